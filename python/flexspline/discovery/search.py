"""Which effects are missing: added one after the other, every earlier choice examined again.

A part of long logs that stands for the whole in the first search.

Where an effect is plain in a tenth of an hour, it need not be looked for in all of it: a first
search goes over short stretches spread evenly over the logs. What it found is where the search on
all rows begins; that refits everything, may take names back, and adds what only all rows show. So
every gain and price that is reported is one of all rows. Effects with memory are followed from
`LEAD` rows before each stretch on: what they remember from before that is a guess.

What the form of a named effect may miss, and another effect may then seem to explain.

No form is exact: what a named effect's own misses is a share of all that it explains, and beside a
large effect that is as much as a small one explains. Where the named effect has a smooth form, the
form can be freed: beside all functions of its channels another effect either still pays its price,
and is there, or does not.

Each round refits the shapes of the model, offers every candidate in its best form beside it (a
shape between the screened ones where that decides), and takes the best that

- gains more than its price (`evidence_of`: the family of candidates is accounted for),
- gains on left-out folds too,
- is no leftover of a name's form (`missed`),
- is physically possible (`impossible`).

Then each name is put to the test again: beside all others it must still pay its price, and no
other candidate may do clearly better in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.discovery.candidates import (
    SHARED,
    Candidate,
    candidates_for,
    joined,
    order_pools,
    possible,
    scanned,
)
from flexspline.discovery.evidence import (
    Columned,
    Dictionary,
    Offer,
    columned,
    evidence_of,
    foretold_gain,
    gain_of,
    held_out,
    offers,
    plain_rows,
)
from flexspline.discovery.flexible import Nameless, channel_told, nameless_of
from flexspline.discovery.gram import Sheet, Whitening, edges_of, tabulated
from flexspline.discovery.model import (
    LOOPS,
    WIDTH,
    Working,
    driving_spring,
    impossible,
    one_signed,
    refitted,
)
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import UNITS, Effect
from flexspline.errors import InputError
from flexspline.fit.problem import Problem, Run, problem_of
from flexspline.fit.requirements import require_one_unit
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.orders import FoundOrder
from flexspline.prepared import Preparation
from flexspline.simulator.record import Simulated

__all__ = [
    "Limits",
    "Searcher",
    "Step",
    "Study",
    "freedom",
    "missed",
    "owned_gain",
    "owned_price",
    "pays_beside_forms",
    "ranked",
    "rows_of",
    "study_of",
    "thinned",
    "undecided",
]

LEAD = 2 * SETTINGS.rows


def rows_of(problem: Problem) -> int:
    """How many rows count."""
    return sum(run.counted for run in problem.runs)


def thinned(problem: Problem, enough: int, stretch: int) -> Problem:
    """Return the problem with about `enough` of its rows, in pieces of about `stretch`.

    Itself where it has less than twice as many. Behind a low pass one row of several is news: it
    is these that are counted.
    """
    enough, stretch = enough * problem.decimation, stretch * problem.decimation
    share = rows_of(problem) // enough
    if share < 2:
        return problem
    runs = tuple(replace(run, stretches=_parts(run, share, stretch)) for run in problem.runs)
    return replace(problem, runs=runs, remembered=_core.Remembered(LEAD))


def _parts(run: Run, share: int, stretch: int) -> tuple[tuple[int, int], ...]:
    """One part of so many of each stretch, from its middle."""
    parts = []
    for first, last in run.stretches:
        count = max(1, round((last - first) / (share * stretch)))
        step = (last - first) / count
        length = round(step / share)
        begins = [first + round((k + 0.5) * step) - length // 2 for k in range(count)]
        parts += [(begin, begin + length) for begin in begins]
    return tuple(parts)


Array = NDArray[np.float64]
Orders = tuple[FoundOrder, ...]


@dataclass
class Study:
    """Problem, effects that may be missing, why others are not tried, and orders found.

    `last`, `known`: what was asked for before, a table and the candidates beside models.
    """

    problem: Problem
    possible: list[Effect]
    not_tried: dict[str, str]
    orders: Orders = field(default=())
    last: Columned | None = field(default=None, repr=False, compare=False)
    known: dict[tuple[Effect, ...], tuple[Orders, list[Candidate]]] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def target(self) -> str:
        return self.problem.target

    @property
    def _span(self) -> float:
        """How far the output goes from end to end in a run, rad; without bound where unknown."""
        kept: dict[Any, Any] = self.problem.kept
        if "span" not in kept:
            logs = [run.log for run in self.problem.runs]
            angles = [log["output_position"] for log in logs if "output_position" in log]
            kept["span"] = max((float(np.ptp(angle)) for angle in angles), default=np.inf)
        return float(kept["span"])

    def thinned(self) -> Study:
        """The same for a part of long logs; itself for others."""
        news = rows_of(self.problem) // self.problem.decimation
        share = round(0.5 * SETTINGS.bends * news)
        enough = max(share, (SETTINGS.tried - 1) * SETTINGS.rows)
        part = thinned(self.problem, enough, SETTINGS.rows // 2)
        return self if part is self.problem else replace(self, problem=part, last=None, known={})

    def candidates(self, model: Sequence[Effect]) -> list[Candidate]:
        """Return what may be missing beside a model."""
        orders, made = self.known.get(tuple(model), (None, []))
        if orders is not self.orders:
            facts = self.problem.runs[0].log.facts
            names = [e.name for e in self.possible]
            pools = order_pools(names, facts, self.orders, model, self.target, self._span)
            made = candidates_for(model, self.possible, self.problem, pools)
            self.known[tuple(model)] = self.orders, made
        return made

    def refine(self, model: Sequence[Effect], effect: Effect) -> None:
        """Let a candidate beside a model have the shapes of `effect`, too."""
        orders, made = self.known[tuple(model)]
        better = [c.having(effect) if c.name == effect.name else c for c in made]
        self.known[tuple(model)] = orders, better

    def dictionary(
        self, work: Working, whitening: Whitening, *, without: str | None = None
    ) -> Dictionary:
        """Return the table of a model and all candidates beside it, or beside it without one."""
        candidates = self._beside(work, without)
        last = self.last
        if (
            last is None
            or last.work is not work
            or last.whitening is not whitening
            or not last.has(candidates)
        ):
            every = [None, without, *(effect.name for effect in work.named)]
            wanted = [e for name in every for c in self._beside(work, name) for e in c.effects]
            last = self.last = columned(self.problem, work, wanted, whitening)
        return last.dictionary(candidates)

    def _beside(self, work: Working, without: str | None) -> list[Candidate]:
        """What may stand beside a model, or beside it in the place of one of its effects."""
        rest = [e for e in work.effects if e.name != without]
        return [c for c in self.candidates(rest) if c.name != without]

    def scan(self, work: Working) -> None:
        """Look for orders in what a model leaves; those of earlier scans stay."""
        logs = [run.log for run in self.problem.runs]
        sheet = Sheet(work.effects, work.coefficients, (), work.coefficients)
        folds = sum(len(edges_of(self.problem, number)) - 1 for number in range(len(logs)))
        residuals = sheet.left_over(self.problem, [np.empty(0)] * folds)
        self.orders = joined(self.orders, scanned(logs, residuals, UNITS[self.target]))


def study_of(
    base: Sequence[Effect],
    logs: Sequence[Log],
    target: str,
    *,
    known_load: str | None,
    lowpass_hz: float | None,
    threads: int,
    exclude: Iterable[str] = (),
    preparations: Sequence[Preparation] = (),
    inputs: Sequence[Log] | None = None,
    counted: Sequence[NDArray[np.bool_]] | None = None,
    simulated: Simulated | None = None,
) -> Study:
    """Make logs ready for the base and every effect that they could show beside it.

    `simulated`: the simulation whose prediction is taken off the target, or None.

    Raises
    ------
    InputError
        As `fit`, for the base alone; for a name in `exclude` that is no effect or is in the base.
    """
    require_one_unit(base, target, known_load)
    problem_of(
        logs,
        base,
        target,
        known_load=known_load,
        lowpass_hz=lowpass_hz,
        threads=threads,
        preparations=preparations,
        inputs=inputs,
        counted=counted,
        simulated=simulated,
    )
    inputs = [_with_motion(log) for log in (logs if inputs is None else inputs)]
    effects, reasons = possible(base, inputs, target, known_load, exclude)
    kept = [e for e in effects if _finite(e, inputs, reasons)]
    problem = problem_of(
        logs,
        [*base, *kept],
        target,
        known_load=known_load,
        lowpass_hz=lowpass_hz,
        threads=threads,
        preparations=preparations,
        inputs=inputs,
        counted=counted,
        simulated=simulated,
    )
    runs = tuple(replace(run, stretches=run.unbroken) for run in problem.runs)
    return Study(replace(problem, runs=runs), kept, reasons)


def _finite(effect: Effect, logs: Sequence[Log], reasons: dict[str, str]) -> bool:
    """Whether all channels of an effect are finite; a candidate's fault is no fault of the base."""
    for log in logs:
        for name in effect.reads:
            if name in log and not np.isfinite(log[name]).all():
                reasons[effect.name] = f"log '{log.name}': {name} is not finite throughout"
                return False
    return True


def _with_motion(log: Log) -> Log:
    """The log with the derivatives of its position, where that allows them."""
    names = [n for n in ("output_velocity", "output_acceleration") if n not in log]
    if not names or "output_position" not in log:
        return log
    try:
        made = differentiate(log)
    except InputError:
        return log
    return log.with_columns({n: made[n] for n in names}, note=made.history[-1])


SUSPECTED = 0.5  # of a gain, that a form may miss, to be freed before that gain is believed
SAME_CAUSE = 0.5  # of an offer's gain, that another one leaves of it, to explain most of the same


def owned_gain(dictionary: Dictionary, name: str) -> float:
    """Squares over σ² that an effect of the model explains beside all others."""
    rest = dictionary.without([name])
    own = dictionary.model[np.array(dictionary.owners) == name]
    left = dictionary.table.without(rest)
    return gain_of(left, own, np.diag(dictionary.table.total))[0]


def owned_price(dictionary: Dictionary, effect: Effect, rivals: int) -> float:
    """What an effect of the model pays beside all others, its shapes known.

    Springs that were held because they would drive were chosen: out of as many ways are those that
    are left.
    """
    left = dictionary.table.without(dictionary.without([effect.name]))
    raw = np.diag(dictionary.table.total)
    columns = dictionary.coefficients(effect.name)
    signs = one_signed(effect.name, dictionary.target)
    ways = comb(len(effect.terms), len(columns)) if effect.name in LOOPS else 1
    return evidence_of(effect.name, signs, left, columns, raw).price(float(ways), rivals)


def missed(dictionary: Dictionary, named: Sequence[Effect], other: Effect) -> float:
    """What the forms of named effects may miss, and another effect may seem to explain, in χ²."""
    return max((_missed_by(dictionary, effect, other) for effect in named), default=0.0)


def _missed_by(dictionary: Dictionary, named: Effect, other: Effect) -> float:
    bends = bool(other.reads) and set(other.reads) <= set(named.reads)  # a constant bends nothing
    share = SETTINGS.bends if bends else _share(named)
    return share * owned_gain(dictionary, named.name)


def undecided(
    offer: Offer, others: Sequence[Offer], dictionary: Dictionary, named: Sequence[Effect]
) -> str:
    """An offer that explains most of the same, as well but for what the forms of names may miss.

    That moves every gain by about as much: a smaller lead does not tell causes apart. Where runs
    show both as the same, they are aliases, which is said elsewhere.
    """
    unsure = max((_share(e) * owned_gain(dictionary, e.name) for e in named), default=0.0)
    raw = np.diag(dictionary.table.total)
    for other in others:
        if other is offer or abs(offer.gain - other.gain) >= unsure:
            continue
        both = np.concatenate([dictionary.model, other.columns])
        kept = gain_of(dictionary.table.without(both), offer.columns, raw)[0]
        if offer.price < kept < SAME_CAUSE * offer.gain:
            return other.effect.name
    return ""


def pays_beside_forms(
    study: Study, whitening: Whitening, dictionary: Dictionary, work: Working, effect: Effect,
    gain: float,
) -> bool:  # fmt: skip
    """Whether an effect clearly pays its price beside a model whose suspected forms are freed.

    Suspected is each name that may miss half of `gain`, which the effect gains beside the forms as
    they are. It does not where one of them cannot be freed, or where what is freed holds the
    effect's own channels, too. Of long logs a part is looked at.
    """
    names = [e for e in work.named if e.name != effect.name]
    suspected = [e for e in names if _missed_by(dictionary, e, effect) > SUSPECTED * gain]
    if any(set(effect.reads) <= set(e.reads) for e in suspected):
        return False
    problem = study.thinned().problem
    freed = [_functions(problem, e) for e in suspected]
    if not all(freed):
        return False
    rest = work.having([e for e in work.effects if e.name != effect.name])
    functions = [group for groups in freed for group in groups]
    table = tabulated(problem, rest.sheet(beside=[effect], functions=functions), whitening)
    first, count = len(rest.owners()), len(effect.terms)
    columns = np.arange(first, first + count)
    left = table.without(np.setdiff1d(np.arange(len(table.total) - 1), columns))
    signs = one_signed(effect.name, dictionary.target)
    told = evidence_of(effect.name, signs, left, columns, np.diag(table.total))
    return told.gain >= SETTINGS.freed * told.price(1.0, len(dictionary.candidates))


def _functions(problem: Problem, effect: Effect) -> list[Nameless]:
    """All functions of no other channels than those of an effect, and of what these have been.

    Empty where they cannot take its place: it remembers, changes at once with the direction, is a
    wave, or a channel of it is not measured.
    """
    if effect.ripple or effect.info.remembers or WIDTH in effect.shapes:
        return []
    load = problem.known_load
    own = {load if name == "load" else name for name in effect.reads}
    told = [({channel_told(c, load) for c in g.channels}, g) for g in nameless_of(problem)]
    found = [group for channels, group in told if channels <= own]
    covered = {name for channels, _ in told if channels <= own for name in channels}
    return found if own <= covered else []


def _share(named: Effect) -> float:
    """Of the gain of a named effect, what its form may miss."""
    return SETTINGS.memory if named.info.remembers else SETTINGS.form


HELD_OUT = 0.5  # of its gain above its price that an effect must have on left-out folds
REACH = 0.5  # of its price, that an offer has to gain for its shape to be looked for in between
LEFT_OF_FORM = "no more than what the form of a named effect misses"


@dataclass(frozen=True)
class Limits:
    """How strict a search is. `lax`: for a first look, without the floors."""

    lax: bool = False
    most: int = SETTINGS.names


@dataclass(frozen=True)
class Step:
    """One name taken: effect, gain and price in χ² at that moment, and the offers beside it."""

    effect: Effect
    gain: float
    price: float
    offers: tuple[Offer, ...]


@dataclass
class Searcher:
    """A search at one noise; `refused` says why the best offers were not taken."""

    study: Study
    whitening: Whitening
    limits: Limits
    say: Callable[[str], object] = lambda _: None
    refused: dict[str, str] = field(default_factory=dict)

    def run(self, work: Working) -> tuple[Working, float, list[Step]]:
        """Return the model with all names, its squares over σ², and the steps."""
        work, squares = self.fitted(work)
        steps: list[Step] = []
        seen = set()
        while len(work.named) < self.limits.most:
            taken = self._best(work, squares, steps)
            if taken is None:
                break
            work, squares, step = taken
            steps.append(step)
            self.say(f"{step.effect.name} beside {len(work.effects) - 1} effects")
            work, squares = self._examined(work, squares)
            key = frozenset((e.name, e.harmonics) for e in work.named)
            if key in seen:
                break
            seen.add(key)
        return work, squares, steps

    def fitted(self, work: Working) -> tuple[Working, float]:
        """Refit a model on the rows that its memory allows, all its springs of one sign."""
        problem, target = self.study.problem, self.study.target
        work, squares = refitted(problem, work, self.whitening)
        while spring := driving_spring(work, target):
            work, squares = refitted(problem, work.holding(spring, 0.0), self.whitening)
        return work, squares

    def _worse(self, work: Working, other: Working) -> bool:
        """Whether a model's error on left-out runs exceeds another's, however both are fitted.

        In the noise's own metric a fit is the sharpest while the model is right; of a model that
        still lacks much, a plain fit foretells more.
        """
        if not self._foretells_less(work, other, self.whitening):
            return False
        problem = self.study.problem
        plain = plain_rows(problem, other)
        made, before = (refitted(problem, one, plain)[0] for one in (work, other))
        return self._foretells_less(made, before, plain)

    def _foretells_less(self, work: Working, other: Working, metric: Whitening) -> bool:
        made, before = (held_out(self.study.problem, one, metric) for one in (work, other))
        return made.worse_than(before, 1.0 + 0.5 * SETTINGS.negligible)

    def pruned(self, work: Working) -> Working:
        """Drop names that do not pay their price beside the others, on left-out folds too."""
        while work.named:
            dictionary = self.study.dictionary(work, self.whitening)
            rivals = len(dictionary.candidates)
            net = {e.name: owned_gain(dictionary, e.name) - owned_price(dictionary, e, rivals)
                   for e in work.named}  # fmt: skip
            worst = min(net, key=lambda name: net[name])
            rest, _ = self.fitted(work.having([e for e in work.effects if e.name != worst]))
            if net[worst] > 0.0 and not self._worse(work, rest):
                break
            work = rest
        return work

    def _best(
        self, work: Working, squares: float, steps: list[Step]
    ) -> tuple[Working, float, Step] | None:
        dictionary, ranked = self._offered(work, squares)
        floor = {o.effect.name: self._missed(dictionary, work, o.effect, o.gain, o.price)
                  for o in ranked}  # fmt: skip
        worthy = [
            o for o in ranked if self._worthy(o, dictionary, floor[o.effect.name], work, ranked)
        ]
        while worthy:
            near = [o for o in worthy if o.gain >= SETTINGS.most * worthy[0].gain][: SETTINGS.tried]
            made = [self._tried(o, work, squares, floor[o.effect.name]) for o in near]
            trials = [trial for trial in made if trial is not None]
            if trials:
                chosen, left, offer, gain = max(trials, key=lambda t: _ranked(t[-1], t[2]))
                beside = tuple(ranked[: SETTINGS.tried])
                return chosen, left, Step(offer.effect, gain, offer.price, beside)
            worthy = [o for o in worthy if o not in near]
        return None

    def _offered(self, work: Working, squares: float) -> tuple[Dictionary, list[Offer]]:
        """Every candidate beside a model, the best first.

        A shape between those that were screened may pay the price that the nearest of them does
        not: where that one comes near, the shape is fitted.
        """
        dictionary = self.study.dictionary(work, self.whitening)
        rivals = len(dictionary.candidates)
        made = offers(dictionary, dictionary.model, rivals, signed=not self.limits.lax)
        close = [o for o in made if own_shapes(o.effect) and REACH * o.price < o.gain < o.price]
        close = [] if self.limits.lax else close
        better = [effect for o in close if (effect := self._bent(o, work, squares)) is not None]
        for effect in better:
            self.study.refine(work.effects, effect)
        if better:
            dictionary = self.study.dictionary(work, self.whitening)
            made = offers(dictionary, dictionary.model, rivals)
        return dictionary, sorted(made, key=_rank, reverse=True)

    def _bent(self, offer: Offer, work: Working, squares: float) -> Effect | None:
        """The effect of an offer with the shapes that pay its price, if any do."""
        made, left = self.fitted(work.having([*work.effects, offer.effect]))
        if squares - left < offer.price:
            return None
        fitted = made.effects[-1].shapes
        return offer.effect.with_shapes(**{n: fitted[n] for n in own_shapes(offer.effect)})

    def _tried(
        self, offer: Offer, work: Working, squares: float, missed: float
    ) -> tuple[Working, float, Offer, float] | None:
        """The model with an offer, its shapes refitted; None where it cannot be taken."""
        made, left = self.fitted(work.having([*work.effects, offer.effect]))
        gain = squares - left
        if gain < offer.price:
            return None
        if self.limits.lax:
            return made, left, offer, gain
        reason = impossible(made, offer.effect.name, self.study.problem)
        if not reason and gain < missed:
            reason = LEFT_OF_FORM
        if not reason and self._worse(made, work):
            reason = "raises the error on left-out runs"
        if reason:
            self.refused[offer.effect.name] = reason
            return None
        return made, left, offer, gain

    def _worthy(
        self,
        offer: Offer,
        dictionary: Dictionary,
        missed: float,
        work: Working,
        beside: Sequence[Offer],
    ) -> bool:
        if offer.net <= 0.0:
            return False
        if self.limits.lax:
            return True
        if offer.gain < missed:
            self.refused[offer.effect.name] = LEFT_OF_FORM
            return False
        equal = undecided(offer, beside, dictionary, work.named)
        if equal:
            self.refused[offer.effect.name] = (
                f"what the form of a named effect misses may be all that tells it from {equal}"
            )
            return False
        foretold = foretold_gain(dictionary.table, dictionary.model, offer.columns, offer.gain)
        share = 0.5**2 if foretold.min() > 0.0 else HELD_OUT
        if float(foretold.sum()) < share * offer.net:
            self.refused[offer.effect.name] = "does not hold on left-out runs"
            return False
        return True

    def _missed(
        self, dictionary: Dictionary, work: Working, effect: Effect, gain: float, cost: float
    ) -> float:
        """What the forms of other names may miss, χ²; 0 if the effect clearly pays beside any."""
        others = [e for e in work.named if e.name != effect.name]
        most = missed(dictionary, others, effect)
        if self.limits.lax or not cost <= gain < most:
            return most
        pays = pays_beside_forms(self.study, self.whitening, dictionary, work, effect, gain)
        return 0.0 if pays else most

    def _examined(self, work: Working, squares: float) -> tuple[Working, float]:
        """Replace or drop earlier names where that is better; every name once."""
        for effect in work.named:
            if len(work.named) < 2 or effect.name not in [e.name for e in work.named]:
                continue
            dictionary = self.study.dictionary(work, self.whitening, without=effect.name)
            rivals = len(dictionary.candidates)
            rest = dictionary.without([effect.name])
            own = owned_gain(dictionary, effect.name)
            floor = owned_price(dictionary, effect, rivals)
            missed = self._missed(dictionary, work, effect, own, floor)
            others = [e for e in work.effects if e.name != effect.name]
            best = max(
                offers(dictionary, rest, rivals), key=lambda o: _ranked(o.gain, o), default=None
            )
            if own < max(floor, missed):
                work, squares = self.fitted(work.having(others))
                continue
            if best is None or best.gain - best.price <= own - floor:
                continue
            swapped = [best.effect if e.name == effect.name else e for e in work.effects]
            trial, left = self.fitted(work.having(swapped))
            margin = SETTINGS.negligible * own * max(freedom(best.effect) - freedom(effect), 0)
            better = left + best.price + margin < squares + floor
            if better and not impossible(trial, best.effect.name, self.study.problem):
                work, squares = trial, left
        return work, squares


def _rank(offer: Offer) -> float:
    return _ranked(offer.gain, offer)


def ranked(gain: float, effect: Effect) -> float:
    """Gain, less a share of it for every column and shape beyond the first."""
    return gain * (1.0 - SETTINGS.negligible * (freedom(effect) - 1))


def _ranked(gain: float, offer: Offer) -> float:
    return ranked(gain, offer.effect) - offer.price


def freedom(effect: Effect) -> int:
    """How many numbers an effect is fitted by; a shape that all friction shares is none of its.

    Springs of one sign are about as free as one: their columns are alike (`cone_price`).
    """
    return (1 if effect.name in LOOPS else len(effect.terms)) + len(own_shapes(effect))


def own_shapes(effect: Effect) -> list[str]:
    """Shapes that are fitted, but for those that all friction shares."""
    return [s.name for s in effect.fitted_shapes if s.name not in SHARED]
