"""Torque over temperature with the fitted polynomial and how well it is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.plot.canvas import (
    MOST_COLOURED_RUNS,
    PALETTE,
    axes_or_new,
    channel_label,
    colours_of_runs,
    legend,
    plain,
    titled,
)
from flexspline.plot.thin import spread_evenly

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["drift_curve"]

Array = NDArray[np.float64]

DRIFT = "temperature_drift"
NORMAL_95 = 1.959964


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
    if DRIFT not in [effect.name for effect in part.effects]:
        raise InputError(
            f"the model of {part.target} has no {DRIFT}; it has "
            f"{listed(effect.name for effect in part.effects)}"
        )
    runs = [logs] if isinstance(logs, Log) else list(logs)
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
    titled(ax, "Drift over temperature")
    legend(ax)
    return ax


def _temperatures(model: Model, part: Part, runs: Sequence[Log], ax: Axes) -> Array:
    """Draw the reading less the effects that are no drift; return all finite temperatures."""
    seen = []
    for log, colour in zip(runs, colours_of_runs(len(runs)), strict=True):
        temperature = log["temperature"]
        others = sum(
            values
            for name, values in model.components(log, part.target).items()
            if name not in (DRIFT, "offset")
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
    chosen, values, names, first = [], [], [], 0
    for effect in part.effects:
        last = first + len(effect.terms)
        if effect.name in (DRIFT, "offset"):
            chosen.append(effect)
            values += part.coefficients[first:last].tolist()
            names += [f"{effect.name}.{term.name}" for term in effect.terms]
        first = last
    log = Log.from_arrays(time=np.arange(len(grid), dtype=float), temperature=grid)

    def value(coefficients: Array) -> Array:
        only = Part(part.target, tuple(chosen), coefficients)
        return Model({"only": only}, model.facts).predict(log, part.target).predicted

    rows = np.column_stack([value(unit) for unit in np.eye(len(values))])
    covariance = _covariance(part.record.get("covariance"), names)
    if covariance is None:
        return value(np.array(values)), None
    error = np.sqrt(np.maximum(np.einsum("np,pq,nq->n", rows, covariance, rows), 0.0))
    return value(np.array(values)), np.asarray(error)


def _covariance(record: Any, names: Sequence[str]) -> Array | None:
    """Covariance of these coefficients, zero for fixed ones; None where nothing is known."""
    if not record or not set(names) & set(record["names"]):
        return None
    found = np.zeros((len(names), len(names)))
    fitted = [k for k, name in enumerate(names) if name in record["names"]]
    at = [record["names"].index(names[k]) for k in fitted]
    found[np.ix_(fitted, fitted)] = np.array(record["matrix"], dtype=float)[np.ix_(at, at)]
    return found
