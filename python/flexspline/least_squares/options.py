"""Options of a fit, and its parameters by name: fixed, bounded, or known beforehand.

A coefficient is called "effect.term", or by its effect alone where that has one term. A shape is
called "effect.shape", or by the shape alone; `direction_width` is one for all friction, and the
shape of the mesh is one for its compliance and for the temperature's effect on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import CATALOGUE, OF_MODEL, Effect, ShapeInfo
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.formatting import short_names
from flexspline.logs.log import MOST, given_number

if TYPE_CHECKING:
    from flexspline.logs.log import Log

__all__ = [
    "SHARED",
    "Bounds",
    "Constraints",
    "FitOptions",
    "Given",
    "MotionOptions",
    "ShapeParameter",
    "bounds_of",
    "coefficient_names",
    "constraints_of",
    "given_of",
    "pair_of",
    "require_given",
    "require_robust",
    "resolve",
    "shapes_of",
]

Array = NDArray[np.float64]
Bounds = tuple[float | None, float | None]

SHARED = tuple(dict.fromkeys(s.name for info in CATALOGUE.values() for s in info.shapes if s.owner))
"""Shapes of which a model has one: what it has is taken."""


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """Options of `fit` that few calls need.

    Parameters
    ----------
    bandwidth : Hz, -3 dB to which the motion of the output is smoothed before rows read it. None:
        the runs tell how noisy each channel is, and noisy ones are smoothed to what tells them
        best (`Fit.inputs`); exact ones are read as recorded. ``float("inf")``: all channels are
        read as recorded, whatever their noise.
    robust : "huber" weighs down outliers and pushes [HuberRonchetti2009]; None does not.
    per_run : terms of which each run has its own coefficient while it shares all others, by
        "effect.term", or by the effect for all its terms: ("offset",) for zeros that differ,
        ("gravity", "inertia") for payloads. See `Fit.between_runs` and
        `least_squares/per_run_terms.py`.
    offset_per_run : the same as "offset" among `per_run`.
    simulation, simulated_torque : what any simulator predicts of the target, as for `compare`; the
        effects are fitted to what it lacks, and the model corrects it.
    threads : for the sums over the logs.
    progress : show what is being done on standard error.

    Raises
    ------
    InputError
        Where robust is something else.
    """

    bandwidth: float | None = None
    robust: str | None = None
    offset_per_run: bool = False
    per_run: str | Sequence[str] = ()
    simulation: Log | Sequence[Log] | None = None
    simulated_torque: str | None = None
    threads: int = 1
    progress: bool = False

    def __post_init__(self) -> None:
        require_robust(self.robust)


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """Options of `fit_motion` that few calls need.

    Parameters
    ----------
    free_controller : fields of the servo's law that are fitted too, of "torque" and "back_emf".
    starts : descents: from the regression, from where short pieces of the runs are missed least,
        and the others around the regression by `seed`.
    folds : every `folds`-th run is left out in turn (of fewer runs, as many blocks of each); what
        the fits without find is within the intervals.
    seed : of the starts.
    bandwidth : as for `FitOptions`, of the regression that comes first and of what the torque is
        predicted from; the motion is compared as it is.
    robust : "huber" weighs down outliers in the regression that comes first; None does not.
    threads : that simulations are shared among.
    progress : show what is being done on standard error.

    Raises
    ------
    InputError
        Where starts, folds or robust are something else.
    """

    free_controller: str | Sequence[str] = ()
    starts: int = 8
    folds: int = 4
    seed: int = 0
    bandwidth: float | None = None
    robust: str | None = None
    threads: int = 1
    progress: bool = False

    def __post_init__(self) -> None:
        require_robust(self.robust)
        for name, least in (("starts", 1), ("folds", 2)):
            value = getattr(self, name)
            if not isinstance(value, int) or value < least:
                raise InputError(f"{name} is {value!r}; give a whole number from {least} up")


def require_robust(robust: str | None) -> None:
    """Refuse weights that do not exist."""
    if robust not in (None, "huber"):
        raise InputError(f"robust is {robust!r}; give 'huber' or None")


@dataclass(frozen=True)
class ShapeParameter:
    """A shape and the effects that share it (by number)."""

    name: str
    info: ShapeInfo
    effects: tuple[int, ...]

    def value(self, effects: Sequence[Effect]) -> float:
        return effects[self.effects[0]].shapes[self.info.name]

    def set(self, effects: Sequence[Effect], value: float) -> tuple[Effect, ...]:
        """Return the effects with this shape replaced in all that share it."""
        changed = list(effects)
        for number in self.effects:
            changed[number] = changed[number].with_shapes(**{self.info.name: value})
        return tuple(changed)


@dataclass(frozen=True, eq=False)
class Constraints:
    """What is known of the coefficients beforehand; NaN where nothing is.

    All (P,), in the units of the coefficients. `held`: value that is not fitted.
    """

    held: Array
    lower: Array
    upper: Array
    prior: Array
    prior_error: Array

    @property
    def free(self) -> NDArray[np.intp]:
        """Numbers of the coefficients that are fitted."""
        return np.flatnonzero(np.isnan(self.held))

    @property
    def bounded(self) -> bool:
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())

    @property
    def informed(self) -> bool:
        """Whether there is a prior."""
        return bool(np.isfinite(self.prior).any())


@dataclass(frozen=True)
class Given:
    """What is known or wanted of the parameters beforehand, by name, in their units."""

    fixed: Mapping[str, float]
    bounds: Mapping[str, Bounds]
    priors: Mapping[str, tuple[float, float]]
    robust: bool


def coefficient_names(
    effects: Sequence[Effect], runs: Sequence[str] = (), own: Sequence[str] = ()
) -> list[str]:
    """Return "effect.term" of every coefficient, in the order of the columns.

    `own`: terms of which each of the `runs` has its own; these come last, as "effect.term.run", or
    "effect.run" where the only term is called as its effect.
    """
    names = [f"{effect.name}.{term.name}" for effect in effects for term in effect.terms]
    mine = [name for name in own if name in names]
    names = [name for name in names if name not in mine]
    for k, run in enumerate(runs):
        twice = f" ({k + 1})" if runs.count(run) > 1 else ""
        names += [f"{short_names(name)}.{run}{twice}" for name in mine]
    return names


def shapes_of(effects: Sequence[Effect]) -> list[ShapeParameter]:
    """Return the shapes that can be fitted, those that effects share once."""
    found: dict[str, ShapeParameter] = {}
    present = {effect.name for effect in effects}
    for number, effect in enumerate(effects):
        for info in effect.fitted_shapes:
            owner = info.owner if info.owner in present else effect.name
            name = info.name if info.owner == OF_MODEL else f"{owner}.{info.name}"
            users = found[name].effects if name in found else ()
            found[name] = ShapeParameter(name, info, (*users, number))
    return list(found.values())


def resolve(name: str, known: Sequence[str], what: str, others: Sequence[str] = ()) -> int:
    """Return which parameter is meant by "effect.term", or by one part of it if that is unique.

    `others`: names that might have been meant, for the error.
    """
    if name in known:
        return list(known).index(name)
    near = [i for i, full in enumerate(known) if name in full.split(".", 1)]
    if len(near) == 1:
        return near[0]
    if near:
        raise InputError(f"{what}: '{name}' may be {listed(known[i] for i in near)}; say which")
    raise InputError(
        f"{what}: there is no parameter '{name}'{did_you_mean(name, [*known, *others])}; "
        f"the model has {listed([*known, *others])}"
    )


def constraints_of(
    names: Sequence[str],
    fixed: Mapping[str, float],
    bounds: Mapping[str, Bounds],
    priors: Mapping[str, tuple[float, float]],
    shapes: Sequence[str] = (),
) -> Constraints:
    """Return what is known of the coefficients of these names, from the options of a fit.

    `shapes`: names of the shapes, which an error mentions too.

    Raises
    ------
    InputError
        For an unknown or ambiguous name, values that are not finite, an empty interval, an error
        that is not positive, or a coefficient that is fixed and more.
    """
    made = Constraints(*(np.full(len(names), np.nan) for _ in range(5)))
    for name, value in fixed.items():
        made.held[resolve(name, names, "fixed", shapes)] = given_number(value, f"fixed: {name}")
    for name, limits in bounds.items():
        at = _not_fixed(resolve(name, names, "bounds", shapes), made, f"bounds: {name}")
        low, high = pair_of(limits, f"bounds: {name}", "(low, high)")
        made.lower[at] = -np.inf if low is None else _limit(low, f"bounds: {name}")
        made.upper[at] = np.inf if high is None else _limit(high, f"bounds: {name}")
        if not made.lower[at] < made.upper[at]:
            raise InputError(f"bounds: {name} from {low} to {high} is empty; give low < high")
    for name, known in priors.items():
        at = _not_fixed(resolve(name, names, "priors", shapes), made, f"priors: {name}")
        value, error = pair_of(known, f"priors: {name}", "(value, standard error)")
        if not given_number(error, f"priors: the error of {name}") >= 1.0 / MOST:
            least = "zero" if error <= 0.0 else f"{1.0 / MOST:g}"
            raise InputError(f"priors: the error of {name} is {error}; give one above {least}")
        made.prior[at], made.prior_error[at] = given_number(value, f"priors: {name}"), error
    return made


def _limit(value: float, what: str) -> float:
    """One end of an interval, which may be open: infinite."""
    return value if np.isinf(value) else given_number(value, what)


def _not_fixed(at: int, made: Constraints, what: str) -> int:
    if not np.isnan(made.held[at]):
        raise InputError(f"{what} is fixed already; leave out one of the two")
    return at


def bounds_of(lower: float, upper: float) -> Bounds | None:
    """Return bounds as a fit takes them of ends that may not be finite; None where neither is."""
    low, high = (float(end) if np.isfinite(end) else None for end in (lower, upper))
    return None if low is None and high is None else (low, high)


def pair_of(pair: Any, what: str, form: str) -> tuple[Any, Any]:
    """Return two values, or refuse what are not two and say which `form` they have."""
    if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
        raise InputError(f"{what} is {pair!r}; give {form}")
    return pair[0], pair[1]


def given_of(
    names: Sequence[str], shapes: Sequence[ShapeParameter], given: Given
) -> tuple[Constraints, dict[str, float], dict[str, tuple[float, float]]]:
    """Return what is known of the coefficients, values of held shapes, and limits of others.

    Raises
    ------
    InputError
        For a name that is no parameter, a value that is none, or bounds that leave nothing.
    """
    fixed, held = _split(given.fixed, shapes)
    bounds, limits = _split(given.bounds, shapes)
    held = {name: given_number(value, f"fixed: {name}") for name, value in held.items()}
    priors, shape_priors = _split(given.priors, shapes)
    for name in shape_priors:
        raise InputError(f"priors: {name} is a shape, which takes no prior; fix or bound it")
    known = constraints_of(names, fixed, bounds, priors, [shape.name for shape in shapes])
    return known, held, {s.name: _limits(s, limits[s.name]) for s in shapes if s.name in limits}


def require_given(effects: Sequence[Effect], given: Given) -> None:
    """Refuse what a fit of these effects would refuse of `given`, before any run is read.

    Of a ripple whose orders the runs are to tell, nobody knows the parameters yet: then nothing is
    refused here.
    """
    if not any(e.ripple and not e.harmonics for e in effects):
        given_of(coefficient_names(effects), shapes_of(effects), given)


def _split(
    options: Mapping[str, Any], shapes: Sequence[ShapeParameter]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split options by name into those of coefficients and those of shapes (by full name)."""
    known = [shape.name for shape in shapes]
    coefficients: dict[str, Any] = {}
    found: dict[str, Any] = {}
    for name, value in options.items():
        matches = [full for full in known if full == name or full.split(".")[-1] == name]
        if len(matches) == 1:
            found[matches[0]] = value
        else:
            coefficients[name] = value
    return coefficients, found


def _limits(shape: ShapeParameter, limits: Bounds) -> tuple[float, float]:
    bounds = pair_of(limits, f"bounds: {shape.name}", "(low, high)")
    low = max(shape.info.lower, shape.info.lower if bounds[0] is None else bounds[0])
    high = min(shape.info.upper, shape.info.upper if bounds[1] is None else bounds[1])
    if not low < high:
        raise InputError(
            f"bounds: {shape.name} from {bounds[0]} to {bounds[1]} leaves nothing of "
            f"{shape.info.lower} to {shape.info.upper} {shape.info.unit}; give a wider range"
        )
    return low, high
