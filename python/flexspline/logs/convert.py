"""A foreign file and a map in TOML become a run: channels in SI units, facts, one table."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.files import atomic_writer
from flexspline.logs.log import Log
from flexspline.logs.read import read_log

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["convert", "read_map", "write_log"]

SECTIONS: Final = ("facts", "columns", "read")
READ_KEYS: Final = (
    "rate",
    "repair",
    "header",
    "separator",
    "decimal",
    "encoding",
    "variable",
    "drop_rows",
)


def convert(
    foreign: str | os.PathLike[str],
    columns: str | os.PathLike[str],
    out: str | os.PathLike[str],
    **overruling: Any,
) -> Log:
    """Read `foreign` by the map in the TOML file `columns`, write the run to `out`, return it.

    A map has three sections, each of which may be left out::

        [read]                     # how the file is written, and repairs: arguments of read_log
        rate = 1000
        separator = "whitespace"
        repair = ["unwrap"]

        [facts]
        gear_ratio = 100
        joint = "7"

        [columns]                  # channel = name, number from 0, or all of a ColumnSource
        output_position = 1
        motor_current = {source = 5, unit = "A", sign = -1}

    Parameters
    ----------
    foreign, columns, out : path
        The file to read, the map, the CSV file to write (whole or not at all).
    **overruling
        Arguments of `read_log` that overrule the map, such as `gear_ratio`.

    Raises
    ------
    InputError
        Where map or file are wrong; `out` is then untouched.
    """
    sections = read_map(columns)
    log = read_log(
        foreign,
        **{
            **sections["read"],
            "columns": sections["columns"],
            "facts": sections["facts"],
            **overruling,
        },
    )
    write_log(log, out)
    return log


def read_map(path: str | os.PathLike[str]) -> dict[str, dict[str, Any]]:
    """Return the sections `read`, `facts` and `columns` of a map file, empty where left out.

    Raises
    ------
    InputError
        For a missing file, bad TOML, an unknown section or key.
    """
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path}: the column map cannot be read ({error.strerror}); "
            "give the path of a TOML file"
        ) from error
    except ValueError as error:  # bad TOML or bad UTF-8
        raise InputError(f"{path}: the column map is not TOML ({error}); correct it") from error
    _require_known(path, "section", content, SECTIONS)
    sections = {name: content.get(name, {}) for name in SECTIONS}
    for name, section in sections.items():
        if not isinstance(section, dict):
            raise InputError(f"{path}: '{name}' is no section; write [{name}] on a line of its own")
    _require_known(path, "key of [read]", sections["read"], READ_KEYS)
    return sections


def write_log(log: Log, path: str | os.PathLike[str]) -> None:
    """Write a log as CSV: facts as ``# key: value`` lines, channel names, numbers.

    Each number is written with as many digits as it takes to read the same number again.
    The file appears whole or not at all.
    """
    with atomic_writer(path) as file:
        for key, value in log.facts.items():
            plain = re.sub(r"[:,;\s]+", " ", key)
            file.write(f"# {plain}: {' '.join(str(value).split())}\n".encode())
        log.to_frame().to_csv(file, index=False, lineterminator="\n")


def _require_known(
    path: str | os.PathLike[str], what: str, given: Mapping[str, Any], known: tuple[str, ...]
) -> None:
    for key in given:
        if key not in known:
            raise InputError(
                f"{path}: '{key}' is no {what}{did_you_mean(key, known)}; give {listed(known)}"
            )
