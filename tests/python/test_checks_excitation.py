"""Channels and excitation that the effects asked for need."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from checks_logs import sound_log

from flexspline import fit
from flexspline.effects import CATALOGUE
from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.checks import check
from flexspline.logs.checks.excitation import (
    both_directions,
    changing,
    excitation,
    excited,
    excited_together,
    motion_of,
    speeds,
)

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
        ("direction_dependent_friction", "100 % of the moving rows go one way"),
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


def test_a_coarse_encoder_does_not_hide_an_acceleration() -> None:
    """Behind the low pass that suits the velocity, steps of 2π/2¹⁷ make as much as the motion."""
    time = np.arange(10_000) / 500.0
    angle = 0.54 * np.sin(0.2 * np.pi * time) + 0.21 * np.sin(0.46 * np.pi * time)
    grain = 2 * np.pi / 2**17
    log = Log.from_arrays(time=time, output_position=grain * np.round(angle / grain))
    assert not check(log, effects=["inertia"]).named("no_excitation")


@pytest.mark.parametrize("counts", [1, 2, 3])
def test_an_encoder_that_flickers_by_a_count_or_two_stands_still(counts: int) -> None:
    rng = np.random.default_rng(counts)
    columns = {
        "output_position": 1.2 + 1e-4 * rng.integers(0, counts + 1, len(TIME)),
        "output_velocity": 1e-4 * rng.integers(-5, 6, len(TIME)),
    }
    found = check(Log.from_arrays(time=TIME, motor_current=rng.normal(size=len(TIME)), **columns))
    still = {one.effect: one.lack for one in found.excited if one.excited is False}
    for name in ("coulomb_friction", "viscous_friction", "inertia"):
        assert still[name] == "the joint stands still"


@pytest.mark.parametrize("grain", [1e-6, 1e-5, 1e-4, 1e-3])
def test_noise_that_is_part_of_an_acceleration_is_never_more_than_the_whole(grain: float) -> None:
    noise = 0.3 * grain * np.random.default_rng(1).standard_normal(len(TIME))
    angle = grain * np.round((0.4937 * TIME + noise) / grain)
    log = Log.from_arrays(time=TIME, output_position=angle)
    (finding,) = check(log, effects=["inertia"]).named("no_excitation")
    (part,) = re.findall(r"of which noise makes (all|[\d.e-]+\d)", finding.sentence)
    assert part == "all" or float(part) < finding.size


def test_without_a_target_effects_are_asked_of_those_whose_channels_are_all_there() -> None:
    """Torsion is the difference of two angles; one of them tells nothing of a gear."""
    torque = 0.1 * np.sin(TIME)
    one = one_speed().with_columns({"sensor_torque": torque}, note="a sensor")
    both = one.with_columns({"motor_position": 100.0 * one["output_position"]}, note="an encoder")
    asked = [{found.effect for found in excited(log, (), None)} for log in (one, both)]
    assert "output_ripple" in asked[0] & asked[1]
    assert "mesh_compliance" in asked[1] - asked[0]


def torsion_run(load: np.ndarray) -> Log:
    """Half a turn back and forth under a load (N,), with both encoders."""
    position = np.pi * np.sin(2 * np.pi * TIME / 5)
    return Log.from_arrays(
        time=TIME,
        output_position=position,
        motor_position=101 * position,
        reference_torque=load,
        motor_torque=np.full(len(TIME), 0.1),
        facts={"gear_ratio": 100, "output_spline": "circular"},
    )


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        ("mesh_compliance", "reference_torque changes by 0 Nm only"),
        ("wave_generator_compliance", "motor_torque changes by 0"),
        ("torsional_hysteresis", "0 Nm one way and 0 Nm back"),
    ],
)
def test_a_constant_torque_twists_nothing(effect: str, words: str) -> None:
    (finding,) = check(torsion_run(np.full(len(TIME), 5.0)), effects=[effect]).named(
        "no_excitation"
    )
    assert effect in finding.sentence and words in finding.sentence


def test_hysteresis_asks_for_loading_and_unloading_whatever_the_noise() -> None:
    noise = np.random.default_rng(1).standard_normal(len(TIME))
    rising = torsion_run(4.0 * TIME + noise)
    (finding,) = check(rising, effects=["torsional_hysteresis"]).named("no_excitation")
    assert "loads and unloads" in finding.remedy
    swinging = torsion_run(20.0 * np.sin(TIME) + noise)
    assert not check(swinging, effects=["torsional_hysteresis"]).named("no_excitation")


def test_without_a_torque_channel_the_mesh_is_no_candidate() -> None:
    log = torsion_run(np.sin(TIME))
    bare = Log.from_arrays(
        **{name: log[name] for name in ("time", "output_position", "motor_position")}
    )
    (finding,) = check(bare, effects=["mesh_compliance"]).named("missing_channel")
    assert finding.severity == "error" and finding.channel == "reference_torque"
    assert not check(bare, effects=["torsional_hysteresis"]).named("missing_channel")


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


def test_a_velocity_alone_is_motion_enough_but_for_an_acceleration() -> None:
    """Which `fit` derives of the angle alone."""
    log = Log.from_arrays(time=TIME, output_velocity=np.sin(TIME))
    assert not check(log, effects=["coulomb_friction", "viscous_friction"])
    (finding,) = check(log, effects=["inertia"])
    assert finding.sentence.startswith("inertia needs output_position or output_acceleration")


def test_a_short_run_is_said_to_be_short() -> None:
    log = sound_log(0, duration=0.5)
    assert check(log, effects=["offset", "viscous_friction"]).named("too_short")


def test_a_rich_run_excites_the_usual_effects() -> None:
    usual = (
        "offset",
        "coulomb_friction",
        "direction_dependent_friction",
        "viscous_friction",
        "stribeck_friction",
        "inertia",
        "temperature_drift",
        "motor_crosstalk",
    )
    assert not check(sound_log(0), effects=usual, target="sensor_torque")


def test_what_does_not_move_spans_no_speed() -> None:
    time = np.arange(200) / 100.0
    log = Log.from_arrays(time=time, output_position=0.0 * time)
    for need in (both_directions, speeds(2.0)):
        lack = need(log, None)
        assert lack is not None and lack[:2] == (0.0, "rad/s")


def test_of_channels_that_may_stand_for_each_other_one_that_changes_is_enough() -> None:
    time = np.arange(200) / 100.0
    log = Log.from_arrays(time=time, motor_torque=np.sin(time), motor_current=0.0 * time)
    for channels in ("motor_torque or motor_current", "motor_current or motor_torque"):
        assert changing(channels, 0.5, "Nm")(log, None) is None
    lack = changing("motor_current or sensor_torque", 0.5, "A")(log, None)
    assert lack is not None and lack[0] == 0.0 and "motor_current changes by 0 A" in lack[2]


@pytest.mark.parametrize("kwargs", [{"effects": ["coulomb_frictoin"]}, {"target": "sensr_torque"}])
def test_a_misspelt_name_is_refused_with_a_proposal(kwargs: dict[str, object]) -> None:
    with pytest.raises(InputError, match="did you mean"):
        check(one_speed(), **kwargs)  # type: ignore[arg-type]


def test_every_effect_can_be_asked_for() -> None:
    for effect in CATALOGUE:
        check(sound_log(1, duration=3.0), effects=[effect])


def test_pole_pairs_that_nobody_states_are_asked_for_and_not_assumed() -> None:
    time = np.arange(4000) / 500.0
    bare = Log.from_arrays(time=time, output_position=2.0 * time, facts={"gear_ratio": 100})
    (found,) = check(bare, effects=["cogging"]).named("no_excitation")
    assert "pole pairs is not stated" in found.sentence and found.remedy == "State pole_pairs."
    # order 100 × pairs at 2 rad/s: 220 Hz of 7 pairs is below half the rate, 255 Hz of 8 above
    for pairs, enough in ((7, True), (8, False)):
        said = check(bare.with_facts({"pole_pairs": pairs}), effects=["cogging"])
        assert bool(said.named("no_excitation")) is not enough


@pytest.mark.parametrize("make", [lambda: sound_log(1), lambda: sound_log(3), one_speed])
def test_what_is_said_of_every_effect_is_what_is_found_of_it_alone(make: Callable[[], Log]) -> None:
    """By the findings with which `fit` asks for its effects."""
    log = make()
    every = excited(log, tuple(CATALOGUE), None)
    assert [one.effect for one in every] == list(CATALOGUE)
    for one in every:
        found = [finding.name for finding in excitation(log, [one.effect], None)]
        assert ("no_excitation" in found) == (one.excited is False or "stated" in one.lack)
        no_channel = one.lack.startswith("no ") and "stated" not in one.lack
        assert ("missing_channel" in found) == no_channel
    motion_of.cache_clear()


def test_an_effect_of_the_load_is_excited_beside_what_makes_a_load_alone() -> None:
    log = sound_log(1)
    said = {one.effect: one for one in check(log, target="sensor_torque").excited}
    assert (
        said["sensor_lag"].excited
        and "with inertia or gravity beside it" in said["sensor_lag"].remedy
    )
    runs = [log.rows(slice(0, 2000))]
    with pytest.raises(InputError, match="inertia"):
        fit(["offset", "sensor_lag"], runs, "sensor_torque")
    assert not said["inertia"].remedy


def test_without_a_torque_constant_a_current_is_no_torque_that_an_effect_reads() -> None:
    log = sound_log(1)
    bare = Log({k: v for k, v in log.columns.items() if k != "motor_torque"}, log.facts)
    (one,) = check(bare, effects=["motor_crosstalk"]).excited
    assert one.excited is None and one.remedy == "State torque_constant."
    with pytest.raises(InputError, match="motor_torque"):
        fit(["offset", "motor_crosstalk"], bare, "sensor_torque")


def test_several_runs_excite_together_what_none_does_alone_but_no_longer_run() -> None:
    slow, fast = one_speed(), one_speed()
    back = fast.with_columns({"output_position": -3.0 * fast["output_position"]}, note="back")
    names = ("coulomb_friction", "viscous_friction", "temperature_drift", "time_drift")
    assert not any(one.excited for log in (slow, back) for one in excited(log, names, None))
    together = {one.effect: one.excited for one in excited_together([slow, back] * 4, names)}
    assert together == {
        "coulomb_friction": True, "viscous_friction": True,
        "temperature_drift": False, "time_drift": False,
    }  # fmt: skip


@pytest.mark.parametrize("ratio", [None, 100.0])
def test_a_motor_that_turns_beside_no_encoder_of_the_output_does_not_stand_still(
    ratio: float | None,
) -> None:
    columns = {"motor_position": 60.0 * np.sin(TIME), "motor_current": np.cos(TIME)}
    facts = {} if ratio is None else {"gear_ratio": ratio, "pole_pairs": 7}
    log = Log.from_arrays(time=TIME, facts=facts, **columns)
    found = {one.effect: one for one in check(log).excited}
    for name in ("wave_generator_ripple", "cogging"):
        if ratio is None:
            assert found[name].lack == "no gear ratio is stated"
            assert found[name].remedy == "State gear_ratio."
        else:
            assert found[name].excited
    still = {**columns, "motor_position": np.zeros(len(TIME))}
    (at_rest,) = excited(Log.from_arrays(time=TIME, **still), ["wave_generator_ripple"], None)
    assert at_rest.lack == "the joint stands still"


def test_channels_to_map_are_named_once() -> None:
    log = Log.from_arrays(time=TIME, motor_torque=np.cos(TIME), sensor_torque=np.sin(TIME))
    lack = {one.effect: one.lack for one in excited(log, (), None)}
    assert lack["position_dependent_friction"] == "no output_position"
    assert lack["load_dependent_friction"] == "no output_position or output_velocity"


def test_where_only_the_motor_has_an_encoder_the_map_that_takes_it_is_named() -> None:
    time = np.arange(0.0, 10.0, 0.004)
    motor = 50.0 * np.sin(time)
    bare = Log.from_arrays(time=time, motor_position=motor, motor_torque=0.1 * np.cos(time))
    geared = bare.with_facts({"gear_ratio": 50.0})
    sensed = geared.with_columns({"output_position": motor / 50.0}, note="an encoder")
    told = []
    for log in (bare, geared, sensed):
        found = check(log, effects=["coulomb_friction"])
        told.append([finding.remedy for finding in found.named("missing_channel")])
    assert len(told[0]) == len(told[1]) == 1 and not told[2]
    assert "scale = 0.02" in told[1][0] and "scale" not in told[0][0]
