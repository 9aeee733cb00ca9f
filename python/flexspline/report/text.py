"""A fit as text: a verdict, a line for each parameter, and its warnings as sentences.

The verdict says how good the fit is on held-out rows, and against what; HTML says the same.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from flexspline.errors import listed
from flexspline.formatting import padded, plus_minus, rows_text, short, short_names
from flexspline.least_squares.ripple import PAIRS, RippleOrder, ripple_orders
from flexspline.report.tables import (
    between_rows,
    between_sentences,
    delay_sentence,
    score_rows,
    smoothed_rows,
)

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit, Parameter

__all__ = [
    "IDLE",
    "SOUND",
    "TARGET_WORDS",
    "WIDEST",
    "ParameterLine",
    "Verdict",
    "between_text",
    "faults_sentence",
    "fit_text",
    "known_groups",
    "known_text",
    "parameter_line",
    "parameter_lines",
    "spread",
    "trust",
    "validation_sentence",
    "verdict",
    "warnings_text",
    "wrapped",
]

WIDTH = 100
WIDEST = 120  # of the table of parameters
IDLE = "not significant"
SOUND = "No problem was found with the fit itself."

TARGET_WORDS = {
    "sensor_torque": "sensor torque",
    "motor_torque": "motor torque (at the output)",
    "motor_current": "motor current",
    "torsion": "torsion",
}
WORSE = 1.15  # held-out over in-sample RMSE from which the fit is said to be too rich

TOGETHER = 0.95  # correlation from which two estimates are said to move together


def fit_text(fit: Fit) -> str:
    """Return what `print(fit)` shows, lines of at most 120 characters where names allow it."""
    judged = verdict(fit)
    blocks = [
        [*wrapped(judged.good), *wrapped(judged.wrong)],
        _parameters(parameter_lines(fit)),
        known_text(fit),
        between_text(fit),
        _trust(fit),
        _channels(fit),
        _motion(fit),
        _scores(fit),
        warnings_text(fit),
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block)


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


def known_text(fit: Fit) -> list[str]:
    """Return lines that say what is known of coefficients that are not known by themselves."""
    text: list[str] = []
    for group in known_groups(fit):
        text += wrapped(f"{group.sentence}.", "", "  ")
        for combination, value in group.known:
            text += wrapped(f"known: {combination} = {value}", "  ", "    ")
    return text


def between_text(fit: Fit) -> list[str]:
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
    rows = smoothed_rows(fit.inputs, fit.part.preparations, read)
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


def warnings_text(fit: Fit) -> list[str]:
    """Return lines of the fit's warnings."""
    said = [sentence for sentence in fit.warnings if sentence != fit.uncertainty.statement]
    return ["Warnings:", *(x for s in said for x in wrapped(s, "- "))] if said else []


@dataclass(frozen=True)
class Verdict:
    """Two sentences. `grave`: what is wrong makes the numbers unfit for use as they stand."""

    good: str
    wrong: str
    grave: bool


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
    grave, doubts = _grave(fit, share), _doubts(fit)
    said = SOUND
    if grave or doubts:
        said = faults_sentence([*grave, *doubts], bool(grave))
    return Verdict(good, " ".join([said, *_zeros(fit)]), bool(grave))


def faults_sentence(faults: Sequence[str], grave: bool) -> str:
    """Return what speaks against a result: problems, or only what to look at before it is used."""
    return f"{'Problems' if grave else 'Check before use'}: {'; '.join(faults)}."


def spread(fit: Fit) -> float:
    """Return the standard deviation of the target over all rows that count, in its unit."""
    y = np.concatenate([run.measured[run.counts] for run in fit.runs])
    return float(y.std())


def validation_sentence(fit: Fit) -> str:
    """Return how the rows never seen were chosen."""
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
    return "Explains nothing of"


def _percent(share: float) -> str:
    if not share > 0.0:
        return "none"
    digits = 1 if share < 0.999 else 3
    return f"{np.floor(share * 100 * 10**digits) / 10**digits:.{digits}f} %"


def _grave(fit: Fit, share: float) -> list[str]:
    found = []
    if not share >= 0.05:
        found.append("it predicts no better than a constant")
    if fit.simulation is None and not fit.uncertainty.reliable:
        found.append("the runs are too short for the errors to hold")
    every = (short_names(name) for group in fit.confounded for name in group.names)
    hidden = [*dict.fromkeys(every)]
    if hidden:
        found.append(f"not determined alone: {listed(hidden, 6)}")
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
        and np.isfinite(p.standard_error)
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


def parameter_lines(fit: Fit) -> list[ParameterLine]:
    """Return a line for each parameter, then one for each order of ripple and derived quantity."""
    ripple = ripple_orders(fit)
    orders = {name for order in ripple for name in order.names}
    lines = [parameter_line(fit, p) for p in fit.parameters if p.name not in orders]
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


def known_groups(fit: Fit) -> list[KnownGroup]:
    """Return what is known of coefficients that are not known by themselves."""
    return [
        KnownGroup(
            short_names(group.sentence),
            tuple(
                (short_names(str(k)), f"{plus_minus(k.value, k.standard_error)} {k.unit}")
                for k in group.known
            ),
        )
        for group in fit.confounded
    ]


def naive_remark(fit: Fit) -> str:
    """Return how wrong errors would be that take every sample for news; "" where none is known."""
    ratios = np.array(
        [
            p.standard_error / p.naive_error
            for p in fit.parameters
            if p.determined and p.naive_error > 0.0 and np.isfinite(p.standard_error)
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


def parameter_line(fit: Fit, parameter: Parameter) -> ParameterLine:
    """Return the line of one parameter by itself."""
    name = short_names(parameter.name)
    owner = parameter.name.split(".")[0] if "." in parameter.name else ""
    if not parameter.determined:
        return ParameterLine(name, *_undetermined(fit, parameter), concern=True, effect=owner)
    value = plus_minus(parameter.value, parameter.standard_error)
    remarks = []
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
        if not parameter.significant:
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


def _interval(parameter: Parameter) -> str:
    low, high = parameter.interval
    if not np.isfinite(parameter.standard_error) or not np.isfinite(high - low):
        return ""  # unknown, or fewer effective samples than parameters
    digits = max(0, min(9, 1 - int(np.floor(np.log10(max((high - low) / 4.0, 1e-9))))))
    return f"{low:.{digits}f} to {high:.{digits}f}"


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
