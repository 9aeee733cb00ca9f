"""The catalogue of physical effects, and one effect with its shapes and orders set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate, pairwise
from types import MappingProxyType
from typing import Any, ClassVar

from flexspline import _core
from flexspline.errors import InputError, did_you_mean, listed, number, shortened

__all__ = [
    "CATALOGUE",
    "Effect",
    "EffectInfo",
    "ShapeInfo",
    "TermInfo",
    "Traits",
    "effect",
    "require_effects",
    "slices_of",
    "traits_of",
    "unit_in",
]

TARGETS = {"sensor_torque": "S", "motor_torque": "M", "motor_current": "M", "torsion": "D"}
MADE_OF = {
    "motor_torque": {"motor_torque", "motor_current"},
    "motor_current": {"motor_torque", "motor_current"},
    "torsion": set[str](),
}
"""Channels that are a target by another name: an effect that read them would explain it by itself.
A torsion is made of both angles, and is no function of one of them."""
UNITS = {"sensor_torque": "Nm", "motor_torque": "Nm", "motor_current": "A", "torsion": "rad"}

OF_MODEL = "model"  # the owner of a shape that all effects of a model share
HIGHEST_ORDER = 1_000_000  # per turn; an encoder line count is far below

Harmonic = tuple[int, str]


@dataclass(frozen=True)
class TermInfo:
    """Name of a coefficient and its unit where the target is in Nm, or alone in rad."""

    name: str
    unit: str


@dataclass(frozen=True)
class Traits:
    """What an effect is, as its header in the core declares it (`effects/effect.hpp`).

    `constant`: the same row for every sample. `basic`: every drive has it. `inertial`: in
    proportion to the acceleration. `carries_load`: part of the torque that the gear transmits.
    `one_signed`: its coefficients have one sign, ≥ 0 where nothing is turned. `dissipative`: with
    coefficients ≥ 0 it takes energy. `loop`: depends on the way that led there. `known_load`: reads
    a load that is known from elsewhere.
    """

    constant: bool
    basic: bool
    inertial: bool
    carries_load: bool
    one_signed: bool
    dissipative: bool
    loop: bool
    known_load: bool


NO_TRAITS = Traits(False, False, False, False, False, False, False, False)


@dataclass(frozen=True)
class ShapeInfo:
    """A number that bends an effect's row, with the bounds of the search for it.

    `owner`: "" for a number of this effect alone; "model" for one that all effects of a model share
    that have it; else the effect whose number it is where the model has that effect.
    """

    name: str
    unit: str
    default: float
    lower: float
    upper: float
    fitted: bool
    owner: str


@dataclass(frozen=True)
class EffectInfo:
    """What the core says of an effect.

    `targets`: letters of S (sensor), M (drive), D (torsion). `reads`: channels, "load" among
    them. `pairs`: pairs of parts that a ripple effect may turn with, empty for others; `modulated`:
    whether speed changes such a ripple. `remembers`: whether its row depends on the rows before.
    `paths`: where one of several channels may drive it, each with the shape that is its width; the
    shape `path` counts them. `demands`: what a run must do to show it, and how much of that.
    `reversal`: what it does at a reversal, in a few words, or "". `combines`: the effects whose
    columns it has together, so that it is never sought beside them.
    """

    name: str
    targets: str
    signature: str
    source: str
    terms: tuple[TermInfo, ...]
    shapes: tuple[ShapeInfo, ...]
    reads: tuple[str, ...]
    pairs: tuple[str, ...]
    traits: Traits
    remembers: bool
    modulated: bool
    paths: tuple[tuple[str, str], ...]
    demands: tuple[tuple[str, float], ...]
    reversal: str
    combines: tuple[str, ...]

    @property
    def carries_load(self) -> bool:
        return self.traits.carries_load


def _catalogue() -> Mapping[str, EffectInfo]:
    known = {}
    for entry in _core.catalogue():
        terms = tuple(TermInfo(*term) for term in entry.pop("terms"))
        shapes = tuple(ShapeInfo(**shape) for shape in entry.pop("shapes"))
        listed_ones = ("reads", "pairs", "paths", "demands", "combines")
        entry |= {name: tuple(entry[name]) for name in listed_ones}
        made = {"terms": terms, "shapes": shapes, "traits": Traits(**entry.pop("traits"))}
        info = EffectInfo(**{**entry, **made})
        known[info.name] = info
    return MappingProxyType(known)


CATALOGUE: Mapping[str, EffectInfo] = _catalogue()


@dataclass(frozen=True)
class Effect:
    """An effect with its shapes and orders.

    Parameters
    ----------
    name : str
        A name of `CATALOGUE`.
    shapes : mapping of str to float
        Values in the units of the catalogue; what is left out has its default.
    harmonics : sequence of (order, pair)
        Of ripple effects: periods per turn of a pair of parts, such as
        (2, "wave_generator_on_flexspline").

    Raises
    ------
    InputError
        For an unknown effect, shape or pair, or a shape outside its bounds.
    """

    own: ClassVar[bool] = False
    """Whether its rows come from a function of the user (`flexspline.own_effect`)."""

    name: str
    shapes: Mapping[str, float] = field(default_factory=dict)
    harmonics: tuple[Harmonic, ...] = ()

    def __repr__(self) -> str:
        given = [f"{name}={value:.4g}" for name, value in self.shapes.items()]
        usual = self.info.pairs[0] if self.info.pairs else ""
        named = [order if pair == usual else (order, pair) for order, pair in self.harmonics]
        orders = [f"orders={named}"] if named else []
        return f"effect({', '.join([repr(self.name), *given, *orders])})"

    def __post_init__(self) -> None:
        self._require_known()
        known = {shape.name: shape for shape in self.info.shapes}
        values = {shape.name: shape.default for shape in self.info.shapes}
        for name, value in self.shapes.items():
            if name not in known:
                raise InputError(
                    f"effect '{self.name}' has no shape '{name}'; it has {listed(known)}"
                )
            values[name] = number(value, f"effect '{self.name}': {name}", known[name].unit)
            if not known[name].lower <= values[name] <= known[name].upper:
                raise InputError(
                    f"effect '{self.name}': {name} = {value} {known[name].unit} is not within "
                    f"{known[name].lower} to {known[name].upper}; give a value in that range"
                )
        object.__setattr__(self, "shapes", MappingProxyType(values))
        object.__setattr__(self, "harmonics", self._checked_harmonics())

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.shapes.items()), self.harmonics))

    def __reduce__(self) -> tuple[Any, ...]:
        return (Effect, (self.name, dict(self.shapes), self.harmonics))

    @property
    def info(self) -> EffectInfo:
        return CATALOGUE[self.name]

    @property
    def ripple(self) -> bool:
        """Whether the effect has orders."""
        return bool(self.info.pairs)

    @cached_property
    def reads(self) -> tuple[str, ...]:
        """Channels that the effect reads: of several that may drive it, the one in use."""
        unused = {channel for channel, _ in self._unused_paths}
        return tuple(channel for channel in self.info.reads if channel not in unused)

    @property
    def fitted_shapes(self) -> tuple[ShapeInfo, ...]:
        """Shapes that a fit searches: of several widths, that of the path in use."""
        unused = {width for _, width in self._unused_paths}
        return tuple(s for s in self.info.shapes if s.fitted and s.name not in unused)

    @property
    def _unused_paths(self) -> tuple[tuple[str, str], ...]:
        paths = self.info.paths
        return tuple(p for k, p in enumerate(paths) if k != round(self.shapes["path"]))

    @cached_property
    def terms(self) -> tuple[TermInfo, ...]:
        """The coefficients, in the order of the row."""
        if not self.ripple:
            return self.info.terms
        return tuple(
            TermInfo(f"{term.name} {order}{_against(pair, self.info.pairs)}", term.unit)
            for order, pair in self.harmonics
            for term in self.info.terms
        )

    def with_shapes(self, **shapes: float) -> Effect:
        """Return the effect with some shapes replaced."""
        return replace(self, shapes={**self.shapes, **shapes})

    def with_orders(self, orders: Iterable[int | Harmonic]) -> Effect:
        """Return the effect with these orders; a bare number is of the effect's first pair."""
        pairs = self.info.pairs
        if not pairs:
            raise InputError(f"effect '{self.name}' has no orders; leave them out")
        given = _listed_orders(self.name, orders)
        harmonics: list[Harmonic] = [o if isinstance(o, tuple) else (o, pairs[0]) for o in given]
        return replace(self, harmonics=tuple(sorted(harmonics, key=lambda h: (h[1], h[0]))))

    def without_load(self) -> Effect:
        """Return the effect on a path that needs no load, where it has one."""
        others = [k for k, (channel, _) in enumerate(self.info.paths) if channel != "load"]
        return self.with_shapes(path=others[0]) if others and "load" in self.reads else self

    def for_core(self) -> dict[str, Any]:
        """Return what the core needs to build the effect."""
        return {
            "name": self.name,
            "shapes": dict(self.shapes),
            "harmonics": list(self.harmonics),
        }

    def _require_known(self) -> None:
        if self.name not in CATALOGUE:
            near = did_you_mean(self.name, CATALOGUE)
            others = "`flexspline fit --help` shows all" if near else f"known are {_named()}"
            raise InputError(f"there is no effect '{shortened(self.name)}'{near}; {others}")

    def _checked_harmonics(self) -> tuple[Harmonic, ...]:
        if self.harmonics and not self.ripple:
            raise InputError(f"effect '{self.name}' has no orders; leave them out")
        if len(self.harmonics) > _core.max_harmonics:
            raise InputError(
                f"effect '{self.name}' takes at most {_core.max_harmonics} orders, "
                f"not {len(self.harmonics)}; leave out the smallest"
            )
        for order, pair in self.harmonics:
            if not 1 <= order <= HIGHEST_ORDER or int(order) != order:
                raise InputError(
                    f"effect '{self.name}': order {order} is not a whole number from 1 to "
                    f"{HIGHEST_ORDER}; give orders per turn"
                )
            if pair not in self.info.pairs:
                raise InputError(
                    f"effect '{self.name}': there is no pair of parts '{pair}'; "
                    f"give one of {listed(self.info.pairs)}"
                )
            if self.harmonics.count((order, pair)) > 1:
                raise InputError(
                    f"effect '{self.name}': order {order} is named twice; name it once"
                )
        return tuple((int(order), pair) for order, pair in self.harmonics)


def effect(name: str, *, orders: Iterable[int | Harmonic] = (), **shapes: float) -> Effect:
    """Return an effect of the catalogue: ``effect("stribeck_friction", stribeck_velocity=0.2)``."""
    if not isinstance(name, str):
        raise InputError(
            f"an effect is given by its name, not as {type(name).__name__}; give the effects "
            "first, then the runs"
        )
    made, given = Effect(name, shapes), _listed_orders(name, orders)
    return made.with_orders(given) if given else made


def _listed_orders(name: str, orders: Iterable[int | Harmonic]) -> list[int | Harmonic]:
    if isinstance(orders, str) or not isinstance(orders, Iterable):
        raise InputError(
            f"effect '{name}': orders = {orders!r} is no list; give a list of whole numbers, such "
            "as [1, 2]"
        )
    return list(orders)


def require_effects(effects: Sequence[Effect], target: str) -> None:
    """Refuse an unknown target, effects that do not act on it, and an effect named twice."""
    if target not in TARGETS:
        near = did_you_mean(target, TARGETS)
        raise InputError(f"there is no target '{target}'{near}; give one of {listed(TARGETS)}")
    names = [effect.name for effect in effects]
    for effect in effects:
        if TARGETS[target] not in effect.info.targets:
            raise InputError(
                f"effect '{effect.name}' does not act on the target {target}; leave it out"
            )
        if effect.own and {*effect.reads} & MADE_OF.get(target, {target}):
            raise InputError(
                f"effect '{effect.name}' reads {listed(effect.reads)}, of which the target "
                f"{target} is made; let it read other channels"
            )
        if names.count(effect.name) > 1:
            raise InputError(f"effect '{effect.name}' is named twice; name it once")


def slices_of(effects: Iterable[Effect]) -> list[slice]:
    """Return where the coefficients of each effect stand among those of all."""
    ends = [0, *accumulate(len(effect.terms) for effect in effects)]
    return [slice(first, last) for first, last in pairwise(ends)]


def traits_of(name: str) -> Traits:
    """Return the traits of an effect of the catalogue; one of the user's own claims none."""
    return CATALOGUE[name].traits if name in CATALOGUE else NO_TRAITS


def unit_in(unit: str, target: str, known_load: str | None) -> str:
    """Return a term's unit for a target: 'Nm·s/rad' for a torque is 'A·s/rad' for a current.

    `known_load`: channel of the load, if there is one. A factor of the load, '1', is 'A/Nm' for a
    current where the load is known in Nm. The load that a model makes itself, of its inertia and
    gravity, is in A as the target is: then the factor is a number. Effects of the torsion alone
    have their units in rad, 'rad/Nm', which stand as they are.
    """
    own = UNITS[target]
    if own == "Nm" or unit.startswith("rad"):
        return unit
    if unit == "1":
        return f"{own}/Nm" if known_load else unit
    return unit.replace("kg·m²", "Nm·s²/rad").replace("Nm", own)


def _named() -> str:
    return listed(CATALOGUE, most=len(CATALOGUE))


def _against(pair: str, pairs: tuple[str, ...]) -> str:
    """Which pair a harmonic belongs to, where the effect leaves a choice."""
    return f" ({pair.rsplit('_on_')[1].replace('_', ' ')})" if len(pairs) > 1 else ""
