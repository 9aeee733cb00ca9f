"""A fit's parameters as one table, and its summary: what statistics programs print on one page.

All numbers are those of `fit_text`, rounded alike, under the names that `fixed` and `bounds` take:
an order of ripple is its cosine and sine here.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexspline.errors import listed
from flexspline.formatting import apart, decimals_for, rows_text, short, table_html
from flexspline.least_squares.likelihood import why_none
from flexspline.least_squares.ripple import ripple_orders
from flexspline.report.text import (
    IDLE,
    TARGET_WORDS,
    WIDEST,
    ParameterLine,
    between_text,
    known_groups,
    known_text,
    parameter_line,
    trust,
    verdict,
    warnings_text,
    wrapped,
)

if TYPE_CHECKING:
    from flexspline.least_squares.options import Bounds
    from flexspline.least_squares.result import Fit, Parameter

__all__ = ["fit_summary", "parameters_html", "parameters_text"]

MOST_NAMES = 6  # of runs
LEAST_REMARK = 40  # letters of a line
COMPARABLE = (
    "AIC and BIC are of the Gaussian likelihood in this noise, at its maximum (generalised least "
    "squares); they compare fits to the same rows of the same target alone."
)

HEAD = ("parameter", "value ± standard error", "unit", "95 % interval", "bounds", "remark")


def parameters_text(fit: Fit) -> str:
    """Return what `print(fit.params)` shows."""
    if not fit.parameters:
        return "No parameters: nothing was fitted."
    table = rows_text(_remarks_wrapped(_rows(fit)), left=range(len(HEAD)))
    return "\n\n".join(["\n".join(block) for block in ([table], known_text(fit)) if block])


def parameters_html(fit: Fit) -> str:
    """Return the same as a fragment of HTML."""
    title = f"{len(fit.parameters)} parameters of the {TARGET_WORDS[fit.target]}"
    known = [
        f"{group.sentence}; known: {combination} = {value}"
        for group in known_groups(fit)
        for combination, value in group.known
    ]
    return table_html(title, _rows(fit), known)


def _rows(fit: Fit) -> list[tuple[str, ...]]:
    rows = []
    for parameter, line in zip(fit.parameters, _lines(fit), strict=True):
        bounds = _bounds(parameter.bounds)
        rows.append((line.name, line.value, line.unit, line.interval, bounds, line.remark))
    return [HEAD, *rows]


def _lines(fit: Fit) -> list[ParameterLine]:
    """A line for each parameter; cosine and sine of an order are significant together."""
    orders = {name: order for order in ripple_orders(fit) for name in order.names}
    lines = []
    for parameter in fit.parameters:
        line, order = parameter_line(fit, parameter), orders.get(parameter.name)
        if order is not None:
            remarks = [part for part in line.remark.split("; ") if part not in ("", IDLE)]
            remarks = remarks if order.significant else [f"order {IDLE}", *remarks]
            line = replace(line, remark="; ".join(remarks))
        lines.append(line)
    return lines


def _remarks_wrapped(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Rows whose last cell, where it is too long for the screen, goes on in rows below."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]) - 1)]
    left = max(WIDEST - sum(widths) - 2 * len(widths), LEAST_REMARK)
    made: list[tuple[str, ...]] = []
    for *cells, remark in rows:
        first, *more = textwrap.wrap(remark, left, break_on_hyphens=False) or [""]
        made += [(*cells, first), *((*[""] * len(cells), rest) for rest in more)]
    return made


def _bounds(bounds: Bounds | None) -> str:
    if bounds is None:
        return ""
    low, high = bounds
    if low is None or high is None:
        return f"above {low:g}" if low is not None else f"below {high:g}"
    return f"{low:g} to {high:g}"


def fit_summary(fit: Fit) -> str:
    """Return what `fit.summary()` is, lines of at most 120 characters where names allow it."""
    judged = verdict(fit)
    blocks = [
        [f"Fit of {TARGET_WORDS[fit.target]}, {_method(fit)}"],
        [rows_text(_facts(fit), left=(0, 1))],
        [_table(fit)],
        known_text(fit),
        between_text(fit),
        [*wrapped(judged.good), *wrapped(judged.wrong)],
        [line for sentence in [*trust(fit), *_notes(fit)] for line in wrapped(sentence)],
        warnings_text(fit),
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block)


def _method(fit: Fit) -> str:
    if fit.simulation is not None:
        return "least squares of the simulated motion"
    if fit.generalised:
        return "generalised least squares"
    solved = fit.solved
    robust = solved is not None and solved.tangent.weights is not None
    return "robust least squares (Huber)" if robust else "least squares"


def _facts(fit: Fit) -> list[tuple[str, str]]:
    runs = [run.log.name for run in fit.runs]
    rows = sum(len(run.log) for run in fit.runs)
    used = sum(int(run.counts.sum()) for run in fit.runs)
    digits = decimals_for(fit.cv_rmse)
    whose = "" if fit.simulation is None else " of the regression"
    found = [
        ("target", f"{fit.target} [{fit.unit}]"),
        ("known load", fit.part.known_load or "none"),
        ("runs", f"{len(runs)} ({listed(runs, MOST_NAMES)})"),
        ("rows", f"{rows}, {used} used"),
        (f"effective sample size{whose}", f"{fit.effective_samples:.0f}"),
        (f"noise{whose}", _noise(fit)),
        ("RMSE", f"{fit.rmse:.{digits}f} {fit.unit}"),
        ("RMSE held out", f"{fit.cv_rmse:.{digits}f} {fit.unit}"),
    ]
    if fit.lowpass is not None:
        found.insert(2, ("low pass", f"{fit.lowpass:g} Hz, zero phase"))
    return [*found, *_criteria(fit)]


def _noise(fit: Fit) -> str:
    noise = fit.uncertainty.noise
    deviation = f"standard deviation {short(noise.innovation_variance**0.5)} {fit.unit}"
    every = f", every {noise.decimation} rows" if noise.decimation > 1 else ""
    if not noise.order:
        return f"white, {deviation}{every}"
    rows = noise.memory * noise.decimation
    rate = float(np.median([run.log.rate for run in fit.runs]))
    count = short(rows) if rows < 100.0 else f"{rows:.0f}"
    memory = f"memory {count} rows ({short(rows / rate)} s)"
    return f"autoregressive of order {noise.order}, innovations of {deviation}, {memory}{every}"


def _criteria(fit: Fit) -> list[tuple[str, str]]:
    if why_none(fit):
        return [("AIC, BIC", "none")]
    found = fit.likelihood
    some = "" if found.of_noise_in_all else ", to be compared with fits of such per-run terms alone"
    return [
        ("log-likelihood", f"{found.log_likelihood:.1f}, of {found.rows} rows"),
        ("effective parameters", f"{found.parameters:.1f}, {found.noise_order + 1} of the noise"),
        ("AIC", f"{found.aic:.1f}{some}"),
        ("BIC", f"{found.bic:.1f}{some}"),
    ]


def _table(fit: Fit) -> str:
    if not fit.parameters:
        return "No parameters: nothing was fitted."
    head = ("parameter", "value", "stderr", "t", "95 % from", "to", "unit", "remark")
    both = zip(fit.parameters, _lines(fit), strict=True)
    return rows_text(_remarks_wrapped([head, *(_row(*one) for one in both)]), left=(0, 6, 7))


def _row(parameter: Parameter, line: ParameterLine) -> tuple[str, ...]:
    if not parameter.determined:
        return (line.name, "–", "–", "", "–", "–", line.unit, f"{line.value}; {line.remark}")
    value, error = apart(line.value)
    low, _, high = line.interval.partition(" to ")
    return (line.name, value, error, _t(parameter), low or "–", high or "–", line.unit, line.remark)


def _t(parameter: Parameter) -> str:
    """Value over error of a coefficient; zero is no value that a shape could have."""
    if parameter.kind != "coefficient" or not parameter.stderr > 0.0:
        return ""
    return f"{parameter.value / parameter.stderr:.2f}"


def _notes(fit: Fit) -> list[str]:
    why = why_none(fit)
    said = [f"No AIC or BIC: {why}."] if why else [COMPARABLE]
    if any(p.kind == "coefficient" and p.stderr > 0.0 for p in fit.parameters):
        said.append("t is the value over its standard error.")
    return said
