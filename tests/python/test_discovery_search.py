"""Rules of the search: what is no noise, no name, and no reason to refuse one."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import recorded_joint
from fit_logs import WIDTH
from hidden_logs import LOAD, friction_of, log_of, noise, rich_run

import flexspline
from flexspline.discovery.evidence import Dictionary, equivalent_t, held_out_gain
from flexspline.discovery.faults import _last_column
from flexspline.discovery.result import Discovery, confidence, doubt
from flexspline.discovery.search import Searcher, missed, search_context_of
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import effect
from flexspline.logs.checks.dependence import Dependence
from flexspline.logs.log import Log
from flexspline.regression.candidate_model import candidate_model_of, solved_at
from flexspline.regression.gram import Table, Whitening, solved

BASE = ["offset", "coulomb_friction", "viscous_friction", "inertia"]
RUNS, ROWS = 4, 750
Array = np.ndarray


def table_of(columns: list[Array], values: list[Array]) -> Table:
    """Products of columns (N, C) and values (N,) of each fold, in noise of size one."""
    both = [np.column_stack([x, y]) for x, y in zip(columns, values, strict=True)]
    return Table(np.array([b.T @ b for b in both]), np.array([len(b) for b in both]))


def folds_apart(signal: float) -> tuple[Table, Array, Array, float]:
    """Four folds on four parts of an axis; waves of three lengths beside a constant and a line."""
    generator, columns, values = np.random.default_rng(5), [], []
    for start in (0.0, 0.5, 1.0, 1.5):
        x = start + generator.uniform(0.0, 0.5, 400)
        waves = [wave(k * x) for k in (1, 2, 3) for wave in (np.cos, np.sin)]
        columns.append(np.column_stack([np.ones(400), x, *waves]))
        values.append(signal * np.cos(3 * x + 0.4) + generator.normal(size=400))
    table = table_of(columns, values)
    model, beside = np.arange(2), np.arange(2, 8)
    return table, model, beside, explained(table)


def explained(table: Table) -> float:
    """Squares that the waves explain beside constant and line."""
    left = [table.total[-1, -1] - table.total[:-1, -1][:n] @ np.linalg.lstsq(
        table.total[:n, :n], table.total[:n, -1], rcond=1e-12)[0] for n in (2, 8)]  # fmt: skip
    return float(left[0] - left[1])


def held_out(table: Table, model: Array) -> Array:
    """Squares that are left on each fold by a fit to the others, (F,)."""
    betas = [solved(table.total - fold, model) for fold in table.folds]
    both = [np.append(-beta, 1.0) for beta in betas]
    at = np.append(model, len(table.total) - 1)
    return np.array(
        [b @ fold[np.ix_(at, at)] @ b for b, fold in zip(both, table.folds, strict=True)]
    )


def test_a_fold_that_goes_beyond_the_others_does_not_condemn_a_right_effect() -> None:
    table, model, beside, gain = folds_apart(2.0)
    plain = held_out(table, model) - held_out(table, np.append(model, beside))
    assert plain.sum() < 0.0  # the error on held-out folds would refuse it
    assert held_out_gain(table, model, beside, gain).sum() > 0.5 * gain


def test_waves_that_are_not_there_are_not_foretold() -> None:
    table, model, beside, gain = folds_apart(0.0)
    assert gain < 25.0
    assert held_out_gain(table, model, beside, gain).sum() < 0.5 * 25.0


@pytest.mark.parametrize("t", [0.5, 3.0, 12.0, 40.0, 200.0])
def test_a_chi_squared_of_one_column_is_as_surprising_as_its_root(t: float) -> None:
    assert equivalent_t(t**2, 1) == pytest.approx(t, rel=1e-3)
    # more columns explain as much by chance more easily, in far tails too, where it hardly matters
    assert 0.9 * np.sqrt(max(t**2 - 25.0, 0.0)) < equivalent_t(t**2, 4) < t


def test_a_delay_does_not_depend_on_the_units_of_the_columns_beside_it() -> None:
    generator = np.random.default_rng(9)
    columns = generator.normal(size=(4, 300, 4))
    values = columns @ [0.5, -1.0, 2.0, 0.3] + 0.1 * generator.normal(size=(4, 300))
    found = _last_column(table_of([*columns], [*values]))
    assert abs(found.seconds - 0.3) < 4.0 * found.error < 0.2
    for unit in ([1e9, 1e9, 1e9, 1.0], [1e-9, 1e-9, 1e-9, 1.0]):
        other = _last_column(table_of([*(columns * unit)], [*values]))
        assert (other.seconds, other.error) == pytest.approx((found.seconds, found.error), rel=1e-6)


def step_in_temperature(c: dict[str, Array]) -> Array:
    """Slow: between two settings of a heater, say; no effect of the catalogue."""
    return 0.06 * np.tanh((c["temperature"] - 31.0) / 0.5)


def loaded(c: dict[str, Array]) -> Array:
    return 0.006 * np.tanh(c["output_velocity"] / 0.02) * np.abs(c[LOAD])


@cache
def found(hidden: str) -> Discovery:
    term = {"step": step_in_temperature, "loaded": loaded}[hidden]
    logs: list[Log] = []
    for seed in range(1, RUNS + 1):
        c = rich_run(seed, ROWS)
        c["temperature"] += 3.0 * seed  # else all warm up alike, and time tells as much
        torque = c[LOAD] + friction_of(c) + noise(seed, ROWS) + term(c)
        logs.append(log_of(c, sensor_torque=torque))
    exclude = ["load_dependent_friction"] if hidden == "loaded" else []
    return flexspline.discover(BASE, logs, target="sensor_torque", known_load=LOAD, exclude=exclude)


def test_a_slow_cause_without_a_name_is_not_taken_for_noise() -> None:
    made = found("step")
    assert made.names == ()
    assert made.unexplained is not None and made.unexplained.depends_on[0] == "temperature"


def test_an_effect_that_is_no_candidate_gets_no_other_name() -> None:
    made = found("loaded")
    assert made.names == ()
    assert made.unexplained is not None
    assert {LOAD, "output_velocity"} <= set(made.unexplained.depends_on)


def test_a_shape_at_a_bound_is_looked_for_anew() -> None:
    """A poorer model may have driven it there."""
    wide = [e.with_shapes(direction_width=0.5) if "direction_width" in e.shapes else e
            for e in recorded_joint.base()]  # fmt: skip
    logs = recorded_joint.runs(target="motor_torque")
    made = search_context_of(
        wide, logs, "motor_torque", known_load=LOAD, lowpass_hz=None, threads=1
    )
    searcher = Searcher(made, Whitening(np.ones(1), 1e-4, 1))
    work, squares = solved_at(
        made.problem, candidate_model_of(wide, len(wide), {}), searcher.whitening
    )
    (number,) = work.bound
    freed, less = searcher._off_bounds(work, squares)
    assert less < 0.5 * squares and not freed.bound
    assert work.searched[number].value(freed.effects) == pytest.approx(WIDTH, rel=0.05)
    assert searcher._off_bounds(freed, less) == (freed, less)


STRONG = (200.0, 60.0, 1.0, 0.0, 0)  # as `confidence` takes them


@pytest.mark.parametrize(
    "worse",
    [
        (30.0, 2.0, 1.0, 0.0, 0),
        (200.0, 2.0, 1.0, 0.0, 0),  # the final fit bears out less
        (200.0, 60.0, 1.0, 30.0, 0),
        (200.0, 60.0, 1.0, 0.0, 2),
    ],
)
def test_weaker_evidence_is_never_stated_with_more_confidence(
    worse: tuple[float, float, float, float, int],
) -> None:
    assert 1.0 - SETTINGS.negligible == confidence(*STRONG) > confidence(*worse)


def test_of_equal_names_none_is_likelier_than_its_share() -> None:
    assert confidence(200.0, 60.0, 1.0, 0.0, 1) == pytest.approx(1.0 / 2.0)
    assert confidence(200.0, 60.0, 1.0, 0.0, 2) == pytest.approx(1.0 / 3.0)


def test_functions_that_hold_a_name_speak_against_it_only_where_enough_is_unexplained() -> None:
    """Free functions of its channels hold every name; x of `confidence` is 0, then 1."""
    enough = SETTINGS.bends * 2e4
    assert confidence(2e4, 60.0, 0.0, 0.99 * enough, 0) > 0.94
    assert confidence(2e4, 60.0, 0.0, 2.0 * enough, 0) < 0.5
    assert confidence(2e4, 60.0, 1.0, 2.0 * enough, 0) > 0.9


@pytest.mark.parametrize("retained", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("left", [0.0, 990.0, 2000.0, 9000.0, 58000.0])
def test_what_functions_take_from_a_confidence_is_said_beside_it(
    retained: float, left: float
) -> None:
    lost = 1.0 - confidence(2e4, 60.0, retained, left, 0)
    said = doubt(2e4, retained, left, ["output_velocity", "reference_torque"])
    assert bool(said) == (lost > SETTINGS.bends)
    if said:
        share = f"{left / 2e4:.0%} of".replace("%", " %")
        assert f"gain {share if left < 2e4 else '2.9 times'} what it does" in said
        assert f"keeps {retained:.0%} of that".replace("%", " %") in said


class Gains:
    """A table in which every name explains as much."""

    def gain(self, name: str) -> float:
        return 1000.0 if name else 0.0


ANGLE_IS_LOAD = Dependence("load", "output_position", 0.02, ("load", "output_position"), "")


@pytest.mark.parametrize(
    ("name", "tied", "share"),
    [
        ("position_dependent_friction", (), SETTINGS.form),
        ("position_dependent_friction", (ANGLE_IS_LOAD,), SETTINGS.bends),
        ("temperature_dependent_friction", (ANGLE_IS_LOAD,), SETTINGS.form),
        ("presliding_friction", (ANGLE_IS_LOAD,), SETTINGS.form),  # it remembers: no form bends so
    ],
)
def test_what_follows_a_tied_channel_may_bend_a_name(
    name: str, tied: tuple[Dependence, ...], share: float
) -> None:
    named = effect("load_dependent_friction")
    assert missed(cast(Dictionary, Gains()), named, effect(name), tied) == share * 1000.0


@pytest.mark.parametrize(("known", "stays"), [(None, False), ("reference_torque", True)])
def test_what_reads_the_load_of_the_model_goes_with_what_makes_it(
    known: str | None, stays: bool
) -> None:
    """A fit of the rest had ended in "sensor_lag depends on the load, which nothing tells"."""
    context: Any = SimpleNamespace(problem=SimpleNamespace(known_load=known))
    white = Whitening(np.ones(1), 1.0, 1)
    names = ["offset", "inertia", "sensor_lag", "viscous_friction"]
    model = candidate_model_of([effect(name) for name in names], 1, {})
    rest = Searcher(context, white).less(model, "inertia")
    assert ("sensor_lag" in [e.name for e in rest.effects]) is stays
    assert [e.name for e in rest.effects if e.name != "sensor_lag"] == [
        "offset",
        "viscous_friction",
    ]


def test_a_ripple_of_other_orders_holds_no_coefficient_of_those_that_it_had() -> None:
    """Those that wave too slowly for the runs are held at zero; it had raised an error."""
    held = {"output_ripple.cosine 1": 0.0, "output_ripple.sine 1": 0.0, "output_ripple.sine 6": 0.5}
    slow, other = (effect("output_ripple", orders=orders) for orders in ([1, 6], [2, 6]))
    made = candidate_model_of([effect("offset"), slow], 1, held).having([effect("offset"), other])
    assert made.fixed == {"output_ripple.sine 6": 0.5}
    assert made.values("output_ripple")[-1] == 0.5


@pytest.mark.parametrize("base", [["offset", "coulomb_friction"], ["offset"]])
def test_a_velocity_that_is_not_known_beside_gaps_hides_no_friction(base: list[str]) -> None:
    """A derived velocity is not finite where no row counts, whether the base reads it or not."""
    runs = []
    for seed in range(1, 4):
        c = rich_run(seed, 3000)
        torque = friction_of(c) + noise(seed, 3000)
        log = log_of(c, motor_torque=torque)
        bare = {n: log[n] for n in ("time", "output_position", "motor_torque")}
        kept = np.ones(3000, dtype=bool)
        for first in (700, 1500):
            kept[first : first + 60] = False  # a bus loses rows, and two of them stand alone
            kept[[first + 20, first + 40]] = True
        runs.append(Log({n: x[kept] for n, x in bare.items()}, {**log.facts, "name": f"r{seed}"}))
    made = flexspline.discover(base, runs, target="motor_torque")
    assert {*made.not_tried} == {"temperature_dependent_friction", "torque_constant_error"}
    assert {"coulomb_friction", "viscous_friction"} - {*base} <= {*made.names}
