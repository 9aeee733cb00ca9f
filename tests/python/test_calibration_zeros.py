"""Zeros that differ between runs: found where they moved, not where they stood, and reported."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import calibration_logs as bench
import numpy as np
import pytest
from calibration_logs import QUIET, SENSITIVITY, Bench
from cli_calls import call

import flexspline
from flexspline import InputError, calibrate
from flexspline.calibration import CalibrationResult
from flexspline.calibration.regression import Shape, regress
from flexspline.calibration.runs import calibration_runs
from flexspline.calibration.thermal import LEVEL, zero_test
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.model import Model

DRAWS = 80
FOUR_SIGMA = 4.0  # two-sided 6e-5
MOVED = (0.0, 5e-3, -4e-3, 1e-3, -2e-3)  # V, of the runs, and the temperatures they start at
STARTS = (20.0, 26.0, 32.0, 21.0, 30.0)
SHAPE = Shape(2, 25.0, 0.0, False, 0.0, True, None)  # that of `calibrate` by default
STEP = 1e-4  # V, of the converter


def moved(log: Log, volts: float) -> Log:
    """The log of a sensor whose zero is so many volts higher, through a converter."""
    voltage = STEP * np.round((log["sensor_voltage"] + volts) / STEP)
    return log.with_columns({"sensor_voltage": voltage}, note="mounted again")


def loaded(number: int, volts: float = 0.0, warming: float = 4.0, rig: Bench = QUIET,
           seed: int | None = None) -> Log:  # fmt: skip
    """One cycle of load while the body warms by so many kelvins."""
    torque = bench.stairs(bench.cycles(1, step=10.0), 4.0, 1.0)
    start = STARTS[number % len(STARTS)]
    warmth = np.linspace(start, start + warming, len(torque))
    log = bench.recorded(f"run{number}", torque, warmth, rig, number if seed is None else seed)
    return moved(log, volts)


def remounted(count: int, scale: float = 1.0) -> list[Log]:
    return [loaded(k, scale * MOVED[k]) for k in range(count)]


@cache
def own() -> CalibrationResult:
    return calibrate(remounted(3), zero_per_run=True, full_scale=70.0)


@cache
def shared() -> CalibrationResult:
    return calibrate(remounted(3), full_scale=70.0)


def test_a_zero_that_moved_is_said_with_its_size_and_the_option() -> None:
    (said,) = [w for w in shared().warnings if "zero differs" in w]
    assert "--zero-per-run (zero_per_run=True)" in said
    assert shared().zero_test is not None and shared().zero_test.moved
    # 9 mV between the second and the third run; zeros beside a drift of degree 2 are known to 1 mV
    assert shared().zero_test.spread == pytest.approx(9e-3, abs=1.5e-3)
    assert "Problems: the zero moved between the runs" in " ".join(str(shared()).split())


def test_two_runs_whose_zeros_fit_a_drift_are_found_out_by_the_drift_within_each() -> None:
    made = calibrate(remounted(2))
    assert made.zero_test is not None and made.zero_test.moved


def test_the_chance_of_a_false_alarm_is_the_level_that_is_stated() -> None:
    """Coloured noise, rounding, a drift of degree 2, bend and hysteresis that repeat."""
    found = []
    for draw in range(DRAWS):
        rig = QUIET if draw % 2 else Bench()
        logs = [loaded(k, rig=rig, seed=1000 + 3 * draw + k) for k in range(3)]
        runs, _ = calibration_runs(logs, "reference_torque", None, temperature_needed=True)
        test = zero_test(runs, regress(runs, SHAPE, find_lag=False))
        assert test is not None and test.tested == 2
        found.append(test.p)
    for level in (0.5 * LEVEL, LEVEL, 2.0 * LEVEL, 0.1, 0.5):
        # a share of n draws scatters by √(level (1 - level) / n)
        scatter = np.sqrt(level * (1.0 - level) / DRAWS)
        assert np.mean(np.array(found) < level) < level + FOUR_SIGMA * scatter


@pytest.mark.parametrize("rig", [QUIET, Bench()], ids=["line", "bend, hysteresis and ripple"])
def test_load_in_one_run_and_none_in_the_other_makes_no_zero_that_moved(rig: Bench) -> None:
    made = calibrate([bench.load_run(rig), bench.drift_run(rig, cooling=True)])
    assert made.zero_test is not None and made.zero_test.tested == 1
    assert not made.zero_test.moved
    assert not any("zero differs" in w for w in made.warnings)


def test_a_known_sensitivity_that_is_wrong_makes_no_zero_that_moved() -> None:
    logs = [bench.load_run(QUIET), bench.drift_run(QUIET)]
    assert not any("zero differs" in w for w in calibrate(logs, sensitivity=62.0).warnings)


def test_one_run_has_nothing_to_compare_its_zero_with() -> None:
    for option in (False, True):
        made = calibrate(loaded(0), zero_per_run=option)
        assert made.zero_test is None and made.zeros == ()
        assert "zeros of" not in str(made).lower()


def test_temperature_that_stands_in_each_run_makes_drift_of_a_zero_and_that_is_said() -> None:
    logs = [loaded(k, MOVED[k], warming=0.0) for k in range(2)]
    made = calibrate(logs, degree=1)
    assert made.zero_test is not None and made.zero_test.tested == 0 and not made.zero_test.moved
    assert "could pass for drift here, unseen" in " ".join(str(made).split())


def test_each_zero_sensitivity_and_drift_are_recovered_within_their_errors() -> None:
    made = own()
    for zero, true in zip(made.zeros, MOVED[:3], strict=True):
        volts = float(bench.drift(np.array(25.0))) + true
        assert abs(zero.voltage - volts) < FOUR_SIGMA * zero.voltage_error
        assert abs(zero.torque + SENSITIVITY * volts) < FOUR_SIGMA * zero.torque_error
        beside = SENSITIVITY * (true - np.mean(MOVED[:3]))
        assert zero.beside == pytest.approx(beside, abs=FOUR_SIGMA * zero.torque_error)
    assert abs(made["sensitivity"].value - SENSITIVITY) < 4.0 * made["sensitivity"].standard_error
    slope, bend = bench.DRIFT[1] + 2.0 * 25.0 * bench.DRIFT[2], bench.DRIFT[2]
    for name, volts in (("drift_1", slope), ("drift_2", bend)):
        true = -SENSITIVITY * volts
        assert abs(made[name].value - true) < FOUR_SIGMA * made[name].standard_error
    # with one zero for all runs the drift is off by many of the errors that are honest
    assert (
        abs(shared()["drift_1"].value + SENSITIVITY * slope) > 10 * made["drift_1"].standard_error
    )


def test_errors_of_zeros_are_as_large_as_results_scatter() -> None:
    draws, scores = 60, []
    for draw in range(draws):
        logs = [loaded(k, MOVED[k], seed=500 + 3 * draw + k) for k in range(3)]
        made = calibrate(logs, zero_per_run=True, degree=2)
        true = [float(bench.drift(np.array(25.0))) + volts for volts in MOVED[:3]]
        scores.append([(z.voltage - t) / z.voltage_error
                       for z, t in zip(made.zeros, true, strict=True)])  # fmt: skip
    # the scatter of a standard deviation from n values is 1/√(2n)
    spread = np.sqrt(np.mean(np.square(scores), axis=0))
    assert np.all(np.abs(spread - 1.0) < FOUR_SIGMA / np.sqrt(2 * draws))


def test_the_zero_of_the_model_is_the_mean_of_the_runs_whatever_their_order_and_length() -> None:
    zeros = own().zeros
    assert own()["zero"].value == pytest.approx(np.mean([z.torque for z in zeros]), rel=1e-9)
    back = calibrate(remounted(3)[::-1], zero_per_run=True, full_scale=70.0)
    assert back["zero"].value == pytest.approx(own()["zero"].value, abs=1e-9)
    assert back["zero"].standard_error == pytest.approx(own()["zero"].standard_error, rel=0.05)
    volts, torque = own().zero_spread
    assert volts == pytest.approx(np.std([z.voltage for z in zeros], ddof=1))
    assert torque == pytest.approx(SENSITIVITY * volts, rel=1e-2)


def test_what_runs_on_the_joint_is_off_by_what_the_table_says() -> None:
    for run, zero, log in zip(own().runs, own().zeros, remounted(3), strict=True):
        read = flexspline.estimate(own().model, log)["sensor_torque"]
        np.testing.assert_allclose(read, run.reference + run.error + zero.beside, rtol=0, atol=1e-9)


def test_a_run_that_was_left_out_is_read_with_the_mean_zero_of_the_others() -> None:
    made = calibrate(remounted(5), zero_per_run=True, degree=1)
    assert made.validated_by == "runs"
    for run, zero in zip(made.runs, made.zeros, strict=True):
        # R zeros: the mean of the others is off by R/(R-1) of what the mean of all is off by
        expected = zero.beside * len(made.zeros) / (len(made.zeros) - 1)
        # the drift of the others is extrapolated, over 5 K at most
        assert float(np.mean(run.held_out)) == pytest.approx(expected, abs=0.05)
    assert made.cv_rmse > made.zero_spread[1] > 5.0 * made.rmse
    assert "has an unknown zero" in " ".join(str(made).split())


def test_a_block_is_read_with_the_zero_of_its_run_and_that_is_said() -> None:
    assert own().validated_by == "blocks"
    assert own().cv_rmse < 2.0 * own().rmse
    assert "with the zero of the rest of its run" in " ".join(str(own()).split())


def test_zeros_that_differ_do_not_widen_repeatability_where_each_run_has_its_own() -> None:
    before, after = (made.figure("repeatability").torque for made in (shared(), own()))
    assert before is not None and after is not None and after < 0.3 * before
    assert "each run read with its own zero" in " ".join(str(own()).split())


def test_a_drift_that_no_run_shows_by_itself_is_refused_in_one_sentence() -> None:
    steady = [loaded(k, warming=0.0) for k in range(3)]
    with pytest.raises(InputError, match="stays the same within each run") as raised:
        calibrate(steady, zero_per_run=True)
    assert "\n" not in str(raised.value) and "--degree 0" in str(raised.value)
    assert len(calibrate(steady, zero_per_run=True, degree=0).zeros) == 3
    slow = [loaded(k, warming=0.8) for k in range(2)]
    with pytest.raises(InputError, match=r"degree 2 at most .* degree = 3"):
        calibrate(slow, zero_per_run=True, degree=3)


def test_a_drift_in_volts_alone_has_zeros_in_volts() -> None:
    logs = [bench.drift_run(QUIET, seed=k, name=f"warm-up {k}") for k in range(2)]
    made = calibrate([moved(log, MOVED[k]) for k, log in enumerate(logs)], zero_per_run=True)
    assert made.unit == "V"
    gap = made.zeros[1].voltage - made.zeros[0].voltage
    assert gap == pytest.approx(MOVED[1], abs=FOUR_SIGMA * 2.0 * made.zeros[0].voltage_error)
    assert "nan" not in str(made)
    made.plot()


def test_a_lag_and_a_gradient_are_fitted_beside_the_zeros() -> None:
    rig = Bench(bend=0.0, memory=0.0, ripple=0.0, lag=30.0, gradient=0.2)
    logs = [bench.load_run(rig), moved(bench.drift_run(rig, cooling=True), 5e-3)]
    made = calibrate(logs, zero_per_run=True, thermal_lag="fit", gradient="fit")
    for name, true in (("thermal_lag", 30.0), ("gradient", 0.2)):
        assert abs(made[name].value - true) < FOUR_SIGMA * made[name].standard_error
    assert made.zeros[1].voltage - made.zeros[0].voltage == pytest.approx(5e-3, abs=0.3e-3)


def test_the_command_writes_zeros_to_model_text_and_report(tmp_path: Path) -> None:
    paths = []
    for log in remounted(3):
        paths.append(tmp_path / f"{log.name}.csv")
        write_log(log, paths[-1])
    result = call("calibrate", *paths, "--zero-per-run", "--out", tmp_path / "sensor")
    assert result.exit_code == 0, result.stderr
    assert "Zeros of 3 runs, standard deviation 0.2" in result.stdout
    page = (tmp_path / "sensor" / "report.html").read_text(encoding="utf-8")
    assert "Zeros of 3 runs" in page and "zero_per_run=True" in page
    held = Model.load(tmp_path / "sensor" / "model.json").estimators["calibration"]
    zeros = held.record["zeros"]  # type: ignore[union-attr]
    assert [zero["run"] for zero in zeros] == ["run0", "run1", "run2"]
    assert held.zero == pytest.approx(np.mean([zero["torque"] for zero in zeros]))  # type: ignore[union-attr]


def test_the_fragment_for_notebooks_shows_the_zeros() -> None:
    page = own()._repr_html_()
    assert "read with the mean zero, it is off by" in page and "run1" in page
    assert "read with the mean zero" not in shared()._repr_html_()
