"""Many short runs, with an offset each: the same fit as with a column for each, in linear work."""

from __future__ import annotations

import importlib
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from fit_logs import FRICTION, WIDTH, autoregressive, friction, log_with, rows_of

import flexspline
from flexspline import FitOptions, _core
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log

offsets = importlib.import_module("flexspline.least_squares.per_run_terms")
NAMES = ["viscous_friction", "offset", "coulomb_friction", "inertia"]


def run_of(number: int, rows: int = 60, phi: float = 0.0, shift: float = 0.2) -> Log:
    """A short stroke at 100 Hz, with an offset of its own."""
    generator = np.random.default_rng([number, 1])
    time = np.arange(rows) / 100.0
    omega, phase = 2 * np.pi * generator.uniform(1, 4), generator.uniform(0, 6.28)
    channels = {
        "time": time,
        "output_position": 0.3 * np.sin(omega * time + phase),
        "output_velocity": 0.3 * omega * np.cos(omega * time + phase),
        "output_acceleration": -0.3 * omega**2 * np.sin(omega * time + phase),
    }
    bare = log_with(channels, name=f"run {number}")
    torque = rows_of(friction(), bare) @ FRICTION + shift * generator.normal()
    return log_with(channels, torque + autoregressive(generator, rows, phi), f"run {number}")


def fitted(logs: list[Log], **options: object) -> Fit:
    return flexspline.fit(NAMES, logs, "sensor_torque", checks=False, **options)  # type: ignore[arg-type]


def with_columns(monkeypatch: pytest.MonkeyPatch, make: Callable[[], Fit]) -> Fit:
    """A fit with a column for the offset of each run."""
    with monkeypatch.context() as patched:
        patched.setattr(offsets, "MANY_RUNS", 10**9)
        return make()


@pytest.mark.parametrize("phi", [0.0, 0.7])
@pytest.mark.parametrize("lowpass", [None, 12.0])
def test_offsets_that_are_taken_out_are_those_of_a_column_for_each_run(
    monkeypatch: pytest.MonkeyPatch, phi: float, lowpass: float | None
) -> None:
    logs = [run_of(k, 80, phi) for k in range(20)]

    def make() -> Fit:
        return fitted(logs, options=FitOptions(offset_per_run=True), lowpass=lowpass)

    few, one = make(), with_columns(monkeypatch, make)
    # Behind a low pass one row of three is news, whose mean is not that of all rows; and columns
    # for all offsets leave the noise model fewer orders.
    near = 0.1 if lowpass is None else 0.3
    assert [p.name for p in few.parameters] == [p.name for p in one.parameters]
    assert [e.name for e in few.part.effects] == NAMES
    assert few.part.coefficients == pytest.approx(one.part.coefficients, rel=1e-7, abs=1e-9)
    for own, other in zip(few.parameters, one.parameters, strict=True):
        assert own.value == pytest.approx(other.value, rel=1e-6, abs=1e-8)
        assert own.standard_error == pytest.approx(other.standard_error, rel=near)
        assert own.naive_error == pytest.approx(other.naive_error, rel=near)
        worth = 4.0 * near  # rows times the square of the ratio of both errors
        assert own.effective_samples == pytest.approx(other.effective_samples, rel=worth)
        assert (own.unit, own.state) == (other.unit, other.state)
    assert few.rmse == pytest.approx(one.rmse, rel=1e-9)
    assert few.cv_rmse == pytest.approx(one.cv_rmse, rel=1e-4)
    noise, other_noise = few.uncertainty.noise, one.uncertainty.noise
    assert noise.parameters == other_noise.parameters
    assert noise.variance == pytest.approx(other_noise.variance, rel=near)


def test_the_offset_of_each_of_many_runs_covers_the_truth() -> None:
    logs = [run_of(k, 60, 0.6) for k in range(100)]
    made = fitted(logs, options=FitOptions(offset_per_run=True), fixed={"direction_width": WIDTH})
    truth = []
    for k in range(100):
        generator = np.random.default_rng([k, 1])
        generator.uniform(1, 4), generator.uniform(0, 6.28)
        truth.append(FRICTION[0] + 0.2 * generator.normal())
    own = [p for p in made.parameters if p.name.startswith("offset.")]
    away = [(p.value - t) / p.standard_error for p, t in zip(own, truth, strict=True)]
    # 100 standardised deviations: mean square 1 ± √(2/100), four sigma.
    assert abs(np.mean(np.square(away)) - 1.0) < 4 * np.sqrt(2 / 100)
    model = flexspline.Model.from_json(made.model.to_json())
    assert model.part().coefficients[1] == pytest.approx(np.mean([p.value for p in own]))
    assert "offset.run 7" in str(made)


def test_what_a_user_says_of_one_offset_is_heard() -> None:
    logs = [run_of(k) for k in range(20)]
    made = fitted(logs, options=FitOptions(offset_per_run=True), fixed={"offset.run 3": 0.5})
    assert made["offset.run 3"].value == 0.5 and made["offset.run 3"].state == "fixed"


def test_a_term_that_is_constant_in_each_run_is_not_determined_beside_the_offsets() -> None:
    logs = [
        run_of(k).with_columns({"temperature": np.full(60, 20.0 + k)}, note="a room")
        for k in range(20)
    ]
    made = flexspline.fit(
        [*NAMES, "temperature_drift"],
        logs,
        "sensor_torque",
        options=FitOptions(offset_per_run=True),
        checks=False,
    )
    assert not made["temperature_drift.linear"].determined
    assert made["viscosity"].determined


class Counted:
    """A design that counts the rows it is asked for."""

    work = 0

    def __init__(self, *given: object, **gear: object) -> None:
        self._own = _core.Design(*given, **gear)

    def __getattr__(self, name: str) -> object:
        method = getattr(self._own, name)

        def call(channels: dict[str, np.ndarray], *rest: object) -> object:
            blocks = next((r for r in rest if isinstance(r, list)), None)
            length = len(next(iter(channels.values())))
            Counted.work += sum(b - a for a, b in blocks) if blocks else length
            return method(channels, *rest)

        return call


@pytest.mark.parametrize("own", [False, True])
def test_work_and_memory_grow_with_the_runs_and_not_with_their_square(
    monkeypatch: pytest.MonkeyPatch, own: bool
) -> None:
    problem = importlib.import_module("flexspline.least_squares.problem").Problem
    monkeypatch.setattr(
        problem,
        "design",
        lambda self, effects: Counted([e.for_core() for e in effects], **self.gear),
    )
    taken = {}
    for count in (60, 240):
        logs = [run_of(k) for k in range(count)]
        Counted.work = 0
        tracemalloc.start()
        made = fitted(
            logs,
            options=FitOptions(offset_per_run=own),
            fixed={"direction_width": WIDTH},
        )
        taken[count] = (Counted.work / count, tracemalloc.get_traced_memory()[1] / count)
        tracemalloc.stop()
        assert made.folds <= 40
    assert taken[240][0] <= 1.1 * taken[60][0]
    assert taken[240][1] <= 1.3 * taken[60][1]


def test_what_is_left_of_a_run_left_out_is_that_of_a_column_for_its_offset(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    logs = [run_of(k, 80, 0.7) for k in range(20)]

    def make() -> Fit:
        held = {"direction_width": WIDTH}
        return fitted(logs, options=FitOptions(offset_per_run=True), fixed=held)

    few, one = make(), with_columns(monkeypatch, make)
    for own, other in zip(few.runs, one.runs, strict=True):
        assert own.held_out == pytest.approx(other.held_out, abs=1e-6, nan_ok=True)
