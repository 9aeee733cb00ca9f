"""What a foreign file holds before any of it is given a meaning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.facts import Fact

__all__ = ["Table", "require_droppable"]


def require_droppable(label: str, count: int, rows: int) -> None:
    """Refuse a number of rows to drop of which two are not left."""
    if not (isinstance(count, int) and 0 <= count <= max(rows - 2, 0)):
        raise InputError(
            f"{label}: drop_rows is {count!r} of {rows} rows; give a whole number that leaves two"
        )


@dataclass(frozen=True)
class Table:
    """Columns, with names where the file has them.

    `lines` is the file line of each row (the first is 1), where the file has lines.
    """

    label: str
    data: tuple[NDArray[Any], ...]
    names: tuple[str, ...] | None = None
    facts: Mapping[str, Fact] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    lines: NDArray[np.intp] | None = None

    @property
    def rows(self) -> int:
        """Number of rows of data, in the longest column."""
        return max((len(column) for column in self.data), default=0)

    def checked(self) -> Table:
        """Return this table if it can be a log: one with two rows of data or more."""
        if not self.data or self.rows == 0:
            raise InputError(f"{self.label}: no rows of data; record the run again")
        if self.rows < 2:
            raise InputError(f"{self.label}: only one row of data; a log needs two or more")
        return self

    def without_first(self, count: int) -> Table:
        """Return the table without its first `count` rows."""
        require_droppable(self.label, count, self.rows)
        return replace(
            self,
            data=tuple(column[count:] for column in self.data),
            lines=None if self.lines is None else self.lines[count:],
        )

    def title(self, number: int) -> str:
        """Return what a sentence calls this column."""
        return f"column '{self.names[number]}'" if self.names else f"column {number}"

    def place(self, row: int) -> str:
        """Return what a sentence calls the row with this index: its number counts from 1."""
        line = "" if self.lines is None else f" (line {self.lines[row]})"
        return f"data row {row + 1}{line}"

    def index(self, source: str | int) -> int:
        """Return the number of a column given by name or number.

        Raises
        ------
        InputError
            Where there is no such column, or more than one of that name.
        """
        width = len(self.data)
        if isinstance(source, int):
            if not 0 <= source < width:
                raise InputError(
                    f"{self.label}: no column {source}; "
                    f"its {width} columns are numbered from 0 to {width - 1}"
                )
            return source
        if self.names is None:
            raise InputError(
                f"{self.label}: no column '{source}', for its columns have no names; "
                f"give a number from 0 to {width - 1}"
            )
        found = [number for number, name in enumerate(self.names) if name == source]
        if not found:
            near = did_you_mean(source, self.names)
            raise InputError(
                f"{self.label}: no column '{source}'{near}; it has {listed(self.names)}"
            )
        if len(found) > 1:
            raise InputError(
                f"{self.label}: {len(found)} columns are named '{source}' "
                f"(numbers {listed(found)}); give the number of the right one"
            )
        return found[0]
