"""Simulated rigs: logs of a joint that has more physics than the models fitted to it.

A rig that contains exactly the model under test proves nothing.
"""

from flexspline.logs.segments import play
from flexspline.rigs.full_range import FullRangeRig, full_range_rig
from flexspline.rigs.sensor import FACTS, Rig, Truth, sensor_rig
from flexspline.rigs.turlapati import TurlapatiRig, turlapati_rig
from flexspline.rigs.zhang import ZhangRig, zhang_rig

__all__ = [
    "FACTS",
    "FullRangeRig",
    "Rig",
    "Truth",
    "TurlapatiRig",
    "ZhangRig",
    "full_range_rig",
    "play",
    "sensor_rig",
    "turlapati_rig",
    "zhang_rig",
]


def __dir__() -> list[str]:
    return __all__
