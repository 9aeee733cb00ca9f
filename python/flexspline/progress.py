"""How far a long computation is, for somebody who watches standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Final, TextIO

if TYPE_CHECKING:
    from tqdm import tqdm

__all__ = ["Progress", "above_progress"]

PATIENCE: Final = 1.0
"""Seconds of work of which nothing is shown: what takes less leaves no line behind."""


class Progress:
    """One line that is written again and again, and is left, with a line end, when all is done.

    So what is printed next, a verdict or an error, begins a line of its own; in a terminal that was
    made narrower and in a transcript too, where a line that is wiped with blanks would stay.

    Parameters
    ----------
    title : what is done; stands in the line that is left.
    shown : whether anything is to be shown at all.
    total : of steps, where it is known.
    unit : of steps; an empty one shows the time alone.
    usual : share of the work that is done, as a rule, when something is said. From the largest of
        these so far it is told how long the rest may take.
    """

    def __init__(
        self,
        title: str,
        shown: bool,
        *,
        total: int | None = None,
        unit: str = "",
        usual: Mapping[str, float] | None = None,
    ) -> None:
        self._title, self._usual = title, usual or {}
        self._bar = _bar(title, total, unit) if shown else None
        self._begun, self._share, self._whole = time.monotonic(), 0.0, 0.0

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.set_description_str(self._title, refresh=False)
            self._bar.close()

    def step(self) -> None:
        """Count one step as done."""
        if self._bar is not None:
            self._bar.update()

    def say(self, what: str) -> None:
        """Say what is done now."""
        if self._bar is not None:
            self._bar.set_description_str(what + self._left(what), refresh=False)
            self._bar.update(0)

    def _left(self, what: str) -> str:
        """How long the rest may take, in words; "" where that is not known, or little."""
        spent, share = time.monotonic() - self._begun, self._usual.get(what, 0.0)
        if share > self._share:
            self._share, self._whole = share, spent / share
        left = self._whole - spent
        if left < PATIENCE:
            return ""
        return (
            f", about {left:.0f} s left" if left < 90.0 else f", about {left / 60.0:.0f} min left"
        )


def _bar(title: str, total: int | None, unit: str) -> tqdm[None]:
    from tqdm import tqdm

    counted = total is not None or unit
    style = None if counted else "{desc}: {elapsed}"
    return tqdm(
        desc=title, total=total, unit=unit, bar_format=style, miniters=0, delay=PATIENCE, leave=True
    )


@contextmanager
def above_progress(stream: TextIO) -> Iterator[None]:
    """Let something be printed above a line of progress, where one is shown."""
    loaded = sys.modules.get("tqdm")  # else no progress was ever shown
    with nullcontext() if loaded is None else loaded.tqdm.external_write_mode(file=stream):
        yield
