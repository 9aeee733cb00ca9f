"""The known load is put on the clock of the target, and names beside it stand."""

from __future__ import annotations

import numpy as np
import pytest
from driven_joint import driven, strokes, waves
from numpy.typing import NDArray
from recorded_joint import FACTS, QUANTUM, RATE, base, exact, friction
from recorded_joint import runs as joint_runs
from scipy.signal import lfilter, sawtooth
from test_hidden_in_torsion import dead_zone, mesh
from torsion_logs import C_M, LOAD, log_of, noise, stiffness_run

import flexspline
from flexspline.discovery.faults import DataFault, with_torque_on_time
from flexspline.effects import effect
from flexspline.logs.checks import check, check_runs
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


def stepped(seed: int, lag: float) -> Log:
    """A load of ramps and steps behind a first-order lag of the sensor, s, and noise of 0.2 Nm.

    The lag follows the load of the same row, half a row sooner than that of the time between.
    """
    c, generator = exact(seed), np.random.default_rng([seed, 77])
    load = 8.0 * sawtooth(2.0 * np.pi * (0.2 + 0.05 * seed) * c["time"] + seed, 0.5)
    load += 4.0 * np.sign(np.sin(2.0 * np.pi * 0.37 * c["time"] + seed))
    kept = np.exp(-1.0 / RATE / lag)
    late, _ = lfilter([1.0 - kept], [1.0, -kept], load, zi=[kept * load[0]])
    return Log.from_arrays(
        facts={"name": f"run{seed}", **FACTS},
        time=c["time"],
        output_position=QUANTUM * np.round(c["output_position"] / QUANTUM),
        reference_torque=load + generator.normal(0.0, 0.02, len(load)),
        sensor_torque=late + friction(c) + generator.normal(0.0, 0.2, len(load)),
    )


def test_a_lag_whose_load_steps_is_named_though_functions_explain_more_than_its_first_order() -> (
    None
):
    lag = 0.15
    logs = [stepped(seed, lag) for seed in range(4)]
    made = flexspline.discover(base(), logs, target="sensor_torque", known_load=LOAD)
    assert made.names == ("sensor_lag",) and made.unexplained is None
    lateness, half_a_row = made.parameters("sensor_lag")[0], 0.5 / RATE
    assert lateness.value == pytest.approx(lag - half_a_row, rel=0.02)
    assert made.final_rmse < 1.05 * 0.2  # of the noise: steps of the load are no noise of the cell


PLAIN = ["offset", "coulomb_friction", "viscous_friction", "inertia", "gravity"]


def drives(late: float) -> list[Log]:
    """Three runs of one drive: strokes, and waves either way."""
    angles = (strokes(), waves(), waves()[::-1].copy())
    return [driven(angle, late, inertia=0.6, bits=17, seed=k) for k, angle in enumerate(angles)]


def test_a_drive_that_is_late_in_one_run_is_late_in_all_that_are_like_it() -> None:
    single = [[fault.name for fault in check(log).faults] for log in drives(0.006)]
    assert single == [["torque_delay"], [], []]
    for findings in check_runs(drives(0.006)):
        (late,) = findings.faults
        assert late.name == "torque_delay" and late.size == pytest.approx(0.006, abs=0.001)
        assert "Seen in" not in late.sentence
    for findings in check_runs([drives(0.006)[0], *drives(0.0)[1:]]):
        said = "".join(fault.sentence for fault in findings.faults)
        assert not said or "Seen in 1 of 3 runs; of the others 2 show another or none." in said


@pytest.mark.parametrize("hidden", ["", "gravity"])
def test_friction_of_a_late_drive_is_no_presliding(hidden: str) -> None:
    effects = [name for name in PLAIN if name != hidden]
    made = flexspline.discover(effects, drives(0.006), target="motor_torque")
    assert made.names == ((hidden,) if hidden else ()) and made.unexplained is None
    assert [fault.name for fault in made.data_faults] == ["torque_delay"] * 3
    assert all("all else moved 5.9" in fault.sentence for fault in made.data_faults)
    values = {p.name: p for p in made.fit.parameters}
    level = values["coulomb_friction.level"]
    assert level.interval[0] < 4.0 < level.interval[1]
    assert values["inertia.inertia"].value == pytest.approx(0.6, rel=0.02)


def test_a_drive_that_one_of_three_runs_shows_late_stays_as_recorded() -> None:
    logs = [drives(0.006)[0], *drives(0.0)[1:]]
    late = DataFault("drive", "torque_delay", "motor_torque", 0.005, "s", (0, 10), "It is late.")
    for faults in ((late,), ()):
        assert with_torque_on_time(logs, faults, "motor_torque") == (logs, faults, 0.0)
    both = (late, late)
    assert with_torque_on_time(logs, both, "sensor_torque") == (logs, both, 0.0)
    moved, said, seconds = with_torque_on_time(logs, both, "motor_torque")
    assert seconds == 0.005
    assert said[0].sentence == "It is late. Names are looked for with all else moved 5 ms later."
    for log, at in zip(moved, logs, strict=True):
        kept = np.isin(at["time"], log["time"])
        assert np.array_equal(log["motor_torque"], at["motor_torque"][kept])
        angle = np.interp(log["time"] - 0.005, at["time"], at["output_position"])
        assert log["output_position"] == pytest.approx(angle, abs=1e-12)


def at_a_sensor(late: float) -> list[Log]:
    """Those drives read by a sensor at the output, their motion late by so many s."""
    return [
        Log.from_arrays(
            time=log["time"], output_position=log["output_position"],
            sensor_torque=80.0 * log["motor_torque"],
            facts={"gear_ratio": 80.0, "name": f"run{k}"},
        )
        for k, log in enumerate(drives(-late))
    ]  # fmt: skip


def test_friction_of_a_late_motion_is_no_presliding() -> None:
    made = flexspline.discover(PLAIN, at_a_sensor(0.004), target="sensor_torque")
    assert made.names == ()
    assert [fault.name for fault in made.data_faults] == ["position_delay"] * 3
    for fault in made.data_faults:
        assert "the motion moved 4." in fault.sentence and "median of the runs" in fault.sentence
    assert made.final_rmse < 1.05 * 0.2  # of the noise
    values = {p.name: p for p in made.fit.parameters}
    assert values["inertia.inertia"].value == pytest.approx(0.6, rel=0.05)


def test_a_motion_late_by_less_than_half_a_row_makes_no_presliding() -> None:
    """Only one of three runs shows it, so that nothing is moved, and friction turns over early."""
    made = flexspline.discover(PLAIN, at_a_sensor(0.0015), target="sensor_torque")
    assert made.names == () and made.unexplained is not None


def filtered(target: str, hertz: float) -> list[Log]:
    """Those drives, their torque behind a first-order low pass, read as a drive's or a sensor's."""
    kept, scale = np.exp(-2.0 * np.pi * hertz / 5000.0), 80.0 if target == "sensor_torque" else 1.0
    logs = []
    for seed, angle in enumerate((strokes(), waves(), waves()[::-1].copy(), strokes(20.0))):
        log = driven(angle, 0.0, inertia=0.6, seed=seed, every=1, noisy=False)
        torque = lfilter([1.0 - kept], [1.0, -kept], scale * log["motor_torque"])[::20]
        torque += np.random.default_rng(seed).normal(0.0, 0.2 * scale / 80.0, len(torque))
        step = 2.0 * np.pi / 2**17
        position = step * np.round(log["output_position"][::20] / step)
        logs.append(Log.from_arrays(
            time=log["time"][::20], output_position=position, **{target: torque},
            facts={"gear_ratio": 80.0, "name": f"run{seed}"},
        ))  # fmt: skip
    return logs


@pytest.mark.parametrize("target", ["motor_torque", "sensor_torque"])
def test_what_a_filter_of_the_torque_makes_of_reversals_is_no_presliding(target: str) -> None:
    """It stands a delay of 10 ms for what is a lag of 16 ms, and the rest is like a spring's."""
    made = flexspline.discover(PLAIN, filtered(target, 10.0), target=target)
    assert made.names == ()
    assert "by which the torque is late" in made.refused["presliding_friction"]
    assert {fault.name for fault in made.data_faults} == {"torque_delay"}


@pytest.mark.parametrize("late", [0.0, 0.01])
def test_presliding_beside_a_late_sensor_keeps_its_name(late: float) -> None:
    logs = [
        Log.from_arrays(
            time=log["time"], output_position=log["output_position"],
            sensor_torque=80.0 * log["motor_torque"],
            facts={"gear_ratio": 80.0, "name": f"run{k}"},
        )
        for k, angle in enumerate((strokes(), waves(), waves()[::-1].copy(), strokes(20.0)))
        for log in [driven(angle, late, inertia=0.6, presliding=0.003, bits=17, seed=k)]
    ]  # fmt: skip
    made = flexspline.discover(PLAIN, logs, target="sensor_torque")
    assert made.names == ("presliding_friction",)


def test_friction_as_late_as_the_sensor_makes_presliding_beside_its_lag_unsure() -> None:
    """A lag in the model is one of the load alone: what it leaves of friction is like a spring."""
    logs = []
    for log in filtered("sensor_torque", 10.0):
        time, kept = np.arange(200_000) / 5000.0, np.exp(-2.0 * np.pi * 10.0 / 5000.0)
        waves_of = ((12.0, 0.23, 0.4), (8.0, 0.61, 1.0), (4.0, 1.3, 2.0))
        load = np.asarray(sum(a * np.sin(2.0 * np.pi * f * time + p) for a, f, p in waves_of))
        late = lfilter([1.0 - kept], [1.0, -kept], load, zi=[kept * load[0]])[0]
        noise = np.random.default_rng([len(logs), 3]).normal(0.0, 0.05, len(log))
        channels = {
            "reference_torque": load[::20] + noise,
            "sensor_torque": log["sensor_torque"] + late[::20],
        }
        logs.append(log.with_columns(channels, note="under a load"))
    made = flexspline.discover(PLAIN, logs, target="sensor_torque", known_load=LOAD)
    assert made.found[0].effect == "sensor_lag" and made.found[0].confidence > 0.9
    for other in made.found[1:]:
        assert other.confidence <= 0.5
    assert "friction that is as late as the sensor" in str(made)
