"""Sums of columns that are never all there equal those of plain rows, and take no more memory."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hidden_logs import FACTS, LOAD, rich_run
from numpy.typing import NDArray
from scipy.signal import lfilter

import flexspline
from flexspline import _core
from flexspline.discovery.basis import BasisFunctions, Functions
from flexspline.discovery.search import SearchContext, search_context_of
from flexspline.least_squares.problem import Problem
from flexspline.logs.log import Log
from flexspline.regression import gram
from flexspline.regression.candidate_model import CandidateModel, candidate_model_of, mixed
from flexspline.regression.gram import ColumnAssembly, Whitening, edges_of, solved, tabulated

Array = NDArray[np.float64]

ROUNDING = 1e-12  # of the lengths of two columns: what sums in another order may differ by
COLOURED = np.array([1.0, -0.6, 0.25, -0.1])
TARGETS = ("sensor_torque", "motor_torque", "motor_current", "torsion")
CURVED = ("offset", "coulomb_friction", "viscous_friction", "inertia")


def log(seed: int, rows: int, gap: int | None = None, jitter: float = 0.0) -> Log:
    """A run with all channels that effects read, of any torque; behind `gap` it went on later."""
    channels = rich_run(seed, rows)
    generator = np.random.default_rng([seed, 3])
    channels["motor_position"] = 101.0 * channels["output_position"]
    for name in ("motor_position", "sensor_torque", "motor_current"):
        noise = generator.standard_normal(rows)
        channels[name] = channels.get(name, np.zeros(rows)) + 0.01 * noise
    channels["motor_temperature"] = channels["temperature"] + 5.0
    time = channels["time"] + jitter * generator.uniform(-1.0, 1.0, rows) * 1e-3
    time[gap or rows :] += 3.0
    kept = {k: v for k, v in channels.items() if k not in ("late_load", "fine_angle")}
    facts = {**FACTS, "torque_constant": 0.1, "name": f"run {seed}"}
    return Log.from_arrays(facts=facts, **{**kept, "time": time})


def context(
    logs: list[Log], target: str = "sensor_torque", cutoff: float | None = None
) -> SearchContext:
    base = ["mesh_compliance"] if target == "torsion" else CURVED
    effects = [flexspline.effect(name) for name in base]
    return search_context_of(effects, logs, target, known_load=LOAD, lowpass_hz=cutoff, threads=1)


def model(made: SearchContext) -> CandidateModel:
    base = ["mesh_compliance"] if made.target == "torsion" else CURVED
    effects = [flexspline.effect(name) for name in base]
    begun = candidate_model_of(effects, len(effects), {})
    values = np.random.default_rng(5).uniform(0.05, 0.3, len(begun.coefficients))
    return replace(begun, coefficients=values)


def everything(made: SearchContext) -> ColumnAssembly:
    """Columns of a model, of its shapes, and of every candidate in every form."""
    work = model(made)
    beside = [e for c in made.candidates(work.effects) for e in c.effects]
    return work.assembly(beside=list(dict.fromkeys(beside)))


def plain_products(problem: Problem, assembly: ColumnAssembly, whitening: Whitening) -> Array:
    """The same with rows that are all there, scipy's filter and numpy's products."""
    folds = []
    for number, run in enumerate(problem.runs):
        columns, target = assembly.rows(problem, number)
        values, rows = np.column_stack([columns, target]), [np.empty(0, dtype=int)]
        filtered = [np.empty((0, values.shape[1]))]
        for first, last in run.stretches:
            at = np.arange(first, last, whitening.decimation)
            if len(at) > 2 * whitening.order + 2:
                made = lfilter(whitening.denominator, [1.0], values[at], axis=0)
                filtered.append(made[whitening.order :])
                rows.append(at[whitening.order :])
        joined, where = np.concatenate(filtered), np.concatenate(rows)
        for first, last in pairwise(edges_of(problem, number)):
            part = joined[(where >= first) & (where < last)]
            folds.append(part.T @ part)
    return np.array(folds)


def assert_same(found: Array, expected: Array, by_fft: bool = False) -> None:
    """Equal but for rounding; by_fft: where that is a share of what the other folds have."""
    lengths = np.sqrt(np.einsum("fii->fi", expected))
    if by_fft:
        lengths = np.broadcast_to(np.linalg.norm(lengths, axis=0), lengths.shape)
    scale = lengths[:, :, None] * lengths[:, None, :]
    assert found.shape == expected.shape
    worst = np.max(np.abs(found - expected) / np.maximum(scale, 1e-300))
    assert worst <= ROUNDING


@pytest.mark.parametrize("target", TARGETS)
def test_sums_of_every_effect_equal_those_of_plain_rows(target: str) -> None:
    made = context([log(1, 3001, gap=1777), log(2, 2500)], target)
    whitening = Whitening(COLOURED, 1.0, 1)
    assembly = everything(made)
    found = tabulated(made.problem, assembly, whitening)
    assert_same(found.folds, plain_products(made.problem, assembly, whitening))


def test_candidates_of_these_tests_are_all_effects_that_remember() -> None:
    remembering = {i.name for i in flexspline.CATALOGUE.values() if i.remembers}
    tried = set()
    for target in TARGETS:
        made = context([log(1, 1000)], target)
        tried |= {e.name for c in made.candidates(model(made).effects) for e in c.effects}
    assert remembering <= tried


@pytest.mark.parametrize("order", [0, 3])
def test_low_pass_and_thinning_are_carried_from_block_to_block(order: int) -> None:
    made = context([log(1, 5001, gap=2222), log(2, 2500)], cutoff=12.0)
    whitening = Whitening(COLOURED[: order + 1], 1.0, made.problem.decimation)
    assert whitening.decimation > 1
    assembly = everything(made)
    assert assembly.even(made.problem)
    found = tabulated(made.problem, assembly, whitening)
    assert_same(found.folds, plain_products(made.problem, assembly, whitening), by_fft=True)


def test_thinning_without_a_low_pass_skips_rows_but_no_memory() -> None:
    made = context([log(1, 3001, gap=1500)])
    whitening = Whitening(COLOURED, 1.0, 700)
    short = replace(whitening, decimation=37)
    for each in (whitening, short):
        found = tabulated(made.problem, everything(made), each)
        assert_same(found.folds, plain_products(made.problem, everything(made), each))


def test_uneven_steps_take_the_way_of_plain_rows() -> None:
    made = context([log(1, 2500, jitter=1.5)], cutoff=12.0)
    whitening = Whitening(COLOURED, 1.0, made.problem.decimation)
    assembly = model(made).assembly()
    assert not assembly.even(made.problem)
    found = tabulated(made.problem, assembly, whitening)
    assert_same(found.folds, plain_products(made.problem, assembly, whitening))


def test_leaving_out_runs_makes_one_fold_of_each() -> None:
    made = context([log(seed, 900) for seed in range(4)])
    whitening = Whitening(COLOURED, 1.0, 1)
    found = tabulated(made.problem, everything(made), whitening)
    assert len(found.folds) == 4
    assert found.rows.tolist() == [900 - 3] * 4
    assert_same(found.folds, plain_products(made.problem, everything(made), whitening))


def remembering(made: SearchContext) -> ColumnAssembly:
    names = ("torque_hysteresis", "sensor_lag", "presliding_friction")
    return model(made).assembly(beside=[flexspline.effect(name) for name in names])


def test_long_runs_are_summed_in_pieces_that_remember_what_came_before() -> None:
    made = context([log(1, 290_000, gap=150_001)])
    whitening = Whitening(COLOURED, 1.0, 1)
    assembly = remembering(made)
    found = tabulated(made.problem, assembly, whitening)
    assert_same(found.folds, plain_products(made.problem, assembly, whitening))
    threaded = tabulated(replace(made.problem, threads=3), assembly, whitening)
    assert np.array_equal(found.folds, threaded.folds)


def test_parts_of_a_run_remember_what_lies_between_them() -> None:
    made = context([log(1, 8000)])
    parts = ((1000, 1900), (4000, 5500), (7990, 7999))
    runs = tuple(replace(run, stretches=parts) for run in made.problem.runs)
    problem = replace(made.problem, runs=runs)
    whitening = Whitening(COLOURED, 1.0, 1)
    found = tabulated(problem, remembering(made), whitening)
    assert_same(found.folds, plain_products(problem, remembering(made), whitening))


def test_rows_asked_for_later_are_remembered_from_those_before() -> None:
    made = context([log(1, 8000)])
    whitening = Whitening(COLOURED, 1.0, 1)
    for parts in (((4000, 4500),), ((500, 900), (4000, 4500), (6000, 6300)), ((4400, 4800),)):
        runs = tuple(replace(run, stretches=parts) for run in made.problem.runs)
        problem = replace(made.problem, runs=runs)
        found = tabulated(problem, remembering(made), whitening)
        assert_same(found.folds, plain_products(problem, remembering(made), whitening))


def test_memory_with_a_lead_is_that_of_a_run_that_begins_so_much_earlier() -> None:
    made = context([log(1, 8000)])
    whitening = Whitening(COLOURED, 1.0, 1)

    def products(logs: list[Log], part: tuple[int, int], remembered: _core.Remembered) -> Array:
        problem = context(logs).problem
        runs = (replace(problem.runs[0], stretches=(part,)),)
        problem = replace(problem, runs=runs, remembered=remembered)
        return tabulated(problem, remembering(made), whitening).total

    run = log(1, 8000)
    short = products([run], (4000, 4500), _core.Remembered(700))
    later = products([run.rows(slice(3300, None))], (700, 1200), _core.Remembered())
    whole = products([run], (4000, 4500), _core.Remembered())
    assert short == pytest.approx(later, rel=1e-9, abs=1e-9)
    assert not np.allclose(short, whole, rtol=1e-9)


def test_bends_mixed_from_products_are_those_mixed_from_rows() -> None:
    made = context([log(1, 3001, gap=1777), log(2, 2500)])
    work, whitening = model(made), Whitening(COLOURED, 1.0, 1)
    assembly, slopes = work.opened()
    opened = tabulated(made.problem, assembly, whitening).total
    found = mixed(opened, slopes @ work.coefficients)
    expected = tabulated(made.problem, work.assembly(), whitening).total
    lengths = np.sqrt(np.diag(expected))
    apart = (found - expected) / np.outer(lengths, lengths)
    assert np.abs(apart).max() < 1e-6  # of a bend 1/160 as long as what it is a difference of


def test_filtered_columns_are_those_of_plain_rows() -> None:
    made = context([log(1, 3001, gap=1777), log(2, 2500)])
    whitening, assembly = Whitening(COLOURED, 1.0, 1), remembering(made)
    for number, run in enumerate(made.problem.runs):
        found, at = assembly.white(made.problem, whitening, number)
        columns, target = assembly.rows(made.problem, number)
        expected, rows = whitening(np.column_stack([columns, target]), run)
        assert np.array_equal(at, rows)
        assert found == pytest.approx(expected, rel=0, abs=1e-11)


def test_what_is_left_on_a_fold_is_target_less_columns_times_its_coefficients() -> None:
    made = context([log(1, 3001, gap=1777), log(2, 2500)])
    assembly = remembering(made)
    betas = list(np.random.default_rng(1).normal(size=(8, assembly.width)))
    found = assembly.left_over(made.problem, betas)
    fold = 0
    for number, left in enumerate(found):
        columns, target = assembly.rows(made.problem, number)
        for first, last in pairwise(edges_of(made.problem, number)):
            expected = target[first:last] - columns[first:last] @ betas[fold]
            assert left[first:last] == pytest.approx(expected, rel=0, abs=1e-11)
            fold += 1


def powers(values: Mapping[str, Array]) -> Array:
    return np.column_stack([values["time"], values["output_velocity"] ** 3])


@pytest.mark.parametrize("cutoff", [None, 12.0])
def test_functions_without_a_name_are_made_in_pieces(
    monkeypatch: pytest.MonkeyPatch, cutoff: float | None
) -> None:
    made = context([log(1, 3001, gap=1777), log(2, 2500)], cutoff=cutoff)
    whitening = Whitening(COLOURED, 1.0, made.problem.decimation)
    assembly = model(made).assembly(
        given=Functions((BasisFunctions(("time", "output_velocity"), powers, 2),))
    )
    monkeypatch.setattr(gram, "CHUNK", 500)
    found = tabulated(made.problem, assembly, whitening)
    assert_same(found.folds, plain_products(made.problem, assembly, whitening), by_fft=True)
    left = assembly.left_over(made.problem, [np.ones(assembly.width)] * len(found.folds))
    columns, target = assembly.rows(made.problem, 0)
    rows = np.isfinite(left[0])
    assert rows.sum() == made.problem.runs[0].counted
    assert left[0][rows] == pytest.approx((target - columns.sum(axis=1))[rows], rel=0, abs=1e-10)


HERE = Path(__file__).parent
MEMORY = """
import resource
from test_discovery_sheet import context, everything, log
from flexspline.regression.gram import tabulated
from flexspline.regression.gram import Whitening
import numpy as np

made = context([log(1, {rows})])
assembly = everything(made)
whitening = Whitening(np.array([1.0, -0.6]), 1.0, 1)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
tabulated(made.problem, assembly, whitening)
print(assembly.width, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_memory_of_a_table_does_not_grow_with_rows_times_columns() -> None:
    rows = 200_000
    code = [sys.executable, "-c", MEMORY.format(rows=rows)]
    done = subprocess.run(code, check=True, capture_output=True, text=True, cwd=HERE)
    width, grown = (int(word) for word in done.stdout.split())
    assert width > 60
    assert grown * 1024 < 0.2 * rows * width * 8


def test_what_rows_do_not_tell_from_the_base_is_the_bases() -> None:
    """A spring that slips all the time is Coulomb friction; alone, both would get a half."""
    chance = np.random.default_rng(0)
    sliding, other = chance.choice([-1.0, 1.0], 100), chance.normal(size=100)
    rows = np.column_stack([sliding, other, 2.0 * sliding, 0.8 * sliding + 3.0 * other])
    made = np.column_stack([rows, 0.2 * sliding + 0.5 * other])
    products = made.T @ made
    every = np.arange(4)
    np.testing.assert_allclose(solved(products, every, 2), [0.2, 0.5, 0.0, 0.0], atol=1e-12)
    least = solved(products, every)
    assert np.abs(least[2:]).min() > 0.01
    np.testing.assert_allclose(rows @ least, made[:, -1], atol=1e-12)
