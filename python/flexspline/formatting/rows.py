"""Rows of words as a table, in text and in HTML; the first row is the head."""

from __future__ import annotations

import html
from collections.abc import Collection, Sequence

__all__ = ["rows_html", "rows_text"]


def rows_text(rows: Sequence[Sequence[str]], left: Collection[int] = (0,)) -> str:
    """Return aligned lines; the columns `left` stand to the left, the others to the right."""
    wide = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join(
        "  ".join(
            f"{cell:<{w}}" if k in left else f"{cell:>{w}}"
            for k, (cell, w) in enumerate(zip(row, wide, strict=True))
        ).rstrip()
        for row in rows
    )


def rows_html(rows: Sequence[Sequence[str]]) -> str:
    """Return the `<tr>` of all rows."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    head, *body = rows
    return line(head, "th") + "".join(line(cells, "td") for cells in body)
