"""A long log is searched in part first, and answered for by all its rows."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fit_logs import WIDTH
from hidden_logs import LOAD, RATIO, friction_of, log_of, noise, rich_run

import flexspline
from flexspline.discovery import search
from flexspline.discovery.candidates import SeenOrders
from flexspline.discovery.search import LEAD
from flexspline.discovery.settings import SETTINGS
from flexspline.regression.candidate_model import CandidateModel
from flexspline.regression.gram import rows_of, thinned

BASE = ("offset", "coulomb_friction", "viscous_friction", "inertia")


def long_log() -> flexspline.Log:
    c = rich_run(3, 30_000)
    hidden = 0.008 * np.abs(c[LOAD]) * np.tanh(c["output_velocity"] / WIDTH)
    torque = friction_of(c) + hidden + c[LOAD] + noise(3, 30_000, 0.02)
    return log_of(c, sensor_torque=torque)


def test_parts_of_a_long_log_lie_evenly_over_all_of_it() -> None:
    made = search.search_context_of(
        [flexspline.effect(name) for name in BASE],
        [long_log()],
        "sensor_torque",
        known_load=LOAD,
        lowpass_hz=None,
        threads=1,
    )
    part = thinned(made.problem, 3000, 300, LEAD)
    (run,) = part.runs
    assert rows_of(part) == pytest.approx(3000, rel=0.02)
    assert len(run.stretches) == 10
    assert np.ptp(np.diff([first for first, _ in run.stretches])) <= 1
    assert thinned(part, 3000, 300, LEAD) is part


def test_orders_are_looked_for_in_all_rows_of_a_log_that_is_searched_in_part(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A quarter of 144 000 rows in pieces told neither of two orders that all of them are sure of.

    Of a log of more than twenty times the rows searched, as many as ten times these are seen.
    """
    seen: list[int] = []

    def scanned(_: Any, residuals: Sequence[Any], unit: str) -> SeenOrders:
        assert unit == "Nm"
        seen.append(sum(int(np.isfinite(rest).sum()) for rest in residuals))
        return SeenOrders()

    monkeypatch.setattr(search, "scanned", scanned)
    for rows, least in ((2000, 29_000), (1000, 9_000)):
        monkeypatch.setattr(search, "SETTINGS", replace(SETTINGS, rows=rows))
        flexspline.discover(BASE, long_log(), target="sensor_torque", known_load=LOAD)
        assert len(seen) == 2 and min(seen) > least >= 0.8 * max(seen)
        seen.clear()


def test_evidence_of_a_log_searched_in_part_is_that_of_all_rows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def found(rows: int) -> flexspline.Discovery:
        monkeypatch.setattr(search, "SETTINGS", replace(SETTINGS, rows=rows))
        return flexspline.discover(BASE, long_log(), target="sensor_torque", known_load=LOAD)

    whole, in_part = found(30_000), found(1000)
    names = [one.effect for one in whole.found]
    assert "load_dependent_friction" in names
    assert [one.effect for one in in_part.found] == names
    for one, other in zip(whole.found, in_part.found, strict=True):
        assert other.t == pytest.approx(one.t, rel=0.2)  # a thirtieth has a fifth of it
    assert whole.searched["names"] == 1.0 and "searched for names first" not in str(whole)
    assert in_part.searched["names"] == pytest.approx(1.0 / 30.0, rel=0.05)
    assert json.loads(in_part.to_json())["searched"] == in_part.searched
    assert "3 % of the rows" in str(in_part)
    assert in_part.final_rmse == pytest.approx(whole.final_rmse, rel=0.01)


def test_a_ripple_has_the_orders_that_all_rows_show_and_a_part_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A thirtieth of the rows shows order 4 by two standard errors, all of them by twelve."""
    monkeypatch.setattr(search, "SETTINGS", replace(SETTINGS, rows=1000))
    c = rich_run(3, 30_000)
    c["motor_position"] = RATIO * c["output_position"]
    turned = c["motor_position"] - c["output_position"]  # of the wave generator in its spline
    ripple = 0.02 * np.sin(2.0 * turned) + 0.002 * np.sin(4.0 * turned)
    torque = friction_of(c) + ripple + c[LOAD] + noise(3, 30_000, 0.02)
    log = log_of(c, sensor_torque=torque)
    made = flexspline.discover(BASE, log, target="sensor_torque", known_load=LOAD)
    (effect,) = (e for e in made.model.part().effects if e.name == "wave_generator_ripple")
    assert sorted(order for order, _ in effect.harmonics) == [2, 4]


@pytest.mark.parametrize(("amplitude", "all_rows"), [(0.02, False), (0.0015, True)])
def test_all_rows_are_searched_only_where_a_part_leaves_doubt(
    monkeypatch: pytest.MonkeyPatch, amplitude: float, all_rows: bool
) -> None:
    """No name explains load times the angle's sine; of a small one a part does not tell that."""
    monkeypatch.setattr(search, "SETTINGS", replace(SETTINGS, rows=1000))
    searched, again = [], search.Searcher.again

    def watched(self: search.Searcher, work: CandidateModel) -> CandidateModel:
        searched.append(rows_of(self.context.problem))
        return again(self, work)

    monkeypatch.setattr(search.Searcher, "again", watched)
    c = rich_run(3, 30_000)
    hidden = amplitude * c[LOAD] * np.sin(c["output_position"])
    torque = friction_of(c) + hidden + c[LOAD] + noise(3, 30_000, 0.02)
    log = log_of(c, sensor_torque=torque)
    made = flexspline.discover(BASE, log, target="sensor_torque", known_load=LOAD)
    assert [one.effect for one in made.found] == []
    assert searched == ([30_000] if all_rows else [])
    if not all_rows:
        assert made.unexplained is not None and made.unexplained.share_of_variance > 0.9
