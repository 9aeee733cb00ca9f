"""Orders that a fit finds by itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from fit_logs import autoregressive

import flexspline
from flexspline.least_squares.ripple import _empty, _only_by_fit, ripple_orders
from flexspline.logs import Log
from flexspline.orders import OrderAnalysis, find_orders
from flexspline.rigs import sensor_rig

SMOOTH = ["offset", "coulomb_friction", "viscous_friction"]
WIDTH = {"direction_width": 0.02}


def run(seed: int, ripple: float = 0.05) -> Log:
    """Two full turns each way with order 3 of the output and order 2 of the motor (ratio 50)."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 24.0, 0.004)
    v = 1.1 * np.sign(np.sin(2 * np.pi * t / 24.0 + 1e-9)) * (1 + 0.2 * np.sin(0.9 * t + seed))
    q = np.cumsum(v) * 0.004 + seed
    y = 0.1 + 0.3 * np.tanh(v / 0.02) + 0.1 * v
    y += ripple * np.cos(3 * q + 0.4) + 0.6 * ripple * np.sin(100 * q)
    y += autoregressive(rng, len(t), innovation=0.01)
    return Log.from_arrays(
        time=t,
        output_position=q,
        output_velocity=v,
        sensor_torque=y,
        facts={"name": f"run {seed}", "gear_ratio": 50},
    )


def fitted(effects: list[str], logs: list[Log]) -> flexspline.Fit:
    return flexspline.fit(effects, logs, "sensor_torque", checks=False, fixed=WIDTH)


def test_orders_left_open_are_found_with_their_amplitudes() -> None:
    fit = fitted([*SMOOTH, "output_ripple", "wave_generator_ripple"], [run(k) for k in range(4)])
    orders = {e.name: [o for o, _ in e.harmonics] for e in fit.part.effects if e.ripple}
    assert orders == {"output_ripple": [3], "wave_generator_ripple": [2]}
    cosine, sine = fit["output_ripple.cosine 3"], fit["output_ripple.sine 3"]
    assert abs(cosine.value - 0.05 * np.cos(0.4)) < 4 * cosine.standard_error
    assert abs(sine.value + 0.05 * np.sin(0.4)) < 4 * sine.standard_error
    assert fit.orders is not None and len(fit.orders) >= 2


def test_an_effect_left_out_of_one_run_is_not_said_to_differ_between_runs() -> None:
    analysis = cast(
        OrderAnalysis, [SimpleNamespace(effect="kinematic_error", per_output_turn=14.592)]
    )
    said = _empty(analysis, "kinematic_error")
    assert "orders 14.592 per output turn" in said and "runs" not in said
    assert "none of them from zero" in said


def test_an_order_whose_steady_part_is_within_its_error_has_no_phase() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 24.0, 0.004)
    v = 1.1 * np.sign(np.sin(2 * np.pi * t / 24.0 + 1e-9))
    q = np.cumsum(v) * 0.004
    wave = np.cos(3 * q + np.where(v > 0, 0.0, np.pi))  # of opposite phase in both directions
    values = 0.05 * wave + 0.01 * rng.standard_normal(len(t))
    log = Log.from_arrays(time=t, output_position=q, output_velocity=v, facts={"gear_ratio": 50})
    found = find_orders(log, [values], unit="Nm", channel="residual of torsion")
    (row,) = (cells for cells in found._cells() if cells[2] == "3")
    assert row[6] == "–"
    assert found._title().startswith("residual of torsion [Nm]: 1 order")
    bare = find_orders(log, [values], channel="gain")
    assert bare._title().startswith("gain: 1 order")


@pytest.mark.parametrize("first", [0, 118, 310])
def test_a_strong_order_over_part_of_a_turn_is_found_and_not_its_side_lobes(first: int) -> None:
    # stretches of a third to half a turn, at many speeds, over waves that they see a part of
    logs = sensor_rig(4, rate=200.0).logs
    effects = [*SMOOTH, "inertia", "stribeck_friction", "temperature_drift"]
    fit = flexspline.fit(effects, logs, "sensor_torque", checks=False)
    rest = [np.where(np.arange(len(r.measured)) < first, np.nan, r.residual) for r in fit.runs]
    found = find_orders(logs, rest, unit="Nm")
    assert [(f.order, f.pair) for f in found] == [(2, "wave_generator_flexspline")]


def test_without_ripple_an_open_effect_is_left_out_and_the_fit_says_so() -> None:
    fit = fitted([*SMOOTH, "output_ripple"], [run(k, ripple=0.0) for k in range(4)])
    assert [e.name for e in fit.part.effects] == SMOOTH
    assert any("no order of output_ripple stands out" in w for w in fit.warnings)


def test_an_order_whose_owner_is_not_in_the_model_is_named() -> None:
    fit = fitted([*SMOOTH, "output_ripple"], [run(k) for k in range(4)])
    assert any(
        "100 per output turn" in w and "wave_generator_ripple, which is not in the model" in w
        for w in fit.warnings
    )


def swung(seed: int, reach: float, ripple: float = 0.16) -> Log:
    """A link of 9 Nm that swings `reach` rad to either side, read with order 2 of the output."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 40.0, 0.01)
    q = np.zeros_like(t)
    for size, slow, fast in [(1.0, 0.03, 0.1), (0.5, 0.1, 0.2), (0.3, 0.2, 0.3)]:
        turned = 2 * np.pi * rng.uniform(slow, fast) * t + rng.uniform(0.0, 2 * np.pi)
        q += reach / 1.8 * size * np.sin(turned)
    y = 4.0 * np.sin(q) + 9.0 * np.cos(q) + ripple * np.cos(2 * q - 0.3)
    y += rng.normal(0.0, 0.02, len(t))
    facts = {"name": f"run {seed}", "gear_ratio": 100}
    return Log.from_arrays(time=t, output_position=q, sensor_torque=y, facts=facts)


def beside_gravity(logs: list[Log]) -> tuple[flexspline.Fit, list[int]]:
    effects = ["offset", "gravity", "output_ripple"]
    fit = flexspline.fit(effects, logs, "sensor_torque", checks=False)
    return fit, [order for e in fit.part.effects if e.ripple for order, _ in e.harmonics]


@pytest.mark.parametrize("seed", [10, 20, 30, 40])
def test_over_part_of_a_turn_an_order_is_found_that_offset_and_gravity_would_hide(
    seed: int,
) -> None:
    fit, orders = beside_gravity([swung(seed + k, reach=2.2) for k in range(3)])
    assert orders == [2]
    for name, true in [("offset", 0.0), ("gravity.sine", 4.0), ("gravity.cosine", 9.0)]:
        assert abs(fit[name].value - true) < 4 * fit[name].standard_error, name


def test_orders_found_over_part_of_a_turn_are_warned_of_in_the_verdict() -> None:
    fit, _ = beside_gravity([swung(10 + k, reach=2.2) for k in range(3)])
    (said,) = [one for one in fit.warnings if "look alike" in one]
    assert "of a turn of the output, over which orders of output_ripple look alike" in said
    assert "Check before use: 1 warning" in " ".join(str(fit).split())


def test_over_part_of_a_turn_no_order_is_made_up_where_there_is_no_ripple() -> None:
    fit, orders = beside_gravity([swung(10 + k, reach=2.2, ripple=0.0) for k in range(3)])
    assert orders == []
    assert not any("look alike" in one for one in fit.warnings)


def test_over_whole_turns_order_1_is_gravity_and_none_of_the_ripple() -> None:
    fit, orders = beside_gravity([swung(10 + k, reach=4.5) for k in range(3)])
    assert orders == [2]
    assert fit["gravity.cosine"].determined
    assert not any("look alike" in one for one in fit.warnings)


def test_given_orders_are_taken_as_they_are() -> None:
    fit = flexspline.fit(
        [*SMOOTH, "output_ripple"],
        [run(0)],
        "sensor_torque",
        checks=False,
        fixed=WIDTH,
        orders={"output_ripple": [1, 3]},
    )
    assert fit.orders is None
    assert [o for o, _ in fit.part.effects[-1].harmonics] == [1, 3]


def test_only_orders_of_the_output_that_the_analysis_doubts_are_said_to_be_the_fits_own() -> None:
    def order(number: int) -> SimpleNamespace:
        return SimpleNamespace(order=number)

    found = cast(OrderAnalysis, SimpleNamespace(faint=[order(2), order(4)]))
    filled = {
        "output_ripple": flexspline.effect("output_ripple", orders=[2, 8]),
        "cogging": flexspline.effect("cogging", orders=[4, 7]),
    }
    (said,) = _only_by_fit(found, filled)
    assert said.startswith("orders 2 per output turn are in the model")
    assert _only_by_fit(found, {"cogging": filled["cogging"]}) == []


def late_swing(rows_late: int, seed: int, amplitude: float = 0.3) -> Log:
    """A sensor, late by so many rows of 2 ms, beside a load cell; order 2 of the motor at 100."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 40.0, 0.002)
    f, p, a = (
        rng.uniform(0.03, 0.25, 4),
        rng.uniform(0, 6.28, 4),
        2.6 * np.array([1, 0.5, 0.3, 0.2]),
    )
    q = np.sin(2 * np.pi * f * t[:, None] + p) @ a
    v = np.cos(2 * np.pi * f * t[:, None] + p) @ (2 * np.pi * f * a)
    load = 8.0 * np.sin(0.7 * t + seed) + 4.0 * np.sin(1.9 * t)
    read = load + 2.0 * np.cos(q) + amplitude * np.cos(200 * q) + rng.normal(0, 0.05, len(t))
    read[rows_late:] = read[: len(t) - rows_late]
    return Log.from_arrays(
        time=t,
        output_position=q,
        output_velocity=v,
        motor_position=100 * q + rng.normal(0, 3e-5, len(t)),
        reference_torque=load + rng.normal(0, 0.03, len(t)),
        sensor_torque=read,
        facts={"name": f"swung {seed}", "gear_ratio": 100},
    )


def of_the_motor(rows_late: int, amplitude: float = 0.3) -> flexspline.Fit:
    return flexspline.fit(
        ["offset", "gravity", "wave_generator_ripple"],
        [late_swing(rows_late, seed, amplitude) for seed in (1, 2)],
        "sensor_torque",
        known_load="reference_torque",
        orders={"wave_generator_ripple": [2]},
    )


@pytest.mark.parametrize("rows_late", [0, 1, 2])
def test_a_sensor_that_is_late_is_said_to_take_part_of_the_ripple(rows_late: int) -> None:
    fit = of_the_motor(rows_late)
    said = [w for w in fit.warnings if "later than reference_torque" in w]
    (order,) = ripple_orders(fit)
    kept = order.amplitude / 0.3
    assert bool(said) is (rows_late > 0) is bool(kept < 0.95)
    assert "No problem" in str(fit) or rows_late
    for warning in said:
        late = float(warning.split("shift=sensor_torque:")[1].split()[0])
        assert late == pytest.approx(0.002 * rows_late, rel=0.4)
        lost = float(warning.split("takes ")[1].split(" %")[0]) / 100
        speed = np.concatenate([run.log["output_velocity"] for run in fit.runs])
        assert 1 - kept == pytest.approx(1 - abs(np.mean(np.exp(200j * speed * 0.002 * rows_late))),
                                         abs=0.03)  # fmt: skip
        assert lost == pytest.approx(1 - kept, abs=0.3)  # of a delay known to a third


def test_a_ripple_that_turns_slowly_is_not_said_to_be_lost_to_a_delay() -> None:
    fit = flexspline.fit(
        ["offset", "gravity", "output_ripple"],
        [late_swing(3, seed, 0.0) for seed in (1, 2)],
        "sensor_torque",
        known_load="reference_torque",
        orders={"output_ripple": [2]},
    )
    assert fit.delay is not None and -fit.delay.seconds > 3 * fit.delay.standard_error
    assert not any("later than" in warning for warning in fit.warnings)


def test_without_a_stated_spline_an_order_of_the_wave_generator_is_the_motors() -> None:
    (order,) = ripple_orders(of_the_motor(0))
    assert (order.turns, order.per_output_turn) == ("the motor", 200.0)
