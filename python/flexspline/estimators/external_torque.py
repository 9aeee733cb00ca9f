"""The external torque: from momentum or from torsion, merged, and watched for contacts.

The stages after the sensor's torque, in the order in which they run. Last the coefficients of the
observer's model that go on learning while the joint works.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import Effect
from flexspline.effects.causes import INERTIA
from flexspline.errors import InputError, above_zero, did_you_mean, listed, numbers
from flexspline.estimators.checks import (
    Entry,
    Estimators,
    Parts,
    choice,
    has_effect,
    json_record,
    link_part,
    require_estimators,
    require_mesh,
)
from flexspline.part import Part

__all__ = [
    "MOST_ADAPTED",
    "MOST_BANDS",
    "Adaptation",
    "Collision",
    "Compliance",
    "Merge",
    "Observer",
    "factor_of",
    "fit_rmse",
    "starting_factor",
]

COMPLIANCE = "compliance"
INPUTS = ("sensor_torque", "motor_torque", COMPLIANCE)
DISCRETISATIONS = ("exact", "euler")

Array = NDArray[np.float64]

USES = ("monitor", "compensate")
LOADS = ("free", "sensor")
MOST_ADAPTED = _core.most_adapted
SATURATED = 3.0  # direction widths: tanh(3) is 0.995
SLOWEST = 0.02  # rad/s, where no adapted effect has a direction width
ERRORS = 5.0  # standard errors of the fit that a range is at least wide, either way


@dataclass(frozen=True)
class Observer(Entry):
    """Momentum observer: the external torque, late by one over the gain.

        ṗ = τ̄ − τ_ext,    p = J q̇,    d τ̂_ext / dt = K (τ_ext − τ̂_ext)

    τ̄ is the torque of the input minus what the model's part knows of it but inertia, which
    is J: part "sensor" for the input sensor_torque (zhang), "drive" for motor_torque
    (full_range). A sensor part without inertia makes J zero, and the observer a low pass.

    With the input compliance the link alone is observed, behind the gear: τ̄ is the torque that
    the estimator `Compliance` finds in the mesh, less the gravity of the part "drive" (or
    "sensor"); friction of motor and gear lies before it. J is that of the drive's part less
    Ñ² · rotor_inertia, or of the sensor's part where there is no drive's. A model may hold this
    observer beside one of the others: `model.json` has it under `compliant_observer`.

    Sources: zhang_disturbance_elimination (16)–(21), full_range_torque_estimation (7), (8); the
    compliant gear is the next step that its conclusion names.

    Parameters
    ----------
    gain : K, 1/s; −3 dB at K/2π Hz.
    input : "sensor_torque", "motor_torque" or "compliance".
    discretisation : "exact", stable at any rate, or "euler" as the papers print it, which is
        refused where gain · period is 2 or more.
    rotor_inertia : of the input compliance: kg·m² at the motor's shaft; zero, as where nothing is
        given, leaves all inertia of the drive's part to the link.

    Raises
    ------
    InputError
        Where the gain is not above zero, a word is unknown, or a rotor's inertia is below zero or
        given for another input.
    """

    gain: float
    input: str = "sensor_torque"
    discretisation: str = "exact"
    rotor_inertia: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", above_zero(self.gain, "observer: gain", "1/s"))
        choice(self.input, "observer: input", INPUTS)
        choice(self.discretisation, "observer: discretisation", DISCRETISATIONS)
        if self.input == COMPLIANCE:
            rotor = above_zero(
                self.rotor_inertia or 0.0, "observer: rotor_inertia", "kg·m²", or_zero=True
            )
            object.__setattr__(self, "rotor_inertia", rotor)
        elif self.rotor_inertia is not None:
            raise InputError(
                "observer: rotor_inertia belongs to the input compliance; leave it out or give "
                "that input"
            )

    @property
    def key(self) -> str:
        """The name of its entry in `model.json`."""
        return "compliant_observer" if self.input == COMPLIANCE else "observer"

    def require(self, estimators: Estimators, parts: Parts) -> None:
        """Refuse a model that lacks what this reads."""
        if self.input == COMPLIANCE:
            self._require_gear(estimators, parts)
        if self.input != "motor_torque":
            return
        part = parts.get("drive")
        if part is None or part.target != "motor_torque":
            raise InputError(
                "the estimator observer with the input motor_torque needs a part for "
                "motor_torque, which the model lacks; make one with: flexspline fit RUN.csv "
                "--target motor_torque --effects "
                "inertia,coulomb_friction_per_direction,viscous_friction --into MODEL.json"
            )
        if not has_effect(part, INERTIA):
            raise InputError(
                "the estimator observer with the input motor_torque needs the effect inertia in "
                "the part for motor_torque; fit it again with: flexspline fit RUN.csv --target "
                "motor_torque --effects inertia,... --into MODEL.json"
            )

    def _require_gear(self, estimators: Estimators, parts: Parts) -> None:
        named = "observer with the input compliance"
        require_mesh(named, parts)
        if link_part(parts) is None:
            raise InputError(
                f"the estimator {named} needs the effect inertia in a part for motor_torque or "
                "sensor_torque, which the model lacks; make one with: flexspline fit RUN.csv "
                "--target motor_torque --effects "
                "inertia,coulomb_friction_per_direction,viscous_friction --into MODEL.json"
            )
        require_estimators(f"the estimator {named} needs", ("compliance",), estimators)


@dataclass(frozen=True)
class Compliance(Entry):
    """Torque through the gear's mesh from its torsion; stiffness and shape are those of the
    effect mesh_compliance in the model's part "torsion".

        τ = −tan(c_m K_m0 Δθ_m) / c_m

    Δθ_m is what is left of the measured torsion q Ñ − θ, seen from the output, when the other
    effects of the part are taken off: negative where the joint pushes outward. Hysteresis on the
    path of the load needs the torque that is looked for: each sample finds it with the loop of the
    sample before, corrects it once by the loop at that torque, and moves the loop on. The loop
    follows this torque alone, also where there is a sensor, and stays while the torque is held.

    The external torque is this less the gravity of the drive's part (or the sensor's), which the
    torsion's part has read as part of its load where it was fitted into a model that knew it.

    Where the model has no sensor torque, the drive's effects that read the load take it from here:
    the external torque of the sample before, zero until there is one.

    Source: full_range_torque_estimation (14), (15), (18); hysteresis is the step beyond it.

    Parameters
    ----------
    margin : share of the way to the pole, π / (2 c_m K_m0), that is kept free: beyond it the
        estimate is held and flagged as saturated. Above 0, below 1.

    Raises
    ------
    InputError
        Where the margin is not between 0 and 1.
    """

    key: ClassVar[str] = "compliance"

    margin: float = 0.05

    def __post_init__(self) -> None:
        margin = above_zero(self.margin, "compliance: margin")
        if not margin < 1.0:
            raise InputError(
                f"compliance: margin = {margin:g} leaves no torque; give a share below 1"
            )
        object.__setattr__(self, "margin", margin)

    def require(self, estimators: Estimators, parts: Parts) -> None:
        """Refuse a model that lacks what this reads."""
        require_mesh("compliance", parts)


METHODS = ("logistic", "kalman")
KALMAN = ("walk", "observer_noise", "compliance_noise")
AT_REST = ("compliance", "compliant_observer")


@dataclass(frozen=True)
class Merge(Entry):
    """The observer in motion, the compliance or an observer with it at standstill.

        λ(q̇) = 1 / (1 + exp(−α (|q̇| − q̇_trans)))
        logistic   τ = λ τ_observer + (1 − λ) τ_compliance
        kalman     τ a random walk; the variance of each estimate goes from its value at rest
                   (λ = 0) to that in motion (λ = 1)

    Sources: full_range_torque_estimation (19), (20); the Kalman filter is the rival that its §II-C
    names.

    Parameters
    ----------
    alpha : α, s/rad, at the output.
    transition_velocity : q̇_trans, rad/s at the output.
    method : "logistic" or "kalman".
    walk : of kalman: Nm/√s, how fast the true torque wanders.
    observer_noise, compliance_noise : of kalman: (at rest, in motion), Nm, standard deviations of
        one sample.
    record : how the values were chosen; kept as it is.
    at_rest : what takes the compliance's place above, noise included: "compliance", or
        "compliant_observer", the observer with the input compliance.

    Raises
    ------
    InputError
        Where a value is not finite or of the wrong sign, or belongs to the other method.
    """

    key: ClassVar[str] = "merge"

    alpha: float
    transition_velocity: float
    method: str = "logistic"
    walk: float | None = None
    observer_noise: tuple[float, float] | None = None
    compliance_noise: tuple[float, float] | None = None
    record: Mapping[str, Any] = field(default_factory=dict, hash=False)
    at_rest: str = "compliance"

    def __post_init__(self) -> None:
        choice(self.method, "merge: method", METHODS)
        choice(self.at_rest, "merge: at_rest", AT_REST)
        velocity = above_zero(
            self.transition_velocity, "merge: transition_velocity", "rad/s", or_zero=True
        )
        made: dict[str, Any] = {
            "alpha": above_zero(self.alpha, "merge: alpha", "s/rad"),
            "transition_velocity": velocity,
            "record": json_record(self.record, self.key),
        }
        if self.method == "kalman":
            made |= self._kalman()
        elif given := [name for name in KALMAN if getattr(self, name) is not None]:
            raise InputError(
                f"merge: {given[0]} belongs to the method kalman; leave it out or give that method"
            )
        for name, value in made.items():
            object.__setattr__(self, name, value)

    def _kalman(self) -> dict[str, Any]:
        for name in KALMAN:
            if getattr(self, name) is None:
                raise InputError(f"merge: the method kalman needs {name}; give it")
        made: dict[str, Any] = {"walk": above_zero(self.walk, "merge: walk", "Nm/√s")}
        for name in KALMAN[1:]:
            pair = numbers(getattr(self, name), f"merge: {name}", "Nm")
            if len(pair) != 2 or min(pair) <= 0.0:
                raise InputError(
                    f"merge: {name} = {list(pair)} is no pair above zero; "
                    "give it at rest and in motion, in Nm"
                )
            made[name] = pair
        return made

    def require(self, estimators: Estimators, parts: Parts) -> None:
        """Refuse a model that lacks what this reads."""
        require_estimators("the estimator merge needs", ("observer", self.at_rest), estimators)


WATCHED = ("observer", "sensor", "merged", "compliant_observer")
MOST_BANDS = 8


@dataclass(frozen=True)
class Collision(Entry):
    """A contact where the external torque leaves a band around zero.

        contact begins   τ > positive[b]  or  τ < −negative[b]
        contact ends     when τ was within release · threshold for the hold time

    b is the band of speed |q̇|. Source: zhang_disturbance_elimination (22), (23): one threshold,
    0.03 Nm; directions, speeds, hysteresis and hold time are the step beyond it.

    Parameters
    ----------
    input : the estimate that is watched: "observer", "sensor", "merged" or "compliant_observer".
    speed_edges : rad/s at the output, increasing, between the bands: one fewer than there are
        thresholds, none for one band.
    negative, positive : Nm, above zero; one threshold per band of speed and direction of torque.
    release : share of the threshold at which a contact may end, above 0 to 1.
    hold : s, how long the torque stays below that before the contact ends.
    record : how the thresholds were found; kept as it is.

    Raises
    ------
    InputError
        Where a threshold is not above zero, or numbers of bands and edges disagree.
    """

    key: ClassVar[str] = "collision"

    input: str
    speed_edges: tuple[float, ...]
    negative: tuple[float, ...]
    positive: tuple[float, ...]
    release: float = 1.0
    hold: float = 0.0
    record: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        choice(self.input, "collision: input", WATCHED)
        edges = self._edges()
        made: dict[str, Any] = {
            "speed_edges": edges,
            "negative": self._thresholds("negative", len(edges) + 1),
            "positive": self._thresholds("positive", len(edges) + 1),
            "release": above_zero(self.release, "collision: release"),
            "hold": above_zero(self.hold, "collision: hold", "s", or_zero=True),
            "record": json_record(self.record, self.key),
        }
        if made["release"] > 1.0:
            raise InputError(
                f"collision: release = {self.release:g} is above the threshold itself; "
                "give a share of at most 1"
            )
        for name, value in made.items():
            object.__setattr__(self, name, value)

    def _edges(self) -> tuple[float, ...]:
        edges = numbers(self.speed_edges, "collision: speed_edges", "rad/s")
        rising = all(low < high for low, high in pairwise(edges))
        if not rising or (edges and edges[0] <= 0.0) or len(edges) >= MOST_BANDS:
            raise InputError(
                f"collision: speed_edges = {list(edges)}; give at most {MOST_BANDS - 1} speeds "
                "above zero, increasing"
            )
        return edges

    def _thresholds(self, name: str, bands: int) -> tuple[float, ...]:
        values = numbers(getattr(self, name), f"collision: {name}", "Nm")
        if len(values) != bands:
            raise InputError(
                f"collision: {len(values)} {name} thresholds for {bands} bands of speed; "
                "give one for each band, one more than speed_edges"
            )
        return tuple(above_zero(value, f"collision: {name}", "Nm") for value in values)

    def require(self, estimators: Estimators, parts: Parts) -> None:
        """Refuse a model that lacks what this reads."""
        needed = {"sensor": (), "merged": ("merge",)}.get(self.input, (self.input,))
        watches = f"the estimator collision watches the {self.input} estimate and needs"
        require_estimators(watches, needed, estimators)


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
    fit. Of a joint that runs at one speed level and viscosity are followed together, and their
    split is that of this covariance: `estimate` says so, and `state.adaptation.told` on the joint
    is then less than the number of coefficients. The formulas stand on top of
    `flexspline/estimators/adaptation.hpp`.

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
        if self.noise is None and fit_rmse(part) is None:
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
        found = self.noise if self.noise is not None else fit_rmse(part)
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
        values = [
            (f"{effect.name}.{term.name}", float(value), effect)
            for effect, own in part.by_effect()
            if effect.name in self.effects
            for term, value in zip(effect.terms, own, strict=True)
        ]
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


def fit_rmse(part: Part) -> float | None:
    """Return the RMSE over all rows of a part's fit, of held-out ones where it says so."""
    for score in part.record.get("scores", ()):
        if score["group"] == "all":
            found = score.get("cv_rmse") or score["rmse"]
            return float(found) if found else None
    return None
