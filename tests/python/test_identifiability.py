"""What the data cannot tell apart is named, what is known of it is right, and nothing else is.

The first case is that of turlapati_intrinsic_dynamics (16): two sigmoids and an offset.
"""

from __future__ import annotations

import numpy as np
import pytest
from fit_logs import (
    FRICTION,
    HELD,
    WIDTH,
    autoregressive,
    chosen,
    fitted,
    friction,
    log_with,
    motion,
    rows_of,
    simulated,
)
from hypothesis import given, settings
from hypothesis import strategies as st

import flexspline
from flexspline import FitOptions, effect
from flexspline.least_squares.identifiability import _reduced

RIPPLE = effect("output_ripple", orders=[1, 2])
PER_DIRECTION = [
    "offset",
    effect("coulomb_friction_per_direction", direction_width=WIDTH),
    "viscous_friction",
    "inertia",
    RIPPLE,
]
WELL_POSED = [*friction(), RIPPLE]
TRUTH = np.array([*FRICTION, 0.1, 0.04, -0.05, 0.03])


def log_of(seed: int = 0, samples: int = 2000):
    noise = autoregressive(np.random.default_rng(seed), samples)
    return simulated(WELL_POSED, TRUTH, motion(seed, samples), noise)


def groups(fit) -> list[set[str]]:
    return [{name.split(".")[1] for name in group.names} for group in fit.confounded]


# turlapati_intrinsic_dynamics (16)


def test_two_sigmoids_and_an_offset_are_confounded_by_name_and_nothing_else_is():
    fit = fitted(PER_DIRECTION, log_of())
    assert groups(fit) == [{"offset", "positive", "negative"}]
    assert fit.confounded[0].exact
    open_ones = {p.name for p in fit.parameters if not p.determined}
    assert open_ones == set(fit.confounded[0].names)
    assert {p.state for p in fit.parameters if not p.determined} == {"not determined"}
    assert "indistinguishable" in fit.confounded[0].sentence


def test_the_confounded_basis_predicts_what_the_well_posed_one_does():
    log, fresh = log_of(), log_of(seed=9)
    ours, other = fitted(PER_DIRECTION, log), fitted(WELL_POSED, log)
    spread = np.ptp(other.predict(fresh).predicted)
    for where in (log, fresh):
        gap = ours.predict(where).predicted - other.predict(where).predicted
        assert np.abs(gap).max() < 1e-10 * spread
    assert ours.cv_rmse == pytest.approx(other.cv_rmse, rel=1e-9)


def test_the_known_combinations_are_each_direction_with_the_offset():
    log = log_of()
    ours, other = fitted(PER_DIRECTION, log), fitted(WELL_POSED, log)
    known = {str(c): c for c in ours.confounded[0].known}
    assert set(known) == {
        "coulomb_friction_per_direction.positive + offset.offset",
        "coulomb_friction_per_direction.negative + offset.offset",
    }
    level, offset = other["level"].value, other["offset"].value
    covariance = other.uncertainty.covariance
    for sign, name in ((1.0, "positive"), (-1.0, "negative")):
        combination = known[f"coulomb_friction_per_direction.{name} + offset.offset"]
        assert combination.value == pytest.approx(offset + sign * level, rel=1e-9)
        direction = np.zeros(len(covariance))
        direction[:2] = 1.0, sign
        error = float(np.sqrt(direction @ covariance @ direction))
        assert combination.standard_error == pytest.approx(error, rel=1e-6)
        assert combination.unit == "Nm"


def test_the_errors_of_the_known_combinations_cover_the_truth():
    inside = []
    for seed in range(60):
        fit = fitted(PER_DIRECTION[:4], log_without_ripple(seed))
        for combination in fit.confounded[0].known:
            sign = 1.0 if "positive" in str(combination) else -1.0
            truth = FRICTION[0] + sign * FRICTION[1]
            inside.append(abs(combination.value - truth) < 1.96 * combination.standard_error)
    # 120 intervals of 95 %, pairs nearly independent: four sigma of the binomial below.
    assert np.mean(inside) > 0.95 - 4 * np.sqrt(0.95 * 0.05 / 120)


def log_without_ripple(seed: int):
    noise = autoregressive(np.random.default_rng([seed, 3]), 2000)
    return simulated(friction(), FRICTION, motion(seed), noise)


def test_no_bare_number_of_a_confounded_weight_is_printed():
    fit = fitted(PER_DIRECTION, log_of())
    text = " ".join(str(fit).split())
    for name in fit.confounded[0].names:
        shown = fit[name].value
        for digits in (3, 4, 5):
            assert f"{shown:.{digits}f} ±" not in text
    assert "indistinguishable" in text
    frame = fit.to_frame()
    assert frame.loc[list(fit.confounded[0].names), "value"].isna().all()


# Other dependencies


@pytest.mark.parametrize("velocity_noise", [0.0, 1e-3])
def test_viscous_coulomb_and_offset_at_one_speed_are_confounded(velocity_noise):
    generator = np.random.default_rng(4)
    channels = motion(0)
    channels["output_velocity"] = 1.0 + velocity_noise * generator.normal(size=2000)
    channels["output_position"] = channels["time"].copy()
    channels["output_acceleration"] = np.zeros(2000)
    log = simulated(friction(), FRICTION, channels, 0.01 * generator.normal(size=2000))
    fit = fitted(friction()[:3], log)
    assert groups(fit) == [{"offset", "level", "viscosity"}]
    if not velocity_noise:
        (combination,) = fit.confounded[0].known
        assert combination.value == pytest.approx(-0.12 + 0.3 + 0.15, abs=0.01)
        assert [weight for _, weight in combination.weights] == pytest.approx([1.0] * 3)


def test_both_directions_at_one_speed_leave_the_offset_determined():
    generator = np.random.default_rng(4)
    channels = motion(0)
    channels["output_velocity"] = np.where(channels["time"] % 4 < 2, 1.0, -1.0)
    channels["output_position"] = np.cumsum(channels["output_velocity"]) * 0.01
    log = simulated(friction(), FRICTION, channels, 0.01 * generator.normal(size=2000))
    fit = fitted(friction()[:3], log)
    assert groups(fit) == [{"level", "viscosity"}]
    assert fit["offset"].determined and fit["offset"].value == pytest.approx(-0.12, abs=0.003)


def test_two_near_dependencies_that_share_nothing_stay_two_groups():
    generator = np.random.default_rng(4)
    channels = motion(0)
    channels["output_velocity"] = np.where(channels["time"] % 4 < 2, 1.0, -1.0)
    channels["output_velocity"] *= 1.0 + 1e-3 * generator.normal(size=2000)
    warm = 60.0 + 0.3 * generator.normal(size=2000)
    log = simulated(friction(), FRICTION, channels, 0.01 * generator.normal(size=2000))
    log = log.with_columns({"temperature": warm}, note="warm all the time")
    as_recorded = float("inf")  # the angle is another motion's
    fit = fitted(
        [*friction()[1:3], "temperature_drift"],
        log,
        options=FitOptions(bandwidth=as_recorded),
    )
    assert sorted(map(sorted, groups(fit))) == [["level", "viscosity"], ["linear", "quadratic"]]
    assert not any(group.exact for group in fit.confounded)


def test_low_harmonics_over_part_of_a_turn_are_confounded_with_the_offset():
    channels = motion(0)
    channels["output_position"] = 0.1 * np.sin(channels["time"])
    generator = np.random.default_rng(1)
    effects = chosen("offset", effect("output_ripple", orders=[1, 2, 3]))
    truth = [0.2, 0.1, 0.05, 0.04, -0.03, 0.02, 0.01]
    log = simulated(effects, truth, channels, 0.01 * generator.normal(size=2000))
    fit = fitted(effects, log, fixed={})
    (cosines,) = [g for g in groups(fit) if "offset" in g]
    assert {"offset", "cosine 1", "cosine 2"} <= cosines
    assert not fit["offset"].determined


def test_a_constant_temperature_leaves_its_drift_and_the_offset_open():
    generator = np.random.default_rng(2)
    channels = motion(0)
    hot = np.full(2000, 31.0)
    log = simulated(["offset"], [0.2], channels, 0.01 * generator.normal(size=2000), "hot")
    hot_log = log.with_columns({"temperature": hot}, note="held at 31 °C")
    fit = fitted(["offset", "temperature_drift"], hot_log, fixed={})
    assert groups(fit) == [{"offset", "linear", "quadratic"}]
    (combination,) = fit.confounded[0].known
    assert dict(combination.weights) == pytest.approx(
        {"offset.offset": 1.0, "temperature_drift.linear": 6.0, "temperature_drift.quadratic": 36.0}
        if combination.weights[0][0] == "offset.offset"
        else {
            "temperature_drift.linear": 1.0,
            "temperature_drift.quadratic": 6.0,
            "offset.offset": 1 / 6,
        }
    )


def test_a_column_of_zeros_is_a_group_of_one_that_nothing_is_known_of():
    generator = np.random.default_rng(2)
    log = simulated(["offset"], [0.2], motion(0), 0.01 * generator.normal(size=2000))
    reference = log.with_columns({"temperature": np.full(2000, 25.0)}, note="held at 25 °C")
    fit = fitted(["offset", "temperature_drift"], reference, fixed={})
    assert groups(fit) == [{"linear"}, {"quadratic"}]
    assert all("not excited" in group.sentence for group in fit.confounded)
    assert not any(group.known for group in fit.confounded)
    assert fit["offset"].determined and not fit["linear"].determined
    assert "not excited" in str(fit)


def test_gravity_beside_order_one_of_the_output_is_an_exact_duplicate():
    fit = fitted([*friction(), "gravity", RIPPLE], log_of())
    assert sorted(map(sorted, groups(fit))) == [["cosine", "cosine 1"], ["sine", "sine 1"]]
    for group in fit.confounded:
        assert group.exact
        (combination,) = group.known
        assert [weight for _, weight in combination.weights] == pytest.approx([1.0, 1.0])
    assert fit["cosine 2"].determined


def test_a_gain_on_a_load_that_is_all_inertia_is_an_exact_duplicate():
    generator = np.random.default_rng(2)
    channels = motion(0)
    load = 0.5 * channels["output_acceleration"]
    torque = load * 1.05 + 0.01 * generator.normal(size=2000)
    log = log_with(channels, torque, reference_torque=load)
    options = {"known_load": "reference_torque", "fixed": {}}
    fit = fitted(["offset", "gain_error", "viscous_friction"], log, **options)
    assert not fit.confounded and fit["gain"].value == pytest.approx(0.05, abs=0.01)
    fit = fitted(["gain_error", "offset", "inertia"], log, **options)
    assert groups(fit) == [{"gain", "inertia"}]


# No false alarms


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10_000),
    orders=st.sets(st.sampled_from([2, 3, 4, 5, 8, 13]), max_size=4),
    more=st.sets(st.sampled_from(["gravity", "nonlinear_viscous_friction", "stribeck_friction"])),
)
def test_a_well_posed_design_reports_nothing(seed, orders, more):
    extra = [effect("output_ripple", orders=sorted(orders))] if orders else []
    effects = [*friction(), *chosen(*sorted(more - {"stribeck_friction"})), *extra]
    if "stribeck_friction" in more:
        effects.append(effect("stribeck_friction", direction_width=WIDTH, stribeck_velocity=0.4))
    generator = np.random.default_rng(seed)
    channels = motion(seed, 4000)
    rows = rows_of(effects, log_with(channels))
    # Columns that are nearly dependent (index above 30) need coefficients well away from zero.
    near = np.linalg.cond(rows / np.linalg.norm(rows, axis=0)) > 30
    signs = generator.choice([-1.0, 1.0] if near else [-1.0, 0.0, 1.0], rows.shape[1])
    truth = signs * generator.uniform(0.1, 0.4, rows.shape[1])
    truth[1] = 0.3  # without any friction nothing could be said of its shapes
    log = simulated(effects, truth, channels, 0.003 * generator.normal(size=4000))
    held = HELD | ({"stribeck_velocity": 0.4} if "stribeck_friction" in more else {})
    fit = fitted(effects, log, fixed=held)
    assert fit.confounded == ()
    assert all(p.determined for p in fit.parameters)


# What resolves a confounding


def test_fixing_one_of_the_group_resolves_it():
    fit = fitted(PER_DIRECTION, log_of(), fixed={**HELD, "offset": -0.12})
    assert fit.confounded == ()
    assert fit["offset"].state == "fixed"
    assert fit["positive"].determined and fit["positive"].value == pytest.approx(0.3, abs=0.03)


def test_a_prior_on_one_of_the_group_resolves_it_and_is_kept_with_the_parameter():
    fit = fitted(PER_DIRECTION, log_of(), priors={"offset": (-0.12, 0.005)})
    assert fit.confounded == ()
    assert fit["offset"].prior == (-0.12, 0.005)
    assert fit["offset"].standard_error == pytest.approx(0.005, rel=1e-3)
    assert fit["positive"].value == pytest.approx(0.3, abs=0.03)
    assert fit["positive"].standard_error > 0.005


@pytest.mark.parametrize("prior", ["viscous_friction", "inertia", "sine 2"])
def test_a_prior_on_something_else_leaves_the_group_confounded(prior):
    fit = fitted(PER_DIRECTION, log_of(), priors={prior: (0.1, 0.1)})
    assert groups(fit) == [{"offset", "positive", "negative"}]


def test_a_prior_that_says_next_to_nothing_leaves_the_group_confounded():
    fit = fitted(PER_DIRECTION, log_of(), priors={"offset": (0.0, 1e3)})
    assert groups(fit) == [{"offset", "positive", "negative"}]
    known = {str(c): c for c in fit.confounded[0].known}
    combination = known["coulomb_friction_per_direction.positive + offset.offset"]
    assert combination.value == pytest.approx(0.18, abs=0.03)
    assert combination.standard_error < 0.02


def test_what_only_the_prior_says_is_taken_from_it_however_loose_it_is():
    fit = fitted(PER_DIRECTION, log_of(), priors={"offset": (5.0, 1e5)})
    assert fit["offset"].value == pytest.approx(5.0, rel=1e-3)
    assert not fit["offset"].determined
    assert fit["offset"].standard_error == pytest.approx(1e5, rel=1e-3)


def test_a_prior_resolves_the_group_beside_a_fitted_shape_too():
    fit = fitted(PER_DIRECTION, log_of(), fixed={}, priors={"offset": (-0.12, 0.005)})
    assert fit.confounded == ()
    assert fit["offset"].standard_error == pytest.approx(0.005, rel=1e-3)
    assert fit["direction_width"].state == "fitted"


def test_a_prior_resolves_the_group_in_a_long_log_even_if_its_value_is_zero():
    truth = np.array([0.0, *FRICTION[1:]])
    noise = 0.02 * np.random.default_rng(3).normal(size=50_000)
    log = simulated(friction(), truth, motion(3, 50_000), noise)
    fit = fitted(PER_DIRECTION[:4], log, priors={"offset": (0.0, 0.005)})
    assert fit.condition > 30 and fit.confounded == ()
    assert fit["positive"].value == pytest.approx(0.3, abs=0.02)


def test_a_bound_that_holds_one_of_the_group_resolves_it():
    fit = fitted(PER_DIRECTION, log_of(), bounds={"offset": (0.5, 1.0), "positive": (-0.25, 9.0)})
    assert fit["offset"].state == "at lower bound" and groups(fit) == []
    elsewhere = fitted(PER_DIRECTION, log_of(), bounds={"viscosity": (0.5, 1.0)})
    assert elsewhere["viscosity"].state == "at lower bound"
    assert groups(elsewhere) == [{"offset", "positive", "negative"}]


def test_combinations_that_are_whole_numbers_but_for_rounding_are_whole() -> None:
    rows = np.array([[1.0, 2.0 + 1e-9, -1.0 - 1e-10], [0.0, 0.0, 1e-12]])
    np.testing.assert_array_equal(_reduced(rows)[0], [1.0, 2.0, -1.0])
    assert _reduced(np.array([[1.0, 0.5 + 1e-9]]))[0, 1] != 0.5


# Motion that noise and rounding make all of


def drive(position, seed: int = 0, **more):
    """A run of friction, gravity and 0.6 kg·m² through this angle, with white noise of 0.3 Nm."""
    time = np.arange(8000) / 200.0
    slope = np.gradient(position, time)
    bend = np.gradient(slope, time) if more.pop("moving", False) else 0.0
    torque = 7.0 * np.tanh(slope.mean() / 0.005) + 5.0 * np.sin(position) + 0.6 * bend
    torque = torque + np.random.default_rng(seed).normal(0.0, 0.3, 8000)
    facts = {"gear_ratio": 80, **more}
    return flexspline.Log.from_arrays(
        facts=facts, time=time, output_position=position, motor_torque=torque / 80.0
    )


def rounded(position, bits: int):
    step = 2.0 * np.pi / 2**bits
    return np.round(position / step) * step


EVEN = 0.5 * np.arange(8000) / 200.0
IDLE = {
    "exact": EVEN,
    "an irrational speed": np.pi / 6.0 * EVEN,
    **{f"{bits} bits": rounded(EVEN, bits) for bits in (12, 13, 14, 15, 16, 17, 19)},
    "noise": EVEN + np.random.default_rng(9).normal(0.0, 1e-5, 8000),
    "floats of 32 bits": EVEN.astype(np.float32).astype(np.float64),
    "at rest, noise": 0.3 + np.random.default_rng(9).normal(0.0, 1e-5, 8000),
}
MODEL = ["coulomb_friction", "inertia", "gravity"]


@pytest.mark.parametrize("name", IDLE)
def test_an_inertia_that_noise_alone_accelerates_is_not_excited(name):
    fit = flexspline.fit(MODEL, drive(IDLE[name]), target="motor_torque")
    inertia = fit["inertia"]
    assert (inertia.state, inertia.value) == ("not determined", 0.0)
    (group,) = [g for g in fit.confounded if "inertia.inertia" in g.names]
    assert "is not excited by these runs" in group.sentence


def test_a_model_of_an_even_motion_predicts_another_without_its_inertia():
    fit = flexspline.fit(MODEL, drive(EVEN), target="motor_torque")
    swing = np.sin(np.arange(8000) / 200.0)
    log = drive(swing, moving=True)
    assert np.abs(fit.model.predict(log).predicted).max() < 2.0 * (7.0 + 5.0)


@pytest.mark.parametrize("bits", [14, 16, 19])
def test_an_inertia_that_a_slow_swing_shows_through_the_steps_is_fitted(bits):
    """0.1 rad at 0.2 Hz beside an even motion: 0.1 Nm of inertia in noise of 0.3 Nm."""
    time = np.arange(8000) / 200.0
    position = EVEN + 0.1 * np.sin(2.0 * np.pi * 0.2 * time)
    truth = position - EVEN
    log = drive(position)
    torque = log["motor_torque"] - 0.6 * (2.0 * np.pi * 0.2) ** 2 * truth / 80.0
    log = log.with_columns(
        {"output_position": rounded(position, bits), "motor_torque": torque}, note="swinging"
    )
    inertia = flexspline.fit(MODEL, log, target="motor_torque")["inertia"]
    assert inertia.determined and inertia.standard_error < 0.1
    assert abs(inertia.value - 0.6) < 4.0 * inertia.standard_error


def test_one_run_that_accelerates_among_others_determines_the_inertia():
    swing = np.sin(np.arange(8000) / 200.0)
    logs = [drive(EVEN, name="even"), drive(EVEN + swing, 1, moving=True, name="swinging")]
    fit = flexspline.fit(MODEL, logs, target="motor_torque")
    assert fit["inertia"].determined and not fit.confounded


@pytest.mark.parametrize("bits", [0, 17, 19])
@pytest.mark.parametrize("seed", range(6))
def test_a_width_that_the_runs_do_not_determine_keeps_its_value(seed, bits):
    log = drive(rounded(EVEN, bits) if bits else EVEN, seed)
    fit = flexspline.fit(MODEL, log, target="motor_torque")
    width, level = fit["direction_width"], fit["coulomb_friction.level"]
    assert width.state == "not determined"
    assert width.value == pytest.approx(0.005, rel=1e-12)
    assert abs(level.value - 7.0) < 4.0 * level.standard_error < 0.02
