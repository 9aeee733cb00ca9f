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
