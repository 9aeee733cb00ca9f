"""Forward selection of missing effects, with removal and exchange of earlier ones.

Each round refits the shapes of the model, offers every candidate in its best form beside it, and
takes the best that exceeds its significance threshold (`evidence.py`), gains half as much on
held-out folds too, gains more than the form of a name may miss (`missed`: no form is exact), and is
physically possible (`physics.py`). Then a name that is no longer significant is removed, and one is
exchanged for another, or for two, where that explains more above its threshold.
All of these are computed from one Gram matrix, and only the best is fitted.

Of long logs short segments spread evenly are searched first. The search on all rows starts from
that result: each name in the form that all rows show, or none; then it adds what only these show.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline.discovery.basis import (
    LEAD,
    TURNS,
    Functions,
    bent_forms,
    places_of,
    turning_over,
)
from flexspline.discovery.candidates import (
    EXCLUDED,
    TAKEN,
    Candidate,
    SeenOrders,
    candidates_for,
    order_candidates,
    possible,
    scanned,
    span_of,
    unseen_of,
)
from flexspline.discovery.evidence import (
    Dictionary,
    Offer,
    dictionary_of,
    held_out_gain,
    offers,
    threshold,
    threshold_of,
)
from flexspline.discovery.physics import (
    LOOPS,
    WIDTH,
    driving_spring,
    falling_power,
    impossible,
)
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import CATALOGUE, UNITS, Effect, Harmonic
from flexspline.effects.causes import (
    COULOMB,
    GRAVITY,
    LAG,
    ONE_SINE,
    PRESLIDING,
    STRIBECK,
    WAVE_GENERATOR_RIPPLE,
)
from flexspline.least_squares.options import SHARED
from flexspline.least_squares.problem import Problem, problem_of
from flexspline.logs.checks.dependence import Dependence
from flexspline.logs.derive import with_motion
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step
from flexspline.regression.candidate_model import CandidateModel, refitted, solved_at, started
from flexspline.regression.gram import (
    Columns,
    Given,
    Whitening,
    gain_of,
    gains_of,
    left_of,
    rows_of,
    solved,
    tabulated,
    thinned,
)
from flexspline.signals import require_one_unit

__all__ = [
    "FEW_PLACES",
    "SearchContext",
    "Searcher",
    "cost_of",
    "form_of",
    "freedom",
    "missed",
    "search_context_of",
    "share_missed",
]  # fmt: skip

Array = NDArray[np.float64]


@dataclass(eq=False, repr=False)
class SearchContext:
    """Problem, effects that may be missing, why others are not tried, and orders found.

    `tied`: channels that are nearly a function of another. `last`, `known`: what was asked for
    before, a table and the candidates beside models. `late`: s, by which the target was late before
    all else was moved to it.
    """

    problem: Problem
    possible: list[Effect]
    not_tried: dict[str, str]
    orders: SeenOrders = field(default_factory=SeenOrders)
    tied: tuple[Dependence, ...] = ()
    last: tuple[CandidateModel, Whitening, Dictionary] | None = None
    known: dict[tuple[Effect, ...], tuple[SeenOrders, list[Candidate]]] = field(
        default_factory=dict
    )
    late: float = 0.0

    @property
    def target(self) -> str:
        return self.problem.target

    def thinned(self, parts: int | None = None) -> SearchContext:
        """The same for a part of long logs, `parts` of `rows` or more; itself for others."""
        parts = SETTINGS.tried - 1 if parts is None else parts
        news = rows_of(self.problem) // self.problem.decimation
        share = round(0.5 * SETTINGS.bends * news)
        enough = max(share, parts * SETTINGS.rows)
        part = thinned(self.problem, enough, SETTINGS.rows // 2, LEAD)
        return self if part is self.problem else replace(self, problem=part, last=None, known={})

    def candidates(self, model: Sequence[Effect]) -> list[Candidate]:
        """Return what may be missing beside a model."""
        orders, made = self.known.get(tuple(model), (None, []))
        if orders is not self.orders:
            orders_of = self.orders_of([e.name for e in self.possible], model)
            made = candidates_for(model, self.possible, self.problem, orders_of)
            self.known[tuple(model)] = self.orders, made
        return made

    def orders_of(
        self, names: Sequence[str], model: Sequence[Effect]
    ) -> dict[str, tuple[Harmonic, ...]]:
        """Return the orders that ripple effects of these names may have beside a model."""
        facts, span = self.problem.runs[0].log.facts, span_of(self.problem)
        return order_candidates(names, facts, self.orders, model, self.target, span)

    def dictionary(
        self, work: CandidateModel, whitening: Whitening, *, without: Sequence[str] = ()
    ) -> Dictionary:
        """Return the table of a model and all candidates, beside it or beside it without some."""
        candidates = self.beside(work, without)
        at, noise, last = self.last or (None, None, None)
        if last and at is work and noise is whitening and (found := last.of(candidates)):
            return found
        names = [effect.name for effect in work.named]
        every = [without, (), *((name,) for name in names)]
        wanted = [e for out in every for c in self.beside(work, out) for e in c.effects]
        made = dictionary_of(self.problem, work, wanted, whitening)
        self.last = work, whitening, made
        return replace(made, candidates=tuple(candidates))

    def beside(self, work: CandidateModel, without: Sequence[str]) -> list[Candidate]:
        """What may stand beside a model, or beside it in the place of some of its effects."""
        return self.candidates([e for e in work.effects if e.name not in without])

    def scan(self, work: CandidateModel, whole: Problem) -> None:
        """Look for orders in what a model leaves; those of earlier scans stay.

        `whole`: all rows. Of many a part is looked at, in long pieces: the angles between short
        ones are what tells an order from the next.
        """
        rows = round(SETTINGS.rows / SETTINGS.little)
        seen = thinned(whole, rows, SETTINGS.rows, LEAD)
        logs = [run.log for run in seen.runs]
        residuals = left_of(seen, work.effects, work.coefficients, work.coefficients)
        self.orders = self.orders.joined(scanned(logs, residuals, UNITS[self.target]))


def search_context_of(
    base: Sequence[Effect],
    logs: Sequence[Log],
    target: str,
    *,
    known_load: str | None,
    exclude: Iterable[str] = (),
    own: Sequence[Effect] = (),
    inputs: Sequence[Log] | None = None,
    **rest: Any,
) -> SearchContext:
    """Make logs ready for the base and every effect that they could show beside it.

    `own`: effects of the user's that are candidates too. `rest`: as for `problem_of`.

    Raises
    ------
    InputError
        As `fit`, for the base alone; for a name in `exclude` that is no effect or is in the base.
    """
    require_one_unit(base, target, known_load)
    inputs = [with_motion(log) for log in (logs if inputs is None else inputs)]
    effects, reasons = possible(base, inputs, target, known_load, exclude, own)
    kept = [e for e in effects if _finite(e, logs, reasons)]
    problem = problem_of(
        logs, [*base, *kept], target, known_load=known_load, inputs=inputs, **rest
    )  # fmt: skip
    runs = tuple(replace(run, stretches=run.unbroken) for run in problem.runs)
    return SearchContext(replace(problem, runs=runs), kept, reasons)


def _finite(effect: Effect, logs: Sequence[Log], reasons: dict[str, str]) -> bool:
    """Whether its channels are finite as recorded; a candidate's fault is no fault of the base.

    Rows between gaps that are too few to derive a motion of do not count (`problem_of`).
    """
    for log in logs:
        for name in effect.reads:
            if name in log and not np.isfinite(log[name]).all():
                reasons[effect.name] = f"log '{log.name}': {name} is not finite throughout"
                return False
    return True


def form_of(effect: Effect) -> float:
    """Of what an effect explains, the share that its form may miss."""
    return SETTINGS.memory if effect.info.remembers else SETTINGS.form


def missed(
    dictionary: Dictionary, named: Effect, other: Effect, tied: Sequence[Dependence]
) -> float:
    """What the form of a named effect may miss, and another may seem to explain, in χ²."""
    return share_missed(named, other, tied) * dictionary.gain(named.name)


def share_missed(named: Effect, other: Effect, tied: Sequence[Dependence]) -> float:
    """Of what a named effect explains, the share that its form may miss and another may show."""
    return SETTINGS.bends if _bends(other, named, tied) else form_of(named)


def _bends(effect: Effect, named: Effect, tied: Sequence[Dependence]) -> bool:
    """Whether an effect reads nothing but a name's channels, and may bend its form.

    Nor, unless it remembers, what is nearly a function of these. A constant bends nothing, and laws
    are bent by nothing: the torque of a rigid body, and what is in proportion to a known load.
    """
    reads, own = {*named.reads}, {*effect.reads}
    pairs = [{one.channel, one.of} for one in tied if not effect.info.remembers]
    seen = reads.union(*(pair for pair in pairs if pair & reads))
    law = named.info.traits.carries_load or named.info.traits.known_load
    return bool(own) and own <= seen and not law


LEFT_OF_FORM = "no more than what the form of a named effect misses"
NOISE_OF_LOAD = "no more than what the noise of the known load gives it"
SPEED = "output_velocity"
MOTOR_TORQUE, MOTOR_CURRENT = "motor_torque", "motor_current"
FEW_PLACES = "it is at a few angles of the output, and does not come again between them"
UNMODULATED = "the same orders explain as much with one amplitude at all speeds"
BY_SMOOTHING = "the motion smoothed more or less explains as much"
BY_FILTER = "the filter or delay by which the torque is late explains as much"


def _filtered(
    problem: Problem, told: Sequence[Array], sooner: float, constant: float
) -> tuple[Array, ...]:
    """What a first-order filter of a time constant changes of values (N,) of each run, s, and what
    taking them sooner does."""
    changed = list[Array]()
    for values, run in zip(told, problem.runs, strict=True):
        time = run.log["time"]
        moved = np.interp(time + sooner, time, values)
        if constant > 0.0:
            kept = np.exp(-median_step(time) / constant)
            moved, _ = lfilter([1.0 - kept], [1.0, -kept], moved, zi=[kept * moved[0]])
        changed.append(moved - values)
    return tuple(changed)


@dataclass
class Searcher:
    """A search at one noise; `refused` says why the best offers were not taken.

    `lax`: for a first look, with no more than thresholds. `kept`: what effects gained beside a
    model and columns that were given.
    """

    context: SearchContext
    whitening: Whitening
    lax: bool = False
    say: Callable[[str], object] = lambda _: None
    refused: dict[str, str] = field(default_factory=dict)
    kept: dict[Any, dict[Effect, float]] = field(default_factory=dict, repr=False)

    def run(self, work: CandidateModel) -> tuple[CandidateModel, list[Offer]]:
        """Return the model with all names, and these with what they gained as they were taken."""
        work, squares = self.fitted(work)
        steps: list[Offer] = []
        seen = set()
        while len(work.named) < SETTINGS.names:
            taken = self._best(work, squares)
            if taken is None:
                break
            work, squares, step = taken
            steps.append(step)
            self.say(f"{step.effect.name} beside {len(work.effects) - 1} effects")
            work, squares = self._examined(*self._off_bounds(work, squares))
            key = frozenset((e.name, e.harmonics) for e in work.named)
            if key in seen:
                break
            seen.add(key)
        if not self.lax and GRAVITY in [e.name for e in work.named]:
            work, _ = self._reordered(work, squares, [GRAVITY])  # no sooner: a sine is its first
        return work, steps

    def fitted(self, work: CandidateModel) -> tuple[CandidateModel, float]:
        """Refit a model, its springs of one sign, and what runs do not show (`unseen`) at zero.

        Nor does a power of the speed make friction fall from rest, where another power is left.
        """
        problem, target = self.context.problem, self.context.target
        if (hidden := unseen_of(work.named, problem)).keys() - work.fixed.keys():
            work = replace(work, fixed={**hidden, **work.fixed}).having(work.effects)
        work, squares = refitted(problem, work, self.whitening)
        while against := driving_spring(work, target) or falling_power(work, problem):
            work, squares = refitted(problem, work.holding(against, 0.0), self.whitening)
        return work, squares

    def _off_bounds(self, work: CandidateModel, squares: float) -> tuple[CandidateModel, float]:
        """Look anew for shapes that stand at a bound: a poorer model may have driven them there."""
        if not work.bound:
            return work, squares
        trial, _ = started(self.context.problem, work, self.whitening, work.bound)
        trial, left = self.fitted(trial)
        return (trial, left) if left < squares else (work, squares)

    def again(self, work: CandidateModel) -> CandidateModel:
        """The names of a part of the rows on all of them: each in its best form, if it holds."""
        work, squares = self.fitted(work)
        for effect in work.named:
            dictionary = self.context.dictionary(work, self.whitening, without=[effect.name])
            made = offers(dictionary, dictionary.without([effect.name]), plain=True)
            cost = cost_of(dictionary, work, effect.name)
            least = dictionary.gain(effect.name) - cost
            for offer in (o for o in made if o.effect.name == effect.name and o.net > least):
                effects = [offer.effect if e.name == effect.name else e for e in work.effects]
                trial, left = self.fitted(work.having(effects))
                if left + offer.threshold < squares + cost:
                    work, squares = trial, left
        work = self.pruned(work)
        for name in [effect.name for effect in work.named]:
            there = name in [effect.name for effect in work.named]
            if there and (reason := self.forbidden(work, name)):
                self.refused[name] = reason
                work = self.pruned(self.fitted(self.less(work, name))[0])
        return work

    def pruned(self, work: CandidateModel) -> CandidateModel:
        """Drop names that do not exceed their threshold beside the others."""
        while work.named:
            dictionary = self.context.dictionary(work, self.whitening)
            net = {e.name: dictionary.gain(e.name) - max(self._owed(dictionary, work, e))
                   for e in work.named}  # fmt: skip
            worst = min(net, key=lambda name: net[name])
            if net[worst] > 0.0:
                break
            work, _ = self.fitted(self.less(work, worst))
        return work

    def less(self, work: CandidateModel, *names: str) -> CandidateModel:
        """The model without some effects, and without those that read a load which these made."""
        rest = work.without(*names)
        known = self.context.problem.known_load is not None
        if known or any(effect.info.carries_load for effect in rest.effects):
            return rest
        return rest.without(*(effect.name for effect in rest.named if "load" in effect.reads))

    def _owed(
        self, dictionary: Dictionary, work: CandidateModel, effect: Effect
    ) -> tuple[float, float]:
        """What a name has to gain beside all others: its threshold, its shapes known; and what the
        forms of others miss or the noise of the load gives.
        """
        cost = cost_of(dictionary, work, effect.name)
        if self.lax:
            return cost, 0.0
        form = self._missed(dictionary, work, effect, dictionary.gain(effect.name))
        noise = dictionary.by_noise(dictionary.own(effect.name), dictionary.without([effect.name]))
        return cost, max(form, noise)

    def _examined(self, work: CandidateModel, squares: float) -> tuple[CandidateModel, float]:
        """Drop names, or exchange them for one or two others where that is better."""
        for name in [effect.name for effect in work.named]:
            if name in {effect.name for effect in work.named}:
                work, squares = self._changed(work, squares, name)
        if self.lax:
            return work, squares
        others = [e.name for e in work.named if e.name != GRAVITY]
        return self._reordered(work, squares, others)

    def _reordered(
        self, work: CandidateModel, squares: float, outs: Sequence[str]
    ) -> tuple[CandidateModel, float]:
        """Take the orders of a ripple anew in the place of its own and of another name, of `outs`.

        Both may stand for these: the first order that is taken is that of a poorer model. A sine is
        no order in the place of gravity.
        """
        dictionary = self.context.dictionary(work, self.whitening)
        for ripple in (e for e in work.named if e.harmonics):
            beside = dictionary.of(self.context.beside(work, [ripple.name]))
            for out in (name for name in outs if name != ripple.name):
                both, rest = (ripple.name, out), self.less(work, out)
                if beside is None or len(rest.effects) + 1 < len(work.effects):
                    continue
                made = offers(beside, dictionary.without(both), plain=True, only=ripple.name)
                for offer in made:
                    each = offer.threshold / len(offer.effect.harmonics)  # of orders, old or new
                    cost = each * len(ripple.harmonics) + cost_of(dictionary, work, out)
                    if offer.net <= dictionary.gain(*both) - cost:
                        continue
                    effects = [offer.effect if e is ripple else e for e in rest.effects]
                    trial, left = self.fitted(rest.having(effects))
                    paid = left + offer.threshold < squares + cost
                    if paid and self._pays(trial, [offer.effect]):
                        return trial, left
        return work, squares

    def _changed(
        self, work: CandidateModel, squares: float, out: str
    ) -> tuple[CandidateModel, float]:
        """The best of a model: as it is, less a name below its threshold, or with an exchange.

        Two in the place of one have to be better than that one and the best that may follow it.
        """
        dictionary = self.context.dictionary(work, self.whitening, without=[out])
        model, rest = dictionary.without([out]), self.less(work, out)
        own = next(effect for effect in work.named if effect.name == out)
        cost, form = self._owed(dictionary, work, own)
        gain = dictionary.gain(out)
        if gain < max(cost, form):
            return self.fitted(rest)
        if len(rest.effects) + 1 < len(work.effects):  # others read the load of this one
            return work, squares
        least = gain - cost
        instead = [o for o in self._instead(dictionary, model, out) if _net(o) > least]
        rivals = [first.effect for first, *_ in instead]
        worthy = (o for o in instead if self._worthy(o[0], dictionary, rest, model, rivals))
        best = next(worthy, None)
        if best is None:
            return work, squares
        if len(best) > 1:
            least += _net(self._worth(dictionary, work, dictionary.model)[:1])
        added = [offer.effect for offer in best]
        trial, left = self.fitted(rest.with_effects(*added))
        margin = max(sum(map(freedom, added)) - freedom(own), 0)
        paid = sum(offer.threshold for offer in best) + SETTINGS.negligible * gain * margin
        if squares + gain - left - paid > least and self._pays(trial, added):
            return trial, left
        return work, squares

    def _instead(self, dictionary: Dictionary, model: Columns, out: str) -> list[list[Offer]]:
        """Return what may take the place of a name, the best first: one, or two for one.

        In gravity's place orders of the output may be.
        """
        plain = out != GRAVITY

        def beside(columns: Columns, *but: str) -> list[Offer]:
            made = offers(dictionary, columns, plain=plain)
            made = [offer for offer in made if offer.effect.name not in (out, *but)]
            return sorted(made, key=_rank, reverse=True)

        made = [[offer] for offer in beside(model)]
        for (first,) in made[: SETTINGS.tried] if not self.lax else ():
            both = np.concatenate([model, first.columns])
            made += [[first, second] for second in beside(both, first.effect.name)[:1]]
        return sorted(made, key=lambda those: sum(map(_rank, those)), reverse=True)

    def _pays(self, work: CandidateModel, added: Sequence[Effect]) -> bool:
        """Whether new names of a fitted model are possible and gain what they owe."""
        if any(self.forbidden(work, effect.name) for effect in added):
            return False
        if len(added) == 1:
            return True
        dictionary = self.context.dictionary(work, self.whitening)
        new = [e for e in work.named if e.name in {effect.name for effect in added}]
        return all(dictionary.gain(e.name) >= max(self._owed(dictionary, work, e)) for e in new)

    def _best(
        self, work: CandidateModel, squares: float
    ) -> tuple[CandidateModel, float, Offer] | None:
        """The model with the best offer that can be taken; None where none can."""
        dictionary = self.context.dictionary(work, self.whitening)
        worthy = self._worth(dictionary, work, dictionary.model)
        while worthy:
            best = worthy[0].gain
            near = [o for o in worthy if o.gain >= _near(work, o.effect) * best][: SETTINGS.tried]
            trials = [trial for o in near if (trial := self._tried(o, dictionary, work, squares))]
            if trials:
                return max(trials, key=lambda trial: _rank(trial[2]))
            worthy = [offer for offer in worthy if offer not in near]
        return None

    def _worth(self, dictionary: Dictionary, work: CandidateModel, model: Columns) -> list[Offer]:
        """Offers beside a model that are worth a fit, the best first."""
        made = sorted(offers(dictionary, model, plain=True), key=_rank, reverse=True)
        rivals = [offer.effect for offer in made if offer.net > 0.0]
        return [offer for offer in made if self._worthy(offer, dictionary, work, model, rivals)]

    def _worthy(
        self,
        offer: Offer,
        dictionary: Dictionary,
        work: CandidateModel,
        model: Columns,
        rivals: Sequence[Effect],
    ) -> bool:
        """Whether an offer is worth a fit; `rivals`: effects that may be asked of next."""
        if offer.net <= 0.0 or self.lax:
            return offer.net > 0.0
        noise = dictionary.by_noise(offer.columns, model)
        if noise > dictionary.table.gain(offer.columns, model):  # that of orders is another
            self.refused[offer.effect.name] = NOISE_OF_LOAD
            return False
        if offer.gain < self._missed(dictionary, work, offer.effect, offer.gain, rivals):
            self.refused[offer.effect.name] = LEFT_OF_FORM
            return False
        if work.bound:  # folds say little of a model that its shapes cannot follow
            return True
        rise = held_out_gain(dictionary.table, model, offer.columns, offer.gain)
        if float(rise.sum()) < 0.5 * offer.gain:
            self.refused[offer.effect.name] = "does not hold on held-out runs"
            return False
        return True

    def _missed(
        self,
        dictionary: Dictionary,
        work: CandidateModel,
        effect: Effect,
        gain: float,
        rivals: Sequence[Effect] = (),
    ) -> float:
        """What the forms of names may miss, χ²; 0 if an effect is clear beside freed forms.

        ∞ where what bends friction over the speed, or behind a reversal, is no more than how it
        turns over at rest, as the model says it does: not where its width stands at a bound.

        Freed (`Bent`) are those that may miss half of its gain. Of long logs a part is looked at.
        """
        tied, others = self.context.tied, [e for e in work.named if e.name != effect.name]
        names = {e.name: missed(dictionary, e, effect, tied) for e in others}
        most = max(names.values(), default=0.0)
        problem = self.context.thinned().problem
        least = threshold(len(effect.terms), 1.0, len(dictionary.candidates))
        rest = [e for e in work.effects if e.name != effect.name]
        poor = any(work.searched[k].name == WIDTH for k in work.bound)  # a better one is no wider
        turning = turning_over(problem, rest) if _at_reversals(effect) and not poor else None
        more = rows_of(self.context.problem) / rows_of(problem)
        alike = [e for e in rivals if _at_reversals(e)]
        if turning and more * self._kept(problem, work, effect, turning, (), alike) < least:
            return np.inf
        if gain >= most:
            return most
        if self._closes_most(work, effect):
            return 0.0
        bent = tuple(e for e in others if names[e.name] > 0.5 * gain)
        freed = bent_forms(problem, bent)
        if freed is None:
            return most
        kept = self._kept(problem, work, effect, freed, bent, rivals)
        return 0.0 if kept >= SETTINGS.freed * least else most

    def _closes_most(self, work: CandidateModel, effect: Effect) -> bool:
        """Whether an effect alone explains nearly all that the base leaves, in the target's unit.

        What the form of a name misses is a small part of it. Behind the noise's filter it may seem
        to be more: what is sharp is most of the evidence there, and little of the torque.
        """
        problem, rest = self.context.thinned().problem, work.without(effect.name)
        plain = Whitening(np.ones(1), 1.0, problem.decimation)
        table = tabulated(problem, rest.assembly(bends=False, beside=[effect]), plain)
        model = np.arange(len(rest.free))
        own = model.size + np.arange(len(effect.terms))
        given = [e.name for e in rest.effects[: rest.base]]
        base = model[np.isin(rest.effect_of[rest.free], given)]
        return table.gain(own, model) >= SETTINGS.most * float(table.without(base)[-1, -1])

    def _kept(
        self,
        problem: Problem,
        work: CandidateModel,
        effect: Effect,
        given: Given,
        bent: tuple[Effect, ...],
        rivals: Sequence[Effect],
    ) -> float:
        """What an effect gains beside a model and given columns: other forms of `bent`.

        Its rivals are asked of with it beside other forms, and from the second effect on that is
        asked of beside the same, for most of the work is the same.
        """
        rest = work.without(effect.name)
        fixed = tuple(sorted(rest.fixed.items()))
        known = self.kept.setdefault((rest.effects, rest.coefficients.tobytes(), fixed, bent), {})
        if effect not in known:
            names = {e.name for e in work.effects}
            more = rivals if (known or bent) and effect.name not in names else ()
            together = [effect, *(e for e in more if e not in known and e.name not in names)]
            known.update(self._gains(problem, rest, list(dict.fromkeys(together)), given, not bent))
        return known[effect]

    def _gains(
        self,
        problem: Problem,
        work: CandidateModel,
        effects: Sequence[Effect],
        given: Given,
        turning: bool,
    ) -> dict[Effect, float]:
        """What each effect alone gains beside a model and columns that are given.

        `turning`: whether friction turns over by these (`TURNS`). It never exceeds its level then,
        as Stribeck's does.
        """
        table = tabulated(problem, work.assembly(beside=effects, given=given), self.whitening)
        owners = work.owners()
        ends = np.cumsum([len(owners), *(len(effect.terms) for effect in effects)])
        model = np.delete(np.arange(len(table.total) - 1), np.arange(ends[0], ends[-1]))
        left, raw = table.without(model), np.diag(table.total)
        exceeds = turning and _exceeds(solved(table.total, model), owners.index(COULOMB))
        beside = {STRIBECK: table.without(model[: len(owners)])} if exceeds else {}
        own = zip(effects, ends, ends[1:], strict=False)
        return {
            e: gain_of(beside.get(e.name, left), np.arange(first, last), raw)[0]
            for e, first, last in own
        }

    def _tried(
        self, offer: Offer, dictionary: Dictionary, work: CandidateModel, squares: float
    ) -> tuple[CandidateModel, float, Offer] | None:
        """The model with an offer, its shapes refitted; None where it cannot be taken."""
        effect = offer.effect
        made, left = self.fitted(work.with_effects(effect))
        gain = squares - left
        if gain < offer.threshold:
            return None
        reason = "" if self.lax else self.forbidden(made, effect.name)
        if not self.lax and not reason and gain < self._missed(dictionary, work, effect, gain):
            reason = LEFT_OF_FORM
        if reason:
            self.refused[effect.name] = reason
            return None
        return made, left, replace(offer, gain=gain)

    def forbidden(self, work: CandidateModel, name: str) -> str:
        """Why a name of a fitted model cannot be what it says; empty where it can."""
        reason = impossible(work, name, self.context.problem)
        effect = next(e for e in work.effects if e.name == name)
        if not reason and effect.info.modulated and self._unmodulated(work, effect):
            return UNMODULATED
        if not reason and self._by_smoothing(work, effect):
            return BY_SMOOTHING
        if not reason and name in LOOPS and self._by_filter(work, effect):
            return BY_FILTER
        return reason or (FEW_PLACES if self._at_few_places(work, effect) else "")

    def _by_smoothing(self, work: CandidateModel, effect: Effect) -> bool:
        """Whether an effect loses most of what it gains to the motion smoothed more or less.

        What a smoother takes of a sharp reversal, or leaves of the noise, looks like a lag, a loop
        or friction.
        """
        blur = tuple(run.blur for run in self.context.problem.runs if run.blur is not None)
        whole = len(blur) == len(self.context.problem.runs)
        return whole and self._loses_most(work, effect, blur)

    def _by_filter(self, work: CandidateModel, effect: Effect) -> bool:
        """Whether an effect loses most of what it gains to the rest of a first-order filter.

        All of a late torque was moved by what such a filter takes for half of a step: ln 2 of its
        time constant.
        """
        late, problem = self.context.late, self.context.problem
        if not late:
            return False
        rest = self._solved_without(work, effect.name)
        told = [rest.predict(problem, number) for number in range(len(problem.runs))]
        return self._loses_most(work, effect, _filtered(problem, told, late, late / np.log(2.0)))

    def by_late_friction(self, work: CandidateModel, name: str) -> bool:
        """Whether a loop loses most of what it gains to friction that is as late as the sensor.

        The lag of a sensor is one of its load: of friction that is late, by a filter or by a delay,
        there is no effect.
        """
        if name not in LOOPS or LAG not in {effect.name for effect in work.effects}:
            return False
        problem, rest = self.context.problem, self._solved_without(work, name)
        seconds = max(float(rest.values(LAG)[0]), 0.0)
        losing = {e.name for e in rest.effects if e.info.traits.dissipative}
        own = np.isin(rest.effect_of, [*losing])
        friction = replace(rest, coefficients=np.where(own, rest.coefficients, 0.0))
        told = [friction.predict(problem, number) for number in range(len(problem.runs))]
        effect = next(e for e in work.effects if e.name == name)
        ways = [_filtered(problem, told, 0.0, seconds), _filtered(problem, told, -seconds, 0.0)]
        return any(self._loses_most(work, effect, way) for way in ways)

    def _solved_without(self, work: CandidateModel, name: str) -> CandidateModel:
        """The model without an effect, with the coefficients that it then has."""
        problem = self.context.thinned().problem
        return solved_at(problem, work.without(name), self.whitening)[0]

    def _loses_most(self, work: CandidateModel, effect: Effect, column: tuple[Array, ...]) -> bool:
        """Whether an effect keeps less than half of what it gains beside a column of each run."""
        problem, rest = self.context.thinned().problem, work.without(effect.name)
        given = Functions(column=column)
        table = tabulated(problem, rest.assembly(beside=[effect], given=given), self.whitening)
        model = np.arange(len(rest.owners()))
        own = model.size + np.arange(len(effect.terms))
        return table.gain(own, np.append(model, own[-1] + 1)) < 0.5 * table.gain(own, model)

    def by_untried(self, work: CandidateModel, name: str) -> str:
        """An effect that was not tried and may be what a name says, "" of none.

        It follows the motor's torque, of which the runs have the current alone, without the
        constant; and that explains most of what the name does.
        """
        problem = self.context.problem
        reasons = self.context.not_tried.items()
        untried = (n for n, why in reasons if why not in (EXCLUDED, TAKEN) and n in CATALOGUE)
        found = next((n for n in untried if CATALOGUE[n].reads == (MOTOR_TORQUE,)), "")
        columns = tuple(r.log[MOTOR_CURRENT] for r in problem.runs if MOTOR_CURRENT in r.log)
        if not found or len(columns) < len(problem.runs):
            return ""
        effect = next(e for e in work.effects if e.name == name)
        return found if self._loses_most(work, effect, columns) else ""

    def _unmodulated(self, work: CandidateModel, effect: Effect) -> bool:
        """Whether a ripple whose amplitude follows the speed keeps next to nothing, or no more than
        its form may miss, beside the same orders with one amplitude.
        """
        problem, rest = self.context.problem, work.without(effect.name)
        plain = Effect(WAVE_GENERATOR_RIPPLE).with_orders(effect.harmonics)
        table = tabulated(problem, rest.assembly(beside=[effect, plain]), self.whitening)
        model, count = np.arange(len(rest.owners())), len(effect.terms)
        own = model.size + np.arange(count)
        kept = table.gain(own, np.append(model, own + count))
        least = max(SETTINGS.told**2 + count, form_of(effect) * table.gain(own, model))
        return kept < least

    def _at_few_places(self, work: CandidateModel, effect: Effect) -> bool:
        """Whether as many places of the output's angle explain more than the orders of a ripple.

        Many orders follow a bump. Counted until the orders explain most of what all of them do, and
        more by what chance may give the best place; of a small ripple these runs do not tell.
        """
        if ONE_SINE[1] not in [pair for _, pair in effect.harmonics]:
            return False
        problem = self.context.thinned().problem
        rest = work.without(effect.name)
        assembly = rest.assembly(beside=[effect], given=places_of(problem))
        table = tabulated(problem, assembly, self.whitening)
        own = len(rest.owners()) + np.arange(len(effect.terms))
        left, raw = table.without(np.arange(own[0])), np.diag(table.total)
        orders = greedy(left, raw, own.reshape(-1, 2))
        at = np.arange(own[-1] + 1, len(table.total) - 1)
        gain, least = gain_of(left, own, raw)[0], threshold(1, 1.0, len(at))
        if gain < SETTINGS.doubtful:
            return False
        pairs = zip(orders, greedy(left, raw, at[:, None]), strict=False)
        return next((b > a + least for a, b in pairs if a >= SETTINGS.most * gain), False)


def greedy(left: Array, raw: Array, groups: NDArray[np.intp]) -> Iterator[float]:
    """Yield what the best group of columns explains, the best two, one added after the other."""
    chosen: list[int] = []
    while len(chosen) < len(groups):
        rest = np.setdiff1d(np.arange(len(groups)), chosen)
        trials = np.array([groups[[*chosen, k]].ravel() for k in rest])
        gains, _ = gains_of(left, trials, raw)
        chosen.append(int(rest[gains.argmax()]))
        yield float(gains.max())


def cost_of(dictionary: Dictionary, work: CandidateModel, name: str) -> float:
    """Return the threshold of a name of the model, its shapes known."""
    own = dictionary.own(name)
    own = own[own < len(work.free)]  # shapes come behind all coefficients
    left = dictionary.table.without(dictionary.without([name]))[np.ix_(own, own)]
    return threshold_of(name, dictionary.target, left, 1.0, len(dictionary.candidates))


def _near(work: CandidateModel, effect: Effect) -> float:
    """Of the best gain, from which an offer is tried; less where it may move shapes of the model.

    These are those of a poorer model: without viscous friction, Coulomb friction changes direction
    as slowly as that, and hides most of what it gains.
    """
    by = [work.effects[at] for shape in work.searched for at in shape.effects]
    return 0.5 if any({*one.reads} & {*effect.reads} for one in by) else SETTINGS.most


def _net(made: Sequence[Offer]) -> float:
    """Gain of all above the threshold of all."""
    return sum(offer.net for offer in made)


def _rank(offer: Offer) -> float:
    """Gain above the threshold, less a share of it for every column and shape beyond the first."""
    return offer.net - SETTINGS.negligible * (freedom(offer.effect) - 1) * offer.gain


def freedom(effect: Effect) -> int:
    """How many numbers an effect is fitted by; a shape that all friction shares is none of its.

    Springs of one sign are about as free as one: their columns are alike.
    """
    own = [shape for shape in effect.fitted_shapes if shape.name not in SHARED]
    return (1 if effect.name in LOOPS else len(effect.terms)) + len(own)


def _at_reversals(effect: Effect) -> bool:
    """Whether an effect may look like another way in which friction turns over at rest."""
    return {*effect.reads} == {SPEED} or effect.name == PRESLIDING


def _exceeds(beta: Array, sliding: int) -> bool:
    """Whether sliding friction that turns over by tanh and other ways exceeds its level.

    `beta`: coefficients of a model whose last columns are `TURNS`; `sliding`: which is tanh.
    """
    speed = np.linspace(0.0, SETTINGS.points, SETTINGS.rows)
    weights = np.array([beta[sliding], *beta[-len(TURNS) :]])
    level = weights @ [np.tanh(speed), *(turn(speed) for turn in TURNS)]
    return bool(np.abs(level).max() > (1.0 + SETTINGS.negligible) * abs(weights.sum()))
