"""Held-out residuals by slices of the data: where the gap was, and where it shrank.

The held-out residuals of the base and of the extended model are sorted by run, frequency, order,
direction, speed, temperature, load, and distance from a reversal.

For bands of frequency, and of orders of the output, each unbroken stretch is turned into cosines
(DCT-II, orthonormal): it does not take the step between its last row and its first for a ripple,
and by Parseval the squares of the bands add up to those of the rows,

    Σ r² = Σ c_k²,     f_k = k / (2 N Δt),     order_k = π k / L  over an angle L [rad].

`disagreement` compares what the base predicts with what was measured. The noise floor of a band is
at most what the extended model leaves in it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from flexspline.comparison.result import Comparison, assembled
from flexspline.comparison.runs import Compared, ComparedRun, located, resolution
from flexspline.comparison.search import Analysis, Band, analysed
from flexspline.discovery.settings import SETTINGS
from flexspline.least_squares.validation import LEAST_ROWS, bands, groups
from flexspline.logs.derive import velocity_noise
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step, runs, true_ranges
from flexspline.orders.parts import effective_ratio, output_angle
from flexspline.regression.candidate_model import rmse_of

if TYPE_CHECKING:
    from flexspline.discovery.result import Discovery

__all__ = ["Disagreement", "HeldRun", "Slice", "compared_motion", "disagreement", "frequency_bands",
           "order_bands", "slices", "telling"]  # fmt: skip

Array = NDArray[np.float64]

DECADE = 1.0 / SETTINGS.little
HIGH_HZ = HIGH_ORDER = DECADE  # where the rate shows it; a power of ten below otherwise
LEAST_ANGLE = 0.5  # rad of the same
MOVES = 0.5  # of the largest speed but for a tenth, from which a row belongs to such a stretch


def frequency_bands(
    logs: Sequence[Log], residuals: Sequence[Sequence[Array]]
) -> list[tuple[str, int, list[float]]]:
    """Return label, rows of the stretches and RMS of each model, of each band, slow to fast.

    `residuals`: of each model, (N,) of each run; NaN where a row does not count.
    """
    rate = 1.0 / max(median_step(log["time"]) for log in logs)
    high = min(HIGH_HZ, DECADE ** np.floor(np.log10(0.5 * SETTINGS.most * rate)))
    edges = [0.0, high / DECADE, high, np.inf]
    labels = [f"below {edges[1]:g} Hz", f"{edges[1]:g} to {high:g} Hz", f"above {high:g} Hz"]
    return _by_band(labels, edges, [_in_time(logs, values) for values in residuals])


def order_bands(
    logs: Sequence[Log], residuals: Sequence[Sequence[Array]]
) -> list[tuple[str, int, list[float]]]:
    """Return label, rows and RMS of each band of orders per output turn, while the joint turns.

    Empty where the runs hold no angle or speed, or turn less than half a radian one way. Takes what
    `frequency_bands` takes.
    """
    if not all("output_position" in log and "output_velocity" in log for log in logs):
        return []
    ratio = effective_ratio(logs[0].facts)
    high = 0.5 * ratio if ratio is not None and ratio > 2.0 * HIGH_ORDER else 0.5 * HIGH_ORDER**2
    edges = [0.0, HIGH_ORDER, high, np.inf]
    labels = [f"below order {HIGH_ORDER:g}", f"orders {HIGH_ORDER:g} to {high:g}",
              f"above order {high:g}"]  # fmt: skip
    parts = [[*_in_angle(logs, values)] for values in residuals]
    return _by_band(labels, edges, parts) if all(parts) else []


def _by_band(
    labels: Sequence[str], edges: Sequence[float], models: Sequence[Iterable[tuple[Array, Array]]]
) -> list[tuple[str, int, list[float]]]:
    made = [_banded(parts, edges) for parts in models]
    return [(label, made[0][0], [sizes[k] for _, sizes in made]) for k, label in enumerate(labels)]


def _banded(
    parts: Iterable[tuple[Array, Array]], edges: Sequence[float]
) -> tuple[int, list[float]]:
    """Rows of all parts, and RMS of each band; NaN without a part."""
    squares, rows = np.zeros(len(edges) - 1), 0
    for at, values in parts:
        power = np.asarray(dct(values, norm="ortho")) ** 2
        for k, (low, high) in enumerate(pairwise(edges)):
            squares[k] += power[(at >= low) & (at < high)].sum()
        rows += len(values)
    sizes: list[float] = np.sqrt(squares / rows if rows else squares * np.nan).tolist()
    return rows, sizes


def _in_time(logs: Sequence[Log], residuals: Sequence[Array]) -> Iterator[tuple[Array, Array]]:
    """Frequencies [Hz] of the cosines, and the values, of each unbroken stretch that counts."""
    for log, values in zip(logs, residuals, strict=True):
        for first, last in runs(log["time"]):
            for a, b in true_ranges(np.isfinite(values[first:last])) + first:
                step = (log["time"][b - 1] - log["time"][a]) / max(b - a - 1, 1)
                yield np.arange(b - a) / (2.0 * (b - a) * (step or 1.0)), values[a:b]


def _in_angle(logs: Sequence[Log], residuals: Sequence[Array]) -> Iterator[tuple[Array, Array]]:
    """Orders of the cosines, and the values at even angles, of each stretch in one direction."""
    for log, values in zip(logs, residuals, strict=True):
        angle, velocity = output_angle(log), log["output_velocity"]
        moving = MOVES * float(np.nanquantile(np.abs(velocity), SETTINGS.most))
        good = np.isfinite(angle) & np.isfinite(values)
        for first, last in runs(log["time"]):
            for way in (1.0, -1.0):
                ahead = (way * velocity > moving) & good
                for a, b in true_ranges(ahead[first:last]) + first:
                    turned = np.maximum.accumulate(way * (angle[a:b] - angle[a]))
                    if b - a < SETTINGS.lines or turned[-1] < LEAST_ANGLE:
                        continue
                    even = np.linspace(0.0, turned[-1], b - a)
                    yield (
                        np.pi * np.arange(b - a) / turned[-1],
                        np.interp(even, turned, values[a:b]),
                    )


GROUPS = (
    "all", "run", "reversals", "direction", "speed", "temperature", "load", "frequency", "order"
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class HeldRun:
    """One run, as fits predict it that never saw the rows; arrays (N,), unit of the target.

    `base`, `final`: NaN where a row does not count. `load`: Nm at the output, None where it is not
    known.
    """

    log: Log
    measured: Array
    base: Array
    final: Array
    load: Array | None = None

    @property
    def counts(self) -> NDArray[np.bool_]:
        """Rows that count, in both."""
        return np.isfinite(self.base) & np.isfinite(self.final)


@dataclass(frozen=True)
class Slice:
    """Some of the rows, or one band of the residual: RMS before and after, unit of the target.

    `group`: "all", "run", "frequency", "order", "reversals", "direction", "speed", "temperature" or
    "load". `rows`: as many as it holds; of a band, of the stretches that it is a band of.
    """

    group: str
    label: str
    rows: int
    base: float
    final: float


def slices(runs: Sequence[HeldRun]) -> tuple[Slice, ...]:
    """Sort the residuals of base and extended model, of the rows that count in both.

    All rows are those that count in each, so that each has the error that `fit` gives it.
    """
    logs, counts = [run.log for run in runs], [run.counts for run in runs]
    own = [run.measured - run.base for run in runs], [run.measured - run.final for run in runs]
    before, after = (
        [np.where(counted, left, np.nan) for counted, left in zip(counts, residuals, strict=True)]
        for residuals in own
    )
    joined = [np.concatenate(values) for values in (before, after)]
    joined = [values[np.isfinite(values)] for values in joined]
    made = [Slice("all", "all rows", len(joined[0]), *map(rmse_of, own))]
    made += [
        _of_rows(group, label, mask, *joined)
        for group, label, mask in _parts(runs, logs, counts)
        if mask.sum() >= LEAST_ROWS
    ]
    for group, found in (
        ("frequency", frequency_bands(logs, [before, after])),
        ("order", order_bands(logs, [before, after])),
    ):
        made += [Slice(group, label, rows, *sizes) for label, rows, sizes in found]
    return tuple(sorted(made, key=lambda part: GROUPS.index(part.group)))


def telling(every: Sequence[Slice]) -> tuple[Slice, ...]:
    """Return the parts that say more than the row of all: not the only one of its group."""
    counts = Counter(part.group for part in every)
    return tuple(part for part in every if part.group == "all" or counts[part.group] > 1)


def _parts(
    runs: Sequence[HeldRun], logs: Sequence[Log], counts: Sequence[NDArray[np.bool_]]
) -> Iterator[tuple[str, str, NDArray[np.bool_]]]:
    names = [log.name for log in logs]
    seen = iter(range(1, len(logs) + 1))
    for group, label, mask in groups(logs, counts):
        twice = group == "run" and names.count(label) > 1
        number = next(seen) if group == "run" else 0
        yield group, f"{label} (run {number})" if twice else label, mask
    loads = [run.load for run in runs]
    if all(load is not None for load in loads):
        size = np.concatenate([np.abs(load[c]) for load, c in zip(loads, counts, strict=True)
                               if load is not None])  # fmt: skip
        yield from bands("load", size, SETTINGS.tried - 1, "Nm")


def _of_rows(group: str, label: str, mask: NDArray[np.bool_], before: Array, after: Array) -> Slice:
    base, final = (float(np.sqrt(np.mean(values[mask] ** 2))) for values in (before, after))
    return Slice(group, label, int(mask.sum()), base, final)


@dataclass(frozen=True, eq=False)
class Disagreement:
    """`before`: the base model compared. `after`: RMS that the extended model leaves, by the names
    and labels of `before.by`."""

    before: Comparison
    after: Mapping[str, Mapping[str, float]]


def disagreement(made: Discovery) -> Disagreement:
    """Compare what the base predicts on held-out folds with what was measured.

    Raises
    ------
    InputError
        Where too few rows count.
    """
    if made.by == "simulation":
        return _judged(made, compared_motion(made.runs, "base"))
    part = made.model.part(made.target)
    runs = tuple(
        located(made.model, part, run.log, run.measured, np.where(run.counts, run.base, np.nan),
                made.fit.lowpass, run.load)
        for run in made.runs
    )  # fmt: skip
    source = part.known_load or "the model's own inertia and gravity"
    return _judged(made, Compared(runs, made.target, made.unit, False, made.fit.lowpass, source))


def compared_motion(held: Sequence[HeldRun], which: str) -> Compared:
    """Return runs whose held-out motion, "base" or "final", is compared with the measured one."""
    runs = tuple(
        ComparedRun(run.log, run.measured, getattr(run, which), np.zeros(len(run.log)), None,
                    velocity_noise(run.log))
        for run in held
    )  # fmt: skip
    floor = resolution([run.measured for run in held])
    return Compared(runs, "output_position", "rad", True, None, "", "Nm", floor)


def _judged(made: Discovery, compared: Compared) -> Disagreement:
    """The comparison, no floor of which is higher than what a model has reached."""
    found = analysed(compared, lambda _: None)
    before, after = assembled(compared, found, made.model.facts), _after(made, compared, found)
    overall = _above(before.overall, made.noise_floor)
    by = {
        name: tuple(_above(one, min(one.noise_floor, after[name][one.label])) for one in bands)
        for name, bands in before.by.items()
    }
    return Disagreement(replace(before, overall=overall, by=by), after)


def _above(band: Band, floor: float) -> Band:
    excess = float(np.sqrt(max(band.rmse**2 - floor**2, 0.0)))
    return replace(band, noise_floor=floor, excess=excess)


def _after(made: Discovery, compared: Compared, found: Analysis) -> dict[str, dict[str, float]]:
    def left(run: ComparedRun, number: int) -> Array:
        return made.runs[number].measured - made.runs[number].final

    squares = found.rows.column(compared, left) ** 2
    after = {}
    for covariate in found.covariates:
        inside = covariate.cells >= 0
        total, count = (
            covariate.bins(
                np.bincount(
                    covariate.cells[inside], weights=each[inside], minlength=covariate.count
                ).astype(np.float64)
            )
            for each in (squares, np.ones(len(squares)))
        )
        rms = np.sqrt(total / np.maximum(count, 1.0))
        after[covariate.name] = dict(zip(covariate.labels, rms.tolist(), strict=False))
    return after
