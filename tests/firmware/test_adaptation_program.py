"""A joint that learns has the same bits everywhere, a price, and a block that brings it back."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import device
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))

import drifting_joint as rig

import flexspline
from flexspline import Adaptation, InputError, Model, learned_model
from flexspline.exporting.block import block_bytes

FRICTION = ("coulomb_friction", "viscous_friction")
TOOLS = [shutil.which(tool) for tool in ("arm-none-eabi-g++", "qemu-system-arm")]


def learner(use: str = "monitor") -> Model:
    return rig.fitted().with_estimator(Adaptation(FRICTION, memory=20.0, use=use))


@pytest.mark.parametrize("target", ["cortex-m4f", "cortex-m7"])
def test_what_a_device_learns_has_the_bits_of_the_host(target: str) -> None:
    if None in TOOLS:
        device.lacking("arm-none-eabi-g++ or qemu-system-arm is missing")
    log, _ = rig.log(100.0, 5, 0.2, push=(30.0, 33.0, 20.0))
    plain = flexspline.certify(rig.fitted(), log, target).cost
    made = flexspline.certify(learner("compensate"), log, target)
    assert made.bit_identical and made.samples == len(log) == 25_000
    names = [output.name for output in made.outputs]
    assert names == ["external_torque_observer", *rig.NAMES]
    # A memory in float: 1e-6 of a coefficient, a few roundings; 20 of them are allowed.
    assert all(output.quantisation < 20 * 2.0**-24 * 10.0 for output in made.outputs[1:])
    # 110 more in most steps; a block's end asks for a row's variance, a round's for its directions.
    assert made.cost.instructions_per_step <= plain.instructions_per_step + 140
    assert made.cost.most_instructions <= plain.most_instructions + 1300
    assert made.cost.ram_bytes <= plain.ram_bytes + 160
    assert made.cost.code_bytes <= plain.code_bytes + 4500
    assert set(made.cost.calls) <= {"memcpy", "memset"}


def learn(model: Model, log: flexspline.Log, folder: Path, scalar: str) -> bytes:
    """The block that a compiled joint saves behind a log."""
    program = device.compiled(model, folder, device.compilers()[0], name="learn")
    time = log["time"]
    period = np.r_[time[1] - time[0], np.diff(time)]
    rows = np.column_stack([period, log["output_velocity"], log["motor_torque"]])
    done = subprocess.run([str(program), scalar], input=rows.tobytes(), capture_output=True)
    assert done.returncode == 0
    return done.stdout


@pytest.mark.parametrize("scalar", ["float", "double"])
def test_what_a_joint_learned_comes_back_by_its_block(tmp_path: Path, scalar: str) -> None:
    model = learner()
    log, _ = rig.log(100.0, 5, 0.2)
    saved = learn(model, log, tmp_path, scalar)
    back = learned_model(model, saved)
    estimated = flexspline.estimate(model, log)
    tolerance = {"float": 2e-6, "double": 0.0}[scalar]
    values = dict(zip(rig.EFFECTS, back.parts["drive"].coefficients, strict=True))
    for name in rig.NAMES:
        assert values[name.split(".")[0]] == pytest.approx(estimated[name][-1], rel=tolerance)
        (entry,) = (p for p in back.parts["drive"].record["parameters"] if p["name"] == name)
        assert entry["value"] == values[name.split(".")[0]]
    assert values["inertia"] == model.parts["drive"].coefficients[0]
    # It can be saved, exported and handed to the joint again.
    again = Model.load(_saved(back, tmp_path / "model.json"))
    assert len(block_bytes(again, scalar)) == len(saved)
    (tmp_path / "joint.bin").write_bytes(saved)
    assert learned_model(again, tmp_path / "joint.bin").parts[
        "drive"
    ].coefficients == pytest.approx(back.parts["drive"].coefficients, rel=0.0)


def _saved(model: Model, path: Path) -> Path:
    model.save(path)
    return path


def test_what_is_no_block_of_the_model_is_refused_in_a_sentence(tmp_path: Path) -> None:
    model = learner()
    good = block_bytes(model)
    assert learned_model(model, good).parts["drive"].coefficients == pytest.approx(
        model.parts["drive"].coefficients, rel=2.0**-23
    )
    broken = bytearray(good)
    broken[-20] ^= 1
    cases = {
        "is no block of parameters": b"{}",
        "of another structure": block_bytes(learner("compensate")),
        "checksum does not fit": bytes(broken),
        "checksum": good[:-8],
    }
    for sentence, given in cases.items():
        with pytest.raises(InputError, match=sentence):
            learned_model(model, given)
    with pytest.raises(InputError, match="has no estimator adaptation"):
        learned_model(rig.fitted(), good)
    with pytest.raises(InputError, match="No such file"):
        learned_model(model, tmp_path / "none.bin")
