"""Numbers and tables as text, for all modules that write sentences.

A value and its error are rounded together. The first row of a table is its head.
"""

from __future__ import annotations

import html
import math
import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Sequence
from decimal import Decimal
from typing import Any, TypeVar

from flexspline.errors import printable

__all__ = [
    "Page",
    "apart",
    "blocks_text",
    "decimals_for",
    "documented",
    "lowered",
    "padded",
    "percent",
    "plus_minus",
    "rows_html",
    "rows_text",
    "scores_html",
    "sentences_text",
    "short",
    "short_names",
    "span",
    "table_html",
    "told_apart",
    "truncated",
]

INDENT = "    "  # of a function's docstring
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
FINEST = 1e-6  # an error below this part of its value is shown as "below"


class Page(str):
    """A text of several lines that a prompt and a notebook's cell show as it reads."""

    __slots__ = ()
    __repr__ = str.__str__


def plus_minus(value: float, error: float) -> str:
    """Return "0.302 ± 0.002", rounded by the rule of the Particle Data Group.

    A large or small one becomes "(1.23 ± 0.04)·10⁻⁵". Without a finite error the value stands
    alone, to four digits.
    """
    if not (math.isfinite(value) and math.isfinite(error)):
        return short(value, 4)
    if error <= FINEST * abs(value):
        return f"{value:.6g} ± {error:.0e}" if error > 0.0 else f"{value:.6g} ± 0"
    from uncertainties import ufloat  # takes long to import, and few calls write errors

    text = f"{ufloat(value, error):P}".replace("±", " ± ").replace("×", "·")
    text = re.sub(r"^(\(?)-(0(\.0+)?) ± ", r"\1\2 ± ", text)
    zero = re.fullmatch(r"\(0(?:\.0+)? ± ([\d.]+)\)·10([¹²³])", text)  # 0·10¹ is no number
    return f"0 ± {float(zero[1]) * 10 ** ('¹²³'.index(zero[2]) + 1):.0f}" if zero else text


def span(low: float, high: float, error: float) -> str:
    """Return "0.298 to 0.306", ends of an interval rounded as `plus_minus` rounds a value.

    Both have the decimals and the power of ten of the larger one beside `error`; six digits, or as
    many as tell them apart, where that shows too little.
    """
    top = max(low, high, key=abs)
    if not error > FINEST * abs(top):
        return " to ".join(told_apart([low, high], 6))
    text, _ = apart(plus_minus(top, error))
    mantissa, ten, power = text.partition("·10")
    decimals = len(mantissa.partition(".")[2])
    places = int(power.translate(SUPERSCRIPTS) or 0)
    shown = (round(Decimal(end).scaleb(-places), decimals) + 0 for end in (low, high))  # no −0.00
    return " to ".join(f"{end:.{decimals}f}{ten}{power}" for end in shown)


def apart(text: str) -> tuple[str, str]:
    """Return value and error of what `plus_minus` wrote, each by itself; "–" without an error."""
    whole = re.fullmatch(r"\((.+) ± (.+)\)(.*)", text)
    if whole:
        return whole[1] + whole[3], whole[2] + whole[3]
    value, _, error = text.partition(" ± ")
    return value, error or "–"


def short(value: float, digits: int = 3) -> str:
    """Return a value to so many digits, "–" where there is none."""
    return f"{value:.{digits}g}" if math.isfinite(value) else "–"


def told_apart(values: Sequence[float], digits: int = 3) -> list[str]:
    """Return values to so many digits, or to as many more as tell the finite ones apart."""
    finite = {value for value in values if math.isfinite(value)}
    while digits < 17 and len({short(value, digits) for value in finite}) < len(finite):
        digits += 1
    return [short(value, digits) for value in values]


def padded(value: float, digits: int = 3) -> str:
    """Return a value to so many digits, zeros at its end too: 0.0160 as well as 0.0848."""
    return f"{value:#.{digits}g}".removesuffix(".") if math.isfinite(value) else "–"


def lowered(before: float, after: float) -> tuple[str, str]:
    """Return an error and what it falls to, `padded` to as many digits as tell them apart."""
    told = [(padded(before, digits), padded(after, digits)) for digits in range(3, 7)]
    return next((both for both in told if len({*both}) > 1), told[0])


def percent(share: float) -> str:
    """Return a share in whole per cent, such as "57 %", never "-0 %"."""
    return f"{round(100.0 * share) + 0.0:.0f} %" if math.isfinite(share) else "–"


def decimals_for(size: float) -> int:
    """Return the decimals that show three digits of a number of this size."""
    if not (math.isfinite(size) and size > 0.0):
        return 3
    return max(0, 2 - math.floor(math.log10(size)))


def truncated(share: float, decimals: int = 3) -> str:
    """Return a share cut off, not rounded, so that 0.9998 does not read as all."""
    if not math.isfinite(share):
        return "–"
    scale = 10**decimals
    return f"{math.floor(share * scale) / scale:.{decimals}f}"


def short_names(text: str) -> str:
    """Write "offset.offset" as "offset": an effect whose only term is called as it is.

    A number, 3.3, stays.
    """
    return re.sub(r"\b([a-z]\w*)\.\1\b", r"\1", text)


def rows_text(rows: Sequence[Sequence[str]], left: Collection[int] = (0,)) -> str:
    """Return aligned lines; the columns `left` stand to the left, the others to the right."""
    rows = [[printable(cell) for cell in row] for row in rows]
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


def scores_html(rows: Sequence[Sequence[str]], *, caption: str = "", note: str = "") -> str:
    """Return a table in the style of those of scores, with what is said above and below it."""
    above = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    below = f"<p>{html.escape(note)}</p>" if note else ""
    return f'<table class="scores">{above}{rows_html(rows)}</table>{below}'


def blocks_text(blocks: Iterable[Sequence[str]]) -> str:
    """Return blocks of lines, an empty line between two; a block without lines vanishes."""
    return "\n\n".join("\n".join(block) for block in blocks if block)


def sentences_text(sentences: Iterable[str], width: int = 100) -> list[str]:
    """Return sentences as a list of points, each wrapped."""
    return [
        textwrap.fill(printable(sentence), width, initial_indent="- ", subsequent_indent="  ")
        for sentence in sentences
    ]


def table_html(title: str, rows: Sequence[Sequence[str]], sentences: Iterable[str]) -> str:
    """Return a fragment for notebooks light and dark: a title, a table, and what is to be said."""
    notes = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in sentences)
    return f"<div><b>{html.escape(title)}</b><table>{rows_html(rows)}</table><ul>{notes}</ul></div>"


Documented = TypeVar("Documented", bound=Callable[..., Any])


def documented(rows: Iterable[tuple[str, str]]) -> Callable[[Documented], Documented]:
    """Put a list of names and what is said of them in the place of ``{formats}`` in a docstring."""
    lines = "\n".join(
        textwrap.fill(
            f"- {name}: {said}", initial_indent=INDENT, subsequent_indent=f"{INDENT}  ", width=100
        )
        for name, said in rows
    )

    def fill(function: Documented) -> Documented:
        if function.__doc__:  # not with python -OO
            function.__doc__ = function.__doc__.replace(f"{INDENT}{{formats}}", lines)
        return function

    return fill
