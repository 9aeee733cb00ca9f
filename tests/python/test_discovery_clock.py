"""The known load is put on the clock of the target, and names beside it stand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from recorded_joint import base
from recorded_joint import runs as joint_runs
from test_hidden_in_torsion import dead_zone, mesh
from torsion_logs import C_M, LOAD, log_of, noise, stiffness_run

import flexspline
from flexspline.discovery.discovering import _Recorded
from flexspline.effects import effect
from flexspline.logs.log import Log

Array = NDArray[np.float64]

BASE = ["offset", effect("mesh_compliance", mesh_shape=C_M)]
OUTPUT, MOTOR = 2.0 * np.pi / 2**22, 2.0 * np.pi / 2**15  # rad, quanta of the encoders
CELL = 0.02  # Nm, noise of the load cell


def torsion_run(seed: int, *, late: float, hidden: bool) -> Log:
    """A gear under load, with a recorder's quanta and noise; the load cell is late, s."""
    c, generator = stiffness_run(seed, 6000), np.random.default_rng([seed, 61])
    torsion = 0.02 + mesh(c) + (dead_zone(c) if hidden else 0.0) + noise(seed, 6000)
    c["output_position"] = OUTPUT * np.round(c["output_position"] / OUTPUT)
    c[LOAD] = np.interp(c["time"] - late, c["time"], c[LOAD]) + generator.normal(0.0, CELL, 6000)
    log = log_of(c, torsion, f"run{seed}")
    motor = MOTOR * np.round(log["motor_position"] / MOTOR)
    return log.with_columns({"motor_position": motor}, note="quanta of the motor's encoder")


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("late", [4e-3, -4e-3, 0.0])
def test_a_load_that_is_late_behind_the_torsion_is_a_fault_and_no_name(
    late: float, hidden: bool
) -> None:
    logs = [torsion_run(seed, late=late, hidden=hidden) for seed in range(4)]
    made = flexspline.discover(BASE, logs, target="torsion", known_load=LOAD)
    assert made.names == (("backlash",) if hidden else ()) and made.unexplained is None
    faults = [f for f in made.data_faults if f.name == "load_delay"]
    assert len(faults) == (4 if late else 0)
    for fault in faults:
        assert fault.size == pytest.approx(abs(late), rel=0.1)
        assert ("early" if late < 0.0 else "late") in fault.sentence
        assert f"shift={LOAD}:{'-' if late < 0.0 else ''}0.00" in fault.sentence


@pytest.mark.parametrize("late", [0.0015, 0.13])
def test_a_delay_is_known_as_well_where_it_is_long(late: float) -> None:
    logs = joint_runs(2, target="motor_torque", late=late)
    made = flexspline.discover(base(), logs, target="motor_torque", known_load=LOAD)
    sizes = [fault.size for fault in made.data_faults if fault.name == "load_delay"]
    assert sizes == pytest.approx([late, late], abs=1e-4)


def arm_run(seed: int, late: float) -> Log:
    """A sensor behind an arm of 20 Nm, 1 % too large; the load cell is late, s."""
    generator, time = np.random.default_rng([seed, 7]), np.arange(10_000) / 500.0
    rates, phases = generator.uniform(0.2, 1.5, 4), generator.uniform(0.0, 6.0, 4)

    def angle(at: Array) -> Array:
        return np.asarray(np.sin(2.0 * np.pi * rates * at[:, None] + phases) @ [0.7, 0.3, 0.2, 0.1])

    load, before = (20.0 * np.sin(angle(at)) for at in (time, time - late))
    return Log.from_arrays(
        time=time,
        output_position=OUTPUT * np.round(angle(time) / OUTPUT),
        sensor_torque=0.1 + 1.01 * load + generator.normal(0.0, 0.05, time.size),
        reference_torque=before + generator.normal(0.0, 0.04, time.size),
        facts={"gear_ratio": 100, "name": f"run {seed}"},
    )


@pytest.mark.parametrize("late", [0.0, 0.005, 0.012])
def test_a_load_cell_that_is_late_behind_an_arm_is_a_fault(late: float) -> None:
    """Functions of the angle tell hardly anything of the delay; all is explained by it alone."""
    logs = [arm_run(seed, late) for seed in range(2)]
    made = flexspline.discover(
        ["offset", "gain_error"], logs, target="sensor_torque", known_load=LOAD
    )
    assert made.names == () and made.unexplained is None
    sizes = [fault.size for fault in made.data_faults if fault.name == "load_delay"]
    assert sizes == pytest.approx([late, late] if late else [], rel=0.02)
    assert made.base_rmse < 0.07


def test_plain_ripple_and_cogging_are_said_and_not_ripple_that_changes_with_speed() -> None:
    """One effect holds the orders of both, and with a resonance far away it is their sum."""

    def ripple(c: dict[str, Array]) -> Array:
        motor = 101.0 * c["output_position"]
        return np.asarray(0.2 * np.cos(2.0 * motor + 0.3) + 0.1 * np.sin(14.0 * motor))

    def fine(log: Log) -> Log:
        return log.with_facts({"pole_pairs": 7, "name": log.name})

    logs = [fine(log) for log in joint_runs(4, added=ripple, target="motor_torque")]
    made = flexspline.discover(base(), logs, target="motor_torque", known_load=LOAD)
    assert set(made.names) == {"wave_generator_ripple", "cogging"}


@pytest.mark.parametrize(
    ("beside", "without", "searched"),
    [(0.6, 0.6, False), (0.6, 0.4, True), (0.4, 0.6, True)],
)
def test_without_a_lag_names_are_looked_for_anew_but_where_functions_explain_more(
    beside: float, without: float, searched: bool
) -> None:
    """With the lag and without: where one of both leaves an answer possible, names are sought."""
    same = SimpleNamespace(unexplained=without)
    made: Any = SimpleNamespace(
        unexplained_beyond=lambda given: beside, in_runs=lambda context, plain: same
    )
    runs: Any = SimpleNamespace(context=lambda free: [free], analysed=lambda free: "anew")
    assert _Recorded.without_lag(runs, made, ()) == ("anew" if searched else same)
