"""Every effect of a drive runs forward as it is fitted, and so does what other code simulated."""

from __future__ import annotations

import numpy as np
import pytest
from forward_runs import FACTS, RATIO, Given, drive, driven, run_of
from numpy.typing import NDArray

import flexspline
from flexspline import _core
from flexspline.effects import CATALOGUE, effect
from flexspline.errors import InputError
from flexspline.forward import drive_inputs
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.signals import core_channels, gear_of
from flexspline.simulation import Friction, Gear, Joint, Motor, Output, Servo

Array = NDArray[np.float64]

SHARP = 1e-4  # rad/s: the narrowest direction that a model may have
BASE: Given = [
    ("inertia", [0.5]),
    ("viscous_friction", [3.0]),
    (effect("coulomb_friction", direction_width=SHARP), [1.5]),
]
SIZES = {
    "offset": [0.7],
    "coulomb_friction_per_direction": [1.2, -0.8],
    "direction_dependent_friction": [0.3, 0.2],
    "nonlinear_viscous_friction": [0.4, 0.1],
    "stribeck_friction": [0.8],
    "presliding_friction": [0.4, 0.3, 0.2, 0.1],
    "load_dependent_friction": [0.15],
    "temperature_dependent_friction": [-0.05, 0.002],
    "position_dependent_friction": [0.2, 0.1, 0.05, 0.1, 0.05, 0.1],
    "gravity": [3.0, 1.0],
    "output_ripple": [0.3, 0.2],
    "wave_generator_ripple": [0.1, 0.2],
    "speed_dependent_ripple": [0.1, 0.2],
    "cogging": [0.1, 0.05],
    "torque_constant_error": [0.1],
    "viscous_friction": [3.0],
    "coulomb_friction": [1.5],
    "inertia": [0.5],
}
LATE = "sensor_lag"  # a delay of the recorder, which drives no joint
OF_DRIVES = sorted(n for n, info in CATALOGUE.items() if "M" in info.targets and n != LATE)


def chosen(name: str) -> tuple[flexspline.Effect, list[float]]:
    info = CATALOGUE[name]
    shapes = (
        {"direction_width": SHARP} if "direction_width" in [s.name for s in info.shapes] else {}
    )
    made = effect(name, orders=[2] if info.pairs else [], **shapes)
    return made, SIZES.get(name, [0.1] * len(made.terms))


def rich(seed: int) -> Log:
    generator = np.random.default_rng(seed)
    time = np.arange(0.0, 12.0, 1e-3)
    torque = np.zeros(len(time))
    for frequency in (0.17, 0.45, 0.9):
        torque += 4.0 * np.sin(2 * np.pi * frequency * time + generator.uniform(0, 6.3))
    return run_of(
        time,
        torque,
        temperature=25.0 + 10.0 * np.sin(0.3 * time),
        reference_torque=2.0 * np.sin(0.8 * time + 1.0),
    )


def settled(log: Log, model: Model) -> NDArray[np.bool_]:
    """Rows that do not depend on what was before the first one."""
    part = model.part()
    design = _core.Design([e.for_core() for e in part.effects], **gear_of(FACTS, False))
    channels = core_channels(log, part.effects, part.known_load)
    return np.asarray(design.settled(channels, len(log), part.coefficients))


@pytest.mark.parametrize("name", OF_DRIVES)
def test_the_torque_that_moved_it_is_what_the_model_predicts_of_the_motion(name: str) -> None:
    """Inverse and forward are one model: rows, coefficients, gear, load and signs alike."""
    model = drive([e for e in BASE if name not in str(e[0])] + [chosen(name)], "reference_torque")
    log = rich(3)
    made = driven(model, log, steps=4)
    moved = log.with_columns(
        {f"output_{k}": made[k] for k in ("position", "velocity", "acceleration")}, note="driven"
    )
    found = model.predict(moved)
    counts = (np.abs(made["velocity"]) > 100 * SHARP) & settled(moved, model)
    assert np.mean(counts) > 0.5
    # a path that turns between rows is longer than they show, there and back by a (1 ms)² / 8 each;
    # springs of 0.4 / 0.01 + 0.3 / 0.005 + 0.2 / 0.0025 + 0.1 / 0.00125 = 260 Nm/rad feel that
    most = float(np.max(np.abs(made["acceleration"])))
    missed = 260.0 * 2.0 * most * 1e-6 / 8.0 if CATALOGUE[name].remembers else 0.0
    assert np.max(np.abs(found.residual[counts])) < 1e-9 + missed


def test_a_joint_that_brakes_more_one_way_runs_and_sticks_as_its_directions_say() -> None:
    """(3 + 0.5) + (2 + 0.25) v forward, (3 - 0.5) + (2 - 0.25) |v| backward; at rest as much."""
    more = effect("direction_dependent_friction", direction_width=SHARP)
    model = drive([
        ("inertia", [0.1]),
        (effect("coulomb_friction", direction_width=SHARP), [3.0]),
        ("viscous_friction", [2.0]),
        (more, [0.5, 0.25]),
    ])  # fmt: skip
    time = np.arange(0.0, 4.0, 1e-3)
    for torque, speed in ((8.0, 4.5 / 2.25), (-6.0, -3.5 / 1.75), (3.4, 0.0), (-2.4, 0.0)):
        made = driven(model, run_of(time, np.full(len(time), torque)), steps=2)
        assert made["velocity"][-1] == pytest.approx(speed, abs=1e-6), torque
    assert driven(model, run_of(time, np.full(len(time), -2.6)))["velocity"][-1] < -0.05


@pytest.mark.parametrize(
    ("target", "load"), [("motor_torque", "reference_torque"), ("motor_current", None)]
)
def test_a_delay_of_the_recorder_is_refused_in_one_sentence(target: str, load: str | None) -> None:
    effects = (effect("inertia"), effect(LATE))
    part = Part(target, effects, np.array([0.5, 0.002]), load)
    model = Model({"drive": part}, FACTS)
    log = rich(3).with_facts({"torque_constant": 0.1})
    log = log.with_columns({"motor_current": log["motor_torque"] / 0.1}, note="simulated")
    for refused in (
        lambda: flexspline.simulate(model, log),
        lambda: flexspline.fit_motion(effects, log, target, known_load=load),
    ):
        with pytest.raises(InputError, match=rf"{LATE} of the {target} part.*repair shift") as said:
            refused()
        assert "\n" not in str(said.value)


def test_presliding_friction_is_elastic_until_it_slips() -> None:
    """Below its level the joint comes to rest on springs, and comes back when let go slowly."""
    width, heights = 0.01, [0.8, 0.6, 0.4, 0.2]
    model = drive([
        ("inertia", [0.5]),
        ("viscous_friction", [5.0]),
        (effect("presliding_friction", presliding_width=width), heights),
    ])  # fmt: skip
    time = np.arange(0.0, 40.0, 1e-3)
    torque = np.interp(time, [0, 10, 20, 30, 40], [0.0, 1.2, -1.2, 1.2, 1.2])
    made = driven(model, run_of(time, torque), steps=4)
    assert np.max(np.abs(made["position"])) < 2 * width
    first, later = made["position"][10_000], made["position"][30_000]
    assert first != pytest.approx(later, abs=1e-6) or first > 0.0
    # a closed loop of torque is a closed loop of angle, once it has been gone round
    again = np.interp(time, [0, 10, 20, 30, 40], [1.2, -1.2, 1.2, -1.2, 1.2])
    loop = driven(model, run_of(time, again), steps=4)["position"]
    assert loop[40_000 - 1] == pytest.approx(loop[20_000], abs=1e-5)
    assert loop[10_000] < loop[20_000] - 1e-4


def test_friction_that_remembers_holds_a_load_from_the_first_row() -> None:
    """What it was before is unknown: it is taken to carry what it can, not to spring into it."""
    model = drive([
        ("inertia", [0.5]),
        ("gravity", [3.0, 0.0]),
        ("viscous_friction", [0.2]),
        (effect("presliding_friction", presliding_width=0.01), [1.0, 0.5, 0.3, 0.2]),
    ])  # fmt: skip
    time = np.arange(0.0, 5.0, 1e-3)
    for angle in (0.0, 0.3, -0.5):
        made = driven(model, run_of(time, np.zeros(len(time))), start=(angle, 0.0), steps=2)
        assert np.max(np.abs(made["position"] - angle)) < 1e-9
    heavy = driven(model, run_of(time, np.zeros(len(time))), start=(1.2, 0.0), steps=2)
    assert heavy["position"][-1] < 1.0  # 3 sin 1.2 > 2: it slides down


@pytest.mark.parametrize("start", [0.0, 0.123])
def test_the_motors_ripple_starts_where_its_encoder_says(start: float) -> None:
    ripple = (effect("cogging", orders=[1]), [0.5, 0.0])
    model = drive([("inertia", [0.5]), ("viscous_friction", [3.0]), ripple])
    time = np.arange(0.0, 2.0, 1e-3)
    plain = run_of(time, 4.0 * np.sin(3.0 * time), output_position=np.full(len(time), start))
    turned = plain.with_columns(
        {"motor_position": np.full(len(time), RATIO * start + 2.0)}, note="encoder"
    )
    made = drive_inputs(model, turned).run(
        model.part(), 2, ("position", "velocity", "acceleration")
    )
    moved = plain.with_columns(
        {
            **{f"output_{k}": made[k] for k in ("position", "velocity", "acceleration")},
            "motor_position": RATIO * made["position"] + 2.0,
        },
        note="driven",
    )
    assert np.max(np.abs(model.predict(moved).residual)) < 1e-8


MEASURED = ("motor_torque", "output_position", "output_velocity", "output_acceleration")
TRUE = {"inertia": 0.9 + 100.0**2 * 4e-5, "coulomb": 2.5, "viscous": 6.0, "gravity": 9.0}


def rig_run(seed: int) -> Log:
    """A rigid joint with an own integrator and own friction, under a servo."""
    joint = Joint(
        Gear(100.0, "flex"),
        Motor(inertia=4e-5),
        Output(inertia=0.9, link_inertia=0.5, gravity=TRUE["gravity"],
               friction=Friction.both_ways(TRUE["coulomb"], viscous=TRUE["viscous"])),
    )  # fmt: skip
    time = np.arange(0.0, 8.0, 2e-3)
    shift = np.random.default_rng(seed).uniform(0, 6.3, 2)
    command = 0.6 * np.sin(1.3 * time + shift[0]) + 0.3 * np.sin(3.1 * time + shift[1])
    servo = Servo(rate=500.0, position_gain=15.0, velocity_gain=0.005, torque_limit=1.0)
    run = joint.simulate(time, servo=servo, position_command=command - command[0])
    log = run.log(name=f"run{seed}", channels=MEASURED)
    return log.with_facts({"gear_ratio": 100.0})


def test_a_joint_of_other_code_is_fitted_and_then_moves_as_it_did() -> None:
    names = ["coulomb_friction", "viscous_friction", "gravity", "inertia"]
    fit = flexspline.fit(names, [rig_run(1), rig_run(2)], target="motor_torque")
    held_out = rig_run(3)
    made = flexspline.simulate(fit.model, held_out, inputs="hold")
    assert made.rmse < 1e-3, made
    assert np.std(made.measured) > 0.2
    values = dict(zip(["coulomb", "viscous", "sine", "cosine", "inertia"],
                      fit.model.part().coefficients, strict=True))  # fmt: skip
    assert values["inertia"] == pytest.approx(TRUE["inertia"], rel=1e-2)


def test_torsion_gives_the_output_from_the_motor() -> None:
    generator = np.random.default_rng(5)
    time = np.arange(0.0, 20.0, 0.005)
    theta = 40.0 * np.sin(0.8 * time)
    load = 8.0 * np.sin(0.5 * time + 1.0) + generator.normal(0, 0.1, len(time))
    effects = (
        effect("mesh_compliance"),
        effect("kinematic_error", orders=[(2, "output_on_housing"), (1, "motor_on_stator")]),
        effect("torsional_hysteresis", load_width=3.0),
    )
    values = np.array([5e-3, 1e-3, 2e-3, 5e-4, 1e-3, 4e-4, 3e-4, 2e-4, 1e-4])
    model = Model({"torsion": Part("torsion", effects, values, "reference_torque")}, FACTS)
    log = Log.from_arrays(
        time=time, motor_position=theta, reference_torque=load,
        output_position=np.zeros(len(time)), facts=FACTS,
    )  # fmt: skip
    made = flexspline.simulate(model, log)
    assert made.channel == "output_position"
    moved = log.with_columns({"output_position": made.simulated}, note="simulated")
    assert np.max(np.abs(model.predict(moved).residual)) < 1e-9
    assert np.max(np.abs(made.simulated - theta / RATIO)) > 1e-4
    assert np.array_equal(made.measured, log["output_position"])
    bare = Log.from_arrays(time=time, motor_position=theta, reference_torque=load)
    unmeasured = flexspline.simulate(model, bare)
    assert np.array_equal(unmeasured.simulated, made.simulated)
    assert np.isnan(unmeasured.measured).all()
    other = log.with_facts({"gear_ratio": 2.0 * FACTS["gear_ratio"]})
    with pytest.raises(InputError, match="they must be of one joint"):
        flexspline.simulate(model, other)


def test_a_sensor_reads_the_load_and_what_it_adds() -> None:
    time = np.arange(0.0, 10.0, 0.005)
    load = 8.0 * np.sin(0.9 * time)
    effects = (effect("offset"), effect("torque_hysteresis"), effect("sensor_lag"))
    values = np.array([0.3, 0.2, 0.1, 0.05, 0.05, 0.01])
    model = Model({"sensor": Part("sensor_torque", effects, values, "reference_torque")}, FACTS)
    log = Log.from_arrays(time=time, reference_torque=load, facts=FACTS)
    made = flexspline.simulate(model, log)
    assert made.channel == "sensor_torque"
    assert np.array_equal(made.simulated, model.predict(log).predicted + load)
    assert np.isnan(made.rmse)
    assert "nothing measured" in str(made)
