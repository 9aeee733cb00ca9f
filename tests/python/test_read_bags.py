"""Bags of ROS 1 and ROS 2 and MCAP: the numbers of their messages, by topic, field and joint."""

from __future__ import annotations

import contextlib
import gzip
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import foreign_files
import numpy as np
import pytest
from bags import (
    LATE,
    ZERO,
    Sent,
    joint_state,
    write_bag1,
    write_bag2,
    write_bag2_parts,
    write_mcap,
    write_mcap_json,
)
from cli_calls import call
from mcap.writer import CompressionType, Writer

from flexspline.errors import InputError
from flexspline.logs import read_log
from flexspline.logs.read import joints_of

TIME = np.arange(300) * 0.002
STEPS = [2_000_000 * k for k in range(300)]
ANGLE = np.stack([np.sin(9.0 * TIME), np.cos(4.0 * TIME)], axis=1)
SPEED = np.stack([9.0 * np.cos(9.0 * TIME), -4.0 * np.sin(4.0 * TIME)], axis=1)
TORQUE = np.stack([20.0 * ANGLE[:, 1], 3.0 + ANGLE[:, 0]], axis=1)
JOINTS = ("hip", "knee")
MAP = {
    "output_position": "position[{joint}]",
    "output_velocity": "velocity[{joint}]",
    "sensor_torque": "effort[{joint}]",
}

STATES = [
    joint_state("/joint_states", step, JOINTS, ANGLE[k], SPEED[k], TORQUE[k])
    for k, step in enumerate(STEPS)
]

FILES: dict[str, Callable[[Path], None]] = {
    "a.bag": lambda p: write_bag1(p, STATES),
    "bz2.bag": lambda p: write_bag1(p, STATES, "BZ2"),
    "lz4.bag": lambda p: write_bag1(p, STATES, "LZ4"),
    "a.db3": lambda p: write_bag2(p, STATES),
    "humble.db3": lambda p: write_bag2(p, STATES, iron=False),
    "ros2.mcap": lambda p: write_bag2(p, STATES, mcap=True),
    "a.mcap": lambda p: write_mcap(p, STATES),
    "lz4.mcap": lambda p: write_mcap(p, STATES, CompressionType.LZ4),
    "plain.mcap": lambda p: write_mcap(p, STATES, CompressionType.NONE),
    "by_its_beginning": lambda p: write_mcap(p, STATES),
}


@pytest.mark.parametrize("name", FILES)
def test_a_joint_is_read_by_its_name(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    assert joints_of(tmp_path / name, MAP) == JOINTS
    for k, joint in enumerate(JOINTS):
        log = read_log(tmp_path / name, MAP, joint=joint)
        assert log["time"] == pytest.approx(TIME, abs=1e-12)
        assert np.array_equal(log["output_position"], ANGLE[:, k])
        assert np.array_equal(log["output_velocity"], SPEED[:, k])
        assert np.array_equal(log["sensor_torque"], TORQUE[:, k])
        assert log.facts["joint"] == joint
    assert any("the clock is header.stamp" in said for said in log.history)


@pytest.mark.parametrize("mcap", [False, True])
@pytest.mark.parametrize("count", [1, 12])
def test_the_folder_of_a_bag_of_ros_2_is_one_run(mcap: bool, count: int, tmp_path: Path) -> None:
    """Its tenth file stands behind its ninth."""
    write_bag2_parts(tmp_path / "run", STATES, count, mcap=mcap)
    assert joints_of(tmp_path / "run", MAP) == JOINTS
    log = read_log(tmp_path / "run", MAP, joint="knee")
    assert log["time"] == pytest.approx(TIME, abs=1e-12)
    assert np.array_equal(log["output_position"], ANGLE[:, 1])
    assert log.facts["name"] == "run"
    (tmp_path / "map.toml").write_text(
        "[columns]\n" + "".join(f"{c} = '{s}'\n" for c, s in MAP.items())
    )
    said = call("convert", tmp_path / "run", "--columns", tmp_path / "map.toml", "--joint", "hip",
                "--out", tmp_path / "hip.csv")  # fmt: skip
    assert said.exit_code == 0, said.output
    assert np.array_equal(read_log(tmp_path / "hip.csv")["sensor_torque"], TORQUE[:, 0])


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda f: (f / "run_1.db3").unlink(), "run: its files run_0.db3, run_2.db3 are not"),
        (lambda f: (f / "run_1.db3").rename(f / "run_1.db3.zstd"), r"run_1.db3.zstd: is packed"),
        (lambda f: [p.unlink() for p in f.glob("*.db3")], "run: has no .db3 and no .mcap file"),
        (lambda f: (f / "metadata.yaml").unlink(), "run: is a folder; give the path of a log"),
        (
            lambda f: (f / "run_2.db3").write_bytes(b"SQLite"),
            "run: run_2.db3: not a ROS 2 bag, or a",
        ),
    ],
)
def test_a_folder_that_is_no_whole_bag_is_refused(
    spoil: Callable[[Path], object], sentence: str, tmp_path: Path
) -> None:
    write_bag2_parts(tmp_path / "run", STATES[:30], 3, mcap=False)
    spoil(tmp_path / "run")
    with pytest.raises(InputError, match=sentence):
        read_log(tmp_path / "run", MAP, joint="knee")


def test_names_in_another_order_are_the_same_joints(tmp_path: Path) -> None:
    mixed = [
        joint_state("/j", step, JOINTS[::way], ANGLE[k, ::way])
        for k, step in enumerate(STEPS)
        for way in [1 if k % 3 else -1]
    ]
    write_mcap(tmp_path / "a.mcap", mixed)
    for k, joint in enumerate(JOINTS):
        log = read_log(tmp_path / "a.mcap", {"output_position": f"position[{joint}]"})
        assert np.array_equal(log["output_position"], ANGLE[:, k])


def test_joints_of_two_publishers_have_the_messages_that_name_them(tmp_path: Path) -> None:
    sent = [
        joint_state("/j", step + shift, [joint], [ANGLE[k, j]])
        for k, step in enumerate(STEPS)
        for j, (joint, shift) in enumerate(zip(JOINTS, (0, 500_000), strict=True))
    ]
    write_bag2(tmp_path / "a.db3", sent)
    for j, joint in enumerate(JOINTS):
        log = read_log(tmp_path / "a.db3", {"output_position": "position[{joint}]"}, joint=joint)
        assert np.array_equal(log["output_position"], ANGLE[:, j]) and len(log) == 300


def wrench(time: int, torque: float) -> Sent:
    stamp = {"sec": (ZERO + time) // 10**9, "nanosec": (ZERO + time) % 10**9}
    fields = {
        "header": {"stamp": stamp, "frame_id": ""},
        "wrench": {
            "force": {"x": 0.0, "y": 0.0, "z": 0.0},
            "torque": {"x": 0.0, "y": 0.0, "z": torque},
        },
    }
    return Sent("/load_cell", time + 3 * LATE, "geometry_msgs/msg/WrenchStamped", fields)


@pytest.mark.parametrize("write", [write_bag1, write_bag2, write_mcap])
def test_a_field_of_another_topic_is_laid_on_the_clock_of_the_faster(
    write: Callable[..., None], tmp_path: Path
) -> None:
    slow = [wrench(step, 5.0 + step * 1e-9) for step in range(0, 600_000_000, 10_000_000)]
    both = sorted([*STATES, *slow], key=lambda sent: sent.time)
    write(tmp_path / "a.bag", both)
    columns = {**MAP, "reference_torque": "wrench.torque.z"}
    log = read_log(tmp_path / "a.bag", columns, joint="knee")
    assert log["time"] == pytest.approx(TIME[:296], abs=1e-12)
    assert log["reference_torque"] == pytest.approx(5.0 + TIME[:296], abs=1e-9)
    assert any("296 samples of topic '/joint_states'" in said for said in log.history)


def test_topics_with_one_path_are_told_apart_by_name_or_variable(tmp_path: Path) -> None:
    left = [joint_state("/left/joint_states", s, JOINTS, ANGLE[k]) for k, s in enumerate(STEPS)]
    right = [joint_state("/right/joint_states", s, JOINTS, -ANGLE[k]) for k, s in enumerate(STEPS)]
    write_mcap(tmp_path / "a.mcap", [*left, *right])
    named = {"output_position": "/right/joint_states.position[knee]"}
    assert np.array_equal(read_log(tmp_path / "a.mcap", named)["output_position"], -ANGLE[:, 1])
    plain = {"output_position": "position[knee]"}
    log = read_log(tmp_path / "a.mcap", plain, variable="/left/joint_states")
    assert np.array_equal(log["output_position"], ANGLE[:, 1])
    with pytest.raises(ValueError, match=r"no column 'position\[knee\]'; it has time, /left"):
        read_log(tmp_path / "a.mcap", plain)


def test_stamps_of_a_simulation_are_no_clock_beside_other_topics(tmp_path: Path) -> None:
    sent = [joint_state("/j", s - ZERO, ["a"], [ANGLE[k, 0]]) for k, s in enumerate(STEPS)]
    sent = [one._replace(time=STEPS[k] + (k % 2) * 100) for k, one in enumerate(sent)]
    write_bag2(tmp_path / "a.db3", sent)
    log = read_log(tmp_path / "a.db3", {"output_position": "position[a]"})
    assert any("the clock is log_time" in said for said in log.history)
    assert log["time"] == pytest.approx(TIME, abs=2e-7)
    stamped = read_log(
        tmp_path / "a.db3", {"time": "header.stamp", "output_position": "position[a]"}
    )
    assert stamped["time"] == pytest.approx(TIME, abs=1e-12)


def test_messages_out_of_order_are_sorted_by_the_time_of_their_recording(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", [*STATES[1::2], *STATES[::2]])
    log = read_log(tmp_path / "a.mcap", MAP, joint="hip")
    assert np.array_equal(log["output_position"], ANGLE[:, 0])


def test_messages_in_json_are_read_by_field_path(tmp_path: Path) -> None:
    records = [(s, {"joints": {"name": ["hip"], "q": [ANGLE[k, 0]]}, "on": k > 99, "none": None})
               for k, s in enumerate(STEPS)]  # fmt: skip
    write_mcap_json(tmp_path / "a.mcap", "state", records)
    log = read_log(tmp_path / "a.mcap", {"output_position": "joints.q[hip]", "enabled": "on"})
    assert np.array_equal(log["output_position"], ANGLE[:, 0])
    assert np.array_equal(log["enabled"], np.arange(300) > 99)


def test_a_packed_file_is_unpacked(tmp_path: Path) -> None:
    for name in ("a.mcap", "a.bag"):
        FILES[name](tmp_path / name)
        packed = tmp_path / f"{name}.gz"
        packed.write_bytes(gzip.compress((tmp_path / name).read_bytes()))
        assert len(read_log(packed, MAP, joint="hip")) == 300


def test_commands_take_a_bag_by_a_map_with_places(tmp_path: Path) -> None:
    write_bag1(tmp_path / "a.bag", STATES)
    (tmp_path / "map.toml").write_text(
        "[columns]\n" + "".join(f'{channel} = "{path}"\n' for channel, path in MAP.items())
    )
    said = call("check", str(tmp_path / "a.bag"), "--columns", str(tmp_path / "map.toml"),
                "--joint", "all")  # fmt: skip
    assert said.exit_code in (0, 3) and "hip" in said.output and "knee" in said.output


def test_init_guesses_the_map_of_a_bag(tmp_path: Path) -> None:
    write_bag2(tmp_path / "a.db3", STATES)
    made = call("init", str(tmp_path / "a.db3"), "--joint", "knee", "--out", f"{tmp_path}/map.toml")
    assert made.exit_code == 0, made.output
    assert 'time = {source = "time", unit = "s"}' in (tmp_path / "map.toml").read_text()
    log = read_log(tmp_path / "a.db3", tmp_path / "map.toml")
    assert np.array_equal(log["output_position"], ANGLE[:, 1])
    assert np.array_equal(log["output_velocity"], SPEED[:, 1])


# what is wrong


def refused(path: Path, columns: Any = None, **how: Any) -> str:
    return foreign_files.refused(path, columns or {"output_position": "position[hip]"}, **how)


@pytest.mark.parametrize("name", ["a.bag", "bz2.bag", "lz4.bag", "a.mcap", "plain.mcap", "a.db3"])
@pytest.mark.parametrize("share", [0.001, 0.3, 0.9, 0.999])
def test_a_recording_that_was_cut_short_is_refused(name: str, share: float, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    content = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(content[: int(share * len(content)) + 20])
    try:
        log = read_log(tmp_path / name, {"output_position": "position[hip]"})
    except InputError as error:
        assert str(error).startswith(str(tmp_path / name)) and "; " in str(error)
    else:  # only what comes behind the messages is missing: an index, a summary
        assert share > 0.5 and np.array_equal(log["output_position"], ANGLE[: len(log), 0])
        assert len(log) == 300


@pytest.mark.parametrize("name", ["a.bag", "lz4.bag", "a.mcap", "plain.mcap", "a.db3"])
def test_damaged_bytes_are_refused_or_read_and_nothing_else(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    content = (tmp_path / name).read_bytes()
    random = np.random.default_rng(5)
    refusals = 0
    for _ in range(60):
        damaged = bytearray(content)
        for at in random.integers(0, len(content), 12):
            damaged[at] = random.integers(256)
        (tmp_path / name).write_bytes(bytes(damaged))
        try:
            read_log(tmp_path / name, {"output_position": "position[hip]"}, max_memory=0.1)
        except InputError as error:
            refusals += 1
            assert str(error).startswith(str(tmp_path / name))
    assert refusals > 5


def test_a_topic_or_a_joint_that_is_not_there_is_said_with_those_that_are(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", STATES)
    said = refused(tmp_path / "a.mcap", variable="/joint_state")
    assert "no topic '/joint_state' (did you mean '/joint_states'?)" in said
    said = refused(tmp_path / "a.mcap", MAP, joint="ankle")
    assert "no column 'position[ankle]'" in said and "position[knee]" in said


def test_what_no_message_says_is_told(tmp_path: Path) -> None:
    for write in (write_mcap, write_bag1):
        write(tmp_path / write.__name__, [])
        assert "has no messages" in refused(tmp_path / write.__name__)
    (tmp_path / "a.bag").write_bytes(b"")
    assert "the file is empty" in refused(tmp_path / "a.bag")
    write_mcap(tmp_path / "one.mcap", STATES[:1])
    assert "only one row of data" in refused(tmp_path / "one.mcap")


def mcap(path: Path, definition: str, data: bytes, encoding: str = "cdr") -> Path:
    """An MCAP file of ten messages of a type of its own."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("a/msg/Own", "ros2msg", definition.encode())
        channel = writer.register_channel("/own", encoding, schema)
        for k in range(10):
            writer.add_message(channel, k, data, k)
        writer.finish()
    return path


DEEP = "".join(f"{'=' * 80}\nMSG: a/T{k}\nT{k + 1} x\nT{k + 1} y\n" for k in range(40))
HOSTILE = {
    "code": ("float64 x\n__import__('os').system('x')\n", "is no field of a message"),
    "itself": ("Own again\n", "a/Own holds itself"),
    "not defined": ("other/Thing x\n", "other/Thing is not defined"),
    "endless": (f"T0 x\n{DEEP}{'=' * 80}\nMSG: a/T40\nfloat64 z\n", "more than 10000 fields"),
    "wide text": ("wstring x\n", "it holds wide text"),
    "too long": ("float64[] x\n", "it ends within 'x'"),
    "too short": ("float64[9] x\n", "it ends within 'x'"),
    "a text beyond": ("string x\n", "it ends within a text"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_definition_that_does_not_fit_is_said(case: str, tmp_path: Path) -> None:
    definition, says = HOSTILE[case]
    data = b"\0\1\0\0\xff\xff\xff\x7f"
    assert says in refused(mcap(tmp_path / "a.mcap", definition, data))


def test_messages_of_other_kinds_are_said(tmp_path: Path) -> None:
    said = refused(mcap(tmp_path / "a.mcap", "float64 x\n", b"", "protobuf"))
    assert "no topic can be read (messages of protobuf)" in said
    assert "it is not plain CDR" in refused(mcap(tmp_path / "a.mcap", "float64 x\n", b"\0\7\0\0"))


def test_chunks_that_unfold_to_more_than_they_say_are_refused(tmp_path: Path) -> None:
    import zstandard
    from mcap.records import Chunk

    from flexspline.logs.bag_files import _unfolded_chunk

    bomb = zstandard.compress(bytes(10_000_000))
    for size, says in ((100, "does not unfold to the size"), (10_000_000, "takes 0.01 GB")):
        chunk = Chunk("zstd", bomb, 0, 0, 0, size)
        with pytest.raises((InputError, ValueError), match=says):
            _unfolded_chunk(chunk, "a.mcap", 1_000_000)


def test_numbers_beyond_the_limit_of_memory_are_refused(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", STATES)
    assert "takes 1e-05 GB of memory" in refused(tmp_path / "a.mcap", max_memory=1e-5)


def test_a_database_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    with contextlib.closing(sqlite3.connect(tmp_path / "a.db3")) as connection:
        connection.execute("CREATE TABLE other (x)")
        connection.execute("CREATE VIEW messages AS SELECT 1 AS topic_id")
        connection.execute("CREATE TABLE topics (id, name, type, serialization_format)")
        connection.commit()
    assert "it has no tables of topics and messages" in refused(tmp_path / "a.db3")
    packed = tmp_path / "a.db3.gz"
    packed.write_bytes(gzip.compress((tmp_path / "a.db3").read_bytes()))
    assert "cannot be read while packed" in refused(packed)


@pytest.mark.parametrize(("name", "library", "extra"), [
    ("a.mcap", "mcap", "mcap"), ("lz4.bag", "lz4", "ros"), ("humble.db3", "rosbags", "ros"),
])  # fmt: skip
def test_without_the_library_the_command_that_installs_it_is_said(
    name: str, library: str, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    FILES[name](tmp_path / name)
    columns = {"output_position": "position[hip]"}
    said = foreign_files.refused_without(library, tmp_path / name, columns, monkeypatch)
    assert said.endswith(f"pip install 'flexspline[{extra}]'")
