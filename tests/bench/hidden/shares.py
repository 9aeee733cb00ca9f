"""Shares with their intervals, and the bars that they are held against."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from scipy.stats import binomtest

from hidden.trial import Outcome

__all__ = ["BARS", "Bin", "Share", "brier", "gaps", "names_of", "reliability", "share", "shares"]

NAMEABLE = ("single", "pair", "triple")
BARS = {50.0: 0.97, 16.0: 0.95, 5.0: 0.80}
NOTHING_BAR, UNKNOWN_BAR, GAP_BAR = 0.98, 0.90, 0.9
EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 1.0)


@dataclass(frozen=True)
class Share:
    """`hits` of `of`, with the 95 % interval of Wilson; `bar`: what it should reach, or None."""

    what: str
    hits: int
    of: int
    low: float
    high: float
    bar: float | None = None

    @property
    def value(self) -> float:
        return self.hits / self.of if self.of else float("nan")

    @property
    def passes(self) -> bool | None:
        """Whether the bar is reached; None without one."""
        return None if self.bar is None or not self.of else self.value >= self.bar


def share(what: str, right: Iterable[bool], bar: float | None = None) -> Share:
    """Return the share of what is right."""
    every = list(right)
    if not every:
        return Share(what, 0, 0, 0.0, 1.0, bar)
    interval = binomtest(sum(every), len(every)).proportion_ci(method="wilson")
    return Share(what, sum(every), len(every), float(interval.low), float(interval.high), bar)


def shares(outcomes: Sequence[Outcome]) -> list[Share]:
    """Return every share that is reported."""
    made = []
    for size, bar in BARS.items():
        own = [o for o in outcomes if o.case.kind in NAMEABLE and o.case.size == size]
        made.append(share(f"right set of names, t = {size:g}", (o.right for o in own), bar))
        made += [share(f"  {kind}, t = {size:g}", (o.right for o in own if o.case.kind == kind))
                 for kind in NAMEABLE]  # fmt: skip
    kinds = {kind: [o for o in outcomes if o.case.kind == kind]
             for kind in ("nothing", "restless", "unknown", "removed", "mismatch")}  # fmt: skip
    nothing = kinds["nothing"]
    made.append(share("nothing hidden, nothing named", (o.right for o in nothing), NOTHING_BAR))
    made.append(share("  of these, nothing called unexplained",
                      (o.unexplained is None for o in nothing)))  # fmt: skip
    for level in sorted({o.case.restless for o in kinds["restless"]}):
        own = [o for o in kinds["restless"] if o.case.restless == level]
        made.append(share(f"  and a noisy velocity, {level:g} of the noise at rest",
                          (o.right for o in own), NOTHING_BAR))  # fmt: skip
    made += _unknowns(kinds["unknown"], kinds["removed"])
    made.append(share("form 9 % off, t = 50 … 150: one name, all explained",
                      (o.right for o in kinds["mismatch"]), BARS[50.0]))  # fmt: skip
    names = [m != "" for o in outcomes for m in o.means]
    made.append(share("names that are wrong, of all given", (not one for one in names)))
    return made


def _unknowns(unknown: list[Outcome], removed: list[Outcome]) -> list[Share]:
    """Unexplained and not named, at sizes where a cause without a name can be seen."""
    both, made = unknown + removed, []
    seen = [o for o in both if o.case.size > min(BARS)]
    made.append(share("unknown cause: unexplained, no name, t = 50 and 16",
                      (o.right for o in seen), UNKNOWN_BAR))  # fmt: skip
    for label, own in (("not in the catalogue", unknown), ("taken out of it", removed)):
        made += [share(f"  {label}, t = {size:g}", (o.right for o in own if o.case.size == size))
                 for size in BARS]  # fmt: skip
    made.append(share("unknown cause: no name, all sizes", (not o.names for o in both)))
    return made


def gaps(outcomes: Sequence[Outcome]) -> list[tuple[str, int, float, float, float, float]]:
    """Return size, count, mean (of shares cut to −1 … 1), median, worst and share of cases ≥ 0.9.

    Of all cases that have names, silent and wrong ones with them; and of those named right.
    """
    made = []
    for size, right in product(BARS, (False, True)):
        own = np.array([o.closed for o in outcomes if o.closed is not None and o.right >= right
                        and o.case.kind in NAMEABLE and o.case.size == size])  # fmt: skip
        if len(own):
            mean = float(np.mean(np.clip(own, -1.0, 1.0)))
            reached = float(np.mean(own >= GAP_BAR))
            label = f"t = {size:g}{', named right' if right else ''}"
            made.append((label, len(own), mean, float(np.median(own)), float(own.min()), reached))
    return made


@dataclass(frozen=True)
class Bin:
    """Names whose confidence lies between two edges: its mean, and the share that is right."""

    low: float
    high: float
    mean: float
    right: Share


def names_of(outcomes: Sequence[Outcome]) -> tuple[np.ndarray, np.ndarray]:
    """Return confidence (K,) of every name, and whether it is right, (K,)."""
    every = [(c, m != "") for o in outcomes for c, m in zip(o.confidences, o.means, strict=True)]
    return np.array([c for c, _ in every]), np.array([r for _, r in every], dtype=bool)


def reliability(outcomes: Sequence[Outcome]) -> list[Bin]:
    """Return the bins that hold a name."""
    confidence, right = names_of(outcomes)
    made = []
    for low, high in pairwise(EDGES):
        own = (confidence > low) & (confidence <= high)
        if own.any():
            mean = float(confidence[own].mean())
            made.append(Bin(low, high, mean, share(f"{low:g} to {high:g}", right[own].tolist())))
    return made


def brier(outcomes: Sequence[Outcome]) -> float:
    """Mean squared difference of confidence and truth; 0.25 for a coin."""
    confidence, right = names_of(outcomes)
    return float(np.mean((confidence - right) ** 2)) if len(right) else float("nan")
