"""What the papers compare with: drift models and ripple removal, on logs whose truth is known."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import ripple_logs

from flexspline.baselines import (
    RippleComparison,
    RippleKalman,
    compare_ripple_methods,
    kalman_oscillator,
    kernel_drift,
    linear_drift,
    order_tracking,
    sum_of_two_bridges,
    wave_generator_angle,
)
from flexspline.errors import InputError
from flexspline.logs import Log

ORDERS = (1, 2, 4)


def warming(quadratic: float, *, rows: int = 600, seed: int = 1) -> Log:
    """Voltage and temperature of (25) and a drift like (24)'s, at several torques."""
    rng = np.random.default_rng(seed)
    temperature = np.linspace(20.0, 45.0, rows)
    torque = rng.choice([0.0, 10.0, 30.0, 70.0], rows)
    warmer = temperature - 25.0
    drift = 2.2 - 0.02 * warmer + quadratic * warmer**2
    voltage = (torque - drift) / 62.738 + rng.normal(0.0, 1e-5, rows)
    return Log.from_arrays(
        time=np.arange(rows, dtype=float),
        sensor_voltage=voltage,
        temperature=temperature,
        reference_torque=torque,
    )


@pytest.fixture(scope="module")
def comparison() -> RippleComparison:
    log, training, cancelling, two = ripple_logs.compared()
    return compare_ripple_methods(
        log, training, orders=ORDERS, cancelling=cancelling, two_bridges=two
    )


def test_linear_drift_is_found_together_with_the_calibration() -> None:
    found = linear_drift(warming(0.0))
    truth = (62.738, 2.2, -0.02)
    errors = np.sqrt(np.diag(found.covariance))
    for value, true, error in zip(
        (found.sensitivity, found.zero, found.slope), truth, errors, strict=True
    ):
        assert abs(value - true) < 4.0 * error
    assert errors[2] < 1e-4


def test_kernel_regression_follows_a_drift_that_a_line_cannot() -> None:
    log = warming(4e-4)
    fresh = warming(4e-4, seed=2)
    left = {}
    for name, found in (("line", linear_drift(log)), ("kernel", kernel_drift(log))):
        torque = found.torque(fresh["sensor_voltage"], fresh["temperature"])
        left[name] = float(np.sqrt(np.mean((torque - fresh["reference_torque"]) ** 2)))
    assert left["kernel"] < 0.005
    assert left["line"] > 5.0 * left["kernel"]


def test_kernel_drift_knows_nothing_outside_its_temperatures() -> None:
    found = kernel_drift(warming(4e-4))
    assert np.isnan(found.drift([10.0, 60.0])).all()
    assert np.isfinite(found.drift([21.0, 44.0])).all()


def test_without_scikit_learn_kernel_drift_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.kernel_ridge", None)
    with pytest.raises(InputError, match=r"pip install 'flexspline\[baselines\]'"):
        kernel_drift(warming(0.0))


def test_the_kernel_of_the_drift_is_not_loaded_by_the_package_of_baselines() -> None:
    code = "import sys, flexspline.baselines; print('sklearn' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "False"


def test_drift_that_cannot_be_told_apart_is_refused() -> None:
    log = warming(0.0)
    with pytest.raises(InputError, match="do not vary enough"):
        linear_drift(log.with_columns({"temperature": np.full(len(log), 30.0)}, note="held"))
    with pytest.raises(InputError, match="needs the channel temperature"):
        linear_drift(Log.from_arrays(time=log["time"], sensor_voltage=log["sensor_voltage"]))
    with pytest.raises(InputError, match="1 temperatures"):
        kernel_drift(log.with_columns({"temperature": np.full(len(log), 30.0)}, note="held"))
    with pytest.raises(InputError, match="no log"):
        linear_drift([])


def test_every_method_leaves_less_ripple_in_motion_than_nothing(
    comparison: RippleComparison,
) -> None:
    nothing = comparison["nothing"].moving_error
    for score in comparison.scores[1:]:
        assert score.moving_error < 0.5 * nothing, score.name


def test_a_quarter_turn_between_two_bridges_cancels_order_two_but_not_order_one(
    comparison: RippleComparison,
) -> None:
    before, after = comparison["nothing"].orders, comparison["sum of two bridges"].orders
    assert after[2] < 0.02 * before[2]
    assert after[1] == pytest.approx(before[1] * np.sqrt(0.5), rel=0.05)


def test_order_tracking_is_useless_at_standstill(comparison: RippleComparison) -> None:
    """It sees no push there: worse than the raw reading, and the delay has no end."""
    score = comparison["order tracking"]
    assert score.rest_delay == np.inf
    assert score.rest_error > 2.0 * comparison["nothing"].rest_error
    assert score.moving_error < 0.3 * comparison["nothing"].moving_error


def test_the_oscillator_holds_at_standstill_what_it_learnt_in_motion(
    comparison: RippleComparison,
) -> None:
    score = comparison["Kalman oscillator"]
    assert score.rest_error < 0.2 * comparison["nothing"].rest_error
    assert score.rest_delay < 1e-3
    assert score.moving_delay > 1e-3  # an order is a notch, and a notch is late


def test_placement_and_regression_add_no_delay(comparison: RippleComparison) -> None:
    for name in ("nothing", "cancelling placement", "sum of two bridges", "regression"):
        assert abs(comparison[name].moving_delay) < 1e-9
        assert abs(comparison[name].rest_delay) < 1e-9


def test_the_regression_leaves_the_growth_with_load_that_it_was_not_told(
    comparison: RippleComparison,
) -> None:
    """Trained without load, it misses 2 % per Nm of a ripple of 0.53 Nm rms; it keeps the rest."""
    score = comparison["regression"]
    assert ripple_logs.NOISE < score.moving_error < 0.12 * comparison["nothing"].moving_error
    assert score.rest_error < 0.2 * comparison["nothing"].rest_error


def test_the_table_says_the_same_as_text_html_and_data(comparison: RippleComparison) -> None:
    text, page, frame = str(comparison), comparison.to_html(), comparison.to_frame()
    assert list(frame.index) == [score.name for score in comparison.scores]
    for score in comparison.scores:
        assert score.name in text and score.name in page
        assert score.cost >= 0.0
    assert "[mNm]" in text and "[ms]" in text and "[ns]" in text and "∞" in text
    assert frame.loc["regression", "moving_error"] == comparison["regression"].moving_error


def test_a_comparison_without_a_truth_or_a_rest_is_refused() -> None:
    log, training, *_ = ripple_logs.compared()
    blind = Log({k: v for k, v in log.columns.items() if k != "reference_torque"}, log.facts)
    with pytest.raises(InputError, match="need the true torque"):
        compare_ripple_methods(blind, training)
    with pytest.raises(InputError, match="both move and stand still"):
        compare_ripple_methods(log, training, at_rest=np.zeros(len(log), bool))


def test_filters_over_the_angle_work_backward_and_at_any_speed() -> None:
    time, position = ripple_logs.motion(9.0)
    motor = 101.0 * (position + 0.3 * np.sin(time) - 0.15 * time)
    log = Log.from_arrays(
        facts=ripple_logs.FACTS,
        time=time,
        output_position=motor / 101.0,
        motor_position=motor,
        sensor_torque=1.0 + 0.3 * np.cos(motor - 0.4) + 0.2 * np.sin(2.0 * motor),
    )
    settled = time > 2.0
    assert np.abs(kalman_oscillator(log, (1, 2)) - 1.0)[settled].max() < 0.01
    assert np.abs(order_tracking(log, (1, 2)) - 1.0)[settled].max() < 0.03


def test_the_angle_is_that_against_the_flexspline() -> None:
    log = ripple_logs.run("a", np.zeros(3000))
    np.testing.assert_allclose(wave_generator_angle(log), np.unwrap(log["motor_position"]))
    flex = log.with_facts({"output_spline": "flex"})
    expected = log["motor_position"] + log["output_position"]
    np.testing.assert_allclose(wave_generator_angle(flex), expected)


def test_wrong_calls_of_the_filters_are_refused() -> None:
    log = ripple_logs.run("a", np.zeros(3000))
    with pytest.raises(InputError, match="different whole numbers"):
        kalman_oscillator(log, (2, 2))
    with pytest.raises(InputError, match="more than twice"):
        order_tracking(log, (40,), points=64)
    with pytest.raises(InputError, match="one value a row"):
        order_tracking(log, (2,), reading=np.zeros(5))
    with pytest.raises(InputError, match="noise"):
        RippleKalman(noise=0.0)
    with pytest.raises(InputError, match="readings of one log"):
        sum_of_two_bridges(np.zeros(3), np.zeros(4))
