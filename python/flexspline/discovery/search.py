"""Which effects are missing: added one after the other, every earlier choice examined again.

Each round refits the shapes of the model, offers every candidate in its best form beside it (a
shape between the screened ones where that decides), and takes the best that

- gains more than its price (`evidence.py`: the family of candidates is accounted for),
- gains on left-out folds too,
- is no leftover of a name's form (`forms.py`),
- is physically possible (`physics.py`).

Then each name is put to the test again: beside all others it must still pay its price, and no
other candidate may do clearly better in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from flexspline.discovery.dictionary import Dictionary
from flexspline.discovery.forms import (
    missed,
    owned_gain,
    owned_price,
    pays_beside_forms,
    undecided,
)
from flexspline.discovery.grids import SHARED
from flexspline.discovery.heldout import held_out, plain_rows
from flexspline.discovery.physics import LOOPS, driving_spring, impossible
from flexspline.discovery.predictive import foretold_gain
from flexspline.discovery.refit import refitted
from flexspline.discovery.scores import Offer, offers
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.study import Study
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.effects import Effect

__all__ = ["Limits", "Searcher", "Step", "freedom", "ranked"]

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

    Springs of one sign are about as free as one: their columns are alike (`cone.py`).
    """
    return (1 if effect.name in LOOPS else len(effect.terms)) + len(own_shapes(effect))


def own_shapes(effect: Effect) -> list[str]:
    """Shapes that are fitted, but for those that all friction shares."""
    return [s.name for s in effect.fitted_shapes if s.name not in SHARED]
