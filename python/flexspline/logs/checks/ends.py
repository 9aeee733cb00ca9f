"""Rows that belong to no experiment, at the ends of a log or at rest: reported, and left out.

A stuck tail repeats its last sample while the joint moves on: another channel shows the motion, or
the joint would have stopped, and its noise with it, from one row to the next. A joint that comes
to rest repeats its values with reason, and so does one whose drive never had noise: such rows are
no finding. A homing move ends where the angle is set anew: it jumps faster than the joint ever
moves, and stays there. A run that is meant to hold one speed has a transient at its start where
its velocity settles, or its torque at the same speed, angle and load. Rest, a stroke that begins
and gravity are none.

A search also leaves out the rows of a drive in which its joint rests: static friction is
undetermined within its level, so a residual of the motor torque at rest points to no cause, however
large it is. A joint rests where its angle stays for half a second within a hundredth of the way
that it covers at speed in that time; a reversal is no rest. A quarter of a second before, in which
a stop may come from a brake, and a quarter after count as rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import listed
from flexspline.logs.channels import CHANNELS, CONDITIONS
from flexspline.logs.checks.consistency import WITHIN
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.samples import LEVELS, LIVELY, unwrapped
from flexspline.logs.log import TEMPERATURES, Log
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.segments import median_step, stuck_from, true_ranges
from flexspline.logs.spikes import CONVERTED

__all__ = [
    "DRIVES",
    "at_work",
    "drive_disabled",
    "homing_move",
    "only_experiments",
    "resting",
    "stuck_tail",
]

Array = NDArray[np.float64]

DISABLED, HOMING, STUCK = "drive_disabled", "homing_move", "stuck_tail"

LEAST = 10
"""Rows: a shorter tail does no harm, and speeds are taken over as many."""

BEFORE = 50
"""Rows before a tail that show whether a channel has noise up to it."""

LONGER = 3.0
"""Times the longest repetition elsewhere in the log, which a coarse channel makes with reason."""

CHANCE = 1e-6
"""Probability that a tail is chance, over all rows in which one could begin."""

NOISY = 1.0 / 3.0
"""Share of rows in which a channel turns: white noise does in 2/3 of them, noise that an integrator
made in 1/2, smooth motion in next to none."""

MOVES = 0.1
"""Of the speed that 99 % of the rows do not exceed: a joint that is faster moves, whatever bias its
velocity has."""

JUMP = 10.0
"""Times the top speed elsewhere: to go that fast and stop within `JUMP_ROWS` no joint is able."""

JUMP_ROWS = 3
JUMPS = 8  # rows that jumps may take in a log
POSITIONS = ("output_position", "motor_position")
VELOCITY = {"output_position": "output_velocity", "motor_position": "motor_velocity"}
TORQUES = ("motor_torque", "motor_current")

DRIVES = ("motor_torque", "motor_current")
REASONS = {
    "stuck_tail": "in a stuck tail",
    "homing_move": "in a homing move",
    "drive_disabled": "while the drive was off",
}
SECONDS = 0.5
STILL = 0.01  # of the way that a joint covers at speed in that time
FEWEST = 100  # rows: a log of which less is left stays as it is

WINDOW = 0.1
"""s, the stretches that are compared."""

CHANNELS_CHECKED = ("output_velocity", "motor_velocity", "motor_current", "motor_torque")

FAR = 2.5
"""A stretch is transient where its RMS deviation is this many times the usual."""

ALIKE = 0.1
"""Of the steady speed, by which a stretch may be off and its torque be compared."""

SLACK = 0.05
"""Of the steady speed, by which a joint that speeds up smoothly may overshoot or lose speed."""

SAME = 1e-6
"""Relative singular value below which columns that explain a torque are taken for the same."""

LOADS = ("reference_torque", "sensor_torque")


def drive_disabled(log: Log) -> Iterator[Finding]:
    """Rows in which the drive is off, in a log in which it is on elsewhere: no fault of a sensor.

    `enabled` tells; without it a torque of exactly zero up to the end, while the joint moves.
    """
    if "enabled" in log:
        off = log["enabled"] < 0.5
        if not off.all():
            for first, last in true_ranges(off):
                yield _disabled(log, "enabled", int(first), int(last), "enabled is 0")
        return
    for channel in TORQUES:
        if (
            channel in log
            and log[channel][-1] == 0.0
            and _still(log[channel])
            and _dead(log, channel)
        ):
            first = _tail(log[channel]).first - 1  # the first zero is no sample either
            yield _disabled(log, channel, first, len(log), f"{channel} is exactly 0, to the end")
            return


def stuck_tail(log: Log) -> Iterator[Finding]:
    """The last sample, repeated to the end of the log by some channels or all, in motion."""
    still = [c for c in log.channels if _still(log[c])]
    off = [c for c in TORQUES if c in still and log[c][-1] == 0.0]
    found = [c for c in CONVERTED if c in still and c not in off and _dead(log, c)]
    found += [c for c in POSITIONS if c in still and _left_behind(log, c)]
    found += [c for p, c in VELOCITY.items() if c in still and _not_that_of(log, c, p)]
    longest = min(found, key=lambda c: _tail(log[c]).first, default="")
    first = _tail(log[longest]).first if found else len(log)
    whole = _all_stop(log)
    if whole is not None and whole <= first + 1:
        first, found, longest = whole, [], ""
    if first == len(log):
        return
    count = len(log) - first
    seconds = float(log["time"][-1] - log["time"][first - 1])
    what = listed(found) if found else "every measured channel"
    yield Finding(
        STUCK,
        "fault",
        found[0] if len(found) == 1 else "all",
        (first, len(log)),
        seconds,
        "s",
        f"{what} repeat{'s' if len(found) < 2 else ''} the last sample in the last {count} rows, "
        f"{first} to {len(log)} ({seconds:.3g} s), while the joint moves: the recorder is stuck.",
        f"Ask for the repair drop_stuck{longest and f'={longest}'}, or record again.",
    )


def homing_move(log: Log) -> Iterator[Finding]:
    """The lesser part of a log before or behind a jump of an angle, where it was set anew."""
    for channel in POSITIONS:
        jumps = _jumps(log, channel)
        if not jumps:
            continue
        edges = [(0, 0), *jumps, (len(log), len(log))]
        parts = [(a[1], b[0]) for a, b in pairwise(edges)]
        first, last = max(parts, key=lambda part: part[1] - part[0])
        if 2 * (last - first) <= len(log):
            continue
        angle = unwrapped(log, channel)
        for begin, end in ((0, first), (last, len(log))):
            inside = [jump for jump in jumps if begin <= jump[0] <= end]
            if begin == end or not inside:
                continue
            row = (inside[-1] if begin == 0 else inside[0])[0]
            size = float(angle[min(row + 1, len(angle) - 1)] - angle[max(row - 2, 0)])
            yield Finding(
                HOMING,
                "fault",
                channel,
                (begin, end),
                size,
                "rad",
                f"{channel} jumps by {size:.4g} rad in row {row}, faster than the joint ever "
                f"moves elsewhere: the angle was set anew (homing, index search). Rows {begin} to "
                f"{end} count from another zero.",
                f"Ask for the repair keep={_span_of(log['time'], first, last)}.",
            )
        return


def _span_of(time: Array, first: int, last: int) -> str:
    """FROM:TO in which the rows [first, last) lie, and none beside them."""
    start = _decimal(time[first], time[first - 1]) if first > 0 else ""
    end = _decimal(time[last - 1], time[last]) if last < len(time) else ""
    return f"{start}:{end}"


def _decimal(value: float, other: float) -> str:
    """A number between both, not the other one, with as few decimals as that takes."""
    for decimals in range(10):
        text = f"{value:.{decimals}f}"
        if min(value, other) <= float(text) <= max(value, other) and float(text) != other:
            return text
    return repr(float(value))


def _disabled(log: Log, channel: str, first: int, last: int, why: str) -> Finding:
    time = log["time"]
    return Finding(
        DISABLED,
        "note",
        channel,
        (first, last),
        float(time[last - 1] - time[first]),
        "s",
        f"the drive is off in rows {first} to {last}: {why}.",
        "These rows say nothing of a drive.",
    )


@dataclass(frozen=True)
class _Tail:
    """Rows from `first` on repeat the row before it.

    `longest`: repetition before, in rows; `share` of such rows there, of `counted` ones.
    """

    first: int
    length: int
    longest: int
    share: float
    counted: int


def _still(values: Array) -> bool:
    """Whether a channel keeps its value over the last rows: the others need no further look."""
    return len(values) > LEAST and bool(np.all(values[-LEAST - 1 :] == values[-1]))


def _tail(values: Array, moving: NDArray[np.bool_] | None = None) -> _Tail:
    """The tail of a channel, beside repetitions where the joint moves; None: everywhere."""
    same = np.diff(values) == 0.0
    first = stuck_from(values)  # the last fresh sample is sound
    if moving is None:
        return _summed(same, first)
    counted = int(moving[1:first].sum())
    tail = _summed(same & moving[1:], first)
    return replace(tail, share=tail.share * first / max(counted, 1), counted=counted)


def _summed(same: NDArray[np.bool_], first: int) -> _Tail:
    """Of `same`, whether a row repeats the one before it, from row 1 on."""
    before = same[: max(first - 1, 0)]
    ranges = true_ranges(before)
    longest = int(np.max(ranges[:, 1] - ranges[:, 0], initial=0))
    share = float(np.mean(before)) if before.size else 1.0
    return _Tail(first, len(same) + 1 - first, longest, share, before.size)


def _unlikely(tail: _Tail, rows: int) -> bool:
    """Whether neither the grain of the channel nor chance makes `rows` repetitions on end."""
    if tail.counted <= BEFORE or rows < max(LEAST, LONGER * tail.longest):
        return False
    share = max(tail.share, 1.0 / tail.counted)
    return bool(share < 1.0 and np.log(tail.counted) + rows * np.log(share) < np.log(CHANCE))


def _noisy(values: Array, first: int) -> bool:
    """Whether the rows before `first` go up and down as noise does."""
    steps = np.diff(values[max(first - BEFORE, 0) : first])
    turns = steps[1:] * steps[:-1] < 0.0
    return bool(turns.size and np.mean(turns) > NOISY)


def _speed(log: Log, channel: str) -> Array | None:
    """Speed of an angle over `LEAST` rows ending at each row; None where that is but noise."""
    if channel not in log or not np.isfinite(log[channel]).all() or len(log) <= 2 * BEFORE:
        return None
    angle, time = unwrapped(log, channel), log["time"]
    took = np.maximum(time[LEAST:] - time[:-LEAST], 1e-12)
    speed = np.zeros(len(angle))
    speed[LEAST:] = (angle[LEAST:] - angle[:-LEAST]) / took
    grain = max(50.0 * quantum(angle), 20.0 * white_noise(angle))
    return speed if float(np.ptp(angle)) > grain else None


def _moving(speed: Array | None) -> NDArray[np.bool_] | None:
    if speed is None:
        return None
    size = np.abs(speed)
    top = float(np.quantile(size, 0.99))
    return np.asarray(size >= MOVES * top) if top > 0.0 else None


def _recorded(log: Log, channel: str) -> Array | None:
    """A velocity as it was recorded, if it is finite."""
    if channel not in log or not np.isfinite(log[channel]).all():
        return None
    return log[channel]


def _dead(log: Log, channel: str) -> bool:
    """Whether a channel keeps one value to the end, though the joint moves there.

    Its noise tells, or a reversal, in which the friction turns round. What is known of a load may
    well be held through that.
    """
    values = log[channel]
    last, first = values[-1], _tail(values).first
    at_limit = last in (np.min(values), np.max(values)) and last != 0.0
    if at_limit and (values[: first - 1] == last).sum() > 1:
        return False  # clipped
    speeds = [_speed(log, position) for position in POSITIONS]
    if all(one is None for one in speeds):
        speeds = [_recorded(log, velocity) for velocity in VELOCITY.values()]
    for speed in speeds:
        moving = _moving(speed)
        if speed is None or moving is None:
            continue
        behind = slice(first + LEAST, None)
        fast = speed[behind][moving[behind]]
        told = _noisy(values, first)
        if channel != "reference_torque" and fast.size:
            told = told or fast.min() < 0.0 < fast.max()
        if told and _unlikely(_tail(values, moving), fast.size):
            return True
    return False


def _left_behind(log: Log, channel: str) -> bool:
    """Whether an angle stays to the end where its velocity or the other encoder goes on."""
    values, time = log[channel], log["time"]
    tail = _tail(values)
    rows = slice(int(np.searchsorted(time, time[tail.first - 1] + WITHIN)), None)  # it may be late
    (other,) = (position for position in POSITIONS if position != channel)
    ratio = log.effective_ratio or 1.0
    factor = ratio if channel == "motor_position" else 1.0 / ratio
    ways = [(_recorded(log, VELOCITY[channel]), 1.0), (_speed(log, other), factor)]
    for speed, scale in ways:
        moving = _moving(speed)
        if speed is None or moving is None:
            continue
        if not _unlikely(_tail(values, moving), int(moving[rows].sum())):
            continue
        way = abs(scale * float(np.trapezoid(np.where(moving, speed, 0.0)[rows], time[rows])))
        if way > 50.0 * quantum(values):
            return True
    return False


def _not_that_of(log: Log, channel: str, position: str) -> bool:
    """Whether a velocity keeps one value to the end that its position contradicts."""
    values, speed = log[channel], _speed(log, position)
    moving = _moving(speed)
    if speed is None or moving is None:
        return False
    tail = _tail(values, moving)
    top = float(np.quantile(np.abs(speed), 0.99))
    off = np.abs(speed[tail.first + LEAST :] - values[-1]) >= MOVES * top
    return _unlikely(tail, int(off.sum()))


def _all_stop(log: Log) -> int | None:
    """First row from which no measured channel changes though the joint moves; None without."""
    channels = [c for c in log.channels if c != "time" and c not in CONDITIONS]
    if not channels or len(log) <= 2 * BEFORE or not all(_still(log[c]) for c in channels):
        return None
    same = {c: np.diff(log[c]) == 0.0 for c in channels}
    every = np.logical_and.reduce(list(same.values()))
    first = stuck_from(*(log[c] for c in channels))
    tail = _summed(every, first)
    if tail.length < 1 or not _unlikely(tail, tail.length):
        return None
    lively = [c for c in channels if np.mean(same[c][: first - 1]) < LIVELY]
    if not lively:
        return None
    for velocity in VELOCITY.values():
        moving = _moving(_recorded(log, velocity))
        if moving is not None and moving[first:].all():
            return first
    for position in POSITIONS:
        speed = _speed(log, position)
        moving = _moving(speed)
        if speed is None or moving is None or not moving[first - 1]:
            continue
        if any(_noisy(log[c], first) for c in lively) or _abrupt(log, position, first):
            return first
    return None


def _abrupt(log: Log, channel: str, first: int) -> bool:
    """Whether a joint that stops there changes its speed more than anywhere before."""
    angle = unwrapped(log, channel)[:first]
    for rows in (JUMP_ROWS, LEAST):
        way = angle[rows:] - angle[:-rows]
        change = np.abs(way[rows:] - way[:-rows])
        if abs(way[-1]) > np.max(change, initial=0.0):
            return True
    return False


def _jumps(log: Log, channel: str) -> list[tuple[int, int]]:
    """Rows [first, last) of each jump of an angle: what is before it, and behind, is sound."""
    if channel not in log or not np.isfinite(log[channel]).all() or len(log) <= 2 * BEFORE:
        return []
    angle, time = unwrapped(log, channel), log["time"]
    step = median_step(time)
    if step <= 0.0:
        return []
    speed = np.abs(np.diff(angle)) / np.maximum(np.diff(time), step)
    top = float(np.partition(speed, -1 - JUMPS)[-1 - JUMPS])
    fast = np.insert(speed > JUMP * top, 0, False)
    made: list[tuple[int, int]] = []
    for first, last in true_ranges(fast):
        before = float(np.median(angle[max(first - LEAST, 0) : first]))
        behind = float(np.median(angle[last : last + LEAST]))
        own = float(np.sum(np.abs(np.diff(angle[first - 1 : last]))))
        stays = abs(behind - before) > 0.5 * own
        if last - first <= JUMP_ROWS and stays and min(first, len(angle) - last) >= LEAST:
            made.append((int(first), _settled(log, channel, int(last) - 1, top)))
    if not made or top == 0.0:
        return []
    kept = np.diff(angle)[~fast[1:]]
    path = np.concatenate(([0.0], np.cumsum(kept)))
    grain = max(50.0 * quantum(path), 20.0 * white_noise(path))
    return made if float(np.ptp(path)) > grain else []


def _settled(log: Log, channel: str, row: int, top: float) -> int:
    """First row from `row` on in which the recorded velocity is none of the jump."""
    velocity = _recorded(log, VELOCITY[channel])
    if velocity is None:
        return row
    slow = np.flatnonzero(np.abs(velocity[row:]) <= 2.0 * top)
    return row + int(slow[0]) if slow.size else row


@dataclass(frozen=True)
class LeftOut:
    """What was left out of one run: `finding` says it; `rows` counts each row under one reason."""

    run: str
    finding: Finding
    reason: str
    rows: int

    @property
    def sentence(self) -> str:
        return f"{self.run}: {self.finding.sentence} They are left out."


@dataclass(frozen=True, eq=False)
class Kept:
    """A run without the rows that were left out; `rows` are those of the recording, (N,)."""

    log: Log
    rows: NDArray[np.intp]
    left: tuple[LeftOut, ...] = ()

    def as_recorded(self, rows: tuple[int, int]) -> tuple[int, int]:
        """Return rows [first, last) of the kept log as rows of the recording."""
        first, last = rows
        if not self.left or not 0 <= first < last <= len(self.rows):
            return rows
        return int(self.rows[first]), int(self.rows[last - 1]) + 1


def only_experiments(logs: Sequence[Log], target: str) -> list[Kept]:
    """Return the runs without stuck tails, homing moves and, of a drive, rows in which it is off.

    Parameters
    ----------
    logs : runs as recorded, or as repaired.
    target : "motor_torque" and "motor_current" are a drive's; a sensor reads on while it is off.
    """
    return [_only(log, target) for log in logs]


def _only(log: Log, target: str) -> Kept:
    everything = Kept(log, np.arange(len(log)))
    found = [*homing_move(log), *stuck_tail(log)]
    found += drive_disabled(log) if target in DRIVES else ()
    keep, left = np.ones(len(log), dtype=bool), []
    for one in found:
        first, last = one.rows
        count = int(keep[first:last].sum())
        keep[first:last] = False
        if count:
            left.append(LeftOut(log.name, one, REASONS[one.name], count))
    if not left or keep.sum() < FEWEST:
        return everything
    said = ", ".join(f"{one.rows} {one.reason}" for one in left)
    rows = np.flatnonzero(keep)
    contiguous = rows[-1] + 1 - rows[0] == len(rows)
    which = slice(int(rows[0]), int(rows[-1]) + 1) if contiguous else keep
    return Kept(log.rows(which, note=f"rows left out: {said}"), rows, tuple(left))


def resting(log: Log) -> NDArray[np.bool_]:
    """Return where the joint of a log rests, (N,); nowhere if the log has no joint angle."""
    from scipy.ndimage import binary_dilation, maximum_filter1d, minimum_filter1d

    if "output_position" not in log or log.rate * log.duration < 2.0:
        return np.zeros(len(log), dtype=bool)
    angle = log["output_position"]
    width = max(2, round(SECONDS * log.rate)) | 1
    way = maximum_filter1d(angle, width) - minimum_filter1d(angle, width)
    middle = way <= STILL * np.quantile(way, 1.0 - STILL)
    return np.asarray(binary_dilation(middle, np.ones(2 * width + 1, dtype=bool)))


def at_work(logs: Sequence[Log], target: str) -> list[NDArray[np.bool_]] | None:
    """Return where the joint of a drive moves in each log, (N,); None where all rows do.

    Of a log that rests throughout all rows do.
    """
    if target not in DRIVES:
        return None
    still = [resting(log) for log in logs]
    if not any(one.any() for one in still):
        return None
    return [np.ones(len(one), dtype=bool) if one.all() else ~one for one in still]


def start_transient(log: Log) -> Iterator[Finding]:
    """A start that differs from the steady run behind it: the longest among the channels."""
    made = _blocks_of(log)
    if made is None:
        return
    found = [(*_start_of(log, c, made), c) for c in CHANNELS_CHECKED if c in log]
    rows, worst, channel = max(found, default=(0, 0.0, ""))
    if rows == 0:
        return
    time = log["time"]
    seconds = float(np.ceil(10 * (time[rows - 1] - time[0]) - 1e-6) / 10)
    level = float(np.nanmedian(log[channel][rows:]))
    unit = CHANNELS[channel].unit
    where = "" if channel in VELOCITY.values() else ", at the same speed, angle and load"
    yield Finding(
        "start_transient",
        "fault",
        channel,
        (0, rows),
        seconds,
        "s",
        f"the first {seconds:.1f} s differ from the steady run behind them: {channel} is up to "
        f"{worst:.3g} {unit} away from its {level:.3g} {unit}{where}.",
        f"Ask for the repair drop_start={seconds:.1f}.",
    )


@dataclass(frozen=True)
class _Blocks:
    """Stretches of 0.1 s of a run that holds one speed: `count` of them, `width` rows each."""

    count: int
    width: int

    def of(self, values: Array) -> Array:
        """Values (N,) by stretch, (count, width)."""
        return values[: self.count * self.width].reshape(self.count, self.width)

    def mean(self, values: Array) -> Array:
        """Mean over the finite values of each stretch, (count,); NaN where there is none."""
        known = np.isfinite(self.of(values))
        sums = np.sum(np.where(known, self.of(values), 0.0), axis=1)
        return np.where(known.any(axis=1), sums / np.maximum(known.sum(axis=1), 1), np.nan)

    @property
    def steady(self) -> slice:
        """The stretches of the last two thirds."""
        return slice(self.count // 3, None)


def _blocks_of(log: Log) -> _Blocks | None:
    """The stretches of a log; None unless it holds one speed.

    In its last two thirds nine rows of ten keep within 40 % of the median velocity, and its last
    half is no part of a slow swing.
    """
    velocity = next((log[c] for c in VELOCITY.values() if c in log), None)
    if velocity is None or not _one_speed(velocity[len(log) // 3 :]):
        return None
    if _swings(velocity[len(log) // 2 :]):
        return None
    width = max(4, round(WINDOW * log.rate)) if np.isfinite(log.rate) else 0
    count = len(log) // width if width else 0
    return _Blocks(count, width) if count >= 10 else None


def _start_of(log: Log, channel: str, made: _Blocks) -> tuple[int, float]:
    """Rows at the start in which a channel is far from its steady course, and how far; 0 if none.

    A velocity is compared with its level, unless the joint speeds up smoothly. A torque is
    compared where the speed is the steady one, with what angle, load and temperature explain.
    Stretches of the start that are found far are left out of that fit, until no more are.
    """
    values = made.of(log[channel])
    if channel in VELOCITY.values():
        if _speeds_up(log, made):
            return 0, 0.0
        level = float(np.nanmedian(values[made.steady]))
        return _far(values, values - level, np.ones(made.count, dtype=bool))
    alike, causes, mean = _at_speed(log, made), [*_causes(log)], made.mean(log[channel])
    columns = np.column_stack([np.ones(made.count), *(made.mean(one) for one in causes)])
    size = np.maximum(np.nan_to_num(np.abs(columns)).max(axis=0), 1e-300)
    fitted = alike & np.isfinite(mean) & np.isfinite(columns).all(axis=1)
    rows, worst = 0, 0.0
    while True:
        fitted[: rows // made.width] = False
        level, *amplitudes = np.linalg.lstsq((columns / size)[fitted], mean[fitted], rcond=SAME)[0]
        away = values - level
        for amplitude, cause, scale in zip(amplitudes, causes, size[1:], strict=True):
            away -= amplitude / scale * made.of(cause)
        longer, far = _far(values, away, alike)
        if longer <= rows:
            return rows, worst
        rows, worst = longer, far


def _far(values: Array, away: Array, alike: NDArray[np.bool_]) -> tuple[int, float]:
    """Rows of the far stretches that the comparable ones begin with, and the largest deviation.

    `values` and how far they are `away`, (count, width), by stretch. A stretch is far where its RMS
    deviation is larger than usual, and larger than in the second half.
    """
    count, width = values.shape
    known: NDArray[np.bool_] = np.isfinite(away) & alike[:, None]
    squares = np.sum(np.where(known, away, 0.0) ** 2, axis=1)
    spread = np.sqrt(squares / np.maximum(known.sum(axis=1), 1))
    told = np.asarray(known.any(axis=1))
    steady = spread[count // 3 :][told[count // 3 :]]
    first = int(np.argmax(told))
    if not steady.size or not told[count // 2 :].any() or first >= count // 2:
        return 0, 0.0
    level = abs(float(np.nanmedian(values[count // 3 :])))
    highest = float(np.max(spread[count // 2 :]))
    far = spread > max(FAR * float(np.median(steady)), 1.25 * highest, 1e-6 * level)
    rows = int(np.argmin(np.append(far[first : count // 2], False)))
    if rows == 0:
        return 0, 0.0
    start = slice(first, first + rows)
    return (first + rows) * width, float(np.max(np.abs(away[start][known[start]])))


def _at_speed(log: Log, made: _Blocks) -> NDArray[np.bool_]:
    """The stretches in which the joint has the speed of the steady run."""
    speed = made.mean(next(log[c] for c in VELOCITY.values() if c in log))
    level = float(np.nanmedian(speed[made.steady]))
    off = np.abs(speed - level)
    usual = float(np.nanpercentile(off[made.steady], 90))
    return np.asarray(off <= max(ALIKE * abs(level), usual))


def _speeds_up(log: Log, made: _Blocks) -> bool:
    """Whether the joint goes to its speed smoothly, and never beyond it or back.

    Its angle tells. A velocity alone may settle in its filter: it has to begin with a rest.
    """
    speed, position = _measured_speed(log, made)
    level = float(np.median(speed[made.steady]))
    if not level:  # NaN goes through, and reaches nothing
        return False
    speed = speed / level
    slack = max(SLACK, 1.25 * float(np.max(np.abs(speed[made.count // 2 :] - 1.0))))
    reached = int(np.argmax(speed >= 1.0 - slack))
    ramp = speed[: made.count // 2]
    smooth = ramp.max() <= 1.0 + slack and np.diff(ramp).min() >= -slack
    stays = 0 < reached < len(ramp) and ramp[reached:].min() >= 1.0 - slack
    return bool(smooth and stays and (position or abs(ramp[0]) <= slack))


def _measured_speed(log: Log, made: _Blocks) -> tuple[Array, bool]:
    """Speed of the joint by stretch, (count,), and whether an angle tells it."""
    position = next((c for c in POSITIONS if c in log), None)
    if position is None:
        return made.mean(next(log[c] for c in VELOCITY.values() if c in log)), False
    angle, time = made.of(unwrapped(log, position)), made.of(log["time"])
    return (angle[:, -1] - angle[:, 0]) / np.maximum(time[:, -1] - time[:, 0], 1e-12), True


def _causes(log: Log) -> Iterator[Array]:
    """What may explain a torque at one speed beside a constant, (N,) each.

    Sine and cosine of the output angle, known torques and their amounts, as friction follows
    these, and temperatures of more than a few levels.
    """
    angle = _output_angle(log)
    if angle is not None:
        yield from (np.sin(angle), np.cos(angle))
    for load in LOADS:
        if load in log and np.isfinite(log[load]).any():
            yield from (log[load], np.abs(log[load]))
    for name in TEMPERATURES:
        if name in log and len(np.unique(log[name])) > LEVELS:
            yield log[name]


def _output_angle(log: Log) -> Array | None:
    """Angle of the output, from wherever its zero is: measured, or from the velocity."""
    if "output_position" in log:
        return log["output_position"]
    ratio = log.effective_ratio or math.nan
    if "motor_position" in log:
        angle = log["motor_position"] / ratio
    elif "output_velocity" in log:
        steps = np.diff(log["time"], prepend=log["time"][0])
        angle = np.cumsum(np.nan_to_num(log["output_velocity"] * steps))
    else:
        return None
    return angle if np.isfinite(angle).any() else None


def _one_speed(velocity: Array) -> bool:
    known = velocity[np.isfinite(velocity)]
    level = float(np.median(known)) if known.size else 0.0
    return level != 0 and float(np.percentile(np.abs(known - level), 90)) < 0.4 * abs(level)


def _swings(velocity: Array) -> bool:
    """Whether a velocity (N,) bends smoothly by more than a twentieth of its level."""
    values = velocity[np.isfinite(velocity)]
    if len(values) < 4:
        return False
    place = np.linspace(-1.0, 1.0, len(values))
    bend = np.polyval(np.polyfit(place, values, 2), place)
    smooth = float(np.std(bend))
    return smooth > max(0.05 * abs(float(np.median(values))), float(np.std(values - bend)))
