"""Forms of the effects that are hidden, and of causes that the catalogue lacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from elsewhere.joint import UNKNOWN
from elsewhere.parts import Array, bouc_wen, dahl, lagged
from elsewhere.scene import Scene

__all__ = ["FORMS", "Term"]

REFERENCE = 25.0  # °C


@dataclass(frozen=True)
class Term:
    """What an effect adds, of any size, and its form in words.

    `ripple`: cosine and sine of the ripple of the wave generator that it alters, which is known.
    """

    values: Array
    form: str = ""
    ripple: tuple[Array, ...] = ()


Form = Callable[[Scene, Generator], Term]


def _phase(rng: Generator) -> float:
    return rng.uniform(0, 6)


def _stribeck(s: Scene, rng: Generator) -> Term:
    width, form = s.joint.speed * rng.uniform(0.04, 0.15), rng.integers(3)
    x = s.v / width
    fades = (np.exp(-np.abs(x)), np.exp(-(x**2)), 1 / (1 + x**2))
    name = ("exponential", "Gaussian", "Lorentzian")[form]
    return Term(s.direction * fades[form], f"{name}, width {width:.3f} rad/s")


def _nonlinear_viscous(s: Scene, rng: Generator) -> Term:
    form = rng.integers(4)
    x = np.abs(s.v) / s.joint.speed
    laws = (x**1.2, x**2, x**1.7, x / (1 + x / 0.4))
    return Term(np.sign(s.v) * laws[form], ("|v|^1.2", "v|v|", "|v|^1.7", "shear thinning")[form])


def _presliding(s: Scene, rng: Generator) -> Term:
    """Dahl's friction less what the base has of it, or LuGre's, with a damping of 4 ms."""
    width = rng.uniform(0.002, 0.03) * (1 if s.joint.reach < 1 else 1.5)
    form = int(rng.integers(3))
    power = 2 if form == 1 else 1
    values = s.each(s.q, lambda q: dahl(q, width, power, rng.uniform(-0.5, 0.5)))
    if form == 2:
        bent = s.each(s.q, lambda q: np.gradient(dahl(q, width, 1, 0.0)) / s.joint.step)
        values = values + 0.004 / width * bent * width  # so rounded in the cases as they are
    return Term(values, f"{('Dahl 1', 'Dahl 2', 'LuGre')[form]}, width {width:.4f} rad")


def _load_dependent(s: Scene, rng: Generator) -> Term:
    power = rng.choice([1.0, 1.1, 1.3])
    return Term(s.direction * np.abs(s.carried / s.joint.largest) ** power, f"|load|^{power}")


def _temperature_dependent(s: Scene, rng: Generator) -> Term:
    rate, form = rng.uniform(0.02, 0.04), rng.integers(2)
    laws = (np.exp(-rate * _warmth(s)) - 1, -_warmth(s) / 10)
    return Term(s.v / s.joint.speed * laws[form], ("exponential", "linear")[form])


def _position_dependent(s: Scene, rng: Generator) -> Term:
    order = rng.choice([1, 2])
    values = s.direction * np.sin(order * s.q + _phase(rng))
    if rng.random() < 0.5:
        values = values + 0.3 * s.direction * np.cos(2 * order * s.q)
    return Term(values, f"order {order}")


def _two_orders(
    rng: Generator, angle: Array, orders: tuple[int, int], share: tuple[float, float]
) -> Array:
    """Two orders of an angle, the second by a random share of the first."""
    first = np.cos(orders[0] * angle + _phase(rng))
    return np.asarray(first + rng.uniform(*share) * np.cos(orders[1] * angle + _phase(rng)))


def _output_ripple(s: Scene, rng: Generator) -> Term:
    order = int(rng.choice([2, 3, 5, 8]))
    values = _two_orders(rng, s.q, (order, 2 * order), (0.3, 0.6))
    return Term(values, f"orders {order}, {2 * order}")


def _wave_angle(s: Scene) -> Array:
    """Angle of the wave generator against the part on which its ripple arises."""
    if s.joint.output_spline == "circular":
        return s.theta - s.q if s.pair == "circ" else s.theta
    return s.theta + s.q if s.pair == "flex" else s.theta


def _wave_ripple(s: Scene, rng: Generator) -> Term:
    order = int(rng.choice([1, 2]))
    values = _two_orders(rng, _wave_angle(s), (order, 2 * order), (0.2, 0.5))
    return Term(values, f"orders {order}, {2 * order} against {s.pair}")


def _cogging(s: Scene, rng: Generator) -> Term:
    orders = (2 * s.joint.pole_pairs, s.joint.slots)
    return Term(_two_orders(rng, s.theta, orders, (0.3, 0.6)), f"orders {orders[0]}, {orders[1]}")


def _resonance(s: Scene, rng: Generator) -> Term:
    """What a resonance adds to ripple of order 2."""
    speed, damping = s.joint.speed * rng.uniform(0.2, 0.6), rng.uniform(0.1, 0.3)
    x = np.abs(s.v) / speed
    gain = 1 / (1 - x**2 + 2j * damping * x)
    phase = 2 * _wave_angle(s) + _phase(rng)
    risen = np.abs(gain) * np.cos(phase + np.sign(s.v) * np.angle(gain))
    form = f"order 2 against {s.pair}, at {speed:.2f} rad/s, damping {damping:.2f}"
    return Term(risen - np.cos(phase), form, (np.cos(phase), np.sin(phase)))


def _warmth(s: Scene) -> Array:
    return s.temperature - REFERENCE


def _temperature_drift(s: Scene, rng: Generator) -> Term:
    curve = rng.uniform(-0.01, 0.01)
    return Term(_warmth(s) + curve * _warmth(s) ** 2, f"curve {curve:.3f}")


def _gradient_drift(s: Scene, rng: Generator) -> Term:
    seconds = rng.uniform(8, 40)
    values = s.each(s.temperature, lambda x: x - lagged(x, seconds, s.joint.step))
    return Term(values, f"T - lag(T, {seconds:.0f} s)")


def _time_drift(s: Scene, rng: Generator) -> Term:
    form = rng.integers(2)
    laws = (np.log1p(s.time / 8), 1 - np.exp(-s.time / 20))
    return Term(laws[form], ("log creep", "exponential creep")[form])


def _nonlinearity(s: Scene, rng: Generator) -> Term:
    x, form = s.carried / s.joint.load, rng.integers(3)
    laws = (x**2, x**3, np.tanh(1.5 * x) / 1.5 - x)
    return Term(laws[form], ("square", "cube", "tanh")[form])


def _hysteresis(s: Scene, rng: Generator) -> Term:
    width, power = s.joint.load * rng.uniform(0.15, 0.6), rng.choice([1.0, 1.5, 2.0])
    beta = rng.uniform(0.5, 0.8)
    loop = s.each(s.carried, lambda x: bouc_wen(x, width, power, beta))
    return Term(-loop, f"Bouc-Wen, width {width:.1f} Nm, power {power}")


def _gravity(s: Scene, rng: Generator) -> Term:
    angle = s.joint.link_angle if s.joint.link else rng.uniform(-3, 3)
    return Term(np.sin(s.q + angle), "one sine")


def _bump(s: Scene, rng: Generator) -> Term:
    width = 0.06 * s.joint.reach
    away = (s.q - s.middle - 0.2 * s.joint.reach) / width
    return Term(np.exp(-0.5 * away**2), f"width {width:.2f} rad")


FORMS: Mapping[str, Form] = {
    "stribeck_friction": _stribeck,
    "nonlinear_viscous_friction": _nonlinear_viscous,
    "presliding_friction": _presliding,
    "load_dependent_friction": _load_dependent,
    "temperature_dependent_friction": _temperature_dependent,
    "position_dependent_friction": _position_dependent,
    "viscous_friction": lambda s, rng: Term(s.v),
    "inertia": lambda s, rng: Term(s.a),
    "gravity": _gravity,
    "output_ripple": _output_ripple,
    "wave_generator_ripple": _wave_ripple,
    "speed_dependent_ripple": _resonance,
    "cogging": _cogging,
    "temperature_drift": _temperature_drift,
    "thermal_gradient_drift": _gradient_drift,
    "time_drift": _time_drift,
    "gain_error": lambda s, rng: Term(s.carried),
    "gain_temperature_dependence": lambda s, rng: Term(
        s.carried / s.joint.load * (_warmth(s) + 0.005 * _warmth(s) ** 2) / 10
    ),
    "sensor_nonlinearity": _nonlinearity,
    "torque_hysteresis": _hysteresis,
    "motor_crosstalk": lambda s, rng: Term(
        s.each(s.motor, lambda x: lagged(x, 0.003, s.joint.step)), "motor torque over 3 ms"
    ),
    "torque_constant_error": lambda s, rng: Term(s.load),
    UNKNOWN + "load_times_speed": lambda s, rng: Term(s.load / s.joint.load * s.v / s.joint.speed),
    UNKNOWN + "gravity_times_speed": lambda s, rng: Term(
        s.gravity / s.joint.link * s.v / s.joint.speed
    ),
    UNKNOWN + "angle2_times_temperature": lambda s, rng: Term((s.q - s.middle) ** 2 * _warmth(s)),
    UNKNOWN + "bump_at_an_angle": _bump,
    UNKNOWN + "friction_with_acceleration": lambda s, rng: Term(
        s.direction * np.abs(s.a) / s.joint.acceleration
    ),
    UNKNOWN + "load_times_sin_angle": lambda s, rng: Term(s.load / s.joint.load * np.sin(s.q)),
}
"""By name; the lag of a sensor, whose size is its lag, is made by `case.py`."""
