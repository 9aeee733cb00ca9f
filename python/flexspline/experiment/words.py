"""Numbers and places as a sentence has them."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["joined", "over", "short"]


def short(value: float) -> str:
    """Return a number with two digits: 0.051, 1.2, 38."""
    rounded = float(f"{float(value):.2g}")
    return f"{rounded + 0.0:g}".replace("-", "−")


def joined(words: Iterable[str]) -> str:
    """Return "a, b and c", each once."""
    every = list(dict.fromkeys(words))
    return " and ".join(p for p in (", ".join(every[:-1]), every[-1]) if p)


def over(low: float, high: float) -> str:
    """Return where angles lie: "over ±1.2 rad" or "from 0.3 to 1.5 rad"."""
    if short(-low) == short(high):
        return f"over ±{short(high)} rad"
    return f"from {short(low)} to {short(high)} rad"
