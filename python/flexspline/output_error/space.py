"""The numbers that a fit to the simulation searches, and the coordinates it searches them in.

What is above zero by its nature (an inertia, a shape, a torque constant) is searched by its
logarithm, θ = e^z. A friction level, which may be none, and what may have either sign are
searched in units of their scale, θ = s z, the level from zero up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.forward.servo import PositionServo
from flexspline.least_squares.options import Bounds, pair_of, resolve, shapes_of
from flexspline.least_squares.result import Parameter
from flexspline.part import Part

__all__ = ["FREE_OF_A_LAW", "Searched", "Space", "space_of"]

Array = NDArray[np.float64]

LOGARITHMIC = ("inertia.inertia",)
NATURAL = {
    "inertia.inertia": (0.0, np.inf),
    "coulomb_friction.level": (0.0, np.inf),
    "viscous_friction.viscosity": (0.0, np.inf),
    "load_dependent_friction.factor": (0.0, 0.99),
}
"""Below zero, each of these would give energy or be no mass; a load's friction that exceeds its
load locks the joint."""
FREE_OF_A_LAW = ("torque", "back_emf")
WIDEST = 1e3  # how far from its start a logarithm may take a number, as a factor
SMALL = 0.05  # of the error of a regression that went the wrong way: where a positive number starts
ERRORS_WIDE = 5.0  # scale of a number of either sign, in standard errors of the regression


@dataclass(frozen=True)
class Searched:
    """One number that is searched.

    `kind`: "coefficient", "shape" or "controller". `start`: where the regression left it, in
    `unit`. `logarithmic`: searched as z = log θ, else as z = θ / `scale`. `lower`, `upper`: of θ.
    """

    name: str
    kind: str
    unit: str
    start: float
    logarithmic: bool
    scale: float
    lower: float
    upper: float

    def coordinate(self, value: float) -> float:
        return float(np.log(value)) if self.logarithmic else value / self.scale

    def value(self, coordinate: float) -> float:
        raw = float(np.exp(coordinate)) if self.logarithmic else coordinate * self.scale
        return min(max(raw, self.lower), self.upper)

    def slope(self, coordinate: float) -> float:
        """dθ/dz, which carries an error from one to the other."""
        return self.value(coordinate) if self.logarithmic else self.scale


@dataclass(frozen=True)
class Space:
    """The search of a drive's numbers and of its servo's.

    `part`: with everything that is not searched. `names`: of its coefficients.
    """

    part: Part
    names: tuple[str, ...]
    searched: tuple[Searched, ...]

    @property
    def start(self) -> Array:
        return np.array([one.coordinate(one.start) for one in self.searched])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(low, high) of the coordinates."""
        ends = np.array([self._ends(one) for one in self.searched]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    def values(self, point: Array) -> Array:
        return np.array([s.value(z) for s, z in zip(self.searched, point, strict=True)])

    def slopes(self, point: Array) -> Array:
        return np.array([s.slope(z) for s, z in zip(self.searched, point, strict=True)])

    def at(self, point: Array) -> tuple[Part, dict[str, float]]:
        """Return the drive at a point of the search, and what of the law's fields is searched."""
        values = self.values(point)
        coefficients = self.part.coefficients.copy()
        effects, law = self.part.effects, {}
        shapes = {shape.name: shape for shape in shapes_of(effects)}
        for one, value in zip(self.searched, values.tolist(), strict=True):
            if one.kind == "coefficient":
                coefficients[self.names.index(one.name)] = value
            elif one.kind == "shape":
                effects = shapes[one.name].set(effects, value)
            else:
                law[one.name.removeprefix("controller.")] = value
        return replace(self.part, effects=effects, coefficients=coefficients), law

    @staticmethod
    def _ends(one: Searched) -> tuple[float, float]:
        with np.errstate(divide="ignore"):
            if one.logarithmic:
                return float(np.log(one.lower)), float(np.log(one.upper))
        return one.lower / one.scale, one.upper / one.scale


def space_of(
    part: Part,
    law: PositionServo | None,
    regressed: Sequence[Parameter],
    bounds: Mapping[str, Bounds],
    free: Sequence[str],
) -> Space:
    """Return the search that starts from a regression.

    Parameters
    ----------
    part : as the regression left it.
    law : the servo's, or None.
    regressed : its parameters; what is fixed there stays.
    bounds : by name of a parameter.
    free : fields of the law to search, of `FREE_OF_A_LAW`.

    Raises
    ------
    InputError
        For a bound of an unknown parameter, and where nothing is left to search.
    """
    ignored = "direction_width"  # the simulation sticks truly: no width of a direction
    names = [p.name for p in regressed if p.kind == "coefficient"]
    shapes = {shape.name: shape.info for shape in shapes_of(part.effects)}
    found = []
    limits = _limits([p.name for p in regressed], bounds)
    for p in regressed:
        if p.state == "fixed" or p.name == ignored:
            continue
        low, high = limits.get(p.name, (None, None))
        if p.kind == "shape":
            info = shapes[p.name]
            found.append(_positive(p.name, "shape", p.unit, p.value, low or info.lower,
                                   high or info.upper))  # fmt: skip
            continue
        ends = NATURAL.get(p.name, (-np.inf, np.inf))
        low, high = ends[0] if low is None else low, ends[1] if high is None else high
        if p.name in LOGARITHMIC:
            start = p.value if p.value > 0.0 else SMALL * _error(p)
            found.append(_positive(p.name, "coefficient", p.unit, start, max(low, 0.0), high))
        else:
            found.append(_signed(p, low, high))
    found += [_of_law(law, name, part.unit) for name in free if law is not None]
    if not found:
        raise InputError("every parameter is fixed; leave one at least to be fitted")
    return Space(part, tuple(names), tuple(found))


def _limits(names: Sequence[str], bounds: Mapping[str, Bounds]) -> dict[str, Bounds]:
    return {
        names[resolve(name, names, "bounds")]: pair_of(ends, f"bounds: {name}", "(low, high)")
        for name, ends in bounds.items()
    }


def _error(p: Parameter) -> float:
    return p.standard_error if np.isfinite(p.standard_error) else max(abs(p.value), 1.0)


def _positive(name: str, kind: str, unit: str, start: float, low: float, high: float) -> Searched:
    low, high = max(low, start / WIDEST), min(high, start * WIDEST)
    return Searched(name, kind, unit, float(np.clip(start, low, high)), True, 1.0, low, high)


def _signed(p: Parameter, low: float, high: float) -> Searched:
    scale = max(abs(p.value), ERRORS_WIDE * _error(p))
    start = float(np.clip(p.value, low, high))
    return Searched(p.name, "coefficient", p.unit, start, False, scale, low, high)


def _of_law(law: PositionServo, name: str, unit: str) -> Searched:
    if name not in FREE_OF_A_LAW:
        raise InputError(
            f"free_controller: '{name}' cannot be fitted; give of {listed(FREE_OF_A_LAW)}"
        )
    value = float(getattr(law, name))
    if not value > 0.0:
        raise InputError(
            f"the controller's {name} is to be fitted but starts at {value:g}; "
            "give a guess above zero"
        )
    per = f"{unit}·s/rad" if name == "back_emf" else f"{unit}/V" if law.supply else unit
    return _positive(f"controller.{name}", "controller", per, value, 0.0, np.inf)
