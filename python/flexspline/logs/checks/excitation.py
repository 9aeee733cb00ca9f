"""Whether a run contains what effects need: channels, motion, load, temperature, rate.

Of effects that are asked for, a missing channel is an error, for the effect cannot be computed. A
run that does not excite the effect is a note: it may be one of several runs that do together.
`excited` says the same of every effect that explains a target, before any is chosen. It is no
promise: what is excited a fit may still not tell from another effect, and of what is hardly excited
a fit may find something that is another effect's.

What an effect reads and demands it declares itself (`effects/effect.hpp`); here is what each demand
means of a log: a need looks at a log and its motion and returns None, or the amount found and what
to record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import wraps

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import CATALOGUE, EffectInfo
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.checks.findings import Excited, Finding
from flexspline.logs.checks.samples import Motion, motion_of, unwrapped
from flexspline.logs.log import Log
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.splitting import ROWS_PER_UNKNOWN

TARGETS = ("sensor_torque", "motor_torque", "motor_current", "torsion")
LETTERS = {"sensor_torque": "S", "motor_torque": "M", "motor_current": "M", "torsion": "D"}
SHORTEST_RUN = 1.0  # s, below which a run is called short
DURATION = "duration"  # the demand that several runs do not meet together
PAUSE = 1.0  # s between runs one behind the other: more than any gap within one

POSITION, MOTOR, KNOWN = "output_position", "motor_position", "reference_torque"
MOTION = "output_position or output_velocity"
DRIVE = "motor_torque or motor_current"
FROM_LOG = {
    "output_velocity": MOTION,
    "output_acceleration": f"{POSITION} or output_acceleration",
    "motor_position": f"{POSITION} or {MOTOR}",
    "motor_torque": DRIVE,
    "load": f"{KNOWN} or {MOTION}",
}
"""What a log may give a channel of the core by, where that is not the channel itself."""
ALWAYS = ("period", "time")

Lack = tuple[float, str, str, str]
"""Size, its unit, what the run lacks, what to record."""
OWN_LOAD = f"only with inertia or gravity beside it, for {KNOWN} is not there"
"""What an effect of the load takes where the load is not known."""
STILL = (0.0, "rad/s", "the joint stands still")
"""What a run without motion lacks; what to record is each demand's own."""
STATE = ("State gear_ratio.", "State pole_pairs.")
"""What to do where a fact is not known, and so neither what a run lacks."""

Array = NDArray[np.float64]
Need = Callable[[Log, Motion | None], Lack | None]


def channels_asked(info: EffectInfo) -> tuple[str, ...]:
    """Channels that a log must have for an effect, each one or an alternative ("a or b").

    Which of several paths drives an effect is its user's choice, so none of them is asked for. The
    load of a torsion is one from outside: the joint's own mass is no part of its model.
    """
    of_torsion = info.targets == "D"
    asked = [POSITION, MOTOR] if of_torsion else []
    for channel in channels_of_rows(info):
        if channel not in ALWAYS:
            known = channel == "load" and (info.traits.known_load or of_torsion)
            asked.append(KNOWN if known else FROM_LOG.get(channel, channel))
    return tuple(dict.fromkeys(asked))


def channels_of_rows(info: EffectInfo) -> list[str]:
    """Channels that an effect reads whichever path drives it."""
    paths = {channel for channel, _ in info.paths}
    return [channel for channel in info.reads if channel not in paths]


def excitation(log: Log, effects: Sequence[str], target: str | None) -> Iterator[Finding]:
    """Missing channels and lacking excitation for these effects and this target."""
    if target is not None:
        yield from _target(log, target)
    if not effects:
        return
    motion = motion_of(_with_position(log))
    if _short(log, len(effects) + 1):
        yield Finding(
            "too_short",
            "note",
            "time",
            (0, len(log)),
            log.duration,
            "s",
            f"the run has {len(log)} rows in {log.duration:.3g} s, little for "
            f"{len(effects)} effect{'' if len(effects) == 1 else 's'}.",
            "Record a longer run, or fit several together.",
        )
    for effect in effects:
        yield from _effect(log, effect, motion)


Lacks = dict[tuple[str, float], Lack | None]
"""What a run lacks, by demand and amount."""


def excited(
    log: Log, effects: Sequence[str], target: str | None, known: Lacks | None = None
) -> tuple[Excited, ...]:
    """Return of each effect whether the run excites it.

    Parameters
    ----------
    log : without any error.
    effects : names, or none: all that explain the target.
    target : or None: all targets whose channels are there.
    known : what the run lacks, as far as that is known.
    """
    letters = {LETTERS[name] for name in ([target] if target else _targets_in(log))}
    names = effects or [name for name, info in CATALOGUE.items() if letters & set(info.targets)]
    motion = motion_of(_with_position(log))
    lacks = dict(known or {})
    return tuple(_excited(log, CATALOGUE[name], motion, lacks) for name in names)


def excited_together(
    logs: Sequence[Log], effects: Sequence[str] = (), target: str | None = None
) -> tuple[Excited, ...]:
    """Return of each effect whether several runs excite it together, with what all have.

    Speeds, directions, angles, loads and temperatures are those of all runs; time is that of the
    longest.

    Parameters
    ----------
    logs : one or more, without any error.
    effects, target : as for `excited`.
    """
    longest = max(logs, key=lambda log: log.duration)
    amounts = {a for info in CATALOGUE.values() for d, a in info.demands if d == DURATION}
    known = {(DURATION, amount): lasting(amount)(longest, None) for amount in amounts}
    try:
        return excited(_one_behind_the_other(logs), effects, target, known)
    finally:
        motion_of.cache_clear()  # it would keep the log


def _one_behind_the_other(logs: Sequence[Log]) -> Log:
    """The rows of all logs, with the channels that all have and a second between them."""
    shared = [name for name in logs[0].channels if all(name in log for log in logs)]
    columns = {name: np.concatenate([log[name] for log in logs]) for name in shared}
    times, start = list[Array](), 0.0
    for log in logs:
        times.append(log["time"] - log["time"][0] + start)
        start = float(times[-1][-1]) + PAUSE
    return Log({**columns, "time": np.concatenate(times)}, logs[0].facts)


def _targets_in(log: Log) -> list[str]:
    """Targets whose channels are there."""
    return [name for name in TARGETS if all(channel in log for channel in _channels_of(name))]


def _channels_of(target: str) -> tuple[str, ...]:
    return (POSITION, MOTOR) if target == "torsion" else (target,)


def _excited(log: Log, info: EffectInfo, motion: Motion | None, lacks: Lacks) -> Excited:
    """Say whether a run excites one effect; `lacks` keeps what other effects asked for too."""
    asked = channels_asked(info)
    missing = [channel for channel in asked if not _given(log, channel)]
    if missing:
        return Excited(info.name, None, f"no {_wanted(missing)}", "Map it when reading.")
    if DRIVE in asked and not ("motor_torque" in log or "torque_constant" in log.facts):
        return Excited(info.name, None, "no torque constant is stated", "State torque_constant.")
    if _short(log, 2):
        said = f"the run has {len(log)} rows in {log.duration:.3g} s"
        return Excited(info.name, False, said, "Record a longer run.")
    for demand, amount in info.demands:
        if (demand, amount) not in lacks:
            lacks[demand, amount] = NEEDS[demand][0](amount)(log, motion)
        if (lack := lacks[demand, amount]) is not None:
            return Excited(info.name, None if lack[3] in STATE else False, lack[2], lack[3])
    own = "load" in channels_of_rows(info) and KNOWN not in log
    return Excited(info.name, True, remedy=OWN_LOAD if own else "")


def _given(log: Log, channel: str) -> bool:
    """Whether a log has a channel, or one of several ("a or b")."""
    return any(name in log for name in channel.split(" or "))


def _wanted(missing: Sequence[str]) -> str:
    """Return the channels to map, without those alternatives that another of them gives too."""
    ways = {one: set(one.split(" or ")) for one in missing}
    least = [one for one in missing if not any(way < ways[one] for way in ways.values())]
    return " and no ".join(least)


def _short(log: Log, unknowns: int) -> bool:
    return len(log) < ROWS_PER_UNKNOWN * unknowns or log.duration < SHORTEST_RUN


def _with_position(log: Log) -> Log:
    """The log with a position of the output, where it has none.

    It is the integral of its velocity, or else what the motor's angle makes of it: a torsion is no
    part of how a joint moves. Without a ratio the motor's angle stands for it.
    """
    from scipy.integrate import cumulative_trapezoid

    if POSITION in log or not ("output_velocity" in log or MOTOR in log):
        return log
    if "output_velocity" not in log:
        path = unwrapped(log, MOTOR) / (log.effective_ratio or 1.0)
        return log.with_columns({POSITION: path}, note="position of the motor's angle")
    path = cumulative_trapezoid(np.nan_to_num(log["output_velocity"]), log["time"], initial=0.0)
    return log.with_columns({POSITION: path}, note="position integrated from velocity")


def _target(log: Log, target: str) -> Iterator[Finding]:
    if target not in TARGETS:
        raise InputError(
            f"'{target}' is no target{did_you_mean(target, TARGETS)}; the targets are "
            f"{listed(TARGETS)}"
        )
    for channel in _channels_of(target):
        if channel not in log:
            yield _missing(log, channel, f"the target {target}")


def _effect(log: Log, effect: str, motion: Motion | None) -> Iterator[Finding]:
    if effect not in CATALOGUE:
        raise InputError(
            f"'{effect}' is no effect{did_you_mean(effect, CATALOGUE)}; the effects are "
            f"{listed(CATALOGUE, most=40)}"
        )
    info = CATALOGUE[effect]
    channels = channels_asked(info)
    for channel in channels:
        if not _given(log, channel):
            yield _missing(log, channel, effect)
            return
    for demand, amount in info.demands:
        need, shown_in = NEEDS[demand]
        lack = need(amount)(log, motion)
        if lack is not None:
            size, unit, what, remedy = lack
            yield Finding(
                "no_excitation",
                "note",
                shown_in or next(iter(channels), "time"),
                (0, len(log)),
                size,
                unit,
                f"{effect} is hardly excited: {what}.",
                remedy,
            )
            return


def _missing(log: Log, channel: str, what: str) -> Finding:
    ratio = log.effective_ratio
    by_motor = (
        f" The motor's encoder tells it but for the gear's torsion: map its column to {POSITION} "
        f"with scale = {1.0 / ratio:.6g}."
        if MOTOR in log and ratio and POSITION not in log and channel.startswith("output_")
        else ""
    )
    return Finding(
        "missing_channel",
        "error",
        channel,
        (0, len(log)),
        0.0,
        "",
        f"{what} needs {channel}, which is not in the log.",
        f"Map it when reading, or leave the effect out.{by_motor}",
    )


def changing(channel: str, least: float, unit: str) -> Need:
    """A channel that spans at least this much."""

    def need(log: Log, _: Motion | None) -> Lack | None:
        names = [name for name in channel.split(" or ") if name in log]
        span = max((_span(log[name]) for name in names), default=0.0)
        if span > least:
            return None
        return (
            span,
            unit,
            f"{listed(names)} changes by {span:.3g} {unit} only",
            f"Record a run in which {listed(names)} changes by more than {least:g} {unit}.",
        )

    return need


def _span(values: Array) -> float:
    """How far a channel changes, of the rows in which it is a number."""
    there = values[np.isfinite(values)]
    return float(np.ptp(there)) if len(there) else 0.0


LOADED = changing(KNOWN, 0.0, "Nm")


def of_motion(remedy: str) -> Callable[[Callable[[Log, Motion], Lack | None]], Need]:
    """Make a need of what looks at a motion; a run that has none lacks it, and is told `remedy`."""

    def decorate(look: Callable[[Log, Motion], Lack | None]) -> Need:
        @wraps(look)
        def need(log: Log, motion: Motion | None) -> Lack | None:
            return (*STILL, remedy) if motion is None else look(log, motion)

        return need

    return decorate


@of_motion("Record a run that moves both ways.")
def both_directions(_: Log, motion: Motion) -> Lack | None:
    """A tenth of the moving rows at least in each direction."""
    limit = 0.05 * float(np.percentile(np.abs(motion.velocity), 95))
    moving = motion.velocity[np.abs(motion.velocity) > limit]
    share = float(np.mean(moving > 0)) if moving.size else 0.0
    less = min(share, 1 - share)
    if less >= 0.1:
        return None
    return (
        less,
        "",
        f"{100 * max(share, 1 - share):.0f} % of the moving rows go one way, where a "
        "level of friction is an offset",
        "Record a run that moves both ways.",
    )


def speeds(ratio: float) -> Need:
    """Moving rows whose speeds span this ratio (10 % to 90 % of them)."""

    @of_motion("Record a run that moves.")
    def need(_: Log, motion: Motion) -> Lack | None:
        speed = np.abs(motion.velocity)
        moving = speed[speed > 0.02 * np.percentile(speed, 99)]
        low, high = (float(x) for x in np.percentile(moving, (10, 90)))
        if high >= ratio * low:
            return None
        return (
            high,
            "rad/s",
            f"the speeds lie between {low:.3g} and {high:.3g} rad/s, a factor "
            f"of {ratio:g} is needed",
            "Record several speeds.",
        )

    return need


@of_motion("Record a run that moves slowly.")
def low_speeds(_: Log, motion: Motion) -> Lack | None:
    """One row in a hundred at least that moves at less than a fifth of the top speed."""
    speed = np.abs(motion.velocity)
    top = float(np.percentile(speed, 99))
    share = float(np.mean((speed > 0.01 * top) & (speed < 0.2 * top)))
    if share >= 0.01:
        return None
    return (
        share,
        "",
        f"only {100 * share:.2g} % of the rows move slower than {0.2 * top:.3g} rad/s",
        "Record low speeds beside high ones.",
    )


def acceleration(_: Log, motion: Motion | None) -> Lack | None:
    """An acceleration well above what the noise of the position makes of it, behind some low pass.

    The bandwidth of the velocity lets noise through that the acceleration does not bear, so that
    narrower ones are looked at too, down to eight widths of the window in the run or 1 Hz.
    """
    if motion is None:
        return 0.0, "rad/s²", "the joint stands still", "Record a run that accelerates."
    time = motion.time
    lasts, step = float(time[-1] - time[0]), float(np.median(np.diff(time)))
    speed = float(np.sqrt(np.mean(motion.velocity**2)))
    grain = max(white_noise(motion.position), quantum(motion.position) / np.sqrt(12))
    bandwidth, lowest = motion.bandwidth, max(1.0, 8.0 / lasts)
    derived = motion.acceleration
    while True:
        size = float(np.sqrt(np.mean(derived**2)))
        # (noise of q̈)² = noise² step ∫ (2πf)⁴ G² df = noise² step 2 (2π)⁴ 0.554 B⁵, see local_fit
        noise = grain * float(np.sqrt(2 * (2 * np.pi) ** 4 * 0.554 * bandwidth**5 * step))
        if size > 5 * noise and size * lasts > speed:
            return None
        if bandwidth <= lowest:
            break
        bandwidth = max(bandwidth / 2, lowest)
        derived = motion.derivative(2, bandwidth)
    share = f"{noise:.3g} rad/s²" if noise < size else "all"
    return (
        size,
        "rad/s²",
        f"the acceleration is {size:.3g} rad/s² RMS below {bandwidth:.3g} Hz, of which noise makes "
        f"{share}",
        "Record a run that accelerates.",
    )


def turn_of(share: float) -> Need:
    """At least this share of an output turn."""

    def need(log: Log, motion: Motion | None) -> Lack | None:
        reach = float(np.ptp(motion.position)) if motion is not None else 0.0
        if reach >= 2 * np.pi * share * 0.98:
            return None
        return (
            reach,
            "rad",
            f"the output covers {reach / (2 * np.pi):.2g} of a turn, where its "
            "low harmonics look like each other and like an offset",
            f"Record at least {share:g} turn, or expect wide intervals.",
        )

    return need


def sampled(order_of: Callable[[Log, float], float | None]) -> Need:
    """Ripple of the lowest order of an effect, per turn of the output, below half the rate."""

    @of_motion("Record a run that moves.")
    def need(log: Log, motion: Motion) -> Lack | None:
        ratio = log.effective_ratio
        if ratio is None:
            return 0.0, "", "no gear ratio is stated", STATE[0]
        order = order_of(log, ratio)
        if order is None:
            return 0.0, "", "the number of pole pairs is not stated", STATE[1]
        fast = np.abs(motion.velocity) * order / (2 * np.pi) > 0.5 * log.rate
        share = float(np.mean(fast))
        if share < 0.1:
            return None
        return (
            share,
            "",
            f"order {order:.4g} per turn is above half the rate of {log.rate:.4g} "
            f"Hz in {100 * share:.0f} % of the rows",
            "Record faster, or move slower.",
        )

    return need


def own_or_known_load(log: Log, motion: Motion | None) -> Lack | None:
    """A known torque that changes, else motion: inertia and gravity of the model are a load too."""
    if KNOWN in log:
        return LOADED(log, motion)
    if motion is not None:
        return None
    return 0.0, "Nm", "neither a known torque nor motion loads it", "Record a run under load."


def both_torques(log: Log, _: Motion | None) -> Lack | None:
    """A known torque that takes both signs, each in a tenth of the rows at least."""
    share = float(np.mean(log[KNOWN] > 0.0))
    less = min(share, 1.0 - share)
    if less >= 0.1:
        return None
    return (
        less,
        "",
        f"the known torque has one sign in {100 * max(share, 1 - share):.0f} % of the rows, where "
        "a dead zone is an offset",
        "Record a run that loads the joint both ways.",
    )


def there_and_back(log: Log, motion: Motion | None) -> Lack | None:
    """A known torque that rises and falls over at least a tenth of its way, else motion both ways.

    The way is counted over a few hundred means, so that noise is no way.
    """
    if KNOWN not in log:
        return both_directions(log, motion)
    load = log[KNOWN]
    means = np.array([part.mean() for part in np.array_split(load, min(200, len(load)))])
    steps = np.diff(means)
    up, down = float(steps[steps > 0].sum()), float(-steps[steps < 0].sum())
    less, way = min(up, down), up + down
    if less > 0.1 * way:
        return None
    return (
        less,
        "Nm",
        f"the known torque goes {max(up, down):.3g} Nm one way and {less:.3g} Nm back",
        "Record a run that loads and unloads.",
    )


def lasting(seconds: float) -> Need:
    """A run of at least this length."""

    def need(log: Log, _: Motion | None) -> Lack | None:
        if log.duration >= seconds:
            return None
        return (
            log.duration,
            "s",
            f"the run lasts {log.duration:.3g} s",
            f"Record {seconds:g} s or more.",
        )

    return need


def teeth(log: Log, ratio: float) -> float | None:
    """Lowest order of cogging per turn of the output; None where the pole pairs are not stated."""
    return ratio * float(log.facts["pole_pairs"]) if "pole_pairs" in log.facts else None


NEEDS: dict[str, tuple[Callable[[float], Need], str]] = {
    "both_directions": (lambda _: both_directions, ""),
    "speed_ratio": (speeds, ""),
    "low_speeds": (lambda _: low_speeds, ""),
    "acceleration": (lambda _: acceleration, ""),
    "turn": (turn_of, ""),
    "resolved_order": (lambda amount: sampled(lambda _, ratio: amount * ratio), ""),
    "resolved_poles": (lambda _: sampled(teeth), ""),
    "temperature": (lambda amount: changing("temperature", amount, "°C"), "temperature"),
    DURATION: (lasting, "time"),
    "known_load": (lambda _: LOADED, KNOWN),
    "any_load": (lambda _: own_or_known_load, ""),
    "both_torques": (lambda _: both_torques, KNOWN),
    "there_and_back": (lambda _: there_and_back, ""),
    "motor_torque": (lambda _: changing(DRIVE, 0.0, ""), DRIVE),
}
"""What an effect may demand of a run, by the amount, and the channel that lacks it: "", the first
that the effect reads."""
