"""The estimators of the core over arrays, against numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline import _core

Array = NDArray[np.float64]

DIVIDER = {
    "supply_voltage": 3.3,
    "divider_resistance": 10e3,
    "nominal_resistance": 10e3,
    "beta": 3435.0,
    "nominal_temperature": 25.0,
}
MESH = {"mesh_stiffness": 15548.0, "mesh_shape": 0.0487}
BAND = {"speed_edges": [], "negative": [1.0], "positive": [2.0]}
NOISES = {
    "observer_rest": 2.0,
    "observer_motion": 1.0,
    "compliance_rest": 1.0,
    "compliance_motion": 3.0,
}


def noise(seed: int, count: int = 2000) -> Array:
    return np.random.default_rng(seed).normal(size=count)


def smooth(seed: int, count: int = 2000) -> Array:
    return np.cumsum(noise(seed, count)) * 0.05


def seconds(count: int = 2000, period: float = 0.01) -> Array:
    return np.arange(count) * period


@pytest.mark.parametrize("period", [0.001, 0.01, 0.05])
def test_the_exact_observer_is_the_low_pass_of_zhang_19(period: float) -> None:
    momentum, known, gain = smooth(1), smooth(2), 100.0
    external = np.append(0.0, (known[1:] + known[:-1]) / 2 - np.diff(momentum) / period)
    share = -np.expm1(-gain * period)
    expected = lfilter([share], [1.0, share - 1.0], external)
    seen = _core.observe_momentum(seconds(period=period), momentum, known, gain=gain, exact=True)
    # a difference of times of 100 s has eps · 100 s / period of its own
    bound = 100.0 / period * np.finfo(float).eps * np.abs(external).max() * 10
    np.testing.assert_allclose(seen, expected, rtol=0, atol=bound)


def test_euler_is_the_sum_of_zhang_21() -> None:
    momentum, known, gain, period = smooth(3), smooth(4), 80.0, 0.002
    integral, residual = 0.0, [0.0]
    for before, now in zip(known[:-1], momentum[1:], strict=True):
        integral += (before - residual[-1]) * period  # our r is that of (21) with the other sign
        residual.append(-gain * (now - integral - momentum[0]))
    seen = _core.observe_momentum(seconds(period=period), momentum, known, gain=gain, exact=False)
    np.testing.assert_allclose(seen, residual, rtol=0, atol=1e-8 * np.abs(residual).max())


def test_a_gain_that_cannot_be_stable_is_refused_with_its_row() -> None:
    time = np.array([0.0, 0.01, 0.02, 0.04, 0.05])
    zero = np.zeros(5)
    with pytest.raises(ValueError, match="ends at row 3; gain times period must stay below 2"):
        _core.observe_momentum(time, zero, zero, gain=100.0, exact=False)
    assert np.isfinite(_core.observe_momentum(time, zero, zero, gain=100.0, exact=True)).all()
    for gain in (0.0, -8.0, np.nan):
        with pytest.raises(ValueError, match="give one above zero"):
            _core.observe_momentum(time, zero, zero, gain=gain, exact=True)


def test_bad_rows_are_held_and_unknown_before_the_first_good_one() -> None:
    time = np.array([0.0, 0.1, np.nan, 0.3, 0.3, 0.4])
    momentum = np.array([np.nan, 0.0, 0.0, 0.0, 5.0, 0.0])
    seen = _core.observe_momentum(time, momentum, np.ones(6), gain=5.0, exact=True)
    expected = -np.expm1(-5.0 * np.array([0.0, 0.0, 0.2, 0.2, 0.3]))
    assert np.isnan(seen[0])
    np.testing.assert_allclose(seen[1:], expected, atol=1e-15)


def test_a_thermistor_reads_its_own_voltage_and_refuses_an_open_line() -> None:
    temperature = np.linspace(-40.0, 120.0, 500)
    kelvin = temperature + 273.15
    resistance = 10e3 * np.exp(3435.0 * (1 / kelvin - 1 / 298.15))
    voltage = 3.3 * resistance / (resistance + 10e3)
    np.testing.assert_allclose(
        _core.thermistor_voltage(temperature, **DIVIDER), voltage, rtol=1e-13
    )
    np.testing.assert_allclose(
        _core.thermistor_temperature(voltage, **DIVIDER), temperature, atol=1e-10
    )
    assert np.isnan(_core.thermistor_temperature([0.0, 3.3, -1.0, np.nan], **DIVIDER)).all()


def test_the_drift_is_the_polynomial_of_a_lagged_temperature() -> None:
    temperature, lag = 30.0 + smooth(5), 7.0
    share = -np.expm1(-0.01 / lag)
    first = temperature[0]
    body = first + lfilter([share], [1.0, share - 1.0], temperature - first)
    expected = np.polyval([2e-4, -0.01, 0.3, 0.0], body - 22.0) + 0.4 * (temperature - body)
    seen = _core.temperature_compensation(
        seconds(),
        temperature,
        coefficients=[0.3, -0.01, 2e-4],
        reference_temperature=22.0,
        gradient=0.4,
        thermal_lag=lag,
    )
    np.testing.assert_allclose(seen, expected, atol=1e-9)


def test_more_coefficients_than_the_core_has_room_for_are_refused() -> None:
    with pytest.raises(ValueError, match="7 values of coefficients are given, room is for 6"):
        _core.temperature_compensation(
            [0.0],
            [25.0],
            coefficients=[0.1] * 7,
            reference_temperature=25.0,
            gradient=0.0,
            thermal_lag=0.0,
        )


def test_compliance_agrees_with_numpy_and_keeps_the_shape() -> None:
    torque = np.linspace(-80.0, 80.0, 600).reshape(3, 200)
    torsion = _core.mesh_torsion(torque, **MESH)
    np.testing.assert_allclose(
        torsion, -np.arctan(0.0487 * torque) / (0.0487 * 15548.0), rtol=1e-14
    )
    back, flags = _core.mesh_torque(torsion, **MESH, margin=0.01)
    np.testing.assert_allclose(back, torque, rtol=1e-13)
    assert back.shape == flags.shape == torque.shape
    assert not flags.any()
    _, flags = _core.mesh_torque(torsion, **MESH, margin=0.5)
    np.testing.assert_array_equal(flags, np.where(np.abs(0.0487 * torque) > 1.0, 2, 0))
    wave = _core.wave_generator_torsion(torque, stiffness=21.9931, shape=3.125)
    expected = np.sign(torque) * np.expm1(-3.125 * np.abs(torque)) / (3.125 * 21.9931)
    np.testing.assert_allclose(wave, expected, rtol=1e-14)


def test_the_merge_weight_is_the_logistic_of_full_range_20() -> None:
    velocity = np.linspace(-0.02, 0.02, 401)
    expected = 1 / (1 + np.exp(-500.0 * (np.abs(velocity) - 0.001)))
    seen = _core.merge_weight(velocity, alpha=500.0, transition_velocity=0.001)
    np.testing.assert_allclose(seen, expected, rtol=1e-14)


def test_the_kalman_merge_is_a_kalman_filter_of_two_measurements() -> None:
    velocity = 0.02 * smooth(6)
    measured = np.stack([smooth(7) + noise(8), smooth(7) + 0.5 * noise(9)], axis=1)
    moving = _core.merge_weight(velocity, alpha=300.0, transition_velocity=0.005)[:, None]
    rest, motion = np.array([4.0, 1.0]), np.array([1.0, 9.0])
    variances = rest + moving * (motion - rest)
    information = (1 / variances[0]).sum()
    state, spread = (measured[0] / variances[0]).sum() / information, 1 / information
    expected = [state]
    for values, noises in zip(measured[1:], variances[1:], strict=True):
        information = 1 / (spread + 2.0**2 * 0.01) + (1 / noises).sum()
        prior = state / (spread + 2.0**2 * 0.01)
        state, spread = (prior + (values / noises).sum()) / information, 1 / information
        expected.append(state)
    seen = _core.merge_kalman(
        seconds(),
        velocity,
        measured[:, 0],
        measured[:, 1],
        alpha=300.0,
        transition_velocity=0.005,
        walk=2.0,
        **NOISES,
    )
    np.testing.assert_allclose(seen, expected, rtol=0, atol=1e-10)


def test_a_contact_begins_at_the_threshold_and_ends_after_the_hold() -> None:
    residual = np.array([0.0, 1.9, 2.1, 1.1, 0.9, 0.9, 0.9, -1.1, 0.0])
    seen = _core.detect_collision(
        seconds(9, 0.125), residual, np.zeros(9), **BAND, release=0.5, hold=0.25
    )
    np.testing.assert_array_equal(seen, np.array([0, 0, 1, 1, 1, 0, 0, 1, 1], dtype=bool))


def test_thresholds_and_bands_of_another_number_are_refused() -> None:
    with pytest.raises(ValueError, match="one more than there are speed_edges"):
        _core.detect_collision(
            [0.0],
            [0.0],
            [0.0],
            speed_edges=[1.0],
            negative=[1.0],
            positive=[1.0],
            release=1,
            hold=0,
        )


def test_columns_of_another_length_are_refused() -> None:
    with pytest.raises(ValueError, match="known_torque"):
        _core.observe_momentum([0.0, 1.0], [0.0, 0.0], [0.0], gain=1.0, exact=True)


CHAIN = {
    "thermistor": DIVIDER,
    "temperature_compensation": {
        "coefficients": (0.02, -6e-4),
        "reference_temperature": 25.0,
        "gradient": 0.0,
        "thermal_lag": 3.0,
        "temperature_range": (20.0, 45.0),
    },
    "sensor": True,
    "calibration": {"sensitivity": 62.738, "zero": 2.1835, "voltage_range": None},
    "observer": {"gain": 100.0, "input": "sensor_torque", "discretisation": "exact"},
    "compliance": {**MESH, "margin": 0.05},
    "merge": {"alpha": 500.0, "transition_velocity": 0.001, "method": "logistic"},
    "collision": {**BAND, "input": "merged", "release": 0.8, "hold": 0.1},
}


RATIO, INERTIA, LINK = 101.0, 0.4, 0.3
INTRINSIC = {"sensor": 0.7, "observed": 0.5, "carried": 0.2}  # Nm, what each model says


def channels() -> dict[str, Array]:
    return {
        "time": seconds(),
        "sensor_voltage": 0.1 * smooth(10),
        "thermistor_voltage": 1.5 + 0.02 * smooth(11),
        "output_position": 0.01 * smooth(14),
        "motor_position": RATIO * (0.01 * smooth(14) - 5e-4 * smooth(15)),
        "output_velocity": 0.01 * smooth(17),
    }


def joint(stages: dict[str, object]) -> _core.Joint:
    gear = {"effective_ratio": RATIO, "output_spline": "unknown", "motor_encoder": True}
    offset = _core.Design([{"name": "offset", "shapes": {}, "harmonics": []}], **gear)
    models = {name: (offset, np.array([value])) for name, value in INTRINSIC.items()}
    return _core.Joint(
        stages,
        {**models, "torsion": (_core.Design([], **gear), np.zeros(0))},
        effective_ratio=RATIO,
        inertia=INERTIA,
        link_inertia=LINK,
    )


def test_the_joint_equals_its_stages_called_one_by_one() -> None:
    at = channels()
    time, velocity = at["time"], at["output_velocity"]
    link = {"gain": 60.0, "input": "compliance", "discretisation": "exact"}
    seen = joint({**CHAIN, "compliant_observer": link}).run(at, [0], inputs=True)
    temperature = _core.thermistor_temperature(at["thermistor_voltage"], **DIVIDER)
    entry = CHAIN["temperature_compensation"]
    assert isinstance(entry, dict)
    wanted = ("coefficients", "reference_temperature", "gradient", "thermal_lag")
    drift = _core.temperature_compensation(time, temperature, **{k: entry[k] for k in wanted})
    sensor = 62.738 * at["sensor_voltage"] + 2.1835 + drift
    exact = {"exact": True}
    observer = _core.observe_momentum(
        time, INERTIA * velocity, sensor - INTRINSIC["observed"], gain=100.0, **exact
    )
    gear, saturated = _core.mesh_torque(seen["torsion"], **MESH, margin=0.05)
    compliance = gear - INTRINSIC["carried"]
    behind = _core.observe_momentum(time, LINK * velocity, compliance, gain=60.0, **exact)
    weight = _core.merge_weight(velocity, alpha=500.0, transition_velocity=0.001)
    merged = compliance + weight * (observer - compliance)
    contact = _core.detect_collision(time, merged, velocity, **BAND, release=0.8, hold=0.1)
    outside = (temperature < 20.0) | (temperature > 45.0)
    expected = {
        "temperature": temperature,
        "sensor_torque": sensor,
        "external_sensor": sensor - INTRINSIC["sensor"],
        "external_compliance": compliance,
        "contact": contact,
        "flags": saturated | outside,
        "missed": np.zeros(len(time)),
        "faults": np.zeros(len(time)),
        "velocity": velocity,
        "momentum": INERTIA * velocity,
        "link_momentum": LINK * velocity,
        "observer_intrinsic": np.full(len(time), INTRINSIC["observed"]),
        "gear_known": np.full(len(time), INTRINSIC["carried"]),
        "motor_torque": np.full(len(time), np.nan),
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(seen[name], values, err_msg=name)
    # the joint adds up the periods that the replay takes as differences of times
    summed = {
        "external_observer": observer,
        "external_compliant_observer": behind,
        "external_merged": merged,
    }
    for name, values in summed.items():
        np.testing.assert_allclose(seen[name], values, rtol=0, atol=1e-9, err_msg=name)
    # the motor's angle of some 100 rad is rounded to 1e-14
    np.testing.assert_allclose(seen["torsion"], 5e-4 * smooth(15), rtol=0, atol=1e-14)
    assert seen.keys() == expected.keys() | summed.keys() | {"torsion"}


def test_a_joint_gives_only_what_it_has_and_starts_anew_where_it_is_told() -> None:
    blind = _core.Joint({"observer": {**CHAIN["observer"], "input": "motor_torque"}})
    at = {"time": seconds(), "motor_torque": smooth(18)}
    whole = blind.run(at, [0])
    marks = {"flags", "faults", "missed"}
    assert whole.keys() == {"temperature", "sensor_torque", "external_observer"} | marks
    again = blind.run(at, [0, 1000])["external_observer"]
    np.testing.assert_array_equal(again[:1000], whole["external_observer"][:1000])
    alone = {name: values[1000:] for name, values in at.items()}
    np.testing.assert_array_equal(again[1000:], blind.run(alone, [0])["external_observer"])


def test_a_kalman_merge_runs_in_the_joint() -> None:
    merge = {
        "alpha": 500.0,
        "transition_velocity": 0.001,
        "method": "kalman",
        "walk": 3.0,
        "observer_noise": (2.0, 1.0),
        "compliance_noise": (1.0, 3.0),
    }
    at = channels()
    seen = joint({**CHAIN, "merge": merge}).run(at, [0])
    expected = _core.merge_kalman(
        at["time"],
        at["output_velocity"],
        seen["external_observer"],
        seen["external_compliance"],
        alpha=500.0,
        transition_velocity=0.001,
        walk=3.0,
        **NOISES,
    )
    np.testing.assert_allclose(seen["external_merged"], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("config", "sentence"),
    [
        ({"observers": {}}, "there is no stage 'observers'"),
        ({"observer": {"gain": 1.0}}, "'observer' lacks 'discretisation'"),
        ({"observer": {**CHAIN["observer"], "gian": 1.0}}, "'observer' has no 'gian'"),
        ({"reading_checks": {"most_speeds": 3.0}}, "'reading_checks' has no 'most_speeds'"),
        (
            {"observer": {"gain": 1.0, "input": "torque", "discretisation": "exact"}},
            "'observer' does not know input 'torque'",
        ),
    ],
)
def test_a_joint_that_cannot_be_is_refused(config: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        _core.Joint(config)


def test_a_run_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="it reads no channel 'torque'"):
        _core.Joint({}).run({"time": seconds(), "torque": seconds()}, [0])
    with pytest.raises(ValueError, match="it needs the channel 'time'"):
        _core.Joint({}).run({}, [0])
    for starts in ([], [1], [0, 2000], [0, 5, 3]):
        with pytest.raises(ValueError, match="starts are rows of the log that rise from 0"):
            _core.Joint({}).run({"time": seconds()}, starts)
    with pytest.raises(ValueError, match="there is no model 'drive'"):
        _core.Joint({}, {"drive": (_core.Design([], 1.0, "unknown", False), np.zeros(0))})
    with pytest.raises(ValueError, match="the design has 0 columns, but there are 2"):
        _core.Joint({}, {"sensor": (_core.Design([], 1.0, "unknown", False), np.zeros(2))})
