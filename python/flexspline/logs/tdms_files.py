"""TDMS files of LabVIEW and DIAdem.

A channel's clock are its waveform properties (start, offset and increment), or a channel of its
group that is called time or holds time stamps. Units are the property ``unit_string``. Scaling is
the file's own: polynomials, tables and formulas of thermometers that npTDMS knows, no programs.
The index beside a file, which its recorder writes, is not looked at.
"""

from __future__ import annotations

import io
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.frames import short_facts
from flexspline.logs.one_clock import Group, GroupedChannel, grouped_table, sound
from flexspline.logs.packed import require_memory
from flexspline.logs.table import Table

__all__ = ["read_tdms"]

KIND: Final = "a TDMS"
UNITS: Final = ("unit_string", "NI_UnitDescription", "unit")
CLOCKS: Final = ("time", "t", "timestamp", "zeit", "temps", "tiempo")
"""Names of channels, in small letters, that are the clock of their group."""
SCALES: Final = frozenset(
    ("Linear", "Polynomial", "Table", "RTD", "Strain", "Thermistor", "Thermocouple", "Add",
     "Subtract", "AdvancedAPI")
)  # fmt: skip
"""Conversions that npTDMS knows; of others it returns the raw numbers."""
UNSET: Final = np.datetime64("1904-01-01T00:00:00", "us")  # LabVIEW's zero
NUMBER: Final = 8  # bytes

Read = Callable[..., NDArray[Any]]


def read_tdms(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the channels of a TDMS file; `variable` is a group, all others are then left out.

    Raises
    ------
    InputError
        Where it is damaged, a channel takes more than `most` bytes, or it has no such group, or
        several of which none has a clock.
    """
    import nptdms

    with sound(label, KIND, nptdms.__name__):
        tdms = _Tdms(file, label)
        with tdms.opened() as found:
            begun = [_begun(channel) for group in found.groups() for channel in group.channels()]
            first = min((each for each in begun if each is not None), default=None)
            groups = [tdms.group(group, first) for group in found.groups()]
            facts = short_facts({str(k): v for k, v in found.properties.items() if k != "name"})
            incomplete = found.file_status.incomplete_final_segment
            every = [len(channel) for group in found.groups() for channel in group.channels()]
    require_memory(NUMBER * max(every, default=0), most, label)
    notes = [f"TDMS, {len(groups)} groups"]
    notes += ["its end is missing: recording stopped within a segment"] if incomplete else []
    parts = [part for group in groups for part in group]
    return grouped_table(parts, label, variable, most, facts, tuple(notes))


@dataclass(frozen=True)
class _Tdms:
    """A file that is opened for each reading: columns are read when they are asked for."""

    file: Path | io.BytesIO
    label: str

    @contextmanager
    def opened(self) -> Iterator[Any]:
        """Open it as a stream: by its path npTDMS would read the index that lies beside it."""
        from nptdms import TdmsFile

        if isinstance(self.file, io.BytesIO):
            self.file.seek(0)
            yield TdmsFile.open(self.file)
            return
        with self.file.open("rb") as stream:
            yield TdmsFile.open(stream)

    def group(self, group: Any, first: np.datetime64 | None) -> list[Group]:
        """Return the channels of a group by their clock: usually one group.

        `first`: when the first waveform of the file begins.
        """
        channels = [channel for channel in group.channels() if len(channel)]
        clock = next((each for each in channels if _is_clock(each)), None)
        by_clock: dict[Any, list[Any]] = defaultdict(list)
        for channel in channels:
            by_clock[_waveform(channel, first) or ("rows", len(channel))].append(channel)
        made = []
        for number, (key, several) in enumerate(by_clock.items()):
            rows = len(several[0])
            read: Read | None = None
            if key[0] != "rows":
                read = partial(_instants, *key[1:])
            elif clock is not None and len(clock) == rows:
                read = partial(self.clock, group.name, clock.name)
            name = group.name if not number else f"{group.name} ({number + 1})"
            each = tuple(self._channel(group, channel) for channel in several)
            made.append(Group(name, rows, each, read, group.name))
        return made

    def _channel(self, group: Any, channel: Any) -> GroupedChannel:
        stated = (channel.properties.get(key) for key in UNITS)
        unit = next((str(text) for text in stated if text), None)
        read = partial(self.column, group.name, channel.name)
        unknown = _unknown_scale([channel.properties, group.properties])
        why = (
            f"it is converted by the rule '{unknown}', which is not known; save it with its "
            "conversion applied"
            if unknown
            else ""
        )
        return GroupedChannel(channel.name, read, unit, why)

    def column(
        self, group: str, name: str, first: int = 0, last: int | None = None
    ) -> NDArray[Any]:
        """Read samples [first, last) of a channel."""
        with sound(f"{self.label}: channel '{name}'", KIND, "nptdms"), self.opened() as found:
            return np.asarray(found[group][name][first:last])

    def clock(
        self, group: str, name: str, first: int = 0, last: int | None = None
    ) -> NDArray[np.float64]:
        """Read a clock as a channel [s]; from its first stamp where it is a date."""
        values = self.column(group, name, first, last)
        if values.dtype.kind == "M":
            begun = values[:1] if first == 0 else self.column(group, name, 0, 1)
            values = (values - begun) / np.timedelta64(1, "s")
        return np.asarray(values, dtype=np.float64)


def _is_clock(channel: Any) -> bool:
    return channel.name.strip().lower() in CLOCKS or channel.dtype.kind == "M"


def _waveform(channel: Any, first: np.datetime64 | None) -> tuple[str, float, float, int] | None:
    """Return when a waveform begins, what its samples are apart [s], and how many they are."""
    step = channel.properties.get("wf_increment")
    if not isinstance(step, (int, float)) or not (np.isfinite(step) and step > 0.0):
        return None
    if channel.properties.get("wf_xunit_string") not in (None, "", "s"):  # a spectrum
        return None
    begun = _begun(channel)
    start = 0.0 if begun is None else float((begun - first) / np.timedelta64(1, "s"))
    start += float(channel.properties.get("wf_start_offset", 0.0))
    return ("waveform", start, float(step), len(channel))


def _begun(channel: Any) -> np.datetime64 | None:
    """Return the date at which a waveform begins, if it states one."""
    begun = channel.properties.get("wf_start_time")
    stamp = None if begun is None else np.datetime64(begun, "us")
    return None if stamp is None or stamp == UNSET else stamp


def _instants(
    start: float, step: float, rows: int, first: int = 0, last: int | None = None
) -> NDArray[np.float64]:
    return np.asarray(
        start + step * np.arange(first, rows if last is None else last), dtype=np.float64
    )


def _unknown_scale(properties: list[Mapping[str, Any]]) -> str:
    """Return the conversion of a channel that is not known, if any."""
    for said in properties:
        if said.get("NI_Scaling_Status", "unscaled") == "scaled":
            return ""
        for key, value in said.items():
            if key.startswith("NI_Scale[") and key.endswith("_Scale_Type") and value not in SCALES:
                return str(value)
    return ""
