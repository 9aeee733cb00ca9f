"""A comparison as text and HTML: two sentences, the worst bands, the map, and all numbers."""

from __future__ import annotations

import math
import os
import textwrap
from typing import TYPE_CHECKING, Any

from flexspline.about import __version__
from flexspline.comparison.result import floor_sentence, ranked
from flexspline.files import atomic_write
from flexspline.formatting.numbers import short
from flexspline.report.comparison_content import (
    band_tables,
    base_told,
    followed,
    order_rows,
    worst_rows,
)
from flexspline.report.html import templates
from flexspline.report.inputs import input_rows, smoothed_rows

if TYPE_CHECKING:
    from flexspline.comparison.result import Comparison

__all__ = ["comparison_html", "comparison_text", "write_comparison_report"]

WIDTH = 100


def comparison_text(made: Comparison) -> str:
    """Return what `print(comparison)` shows, lines of at most 120 characters."""
    blocks = [
        [line for sentence in made.sentences for line in _wrapped(sentence)],
        [line for sentence in base_told(made) for line in _wrapped(sentence)],
        _table(worst_rows(made)),
        [x for k, said in enumerate(followed(made), start=1) for x in _wrapped(f"{k}. {said}")],
        _table(order_rows(made)) if made.orders else [],
        _wrapped(floor_sentence(made)),
        _channels(made),
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block)


def _channels(made: Comparison) -> list[str]:
    """Noisy channels as the model read them; nothing of exact runs."""
    read = [way.channel for way in made.preparations]
    rows = smoothed_rows(made.inputs, made.preparations, read)
    return ["Noisy channels:", *_table(rows)] if rows else []


def comparison_html(made: Comparison) -> str:
    """Return a comparison as a fragment of HTML without scripts, for notebooks."""
    return templates().get_template("comparison_fragment.html").render(_common(made))


def write_comparison_report(made: Comparison, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.comparison import panels, plot_comparison, plot_orders
    from flexspline.report.figures import ReportFigure, inline_svg

    charts = [ReportFigure(inline_svg(plot_comparison(made), "map of the disagreement"), MAP)]
    if made.spectrum is not None:
        charts.append(ReportFigure(inline_svg(plot_orders(made), "orders of the residual"), ORDERS))
    page = (
        templates()
        .get_template("comparison.html")
        .render(
            _common(made),
            title=str(made.facts.get("joint", "Model and measurement compared")),
            map=charts[0],
            spectra=charts[1:],
            panels=len(panels(made)),
            tables=band_tables(made),
            channels=input_rows(made.inputs, made.preparations),
            delay="",
            logs=_logs(made),
            call=_call(made),
        )
    )
    atomic_write(path, page)


MAP = (
    "RMS of measured less modelled (dark) in each band against the noise floor there (grey, with "
    "two standard errors); what lies between is the excess, coloured, and a dot marks an excess "
    "that is more than chance. All panels have the same scale; what the gap follows comes first. "
    "Hatched: fewer than 2 % of the rows."
)
ORDERS = (
    "Amplitude of the residual over the orders of each pair of parts. Marks are orders that stand "
    "out of the noise of their own stretches, with two standard errors; noise alone marks one in a "
    "hundred searches. Slow or short runs make lines wide."
)


def _common(made: Comparison) -> dict[str, Any]:
    return {
        "sentences": made.sentences,
        "grave": bool(made.follows),
        "worst": worst_rows(made),
        "followed": followed(made),
        "orders": order_rows(made) if made.orders else [],
        "floor": floor_sentence(made),
        "notes": base_told(made),
        "load": made.load_source,
        "kind": _kind(made),
        "what": made.what.replace("_", " "),
        "unit": made.unit,
        "names": ranked(made),
        "version": __version__,
    }


def _kind(made: Comparison) -> str:
    if made.foreign:
        return "a foreign simulation"
    return "forward simulation" if made.simulated else "prediction"


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    wide = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(
            f"{cell:<{w}}" if k < 2 else f"{cell:>{w}}"
            for k, (cell, w) in enumerate(zip(row, wide, strict=True))
        ).rstrip()
        for row in rows
    ]


def _wrapped(sentence: str) -> list[str]:
    return textwrap.wrap(sentence, WIDTH, break_long_words=False, break_on_hyphens=False)


def _logs(made: Comparison) -> list[dict[str, Any]]:
    return [
        {
            "name": run.log.name,
            "rows": f"{len(run.log)} rows, {short(run.log.duration, 4)} s at "
            f"{short(run.log.rate, 4)} Hz",
            "path": run.log.source.path if run.log.source else "not from a file",
            "sha256": run.log.source.sha256 if run.log.source else "",
            "history": list(run.log.history),
        }
        for run in made.runs
    ]


def _call(made: Comparison) -> str:
    foreign = bool(made.foreign)
    given = ["None" if foreign else "model", "logs"]
    if not made.simulated:
        given.append(f"target={made.what!r}")
    if foreign and "the runs" not in made.foreign:
        given.append("simulation=simulation")
    if foreign:
        given.append("simulated_motion=True" if made.simulated else "simulated_torque=column")
    if made.lowpass is not None:
        given.append(f"lowpass={made.lowpass!r}")
    if made.bandwidth is not None:
        told = f"{made.bandwidth!r}" if math.isfinite(made.bandwidth) else "float('inf')"
        given.append(f"bandwidth={told}")
    if made.simulated and not foreign:
        given.append("simulated=True")
    return f"comparison = flexspline.compare({', '.join(given)})"
