"""Orders that a fit finds by itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from fit_logs import autoregressive

import flexspline
from flexspline.least_squares.ripple import _empty, _only_by_fit
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
