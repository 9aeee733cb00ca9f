"""Fleets of joints: fit, discover and compare for hundreds, and what they have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexspline.lazy import attached

if TYPE_CHECKING:
    from flexspline.fleet.sessions import Session, Sessions, mean_temperature, sessions_of

__all__ = ["Session", "Sessions", "mean_temperature", "sessions_of"]

_HOME = {
    "Session": "sessions",
    "Sessions": "sessions",
    "mean_temperature": "sessions",
    "sessions_of": "sessions",
}

__getattr__ = attached(__name__, _HOME)
