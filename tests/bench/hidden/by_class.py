"""The table of a recorded class: shares with their intervals and bars, and what is kept of a name.

a name lowers the error     on three runs that nobody fitted (`laws.py`)
a name is told from zero    a coefficient of it is two standard errors from zero in the final fit;
                            `together`: its coefficients are as surely not all zero, which
                            `discover` itself asks of each name
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from hidden.cases import RECORDED_SIZES
from hidden.shares import GAP_BAR, NAMEABLE, NOTHING_BAR, UNKNOWN_BAR, Share, share
from hidden.trial import Outcome

__all__ = ["CLASS_BARS", "LAWS", "WRONG", "class_gaps", "class_shares", "not_dealt"]

CLASS_BARS: Mapping[str, Mapping[float, float]] = {
    "lab": {500.0: 0.92, 50.0: 0.95, 16.0: 0.90, 5.0: 0.70},
    "robot": {500.0: 0.88, 50.0: 0.90, 16.0: 0.80, 5.0: 0.55},
}
WRONG = 0.02  # of cases, with a wrong name or fault
LAWS = 0.02  # of names that contradict themselves
CLEAR = 2.0  # standard errors
SEEN = 16.0  # t from which an unknown cause is to be said


def class_shares(outcomes: Sequence[Outcome]) -> list[Share]:
    """Return every share of one recorded class; of shares of what is wrong, those without it."""
    dealt = [o for o in outcomes if not o.undealt]
    recorder, made = dealt[0].case.recorder, list[Share]()
    for size in RECORDED_SIZES:
        own = [o for o in dealt if o.case.kind in NAMEABLE and o.case.size == size]
        bar = CLASS_BARS[recorder][size]
        made.append(share(f"right set of names, t = {size:g}", (o.right for o in own), bar))
        made += [share(f"  {kind}, t = {size:g}", (o.right for o in own if o.case.kind == kind))
                 for kind in NAMEABLE]  # fmt: skip
    nothing = [o for o in dealt if o.case.kind == "nothing"]
    made.append(share("nothing hidden, nothing named",
                      (_silent(o) for o in nothing), NOTHING_BAR))  # fmt: skip
    made += _unknown([o for o in dealt if o.case.kind in ("unknown", "removed")])
    made += _wrong(dealt)
    there = [name in (*o.small, *o.case.nameable) for o in dealt for name in o.also_seen]
    return [*made, *_laws(dealt), share('"also seen", and there', there)]


def _silent(one: Outcome) -> bool:
    """Whether nothing is named, but a lag with the delay that it is."""
    return not one.error and "" not in one.means


def _unknown(both: list[Outcome]) -> list[Share]:
    seen = [o for o in both if o.case.size >= SEEN]
    made = [share("unknown cause: unexplained, no name, t ≥ 16", (o.right for o in seen),
                  UNKNOWN_BAR)]  # fmt: skip
    for kind, label in (("unknown", "not in the catalogue"), ("removed", "taken out of it")):
        made += [share(f"  {label}, t = {size:g}",
                       (o.right for o in both if o.case.kind == kind and o.case.size == size))
                 for size in RECORDED_SIZES]  # fmt: skip
    return made


def _wrong(dealt: list[Outcome]) -> list[Share]:
    """Cases without a wrong name or fault, which the bar is turned round for."""
    made = [share("no wrong name or fault, all cases", (not o.wrong for o in dealt), 1.0 - WRONG)]
    for size in (*RECORDED_SIZES, 0.0):
        own = [o for o in dealt if o.case.size == size]
        label = f"t = {size:g}" if size else "nothing hidden"
        made.append(share(f"  {label}", (not o.wrong for o in own), 1.0 - WRONG))
    made.append(share("  no wrong name, faults apart", ("" not in o.means for o in dealt)))
    made.append(share("no error raised", (not o.error for o in dealt)))
    return made


def _laws(dealt: list[Outcome]) -> list[Share]:
    """Names that hold what a name promises."""
    lower = [after < before for o in dealt for before, after, _ in o.unseen]
    clear = [errors > CLEAR for o in dealt for _, _, errors in o.unseen if o.case.size >= SEEN]
    told = [one for o in dealt for one in o.told]
    together = [one for o in dealt for one in o.together]
    both = [one and after < before for o in dealt
            for one, (before, after, _) in zip(o.told, o.unseen, strict=True)]  # fmt: skip
    return [
        share("names that lower the error on unseen runs", lower),
        share("  by more than two standard errors, t ≥ 16", clear),
        share("  the error that discover reports", (a < b for o in dealt for b, a in o.rmse)),
        share("names that are told from zero in the final fit", told),
        share("  by its coefficients together", together),
        share("names that lower the error and are told from zero", both, 1.0 - LAWS),
    ]


def class_gaps(outcomes: Sequence[Outcome]) -> list[tuple[str, int, float, float, float, float]]:
    """Return size, count, mean (of shares cut to −1 … 1), median, worst, share of cases ≥ 0.9."""
    made = []
    for size in RECORDED_SIZES:
        own = np.array([o.closed for o in outcomes if o.closed is not None
                        and o.case.kind in NAMEABLE and o.case.size == size])  # fmt: skip
        if len(own):
            mean = float(np.mean(np.clip(own, -1.0, 1.0)))
            made.append((f"t = {size:g}", len(own), mean, float(np.median(own)), float(own.min()),
                         float(np.mean(own >= GAP_BAR))))  # fmt: skip
    return made


def not_dealt(outcomes: Sequence[Outcome]) -> Counter[tuple[str, float]]:
    """Count cases whose size is out of reach by what is hidden and its size."""
    return Counter((o.case.label, o.case.size) for o in outcomes if o.undealt)
