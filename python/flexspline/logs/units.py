"""How recorders, laboratories and languages write units and times, and what these are.

Of a unit it is what pint calls it. A spelling counts whatever its blanks, brackets and product
signs: "[N·m]" is "Nm". Letters' case counts first ("mNm"), then not ("NM").

Time stamps are dates with a time, or times of day; they become seconds. Whether 03/04 is in March
or in April is not told by a date: of both orders the one counts under which the rows of a run lie
closer together.
"""

from __future__ import annotations

import functools
import re
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "COUNTS",
    "canonical_unit",
    "is_stamp",
    "seconds_of_stamps",
    "states_no_unit",
    "without_remark",
]


SMALL: Final = ("mNm", "mA", "mV")  # with a capital M they may be mega

SPELLINGS: Final[dict[str, tuple[str, ...]]] = {
    "s": ("s", "sec", "secs", "second", "seconds", "sek", "sekunden", "秒", "с"),
    "ms": ("ms", "msec", "millis", "millisecond", "milliseconds", "millisekunden", "мс"),
    "us": ("us", "µs", "μs", "usec", "micros", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanosecond", "nanoseconds"),
    "day": ("day", "days", "d"),
    "rad": ("rad", "рад", "radian", "radians", "rads"),
    "mrad": ("mrad",),
    "deg": ("deg", "degs", "degree", "degrees", "°", "º", "grad", "度", "град"),
    "rev": ("rev", "revs", "revolution", "revolutions", "turn", "turns", "umdr", "tr"),
    "rad/s": ("rad/s", "rad/sec", "rads/s", "rad_s", "rad_per_s", "rad_sec", "rads-1", "rads^-1"),
    "deg/s": ("deg/s", "deg/sec", "°/s", "°/sec", "º/s", "dps", "grad/s", "deg_s", "deg_per_s"),
    "mrad/s": ("mrad/s", "mrad_s"),
    "rpm": (
        "rpm", "1/min", "1min", "1.min", "u/min", "min-1", "min^-1", "r/min", "rev/min", "umin",
        "upm", "tr/min", "/min", "min⁻¹", "rev_min", "об/мин", "obr/min", "ot/min", "giri/min",
    ),
    "rev/s": ("rev/s", "revs/s", "turn/s", "turns/s", "rps", "r/s", "u/s", "rev_s"),
    "rad/s^2": ("rad/s^2", "rad/s²", "rad/s2", "rad/ss", "rad_s2", "rads-2"),
    "deg/s^2": ("deg/s^2", "deg/s²", "deg/s2", "°/s²", "°/s^2", "°/s2", "deg_s2"),
    "Nm": ("Nm", "newtonmetre", "newtonmeter", "newtonmetres", "newtonmeters", "нм", "N_m"),
    "mNm": ("mNm", "N_mm", "Nmm"),
    "Ncm": ("Ncm",),
    "cNm": ("cNm",),
    "dNm": ("dNm",),
    "daNm": ("daNm",),
    "kilonewton * metre": ("kNm",),
    "uNm": ("uNm", "µNm", "μNm"),
    "lbf * inch": ("lbfin", "lbin", "inlb", "inlbf", "inlbs", "lbsin"),
    "lbf * foot": ("lbfft", "lbft", "ftlb", "ftlbf", "ftlbs"),
    "ozf * inch": ("ozfin", "ozin", "inoz", "inozf"),
    "kgf * cm": ("kgfcm", "kgcm", "kgf_cm"),
    "kgf * m": ("kgfm", "kgm", "kgf_m"),
    "A": ("A", "А", "amp", "amps", "ampere", "amperes"),
    "mA": ("mA", "мА", "milliamp", "milliamps"),
    "V": ("V", "В", "volt", "volts"),
    "mV": ("mV", "millivolt", "millivolts"),
    "degC": ("degC", "°C", "ºC", "℃", "C", "celsius", "deg_C", "gradC"),
    "degF": ("degF", "°F", "ºF", "℉", "F", "fahrenheit", "deg_F"),
    "K": ("K", "kelvin"),
    "%": ("%", "percent", "prozent", "pct"),
    "permille": ("permille", "‰"),
}  # fmt: skip
"""pint's unit: how it is met. "grad" and "C" are the laboratory's, degrees and not gon or coulomb.
Not here: "Hz" and "1/s", which of a speed may be turns or radians in a second."""

NO_UNIT: Final = frozenset(
    (
        "", "1", "0/1", "?", "none", "null", "nil", "n/a", "na", "nan", "no unit", "no units",
        "unitless", "dimensionless", "unknown", "undefined", "ohne", "keine", "dimensionslos",
        "bool", "boolean", "logical", "flag", "state", "on/off", "float", "double", "text",
        "filtered", "unfiltered", "measured", "actual", "from custom scale",
    )
)  # fmt: skip
"""What recorders write in the place of a unit where they state none, beside dashes: a kind of
number, a remark, and what TDMS files of LabVIEW say where a user's own scale has the unit."""
COUNTS: Final = ("count", "counts", "cnt", "cnts", "inc", "incr", "increments", "inkremente",
                 "inkr", "tick", "ticks", "qc", "quadcounts", "pulses", "lsb", "raw")  # fmt: skip
"""Whole numbers of an encoder or a converter: what one of them is worth is for a map to say."""

CLOCK: Final = r"\d{1,2}:\d{2}:\d{2}(?:[.,]\d+)?"
STAMP: Final = re.compile(
    rf"\s*(?:\d{{1,4}}[-./]\d{{1,2}}[-./]\d{{1,4}}[T\s_,]+)?{CLOCK}\s*"
    r"(?:[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|[+-]\d{2}:?\d{2})?\s*"
)
DAY: Final = 86_400.0


def canonical_unit(text: str) -> str | None:
    """Return pint's name of a unit as somebody spelt it, or None where the spelling is not known.

    Examples
    --------
    >>> canonical_unit("[N·m]"), canonical_unit("U/min"), canonical_unit("apples")
    ('Nm', 'rpm', None)
    """
    bare = _bare(text)
    exact, folded = _tables()
    for plain in (re.sub(r"\s", "", bare), _without_signs(bare)):
        unit = exact.get(plain) or folded.get(plain.lower())
        if unit and (plain in exact or not (unit in SMALL and plain != plain.lower())):
            return unit
    return None


def states_no_unit(text: str) -> bool:
    """Whether a text in the place of a unit states none.

    Examples
    --------
    >>> states_no_unit("[-]"), states_no_unit("None"), states_no_unit("foo")
    (True, True, False)
    """
    return _bare(text).strip("-–—−_./ ").lower() in NO_UNIT


def without_remark(text: str) -> str:
    """Return a unit without what is said of it behind: "° (Angle)", "seconds since 2020-01-01"."""
    bare = re.sub(r"\s*\(.*\)?$", "", _bare(text).strip("'\""))
    return re.sub(r"\s+since\s.*$", "", bare, flags=re.IGNORECASE)


def _bare(text: str) -> str:
    """Return a unit without the brackets around it."""
    return re.sub(r"^\s*(?:\[(.*)\]|\((.*)\)|\{(.*)\})\s*$", r"\1\2\3", str(text)).strip()


def _without_signs(bare: str) -> str:
    """Return a torque without the signs of its product: "N·m", "lbf-in"."""
    return re.sub(r"(?<=[A-Za-zА-я])[\s·⋅•・*.-]+(?=[A-Za-zА-я])", "", bare)


@functools.cache
def _tables() -> tuple[dict[str, str], dict[str, str]]:
    exact, folded = dict[str, str](), dict[str, str]()
    for unit, spellings in SPELLINGS.items():
        for spelling in (unit, *spellings):
            plain = re.sub(r"\s", "", spelling)
            exact.setdefault(plain, unit)
            folded.setdefault(plain.lower(), unit)
    return exact, folded


def is_stamp(cell: object) -> bool:
    """Tell whether a cell is a date with a time, or a time of day."""
    return isinstance(cell, str) and STAMP.fullmatch(cell) is not None


def seconds_of_stamps(cells: NDArray[Any]) -> NDArray[np.float64] | None:
    """Return seconds from the first of these stamps [s], or None where one of them is none.

    Parameters
    ----------
    cells : ndarray of text, shape (n,)
        ISO 8601 with or without a zone, a date of numbers with a time, or a time of day, which
        begins anew at midnight. Seconds have a decimal point or comma.
    """
    texts = [str(cell).strip().replace(",", ".") for cell in cells]
    if not texts or not all(is_stamp(text) for text in texts):
        return None
    if re.fullmatch(CLOCK, texts[0]):
        import pandas

        seconds = _seconds(pandas.to_timedelta(pandas.Series(texts), errors="coerce"))
        if seconds is None:
            return None
        return seconds + DAY * np.cumsum(np.diff(seconds, prepend=0.0) < -DAY / 2)
    both = [_seconds(_dates(texts, day_first)) for day_first in (True, False)]
    told = [seconds for seconds in both if seconds is not None]
    return min(told, key=lambda seconds: float(np.abs(np.diff(seconds)).sum()), default=None)


def _seconds(since: Any) -> NDArray[np.float64] | None:
    seconds = np.asarray((since - since.iloc[0]).dt.total_seconds(), dtype=np.float64)
    return seconds if np.isfinite(seconds).all() else None


def _dates(texts: list[str], day_first: bool) -> Any:
    import pandas

    parts = [re.fullmatch(rf"(.*?)[T\s_]+({CLOCK}.*)", text) for text in texts]
    dates = {part[1]: _iso(part[1], day_first) for part in parts if part}
    plain = pandas.Series([f"{dates[part[1]]} {part[2]}" if part else None for part in parts])
    how = "mixed" if re.search("[AaPp]", texts[0].split(":")[-1]) else "ISO8601"
    return pandas.to_datetime(plain, format=how, utc=True, errors="coerce")


def _iso(date: str, day_first: bool) -> str:
    """Return year-month-day of a date of three numbers, the year first or last."""
    first, second, third = re.split(r"[-./]", date)
    if len(first) == 4:
        return f"{first}-{second}-{third}"
    day, month = (first, second) if day_first else (second, first)
    return f"{third if len(third) == 4 else '20' + third}-{month:0>2}-{day:0>2}"
