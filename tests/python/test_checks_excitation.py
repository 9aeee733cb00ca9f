"""Channels and excitation that the effects asked for need."""

from __future__ import annotations

import numpy as np
import pytest
from checks_logs import sound_log

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.checks import check
from flexspline.logs.checks.excitation import EFFECTS

TIME = np.arange(10_000) / 1000


def one_speed() -> Log:
    """0.5 rad/s in one direction for 10 s."""
    noise = 1e-5 * np.random.default_rng(0).standard_normal(len(TIME))
    return Log.from_arrays(
        time=TIME,
        output_position=0.5 * TIME + noise,
        temperature=np.full(len(TIME), 30.0),
        facts={"gear_ratio": 100},
    )


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        ("coulomb_friction", "100 % of the moving rows go one way"),
        ("stribeck_friction", "go one way"),
        ("viscous_friction", "a factor of 1.5 is needed"),
        ("nonlinear_viscous_friction", "a factor of 3 is needed"),
        ("inertia", "of which noise makes"),
        ("output_ripple", "covers 0.8 of a turn"),
        ("temperature_drift", "changes by 0 °C only"),
        ("time_drift", "lasts 10 s"),
    ],
)
def test_a_run_at_one_speed_does_not_excite(effect: str, words: str) -> None:
    (finding,) = check(one_speed(), effects=[effect]).named("no_excitation")
    assert effect in finding.sentence and words in finding.sentence
    assert finding.severity == "note"


def test_low_speeds_are_asked_for_by_stribeck() -> None:
    square = 0.5 * np.sign(np.sin(TIME)) + 1e-4 * np.sin(50 * TIME)
    position = np.cumsum(square) / 1000
    log = Log.from_arrays(time=TIME[::1], output_position=position)
    assert (
        "slower than"
        in check(log, effects=["stribeck_friction"]).named("no_excitation")[0].sentence
    )


def test_cogging_beyond_half_the_rate_is_named_with_its_order() -> None:
    time = np.arange(0, 20, 0.01)
    log = Log.from_arrays(
        time=time, output_position=2.0 * time, facts={"gear_ratio": 100, "pole_pairs": 7}
    )
    (finding,) = check(log, effects=["cogging"]).named("no_excitation")
    assert "order 700 per turn is above half the rate of 100 Hz" in finding.sentence


@pytest.mark.parametrize(
    ("effect", "channel"),
    [
        ("gain_error", "reference_torque"),
        ("temperature_drift", "temperature"),
        ("kinematic_error", "motor_position"),
    ],
)
def test_a_missing_channel_is_an_error(effect: str, channel: str) -> None:
    log = Log.from_arrays(time=TIME, output_position=np.sin(TIME))
    (finding,) = check(log, effects=[effect]).errors
    assert (finding.name, finding.channel) == ("missing_channel", channel)


def test_a_missing_target_is_an_error() -> None:
    findings = check(one_speed(), target="sensor_torque")
    assert [f.name for f in findings.errors] == ["missing_channel"]


def test_a_velocity_alone_is_motion_enough() -> None:
    log = Log.from_arrays(time=TIME, output_velocity=np.sin(TIME))
    assert not check(log, effects=["coulomb_friction", "viscous_friction", "inertia"])


def test_a_short_run_is_said_to_be_short() -> None:
    log = sound_log(0, duration=0.5)
    assert check(log, effects=["offset", "viscous_friction"]).named("too_short")


def test_a_rich_run_excites_the_usual_effects() -> None:
    usual = (
        "offset",
        "coulomb_friction",
        "viscous_friction",
        "stribeck_friction",
        "inertia",
        "temperature_drift",
        "motor_crosstalk",
    )
    assert not check(sound_log(0), effects=usual, target="sensor_torque")


@pytest.mark.parametrize("kwargs", [{"effects": ["coulomb_frictoin"]}, {"target": "sensr_torque"}])
def test_a_misspelt_name_is_refused_with_a_proposal(kwargs: dict[str, object]) -> None:
    with pytest.raises(InputError, match="did you mean"):
        check(one_speed(), **kwargs)  # type: ignore[arg-type]


def test_every_effect_can_be_asked_for() -> None:
    for effect in EFFECTS:
        check(sound_log(1, duration=3.0), effects=[effect])
