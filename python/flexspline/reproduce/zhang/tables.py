"""Tables 1 to 3 of the first paper, and what the bound without contact is made of."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.fitting import fit
from flexspline.least_squares.result import Fit
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.reproduce.zhang.arm import Arm
from flexspline.reproduce.zhang.study import Study
from flexspline.rigs.zhang import ARM, LATE

if TYPE_CHECKING:
    import pandas

__all__ = ["free_motion", "identified", "table1", "table2", "table3"]

Array = NDArray[np.float64]

RIPPLE = "wave_generator_ripple"
BANDWIDTH = 5.0  # Hz, of torque, speed and acceleration that identify the arm


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
