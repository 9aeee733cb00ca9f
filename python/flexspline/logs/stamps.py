"""Time stamps written as text: dates with a time, or times of day, as seconds.

Whether 03/04 is in March or in April is not told by a date: of both orders the one counts under
which the rows of a run lie closer together.
"""

from __future__ import annotations

import re
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["is_stamp", "seconds_of_stamps"]

CLOCK: Final = r"\d{1,2}:\d{2}:\d{2}(?:[.,]\d+)?"
STAMP: Final = re.compile(
    rf"\s*(?:\d{{1,4}}[-./]\d{{1,2}}[-./]\d{{1,4}}[T\s_,]+)?{CLOCK}\s*"
    r"(?:[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|[+-]\d{2}:?\d{2})?\s*"
)
DAY: Final = 86_400.0


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
