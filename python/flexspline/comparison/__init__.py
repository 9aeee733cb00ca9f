"""`compare`: where a model and logs disagree, against the noise floor.

Against a simulation, the model is a part without effects, whose prediction is the simulation's.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexspline.errors import InputError
from flexspline.logs.derive import increasing_time
from flexspline.logs.log import Log, measurable
from flexspline.model import PART_OF, Model, Part, require_model
from flexspline.progress import Progress
from flexspline.signals import require_apart
from flexspline.simulator import Remark, take

if TYPE_CHECKING:
    from flexspline.comparison.result import Comparison
    from flexspline.forward.servo import PositionServo
    from flexspline.logs.read import LogLike

__all__ = [
    "Base",
    "based",
    "compare",
]

FACTS = ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant")


def compare(
    model: Model | None,
    logs: LogLike | Iterable[LogLike],
    *,
    target: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    simulated: bool = False,
    controller: PositionServo | None = None,
    simulation: LogLike | Sequence[LogLike] | None = None,
    simulated_torque: str | None = None,
    simulated_motion: bool = False,
    known_load: str | None = None,
    speed_above: float | None = None,
    progress: bool = False,
) -> Comparison:
    """Say where a model, or any simulation, and logs disagree. No parameter is touched.

    Parameters
    ----------
    model : with a part for the target; None where a simulation is the base.
    logs : one or several runs (as `read_log` takes them) of its joint.
    target : which part, where the model has several.
    lowpass : Hz; zero phase, on measured and predicted alike.
    bandwidth : Hz, -3 dB to which the motion of the output is smoothed before the model reads it.
        None: channels are made as in the runs that the model was fitted to, or where it says
        nothing of that, noisy ones as these runs tell (`Comparison.inputs`); ``float("inf")``: all
        are read as recorded.
    simulated : compare a forward simulation (see `flexspline.simulate`) instead of the prediction:
        of a drive or a torsion the output's angle, of a sensor its reading.
    controller : the servo law that drives the simulation, where the motor torque is not measured.
    simulation : one log for each run, in their order, that any simulator made, with time stamps of
        the runs' clock. It is the base: what it says is compared.
    simulated_torque : its column, or without `simulation` that of the runs, in the unit of the
        target, at the output. By default `simulated_torque`, or else the target's own channel.
    simulated_motion : compare its output_position [rad] instead of a torque.
    known_load : channel that holds τ_load [Nm], beside a simulated torque.
    speed_above : rad/s; rows whose output is slower are left out. The speed is that of
        output_velocity, or of the derivative of output_position.
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
        Where a log lacks a channel, is of another joint, or holds too few rows (so fast); and
        unless exactly one of a model and a simulation is the base.

    Notes
    -----
    Sources: `comparison/search.py` (what the residual follows), `logs/derive.py` (errors in
    variables), `comparison/covariates.py`.
    """
    from flexspline.comparison.result import assembled
    from flexspline.comparison.runs import only_fast, predicted, simulated_elsewhere
    from flexspline.comparison.runs import simulated as by_simulation
    from flexspline.comparison.search import analysed
    from flexspline.logs.read import as_logs

    runs = as_logs(logs)
    if not runs:
        raise InputError("there is no log to compare with; give at least one")
    require_apart(runs)
    runs, emptied = _measurable(runs)
    if controller is not None and not simulated:
        raise InputError("a controller drives a simulation; leave it out or give simulated")
    foreign = simulation is not None or simulated_torque is not None
    _require_one_base(model, foreign, simulated, simulation, simulated_torque, simulated_motion)
    if (simulated or simulated_motion) and lowpass is not None:
        raise InputError("a low pass is for predictions; leave lowpass out where simulated")
    if (simulated or simulated_motion) and bandwidth is not None:
        raise InputError("a bandwidth is for predictions; leave bandwidth out where simulated")
    with Progress("comparing", progress) as bar:
        notes = emptied
        if foreign and not simulated_motion:
            base = based(model, runs, target, known_load, simulation, simulated_torque)
            model, runs = base.model, base.logs
            notes += tuple(remark.sentence for remark in base.remarks)
        if simulated_motion:
            assert simulation is not None
            compared = simulated_elsewhere(runs, simulation)
        else:
            assert model is not None
            compared = (
                by_simulation(model, runs, target, controller)
                if simulated
                else predicted(model, runs, target, lowpass, bandwidth)
            )
        compared = replace(compared, notes=(*compared.notes, *notes))
        if speed_above is not None:
            compared = only_fast(compared, speed_above)
        made = analysed(compared, bar.say)
        bar.say("bands")
        return assembled(compared, made, model.facts if model else dict(runs[0].facts))


def _measurable(runs: Sequence[Log]) -> tuple[list[Log], tuple[str, ...]]:
    """The runs with what no instrument reads as empty, and a sentence for each such channel.

    Raises
    ------
    InputError
        Where the time of a run does not increase.
    """
    made: list[Log] = []
    said: list[str] = []
    for run in runs:
        log, sentences = measurable(run)
        increasing_time(log, "a comparison")
        made.append(log)
        said += [f"{sentence}." for sentence in sentences]
    return made, tuple(said)


def _require_one_base(
    model: Model | None,
    foreign: bool,
    simulated: bool,
    simulation: object,
    simulated_torque: str | None,
    simulated_motion: bool,
) -> None:
    if model is None and not foreign:
        raise InputError(
            "there is nothing to compare with; give exactly one of a model and a simulation"
        )
    if model is not None:
        require_model(model)
    if simulated and foreign:
        raise InputError("simulated drives the model; leave it out where a simulation is the base")
    if not simulated_motion:
        return
    if simulation is None or simulated_torque is not None or model is not None:
        raise InputError(
            "simulated_motion compares the output_position of a simulation; give simulation, and "
            "neither a model nor simulated_torque"
        )


@dataclass(frozen=True)
class Base:
    """A model to start from, the runs with what it reads, and what there is to say of these."""

    model: Model
    logs: list[Log]
    remarks: tuple[Remark, ...]


def based(
    model: Model | None,
    logs: Sequence[Log],
    target: str | None,
    known_load: str | None,
    simulation: LogLike | Sequence[LogLike] | None,
    column: str | None,
) -> Base:
    """Return the base that a simulation makes, alone or beneath the model that corrects it.

    Parameters
    ----------
    model : None, or one whose part for the target corrects this simulation.
    simulation, column : as for `take`; not None both.

    Raises
    ------
    InputError
        As `take`; for a model that is a base by itself, and where no target is given.
    """
    if model is None:
        if target is None:
            raise InputError("no target is given; give target='sensor_torque' or another one")
        taken = take(logs, target, known_load, simulation, column)
        part = Part(target, (), np.zeros(0), known_load, simulated=taken.simulated)
        facts = {key: logs[0].facts[key] for key in FACTS if key in logs[0].facts}
        return Base(Model({PART_OF[target]: part}, facts), list(taken.logs), taken.remarks)
    part = model.part(target)
    if part.simulated is None:
        raise InputError(
            "a model and a simulation are given, and each is a base by itself; give exactly one of "
            "effects, a model, and a simulation"
        )
    known_load = known_load or part.known_load
    taken = take(logs, part.target, known_load, simulation, column)
    simulated = replace(taken.simulated, holds_load=part.simulated.holds_load)
    part = replace(part, known_load=known_load, simulated=simulated)
    parts = {**model.parts, PART_OF[part.target]: part}
    return Base(replace(model, parts=parts), list(taken.logs), taken.remarks)
