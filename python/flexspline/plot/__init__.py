"""Figures of logs and fits. Every function takes axes to draw on, or makes its own.

A fit drawn: how good it is, where it is not, and what it is made of. Measured against predicted,
and the residual over any channel; what each effect contributes; torque over temperature, with how
well the polynomial is known; the motion of a fit by simulation; a profile over its parameter,
beside Wald's parabola, and the region of two parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexspline.effects.causes import OFFSET, TEMPERATURE_DRIFT
from flexspline.errors import InputError, listed
from flexspline.formatting import percent, short_names
from flexspline.forward import simulate
from flexspline.least_squares.result import contributions
from flexspline.logs.log import IMAGINABLE, Log
from flexspline.logs.read import as_logs
from flexspline.model import Model, Part
from flexspline.plot.canvas import (
    GREY,
    INK,
    MOST_COLOURED_RUNS,
    PALETTE,
    Panel,
    axes_or_new,
    banded,
    can_be_drawn,
    channel_label,
    colours_of_runs,
    finished,
    legend,
    log_axis,
    middle,
    outline,
    panelled,
    part_of,
    plain,
    short_labels,
    spread_evenly,
    titled,
)
from flexspline.plot.orders import order_spectra

if TYPE_CHECKING:
    from flexspline.least_squares.profile import Contour, Profile
    from flexspline.least_squares.result import Fit, FittedRun

__all__ = [
    "components",
    "drift_curve",
    "measured_against_predicted",
    "order_spectra",
    "plot_fit",
    "residual_over",
    "simulated_motion",
]


LOOK_FOR = {
    "worst": "The run whose simulated motion is off most. Both lines start together; where they "
    "part is where the model errs first, what follows is also the error carried on.",
    "median": "A run in the middle: this is what to expect of the next one.",
    "predicted": "All points should lie along the diagonal. A cloud that bends or lies beside it "
    "is an effect the model lacks; a run apart from the others is a run unlike them.",
    "time": "The residual should be equally wide everywhere and centred on zero. A slow drift is "
    "temperature or time; a burst is a push, a reversal or a fault of the log.",
    "output_position": "The median should lie on zero at every angle. Waves are ripple that the "
    "model lacks, one period a turn is gravity.",
    "output_velocity": "The median should lie on zero at every speed. A step at zero is Coulomb "
    "friction, a slope viscous friction, a peak at low speed Stribeck friction.",
    "temperature": "The median should lie on zero at every temperature. A slope is drift.",
    "load": "The median should lie on zero at every load. A slope is a wrong gain, a bend a sensor "
    "that is not linear, and a band that widens with the load friction that grows with it.",
    "components": "What the prediction is made of. Effects that are indistinguishable in these "
    "runs are drawn as their sum.",
    "components over": "The median contribution at each speed; a band holds 90 % where an effect "
    "depends on more than the speed.",
    "orders": "Lines of the target that the residual no longer has are explained. A line that is "
    "left is a ripple the model lacks; its order says what turns. Where they begin above order 1, "
    "the runs turn too little to resolve what lies below.",
    "drift": "The reading without the other effects should follow the curve; the band holds the "
    "true curve with 95 %.",
}

OF_TORSION = {
    "output_position": "The median should lie on zero at every angle. Waves are kinematic error "
    "that the model lacks; one period a turn is eccentricity, or gravity that the load leaves out.",
    "output_velocity": "The median should lie on zero at every speed. A step at zero is hysteresis "
    "or backlash that the model lacks, a slope one encoder that is late against the other.",
    "temperature": "The median should lie on zero at every temperature. A slope is an angle that "
    "drifts, a band that widens a stiffness that changes with temperature.",
    "load": "The median should lie on zero at every load. A slope is a wrong compliance, a bend "
    "stiffness that changes with the load, a step at zero backlash, two branches hysteresis.",
}
"""What to look for where the target is the torsion: an angle, which friction and the sensor's gain
make nothing of."""

Array = NDArray[np.float64]

_WORDS = {"output_position": "output angle", "motor_position": "motor angle"}

REFERENCE = "reference_torque"
BOTH_WAYS = 0.1  # of the rows go each way, from which both have a median of their own

LOOSE = 0.5  # a band wider than this part of the median's range hides the median
STYLES = ("-", "--", ":")

NORMAL_95 = 1.959964

HIGHEST = 4.0  # times the limit: what lies above tells nothing


def __dir__() -> list[str]:
    return __all__


def plot_fit(fit: Fit) -> Figure:
    """Return a figure with a panel for each view that the channels of the runs allow."""
    return panelled(panels(fit))


def panels(fit: Fit) -> list[Panel]:
    """Return the views that the channels of the runs allow."""
    look_for = LOOK_FOR | (OF_TORSION if fit.target == "torsion" else {})
    found = [
        *_motion(fit),
        Panel(partial(measured_against_predicted, fit), LOOK_FOR["predicted"]),
        Panel(partial(residual_over, fit, "time"), LOOK_FOR["time"]),
    ]
    for channel in ("output_position", "output_velocity", "temperature"):
        if has_channel(fit, channel):
            found.append(Panel(partial(residual_over, fit, channel), look_for[channel]))
    load = fit.part.known_load or REFERENCE
    if has_channel(fit, load):
        found.append(Panel(partial(residual_over, fit, load), look_for["load"]))
    if fit.part.effects:
        found.append(Panel(partial(components, fit, "time"), LOOK_FOR["components"]))
        if all("output_velocity" in run.log for run in fit.runs):
            over = partial(components, fit, "output_velocity")
            found.append(Panel(over, LOOK_FOR["components over"]))
    if TEMPERATURE_DRIFT in [effect.name for effect in fit.part.effects]:
        logs = [run.log for run in fit.runs]
        found.append(Panel(partial(drift_curve, fit, logs), LOOK_FOR["drift"]))
    if can_be_drawn(order_spectra, fit):
        found.append(Panel(partial(order_spectra, fit), LOOK_FOR["orders"]))
    return found


def _motion(fit: Fit) -> list[Panel]:
    """Of a fit by simulation the run that it misses most, and one in the middle."""
    if fit.simulation is None:
        return []
    shown = ("worst", "median") if len(fit.runs) > 1 else ("worst",)
    return [Panel(partial(simulated_motion, fit, run), LOOK_FOR[run]) for run in shown]


def measured_against_predicted(fit: Fit, ax: Axes | None = None) -> Axes:
    """Draw measured over predicted y, in the target's unit, with the diagonal.

    Each run has a colour of its own where there are ten or fewer.
    """
    ax = axes_or_new(ax)
    x, y, colour = _points(fit, [run.predicted for run in fit.runs], "measured")
    ax.scatter(x, y, c=colour, s=2.5, alpha=0.35, linewidths=0, rasterized=True)
    ends = [min(x.min(), y.min()), max(x.max(), y.max())]
    ax.plot(ends, ends, color=INK, linewidth=1.0, label="measured = predicted")
    what = fit.target.replace("_", " ")
    ax.set(xlabel=f"predicted {what} [{fit.unit}]", ylabel=f"measured {what} [{fit.unit}]")
    titled(ax, "Measured against predicted")
    _name_runs(fit, ax)
    legend(ax)
    return ax


def residual_over(fit: Fit, channel: str = "time", ax: Axes | None = None) -> Axes:
    """Draw measured − predicted over a channel, in the unit of the target.

    Over time the runs stand one after the other. Over other channels dots, coloured by run where
    there are ten or fewer, lie behind the median and the band that holds 90 %. An angle over
    more than a turn is wrapped.

    Raises
    ------
    InputError
        Where no run has the channel.
    """
    alone, ax = ax is None, axes_or_new(ax)
    if not has_channel(fit, channel):
        known = dict.fromkeys(name for run in fit.runs for name in run.log.channels)
        raise InputError(f"no run of the fit has values of '{channel}'; they have {listed(known)}")
    if channel == "time":
        _measured_over_time(fit, ax)
    else:
        _residual_over_channel(fit, channel, ax)
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set_ylabel(f"residual [{fit.unit}]")
    titled(ax, f"Residual over {_WORDS.get(channel, channel.replace('_', ' '))}")
    if alone:
        _name_runs(fit, ax)
    legend(ax)
    return ax


def has_channel(fit: Fit, channel: str) -> bool:
    """Whether a run has finite values of a channel on rows that count."""
    return any(
        channel in run.log and bool(np.isfinite(_values(run, channel)[run.counts]).any())
        for run in fit.runs
    )


def _measured_over_time(fit: Fit, ax: Axes) -> None:
    end = 0.0
    most = max(200, 20_000 // len(fit.runs))
    for run, colour in zip(fit.runs, colours_of_runs(len(fit.runs)), strict=True):
        time = run.log["time"] - run.log["time"][0] + end
        residual = np.where(run.counts, run.residual, np.nan)
        at = outline(residual, most)
        ax.plot(time[at], residual[at], color=colour, linewidth=0.6, rasterized=len(at) > 5000)
        end = float(time[-1])
    many = len(fit.runs) > 1
    ax.set_xlabel("time, runs one after the other [s]" if many else "time since the start [s]")


def _residual_over_channel(fit: Fit, channel: str, ax: Axes) -> None:
    wrapped = channel.endswith("position") and _range(fit, channel) > 2.02 * np.pi
    columns = [_column(run, channel, wrapped) for run in fit.runs]
    x, y, colour = _points(fit, columns, "residual")
    ax.scatter(x, y, c=colour, s=2, alpha=0.2, linewidths=0, rasterized=True)
    inside = [run.counts for run in fit.runs]
    whole = np.concatenate([c[i] for c, i in zip(columns, inside, strict=True)])
    residual = np.concatenate([run.residual[run.counts] for run in fit.runs])
    bands = banded(whole, residual)
    ax.fill_between(
        bands.centre, bands.low, bands.high, color=GREY, alpha=0.25, linewidth=0, label="90 %"
    )
    for label, line, rows in _ways(fit, channel):
        some = banded(whole[rows], residual[rows])
        ax.plot(some.centre, some.median, line, color=INK, linewidth=1.6, markersize=2, label=label)
    words = channel_label(channel)
    ax.set_xlabel(words.replace(" [", " within a turn [") if wrapped else words)
    low, high = np.nanpercentile(y, [0.1, 99.9])
    ax.set_ylim(low - 0.25 * (high - low), high + 0.25 * (high - low))


def _ways(fit: Fit, channel: str) -> list[tuple[str, str, NDArray[np.bool_]]]:
    """Label, line and rows (n,) of each median: by direction, where one would leap between two."""
    every = np.ones(sum(int(run.counts.sum()) for run in fit.runs), dtype=bool)
    plain_one = [("median", ".-", every)]
    if channel == "output_velocity" or not has_channel(fit, "output_velocity"):
        return plain_one
    speed = np.concatenate([_column(run, "output_velocity", False)[run.counts] for run in fit.runs])
    ways = [("median forward", ".-", speed > 0.0), ("median backward", ".--", speed < 0.0)]
    both = min(int(rows.sum()) for _, _, rows in ways) > BOTH_WAYS * len(speed)
    return ways if both else plain_one


def _column(run: FittedRun, channel: str, wrapped: bool) -> Array:
    if channel not in run.log:
        return np.full(len(run.log), np.nan)
    values = _values(run, channel)
    return np.asarray(np.mod(values, 2.0 * np.pi) if wrapped else values)


def _values(run: FittedRun, channel: str) -> Array:
    """A channel with NaN for what no instrument reads: no fit used it, no axis holds it."""
    values = run.log[channel]
    return np.where(np.abs(values) <= IMAGINABLE, values, np.nan)


def _range(fit: Fit, channel: str) -> float:
    """From the least to the largest value in all runs."""
    whole = np.concatenate([_values(run, channel) for run in fit.runs if channel in run.log])
    return float(np.ptp(whole[np.isfinite(whole)]))


def _points(fit: Fit, columns: list[Array], what: str) -> tuple[Array, Array, NDArray[np.float64]]:
    """At most 20 000 points of all runs, shuffled, with colours (m, 4)."""
    from matplotlib.colors import to_rgba_array

    shades = to_rgba_array(colours_of_runs(len(fit.runs)))
    x = np.concatenate([c[run.counts] for c, run in zip(columns, fit.runs, strict=True)])
    y = np.concatenate([getattr(run, what)[run.counts] for run in fit.runs])
    number = np.repeat(np.arange(len(fit.runs)), [int(run.counts.sum()) for run in fit.runs])
    good = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    at = good[spread_evenly(len(good))]
    return x[at], y[at], shades[number[at]]


def _name_runs(fit: Fit, ax: Axes) -> None:
    if 1 < len(fit.runs) <= MOST_COLOURED_RUNS:
        names = short_labels([run.log.name for run in fit.runs])
        for name, colour in zip(names, colours_of_runs(len(fit.runs)), strict=True):
            ax.plot([], [], "o", color=colour, markersize=4, label=plain(name))


def components(
    fit: Fit, over: str = "time", ax: Axes | None = None, *, run: int | None = None
) -> Axes:
    """Draw the contribution of each effect, in the target's unit.

    Effects that the runs cannot tell apart are drawn as their sum.

    Parameters
    ----------
    over : "time" draws the measured and each part of the predicted y over at most ten seconds
        from the middle of a run; another channel the median of each effect over it within
        the band that holds 90 %, or the band alone where the effect hangs on something else.
    run : number of the run; None: the first over time, all over another channel.

    Raises
    ------
    InputError
        Where a run lacks the channel, or there is no such run.
    """
    ax = axes_or_new(ax)
    if run is not None and not 0 <= run < len(fit.runs):
        raise InputError(f"there is no run {run}; the fit has runs 0 to {len(fit.runs) - 1}")
    if over == "time":
        _components_over_time(fit, fit.runs[run or 0], ax)
    else:
        _components_over_channel(fit, list(fit.runs) if run is None else [fit.runs[run]], over, ax)
    ax.axhline(0.0, color=INK, linewidth=0.6)
    ax.set_ylabel(f"{fit.target.replace('_', ' ')} [{fit.unit}]")
    legend(ax)
    return ax


def _components_over_time(fit: Fit, run: FittedRun, ax: Axes) -> None:
    time = run.log["time"]
    some = middle(time)
    part, time = part_of(time, some), time - time[0]
    at = outline(run.measured[some]) + some.start
    ax.plot(time[at], run.measured[at], color=GREY, linewidth=1.0, label="measured")
    parts = contributions(fit, run)
    rough = {name: float(np.nanmean(np.abs(np.diff(y[some])))) for name, y in parts.items()}
    behind = sorted(parts, key=lambda name: -rough[name])
    for (name, values), (colour, line) in zip(parts.items(), _looks(), strict=False):
        at = outline(values[some]) + some.start
        ax.plot(
            time[at],
            values[at],
            line,
            color=colour,
            linewidth=1.3,
            label=name,
            zorder=2.1 + 0.01 * behind.index(name),
        )
    ax.set_xlabel("time since the start of the run [s]")
    titled(ax, f"Contribution of each effect, {plain(run.log.name)}{part}")


def _components_over_channel(fit: Fit, runs: list[FittedRun], channel: str, ax: Axes) -> None:
    for each in runs:
        if channel not in each.log:
            raise InputError(
                f"log '{each.log.name}': no channel '{channel}'; it has {listed(each.log.channels)}"
            )
    x = np.concatenate([each.log[channel][each.counts] for each in runs])
    parts = [{k: v[each.counts] for k, v in contributions(fit, each).items()} for each in runs]
    for name, (colour, line) in zip(parts[0] if parts else {}, _looks(), strict=False):
        bands = banded(x, np.concatenate([part[name] for part in parts]))
        middle = bands.median[np.isfinite(bands.median)]
        if not middle.size:  # no band holds rows enough for its middle
            continue
        rounding = 1e-6 * float(np.abs(middle).max(initial=0.0))
        tells = np.nanmedian(bands.high - bands.low) <= LOOSE * np.ptp(middle) + rounding
        ax.fill_between(
            bands.centre,
            bands.low,
            bands.high,
            color=colour,
            alpha=0.2,
            linewidth=0,
            label=None if tells else f"{name} (90 %)",
        )
        if tells:
            ax.plot(
                bands.centre,
                bands.median,
                line,
                color=colour,
                linewidth=1.5,
                marker=".",
                markersize=2.5,
                label=name,
            )
    ax.set_xlabel(channel_label(channel))
    titled(ax, f"Contribution of each effect over {channel.replace('_', ' ')}")


def _looks() -> list[tuple[str, str]]:
    return [(colour, line) for line in STYLES for colour in PALETTE]


def drift_curve(
    fitted: Fit | Model,
    logs: Log | Sequence[Log],
    ax: Axes | None = None,
    *,
    target: str | None = None,
) -> Axes:
    """Draw the reading less all other effects over temperature, and the fitted drift.

    The curve is offset + drift; its band holds the truth with 95 % (from the covariance of the
    fit; without one there is no band).

    Parameters
    ----------
    fitted : a fit, or a model with a `temperature_drift`.
    logs : with the channel `temperature` and those of the target.
    target : of which part, where the model has several.

    Raises
    ------
    InputError
        Where the model has no temperature drift, or a log no temperature.
    """
    ax = axes_or_new(ax)
    model = fitted if isinstance(fitted, Model) else fitted.model
    part = model.part(target if isinstance(fitted, Model) else fitted.target)
    if TEMPERATURE_DRIFT not in [effect.name for effect in part.effects]:
        raise InputError(
            f"the model of {part.target} has no {TEMPERATURE_DRIFT}; it has "
            f"{listed(effect.name for effect in part.effects)}"
        )
    runs = as_logs(logs)
    known = _temperatures(model, part, runs, ax)
    grid = np.linspace(known.min(), known.max(), 200)
    curve, error = _curve(model, part, grid)
    ax.plot(grid, curve, color=PALETTE[3], linewidth=2.0, label="fitted drift")
    if error is not None:
        low, high = curve - NORMAL_95 * error, curve + NORMAL_95 * error
        ax.fill_between(grid, low, high, color=PALETTE[3], alpha=0.3, linewidth=0, label="95 %")
    ax.set(
        xlabel=channel_label("temperature"),
        ylabel=f"{part.target.replace('_', ' ')} less other effects [{part.unit}]",
    )
    return finished(ax, "Drift over temperature")


def _temperatures(model: Model, part: Part, runs: Sequence[Log], ax: Axes) -> Array:
    """Draw the reading less the effects that are no drift; return all finite temperatures."""
    seen = []
    for log, colour in zip(runs, colours_of_runs(len(runs)), strict=True):
        temperature = log["temperature"]
        others = sum(
            values
            for name, values in model.components(log, part.target).items()
            if name not in (TEMPERATURE_DRIFT, OFFSET)
        )
        y = model.predict(log, part.target).measured - others
        good = np.flatnonzero(np.isfinite(temperature) & np.isfinite(y))
        seen.append(temperature[good])
        at = good[spread_evenly(len(good), 20_000 // len(runs))]
        ax.scatter(
            temperature[at],
            y[at],
            s=2.5,
            alpha=0.3,
            linewidths=0,
            color=colour,
            rasterized=True,
        )
        if len(runs) <= MOST_COLOURED_RUNS:
            ax.plot([], [], "o", color=colour, markersize=4, label=plain(log.name))
    joined = np.concatenate(seen) if seen else np.empty(0)
    if not len(joined):
        raise InputError("no log has a finite temperature; give logs that have")
    return np.asarray(joined)


def _curve(model: Model, part: Part, grid: Array) -> tuple[Array, Array | None]:
    """Offset + drift on a grid of temperatures, with its standard error where it is known."""
    drift = part.keeping(lambda effect: effect.name in (TEMPERATURE_DRIFT, OFFSET))
    names = [f"{effect.name}.{term.name}" for effect in drift.effects for term in effect.terms]
    log = Log.from_arrays(time=np.arange(len(grid), dtype=float), temperature=grid)

    def value(coefficients: Array) -> Array:
        only = Part(part.target, drift.effects, coefficients)
        return Model({"only": only}, model.facts).predict(log, part.target).predicted

    rows = np.column_stack([value(unit) for unit in np.eye(len(names))])
    covariance = _covariance(part.record.get("covariance"), names)
    if covariance is None:
        return value(drift.coefficients), None
    error = np.sqrt(np.maximum(np.einsum("np,pq,nq->n", rows, covariance, rows), 0.0))
    return value(drift.coefficients), np.asarray(error)


def _covariance(record: Any, names: Sequence[str]) -> Array | None:
    """Covariance of these coefficients, zero for fixed ones; None where nothing is known."""
    if not record or not set(names) & set(record["names"]):
        return None
    found = np.zeros((len(names), len(names)))
    fitted = [k for k, name in enumerate(names) if name in record["names"]]
    at = [record["names"].index(names[k]) for k in fitted]
    found[np.ix_(fitted, fitted)] = np.array(record["matrix"], dtype=float)[np.ix_(at, at)]
    return found


def simulated_motion(fit: Fit, run: str = "worst", ax: Axes | None = None) -> Axes:
    """Draw the measured and the simulated angle [rad] of one run over time [s].

    Parameters
    ----------
    fit : made by simulation.
    run : a run's name; or "worst" or "median", by the gap on rows that a fit did not count.

    Raises
    ------
    InputError
        Where the fit was not made by simulation, or has no such run.
    """
    if fit.simulation is None:
        raise InputError("the fit is a regression; fit with by='simulation' to draw its motion")
    number = _chosen(fit, run)
    log = fit.simulation.logs[number]
    made = simulate(fit.model, log, target=fit.target, controller=fit.simulation.controller)
    ax = axes_or_new(ax)
    time = log["time"] - log["time"][0]
    for label, values, colour in (
        ("measured", made.measured, GREY),
        ("simulated", made.simulated, PALETTE[0]),
    ):
        at = outline(values)
        ax.plot(time[at], values[at], color=colour, linewidth=1.2, label=label)
    ax.set(xlabel="time since the start [s]", ylabel="output angle [rad]")
    gap = fit.simulation.runs[number]
    return finished(ax, f"{plain(gap.name)}: {1e3 * gap.held_out:.3g} mrad RMS held out")


def _chosen(fit: Fit, run: str) -> int:
    """The number of a run in the fit."""
    assert fit.simulation is not None
    gaps = fit.simulation.runs
    order = np.argsort([gap.held_out for gap in gaps])
    if run in ("worst", "median"):
        return int(order[-1] if run == "worst" else order[(len(order) - 1) // 2])
    names = [gap.name for gap in gaps]
    if run not in names:
        raise InputError(f"no run '{run}' in this fit; it has {', '.join(names)}")
    return names.index(run)


def plot_profile(made: Profile) -> Figure:
    """Return a figure of a profile."""
    figure = draw_profile(made).figure
    assert isinstance(figure, Figure)
    return figure


def plot_contour(made: Contour) -> Figure:
    """Return a figure of a region."""
    figure = draw_contour(made).figure
    assert isinstance(figure, Figure)
    return figure


def draw_profile(made: Profile, ax: Axes | None = None) -> Axes:
    """Draw the statistic over the value, its limit, and what Wald's interval takes it for."""
    ax = axes_or_new(ax)
    shown = made.statistic <= HIGHEST * made.limit
    low, high = made.values[shown].min(), made.values[shown].max()
    half = 0.5 * (made.wald[1] - made.wald[0])
    line = np.linspace(low, high, 400)
    parabola = made.limit * ((line - made.value) / half) ** 2
    ax.plot(line, parabola, "--", color=GREY, linewidth=1.0, label="Wald")
    ax.plot(made.values, made.statistic, ".-", color=PALETTE[0], markersize=3, label="profile")
    label = f"limit at {percent(made.level)}"
    ax.axhline(made.limit, color=INK, linewidth=0.8, linestyle=":", label=label)
    for number, (start, end) in enumerate(made.parts):
        inside = (low if start is None else start, high if end is None else end)
        label = "" if number else "interval"
        ax.axvspan(*inside, color=PALETTE[0], alpha=0.12, linewidth=0, label=label)
    ax.set(ylim=(0.0, HIGHEST * made.limit), xlim=(low, high), ylabel="statistic D [1]")
    if low > 0.0 and high > 10.0 * low:
        log_axis(ax, "x")
    ax.set_xlabel(f"{short_names(made.name)} [{made.unit}]")
    return finished(ax, f"Profile of {short_names(made.name)}")


def draw_contour(made: Contour, ax: Axes | None = None) -> Axes:
    """Draw the region of two parameters; it is open where it does not end within bounds."""
    ax = axes_or_new(ax)
    around = np.vstack([made.points, made.points[:1]])
    label = f"{percent(made.level)}, both together{', by F' if made.by else ''}"
    ax.plot(*around.T, ".-", color=PALETTE[0], markersize=3, label=label)
    ax.plot(*made.values, "+", color=INK, markersize=8, label="as fitted")
    one, other = (f"{short_names(n)} [{u}]" for n, u in zip(made.names, made.units, strict=True))
    ax.set(xlabel=one, ylabel=other)
    return finished(ax, "Region of two parameters")
