"""A simulated run in words."""

from __future__ import annotations

import html

import numpy as np

from flexspline.forward.result import ForwardRun

__all__ = ["run_html", "run_text"]


def run_text(run: ForwardRun) -> str:
    """Return the gap between measured and simulated, its worst row, and how it was integrated."""
    return "\n".join([f"{run.log.name}: {run.channel} simulated", *(f"  {s}" for s in _said(run))])


def run_html(run: ForwardRun) -> str:
    """Return the same for a notebook."""
    items = "".join(f"<li>{html.escape(said)}</li>" for said in _said(run))
    head = html.escape(f"{run.log.name}: {run.channel} simulated")
    return f"<p><b>{head}</b></p><ul>{items}</ul>"


def _said(run: ForwardRun) -> list[str]:
    said = [_gap(run)]
    if run.stuck is not None:
        held = 100.0 * float(np.mean(run.stuck))
        steps = f"{run.steps_per_sample} steps from row to row"
        if np.isfinite(run.step_error):
            steps += f"; half of them change it by {run.step_error:.2g} {run.unit} RMS"
        said += [f"friction holds the joint on {held:.3g} % of {len(run.log)} rows", steps]
    return [*said, *run.notes]


def _gap(run: ForwardRun) -> str:
    if not np.isfinite(run.rmse):
        return f"nothing measured to compare with on {len(run.log)} rows"
    worst = int(np.nanargmax(np.abs(run.residual)))
    moves = float(np.nanstd(run.measured))
    return (
        f"RMSE {run.rmse:.4g} {run.unit} (the measured one varies by {moves:.3g} {run.unit}), at "
        f"most {abs(run.residual[worst]):.3g} {run.unit} at {run.log['time'][worst]:.4g} s"
    )
