"""From a base model to names and their aliases: noise, search, what is left, in this order.

Names that explain these runs as well: rivals beside which a named effect leaves next to nothing.

An alias is real where what the named effect explains, projected on the rest of the model and the
rival, leaves t < 3. The gain of the effect beside the rival estimates t² plus its number of
columns. The rival's shapes are refitted first: on the grid it may look worse than it is.

Where forms are not exact, as in all measured logs, t goes on growing with the length of the log.
There a rival counts as well that explains nearly as much and whose squares on left-out folds do
not exceed the named effect's by more than they vary from fold to fold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.evidence import (
    HeldOut,
    Offer,
    foretold_gain,
    gain_of,
    held_out,
    offers,
    plain_rows,
)
from flexspline.discovery.flexible import nameless_of
from flexspline.discovery.gram import Columns, Sheet, Table, Whitening
from flexspline.discovery.model import (
    Working,
    at_upper_bound,
    impossible,
    refitted,
    solved_at,
    started,
    working,
)
from flexspline.discovery.search import (
    Limits,
    Searcher,
    Step,
    Study,
    freedom,
    owned_gain,
    ranked,
    rows_of,
    thinned,
)
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.unexplained import (
    Ceiling,
    Leftover,
    first_whitening,
    leftover_of,
    restricted_whitening,
)
from flexspline.effects import Effect
from flexspline.fit.memory import settled
from flexspline.fit.problem import Problem
from flexspline.fit.ripple import FOLLOWER, LEADERS
from flexspline.report.numbers import percent

__all__ = ["Analysis", "Rival", "analysed", "rivals_of", "simplest"]

FOLDS_DIFFER = 2.0  # standard errors of the difference over folds, up to which they do not
COGGING = "cogging"
EXPLAINS = 0.5  # of what the named effect gains, that a rival gains in its place at least


@dataclass(frozen=True)
class Rival:
    """Another candidate in the place of a named effect.

    `gain`: what it explains there, and `own` what the named effect explains, in χ². `left`: |t|
    that the named effect keeps beside it, and `adds` what it keeps beside the named effect.
    `behind`: how much worse it is on left-out folds, in standard errors of the difference from
    fold to fold. `tied`: the two channels, one of which each of them reads, if in these runs one
    is nearly a function of the other; else empty.
    """

    effect: Effect
    gain: float
    own: float
    left: float
    adds: float
    behind: float
    tied: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def alias(self) -> bool:
        """Whether these runs do not tell it from the named effect."""
        return self.by_t or self.by_folds or self.by_tie

    @property
    def by_tie(self) -> bool:
        """Whether it explains nearly as much by a channel that is nearly a function of another."""
        return bool(self.tied) and self.gain >= SETTINGS.most * self.own

    @property
    def by_t(self) -> bool:
        """Whether the named effect leaves next to nothing beside it."""
        return self.left < SETTINGS.told and self.gain >= EXPLAINS * self.own

    @property
    def by_folds(self) -> bool:
        """Whether it explains nearly as much, and left-out folds do not tell which is better."""
        same = self.left**2 < EXPLAINS * self.own
        return same and self.gain >= SETTINGS.most * self.own and self.behind < FOLDS_DIFFER

    @property
    def share(self) -> float:
        """Of what the named effect explains, what it explains in its place; at most one."""
        return float(min(self.gain / max(self.own, TINY), 1.0))

    def why(self, named: str, folds: str) -> str:
        """Return which rule makes it an alias; `folds`: what was left out, runs or blocks."""
        if self.by_t:
            return f"beside it {named} keeps t = {self.left:.1f}"
        if self.by_tie and not self.by_folds:
            return (
                f"it explains {percent(self.share)} as much, and {self.tied[0]} is nearly a "
                f"function of {self.tied[1]} in these runs"
            )
        return (
            f"it explains {percent(self.share)} as much, and left-out {folds} do not tell "
            f"which is better, although {named} keeps t = {self.left:.1f} beside it"
        )

    @property
    def inside(self) -> bool:
        """Whether the named effect is another form of it: it adds nothing, and lacks little.

        Where the load is a function of the angle, friction that follows the angle holds every form
        of friction that follows the load. That it fits better, with more numbers, is a matter of
        form as long as it is no more than a form may miss.
        """
        return self.adds < SETTINGS.told and self.gain >= (1.0 - SETTINGS.bends) * self.own


def rivals_of(searcher: Searcher, work: Working, effect: Effect) -> list[Rival]:
    """Return the rivals of a named effect, the best first."""
    dictionary = searcher.study.dictionary(work, searcher.whitening, without=effect.name)
    rest = dictionary.without([effect.name])
    mine = dictionary.model[np.array(dictionary.owners) == effect.name]
    own = owned_gain(dictionary, effect.name)
    raw = np.diag(dictionary.table.total)
    beside_it = dictionary.table.without(dictionary.model)
    near = (0.5 * SETTINGS.certain) ** 2  # what keeps more has no alias, whatever its shape
    made = []
    for offer in offers(dictionary, rest, len(dictionary.candidates)):
        beside: Columns = np.concatenate([rest, offer.columns])
        kept = gain_of(dictionary.table.without(beside), mine, raw)[0]
        made.append((kept, offer))
    found = []
    for rank, (kept, offer) in enumerate(sorted(made, key=lambda pair: pair[0])):
        gain = offer.gain
        if rank < SETTINGS.tried and kept < near and gain >= EXPLAINS * own:
            kept, gain, trial = _refitted(searcher, work, effect, offer, kept)
            if impossible(trial, offer.effect.name, searcher.study.problem):
                continue
        left = float(np.sqrt(max(kept - len(effect.terms), 0.0)))
        more = gain_of(beside_it, offer.columns, raw)[0] - len(offer.columns)
        adds = float(np.sqrt(max(more, 0.0)))
        behind = _behind(dictionary.table, rest, (mine, own), (offer.columns, offer.gain))
        found.append(Rival(offer.effect, gain, own, left, adds, behind))
    return sorted(found, key=lambda rival: -rival.gain)


def simplest(searcher: Searcher, work: Working) -> Working:
    """Replace each name by the equal with fewest coefficients: of equals the plainest is said.

    A rival that only the folds do not tell from it is an alias, but no equal.
    """
    for effect in work.named:
        equals = [r.effect for r in rivals_of(searcher, work, effect) if r.by_t or r.inside]
        for plain in sorted(equals, key=freedom):
            if freedom(plain) >= freedom(effect):
                break
            effects = [plain if e.name == effect.name else e for e in work.effects]
            trial, _ = searcher.fitted(work.having(effects))
            if not impossible(trial, plain.name, searcher.study.problem):
                work = trial
                break
    return _leading(searcher, work)


def _leading(searcher: Searcher, work: Working) -> Working:
    """Replace ripple that changes with speed by its plain kinds where they explain as much.

    It holds the orders of all of them, and with a resonance far away it is their sum.
    """
    follower = next((e for e in work.named if e.name == FOLLOWER), None)
    if follower is None:
        return work
    rest = [e for e in work.effects if e is not follower]
    offered = {c.name: c.variants[0] for c in searcher.study.candidates(rest) if c.name in LEADERS}
    teeth = set(offered[COGGING].harmonics) if COGGING in offered else set()
    of_leader = {name: [h for h in follower.harmonics if (h in teeth) == (name == COGGING)]
                 for name in offered}  # fmt: skip
    plain = [offered[name].with_orders(own) for name, own in of_leader.items() if own]
    if not plain:
        return work
    trial, squares = searcher.fitted(work.having([*rest, *plain]))
    _, left = searcher.fitted(work)
    _, without = searcher.fitted(work.having(rest))
    return trial if squares - left < SETTINGS.bends * (without - left) else work


def _behind(
    table: Table, rest: Columns, named: tuple[Columns, float], other: tuple[Columns, float]
) -> float:
    """Standard errors by which a rival is worse on left-out folds; columns and gain of both."""
    more = foretold_gain(table, rest, *named) - foretold_gain(table, rest, *other)
    spread = float(np.std(more, ddof=1) * np.sqrt(len(more)))
    return float(more.sum() / max(spread, TINY))


def _refitted(
    searcher: Searcher, work: Working, effect: Effect, offer: Offer, kept: float
) -> tuple[float, float, Working]:
    """Gain of the effect beside a rival with fitted shapes; the rival's in its place, and there."""
    others = [e for e in work.effects if e.name != effect.name]
    trial, squares = searcher.fitted(work.having([*others, offer.effect]))
    _, both = searcher.fitted(trial.having([*trial.effects, effect]))
    without = searcher.fitted(work.having(others))[1]
    return min(kept, max(squares - both, 0.0)), max(without - squares, 0.0), trial


Array = NDArray[np.float64]

MOST_KEPT = 0.5  # of each run's rows that stay at least, where those of unknown past are left out
CLOSED_IN_NOISE = 0.5  # of the same as the noise sees it, for names that close it for the eye


@dataclass(frozen=True, eq=False)
class Analysis:
    """Base and final model, the search that led there, and what is left.

    `part`: the study of the rows that were searched first, all of them where they are few.
    `ceiling`: functions without a name, on the share `looked_at` of all rows.
    `doubted`: names that only stood in for a cause without a name, and were taken back.
    """

    study: Study
    part: Study
    base: Working
    final: Working
    searcher: Searcher
    steps: tuple[Step, ...]
    leftover: Leftover
    doubted: tuple[str, ...]
    ceiling: Ceiling
    looked_at: float

    def without(self, name: str) -> Analysis:
        """Return the analysis with one effect fewer: the others refitted, what is left anew."""
        if name in [e.name for e in self.base.effects]:
            base, final = (self.searcher.fitted(work.plain(name))[0]
                           for work in (self.base, self.final))  # fmt: skip
            return replace(self, base=base, final=final)
        kept = [e for e in self.final.effects if e.name != name]
        final, _ = self.searcher.fitted(self.final.having(kept))
        leftover = leftover_of(self.ceiling, final).times(1.0 / self.looked_at)
        return replace(self, final=final, leftover=leftover)

    @property
    def whitening(self) -> Whitening:
        return self.searcher.whitening

    @cached_property
    def plain(self) -> Whitening:
        """Rows as a user sees them, weighed by what the final model leaves."""
        return plain_rows(self.study.problem, self.final)

    @cached_property
    def _left(self) -> dict[Any, HeldOut]:
        return {}

    def left_by(self, work: Working) -> HeldOut:
        """Return what a model refitted to the rows as they are leaves of those held out."""
        key = work.effects, work.base, tuple(sorted(work.fixed.items()))
        found = self._left.pop(key, None)
        if found is None:
            problem = self.study.problem
            made, _ = refitted(problem, work, self.plain)
            found = held_out(problem, made, self.plain)
        self._left[key] = found
        if len(self._left) > SETTINGS.tried:  # each holds as many numbers as there are rows
            del self._left[next(iter(self._left))]
        return found

    @property
    def searched(self) -> float:
        """Share of the rows that were searched first."""
        return min(rows_of(self.part.problem) / rows_of(self.study.problem), 1.0)


def analysed(
    study: Study,
    effects: Sequence[Effect],
    fixed: Mapping[str, float],
    say: Callable[[str], object],
) -> Analysis:
    """Look for what is missing beside `effects`; `say` is told what is being done.

    Of long logs a part is searched first (`thinned`), then all rows from there.
    """
    whole, study = study, study.thinned()
    say("base model")
    plain = Whitening(np.ones(1), 1.0, study.problem.decimation)
    given = working(effects, len(effects), fixed)
    base, _ = started(study.problem, given, plain)
    say("looking for orders")
    study.scan(base)
    say("noise")
    first = first_whitening(study.problem, _everything(study, base))
    lax, _, _ = Searcher(study, first, Limits(lax=True), say).run(base)
    study.problem = _known(study.problem, lax.effects)
    study.scan(lax)
    looked_at = thinned(whole.problem, SETTINGS.rows, round(SETTINGS.little * SETTINGS.rows))
    beside = leftover_of(Ceiling(looked_at, first), lax).groups
    whitening = restricted_whitening(study.problem, lax, beside)
    searcher = Searcher(study, whitening, Limits(), say)
    base, _ = searcher.fitted(base)
    final, steps = _searched(searcher, base, given)
    if study is not whole:
        say("all rows")
        whole.orders = study.orders
        searcher = replace(searcher, study=whole)
        base, _ = searcher.fitted(base)
        final, _, more = searcher.run(final)
        steps += more
    say("what is left")
    share = rows_of(whole.problem) / rows_of(looked_at)
    ceiling = Ceiling(looked_at, whitening)
    leftover, doubted = leftover_of(ceiling, final).times(share), []
    at_first = leftover.net
    closed = _closes(looked_at, whitening, base, final, leftover)
    while True:
        little = _closing_little(looked_at, base, final) if closed else None
        stand_in = _stand_in(searcher, final, leftover, at_first, little)
        if stand_in is None:
            break
        doubted.append(stand_in)
        kept = [e for e in final.effects if e.name != stand_in]
        final = searcher.pruned(searcher.fitted(final.having(kept))[0])
        leftover = leftover_of(ceiling, final).times(share)
    final = _ordered(searcher, searcher.pruned(simplest(searcher, final)))
    return Analysis(
        whole, study, base, final, searcher, tuple(steps), leftover, tuple(doubted), ceiling,
        1.0 / share,
    )  # fmt: skip


def _searched(searcher: Searcher, base: Working, given: Working) -> tuple[Working, list[Step]]:
    """The names beside a base, and the steps there.

    What a base lacks may drive the width of a change of direction to its upper bound, where it
    makes up for it: a first search holds such shapes as they were given, a second one frees them.
    """
    held = {s.name: s.value(given.effects) for s in given.searched}
    held = {name: held[name] for name in at_upper_bound(base)}
    if not held:
        final, _, steps = searcher.run(base)
        return final, steps
    start = working(base.effects, base.base, {**base.fixed, **held})
    final, _, steps = searcher.run(start)
    if not final.named:
        return base, []
    free = working(final.effects, final.base, base.fixed)
    final, _, more = searcher.run(free)
    return final, [*steps, *more]


def _known(problem: Problem, effects: Sequence[Effect]) -> Problem:
    """Leave out the rows at which effects still depend on what came before, if each run has few."""
    runs = tuple(replace(run, unbroken=run.stretches) for run in problem.runs)  # a part stays one
    left = settled(replace(problem, runs=runs), effects)
    both = zip(left.runs, problem.runs, strict=True)
    return left if all(a.counted >= MOST_KEPT * b.counted for a, b in both) else problem


def _everything(study: Study, work: Working) -> Sheet:
    """Columns of the model, all candidates and functions of each channel."""
    wanted = [e for c in study.candidates(work.effects) for e in c.effects]
    nameless = nameless_of(study.problem, pairs=False)
    return work.sheet(beside=list(dict.fromkeys(wanted)), functions=nameless)


def _ordered(searcher: Searcher, work: Working) -> Working:
    """Put the name that gains most beside those before it first: a search may lose this order."""
    dictionary = searcher.study.dictionary(work, searcher.whitening)
    owners, raw = np.array(dictionary.owners), np.diag(dictionary.table.total)
    rest = {e.name: e for e in work.named}
    before, chosen = dictionary.without(list(rest)), list(work.effects[: work.base])
    while rest:
        left = dictionary.table.without(before)
        gains = {name: gain_of(left, dictionary.model[owners == name], raw)[0] for name in rest}
        best = max(gains, key=lambda name: ranked(gains[name], rest[name]))
        before = np.concatenate([before, dictionary.model[owners == best]])
        chosen.append(rest.pop(best))
    same = chosen == list(work.effects)
    return work if same else searcher.fitted(work.having(chosen))[0]


def _closes(
    problem: Problem, whitening: Whitening, base: Working, final: Working, leftover: Leftover
) -> bool:
    """Whether the names close nearly all of the gap that functions without a name could close.

    In logs of many rows what a form misses is sure as well, and free functions of a name's own
    channels hold the name: they do not make it a stand-in where little is left to explain. The gap
    is that of left-out folds in the noise's own metric: slow noise would hide it. Names that close
    it in the target's unit may leave more of what the noise sees, such as the shape of a jump.
    """
    if not leftover.groups or not final.named:
        return False
    seen = _share_closed(problem, whitening, base, final, leftover)
    if seen is None or not CLOSED_IN_NOISE <= seen < SETTINGS.most:
        return seen is not None and seen >= SETTINGS.most
    plain = _share_closed(problem, plain_rows(problem, final), base, final, leftover)
    return plain is None or plain >= SETTINGS.most


def _share_closed(
    problem: Problem, whitening: Whitening, base: Working, final: Working, leftover: Leftover
) -> float | None:
    """Share that names close of what they and functions without a name close on left-out folds.

    None where functions that explain a lot close nothing there: runs go where no other went.
    """
    before, after = (held_out(problem, work, whitening).squares for work in (base, final))
    floor = held_out(problem, final, whitening, leftover.groups).squares
    if floor >= after:
        return None
    return (before - after) / max(before - floor, TINY)


def _stand_in(
    searcher: Searcher,
    work: Working,
    leftover: Leftover,
    at_first: float,
    little: Sequence[str] | None,
) -> str | None:
    """The named effect that most clearly stands in for something else, if one does.

    `at_first`: what was left before any name was taken back, in χ²; a name that was is part of
    what is left now, and no reason to take back those that explain something else. `little`: of
    names that close nearly all of the gap, those that close next to nothing: they may be part of
    anything larger that is left. None where the names do not close it.
    """
    if not leftover.groups or not work.named:
        return None
    dictionary = searcher.study.dictionary(work, searcher.whitening)
    shares = {e.name: leftover.net / max(owned_gain(dictionary, e.name), TINY)
              for e in work.named if little is None or e.name in little}  # fmt: skip
    larger = SETTINGS.overwhelming if little is None else 1.0
    small = larger * leftover.net / max(at_first, TINY)
    doubted = [n for n, share in shares.items() if share > small
               or (share > SETTINGS.little
                   and leftover.survives[n] < SETTINGS.stand_in)]  # fmt: skip
    return max(doubted, key=lambda name: shares[name], default=None)


def _closing_little(problem: Problem, base: Working, final: Working) -> list[str]:
    """Names without which next to nothing of the gap opens again, in the target's unit."""
    plain = plain_rows(problem, final)
    before, after = (held_out(problem, work, plain).squares for work in (base, final))
    found = []
    for effect in final.named:
        rest, _ = solved_at(problem, final.having([e for e in final.effects if e != effect]), plain)
        opened = held_out(problem, rest, plain).squares - after
        if opened < SETTINGS.bends * (before - after):
            found.append(effect.name)
    return found
