"""The run to record next separates what the recorded runs confound, within the limits."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from confounded_logs import LOAD, RATE, RIGS, WIDTH, Rig, random_excitation
from driven_joint import driven, waves
from fit_logs import autoregressive
from measured import ur10e

import flexspline
from flexspline import Limits, Model, Part, Plan, _core
from flexspline.cli import commands
from flexspline.effects import effect
from flexspline.experiment import _prepared, recording
from flexspline.experiment.plan import Bounds, over
from flexspline.experiment.planning import Bench, Layout, Trust, in_any_run
from flexspline.experiment.recording import _kinds
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log
from flexspline.prepared import Preparation
from flexspline.regression.gram import Whitening

ANGLE, MOTOR = "a load tied to the angle", "a motor that follows the load"
CLOCK, WEIGHT = "a warm-up that follows the clock", "a weight of its own"
LIMITS = {MOTOR: Limits(velocity=1.5, acceleration=6.0)}
AGREES = 0.2  # of t: forms are fitted, and the noise of four runs is known to 10 %


@cache
def recorded(name: str) -> tuple[Log, ...]:
    return tuple(RIGS[name].recorded(number) for number in range(1, 5))


@cache
def fitted(name: str) -> Fit:
    rig = RIGS[name]
    hidden = effect(rig.hidden)
    return flexspline.fit(
        [*rig.base, hidden], recorded(name), "sensor_torque", known_load=LOAD, checks=False
    )


@cache
def plan(name: str) -> Plan:
    rig = RIGS[name]
    rival = effect(rig.rival, orders=[1]) if rig.rival == "output_ripple" else rig.rival
    made = flexspline.next_experiment(
        fitted(name), (rig.hidden, rival), recorded(name), limits=LIMITS.get(name)
    )
    assert made is not None
    return made


def followed(name: str) -> list[Log]:
    """The recorded runs and the planned one, really recorded."""
    return [*recorded(name), *RIGS[name].follow(plan(name).log, 40)]


def discovered(name: str) -> flexspline.Discovery:
    return flexspline.discover(
        RIGS[name].base, followed(name), target="sensor_torque", known_load=LOAD
    )


@pytest.mark.parametrize("name", [ANGLE, MOTOR, CLOCK])
def test_the_separation_that_is_expected_is_the_one_that_comes(name: str) -> None:
    rig: Rig = RIGS[name]
    made = plan(name)
    assert rig.separation(recorded(name)) < 3.0 and made.now < 3.0
    assert made.expected > 20.0
    assert made.expected == pytest.approx(rig.separation(followed(name)), rel=AGREES)


@pytest.mark.parametrize("name", [ANGLE, MOTOR])
def test_a_random_excitation_of_the_same_length_separates_less(name: str) -> None:
    rig, bounds = RIGS[name], plan(name).bounds
    assert bounds.load is not None
    planned = rig.separation([*recorded(name), *rig.follow(plan(name).log, 40)[:1]])
    worse = 0
    for seed in range(10):
        run = random_excitation(seed, bounds.duration, bounds.position, bounds.load,
                                bounds.velocity, bounds.acceleration)  # fmt: skip
        worse += rig.separation([*recorded(name), rig.record(run, 60 + seed)]) < planned
    assert worse >= 9


@pytest.mark.parametrize("name", [ANGLE, MOTOR])
def test_the_planned_run_added_the_right_cause_is_named_alone(name: str) -> None:
    made = discovered(name)
    assert made.names == (RIGS[name].hidden,)
    assert made.found[0].indistinguishable_from == ()
    assert made.next_experiment is None and made.plan is None


def test_gravity_and_a_first_order_of_the_output_need_another_mounting() -> None:
    made = plan(WEIGHT)
    assert made.expected < 0.05
    assert "No motion tells gravity and output_ripple apart, within any limits" in made.sentence
    assert "upright" in made.sentence and "Another payload" in made.sentence


def test_other_orders_that_stand_for_gravity_over_part_of_a_turn_promise_no_run() -> None:
    """Runs over a whole turn let the ripple have order 1, whatever orders it has in these."""
    narrow = effect("output_ripple", orders=[2, 3])
    asked = flexspline.next_experiment(fitted(WEIGHT), ("gravity", narrow), recorded(WEIGHT))
    assert asked is not None and asked.expected > 3.0  # of these orders alone a run does tell it

    found = SimpleNamespace(
        fit=fitted(WEIGHT),
        model=fitted(WEIGHT).model,
        found=[
            SimpleNamespace(
                effect="gravity",
                rivals=[SimpleNamespace(effect=narrow, name=narrow.name)],
                indistinguishable_from=[narrow.name],
            )
        ],
    )
    made = flexspline.next_experiment(cast(Any, found), None, recorded(WEIGHT))
    assert made is not None and made.outlooks[0].expected < 0.05
    assert "Record" not in made.sentence.split(":")[0] and "upright" in made.sentence


def test_a_rival_gets_order_1_beside_gravity_alone_and_keeps_its_own() -> None:
    ripple = effect("output_ripple", orders=[2, 3])
    wide = in_any_run("gravity", ripple)
    assert [order for order, _ in wide.harmonics] == [1, 2, 3]
    assert in_any_run("gravity", wide) == wide and in_any_run("inertia", ripple) == ripple
    full = effect("output_ripple", orders=range(2, 2 + _core.max_harmonics))
    assert len(in_any_run("gravity", full).harmonics) == _core.max_harmonics


def test_where_the_limits_are_too_tight_the_one_that_binds_is_named() -> None:
    rig = RIGS[MOTOR]
    made = flexspline.next_experiment(
        fitted(MOTOR), (rig.hidden, rig.rival), recorded(MOTOR), limits=Limits(acceleration=0.1)
    )
    assert made is not None and made.expected < 3.0
    assert made.outlooks[0].doubled is not None
    assert "acceleration binds" in made.sentence and "No run within these limits" in made.sentence


@cache
def at_one_temperature() -> tuple[Log, ...]:
    rig = RIGS[ANGLE]
    runs = [rig.recorded(number) for number in range(1, 4)]
    constant = np.full(len(runs[0]), 30.0)
    return tuple(run.with_columns({"temperature": constant}, note="a room") for run in runs)


def told_by_temperature(limits: Limits | None) -> Plan:
    rig, logs = RIGS[ANGLE], at_one_temperature()
    effects = [*rig.base, effect(rig.hidden)]
    fit = flexspline.fit(effects, logs, "sensor_torque", known_load=LOAD, checks=False)
    made = flexspline.next_experiment(fit, ("offset", "temperature_drift"), logs, limits=limits)
    assert made is not None
    return made


def test_runs_at_one_temperature_are_told_that_others_would_tell() -> None:
    """It said that nothing which can be commanded would, and twice a range of zero is none."""
    made = told_by_temperature(None)
    assert made.expected < 0.05
    binds = "the temperature binds: from 20 to 40 °C instead of 30 °C, t = "
    assert binds in made.sentence and "twice as wide" not in made.sentence
    promised = made.outlooks[0].doubled
    assert promised is not None
    there = told_by_temperature(Limits(temperature=(20.0, 40.0)))
    assert there.expected == pytest.approx(promised[2], rel=0.3)  # the same, its motion refined


def test_a_temperature_that_cannot_be_set_is_not_asked_for() -> None:
    made = told_by_temperature(Limits(temperature=(30.0, 30.0)))
    assert "temperature binds" not in made.sentence
    assert "all that can be commanded acts on both alike" in made.sentence


def test_a_narrow_range_of_temperatures_binds_like_any_other() -> None:
    """A planned run held the temperatures that it had, whatever the limits."""
    narrow = told_by_temperature(Limits(temperature=(29.9, 31.1)))
    assert not narrow.outlooks[0].settled
    assert "the temperature binds: from 29 to 32 °C, t = " in narrow.sentence


def test_a_parameter_that_the_runs_leave_open_gets_a_run_too() -> None:
    rig = Rig(("offset",), "", "", lambda c: 0.8 * np.cos(c["output_position"] - 0.4),
              lambda c: {}, swing=0.1)  # fmt: skip
    logs = [rig.recorded(number) for number in range(1, 4)]
    known = effect("coulomb_friction", direction_width=WIDTH)
    names = ["offset", known, "viscous_friction", "gravity"]
    fixed = {"direction_width": WIDTH}
    fit = flexspline.fit(names, logs, "sensor_torque", fixed=fixed, checks=False)
    assert {"offset.offset", "gravity.cosine"} <= {
        n for group in fit.confounded for n in group.names
    }
    narrow = flexspline.next_experiment(fit, None, logs)
    wide = flexspline.next_experiment(
        fit, None, logs, limits=Limits(position=(-1.5, 1.5), velocity=1.0, acceleration=2.0)
    )
    assert narrow is not None and "No run within these limits determines" in narrow.sentence
    assert wide is not None and all(one.settled for one in wide.outlooks)
    again = flexspline.fit(names, [*logs, *rig.follow(wide.log, 50)], "sensor_torque", checks=False)
    for one in wide.outlooks:
        (name,) = one.names
        assert again[name].determined
        assert again[name].standard_error < one.now / 3.0
        assert 0.3 < again[name].standard_error / one.expected < 3.0


def test_of_what_a_fit_takes_the_shortest_solution_for_nothing_is_known() -> None:
    """At one speed offset and friction are one torque: half of it each is known of neither."""
    generator, time = np.random.default_rng(1), np.arange(6000) / 200.0
    velocity = 0.5 + 1e-3 * np.sin(time)
    noise = 0.02
    log = flexspline.Log.from_arrays(
        time=time,
        output_position=np.cumsum(velocity) / 200.0,
        output_velocity=velocity,
        motor_current=0.3 + noise * generator.standard_normal(len(time)),
        facts={"gear_ratio": 100.0, "torque_constant": 0.1},
    )
    fit = flexspline.fit(["offset", "coulomb_friction"], log, "motor_current", checks=False)
    made = flexspline.next_experiment(fit, None, log)
    assert made is not None and made.sentence.count("now nothing is known of it") == 2
    for one in made.outlooks:
        assert one.now == np.inf and one.settled
        assert 0.5 < one.expected * np.sqrt(len(time)) / noise < 5.0


def test_nothing_confounded_needs_no_run() -> None:
    assert flexspline.next_experiment(fitted(ANGLE), None, recorded(ANGLE)) is None


@pytest.mark.parametrize("name", [ANGLE, MOTOR, CLOCK, WEIGHT])
def test_a_trajectory_obeys_its_limits_and_begins_and_ends_at_rest(
    name: str, tmp_path: Path
) -> None:
    made = plan(name)
    made.save(tmp_path / "next_experiment.csv")
    log = flexspline.read_log(tmp_path / "next_experiment.csv")
    bounds, slack = made.bounds, 1e-9
    q, v, a = (log[f"output_{k}"] for k in ("position", "velocity", "acceleration"))
    assert bounds.position[0] - slack <= q.min() and q.max() <= bounds.position[1] + slack
    assert np.abs(v).max() <= bounds.velocity * (1 + slack)
    assert np.abs(a).max() <= bounds.acceleration * (1 + slack)
    assert abs(v[0]) + abs(v[-1]) + abs(a[0]) + abs(a[-1]) < 1e-9
    if "reference_torque" in log:
        assert bounds.load is not None
        assert bounds.load[0] - slack <= log[LOAD].min()
        assert log[LOAD].max() <= bounds.load[1] + slack
    inside = np.diff(log["time"]) < 0.5
    assert inside.sum() / RATE == pytest.approx(bounds.duration, abs=0.1)
    # Velocity is the derivative of the angle, acceleration that of velocity: the trapezoidal rule
    # is wrong by h³/12 of the next derivative but one, here below a thousandth of the limits.
    step = np.diff(log["time"])[inside]
    for slope, value, size in ((v, q, bounds.velocity), (a, v, bounds.acceleration)):
        mean = 0.5 * (slope[1:] + slope[:-1])[inside]
        assert np.abs(np.diff(value)[inside] - mean * step).max() < 0.01 * size * step.max()


def test_every_kind_of_run_keeps_within_any_limits() -> None:
    draw = np.random.default_rng(5)
    for _ in range(60):
        low, span = draw.uniform(-3, 3), 10 ** draw.uniform(-2, 1.5)
        velocity, acceleration = 10 ** draw.uniform(-2, 1), 10 ** draw.uniform(-2, 1.5)
        seconds = 10 ** draw.uniform(0.5, 2.0)
        bounds = Bounds((low, low + span), velocity, acceleration, None, 0.0, None, 0.0, seconds)
        for kind in _kinds():
            path = kind.draw(draw.uniform(size=kind.starts.shape[1]), bounds).path
            q, v, a = path(np.linspace(0.0, seconds, 3000)).T
            assert low - 1e-9 <= q.min() and q.max() <= low + span + 1e-9, kind.name
            assert np.abs(v).max() <= velocity * (1 + 1e-9), kind.name
            assert np.abs(a).max() <= acceleration * (1 + 1e-9), kind.name
            assert np.abs([v[0], v[-1]]).max() <= 1e-9 * velocity, kind.name
            assert abs(q[-1] - q[0]) <= 1e-9 * max(span, 1.0), kind.name


@pytest.mark.parametrize("rate", [37.0, 100.0, 1000.0])
def test_the_words_say_the_angles_of_the_trajectory_at_any_rate(rate: float) -> None:
    draw, kind = np.random.default_rng(6), next(k for k in _kinds() if k.name == "holds")
    setting = recording.Setting((recording.Part(None, None),))
    for _ in range(300):
        bounds = Bounds((1.0, 5.0), 1.0, 10.0, None, 0.0, None, 0.0, draw.uniform(3.0, 12.0))
        made = recording.Excitation(kind, draw.uniform(size=3), setting)
        q = recording.commanded(made, bounds, rate)["output_position"]
        assert over(q.min(), q.max()) in made.words(bounds)


def test_a_planned_run_of_a_drive_counts_the_rows_that_a_fit_counts() -> None:
    """To and fro at one speed for six seconds, then at rest; the motion is read at −3 dB at 5 Hz.

    No filter at 2.5 Hz reaches over 0.42 s, 1.05 / B (`logs/derive.py`).
    """
    ways = tuple(
        Preparation(name, "output_position", 5.0) for name in ("output_velocity", "output_position")
    )
    friction = (effect("coulomb_friction", direction_width=0.01), effect("viscous_friction"))
    part = Part("motor_torque", friction, np.array([4.0, 6.0]))
    problem, work = _prepared(part, [], [driven(waves(), 0.0, 0.6)], None)
    time = np.arange(1000) / 100.0
    moving, ahead = time < 6.0, np.mod(time, 2.0) < 1.0
    columns = {
        "time": time,
        "output_position": np.where(moving, 0.5 * np.abs(np.mod(time - 1.0, 2.0) - 1.0), 0.0),
        "output_velocity": np.where(moving, np.where(ahead, 0.5, -0.5), 0.0),
    }
    counted = {}
    for resolved in (None, 0.1):
        bench = Bench(
            replace(problem, preparations=ways), Layout(work, (), ()),
            Whitening(np.ones(1), 1.0, 1), Trust(np.empty(0), np.ones(1)), 100.0, None,
            np.zeros((2, 2)), resolved,
        )  # fmt: skip
        (run,) = bench.as_read(columns).runs
        counted[resolved] = np.zeros(1000, dtype=bool)
        for first, last in run.stretches:
            counted[resolved][first:last] = True
    assert counted[None][:550].all() and not counted[None][700:].any()
    beside = np.abs(time - np.round(time))  # s from the next reversal
    inside = (time > 0.5) & (time < 5.5)
    blurred = inside & (beside > 0.04) & (beside < 0.08)
    assert not counted[0.1][blurred].any() and counted[0.1][inside & (beside > 0.43)].all()


def test_a_joint_whose_angle_is_not_recorded_rests() -> None:
    logs = []
    for number in (1, 2):
        log = RIGS[CLOCK].recorded(number)
        noise = autoregressive(np.random.default_rng([number, 83]), len(log), 0.6, 0.02)
        torque = 0.05 * (log["temperature"] - 25.0) + noise
        kept = {"time": log["time"], "temperature": log["temperature"]}
        logs.append(Log.from_arrays(**kept, sensor_torque=torque))
    fit = flexspline.fit(["offset", "temperature_drift"], logs, "sensor_torque", checks=False)
    made = flexspline.next_experiment(fit, ("temperature_drift", "time_drift"), logs)
    assert made is not None and made.expected > 3.0
    assert np.ptp(made.log["output_position"]) == 0.0
    assert np.ptp(made.log["temperature"]) > 5.0


def test_the_figure_names_channels_with_their_units() -> None:
    figure = plan(CLOCK).plot()
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels[:3] == ["angle [rad]", "velocity [rad/s]", "temperature [°C]"]
    assert figure.axes[-1].get_xlabel() == "expected separation t [–]"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"velocity": -1.0}, "velocity"),
        ({"position": (1.0, 0.0)}, "lowest first"),
        ({"load": (0.0, float("nan"))}, "lowest, highest"),
    ],
)
def test_limits_that_cannot_be_are_refused(given: dict[str, float], said: str) -> None:
    with pytest.raises(flexspline.InputError, match=said):
        Limits(**given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("pair", "said"),
    [
        (("offset", "coulomb_friction"), "one must be in the model"),
        (("gain_error", "sensor_lag"), "one must be in the model"),
        (("offset", "output_ripple"), "orders"),
    ],
)
def test_rivals_that_are_none_are_refused(pair: tuple[str, str], said: str) -> None:
    with pytest.raises(flexspline.InputError, match=said):
        flexspline.next_experiment(fitted(ANGLE), pair, recorded(ANGLE))


def test_discover_writes_the_trajectory_beside_its_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = []
    for number, log in enumerate(recorded(ANGLE)):
        paths.append(str(tmp_path / f"{number}.csv"))
        log.to_frame().to_csv(paths[-1], index=False)
    out = tmp_path / "found"
    asked = ["discover", *paths, "--target", "sensor_torque", "--known-load", LOAD,
             "--gear-ratio", "100", "--output-spline", "circular", "--out", str(out),
             "--effects", ",".join(RIGS[ANGLE].base), "--limit", "velocity=0.3",
             "--limit", "position=-0.4,0.4"]  # fmt: skip
    with pytest.raises(SystemExit) as left:
        commands.main(asked)
    assert not left.value.code
    content = json.loads((out / "discovery.json").read_text(encoding="utf-8"))
    assert "position_dependent_friction would stand apart" in content["next_experiment"]
    assert "next_experiment.csv" in capsys.readouterr().out
    log = flexspline.read_log(out / "next_experiment.csv")
    assert np.abs(log["output_velocity"]).max() <= 0.3
    assert log["output_position"].min() >= -0.4 and log["output_position"].max() <= 0.4
    assert np.ptp(log["output_position"]) > 0.1


@pytest.mark.usefixtures("data_folder")
def test_ur10e_joint_2_goes_to_and_fro_where_its_load_changes_sign() -> None:
    log = ur10e(2)
    wide = {"direction_width": 0.0124}  # all values are those of a fit to this run
    effects = [
        effect("offset"),
        effect("coulomb_friction", **wide),
        effect("viscous_friction"),
        effect("inertia"),
        effect("gravity"),
        effect("load_dependent_friction", **wide),
    ]
    values = [0.14, 0.963, 1.78, 1.751, 0.08, -10.35, 0.0627]
    model = Model({"drive": Part("motor_current", tuple(effects), np.array(values))})
    made = flexspline.next_experiment(
        model, ("load_dependent_friction", "position_dependent_friction"), log, lowpass=5.0
    )
    assert made is not None and made.now < 4.0 and made.expected > 1.5 * made.now
    # By motion alone the rival stays near, and the sentence does not hide it.
    assert made.outlooks[0].taken > 0.84 and "a payload" in made.sentence
    # The arm stands upright at −π/2: there |load| has its kink, which no low harmonic has.
    q = made.log["output_position"]
    assert q.min() < -np.pi / 2 < q.max()
    assert log["output_position"].min() <= q.min() and q.max() <= log["output_position"].max()
