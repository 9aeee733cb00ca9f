"""A discovery as text and as HTML: what was missing, why, and by how much the gap shrank."""

from __future__ import annotations

import os
import textwrap
from typing import TYPE_CHECKING, Any

from flexspline import __version__
from flexspline.errors import listed
from flexspline.files import atomic_write
from flexspline.report.numbers import plus_minus, short
from flexspline.report.verdict import TARGET_WORDS

if TYPE_CHECKING:
    from flexspline.discovery.result import Discovery, Found

__all__ = ["discovery_html", "discovery_text", "write_discovery_report"]

WIDTH = 100


def discovery_text(made: Discovery) -> str:
    """Return what `print(discovery)` shows."""
    blocks = [_wrapped(verdict(made))]
    if made.data_faults:
        faults = [_wrapped(f.sentence, "- ") for f in made.data_faults]
        blocks.append("\n".join(["Faults of the data, to be mended first:", *faults]))
    blocks += [_one(made, number, one) for number, one in enumerate(made.found, 1)]
    blocks += [_wrapped(sentence) for sentence in remarks(made)]
    return "\n\n".join(blocks)


def verdict(made: Discovery) -> str:
    """Return what was found, and by how much the gap shrank, in a sentence or two."""
    what = TARGET_WORDS[made.target]
    where = f"on {made.validated_by} that no fit saw"
    rmse = f"{short(made.base_rmse)} to {short(made.final_rmse)} {made.unit}"
    if made.found:
        names = listed(made.names, most=len(made.names))
        floor = f"noise floor {short(made.noise_floor)} {made.unit}"
        return f"The model of the {what} lacks {names}: RMSE {rmse} {where}, {floor}."
    if made.unexplained:
        return (
            f"No effect that is known explains what the model of the {what} lacks: RMSE "
            f"{short(made.base_rmse)} {made.unit} {where}."
        )
    return (
        f"Nothing is missing in the model of the {what} that these runs show: RMSE "
        f"{short(made.base_rmse)} {made.unit} {where}, which is noise."
    )


def remarks(made: Discovery) -> list[str]:
    """Return what else has to be said: what is unexplained, what to record, what was not tried."""
    said = []
    if made.unexplained:
        share = 100.0 * made.unexplained.share_of_variance
        on = listed(made.unexplained.depends_on)
        said.append(
            f"Unexplained: {share:.0f} % of the gap above the noise floor (mean square) depends on "
            f"{on}, in a way that no effect of the catalogue has."
        )
    if made.doubted:
        said.append(
            f"{listed(made.doubted)} would explain a part of it, but only stands in for this."
        )
    if made.next_experiment:
        said.append(f"Next: {made.next_experiment}")
    if made.not_tried:
        said.append(f"Not tried, for lack of channels or facts: {listed(made.not_tried, most=40)}.")
    return said


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


def discovery_html(made: Discovery) -> str:
    """Return a discovery as a fragment of HTML without scripts, for notebooks."""
    return _rendered(made, "discovery_fragment.html")


def write_discovery_report(made: Discovery, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    atomic_write(path, _rendered(made, "discovery.html"))


def _rendered(made: Discovery, template: str) -> str:
    from flexspline.report.html import templates

    found: list[dict[str, Any]] = [
        {
            "one": one,
            "confidence": f"{100.0 * one.confidence:.0f} %",
            "before": short(one.rmse_before),
            "after": short(one.rmse_after),
            "parameters": [
                (p.name, plus_minus(p.value, p.standard_error), p.unit)
                for p in made.parameters(one.effect)
            ],
        }
        for one in made.found
    ]
    return (
        templates()
        .get_template(template)
        .render(
            made=made,
            found=found,
            verdict=verdict(made),
            remarks=remarks(made),
            rmse=[short(v) for v in (made.base_rmse, made.final_rmse, made.noise_floor)],
            title=str(made.model.facts.get("joint", f"What the {TARGET_WORDS[made.target]} lacks")),
            version=__version__,
        )
    )
