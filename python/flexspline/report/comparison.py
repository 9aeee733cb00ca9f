"""A comparison as text and HTML: two sentences, the worst bands, the map, and all numbers.

Several models side by side as text and HTML: errors by run and of all rows, AIC and BIC.
"""

from __future__ import annotations

import os
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from flexspline.comparison.models import FITTED
from flexspline.comparison.result import floor_sentence, legible, ranked, sized
from flexspline.comparison.search import Band, worst_band
from flexspline.errors import listed
from flexspline.formatting import (
    blocks_text,
    decimals_for,
    padded,
    percent,
    rows_text,
    table_html,
)
from flexspline.plot.canvas import own_style
from flexspline.report.html import bandwidth_given, log_facts, templates, write_html
from flexspline.report.tables import input_rows, smoothed_rows
from flexspline.report.text import TARGET_WORDS, wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flexspline.comparison.models import ModelComparison
    from flexspline.comparison.result import Comparison

__all__ = [
    "comparison_html",
    "comparison_text",
    "followed",
    "models_html",
    "models_text",
    "write_comparison_report",
    "write_models_report",
]


WIDTH = 100
WORDS = (0, 1)  # columns of words; the others are numbers

MAP = (
    "RMS of measured − modelled (line) in each band against the noise floor there (grey, with "
    "two standard errors); what lies between is the excess, coloured, and a dot marks an excess "
    "that is more than chance. All panels have the same scale; what the gap follows comes first. "
    "Bands are drawn equally wide, whatever they span: read their ends. "
    "Hatched: fewer than 2 % of the rows."
)
ORDERS = (
    "Amplitude of the residual over the orders of each pair of parts. Marks are orders that stand "
    "out of the noise of their own stretches, with two standard errors; noise alone marks one in a "
    "hundred searches. Slow or short runs make lines wide."
)

Row = tuple[str, ...]

LEAST_CHANCE = 1e-9
LONGEST_LABEL = 34
MOST_ORDERS = 8

MOST_RUNS = 12
OWN, BEST = "†", "*"
CRITERIA = (
    "AIC and BIC are of the rows that the fits were made of, in each fit's own noise; lower is "
    "better, and a difference below 2 tells nothing."
)


def comparison_text(made: Comparison) -> str:
    """Return what `print(comparison)` shows, lines of at most 120 characters."""
    blocks = [
        [line for sentence in made.sentences for line in _wrapped(sentence)],
        [line for sentence in base_told(made) for line in _wrapped(sentence)],
        [rows_text(worst_rows(made), WORDS)],
        [x for k, said in enumerate(followed(made), start=1) for x in _wrapped(f"{k}. {said}")],
        [rows_text(order_rows(made), WORDS)] if made.orders else [],
        _wrapped(floor_sentence(made)),
        _channels(made),
    ]
    return blocks_text(blocks)


def _channels(made: Comparison) -> list[str]:
    """Noisy channels as the model read them; nothing of exact runs."""
    read = [way.channel for way in made.preparations]
    rows = smoothed_rows(made.inputs, made.preparations, read)
    return ["Noisy channels:", rows_text(rows, WORDS)] if rows else []


def comparison_html(made: Comparison) -> str:
    """Return a comparison as a fragment of HTML without scripts, for notebooks."""
    return templates().get_template("comparison_fragment.html").render(_common(made))


@own_style()
def write_comparison_report(made: Comparison, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.comparison import panels, plot_comparison, plot_orders
    from flexspline.report.html import ReportFigure, inline_svg

    charts = [ReportFigure(inline_svg(plot_comparison(made), "map of the disagreement"), MAP)]
    if made.spectrum is not None:
        charts.append(ReportFigure(inline_svg(plot_orders(made), "orders of the residual"), ORDERS))
    write_html(
        path,
        "comparison.html",
        _common(made),
        title=str(made.facts.get("joint", "Model and measurement compared")),
        map=charts[0],
        spectra=charts[1:],
        panels=len(panels(made)),
        tables=band_tables(made),
        channels=input_rows(made.inputs, made.preparations),
        delay="",
        logs=log_facts([run.log for run in made.runs]),
        call=_call(made),
    )


def _common(made: Comparison) -> dict[str, Any]:
    return {
        "sentences": made.sentences,
        "critical": bool(made.follows or made.is_short),
        "worst": worst_rows(made),
        "followed": followed(made),
        "orders": order_rows(made) if made.orders else [],
        "floor": floor_sentence(made),
        "notes": base_told(made),
        "load": made.load_source,
        "kind": _kind(made),
        "what": made.what.replace("_", " "),
        "unit": made.unit,
        "names": ranked(made),
    }


def _kind(made: Comparison) -> str:
    if made.foreign:
        return "a foreign simulation"
    return "forward simulation" if made.simulated else "prediction"


def _wrapped(sentence: str) -> list[str]:
    return textwrap.wrap(sentence, WIDTH, break_long_words=False, break_on_hyphens=False)


def _call(made: Comparison) -> str:
    foreign = bool(made.foreign)
    given = ["None" if foreign else "model", "logs"]
    if not made.simulated:
        given.append(f"target={made.what!r}")
    if foreign and "the runs" not in made.foreign:
        given.append("simulation=simulation")
    if foreign:
        given.append("simulated_motion=True" if made.simulated else "simulated_torque=column")
    if made.lowpass is not None:
        given.append(f"lowpass={made.lowpass!r}")
    given += bandwidth_given(made.bandwidth)
    if made.speed_above is not None:
        given.append(f"speed_above={made.speed_above!r}")
    if made.simulated and not foreign:
        given.append("simulated=True")
    return f"comparison = flexspline.compare({', '.join(given)})"


def base_told(made: Comparison) -> list[str]:
    """Return what there is to say of a foreign simulation that is the base, and of the rows."""
    if not made.foreign:
        return [*made.notes]
    return [f"The base is what a simulation says: {made.foreign}.", *made.notes]


def worst_rows(made: Comparison) -> list[Row]:
    """Return heading and rows: all rows, then the band of each covariate that exceeds most."""
    unit = made.unit
    head = ("largest excess over", "", "rows", f"RMSE [{unit}]", "noise floor", "excess", "bias")
    rows = [head, ("all rows", "", *_numbers(made.overall, made.noise_floor))]
    for name in ranked(made):
        band = worst_band(made.by[name])
        label = _short(band.label)
        rows.append((made.words[name], label, *_numbers(band, made.noise_floor)))
    return rows


def followed(made: Comparison) -> list[str]:
    """Return a sentence for each thing that the gap follows."""
    return [
        f"follows {f.words}: {percent(min(f.share, 1.0))} of the gap's square above the floor, "
        f"chance {_chance(f.chance)}"
        + (f"; nearly as well: {', '.join(f.also)}" if f.also else "")
        + "."
        for f in made.follows
    ]


def order_rows(made: Comparison) -> list[Row]:
    """Return heading and rows of the orders found."""
    head = ("order per output turn", "what turns", f"amplitude [{made.unit}]", "chance")
    found: list[Row] = [head]
    for peak in made.orders[:MOST_ORDERS]:
        size = f"{sized(peak.amplitude, peak.error)} ± {sized(peak.error, peak.error)}"
        found.append((f"{peak.per_output_turn:.6g}", peak.label, size, _chance(peak.chance)))
    return found


def band_tables(made: Comparison) -> list[tuple[str, list[Row]]]:
    """Return title and rows of every covariate, for the report."""
    floor = made.noise_floor
    return [
        (
            made.words[name],
            [
                (band.label, *_numbers(band, floor), padded(band.variance),
                 f"{band.effective_rows:.0f}", _chance(band.chance) if band.significant else "–")
                for band in made.by[name]
            ],
        )
        for name in ranked(made)
    ]  # fmt: skip


def _numbers(band: Band, floor: float) -> Row:
    error = f" ± {sized(band.noise_floor_error, 0.1 * floor)}"
    return (
        str(band.rows),
        legible(band.rmse, 0.1 * floor),
        sized(band.noise_floor, 0.1 * floor) + error,
        legible(band.excess, 0.1 * floor) if band.significant else "–",
        legible(band.bias, 0.1 * floor),
    )


def _short(label: str) -> str:
    return label if len(label) <= LONGEST_LABEL else label[: LONGEST_LABEL - 2] + " …"


def _chance(chance: float) -> str:
    return f"{chance:.0e}" if chance >= LEAST_CHANCE else "below 1e-09"


def models_text(made: ModelComparison) -> str:
    """Return what `print(comparison)` shows."""
    table = rows_text(_rows(made))
    notes = [line for sentence in [_verdict(made), *_notes(made)] for line in wrapped(sentence)]
    return "\n\n".join(["\n".join(wrapped(_title(made))), table, "\n".join(notes)])


def models_html(made: ModelComparison) -> str:
    """Return the same as a fragment of HTML."""
    return table_html(_title(made), _rows(made), [_verdict(made), *_notes(made)])


@own_style()
def write_models_report(made: ModelComparison, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.comparison import model_panels
    from flexspline.report.html import drawn

    write_html(
        path,
        "models.html",
        what=TARGET_WORDS[made.target],
        names=made.names,
        verdict=_verdict(made),
        title=_title(made),
        errors=_rows(made),
        notes=_notes(made),
        figures=[drawn(panel) for panel in model_panels(made)],
        logs=log_facts([run.log for run in made.runs]),
        call=_models_call(made),
    )


def _verdict(made: ModelComparison) -> str:
    """Which model has the lowest error over all rows, of those whose errors can be compared."""
    errors, digits = made.errors()[-1], decimals_for(float(np.nanmin(made.errors())))
    rivals, over = [k for k, kind in enumerate(made.kinds()[-1]) if kind != FITTED], "all rows"
    if len(rivals) < 2:
        runs, errors = made.unseen()
        if not runs or len(made.names) < 2:
            return (
                "These errors say nothing of which model is better: see what kind of error each is."
            )
        rivals, over = [*range(len(made.names))], f"{listed(runs, 3)}, which no model was fitted to"
    ranked = sorted(rivals, key=lambda k: errors[k])
    best, rest = ranked[0], ranked[1:]
    others = listed([f"{made.names[k]} {errors[k]:.{digits}f}" for k in rest])
    said = f"Lowest error over {over}: {made.names[best]}, {errors[best]:.{digits}f} {made.unit}"
    return f"{said}; {others}."


def _models_call(made: ModelComparison) -> str:
    lowpass = "" if made.lowpass is None else f", lowpass={made.lowpass!r}"
    return f"comparison = flexspline.compare_models(models, logs, target={made.target!r}{lowpass})"


def _title(made: ModelComparison) -> str:
    smoothed = "" if made.lowpass is None else f", low-passed at {made.lowpass:g} Hz"
    return f"RMSE of the {TARGET_WORDS[made.target]} [{made.unit}]{smoothed}, {made.rows} rows"


def _rows(made: ModelComparison) -> list[tuple[str, ...]]:
    errors, kinds = made.errors(), made.kinds()
    digits = decimals_for(float(np.nanmin(errors)))
    labels = [run.log.name for run in made.runs]
    shown = list(range(len(labels)))
    if len(labels) > MOST_RUNS:  # the worst
        worst = np.argsort(-np.nan_to_num(errors[:-1].max(axis=1)), kind="stable")[:MOST_RUNS]
        shown = sorted(worst.tolist())
    alike = len(set(kinds)) == 1
    rows = [("", *made.names), *([("kind of error", *kinds[-1])] if alike else [])]
    for at in [*shown, len(labels)]:
        label = labels[at] if at < len(labels) else "all rows"
        own = np.array([kind == FITTED for kind in kinds[at]])
        rows.append((label, *_cells(np.round(errors[at], digits), own, digits)))
    if not alike:
        rows.append(("kind over all rows", *kinds[-1]))
    for label, values in (("AIC", made.aic), ("BIC", made.bic)):
        if np.isfinite(values).any():
            rows.append((label, *_cells(np.round(values, 1), np.isnan(values), 1)))
    return rows


def _cells(values: NDArray[np.float64], own: NDArray[np.bool_], digits: int) -> list[str]:
    """Numbers with a mark each: the best of those that can be compared, and those that cannot."""
    rivals = values[~own & np.isfinite(values)]
    best = rivals.min() if len(rivals) > 1 else np.nan
    cells = []
    for value, apart in zip(values, own, strict=True):
        mark = OWN if apart else BEST if value == best else " "
        cells.append(f"{value:.{digits}f} {mark}" if np.isfinite(value) else "–  ")
    return cells


def _notes(made: ModelComparison) -> list[str]:
    starred = any(BEST in cell for row in _rows(made)[1:] for cell in row[1:])
    said = [f"{BEST} lowest of its row"] if starred else []
    if len(made.runs) > MOST_RUNS:
        said.append(f"The {MOST_RUNS} worst of {len(made.runs)} runs are shown.")
    if np.isfinite(made.aic).any():
        said.append(CRITERIA)
    return [*said, *made.notes]
