"""Recordings of ROS 1 (.bag) and ROS 2 (.db3, .mcap), and MCAP with messages in JSON.

A bag of ROS 2 is a folder, whose files are read as one, in the order of their numbers.

Each number in a message is a column, called by the path of its field; where several topics have
that path, with the topic before it: ``/left/joint_states.position[elbow]``. Columns of one topic
are a series with a clock of its own: ``header.stamp``, where the messages of every topic have one
near the time of recording, otherwise the time of recording; both are columns too. A joint that
only some messages name has those alone.

Containers are read record by record, and nothing is unfolded beyond the limit of memory.
Definitions of messages come with the file, from a stranger. They are read as lists of fields and
walked; no code is made of them, as the decoders of common libraries do. Numbers are called by the
path of their field: ``wrench.force.x``. A list of numbers that is as long as the list of names
beside it, as in ``sensor_msgs/JointState``, is called by these: ``position[elbow]``; any other by
number. Stamps are whole nanoseconds.
"""

from __future__ import annotations

import bz2
import contextlib
import io
import json
import re
import sqlite3
import struct
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.one_clock import with_time
from flexspline.logs.packed import require_memory
from flexspline.logs.table import Series, Table

__all__ = ["parts_of", "read_bag", "read_mcap", "read_ros2"]

PRIMITIVES: Final = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
STAMPS: Final = {
    "time": "II", "duration": "ii",
    "builtin_interfaces/Time": "iI", "builtin_interfaces/Duration": "iI",
}  # fmt: skip
"""Seconds and nanoseconds, of ROS 1 and of ROS 2."""
FIELD: Final = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?P<count>(?:<=)?\d*)\])?\s+"
    r"(?P<name>[A-Za-z]\w*)\s*(?P<constant>=)?"
)
MOST_FIELDS: Final = 10_000  # of a message with all that it holds
LIST_LIMIT: Final = 64  # numbers of a list without names that become columns
LARGEST: Final = 2**63  # whole numbers of 64 bits
STAMP: Final = "header.stamp"
"""Path of the instant at which the numbers of a message were taken, where it has one."""


class MessageError(ValueError):
    """Why a definition or a message cannot be read."""


class Stamp(int):
    """Nanoseconds."""


@dataclass(frozen=True)
class Field:
    """A field of a message: `count` is None for one value, −1 for a list of any length."""

    name: str
    type: str
    count: int | None = None


Definitions = Mapping[str, tuple[Field, ...]]


def definitions(text: str, root: str) -> Definitions:
    """Return the fields of a message and of all that it holds, by their types.

    Parameters
    ----------
    text : the definition of `root`, and below lines of ``=`` those of others, each under ``MSG:``.
    root : such as "sensor_msgs/msg/JointState".

    Raises
    ------
    MessageError
        For a line that is no field.
    """
    found: dict[str, tuple[Field, ...]] = {}
    for number, part in enumerate(re.split(r"^=+[ \t]*$", text.replace("\r", ""), flags=re.M)):
        lines = [line.split("#")[0].strip() for line in part.split("\n")]
        lines = [line for line in lines if line]
        name = _plain(root)
        if number and lines and lines[0].startswith("MSG:"):
            name = _plain(lines.pop(0)[4:].strip())
        fields = [_field(line, name) for line in lines]
        found.setdefault(name, tuple(field for field in fields if field is not None))
    return found


def _plain(name: str) -> str:
    """Return "package/Type" of "package/msg/Type"."""
    return name.replace("/msg/", "/")


def _field(line: str, inside: str) -> Field | None:
    """Return the field of a line, None for a constant."""
    match = FIELD.match(line)
    if match is None:
        raise MessageError(f"'{line[:60]}' is no field of a message")
    if match["constant"]:
        return None
    kind = _plain(match["type"])
    if kind == "Header":
        kind = "std_msgs/Header"
    elif kind not in PRIMITIVES and kind not in STAMPS and "/" not in kind and "string" not in kind:
        kind = f"{inside.rpartition('/')[0]}/{kind}"
    count = match["count"]
    fixed = count is not None and count.isdecimal()
    return Field(match["name"], kind, (int(count) if fixed else -1) if match["array"] else None)


class Decoder:
    """Reads messages of one type.

    Parameters
    ----------
    known : of `definitions`.
    root : the type of the messages.
    cdr : as ROS 2 writes them; otherwise as ROS 1 does.

    Raises
    ------
    MessageError
        Where a type is not defined, holds itself or more fields than any message has; and of a
        message, where it is too short.
    """

    def __init__(self, known: Definitions, root: str, *, cdr: bool) -> None:
        self._known, self._root, self._cdr = known, _plain(root), cdr
        _count_fields(known, self._root, ())

    def __call__(self, content: bytes) -> dict[str, Any]:
        """Return what a message holds, by the names of its fields."""
        order, start = "<", 0
        if self._cdr:
            if len(content) < 4 or content[0] or content[1] > 1:
                raise MessageError("it is not plain CDR")
            order, start = "<" if content[1] else ">", 4
        reader = _Reader(content, start, order, self._known, self._cdr)
        try:
            return reader.message(self._root)
        except (struct.error, UnicodeDecodeError) as error:
            raise MessageError(f"it is too short or not as defined ({error})") from error


def _count_fields(known: Definitions, kind: str, above: tuple[str, ...]) -> int:
    if kind in above:
        raise MessageError(f"{kind} holds itself")
    if kind not in known:
        raise MessageError(f"{kind} is not defined")
    total = 0
    for each in known[kind]:
        plain = each.type in PRIMITIVES or each.type in STAMPS or "string" in each.type
        total += 1 if plain else 1 + _count_fields(known, each.type, (*above, kind))
        if total > MOST_FIELDS:
            raise MessageError(f"{kind} has more than {MOST_FIELDS} fields")
    return total


class _Reader:
    """Walks through the bytes of one message."""

    def __init__(
        self, content: bytes, start: int, order: str, known: Definitions, cdr: bool
    ) -> None:
        self._content, self._at, self._origin = content, start, start
        self._order, self._known, self._cdr = order, known, cdr

    def message(self, kind: str) -> dict[str, Any]:
        fields = self._known[kind]
        if not fields and self._cdr:
            self._at += 1  # of a structure that needs at least one member
        return {field.name: self._value(field) for field in fields}

    def _value(self, field: Field) -> Any:
        if field.count is None:
            return self._one(field.type)
        count = self._numbers("I", 1)[0] if field.count < 0 else field.count
        if count > len(self._content) - self._at:
            raise MessageError(f"it ends within '{field.name}'")
        if field.type in PRIMITIVES:
            return self._numbers(PRIMITIVES[field.type], count)
        return [self._one(field.type) for _ in range(count)]

    def _one(self, kind: str) -> Any:
        if kind in PRIMITIVES:
            return self._numbers(PRIMITIVES[kind], 1)[0]
        if kind == "string":
            length = self._numbers("I", 1)[0]
            raw = self._content[self._at : self._at + length]
            if len(raw) < length:
                raise MessageError("it ends within a text")
            self._at += length
            return raw.rstrip(b"\0").decode("utf-8", "replace")
        if kind == "wstring":
            raise MessageError("it holds wide text, which is not read")
        if kind in STAMPS:
            seconds, rest = (self._numbers(letter, 1)[0] for letter in STAMPS[kind])
            return Stamp(seconds * 1_000_000_000 + rest)
        return self.message(kind)

    def _numbers(self, letter: str, count: int) -> Any:
        size = struct.calcsize("=" + letter)
        if self._cdr and count:
            self._at += -(self._at - self._origin) % size
        end = self._at + count * size
        if end > len(self._content):
            raise MessageError("it ends too early")
        if count > MOST_FIELDS:  # an image, or a cloud of points
            self._at = end
            return None
        made = struct.unpack_from(f"{self._order}{count}{letter}", self._content, self._at)
        self._at = end
        return made


Value = float | int | bool | str | Stamp


def flattened(
    value: Any, path: str = "", labels: tuple[str, ...] = ()
) -> Iterator[tuple[str, Value]]:
    """Yield each number and text in a message with its path."""
    if isinstance(value, dict):
        own = _labels(value)
        for name, inner in value.items():
            if own is None or inner is not own[1]:
                below = f"{path}.{name}" if path else str(name)
                yield from flattened(inner, below, own[0] if own else labels)
    elif isinstance(value, (list, tuple)):
        named = len(value) == len(labels)
        if named or len(value) <= LIST_LIMIT:
            for label, inner in zip(labels if named else range(len(value)), value, strict=True):
                yield from flattened(inner, f"{path}[{label}]")
    elif isinstance(value, int) and not -LARGEST <= value < LARGEST:
        yield path, float(value)
    elif isinstance(value, (int, float, str)):
        yield path, value


def _labels(value: Mapping[str, Any]) -> tuple[tuple[str, ...], Any] | None:
    """Return the names that stand in a list beside numbers, and that list."""
    for key, inner in value.items():
        named = key == "name" or key.endswith("names")
        if named and isinstance(inner, (list, tuple)) and _are_names(inner):
            return tuple(inner), inner
    return None


def _are_names(texts: Sequence[Any]) -> bool:
    known = {text for text in texts if isinstance(text, str)}
    return 0 < len(known) == len(texts)


LOG_TIME: Final = "log_time"
NEAR: Final = 60_000_000_000
"""Nanoseconds between the stamp of a message and its recording, within which both are of one clock.
A simulation's stamps begin at zero; a network delays by less than a second."""
NUMBER: Final = 8  # bytes
PAGES: Final = ("count", "size")


class Message(NamedTuple):
    """A message as its container has it; `time` in ns since 1970."""

    topic: str
    time: int
    content: bytes


Decode = Callable[[bytes], Any]


@dataclass(frozen=True)
class _Topic:
    """How the messages of a topic are read, or why they are not."""

    name: str
    decode: Decode | None
    why: str = ""


@dataclass(frozen=True)
class _Shape:
    """Messages that have the same paths: which they are, and their values one behind the other."""

    rows: array[int] = field(default_factory=lambda: array("q"))
    values: list[array[Any] | list[str]] = field(default_factory=list)


Shapes = dict[tuple[tuple[str, type], ...], _Shape]
CODES: Final = {Stamp: "q", bool: "b", int: "q", float: "d"}


def read_mcap(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the numbers of an MCAP file; `variable` is a topic, all others are then left out.

    Raises
    ------
    InputError
        Where it is damaged, unfolds to more than `most` bytes, or has no such topic, or none that
        can be read.
    """
    from mcap.exceptions import McapError

    with _sound(label, "MCAP file", McapError), _opened(file) as stream:
        return _Bag(label, variable, most).table(_mcap(stream, label, most), "MCAP")


def read_bag(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the numbers of a bag of ROS 1; see `read_mcap`."""
    with _sound(label, "ROS 1 bag"), _opened(file) as stream:
        return _Bag(label, variable, most).table(_ros1(stream, label, most), "bag of ROS 1")


def read_ros2(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the numbers of a bag of ROS 2: its folder, or a file of it in SQLite; see `read_mcap`.

    Raises
    ------
    InputError
        As `read_mcap`, and where it is packed or its folder has no file that can be read.
    """
    if isinstance(file, io.BytesIO):
        raise InputError(f"{label}: a bag of ROS 2 cannot be read while packed; unpack it")
    files = parts_of(file) if file.is_dir() else [file]
    with _sound(label, "ROS 2 bag"):
        return _Bag(label, variable, most).table(_one_by_one(files, label, most), "bag of ROS 2")


def parts_of(folder: Path) -> list[Path]:
    """Return the files of a bag of ROS 2 in the order in which they were recorded.

    Its recorder begins the next file, NAME_0.db3, NAME_1.db3, ... NAME_10.db3, where one is full.

    Raises
    ------
    InputError
        Where there is none, or one of its files is packed or missing.
    """
    there = sorted(folder.iterdir())
    files = [path for path in there if path.suffix in (".db3", ".mcap") and path.is_file()]
    for path in there:
        if path.suffix == ".zstd":
            raise InputError(f"{path}: is packed; unpack the bag (zstd -d), or ros2 bag convert")
    numbers = {path: int(n) for path in files if (n := path.stem.rpartition("_")[2]).isdecimal()}
    if not files:
        raise InputError(f"{folder}: has no .db3 and no .mcap file; copy the whole bag")
    if len(files) > 1 and sorted(numbers.values()) != [*range(len(files))]:
        raise InputError(
            f"{folder}: its files {listed(path.name for path in files)} are not numbered from 0 "
            "on; copy the whole bag, or give one of them"
        )
    return sorted(files, key=lambda path: numbers.get(path, 0))


def _one_by_one(files: Sequence[Path], label: str, most: int) -> Iterator[Record]:
    """Yield what the files of a bag hold, one after the other."""
    for file in files:
        name = label if len(files) == 1 else f"{label}: {file.name}"
        yield from (_mcap_part if file.suffix == ".mcap" else _sqlite_part)(file, name, most)


def _mcap_part(file: Path, label: str, most: int) -> Iterator[Record]:
    from mcap.exceptions import McapError

    with _sound(label, "MCAP file", McapError), file.open("rb") as stream:
        yield from _mcap(stream, label, most)


def _sqlite_part(file: Path, label: str, most: int) -> Iterator[Record]:
    where = f"{file.resolve().as_uri()}?mode=ro&immutable=1"
    with (
        _sound(label, "ROS 2 bag", sqlite3.Error),
        contextlib.closing(sqlite3.connect(where, uri=True)) as connection,
    ):
        pages, size = (connection.execute(f"PRAGMA page_{x}").fetchone()[0] for x in PAGES)
        if pages * size > file.stat().st_size:  # what is missing would be read as zeros
            raise EOFError("it was cut short")
        yield from _ros2(connection)


@contextlib.contextmanager
def _sound(label: str, kind: str, *errors: type[Exception]) -> Iterator[None]:
    """Say of which file it is that something cannot be read."""
    broken: tuple[type[Exception], ...] = (
        *errors,
        struct.error,
        EOFError,
        ValueError,
        KeyError,
        MemoryError,
        RuntimeError,
    )
    try:
        yield
    except InputError:
        raise
    except broken as error:
        said = str(error) or type(error).__name__
        raise InputError(
            f"{label}: not a {kind}, or a damaged one ({said}); copy or record it again, or repair "
            "it with its recorder's tool (mcap recover, rosbag reindex, ros2 bag reindex)"
        ) from error


@contextlib.contextmanager
def _opened(file: Path | io.BytesIO) -> Iterator[IO[bytes]]:
    if isinstance(file, Path):
        with file.open("rb") as stream:
            yield stream
    else:
        yield file


Record = _Topic | Message
"""What a container yields: a topic before its messages."""


@dataclass(frozen=True)
class _Bag:
    """What is read of one recording."""

    label: str
    variable: str | None
    most: int

    def table(self, records: Iterable[Record], kind: str) -> Table:
        """Return the columns of all topics, or of the one that is chosen."""
        topics: dict[str, _Topic] = {}
        shapes: dict[str, Shapes] = {}
        times: dict[str, array[int]] = {}
        taken = 0
        for record in records:
            if isinstance(record, _Topic):
                topics.setdefault(record.name, record)
                continue
            decode = topics[record.topic].decode
            if decode is None or self.variable not in (None, record.topic):
                continue
            stamps = times.setdefault(record.topic, array("q"))
            found = list(flattened(self._decoded(decode, record, len(stamps))))
            _keep(shapes.setdefault(record.topic, {}), len(stamps), found)
            stamps.append(record.time)
            taken += NUMBER * (len(found) + 1)
            require_memory(taken, self.most, self.label)
        self._require_topic(topics, times)
        return self._table(kind, topics, {name: _Read(times[name], shapes[name]) for name in times})

    def _decoded(self, decode: Decode, message: Message, number: int) -> Any:
        try:
            return decode(message.content)
        except (MessageError, ValueError, RecursionError) as error:
            raise InputError(
                f"{self.label}: message {number + 1} of topic '{message.topic}' cannot be read: "
                f"{error}; name another topic with variable=, or record it again"
            ) from error

    def _require_topic(self, topics: dict[str, _Topic], times: dict[str, array[int]]) -> None:
        if self.variable is not None and self.variable not in topics:
            raise InputError(
                f"{self.label}: no topic '{self.variable}'{did_you_mean(self.variable, topics)}; "
                f"it has {listed(topics)}"
            )
        if times:
            return
        why = {t.why for t in topics.values() if t.why and self.variable in (None, t.name)}
        if why:
            raise InputError(
                f"{self.label}: no topic can be read ({listed(sorted(why))}); record messages of "
                "ROS or JSON"
            )
        raise InputError(f"{self.label}: has no messages; record the run again")

    def _table(self, kind: str, topics: dict[str, _Topic], read: dict[str, _Read]) -> Table:
        whole = {name: each.sorted() for name, each in read.items()}
        stamped = all(each.stamps is not None for each in whole.values() if each.has_header)
        series: list[Series] = []
        columns: list[tuple[str, str, NDArray[Any], str | None, int]] = []
        for topic, each in whole.items():
            clock = each.stamps if stamped and each.stamps is not None else each.times
            for k, (rows, paths) in enumerate(each.groups()):
                part = f" ({k + 1})" if k else ""
                series.append(Series(f"topic '{topic}'{part}", clock[rows]))
                for path, values in paths.items():
                    unit = "ns" if path == LOG_TIME or path in each.in_nanoseconds else None
                    columns.append((topic, path, values, unit, len(series) - 1))
        met = Counter(path for _, path, *_ in columns)
        names = [path if met[path] == 1 else f"{topic}.{path}"
                 for topic, path, *_ in columns]  # fmt: skip
        units = [unit for *_, unit, _ in columns]
        left = [topic.name for topic in topics.values() if topic.decode is None]
        said = f"{kind}, topics {listed(whole)}"
        said += f"; not read: {listed(left)}" if left else ""
        clock_said = STAMP if stamped and any(e.has_header for e in whole.values()) else LOG_TIME
        return with_time(
            Table(
                self.label,
                tuple(values for _, _, values, _, _ in columns),
                tuple(names),
                notes=(said, f"the clock is {clock_said}"),
                units=tuple(units),
                series=tuple(series),
                of_series=tuple(number for *_, number in columns),
            )
        )


def _keep(shapes: Shapes, row: int, found: list[tuple[str, Value]]) -> None:
    """Put the values of a message behind those of the same paths."""
    key = tuple((path, type(value)) for path, value in found)
    shape = shapes.get(key)
    if shape is None:
        empty: list[array[Any] | list[str]] = [
            array(CODES[kind]) if kind in CODES else [] for _, kind in key
        ]
        shape = shapes[key] = _Shape(values=empty)
    shape.rows.append(row)
    for values, (_, value) in zip(shape.values, found, strict=True):
        values.append(value)  # type: ignore[arg-type]


class _Sorted(NamedTuple):
    """Columns of a topic by path, each with the rows that have it, in the order of recording."""

    times: NDArray[np.int64]
    stamps: NDArray[np.int64] | None
    has_header: bool
    columns: dict[str, tuple[NDArray[np.int64], NDArray[Any]]]
    in_nanoseconds: frozenset[str]

    def groups(self) -> Iterator[tuple[NDArray[np.int64], dict[str, NDArray[Any]]]]:
        """Yield columns that have the same rows together."""
        found: dict[bytes, tuple[NDArray[np.int64], dict[str, NDArray[Any]]]] = {}
        for path, (rows, values) in self.columns.items():
            found.setdefault(rows.tobytes(), (rows, {}))[1][path] = values
        yield from found.values()


@dataclass(frozen=True)
class _Read:
    """Messages of a topic as they were read."""

    times: array[int]
    shapes: Shapes

    def sorted(self) -> _Sorted:
        """Return the columns in the order in which messages were recorded."""
        times = np.array(self.times, dtype=np.int64)
        order = np.argsort(times, kind="stable")
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        columns: dict[str, tuple[NDArray[np.int64], NDArray[Any]]] = {
            LOG_TIME: (np.arange(len(times), dtype=np.int64), times[order])
        }
        parts: dict[str, list[tuple[NDArray[np.int64], NDArray[Any]]]] = {}
        for key, shape in self.shapes.items():
            rows = place[np.array(shape.rows, dtype=np.int64)]
            for (path, kind), read in zip(key, shape.values, strict=True):
                made: NDArray[Any] = np.array(read, dtype=KINDS.get(kind, object))
                parts.setdefault(path, []).append((rows, made))
        for path, several in parts.items():
            every = np.concatenate([rows for rows, _ in several])
            values = np.concatenate([values for _, values in several])
            inside = np.argsort(every)
            columns[path] = (every[inside], values[inside])
        stamps = None
        if STAMP in columns and len(columns[STAMP][0]) == len(times):
            own = columns[STAMP][1]
            near = np.abs(own.astype(np.float64) - times[order].astype(np.float64)) < NEAR
            stamps = own if near.all() else None
        kinds = {path for key in self.shapes for path, kind in key if kind is Stamp}
        return _Sorted(times[order], stamps, STAMP in columns, columns, frozenset(kinds))


KINDS: Final[dict[type, type]] = {Stamp: np.int64, bool: np.bool_, int: np.int64, float: np.float64}


def _decode_of(encoding: str, kind: str, text: str, *, cdr: bool) -> tuple[Decode | None, str]:
    """Return how messages of a definition are read, or why they are not."""
    if encoding not in ("ros2msg", "ros1msg"):
        return None, f"definitions of {encoding or 'no language'}"
    try:
        return Decoder(definitions(text, kind), kind, cdr=cdr), ""
    except MessageError as error:
        return None, f"{kind}: {error}"


def _mcap(stream: IO[bytes], label: str, most: int) -> Iterator[Record]:
    from mcap.records import Channel, Chunk, Schema
    from mcap.records import Message as Recorded
    from mcap.stream_reader import StreamReader, breakup_chunk

    schemas: dict[int, Any] = {}
    names: dict[int, str] = {}
    size = stream.seek(0, io.SEEK_END)
    stream.seek(0)
    for outer in StreamReader(stream, emit_chunks=True, record_size_limit=size).records:
        inner: list[Any] = [outer]
        if isinstance(outer, Chunk):
            inner = breakup_chunk(_unfolded_chunk(outer, label, most), validate_crc=True)
        for record in inner:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel) and record.id not in names:
                names[record.id] = record.topic
                yield _mcap_topic(record, schemas.get(record.schema_id))
            elif isinstance(record, Recorded):
                yield Message(names[record.channel_id], record.log_time, record.data)


def _mcap_topic(channel: Any, schema: Any) -> _Topic:
    if channel.message_encoding == "json":
        return _Topic(channel.topic, partial(json.loads, parse_int=float))
    if channel.message_encoding not in ("cdr", "ros1") or schema is None:
        return _Topic(channel.topic, None, f"messages of {channel.message_encoding or 'no kind'}")
    text = schema.data.decode("utf-8", "replace")
    cdr = channel.message_encoding == "cdr"
    decode, why = _decode_of(schema.encoding, schema.name, text, cdr=cdr)
    return _Topic(channel.topic, decode, why)


def _unfolded_chunk(chunk: Any, label: str, most: int) -> Any:
    """Return a chunk that is not packed, unfolded to no more than it says and may take."""
    require_memory(chunk.uncompressed_size, most, label)
    if not chunk.compression:
        return chunk
    wanted = chunk.uncompressed_size
    if chunk.compression == "zstd":
        import zstandard

        reader = zstandard.ZstdDecompressor().stream_reader(chunk.data)
        try:
            data = reader.read(wanted + 1)
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from error
    elif chunk.compression == "lz4":
        data = _lz4(chunk.data, wanted)
    else:
        raise ValueError(f"a chunk is packed by {chunk.compression}")
    if len(data) != wanted:
        raise ValueError("a chunk does not unfold to the size that it states")
    return replace(chunk, data=data, compression="")


def _lz4(data: bytes, wanted: int) -> bytes:
    import lz4.frame

    made: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=wanted + 1)
    return made


ROS1_MAGIC: Final = b"#ROSBAG V2.0\n"
CONNECTION, CHUNK, MESSAGE = 7, 5, 2


def _ros1(stream: IO[bytes], label: str, most: int) -> Iterator[Record]:
    if stream.read(len(ROS1_MAGIC)) != ROS1_MAGIC:
        raise ValueError("it does not begin as one")
    size = stream.seek(0, io.SEEK_END)
    stream.seek(len(ROS1_MAGIC))
    names: dict[bytes, str] = {}
    for header, data in _ros1_records(stream, size):
        inner: Iterable[tuple[dict[str, bytes], bytes]] = [(header, data)]
        if header["op"][0] == CHUNK:
            content = _ros1_chunk(header, data, label, most)
            inner = _ros1_records(io.BytesIO(content), len(content))
        for fields, content in inner:
            if fields["op"][0] == CONNECTION and fields["conn"] not in names:
                topic = _ros1_topic(fields, content)
                names[fields["conn"]] = topic.name
                yield topic
            elif fields["op"][0] == MESSAGE:
                seconds, rest = struct.unpack("<II", fields["time"])
                yield Message(names[fields["conn"]], seconds * 1_000_000_000 + rest, content)


def _ros1_records(stream: IO[bytes], size: int) -> Iterator[tuple[dict[str, bytes], bytes]]:
    while head := stream.read(4):
        header = _ros1_fields(_exactly(stream, struct.unpack("<I", head)[0], size))
        length = struct.unpack("<I", _exactly(stream, 4, size))[0]
        yield header, _exactly(stream, length, size)


def _exactly(stream: IO[bytes], length: int, size: int) -> bytes:
    data = stream.read(length) if length <= size else b""
    if len(data) != length:
        raise EOFError("it ends within a record")
    return data


def _ros1_fields(header: bytes) -> dict[str, bytes]:
    """Return the fields of a header, each of which states its length."""
    fields, at = {}, 0
    while at < len(header):
        length = struct.unpack_from("<I", header, at)[0]
        name, _, value = header[at + 4 : at + 4 + length].partition(b"=")
        fields[name.decode("utf-8", "replace")] = value
        at += 4 + length
    if not fields.get("op"):
        raise ValueError("a record does not say what it is")
    return fields


def _ros1_chunk(header: dict[str, bytes], data: bytes, label: str, most: int) -> bytes:
    wanted = struct.unpack("<I", header["size"])[0]
    require_memory(wanted, most, label)
    packed = header["compression"].decode("utf-8", "replace")
    if packed == "none":
        return data
    if packed == "bz2":
        data = bz2.BZ2Decompressor().decompress(data, max_length=wanted + 1)
    elif packed == "lz4":
        data = _lz4(data, wanted)
    else:
        raise ValueError(f"a chunk is packed by {packed}")
    if len(data) != wanted:
        raise ValueError("a chunk does not unfold to the size that it states")
    return data


def _ros1_topic(fields: dict[str, bytes], content: bytes) -> _Topic:
    topic = fields["topic"].decode("utf-8", "replace")
    said = _ros1_fields(content + b"\x04\0\0\0op=0")
    kind = said["type"].decode("utf-8", "replace")
    text = said["message_definition"].decode("utf-8", "replace")
    decode, why = _decode_of("ros1msg", kind, text, cdr=False)
    return _Topic(topic, decode, why)


def _ros2(connection: sqlite3.Connection) -> Iterator[Record]:
    """Yield what a bag of ROS 2 in SQLite holds, whose tables have to be tables."""
    connection.execute("PRAGMA trusted_schema = OFF")
    kinds = dict(connection.execute("SELECT name, type FROM sqlite_master"))
    if not all(kinds.get(name) == "table" for name in ("topics", "messages")):
        raise ValueError("it has no tables of topics and messages")
    texts: dict[str, tuple[str, str]] = {}
    if kinds.get("message_definitions") == "table":
        rows = connection.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        )
        texts = {str(kind): (str(language), str(text)) for kind, language, text in rows if text}
    names: dict[int, str] = {}
    rows = connection.execute("SELECT id, name, type, serialization_format FROM topics")
    for number, name, kind, written in rows:
        names[number] = str(name)
        if written != "cdr":
            yield _Topic(str(name), None, f"messages of {written}")
            continue
        language, text = texts.get(str(kind)) or ("ros2msg", _known_definition(str(kind)))
        decode, why = _decode_of(language, str(kind), text, cdr=True)
        yield _Topic(str(name), decode, why)
    for number, time, data in connection.execute("SELECT topic_id, timestamp, data FROM messages"):
        if number not in names or not isinstance(data, bytes) or not isinstance(time, int):
            raise ValueError("a message is of no topic, or has no time or bytes")
        yield Message(names[number], time, data)


def _known_definition(kind: str) -> str:
    """Return the definition of a common type, which bags before ROS 2 Iron do not hold."""
    from rosbags.typesys import Stores, get_typestore

    try:
        text: str = get_typestore(Stores.ROS2_HUMBLE).generate_msgdef(kind, ros_version=2)[0]
    except Exception:  # of many kinds, for a type that is not common
        return f"{kind} is not one that ROS 2 comes with"
    return text
