"""The external torque: from momentum or from torsion, merged, and watched for contacts.

The stages after the sensor's torque, in the order in which they run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

from flexspline.effects.causes import INERTIA
from flexspline.errors import InputError
from flexspline.estimators.checks import (
    Entry,
    Estimators,
    Parts,
    above_zero,
    choice,
    has_effect,
    json_record,
    link_part,
    numbers,
    require_estimators,
    require_mesh,
)

__all__ = ["MOST_BANDS", "Collision", "Compliance", "Merge", "Observer"]

COMPLIANCE = "compliance"
INPUTS = ("sensor_torque", "motor_torque", COMPLIANCE)
DISCRETISATIONS = ("exact", "euler")


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
