"""A certificate says what an emulated Cortex-M computes with an exported model, bit by bit."""

from __future__ import annotations

import importlib.resources
import json
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

import chain_rig
import device
import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner
from every_effect import all_of, exported, rich

import flexspline
from flexspline import Certificate, InputError, certification, programs
from flexspline.certification.program import DEVICES, Built, Device
from flexspline.cli import commands
from flexspline.effects import effect
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.model import Model, Part
from flexspline.programs import firmware_folder

CORTEX = ("cortex-m4f", "cortex-m7")
NEEDED = ("arm-none-eabi-g++", "qemu-system-arm")

if any(shutil.which(tool) is None for tool in NEEDED):
    device.lacking("arm-none-eabi-g++ or qemu-system-arm is missing; see .ci/run for the packages")


@pytest.fixture(scope="module", autouse=True)
def _host_programs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The host's program of a header is built once: many tests certify the same model."""
    built: dict[tuple[object, ...], Built] = {}
    build = certification.build

    def once(
        device: Device, folder: Path, unit: str, scalar: str, options: Sequence[str] = ("-O2",)
    ) -> Built:
        if device.name != "host":
            return build(device, folder, unit, scalar, options)
        header = (folder / "joint.hpp").read_bytes()
        known = (header, unit, scalar, *options)
        if known not in built:
            apart = tmp_path_factory.mktemp("host")
            (apart / "joint.hpp").write_bytes(header)
            built[known] = build(device, apart, unit, scalar, options)
        return built[known]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(certification, "build", once)
        yield


def valid(made: Certificate) -> dict:
    """The certificate as JSON, after its schema accepted it."""
    folder = importlib.resources.files("flexspline") / "schemas"
    schema = json.loads((folder / "certificate.schema.json").read_text(encoding="utf-8"))
    content = json.loads(json.dumps(made.to_json()))
    jsonschema.validate(content, schema)
    return content


@pytest.mark.parametrize("target", CORTEX)
def test_the_whole_chain_has_the_bits_of_the_host(target: str) -> None:
    log = chain_rig.raw_channels(20_000)
    made = flexspline.certify(chain_rig.angle_joint(), log, target)
    said = valid(made)
    assert made.bit_identical and said["bit_identical"]
    assert said["samples"] == len(log) and said["refused"] == 0
    assert said["largest_difference"]["ulp"] == 0 and said["largest_difference"]["value"] == 0.0
    assert len(made.outputs) == 7
    for output in made.outputs:
        assert 0.9 * len(log) < output.samples <= len(log), output.name
        assert 0.0 < output.quantisation < 1e-3, output.name
    cost = made.cost
    assert 0 < cost.instructions_per_step <= cost.most_instructions < cost.cycles_per_step * 2
    assert 0 < cost.stack_bytes < 4096 and 0 < cost.ram_bytes < cost.flash_bytes < 2**15
    assert set(cost.calls) <= {"memcpy", "memset"}
    assert "with the host's bits in all" in str(made) and "instructions per step" in str(made)
    assert made._repr_html_().count("<td>Nm</td>") == 6


@pytest.mark.parametrize("target", ["sensor_torque", "motor_current", "torsion"])
def test_all_effects_of_a_target_have_the_bits_of_the_host(target: str) -> None:
    model, log = exported(all_of(target), target), rich(5, 3000)
    for cortex in CORTEX:
        made = flexspline.certify(model, log, cortex)
        assert made.bit_identical, f"{cortex}: {made}"
        (output,) = made.outputs
        assert (output.name, output.samples) == (target, len(log))
        assert 0.0 < output.quantisation < 1e-3


def small() -> tuple[flexspline.Model, Log]:
    """A calibrated sensor alone, and a short log of it."""
    return chain_rig.joint(chain_rig.CALIBRATION), chain_rig.raw_channels(500)


def test_a_reading_beyond_its_limit_is_counted_and_is_no_difference() -> None:
    model, log = small()
    volts = log["sensor_voltage"].copy()
    volts[100:103] = 500.0  # calibrated within 1 V
    made = flexspline.certify(model, log.with_columns({"sensor_voltage": volts}, note="wild"))
    said = valid(made)
    assert made.bit_identical and (said["out_of_range"], said["refused"]) == (3, 0)
    assert f"3 of {len(log)} samples have a reading beyond its limit" in str(made)


def test_a_part_refuses_a_load_far_beyond_its_fit_and_the_certificate_says_so() -> None:
    record = {"validity": {"known_load": [-20.0, 20.0]}}
    effects = (effect("torque_hysteresis"),)
    part = Part("sensor_torque", effects, np.full(4, 0.1), "reference_torque", record)
    time = np.arange(300) * 1e-3
    load = 20.0 * np.sin(9.0 * time)
    load[[150, 160]] = 2500.0, -1e10
    log = Log.from_arrays(time=time, reference_torque=load)
    made = flexspline.certify(Model({"sensor": part}, {}), log)
    assert made.bit_identical and (made.out_of_range, made.refused) == (2, 2)
    assert made.outputs[0].samples == 298


def test_instructions_are_counted_alike_in_each_run() -> None:
    made = [flexspline.certify(*small(), "cortex-m4f").cost for _ in range(2)]
    assert made[0] == made[1]


def test_a_program_that_fuses_operations_is_reported_as_another() -> None:
    model, log = small()
    made = flexspline.certify(model, log, "cortex-m4f", options=("-O2", "-ffp-contract=fast"))
    said = valid(made)
    assert not made.bit_identical and not said["bit_identical"]
    worst = said["largest_difference"]
    assert worst["ulp"] >= 1 and 0.0 < worst["value"] < 1e-3 and worst["unit"] == "Nm"
    assert "NOT compute" in str(made) and "-ffp-contract=off" in str(made)


def test_the_command_writes_what_the_call_says(tmp_path: Path) -> None:
    model, log = small()
    model.save(tmp_path / "model.json")
    write_log(log, tmp_path / "run.csv")
    out = tmp_path / "cert.json"
    words = ["certify", "--model", tmp_path / "model.json", tmp_path / "run.csv"]
    words += ["--device", "host", "--out", out]
    result = CliRunner().invoke(commands, [str(word) for word in words])
    assert result.exit_code == 0, result.stderr
    said = json.loads(out.read_text(encoding="utf-8"))
    assert (said["device"], said["bit_identical"], said["samples"]) == ("host", True, len(log))
    assert said["out_of_range"] == 0
    assert said["stack_bytes"] is None and said["flash_bytes"] > 0
    assert result.stdout.startswith("host computes the estimators with the host's bits in all")


@pytest.mark.parametrize("tool", NEEDED)
def test_a_missing_tool_is_one_sentence_that_names_the_package(
    monkeypatch: pytest.MonkeyPatch, tool: str
) -> None:
    there = shutil.which
    monkeypatch.setattr(
        programs.shutil, "which", lambda name: None if name == tool else there(name)
    )
    with pytest.raises(InputError) as caught:
        flexspline.certify(*small(), "cortex-m7")
    sentence = str(caught.value)
    assert sentence.startswith(f"{tool} is not on this machine; install Debian's ")
    assert programs.PACKAGES[tool] in sentence and "\n" not in sentence


@pytest.mark.parametrize("target", ["host", *CORTEX])
def test_the_example_compiles_by_its_makefile_and_runs(tmp_path: Path, target: str) -> None:
    export(chain_rig.angle_joint(), tmp_path / "joint.hpp")
    make = shutil.which("make")
    if make is None:
        device.lacking("make is missing; install Debian's make")
        return
    given = [f"TARGET={target}", "JOINT=joint.hpp", f"INCLUDE={device.include()}"]
    call = [make, "-f", str(firmware_folder() / "Makefile"), "example", *given]
    subprocess.run(call, cwd=tmp_path, check=True)
    run = ["./example"]
    if target != "host":
        board = DEVICES[target].machine
        run = ["qemu-system-arm", "-machine", str(board), "-display", "none", "-monitor", "none"]
        run += ["-semihosting-config", "enable=on,target=native", "-serial", "none"]
        run += ["-kernel", f"example-{target}.elf"]
    assert subprocess.run(run, cwd=tmp_path, timeout=60).returncode == 0


def test_what_cannot_be_certified_is_refused_with_a_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certification.tempfile, "tempdir", str(tmp_path))
    model, log = small()
    with pytest.raises(InputError, match=r"no device 'cortex-m4' \(did you mean 'cortex-m4f'\?\)"):
        flexspline.certify(model, log, "cortex-m4")
    with pytest.raises(InputError, match=r"compiling joint_unit.cpp for host: .*other compiler"):
        flexspline.certify(model, log, "host", options=("-fno-such-option",))
    blind = chain_rig.without(log, "sensor_voltage")
    with pytest.raises(InputError, match="no row has all that the model reads"):
        flexspline.certify(model, blind, "host")
    assert not list(tmp_path.iterdir())
