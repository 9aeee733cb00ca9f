"""What is left that no name explains, and the channels that carry it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from flexspline.discovery.nameless import Nameless, columns_of, nameless_of
from flexspline.discovery.scores import ALPHA, gain_of
from flexspline.discovery.table import Table, tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.fit.problem import Problem

__all__ = ["Leftover", "leftover_of"]

MOST = 3
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
        """Those that carry it, the most important first; the motor's angle by its channel."""
        order = sorted(self.carried, key=lambda name: -self.carried[name])
        told = [n for n in order if self.carried[n] >= CARRIES * max(self.gain, 1e-300)]
        return ["motor_position" if name == "motor_angle" else name for name in told or order[:1]]


def leftover_of(problem: Problem, work: Working, whitening: Whitening) -> Leftover:
    """Find the functions without a name that still gain beside a model."""
    groups = nameless_of(problem)
    columns = []
    for number in range(len(problem.runs)):
        rows, target = work.rows(problem, number)
        columns.append((np.column_stack([rows, columns_of(groups, problem, number)]), target))
    table = tabulated(problem, columns, whitening)
    own = len(work.owners())
    ends = own + np.cumsum([0, *(group.count for group in groups)])
    at = [np.arange(a, b) for a, b in pairwise(ends.tolist())]
    model, chosen = np.arange(own), list[int]()
    while len(chosen) < MOST:
        best = _best(table, model, at, chosen)
        if best is None:
            break
        chosen.append(best)
        model = np.concatenate([model, at[best]])
    return _summary(table, work, [groups[k] for k in chosen], [at[k] for k in chosen])


def _best(
    table: Table, model: NDArray[np.intp], at: list[NDArray[np.intp]], chosen: list[int]
) -> int | None:
    left, raw = table.without(model), np.diag(table.total)
    scored = []
    for k, columns in enumerate(at):
        if k not in chosen:
            gain, seen = gain_of(left, columns, raw)
            scored.append((gain - chi2.isf(ALPHA / len(at), max(seen, 1)), gain, k))
    before = table.held_out(model).sum()
    for net, gain, k in sorted(scored, reverse=True):
        if net <= 0.0:
            return None
        if before - table.held_out(np.concatenate([model, at[k]])).sum() > HELD_OUT * gain:
            return k
    return None


def _summary(
    table: Table, work: Working, groups: list[Nameless], at: list[NDArray[np.intp]]
) -> Leftover:
    own = np.arange(len(work.owners()))
    raw = np.diag(table.total)
    everything = np.concatenate([np.empty(0, dtype=np.intp), *at])
    gain = gain_of(table.without(own), everything, raw)[0] if len(at) else 0.0
    carried = {}
    for name in dict.fromkeys(c for group in groups for c in group.channels):
        rest = [a for g, a in zip(groups, at, strict=True) if name not in g.channels]
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
