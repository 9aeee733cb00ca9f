"""Evidence for a candidate beside a model: its Δχ², significance threshold, and held-out score.

The gain Δχ² is the decrease of the sum of squares over σ² when columns join the model: under the
null hypothesis χ² with as many degrees of freedom as there are columns. Of m candidates, each in v
forms, the best reaches the χ² of probability α / (m v) by chance in a share α of all logs; that is
the significance threshold of each, so that effects with many columns or forms and those with few
compete on equal terms. A single coefficient whose sign physics determines has half that chance. The
threshold of a ripple counts each order that it takes, out of all that it may have.

Springs of a hysteresis all brake: what they explain lies in the cone that their columns span with
coefficients of one sign. Chance explains less in a cone than in the whole space: with G the
products of the columns and c ~ N(0, G) their gradients under the null hypothesis,

    P(gain > s) = Σ_j w_j P(χ²_j > s),     w_j: probability that j coefficients are not zero

(chi-bar squared). Columns that are alike span a narrow cone, in which nearly one is free. Source:
[SilvapulleSen2005], Constrained Statistical Inference, section 3.4.

The held-out score of a fold includes the uncertainty of its prediction: a fold may reach an angle
or a temperature that no other has, where a plain error would reject every right effect. The other
folds predict the density N(X_f β, σ² (1 + X_f A⁻¹ X_fᵀ)). With A = G + Λ (products
over σ², prior), b = Xᵀy,

    2 ln p(y_f | others) = m(all) − m(all but f),     m = bᵀ A⁻¹ b − ln |A|     (+ y_f alone)

Columns on trial have a prior: in columns of length one their coefficients have the mean square
gain / count. Source: [Bishop2006], Pattern Recognition and Machine Learning, section 3.5.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, nnls
from scipy.special import gammaln
from scipy.stats import chi2, norm

from flexspline.discovery.candidates import Candidate, span_of, unseen
from flexspline.discovery.physics import level_of, one_signed
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import Effect
from flexspline.effects.causes import COULOMB, GRAVITY, LOAD_SCALES, OFFSET, OUTPUT_RIPPLE, STRIBECK
from flexspline.least_squares.problem import Problem, noise_of_load
from flexspline.regression.candidate_model import CandidateModel
from flexspline.regression.gram import (
    SINGULAR,
    TINY,
    Columns,
    Table,
    Whitening,
    gain_of,
    gains_of,
    left_by,
    scaled_products,
    tabulated,
)

__all__ = ["Dictionary", "Offer", "cone_gain", "cone_threshold", "dictionary_of", "equivalent_t",
           "held_out_gain", "offers", "threshold", "threshold_of"]  # fmt: skip

Array = NDArray[np.float64]

SHAPE_THRESHOLD = 2.0  # χ² that a shape takes for itself when it is fitted


@cache  # a search asks for few of them, very often
def threshold(columns: int, forms: float, rivals: int) -> float:
    """Return the χ² that the best of `rivals` in so many forms reaches by chance in a share α."""
    return float(chi2.isf(_share(forms, rivals), columns))


def _share(forms: float, rivals: int) -> float:
    return SETTINGS.alpha / max(rivals, 1) / forms


def threshold_of(name: str, target: str, products: Array, forms: float, rivals: int) -> float:
    """Return the threshold of an effect of some signs; `products`: (K, K) of columns, over σ²."""
    signs, count = one_signed(name, target), len(products)
    if signs and count > 1:
        return cone_threshold(products, _share(forms, rivals), signs > 1)
    return threshold(max(count, 1), 0.5 * forms if signs else forms, rivals)


def equivalent_t(gain: float, columns: int) -> float:
    """Return the |t| of a normal number that is as surprising as a χ² of so many columns."""
    tail = float(chi2.sf(max(gain, 0.0), columns))
    if tail > TINY or gain == np.inf:
        return float(norm.isf(0.5 * tail))
    half = 0.5 * columns
    log_p = -0.5 * gain + (half - 1.0) * np.log(0.5 * gain) - gammaln(half)
    return float(np.sqrt(-2.0 * log_p - np.log(-np.pi * log_p)))


def held_out_gain(table: Table, model: Columns, beside: Columns, gain: float) -> Array:
    """Return the rise (F,) of 2 ln p of each fold by columns beside a model, χ² where all is well.

    `gain`: of these columns beside the model, in χ².
    """
    both = np.concatenate([model, beside])
    prior = max(len(beside) / max(gain, 1.0), SINGULAR)  # of the squares of each column
    ridge = np.append(np.full(len(model), SINGULAR), np.full(len(beside), prior))
    return _held_out_rise(table, both, ridge) - _held_out_rise(table, model, ridge[: len(model)])


def _held_out_rise(table: Table, columns: Columns, ridge: Array) -> Array:
    total = table.total
    picked = np.append(columns, len(total) - 1)
    total, folds = total[np.ix_(picked, picked)], table.folds[:, picked][:, :, picked]
    scale = np.sqrt(np.maximum(np.diag(total)[:-1], TINY))
    whole = _mass(total, scale, ridge)
    return np.array([whole - _mass(total - fold, scale, ridge) for fold in folds])


def _mass(products: Array, scale: Array, ridge: Array) -> float:
    """bᵀ A⁻¹ b − ln |A|."""
    inside = products[:-1, :-1] / np.outer(scale, scale) + np.diag(ridge)
    values, vectors = np.linalg.eigh(inside)
    values = np.maximum(values, SETTINGS.little * SINGULAR)
    along = vectors.T @ (products[:-1, -1] / scale)
    return float(np.sum(along**2 / values) - np.sum(np.log(values)))


@dataclass(frozen=True, eq=False)
class Dictionary:
    """The table of a model beside candidates, and beside what else may be asked for.

    `target`: what is explained. `model`: its columns, shapes' included. `owners`: effect of each of
    them. `at`: columns of each effect that a candidate consists of, but for those that these runs
    do not show (`unseen`). `coulomb`: level of the model's Coulomb friction, 0 without.
    `simulated`: whether a simulation is the base, which may have too much of a friction.
    `noisy`: the table with what columns have in common with the noise of a load (`_noisy_table`).
    """

    target: str
    table: Table
    model: Columns
    owners: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    at: dict[Effect, Columns]
    coulomb: float = 0.0
    simulated: bool = False
    noisy: Table | None = None

    def by_noise(self, columns: Columns, model: Columns) -> float:
        """Twice what the noise of a known load gives columns beside a model, χ²: what gains less
        is most likely that.
        """
        return 2.0 * self.noisy.gain(columns, model) if self.noisy else 0.0

    @cached_property
    def raw(self) -> Array:
        """Squares of all columns and of the target, over σ²."""
        return np.diag(self.table.total)

    def of(self, candidates: Sequence[Candidate]) -> Dictionary | None:
        """The same for these candidates; None where a column of theirs is not there."""
        there = all(effect in self.at for c in candidates for effect in c.effects)
        return replace(self, candidates=tuple(candidates)) if there else None

    def own(self, name: str) -> Columns:
        """Columns of one of the model's effects."""
        return np.asarray(self.model[np.array(self.owners) == name])

    def without(self, names: Sequence[str]) -> Columns:
        """Columns of the model but those of some effects."""
        keep = [k for k, owner in enumerate(self.owners) if owner not in names]
        return self.model[keep]

    def gain(self, *names: str) -> float:
        """Squares over σ² that some effects of the model explain beside all others."""
        own = np.concatenate([self.own(name) for name in names])
        return self.table.gain(own, self.without(names))


def dictionary_of(
    problem: Problem, work: CandidateModel, wanted: Iterable[Effect], whitening: Whitening
) -> Dictionary:
    """Add up the products of the columns of a model and of effects beside it, in one pass."""
    wanted = list(dict.fromkeys(wanted))
    owners, span = tuple(work.owners()), span_of(problem)
    ends = len(owners) + np.cumsum([0, *(len(effect.terms) for effect in wanted)])
    own = {e: np.arange(a, b) for e, a, b in zip(wanted, ends, ends[1:], strict=False)}
    table = tabulated(problem, work.assembly(beside=wanted), whitening)
    every = [*owners, *(effect.name for effect in wanted for _ in effect.terms)]
    reading = {effect.name for effect in (*work.effects, *wanted) if "load" in effect.reads}
    return Dictionary(
        target=problem.target,
        table=table,
        model=np.arange(len(owners)),
        owners=owners,
        candidates=(),
        at={effect: np.delete(columns, unseen(effect, span)) for effect, columns in own.items()},
        coulomb=level_of(work, COULOMB),
        simulated=problem.simulated is not None,
        noisy=_noisy_table(table, every, reading, problem, whitening),
    )


def _noisy_table(
    table: Table,
    owners: Sequence[str],
    reading: Collection[str],
    problem: Problem,
    whitening: Whitening,
) -> Table | None:
    """Return the table with −V c, by which columns follow the noise of a load, for the target's.

    Least squares takes V / S of the load away where others tell it but for S of its squares: they
    know it better than its channel does. V² / S is gained by that, from nothing. V is that of all
    rows (`noise_of_load`), in χ²; c is the slope of a column over the load, 1 of a scale of it: the
    mean derivative of any function of a load that is about normal [Bussgang1952]. None where no
    column is the load, or its noise is not known.

    Parameters
    ----------
    owners : effect of each column, (C,). reading : effects that read the load.
    """
    load = next((k for k, name in enumerate(owners) if name in LOAD_SCALES), None)
    if load is None or not problem.scatter:
        return None
    rows, names = int(table.rows.sum()), np.array(owners)
    noise = noise_of_load(problem, whitening.denominator, whitening.decimation)
    beside = table.without(np.flatnonzero(names == OFFSET)[:1])  # as a candidate it is there again
    slopes = beside[load, :-1] / max(float(beside[load, load]), TINY)
    follows = np.where(np.isin(names, [*reading]), slopes, 0.0)
    total = table.total.copy()
    total[-1, :-1] = total[:-1, -1] = -rows * noise / whitening.variance * follows
    return Table(total[None], np.array([rows]))


@dataclass(frozen=True, eq=False)
class Offer:
    """A candidate in its best form beside a model: what it gains, and its threshold, in χ²."""

    effect: Effect
    columns: Columns
    gain: float
    threshold: float

    @property
    def net(self) -> float:
        """Gain above the threshold."""
        return self.gain - self.threshold


def offers(
    dictionary: Dictionary, model: Columns, *, plain: bool = False, only: str = ""
) -> list[Offer]:
    """Return every candidate in its best form beside these columns of the model.

    `plain`: several orders of the output for what one sine, gravity, leaves alone, unless they
    alone explain more than it and others. `only`: the name of the candidate that is asked for.
    """
    left = dictionary.table.without(model)
    by_sine = next((c for c in dictionary.candidates if c.name == GRAVITY), None)
    leaves = left
    if plain and by_sine is not None:
        sine = dictionary.at[by_sine.variants[0]]
        leaves = dictionary.table.without(np.concatenate([model, sine]))

    def best(candidate: Candidate) -> Offer:
        if not plain or by_sine is None or candidate.name != OUTPUT_RIPPLE:
            return _offer(candidate, dictionary, left)
        one = _offer(candidate, dictionary, left, most=1)
        beside, alone = (_offer(candidate, dictionary, rest) for rest in (leaves, left))
        gravity = _offer(by_sine, dictionary, left)
        if alone.net > max(one.net, beside.net + gravity.net):
            return alone
        return max(one, beside, key=lambda offer: offer.net)

    return [best(c) for c in dictionary.candidates if only in ("", c.name)]


def _offer(
    candidate: Candidate, dictionary: Dictionary, left: Array, most: int | None = None
) -> Offer:
    """A candidate in its best form; of a ripple `most` orders, or as many as exceed theirs."""
    rivals = len(dictionary.candidates)
    if candidate.atoms:
        made = [_orders(v, atoms, dictionary, left, most or len(atoms))
                for v, atoms in zip(candidate.variants, candidate.atoms, strict=True)]  # fmt: skip
        return max(made, key=lambda offer: offer.net)
    forms = 0.5 * (1 + len(candidate.variants))
    signs = one_signed(candidate.name, dictionary.target)
    side = dictionary.coulomb if candidate.name == STRIBECK else float(signs == 1)
    side = 0.0 if dictionary.simulated else side
    raw = dictionary.raw
    gains = {v: _gain(left, dictionary.at[v], raw, signs, side) for v in candidate.variants}
    variant = max(gains, key=lambda v: gains[v][0])
    (gain, seen), columns = gains[variant], dictionary.at[variant]
    if seen == len(columns):
        products = left[np.ix_(columns, columns)]
        cost = threshold_of(candidate.name, dictionary.target, products, forms, rivals)
    else:
        cost = threshold(max(seen, 1), forms, rivals)
    return Offer(variant, columns, gain, cost + SHAPE_THRESHOLD * (forms > 1.0))


def _gain(left: Array, columns: Columns, raw: Array, signs: int, side: float) -> tuple[float, int]:
    """What columns explain with the signs that physics allows, and how many are seen.

    A single coefficient has the sign of `side`, where that has one.
    """
    gain, seen = gain_of(left, columns, raw)
    if len(columns) == 1 and side * left[columns[0], -1] < 0.0:
        return 0.0, seen
    if not signs or seen < len(columns) or seen == 1:
        return gain, seen
    return cone_gain(left[np.ix_(columns, columns)], left[columns, -1], signs > 1), seen


def cone_gain(products: Array, pulls: Array, either: bool) -> float:
    """Squares that coefficients of one sign explain: the positive one, or `either`.

    `products`: (K, K) of the columns, over σ². `pulls`: (K,), products of columns and target.
    """
    scale = np.sqrt(np.maximum(np.diag(products), TINY))
    values, vectors = np.linalg.eigh(products / np.outer(scale, scale))
    seen = values > SINGULAR * max(float(values.max()), TINY)
    root = np.sqrt(values[seen])[:, None] * vectors[:, seen].T
    along = vectors[:, seen].T @ (pulls / scale) / np.sqrt(values[seen])
    sides = (along, -along) if either else (along,)
    return float(max(along @ along - nnls(root, side)[1] ** 2 for side in sides))


def cone_threshold(products: Array, share: float, either: bool) -> float:
    """Return the gain that chance exceeds in a share of all logs, with coefficients of one sign.

    `products`, `either`: as for `cone_gain`.
    """
    scale = np.sqrt(np.maximum(np.diag(products), TINY))
    alike = np.round(products / np.outer(scale, scale), 2)  # what is alike is asked again and again
    weights = np.array(_free(tuple(map(tuple, alike.tolist()))))
    share = 0.5 * share if either else share

    def above(gain: float) -> float:
        return float(weights[1:] @ chi2.sf(gain, np.arange(1, len(weights)))) - share

    return float(brentq(above, 0.0, chi2.isf(share, len(products))))


@lru_cache
def _free(alike: tuple[tuple[float, ...], ...]) -> tuple[float, ...]:
    """How often 0, 1, … K of the coefficients are positive where nothing is there, (K + 1,)."""
    values, vectors = np.linalg.eigh(np.array(alike))
    root = np.sqrt(np.maximum(values, SINGULAR))[:, None] * vectors.T
    count, draws = len(alike), SETTINGS.rows // SETTINGS.functions
    pulls = np.random.default_rng(0).normal(size=(draws, count))
    free = [np.count_nonzero(nnls(root, pull)[0]) for pull in pulls]
    return tuple((np.bincount(free, minlength=count + 1) / draws).tolist())


def _orders(
    variant: Effect, atoms: tuple[Effect, ...], dictionary: Dictionary, left: Array, most: int
) -> Offer:
    """Take up to `most` orders of a ripple, one after the other, while one gains its `threshold`
    and more than the form of the others may miss.
    """
    chosen, raw = list[Effect](), dictionary.raw
    columns, gain, cost = np.empty(0, dtype=np.intp), 0.0, 0.0
    each = threshold(2, len(atoms), len(dictionary.candidates))
    while len(chosen) < most:
        rest = [atom for atom in atoms if atom not in chosen]
        trials = np.array([[*columns, *dictionary.at[atom]] for atom in rest], dtype=np.intp)
        if chosen and rest:
            parted = _parted(left, trials, raw)
            rest = [atom for atom, apart in zip(rest, parted, strict=True) if apart]
            trials = trials[parted]
        if not rest:
            break
        best = int(_more(left, columns[None], trials[:, len(columns) :], raw).argmax())
        atom, both = rest[best], trials[best]
        reached, _ = gain_of(left, both, raw)
        if chosen and reached - gain < max(each, SETTINGS.form * reached):
            break
        chosen.append(atom)
        columns, gain, cost = both, reached, cost + each
        columns, gain = _exchanged(chosen, gain, atoms, dictionary, left)
    harmonics = [h for atom in chosen for h in atom.harmonics]
    return Offer(variant.with_orders(harmonics), columns, gain, cost)


def _exchanged(
    chosen: list[Effect],
    gain: float,
    atoms: tuple[Effect, ...],
    dictionary: Dictionary,
    left: Array,
) -> tuple[Columns, float]:
    """Exchange orders of `chosen` for others as long as that gains: over less than a turn the
    first is taken for those that are still to come."""
    columns, raw = np.concatenate([dictionary.at[atom] for atom in chosen]), dictionary.raw
    while len(chosen) > 1:
        rest = [atom for atom in atoms if atom not in chosen]
        if not rest:
            break
        own = np.array([dictionary.at[atom] for atom in chosen])
        others = np.array([dictionary.at[atom] for atom in rest])
        kept = np.array([np.delete(own, place, axis=0).ravel() for place in range(len(own))])
        gains = gains_of(left, kept, raw)[0][:, None] + _more(left, kept, others, raw)
        better = np.argwhere(gains > gain * (1.0 + SINGULAR))
        better = better[np.argsort(-gains[tuple(better.T)], kind="stable")]
        for place, news in better:
            own[place] = others[news]
            if _parted(left, own.reshape(1, -1), raw)[0]:
                break
            own[place] = dictionary.at[chosen[place]]
        else:
            break
        chosen[place], columns = rest[news], own.ravel()
        gain, _ = gain_of(left, columns, raw)
    return columns, gain


def _more(left: Array, kept: NDArray[np.intp], groups: NDArray[np.intp], raw: Array) -> Array:
    """What groups of columns (n, k) explain beside each of several sets (m, c): (m, n)."""
    count = kept.shape[1]
    behind = np.broadcast_to([*groups.ravel(), len(left) - 1], (len(kept), groups.size + 1))
    asked = np.column_stack([kept, behind])
    beside = left_by(left[asked[:, :, None], asked[:, None, :]], np.arange(count))
    places = count + np.arange(groups.size).reshape(groups.shape)
    return gains_of(beside, places, raw[asked[0]])[0]


def _parted(left: Array, groups: NDArray[np.intp], raw: Array) -> NDArray[np.bool_]:
    """Whether every mix of each group of columns (n, k) keeps a share of its squares, (n,)."""
    products, _ = scaled_products(left, groups, raw)
    return np.asarray(np.linalg.eigvalsh(products)[:, 0] >= SETTINGS.negligible)
