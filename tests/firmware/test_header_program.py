"""An exported header, compiled and run sample by sample, says what `predict` says."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import device
import numpy as np
import pytest
from every_effect import LOAD, all_of, exported, motion, rich

import flexspline
from flexspline.effects import Effect, effect, unit_in
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.model import PART_OF, Model, Part
from flexspline.prepared import prepared

FLEX = "wave_generator_on_flexspline"
CIRCULAR = "wave_generator_on_circular_spline"

FITTED = (
    effect("offset"),
    effect("coulomb_friction", direction_width=0.03),
    effect("viscous_friction"),
    effect("nonlinear_viscous_friction"),
    effect("stribeck_friction", stribeck_velocity=0.2, direction_width=0.03),
    effect("load_dependent_friction", direction_width=0.03),
    effect("inertia"),
    effect("gravity"),
    effect("output_ripple", orders=[2, 3, 4, 320, 4200]),
    effect("wave_generator_ripple", orders=[(1, FLEX), (2, FLEX), (2, CIRCULAR), (4, CIRCULAR)]),
    effect("cogging", orders=[6, 42]),
    effect("temperature_drift"),
    effect("gain_error"),
)
OTHERS = (
    effect("coulomb_friction_per_direction", direction_width=0.02),
    effect("output_ripple", orders=range(1, 21)),
    effect("load_dependent_friction", direction_width=0.02),
    effect("wave_generator_ripple", orders=[(1, CIRCULAR), (2, CIRCULAR), (3, FLEX)]),
)


def without_encoder(log: Log) -> Log:
    columns = {name: log[name] for name in log.channels if name != "motor_position"}
    return Log.from_arrays(facts=dict(log.facts), **columns)


def model_of(
    effects: tuple[Effect, ...],
    ratio: float,
    spline: str | None,
    encoder: bool,
    target: str = "sensor_torque",
) -> Model:
    """A model with random coefficients of the size of one for each effect's row."""
    rng = np.random.default_rng(7)
    terms = [(e.name, term) for e in effects for term in e.terms]
    sizes = {"nonlinear_viscous_friction": 1e-3, "load_dependent_friction": 0.05, "inertia": 0.01}
    sizes |= {"temperature_drift": 0.02, "gain_error": 0.02, "viscous_friction": 0.05}
    values = [rng.normal() * sizes.get(name, 0.3) for name, _ in terms]
    record = {"channels": ["motor_position"]} if encoder else {}
    facts = {"gear_ratio": ratio} | ({"output_spline": spline} if spline else {})
    part = Part(target, effects, np.array(values), LOAD, record)
    return Model({PART_OF[target]: part}, facts)


@pytest.fixture(scope="module")
def fitted() -> tuple[Model, Log]:
    """A fit to simulated runs of a joint whose gear ratio is no whole number."""
    rng = np.random.default_rng(3)
    truth = model_of(FITTED, 100.7, "circular", encoder=False)
    facts = {"gear_ratio": 100.7, "output_spline": "circular"}
    logs = []
    for seed in range(3):
        log = without_encoder(motion(seed)).with_facts(facts)
        reading = truth.predict(log).predicted + log[LOAD] + 0.02 * rng.normal(size=len(log))
        logs.append(log.with_columns({"sensor_torque": reading}, note="simulated"))
    made = flexspline.fit(list(FITTED), logs, "sensor_torque", known_load=LOAD, checks=False)
    return made.model, logs[0]


CASES = [
    pytest.param(FITTED, 100.0, "circular", False, id="circular"),
    pytest.param(FITTED, 50.0, "flex", False, id="flex"),
    pytest.param(FITTED, 100.7, None, False, id="fraction"),
    pytest.param(OTHERS, 100.0, "circular", True, id="encoder"),
]


TWISTED = (
    effect("offset"),
    effect("mesh_compliance", mesh_shape=0.06),
    effect("torsional_hysteresis", load_width=12.0, angle_width=0.9),
    effect("wave_generator_compliance"),
    effect("kinematic_error", orders=[2, (2, CIRCULAR), (1, FLEX), (14, "motor_on_stator")]),
    effect("temperature_drift"),
)


def assert_same_as_predict(model: Model, log: Log, program: Path) -> None:
    torque, status = device.stream(program, "double", "radians", device.radian_rows(log, LOAD))
    expected = model.predict(log).predicted
    assert not status.any()
    assert np.abs(torque - expected).max() <= 1e-12 * np.ptp(expected)


def float_error(program: Path, log: Log, far: int) -> float:
    """Largest difference of float and double, both fed with what a float device reads."""
    rows = device.encoder_rows(device.radian_rows(log, LOAD), far)
    single, _ = device.stream(program, "float", "fractions", rows)
    double, _ = device.stream(program, "double", "fractions", rows)
    return float(np.abs(single - double).max() / np.ptp(double))


@pytest.mark.parametrize("compiler", device.compilers())
def test_a_fitted_model_on_the_device_predicts_what_predict_does(
    fitted: tuple[Model, Log], tmp_path: Path, compiler: str
) -> None:
    """The device reads its channels as they are: here as `predict` has smoothed the noisy ones."""
    model, log = fitted
    log = prepared(log, model.part().preparations)
    program = device.compiled(model, tmp_path, compiler)
    assert_same_as_predict(model, log, program)
    assert float_error(program, log, far=0) <= 1e-6


@pytest.mark.parametrize(("effects", "ratio", "spline", "encoder"), CASES)
def test_every_gear_predicts_the_same_in_python_and_on_the_device(
    tmp_path: Path, effects: tuple[Effect, ...], ratio: float, spline: str | None, encoder: bool
) -> None:
    model = model_of(effects, ratio, spline, encoder)
    log = motion(5) if encoder else without_encoder(motion(5))
    program = device.compiled(model, tmp_path, device.compilers()[0])
    assert_same_as_predict(model, log, program)
    for far in (0, 1_000_000, -200_000_000):
        assert float_error(program, log, far) <= 1e-6


@pytest.mark.parametrize("path", [0, 1])
def test_a_model_with_memory_is_the_same_in_python_and_on_the_device(
    tmp_path: Path, path: int
) -> None:
    effects = tuple(e.with_shapes(path=path) if e.info.paths else e for e in TWISTED)
    sensor = model_of(effects, 100.0, "circular", encoder=True, target="torsion")
    log = motion(5)
    torque = 0.4 * np.sin(0.9 * log["time"])
    log = log.with_columns({"motor_torque": torque}, note="simulated")
    rows = np.delete(np.arange(len(log)), slice(2000, 2100))  # a gap: memory starts anew behind it
    mask = np.zeros(len(log), dtype=bool)
    mask[rows] = True
    log = log.rows(mask, note="a gap")
    for compiler in device.compilers():
        program = device.compiled(sensor, tmp_path, compiler)
        assert_same_as_predict(sensor, log, program)
        assert float_error(program, log, far=0) <= 2e-6


@pytest.mark.parametrize("target", ["sensor_torque", "motor_current", "torsion"])
def test_every_effect_of_the_catalogue_has_the_same_bits_on_the_device(
    tmp_path: Path, target: str
) -> None:
    log = rich(5)
    models = {f"{made.name}_alone": exported((made,), target) for made in all_of(target)}
    program = device.compiled_together(models, tmp_path, device.compilers()[0])
    rows = device.radian_rows(log, LOAD)
    for made, (name, model) in zip(all_of(target), models.items(), strict=True):
        torque, status = device.stream(program, "double", "radians", rows, name)
        assert not status.any(), made.name
        assert np.array_equal(torque, model.predict(log).predicted), made.name
        text = (tmp_path / f"{name}.hpp").read_text()
        assert all(unit_in(term.unit, target, LOAD) in text for term in made.terms), made.name


@pytest.mark.parametrize("target", ["sensor_torque", "motor_torque", "torsion"])
def test_all_effects_of_a_target_at_once_have_the_same_bits_on_the_device(
    tmp_path: Path, target: str
) -> None:
    model, log = exported(all_of(target), target), rich(5)
    for compiler in device.compilers():
        program = device.compiled(model, tmp_path, compiler)
        rows = device.radian_rows(log, LOAD)
        torque, status = device.stream(program, "double", "radians", rows)
        assert not status.any()
        assert np.array_equal(torque, model.predict(log).predicted)
        assert float_error(program, log, far=0) <= 2e-6


def test_a_sample_that_is_not_finite_is_flagged_and_keeps_the_last_torque(
    fitted: tuple[Model, Log], tmp_path: Path
) -> None:
    model, log = fitted
    program = device.compiled(model, tmp_path, device.compilers()[0])
    good = device.radian_rows(log, LOAD)
    rng = np.random.default_rng(11)
    bad = np.sort(rng.choice(np.arange(1, len(good)), 300, replace=False))
    broken = good.copy()
    values = np.array([np.nan, np.inf, -np.inf])
    broken[bad, rng.choice([0, 4, 5, 6, 7], bad.size)] = values[np.arange(bad.size) % 3]
    for scalar in ("double", "float"):
        whole, _ = device.stream(program, scalar, "radians", good)
        torque, status = device.stream(program, scalar, "radians", broken)
        assert np.flatnonzero(status).tolist() == bad.tolist()
        last_good = np.maximum.accumulate(np.where(status == 0, np.arange(len(good)), 0))
        assert np.array_equal(torque, whole[last_good])


def test_a_header_compiles_alone_for_every_target_and_for_no_effects(tmp_path: Path) -> None:
    parts = {
        "sensor": Part("sensor_torque", (), np.array([])),
        "drive": Part("motor_current", (effect("inertia"),), np.array([1e-300])),
        "torsion": Part("torsion", (effect("temperature_drift"),), np.array([1e-5, -0.0])),
    }
    model = Model(parts, {"joint": "a \\ joint\n#error"})
    for part in parts.values():
        device.compiled(model, tmp_path, device.compilers()[0], part.target)


def test_a_cmake_project_finds_the_installed_core(tmp_path: Path) -> None:
    package = Path(flexspline.__file__).parent / "cmake"
    cmake = shutil.which("cmake")
    if not package.is_dir() or cmake is None:
        device.lacking("flexspline is not installed as a wheel, or cmake is missing")
        return
    export(model_of(OTHERS, 100.0, "flex", True), tmp_path / "joint.hpp")
    for name in ("stream.cpp", "rows.hpp"):
        shutil.copy(Path(__file__).with_name(name), tmp_path)
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.20)\n"
        "project(consumer LANGUAGES CXX)\n"
        "find_package(flexspline CONFIG REQUIRED)\n"
        "add_executable(stream stream.cpp)\n"
        "target_include_directories(stream PRIVATE .)\n"
        "target_link_libraries(stream PRIVATE flexspline::core)\n"
    )
    build = str(tmp_path / "build")
    configure = [cmake, "-S", str(tmp_path), "-B", build, f"-Dflexspline_DIR={package}"]
    for command in (configure, [cmake, "--build", build]):
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
