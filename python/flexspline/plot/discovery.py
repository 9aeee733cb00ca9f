"""Figures of a discovery: a held-out run, where the gap shrank, orders, and the run to record next.

A planned run is drawn as its command over time, with the information that is expected of it.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexspline.discovery.result import BY_NAMES
from flexspline.discovery.slices import telling
from flexspline.experiment.plan import ENOUGH
from flexspline.plot.canvas import (
    GREY,
    INK,
    LEAST,
    PALETTE,
    STRETCH,
    Panel,
    PlainFigure,
    axes_or_new,
    can_be_drawn,
    channel_label,
    finished,
    outline,
    panelled,
    part_of,
    plain,
    titled,
)
from flexspline.plot.orders import over_orders, spectrum_over

if TYPE_CHECKING:
    from flexspline.discovery.result import Discovery
    from flexspline.discovery.slices import HeldRun, Slice
    from flexspline.experiment.plan import Plan

__all__ = ["held_out_run", "left_over", "panels", "plot_discovery", "plot_plan", "shrunk"]

Array = NDArray[np.float64]

SWINGS = 60  # to and fro of what the names change, that can be looked at in one go
FEW = 0.02  # of all rows: a part of fewer says so
MOST_RUNS = 6
BEFORE, AFTER = PALETTE[3], PALETTE[0]

SHOWN_ALONE = {
    "run": "The stretch in which the residual is largest, predicted by fits without it.",
    "left": "The same stretch: measured less predicted.",
    "shrunk": "RMS on held-out folds, in parts of the runs and in bands of the residual{worst}; "
    "the dashed line is how low it could get over all rows.",
    "driven": "The run on which the forward simulation is worst: the model starts from the "
    "measured state and sees nothing but the inputs, by fits without the run. What friction is "
    "wrong about adds up here.",
    "orders": "Amplitude of the residual over orders of the output, on held-out folds.",
}
"""What to look for in the figures of a discovery that names nothing."""

LOOK_FOR = {
    "run": "The stretch in which the named effects change most, predicted by fits without "
    "it; short where they change fast. The extended model should lie on what was measured where "
    "the base does not.",
    "left": "The same stretch: measured less predicted. What is left should be noise about zero.",
    "shrunk": "RMS on held-out folds, before (open) and after (full), in parts of the runs "
    "and in bands of the residual{worst}; the dashed line is how low it could get over all rows.",
    "driven": "The run on which the forward simulation gained most, or lost least: both models "
    "start from the measured state and see nothing but the inputs, by fits without the run. "
    "What friction is wrong about adds up here.",
    "orders": "Amplitude of the residual over orders of the output, on held-out folds. "
    "Lines that the extended model no longer has are explained.",
}

CHANNELS = ("output_position", "output_velocity", "reference_torque", "temperature")


def plot_discovery(made: Discovery) -> PlainFigure:
    """Return a figure with a panel for each view that the runs allow."""
    return panelled(panels(made))


def panels(made: Discovery) -> list[Panel]:
    """Return the views that the runs allow."""
    said = LOOK_FOR if made.found else SHOWN_ALONE
    every = telling(made.slices)
    shown = _shown(every)
    worst = f", of the runs the {MOST_RUNS} worst" if len(shown) < len(every) else ""
    found = [
        Panel(partial(held_out_run, made), said["run"]),
        Panel(partial(left_over, made), said["left"]),
        Panel(partial(shrunk, made), said["shrunk"].format(worst=worst), _height(len(shown))),
    ]
    if made.motion is not None:
        found.append(Panel(partial(driven_forward, made), said["driven"]))
    if can_be_drawn(orders_before_after, made):
        found.append(Panel(partial(orders_before_after, made), said["orders"]))
    return found


def held_out_run(made: Discovery, ax: Axes | None = None) -> Axes:
    """Draw measured, base and extended model over the most telling seconds of a held-out run."""
    ax = axes_or_new(ax)
    run, some, models = _told_run(made)
    for label, values, colour, width in [("measured", run.measured, GREY, 1.6), *models]:
        _over_time(ax, run, some, values, color=colour, linewidth=width, label=label)
    ax.set_ylabel(f"{made.what.replace('_', ' ')} [{made.unit}]")
    part = part_of(run.log["time"], some)
    return finished(ax, f"Predicted without having seen it, {plain(run.log.name)}{part}")


def left_over(made: Discovery, ax: Axes | None = None) -> Axes:
    """Draw what base and extended model leave of the same seconds."""
    ax = axes_or_new(ax)
    run, some, models = _told_run(made)
    for label, values, colour, _ in models:
        left = run.measured - values
        _over_time(ax, run, some, left, color=colour, linewidth=0.8, label=label)
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set_ylabel(f"measured − predicted [{made.unit}]")
    return finished(ax, "What is left of it")


Line = tuple[str, Array, str, float]
"""Label, values, colour, width."""


def _told_run(made: Discovery) -> tuple[HeldRun, slice, list[Line]]:
    """The most telling run, the rows of it that are shown, and what the models say of it."""
    number, some = _telling(made)
    return made.runs[number], some, _models(made, made.runs[number])


def _models(made: Discovery, run: HeldRun) -> list[Line]:
    lines = [("base model", run.base, BEFORE, 1.0)]
    return [*lines, ("extended model", run.final, AFTER, 1.0)] if made.found else lines


def _over_time(ax: Axes, run: HeldRun, some: slice, values: Array, **how: Any) -> None:
    time = run.log["time"] - run.log["time"][0]
    at = outline(values[some]) + some.start
    ax.plot(time[at], values[at], **how)
    ax.set_xlabel("time since the start of the run [s]")


def driven_forward(made: Discovery, ax: Axes | None = None) -> Axes:
    """Draw measured less simulated motion of the run on which it shrank most, in its unit.

    Only for a discovery whose model can be driven forward.
    """
    assert made.motion is not None
    ax = axes_or_new(ax)

    def gain(run: HeldRun) -> float:
        before, after = (np.nansum((run.measured - m) ** 2) for m in (run.base, run.final))
        return float(before - after if made.found else before)

    run = max(made.motion.runs, key=gain)
    for label, values, colour, width in _models(made, run):
        left = run.measured - values
        _over_time(ax, run, slice(0, len(left)), left, color=colour, linewidth=width, label=label)
    ax.axhline(0.0, color=INK, linewidth=0.8)
    words = made.motion.channel.replace("_", " ")
    ax.set_ylabel(f"{words}, measured − simulated [{made.motion.unit}]")
    return finished(ax, f"Driven forward from its inputs: {plain(run.log.name)}")


def shrunk(made: Discovery, ax: Axes | None = None) -> Axes:
    """Draw the RMS before and after in each part of the runs and each band of the residual."""
    shown = _shown(telling(made.slices))
    ax = axes_or_new(ax, 6.0, _height(len(shown)))
    at = -np.arange(len(shown), dtype=np.float64)
    base, final = (np.array([getattr(s, key) for s in shown]) for key in ("base", "final"))
    floor = "all that is left" if made.floor.by == BY_NAMES else "noise floor"
    ax.axvline(made.noise_floor, color=INK, linewidth=0.8, linestyle="--", label=floor)
    ax.hlines(at, final, base, color=GREY, linewidth=1.2)
    ax.plot(
        base,
        at,
        "o",
        color=BEFORE,
        markerfacecolor="none",
        markersize=5,
        label="before" if made.found else "base model",
    )
    if made.found:
        ax.plot(final, at, "o", color=AFTER, markersize=4.5, label="after")
    whole = max(s.rows for s in shown)
    ax.set_yticks(at, [_label(s, s.rows < FEW * whole) for s in shown])
    ax.tick_params(axis="y", labelsize=LEAST, length=0)
    ax.set(xlabel=f"RMS on folds that no fit saw [{made.unit}]", xlim=(0.0, None))
    ax.set_ylim(at[-1] - 0.7, 0.7)
    return finished(
        ax, "By how much the gap shrank, and where" if made.found else "How large the gap is"
    )


def orders_before_after(made: Discovery, ax: Axes | None = None) -> Axes:
    """Draw the amplitude of both residuals over orders per output turn.

    Raises
    ------
    InputError
        Where the joint does not turn, or the runs hold no angle.
    """
    logs = [run.log for run in made.runs]
    left = {"base model": [run.measured - run.base for run in made.runs]}
    if made.found:
        left["extended model"] = [run.measured - run.final for run in made.runs]
    spectra = {label: spectrum_over(logs, values) for label, values in left.items()}
    ax = axes_or_new(ax)
    for (label, spectrum), look in zip(
        spectra.items(), ((BEFORE, 2.0), (AFTER, 0.9)), strict=False
    ):
        ax.plot(*spectrum, color=look[0], linewidth=look[1], label=label)
    over_orders(ax, spectra["base model"][0], made.unit)
    after = ", before and after" if made.found else ""
    return finished(ax, f"Orders of the residual{after}")


def _telling(made: Discovery) -> tuple[int, slice]:
    """The run and the rows in which the squares of the residual shrank most; held-out."""
    best, found, stretch = -np.inf, (0, slice(0, len(made.runs[0].log))), _stretch(made)
    for number, run in enumerate(made.runs):
        gain = np.nan_to_num((run.measured - run.base) ** 2)
        gain -= np.nan_to_num((run.measured - run.final) ** 2) if made.found else 0.0
        time = run.log["time"]
        last = np.searchsorted(time, time + stretch)
        total = np.concatenate([[0.0], np.cumsum(gain)])
        inside = total[last] - total[:-1]
        first = int(np.argmax(inside))
        if inside[first] > best:
            best, found = float(inside[first]), (number, slice(first, int(last[first])))
    return found


def _stretch(made: Discovery) -> float:
    """How many seconds can be looked at in one go: few where what the names change swings fast."""
    swings, seconds = 0, 0.0
    for run in made.runs:
        change = (run.final - run.base)[run.counts]
        swings += int(np.count_nonzero(np.diff(np.signbit(change - np.median(change)))))
        seconds += run.log.duration
    return min(STRETCH, SWINGS * seconds / swings) if swings and made.found else STRETCH


def _shown(every: tuple[Slice, ...]) -> list[Slice]:
    """All parts; of many runs the worst."""
    many = [s for s in every if s.group == "run"]
    worst = sorted(many, key=lambda s: -s.base)[:MOST_RUNS]
    return [s for s in every if s.group != "run" or len(many) <= MOST_RUNS or s in worst]


def _height(parts: int) -> float:
    """Inches that so many parts need below each other, with title and axis."""
    return 1.3 + 0.15 * parts


def _label(part: Slice, few: bool) -> str:
    if few:
        return f"{_label(part, few=False)} ({part.rows} rows)"
    named = part.group in ("all", "direction", "reversals", "order")
    if named or part.label.lower().startswith(part.group):
        return plain(part.label)
    return f"{part.group} {plain(part.label)}"


def plot_plan(made: Plan) -> PlainFigure:
    """Return a figure: commanded channels over time, and the separation that is expected."""
    shown = [name for name in CHANNELS if name in made.log]
    figure = PlainFigure(10.0, 1.7 * len(shown) + 1.2)
    left, right = figure.subfigures(1, 2, width_ratios=(2.2, 1.0), squeeze=False)[0]
    axes = left.subplots(len(shown), 1, sharex=True, squeeze=False).ravel()
    for ax, name in zip(axes, shown, strict=True):
        commanded_channel(made, name, ax)
        ax.set_xlabel("time [s]" if name == shown[-1] else "")
    titled(axes[0], "To be commanded")
    expected_separation(made, right.add_subplot())
    return figure


def commanded_channel(made: Plan, channel: str, ax: Axes | None = None) -> Axes:
    """Draw one channel of the trajectory; a wait for another temperature is a dotted line."""
    ax = axes_or_new(ax, 6.0, 2.0)
    time, values = _without_waits(made.log["time"], made.log[channel])
    ax.plot(time, values, color=PALETTE[0], linewidth=1.0)
    for wait in time[np.isnan(values)]:
        ax.axvline(wait, color=GREY, linewidth=1.0, linestyle=":")
    ax.set(ylabel=channel_label(channel).replace("output ", ""), xlabel="time [s]")
    return ax


def expected_separation(made: Plan, ax: Axes | None = None) -> Axes:
    """Draw what the first question stands at: now, with the best run of each kind, as planned."""
    ax = axes_or_new(ax, 4.0, 3.0)
    first = made.outlooks[0]
    if first.parameter:
        names, values = ["now", "planned"], [first.now, first.expected]
        ax.set_xlabel(f"standard error [{first.unit}]")
    else:
        others = sorted(made.kinds.items(), key=lambda item: item[1])
        names = ["now", *(name for name, _ in others), "planned"]
        values = [first.now, *(t for _, t in others), first.expected]
        ax.axvline(
            ENOUGH, color=GREY, linestyle="--", linewidth=1.0, label=f"distinguished: {ENOUGH:g}"
        )
        ax.set_xlabel("expected separation t [–]")
    shown = [v if np.isfinite(v) else 0.0 for v in values]
    colours = [GREY, *([PALETTE[5]] * (len(shown) - 2)), PALETTE[0]]
    ax.barh(names, shown, color=colours, height=0.6)
    for place, value in enumerate(values):
        said = f"{value:.3g}" if np.isfinite(value) else "not known"
        ax.annotate(f" {said}", (shown[place], place), va="center", fontsize=8, color=INK)
    return finished(ax, " or\n".join(first.names).replace("_", " "))


def _without_waits(time: Array, values: Array) -> tuple[Array, Array]:
    """Time (N,) with waits taken out, and values that are NaN there."""
    step = np.diff(time, prepend=time[0])
    usual = float(np.median(step[1:]))
    waits = np.flatnonzero(step > 60.0)
    kept = np.cumsum(np.where(step > 60.0, usual, step))
    return np.insert(kept, waits, kept[waits]), np.insert(values, waits, np.nan)
