"""From a base model to names and their aliases: noise, search, what is left, in this order.

A rival is an alias where what the named effect explains, projected on the rest of the model and the
rival, leaves t < 3, or no more than its own form may miss: where forms are not exact, as in all
measured logs, t goes on growing with the length of the log. The gain of the effect beside the rival
estimates t² plus its number of columns. The rival's shapes are refitted first: on the grid it may
look worse than it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.basis import (
    Functions,
    Varied,
    channel_told,
    flexible_basis,
    state_functions,
)
from flexspline.discovery.candidates import Candidate, OfBase
from flexspline.discovery.evidence import (
    Dictionary,
    Offer,
    dictionary_of,
    held_out_gain,
    offers,
    threshold,
)
from flexspline.discovery.search import FEW_PLACES, SearchContext, Searcher, form_of, freedom
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.unexplained import (
    ExplainableBound,
    Leftover,
    Repeated,
    leftover_of,
    looked_at,
    repeated,
)
from flexspline.effects import Effect, Harmonic
from flexspline.effects.causes import COGGING, GRAVITY, OUTPUT_RIPPLE, WAVE_GENERATOR_RIPPLE
from flexspline.errors import listed
from flexspline.formatting import percent
from flexspline.least_squares.problem import Problem
from flexspline.logs.checks.dependence import Dependence, dependences
from flexspline.regression.candidate_model import (
    CandidateModel,
    HeldOut,
    candidate_model_of,
    first_whitening,
    held_out,
    plain_rows,
    refitted,
    restricted_whitening,
    solved_at,
    started,
)
from flexspline.regression.gram import TINY, Whitening, left_of, rows_of, solved, tabulated

__all__ = ["Analysis", "FirstLook", "Rival", "analysed", "contribution", "first_look",
           "in_place_of", "rivals_of"]  # fmt: skip

Array = NDArray[np.float64]

READ = ("time", "output_position", "output_velocity", "output_acceleration", "temperature")
VARIES = "it is no constant: its size varies with"
EXPLAINS = 0.5  # of what the named effect gains, that a rival gains in its place at least


@dataclass(frozen=True)
class Rival:
    """Another candidate in the place of a named effect.

    `gain`: what it explains there, and `own` what the named effect explains, in χ². `left`: |t|
    that the named effect keeps beside it, and `adds` what it keeps beside the named effect.
    `form`: of what the named effect explains, that its form may miss. `tied`: the two channels,
    one of which each of them reads, if in these runs one is nearly a function of the other; else
    empty. `moved`: by how much the forms of the other names may move a gain, in χ². `counted`: of a
    t of the search, what the final fit bears out. `more`: whether these are orders that an effect
    of the model may have beside its own.
    """

    effect: Effect
    gain: float
    own: float
    left: float
    adds: float
    form: float
    tied: tuple[str, ...] = ()
    moved: float = 0.0
    counted: float = 1.0
    more: bool = False

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def words(self) -> str:
        """The name; of more orders, which."""
        if not self.more:
            return self.name
        orders = [str(order) for order, _ in self.effect.harmonics]
        return f"{'order' if len(orders) == 1 else 'orders'} {listed(orders)} of {self.name}"

    @property
    def share(self) -> float:
        """Of what the named effect explains, what it explains in its place; at most one."""
        return float(min(self.gain / max(self.own, TINY), 1.0))

    @property
    def keeps(self) -> float:
        """`left` as it is printed, beside a t of the named effect that counts both."""
        return self.left * self.counted

    @property
    def by_t(self) -> bool:
        """Whether the named effect keeps next to nothing beside it."""
        return self.left < SETTINGS.told and self.gain >= EXPLAINS * self.own

    @property
    def alias(self) -> bool:
        """Whether these runs do not tell it from the named effect."""
        return bool(self.why(""))

    def why(self, named: str) -> str:
        """Return which rule makes it an alias, "" where none does.

        It leaves next to nothing; or no more than the form of the named effect may miss; or it
        explains as much, but for chance or for what the forms of other names may miss; or it
        explains most of it by a channel that is nearly a function of another.
        """
        kept, lost, same = self.left**2, self.own - self.gain, self.left**2 < 0.5 * self.own
        most = self.gain >= SETTINGS.most * self.own
        much = f"explains {percent(self.share)} as much"
        beside = f"{named} keeps t = {self.keeps:.1f}"
        rules = (
            (self.by_t, f"beside it {beside}"),
            (most and kept < self.form * self.own,
             f"it {much}, and what {named} keeps beside it, t = {self.keeps:.1f}, is no more than "
             "its form may miss"),
            (lost <= 0.0 or (same and lost < SETTINGS.told**2),
             f"in its place it {much}, and {beside} beside it"),
            (same and lost < self.moved,
             f"it {much}, and by that much the forms of other names may be off"),
            (most and bool(self.tied),
             f"it {much}, and {' is nearly a function of '.join(self.tied)} in these runs"),
        )  # fmt: skip
        return next((reason for holds, reason in rules if holds), "")

    @property
    def inside(self) -> bool:
        """Whether the named effect is another form of it: it adds nothing, and lacks little.

        So is friction over the angle of friction over the load, where this follows the angle.
        """
        return self.adds < SETTINGS.told and self.gain >= (1.0 - SETTINGS.bends) * self.own


def rivals_of(
    searcher: Searcher, work: CandidateModel, effect: Effect, tied: Sequence[Dependence] = ()
) -> list[Rival]:
    """Return the rivals of a named effect, the best first; none that physics does not allow.

    `tied`: channels that are nearly a function of another; what remembers is tied by none.
    """
    dictionary = searcher.context.dictionary(work, searcher.whitening, without=[effect.name])
    own = dictionary.gain(effect.name)
    form, names = form_of(effect), [e for e in work.named if e.name != effect.name]
    moved = max((form_of(e) * dictionary.gain(e.name) for e in names), default=0.0)
    near = SETTINGS.doubtful + form * own  # more is no alias, whatever its shape
    made = [*_offered(dictionary, effect), *_more_orders(searcher, work, effect)]
    found = []
    for rank, (kept, more, offer) in enumerate(sorted(made, key=lambda one: one[0])):
        gain, trial = offer.gain, None
        if rank < SETTINGS.tried and kept < near and gain >= EXPLAINS * own:
            kept, gain, trial = _refitted(searcher, work, effect, offer, kept)
        rival = Rival(
            offer.effect, gain, own,
            left=float(np.sqrt(max(kept - len(effect.terms), 0.0))),
            adds=float(np.sqrt(max(more - len(offer.columns), 0.0))),
            form=form, moved=moved, tied=_tie(offer.effect, effect, tied),
            more=offer.effect.name in [e.info.name for e in work.effects],
        )  # fmt: skip
        allowed = [""]
        if trial is None and rival.alias:
            trial, _ = searcher.fitted(in_place_of(work, effect.name, offer.effect))
            allowed.append(FEW_PLACES)  # it is no ripple, but something that may be there
        if trial is None or rival.more or searcher.forbidden(trial, rival.name) in allowed:
            found.append(rival)
    return sorted(found, key=lambda rival: -rival.gain)


def _tie(rival: Effect, effect: Effect, tied: Sequence[Dependence]) -> tuple[str, ...]:
    """The two channels that tie a rival to an effect; () where none do."""
    alike = rival.info.remembers == effect.info.remembers
    reads = effect.info.reads, rival.info.reads
    return next((one.said for one in tied if alike and one.swapped(*reads)), ())


def _offered(dictionary: Dictionary, effect: Effect) -> list[tuple[float, float, Offer]]:
    """Offers in the place of an effect: what it keeps beside each, and each beside it, in χ²."""
    rest, mine = dictionary.without([effect.name]), dictionary.own(effect.name)
    gain_of = dictionary.table.gain
    return [
        (gain_of(mine, np.append(rest, o.columns)), gain_of(o.columns, dictionary.model), o)
        for o in offers(dictionary, rest)
        if o.effect.name != effect.name and len(o.columns)
    ]


def _more_orders(
    searcher: Searcher, work: CandidateModel, effect: Effect
) -> list[tuple[float, float, Offer]]:
    """As `_offered`, orders that other effects of the model may have beside those that they have.

    A sine of the angle is gravity, or the first order of a ripple whose second one is named. What
    pole pairs or slots claim is cogging, or the overtone of a larger order of the wave generator.
    """
    context, more = searcher.context, list[Candidate]()
    others = (e for e in work.effects if e.harmonics and not isinstance(e, OfBase))
    for other in (e for e in others if e.name != effect.name):
        rest = [e for e in work.effects if e.name not in (effect.name, other.name)]
        new = context.orders_of([other.name], rest).get(other.name, ())
        own = dict.fromkeys([*new, *_overtones(work, effect, other)])
        atoms = tuple(other.with_orders([h]) for h in own if h not in other.harmonics)
        if atoms:
            more.append(Candidate(other.name, (other,), (atoms,)))
    if not more:
        return []
    wanted = [atom for one in more for atom in one.effects]
    beside = dictionary_of(context.problem, work, wanted, searcher.whitening)
    return _offered(replace(beside, candidates=tuple(more)), effect)


def _overtones(work: CandidateModel, effect: Effect, other: Effect) -> list[Harmonic]:
    """Orders of cogging that are twice a larger one of the wave generator's ripple."""
    if (effect.name, other.name) != (COGGING, WAVE_GENERATOR_RIPPLE):
        return []
    sizes, mine = (
        dict(zip(e.harmonics, np.hypot(*work.values(e.name).reshape(-1, 2).T), strict=True))
        for e in (other, effect)
    )
    doubled = [((2 * order, pair), size) for (order, pair), size in sizes.items()]
    return [harmonic for harmonic, size in doubled if size > mine.get(harmonic, np.inf)]


def simplest(
    searcher: Searcher, work: CandidateModel, rejected: Sequence[str] = ()
) -> CandidateModel:
    """Replace each name by the equal with fewest coefficients: of equals the plainest is said.

    Of as many, gravity: the first order of the output alone is its. By none that was rejected.
    """
    for effect in work.named:
        rivals = rivals_of(searcher, work, effect)
        equals = [r.effect for r in rivals
                  if not r.more and r.name not in rejected
                  and (r.by_t or r.inside or r.gain >= r.own)]  # fmt: skip
        for plain in sorted(equals, key=freedom):
            owner = (effect.name, plain.name) == (OUTPUT_RIPPLE, GRAVITY)
            if freedom(plain) >= freedom(effect) + owner:
                break
            effects = [plain if e.name == effect.name else e for e in work.effects]
            trial, _ = searcher.fitted(work.having(effects))
            if not searcher.forbidden(trial, plain.name):
                work = trial
                break
    return work


def _refitted(
    searcher: Searcher, work: CandidateModel, effect: Effect, offer: Offer, kept: float
) -> tuple[float, float, CandidateModel]:
    """Gain of the effect beside a rival with fitted shapes; the rival's in its place, and there."""
    others = work.without(effect.name)
    trial, squares = searcher.fitted(in_place_of(work, effect.name, offer.effect))
    _, both = searcher.fitted(trial.with_effects(effect))
    without = searcher.fitted(others)[1]
    return min(kept, max(squares - both, 0.0)), max(without - squares, 0.0), trial


def in_place_of(work: CandidateModel, name: str, effect: Effect) -> CandidateModel:
    """The model with an effect in the place of another, or with more orders of one that it has."""
    work = work.without(name)
    own = next((e for e in work.effects if e.name == effect.name), None)
    if own is None:
        return work.with_effects(effect)
    both = own.with_orders([*own.harmonics, *effect.harmonics])
    return work.having([both if e is own else e for e in work.effects])


@dataclass(frozen=True, eq=False)
class Analysis:
    """Base and final model, the search that led there, and what is left.

    `part`: the context of the rows on which orders and noise are looked at; all, where they are
    few. `bound`: what functions of the channels explain. `rejected`: names that were spurious, as
    these tell. `generalised`: whether the model is fitted by generalised least squares.
    """

    context: SearchContext
    part: SearchContext
    base: CandidateModel
    final: CandidateModel
    searcher: Searcher
    bound: ExplainableBound
    steps: tuple[Offer, ...]
    leftover: Leftover
    rejected: tuple[str, ...]
    generalised: bool = False

    def without(self, *names: str) -> Analysis:
        """Return the analysis without some effects: the others refitted; of names, what is left."""
        final = self.searcher.less(self.final, *names)
        if not {*names} & {e.name for e in self.base.effects}:
            return self.of(final)
        final, _ = self.searcher.fitted(final)
        base, _ = self.searcher.fitted(self.base.without(*names))
        return replace(self, base=base, final=final)

    def of(self, work: CandidateModel) -> Analysis:
        """Return the analysis with another final model: that refitted, what is left anew."""
        final, _ = self.searcher.fitted(work)
        return replace(self, final=final, leftover=leftover_of(self.bound, final))

    def with_orders(self, effect: Effect, orders: Sequence[Harmonic]) -> Analysis:
        """Return the analysis with a named ripple of these orders alone."""
        less = effect.with_orders(orders)
        return self.of(self.final.having([less if e is effect else e for e in self.final.effects]))

    def in_runs(self, context: SearchContext, plain: str) -> Analysis:
        """Return the analysis of the same runs prepared in another way: the same names, refitted.

        `plain`: an effect of the base that is left out.
        """
        context.orders, context.tied = self.context.orders, self.context.tied
        part = context.thinned()
        searcher = replace(self.searcher, context=context)
        base, _ = searcher.fitted(self.base.without(plain))
        final = searcher.pruned(searcher.fitted(self.final.without(plain))[0])
        bound = ExplainableBound(context.problem, self.whitening)
        return replace(
            self, context=context, part=part, base=base, final=final, searcher=searcher,
            bound=bound, leftover=leftover_of(bound, final),
        )  # fmt: skip

    @property
    def whitening(self) -> Whitening:
        return self.searcher.whitening

    @cached_property
    def fitted_as(self) -> Whitening:
        """How the model that is returned weighs rows."""
        return self.whitening if self.generalised else plain_rows(self.context.problem, self.final)

    @cached_property
    def tied(self) -> tuple[Dependence, ...]:
        """Channels that are nearly a function of each other, beside the final model."""
        return tied_channels(looked_at(self.context.problem), self.final)

    def left_by(self, work: CandidateModel) -> HeldOut:
        """Return what a model refitted as the final one leaves of rows held out."""
        problem = self.context.problem
        return held_out(problem, refitted(problem, work, self.fitted_as)[0], self.fitted_as)

    @cached_property
    def before(self) -> HeldOut:
        """What the base leaves of rows held out."""
        return self.left_by(self.base)

    @cached_property
    def after(self) -> HeldOut:
        """What the final model leaves of them."""
        return self.left_by(self.final)

    @cached_property
    def errors(self) -> list[float]:
        """RMSE held out, in the target's unit: of the base, and with one name more each."""
        between = [self.left_by(work).rmse for work in self.nested[1:-1]]
        return [self.before.rmse, *between, *([self.after.rmse] if self.final.named else [])]

    @cached_property
    def nested(self) -> list[CandidateModel]:
        """The base, and the model with one name more each."""
        final, fitted = self.final, self.searcher.fitted
        ends = range(final.base + 1, len(final.effects))
        between = [fitted(final.having(final.effects[:end]))[0] for end in ends]
        return [self.base, *between, *([final] if final.named else [])]

    @cached_property
    def unexplained(self) -> float:
        """As `unexplained_by`, of the final model."""
        return unexplained_by(self.part, self.base, self.final, self.whitening, self.leftover)

    @cached_property
    def again(self) -> Repeated | None:
        """What comes again at the same place in other folds, of what the final model leaves."""
        return repeated(self.after)

    @property
    def answers(self) -> bool:
        """Whether names explain more than is left unexplained, or nearly all of the target."""
        before, after = self.before.rmse**2, self.after.rmse**2
        if after <= (1.0 - SETTINGS.most) * before and before > 0.0:
            return True
        return self.unexplained <= 0.5 and (self.again is None or self.again.fall <= before - after)

    def closes_most(self, name: str) -> bool:
        """As `closes_most`, of a name of the final model."""
        return closes_most(self.context.problem, self.base, self.final, name)

    def unexplained_beyond(self, given: str) -> float:
        """As `unexplained`, where what an effect of the base closes counts as explained too."""
        base, _ = self.searcher.fitted(self.base.without(given))
        return unexplained_by(self.part, base, self.final, self.whitening, self.leftover)

    @property
    def searched(self) -> dict[str, float]:
        """Share of the rows that were searched first, for names and for what no name explains."""
        rows = rows_of(self.context.problem)
        names, functions = self.context.thinned(1).problem, looked_at(self.context.problem)
        few = {"names": names, "functions": functions}
        return {what: min(rows_of(problem) / rows, 1.0) for what, problem in few.items()}


@dataclass(frozen=True)
class FirstLook:
    """What is known before names are looked for: the base, orders in what it leaves, the noise.

    `whole`, `part`: the context of all rows, and of those on which orders and noise are looked at.
    """

    whole: SearchContext
    part: SearchContext
    base: CandidateModel
    noise: Whitening


def first_look(
    context: SearchContext,
    effects: Sequence[Effect],
    fixed: Mapping[str, float],
    say: Callable[[str], object],
) -> FirstLook:
    """Fit the base alone; of long logs to a part (`thinned`)."""
    part = context.thinned()
    say("base model")
    plain = Whitening(np.ones(1), 1.0, part.problem.decimation)
    base, _ = started(part.problem, candidate_model_of(effects, len(effects), fixed), plain)
    say("looking for orders")
    part.scan(base, context.problem)
    say("noise")
    every = [e for c in part.candidates(base.effects) for e in c.effects]
    flexible = Functions(tuple(flexible_basis(part.problem, pairs=False)))
    assembly = base.assembly(beside=list(dict.fromkeys(every)), given=flexible)
    return FirstLook(context, part, base, first_whitening(part.problem, assembly))


def analysed(look: FirstLook, say: Callable[[str], object]) -> Analysis:
    """Look for what is missing beside a base; `say` is told what is being done.

    Of long logs a part is searched first, then all rows from there. Where the part leaves no doubt
    that functions explain more than its names do, all rows are not searched: they are no answer.
    Where functions of the angle are what is left beside a first look, more orders of it are tried.
    """
    whole, context, base, first = look.whole, look.part, look.base, look.noise
    few = whole.thinned(1)
    few.orders, few.tied = context.orders, tied_channels(looked_at(whole.problem), base)
    whole.tied = context.tied = few.tied
    lax, _ = Searcher(few, first, True, say).run(base)
    lax, _ = Searcher(context, first, True).fitted(lax)
    context.scan(lax, whole.problem)
    say("functions of the channels")
    left = leftover_of(ExplainableBound(whole.problem, first), lax)
    beside, certain = left.groups, left.net > SETTINGS.certain**2
    if certain and left.channels == ["output_position"]:
        context.orders = replace(context.orders, low=True)
    whitening = restricted_whitening(context.problem, lax, Functions(beside) if beside else None)
    few.orders = context.orders
    searcher = Searcher(few, whitening, say=say)
    say("names")
    base, _ = searcher.fitted(base)
    final, steps = searcher.run(base)
    bound = ExplainableBound(whole.problem, whitening)
    rejected = list[str]()
    if few is not whole:
        say("all rows")
        whole.orders = context.orders
        kept, leftover, rejected = _without_spurious(searcher, bound, base, final)
        strong = final.named and bound.share * leftover.net > SETTINGS.certain**2
        if hopeless := strong and unexplained_by(context, base, kept, whitening, leftover) > 0.5:
            before, after = _squares(context.problem, base, kept)
            hopeless = before - after < SETTINGS.most * before
        searcher = replace(searcher, context=whole)
        base, _ = searcher.fitted(base)
        if hopeless:
            final = base
        else:
            final, rejected = searcher.again(final), []
            final, added = searcher.run(final)
            steps += added
    say("what is left")
    final, leftover, more = _without_spurious(searcher, bound, base, final)
    rejected += more
    plain = searcher.pruned(simplest(searcher, final, rejected))
    if plain is not final:
        final, leftover = plain, leftover_of(bound, plain)
    final, leftover, more = _of_one_size(searcher, bound, final, leftover)
    rejected += more
    return Analysis(
        whole, context, base, final, searcher, bound, tuple(steps), leftover, tuple(rejected)
    )


def unexplained_by(
    context: SearchContext,
    base: CandidateModel,
    final: CandidateModel,
    whitening: Whitening,
    leftover: Leftover,
) -> float:
    """Share of the gap above the noise floor that a flexible basis alone closes held out.

    In the noise's own metric; by the evidence where runs go where no other went.
    """
    if not leftover.groups:
        return 0.0
    functions = Functions(leftover.groups)
    first, last, least = (
        held_out(context.problem, work, whitening, beside).squares
        for work, beside in ((base, None), (final, None), (final, functions))
    )
    share = (last - least) / (first - least) if min(first, last) > least else None
    return float(min(leftover.share if share is None else share, 1.0))


def closes_most(problem: Problem, base: CandidateModel, work: CandidateModel, name: str) -> bool:
    """Whether a name alone closes nearly all that the base leaves, held out in the target's unit.

    It is no part of what is left then. In the noise's own metric that may seem to be more: what is
    sharp counts for most there, though it may be little of the torque.
    """
    rest, _ = solved_at(problem, work.without(name), plain_rows(problem, work))
    before, without, after = _squares(problem, base, rest, work)
    return without - after >= SETTINGS.most * before


def _squares(problem: Problem, *works: CandidateModel) -> list[float]:
    """Squares that models leave of rows held out, in the target's unit."""
    plain = plain_rows(problem, works[-1])
    return [held_out(problem, work, plain).squares for work in works]


def _without_spurious(
    searcher: Searcher, bound: ExplainableBound, base: CandidateModel, final: CandidateModel
) -> tuple[CandidateModel, Leftover, list[str]]:
    """The model without spurious names, what is left then, and these."""
    leftover, rejected = leftover_of(bound, final), list[str]()
    at_first, closed = leftover.net, _small(bound.problem, base, final, leftover) is not None
    while True:
        small = _small(bound.problem, base, final, leftover) if closed else None
        retained = _spurious(searcher, bound, base, final, leftover, at_first, small)
        if retained is None:
            return final, leftover, rejected
        rejected.append(retained)
        final = _less(searcher, final, retained)
        leftover = leftover_of(bound, final)


def _less(searcher: Searcher, work: CandidateModel, name: str) -> CandidateModel:
    """The model less one effect, and less the names that are below their threshold then."""
    return searcher.pruned(searcher.fitted(searcher.less(work, name))[0])


def _small(
    problem: Problem, base: CandidateModel, final: CandidateModel, leftover: Leftover
) -> list[str] | None:
    """Names without which next to nothing of the gap opens again; None where much of it is open.

    Nor may such a name close half of what is left without it. The gap is what names and flexible
    functions explain. Where names explain more than half of it in the noise's own metric, but not
    nearly all, held-out folds decide in the target's unit, which shows less of what a form misses.
    """
    if not final.named or leftover.share >= 0.5:
        return None
    plain, functions = plain_rows(problem, final), Functions(leftover.groups)

    def left(work: CandidateModel, beside: Functions | None = None) -> float:
        return held_out(problem, work, plain, beside).squares

    before, after = left(base), left(final)
    if leftover.share > 1.0 - SETTINGS.most:
        floor = min(left(final, functions), after)
        if before - after < SETTINGS.most * (before - floor):
            return None
    found = []
    for effect in final.named:
        lacking = left(solved_at(problem, final.without(effect.name), plain)[0])
        opened = lacking - after
        if opened < SETTINGS.bends * (before - after) and opened < 0.5 * lacking:
            found.append(effect.name)
    return found


def contribution(problem: Problem, work: CandidateModel, name: str) -> list[Array]:
    """Return what one effect of a model adds to the target, (N,) for each run; NaN elsewhere."""
    values = np.where(work.effect_of == name, work.coefficients, 0.0)
    left = left_of(problem, work.effects, work.coefficients, values)
    return [run.target - rest for run, rest in zip(problem.runs, left, strict=True)]


def carried_load(problem: Problem, work: CandidateModel) -> list[Array]:
    """Return the load that the model's effects carry, (N,) of each run; [] where one is known."""
    own = [e.name for e in work.effects if e.info.carries_load and problem.known_load is None]
    parts = [contribution(problem, work, name) for name in own]
    return [np.sum(of_run, axis=0) for of_run in zip(*parts, strict=True)]


def tied_channels(problem: Problem, work: CandidateModel) -> tuple[Dependence, ...]:
    """Channels that are nearly a function of each other; the load that is known, or the model's."""
    carried, seen = carried_load(problem, work), []
    for number, run in enumerate(problem.runs):
        channels = {c: run.log[c] for c in READ if c in run.log}
        channels["time"] = channels["time"] - channels["time"][0]
        if "known_load" in run.channels:
            channels["load"] = run.channels["known_load"]
        elif carried:
            channels["load"] = carried[number]
        rows = np.concatenate([np.arange(first, last) for first, last in run.stretches])
        seen.append({c: values[rows] for c, values in channels.items()})
    known = problem.known_load
    found = dependences(seen, {"load": known or "the load of the model"})
    trivial = ("load", "output_acceleration")  # what an inertia of the model carries
    return tuple(one for one in found if known or (one.channel, one.of) != trivial)


def _of_one_size(
    searcher: Searcher, bound: ExplainableBound, final: CandidateModel, leftover: Leftover
) -> tuple[CandidateModel, Leftover, list[str]]:
    """The model less names that are no constant times their form, what is left, and the spurious.

    The searcher is told why another was not taken.
    """
    rejected = list[str]()
    for effect in final.named:
        if effect.name not in [e.name for e in final.named] or effect.info.remembers:
            continue
        if channel := _varies_with(bound, final, effect, searcher.context.tied):
            searcher.refused[effect.name] = f"{VARIES} {channel}"
        elif _of_one_part(bound, final, effect, leftover):
            rejected.append(effect.name)
        else:
            continue
        final = _less(searcher, final, effect.name)
        leftover = leftover_of(bound, final)
    return final, leftover, rejected


def _of_one_part(
    bound: ExplainableBound, work: CandidateModel, effect: Effect, leftover: Leftover
) -> bool:
    """Whether what carries a name acts one way only, or grows with the speed, as no effect does.

    Let f be what a name explains and m the sign of the velocity, or the speed over its mean under
    f², less one. Of a cause that is (1 + c m) f, c m f is left over beside f: c = 1 where it acts
    forward alone or grows with the speed. The speed is asked about only where the name's own
    channels carry all that is left, and that is more than a small part.
    """
    problem, name = bound.problem, effect.name
    if not all("output_velocity" in run.log for run in problem.runs):
        return False
    parts = [np.nan_to_num(part) for part in contribution(problem, work, name)]
    velocity = [run.log["output_velocity"] for run in problem.runs]
    turned, own = _left_by(bound, work, name, parts, [np.sign(v) for v in velocity])
    known = problem.known_load
    carried = {channel_told(c, known) for group in leftover.groups for c in group.channels}
    little = bound.share * leftover.net < SETTINGS.little * own
    if abs(turned) > 0.5 or little or not carried <= {*effect.reads}:
        return abs(turned) > 0.5
    sums = [(f**2 @ np.abs(v), f @ f) for f, v in zip(parts, velocity, strict=True)]
    mean = sum(a for a, _ in sums) / max(sum(b for _, b in sums), TINY)
    faster = [np.abs(v) / mean - 1.0 for v in velocity]
    return 0.5 < _left_by(bound, work, name, parts, faster)[0] < 2.0


def _varies_with(
    bound: ExplainableBound, work: CandidateModel, effect: Effect, tied: Sequence[Dependence]
) -> str:
    """The channel with which most of the size of a name varies, "" where it is one size.

    What the name explains, times functions of a channel of the joint's state that it does not read,
    gains more beside the model than a small part of what it does, than what is no second name
    beside all names, and than another form might; and so it does on folds. A ripple lives in bands
    of the speed; and an offset times a function is whatever else the function is.
    """
    problem, name = bound.many, effect.name
    read = {problem.known_load if c in ("load", "motor_torque") else c for c in effect.reads}
    read |= {"output_velocity", "output_acceleration"} if effect.ripple else set()
    free = [
        group for group in state_functions(problem) if group.channels[0] not in read
        and not any(one.swapped(effect.reads, group.channels) for one in tied)
    ]  # fmt: skip
    if not free or not effect.reads:
        return ""
    parts = tuple(np.nan_to_num(part) for part in contribution(problem, work, name))
    assembly = work.assembly(given=Varied(parts, Functions(tuple(free))))
    table = tabulated(problem, assembly, bound.whitening)
    model, owners = np.arange(len(work.owners())), np.array(work.owners())
    own = {e.name: table.gain(model[owners == e.name], model[owners != e.name]) for e in work.named}
    least = max(SETTINGS.little * own[name], SETTINGS.bends * sum(own.values()), SETTINGS.doubtful)
    ends, found = len(model) + np.cumsum([0, *(group.count for group in free)]), {"": 0.0}
    for group, first, last in zip(free, ends, ends[1:], strict=False):
        more = np.arange(first, last)
        gain = table.gain(more, model)
        if gain > least and held_out_gain(table, model, more, gain).sum() > 0.5**2 * gain:
            found[group.channels[0]] = gain
    return max(found, key=lambda channel: found[channel])


def _left_by(
    bound: ExplainableBound,
    work: CandidateModel,
    name: str,
    parts: Sequence[Array],
    by: Sequence[Array],
) -> tuple[float, float]:
    """How much of a name's part (N,) times `by` is left over, 0 if chance; and the name's gain."""
    turned = tuple(f * m for f, m in zip(parts, by, strict=True))
    squares, turned_squares = (sum(float(one @ one) for one in own) for own in (parts, turned))
    assembly = work.assembly(given=Functions(column=turned))
    table = tabulated(bound.problem, assembly, bound.whitening)
    model, owners = np.arange(len(table.total) - 2), np.array(work.owners())
    last = np.array([len(model)])
    own = table.gain(model[owners == name], model[owners != name])
    gain = table.gain(last, model)
    share = float(solved(table.total, np.append(model, last))[-1])
    least = 0.5**2 * own * turned_squares / max(squares, TINY)
    return share if gain > max(least, threshold(1, 1.0, len(work.named))) else 0.0, own


def _spurious(
    searcher: Searcher,
    bound: ExplainableBound,
    base: CandidateModel,
    work: CandidateModel,
    leftover: Leftover,
    at_first: float,
    small: Sequence[str] | None,
) -> str | None:
    """The named effect that is most clearly spurious, if one is.

    That is one of which functions of a flexible basis hold most, where they still explain a small
    part of it; or one beside which they explain far more. Where names explain nearly all, only
    those that explain little of it are asked (`_small`); where no more is left than the form of a
    name may miss, none. `at_first`: what was left before any name was taken back, in χ²: a name
    that was is part of what is left now.
    """
    if not leftover.groups or not work.named:
        return None
    dictionary = searcher.context.dictionary(work, searcher.whitening)
    times = rows_of(bound.problem) / bound.share / rows_of(searcher.context.problem)
    gains = {e.name: times * dictionary.gain(e.name) for e in work.named}
    if leftover.net <= max(form_of(e) * gains[e.name] for e in work.named):
        return None
    shares = {name: leftover.net / max(gain, TINY)
              for name, gain in gains.items() if small is None or name in small}  # fmt: skip
    larger = SETTINGS.overwhelming if small is None else 1.0
    most = larger * leftover.net / max(at_first, TINY)
    held = [name for name in shares if leftover.retained[name] < SETTINGS.retained]
    spurious = [name for name, share in shares.items()
                if share > most or (share > SETTINGS.little and name in held)]  # fmt: skip
    parts = [name for name in spurious if not closes_most(bound.problem, base, work, name)]
    return max(parts, key=lambda name: shares[name], default=None)
