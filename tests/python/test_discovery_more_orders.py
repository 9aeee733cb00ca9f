"""A ripple of the base may lack orders: they are found under its name, and stand beside its own."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import flexspline
from flexspline.discovery.assemble import _as_read
from flexspline.discovery.candidates import OF_BASE
from flexspline.discovery.result import Discovery
from flexspline.effects import Effect, effect
from flexspline.experiment.plan import Outlook, Plan
from flexspline.logs.log import Log
from flexspline.report.discovery import discovery_call

Array = NDArray[np.float64]
Waves = Callable[[Array], Array]

QUANTUM = 2.0 * np.pi / 2**17
FRICTION = ["offset", "coulomb_friction", "viscous_friction"]
SIZE = 0.3  # Nm


def runs(known: Waves, hidden: Waves) -> list[Log]:
    """A joint of 100:1 behind an encoder of 17 bit; waves of the motor's angle, Nm."""
    made, generator = [], np.random.default_rng(3)
    for k in range(4):
        time = np.arange(0.0, 12.0, 1 / 500.0)
        angle = 1.4 * np.sin(2.0 * np.pi * (0.13 + 0.03 * k) * time)
        angle += 0.2 * np.sin(2.0 * np.pi * 0.31 * time + k)
        speed, motor = np.gradient(angle, time), 100.0 * angle
        torque = 0.2 + np.tanh(speed / 0.01) + 0.8 * speed + known(motor) + hidden(motor)
        torque += generator.normal(0.0, 0.05, len(time))
        made.append(
            Log.from_arrays(
                facts={"gear_ratio": 100.0, "pole_pairs": 7, "slots": 12, "name": f"run{k}"},
                time=time,
                output_position=QUANTUM * np.round(angle / QUANTUM),
                motor_torque=0.01 * np.round(torque / 0.01),
            )
        )
    return made


def discovered(known: Effect, logs: list[Log], fixed: Mapping[str, float]) -> Discovery:
    found = flexspline.discover([*FRICTION, known], logs, target="motor_torque", fixed=fixed)
    assert OF_BASE not in str(found) + found.to_json() + str(found.fit)
    return found


@pytest.mark.parametrize(
    ("known", "own", "order", "turns"),
    [
        (effect("wave_generator_ripple", orders=[2]), 2.0, 1, 1.0),
        (effect("output_ripple", orders=[2]), 0.02, 3, 0.01),
    ],
    ids=lambda given: given.name if isinstance(given, Effect) else "",
)
def test_an_order_that_a_ripple_of_the_base_lacks_is_found_under_its_name(
    known: Effect, own: float, order: int, turns: float
) -> None:
    def waves(motor: Array) -> Array:
        return np.asarray(SIZE * np.sin(own * motor))

    def hidden(motor: Array) -> Array:
        return np.asarray(SIZE * np.cos(order * turns * motor + 1.0))

    held = {f"{known.name}.{known.terms[0].name}": 0.0}
    made = discovered(known, runs(waves, hidden), fixed=held)
    assert made.names == (known.name,) and made.unexplained is None
    assert f"lacks {known.name} (more orders):" in " ".join(str(made).split())
    parameters = made.parameters(known.name)
    assert [p.name.split()[:2] for p in parameters] == [
        [f"{known.name}.{wave}", str(order)] for wave in ("cosine", "sine")
    ]
    assert np.linalg.norm([p.value for p in parameters]) == pytest.approx(100.0 * SIZE, rel=0.02)
    assert made.base_orders == {known.name: known.harmonics}
    told = json.loads(made.to_json())
    assert [p["name"] for p in told["found"][0]["parameters"]] == [p.name for p in parameters]
    assert f"orders={{'{known.name}': [{known.harmonics[0][0]}]}}" in discovery_call(made)
    fixed = {p.name for p in made.fit.parameters if p.state == "fixed"}
    assert fixed == {*held}
    (extended,) = [e for e in made.model.part().effects if e.name == known.name]
    assert sorted(k for k, _ in extended.harmonics) == sorted([known.harmonics[0][0], order])


def test_a_plan_names_the_ripple_of_the_base_as_its_user_does() -> None:
    told = f"wave_generator_ripple{OF_BASE}.sine 2"
    outlook = Outlook((told,), 1.0, 0.1, "Nm", 0.0, None)
    plan: Any = Plan(f"It determines {told}.", None, (outlook,), {}, None)  # type: ignore[arg-type]
    made = _as_read(plan)
    assert made is not None and made.sentence == "It determines wave_generator_ripple.sine 2."
    assert made.outlooks[0].names == ("wave_generator_ripple.sine 2",)


def test_a_ripple_that_has_its_orders_lacks_none() -> None:
    def waves(motor: Array) -> Array:
        return np.asarray(SIZE * np.sin(2.0 * motor))

    known = effect("wave_generator_ripple", orders=[2])
    made = discovered(known, runs(waves, np.zeros_like), {})
    assert made.names == () and made.unexplained is None
    assert f"{known.name}.{known.terms[0].name}" in {p.name for p in made.fit.parameters}
    with pytest.raises(flexspline.InputError, match="excluded and in the model"):
        flexspline.discover(
            [known], made.fit.runs[0].log, target="motor_torque", exclude=known.name
        )
