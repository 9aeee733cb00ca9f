"""A fleet over months: the joint that changed is found, with cause and date; others are quiet."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from cli_calls import call
from figure_layout import page_faults
from fleet_logs import NAMES, drawn, run_of
from worn_joints import worn_history

from flexspline import InputError
from flexspline.fleet import cluster
from flexspline.logs.writing import write_log
from flexspline.tracking import FleetTrack, track, track_fleet
from flexspline.tracking.changes import threshold

SESSIONS, ONSET, STEP = 14, 8, 0.15


def date(week: int) -> str:
    return str(np.datetime64("2027-01-04") + 7 * week)


def write_fleet(folder: Path, dated: bool = True) -> Path:
    """Three joints, fourteen weeks each; friction of the second rises by half in the ninth week."""
    for number, rng in enumerate(np.random.default_rng(3).spawn(3), 1):
        truth = drawn(rng)
        for week in range(SESSIONS):
            now = {name: value * rng.normal(1.0, 0.02) for name, value in truth.items()}
            now["coulomb_friction"] += STEP if number == 2 and week >= ONSET else 0.0
            name = date(week) if dated else f"w{week}"
            path = folder / f"joint{number}" / f"{name}.csv"
            path.parent.mkdir(exist_ok=True)
            write_log(run_of(now, rng, 10.0, name=name), path)
    return folder


@cache
def line() -> Path:
    return write_fleet(Path(mkdtemp()))


@cache
def tracked() -> FleetTrack:
    return track_fleet(line(), "sensor_torque", NAMES, workers=0)


def test_the_joint_that_changed_is_found_with_cause_and_date() -> None:
    made = tracked()
    assert [*made.changed] == ["joint2"] and set(made.quiet) == {"joint1", "joint3"}
    (change,) = made.changed["joint2"]
    assert change.parameter == "coulomb_friction.level"
    assert str(change.between[0])[:10] <= date(ONSET) <= str(change.between[1])[:10]
    assert change.interval[0] < STEP < change.interval[1]
    row = made.to_frame().iloc[0]
    assert (row["joint"], row["cause"], row["unit"]) == ("joint2", "coulomb_friction", "Nm")
    assert "joint2 changed, 2 are quiet" in str(made)
    fewer = replace(made, tracks={name: made.tracks[name] for name in ("joint1", "joint2")})
    assert "joint2 changed, 1 is quiet" in str(fewer)
    alone = replace(made, tracks={"joint1": made.tracks["joint1"]})
    assert "1 joint, " in str(alone)


def test_two_workers_that_are_started_once_give_the_same_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("distributed", reason="pip install 'flexspline[fleet]' for clusters")
    started, start = [], cluster._client
    monkeypatch.setattr(cluster, "_client", lambda *asked: started.append(1) or start(*asked))
    made = track_fleet(line(), "sensor_torque", NAMES, workers=2)
    assert len(started) == 1  # for the runs and for the joints
    assert made.to_json() == tracked().to_json()
    assert all(made[name].to_json() == tracked()[name].to_json() for name in made.tracks)


def test_a_session_of_the_fleet_is_one_of_the_joint_alone() -> None:
    """Its dates, temperatures and estimates, by the same sums."""
    history = tracked()["joint2"].history
    assert [str(each)[:10] for each in history.dates] == [date(k) for k in range(SESSIONS)]
    assert history.knows_temperature is not None and history.joint == "joint2"
    level = history.values[:, history.names.index("coulomb_friction.level")]
    assert np.mean(level[ONSET:]) - np.mean(level[:ONSET]) == pytest.approx(STEP, abs=0.03)
    assert history.target == "sensor_torque"
    velocity = history.ranges["output_velocity"]
    assert velocity.shape == (SESSIONS, 2) and (velocity[:, 0] < velocity[:, 1]).all()


def test_of_many_joints_a_change_needs_more_evidence() -> None:
    """A change that one joint tells is none where a thousand are looked at."""
    worn = {"coulomb_friction.level": lambda weeks: 1.9 * (weeks >= 40)}
    alone = worn_history(5, worn=worn)
    among = worn_history(5, worn=worn, among=100_000)
    (change,) = track(alone).changes
    assert change.needed == threshold(len(alone), 3)
    assert among.looked_at == 3 * 100_000
    assert change.evidence < threshold(len(alone), among.looked_at)
    assert not track(among).changes


def test_runs_without_a_date_are_named_and_none_of_all_is_refused(tmp_path: Path) -> None:
    write_fleet(tmp_path, dated=False)
    with pytest.raises(InputError, match=r"joint1/w0: has no date.*no other joint can be tracked"):
        track_fleet(tmp_path, "sensor_torque", NAMES, workers=0)
    for week in range(1, SESSIONS):
        for joint in ("joint1", "joint2", "joint3"):
            (tmp_path / joint / f"w{week}.csv").rename(tmp_path / joint / f"{date(week)}.csv")
    made = track_fleet(tmp_path, "sensor_torque", NAMES, workers=0)
    assert [what for what, _ in made.failed] == [f"joint{k}/w0" for k in (1, 2, 3)]
    assert all(len(one.history) == SESSIONS - 1 for one in made.tracks.values())


def test_a_joint_that_is_not_there_is_said_with_those_that_are() -> None:
    with pytest.raises(InputError, match=r"no joint 'joint4' is tracked.*joint1, joint2, joint3"):
        tracked()["joint4"]


def test_the_command_writes_pages_and_tracks_of_all(tmp_path: Path) -> None:
    said = call("fleet", "track", line(), "--target", "sensor_torque", "--effects",
                ",".join(NAMES), "--limit", "coulomb_friction=200%", "--workers", 0,
                "--out", tmp_path / "wear")  # fmt: skip
    assert said.exit_code == 0, said.output
    assert "joint2 changed" in said.stdout and "3 pages and tracks" in said.stdout
    content = json.loads((tmp_path / "wear" / "fleet_track.json").read_text())
    assert [*content["changed"]] == ["joint2"] and content["quiet"] == ["joint1", "joint3"]
    assert content["changed"]["joint2"][0]["causes"] == ["coulomb_friction"]
    own = json.loads((tmp_path / "wear" / "units" / "joint2.json").read_text())
    assert own["joint"] == "joint2" and len(own["changes"]) == 1
    for page in ("report.html", "units/joint2.html"):
        assert not page_faults(tmp_path / "wear" / page)
    said = call("fleet", "track", line(), "--out", tmp_path / "none")
    assert said.exit_code == 2 and "exactly one of --effects" in said.stderr
    assert not (tmp_path / "none").exists()
