"""`guess_map` and `flexspline init` on files as recorders write them.

What is guessed is held to the run that a recorder recorded, channel by channel in SI units:
`recorders.py` has thirty of them, `more_recorders.py` some that no rule was made on.
"""

from __future__ import annotations

import gzip
import json
import tempfile
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest
from cli_calls import call
from fresh_recorders import FRESH_RECORDERS
from more_recorders import MORE_RECORDERS
from recorder_files import Recorder
from recorders import RECORDERS
from unseen_recorders import UNSEEN_RECORDERS

import flexspline
from flexspline import Guess, InputError, guess_map, read_log
from flexspline.logs.channels import CHANNELS
from flexspline.logs.columns import USUAL, _by_pint, to_si
from flexspline.logs.read import read_map
from flexspline.logs.units import seconds_of_stamps
from flexspline.recordings.columns import joined

WITHIN = 0.03  # of a channel's standard deviation, besides the step in which the file holds it
RIGHT = 27  # of thirty
FOLDER = tempfile.TemporaryDirectory()


def wrong(recorder: Recorder, guess: Guess) -> tuple[list[str], list[str]]:
    """What a guess says wrongly and does not doubt; and what it lacks or doubts wrongly."""
    silent, missed, file = [], [], recorder.file()
    log = guess.log()
    for channel, truth in file.truth.items():
        made = channel in guess.channels or (channel == "time" and "rate" in guess.read)
        if made and apart(recorder, channel, log[channel], truth):
            (missed if guess.doubts.get(channel) else silent).append(channel)
        elif not made:
            missed.append(channel)
    for channel in guess.channels:
        sure = not guess.doubts.get(channel)
        if channel not in file.truth and channel != "enabled" and sure:
            silent.append(f"{channel}, which is not there")
    for fact in ("gear_ratio", "output_spline"):
        if fact in file.facts and guess.facts.get(fact) != file.facts[fact]:
            missed.append(fact)
    return silent, [name for name in missed if name not in file.ambiguous]


def apart(recorder: Recorder, channel: str, got: np.ndarray, truth: np.ndarray) -> bool:
    """Whether a channel is not what was recorded, but for the rounding of the file."""
    if got.shape != truth.shape:
        return True
    if channel == "time":
        got, truth = got - got[0], truth - truth[0]
    there = np.isfinite(got) & np.isfinite(truth)
    left, made = got[there] - truth[there], recorder.file()
    if channel in made.wraps:
        left -= made.wraps[channel] * np.rint(left / made.wraps[channel])
    step = float(np.median(np.diff(truth))) if channel == "time" else made.steps.get(channel, 0)
    return float(np.sqrt(np.mean(left**2))) > WITHIN * np.std(truth[there]) + step


@cache
def guessed_path(recorder: Recorder) -> Path:
    return recorder.write(Path(tempfile.mkdtemp(prefix=recorder.name, dir=FOLDER.name)))


@cache
def guessed(recorder: Recorder) -> Guess:
    return guess_map(guessed_path(recorder))


@pytest.mark.parametrize("recorder", RECORDERS, ids=lambda each: each.name)
def test_what_is_wrong_in_a_guess_is_said_to_be_unsure(
    recorder: Recorder, data_folder: Path
) -> None:
    silent, _ = wrong(recorder, guessed(recorder))
    assert silent == []


REFUSED = {
    "grafana_formatted": "no table of numbers is seen in its first 400 lines",
    "octave_text": "data row 3001 (line 3013) has 3 fields where the first line of the table has 6",
    "graphtec_gl240": "data row 4 (line 7) has 3 fields where the first line of the table has 2",
}
"""What no map can be guessed of, and the reason that the sentence begins with."""


@pytest.mark.parametrize(
    "recorder", (*MORE_RECORDERS, *UNSEEN_RECORDERS, *FRESH_RECORDERS), ids=lambda each: each.name
)
def test_of_files_that_are_no_tables_or_of_odd_ones_nothing_wrong_is_said_either(
    recorder: Recorder,
) -> None:
    if recorder.name in REFUSED:
        with pytest.raises(InputError) as refused:
            guessed(recorder)
        assert str(refused.value).startswith(f"{guessed_path(recorder)}: {REFUSED[recorder.name]}")
        return
    silent, _ = wrong(recorder, guessed(recorder))
    assert silent == []


def test_at_least_27_of_thirty_recordings_get_the_right_map(data_folder: Path) -> None:
    missed = {each.name: wrong(each, guessed(each))[1] for each in RECORDERS}
    assert sum(not names for names in missed.values()) >= RIGHT, missed


@pytest.mark.parametrize("recorder", RECORDERS, ids=lambda each: each.name)
def test_a_map_that_is_written_reads_what_the_guess_reads(
    recorder: Recorder, tmp_path: Path, data_folder: Path
) -> None:
    guess = guessed(recorder)
    guess.save(tmp_path / "map.toml")
    sections = read_map(tmp_path / "map.toml")
    facts = sections["facts"]
    log = read_log(guess.recording, sections["columns"], facts=facts, **sections["read"])
    same = guess.log()
    assert log.channels == same.channels
    assert all(np.array_equal(log[name], same[name], equal_nan=True) for name in log.channels)
    assert dict(log.facts) == dict(same.facts)


# the command


def written(tmp_path: Path, name: str) -> Path:
    return next(each for each in RECORDERS if each.name == name).write(tmp_path)


def test_init_writes_a_map_with_reasons_and_a_figure_and_check_takes_it(tmp_path: Path) -> None:
    recording = written(tmp_path, "excel_german")
    out = tmp_path / "map.toml"
    made = call("init", str(recording), "--out", str(out))
    assert made.exit_code == 0, made.stderr
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    content = out.read_text(encoding="utf-8")
    assert 'encoding = "cp1252"' in content
    assert "# the motor counts against the output in the file" in content.replace("; ", "\n# ")
    for channel in guess_map(recording).doubts:
        assert f"{channel} ?" in made.stdout
    checked = call("check", str(recording), "--columns", str(out))
    assert checked.exit_code == 0, checked.stderr  # and nothing is found in it


def test_init_of_one_joint_of_several_takes_the_one_that_is_asked_for(tmp_path: Path) -> None:
    recording = written(tmp_path, "ur_rtde")
    assert guess_map(recording).columns["output_position"].source == "actual_q_2"
    assert guess_map(recording, joint="4").columns["output_position"].source == "actual_q_4"
    with pytest.raises(InputError, match=r"no joint '9'.* it has 0, 1, 2, 3, 4, 5"):
        guess_map(recording, joint="9")


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "the file is empty"),
        (b"only words\nand more\n", "no table of numbers is seen"),
        (b"aa,bb\n1,2\n3,1\n2,6\n7,5\n", "no column can be told"),
    ],
)
def test_a_recording_of_nothing_known_is_refused_in_one_sentence(
    tmp_path: Path, content: bytes, sentence: str
) -> None:
    recording = tmp_path / "recording.txt"
    recording.write_bytes(content)
    made = call("init", str(recording), "--out", str(tmp_path / "map.toml"))
    assert made.exit_code == 2
    assert sentence in made.stderr and str(recording) in made.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["recording.txt"]


def test_a_missing_recording_is_refused_and_a_map_never_replaces_its_recording(
    tmp_path: Path,
) -> None:
    assert call("init", str(tmp_path / "none.csv")).exit_code == 2
    recording = written(tmp_path, "pandas_iso")
    before = recording.read_bytes()
    assert call("init", str(recording), "--out", str(recording)).exit_code == 2
    assert recording.read_bytes() == before


def test_names_that_would_leave_their_comment_or_string_stay_in_it(tmp_path: Path) -> None:
    evil = 'tau" \\ x = 1 \x1b[2J ‮ [Nm]'
    recording = tmp_path / "run.npz"
    time = np.arange(500) / 100.0
    np.savez(
        recording,
        **{"t": time, "q": np.sin(time), "zz\n[read]\nrate = 7": time * 0 + 1, evil: np.cos(time)},
    )
    guess = guess_map(recording)
    guess.save(tmp_path / "map.toml")
    sections = read_map(tmp_path / "map.toml")
    assert sections["columns"]["sensor_torque"]["source"] == evil
    assert "rate" not in sections["read"]
    assert "\x1b" not in str(guess)
    comments = [
        line
        for line in guess.toml().splitlines()
        if line.startswith("#") and not line.isprintable()
    ]
    assert comments == []


# what physics tells


TIME = np.arange(2000) / 200.0
Q = 0.8 * np.sin(1.7 * TIME) + 0.1 * np.sin(5.0 * TIME)  # rad
DQ = 0.8 * 1.7 * np.cos(1.7 * TIME) + 0.5 * np.cos(5.0 * TIME)  # rad/s


@pytest.mark.parametrize(("unit", "factor"), [("deg", 180 / np.pi), ("rev", 0.5 / np.pi)])
def test_an_angle_without_a_unit_is_told_by_a_velocity_with_one(
    tmp_path: Path, unit: str, factor: float
) -> None:
    np.savez(tmp_path / "run.npz", t=TIME, q=Q * factor, **{"dq [rpm]": DQ * 30 / np.pi})
    guess = guess_map(tmp_path / "run.npz")
    assert guess.channels["output_position"].unit == unit
    assert not guess.doubts.get("output_position")
    assert np.allclose(guess.log()["output_position"], Q)


def test_a_velocity_whose_sign_is_turned_is_turned_back(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", **{"t": TIME, "q [rad]": Q, "dq [rad/s]": -DQ})
    assert guess_map(tmp_path / "run.npz").channels["output_velocity"].sign == -1


@pytest.mark.parametrize("turns", [100, 101, -100])
def test_the_gear_ratio_is_how_far_the_motor_turns(tmp_path: Path, turns: int) -> None:
    np.savez(tmp_path / "run.npz", **{"t": TIME, "q [rad]": Q, "theta [rad]": turns * Q})
    guess = guess_map(tmp_path / "run.npz")
    assert guess.facts["gear_ratio"] == abs(turns)
    assert guess.channels["motor_position"].sign == np.sign(turns)
    assert any("circular" in said for said in guess.unsure) == (turns == 101)


def test_a_rate_that_nothing_states_follows_from_angle_and_velocity(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", **{"q [rad]": Q, "dq [rad/s]": DQ})
    guess = guess_map(tmp_path / "run.npz")
    assert guess.read["rate"] == 200.0
    assert any("rate" in said for said in guess.unsure)


def test_a_recording_without_time_and_rate_says_so_and_takes_the_rate_given(
    tmp_path: Path,
) -> None:
    recording = tmp_path / "run.npz"
    np.savez(recording, **{"q [rad]": Q, "tau_s [Nm]": Q**2})
    assert any("--rate" in said for said in guess_map(recording).unsure)
    with pytest.raises(InputError, match="give the rate in Hz"):
        guess_map(recording).log()
    assert guess_map(recording, rate=200.0).log()["time"][1] == 1 / 200.0


def test_a_current_against_friction_is_turned_and_gravity_alone_turns_nothing(
    tmp_path: Path,
) -> None:
    friction, gravity = 2.0 * np.tanh(DQ / 0.05) + 1.0 * DQ, 6.0 * np.sin(Q)
    for current, sign in ((friction + gravity, 1), (-friction - gravity, -1)):
        np.savez(tmp_path / "run.npz", **{"t": TIME, "q [rad]": Q, "i_q [A]": current})
        assert guess_map(tmp_path / "run.npz").channels["motor_current"].sign == sign
    np.savez(tmp_path / "run.npz", **{"t": TIME, "q [rad]": Q, "i_q [A]": -gravity})
    guess = guess_map(tmp_path / "run.npz")
    assert guess.channels["motor_current"].sign == 1
    assert "sign" in guess.doubts["motor_current"]


@pytest.mark.parametrize("sign", [1, -1])
def test_a_half_of_the_run_that_goes_one_way_hides_no_sign(tmp_path: Path, sign: int) -> None:
    late = TIME[-1] / 2.0 < TIME
    velocity = np.where(late, 0.5 + 0.3 * np.sin(1.7 * TIME), DQ)
    angle = np.cumsum(velocity) * TIME[1]
    current = sign * (2.0 * np.tanh(velocity / 0.05) + 6.0 * np.sin(angle))
    columns = {"t": TIME, "q [rad]": angle, "dq [rad/s]": velocity, "i_q [A]": current}
    np.savez(tmp_path / "run.npz", **columns)
    guess = guess_map(tmp_path / "run.npz")
    assert guess.channels["motor_current"].sign == sign
    assert ("motor_current" in guess.doubts) == (sign < 0)  # what is turned is to be looked at


def test_motion_one_way_is_said_to_tell_no_sign(tmp_path: Path) -> None:
    angle = 0.5 * TIME + 0.1 * np.sin(TIME)
    current = 2.0 + 6.0 * np.sin(angle)
    np.savez(tmp_path / "run.npz", **{"t": TIME, "q [rad]": angle, "i_q [A]": current})
    doubt = guess_map(tmp_path / "run.npz").doubts["motor_current"]
    assert "one way" in doubt and "friction" not in doubt


# reading what a map says


TEXT = "made by hand\nt;w;M\ns;rpm;mNm\n0,0;1,5;2\n0,5;3,0;4\n1,0;4,5;6\ncomment at the end\n"


def test_lines_above_units_below_the_names_and_a_footer_are_read_as_said(tmp_path: Path) -> None:
    (tmp_path / "run.txt").write_text(TEXT)
    log = read_log(
        tmp_path / "run.txt",
        {"time": "t", "output_velocity": "w", "sensor_torque": ("M", "Nm")},
        skip_lines=1,
        units_row=True,
        skip_footer=1,
    )
    assert log["time"].tolist() == [0.0, 0.5, 1.0]
    assert np.allclose(log["output_velocity"], np.array([1.5, 3.0, 4.5]) * np.pi / 30)
    assert log["sensor_torque"].tolist() == [2.0, 4.0, 6.0]  # the map's own unit overrules


def test_the_command_line_reads_these_too(tmp_path: Path) -> None:
    (tmp_path / "run.txt").write_text("Prüfstand\n" + TEXT[13:-19], encoding="latin-1")
    (tmp_path / "map.toml").write_text(
        '[columns]\ntime = "t"\noutput_velocity = "w"\nsensor_torque = "M"\n'
    )
    made = call(
        "convert", str(tmp_path / "run.txt"), "--columns", str(tmp_path / "map.toml"),
        "--out", str(tmp_path / "run.csv"),
        "--encoding", "latin-1", "--skip-lines", "1", "--units-row",
    )  # fmt: skip
    assert made.exit_code == 0, made.stderr
    assert read_log(tmp_path / "run.csv")["sensor_torque"].tolist() == [0.002, 0.004, 0.006]


def test_what_is_known_of_a_text_is_given_to_the_guess(tmp_path: Path) -> None:
    rows = "".join(f"{k / 100:g};{k / 50:g};{np.sin(k / 9):.3f}\n" for k in range(300))
    decoy = "gains\n" + "1;2;3\n" * 40
    text = f"{decoy}Zeit;Winkel [°];Moment [Nm]\ns;deg;Nm\n{rows}"
    run, made_map = tmp_path / "run.txt", tmp_path / "map.toml"
    run.write_bytes(text.encode("cp850"))
    line = ("init", run, "--out", made_map, "--skip-lines", 41, "--units-row")
    assert call(*line, "--encoding", "cp850").exit_code == 0
    log = read_log(run, made_map)
    assert len(log) == 300 and {"time", "output_position"} <= set(log.channels)
    assert np.ptp(log["output_position"]) == pytest.approx(np.radians(299 / 50))
    assert "skip_lines = 41" in made_map.read_text() and "cp850" in made_map.read_text()
    for wrong in (("--encoding", "nonsense"), ("--skip-lines", 5000)):
        made = call(*line[:4], *wrong)
        assert made.exit_code == 2 and made.stderr.count("\n") == 1, made.stderr
    np.savez(tmp_path / "run.npz", t=np.arange(9.0), q=np.arange(9.0))
    assert "is no text" in call("init", tmp_path / "run.npz", "--encoding", "utf-8").stderr


def test_an_option_overrules_the_map_also_where_it_says_no_or_none(tmp_path: Path) -> None:
    (tmp_path / "run.txt").write_text("t;w\n0;1\n1;2\n2;3\n")
    (tmp_path / "map.toml").write_text(
        '[read]\nskip_lines = 1\nunits_row = true\n[columns]\ntime = "t"\noutput_velocity = "w"\n'
    )
    made = call(
        "convert", str(tmp_path / "run.txt"), "--columns", str(tmp_path / "map.toml"),
        "--out", str(tmp_path / "run.csv"), "--skip-lines", "0", "--no-units-row",
    )  # fmt: skip
    assert made.exit_code == 0, made.stderr
    assert read_log(tmp_path / "run.csv")["output_velocity"].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("lines", [9, 10])
def test_more_lines_to_skip_than_there_are_is_one_sentence(tmp_path: Path, lines: int) -> None:
    (tmp_path / "run.txt").write_text(TEXT)
    with pytest.raises(InputError, match=rf"has 7 lines where {lines} are to be skipped"):
        read_log(tmp_path / "run.txt", {"time": "t"}, skip_lines=lines)


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        (["2026-03-01T12:00:00.001Z", "2026-03-01T12:00:00.251Z"], 0.25),
        (["2026-10-25 02:59:59.5+02:00", "2026-10-25 02:00:00.5+01:00"], 1.0),  # summer time ends
        (["01.03.2026 12:00:00,125", "01.03.2026 12:00:00,250"], 0.125),
        (["3/1/2026 11:59:59.5 AM", "3/1/2026 12:00:00.5 PM"], 1.0),
        (["13/1/2026 1:00:00", "13/1/2026 1:00:02"], 2.0),
        (["23:59:59.9", "0:00:00.1"], 0.2),
        (["1770000000000000000", "1770000000004000000"], 4e6),
    ],
)
def test_time_stamps_are_seconds_from_the_first(
    tmp_path: Path, stamps: list[str], seconds: float
) -> None:
    rows = "".join(f"{stamp};{n}\n" for n, stamp in enumerate(stamps))
    (tmp_path / "run.csv").write_text("when;q\n" + rows)
    log = read_log(tmp_path / "run.csv", {"time": "when", "output_position": "q"}, separator=";")
    assert log["time"].tolist() == pytest.approx([0.0, seconds], abs=1e-9)


def test_columns_of_matrices_and_vectors_in_groups_are_named_as_numpy_reaches_them(
    tmp_path: Path,
) -> None:
    time, q = np.arange(5) / 10.0, np.arange(15.0).reshape(5, 3)
    log = read_log({"t": time, "q": q}, {"time": "t", "output_position": "q[:, 2]"})
    assert log["output_position"].tolist() == q[:, 2].tolist()
    log = read_log({"t": time, "q": q.T}, {"time": "t", "output_position": "q[2, :]"})
    assert log["output_position"].tolist() == q[:, 2].tolist()
    for name, content, marks in (
        ("plain.h5", q, {}),
        ("matlab.mat", q.T, {"MATLAB_class": b"double"}),
    ):
        with h5py.File(tmp_path / name, "w") as file:
            file["t"], file["run/q"] = time, content
            file["run/q"].attrs.update(marks)
        packed = tmp_path / f"{name}.gz"
        packed.write_bytes(gzip.compress((tmp_path / name).read_bytes()))
        for source in (tmp_path / name, packed):
            log = read_log(source, {"time": "t", "output_position": "run.q[:, 2]"})
            assert log["output_position"].tolist() == q[:, 2].tolist()
    nested = {"run": {"t": time, "joint": {"q": q[:, 1]}}, "gains": {"kp": 3.0}}
    log = read_log(nested, {"time": "run.t", "output_position": "run.joint.q"})
    assert log["output_position"].tolist() == q[:, 1].tolist()


def test_guess_map_is_public_and_its_repr_is_a_line(tmp_path: Path) -> None:
    assert "guess_map" in dir(flexspline)
    guess = guess_map(written(tmp_path, "aligned_hash"))
    assert "\n" not in repr(guess) and len(repr(guess)) < 300
    assert "<table" in guess._repr_html_()
    json.dumps(dict(guess.facts))


def test_a_stated_gear_ratio_that_the_motion_contradicts_is_unsure_and_stages_are_no_ratio(
    tmp_path: Path,
) -> None:
    table = "\n".join(f"{t:.4f};{q:.6f};{50 * q:.4f}" for t, q in zip(TIME, Q, strict=True))
    recording = tmp_path / "run.txt"
    for head, unsure in (("gear ratio: 100", True), ("gear ratio: 50", False)):
        recording.write_text(f"{head}\n\nt [s];q [rad];theta [rad]\n{table}\n")
        guess = guess_map(recording)
        assert guess.facts["gear_ratio"] == 50
        assert any("the file says 100" in said for said in guess.unsure) == unsure
    recording.write_text(f"Getriebe 3 Stufen, 50:1\n\nt [s];q [rad]\n{table.replace(';', ';')}\n")
    assert guess_map(recording).facts.get("gear_ratio") in (None, 50)


def test_a_rate_beside_a_clock_is_unsure_and_no_rate_below_zero_is_taken(tmp_path: Path) -> None:
    recording = tmp_path / "run.npz"
    np.savez(recording, **{"t [s]": TIME, "q [rad]": Q})
    assert any("clock" in said for said in guess_map(recording, rate=1000.0).unsure)
    for rate in (0.0, -5.0, float("nan")):
        with pytest.raises(InputError, match="give rows per second, above zero"):
            guess_map(recording, rate=rate)


def test_an_odd_cell_costs_the_figure_and_not_the_map(tmp_path: Path) -> None:
    rows = [f"{t:.4f},{q:.6f}" for t, q in zip(TIME, Q, strict=True)]
    rows[700] = "3.5000,OVLD"
    recording = tmp_path / "run.csv"
    recording.write_text("t [s],q [rad]\n" + "\n".join(rows) + "\n")
    said = call("init", recording, "--out", tmp_path / "map.toml")
    assert said.exit_code == 0
    assert "not drawn" in said.stdout and "OVLD" in said.stdout
    assert (tmp_path / "map.toml").exists() and not (tmp_path / "map.png").exists()


def test_a_long_line_above_the_table_takes_no_time(tmp_path: Path) -> None:
    """A pattern that looks at a line in every way from every letter takes minutes for this."""
    recording = tmp_path / "run.txt"
    digits, name = "7" * 20_000, "x" + " " * 20_000 + "y"
    table = "\n".join(f"{t:.4f};{q:.6f};1" for t, q in zip(TIME[:300], Q[:300], strict=True))
    recording.write_text(f"{digits}\n\nt [s];q [rad];{name}\n{table}\n")
    assert "output_position" in guess_map(recording).channels


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        (["12/04/2026 23:59:59.5", "13/04/2026 00:00:00.5"], 1.0),
        (["03/04/2026 23:59:59.5", "04/04/2026 00:00:00.5"], 1.0),
        (["04/03/2026 23:59:59.5", "04/04/2026 00:00:00.5"], 1.0),
        (["2026-04-03 14:00:00", "2026-04-03 01:00:00"], -46_800.0),
    ],
)
def test_a_date_is_read_so_that_a_night_is_no_month(stamps: list[str], seconds: float) -> None:
    read = seconds_of_stamps(np.array(stamps, dtype=object))
    assert read is not None
    assert read.tolist() == [0.0, seconds]


@pytest.mark.parametrize(
    ("channel", "unit", "factor"),
    [
        ("sensor_torque", "MNm", 1e6),
        ("sensor_torque", "mNm", 1e-3),
        ("sensor_torque", "N·m", 1.0),
        ("sensor_voltage", "MV", 1e6),
        ("output_velocity", "1/min", np.pi / 30),
        ("output_velocity", "RPM", np.pi / 30),
        ("output_position", "°", np.pi / 180),
    ],
)
def test_a_unit_is_what_pint_calls_it_before_it_is_what_may_be_meant(
    channel: str, unit: str, factor: float
) -> None:
    assert to_si(channel, unit)[0] == pytest.approx(factor)


def test_the_usual_units_are_those_of_pint() -> None:
    channels = {channel.unit: name for name, channel in CHANNELS.items()}
    for wanted, known in USUAL.items():
        for unit, factor in known.items():
            assert _by_pint(channels[wanted], wanted, unit) == (factor, 0.0)


def test_vectors_at_the_top_are_the_record_whatever_lies_beside_them(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", t=TIME, q=Q, map=np.ones((5000, 10)))
    log = read_log(tmp_path / "run.npz", {"time": "t", "output_position": "q"})
    assert len(log) == len(TIME)


def test_an_attribute_that_is_no_unit_changes_nothing(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file.create_dataset("t", data=TIME).attrs["units"] = "seconds since 2020-01-01"
        file.create_dataset("q", data=np.degrees(Q)).attrs["units"] = "deg"
        file["alias"] = h5py.SoftLink("/q")
    log = read_log(tmp_path / "run.h5", {"time": "t", "output_position": "q"})
    assert np.array_equal(log["time"], TIME)
    assert np.allclose(log["output_position"], Q)


def test_of_columns_without_names_a_velocity_is_not_taken_for_a_position(tmp_path: Path) -> None:
    """The velocity's own derivative follows it more exactly than it follows a noisy angle."""
    time = np.arange(0.0, 20.0, 0.01)
    slow, fast = 3.0 * np.pi, 7.0 * np.pi  # whole periods in the run
    angle = -np.cos(slow * time) / slow - 0.5 * np.cos(fast * time) / fast
    angle += 0.01 * np.random.default_rng(1).standard_normal(len(time))
    velocity = np.sin(slow * time) + 0.5 * np.sin(fast * time)
    current = slow * np.cos(slow * time) + 0.5 * fast * np.cos(fast * time)
    np.savetxt(
        tmp_path / "bare.csv", np.column_stack([time, angle, velocity, current]), "%.6g", ","
    )
    guess = guess_map(tmp_path / "bare.csv")
    assert guess.columns["output_position"].source == 1
    assert guess.columns["output_velocity"].source == 2


def test_a_reason_is_given_once() -> None:
    assert joined("the velocity's integral", "", "the velocity's integral") == (
        "the velocity's integral"
    )


def angles_without_units(path: Path, **factors: float) -> Guess:
    """The guess of a joint of 100:1 whose columns have no units, each times a factor of rad."""
    time = np.arange(8000) * 0.002
    q = 1.2 * np.sin(time) + 0.5 * np.sin(2.3 * time)
    speed = 1.2 * np.cos(time) + 1.15 * np.cos(2.3 * time)
    columns = {
        "q": q,
        "dq": speed,
        "phi_m": 100.0 * q + 0.01 * np.sin(200.0 * q),
        "tau_motor": 0.1 * np.tanh(speed / 0.01) + 0.05 * speed,
    }
    scaled = {name: factors.get(name, 1.0) * values for name, values in columns.items()}
    table = np.column_stack([time, *scaled.values()])
    np.savetxt(path, table, delimiter=",", header=",".join(["t", *scaled]), comments="")
    return guess_map(path)


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("velocity", [True, False])
def test_angles_of_one_file_without_units_are_in_one_unit(
    unit: str, velocity: bool, tmp_path: Path
) -> None:
    """q was taken for degrees by its size, phi_m for rad, and the gear for 5730:1, surely."""
    names = ["q", "phi_m", *(["dq"] if velocity else [])]
    factor = np.degrees(1.0) if unit == "deg" else 1.0
    guess = angles_without_units(tmp_path / "run.csv", **dict.fromkeys(names, factor))
    assert guess.facts["gear_ratio"] == 100.0
    assert guess.channels["output_position"].unit == guess.channels["motor_position"].unit == unit
    assert guess.log()["motor_position"].max() == pytest.approx(100 * 1.7, rel=0.05)
    assert not any("gear_ratio" in said and "degrees" in said for said in guess.unsure)


@pytest.mark.parametrize(("name", "ratio"), [("phi_m", 5730.0), ("q", 1.7453)])
def test_a_ratio_that_degrees_beside_radians_make_is_unsure(
    name: str, ratio: float, tmp_path: Path
) -> None:
    guess = angles_without_units(tmp_path / "run.csv", **{name: np.degrees(1.0), "dq": np.nan})
    assert guess.facts["gear_ratio"] == pytest.approx(ratio, rel=1e-3)
    (said,) = (each for each in guess.unsure if "gear_ratio" in each)
    assert "in degrees and the other in radians?" in said and " 100;" in said


def test_a_unit_that_is_stated_of_one_angle_is_the_other_s_where_a_gear_is_between(
    tmp_path: Path,
) -> None:
    for unit, own in (("rad", 1.0), ("deg", np.degrees(1.0))):
        for factor, motor in ((1.0, "rad"), (np.degrees(1.0), "deg")):
            path = tmp_path / "run.csv"
            angles_without_units(path, q=own, dq=np.nan, phi_m=factor)
            path.write_text(path.read_text().replace("t,q,", f"t,q [{unit}],", 1))
            guess = guess_map(path)
            assert guess.channels["motor_position"].unit == motor
            assert guess.facts["gear_ratio"] == 100.0
