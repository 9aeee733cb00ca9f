"""The gear in the chain: hysteresis by the load, the link's observer, load of a blind joint."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import full_range_logs as rigs
import numpy as np
import pytest
from chain_rig import (
    BY_GEAR,
    BY_MOTOR,
    DRIVE,
    FACTS,
    MERGE,
    RATIO,
    TORSION,
    blind_joint,
    raw_log,
    with_hysteresis,
)
from numpy.typing import NDArray

import flexspline
from flexspline import Compliance, InputError, Merge, Observer, effect
from flexspline.estimation import Status
from flexspline.estimation.plan import plan_of
from flexspline.full_range import train
from flexspline.full_range.methods import signals_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.simulation import Encoder, Friction, Gear, Joint, Motor, Output, Servo, SlipElement

Array = NDArray[np.float64]

LOAD = "reference_torque"
SLIPS = ((0.6, 50e-6), (0.7, 150e-6), (0.7, 300e-6))  # Nm, rad: 2 Nm of hysteresis, some 1.5 arcmin
WIDTH = 10.0  # Nm; the load turns over more than twice that
ZERO = Part("sensor_torque", (effect("offset"),), np.zeros(1))  # a sensor without error


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


# Hysteresis on the path of the load


@cache
def hysteretic(seed: int) -> Log:
    """A simulated gear whose mesh slips inside, under 21 Nm; the torque through it beside."""
    time = np.arange(20_000) / 500.0
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 3)
    swings = zip((12.0, 6.0, 3.0), (0.21, 0.57, 1.3), phases, strict=True)
    load = np.sum([a * np.sin(2 * np.pi * f * time + p) for a, f, p in swings], axis=0)
    slips = [SlipElement(level / reach, level) for level, reach in SLIPS]
    made = Joint(
        Gear(mesh_stiffness=26431.0, mesh_shape=0.0487, hysteresis=slips, damping=5.0),
        Motor(inertia=1e-4, friction=Friction(viscous=1e-3)),
        Output(inertia=0.5),
    ).simulate(
        time,
        servo=Servo(rate=1000.0, position_gain=20.0, velocity_gain=0.05),
        position_command=0.3 * np.sin(2 * np.pi * 0.1 * time),
        load_torque=load,
    )
    log = made.log(output_encoder=Encoder(20), motor_encoder=Encoder(15))
    return log.with_columns({LOAD: np.array(made["transmitted_torque"])}, note="at the mesh")


def fitted(*more: str) -> Part:
    fixed = {"load_width": WIDTH} if more else None
    effects = ["offset", "mesh_compliance", *more]
    return flexspline.fit(effects, hysteretic(0), "torsion", known_load=LOAD, fixed=fixed).part


def error_of(part: Part) -> Array:
    """Error of the compliance on a run that the fit has not seen, once the springs have settled."""
    model = Model({"torsion": part}, FACTS).with_estimator(Compliance())
    log = hysteretic(1)
    return (flexspline.estimate(model, log)["external_torque_compliance"] - log[LOAD])[1000:]


def test_a_loop_taken_off_leaves_a_sixth_of_the_error_of_one_left_in() -> None:
    whole = fitted("torsional_hysteresis")
    left_in = replace(whole, effects=whole.effects[:2], coefficients=whole.coefficients[:2])
    taken, left, without = (
        rms(error_of(part)) for part in (whole, left_in, fitted())
    )  # 0.21, 1.50, 1.14 Nm
    assert taken < left / 6.0 and taken < without / 4.5


def solved(torsion: Array, part: Part) -> Array:
    """The torque of each row by forty rounds of torque and loop: an oracle of its own."""
    stiffness, width = RATIO / part.coefficients[1], WIDTH / 2.0 ** np.arange(4)
    shape, heights = part.effects[1].shapes["mesh_shape"], part.coefficients[2:] / RATIO
    springs, last, found = np.zeros(4), None, np.zeros(len(torsion))
    for row, twist in enumerate(torsion):
        torque = found[row - 1]
        for _ in range(40):
            z = np.zeros(4) if last is None else np.clip(springs + torque - last, -width, width)
            torque = -np.tan(shape * stiffness * (twist - heights @ (z / width))) / shape
        springs, last, found[row] = z, torque, torque
    return found


def test_one_correction_is_as_good_as_solving_for_torque_and_loop() -> None:
    part, log = fitted("torsional_hysteresis"), hysteretic(1).rows(slice(0, 6000))
    model = Model({"torsion": part}, FACTS).with_estimator(Compliance())
    made = flexspline.estimate(model, log)["external_torque_compliance"]
    measured = RATIO * log["output_position"] - log["motor_position"] - part.coefficients[0]
    best = solved(measured / RATIO, part)
    error, least = rms(made - log[LOAD]), rms(best - log[LOAD])
    assert 0.0 < rms(made - best) < 0.1 * least and error < 1.02 * least


def test_the_loop_of_the_load_is_taken_off_the_same_with_and_without_a_sensor() -> None:
    log = raw_log(1500)
    blind = blind_joint(Compliance())
    seeing = Model({**blind.parts, "sensor": ZERO}, FACTS, blind.estimators)
    one, other = (flexspline.estimate(m, log) for m in (blind, seeing))
    assert "external_torque_sensor" in other and "external_torque_sensor" not in one
    np.testing.assert_array_equal(
        one["external_torque_compliance"], other["external_torque_compliance"]
    )


def broken(log: Log) -> Log:
    """The log with readings missing, an encoder step past the pole, and a gap."""
    motor = np.array(log["motor_position"])
    motor[[0, 300, 301, 900]] = np.nan
    motor[1200:1210] += 0.5
    holed = log.with_columns({"motor_position": motor}, note="broken")
    return holed.rows(np.r_[0:2000, 2300 : len(log)], note="a gap")


@cache
def rigid_link() -> Model:
    """The hand-driven joint with a loop on the path of the load and friction that grows with it."""
    made = rigs.model()
    drive = made.part("motor_torque")
    friction = effect("load_dependent_friction", direction_width=rigs.WIDTH)
    drive = replace(
        drive, effects=(*drive.effects, friction), coefficients=np.append(drive.coefficients, 0.05)
    )
    torsion = with_hysteresis(made.part("torsion"))
    return replace(made, parts={"drive": drive, "torsion": torsion})


def test_full_range_and_the_chain_agree_bit_for_bit_on_a_gear_that_remembers() -> None:
    logs = [rigs.rig(seed).log for seed in (0, 1)]
    options = {"methods": (), "rotor_inertia": rigs.ROTOR_INERTIA}
    plain = train(rigid_link(), logs, **options)
    made = train(rigid_link(), logs, at_rest="compliant_observer", **options)
    for log in (rigs.rig(7).log, broken(rigs.rig(7).log)):
        found, chain = made.estimates(log), flexspline.estimate(made.model, log)
        names = {"o": "observer", "c": "compliance", "co": "compliant_observer", "mco": "merged"}
        for name, column in names.items():
            made_here = chain[f"external_torque_{column}"]
            good = np.isfinite(made_here)
            assert np.count_nonzero(good) > 0.9 * len(log)
            np.testing.assert_array_equal(found[name][good], made_here[good], err_msg=name)
        other = flexspline.estimate(plain.model, log)["external_torque_merged"]
        good = np.isfinite(other)
        np.testing.assert_array_equal(found["m"][good], other[good])
    assert made.merged == "mco" and plain.merged == "m" and "mco has" in str(made)
    assert made.transition is made.transitions["mco"]


def test_the_mesh_s_torsion_of_full_range_has_no_loop_in_it() -> None:
    model, log, settings = rigid_link(), rigs.rig(7).log, train_settings()
    found = signals_of(model, log, settings)
    stiffness, shape = rigs.GEAR.mesh_stiffness, rigs.GEAR.mesh_shape
    torque = -np.tan(shape * stiffness * found.mesh_torsion) / shape
    np.testing.assert_allclose(torque, found.compliance, rtol=0, atol=1e-9)


def train_settings():
    return train(rigs.model(), [rigs.rig(0).log], methods=()).settings


def test_a_word_for_rest_that_is_none_is_refused_before_training() -> None:
    with pytest.raises(InputError, match="at_rest = 'co' is unknown"):
        train(rigs.model(), [rigs.rig(0).log], methods=(), at_rest="co")


# The observer of the link


def test_the_link_s_observer_finds_a_push_that_inertia_hides_from_the_compliance() -> None:
    rig = rigs.rig(7, extra=False)
    link = Observer(80.0, "compliance", rotor_inertia=rigs.ROTOR_INERTIA)
    model = rigs.model().with_estimator(Compliance()).with_estimator(link)
    made = flexspline.estimate(model, rig.log)
    moving = np.abs(rig.log["output_velocity"]) > 0.1
    by_gear, alone = (
        rms((made[f"external_torque_{name}"] - rig.external)[moving])
        for name in ("compliant_observer", "compliance")
    )
    assert by_gear < 0.8 * alone
    assert "external_torque_observer" not in made  # no motor torque is needed


def test_a_rotor_that_outweighs_link_and_rotor_is_refused() -> None:
    link = Observer(80.0, "compliance", rotor_inertia=1.0)
    model = blind_joint(Compliance(), link)
    with pytest.raises(InputError, match="link and rotor together; give"):
        flexspline.estimate(model, raw_log(500))


def test_a_joint_with_a_sensor_alone_takes_the_link_s_inertia_from_it() -> None:
    sensor = Part("sensor_torque", (effect("inertia"),), np.array([0.4]))
    parts = {"sensor": sensor, "torsion": TORSION}
    model = Model(parts, FACTS).with_estimator(Compliance()).with_estimator(BY_GEAR)
    assert plan_of(model).link_inertia == 0.4 - RATIO**2 * BY_GEAR.rotor_inertia


def test_a_row_without_velocity_has_no_observer_of_the_link_and_says_so() -> None:
    log = raw_log(800)
    velocity = log["output_velocity"].copy()
    velocity[[100, 500]] = np.nan
    made = flexspline.estimate(
        blind_joint(Compliance(), BY_GEAR), log.with_columns({"output_velocity": velocity}, note="")
    )
    assert np.flatnonzero(made.flagged(Status.NO_COMPLIANT_OBSERVER)).tolist() == [100, 500]
    assert "no torque from the observer of the link" in str(made)


def test_an_euler_gain_of_the_link_that_cannot_hold_is_refused() -> None:
    model = blind_joint(Compliance(), Observer(1000.0, "compliance", "euler"))
    with pytest.raises(InputError, match="compliant observer's gain of 1000 1/s by euler"):
        flexspline.estimate(model, raw_log(500))


# Load-dependent friction in a joint without a sensor


def test_friction_that_grows_with_the_load_is_found_without_a_sensor() -> None:
    log = raw_log()
    parts = {"drive": DRIVE, "torsion": TORSION}
    bare = Model(parts, FACTS).with_estimator(BY_MOTOR)
    helped = bare.with_estimator(Compliance())
    truth = log[LOAD]
    deaf, hearing = (flexspline.estimate(model, log) for model in (bare, helped))
    # the observer's own delay, with a model that has all of the friction
    late = np.max(np.abs(np.gradient(truth, log["time"]))) / BY_MOTOR.gain
    errors = [(made["external_torque_observer"] - truth)[500:] for made in (deaf, hearing)]
    sensed = log.with_columns({"sensor_torque": truth}, note="a sensor without error")
    told = flexspline.estimate(Model({**parts, "sensor": ZERO}, FACTS, bare.estimators), sensed)
    whole = (told["external_torque_observer"] - truth)[500:]
    # and the friction under the inertia, which the observer's part leaves out of the load
    carried = DRIVE.coefficients[0] * np.max(np.abs(log["output_acceleration"]))
    assert np.max(np.abs(whole)) <= late + DRIVE.coefficients[4] * carried
    # one row late, 2 ms: at most the friction's share of what the load moves in it
    shares = DRIVE.coefficients[4] * late * BY_MOTOR.gain * 2e-3
    assert np.max(np.abs(errors[1] - whole)) <= shares + 1e-9
    assert np.max(np.abs(errors[0] - whole)) > 20 * shares
    assert any("take it as zero: no sensor" in note for note in deaf.notes)
    assert any("the compliance's of the row before" in note for note in hearing.notes)


def test_the_load_of_a_blind_joint_is_the_last_one_known_and_zero_before() -> None:
    log = raw_log(1000)
    motor = np.array(log["motor_position"])
    motor[:50] = np.nan
    motor[400:450] = np.nan
    motor[600:610] += 0.5  # held at the pole
    model = blind_joint(BY_MOTOR, Compliance(), MERGE)
    made = flexspline.estimate(model, log.with_columns({"motor_position": motor}, note="holes"))
    assert np.isfinite(made["external_torque_observer"]).all()
    assert made.flagged(Status.SATURATED)[600:610].all()
    load = made["external_torque_compliance"].copy()
    load[600:610] = np.nan
    known = np.concatenate([[0.0], load[:-1]])
    for row in range(1, len(known)):
        known[row] = known[row] if np.isfinite(known[row]) else known[row - 1]
    assert not known[:51].any() and known[425] == load[399] and known[605] == load[599]
    told = Model({"drive": DRIVE, "sensor": ZERO}, FACTS).with_estimator(BY_MOTOR)
    same = flexspline.estimate(told, log.with_columns({"sensor_torque": known}, note="told"))
    np.testing.assert_array_equal(
        made["external_torque_observer"], same["external_torque_observer"]
    )


# A torsion's part made by hand


def test_a_torsion_part_without_a_record_reads_the_motor_s_encoder() -> None:
    log = raw_log(500)
    recorded = replace(TORSION, record={"channels": ["motor_position"]})
    by_hand = replace(TORSION, record={})
    one, other = (
        flexspline.estimate(Model({"torsion": part}, FACTS).with_estimator(Compliance()), log)
        for part in (recorded, by_hand)
    )
    np.testing.assert_array_equal(
        one["external_torque_compliance"], other["external_torque_compliance"]
    )


def test_a_merge_at_rest_by_the_link_needs_no_other_field() -> None:
    merge = Merge(500.0, 0.01, at_rest="compliant_observer")
    made = flexspline.estimate(blind_joint(BY_MOTOR, Compliance(), BY_GEAR, merge), raw_log(500))
    weight = flexspline._core.merge_weight(
        raw_log(500)["output_velocity"], alpha=500.0, transition_velocity=0.01
    )
    still, moving = made["external_torque_compliant_observer"], made["external_torque_observer"]
    expected = still + weight * (moving - still)
    np.testing.assert_allclose(made["external_torque_merged"], expected, atol=1e-12)


# A zero that moved


@cache
def fitted_by_hand() -> Model:
    """Drive and torsion fitted to a joint driven by hand, with observer and compliance."""
    log, known = rigs.rig(0, pushes=16).log, {"known_load": LOAD}
    friction = ("inertia", "coulomb_friction", "viscous_friction")
    drive = flexspline.fit(friction, log, "motor_torque", **known).model
    error = effect("kinematic_error", orders=tuple(rigs.ERROR))
    gear = flexspline.fit(
        ["offset", "mesh_compliance", error], log, "torsion", into=drive, **known
    ).model
    return gear.with_estimator(Observer(40.0, "motor_torque")).with_estimator(Compliance())


def said_of_zero(zero: float, seed: int, *more: str) -> list[str]:
    """What is doubted of a run whose motor encoder has this zero, rad of the motor."""
    log = rigs.rig(seed, pushes=16).log
    columns = {"motor_position": log["motor_position"] + zero}
    moved = log.with_columns(columns, note="a zero").without({*more}, ())
    return [d for d in flexspline.estimate(fitted_by_hand(), moved).doubts if "zero" in d]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("zero", [-0.01, 0.01, 0.02])
def test_an_encoder_whose_zero_moved_since_the_fit_is_doubted_with_its_torque(
    seed: int, zero: float
) -> None:
    (said,) = said_of_zero(zero, seed)
    torque = float(said.partition("compliance is ")[2].partition(" Nm")[0])
    assert torque == pytest.approx(zero / 0.01 * 3.3, rel=0.2)  # of a gear that stiffens
    moved = float(said.partition("moved by ")[2].partition(" rad")[0])
    assert moved == pytest.approx(abs(zero), abs=0.0015)
    assert "in either direction" in said


def test_a_zero_that_stayed_or_that_the_fit_cannot_tell_is_not_doubted() -> None:
    for seed in range(1, 6):
        assert said_of_zero(0.0, seed) == []
        assert said_of_zero(0.001, seed) == []  # 0.3 Nm, of the 1.3 Nm that the fits miss
