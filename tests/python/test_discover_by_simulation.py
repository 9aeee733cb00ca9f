"""`discover --by simulation`: a drive's missing effect, found by its motion alone."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from cli_calls import call

import flexspline
from flexspline import Fit, InputError, Log, Model, Part
from flexspline.discovery import by_simulation
from flexspline.discovery.by_simulation import CHANCE, Driven, Step, _where, p_of_zero
from flexspline.effects import effect
from flexspline.forward import PositionServo
from flexspline.least_squares.options import shapes_of
from flexspline.logs.writing import write_log
from flexspline.output_error.cost import UNSEEN, Cost
from flexspline.output_error.fitting import Errors, Settings, with_servo_torque

BASE = ["inertia", "gravity", "coulomb_friction", "viscous_friction"]
WEIGHT = 0.5  # Nm
SERVO = PositionServo(8.0, limit=1.0, torque=1.2, back_emf=0.05)
COARSE = 2 * np.pi / 4096
SECONDS, RATE = 5.0, 80.0


def truth(factor: float) -> Model:
    """A pendulum with friction that grows with its weight's torque by `factor`."""
    effects = [effect(name).without_load() for name in (*BASE, "load_dependent_friction")]
    at = {"inertia.inertia": 0.006, "coulomb_friction.level": 0.02,
          "viscous_friction.viscosity": 0.01, "gravity.sine": WEIGHT, "gravity.cosine": 0.0,
          "load_dependent_friction.factor": factor}  # fmt: skip
    names = [f"{e.name}.{term.name}" for e in effects for term in e.terms]
    values = [at[name] for name in names]
    return Model({"drive": Part("motor_torque", tuple(effects), np.array(values))},
                 {"gear_ratio": 1.0})  # fmt: skip


@cache
def runs(factor: float) -> tuple[Log, ...]:
    """Eight runs of the servo: command, duty and the angle as its encoder counts it."""
    made = []
    time = np.arange(0.0, SECONDS, 1.0 / RATE)
    for number in range(8):
        speed, size = 1.0 + 0.35 * number, 1.6 - 0.1 * number
        goal = size * np.sin(speed * time) + 0.4 * np.sin(2.7 * speed * time + number)
        log = Log.from_arrays(
            time=time, output_position=np.zeros_like(time), commanded_position=goal
        ).with_facts({"gear_ratio": 1.0, "name": f"run {number}"})
        driven = flexspline.simulate(truth(factor), log, controller=SERVO)
        angle = np.round(driven.simulated / COARSE) * COARSE
        duty = np.clip(SERVO.position_gain * (goal - angle), -1.0, 1.0)
        made.append(log.with_columns({"output_position": angle, "duty": duty}, note="simulated"))
    return tuple(made)


def found_in(factor: float) -> flexspline.Discovery:
    return flexspline.discover(
        BASE, runs(factor), by="simulation", controller=replace(SERVO), exclude=SLOW,
        fixed={"gravity.sine": WEIGHT, "gravity.cosine": 0.0},
    )  # fmt: skip


SLOW = ("presliding_friction", "position_dependent_friction", "stribeck_friction")  # to search


@pytest.fixture(scope="module")
def found() -> flexspline.Discovery:
    return found_in(0.3)


def test_friction_that_grows_with_the_load_is_named_with_its_size(
    found: flexspline.Discovery,
) -> None:
    assert found.names == ("load_dependent_friction",)
    (factor,) = found.parameters("load_dependent_friction")
    assert factor.value == pytest.approx(0.3, rel=0.1)
    assert found.final_rmse < 0.5 * found.base_rmse


def test_errors_are_of_the_angle_and_the_report_is_that_of_every_discovery(
    found: flexspline.Discovery, tmp_path: Path
) -> None:
    content = json.loads(found.to_json())
    assert (content["by"], content["unit"], content["target"]) == (
        "simulation", "rad", "motor_torque",
    )  # fmt: skip
    assert content["simulated_rmse"]["final"] == pytest.approx(content["rmse"]["final"])
    assert "driven forward, lacks load_dependent_friction" in str(found)
    found.report(tmp_path / "report.html")
    assert "load_dependent_friction" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_extended_model_drives_unseen_runs(found: flexspline.Discovery) -> None:
    law = found.fit.simulation.controller
    made = flexspline.simulate(found.model, list(runs(0.3)), controller=law)
    assert np.sqrt(np.mean([run.rmse**2 for run in made])) < 2.0 * found.final_rmse


def test_a_joint_that_lacks_nothing_gets_no_name() -> None:
    nothing = found_in(0.0)
    assert nothing.names == ()
    assert set(nothing.refused) >= {"load_dependent_friction"}


@pytest.mark.usefixtures("undrawn")
def test_the_command_line_searches_by_simulation_too(tmp_path: Path) -> None:
    paths = [tmp_path / f"run{k}.csv" for k in range(8)]
    for path, log in zip(paths, runs(0.3), strict=True):
        write_log(log, path)
    SERVO.save(tmp_path / "servo.json")
    out = tmp_path / "found"
    made = call(
        "discover", *paths, "--by", "simulation", "--controller", tmp_path / "servo.json",
        "--effects", ",".join(BASE), "--exclude", ",".join((*SLOW, "nonlinear_viscous_friction")),
        "--fix", f"gravity.sine={WEIGHT}", "--fix", "gravity.cosine=0", "--out", out,
    )  # fmt: skip
    assert made.exit_code == 0, made.stderr
    content = json.loads((out / "discovery.json").read_text(encoding="utf-8"))
    assert [one["effect"] for one in content["found"]] == ["load_dependent_friction"]
    assert (out / "report.html").is_file() and Model.load(out / "model.json").part().target


def test_what_cannot_be_driven_is_refused() -> None:
    logs = list(runs(0.3))
    with pytest.raises(InputError, match="needs the effect inertia"):
        flexspline.discover(["coulomb_friction"], logs, by="simulation", controller=SERVO)
    with pytest.raises(InputError, match="leave the foreign simulation out"):
        flexspline.discover(BASE, logs, by="simulation", simulated_torque="x")
    with pytest.raises(InputError, match="give by='simulation' or leave it out"):
        flexspline.discover(BASE, logs, target="motor_torque", controller=SERVO)


def test_the_motion_gains_most_where_its_mean_square_falls_most() -> None:
    swings, leans = np.array([1.0, -1.0, 1.0, -1.0]), np.full(4, 0.5)
    before = cast(Driven, SimpleNamespace(held_out=[swings, leans, np.full(4, np.nan)]))
    after = cast(Driven, SimpleNamespace(held_out=[0.0 * swings, 0.0 * leans, np.full(4, np.nan)]))
    runs = [SimpleNamespace(log=SimpleNamespace(name=name)) for name in ("swings", "leans", "lost")]
    assert _where(before, after, cast(Fit, SimpleNamespace(runs=runs))) == "most in swings"


def fitted(
    values: dict[str, float], error: float = 1.0, alike: float = 0.0
) -> tuple[Driven, Errors]:
    """A fit that ended at `values`, each with one error and with one correlation to the others."""
    searched = [SimpleNamespace(name=name) for name in values]
    point, count = np.array([*values.values()]), len(values)
    made = SimpleNamespace(
        cost=SimpleNamespace(space=SimpleNamespace(searched=searched)),
        best=SimpleNamespace(point=point),
    )
    each = np.full(count, error)
    related = np.eye(count) + alike * (1.0 - np.eye(count))
    known = np.ones(count, dtype=bool)
    return cast(Driven, made), Errors(each, related, known, each, each, each, 3, 100)


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_one_coefficient_is_significant_where_its_printed_interval_leaves_zero_out(
    share: float,
) -> None:
    _, errors = fitted({"load_dependent_friction.factor": 0.0})
    value = share * float(errors.half_widths[0])
    made, errors = fitted({"load_dependent_friction.factor": value, "inertia.inertia": 9.0})
    assert (p_of_zero(made, effect("load_dependent_friction"), errors) < CHANCE) == (share > 1.0)


def test_coefficients_that_are_known_by_their_sum_alone_are_significant_together() -> None:
    names = ("presliding_friction.half", "presliding_friction.quarter")
    own = effect("presliding_friction")
    assert {f"{own.name}.{term.name}" for term in own.terms} >= {*names}
    apart = p_of_zero(*_pair(names, 0.0))
    assert p_of_zero(*_pair(names, -0.9)) < 0.05 < apart


def _pair(names: tuple[str, ...], alike: float) -> tuple[Driven, flexspline.effects.Effect, Errors]:
    made, errors = fitted(dict.fromkeys(names, 2.5), alike=alike)
    return made, effect("presliding_friction"), errors


def test_what_the_runs_do_not_determine_is_not_significant() -> None:
    made, errors = fitted({"load_dependent_friction.factor": 1e6})
    blind = replace(errors, determined=np.array([False]), standard=np.array([np.nan]))
    assert p_of_zero(made, effect("load_dependent_friction"), blind) == 1.0
    assert p_of_zero(made, effect("offset"), errors) == 1.0


def scripted(monkeypatch: pytest.MonkeyPatch, p: dict[tuple[str, ...], dict[str, float]]) -> None:
    """A search whose fits are the tuples of the names in them, with p of each name in each fit."""

    def model(names: tuple[str, ...]) -> SimpleNamespace:
        return SimpleNamespace(effects=tuple(map(effect, names)), names=names)

    def following(way: object, here: SimpleNamespace, effects: list[flexspline.effects.Effect],
                  say: object) -> tuple[Step | None, dict[str, str]]:  # fmt: skip
        for one in effects:
            names = (*here.names, one.name)
            if names in p:
                return Step(one, cast(Driven, here), cast(Driven, model(names)), 9.0, 1.0, ()), {}
        return None, {}

    monkeypatch.setattr(by_simulation, "driven_model", lambda way, effects: model(()))
    monkeypatch.setattr(by_simulation, "_next", following)
    monkeypatch.setattr(by_simulation, "errors_within", lambda made: None)
    monkeypatch.setattr(by_simulation, "p_of_zero", lambda made, one, _: p[made.names][one.name])


def names_of(monkeypatch: pytest.MonkeyPatch, p: dict[tuple[str, ...], dict[str, float]],
             effects: list[str]) -> tuple[list[str], dict[str, str]]:  # fmt: skip
    scripted(monkeypatch, p)
    monkeypatch.setattr(by_simulation, "possible", lambda *_: ([*map(effect, effects)], {}))
    made = by_simulation.search(
        [], [], "motor_torque", None, {}, (), Settings(None), lambda _: None
    )
    return [step.effect.name for step in made.steps], dict(made.refused)


def test_a_name_that_a_later_one_takes_its_significance_from_is_withdrawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stribeck, load = "stribeck_friction", "load_dependent_friction"
    p = {(stribeck,): {stribeck: 0.01}, (stribeck, load): {stribeck: 0.4, load: 0.001},
         (load,): {load: 0.001}}  # fmt: skip
    names, refused = names_of(monkeypatch, p, [stribeck, load])
    assert names == [load]
    assert refused == {stribeck: f"not significant in the final fit beside {load}, p = 0.4"}


def test_names_that_stay_significant_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    stribeck, load = "stribeck_friction", "load_dependent_friction"
    p = {(stribeck,): {stribeck: 0.01}, (stribeck, load): {stribeck: 0.049, load: 0.001}}
    assert names_of(monkeypatch, p, [stribeck, load]) == ([stribeck, load], {})


def candidate(name: str, error: float, *, p: float, wobble: float = 0.0) -> SimpleNamespace:
    """A model with one effect more that misses each of eight runs by about `error`."""
    sizes = np.log(error) + wobble * (-1.0) ** np.arange(8)
    return SimpleNamespace(name=name, rmse=error, best=SimpleNamespace(rmse=error), p=p,
                           effects=(), sizes=lambda: sizes)  # fmt: skip


def next_of(
    monkeypatch: pytest.MonkeyPatch, *candidates: SimpleNamespace
) -> tuple[Step | None, dict[str, str]]:
    by_name = {one.name: one for one in candidates}
    monkeypatch.setattr(by_simulation, "_beside", lambda way, here, one: by_name[one.name])
    monkeypatch.setattr(by_simulation, "_descended", lambda made: made)
    monkeypatch.setattr(by_simulation, "_held_out", lambda made: made)
    monkeypatch.setattr(by_simulation, "errors_within", lambda made: None)
    monkeypatch.setattr(by_simulation, "p_of_zero", lambda made, one, errors: made.p)
    here = cast(Driven, candidate("base", 0.1, p=0.0, wobble=0.02))
    way = cast(by_simulation._Way, None)
    return by_simulation._next(way, here, [*map(effect, by_name)], lambda _: None)


def test_an_effect_that_is_not_significant_in_the_final_fit_is_no_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    step, refused = next_of(monkeypatch, candidate("presliding_friction", 0.05, p=0.06))
    assert step is None
    assert refused == {"presliding_friction": "not significant in the final fit, p = 0.06"}
    step, _ = next_of(monkeypatch, candidate("presliding_friction", 0.05, p=0.04))
    assert step is not None and step.effect.name == "presliding_friction"


def test_an_effect_that_explains_as_much_is_an_alias_though_it_is_not_significant(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    load = candidate("load_dependent_friction", 0.05, p=0.001)
    waves = candidate("position_dependent_friction", 0.049, p=0.06, wobble=0.05)
    step, _ = next_of(monkeypatch, load, waves)
    assert step is not None and step.effect.name == "load_dependent_friction"
    assert step.alike == ("position_dependent_friction",)


def test_the_best_of_many_is_named_wherever_it_stands_among_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = ("presliding_friction", "stribeck_friction", "position_dependent_friction",
             "nonlinear_viscous_friction", "load_dependent_friction")  # fmt: skip
    many = [candidate(name, 0.08 - 0.01 * k, p=0.001) for k, name in enumerate(names)]
    for candidates in (many, many[::-1]):
        step, _ = next_of(monkeypatch, *candidates)
        assert step is not None and step.effect.name == names[-1]


@pytest.mark.parametrize(("others", "named"), [(0, True), (1, False)])
def test_one_effect_alone_is_named_by_chance_once_in_twenty_and_of_two_each_half_as_often(
    monkeypatch: pytest.MonkeyPatch, others: int, named: bool
) -> None:
    """Seven degrees of freedom: t = 2.1 is passed by chance once in 27."""
    spread = np.std(0.02 * (-1.0) ** np.arange(8), ddof=1) / np.sqrt(8)
    one = candidate("load_dependent_friction", 0.1 * np.exp(-2.1 * spread), p=0.001)
    worse = candidate("stribeck_friction", 0.2, p=0.001)
    step, _ = next_of(monkeypatch, one, *[worse][:others])
    assert (step is not None) == named


def test_every_name_is_significant_and_shares_of_the_gap_are_of_all_that_closes(
    found: flexspline.Discovery,
) -> None:
    assert all(0.0 <= one.coefficients_p < CHANCE for one in found.found)
    assert sum(one.share_of_gap for one in found.found) == pytest.approx(1.0)


@pytest.mark.parametrize(("share", "moves"), [(0.99, True), (1.01, False)])
def test_a_start_from_which_the_joint_stands_still_is_none(share: float, moves: bool) -> None:
    """A motion by 2 rad from 5 rad on, of which the rows of rest at its start do not count."""
    measured = np.repeat([5.0, 7.0], 10)
    run = SimpleNamespace(measured=measured, stretches=np.array([[0, 20]]))
    cost = SimpleNamespace(runs=[run], counts=[measured > 6.0], space=SimpleNamespace(start=None),
                           rmse=lambda _: 2.0 * share)  # fmt: skip
    assert by_simulation._moves(cast(Cost, cost)) == moves


def test_what_the_motion_does_not_see_is_held_at_what_the_base_says() -> None:
    logs = [with_servo_torque(log, SERVO, "motor_torque") for log in runs(0.3)[:4]]
    known = {"gravity.sine": WEIGHT, "gravity.cosine": 0.0}
    way = by_simulation._Way(logs, "motor_torque", None, known, Settings(SERVO))
    first, _, _ = way.posed([*map(effect, BASE)], 1)
    width = first[UNSEEN]
    beside = [*map(effect, BASE), effect("load_dependent_friction")]
    second, cost, _ = way.posed(beside, 1, {UNSEEN: width})
    assert second[UNSEEN] == width and width.state != "fixed"
    widths = {shape.name: shape.value(second.part.effects) for shape in shapes_of(beside)}
    assert widths[UNSEEN] == pytest.approx(width.value)
    assert [one.name for one in cost.space.searched][-1] == "load_dependent_friction.factor"
