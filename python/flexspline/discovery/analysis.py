"""From a base model to names: noise, search, what is left, in this order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.aliases import simplest
from flexspline.discovery.ceiling import Ceiling
from flexspline.discovery.evidence import gain_of
from flexspline.discovery.forms import owned_gain
from flexspline.discovery.heldout import HeldOut, held_out, plain_rows
from flexspline.discovery.nameless import nameless_of
from flexspline.discovery.noise import first_whitening, restricted_whitening
from flexspline.discovery.refit import at_upper_bound, refitted, solved_at, started
from flexspline.discovery.search import Limits, Searcher, Step, ranked
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.sheet import Sheet
from flexspline.discovery.study import Study
from flexspline.discovery.thinning import rows_of, thinned
from flexspline.discovery.unexplained import Leftover, leftover_of
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working, working
from flexspline.effects import Effect
from flexspline.fit.memory import settled
from flexspline.fit.problem import Problem

__all__ = ["Analysis", "analysed"]

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

    Of long logs a part is searched first (`thinning.py`), then all rows from there.
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
