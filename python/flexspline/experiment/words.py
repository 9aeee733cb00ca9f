"""Numbers and places as a sentence has them."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["joined", "over", "short"]

NARROW = 0.05  # of the middle's size: ends that two digits hardly tell apart


def short(value: float) -> str:
    """Return a number with two digits: 0.051, 1.2, 38."""
    rounded = float(f"{float(value):.2g}")
    return f"{rounded + 0.0:g}".replace("-", "−")


def joined(words: Iterable[str]) -> str:
    """Return "a, b and c", each once."""
    every = list(dict.fromkeys(words))
    return " and ".join(p for p in (", ".join(every[:-1]), every[-1]) if p)


def over(low: float, high: float) -> str:
    """Return where angles lie: over ±1.2 rad, from 0.3 to 1.5 rad, or within ±0.004 rad of 4.8."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if half < NARROW * abs(middle):
        return f"within ±{short(half)} rad of {short(middle)} rad"
    if short(-low) == short(high):
        return f"over ±{short(high)} rad"
    return f"from {short(low)} to {short(high)} rad"
