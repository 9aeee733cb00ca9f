"""`compare`: where a model and logs disagree, against the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tqdm import tqdm

from flexspline.errors import InputError

if TYPE_CHECKING:
    from flexspline.comparison.result import Comparison
    from flexspline.forward.servo import PositionServo
    from flexspline.logs.log import Log
    from flexspline.model import Model

__all__ = ["compare"]


def compare(
    model: Model,
    logs: Log | Sequence[Log],
    *,
    target: str | None = None,
    lowpass: float | None = None,
    simulated: bool = False,
    controller: PositionServo | None = None,
    progress: bool = False,
) -> Comparison:
    """Say where a model and logs disagree. No parameter is touched.

    Parameters
    ----------
    model : with a part for the target.
    logs : one or several runs of its joint.
    target : which part, where the model has several.
    lowpass : Hz; zero phase, on measured and predicted alike.
    simulated : compare a forward simulation (see `flexspline.simulate`) instead of the prediction:
        of a drive or a torsion the output's angle, of a sensor its reading.
    controller : the servo law that drives the simulation, where the motor torque is not measured.
    progress : show what is being done on standard error.

    Returns
    -------
    Comparison
        Residual (measured − predicted) against its noise floor, overall and by run, direction,
        speed, load, temperature, angle, acceleration, distance from the last reversal, time and
        order of what turns.

    Raises
    ------
    InputError
        Where a log lacks a channel, is of another joint, or holds too few rows.

    Notes
    -----
    Sources: `comparison/search.py` (what the residual follows), `comparison/memory.py` (effective
    samples), `comparison/velocity.py` (errors in variables).
    """
    from flexspline.comparison.analysis import analysed
    from flexspline.comparison.assemble import assembled
    from flexspline.comparison.runs import predicted
    from flexspline.comparison.simulated import simulated as by_simulation
    from flexspline.logs.log import Log

    runs = [logs] if isinstance(logs, Log) else list(logs)
    if not runs:
        raise InputError("there is no log to compare with; give at least one")
    if controller is not None and not simulated:
        raise InputError("a controller drives a simulation; leave it out or give simulated")
    if simulated and lowpass is not None:
        raise InputError("a low pass is for predictions; leave lowpass out where simulated")
    with tqdm(desc="predicting", total=4, disable=not progress, leave=False, delay=1.0) as bar:

        def say(what: str) -> None:
            bar.update()
            bar.set_description(what)

        if simulated:
            compared = by_simulation(model, runs, target, controller)
        else:
            compared = predicted(model, runs, target, lowpass)
        made = analysed(compared, say)
        say("bands")
        return assembled(compared, made, model.facts)
