"""Simulated rigs: logs of a joint that has more physics than the models fitted to it.

A rig that contains exactly the model under test proves nothing.
"""

from flexspline.rigs.sensor import FACTS, Rig, Truth, play, sensor_rig
from flexspline.rigs.turlapati import TurlapatiRig, turlapati_rig

__all__ = ["FACTS", "Rig", "Truth", "TurlapatiRig", "play", "sensor_rig", "turlapati_rig"]
