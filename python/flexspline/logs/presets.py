"""Presets: column maps of recorders that everybody has, as data with sources for all they say.

Each is a file ``presets/NAME.toml``, in which::

    recorder = "what writes such files"
    joints = "what joints are called"

    [[source]]                       # of names, units and signs
    title = "…"
    url = "…"
    says = "…"

    [columns]                        # of a column map; of several sources the first that is there
    output_position = {source = ["q_{joint}", "position[{joint}]"], unit = "rad"}
    motor_current = {source = "current_{joint}", unit = "A"}

    [ask.motor_current]              # what no source says of a channel, by key of a column, and why
    sign = "…"

    [unknown]                        # facts that no source says
    gear_ratio = "…"

A file need not have all columns of a preset. What no source says is not guessed: such a channel is
read once a map answers, ``motor_current = {sign = -1}``, which is laid over the preset's own entry.
A unit that the file itself states is right where the preset says another.
"""

from __future__ import annotations

import functools
import importlib.resources
import sys
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.columns import ColumnSpec
from flexspline.logs.splitting import (
    columns_of_joint,
    has_places,
    joints_among,
    joints_in,
    placed_joint,
)
from flexspline.logs.table import Table
from flexspline.logs.units import COUNTS, states_no_unit, without_remark

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["OPEN", "Preset", "preset_names", "preset_of", "presets_text"]

OPEN: Final = "not known: "
"""How the sentence of a log's history begins that says what a preset leaves open: then comes the
name of the channel or fact, and a colon."""
WIDTH: Final = 98  # of a line of the list of all presets
EXAMPLES: Final = {"sign": "1", "scale": "1.0", "unit": '"A"'}
"""What an answer may look like, by key of a column."""

Columns = Mapping[str, ColumnSpec]


@dataclass(frozen=True)
class Source:
    """Where something is said: `title` and `url` of a page or file, and what it `says`."""

    title: str
    url: str
    says: str


@dataclass(frozen=True)
class Preset:
    """A column map of a recorder.

    Parameters
    ----------
    name : such as "ur-rtde".
    recorder : what writes such files.
    joints : what its joints are called.
    sources : of names, units and signs.
    columns : channel to an entry of a column map, whose source may be several.
    ask : by channel, keys of its entry that no source says, each with why.
    unknown : facts that no source says, each with why.
    """

    name: str
    recorder: str
    joints: str
    sources: tuple[Source, ...]
    columns: Mapping[str, Mapping[str, Any]]
    ask: Mapping[str, Mapping[str, str]]
    unknown: Mapping[str, str]

    def joined(
        self, columns: Columns | None, joint: str | None, table: Table
    ) -> tuple[dict[str, ColumnSpec], tuple[str, ...]]:
        """Return the map of a file, and sentences: what it is by, and what is left open.

        Parameters
        ----------
        columns : of the user, which win; an entry without a source is laid over the preset's.
        joint : which one, where the file has several.
        table : the file's.

        Raises
        ------
        InputError
            Where the file has no column of the preset, or not of that joint, or those of several
            joints and none is asked for.
        """
        own = {name: spec for name, spec in (columns or {}).items()
               if name not in self.columns or not _is_answer(spec)}  # fmt: skip
        answers: dict[str, Mapping[str, Any]] = {
            name: spec for name, spec in (columns or {}).items()
            if name not in own and isinstance(spec, Mapping)
        }  # fmt: skip
        of_joint = has_places(own)
        if of_joint and joint is not None:
            own = columns_of_joint(own, joint, table.label)
        made: dict[str, ColumnSpec] = {}
        said: list[str] = []
        for channel, entry in self.columns.items():
            if channel in own:
                continue
            answer = answers.get(channel)
            sources = _placed(entry, joint, table.label)
            source = next((each for each in sources if each in _names(table)), None)
            if source is None and answer is None:
                continue
            of_joint |= source is not None and source not in _sources(entry)
            lacking = [key for key in self.ask.get(channel, {}) if key not in (answer or {})]
            if lacking:
                said.append(self._question(channel, lacking, source or sources[0]))
            else:
                as_stated = _as_stated(entry, source, table)
                made[channel] = {**as_stated, **(answer or {}), "source": source or sources[0]}
        self._require_columns({**made, **own}, said, table)
        self._require_joint(joint, of_joint, table)
        return {**made, **own}, (self._named(), *said)

    def open_facts(self, known: Mapping[str, Any]) -> Iterator[str]:
        """Yield a sentence for each fact that neither the sources nor anybody else says."""
        for fact, why in self.unknown.items():
            if fact not in known:
                option = fact.replace("_", "-")
                yield f"{OPEN}{fact}: {why}; give --{option} or {fact}= where a command asks for it"

    def joints_of(self, columns: Columns | None, table: Table) -> tuple[str, ...]:
        """Return the joints of which a file has every column that it has of one of them.

        Raises
        ------
        InputError
            Where it has columns of none.
        """
        own = {name: spec for name, spec in (columns or {}).items() if not _is_answer(spec)}
        sources = [text for channel, entry in self.columns.items() if channel not in own
                   for text in _sources(entry) if has_places({channel: text})]  # fmt: skip
        there = [text for text in sources if joints_in(_names(table), text)] or sources
        named = {str(number): text for number, text in enumerate(there)}
        return joints_among(_names(table), {**named, **own}, table.label)

    def _require_columns(self, made: Columns, said: list[str], table: Table) -> None:
        every = [text for entry in self.columns.values() for text in _sources(entry)]
        joints = [text for text in every if joints_in(_names(table), text)]
        if not (made.keys() - {"time"} or said or joints):
            raise InputError(
                f"{table.label}: has no column of the preset {self.name}, such as "
                f"{listed(every, 4)}; it has {listed(table.names or ['columns without names'])}"
            )

    def _require_joint(self, joint: str | None, found: bool, table: Table) -> None:
        """Refuse that no joint is asked for where columns are of several, and one that is not."""
        texts = [text for entry in self.columns.values() for text in _sources(entry)]
        several = [text for text in texts if joints_in(_names(table), text)]
        if several and not found:
            there = listed(self.joints_of(None, table))
            why = (
                f"has no joint {joint}" if joint else "has columns by joint, and none is asked for"
            )
            raise InputError(
                f"{table.label}: {why}; give --joint NAME, or joint= of read_log, one of {there} "
                f"(by the preset {self.name}: {self.joints})"
            )
        if joint and not found:
            raise InputError(
                f"{table.label}: joint {joint} is asked for, and the file has columns of one joint "
                f"alone by the preset {self.name}; leave it out"
            )

    def _named(self) -> str:
        pages = listed(f"{each.title} <{each.url}>" for each in self.sources)
        return f"columns by the preset {self.name}: {self.recorder}; sources: {pages}"

    def _question(self, channel: str, keys: list[str], source: str) -> str:
        why = "; ".join(f"{key}: {self.ask[channel][key]}" for key in keys)
        answer = ", ".join(f"{key} = {EXAMPLES[key]}" for key in keys)
        return (
            f"{OPEN}{channel}: column '{source}' is not read ({why}); say it in the map, such as "
            f"{channel} = {{{answer}}}"
        )


def _is_answer(spec: ColumnSpec | None) -> bool:
    """Whether an entry of a map says something of a preset's and is none by itself."""
    return isinstance(spec, Mapping) and "source" not in spec


def _names(table: Table) -> tuple[str, ...]:
    return table.names or ()


def _sources(entry: Mapping[str, Any]) -> tuple[str, ...]:
    source = entry["source"]
    return (source,) if isinstance(source, str) else tuple(source)


def _placed(entry: Mapping[str, Any], joint: str | None, label: str) -> list[str]:
    """Return the sources of an entry, those with a place with the joint in it, if one is given."""
    if joint is None:
        return list(_sources(entry))
    return [str(placed_joint(text, joint, label)) for text in _sources(entry)]


def _as_stated(entry: Mapping[str, Any], source: str | None, table: Table) -> dict[str, Any]:
    """Return an entry without a unit and a scale where the file itself states a unit."""
    stated = table.units[_names(table).index(source)] if table.units and source else None
    if stated is None or states_no_unit(stated) or without_remark(stated).lower() in COUNTS:
        return dict(entry)
    return {key: value for key, value in entry.items() if key not in ("unit", "scale", "bits")}


@functools.cache
def preset_names() -> tuple[str, ...]:
    """Return the names of all presets."""
    files = importlib.resources.files("flexspline") / "presets"
    return tuple(sorted(file.name.removesuffix(".toml") for file in files.iterdir()
                        if file.name.endswith(".toml")))  # fmt: skip


@functools.cache
def preset_of(name: str) -> Preset:
    """Return a preset by its name.

    Raises
    ------
    InputError
        Where there is none of that name.
    """
    if name not in preset_names():
        raise InputError(
            f"there is no preset '{name}'{did_you_mean(name, preset_names())}; the presets are "
            f"{listed(preset_names())}"
        )
    file = importlib.resources.files("flexspline") / "presets" / f"{name}.toml"
    said = tomllib.loads(file.read_text(encoding="utf-8"))
    return Preset(
        name,
        said["recorder"],
        said["joints"],
        tuple(Source(**each) for each in said["source"]),
        said["columns"],
        said.get("ask", {}),
        said.get("unknown", {}),
    )


def presets_text() -> str:
    """Return what each preset reads, by which sources, and what it leaves to be said."""
    made = ("\n".join(_wrapped(preset_of(name))) for name in preset_names())
    return "\n\n".join(made)


def _wrapped(preset: Preset) -> Iterator[str]:
    for line in _lines(preset):
        yield textwrap.fill(
            line, WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
        )


def _lines(preset: Preset) -> Iterator[str]:
    yield preset.name
    yield f"  {preset.recorder}"
    yield f"  joints: {preset.joints}"
    for channel, entry in preset.columns.items():
        how = {key: value for key, value in entry.items() if key != "source"}
        how |= dict.fromkeys(preset.ask.get(channel, {}), "?")
        made = ", ".join(f"{key} {value}" for key, value in how.items())
        yield f"  {channel}: {' or '.join(_sources(entry))}{f' ({made})' if made else ''}"
    for channel, asked in preset.ask.items():
        for key, why in asked.items():
            yield f"  to be said: {key} of {channel}: {why}"
    for fact, why in preset.unknown.items():
        yield f"  to be said: {fact}: {why}"
    for source in preset.sources:
        yield f"  source: {source.title} <{source.url}>: {source.says}"
