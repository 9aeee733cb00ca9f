"""What a step of the ten-harmonic chain costs a Cortex-M4F, counted; and that it has no heap."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import chain_rig
import device
import device_chains
import pytest

import flexspline
from flexspline.certification import Cost
from flexspline.model import Model

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

import chain

NEEDED = ("arm-none-eabi-g++", "qemu-system-arm")

if any(shutil.which(tool) is None for tool in NEEDED):
    device.lacking("arm-none-eabi-g++ or qemu-system-arm is missing; see .ci/run for the packages")


def cost_of(model: Model) -> Cost:
    """What a Cortex-M4F counts over 2000 samples; it makes the same bits as a PC."""
    made = flexspline.certify(model, chain_rig.raw_channels(2000), "cortex-m4f")
    assert made.bit_identical
    return made.cost


def test_ten_harmonics_cost_at_most_450_instructions_and_2750_bytes() -> None:
    cost = cost_of(device_chains.ten_harmonics())
    assert 300 < cost.instructions_per_step <= 450
    assert cost.most_instructions <= 530  # a new period and a mesh at its pole in one sample
    assert 1500 < cost.code_bytes <= 2750  # 250 of them the limits of seven readings


def test_with_thermistor_and_detector_no_step_costs_more_than_700() -> None:
    cost = cost_of(device_chains.ten_harmonics(chain_rig.THERMISTOR, chain_rig.COLLISION))
    assert 400 < cost.instructions_per_step <= cost.most_instructions <= 700


def test_with_thermistor_detector_and_reading_checks_a_step_costs_at_most_700() -> None:
    cost = cost_of(device_chains.everything())
    assert 500 < cost.instructions_per_step <= 700
    assert cost.most_instructions <= 790  # a new period and a mesh at its pole in one sample


def test_a_velocity_from_the_angle_costs_at_most_70_instructions_more() -> None:
    assert 600 < cost_of(device_chains.by_angle()).instructions_per_step <= 730


@pytest.mark.parametrize("scalar", ["float", "double"])
def test_a_step_calls_no_heap(scalar: str) -> None:
    log = chain_rig.raw_channels(2000)
    *times, calls = chain.host_steps(device_chains.everything(), log, scalar, "2")
    assert calls == 0 and all(time > 0.0 for time in times)
