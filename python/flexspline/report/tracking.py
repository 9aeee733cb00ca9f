"""A track as text and HTML: what to decide, what changed, what comes, and every parameter."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from flexspline.errors import printable
from flexspline.formatting import plus_minus, rows_text, short, table_html
from flexspline.plot.canvas import own_style
from flexspline.report.html import drawn, write_html
from flexspline.report.text import wrapped
from flexspline.tracking.result import day, spoken

if TYPE_CHECKING:
    from flexspline.tracking.result import Track

__all__ = ["track_html", "track_text", "write_track_report"]

Row = tuple[str, ...]


def track_text(made: Track) -> str:
    """Return what `print(track)` shows."""
    said = [line for sentence in made.sentences for line in wrapped(sentence, "- ", "  ")]
    notes = [line for sentence in made.remarks for line in wrapped(sentence, "- ", "  ")]
    table = [row[:-1] for row in parameter_rows(made)]  # a line of a terminal has less room
    blocks = [wrapped(made.verdict), said, [rows_text(table, (0, 1)), *made.levels], notes]
    return "\n\n".join("\n".join(printable(line) if k != 2 else line for line in block)
                       for k, block in enumerate(blocks) if block)  # fmt: skip


def track_html(made: Track) -> str:
    """Return a track as a fragment of HTML without scripts, for notebooks."""
    said = [*made.sentences, *made.levels, *made.remarks]
    return table_html(made.verdict, parameter_rows(made), said)


@own_style()
def write_track_report(made: Track, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.tracking import LOOK, panels

    write_html(
        path,
        "track.html",
        title=made.history.joint or "One joint over time",
        verdict=made.verdict,
        critical=bool(made.changes),
        sentences=made.sentences,
        parameters=parameter_rows(made),
        levels=made.levels,
        figures=[drawn(panel) for panel in panels(made)],
        look=LOOK,
        remarks=made.remarks,
        sessions=session_rows(made),
    )


def parameter_rows(made: Track) -> list[Row]:
    """Return heading and a row for each parameter."""
    rows: list[Row] = [("parameter", "", "unit", "at first", "now", "per K", "between sessions")]
    for p in made.parameters:
        rows.append(
            (
                spoken(p.name),
                p.state,
                "" if p.unit == "1" else p.unit,
                _value(*p.at_first),
                _value(*p.now),
                _value(*p.by_temperature),
                short(p.between_sessions, 2),
            )
        )
    return rows


def _value(value: float, error: float) -> str:
    return plus_minus(value, error) if np.isfinite(value) else "–"


def session_rows(made: Track) -> list[Row]:
    """Return heading and a row for each session."""
    history = made.history
    rows: list[Row] = [("session", "date", "temperature [°C]", "parameters told")]
    for label, date, warm, values in zip(
        history.labels, history.dates, history.temperatures, history.values, strict=True
    ):
        when: Any = date.astype("M8[s]").astype(object)
        told = f"{int(np.isfinite(values).sum())} of {len(values)}"
        rows.append((label, day(when), short(float(warm), 3), told))
    return rows
