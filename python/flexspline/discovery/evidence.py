"""Evidence for a candidate beside a model, what it has to exceed, and what holds held out.

What columns explain beside a model, and what they have to explain to be no chance.

The gain is the fall of squares over σ² when columns join the model: χ² with as many degrees of
freedom as there are columns where nothing is. Of m candidates, each in v forms, the best reaches
the χ² of probability α / (m v) by chance in a share α of all logs; that is the price that each
pays, so that effects with many columns or forms and those with few compete on equal terms.

What physics says of the coefficients makes chance smaller: those of one sign lie in a cone
(`cone_price`), a friction or a mass of a drive has one sign of two. And the orders of a series
become smaller: the first may pay alone, at the price of half a chance.

Evidence for coefficients that all have one sign: χ² of a cone.

Springs of a hysteresis all brake, so what they explain lies in the cone that their columns span
with coefficients of one sign. Chance finds less in a cone than in the whole space: with G the
products of the columns and c ~ N(0, G) their pulls where nothing is there,

    P(gain > s) = Σ_j w_j P(χ²_j > s),     w_j: probability that j coefficients are not zero

(chi-bar squared). Columns that are alike span a narrow cone, in which nearly one is free. Source:
Silvapulle & Sen 2005, Constrained Statistical Inference, section 3.4.

How well the other folds foretell one, with how well they can know it counted.

A fold may go where no other fold went: a joint's angle, a temperature. There a fit to the others
says little, and its plain error would condemn every right effect. The density that it foretells,
N(X_f β, σ² (1 + X_f A⁻¹ X_fᵀ)), says how little. With A = G + Λ (products over σ², prior), b = Xᵀy,

    2 ln p(y_f | others) = m(all) − m(all but f),     m = bᵀ A⁻¹ b − ln |A|     (+ y_f alone)

Columns on trial have a prior: in columns of length one their coefficients have the mean square
gain / count. Source: Bishop 2006, Pattern Recognition and Machine Learning, section 3.5.

Every candidate stands in its best form beside a model, and a ripple pays for each order that it
takes, out of all that it may have.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, nnls
from scipy.special import chdtrc, chdtri, gammaln
from scipy.stats import chi2, norm

from flexspline.discovery.candidates import Candidate
from flexspline.discovery.flexible import Nameless
from flexspline.discovery.gram import (
    SINGULAR,
    Columns,
    Sheet,
    Table,
    Whitening,
    edges_of,
    inverse_of,
    left_by,
    solved,
    tabulated,
)
from flexspline.discovery.model import VARYING, Working, one_signed, solved_at
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.effects import Effect
from flexspline.fit.problem import Problem

__all__ = [
    "Columned",
    "Dictionary",
    "Evidence",
    "Fold",
    "HeldOut",
    "Offer",
    "columned",
    "cone_gain",
    "cone_price",
    "equivalent_t",
    "evidence_of",
    "foretold_gain",
    "gain_of",
    "held_out",
    "offers",
    "plain_rows",
    "price",
    "prior_of",
]

Array = NDArray[np.float64]

FIRST = {VARYING: 2}
"""Columns of the first order of a series."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What columns gain beside a model, in χ².

    `count`: columns that are seen. `signs`: see `one_signed`. `products`: of the columns (K, K),
    where their coefficients have one sign. `first`: gain of the first order alone, of a series.
    """

    gain: float
    count: int
    signs: int
    products: Array | None = None
    first: float | None = None

    def price(self, forms: float, rivals: int) -> float:
        """Return what the best of `rivals` in so many forms gains by chance in a share α of logs.

        Of a series, less what the first order gains above its price where that is more.
        """
        if self.products is not None:
            return cone_price(self.products, _share(forms, rivals), either=self.signs > 1)
        if self.first is not None:
            all_orders = price(self.count, 2.0 * forms, rivals)
            alone = price(min(self.count, 2), 2.0 * forms, rivals) + self.gain - self.first
            return min(all_orders, alone)
        if self.signs == 1 and self.count == 1:
            return float(chi2.isf(2.0 * _share(forms, rivals), 1))
        return price(self.count, forms, rivals)


def evidence_of(name: str, signs: int, left: Array, columns: Columns, raw: Array) -> Evidence:
    """Return what the columns of an effect gain of what a model leaves.

    `signs`: that its coefficients may all have, see `one_signed`. `left`: products (C + 1, C + 1)
    of all columns and the target, less what the model explains.
    `raw`: the squares of the columns before.
    """
    gain, seen = gain_of(left, columns, raw)
    if signs and seen == len(columns) > 1:
        products = left[np.ix_(columns, columns)]
        gain = cone_gain(products, left[columns, -1], either=signs > 1)
        return Evidence(gain, seen, signs, products)
    first = gain_of(left, columns[: FIRST[name]], raw)[0] if name in FIRST else None
    return Evidence(gain, max(seen, 1), signs, None, first)


@cache  # a search asks for few of them, very often
def price(columns: int, forms: float, rivals: int) -> float:
    """Return the χ² that the best of `rivals` reaches by chance in a share α of all logs."""
    return float(chi2.isf(_share(forms, rivals), columns))


def _share(forms: float, rivals: int) -> float:
    return SETTINGS.alpha / max(rivals, 1) / max(forms, 1.0)


def equivalent_t(gain: float, columns: int) -> float:
    """Return the |t| of a normal number that is as surprising as a χ² of so many columns."""
    tail = float(chi2.sf(max(gain, 0.0), columns))
    if tail > TINY or gain == np.inf:
        return float(norm.isf(0.5 * tail))
    half = 0.5 * columns
    log_p = -0.5 * gain + (half - 1.0) * np.log(0.5 * gain) - gammaln(half)
    return float(np.sqrt(-2.0 * log_p - np.log(-np.pi * log_p)))


def gain_of(left: Array, columns: Columns, raw: Array) -> tuple[float, int]:
    """Squares over σ² that columns explain of what the model leaves, and how many are seen."""
    scale = np.sqrt(np.maximum(raw[columns], TINY))
    products = left[np.ix_(columns, columns)] / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(products)
    least = max(SINGULAR / SETTINGS.negligible, SINGULAR * float(values.max(initial=0.0)))
    seen = values > least
    along = vectors[:, seen].T @ (left[columns, -1] / scale)
    return float(np.sum(along**2 / values[seen])), int(seen.sum())


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


def cone_price(products: Array, share: float, either: bool) -> float:
    """Return the gain that chance exceeds in a share of all logs."""
    weights = _weights(products)
    numbers = np.arange(1, len(weights))
    share = 0.5 * share if either else share

    def above(gain: float) -> float:
        return float(weights[1:] @ chdtrc(numbers, gain)) - share

    highest = float(chdtri(len(products), share))
    return float(brentq(above, 0.0, highest)) if above(highest) < 0.0 < above(0.0) else highest


def _weights(products: Array) -> Array:
    """How often 0, 1, … K of the coefficients are positive where nothing is there, (K + 1,)."""
    count = len(products)
    scale = np.sqrt(np.maximum(np.diag(products), TINY))
    within = products / np.outer(scale, scale) + SINGULAR * np.eye(count)
    values, vectors = np.linalg.eigh(within)
    pulls = (_normal(count) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    weights = np.zeros(count + 1)
    for size in range(1, count + 1):
        for chosen in map(list, combinations(range(count), size)):
            beta = np.linalg.solve(within[np.ix_(chosen, chosen)], pulls[:, chosen].T)
            left = pulls.T - within[:, chosen] @ beta
            left[chosen] = 0.0
            weights[size] += np.sum((beta > 0.0).all(axis=0) & (left <= 0.0).all(axis=0))
    weights /= len(pulls)
    weights[0] = max(1.0 - weights.sum(), 0.0)
    return weights


@cache
def _normal(count: int) -> Array:
    return np.random.default_rng(0).normal(size=(round(SETTINGS.little * SETTINGS.rows), count))


FIRM = SETTINGS.singular
"""Of a column's squares: what keeps columns apart that depend on each other."""


def foretold_gain(table: Table, model: Columns, beside: Columns, gain: float) -> Array:
    """Return the rise (F,) of 2 ln p of each fold by columns beside a model, χ² where all is well.

    `gain`: of these columns beside the model, in χ².
    """
    both = np.concatenate([model, beside])
    ridge = np.append(np.full(len(model), FIRM), np.full(len(beside), prior_of(beside, gain)))
    return _foretold(table, both, ridge) - _foretold(table, model, ridge[: len(model)])


def prior_of(columns: Columns, gain: float) -> float:
    """Return the prior's share of the squares of each column."""
    return max(len(columns) / max(gain, 1.0), FIRM)


def _foretold(table: Table, columns: Columns, ridge: Array) -> Array:
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
    values = np.maximum(values, SETTINGS.little * FIRM)
    along = vectors.T @ (products[:-1, -1] / scale)
    return float(np.sum(along**2 / values) - np.sum(np.log(values)))


@dataclass(frozen=True, eq=False)
class Dictionary:
    """The table of a model beside candidates.

    `target`: what is explained. `model`: its columns, shapes' included; the first `linear` are of
    coefficients. `owners`: effect of each of them. `at`: columns of each effect that a candidate
    consists of.
    """

    target: str
    table: Table
    model: Columns
    linear: int
    owners: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    at: dict[Effect, Columns]

    def coefficients(self, name: str) -> Columns:
        """Columns of the free coefficients of one of the model's effects."""
        owners = np.array(self.owners[: self.linear])
        return np.asarray(self.model[: self.linear][owners == name])

    def without(self, names: Sequence[str]) -> Columns:
        """Columns of the model but those of some effects."""
        keep = [k for k, owner in enumerate(self.owners) if owner not in names]
        return self.model[keep]


@dataclass(frozen=True, eq=False)
class Columned:
    """The table of a model beside every effect that is looked at while it stands.

    One pass over the logs serves all questions about a model: what may join it, and what would
    take the place of each of its names.
    """

    target: str
    work: Working
    whitening: Whitening
    table: Table
    at: dict[Effect, Columns]

    def has(self, candidates: Sequence[Candidate]) -> bool:
        """Whether every column of these candidates is there."""
        return all(effect in self.at for c in candidates for effect in c.effects)

    def dictionary(self, candidates: Sequence[Candidate]) -> Dictionary:
        """Return the part of the table that these candidates need."""
        wanted = list(dict.fromkeys(e for c in candidates for e in c.effects))
        own = np.arange(len(self.work.owners()))
        columns = np.concatenate([own, *(self.at[effect] for effect in wanted)])
        at, first = {}, len(own)
        for effect in wanted:
            at[effect] = np.arange(first, first + len(effect.terms))
            first += len(effect.terms)
        return Dictionary(
            self.target,
            self.table.of(columns),
            own,
            len(self.work.free),
            tuple(self.work.owners()),
            tuple(candidates),
            at,
        )


def columned(
    problem: Problem, work: Working, wanted: Sequence[Effect], whitening: Whitening
) -> Columned:
    """Add up the products of the columns of a model and of effects beside it."""
    wanted = list(dict.fromkeys(wanted))
    at, first = {}, len(work.owners())
    for effect in wanted:
        at[effect] = np.arange(first, first + len(effect.terms))
        first += len(effect.terms)
    table = tabulated(problem, work.sheet(beside=wanted), whitening)
    return Columned(problem.target, work, whitening, table, at)


SHAPE_PRICE = 2.0  # χ² that a shape takes for itself when it is fitted


@dataclass(frozen=True)
class Offer:
    """A candidate in its best form beside a model: what it gains, and its price, in χ²."""

    effect: Effect
    columns: Columns
    gain: float
    price: float

    @property
    def net(self) -> float:
        """Gain above the price."""
        return self.gain - self.price


def offers(
    dictionary: Dictionary, model: Columns, rivals: int, *, signed: bool = True
) -> list[Offer]:
    """Return every candidate in its best form beside these columns of the model.

    `signed`: whether coefficients have the signs that physics gives them.
    """
    total = dictionary.table.total
    left = dictionary.table.without(model)
    raw = np.diag(total)
    made = [_offer(c, dictionary, left, raw, rivals, signed) for c in dictionary.candidates]
    return [offer for offer in made if offer is not None]


def _offer(
    candidate: Candidate,
    dictionary: Dictionary,
    left: Array,
    raw: Array,
    rivals: int,
    signed: bool,
) -> Offer | None:
    if candidate.atoms:
        found = [_orders(v, atoms, dictionary, left, raw, rivals)
                 for v, atoms in zip(candidate.variants, candidate.atoms, strict=True)]  # fmt: skip
    else:
        forms = 0.5 * (1 + len(candidate.variants))
        signs = one_signed(candidate.name, dictionary.target) if signed else 0
        tried = [(v, evidence_of(v.name, signs, left, dictionary.at[v], raw))
                 for v in candidate.variants]  # fmt: skip
        best, told = max(tried, key=lambda pair: pair[1].gain)
        cost = told.price(forms, rivals) + SHAPE_PRICE * (forms > 1.0)
        found = [Offer(best, dictionary.at[best], told.gain, cost)]
    return max(found, key=lambda offer: offer.net, default=None)


def _orders(
    variant: Effect,
    atoms: tuple[Effect, ...],
    dictionary: Dictionary,
    left: Array,
    raw: Array,
    rivals: int,
) -> Offer:
    """Take the orders of a ripple effect one after the other, as long as one pays its price."""
    chosen: list[Effect] = []
    columns, gain, cost = np.empty(0, dtype=np.intp), 0.0, 0.0
    each = price(2, len(atoms), rivals)
    while len(chosen) < len(atoms):
        trials = []
        for atom in (a for a in atoms if a not in chosen):
            both = np.concatenate([columns, dictionary.at[atom]])
            if not chosen or _parted(left, both, raw):
                trials.append((gain_of(left, both, raw)[0], atom, both))
        if not trials:
            break
        reached, atom, both = max(trials, key=lambda trial: trial[0])
        if chosen and reached - gain < each:
            break
        chosen.append(atom)
        columns, gain, cost = both, reached, cost + each
    harmonics = [h for atom in chosen for h in atom.harmonics]
    return Offer(variant.with_orders(harmonics), columns, gain, cost)


def _parted(left: Array, columns: Columns, raw: Array) -> bool:
    """Whether every mix of these columns keeps a share of its squares beside the model."""
    scale = np.sqrt(np.maximum(raw[columns], TINY))
    products = left[np.ix_(columns, columns)] / np.outer(scale, scale)
    return float(np.linalg.eigvalsh(products)[0]) >= SETTINGS.negligible


BESIDE = "functions without a name"


@dataclass(frozen=True, eq=False)
class Fold:
    """Rows [first, last) of a run, and the coefficients (P,) of the fit that never saw them."""

    run: int
    first: int
    last: int
    coefficients: Array


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Fits to all folds but one, and what they leave of that one.

    `betas`: coefficients (C,) of the columns of `sheet` without each fold. `mean_square`: what they
    leave, of the rows that the sums hold. `spread`: mean square by which the coefficients'
    uncertainty moves the prediction; large where a fold goes where no other went. `squares`: what
    is left over σ² once filtered as the noise is, in χ².
    """

    problem: Problem
    work: Working
    sheet: Sheet
    betas: tuple[Array, ...]
    mean_square: float
    spread: float
    squares: float

    @cached_property
    def residuals(self) -> tuple[Array, ...]:
        """(N,) of each run, NaN where a row does not count."""
        return tuple(self.sheet.left_over(self.problem, self.betas))

    @cached_property
    def folds(self) -> tuple[Fold, ...]:
        """The folds, in order, each with the fit that never saw it."""
        return tuple(_folds(self.problem, self.work, self.betas))

    @property
    def rmse(self) -> float:
        """In the unit of the target, of all rows that count."""
        counted = (np.isfinite(part) for part in self.residuals)
        parts = [part if c.all() else part[c] for part, c in
                 zip(self.residuals, counted, strict=True)]  # fmt: skip
        squares = sum(float(part @ part) for part in parts)
        return float(np.sqrt(squares / sum(map(len, parts))))

    def worse_than(self, other: HeldOut, factor: float) -> bool:
        """Whether the error exceeds another's by a factor, beyond what is not known."""
        unknown = max(self.spread - other.spread, 0.0)
        return self.mean_square - unknown > factor**2 * other.mean_square


def held_out(
    problem: Problem, work: Working, whitening: Whitening, beside: Sequence[Nameless] = ()
) -> HeldOut:
    """Leave out one fold after the other and fit the coefficients to the rest; shapes stay.

    What was named is drawn towards nothing as far as the evidence for it is weak: where a fold
    goes beyond the others, free coefficients run wild.

    `beside`: functions without a name that are fitted too. Columns that no other fold sees
    contribute nothing.
    """
    sheet = work.sheet(bends=False, functions=beside)
    table = tabulated(problem, sheet, whitening)
    every, total = np.arange(len(table.total) - 1), table.total
    drawn = np.diag(np.diag(total) * _drawn(work, total, len(every)))
    others = [total - fold + drawn for fold in table.folds]
    betas = [solved(products, every) for products in others]
    plain, size = table, whitening.variance
    if whitening.order:  # the rows as they are, which only the filter hides
        size = 1.0
        plain = tabulated(problem, sheet, Whitening(np.ones(1), size, problem.decimation))
    moved = [size * np.sum(inverse_of(products) * own[:-1, :-1])
             for products, own in zip(others, plain.folds, strict=True)]  # fmt: skip
    left = [size * _squares(own, beta) for own, beta in zip(plain.folds, betas, strict=True)]
    rows = int(np.sum(plain.rows))
    return HeldOut(
        problem,
        work,
        sheet,
        tuple(betas),
        mean_square=max(float(np.sum(left)), 0.0) / rows,
        spread=float(np.sum(moved)) / rows,
        squares=sum(_squares(fold, beta) for fold, beta in zip(table.folds, betas, strict=True)),
    )


def _squares(products: Array, beta: Array) -> float:
    """What is left of the target of products [columns, y] by coefficients."""
    both = np.append(-beta, 1.0)
    return float(both @ products @ both)


def plain_rows(problem: Problem, work: Working) -> Whitening:
    """Rows as `fit` takes them, for what users see; σ² is what this model leaves.

    Its names count as given here: what physics says of their size is weighed by σ².
    """
    rows = Whitening(np.ones(1), 1.0, problem.decimation)
    _, squares = solved_at(problem, replace(work, base=len(work.effects)), rows)
    count = sum(len(at) for run in problem.runs for at in rows.taken(run))
    whole = sum(float(run.target @ run.target) for run in problem.runs)
    return replace(rows, variance=max(squares, SETTINGS.singular**2 * whole, TINY) / max(count, 1))


def _folds(problem: Problem, work: Working, betas: Sequence[Array]) -> Iterator[Fold]:
    """Each fold with all coefficients of the model that never saw it."""
    count, solutions = len(work.free), iter(betas)
    for number in range(len(problem.runs)):
        for first, last in pairwise(edges_of(problem, number)):
            values = work.coefficients.copy()
            values[work.free] = next(solutions)[:count]
            yield Fold(number, int(first), int(last), values)


def _drawn(work: Working, total: Array, count: int) -> Array:
    """Prior of each column as a share of its squares, (count + 1,): none for the base's."""
    owners = [work.owners()[k] for k in range(len(work.free))]
    named = {e.name for e in work.named}
    labels = np.array(owners + [BESIDE] * (count - len(owners)))
    share = np.zeros(count + 1)
    for label in (name for name in dict.fromkeys(labels.tolist()) if name in {*named, BESIDE}):
        mine, rest = np.flatnonzero(labels == label), np.flatnonzero(labels != label)
        gain, _ = gain_of(left_by(total, rest), mine, np.diag(total))
        share[mine] = prior_of(mine, gain)
    return share
