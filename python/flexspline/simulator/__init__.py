"""A foreign simulation as the base: what any simulator predicts for the runs, beside them.

    y = what the simulation says + what it lacks

`record.py` is what a model keeps of it, `taken.py` brings it onto the clock of each run, `delay.py`
looks for a delay between measured and simulated values. `comparison/base.py` makes it the base.
"""

from flexspline.simulator.record import SIMULATED, Simulated, SimulatedFile

__all__ = ["SIMULATED", "Simulated", "SimulatedFile"]
