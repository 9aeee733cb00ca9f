"""Friction and ripple over the joint's angle, where a run shows only a part of a turn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from fit_logs import WIDTH
from numpy.typing import NDArray
from recorded_joint import FACTS, LEVEL, LOAD, RATIO, base, exact, friction

import flexspline
from flexspline.discovery.candidates import unseen
from flexspline.discovery.result import Discovery
from flexspline.effects import Effect, effect
from flexspline.logs.log import Log

Array = NDArray[np.float64]

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


def over(span: float, added: Callable[[dict[str, Array]], Array], seed: int) -> Log:
    """A run over `span` rad, with something added to its friction, Nm."""
    c = exact(seed)
    share = span / float(np.ptp(c["output_position"]))
    for name in ("output_position", "output_velocity", "output_acceleration"):
        c[name] = share * c[name]
    noise = np.random.default_rng([seed, 79]).normal(0.0, 0.01, len(c["time"]))
    torque = friction(c) + added(c) + noise + c[LOAD]
    return Log.from_arrays(facts={"name": f"run{seed}", **FACTS}, **c, sensor_torque=torque)


def found(span: float, added: Callable[[dict[str, Array]], Array]) -> Discovery:
    logs = [over(span, added, seed) for seed in range(4)]
    return flexspline.discover(base(), logs, target="sensor_torque", known_load=LOAD)


@pytest.mark.parametrize("orders", [(8, 16), (5, 10), (7,)])
def test_ripple_of_the_output_is_found_at_any_order_over_a_part_of_a_turn(
    orders: tuple[int, ...],
) -> None:
    """Over 2 rad a scan tells orders that lie three apart, and takes one for two."""
    made = found(2.0, lambda c: sum(0.05 * np.cos(k * c["output_position"] + k) for k in orders))
    assert made.names == ("output_ripple",)
    (own,) = (e for e in made.model.part("sensor_torque").effects if e.name == "output_ripple")
    assert {order for order, _ in own.harmonics} == {*orders}


@pytest.mark.parametrize("width", [0.05, 0.15])
def test_a_bump_at_one_angle_is_no_ripple(width: float) -> None:
    """Orders up to twenty follow it; but it does not come again."""

    def bump(c: dict[str, Array]) -> Array:
        q = c["output_position"]
        return np.asarray(0.2 * np.exp(-0.5 * ((q - 0.2) / width) ** 2))

    made = found(2.0, bump)
    assert made.names == () and made.unexplained is not None
    assert "output_position" in made.unexplained.depends_on


def test_what_a_large_ripple_leaves_is_no_small_friction_but_a_small_friction_is() -> None:
    """Ripple is off by what its amplitude does over angle and speed, and that is asked for."""

    def ripple(c: dict[str, Array]) -> Array:
        return np.asarray(np.cos(RATIO * c["output_position"] + 0.3))

    def heated(c: dict[str, Array]) -> Array:
        c["temperature"] = 25.0 + 10.0 * c["time"] / c["time"][-1]
        return np.asarray(-0.02 * c["output_velocity"] * (c["temperature"] - 25.0))

    made = found(2.0, lambda c: ripple(c) + heated(c))
    assert made.names == ("wave_generator_ripple", "temperature_dependent_friction")
