"""The rows that a comparison works on: measured and modelled values of all runs, side by side.

The modelled values are a prediction, or a forward simulation from the inputs of each run. An angle
that was simulated has a known noise floor, that of its encoder at rest; the remainder after all
covariates would be none, for a simulation that drifts is off by something that no channel shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.formatting import padded, percent
from flexspline.forward import simulate
from flexspline.forward.servo import PositionServo
from flexspline.least_squares.problem import away_from_ends, coarser, resolved_rows
from flexspline.logs.channel_noise import ChannelNoise
from flexspline.logs.derive import velocity_noise, with_motion
from flexspline.logs.log import Log
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.read import LogLike
from flexspline.logs.segments import median_step, output_speed
from flexspline.logs.segments import runs as unbroken
from flexspline.model import Model, Part, fitted_to, lowpass_remark, part_warnings, range_warnings
from flexspline.orders import ringing
from flexspline.part import PART_OF
from flexspline.prepared import ACCELERATION, VELOCITY, Preparation, learned, prepared
from flexspline.signals import target_of
from flexspline.simulator import covered, onto_clock, paired

__all__ = [
    "LOADS",
    "Compared",
    "ComparedRun",
    "Rows",
    "load_of",
    "located",
    "only_fast",
    "predicted",
    "resolution",
    "rows_of",
    "simulated",
    "simulated_elsewhere",
    "warned",
]

Array = NDArray[np.float64]

LOADS = ("reference_torque",)

LEAST_ROWS = 200
MOST_LOOKED_AT = 300_000  # for the noise and its memory
MOST_WARNED = 5  # sentences on the model, and on what it was fitted to
BLOCK = 16_384
STILL_IN_NOISE = 3.0  # standard deviations of the velocity that have no direction
_SLOW_OF_USUAL = 1e-2
_STILL_OF_USUAL = 1e-3  # of the speed that 99 % of the rows stay below


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """One run, arrays (N,).

    Parameters
    ----------
    log : with the derived channels that locate a disagreement.
    measured, modelled : in the unit of the comparison; NaN where there is nothing.
    doubt : standard deviation that the velocity's noise gives `modelled`, its unit.
    load : at the output, Nm (A where the model's own load is in a part in A), or None.
    velocity_noise : rad/s, standard deviation; 0 where there is no velocity.
    warnings : what `predict` warns of, a sentence each without its stop.
    """

    log: Log
    measured: Array
    modelled: Array
    doubt: Array
    load: Array | None
    velocity_noise: float
    warnings: tuple[str, ...] = ()

    @property
    def residual(self) -> Array:
        """Measured minus modelled."""
        return self.measured - self.modelled


@dataclass(frozen=True, eq=False)
class Compared:
    """All runs: `what` is compared (a target, or a channel of a simulation) in `unit`.

    `simulated`: by forward simulation. `lowpass`: Hz, or None. `load_source`: where the load of
    the runs is from, in words; `load_unit` where that is the model. `floor`: noise of what is
    measured, where that is known; None where it is to be estimated. `foreign`: the simulation
    that is the base, in words; "" without one. `notes`: sentences on it. `inputs`: noise of each
    channel; `preparations`: how the model read them; `bandwidth`: Hz, as it was asked for.
    `speed_above`: rad/s of the output, below which rows are left out; None for none.
    """

    runs: tuple[ComparedRun, ...]
    what: str
    unit: str
    simulated: bool
    lowpass: float | None
    load_source: str
    load_unit: str = "Nm"
    floor: float | None = None
    foreign: str = ""
    notes: tuple[str, ...] = ()
    inputs: tuple[ChannelNoise, ...] = ()
    preparations: tuple[Preparation, ...] = ()
    bandwidth: float | None = None
    speed_above: float | None = None


def predicted(
    model: Model,
    logs: Sequence[Log],
    target: str | None,
    lowpass: float | None,
    bandwidth: float | None = None,
) -> Compared:
    """Return measured and predicted y of every run.

    `bandwidth`: see `compare`.

    Raises
    ------
    InputError
        Where a log lacks the target or a channel that an effect reads.
    """
    part = model.part(target)
    noise, ways = learned(logs, part.target, part.known_load, bandwidth)
    if bandwidth is None and "prepared" in part.record:
        ways = part.preparations
    if ways != part.preparations:
        part = part.preparing(ways)
        model = replace(model, parts={**model.parts, PART_OF[part.target]: part})
    source = load_source_of(part, logs)
    own = _noise_left(noise, ways)
    runs = tuple(_predicted_run(model, part, log, lowpass, source, own) for log in logs)
    notes = tuple(filter(None, [lowpass_remark(part, lowpass), _seen_by(part, logs, lowpass)]))
    notes += warned(run.warnings for run in runs)
    notes += _ringing(runs, part, ways)
    if part.target != "torsion" and any(way.channel == VELOCITY for way in ways):
        runs, left_out = _resolved(model, part, logs, lowpass, runs)
        notes += left_out
    foreign = part.simulated.words if part.simulated is not None else ""
    return Compared(
        runs, part.target, part.unit, False, lowpass, source, part.unit, foreign=foreign,
        notes=notes, inputs=tuple(noise.values()), preparations=tuple(ways), bandwidth=bandwidth,
    )  # fmt: skip


def _ringing(
    runs: Sequence[ComparedRun], part: Part, ways: Sequence[Preparation]
) -> tuple[str, ...]:
    """A sentence on the mode that motion or load excite in the residual, if there is one."""
    known = {way.channel: way.bandwidth for way in ways}
    asked = filter(None, (ACCELERATION, part.known_load))
    left = [(run.log, run.residual, unbroken(run.log["time"])) for run in runs]
    found = ringing(left, {channel: known.get(channel, np.inf) for channel in asked})
    if found is None:
        return ()
    channel, mode = found
    return (
        f"{percent(mode.share)} of the gap's mean square rings at {mode.frequency:.3g} Hz where "
        f"{channel} excites it: a mode that the model has not, which counts as noise here. Look at "
        "the arm of the load, the couplings and the bench.",
    )


def _seen_by(part: Part, logs: Sequence[Log], lowpass: float | None) -> str:
    """A sentence where the part was fitted to some of the logs, whose errors are then in-sample.

    Where they are all that it was fitted to, with the held-out error of that fit.
    """
    seen = [log.name for log in logs if fitted_to(part, log)]
    if not seen:
        return ""
    if len(seen) < len(logs):
        return f"The model was fitted to {listed(seen)}: its errors there are in-sample."
    said = "The model was fitted to these runs, so its errors here are in-sample"
    scores, by = part.record.get("scores", ()), part.record.get("validated", {}).get("by")
    if not scores or len(part.record["logs"]) != len(logs) or part.record.get("lowpass") != lowpass:
        return f"{said}."
    return (
        f"{said}; on {by} that no fit saw it has {padded(scores[0]['cv_rmse'])} {part.unit} RMSE."
    )


def warned(runs: Iterable[Sequence[str]], of: str = "") -> tuple[str, ...]:
    """Return what each run says against a model, each sentence once; of many the first.

    `of`: a space and what tells the model from others that are compared.
    """
    said = [*dict.fromkeys(sentence for warnings in runs for sentence in warnings)]
    told = [f"Warning{of}: {sentence}." for sentence in said[:MOST_WARNED]]
    if (more := len(said) - MOST_WARNED) > 0:
        told.append(f"{more} more warnings{of} of this kind: predict says them all.")
    return tuple(told)


def _resolved(
    model: Model,
    part: Part,
    logs: Sequence[Log],
    lowpass: float | None,
    runs: Sequence[ComparedRun],
) -> tuple[tuple[ComparedRun, ...], tuple[str, ...]]:
    """The runs without rows whose motion the recorder does not resolve, and how many these are.

    `part`, `lowpass`: by which the model's predictions were made.
    """
    further = part.preparing(coarser(part.preparations))
    blurred = replace(model, parts={**model.parts, PART_OF[part.target]: further})
    both = [
        (run.modelled, blurred.predict(log, part.target, lowpass_hz=lowpass).predicted)
        for run, log in zip(runs, logs, strict=True)
    ]
    told = resolved_rows(logs, [run.measured for run in runs], both)
    made = []
    for run, log, rows in zip(runs, logs, told, strict=True):
        counted = rows & away_from_ends(log, log, part.preparations)
        made.append(replace(run, modelled=np.where(counted, run.modelled, np.nan)))
    left = sum(
        int(np.isfinite(a.residual).sum() - np.isfinite(b.residual).sum())
        for a, b in zip(runs, made, strict=True)
    )
    if not left:
        return tuple(runs), ()
    whole = sum(map(len, logs))
    return tuple(made), (
        f"{left} of {whole} rows are not compared: there, at reversals and at the ends of runs, "
        "the recorder does not resolve the motion.",
    )


def _predicted_run(
    model: Model, part: Part, log: Log, lowpass: float | None, source: str, noise: float
) -> ComparedRun:
    made = model.predict(log, part.target, lowpass_hz=lowpass)
    if not np.isfinite(made.residual).any():
        target_of(log, part.target, part.known_load)  # its sentence says which channel is missing
        raise InputError(
            f"log '{log.name}': no row has a measured and a predicted {part.target}; "
            "look for channels without values"
        )
    log = with_motion(prepared(log, part.preparations))
    load = load_of(model, part, log, source)
    run = located(model, part, log, made.measured, made.predicted, lowpass, load, noise)
    return replace(run, warnings=made.warnings)


def _noise_left(noise: Mapping[str, ChannelNoise], ways: Sequence[Preparation]) -> float:
    """What smoothing leaves of the velocity's noise, rad/s: it is no longer white there."""
    for way in ways:
        if way.channel == VELOCITY and way.source in noise:
            return noise[way.source].within(way.bandwidth, int(way.source != VELOCITY))
    return 0.0


def located(
    model: Model,
    part: Part,
    log: Log,
    measured: Array,
    modelled: Array,
    lowpass: float | None,
    load: Array | None,
    smoothed: float = 0.0,
) -> ComparedRun:
    """Return a run with what locates a disagreement, and what its velocity's noise does to it.

    `part`: of the model, whose friction the noise goes through. `smoothed`: noise that is left of a
    smoothed velocity, rad/s. Others as in `ComparedRun`.
    """
    log = with_motion(log)
    noise = max(velocity_noise(log), smoothed)
    doubt = _doubt(model, part, log, noise)
    if lowpass is not None:  # white noise keeps this share of its size
        doubt = doubt * min(1.0, (2.0 * lowpass * median_step(log["time"])) ** 0.5)
    return ComparedRun(log, measured, modelled, doubt, load, noise)


def _doubt(model: Model, part: Part, log: Log, noise: float) -> Array:
    """Half of what the prediction changes by from v − σ to v + σ, (N,)."""
    chosen = _only(part, [not e.info.remembers and "output_velocity" in e.reads
                          for e in part.effects])  # fmt: skip
    if not chosen.effects or noise == 0.0 or "output_velocity" not in log:
        return np.zeros(len(log))
    small = replace(model, parts={PART_OF[part.target]: chosen})
    velocity = log["output_velocity"]
    late, early = (
        small.predict(
            log.with_columns({"output_velocity": velocity + shift}, note="shifted"), part.target
        ).predicted
        for shift in (noise, -noise)
    )
    return np.nan_to_num(0.5 * np.abs(late - early))


def _only(part: Part, wanted: Sequence[bool]) -> Part:
    """The part with some of its effects."""
    sizes = [len(e.terms) for e in part.effects]
    effects = tuple(e for e, keep in zip(part.effects, wanted, strict=True) if keep)
    kept = np.repeat(np.asarray(wanted, dtype=bool), sizes)
    return replace(part, effects=effects, coefficients=part.coefficients[kept])


def load_source_of(part: Part, logs: Sequence[Log]) -> str:
    """Return what the load of all runs is from, in words; "" where it is not known."""
    for channel in (part.known_load, *LOADS):
        if channel is not None and all(channel in log for log in logs):
            return channel
    carried = [e.name for e in part.effects if e.info.carries_load]
    return f"the model's own {' and '.join(carried)}" if carried else ""


def load_of(model: Model, part: Part, log: Log, source: str) -> Array | None:
    """Return the load at the output, (N,), in the unit of the part; None where it is not known."""
    if source in log:
        return np.asarray(log[source])
    if not source:
        return None
    parts = model.components(log, part.target)
    carried = [parts[e.name] for e in part.effects if e.info.carries_load]
    return np.asarray(np.sum(carried, axis=0))


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows that count, of all runs together, (N,).

    Parameters
    ----------
    residual : in the unit of the comparison.
    run : number of the run.
    starts : first row of each unbroken stretch, as indices.
    direction : 0 standing still, 1 forward, 2 backward; 0 where there is no velocity.
    allowance : mean shift of the residual that the velocity's noise may cause, its unit.
    doubt : standard deviation of the same.
    still : for each run, rad/s that count as standing still.
    slow : for each run, rad/s below which nothing is a reversal, as in `logs/segments.py`.
    counts : for each run, which of its rows are here.
    floor : noise of what is measured, where it is known.
    """

    residual: Array
    run: NDArray[np.int32]
    starts: NDArray[np.intp]
    direction: NDArray[np.int8]
    allowance: Array
    doubt: Array
    still: tuple[float, ...]
    slow: tuple[float, ...]
    counts: tuple[NDArray[np.bool_], ...]
    floor: float | None = None

    def __len__(self) -> int:
        return len(self.residual)

    @cached_property
    def looked_at(self) -> tuple[tuple[int, int], ...]:
        """Unbroken pieces (start, stop); of many rows shorter ones, evenly spread."""
        whole = list(pairwise([*self.starts.tolist(), len(self)]))
        every = -(-len(self) // MOST_LOOKED_AT)
        if every == 1:
            return tuple(whole)
        cut = [(a, min(a + BLOCK, b)) for first, b in whole for a in range(first, b, BLOCK)]
        return tuple(cut[::every])

    def column(self, compared: Compared, of: Callable[[ComparedRun, int], Array]) -> Array:
        """Put together a value for each row: `of` gives one for each row of run number k."""
        made = (of(run, k)[keep] for k, (run, keep) in enumerate(zip(compared.runs, self.counts,
                                                                     strict=True)))  # fmt: skip
        return np.concatenate([np.asarray(values, dtype=np.float64) for values in made])


def rows_of(compared: Compared) -> Rows:
    """Return the rows with a measured and a modelled value.

    Raises
    ------
    InputError
        Where they are too few to be judged.
    """
    counts = tuple(np.isfinite(run.residual) for run in compared.runs)
    if sum(int(c.sum()) for c in counts) < LEAST_ROWS:
        raise InputError(
            f"the logs have {sum(int(c.sum()) for c in counts)} rows to compare and "
            f"{LEAST_ROWS} are needed at least; give longer runs"
        )
    still = tuple(_still(run, _STILL_OF_USUAL) for run in compared.runs)
    slow = tuple(_still(run, _SLOW_OF_USUAL) for run in compared.runs)
    parts = [
        (run.residual[keep], *_moving(run, limit, keep))
        for run, limit, keep in zip(compared.runs, still, counts, strict=True)
    ]
    residual, direction, allowance, doubt = (
        np.concatenate(columns) for columns in zip(*parts, strict=True)
    )
    sizes = [int(c.sum()) for c in counts]
    run = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)
    return Rows(residual, run, _starts(compared, counts), direction.astype(np.int8), allowance,
                doubt, still, slow, counts, compared.floor)  # fmt: skip


def _still(run: ComparedRun, share: float) -> float:
    if "output_velocity" not in run.log:
        return 0.0
    usual = float(np.nanpercentile(np.abs(run.log["output_velocity"]), 99))
    return max(STILL_IN_NOISE * run.velocity_noise, share * usual)


def _moving(
    run: ComparedRun, still: float, keep: NDArray[np.bool_]
) -> tuple[NDArray[np.int8], Array, Array]:
    """Direction, allowance and doubt of the rows kept."""
    doubt = run.doubt[keep]
    if "output_velocity" not in run.log:
        return np.zeros(len(doubt), dtype=np.int8), np.zeros(len(doubt)), doubt
    velocity = run.log["output_velocity"][keep]
    direction = np.where(velocity > still, 1, np.where(velocity < -still, 2, 0))
    near = np.abs(velocity) <= (STILL_IN_NOISE + 1.0) * run.velocity_noise
    return direction.astype(np.int8), np.where(near, doubt, 0.0), doubt


def only_fast(compared: Compared, least: float) -> Compared:
    """Return the runs without rows whose output is slower than `least`, rad/s.

    Raises
    ------
    InputError
        Where a run tells no velocity, or too few rows are so fast.
    """
    speeds = [output_speed(run.log, least) for run in compared.runs]
    runs = tuple(
        replace(run, modelled=np.where(speed >= least, run.modelled, np.nan))
        for run, speed in zip(compared.runs, speeds, strict=True)
    )
    before, kept = (sum(int(np.isfinite(one.residual).sum()) for one in each)
                    for each in (compared.runs, runs))  # fmt: skip
    if before and kept < LEAST_ROWS:
        raise InputError(
            f"{kept} rows of the logs move at {least:g} rad/s or more, and {LEAST_ROWS} are needed "
            f"at least; the fastest moves at {max(map(np.nanmax, speeds)):.3g} rad/s; give a lower "
            "speed_above or longer runs"
        )
    note = f"{before - kept} of {before} rows are slower than {least:g} rad/s and not compared."
    return replace(compared, runs=runs, notes=(*compared.notes, note), speed_above=least)


def _starts(compared: Compared, counts: tuple[NDArray[np.bool_], ...]) -> NDArray[np.intp]:
    found, first = [], 0
    for run, keep in zip(compared.runs, counts, strict=True):
        time = run.log["time"][keep]
        if len(time):
            found.append(first + unbroken(time)[:, 0])
        first += len(time)
    return np.concatenate(found)


def simulated(
    model: Model, logs: Sequence[Log], target: str | None, controller: PositionServo | None
) -> Compared:
    """Return measured and simulated motion of every run; of a sensor, its reading.

    Raises
    ------
    InputError
        Where a run cannot be simulated, or lacks the channel to compare with.
    """
    part = model.part(target)
    source = load_source_of(part, logs)
    runs, channel, unit = [], "", ""
    for log in logs:
        made = simulate(model, log, target=target, controller=controller)
        channel, unit = made.channel, made.unit
        if not np.isfinite(made.residual).any():
            raise InputError(
                f"log '{log.name}': has no {channel} to compare the simulation with; map a column "
                "to it"
            )
        log = with_motion(log)
        nothing = np.zeros(len(log))
        load = load_of(model, part, log, source)
        inputs = with_motion(prepared(log, part.preparations))
        said = (*part_warnings(part), *range_warnings(part, inputs))
        runs.append(
            ComparedRun(
                log, made.measured, made.simulated, nothing, load, velocity_noise(log), said
            )
        )
    floor = resolution([run.measured for run in runs]) if channel == "output_position" else None
    return Compared(
        tuple(runs),
        channel,
        unit,
        True,
        None,
        source,
        part.unit,
        floor,
        notes=warned(run.warnings for run in runs),
    )


def simulated_elsewhere(logs: Sequence[Log], simulation: LogLike | Sequence[LogLike]) -> Compared:
    """Return measured angles of the output, and those that a foreign simulation gives.

    Raises
    ------
    InputError
        Where a run or its simulation has no output_position, or the simulation is of another span.
    """
    runs, notes = [], []
    for log, other in zip(logs, paired(logs, simulation), strict=True):
        for one in (log, other):
            if "output_position" not in one:
                raise InputError(
                    f"log '{one.name}': has no output_position to compare the motion by; map a "
                    "column to it"
                )
        angle = onto_clock(log, other, other["output_position"])
        log, left = covered(log, angle)
        angle = angle[np.isfinite(angle)]
        notes += [f"{log.name}: {found.sentence}" for found in left]
        log = with_motion(log)
        load = np.asarray(log[LOADS[0]]) if LOADS[0] in log else None
        measured = np.asarray(log["output_position"])
        nothing = np.zeros(len(log))
        runs.append(ComparedRun(log, measured, angle, nothing, load, velocity_noise(log)))
    source = LOADS[0] if all(run.load is not None for run in runs) else ""
    made = tuple(run if source else replace(run, load=None) for run in runs)
    floor = resolution([run.measured for run in made])
    return Compared(
        made, "output_position", "rad", True, None, source, "Nm", floor,
        "files of its own", tuple(notes),
    )  # fmt: skip


def resolution(angles: Sequence[NDArray[np.float64]]) -> float:
    """Return the RMS of the noise of measured angles, rad: white noise or their counts."""
    found = [
        max(white_noise(angle), quantum(angle) / np.sqrt(12.0))
        for angle in angles
        if np.isfinite(angle).all()
    ]
    return float(np.sqrt(np.mean(np.square(found)))) if found else 0.0
