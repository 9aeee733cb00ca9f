"""`calibrate`: sensitivity, zero and drift with honest errors, alone and together."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import calibration_logs as bench
import numpy as np
import pytest
from calibration_logs import QUIET, SENSITIVITY, Bench

import flexspline
from flexspline import Calibration, InputError, Model, TemperatureCompensation, calibrate
from flexspline.calibration import CalibrationResult
from flexspline.logs.log import Log

SEEDS = 40
FOUR_SIGMA = 4.0  # two-sided 6e-5
TRUE_ZERO = -SENSITIVITY * float(bench.drift(np.array(25.0)))  # Nm: torque at 0 V and 25 °C


@cache
def whole() -> CalibrationResult:
    """Two cycles of load and a warm-up with cooling, with bend, hysteresis and ripple."""
    return calibrate([bench.load_run(), bench.drift_run(cooling=True)], full_scale=70.0)


@cache
def quiet() -> CalibrationResult:
    """The same rig without what the model lacks."""
    return calibrate([bench.load_run(QUIET), bench.drift_run(QUIET, cooling=True)])


def test_sensitivity_and_zero_of_25_are_recovered_within_their_errors() -> None:
    made = quiet()
    for name, true in (("sensitivity", SENSITIVITY), ("zero", TRUE_ZERO)):
        parameter = made[name]
        assert abs(parameter.value - true) < FOUR_SIGMA * parameter.standard_error
        assert parameter.determined and parameter.significant


def test_the_polynomial_of_24_is_recovered_within_its_errors() -> None:
    for parameter, true in zip(quiet().drift_polynomial, bench.DRIFT, strict=True):
        assert abs(parameter.value - true) < FOUR_SIGMA * parameter.standard_error
        assert parameter.standard_error < 0.1 * abs(true)


def test_errors_are_as_large_as_results_scatter() -> None:
    scores = []
    for seed in range(SEEDS):
        load = bench.load_run(QUIET, seed=2 * seed, count=1)
        made = calibrate([load, bench.drift_run(QUIET, seed=2 * seed + 1)])
        found = [(made["sensitivity"], SENSITIVITY), (made["zero"], TRUE_ZERO)]
        found += list(zip(made.drift_polynomial, bench.DRIFT, strict=True))
        scores.append([(p.value - true) / p.standard_error for p, true in found])
    spread = np.std(scores, axis=0)
    # the scatter of a standard deviation from n values is 1/√(2n)
    assert np.all(np.abs(spread - 1.0) < FOUR_SIGMA / np.sqrt(2 * SEEDS))


def test_errors_that_take_every_sample_for_news_are_too_small() -> None:
    zero = quiet()["zero"]
    # AR(1) with 0.9 under white reference noise: more than twice, √19 at most
    assert 2.0 < zero.standard_error / zero.naive_error < np.sqrt(19.0)


def test_noise_of_the_voltage_does_not_bend_the_sensitivity() -> None:
    noisy = Bench(bend=0.0, memory=0.0, ripple=0.0, noise=0.03, persistence=0.0)
    logs = [bench.load_run(noisy, seed=seed) for seed in range(10)]
    made = [calibrate(log, degree=0)["sensitivity"] for log in logs]
    error = np.mean([p.standard_error for p in made]) / np.sqrt(len(made))
    assert abs(np.mean([p.value for p in made]) - SENSITIVITY) < FOUR_SIGMA * error
    other_way = [np.polyfit(g["sensor_voltage"], g["reference_torque"], 1)[0] for g in logs]
    signal = np.var(logs[0]["reference_torque"]) / SENSITIVITY**2
    attenuated = SENSITIVITY * signal / (signal + noisy.noise**2)
    assert np.mean(other_way) == pytest.approx(attenuated, abs=FOUR_SIGMA * error)
    assert attenuated < SENSITIVITY - 10.0 * error


def test_noise_of_the_reference_that_matters_is_said() -> None:
    noisy = Bench(bend=0.0, memory=0.0, ripple=0.0, reference_noise=1.0)
    made = calibrate(bench.load_run(noisy), degree=0)
    assert any("noise of the reference" in said for said in made.warnings)
    assert not any("noise of the reference" in said for said in quiet().warnings)


def test_without_load_the_drift_is_fitted_in_volts_alone() -> None:
    made = calibrate(bench.drift_run(QUIET, cooling=True))
    assert made.calibration is None and made.compensation is None
    assert made.model.estimators == {}
    assert made.unit == "V" and made.torque_parameters == ()
    for parameter, true in zip(made.drift_polynomial, bench.DRIFT, strict=True):
        assert abs(parameter.value - true) < FOUR_SIGMA * parameter.standard_error
    assert "never leaves zero" in made.sensitivity_reason
    assert "not determined" in str(made)


def test_without_load_and_with_a_known_sensitivity_the_drift_is_in_torque_too() -> None:
    log = bench.without(bench.drift_run(QUIET, cooling=True), "reference_torque")
    made = calibrate(log, reference=None, sensitivity=SENSITIVITY)
    assert made["sensitivity"].state == "fixed"
    volts, torque = made.voltage_parameters, made.torque_parameters
    for v, t in zip(volts, torque[1:], strict=True):
        assert t.value == pytest.approx(-SENSITIVITY * v.value, rel=1e-12)
        assert t.standard_error == pytest.approx(SENSITIVITY * v.standard_error, rel=1e-9)
    assert abs(made["zero"].value - TRUE_ZERO) < FOUR_SIGMA * made["zero"].standard_error


def test_a_drift_run_into_a_calibrated_model_keeps_its_sensitivity() -> None:
    first = calibrate(bench.load_run(QUIET), degree=0)
    assert set(first.model.estimators) == {"calibration"}
    drift = bench.without(bench.drift_run(QUIET), "reference_torque")
    second = calibrate(drift, reference=None, into=first.model)
    before, after = (m.estimators["calibration"] for m in (first.model, second.model))
    assert isinstance(before, Calibration) and isinstance(after, Calibration)
    assert after.sensitivity == before.sensitivity
    assert after.voltage_range == before.voltage_range
    assert after.full_scale == before.full_scale
    assert isinstance(second.model.estimators["temperature_compensation"], TemperatureCompensation)


def test_a_calibration_without_temperature_drops_an_older_compensation() -> None:
    again = calibrate(bench.load_run(QUIET), degree=0, into=quiet().model)
    assert set(again.model.estimators) == {"calibration"}


def test_other_estimators_and_facts_of_the_model_are_kept() -> None:
    collision = flexspline.Collision("sensor", (), (0.3,), (0.3,))
    model = Model({}, {"joint": "elbow"}).with_estimator(collision)
    made = calibrate([bench.load_run(QUIET), bench.drift_run(QUIET)], into=model)
    assert made.model.estimators["collision"] == collision
    assert made.model.facts["joint"] == "elbow"


def test_the_model_survives_its_file() -> None:
    again = Model.from_json(whole().model.to_json())
    assert again.estimators == whole().model.estimators
    record = again.estimators["calibration"].record  # type: ignore[union-attr]
    names = [p["name"] for p in record["parameters"]]
    assert names == ["sensitivity", "zero", "drift_1", "drift_2"]
    assert [f["name"] for f in record["figures"]] == [f.name for f in whole().figures]
    assert record["logs"][0]["rows"] == len(bench.load_run())


def test_what_runs_on_the_joint_reads_what_the_calibration_judged() -> None:
    made = whole()
    for run, log in zip(made.runs, [bench.load_run(), bench.drift_run(cooling=True)], strict=True):
        read = flexspline.estimate(made.model, log)["sensor_torque"]
        np.testing.assert_allclose(read, run.reference + run.error, rtol=0, atol=1e-9)


def test_readings_outside_the_fitted_temperatures_are_flagged() -> None:
    hot = bench.recorded("hot", np.zeros(200), np.full(200, 60.0), QUIET, 9)
    status = flexspline.estimate(quiet().model, hot)["status"].astype(int)
    assert np.all(status & 1)
    inside = bench.recorded("mild", np.zeros(200), np.full(200, 30.0), QUIET, 9)
    assert not np.any(flexspline.estimate(quiet().model, inside)["status"].astype(int) & 1)


def test_what_was_held_out_is_no_better_than_what_was_fitted() -> None:
    made = whole()
    assert made.cv_rmse >= made.rmse
    assert made.worst_fold >= made.median_fold >= min(made.fold_rmses)
    assert made.validated_by == "blocks" and len(made.fold_rmses) == 8


def test_four_runs_are_held_out_whole() -> None:
    logs: list[Log] = []
    for seed in range(2):
        load, drift = bench.load_run(QUIET, seed=seed), bench.drift_run(QUIET, seed=10 + seed)
        logs += [
            load.with_facts({"name": f"load{seed}"}),
            drift.with_facts({"name": f"drift{seed}"}),
        ]
    made = calibrate(logs)
    assert made.validated_by == "runs"
    assert made.fold_labels == ("load0", "drift0", "load1", "drift1")
    assert made.worst_fold < 2.0 * made.median_fold


def test_a_run_that_alone_holds_the_load_is_not_held_out_whole() -> None:
    logs = [bench.load_run(QUIET, count=1)]
    logs += [bench.drift_run(QUIET, seed=s, name=f"drift{s}") for s in range(3)]
    assert calibrate(logs).validated_by == "blocks"


def test_load_that_nearly_follows_temperature_is_named_as_confounded() -> None:
    made = calibrate(load_beside_temperature("saturating", seed=5), degree=2)
    assert any("sensitivity" in group.names for group in made.confounded)
    assert "not determined alone: sensitivity" in str(made)
    assert not made["sensitivity"].determined


def load_beside_temperature(course: str, seed: int, thermometer: float = 0.02) -> Log:
    """Load and temperature that both change all the time; the thermometer has noise, K."""
    u = np.linspace(0.0, 1.0, 6000)
    levels = np.arange(0.0, 71.0, 10.0)
    shares = {
        "ramp": u,
        "saturating": 1.0 - np.exp(-3.0 * u),
        "there and back": 1.0 - np.abs(2.0 * u - 1.0),
        "cosine": 0.5 - 0.5 * np.cos(np.pi * u),
        "stairs": bench.stairs(levels, 20.0, 2.0) / 70.0,
    }
    share = shares[course]
    warmth = 20.0 + 25.0 * (share if course == "stairs" else u)
    rig = replace(QUIET, thermometer=thermometer)
    log = bench.recorded("both", 70.0 * share, warmth, rig, seed)
    linear = np.polynomial.polynomial.polyval(warmth, bench.DRIFT[:2]) - bench.drift(warmth)
    return log.with_columns({"sensor_voltage": log["sensor_voltage"] + linear}, note="linear drift")


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("course", ["ramp", "saturating", "there and back", "cosine", "stairs"])
def test_a_sensitivity_holds_the_truth_or_is_refused_whatever_the_degree(
    course: str, degree: int
) -> None:
    for seed, thermometer in enumerate((0.02, 0.02, 0.0, 0.05)):
        try:
            found = calibrate(load_beside_temperature(course, seed, thermometer), degree=degree)[
                "sensitivity"
            ]
        except InputError as error:
            assert "load and temperature change together" in str(error)
            assert "\n" not in str(error)
            continue
        assert abs(found.value - SENSITIVITY) < FOUR_SIGMA * found.standard_error


def test_load_that_follows_temperature_is_refused_unless_the_sensitivity_is_known() -> None:
    log = load_beside_temperature("ramp", 5)
    with pytest.raises(InputError, match=r"change together .* drift of degree 1 cannot") as raised:
        calibrate(log, degree=1)
    assert "smaller degree" not in str(raised.value)
    made = calibrate(log, degree=1, sensitivity=SENSITIVITY)
    assert made["sensitivity"].state == "fixed" and "change" not in made.sensitivity_reason


def test_a_run_with_load_at_a_steady_temperature_tells_load_and_temperature_apart() -> None:
    made = calibrate([load_beside_temperature("ramp", 5), bench.load_run(QUIET)], degree=1)
    sensitivity = made["sensitivity"]
    assert sensitivity.determined
    assert abs(sensitivity.value - SENSITIVITY) < FOUR_SIGMA * sensitivity.standard_error


def test_a_parameter_or_figure_that_is_not_there_is_answered_with_those_that_are() -> None:
    with pytest.raises(InputError, match="did you mean 'sensitivity'"):
        whole()["sensitivty"]
    with pytest.raises(InputError, match="did you mean 'hysteresis'"):
        whole().figure("histeresis")
