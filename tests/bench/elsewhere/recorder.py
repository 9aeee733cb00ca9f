"""What the recorder makes of a case: quanta, delays, noise, missing rows; and the logs.

A laboratory's recorder has an output and a motor encoder, a filtered and late velocity, perhaps an
acceleration, and a load cell that is noisy and late. A robot's has differences of a coarse encoder
and a current in quanta; rows may be missing, and time stamps may be whole milliseconds. Either may
have a slow thermometer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

import flexspline
from elsewhere.case import Case, case_of
from elsewhere.parts import Array, coloured, lagged, low_passed, quantised

__all__ = ["Recorder", "Recording", "recorded"]

JITTER = 0.3  # of a quantum of the output encoder
THERMOMETER = 0.02  # K of noise


@dataclass(frozen=True)
class Recorder:
    """Settings in SI units; lags, delays and noise are those of the channel.

    Of a robot alone: `current_quantum`, `stride` (rows of a difference), `drops`, `milliseconds`.
    The others that are true or false say which channels and facts there are.
    """

    output_quantum: float
    motor_quantum: float
    load_delay: float
    load_noise: float
    velocity_cutoff: float
    velocity_delay: float
    velocity_noise: float
    temperature_quantum: float
    temperature_lag: float
    motor_position: bool
    acceleration: bool
    motor_torque: bool
    poles: bool
    drops: bool
    milliseconds: bool
    current_quantum: float

    def stride(self, rate: float, speed: float) -> int:
        """Rows over which a robot takes the difference of its angle: a quantum is 4 % of v."""
        rows = max(1, int(np.ceil(self.output_quantum * rate / (0.04 * speed))))
        return min(rows, int(0.06 * rate) or 1)


@dataclass(frozen=True)
class Recording:
    """A case as `discover` is given it, and the truth.

    `hidden`: names, that of a cause without a name beginning with "?". `noise`: deviation of the
    noise in the target, in its unit.
    """

    seed: int
    kind: str
    base: list[str | flexspline.Effect]
    logs: list[flexspline.Log]
    target: str
    known_load: str | None
    hidden: tuple[str, ...]
    noise: float
    description: str


def recorded(seed: int) -> Recording:
    """Make the logs of a seed."""
    rng = np.random.default_rng([seed, 777])
    case = case_of(seed, rng)
    recorder = _drawn(case, rng)
    deal = case.deal
    return Recording(
        seed=seed,
        kind=deal.kind,
        base=list(case.known),
        logs=[_log(case, recorder, run, rng) for run in range(case.scene.joint.runs)],
        target=deal.target,
        known_load="reference_torque" if deal.lab else None,
        hidden=deal.hidden,
        noise=case.noise * (1.0 if deal.lab else 1 / case.scene.joint.drive),
        description=_description(case, recorder),
    )


def _drawn(case: Case, rng: Generator) -> Recorder:
    deal, joint, lab = case.deal, case.scene.joint, case.deal.lab
    named = deal.target == "motor_torque" or deal.hides("motor_crosstalk")
    return Recorder(
        output_quantum=_turn(rng, 18, 23) if lab else _turn(rng, 12, 18),
        motor_quantum=_turn(rng, 13, 21),
        load_delay=rng.uniform(0, 0.002),
        load_noise=rng.uniform(0.1, 0.35) * case.noise,
        velocity_cutoff=rng.uniform(30, 120),
        velocity_delay=rng.uniform(0, 1) / joint.rate,
        velocity_noise=rng.uniform(0.001, 0.004) * joint.speed,
        temperature_quantum=rng.choice([0.06, 0.1, 0.25]),
        temperature_lag=rng.uniform(2, 6),
        motor_position=lab or rng.random() < 0.5,
        acceleration=lab and rng.random() < 0.15,
        motor_torque=lab and (named or rng.random() < 0.8),
        poles=lab or deal.hides("cogging") or rng.random() < 0.5,
        drops=not lab and rng.random() < 0.4,
        milliseconds=not lab and rng.random() < 0.7,
        current_quantum=0.0 if lab else rng.uniform(0.2, 0.8) * case.noise / joint.drive,
    )


def _turn(rng: Generator, least: int, most: int) -> float:
    """Quantum of an encoder, rad."""
    return float(2 * np.pi / 2 ** int(rng.integers(least, most)))


def _log(case: Case, recorder: Recorder, run: int, rng: Generator) -> flexspline.Log:
    s, joint, lab = case.scene, case.scene.joint, case.deal.lab
    rows = s.slices[run]
    count, thin = rows.stop - rows.start, slice(rows.start, rows.stop, joint.refined)
    torque = case.output[rows] + case.hidden[rows] + _noise(case, count, rng)
    angle = s.q[rows] + rng.normal(size=count) * recorder.output_quantum * JITTER
    columns = {"output_position": quantised(angle, recorder.output_quantum)[:: joint.refined]}
    if recorder.motor_position:
        columns["motor_position"] = quantised(s.theta[thin], recorder.motor_quantum)
    columns |= _lab(case, recorder, rows, torque, rng) if lab else _robot(
        case, recorder, columns["output_position"], torque[:: joint.refined])  # fmt: skip
    if joint.thermometer:
        read = lagged(s.temperature[rows], recorder.temperature_lag, joint.step)
        read = read + THERMOMETER * rng.normal(size=count)
        columns["temperature"] = quantised(read, recorder.temperature_quantum)[:: joint.refined]
    columns["time"] = np.round(s.time[thin], 3) if recorder.milliseconds else s.time[thin]
    kept = np.ones(len(columns["time"]), bool)
    if recorder.drops:
        _drop(kept, rng)
    facts = _facts(case, recorder) | {"name": f"{case.deal.kind}{case.deal.seed}_{run}"}
    kept_columns = {channel: values[kept] for channel, values in columns.items()}
    return flexspline.Log.from_arrays(facts=facts, **kept_columns)


def _noise(case: Case, count: int, rng: Generator) -> Array:
    white = np.sqrt(case.white) * rng.normal(size=count)
    slow = np.sqrt(1 - case.white) * coloured(rng, count, case.scene.joint.step, case.seconds)
    return np.asarray(case.noise * (white + slow))


def _lab(
    case: Case, recorder: Recorder, rows: slice, torque: Array, rng: Generator
) -> dict[str, Array]:
    """Channels of a rig beside angles and temperature, on rows of the log."""
    s, joint = case.scene, case.scene.joint
    thin, quantum = slice(None, None, joint.refined), 0.1 * case.noise
    columns = _motion(case, recorder, rows, rng)
    cell = np.interp(s.time[rows] - recorder.load_delay, s.time[rows], s.load[rows])
    cell = cell + recorder.load_noise * rng.normal(size=len(cell))
    columns["reference_torque"] = quantised(cell, recorder.load_noise * 0.8)[thin]
    if case.deal.target == "motor_torque":
        own = quantised(torque / joint.ratio, quantum / joint.ratio)
        return columns | {"motor_torque": own[thin]}
    columns["sensor_torque"] = quantised(torque, quantum)[thin]
    if recorder.motor_torque:
        motor = s.motor[rows] + 0.01 * joint.load * rng.normal(size=len(torque))
        columns["motor_torque"] = (motor / joint.ratio)[thin]
    return columns


def _motion(case: Case, recorder: Recorder, rows: slice, rng: Generator) -> dict[str, Array]:
    """Velocity and, if there is one, acceleration of a rig."""
    s, step, thin = case.scene, case.scene.joint.step, slice(None, None, case.scene.joint.refined)
    smooth = low_passed(s.v[rows], recorder.velocity_cutoff, step)
    v = np.interp(s.time[rows] - recorder.velocity_delay, s.time[rows], smooth)[thin]
    v = v + recorder.velocity_noise * rng.normal(size=len(v))
    columns = {"output_velocity": quantised(v, recorder.velocity_noise / 2)}
    if recorder.acceleration:
        a = low_passed(s.a[rows], 60, step)[thin]
        columns["output_acceleration"] = a + 0.03 * np.std(s.a) * rng.normal(size=len(a))
    return columns


def _robot(case: Case, recorder: Recorder, angle: Array, torque: Array) -> dict[str, Array]:
    """Velocity and current of a robot's joint, on rows of the log."""
    joint = case.scene.joint
    stride = recorder.stride(joint.rate, joint.speed)
    before = np.concatenate([np.full(stride, angle[0]), angle[:-stride]])
    return {
        "output_velocity": (angle - before) * joint.rate / stride,
        "motor_current": quantised(torque / joint.drive, recorder.current_quantum),
    }


def _drop(kept: NDArray[np.bool_], rng: Generator) -> None:
    """Lose a few stretches of at most five rows."""
    for _ in range(int(rng.integers(1, 12))):
        first = int(rng.integers(5, len(kept) - 20))
        kept[first : first + int(rng.integers(1, 6))] = False


def _facts(case: Case, recorder: Recorder) -> dict[str, str | float | int]:
    joint = case.scene.joint
    facts: dict[str, str | float | int] = {
        "gear_ratio": joint.gear_ratio, "output_spline": joint.output_spline,
    }  # fmt: skip
    if recorder.poles:
        facts |= {"pole_pairs": joint.pole_pairs, "slots": joint.slots}
    if not case.deal.lab:
        facts["torque_constant"] = joint.torque_constant
    return facts


def _description(case: Case, recorder: Recorder) -> str:
    """What was drawn, in words."""
    s, joint, deal = case.scene, case.scene.joint, case.deal
    size = f"L={joint.load:.0f}" if deal.lab else f"mg={joint.link:.0f}"
    channels = (
        f"{', acc' * recorder.acceleration}{', T' * joint.thermometer}, "
        f"enc {round(np.log2(2 * np.pi / recorder.output_quantum))} bit"
    )
    return (
        f"{deal.kind} {deal.target} N={joint.gear_ratio:.0f} {joint.output_spline} "
        f"{joint.rate:.0f} Hz {joint.runs} runs, {'/'.join(s.motions)}, R={joint.reach:.2f} "
        f"vm={joint.speed:.2f}, load {s.loading} {size}; asym={200 * joint.asymmetry:+.0f}%; "
        f"noise {case.noise:.3f} Nm ({100 * case.noise / case.range:.1f}% of range){channels}; "
        f"hidden: {'; '.join(case.forms) or 'nothing'}"
    )
