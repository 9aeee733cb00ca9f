"""What is left that no name explains, and the channels that carry it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import chi2

from flexspline.discovery.ceiling import Ceiling, Overlap
from flexspline.discovery.evidence import gain_of
from flexspline.discovery.nameless import Nameless, channel_told
from flexspline.discovery.predictive import foretold_gain
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.table import Columns, Table, solved
from flexspline.discovery.values import ROUND
from flexspline.discovery.working import Working

__all__ = ["Leftover", "kept", "leftover_of"]


@dataclass(frozen=True)
class Leftover:
    """Functions that explain the residual; `gain` in χ², by channel in `carried`.

    `net`: of each when it was taken, less what the best of so many reaches by chance.

    `share`: of all that names and functions explain, the functions' part, in χ².

    `survives`: gain of each named effect beside these functions and all others of one of their
    channels, over its gain without them.
    """

    groups: tuple[Nameless, ...]
    gain: float
    net: float
    share: float
    carried: dict[str, float]
    survives: dict[str, float]

    def times(self, share: float) -> Leftover:
        """What so many times the rows would show."""
        carried = {name: share * gain for name, gain in self.carried.items()}
        return replace(self, gain=share * self.gain, carried=carried)

    @property
    def channels(self) -> list[str]:
        """Those that carry it, the most important first."""
        order = sorted(self.carried, key=lambda name: -self.carried[name])
        told = [n for n in order if self.carried[n] >= SETTINGS.little * max(self.gain, TINY)]
        return told or order[:1]


def leftover_of(ceiling: Ceiling, work: Working) -> Leftover:
    """Find the functions without a name that still gain beside a model."""
    overlap = ceiling.beside(work)
    above = 0.0
    while len(overlap.chosen) < SETTINGS.tried:
        best = _best(overlap)
        if best is None:
            break
        above += best[1]
        overlap.take([best[0]])
    return _summary(overlap, work, above)


def _best(overlap: Overlap) -> tuple[int, float] | None:
    """The next functions, with their gain above its price."""
    gains = overlap.gains()
    scored = [
        (gain - chi2.isf(SETTINGS.alpha / len(gains), max(seen, 1)), gain, k)
        for k, (gain, seen) in enumerate(gains)
        if k not in overlap.chosen
    ]
    for net, gain, k in sorted(scored, reverse=True):
        if net <= 0.0:
            return None
        table = overlap.table(k)
        every = np.arange(len(table.total) - 1)
        own = len(every) - overlap.ceiling.groups[k].count
        if foretold_gain(table, every[:own], every[own:], gain).sum() > 0.5**2 * gain:
            return k, net
    return None


def _summary(overlap: Overlap, work: Working, net: float) -> Leftover:
    table, ceiling = overlap.table(), overlap.ceiling
    known_load = ceiling.problem.known_load
    groups = [ceiling.groups[k] for k in overlap.chosen]
    ends = overlap.own - 1 + np.cumsum([0, *(group.count for group in groups)])
    at = [np.arange(a, b) for a, b in pairwise(ends.tolist())]
    own, raw = np.arange(overlap.own - 1), np.diag(table.total)
    everything = np.concatenate([np.empty(0, dtype=np.intp), *at])
    gain = gain_of(table.without(own), everything, raw)[0] if len(at) else 0.0
    told = [{channel_told(c, known_load) for c in group.channels} for group in groups]
    carried = {}
    for name in dict.fromkeys(c for names in told for c in sorted(names)):
        rest = [a for names, a in zip(told, at, strict=True) if name not in names]
        kept = np.concatenate([np.empty(0, dtype=np.intp), *rest])
        without = gain_of(table.without(own), kept, raw)[0] if len(rest) else 0.0
        carried[name] = gain - without
    share = net / max(net + _named_gain(table, work), TINY)
    survives = _survival(overlap, work, set(carried))
    return Leftover(tuple(groups), gain, net, share, carried, survives)


def _named_gain(table: Table, work: Working) -> float:
    """What all names explain beside the base, in χ²."""
    named = np.isin(work.owners(), [effect.name for effect in work.named])
    mine, base = np.flatnonzero(named), np.flatnonzero(~named)
    return gain_of(table.without(base), mine, np.diag(table.total))[0] if len(mine) else 0.0


def _survival(overlap: Overlap, work: Working, carriers: set[str]) -> dict[str, float]:
    """Gain of each named effect beside the functions taken and all of a channel that carries them.

    Gain, over its gain without them. What a cause without a name shows of one channel alone may be
    taken for an effect of that channel. Orders of the motor's angle are what a ripple of it is made
    of: they do not stand against it.
    """
    ceiling, own = overlap.ceiling, np.arange(overlap.own - 1)
    load = ceiling.problem.known_load
    alone = [k for k, group in enumerate(ceiling.groups) if len(group.channels) == 1]
    carrying = [k for k in alone if channel_told(ceiling.groups[k].channels[0], load) in carriers]
    beside = [k for k in carrying if k not in overlap.chosen]
    if beside:
        overlap.take(beside)
    table = overlap.table()
    taken = [ceiling.groups[k] for k in overlap.chosen]
    everything = np.arange(len(own), len(table.total) - 1)
    turns = [group.channels == (ROUND,) for group in taken for _ in range(group.count)]
    apart = everything[~np.array(turns, dtype=bool)]
    survives, owners = {}, np.array(work.owners())
    for effect in work.named:
        mine, others = own[owners == effect.name], own[owners != effect.name]
        turning = effect.ripple and "motor_position" in effect.reads
        survives[effect.name] = kept(table, mine, others, apart if turning else everything)
    return survives


def kept(table: Table, mine: Columns, others: Columns, functions: Columns) -> float:
    """Share of its gain that a name keeps beside functions, its coefficients at most as without.

    Functions that hold nearly all of it leave slivers of its columns, by which free coefficients
    would explain whatever is there. So the name is taken as it was fitted, times c in [0, 1]: with
    L the squares that functions leave of that column, and b its product with what they leave of
    the target, it explains 2 c b − c² L.
    """
    alone, beside = table.without(others), table.without(np.concatenate([others, functions]))
    beta = solved(alone, mine)
    gain = float(beta @ alone[mine, -1])
    along = float(beta @ beside[mine, -1])
    squares = float(beta @ beside[np.ix_(mine, mine)] @ beta)
    scale = float(np.clip(along / max(squares, TINY), 0.0, 1.0))
    return (2.0 * scale * along - scale**2 * squares) / max(gain, TINY)
