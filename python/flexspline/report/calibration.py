"""A calibration as text and HTML: a verdict, parameters, figures in %FS, and what is wrong."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.result import bend_of, held_in_drift, late_of, percent_text
from flexspline.errors import listed
from flexspline.formatting import blocks_text, padded, plus_minus, short
from flexspline.plot.canvas import own_style
from flexspline.report.html import log_facts, templates, write_html
from flexspline.report.text import UNKNOWN, Verdict, faults_sentence, unknown_error

if TYPE_CHECKING:
    from flexspline.calibration.accuracy import Figure
    from flexspline.calibration.regression import Alone
    from flexspline.calibration.result import CalibrationResult
    from flexspline.calibration.thermal import ThermalLeg
    from flexspline.least_squares.result import Parameter

__all__ = [
    "calibration_html",
    "calibration_text",
    "digits",
    "sized",
    "told",
    "write_calibration_report",
]

WIDTH = 100

MILLI = 1000.0
POOR = 0.05  # of the full scale
ROUNDING = 1e-9  # of the RMSE: what sums of doubles leave of a mean that is zero
MEANS = {
    "sensitivity": "of torque over voltage",
    "zero": "torque at 0 V; in volts the reading without load, at T₀",
    "gradient": "of T − T_b",
    "thermal_lag": "of the elastic body behind the thermometer",
}
SOURCES = {
    "given": "as given",
    "model": "that of the model",
    "reference": "the largest reference, for want of a given one",
}
OWN_ZEROS = (
    "The zero above, which the model holds, is the mean of the runs'; its error is that of the "
    "noise alone. A sensor that is mounted or zeroed again has another zero: zero its reading, or "
    "take it to be off by that standard deviation times √(1 + 1/R) after R runs, and by more after "
    "few."
)


def calibration_text(result: CalibrationResult) -> str:
    """Return what `print(result)` shows."""
    judged = calibration_verdict(result)
    blocks = [
        [*_wrapped(judged.good), *_wrapped(judged.wrong)],
        _parameter_text(result),
        _zero_text(result),
        _figure_text(result),
        [line for sentence in told(result) for line in _wrapped(sentence)],
        _listed("Warnings:", [w for w in result.warnings if w != result.uncertainty.statement]),
    ]
    return blocks_text(blocks)


def calibration_html(result: CalibrationResult) -> str:
    """Return a calibration as a fragment of HTML without scripts, for notebooks."""
    return templates().get_template("calibration_fragment.html").render(_common(result))


@own_style()
def write_calibration_report(result: CalibrationResult, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.sensor import panels  # matplotlib only where it draws
    from flexspline.report.html import drawn

    joint = result.model.facts.get("joint", result.runs[0].log.facts.get("joint"))
    write_html(
        path,
        "calibration.html",
        _common(result),
        title=str(joint or "Calibration of the torque sensor"),
        charts=[drawn(panel) for panel in panels(result)],
        folds=[
            (label, sized(result, rmse))
            for label, rmse in zip(result.fold_labels, result.fold_rmses, strict=True)
        ],
        logs=log_facts([run.log for run in result.runs]),
        call=_call(result),
    )


def _parameter_text(result: CalibrationResult) -> list[str]:
    lines = calibration_lines(result)
    head = ("parameter", "value ± standard error", "in volts", "")
    rows = [head, *((x.name, x.torque, x.voltage, x.remark) for x in lines)]
    return _table(rows)


def _zero_text(result: CalibrationResult) -> list[str]:
    if not result.zeros:
        return []
    return [*_table(zero_rows(result)), *_wrapped(zero_sentence(result))]


def _figure_text(result: CalibrationResult) -> list[str]:
    return [*_wrapped(scale_line(result)), *_table([row[:4] for row in figure_rows(result)])]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns side by side; the last one wrapped."""
    wide = [max(len(row[k]) for row in rows) for k in range(3)]
    keep = [k for k in range(3) if wide[k]]
    text = []
    for row in rows:
        start = "  ".join(f"{row[k]:<{wide[k]}}" for k in keep) + "  "
        first, *more = textwrap.wrap(row[3], max(120 - len(start), 40)) or [""]
        text += [f"{start}{first}".rstrip(), *(" " * len(start) + rest for rest in more)]
    return text


def _listed(title: str, sentences: Sequence[str]) -> list[str]:
    return [title, *(x for s in sentences for x in _wrapped(s, "- "))] if sentences else []


def _wrapped(sentence: str, first: str = "") -> list[str]:
    return textwrap.wrap(
        sentence,
        WIDTH,
        initial_indent=first,
        subsequent_indent=" " * len(first),
        break_long_words=False,
        break_on_hyphens=False,
    )


def _common(result: CalibrationResult) -> dict[str, Any]:
    return {
        "verdict": calibration_verdict(result),
        "lines": calibration_lines(result),
        "zeros": zero_rows(result),
        "zero_sentence": zero_sentence(result) if result.zeros else "",
        "scale": scale_line(result),
        "figures": figure_rows(result),
        "told": told(result),
        "groups": [group.sentence for group in result.confounded],
        "reliable": result.uncertainty.reliable,
        "warnings": [w for w in result.warnings if w != result.uncertainty.statement],
    }


def _call(result: CalibrationResult) -> str:
    shape = result.shape
    given = [f"degree={shape.degree}", f"reference_temperature={shape.reference_temperature:g}"]
    if shape.lag:
        searched = any(p.name == "thermal_lag" and p.state != "fixed" for p in result.parameters)
        given.append("thermal_lag='fit'" if searched else f"thermal_lag={shape.lag!r}")
    if shape.gradient or shape.held_gradient:
        given.append("gradient='fit'" if shape.gradient else f"gradient={shape.held_gradient!r}")
    if shape.held_sensitivity is not None:
        given.append(f"sensitivity={shape.held_sensitivity!r}")
    if result.zeros:
        given.append("zero_per_run=True")
    if result.full_scale_source == "given":
        given.append(f"full_scale={result.full_scale!r}")
    lines = "".join(f"    {argument},\n" for argument in ["logs", *given])
    return f"result = flexspline.calibrate(\n{lines})"


@dataclass(frozen=True)
class CalibrationLine:
    """A parameter as text: in Nm, in V or mV, and a remark; `concern`: a reason to worry."""

    name: str
    torque: str
    voltage: str
    remark: str
    concern: bool


def calibration_verdict(result: CalibrationResult) -> Verdict:
    """Return how good the calibration is on held-out rows, and what is wrong with it."""
    worst = f"{sized(result, result.worst_fold)} in the worst of {len(result.fold_rmses)} parts"
    worst += "".join(f", and {_determines(one)}" for one in result.alone)
    held = f"{sized(result, result.cv_rmse)} RMSE on held-out rows"
    if result.calibration is None:
        good = f"No calibration, but the drift in volts: {held}, {worst}."
    else:
        sensitivity = result["sensitivity"]
        known = plus_minus(sensitivity.value, sensitivity.standard_error)
        share = ""
        if result.full_scale:
            of_scale = _of_scale(result.cv_rmse, result.full_scale)
            share = f" ({of_scale} % of {short(result.full_scale, 4)} Nm)"
        good = f"Calibrated, {known} Nm/V: the reading is off by {held}{share}, {worst}."
    faults, missing = _faults(result), _missing(result)
    if not faults:
        return Verdict(good, f"No problem was found with it.{missing}", False)
    critical = (
        result.calibration is None
        or not result.uncertainty.reliable
        or _hidden(result) != []
        or _moved(result)
    )
    return Verdict(good, f"{faults_sentence(faults, critical)}{missing}", critical)


def _moved(result: CalibrationResult) -> bool:
    return result.zero_test is not None and result.zero_test.moved


def calibration_lines(result: CalibrationResult) -> list[CalibrationLine]:
    """Return a line for each parameter, in Nm and in volts."""
    torque = {p.name: p for p in result.torque_parameters}
    volts = {p.name: p for p in result.voltage_parameters}
    names = list(torque or volts)
    return [_line(result, name, torque.get(name), volts.get(name)) for name in names]


def figure_rows(result: CalibrationResult) -> list[tuple[str, str, str, str, bool]]:
    """Return name, %FS, Nm, remark, and whether there is a value, of each figure."""
    rows = []
    for figure in result.figures:
        if figure.percent is None or figure.torque is None:
            rows.append((figure.name, "not shown", "", figure.reason, False))
            continue
        rows.append(
            (
                figure.name,
                f"{_fixed(figure.percent)} %FS",
                f"{_fixed(figure.torque)} Nm",
                _remark(figure),
                True,
            )
        )
    return rows


def scale_line(result: CalibrationResult) -> str:
    """Return what the figures are percent of."""
    if result.full_scale is None:
        return "Figures: no full scale is known."
    source = SOURCES[result.full_scale_source]
    own = ", each run read with its own zero" if result.zeros else ""
    return f"Figures, in % of the full scale of {short(result.full_scale, 4)} Nm ({source}){own}:"


def zero_rows(result: CalibrationResult) -> list[tuple[str, str, str, str]]:
    """Return a head and, of each run, its zero in Nm, in mV, and what it is beside the mean."""
    if not result.zeros:
        return []
    torque = result.unit == "Nm"
    rows = [("zero of the run", "value ± standard error" if torque else "", "in volts",
             "read with the mean zero, it is off by")]  # fmt: skip
    for zero in result.zeros:
        volts = plus_minus(MILLI * zero.voltage, MILLI * zero.voltage_error)
        known = f"{plus_minus(zero.torque, zero.torque_error)} Nm" if torque else ""
        off = sized(result, zero.beside if torque else zero.beside_voltage)
        rows.append((zero.run, known, f"{volts} mV", off))
    return rows


def zero_sentence(result: CalibrationResult) -> str:
    """Return how far the zeros of the runs spread, and what the zero of the result is."""
    volts, torque = result.zero_spread
    size = f"{digits(MILLI * volts)} mV"
    if result.unit == "Nm":
        share = f", {_of_scale(torque, result.full_scale)} %FS" if result.full_scale else ""
        size = f"{digits(torque)} Nm ({size}{share})"
    return f"Zeros of {len(result.zeros)} runs, standard deviation {size}. {OWN_ZEROS}"


def told(result: CalibrationResult) -> list[str]:
    """Return sentences on the drift, the legs, the errors and what was held out."""
    said = []
    if result.shape.degree:
        terms = [_term(p, k) for k, p in enumerate(result.drift_polynomial)]
        polynomial = " ".join(reversed(terms)).removeprefix("+ ")
        said.append(f"Reading without load: b(T) = {polynomial} mV, T in °C.")
    said += _legs(result)
    if result.unit == "V" and result.thermal is not None:
        before, after = _spread(result.thermal.both)
        said.append(
            f"Means over temperature spread by {sized(result, before)} before and "
            f"{sized(result, after)} after the drift is taken off."
        )
    held = "runs" if result.validated_by == "runs" else "contiguous blocks"
    said.append(
        f"Held out: each of {len(result.fold_rmses)} {held} in turn; RMSE in the median "
        f"{sized(result, result.median_fold)}, in the worst {sized(result, result.worst_fold)}; in "
        f"sample {sized(result, result.rmse)}.{_held_zero(result)}{_no_runs(result)}"
    )
    test = result.zero_test
    if test is not None and not test.moved and test.tested < len(result.runs) - 1:
        said.append(
            "A zero that moved between the runs could pass for drift here, unseen: the temperature "
            "changes too little within the runs."
        )
    if result.drift_beside_bend:
        what = "Drift and thermal lag are" if result.shape.lag else "The drift is"
        said.append(f"{what} found beside bend and hysteresis, so that none of these goes there.")
    return [*said, result.uncertainty.statement, noise_alone(result)]


def _determines(one: Alone) -> str:
    """What a part of the runs alone determines, in words."""
    return f"{one.label} alone determines {listed(n.replace('_', ' ') for n in one.names)}"


def _no_runs(result: CalibrationResult) -> str:
    """Why no whole runs were left out, where that is for what one alone determines."""
    if not result.instead:
        return ""
    return f" No whole run is held out, for {'; '.join(map(_determines, result.instead))}."


def noise_alone(result: CalibrationResult) -> str:
    """Return what the errors hold, and how many parameters the noise has that are not told."""
    repeats = "bend and hysteresis"
    if result.gain_test is not None:
        repeats = "bend, hysteresis and a gain that changes with temperature"
    count = result.uncertainty.noise.parameters - len(result.uncertainty.basis)
    beside = f", which is found beside {count} more of {repeats}" if count > 0 else ""
    return (
        f"Errors of parameters are those of the noise{beside}: {repeats} repeat, and stand in the "
        "figures."
    )


def _held_zero(result: CalibrationResult) -> str:
    """With what zero a part that was left out is read."""
    if not result.zeros:
        return ""
    if result.validated_by == "runs":
        return (
            " A run that was left out has an unknown zero and is read with the mean of the "
            "others', so that its error holds the spread of the zeros; in sample each has its own."
        )
    return (
        " A block is read with the zero of the rest of its run: a held-out run is off "
        "by the spread of the zeros as well."
    )


def _spread(means: NDArray[np.float64]) -> list[float]:
    """Largest less least of each column, (c,), bins without rows left out."""
    found: list[float] = (np.nanmax(means, axis=0) - np.nanmin(means, axis=0)).tolist()
    return found


def _told(leg: ThermalLeg) -> float:
    """The mean error of a leg, 0 where that is rounding: a mean that is fitted is zero."""
    return leg.bias if abs(leg.bias) > ROUNDING * leg.rmse else 0.0


def _legs(result: CalibrationResult) -> list[str]:
    """What ways load and temperature went."""
    said = []
    if result.legs:
        up = sum(leg.rising for leg in result.legs)
        what = "plateaus" if result.points is not None and result.points.stepped else "ramps"
        levels = 0 if result.points is None else len(result.points.levels)
        said.append(
            f"Legs of the reference: {up} rising, {len(result.legs) - up} falling; {levels} levels "
            f"on {what}."
        )
    said += [
        f"{'Heating' if leg.heating else 'Cooling'} in {leg.run}, {leg.low:.1f} to {leg.high:.1f} "
        f"°C: the reading is off by {sized(result, leg.rmse)} RMSE, {sized(result, _told(leg))} in "
        "the mean."
        for leg in result.thermal_legs
    ]
    return said


def _remark(figure: Figure) -> str:
    if figure.at is None or not figure.resolved:
        shown = _fixed(figure.noise or 0.0)
        return f"{figure.definition}; not significant: noise alone shows up to {shown} %FS"
    return f"{figure.definition}; at {short(round(figure.at, 1) + 0.0, 3)} {figure.at_unit}"


def _line(
    result: CalibrationResult, name: str, torque: Parameter | None, volts: Parameter | None
) -> CalibrationLine:
    shown = torque or volts
    assert shown is not None
    remarks, concern = [], False
    if not shown.determined:
        alone = any(name in group.names for group in result.confounded)
        remarks, concern = ["not determined alone" if alone else shown.state], True
    elif shown.state == "fixed":
        remarks.append("given, not fitted")
    elif unknown_error(shown):
        remarks.append(UNKNOWN)
    elif not shown.significant:
        remarks.append("not significant")
    if shown.state == "fitted" and (name.startswith("drift") or name == "thermal_lag"):
        held = held_in_drift(result)
        remarks += [held] if held else []
        concern = concern or bool(held)
    if name == "zero" and result.zeros:
        remarks.append("mean of the zeros of the runs")
    if name in MEANS:
        remarks.append(MEANS[name])
    if name == "thermal_lag":
        lag = _value(shown, 1.0, "s")
        return CalibrationLine("thermal lag", lag, "", "; ".join(remarks), concern)
    return CalibrationLine(
        name.replace("_", " "),
        "" if torque is None else _value(torque, 1.0, torque.unit),
        "" if volts is None else _value(volts, MILLI, "m" + volts.unit),
        "; ".join(remarks),
        concern,
    )


def _value(parameter: Parameter, scale: float, unit: str) -> str:
    if not parameter.determined and parameter.kind == "shape":
        return f"not determined, {short(parameter.value)} {unit} is used"
    return f"{plus_minus(scale * parameter.value, scale * parameter.stderr)} {unit}"


def _term(parameter: Parameter, power: int) -> str:
    sign = "−" if parameter.value < 0.0 else "+"
    error = MILLI * parameter.standard_error
    value = plus_minus(abs(MILLI * parameter.value), error)
    return f"{sign} ({value})" + (f" T{'⁰ ²³⁴⁵⁶'[power]}".rstrip() if power else "")


def _faults(result: CalibrationResult) -> list[str]:
    found = []
    if result.sensitivity_reason:
        what = "not determined" if result.calibration is None else "not fitted but taken as known"
        found.append(f"the sensitivity is {what}, {result.sensitivity_reason}")
    found += _of_the_sensor(result)
    hidden = _hidden(result)
    if hidden:
        found.append(f"not determined alone: {', '.join(hidden).replace('_', ' ')}")
    if result.full_scale and result.unit == "Nm" and result.cv_rmse > POOR * result.full_scale:
        found.append("a straight line and a drift do not describe these runs")
    if not result.uncertainty.reliable:
        found.append("the runs are too short for the errors to hold")
    warned = len([w for w in result.warnings if w != result.uncertainty.statement])
    if warned:
        found.append(f"{warned} warning{'s' if warned > 1 else ''}, see below")
    return found


def _of_the_sensor(result: CalibrationResult) -> list[str]:
    """What zero, gain and line are; of a channel with spikes nobody knows."""
    if result.spiked:
        return [f"single rows of {listed(result.spiked)} leap (repair drop_spikes)"]
    found = []
    if (delay := late_of(result)) is not None:
        way = "late" if delay.seconds > 0.0 else "early"
        size = plus_minus(1e3 * abs(delay.seconds), 1e3 * delay.error)
        found.append(f"the reference is {size} ms {way}")
    if _moved(result):
        found.append("the zero moved between the runs")
    if result.gain_test is not None and result.gain_test.changes:
        found.append("the gain changes with temperature")
    if (bend := bend_of(result)) is not None:
        found.append(f"a straight line is off by {percent_text(bend[0].percent or 0.0)} %FS")
    return found


def _missing(result: CalibrationResult) -> str:
    """Figures that runs with load might have shown; their variants go without saying."""
    if result.sensitivity_reason:
        return ""
    names = [f.name for f in result.figures if f.percent is None]
    plain = list(dict.fromkeys(name.split(",")[0] for name in names))
    if result.gain_test is None and result.shape.degree > 0:
        plain.append("gain against temperature")
    return f" These runs do not show: {', '.join(plain)}." if plain else ""


def _hidden(result: CalibrationResult) -> list[str]:
    """Names that the runs confound, but for drift among itself: its sum is known all the same."""
    groups = [g.names for g in result.confounded]
    return [n for g in groups if not all(name.startswith("drift") for name in g) for n in g]


def sized(result: CalibrationResult, size: float) -> str:
    """Return an error of reading with its unit: Nm, or mV without a sensitivity."""
    if result.unit == "V":
        return f"{digits(MILLI * size)} mV"
    return f"{digits(size)} Nm"


def digits(value: float) -> str:
    """Return a number to three digits, with a proper minus."""
    return padded(value).replace("-", "−")


def _fixed(value: float) -> str:
    return f"{value:.3f}" if value < 10.0 else f"{value:.4g}" if value < 1e4 else f"{value:.0f}"


def _of_scale(torque: float, full_scale: float) -> str:
    """Return a torque in per cent of the full scale, to two digits and in no power of ten."""
    return percent_text(100.0 * torque / full_scale)
