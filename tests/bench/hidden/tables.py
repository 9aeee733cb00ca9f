"""What came out, as text and as plain values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hidden.by_class import class_gaps, class_shares, not_dealt
from hidden.confusion import confusion
from hidden.shares import GAP_BAR, Share, brier, gaps, reliability, shares
from hidden.trial import Outcome

__all__ = ["summary", "text"]


def text(outcomes: Sequence[Outcome]) -> str:
    """Return all tables; of a recorded class those of its own bars."""
    dealt = [o for o in outcomes if not o.undealt]
    if not dealt:
        return _not_dealt(outcomes)
    if dealt[0].case.recorder == "exact":
        parts = [_shares(shares(outcomes)), _by_target(outcomes, shares), _gaps(gaps(outcomes))]
    else:
        parts = [f"Class {dealt[0].case.recorder}\n" + _shares(class_shares(dealt)),
                 _by_target(dealt, class_shares), _gaps(class_gaps(dealt)),
                 _not_dealt(outcomes), _besides(dealt)]  # fmt: skip
    return "\n\n".join([*parts, _reliability(dealt), _confused(dealt), _seconds(dealt)])


def _not_dealt(outcomes: Sequence[Outcome]) -> str:
    counts = sorted(not_dealt(outcomes).items())
    lines = [f"Not dealt, for t is above 0.8 of the largest: {sum(n for _, n in counts)} cases"]
    return "\n".join([*lines, *(f"{label}, t = {size:g}: {n}" for (label, size), n in counts)])


def _line(one: Share) -> str:
    said = f"{one.what:66s} {one.hits:4d} of {one.of:4d}"
    if not one.of:
        return said
    said += f"  {100 * one.value:5.1f} % ({100 * one.low:.0f} to {100 * one.high:.0f})"
    if one.bar is None:
        return said
    return f"{said}  bar {100 * one.bar:.0f} %: {'pass' if one.passes else 'FAIL'}"


def _shares(every: Sequence[Share]) -> str:
    return "\n".join(["Shares with Wilson's 95 % intervals", *map(_line, every)])


def _besides(dealt: Sequence[Outcome]) -> str:
    """How many small effects there were besides; two or three where they can be small enough."""
    lines = ["Small effects besides: cases with none, one, two, three"]
    for size in sorted({o.case.size for o in dealt if o.case.nameable}, reverse=True):
        own = [len(o.small) for o in dealt if o.case.nameable and o.case.size == size]
        lines.append(f"t = {size:g}: {', '.join(str(own.count(k)) for k in range(4))}")
    return "\n".join(lines)


def _by_target(
    outcomes: Sequence[Outcome], every: Callable[[Sequence[Outcome]], list[Share]]
) -> str:
    lines = ["By target: right sets of names, all sizes; nothing; unknown (t = 50 and 16)"]
    for target in dict.fromkeys(o.case.target for o in outcomes):
        own = [s for s in every([o for o in outcomes if o.case.target == target])
               if s.bar is not None]  # fmt: skip
        lines += [_line(Share(f"{target}: {s.what.strip()}", s.hits, s.of, s.low, s.high, s.bar))
                  for s in own]  # fmt: skip
    return "\n".join(lines)


def _gaps(every: Sequence[tuple[str, int, float, float, float, float]]) -> str:
    lines = ["Share closed of what the true forms close, on runs that nobody fitted"]
    for size, count, mean, median, worst, reached in every:
        verdict = "pass" if mean >= GAP_BAR else "FAIL"
        lines.append(f"{size:20s}{count:4d} cases: mean {mean:.3f} (bar {GAP_BAR}: {verdict}), "
                     f"median {median:.3f}, worst {worst:.2f}, "
                     f"{100 * reached:.0f} % of cases reach it")  # fmt: skip
    return "\n".join(lines)


def _reliability(outcomes: Sequence[Outcome]) -> str:
    lines = [f"Reliability of the confidence (Brier {brier(outcomes):.3f})"]
    for one in reliability(outcomes):
        inside = one.right.low <= one.mean <= one.right.high
        lines.append(f"said {one.mean:.2f}: right {one.right.hits:3d} of {one.right.of:3d}, "
                     f"{one.right.value:.2f} ({one.right.low:.2f} to {one.right.high:.2f})"
                     f"{'' if inside else '  outside'}")  # fmt: skip
    return "\n".join(lines)


def _confused(outcomes: Sequence[Outcome]) -> str:
    """The confusion matrix without its diagonal; whole in the figure and in JSON."""
    table, lines = confusion(outcomes), ["Confused (the whole matrix is in the figure)"]
    for row, counts in table.iterrows():
        total = int(counts.sum())
        others = counts.drop(index=row, errors="ignore")
        said = ", ".join(f"{name} {n}" for name, n in others[others > 0].items())
        lines.append(f"{row:33s} {int(counts.get(row, 0)):4d} of {total:4d} as itself"
                     f"{'; ' + said if said else ''}")  # fmt: skip
    return "\n".join(lines)


def _seconds(outcomes: Sequence[Outcome]) -> str:
    times = [o.seconds for o in outcomes]
    faults = sum(bool(o.faults) for o in outcomes)
    return (f"Processor time of a case: median {np.median(times):.1f} s, "
            f"worst {np.max(times):.1f} s; "
            f"cases with a data fault (exact: there is none): {faults}")  # fmt: skip


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return all numbers as plain values."""
    undealt = not_dealt(outcomes)
    outcomes = [o for o in outcomes if not o.undealt]
    table = confusion(outcomes)
    exact = all(o.case.recorder == "exact" for o in outcomes)
    every, closed = (shares, gaps) if exact else (class_shares, class_gaps)
    return {
        "cases": len(outcomes),
        "not_dealt": {f"{label} t={size:g}": n for (label, size), n in undealt.items()},
        "shares": [{**asdict(s), "value": s.value, "passes": s.passes} for s in every(outcomes)],
        "gap_closed": [dict(zip(("size", "cases", "mean", "median", "worst",
                                 "share_of_cases_above_bar"),
                                row, strict=True)) for row in closed(outcomes)],
        "reliability": [asdict(one) for one in reliability(outcomes)],
        "brier": brier(outcomes),
        "confusion": {"hidden": list(table.index), "named": list(table.columns),
                      "counts": table.to_numpy().tolist()},
        "seconds": {"median": float(np.median([o.seconds for o in outcomes])),
                    "worst": max(o.seconds for o in outcomes)},
    }  # fmt: skip
