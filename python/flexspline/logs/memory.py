"""How much memory a log may take: by default half of what is free when it is read.

A packed file says nothing of its size before it is unfolded, and a few bytes may unfold to
terabytes; so does a head that promises more numbers than the file holds.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Final

from flexspline.errors import InputError

__all__ = ["GIGABYTE", "memory_limit", "require_memory"]

GIGABYTE: Final = 1e9  # bytes
UNKNOWN: Final = 8 * GIGABYTE  # bytes, taken for free where the system does not tell
SHARE: Final = 0.5  # of what is free: reading text takes a copy beside the numbers


def memory_limit(gigabytes: float | None) -> int:
    """Return how many bytes a log may take: what is asked for, or half of what is free.

    Raises
    ------
    InputError
        For a number that is not above zero.
    """
    if gigabytes is None:
        return int(SHARE * _free())
    if not (isinstance(gigabytes, (int, float)) and 0.0 < gigabytes < 1e9):
        raise InputError(f"max_memory is {gigabytes!r}; give gigabytes above zero")
    return int(gigabytes * GIGABYTE)


MORE: Final = (
    "give max_memory (--max-memory GB) if that is right, or look whether the file is what it "
    "should be"
)


def require_memory(wanted: float, most: float, label: str, advice: str = MORE) -> None:
    """Refuse what takes more than `most` bytes.

    `label` is what the sentence calls it, `advice` what it says to do.
    """
    if wanted > most:
        raise InputError(
            f"{label}: takes {wanted / GIGABYTE:.3g} GB of memory or more, of which "
            f"{most / GIGABYTE:.3g} GB may be taken; {advice}"
        )


def _free() -> float:
    """Bytes that are free, by Linux; of all there is, where another system tells only that."""
    try:
        found = re.search(r"^MemAvailable:\s+(\d+) kB", Path("/proc/meminfo").read_text(), re.M)
        if found:
            return 1024.0 * int(found[1])
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (OSError, ValueError, AttributeError):
        return UNKNOWN
