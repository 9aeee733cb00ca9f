"""Coefficients follow a joint that drifts, and stay where there is nothing to be learned."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import drifting_joint as rig
import numpy as np
import pytest
from drifting_joint import COULOMB, NAMES, RATE, VISCOUS

import flexspline
from flexspline import Adaptation, Estimate, InputError, Model, Observer, Part, effect
from flexspline.estimation.plan import plan_of
from flexspline.estimators.external_torque import factor_of
from flexspline.exporting import export
from flexspline.exporting.block import block_bytes
from flexspline.logs.log import Log

FRICTION = ("coulomb_friction", "viscous_friction")
MEMORY = 60.0


@pytest.fixture(scope="module")
def fitted() -> Model:
    return rig.fitted()


def learner(model: Model, **settings: object) -> Model:
    given = {"memory": MEMORY, **settings}
    return model.with_estimator(Adaptation(FRICTION, **given))  # type: ignore[arg-type]


def errors(made: Estimate, worn: np.ndarray) -> np.ndarray:
    """Of both coefficients, over the true ones, behind five memories, (2, rows)."""
    late = slice(int(5 * MEMORY * RATE), None)
    true = ((NAMES[0], COULOMB), (NAMES[1], VISCOUS))
    return np.array([(made[name] / (value * worn) - 1.0)[late] for name, value in true])


@pytest.mark.parametrize("seed", range(5))
def test_friction_that_rises_by_a_fifth_is_followed(fitted: Model, seed: int) -> None:
    log, worn = rig.log(1200.0, 10 + seed, 0.2)
    found = errors(flexspline.estimate(learner(fitted), log), worn)
    # Late by a memory, 1 % of the start, and by half a round; four times 0.35 % and 0.6 % of noise.
    assert np.abs(found[0]).max() < 0.025
    assert np.abs(found[1]).max() < 0.035
    assert np.abs(np.median(found, axis=1)).max() < 0.015  # without it: 0.11 in the middle


def at_speeds(seconds: float, seed: int, falls: float, *speeds: float) -> tuple[Log, np.ndarray]:
    """To and fro in strokes of 2 s at these speeds [rad/s] in turn; friction falls by a share."""
    log, _ = rig.log(seconds, seed)
    time, random = log["time"], np.random.default_rng(seed)
    size = np.array(speeds)[(time // 4.0).astype(int) % len(speeds)]
    v = size * np.clip(8.0 * np.sin(2.0 * np.pi * time / 4.0), -1.0, 1.0)
    a, worn = np.gradient(v, time), 1.0 - falls * time / seconds
    output = rig.INERTIA * a + worn * (COULOMB * np.tanh(v / rig.WIDTH) + VISCOUS * v)
    output += rig.ar_noise(random, len(time), 0.95, 0.25)
    columns = {"motor_torque": output / rig.RATIO, "output_velocity": v, "output_acceleration": a}
    return log.with_columns(columns, note="strokes"), worn


def said_of_split(made: Estimate) -> list[str]:
    return [doubt for doubt in made.doubts if "rounds of the adaptation" in doubt]


def test_one_speed_does_not_tell_level_from_viscosity_and_that_is_said(fitted: Model) -> None:
    log, worn = at_speeds(1200.0, 4, 0.3, 0.5)
    made = flexspline.estimate(learner(fitted), log)
    level, viscosity = (made[name][-1] for name in NAMES)
    assert level + 0.5 * viscosity == pytest.approx((COULOMB + 0.5 * VISCOUS) * worn[-1], rel=0.03)
    assert level > 1.15 * COULOMB * worn[-1] and viscosity < 0.85 * VISCOUS * worn[-1]
    (said,) = said_of_split(made)
    assert "the motion tells 1 of 2 directions of coulomb_friction.level, visc" in said
    log, worn = at_speeds(1200.0, 4, 0.3, 0.2, 0.8)
    made = flexspline.estimate(learner(fitted), log)
    assert made[NAMES[0]][-1] == pytest.approx(COULOMB * worn[-1], rel=0.05)
    assert made[NAMES[1]][-1] == pytest.approx(VISCOUS * worn[-1], rel=0.05)
    assert said_of_split(made) == []
    assert said_of_split(flexspline.estimate(learner(fitted), rig.log(600.0, 5)[0])) == []


def test_half_of_the_memory_is_half_as_late(fitted: Model) -> None:
    log, worn = rig.log(1200.0, 3, 0.2)
    late = [
        errors(flexspline.estimate(learner(fitted, memory=memory), log), worn).mean(axis=1)
        for memory in (60.0, 120.0)
    ]
    assert (late[1] < late[0]).all() and (late[0] < 0.0).all()
    assert np.mean(late[1] / late[0]) == pytest.approx(2.0, rel=0.35)


def test_monitoring_changes_no_estimate_and_compensating_brings_the_observer_back(
    fitted: Model,
) -> None:
    log, _ = rig.log(600.0, 4, 0.2)
    plain, watched, helped = (
        flexspline.estimate(model, log)["external_torque_observer"]
        for model in (fitted, learner(fitted), learner(fitted, use="compensate"))
    )
    assert np.abs(watched - plain).max() < 1e-12  # the effects are summed in another order
    moving = np.abs(log["output_velocity"]) > 0.1
    late = moving & (log["time"] > 500.0)
    sizes = [np.sqrt(np.mean(torque[late] ** 2)) for torque in (plain, helped)]
    assert sizes[0] > 1.5 and sizes[1] < 0.25 * sizes[0]


def test_a_joint_that_stands_keeps_what_it_knew(fitted: Model) -> None:
    log, _ = rig.log(600.0, 5, stands=(100.0, 500.0))
    made = flexspline.estimate(learner(fitted), log)
    still = (log["time"] >= 101.0) & (log["time"] < 500.0)
    for name in NAMES:
        assert np.ptp(made[name][still]) == 0.0
        assert np.ptp(made[name]) > 0.0


def test_a_contact_does_not_teach(fitted: Model) -> None:
    pushed, _ = rig.log(400.0, 6, push=(200.0, 260.0, 12.0))
    free, _ = rig.log(400.0, 6)
    made, alone = (flexspline.estimate(learner(fitted), log) for log in (pushed, free))
    assert made["contact"][int(210 * RATE) : int(250 * RATE)].all()
    for name in NAMES:
        assert made[name][-1] == pytest.approx(alone[name][-1], rel=0.01)
        assert np.abs(made[name] / made[name][int(199 * RATE)] - 1.0)[-50_000:].max() < 0.02


def test_without_a_detector_the_gate_keeps_a_push_out(fitted: Model) -> None:
    rest = {key: made for key, made in fitted.estimators.items() if key != "collision"}
    blind = learner(replace(fitted, estimators=rest))
    log, _ = rig.log(400.0, 7, push=(200.0, 260.0, 12.0))
    made = flexspline.estimate(blind, log)
    for name in NAMES:
        assert np.ptp(made[name][int(202 * RATE) : int(259 * RATE)]) < 0.01 * made[name][0]


def test_a_slow_push_below_the_gate_is_taken_for_friction_within_its_range(fitted: Model) -> None:
    """What the description warns of: no witness tells such a push from friction."""
    log, _ = rig.log(600.0, 8, push=(100.0, 600.0, 0.9))
    made = flexspline.estimate(learner(fitted, use="compensate"), log)
    moved = [abs(made[name][-1] / made[name][0] - 1.0) for name in NAMES]
    assert max(moved) < 0.15


def test_a_sensor_that_knows_the_load_keeps_it_out_of_friction(fitted: Model) -> None:
    log, worn = rig.log(600.0, 9, 0.1, push=(0.0, 600.0, 1.0))
    noise = 0.1 * np.random.default_rng(1).standard_normal(len(log))
    log = log.with_columns({"sensor_torque": np.full(len(log), 1.0) + noise}, note="a sensor")
    sensor = Part("sensor_torque", (effect("offset"),), np.array([0.0]))
    joint = replace(fitted, parts={**fitted.parts, "sensor": sensor}, estimators={})
    joint = joint.with_estimator(Observer(40.0, "motor_torque"))
    found = errors(flexspline.estimate(learner(joint, load="sensor"), log), worn)
    assert np.abs(found[0]).max() < 0.025 and np.abs(found[1]).max() < 0.035


def test_what_was_learned_goes_on_behind_a_gap(fitted: Model) -> None:
    log, _ = rig.log(300.0, 10, start=1.15)
    time = log["time"] + 1000.0 * (log["time"] >= 200.0)
    gap = log.with_columns({"time": time}, note="a night")
    made, whole = (flexspline.estimate(learner(fitted), one) for one in (gap, log))
    row = int(200 * RATE)
    assert made.status[row] & 256
    for name in NAMES:
        assert made[name][row] == made[name][row - 1]
        assert made[name][-1] == pytest.approx(whole[name][-1], rel=0.005)


def test_rows_that_are_missing_cost_nothing_but_themselves(fitted: Model) -> None:
    log, _ = rig.log(300.0, 11, start=1.1)
    torque = log["motor_torque"].copy()
    torque[np.random.default_rng(2).random(len(torque)) < 0.02] = np.nan
    holes = log.with_columns({"motor_torque": torque}, note="holes")
    made, whole = (flexspline.estimate(learner(fitted), one) for one in (holes, log))
    for name in NAMES:
        assert np.isfinite(made[name]).all()
        assert made[name][-1] == pytest.approx(whole[name][-1], rel=0.01)


def test_columns_are_named_and_written(fitted: Model, tmp_path: Path) -> None:
    log, _ = rig.log(30.0, 12)
    made = flexspline.estimate(learner(fitted), log)
    assert tuple(made.columns)[-2:] == NAMES
    assert made.adapted == {NAMES[0]: "Nm", NAMES[1]: "Nm·s/rad"}
    assert NAMES[1] in str(made) and "Nm·s/rad" in made._repr_html_()
    made.save(tmp_path / "out.csv")
    head = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()[0]
    assert head.endswith(",".join(NAMES))
    assert made.to_frame()[NAMES[0]].iloc[0] == made[NAMES[0]][0]


def test_a_model_without_it_is_exported_as_ever(fitted: Model, tmp_path: Path) -> None:
    export(fitted, tmp_path / "joint.hpp")
    assert "adapt" not in (tmp_path / "joint.hpp").read_text(encoding="utf-8").lower()
    assert len(block_bytes(learner(fitted))) == len(block_bytes(fitted)) + 4 * (6 + 2 + 2 + 3)


def test_it_starts_with_the_covariance_of_the_fit(fitted: Model) -> None:
    part = fitted.parts["drive"]
    entry = plan_of(learner(fitted)).estimating["adaptation"]
    d0, u, d1 = entry["factor"]
    factors = np.array([[1.0, u], [0.0, 1.0]])
    made = factors @ np.diag([d0, d1]) @ factors.T
    known = part.record["covariance"]
    places = [known["names"].index(name) for name in NAMES]
    assert made == pytest.approx(np.array(known["matrix"])[np.ix_(places, places)], rel=1e-9)
    low, high = np.array(entry["low"]), np.array(entry["high"])
    values = part.coefficients[1:]
    assert low == pytest.approx(values / 2.0) and high == pytest.approx(2.0 * values)
    width = part.effects[1].shapes["direction_width"]
    assert entry["least_speed"] == pytest.approx(3.0 * width)
    assert entry["noise"] == pytest.approx(0.29, abs=0.02)


def test_a_part_that_no_fit_made_starts_with_its_ranges() -> None:
    effects = (effect("inertia"), effect("coulomb_friction"), effect("offset"))
    part = Part("motor_torque", effects, np.array([0.8, 6.0, -0.1]))
    joint = Model({"drive": part}, rig.FACTS).with_estimator(Observer(40.0, "motor_torque"))
    made = joint.with_estimator(Adaptation(("offset", "coulomb_friction"), noise=0.5))
    plan = plan_of(made)
    assert plan.observed is not None
    assert [one.name for one in plan.observed.effects] == ["coulomb_friction", "offset"]
    entry = plan.estimating["adaptation"]
    assert entry["low"] == [3.0, -0.2] and entry["high"] == [12.0, -0.05]
    assert entry["factor"] == pytest.approx([1.5**2, 0.0, 0.025**2])


def test_a_coefficient_that_was_fixed_is_not_adapted(fitted: Model) -> None:
    part = fitted.parts["drive"]
    entries = [
        {**one, "state": "fixed", "standard_error": None} if one["name"] == NAMES[0] else one
        for one in part.record["parameters"]
    ]
    held = replace(part, record={**part.record, "parameters": entries})
    joint = learner(replace(fitted, parts={"drive": held}))
    log, _ = rig.log(120.0, 13, start=1.1)
    made = flexspline.estimate(joint, log)
    assert np.ptp(made[NAMES[0]]) == 0.0
    assert made[NAMES[1]][-1] > 1.05 * made[NAMES[1]][0]


def test_a_covariance_is_taken_apart() -> None:
    random = np.random.default_rng(3)
    for size in range(1, 9):
        rows = random.standard_normal((size + 2, size)) * 10.0 ** random.uniform(-3, 3, size)
        covariance = rows.T @ rows
        packed = factor_of(covariance)
        assert packed is not None
        upper, diagonal = np.eye(size), np.zeros(size)
        for k in range(size):
            first = k * (k + 1) // 2
            upper[:k, k], diagonal[k] = packed[first : first + k], packed[first + k]
        assert (diagonal > 0.0).all()
        scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        again = upper @ np.diag(diagonal) @ upper.T
        assert np.abs((again - covariance) / scale).max() < 1e-9
    assert factor_of(np.array([[1.0, 2.0], [2.0, 1.0]])) is None


def test_model_json_keeps_it(fitted: Model, tmp_path: Path) -> None:
    made = learner(fitted, gate=3.0, least_speed=0.1, use="compensate")
    made.save(tmp_path / "model.json")
    again = Model.load(tmp_path / "model.json")
    assert again.estimators["adaptation"] == made.estimators["adaptation"]
    assert plan_of(again).estimating["adaptation"] == plan_of(made).estimating["adaptation"]


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"effects": ()}, "no effects to adapt"),
        ({"memory": 0.0}, "memory = 0"),
        ({"memory": 0.05}, "no longer than an interval"),
        ({"range_factor": 1.0}, "leaves no range"),
        ({"gate": float("nan")}, "gate = nan"),
        ({"least_speed": -1.0}, "least_speed"),
        ({"use": "compensates"}, "use = 'compensates'.*did you mean.*compensate"),
        ({"load": "none"}, "load = 'none'"),
    ],
)
def test_wrong_settings_are_refused_in_a_sentence(
    settings: dict[str, object], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        Adaptation(**{"effects": FRICTION, **settings})  # type: ignore[arg-type]


def test_a_model_that_lacks_what_it_reads_is_refused_in_a_sentence(fitted: Model) -> None:
    bare = replace(fitted, estimators={})
    cases = {
        "needs the estimator observer": (bare, Adaptation(FRICTION)),
        "no effect 'coulomb'.*did you mean": (fitted, Adaptation(("coulomb",))),
        "inertia is the observer's own": (fitted, Adaptation(("inertia",))),
        "the load sensor needs": (fitted, Adaptation(FRICTION, load="sensor")),
    }
    for sentence, (model, made) in cases.items():
        with pytest.raises(InputError, match=sentence):
            model.with_estimator(made)
    effects = (effect("coulomb_friction"), effect("presliding_friction"))
    part = Part("motor_torque", effects, np.ones(5))
    joint = Model({"drive": part}, rig.FACTS)
    with pytest.raises(InputError, match="needs the effect inertia"):
        joint.with_estimator(Observer(40.0, "motor_torque"))
    whole = replace(part, effects=(effect("inertia"), *effects), coefficients=np.ones(6))
    joint = Model({"drive": whole}, rig.FACTS).with_estimator(Observer(40.0, "motor_torque"))
    with pytest.raises(InputError, match="presliding_friction has a memory"):
        joint.with_estimator(Adaptation(("presliding_friction",), noise=1.0))
    with pytest.raises(InputError, match="no fit recorded; give noise in Nm"):
        joint.with_estimator(Adaptation(("coulomb_friction",)))
    ripple = effect("output_ripple", orders=[1, 2, 3, 4, 5])
    wide = replace(part, effects=(effect("inertia"), ripple), coefficients=np.ones(11))
    joint = Model({"drive": wide}, rig.FACTS).with_estimator(Observer(40.0, "motor_torque"))
    with pytest.raises(InputError, match="have 10 coefficients together"):
        joint.with_estimator(Adaptation(("output_ripple",), noise=1.0))


def test_a_log_without_its_channels_says_so_and_learns_nothing(fitted: Model) -> None:
    log, _ = rig.log(30.0, 14)
    kept = {name: log[name] for name in log.channels if name != "output_velocity"}
    made = flexspline.estimate(learner(fitted), Log.from_arrays(facts=dict(log.facts), **kept))
    assert any("derived from output_position" in note for note in made.notes)
