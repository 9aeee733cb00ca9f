"""The runs of a joint with what is hidden in them, at its size, and the noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import Generator

import flexspline
from elsewhere.effects import FORMS, Term
from elsewhere.joint import Deal, dealt, drawn
from elsewhere.parts import Array, lagged
from elsewhere.scene import Scene, scene

__all__ = ["Case", "case_of"]

Known = dict[str | flexspline.Effect, tuple[Array, ...]]

PAIRS = {"circ": "wave_generator_on_circular_spline", "flex": "wave_generator_on_flexspline"}
DRIFTS = ("temperature_drift", "time_drift", "thermal_gradient_drift")  # an offset is no size
EITHER_SIGN = ("gain_error", "torque_constant_error")
SIZES = (0.5, 5.0)  # RMS of what is hidden, in deviations of the noise, evenly in the logarithm
VISIBLE = 0.3  # deviations of the noise that the known effects leave of it, if SIZES allow
LONGEST_LAG = 0.15  # s of a sensor


@dataclass
class Case:
    """Runs of a joint, what is known of them, and what is hidden.

    `known`: columns of the effects of the base. `output`: torque by the known effects, Nm, and
    `hidden` by the others; `forms` say what these are. `noise`: deviation in the output, Nm;
    `white`: share of its variance that is white, the rest being correlated over `seconds`.
    `range`: of the output, Nm.
    """

    deal: Deal
    scene: Scene
    known: Known
    output: Array
    hidden: Array
    range: float
    noise: float
    white: float
    seconds: float
    forms: list[str] = field(default_factory=list)

    def left(self, values: Array) -> float:
        """RMS that the known effects leave of values."""
        thin = slice(None, None, self.scene.joint.refined)
        known = np.column_stack([column for own in self.known.values() for column in own])[thin]
        factors = np.linalg.lstsq(known, values[thin], rcond=None)[0]
        return _rms(values[thin] - known @ factors)

    def hide(self, name: str, rng: Generator) -> None:
        """Add an effect; if it is one of the base, it is known no longer."""
        if name == "sensor_lag":
            size = np.exp(rng.uniform(*np.log(SIZES))) * self.noise
            term, factor = _sensor_lag(self.scene, size), 1.0
        else:
            term = FORMS[name](self.scene, rng)
            self._learn(name, term)
            factor = self._factor(name, term.values, rng)
        if term.ripple:
            self.output = self.output + factor * term.ripple[0]
            self.scene = replace(self.scene, motor=self.scene.motor + factor * term.ripple[0])
        added = term.values * factor
        self.hidden = self.hidden + added
        self.forms.append(
            f"{name}[{term.form}] rms/noise={_rms(added) / self.noise:.2f} "
            f"visible/noise={self.left(added) / self.noise:.2f}"
        )

    def _learn(self, name: str, term: Term) -> None:
        """Take what is hidden from what is known, and add the ripple that it alters."""
        columns = self.known.pop(name, ())
        last = [*self.known][-1]
        if name == "gravity" and columns and isinstance(last, flexspline.Effect):
            self.known[last] = columns  # a slip that is kept: sized beside itself, not the ripple
        if term.ripple:
            pair = PAIRS[self.scene.pair]
            self.known[flexspline.effect("wave_generator_ripple", orders=[(2, pair)])] = term.ripple

    def _factor(self, name: str, values: Array, rng: Generator) -> float:
        """Size and sign of a term in Nm."""
        size = np.exp(rng.uniform(*np.log(SIZES)))
        own = float(np.std(values)) if name in DRIFTS else _rms(values)
        visible = max(self.left(values) / own, 1e-9)
        sign = -1 if name in EITHER_SIGN and rng.random() < 0.5 else 1
        return float(min(SIZES[1], max(size, VISIBLE / visible)) * self.noise / own * sign)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _sensor_lag(s: Scene, size: float) -> Term:
    """A lag of what the sensor carries, so long that it makes a deviation of so many Nm."""

    def made(seconds: float) -> Array:
        return s.each(s.carried, lambda x: lagged(x, seconds, s.joint.step)) - s.carried

    low, high = 1e-4, LONGEST_LAG
    for _ in range(18):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if np.std(made(middle)) < size else (low, middle)
    return Term(made(low), f"lag {low * 1e3:.1f} ms")


def case_of(seed: int, rng: Generator) -> Case:
    """Draw the case of a seed."""
    deal = dealt(seed, rng)
    joint = drawn(deal, rng)
    s = scene(deal, joint, rng)
    coulomb, viscous = s.friction
    output = s.carried + coulomb + viscous + joint.offset
    motor = output + _losses(s, rng) if deal.target == "sensor_torque" else output
    reach = float(np.percentile(output, 99.8) - np.percentile(output, 0.2))
    noise, white = rng.uniform(0.005, 0.02) * reach, rng.uniform(0.3, 0.8)
    seconds = rng.uniform(0.005, 0.05)
    s = replace(s, motor=motor, pair=str(rng.choice(list(PAIRS))))
    known: Known = {
        "offset": (np.ones_like(s.q),),
        "coulomb_friction": (coulomb,),
        "viscous_friction": (viscous,),
    }
    if joint.inertia_known:
        known["inertia"] = (s.a,)
    if not deal.lab:
        known["gravity"] = (np.sin(s.q), np.cos(s.q))
    case = Case(deal, s, known, output, np.zeros_like(output), reach, noise, white, seconds)
    for name in deal.hidden:
        case.hide(name, rng)
    return case


def _losses(s: Scene, rng: Generator) -> Array:
    """What a motor has to do beside what the sensor sees, Nm at the output."""
    own = s.joint
    friction = 0.08 * own.load * s.direction + 0.05 * own.load * s.v / own.speed
    return np.asarray(friction + rng.uniform(0.2, 0.6) * own.load / own.acceleration * s.a)
