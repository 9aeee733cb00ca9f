"""Measured joints driven forward: from a motor's current, and from what a servo was told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from measured import ur10e, xl330

import flexspline
from flexspline.effects import effect
from flexspline.model import Model, Part

FRICTION = ["offset", "coulomb_friction", "viscous_friction", "inertia"]
HELD_OUT = ("10h28m17", "10h28m57", "10h29m37", "10h29m47")


def test_a_ur10e_joint_moves_by_its_current_as_it_did(data_folder: Path) -> None:
    """Fitted to the first half of joint 1's run, whose axis is upright; the second half driven."""
    log = ur10e(1)
    half = len(log) // 2
    first, second = log.rows(slice(0, half), note="first"), log.rows(slice(half, None), note="last")
    fit = flexspline.fit(FRICTION, first, target="motor_current", lowpass=5.0)
    made = flexspline.simulate(fit.model, second)
    assert np.std(made.measured) > 1.0
    assert made.rmse < 0.05
    assert made.step_error < 1e-5


def test_a_pendulum_follows_its_servo_as_it_did(data_folder: Path) -> None:
    """The XL330 of five numbers that were fitted to the other twelve runs, from its first row on.

    Mass and length are known; voltage drive, Coulomb and load friction. 109 mrad RMS with the
    numbers that its authors publish, 77 with Coulomb and viscous friction.
    """
    inertia, constant, back_emf, coulomb, load = 0.00646, 0.0771, 0.0341, 0.0272, 0.1611
    effects = ("inertia", "gravity", "coulomb_friction", "load_dependent_friction")
    values = np.array([inertia, 0.49 * 9.81 * 0.1, 0.0, coulomb, load])
    part = Part("motor_torque", tuple(effect(name) for name in effects), values)
    servo = flexspline.PositionServo(
        "kp",
        gain_scale=4096 / (2 * np.pi) / (256 * 885),
        torque=constant,
        back_emf=back_emf,
        supply=True,
        encoder_step=2 * np.pi / 4096,
    )
    logs = [xl330(name).with_facts({"gear_ratio": 1.0}) for name in HELD_OUT]
    made = flexspline.simulate(Model({"drive": part}), logs, controller=servo)
    each = [run.rmse for run in made]
    assert np.sqrt(np.mean(np.square(each))) < 0.056
    assert max(each) < 0.075
    assert max(run.step_error for run in made) < 1e-5
