"""Figures of fits: labelled, thinned, and without a trace in pyplot."""

from __future__ import annotations

import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
import report_fits
from figure_layout import figure_faults
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import flexspline
from flexspline import plot
from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.plot.canvas import banded, outline, spread_evenly

UNIT = re.compile(r"\[[^\]]+\]$")


def labelled(ax: Axes) -> bool:
    return all(UNIT.search(label) for label in (ax.get_xlabel(), ax.get_ylabel()))


def test_every_axis_of_the_figure_has_a_unit_and_a_title_and_all_can_be_read() -> None:
    figure = report_fits.plain_fit().plot()
    axes = _axes(figure)
    assert len(axes) == 9
    assert all(labelled(ax) and ax.get_title(loc="left") for ax in axes)
    assert figure_faults(figure) == []


def test_a_figure_is_not_left_open() -> None:
    before = plt.get_fignums()
    report_fits.confounded_fit().plot()
    plot.residual_over(report_fits.plain_fit(), "temperature")
    assert plt.get_fignums() == before


def test_each_panel_draws_on_the_axes_it_is_given() -> None:
    fit = report_fits.plain_fit()
    logs = [run.log for run in fit.runs]
    for draw in (
        lambda ax: plot.measured_against_predicted(fit, ax),
        lambda ax: plot.residual_over(fit, "output_velocity", ax),
        lambda ax: plot.components(fit, "time", ax, run=2),
        lambda ax: plot.components(fit, "output_position", ax),
        lambda ax: plot.order_spectra(fit, ax),
        lambda ax: plot.drift_curve(fit, logs, ax),
        lambda ax: plot.drift_curve(fit.model, logs[0], ax),
    ):
        ax = Figure().add_subplot()
        assert draw(ax) is ax
        assert labelled(ax)


def test_no_panel_holds_more_than_twenty_thousand_points() -> None:
    for ax in _axes(report_fits.plain_fit().plot()):
        dots = [len(c.get_offsets()) for c in ax.collections]
        lines = sum(len(np.asarray(line.get_xdata())) for line in ax.lines)
        assert max([0, *dots]) <= 20_000
        assert lines <= 8 * 20_000


def test_a_thinned_line_keeps_its_extremes() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=123_457)
    values[77_777], values[5] = 50.0, np.nan
    at = outline(values, 2000)
    assert len(at) <= 2000 and np.all(np.diff(at) > 0)
    assert np.nanmax(values[at]) == 50.0
    assert np.nanmin(values[at]) == np.nanmin(values)


def test_thinned_points_are_distinct_and_cover_the_range() -> None:
    at = spread_evenly(100_000, 500)
    assert len(set(at.tolist())) == 500
    assert at.min() < 1000 and at.max() > 99_000


def test_a_bin_without_values_is_a_gap() -> None:
    x = np.concatenate([np.linspace(0, 1, 500), np.linspace(9, 10, 500)])
    bands = banded(x, np.ones(1000), bins=10)
    assert np.isnan(bands.median[4]) and bands.median[0] == 1.0


def test_the_drift_curve_is_the_polynomial_of_the_fit() -> None:
    fit = report_fits.plain_fit()
    ax = plot.drift_curve(fit, [run.log for run in fit.runs])
    (line,) = [line for line in ax.lines if line.get_label() == "fitted drift"]
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    expected = fit["offset"].value + fit["temperature_drift.linear"].value * (x - 25.0)
    expected += fit["temperature_drift.quadratic"].value * (x - 25.0) ** 2
    np.testing.assert_allclose(y, expected, atol=1e-12)


def test_a_spectrum_loses_the_line_that_was_fitted() -> None:
    ax = plot.order_spectra(report_fits.plain_fit())
    target, residual = (
        next(line for line in ax.lines if line.get_label() == name)
        for name in ("target", "residual")
    )
    height = []
    for line in (target, residual):
        x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        height.append(y[(x > 201) & (x < 203)].max())
    assert height[0] == pytest.approx(0.08, rel=0.2)
    assert height[1] < 0.1 * height[0]


def test_a_log_without_velocity_or_with_broken_temperature_still_plots() -> None:
    log = report_fits.run(3)
    temperature = np.array(log["temperature"])
    temperature[100:200] = np.nan
    noise = np.random.default_rng(3).normal(size=len(log))
    bare = Log.from_arrays(time=log["time"], temperature=temperature, sensor_torque=noise)
    fit = flexspline.fit(["offset"], bare, "sensor_torque", checks=False)
    titles = [ax.get_title(loc="left") for ax in _axes(fit.plot())]
    assert "Residual over temperature" in titles
    assert "Residual over output velocity" not in titles
    assert "Order spectrum before and after" not in titles


def test_what_is_left_rises_over_the_known_load_where_the_gain_is_wrong() -> None:
    load = "reference_torque"
    log = report_fits.run(3, 600)
    torque = 10.0 * np.sin(np.arange(600) / 40.0)
    channels = {name: log[name] for name in ("time", "output_position", "output_velocity")}
    channels |= {load: torque, "sensor_torque": 1.02 * torque + log["output_velocity"]}
    loaded = Log.from_arrays(**channels)
    names = ["offset", "viscous_friction"]
    fit = flexspline.fit(names, loaded, "sensor_torque", known_load=load, checks=False)
    words = load.replace("_", " ")
    ax = next(a for a in _axes(fit.plot()) if a.get_title(loc="left") == f"Residual over {words}")
    assert ax.get_xlabel() == f"{words} [Nm]"
    medians = [line for line in ax.lines if str(line.get_label()).startswith("median")]
    assert [line.get_label() for line in medians] == ["median forward", "median backward"]
    for median in medians:
        at, left = (values[np.isfinite(median.get_ydata())] for values in median.get_data())
        assert np.polyfit(at, left, 1)[0] == pytest.approx(0.02, rel=0.1)


def test_a_median_does_not_leap_between_the_two_directions() -> None:
    """Friction that the model lacks is +1 and −1 at every angle."""
    log = report_fits.run(3)
    torque = np.sign(log["output_velocity"])
    channels = {name: log[name] for name in ("time", "output_position", "output_velocity")}
    log = Log.from_arrays(**channels, sensor_torque=torque)
    fit = flexspline.fit(["offset"], log, "sensor_torque", checks=False)
    ax = plot.residual_over(fit, "output_position")
    lines = {str(line.get_label()): np.asarray(line.get_ydata()) for line in ax.lines}
    for label, value in (("median forward", 1.0), ("median backward", -1.0)):
        known = lines[label][np.isfinite(lines[label])]
        assert len(known) > 10
        assert known == pytest.approx(value - fit["offset.offset"].value)


def test_many_runs_are_not_told_apart() -> None:
    fit = flexspline.fit(
        ["offset", "viscous_friction"],
        [report_fits.run(k, 500) for k in range(12)],
        "sensor_torque",
        checks=False,
    )
    ax = plot.measured_against_predicted(fit)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["measured = predicted"]


def test_what_cannot_be_drawn_is_an_error_in_one_sentence() -> None:
    fit = report_fits.confounded_fit()
    with pytest.raises(InputError, match="no run of the fit has values of 'motor_torque'"):
        plot.residual_over(fit, "motor_torque")
    with pytest.raises(InputError, match="there is no run 9"):
        plot.components(fit, run=9)
    with pytest.raises(InputError, match="has no temperature_drift"):
        plot.drift_curve(fit, fit.runs[0].log)
    with pytest.raises(InputError, match="motor_current"):
        plot.components(fit, "motor_current")


def test_a_notebook_can_show_a_figure_without_pyplot() -> None:
    figure = plot.residual_over(report_fits.constrained_fit()).figure
    assert figure._repr_png_()[:4] == b"\x89PNG"


def _axes(figure: Figure) -> list[Axes]:
    return [ax for cell in figure.subfigs for ax in cell.axes]
