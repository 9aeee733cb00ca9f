"""A log, or its pieces one after the other, as a file: CSV in SI units, or another format.

What is written here `read_log` reads without a map: columns have the names of channels, and facts
stand on top.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from flexspline.errors import InputError
from flexspline.files import atomic_writer, write_columns
from flexspline.logs.formats import format_named

if TYPE_CHECKING:
    from flexspline.logs.log import Log

__all__ = ["write_log", "write_pieces"]


def write_log(log: Log, path: str | os.PathLike[str]) -> None:
    """Write a log as CSV: facts as ``# key: value`` lines, channel names, numbers.

    Each number is written with as many digits as it takes to read the same number again. A path
    that ends like one of another format that is written too (see `read_log`) is such a file. The
    file appears whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written, or the library of its format is not there.
    """
    write_pieces([log], path)


def write_pieces(pieces: Iterable[Log], path: str | os.PathLike[str]) -> None:
    """Write pieces of one log as `write_log` writes the whole; one of them is held at a time.

    Raises
    ------
    InputError
        As `write_log`.
    """
    several = iter(pieces)
    first = next(several)
    form = format_named(Path(path))
    write = (form and form.write) or _write_csv
    try:
        with atomic_writer(path) as file:
            write(_facts(first), first, chain([first], several), file)
    except ModuleNotFoundError as error:
        if form is None or not form.extra:
            raise
        raise InputError(
            f"{path}: {error.name} is needed to write it; {form.install}, or give a name that ends "
            "in .csv"
        ) from error


def _write_csv(facts: Mapping[str, str], first: Log, pieces: Iterator[Log], file: BinaryIO) -> None:
    for key, value in facts.items():
        file.write(f"# {key}: {value}\n".encode())
    for piece in pieces:
        write_columns(piece.columns, file, head=piece is first)


def _facts(log: Log) -> dict[str, str]:
    """Return the facts as they stand in a file, each on one line."""
    return {
        re.sub(r"[:,;\s]+", " ", key): " ".join(str(value).split())
        for key, value in log.facts.items()
    }
