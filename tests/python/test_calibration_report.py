"""What a calibration prints, shows in a notebook, draws and reports."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import calibration_logs as bench
import matplotlib.pyplot as plt
import numpy as np
import pytest
from calibration_logs import QUIET
from figure_layout import page_faults
from html_pages import tags_of
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexspline import InputError, calibrate
from flexspline.calibration import CalibrationResult
from flexspline.plot import sensor as plots

UNIT = re.compile(r"\[[^\]]+\]$")


@cache
def whole() -> CalibrationResult:
    return calibrate([bench.load_run(), bench.drift_run(cooling=True)], full_scale=70.0)


@cache
def drift_alone() -> CalibrationResult:
    return calibrate(bench.drift_run(QUIET))


@cache
def load_alone() -> CalibrationResult:
    return calibrate(bench.load_run(), degree=0)


def everything() -> list[CalibrationResult]:
    return [whole(), drift_alone(), load_alone()]


def axes(figure: Figure) -> list[Axes]:
    return [ax for part in figure.subfigs for ax in part.axes]


def test_the_text_leads_with_the_verdict_and_fits_a_screen_in_width() -> None:
    for made in everything():
        lines = str(made).splitlines()
        assert max(map(len, lines)) <= 120
    assert str(whole()).startswith("Calibrated, 62.")
    assert str(drift_alone()).startswith("No calibration, but the drift in volts")


def test_every_parameter_and_figure_stands_in_the_text() -> None:
    text = str(whole())
    for parameter in whole().parameters:
        assert parameter.name.replace("_", " ") in text
    for figure in whole().figures:
        assert re.search(rf"^{re.escape(figure.name)} +[\d.]+ %FS +[\d.]+ Nm", text, re.MULTILINE)


def test_a_figure_that_is_not_shown_says_why_instead_of_a_number() -> None:
    text = str(drift_alone())
    for figure in drift_alone().figures:
        assert re.search(rf"^{re.escape(figure.name)} +not shown +{figure.reason[:20]}", text,
                         re.MULTILINE)  # fmt: skip


def test_html_is_closed_loads_nothing_and_shows_each_figure_that_the_runs_allow(
    tmp_path: Path,
) -> None:
    for made, count in zip(everything(), (4, 2, 2), strict=True):
        path = tmp_path / f"{count}.html"
        made.report(path)
        page = path.read_text(encoding="utf-8")
        assert page.count("<svg") == count == len(axes(made.plot()))
        for text in (page, made._repr_html_()):
            assert "script" not in tags_of(text)
            assert "<script" not in text
        assert not re.search(r"""(src|href)\s*=\s*["'](https?:)?//""", page)


def test_the_report_can_be_read_wide_narrow_and_dark(tmp_path: Path) -> None:
    whole().report(tmp_path / "report.html")
    assert page_faults(tmp_path / "report.html") == []


def test_every_axis_has_a_unit_and_a_title_and_nothing_is_left_open() -> None:
    before = plt.get_fignums()
    for made in everything():
        for ax in axes(made.plot()):
            assert UNIT.search(ax.get_xlabel()) and UNIT.search(ax.get_ylabel())
            assert ax.get_title(loc="left")
    assert plt.get_fignums() == before


def test_a_plot_that_the_runs_do_not_allow_is_refused() -> None:
    with pytest.raises(InputError, match="leg of the reference"):
        plots.calibration_line(drift_alone())
    for view in (plots.voltage_drift, plots.compensation):
        with pytest.raises(InputError, match="leaves temperature out"):
            view(load_alone())


def test_tables_hold_the_same_numbers() -> None:
    frame, figures = whole().to_frame(), whole().figures_frame()
    assert frame.loc["sensitivity", "value"] == whole()["sensitivity"].value
    assert figures.loc["hysteresis", "percent"] == whole().figure("hysteresis").percent


@pytest.mark.usefixtures("undrawn")
def test_the_call_that_the_report_prints_makes_the_calibration_again(tmp_path: Path) -> None:
    import flexspline

    whole().report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    call = re.search(r"<code>(result = flexspline\.calibrate.*?)</code>", page, re.DOTALL)
    assert call is not None
    logs = [bench.load_run(), bench.drift_run(cooling=True)]
    names: dict[str, object] = {"flexspline": flexspline, "logs": logs}
    exec(call[1].replace("&#39;", "'"), names)
    again = names["result"]
    assert isinstance(again, CalibrationResult)
    assert str(again) == str(whole())


def test_a_share_of_a_full_scale_that_is_too_small_is_no_power_of_ten() -> None:
    runs = [bench.load_run(), bench.drift_run(cooling=True)]
    text = " ".join(str(calibrate(runs, full_scale=0.007)).split())
    assert re.search(r"\(\d{3,} % of 0\.007 Nm\)", text)
    assert not re.search(r"e\+\d+ %", text)


def test_parameters_of_what_repeats_are_told_from_those_of_the_table() -> None:
    made = whole()
    count = made.uncertainty.noise.parameters - len(made.parameters)
    assert count > 0
    said = " ".join(str(made).split())
    assert f"found beside {count} more of bend and hysteresis" in said


def test_a_mean_that_the_fit_makes_zero_is_printed_as_zero() -> None:
    (leg,) = drift_alone().thermal_legs
    assert 0.0 < abs(leg.bias) < 1e-9 * leg.rmse
    said = " ".join(str(drift_alone()).split())
    assert re.search(r"RMSE, [0.]+ mV in the mean", said)


def test_a_band_that_knows_nothing_does_not_hide_the_drift() -> None:
    made = drift_alone()
    blind = replace(made, uncertainty=replace(made.uncertainty, basis=1e6 * made.uncertainty.basis))
    assert np.ptp(plots.voltage_drift(blind).get_ylim()) < 3 * np.ptp(
        plots.voltage_drift(made).get_ylim()
    )
