"""What is summed over every run of a fleet: effects whose shapes and orders one joint has told.

Sums of products can be merged only where all runs have the same columns, so that shapes (a Stribeck
velocity, a width) and orders of ripple are held, at the values of a model or of a pilot joint.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from flexspline.effects import UNITS, Effect, require_effects, unit_in
from flexspline.errors import InputError, listed
from flexspline.fleet.sessions import readable
from flexspline.formatting import short_names
from flexspline.least_squares.options import coefficient_names, constraints_of, resolve, shapes_of
from flexspline.signals import require_one_unit

if TYPE_CHECKING:
    from flexspline.fleet.sessions import Session
    from flexspline.least_squares.options import Constraints
    from flexspline.model import Model

__all__ = ["PilotError", "Plan", "plan_of_model", "plan_of_pilot"]

PILOT_RUNS = 3
"""Of the pilot joint, the longest: shapes are common to all runs, and more tell them no better."""


class PilotError(InputError):
    """The runs of the pilot joint tell no shapes and orders."""


@dataclass(frozen=True)
class Plan:
    """How each run is summed.

    Parameters
    ----------
    effects : with the shapes and orders that are held.
    target, known_load, lowpass, bandwidth : as for `fit`.
    fixed : coefficients that are not fitted.
    own : terms, "effect.term", of which each run has its own, such as zeros.
    pilot : who told shapes and orders, in words.
    checks : whether runs are looked at first; one that no fit can use is left out.
    """

    effects: tuple[Effect, ...]
    target: str
    known_load: str | None = None
    lowpass: float | None = None
    bandwidth: float | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    own: tuple[str, ...] = ()
    pilot: str = ""
    checks: bool = True

    def __post_init__(self) -> None:
        require_effects(self.effects, self.target)
        require_one_unit(self.effects, self.target, self.known_load)
        names = coefficient_names(self.effects)
        own = []
        for each in self.own:
            its = [name for name in names if name.split(".")[0] == each]
            own += its or [names[resolve(each, names, "per_run")]]
        object.__setattr__(self, "own", tuple(dict.fromkeys(own)))
        if not self.names:
            raise InputError("there is no coefficient to fit; give effects, or fix fewer of them")

    @property
    def unit(self) -> str:
        """Unit of the target."""
        return UNITS[self.target]

    @property
    def constraints(self) -> Constraints:
        """What is held of the coefficients."""
        return constraints_of(coefficient_names(self.effects), self.fixed, {}, {})

    @property
    def free(self) -> list[int]:
        """Numbers of the coefficients that are fitted, those of single runs among them."""
        return [int(k) for k in self.constraints.free]

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficients that joints are compared by: neither fixed nor each run's own."""
        names = coefficient_names(self.effects)
        return tuple(names[k] for k in self.free if names[k] not in self.own)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of `names`."""
        terms = [term for each in self.effects for term in each.terms]
        names = coefficient_names(self.effects)
        return tuple(
            unit_in(terms[names.index(name)].unit, self.target, self.known_load)
            for name in self.names
        )

    @property
    def held_shapes(self) -> dict[str, float]:
        """Shapes by full name, with their values."""
        return {shape.name: shape.value(self.effects) for shape in shapes_of(self.effects)}

    def to_json(self) -> dict[str, Any]:
        """Return the plan as `fleet.json` holds it."""
        return {
            "target": self.target,
            "unit": self.unit,
            "known_load": self.known_load,
            "lowpass": self.lowpass,
            "bandwidth": self.bandwidth,
            "fixed": dict(self.fixed),
            "per_run": list(self.own),
            "pilot": self.pilot,
            "effects": [
                {
                    "name": each.name,
                    "shapes": dict(each.shapes),
                    "harmonics": [list(harmonic) for harmonic in each.harmonics],
                }
                for each in self.effects
            ],
        }


def plan_of_model(model: Model, target: str | None, label: str, **how: Any) -> Plan:
    """Return the plan with shapes and orders of a joint's model.

    Parameters
    ----------
    target : which part; None where there is one alone.
    label : who told them, for the result.
    **how : other fields of a `Plan`.
    """
    part = model.part(target)
    load = how.pop("known_load", None) or part.known_load
    return Plan(part.effects, part.target, load, pilot=label, **how)


def plan_of_pilot(
    effects: str | Effect | Iterable[str | Effect],
    sessions: Sequence[Session],
    target: str,
    *,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    known_load: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    per_run: Sequence[str] = (),
    checks: bool = True,
) -> Plan:
    """Return the plan with shapes and orders that a fit finds in runs of one joint.

    Where there is nothing to be found, no run is read.

    Parameters
    ----------
    sessions : of the pilot joint; its longest `PILOT_RUNS` are fitted.

    Raises
    ------
    PilotError
        Where they cannot be fitted.
    """
    from flexspline.fitting import with_orders

    chosen = with_orders(effects, orders or {})
    if known_load is None:
        chosen = [each.without_load() for each in chosen]
    require_effects(chosen, target)
    fixed = dict(fixed or {})
    shapes = {shape.name: shape for shape in shapes_of(chosen)}
    held = {name: value for name, value in fixed.items() if _shape(name, shapes)}
    how: dict[str, Any] = {"known_load": known_load, "lowpass": lowpass, "bandwidth": bandwidth}
    how |= {"fixed": {k: v for k, v in fixed.items() if k not in held}, "checks": checks}
    for name, value in held.items():
        chosen = list(shapes[_shape(name, shapes)].set(chosen, value))
    loose = [name for name in shapes if name not in {_shape(each, shapes) for each in held}]
    if not loose and not any(each.ripple and not each.harmonics for each in chosen):
        return Plan(tuple(chosen), target, own=tuple(per_run), **how)
    return _piloted(chosen, sessions, target, fixed, per_run, loose, how)


def _shape(name: str, shapes: Iterable[str]) -> str:
    """Full name of the shape that is meant, or "" where it is none."""
    return next((full for full in shapes if name in (full, full.split(".")[-1])), "")


def _piloted(
    chosen: Sequence[Effect],
    sessions: Sequence[Session],
    target: str,
    fixed: Mapping[str, float],
    per_run: Sequence[str],
    loose: Sequence[str],
    how: Mapping[str, Any],
) -> Plan:
    from flexspline.fitting import fit
    from flexspline.least_squares.options import FitOptions

    longest = sorted(sessions, key=lambda session: (-session.size, session.run))[:PILOT_RUNS]
    unit = longest[0].unit
    try:
        logs, _ = readable(longest)
        own = tuple(per_run) if len(logs) > 1 else ()
        made = fit(
            chosen,
            logs,
            target,
            known_load=how["known_load"],
            lowpass=how["lowpass"],
            fixed=fixed,
            checks=how["checks"],
            options=FitOptions(bandwidth=how["bandwidth"], per_run=own),
        )
    except InputError as error:
        raise PilotError(
            f"the pilot joint {unit}, which is to tell shapes and orders: {error}"
        ) from error
    kept = [each.name for each in made.part.effects]
    lost = [each.name for each in chosen if each.name not in kept]
    found = [*loose, *(f"orders of {each.name}" for each in made.part.effects if each.harmonics)]
    by = f"{unit} ({listed(log.name for log in logs)})"
    said = f"held as a fit of {by} found them: {listed(map(short_names, found))}"
    ends = [p.name for p in made.parameters if p.kind == "shape" and p.state.startswith("at ")]
    said += f"; {listed(ends)} ended at a bound, which is no value of a joint" if ends else ""
    said += f"; it has no orders of {listed(lost)}, which the fleet's model lacks" if lost else ""
    return Plan(made.part.effects, target, own=tuple(per_run), pilot=said, **how)
