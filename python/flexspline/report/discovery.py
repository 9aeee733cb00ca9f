"""A discovery as text and as HTML: what was missing, why, and by how much the gap shrank."""

from __future__ import annotations

import os
import textwrap
from typing import TYPE_CHECKING, Any

from flexspline.about import __version__
from flexspline.errors import listed
from flexspline.files import atomic_write
from flexspline.formatting.numbers import plus_minus, short
from flexspline.report.content import known_groups, parameter_lines
from flexspline.report.discovery_content import (
    best_rivals,
    channel_rows,
    discovery_call,
    effect_lines,
    estimator_sentence,
    faults_told,
    headlines,
    remarks,
    searched_sentence,
    shrunk_tables,
    verdict,
)
from flexspline.report.facts import log_facts, model_facts
from flexspline.report.html import templates
from flexspline.report.verdict import TARGET_WORDS

if TYPE_CHECKING:
    from flexspline.discovery.result import Discovery, Found

__all__ = ["discovery_html", "discovery_text", "write_discovery_report"]

WIDTH = 100
MAP = (
    "RMS of measured less predicted on folds that no fit saw (dark; blue: the extended model) in "
    "each band against the noise floor there (grey, with two standard errors). What lies between "
    "is the excess, coloured, and a dot marks an excess that is more than chance. All panels have "
    "the same scale; what the gap follows comes first. Hatched: fewer than 2 % of the rows; an "
    "arrow: the extended model's RMS where it is above the axes."
)
PLAN = (
    "What to command over time, as next_experiment.csv holds it, and how far apart the rivals are "
    "expected to stand after this run if the named one is right, beside now and the best run of "
    "each simple kind."
)


def discovery_text(made: Discovery) -> str:
    """Return what `print(discovery)` shows."""
    blocks = [_wrapped(verdict(made))]
    for title, sentences in faults_told(made):
        blocks.append("\n".join([f"{title}:", *(_wrapped(said, "- ") for said in sentences)]))
    blocks += [_one(made, number, one) for number, one in enumerate(made.found, 1)]
    blocks += [_wrapped(sentence) for sentence in remarks(made)]
    return "\n\n".join(blocks)


def discovery_html(made: Discovery) -> str:
    """Return a discovery as a fragment of HTML without scripts, for notebooks."""
    return templates().get_template("discovery_fragment.html").render(_common(made))


def write_discovery_report(made: Discovery, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.comparison import plot_comparison
    from flexspline.plot.discovery import panels
    from flexspline.report.figures import ReportFigure, drawn, inline_svg

    where = made.disagreement
    chart = plot_comparison(where.before, where.after if made.found else None)
    page = (
        templates()
        .get_template("discovery.html")
        .render(
            _common(made),
            title=str(made.model.facts.get("joint", f"What the {TARGET_WORDS[made.target]} lacks")),
            places=where.before.sentences,
            map=ReportFigure(inline_svg(chart, "map of the disagreement"), MAP),
            figures=[drawn(panel) for panel in panels(made)],
            plan=None
            if made.plan is None
            else ReportFigure(inline_svg(made.plan.plot(), "run to record next"), PLAN),
            tables=shrunk_tables(made),
            channels=channel_rows(made),
            delay="",
            searched=searched_sentence(made),
            estimator=estimator_sentence(made),
            lines=parameter_lines(made.fit),
            groups=known_groups(made.fit),
            logs=log_facts(made.fit),
            facts=model_facts(made.fit),
            call=discovery_call(made),
        )
    )
    atomic_write(path, page)


def _common(made: Discovery) -> dict[str, Any]:
    """What the fragment shows, and the report too."""
    return {
        "made": made,
        "verdict": verdict(made),
        "remarks": remarks(made),
        "faults": faults_told(made),
        "headlines": headlines(made),
        "found": [
            {
                "one": one,
                "confidence": f"{100.0 * one.confidence:.0f} %",
                "before": short(one.rmse_before),
                "after": short(one.rmse_after),
                "lines": effect_lines(made, one),
                "rivals": best_rivals(made, one),
            }
            for one in made.found
        ],
        "grave": bool(made.unexplained or any(fault.grave for fault in made.data_faults)),
        "version": __version__,
    }


def _one(made: Discovery, number: int, one: Found) -> str:
    lines = [f"{number}. {one.effect}   confidence {100.0 * one.confidence:.0f} %   {one.where}"]
    for p in made.parameters(one.effect):
        name = p.name.split(".", 1)[-1]
        lines.append(f"   {name:<24} {plus_minus(p.value, p.standard_error)} {p.unit}".rstrip())
    lines.append(_wrapped(one.evidence, "   "))
    if one.indistinguishable_from:
        also = listed(one.indistinguishable_from)
        lines.append(_wrapped(f"These runs would be explained as well by {also}.", "   "))
    return "\n".join(lines)


def _wrapped(sentence: str, first: str = "") -> str:
    return "\n".join(
        textwrap.wrap(
            sentence, WIDTH, initial_indent=first, subsequent_indent=" " * len(first),
            break_long_words=False, break_on_hyphens=False,
        )
    )  # fmt: skip
