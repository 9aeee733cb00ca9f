"""Faults of a recorder are the same in all of its runs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from recorded_joint import LOAD, base, runs

from flexspline.discovery.faults import data_faults, load_delays
from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.logs.checks.consistency import TOLD, measured_gear
from flexspline.logs.log import Log

Array = NDArray[np.float64]

RATE = 500.0
RATIO = 100.0


def swinging(number: int, *, late: float = 0.0, sign: float = 1.0, rough: float = 1e-5) -> Log:
    """A joint with two encoders and friction.

    `late`: of the output's encoder, s. `rough`: its noise, rad.
    """
    rng = np.random.default_rng([number, 5])
    time = np.arange(0.0, 20.0, 1.0 / RATE)

    def angle(t: Array) -> Array:
        return np.asarray(np.sin((0.9 + 0.1 * number) * t) + 0.3 * np.sin(2.3 * t + number))

    velocity = np.gradient(angle(time), time)
    torque = 3.0 * np.tanh(velocity / 0.01) + 4.0 * velocity + rng.normal(0.0, 0.05, time.size)
    return Log.from_arrays(
        time=time,
        output_position=angle(time - late) + rng.normal(0.0, rough, time.size),
        motor_position=RATIO * angle(time),
        motor_torque=sign * torque,
        facts={"name": f"run{number}", "gear_ratio": RATIO, "output_spline": "flex"},
    )


def named(logs: list[Log], name: str) -> list[str]:
    return [f.run for f in data_faults(logs, base(), "motor_torque", None) if f.name == name]


def test_an_encoder_that_is_late_in_all_runs_is_late() -> None:
    assert named([swinging(k, late=5e-4) for k in range(5)], "encoder_delay") == [
        f"run{k}" for k in range(5)
    ]


def test_a_part_of_a_row_that_differs_from_run_to_run_is_torsion() -> None:
    delays = (5e-4, -4e-4, 1e-4, -6e-4, 5e-4)
    assert named([swinging(k, late=d) for k, d in enumerate(delays)], "encoder_delay") == []


def test_one_run_on_another_clock_is_late_alone() -> None:
    logs = [swinging(k, late=6e-3 if k == 2 else 0.0) for k in range(5)]
    assert named(logs, "encoder_delay") == ["run2"]


def test_one_run_is_late_alone_only_beyond_its_own_error() -> None:
    """0.9 rows at an error of a sixth of a row: it might be four standard errors less."""
    logs = [swinging(k, late=1.8e-3, rough=0.02) if k == 2 else swinging(k) for k in range(5)]
    gear = measured_gear(logs[2])
    assert gear is not None and gear.delay > TOLD * gear.delay_error > 1e-3
    assert named(logs, "encoder_delay") == []


def test_a_part_of_a_row_that_few_runs_show_is_not_that_of_a_recorder() -> None:
    """All lean the same way, and all but one by no more than their errors."""
    logs = [swinging(k, late=3e-4, rough=3e-4 if k == 3 else 8e-3) for k in range(5)]
    gears = [measured_gear(log) for log in logs]
    shown = [gear is not None and gear.delay > TOLD * gear.delay_error for gear in gears]
    assert shown == [False, False, False, True, False]
    assert named(logs, "encoder_delay") == []


def test_an_effect_of_the_load_asks_for_the_channel_that_is_the_known_load() -> None:
    log = runs(1, target="motor_torque")[0]
    columns = {name: log[name] for name in log.channels if name != LOAD}
    logs = [Log.from_arrays(facts=dict(log.facts), **columns, sensor_torque=log[LOAD])]
    effects = [*base(), effect("torque_constant_error")]
    assert data_faults(logs, effects, "motor_torque", "sensor_torque") == ()
    with pytest.raises(InputError, match="torque_constant_error needs reference_torque"):
        data_faults(logs, effects, "motor_torque", None)
    with pytest.raises(InputError, match="temperature_dependent_friction needs temperature"):
        warm = [*effects, effect("temperature_dependent_friction")]
        data_faults(logs, warm, "motor_torque", "sensor_torque")


@pytest.mark.parametrize(("flipped", "told"), [(1, 0), (3, 3), (5, 5)])
def test_a_sign_is_flipped_in_at_least_half_of_the_runs(flipped: int, told: int) -> None:
    logs = [swinging(k, sign=-1.0 if k < flipped else 1.0) for k in range(5)]
    assert len(named(logs, "torque_sign")) == told


@pytest.mark.parametrize("late", [1.2e-3, -1.2e-3])
def test_the_channel_that_is_late_is_named_with_its_repair(late: float) -> None:
    logs = runs(2)
    faults = load_delays(logs, "motor_torque", LOAD, late)
    channel = LOAD if late > 0.0 else "motor_torque"
    assert [f.run for f in faults] == [log.name for log in logs]
    assert all(f.channel == channel and f.size == abs(late) for f in faults)
    assert all(f"shift={channel}:0.0012" in f.sentence for f in faults)


@pytest.mark.parametrize(("every", "grave"), [(1000, False), (50, True)])
def test_few_missing_rows_need_no_repair_and_are_not_to_be_fixed_first(
    every: int, grave: bool
) -> None:
    whole = swinging(0)
    kept = np.flatnonzero(np.arange(len(whole)) % every != 7)
    faults = data_faults([whole.rows(kept, note="a bus loses rows")], base(), "motor_torque", None)
    assert [fault.grave for fault in faults if fault.name == "dropped_samples"] == [grave]
