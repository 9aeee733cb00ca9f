"""What may be missing: every effect of the catalogue that acts on the target and has its channels.

A candidate is an effect in several shapes, of which one is right at most; a ripple effect is a
pool of orders (its atoms), of which several may be. Which effects are no candidates is said, with
the reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from flexspline.discovery.freedom import DIRECTIONS, LAG
from flexspline.discovery.grids import shaped
from flexspline.effects import CATALOGUE, TARGETS, Effect, Harmonic
from flexspline.errors import InputError
from flexspline.fit.problem import Problem
from flexspline.fit.requirements import gear_for, require_load, require_one_unit
from flexspline.logs.log import Log
from flexspline.signals import channels_for

__all__ = ["Candidate", "candidates_for", "possible"]

PAIRED = {
    "coulomb_friction_per_direction": ("coulomb_friction", "offset"),
}
"""The same columns under another name: never a candidate, and who has it needs no others."""


@dataclass(frozen=True)
class Candidate:
    """One effect that may be missing.

    `variants`: the effect in several shapes, one of which is tried at a time. `atoms`: of a ripple
    effect, for each variant the effect with one order each.
    """

    name: str
    variants: tuple[Effect, ...]
    atoms: tuple[tuple[Effect, ...], ...] = ()

    @property
    def effects(self) -> list[Effect]:
        """Everything that needs columns."""
        if self.atoms:
            return [atom for atoms in self.atoms for atom in atoms]
        return list(self.variants)

    def having(self, variant: Effect) -> Candidate:
        """Return the candidate with another variant."""
        orders = self.variants[0].harmonics
        variant = variant.with_orders(orders) if orders else variant
        atoms = tuple(variant.with_orders([h]) for h in orders)
        return replace(
            self,
            variants=(*self.variants, variant),
            atoms=(*self.atoms, atoms) if self.atoms else (),
        )


def possible(
    base: Sequence[Effect],
    logs: Sequence[Log],
    target: str,
    known_load: str | None,
    exclude: Iterable[str] = (),
) -> tuple[list[Effect], dict[str, str]]:
    """Return the effects that these logs could show beside `base`, and why the others cannot.

    `exclude`: names that the caller knows not to be there.

    Raises
    ------
    InputError
        For a name in `exclude` that is no effect, or one of the base.
    """
    names = {e.name for e in base}
    absent = _absent(exclude, names)
    never = {DIRECTIONS} if target == "sensor_torque" else {DIRECTIONS, LAG}
    taken = names | never | set(PAIRED) | {n for own in names for n in PAIRED.get(own, ())}
    found, reasons = [], {}
    for info in CATALOGUE.values():
        if info.name in taken or TARGETS[target] not in info.targets:
            continue
        if info.name in absent:
            reasons[info.name] = "excluded by the caller"
            continue
        effect = Effect(info.name)
        effect = effect.without_load() if known_load is None else effect
        try:
            for log in logs:
                channels_for(log, [effect], known_load)
            gear_for(logs, target, [effect])
        except InputError as error:
            reasons[info.name] = str(error)
            continue
        found.append(effect)
    carriers = [*base, *(e for e in found if e.info.carries_load)]
    for effect in list(found):
        try:
            require_load([*carriers, effect], known_load)
            require_one_unit([*base, effect], target, known_load)
        except InputError as error:
            reasons[effect.name] = str(error)
            found.remove(effect)
    return found, reasons


def _absent(exclude: Iterable[str], base: set[str]) -> set[str]:
    absent = {exclude} if isinstance(exclude, str) else set(exclude)
    for name in sorted(absent):
        Effect(name)  # refuses what is no effect
        if name in base:
            raise InputError(f"'{name}' is excluded and in the model; leave it out of one of them")
    return absent


def candidates_for(
    model: Sequence[Effect],
    effects: Iterable[Effect],
    problem: Problem,
    pools: dict[str, tuple[Harmonic, ...]],
) -> list[Candidate]:
    """Return the candidates beside a model.

    Parameters
    ----------
    effects : those that the logs could show; those in the model already are left out.
    pools : orders that may be there, by ripple effect.
    """
    names, made = {e.name for e in model}, []
    for effect in effects:
        if effect.name in names or not _loaded([*model, effect], problem):
            continue
        effect = effect.with_orders(pools.get(effect.name, ())) if effect.ripple else effect
        variants = shaped(effect, tuple(model), problem)
        if not effect.ripple:
            made.append(Candidate(effect.name, tuple(variants)))
        elif pools.get(effect.name):
            atoms = [tuple(v.with_orders([h]) for h in pools[effect.name]) for v in variants]
            made.append(Candidate(effect.name, tuple(variants), tuple(atoms)))
    return made


def _loaded(effects: Sequence[Effect], problem: Problem) -> bool:
    try:
        require_load(effects, problem.known_load)
        require_one_unit(effects, problem.target, problem.known_load)
    except InputError:
        return False
    return True
