"""Calls of `fit` that cannot work, each with its one sentence; and the fit of nothing at all."""

from __future__ import annotations

import re

import numpy as np
import pytest
from fit_logs import FRICTION, autoregressive, friction, log_with, motion, simulated

import flexspline
from flexspline import FitOptions, InputError
from flexspline.effects import Effect


def log_of(samples: int = 2000, name: str = "bench", **facts):
    noise = autoregressive(np.random.default_rng(1), samples)
    log = simulated(friction(), FRICTION, motion(1, samples), noise, name)
    return log.with_facts(facts) if facts else log


def spoilt(channel: str):
    log = log_of()
    values = log[channel].copy()
    values[117] = np.nan
    return log.with_columns({channel: values}, note="spoilt")


def without(*channels: str):
    log = log_of()
    kept = {name: log[name] for name in log.channels if name not in channels}
    return flexspline.Log.from_arrays(facts={"name": "bench"}, **kept)


GEAR = {"gear_ratio": 100.0}
BASE = ["offset", "coulomb_friction", "viscous_friction"]

WRONG = {
    "unknown effect": (["viscous_fricton"], log_of, {}, ["viscous_fricton", "viscous_friction"]),
    "runs where effects belong": ([log_of()], log_of, {}, ["not as Log", "effects first"]),
    "unknown target": (BASE, log_of, {"target": "torque"}, ["torque", "sensor_torque"]),
    "target not in the log": (
        BASE,
        log_of,
        {"target": "motor_current"},
        ["bench", "motor_current"],
    ),
    "no gear ratio": (
        ["offset"],
        lambda: log_with(motion(0), motor_torque=np.ones(2000), name="bench"),
        {"target": "motor_torque"},
        ["bench", "gear_ratio"],
    ),
    "no gear ratio for the wave generator": (
        ["wave_generator_ripple"],
        log_of,
        {"orders": {"wave_generator_ripple": [2]}},
        ["wave_generator_ripple", "gear_ratio"],
    ),
    "effect of another target": (
        ["gain_error"],
        lambda: log_with(motion(0), motor_current=np.ones(2000)),
        {"target": "motor_current"},
        ["gain_error", "motor_current"],
    ),
    "effect named twice": (["offset", "offset"], log_of, {}, ["offset", "twice"]),
    "channel missing": (["temperature_drift"], log_of, {}, ["bench", "temperature"]),
    "velocity and position missing": (
        BASE,
        lambda: without("output_velocity", "output_position"),
        {},
        ["bench", "output_velocity"],
    ),
    "known load missing": (BASE, log_of, {"known_load": "reference_torque"}, ["reference_torque"]),
    "load without a source": (["load_dependent_friction"], log_of, {}, ["known_load", "inertia"]),
    "gain without a load": (["gain_error"], log_of, {}, ["gain_error", "known_load"]),
    "too few rows": (friction(), lambda: log_of(25), {}, ["25 rows", "record longer"]),
    "NaN in the target": (BASE, lambda: spoilt("sensor_torque"), {}, ["sensor_torque", "row 117"]),
    "NaN in a channel": (BASE, lambda: spoilt("output_velocity"), {}, ["output_velocity", "117"]),
    "logs of two gears": (
        BASE,
        lambda: [log_of(gear_ratio=100.0), log_of(1500, gear_ratio=50.0)],
        {},
        ["gear_ratio", "100", "50"],
    ),
    "logs of two joints": (
        BASE,
        lambda: [log_of(joint="A1"), log_of(1500, joint="A2")],
        {},
        ["joint", "A1", "A2"],
    ),
    "motor encoder in one log only": (
        ["wave_generator_ripple"],
        lambda: [
            log_of(**GEAR),
            log_of(**GEAR).with_columns({"motor_position": np.ones(2000)}, note=""),
        ],
        {"orders": {"wave_generator_ripple": [2]}},
        ["motor_position"],
    ),
    "low pass beyond Nyquist": (BASE, log_of, {"lowpass": 80.0}, ["80", "bench"]),
    "low pass longer than the log": (BASE, lambda: log_of(100), {"lowpass": 0.5}, ["bench", "0.5"]),
    "low pass of nothing": (BASE, log_of, {"lowpass": 0.0}, ["low pass"]),
    "orders of an effect without": (
        BASE,
        log_of,
        {"orders": {"offset": [1]}},
        ["offset", "orders"],
    ),
    "orders of an absent effect": (
        BASE,
        log_of,
        {"orders": {"cogging": [4]}},
        ["orders", "cogging"],
    ),
    "order zero": (
        ["output_ripple"],
        log_of,
        {"orders": {"output_ripple": [0, 1]}},
        ["order 0", "whole number"],
    ),
    "half an order": (
        ["output_ripple"],
        log_of,
        {"orders": {"output_ripple": [1.5]}},
        ["order 1.5"],
    ),
    "an order twice": (
        ["output_ripple"],
        log_of,
        {"orders": {"output_ripple": [2, 2]}},
        ["order 2", "twice"],
    ),
    "too many orders": (
        ["output_ripple"],
        log_of,
        {"orders": {"output_ripple": range(1, 70)}},
        ["at most 64"],
    ),
    "an order beyond all teeth": (
        ["output_ripple"],
        log_of,
        {"orders": {"output_ripple": [2**40]}},
        ["1000000"],
    ),
    "prior without an error": (
        BASE,
        log_of,
        {"priors": {"offset": (0.0, 0.0)}},
        ["offset", "above"],
    ),
    "prior of infinite error": (
        BASE,
        log_of,
        {"priors": {"offset": (0.0, np.inf)}},
        ["offset", "inf"],
    ),
    "prior that is no number": (
        BASE,
        log_of,
        {"priors": {"offset": (np.nan, 1.0)}},
        ["offset", "nan"],
    ),
    "prior that is no pair": (BASE, log_of, {"priors": {"offset": 0.1}}, ["offset", "(value"]),
    "prior of a shape": (
        BASE,
        log_of,
        {"priors": {"direction_width": (0.1, 0.1)}},
        ["direction_width", "shape"],
    ),
    "prior of something fixed": (
        BASE,
        log_of,
        {"priors": {"offset": (0.1, 0.1)}, "fixed": {"offset": 0.1}},
        ["offset", "fixed already"],
    ),
    "fixed at NaN": (BASE, log_of, {"fixed": {"offset": np.nan}}, ["offset", "nan"]),
    "fixed unknown": (BASE, log_of, {"fixed": {"ofset": 0.1}}, ["ofset", "offset.offset"]),
    "fixed shape unknown": (
        BASE,
        log_of,
        {"fixed": {"direction_with": 0.1}},
        ["direction_with", "direction_width"],
    ),
    "fixed shape out of range": (
        BASE,
        log_of,
        {"fixed": {"direction_width": 7.0}},
        ["direction_width", "0.5"],
    ),
    "ambiguous name": (
        ["nonlinear_viscous_friction"],
        log_of,
        {"fixed": {"nonlinear_viscous_friction": 1.0}},
        ["quadratic", "cubic", "say which"],
    ),
    "empty bounds": (BASE, log_of, {"bounds": {"offset": (1.0, 1.0)}}, ["offset", "empty"]),
    "crossed bounds": (BASE, log_of, {"bounds": {"offset": (1.0, -1.0)}}, ["offset", "low < high"]),
    "bounds of a shape outside": (
        BASE,
        log_of,
        {"bounds": {"direction_width": (3.0, 4.0)}},
        ["direction_width", "0.5"],
    ),
    "an offset per run of no offset": (
        BASE[1:],
        lambda: [log_of(), log_of(1500)],
        {"options": FitOptions(offset_per_run=True)},
        ["offset_per_run", "add"],
    ),
    "no log": (BASE, list, {}, ["no log"]),
    "the name of a file that is not there": (
        BASE,
        lambda: ["run.csv"],
        {},
        ["run.csv", "no such file"],
    ),
    "bounds that are no pair": (
        BASE,
        log_of,
        {"bounds": {"offset": 0.1}},
        ["offset", "(low, high)"],
    ),
    "shape bounds that are no pair": (
        BASE,
        log_of,
        {"bounds": {"direction_width": 0.1}},
        ["direction_width", "(low, high)"],
    ),
    "orders as one number": (
        ["output_ripple"],
        log_of,
        {"orders": {"output_ripple": 2}},
        ["output_ripple", "orders = 2 is no list"],
    ),
    "orders without an effect": (
        ["output_ripple"],
        log_of,
        {"orders": [2]},
        ["orders is a list", "dictionary"],
    ),
    "low pass in words": (BASE, log_of, {"lowpass": "5"}, ["bandwidth = '5'", "in Hz"]),
    "bandwidth in words": (
        BASE,
        log_of,
        {"options": FitOptions(bandwidth="5")},
        ["bandwidth = '5'", "in Hz"],
    ),
    "options as a dictionary": (
        BASE,
        log_of,
        {"options": {"bandwidth": 3.0}},
        ["options is a dict", "give FitOptions(...)"],
    ),
    "into the path of a model": (
        BASE,
        log_of,
        {"into": "model.json"},
        ["into is a str", "give what it holds, Model.load('model.json')"],
    ),
    "shape fixed in words": (BASE, log_of, {"fixed": {"direction_width": "wide"}}, ["'wide'"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_call_is_refused_with_one_sentence(case):
    effects, logs, options, words = WRONG[case]
    options = {"target": "sensor_torque", **options}
    with pytest.raises(InputError) as caught:
        flexspline.fit(effects, logs(), checks=False, **options)
    sentence = str(caught.value)
    for word in words:
        assert word in sentence, sentence
    assert "\n" not in sentence
    assert len(re.findall(r"[.!?] [A-Z]", sentence)) == 0, sentence
    assert len(sentence) < 400


def test_an_infinity_in_a_channel_that_nothing_reads_does_no_harm():
    log = log_of().with_columns({"temperature": np.full(2000, np.inf)}, note="broken thermistor")
    fit = flexspline.fit(["offset"], log, "sensor_torque", checks=False)
    assert np.isfinite(fit.rmse)


# The fit of nothing


@pytest.mark.parametrize("options", [{}, {"lowpass": 5.0}, {"options": FitOptions(robust="huber")}])
def test_a_fit_of_no_effects_has_no_parameters_and_leaves_the_target(options):
    log = log_of()
    fit = flexspline.fit([], log, "sensor_torque", checks=False, **options)
    assert fit.parameters == () and fit.confounded == ()
    assert len(fit.part.coefficients) == 0 and fit.covariance.shape == (0, 0)
    assert np.array_equal(fit.runs[0].residual, fit.runs[0].measured)
    counts = fit.runs[0].counts
    assert np.array_equal(fit.runs[0].held_out[counts], fit.runs[0].residual[counts])
    assert fit.rmse == fit.cv_rmse
    assert not fit.predict(log).predicted.any()
    assert "No parameters" in str(fit) and fit.to_frame().empty
    assert fit.shares() == {}


def test_a_fit_of_no_effects_is_saved_and_read_again(tmp_path):
    logs = [log_of(name="a"), log_of(1500, name="b")]
    fit = flexspline.fit([], logs, "sensor_torque", checks=False)
    fit.model.save(tmp_path / "model.json")
    again = flexspline.Model.load(tmp_path / "model.json")
    assert again.part().effects == ()


def test_everything_fixed_leaves_no_freedom_and_still_a_fit():
    fit = flexspline.fit(
        friction(),
        log_of(),
        "sensor_torque",
        checks=False,
        fixed={
            "offset": -0.12,
            "level": 0.3,
            "viscosity": 0.15,
            "inertia": 0.02,
            "direction_width": 0.05,
        },
    )
    assert {p.state for p in fit.parameters} == {"fixed"}
    assert fit.part.coefficients == pytest.approx(FRICTION)
    assert fit.rmse == pytest.approx(0.046, abs=0.01)
    assert "fixed" in str(fit)


def test_a_perfect_fit_prints():
    log = simulated(friction(), FRICTION, motion(1))
    fit = flexspline.fit(friction(), log, "sensor_torque", checks=False)
    assert fit.rmse < 1e-6
    assert "viscous_friction" in str(fit)


@pytest.mark.parametrize("effects", [iter([Effect("offset")]), "offset", Effect("offset")])
def test_one_effect_may_come_alone_or_from_any_iterable(effects):
    fit = flexspline.fit(effects, log_of(), "sensor_torque", checks=False)
    assert [p.name for p in fit.parameters] == ["offset.offset"]
