"""What a log can hold: numbers that an instrument reads, on a clock that a recorder has.

Beyond these limits squares and products leave the range of a double, sorting by time asks for
memory without end, and no physics is left. An instrument that has nothing to say often writes a
number all the same: 9.91e37 for an overload (SCPI).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from numbers import Real
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, shortened
from flexspline.logs.channels import CHANNELS
from flexspline.logs.log import Log

__all__ = [
    "IMAGINABLE",
    "LATEST",
    "LEAST",
    "MOST",
    "SHORTEST",
    "Beyond",
    "beyond",
    "emptied",
    "given_number",
    "is_read",
    "measurable",
    "require_clock",
]

IMAGINABLE: Final = 1e9
"""No channel of a log but time is beyond this, in SI units: a motor at 60 000 rpm needs two days
for 1e9 rad, and what twists, pulls or heats a joint is further from it still. Half and double of it
change nothing that an instrument has written."""

LATEST: Final = 1e11
"""s: time stamps are within this: 3000 years, so that they may count from the year 0. A double
tells steps of 15 µs there."""

SHORTEST: Final = 1e-9
"""s: no recorder of a joint steps faster; who writes seconds as milliseconds is far above it."""

LEAST: Final = 1e-20
"""No target is as small as this throughout, in SI units: its square, and the square of that, are
numbers of full precision. The finest torsion balances resolve 1e-18 Nm."""


MOST: Final = 1e15
"""No parameter or setting that somebody gives is beyond this, in SI units, nor a standard error
below its inverse: beside it a double has no digit left for a torque of 1 Nm."""


class Beyond(NamedTuple):
    """A channel with numbers that no instrument reads, and their rows."""

    channel: str
    rows: NDArray[np.intp]
    sentence: str


def beyond(log: Log) -> Iterator[Beyond]:
    """Give each channel with finite numbers beyond the limits."""
    for name, values in log.columns.items():
        limit = LATEST if name == "time" else IMAGINABLE
        if -limit <= np.fmin.reduce(values) and np.fmax.reduce(values) <= limit:
            continue
        rows = np.flatnonzero(np.isfinite(values) & (np.abs(values) > limit))
        if len(rows):
            unit = CHANNELS[name].unit
            what = "recorder stamps" if name == "time" else "instrument reads"
            count = "in one row" if len(rows) == 1 else f"in {len(rows)} rows"
            yield Beyond(
                name,
                rows,
                f"{name} is beyond what any {what} {count}: {values[rows[0]]:.4g} {unit} in row "
                f"{rows[0]}",
            )


def is_read(values: NDArray[np.float64]) -> bool:
    """Whether all values of a channel other than time are such as an instrument reads."""
    return bool(np.max(np.abs(values), initial=0.0) <= IMAGINABLE)  # not so with NaN


def given_number(value: object, what: str) -> float:
    """Return a number that somebody gives, or refuse what is none or beyond `MOST`.

    Raises
    ------
    InputError
        That begins with `what`.
    """
    number = value if isinstance(value, int) else float(value) if isinstance(value, Real) else None
    if number is None or not -math.inf < number < math.inf:
        raise InputError(f"{what} is {shortened(repr(value))}; give a finite number")
    if not -MOST <= number <= MOST:
        raise InputError(
            f"{what} is {shortened(value, 40)}, beyond {MOST:g}, which no joint has; correct it"
        )
    return float(number)


def emptied(log: Log) -> Log:
    """Return the log with NaN for what no instrument reads, and for a time that is infinite."""
    made = {one.channel: np.array(log[one.channel]) for one in beyond(log)}
    for name, values in made.items():
        values[np.abs(values) > (LATEST if name == "time" else IMAGINABLE)] = np.nan
    if np.isinf(log["time"]).any():
        made["time"] = np.where(np.isinf(log["time"]), np.nan, made.get("time", log["time"]))
    return log.with_columns(made, note="overloads are empty") if made else log


def measurable(log: Log) -> tuple[Log, tuple[str, ...]]:
    """Return the log with NaN for what no instrument reads, and a sentence for each such channel.

    Raises
    ------
    InputError
        Where the log has no clock, see `require_clock`.
    """
    require_clock(log)
    said = tuple(
        f"{log.name}: {one.sentence}; it counts as empty: look for an overload, or for another "
        "unit of the column"
        for one in beyond(log)
    )
    return (emptied(log) if said else log), said


def require_clock(log: Log) -> None:
    """Refuse time stamps that are no numbers, or that no recorder makes; not their order.

    Raises
    ------
    InputError
        Where time is not finite or beyond `LATEST`, or its steps are below `SHORTEST`.
    """
    time = log["time"]
    lost = np.flatnonzero(~np.isfinite(time) | (np.abs(time) > LATEST))
    if len(lost):
        raise InputError(
            f"log '{log.name}': time is {time[lost[0]]:.4g} s in row {lost[0]} (rows of this kind: "
            f"{len(lost)}); ask for the repair drop_invalid, or correct the unit of the column"
        )
    if 0.0 < 1.0 / log.rate < SHORTEST:
        raise InputError(
            f"log '{log.name}': time goes by steps of {1.0 / log.rate:.3g} s, which no recorder "
            "has; correct the unit of its column"
        )
