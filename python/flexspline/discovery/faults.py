"""Faults of the data, looked for before any physics, and the error that each of them induces.

A fault of size r [target's unit, RMS] beside a noise floor σ raises the error from σ to √(σ² + r²).
One that raises it by less than a hundredth is worth knowing, and no reason to reject a name.

    delay of a velocity          r: prediction with the velocity as recorded less with the right one
    rows that repeat others      r: each is wrong by one step of the target, √(share · mean step²)

The induced error of another fault is not known, and it counts as critical.

The clock of a load cell may be late. A load L that is late by d leaves, to first order,

    d · c(t),     c = −L′ ∂(y − X β)/∂L

of target y and model X β, with L′ the slope of the load as rows read it. Missing effects may depend
on the load too, so d is estimated beside everything that may be missing: all candidates of the
search and flexible functions of every channel [FrischWaugh1933], before any name is looked for. The
delay of a recorder is the same in all folds: their scatter is part of its error. Names that are
found later make it more precise, within that error.

A sensor cannot read a torque before it is there: where its reading is ahead, the load is late.
Where it is behind, the sensor may be: that is an effect, and to be named. Between the torque of a
drive, or a torsion, and the load cell any delay is one of the recorder.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.constants import milli

from flexspline.discovery.analysis import Analysis, FirstLook
from flexspline.discovery.basis import RATE, Functions, flexible_basis
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import Effect
from flexspline.effects.causes import LAG
from flexspline.errors import InputError
from flexspline.formatting import short
from flexspline.least_squares.late_load import slopes_by
from flexspline.least_squares.result import Fit
from flexspline.logs.checks import check_runs
from flexspline.logs.checks.consistency import (
    DRIVE,
    MOVED,
    POSITION_DELAY,
    TOLD,
    TORQUE_DELAY,
    late_alike,
    measured_gear,
)
from flexspline.logs.checks.findings import NO_TORSION, Finding
from flexspline.logs.checks.samples import DROPPED, unwrapped
from flexspline.logs.log import Log
from flexspline.logs.repairs import move_earlier
from flexspline.logs.segments import median_step
from flexspline.model import Model
from flexspline.regression.gram import SINGULAR, TINY, Table, left_by, solved, tabulated
from flexspline.signals import target_of

__all__ = ["SENSOR", "DataFault", "Delay", "data_faults", "delay_behind", "delay_beside_everything",
           "graded", "lead_of", "load_delays", "with_measured_ratio", "with_torque_on_time",
           "with_unwrapped_angles"]  # fmt: skip

RATIO = "gear_ratio"
WRAPPED = "wrapped_angle"
ENCODER_DELAY = "encoder_delay"
HALF_A_ROW = 0.5  # more than that a run may be late by alone: another clock
SIGN = "torque_sign"  # this and a small delay are a recorder's where half of the runs show them
NO_TWIST = tuple(name for name in NO_TORSION if name != RATIO)

Array = NDArray[np.float64]

VELOCITY = "output_velocity"
SENSOR = ("sensor_torque",)


@dataclass(frozen=True)
class DataFault:
    """A fault of one run: `name` of the check, channel, size in `unit`, rows [first, last).

    `makes`: RMS of what it makes of the target, in its unit, None where that is not known. `grave`:
    whether it matters beside the noise floor (`graded`). `left_out`: these rows were left out of
    all that follows.
    """

    run: str
    name: str
    channel: str
    size: float
    unit: str
    rows: tuple[int, int]
    sentence: str
    makes: float | None = None
    grave: bool = True
    left_out: bool = False

    @classmethod
    def of(cls, run: str, found: Finding, sentence: str, **more: bool) -> DataFault:
        """What a check has found in a run, in these words."""
        size, rows = found.size, found.rows
        return cls(run, found.name, found.channel, size, found.unit, rows, sentence, **more)


def data_faults(
    logs: Sequence[Log],
    base: Sequence[Effect],
    target: str,
    known_load: str | None,
    threads: int = 1,
) -> tuple[DataFault, ...]:
    """Return the faults of all runs.

    Raises
    ------
    InputError
        Where a fault makes every fit meaningless. A ratio that the encoders contradict does not:
        they show the right one, see `with_measured_ratio`.
    """
    elsewhere = known_load not in (None, "reference_torque")
    asked = [e.name for e in base if not (e.own or (elsewhere and "load" in e.reads))]
    found, checks = [], check_runs(logs, effects=asked, target=target, threads=threads)
    for log, findings in zip(logs, checks, strict=True):
        findings.raise_errors()
        if target == "torsion":
            findings.raise_named(NO_TWIST)
        few = SETTINGS.negligible * len(log)  # of them a fit takes both sides apart
        found += [
            DataFault.of(log.name, f, f"{log.name}: {f.sentence} {f.remedy}".rstrip(),
                         grave=f.name != DROPPED or f.size > few)
            for f in findings.faults
        ]  # fmt: skip
    late = {f.run for f in found if f.name == ENCODER_DELAY}
    if late:
        gears = {log.name: gear for log in logs if (gear := measured_gear(log)) is not None}
        if 2 * len(late) < len(logs) or not late_alike([*gears.values()]):
            row = {log.name: median_step(log["time"]) for log in logs}
            least = {run: abs(one.delay) - TOLD * one.delay_error for run, one in gears.items()}
            found = [f for f in found if f.name != ENCODER_DELAY
                     or least[f.run] > HALF_A_ROW * row[f.run]]  # fmt: skip
    flipped = Counter(f.channel for f in found if f.name == SIGN)
    rare = [channel for channel, runs in flipped.items() if 2 * runs < len(logs)]
    return tuple(f for f in found if not (f.name == SIGN and f.channel in rare))


def with_unwrapped_angles(
    logs: Sequence[Log], faults: Sequence[DataFault]
) -> tuple[list[Log], tuple[DataFault, ...]]:
    """Return the runs with the angles that wrap unwrapped; the fault's sentence then says so.

    Orders of a motor's angle that jumps at each turn would be those of no machine.
    """
    wraps = {(fault.run, fault.channel) for fault in faults if fault.name == WRAPPED}
    whole = []
    for log in logs:
        angles = {name: unwrapped(log, name) for run, name in sorted(wraps) if run == log.name}
        note = f"unwrapped for the search: {', '.join(angles)}"
        whole.append(log.with_columns(angles, note=note) if angles else log)
    said = "Names are looked for with the unwrapped angle."
    told = [replace(f, sentence=f"{f.sentence} {said}") if f.name == WRAPPED else f for f in faults]
    return whole, tuple(told)


def with_measured_ratio(
    logs: Sequence[Log], faults: Sequence[DataFault], target: str
) -> tuple[list[Log], tuple[DataFault, ...]]:
    """Return the runs with the ratio that their encoders show, where a torsion would be nothing.

    With a wrong ratio q Ñ − θ grows with every turn. The fault's sentence then says which one is
    used. One that is off by a little, and no whole number, may be a torsion that follows the angle.
    """
    shown = [fault.size for fault in faults if fault.name == RATIO]
    stated = logs[0].effective_ratio
    if target != "torsion" or not shown or stated is None:
        return list(logs), tuple(faults)
    ratio = float(np.median(shown))
    near = abs(ratio / stated - 1.0) < SETTINGS.negligible
    if near and abs(ratio - round(ratio)) > SETTINGS.bends:
        return list(logs), tuple(faults)
    circular = logs[0].facts.get("output_spline") == "circular"
    said = f"What follows is with {ratio:.5g} turns of the motor side per turn of the output."
    mended = [log.with_facts({"gear_ratio": ratio - circular}, note=said) for log in logs]
    told = [replace(f, sentence=f"{f.sentence} {said}") if f.name == RATIO else f for f in faults]
    return mended, tuple(told)


def with_torque_on_time(
    logs: Sequence[Log], faults: Sequence[DataFault], target: str
) -> tuple[list[Log], tuple[DataFault, ...], float]:
    """Return the runs with a torque that half and more show late, or a motion that most do.

    Friction that is late looks like presliding, and so does a motion that is. Where the torque is
    late all else is moved later, for a target that is interpolated has another noise, and friction
    that turns over within a row is blurred; a motion that is late is moved itself. The fault's
    sentence then says by how much. Last comes by how much the target was late, s; 0 for none.
    """
    read = SENSOR if target in SENSOR else DRIVE
    torque = [f for f in faults if f.name == TORQUE_DELAY and f.channel in read and target in read]
    late = torque or [f for f in faults if f.name == POSITION_DELAY and target in SENSOR]
    has = [log for log in logs if any(name in log for name in read)]
    seen = max(Counter(fault.channel for fault in late).values(), default=0)
    if not late or 2 * seen < len(has) + (not torque):
        return list(logs), tuple(faults), 0.0
    seconds = float(np.median([fault.size for fault in late]))

    def moved(log: Log) -> Log:
        rest = [name for name in log.channels if name not in ("time", *read)]
        names = rest if torque else [name for name in MOVED if name in log]
        return move_earlier(log, names[0], -seconds if torque else seconds, *names[1:])

    size = f"{short(seconds / milli)} ms"
    said = f"all else moved {size} later" if torque else f"the motion moved {size} earlier"
    middle = ", the median of the runs" if len({fault.size for fault in late}) > 1 else ""
    said = f"Names are looked for with {said}{middle}."
    told = [replace(f, sentence=f"{f.sentence} {said}") if f in late else f for f in faults]
    on_time = [moved(log) if log in has else log for log in logs]
    return on_time, tuple(told), seconds if torque else 0.0


def graded(
    faults: Sequence[DataFault], logs: Sequence[Log], fit: Fit, floor: float
) -> tuple[DataFault, ...]:
    """Return the faults with what each makes of the target, and whether that matters.

    Parameters
    ----------
    logs : the runs as recorded, the rows that count.
    fit : of the extended model.
    floor : noise floor, in the unit of the target.
    """
    by_name = Counter(log.name for log in logs)
    alone = {log.name: log for log in logs if by_name[log.name] == 1}
    return tuple(_graded(fault, alone.get(fault.run), fit, floor) for fault in faults)


def _graded(fault: DataFault, log: Log | None, fit: Fit, floor: float) -> DataFault:
    try:
        makes = None if log is None else _makes(fault, log, fit)
    except InputError:  # where the fault cannot be taken off, its size is not known
        makes = None
    if makes is None or not np.isfinite(makes):
        return fault
    grave = bool(np.hypot(floor, makes) > (1.0 + SETTINGS.negligible) * floor)
    size = f"{short(makes)} {fit.unit} RMS beside noise of at most {short(floor)} {fit.unit}"
    said = f"It makes {size}{'.' if grave else ': too little to matter.'}"
    source = {p.channel: p.source for p in fit.part.preparations}.get(VELOCITY, VELOCITY)
    if fault.channel == VELOCITY and source != VELOCITY:
        said = (
            f"Names are looked for with a velocity derived from {source}; as recorded it makes "
            f"{size}."
        )
    elif fault.channel == VELOCITY and grave:
        said = (
            f"Names are looked for with it as recorded; by itself it makes {size}, of which the "
            "model takes up a part."
        )
    return replace(fault, makes=makes, grave=grave, sentence=f"{fault.sentence} {said}")


def _makes(fault: DataFault, log: Log, fit: Fit) -> float | None:
    """RMS of what a fault makes of the target; None where that is not known."""
    if fault.name == "velocity_delay" and fault.channel == VELOCITY:
        moved = move_earlier(log, VELOCITY, fault.size)
        both = [_as_recorded(fit, one) for one in (log, moved)]
        _, first, second = np.intersect1d(log["time"], moved["time"], return_indices=True)
        return float(np.sqrt(np.nanmean((both[0][first] - both[1][second]) ** 2)))
    if fault.name == "repeated_rows":
        steps = np.diff(target_of(log, fit.target, fit.part.known_load))
        return float(np.sqrt(fault.size / len(log) * np.mean(steps**2)))
    return None


def _as_recorded(fit: Fit, log: Log) -> Array:
    """The prediction with the channels as they are, low-passed as the fit's rows were."""
    record = {name: value for name, value in fit.part.record.items() if name != "prepared"}
    plain: Model = fit.model.with_part(replace(fit.part, record=record), {})
    return plain.predict(log, fit.target, lowpass_hz=fit.lowpass).predicted


@dataclass(frozen=True)
class Delay:
    """By how much the load is later than the target, s, and the standard error."""

    seconds: float = 0.0
    error: float = np.inf

    @property
    def significant(self) -> bool:
        return abs(self.seconds) > SETTINGS.told * self.error

    def bears_out(self, seconds: float) -> bool:
        """Whether a delay lies within the error of this one, which would tell it from none."""
        reach = SETTINGS.told * self.error
        return abs(seconds - self.seconds) <= reach < abs(seconds)


def delay_beside_everything(look: FirstLook) -> Delay:
    """Return the delay of the known load beside all that may be missing."""
    context, work = look.part, look.base.without(LAG)
    problem = context.problem
    load = problem.known_load
    static = [g for g in flexible_basis(problem, pairs=False)
              if RATE not in g.channels and not (g.past and load in g.channels)]  # fmt: skip
    beside = [e for c in context.candidates(work.effects) if c.name != LAG for e in c.effects]
    given = Functions(tuple(static), slopes_by(problem, work.effects, work.coefficients))
    assembly = work.assembly(beside=list(dict.fromkeys(beside)), given=given)
    return _last_column(tabulated(problem, assembly, look.noise))


def _last_column(table: Table) -> Delay:
    """The coefficient of the last column beside all others; its error by noise or by folds."""
    model = np.arange(len(table.total) - 2)
    squares = float(left_by(table.total, model)[-2, -2])
    if squares <= SINGULAR * table.total[-2, -2]:
        return Delay()
    left = np.append(-solved(table.total, model), [0.0, 1.0])
    own = np.append(-solved(table.total[:-1, :-1], model), [1.0, 0.0])
    weight = np.maximum([own @ fold @ own for fold in table.folds], TINY)
    told = np.array([own @ fold @ left for fold in table.folds]) / weight
    late = float(np.average(told, weights=weight))
    scatter = float(np.average((told - late) ** 2, weights=weight)) / max(len(told) - 1, 1)
    return Delay(late, float(np.sqrt(max(1.0 / squares, scatter))))


def delay_behind(made: Analysis) -> Delay:
    """Return the delay of a load whose torsion the model predicts.

    What a late load leaves follows d dp/dt of the prediction p, beside the columns of all names,
    those that were taken back included. What no name explains may follow it too: the error is
    doubled beside that.
    """
    problem, searcher = made.context.problem, made.searcher
    taken = {step.effect.name: step.effect for step in made.steps}
    back = [taken[name] for name in made.rejected if name in taken]
    work, _ = searcher.fitted(made.final.with_effects(*back))
    slopes = tuple(
        np.gradient(work.predict(problem, number), run.log["time"])
        for number, run in enumerate(problem.runs)
    )
    assembly = work.assembly(given=Functions(column=slopes))
    late = _last_column(tabulated(problem, assembly, searcher.whitening))
    return replace(late, error=2.0 * late.error) if made.leftover.groups else late


def lead_of(made: Analysis) -> Delay:
    """Return by how much the sensor is ahead of its load by the lag of the final model, if any."""
    work = made.final
    if LAG not in [effect.name for effect in work.effects]:
        return Delay()
    dictionary = made.searcher.context.dictionary(work, made.searcher.whitening)
    lead = -float(work.values(LAG)[0])
    return Delay(lead, abs(lead) / np.sqrt(max(dictionary.gain(LAG), TINY)))


def load_delays(logs: Sequence[Log], target: str, load: str, late: float) -> tuple[DataFault, ...]:
    """Return the fault of each run whose known load is late by so much against the target, s."""
    channel, other = (load, target) if late > 0.0 or target == "torsion" else (target, load)
    why = ", which cannot read a torque before it is there" if target in SENSOR else ""
    size, early = abs(late), channel == load and late < 0.0
    said = (
        f"{channel} is {size / milli:.3g} ms {'early' if early else 'late'} against {other}{why}; "
        f"names are looked for with {load} moved by that much. "
        f"Ask for the repair shift={channel}:{late if early else size:.3g}."
    )
    return tuple(
        DataFault(log.name, "load_delay", channel, size, "s", (0, len(log)), f"{log.name}: {said}")
        for log in logs
    )
