"""Rows: what is hidden. Columns: the name given, "unexplained" or "nothing" among both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import pandas as pd

from hidden.trial import Outcome

__all__ = ["confusion"]

NOTHING, UNEXPLAINED, UNKNOWN, REMOVED = "nothing", "unexplained", "unknown cause", "taken out"
MORE = "nothing more"


def confusion(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """Count names by what is hidden.

    A hidden effect that got no name of its own is counted at each wrong name of its case, else at
    "unexplained" or "nothing". Wrong names beside hidden effects that were all found are counted
    in the row "nothing more". A declared alias that is real counts as the hidden effect.
    """
    counted: Counter[tuple[str, str]] = Counter()
    for one in outcomes:
        counted.update(_cells(one))
    rows = _ordered({row for row, _ in counted}, (MORE, NOTHING, UNKNOWN, REMOVED))
    columns = _ordered({column for _, column in counted}, (UNEXPLAINED, NOTHING))
    table = [[counted[row, column] for column in columns] for row in rows]
    return pd.DataFrame(table, index=rows, columns=columns)


def _ordered(names: set[str], last: tuple[str, ...]) -> list[str]:
    return sorted(names - {*last}) + [name for name in last if name in names]


def _cells(one: Outcome) -> list[tuple[str, str]]:
    wrong = [name for name, means in zip(one.names, one.means, strict=True) if not means]
    left = UNEXPLAINED if one.unexplained is not None else NOTHING
    if not one.case.nameable:
        row = UNKNOWN if one.case.unknown else REMOVED if one.case.excluded else NOTHING
        return [(row, name) for name in wrong or [left]]
    missed = [name for name in one.case.nameable if name not in one.means]
    cells = [(name, name) for name in one.means if name]
    cells += [(name, other) for name in missed for other in wrong or [left]]
    return cells if missed else cells + [(MORE, name) for name in wrong]
