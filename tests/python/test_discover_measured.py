"""What the measured logs lack is named as those who know them would name it.

Every log as it was recorded, but for repairs that its own faults ask for. Most are discoveries of
the notebook `missing_effect_measured`, which is run once for them: its sentences of experts say
what is asserted here. What does not come out is not asserted; it stands there.
"""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import notebook_runs
import numpy as np
import pytest
from measured import iiwa, two_encoder, ur10e

import flexspline
from flexspline.discovery.faults import data_faults
from flexspline.discovery.result import Discovery
from flexspline.logs.checks.consistency import measured_gear
from flexspline.logs.checks.ends import at_work, resting
from flexspline.logs.repairs import repaired

MOVES = ["offset", "coulomb_friction", "viscous_friction", "inertia", "gravity"]
MENDED = ["flip_sign=sensor_torque", "velocity_from_position=output_velocity"]
NM_PER_A = 7.6
ALL = ["base_joint", "shoulder", "forearm", "current", "sensor", "presliding", "wrist", "servo",
       "twist"]  # fmt: skip

pytestmark = pytest.mark.usefixtures("data_folder")


Discoveries = dict[str, Discovery]

GIVEN = """
import pickle
made = {{
    name: value
    for name, value in globals().items()
    if isinstance(value, flexspline.Discovery) and not name.startswith("_")
}}
Path({path!r}).write_bytes(pickle.dumps(made))
"""


@pytest.fixture(scope="module")
def made(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Discoveries:
    """The notebook's discoveries by the names that it gives them."""
    folder = tmp_path_factory.mktemp("notebook")
    file = folder / "made"
    notebook_runs.run("missing_effect_measured", folder, GIVEN.format(path=str(file)))
    found: Discoveries = pickle.loads(file.read_bytes())
    return found


@pytest.mark.parametrize("joint", [1, 2, 4])
def test_rest_is_found_at_the_end_of_a_run_and_never_in_a_reversal(joint: int) -> None:
    log = ur10e(joint)
    still = resting(log)
    speed = np.abs(log["output_velocity"])
    assert still[-100:].all()
    assert 0.02 < still.mean() < 0.12
    assert speed[~still].max() == speed.max()
    assert at_work([log], "sensor_torque") is None
    (candidate_model_of,) = at_work([log], "motor_current") or [None]
    np.testing.assert_array_equal(candidate_model_of, ~still)


def test_friction_that_grows_with_its_own_load_is_named_first_in_joint_2(made: Discoveries) -> None:
    shoulder = made["shoulder"]
    assert shoulder.found[0].effect == "load_dependent_friction"
    assert "position_dependent_friction" in shoulder.found[0].indistinguishable_from
    (factor,) = shoulder.parameters("load_dependent_friction")
    assert factor.name == "load_dependent_friction.factor"
    assert factor.unit == "1"  # of a load that the model makes itself, in A


def test_both_readings_of_joint_2s_largest_gap_are_said_and_the_run_that_would_tell(
    made: Discoveries,
) -> None:
    """Gravity is its load, and follows the angle: friction that grows with either is the same."""
    shoulder = made["shoulder"]
    readings = {"load_dependent_friction", "position_dependent_friction"}
    first = shoulder.found[0]
    assert {first.effect, *first.indistinguishable_from} >= readings
    assert first.effect in readings and first.confidence <= 0.5
    assert first.rmse_after < 0.45 * first.rmse_before
    assert shoulder.dependences
    said = str(shoulder.next_experiment)
    assert all(name in said for name in readings)


def test_joint_1_lacks_viscous_friction_that_bends_and_what_builds_up_after_a_reversal(
    made: Discoveries,
) -> None:
    """Stribeck friction that would fade at 1.8 rad/s, beyond the largest speed, is the bend too."""
    base_joint = made["base_joint"]
    assert base_joint.names[0] == "nonlinear_viscous_friction"
    assert "presliding_friction" in base_joint.names[1:]
    told = {*base_joint.names, *base_joint.found[0].indistinguishable_from}
    assert "stribeck_friction" not in told
    assert base_joint.found[0].rmse_after < 0.8 * base_joint.base_rmse
    assert base_joint.final_rmse < 0.7 * base_joint.base_rmse


def require_floor_below_what_is_left(found: Discovery) -> None:
    if found.unexplained is None:
        assert found.noise_floor == found.final_rmse
    else:
        assert found.noise_floor < found.final_rmse
        assert found.gap_closed < 1.0


@pytest.mark.parametrize("name", ALL)
def test_the_floor_is_below_what_is_left_by_what_is_said_to_be_unexplained(
    name: str, made: Discoveries
) -> None:
    require_floor_below_what_is_left(made[name])


@pytest.mark.parametrize("name", ALL)
def test_the_headline_and_the_table_below_it_say_one_error(name: str, made: Discoveries) -> None:
    """A name that remembers leaves out rows that count in the base."""
    found = made[name]
    (whole,) = (part for part in found.slices if part.group == "all")
    assert whole.base == pytest.approx(found.base_rmse, rel=1e-12)
    assert whole.final == pytest.approx(found.final_rmse, rel=1e-12)


@pytest.mark.parametrize("name", ALL)
def test_an_effect_has_one_verdict(name: str, made: Discoveries) -> None:
    """Never an equal of a name and spurious; never withdrawn, and rejected for another reason."""
    found = made[name]
    told = {*found.names, *(equal for one in found.found for equal in one.indistinguishable_from)}
    assert not told & {*found.refused, *found.doubted}
    assert not {*found.refused} & {*found.doubted}


@pytest.mark.parametrize("joint", [1, 2, 4])
def test_so_it_is_in_a_log_as_it_was_recorded(joint: int) -> None:
    require_floor_below_what_is_left(
        flexspline.discover(MOVES, ur10e(joint), target="motor_current")
    )


@pytest.mark.parametrize("name", ["base_joint", "forearm"])
def test_springs_of_presliding_brake_one_and_all(name: str, made: Discoveries) -> None:
    springs = made[name].parameters("presliding_friction")
    values = [p.value for p in springs if p.unit == "A"]
    assert len(values) == 4
    assert min(values) >= 0.0 < max(values)
    (where,) = [one.where for one in made[name].found if one.effect == "presliding_friction"]
    assert where.endswith("both directions, built up anew after each reversal")


@pytest.mark.parametrize("name", ALL)
def test_each_name_lowers_the_error_and_none_stands_beside_more_that_is_unexplained(
    name: str, made: Discoveries
) -> None:
    found = made[name]
    assert found.names
    assert all(one.rmse_after < one.rmse_before for one in found.found)
    assert found.unexplained is None or found.unexplained.share_of_variance <= 0.5


@pytest.mark.parametrize("name", ALL)
def test_a_name_keeps_no_more_beside_a_rival_than_it_has(name: str, made: Discoveries) -> None:
    for one in made[name].found:
        assert one.rivals and all(rival.keeps <= one.t * (1.0 + 1e-9) for rival in one.rivals)
        told = re.findall(r"t = (\d+\.\d)", one.evidence)
        assert told and all(float(t) <= one.t + 0.05 for t in told)


def test_joint_4_lacks_no_friction_of_velocity_or_load(made: Discoveries) -> None:
    wrong = {"load_dependent_friction", "nonlinear_viscous_friction", "stribeck_friction"}
    assert not wrong & set(made["forearm"].names)


def test_the_current_of_the_kinova_lacks_cogging_that_changes_with_speed(made: Discoveries) -> None:
    """The rotor is shaken by both, and the base has no inertia: that is named behind them."""
    current = made["current"]
    assert set(current.names[:2]) == {"cogging", "speed_dependent_ripple"}
    assert current.names[2:] == ("inertia",)
    (inertia,) = current.parameters("inertia")
    assert inertia.value > 8.0 * inertia.standard_error
    # 7 pole pairs: 7, 14, 28, 42; 1200 and 2400 per output turn are 12 and 24 of the motor
    assert {7, 12, 14, 24, 28, 42} <= orders_of(current, "cogging")
    assert current.validated_by == "runs"
    where = next(one.where for one in current.found if one.effect == "cogging")
    assert "of motor on stator (7 is 7 pole pairs × motor; 14 is 2 × 7 pole pairs" in where
    assert NM_PER_A * current.final_rmse <= 0.125


def orders_of(found: Discovery, name: str) -> set[int]:
    (own,) = [e for e in found.fit.part.effects if e.name == name]
    return {order for order, _ in own.harmonics}


def test_the_sensor_of_the_kinova_has_two_four_and_eight_of_its_own_ring(made: Discoveries) -> None:
    sensor = made["sensor"]
    assert {2, 4, 8} <= orders_of(sensor, "output_ripple")
    assert orders_of(sensor, "speed_dependent_ripple") == {2, 7}
    # ten runs, with the two slowest as well, leave 0.056
    assert sensor.final_rmse < 0.058 < 0.1 < sensor.base_rmse


@pytest.mark.parametrize(("joint", "speed"), [(1, "p3"), (2, "p1"), (5, "p1"), (7, "p5")])
def test_a_late_velocity_of_the_iiwa_is_a_fault_before_any_friction(joint: int, speed: str) -> None:
    log = repaired(iiwa(joint, speed), "flip_sign=sensor_torque")
    (late,) = [f for f in data_faults([log], [], "sensor_torque", None)
               if f.name == "velocity_delay"]  # fmt: skip
    assert late.channel == "output_velocity"
    assert 0.031 <= late.size <= 0.076


def at_speeds(joint: int, speeds: str) -> Discovery:
    """Half a minute each of an iiwa's runs: several speeds tell an angle from a delay."""
    runs = [repaired(iiwa(joint, speed), MENDED) for speed in speeds.split()]
    runs = [log.rows(slice(200, 200 + int(30 * log.rate))) for log in runs]
    base = ["offset", "coulomb_friction", "viscous_friction"]
    return flexspline.discover(base, runs, target="sensor_torque", lowpass=10.0)


def test_friction_of_iiwa_joint_1_builds_up_over_an_angle_at_every_speed(made: Discoveries) -> None:
    assert made["presliding"].names[0] == "presliding_friction"
    assert made["presliding"].found[0].rmse_after < 0.14


@pytest.mark.xfail(
    reason="0.135 of 0.256 Nm are left, by `fit` too: a bar of when the base missed 0.67",
    strict=True,
)
def test_it_leaves_less_than_three_tenths_of_what_the_base_misses(made: Discoveries) -> None:
    assert made["presliding"].found[0].rmse_after < 0.3 * made["presliding"].base_rmse


def test_without_gravity_the_iiwas_joint_2_lacks_gravity() -> None:
    found = at_speeds(2, "p2 p4 p6 p8")
    assert found.names[0] == "gravity"
    assert found.final_rmse < 0.3 * found.base_rmse


def test_presliding_of_iiwa_joint_5_and_friction_over_the_angle() -> None:
    """0.0203 Nm before; what `fit` leaves on held-out runs with these names."""
    five = at_speeds(5, "p1 p2 p3 p4 p5 p6 p7 p8 p9")
    assert set(five.names) == {"presliding_friction", "position_dependent_friction"}
    assert five.final_rmse < 0.0185
    # each spring and each order is nearly as large as its error: t is that of the final fit, where
    # the search has 100 and more. It was 9 and 15 under noise that the residual contradicts
    assert [one.t for one in five.found] == pytest.approx([19.0, 23.3], rel=0.05)
    assert all(one.confidence < 0.5 for one in five.found)
    # 1.06 rad show no order of one turn: six orders had told it by 221 - 92 + 17 Nm
    waves = {p.name.split(".")[1]: p for p in five.parameters("position_dependent_friction")}
    assert [n for n, p in waves.items() if p.state == "fixed"] == ["cosine 1", "sine 1"]
    assert max(abs(p.value) for p in waves.values()) < 1.0


def test_presliding_of_iiwa_joint_7(made: Discoveries) -> None:
    """0.110 Nm before."""
    assert made["wrist"].names[0] == "presliding_friction"
    assert made["wrist"].final_rmse < 0.072


@pytest.mark.xfail(
    reason="beside the acceleration that is made now, functions of a flexible basis explain more",
    strict=True,
)
def test_friction_of_the_xl330_grows_with_its_load_first_of_all(made: Discoveries) -> None:
    """All twelve logs, of 1 to 6 s each: fewer do not tell it."""
    servo = made["servo"]
    first = servo.found[0]
    assert first.effect == "load_dependent_friction"
    assert first.rmse_before == pytest.approx(0.0453, abs=5e-4)
    assert first.rmse_after < 0.0405
    (factor,) = servo.parameters(first.effect)
    assert 0.1 < factor.value < 0.5  # of the load
    assert all(one.confidence < 0.5 for one in servo.found[1:])  # and they gain next to nothing
    assert servo.final_rmse > 0.98 * first.rmse_after


def test_two_encoders_show_their_delay_and_ratio_before_their_hysteresis() -> None:
    encoders = two_encoder(1).with_facts({"gear_ratio": 7.3})
    (late,) = data_faults([encoders], [], "torsion", None)
    assert late.name == "encoder_delay"
    assert 0.4e-3 < late.size < 0.7e-3
    gear = measured_gear(encoders)
    assert gear is not None
    aligned = repaired(encoders, f"shift=output_position:{gear.delay}")
    stated_wrongly = aligned.with_facts({"gear_ratio": 7.0})
    found = flexspline.discover(["offset"], stated_wrongly, target="torsion")
    (ratio,) = found.data_faults
    assert ratio.name == "gear_ratio"
    assert ratio.size == pytest.approx(7.296, abs=2e-3)
    assert found.names == ("torsional_hysteresis", "kinematic_error")
    assert found.final_rmse < 0.3 * found.base_rmse
    assert found.model.facts["gear_ratio"] == ratio.size
