"""`find_delay` and the jackknife: what every check of a delay, a gear or a sign rests on."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from driven_joint import driven, strokes, waves
from hidden_logs import noise, slipping
from numpy.typing import NDArray

import flexspline
from flexspline.logs import Log
from flexspline.logs.checks import check, check_runs, consistency
from flexspline.logs.checks.consistency import (
    SURE,
    Delay,
    _both_ways,
    _lowest,
    find_delay,
    gear,
    motion_columns,
    solve_with_error,
    torque,
)
from flexspline.logs.checks.samples import Motion, motion_of
from flexspline.logs.repairs import repaired

Array = NDArray[np.float64]

WITHIN, STEP = 0.08, 0.02  # s
TIME = np.arange(4000) / 200.0


def motion(time: Array) -> Array:
    """Two columns, (N, 2), that no delay turns into each other."""
    return np.column_stack((np.sin(2.1 * time) + np.sin(7.7 * time + 1.0), np.cos(5.3 * time)))


def delay_of(seconds: float, within: float = WITHIN, noise: float = 0.0, seed: int = 0) -> Delay:
    target = motion(TIME - seconds) @ [2.0, -0.7] + 3.0
    target += noise * np.random.default_rng(seed).normal(size=len(TIME))
    valid = (TIME[0] + within <= TIME) & (TIME[-1] - within >= TIME)
    found = find_delay(TIME, target, motion(TIME), valid, within, STEP)
    assert found is not None
    return found


@pytest.mark.parametrize("seconds", [-0.079, -0.031, 0.0, 0.009, 0.05, 0.079])
def test_a_delay_is_found_wherever_it_is_looked_for(seconds: float) -> None:
    found = delay_of(seconds)
    assert found.seconds == pytest.approx(seconds, abs=1e-5)
    assert found.coefficients == pytest.approx([2.0, -0.7], rel=1e-4)
    assert found.explained == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("seconds", [-0.015, 0.015])
def test_the_scan_looks_to_both_sides_though_it_be_one_step_wide(seconds: float) -> None:
    assert delay_of(seconds, within=STEP).seconds == pytest.approx(seconds, abs=1e-5)


def test_the_error_of_a_delay_is_as_large_as_delays_scatter() -> None:
    found = [delay_of(0.013, noise=0.3, seed=seed) for seed in range(60)]
    away = [(one.seconds - 0.013) / one.error for one in found]
    # mean square of 60: 1 ± √(2/60), four sigma; sixteen blocks make an error uncertain by a sixth
    assert abs(np.mean(np.square(away)) - 1.0) < 4 * np.sqrt(2 / 60) + 1 / 6


def test_coefficients_and_errors_have_the_unit_of_the_target_over_that_of_the_column() -> None:
    generator = np.random.default_rng(3)
    design = generator.normal(size=(3000, 2))
    target = design @ [1.5, -4.0] + generator.normal(size=3000)
    values, errors = solve_with_error(design, target)
    assert errors == pytest.approx(1.0 / np.sqrt(3000), rel=0.6)  # of 16 blocks
    assert np.all(np.abs(values - [1.5, -4.0]) < 5.0 * errors)
    scaled, errors_scaled = solve_with_error(design * [1e3, 1e-3], 10.0 * target)
    assert scaled == pytest.approx(values * [1e-2, 1e4])
    assert errors_scaled == pytest.approx(errors * [1e-2, 1e4])


# What is made of it: a delay that matters is a finding, and one that does not is none


def encoders(rows_late: float) -> Log:
    """Two encoders without noise, the one of the output late by so many rows."""
    time = np.arange(4000) / 200.0

    def angle(at: Array) -> Array:
        return np.asarray(0.8 * np.sin(1.3 * at) + 0.3 * np.sin(3.1 * at + 1.0))

    return Log.from_arrays(
        time=time,
        output_position=angle(time - rows_late / 200.0),
        motor_position=100.0 * angle(time),
        facts={"gear_ratio": 100.0, "output_spline": "flex"},
    )


@pytest.mark.parametrize(("rows_late", "told"), [(0.02, False), (0.3, True)])
def test_encoders_a_small_part_of_a_row_apart_are_no_fault_however_sure_it_is(
    rows_late: float, told: bool
) -> None:
    assert ["encoder_delay" in one.name for one in gear(encoders(rows_late))].count(True) == told


def braked(
    load: Callable[[Array, Array], Array], late: float = 0.0, *, behind: str = "", drive: str = ""
) -> Log:
    """A gear of 9000 Nm/rad that carries `load(time, velocity)`, the output's encoder late.

    `behind`, `drive`: the channels of the load and of the drive's torque, if there.
    """
    time, rng = np.arange(8000) / 200.0, np.random.default_rng(4)

    def angle(at: Array) -> Array:
        return np.asarray(0.8 * np.sin(1.3 * at) + 0.3 * np.sin(3.1 * at + 1.0))

    velocity = 1.04 * np.cos(1.3 * time) + 0.93 * np.cos(3.1 * time + 1.0)
    carried = load(time, velocity)
    torques = {
        behind: carried + rng.normal(0.0, 0.02, time.size),
        drive: (carried + 6.0 * np.tanh(velocity / 0.01) + 3.0 * velocity) / 100.0,
    }
    return Log.from_arrays(
        time=time,
        output_position=angle(time - late) + rng.normal(0.0, 3e-6, time.size),
        motor_position=100.0 * (angle(time) + carried / 9000.0),
        facts={"gear_ratio": 100.0, "output_spline": "flex", "torque_constant": 0.1},
        **{channel: torque for channel, torque in torques.items() if channel},
    )


def brake(_: Array, velocity: Array) -> Array:
    return 8.0 * velocity


def braked_mass(time: Array, velocity: Array) -> Array:
    return brake(time, velocity) + np.gradient(velocity, time)


def winch(_: Array, velocity: Array) -> Array:
    return np.asarray(-9.0 * np.tanh(velocity / 0.3))


@pytest.mark.parametrize("channel", ["reference_torque", "sensor_torque"])
@pytest.mark.parametrize("load", [brake, braked_mass])
def test_torsion_under_a_brake_is_no_late_encoder(
    load: Callable[[Array, Array], Array], channel: str
) -> None:
    (found,) = gear(braked(load, behind=channel))
    assert (found.name, found.severity) == ("encoder_delay", "note")
    assert found.size == pytest.approx(8.0 / 9000.0, rel=0.05)
    assert f"of a gear of 9e+03 Nm/rad under {channel}" in found.sentence
    assert found.remedy.startswith("Leave it as torsion")


def test_torsion_under_a_load_that_drives_the_joint_is_no_late_encoder() -> None:
    (found,) = gear(braked(winch, behind="reference_torque"))
    assert found.severity == "note" and found.channel == "motor_position"
    assert "torsion under reference_torque explains as much" in found.sentence


@pytest.mark.parametrize("late", [0.002, -0.002])
def test_a_late_encoder_is_told_beside_torsion_by_as_much_as_it_is_late(late: float) -> None:
    (found,) = gear(braked(winch, late, behind="reference_torque"))
    assert found.severity == "fault" and found.size == pytest.approx(abs(late), rel=0.02)
    assert "more than torsion under reference_torque explains" in found.sentence
    assert found.remedy.startswith("Ask for the repair shift=")


@pytest.mark.parametrize("drive", ["", "motor_torque", "motor_current"])
def test_without_a_torque_behind_the_gear_a_brake_is_not_excluded(drive: str) -> None:
    log = braked(brake, drive=drive)
    if drive == "motor_current":
        log = log.with_columns({drive: log[drive] / 0.1}, note="of a torque constant")
    (found,) = gear(log)
    assert "or the gear twists under a brake or friction" in found.sentence
    sure = "the gear is stiffer" if drive else "nothing at the output does so"
    assert found.remedy.startswith(f"If {sure}, ask for the repair shift=output_position:0.000889")
    # (8 + 3) Nm s/rad over 0.889 ms, and a part of Coulomb friction
    assert ("only a gear softer than 1.2e+04 Nm/rad" in found.sentence) == bool(drive)


def late_torque(noise: float, rows: int = 6000, late: float = 0.004) -> Log:
    time = np.arange(rows) / 500.0

    def swing(at: Array, turn: int) -> Array:
        """The angle, and with one or two turns its derivatives."""
        waves = ((0.8, 1.3, 0.0), (0.3, 3.1, 1.0), (0.15, 7.3, 2.0))
        return np.asarray(sum(a * w**turn * np.sin(w * at + p + turn * np.pi / 2)
                              for a, w, p in waves))  # fmt: skip

    at = time - late
    reading = 2.0 * np.sin(swing(at, 0)) + 0.4 * np.tanh(swing(at, 1) / 0.02)
    reading += noise * np.random.default_rng(8).normal(size=len(time))
    return Log.from_arrays(
        time=time, output_position=swing(time, 0), sensor_torque=reading,
        facts={"gear_ratio": 100.0, "output_spline": "flex"},
    )  # fmt: skip


@pytest.mark.parametrize("late", [0.0015, 0.004])  # s; a row is 0.002
def test_a_late_torque_is_told_where_its_delay_explains_something(late: float) -> None:
    (found,) = torque(late_torque(1e-3, late=late))
    assert found.name == "torque_delay" and found.size == pytest.approx(late, rel=0.2)


def late_drive(late: float, presliding: float = 0.0) -> Log:
    """A drive with friction, inertia and gravity, late by so many s; the slip of its friction."""
    time = np.arange(20_000) / 500.0

    def swing(at: Array, turn: int) -> Array:
        waves = ((0.8, 0.6, 0.0), (0.3, 1.1, 1.0), (0.15, 2.3, 2.0))
        return np.asarray(sum(a * w**turn * np.sin(w * at + p + turn * np.pi / 2)
                              for a, w, p in waves))  # fmt: skip

    at = time - late
    slip = np.tanh(swing(at, 1) / 0.005)
    if presliding:
        angle, slip = swing(at, 0), np.zeros_like(time)
        for k in range(1, len(time)):  # elastic until it slips
            slip[k] = np.clip(slip[k - 1] + (angle[k] - angle[k - 1]) / presliding, -1.0, 1.0)
    torque = 6.0 * slip + 5.0 * swing(at, 1) + 1.8 * swing(at, 2) + 9.0 * np.cos(swing(at, 0))
    torque += 0.3 * np.random.default_rng(5).normal(size=len(time))
    return Log.from_arrays(
        time=time, output_position=swing(time, 0), motor_torque=torque / 100.0,
        facts={"gear_ratio": 100.0, "output_spline": "flex", "name": "drive"},
    )  # fmt: skip


@pytest.mark.parametrize(("late", "told"), [(0.0, False), (0.01, True), (0.02, True)])
def test_a_drive_that_is_late_is_a_fault_that_a_fit_warns_of(late: float, told: bool) -> None:
    log = late_drive(late)
    faults = check(log).faults
    assert [one.name for one in faults] == ["torque_delay"] * told
    made = flexspline.fit(
        ["coulomb_friction", "viscous_friction", "inertia", "gravity"], log, "motor_torque"
    )
    assert any("shift=motor_torque:" in said for said in made.warnings) is told
    if told:
        assert faults[0].size == pytest.approx(late, rel=0.05)
        asked = faults[0].remedy.split()[-1].rstrip(".")
        assert not check(repaired(log, asked)).named("torque_delay")


@pytest.mark.parametrize(
    ("motion", "inertia"),
    [(strokes, 0.6), (strokes, 3.0), (waves, 3.0)],  # kg·m²
)
def test_the_inertia_of_a_late_drive_does_not_hide_how_late_it_is(
    motion: Callable[[], Array], inertia: float
) -> None:
    """Friction and gravity that are late look like viscous friction and less inertia."""
    assert not check(driven(motion(), 0.0, inertia, 0.0)).faults
    (late,) = check(driven(motion(), 0.006, inertia, 0.0)).faults
    assert late.name == "torque_delay"
    assert late.size == pytest.approx(0.006, abs=0.0012)


def test_a_late_drive_is_told_far_from_reversals_beside_presliding() -> None:
    """Of the whole run the delay is 20 ms and more, for friction that rises over a travel."""
    assert not check(driven(strokes(), 0.0, 0.6, presliding=0.003)).faults
    (late,) = check(driven(strokes(), 0.006, 0.6, presliding=0.003)).faults
    assert late.name == "torque_delay"
    assert late.size == pytest.approx(0.006, abs=0.0012)


@pytest.mark.parametrize("speed", [0.2, 0.4])  # rad/s
@pytest.mark.parametrize("level", [0.2, 1.0])  # Nm
def test_a_drive_to_and_fro_at_one_speed_does_not_tell_a_delay_from_presliding(
    speed: float, level: float
) -> None:
    time = np.arange(8000) / 200.0
    way = np.where(time % 4.0 < 2.0, 1.0, -1.0)
    angle = np.concatenate(([0.0], np.cumsum(speed * way)[:-1] / 200.0))
    torque = 0.3 * way + slipping(angle, level, width=0.03) + noise(seed=1, samples=8000)
    log = Log.from_arrays(time=time, output_position=angle, motor_torque=torque)
    assert not check(log).faults


def at_sensor(drive: Log) -> Log:
    """The same motion and torque, read by a sensor at the output."""
    return Log.from_arrays(
        time=drive["time"], output_position=drive["output_position"],
        output_velocity=np.gradient(drive["output_position"], drive["time"]),
        sensor_torque=80.0 * drive["motor_torque"], facts={"gear_ratio": 80.0, "name": "sensor"},
    )  # fmt: skip


@pytest.mark.parametrize("motion", [strokes, waves])
@pytest.mark.parametrize("late", [0.002, 0.004, 0.008])  # s, half a row and more
def test_a_motion_that_is_late_behind_its_sensor_is_a_fault(
    motion: Callable[[], Array], late: float
) -> None:
    log = at_sensor(driven(motion(), -late, 0.6, 0.0))
    (found,) = check(log).faults
    assert (found.name, found.channel) == ("position_delay", "output_position")
    assert found.size == pytest.approx(late, abs=0.0012)
    asked = [word.rstrip(",") for word in found.remedy.split() if word.startswith("shift=")]
    assert len(asked) == 2
    assert not check(repaired(log, asked)).faults


@pytest.mark.parametrize("motion", [strokes, waves])
@pytest.mark.parametrize("presliding", [0.0, 0.003])
def test_the_motion_of_a_sensor_that_is_not_late_is_no_fault(
    motion: Callable[[], Array], presliding: float
) -> None:
    assert not check(at_sensor(driven(motion(), 0.0, 0.6, presliding))).faults


@pytest.mark.parametrize("held", [1, 3])  # rows for which the torque keeps a value
def test_a_sensor_that_is_late_behind_its_motion_is_a_fault_where_nothing_else_is_missing(
    held: int,
) -> None:
    log = at_sensor(driven(strokes(), 0.006, 0.6, 0.0))
    torque = np.repeat(log["sensor_torque"][::held], held)[: len(log)]
    log = log.with_columns({"sensor_torque": torque}, note="held")
    (late,) = check(log).faults
    assert (late.name, late.channel) == ("torque_delay", "sensor_torque")
    assert late.size == pytest.approx(0.006 + 0.002 * (held - 1), abs=0.0012)
    wanders = (
        0.5 * np.cumsum(np.random.default_rng(3).normal(size=len(log))) / 15.0
    )  # another joint
    log = log.with_columns({"sensor_torque": torque + wanders}, note="more")
    assert not check(log).faults


def test_a_drive_that_is_early_may_be_ahead_by_torsion() -> None:
    findings = check(driven(waves(), -0.004, 0.6, 0.0))
    assert not findings.faults
    (found,) = findings.named("position_delay")
    assert "or the gear twists under friction at the output" in found.sentence
    assert found.remedy.startswith("If it is late, ask for the repair shift=output_position:0.00")


@pytest.mark.parametrize("presliding", [0.003, 0.01, 0.03])  # rad
def test_friction_that_gives_before_it_slips_is_no_fault_of_a_drive(presliding: float) -> None:
    assert not check(late_drive(0.0, presliding)).faults


def moves(seed: int) -> Array:
    """From one place to the next at 1 kHz for 20 s, rad, with 0.4 s of rest at each."""
    rng = np.random.default_rng(seed)
    pieces, here = list[Array](), rng.uniform(-1.5, 1.5)
    while sum(map(len, pieces)) < 20_000:
        goal, rows = rng.uniform(-2.0, 2.0), int(rng.uniform(1000.0, 3500.0))
        s = np.arange(rows) / rows
        pieces += [here + (goal - here) * (10.0 - 15.0 * s + 6.0 * s**2) * s**3, np.full(400, goal)]
        here = goal
    return np.concatenate(pieces)[:20_000]


@pytest.mark.parametrize("seed", range(8))
def test_friction_that_grows_with_a_weight_is_no_fault_of_a_drive(seed: int) -> None:
    """Without columns of it, a delay of 28 and 37 ms explains a part of it in two of eight runs."""
    angle, time = moves(seed), np.arange(20_000) / 1000.0
    speed, load = np.gradient(angle, time), np.sin(angle)  # A
    slip = np.tanh(speed / 0.005)
    current = load + 0.02 * np.gradient(speed, time) + 0.03 * speed
    current += (0.05 + 0.06 * np.abs(load)) * slip
    current += np.random.default_rng([seed, 1]).normal(0.0, 0.002, len(time))
    step, every = 2.0 * np.pi / 2**15, slice(None, None, 5)
    log = Log.from_arrays(
        time=time[every], output_position=np.round(angle[every] / step) * step,
        motor_current=current[every], facts={"gear_ratio": 100.0, "torque_constant": 0.04},
    )  # fmt: skip
    assert not check(log).named("torque_delay")


def test_a_delay_that_explains_next_to_nothing_is_not_told_however_sure_it_is() -> None:
    log = late_torque(0.8, 30000)
    motion = motion_of(log)
    assert motion is not None
    reading, columns = motion.smooth(log["sensor_torque"]), motion_columns(log, motion)
    found = find_delay(motion.time, reading, columns[:, :-2], motion.inside(0.15), 0.15, 0.005)
    assert found is not None and found.seconds > max(0.001, SURE * found.error)
    assert 0.5 < found.explained < 1.0
    assert 1.0 - found.explained > 0.99 * (1.0 - found.explained_without)
    assert list(torque(log)) == []


@pytest.mark.parametrize(("way", "both"), [(1.0, False), (-1.0, False), (None, True)])
def test_friction_shows_a_sign_only_where_the_joint_goes_both_ways(
    way: float | None, both: bool
) -> None:
    speed = np.sin(TIME)
    velocity = speed if way is None else way * np.abs(speed)
    assert _both_ways(cast(Motion, SimpleNamespace(velocity=velocity))) == both


def test_a_column_of_zeros_has_no_part_in_a_delay() -> None:
    columns = np.column_stack((np.zeros_like(TIME), motion(TIME)))
    target = motion(TIME - 0.01) @ [2.0, -0.7]
    valid = (TIME[0] + WITHIN <= TIME) & (TIME[-1] - WITHIN >= TIME)
    found = find_delay(TIME, target, columns, valid, WITHIN, STEP)
    assert found is not None
    assert found.coefficients == pytest.approx([0.0, 2.0, -0.7], rel=1e-4)


def test_the_lowest_point_is_walked_to_and_looks_at_its_neighbours_alone() -> None:
    grid, asked = np.linspace(-1.0, 1.0, 41), list[float]()

    def loss(delay: float) -> float:
        asked.append(delay)
        return (delay - 0.5) ** 2

    scanned = [abs(delay - 0.4) for delay in grid]
    assert _lowest(loss, grid, scanned) == pytest.approx(0.5)
    assert sorted(asked) == pytest.approx([0.35, 0.4, 0.45, 0.5, 0.55])


# Runs of one recorder


def recorded(rows_late: float, turns: int = 1, noise: float = 0.0) -> Log:
    """A run at 500 Hz whose velocity is late by so many rows; a slow one hardly shows it."""
    time = np.arange(8000) / 500.0

    def angle(at: Array) -> Array:
        return np.asarray(0.8 * np.sin(1.3 * turns * at) + 0.1 * np.sin(4.7 * turns * at + 1.0))

    def velocity(at: Array) -> Array:
        return np.asarray(
            turns * (1.04 * np.cos(1.3 * turns * at) + 0.47 * np.cos(4.7 * turns * at + 1.0))
        )

    noisy = noise * np.random.default_rng(5).normal(size=len(time))
    return Log.from_arrays(
        time=time,
        output_position=angle(time),
        output_velocity=velocity(time - rows_late / 500.0) + noisy,
        facts={"gear_ratio": 100.0, "output_spline": "flex"},
    )


def late_in(runs: list[Log]) -> list[str]:
    """The sentence on each run's delay, "" where there is none."""
    made = [one.named("velocity_delay") for one in check_runs(runs)]
    return [one[0].sentence if one else "" for one in made]


def test_a_recorders_delay_on_the_limit_is_told_of_all_runs_that_have_it() -> None:
    runs = [recorded(0.499), recorded(0.53), recorded(0.497)]
    assert [bool(check(run).named("velocity_delay")) for run in runs] == [False, True, False]
    said = late_in(runs)
    assert all(said) and not any("Seen in" in one for one in said)


def test_a_delay_that_some_runs_show_says_of_how_many_and_what_the_others_tell() -> None:
    same, none, noise = recorded(1.0), recorded(0.0), recorded(0.0, noise=3.0)
    said = "Seen in 1 of 3 runs; of the others 1 does not tell and 1 shows another or none."
    assert late_in([same, none, noise]) == [f"{late_in([same])[0]} {said}", "", ""]


def test_a_delay_that_all_or_no_runs_show_is_told_as_of_single_runs() -> None:
    assert late_in([recorded(1.0), recorded(1.5)]) == [*late_in([recorded(1.0)]),
                                                       *late_in([recorded(1.5)])]  # fmt: skip
    assert late_in([recorded(0.0), recorded(0.2)]) == ["", ""]


def test_checks_and_fit_look_for_a_delay_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Delay | None] = []

    def counted(*given: Any) -> Delay | None:
        made.append(find_delay(*given))
        return made[-1]

    monkeypatch.setattr(consistency, "find_delay", counted)
    log = recorded(15.0, noise=1e-4)
    noise = 1e-4 * np.random.default_rng(6).normal(size=(2, len(log)))
    columns = {
        "output_position": log["output_position"] + noise[0],
        "sensor_torque": log["output_velocity"] + noise[1],
    }
    log = log.with_columns(columns, note="noisy")
    fit = flexspline.fit(["offset", "viscous_friction"], log, "sensor_torque")
    (velocity,) = [one for one in fit.inputs if one.channel == "output_velocity"]
    told = [one.seconds for one in made if one is not None and len(one.coefficients) == 1]
    assert told == [velocity.delay] == [pytest.approx(0.03, abs=1e-3)]
