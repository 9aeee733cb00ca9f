"""A fit as text: a verdict, a line for each parameter, and what is wrong with it in words."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from flexspline.report.content import ParameterLine, known_groups, parameter_lines
from flexspline.report.inputs import delay_sentence, smoothed_rows
from flexspline.report.tables import score_rows
from flexspline.report.verdict import TARGET_WORDS, trust, verdict

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["fit_text"]

WIDTH = 100
WIDEST = 120  # of the table of parameters


def fit_text(fit: Fit) -> str:
    """Return what `print(fit)` shows, lines of at most 120 characters where names allow it."""
    judged = verdict(fit)
    blocks = [
        [*_wrapped(judged.good), *_wrapped(judged.wrong)],
        _parameters(parameter_lines(fit)),
        _known(fit),
        _trust(fit),
        _channels(fit),
        _motion(fit),
        _scores(fit),
        _warnings(fit),
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block)


def _wrapped(sentence: str, first: str = "", rest: str = "") -> list[str]:
    return textwrap.wrap(
        sentence,
        WIDTH,
        initial_indent=first,
        subsequent_indent=rest or " " * len(first),
        break_long_words=False,
        break_on_hyphens=False,
    )


def _parameters(lines: Sequence[ParameterLine]) -> list[str]:
    if not lines:
        return ["No parameters: nothing was fitted."]
    names = [("  " if _in_group(lines, k) else "") + line.name for k, line in enumerate(lines)]
    wide = [max(map(len, [*names, "parameter"]))]
    wide += [max(len(line.value) for line in lines), max(len(line.unit) for line in lines)]
    head = f"{'parameter':<{wide[0]}}  {'value ± standard error':<{wide[1]}}"
    wide[1] = max(wide[1], len("value ± standard error"))
    text = [f"{head}  {'unit':<{wide[2]}}".rstrip()]
    for name, line in zip(names, lines, strict=True):
        if line.heading:
            text += _wrapped(line.heading)
        row = f"{name:<{wide[0]}}  {line.value:<{wide[1]}}  {line.unit:<{wide[2]}}  "
        first, *more = textwrap.wrap(line.remark, max(WIDEST - len(row), 40)) or [""]
        text += [f"{row}{first}".rstrip(), *(" " * len(row) + rest for rest in more)]
    return text


def _in_group(lines: Sequence[ParameterLine], number: int) -> bool:
    return any(line.heading for line in lines[: number + 1])


def _known(fit: Fit) -> list[str]:
    text: list[str] = []
    for group in known_groups(fit):
        text += _wrapped(f"{group.sentence}.", "", "  ")
        for combination, value in group.known:
            text += _wrapped(f"known: {combination} = {value}", "  ", "    ")
    return text


def _trust(fit: Fit) -> list[str]:
    return [line for sentence in trust(fit) for line in _wrapped(sentence)]


def _channels(fit: Fit) -> list[str]:
    """Noisy channels as the rows read them, and how late the load is; nothing of exact runs."""
    read = [*fit.part.record.get("channels", ()), fit.part.known_load or ""]
    rows = smoothed_rows(fit.inputs, fit.part.preparations, read)
    if not rows:
        return []
    said = delay_sentence(fit.delay, fit.unit)
    return ["Noisy channels:", *_aligned(rows), *(_wrapped(said) if said else [])]


def _motion(fit: Fit) -> list[str]:
    if fit.simulation is None:
        return []
    return [
        "Simulated − measured position, mrad RMS:",
        *_aligned(fit.simulation.table()),
        *_wrapped(fit.simulation.ends),
    ]


def _scores(fit: Fit) -> list[str]:
    rows = score_rows(fit.scores, fit.unit)
    return [f"Residual of {TARGET_WORDS[fit.target]}, measured − predicted:", *_aligned(rows)]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """A table as lines, its first column to the left."""
    wide = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(
            f"{cell:<{w}}" if k == 0 else f"{cell:>{w}}"
            for k, (cell, w) in enumerate(zip(row, wide, strict=True))
        ).rstrip()
        for row in rows
    ]


def _warnings(fit: Fit) -> list[str]:
    said = [sentence for sentence in fit.warnings if sentence != fit.uncertainty.statement]
    return ["Warnings:", *(x for s in said for x in _wrapped(s, "- "))] if said else []
