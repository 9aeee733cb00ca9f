"""Orders that discovery tries without having seen them: by parts that turn and by facts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from flexspline.discovery import candidates
from flexspline.discovery.basis import ROUND, _fine, _motor_angle
from flexspline.discovery.candidates import (
    CORE_PAIRS,
    SeenOrders,
    _low,
    _of_facts,
    order_candidates,
    scanned,
)
from flexspline.discovery.search import _finite
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import effect
from flexspline.logs.log import Log
from flexspline.regression.candidate_model import _range, _size

GEAR = {"gear_ratio": 100.0, "output_spline": "circular"}


def orders(tried: list) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for order, pair in tried:
        found.setdefault(pair.name, []).append(order)
    return found


def test_low_orders_of_all_that_turns_are_tried_where_the_gear_ratio_is_known() -> None:
    tried = orders(_low(GEAR, seen=False))
    assert "output_housing" in tried and len(tried) > 1
    assert all(found == list(range(1, SETTINGS.tried + 1)) for found in tried.values())
    after = orders(_low(GEAR, seen=True))
    assert len(after["output_housing"]) == SETTINGS.functions > SETTINGS.tried
    assert {k: v for k, v in after.items() if k != "output_housing"} == {
        k: v for k, v in tried.items() if k != "output_housing"
    }


def test_without_a_gear_ratio_nothing_of_the_motor_is_tried() -> None:
    assert list(orders(_low({}, seen=False))) == ["output_housing"]
    assert _of_facts({"pole_pairs": 7, "slots": 36}) == []


def test_pole_pairs_and_slots_are_tried_once_and_twice_a_turn_of_the_motor() -> None:
    tried = orders(_of_facts({**GEAR, "pole_pairs": 7, "slots": 36}))
    assert tried == {"motor_stator": [7, 14, 36, 72]}
    assert _of_facts({**GEAR, "pole_pairs": 1}) == []  # these are the low orders


@pytest.mark.parametrize(
    ("sizes", "pairs", "order", "both"),
    [((1.0, 0.4), 4, 4, True), ((0.4, 1.0), 4, 4, False), ((1.0, 0.4), 6, 6, False)],
)
def test_twice_a_larger_order_of_the_wave_generator_may_be_its_own(
    sizes: tuple[float, float], pairs: int, order: int, both: bool
) -> None:
    """2 and 4 turns of the motor, with 4 pole pairs: one cause with an overtone, or two."""
    facts = {"gear_ratio": 100.0, "output_spline": "flexspline", "pole_pairs": pairs}
    found = [
        SimpleNamespace(order=k, pair="motor_stator", per_output_turn=100.0 * k, resolution=0.5,
                        amplitude=size, effect=name)
        for k, size, name in ((2, sizes[0], "wave_generator_ripple"), (order, sizes[1], "cogging"))
    ]  # fmt: skip
    names = ["cogging", "wave_generator_ripple"]
    orders_of = order_candidates(
        names, facts, SeenOrders(cast(Any, found)), (), "sensor_torque", 6.0
    )
    motor = CORE_PAIRS["motor_stator"]
    assert (order, motor) in orders_of["cogging"]
    assert ((order, motor) in orders_of["wave_generator_ripple"]) is both


def test_a_time_constant_is_looked_for_from_two_rows_to_half_of_the_longest_run() -> None:
    runs = [SimpleNamespace(log=Log.from_arrays(time=np.arange(n) / rate))
            for n, rate in ((401, 100.0), (4001, 200.0))]  # fmt: skip
    lag = effect("sensor_lag")
    (shape,) = (s for s in lag.info.shapes if s.unit == "s")
    low, high = _range(lag, shape, cast(Any, SimpleNamespace(runs=runs)))
    assert (low, high) == pytest.approx((2.0 / 200.0, 10.0))


def test_functions_over_a_turn_of_the_motor_are_all_its_low_orders() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    basis, count = _fine({ROUND: angle}, ROUND)
    columns = basis({ROUND: angle})
    assert columns.shape == (400, count)

    def left(order: int) -> float:
        wave = np.cos(order * angle + 0.3)
        return float(np.ptp(wave - columns @ np.linalg.lstsq(columns, wave, rcond=None)[0]))

    assert max(map(left, range(1, SETTINGS.functions + 1))) < 1e-9
    assert left(SETTINGS.functions + 1) > 1.0


def test_without_a_motor_encoder_the_motor_turns_as_the_gear_says() -> None:
    angle = np.linspace(-1.0, 2.0, 50)
    bare = Log.from_arrays(time=np.arange(50.0), output_position=angle, facts=GEAR)
    run, rows = cast(Any, SimpleNamespace(log=bare)), slice(10, 30)
    assert _motor_angle(run, rows) == pytest.approx(101.0 * angle[rows])
    encoder = bare.with_columns({"motor_position": 101.0 * angle + 0.1}, note="an encoder")
    run = cast(Any, SimpleNamespace(log=encoder))
    assert _motor_angle(run, rows) == pytest.approx(101.0 * angle[rows] + 0.1)


def test_the_size_of_a_channel_is_its_largest_without_the_outermost_half_per_cent() -> None:
    values = np.linspace(-1.0, 1.0, 20001)
    assert _size(values, "Nm") == pytest.approx(0.995)
    assert _size(values, "rad") == pytest.approx(0.99)


@pytest.mark.parametrize(
    ("pairs", "faint", "low"),
    [((), (), False), (("motor_stator",), (), False), (("output_housing",), (), True),
     ((), (SimpleNamespace(order=7),), True)],
)  # fmt: skip
def test_a_scan_that_is_not_certain_of_low_orders_has_more_of_them_tried(
    monkeypatch: pytest.MonkeyPatch, pairs: tuple[str, ...], faint: tuple[Any, ...], low: bool
) -> None:
    found = tuple(SimpleNamespace(pair=pair) for pair in pairs)
    scan = SimpleNamespace(found=found, faint=faint)
    monkeypatch.setattr(candidates, "find_orders", lambda *_, **__: scan)
    assert scanned([], [], "Nm") == SeenOrders(cast(Any, found), low)


def test_orders_of_two_scans_are_each_there_once_and_low_ones_stay_seen() -> None:
    def line(order: float) -> Any:
        return SimpleNamespace(per_output_turn=order, resolution=0.5)

    both = SeenOrders((line(3.0), line(100.0))).joined(SeenOrders((line(100.4), line(7.0)), True))
    assert [one.per_output_turn for one in both.found] == [3.0, 100.0, 7.0] and both.low
    assert SeenOrders((), True).joined(SeenOrders()).low


def test_where_nothing_turns_no_order_is_found() -> None:
    still = Log.from_arrays(time=np.arange(0.0, 5.0, 0.01), output_position=np.full(500, 0.3))
    assert scanned([still], [np.zeros(500)], "Nm") == SeenOrders()


def test_a_candidate_whose_channel_has_holes_is_left_out_with_the_log_that_has_them() -> None:
    time = np.arange(0.0, 5.0, 0.01)
    warm = np.where(time > 4.0, np.nan, 30.0)
    logs = [Log.from_arrays(time=time, temperature=np.full(500, 25.0), facts={"name": "whole"}),
            Log.from_arrays(time=time, temperature=warm, facts={"name": "holed"})]  # fmt: skip
    reasons: dict[str, str] = {}
    assert not _finite(effect("temperature_drift"), logs, reasons)
    assert "log 'holed': temperature is not finite" in reasons["temperature_drift"]
    assert _finite(effect("temperature_drift"), logs[:1], reasons)
