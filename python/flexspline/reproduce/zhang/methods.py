"""Ways to remove ripple, on one run of the first paper's joint that moves and then stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.baselines import compare_ripple_methods
from flexspline.baselines.table import RippleComparison
from flexspline.logs.log import Log
from flexspline.rigs.zhang import FINE, LATE, RATE, SERVO, SPEED, ZhangRig, facts
from flexspline.rigs.zhang_sensor import SENSITIVITY
from flexspline.sensor import Bridge
from flexspline.simulation import Trajectory

__all__ = ["ORDERS", "ripple_methods"]

Array = NDArray[np.float64]

ORDERS = (1, 2, 4)
ANGLES = ("output_position", "motor_position")
MOVING, STANDING = 12.0, 6.0  # s
LOAD = 2.0  # Nm, that swings with 0.1 Hz
CIRCUITS = (1.003, 0.997)  # gains of the two circuits of refs. 13 and 14: two resistors of 0.3 %


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
