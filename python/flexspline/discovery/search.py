"""Which effects are missing: added one after the other, every earlier choice examined again.

Each round refits the shapes of the model, offers every candidate in its best form beside it, and
takes the best that

- gains more than its price (`scores.py`: the family of candidates is accounted for),
- gains on left-out folds too,
- is no leftover: what a name's form misses is a small share of what that name explains,
- is physically possible (`physics.py`).

Then each name is put to the test again: beside all others it must still pay its price, and no
other candidate may do clearly better in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from flexspline.discovery.dictionary import Dictionary
from flexspline.discovery.grids import SHARED
from flexspline.discovery.heldout import held_out, plain_rows
from flexspline.discovery.physics import driving_spring, impossible
from flexspline.discovery.predictive import foretold_gain
from flexspline.discovery.refit import refitted
from flexspline.discovery.scores import Offer, gain_of, offers, price
from flexspline.discovery.study import Study
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.effects import Effect

__all__ = ["Limits", "Searcher", "Step", "freedom", "owned_gain", "ranked"]

MOST_NAMES = 8
LEFTOVER = 0.007  # of the gain of a name: below, it may be what its form misses
SAME = 0.05  # the same for a candidate that reads nothing else: it may bend what the name shows
REMEMBERED = 0.03  # the same of an effect with memory, whose loops have more ways to differ
SAME_CAUSE = 0.5  # of an offer's gain, that another one leaves of it, to explain most of the same
HELD_OUT = 0.5  # of its gain above its price that an effect must have on left-out folds
EVERYWHERE = 0.25  # the same of an effect that gains on each of them
REFITTED = 4  # offers whose shapes are refitted before one is chosen
NEAR = 0.8  # of the best offer's gain, to be among these
WORSE = 1.005  # times the error on left-out runs, which an effect may not exceed; what is small
# in slow noise lowers it by less than the noise varies
LEFT_OF_FORM = "no more than what the form of a named effect misses"
COLUMN_SHARE = 0.01  # of the gain that each further column or shape has to explain


@dataclass(frozen=True)
class Limits:
    """How strict a search is. `lax`: for a first look, without the floors."""

    lax: bool = False
    most: int = MOST_NAMES


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
        return made.worse_than(before, WORSE)

    def pruned(self, work: Working) -> Working:
        """Drop names that do not pay their price beside the others, on left-out folds too."""
        while work.named:
            dictionary = self.study.dictionary(work, self.whitening)
            rivals = len(dictionary.candidates)
            net = {e.name: owned_gain(dictionary, e.name) - price(len(e.terms), 1.0, rivals)
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
        dictionary = self.study.dictionary(work, self.whitening)
        rivals = len(dictionary.candidates)
        ranked = sorted(offers(dictionary, dictionary.model, rivals), key=_rank, reverse=True)
        missed = {o.effect.name: _missed(dictionary, work.named, o.effect) for o in ranked}
        worthy = [
            o for o in ranked if self._worthy(o, dictionary, missed[o.effect.name], work, ranked)
        ]
        while worthy:
            near = [o for o in worthy if o.gain >= NEAR * worthy[0].gain][:REFITTED]
            made = [self._tried(o, work, squares, missed[o.effect.name]) for o in near]
            trials = [trial for trial in made if trial is not None]
            if trials:
                chosen, left, offer, gain = max(trials, key=lambda t: _ranked(t[3], t[2]))
                return chosen, left, Step(offer.effect, gain, offer.price, tuple(ranked[:6]))
            worthy = [o for o in worthy if o not in near]
        return None

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
        equal = _undecided(offer, beside, dictionary, work.named)
        if equal:
            self.refused[offer.effect.name] = (
                f"what the form of a named effect misses may be all that tells it from {equal}"
            )
            return False
        foretold = foretold_gain(dictionary.table, dictionary.model, offer.columns, offer.gain)
        share = EVERYWHERE if foretold.min() > 0.0 else HELD_OUT
        if float(foretold.sum()) < share * offer.net:
            self.refused[offer.effect.name] = "does not hold on left-out runs"
            return False
        return True

    def _examined(self, work: Working, squares: float) -> tuple[Working, float]:
        """Replace or drop earlier names where that is better; every name once."""
        for effect in work.named:
            if len(work.named) < 2 or effect.name not in [e.name for e in work.named]:
                continue
            dictionary = self.study.dictionary(work, self.whitening, without=effect.name)
            rivals = len(dictionary.candidates)
            rest = dictionary.without([effect.name])
            own = owned_gain(dictionary, effect.name)
            floor = price(len(effect.terms), 1.0, rivals)
            missed = _missed(dictionary, [e for e in work.named if e.name != effect.name], effect)
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
            margin = COLUMN_SHARE * own * max(freedom(best.effect) - freedom(effect), 0)
            better = left + best.price + margin < squares + floor
            if better and not impossible(trial, best.effect.name, self.study.problem):
                work, squares = trial, left
        return work, squares


def owned_gain(dictionary: Dictionary, name: str) -> float:
    """Squares over σ² that an effect of the model explains beside all others."""
    rest = dictionary.without([name])
    own = dictionary.model[np.array(dictionary.owners) == name]
    left = dictionary.table.without(rest)
    return gain_of(left, own, np.diag(dictionary.table.total))[0]


def _missed(dictionary: Dictionary, named: Sequence[Effect], other: Effect) -> float:
    """What the forms of named effects may miss, and another effect may seem to explain, in χ²."""
    gains = []
    for effect in named:
        share = SAME if set(other.reads) <= set(effect.reads) else _share(effect)
        gains.append(share * owned_gain(dictionary, effect.name))
    return max(gains, default=0.0)


def _undecided(
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


def _share(named: Effect) -> float:
    """Of the gain of a named effect, what its form may miss."""
    return REMEMBERED if named.info.remembers else LEFTOVER


def _rank(offer: Offer) -> float:
    return _ranked(offer.gain, offer)


def ranked(gain: float, effect: Effect) -> float:
    """Gain, less a share of it for every column and shape beyond the first."""
    return gain * (1.0 - COLUMN_SHARE * (freedom(effect) - 1))


def _ranked(gain: float, offer: Offer) -> float:
    return ranked(gain, offer.effect) - offer.price


def freedom(effect: Effect) -> int:
    """How many numbers an effect is fitted by; a shape that all friction shares is none of its."""
    own = [s for s in effect.fitted_shapes if s.name not in SHARED]
    return len(effect.terms) + len(own)
