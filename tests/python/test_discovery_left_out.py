"""Rows of no experiment are left out before names are looked for; tied channels are both told."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest
from confounded_logs import RIGS
from driven_joint import driven, strokes
from recorded_joint import LOAD, base, recorded

import flexspline
from flexspline.discovery.analysis import Rival
from flexspline.discovery.result import Discovery
from flexspline.effects import effect
from flexspline.logs.checks.ends import resting
from flexspline.logs.log import Log

TAIL, HOMING, ROWS = 400, 150, 2000
RUNS = 4


def lossy(log: Log) -> Log:
    """The run with friction that grows with its load."""
    load, angle = log[LOAD], log["output_position"]
    direction = np.tanh(np.gradient(angle, log["time"]) / 0.05)
    torque = log["sensor_torque"] + 0.05 * np.abs(load) * direction
    return log.with_columns({"sensor_torque": torque}, note="load-dependent friction")


def sound() -> list[Log]:
    return [lossy(recorded(seed)) for seed in range(RUNS)]


def spoilt() -> list[Log]:
    """The same runs: one with a stuck tail, one in which the angle is set anew after a start."""
    runs = sound()
    stuck = {name: runs[0][name].copy() for name in runs[0].channels}
    for name, values in stuck.items():
        if name != "time":
            values[-TAIL:] = values[-TAIL - 1]
    homed = runs[1]["output_position"] - 1.7 * (np.arange(ROWS) < HOMING)
    runs[0] = runs[0].with_columns(stuck, note="stuck")
    runs[1] = runs[1].with_columns({"output_position": homed}, note="homed")
    return runs


@cache
def found(kind: str) -> Discovery:
    logs = spoilt() if kind == "spoilt" else sound()
    return flexspline.discover(base(), logs, target="sensor_torque", known_load=LOAD)


def test_names_and_errors_are_those_of_the_runs_without_these_rows() -> None:
    spoilt, sound = found("spoilt"), found("sound")
    assert spoilt.names == sound.names == ("load_dependent_friction",)
    assert spoilt.base_rmse == pytest.approx(sound.base_rmse, rel=0.05)
    assert spoilt.final_rmse == pytest.approx(sound.final_rmse, rel=0.05)


def test_rows_left_out_are_counted_by_reason() -> None:
    rows = found("spoilt").rows
    assert rows["in a stuck tail"] == TAIL
    assert rows["in a homing move"] == HOMING
    assert sum(rows.values()) == RUNS * ROWS
    assert not {"in a stuck tail", "in a homing move"} & found("sound").rows.keys()


def test_a_drive_rests_by_its_log_as_recorded_however_its_motion_is_smoothed() -> None:
    """It rested where the smoothed motion did: more rows than were left out, the others -443."""
    stops = [np.append(part, np.full(1500, part[-1])) for part in np.array_split(strokes(), 4)]
    log = driven(np.concatenate(stops), 0.0, inertia=0.6, bits=10, every=40)
    plain = ["offset", "coulomb_friction", "viscous_friction", "inertia", "gravity"]
    rows = flexspline.discover(plain, log, target="motor_torque").rows
    assert rows["at rest"] == np.count_nonzero(resting(log)) > 50
    assert sum(rows.values()) == len(log) and min(rows.values()) > 0


def test_the_headline_counts_the_rows_that_the_error_is_of() -> None:
    used = found("spoilt").rows["used"]
    assert used < RUNS * ROWS
    headline = " ".join(str(found("spoilt")).split()).split(" Noise")[0]
    assert f"that no fit saw ({used} of {RUNS * ROWS} rows)" in headline


def test_they_are_said_with_their_rows_and_are_no_fault_to_mend() -> None:
    made = found("spoilt")
    tail, homing = (
        next(f for f in made.data_faults if f.name == name)
        for name in ("stuck_tail", "homing_move")
    )
    assert (tail.run, tail.rows) == ("run0", (ROWS - TAIL, ROWS))
    assert (homing.run, homing.rows) == ("run1", (0, HOMING))
    assert tail.left_out and homing.left_out and not tail.grave
    text = " ".join(str(made).split())
    assert "Left out of the runs, before anything was searched" in text
    assert f"rows, {ROWS - TAIL} to {ROWS}" in text
    assert f"Rows 0 to {HOMING} count from another zero" in text
    assert f"{TAIL} in a stuck tail" in text
    told = json.loads(made.to_json())
    cut = [fault for fault in told["data_faults"] if fault["left_out"]]
    assert {fault["name"] for fault in cut} == {"stuck_tail", "homing_move"}
    assert told["rows"]["in a stuck tail"] == TAIL


@pytest.mark.parametrize("name", ["a load tied to the angle", "a warm-up that follows the clock"])
def test_both_readings_are_told_where_one_channel_follows_another(name: str) -> None:
    rig = RIGS[name]
    logs = [rig.recorded(number) for number in range(4)]
    made = flexspline.discover(rig.base, logs, target="sensor_torque", known_load=LOAD)
    (tied,) = made.dependences
    assert made.names == (rig.hidden,)
    assert rig.rival in made.found[0].indistinguishable_from
    rival = next(r for r in made.found[0].rivals if r.name == rig.rival)
    assert rival.tied == tied.said
    assert tied.left < 0.01
    assert "is nearly a function of" in tied.sentence
    assert tied.sentence in " ".join(str(made).split())
    assert tied.sentence in made._repr_html_()
    assert json.loads(made.to_json())["dependences"][0]["of"] == tied.of


def test_folds_that_tell_forms_apart_do_not_tell_tied_causes_apart() -> None:
    rival = effect("position_dependent_friction")
    apart = Rival(rival, gain=900.0, own=1000.0, left=12.0, adds=3.0, form=0.007)
    tied = Rival(rival, 900.0, 1000.0, 12.0, 3.0, 0.007, ("reference_torque", "output_position"))
    less = Rival(rival, 790.0, 1000.0, 12.0, 3.0, 0.007, ("reference_torque", "output_position"))
    assert not apart.alias and tied.alias and not less.alias
    said = tied.why("load_dependent_friction")
    assert said.endswith("reference_torque is nearly a function of output_position in these runs")
