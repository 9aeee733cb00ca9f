"""Recordings of ROS as its tools write them, by libraries that the package does not read with."""

from __future__ import annotations

import contextlib
import json
import shutil
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag1 import Writer as Bag1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2
from rosbags.typesys import Stores, get_typestore

ZERO = 1_800_000_000_000_000_000
"""Nanoseconds since 1970 at which recordings begin."""
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
LATE = 700_000  # ns from a stamp to its recording


class Sent(NamedTuple):
    """A message: topic, nanoseconds since `ZERO`, type, and its fields as nested dictionaries."""

    topic: str
    time: int
    type: str
    fields: dict[str, Any]


def joint_state(
    topic: str, time: int, names: Sequence[str], position: Sequence[float],
    velocity: Sequence[float] = (), effort: Sequence[float] = (),
) -> Sent:  # fmt: skip
    """A sensor_msgs/JointState, recorded `LATE` ns behind its stamp."""
    stamp = {"sec": (ZERO + time) // 10**9, "nanosec": (ZERO + time) % 10**9}
    fields = {
        "header": {"stamp": stamp, "frame_id": "base"},
        "name": list(names),
        "position": np.array(position, dtype=float),
        "velocity": np.array(velocity, dtype=float),
        "effort": np.array(effort, dtype=float),
    }
    return Sent(topic, time + LATE, "sensor_msgs/msg/JointState", fields)


def _made(store: Any, kind: str, fields: dict[str, Any]) -> Any:
    """The message of a store with these fields; ROS 1 wants a number in its headers."""
    wanted = store.types[kind].__dataclass_fields__
    made = {}
    for name, described in store.fielddefs[kind][1]:
        if name == "seq" and name not in fields:
            made[name] = 0
            continue
        value = fields[name]
        if isinstance(value, dict):
            value = _made(store, described[1], value)
        made[name] = value
    assert set(made) <= set(wanted)
    return store.types[kind](**made)


def write_bag1(path: Path, sent: Sequence[Sent], packed: str | None = None) -> None:
    """A .bag of ROS 1."""
    bag = Bag1(path)
    if packed:
        bag.set_compression(Bag1.CompressionFormat[packed])
    with bag as writer:
        kinds = {s.topic: s.type for s in sent}
        topics = {t: writer.add_connection(t, k, typestore=ROS1) for t, k in kinds.items()}
        for s in sent:
            raw = ROS1.serialize_ros1(_made(ROS1, s.type, s.fields), s.type)
            writer.write(topics[s.topic], ZERO + s.time, raw)


def write_bag2_folder(
    folder: Path, sent: Sequence[Sent], *, mcap: bool = False, iron: bool = True
) -> Path:
    """A bag of ROS 2, of a version that keeps definitions or not; return its one file."""
    storage = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with Bag2(folder, version=9 if iron else 8, storage_plugin=storage) as writer:
        kinds = {s.topic: s.type for s in sent}
        topics = {t: writer.add_connection(t, k, typestore=ROS2) for t, k in kinds.items()}
        for s in sent:
            raw = ROS2.serialize_cdr(_made(ROS2, s.type, s.fields), s.type)
            writer.write(topics[s.topic], ZERO + s.time, raw)
    (made,) = [file for file in folder.iterdir() if file.suffix in (".db3", ".mcap")]
    if not iron:
        with contextlib.closing(sqlite3.connect(made)) as connection:
            connection.execute("DROP TABLE message_definitions")
            connection.commit()
    return made


def write_bag2(path: Path, sent: Sequence[Sent], *, mcap: bool = False, iron: bool = True) -> None:
    """The .db3 or .mcap of a bag of ROS 2 alone."""
    folder = path.with_name(f"{path.name}.folder")
    shutil.move(write_bag2_folder(folder, sent, mcap=mcap, iron=iron), path)
    shutil.rmtree(folder)


def write_bag2_parts(folder: Path, sent: Sequence[Sent], count: int, *, mcap: bool) -> None:
    """A bag of ROS 2 whose recorder began the next file again and again."""
    parts = np.array_split(np.arange(len(sent)), count)
    for number, part in enumerate(parts):
        draft = folder.with_name(f"draft{number}")
        made = write_bag2_folder(draft, [sent[k] for k in part], mcap=mcap)
        folder.mkdir(exist_ok=True)
        shutil.move(made, folder / f"{folder.name}_{number}{made.suffix}")
        shutil.move(draft / "metadata.yaml", folder / "metadata.yaml")
        shutil.rmtree(draft)


def write_mcap(
    path: Path,
    sent: Sequence[Sent],
    packed: CompressionType = CompressionType.ZSTD,
    size: int = 4096,
) -> None:
    """An MCAP file as Foxglove's own library writes it."""
    with path.open("wb") as file:
        writer = Ros2Writer(file, chunk_size=size, compression=packed)
        schemas = {
            kind: writer.register_msgdef(kind, ROS2.generate_msgdef(kind, ros_version=2)[0])
            for kind in {s.type for s in sent}
        }
        for s in sent:
            plain = json.loads(json.dumps(s.fields, default=lambda array: array.tolist()))
            writer.write_message(s.topic, schemas[s.type], plain, ZERO + s.time, ZERO + s.time)
        writer.finish()


def write_mcap_json(path: Path, topic: str, records: Sequence[tuple[int, Any]]) -> None:
    """An MCAP file with messages in JSON; each at so many nanoseconds."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("state", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel(topic, "json", schema)
        for time, record in records:
            data = json.dumps(record).encode()
            writer.add_message(channel, ZERO + time, data, ZERO + time)
        writer.finish()
