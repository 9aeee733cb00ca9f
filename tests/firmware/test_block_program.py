"""A block of parameters from Python is what a compiled program holds, and replaces it."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import chain_rig
import device
import numpy as np
import pytest
from chain_rig import BY_GEAR, BY_MOTOR, CALIBRATION, COLLISION, KALMAN, MERGE

from flexspline import Adaptation, Collision, Compliance, InputError, Observer, effect
from flexspline.effects import CATALOGUE
from flexspline.exporting import export
from flexspline.exporting.block import block_bytes
from flexspline.model import Model, Part

FRESH = b""
FLEX = "wave_generator_on_flexspline"


def every_effect(target: str, letter: str) -> Model:
    """A part with all effects of a target, each with coefficients of its own."""
    effects = tuple(
        effect(info.name, orders=[2, 320]) if info.pairs else effect(info.name)
        for info in CATALOGUE.values()
        if letter in info.targets
    )
    count = sum(len(e.terms) for e in effects)
    part = Part(target, effects, np.linspace(0.01, 0.3, count), "reference_torque")
    name = {"S": "sensor", "M": "drive", "D": "torsion"}[letter]
    return Model({name: part}, chain_rig.FACTS)


CHAINS = {
    "everything": (chain_rig.whole_joint(), "joint"),
    "by_the_angles_alone": (chain_rig.angle_joint(), "joint"),
    "kalman": (chain_rig.joint(BY_MOTOR, Compliance(0.2), KALMAN, COLLISION), "joint"),
    "behind_the_gear": (
        chain_rig.joint(
            BY_MOTOR,
            Compliance(),
            BY_GEAR,
            replace(MERGE, at_rest="compliant_observer"),
            Collision("compliant_observer", (), (2.0,), (2.0,)),
        ),
        "joint",
    ),
    "by_euler": (
        chain_rig.joint(CALIBRATION, Observer(100.0, discretisation="euler")),
        "joint",
    ),
    "learning": (
        chain_rig.joint(
            CALIBRATION,
            BY_MOTOR,
            Collision("observer", (), (2.0,), (2.0,)),
            Adaptation(("gravity", "viscous_friction"), noise=0.3, use="compensate", load="sensor"),
        ),
        "joint",
    ),
    "all_effects_of_a_sensor": (every_effect("sensor_torque", "S"), "model"),
    "all_effects_of_a_drive": (every_effect("motor_torque", "M"), "model"),
    "all_effects_of_a_torsion": (every_effect("torsion", "D"), "model"),
}


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One program of all, which takes half the time of a program for each."""
    models = {case: model for case, (model, _) in CHAINS.items()}
    holds = {case: made for case, (_, made) in CHAINS.items()}
    return device.compiled_together(
        models, tmp_path_factory.mktemp("block"), device.compilers()[0], "block", ("-O0",), holds
    )


def answer(program: Path, case: str, scalar: str, given: bytes) -> bytes:
    done = subprocess.run([program, scalar, case], input=given, capture_output=True, check=True)
    return done.stdout


@pytest.mark.parametrize("case", CHAINS)
def test_a_block_holds_the_bytes_of_the_compiled_header(program: Path, case: str) -> None:
    model, _ = CHAINS[case]
    for scalar in ("float", "double"):
        assert block_bytes(model, scalar) == answer(program, case, scalar, FRESH)


def test_a_block_of_other_numbers_replaces_all_of_them(program: Path, tmp_path: Path) -> None:
    model, _ = CHAINS["everything"]
    drive = replace(chain_rig.DRIVE, coefficients=1.5 * chain_rig.DRIVE.coefficients)
    other = replace(model, parts={**model.parts, "drive": drive})
    for scalar in ("float", "double"):
        export(other, tmp_path / "joint.bin", format="binary", scalar=scalar)
        given = (tmp_path / "joint.bin").read_bytes()
        assert given != answer(program, "everything", scalar, FRESH)
        assert answer(program, "everything", scalar, given) == bytes([0]) + given


def test_a_program_refuses_what_is_not_made_for_it_and_keeps_its_own(program: Path) -> None:
    model, _ = CHAINS["everything"]
    own = answer(program, "everything", "float", FRESH)
    corrupt = bytearray(own)
    corrupt[40] ^= 4
    refused = {
        1: own[:-1],
        2: b"{" + own[1:],
        5: bytes(corrupt),
        6: block_bytes(model, "double"),
        7: block_bytes(CHAINS["kalman"][0]),
    }
    for status, given in refused.items():
        assert answer(program, "everything", "float", given) == bytes([status]) + own


def test_a_number_that_a_float_cannot_hold_is_refused_by_name(tmp_path: Path) -> None:
    large = Part("sensor_torque", (effect("offset"),), np.array([1e39]))
    with pytest.raises(InputError, match=r"coefficients = 1e\+39 does not fit into a float"):
        export(Model({"sensor": large}, {}), tmp_path / "joint.bin", format="binary")
    assert not list(tmp_path.iterdir())
