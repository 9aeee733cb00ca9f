"""Recordings of foreign recorders: what their columns are, guessed with reasons."""

from __future__ import annotations

from flexspline.recordings.guessing import guess_map
from flexspline.recordings.result import Guess, Guessed

__all__ = ["Guess", "Guessed", "guess_map"]
