"""Every effect of the catalogue in another form than the catalogue's, for three targets.

Other exponents (load^1.15, |v|^2.4), other bends (algebraic against tanh, tanh against arctan),
Bouc and Wen's loop against springs that slip, exponential against polynomial temperature laws,
teeth with edges against plain sines. A form is sized by the case; its own scale is free.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hidden.rig import Array, Scene
from hidden.shapes import bouc_wen, lagged, passing

__all__ = ["FORMS", "RIPPLE", "Form"]

Form = Callable[[Scene], Array]

RIPPLE = (2, "wave_generator_on_flexspline")
"""Order and pair that the base has where a resonance of it is hidden."""


def _resonant(s: Scene) -> Array:
    """What a resonance adds to ripple whose damping grows with the speed: ζ = 0.25 |ρ|^0.4."""
    rho = 2.0 * s.v / 0.9
    gain = 1.0 / (1.0 - rho**2 + 0.5j * rho * np.abs(rho) ** 0.4)
    return np.asarray(np.real((gain - 1.0) * np.exp(1j * (2.0 * _flexspline(s) + 0.4))))


def _flexspline(s: Scene) -> Array:
    return s.theta if s.joint.output_spline == "circular" else s.beta


def _teeth(angle: Array, edge: float) -> Array:
    """A wave with edges: Σ I_k(edge) cos kα, less its mean."""
    return np.asarray((np.exp(edge * np.cos(angle)) - np.i0(edge)) / edge)


def _warm(s: Scene, rate: float) -> Array:
    return np.asarray(np.expm1(rate * (s.temperature - 25.0)) / rate)


FRICTION: Mapping[str, Form] = {
    "offset": lambda s: np.ones(len(s.time)),
    "coulomb_friction": passing,
    "viscous_friction": lambda s: s.v * np.abs(s.v) ** 0.04,
    "nonlinear_viscous_friction": lambda s: s.v * np.abs(s.v) ** 1.4,
    "stribeck_friction": lambda s: passing(s) * np.exp(-(np.abs(s.v / 0.12) ** 1.6)),
    "presliding_friction": lambda s: bouc_wen(s.q, 0.02),
    "load_dependent_friction": lambda s: passing(s) * np.abs(s.transmitted) ** 1.15,
    "temperature_dependent_friction": lambda s: s.v * _warm(s, -0.04),
    "position_dependent_friction": lambda s: (
        passing(s) * (np.cos(s.q - 0.4) + 0.4 * np.abs(np.sin(s.q + 1.0)))
    ),
    "inertia": lambda s: s.a * (1.0 + 0.1 * np.cos(s.q)),
    "gravity": lambda s: np.sin(s.q - 0.3 + 0.08 * np.sin(s.q)),
    "output_ripple": lambda s: _teeth(2.0 * s.q + 0.5, 0.4) + 0.5 * np.cos(3.0 * s.q),
    "wave_generator_ripple": lambda s: (
        (1.0 + 0.08 * np.cos(s.q)) * _teeth(2.0 * s.theta + 0.5, 0.5)
    ),
    "speed_dependent_ripple": _resonant,
    "cogging": lambda s: _teeth(2.0 * s.joint.pole_pairs * s.theta + 0.5, 0.3),
}

SENSOR: Mapping[str, Form] = {
    **FRICTION,
    "temperature_drift": lambda s: _warm(s, 0.03),
    "thermal_gradient_drift": lambda s: (
        s.temperature - lagged(lagged(s.temperature, 1.5, s.rate), 0.3, s.rate)
    ),
    "time_drift": lambda s: -np.expm1(-s.time / 20.0),
    "gain_error": lambda s: s.load * (1.0 + 0.004 * np.abs(s.load)),
    "gain_temperature_dependence": lambda s: s.load * _warm(s, 0.02),
    "sensor_nonlinearity": lambda s: (
        np.cosh(0.15 * s.load) - 1.0 + 0.3 * (np.sinh(0.3 * s.load) - 0.3 * s.load)
    ),
    "torque_hysteresis": lambda s: -bouc_wen(s.load, 2.0),
    "motor_crosstalk": lambda s: s.motor_torque * (1.0 + 0.1 * np.abs(s.motor_torque)),
    "sensor_lag": lambda s: lagged(lagged(s.load, 0.012, s.rate), 0.005, s.rate) - s.load,
}

DRIVE: Mapping[str, Form] = {
    **FRICTION,
    "torque_constant_error": lambda s: s.load * (1.0 - 0.001 * s.load**2),
}

TORSION: Mapping[str, Form] = {
    "offset": lambda s: np.ones(len(s.time)),
    "temperature_drift": lambda s: _warm(s, 0.03),
    "time_drift": lambda s: -np.expm1(-s.time / 20.0),
    "mesh_compliance": lambda s: -s.load / (1.0 + (0.06 * np.abs(s.load)) ** 1.5),
    "wave_generator_compliance": lambda s: -np.tanh(4.0 * s.motor_torque),
    "kinematic_error": lambda s: _teeth(2.0 * s.q + 0.5, 0.4) + 0.7 * _teeth(2.0 * s.theta, 0.5),
    "torsional_hysteresis": lambda s: bouc_wen(s.load, 2.0),
    "backlash": lambda s: -s.load / np.sqrt(s.load**2 + 0.4**2),
    "temperature_dependent_stiffness": lambda s: (
        -np.tanh(0.9 * s.joint.mesh_shape * s.load) * _warm(s, 0.01)
    ),
}

FORMS: Mapping[str, Mapping[str, Form]] = {
    "sensor_torque": SENSOR,
    "motor_torque": DRIVE,
    "torsion": TORSION,
}
