"""What is left that no name explains, and the channels that carry it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import chi2

from flexspline.discovery.ceiling import Ceiling, Overlap
from flexspline.discovery.nameless import Nameless, channel_told
from flexspline.discovery.scores import ALPHA, gain_of
from flexspline.discovery.table import Table
from flexspline.discovery.working import Working

__all__ = ["Leftover", "leftover_of"]

MOST = 4
FIRM = 1e-10  # of a column's squares: what keeps dependent columns of the model apart
HELD_OUT = 0.25  # of a function's gain that it must keep on left-out folds
CARRIES = 0.15  # of the whole gain that hangs on a channel, for the channel to be named


@dataclass(frozen=True)
class Leftover:
    """Functions that explain the residual; `gain` in χ², by channel in `carried`.

    `survives`: gain of each named effect beside these functions, over its gain without them.
    """

    groups: tuple[Nameless, ...]
    gain: float
    carried: dict[str, float]
    survives: dict[str, float]

    @property
    def channels(self) -> list[str]:
        """Those that carry it, the most important first."""
        order = sorted(self.carried, key=lambda name: -self.carried[name])
        told = [n for n in order if self.carried[n] >= CARRIES * max(self.gain, 1e-300)]
        return told or order[:1]


def leftover_of(ceiling: Ceiling, work: Working) -> Leftover:
    """Find the functions without a name that still gain beside a model."""
    overlap = ceiling.beside(work)
    while len(overlap.chosen) < MOST:
        best = _best(overlap)
        if best is None:
            break
        overlap.take(best)
    return _summary(overlap, work)


def _best(overlap: Overlap) -> int | None:
    gains = overlap.gains()
    scored = [
        (gain - chi2.isf(ALPHA / len(gains), max(seen, 1)), gain, k)
        for k, (gain, seen) in enumerate(gains)
        if k not in overlap.chosen
    ]
    for net, gain, k in sorted(scored, reverse=True):
        if net <= 0.0:
            return None
        table = overlap.table(k)
        own = len(table.total) - 1 - overlap.ceiling.groups[k].count
        if held_out_gain(table, own, gain) > HELD_OUT * gain:
            return k
    return None


def held_out_gain(table: Table, own: int, gain: float) -> float:
    """Fall of the squares on left-out folds by the functions behind the first `own` columns.

    Where a fold goes beyond the others, free functions run wild, so these are drawn towards
    nothing: in columns of length one their coefficients have the mean square gain / count.
    """
    total = table.total
    count = len(total) - 1 - own
    ridge = np.append(np.full(own, FIRM), np.full(count, count / max(gain, 1.0)))
    scale = np.sqrt(np.maximum(np.diag(total)[:-1], 1e-300))
    fall = 0.0
    for fold in table.folds:
        others = total - fold
        for columns, sign in ((own, 1.0), (own + count, -1.0)):
            part = slice(0, columns)
            length = scale[part]
            products = others[part, part] / np.outer(length, length) + np.diag(ridge[part])
            beta = np.linalg.solve(products, others[part, -1] / length) / length
            fall += sign * float(beta @ fold[part, part] @ beta - 2.0 * beta @ fold[part, -1])
    return fall


def _summary(overlap: Overlap, work: Working) -> Leftover:
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
    survives = {}
    owners = np.array(work.owners())
    for effect in work.named:
        mine, others = own[owners == effect.name], own[owners != effect.name]
        alone = gain_of(table.without(others), mine, raw)[0]
        beside = gain_of(table.without(np.concatenate([others, everything])), mine, raw)[0]
        survives[effect.name] = beside / max(alone, 1e-300)
    return Leftover(tuple(groups), gain, carried, survives)
