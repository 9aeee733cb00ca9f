"""Degree, distinct temperatures, thermistor, heating and cooling, lag and gradient."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import calibration_logs as bench
import numpy as np
import pytest
from calibration_logs import FULL_SCALE, QUIET, Array, Bench

from flexspline import InputError, Thermistor, _core, calibrate
from flexspline.calibration import regression, structure
from flexspline.calibration.result import CalibrationResult
from flexspline.calibration.runs import CalibrationRun, calibration_runs
from flexspline.calibration.thermal import count_temperatures
from flexspline.least_squares.uncertainty import parameter_uncertainty
from flexspline.report.calibration import calibration_lines

FOUR_SIGMA = 4.0
LAG, GRADIENT = 40.0, 0.05
LAGGING = Bench(bend=0.0, memory=0.0, ripple=0.0, lag=LAG, gradient=GRADIENT)
DIVIDER = Thermistor(3.3, 10e3, 10e3, 3435.0)


@cache
def lagging(fitted: bool) -> CalibrationResult:
    logs = [bench.load_run(LAGGING, count=1), bench.drift_run(LAGGING, cooling=True)]
    how = "fit" if fitted else 0.0
    return calibrate(logs, thermal_lag=how, gradient=how, full_scale=FULL_SCALE)


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_fewer_than_degree_plus_one_temperatures_are_refused_and_counted(degree: int) -> None:
    levels = np.repeat(np.linspace(20.0, 45.0, degree), 400)
    log = bench.recorded("few", np.zeros(len(levels)), levels, QUIET, 3)
    count = f"{degree} distinct temperature{'' if degree == 1 else 's'} "
    with pytest.raises(InputError, match=f"{count}.*degree {degree} needs {degree + 1}"):
        calibrate(log, degree=degree)


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_degree_plus_one_temperatures_are_enough(degree: int) -> None:
    levels = np.repeat(np.linspace(20.0, 45.0, degree + 1), 400)
    log = bench.recorded("enough", np.zeros(len(levels)), levels, QUIET, 3)
    assert len(calibrate(log, degree=degree).drift_polynomial) == degree + 1


def test_noise_of_the_thermometer_makes_no_new_temperatures() -> None:
    rng = np.random.default_rng(1)
    assert count_temperatures([25.0 + rng.normal(0.0, 0.3, 20_000)], 0.3) < 4
    assert count_temperatures([np.array([20.0, 20.4, 25.0, 25.1])], 0.0) == 2


def test_a_cubic_drift_needs_and_gets_a_cubic() -> None:
    warmth = bench.stairs(bench.thermal_steps(), 60.0, 60.0)
    log = bench.recorded("cubic", np.zeros(len(warmth)), warmth, QUIET, 3)
    bent = log["sensor_voltage"] + 2e-6 * (warmth - 25.0) ** 3
    log = log.with_columns({"sensor_voltage": bent}, note="cubic")
    third = calibrate(log, degree=3)
    square = calibrate(log, degree=2)
    cubic = third.drift_polynomial[3]
    assert abs(cubic.value - 2e-6) < FOUR_SIGMA * cubic.standard_error
    assert third.cv_rmse < square.cv_rmse


def test_the_drift_does_not_depend_on_where_it_is_counted_from() -> None:
    log = bench.drift_run(QUIET)
    one, other = (calibrate(log, reference_temperature=t) for t in (25.0, 40.0))
    for a, b in zip(one.drift_polynomial, other.drift_polynomial, strict=True):
        assert a.value == pytest.approx(b.value, rel=1e-8)
        assert a.standard_error == pytest.approx(b.standard_error, rel=1e-4)


def test_the_band_of_the_drift_holds_the_truth() -> None:
    made = calibrate([bench.load_run(QUIET), bench.drift_run(QUIET, cooling=True)])
    grid = np.linspace(20.0, 45.0, 26)
    values, errors = made.drift_voltage(grid)
    assert np.all(np.abs(values - bench.drift(grid)) < FOUR_SIGMA * errors)


def test_a_thermistor_stands_in_for_the_temperature() -> None:
    logs = [bench.load_run(QUIET, count=1), bench.drift_run(QUIET)]
    plain = calibrate(logs)
    divided = [
        bench.without(
            log.with_columns(
                {
                    "thermistor_voltage": _core.thermistor_voltage(
                        log["temperature"], **DIVIDER.to_json()
                    )
                },
                note="divider",
            ),
            "temperature",
        )
        for log in logs
    ]
    made = calibrate(divided, thermistor=DIVIDER)
    assert made.model.estimators["thermistor"] == DIVIDER
    for name in ("sensitivity", "zero", "drift_1", "drift_2"):
        assert made[name].value == pytest.approx(plain[name].value, rel=1e-6)
    again = calibrate(divided, into=made.model)  # the constants of the model
    assert again["drift_2"].value == made["drift_2"].value


@pytest.mark.parametrize("hotter", [0.0, 200.0])
def test_a_thermistor_that_reads_what_no_joint_bears_is_told(hotter: float) -> None:
    log = bench.drift_run(QUIET)
    volts = _core.thermistor_voltage(log["temperature"] + hotter, **DIVIDER.to_json())
    divided = log.with_columns({"thermistor_voltage": volts}, note="divider")
    made = calibrate(bench.without(divided, "temperature"), thermistor=DIVIDER)
    told = [said for said in made.warnings if "thermistor reads above 200 °C" in said]
    assert len(told) == (1 if hotter else 0)


def test_an_open_or_unknown_thermistor_is_refused() -> None:
    log = bench.without(bench.drift_run(QUIET), "temperature")
    rng = np.random.default_rng(2)
    volts = 1.5 + rng.normal(0.0, 0.01, len(log))
    volts[100:103] = 3.3 + rng.uniform(0.01, 0.02, 3)
    open_circuit = log.with_columns({"thermistor_voltage": volts}, note="open")
    with pytest.raises(InputError, match=r"in 3 rows, first in row 100 .*open or short circuit"):
        calibrate(open_circuit, thermistor=DIVIDER)
    with pytest.raises(InputError, match="thermistor_voltage needs the constants"):
        calibrate(open_circuit)


def test_heating_alone_shows_no_thermal_hysteresis() -> None:
    made = calibrate([bench.load_run(QUIET, count=1), bench.drift_run(QUIET)])
    figure = made.figure("thermal hysteresis, compensated")
    assert figure.percent is None and "only rises" in figure.reason
    assert [leg.heating for leg in made.thermal_legs] == [True]


def test_heating_and_cooling_are_reported_by_themselves() -> None:
    made = calibrate([bench.load_run(QUIET, count=1), bench.drift_run(QUIET, cooling=True)])
    assert [leg.heating for leg in made.thermal_legs] == [True, False]
    assert "Heating in drift" in str(made) and "Cooling in drift" in str(made)
    figure = made.figure("thermal hysteresis, compensated")
    assert figure.percent is not None and figure.noise is not None
    assert figure.percent < 2.0 * figure.noise


def test_a_body_that_lags_shows_as_thermal_hysteresis_and_is_said_to() -> None:
    made = lagging(False)
    figure = made.figure("thermal hysteresis, compensated")
    assert figure.percent is not None and figure.noise is not None
    assert figure.percent > 2.0 * figure.noise
    assert any("thermal_lag='fit'" in said for said in made.warnings)


def test_lag_and_gradient_are_found_within_their_errors() -> None:
    made = lagging(True)
    for name, true in (("thermal_lag", LAG), ("gradient", GRADIENT)):
        parameter = made[name]
        assert parameter.determined
        assert abs(parameter.value - true) < FOUR_SIGMA * parameter.standard_error
        assert parameter.standard_error < 0.2 * true
    assert made.compensation is not None
    assert made.compensation.thermal_lag == made["thermal_lag"].value
    assert made.compensation.gradient == made["gradient"].value


def test_the_noise_of_one_reading_is_not_what_a_body_that_lags_starts_from() -> None:
    """It stayed for the length of the lag, and intervals of 95 % covered 87 %, or hardly half."""
    rig = replace(LAGGING, noise=1e-4, gradient=0.2, thermometer=0.05)
    grid = np.array([22.0, 25.0, 40.0])
    off = []
    for seed in range(30):
        logs = [
            bench.load_run(rig, count=1, seed=2 * seed + 1),
            bench.drift_run(rig, seed=2 * seed),
        ]
        made = calibrate(logs, thermal_lag=LAG, gradient=rig.gradient, full_scale=FULL_SCALE)
        values, errors = made.drift_voltage(grid)
        off.append((values - bench.drift(grid)) / errors)
    # the mean of 30 squares of a standard normal number is below 1.99 in 99.9 % of cases
    assert np.mean(np.square(off), axis=0).max() < 1.99


def test_a_first_temperature_is_replaced_within_its_noise_alone() -> None:
    def run(temperature: Array, thermometer: float) -> CalibrationRun:
        rig = replace(QUIET, thermometer=thermometer)
        log = bench.recorded("run", np.zeros(2000), temperature, rig, 3)
        return calibration_runs([log], None, None, temperature_needed=True)[0][0]

    level, noise = np.full(2000, 25.0), 0.02
    stepped = np.concatenate([[20.0], level[1:]])
    for kept in (run(stepped, noise), run(stepped, 0.0), run(level, 0.0)):
        assert kept.temperature_of_body is kept.temperature
    flat = run(level, noise)
    assert flat.temperature_of_body is not None and flat.temperature is not None
    assert np.array_equal(flat.temperature_of_body[1:], flat.temperature[1:])
    error = 2.0 * noise / np.sqrt(40.0)  # of the end of a line through a fiftieth of the rows
    assert abs(flat.temperature_of_body[0] - 25.0) < FOUR_SIGMA * error


def test_a_fitted_lag_removes_the_thermal_hysteresis_on_rows_never_seen_too() -> None:
    before, after = lagging(False), lagging(True)
    left = after.figure("thermal hysteresis, compensated")
    assert left.percent is not None and left.noise is not None
    assert left.percent < 2.0 * left.noise
    assert after.cv_rmse < before.cv_rmse


def test_the_least_of_several_minima_over_the_lag_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A narrow minimum between two lags of the grid is passed over where another is wide."""

    def squares(sums: object) -> SimpleNamespace:
        logarithm = np.log(sums)  # the lag, as the sums below hold it
        wide = 0.01 * (logarithm - np.log(0.5)) ** 2
        narrow = 4.0 * (logarithm - np.log(LAG)) ** 2 - 0.1
        return SimpleNamespace(residual_squares=1.0 + min(wide, narrow, 1.0))

    monkeypatch.setattr(regression, "sums_of", lambda runs, shape, edges, structure: shape.lag)
    monkeypatch.setattr(regression, "solution_of", squares)
    monkeypatch.setattr(regression, "_limits", lambda runs: np.array([0.2, 150.0]))
    grid = np.linspace(np.log(0.2), np.log(150.0), regression.GRID)
    seen = [squares(np.exp(point)).residual_squares for point in grid]
    assert abs(grid[int(np.argmin(seen))] - np.log(0.5)) < 0.5  # the wide one, by the grid alone
    shape = regression.Shape(2, 25.0, 0.0, True, 0.0, True, None)
    assert regression.search_lag([], shape, []).value == pytest.approx(LAG, rel=1e-3)


def test_a_given_lag_and_gradient_are_used_and_not_fitted() -> None:
    logs = [bench.load_run(LAGGING, count=1), bench.drift_run(LAGGING, cooling=True)]
    made = calibrate(logs, thermal_lag=LAG, gradient=GRADIENT)
    assert made["thermal_lag"].state == "fixed"
    assert made.compensation is not None
    assert (made.compensation.thermal_lag, made.compensation.gradient) == (LAG, GRADIENT)
    assert made.rmse == pytest.approx(lagging(True).rmse, rel=0.01)


def test_a_lag_that_is_not_there_is_not_told_apart_from_zero() -> None:
    logs = [bench.load_run(QUIET, count=1), bench.drift_run(QUIET, cooling=True)]
    made = calibrate(logs, thermal_lag="fit")
    lag = made["thermal_lag"]
    assert not lag.determined or not lag.significant
    steps = np.full(2000, 25.0)
    rest = bench.recorded("rest", np.zeros(2000), steps, Bench(thermometer=0.0), 3)
    warm = bench.recorded("warm", np.zeros(2000), steps + 10.0, Bench(thermometer=0.0), 4)
    still = calibrate([rest, warm], degree=1, thermal_lag="fit")
    assert not still["thermal_lag"].determined
    assert any("say nothing of a thermal lag" in said for said in still.warnings)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"degree": 7}, "whole number from 0 to 6"),
        ({"degree": 1.5}, "whole number from 0 to 6"),
        ({"degree": True}, "whole number from 0 to 6"),
        ({"thermal_lag": "yes"}, "or 'fit' to find it"),
        ({"thermal_lag": -1.0}, "below 0"),
        ({"gradient": 0.1}, "give thermal_lag as well"),
        ({"degree": 0, "thermal_lag": 3.0}, "degree of 1 or more for a lag"),
        ({"reference_temperature": np.nan}, "no finite number"),
        ({"full_scale": 0.0}, "above zero"),
        ({"sensitivity": 0.0}, "reads nothing"),
        ({"thermistor": {"supply_voltage": 3.3}}, "lacks 'divider_resistance'"),
    ],
)
def test_arguments_without_sense_are_refused(arguments: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        calibrate(bench.drift_run(QUIET), **arguments)  # type: ignore[arg-type]


def warm_loads(per_kelvin: float, seed: int, rig: Bench = QUIET) -> CalibrationResult:
    """Load at 15, 25 and 40 °C and a drift without load; the gain changes by so much per kelvin."""
    logs = [bench.drift_run(rig, seed=seed)]
    for number, warmth in enumerate((15.0, 25.0, 40.0)):
        log = bench.load_run(rig, seed=10 * seed + number, count=1, temperature=warmth)
        more = per_kelvin * (log["temperature"] - 25.0) * log["reference_torque"]
        voltage = log["sensor_voltage"] + more / bench.SENSITIVITY
        logs.append(log.with_columns({"sensor_voltage": voltage}, note="a warmer bridge"))
    return calibrate(logs, full_scale=FULL_SCALE)


@pytest.mark.parametrize("rig", [QUIET, Bench()], ids=["line", "bend and hysteresis"])
@pytest.mark.parametrize("per_kelvin", [1e-3, -3e-4])
def test_a_gain_that_changes_with_temperature_is_named_with_its_size(
    per_kelvin: float, rig: Bench
) -> None:
    made = warm_loads(per_kelvin, 3, rig)
    assert made.gain_test is not None and made.gain_test.changes
    assert made.gain_test.per_kelvin == pytest.approx(per_kelvin, rel=0.03)
    assert "the gain changes with temperature" in " ".join(str(made).split("\n\n")[0].split())
    assert any("gain_temperature_dependence" in said for said in made.warnings)
    assert made.uncertainty.reliable and not any("record longer" in w for w in made.warnings)


def test_a_gain_that_stays_is_called_one_that_changes_once_in_a_hundred_calibrations() -> None:
    """Of 20, more than two with a chance of 1 in 1000."""
    tests = [warm_loads(0.0, seed, Bench()).gain_test for seed in range(20)]
    assert sum(test is not None and test.changes for test in tests) <= 2
    off = [test.per_kelvin / test.error for test in tests if test is not None]
    assert len(off) == 20
    assert np.mean(np.square(off)) < 1.0 + FOUR_SIGMA * np.sqrt(2 / 20)


def test_load_at_one_temperature_does_not_show_a_gain_against_temperature() -> None:
    made = calibrate([bench.load_run(QUIET), bench.drift_run(QUIET)], full_scale=FULL_SCALE)
    assert made.gain_test is None
    said = " ".join(str(made).split("\n\n")[0].split())
    assert "do not show: thermal hysteresis, gain against temperature" in said
    assert "gain against temperature" not in str(warm_loads(0.0, 3))


def test_all_tests_of_a_sensor_take_noise_and_errors_from_one_function(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    callers = []

    def noted(*given: Any, **named: Any) -> Any:
        callers.append(sys._getframe(1).f_code.co_name)
        return parameter_uncertainty(*given, **named)

    monkeypatch.setattr(structure, "parameter_uncertainty", noted)
    made = warm_loads(1e-3, 3)
    assert None not in (made.zero_test, made.gain_test, made.delay_test)
    assert len(callers) == 4 and set(callers) == {"wald_test"}  # and whether bend shows


BENT = Bench(ripple=0.0, lag=LAG)


def bent(seed: int, rig: Bench = BENT, moved: float = 0.0, **how: Any) -> CalibrationResult:
    """Load at 25, 25 and 40 °C and one warm-up without load, whose zero has moved, V."""
    loads = [
        bench.load_run(rig, seed=10 * seed + k, count=1, temperature=warmth)
        for k, warmth in enumerate((25.0, 25.0, 40.0))
    ]
    time = np.arange(0.0, 1800.0, 0.1)
    warmth = 22.0 + 25.0 * -np.expm1(-time / 500.0)
    warm = bench.recorded("warm", np.zeros(len(time)), warmth, rig, 10 * seed + 9)
    volts = {"sensor_voltage": warm["sensor_voltage"] + moved}
    logs = [*loads, warm.with_columns(volts, note="zeroed again")]
    return calibrate(logs, thermal_lag="fit", full_scale=FULL_SCALE, **how)


@pytest.mark.parametrize("own", [False, True])
def test_bend_and_hysteresis_of_load_runs_do_not_go_into_drift_and_lag(own: bool) -> None:
    grid = np.array([22.0, 25.0, 40.0])
    lags, drifts = [], []
    for seed in range(10):
        made = bent(seed, zero_per_run=own)
        assert made.drift_beside_bend
        lag = made["thermal_lag"]
        lags.append((lag.value - LAG) / lag.standard_error)
        slope = np.diff(made.drift_voltage(grid)[0] - bench.drift(grid))
        drifts.append(np.abs(slope).max())
    # the mean of 10 squares of a standard normal number is below 2.96 in 99.9 % of cases
    assert np.mean(np.square(lags)) < 2.96
    assert max(drifts) < 0.3 * 0.2 / bench.SENSITIVITY  # of the hysteresis
    assert "found beside bend and hysteresis" in " ".join(str(made).split())


def test_a_bend_is_no_zero_that_moved_and_needs_no_second_calibration() -> None:
    made = bent(1)
    assert made.zero_test is not None and not made.zero_test.moved
    (said,) = [said for said in made.warnings if "a straight line is off" in said]
    assert "the errors of sensitivity and zero hold the noise alone" in said
    assert "calibrate the runs with load alone" not in said


def test_a_line_without_bend_is_calibrated_as_before() -> None:
    made = bent(1, replace(LAGGING, gradient=0.0))
    assert not made.drift_beside_bend
    assert "found beside bend" not in str(made)


def test_a_lag_that_holds_a_zero_that_moved_says_so_in_its_own_line() -> None:
    made = bent(1, moved=3e-3)
    assert made.zero_test is not None and made.zero_test.moved
    (line,) = [one for one in calibration_lines(made) if one.name == "thermal lag"]
    assert "holds zeros that moved, its error does not" in line.remark and line.concern
    assert any(
        "drift, thermal lag and their errors hold the difference" in w for w in made.warnings
    )
    (line,) = [one for one in calibration_lines(bent(1)) if one.name == "thermal lag"]
    assert "holds" not in line.remark and not line.concern


def test_a_bend_that_no_run_tells_from_the_drift_is_said_in_the_line_of_the_drift() -> None:
    torque = bench.stairs(bench.cycles(2), 6.0, 1.5)
    warmth = 25.0 + 10.0 * (torque / FULL_SCALE) ** 2
    rig = Bench(bend=1.0, thermometer=0.0, reference_noise=0.0)
    made = calibrate(bench.recorded("one", torque, warmth, rig, 3), degree=1)
    assert not made.drift_beside_bend and made.bend_taken
    (line,) = [one for one in calibration_lines(made) if one.name == "drift 1"]
    assert "may be a bend, its error does not hold that" in line.remark and line.concern


@pytest.mark.parametrize("own", [False, True])
def test_a_run_that_alone_determines_the_lag_is_not_held_out_as_a_whole(own: bool) -> None:
    made = bent(2, zero_per_run=own)
    assert made.validated_by == "blocks"
    (instead,) = made.instead
    assert instead.label == "warm" and "thermal_lag" in instead.names
    assert made.cv_rmse < 2.0 * made.rmse
    said = " ".join(str(made).split())
    assert "No whole run is held out, for warm alone determines drift 1, drift 2" in said
    named = "and warm, 0 to 224.9 s alone determines drift 1, drift 2, thermal lag." in said
    assert named is bool(made.alone) is own  # beside a zero of its own its beginning tells all


def test_a_part_that_alone_determines_the_drift_is_named_beside_its_error() -> None:
    warmth = np.where(np.arange(6000) < 5600, 25.0, 35.0)
    warm = bench.recorded("warm", np.zeros(6000), warmth, QUIET, 3)
    made = calibrate([bench.load_run(QUIET, count=1), warm], degree=1, full_scale=FULL_SCALE)
    (alone,) = made.alone
    assert alone.label.startswith("warm") and alone.names == ("drift_1",)
    first = " ".join(str(made).split("\n\n")[0].split())
    assert f"parts, and {alone.label} alone determines drift 1." in first
