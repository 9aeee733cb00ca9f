"""A fit as text: a verdict, a line for each parameter, and its warnings as sentences.

The verdict says how good the fit is on held-out rows, and against what; HTML says the same.

The summary is what statistics programs print on one page, the parameters one table. Their numbers
are those of `fit_text`, rounded alike, under the names that `fixed` and `bounds` take: an order of
ripple is its cosine and sine here.
"""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from flexspline.errors import listed
from flexspline.formatting import (
    apart,
    blocks_text,
    decimals_for,
    padded,
    plus_minus,
    rows_text,
    short,
    short_names,
    span,
    table_html,
)
from flexspline.least_squares.likelihood import why_none
from flexspline.least_squares.ripple import PAIRS, RippleOrder, ripple_orders
from flexspline.model import load_words, negative_terms
from flexspline.report.tables import (
    between_rows,
    between_sentences,
    delay_sentence,
    late_of,
    score_rows,
    smoothed_rows,
)

if TYPE_CHECKING:
    from flexspline.least_squares.options import Bounds
    from flexspline.least_squares.result import Fit, Parameter

__all__ = [
    "SOUND",
    "TARGET_WORDS",
    "ParameterLine",
    "Verdict",
    "faults_sentence",
    "fit_summary",
    "fit_text",
    "known_groups",
    "known_text",
    "parameter_lines",
    "parameters_html",
    "parameters_text",
    "spread",
    "trust",
    "validation_sentence",
    "verdict",
    "wrapped",
]


WIDTH = 100
WIDEST = 120  # of the table of parameters
IDLE = "not significant"
UNKNOWN = "error not known"
"""Of a value that has an estimate and no interval: too few independent samples tell its error."""
SOUND = "No problem was found with the fit itself."

TARGET_WORDS = {
    "sensor_torque": "sensor torque",
    "motor_torque": "motor torque (at the output)",
    "motor_current": "motor current",
    "torsion": "torsion",
}
WORSE = 1.15  # held-out over in-sample RMSE from which the fit is said to be too rich

TOGETHER = 0.95  # correlation from which two estimates are said to move together

MOST_NAMES = 6  # of runs
LEAST_REMARK = 40  # letters of a line
COMPARABLE = (
    "AIC and BIC are of the Gaussian likelihood in this noise, at its maximum (generalised least "
    "squares); they compare fits to the same rows of the same target alone."
)

HEAD = ("parameter", "value ± standard error", "unit", "95 % interval", "bounds", "remark")


def fit_text(fit: Fit) -> str:
    """Return what `print(fit)` shows, lines of at most 120 characters where names allow it."""
    judged = verdict(fit)
    blocks = [
        [*wrapped(judged.good), *wrapped(judged.wrong)],
        _parameters(parameter_lines(fit)),
        known_text(fit),
        _between_text(fit),
        _trust(fit),
        _channels(fit),
        _motion(fit),
        _scores(fit),
        _warnings_text(fit),
    ]
    return blocks_text(blocks)


def wrapped(sentence: str, first: str = "", rest: str = "") -> list[str]:
    """Return a sentence in lines of at most 100 characters, the first and all others indented."""
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
            text += wrapped(line.heading)
        row = f"{name:<{wide[0]}}  {line.value:<{wide[1]}}  {line.unit:<{wide[2]}}  "
        first, *more = textwrap.wrap(line.remark, max(WIDEST - len(row), 40)) or [""]
        text += [f"{row}{first}".rstrip(), *(" " * len(row) + rest for rest in more)]
    return text


def _in_group(lines: Sequence[ParameterLine], number: int) -> bool:
    return any(line.heading for line in lines[: number + 1])


def known_text(fit: Fit, of: Collection[str] | None = None) -> list[str]:
    """Return lines that say what is known of coefficients that are not known by themselves.

    `of`: effects, one of which a group has to hold; None: every group.
    """
    text: list[str] = []
    for group in known_groups(fit, of):
        text += wrapped(f"{group.sentence}.", "", "  ")
        for combination, value in group.known:
            text += wrapped(f"known: {combination} = {value}", "  ", "    ")
    return text


def _between_text(fit: Fit) -> list[str]:
    """Return lines of the terms that each run has of its own; none where there are none."""
    rows = between_rows(fit)
    if not rows:
        return []
    said = [line for sentence in between_sentences(fit) for line in wrapped(sentence)]
    return ["Of each run by itself:", rows_text(rows), *said]


def _trust(fit: Fit) -> list[str]:
    return [line for sentence in trust(fit) for line in wrapped(sentence)]


def _channels(fit: Fit) -> list[str]:
    """Noisy channels as the rows read them, and how late the load is; nothing of exact runs."""
    read = [*fit.part.record.get("channels", ()), fit.part.known_load or ""]
    rows = smoothed_rows(fit.inputs, fit.part.preparations, read, late_of(fit.delay))
    if not rows:
        return []
    said = delay_sentence(fit.delay, fit.unit)
    return ["Noisy channels:", rows_text(rows), *(wrapped(said) if said else [])]


def _motion(fit: Fit) -> list[str]:
    if fit.simulation is None:
        return []
    return [
        "Simulated − measured position, mrad RMS:",
        rows_text(fit.simulation.table()),
        *wrapped(fit.simulation.ends),
    ]


def _scores(fit: Fit) -> list[str]:
    rows = score_rows(fit.scores, fit.unit)
    return [f"Residual of {TARGET_WORDS[fit.target]}, measured − predicted:", rows_text(rows)]


def _warnings_text(fit: Fit) -> list[str]:
    """Return lines of the fit's warnings."""
    said = [sentence for sentence in fit.warnings if sentence != fit.uncertainty.statement]
    return ["Warnings:", *(x for s in said for x in wrapped(s, "- "))] if said else []


@dataclass(frozen=True)
class Verdict:
    """Two sentences. `critical`: what is wrong makes the numbers unfit for use as they stand."""

    good: str
    wrong: str
    critical: bool


def verdict(fit: Fit) -> Verdict:
    """Return the verdict in words."""
    around = spread(fit)
    share = 1.0 - (fit.cv_rmse / around) ** 2 if around > 0.0 else float("nan")
    what = TARGET_WORDS[fit.target]
    good = (
        f"{_grade(share)} the {what} on held-out rows: "
        f"{padded(fit.cv_rmse)} {fit.unit} RMSE is left of a spread of "
        f"{padded(around)} {fit.unit} ({_percent(share)} of the variance explained)."
    )
    if fit.between_runs and np.isfinite(new := fit.between_runs[0].new_run_rmse):
        good += (
            f" A new run, predicted with the mean of the runs' own terms, leaves {padded(new)} "
            f"{fit.unit}."
        )
    if fit.simulation is not None:
        good = f"{fit.simulation.verdict} {good}"
    critical, doubts = _critical(fit, share), _doubts(fit)
    said = SOUND
    if critical or doubts:
        said = faults_sentence([*critical, *doubts], bool(critical))
    return Verdict(good, " ".join([said, *_zeros(fit)]), bool(critical))


def faults_sentence(faults: Sequence[str], critical: bool) -> str:
    """Return what speaks against a result: problems, or only what to look at before it is used."""
    return f"{'Problems' if critical else 'Check before use'}: {'; '.join(faults)}."


def spread(fit: Fit) -> float:
    """Return the standard deviation of the target over all rows that count, in its unit."""
    y = np.concatenate([run.measured[run.counts] for run in fit.runs])
    return float(y.std())


def validation_sentence(fit: Fit) -> str:
    """Return how the held-out rows were chosen."""
    if fit.validated_by == "folds of runs":
        return f"Held out: each of {fit.folds} folds of runs in turn, fitted to the others."
    if fit.validated_by == "runs":
        return f"Held out: each of {fit.folds} runs in turn, fitted to the others."
    return f"Held out: each of {fit.folds} contiguous blocks in turn, fitted to the others."


def trust(fit: Fit) -> list[str]:
    """Return why the errors can be believed, and what was held out."""

    if fit.simulation is None:
        said = [fit.uncertainty.statement, naive_remark(fit), validation_sentence(fit)]
    else:
        said = [*fit.simulation.sentences, naive_remark(fit), validation_sentence(fit)]
    return [sentence for sentence in said if sentence]


def _grade(share: float) -> str:
    for limit, words in (
        (0.98, "Explains nearly all of"),
        (0.9, "Explains most of"),
        (0.5, "Explains a part of"),
        (0.05, "Explains little of"),
    ):
        if share >= limit:
            return words
    return "Explains next to nothing of" if share > 0.0 else "Explains nothing of"


def _percent(share: float) -> str:
    if not share > 0.0:
        return "none"
    digits = 1 if share < 0.999 else 3
    return f"{np.floor(share * 100 * 10**digits) / 10**digits:.{digits}f} %"


def _critical(fit: Fit, share: float) -> list[str]:
    found = []
    if not share >= 0.05:
        found.append("it predicts no better than a constant")
    if fit.parameters and fit.simulation is None and not fit.uncertainty.reliable:
        found.append("the runs are too short for the errors to hold")
    for words, groups in (
        ("not determined alone", [g.names for g in fit.confounded if len(g.names) > 1]),
        ("not excited by these runs", [g.names for g in fit.confounded if len(g.names) == 1]),
    ):
        if hidden := [*dict.fromkeys(short_names(name) for names in groups for name in names)]:
            found.append(f"{words}: {listed(hidden, 6)}")
    stuck = [short_names(p.name) for p in fit.parameters if p.state.startswith("at ")]
    if stuck:
        found.append(f"at a bound: {listed(stuck, 6)}")
    return found


def _doubts(fit: Fit) -> list[str]:
    found = []
    if fit.cv_rmse > WORSE * fit.rmse:
        percent = round(100.0 * (fit.cv_rmse / fit.rmse - 1.0))
        found.append(f"{percent} % worse on held-out rows than on its own")
    shapes = [short_names(p.name) for p in fit.parameters if p.kind == "shape" and not p.determined]
    if shapes:
        found.append(f"shape not determined: {listed(shapes, 6)}")
    if negative := negative_terms(fit.part, significant=True):
        found.append(f"negative, which no drive has: {listed([t.name for t in negative], 6)}")
    warned = len([said for said in fit.warnings if said != fit.uncertainty.statement])
    if warned:
        found.append(f"{warned} warning{'s' if warned > 1 else ''}, see below")
    return found


def _zeros(fit: Fit) -> list[str]:
    """A sentence of the terms that are not significant, which is no fault of a fit."""
    idle = _idle(fit)
    return [f"Not significant (95 %): {listed(idle, 6)}."] if idle else []


def _idle(fit: Fit) -> list[str]:
    """Coefficients and orders that may as well be zero."""
    orders = ripple_orders(fit)
    whole = {name for order in orders for name in order.names}
    idle = [
        short_names(p.name)
        for p in fit.parameters
        if p.kind == "coefficient"
        and p.determined
        and p.name not in whole
        and np.isfinite(p.stderr)
        and not p.significant
    ]
    return idle + [f"{o.effect} order {o.order}" for o in orders if not o.significant]


@dataclass(frozen=True)
class ParameterLine:
    """One line of the table of parameters, as text.

    `heading`: of the lines from here on, "" for none. `concern`: the remark is a reason to worry.
    `interval`: of 95 %. `naive`: the error as if every sample were news. `effect`: whose it is, ""
    where several share it. `tied`: strongly correlated with another.
    """

    name: str
    value: str
    unit: str
    remark: str
    concern: bool = False
    heading: str = ""
    interval: str = ""
    naive: str = ""
    effect: str = ""
    tied: bool = False


@dataclass(frozen=True)
class KnownGroup:
    """Confounded coefficients: why, and the combinations that are known, with value and unit."""

    sentence: str
    known: tuple[tuple[str, str], ...]


def parameter_lines(fit: Fit, of: Collection[str] | None = None) -> list[ParameterLine]:
    """Return a line for each parameter, then one for each order of ripple and derived quantity.

    `of`: names of parameters, for these alone.
    """
    asked = {p.name for p in fit.parameters} if of is None else {*of}
    ripple = ripple_orders(fit)
    orders = {name for order in ripple for name in order.names}
    lines = [_parameter_line(fit, p) for p in fit.parameters if p.name in asked - orders]
    ripple = [order for order in ripple if asked.issuperset(order.names)]
    for (effect, turns), members in groupby(ripple, lambda o: (o.effect, o.turns)):
        for number, order in enumerate(members):
            lines.append(_ripple_line(order, "" if number else _heading(effect, turns)))
    return [*lines, *_derived_lines(fit)]


def _derived_lines(fit: Fit) -> list[ParameterLine]:
    """What follows from the parameters, under a heading of its own."""
    return [
        ParameterLine(
            d.name,
            plus_minus(d.value, d.standard_error),
            d.unit,
            "",
            heading="" if number else "From these (errors to first order)",
        )
        for number, d in enumerate(fit.derived)
    ]


def known_groups(fit: Fit, of: Collection[str] | None = None) -> list[KnownGroup]:
    """Return what is known of coefficients that are not known by themselves, as `known_text`."""
    return [
        KnownGroup(
            short_names(group.sentence),
            tuple(
                (short_names(str(k)), f"{plus_minus(k.value, k.standard_error)} {k.unit}")
                for k in group.known
            ),
        )
        for group in fit.confounded
        if of is None or any(name.split(".")[0] in of for name in group.names)
    ]


def naive_remark(fit: Fit) -> str:
    """Return how wrong errors would be that take every sample for news; "" where none is known."""
    ratios = np.array(
        [
            p.stderr / p.naive_error
            for p in fit.parameters
            if p.naive_error > 0.0 and np.isfinite(p.stderr)
        ]
    )
    if not len(ratios):
        return ""
    low, middle, high = np.percentile(ratios, [0, 50, 100]).tolist()
    naive = "Naive errors (all samples treated as independent)"
    if middle < 1.1:
        return f"{naive} would be about the same."
    spread = f" ({low:.1f} to {high:.1f})" if high > 1.2 * low else ""
    return f"{naive} are {middle:.1f} times too small{spread}."


def _heading(effect: str, turns: str) -> str:
    return f"{effect}: A·cos(order·angle − phase) per turn of {turns}"


def _ripple_line(order: RippleOrder, heading: str) -> ParameterLine:
    counted = ""
    if order.turns != PAIRS["output_on_housing"] and np.isfinite(order.per_output_turn):
        counted = f"{order.per_output_turn:g} per output turn"
    phase = f"phase {_angle(order)}" if order.significant else IDLE
    return ParameterLine(
        f"order {order.order}",
        plus_minus(order.amplitude, order.amplitude_error),
        order.unit,
        "; ".join(part for part in (phase, counted) if part),
        heading=heading,
        naive=_error(order.naive_error),
        effect=order.effect,
    )


def _angle(order: RippleOrder) -> str:
    digits = 0 if order.phase_error >= 1.0 else 1
    return f"{order.phase:.{digits}f}° ± {max(order.phase_error, 0.1):.{digits}f}°"


def _parameter_line(fit: Fit, parameter: Parameter) -> ParameterLine:
    """Return the line of one parameter by itself."""
    name = short_names(parameter.name)
    owner = parameter.name.split(".")[0] if "." in parameter.name else ""
    if not parameter.determined:
        return ParameterLine(name, *_undetermined(fit, parameter), concern=True, effect=owner)
    value = plus_minus(parameter.value, parameter.stderr)
    remarks = [UNKNOWN] if unknown_error(parameter) else []
    concern = False
    tied: list[str] = []
    if parameter.state == "fixed":
        remarks.append("fixed")
    elif parameter.state != "fitted":
        remarks.append(f"ended {parameter.state.replace('at ', 'at its ')}")
        concern = True
    if parameter.prior is not None:
        remarks.append(f"prior {plus_minus(*parameter.prior)}")
    if parameter.kind == "coefficient" and np.isfinite(parameter.standard_error):
        if parameter.error_known and not parameter.significant:
            remarks.append(IDLE)
        tied = _partners(fit, parameter)
        remarks += tied
    return ParameterLine(
        name,
        value,
        parameter.unit,
        "; ".join(remarks),
        concern,
        interval=_interval(parameter),
        naive=_error(parameter.naive_error),
        effect=owner,
        tied=bool(tied),
    )


def unknown_error(parameter: Parameter) -> bool:
    """Whether it was fitted, and too few independent samples tell how far off it is."""
    return np.isfinite(parameter.standard_error) and not parameter.error_known


def _interval(parameter: Parameter) -> str:
    return span(*parameter.interval, parameter.stderr) if np.isfinite(parameter.stderr) else ""


def _error(error: float) -> str:
    return short(error, 2) if np.isfinite(error) else ""


def _undetermined(fit: Fit, parameter: Parameter) -> tuple[str, str, str]:
    """Value, unit and remark of a parameter that must not show a number of its own."""
    if parameter.kind == "shape":
        said = f"the model uses {short(parameter.value)} {parameter.unit}"
        return "not determined", "", said
    partners = next((g.names for g in fit.confounded if parameter.name in g.names), ())
    if not partners:
        return "not determined", "", "its run does not determine it"
    if len(partners) == 1:
        return "not determined", "", "these runs do not excite it"
    return "not determined alone", "", "what is known stands below"


def _partners(fit: Fit, parameter: Parameter) -> list[str]:
    """Parameters whose estimates are tied to this one."""
    names = fit.part.record["covariance"]["names"]
    if parameter.name not in names:
        return []
    errors = np.sqrt(np.maximum(np.diag(fit.covariance), 1e-300))
    row = names.index(parameter.name)
    correlation = fit.covariance[row] / errors / errors[row]
    hidden = {p.name for p in fit.parameters if not p.determined}
    tied = [
        short_names(name)
        for name, r in zip(names, correlation, strict=True)
        if abs(r) > TOGETHER and name != parameter.name and name not in hidden
    ]
    return [f"strongly correlated with {listed(tied, 2)}"] if tied else []


def parameters_text(fit: Fit) -> str:
    """Return what `print(fit.params)` shows."""
    if not fit.parameters:
        return "No parameters: nothing was fitted."
    table = rows_text(_remarks_wrapped(_rows(fit)), left=range(len(HEAD)))
    return blocks_text([[table], known_text(fit)])


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
        line, order = _parameter_line(fit, parameter), orders.get(parameter.name)
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
        _between_text(fit),
        [*wrapped(judged.good), *wrapped(judged.wrong)],
        [line for sentence in [*trust(fit), *_notes(fit)] for line in wrapped(sentence)],
        _warnings_text(fit),
    ]
    return blocks_text(blocks)


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
        ("known load", load_words(fit.part)),
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
    return f"{round(parameter.value / parameter.stderr, 2) + 0.0:.2f}"  # no −0.00


def _notes(fit: Fit) -> list[str]:
    why = why_none(fit)
    said = [f"No AIC or BIC: {why}."] if why else [COMPARABLE]
    if any(p.kind == "coefficient" and p.stderr > 0.0 for p in fit.parameters):
        said.append("t is the value over its standard error.")
    return said
