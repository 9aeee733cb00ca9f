"""Scan of the orders of all segments, with lines subtracted as they are found.

Each round looks at the remaining values: the power over the local floor is summed over
the segments as it is (a ripple whose phase changes with speed) and with phases (one that does
not). Of the surprising peaks those with the most power become lines, all lines are fitted
together with the smooth part, and the rest is scanned again until nothing stands out: a strong
order's leakage over part of a turn, gone with it, is not named. Surprise says whether something
is there; it cannot say where, because it compares with the neighbourhood, which a side lobe too
exceeds by far.

Amplitude and phase of the orders found are fitted together, with errors from the local floor. In
segment g order k has β_g = (a_g, b_g) of a cos kq + b sin kq, with covariance
F_g(k) (XᵀX)⁻¹: F is the local noise floor, so the errors hold for correlated noise. Over the
segments

    amplitude   A² = Σ w_g (|β_g|² - tr cov_g) / Σ w_g     for any phase,
    steady      β = (Σ cov_g⁻¹)⁻¹ Σ cov_g⁻¹ β_g            the part of constant phase,

with w_g = 1 / (A² + tr cov_g): segments count alike unless they are too noisy for A
[DerSimonianLaird1986].

Noise floor and surprise. Measured noise is correlated, so its power changes with the order. Where
there is only noise, the power at one order follows an exponential law around the local floor F,
whatever the noise's colour. F is the median over a block of orders (a few lines in it do no harm)
divided by ln 2, interpolated between blocks linearly in the logarithms. Estimated from M_e
effective orders, power / F follows an F(2, 2 M_e) law, so that

    P(power > z F) = (1 + z / M_e)^(-M_e),    surprise x = M_e ln(1 + z / M_e)

is again unit exponential. A sum of G surprises follows a gamma law of shape G. Over a scan of
C independent orders the largest passes x about C sqrt(π x / 3) e^(-x) times: oversampling adds to
the chances. Sources: [Scargle1982]; [Davies1987] and [Baluev2008] (the crossing rate), [Trunk1978]
(smallest of).

Low whole orders of the output are visible only in all runs together: a run over part of a turn
cannot tell order 2 from a trend. Runs that cover the circle together can, if the ripple stands
still on it: one amplitude and phase for all, an offset for each segment. An order k is claimed
where k times the longest covered arc is at least 1.5 turns, or the circle is closed; lower ones are
fitted beside it as unknowns and never named. Power is compared with a power law over the orders 1
to 40 around its median (noise at low orders is red).

Where runs cover part of a turn each, the low orders of all runs together are few and correlated,
and a floor that allows for red noise makes few of them significant. Those that exceed the median of
the other low orders are listed apart and never counted as found, with an error from leaving out one
run at a time (jackknife: [Efron1982]), which holds for noise of any colour since runs are
independent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby, pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from flexspline.orders.spectrum import Stretch, fourier_sums

__all__ = [
    "CLEAR",
    "EFFECTIVE",
    "NEIGHBOURS",
    "SCANNED",
    "SEPARATE",
    "TOGETHER",
    "Estimate",
    "Faint",
    "Floor",
    "Line",
    "Round",
    "Share",
    "chance_in_scan",
    "estimates",
    "even_weights",
    "find_faint",
    "find_lines",
    "find_low",
    "is_new",
    "less_low",
    "neighbours",
    "peaks",
    "pooled",
    "powers",
    "scan",
    "scattered",
    "surprise",
    "visible",
]

Level = TypeVar("Level", float, NDArray[np.float64])

_CHUNK = 1 << 15
_MOST = 200  # lines; more are not ripple

CLEAR = 2.0  # standard errors that a line must keep once all are fitted together
SEPARATE = 0.1  # of its information that an order must keep beside the others

EFFECTIVE = 0.48  # orders that a median of exponential powers is worth: ln(2)² for the mean
_NEAR, _FAR = 1.5, 8.0  # independent orders
_LEAKAGE = 0.01  # twice the mean of sinc² over 1.5 to 8
NEIGHBOURS = _FAR - _NEAR
_FIRST, _LARGEST, _GROWTH = 16.0, 64.0, 1.3  # independent orders in a block

SCANNED = 40
TOGETHER = "all runs"
_CYCLES = 1.5  # turns that a low order must have over the longest covered arc
_BINS = 180
_CLOSED = 0.98  # turns: the circle counts as covered
_EDGE = 0.25  # the end of a fitted power law is known a quarter as well as its middle
_KEPT = 0.05  # of its information that an order must keep beside offsets and other orders

_RUNS = 4  # fewer say nothing on how much one differs from the next


@dataclass(frozen=True)
class Line:
    """An order per output turn, its false-alarm probability, and the resolution there."""

    order: float
    chance: float
    resolution: float


@dataclass(frozen=True, eq=False)
class Round:
    """What one scan saw, over `order`: the two statistics, their shapes and the sharpest span.

    `power`, `steady`: over the block floors alone, summed as it is and with phases.
    """

    order: NDArray[np.float64]
    summed: NDArray[np.float64]
    seen: NDArray[np.float64]
    coherent: NDArray[np.float64]
    turns: NDArray[np.float64]
    power: NDArray[np.float64]
    steady: NDArray[np.float64]
    floors: list[Floor | None]


def scan(
    parts: Sequence[Stretch],
    rest: Sequence[NDArray[np.float64]],
    turns: int,
    highest: float,
    lines: Sequence[float],
) -> Round:
    """Return the statistics of one round over orders k = 0, 1/turns, … `highest`."""
    order = np.arange(int(np.floor(highest * turns + 1e-9)) + 1) / turns
    summed, seen, span, total = np.zeros((4, len(order)))
    phasor, spread, support = np.zeros(len(order), complex), *np.zeros((2, len(order)))
    over_floor, weight = np.zeros(len(order), complex), np.zeros(len(order))
    floors: list[Floor | None] = []
    for part, values in zip(parts, rest, strict=True):
        where = slice(*np.searchsorted(order, [part.lowest, min(part.highest, highest)]))
        k = order[where]
        floor = None
        if len(k) > 2:
            sums = fourier_sums(part.angle, values, turns, highest)[where]
            power = np.abs(sums) ** 2 / len(values)
            floor = block_floor(k, power, part.turns, lines)
        floors.append(floor)
        if floor is None:
            continue
        level, known = floor.level(k), floor.support(k)
        total[where] += power / level
        over_floor[where] += sums / level
        weight[where] += len(values) / level
        beside = neighbours(power, turns / part.turns)
        known = np.where(beside > level, np.minimum(known, NEIGHBOURS), known)
        level = np.maximum(level, beside)
        summed[where] += surprise(power / level, known)
        seen[where] += 1
        phasor[where] += sums / level
        spread[where] += len(values) / level
        support[where] += known
        span[where] = np.maximum(span[where], part.turns)
    coherent = surprise(np.abs(phasor) ** 2 / np.maximum(spread, 1e-300), np.maximum(support, 1.0))
    steady = np.abs(over_floor) ** 2 / np.maximum(weight, 1e-300)
    return Round(order, summed, seen, coherent, span, total, steady, floors)


def find_lines(
    parts: Sequence[Stretch],
    turns: int,
    highest: float,
    false_alarm: float,
    snap: Callable[[float, float], float],
    known: Sequence[Line] = (),
) -> tuple[list[Line], Round]:
    """Search until nothing stands out; return the lines and the last round.

    Parameters
    ----------
    turns, highest : int, float
        Step (1/turns) and end of the orders scanned.
    false_alarm : float
        Probability that noise alone yields any line.
    snap : callable
        (order, resolution) -> the whole order that it stands for, or the order itself.
    known : sequence of Line
        Lines that the values are free of already, near which nothing is named.
    """
    lines: list[Line] = []
    rest: Sequence[NDArray[np.float64]] = [part.values for part in parts]
    apart = 3 / min(part.turns for part in parts)
    while True:
        seen = scan(parts, rest, turns, highest, [line.order for line in (*known, *lines)])
        new: list[Line] = []
        strongest = 0.0
        for strength, peak in peaks(seen, false_alarm):
            line = Line(snap(peak.order, peak.resolution), peak.chance, peak.resolution)
            if strength < 0.2 * strongest:
                break
            if is_new(line, [*known, *lines], 2.0) and is_new(line, new, apart / line.resolution):
                strongest = strongest or strength
                new.append(line)
        if not new or len(lines) > _MOST:
            return lines, seen
        lines += new
        rest = [without(part, [line.order for line in lines]) for part in parts]


def without(part: Stretch, orders: Sequence[float]) -> NDArray[np.float64]:
    """Return the stretch's values, shape (rows,), less what base and `orders` explain."""
    here = visible(part, orders)
    if not here:
        return part.values
    gram, moment, shared = normal_equations(part, here)
    level = np.trace(gram) / len(gram)
    weight = np.linalg.solve(gram + 1e-6 * level * np.eye(len(gram)), moment)
    rest = part.values + part.base @ (shared @ weight)
    for rows, columns in _harmonics(part, here):
        rest[rows] -= columns @ weight
    return rest


def visible(part: Stretch, orders: Sequence[float]) -> list[float]:
    """Return those of `orders` that the stretch can show."""
    return [k for k in orders if part.lowest <= k <= part.highest]


def normal_equations(
    part: Stretch, orders: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return XᵀX, Xᵀy and BᵀX: X cosine and sine of each order less its smooth part B.

    Shapes (2 orders, 2 orders), (2 orders,) and (base columns, 2 orders).
    """
    size = 2 * len(orders)
    gram, moment = np.zeros((size, size)), np.zeros(size)
    shared = np.zeros((part.base.shape[1], size))
    for rows, columns in _harmonics(part, orders):
        gram += columns.T @ columns
        moment += columns.T @ part.values[rows]
        shared += part.base[rows].T @ columns
    return gram - shared.T @ shared, moment, shared


def _harmonics(
    part: Stretch, orders: Sequence[float]
) -> Iterator[tuple[slice, NDArray[np.float64]]]:
    """Yield chunks of rows with columns cos k_1 q, sin k_1 q, cos k_2 q, …"""
    for first in range(0, len(part.angle), _CHUNK):
        rows = slice(first, first + _CHUNK)
        phase = part.angle[rows, None] * np.asarray(orders)
        columns = np.empty((len(phase), 2 * len(orders)))
        columns[:, 0::2], columns[:, 1::2] = np.cos(phase), np.sin(phase)
        yield rows, columns


def peaks(seen: Round, false_alarm: float) -> list[tuple[float, Line]]:
    """Return significant peaks with their power over the floor, the strongest first."""
    step = seen.order[1] - seen.order[0]
    cells = 2 * step * float(np.sum(seen.turns))  # two statistics
    found: list[tuple[float, Line]] = []
    for x, shape, power in (
        (seen.summed, seen.seen, seen.power),
        (seen.coherent, np.minimum(seen.seen, 1.0), seen.steady),
    ):
        middle = x[1:-1]
        top = (middle >= x[:-2]) & (middle > x[2:]) & (middle > shape[1:-1] + 4)
        at = 1 + np.flatnonzero(top)
        chance = chance_in_scan(x[at], shape[at], cells)
        for i, p in zip(at[chance < false_alarm], chance[chance < false_alarm], strict=True):
            k = _summit(power, int(i), round(0.5 / (seen.turns[i] * step)))
            order = float(seen.order[k] + step * _beside(power, k))
            found.append((float(power[k]), Line(order, float(p), float(1 / seen.turns[i]))))
    return sorted(found, key=lambda peak: -peak[0])


def _summit(power: NDArray[np.float64], at: int, reach: int) -> int:
    """Return where the power is highest within `reach` entries of `at`."""
    first = max(at - reach, 0)
    return first + int(np.argmax(power[first : at + reach + 1]))


def _beside(power: NDArray[np.float64], at: int) -> float:
    """Return by how many entries a parabola's top lies beside `at`."""
    if not 0 < at < len(power) - 1:
        return 0.0
    before, here, after = power[at - 1 : at + 2]
    bend = before - 2 * here + after
    return float(0.5 * (before - after) / bend) if bend < 0 else 0.0


def is_new(line: Line, known: Sequence[Line], distance: float) -> bool:
    """Whether `line` lies `distance` resolutions or more from every line of `known`."""
    return all(abs(line.order - other.order) >= distance * line.resolution for other in known)


@dataclass(frozen=True, eq=False)
class Share:
    """An order in one stretch: name, signed speed [rad/s], rows, (a, b) and covariance."""

    stretch: str
    speed: float
    rows: int
    weight: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @property
    def amplitude(self) -> float:
        """√(a² + b²), in the unit of the values."""
        return float(np.hypot(*self.weight))


@dataclass(frozen=True)
class Estimate:
    """An order over all stretches: amplitudes in the unit of the values, phase in rad."""

    amplitude: float
    error: float
    steady: float
    phase: float
    phase_error: float
    shares: tuple[Share, ...]


def estimates(
    parts: Sequence[Stretch], floors: Sequence[Floor | None], orders: Sequence[float]
) -> list[Estimate | None]:
    """Return one estimate for each of `orders`, None where no stretch separates it."""
    shares: list[list[Share]] = [[] for _ in orders]
    for part, floor in zip(parts, floors, strict=True):
        here = visible(part, orders)
        if floor is None or not here:
            continue
        gram, moment, _ = normal_equations(part, here)
        level = np.trace(gram) / len(gram)
        inverse = np.linalg.inv(gram + 1e-9 * level * np.eye(len(gram)))
        weight, noise = inverse @ moment, floor.level(np.array(here))
        for i, order in enumerate(here):
            pair = slice(2 * i, 2 * i + 2)
            block = inverse[pair, pair]
            if np.linalg.eigvalsh(block)[-1] * SEPARATE * len(part.angle) / 2 < 1:
                shares[list(orders).index(order)].append(
                    Share(part.name, part.speed, len(part.angle), weight[pair], noise[i] * block)
                )
    return [combined(found) if found else None for found in shares]


def combined(shares: Sequence[Share]) -> Estimate:
    """Return the estimate over `shares`, which must not be empty."""
    spread = np.array([np.trace(share.covariance) for share in shares])
    power = np.array([share.amplitude**2 for share in shares]) - spread
    each = even_weights(power, spread)
    information = [np.linalg.inv(share.covariance) for share in shares]
    covariance = np.linalg.inv(np.sum(information, axis=0))
    pulls = [info @ share.weight for info, share in zip(information, shares, strict=True)]
    a, b = covariance @ np.sum(pulls, axis=0)
    steady = float(np.hypot(a, b))
    across = np.array([-b, a]) / max(steady, 1e-300)
    phase_error = float(np.sqrt(across @ covariance @ across)) / max(steady, 1e-300)
    return Estimate(
        float(np.sqrt(max(each @ power, 0.0))),
        float(np.sqrt(each**2 @ spread / 2)),
        steady,
        float(np.arctan2(b, a)),
        min(phase_error, float(np.pi)),
        tuple(shares),
    )


def scattered(shares: Sequence[Share]) -> tuple[float, NDArray[np.float64]]:
    """Return the spread of the stretches about their steady part, and that part's covariance.

    Each stretch has a wave of its own, β_g = β + δ_g, beside the noise. δ_g has the variance

        τ² = max(0, (Σ w_g |β_g - β|² / 2 - (G - 1)) / (Σ w_g - Σ w_g² / Σ w_g)),

    in a and in b alike, w_g = 2 / tr cov_g and β the steady part [DerSimonianLaird1986]; the spread
    is √2 τ, the root mean square of |δ_g|, in the unit of the values. Waves of opposite phases have
    no steady part and a spread as large as they are. Of one stretch it is NaN.
    """
    information = [np.linalg.inv(share.covariance) for share in shares]
    covariance = np.linalg.inv(np.sum(information, axis=0))
    if len(shares) < 2:
        return float("nan"), covariance
    pulls = [info @ share.weight for info, share in zip(information, shares, strict=True)]
    beta = covariance @ np.sum(pulls, axis=0)
    weight = np.array([2 / np.trace(share.covariance) for share in shares])
    apart = np.array([np.sum((share.weight - beta) ** 2) for share in shares])
    total = weight.sum()
    room = total - weight @ weight / total
    square = max((weight @ apart / 2 - (len(shares) - 1)) / room, 0.0)
    return float(np.sqrt(2 * square)), covariance + square * (weight @ weight) / total**2 * np.eye(
        2
    )


def even_weights(power: NDArray[np.float64], spread: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return w_g, summing to one, for estimated powers A_g² with noise of power `spread`."""
    weight = 1 / spread / np.sum(1 / spread)
    for _ in range(5):
        weight = 1 / (max(float(weight @ power), 0.0) + spread)
        weight /= weight.sum()
    return np.asarray(weight)


@dataclass(frozen=True, eq=False)
class Floor:
    """Floor over blocks of orders: their centres, levels and effective number of orders."""

    centres: NDArray[np.float64]
    levels: NDArray[np.float64]
    counts: NDArray[np.float64]

    def level(self, order: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return F at `order`; below the first block it goes on rising as between the first two."""
        x, known, levels = np.log(order), np.log(self.centres), np.log(self.levels)
        value = np.interp(x, known, levels)
        if len(known) > 1:
            slope = min((levels[1] - levels[0]) / (known[1] - known[0]), 0.0)
            value = value + np.where(x < known[0], slope * (x - known[0]), 0.0)
        return np.asarray(np.exp(value), dtype=np.float64)

    def support(self, order: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return M_e at `order`."""
        return np.asarray(np.interp(np.log(order), np.log(self.centres), self.counts))


def neighbours(power: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Return the smaller of the mean powers 1.5 to 8 independent orders below and above.

    What a line at the order itself leaks there over its span, and twice that, is taken off.
    `cell` is the number of entries of `power`, shape (orders,), for one independent order.
    """
    near, far = max(1, round(_NEAR * cell)), max(2, round(_FAR * cell))
    total = np.concatenate([[0.0], np.cumsum(power)])
    at, size = np.arange(len(power)), len(power)

    def mean(first: NDArray[np.intp], last: NDArray[np.intp]) -> NDArray[np.float64]:
        first, last = np.clip(first, 0, size), np.clip(last, 0, size)
        full = last - first >= 0.75 * (far - near)
        value = (total[last] - total[first]) / np.maximum(last - first, 1)
        return np.asarray(np.where(full, value, np.inf))

    around = np.minimum(mean(at - far, at - near), mean(at + near + 1, at + far + 1))
    least = np.where(np.isfinite(around), around, 0.0) - _LEAKAGE * power
    return np.asarray(np.maximum(least, 0.0))


def block_floor(
    order: NDArray[np.float64], power: NDArray[np.float64], turns: float, taken: Sequence[float]
) -> Floor | None:
    """Return the floor of `power` over the evenly spaced `order`, None where too few are seen.

    Parameters
    ----------
    order, power : array, shape (orders,)
        Orders per output turn, > 0, and power in any unit.
    turns : float
        Span of the data: 1/turns is the distance of independent orders.
    taken : sequence of float
        Orders of lines already fitted and taken out, whose neighbourhood is too quiet.
    """
    free = power > 0
    for line in taken:
        free &= np.abs(order - line) > 0.6 / turns
    cells = (order[-1] - order[0]) * turns
    if cells < 12 or np.count_nonzero(free) < 12:
        return None
    edges, width = [0.0], _FIRST
    while edges[-1] < cells:
        edges.append(edges[-1] + width)
        width = min(width * _GROWTH, _LARGEST)
    if len(edges) > 2 and cells - edges[-2] < _FIRST:
        del edges[-2]
    marks = np.searchsorted((order - order[0]) * turns, edges)
    step = (order[1] - order[0]) * turns
    centres, levels, support = [], [], []
    for first, last in pairwise(marks):
        inside = first + np.flatnonzero(free[first:last])
        if len(inside) * step >= 6:
            centres.append(float(np.exp(np.mean(np.log(order[inside])))))
            levels.append(float(np.median(power[inside])) / np.log(2))
            support.append(len(inside) * step)
    if not centres:
        return None
    return Floor(np.array(centres), np.array(levels), EFFECTIVE * np.array(support))


def surprise(ratio: NDArray[np.float64], support: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x = M ln(1 + z / M), unit exponential for noise alone, 0 at M = 0; as `ratio`."""
    known = np.where(support > 0.0, support, 1.0)
    return np.where(support > 0.0, known * np.log1p(ratio / known), 0.0)


def chance_in_scan(
    x: NDArray[np.float64], shape: NDArray[np.float64], cells: float
) -> NDArray[np.float64]:
    """Return the probability that noise alone passes `x` somewhere in a scan.

    Parameters
    ----------
    x, shape : array, shape (peaks,)
        Sum of surprises and how many were summed.
    cells : float
        Number of independent orders scanned.
    """
    single = special.gammaincc(shape, x)
    tail = -np.log(np.maximum(single, 1e-300))
    often = np.maximum(1.0, np.sqrt(np.pi * tail / 3)) * cells * single
    return np.asarray(-np.expm1(-often), dtype=np.float64)


def covered_arc(angles: Sequence[NDArray[np.float64]]) -> float:
    """Return the longest arc of the circle that is covered without a gap, in turns (at most 1)."""
    hit = np.zeros(_BINS, dtype=bool)
    for angle in angles:
        hit[(np.mod(angle / (2 * np.pi), 1.0) * _BINS).astype(int) % _BINS] = True
    if hit.all():
        return 1.0
    gaps = np.flatnonzero(~hit)
    return float(np.diff(np.append(gaps, gaps[0] + _BINS)).max() - 1) / _BINS


def find_low(parts: Sequence[Stretch], false_alarm: float) -> tuple[list[Line], list[Estimate]]:
    """Return low lines and their estimates, sought where single stretches see too little."""
    first, last = scanned_low(parts)
    if first > last:
        return [], []
    longest = max(part.turns for part in parts)
    arc = covered_arc([part.angle for part in parts])
    gram, moment, rows = sums = pooled(parts)
    taken, tried = list(range(1, first)), np.arange(first, SCANNED + 1)
    found, floor = _standing_out(sums, taken, tried, last, partial(_power_law, tried), false_alarm)
    lines = [Line(float(order), chance, 1 / max(arc, longest)) for order, chance in found]
    levels = [float(floor[int(line.order) - first]) for line in lines]
    return lines, _estimates(gram, moment, rows, taken, lines, levels)


def _standing_out(
    sums: tuple[NDArray[np.float64], NDArray[np.float64], int],
    taken: list[int],
    tried: NDArray[np.intp],
    last: int,
    floor_of: Callable[[NDArray[np.float64]], tuple[Level, float]],
    false_alarm: float,
) -> tuple[list[tuple[int, float]], Level]:
    """Move what stands out of a floor, the largest first, from `tried` up to `last` to `taken`.

    Returns orders with their probabilities, and the floor beside all of them.
    """
    count = int(last - tried[0] + 1)
    found: list[tuple[int, float]] = []
    while True:
        power = powers(*sums, taken, tried)
        floor, support = floor_of(power)
        x = surprise(power / floor, np.full(len(power), support))
        best = int(np.argmax(x[:count]))
        chance = float(chance_in_scan(x[[best]], np.ones(1), float(count))[0])
        if chance >= false_alarm or support < 2:
            return found, floor
        taken.append(int(tried[best]))
        found.append((taken[-1], chance))


def _power_law(
    order: NDArray[np.intp], power: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the floor at each order, and how many orders it is worth (0: not known)."""
    free = np.flatnonzero(power > 0)
    if len(free) < 10:
        return np.ones(len(power)), 0.0
    slope = min(float(stats.theilslopes(np.log(power[free]), np.log(order[free]))[0]), 0.0)
    shape = order.astype(np.float64) ** slope
    level = np.median(power[free] / shape[free]) / np.log(2)
    return level * shape, _EDGE * EFFECTIVE * len(free)


def scanned_low(parts: Sequence[Stretch]) -> tuple[int, int]:
    """Return the first and last low order that may be claimed, (1, 0) where there is none."""
    arc = covered_arc([part.angle for part in parts])
    first = 1 if arc >= _CLOSED else int(np.ceil(_CYCLES / max(arc, 1 / _BINS)))
    last = min(SCANNED, int(10 / max(part.turns for part in parts)))
    return (first, last) if first <= min(last, SCANNED // 4) else (1, 0)


def flat_floor(power: NDArray[np.float64]) -> tuple[float, float]:
    """Return one floor for all low orders, and how many orders it is worth (0: not known)."""
    free = power[power > 0]
    if len(free) < 10:
        return 1.0, 0.0
    return float(np.median(free)) / float(np.log(2)), _EDGE * EFFECTIVE * len(free)


def less_low(
    part: Stretch, lines: Sequence[Line], found: Sequence[Estimate]
) -> NDArray[np.float64]:
    """Return the stretch's values, shape (rows,), less the low lines."""
    rest = part.values.copy()
    for line, estimate in zip(lines, found, strict=True):
        wave = estimate.steady * np.cos(line.order * part.angle - estimate.phase)
        rest -= wave - part.base @ (part.base.T @ wave)
    return rest


def pooled(parts: Sequence[Stretch]) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Return XᵀX, Xᵀy for orders 1 to 40 less each stretch's mean, and the number of rows."""
    size = 2 * SCANNED
    gram, moment = np.zeros((size, size)), np.zeros(size)
    for part in parts:
        y = part.raw
        total, centred = np.zeros(size), y - y.mean()
        for first in range(0, len(y), 1 << 15):
            turn = part.angle[first : first + (1 << 15), None] * np.arange(1, SCANNED + 1)
            columns = np.concatenate([np.cos(turn), np.sin(turn)], axis=1)
            gram += columns.T @ columns
            moment += columns.T @ centred[first : first + (1 << 15)]
            total += columns.sum(axis=0)
        gram -= np.outer(total, total) / len(y)
    return gram, moment, sum(len(part.raw) for part in parts)


def harmonic_columns(orders: Sequence[int]) -> NDArray[np.intp]:
    """Return where the cosines and the sines of `orders` stand among the pooled columns."""
    cosines = np.asarray(orders, dtype=np.intp) - 1
    return np.concatenate([cosines, cosines + SCANNED])


def powers(
    gram: NDArray[np.float64],
    moment: NDArray[np.float64],
    rows: int,
    taken: Sequence[int],
    tried: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Return half the drop of the squared rest by each tried order beside those taken."""
    base = harmonic_columns(taken)
    known = np.linalg.pinv(gram[np.ix_(base, base)], rcond=1e-6, hermitian=True)
    power = np.zeros(len(tried))
    for i, k in enumerate(tried):
        if int(k) in taken:
            continue
        pair = harmonic_columns([int(k)])
        shared = gram[np.ix_(pair, base)] @ known
        inner = gram[np.ix_(pair, pair)] - shared @ gram[np.ix_(base, pair)]
        rest = moment[pair] - shared @ moment[base]
        if np.linalg.eigvalsh(inner)[0] > _KEPT * rows / 2:
            power[i] = 0.5 * rest @ np.linalg.solve(inner, rest)
    return power


def _estimates(
    gram: NDArray[np.float64],
    moment: NDArray[np.float64],
    rows: int,
    taken: Sequence[int],
    lines: Sequence[Line],
    levels: Sequence[float],
) -> list[Estimate]:
    """Return the joint estimates of `lines`, with their floors."""
    base = harmonic_columns(taken)
    inverse = np.linalg.pinv(gram[np.ix_(base, base)], rcond=1e-6, hermitian=True)
    weight = inverse @ moment[base]
    found = []
    for line, level in zip(lines, levels, strict=True):
        i = list(taken).index(int(line.order))
        pair = np.array([i, i + len(taken)])
        found.append(
            combined(
                [
                    Share(
                        TOGETHER,
                        float("nan"),
                        rows,
                        weight[pair],
                        level * inverse[np.ix_(pair, pair)],
                    )
                ]
            )
        )
    return found


@dataclass(frozen=True)
class Faint:
    """A whole order per output turn with amplitude and its standard error [unit]."""

    order: int
    amplitude: float
    error: float


def find_faint(
    parts: Sequence[Stretch], found: Sequence[float], false_alarm: float
) -> tuple[Faint, ...]:
    """Return low orders that stand out of a flat floor beside those `found` already."""
    first, last = scanned_low(parts)
    runs = [list(group) for _, group in groupby(parts, lambda part: part.run)]
    if first > last or len(runs) < _RUNS:
        return ()
    each = [pooled(run) for run in runs]
    gram = np.sum([e[0] for e in each], axis=0)
    moment = np.sum([e[1] for e in each], axis=0)
    rows = sum(e[2] for e in each)
    taken = [*range(1, first), *(int(k) for k in found if k <= SCANNED and k == int(k))]
    tried = np.arange(first, SCANNED + 1)
    new, _ = _standing_out((gram, moment, rows), taken, tried, last, flat_floor, false_alarm)
    return tuple(_jackknifed(each, taken, order) for order, _ in sorted(new))


def _jackknifed(
    each: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], int]],
    taken: Sequence[int],
    order: int,
) -> Faint:
    """Return `order` fitted beside `taken`, its error from leaving out one run at a time."""
    base = harmonic_columns(taken)
    at = [list(taken).index(order), list(taken).index(order) + len(taken)]
    grams, moments = np.array([e[0] for e in each]), np.array([e[1] for e in each])

    def fitted(kept: NDArray[np.bool_]) -> NDArray[np.float64]:
        gram = grams[kept].sum(axis=0)[np.ix_(base, base)]
        inverse = np.linalg.pinv(gram, rcond=1e-6, hermitian=True)
        return np.asarray((inverse @ moments[kept].sum(axis=0)[base])[at])

    runs = len(each)
    whole = fitted(np.ones(runs, dtype=bool))
    less_one = np.array([fitted(np.arange(runs) != run) for run in range(runs)])
    spread = less_one - less_one.mean(axis=0)
    amplitude = float(np.hypot(*whole))
    along = spread @ whole / max(amplitude, 1e-300)
    return Faint(order, amplitude, float(np.sqrt((runs - 1) / runs * np.sum(along**2))))
