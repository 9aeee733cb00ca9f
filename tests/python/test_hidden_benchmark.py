"""The benchmark of hidden effects: its runs are what it says, and it calls wrong what is wrong."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

from hidden.cases import Case, cases, quick
from hidden.combined import EXCLUDED, PAIRS, TRIPLES
from hidden.confusion import confusion
from hidden.dictionary import columns_of, reduced
from hidden.forms import FORMS
from hidden.made import Made, made_of
from hidden.noise import NOISES
from hidden.rig import LOAD
from hidden.running import outcomes_of
from hidden.shapes import bouc_wen
from hidden.shares import share, shares
from hidden.trial import ALIAS, Outcome, judged, left_beside, stands_for

from flexspline.effects import CATALOGUE, TARGETS, effect

Array = np.ndarray
CASE = Case(1, "single", "sensor_torque", ("load_dependent_friction",), "", (), 16.0, 5, "small",
            "swings", "AR 0.9", 0.01)  # fmt: skip


@cache
def made(case: Case) -> Made:
    return made_of(case)


def covariance(noise: str, level: float, rows: int) -> Array:
    """First row of the noise's covariance, from its impulse response, (rows,)."""
    impulse = np.zeros(rows + 2000)
    impulse[0] = 1.0
    response = lfilter([1.0], NOISES[noise].denominator, impulse)
    lags = np.array([response[: len(response) - k] @ response[k:] for k in range(rows)])
    return np.asarray(level**2 * lags / lags[0])


def products(columns: list[Array], case: Case) -> Array:
    """Σ XᵀK⁻¹X over independent runs, with the whole covariance K of the noise."""
    first = covariance(case.noise, case.level, len(columns[0]))
    return np.asarray(sum(x.T @ solve_toeplitz(first, x) for x in columns))


def t_of(information: Array, term: int) -> float:
    """t of a column whose coefficient is one, beside all others."""
    return float(1.0 / np.sqrt(np.linalg.inv(information)[term, term]))


def base_columns(made: Made, k: int) -> Array:
    """Base of a torque and the bend of its Coulomb friction, (N, 5)."""
    s = made.scenes[k]
    slip = s.v / s.joint.width
    bend = slip / np.cosh(slip) ** 2
    return np.column_stack([np.ones(len(s.v)), np.tanh(slip), bend, s.v, s.a])


@pytest.mark.parametrize("noise", ["AR 0.9", "swinging"])
def test_the_true_form_has_the_t_that_is_claimed_beside_the_base(noise: str) -> None:
    case = replace(CASE, noise=noise)
    (name,), one = case.hidden, made(case)
    columns = [np.column_stack([base_columns(one, k), one.terms[name][k]]) for k in range(5)]
    assert t_of(products(columns, case), -1) == pytest.approx(one.t_base[name], rel=0.02)


def test_the_size_is_the_t_beside_the_nearest_rival() -> None:
    case = replace(CASE, hidden=("motor_crosstalk",))
    one = made(case)
    assert one.closest["motor_crosstalk"] in ("gain_error", "torque_hysteresis")
    columns = [
        np.column_stack([base_columns(one, k), one.terms["motor_crosstalk"][k], one.logs[k][LOAD]])
        for k in range(5)
    ]
    both = products(columns, case)
    assert t_of(both[:6, :6], 5) == pytest.approx(one.t_base["motor_crosstalk"], rel=0.02)
    assert 16.0 * 0.98 < t_of(both, 5) < t_of(both[:6, :6], 5)


def test_each_of_a_pair_is_sized_beside_the_other() -> None:
    names = ("load_dependent_friction", "position_dependent_friction")
    case = replace(CASE, kind="pair", hidden=names)
    one = made(case)
    columns = [
        np.column_stack([base_columns(one, k), *(one.terms[name][k] for name in names)])
        for k in range(5)
    ]
    both = products(columns, case)
    for name, at in zip(names, (-2, -1), strict=True):
        assert t_of(both, at) == pytest.approx(one.t_base[name], rel=0.02)
        assert one.t_base[name] > case.size * 0.999


def test_the_same_case_is_made_twice_alike() -> None:
    first, again = made(CASE), made_of(CASE)
    for a, b in zip(first.logs + first.held_out, again.logs + again.held_out, strict=True):
        assert a["sensor_torque"].tobytes() == b["sensor_torque"].tobytes()
    other = made(replace(CASE, seed=6))
    assert np.abs(other.logs[0]["sensor_torque"] - first.logs[0]["sensor_torque"]).max() > 0.1


def test_the_noise_has_the_size_and_the_memory_that_is_said() -> None:
    for name, kind in NOISES.items():
        drawn = kind.drawn(np.random.default_rng(3), 400_000, 0.02)
        lags = covariance(name, 0.02, 2)
        slack = 0.05 if name == "AR 0.97" else 0.03  # four errors of a variance at that memory
        assert np.var(drawn) == pytest.approx(lags[0], rel=slack)
        assert np.mean(drawn[1:] * drawn[:-1]) == pytest.approx(lags[1], abs=slack * lags[0])


def test_bouc_and_wens_loop_solves_its_differential_equation() -> None:
    path = 0.05 * np.sin(np.linspace(0.0, 9.0, 40_001)) * np.linspace(0.3, 1.0, 40_001)
    z, u = bouc_wen(path, 0.02), np.diff(path)
    slope = (u - 0.5 * (np.abs(u) * z[:-1] + u * np.abs(z[:-1]))) / 0.02
    assert np.abs(np.cumsum(slope) - z[1:]).max() < 2e-3  # Euler's own error at this step


def test_every_effect_of_the_catalogue_is_hidden_alone_or_is_a_pair_of_columns() -> None:
    for target, forms in FORMS.items():
        shown = {n for n, info in CATALOGUE.items() if TARGETS[target] in info.targets}
        later = {"direction_dependent_friction"} | ({"sensor_lag"} - set(forms))  # never named
        assert shown - set(forms) <= {"coulomb_friction_per_direction", *later}
        assert set(forms) <= shown


def test_there_are_as_many_cases_as_are_asked_for() -> None:
    every = cases()
    assert len({c.key for c in every}) == len(every)
    assert sum(c.kind == "nothing" for c in every) == 300
    assert all(len(PAIRS[t]) >= 12 and len(TRIPLES[t]) >= 6 for t in FORMS)
    assert {c.joint for c in every} == {"small", "large"}
    assert {c.noise for c in every} == set(NOISES)
    assert {c.excitation for c in every} == {"swings", "moves", "tied"}
    assert set(quick(every)) < set(every) and 55 <= len(quick(every)) <= 75
    assert all(name in FORMS[t] for t in FORMS for name in EXCLUDED[t])


def test_an_alias_counts_only_where_it_is_declared_and_real() -> None:
    case = replace(CASE, hidden=("gravity",), size=5.0)
    one, ripple = made(case), effect("output_ripple", orders=[1])
    assert left_beside(case, one, "gravity", ripple) < ALIAS
    assert stands_for(case, one, [ripple], [("gravity",)]) == ("gravity",)
    assert stands_for(case, one, [ripple], [()]) == ("",)
    far = effect("stribeck_friction")
    assert left_beside(case, one, "gravity", far) > ALIAS
    assert stands_for(case, one, [far], [("gravity",)]) == ("",)


def test_one_hidden_effect_is_found_once() -> None:
    case = replace(CASE, hidden=("gravity",), size=5.0)
    both = [effect("output_ripple", orders=[1]), effect("gravity")]
    assert stands_for(case, made(case), both, [("gravity",), ()]) == ("", "gravity")


def test_wrong_answers_are_called_wrong() -> None:
    nothing = replace(CASE, kind="nothing", hidden=())
    restless = replace(nothing, kind="restless", restless=0.3)
    assert judged(restless, (), False) and not judged(restless, ("",), False)
    unknown = replace(CASE, kind="unknown", hidden=(), unknown="power")
    removed = replace(CASE, kind="removed", excluded=CASE.hidden)
    off = replace(CASE, kind="mismatch")
    own = CASE.hidden
    assert judged(nothing, (), False) and not judged(nothing, ("",), False)
    assert judged(CASE, own, False) and judged(CASE, own, True)
    assert not judged(CASE, (), False)
    assert not judged(CASE, (*own, ""), False)
    for case in (unknown, removed):
        assert judged(case, (), True)
        assert not judged(case, (), False) and not judged(case, ("",), True)
    assert judged(off, own, False) and not judged(off, own, True)


def outcome(case: Case, names: tuple[str, ...], means: tuple[str, ...]) -> Outcome:
    return Outcome(case, {}, {}, names, ((),) * len(names), (0.9,) * len(names), means, None,
                   (), judged(case, means, False), None, 1.0)  # fmt: skip


def test_a_wrong_name_stands_in_the_column_of_what_was_said() -> None:
    pair = replace(CASE, kind="pair", hidden=("gravity", "cogging"))
    wrong = outcome(pair, ("gravity", "sensor_lag"), ("gravity", ""))
    more = outcome(CASE, (*CASE.hidden, "offset"), (*CASE.hidden, ""))
    missed = outcome(CASE, (), ())
    table = confusion([wrong, more, missed])
    assert table.loc["gravity", "gravity"] == 1
    assert table.loc["cogging", "sensor_lag"] == 1
    assert table.loc["nothing more", "offset"] == 1
    assert table.loc["load_dependent_friction", "nothing"] == 1
    assert table.to_numpy().sum() == 5
    said = {s.what: s for s in shares([wrong, more, missed])}
    assert said["names that are wrong, of all given"].hits == 2
    assert said["right set of names, t = 16"].hits == 0


def test_a_bar_is_passed_by_the_share_and_not_by_its_interval() -> None:
    assert share("", [True] * 97 + [False] * 3, 0.97).passes
    assert not share("", [True] * 96 + [False] * 4, 0.97).passes
    assert share("", [], 0.97).passes is None


def test_an_outcome_survives_its_line_of_json() -> None:
    one = outcome(CASE, ("gravity",), ("",))
    assert Outcome.from_json(one.to_json()) == one


def test_a_form_that_is_off_leaves_nine_per_cent_beside_the_catalogues() -> None:
    case = replace(CASE, kind="mismatch", size=100.0)
    (name,), one = case.hidden, made(case)
    own = one.sizing.own(one.terms[name])
    exact = one.sizing.beside(effect(name, direction_width=one.scenes[0].joint.width))
    share_left = one.sizing.left(own, exact) / one.sizing.left(own)
    assert share_left == pytest.approx(0.09, rel=0.01)
    assert one.t_base[name] == pytest.approx(100.0)


@dataclass(frozen=True)
class Seen:
    """A line of a run."""

    case: Case

    def to_json(self) -> dict[str, object]:
        return {"key": self.case.key, "number": self.case.number}


def test_a_run_that_was_stopped_goes_on_and_refuses_lines_of_other_code(tmp_path: Path) -> None:
    every, lines, worked = cases()[:4], tmp_path / "cases.jsonl", list[int]()

    def work(case: Case) -> Seen:
        if len(worked) == 2:
            raise KeyboardInterrupt
        worked.append(case.number)
        return Seen(case)

    def read(line: dict[str, object]) -> Seen:
        return Seen(next(c for c in every if c.number == line["number"]))

    with pytest.raises(KeyboardInterrupt):
        outcomes_of(every, lines, 1, work, read, print)
    done = tuple(worked)
    lines.write_text(lines.read_text() + '{"key": "cut')
    worked.clear()
    made = outcomes_of(every[:3], lines, 1, work, read, print)
    assert len(worked) == 1 and not {*worked} & {*done}
    assert [s.case.number for s in made] == sorted(c.number for c in every[:3])
    lines.write_text(lines.read_text().replace('"code": "', '"code": "x'))
    with pytest.raises(SystemExit, match="made by other code"):
        outcomes_of(every, lines, 1, work, read, print)


def test_the_reduced_columns_leave_the_squares_of_every_fit_as_they_are() -> None:
    draw = np.random.default_rng(8)
    runs = [draw.normal(size=(900, 9)) for _ in range(4)]
    for run in runs:
        run[:, 5] = run[:, 3] + run[:, 4]  # exactly dependent
    base, y = [r[:, :2] for r in runs], [r[:, 8] + r[:, 2] + r[:, 0] for r in runs]
    columns = reduced(base, [r[:, 2:8] for r in runs], y, list("abcdef"))
    assert len(columns.owners) == 5 and len({*columns.owners} & {*"bcd"}) == 2
    known, target = np.concatenate(base), np.concatenate(y)
    names = [*columns.owners]
    raw = np.concatenate(runs)[:, [2 + "abcdef".index(n) for n in names]]
    whole = np.linalg.lstsq(np.column_stack([known, raw]), target, rcond=None)[1][0]
    small = np.linalg.lstsq(columns.X, columns.y, rcond=None)
    left = np.sum((columns.y - columns.X @ small[0]) ** 2)
    assert left == pytest.approx(whole, rel=1e-9)


def test_methods_of_others_choose_the_two_columns_that_make_the_target() -> None:
    pytest.importorskip("pysindy", reason="comes with flexspline[bench]")
    from hidden.selectors import METHODS

    draw = np.random.default_rng(4)
    runs = [draw.normal(size=(600, 6)) for _ in range(4)]
    y = [2.0 * r[:, 1] - r[:, 4] + 0.1 * draw.normal(size=600) for r in runs]
    base = [np.ones((600, 1))] * 4
    columns = reduced(base, runs, y, list("abcdef"))
    for method, chosen in METHODS.items():
        assert {"b", "e"} <= {*columns.of(chosen(columns))}, method
    for method in ("LassoCV, 1 SE", "stepwise BIC"):
        assert {*columns.of(METHODS[method](columns))} == {"b", "e"}


def test_the_dictionary_of_the_others_has_the_candidates_of_discover() -> None:
    columns = columns_of(made(CASE), CASE.target, ("gravity",))
    missing = set(FORMS[CASE.target]) - {*columns.owners} - {e.name for e in made(CASE).base}
    assert missing <= {"gravity", "speed_dependent_ripple"}  # the latter needs a ripple to follow
    assert not {"gravity", "offset"} & {*columns.owners}
