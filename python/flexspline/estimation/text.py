"""An estimate in words: what each stage gave, where it was silent, what is to be known of it."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Sequence

import numpy as np

from flexspline.estimation.result import COLUMNS, Estimate
from flexspline.estimation.status import MEANING
from flexspline.formatting import short

__all__ = ["estimate_html", "estimate_text"]

WIDTH = 100
MOST_CONTACTS = 5
HEAD = ("column", "unit", "mean", "least", "most", "empty rows")


def estimate_text(made: Estimate) -> str:
    """Return what `print(estimate)` shows."""
    rows = [HEAD, *_rows(made)]
    wide = [max(len(row[k]) for row in rows) for k in range(len(HEAD))]
    table = ["  ".join(_padded(row, wide)).rstrip() for row in rows]
    said = [
        textwrap.fill(sentence, WIDTH, initial_indent="- ", subsequent_indent="  ")
        for sentence in _sentences(made)
    ]
    return "\n".join([_title(made), "", *table, *([""] if said else []), *said])


def estimate_html(made: Estimate) -> str:
    """Return the same as a fragment of HTML, for notebooks light and dark."""

    def row(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    body = "".join(row(cells, "td") for cells in _rows(made))
    notes = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in _sentences(made))
    return (
        f"<div><b>{html.escape(_title(made))}</b><table>{row(HEAD, 'th')}{body}</table>"
        f"<ul>{notes}</ul></div>"
    )


def _title(made: Estimate) -> str:
    time = made["time"]
    return f"Estimate of {made.name}: {len(made)} rows, {time[-1] - time[0]:.6g} s"


def _rows(made: Estimate) -> list[tuple[str, ...]]:
    found = []
    for name, data in made.columns.items():
        if name in ("time", "contact", "status"):
            continue
        good = data[np.isfinite(data)]
        sizes = (good.mean(), good.min(), good.max()) if good.size else (np.nan,) * 3
        empty = len(data) - good.size
        found.append((name, COLUMNS[name], *(short(float(s), 4) for s in sizes), str(empty)))
    return found


def _padded(row: Sequence[str], wide: Sequence[int]) -> list[str]:
    return [
        f"{c:<{w}}" if k < 2 else f"{c:>{w}}"
        for k, (c, w) in enumerate(zip(row, wide, strict=True))
    ]


def _sentences(made: Estimate) -> list[str]:
    """Contacts, what is flagged and in how many rows, then the notes."""
    said = []
    if "contact" in made:
        said.append(_contacts(made))
    status = made.status
    for bit, meaning in MEANING.items():
        rows = int(np.count_nonzero(status & int(bit)))
        if rows:
            said.append(f"status {int(bit)} in {rows} of {len(made)} rows: {meaning}")
    return [*said, *made.notes]


def _contacts(made: Estimate) -> str:
    found = made.contacts
    if not found:
        return "no contact"
    first = ", ".join(f"{start:.4g}–{end:.4g} s" for start, end in found[:MOST_CONTACTS])
    more = f" and {len(found) - MOST_CONTACTS} more" if len(found) > MOST_CONTACTS else ""
    return f"{len(found)} contact{'s' if len(found) > 1 else ''}: {first}{more}"
