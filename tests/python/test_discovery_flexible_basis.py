"""What stands for a cause without a name, and what does not save a wrong one. A second together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hidden_logs import LOAD, log_of, rich_run
from scipy.signal import lfilter

from flexspline.discovery import assemble
from flexspline.discovery.analysis import Rival
from flexspline.discovery.basis import PAST, ROUND, Functions, flexible_basis, past_of
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.unexplained import (
    ExplainableBound,
    Repeated,
    kept,
    leftover_in,
    leftover_of,
    repeated,
)
from flexspline.effects import effect
from flexspline.least_squares.problem import Problem, problem_of
from flexspline.regression.candidate_model import HeldOut, candidate_model_of, held_out, solved_at
from flexspline.regression.gram import Table, Whitening

Array = np.ndarray
ROWS = 2000


def problem() -> Problem:
    logs = [log_of(rich_run(3, ROWS), sensor_torque=np.zeros(ROWS))]
    base = [effect("offset")]
    return problem_of(logs, base, "sensor_torque", known_load=LOAD, lowpass_hz=None, threads=1)


def left_by(names: tuple[str, ...], values: Array) -> float:
    """Share of the squares of values that the best functions of some channels leave."""
    here = problem()
    left = []
    for group in (g for g in flexible_basis(here) if set(g.channels) == set(names)):
        made = np.column_stack([np.ones(ROWS), Functions((group,)).rows(here, 0, slice(0, ROWS))])
        rest = values - made @ np.linalg.lstsq(made, values, rcond=1e-10)[0]
        left.append(float(rest @ rest / np.sum((values - values.mean()) ** 2)))
    return min(left)


def test_a_coefficient_that_waves_with_another_channel_is_held_and_its_waves_alone_are_not() -> (
    None
):
    c = rich_run(3, ROWS)
    cause = np.sin(0.9 * c[LOAD]) * c["motor_torque"]
    assert left_by((LOAD, "motor_torque"), cause) < 0.1
    assert left_by((LOAD,), cause) > 0.5
    assert left_by(("motor_torque",), cause) > 0.5


def test_heat_that_flows_through_two_masses_is_held_by_the_past_of_a_temperature() -> None:
    c = rich_run(3, ROWS)
    time, warm = c["time"], c["temperature"]
    stages = [warm]
    for lag in (1.7, 0.4):
        late = np.empty(ROWS)
        late[0] = stages[-1][0]
        for k in range(1, ROWS):
            late[k] = late[k - 1] + (stages[-1][k] - late[k - 1]) * (time[k] - time[k - 1]) / lag
        stages.append(late)
    assert left_by(("temperature",), warm - stages[-1]) < 0.01


def test_the_past_begins_anew_behind_a_gap_and_forgets_at_its_own_pace() -> None:
    time = np.concatenate([np.arange(400) / 100.0, 60.0 + np.arange(400) / 100.0])
    values = np.where(np.arange(800) < 200, 0.0, np.where(np.arange(800) < 400, 1.0, 5.0))
    made = past_of(time, {"temperature": values}, ["temperature", "absent"], 30.0)
    assert list(made) == ["temperature" + PAST]
    behind = made["temperature" + PAST].T
    for late, lag in zip(behind, np.geomspace(0.02, 15.0, len(behind)), strict=True):
        assert late[:200] == pytest.approx(0.0)
        assert late[200 + 99] == pytest.approx(-np.expm1(-1.0 / lag), abs=1e-9)
        assert late[400:] == pytest.approx(5.0)


def table_of(name: Array, function: Array, values: Array) -> Table:
    """One fold of columns [name, function] and values, in noise of size one."""
    both = np.column_stack([name, function, values])
    return Table((both.T @ both)[None], np.array([len(both)]))


@pytest.mark.parametrize(("cause", "share"), [(0.1, 0.01), (-0.8, 0.0), (0.0, 0.0)])
def test_a_sliver_of_its_column_does_not_save_a_name(cause: float, share: float) -> None:
    """A function holds all but a hundredth of a name; the cause follows the rest as it may."""
    function, sliver = np.random.default_rng(11).normal(size=(2, 40_000))
    name = function + 0.1 * sliver
    table = table_of(name, function, function + cause * sliver)
    free = table.without(np.array([1]))
    assert free[0, -1] ** 2 / free[0, 0] == pytest.approx(40_000 * cause**2, rel=0.05)
    left = kept(table, np.array([0]), np.array([], dtype=np.intp), np.array([1]))
    assert left == pytest.approx(share, abs=0.001)


def rival(gain: float, adds: float) -> Rival:
    return Rival(effect("gravity"), gain, own=1000.0, left=31.6, adds=adds, form=0.007)


def test_a_plainer_form_stands_for_a_name_only_where_it_lacks_what_a_form_may_miss() -> None:
    assert rival(gain=960.0, adds=0.0).inside
    assert not rival(gain=880.0, adds=0.0).inside  # it keeps eleven standard errors
    assert not rival(gain=960.0, adds=4.0).inside  # it explains something else as well


def places(seed: int) -> Problem:
    """Four runs of noise, each at angles where no other goes."""
    logs = []
    for number in range(4):
        c = rich_run(seed + number, ROWS)
        c["output_position"] = c["output_position"] + 4.0 * number
        torque = c[LOAD] + np.random.default_rng([seed, number]).normal(0.0, 0.02, ROWS)
        logs.append(log_of(c, sensor_torque=torque))
    return problem_of(
        logs, [effect("offset")], "sensor_torque", known_load=LOAD, lowpass_hz=None, threads=1
    )


@pytest.mark.parametrize("seed", range(10, 16))
def test_functions_of_noise_go_nowhere_in_places_that_no_other_run_has_seen(seed: int) -> None:
    here = places(seed)
    work = candidate_model_of([effect("offset")], 1, {})
    plain = Whitening(np.ones(1), 0.02**2, 1)
    work, _ = solved_at(here, work, plain)
    alone = held_out(here, work, plain).rmse
    crossed = [g for g in flexible_basis(here) if "output_position" in g.channels and g.count > 20]
    assert crossed
    beside = held_out(here, work, plain, Functions(tuple(crossed[:3]))).rmse
    assert beside < 1.02 * alone


def test_functions_that_explain_are_not_shrunk_away() -> None:
    c = rich_run(3, ROWS)
    cause = np.tanh(3.0 * c["output_velocity"])
    logs = [log_of(c, sensor_torque=c[LOAD] + cause)]
    here = problem_of(
        logs, [effect("offset")], "sensor_torque", known_load=LOAD, lowpass_hz=None, threads=1
    )
    plain = Whitening(np.ones(1), 0.1**2, 1)
    work, _ = solved_at(here, candidate_model_of([effect("offset")], 1, {}), plain)
    best = min(
        held_out(here, work, plain, Functions((group,))).rmse
        for group in flexible_basis(here)
        if group.channels == ("output_velocity",)
    )
    assert best < 0.1 * held_out(here, work, plain).rmse


def held_out_of(cause: Callable[[dict[str, Array]], Array], seed: int) -> HeldOut:
    """A cause in noise with a memory of a tenth of a run, beside a constant."""
    logs = []
    for number in range(4):
        c = rich_run(seed + number, ROWS)
        white = np.random.default_rng([seed, number]).normal(0.0, 0.02, ROWS)
        slow = lfilter([0.1], [1.0, -0.995], white)
        logs.append(log_of(c, sensor_torque=c[LOAD] + cause(c) + slow))
    here = problem_of(
        logs, [effect("offset")], "sensor_torque", known_load=LOAD, lowpass_hz=None, threads=1
    )
    plain = Whitening(np.ones(1), 0.02**2, 1)
    work, _ = solved_at(here, candidate_model_of([effect("offset")], 1, {}), plain)
    return held_out(here, work, plain)


@pytest.mark.parametrize("seed", range(20, 40))
def test_slow_noise_does_not_come_again(seed: int) -> None:
    assert repeated(held_out_of(lambda c: np.zeros(ROWS), seed)) is None


@pytest.mark.parametrize(
    ("cause", "channels"),
    [
        (lambda c: 0.1 * np.sin(40.0 * c["output_position"]), {"output_position"}),
        (lambda c: 0.1 * np.sin(9.0 * c["output_velocity"]), {"output_velocity"}),
    ],
)
def test_waves_finer_than_all_functions_come_again_where_they_were(
    cause: Callable[[dict[str, Array]], Array], channels: set[str]
) -> None:
    found = repeated(held_out_of(cause, 20))
    assert found is not None
    assert channels <= set(found.channels)
    assert 0.3 * 0.005 < found.fall < 1.1 * 0.005  # of its mean square


def test_what_comes_again_is_a_share_of_the_error_that_is_printed() -> None:
    """The search leaves 0.107 Nm, the fit 0.061: its noise of 0.05 was a floor of 0.040 Nm."""
    made = SimpleNamespace(
        again=Repeated(0.3 * 0.107**2, 1e-4, ("load",)),
        after=SimpleNamespace(rmse=0.107),
        context=SimpleNamespace(problem=SimpleNamespace(known_load=None)),
    )
    found = assemble._again(cast(Any, made), [0.1, 0.061], 1e-4)
    assert found is not None
    assert found[1].rmse == pytest.approx(0.061 * np.sqrt(0.7))
    assert found[0].share_of_variance == pytest.approx(0.3 / (0.1**2 / 0.061**2 - 0.7))


def test_waves_over_a_turn_have_as_many_orders_as_the_settings_say() -> None:
    waves = [g for g in flexible_basis(problem()) if g.channels == (ROUND,) and g.count == 2]
    assert len(waves) == SETTINGS.lines


def test_what_functions_gain_above_chance_is_less_than_all_that_they_gain() -> None:
    c = rich_run(3, ROWS)
    torque = 0.02 * c[LOAD] * c["output_velocity"] + 0.01 * np.random.default_rng(1).normal(
        size=ROWS
    )
    here = problem_of([log_of(c, sensor_torque=torque)], [effect("offset")], "sensor_torque",
                      known_load=LOAD, lowpass_hz=None, threads=1)  # fmt: skip
    white = Whitening(np.ones(1), 1e-4, 1)
    base = replace(candidate_model_of([effect("offset")], 1, {}), coefficients=np.zeros(1))
    found = leftover_of(ExplainableBound(here, white), base)
    assert set(found.channels) == {LOAD, "output_velocity"}
    assert 0.5 * found.gain < found.net < found.gain


def test_what_functions_gain_is_how_far_the_squares_fall_in_variances_of_the_noise() -> None:
    c, variance = rich_run(3, ROWS), 1e-4
    cause = 0.02 * c[LOAD] * c["output_velocity"]
    here = problem_of([log_of(c, sensor_torque=c[LOAD] + cause)], [effect("offset")],
                      "sensor_torque", known_load=LOAD, lowpass_hz=None, threads=1)  # fmt: skip
    base = replace(candidate_model_of([effect("offset")], 1, {}), coefficients=np.zeros(1))
    found = leftover_of(ExplainableBound(here, Whitening(np.ones(1), variance, 1)), base)
    assert found.gain == pytest.approx(ROWS * np.var(cause) / variance, rel=0.01)


def test_a_product_of_channels_that_few_rows_do_not_show_is_seen_on_many() -> None:
    """A share of the noise's variance that is 7 in the rows of the wide basis, in χ²."""
    rows, share = 8 * SETTINGS.rows, 7.0 / SETTINGS.rows
    c = rich_run(3, rows)
    cause = c[LOAD] * c["output_velocity"]
    noise = np.random.default_rng(1).normal(size=rows)
    torque = c[LOAD] + np.sqrt(share) * cause / np.std(cause) + noise
    here = problem_of([log_of(c, sensor_torque=torque)], [effect("offset")], "sensor_torque",
                      known_load=LOAD, lowpass_hz=None, threads=1)  # fmt: skip
    bound = ExplainableBound(here, Whitening(np.ones(1), 1.0, 1))
    base = replace(candidate_model_of([effect("offset")], 1, {}), coefficients=np.zeros(1))
    wide, powers = (leftover_in(table, base) for table in bound.tables)
    assert wide.gain == 0.0 < powers.gain
    found = leftover_of(bound, base)
    assert found.gain == powers.gain
    assert set(found.channels) == {LOAD, "output_velocity"}
    assert 0.5 * share * rows < found.gain < 2.0 * share * rows
