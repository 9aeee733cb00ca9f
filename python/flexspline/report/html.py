"""A fit as HTML: a small table for notebooks, and a report in one file that needs no network."""

from __future__ import annotations

import os
import re
from functools import cache
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from flexspline.about import __version__
from flexspline.files import atomic_write
from flexspline.formatting.numbers import short
from flexspline.least_squares.result import shares
from flexspline.report.content import known_groups, parameter_lines
from flexspline.report.facts import log_facts, model_facts, python_call
from flexspline.report.inputs import delay_sentence, input_rows
from flexspline.report.tables import grouped_scores, score_rows
from flexspline.report.verdict import TARGET_WORDS, trust, validation_sentence, verdict

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["fit_html", "templates", "write_report"]


def fit_html(fit: Fit) -> str:
    """Return a fit as a fragment of HTML without scripts, for notebooks light and dark."""
    return (
        templates()
        .get_template("fit.html")
        .render(_common(fit), scores=score_rows(fit.scores, fit.unit))
    )


def write_report(fit: Fit, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.report.figures import report_figures  # matplotlib only where it draws

    made = shares(fit)
    largest = max(made.values(), default=1.0) or 1.0
    page = (
        templates()
        .get_template("report.html")
        .render(
            _common(fit),
            title=str(fit.model.facts.get("joint", f"Fit of {TARGET_WORDS[fit.target]}")),
            scores=grouped_scores(fit.scores),
            figures=report_figures(fit),
            shares=[(name, short(size), 100.0 * size / largest) for name, size in made.items()],
            orders="" if fit.orders is None else str(fit.orders),
            channels=input_rows(fit.inputs, fit.part.preparations),
            delay=delay_sentence(fit.delay, fit.unit),
            logs=log_facts(fit),
            facts=model_facts(fit),
            call=python_call(fit),
        )
    )
    atomic_write(path, page)


def _common(fit: Fit) -> dict[str, Any]:
    return {
        "verdict": verdict(fit),
        "lines": parameter_lines(fit),
        "groups": known_groups(fit),
        "trust": trust(fit)[:-1],
        "held": validation_sentence(fit),
        "motion": None if fit.simulation is None else fit.simulation.table(),
        "starts": None if fit.simulation is None else fit.simulation.ends,
        "reliable": fit.simulation is not None or fit.uncertainty.reliable,
        "warnings": [w for w in fit.warnings if w != fit.uncertainty.statement],
        "what": TARGET_WORDS[fit.target],
        "unit": fit.unit,
        "version": __version__,
    }


@cache
def templates() -> Environment:
    """Return the package's HTML templates, which know how a minus sign is printed."""
    made = Environment(
        loader=PackageLoader("flexspline.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["minus"] = lambda text: re.sub(r"(?<![\w.])-(?=\d)", "−", text)
    return made
