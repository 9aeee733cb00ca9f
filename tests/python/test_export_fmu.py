"""A model as an FMU: what FMPy makes of it is what the core makes, and FMI's own schemas hold."""

from __future__ import annotations

import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from cli_calls import call
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from fmu_runs import (
    FACTS,
    LOAD,
    driven,
    every_effect,
    inputs_of,
    model_of,
    references,
    run_of,
    started,
    unpacked,
)
from lxml import etree
from test_own_effect import NM, WIDTHS
from test_own_header import HEADER, curve

from flexspline import InputError, own_effect
from flexspline.effects import effect
from flexspline.exporting import export
from flexspline.exporting.fmu import NUMBERED, STATUS, STATUSES
from flexspline.model import Model, Part
from flexspline.programs import include_folder

if shutil.which("c++") is None:
    pytest.skip("c++ is missing; install Debian's g++", allow_module_level=True)

HEADERS = Path(fmpy.__file__).parent / "c-code"
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3"
MEMORY = ("presliding_friction", "sensor_lag", "viscous_friction")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU with memory, of little more."""
    model = model_of("motor_torque", [effect(name) for name in MEMORY])
    return export(model, tmp_path_factory.mktemp("small") / "joint.fmu", format="fmu")


def small_model() -> Model:
    return model_of("motor_torque", [effect(name) for name in MEMORY])


@pytest.mark.parametrize(
    ("target", "encoder"),
    [("sensor_torque", True), ("motor_torque", True), ("torsion", True), ("motor_current", False)],
)
def test_an_fmu_of_every_effect_has_the_numbers_of_the_core(
    target: str, encoder: bool, tmp_path: Path
) -> None:
    model, log = model_of(target, every_effect(target), encoder=encoder), run_of()
    path = export(model, tmp_path / "joint.fmu", format="fmu")
    assert validate_fmu(str(path)) == []
    with unpacked(path, tmp_path / "fmu") as (description, instance):
        assert ("motor_position" in inputs_of(description)) == encoder
        outputs, made = driven(description, started(instance(), log["time"][0]), log)
    said = model.predict(log).predicted
    scale = np.abs(said).max()
    assert outputs[0] == f"modelled_{target}"
    np.testing.assert_allclose(made[:, 0], said, rtol=0.0, atol=1e-12 * scale)
    parts = model.components(log)
    assert outputs[1:] == [f"part_{name}" for name in parts]
    for name, column in zip(parts, made[:, 1:].T, strict=True):
        np.testing.assert_allclose(column, parts[name], rtol=0.0, atol=1e-12 * scale, err_msg=name)


def test_instances_know_nothing_of_each_other(small: Path, tmp_path: Path) -> None:
    log, other = run_of(1, 400), run_of(2, 400)
    with unpacked(small, tmp_path) as (description, instance):
        slaves = [started(instance(name), log["time"][0]) for name in ("one", "two")]
        slaves[1].reset()
        started(slaves[1], other["time"][0])
        apart = [driven(description, slaves[k], each)[1] for k, each in enumerate((log, other))]
        mixed: list[list[Any]] = [[], []]
        for slave, each in zip(slaves, (log, other), strict=True):
            slave.reset()
            started(slave, each["time"][0])
        for row in range(400):
            for k, each in enumerate((log, other)):
                mixed[k].append(driven(description, slaves[k], each, slice(row, row + 1))[1][0])
        for k in range(2):
            assert np.array(mixed[k]).tobytes() == apart[k].tobytes()


def test_a_reset_forgets_and_a_run_without_one_remembers(small: Path, tmp_path: Path) -> None:
    log = run_of(1, 300)
    with unpacked(small, tmp_path) as (description, instance):
        slave = started(instance(), log["time"][0])
        first = driven(description, slave, log)[1]
        slave.reset()
        assert slave.getFloat64([*inputs_of(description).values()]) == [0.0] * 3
        again = driven(description, started(slave, log["time"][0]), log)[1]
        assert again.tobytes() == first.tobytes()
        late = log.rows(slice(150, None))
        slave.reset()
        fresh = driven(description, started(slave, late["time"][0]), late)[1]
        assert np.abs(fresh - first[150:]).max() > 1e-3


def test_what_is_read_twice_moves_nothing(small: Path, tmp_path: Path) -> None:
    log = run_of(1, 50)
    with unpacked(small, tmp_path) as (description, instance):
        slave = started(instance(), log["time"][0])
        known, inputs = references(description), inputs_of(description)
        driven(description, slave, log)
        found = []
        for values in ([1.0, 0.5, 2.0], [-1.0, 0.5, 2.0], [1.0, 0.5, 2.0]):
            slave.setFloat64([*inputs.values()], values)
            made = slave.getFloat64([known["modelled_motor_torque"]] * 2)
            assert made[0] == made[1]
            found.append(made[0])
        assert found[0] == found[2] != found[1]


def test_fmpy_simulates_it_with_inputs_held_over_each_step(small: Path) -> None:
    log = run_of(1, 300)
    names = {"known_load": LOAD, "output_position": "output_position"}
    names["output_velocity"] = "output_velocity"
    time = 0.004 * np.arange(len(log))
    columns = [time, *(log[channel] for channel in names.values())]
    types = [("time", float), *((name, float) for name in names)]
    signals = np.array(list(zip(*columns, strict=True)), dtype=types)
    made = fmpy.simulate_fmu(
        str(small), input=signals, output_interval=0.004, stop_time=time[-1],
        output=["part_viscous_friction", "status"], fmi_type="CoSimulation",
    )  # fmt: skip
    held = small_model().components(log)["viscous_friction"]
    assert made["part_viscous_friction"][0] == pytest.approx(held[0], rel=1e-12)
    # FMPy reads outputs at the end of a step, before the next inputs are set
    np.testing.assert_allclose(made["part_viscous_friction"][1:], held[:-1], rtol=1e-9, atol=1e-12)
    assert (made["status"] == 0).all()


def test_a_bad_input_says_so_and_keeps_the_last_good_values(small: Path, tmp_path: Path) -> None:
    log, said = run_of(1, 30), []
    with unpacked(small, tmp_path) as (description, instance):
        slave = started(
            instance(logMessage=lambda *args: said.append(args[1:]), loggingOn=True), log["time"][0]
        )
        outputs, made = driven(description, slave, log)
        known, now = references(description), log["time"][-1] + 0.004
        for value, status in ((np.nan, 1), (np.inf, 1), (1e30, 3)):
            slave.setFloat64([known["output_position"]], [value])
            assert slave.getInt64([STATUS]) == [status]
            assert slave.getFloat64([known[name] for name in outputs]) == made[-1].tolist()
            slave.doStep(now, 0.004)
            assert said.pop()[0] == 1 and not said  # fmi3Warning
        slave.setFloat64([known["output_position"]], [log["output_position"][-1]])
        assert slave.getInt64([STATUS]) == [0]
        slave.doStep(now, 4000.0)
        slave.doStep(now + 4000.0, 1.0)
        assert b"more than an hour" in said.pop()[2]
    assert [*STATUSES][3] == "out_of_range"


@pytest.mark.parametrize(
    "wrong",
    [
        lambda slave: slave.setFloat64([64], [1.0]),  # an output
        lambda slave: slave.setFloat64([5], [1.0]),  # a channel that the model does not read
        lambda slave: slave.getFloat64([63]),
        lambda slave: slave.getFloat64([128 + len(MEMORY)]),
        lambda slave: slave.getInt64([64]),
        lambda slave: slave.getInt32([1]),
        lambda slave: slave.setString([1], ["x"]),
        lambda slave: slave.getFMUState(),
        lambda slave: slave.doStep(0.0, 0.0),
        lambda slave: slave.doStep(float("nan"), 1.0),
        lambda slave: slave.enterEventMode(),
        lambda slave: slave.enterInitializationMode(),
        lambda slave: (slave.terminate(), slave.setFloat64([1], [1.0])),
        lambda slave: (slave.reset(), slave.doStep(0.0, 1.0)),
    ],
)
def test_a_wrong_call_is_an_error_and_no_crash(wrong: Any, small: Path, tmp_path: Path) -> None:
    said: list[Any] = []
    with unpacked(small, tmp_path) as (_, instance):
        slave = started(instance(logMessage=lambda *args: said.append(args), loggingOn=True), 0.0)
        with pytest.raises(FMICallException):
            wrong(slave)
        assert len(said) == 1 and said[0][1] == 3  # fmi3Error, with a sentence


def test_the_binary_of_another_model_is_not_taken(small: Path, tmp_path: Path) -> None:
    with unpacked(small, tmp_path) as (description, instance):
        for token in ("", "motor_torque:", description.guid[:-1] + "x", description.guid + "0"):
            description.guid = token
            with pytest.raises(Exception, match="Failed to instantiate"):
                instance(logMessage=lambda *_: None)


def test_flags_units_and_schemas_are_those_of_fmi(small: Path, tmp_path: Path) -> None:
    assert validate_fmu(str(small)) == []
    with unpacked(small, tmp_path) as (description, _):
        flags = description.coSimulation
        assert not flags.canGetAndSetFMUstate and not flags.canSerializeFMUstate
        assert flags.canHandleVariableCommunicationStepSize and not flags.needsExecutionTool
        units = {v.name: v.unit for v in description.modelVariables if v.type == "Float64"}
        assert units["output_velocity"] == "rad/s" and units["known_load"] == "N.m"
        assert {u.name for u in description.unitDefinitions} == {*units.values()} | {"s"}
        assert not {"period", "temperature", "motor_torque"} & units.keys()
    build = tmp_path / "sources" / "buildDescription.xml"
    etree.XMLSchema(file=str(SCHEMA / "fmi3BuildDescription.xsd")).assertValid(
        etree.parse(str(build))
    )
    for text in (build, tmp_path / "modelDescription.xml"):
        assert text.read_bytes().isascii()
        assert not re.search(rb"[^\n -~]", text.read_bytes())


def test_the_sources_agree_with_fmis_own_headers_and_build_with_a_prefix(
    small: Path, tmp_path: Path
) -> None:
    with zipfile.ZipFile(small) as packed:
        packed.extractall(tmp_path)
    folder = tmp_path / "sources"
    compiler = ["c++", "-std=c++20", "-Wall", "-Wextra", "-Werror", "-I.", "fmu/fmu.cpp"]
    theirs = ["-include", HEADERS / "fmi3Functions.h", "-fsyntax-only"]
    subprocess.run([*compiler, *theirs], cwd=folder, check=True)
    names = tmp_path / "names.o"
    subprocess.run(
        [*compiler, "-DFMI3_FUNCTION_PREFIX=elbow_", "-c", "-o", names], cwd=folder, check=True
    )
    said = subprocess.run(["nm", names], capture_output=True, text=True, check=True).stdout
    assert " T elbow_fmi3DoStep" in said and " T fmi3" not in said
    text = (HEADERS / "fmi3Functions.h").read_text()
    declared = set(re.findall(r"#define (fmi3\w+) +fmi3FullName", text))
    assert len(declared) > 60
    assert {f"elbow_{name}" for name in declared} <= set(re.findall(r" T (\w+)", said))


def test_an_importer_compiles_the_sources_to_the_same_numbers(small: Path, tmp_path: Path) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("cmake is missing; install it")
    log = run_of(1, 200)
    with unpacked(small, tmp_path / "ours") as (description, instance):
        ours = driven(description, started(instance(), log["time"][0]), log)[1]
    with zipfile.ZipFile(small) as packed:
        packed.extractall(tmp_path / "theirs")
    (library,) = (tmp_path / "theirs" / "binaries").rglob("joint.*")
    library.unlink()
    build_platform_binary(tmp_path / "theirs")
    assert library.exists()
    with zipfile.ZipFile(tmp_path / "theirs.fmu", "w") as packed:
        for file in (tmp_path / "theirs").rglob("*"):
            packed.write(file, file.relative_to(tmp_path / "theirs"))
    with unpacked(tmp_path / "theirs.fmu", tmp_path / "again") as (description, instance):
        theirs = driven(description, started(instance(), log["time"][0]), log)[1]
    assert theirs.tobytes() == ours.tobytes()


def test_the_same_model_makes_the_same_bytes(small: Path, tmp_path: Path) -> None:
    again = export(small_model(), tmp_path / "joint.fmu", format="fmu")
    assert again.read_bytes() == small.read_bytes()


def test_channels_are_numbered_as_the_core_numbers_them() -> None:
    text = (include_folder() / "flexspline" / "sample.hpp").read_text()
    names = re.findall(r'"(\w+)"', text.partition("channel_names{")[2].partition("};")[0])
    assert tuple(names[: len(NUMBERED)]) == NUMBERED
    assert set(names) - set(NUMBERED) == {"period", "time"}


@pytest.mark.parametrize("name", ["stepper", "fmu", "fmi3", "joint", "flexspline"])
def test_an_own_effect_of_any_name_runs_in_an_fmu(name: str, tmp_path: Path) -> None:
    text = HEADER.replace('"hump"', f'"{name}"').replace("Hump", name.capitalize())
    (tmp_path / f"{name}.hpp").write_text(text)
    own = own_effect(name=name, terms=NM, shapes=WIDTHS, header=tmp_path / f"{name}.hpp")(curve)
    model = model_of("motor_torque", [effect("viscous_friction"), own])
    path, log = export(model, tmp_path / "joint.fmu", format="fmu"), run_of(1, 100)
    assert validate_fmu(str(path)) == []
    with unpacked(path, tmp_path / "fmu") as (description, instance):
        outputs, made = driven(description, started(instance(), log["time"][0]), log)
    assert outputs[2] == f"part_{name}"
    np.testing.assert_allclose(made[:, 0], model.predict(log).predicted, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "name", ['a"b<c>&d', "--> <joint/>", "tab\tand\x00zero\x1b[2J", "關節 \u202e", "x\ny"]
)
def test_no_name_reaches_out_of_its_place(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flexspline.exporting.fmu._compiled", lambda *_: ("binaries/x/y.so", b""))
    log = {"name": name, "rows": 9, "sha256": None, "history": [f"{name} zero phase {name}"]}
    made = model_of("motor_torque", [effect("viscous_friction")], logs=[log])
    model = Model(made.parts, {**FACTS, "joint": name})
    path = export(model, tmp_path / "joint.fmu", format="fmu")
    with zipfile.ZipFile(path) as packed:
        text = packed.read("modelDescription.xml")
    assert text.isascii() and not re.search(rb"[^\n -~]", text)
    root = ET.fromstring(text)
    assert root[0].tag == "CoSimulation" and len(root) == 6
    assert root.attrib["modelName"].isprintable()


def refused(sentence: str, path: Path, call_it: Any) -> None:
    """Refused in one sentence, with nothing beside what was there before."""
    before = {each: each.read_bytes() for each in path.parent.rglob("*") if each.is_file()}
    with pytest.raises(InputError, match=sentence) as caught:
        call_it()
    assert "\n" not in str(caught.value)
    after = {each: each.read_bytes() for each in path.parent.rglob("*") if each.is_file()}
    assert after == before


def test_without_a_compiler_the_sentence_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    monkeypatch.delenv("CXX", raising=False)
    path = tmp_path / "new" / "joint.fmu"
    for _ in range(2):  # what is there already stays
        refused(
            r"c\+\+ is not on this machine; install Debian's g\+\+",
            path,
            lambda: export(small_model(), path, format="fmu"),
        )
        assert not (tmp_path / "new").exists() or path.read_bytes() == b"old"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"old")


def test_a_compiler_that_refuses_leaves_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\necho 'fmu.cpp:1: error: no such language' >&2\nexit 4\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CXX", str(broken))
    path = tmp_path / "joint.fmu"
    refused(
        "compiling the FMU joint: exit code 4: fmu.cpp:1: error: no such language",
        path,
        lambda: export(small_model(), path, format="fmu"),
    )


def test_a_system_without_a_name_in_fmi_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.platform", "sunos5")
    path = tmp_path / "joint.fmu"
    refused("no name for binaries of sunos5", path, lambda: export(small_model(), path, "fmu"))


def test_what_no_fmu_can_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "joint.fmu"
    (tmp_path / "other.txt").write_text("mine")
    friction = model_of("motor_torque", [effect("viscous_friction")])
    sensor = model_of("sensor_torque", [effect("offset")])
    both = Model({**friction.parts, **sensor.parts}, FACTS)
    own = own_effect(name="hump", terms=NM, shapes=WIDTHS)(curve)
    huge = Part("motor_torque", (effect("offset"),), np.array([1e300]))
    gear = Model(friction.parts, {"gear_ratio": 1e12})
    for model, sentence in (
        (both, "parts for motor_torque, sensor_torque; say which target"),
        (model_of("motor_torque", [own]), "hump.hpp, and give it with header or with_header"),
        (Model({"drive": huge}), "offset.offset = 1e.300 does not fit into a float"),
        (gear, "gear_ratio gives an effective ratio of"),
    ):
        refused(sentence, path, lambda model=model: export(model, path, "fmu"))
    refused("no part for the target torsion", path, lambda: export(both, path, "fmu", "torsion"))
    with pytest.raises(InputError, match="fmu leaves out nothing"):
        export(friction, path, "fmu", runs=run_of(1, 20))
    assert not path.exists()


def test_an_fmu_is_no_folder_and_replaces_none_that_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flexspline.exporting.fmu._compiled", lambda *_: ("binaries/x/y.so", b""))
    small_model().save(tmp_path / "model.json")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine").write_text("mine")
    for out, sentence in (
        (tmp_path / "folder", "give the name of a file"),
        (tmp_path / "model.json", "would overwrite"),
        (tmp_path / "model.json" / "joint.fmu", "cannot be written"),
        (Path("/dev/null"), "is a device"),
    ):
        done = call("export", "--model", tmp_path / "model.json", "--format", "fmu", "--out", out)
        assert done.exit_code == 2 and sentence in done.stderr, done.stderr
    assert sorted(each.name for each in tmp_path.rglob("*")) == ["folder", "mine", "model.json"]


def test_the_command_exports_an_fmu_that_runs(tmp_path: Path) -> None:
    small_model().save(tmp_path / "model.json")
    out = tmp_path / "joint 7.fmu"
    done = call("export", "--model", tmp_path / "model.json", "--format", "fmu", "--out", out)
    assert done.exit_code == 0 and f"wrote {out}" in done.stdout
    log = run_of(1, 20)
    with unpacked(out, tmp_path / "fmu") as (description, instance):
        assert description.coSimulation.modelIdentifier == "joint_7"
        made = driven(description, started(instance(), log["time"][0]), log)[1]
    np.testing.assert_allclose(made[:, 0], small_model().predict(log).predicted, atol=1e-12)
