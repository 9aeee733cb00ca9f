"""The third paper's rig: what its own models of friction and torsion lack is found and added.

§I: "viscous friction is nonlinearly dependent on the velocity, gear temperature, and teeth wear"
while (21) has a cubic of the velocity alone; "the torsion measurement is affected by kinematic
error", which (15) and (16) have not.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

import flexspline
from flexspline.discovery.result import Discovery
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.rigs import full_range_rig
from flexspline.rigs.full_range import KINEMATIC_ERROR, FullRangeRig
from flexspline.simulation import Noise, Servo, Start

FRICTION = (
    "offset", "coulomb_friction", "viscous_friction", "nonlinear_viscous_friction", "inertia"
)  # fmt: skip
TORSION = ("offset", "mesh_compliance", "wave_generator_compliance")
TEMPERATURES = (24.0, 28.0, 33.0, 38.0)  # °C
LEVELS = (0.05, 0.1, 0.2, 0.4, 0.6, 0.9, 1.2, 1.5)  # rad/s, each both ways
CONSTANT = 0.1  # Nm/A
RIPPLE = {"speed_dependent_ripple", "wave_generator_ripple"}


@cache
def rig() -> FullRangeRig:
    return full_range_rig(1)


@cache
def friction_runs() -> tuple[Log, ...]:
    """Speeds held both ways in another order each day, each day of another temperature."""
    return tuple(_friction_run(day, warm) for day, warm in enumerate(TEMPERATURES))


def _friction_run(day: int, warm: float) -> Log:
    levels = np.random.default_rng([day, 7]).permutation(LEVELS)
    time = np.arange(0.0, 16.0, 1.0 / 500.0)
    held = np.repeat(np.column_stack([levels, -levels]).ravel(), 2)
    knots = np.concatenate([[0.0], *([at + 0.2, at + 1.0] for at in np.arange(16.0))])
    run = rig().joint.simulate(
        time,
        start=Start(0.3 * day, motor_temperature=warm, body_temperature=warm),
        room_temperature=warm - 2.0,
        servo=Servo(500.0, velocity_gain=0.03, integral_gain=0.5, torque_limit=2.0),
        velocity_command=np.interp(time, knots, [0.0, *held]),
        load_torque=0.0,
    )
    log = run.log(
        name=f"{warm:g} °C",
        rate=125.0,
        output_encoder=rig().output_encoder,
        motor_encoder=rig().motor_encoder,
        noise={"motor_torque": Noise(1e-3), "temperature": Noise(0.05, memory=1.0)},
        seed=day,
        channels=["output_position", "motor_position", "motor_torque", "temperature"],
    )
    return differentiate(log, bandwidth=15.0)


@cache
def friction() -> Discovery:
    return flexspline.discover(FRICTION, friction_runs(), target="motor_torque")


@cache
def torsion() -> Discovery:
    logs = [
        rig().turning(speed=speed, turns=0.6).with_facts({"name": f"{speed:g} rad/s"})
        for speed in (0.4, 0.6, 0.5, 0.7)
    ]
    return flexspline.discover(TORSION, logs, target="torsion", known_load="reference_torque")


def test_the_temperature_that_21_lacks_is_the_surest_name() -> None:
    """The kinematic error shakes the rotor: that (21) has not either, and it may close more."""
    made = friction()
    assert (
        {"temperature_dependent_friction"}
        < {*made.names}
        <= {"temperature_dependent_friction", *RIPPLE}
    )
    assert max(made.found, key=lambda one: one.t).effect == "temperature_dependent_friction"
    left = [made.base_rmse, *(one.rmse_after for one in made.found)]
    assert left == sorted(left, reverse=True)


def test_warm_friction_is_less_as_the_rig_has_it() -> None:
    linear = friction().parameters("temperature_dependent_friction")[0]
    drive = rig().joint.motor.friction
    true = -drive.viscous_fade * drive.viscous * rig().joint.effective_ratio ** 2
    assert linear.value < -8.0 * linear.standard_error
    assert 0.5 < linear.value / true < 1.5  # the rig's fades with all powers of the speed


def test_the_gap_shrinks_in_prediction_when_it_is_cold_and_when_it_is_hot() -> None:
    table = friction().before_after()
    slow = table.loc[("frequency", "below 1 Hz")]
    assert slow["final"] < 0.4 * slow["base"]
    temperature = table.loc["temperature"]
    assert (temperature["final"] < 0.85 * temperature["base"]).all()


def test_the_gap_shrinks_in_forward_simulation_too() -> None:
    said = json.loads(friction().to_json())["simulated_rmse"]
    assert said["channel"] == "output_position"
    assert said["final"] < 0.5 * said["base"]


def test_the_extended_model_runs_forward_from_its_file(tmp_path: Path) -> None:
    friction().model.save(tmp_path / "joint.json")
    loaded = flexspline.Model.load(tmp_path / "joint.json")
    log = friction_runs()[0]
    again, first = (flexspline.simulate(m, log) for m in (loaded, friction().model))
    assert np.array_equal(again.simulated, first.simulated)
    assert again.rmse < 0.5 * np.ptp(log["output_position"])


def test_a_current_tells_the_same_as_a_torque() -> None:
    logs = [
        log.with_columns({"motor_current": log["motor_torque"] / CONSTANT}, note="simulated")
        for log in friction_runs()
    ]
    made = flexspline.discover(FRICTION, logs, target="motor_current")
    assert made.names == friction().names
    factor = rig().joint.effective_ratio * CONSTANT
    assert np.isclose(made.final_rmse * factor, friction().final_rmse, rtol=0.02)


def test_the_kinematic_error_is_named_with_its_largest_orders() -> None:
    made = torsion()
    assert made.names == ("kinematic_error",)
    assert made.final_rmse < 0.6 * made.base_rmse
    (error,) = (e for e in made.model.part("torsion").effects if e.name == "kinematic_error")
    largest = sorted(KINEMATIC_ERROR, key=lambda h: -h.amplitude)[:3]
    assert {(h.order, h.pair) for h in largest} <= set(error.harmonics)
    first = largest[0]
    named = {p.name.split(".")[1]: p.value for p in made.parameters("kinematic_error")}
    size = np.hypot(named["cosine 2 (circular spline)"], named["sine 2 (circular spline)"])
    assert abs(size / first.amplitude - 1.0) < 0.4
