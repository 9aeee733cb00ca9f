"""Repairs: each asked for by name, done in the order asked, and written into the history.

A repair is "name" or "name=value", as in ``repair=("sort_time", "drop_start=1.0")`` or
``{"drop_start": 1.0}``. `REPAIRS` is the list of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.channels import CHANNELS, CONDITIONS
from flexspline.logs.derive import differentiate, has_value, increasing_time, resample, sampled
from flexspline.logs.log import Log, beyond
from flexspline.logs.segments import even_stamps, repeats, stuck_from
from flexspline.logs.spikes import SPIKED, spikes

__all__ = [
    "REPAIRS",
    "Repair",
    "Repairs",
    "move_earlier",
    "repaired",
    "repairs_of_both",
    "repairs_of_source",
    "spelled",
]

Repairs = str | Sequence[str] | Mapping[str, Any]

POSITIONS: Final = ("output_position", "motor_position", "commanded_position")
MOTOR_SIDE: Final = ("motor_position", "motor_velocity", "motor_torque", "motor_current")
OF_EITHER_SIGN: Final = ("scale", "shift", "drop_clipped", "keep")
VELOCITIES: Final = {"output_velocity": "output_position", "motor_velocity": "motor_position"}


@dataclass(frozen=True)
class Repair:
    """How a repair's value is written ("" for none, "[x]" if it may be left out), what it does."""

    value: str
    meaning: str
    do: Callable[[Log, str], Log]


def repaired(log: Log, repairs: Repairs) -> Log:
    """Return `log` with these repairs done, in this order.

    Raises
    ------
    InputError
        For an unknown repair, a value that is missing or not to be there, or a log on which
        the repair cannot be done.
    """
    for name, value in _asked(repairs):
        if name not in REPAIRS:
            raise InputError(
                f"repair '{name}' is not known{did_you_mean(name, REPAIRS)}; "
                f"the repairs are {listed(spelled(known) for known in REPAIRS)}"
            )
        repair = REPAIRS[name]
        if bool(value) != bool(repair.value) and not repair.value.startswith("["):
            raise InputError(
                f"repair '{name}' is written '{spelled(name)}': {repair.meaning}; "
                f"correct '{name}{'=' if value else ''}{value}'"
            )
        log = repair.do(log, value)
    return log


def repairs_of_both(said: Repairs, given: Repairs) -> Repairs:
    """Return the repairs that a column map says, and behind them what a call asks for besides.

    What both ask for is done once, as the call says it: its `drop_start=0.1` is there in place of
    the map's `drop_start=0.05`.
    """
    if not said or not given:
        return given or said
    more = [*_asked(given)]
    again = {_of(*one) for one in more}
    both = [*(one for one in _asked(said) if _of(*one) not in again), *more]
    return [f"{name}={value}" if value else name for name, value in both]


def repairs_of_source(
    repairs: Repairs, derived: str, source: str
) -> tuple[list[str], list[str]] | None:
    """Return repairs for before a channel is derived as a multiple of its source, and for behind.

    What turns, scales or moves either is done to the source, and once where both are named. Other
    repairs of the derived channel are of its own values, and come behind. None where nothing is
    done to the source.
    """
    before, behind = list[str](), list[str]()
    moved = set[tuple[str, str]]()
    for name, value in _asked(repairs):
        whole = name in ("flip_sign", "scale", "shift")
        if whole and _of(name, value)[1] in (derived, source):
            channel = _of(name, value)[1]
            other = source if channel == derived else derived
            if (name, other) not in moved:
                before.append(f"{name}={value.replace(derived, source, 1)}")
            moved.add((name, channel))
        else:
            repair = f"{name}={value}" if value else name
            (behind if _of(name, value)[1] == derived else before).append(repair)
    return (before, behind) if moved else None


def _of(name: str, value: str) -> tuple[str, str]:
    """A repair and the channel that it is of, if any."""
    first = value.split(":")[0]
    return name, first if first.isidentifier() else ""


def move_earlier(log: Log, channel: str, seconds: float, *others: str) -> Log:
    """Return the log with channels that are late by `seconds` moved to where they belong.

    The new value at t is the old one at t + seconds, by linear interpolation. Rows that then
    have no value, at one end and beside gaps, are dropped.
    """
    time = increasing_time(log, f"shift of {channel}")
    at = time + seconds
    inside = has_value(time, at)
    names, way = (channel, *others), "earlier" if seconds > 0 else "later"
    moved = log.with_columns(
        {name: sampled(name, time, log[name], at) for name in names},
        note=f"{', '.join(names)} moved {abs(seconds):g} s {way}; "
        f"rows without a value, dropped: {np.count_nonzero(~inside)}",
    )
    return _kept(moved, inside, f"shift of {channel}", "")


def _asked(repairs: Repairs) -> Iterator[tuple[str, str]]:
    if isinstance(repairs, Mapping):
        for name, value in repairs.items():
            if value is not False:
                parts = value if isinstance(value, (tuple, list)) else [value]
                plain = value is None or value is True
                yield name, "" if plain else ":".join(str(part) for part in parts)
        return
    if isinstance(repairs, str):
        repairs = [repairs]
    if not isinstance(repairs, Sequence) or not all(isinstance(name, str) for name in repairs):
        raise InputError(f"repair is {repairs!r}; give names such as 'unwrap' or 'drop_start=1'")
    for repair in repairs:
        name, _, value = repair.partition("=")
        yield name.strip(), value.strip()


def spelled(name: str) -> str:
    value = REPAIRS[name].value
    return name if not value else f"{name}[={value[1:]}" if value[0] == "[" else f"{name}={value}"


def _drop_invalid(log: Log, channel: str) -> Log:
    names = (channel,) if channel else log.channels
    wrong = {name: ~np.isfinite(log[name]) for name in names}
    where = listed(f"{rows.sum()} in {name}" for name, rows in wrong.items() if rows.any())
    said = f"not finite: {where}"
    for one in (found for found in beyond(log) if found.channel in wrong):
        wrong[one.channel][one.rows] = True
        said += f"; {one.sentence}"
    valid = ~np.logical_or.reduce(list(wrong.values()))
    note = f"drop_invalid: rows dropped: {np.count_nonzero(~valid)}; {said}"
    return _kept(log, valid, "drop_invalid", note)


def _sort_time(log: Log, _: str) -> Log:
    order = np.argsort(log["time"], kind="stable")
    moved = np.count_nonzero(order != np.arange(len(log)))
    return log.rows(order, note=f"sort_time: rows put elsewhere: {moved}")


def _drop_duplicates(log: Log, _: str) -> Log:
    fresh = np.concatenate([[True], np.diff(log["time"]) != 0])
    note = (
        "drop_duplicates: rows that repeat the time stamp before them, dropped: "
        f"{np.count_nonzero(~fresh)}"
    )
    return _kept(log, fresh, "drop_duplicates", note)


def _drop_repeated(log: Log, _: str) -> Log:
    again = repeats(log)
    note = (
        "drop_repeated: rows that repeat all values of the row before them, dropped: "
        f"{np.count_nonzero(again)}"
    )
    return _kept(log, ~again, "drop_repeated", note)


def _drop_stuck(log: Log, channel: str) -> Log:
    measured = [name for name in log.channels if name != "time" and name not in CONDITIONS]
    names = (channel,) if channel else measured
    if not names:
        raise InputError(
            f"log '{log.name}': drop_stuck finds no measured channel; it has {listed(log.channels)}"
        )
    first = stuck_from(*(log[name] for name in names))
    what = channel or "every measured channel"
    note = f"drop_stuck: the last rows, which repeat {what}; rows dropped: {len(log) - first}"
    return _kept(log, np.arange(len(log)) < first, "drop_stuck", note)


def _drop_clipped(log: Log, value: str) -> Log:
    channel, limit = _channel_and_number("drop_clipped", value)
    clipped = log[channel] == limit
    note = (
        f"drop_clipped: rows in which {channel} is {limit:g} {CHANNELS[channel].unit}, dropped: "
        f"{np.count_nonzero(clipped)}"
    )
    return _kept(log, ~clipped, "drop_clipped", note)


def _drop_spikes(log: Log, channel: str) -> Log:
    names = (channel,) if channel else tuple(name for name in SPIKED if name in log)
    found = {name: spikes(log["time"], log[name]) for name in names}
    alone = np.zeros(len(log), dtype=bool)
    for rows in found.values():
        alone[rows] = True
    where = listed(f"{len(rows)} in {name}" for name, rows in found.items() if len(rows)) or "none"
    note = (
        f"drop_spikes: rows that stand alone in a channel, dropped: {np.count_nonzero(alone)}; "
        f"{where}"
    )
    return _kept(log, ~alone, "drop_spikes", note)


def _keep(log: Log, value: str) -> Log:
    start, colon, end = (part.strip() for part in value.partition(":"))
    if not colon or not (start or end):
        raise InputError(f"repair 'keep={value}': no span of time; write {spelled('keep')}")
    first = _number("keep", start) if start else -math.inf
    last = _number("keep", end) if end else math.inf
    inside = (log["time"] >= first) & (log["time"] <= last)
    note = f"keep: from {first:g} to {last:g} s; rows dropped: {np.count_nonzero(~inside)}"
    return _kept(log, inside, "keep", note)


def _drop_start(log: Log, value: str) -> Log:
    seconds = _number("drop_start", value)
    late = log["time"] >= log["time"][0] + seconds
    note = f"drop_start: the first {seconds:g} s; rows dropped: {np.count_nonzero(~late)}"
    return _kept(log, late, "drop_start", note)


def _drop_end(log: Log, value: str) -> Log:
    seconds = _number("drop_end", value)
    early = log["time"] <= log["time"][-1] - seconds
    note = f"drop_end: the last {seconds:g} s; rows dropped: {np.count_nonzero(~early)}"
    return _kept(log, early, "drop_end", note)


def _even_time(log: Log, _: str) -> Log:
    time = log["time"]
    if not (len(time) > 1 and np.diff(time).min() >= 0.0 and time[-1] > time[0]):
        raise InputError(
            f"log '{log.name}': even_time needs a time that does not run backwards; ask for "
            "drop_invalid and sort_time before it"
        )
    even, step = even_stamps(time)
    note = f"even_time: even stamps, {step:.6g} s from row to row; moved by up to "
    return log.with_columns({"time": even}, note=f"{note}{np.max(np.abs(even - time)):.3g} s")


def _unwrap(log: Log, channel: str) -> Log:
    names = (channel,) if channel else tuple(name for name in POSITIONS if name in log)
    if not names:
        raise InputError(
            f"log '{log.name}': unwrap finds no position; it has {listed(log.channels)}"
        )
    for name in names:
        if not np.isfinite(log[name]).all():
            row = int(np.flatnonzero(~np.isfinite(log[name]))[0])
            raise InputError(
                f"log '{log.name}': row {row} of '{name}' is not finite and "
                "cannot be unwrapped; ask for drop_invalid before unwrap"
            )
        whole = np.unwrap(log[name])
        jumps = np.count_nonzero(np.abs(np.diff(log[name])) > np.pi)
        log = log.with_columns({name: whole}, note=f"unwrap: jumps of 2π in {name} undone: {jumps}")
    return log


def _flip_sign(log: Log, channel: str) -> Log:
    return log.with_columns({channel: -log[channel]}, note=f"flip_sign: {channel} times -1")


def _scale(log: Log, value: str) -> Log:
    channel, factor = _channel_and_number("scale", value)
    return log.with_columns(
        {channel: log[channel] * factor}, note=f"scale: {channel} times {factor:g}"
    )


def _reverse_motor(log: Log, _: str) -> Log:
    names = [name for name in MOTOR_SIDE if name in log]
    if not names:
        raise InputError(
            f"log '{log.name}': reverse_motor finds no channel of the motor; it has "
            f"{listed(log.channels)}"
        )
    return log.with_columns(
        {name: -log[name] for name in names}, note=f"reverse_motor: {listed(names)} times -1"
    )


def _velocity_from_position(log: Log, channel: str) -> Log:
    velocity = channel or "output_velocity"
    if velocity not in VELOCITIES:
        raise InputError(
            f"repair 'velocity_from_position={channel}': no such velocity; "
            f"give {' or '.join(VELOCITIES)}"
        )
    increasing_time(log, "velocity_from_position")
    derived = differentiate(log, of=VELOCITIES[velocity], channels=(velocity,))
    note = f"velocity_from_position: {velocity} is that of {VELOCITIES[velocity]}"
    return derived.with_columns({}, note=note)


def _shift(log: Log, value: str) -> Log:
    channel, seconds = _channel_and_number("shift", value)
    return move_earlier(log, channel, seconds)


def _resample(log: Log, value: str) -> Log:
    increasing_time(log, "resample")
    return resample(log, _number("resample", value))


def _number(name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or (number < 0 and name not in OF_EITHER_SIGN):
        raise InputError(
            f"repair '{name}={text}': '{text}' is no number that it can take; write {spelled(name)}"
        )
    return number


def _channel_and_number(name: str, value: str) -> tuple[str, float]:
    channel, _, number = value.partition(":")
    if channel not in CHANNELS:
        raise InputError(
            f"repair '{name}={value}': '{channel}' is no channel"
            f"{did_you_mean(channel, CHANNELS)}; write {spelled(name)}"
        )
    return channel, _number(name, number)


def _kept(log: Log, mask: NDArray[np.bool_], what: str, note: str) -> Log:
    if not mask.any():
        raise InputError(
            f"log '{log.name}': {what} leaves no row of {len(log)}; give it less or leave it out"
        )
    return log.rows(mask, note=note)


REPAIRS: Final[dict[str, Repair]] = {
    "drop_invalid": Repair(
        "[channel]", "drop rows with NaN, infinity or an overload", _drop_invalid
    ),
    "sort_time": Repair("", "put rows in the order of time", _sort_time),
    "drop_duplicates": Repair("", "drop rows that repeat a time stamp", _drop_duplicates),
    "drop_repeated": Repair("", "drop rows that repeat all of the row before", _drop_repeated),
    "drop_stuck": Repair("[channel]", "drop the end that repeats the last sample", _drop_stuck),
    "drop_clipped": Repair("channel:limit", "drop rows at a limit of a channel", _drop_clipped),
    "drop_spikes": Repair("[channel]", "drop single rows that stand alone", _drop_spikes),
    "keep": Repair("from:to", "keep no more than these seconds of the run's clock", _keep),
    "drop_start": Repair("seconds", "drop the start of the run", _drop_start),
    "drop_end": Repair("seconds", "drop the end of the run", _drop_end),
    "unwrap": Repair("[channel]", "undo the jumps of 2π of a wrapped angle", _unwrap),
    "flip_sign": Repair("channel", "turn the sign of a channel", _flip_sign),
    "scale": Repair("channel:factor", "multiply a channel", _scale),
    "shift": Repair("channel:seconds", "move a late channel earlier", _shift),
    "reverse_motor": Repair("", "turn the sign of all channels of the motor", _reverse_motor),
    "velocity_from_position": Repair(
        "[velocity]", "compute a velocity anew from its position", _velocity_from_position
    ),
    "even_time": Repair("", "put even time stamps on rows that got them in bursts", _even_time),
    "resample": Repair("Hz", "put the log on even steps", _resample),
}
