"""The weight of a link beside a known load: fit, prediction and estimate read the same torque."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import flexspline
from flexspline import Compliance, Fit, FlexsplineWarning, InputError, Model, full_range
from flexspline.exporting.coupling import without_log
from flexspline.logs.log import Log
from flexspline.report.html import model_facts, python_call

Array = NDArray[np.float64]

LOAD = "reference_torque"
RATIO, STIFFNESS, ZERO = 101.0, 25_000.0, 0.002  # Ñ, Nm/rad at the output, rad at the motor
WEIGHT = 6.0  # Nm, of a link that points down at q = 0
RATE = 250.0
DRIVE = ["offset", "inertia", "gravity", "coulomb_friction", "viscous_friction"]
GEAR = ["offset", "mesh_compliance"]


def log_of(name: str, position: Array, load: Array, cell: Array, **friction: Array) -> Log:
    """A joint whose gear carries load and weight; `cell`: what stands in reference_torque."""
    generator = np.random.default_rng([len(position), sum(map(ord, name))])
    carried = load + WEIGHT * np.sin(position)
    time = np.arange(len(position)) / RATE
    velocity = np.gradient(position, time)
    torque = carried + friction.get("friction", 0.0) + 1.2 * np.gradient(velocity, time)
    noise = generator.normal(size=(3, len(position)))
    return Log.from_arrays(
        facts={"name": name, "gear_ratio": 100.0, "output_spline": "circular"},
        time=time,
        output_position=position,
        output_velocity=velocity,
        motor_position=RATIO * position + RATIO * carried / STIFFNESS - ZERO + 2e-4 * noise[0],
        motor_torque=torque / RATIO + 3e-3 * noise[1],
        reference_torque=cell + 0.01 * noise[2],
    )


def hold(angle: float, holds_weight: bool = False) -> Log:
    """A stiffness run at one angle; the load cell may be behind the weight or before it."""
    time = np.arange(0.0, 30.0, 1.0 / RATE)
    load = 25.0 * np.sin(2.0 * np.pi * 0.1 * time)
    held = holds_weight * WEIGHT * np.sin(angle)
    return log_of(f"hold {angle}", np.full(len(time), angle), load, load + held)


def moving(seed: int = 0, swing: float = 1.5, holds_weight: bool = False) -> Log:
    """Runs and rests under a load that comes and goes; `swing`: rad to either side of 0."""
    time = np.arange(0.0, 40.0, 1.0 / RATE)
    position = swing * np.sin(2.0 * np.pi * 0.11 * time + seed) * np.sin(0.3 * time) ** 2
    velocity = np.gradient(position, time)
    load = 10.0 * np.sin(2.0 * np.pi * 0.23 * time + 2.0 * seed)
    friction = 5.0 * np.tanh(velocity / 0.01) + 8.0 * velocity
    held = holds_weight * WEIGHT * np.sin(position)
    return log_of(f"run {seed}", position, load, load + held, friction=friction)


def drive_of(known_load: str | None = LOAD, holds_weight: bool = False, swing: float = 1.5) -> Fit:
    runs = [moving(seed, swing, holds_weight) for seed in (0, 1)]
    return flexspline.fit(DRIVE, runs, "motor_torque", known_load=known_load, checks=False)


@cache
def drive() -> Fit:
    return drive_of()


def gear_of(*logs: Log, into: Model | None) -> Fit:
    return flexspline.fit(GEAR, [*logs], "torsion", known_load=LOAD, into=into, checks=False)


@cache
def gear() -> Fit:
    return gear_of(hold(0.8), into=drive().model)


def external(model: Model, log: Log) -> tuple[Array, tuple[str, ...]]:
    made = flexspline.estimate(model.with_estimator(Compliance()), log)
    return made.columns["external_torque_compliance"], made.warnings


def test_a_stiffness_run_at_one_angle_leaves_its_weight_out_of_the_offset() -> None:
    """It was in the offset, −0.0154 rad, at a standard error of 2e-6 rad, and nothing said so."""
    found = gear()["offset"]
    gravity = np.array([drive()[f"gravity.{term}"].standard_error for term in ("sine", "cosine")])
    error = float(gravity @ [np.sin(0.8), np.cos(0.8)]) * RATIO / STIFFNESS
    assert abs(found.value - ZERO) < 4.0 * np.hypot(error, found.standard_error)
    assert abs(found.value - ZERO) < 0.05 * WEIGHT * np.sin(0.8) * RATIO / STIFFNESS


def test_of_several_angles_the_weight_is_no_misfit() -> None:
    both = gear_of(hold(0.8), hold(-0.8), into=drive().model)
    alone = gear_of(hold(0.8), hold(-0.8), into=None)
    level = 2e-4  # rad, the encoder's noise
    assert both.rmse < 2.0 * level < 50.0 * level < alone.rmse
    compliance = both["mesh_compliance.compliance"]
    assert compliance.value == pytest.approx(RATIO / STIFFNESS, rel=1e-3)


def test_the_estimate_takes_off_the_weight_that_the_fit_put_in() -> None:
    """−4.3 Nm, the weight at 0.8 rad, on every row of every run before."""
    log = moving(3)
    load = log[LOAD]
    found, notes = external(gear().model, log)
    inertia = 1.2 * np.abs(np.gradient(log["output_velocity"], log["time"])).max()
    assert abs(np.mean(found - load)) < 0.1
    assert np.abs(found - load).max() < 0.5 + inertia
    assert not any("taken off the gear's torque" in note for note in notes)


def test_prediction_at_another_angle_holds_the_weight_and_survives_its_file(tmp_path: Path) -> None:
    gear().model.save(tmp_path / "joint.json")
    again = Model.load(tmp_path / "joint.json")
    there = hold(-0.5)
    made = again.predict(there, "torsion")
    assert np.array_equal(made.predicted, gear().model.predict(there, "torsion").predicted)
    assert abs(np.mean(made.residual)) < 1e-3  # rad; the weight is 0.012 rad here
    parts = again.components(there, "torsion")
    assert sum(parts.values()) == pytest.approx(made.predicted, abs=1e-12)
    simulated = flexspline.simulate(again, there, target="torsion")
    assert np.abs(simulated.log["output_position"] - there["output_position"]).max() < 1e-3 / 50.0


def test_what_shows_or_runs_the_part_says_what_its_load_is(tmp_path: Path) -> None:
    whole = f"{LOAD} + the gravity of the part for motor_torque"
    assert ("known load", whole) in model_facts(gear())
    flexspline.export(gear().model, tmp_path / "gear.hpp", target="torsion")
    assert f"Reads known_load [Nm]: {whole}" in (tmp_path / "gear.hpp").read_text()
    assert without_log(gear().part, LOAD).carried is None  # a simulator's bodies have the weight


def test_a_prediction_without_the_angle_is_one_sentence() -> None:
    log = hold(0.8)
    bare = Log({name: log[name] for name in ("time", LOAD)}, dict(log.facts))
    with pytest.raises(InputError, match=r"gravity of the part for motor_torque.*output_position"):
        gear().model.predict(bare, "torsion")


def test_a_load_cell_that_carries_the_weight_changes_nothing() -> None:
    """Beside it the drive has no gravity, so none is added and none taken off."""
    known = drive_of(holds_weight=True)
    into = gear_of(hold(0.8, holds_weight=True), into=known.model)
    alone = gear_of(hold(0.8, holds_weight=True), into=None)
    gravity = float(np.hypot(*known.part.coefficients_of("gravity")))
    for name in ("offset", "mesh_compliance.compliance"):
        moved = gravity * RATIO / STIFFNESS if name == "offset" else 1e-3 * alone[name].value
        assert abs(into[name].value - alone[name].value) <= moved
    assert gravity < 0.02 * WEIGHT


def test_a_weight_that_the_load_may_hold_is_said_and_changes_no_number() -> None:
    """The drive was fitted without the load: whether a load cell held the weight is not known."""
    free = drive_of(known_load=None).model
    into, alone = gear_of(hold(0.8), into=free), gear_of(hold(0.8), into=None)
    assert np.array_equal(into.part.coefficients, alone.part.coefficients)
    (said,) = set(into.warnings) - set(alone.warnings)
    assert said.startswith("the gravity of the part for motor_torque is up to ")
    assert f"known_load='{LOAD}'" in said and "It is taken to hold it" in said


def test_a_torsion_fitted_before_the_gravity_was_known_is_said() -> None:
    before = gear_of(hold(0.8), into=None).model
    runs = [moving(seed) for seed in (0, 1)]
    fitted = flexspline.fit(DRIVE, runs, "motor_torque", known_load=LOAD, into=before, checks=False)
    _, notes = external(fitted.model, moving(3))
    (said,) = [note for note in notes if "taken off the gear's torque" in note]
    assert said.startswith(f"the part for torsion was fitted to {LOAD} alone, without the gravity")


def test_the_report_makes_the_fit_again_with_the_weight() -> None:
    both = gear_of(hold(0.8), hold(-0.8), into=drive().model)
    given = {"flexspline": flexspline, "logs": [hold(0.8), hold(-0.8)], "model": drive().model}
    exec(python_call(both), given)
    again: Fit = given["fit"]  # type: ignore[assignment]
    assert again.part.carried == both.part.carried is not None
    np.testing.assert_array_equal(again.part.coefficients, both.part.coefficients)
    assert "into=" not in python_call(gear_of(hold(0.8), into=None))


def test_discover_goes_on_with_the_weight() -> None:
    logs = [hold(0.8), hold(-0.8)]
    both = gear_of(*logs, into=drive().model)
    found = flexspline.discover(both.model, logs, target="torsion")
    assert found.fit.part.carried == both.part.carried
    assert found.fit.rmse == pytest.approx(both.rmse, rel=0.05)


@cache
def narrow() -> Model:
    """Over 0.15 rad a cosine is an offset: two numbers of which one sum is known."""
    return gear_of(hold(0.05), into=drive_of(swing=0.15).model).model


def test_a_gravity_that_its_fit_did_not_determine_is_said_where_it_is_read() -> None:
    """±19 Nm of offset and gravity that cancel in the drive fed the compliance in silence."""
    states = {p["name"]: p["state"] for p in narrow().parts["drive"].record["parameters"]}
    assert states["gravity.cosine"] == "not determined"
    runs = [moving(seed, 0.15) for seed in (0, 1)]
    trained = full_range.train(narrow(), runs, gain=60.0, methods=())
    again = gear_of(hold(0.05), into=narrow())
    for sentences in (external(narrow(), runs[0])[1], trained.warnings, again.warnings):
        (said,) = [one for one in sentences if "was not determined" in one]
        assert "the gravity of the part for motor_torque" in said
        assert "do not tell it from offset" in said


def test_a_gravity_that_is_not_determined_is_warned_of_as_a_joint_is_exported(
    tmp_path: Path,
) -> None:
    model = narrow().with_estimator(Compliance())
    with pytest.warns(FlexsplineWarning, match="gravity .* was not determined by its fit"):
        flexspline.export(model, tmp_path / "joint.hpp")
    with pytest.raises(InputError, match="without strict this is a warning"):
        flexspline.export(model, tmp_path / "joint.hpp", strict=True)


def test_a_gravity_that_is_determined_is_not_spoken_of() -> None:
    trained = full_range.train(gear().model, [moving(0), moving(1)], gain=60.0, methods=())
    for sentences in (external(gear().model, moving(0))[1], trained.warnings, gear().warnings):
        assert not any("was not determined" in one for one in sentences)
