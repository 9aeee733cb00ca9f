"""A log, or its pieces one after the other, as a file: CSV in SI units, or Parquet.

What is written here `read_log` reads without a map: columns have the names of channels, and facts
stand on top, in a Parquet file in its metadata.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final

from flexspline.errors import InputError
from flexspline.files import atomic_writer, write_columns
from flexspline.logs.channels import CHANNELS

if TYPE_CHECKING:
    from flexspline.logs.log import Log

__all__ = ["write_log", "write_pieces"]

PARQUET: Final = (".parquet", ".pq")


def write_log(log: Log, path: str | os.PathLike[str]) -> None:
    """Write a log as CSV: facts as ``# key: value`` lines, channel names, numbers.

    Each number is written with as many digits as it takes to read the same number again. A path
    that ends in .parquet or .pq is written as such a file (``flexspline[parquet]``). The file
    appears whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written, or pyarrow is not there.
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
    parquet = Path(path).suffix.lower() in PARQUET
    write = _parquet_writer(path) if parquet else _write_csv
    with atomic_writer(path) as file:
        write(first, chain([first], several), file)


def _write_csv(first: Log, pieces: Iterator[Log], file: BinaryIO) -> None:
    for key, value in _facts(first).items():
        file.write(f"# {key}: {value}\n".encode())
    for piece in pieces:
        write_columns(piece.columns, file, head=piece is first)


def _facts(log: Log) -> dict[str, str]:
    """Return the facts as they stand in a file, each on one line."""
    return {
        re.sub(r"[:,;\s]+", " ", key): " ".join(str(value).split())
        for key, value in log.facts.items()
    }


def _parquet_writer(path: str | os.PathLike[str]) -> Callable[[Log, Iterator[Log], BinaryIO], None]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ModuleNotFoundError as error:
        raise InputError(
            f"{path}: {error.name} is needed to write it; pip install 'flexspline[parquet]', or "
            "give a name that ends in .csv"
        ) from error

    def write(first: Log, pieces: Iterator[Log], file: BinaryIO) -> None:
        fields = [
            pyarrow.field(name, pyarrow.float64(), metadata={"unit": CHANNELS[name].unit})
            for name in first.columns
        ]
        schema = pyarrow.schema(fields, metadata=_facts(first))
        with parquet.ParquetWriter(file, schema) as made:
            for piece in pieces:
                made.write_table(pyarrow.table(dict(piece.columns), schema=schema))

    return write
