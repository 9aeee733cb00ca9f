"""MDF 4 files (ASAM), which loggers of vehicles and test rigs write.

A channel's numbers come by the conversion that its file states: linear, rational, or a table. One
that is a formula or text would have to be computed by a program from a stranger, and is not read;
states that are called by a text stay numbers. A channel that is invalid has no number there. Units
are those of the conversion or the channel.

Before asammdf sees a file, its lists of blocks are walked: what leads back to itself, out of the
file, or unfolds to more than memory is refused.
"""

from __future__ import annotations

import io
import struct
import traceback
import weakref
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs.frames import short_facts
from flexspline.logs.one_clock import Group, GroupedChannel, grouped_table, named_apart, sound
from flexspline.logs.packed import require_memory
from flexspline.logs.table import Table

__all__ = ["read_mdf"]

KIND, LOGGER = "an MDF 4", "asammdf"
MAGIC: Final = b"MDF     "
HEAD: Final = 64  # bytes in front of the first block
COMMON: Final = struct.Struct("<4s4xQQ")  # of each block: what it is, its length, its links
FACTS: Final = ("author", "department", "project", "subject")
FRAGMENT: Final = 8 << 20  # bytes of records that asammdf holds at a time
MOST_LINKS: Final = 1 << 20

MASTERS: Final = (2, 3)  # channel types: of records, and virtual
VIRTUAL: Final = (3, 6)
FIXED: Final = 0
TIME: Final = 1  # sync type
NUMBERS: Final = range(6)  # data types: whole and floating-point numbers of both byte orders
KINDS: Final = {6: "text", 7: "text", 8: "text", 9: "text", 17: "text", 10: "bytes", 11: "bytes",
                12: "bytes", 13: "dates", 14: "dates", 15: "complex numbers",
                16: "complex numbers"}  # fmt: skip
CONVERSIONS: Final = (0, 1, 2, 4, 5, 6)  # none, linear, rational, tables of numbers
STATES: Final = (7, 8)  # a text, or another conversion, by value or range
FORMULA: Final = 3
DEEPEST: Final = 8  # conversions inside of each other
REMOTE_MASTER: Final = 8  # flag of a channel group

DEFLATE: Final = (0, 1)
LZ4: Final = (4, 5)
RATIO: Final = {**dict.fromkeys(DEFLATE, 1032), **dict.fromkeys(LZ4, 255)}
"""How much a packed block can unfold to at most, in parts of its own size."""


def read_mdf(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the channels of an MDF 4 file; `variable` is a group, all others are then left out.

    Raises
    ------
    InputError
        Where it is damaged, of another version or not finalised, or unfolds to more than `most`
        bytes; where it has no such group, or several of which none has a clock.
    """
    from asammdf import MDF

    opener: Any = MDF
    stream: IO[bytes] = file.open("rb") if isinstance(file, Path) else io.BytesIO(file.getbuffer())
    with sound(label, KIND, LOGGER), _closed_on_error(stream):
        version = _version(stream, label)
        blocks = _Blocks(stream, label, most)
        blocks.require_sound()
        stream.seek(0)
        found = opener(stream, process_bus_logging=False)
        found.configure(read_fragment_size=FRAGMENT)
        mdf = _Mdf(found, label, blocks.rules)
        weakref.finalize(mdf, stream.close)
        names = named_apart([str(group.channel_group.acq_name or "") for group in found.groups])
        groups = [mdf.group(number, name) for number, name in enumerate(names)]
        facts = short_facts({key: getattr(found.header, key, "") or None for key in FACTS})
    notes = (f"MDF {version}, {len(groups)} groups", *mdf.notes())
    return grouped_table(groups, label, variable, most, facts, notes)


@contextmanager
def _closed_on_error(stream: IO[bytes]) -> Iterator[None]:
    """Close a file that cannot be read, and let go of what asammdf had made of it.

    Else half of an object would fail to close itself, of which Python tells on standard error.
    """
    try:
        yield
    except Exception as error:
        stream.close()
        for frame, _ in traceback.walk_tb(error.__traceback__):
            made = frame.f_locals.get("self")
            if type(made).__module__.startswith("asammdf."):
                made.__dict__["_closed"] = True
        raise


def _version(stream: IO[bytes], label: str) -> str:
    """Return the version of a file that is finished, such as "4.10"."""
    head = stream.read(HEAD)
    if len(head) < HEAD or head[:8] not in (MAGIC, b"UnFinMF "):
        raise ValueError("it does not begin as one")
    version = head[8:16].decode("latin-1").strip(" \0")
    if not version.startswith("4."):
        raise InputError(
            f"{label}: is MDF {version or 'of no version'}, and MDF 4 alone is read; convert it, "
            "such as by asammdf: MDF(old).convert('4.10').save(new)"
        )
    if head[:8] != MAGIC or any(head[60:64]):
        raise InputError(
            f"{label}: was not finalised by its recorder; finalise it, such as by asammdf: "
            "MDF(old).save(new)"
        )
    return version


class _Block(NamedTuple):
    """A block: where it is, what it is, its links, and where its data and its end are."""

    at: int
    kind: bytes
    links: tuple[int, ...]
    data: int
    end: int


@dataclass
class _Blocks:
    """The lists of blocks of a file, in which each block has to be met once.

    `rules`: of which kind the conversion of a channel is, by where its block is.
    """

    stream: IO[bytes]
    label: str
    most: int
    size: int = 0
    met: set[int] = field(default_factory=set)
    rules: dict[int, int] = field(default_factory=dict)

    def require_sound(self) -> None:
        """Walk all lists: of groups, channels and data, of attachments, events and history.

        Raises
        ------
        ValueError
            Where one leads back to itself or out of the file, or data are missing.
        """
        self.size = self.stream.seek(0, io.SEEK_END)
        head = self._block(HEAD, b"##HD")
        for first in head.links[1:5]:
            for _ in self._chain(first):
                pass
        for group in self._chain(head.links[0], b"##DG"):
            promised = 0
            record = self._bytes(group.data, 1)[0]
            for channels in self._chain(group.links[1], b"##CG"):
                _, cycles, flags, _, _, wide, invalid = struct.unpack(
                    "<QQHHIII", self._bytes(channels.data, 32)
                )
                promised += 0 if flags & 1 else cycles * (record + wide + invalid)
                self._channels(channels.links[1])
            held = self._held(group.links[2])
            if promised > held:
                raise ValueError(f"a group promises {promised} bytes and has {held}")

    def _channels(self, first: int) -> None:
        for channel in self._chain(first, b"##CN"):
            inner, rule = channel.links[1], channel.links[4]
            if rule:
                self.rules[channel.at] = self._bytes(self._block(rule, b"##CC").data, 1)[0]
            if inner and self._kind(inner) == b"##CN":
                self._channels(inner)
            elif inner:
                for _ in self._chain(inner, b"##CA"):
                    pass
            if channel.links[5] and self._kind(channel.links[5]) in (b"##HL", b"##DL", b"##DZ"):
                self._held(channel.links[5], shared=True)

    def _held(self, at: int, *, shared: bool = False) -> int:
        """Bytes of data of a block or a list of blocks, each of which unfolds to what it says.

        `shared`: of channels, several of which may lead to the same.
        """
        if not at:
            return 0
        kept = set(self.met) if shared else self.met
        block = self._block(at)
        if block.kind == b"##HL":
            held = self._held(block.links[0], shared=shared)
        elif block.kind in (b"##DL", b"##LD"):
            held = 0
            for part in self._chain(at):
                for inner in part.links[1:]:
                    held += self._held(inner, shared=shared)
        elif block.kind == b"##DZ":
            held = self._unfolded(block)
        else:
            held = block.end - block.data
        self.met = kept
        return held

    def _unfolded(self, block: _Block) -> int:
        """Bytes that a packed block unfolds to; no more than it says, and than memory."""
        packed, _, unfolded, length = struct.unpack("<2xBxIQQ", self._bytes(block.data, 24))
        require_memory(unfolded, self.most, self.label)
        if length > block.end - block.data - 24:
            raise ValueError("a packed block ends within its data")
        if packed not in RATIO:
            raise InputError(
                f"{self.label}: its data are packed by another method than Deflate and LZ4, such "
                "as Zstandard, which could unfold to anything; save it with Deflate, such as by "
                "asammdf: MDF(old).save(new, compression=2)"
            )
        if RATIO[packed] * length > self.most and packed in DEFLATE:
            unfolding = zlib.decompressobj()
            unfolding.decompress(self._bytes(block.data + 24, length), unfolded + 1)
            if not unfolding.eof:
                raise ValueError("a packed block does not unfold to the size that it states")
        return int(unfolded)

    def _chain(self, at: int, kind: bytes = b"") -> Iterator[_Block]:
        """Yield the blocks of a list, each of which leads to the next by its first link."""
        while at:
            if at in self.met:
                raise ValueError("a list of blocks leads back to itself")
            self.met.add(at)
            block = self._block(at, kind)
            yield block
            at = block.links[0]

    def _kind(self, at: int) -> bytes:
        return self._bytes(at, 4)

    def _block(self, at: int, kind: bytes = b"") -> _Block:
        found, length, count = COMMON.unpack(self._bytes(at, COMMON.size))
        if not found.startswith(b"##") or (kind and found != kind):
            raise ValueError(f"byte {at} should begin a block {kind.decode() or '##'}")
        if length < COMMON.size + 8 * count or count > MOST_LINKS or at + length > self.size:
            raise ValueError(f"the block at byte {at} ends outside the file")
        links = struct.unpack(f"<{count}Q", self._bytes(at + COMMON.size, 8 * count))
        return _Block(at, found, links or (0,), at + COMMON.size + 8 * count, at + length)

    def _bytes(self, at: int, count: int) -> bytes:
        self.stream.seek(min(at, self.size))
        data = self.stream.read(count)
        if len(data) != count:
            raise EOFError("it was cut short")
        return data


class _Mdf:
    """A file that asammdf has opened: columns are read when they are asked for."""

    def __init__(self, found: Any, label: str, rules: Mapping[int, int]) -> None:
        self._found = found
        self._label = label
        self._rules = rules
        self._states: list[str] = []

    def notes(self) -> tuple[str, ...]:
        """What to know of the numbers."""
        return (f"states as numbers: {', '.join(self._states[:20])}",) if self._states else ()

    def group(self, number: int, name: str) -> Group:
        """Return the channels of a group, and its clock."""
        group = self._found.groups[number]
        clock = self._clock(number)
        channels = []
        for place, channel in enumerate(group.channels):
            read = partial(self.column, number, place)
            why = self._why_not(group, place)
            if not why and getattr(channel.conversion, "conversion_type", 0) in STATES:
                self._states.append(channel.name)
            channels.append(GroupedChannel(str(channel.name), read, _unit(channel), why))
        read_clock = partial(self.clock, *clock) if clock is not None else None
        return Group(name, int(group.channel_group.cycles_nr), tuple(channels), read_clock)

    def _clock(self, number: int) -> tuple[int, int] | None:
        """Return where the time of a group stands, if it has one that can be read."""
        group = self._found.groups[number]
        if group.channel_group.flags & REMOTE_MASTER:
            number = group.channel_group.cg_master_index
            group = self._found.groups[number]
        place = self._found.masters_db.get(number)
        if place is None or group.channels[place].channel_type not in MASTERS:
            return None
        readable = group.channels[place].sync_type == TIME and not self._why_not(group, place)
        return (number, place) if readable else None

    def _why_not(self, group: Any, place: int) -> str:
        """Return why a channel cannot be read, and what to do; nothing where it can.

        Of the conversion the file has the word: of one that asammdf cannot read it makes none.
        """
        channel = group.channels[place]
        kind = self._rules.get(channel.address, 0)
        lost = kind and channel.conversion is None
        return (
            _why_no_numbers(group, place)
            or _why_not_by_rule(kind)
            or (f"its conversion is damaged; {REMEDY}" if lost else "")
            or _why_not_converted(channel.conversion)
        )

    def clock(self, number: int, place: int, *rows: int) -> NDArray[np.float64]:
        """Read a clock as a channel; in seconds, whole ones too."""
        return np.asarray(self.column(number, place, *rows), dtype=np.float64)

    def column(
        self, number: int, place: int, first: int = 0, last: int | None = None
    ) -> NDArray[Any]:
        """Read samples [first, last) of a channel, converted as it says; NaN where invalid."""
        channel = self._found.groups[number].channels[place]
        with sound(f"{self._label}: channel '{channel.name}'", KIND, LOGGER):
            values, invalid = self._found.get(
                group=number,
                index=place,
                raw=True,
                samples_only=True,
                ignore_invalidation_bits=True,
                record_offset=first,
                record_count=None if last is None else last - first,
            )
            if channel.conversion is not None:
                values = channel.conversion.convert(values, ignore_value2text_conversions=True)
            made: NDArray[Any] = np.asarray(values)
            if made.ndim != 1 or made.dtype.kind not in "biuf":
                raise ValueError(f"its conversion makes {made.dtype}, and no numbers")
            if invalid is not None and np.any(invalid):
                made = made.astype(np.float64)
                made[np.asarray(invalid, dtype=bool)] = np.nan
        return made


def _unit(channel: Any) -> str | None:
    stated = getattr(channel.conversion, "unit", "") or channel.unit
    return str(stated) if stated else None


def _why_no_numbers(group: Any, place: int) -> str:
    """Return why a channel holds no numbers, and what to do; nothing where it does."""
    channel = group.channels[place]
    if channel.component_addr or group.channel_dependencies[place]:
        return "it is an array or a structure; save its parts as channels"
    if channel.data_type not in NUMBERS:
        return f"it holds {KINDS.get(channel.data_type, 'data of no known kind')}; save numbers"
    if channel.channel_type not in (FIXED, *MASTERS, *VIRTUAL):
        return "its samples are of no fixed length; save numbers"
    bits = 8 * channel.byte_offset + channel.bit_offset + channel.bit_count
    if channel.channel_type not in VIRTUAL and (
        bits > 8 * group.channel_group.samples_byte_nr or not 0 < channel.bit_count <= 64
    ):
        return "it lies outside its records; record the file again"
    return ""


REMEDY: Final = "save the file with the conversion applied, or record the raw numbers"


def _why_not_by_rule(kind: int) -> str:
    """Return why a conversion of a kind is not computed."""
    if kind == FORMULA:
        return (
            "it is converted by a formula, which is text that would have to be run as a program; "
            + REMEDY
        )
    if kind not in (*CONVERSIONS, *STATES):
        return f"it is converted by a rule of kind {kind}, which does not make numbers; {REMEDY}"
    return ""


def _why_not_converted(conversion: Any, depth: int = 0) -> str:
    """Return why a conversion, or one that it leads to, is not computed."""
    if conversion is None or isinstance(conversion, bytes):
        return ""
    why = _why_not_by_rule(conversion.conversion_type)
    if why or conversion.conversion_type not in STATES:
        return why
    if depth > DEEPEST:
        return f"its conversion leads to others without end; {REMEDY}"
    inner = (conversion.referenced_blocks or {}).values()
    return next(filter(None, (_why_not_converted(each, depth + 1) for each in inner)), "")
