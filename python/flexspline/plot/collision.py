"""Residuals, thresholds and contacts over time; thresholds against what was seen."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from flexspline.collision.residual import Residual
from flexspline.collision.result import DetectorCalibration
from flexspline.logs.segments import true_ranges
from flexspline.plot.canvas import INK, PALETTE, axes_or_new, legend, titled

__all__ = ["contacts_over_time", "thresholds_of_joints"]


def contacts_over_time(
    detector: DetectorCalibration, residual: Residual, joint: int = 1, *, ax: Axes | None = None
) -> Axes:
    """Draw one joint's residual, the thresholds that hold at its speed, and the contacts found.

    Parameters
    ----------
    detector : from `calibrate_detector`.
    residual : one run.
    joint : 1 to n.
    ax : axes to draw on; default: those of a new figure.

    Raises
    ------
    InputError
        Where the residual has other joints or another unit than the detector.
    """
    axes = axes_or_new(ax)
    contact = detector.detect(residual)[:, joint - 1]
    band = np.searchsorted(detector.speed_edges, residual.speed[:, joint - 1], side="right")
    axes.plot(residual.time, residual.values[:, joint - 1], color=INK, linewidth=0.8)
    for direction in (-1, 1):
        levels = direction * np.array(detector.values(joint, direction))[band]
        axes.step(residual.time, levels, where="post", color=PALETTE[3], linewidth=0.9)
    for first, last in true_ranges(contact):
        axes.axvspan(
            residual.time[first], residual.time[last - 1], color=PALETTE[1], alpha=0.3, linewidth=0
        )
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"residual [{residual.unit}]")
    titled(axes, f"{residual.name}, joint {joint}: thresholds in red, contacts shaded")
    return axes


def thresholds_of_joints(detector: DetectorCalibration, *, ax: Axes | None = None) -> Axes:
    """Draw every threshold beside the likely one, the largest value and the paper's rule.

    Parameters
    ----------
    detector : from `calibrate_detector`.
    ax : axes to draw on; default: those of a new figure.
    """
    axes = axes_or_new(ax)
    at = np.arange(len(detector.thresholds))
    for label, marker, colour, values in (
        ("threshold", "_", PALETTE[3], [t.value for t in detector.thresholds]),
        (
            "most likely for the stated rate",
            "x",
            PALETTE[0],
            [t.likely for t in detector.thresholds],
        ),
        ("largest value · 1.18 (paper)", "+", PALETTE[2], [t.paper for t in detector.thresholds]),
        ("largest value", ".", INK, [t.largest for t in detector.thresholds]),
    ):
        if np.isfinite(values).any():
            axes.plot(at, values, linestyle="", marker=marker, color=colour, label=label)
    names = [f"{t.joint}{'+' if t.direction > 0 else '−'} {t.band}" for t in detector.thresholds]
    axes.set_xticks(at, names, rotation=90)
    axes.set_xlabel("joint, direction, band of speed")
    axes.set_ylabel(f"residual [{detector.unit}]")
    titled(axes, "Thresholds of the collision detector")
    legend(axes)
    return axes
