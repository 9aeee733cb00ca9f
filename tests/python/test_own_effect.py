"""Effects of the user's own: found where they are, refused in a sentence, and no code in a file."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hidden_logs import BASE, LOAD, friction_of, log_of, noise, rich_run
from numpy.typing import NDArray

import flexspline
from flexspline import InputError, OwnEffect, effect, own_effect
from flexspline.least_squares.options import FitOptions
from flexspline.least_squares.problem import Problem, problem_of
from flexspline.logs.log import Log
from flexspline.regression.gram import ColumnAssembly, Whitening, tabulated
from flexspline.report.html import python_call

Array = NDArray[np.float64]

HEIGHT, SPEED = 0.2, 0.6
NM = {"height": "Nm"}
WIDTHS = {"width": ("rad/s", 0.02, 3.0)}
ROUNDING = 1e-9  # of a coefficient: sums of plain rows, where the core has its own order
EASY = [effect(n) for n in ("offset", "coulomb_friction", "viscous_friction", "inertia")]


@own_effect(terms=NM, shapes=WIDTHS)
def hump(output_velocity: Array, width: float = 0.2) -> Array:
    """Friction that is largest at one speed."""
    x = output_velocity / width
    return np.asarray(x * np.exp(-(x**2)))


@own_effect(terms={"viscosity": "Nm·s/rad"})
def drag(output_velocity: Array) -> Array:
    """What viscous_friction is."""
    return output_velocity


@own_effect(terms={"cosine": "Nm", "sine": "Nm"})
def swing(output_position: Array) -> tuple[Array, Array]:
    """What gravity is, beside a constant."""
    return np.cos(output_position), np.sin(output_position)


@cache
def runs(height: float, rows: int = 2000) -> tuple[Log, ...]:
    """Two runs, with a hump of this height in their friction."""
    made = []
    for seed in (1, 2):
        c = rich_run(seed, rows)
        x = c["output_velocity"] / SPEED
        own = height * x * np.exp(-(x**2))
        y = friction_of(c) + own + noise(seed, rows)
        log = log_of(c, sensor_torque=c[LOAD] + y)
        made.append(log.with_facts({"name": f"run {seed}"}))
    return tuple(made)


@cache
def fitted() -> Any:
    return flexspline.fit([*BASE, hump], runs(HEIGHT), "sensor_torque", known_load=LOAD)


def made_of(function: Callable[..., Any], **how: Any) -> OwnEffect:
    return own_effect(**{"name": "own", "terms": NM, **how})(function)


def test_a_hidden_effect_is_fitted_with_its_shape() -> None:
    found = {p.name: p for p in fitted().parameters}
    for name, truth in (("hump.height", HEIGHT), ("hump.width", SPEED)):
        assert abs(found[name].value - truth) < 4.0 * found[name].standard_error
        assert found[name].standard_error < 0.05 * truth
    assert found["hump.width"].unit == "rad/s"
    without = flexspline.fit(BASE, runs(HEIGHT), "sensor_torque", known_load=LOAD)
    assert fitted().cv_rmse < 0.7 * without.cv_rmse


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"lowpass": 20.0},
        {"options": FitOptions(offset_per_run=True)},
        {"options": FitOptions(robust="huber")},
        {"priors": {"inertia": (0.02, 0.001)}},
    ],
)
def test_a_copy_of_the_catalogues_fits_as_the_original(how: Mapping[str, Any]) -> None:
    names = ["offset", effect("coulomb_friction", direction_width=0.05)]
    both = [
        flexspline.fit(
            [*names, one, "inertia"], runs(0.0, 600), "sensor_torque", known_load=LOAD,
            fixed={"direction_width": 0.05}, **how,
        )
        for one in ("viscous_friction", drag)
    ]  # fmt: skip
    for there, here in zip(both[0].parameters, both[1].parameters, strict=True):
        assert here.name.replace("drag", "viscous_friction") == there.name
        assert here.unit == there.unit
        assert here.value == pytest.approx(there.value, rel=ROUNDING, abs=ROUNDING)
        assert here.standard_error == pytest.approx(there.standard_error, rel=1e-6, nan_ok=True)
    assert both[1].cv_rmse == pytest.approx(both[0].cv_rmse, rel=ROUNDING)


class Speeds:
    """A given column behind those of effects."""

    count = 1

    def rows(self, problem: Problem, number: int, rows: slice) -> Array:
        return np.abs(problem.runs[number].channels["output_velocity"][rows, None])


@pytest.mark.parametrize("cutoff", [None, 20.0])
def test_a_search_tabulates_own_columns_wherever_they_stand(cutoff: float | None) -> None:
    """A copy before, between and behind the core's effects, held and mixed as the original."""
    tables, left = [], []
    for viscous in (effect("viscous_friction"), drag):
        effects = (viscous, effect("offset"), swing, effect("load_dependent_friction"), hump)
        count = sum(len(one.terms) for one in effects)
        problem = problem_of(
            runs(HEIGHT, 600), effects, "sensor_torque", known_load=LOAD, lowpass_hz=cutoff,
            threads=2,
        )  # fmt: skip
        columns = tuple([(k, 1.0)] for k in range(count))
        mixed = ([(0, 0.5), (2, -0.25), (count - 1, 2.0)],)
        held = np.linspace(0.1, 0.4, count)
        assembly = ColumnAssembly(effects, np.zeros(count), (*columns, *mixed), held, Speeds())
        noise = Whitening(np.array([1.0, -0.6]), 0.01, 1)
        tables.append(tabulated(problem, assembly, noise).total)
        folds = len(tabulated(problem, assembly, noise).folds)
        left.append(
            np.concatenate(assembly.left_over(problem, [np.full(assembly.width, 0.1)] * folds))
        )
    size = np.sqrt(np.diag(tables[0]))
    assert (np.abs(tables[1] - tables[0]) <= 1e-11 * np.outer(size, size)).all()
    seen = np.isfinite(left[0])
    assert seen.any() and np.array_equal(seen, np.isfinite(left[1]))
    assert np.allclose(left[0][seen], left[1][seen], rtol=0.0, atol=1e-12)


EXCLUDED = ["presliding_friction", "torque_hysteresis", "sensor_lag", "output_ripple", "cogging",
            "wave_generator_ripple", "speed_dependent_ripple", "position_dependent_friction",
            "thermal_gradient_drift", "temperature_dependent_friction"]  # fmt: skip


def test_an_own_effect_is_named_where_it_is_hidden_and_nowhere_else() -> None:
    """Its rivals by form, Stribeck's friction and a bent viscous one, are candidates beside it."""
    names = []
    for height in (HEIGHT, 0.0):
        found = flexspline.discover(
            EASY, runs(height, 1200), target="sensor_torque", known_load=LOAD, own=hump,
            exclude=EXCLUDED, fixed={"direction_width": 0.05},
        )  # fmt: skip
        names.append(found.names)
    assert names == [("hump",), ()]


def test_a_search_from_a_model_with_an_own_effect_finds_what_it_lacks() -> None:
    base = flexspline.fit(
        [EASY[0], EASY[1], EASY[3], hump(width=SPEED)], runs(HEIGHT, 1200), "sensor_torque",
        known_load=LOAD, fixed={"direction_width": 0.05, "hump.width": SPEED},
    )  # fmt: skip
    found = flexspline.discover(base.model, runs(HEIGHT, 1200), exclude=EXCLUDED)
    assert found.names == ("viscous_friction",)
    assert found.base_effects == ("offset", "coulomb_friction", "inertia", "hump")
    assert "hump.height" in {p.name for p in found.fit.parameters}


def test_a_model_keeps_the_declaration_and_no_code(tmp_path: Path) -> None:
    file = tmp_path / "joint.json"
    fitted().model.save(file)
    content = json.loads(file.read_text())
    (kept,) = (e for e in content["sensor"]["effects"] if e["name"] == "hump")
    assert kept["own"] == {
        "reads": ["output_velocity"],
        "terms": [{"name": "height", "unit": "Nm"}],
        "shapes": [{"name": "width", "unit": "rad/s"}],
    }
    again = flexspline.Model.load(file, own=[swing, hump])
    assert again.to_json() == fitted().model.to_json()
    log = runs(HEIGHT)[0]
    expected = fitted().model.predict(log).predicted
    assert np.array_equal(again.predict(log).predicted, expected)
    parts = again.components(log)
    assert np.allclose(sum(parts.values()), expected, rtol=0.0, atol=1e-12)


def test_a_model_with_an_own_effect_is_loaded_with_its_function_alone(tmp_path: Path) -> None:
    file = tmp_path / "joint.json"
    fitted().model.save(file)
    with pytest.raises(InputError, match=r"json: sensor: effect 'hump' is a Python function"):
        flexspline.Model.load(file)
    other = made_of(lambda temperature: temperature, name="hump")
    with pytest.raises(InputError, match="of the file has the channels output_velocity, and the"):
        flexspline.Model.load(file, own=other)
    renamed = made_of(
        lambda output_velocity, width: output_velocity, name="hump", shapes=WIDTHS,
        terms={"level": "Nm"},
    )  # fmt: skip
    with pytest.raises(InputError, match=r"has the terms height \[Nm\], and the one .* level"):
        flexspline.Model.load(file, own=renamed)


@pytest.mark.parametrize(
    ("place", "text"),
    [
        (("name",), "os.system('true')"),
        (("own", "terms", 0, "name"), "height\\input{x}"),
        (("own", "terms", 0, "unit"), "Nm\n#include"),
        (("own", "reads", 0), "__import__"),
        (("own", "header"), "hump.hpp"),
    ],
)
def test_text_of_another_alphabet_in_a_declaration_is_refused(
    place: tuple[str | int, ...], text: str
) -> None:
    content = json.loads(fitted().model.to_json())
    at = content["sensor"]["effects"][-1]
    for step in place[:-1]:
        at = at[step]
    at[place[-1]] = text
    with pytest.raises(InputError, match="model: at sensor/effects/"):
        flexspline.Model.from_json(json.dumps(content), own=[hump])


def test_a_report_calls_an_own_effect_as_a_name_of_python() -> None:
    assert "'inertia', hump]" in python_call(fitted())


def test_a_copy_of_a_fit_has_the_same_function() -> None:
    assert copy.deepcopy(fitted().part.effects[-1]) == fitted().part.effects[-1]
    assert hump(width=0.3) != hump(width=0.4) and hash(hump(width=0.3)) == hash(hump(width=0.3))


WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "a name of the catalogue": (
        lambda: made_of(np.cos, name="inertia"),
        "effect 'inertia' is one of the catalogue",
    ),
    "a name of another alphabet": (
        lambda: made_of(np.cos, name="a\nb"),
        r"effect 'a\\nb' is no name; give lower-case letters",
    ),
    "no terms": (lambda: made_of(np.cos, terms={}), "has no terms"),
    "a unit that is none": (
        lambda: made_of(np.cos, terms={"a": "furlong"}),
        "term 'a' has the unit 'furlong', which is none",
    ),
    "a unit with more behind it": (lambda: made_of(np.cos, terms={"a": "Nm\n"}), r"unit 'Nm\\n'"),
    "a term that is no name": (lambda: made_of(np.cos, terms={"a b": "Nm"}), "term 'a b' is no"),
    "a channel that is none": (
        lambda: made_of(lambda output_velocty: 0),
        r"takes 'output_velocty' \(did you mean 'output_velocity'\?\)",
    ),
    "parameters without a name": (
        lambda: made_of(lambda *a: 0),
        r"takes \*a, which no name gives; write",
    ),
    "a shape that is not taken": (
        lambda: made_of(lambda output_velocity: 0, shapes=WIDTHS),
        "does not take the shape 'width'",
    ),
    "a function of the C library": (lambda: made_of(min), "does not say what it takes"),
    "no channel": (lambda: made_of(lambda width: 0, shapes=WIDTHS), "reads no channel"),
    "a shape of zero": (
        lambda: made_of(lambda output_velocity, a: 0, shapes={"a": ("s", 0.0, 1.0)}),
        "shape 'a' goes from 0 to 1; give bounds above 0",
    ),
    "a shape without bounds": (
        lambda: made_of(lambda output_velocity, a: 0, shapes={"a": "s"}),
        "shape 'a' is 's'; give its unit, lowest and highest",
    ),
    "a start outside": (
        lambda: made_of(lambda output_velocity, width=9.0: 0, shapes=WIDTHS),
        "shape 'width' starts at 9, which is not within 0.02 to 3",
    ),
    "a shape that others share": (
        lambda: made_of(
            lambda output_velocity, direction_width: 0,
            shapes={"direction_width": ("rad/s", 0.01, 1.0)},
        ),
        "shape 'direction_width' is called as a shape that other effects share",
    ),
    "a target that is none": (
        lambda: made_of(lambda output_velocity: 0, targets="sensor_torque"),
        "has the targets 'sensor_torque'; give a list of",
    ),
    "a shape out of its bounds": (lambda: hump(width=5.0), "width = 5.0 rad/s is not within 0.02"),
    "a shape in words": (lambda: hump(width="a"), "'hump': width = 'a' is no finite number; give"),
    "what is no own effect": (
        lambda: flexspline.discover(
            EASY,
            runs(0.0, 600),
            target="sensor_torque",
            own=["hump"],  # type: ignore[list-item]
        ),
        "own holds 'hump'; give what flexspline.own_effect makes",
    ),
    "a search by simulation": (
        lambda: flexspline.discover(EASY, runs(0.0, 600), own=hump, by="simulation"),
        "leave own out",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_declaration_is_refused_in_a_sentence(what: str) -> None:
    call, said = WRONG[what]
    with pytest.raises(InputError, match=said):
        call()


def _double(output_velocity: Array) -> Array:
    output_velocity *= 2.0
    return output_velocity


FAULTY: dict[str, tuple[Callable[..., Any], str]] = {
    "raises": (lambda output_velocity: 1 / 0, "ends with ZeroDivisionError: division by zero"),
    "is short": (lambda output_velocity: output_velocity[:-1], r"shape \(599,\) for 600 rows"),
    "is one number": (lambda output_velocity: 1.0, "returned a float for 600 rows and 1 term"),
    "is nothing": (lambda output_velocity: None, "returned a NoneType"),
    "is complex": (lambda output_velocity: output_velocity + 1j, "array of complex128"),
    "is two": (lambda output_velocity: (output_velocity, output_velocity), "a tuple of 2"),
    "is not finite": (
        lambda output_velocity: np.where(output_velocity > 0.0, 1.0, np.nan),
        r"it is not finite in \d+ of 600 rows, first in row",
    ),
    "looks at other rows": (
        lambda output_velocity: output_velocity - output_velocity.mean(),
        "on log 'run 1' a row of its function depends on other rows",
    ),
    "writes": (_double, "ends with ValueError: output array is read-only"),
    "reads the target": (
        lambda sensor_torque: sensor_torque,
        "reads sensor_torque, of which the target sensor_torque is made",
    ),
    "reads what is not there": (
        lambda motor_current: motor_current,
        "log 'run 1': own needs the channel motor_current; it has time,",
    ),
    "reads an angle that is not measured": (
        lambda motor_position: np.cos(motor_position),
        "log 'run 1': own needs the channel motor_position; it has time,",
    ),
}


@pytest.mark.parametrize("what", FAULTY)
def test_a_faulty_function_is_refused_in_a_sentence(what: str) -> None:
    function, said = FAULTY[what]
    before = runs(0.0, 600)[0]["output_velocity"].copy()
    with pytest.raises(InputError, match=said):
        flexspline.fit([*EASY, made_of(function)], runs(0.0, 600), "sensor_torque", known_load=LOAD)
    assert np.array_equal(runs(0.0, 600)[0]["output_velocity"], before)


def only_of_the_catalogue() -> Iterator[tuple[str, Callable[[], object]]]:
    model = fitted().model
    log = runs(HEIGHT)[0]
    yield (
        "estimate",
        lambda: flexspline.estimate(model.with_estimator(flexspline.Observer(gain=80.0)), log),
    )
    yield "fit_motion", lambda: flexspline.fit_motion([*EASY, hump], [log], "motor_torque")


def test_what_runs_in_the_compiled_core_says_so() -> None:
    for name, call in only_of_the_catalogue():
        with pytest.raises(InputError, match="effect 'hump' is your own, and this runs in the"):
            call()
            pytest.fail(name)


def test_units_of_the_catalogue_are_units_of_ones_own() -> None:
    known = flexspline.CATALOGUE.values()
    for unit in {thing.unit for info in known for thing in (*info.terms, *info.shapes)}:
        assert made_of(lambda output_velocity: 0, terms={"a": unit}).info.terms[0].unit == unit


def test_columns_that_say_the_same_are_named_as_such() -> None:
    made = flexspline.fit([*EASY, drag], runs(0.0, 600), "sensor_torque", known_load=LOAD)
    (group,) = made.confounded
    assert set(group.names) == {"viscous_friction.viscosity", "drag.viscosity"}
