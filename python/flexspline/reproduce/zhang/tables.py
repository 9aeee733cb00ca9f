"""Tables 1 to 3 of the first paper, and what the bound without contact is made of.

Ways to remove ripple are compared on one run of a joint that moves and then stands; models of the
drift (refs. 16 and 17 beside the paper's) on the runs of one bench.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.baselines import compare_drift_methods, compare_ripple_methods
from flexspline.baselines.ripple import RippleComparison
from flexspline.fitting import fit
from flexspline.least_squares.result import Fit
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.reproduce.zhang.study import Arm, Study
from flexspline.rigs.zhang import ARM, FINE, LATE, RATE, SERVO, SPEED, ZhangRig, facts
from flexspline.rigs.zhang_sensor import SENSITIVITY, THERMISTOR
from flexspline.sensor import Bridge
from flexspline.simulation import Trajectory

if TYPE_CHECKING:
    import pandas

__all__ = [
    "ORDERS",
    "drift_methods",
    "free_motion",
    "identified",
    "ripple_methods",
    "table1",
    "table2",
    "table3",
]

Array = NDArray[np.float64]

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
