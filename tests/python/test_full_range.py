"""The full-range estimate: signs, truth, the choice of the transition, and what is refused."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache

import full_range_logs as rigs
import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.estimation import estimate
from flexspline.estimators import Calibration, Collision, TemperatureCompensation
from flexspline.full_range import FullRange, Transition, train, with_mesh_stiffness
from flexspline.full_range.methods import (
    StructuralDamping,
    choose_transition,
    fit_structural_damping,
    merge_weight,
    signals_of,
)
from flexspline.full_range.torsion_part import only
from flexspline.logs.log import Log
from flexspline.model import Model

QUICK = ("sd", "kalman")


@cache
def trained() -> FullRange:
    logs = [rigs.rig(seed).log for seed in (0, 1)]
    return train(rigs.model(), logs, methods=QUICK, rotor_inertia=rigs.ROTOR_INERTIA)


@cache
def unseen() -> rigs.Rig:
    return rigs.rig(7)


def test_one_push_has_the_same_sign_in_sensor_observer_and_compliance() -> None:
    rig, found = unseen(), trained().estimates(unseen().log)
    moving = np.abs(rig.log["output_velocity"]) > 0.1
    pushed = np.abs(rig.external) > 2.0
    for name, rows in (("o", moving), ("c", pushed), ("m", pushed), ("sd", pushed), ("co", pushed)):
        assert np.all(found[name][rows] * rig.external[rows] > 0.0), name


def test_without_physics_unknown_the_mesh_s_torsion_errs_by_the_encoders_alone() -> None:
    rig = rigs.rig(3, extra=False)
    found = signals_of(rigs.model(), rig.log, trained().settings)
    gear = rigs.GEAR
    truth = -np.arctan(gear.mesh_shape * rig.mesh_torque) / (gear.mesh_shape * gear.mesh_stiffness)
    # half a step of either encoder; the motor's torque of 1 mNm twists the model's wave generator
    quantum = np.pi / 2**14 / rigs.RATIO + np.pi / 2**19
    motor = np.abs(rig.log["motor_torque"]) / gear.wave_generator_stiffness / rigs.RATIO
    # the rig's kinematic error turns with the motor's side alone: off by twice the torsion
    turned = 2 * 2 * np.abs(truth).max() * max(rigs.ERROR.values()) / rigs.RATIO
    assert np.all(np.abs(found.mesh_torsion - truth) <= quantum + motor + turned)


def test_without_physics_unknown_the_observer_in_motion_follows_the_truth() -> None:
    rig = rigs.rig(3, extra=False)
    error = trained().estimates(rig.log)["o"] - rig.external
    moving = np.abs(rig.log["output_velocity"]) > 0.1
    late = np.max(np.abs(np.gradient(rig.external, rig.log["time"]))) / 80.0  # slope over the gain
    assert np.sqrt(np.mean(error[moving] ** 2)) < late
    assert abs(np.mean(error[moving])) < 0.2


def test_merged_beats_either_alone_on_a_run_never_seen() -> None:
    table = trained().table(unseen().log)
    assert table["m"]["full"].rmse < table["o"]["full"].rmse
    assert table["m"]["full"].rmse < table["c"]["full"].rmse * 1.02
    weak = train(rigs.model(stiffness=15548.0), [rigs.rig(0).log], methods=()).table(unseen().log)
    assert weak["m"]["full"].rmse < 0.7 * min(weak["o"]["full"].rmse, weak["c"]["full"].rmse)


def test_a_trained_model_still_reads_volts_as_the_model_that_it_was_trained_from() -> None:
    """Calibration and compensation were dropped: of a log of volts every estimate was empty."""
    calibration = Calibration(40.0, 1.5)
    sensing = rigs.model().with_estimator(calibration).with_estimator(
        TemperatureCompensation((0.0, 0.02), reference_temperature=25.0)
    )  # fmt: skip
    detector = Collision("sensor", (), (3.0,), (3.0,))
    made = train(sensing.with_estimator(detector), [rigs.rig(0).log], methods=())
    assert not any("is left out" in said for said in made.warnings)
    log = rigs.rig(1).log
    volts = log.with_columns(
        {
            "sensor_voltage": (log["reference_torque"] - 1.5) / 40.0,
            "temperature": np.full(len(log), 30.0),
        },
        note="of the test",
    )
    found, before = estimate(made.model, volts), estimate(sensing, volts)
    assert np.isfinite(found["sensor_torque"]).all() and "contact" in found
    assert np.array_equal(found["sensor_torque"], before["sensor_torque"])
    assert np.isfinite(found["external_torque_merged"]).any()


def test_a_detector_of_a_torque_that_training_replaces_is_left_out_and_that_is_said() -> None:
    watching = trained().model.with_estimator(Collision("merged", (), (3.0,), (3.0,)))
    made = train(watching, [rigs.rig(0).log], methods=())
    assert "collision" not in made.model.estimators
    assert any("the estimator collision of the model is left out" in s for s in made.warnings)


def test_the_observer_is_blind_at_rest_and_the_compliance_worst_in_motion() -> None:
    table = trained().table(unseen().log)
    assert table["o"]["no motion"].rmse > 2.0 * table["c"]["no motion"].rmse
    assert table["c"]["motion"].rmse > table["c"]["no motion"].rmse


def test_the_compliant_gear_inside_the_observer_takes_the_link_s_inertia_off() -> None:
    table = trained().table(unseen().log)
    assert table["co"]["motion"].rmse < 0.8 * table["c"]["motion"].rmse
    assert table["o2"]["motion"].rmse < 1.1 * table["o"]["motion"].rmse


def test_the_estimates_are_those_of_the_production_chain_bit_for_bit() -> None:
    log = unseen().log
    chain, found = estimate(trained().model, log), trained().estimates(log)
    for name, column in (("o", "observer"), ("c", "compliance"), ("m", "merged")):
        np.testing.assert_array_equal(found[name], chain[f"external_torque_{column}"])


def test_the_trained_model_survives_its_file() -> None:
    loaded = Model.from_json(trained().model.to_json())
    log = unseen().log.rows(slice(0, 2000))
    one, other = (estimate(m, log)["external_torque_merged"] for m in (trained().model, loaded))
    np.testing.assert_array_equal(one, other)


def test_past_the_pole_the_torque_is_held_flagged_and_of_the_right_sign() -> None:
    log = unseen().log
    motor = np.array(log["motor_position"])
    motor[3000:3100] += 0.3  # a step of the motor's encoder, 3 mrad at the output: outward
    motor[5000:5100] -= 0.3
    broken = log.with_columns({"motor_position": motor}, note="steps")
    found, held = trained().estimates(broken), trained().saturated(broken)["c"]
    assert all(np.isfinite(torque).all() for torque in found.values())
    assert held[3000:3100].all() and held[5000:5100].all() and not held[:2900].any()
    assert (found["c"][3000:3100] > 0.0).all() and (found["c"][5000:5100] < 0.0).all()
    longest = np.tan(0.95 * np.pi / 2) / rigs.GEAR.mesh_shape
    np.testing.assert_allclose(np.abs(found["c"][3000:3100]), longest, rtol=1e-12)


def test_a_weight_at_rest_shuts_the_observer_out_and_its_lack_is_warned_of() -> None:
    logs = [rigs.rig(seed).log for seed in (0, 1)]
    shut = train(rigs.model(), logs, methods=(), weight_at_rest=0.02)
    assert shut.transition.weight_at_rest <= 0.02 + 1e-12
    assert shut.transition.mean_at_rest <= 0.02
    assert not any("λ(0)" in sentence for sentence in shut.warnings)
    free = trained()
    assert free.transition.weight_at_rest > 0.05
    assert any(s.startswith("m: λ(0) = ") for s in free.warnings)
    assert "Warning: m: λ(0)" in str(free).replace("\n  ", " ")


def test_a_weight_at_rest_holds_with_the_noise_of_the_velocity_and_not_at_zero_alone() -> None:
    """λ(0) = 0.05 was met by a step within the noise: behind it a quarter was the observer's."""
    rng = np.random.default_rng(3)
    still = np.arange(40_000) % 2 == 0
    velocity = np.where(still, rng.normal(0.0, 2e-4, 40_000), rng.uniform(0.002, 0.5, 40_000))
    blind = np.where(still, 0.4, 0.1)  # the observer is somewhat worse at rest, better in motion
    errors = [rng.normal(0.0, size) for size in (blind, np.full(40_000, 0.35))]
    blocks = np.arange(40_000) // 1000
    found = choose_transition(velocity, *errors, blocks, weight_at_rest=0.05, at_rest=still, seed=1)
    weight = merge_weight(np.abs(velocity[still]), found.alpha, found.transition_velocity)
    assert weight.mean() <= 0.05
    assert found.mean_at_rest == pytest.approx(weight.mean())
    assert found.weight_at_rest <= 0.05 and found.warning is None
    moving = np.abs(velocity[~still])
    assert merge_weight(moving, found.alpha, found.transition_velocity).mean() > 0.95


def test_noise_that_lets_the_observer_in_at_rest_is_warned_of_where_zero_speed_would_not() -> None:
    nothing = (0.0, 0.0)
    noisy = Transition(9870.0, 3e-4, nothing, nothing, 0.0, 0.0, 0.0, mean_at_rest=0.255)
    quiet = replace(noisy, transition_velocity=4e-4)
    assert quiet.weight_at_rest < 0.05
    assert quiet.warning is not None
    assert quiet.warning.startswith("with the noise of the velocity, λ at rest = 0.255")
    assert replace(quiet, mean_at_rest=0.04).warning is None


def test_the_paper_s_first_merge_leaves_38_percent_of_the_observer_at_rest() -> None:
    nothing = (0.0, 0.0)
    paper = Transition(500.0, 0.001, nothing, nothing, 0.0, 0.0, 0.0)
    assert paper.weight_at_rest == pytest.approx(0.378, abs=5e-4)
    assert paper.warning is not None


def test_a_sharp_change_of_the_better_estimate_is_found_within_its_interval() -> None:
    rng = np.random.default_rng(1)
    velocity = rng.uniform(-1.0, 1.0, 20000)
    slow = np.abs(velocity) < 0.3
    observer = rng.normal(0.0, np.where(slow, 2.0, 0.5))
    compliance = rng.normal(0.0, np.where(slow, 0.5, 2.0))
    found = choose_transition(velocity, observer, compliance, np.arange(20000) // 500)
    low, high = found.velocity_interval
    assert low <= 0.3 + 0.01 and high >= 0.3 - 0.01
    assert found.transition_velocity == pytest.approx(0.3, abs=0.02)
    # the better one alone has 0.5 Nm, the best mixture √(ab/(a+b)) = 0.485 Nm; 20000 rows know
    # a standard deviation to 1/200
    assert 0.485 * (1 - 3 / 200) < found.rmse < 0.5 * (1 + 3 / 200)


def test_a_table_splits_its_errors_into_bias_and_variance_and_says_what_moves() -> None:
    table = trained().table(unseen().log)
    for method in table.methods:
        score = table[method]["full"]
        assert score.rmse**2 == pytest.approx(score.variance + score.bias**2)
    velocity = np.abs(unseen().log["output_velocity"])
    assert table.motion_share == pytest.approx(np.mean(velocity >= table.motion_speed))
    assert table.rule in str(table) and table.to_frame().shape == (len(table.methods), 9)
    assert table.rule.split(";")[0][:20] in table._repr_html_()
    with pytest.raises(InputError, match="no method 'x'"):
        table["x"]


def test_of_several_torsion_parts_the_best_when_merged_is_kept() -> None:
    model = rigs.model()
    good = model.part("torsion")
    parts = {"1": with_mesh_stiffness(good, 15548.0, rigs.RATIO), "2": good}
    made = train(model, [rigs.rig(0).log], torsion_parts=parts, methods=())
    assert made.kept == "2" and made.model.part("torsion") is good
    assert {"c1", "c2", "m1", "m2"} < set(made.training.methods)
    assert made.training["c1"]["no motion"].rmse > made.training["c2"]["no motion"].rmse


def test_the_wave_generator_is_silent_while_the_motor_is() -> None:
    assert trained().wave_generator_share < 0.01
    assert "all but silent" in str(trained())


def test_a_torsion_model_without_the_wave_generator_says_so_and_nothing_of_the_motor() -> None:
    model = rigs.model()
    mesh = only(model.part("torsion"), "mesh_compliance")
    made = train(model, [rigs.rig(0).log], torsion_parts={"1": mesh}, methods=())
    said = " ".join(str(made).split())
    assert made.wave_generator_share == 0.0 and "silent" not in said
    assert "the torsion model has no wave_generator_compliance" in said


def test_structural_damping_finds_what_made_its_torque() -> None:
    time = np.arange(5000) / 250.0
    torsion = 1e-3 * np.sin(2.0 * time) + 4e-4 * np.sin(11.0 * time)
    truth = StructuralDamping(9000.0, 0.6, 0.4)
    found = fit_structural_damping([(time, torsion, truth.torque(time, torsion))])
    assert found.damping == pytest.approx(9000.0, rel=1e-3)
    assert found.time_constant == pytest.approx(0.6, rel=1e-3)
    assert found.initial_torque == pytest.approx(0.4, rel=1e-3)
    with pytest.raises(InputError, match="does not rise with the torque"):
        fit_structural_damping([(time, torsion, 9000.0 * torsion)])


def test_a_gaussian_process_learns_the_paper_s_inputs() -> None:
    made = train(rigs.model(), [rigs.rig(0).log], methods=("gp",), gp_rows=300)
    assert made.process is not None and made.process.rows == 300
    spread = float(np.std(rigs.rig(0).external))
    assert made.training["gp"]["full"].rmse < 0.7 * spread
    assert "300 of 12000 training rows" in str(made)


def test_without_scikit_learn_gp_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.gaussian_process", None)
    with pytest.raises(InputError, match=r"install flexspline\[baselines\] or leave 'gp' out"):
        train(rigs.model(), [rigs.rig(0).log], methods=("gp",))


def test_a_gap_in_the_log_starts_the_observer_again() -> None:
    log = unseen().log
    keep = np.ones(len(log), dtype=bool)
    keep[4000:6000] = False
    cut = log.rows(keep)
    chain, found = estimate(trained().model, cut), trained().estimates(cut)
    np.testing.assert_array_equal(found["o"], chain["external_torque_observer"])


def test_a_velocity_that_is_missing_is_made_as_on_the_device() -> None:
    log = unseen().log
    bare = Log({k: v for k, v in log.columns.items() if "velocity" not in k}, log.facts)
    chain, found = estimate(trained().model, bare), trained().estimates(bare)
    begun = bare["time"] - bare["time"][0] > 0.5  # s, in which either start is forgotten
    np.testing.assert_array_equal(found["m"][begun], chain["external_torque_merged"][begun])
    assert np.isnan(chain["external_torque_merged"][0])  # a device says nothing of its start


def test_what_training_cannot_work_with_is_one_sentence() -> None:
    model, log = rigs.model(), rigs.rig(0).log
    speed = np.abs(log["output_velocity"])
    slow, fast = log.rows(speed < 0.008), log.rows(speed > 0.05)
    without = Log({k: v for k, v in log.columns.items() if k != "reference_torque"}, log.facts)
    cases = [
        ([], {}, "there is no training log"),
        (slow, {}, "hold no motion"),
        (fast, {}, "hold no standstill"),
        (without, {}, "no channel 'reference_torque'; training needs the true torque"),
        (log, {"methods": ("sk",)}, "no method 'sk'"),
        (log, {"torsion_parts": {}}, "torsion_parts is empty"),
        (log, {"torsion_parts": {"o": model.part("torsion")}}, "'o' is no number"),
        (log, {"weight_at_rest": 1.5}, "is no share"),
        (log, {"motion_speed": -1.0}, "give a speed above zero"),
        (log, {"rotor_inertia": 1.0}, "link and rotor together"),
        (log, {"margin": 1.0}, "margin = 1 leaves no torque"),
    ]
    for logs, options, said in cases:
        with pytest.raises(InputError, match=said):
            train(model, logs, **{"methods": (), **options})  # type: ignore[arg-type]


def test_a_model_without_drive_or_torsion_is_told_what_to_fit() -> None:
    model, log = rigs.model(), rigs.rig(0).log
    for missing, said in (("drive", "part for motor_torque"), ("torsion", "torsion")):
        parts = {name: part for name, part in model.parts.items() if name != missing}
        with pytest.raises(InputError, match=said):
            train(replace(model, parts=parts), log, methods=())
