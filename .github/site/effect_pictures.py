"""The picture of an effect: what the core computes of it while one channel is swept.

An effect that remembers is led there and back; another gets a curve for each of its coefficients,
or, where it reads a second channel, one for each of three values of that.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexspline.effects import TARGETS, Effect, EffectInfo, effect
from flexspline.logs.channels import CHANNELS, Channel
from flexspline.logs.log import Log
from flexspline.model import PART_OF, Model, Part

Array = NDArray[np.float64]
Curve = tuple[Array, Array, str]

LOAD = "reference_torque"
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}
ROWS, RATE = 2401, 100.0
ORDER = 2  # periods per turn, where an effect has orders
TURN = 2.0 * np.pi
SPANS = {
    "output_position": (0.0, TURN),
    "motor_position": (0.0, TURN),
    "output_velocity": (-0.6, 0.6),
    "load": (-40.0, 40.0),
    "temperature": (5.0, 55.0),
    "output_acceleration": (-20.0, 20.0),
    "motor_torque": (-1.0, 1.0),
    "time": (0.0, 600.0),
}
"""Channels in the order in which they are chosen for the axis, and how far they are swept; others
come last."""
ELSEWHERE = (0.0, 50.0)
BESIDE = {
    "output_velocity": (-0.3, 0.3),
    "load": (5.0, 10.0, 20.0),
    "temperature": (5.0, 25.0, 45.0),
}
"""Values of a channel that is read beside that of the axis; the rest rests."""
COLOURS = ("#3b82c4", "#d9742b", "#3a9a5b", "#b05cc0", "#c4a000", "#7f7f7f")
GREY = "#7d8590"  # seen on white and on black


def axis_of(info: EffectInfo) -> str:
    """Return the channel that the picture of an effect has on its axis."""
    if "period" in info.reads or not info.reads:
        return "time"
    if info.paths:
        return info.paths[0][0]
    return next((name for name in SPANS if name in info.reads), info.reads[0])


def draw(info: EffectInfo, path: Path) -> None:
    """Write the picture of an effect as SVG, transparent, of the same bytes each time."""
    settings = {"svg.hashsalt": "flexspline", "font.size": 11, "svg.fonttype": "none"}
    with matplotlib.rc_context(settings):
        figure = Figure(figsize=(6.4, 3.2))
        ax = figure.add_axes((0.1, 0.16, 0.85, 0.74))  # a layout engine takes as long as all else
        curves = list(_curves(info))
        largest = max(float(np.abs(y).max()) for _, y, _ in curves)
        for (x, y, label), colour in zip(curves, COLOURS, strict=False):
            ax.plot(x, y / largest, color=colour, label=label, linewidth=1.8)
        ax.set(xlabel=_label(axis_of(info)), ylabel="share of largest value", ylim=(-1.1, 1.1))
        _greyed(ax)
        if len(curves) > 1:
            ax.legend(
                loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, labelcolor=GREY
            )
        figure.savefig(path, format="svg", transparent=True, metadata={"Date": None})


def _greyed(ax: Axes) -> None:
    ax.grid(color=GREY, alpha=0.25)
    for spine in ax.spines.values():
        spine.set_visible(False)
    ax.tick_params(colors=GREY, length=0)
    for text in (ax.xaxis.label, ax.yaxis.label):
        text.set_color(GREY)


def _label(channel: str) -> str:
    return f"{channel.replace('_', ' ')} [{_channel(channel).unit}]"


def _curves(info: EffectInfo) -> Iterator[Curve]:
    """Yield what is on the axis, what the effect is there, and what to call it."""
    chosen = effect(info.name, orders=[(ORDER, pair) for pair in info.pairs[:1]])
    axis = axis_of(info)
    if axis == "time" and info.remembers:
        yield from _up_and_down(chosen)
        return
    if info.remembers:
        yield _there_and_back(chosen, axis)
        return
    x = np.linspace(*SPANS.get(axis, ELSEWHERE), ROWS)
    beside = [name for name in BESIDE if name in info.reads and name != axis]
    for name in beside[:1]:
        for value in _values(chosen, name):
            y = _computed(chosen, {axis: x, name: np.full(ROWS, value)}, 0)
            yield x, y, f"at {value:g} {_channel(name).unit}"
    if beside:
        return
    for k, term in enumerate(chosen.terms):
        y = _computed(chosen, {axis: x}, k)
        yield x, y / np.abs(y).max(), term.name


def _channel(name: str) -> Channel:
    return CHANNELS[LOAD if name == "load" else name]


def _values(chosen: Effect, name: str) -> tuple[float, ...]:
    """Return values of a channel beside that of the axis: below, at and above a resonance."""
    if chosen.info.modulated and name == "output_velocity":
        met = chosen.shapes["resonance_velocity"] / ORDER
        return (0.5 * met, met, 2.0 * met)
    return BESIDE[name]


def _there_and_back(chosen: Effect, axis: str) -> Curve:
    """The second of two strokes: the first brings the memory to where it then is each time."""
    width = next(value for name, value in chosen.shapes.items() if name.endswith("width"))
    x = 4.0 * width * np.sin(np.linspace(0.0, 2.0 * TURN, ROWS))
    half = slice(ROWS // 2, None)
    return x[half], _computed(chosen, {axis: x})[half], chosen.name


def _up_and_down(chosen: Effect) -> Iterator[Curve]:
    """A channel that rises and falls, and what the effect makes of it in some of its own times."""
    driven = next(name for name in ("load", "temperature") if name in chosen.reads)
    own = max(chosen.shapes[shape.name] for shape in chosen.info.shapes if shape.unit == "s")
    time = np.linspace(0.0, 16.0 * own, ROWS)
    risen = np.clip(np.minimum(time / own - 2.0, 9.0 - time / own), 0.0, 1.0)
    y = _computed(chosen, {driven: 20.0 + 10.0 * risen, "time": time})
    yield time, y / np.abs(y).max(), chosen.name
    yield time, risen, f"{driven}, which drives it"


def _computed(chosen: Effect, swept: dict[str, Array], term: int | None = None) -> Array:
    """What the core says of an effect over a run, one coefficient being 1, or each."""
    read = {*SPANS, *chosen.reads, LOAD} - {"time", "period", "load"}
    channels = {name: np.zeros(ROWS) for name in read}
    channels |= {"time": np.arange(ROWS) / RATE, "temperature": np.full(ROWS, 25.0)}
    channels |= {LOAD if name == "load" else name: values for name, values in swept.items()}
    if "time" in swept:
        channels["time"] = swept["time"] - swept["time"][0]
    target = next(t for t, letter in TARGETS.items() if letter in chosen.info.targets)
    count = len(chosen.terms)
    values = np.ones(count) if term is None else np.eye(count)[term]
    part = Part(target, (chosen,), values, LOAD, {"channels": ["motor_position"]})
    log = Log.from_arrays(facts=FACTS, **channels)
    return Model({PART_OF[target]: part}, FACTS).components(log)[chosen.name]
