"""Which parameter changed: one cause, one change, and "one of these" where the sessions cannot say.

Estimates that a run confounds are wrong together. So a change is sought where it is seen best, in
what is left of a parameter once the others are taken into account ([Hawkins1993]),

    z_p = y_p − C_po V_oo⁻¹ y_o,        V = C + D

C the measured covariance, D what differs from session to session beyond it; of a parameter that is
hardly confounded that is the parameter itself. Where an alarm is raised, the changes δ̂ of all
parameters at that onset have the covariance Σ, and a cause b, which moves its own parameters E_b
alone, has the evidence

    ln B_b = ½ |P_b δ̂|²_Σ − dim b,      P_b δ̂ = E_b (E_bᵀ Σ⁻¹ E_b)⁻¹ E_bᵀ Σ⁻¹ δ̂

(the penalty is Akaike's). A cause is named where it has 95 % of all; else those that share them.

What a cause b leaves, |δ̂|²_Σ − |P_b δ̂|²_Σ, is what the others did by themselves. Where that is more
than their errors, several changed at that onset: of all sets B of causes the one is told that has
the most

    ln B_B − (|B| − 1) h

with h the threshold of a change, for each further one is one more change that is told. Where
several parameters changed by one share κ of their levels ℓ, δ = κ ℓ, that is one number instead of
several; it is told where its evidence is beyond theirs by 95 to 5 and leaves nothing to a further
cause. A size is of the sum z_p beside the parameters that stayed; where the parameter by itself
contradicts it ([Hausman1978]), it is the parameter's own.

What is then told is known, and another change is sought beside it.

What explains a change of a parameter other than wear: a zero that moved, or another motion.

Amplitude A and quadrature Q of gravity are a vector. A mass that changed makes it longer or
shorter; a zero of the encoder that moved, or an axis that was mounted otherwise, turns it and
leaves its length. With (A, Q) before a change and (A', Q') at the last session

    angle = atan2(Q', A') − atan2(Q, A),        length changed by |(A', Q')| − |(A, Q)|

each with the errors of both, to first order.

A form that the model lacks, such as friction that grows towards standstill, goes into the terms
that it has, by how fast, how far or how loaded the sessions run; and friction that grew slows a
joint that is driven by a torque. So where the range of a channel changed with a parameter, at the
same sessions, either may be the cause; it is the likelier one where a level is now below zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import CATALOGUE
from flexspline.effects.causes import PRESLIDING
from flexspline.logs.channels import CHANNELS
from flexspline.part import PART_OF
from flexspline.tracking.changes import (
    INTERVAL,
    LEAST_SESSIONS,
    NOISES,
    Candidates,
    Posterior,
    Series,
    Shape,
    evidence_over_time,
    posterior_of,
    threshold,
)
from flexspline.tracking.history import AMPLITUDE, QUADRATURE, TOLD, WARMTHS, History, cause_of

__all__ = [
    "SCALE",
    "OtherRange",
    "Told",
    "Turned",
    "detected",
    "drawn",
    "moved",
    "moves",
    "negative",
    "other_ranges",
    "turned_by",
    "weights_of",
]

Array = NDArray[np.float64]

MOST_CHANGES: Final = 6
CONFOUNDED: Final = 0.5
"""Share of its variance that the others leave of a parameter, below which it is seen beside them.
At a quarter a change of one of two that are correlated by 0.8 is told later; at 0.8 noise of
hardly confounded parameters comes in."""
BEYOND: Final = (0.01, 0.1, 1.0)
"""Of the measured variance: what differs from session to session beyond it. That is taken which
leaves the least from session to session: it is not known well enough by itself."""
SMALL: Final = 0.05  # weight, in standard errors, below which another parameter is left out
SURE: Final = 0.95
BENDS: Final = 0.25
"""Of a change's size: another one of the same parameter that is smaller says that wear is no
straight line, and not that something else began. At half of it a bent course is told as two."""
SHRINKING: Final = 20.0  # sessions' worth of the measured correlation beside the residuals' own
FARTHEST: Final = 3.0  # standard deviations to which residuals count in a correlation
SCALE: Final = "scale of the torque"
"""The cause that moves all parameters by one share of their levels."""
CONTRADICTED: Final = 2.0
"""Standard errors between two estimates of one size from which one contradicts the other: 5 % where
none does, and those are told with the larger error, which holds for them too."""


@dataclass(frozen=True, eq=False)
class Told:
    """A change that is told.

    Parameters
    ----------
    causes : what it may be, the likeliest first; one where it is known.
    chances : of them, of all causes.
    parameters : the parameter of each cause that shows it best.
    shape : the likeliest.
    weights : (P,) of the series in which it is seen.
    evidence, needed : ln B, and what it must exceed.
    others : changes that are known beside it in that series.
    bends : those among them that only bend it: of the same cause, and much smaller.
    """

    causes: tuple[str, ...]
    chances: tuple[float, ...]
    parameters: tuple[int, ...]
    shape: Shape
    weights: Array
    evidence: float
    needed: float
    others: tuple[Shape, ...]
    bends: tuple[Shape, ...] = ()


def weights_of(history: History) -> Array:
    """Return (P, P): the weighted sum of parameters in which a change of each is sought."""
    return np.array([_row(history, p, ()) for p in range(len(history.names))])


def _row(history: History, p: int, moved_too: Sequence[int]) -> Array:
    """Weights (P,) of the sum in which a change of p is seen, beside all that did not move."""
    width = len(history.names)
    made: Array = np.eye(width)[p]
    told = np.isfinite(history.values).all(axis=1)
    told &= np.isfinite(history.covariance).all(axis=(1, 2))
    others = np.array([k for k in range(width) if k != p and k not in moved_too], dtype=int)
    if not len(others) or told.sum() < LEAST_SESSIONS:
        return made
    values = history.values[told]
    measured = np.median(history.covariance[told], axis=0)
    scale = np.sqrt(np.diag(measured))
    if not scale.all():
        return made
    both = measured / np.outer(scale, scale)
    rows = [made]
    rows += [_beside(both, p, others, beyond) * scale[p] / scale for beyond in BEYOND]
    spreads = _spread(values @ np.array(rows).T)
    best = int(np.argmin(spreads))
    return rows[best] if spreads[best] < CONFOUNDED * spreads[0] else made


def _beside(correlation: Array, p: int, others: NDArray[np.intp], beyond: float) -> Array:
    """Weights (P,) of p beside these others, where D is that share of C's diagonal."""
    inner = correlation[np.ix_(others, others)] + beyond * np.eye(len(others))
    row = np.zeros(len(correlation))
    row[others] = -np.linalg.solve(inner, correlation[others, p])
    row[np.abs(row) < SMALL] = 0.0
    row[p] = 1.0
    return row


def _spread(values: Array) -> Array:
    """Variance (K,) of values (S, K) from session to session, whatever few of them do."""
    return np.asarray((1.4826 * np.median(np.abs(np.diff(values, axis=0)), axis=0)) ** 2 / 2.0)


def detected(history: History) -> list[Told]:
    """Return the changes that a history tells, in the order of their evidence."""
    search = _Search(history)
    while len(search.found) < MOST_CHANGES and (search.next_one() or search.passed_one()):
        pass
    return _settled(history, search.found)


class _Search:
    """Changes told so far, and what is asked of each parameter beside them."""

    def __init__(self, history: History) -> None:
        self.history = history
        self.weights = weights_of(history)
        self.width = len(history.names)
        self.known: list[list[Shape]] = [[] for _ in range(self.width)]
        self.kept: dict[int, tuple[tuple[Shape, ...], float, Candidates | None]] = {}
        self.found: list[Told] = []
        self.spent: set[int] = set()

    def next_one(self) -> bool:
        """Tell the change of most evidence, if there is one."""
        while True:
            excess, best = max((self._asked(p), -p) for p in range(self.width))
            candidates = self.kept[-best][2]
            if excess <= 0.0 or candidates is None:
                return False
            shape, count = _likeliest(candidates), len(candidates.series.days)
            made = self._blamed(self.history, shape, excess, count)
            made = [each for each in made if _is_told(_sizes(self.history, each))]
            if made:
                self._know(made)
                return True
            self.spent.add(-best)

    def passed_one(self) -> bool:
        """Tell what could be told at an earlier session and is undone since, as by a repair.

        Alone it is no more evident at the last session; beside it what undid it has to be.
        """
        for p in range(self.width):
            series = self._series(p)
            if p in self.spent or len(series.days) < LEAST_SESSIONS:
                continue
            needed = [threshold(n, self.history.looked_at) for n in range(1, len(series.days) + 1)]
            over = evidence_over_time(series) - np.array(needed)
            at = int(np.argmax(over))
            self.spent.add(p)
            if over[at] <= 0.0:
                continue
            shape = _likeliest(Candidates.of(series.until(at + 1)))
            until = self.history.sessions(self.history.days <= series.days[at])
            first = self._blamed(until, shape, float(over[at]), at + 1)
            before, told = [[*shapes] for shapes in self.known], [*self.found]
            self._know(first)
            if first and self.next_one():
                return True
            self.known, self.found = before, told
        return False

    def _series(self, p: int) -> Series:
        series, _ = self.history.series(self.weights[p])
        return series.beside(*_known_of(self.weights[p], self.known))

    def _asked(self, p: int) -> float:
        """By how much the evidence of a parameter exceeds what is needed; kept."""
        beside = _known_of(self.weights[p], self.known)
        if p in self.kept and self.kept[p][0] == beside:
            return -np.inf if p in self.spent else self.kept[p][1]
        series = self._series(p)
        excess, candidates = -np.inf, None
        if len(series.days) >= LEAST_SESSIONS + len(beside):
            candidates = Candidates.of(series)
            needed = threshold(len(series.days), self.history.looked_at)
            excess = float(candidates.evidence[-1]) - needed
        self.kept[p] = (beside, excess, candidates)
        self.spent.discard(p)
        return excess

    def _blamed(self, history: History, shape: Shape, excess: float, sessions: int) -> list[Told]:
        """The changes that explain what all parameters did at an onset."""
        needed = threshold(sessions, self.history.looked_at)
        made = [
            Told(*each, shape, weights, needed + excess, needed, ())
            for each, weights in _blamed(history, shape, self.known, needed)
        ]
        return [_seen_best(history, each, [*made, *self.found]) for each in made]

    def _know(self, changes: Sequence[Told]) -> None:
        for change in changes:
            self.found.append(change)
            for p, name in enumerate(self.history.names):
                if moves(change, name) and change.shape not in self.known[p]:
                    self.known[p].append(change.shape)


def moves(change: Told, name: str) -> bool:
    """Whether a parameter is one of those that a change may have moved."""
    return SCALE in change.causes or cause_of(name) in change.causes


def _settled(history: History, found: Sequence[Told]) -> list[Told]:
    """The changes, each beside all others; what only bends a larger one of its cause is of that."""
    beside = [_seen_best(history, each, found) for each in found]
    draws = [_sizes(history, each) for each in beside]
    sizes = [abs(float(np.mean(each))) for each in draws]
    told = [k for k in range(len(found)) if _is_told(draws[k])]
    whole: dict[int, Told] = {}
    for k in sorted(told, key=lambda k: -sizes[k]):
        own = beside[k]
        larger = [
            j
            for j, each in whole.items()
            if each.causes == own.causes
            and each.parameters[0] == own.parameters[0]
            and sizes[k] < BENDS * sizes[j]
        ]
        if larger:
            j = larger[0]
            whole[j] = replace(whole[j], bends=(*whole[j].bends, own.shape))
        else:
            whole[k] = own
    return [*whole.values()]


def _seen_best(history: History, change: Told, found: Sequence[Told]) -> Told:
    """The change in the sum in which it is seen best, whatever others are told beside it."""
    if SCALE in change.causes:
        return replace(change, others=_others(history, change, found))
    p, plain = change.parameters[0], np.eye(len(history.names))[change.parameters[0]]
    at_once = [each for each in found if each is not change and _hides(history, change, each)]
    names = history.names
    too = [k for k, name in enumerate(names) if any(moves(each, name) for each in at_once)]
    own, alone = (
        replace(each, others=_others(history, each, found))
        for each in (replace(change, weights=row) for row in (_row(history, p, too), plain))
    )
    seen, by_itself = (
        _moved(history, each.weights, each.shape, each.others) for each in (own, alone)
    )
    beyond = np.sqrt(max(by_itself.error**2 - seen.error**2, 0.0))
    contradicted = abs(by_itself.size - seen.size) > CONTRADICTED * beyond
    is_told = abs(by_itself.size) > CONTRADICTED * by_itself.error
    return alone if contradicted and is_told else own


def _hides(history: History, change: Told, other: Told) -> bool:
    """Whether a change costs more beside another's shape than without the parameter it moved."""
    if change.shape == other.shape:
        return True
    shapes = np.array([change.shape.of(history.days), other.shape.of(history.days)])
    centred = shapes - shapes.mean(axis=1, keepdims=True)
    size = float(np.prod(np.linalg.norm(centred, axis=1)))
    return size > 0.0 and float(centred[0] @ centred[1] / size) ** 2 > 1.0 - CONFOUNDED


def _others(history: History, change: Told, found: Sequence[Told]) -> tuple[Shape, ...]:
    """Shapes of the other changes of parameters in whose series this one is seen."""
    names = [history.names[p] for p in np.flatnonzero(change.weights)]
    shapes = (
        each.shape
        for each in found
        if each.shape != change.shape and any(moves(each, name) for name in names)
    )
    return tuple(dict.fromkeys(shapes))


def _known_of(weights: Array, known: Sequence[Sequence[Shape]]) -> tuple[Shape, ...]:
    every = (shape for p in np.flatnonzero(weights).tolist() for shape in known[p])
    return tuple(dict.fromkeys(every))


def _likeliest(candidates: Candidates) -> Shape:
    by_candidate = candidates.weights.sum(axis=1)
    return candidates.shapes[int(np.argmax(by_candidate))]


def _sizes(history: History, change: Told) -> Array:
    """Draws (N,) of what a change has made by the last session."""
    made = drawn(history, change, np.random.default_rng(0))
    return np.asarray(made.changed(history.days[-1:])[:, 0])


def _is_told(sizes: Array) -> bool:
    """Whether a size is told from zero."""
    low, high = np.percentile(sizes, INTERVAL)
    return bool(low > 0.0 or high < 0.0)


def drawn(history: History, change: Told, rng: np.random.Generator) -> Posterior:
    """Draw the course of the series in which a change is seen."""
    series, _ = history.series(change.weights)
    series = series.beside(*change.others)
    return posterior_of(series, Candidates.of(series), rng)


@dataclass(frozen=True, eq=False)
class _Moved:
    """By how much a number changed with a shape: size and error, level before, rest (S,).

    `covariance`: (2, 2) of level and size.
    """

    size: float
    error: float
    level: float
    left: Array
    covariance: Array


def moved(history: History, p: int, shape: Shape, known: Sequence[Shape]) -> _Moved:
    """Return by how much a parameter changed with a shape, in the noise that fits it best."""
    return _moved(history, np.eye(len(history.names))[p], shape, known)


def _moved(history: History, weights: Array, shape: Shape, known: Sequence[Shape]) -> _Moved:
    """By how much a weighted sum (P,) of parameters changed with a shape."""
    left = np.full(len(history), np.nan)
    series, at = history.series(weights)
    series = series.beside(*known)
    width = series.covariates.shape[1] + 1
    if len(at) < width + 2:
        return _Moved(0.0, np.inf, 0.0, left, np.diag([np.inf, np.inf]))
    best: tuple[float, Array, Array, Array] | None = None
    for noise in NOISES:
        values, columns = series.white(noise, (shape,))
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        gram = (columns / size).T @ (columns / size)
        inverse = np.linalg.pinv(gram, rcond=1e-9, hermitian=True)
        slopes = inverse @ ((columns / size).T @ values)
        rest = values - (columns / size) @ slopes
        scale = max(float(rest @ rest) / max(len(at) - width, 1), series.floor)
        log_det = float(np.linalg.slogdet(series.covariance(noise))[1])
        likely = -0.5 * (len(at) * np.log(scale) + float(rest @ rest) / scale + log_det)
        if best is None or likely > best[0]:
            ends = np.ix_([0, -1], [0, -1])
            both = scale * inverse[ends] / np.outer(size, size)[ends]
            best = likely, slopes / size, both, rest / np.sqrt(scale)
    assert best is not None
    _, found, both, left[at] = best
    error = float(np.sqrt(max(both[1, 1], 0.0)))
    return _Moved(float(found[-1]), error if error > 0.0 else np.inf, float(found[0]), left, both)


@dataclass(frozen=True, eq=False)
class _Steps:
    """What K parameters did with a shape, in their standard errors.

    Parameters
    ----------
    seen : numbers of the parameters.
    names : causes of them.
    sizes, levels : (K,) of the change, and before it.
    errors : (K,) of the sizes, in the units of the parameters.
    inverse : (K, K) of the correlation of the sizes.
    needed : what each further cause has to explain.
    """

    seen: list[int]
    names: list[str]
    sizes: Array
    levels: Array
    errors: Array
    inverse: Array
    needed: float

    @property
    def causes(self) -> list[str]:
        return list(dict.fromkeys(self.names))

    def directions(self, cause: str) -> Array:
        """(K, D): what a cause may move."""
        if cause == SCALE:
            return self.levels[:, None]
        return np.eye(len(self.names))[:, [k for k, n in enumerate(self.names) if n == cause]]

    def explained(self, causes: Sequence[str]) -> tuple[float, Array]:
        """Evidence of a set of causes, and (K, causes) what each of them moved."""
        each = [self.directions(cause) for cause in causes]
        every = np.column_stack(each)
        pulled = every.T @ self.inverse @ self.sizes
        slopes = np.linalg.pinv(every.T @ self.inverse @ every, hermitian=True) @ pulled
        evidence = 0.5 * float(pulled @ slopes) - every.shape[1]
        parts = np.split(slopes, np.cumsum([one.shape[1] for one in each])[:-1])
        made = np.column_stack([one @ part for one, part in zip(each, parts, strict=True)])
        return evidence - self.needed * (len(causes) - 1), made

    def evidence(self, causes: Sequence[str]) -> float:
        return self.explained(causes)[0]

    def shows(self, causes: Sequence[str], cause: str) -> int:
        """The parameter that shows best what a cause of a set moved."""
        made = self.explained(causes)[1][:, list(causes).index(cause)]
        return self.seen[int(np.argmax(np.abs(made)))]

    def best(self) -> tuple[str, ...]:
        """The set of most evidence: causes are added, left and exchanged while that gains."""
        found: tuple[str, ...] = (max(self.causes, key=lambda cause: self.evidence([cause])),)
        while True:
            near = max(self._neighbours(found), key=self.evidence, default=found)
            if self.evidence(near) <= self.evidence(found):
                return found
            found = near

    def _neighbours(self, found: tuple[str, ...]) -> list[tuple[str, ...]]:
        less = [tuple(c for c in found if c != one) for one in found]
        free = [cause for cause in self.causes if cause not in found]
        more = [(*few, cause) for few in less for cause in free]
        more += [few for few in less if few]
        if len(found) < MOST_CHANGES:
            more += [(*found, cause) for cause in free]
        return more

    def is_scaled(self, found: Sequence[str]) -> bool:
        """Whether one share of all explains what several causes would have to."""
        if len(found) < 2:
            return False
        scaled = self.evidence([SCALE])
        surely = scaled > self.evidence(found) + np.log(SURE / (1.0 - SURE))
        return surely and all(self.evidence([SCALE, one]) <= scaled for one in self.causes)

    def scale(self, width: int) -> tuple[int, Array]:
        """The parameter that shows a common share best, and weights (P,) of the sum in which."""
        towards = self.inverse @ self.levels
        best = int(np.argmax(np.abs(self.levels)))
        shares = towards * self.levels[best] / float(self.levels @ towards)
        weights = np.zeros(width)
        weights[self.seen] = shares * self.errors[best] / self.errors
        return self.seen[best], weights

    def alternatives(self, found: Sequence[str], cause: str) -> tuple[list[str], list[float]]:
        """Causes that explain as well what one of a set does, and their chances, to 95 %."""
        others = [each for each in found if each != cause]
        free = [each for each in self.causes if each not in others]
        evidence = np.array([self.evidence([*others, each]) for each in free])
        chances = np.exp(evidence - evidence.max())
        chances /= chances.sum()
        order = np.argsort(-chances, kind="stable")
        sure = chances[order[0]] >= SURE
        least = 1 if sure else int(np.searchsorted(np.cumsum(chances[order]), SURE)) + 1
        return [free[k] for k in order[:least]], [float(chances[k]) for k in order[:least]]


def _steps(
    history: History, shape: Shape, known: Sequence[Sequence[Shape]], needed: float
) -> _Steps | None:
    """What all parameters did with a shape; None where none is known.

    A parameter that is known to have changed with this shape is free to, and explains no more.
    """
    made = {p: moved(history, p, shape, its) for p, its in enumerate(known) if shape not in its}
    seen = [p for p, each in made.items() if np.isfinite(each.error)]
    if not seen:
        return None
    together = _correlation(history, [made[p].left for p in seen], seen)
    errors = np.array([made[p].error for p in seen])
    return _Steps(
        seen,
        [cause_of(history.names[p]) for p in seen],
        np.array([made[p].size for p in seen]) / errors,
        np.array([made[p].level for p in seen]) / errors,
        errors,
        np.asarray(np.linalg.inv(together)),
        needed,
    )


_Blame = tuple[tuple[str, ...], tuple[float, ...], tuple[int, ...]]


def _blamed(
    history: History, shape: Shape, known: Sequence[Sequence[Shape]], needed: float
) -> list[tuple[_Blame, Array]]:
    """Of each change at an onset: its causes, their chances, what shows each best, and weights."""
    steps = _steps(history, shape, known, needed)
    if steps is None:
        return []
    found = steps.best()
    if _may_scale(history, steps) and steps.is_scaled(found):
        best, weights = steps.scale(len(history.names))
        if len(history.series(weights)[0].days) >= LEAST_SESSIONS:
            return [(((SCALE,), (1.0,), (best,)), weights)]
    made = []
    for cause in found:
        causes, chances = steps.alternatives(found, cause)
        others = [each for each in found if each != cause]
        shows = tuple(steps.shows([*others, one], one) for one in causes)
        made.append(((tuple(causes), tuple(chances), shows), np.eye(len(history.names))[shows[0]]))
    return made


def _may_scale(history: History, steps: _Steps) -> bool:
    """Whether a common share would be of the torque: of friction and of what is none.

    Friction by itself may change by one share, and so may what a joint carries.
    """
    if any(unit.startswith("rad") for unit in history.units):
        return False
    told = np.abs(steps.levels) > TOLD
    infos = [
        CATALOGUE.get(history.names[p].partition(".")[0])
        for p, is_told in zip(steps.seen, told, strict=True)
        if is_told
    ]
    friction = any(info is not None and info.traits.dissipative for info in infos)
    return friction and any(info is not None and info.carries_load for info in infos)


def _correlation(history: History, left: Sequence[Array], seen: Sequence[int]) -> Array:
    """Correlation of sizes: of residuals over the sessions, drawn to that of what was measured."""
    rows = np.clip(np.array(left), -FARTHEST, FARTHEST)
    rows = np.where(np.isfinite(rows), rows, 0.0)
    norms = np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
    own = (rows @ rows.T) / np.outer(norms, norms)
    covariance = history.covariance[:, seen][:, :, seen]
    told = np.isfinite(covariance).all(axis=(1, 2))
    measured = np.eye(len(seen))
    if told.any():
        middle = np.median(covariance[told], axis=0)
        values = history.values[told][:, seen]
        total = np.maximum(_spread(values), np.diag(middle)) if len(values) > 1 else np.diag(middle)
        scale = np.sqrt(np.maximum(total, 1e-300))
        measured = middle / np.outer(scale, scale)
        np.fill_diagonal(measured, 1.0)
    count = float(len(history))
    mixed = (count * own + SHRINKING * measured) / (count + SHRINKING)
    values, vectors = np.linalg.eigh(0.5 * (mixed + mixed.T))
    whole = (vectors * np.maximum(values, 1e-4)) @ vectors.T
    size = np.sqrt(np.diag(whole))
    return np.asarray(whole / np.outer(size, size))


WIDER: Final = 0.25
"""Of the wider of two ranges: by how much an end of it moves where sessions run differently."""
FOLLOWS: Final = 0.5
"""Share of the variance of a range's end, over the sessions, that a change explains."""
AT_ONCE: Final = 0.9
"""Of what the best step explains of a range's end: less, and it moved at another date."""


@dataclass(frozen=True)
class OtherRange:
    """A channel whose range changed with a parameter: (low, high) of sessions before and since."""

    channel: str
    unit: str
    before: tuple[float, float]
    since: tuple[float, float]

    @property
    def old(self) -> str:
        """What the sessions covered before."""
        return self._words(self.before)

    @property
    def new(self) -> str:
        """What they cover since."""
        return self._words(self.since)

    def _words(self, ends: tuple[float, float]) -> str:
        return f"{ends[0]:.3g} to {ends[1]:.3g} {self.unit}"


@dataclass(frozen=True)
class Turned:
    """By how much the direction of gravity turned, in degrees, with its standard error."""

    degrees: float
    error: float


def turned_by(history: History, change: Told) -> Turned | None:
    """Return by how much gravity turned with a change; None where its length is not known to stay.

    Parameters
    ----------
    history : with amplitude and quadrature, see `History.turned`.
    """
    effect, _, term = history.names[change.parameters[0]].partition(".")
    info = CATALOGUE.get(effect)
    names = [f"{effect}.{word}" for word in (AMPLITUDE, QUADRATURE)]
    if info is None or not info.carries_load or len(change.causes) > 1:
        return None
    if f"{effect}.{term}" not in names or not set(names) <= set(history.names):
        return None
    both = [moved(history, history.names.index(n), change.shape, change.others) for n in names]
    if not all(np.isfinite(each.error) for each in both):
        return None
    course = float(change.shape.of(history.days[-1:])[0])
    before = complex(*(each.level for each in both))
    after = before + course * complex(*(each.size for each in both))
    angle, length = float(np.angle(after / before)), abs(after) - abs(before)

    def error_of(at_first: complex, at_last: complex) -> float:
        """Of a number with these slopes over amplitude and quadrature."""
        slopes = [(at_last - at_first), course * at_last]
        parts = (np.array([s.real for s in slopes]), np.array([s.imag for s in slopes]))
        squares = [g @ each.covariance @ g for g, each in zip(parts, both, strict=True)]
        return float(np.sqrt(sum(squares)))

    length_error = error_of(before / abs(before), after / abs(after))
    error = error_of(1j * before / abs(before) ** 2, 1j * after / abs(after) ** 2)
    least = max(error, length_error / abs(after))  # a mass as large could hide in the latter
    if abs(length) > TOLD * length_error or abs(angle) < TOLD * least:
        return None
    return Turned(float(np.degrees(angle)), float(np.degrees(error)))


def other_ranges(history: History, change: Told, turned: bool) -> tuple[OtherRange, ...]:
    """Return the channels whose ranges changed where a parameter did, those that did most first.

    Temperature is none of them: it is accounted for. An angle whose zero moved (`turned`) has
    another range by that, and so has the load of a joint that carries another one.
    """
    info = CATALOGUE.get(change.causes[0].partition(".")[0].partition(",")[0])
    carries = info is not None and info.carries_load
    found = []
    for channel, ends in history.ranges.items():
        unit = CHANNELS[channel].unit if channel in CHANNELS else "Nm"
        if channel in WARMTHS or (turned and unit == "rad") or (carries and unit == "Nm"):
            continue
        each = _other_range(history, change, ends)
        if each is not None:
            share, before, since = each
            found.append((share, OtherRange(channel, unit, before, since)))
    return tuple(each for _, each in sorted(found, key=lambda pair: -pair[0]))


def _other_range(
    history: History, change: Told, ends: Array
) -> tuple[float, tuple[float, float], tuple[float, float]] | None:
    """By which share of a range it changed with a change, and what it was before and is since."""
    known = np.isfinite(ends).all(axis=1)
    days, ends = history.days[known], ends[known]
    course = change.shape.of(days)
    if len(days) < LEAST_SESSIONS or not np.ptp(course):
        return None
    half = 0.5 * course[-1]
    before, since = (np.median(ends[rows], axis=0) for rows in (course < half, course >= half))
    width = max(float(np.ptp(before)), float(np.ptp(since)))
    moves = np.abs(since - before)
    end = int(np.argmax(moves))
    if not moves[end] > WIDER * width:
        return None
    steps = [(days >= day).astype(np.float64) for day in np.unique(days)[1:]]
    best = max(_explained(step, ends[:, end]) for step in steps)
    if _explained(course, ends[:, end]) < max(FOLLOWS, AT_ONCE * best):
        return None
    low, high = before.tolist(), since.tolist()
    return float(moves[end]) / width, (low[0], low[1]), (high[0], high[1])


def _explained(course: Array, values: Array) -> float:
    """Share of the variance of values (S,) that a course (S,) explains."""
    both = np.array([course - course.mean(), values - values.mean()])
    size = float(np.prod(np.linalg.norm(both, axis=1)))
    return float(both[0] @ both[1] / size) ** 2 if size > 0.0 else 0.0


def negative(history: History, name: str, level: tuple[float, float]) -> str:
    """Return what a level below zero would be that no drive has, friction or inertia, or "".

    Beside presliding the level of Coulomb friction is a share, and has no sign.
    """
    effect = name.partition(".")[0]
    info = CATALOGUE.get(effect)
    if info is None or not info.traits.one_signed or len(info.terms) != 1:
        return ""
    if PART_OF.get(history.target) != "drive" or level[0] + TOLD * level[1] >= 0.0:
        return ""
    names = {each.partition(".")[0] for each in history.names}
    return "" if PRESLIDING in names else effect.rpartition("_")[2]
