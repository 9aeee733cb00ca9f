"""Friction over the joint's angle, where a run shows only a part of a turn."""

from __future__ import annotations

import numpy as np
import pytest
from fit_logs import WIDTH
from recorded_joint import LEVEL, LOAD, base, exact, friction

import flexspline
from flexspline.discovery.candidates import unseen
from flexspline.effects import Effect, effect
from flexspline.logs.log import Log

WAVES = Effect("position_dependent_friction")


@pytest.mark.parametrize(("span", "held"), [(0.3, 4), (0.6, 4), (1.0, 2), (1.6, 0), (9.0, 0)])
def test_of_an_order_a_quarter_of_a_period_has_to_be_seen(span: float, held: int) -> None:
    """Order 1 from π/2 rad on, 2 from half of that; 3, the fastest, at any span."""
    assert unseen(WAVES, span) == [*range(held)]


def test_what_does_not_wave_over_the_angle_is_always_seen() -> None:
    for name in ("gravity", "presliding_friction", "viscous_friction"):
        assert unseen(Effect(name), 0.01) == []
    assert unseen(effect("output_ripple").with_orders([(1, "output_on_housing")]), 0.01) == []


def short(seed: int) -> Log:
    """A run over an eighth of a turn, whose friction is higher at both ends than in the middle."""
    c = exact(seed)
    for name in ("output_position", "output_velocity", "output_acceleration"):
        c[name] = 0.1 * c[name]
    q = c["output_position"] - np.mean(c["output_position"])
    more = 0.3 * (q / np.ptp(q)) ** 2 * np.tanh(c["output_velocity"] / WIDTH)
    noise = np.random.default_rng([seed, 77]).normal(0.0, 0.005, len(q))
    return Log.from_arrays(
        facts={"name": f"run{seed}"}, **c, sensor_torque=friction(c) + more + noise + c[LOAD]
    )


def test_a_part_of_a_turn_tells_no_friction_of_hundreds_of_newton_metres() -> None:
    """All orders of a turn would cancel each other by many times what they explain together."""
    logs = [short(seed) for seed in range(4)]
    span = max(float(np.ptp(log["output_position"])) for log in logs)
    made = flexspline.discover(base(), logs, target="sensor_torque", known_load=LOAD)
    assert made.names == ("position_dependent_friction",)
    own = {p.name.split(".")[1]: p for p in made.parameters("position_dependent_friction")}
    held = [n for n, p in own.items() if p.state == "fixed"]
    assert held == ["cosine 1", "sine 1"] and 0.79 < span < 1.57
    assert max(abs(p.value) for p in own.values()) < 10.0 * LEVEL
