"""A load cell beside the target: it is said what known_load is for."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from cli_calls import call
from fit_logs import FRICTION, autoregressive, friction, log_with, motion, rows_of

import flexspline
from flexspline.logs import Log
from flexspline.logs.checks import check, check_runs
from flexspline.logs.checks.consistency import Reaction, _turned
from flexspline.logs.checks.load import UNUSED, unused_load
from flexspline.logs.repairs import repaired

BASE = ["offset", "coulomb_friction", "viscous_friction"]


def run(*extra: str, seed: int = 1) -> Log:
    """A run with friction and these channels beside it, a load of 3 Nm in the target."""
    channels = motion(seed)
    load = 3.0 * np.sin(0.9 * channels["time"])
    torque = rows_of(friction(), log_with(channels)) @ FRICTION + load
    torque += autoregressive(np.random.default_rng(seed), len(torque))
    return log_with(channels, torque, f"run{seed}", **dict.fromkeys(extra, load))


@pytest.mark.parametrize(
    ("extra", "target", "named"),
    [
        (["reference_torque"], "sensor_torque", UNUSED),
        (["reference_torque", "motor_current"], "motor_current", UNUSED),
        (["motor_current"], "sensor_torque", None),  # a joint's own sensor, in most runs
        (["motor_current"], "motor_current", None),
        ([], "sensor_torque", None),
        (["reference_torque"], None, None),
        (["motor_current"], None, None),
    ],
)
def test_a_check_says_how_a_load_cell_is_used(
    extra: list[str], target: str | None, named: str | None
) -> None:
    found = check(run(*extra), target=target)
    said = [f for f in found.notes if f.name == UNUSED]
    assert [f.name for f in said] == ([named] if named else [])
    assert all("--known-load" in f.sentence + f.remedy for f in said)


def test_of_several_runs_it_is_said_once() -> None:
    made = check_runs([run("reference_torque", seed=k) for k in (1, 2)], target="sensor_torque")
    assert [len(one.named(UNUSED)) for one in made] == [1, 0]


def test_a_load_that_stays_the_same_is_no_load_to_use() -> None:
    log = run().with_columns({"reference_torque": np.zeros(len(run()))}, note="not connected")
    assert not check(log, target="sensor_torque").named(UNUSED)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308])
def test_a_load_of_no_number_is_none(value: float) -> None:
    log = run().with_columns({"reference_torque": np.full(len(run()), value)}, note="broken")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert unused_load([log], "sensor_torque", None) == []
        ends = np.where(np.arange(len(log)) % 2, 1e308, -1e308)
        assert unused_load(
            [log.with_columns({"reference_torque": ends}, note="broken")], "sensor_torque", None
        )


def test_fit_and_discover_say_that_a_known_load_was_not_used() -> None:
    logs = [run("reference_torque", seed=k) for k in (1, 2)]
    without = flexspline.fit(BASE, logs, target="sensor_torque")
    (said,) = [sentence for sentence in without.warnings if "known_load" in sentence]
    used = flexspline.fit(BASE, logs, target="sensor_torque", known_load="reference_torque")
    assert not any("known_load" in sentence for sentence in used.warnings)
    assert used.rmse < 0.2 * without.rmse
    found = flexspline.discover(BASE, logs, target="sensor_torque")
    assert said in found.warnings and said.rstrip(".") in str(found).replace("\n", " ")
    found = flexspline.discover(BASE, logs, target="sensor_torque", known_load="reference_torque")
    assert not any("known_load" in sentence for sentence in found.warnings)


def test_the_help_says_what_a_known_load_does() -> None:
    said = " ".join(call("fit", "--help").output.split())
    assert "effects explain the target less this" in said


def test_runs_that_differ_in_their_load_cell_are_not_judged() -> None:
    logs = [run("reference_torque"), run(seed=2)]
    made = flexspline.fit(BASE, logs, target="sensor_torque")
    assert not any("known_load" in sentence for sentence in made.warnings)


RATIO = 100.0
SLIPS = ("load_sign", "load_scale")


def beside_a_load_cell(part: float = 1.0, **factors: float) -> Log:
    """A joint of ratio 100 under load, channels times these factors.

    `part`: how much of the motor's and the sensor's load the cell reads, the rest follows another
    frequency.
    """
    channels = motion(4, samples=8_000)
    t, v, a = (channels[name] for name in ("time", "output_velocity", "output_acceleration"))
    load, other = 9.0 * np.sin(0.9 * t), 9.0 * np.sin(2.3 * t)
    carried = part * load + (1.0 - part) * other
    noise = np.random.default_rng(4).standard_normal
    drive = (carried + 1.5 * a + 4.0 * np.tanh(v / 0.01) + 2.0 * v) / RATIO
    columns = {
        "time": t,
        "output_position": channels["output_position"],
        "reference_torque": load + 0.03 * noise(len(t)),
        "sensor_torque": carried + 0.8 * a + 0.05 * noise(len(t)),
        "motor_torque": drive + 0.003 * noise(len(t)),
    }
    return Log(
        {name: factors.get(name, 1.0) * values for name, values in columns.items()},
        {"gear_ratio": RATIO, "name": "cell"},
    )


@pytest.mark.parametrize(
    ("factors", "blamed"),
    [
        ({"reference_torque": -1.0}, [("load_sign", "reference_torque")]),
        ({"sensor_torque": -1.0}, [("load_sign", "sensor_torque")]),
        ({"motor_torque": -1.0}, []),  # told by its friction
        ({"motor_torque": RATIO}, [("load_scale", "motor_torque")]),
        ({"sensor_torque": 1 / RATIO}, [("load_scale", "sensor_torque")]),
        ({"sensor_torque": 1e3}, [("load_scale", "sensor_torque")]),
        (
            {"reference_torque": -1e3},
            [
                ("load_scale", "motor_torque"),
                ("load_scale", "sensor_torque"),
                ("load_sign", "reference_torque"),
            ],
        ),
        ({"sensor_torque": 1.2, "motor_torque": 0.9}, []),  # a gain, a torque constant
        ({"sensor_torque": 3.0}, []),  # no slip makes that
        ({}, []),
    ],
)
def test_a_load_of_the_wrong_sign_or_unit_is_told_and_repaired_as_said(
    factors: dict[str, float], blamed: list[tuple[str, str]]
) -> None:
    log = beside_a_load_cell(**factors)
    found = [f for f in check(log).faults if f.name in SLIPS]
    assert sorted((f.name, f.channel) for f in found) == blamed
    for finding in found[:1] if len(found) == 1 else []:
        (asked, *_) = re.findall(r"(?:flip_sign|scale)=[\w:.]*\w", finding.remedy)
        assert not check(repaired(log, asked)).faults


NEWTON_METRES = {"kgf·m": 9.80665, "kgf·cm": 0.0980665, "lbf·ft": 1.355818, "lbf·in": 0.1129848,
                 "ozf·in": 0.00706155, "cNm": 0.01, "daNm": 10.0}  # fmt: skip


@pytest.mark.parametrize("unit", NEWTON_METRES)
@pytest.mark.parametrize("channel", ["reference_torque", "sensor_torque"])
@pytest.mark.parametrize("way", [1, -1])
def test_a_torque_in_another_unit_than_its_load_is_told_and_repaired_as_said(
    unit: str, channel: str, way: int
) -> None:
    """A load cell in kgf·m, lbf·ft or lbf·in passed: 1000 and the gear ratio alone were known."""
    factor = NEWTON_METRES[unit] ** way
    log = beside_a_load_cell(**{channel: factor})
    sensor = Log({n: log[n] for n in log.channels if n != "motor_torque"}, log.facts)
    (finding,) = [f for f in check(sensor).faults if f.name in SLIPS]
    assert (finding.name, finding.channel) == ("load_scale", "sensor_torque")
    assert unit in finding.sentence and finding.sentence.count(" in Nm and was taken") <= 2
    asked = re.findall(rf"scale={channel}:[\d.e+-]*\d", finding.remedy)[0]
    assert not check(repaired(sensor, asked)).faults


@pytest.mark.parametrize(
    ("factors", "told"),
    [((1.34, 1.34), [0, 1]), ((1.34, 1.0), [0]), ((1.0, 1.34), [1]), ((1.34, 1.2), []),
     ((1.26, 1.2, 1.34), []), ((1.2, 1.2), [])],
)  # fmt: skip
def test_a_gain_that_differs_between_runs_is_no_unit(
    factors: tuple[float, ...], told: list[int]
) -> None:
    """One run may be recorded in lbf·ft, and the next in Nm; neither unit makes 1.2."""
    logs = []
    for k, factor in enumerate(factors):
        log = beside_a_load_cell(sensor_torque=factor)
        names = {name: log[name] for name in log.channels if name != "motor_torque"}
        logs.append(Log(names, {**log.facts, "name": f"run{k}"}))
    found = [[f for f in one if f.name == "load_scale"] for one in check_runs(logs)]
    assert [k for k, own in enumerate(found) if own] == told
    assert all("lbf·ft" in f.sentence for own in found for f in own)


@pytest.mark.parametrize(
    ("factor", "severity"),
    [(9.81, "fault"), (0.113, "fault"), (100.0, "fault"), (1.3558, "note"), (0.7376, "note")],
)
def test_a_drive_s_factor_of_an_efficiency_is_no_sure_fault(factor: float, severity: str) -> None:
    log = beside_a_load_cell(reference_torque=factor, sensor_torque=factor)
    found = [f for f in check(log) if f.name == "load_scale"]
    assert [(f.channel, f.severity) for f in found] == [("motor_torque", severity)]


@pytest.mark.parametrize("seed", range(40))
def test_gains_of_a_sensor_and_a_drive_are_no_units(seed: int) -> None:
    """Within the quarter that torque constant and efficiency make, and where no unit is near."""
    rng = np.random.default_rng(seed)
    for sensor, motor in (
        rng.uniform(0.83, 1.2, 2),
        np.exp(rng.uniform(np.log(2.0), np.log(7.0), 2)) ** rng.choice([-1, 1], 2),
    ):
        log = beside_a_load_cell(sensor_torque=sensor, motor_torque=motor)
        assert not [f for f in check(log) if f.name in SLIPS]


def test_a_load_cell_that_sees_another_load_judges_no_torque() -> None:
    """Where the load explains but a part of what motion leaves, its factor is not the joint's."""
    log = beside_a_load_cell(part=-0.4)
    assert not [f for f in check(log) if f.name in SLIPS]


def test_without_a_gear_no_side_of_it_is_wrong() -> None:
    log = beside_a_load_cell(motor_torque=RATIO).with_facts({"gear_ratio": 1.0}, note="direct")
    assert not [f for f in check(log) if f.name in SLIPS]


def test_a_fit_warns_of_a_load_of_the_wrong_sign() -> None:
    made = flexspline.fit(
        ["coulomb_friction", "viscous_friction", "inertia"],
        beside_a_load_cell(reference_torque=-1.0),
        target="motor_torque",
        known_load="reference_torque",
    )
    assert any("flip_sign=reference_torque" in said for said in made.warnings)


@pytest.mark.parametrize(
    ("factor", "friction", "inertia", "wrong"),
    [
        (1.0, -0.1, 0.003, None),
        (1.0, -0.1, -0.003, None),
        (-1.0, 0.1, 0.003, ("reference_torque",)),
        (-1.0, -0.1, -0.003, None),
        (-1.0, -0.1, 0.003, ("reference_torque", "motor_torque")),
    ],
)
def test_a_drive_that_its_load_drives_has_no_load_of_the_wrong_sign(
    factor: float, friction: float, inertia: float, wrong: tuple[str, ...] | None
) -> None:
    """Friction told as negative beside a positive inertia had called a factor of 1 a flipped load.

    A torque that is flipped as a whole, inertia and all, is told by itself.
    """
    reaction = Reaction(friction, 0.01, inertia, 1e-4)
    assert _turned("motor_torque", factor, reaction) == wrong
