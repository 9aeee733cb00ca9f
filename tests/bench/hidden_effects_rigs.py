"""Runs that hide effects, made by numpy alone, in forms that differ from the catalogue's.

The base has another smoothing of the change of direction (arctangent), a Stribeck friction fades
with another exponent, loops are Bouc-Wen's, temperature laws exponential. Unknown causes depend
on measured channels in a way that no effect of the catalogue has.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
Channels = dict[str, Array]
Form = Callable[[Channels], Array]

RATE, SECONDS, RUNS = 200.0, 20.0, 5
RATIO = 101.0
FACTS = {"gear_ratio": 100.0, "output_spline": "circular", "pole_pairs": 7}
LOAD = "reference_torque"
WIDTH = 0.03


@dataclass(frozen=True)
class Setting:
    """How runs are excited and how noisy they are: `memory` of AR(1) noise, its size in Nm."""

    rich: bool
    memory: float
    size: float


def channels(seed: int, number: int, setting: Setting) -> Channels:
    """Motion, load and temperatures of one run, each at its own pace; poor: all tied together."""
    generator = np.random.default_rng([seed, number, 5])
    time = np.arange(round(RATE * SECONDS)) / RATE
    velocity = np.zeros(len(time))
    acceleration, position = np.zeros((2, len(time)))
    for frequency, share in ((0.13, 1.0), (0.083, 0.6), (0.37, 0.35)):
        omega = 2 * np.pi * frequency * generator.uniform(0.85, 1.15)
        phase, size = generator.uniform(0, 2 * np.pi), share * generator.uniform(1.0, 2.2)
        position += size / omega * np.sin(omega * time + phase)
        velocity += size * np.cos(omega * time + phase)
        acceleration -= size * omega * np.sin(omega * time + phase)
    shift = generator.uniform(0, 2 * np.pi, 6)
    level, swing = generator.uniform(18, 36), generator.uniform(2, 10)
    made = {
        "time": time,
        "output_position": position + generator.uniform(-2, 2),
        "output_velocity": velocity,
        "output_acceleration": acceleration,
        "temperature": level
        + swing * -np.expm1(-time / generator.uniform(6, 20))
        + np.sin(0.4 * time + shift[4]),
        "motor_torque": 0.2 * np.sin(1.1 * time + shift[3]) + 0.1 * np.sin(4.3 * time + shift[5]),
    }
    free = 5 * np.sin(0.7 * time + shift[0]) + 3 * np.sin(2.9 * time + shift[1])
    tied = 6 * np.sin(made["output_position"] - 0.4)
    made[LOAD] = free + 1.5 * np.sin(9.7 * time + shift[2]) if setting.rich else tied
    made["motor_torque"] += made[LOAD] / RATIO
    return made


def direction(c: Channels, width: float = WIDTH) -> Array:
    """The change of direction by an arctangent, where the catalogue has a hyperbolic tangent."""
    return np.asarray(2 / np.pi * np.arctan(c["output_velocity"] / width * np.pi / 2))


def base_torque(c: Channels) -> Array:
    """Offset, Coulomb and viscous friction, inertia."""
    return np.asarray(
        -0.12
        + 0.3 * np.tanh(c["output_velocity"] / WIDTH)
        + 0.15 * c["output_velocity"]
        + 0.02 * c["output_acceleration"]
    )


def noise(seed: int, number: int, setting: Setting, rows: int) -> Array:
    """AR(1), in its steady state from the first row."""
    white = np.random.default_rng([seed, number, 11]).normal(size=rows + 400)
    coloured = lfilter([1.0], [1.0, -setting.memory], white)[400:]
    return np.asarray(setting.size * np.sqrt(1 - setting.memory**2) * coloured)


def bouc_wen(path: Array, width: float) -> Array:
    """z' = (u' − (|u'| z + u' |z|) / 2) / width, by Euler's rule with small steps."""
    z, made = 0.0, []
    for step in np.diff(path, prepend=path[0]):
        for _ in range(4):
            z += (0.25 * step - 0.5 * (abs(0.25 * step) * z + 0.25 * step * abs(z))) / width
        made.append(z)
    return np.array(made)


def lagged(values: Array, seconds: float) -> Array:
    share = 1.0 - np.exp(-1.0 / (RATE * seconds))
    start = [(1.0 - share) * values[0]]
    return np.asarray(lfilter([share], [1.0, share - 1.0], values, zi=start)[0])


def _stribeck(c: Channels) -> Array:
    return np.asarray(direction(c) * np.exp(-np.abs(c["output_velocity"]) / 0.15))


def _bent(c: Channels) -> Array:
    v = c["output_velocity"]
    return np.asarray(np.sign(v) * np.abs(v) ** 2.5)


def _loaded(c: Channels) -> Array:
    return np.asarray(direction(c) * np.abs(c[LOAD]) ** 1.15)


def _by_temperature(c: Channels) -> Array:
    return np.asarray(c["output_velocity"] * np.expm1(-0.04 * (c["temperature"] - 25.0)))


def _by_position(c: Channels) -> Array:
    q = c["output_position"]
    return np.asarray(direction(c) * (np.cos(q - 0.4) + 0.5 * np.abs(np.sin(q + 1.0))))


def _presliding(c: Channels) -> Array:
    return bouc_wen(c["output_position"], 0.02) - direction(c)


def _gravity(c: Channels) -> Array:
    return np.asarray(np.sin(c["output_position"] - 0.3))


def _output_ripple(c: Channels) -> Array:
    q = c["output_position"]
    return np.asarray(np.cos(2 * q + 0.5) + 0.5 * np.cos(3 * q))


def _wave_ripple(c: Channels) -> Array:
    theta = RATIO * c["output_position"]
    return np.asarray(np.cos(2 * theta + 0.5) + 0.4 * np.cos(4 * theta))


def _cogging(c: Channels) -> Array:
    return np.asarray(np.cos(14 * RATIO * c["output_position"] + 0.5))


def _drift(c: Channels) -> Array:
    return np.asarray(np.expm1(0.03 * (c["temperature"] - 25.0)))


def _gradient(c: Channels) -> Array:
    return c["temperature"] - lagged(lagged(c["temperature"], 1.5), 1.5)


def _creep(c: Channels) -> Array:
    return np.asarray(-np.expm1(-c["time"] / 25.0))


def _gain(c: Channels) -> Array:
    return np.asarray(c[LOAD] * (1.0 + 0.004 * np.abs(c[LOAD])))


def _warm_gain(c: Channels) -> Array:
    return np.asarray(c[LOAD] * np.expm1(0.02 * (c["temperature"] - 25.0)))


def _nonlinear(c: Channels) -> Array:
    return np.asarray(np.cosh(0.2 * c[LOAD]) - 1 + 0.3 * np.sinh(0.3 * c[LOAD]) - 0.09 * c[LOAD])


def _hysteresis(c: Channels) -> Array:
    return bouc_wen(c[LOAD], 2.0)


def _crosstalk(c: Channels) -> Array:
    return np.asarray(c["motor_torque"] * (1.0 + 0.1 * np.abs(c["motor_torque"])))


def _late(c: Channels) -> Array:
    return lagged(lagged(c[LOAD], 0.01), 0.005) - c[LOAD]


def _spring(load: Array, shape: float) -> Array:
    """A stiffening spring by a power law's saturation, where the catalogue has an arctangent."""
    return np.asarray(np.tanh(shape * load) / shape)


def torsion(c: Channels) -> Array:
    """Mesh compliance of about 26 kNm/rad at the output, and a constant: at the motor, rad."""
    return np.asarray(0.02 - RATIO / 26431.0 * np.arctan(0.0487 * c[LOAD]) / 0.0487)


SENSOR: Mapping[str, Form] = {
    "stribeck_friction": _stribeck,
    "nonlinear_viscous_friction": _bent,
    "load_dependent_friction": _loaded,
    "temperature_dependent_friction": _by_temperature,
    "position_dependent_friction": _by_position,
    "presliding_friction": _presliding,
    "gravity": _gravity,
    "output_ripple": _output_ripple,
    "wave_generator_ripple": _wave_ripple,
    "cogging": _cogging,
    "temperature_drift": _drift,
    "thermal_gradient_drift": _gradient,
    "time_drift": _creep,
    "gain_error": _gain,
    "gain_temperature_dependence": _warm_gain,
    "sensor_nonlinearity": _nonlinear,
    "torque_hysteresis": _hysteresis,
    "motor_crosstalk": _crosstalk,
    "sensor_lag": _late,
}

NO_DRIVE = ("temperature_drift", "thermal_gradient_drift", "time_drift", "gain_error", "gravity",
            "gain_temperature_dependence", "sensor_nonlinearity", "torque_hysteresis",
            "motor_crosstalk", "sensor_lag")  # fmt: skip
DRIVE: Mapping[str, Form] = {
    **{name: form for name, form in SENSOR.items() if name not in NO_DRIVE},
    "gravity": _gravity,
    "torque_constant_error": _gain,
}

TORSION: Mapping[str, Form] = {
    "wave_generator_compliance": lambda c: -_spring(c["motor_torque"], 4.0),
    "kinematic_error": lambda c: _output_ripple(c) + 0.7 * _wave_ripple(c),
    "torsional_hysteresis": lambda c: -bouc_wen(c[LOAD], 2.0),
    "backlash": lambda c: -2 / np.pi * np.arctan(3.0 * c[LOAD]),
    "temperature_dependent_stiffness": lambda c: (
        -np.arctan(0.0487 * c[LOAD]) * np.expm1(0.01 * (c["temperature"] - 25.0))
    ),
    "temperature_drift": _drift,
    "time_drift": _creep,
}

FORMS = {"sensor_torque": SENSOR, "motor_torque": DRIVE, "torsion": TORSION}
FRICTION = ("offset", "coulomb_friction", "viscous_friction", "inertia")
BASES = {
    "sensor_torque": FRICTION,
    "motor_torque": FRICTION,
    "torsion": ("offset", "mesh_compliance"),
}

UNKNOWN: Mapping[str, Form] = {
    "power": lambda c: c[LOAD] * c["output_velocity"],
    "load times angle": lambda c: c[LOAD] * np.cos(c["output_position"]),
    "even in speed": lambda c: np.exp(-((np.abs(c["output_velocity"]) - 0.5) ** 2) / 0.02),
    "a bump at an angle": lambda c: np.exp(-((c["output_position"] - 0.4) ** 2) / 0.01),
    "a step in temperature": lambda c: np.tanh((c["temperature"] - 29.0) / 0.5),
    "waves in temperature times angle": lambda c: (
        np.sin(0.5 * c["temperature"]) * np.sin(c["output_position"])
    ),
    "acceleration times angle": lambda c: c["output_acceleration"] * np.sin(c["output_position"]),
    "waves in load": lambda c: np.sin(2.0 * c[LOAD]),
}
