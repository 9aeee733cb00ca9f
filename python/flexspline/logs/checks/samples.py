"""Samples by themselves, rows out of order, dropped or stuck, and the motion in those that are
sound.

The motion is derived from the position, cleaned and of bearable size. The log itself is not
touched. Rows that are not finite or not increasing in time are left out, angles unwrapped. Of long
logs eight stretches are looked at, 400 000 rows in all.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import listed
from flexspline.logs.channels import CHANNELS, CONDITIONS
from flexspline.logs.checks.findings import Finding
from flexspline.logs.derive import default_bandwidth
from flexspline.logs.local_fit import LocalFit
from flexspline.logs.log import SHORTEST, TEMPERATURES, Log, beyond
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.segments import GAP_STEPS, at_rest, median_step, repeats, runs, true_ranges
from flexspline.logs.spikes import CONVERTED, SPIKED, spikes
from flexspline.logs.splitting import GAP

DROP_STEPS = 1.75
"""A step of more median steps than this has lost at least one sample."""

DROPPED = "dropped_samples"

WARMEST, ICE = 200.0, 273.15
"""°C of no joint, whose grease burns, and colder than any in kelvin; and K of melting ice."""

LEFT_OUT = re.compile(
    r"(drop_(?:invalid|duplicates|repeated|clipped|spikes)): .*?dropped: (\d+)(?:;|$)"
)
"""What a log's history says of a repair that leaves out single rows (`logs/repairs.py`)."""

JITTER_SHARE = 0.05
"""Where more steps than this share are long, the clock is uneven and nothing was dropped."""

AT_ONCE, REGULAR, FEWEST_STEPS = 0.25, 0.8, 100
"""Rows come at once that are less of the mean step apart; and they come in bursts where this share
of these, of so many rows, has the same length within a row. A clock that jitters by a fifth of its
step has 1 row of 10 000 that close."""

SLOW = 0.5
"""s from row to row, from which time may be in milliseconds: what a recorder of 2 kHz writes then,
and one of 200 Hz writes 5 s. Recorders of a joint's motion are not as slow as this."""

RESOLVED = 2.0 * np.pi / 20.0
"""RMS of second over that of first differences of a position in a motion with 20 rows a period:
2 sin(π / 20); noise has √3, a pose that changes within a row √2, however long it is held. A
recorder of 200 Hz gives as many to any motion below 10 Hz; one of 1 Hz that were as slow indeed, to
none with a period below 20 s."""

STUCK_ROWS = 3
"""As many equal rows in a row are a stuck recorder; fewer are repeated rows, and fewer in the
whole log are chance."""

LIVELY = 0.01
"""A channel with a smaller share of repeated values changes with every sample that it gets."""

POSITIONS = ("output_position", "motor_position", "commanded_position")

DRIVES = ("motor_torque", "motor_current")
"""Channels that are zero with reason while the drive is off."""

UNSIGNED_BITS = (16, 32)
"""Widths of whole numbers that recorders write in two's complement."""

UNITS = (1.0, 1e-3, 1e-6)
"""What one of these whole numbers is worth, beside the quantum of the channel."""

LEAP = 10.0
"""Times as far as 95 % of its other steps a channel may go where it changes its sign. Coulomb
friction of a drive that turns round within a row makes one row leap; the least leap of a broken
thermometer, of 20 K at steps of 0.1 K and two of these from row to row, is 100 times its steps."""

OFTEN = 0.05
"""Share of the rows with either sign, from which a channel may leap between the two."""

TURNING = 5.0
"""Times the level beside it: a channel that turns round smoothly is 2.4 times as long at its last
level (1 : √2 − 1), and twice that by chance of where the level lies."""

NOISY_PILE = 3.0
"""Times the level beside it, from which a channel with noise above its grain is clipped. Of noise
that is cut in its middle, half is at the limit; at an end that is none are the fewest rows."""

LEVELS = 4
"""Levels of which `quantum` finds no lattice."""

COARSE_LEVELS = 30_000
"""A channel with more levels than this over its range is not called quantised."""

Array = NDArray[np.float64]

STRETCHES, STRETCH_ROWS = 8, 50_000


def no_channels(log: Log) -> Iterator[Finding]:
    """A log of time alone: nothing in it can be looked at or fitted."""
    if log.channels == ("time",):
        yield Finding(
            "no_channels",
            "error",
            "time",
            (0, len(log)),
            0.0,
            "",
            "no channel but time is there.",
            "Name its columns in a column map.",
        )


def not_finite(log: Log) -> Iterator[Finding]:
    """NaN and infinities: channel, first row and count."""
    for channel in log.channels:
        bad = np.flatnonzero(~np.isfinite(log[channel]))
        if bad.size:
            yield Finding(
                "not_finite",
                "error",
                channel,
                _span(bad),
                float(bad.size),
                "rows",
                f"{channel} is NaN or infinite in {_rows(bad.size)}, first in row {bad[0]}.",
                "Ask for the repair drop_invalid.",
            )


def impossible(log: Log) -> Iterator[Finding]:
    """Numbers that no instrument reads, such as an overload, and clocks that no recorder has."""
    for one in beyond(log):
        yield Finding(
            "impossible_value",
            "error" if one.channel == "time" else "fault",
            one.channel,
            _span(one.rows),
            float(one.rows.size),
            "rows",
            f"{one.sentence}.",
            "Ask for the repair drop_invalid, or correct the unit of the column.",
        )
    step = median_step(log["time"])
    if 0.0 < step < SHORTEST:
        yield Finding(
            "impossible_clock",
            "error",
            "time",
            (0, len(log)),
            step,
            "s",
            f"time goes by steps of {step:.3g} s, which no recorder has.",
            "Correct the unit of its column.",
        )


def kelvin(log: Log) -> Iterator[Finding]:
    """Temperatures that are none of a joint in °C, and are one in kelvin."""
    for channel in (name for name in TEMPERATURES if name in log):
        known = log[channel][np.isfinite(log[channel])]
        middle = float(np.median(known)) if known.size else 0.0
        if WARMEST < middle < WARMEST + ICE:
            yield Finding(
                "temperature_unit",
                "fault",
                channel,
                (0, len(log)),
                middle,
                "°C",
                f"{channel} is {middle:.4g} °C in the median: its column is in kelvin, and this is "
                f"{middle - ICE:.3g} °C.",
                f"Give the column its unit, K, or take {ICE} off.",
            )


def time_order(log: Log) -> Iterator[Finding]:
    """Time that runs backwards or stands."""
    steps = np.diff(log["time"])
    back, same = np.flatnonzero(steps < 0) + 1, np.flatnonzero(steps == 0) + 1
    if back.size:
        worst = float(-np.min(steps[back - 1]))
        restart = worst > GAP * median_step(log["time"])
        other = ", or, where several runs lie in the file, cut it by split_gaps (--split-gaps)"
        yield Finding(
            "time_not_increasing",
            "error",
            "time",
            _span(back),
            worst,
            "s",
            f"time runs backwards in {_rows(back.size)}, first in row {back[0]}, by up to "
            f"{worst:.4g} s.",
            f"Ask for the repair sort_time{other if restart else ''}.",
        )
    if same.size and not arrival_bursts(log):
        yield Finding(
            "duplicate_time",
            "error",
            "time",
            _span(same),
            float(same.size),
            "rows",
            f"the time of the row before is repeated in {_rows(same.size)}, first row {same[0]}.",
            "Ask for the repair drop_duplicates.",
        )


def stamps_of_arrival(log: Log) -> Iterator[Finding]:
    """Time stamps that several rows at once got when they arrived, over a bus or from a queue."""
    rows = arrival_bursts(log)
    if not rows:
        return
    time = log["time"]
    step = float(np.median(time[rows:] - time[:-rows])) / rows
    close = float(np.median(np.sort(np.diff(time))[: len(time) // 2]))
    yield Finding(
        "arrival_time",
        "error",
        "time",
        (0, len(log)),
        float(rows),
        "rows",
        f"rows come {rows} at a time, {close:.2g} s from one to the next where {step:.4g} s is the "
        "mean: they were stamped when they arrived, and not when they were measured.",
        "Ask for the repair even_time, which puts even stamps at the mean rate, or record the time "
        "of measurement.",
    )


def arrival_bursts(log: Log) -> int:
    """Rows that arrive at once, in the median; 0 unless nearly all rows come so.

    Between such rows hardly any time goes by, and the joint goes as far as it does over the long
    steps, by the angle or else the motor's. A recorder that does read twice at once reads the same
    angle twice.
    """
    steps = np.diff(log["time"])
    if len(steps) < FEWEST_STEPS or not np.isfinite(steps).all() or steps.min() < 0.0:
        return 0
    long = steps > AT_ONCE * float(np.mean(steps))
    if not 0.0 < np.mean(long) <= 0.6:
        return 0
    sizes = np.diff(np.flatnonzero(long))
    rows = int(np.median(sizes)) if sizes.size else 0
    if rows < 2 or np.mean(np.abs(sizes - rows) <= 1) < REGULAR:
        return 0
    if np.mean(repeats(log)[1:][~long]) > 0.5:
        return 0
    ways = (np.abs(np.diff(unwrapped(log, name))) for name in POSITIONS[:2] if name in log)
    way = next(ways, np.zeros(len(steps)))
    even = np.nansum(way[~long]) * long.sum() >= 0.5 * np.nansum(way[long]) * (~long).sum()
    return rows if even else 0


def slow_clock(log: Log) -> Iterator[Finding]:
    """Rows so far apart in time that it may be in milliseconds, of a motion that they resolve.

    A velocity tells for sure, by a factor of 1000 (`velocity_of_position`); elsewhere a slow joint
    cannot be told from a fast one, so that this is a note.
    """
    step = median_step(log["time"])
    moves = [name for name in POSITIONS[:2] if name in log and _resolved(unwrapped(log, name))]
    if step < SLOW or not moves:
        return
    yield Finding(
        "slow_clock",
        "note",
        "time",
        (0, len(log)),
        step,
        "s",
        f"rows are {step:.4g} s apart, and {moves[0]} goes smoothly from one to the next: is the "
        "time in milliseconds?",
        'If so, read it with the unit "ms", or ask for the repair scale=time:0.001; velocity, '
        "viscous friction and inertia are wrong by powers of 1000 without it.",
    )


def _resolved(position: Array) -> bool:
    """Whether a position moves, and by steps that change little from row to row."""
    known = position[np.isfinite(position)]
    if len(np.unique(known)) <= LEVELS:
        return False
    first, second = (float(np.sqrt(np.mean(np.diff(known, n=n) ** 2))) for n in (1, 2))
    return second <= RESOLVED * first


def dropped_samples(log: Log) -> Iterator[Finding]:
    """Steps of time that are too long by whole samples."""
    time = log["time"]
    step = median_step(time)
    if step == 0:
        return
    steps = np.diff(time)
    long = np.flatnonzero(steps > DROP_STEPS * step)
    if long.size == 0 or long.size > JITTER_SHARE * steps.size or arrival_bursts(log):
        return
    missing = int(np.sum(np.round(steps[long] / step) - 1))
    widest = float(np.max(steps[long]))
    names, count = _left_out(log)
    asked = missing <= count
    remedy = "The repair resample=Hz puts the log on even steps."
    if asked:
        remedy = f"The repair {listed(names)} left them out, as asked; nothing is to be done."
    elif widest > GAP_STEPS * step:
        remedy = (
            f"A fit takes the rows on either side of a gap of more than {GAP_STEPS} steps apart "
            "and needs no repair; the repair resample=Hz closes shorter ones."
        )
    yield Finding(
        DROPPED,
        "note" if asked else "fault",
        "time",
        _span(long + 1),
        float(missing),
        "rows",
        f"about {_rows(missing)} missing in {_counted(long.size, 'place')}, first before row "
        f"{long[0] + 1}; the longest step is {widest:.4g} s where {step:.4g} s is usual.",
        remedy,
    )


def _left_out(log: Log) -> tuple[list[str], int]:
    """Repairs that left out single rows of a log, and how many rows they did."""
    told = [LEFT_OUT.match(said) for said in log.history]
    made = [(one[1], int(one[2])) for one in told if one is not None]
    return [name for name, _ in made], sum(count for _, count in made)


def repeated_rows(log: Log) -> Iterator[Finding]:
    """Rows in which no lively channel differs from the row before: a recorder that stood still.

    Lively is a channel that hardly ever repeats a value in other rows; one at least must exist, for
    a joint at rest with coarse encoders repeats its values with good reason. Rows in which it
    certainly rests count as neither.
    """
    same = {c: np.diff(log[c]) == 0 for c in log.channels if c != "time"}
    if len(log) < 10 or not same:
        return
    rest = at_rest(log)[1:]
    stuck = repeats(log)[1:]
    others = ~stuck & ~rest
    lively = others.any() and any(np.mean(s[others]) < LIVELY for s in same.values())
    ranges = true_ranges(stuck)
    if not lively or np.count_nonzero(stuck) < STUCK_ROWS:
        return
    lengths = ranges[:, 1] - ranges[:, 0]
    rows, longest = np.flatnonzero(stuck) + 1, int(np.max(lengths))
    name = "stuck_recorder" if longest >= STUCK_ROWS else "repeated_rows"
    yield Finding(
        name,
        "fault",
        "all",
        _span(rows),
        float(rows.size),
        "rows",
        f"{_rows(rows.size)} repeat all values of the row before, first row {rows[0]}, up to "
        f"{longest} on end: the recorder was read faster than it was written.",
        "Ask for the repair drop_repeated, or record again.",
    )


def _span(rows: NDArray[np.intp]) -> tuple[int, int]:
    return int(rows[0]), int(rows[-1]) + 1


def _rows(count: int) -> str:
    return _counted(count, "row")


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


def constant(log: Log) -> Iterator[Finding]:
    """Channels that never change."""
    for channel in log.channels:
        values = log[channel]
        if channel == "time" or channel in CONDITIONS or len(values) < 2:
            continue
        if np.all(values == values[0]):
            yield Finding(
                "constant_channel",
                "fault",
                channel,
                (0, len(log)),
                float(values[0]),
                CHANNELS[channel].unit,
                f"{channel} is {values[0]:.6g} {CHANNELS[channel].unit} in every row.",
                "Check the wiring and the column map, or leave the channel out.",
            )


def unsigned(log: Log) -> Iterator[Finding]:
    """Channels with a sign whose whole numbers were read without it: −1 is 65535 of 16 bits.

    All lie within a quarter of 2ᵇ of either end of its range, some at both, and jump between them.
    With their sign they go through zero as they go elsewhere, or are often at both ends: a sensor
    that fails now and then leaps to what the converter then writes, and back.
    """
    for channel in log.channels:
        known = np.flatnonzero(np.isfinite(log[channel]))
        values = log[channel][known]
        if channel in ("time", *POSITIONS) or not _at_both_ends(values):
            continue
        values = np.abs(values)
        steps = (quantum(values), *UNITS)
        worth = ((b, s) for b in UNSIGNED_BITS for s in steps if _is_unsigned(values, s, b))
        bits, step = next(worth, (0, 0.0))
        if not bits:
            continue
        jumps = known[np.flatnonzero(np.abs(np.diff(values)) > 2.0 ** (bits - 1) * step) + 1]
        yield Finding(
            "unsigned_channel",
            "error",
            channel,
            _span(jumps),
            float(jumps.size),
            "jumps",
            f"{channel} jumps between nearly 0 and nearly {2**bits * step:.5g} "
            f"{CHANNELS[channel].unit} in {_counted(jumps.size, 'place')}, first in row "
            f"{jumps[0]}: its whole numbers of {bits} bits were read without their sign.",
            f"Give its column bits = {bits} in the column map.",
        )


def _at_both_ends(values: Array) -> bool:
    """Whether all have one sign, some lie near zero, some near the largest, none in the third
    between.

    A map may have turned the sign of all.
    """
    if len(values) < 2 or values.min() < 0.0 < values.max():
        return False
    values = np.abs(values)
    most = float(values.max())
    return float(values.min()) < most / 3 and not np.any(
        (values > most / 3) & (values < most / 1.4)
    )


def _is_unsigned(values: Array, step: float, bits: int) -> bool:
    """Whether these are multiples of `step` near both ends of 2ᵇ, nowhere between, and go through
    zero.
    """
    if step <= 0.0:
        return False
    turn = 2.0**bits
    whole = np.round(values / step)
    if whole.max() >= turn or np.max(np.abs(values - whole * step)) > 1e-3 * step:
        return False
    low, high = whole < 0.25 * turn, whole >= 0.75 * turn
    if not (low.any() and high.any() and np.all(low | high)):
        return False
    return _goes_through_zero(np.where(high, whole - turn, whole), high)


def _goes_through_zero(counts: Array, negative: NDArray[np.bool_]) -> bool:
    """Whether signed counts change their sign by such steps as they have elsewhere.

    What leaps at all of its changes of sign is taken for signed where both signs are frequent.
    """
    steps, changes = np.abs(np.diff(counts)), np.diff(negative)
    usual = float(np.percentile(steps[~changes], 95)) if not changes.all() else 0.0
    crossing = float(np.median(steps[changes])) <= LEAP * max(usual, 1.0)
    share = float(np.mean(negative))
    kinds = min(len(np.unique(counts[side])) for side in (negative, ~negative))
    return crossing or (min(share, 1.0 - share) > OFTEN and kinds > 2)


def clipped(log: Log) -> Iterator[Finding]:
    """Values that pile up at the largest or smallest: far more often than at the levels beside.

    Where the joint rests a coarse channel keeps its value with reason, and where a drive is off.
    """
    resting = at_rest(log)
    off = log["enabled"] < 0.5 if "enabled" in log else np.zeros(len(log), dtype=bool)
    for channel in CONVERTED:
        if channel not in log or not np.isfinite(log[channel]).any():
            continue
        values, idle = log[channel], resting | off if channel in DRIVES else resting
        limits = {float(np.nanmax(values)), float(np.nanmin(values))}
        ends = [_End(values, at, true_ranges((values == at) & ~idle)) for at in sorted(limits)]
        for end in _clipped_ends(ends):
            unit = CHANNELS[channel].unit
            yield Finding(
                "clipped_channel",
                "fault",
                channel,
                (int(end.ranges[0, 0]), int(end.ranges[-1, 1])),
                end.limit,
                unit,
                f"{channel} stays at exactly {end.limit:.6g} {unit} in {end.count} rows, first in "
                f"row {end.ranges[0, 0]}: it is clipped there.",
                f"Ask for the repair drop_clipped={channel}:{end.limit!r}, or record with a wider "
                "range.",
            )


@dataclass(frozen=True, eq=False)
class _End:
    """The largest or smallest value of a channel, and the rows at it in which the joint works."""

    values: Array
    limit: float
    ranges: NDArray[np.intp]

    @property
    def count(self) -> int:
        return int(np.sum(self.ranges[:, 1] - self.ranges[:, 0]))

    @property
    def longest(self) -> int:
        """Rows on end."""
        return int(np.max(self.ranges[:, 1] - self.ranges[:, 0], initial=0))

    @cached_property
    def beside(self) -> int:
        """How often the level next to the limit occurs."""
        return _beside(self.values, self.limit)

    @cached_property
    def usual(self) -> float:
        """How often levels near the limit occur."""
        return _usual_count(self.values, self.limit)


def _clipped_ends(ends: Sequence[_End]) -> list[_End]:
    """The ends at which a channel is clipped.

    Noise above a channel's grain is at no level for several rows on end, and at the largest least
    of all, so that less of a pile shows a limit then: on one side, or on both together where they
    are the same but for their sign.
    """
    found = [end for end in ends if _often([end]) and _piles_up([end], _slowing(end))]
    values = ends[0].values
    if len(found) < len(ends) and _often(ends) and white_noise(values) > quantum(values):
        found = [e for e in ends if e in found or (_often([e]) and _piles_up([e], NOISY_PILE))]
        mirrored = len(ends) == 2 and np.isclose(ends[0].limit, -ends[1].limit, rtol=1e-9, atol=0.0)
        if mirrored and _piles_up(ends, 1.0):
            found = [end for end in ends if end.count]
    return found


def _slowing(end: _End) -> float:
    """Times the level beside it, above which it is more than a smooth motion's turn.

    What is cut off does not slow down before.
    """
    return TURNING * max(end.beside / end.usual, 1.0)


def _often(ends: Sequence[_End]) -> bool:
    """Whether ends, taken together, occur often, but not most of the time, and on end."""
    count, rows = sum(end.count for end in ends), len(ends[0].values)
    enough = max(10, 0.0005 * rows) <= count < 0.5 * rows
    return enough and max(end.longest for end in ends) >= 3


def _piles_up(ends: Sequence[_End], times: float) -> bool:
    """Whether ends, taken together, occur `times` as often as beside them, and as no level near."""
    count, beside = sum(end.count for end in ends), sum(end.beside for end in ends)
    usual = float(np.mean([end.usual for end in ends]))
    return count >= max(10.0 * usual, times * beside)


def spiked(log: Log) -> Iterator[Finding]:
    """Single rows that leap out of a channel that goes on as it came."""
    for channel in SPIKED:
        rows = spikes(log["time"], log[channel]) if channel in log else np.zeros(0, np.intp)
        if not rows.size:
            continue
        values, unit = log[channel], CHANNELS[channel].unit
        first, last = rows[0], rows[0]
        while last + 1 in rows[:2]:
            last += 1
        yield Finding(
            "spikes",
            "fault",
            channel,
            _span(rows),
            float(rows.size),
            "rows",
            f"{channel} leaps in {_counted(rows.size, 'single row')}, first to "
            f"{values[first]:.4g} {unit} in row {first} between {values[first - 1]:.4g} and "
            f"{values[last + 1]:.4g}: no joint is as fast, what reads or sends it fails.",
            f"Ask for the repair drop_spikes={channel}, or fit with --robust "
            '(FitOptions(robust="huber")).',
        )


def wrapped(log: Log) -> Iterator[Finding]:
    """Angles that jump by a turn between two rows."""
    for channel in POSITIONS:
        if channel not in log:
            continue
        jumps = wrap_rows(log, channel)
        if jumps.size:
            yield Finding(
                "wrapped_angle",
                "fault",
                channel,
                (int(jumps[0]), int(jumps[-1]) + 1),
                float(jumps.size),
                "jumps",
                f"{channel} jumps by a whole turn in {jumps.size} place"
                f"{'' if jumps.size == 1 else 's'}, first in row {jumps[0]}: the angle is wrapped.",
                f"Ask for the repair unwrap={channel}; the other checks went on with the unwrapped "
                "angle.",
            )


def quantised(log: Log) -> Iterator[Finding]:
    """Channels whose steps stand above their noise."""
    for channel in (*POSITIONS[:2], "output_velocity", "motor_velocity", *CONVERTED):
        if channel not in log:
            continue
        values = unwrapped(log, channel) if channel in POSITIONS else log[channel]
        step = quantum(values)
        if step == 0:
            continue
        reach = float(np.nanmax(values) - np.nanmin(values))
        if reach / step > COARSE_LEVELS or step < white_noise(values):
            continue
        unit = CHANNELS[channel].unit
        yield Finding(
            "quantised_channel",
            "note",
            channel,
            (0, len(log)),
            step,
            unit,
            f"{channel} has steps of {step:.4g} {unit}, {reach / step:.0f} over its range.",
            "A fit chooses the bandwidth of its derivatives by these steps; nothing is to be done.",
        )


def wrap_rows(log: Log, channel: str) -> NDArray[np.intp]:
    """Rows that step by a turn more, or less, than the rows around them."""
    return _wraps(log[channel], log["time"])[0]


def unwrapped(log: Log, channel: str) -> NDArray[np.float64]:
    """The angle without its wraps; a motor that turns more than π per row stays as it is.

    Of all rows: where some are left out, a jump of the angle may look like a wrap.
    """
    position, known = log[channel], np.isfinite(log[channel])
    rows, turns = _wraps(position[known], log["time"][known])
    excess = np.zeros(np.count_nonzero(known))
    excess[rows] = 2 * np.pi * turns
    whole = position.copy()
    whole[known] -= np.cumsum(excess)
    return whole


def _wraps(position: Array, time: Array) -> tuple[NDArray[np.intp], Array]:
    """Rows behind a wrap, and by how many turns (1 or -1); over a gap the angle has gone on."""
    steps, times = np.diff(position), np.diff(time)
    far = np.flatnonzero(np.abs(steps) > np.pi / 2)
    if far.size == 0 or len(steps) < 5:
        return far[:0] + 1, np.zeros(0)
    window = np.clip(far - 2, 0, len(steps) - 5)[:, None] + np.arange(5)  # at an end: to one side
    beside = window != far[:, None]
    around = np.median(steps[window][beside].reshape(-1, 4), axis=1)
    usual = np.median(times[window][beside].reshape(-1, 4), axis=1)
    rows_gone = np.round(times[far] / np.where(usual > 0.0, usual, np.inf))
    excess = steps[far] - around * np.fmax(rows_gone, 1.0)
    whole = np.abs(np.abs(excess) - 2 * np.pi) < 0.7
    return far[whole] + 1, np.sign(excess[whole])


def _beside(values: NDArray[np.float64], limit: float) -> int:
    """How often the level next to the limit occurs."""
    inner = values[np.isfinite(values) & (values != limit)]
    if inner.size == 0:
        return 0
    return int(np.count_nonzero(inner == inner[np.argmin(np.abs(inner - limit))]))


def _usual_count(values: NDArray[np.float64], limit: float) -> float:
    """How often the twenty levels beside the limit occur, in the median."""
    inner = values[np.isfinite(values) & (values != limit)]
    if inner.size == 0:
        return float("inf")
    near = np.sort(np.abs(inner - limit))[: max(2000, inner.size // 50)]
    _, counts = np.unique(near, return_counts=True)
    return float(np.median(counts[:20]))


@dataclass(frozen=True, eq=False)
class Motion:
    """Velocity and acceleration of one angle, zero phase, with the channels beside it.

    All arrays have one row per row looked at; `smooth` gives other channels the same low pass.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    bandwidth: float
    ranges: NDArray[np.intp]
    rows: NDArray[np.intp]

    def smooth(self, values: Array) -> Array:
        """A channel of the log behind the low pass that the velocity has."""
        return self.low_passed(values[self.rows])

    def low_passed(self, values: Array) -> Array:
        """Columns with a row for each row of the motion, behind its low pass."""
        return _by_range(LocalFit(self.bandwidth), self.time, values, self.ranges)

    def derivative(self, order: int, bandwidth: float) -> Array:
        """Derivative of the position behind a low pass of another bandwidth [Hz]."""
        return _by_range(LocalFit(bandwidth, order), self.time, self.position, self.ranges)

    def away_from(self, instants: Array, delay: float) -> NDArray[np.bool_]:
        """Rows to which the low pass carries nothing of these instants, delayed or not.

        The instants rise, (K,) s, and come up to `delay` [s] later.
        """
        reach = LocalFit(self.bandwidth).half_length
        first = np.searchsorted(instants, self.time - reach - delay)
        return np.asarray(first == np.searchsorted(instants, self.time + reach, side="right"))

    def inside(self, margin: float) -> NDArray[np.bool_]:
        """Rows at least `margin` [s] away from the ends of their run, and not at its edge."""
        reach = max(margin, LocalFit(self.bandwidth).half_length)
        valid = np.zeros(len(self.time), dtype=bool)
        for a, b in self.ranges:
            t = self.time[a:b]
            valid[a:b] = (t - t[0] >= reach) & (t[-1] - t >= reach)
        return valid


@lru_cache(maxsize=2)  # several checks ask in turn; `check` forgets it behind them
def motion_of(log: Log, channel: str = "output_position") -> Motion | None:
    """Motion of a position channel; None where it has none worth the name.

    Too little motion: less than 50 quanta or 20 times the noise, or fewer than 100 rows. So few
    levels as show no quantum are a count or two of an encoder at rest.
    """
    if channel not in log:
        return None
    rows = _usable_rows(log)
    time, position = log["time"][rows], unwrapped(log, channel)[rows]
    travel = float(np.ptp(position)) if len(position) else 0.0
    grain = max(50 * quantum(position), 20 * white_noise(position))
    still = travel <= max(grain, 1e-12) or len(np.unique(position)) <= LEVELS
    if len(rows) < 100 or still:
        return None
    ranges = runs(time)
    ranges = ranges[ranges[:, 1] - ranges[:, 0] >= 10]
    if len(ranges) == 0:
        return None
    keep = np.concatenate([np.arange(a, b) for a, b in ranges])
    ends = np.cumsum(ranges[:, 1] - ranges[:, 0])
    bounds = np.stack((np.concatenate(([0], ends[:-1])), ends), axis=1)
    return _derived(time[keep], position[keep], bounds, rows[keep])


def _derived(
    time: Array, position: Array, ranges: NDArray[np.intp], rows: NDArray[np.intp]
) -> Motion:
    bandwidth = min(default_bandwidth(time, position), 0.1 / median_step(time))
    velocity, acceleration = (
        _by_range(LocalFit(bandwidth, order), time, position, ranges) for order in (1, 2)
    )
    return Motion(time, position, velocity, acceleration, bandwidth, ranges, rows)


def _by_range(fit: LocalFit, time: Array, values: Array, ranges: NDArray[np.intp]) -> Array:
    return np.concatenate([fit.apply(time[a:b], values[a:b]) for a, b in ranges])


def _usable_rows(log: Log) -> NDArray[np.intp]:
    """Rows that are finite in all channels and increase in time, of eight stretches if many."""
    count = len(log)
    if count > STRETCHES * STRETCH_ROWS:
        starts = np.linspace(0, count - STRETCH_ROWS, STRETCHES).astype(np.intp)
        rows = np.concatenate([np.arange(s, s + STRETCH_ROWS) for s in starts])
    else:
        rows = np.arange(count)
    for channel in log.channels:
        there = np.isfinite(log[channel][rows])
        if there.any() or channel not in CONDITIONS:  # a broken thermometer hides no motion
            rows = rows[there]
    if rows.size == 0:
        return rows
    time = log["time"][rows]
    highest = np.concatenate(([-np.inf], np.maximum.accumulate(time)[:-1]))
    return np.asarray(rows[time > highest])
