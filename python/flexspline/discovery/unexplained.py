"""What no name explains: functions of the channels that still gain beside a model.

Their products are made once for a noise: models come and go while a cause is looked for, the
functions stay.

Functions follow no wave or bump that is finer than they are, and slow noise takes it in. What comes
again at the same place in another run is no noise, whatever its form: `repeated` asks the nearest
neighbours [CoverHart1967].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import chi2, f

from flexspline.discovery.basis import (
    DIRECTION,
    LEAD,
    ROUND,
    BasisFunctions,
    Functions,
    channel_told,
    flexible_basis,
    values_of,
)
from flexspline.discovery.evidence import held_out_gain
from flexspline.discovery.settings import SETTINGS
from flexspline.least_squares.problem import Problem
from flexspline.regression.candidate_model import CandidateModel, HeldOut, fall_of
from flexspline.regression.gram import (
    SINGULAR,
    TINY,
    ColumnAssembly,
    Columns,
    Table,
    Whitening,
    edges_of,
    fold_blocks,
    gain_of,
    left_by,
    rows_of,
    solved,
    tabulated,
    thinned,
)

__all__ = ["ExplainableBound", "Leftover", "Repeated", "differing", "kept", "leftover_in",
           "leftover_of", "looked_at", "repeated"]  # fmt: skip

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

FUNCTIONS = "rows of functions"  # what a problem keeps of them


class ExplainableBound:
    """Functions of all channels and pairs of them, as a noise sees them.

    `tables`: all of them on few rows, and powers, of which each takes little evidence, on many.
    `problem`, `share`: of the first.
    """

    def __init__(self, problem: Problem, whitening: Whitening) -> None:
        self.whitening = whitening
        few = looked_at(problem)
        groups = flexible_basis(few)
        plain = [group for group in groups if group.plain]
        rivals = len(groups) + len(plain)
        many = _part(problem, round(SETTINGS.rows / SETTINGS.little))
        self.tables = (
            FunctionTable(few, groups, whitening, rows_of(few) / rows_of(problem), rivals),
            FunctionTable(many, plain, whitening, rows_of(many) / rows_of(problem), rivals),
        )
        self.problem, self.share, self.many = few, self.tables[0].share, many


class FunctionTable:
    """Some functions on some rows.

    `share`: of all rows that count. `rivals`: how many are asked for, here and elsewhere. `blocks`:
    products (C, C) over σ² of each of the `groups`.
    """

    def __init__(
        self,
        problem: Problem,
        groups: Sequence[BasisFunctions],
        whitening: Whitening,
        share: float,
        rivals: int,
    ) -> None:
        self.problem, self.groups, self.whitening = problem, groups, whitening
        self.share, self.rivals = share, rivals
        ends = np.cumsum([0, *(group.count for group in groups)])
        self.at = [slice(a, b) for a, b in pairwise(ends.tolist())]
        width = self.at[-1].stop + 1
        self.rows, self.columns = list[Rows](), list[Array]()
        self.folds: list[tuple[int, int, int]] = []
        for number, made in enumerate(_functions(problem, groups)):
            white, rows = whitening.stretches(made, width)
            self.rows.append(rows)
            self.columns.append(white[:, :-1])
            self.folds += [(number, a, b) for a, b in fold_blocks(problem, number, rows)]
        parts = [[self.part(fold, at) for fold in self.folds] for at in self.at]
        self.blocks = [self.over_noise(own, own).sum(axis=0) for own in parts]

    def part(self, fold: tuple[int, int, int], at: slice = slice(None)) -> Array:
        """Columns of some functions on the rows of a fold."""
        number, first, last = fold
        return self.columns[number][first:last, at]

    def over_noise(self, left: Sequence[Array], right: Sequence[Array]) -> Array:
        """Products over σ² of columns (n, A) and (n, B) of each fold: (F, A, B)."""
        both = zip(left, right, strict=True)
        return np.array([a.T @ b for a, b in both]) / self.whitening.variance

    def beside(self, work: CandidateModel) -> Overlap:
        """Return the functions beside the columns of a model, and beside what a smoother blurs."""
        blur = [run.blur for run in self.problem.runs]
        known = tuple(one for one in blur if one is not None)
        given = Functions(column=known) if len(known) == len(blur) else None
        assembly, made = work.assembly(given=given), []
        for number in range(len(self.problem.runs)):
            white, at = assembly.white(self.problem, self.whitening, number)
            made.append(white[np.searchsorted(at, self.rows[number])])
        owners = [*work.owners(), *([""] if given else [])]
        return Overlap(self, [made[n][first:last] for n, first, last in self.folds], owners)


Made = list[tuple[tuple[int, int], Array]]


def looked_at(problem: Problem) -> Problem:
    """The rows on which flexible functions are looked at."""
    return _part(problem, SETTINGS.rows)


def _part(problem: Problem, rows: int) -> Problem:
    return thinned(problem, rows, round(SETTINGS.little * SETTINGS.rows), LEAD)


def _functions(problem: Problem, groups: Sequence[BasisFunctions]) -> list[Made]:
    """Rows of all functions by stretch of each run; one noise after another asks for them."""
    kept: dict[Any, Any] = problem.kept
    stretches = [run.stretches for run in problem.runs]
    name = f"{FUNCTIONS}, {len(groups)}"
    if kept.get(name, (None,))[0] != stretches:
        assembly = ColumnAssembly((), np.empty(0), (), np.empty(0), Functions(tuple(groups)))
        numbers = range(len(problem.runs))
        kept[name] = stretches, [[*assembly.stretches(problem, number)] for number in numbers]
    made: list[Made] = kept[name][1]
    return made


class Overlap:
    """Functions beside a model's columns M: (n, M + 1) of each fold, the target last.

    `chosen`: groups of functions that were taken to the model.
    """

    def __init__(self, bound: FunctionTable, columns: list[Array], owners: Sequence[str]) -> None:
        self.bound, self.columns, self.chosen = bound, columns, list[int]()
        self.owners = np.array(owners, dtype=str)
        self._across = self._towards(columns)

    def take(self, group: int) -> None:
        """Take a group of functions to the model."""
        at = self.bound.at[group]
        more = self._towards([self.bound.part(fold, at) for fold in self.bound.folds])
        self._across = np.column_stack([self._across[:, :-1], more, self._across[:, -1]])
        self.chosen.append(group)

    def _towards(self, columns: Sequence[Array]) -> Array:
        """Products over σ² of all functions and some columns (n, K) of each fold: (C, K)."""
        every = [self.bound.part(fold) for fold in self.bound.folds]
        return np.asarray(self.bound.over_noise(every, columns).sum(axis=0))

    def _with(self, *more: int) -> list[Array]:
        """[Model, functions taken, and more, target] of each fold."""
        at = [self.bound.at[group] for group in (*self.chosen, *more)]
        return [
            np.column_stack([own[:, :-1], *(self.bound.part(fold, a) for a in at), own[:, -1]])
            for fold, own in zip(self.bound.folds, self.columns, strict=True)
        ]

    def gains(self) -> list[tuple[float, int]]:
        """Squares over σ² that each group explains beside the model, and columns seen."""
        own, bound, across = self._with(), self.bound, self._across
        inside = bound.over_noise(own, own).sum(axis=0)
        scale = np.sqrt(np.maximum(np.diag(inside)[:-1], TINY))
        products = inside[:-1, :-1] / np.outer(scale, scale)
        inverse = np.linalg.pinv(products, SINGULAR, hermitian=True)
        towards = inverse @ (inside[:-1, -1] / scale)
        made = []
        for at, total in zip(bound.at, bound.blocks, strict=True):
            shared = across[at, :-1] / scale
            left = np.empty((len(total), len(total) + 1))
            left[:, :-1] = total - shared @ inverse @ shared.T
            left[:, -1] = across[at, -1] - shared @ towards
            square = np.vstack([left, np.append(left[:, -1], 0.0)])
            made.append(gain_of(square, np.arange(len(total)), np.diag(total)))
        return made

    def table(self, *more: int) -> Table:
        """Products of [model, functions taken, and more, target] by fold."""
        own = self._with(*more)
        rows = [last - first for _, first, last in self.bound.folds]
        return Table(self.bound.over_noise(own, own), np.array(rows, dtype=np.int64))


@dataclass(frozen=True)
class Leftover:
    """Functions that explain the residual; `gain` in χ², by channel in `carried`.

    `net`: of each when it was taken, less what the best of so many reaches by chance. `share`: of
    all that names and functions explain, the functions' part, in χ². `retained`: see `_retained`.
    """

    groups: tuple[BasisFunctions, ...]
    gain: float
    net: float
    share: float
    carried: dict[str, float]
    retained: dict[str, float]

    @property
    def channels(self) -> list[str]:
        """Those that carry it, the most important first."""
        order = sorted(self.carried, key=lambda name: -self.carried[name])
        told = [n for n in order if self.carried[n] >= SETTINGS.little * max(self.gain, TINY)]
        return told or order[:1]


def leftover_of(bound: ExplainableBound, work: CandidateModel) -> Leftover:
    """Return what the functions that explain most of the residual of a model explain of it."""
    return max((leftover_in(one, work) for one in bound.tables), key=lambda one: one.net)


def leftover_in(some: FunctionTable, work: CandidateModel) -> Leftover:
    """Find the functions of a table that still gain beside a model."""
    overlap, above = some.beside(work), 0.0
    while len(overlap.chosen) < SETTINGS.tried:
        best = _best(overlap)
        if best is None:
            break
        above += best[1]
        overlap.take(best[0])
    return _summary(overlap, work, above)


def _best(overlap: Overlap) -> tuple[int, float] | None:
    """The next functions, with their gain above its threshold."""
    gains = overlap.gains()
    scored = [
        (gain - chi2.isf(SETTINGS.alpha / overlap.bound.rivals, max(seen, 1)), gain, k)
        for k, (gain, seen) in enumerate(gains)
        if k not in overlap.chosen
    ]
    for net, gain, k in sorted(scored, reverse=True):
        if net <= 0.0:
            return None
        table = overlap.table(k)
        every = np.arange(len(table.total) - 1)
        own = len(every) - overlap.bound.groups[k].count
        if held_out_gain(table, every[:own], every[own:], gain).sum() > 0.5**2 * gain:
            return k, net
    return None


def _summary(overlap: Overlap, work: CandidateModel, net: float) -> Leftover:
    """What the functions taken explain, as all rows would show it."""
    table, bound = overlap.table(), overlap.bound
    times = 1.0 / bound.share
    known_load = bound.problem.known_load
    groups = [bound.groups[k] for k in overlap.chosen]
    ends = len(overlap.owners) + np.cumsum([0, *(group.count for group in groups)])
    at = [np.arange(a, b) for a, b in pairwise(ends.tolist())]
    own, none = np.arange(len(overlap.owners)), np.empty(0, dtype=np.intp)
    gain = table.gain(np.concatenate([none, *at]), own)
    told = [{channel_told(c, known_load) for c in group.channels} for group in groups]
    carried = {}
    for name in dict.fromkeys(c for names in told for c in sorted(names)):
        rest = [a for names, a in zip(told, at, strict=True) if name not in names]
        carried[name] = times * (gain - table.gain(np.concatenate([none, *rest]), own))
    named = np.isin(overlap.owners, [effect.name for effect in work.named])
    by_names = table.gain(np.flatnonzero(named), np.flatnonzero(~named))
    share = net / max(net + by_names, TINY)
    retained = _retained(overlap, work, set(carried))
    return Leftover(tuple(groups), times * gain, times * net, share, carried, retained)


def _retained(overlap: Overlap, work: CandidateModel, carriers: set[str]) -> dict[str, float]:
    """Gain of each named effect beside the functions taken and all of a channel that carries them,
    over its gain without them.

    Orders of the motor's angle do not stand against a ripple of it, which they are.
    """
    bound, own = overlap.bound, np.arange(len(overlap.owners))
    load = bound.problem.known_load
    alone = [k for k, group in enumerate(bound.groups) if len(group.channels) == 1]
    carrying = [k for k in alone if channel_told(bound.groups[k].channels[0], load) in carriers]
    beside = [k for k in carrying if k not in overlap.chosen]
    table = overlap.table(*beside)
    taken = [bound.groups[k] for k in (*overlap.chosen, *beside)]
    everything = np.arange(len(own), len(table.total) - 1)
    turns = [group.channels == (ROUND,) for group in taken for _ in range(group.count)]
    apart = everything[~np.array(turns, dtype=bool)]
    retained, owners = {}, overlap.owners
    for effect in work.named:
        mine, others = own[owners == effect.name], own[owners != effect.name]
        turning = effect.ripple and "motor_position" in effect.reads
        retained[effect.name] = kept(table, mine, others, apart if turning else everything)
    return retained


def kept(table: Table, mine: Columns, others: Columns, functions: Columns) -> float:
    """Share of its gain that a name keeps beside functions, its coefficients at most as without.

    The name is taken as it was fitted, times c in [0, 1]: with L the squares that functions leave
    of that column, and b its product with what they leave of the target, it explains 2 c b − c² L.
    """
    alone, beside = table.without(others), table.without(np.concatenate([others, functions]))
    beta = solved(alone, mine)
    gain = float(beta @ alone[mine, -1])
    along = float(beta @ beside[mine, -1])
    squares = float(beta @ beside[np.ix_(mine, mine)] @ beta)
    scale = float(np.clip(along / max(squares, TINY), 0.0, 1.0))
    return (2.0 * scale * along - scale**2 * squares) / max(gain, TINY)


@dataclass(frozen=True)
class Differing:
    """Effects of a model that have no one size for all runs, such as gravity of other payloads.

    `share`: of the squares that the model leaves, what sizes of each run's own take away.
    """

    effects: tuple[str, ...]
    share: float


def differing(problem: Problem, work: CandidateModel) -> Differing | None:
    """Return which effects of a model differ between runs, where that is most of what it leaves.

    The second effect and those behind it as well only where they take a tenth of that more. Blocks,
    longer than the memory of the noise, are independent: beside them it has to be more than the
    best of all effects reaches by chance (F).
    """
    products = _by_runs(problem, work)
    total = products.sum(axis=0)
    whole = float(left_by(total, np.arange(len(total) - 1))[-1, -1])
    if whole <= SINGULAR**2 * total[-1, -1]:
        return None  # rounding
    owners, chosen, share = np.array(work.owners()[: len(work.free)]), list[str](), 0.0
    names = list(dict.fromkeys(owners.tolist()))
    while len(chosen) < min(SETTINGS.tried, len(names)):
        gains = {n: _of_each_run(products, np.isin(owners, [*chosen, n])) / whole
                 for n in names if n not in chosen}  # fmt: skip
        best = max(gains, key=gains.__getitem__)
        if gains[best] - share < (SETTINGS.little if chosen else 0.5):
            break
        chosen, share = [*chosen, best], min(gains[best], 1.0)
    more = np.count_nonzero(np.isin(owners, chosen)) * (len(products) - 1)
    rest = rows_of(problem) // problem.block_rows - len(owners) - more
    if not more or rest < 1:
        return None
    ratio = share / more * rest / max(1.0 - share, TINY)
    told = f.sf(ratio, more, rest) < SETTINGS.alpha / len(names)
    return Differing(tuple(chosen), share) if told else None


def _by_runs(problem: Problem, work: CandidateModel) -> Array:
    """Products of [free coefficients' columns, target] of each run, (R, F + 1, F + 1)."""
    plain = Whitening(np.ones(1), 1.0, problem.decimation)
    table = tabulated(problem, work.assembly(bends=False), plain)
    counts = [len(edges_of(problem, number)) - 1 for number in range(len(problem.runs))]
    firsts = np.cumsum([0, *counts[:-1]])
    return np.add.reduceat(table.folds, firsts, axis=0)


def _of_each_run(products: Array, own: NDArray[np.bool_]) -> float:
    """Squares that some columns explain with coefficients of each run, beyond common ones."""
    common = left_by(products.sum(axis=0), np.arange(len(own)))[-1, -1]
    left = left_by(products, np.flatnonzero(own)).sum(axis=0)
    return float(common - left_by(left, np.flatnonzero(~own))[-1, -1])


@dataclass(frozen=True)
class Repeated:
    """What comes again at the same values of some channels: by how much it lowers the mean square
    of a held-out residual, the standard error of that, and the channels."""

    fall: float
    error: float
    channels: tuple[str, ...]


NEIGHBOURS = 2 * SETTINGS.tried


def repeated(left: HeldOut) -> Repeated | None:
    """Return what neighbours in other folds predict best of a held-out residual, if they do.

    A row's neighbours are the rows of other folds with the nearest values of a channel, or of two,
    in standard deviations; where they are far nothing is predicted. Of noise they predict nothing,
    slow or not: other folds know nothing of it.
    """
    problem = left.problem
    largest = max(float(np.abs(run.target).max()) for run in problem.runs)
    if left.rmse <= SINGULAR * largest:
        return None  # rounding
    alone = {c for group in flexible_basis(problem) for c in group.channels} - {ROUND, DIRECTION}
    names = [name for name in values_of(problem, 0, slice(0, 1)) if name in alone]
    step = max(1, 2 * sum(map(len, left.residuals)) // SETTINGS.rows)
    places, values = list[Array](), list[Array]()
    for fold in left.folds:
        made = values_of(problem, fold.run, slice(fold.first, fold.last))
        place = np.column_stack([made[name] for name in names])[::step]
        value = left.residuals[fold.run][fold.first : fold.last : step]
        counted = np.isfinite(value)
        places.append(place[counted])
        values.append(value[counted])
    scale = np.maximum(np.std(np.concatenate(places), axis=0), TINY)
    places = [place / scale for place in places]
    block = max(2, problem.block_rows // step)
    found = []
    for count in (1, 2):
        for columns in combinations(range(len(names)), count):
            own = [place[:, columns] for place in places]
            after = _beyond_others(own, values)
            fall, error = fall_of(values, after, block)
            if fall > SETTINGS.told * error:
                found.append(Repeated(fall, error, tuple(names[k] for k in columns)))
    return max(found, key=lambda one: one.fall / max(one.error, TINY), default=None)


def _beyond_others(places: Sequence[Array], values: Sequence[Array]) -> list[Array]:
    """What the neighbours in other folds leave of the rows of each, (n,); of many folds in turn."""
    count = min(len(values), NEIGHBOURS)
    left = [*values]
    for turn in range(count):
        rest = [k for k in range(len(values)) if k % count != turn and len(values[k])]
        if sum(len(values[k]) for k in rest) < NEIGHBOURS:
            continue
        others = np.concatenate([values[k] for k in rest])
        tree = cKDTree(np.concatenate([places[k] for k in rest]))
        for k in (k for k in range(turn, len(values), count) if len(values[k])):
            far, at = tree.query(places[k], k=NEIGHBOURS)
            told = SETTINGS.most * others[at].mean(axis=1)
            left[k] = values[k] - np.where(far[:, -1] < SETTINGS.little, told, 0.0)
    return left
