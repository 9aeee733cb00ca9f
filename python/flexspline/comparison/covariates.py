"""Covariates of a disagreement, each as bins, and as cells: a bin in one direction of motion.

A mean over both directions would hide friction, which changes its sign with the direction. Edges of
bins are round numbers, with enough rows between them.

Orders are covariates too: they are found in the residual by `flexspline.orders` (noise alone names
one in a hundred logs), and explain a cosine and a sine for each order, direction by direction.

The rows of a cell are not independent, so each has an effective sample size. The noise is
autoregressive (`least_squares/noise_model.py`), fitted to what `search.py` leaves of the residual
where the joint moves. With its autocorrelation ρ_h and A_j(h) pairs of rows h apart that are both
in cell j

    var(mean of cell j) = s_j² / n_j² Σ_h ρ_h A_j(h) = s_j² τ_j / n_j

and n_j / τ_j rows are independent. A_j is counted at a few lags and interpolated linearly between.
The mean square has the same with ρ_h² (Gaussian noise), times 2. Source: [Bartlett1946]. Where
means of long batches scatter more than the model says, the sums of ρ are that much larger.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.curves import Curves, curves_of
from flexspline.comparison.runs import Compared, ComparedRun, Rows
from flexspline.errors import InputError
from flexspline.formatting import told_apart
from flexspline.least_squares.noise_model import Chunk, NoiseModel, noise_model
from flexspline.logs.segments import since_reversal
from flexspline.orders import FoundOrder, OrderAnalysis, find_orders
from flexspline.orders.parts import output_angle

__all__ = [
    "Covariate",
    "Memory",
    "Turning",
    "covariates_of",
    "even_edges",
    "growing_edges",
    "in_bins",
    "labels_of",
    "memory_of",
    "turning_of",
]

Array = NDArray[np.float64]

Cells = NDArray[np.int16] | NDArray[np.int32]

DIRECTIONS = ("at rest", "forward", "backward")
ANGLE_BINS = 24
EVEN_BINS = 10
COARSE = 4
FIRST_SINCE = 1e-3  # of the longest way since a reversal: the first edge
_LEAST_SHARE, _LEAST_ROWS = 0.002, 30
_TURN = 2.0 * np.pi

_ROUND_GROWING = np.array([1.0, 1.5, 2.0, 3.0, 5.0, 7.0])
_ROUND_STEPS = np.array([1.0, 2.0, 2.5, 5.0, 10.0])
_SAMPLED = 200_000
_DECADES = 4  # below the largest value that growing bins go

SEARCHED_ROWS = 150_000
MOST_ORDERS = 12
FALSE_ALARM = 0.01
CELLS = 1e4  # orders that a search looks at: what is left of one has to stand out of as many
_CHUNK = 1 << 16

LARGEST_ORDER = 32
LONGEST = 1 << 15  # rows of memory
NEGLIGIBLE = 1e-3
LAGS = 14
BATCH = 2  # times the memory: the shortest batch
LEAST_BATCHES = 20
_FFT = 1 << 18
_LEAST_TAU = 0.1
_LEAST_DEGREES = 4.0


@dataclass(frozen=True, eq=False)
class Covariate:
    """One thing that rows are sorted by.

    Parameters
    ----------
    name : key in `comparison.json`; `words` in sentences; `unit` of the edges.
    edges : (bins + 1,), or None for kinds.
    labels : what each bin is called.
    cells : (N,), cell of each row, -1 where the row has none.
    bin_of : (cells,), bin of each cell. `direction_of`: its direction, -1 where it has none.
    shown : whether it is a line of the result; others only clean the noise floor.
    curves : through neighbouring cells; None for kinds, which have no neighbours.
    """

    name: str
    words: str
    unit: str
    edges: Array | None
    labels: tuple[str, ...]
    cells: Cells
    bin_of: NDArray[np.intp]
    direction_of: NDArray[np.intp]
    shown: bool = True
    curves: Curves | None = None

    @property
    def count(self) -> int:
        """How many cells there are."""
        return len(self.bin_of)

    def bins(self, per_cell: Array) -> Array:
        """Add up what cells have, (cells,), for each bin."""
        made = np.bincount(self.bin_of, weights=per_cell, minlength=len(self.labels))
        return np.asarray(made, dtype=np.float64)


def covariates_of(compared: Compared, rows: Rows) -> list[Covariate]:
    """Return what the channels of all runs allow, the simplest first."""
    least = max(_LEAST_ROWS, round(_LEAST_SHARE * len(rows)))
    found = list(_found(compared, rows, least))
    known = {covariate.name: covariate for covariate in found}
    for first, second in (("speed", "load"), ("speed", "temperature"), ("speed", "position")):
        if first in known and second in known:
            found.append(_together(known[first], known[second], rows))
    return [covariate for covariate in found if len(covariate.labels) > 1 or
            covariate.name == "offset"]  # fmt: skip


def _found(compared: Compared, rows: Rows, least: int) -> Iterator[Covariate]:
    yield _kinds("offset", "everywhere", ("all rows",), np.zeros(len(rows), np.int16), shown=False)
    if all("output_velocity" in run.log for run in compared.runs):
        yield _kinds("direction", "direction", DIRECTIONS, rows.direction.astype(np.int16))
        speed = rows.column(compared, lambda run, k: np.abs(run.log["output_velocity"]))
        yield _split(
            "speed",
            "speed",
            "rad/s",
            speed,
            growing_edges(speed, least, max(rows.still)),
            rows.direction,
        )
    yield from _conditions(compared, rows, least)
    yield from _place(compared, rows, least)
    yield from _history(compared, rows, least)


def _conditions(compared: Compared, rows: Rows, least: int) -> Iterator[Covariate]:
    if all(run.load is not None for run in compared.runs):
        load = rows.column(compared, lambda run, k: np.asarray(run.load))
        own = compared.load_source.startswith("the model")
        unit = compared.load_unit if own else "Nm"
        edges = even_edges(load, least, EVEN_BINS)
        yield _split("load", "load", unit, load, edges, rows.direction)
    for name in ("temperature", "motor_temperature"):
        if all(name in run.log for run in compared.runs):
            values = rows.column(compared, partial(_channel, name=name))
            edges = even_edges(values, least, EVEN_BINS)
            yield _split(name, name.replace("_", " "), "°C", values, edges, rows.direction)


def _place(compared: Compared, rows: Rows, least: int) -> Iterator[Covariate]:
    if all("output_position" in run.log for run in compared.runs):
        angle = rows.column(compared, lambda run, k: run.log["output_position"])
        there = angle[np.isfinite(angle)]
        whole = len(there) > 0 and bool(np.ptp(there) > 1.02 * _TURN)
        edges = np.linspace(0.0, _TURN, ANGLE_BINS + 1) if whole else even_edges(
            angle, least, ANGLE_BINS
        )  # fmt: skip
        angle = np.mod(angle, _TURN) if whole else angle
        yield _split("position", "output angle", "rad", angle, edges, rows.direction)
    if all("output_acceleration" in run.log for run in compared.runs):
        values = rows.column(compared, lambda run, k: run.log["output_acceleration"])
        edges = even_edges(values, least, EVEN_BINS)
        yield _split("acceleration", "acceleration", "rad/s²", values, edges, rows.direction)


def _history(compared: Compared, rows: Rows, least: int) -> Iterator[Covariate]:
    channels = ("output_position", "output_velocity")
    if all(c in run.log for run in compared.runs for c in channels):

        def since(run: ComparedRun, number: int) -> Array:
            log = run.log
            made = since_reversal(log["time"], log["output_position"], log["output_velocity"],
                                  rows.slow[number])  # fmt: skip
            return np.column_stack(made)

        parts = zip(compared.runs, rows.counts, strict=True)
        table = np.concatenate([since(run, k)[keep] for k, (run, keep) in enumerate(parts)])
        kept = np.where(table[:, 2] > 0, 1, 2)
        for name, words, unit, values in (
            ("reversal_angle", "angle since the last reversal", "rad", table[:, 1]),
            ("reversal_time", "time since the last reversal", "s", table[:, 0]),
        ):
            if np.isfinite(values).any():
                first = FIRST_SINCE * float(np.nanmax(values))
                edges = growing_edges(values, least, first)
                yield _split(name, words, unit, values, edges, kept)
    time = rows.column(compared, lambda run, k: run.log["time"] - run.log["time"][0])
    yield _by_run("time", time, even_edges(time, least, EVEN_BINS), rows, len(compared.runs))
    if len(compared.runs) > 1:
        names = tuple(run.log.name for run in compared.runs)
        yield _kinds("run", "run", names, rows.run)


def _channel(run: ComparedRun, number: int, *, name: str) -> Array:
    return run.log[name]


def _packed(cells: NDArray[np.integer]) -> Cells:
    """The cells in as few bytes as hold them, with room for one more."""
    few = int(cells.max(initial=0)) < np.iinfo(np.int16).max - 1
    return cells.astype(np.int16) if few else cells.astype(np.int32)


def _kinds(
    name: str, words: str, labels: tuple[str, ...], cells: Cells, *, shown: bool = True
) -> Covariate:
    each = np.arange(len(labels))
    none = np.full(len(labels), -1)
    return Covariate(name, words, "", None, labels, cells, each, none, shown)


def _split(
    name: str, words: str, unit: str, values: Array, edges: Array, direction: NDArray[np.integer]
) -> Covariate:
    """Cells of every bin in every direction."""
    place = in_bins(values, edges)
    cells = _packed(np.where(place < 0, -1, 3 * place + direction))
    number = np.arange(3 * (len(edges) - 1))
    curves = curves_of(cells, values, edges, number.reshape(-1, 3).T)
    return Covariate(name, words, unit, edges, labels_of(edges, unit), cells, number // 3,
                     number % 3, curves=curves)  # fmt: skip


def _by_run(name: str, time: Array, edges: Array, rows: Rows, runs: int) -> Covariate:
    """Cells of every bin in every run: a drift of one run is not that of another."""
    place, count = in_bins(time, edges), len(edges) - 1
    cells = _packed(np.where(place < 0, -1, rows.run * count + place))
    number = np.arange(runs * count)
    curves = curves_of(cells, time, edges, number.reshape(runs, count))
    return Covariate(name, "time", "s", edges, labels_of(edges, "s"), cells, number % count,
                     np.full(runs * count, -1), curves=curves)  # fmt: skip


def _together(first: Covariate, second: Covariate, rows: Rows) -> Covariate:
    """Cells of two covariates at once, the first in few bins: repeated states."""
    size = -(-len(first.labels) // COARSE)
    coarse = np.where(first.cells < 0, -1, first.bin_of[first.cells] // size)
    few = int(coarse.max()) + 1
    both = (coarse >= 0) & (second.cells >= 0)
    cells = _packed(np.where(both, coarse * np.int32(second.count) + second.cells, -1))
    number = np.arange(few * second.count)
    words = f"{first.words} and {second.words} together"
    assert second.curves is not None
    lines = number.reshape(few, -1, 3).transpose(0, 2, 1).reshape(3 * few, -1)
    curves = replace(second.curves, cells=cells, lines=lines)
    return Covariate(f"{first.name} and {second.name}", words, "", None, ("",) * 2, cells,
                     np.zeros(len(number), np.intp), second.direction_of[number % second.count],
                     False, curves)  # fmt: skip


def growing_edges(values: Array, least: int, first: float) -> Array:
    """Return edges from 0 that grow by about a half each, the last one infinite.

    Parameters
    ----------
    values : (N,), at least 0, any unit; rows not finite are left out.
    least : rows that a bin must hold.
    first : the smallest edge above 0: what is nearer is indistinguishable from zero.
    """
    known, weight = _sampled(values)
    if not len(known) or not known[-1] > 0.0:
        return np.array([0.0, np.inf])
    top = float(np.floor(np.log10(known[-1])))
    marks = np.concatenate([_ROUND_GROWING * 10.0**k for k in np.arange(top - _DECADES, top + 1)])
    marks = marks[(marks < known[-1]) & (marks >= first)]
    return _merged(np.concatenate([[0.0], marks, [np.inf]]), known, weight, least)


def even_edges(values: Array, least: int, bins: int) -> Array:
    """Return about `bins` even bins between the 1 and 99 % points, open at both ends."""
    known, weight = _sampled(values)
    if len(known) < 2:
        return np.array([-np.inf, np.inf])
    low, high = np.quantile(known, [0.01, 0.99])
    rough = max(high - low, 1e-9 * max(abs(high), abs(low))) / bins
    if not rough > 0.0:
        return np.array([-np.inf, np.inf])
    scale = 10.0 ** np.floor(np.log10(rough))
    step = scale * _ROUND_STEPS[np.searchsorted(_ROUND_STEPS, rough / scale - 1e-9)]
    inner = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    return _merged(np.concatenate([[-np.inf], inner, [np.inf]]), known, weight, least)


def in_bins(values: Array, edges: Array) -> NDArray[np.int32]:
    """Return the bin of each value, (N,); -1 where it is not finite."""
    place = np.clip(np.searchsorted(edges[1:-1], values, side="right"), 0, len(edges) - 2)
    return np.where(np.isfinite(values), place, -1).astype(np.int32)


def labels_of(edges: Array, unit: str) -> tuple[str, ...]:
    """Return what each bin is called, such as "0.1 to 0.2 rad/s"."""
    first, *inner, last = edges.tolist()
    lowest = -np.inf if first == 0.0 else first  # of a size, which has nothing below 0
    ends = zip([lowest, *inner, last], told_apart([first, *inner, last]), strict=True)
    return tuple(
        _label(low, high, below, above, unit) for (low, below), (high, above) in pairwise(ends)
    )


def _label(low: float, high: float, below: str, above: str, unit: str) -> str:
    if low == -np.inf:
        return "all" if high == np.inf else f"below {above} {unit}"
    return f"above {below} {unit}" if high == np.inf else f"{below} to {above} {unit}"


def _sampled(values: Array) -> tuple[Array, float]:
    """Sorted finite values, thinned, and how many rows each stands for."""
    step = max(1, len(values) // _SAMPLED)
    known = values[::step]
    return np.sort(known[np.isfinite(known)]), float(step)


def _merged(edges: Array, known: Array, weight: float, least: int) -> Array:
    """Drop edges until each bin holds `least` rows."""
    below = weight * np.searchsorted(known, edges)
    kept = [0]
    for k in range(1, len(edges) - 1):
        if below[k] - below[kept[-1]] >= least and below[-1] - below[k] >= least:
            kept.append(k)
    return np.asarray(edges[[*kept, len(edges) - 1]])


@dataclass(frozen=True, eq=False)
class Turning:
    """The angle of the output (N,), rad, and the orders found, or why there are none."""

    angle: Array
    direction: NDArray[np.int8]
    analysis: OrderAnalysis | None
    why_not: str

    @property
    def found(self) -> tuple[FoundOrder, ...]:
        """The largest orders."""
        return () if self.analysis is None else self.analysis.found[:MOST_ORDERS]

    def explained(self, rest: Array) -> tuple[Array, Array]:
        """Return what the orders explain of `rest`, (N,), and their amplitudes (orders,)."""
        orders = np.array([order.per_output_turn for order in self.found])
        made, power = np.zeros(len(rest)), np.zeros(len(orders))
        for way in (1, 2):
            rows = np.flatnonzero((self.direction == way) & np.isfinite(self.angle))
            if len(rows) < 4 * len(orders) + 8:
                continue
            weights = self._weights(orders, rows, rest)
            for part in np.array_split(rows, -(-len(rows) // _CHUNK)):
                made[part] = self._columns(orders, part) @ weights
            power += len(rows) / len(rest) * (weights.reshape(-1, 2) ** 2).sum(axis=1)
        return made, np.sqrt(power)

    def chance(self, amplitudes: Array) -> float:
        """Return the probability that noise alone leaves any order as large as these."""
        errors = np.array([max(order.error, 1e-300) for order in self.found])
        surprise = float(np.max(0.5 * (amplitudes / errors) ** 2))
        return min(1.0, CELLS * float(np.exp(-surprise)))

    def _weights(self, orders: Array, rows: NDArray[np.intp], rest: Array) -> Array:
        gram, moment = np.zeros((2 * len(orders),) * 2), np.zeros(2 * len(orders))
        for part in np.array_split(rows, -(-len(rows) // _CHUNK)):
            columns = self._columns(orders, part)
            gram += columns.T @ columns
            moment += columns.T @ rest[part]
        return np.asarray(np.linalg.lstsq(gram, moment, rcond=1e-9)[0])

    def _columns(self, orders: Array, rows: NDArray[np.intp]) -> Array:
        phase = self.angle[rows, None] * orders
        return np.stack([np.cos(phase), np.sin(phase)], axis=2).reshape(len(rows), -1)


def turning_of(compared: Compared, rows: Rows, rest: Array) -> Turning:
    """Find the orders in `rest`, (N,), of at most `SEARCHED_ROWS` rows in the middle of runs."""
    logs = [run.log for run in compared.runs]
    sides = ("output_position", "motor_position")
    if not all(any(side in log for side in sides) for log in logs):
        return _none(rows, "the runs hold no angle")
    try:
        angle = rows.column(compared, lambda run, k: output_angle(run.log))
        values = _searched(compared, rows, rest)
        called = f"residual of {compared.what.replace('_', ' ')}"
        analysis = find_orders(
            logs, values, false_alarm=FALSE_ALARM, unit=compared.unit, channel=called,
            vibrations=True,  # what stays at one frequency is no order of what turns
        )  # fmt: skip
    except InputError as error:
        return _none(rows, str(error))
    return Turning(angle, rows.direction, analysis, "")


def _none(rows: Rows, why: str) -> Turning:
    return Turning(np.zeros(len(rows)), rows.direction, None, why)


def _searched(compared: Compared, rows: Rows, rest: Array) -> list[Array]:
    """Values of each run; NaN on rows that do not count or are too many."""
    share = min(1.0, SEARCHED_ROWS / len(rows))
    found, first = [], 0
    for run, keep in zip(compared.runs, rows.counts, strict=True):
        at = np.flatnonzero(keep)
        skipped = round(0.5 * (1.0 - share) * len(at))
        values = np.full(len(run.log), np.nan)
        inside = at[skipped : len(at) - skipped]
        values[inside] = rest[first + skipped : first + len(at) - skipped]
        found.append(values)
        first += len(at)
    return found


@dataclass(frozen=True, eq=False)
class Memory:
    """The noise's autocorrelation, as weights at a few lags.

    `model`: autoregressive. `lags`: (L,), rows. `weights`: (L,), sums of ρ around each lag, both
    signs of h; `squares`: the same of ρ². `degrees`: of freedom that an error estimate has.
    `blocks`: rows at which pairs are counted, (start, stop).
    """

    model: NoiseModel
    lags: NDArray[np.intp]
    weights: Array
    squares: Array
    degrees: float
    blocks: tuple[tuple[int, int], ...]

    def times(self, cells: NDArray[np.integer], count: int) -> tuple[Array, Array]:
        """Return τ of the mean and of the mean square of each cell, (count,) each."""
        pairs = np.zeros((len(self.lags), count))
        for first, last in self.blocks:
            part = cells[first:last]
            for k, lag in enumerate(self.lags):
                early, late = part[: max(len(part) - lag, 0)], part[lag:]
                same = early[(early == late) & (early >= 0)]
                pairs[k] += np.bincount(same, minlength=count)
        seen = pairs[0] > 0
        share = np.where(seen, pairs / np.where(seen, pairs[0], 1.0), 1.0)
        mean, square = self.weights @ share, self.squares @ share
        return np.maximum(mean, _LEAST_TAU), np.maximum(square, _LEAST_TAU)


def memory_of(rows: Rows, rest: Array, decimation: int = 1) -> Memory:
    """Fit the noise's memory to `rest`, (N,), what is left of the residual on `rows.looked_at`.

    Parameters
    ----------
    decimation : of how many rows one is news, for a residual that was low-passed.
    """
    blocks = rows.looked_at
    moving = rows.direction > 0
    if 2 * np.count_nonzero(moving) < len(rows):
        moving[:] = True  # at rest what holds the joint is no noise; but here is little else
    chunks = [_chunk(rest, np.arange(*block), moving) for block in blocks]
    size = sum(len(chunk.residual) for chunk in chunks)
    basis = np.full((1, 1), 1.0 / np.sqrt(size))
    model = noise_model(lambda: iter(chunks), basis, max_order=LARGEST_ORDER, decimation=decimation)
    rho = _autocorrelation(model, max(last - first for first, last in blocks))
    lags = _lags(len(rho) - 1)
    degrees = max(_LEAST_DEGREES, model.samples / max(model.memory, 1.0) - 1.0)
    longer = _longer(rho, rest, blocks, round(model.memory * decimation))
    return Memory(model, lags, longer * _hats(rho, lags), _hats(rho**2, lags), degrees, blocks)


def _longer(rho: Array, rest: Array, blocks: Sequence[tuple[int, int]], memory: int) -> float:
    """How many times more the means of long batches scatter than the model says, at least 1.

    An order chosen for what comes next misses slow noise under white noise.
    """
    found = [1.0]
    square = float(np.mean([np.mean(rest[a:b] ** 2) for a, b in blocks]))
    if square == 0.0:  # nothing scatters
        return 1.0
    for size in (BATCH * memory, 2 * BATCH * memory, 4 * BATCH * memory):
        means = [
            rest[a : a + (b - a) // size * size].reshape(-1, size).mean(axis=1)
            for a, b in blocks
            if size > 0
        ]
        batches = np.concatenate(means) if means else np.empty(0)
        if len(batches) < LEAST_BATCHES:
            break
        lag = np.arange(1, min(len(rho), size))
        told = (1.0 + 2.0 * float(((1.0 - lag / size) * rho[lag]).sum())) / size
        found.append(float(np.mean(batches**2)) / (square * told))
    return max(found)


def _chunk(rest: Array, part: NDArray[np.intp], moving: NDArray[np.bool_]) -> Chunk:
    part = part[moving[part]]
    return Chunk(np.ones((len(part), 1)), rest[part], np.diff(part, prepend=-2) > 1)


def _autocorrelation(model: NoiseModel, rows: int) -> Array:
    """ρ_h of all lags that matter, from the model's spectrum; straight between decimated rows."""
    power = np.abs(np.fft.rfft(model.denominator, _FFT)) ** -2.0
    gamma = np.fft.irfft(power)[: max(2, min(LONGEST, rows // 2) // model.decimation)]
    rho = gamma / gamma[0]
    last = int(np.flatnonzero(np.abs(rho) > NEGLIGIBLE)[-1]) + 2
    rho = np.append(rho, 0.0)[: last + 1]
    fine = np.arange(model.decimation * (len(rho) - 1) + 1)
    return np.asarray(np.interp(fine / model.decimation, np.arange(len(rho)), rho))


def _lags(last: int) -> NDArray[np.intp]:
    grown = np.unique(np.round(np.geomspace(1, max(last, 1), LAGS)).astype(np.intp))
    return np.concatenate([[0], grown])


def _hats(rho: Array, lags: NDArray[np.intp]) -> Array:
    """Sums of ρ over lags of both signs, shared between the two lags beside."""
    every = np.arange(lags[-1] + 1)
    values = np.append(rho, np.zeros(max(0, len(every) - len(rho))))[: len(every)]
    both = np.where(every == 0, 1.0, 2.0) * values
    after = np.clip(np.searchsorted(lags, every), 1, len(lags) - 1)
    share = (every - lags[after - 1]) / (lags[after] - lags[after - 1])
    made = np.bincount(after, weights=share * both, minlength=len(lags))
    made += np.bincount(after - 1, weights=(1.0 - share) * both, minlength=len(lags))
    return np.asarray(made)
