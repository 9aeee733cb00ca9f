"""Figures of the full-range estimate: 7, 8 and 9 of full_range_torque_estimation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexspline.logs.log import Log
from flexspline.plot.canvas import GREY, INK, PALETTE, PlainFigure, axes_or_new, legend, titled
from flexspline.plot.thin import outline

if TYPE_CHECKING:
    from flexspline.full_range.result import FullRange, SpeedCurve
    from flexspline.full_range.transition import Transition

__all__ = ["error_over_speed", "torque_by_method", "validation"]

Array = NDArray[np.float64]

MOST = 4000  # points of a line
WORDS = {"o": "observer", "m": "merged", "c": "compliance"}


def error_over_speed(
    curve: SpeedCurve,
    ax: Axes | None = None,
    *,
    methods: Sequence[str] | None = None,
    transition: Transition | None = None,
) -> Axes:
    """Draw RMSE against speed with its spread, and the chosen transition (Fig. 7).

    Parameters
    ----------
    curve : of the training logs.
    methods : which; None for observer and compliance.
    transition : marked with its 95 % interval; None for no mark.
    """
    ax = axes_or_new(ax, 6.4, 4.0)
    chosen = list(methods or [name for name in curve.rmse if name == "o" or _numbered(name, "c")])
    shown = np.array([curve.edges[0], *np.sqrt(curve.edges[1:-1] * curve.edges[2:])])
    shown[0] = 0.5 * curve.edges[1]
    for number, name in enumerate(chosen):
        colour = PALETTE[number % len(PALETTE)]
        shift = shown * (1.0 + 0.02 * (number - (len(chosen) - 1) / 2))
        ax.errorbar(
            shift,
            curve.rmse[name],
            yerr=np.nan_to_num(curve.spread[name]),
            color=colour,
            marker="o",
            markersize=4,
            capsize=3,
            linewidth=1.4,
            elinewidth=0.9,
            label=_word(name),
        )
    if transition is not None:
        _mark(ax, transition, float(shown[0]))
    ax.set_xscale("log")
    ax.set_ylim(bottom=0.0)
    ax.set(
        xlabel="speed at the output, first point: at rest [rad/s]",
        ylabel="RMSE of the external torque [Nm]",
    )
    titled(ax, f"Error over speed; bars: {curve.repetitions}")
    legend(ax)
    return ax


def validation(trained: FullRange, log: Log) -> Figure:
    """Return torque, torsion, velocity and motor torque over time with the transition (Fig. 8)."""
    figure = PlainFigure(9.0, 7.6)
    axes = figure.subplots(4, 1, sharex=True)
    drawn = trained.drawn(log)
    time = drawn["time"]
    shaded = outline(drawn["weight"], MOST)
    rows = (
        ("reference", 1.0, "external torque τ_e [Nm]"),
        ("torsion", 1e3, "torsion Δθ [mrad]"),
        ("velocity", 1.0, "velocity q̇ [rad/s]"),
        ("motor_torque", 1e3, "motor torque τ_m [mNm]"),
    )
    for ax, (name, scale, label) in zip(axes, rows, strict=True):
        axes_or_new(ax)
        values = scale * drawn[name]
        at = outline(values, MOST)
        ax.plot(time[at], values[at], color=PALETTE[0], linewidth=1.0)
        low, high = ax.get_ylim()
        height = low + (high - low) * drawn["weight"][shaded]
        ax.fill_between(time[shaded], low, height, color=GREY, alpha=0.22, linewidth=0, step="mid")
        ax.set_ylim(low, high)
        ax.set_ylabel(label, fontsize=8.5)
    axes[-1].set_xlabel("time [s]")
    titled(axes[0], f"{log.name}: shaded to the height of λ(q̇), empty at rest, full in motion")
    return figure


def torque_by_method(
    trained: FullRange, log: Log, ax: Axes | None = None, *, methods: Sequence[str] | None = None
) -> Axes:
    """Draw the reference and the estimates over time (Fig. 9).

    Parameters
    ----------
    trained : by `flexspline.full_range.train`.
    log : with the training's channels; its reference is drawn where it has one.
    methods : which; None for observer, compliance and merged.
    """
    ax = axes_or_new(ax, 9.0, 4.4)
    estimates = trained.estimates(log)
    kept = trained.kept
    chosen = list(methods or ("o", f"c{kept}", f"m{kept}"))
    time = log["time"]
    if trained.reference in log:
        _line(ax, time, log[trained.reference], INK, "reference", 2.2)
    for number, name in enumerate(chosen):
        _line(ax, time, estimates[name], PALETTE[number % len(PALETTE)], _word(name), 1.0)
    _limit(ax, {name: estimates[name] for name in chosen}, log, trained.reference)
    ax.set(xlabel="time [s]", ylabel="external torque, outward [Nm]")
    titled(ax, f"External torque of {log.name}")
    legend(ax, columns=len(chosen) + 1)
    return ax


def _line(ax: Axes, time: Array, values: Array, colour: str, label: str, width: float) -> None:
    at = outline(values, MOST)
    ax.plot(time[at], values[at], color=colour, linewidth=width, label=label, alpha=0.9)


def _limit(ax: Axes, estimates: Mapping[str, Array], log: Log, reference: str) -> None:
    """Show what the torque is, not the farthest spike of the worst method."""
    every = [*estimates.values(), *([log[reference]] if reference in log else [])]
    ends = np.nanquantile(np.concatenate(every), [0.002, 0.998])
    margin = 0.15 * float(ends[1] - ends[0])
    ax.set_ylim(float(ends[0]) - margin, float(ends[1]) + 1.6 * margin)


def _mark(ax: Axes, transition: Transition, least: float) -> None:
    """The transition velocity as a line, its interval as a band; what is below the axis at its
    left end."""
    low, high = (max(v, 0.7 * least) for v in transition.velocity_interval)
    ax.axvspan(low, high, color=GREY, alpha=0.25, linewidth=0)
    ax.axvline(
        max(transition.transition_velocity, 0.7 * least),
        color=INK,
        linewidth=1.0,
        linestyle="--",
        label=f"q̇_trans = {transition.transition_velocity:.3g} rad/s (95 %: shaded)",
    )


def _word(name: str) -> str:
    """What a method's letter means."""
    return f"{WORDS[name[0]]} {name}" if any(_numbered(name, w) for w in WORDS) else name


def _numbered(name: str, letter: str) -> bool:
    """Whether a name is this letter, or it with a number."""
    return name == letter or (name[0] == letter and name[1:].isdigit())
