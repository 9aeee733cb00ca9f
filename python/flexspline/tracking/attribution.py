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
What is then told is known, and another change is sought beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

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
from flexspline.tracking.history import History, cause_of

__all__ = ["Told", "detected", "drawn", "moved", "weights_of"]

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
    width = len(history.names)
    made = np.eye(width)
    told = np.isfinite(history.values).all(axis=1)
    told &= np.isfinite(history.covariance).all(axis=(1, 2))
    if width < 2 or told.sum() < LEAST_SESSIONS:
        return made
    values = history.values[told]
    measured = np.median(history.covariance[told], axis=0)
    scale = np.sqrt(np.diag(measured))
    if not scale.all():
        return made
    both = measured / np.outer(scale, scale)
    for p in range(width):
        rows = [made[p], *(_beside_others(both, p, beyond) * scale[p] / scale for beyond in BEYOND)]
        spreads = _spread(values @ np.array(rows).T)
        best = int(np.argmin(spreads))
        if spreads[best] < CONFOUNDED * spreads[0]:
            made[p] = rows[best]
    return made


def _beside_others(correlation: Array, p: int, beyond: float) -> Array:
    """Weights (P,) of what is left of one parameter, where D is that share of C's diagonal."""
    others = np.flatnonzero(np.arange(len(correlation)) != p)
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
            change = self._blamed(self.history, shape, excess, count)
            if _is_told(_sizes(self.history, change)):
                self._know(change)
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
            before = [[*shapes] for shapes in self.known]
            self._know(first)
            if self.next_one():
                return True
            self.known = before
            self.found.remove(first)
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

    def _blamed(self, history: History, shape: Shape, excess: float, sessions: int) -> Told:
        causes, chances, parameters = _blamed(history, shape, self.known)
        needed = threshold(sessions, self.history.looked_at)
        own = self.weights[parameters[0]]
        others = _known_of(own, self.known)
        return Told(causes, chances, parameters, shape, own, needed + excess, needed, others)

    def _know(self, change: Told) -> None:
        self.found.append(change)
        for p in range(self.width):
            if cause_of(self.history.names[p]) in change.causes:
                self.known[p].append(change.shape)


def _settled(history: History, found: Sequence[Told]) -> list[Told]:
    """The changes, each beside all others; what only bends a larger one of its cause is of that."""
    beside = [replace(each, others=_others(history, each, found)) for each in found]
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


def _others(history: History, change: Told, found: Sequence[Told]) -> tuple[Shape, ...]:
    """Shapes of the other changes of parameters in whose series this one is seen."""
    seen = {cause_of(history.names[p]) for p in np.flatnonzero(change.weights)}
    shapes = (each.shape for each in found if each.shape != change.shape and seen & {*each.causes})
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
    """By how much a parameter changed with a shape: size and error, and what is left (S,)."""

    size: float
    error: float
    left: Array


def moved(history: History, p: int, shape: Shape, known: Sequence[Shape]) -> _Moved:
    """Return by how much a parameter changed with a shape, in the noise that fits it best."""
    left = np.full(len(history), np.nan)
    series, at = history.series(np.eye(len(history.names))[p])
    series = series.beside(*known)
    width = series.covariates.shape[1] + 1
    if len(at) < width + 2:
        return _Moved(0.0, np.inf, left)
    best: tuple[float, float, float, Array] | None = None
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
            error = float(np.sqrt(scale * max(inverse[-1, -1], 0.0)) / size[-1])
            best = likely, float(slopes[-1] / size[-1]), error, rest / np.sqrt(scale)
    assert best is not None
    left[at] = best[3]
    return _Moved(best[1], best[2] if best[2] > 0.0 else np.inf, left)


def _blamed(
    history: History, shape: Shape, known: Sequence[Sequence[Shape]]
) -> tuple[tuple[str, ...], tuple[float, ...], tuple[int, ...]]:
    """Causes that explain what happened at an onset, their chances, and what shows each best.

    A parameter that is known to have changed with this shape is free to, and explains no more.
    """
    made = {p: moved(history, p, shape, its) for p, its in enumerate(known) if shape not in its}
    seen = [p for p, each in made.items() if np.isfinite(each.error)]
    together = _correlation(history, [made[p].left for p in seen], seen)
    errors = np.array([made[p].error for p in seen])
    sizes = np.array([made[p].size for p in seen]) / errors
    inverse = np.linalg.inv(together)
    names = [cause_of(history.names[p]) for p in seen]
    causes = list(dict.fromkeys(names))
    evidence, shows = [], []
    for cause in causes:
        own = [k for k, name in enumerate(names) if name == cause]
        pulled = inverse[own] @ sizes
        own_sizes = np.linalg.solve(inverse[np.ix_(own, own)], pulled)
        evidence.append(0.5 * float(pulled @ own_sizes) - len(own))
        shows.append(seen[own[int(np.argmax(np.abs(own_sizes)))]])
    chances = np.exp(np.array(evidence) - max(evidence))
    chances /= chances.sum()
    order = np.argsort(-chances, kind="stable")
    least = (
        1
        if chances[order[0]] >= SURE
        else int(np.searchsorted(np.cumsum(chances[order]), SURE)) + 1
    )
    taken = order[:least]
    return (
        tuple(causes[k] for k in taken),
        tuple(float(chances[k]) for k in taken),
        tuple(shows[k] for k in taken),
    )


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
