"""Facts: what does not change during a run, such as the gear ratio or the run's name."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, Final

from flexspline.errors import InputError, printable

__all__ = ["Fact", "checked_facts", "parsed_fact"]

Fact = str | float | int

TEXTS: Final = ("name", "joint")
POSITIVE: Final = ("gear_ratio", "torque_constant")
COUNTS: Final = ("pole_pairs", "slots")
SPLINES: Final = ("circular", "flex")


def checked_facts(facts: Mapping[str, Any], label: str) -> dict[str, Fact]:
    """Return `facts` with the known ones in their own type.

    Parameters
    ----------
    facts : mapping of str to str, float or int
        `gear_ratio` [–] and `torque_constant` [Nm/A] are positive numbers, `pole_pairs` and
        `slots` positive whole numbers, `output_spline` is "circular" or "flex", `name`
        and `joint` are text, which is kept to one line that a terminal can show. Everything else
        is free. None means "not known" and is left out.
    label : str
        What an error calls the log, such as its file name.

    Raises
    ------
    InputError
        Where a known fact has a value that it cannot have.
    """
    return {
        str(key): _checked(str(key), value, label)
        for key, value in facts.items()
        if value is not None
    }


def parsed_fact(text: str) -> Fact:
    """Return a number where `text` is how Python writes that number, else the text.

    A serial number such as "00123" therefore stays text.
    """
    try:
        number: float | int = int(text) if re.fullmatch(r"[+-]?\d+", text) else float(text)
    except ValueError:
        return text
    return number if repr(number) == text and math.isfinite(number) else text


def _checked(key: str, value: Any, label: str) -> Fact:
    if key in TEXTS:
        return printable(str(value))
    if key in POSITIVE:
        return _positive(key, value, label)
    if key in COUNTS:
        number = _positive(key, value, label)
        if number != int(number):
            raise InputError(f"{label}: {key} is {value!r}; give a positive whole number")
        return int(number)
    if key == "output_spline" and value not in SPLINES:
        raise InputError(f"{label}: output_spline is {value!r}; give 'circular' or 'flex'")
    if hasattr(value, "item"):
        value = value.item()
    return value if isinstance(value, (str, int, float)) else str(value)


def _positive(key: str, value: Any, label: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (number > 0 and math.isfinite(number)):
        raise InputError(f"{label}: {key} is {value!r}; give a positive number")
    return number
