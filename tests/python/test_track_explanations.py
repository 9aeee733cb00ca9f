"""What explains a change other than wear: a zero that moved, and what the sessions ran."""

from __future__ import annotations

import json

import numpy as np
import pytest
from worn_joints import worn_history

from flexspline.tracking import Track, track

GRAVITY = ("gravity.cosine", "gravity.sine", "coulomb_friction.level")
ERRORS = (0.02, 0.02, 0.1)


def turned_joint(turn: float, share: float = 1.0, phase: float = 0.3, seed: int = 2) -> Track:
    """Gravity of 4 Nm that turns by an angle and becomes a share of itself in session 40."""
    before, after = 4.0 * np.exp(1j * phase), 4.0 * share * np.exp(1j * (phase + turn))
    moved = after - before
    worn = {
        name: lambda weeks, size=size: size / ERRORS[0] * (weeks >= 40)
        for name, size in zip(GRAVITY, (moved.real, moved.imag), strict=False)
    }
    return track(
        worn_history(
            seed, names=GRAVITY, levels=(before.real, before.imag, 6.0), noises=ERRORS,
            units=("Nm",) * 3, worn=worn, per_kelvin=0.0,
        )
    )  # fmt: skip


@pytest.mark.parametrize("turn", [0.06, -0.06, 0.6, 2.0, np.pi])
def test_gravity_that_only_turned_is_a_zero_that_moved_and_no_mass(turn: float) -> None:
    made = turned_joint(turn)
    (change,) = made.changes
    assert change.turned is not None
    off = (np.radians(change.turned.degrees) - turn + np.pi) % (2.0 * np.pi) - np.pi
    assert abs(off) < 4.0 * np.radians(change.turned.error) < 0.02
    assert "The direction of gravity turned at once by" in change.sentence
    assert "zero of the encoder" in change.sentence
    assert "zero of its encoder" in made.verdict
    assert "mass has changed" not in made.verdict
    (told,) = json.loads(made.to_json())["changes"]
    assert told["turned"]["degrees"] == change.turned.degrees


@pytest.mark.parametrize(("turn", "share"), [(0.0, 1.1), (0.3, 1.2), (0.0, 0.5), (0.06, 0.9)])
def test_gravity_that_grew_or_shrank_is_a_mass_whether_it_turned_or_not(
    turn: float, share: float
) -> None:
    made = turned_joint(turn, share)
    assert all(change.turned is None for change in made.changes)
    assert "a mass has changed" in made.verdict


def other_motion(week: int, viscous: float = -4.0, **more: object) -> Track:
    """Friction steps in session 40; from another session on the motion is slower."""
    rng = np.random.default_rng(7)
    speed = np.where(np.arange(80) < week, 1.5, 0.35) * rng.uniform(0.8, 1.0, 80)
    ranges = {
        "output_velocity": np.column_stack([-speed, speed]),
        "output_position": np.tile([-1.0, 1.0], (80, 1)),
    }
    names = ("coulomb_friction.level", "viscous_friction.viscosity")
    return track(
        worn_history(
            1, names=names, levels=(6.0, 3.0), noises=(0.1, 0.1), units=("Nm", "Nm·s/rad"),
            worn={names[1]: lambda weeks: 10.0 * viscous * (weeks >= 40)}, ranges=ranges, **more,
        )
    )  # fmt: skip


def test_a_motion_that_changed_with_a_level_that_no_drive_has_is_the_likelier_cause() -> None:
    made = other_motion(40, target="motor_torque")
    (change,) = made.changes
    (other,) = change.ranges
    assert other.channel == "output_velocity" and other.unit == "rad/s"
    assert other.before[1] > 1.2 > 0.35 >= other.since[1]
    assert "a form that the model lacks is likelier" in change.sentence
    assert "lubricant" not in made.verdict and "sessions that run as before" in made.verdict
    (told,) = json.loads(made.to_json())["changes"]
    assert told["ranges"][0]["channel"] == "output_velocity"


def test_a_motion_that_changed_with_friction_may_be_its_cause_or_come_of_it() -> None:
    """Friction that grows slows a joint that is driven by a torque."""
    made = other_motion(40, 4.0, target="motor_torque")
    (change,) = made.changes
    assert change.ranges and not change.negative and not change.misled
    assert "may be why it seems to change, or what comes of it" in change.sentence
    assert "lubricant" in made.verdict and "sessions that run as before" in made.verdict


@pytest.mark.parametrize("week", [10, 25, 55, 80])
def test_a_motion_that_changed_at_another_date_is_none(week: int) -> None:
    made = other_motion(week)
    (change,) = made.changes
    assert change.ranges == () and "lubricant" in made.verdict


def test_friction_below_zero_is_said_to_be_none_that_a_drive_has() -> None:
    made = other_motion(80, target="motor_torque")
    assert any("is negative friction, which no drive has" in each for each in made.sentences)
    assert "lubricant" not in made.verdict and made.changes[0].negative
    for other in (other_motion(80, target="sensor_torque"), other_motion(80, -2.0)):
        assert not other.changes[0].negative and "negative" not in str(other)
