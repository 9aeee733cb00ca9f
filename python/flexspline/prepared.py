"""Channels as a model expects them: made as in the runs that its effects were found in.

Rows of a noisy channel are noisy regressors: their coefficients are attenuated, and what they no
longer explain looks for another effect. A regressor that is replaced by what the recording lets
one expect of it, E[x | recorded], leaves no such bias (regression calibration:
[Carroll2006]). Of a channel whose noise is flat that is the channel smoothed up to
where its signal exceeds the noise (`logs/channel_noise.py`). Position, velocity and acceleration of
the output are one smoothed motion, from the channel that tells the velocity best. So they are, too,
where a position has frequencies beyond those that its rows tell: which rows that spoils has to be
known, for they do not count. The target is never smoothed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from flexspline.errors import InputError, number
from flexspline.logs.channel_noise import ChannelNoise, channel_noise, is_only_noise
from flexspline.logs.checks.consistency import is_delay, velocity_delay
from flexspline.logs.derive import derivative, lowpass_log
from flexspline.logs.local_fit import require_bandwidth
from flexspline.logs.log import Log, emptied, is_read
from flexspline.parallel import in_order

__all__ = [
    "MOTION",
    "Preparation",
    "bandwidth_used",
    "inputs_json",
    "learned",
    "noise_of_channels",
    "preparations_for",
    "preparations_of",
    "prepared",
    "without_noise_alone",
]

POSITION, VELOCITY, ACCELERATION = (
    "output_position",
    "output_velocity",
    "output_acceleration",
)
MOTION = (POSITION, VELOCITY, ACCELERATION)
INPUTS = ("motor_position", "temperature", "motor_temperature")
OF_THE_MOTOR = ("motor_torque", "motor_current")  # inputs where they are not the target
QUIETER = 0.5  # of the noise of a derivative, for a recorded velocity to be used instead: it may
# be late, and have been filtered by its drive, which a position has not
TOLD = 0.05  # of a row, from which a delay is told


@dataclass(frozen=True)
class Preparation:
    """How a channel was made before any effect read it: without phase, −3 dB at `bandwidth`.

    Parameters
    ----------
    channel : that is made.
    source : the same channel, then it is smoothed; or a position, whose derivative it is.
    bandwidth : Hz.
    """

    channel: str
    source: str
    bandwidth: float

    @property
    def how(self) -> str:
        """Return it in words, such as "smoothed at 16 Hz"."""
        made = "smoothed" if self.source == self.channel else f"derived from {self.source}"
        return f"{made} at {self.bandwidth:.3g} Hz"

    def __call__(self, log: Log) -> Log:
        """Return the log with the channel made so, once; as it is where it lacks the source.

        Raises
        ------
        InputError
            Where the bandwidth does not suit the log's rate, or the position is not finite.
        """
        note = f"{self.channel} as the model expects it: {self.how}"
        if self.source not in log or note in log.history:
            return log
        if self.source != self.channel:
            made = derivative(log, self.source, 2 if self._twice else 1, self.bandwidth)
            return log.with_columns({self.channel: made}, note=note)
        values = np.array(log[self.channel])
        lost = ~np.isfinite(values)
        if lost.all():
            return log
        values[lost] = np.interp(np.flatnonzero(lost), np.flatnonzero(~lost), values[~lost])
        whole = log.with_columns({self.channel: values}, note=note)
        smooth = np.array(lowpass_log(whole, self.bandwidth, (self.channel,))[self.channel])
        smooth[lost] = np.nan
        return log.with_columns({self.channel: smooth}, note=note)

    @property
    def _twice(self) -> bool:
        """Whether the channel is the second derivative of its source."""
        return self.channel == ACCELERATION and self.source == POSITION

    def to_json(self) -> dict[str, Any]:
        """Return it as `model.json` holds it."""
        return asdict(self)


def preparations_of(record: Mapping[str, Any]) -> tuple[Preparation, ...]:
    """Return what a part's record says of its channels; models made before this say nothing."""
    return tuple(
        Preparation(str(one["channel"]), str(one["source"]), float(one["bandwidth"]))
        for one in record.get("prepared", ())
    )


def inputs_json(
    inputs: Sequence[ChannelNoise], ways: Sequence[Preparation]
) -> list[dict[str, Any]]:
    """Return the noise of each channel and how rows read it, as `comparison.json` holds it."""
    used = {way.channel: way.bandwidth for way in ways}
    return [
        {
            "channel": noise.channel,
            "noise": noise.noise,
            "quantum": noise.quantum,
            "bandwidth": noise.bandwidth,
            "bandwidth_used": used.get(noise.channel),
        }
        for noise in inputs
    ]


def bandwidth_used(ways: Sequence[Preparation]) -> float | None:
    """-3 dB of the output's motion as rows read it, Hz; None where it is as recorded."""
    return next((way.bandwidth for way in ways if way.channel == "output_velocity"), None)


def prepared(log: Log, preparations: Iterable[Preparation]) -> Log:
    """Return the log with all channels made as a model expects them, once for each log."""
    ways = tuple(preparations)
    if not ways:
        return log
    made = _MADE.setdefault(log, {})
    if ways not in made:
        whole = log
        for one in ways:
            whole = one(whole)
        made.clear()  # the last ones that were asked for: a log is prepared in one way at a time
        made[ways] = whole
    return made[ways]


def without_noise_alone(
    runs: Sequence[Log], made: Sequence[Log], ways: Sequence[Preparation]
) -> tuple[list[Log], bool]:
    """Return logs with an acceleration of zero where no run shows one, and whether that is so.

    What one expects of an acceleration that noise makes all of is zero. A run among others whose
    acceleration shows keeps its own.

    Parameters
    ----------
    runs : as recorded.
    made : the same with their channels made in these ways.
    """
    source = next((way.source for way in ways if way.channel == ACCELERATION), POSITION)
    recorded = all(way.channel != ACCELERATION for way in ways)
    order = 2 if source == POSITION else 1
    for log in runs:
        if source not in log or (recorded and ACCELERATION in log):
            return [*made], False
        if not is_only_noise(log, source, order):
            return [*made], False
    note = f"{ACCELERATION} taken as zero: noise and rounding of {source} make all of it"
    zeros = [{ACCELERATION: np.zeros(len(log))} for log in made]
    return [log.with_columns(zero, note=note) for log, zero in zip(made, zeros, strict=True)], True


_MADE: WeakKeyDictionary[Log, dict[tuple[Preparation, ...], Log]] = WeakKeyDictionary()


def learned(
    logs: Sequence[Log],
    target: str,
    known_load: str | None,
    bandwidth: float | None = None,
    threads: int = 1,
) -> tuple[dict[str, ChannelNoise], tuple[Preparation, ...]]:
    """Return the noise of each channel, and how the inputs of a model are made from them.

    Parameters
    ----------
    bandwidth : Hz, -3 dB of the output's motion; None: what tells each derivative best; infinity:
        every channel is read as recorded.
    threads : channels that are looked at at the same time.

    Raises
    ------
    InputError
        For a bandwidth that does not suit the rate of a log.
    """
    if bandwidth not in (None, math.inf) and not number(bandwidth, "bandwidth", "Hz") > 0.0:
        raise InputError(
            f"bandwidth is {bandwidth!r}; give Hz above 0, or infinity for channels as recorded"
        )
    if bandwidth is not None and np.isfinite(bandwidth):
        for log in logs:
            require_bandwidth(bandwidth, log.rate, f"log '{log.name}', motion of the output")
    noise = noise_of_channels(logs, threads)
    if bandwidth == np.inf:
        return noise, ()
    position, velocity = noise.get(POSITION), noise.get(VELOCITY)
    if position is not None and velocity is not None and _quieter(velocity, position):
        late = _lateness(logs, position.smoother(1))
        if abs(late) * velocity.rate > TOLD:  # small against the motion's periods it is no longer
            late = _as_checked(logs, late)
        noise[VELOCITY] = replace(velocity, delay=late)
    return noise, preparations_for(noise, target, known_load, bandwidth)


def noise_of_channels(logs: Sequence[Log], threads: int = 1) -> dict[str, ChannelNoise]:
    """Return the noise of each channel that all runs have, if its values are an instrument's."""
    shared = [
        name
        for name in logs[0].channels
        if name != "time" and all(name in log and is_read(name, log[name]) for log in logs)
    ]
    found = in_order(threads, lambda name: channel_noise(logs, name), shared)
    return {name: one for name, one in zip(shared, found, strict=True) if one is not None}


def preparations_for(
    noise: Mapping[str, ChannelNoise],
    target: str,
    known_load: str | None,
    bandwidth: float | None = None,
) -> tuple[Preparation, ...]:
    """Return how the inputs of a model are made from channels with this noise.

    Parameters
    ----------
    noise : by channel, see `noise_of_channels`.
    target : it is never smoothed, nor what it is made of beside the rows.
    known_load : channel of τ_load that the rows read, or None.
    bandwidth : Hz, -3 dB of all of the output's motion; None: what tells each derivative best.
    """
    made = list(_motion(noise, bandwidth))
    drive = target in ("motor_torque", "motor_current")
    inputs = (*INPUTS, *(() if drive else OF_THE_MOTOR), *([known_load] if known_load else []))
    for name in (n for n in inputs if n in noise):
        if noise[name].noisy:
            made.append(Preparation(name, name, noise[name].smoother()))
    return tuple(made)


def _motion(noise: Mapping[str, ChannelNoise], bandwidth: float | None) -> Iterable[Preparation]:
    """The output's motion: derivatives first, since they are those of the position as recorded."""
    position, velocity = noise.get(POSITION), noise.get(VELOCITY)
    quieter = position is not None and velocity is not None and _quieter(velocity, position)
    coarse = position is not None and position.coarse and not quieter
    if position is None or not (position.noisy or coarse or bandwidth is not None):
        if velocity is not None and velocity.noisy:  # an angle without noise tells it better
            told = velocity.smoother() if position is None else position.smoother(1)
            source = VELOCITY if position is None else POSITION
            yield Preparation(VELOCITY, source, bandwidth or told)
        return
    if velocity is not None and quieter:
        yield Preparation(ACCELERATION, VELOCITY, bandwidth or velocity.smoother(1))
        if velocity.noisy or bandwidth is not None:
            yield Preparation(VELOCITY, VELOCITY, bandwidth or velocity.smoother())
    else:
        yield Preparation(ACCELERATION, POSITION, bandwidth or position.smoother(2))
        yield Preparation(VELOCITY, POSITION, bandwidth or position.smoother(1))
    yield Preparation(POSITION, POSITION, bandwidth or position.smoother())


def _quieter(velocity: ChannelNoise, position: ChannelNoise) -> bool:
    """Whether a recorded velocity, with its delay, is nearer to the motion than a derivative is."""
    band = min(position.bandwidth, velocity.bandwidth)
    late = velocity.delay * velocity.slope
    return bool(np.hypot(velocity.within(band), late) < QUIETER * position.within(band, 1))


def _lateness(logs: Sequence[Log], bandwidth: float) -> float:
    """By how much the recorded velocity is later than the position's derivative, s.

    A velocity that is late by d falls short of the derivative by d times the acceleration, both
    seen through the same smoother.
    """
    products, squares = 0.0, 0.0
    for log in logs:
        product, square = _late_motion(log, bandwidth)
        products += product
        squares += square
    return products / squares if squares > 0.0 else 0.0


def _as_checked(logs: Sequence[Log], late: float) -> float:
    """The delay as the checks of encoders tell it, the median of the runs; s.

    What is `late` by much of the motion's periods falls short by less than delay · acceleration.
    """
    found = [velocity_delay(emptied(log), VELOCITY) for log in logs]
    told = [one.seconds for one in found if one is not None and is_delay(one)]
    return float(np.median(told)) if 2 * len(told) > len(logs) else late


def _late_motion(log: Log, bandwidth: float) -> tuple[float, float]:
    """Sums of (shortfall · acceleration) and of acceleration², once for each log and bandwidth."""
    kept = _LATE.setdefault(log, {})
    if bandwidth not in kept:
        smooth = lowpass_log(log, bandwidth, (VELOCITY,))
        velocity, slope = (derivative(log, POSITION, order, bandwidth) for order in (1, 2))
        short = velocity - smooth[VELOCITY]
        seen = np.isfinite(short) & np.isfinite(slope)
        short, slope = short[seen], slope[seen]
        kept[bandwidth] = float(short @ slope), float(slope @ slope)
    return kept[bandwidth]


_LATE: WeakKeyDictionary[Log, dict[float, tuple[float, float]]] = WeakKeyDictionary()
