"""One draw of the first paper, and the quantities of its claims: sensor, and arm.

Of the sensor: ripple of two placements, drift, calibration. Of the arm: the observer in free motion
and in collisions (§4.4).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.baselines import wave_generator_angle
from flexspline.calibration import CalibrationResult, calibrate
from flexspline.estimation import estimate
from flexspline.logs.derive import differentiate_causal
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.rigs.zhang import ARM, RATE, REST, Collision, ZhangRig, zhang_rig
from flexspline.rigs.zhang_sensor import DRIFT, FULL_SCALE, THERMISTOR
from flexspline.sensor import Bridge

__all__ = [
    "GAIN",
    "SPEEDS",
    "THRESHOLD",
    "Arm",
    "Hit",
    "Study",
    "amplitude",
    "dead_beat",
    "draw",
    "low_pass_error",
    "peak_between",
    "spectrum",
    "sum_over_one",
]

Array = NDArray[np.float64]

PADDED = 16  # so that a peak is found between the bins of a record
FIRST = 5.0  # s of a run that count as its start
LAST = 60.0  # s that count as its end

GAIN = 100.0  # 1/s
THRESHOLD = 0.03  # Nm
SPEEDS = (30.0, 45.0, 60.0)  # °/s
SETTLED = 0.3  # s after which filters no longer show their start


@dataclass(frozen=True)
class Study:
    """A rig and what §4.1 to §4.3 make of its sensor."""

    rig: ZhangRig

    @cached_property
    def placements(self) -> tuple[Log, Log]:
        """At 35.16 °/s without load: common and cancelling placement."""
        return self.rig.ripple()

    @cached_property
    def loading(self) -> CalibrationResult:
        """§4.3 as printed: one way, without temperature."""
        return calibrate(self.rig.bench.calibration(), degree=0, full_scale=FULL_SCALE)

    @cached_property
    def unloading(self) -> CalibrationResult:
        """The same with the way back, which hysteresis needs."""
        log = self.rig.bench.calibration(unloading=True)
        return calibrate(log, degree=0, full_scale=FULL_SCALE)

    @cached_property
    def drift(self) -> CalibrationResult:
        """§4.2: 20 to 45 °C without load, into the model of the line."""
        return calibrate(
            self.rig.bench.oven(),
            reference=None,
            thermistor=THERMISTOR,
            reference_temperature=20.0,
            into=self.loading.model,
        )

    @property
    def model(self) -> Model:
        """Line, drift and thermistor: what the sensor's microcontroller computes."""
        return self.drift.model

    @cached_property
    def held_out(self) -> Log:
        """A warming of another day."""
        return self.rig.bench.warm_up()

    @cached_property
    def before(self) -> Array:
        """Reading of the held-out warming less that at 20 °C, without compensation, Nm."""
        reading = self.loading["sensitivity"].value * self.held_out["sensor_voltage"]
        return np.asarray(reading - reading[self.held_out["time"] < FIRST].mean())

    @cached_property
    def after(self) -> Array:
        """Compensated reading of the held-out warming, Nm."""
        return np.asarray(estimate(self.model, self.held_out)["sensor_torque"])

    @property
    def risen(self) -> float:
        """Reading at 45 °C less that at 20 °C, without compensation, Nm."""
        time = self.held_out["time"]
        return float(self.before[time > time[-1] - LAST].mean())

    @property
    def polynomial_off(self) -> float:
        """Largest |estimate − (24)| / standard error of the three coefficients."""
        found = self.drift.drift_polynomial
        off = [abs(p.value - t) / p.standard_error for p, t in zip(found, DRIFT, strict=True)]
        return float(max(off))

    @property
    def four_gauges(self) -> Bridge:
        """R1 to R4 of the cancelling sensor, at 0° and 90°, by themselves."""
        built = self.rig.sensor.cancelling
        return replace(built, gauges=built.gauges[:4])

    def amplitude_left(self, order: int) -> float:
        """Amplitude of an order, cancelling over common placement."""
        common, cancelling = self.placements
        return amplitude(cancelling, order) / amplitude(common, order)


def amplitude(log: Log, order: int) -> float:
    """Amplitude of an order of the wave generator in the voltage [V], beside a straight drift."""
    phase = order * wave_generator_angle(log)
    time = log["time"] - log["time"][0]
    rows = np.column_stack([np.ones_like(time), time, np.cos(phase), np.sin(phase)])
    found = np.linalg.lstsq(rows, log["sensor_voltage"], rcond=None)[0]
    return float(np.hypot(found[2], found[3]))


def spectrum(log: Log) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes [V] of the voltage, Hann's window, zeros appended."""
    voltage = log["sensor_voltage"] - log["sensor_voltage"].mean()
    window = np.hanning(len(voltage))
    size = 2.0 * np.abs(np.fft.rfft(voltage * window, PADDED * len(voltage))) / window.sum()
    return np.asarray(np.fft.rfftfreq(PADDED * len(voltage), 1.0 / log.rate)), np.asarray(size)


def peak_between(log: Log, low: float, high: float) -> float:
    """Frequency of the highest peak between two [Hz]."""
    hertz, size = spectrum(log)
    inside = (hertz >= low) & (hertz <= high)
    return float(hertz[inside][np.argmax(size[inside])])


@dataclass(frozen=True)
class Hit:
    """A collision, without and with a stop on the flag.

    Parameters
    ----------
    speed : °/s, and its sign the direction.
    free : no stop. stopped : the arm stops on the flag.
    residual : of the observer in `free`, Nm, (N,).
    flag : time of the first row at or after the touch that passes the threshold on the side of
        the contact, s; the end of the run where none does.
    """

    speed: float
    free: Collision
    stopped: Collision
    residual: Array
    flag: float

    @property
    def delay(self) -> float:
        """From first contact to the flag, s."""
        return self.flag - self.free.touched


@dataclass(frozen=True)
class Arm:
    """The arm of a rig with the observer of Table 2; `model` reads the sensor."""

    rig: ZhangRig
    model: Model
    gain: float = GAIN
    exact: bool = True

    @cached_property
    def swings(self) -> Log:
        """Two minutes without contact."""
        return self.rig.swings()

    @cached_property
    def free_residual(self) -> Array:
        """Observer in free motion, Nm, NaN while filters start."""
        return self.residual(self.swings)

    @property
    def bound(self) -> float:
        """Largest |r| without contact, Nm."""
        return float(np.nanmax(np.abs(self.free_residual)))

    @property
    def false_alarms(self) -> int:
        """Alarms of two minutes without contact."""
        known = np.isfinite(self.free_residual)
        contact = _core.detect_collision(
            self.swings["time"][known],
            self.free_residual[known],
            np.zeros(int(known.sum())),
            speed_edges=[],
            negative=[THRESHOLD],
            positive=[THRESHOLD],
            release=1.0,
            hold=0.0,
        )
        return int(np.count_nonzero(np.diff(contact.astype(int), prepend=0) == 1))

    @cached_property
    def hits(self) -> tuple[Hit, ...]:
        """A collision at each speed, directions taking turns."""
        ways = ((speed, 1 - 2 * (k % 2)) for k, speed in enumerate(SPEEDS))
        return tuple(self.hit(speed, way) for speed, way in ways)

    def hit(self, speed: float, direction: int) -> Hit:
        """Collide, find the flag, and collide again with a stop at it."""
        free = self.rig.collide(speed, direction)
        residual = self.residual(free.log)
        time = free.log["time"]
        late = np.flatnonzero((time >= free.touched) & (direction * residual > THRESHOLD))
        flag = float(time[late[0] if len(late) else -1])
        stopped = self.rig.collide(speed, direction, alarm=flag)
        return Hit(direction * speed, free, stopped, residual, flag)

    def state(self, log: Log) -> tuple[Array, Array]:
        """Causal velocity [rad/s] and the sensor's torque, zero with the arm hanging [Nm]."""
        torque = estimate(self.model, log)["sensor_torque"]
        resting = (log["time"] > SETTLED) & (log["time"] < REST)
        speed = differentiate_causal(log, bandwidth=self.rig.speed_bandwidth)["output_velocity"]
        return speed, torque - torque[resting].mean()

    def residual(self, log: Log) -> Array:
        """External torque by (21) with the parameters of Table 2, our sign, Nm."""
        speed, torque = self.state(log)
        known = torque - ARM[1] * np.sin(log["output_position"])
        external = _core.observe_momentum(
            log["time"], ARM[0] * speed, known, gain=self.gain, exact=self.exact
        )
        return np.where(log["time"] - log["time"][0] < SETTLED, np.nan, external)


def low_pass_error(gain: float = GAIN, rate: float = RATE) -> float:
    """Largest |exact observer − (19)'s response| to a step of 1 Nm on a rigid arm.

    The arm turns in a horizontal plane, without friction or noise; (19) is about τ_c alone.
    """
    from flexspline.simulation import Joint, Motor, Output

    arm = Joint(motor=Motor(inertia=1e-5), output=Output(inertia=ARM[0]))
    time = np.arange(0.0, 0.2, 1.0 / rate)
    run = arm.simulate(time, load_torque=1.0, inputs="hold")
    whole = ARM[0] + arm.effective_ratio**2 * arm.motor.inertia
    momentum = whole * run["output_velocity"]
    seen = _core.observe_momentum(time, momentum, np.zeros_like(time), gain=gain, exact=True)
    return float(np.nanmax(np.abs(seen + np.expm1(-gain * time))))


def dead_beat(rate: float = RATE) -> float:
    """K_O · dt from which a forward-Euler observer no longer settles.

    From one sample to the next its error is multiplied by a factor that falls on a straight line
    with K_O · dt; the line through two gains that settle says where the factor is −1.
    """
    at = (1.2, 1.6)
    low, high = (_error_factor(k, rate) for k in at)
    return float(at[0] + (-1.0 - low) * (at[1] - at[0]) / (high - low))


def _error_factor(step: float, rate: float) -> float:
    time = np.arange(6) / rate
    seen = _core.observe_momentum(
        time, -time, np.zeros_like(time), gain=step * rate, exact=False
    )  # an external torque of 1 Nm
    return float((1.0 - seen[3]) / (1.0 - seen[2]))


def draw(rng: np.random.Generator) -> Mapping[str, float]:
    """Return the quantities of the paper's claims for one rig."""
    study = Study(zhang_rig(int(rng.integers(2**32))))
    return {
        "zhang.fig7.opposite_phase_cancels": sum_over_one(np.pi),
        "zhang.fig7.quarter_phase_cancels": sum_over_one(np.pi / 2.0),
        **_ripple(study),
        **_drift(study),
        **_calibration(study),
        **_arm(Arm(study.rig, study.model)),
        "zhang.observer.low_pass": low_pass_error(),
        "zhang.euler.dead_beat": dead_beat(),
    }


def sum_over_one(phase: float) -> float:
    """Amplitude of the sum of two signals this electrical phase apart, over that of one."""
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    both = np.sin(angle) + np.sin(angle - phase)
    return float(np.abs(np.fft.rfft(both)[1]) / np.abs(np.fft.rfft(np.sin(angle))[1]))


def _ripple(study: Study) -> dict[str, float]:
    common, _ = study.placements
    once = study.four_gauges.ripple()[1] / study.rig.sensor.common.ripple()[1]
    return {
        "zhang.fig15.peak_once_per_turn": peak_between(common, 8.0, 12.0),
        "zhang.fig15.peak_twice_per_turn": peak_between(common, 17.0, 23.0),
        "zhang.fig15.once_gone": study.amplitude_left(1),
        "zhang.fig15.twice_gone": study.amplitude_left(2),
        "zhang.bridge.two_places_cancel_once": once,
    }


def _drift(study: Study) -> dict[str, float]:
    return {
        "zhang.fig16.polynomial": study.polynomial_off,
        "zhang.fig17.before": float(np.abs(study.before).max()),
        "zhang.fig17.rises": study.risen,
        "zhang.fig17.after": float(np.abs(study.after).max()),
    }


def _calibration(study: Study) -> dict[str, float]:
    sensitivity, zero = (study.loading[name].value for name in ("sensitivity", "zero"))
    one_way = study.loading.figure("hysteresis").percent
    both = study.unloading.figure("hysteresis").percent
    bend = study.loading.figure("non-linearity, least squares").percent
    return {
        "zhang.fig18.sensitivity": 1e-3 * sensitivity,
        "zhang.fig18.zero": -1e3 * zero / sensitivity,
        "zhang.table3.nonlinearity": _known(bend),
        "zhang.table3.hysteresis": _known(both),
        "zhang.table3.hysteresis_one_way": float(one_way is not None),
    }


def _arm(arm: Arm) -> dict[str, float]:
    return {
        "zhang.fig20.no_contact_bound": arm.bound,
        "zhang.fig20.false_alarms": float(arm.false_alarms),
        "zhang.fig20.delay": max(hit.delay for hit in arm.hits),
        "zhang.fig20.stopping_helps": max(hit.stopped.peak / hit.free.peak for hit in arm.hits),
    }


def _known(percent: float | None) -> float:
    return float("nan") if percent is None else percent
