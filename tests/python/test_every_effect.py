"""What holds for every effect of the catalogue: it is asked for, refused, reported and listed."""

from __future__ import annotations

from contextlib import nullcontext
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hidden_logs import FACTS, LOAD, RATIO, friction_of, log_of, noise, rich_run
from undrawn import undrawn

import flexspline
from flexspline import CATALOGUE, InputError, effect
from flexspline.effects import TARGETS, Effect
from flexspline.least_squares.options import shapes_of
from flexspline.logs.checks import check
from flexspline.logs.checks.excitation import channels_asked
from flexspline.logs.log import Log

BASE = ["offset", "viscous_friction"]
DRAWN = "sensor_torque"  # whose figures are drawn, the target of most effects


@cache
def rich_log(without: tuple[str, ...] = ()) -> Log:
    """A run with every channel but those."""
    c = rich_run(5)
    torque = c[LOAD] + friction_of(c) + noise(5, len(c["time"]))
    more = {"sensor_torque": torque, "motor_position": RATIO * c["output_position"] + 1e-4 * torque}
    more["motor_current"] = 10.0 * c["motor_torque"]
    for name in without:
        (more if name in more else c).pop(name)
    return log_of(c, **more)


def with_orders(name: str) -> Effect:
    return effect(name, orders=[1, 2]) if CATALOGUE[name].pairs else effect(name)


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_a_run_with_everything_excites_it(name: str) -> None:
    assert CATALOGUE[name].demands or CATALOGUE[name].traits.constant
    findings = check(rich_log(), effects=[name])
    assert not findings.named("missing_channel"), name
    unexcited = [f.sentence for f in findings.named("no_excitation")]
    assert not unexcited or name in ("time_drift", "wave_generator_ripple", "cogging")
    findings.raise_errors()


TARGET = {"S": "sensor_torque", "M": "motor_current", "D": "torsion"}
NEEDS = [
    (name, asked) for name, info in sorted(CATALOGUE.items()) for asked in channels_asked(info)
]


@pytest.mark.parametrize(("name", "asked"), NEEDS)
@pytest.mark.parametrize("checks", [True, False])
def test_without_a_channel_that_it_needs_it_is_refused_in_one_sentence(
    name: str, asked: str, checks: bool
) -> None:
    channels, target = asked.split(" or "), TARGET[CATALOGUE[name].targets[0]]
    log = rich_log(tuple(channels))
    load = LOAD if LOAD in log and target != "motor_current" else None
    with pytest.raises(InputError) as caught:
        flexspline.fit(["offset", with_orders(name)], log, target, known_load=load, checks=checks)
    said = str(caught.value)
    assert "\n" not in said
    # a torsion is a difference of both angles: without one it is the target that cannot be had
    of_angle = target == "torsion" and channels[0] in ("output_position", "motor_position")
    assert f"target {target}" in said if of_angle else name in said
    assert any(channel in said for channel in channels) or "load" in said


@pytest.mark.parametrize(
    ("spline", "pair", "tells"),
    [
        ("circular", "wave_generator_on_circular_spline", False),
        ("circular", "wave_generator_on_flexspline", True),
        ("flex", "wave_generator_on_flexspline", False),
        ("circular", "motor_on_stator", True),
    ],
)
def test_a_pair_that_turns_with_the_output_needs_its_angle(
    spline: str, pair: str, tells: bool
) -> None:
    """It had been taken for zero where the log has the motor's angle alone."""
    log = rich_log(("output_position",)).with_facts({"output_spline": spline})
    ripple = effect("wave_generator_ripple", orders=[(2, pair)])
    effects = ["offset", "viscous_friction", ripple]
    if tells:
        fit = flexspline.fit(effects, log, "sensor_torque")
        assert np.isfinite([p.value for p in fit.parameters]).all()
        return
    with pytest.raises(InputError, match="wave_generator_ripple needs the channel output_position"):
        flexspline.fit(effects, log, "sensor_torque", checks=False)


@pytest.mark.parametrize("name", ["sensor_nonlinearity", "torque_hysteresis", "sensor_lag"])
def test_an_error_in_the_load_needs_one_known_or_the_models_own(name: str) -> None:
    log = rich_log((LOAD,))
    with pytest.raises(InputError, match=f"'{name}' depends on the load"):
        flexspline.fit([*BASE, name], log, "sensor_torque")


def test_a_current_without_a_torque_constant_is_no_torque_and_the_sentence_says_so() -> None:
    log = rich_log(("motor_torque",))
    with pytest.raises(InputError, match=r"motor_crosstalk needs .*give torque_constant"):
        flexspline.fit([*BASE, "motor_crosstalk"], log, "sensor_torque", known_load=LOAD)
    known = log.with_facts({"torque_constant": 0.1})
    made = flexspline.fit([*BASE, "motor_crosstalk"], known, "sensor_torque", known_load=LOAD)
    assert "motor_torque" in made.part.record["validity"]


@pytest.mark.parametrize("target", ["sensor_torque", "motor_torque", "motor_current", "torsion"])
@pytest.mark.parametrize("half", [0, 1])
def test_a_report_holds_the_effects_of_a_target(target: str, half: int, tmp_path: Path) -> None:
    names = [n for n, info in CATALOGUE.items() if TARGETS[target] in info.targets][half::2]
    if target == "motor_current":  # the model's own load would be in A beside a known one in Nm
        names = [n for n in names if not CATALOGUE[n].carries_load]
    effects = [with_orders(name) for name in names]
    fixed = {shape.name: shape.value(effects) for shape in shapes_of(effects)}
    log = rich_log().with_facts({"torque_constant": 0.1})
    made = flexspline.fit(effects, log, target, known_load=LOAD, fixed=fixed, checks=False)
    with nullcontext() if target == DRAWN else undrawn():
        made.report(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(name in text and name in str(made) for name in names)
    made.model.save(tmp_path / "model.json")
    again = flexspline.Model.load(tmp_path / "model.json")
    expected = made.model.predict(rich_log()).predicted
    assert np.array_equal(again.predict(rich_log()).predicted, expected)


def test_time_counts_from_the_first_row_of_a_run() -> None:
    log = rich_log()
    model = flexspline.Model(
        {"sensor": flexspline.Part("sensor_torque", (effect("time_drift"),), np.array([1.0, 0.0]))}
    )
    late = Log.from_arrays(time=log["time"] + 1.7e9, facts=FACTS)
    assert model.predict(late).predicted == pytest.approx(log["time"], abs=1e-6)


def test_bent_ripple_takes_the_orders_of_the_ripple_beside_it() -> None:
    ripple = effect(
        "wave_generator_ripple", orders=[(1, "motor_on_stator"), (2, "motor_on_stator")]
    )
    log = rich_log()
    made = flexspline.fit(
        [*BASE, ripple, "speed_dependent_ripple"], log, "sensor_torque", known_load=LOAD
    )
    (bent,) = (e for e in made.part.effects if e.name == "speed_dependent_ripple")
    assert bent.harmonics == ripple.harmonics
