"""Claims beside ours, as a table, as text and as a page."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from flexspline.about import __version__

if TYPE_CHECKING:
    import pandas

    from flexspline.reproduce.claims import Verdict
    from flexspline.reproduce.run import Reproduction

__all__ = ["claims_html", "claims_table", "claims_text", "report_page"]

WORDS = {True: "holds", False: "does not hold", None: "not decided"}


def claims_table(made: Reproduction) -> pandas.DataFrame:
    """Return a row for each claim: published, ours (median and 90 % range), verdict."""
    import pandas

    rows = [
        {
            "claim": verdict.claim.claim,
            "source": verdict.claim.source,
            "published": _published(verdict),
            "ours": _ours(verdict),
            "unit": verdict.claim.unit,
            "criterion": _criterion(verdict),
            "verdict": WORDS[verdict.holds],
        }
        for verdict in made.verdicts
    ]
    return pandas.DataFrame(rows, index=[verdict.claim.id for verdict in made.verdicts])


def claims_text(made: Reproduction) -> str:
    """Return the claims of a paper, three lines each at most."""
    counts = [
        f"{sum(v.holds is answer for v in made.verdicts)} {word}" for answer, word in WORDS.items()
    ]
    lines = [f"{made.paper}: {', '.join(counts)}; {made.draws} draws, seed {made.seed}", ""]
    for verdict in made.verdicts:
        claim = verdict.claim
        lines.append(f"{WORDS[verdict.holds]:<13}  {claim.claim} [{claim.source}]")
        if claim.quantity:
            lines.append(
                f"{'':<15}{claim.quantity}: published {_published(verdict)}, "
                f"ours {_ours(verdict)} {claim.unit}; {_criterion(verdict)}"
            )
        else:
            lines.append(f"{'':<15}{_criterion(verdict)}")
    return "\n".join(lines)


def claims_html(made: Reproduction) -> str:
    """Return the claims as a fragment of HTML."""
    import pandas

    with pandas.option_context("display.max_colwidth", None):
        table = claims_table(made).to_html(index=False, border=0)
    return f"<p>{made.draws} draws, seed {made.seed}</p>\n{table}"


def report_page(made: Mapping[str, Reproduction]) -> str:
    """Return a page with every figure, table and claim; figures lie inside it."""
    body = "\n".join(part for reproduction in made.values() for part in _chapter(reproduction))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        "<title>Three papers, done again</title>\n<style>\n"
        "body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; "
        "padding: 0 1rem; color: #26282b; background: #fff; }\n"
        "table { border-collapse: collapse; font-size: 0.8rem; }\n"
        "td, th { padding: 0.25rem 0.5rem; text-align: left; vertical-align: top; "
        "border-bottom: 1px solid #ddd; }\n"
        "figure { margin: 1.5rem 0; } figcaption { color: #555; font-size: 0.9rem; }\n"
        "svg { max-width: 100%; height: auto; }\n</style></head><body>\n"
        f"{body}\n<p>flexspline {__version__}</p>\n</body></html>\n"
    )


def _chapter(made: Reproduction) -> Iterator[str]:
    from flexspline.report.html import inline_svg

    yield f"<h1>{html.escape(made.paper)}</h1>"
    yield claims_html(made)
    for name, figure in made.story.figures.items():
        caption = html.escape(made.story.captions.get(name, ""))
        yield f"<figure>{inline_svg(figure, f'{made.paper} {name}')}"
        yield f"<figcaption><b>{html.escape(name)}</b> {caption}</figcaption></figure>"
    for name, table in made.story.tables.items():
        yield f"<h2>{html.escape(name)}</h2>"
        yield f"<p>{html.escape(made.story.captions.get(name, ''))}</p>"
        yield table.to_html(border=0, float_format=lambda value: f"{value:.4g}")


def _published(verdict: Verdict) -> str:
    value = verdict.claim.published
    return "not printed" if value is None else f"{value:g}"


def _ours(verdict: Verdict) -> str:
    good = verdict.values[np.isfinite(verdict.values)]
    if not good.size:
        return "–"
    low, median, high = np.percentile(good, [5, 50, 95])
    if good.size == 1 or low == high:
        return f"{median:.3g}"
    return f"{median:.3g} ({low:.3g} … {high:.3g})"


def _criterion(verdict: Verdict) -> str:
    rule = verdict.claim.criterion
    if rule["kind"] == "undecidable":
        return str(rule["reason"])
    if rule["kind"] == "near":
        expected = rule.get("expected", verdict.claim.published)
        wanted = f"{expected:g} ± {rule['tolerance']:g}"
    else:
        wanted = f"{'≤' if rule['kind'] == 'at_most' else '≥'} {rule['bound']:g}"
    return f"{wanted} in {100 * rule.get('share', 1.0):.0f} % of draws"
