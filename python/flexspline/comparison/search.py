"""What a residual depends on, the noise floor that remains, and the RMSE of each band against it.

Covariates that the residual depends on are selected one by one. Each round tests every covariate on
the remaining residual e, cell by cell:

    m_j mean of e in cell j,   s_j its spread there,   error_j = s_j √(τ_j / n_j)
    (with few rows the spread is uncertain: it is then shrunk towards that of all rows)
    t_j = max(|m_j| − a_j, 0) / error_j,   a_j what the velocity's noise may shift it by
    chance = 1 − (1 − p_min)^cells           gain = Σ n_j (m_j² − error_j² − a_j²) / N

The largest gain wins (of near equals the simplest), all winners are fitted together as curves that
are continuous across bands (`curves.py`), and the next round starts, until no chance is below
α / covariates or no gain matters. Noise alone, whatever its colour, ends in the first round. Orders
are looked for in the residual, and again in what remains once it follows something else.

The noise model must be fitted to a residual that neither holds the structure that is searched for
(it would pass for autocorrelation) nor lacks the noise that a fit absorbs (the autocorrelation
would be too short). So cells and curves are learned on seven eighths of each run, in blocks that
outlast the noise, and subtracted from the rest, one covariate after the other, as long as that
reduces the residual of the held-out rows. Cells that hold nothing but noise increase it and are not
used; in blocks shorter than slow noise they would tell it from the rows beside.

Each band of each covariate has an RMSE and a noise floor. In band k with residual r, and e what
remains when everything that it depends on is taken out:

    RMSE² = mean r²,   floor² = mean e² · (1 + swallowed),   excess² = RMSE² − floor²

Where the noise of what is measured is known, it is the floor instead. Where the velocity is too
noisy for the model's friction, the floor is at least the floor of all rows plus what that noise
does to the prediction. Errors include the noise's autocorrelation.

Of each covariate that the residual depends on, the range is located in which it does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm as normal
from scipy.stats import t as student

from flexspline.comparison.covariates import (
    LARGEST_ORDER,
    Covariate,
    Memory,
    Turning,
    covariates_of,
    memory_of,
    turning_of,
)
from flexspline.comparison.curves import DEGREE, JUMP, Curves
from flexspline.comparison.runs import Compared, Rows, rows_of
from flexspline.logs.segments import median_step

__all__ = [
    "ALPHA",
    "Analysis",
    "Band",
    "OrderPeak",
    "Place",
    "Search",
    "Step",
    "analysed",
    "bands_of",
    "overall",
    "peaks_of",
    "place_of",
    "search",
    "worst_band",
]

Array = NDArray[np.float64]

ALPHA = 0.01  # that noise alone names anything in a set of logs
NEAR = 0.9  # of the largest gain: as good
ALSO = 0.7  # of the largest gain: would do nearly as well
OF_FLOOR, OF_GAP = 0.01, 0.03  # of their squares: a smaller gain does not matter
LEAST_WORTH = 2.0  # independent rows that a cell needs to be tested
OWN_SPREAD = 30.0  # independent rows from which a cell is believed to be quieter than the rest
MOST_STEPS = 8
SWEEPS = 4
ORDERS = "position_order"
TOGETHER = " and "  # in the name of two covariates at once

NESTED = ("offset", "direction")
"""What every other covariate holds too, and so would explain as well."""

PREFERENCE = (
    "offset",
    "direction",
    ORDERS,
    "speed",
    "load",
    "temperature",
    "motor_temperature",
    "position",
    "reversal_angle",
    "reversal_time",
    "acceleration",
    "time",
    "run",
)
"""Of two that explain as much, the earlier one is said."""

PROXIES = ("time", "run")
"""Where a motion repeats, everything is nearly a function of these."""

PER_CUTOFF = 2.5  # a low-passed residual has news this many times per period of the cutoff

FOLDS = 8
BLOCKS = 40  # of a run, dealt to the folds in turn
SHORTEST = 2 * LARGEST_ORDER  # rows of a block: it shows what the noise's model looks back over
FEWEST = 4  # of these, of which each is told by the others
WORTH_IT = 0.02  # of the mean square: what a covariate has to take off
MOST_ROUNDS = 8
SAWTOOTH = 0.5  # of what means leave of held-out rows: noise that a curve follows leaves more

LEAST_EFFECTIVE = 5.0  # rows that a band is worth, to be called the worst
_DOUBTFUL = 0.25  # of the floor's square, from which the velocity's noise matters

LARGE = 0.25  # of the largest mean square: half of the largest RMS
BOTH = 0.1  # of the larger direction's mean square: still both directions
NEAR_ZERO = 0.34  # a band from below this part of its upper end starts at 0 for what starts there


@dataclass(frozen=True, eq=False)
class CellTest:
    """Cells of one covariate against what is left: (cells,) each, and the two verdicts."""

    rows: Array
    mean: Array
    error: Array
    p: Array
    gain: float
    chance: float
    tau: Array = field(repr=False)


@dataclass(frozen=True, eq=False)
class Step:
    """One thing that the residual follows.

    `covariate` None: orders of what turns, by `turning`. `gain`: mean square explained.
    `chance`: that noise alone does so. `also`: names of what would do nearly as well.
    `fitted`: (cells,) means of a covariate, or (N,) of orders; `lost`: sum of squares of noise that
    it swallows. `curve`: (cells, 4) of what is subtracted, or (cells, 1) where these are means.
    """

    name: str
    covariate: Covariate | None
    turning: Turning | None
    gain: float
    chance: float
    also: tuple[str, ...]
    fitted: Array
    lost: float
    curve: Array | None = None


@dataclass(frozen=True, eq=False)
class Search:
    """Steps in the order found, what they leave (N,), and the last chance of each name."""

    steps: tuple[Step, ...]
    rest: Array
    chances: dict[str, float]

    @property
    def floor_square(self) -> float:
        """Mean square of the noise, with what the steps swallowed of it."""
        return float(self.rest @ self.rest) / len(self.rest) * self.swallowed

    @property
    def swallowed(self) -> float:
        """Factor from the mean square of what is left to that of the noise."""
        squares = float(self.rest @ self.rest)
        lost = sum(step.lost for step in self.steps)
        return 1.0 + lost / squares if squares > 0.0 else 1.0


class CellTests:
    """Tests cells of covariates; what does not change between rounds is kept."""

    def __init__(self, rows: Rows, memory: Memory) -> None:
        self.rows, self.memory = rows, memory
        self.known: dict[str, tuple[Array, Array, Array]] = {}
        self.powers: dict[str, Array] = {}

    def __call__(self, covariate: Covariate, rest: Array) -> CellTest:
        count, tau, allowed = self._kept(covariate)
        inside = np.maximum(count, 1.0)
        total = self.sum(covariate, rest)
        squares = self.sum(covariate, rest * rest)
        mean = total / inside
        worth = np.maximum(count / tau, 1e-9)
        usable = worth >= LEAST_WORTH
        spread = _spread(squares / inside - mean**2, worth, float(rest @ rest) / len(rest))
        error = np.sqrt(spread / worth)
        excess = np.maximum(np.abs(mean) - allowed, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(excess > 0.0, excess / error, 0.0)
        p = np.where(usable, 2.0 * student.sf(ratio, self.memory.degrees), 1.0)
        gained = np.where(usable, count * (mean**2 - error**2 - allowed**2), 0.0)
        chance = -np.expm1(usable.sum() * np.log1p(-min(float(p.min()), 1.0 - 1e-12)))
        return CellTest(count, mean, error, p, float(gained.sum()) / len(rest), chance, tau)

    def sum(self, covariate: Covariate, values: Array) -> Array:
        """Sum of values (N,) in each cell."""
        cells = covariate.cells
        if cells.min(initial=0) >= 0:
            made = np.bincount(cells, weights=values, minlength=covariate.count)
        else:
            made = np.bincount(cells + 1, weights=values, minlength=covariate.count + 1)[1:]
        return np.asarray(made, dtype=np.float64)

    def curve(self, covariate: Covariate, rest: Array, powers: int | None = None) -> Array:
        """What is subtracted of `rest` (N,): a curve (cells, 4), or means (cells, 1).

        `powers`: 4 or 1 as it was; None: means only where a jump lies on an edge.
        """
        inside = np.maximum(self._kept(covariate)[0], 1.0)
        means = (self.sum(covariate, rest) / inside)[:, None]
        curves = covariate.curves
        if curves is None or powers == 1:
            return means
        made = curves.fitted(self._ones(covariate, curves), curves.sums(rest, DEGREE + 1)[0])
        if powers is not None:
            return made
        left = [rest - curves.values(each) for each in (means, made)]
        least, smooth = (float(each @ each) for each in left)
        return means if least < (1.0 - JUMP) * smooth else made

    def means(self, covariate: Covariate, curve: Array) -> Array:
        """Mean of a curve over the rows of each cell, (cells,)."""
        if covariate.curves is None or curve.shape[1] == 1:
            return curve[:, 0]
        ones = self._ones(covariate, covariate.curves)
        total = (ones[:, : curve.shape[1]] * curve).sum(axis=1)
        return np.asarray(total / np.maximum(ones[:, 0], 1.0))

    def swallowed(self, covariate: Covariate, curve: Array, rest: Array) -> float:
        """Sum of squares of noise that a curve takes off, by what it leaves, (N,)."""
        made = self(covariate, rest)
        most = float(rest @ rest) / len(rest)
        lost = float((made.rows * np.minimum(made.error**2, most)).sum())
        if covariate.curves is None or curve.shape[1] == 1:
            return lost
        bands = np.count_nonzero(made.rows[covariate.curves.lines], axis=1)
        return lost * (1.0 + DEGREE * np.count_nonzero(bands) / max(int(bands.sum()), 1))

    def _ones(self, covariate: Covariate, curves: Curves) -> Array:
        if covariate.name not in self.powers:
            made = curves.sums(np.ones(len(self.rows)), 2 * DEGREE + 1)[0]
            self.powers[covariate.name] = made
        return self.powers[covariate.name]

    def _kept(self, covariate: Covariate) -> tuple[Array, Array, Array]:
        if covariate.name not in self.known:
            count = self.sum(covariate, np.ones(len(self.rows)))
            tau = self.memory.times(covariate.cells, covariate.count)[0]
            allowed = self.sum(covariate, self.rows.allowance) / np.maximum(count, 1.0)
            self.known[covariate.name] = count, tau, allowed
        return self.known[covariate.name]


def _spread(local: Array, worth: Array, everywhere: float) -> Array:
    """Variance in each cell: its own where larger or well known, else drawn to that of all."""
    drawn = (worth * local + OWN_SPREAD * everywhere) / (worth + OWN_SPREAD)
    return np.maximum(np.where(local > everywhere, local, drawn), 1e-300)


def search(
    rows: Rows, covariates: Sequence[Covariate], turning: Turning, test: CellTests
) -> Search:
    """Find what the residual follows; see the module docstring."""
    steps: list[Step] = []
    rest = rows.residual
    chances: dict[str, float] = {}
    gap = float(rest @ rest) / len(rest)
    before: dict[str, tuple[float, float]] = {}
    for _ in range(MOST_STEPS):
        taken = {step.name for step in steps}
        free = [c for c in covariates if c.name not in taken]
        tests = {c.name: test(c, rest) for c in free}
        gains = {name: (made.gain, made.chance) for name, made in tests.items()}
        waves = None
        if turning.found and ORDERS not in taken:
            waves, amplitudes = turning.explained(rest)
            gains[ORDERS] = (_wave_gain(rest, waves, turning), turning.chance(amplitudes))
        chances = {name: chance for name, (_, chance) in gains.items()}
        if steps:
            steps[-1] = _told_apart(steps[-1], before, gains)
        before = gains
        left = float(rest @ rest) / len(rest)
        simple = {n: g for n, g in gains.items() if TOGETHER not in n}
        name, also = _winner(simple, gap, left, len(gains))
        if name is None:  # two at once only where nothing alone is left
            name, also = _winner(gains, gap, left, len(gains))
        if name is None:
            break
        gain, chance = gains[name]
        if name == ORDERS and waves is not None:
            lost = (float(rest @ rest) - float((rest - waves) @ (rest - waves))) - gain * len(rest)
            step = Step(name, None, turning, gain, chance, also, waves, max(lost, 0.0))
        else:
            covariate = next(c for c in free if c.name == name)
            made = tests[name]
            curve = test.curve(covariate, rest)
            step = Step(name, covariate, None, gain, chance, also, made.mean, 0.0, curve)
        steps, after = _together([*steps, step], rows.residual, test)
        more = left - (float(after @ after) + steps[-1].lost) / len(rest)
        if steps[-1].curve is not None and steps[-1].curve.shape[1] > 1:  # takes more than means do
            steps[-1] = replace(steps[-1], gain=max(gain, more))
        rest = after
    return Search(tuple(steps), rest, chances)


def _told_apart(
    step: Step, before: dict[str, tuple[float, float]], after: dict[str, tuple[float, float]]
) -> Step:
    """The step without what explains most of its own gain beside it too: that is no second name."""
    same = [n for n in step.also if after[n][0] < 0.5 * before[n][0]]
    return replace(step, also=tuple(same))


def _winner(
    gains: dict[str, tuple[float, float]], gap: float, left: float, family: int
) -> tuple[str | None, tuple[str, ...]]:
    """The simplest of the best gains that count, and what would do nearly as well.

    A proxy is the last to be said. What does nearly as well may be in more cells, and so below its
    level.
    """
    level = ALPHA / max(family, 1)
    sure = {n: g for n, (g, chance) in gains.items() if chance < level}
    best = max(sure.values(), default=0.0)
    if best <= OF_FLOOR * (left - best) or best < OF_GAP * gap:
        return None, ()
    order = [n for n in PREFERENCE if n in gains] + [n for n in gains if n not in PREFERENCE]
    known = max((g for n, g in sure.items() if n not in PROXIES), default=0.0)
    enough = NEAR * (known if known >= ALSO * best else best)
    name = next(n for n in order if sure.get(n, 0.0) >= enough)
    plain = max(0.0, *(sure.get(n, 0.0) for n in NESTED))
    if name in NESTED:
        return name, ()
    also = tuple(n for n in order if n != name and n not in NESTED and TOGETHER not in n
                 and gains[n][0] - plain >= ALSO * (best - plain))  # fmt: skip
    return name, also


def _wave_gain(rest: Array, waves: Array, turning: Turning) -> float:
    """Mean square that the orders explain, less what they would of noise."""
    left = rest - waves
    explained = (float(rest @ rest) - float(left @ left)) / len(rest)
    noise = sum(order.error**2 for order in turning.found)
    return explained - noise


def _together(steps: list[Step], residual: Array, test: CellTests) -> tuple[list[Step], Array]:
    """Fit all steps together, in sweeps over them; return them and what they leave."""
    rest = residual - np.sum([_values(step) for step in steps], axis=0)
    for _ in range(SWEEPS if len(steps) > 1 else 0):
        for number, step in enumerate(steps):
            if step.covariate is None or step.curve is None:
                continue
            change = test.curve(step.covariate, rest, step.curve.shape[1])
            rest = rest - _of_cells(step.covariate, change)
            steps[number] = replace(step, curve=step.curve + change)
    for number, step in enumerate(steps):
        if step.covariate is not None and step.curve is not None:
            means = test.means(step.covariate, step.curve)
            lost = test.swallowed(step.covariate, step.curve, rest)
            steps[number] = replace(step, fitted=means, lost=lost)
    return steps, rest


def _values(step: Step) -> Array:
    if step.covariate is None or step.curve is None:
        return step.fitted
    return _of_cells(step.covariate, step.curve)


def _of_cells(covariate: Covariate, curve: Array) -> Array:
    """Each row's value on the curve of its cell, 0 for rows without one."""
    if covariate.curves is not None:
        return covariate.curves.values(curve)
    return np.append(curve[:, 0], 0.0)[covariate.cells]


@dataclass(frozen=True, eq=False)
class Analysis:
    """What the residual follows: `found`, tested by `test` with the noise's `memory`.

    `turning`: orders in the residual, or in what is left where it follows something else first;
    `spectrum`: those of the residual itself. `step`: s, of the rows.
    """

    rows: Rows
    covariates: tuple[Covariate, ...]
    memory: Memory
    test: CellTests
    found: Search
    turning: Turning
    spectrum: Turning
    step: float


def analysed(compared: Compared, say: Callable[[str], None]) -> Analysis:
    """Search the runs; `say` is told what is being done."""
    say("sorting rows")
    rows = rows_of(compared)
    covariates = covariates_of(compared, rows)
    step = min(median_step(run.log["time"]) for run in compared.runs)
    news = 1
    if compared.lowpass is not None:
        news = max(1, int(1.0 / (PER_CUTOFF * compared.lowpass * step)))
    say("looking for orders")
    turning = spectrum = turning_of(compared, rows, rows.residual)
    say("what the residual follows")
    memory = _memory_beside(rows, covariates, turning, news)
    test = CellTests(rows, memory)
    found = search(rows, covariates, turning, test)
    if found.steps and ORDERS not in [each.name for each in found.steps]:
        turning = turning_of(compared, rows, found.rest)
        if turning.found:
            found = search(rows, covariates, turning, test)
    return Analysis(rows, tuple(covariates), memory, test, found, turning, spectrum, step)


def _memory_beside(
    rows: Rows, covariates: Sequence[Covariate], turning: Turning, news: int
) -> Memory:
    """The noise's memory beside what cells and orders explain, in blocks that outlast it.

    Of slow noise a block shorter than that is told by the rows beside it, in cells that mean
    nothing. Where no block of a run outlasts it, nothing is taken off, and all is noise.
    """
    at = np.concatenate([np.arange(*piece) for piece in rows.looked_at])
    longest = len(at) / len(np.unique(rows.run[at]))
    blocks = min(BLOCKS, int(longest // SHORTEST))
    while blocks >= FEWEST:
        memory = memory_of(rows, held_out_rest(rows, covariates, turning, blocks), news)
        if memory.model.memory * memory.model.decimation <= longest / blocks:
            return memory
        blocks //= 2
    return memory_of(rows, rows.residual, news)


def held_out_rest(
    rows: Rows, covariates: Sequence[Covariate], turning: Turning, blocks: int = BLOCKS
) -> Array:
    """Return the residual without what cells and orders explain of held-out rows, (N,).

    Only rows of `rows.looked_at` are worked on; the others stay as they are. `blocks`: of a run.
    """
    at = np.concatenate([np.arange(*piece) for piece in rows.looked_at])
    fold, rest = _folds(rows.run[at], blocks), rows.residual[at]
    turning = replace(turning, angle=turning.angle[at], direction=turning.direction[at])
    cells = [(covariate.cells[at], covariate.count) for covariate in covariates]
    curves = [
        None if each.curves is None else _FoldCurves(each.curves.at(at), fold)
        for each in covariates
    ]
    for _ in range(MOST_ROUNDS):
        left = float(rest @ rest)
        tries = [_without(rest, *each, fold) for each in cells]
        if turning.found:
            tries.append(rest - turning.explained(rest)[0])
        number = min(range(len(tries)), key=lambda k: float(tries[k] @ tries[k]))
        best = _smoother(tries[number], curves[number] if number < len(curves) else None, rest)
        if float(best @ best) > (1.0 - WORTH_IT) * left:
            break
        rest = best
    made = rows.residual.copy()
    made[at] = rest
    return made


def _smoother(best: Array, curve: _FoldCurves | None, rest: Array) -> Array:
    """What a curve leaves of `rest` (N,), if that is much less than the `best` of means does."""
    if curve is None:
        return best
    made = curve.without(rest)
    return made if float(made @ made) < SAWTOOTH * float(best @ best) else best


def _folds(run: NDArray[np.int32], blocks: int) -> NDArray[np.int64]:
    sizes = np.bincount(run)
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    place = np.arange(len(run)) - first[run]
    return np.asarray(place * blocks // np.maximum(sizes[run], 1) % FOLDS)


def _without(rest: Array, cells: NDArray[np.integer], last: int, fold: NDArray[np.int64]) -> Array:
    """Take off each row the mean of its cell in the other folds."""
    both = fold * (last + 1) + np.where(cells < 0, last, cells)
    size = FOLDS * (last + 1)
    total = np.bincount(both, weights=rest, minlength=size).reshape(FOLDS, -1)
    count = np.bincount(both, minlength=size).reshape(FOLDS, -1)
    others = (total.sum(axis=0) - total) / np.maximum(count.sum(axis=0) - count, 1)
    others[:, -1] = 0.0
    return np.asarray(rest - others.ravel()[both])


class _FoldCurves:
    """Curves that each fold is predicted by, learned on the others."""

    def __init__(self, curves: Curves, fold: NDArray[np.int64]) -> None:
        self.curves, self.fold = curves, fold

    def without(self, rest: Array) -> Array:
        """Take off each row the curve of the other folds."""
        ones = self._others(np.ones(len(rest)), 2 * DEGREE + 1)
        moments = self._others(rest, DEGREE + 1)
        made = rest.copy()
        for number, sums in enumerate(zip(ones, moments, strict=True)):
            held = self.fold == number
            made[held] -= self.curves.at(held).values(self.curves.fitted(*sums))
        return made

    def _others(self, values: Array, powers: int) -> Array:
        each = self.curves.sums(values, powers, self.fold)
        return np.asarray(each.sum(axis=0) - each)


@dataclass(frozen=True)
class Band:
    """One band of rows. Numbers in the unit of the comparison, variance in its square.

    `lower`, `upper`: of the covariate, in its unit; None for kinds and where it is open.
    `effective_rows`: the effective sample size. `noise_floor_error`: standard error of the floor.
    `excess`: RMS above the floor. `chance`: that noise alone shows such a mean, or such a mean
    square above the floor, in any band of this covariate. `significant`: more than chance.
    """

    label: str
    lower: float | None
    upper: float | None
    rows: int
    effective_rows: float
    rmse: float
    variance: float
    bias: float
    noise_floor: float
    noise_floor_error: float
    excess: float
    chance: float
    significant: bool


@dataclass(frozen=True)
class OrderPeak:
    """An order of what turns in the residual; amplitude and error in its unit.

    `order` per turn of `pair`; `label` says what turns; `chance`: that noise alone shows it.
    """

    pair: str
    order: float
    per_output_turn: float
    amplitude: float
    error: float
    chance: float
    label: str
    also: tuple[str, ...]


def overall(rows: Rows, memory: Memory, found: Search, test: CellTests) -> Band:
    """Return the band of all rows.

    What the residual follows is above the floor, though the velocity's noise may explain as much:
    its gain is less what that noise may shift.
    """
    cells = np.zeros(len(rows), dtype=np.int16)
    one = np.zeros(1, dtype=np.intp)
    whole = Covariate("all", "all rows", "", None, ("all rows",), cells, one, one - 1)
    (band,) = bands_of(whole, rows, memory, found, test, len(found.chances))
    chance = min((step.chance for step in found.steps), default=min(found.chances.values()))
    chance = min(1.0, chance * len(found.chances))
    square = band.rmse**2
    most = max(square - sum(step.gain for step in found.steps), found.floor_square)
    floor = min(band.noise_floor, float(np.sqrt(min(most, square))))
    error = band.noise_floor_error * (floor / band.noise_floor if band.noise_floor else 1.0)
    excess = float(np.sqrt(square - floor**2))
    return replace(
        band, noise_floor=floor, noise_floor_error=error, excess=excess, chance=chance,
        significant=bool(found.steps),
    )  # fmt: skip


def bands_of(
    covariate: Covariate,
    rows: Rows,
    memory: Memory,
    found: Search,
    test: CellTests,
    family: int,
) -> list[Band]:
    """Return the bands of a covariate that hold rows; `family`: covariates tested together."""
    tested = test(covariate, rows.residual)
    count = covariate.bins(tested.rows)
    inside = np.maximum(count, 1.0)
    mean = covariate.bins(test.sum(covariate, rows.residual)) / inside
    square = covariate.bins(test.sum(covariate, rows.residual**2)) / inside
    floor = _floor(covariate, rows, found, test, inside, square)
    bins = np.append(covariate.bin_of, -1)[covariate.cells].astype(np.int32)
    tau, tau_square = memory.times(bins, len(covariate.labels))
    error = np.sqrt(floor * tau_square / (2.0 * inside))  # half of that of the square, by 2 √floor
    excess = np.sqrt(np.maximum(square - floor, 0.0))
    chance = np.ones(len(covariate.labels))
    np.minimum.at(chance, covariate.bin_of, tested.p)
    above = np.maximum(square - floor, 0.0) / np.maximum(2.0 * np.sqrt(floor) * error, 1e-300)
    chance = np.minimum(2.0 * np.minimum(chance, normal.sf(above)), 1.0 - 1e-12)
    chance = -np.expm1(covariate.count * np.log1p(-chance))
    sure = (chance < ALPHA / family) & (excess > 0.0) & bool(found.steps)
    ends = _ends(covariate)
    return [
        Band(
            covariate.labels[k],
            ends[k][0],
            ends[k][1],
            int(count[k]),
            float(count[k] / tau[k]),
            float(np.sqrt(square[k])),
            float(max(square[k] - mean[k] ** 2, 0.0)),
            float(mean[k]),
            float(np.sqrt(floor[k])),
            float(error[k]),
            float(excess[k]),
            float(chance[k]),
            bool(sure[k]),
        )
        for k in np.flatnonzero(count > 0).tolist()
    ]


def worst_band(bands: Sequence[Band]) -> Band:
    """Return the band with the largest significant excess.

    Where none is significant: with the largest RMSE, of those with enough rows to tell.
    """
    sure = [band for band in bands if band.significant]
    known = [band for band in bands if band.effective_rows >= LEAST_EFFECTIVE] or list(bands)
    return max(sure, key=lambda band: band.excess) if sure else max(known, key=lambda b: b.rmse)


def peaks_of(turning: Turning) -> list[OrderPeak]:
    """Return the orders found, the largest first."""
    return [
        OrderPeak(o.pair, float(o.order), o.per_output_turn, o.amplitude, o.error, o.chance,
                  o.label, o.aliases[:2])
        for o in turning.found
    ]  # fmt: skip


def _floor(
    covariate: Covariate, rows: Rows, found: Search, test: CellTests, inside: Array, square: Array
) -> Array:
    """Squares of the floor of each band."""
    if rows.floor is not None:
        return np.minimum(rows.floor**2, square)
    left = covariate.bins(test.sum(covariate, found.rest**2)) / inside * found.swallowed
    doubt = covariate.bins(test.sum(covariate, rows.doubt**2)) / inside
    everywhere = max(found.floor_square - float(np.mean(rows.doubt**2)), 0.0)
    least = np.minimum(square, everywhere + doubt)
    return np.where(doubt > _DOUBTFUL * left, np.maximum(left, least), np.minimum(left, square))


def _ends(covariate: Covariate) -> Sequence[tuple[float | None, float | None]]:
    if covariate.edges is None:
        return [(None, None)] * len(covariate.labels)
    closed = [float(e) if np.isfinite(e) else None for e in covariate.edges]
    return list(pairwise(closed))


@dataclass(frozen=True)
class Place:
    """Bands (lower, upper) of a covariate, None where open, and directions, in which it is large.

    `kinds`: labels instead of bands, for runs and directions, with `means` of each in the unit
    of the comparison. `whole`: as large over the whole range. `turns_sign`: with the direction.
    """

    bands: tuple[tuple[float | None, float | None], ...]
    directions: tuple[str, ...]
    turns_sign: bool
    kinds: tuple[str, ...]
    means: tuple[float, ...]
    whole: bool


def place_of(step: Step, tested: CellTest) -> Place:
    """Return where a step is large; `tested` are its cells."""
    covariate = step.covariate
    assert covariate is not None
    power = np.maximum(step.fitted**2 - tested.error**2, 0.0) * (tested.rows / tested.tau >= 2.0)
    total, count = covariate.bins(power * tested.rows), covariate.bins(tested.rows)
    level = total / np.maximum(count, 1.0)
    large = level >= LARGE * level.max()
    weight = power * tested.rows * large[covariate.bin_of]
    directions = _directions(covariate, weight)
    turns = _turns_sign(covariate, np.sign(step.fitted) * weight)
    if covariate.edges is None:
        kinds = tuple(np.array(covariate.labels)[large].tolist())
        means = covariate.bins(step.fitted * tested.rows) / np.maximum(count, 1.0)
        return Place((), directions, turns, kinds, tuple(means[large].tolist()), False)
    return Place(_bands(covariate, large), directions, turns, (), (), bool(large[count > 0].all()))


def _bands(
    covariate: Covariate, large: NDArray[np.bool_]
) -> tuple[tuple[float | None, float | None], ...]:
    edges = covariate.edges
    assert edges is not None
    found: list[tuple[float | None, float | None]] = []
    for wanted, group in groupby(range(len(large)), key=lambda k: bool(large[k])):
        if wanted:
            members = list(group)
            low, high = float(edges[members[0]]), float(edges[members[-1] + 1])
            if edges[0] == 0.0 and np.isfinite(high) and low < NEAR_ZERO * high:
                low = 0.0 if covariate.name != "position" else low
            if low == 0.0:
                found.clear()  # a band from 0 holds those before it
            found.append((low if np.isfinite(low) else None, high if np.isfinite(high) else None))
    return tuple(found)


def _directions(covariate: Covariate, power: Array) -> tuple[str, ...]:
    """ "forward" and "backward" where the share of each is large."""
    each = [float(power[covariate.direction_of == way].sum()) for way in (1, 2)]
    if not max(each) > 0.0:
        return ()
    return tuple(
        word
        for word, size in zip(("forward", "backward"), each, strict=True)
        if size >= BOTH * max(each)
    )


def _turns_sign(covariate: Covariate, signed: Array) -> bool:
    """Whether most of what is large has opposite signs in the two directions of its bin."""
    forward, backward = (
        covariate.bins(np.where(covariate.direction_of == way, signed, 0.0)) for way in (1, 2)
    )
    opposite = np.where(forward * backward < 0.0, np.abs(forward) + np.abs(backward), 0.0)
    return bool(opposite.sum() > 0.5 * np.abs(signed).sum())
