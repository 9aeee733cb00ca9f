"""Every target with a known load: it is taken off the target once, in the target's unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cli_calls import call
from fit_logs import WIDTH, motion
from numpy.typing import NDArray

import flexspline
from flexspline import InputError, effect
from flexspline.effects import Effect
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.signals import require_one_unit

LOAD = "reference_torque"
RATIO, CONSTANT = 101.0, 0.08  # Ñ, Nm/A
GEAR = {"gear_ratio": 100.0, "output_spline": "circular"}
BASE = ["offset", effect("coulomb_friction", direction_width=WIDTH), "viscous_friction"]
LOADED = [*BASE, effect("load_dependent_friction", direction_width=WIDTH)]
TRUTH = np.array([-0.12, 0.3, 0.5, 0.08])  # Nm, Nm, Nm·s/rad, 1
COMPLIANCE = 4e-5  # rad/Nm
SCALE = {"sensor_torque": 1.0, "motor_torque": 1.0, "motor_current": 1.0 / (RATIO * CONSTANT)}

Array = NDArray[np.float64]


def run_of(seed: int = 0, facts: dict[str, float | str] | None = None) -> Log:
    """All four targets of one joint that moves under a load which dwarfs its friction."""
    channels = motion(seed)
    generator = np.random.default_rng([seed, 29])
    time, v = channels["time"], channels["output_velocity"]
    load = 8.0 * np.sin(0.9 * time + seed) + 3.0
    slides = np.tanh(v / WIDTH)
    own = TRUTH[0] + TRUTH[1] * slides + TRUTH[2] * v + TRUTH[3] * np.abs(load) * slides
    torque = load + own
    made = {"sensor": torque, "motor": torque / RATIO, "current": torque / RATIO / CONSTANT}
    made = {k: a + 1e-3 * np.std(a) * generator.normal(size=len(time)) for k, a in made.items()}
    theta = RATIO * channels["output_position"] - 0.01 + COMPLIANCE * load
    return Log.from_arrays(
        facts={"name": f"run{seed}", **GEAR, "torque_constant": CONSTANT, **(facts or {})},
        **channels,
        sensor_torque=made["sensor"],
        motor_torque=made["motor"],
        motor_current=made["current"],
        motor_position=theta + 1e-7 * generator.normal(size=len(time)),
        **{LOAD: load},
    )


def fitted(target: str, logs: Log | list[Log]) -> flexspline.Fit:
    return flexspline.fit(
        LOADED, logs, target, known_load=LOAD, fixed={"direction_width": WIDTH}, checks=False
    )


@pytest.mark.parametrize("target", SCALE)
def test_the_true_coefficients_come_out_beside_a_known_load(target: str) -> None:
    made = fitted(target, run_of())
    found = [p for p in made.parameters if p.kind == "coefficient"]
    for parameter, truth in zip(found, TRUTH * SCALE[target], strict=True):
        assert parameter.value == pytest.approx(truth, abs=4.5 * parameter.standard_error)
        assert parameter.standard_error < 0.1 * abs(truth)
    assert made.score.r_squared > 0.98
    units = {"motor_current": ["A", "A", "A·s/rad", "A/Nm"]}
    assert [p.unit for p in found] == units.get(target, ["Nm", "Nm", "Nm·s/rad", "1"])


def test_of_a_torsion_the_load_is_what_twists_and_nothing_is_taken_off() -> None:
    made = flexspline.fit(
        ["offset", "mesh_compliance"], run_of(), "torsion", known_load=LOAD, checks=False
    )
    compliance = made["mesh_compliance.compliance"]
    assert compliance.value == pytest.approx(COMPLIANCE, abs=4.5 * compliance.standard_error)
    bare = flexspline.fit(["offset"], run_of(), "torsion", checks=False)
    assert np.array_equal(made.runs[0].measured, bare.runs[0].measured)


@pytest.mark.parametrize("target", ["motor_torque", "motor_current"])
def test_a_held_out_current_is_explained_as_well_as_a_torque(target: str) -> None:
    runs = [run_of(seed) for seed in range(4)]
    made = fitted(target, runs)
    spread = np.std(np.concatenate([run.measured for run in made.runs]))
    assert 1.0 - (made.cv_rmse / spread) ** 2 > 0.98


@pytest.mark.parametrize("target", SCALE)
def test_prediction_and_comparison_are_of_the_same_y(target: str) -> None:
    made, fresh = fitted(target, run_of()), run_of(7)
    made_again = Model.from_json(made.model.to_json())
    own = made_again.predict(run_of())
    assert np.array_equal(own.measured, made.runs[0].measured)
    bare = Log(fresh.columns, {"name": "fresh", "gear_ratio": 100.0})  # the model knows the rest
    predicted = made_again.predict(bare)
    assert np.sqrt(np.mean(predicted.residual**2)) < 1.5 * made.rmse
    compared = flexspline.compare(made_again, fresh)
    assert compared.rmse == pytest.approx(np.sqrt(np.mean(predicted.residual**2)), rel=1e-9)


@pytest.mark.parametrize("target", SCALE)
def test_what_a_base_lacks_is_found_under_a_known_load(target: str) -> None:
    logs = [run_of(seed) for seed in range(2)]
    made = flexspline.discover(
        BASE, logs, target=target, known_load=LOAD, fixed={"direction_width": WIDTH}
    )
    assert made.names == ("load_dependent_friction",)


def test_a_current_moves_the_joint_as_its_torque_does() -> None:
    """A run without noise and without change of direction, driven forward under its load."""
    time = np.arange(400) / 200.0
    v = 2.0 - np.cos(1.5 * time)
    q, a = 2.0 * time - np.sin(1.5 * time) / 1.5, 1.5 * np.sin(1.5 * time)
    load = 4.0 * np.sin(2.0 * time)
    torque = (load + 0.3 + 0.5 * v + 0.7 * a) / RATIO
    log = Log.from_arrays(
        facts={**GEAR, "torque_constant": CONSTANT},
        time=time, output_position=q, output_velocity=v, output_acceleration=a,
        motor_torque=torque, motor_current=torque / CONSTANT, **{LOAD: load},
    )  # fmt: skip
    effects = ["offset", "viscous_friction", "inertia"]
    for target in ("motor_torque", "motor_current"):
        model = flexspline.fit(effects, log, target, known_load=LOAD, checks=False).model
        assert flexspline.simulate(model, log).rmse < 1e-3 * np.ptp(q)


@pytest.mark.parametrize("missing", ["torque_constant", "gear_ratio"])
def test_a_load_that_cannot_be_turned_into_amperes_is_refused(missing: str) -> None:
    full = run_of()
    log = Log(full.columns, {k: v for k, v in full.facts.items() if k != missing})
    with pytest.raises(InputError, match=f"run0.*{LOAD}.*--{missing.replace('_', '-')}"):
        fitted("motor_current", log)


def test_runs_of_two_torque_constants_are_refused() -> None:
    logs = [run_of(0), run_of(1, {"torque_constant": 0.09})]
    with pytest.raises(InputError, match="torque_constant"):
        fitted("motor_current", logs)
    model = fitted("motor_current", logs[0]).model
    with pytest.raises(InputError, match="torque_constant"):
        model.predict(logs[1])
    with pytest.raises(InputError, match="torque_constant"):
        flexspline.fit(["offset"], logs[1], "sensor_torque", checks=False, into=model)


def test_a_load_in_newton_metres_is_not_added_to_one_in_amperes() -> None:
    log = run_of()
    with pytest.raises(InputError, match=r"load_dependent_friction.*inertia.*motor_torque"):
        flexspline.fit([*LOADED, "inertia"], log, "motor_current", known_load=LOAD, checks=False)
    chosen = [e if isinstance(e, Effect) else effect(e) for e in LOADED]
    for target in ("sensor_torque", "motor_torque"):
        require_one_unit([*chosen, effect("inertia")], target, LOAD)
    require_one_unit([*chosen, effect("inertia")], "motor_current", None)


def test_a_wrong_torque_constant_is_what_is_left_of_the_load() -> None:
    log = run_of(0, {"torque_constant": 0.1})
    names = [*LOADED, "torque_constant_error"]
    made = flexspline.fit(
        names, log, "motor_current", known_load=LOAD, fixed={"direction_width": WIDTH}, checks=False
    )
    factor = made["torque_constant_error.factor"]
    truth = (1.0 / CONSTANT - 1.0 / 0.1) / RATIO
    assert factor.value == pytest.approx(truth, abs=4.5 * factor.standard_error)


@pytest.mark.usefixtures("undrawn")
def test_the_command_line_subtracts_the_load_and_names_what_it_lacks(tmp_path: Path) -> None:
    log = run_of(0)
    bare = tmp_path / "run.csv"
    pd.DataFrame(dict(log.columns)).to_csv(bare, index=False)
    given = ["fit", str(bare), "--target", "motor_current", "--known-load", LOAD, "--effects",
            "offset,coulomb_friction,viscous_friction,load_dependent_friction",
            "--out", str(tmp_path / "joint")]  # fmt: skip
    refused = call(*given)
    assert refused.exit_code == 2
    assert "--torque-constant and --gear-ratio" in refused.stderr
    gear = ["--gear-ratio", "100", "--output-spline", "circular"]
    assert call(*given, *gear, "--torque-constant", CONSTANT).exit_code == 0
    model, out = str(tmp_path / "joint" / "model.json"), tmp_path / "residual.csv"
    assert call("predict", "--model", model, bare, "--out", out).exit_code == 0
    table = pd.read_csv(out)
    expected = log["motor_current"] - log[LOAD] / (RATIO * CONSTANT)
    assert table["measured"].to_numpy() == pytest.approx(expected, rel=1e-12)
    assert np.std(table["residual"]) < 0.2 * np.std(expected)
