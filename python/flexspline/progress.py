"""How far a long computation is, for somebody who watches standard error."""

from __future__ import annotations

import sys
from collections.abc import Iterator
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
    """

    def __init__(
        self, title: str, shown: bool, *, total: int | None = None, unit: str = ""
    ) -> None:
        self._title = title
        self._bar = _bar(title, total, unit) if shown else None

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
            self._bar.set_description_str(what, refresh=False)
            self._bar.update(0)


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
