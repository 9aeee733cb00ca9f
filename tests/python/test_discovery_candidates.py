"""Orders that discovery tries without having seen them: by parts that turn and by facts."""

from __future__ import annotations

from flexspline.discovery.candidates import _low, _of_facts
from flexspline.discovery.settings import SETTINGS

GEAR = {"gear_ratio": 100.0, "output_spline": "circular"}


def orders(tried: list) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for order, pair in tried:
        found.setdefault(pair.name, []).append(order)
    return found


def test_low_orders_of_all_that_turns_are_tried_where_the_gear_ratio_is_known() -> None:
    tried = orders(_low(GEAR, scanned_out=False))
    assert "output_housing" in tried and len(tried) > 1
    assert all(found == list(range(1, SETTINGS.tried + 1)) for found in tried.values())
    scanned = orders(_low(GEAR, scanned_out=True))
    assert len(scanned["output_housing"]) == SETTINGS.functions > SETTINGS.tried
    assert {k: v for k, v in scanned.items() if k != "output_housing"} == {
        k: v for k, v in tried.items() if k != "output_housing"
    }


def test_without_a_gear_ratio_nothing_of_the_motor_is_tried() -> None:
    assert list(orders(_low({}, scanned_out=False))) == ["output_housing"]
    assert _of_facts({"pole_pairs": 7, "slots": 36}) == []


def test_pole_pairs_and_slots_are_tried_once_and_twice_a_turn_of_the_motor() -> None:
    tried = orders(_of_facts({**GEAR, "pole_pairs": 7, "slots": 36}))
    assert tried == {"motor_stator": [7, 14, 36, 72]}
    assert _of_facts({**GEAR, "pole_pairs": 1}) == []  # these are the low orders
