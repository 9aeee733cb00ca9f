"""Several models side by side as text and HTML: errors by run and of all rows, AIC and BIC."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from flexspline.about import __version__
from flexspline.comparison.models import FITTED
from flexspline.errors import listed
from flexspline.files import atomic_write
from flexspline.formatting import decimals_for, rows_text, table_html
from flexspline.plot.canvas import own_style
from flexspline.report.text import TARGET_WORDS, wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flexspline.comparison.models import ModelComparison

__all__ = ["models_html", "models_text", "write_models_report"]

MOST_RUNS = 12
OWN, BEST = "†", "*"
CRITERIA = (
    "AIC and BIC are of the rows that the fits were made of, in each fit's own noise; lower is "
    "better, and a difference below 2 tells nothing."
)


def models_text(made: ModelComparison) -> str:
    """Return what `print(comparison)` shows."""
    table = rows_text(_rows(made))
    notes = [line for sentence in _notes(made) for line in wrapped(sentence)]
    return "\n\n".join(["\n".join(wrapped(_title(made))), table, "\n".join(notes)])


def models_html(made: ModelComparison) -> str:
    """Return the same as a fragment of HTML."""
    return table_html(_title(made), _rows(made), _notes(made))


@own_style()
def write_models_report(made: ModelComparison, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.models import panels
    from flexspline.report.html import drawn, log_facts, templates

    page = (
        templates()
        .get_template("models.html")
        .render(
            what=TARGET_WORDS[made.target],
            names=made.names,
            verdict=_verdict(made),
            title=_title(made),
            table=_rows(made),
            notes=_notes(made),
            figures=[drawn(panel) for panel in panels(made)],
            logs=log_facts([run.log for run in made.runs]),
            call=_call(made),
            version=__version__,
        )
    )
    atomic_write(path, page)


def _verdict(made: ModelComparison) -> str:
    """Which model has the lowest error over all rows, of those whose errors can be compared."""
    errors, digits = made.errors()[-1], decimals_for(float(np.nanmin(made.errors())))
    rivals = [k for k, kind in enumerate(made.kinds()[-1]) if kind != FITTED]
    if len(rivals) < 2:
        return "These errors say nothing of which model is better: see what kind of error each is."
    ranked = sorted(rivals, key=lambda k: errors[k])
    best, rest = ranked[0], ranked[1:]
    others = listed([f"{made.names[k]} {errors[k]:.{digits}f}" for k in rest])
    said = f"Lowest error over all rows: {made.names[best]}, {errors[best]:.{digits}f} {made.unit}"
    return f"{said}; {others}."


def _call(made: ModelComparison) -> str:
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
    rows = [("", *made.names), ("kind of error", *kinds[-1])]
    for at in [*shown, len(labels)]:
        label = labels[at] if at < len(labels) else "all rows"
        own = np.array([kind == FITTED for kind in kinds[at]])
        rows.append((label, *_cells(np.round(errors[at], digits), own, digits)))
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
