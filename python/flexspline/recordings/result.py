"""What `guess_map` returns: a column map with its reasons."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from flexspline.errors import listed, printable
from flexspline.files import atomic_write
from flexspline.formatting import rows_text, sentences_text, table_html
from flexspline.logs.columns import ColumnSource

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexspline.logs.log import Log

__all__ = ["Guess", "Guessed"]

HEAD = ("channel", "column", "unit", "sign", "why")


@dataclass(frozen=True)
class Guessed:
    """One channel of a guessed map.

    Parameters
    ----------
    number : of the column, from 0.
    name : of the column, "" where it has none.
    unit, sign, scale : as in `flexspline.ColumnSource`.
    reason : why, in words.
    unsure : what speaks for looking again, in words; "" where nothing does.
    """

    number: int
    name: str
    unit: str | None
    sign: int = 1
    scale: float = 1.0
    reason: str = ""
    unsure: str = ""


@dataclass(frozen=True, repr=False)
class Guess:
    """A column map as `guess_map` guesses it.

    Parameters
    ----------
    recording : path of the file.
    read, facts : sections of the map.
    channels : what each channel is made of.
    ignored : number of a column → its name, and why it is no channel.
    reasons : sentences on how the file is read.
    fact_reasons : a sentence for each fact.
    unsure : sentences on what is not of one channel alone.
    numbered : whether columns go by number: a reader does not see their names.
    max_memory : what the recording may unfold to when it is read again [GB].
    """

    recording: str
    read: Mapping[str, Any]
    facts: Mapping[str, Any]
    channels: Mapping[str, Guessed]
    ignored: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    fact_reasons: Mapping[str, str] = field(default_factory=dict)
    unsure: tuple[str, ...] = ()
    numbered: bool = False
    max_memory: float | None = None

    @property
    def columns(self) -> dict[str, ColumnSource]:
        """The map for ``read_log(recording, columns=…)``."""
        names = ["", "", *(each.name for each in self.channels.values()),
                 *(name for name, _ in self.ignored.values())]  # fmt: skip
        return {
            channel: ColumnSource(
                each.name if names.count(each.name) == 1 and not self.numbered else each.number,
                each.unit, each.sign, each.scale,
            )
            for channel, each in self.channels.items()
        }  # fmt: skip

    @property
    def doubts(self) -> dict[str, str]:
        """What is unsure, by channel."""
        return {name: each.unsure for name, each in self.channels.items() if each.unsure}

    def log(self) -> Log:
        """Read the recording with this map.

        Raises
        ------
        InputError
            Where it has neither time stamps nor a rate, or cells that are no numbers.
        """
        from flexspline.logs.read import read_log

        return read_log(
            self.recording,
            self.columns,
            facts=self.facts,
            max_memory=self.max_memory,
            **self.read,
        )

    def to_json(self) -> dict[str, Any]:
        """Return the map with its reasons and doubts, as `flexspline init --json` prints it."""
        return {
            "read": dict(self.read),
            "facts": dict(self.facts),
            "channels": {name: asdict(each) for name, each in self.channels.items()},
            "unsure": [*(f"{name}: {said}" for name, said in self.doubts.items()), *self.unsure],
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map as TOML, each entry with its reason as a comment; whole or not at all."""
        atomic_write(path, self.toml())

    def toml(self) -> str:
        """Return the map as TOML."""
        lines = [_comment(f"column map of {self.recording}, guessed; look at what is unsure"), ""]
        lines += [_comment(said) for said in self.reasons]
        lines += ["[read]", *(f"{key} = {_toml(value)}" for key, value in self.read.items()), ""]
        lines += ["[facts]"]
        for name, value in self.facts.items():
            lines += [_comment(self.fact_reasons[name]), f"{name} = {_toml(value)}"]
        lines += ["", "[columns]"]
        for channel, source in self.columns.items():
            each = self.channels[channel]
            lines += [_comment(f"UNSURE: {each.unsure}")] if each.unsure else []
            lines += [_comment(each.reason)] if each.reason else []
            lines += [f"{channel} = {_source(source)}"]
        lines += ["", *(_comment(f"unsure: {said}") for said in self.unsure)]
        lines += [
            _comment(f"no channel: column {number}{f' {name!r}' if name else ''}: {why}")
            for number, (name, why) in self.ignored.items()
        ]
        content = "\n".join(lines).rstrip("\n") + "\n"
        return content.encode(errors="replace").decode()  # halves of letters are none

    def plot(self) -> Figure:
        """Return a figure of the channels over time, as the map makes them."""
        return self.log().plot()

    def __str__(self) -> str:
        said = sentences_text(self._said(), 100)
        return "\n".join([rows_text(self._table(), left=(0, 1, 2, 4)), *said])

    def __repr__(self) -> str:
        return f"Guess({self.recording!r}, {listed(self.channels)}; unsure: {listed(self.doubts)})"

    def _repr_html_(self) -> str:
        return table_html(f"column map of {self.recording}", self._table(), self._said())

    def _table(self) -> list[tuple[str, ...]]:
        rows = [
            (
                channel + (" ?" if each.unsure else ""),
                printable(each.name) or f"column {each.number}",
                _unit(each),
                "" if each.sign == 1 else "−1",
                each.reason,
            )
            for channel, each in self.channels.items()
        ]
        return [HEAD, *rows]

    def _said(self) -> list[str]:
        facts = [f"{name} {value}: {self.fact_reasons[name]}" for name, value in self.facts.items()]
        doubts = [*(f"{name}: {said}" for name, said in self.doubts.items()), *self.unsure]
        none = [printable(name) or f"column {number}" for number, (name, _) in self.ignored.items()]
        said = [*self.reasons, *facts, *(f"Unsure (?): {doubt}" for doubt in doubts)]
        return [*said, f"No channel: {listed(none)}"] if none else said


def _unit(each: Guessed) -> str:
    if each.scale == 1.0 or not each.unit:
        return each.unit or ""
    parts = 1.0 / each.scale
    return (
        f"{each.unit} / {parts:.0f}" if parts == round(parts) else f"{each.unit} × {each.scale:g}"
    )


def _source(source: ColumnSource) -> str:
    parts = [f"source = {_toml(source.source)}"]
    parts += [f"unit = {_toml(source.unit)}"] if source.unit else []
    parts += [f"sign = {source.sign}"] if source.sign != 1 else []
    parts += [f"scale = {source.scale!r}"] if source.scale != 1.0 else []
    return "{" + ", ".join(parts) + "}"


def _toml(value: object) -> str:
    """Return a value as TOML, whose strings, numbers and lists are JSON's but for one sign."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _comment(said: str) -> str:
    return f"# {printable(said)}"
