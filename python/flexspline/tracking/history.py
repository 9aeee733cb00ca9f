"""The parameters of one joint, session by session: what `track` works on.

An order has cosine and sine, a and b, whose share depends on where an angle is zero. With the phase
ψ of the first sessions they become what grows and what turns:

    amplitude = a cos ψ + b sin ψ,        quadrature = b cos ψ − a sin ψ

The amplitude is the order as it was at first; the quadrature is zero there, and grows where the
order turns against it. An order that the first sessions do not tell from zero has no phase, and
keeps its cosine and sine.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError
from flexspline.tracking.changes import Series

__all__ = ["DAY", "FIRST", "History", "cause_of"]

Array = NDArray[np.float64]

DAY: Final = 86400.0  # s
FIRST: Final = 12
"""Sessions that are the beginning: a phase and what parameters have in common are taken from them.
Half of it doubles the error of a phase; twice as many let early wear into the beginning."""
TOLD: Final = 3.0  # standard errors by which an amplitude is told from zero
COSINE, SINE = "cosine", "sine"
AMPLITUDE, QUADRATURE = "amplitude", "quadrature"


@dataclass(frozen=True, eq=False)
class History:
    """Estimates of one joint's parameters over calendar time, by date.

    Parameters
    ----------
    dates : (S,) datetime64; in any order, and equal ones are allowed.
    names : of the P parameters, "effect.term".
    units : of them.
    values : (S, P), NaN where a session does not determine one.
    covariance : (S, P, P) of what was measured, or standard errors (S, P).
    temperatures : (S,) mean of each session in °C, NaN where it is not known; by default of none.
    labels : names of the sessions.
    joint : its name.
    remarks : what was left out, in sentences.
    among : joints that are looked at together: of many, one shows more by chance.

    Raises
    ------
    InputError
        Where shapes do not fit, there is no session or no parameter, a date is missing, or a
        variance is negative.
    """

    dates: NDArray[np.datetime64]
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array
    temperatures: Array = field(default_factory=lambda: np.empty(0))
    labels: tuple[str, ...] = ()
    joint: str = ""
    remarks: tuple[str, ...] = field(default=())
    among: int = 1

    def __post_init__(self) -> None:
        dates = np.asarray(self.dates, dtype="datetime64[s]")
        values = _numbers(self.values, "values")
        count, width = len(dates), len(self.names)
        if not count or not width:
            raise InputError("a history needs a session and a parameter; give at least one of each")
        if np.isnat(dates).any():
            at = int(np.flatnonzero(np.isnat(dates))[0])
            raise InputError(f"session {at + 1} of the history has no date; give one or leave it")
        covariance = _numbers(self.covariance, "covariance")
        if covariance.shape == (count, width):
            covariance = covariance[:, :, None] ** 2 * np.eye(width)
        warm = _numbers(self.temperatures, "temperatures")
        warm = warm if warm.size else np.full(count, np.nan)
        labels = self.labels or tuple(f"session {k}" for k in range(1, count + 1))
        for what, has, is_to in (
            ("values", values.shape, (count, width)),
            ("covariance", covariance.shape, (count, width, width)),
            ("temperatures", warm.shape, (count,)),
            ("units", (len(self.units),), (width,)),
            ("labels", (len(labels),), (count,)),
        ):
            if has != is_to:
                raise InputError(
                    f"{what} of the history are of shape {has}; with {count} sessions and {width} "
                    f"parameters give {is_to}"
                )
        variances = np.einsum("spp->sp", covariance)
        if (variances < 0.0).any():
            raise InputError("a variance of the history is negative; give a covariance")
        if len(set(self.names)) < width:
            raise InputError("two parameters of the history have one name; give each its own")
        order = np.argsort(dates, kind="stable")
        for name, made in (
            ("dates", dates[order]),
            ("values", values[order]),
            ("covariance", covariance[order]),
            ("temperatures", warm[order]),
            ("labels", tuple(labels[k] for k in order)),
        ):
            object.__setattr__(self, name, made)

    def __len__(self) -> int:
        return len(self.dates)

    def __repr__(self) -> str:
        joint = f" of {self.joint}" if self.joint else ""
        ends = f"{self.dates[0].astype('M8[D]')} to {self.dates[-1].astype('M8[D]')}"
        return f"<History{joint}: {len(self)} sessions, {ends}, {len(self.names)} parameters>"

    @property
    def days(self) -> Array:
        """(S,) days since the first session."""
        seconds = (self.dates - self.dates[0]).astype("timedelta64[s]").astype(np.float64)
        return np.asarray(seconds / DAY)

    @property
    def looked_at(self) -> int:
        """How many series are looked at for a change: parameters, of all joints."""
        return len(self.names) * self.among

    @property
    def years(self) -> float:
        """From the first session to the last."""
        return float(self.days[-1] / 365.25)

    @property
    def knows_temperature(self) -> NDArray[np.bool_] | None:
        """(S,) which sessions tell it, where more than half do; None: it is not accounted for."""
        told = np.isfinite(self.temperatures)
        return told if 2 * told.sum() > len(told) else None

    @property
    def errors(self) -> Array:
        """(S, P) standard errors of what was measured."""
        return np.asarray(np.sqrt(np.einsum("spp->sp", self.covariance)))

    def date(self, days: float) -> datetime:
        """The date so many days after the first session."""
        when: datetime = (self.dates[0] + np.timedelta64(round(days * DAY), "s")).astype(datetime)
        return when

    def since(self, when: str | datetime | np.datetime64) -> History:
        """Return the sessions from a date on: those of a joint that was serviced then.

        Raises
        ------
        InputError
            Where it is no date, or no session is left.
        """
        try:
            first = np.datetime64(str(when).replace(" ", "T"), "s")
        except ValueError:
            raise InputError(f"'{when}' is no date; write it as 2027-03-14") from None
        kept = self.dates >= first
        if not kept.any():
            raise InputError(
                f"no session is from {first.astype('M8[D]')} on; the last is of "
                f"{self.dates[-1].astype('M8[D]')}: give an earlier date"
            )
        return self.sessions(kept)

    def sessions(self, which: NDArray[Any]) -> History:
        """Return some of the sessions."""
        at = np.flatnonzero(which) if which.dtype == bool else which
        return replace(
            self,
            dates=self.dates[at],
            values=self.values[at],
            covariance=self.covariance[at],
            temperatures=self.temperatures[at],
            labels=tuple(self.labels[k] for k in at),
        )

    def only(self, which: Sequence[int]) -> History:
        """Return some of the parameters."""
        at = list(which)
        return replace(
            self,
            names=tuple(self.names[k] for k in at),
            units=tuple(self.units[k] for k in at),
            values=self.values[:, at],
            covariance=self.covariance[:, at][:, :, at],
        )

    def series(self, weights: Array) -> tuple[Series, NDArray[np.intp]]:
        """Return a weighted sum of parameters, `weights` (P,), over the sessions that tell it.

        Sessions of unknown temperature are left out where others tell it. The numbers of the
        sessions that are left come beside it.
        """
        used = np.flatnonzero(weights)
        values = self.values[:, used] @ weights[used]
        inner = self.covariance[:, used][:, :, used]
        variances = np.einsum("sij,i,j->s", inner, weights[used], weights[used])
        told = np.isfinite(values) & np.isfinite(variances)
        warm = self.knows_temperature
        if warm is not None:
            told &= warm
        at = np.flatnonzero(told)
        temperatures = None if warm is None else self.temperatures[at]
        return Series(self.days[at], values[at], variances[at], temperatures), at

    def turned(self) -> History:
        """Return the history with amplitude and quadrature of each order that has a phase."""
        names, turn = list(self.names), np.eye(len(self.names))
        for cosine, sine, rest in self._orders():
            first = [*self._first((cosine, sine))]
            if len(first) < 4:
                continue
            both = self.values[first][:, [cosine, sine]]
            mean = np.median(both, axis=0)
            size = float(np.hypot(*mean))
            if not size > 0.0:
                continue
            along = mean / size
            spread = 1.4826 * np.median(np.abs(both @ along - size)) / np.sqrt(len(first))
            known = self.covariance[first][:, [cosine, sine]][:, :, [cosine, sine]]
            error = np.sqrt(np.mean(np.einsum("sij,i,j->s", known, along, along)) / len(first))
            if size < TOLD * float(np.hypot(spread, error)):
                continue
            turn[np.ix_([cosine, sine], [cosine, sine])] = [
                [along[0], along[1]], [-along[1], along[0]]
            ]  # fmt: skip
            names[cosine], names[sine] = (
                f"{names[cosine].split('.')[0]}.{word}{rest}" for word in (AMPLITUDE, QUADRATURE)
            )
        values = np.full_like(self.values, np.nan)
        for p, row in enumerate(turn):
            used = np.flatnonzero(row)
            values[:, p] = self.values[:, used] @ row[used]
        covariance = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        covariance = turn @ covariance @ turn.T
        known = np.isfinite(np.einsum("spp->sp", self.covariance))
        unknown = np.any(~known[:, None, :] & (turn != 0.0), axis=2) | ~np.isfinite(values)
        covariance[unknown[:, :, None] | unknown[:, None, :]] = np.nan
        return replace(self, names=tuple(names), values=values, covariance=covariance)

    def _orders(self) -> Iterator[tuple[int, int, str]]:
        """Numbers of cosine and sine of each order, and what stands behind these words."""
        for cosine, name in enumerate(self.names):
            effect, _, term = name.partition(".")
            word, _, rest = term.partition(" ")
            rest = f" {rest}" if rest else ""
            other = f"{effect}.{SINE}{rest}"
            if word == COSINE and other in self.names:
                yield cosine, self.names.index(other), rest

    def _first(self, parameters: Sequence[int]) -> NDArray[np.intp]:
        """The first sessions that tell these parameters."""
        told = np.isfinite(self.values[:, list(parameters)]).all(axis=1)
        return np.flatnonzero(told)[:FIRST]


def cause_of(name: str) -> str:
    """Return what a parameter belongs to: its effect, or one order of it.

    Several parameters of one cause change together, such as amplitude and quadrature.
    """
    effect, _, term = name.partition(".")
    word, _, rest = term.partition(" ")
    if word in (COSINE, SINE, AMPLITUDE, QUADRATURE):
        return f"{effect}, order {rest}" if rest else effect
    return name if word else effect


def _numbers(given: ArrayLike, what: str) -> Array:
    try:
        return np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what} of the history are no numbers; give an array of them") from None
