"""The first paper, zhang_disturbance_elimination, done again on `flexspline.rigs.zhang_rig`.

One draw of the rig has the quantities of the paper's claims. Of the sensor: ripple of two
placements, drift, calibration. Of the arm: the observer in free motion and in collisions (§4.4).
From the same rig come the paper's figures and tables, and where its text errs.

Tables 1 to 3 are there with what the bound without contact is made of. Ways to remove ripple are
compared on one run of a joint that moves and then stands; models of the drift (refs. 16 and 17
beside the paper's) on the runs of one bench.

Figures 14 to 18 are the sensor's. Figure 20 is the arm's, with what the observer's gain costs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexspline import _core
from flexspline.baselines import (
    compare_drift_methods,
    compare_ripple_methods,
    wave_generator_angle,
)
from flexspline.baselines.ripple import RippleComparison
from flexspline.calibration import CalibrationResult, calibrate
from flexspline.estimation import estimate
from flexspline.fitting import fit
from flexspline.least_squares.result import Fit
from flexspline.logs.derive import differentiate, differentiate_causal
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.observer import observer_delay, observer_noise
from flexspline.plot.canvas import (
    GREY,
    INK,
    PALETTE,
    PlainFigure,
    axes_or_new,
    finished,
    legend,
    log_axis,
    titled,
)
from flexspline.plot.sensor import (
    bridge_orders,
    calibration_deviation,
    calibration_line,
    cancelling_phase,
    heating_curves,
    placement_ripple,
    voltage_drift,
)
from flexspline.reproduce import Story
from flexspline.rigs.zhang import (
    ARM,
    FINE,
    LATE,
    RATE,
    REST,
    SERVO,
    SPEED,
    Collision,
    ZhangRig,
    facts,
    zhang_rig,
)
from flexspline.rigs.zhang_sensor import (
    DRIFT,
    FULL_SCALE,
    SENSITIVITY,
    THERMISTOR,
    drift_voltage,
)
from flexspline.sensor import (
    Bridge,
    Tolerance,
    cancelling_bridge,
    common_bridge,
    heating_drift,
    placement_tolerance,
)
from flexspline.simulation import Trajectory

if TYPE_CHECKING:
    import pandas

__all__ = [
    "GAIN",
    "SPEEDS",
    "THRESHOLD",
    "Arm",
    "Hit",
    "Study",
    "amplitude",
    "collisions",
    "compensated",
    "dead_beat",
    "draw",
    "drift_curve",
    "drift_methods",
    "free_motion",
    "gains",
    "heating",
    "identified",
    "line",
    "low_pass_error",
    "panels",
    "peak_between",
    "phase",
    "placement",
    "ripple_methods",
    "spectrum",
    "story",
    "sum_over_one",
    "table1",
    "table2",
    "table3",
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


@dataclass(frozen=True, eq=False)
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


CAPTIONS = {
    "fig7": 'The text\'s "phase difference of π/2" stands against π in its own (3): π cancels, '
    "π/2 leaves √2. π/2 is the angle between the spokes, which order 2 makes π. (1) has the same "
    "ε_w in both gauges, by which the sinusoid of (2) would vanish: what (2) needs is bending, of "
    "opposite sign on both flanks of a spoke.",
    "fig14": "Two seconds of 20: the common placement waves, the cancelling one is at the step of "
    "the converter, 0.076 mV.",
    "fig15": "Peaks once and twice per turn of the wave generator against the flexspline, where "
    "the gauges sit: 35.16 °/s · 101/360 = 9.86 Hz. 101 is inferred from N = 100, which is not "
    "printed; the printed 9.89 and 19.76 Hz imply 101.26 and 101.16. Gone with eight gauges. "
    "The text derives the second order only; R1 to R4 at 0° and 90° leave 0.71 of the first. What "
    "stays is order 4, at 39.5 Hz.",
    "fig16": "Our b(T) with its 95 % band on (24). (24) is a voltage, that of (11); b of (9) is a "
    "torque. It falls to a minimum at 42.7 °C.",
    "fig17": "A warming that the fit never saw. (24) falls by 0.33 Nm, where the text says that "
    "the reading rises by up to 0.38 Nm: the sign does not follow from (24).",
    "fig18": "Left the protocol as printed: 2 °/s one way, called dynamic although the speed is "
    'constant. −2.1835/62.738 V = −34.8 mV is the zero of the line, not a "temperature drift". '
    "Right: only with the way back does hysteresis show.",
    "fig20": "(a) What the threshold has to stay above; the level is order 4 in a zero that was "
    "set at rest, see free_motion. (b) The residual passes it in the first samples after the "
    "touch. (c) Force with and without the stop. The egg's strength is not printed.",
    "placement": "How exactly must gauges be bonded? Placement errors bring orders 1 and 2 back in "
    "proportion; order 4 stays whatever the care.",
    "heating": "The bridge cancels what its gauges have in common, software what one temperature "
    "tells: heated unevenly, both together leave least.",
    "gain": "K_O = 100 1/s at 100 Hz makes forward Euler dead-beat: all noise of the newest torque "
    "passes. At K·dt = 2 it rings for ever. The exact form has no such limit.",
    "table1": "As printed: inputs of their finite elements, which nothing here can reproduce. The "
    'text\'s largest "strain of 0.003 mm" has no meaning: a strain has no unit.',
    "table2": "The printed parameters, and our fit of (23) to swings without contact on this rig, "
    "whose truth is known.",
    "table3": "The figures are what the simulated sensor was given; that they come back says that "
    "they are read correctly. One way there is no hysteresis to read. Percent of 70 Nm is our "
    "reading.",
    "ripple_methods": "Ripple left of the common placement's, delay and cost, in motion and at "
    "standstill [Nm, s]. Order tracking sees no torque at standstill and is late in motion. Filter "
    "and regression hold at standstill what they learnt in motion, and take off order 4, which "
    "placement leaves; placement needs neither angle nor learning.",
    "drift_methods": "What each model of the drift leaves of a warming that it never saw (refs. 16 "
    "and 17 beside the paper's), all from the same runs of brake and oven. A line misses the bend "
    "of (24); a kernel has no law between the levels of the oven, and none beyond them.",
    "free_motion": "Order 4, which no placement at quarter turns cancels, and a zero set on top of "
    "it make most of what the observer reads without contact. The printed bound says that theirs "
    "was small; a fit of the ripple takes most of it off. (23) has neither ripple nor friction "
    "beyond the sensor.",
}

BLUE, ORANGE, GREEN, RED = PALETTE[:4]
SHOWN = 2.0  # s

GAINS = (10.0, 20.0, 50.0, 100.0, 150.0, 190.0)  # 1/s
AROUND = (-0.1, 0.2)  # s about the touch

RIPPLE = "wave_generator_ripple"
BANDWIDTH = 5.0  # Hz, of torque, speed and acceleration that identify the arm

ORDERS = (1, 2, 4)
ANGLES = ("output_position", "motor_position")
MOVING, STANDING = 12.0, 6.0  # s
LOAD = 2.0  # Nm, that swings with 0.1 Hz
CIRCUITS = (1.003, 0.997)  # gains of the two circuits of refs. 13 and 14: two resistors of 0.3 %

EVERY = slice(0, None, 10)  # neighbours say the same, and a kernel takes its time


def table1() -> pandas.DataFrame:
    """Spokes and slits as printed: inputs of their finite elements."""
    import pandas

    return pandas.DataFrame(
        {"length [mm]": [10.0, 8.0], "width [mm]": [12.0, 1.6], "height [mm]": [6.0, 6.0]},
        index=["spoke", "slit"],
    )


def identified(arm: Arm) -> Fit:
    """Fit (23) and an offset to the swings without contact, rows and torque filtered alike."""
    _, torque = arm.state(arm.swings)
    log = arm.swings.with_columns({"sensor_torque": torque}, note="by the calibrated sensor")
    return fit(
        ["inertia", "gravity", "offset"],
        differentiate(log, bandwidth=4.0 * BANDWIDTH),
        "sensor_torque",
        lowpass=BANDWIDTH,
        checks=False,
    )


def table2(arm: Arm) -> pandas.DataFrame:
    """Arm: published, our fit of (23), and the truth of this rig."""
    import pandas

    found = {p.name: p for p in identified(arm).parameters}
    truth = arm.rig.joint.output
    rows = {}
    for label, name, printed, true in (
        ("ml² + J [kg m²]", "inertia", ARM[0], truth.inertia),
        ("mgl [Nm]", "gravity.sine", ARM[1], truth.gravity),
    ):
        parameter = found[next(key for key in found if key.startswith(name))]
        rows[label] = {
            "published": printed,
            "ours": parameter.value,
            "standard error": parameter.standard_error,
            "true in this rig": true,
        }
    return pandas.DataFrame.from_dict(rows, orient="index")


def table3(study: Study) -> pandas.DataFrame:
    """Sensor: published beside ours."""
    import pandas

    load, both = study.loading, study.unloading
    sensitivity, zero = load["sensitivity"], load["zero"]
    least = "non-linearity, least squares"
    rows = {
        "sensitivity [Nm/mV]": (0.0627, 1e-3 * sensitivity.value),
        "zero [mV]": (-34.8, -1e3 * zero.value / sensitivity.value),
        "non-linearity, least squares, one way [%FS]": (0.878, load.figure(least).percent),
        "non-linearity, best line, one way [%FS]": (None, load.figure("non-linearity").percent),
        "non-linearity, least squares, both ways [%FS]": (None, both.figure(least).percent),
        "hysteresis, one way [%FS]": (0.903, load.figure("hysteresis").percent),
        "hysteresis, both ways [%FS]": (0.903, both.figure("hysteresis").percent),
        "sensing range [Nm]": (70.0, None),
        "height [mm]": (10.0, None),
        "diameter [mm]": (86.0, None),
        "weight [g]": (60.6, None),
    }
    return pandas.DataFrame.from_dict(
        rows, orient="index", columns=["published", "ours"], dtype=float
    )


def free_motion(arm: Arm) -> pandas.DataFrame:
    """What the largest |r| of two minutes without contact is made of, Nm.

    The angle of the ripple that is fitted is that of the reading, which the converter delays.
    """
    import pandas

    log, truth = arm.swings, arm.rig.joint.output
    _, torque = arm.state(log)
    known = torque - ARM[1] * np.sin(log["output_position"])
    waves = arm.rig.sensor.cancelling.waves
    sensor = arm.rig.sensor
    without = replace(
        sensor, cancelling=sensor.cancelling.with_waves(*(w for w in waves if w.order < 4))
    )
    rows = {
        "as printed: Table 2, zero at rest": arm.bound,
        "the same, forward Euler": replace(arm, exact=False).bound,
        "zero in motion": _bound(arm, ARM[0], known - known.mean()),
        "the same, arm known exactly": _bound(
            arm,
            truth.inertia,
            torque - torque.mean() - truth.gravity * np.sin(log["output_position"]),
        ),
        "zero in motion, orders 1, 2, 4 fitted and taken off": _bound(
            arm, ARM[0], known - _rippling(log, known)
        ),
        "zero at rest, a wave generator without order 4": Arm(
            replace(arm.rig, sensor=without), arm.model
        ).bound,
        "published": 0.0255,
    }
    return pandas.DataFrame.from_dict(rows, orient="index", columns=["largest |r| [Nm]"])


def _bound(arm: Arm, inertia: float, known: Array) -> float:
    """Largest |r| [Nm] with this inertia [kg m²] and known torque [Nm]."""
    speed, _ = arm.state(arm.swings)
    seen = _core.observe_momentum(
        arm.swings["time"], inertia * speed, known, gain=arm.gain, exact=arm.exact
    )
    return float(np.abs(seen[np.isfinite(arm.free_residual)]).max())


def _rippling(log: Log, torque: Array) -> Array:
    """Offset and ripple that a fit finds in the torque beside inertia [Nm], (N,)."""
    late = np.interp(log["time"] - LATE, log["time"], log["motor_position"])
    columns = {"motor_position": late, "sensor_torque": torque}
    seen = differentiate(log.with_columns(columns, note="angle of the reading"), bandwidth=20.0)
    made = fit(
        ["inertia", "offset", RIPPLE], seen, "sensor_torque", orders={RIPPLE: (1, 2, 4)},
        checks=False,
    )  # fmt: skip
    parts = made.model.components(seen)
    return np.asarray(parts["offset"] + parts[RIPPLE])


def ripple_methods(rig: ZhangRig) -> RippleComparison:
    """Return what each way leaves of the common placement's ripple, in motion and at rest.

    The truth is the reading of a bridge without ripple through the same converter, so that what
    the converter delays counts for no method.
    """
    trained = _run(rig, MOVING + STANDING, 0.0, 1)
    run = _run(rig, MOVING, LOAD, 2)
    built = rig.sensor.cancelling
    halves = [replace(built, gauges=built.gauges[k : k + 2] + built.gauges[k + 4 : k + 6])
              for k in (0, 2)]  # fmt: skip
    first, second = (
        gain * _torque(rig, run, half, 4 + k)
        for k, (gain, half) in enumerate(zip(CIRCUITS, halves, strict=True))
    )
    return compare_ripple_methods(
        _log(rig, run, 3),
        _log(rig, trained, 6),
        truth=_torque(rig, run, built.with_waves(), 7),
        orders=ORDERS,
        cancelling=_torque(rig, run, built, 8),
        two_bridges=(first, second),
        at_rest=(run.time > MOVING + 0.2)[:: _every()],
    )


def _run(rig: ZhangRig, moving: float, load: float, seed: int) -> Trajectory:
    """35.16 °/s until `moving` [s], then standstill, under a load that swings [Nm]."""
    time = np.arange(round((MOVING + STANDING) * FINE)) / FINE
    speed = np.where(time < moving, SPEED, 0.0)
    joint = replace(rig.joint, output=replace(rig.joint.output, gravity=0.0))
    return joint.simulate(
        time,
        servo=SERVO,
        position_command=SPEED * np.minimum(time, moving),
        velocity_command=speed,
        load_torque=load * np.sin(2.0 * np.pi * 0.1 * time + seed),
    )


def _every() -> int:
    return round(FINE / RATE)


def _torque(rig: ZhangRig, run: Trajectory, bridge: Bridge, number: int) -> Array:
    """Reading of a bridge [Nm], zero without load, at 100 Hz; each has its own noise."""
    rng = np.random.default_rng([rig.seed, 20, number])
    own = replace(bridge, strain_per_torque=bridge.strain_per_torque / bridge.torque_gain)
    still = own.with_thermal(0.0)
    voltage = still.voltage(run.wave_generator_on_flexspline, run["transmitted_torque"])
    read = rig.sensor.read(bridge, run.time, voltage, _every(), rng)
    return SENSITIVITY * (read - rig.sensor.electronics.offset)


def _log(rig: ZhangRig, run: Trajectory, number: int) -> Log:
    """The common placement's reading with the angles at the time that it is of.

    Without this order 2 would be 1.1 rad late at 35.16 °/s and not at standstill.
    """
    time = run.time[:: _every()]
    angles = {name: np.interp(time - LATE, run.time, run[name]) for name in ANGLES}
    columns = {
        "time": time,
        **angles,
        "sensor_torque": _torque(rig, run, rig.sensor.common, number),
    }
    return Log(columns, facts("common placement"), ("simulated by flexspline.simulation",))


def drift_methods(study: Study) -> pandas.DataFrame:
    """Return what each model of the drift leaves of the warming that no fit saw.

    All learn from the same two runs, brake and oven. The polynomial is fitted together with the
    line here, as the others are; the paper fits it after the line.
    """
    bench = study.rig.bench
    brake, oven = bench.calibration(unloading=True), bench.oven()
    return compare_drift_methods([_warm(brake), _warm(oven)], _warm(study.held_out))


def _warm(log: Log) -> Log:
    """Every tenth row, with the temperature [°C] by the thermistor; without load where none is."""
    thin = log.rows(EVERY, note="every tenth row")
    columns = {
        "temperature": _core.thermistor_temperature(thin["thermistor_voltage"], **THERMISTOR)
    }
    if "reference_torque" not in log:
        columns["reference_torque"] = np.zeros(len(thin))
    return thin.with_columns(columns, note="temperature by the thermistor")


def story(seed: int) -> Story:
    """Return figures and tables of one rig."""
    study = Study(zhang_rig(seed))
    arm = Arm(study.rig, study.model)
    figures = {
        "fig7": phase(),
        "fig14": ripple_over_time(study),
        "fig15": ripple_spectrum(study),
        "fig16": drift_curve(study),
        "fig17": compensated(study),
        "fig18": line(study),
        "fig20": collisions(arm),
        "placement": placement(),
        "heating": heating(),
        "gain": gains(arm),
    }
    tables = {
        "table1": table1(),
        "table2": table2(arm),
        "table3": table3(study),
        "ripple_methods": ripple_methods(study.rig).to_frame(),
        "drift_methods": drift_methods(study),
        "free_motion": free_motion(arm),
    }
    return Story(figures, tables, CAPTIONS)


def panels(count: int, width: float = 5.4, height: float = 3.6) -> tuple[PlainFigure, list[Axes]]:
    """Return a figure with so many axes beside each other."""
    figure = PlainFigure(width * count, height)
    return figure, [axes_or_new(figure.add_subplot(1, count, k + 1)) for k in range(count)]


def phase() -> PlainFigure:
    """Figure 7: two gauges and their sum, over the electrical phase."""
    figure = cancelling_phase()
    assert isinstance(figure, PlainFigure)
    return figure


def ripple_over_time(study: Study) -> PlainFigure:
    """Figure 14: voltage of both placements at 35.16 °/s, without its mean."""
    figure, axes = panels(2)
    for ax, log, name, colour in zip(
        axes, study.placements, ("a  common", "b  cancelling"), (ORANGE, BLUE), strict=True
    ):
        time = log["time"] - log["time"][0]
        first = time < SHOWN
        voltage = log["sensor_voltage"] - log["sensor_voltage"].mean()
        ax.plot(time[first], 1e3 * voltage[first], color=colour)
        _with_torque(ax)
        ax.set(xlabel="time [s]", ylabel="voltage less its mean [mV]")
        titled(ax, f"{name} placement, 35.16 °/s")
    axes[1].set_ylim(*axes[0].get_ylim())
    return figure


def ripple_spectrum(study: Study) -> PlainFigure:
    """Figure 15: spectra of both placements."""
    figure, axes = panels(2)
    for ax, log, name, colour in zip(
        axes, study.placements, ("a  common", "b  cancelling"), (ORANGE, BLUE), strict=True
    ):
        hertz, size = spectrum(log)
        ax.plot(hertz, np.maximum(1e3 * size, 1e-5), color=colour, linewidth=0.9)
        for at in (9.89, 19.76):
            ax.axvline(at, color=GREY, linestyle="--", linewidth=0.9)
        ax.set(xlabel="frequency [Hz]", ylabel="amplitude [mV]", ylim=(1e-3, 30.0))
        log_axis(ax, "y")
        titled(ax, f"{name} placement; dashed: 9.89 and 19.76 Hz")
    return figure


def drift_curve(study: Study) -> PlainFigure:
    """Figure 16: voltage over temperature, our b(T) and (24)."""
    figure, (ax,) = panels(1, 6.4)
    voltage_drift(study.drift, ax)
    grid = np.linspace(20.0, 45.0, 100)
    ax.plot(grid, 1e3 * drift_voltage(grid), "--", color=GREEN, label="(24)")
    lowest = float(grid[np.argmin(drift_voltage(grid))])
    ax.axvline(lowest, color=GREY, linewidth=0.8, linestyle=":", label=f"minimum, {lowest:.1f} °C")
    legend(ax)
    return figure


def compensated(study: Study) -> PlainFigure:
    """Figure 17: a warming that the fit never saw, before and after."""
    figure, axes = panels(2)
    warmth = study.model.estimators["thermistor"]
    temperature = _core.thermistor_temperature(
        study.held_out["thermistor_voltage"], **warmth.to_json()
    )
    minutes = study.held_out["time"] / 60.0
    for ax, x, label in zip(axes, (temperature, minutes), ("temperature [°C]", "time [min]"),
                            strict=True):  # fmt: skip
        for values, colour, name in (
            (study.before, ORANGE, "before"),
            (study.after, BLUE, "after"),
        ):
            ax.plot(x, values, ".", markersize=1.2, color=colour)
            ax.plot([], [], "o", markersize=4, color=colour, label=name)
        ax.axhline(0.0, color=INK, linewidth=0.8)
        for bound in (-0.08, 0.08):
            ax.axhline(bound, color=GREY, linestyle="--", linewidth=0.9)
        ax.axhline(0.38, color=RED, linestyle=":", linewidth=1.0)
        ax.set(xlabel=label, ylabel="reading without load [Nm]")
        legend(ax)
    titled(axes[0], "Over temperature; dashed: published ±0.08 Nm after")
    titled(axes[1], "Over time; dotted: published 0.38 Nm, which (24) turns round")
    return figure


def line(study: Study) -> PlainFigure:
    """Figure 18: the line of §4.3, and what is beside it with the way back."""
    figure, axes = panels(2)
    calibration_line(study.loading, axes[0])
    titled(axes[0], "0 to 70 Nm one way, as printed: τ = 62.738 V + 2.1835")
    calibration_deviation(study.unloading, axes[1])
    titled(axes[1], "Beside the line, with the way back")
    return figure


def placement() -> PlainFigure:
    """Ours: what each placement lets through, and what bonding tolerances leave."""
    figure, axes = panels(2, height=4.0)
    bridges = {
        "common, 4 gauges": common_bridge(),
        "0° and 90°, 4 gauges": cancelling_bridge(4),
        "all eight": cancelling_bridge(8),
    }
    bridge_orders(bridges, axes[0])
    limits = Tolerance(angle=np.radians(1.0), tilt=np.radians(2.0), factor=0.01)
    placement_ripple(placement_tolerance(cancelling_bridge(8), limits), axes[1])
    return figure


def heating() -> PlainFigure:
    """Ours: drift with the bridge alone, with software alone and with both."""
    figure, axes = panels(2)
    drift = heating_drift(cancelling_bridge(8))
    heating_curves(drift, axes[0], uneven=False)
    heating_curves(drift, axes[1], uneven=True)
    return figure


def _with_torque(ax: Axes) -> None:
    """A second axis in Nm by (25)."""
    beside = ax.secondary_yaxis(
        "right",
        functions=(
            lambda y: np.asarray(y) * SENSITIVITY / 1e3,
            lambda y: np.asarray(y) / SENSITIVITY * 1e3,
        ),
    )
    beside.set_ylabel("[Nm]", fontsize=9.5, color=INK)
    beside.tick_params(labelsize=8.5, colors=INK)


def collisions(arm: Arm) -> PlainFigure:
    """Figure 20: the residual without contact, at a collision, and the force of the contact."""
    figure, (a, b, c) = panels(3, 4.0)
    time = arm.swings["time"]
    a.plot(time, 1e3 * arm.free_residual, color=BLUE, linewidth=0.6)
    for bound, style, name in (
        (THRESHOLD, "-", "threshold 0.03"),
        (0.0255, ":", "printed bound 0.0255"),
    ):
        a.axhline(1e3 * bound, color=RED, linestyle=style, linewidth=1.0, label=f"{name} Nm")
        a.axhline(-1e3 * bound, color=RED, linestyle=style, linewidth=1.0)
    low, high = a.get_ylim()
    a.set(xlabel="time [s]", ylabel="external torque [mNm]", ylim=(low, high + 0.3 * (high - low)))
    finished(a, "a  two minutes without contact")
    for hit, colour in zip(arm.hits, (BLUE, ORANGE, GREEN), strict=True):
        _near(b, hit, hit.residual, hit.free.log["time"], colour, _speed(hit))
        b.axvline(1e3 * hit.delay, color=colour, linestyle="--", linewidth=0.9)
        _force(c, hit, colour)
    b.set_yscale("symlog", linthresh=0.1)
    b.axhline(THRESHOLD, color=RED, linewidth=1.0)
    b.axhline(-THRESHOLD, color=RED, linewidth=1.0)
    b.set(xlabel="time since the touch [ms]", ylabel="external torque [Nm]")
    finished(b, "b  collisions; dashed: the flag")
    c.set(xlabel="time since the touch [ms]", ylabel="|torque on the obstacle| [Nm]")
    finished(c, "c  contact with the stop (full) and without (dotted)")
    return figure


def _speed(hit: Hit) -> str:
    return f"{hit.speed:+.0f} °/s".replace("-", "−")


def _near(
    ax: Axes, hit: Hit, values: np.ndarray, time: np.ndarray, colour: str, label: str
) -> None:
    since = time - hit.free.touched
    near = (since > AROUND[0]) & (since < AROUND[1])
    ax.plot(1e3 * since[near], values[near], ".-", markersize=3, color=colour, label=label)


def _force(ax: Axes, hit: Hit, colour: str) -> None:
    for run, style, label in (
        (hit.stopped, "-", f"{_speed(hit)}, {hit.stopped.peak:.1f} Nm"),
        (hit.free, ":", f"no stop, {hit.free.peak:.0f} Nm"),
    ):
        since = run.trajectory.time - hit.free.touched
        near = (since > AROUND[0]) & (since < AROUND[1])
        torque = np.abs(run.trajectory["contact_torque"][near])
        ax.plot(1e3 * since[near], torque, style, color=colour, label=label)


def gains(arm: Arm) -> PlainFigure:
    """Ours: delay and noise over the gain, exact and Euler, and the step responses."""
    figure, (a, b, c) = panels(3, 4.0)
    gain = np.geomspace(5.0, 199.0, 200)
    for kind, colour in (("exact", BLUE), ("euler", ORANGE)):
        a.plot(gain, 1e3 * observer_delay(gain, 1.0 / RATE, kind), color=colour, label=kind)
        noise = observer_noise(gain, 1.0 / RATE, kind, torque_noise=1.0)
        b.plot(gain, noise, color=colour, label=f"{kind}, white torque noise")
        c.plot(*_step(100.0, kind == "exact"), "o-", color=colour, label=f"{kind}, K = 100 1/s")
    c.plot(*_step(190.0, False), ".-", color=RED, label="euler, K = 190 1/s", linewidth=0.9)
    found = [_spread(replace(arm, gain=k)) for k in GAINS]
    b.plot(GAINS, np.array(found) / found[GAINS.index(GAIN)] * float(
        observer_noise(GAIN, 1.0 / RATE, "exact", torque_noise=1.0)),
        "s", color=GREEN, label="exact on the rig's swings, scaled at 100 1/s")  # fmt: skip
    for ax in (a, b):
        ax.axvline(GAIN, color=GREY, linestyle="--", linewidth=0.9)
        log_axis(ax, "x")
        ax.set_xlabel("gain K [1/s]")
    a.set_ylabel("delay [ms]")
    b.set_ylabel("noise of the estimate [of the torque's]")
    b.set_ylim(0.0, 3.0)
    c.axhline(1.0, color=INK, linewidth=0.8)
    c.set(xlabel="time since a step of torque [ms]", ylabel="estimate [of the step]")
    titled(a, "a  delay at 100 Hz; dashed: printed gain")
    titled(b, "b  noise; Euler's is that of the torque at K·dt = 1")
    titled(c, "c  step: Euler is dead-beat at 100, rings at 190")
    for ax in (a, b, c):
        legend(ax)
    return figure


def _step(gain: float, exact: bool) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(16) / RATE
    return 1e3 * time, _core.observe_momentum(
        time, -time, np.zeros_like(time), gain=gain, exact=exact
    )


def _spread(arm: Arm) -> float:
    """Standard deviation of the residual without contact, Nm."""
    return float(np.nanstd(arm.free_residual))
