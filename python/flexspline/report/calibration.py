"""A calibration as text and HTML: a verdict, parameters, figures in %FS, and what is wrong."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from flexspline.about import __version__
from flexspline.files import atomic_write
from flexspline.formatting.numbers import short
from flexspline.report.calibration_content import (
    calibration_lines,
    calibration_verdict,
    figure_rows,
    scale_line,
    sized,
    told,
)
from flexspline.report.html import templates

if TYPE_CHECKING:
    from flexspline.calibration.result import CalibrationResult

__all__ = ["calibration_html", "calibration_text", "write_calibration_report"]

WIDTH = 100


def calibration_text(result: CalibrationResult) -> str:
    """Return what `print(result)` shows."""
    judged = calibration_verdict(result)
    blocks = [
        [*_wrapped(judged.good), *_wrapped(judged.wrong)],
        _parameter_text(result),
        _figure_text(result),
        [line for sentence in told(result) for line in _wrapped(sentence)],
        _listed("Warnings:", [w for w in result.warnings if w != result.uncertainty.statement]),
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block)


def calibration_html(result: CalibrationResult) -> str:
    """Return a calibration as a fragment of HTML without scripts, for notebooks."""
    return templates().get_template("calibration_fragment.html").render(_common(result))


def write_calibration_report(result: CalibrationResult, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.calibration import panels  # matplotlib only where it draws
    from flexspline.report.figures import drawn

    joint = result.model.facts.get("joint", result.runs[0].log.facts.get("joint"))
    page = (
        templates()
        .get_template("calibration.html")
        .render(
            _common(result),
            title=str(joint or "Calibration of the torque sensor"),
            charts=[drawn(panel) for panel in panels(result)],
            folds=[
                (label, sized(result, rmse))
                for label, rmse in zip(result.fold_labels, result.fold_rmses, strict=True)
            ],
            logs=_logs(result),
            call=_call(result),
        )
    )
    atomic_write(path, page)


def _parameter_text(result: CalibrationResult) -> list[str]:
    lines = calibration_lines(result)
    head = ("parameter", "value ± standard error", "in volts", "")
    rows = [head, *((x.name, x.torque, x.voltage, x.remark) for x in lines)]
    return _table(rows)


def _figure_text(result: CalibrationResult) -> list[str]:
    return [scale_line(result), *_table([row[:4] for row in figure_rows(result)])]


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
        "scale": scale_line(result),
        "figures": figure_rows(result),
        "told": told(result),
        "groups": [group.sentence for group in result.confounded],
        "reliable": result.uncertainty.reliable,
        "warnings": [w for w in result.warnings if w != result.uncertainty.statement],
        "version": __version__,
    }


def _logs(result: CalibrationResult) -> list[dict[str, Any]]:
    return [
        {
            "name": run.log.name,
            "rows": f"{len(run.log)} rows, {short(run.log.duration, 4)} s at "
            f"{short(run.log.rate, 4)} Hz",
            "path": run.log.source.path if run.log.source else "not from a file",
            "sha256": run.log.source.sha256 if run.log.source else "",
            "history": list(run.log.history),
        }
        for run in result.runs
    ]


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
    if result.full_scale_source == "given":
        given.append(f"full_scale={result.full_scale!r}")
    lines = "".join(f"    {argument},\n" for argument in ["logs", *given])
    return f"result = flexspline.calibrate(\n{lines})"
