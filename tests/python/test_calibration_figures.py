"""Legs and points of the reference, and figures in %FS by their definitions."""

from __future__ import annotations

import calibration_logs as bench
import numpy as np
import pytest
from calibration_logs import FULL_SCALE, QUIET, Bench

from flexspline import calibrate
from flexspline.calibration.accuracy import (
    Leg,
    Points,
    best_line,
    legs_of,
    load_figures,
    points_on,
    slack_of,
)
from flexspline.calibration.result import CalibrationResult
from flexspline.formatting import short

LEVELS = np.array([0.0, 50.0, 100.0])


def by_hand(table: list[list[float]], rising: list[bool], full_scale: float = 100.0):  # type: ignore[no-untyped-def]
    """Figures of reading less reference, Nm, a row for each leg at 0, 50 and 100 Nm."""
    legs = [Leg(0, 0, 1, up, 0.0, 100.0) for up in rising]
    values = np.array(table)
    leg, level = (index.ravel() for index in np.indices(values.shape))
    points = Points(leg, level, LEVELS[level], values.reshape(-1, 1), np.array([1e-6]), True)
    return {f.name: f for f in load_figures(legs, points, full_scale, "")}


def test_hysteresis_is_the_largest_gap_of_the_averages() -> None:
    found = by_hand([[0.0, 0.2, 0.0], [0.1, -0.2, 0.0], [0.0, 0.4, 0.0], [0.1, 0.0, 0.0]],
                    [True, False, True, False])  # fmt: skip
    figure = found["hysteresis"]
    assert figure.torque == pytest.approx(0.3 - (-0.1))
    assert (figure.percent, figure.at) == (pytest.approx(0.4), 50.0)


def test_repeatability_is_the_spread_from_the_same_side() -> None:
    found = by_hand([[0.0, 0.2, 0.0], [0.1, -0.2, 0.0], [0.05, 0.5, 0.0], [0.1, 0.15, 0.0]],
                    [True, False, True, False])  # fmt: skip
    assert found["repeatability"].torque == pytest.approx(0.15 - (-0.2))


def test_combined_error_is_that_of_the_worst_reading_of_a_single_leg() -> None:
    found = by_hand([[0.0, 0.2, -0.7], [0.1, -0.2, 0.0]], [True, False])
    assert found["combined error"].torque == pytest.approx(0.7)
    assert found["combined error"].at == 100.0


def test_non_linearity_is_that_of_the_average_of_both_ways() -> None:
    # the curve is 0.1, 0.5, 0.2: through the ends 0.15 at mid-range, best line half of 0.35
    found = by_hand([[0.1, 0.7, 0.2], [0.1, 0.3, 0.2]], [True, False])
    assert found["non-linearity, terminal based"].torque == pytest.approx(0.35)
    assert found["non-linearity"].torque == pytest.approx(0.175)
    assert found["non-linearity, least squares"].torque == pytest.approx(0.5)


def test_percent_are_of_the_full_scale_given() -> None:
    found = by_hand([[0.0, 0.2, 0.0], [0.0, 0.0, 0.0]], [True, False], full_scale=200.0)
    assert found["hysteresis"].percent == pytest.approx(0.1)


def test_the_best_line_leaves_an_eighth_of_a_parabola() -> None:
    x = np.linspace(0.0, 1.0, 101)
    left = x**2 - best_line(x, x**2)
    assert np.abs(left).max() == pytest.approx(1.0 / 8.0, rel=1e-6)
    assert np.abs(x**2 - np.polyval(np.polyfit(x, x**2, 1), x)).max() > 1.0 / 8.0


def test_one_way_loading_shows_no_hysteresis_and_no_repeatability() -> None:
    made = calibrate([bench.load_run(one_way=True), bench.drift_run()])
    for name, why in (("hysteresis", "only rises"), ("repeatability", "two cycles")):
        figure = made.figure(name)
        assert figure.percent is None and figure.torque is None
        assert why in figure.reason
    assert made.figure("non-linearity").percent is not None
    assert "rising legs alone" in made.figure("non-linearity").definition
    assert "do not show: hysteresis, repeatability" in " ".join(str(made).split())


def test_one_cycle_shows_hysteresis_and_no_repeatability() -> None:
    made = calibrate(bench.load_run(count=1), degree=0)
    assert made.figure("hysteresis").percent is not None
    assert made.figure("repeatability").percent is None


def of_load(rig: Bench, *, ramp: bool = False) -> CalibrationResult:
    return calibrate(bench.load_run(rig, ramp=ramp), degree=0, full_scale=FULL_SCALE)


@pytest.mark.parametrize("ramp", [False, True])
def test_hysteresis_of_the_rig_is_found_on_plateaus_and_on_ramps(ramp: bool) -> None:
    figure = of_load(Bench(bend=0.0, ripple=0.0, memory=0.2), ramp=ramp).figure("hysteresis")
    assert figure.noise is not None and figure.torque is not None
    noise = figure.noise * FULL_SCALE / 100.0
    # ±0.2 Nm in mid-range; the first leg starts without memory, so the averages may be nearer
    assert 0.4 - 0.1 - noise < figure.torque < 0.4 + noise


def test_non_linearity_of_the_rig_is_found() -> None:
    made = of_load(Bench(memory=0.0, ripple=0.0, bend=0.3))
    levels = np.arange(0.0, 70.1, 5.0)
    curve = bench.bend(levels, 0.3)
    true = np.abs(curve - best_line(levels, curve)).max()
    figure = made.figure("non-linearity")
    assert figure.noise is not None
    assert figure.torque == pytest.approx(true, abs=figure.noise * FULL_SCALE / 100.0)


def test_a_rig_without_bend_and_memory_shows_no_more_than_noise() -> None:
    made = of_load(QUIET)
    for name in ("non-linearity", "hysteresis", "repeatability"):
        figure = made.figure(name)
        assert figure.percent is not None and figure.noise is not None
        assert figure.percent < 2.0 * figure.noise


def test_the_full_scale_is_stated_and_where_it_is_from() -> None:
    log = bench.load_run()
    assert "full scale of 70 Nm (as given)" in str(calibrate(log, degree=0, full_scale=70.0))
    made = calibrate(log, degree=0)
    assert made.full_scale == np.abs(log["reference_torque"]).max()
    assert "the largest reference" in str(made)


def test_runs_far_below_the_full_scale_are_said_to_show_a_part() -> None:
    made = calibrate(bench.load_run(), degree=0, full_scale=200.0)
    assert any("say nothing of the rest" in said for said in made.warnings)


def walks(torque: np.ndarray, noise: float = 0.02) -> list[np.ndarray]:  # type: ignore[type-arg]
    return [torque + np.random.default_rng(4).normal(0.0, noise, len(torque))]


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.3])
@pytest.mark.parametrize("count", [1, 3])
def test_steps_give_one_leg_for_each_way(noise: float, count: int) -> None:
    columns = walks(bench.stairs(bench.cycles(count), 6.0, 1.5), noise)
    legs = legs_of(columns, slack_of(columns), 35.0)
    assert [leg.rising for leg in legs] == [True, False] * count
    assert (legs[0].start, legs[-1].stop) == (0, len(columns[0]))
    points = points_on(legs, columns, [c[:, None] for c in columns], slack_of(columns))
    assert points is not None and points.stepped
    tolerance = 5.0 * noise / np.sqrt(40.0) + 1e-9  # mean of 45 settled rows
    np.testing.assert_allclose(points.levels, np.arange(0.0, 70.1, 5.0), atol=tolerance + 0.02)


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.3])
def test_ramps_give_bins(noise: float) -> None:
    columns = walks(bench.stairs(np.array([0.0, 70.0, 0.0, 70.0, 0.0]), 1.0, 60.0), noise)
    legs = legs_of(columns, slack_of(columns), 35.0)
    assert [leg.rising for leg in legs] == [True, False, True, False]
    points = points_on(legs, columns, [c[:, None] for c in columns], slack_of(columns))
    assert points is not None and not points.stepped and len(points.levels) == 20


def test_load_of_both_signs_rises_and_falls() -> None:
    columns = walks(bench.stairs(np.array([0.0, 70.0, -70.0, 70.0, 0.0]), 2.0, 60.0))
    legs = legs_of(columns, slack_of(columns), 100.0)
    assert [leg.rising for leg in legs] == [False, True]


def test_noise_alone_is_no_leg() -> None:
    columns = [*walks(bench.stairs(bench.cycles(1), 6.0, 1.5)), *walks(np.zeros(2000))]
    legs = legs_of(columns, slack_of(columns), 35.0)
    assert {leg.run for leg in legs} == {0}


def test_negative_load_is_calibrated_like_positive() -> None:
    log = bench.load_run(QUIET)
    turned = log.with_columns(
        {n: -log[n] for n in ("reference_torque", "sensor_voltage")}, note="turned"
    )
    one, other = (calibrate(g, degree=0, full_scale=70.0) for g in (log, turned))
    assert other["sensitivity"].value == pytest.approx(one["sensitivity"].value, rel=1e-9)
    for name in ("hysteresis", "non-linearity"):
        assert other.figure(name).percent == pytest.approx(one.figure(name).percent, rel=1e-6)


def test_noise_is_said_to_show_no_more_than_all_errors_that_there_are() -> None:
    """Zeros that moved between runs look like very slow noise, whose mean has a huge error."""
    moved = [
        log.with_columns({"sensor_voltage": log["sensor_voltage"] + volts}, note="mounted again")
        for log, volts in zip(
            (bench.load_run(QUIET, seed=k, temperature=20.0 + 6.0 * k) for k in range(3)),
            (0.0, 5e-3, -4e-3),
            strict=True,
        )
    ]
    made = calibrate(moved, degree=1, full_scale=FULL_SCALE)
    asymptotic = np.sqrt(made.uncertainty.noise.long_run_variance / 60.0)  # 6 s at 10 Hz
    assert made["sensitivity"].value * asymptotic > 3.0 * made.rmse
    for figure in made.figures:
        # the largest of so many normal deviates, or twice the usual range of ten, of the RMSE
        most = max(np.sqrt(2.0 * np.log(2.0 * 15 * 12)), 2.0 * 3.078) * made.rmse
        assert figure.noise is None or figure.noise * FULL_SCALE / 100.0 <= most


@pytest.mark.parametrize(("size", "said"), [(0.0, False), (0.05, False), (1.4, True)])
def test_a_line_that_does_not_hold_is_said_in_the_verdict(size: float, said: bool) -> None:
    """Nm of a cubic on 70 Nm: none, 0.07 % and 2 % of the full scale."""
    rig = Bench(bend=size, memory=0.0, ripple=0.0)
    made = calibrate([bench.load_run(rig), bench.drift_run(rig)], full_scale=FULL_SCALE)
    judged = " ".join(str(made).split("\n\n")[0].split())
    assert ("a straight line is off by" in judged) is said
    assert ("No problem was found" in judged) is not said
    warned = [w for w in made.warnings if "the noise alone and not the bend" in w]
    assert bool(warned) is said
    assert all("times the noise of a reading" in w and "--degree 0" not in w for w in warned)
    assert all("the characteristic is bent, and" in w for w in warned)
    assert made.drift_beside_bend or not said


def test_a_loop_whose_middle_is_straight_is_not_called_bent() -> None:
    """At its ends a loop has one side alone, by half of its width beside the middle."""
    made = calibrate([bench.load_run(Bench(bend=0.0, memory=1.4, ripple=0.0))], degree=0,
                     full_scale=FULL_SCALE)  # fmt: skip
    (said,) = [w for w in made.warnings if "a straight line is off" in w]
    apart = made.figure("hysteresis").torque
    assert apart is not None and apart > 1.0
    assert f"is a loop, whose sides are up to {short(apart)} Nm apart, and" in said
    assert said.endswith("hold the noise alone and not the loop")


def test_what_the_readings_of_one_load_differ_by_is_not_called_bent() -> None:
    """A reference that is 1 s late is off as the line is, by no more than the figure's noise."""
    rig = Bench(bend=0.0, memory=0.0, ripple=0.0)
    log = bench.load_run(rig)
    late = np.interp(log["time"] - 1.0, log["time"], log["reference_torque"])
    load = log.with_columns({"reference_torque": late}, note="late")
    made = calibrate([load, bench.drift_run(rig)], full_scale=FULL_SCALE)
    (said,) = [w for w in made.warnings if "a straight line is off" in w]
    figure = made.figure("non-linearity, least squares")
    assert figure.percent is not None and figure.noise is not None
    assert figure.percent <= figure.noise
    assert "no bend that is significant" in said and "is bent" not in said
    assert "a reference that was recorded late" in said
