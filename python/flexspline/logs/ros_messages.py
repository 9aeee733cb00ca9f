"""Messages of ROS 1 and ROS 2: their definitions, and the numbers in their bytes.

A definition comes with the file, from a stranger. It is read as a list of fields and walked; no
code is made of it, as the decoders of common libraries do. Numbers are called by the path of their
field: ``wrench.force.x``. A list of numbers that is as long as the list of names beside it, as in
``sensor_msgs/JointState``, is called by these: ``position[elbow]``; any other by number. Stamps are
whole nanoseconds.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

__all__ = ["STAMP", "Decoder", "Field", "MessageError", "Stamp", "definitions", "flattened"]

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
    for field in known[kind]:
        plain = field.type in PRIMITIVES or field.type in STAMPS or "string" in field.type
        total += 1 if plain else 1 + _count_fields(known, field.type, (*above, kind))
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
