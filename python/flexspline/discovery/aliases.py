"""Names that explain these runs as well: rivals beside which a named effect leaves next to nothing.

An alias is real where what the named effect explains, projected on the rest of the model and the
rival, leaves t < 3. The gain of the effect beside the rival estimates t² plus its number of
columns. The rival's shapes are refitted first: on the grid it may look worse than it is.

Where forms are not exact, as in all measured logs, t goes on growing with the length of the log.
There a rival counts as well that explains nearly as much and whose squares on left-out folds do
not exceed the named effect's by more than they vary from fold to fold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexspline.discovery.evidence import gain_of
from flexspline.discovery.forms import owned_gain
from flexspline.discovery.physics import impossible
from flexspline.discovery.predictive import foretold_gain
from flexspline.discovery.scores import Offer, offers
from flexspline.discovery.search import Searcher, freedom
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.table import Columns, Table
from flexspline.discovery.working import Working
from flexspline.effects import Effect
from flexspline.fit.ripple import FOLLOWER, LEADERS
from flexspline.report.numbers import percent

__all__ = ["Rival", "rivals_of", "simplest"]

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
        return self.adds < SETTINGS.told and self.gain >= (1.0 - SETTINGS.little) * self.own


def rivals_of(searcher: Searcher, work: Working, effect: Effect) -> list[Rival]:
    """Return the rivals of a named effect, the best first."""
    dictionary = searcher.study.dictionary(work, searcher.whitening, without=effect.name)
    rest = dictionary.without([effect.name])
    mine = dictionary.model[np.array(dictionary.owners) == effect.name]
    own = owned_gain(dictionary, effect.name)
    raw = np.diag(dictionary.table.total)
    beside_it = dictionary.table.without(dictionary.model)
    made = []
    for offer in offers(dictionary, rest, len(dictionary.candidates)):
        beside: Columns = np.concatenate([rest, offer.columns])
        kept = gain_of(dictionary.table.without(beside), mine, raw)[0]
        made.append((kept, offer))
    found = []
    for rank, (kept, offer) in enumerate(sorted(made, key=lambda pair: pair[0])):
        gain = offer.gain
        if rank < SETTINGS.tried and kept < EXPLAINS * own <= gain:
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
