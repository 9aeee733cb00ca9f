"""Segments of a log: unbroken runs, gaps, constant speed, standstill, reversals.

Everything here is either a list of `Segment` (half-open row ranges) or a mask with one truth
value per row. Velocity is the channel ``output_velocity`` where the log has it, else the
zero-phase derivative of ``output_position``. `play` follows a channel once it has gone further than
the slack between both.

The distance from the last reversal is measured in time and in angle. A row counts as moving where
|v| exceeds a threshold; a stop keeps the previous direction. The reversal is the first row that
moves the other way. Before the first one nothing is known (NaN).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs.log import Log
from flexspline.logs.quantisation import quantum

__all__ = ["play", "since_reversal"]

GAP_STEPS = 2.5
"""A step longer than this many median steps is a gap: filters start again behind it."""

CREEP = 4.0
"""Quanta over a repeated position and the rows beside it that slow motion makes: two each way."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Segment:
    """Rows ``start`` to ``stop`` (exclusive) of a log and what they are."""

    start: int
    stop: int
    kind: str

    def __len__(self) -> int:
        return self.stop - self.start

    @property
    def rows(self) -> slice:
        """The rows as a slice, for indexing a channel."""
        return slice(self.start, self.stop)


def median_step(time: NDArray[np.float64]) -> float:
    """The typical time step [s] of a log: the median of the positive ones, 0 if there are none."""
    steps = np.diff(time)
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0


def runs(time: NDArray[np.float64], gap: float | None = None) -> NDArray[np.intp]:
    """Row ranges without a gap, shape (k, 2), half-open.

    Parameters
    ----------
    time : array (N,), s, strictly increasing
    gap : s, a longer step starts a new run; default 2.5 median steps
    """
    if len(time) == 0:
        return np.zeros((0, 2), dtype=np.intp)
    steps = np.diff(time)
    even = gap is None and steps.size and 0.0 < steps.max() <= GAP_STEPS * steps.min()
    limit = np.inf if even else GAP_STEPS * median_step(time) if gap is None else gap
    cuts = np.flatnonzero(steps > limit) + 1
    edges = np.concatenate(([0], cuts, [len(time)]))
    return np.stack((edges[:-1], edges[1:]), axis=1)


def even_stamps(time: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Even time stamps [s] for rows that got theirs in bursts, shape (N,), and their step [s].

    All runs between gaps have the step of the lines through their stamps over the rows, by least
    squares, and each run the mean of its stamps. A gap is longer than 2.5 of the steps from burst
    to burst.

    Parameters
    ----------
    time : array (N,), s, that does not decrease and is not constant
    """
    steps = np.diff(time)
    between = float(np.median(steps[steps >= np.mean(steps)]))
    ranges = runs(time, GAP_STEPS * between)
    lengths = ranges[:, 1] - ranges[:, 0]
    row = np.arange(len(time), dtype=np.float64)
    number = row - np.repeat(0.5 * (ranges[:, 0] + ranges[:, 1] - 1), lengths)
    mean = np.repeat(np.add.reduceat(time, ranges[:, 0]) / lengths, lengths)
    step = float(number @ (time - mean)) / float(number @ number)
    return mean + step * number, step


def at_rest(log: Log) -> NDArray[np.bool_]:
    """Rows in which the output certainly stands still, shape (N,); none where that is not told.

    Its position keeps its value from row to row, and its velocity is next to nothing. Where no
    velocity is recorded, the position must not catch up behind those rows either, as it does when
    the recorder stood still and the joint did not.
    """
    if "output_position" not in log or len(log) < 3:
        return np.zeros(len(log), dtype=bool)
    position = log["output_position"]
    steps = np.abs(np.diff(position))
    same = steps == 0.0
    if not same.any() or not np.isfinite(log.columns.get("output_velocity", position)).any():
        return np.zeros(len(log), dtype=bool)
    if "output_velocity" in log:
        speed = np.abs(log["output_velocity"])
        slow = speed <= 0.01 * float(np.nanquantile(speed, 0.99))
    else:
        slow = np.ones(len(log), dtype=bool)
        first, last = true_ranges(same).T
        before, behind = np.maximum(first - 1, 0), np.minimum(last + 1, len(log) - 1)
        least = 0.01 * float(np.nanquantile(steps, 0.99)) * (behind - before)
        way = np.abs(position[behind] - position[before])
        still = way <= np.maximum(least, CREEP * quantum(position))
        same[same] = np.repeat(still, last - first)
    kept = np.append(same, False) | np.insert(same, 0, False)
    return np.asarray(slow & kept)


def repeats(log: Log) -> NDArray[np.bool_]:
    """Rows that repeat all values of the row before, the time aside, shape (N,).

    None where the log holds nothing but time, and none where the joint certainly rests: there a
    coarse encoder repeats its value with reason.
    """
    same = [np.diff(log[name]) == 0.0 for name in log.channels if name != "time"]
    found = np.zeros(len(log), dtype=bool)
    if same:
        found[1:] = np.logical_and.reduce(same) & ~at_rest(log)[1:]
    return found


def stuck_from(*columns: Array) -> int:
    """First row from which all columns (N,) repeat the row before up to the end; N without any."""
    fresh = np.flatnonzero(np.logical_or.reduce([np.diff(values) != 0.0 for values in columns]))
    return int(fresh[-1]) + 2 if fresh.size else min(1, len(columns[0]))


def gaps(log: Log, gap: float | None = None) -> tuple[Segment, ...]:
    """The places where rows are missing: the last row before and the first row behind each gap."""
    breaks = runs(log["time"], gap)[1:, 0]
    return tuple(Segment(int(row) - 1, int(row) + 1, "gap") for row in breaks)


def standstill(log: Log, threshold: float | None = None) -> NDArray[np.bool_]:
    """Rows where the output does not move, shape (N,).

    Parameters
    ----------
    log : the log, with ``output_velocity`` or ``output_position``
    threshold : rad/s at the output; default 1 % of the speed that 99 % of the rows stay below
    """
    velocity = output_velocity(log)
    limit = _slow(velocity) if threshold is None else threshold
    return np.asarray(np.abs(velocity) <= limit)


def constant_speed(
    log: Log, *, tolerance: float = 0.05, shortest: float = 0.25
) -> tuple[Segment, ...]:
    """Stretches that hold one speed, standstill left out.

    Parameters
    ----------
    log : the log, with ``output_velocity`` or ``output_position``
    tolerance : largest deviation from the stretch's median speed, as a share of it
    shortest : s, shorter stretches are left out

    Notes
    -----
    Rows are steady that keep within the tolerance of the velocity's mean over half of `shortest`,
    where that mean has itself changed by less than the tolerance since half of `shortest` ago.
    """
    time = log["time"]
    velocity = output_velocity(log)
    width = max(1, round(0.5 * shortest / max(median_step(time), 1e-12)))
    smooth = _moving_mean(velocity, width)
    steady = (np.abs(velocity - smooth) <= tolerance * np.abs(smooth)) & ~standstill(log)
    drift = np.zeros(len(time), dtype=bool)
    drift[width:] = np.abs(smooth[width:] - smooth[:-width]) > tolerance * np.abs(smooth[width:])
    steady &= ~drift
    return tuple(
        Segment(int(a), int(b), "constant_speed")
        for a, b in true_ranges(steady & _same_run(time))
        if time[b - 1] - time[a] >= shortest
    )


def reversals(log: Log, threshold: float | None = None) -> tuple[Segment, ...]:
    """Changes of direction: from the last row of one direction to the first of the other.

    A dwell between the two belongs to the reversal; a stop that goes on in the same direction is
    none. Noise about zero makes none, for speeds below the threshold have no direction.

    Parameters
    ----------
    log : the log, with ``output_velocity`` or ``output_position``
    threshold : rad/s at the output, below it nothing counts as moving; default as `standstill`

    Returns
    -------
    Segments of kind ``reversal``: row ``start`` is the last that moves one way, row ``stop - 1``
    the first that moves the other way.
    """
    velocity = output_velocity(log)
    limit = _slow(velocity) if threshold is None else threshold
    moving = np.flatnonzero(np.abs(velocity) > limit)
    turns = np.flatnonzero(np.diff(np.sign(velocity[moving])) != 0)
    return tuple(Segment(int(moving[k]), int(moving[k + 1]) + 1, "reversal") for k in turns)


def reversal_times(log: Log, threshold: float | None = None) -> NDArray[np.float64]:
    """Times [s] at which the direction changes: the middle of each reversal's zero crossing."""
    time, found = log["time"], reversals(log, threshold)
    return np.array([0.5 * (time[s.start] + time[s.stop - 1]) for s in found], dtype=np.float64)


def near_reversal(
    log: Log, seconds: float = 0.1, threshold: float | None = None
) -> NDArray[np.bool_]:
    """Rows within `seconds` of the end of one direction or the start of the other, shape (N,)."""
    time = log["time"]
    found = reversals(log, threshold)
    ends = np.array([[s.start, s.stop - 1] for s in found], dtype=np.intp).ravel()
    marks = time[ends]
    change = np.zeros(len(time) + 1, dtype=np.int64)
    np.add.at(change, np.searchsorted(time, marks - seconds, side="left"), 1)
    np.add.at(change, np.searchsorted(time, marks + seconds, side="right"), -1)
    return np.asarray(np.cumsum(change[:-1]) > 0)


def segments(log: Log) -> tuple[Segment, ...]:
    """All segments of a log by their first row: gaps, standstill, constant speed, reversals."""
    still = (Segment(int(a), int(b), "standstill") for a, b in true_ranges(standstill(log)))
    found: Iterable[Segment] = (*gaps(log), *still, *constant_speed(log), *reversals(log))
    return tuple(sorted(found, key=lambda s: (s.start, s.stop)))


def true_ranges(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Half-open ranges of rows where a mask is true, shape (k, 2)."""
    padded = np.concatenate(([False], mask, [False]))
    return np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)


def output_velocity(log: Log) -> NDArray[np.float64]:
    """The channel ``output_velocity`` [rad/s], or the derivative of ``output_position``."""
    if "output_velocity" in log:
        return log["output_velocity"]
    if "output_position" not in log:
        raise InputError(
            f"{log.name}: segments need output_velocity or output_position; map one of them."
        )
    from flexspline.logs.derive import differentiate  # derive needs the runs above

    return differentiate(log)["output_velocity"]


def output_speed(log: Log, least: float) -> NDArray[np.float64]:
    """Speed of the output [rad/s], shape (N,), by which rows of at least `least` are chosen.

    It is that of the channel ``output_velocity``, else of the derivative of ``output_position``.

    Raises
    ------
    InputError
        Where `least` is no speed, or the log has neither channel.
    """
    if not (isinstance(least, Real) and np.isfinite(least) and least >= 0.0):
        raise InputError(f"speed_above is {least!r}; give rad/s, 0 or more")
    if "output_velocity" not in log and "output_position" not in log:
        raise InputError(
            f"log '{log.name}': speed_above needs output_velocity or output_position, and it has "
            "neither; map a column to one of them, or leave speed_above out"
        )
    return np.abs(output_velocity(log))


def _slow(velocity: NDArray[np.float64]) -> float:
    """1 % of the speed that 99 % of the rows stay below."""
    known = velocity[np.isfinite(velocity)]
    return 0.01 * float(np.percentile(np.abs(known), 99)) if known.size else 0.0


def _moving_mean(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Mean over `width` rows, centred, shorter at the ends."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    centre = np.arange(len(values))
    first = np.maximum(centre - width // 2, 0)
    last = np.minimum(centre + width // 2 + 1, len(values))
    return np.asarray((sums[last] - sums[first]) / (last - first))


def _same_run(time: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True but for the first row behind each gap, so that no range spans a gap."""
    inside = np.ones(len(time), dtype=bool)
    inside[runs(time)[1:, 0]] = False
    return inside


class SinceReversal(NamedTuple):
    """Arrays (N,): seconds, angle [rad at the output], and the direction kept, -1, 0 or 1."""

    seconds: Array
    angle: Array
    direction: NDArray[np.int8]


def since_reversal(time: Array, position: Array, velocity: Array, still: float) -> SinceReversal:
    """Return the distance of every row from the last reversal.

    Parameters
    ----------
    time, position, velocity : (N,), s, rad, rad/s at the output; starts again behind a gap.
    still : rad/s, up to which the joint has no direction.
    """
    seconds, angle = np.full((2, len(time)), np.nan)
    direction = np.zeros(len(time), dtype=np.int8)
    for a, b in runs(time):
        kept = _kept(np.sign(velocity[a:b]) * (np.abs(velocity[a:b]) > still))
        direction[a:b] = kept
        turned = np.flatnonzero((kept[1:] != kept[:-1]) & (kept[:-1] != 0)) + 1
        if not len(turned):
            continue
        rows = np.arange(turned[0], b - a)
        last = a + turned[np.searchsorted(turned, rows, side="right") - 1]
        seconds[a + rows] = time[a + rows] - time[last]
        angle[a + rows] = np.abs(position[a + rows] - position[last])
    return SinceReversal(seconds, angle, direction)


def _kept(sign: Array) -> NDArray[np.int8]:
    """Signs with each 0 replaced by the last one that is none."""
    at = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign)), 0))
    return np.asarray(sign[at], dtype=np.int8)


def play(position: Array, slip: float) -> Array:
    """Return where the far end of an elastic-plastic element sits, (N,).

    p_k = min(q_k + s, max(q_k − s, p_{k−1})),  p_0 = q_0: it follows once the spring is
    stretched by s. Clamps compose to clamps, so the recursion is a scan in log2(N) passes over
    the arrays [HillisSteele1986].
    """
    low, high = position - slip, position + slip
    low[0] = high[0] = position[0]
    step = 1
    while step < len(position):
        before_low, before_high = low[:-step], high[:-step]
        now_low, now_high = low[step:], high[step:]
        new_low = np.clip(before_low, now_low, now_high)
        new_high = np.clip(before_high, now_low, now_high)
        low, high = np.concatenate([low[:step], new_low]), np.concatenate([high[:step], new_high])
        step *= 2
    return low
