"""What `export` and `predict` say of a model that should not be trusted as it stands."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import call
from fit_logs import WIDTH, autoregressive, log_with, motion

import flexspline
from flexspline.effects import Effect, effect
from flexspline.errors import FlexsplineWarning, InputError
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.model import PART_OF, Model, Part, part_warnings, range_warnings, sign_warnings
from flexspline.simulator import Simulated

TIME = np.arange(400) * 1e-2
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}


def entry(name: str, value: float, error: float | None, **more: Any) -> dict[str, Any]:
    known = {"kind": "coefficient", "state": "fitted", "unit": "Nm", "determined": True}
    return {"name": name, "value": value, "standard_error": error, **known, **more}


def part(target: str, values: dict[Effect, list[float]], **record: Any) -> Part:
    every = np.array([value for some in values.values() for value in some])
    return Part(target, tuple(values), every, None, record)


def model(made: Part) -> Model:
    return Model({PART_OF[made.target]: made}, FACTS)


def run(velocity: np.ndarray, **columns: np.ndarray) -> Log:
    position = np.cumsum(velocity) * 1e-2
    known = {"time": TIME, "output_position": position, "output_velocity": velocity, **columns}
    return Log.from_arrays(facts={"name": "run 7", **FACTS}, **known)


SLOW = run(np.sin(TIME))
VISCOUS = effect("viscous_friction")
SOUND = part(
    "motor_torque",
    {VISCOUS: [0.5]},
    parameters=[entry("viscous_friction.viscosity", 0.5, 0.01)],
    validity={"output_velocity": [-1.0, 1.0]},
)


def test_a_sound_model_within_its_ranges_is_not_warned_of(tmp_path: Path) -> None:
    assert model(SOUND).predict(SLOW).warnings == ()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        export(model(SOUND), tmp_path / "joint.hpp", strict=True)


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (effect("viscous_friction"), "viscous_friction.viscosity = -0.1 .* negative friction"),
        (effect("inertia"), "inertia = -0.1 .* negative inertia"),
        (effect("coulomb_friction"), "coulomb_friction.level = -0.1 Nm is negative friction"),
        (effect("stribeck_friction"), "stribeck_friction.level = -0.1 Nm is negative friction"),
        (effect("load_dependent_friction"), "load_dependent_friction.factor = -0.1 is negative"),
    ],
)
def test_a_drive_that_gives_energy_is_named_and_a_sensor_is_not(made: Effect, says: str) -> None:
    drive = part("motor_torque", {made: [-0.1]})
    with pytest.raises(InputError, match=says):
        export(model(drive), "/nowhere/joint.hpp", strict=True)
    assert part_warnings(part("motor_torque", {made: [0.0]})) == []
    assert part_warnings(part("sensor_torque", {made: [-0.1]})) == []


def test_a_coefficient_that_is_not_determined_by_itself_has_no_sign() -> None:
    """Where a joint turns one way, offset and friction are one number: −555 A is no friction."""
    drive = part("motor_torque", {effect("coulomb_friction"): [-555.0]})
    entry = {"name": "coulomb_friction.level", "kind": "coefficient", "value": -555.0,
             "standard_error": 5465.0, "state": "fitted"}  # fmt: skip
    assert len(sign_warnings(replace(drive, record={"parameters": [entry]}))) == 1
    hidden = {**entry, "state": "not determined"}
    assert sign_warnings(replace(drive, record={"parameters": [hidden]})) == []


def test_what_a_foreign_simulation_has_too_much_of_may_be_negative() -> None:
    drive = part("motor_torque", {effect("viscous_friction"): [-0.1]})
    assert len(sign_warnings(drive)) == 1
    beside = Simulated("mujoco", own_files=False, holds_load=False)
    assert sign_warnings(replace(drive, simulated=beside)) == []


def test_a_discovery_warns_of_the_same_signs() -> None:
    logs = []
    for seed in (1, 2, 3):
        at = motion(seed)
        noise = autoregressive(np.random.default_rng(seed), len(at["time"]))
        torque = 0.3 * np.tanh(at["output_velocity"] / WIDTH) - 0.2 * at["output_velocity"] + noise
        logs.append(log_with(at, name=f"run{seed}", facts=FACTS, motor_torque=torque / 101.0))
    base = ["offset", "coulomb_friction", "viscous_friction"]
    made = flexspline.discover(base, logs, target="motor_torque", exclude=["inertia"])
    (said,) = made.warnings
    assert said == sign_warnings(made.fit.part)[0] and "negative friction" in said
    assert f"Check before use: {said}." in " ".join(str(made).split())
    assert json.loads(made.to_json())["warnings"] == [said]


@pytest.mark.parametrize(("viscosity", "warned"), [(-0.2, True), (0.2, False)])
def test_a_fit_warns_of_negative_friction_that_is_significant(
    viscosity: float, warned: bool
) -> None:
    at = motion(1)
    noise = autoregressive(np.random.default_rng(1), len(at["time"]))
    velocity = at["output_velocity"]
    torque = 0.3 * np.tanh(velocity / WIDTH) + viscosity * velocity + noise
    log = log_with(at, facts=FACTS, motor_torque=torque / 101.0)
    fit = flexspline.fit(["coulomb_friction", "viscous_friction"], log, "motor_torque")
    assert (
        any("negative friction, which no drive has; fit" in said for said in fit.warnings) is warned
    )
    said = " ".join(str(fit).split())
    assert ("negative, which no drive has: viscous_friction.viscosity;" in said) is warned


def test_a_negative_value_within_its_error_is_said_to_be_that_and_no_matter_of_a_fit() -> None:
    made = fitted(part("motor_torque", {effect("inertia"): [-0.1]}), -0.1, 0.2)
    (said,) = sign_warnings(made)
    assert "negative inertia, which no drive has, and not significant; fit" in said
    assert sign_warnings(made, significant=True) == []
    (sure,) = sign_warnings(fitted(made, -0.1, 0.01), significant=True)
    assert "and not significant" not in sure
    hidden = fitted(made, -0.1, 0.01, "not determined")  # its value is not printed either
    assert sign_warnings(hidden, significant=True) == []


def fitted(made: Part, value: float, error: float, state: str = "fitted") -> Part:
    """The part, with what a fit records of its inertia."""
    entry = {"name": "inertia.inertia", "kind": "coefficient", "value": value,
             "standard_error": error, "state": state}  # fmt: skip
    return replace(made, record={**made.record, "parameters": [entry]})


@pytest.mark.parametrize(("values", "warned"), [([1.0, -1.0], 0), ([1.0, 1.2], 1), ([0.9, 0.5], 0)])
def test_friction_per_direction_has_half_the_difference_as_its_level(
    values: list[float], warned: int
) -> None:
    made = part("motor_current", {effect("coulomb_friction_per_direction"): values})
    assert len(part_warnings(made)) == warned


COULOMB, BY_SIDE = effect("coulomb_friction"), effect("coulomb_friction_per_direction")
PRESLIDING = effect("presliding_friction")


def slides(level: float, error: float, apart: float = 1.0) -> Part:
    """Coulomb friction of `level` beside springs of 12 Nm; `error`: of the sum, `apart`: of each.

    Coulomb and springs differ by an unknown share: their errors are opposite.
    """
    values = {COULOMB: [level], PRESLIDING: [2.0, 3.0, 4.0, 3.0]}
    names = ["coulomb_friction.level", *(f"presliding_friction.{t.name}" for t in PRESLIDING.terms)]
    known = [
        entry(name, value, apart)
        for name, value in zip(names, [level, 2.0, 3.0, 4.0, 3.0], strict=True)
    ]
    share = np.array([4.0, -1.0, -1.0, -1.0, -1.0]) * apart
    spread = np.outer(share, share)
    spread[0, 0] += error**2
    covariance = {"names": names, "matrix": spread.tolist()}
    return part("motor_torque", values, parameters=known, covariance=covariance)


def test_coulomb_friction_beside_presliding_has_the_sign_of_their_sum() -> None:
    assert sign_warnings(slides(-4.0, 0.01)) == []
    (said,) = sign_warnings(slides(-12.5, 0.01))
    assert said.startswith("coulomb_friction + presliding_friction = -0.5 Nm is negative friction")


@pytest.mark.parametrize(("error", "sure"), [(0.2, True), (0.3, False)])
def test_that_sum_is_judged_by_its_own_error(error: float, sure: bool) -> None:
    made = slides(-12.5, error, apart=5.0)  # neither of the two is known by itself
    (said,) = sign_warnings(made)
    assert ("and not significant" in said) is not sure
    assert bool(sign_warnings(made, significant=True)) is sure


@pytest.mark.parametrize(("values", "warned"), [([-4.0, 4.0], 0), ([-14.0, 12.0], 1)])
def test_levels_of_two_directions_are_summed_with_presliding_too(
    values: list[float], warned: int
) -> None:
    made = part("motor_torque", {BY_SIDE: values, PRESLIDING: [2.0, 3.0, 4.0, 3.0]})
    said = sign_warnings(made)
    assert len(said) == warned
    assert all("coulomb_friction_per_direction + presliding_friction = -1 Nm" in s for s in said)


def test_a_sum_whose_shares_no_run_determines_has_no_sign() -> None:
    made = slides(-12.5, 0.01)
    entries = [{**one, "state": "not determined"} for one in made.record["parameters"]]
    assert sign_warnings(replace(made, record={**made.record, "parameters": entries})) == []


def test_a_current_has_its_own_unit() -> None:
    (said,) = part_warnings(part("motor_current", {VISCOUS: [-0.1]}))
    assert "A·s/rad" in said


@pytest.mark.parametrize(
    ("value", "error", "state", "warned"),
    [
        (0.5, 0.24, "fitted", False),
        (0.5, 0.26, "fitted", True),
        (0.5, None, "fixed", False),
        (0.5, 9.0, "fixed", False),
        (0.5, None, "not determined", True),
        (0.5, None, "fitted", False),
    ],
)
def test_a_term_that_may_as_well_be_zero_is_named(
    value: float, error: float | None, state: str, warned: bool
) -> None:
    known = [entry("viscous_friction.viscosity", value, error, state=state)]
    said = part_warnings(part("sensor_torque", {VISCOUS: [value]}, parameters=known))
    assert len(said) == warned
    assert all("viscous_friction.viscosity" in one and "not significant" in one for one in said)


def test_an_order_counts_as_a_whole() -> None:
    ripple = effect("output_ripple", orders=[2, 3])
    names = [f"output_ripple.{term.name}" for term in ripple.terms]
    values = [0.0, 0.5, 0.1, 0.1]  # the sine of order 2 is large, its cosine is nothing
    known = [entry(name, value, 0.1) for name, value in zip(names, values, strict=True)]
    spread = {"names": names, "matrix": (0.01 * np.eye(4)).tolist()}
    made = part("sensor_torque", {ripple: values}, parameters=known, covariance=spread)
    (said,) = part_warnings(made)
    assert "output_ripple order 3;" in said and "order 2" not in said


@pytest.mark.parametrize("matrix", [[], [[1.0], [0.0]], [[0.0, 0.0], [0.0, 0.0]], [[1.0, 0.0]]])
def test_a_covariance_that_says_nothing_of_an_order_is_not_held_against_it(
    matrix: list[list[float]],
) -> None:
    ripple = effect("output_ripple", orders=[2])
    names = [f"output_ripple.{term.name}" for term in ripple.terms]
    spread = {"names": names, "matrix": matrix}
    assert part_warnings(part("sensor_torque", {ripple: [0.1, 0.1]}, covariance=spread)) == []


def test_a_shape_at_its_bound_is_named() -> None:
    known = [entry("stribeck_velocity", 2.0, None, kind="shape", state="at upper bound")]
    (said,) = part_warnings(part("sensor_torque", {VISCOUS: [0.5]}, parameters=known))
    assert "stribeck_velocity (upper bound)" in said


def test_rows_outside_of_the_runs_of_the_fit_are_counted() -> None:
    fast = run(np.r_[np.full(390, 0.5), np.full(10, 1.6)])
    (said,) = model(SOUND).predict(fast).warnings
    assert said.startswith("log 'run 7': 10 of 400 rows lie outside of what the model")
    assert "output_velocity from 1.6 to 1.6 rad/s (fitted from -1 to 1)" in said


def test_the_speed_of_a_run_of_positions_alone_counts() -> None:
    fast = run(np.full(400, 4.0))
    positions = Log.from_arrays(
        facts=dict(fast.facts), time=TIME, output_position=fast["output_position"]
    )
    (said,) = model(SOUND).predict(positions).warnings
    assert said.startswith("log 'run 7': 400 of 400 rows lie outside of what the model")
    assert "output_velocity from 4 to 4 rad/s (fitted from -1 to 1)" in said


def test_the_noise_of_a_channel_that_the_model_reads_smoothed_is_no_extrapolation() -> None:
    way = {"channel": "output_velocity", "source": "output_velocity", "bandwidth": 2.0}
    made = replace(SOUND, record={**SOUND.record, "prepared": [way]})
    noisy = run(np.sin(TIME) + 0.3 * np.random.default_rng(1).standard_normal(400))
    assert np.abs(noisy["output_velocity"]).max() > 1.1
    assert model(made).predict(noisy).warnings == ()


@pytest.mark.parametrize(("beyond", "warned"), [(0.09, 0), (0.11, 1)])
def test_the_noise_of_a_reading_at_the_edge_is_no_extrapolation(beyond: float, warned: int) -> None:
    assert len(range_warnings(SOUND, run(np.full(400, 1.0 + beyond)))) == warned
    assert len(range_warnings(SOUND, run(np.full(400, -1.0 - beyond)))) == warned


@pytest.mark.parametrize(
    ("ends", "angle", "warned"),
    [
        ((0.0, 1.0), 0.5, 0),
        ((0.0, 1.0), 0.5 + 8.0 * np.pi, 0),
        ((0.0, 1.0), 0.5 - 4.0 * np.pi, 0),
        ((0.0, 1.0), 3.0, 1),
        ((0.0, 1.0), -0.1, 1),
        ((6.2, 7.2), 0.5, 0),
        ((6.2, 7.2), 1.5, 1),
        ((0.0, 7.0), 3.0, 0),
    ],
)
def test_an_angle_is_inside_in_every_turn(
    ends: tuple[float, float], angle: float, warned: int
) -> None:
    known = {"output_position": list(ends)}
    made = part("sensor_torque", {effect("gravity"): [1.0, 1.0]}, validity=known)
    log = Log.from_arrays(time=[0.0, 1.0], output_position=[angle, angle])
    assert len(range_warnings(made, log)) == warned


def test_a_channel_that_no_effect_reads_does_not_count() -> None:
    made = part("sensor_torque", {VISCOUS: [0.5]}, validity={"temperature": [20.0, 21.0]})
    assert range_warnings(made, run(np.sin(TIME), temperature=np.full(400, 60.0))) == []


def weak_model(folder: Path) -> tuple[Path, Path]:
    """A model that three things speak against, and a run beyond its ranges."""
    known = [entry("viscous_friction.viscosity", -0.1, 0.2), entry("x", 1.0, None, kind="shape")]
    known[1]["state"] = "at lower bound"
    ranges = {"output_velocity": [-0.1, 0.1]}
    made = part("motor_torque", {VISCOUS: [-0.1]}, parameters=known, validity=ranges)
    model(made).save(folder / "model.json")
    write_log(SLOW, folder / "run.csv")
    return folder / "model.json", folder / "run.csv"


def test_a_run_without_the_known_load_that_effects_read_is_told() -> None:
    """What the joint adds is predicted without one; what grows with the load is not known then."""
    gain = Part("sensor_torque", (effect("gain_error"),), np.array([0.01]), "reference_torque")
    (said,) = model(gain).predict(SLOW).warnings
    assert "run 7" in said and "reference_torque" in said and "gain_error" in said
    loaded = run(np.sin(TIME), reference_torque=np.cos(TIME))
    assert model(gain).predict(loaded).warnings == ()
    plain = Part("sensor_torque", (VISCOUS,), np.array([0.5]), "reference_torque")
    assert model(plain).predict(SLOW).warnings == ()


def test_predict_says_a_sentence_a_line_and_strict_refuses(tmp_path: Path) -> None:
    joint, log = weak_model(tmp_path)
    out = tmp_path / "out.csv"
    done = call("predict", "--model", joint, log, "--out", out)
    assert done.exit_code == 0 and out.is_file() and done.stdout.count("\n") == 1
    lines = done.stderr.splitlines()
    assert len(lines) == 4 and all(line.startswith("flexspline: warning: ") for line in lines)
    for line, word in zip(lines, ("friction", "significant", "bound", "rows lie"), strict=True):
        assert word in line
    out.unlink()
    refused = call("predict", "--model", joint, log, "--out", out, "--strict")
    assert refused.exit_code == 2 and refused.stderr.count("\n") == 1 and not out.exists()
    assert "3 more" in refused.stderr


@pytest.mark.parametrize("form", ["header", "json", "binary"])
def test_export_says_a_sentence_a_line_and_strict_refuses(tmp_path: Path, form: str) -> None:
    joint, _ = weak_model(tmp_path)
    out = tmp_path / "joint.out"
    done = call("export", "--model", joint, "--format", form, "--out", out)
    assert done.exit_code == 0 and out.is_file()
    assert done.stderr.count("flexspline: warning: ") == done.stderr.count("\n") == 3
    out.unlink()
    refused = call("export", "--model", joint, "--format", form, "--out", out, "--strict")
    assert refused.exit_code == 2 and refused.stderr.count("\n") == 1 and not out.exists()


def test_export_warns_in_python_too(tmp_path: Path) -> None:
    joint, _ = weak_model(tmp_path)
    with pytest.warns(FlexsplineWarning, match="negative friction"):
        export(Model.load(joint), tmp_path / "joint.hpp")


def test_a_fit_that_ends_well_makes_a_model_without_a_warning() -> None:
    rng = np.random.default_rng(5)
    v = np.sin(3.0 * TIME)
    log = run(v, sensor_torque=0.5 * v + 0.01 * rng.normal(size=len(v)))
    fit = flexspline.fit(["viscous_friction"], log, "sensor_torque", checks=False)
    assert fit.model.predict(log).warnings == ()
    both = flexspline.fit(["offset", "viscous_friction"], log, "sensor_torque", checks=False)
    weak = [p.name for p in both.parameters if p.kind == "coefficient" and not p.significant]
    said = both.model.predict(log).warnings
    assert len(said) == bool(weak) and all(name in said[0] for name in weak)
