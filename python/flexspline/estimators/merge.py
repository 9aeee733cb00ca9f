"""Observer and compliance estimate in one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from flexspline.errors import InputError
from flexspline.estimators.checks import (
    above_zero,
    choice,
    from_fields,
    json_record,
    numbers,
    to_fields,
)

__all__ = ["Merge"]

METHODS = ("logistic", "kalman")
KALMAN = ("walk", "observer_noise", "compliance_noise")
AT_REST = ("compliance", "compliant_observer")


@dataclass(frozen=True)
class Merge:
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

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Merge:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
