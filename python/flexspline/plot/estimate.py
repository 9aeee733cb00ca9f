"""External torques drawn: over time as each estimator sees them, full range, contacts, gains.

Figures 7, 8 and 9 are those of full_range_torque_estimation. Thresholds of contacts stand against
what was seen, gains of the momentum observer against what they cost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from flexspline.collision.result import DetectorCalibration, Residual
from flexspline.estimation import Estimate, Status
from flexspline.logs.log import Log
from flexspline.logs.segments import true_ranges
from flexspline.observer import observer_delay, observer_noise
from flexspline.plot.canvas import (
    GREY,
    INK,
    PALETTE,
    PlainFigure,
    axes_or_new,
    channel_label,
    finished,
    log_axis,
    outline,
    titled,
)

if TYPE_CHECKING:
    from flexspline.full_range.methods import Transition
    from flexspline.full_range.result import FullRange, SpeedCurve

__all__ = [
    "contacts_over_time",
    "error_over_speed",
    "observer_gain",
    "plot_estimate",
    "thresholds_of_joints",
    "torque_by_method",
    "validation",
]

PREFIX = "external_torque_"

Array = NDArray[np.float64]

MOST = 4000  # points of a line
WORDS = {"o": "observer", "m": "merged", "c": "compliance"}


def plot_estimate(made: Estimate) -> Figure:
    """Return a figure: external torques with contacts shaded, and below it what is flagged."""
    figure = PlainFigure(9.0, 5.2)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    external_torques(made, above)
    above.set_xlabel("")
    status_bits(made, below)
    return figure


def external_torques(made: Estimate, ax: Axes | None = None) -> Axes:
    """Draw each external torque over time; contacts are shaded."""
    ax = axes_or_new(ax)
    time = made["time"]
    names = [name for name in made.columns if name.startswith(PREFIX)]
    for colour, name in zip(PALETTE, names, strict=False):
        if np.isfinite(made[name]).any():
            rows = outline(made[name])
            label = name.removeprefix(PREFIX)
            ax.plot(time[rows], made[name][rows], color=colour, linewidth=0.9, label=label)
    for start, end in made.contacts:
        ax.axvspan(start, end, color=GREY, alpha=0.25, linewidth=0)
    ax.set_xlabel(channel_label("time"))
    ax.set_ylabel("external torque [Nm]")
    return finished(ax, f"{made.name}: external torque at the output")


def status_bits(made: Estimate, ax: Axes | None = None) -> Axes:
    """Draw a mark at each row that has a bit of the status, a line for each bit that occurs."""
    ax = axes_or_new(ax, height=1.6)
    time = made["time"]
    found = [bit for bit in Status if made.flagged(bit).any()]
    for line, bit in enumerate(found):
        rows = np.flatnonzero(made.flagged(bit))
        rows = rows[outline(rows.astype(np.float64))]
        ax.plot(time[rows], np.full(rows.size, line), "|", color=PALETTE[3], markersize=7)
    ax.set_yticks(range(len(found)), [str(bit.name).lower().replace("_", " ") for bit in found])
    ax.set_ylim(-0.6, max(len(found), 1) - 0.4)
    ax.set_xlabel(channel_label("time"))
    return ax


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
    log_axis(ax, "x")
    ax.set_ylim(bottom=0.0)
    ax.set(
        xlabel="speed at the output, first point: at rest [rad/s]",
        ylabel="RMSE of the external torque [Nm]",
    )
    return finished(ax, f"Error over speed; bars: {curve.repetitions}")


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
    return finished(ax, f"External torque of {log.name}")


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
    return finished(axes, "Thresholds of the collision detector")


def observer_gain(
    period: float,
    *,
    torque_noise: float,
    velocity_noise: float = 0.0,
    inertia: float = 0.0,
    gains: ArrayLike | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw delay and noise of the estimate over the gain, exact and by forward Euler.

    Parameters
    ----------
    period : s, between samples.
    torque_noise, velocity_noise, inertia : as for `observer_noise`; Nm, rad/s, kg m².
    gains : 1/s; default: gain · period of 0.01 to 1.9.
    ax : axes to draw on; default: those of a new figure.

    Raises
    ------
    InputError
        Where a gain or the period is not above zero, or Euler cannot be stable.
    """
    at = np.geomspace(0.01, 1.9, 80) / period if gains is None else np.asarray(gains, dtype=float)
    noise: dict[str, Any] = {
        "torque_noise": torque_noise,
        "velocity_noise": velocity_noise,
        "inertia": inertia,
    }
    axes = axes_or_new(ax)
    beside = axes_or_new(axes.twinx())
    beside.grid(False)
    beside.spines["right"].set(visible=True, color=INK)
    for name, style in (("exact", "-"), ("euler", "--")):
        late = 1e3 * observer_delay(at, period, name)
        spread = observer_noise(at, period, name, **noise)
        axes.plot(at, late, style, color=PALETTE[0], label=f"delay, {name}")
        axes.plot([], [], style, color=PALETTE[3], label=f"noise, {name}")
        beside.plot(at, spread, style, color=PALETTE[3])
    axes.axvline(1.0 / period, color=GREY, linewidth=0.8, linestyle=":")
    log_axis(axes, "x")
    for one in (axes, beside):
        log_axis(one, "y")
    axes.set_xlabel("gain K [1/s]")
    axes.set_ylabel("delay [ms]")
    beside.set_ylabel("noise of the external torque [Nm RMS]")
    return finished(axes, "Momentum observer: delay against noise; dotted: gain · period = 1")
