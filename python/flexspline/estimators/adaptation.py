"""Coefficients of the observer's model that go on learning while the joint works."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import Effect
from flexspline.effects.causes import INERTIA
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.estimators.checks import (
    Entry,
    Estimators,
    Parts,
    above_zero,
    choice,
    require_estimators,
)
from flexspline.estimators.external_torque import Observer
from flexspline.part import Part

__all__ = ["MOST_ADAPTED", "Adaptation", "factor_of", "starting_factor"]

Array = NDArray[np.float64]

USES = ("monitor", "compensate")
LOADS = ("free", "sensor")
MOST_ADAPTED = _core.most_adapted
SATURATED = 3.0  # direction widths: tanh(3) is 0.995
SLOWEST = 0.02  # rad/s, where no adapted effect has a direction width
ERRORS = 5.0  # standard errors of the fit that a range is at least wide, either way


@dataclass(frozen=True)
class Adaptation(Entry):
    """Coefficients of the observer's model that follow the joint as it wears, warms or is greased.

        y = θ · φ + noise,     y = mean of τ̄ − τ_model over a block, less Δ(J q̇) / T

    Recursive least squares with exponential forgetting of what the motion excites and of nothing
    else, U D Uᵀ of the covariance, in the core and the same on a PC and on the joint; off unless a
    model has it. A block of samples teaches where the joint moves in all of it, no sample in it or
    in the block behind has a contact or a flag, and it is within the gate; else every coefficient
    stays as it is, also for years. Blocks count together after an eighth of the memory, so each
    coefficient moves in steps. It starts at the part's coefficients with the covariance of their
    fit. The formulas stand on top of `flexspline/estimators/adaptation.hpp`.

    With the use monitor no estimate changes: what was learned is there to be read, in `estimate` as
    columns by the names of the parameters, on the joint by `joint.adapted(state)`, and in the
    block that `joint.adopt(state)` and `save` write, which `flexspline.learned_model` reads. With
    compensate the observer goes by it; a slow push that is no contact is then taken for friction,
    as far as gate and ranges let it, so give the model a `Collision` too.

    Sources: [Kulhavy1987], [CaoSchwartz2000], [Bierman1977], [GoodwinSin1984].

    Parameters
    ----------
    effects : names, in the part of the observer's input, without memory and inertia; at most eight
        coefficients together.
    memory : s of motion that teaches, after which a block counts 1/e. Half of it follows twice
        as fast with √2 of the noise. A drift is followed late by it.
    interval : s of a block. Noise that is correlated for longer counts as news; a block much
        longer than a move is left out where the joint stops in it.
    noise : Nm, standard deviation of a block around the model; None for the RMSE of the part's fit,
        which takes all that the model misses as noise. The gate is as wide as this is large.
    gate : standard deviations; 4 refuse 6 in 100 000 blocks of normal noise, 2 would refuse 5 in
        100, and 8 let a push of twice the size teach. A change beyond the gate from one round to
        the next is never learned: fit the joint anew.
    least_speed : rad/s at the output; None for three times the widest direction width of the
        effects: there friction has its full level.
    least_information : what a round must say of a coefficient for it to be followed, squared
        standard deviations were it half its range off: at 100 it is known to 3.5 % of half its
        range, at 50 to 5 %, at 200 to 2.5 %; what is less excited keeps its value.
    range_factor : above 1: a coefficient stays between its value over it and its value times it, at
        least five standard errors of the fit to either side; one that has one sign keeps it.
    use : "monitor" or "compensate".
    load : "free", no torque from outside but in contact, or "sensor": the sensor's external torque,
        for an observer with the input motor_torque in a joint with a sensor.

    Raises
    ------
    InputError
        Where a number is not finite or not above zero, a word is unknown, or no effect is given.
    """

    key: ClassVar[str] = "adaptation"

    effects: tuple[str, ...]
    memory: float = 600.0
    interval: float = 0.1
    noise: float | None = None
    gate: float = 4.0
    least_speed: float | None = None
    least_information: float = 100.0
    range_factor: float = 2.0
    use: str = "monitor"
    load: str = "free"

    def __post_init__(self) -> None:
        given = (self.effects,) if isinstance(self.effects, str) else tuple(self.effects)
        if not given or not all(isinstance(name, str) for name in given):
            raise InputError(
                "adaptation: no effects to adapt; give names, such as coulomb_friction"
            )
        object.__setattr__(self, "effects", tuple(dict.fromkeys(given)))
        units = {"memory": "s", "interval": "s", "gate": "", "least_information": ""}
        for name, unit in units.items():
            value = above_zero(getattr(self, name), f"adaptation: {name}", unit)
            object.__setattr__(self, name, value)
        for name, unit in {"noise": "Nm", "least_speed": "rad/s"}.items():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, above_zero(value, f"adaptation: {name}", unit))
        factor = above_zero(self.range_factor, "adaptation: range_factor")
        if not factor > 1.0:
            raise InputError(
                f"adaptation: range_factor = {factor:g} leaves no range; give one above 1"
            )
        object.__setattr__(self, "range_factor", factor)
        if not self.memory > self.interval:
            raise InputError(
                f"adaptation: a memory of {self.memory:g} s is no longer than an interval of "
                f"{self.interval:g} s; give a longer one"
            )
        choice(self.use, "adaptation: use", USES)
        choice(self.load, "adaptation: load", LOADS)

    def require(self, estimators: Estimators, parts: Parts) -> None:
        """Refuse a model that lacks what this reads."""
        require_estimators("the estimator adaptation needs", ("observer",), estimators)
        observer = estimators["observer"]
        assert isinstance(observer, Observer)
        by_motor = observer.input == "motor_torque"
        part = parts.get("drive" if by_motor else "sensor")
        if part is None:
            raise InputError(
                f"the estimator adaptation needs a part for {observer.input}, which the observer "
                "reads and the model lacks; make one with: flexspline fit RUN.csv --target "
                f"{observer.input} --effects coulomb_friction,viscous_friction --into MODEL.json"
            )
        self._require_effects(part)
        if self.noise is None and _rmse(part) is None:
            raise InputError(
                f"the estimator adaptation needs the noise of the part for {part.target}, which "
                "no fit recorded; give noise in Nm"
            )
        measures = "sensor" in parts or estimators.keys() & {
            "calibration",
            "temperature_compensation",
        }
        if self.load == "sensor" and not (by_motor and measures):
            raise InputError(
                "adaptation: the load sensor needs a joint with a sensor and an observer with the "
                "input motor_torque; give the load free"
            )

    def _require_effects(self, part: Part) -> None:
        known = {effect.name: effect for effect in part.effects}
        for name in self.effects:
            if name not in known:
                raise InputError(
                    f"adaptation: the part for {part.target} has no effect '{name}'"
                    f"{did_you_mean(name, known)}; it has {listed(known)}"
                )
            if name == INERTIA or known[name].info.remembers:
                why = "is the observer's own" if name == INERTIA else "has a memory"
                raise InputError(f"adaptation: the effect {name} {why}; leave it out")
        count = sum(len(known[name].terms) for name in self.effects)
        if count > MOST_ADAPTED:
            raise InputError(
                f"adaptation: {listed(self.effects)} have {count} coefficients together; give "
                f"effects with at most {MOST_ADAPTED}"
            )

    def speed(self, part: Part) -> float:
        """The least speed, rad/s: the one that is given, or that of the part's adapted effects."""
        if self.least_speed is not None:
            return self.least_speed
        widths = [
            effect.shapes["direction_width"]
            for effect in self.adapted(part)
            if "direction_width" in effect.shapes
        ]
        return max((SATURATED * width for width in widths), default=SLOWEST)

    def spread(self, part: Part) -> float:
        """The noise of a block, Nm."""
        found = self.noise if self.noise is not None else _rmse(part)
        assert found is not None
        return found

    def adapted(self, part: Part) -> list[Effect]:
        """The effects of a part that are adapted, in its order."""
        return [effect for effect in part.effects if effect.name in self.effects]

    def names(self, part: Part) -> list[str]:
        """The parameters that are adapted, in the part's order."""
        return [f"{e.name}.{term.name}" for e in self.adapted(part) for term in e.terms]

    def start(self, part: Part) -> dict[str, list[float]]:
        """Ranges and factor of the covariance that the core begins with, in the part's order."""
        entries = {entry["name"]: entry for entry in part.record.get("parameters", ())}
        low, high = [], []
        first, values = 0, []
        for effect in part.effects:
            last = first + len(effect.terms)
            if effect.name in self.effects:
                values += [
                    (f"{effect.name}.{term.name}", float(value), effect)
                    for term, value in zip(effect.terms, part.coefficients[first:last], strict=True)
                ]
            first = last
        for name, value, effect in values:
            ends = self._range(value, entries.get(name, {}), effect)
            low.append(ends[0])
            high.append(ends[1])
        half = (np.array(high) - np.array(low)) / 2.0
        covariance = starting_factor([name for name, *_ in values], part, half)
        return {"low": low, "high": high, "factor": covariance.tolist()}

    def _range(self, value: float, entry: object, effect: Effect) -> tuple[float, float]:
        known = entry if isinstance(entry, dict) else {}
        if known.get("state") == "fixed":
            return value, value
        error = known.get("standard_error") or 0.0
        ends = (value / self.range_factor, value * self.range_factor)
        low = min(*ends, value - ERRORS * error)
        high = max(*ends, value + ERRORS * error)
        if effect.info.traits.one_signed:
            low, high = (max(low, 0.0), high) if value >= 0.0 else (low, min(high, 0.0))
        return low, high


def starting_factor(names: list[str], part: Part, half: Array) -> Array:
    """Return U and D of the covariance of a fit, (N (N + 1) / 2,) as the core packs them.

    Where the fit recorded none of a coefficient, a third of half its range is its standard
    deviation; one without a range has none.
    """
    prior = np.diag((half / 3.0) ** 2)
    recorded = part.record.get("covariance", {})
    known = list(recorded.get("names", ()))
    matrix = np.array(recorded.get("matrix", ()), dtype=np.float64).reshape(len(known), len(known))
    own = [k for k, name in enumerate(names) if name in known and half[k] > 0.0]
    places = [known.index(names[k]) for k in own]
    found = matrix[np.ix_(places, places)] if own else np.zeros((0, 0))
    good = np.isfinite(found).all(axis=0) & (np.diag(found) > 0.0)
    own = [k for k, fine in zip(own, good, strict=True) if fine]
    prior[np.ix_(own, own)] = found[np.ix_(good, good)]
    made = factor_of(prior)
    return made if made is not None else factor_of(np.diag(np.diag(prior)))  # type: ignore[return-value]


def factor_of(covariance: Array) -> Array | None:
    """Return U and D of P = U D Uᵀ, column by column; None where P is not positive.

    A coefficient with neither variance nor covariance has zeros.
    """
    size = len(covariance)
    left, packed = covariance.copy(), np.zeros(size * (size + 1) // 2)
    for k in reversed(range(size)):
        d, first = left[k, k], k * (k + 1) // 2
        if d == 0.0 and not left[k, :k].any():
            continue
        if not d > 1e-12 * covariance[k, k]:  # all but what rounding leaves of it is explained
            return None
        column = left[:k, k] / d
        packed[first : first + k], packed[first + k] = column, d
        left[:k, :k] -= d * np.outer(column, column)
    return packed


def _rmse(part: Part) -> float | None:
    """The RMSE over all rows of the part's fit, on rows that it did not see where it says so."""
    for score in part.record.get("scores", ()):
        if score["group"] == "all":
            found = score.get("cv_rmse") or score["rmse"]
            return float(found) if found else None
    return None
