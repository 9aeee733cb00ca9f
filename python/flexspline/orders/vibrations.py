"""Vibrations that stay at one frequency, told from what turns with the joint by its speed.

Order k of a stretch at one speed v and a vibration at f = k |v| / 2π are the same wave there. They
part where the speed is another one, from stretch to stretch or within one. So the values are
scanned over the angle and over the time (`orders/scan.py`, with 2π t in the place of the angle, so
that Hz stand in the place of orders per turn), and what turns competes with what does not: of both
scans the strongest line is taken, all lines are fitted together and subtracted, and the rest is
scanned again. At one speed alone both are equally strong, and a line counts as an order.

A line is told from one of the other kind by pieces of runs in which it is significant: stretches,
each cut into its slow and its fast rows where a changing speed takes the phase of the order away
from that of the frequency. Of two pieces of durations T, T' the speeds v, v' (of 90 % of the rows)
have to be so far apart that the order moves by more than both resolve:

    k (min v - max v') / 2π > 1/T + 1/T'.

A vibration has to be distinguished so, and to be significant in half of those pieces at least that
would show it: what a strong order leaves behind is a line at one speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.log import Log
from flexspline.orders.scan import (
    CLEAR,
    SEPARATE,
    Floor,
    Line,
    Round,
    even_weights,
    is_new,
    peaks,
    scan,
    surprise,
)
from flexspline.orders.spectrum import NYQUIST, Stretch, step_turns

__all__ = ["Competition", "Mode", "Piece", "Vibration", "compete", "excited", "one_speed",
           "ringing"]  # fmt: skip

Array = NDArray[np.float64]

SIGNIFICANT = 0.01
"""Chance that noise alone makes a line significant in any of the stretches that are looked at."""

SEEN = 0.5
"""Share of the stretches that would show a vibration in which it has to be significant."""

STRONGER = 1.1
"""Times the strongest order that a vibration has to be: at one speed alone both are one line, and
their strengths differ by what the floors do."""

BESIDE = 7
"""Independent lines on either side that tell the noise of a piece: what an order of varying size
leaves behind is no line there, and more than the floor."""

STRONGEST = 0.2  # of the strongest line of a round: weaker ones may be its leakage
STEADY = 0.05  # spread of the speeds of what counts as one speed, as in `logs/segments.py`
PEAK = 4.0
"""Times |H|² an octave beside it, on either side, that a mode has: those with a damping ratio of up
to 0.18 do, to 0.32 at half of it and 0.12 at twice. Of 60 simulated rigs without one, it was 1.1 at
most in the four where a tenth of the rest and more followed the acceleration."""

SEGMENT = 4.0  # s, of which spectra are averaged: a mode of a hertz rings that often in it
SLOWEST = 4.0  # periods in a segment, above which a mode is looked for
MUCH = 0.1  # of the mean square, that a mode has to make to be worth a word
OCTAVE = np.sqrt(2.0)  # either way of a frequency

MOST = 50  # lines of one kind
_MOST_SCANNED = 5_000_000  # frequencies, 0.1 kB each: of one hour at 1 kHz, all
_CYCLES = 1.5  # in a stretch, below which a vibration cannot be told from a trend
_CHUNK = 1 << 15
_TINY = 1e-300


@dataclass(frozen=True)
class Vibration:
    """A vibration at `frequency` [Hz], whatever the speed.

    `resolution`: Hz; two nearer ones are indistinguishable. `amplitude`, `error`: root mean square
    over the pieces and its standard error [unit]. `chance`: that noise alone gives such a peak
    anywhere in the scan. `speeds`: of the slowest and the fastest piece that shows it [rad/s].
    `seen`, `of`: pieces that show it, and that would.
    """

    frequency: float
    resolution: float
    amplitude: float
    error: float
    chance: float
    speeds: tuple[float, float]
    seen: int
    of: int


@dataclass(frozen=True)
class Mode:
    """What follows an input through a resonance at `frequency` [Hz].

    `share`: of the mean square of the values, which within an octave around it follows the input.
    """

    frequency: float
    share: float


Piece = tuple[Array, Array, Array]
"""Time [s], input and values, (N,) each, without a gap."""


@dataclass(frozen=True)
class Competition:
    """What is left of orders and frequencies once they have competed.

    `orders`: lines per output turn that no vibration explains, and `waves` those in Hz, of which
    the `vibrations` are what is told from an order. `floors`: of the noise over the orders, by
    stretch. `scanned`: lowest and highest frequency [Hz].
    """

    orders: tuple[Line, ...]
    waves: tuple[Line, ...]
    vibrations: tuple[Vibration, ...]
    floors: tuple[Floor | None, ...]
    scanned: tuple[float, float]

    def speed_alone(self, parts: Sequence[Stretch], order: float, resolution: float) -> float:
        """Return the speed [rad/s] at which alone an order is seen; NaN where several tell it.

        `order`, `resolution`: per output turn. What no single piece shows counts as seen in all.
        """
        others = [line for line in self.orders if abs(line.order - order) >= resolution]
        values = [_less(part, others, self.waves) for part in parts]
        pieces = _pieces(parts, parts, values, self.floors, order)
        seen = _significant(pieces) or pieces or _all_pieces(parts, order)
        if _apart(seen, [order] * len(seen)):
            return float("nan")
        return float(np.median([piece.speed for piece in seen]))


def compete(
    parts: Sequence[Stretch],
    highest: float,
    rate: float,
    false_alarm: float,
    snap: Callable[[float, float], float],
    known: Sequence[Line] = (),
) -> Competition:
    """Return the orders and the vibrations of stretches.

    Parameters
    ----------
    parts : without gaps in time, which would make each line many (`sweeps`).
    highest : order per output turn that is scanned.
    rate : Hz, of the slowest run.
    false_alarm : probability that noise alone yields any line.
    snap, known : as for `find_lines`.
    """
    timed = [_over_time(part, rate) for part in parts]
    turns, ticks = step_turns(parts), step_turns(timed)
    top = min(max(part.highest for part in timed), _MOST_SCANNED / ticks)
    orders: list[Line] = []
    waves: list[Line] = []
    rest: list[Array] = [part.values for part in parts]
    while True:
        here = [line.order for line in (*known, *orders)]
        over_angle = scan(parts, rest, turns, highest, here)
        over_time = scan(timed, rest, ticks, top, [line.order for line in waves])
        turning = _new(over_angle, parts, false_alarm / 2, [*known, *orders], snap)
        lasting = _new(over_time, timed, false_alarm / 2, waves, lambda frequency, _: frequency)
        if not (turning or lasting) or max(len(orders), len(waves)) > MOST:
            break
        if _strength(lasting) > STRONGER * _strength(turning):
            waves.append(lasting[0][1])
        else:
            orders.append(turning[0][1])
        rest = [_less(part, orders, waves) for part in parts]
    return Competition(
        tuple(orders),
        tuple(waves),
        _vibrations(parts, timed, orders, waves, over_time),
        tuple(over_angle.floors),
        (min(part.lowest for part in timed), top),
    )


def excited(pieces: Sequence[Piece], highest: float) -> Mode | None:
    """Return the mode that an input excites in values; None where none peaks, or pieces are short.

    Parameters
    ----------
    pieces : of one input.
    highest : Hz, up to which the input is known.
    """
    spectra = [made for piece in pieces if (made := _spectra(*piece)) is not None]
    if not spectra:
        return None
    common = min(made.shape[1] for made, _ in spectra)
    counts = [number for _, number in spectra]
    mean = np.average([made[:, :common] for made, _ in spectra], axis=0, weights=counts)
    own, all_power, shared = mean[0].real, mean[1].real, np.abs(mean[2]) ** 2
    gain, at, count = shared / np.maximum(own, _TINY) ** 2, np.arange(common) / SEGMENT, sum(counts)
    chance = 1.0 / max(count, 2)
    coherence = shared / np.maximum(own * all_power, _TINY)
    power = np.maximum(coherence - chance, 0.0) / (1.0 - chance) * all_power
    looked_at = (at >= SLOWEST / SEGMENT) & (at <= min(highest, at[-1] / 2.0))
    if not looked_at.any() or not all_power.any():
        return None
    peak = float(at[np.argmax(np.where(looked_at, power, 0.0))])
    near = (at > peak / OCTAVE) & (at < peak * OCTAVE)
    sides = [(0.5 * peak, peak / OCTAVE), (peak * OCTAVE, 2.0 * peak)]
    beside = max(float(np.median(gain[(at >= low) & (at <= high)])) for low, high in sides)
    if gain[at == peak][0] < PEAK * beside:
        return None
    return Mode(peak, float(power[near].sum() / all_power.sum()))


def ringing(
    runs: Sequence[tuple[Log, Array, Iterable[Sequence[int]]]], highest: Mapping[str, float]
) -> tuple[str, Mode] | None:
    """Return the channel that excites most of what is left, and the mode; None of a small one.

    Parameters
    ----------
    runs : log, what is left (N,), and its row ranges without a gap.
    highest : Hz, up to which a channel is known, by its name; one that a run lacks is passed over.
    """
    found: dict[str, Mode] = {}
    for channel, known in highest.items():
        pieces = [
            (log["time"][first:last], log[channel][first:last], left[first:last])
            for log, left, ranges in runs
            if channel in log
            for first, last in ranges
        ]
        whole = [piece for piece in pieces if all(np.isfinite(part).all() for part in piece)]
        mode = excited(whole, known)
        if mode is not None and mode.share > MUCH:
            found[channel] = mode
    return max(found.items(), key=lambda one: one[1].share, default=None)


def _spectra(time: Array, given: Array, values: Array) -> tuple[NDArray[np.complex128], int] | None:
    """S_xx, S_yy and S_xy (3, F) at multiples of 1 / SEGMENT, and of how many segments.

    None of a piece that is shorter than one.
    """
    from scipy.signal import csd

    if len(time) < 2:
        return None
    step = float(np.median(np.diff(time)))
    length = round(SEGMENT / step)
    if not 2 <= length <= len(time):
        return None
    pairs = ((given, given), (values, values), (given, values))
    made = np.array([csd(x, y, 1.0 / step, nperseg=length)[1] for x, y in pairs])
    return made, (len(time) - length) // (length - length // 2) + 1


def one_speed(parts: Sequence[Stretch]) -> bool:
    """Whether all stretches turn at one speed, in either direction."""
    speeds = [abs(part.speed) for part in parts]
    return max(speeds) - min(speeds) <= STEADY * max(speeds)


def _over_time(part: Stretch, rate: float) -> Stretch:
    """The stretch with 2π t as its angle: its orders are frequencies in Hz."""
    duration = float(np.ptp(part.time))
    return replace(
        part,
        angle=2.0 * np.pi * part.time,
        turns=duration,
        lowest=_CYCLES / duration,
        highest=NYQUIST * rate / 2.0,
    )


def _new(
    seen: Round,
    parts: Sequence[Stretch],
    false_alarm: float,
    known: Sequence[Line],
    snap: Callable[[float, float], float],
) -> list[tuple[float, Line]]:
    """Peaks that are new, the strongest first, without those that may be its leakage."""
    apart = 3 / min(part.turns for part in parts)
    new: list[tuple[float, Line]] = []
    for strength, peak in peaks(seen, false_alarm):
        line = Line(snap(peak.order, peak.resolution), peak.chance, peak.resolution)
        if strength < STRONGEST * _strength(new):
            break
        taken = [line for _, line in new]
        if is_new(line, known, 2.0) and is_new(line, taken, apart / line.resolution):
            new.append((strength, line))
    return new


def _strength(found: Sequence[tuple[float, Line]]) -> float:
    return found[0][0] if found else 0.0


def _less(part: Stretch, orders: Sequence[Line], waves: Sequence[Line]) -> Array:
    """Values (rows,) less these lines, fitted together."""
    turning = np.array([k.order for k in orders if part.lowest <= k.order <= part.highest])
    lasting = np.array([f.order for f in waves])
    count = 2 * (len(turning) + len(lasting))
    if count == 0:
        return part.values
    gram, moment = np.zeros((count, count)), np.zeros(count)
    shared = np.zeros((part.base.shape[1], count))
    for rows, columns in _columns(part, turning, lasting):
        gram += columns.T @ columns
        moment += columns.T @ part.values[rows]
        shared += part.base[rows].T @ columns
    gram -= shared.T @ shared
    ridge = 1e-6 * np.trace(gram) / count * np.eye(count)
    weight = np.linalg.solve(gram + ridge, moment)
    made = part.values + part.base @ (shared @ weight)
    for rows, columns in _columns(part, turning, lasting):
        made[rows] -= columns @ weight
    return made


def _columns(part: Stretch, turning: Array, lasting: Array) -> Iterator[tuple[slice, Array]]:
    """Yield chunks of rows with cosine and sine of each order, then of each frequency."""
    for first in range(0, len(part.angle), _CHUNK):
        rows = slice(first, first + _CHUNK)
        phase = np.concatenate(
            [part.angle[rows, None] * turning, 2.0 * np.pi * part.time[rows, None] * lasting],
            axis=1,
        )
        columns = np.empty((len(phase), 2 * phase.shape[1]))
        columns[:, 0::2], columns[:, 1::2] = np.cos(phase), np.sin(phase)
        yield rows, columns


@dataclass(frozen=True)
class _Piece:
    """A line in rows of a stretch that lasts `span` [s].

    `speeds` [rad/s]: quantiles of 5, 50 and 95 %. `power` and `noise`: |β|² and what noise makes of
    it in the mean, squared unit of the values.
    """

    speeds: tuple[float, float, float]
    span: float
    power: float = 0.0
    noise: float = 0.0

    @property
    def speed(self) -> float:
        return self.speeds[1]


def _pieces(
    parts: Sequence[Stretch],
    timed: Sequence[Stretch],
    values: Sequence[Array],
    floors: Sequence[Floor | None],
    line: float,
) -> list[_Piece]:
    """A line of `timed` in the pieces of the stretches `parts` that show it.

    `values`: (rows,) for each stretch, less all other lines. `timed`: the stretches themselves for
    an order.
    """
    found = []
    for part, one, data, floor in zip(parts, timed, values, floors, strict=True):
        if floor is None or not one.lowest <= line <= one.highest:
            continue
        level = float(floor.level(np.array([line]))[0])
        for rows in _rows_by_speed(part, _turning(line, part, one)):
            made = _fitted(one.angle[rows], data[rows], line)
            if made is None:
                continue
            power, trace, rest = made
            near = [
                [_fitted(one.angle[rows], rest, other) for other in side]
                for side in _beside(line, one.turns)
            ]
            told = [[each[0] for each in side if each is not None] for side in near]
            sides = [float(np.mean(side)) for side in told if side]
            noise = max([level * trace, *sides])
            found.append(replace(_piece(part, rows), power=power, noise=noise))
    return found


def _fitted(angle: Array, values: Array, line: float) -> tuple[float, float, Array] | None:
    """|β|² of a line, the trace of (XᵀX)⁻¹, and the rest; None where X is not of full rank."""
    wave = np.column_stack([np.cos(line * angle), np.sin(line * angle)])
    gram = wave.T @ wave
    if np.linalg.eigvalsh(gram)[0] < SEPARATE * len(angle) / 2:
        return None
    inverse = np.linalg.inv(gram)
    weight = inverse @ (wave.T @ values)
    return float(weight @ weight), float(np.trace(inverse)), values - wave @ weight


def _beside(line: float, turns: float) -> tuple[list[float], list[float]]:
    """Independent lines below and above one, the nearest left out; below zero there are none."""
    away = [number / turns for number in range(2, BESIDE + 2)]
    return [line - one for one in away if line > one], [line + one for one in away]


def _all_pieces(parts: Sequence[Stretch], order: float) -> list[_Piece]:
    """Every piece of the stretches, whatever it shows."""
    return [_piece(part, rows) for part in parts for rows in _rows_by_speed(part, order)]


def _piece(part: Stretch, rows: NDArray[np.bool_]) -> _Piece:
    low, middle, high = np.quantile(np.abs(part.speeds[rows]), [0.05, 0.5, 0.95]).tolist()
    return _Piece((low, middle, high), float(np.ptp(part.time)))


def _turning(line: float, part: Stretch, one: Stretch) -> float:
    """A line of a stretch, or of it over time, as an order per output turn."""
    return line if one is part else 2.0 * np.pi * line / abs(part.speed)


def _rows_by_speed(part: Stretch, order: float) -> list[NDArray[np.bool_]]:
    """All rows where an order keeps its phase beside a frequency; else slow and fast half.

    It keeps it where the angle stays within half a period of the order about a line over time.
    """
    time = part.time - part.time.mean()
    slope = (time @ part.angle) / max(float(time @ time), 1e-300)
    if order * float(np.std(part.angle - slope * time)) <= np.pi:
        return [np.ones(len(time), dtype=bool)]
    fast = np.abs(part.speeds) > np.median(np.abs(part.speeds))
    return [~fast, fast]


def _vibrations(
    parts: Sequence[Stretch],
    timed: Sequence[Stretch],
    orders: Sequence[Line],
    waves: Sequence[Line],
    seen: Round,
) -> tuple[Vibration, ...]:
    """The frequencies that are told from orders, the largest first."""
    found = []
    for number, line in enumerate(waves):
        others = [*waves[:number], *waves[number + 1 :]]
        values = [_less(part, orders, others) for part in parts]
        pieces = _pieces(parts, timed, values, seen.floors, line.order)
        made = _vibration(line, pieces)
        if made is not None:
            found.append(made)
    return tuple(sorted(found, key=lambda one: -one.amplitude))


def _vibration(line: Line, pieces: Sequence[_Piece]) -> Vibration | None:
    """A line over time as a vibration; None where it may be an order, or left of one."""
    shown = _significant(pieces)
    if not shown:
        return None
    noise = np.array([one.noise for one in pieces])
    power = np.array([one.power for one in pieces]) - noise
    weight = even_weights(power, noise)
    square = max(float(weight @ power), 0.0)
    level = _level(len(pieces))
    of = sum(one in shown or _surprise(square, one.noise) > level for one in pieces)
    orders = [2.0 * np.pi * line.order / one.speed for one in shown]
    amplitude = float(np.sqrt(square))
    error = float(np.sqrt(weight**2 @ noise / 2))
    if len(shown) < SEEN * of or amplitude <= CLEAR * error or not _apart(shown, orders):
        return None
    speeds = [one.speed for one in shown]
    return Vibration(
        line.order,
        line.resolution,
        amplitude,
        error,
        line.chance,
        (min(speeds), max(speeds)),
        len(shown),
        of,
    )


def _apart(pieces: Sequence[_Piece], orders: Sequence[float]) -> bool:
    """Whether these pieces tell a line, of this order in each, from one of the other kind."""
    finest = np.array([1.0 / one.span for one in pieces])
    low, _, high = np.array([one.speeds for one in pieces]).T
    least = np.minimum.outer(np.asarray(orders), np.asarray(orders))
    moved = np.subtract.outer(low, high) * least / (2.0 * np.pi)
    return bool((moved > np.add.outer(finest, finest)).any())


def _significant(pieces: Sequence[_Piece]) -> list[_Piece]:
    """Pieces whose power noise alone makes in few cases."""
    level = _level(len(pieces))
    return [one for one in pieces if _surprise(one.power, one.noise) > level]


def _surprise(power: float, noise: float) -> float:
    """How unlikely a power is beside a noise that so few lines tell, see `orders/scan.py`."""
    return float(surprise(np.array([power / noise]), np.array([float(BESIDE)]))[0])


def _level(count: int) -> float:
    return float(np.log(max(count, 1) / SIGNIFICANT))
