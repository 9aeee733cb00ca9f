"""Limits of the numbers of a simulated joint, stated beside each field and checked alike."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from flexspline.errors import InputError

__all__ = ["above", "at_least", "require_limits", "whole"]


def at_least(lowest: float, default: float = 0.0) -> Any:
    """Return a dataclass field whose number is ≥ `lowest`."""
    return dataclasses.field(default=default, metadata={"least": lowest})


def above(bound: float, default: float) -> Any:
    """Return a dataclass field whose number is > `bound`."""
    return dataclasses.field(default=default, metadata={"above": bound})


def whole(lowest: int, highest: int, default: int) -> Any:
    """Return a dataclass field whose number is whole and within [lowest, highest]."""
    return dataclasses.field(default=default, metadata={"whole": (lowest, highest)})


def require_limits(owner: Any) -> None:
    """Raise InputError, with the name of the field, for a number outside its limits."""
    for each in dataclasses.fields(owner):
        value = getattr(owner, each.name)
        remedy = ""
        if "whole" in each.metadata:
            low, high = each.metadata["whole"]
            if not (isinstance(value, (int, float)) and value % 1 == 0 and low <= value <= high):
                remedy = f"a whole number from {low} to {high}"
        elif each.metadata or isinstance(value, (int, float)):
            remedy = _remedy(each.metadata, value)
        if remedy:
            name = f"{type(owner).__name__}.{each.name}"
            raise InputError(f"simulation: {name} is {value!r}; give {remedy}")


def _remedy(limits: Mapping[Any, Any], value: Any) -> str:
    """Return what to give instead of `value`, or nothing."""
    if not isinstance(value, (int, float)) or not math.isfinite(value):
        return "a finite number"
    if "least" in limits and value < limits["least"]:
        return f"a number of at least {limits['least']:g}"
    if "above" in limits and not value > limits["above"]:
        return f"a number above {limits['above']:g}"
    return ""
