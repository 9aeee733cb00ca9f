"""The result of `track`: each parameter over calendar time, what changed, and what comes when.

Every sentence is made of the numbers beside it. A change is told where it exceeds its threshold and
its size is told from zero; a date is given only where a change that is told leads there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from flexspline.about import __version__
from flexspline.effects import CATALOGUE
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.formatting import plus_minus, short, short_names
from flexspline.lazy import Rendered, render
from flexspline.model import no_drive_has
from flexspline.schema import checked_json
from flexspline.tracking.attribution import SCALE, OtherRange, Turned
from flexspline.tracking.changes import (
    ACCELERATING,
    LEAST_SESSIONS,
    RAMP,
    RUNNING_AWAY,
    SETTLING,
    STEP,
)

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from flexspline.tracking.history import History

__all__ = [
    "Band",
    "Change",
    "Forecast",
    "Track",
    "TrackedParameter",
    "day",
    "days_of",
    "in_unit",
    "spoken",
]

Array = NDArray[np.float64]
Interval = tuple[datetime, datetime]

MOST_RELATIVE = 3.0  # times the level before; beyond, that level was hardly there

DIFFERENT = 2.0  # standard errors by which a level is another than at first
AS_UPPER = (
    " It is taken for a lower limit, for the level at first lies above it; an upper one would be "
    "exceeded already."
)
WHOLE = (
    ": friction and what it carries changed by one share, which what the torque is measured with "
    "explains, such as the torque constant or the current sensor."
)
RISES, FALLS, TURNS = ("rises", "rose"), ("falls", "fell"), ("turns", "turned")
TURNED = (
    ", and its amplitude stayed: no mass changed, but the zero of the encoder moved, or the axis "
    "was mounted otherwise."
)
OTHERWISE = "At the same time the sessions ran differently ({}): "
LIKELIER = "a form that the model lacks is likelier than a change of the joint."
EITHER = "that may be why it seems to change, or what comes of it."
UNLIKELY = 0.1  # chance of a step below which a change is said to be gradual

FORMAT = "flexspline-track"
VERSION = 1
NOT_KNOWN, NO_CHANGE, CHANGED, DISPUTED = (
    "not known yet", "no change told", "changed", "may have changed"
)  # fmt: skip
"""States of a parameter; the last: it is one of those that share a change."""


@dataclass(frozen=True, eq=False)
class Band:
    """The level of a parameter at the reference temperature: median and 95 % on some days, (D,)."""

    dates: NDArray[np.datetime64]
    middle: Array
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class TrackedParameter:
    """One parameter over calendar time; numbers in `unit`.

    Parameters
    ----------
    name, unit : "effect.term"; of an order amplitude and quadrature, see `History`.
    state : "not known yet", "no change told", "changed" or "may have changed".
    sessions : that tell it.
    at_first, now : level at the reference temperature, with its standard error: median, and half of
        the 68 % interval.
    by_temperature : per K at the reference temperature, with its error; NaN where that is not
        accounted for.
    between_sessions : standard deviation from session to session once all else is taken out.
    measured_error : typical standard error of a session.
    least : a lasting step in the middle of these sessions is told from about this size on.
    values : (S,) as measured, NaN where a session does not tell it; `corrected`: what they would be
        at the reference temperature.
    band : of its level.
    negative : what it is below zero that no drive has, friction or inertia, or "".
    """

    name: str
    unit: str
    state: str
    sessions: int
    at_first: tuple[float, float]
    now: tuple[float, float]
    by_temperature: tuple[float, float]
    between_sessions: float
    measured_error: float
    least: float
    values: Array
    corrected: Array
    band: Band
    negative: str = ""

    @property
    def differs(self) -> bool:
        """Whether it is now another than at first: what a repair has undone is none."""
        error = float(np.hypot(self.at_first[1], self.now[1]))
        return abs(self.now[0] - self.at_first[0]) > DIFFERENT * error

    @property
    def sentence(self) -> str:
        """What became of it."""
        name, now = spoken(self.name), in_unit(plus_minus(*self.now), self.unit)
        if self.state == NOT_KNOWN:
            return f"{name}: not known yet; {now} so far."
        if self.state == NO_CHANGE:
            least = in_unit(short(self.least, 2), self.unit)
            return f"{name}: no change told, {now}; a lasting step is told from about {least} on."
        first = in_unit(plus_minus(*self.at_first), self.unit)
        return f"{name}: {self.state}, {first} at first, now {now}."


@dataclass(frozen=True)
class Change:
    """A change that is told.

    Parameters
    ----------
    causes : effects, or orders of one, that it may be; one where it is known which.
    chances : of them.
    parameter, unit : which shows it best, of the first cause.
    kind : "step", "ramp", "settling", "accelerating" or "running away"; None where that is not
        known yet.
    at_once : chance that it is a step.
    date, between : of the onset: median, and 95 %.
    size, error : what it has made by the last session; `interval`: 95 %.
    relative : of the level before, NaN where that is not told from zero. Where the cause is the
        scale of the torque, the share by which all parameters changed.
    per_year : how fast it goes on at the last session; 0 of a step.
    told_since : the session at which it could first be told.
    evidence, needed : ln B and what it must exceed.
    turned : by how much gravity turned, where that is all that it did.
    ranges : channels whose ranges changed at the same sessions, and may be the cause.
    negative : whether its level is now below zero, which no drive has.
    misled : whether ranges are the likelier cause: a level that changed with them is `negative`.
    """

    causes: tuple[str, ...]
    chances: tuple[float, ...]
    parameter: str
    unit: str
    kind: str | None
    at_once: float
    date: datetime
    between: Interval
    size: float
    error: float
    interval: tuple[float, float]
    relative: float
    per_year: float
    told_since: datetime
    evidence: float
    needed: float
    turned: Turned | None = None
    ranges: tuple[OtherRange, ...] = ()
    negative: bool = False
    misled: bool = False

    @property
    def known(self) -> bool:
        """Whether it is known which cause it is."""
        return len(self.causes) == 1

    @property
    def scaled(self) -> bool:
        """Whether all parameters changed by one share, `relative`."""
        return SCALE in self.causes

    @property
    def sentence(self) -> str:
        """What changed, since when and by how much, and what explains it rather."""
        if not self.ranges:
            return self._changed
        ran = listed(f"{each.channel} from {each.new}, before {each.old}" for each in self.ranges)
        return f"{self._changed} {OTHERWISE.format(ran)}{LIKELIER if self.misled else EITHER}"

    @property
    def _changed(self) -> str:
        """What changed, since when and by how much."""
        if self.scaled:
            way = RISES if self.relative > 0.0 else FALLS
            return f"{self._what('The torque as a whole', self._share, way)}{WHOLE}"
        name = spoken(self.parameter)
        if self.turned is not None:
            angle = f"{plus_minus(self.turned.degrees, self.turned.error)}°"
            name = f"The direction of {name.partition('.')[0]}"
            return f"{self._what(name, angle, TURNS)}{TURNED}"
        size = in_unit(plus_minus(abs(self.size), self.error), self.unit)
        if abs(self.relative) <= MOST_RELATIVE:
            size += f" ({_percent(self.relative, '+')})"
        what = self._what(name, size, RISES if self.size > 0.0 else FALLS)
        if self.known:
            return f"{what}."
        others = listed(
            f"{c} {p:.0%}".replace("%", " %")
            for c, p in zip(self.causes, self.chances, strict=True)
        )
        return f"One of these changed, I do not know which ({others}). If it is the first: {what}."

    @property
    def _share(self) -> str:
        """By which share all parameters changed."""
        error = abs(self.relative * self.error / self.size)
        return f"{plus_minus(100.0 * abs(self.relative), 100.0 * error)} %"

    def _what(self, name: str, size: str, way: tuple[str, str]) -> str:
        """What a name did, since when and by how much."""
        first, last = (day(each) for each in self.between)
        about = f"{day(self.date)}" + (f" ({first} to {last})" if first != last else "")
        does, did = way
        faster = f"{name} {does} ever faster since {about}, by {size} so far"
        return {
            STEP: f"{name} {did} at once by {size} about {about}",
            RAMP: f"{name} {does} since {about}, by {size} so far",
            ACCELERATING: faster,
            RUNNING_AWAY: faster,
            SETTLING: f"{name} {did} since {about} by {size} and settles",
        }.get(self.kind or "", f"{name} {did} by {size} since {about}; {self._open}")

    @property
    def _open(self) -> str:
        """What is not known of its kind."""
        if self.at_once < UNLIKELY:
            return "gradually, and how it goes on is not known yet"
        return "whether at once or gradually is not known yet"

    @property
    def needs(self) -> str:
        """What the joint needs."""
        if not self.ranges:
            return self._look
        ran = listed(f"{each.channel} from {each.old}" for each in self.ranges)
        again = f"sessions that run as before ({ran}) to tell whether it changed at all"
        return again if self.misled or not self._look else f"{self._look}, and {again}"

    @property
    def _look(self) -> str:
        """What it needs if all sessions ran alike."""
        if self.negative:
            return f"another model, for its {spoken(self.parameter)} is none that a drive has"
        if self.scaled:
            return "a look at its torque constant and current sensor"
        if self.turned is not None:
            return "a look at the zero of its encoder and at how its axis is mounted"
        return needed_by(self.parameter.partition(".")[0]) if self.known else ""


@dataclass(frozen=True)
class Forecast:
    """When a parameter reaches a limit, at the reference temperature.

    Parameters
    ----------
    parameter, unit, limit : which, and what it must not pass.
    now : level after the last session, with its standard error.
    chance : that it is reached within `horizon` years of the last session.
    date : median; None where it is not told that it will be reached.
    within_80, within_95 : intervals; None as an end: not within the horizon, perhaps never.
    horizon : years.
    why_none : why there is no date, or "".
    lower : whether it must not fall below the limit: the level at first lies above it.
    """

    parameter: str
    unit: str
    limit: float
    now: tuple[float, float]
    chance: float
    date: datetime | None
    within_80: tuple[datetime | None, datetime | None]
    within_95: tuple[datetime | None, datetime | None]
    horizon: float
    why_none: str = ""
    lower: bool = False

    @property
    def sentence(self) -> str:
        """When, or why no date is given."""
        name = spoken(self.parameter)
        limit = f"limit of {in_unit(short(self.limit, 4), self.unit)}"
        limit = f"lower {limit}" if self.lower else limit
        now = f"now {in_unit(plus_minus(*self.now), self.unit)}"
        if self.why_none:
            said = f"{name} and its {limit}, {now}: {self.why_none}."
            return said + (AS_UPPER if self.lower and self.now[0] > self.limit else "")
        first, last = self.within_95
        assert first is not None
        if last is None:
            when = "may reach" if self.date is None else "reaches"
            about = "" if self.date is None else f" about {day(self.date)},"
            return (
                f"{name} {when} its {limit}{about} not before {day(first)} (97.5 %), "
                f"within {self.horizon:g} years with a probability of {_percent(self.chance)}; "
                f"{now}."
            )
        assert self.date is not None
        early, late = self.within_80
        inner = "" if early is None or late is None else f"80 % {day(early)} to {day(late)}, "
        return (
            f"{name} reaches its {limit} about {day(self.date)} ({inner}95 % {day(first)} "
            f"to {day(last)}); {now}."
        )


@dataclass(frozen=True, eq=False, repr=False)
class Track(Rendered):
    """One joint over months.

    Parameters
    ----------
    history : the sessions, with amplitude and quadrature of orders.
    parameters : each over time.
    changes : those that are told, by date.
    forecasts : one of each limit.
    reference : °C at which levels are told; NaN where temperature is not accounted for.
    remarks : what was left out, and what limits all this.
    """

    _kind: ClassVar = "track"

    history: History
    parameters: tuple[TrackedParameter, ...]
    changes: tuple[Change, ...]
    forecasts: tuple[Forecast, ...]
    reference: float
    remarks: tuple[str, ...] = field(default=())

    def __getitem__(self, name: str) -> TrackedParameter:
        """Return a parameter by "effect.term", or by its effect where that has one."""
        for parameter in self.parameters:
            if name in (parameter.name, short_names(parameter.name)):
                return parameter
        near = [p for p in self.parameters if p.name.partition(".")[0] == name]
        if len(near) == 1:
            return near[0]
        names = [p.name for p in self.parameters]
        raise InputError(
            f"the track has no one parameter '{name}'{did_you_mean(name, names)}; it has "
            f"{listed(names)}"
        )

    @property
    def known(self) -> bool:
        """Whether there are sessions enough to tell any change."""
        return any(p.state != NOT_KNOWN for p in self.parameters)

    @property
    def verdict(self) -> str:
        """What there is to decide, in a sentence or two."""
        joint = self.history.joint or "The joint"
        count = len(self.history)
        span = f"{count} session{'s' if count > 1 else ''}, {days_of(self.history.dates)}"
        if not self.known:
            return (
                f"{joint}: whether it changed is not known yet ({span}); no change can be told of "
                f"fewer than {LEAST_SESSIONS} sessions that tell a parameter."
            )
        if not self.changes:
            return f"{joint}: no change is told ({span})."
        told = len(self.changes)
        lasting = [c for c in self.changes if c.needs and self[c.parameter].differs]
        needs = list(dict.fromkeys(c.needs for c in lasting))
        what = f"{told} change{'s' if told > 1 else ''} told ({span})"
        return f"{joint}: {what}." + (f" It needs {_and(needs)}." if needs else "")

    @property
    def levels(self) -> list[str]:
        """At which temperature levels are told, where that is accounted for."""
        if not np.isfinite(self.reference):
            return []
        return [f"Levels are those at {self.reference:.1f} °C, the median of the sessions."]

    @property
    def sentences(self) -> list[str]:
        """Changes, what else changed with them, forecasts, and trends without a limit."""
        said = [change.sentence for change in self.changes]
        if not any(change.scaled for change in self.changes):
            named = {change.parameter for change in self.changes}
            more = [p for p in self.parameters if p.state == CHANGED and p.name not in named]
            said += [p.sentence for p in more]
        said += [
            f"{spoken(p.name)}, now {in_unit(plus_minus(*p.now), p.unit)}, "
            f"{no_drive_has(p.negative)}: the model lacks a form that these sessions show."
            for p in self.parameters
            if p.negative
        ]
        said += [forecast.sentence for forecast in self.forecasts]
        limited = {forecast.parameter for forecast in self.forecasts}
        lead = [c.parameter for c in self.changes if _goes_on(c) and c.parameter not in limited]
        if lead:
            names = _and(list(dict.fromkeys(map(spoken, lead))))
            said.append(f"No limit of {names} is given, so no date: say what it must not pass.")
        return said

    def to_frame(self) -> pandas.DataFrame:
        """Return a row for each parameter."""
        import pandas

        rows = [{"parameter": p.name, **_numbers(p)} for p in self.parameters]
        return pandas.DataFrame(rows).set_index("parameter")

    def to_json(self) -> str:
        """Return the text of `track.json`.

        Numbers are in each parameter's unit, dates in ISO 8601.
        """
        return checked_json(
            {
                "format": FORMAT,
                "version": VERSION,
                "made_by": f"flexspline {__version__}",
                "joint": self.history.joint or None,
                "verdict": self.verdict,
                "known": self.known,
                "reference_temperature": self.reference,
                "sessions": [
                    {"name": name, "date": _iso(date), "temperature": float(warm)}
                    for name, date, warm in zip(
                        self.history.labels,
                        self.history.dates,
                        self.history.temperatures,
                        strict=True,
                    )
                ],
                "parameters": [_parameter_json(p) for p in self.parameters],
                "changes": [
                    {
                        **asdict(c),
                        "date": _iso(c.date),
                        "between": [_iso(each) for each in c.between],
                        "told_since": _iso(c.told_since),
                        "sentence": c.sentence,
                        "needs": c.needs or None,
                    }
                    for c in self.changes
                ],
                "forecasts": [
                    {
                        **asdict(f),
                        "date": _iso(f.date),
                        "within_80": [_iso(each) for each in f.within_80],
                        "within_95": [_iso(each) for each in f.within_95],
                        "why_none": f.why_none or None,
                        "sentence": f.sentence,
                    }
                    for f in self.forecasts
                ],
                "remarks": list(self.remarks),
            },
            "track",
        )

    def summary(self) -> str:
        """Return verdict, changes, forecasts and a line for each parameter."""
        return render("track", "text", self)

    def __repr__(self) -> str:
        return (
            f"<Track of {self.history.joint or 'a joint'}: {len(self.history)} sessions, "
            f"{len(self.parameters)} parameters, {len(self.changes)} changes told>"
        )

    def plot(self) -> Figure:
        """Return a figure: each parameter over calendar time with its band."""
        return render("track", "figure", self)


def day(when: datetime) -> str:
    """Return a date as 2027-03-14."""
    return when.strftime("%Y-%m-%d")


def days_of(dates: NDArray[np.datetime64]) -> str:
    """Return the first and the last of dates, or the one day that they are of."""
    first, last = (
        day(each.astype("datetime64[s]").astype(datetime)) for each in (dates.min(), dates.max())
    )
    return first if first == last else f"{first} to {last}"


def _goes_on(change: Change) -> bool:
    return change.known and change.at_once < UNLIKELY and change.kind != SETTLING


def _iso(when: datetime | np.datetime64 | None) -> str | None:
    if when is None:
        return None
    return (when.astype(datetime) if isinstance(when, np.datetime64) else when).isoformat()


def in_unit(number: str, unit: str) -> str:
    """Return a number with its unit; a share has none."""
    return number if unit == "1" else f"{number} {unit}"


def spoken(name: str) -> str:
    """Return a parameter as sentences call it: its effect and, where it has several, which."""
    effect, _, term = name.partition(".")
    info = CATALOGUE.get(effect)
    if info is not None and [each.name for each in info.terms] == [term] and not info.pairs:
        return effect
    word, _, order = term.partition(" ")
    return f"{effect} order {order} ({word})" if info is not None and info.pairs else name


def _percent(share: float, sign: str = "") -> str:
    return f"{round(100.0 * share) + 0.0:{sign}.0f} %"


def needed_by(effect: str) -> str:
    """Return what to look at or to do, as words behind "It needs"; "" of an effect of your own."""
    info = CATALOGUE.get(effect)
    if info is None:
        return ""
    if info.traits.constant:
        return "a new zero"
    if info.carries_load:
        return "a look at what it carries: a mass has changed"
    if info.targets == "D":
        return "a look at its gear: what it yields has changed"
    if info.pairs:
        return "a look at what turns at that order: bearings, wave generator, teeth"
    if info.traits.known_load or (info.reads == ("load",) and not info.traits.dissipative):
        return "a new calibration of its torque"
    if "output_velocity" in info.reads or info.traits.dissipative:
        return "a look at its lubricant and bearings"
    return "a look at its sensor"


def _and(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _numbers(p: TrackedParameter) -> dict[str, Any]:
    return {
        "unit": p.unit,
        "state": p.state,
        "sessions": p.sessions,
        "at_first": p.at_first[0],
        "at_first_error": p.at_first[1],
        "now": p.now[0],
        "now_error": p.now[1],
        "per_kelvin": p.by_temperature[0],
        "per_kelvin_error": p.by_temperature[1],
        "between_sessions": p.between_sessions,
        "measured_error": p.measured_error,
        "least": p.least,
    }


def _parameter_json(p: TrackedParameter) -> dict[str, Any]:
    return {
        "name": p.name,
        **_numbers(p),
        "values": p.values.tolist(),
        "corrected": p.corrected.tolist(),
        "band": {
            "dates": [_iso(each) for each in p.band.dates],
            "middle": p.band.middle.tolist(),
            "low": p.band.low.tolist(),
            "high": p.band.high.tolist(),
        },
        "sentence": p.sentence,
    }
