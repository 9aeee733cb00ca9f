"""A certificate in words: the verdict, each output, what a step costs."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from flexspline.formatting import short

if TYPE_CHECKING:
    from flexspline.certification.result import Certificate

__all__ = ["certificate_html", "certificate_text"]

WIDTH = 100
HEAD = ("output", "unit", "samples", "other bits", "largest ULP", "largest", "float costs", "RMS")


def certificate_text(made: Certificate) -> str:
    """Return what `print(certificate)` shows."""
    rows = [HEAD, *_rows(made)]
    wide = [max(len(row[k]) for row in rows) for k in range(len(HEAD))]
    table = [
        "  ".join(
            f"{c:<{w}}" if k < 2 else f"{c:>{w}}"
            for k, (c, w) in enumerate(zip(row, wide, strict=True))
        ).rstrip()
        for row in rows
    ]
    said = [
        textwrap.fill(sentence, WIDTH, initial_indent="- ", subsequent_indent="  ")
        for sentence in _sentences(made)
    ]
    return "\n".join([*textwrap.wrap(_verdict(made), WIDTH), "", *table, "", *said])


def certificate_html(made: Certificate) -> str:
    """Return the same as a fragment of HTML, for notebooks light and dark."""

    def row(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    body = "".join(row(cells, "td") for cells in _rows(made))
    notes = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in _sentences(made))
    return (
        f"<div><b>{html.escape(_verdict(made))}</b><table>{row(HEAD, 'th')}{body}</table>"
        f"<ul>{notes}</ul></div>"
    )


def _verdict(made: Certificate) -> str:
    what = "the estimators" if made.certified == "estimators" else f"the model of {made.certified}"
    where = made.device if made.machine is None else f"{made.device} (QEMU {made.machine})"
    if made.bit_identical:
        return f"{where} computes {what} with the host's bits in all {made.samples} samples."
    worst = made.largest_difference
    apart = "flags or verdicts differ"
    if worst.largest_ulp > 0:
        size = f"{worst.largest_ulp} ULP, {short(worst.largest, 3)} {worst.unit}"
        apart = f"{worst.name} differs by up to {size}"
    return (
        f"{where} does NOT compute {what} with the host's bits: {apart}; compile with "
        "-ffp-contract=off and without -ffast-math."
    )


def _rows(made: Certificate) -> list[tuple[str, ...]]:
    return [
        (
            output.name,
            output.unit,
            str(output.samples),
            str(output.different),
            str(output.largest_ulp),
            *(short(v, 3) for v in (output.largest, output.quantisation, output.quantisation_rms)),
        )
        for output in made.outputs
    ]


def _sentences(made: Certificate) -> list[str]:
    cost, costly = made.cost, made.quantisation
    said = [
        f"float instead of double, readings rounded too, costs {costly.name} at most "
        f"{short(costly.quantisation, 3)} {costly.unit}, {short(costly.quantisation_rms, 3)} RMS"
    ]
    if cost.instructions_per_step is not None:
        most = "" if cost.most_instructions is None else f", at most {cost.most_instructions}"
        count = f"{cost.instructions_per_step:.0f}"
        said.append(f"{count} instructions per step{most} ({cost.instructions_by})")
    if cost.cycles_per_step is not None:
        said.append(f"about {cost.cycles_per_step:.0f} cycles per step ({cost.cycles_by})")
    sizes = {"code": cost.code_bytes, "flash": cost.flash_bytes, "RAM": cost.ram_bytes}
    sizes["stack"] = cost.stack_bytes
    known = [f"{name} {size} bytes" for name, size in sizes.items() if size is not None]
    if known:
        said.append(f"{', '.join(known)} (stack: {cost.stack_by})")
    if cost.calls:
        said.append(f"calls of the compiler's libraries: {', '.join(cost.calls)}")
    if made.refused:
        said.append(f"{made.refused} of {made.samples} samples were refused by the step")
    options = " ".join(made.options)
    said.append(f"{made.processor}; {made.compiler} {options}")
    return [*said, *made.notes]
