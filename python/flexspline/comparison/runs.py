"""What a comparison is made of: measured and modelled values of each run.

Prediction and forward simulation both end here; whatever follows does not know which it was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.least_squares.problem import away_from_ends, coarser, resolved_rows
from flexspline.logs.channel_noise import ChannelNoise
from flexspline.logs.derive import velocity_noise, with_motion
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step
from flexspline.model import Model, Part
from flexspline.part import PART_OF
from flexspline.prepared import VELOCITY, Preparation, learned, prepared
from flexspline.signals import target_of

__all__ = ["LOADS", "Compared", "ComparedRun", "load_of", "load_source_of", "located", "predicted"]

Array = NDArray[np.float64]

LOADS = ("reference_torque",)


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
    """

    log: Log
    measured: Array
    modelled: Array
    doubt: Array
    load: Array | None
    velocity_noise: float

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
    notes: tuple[str, ...] = ()
    if part.target != "torsion" and any(way.channel == VELOCITY for way in ways):
        runs, notes = _resolved(model, part, logs, lowpass, runs)
    foreign = part.simulated.words if part.simulated is not None else ""
    return Compared(
        runs, part.target, part.unit, False, lowpass, source, part.unit, foreign=foreign,
        notes=notes, inputs=tuple(noise.values()), preparations=tuple(ways), bandwidth=bandwidth,
    )  # fmt: skip


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
    return located(model, part, log, made.measured, made.predicted, lowpass, load, noise)


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
