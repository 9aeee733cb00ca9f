"""From a file of any known format, or data in memory, to a table without meaning."""

from __future__ import annotations

import bz2
import gzip
import hashlib
import io
import json
import lzma
import os
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas

from flexspline.errors import InputError, listed
from flexspline.logs.delimited import Dialect, read_delimited
from flexspline.logs.log import Source
from flexspline.logs.matlab import read_matlab
from flexspline.logs.nested import from_array, from_value, records_at
from flexspline.logs.table import Table

__all__ = ["PACKED", "read_table"]

PACKED: Final[dict[str, Callable[[bytes], bytes]]] = {
    ".gz": gzip.decompress,
    ".bz2": bz2.decompress,
    ".xz": lzma.decompress,
    ".zip": lambda content: _only_member(content),
}
BROKEN: Final = (OSError, EOFError, lzma.LZMAError, zipfile.BadZipFile, zlib.error, RuntimeError)


def read_table(
    source: Any, variable: str | None, dialect: Dialect, drop_rows: int = 0
) -> tuple[Table, Source | None]:
    """Return what `source` holds, and where it comes from if it is a file.

    Parameters
    ----------
    source : path, ndarray, mapping of arrays or pandas.DataFrame
        The formats of `read_log`.
    variable : str, optional
        Name, or path with dots, of the part of a .mat, .npz or .json file that is the table.
    dialect : Dialect
        How text is written.
    drop_rows : int
        Rows at the start that are left out.

    Raises
    ------
    InputError
        Where the file is missing, empty, corrupt or holds no table.
    """
    if isinstance(source, (str, os.PathLike)):
        return _from_file(Path(source), variable, dialect, drop_rows)
    if isinstance(source, pandas.DataFrame):
        table = _from_frame(source)
    elif isinstance(source, np.ndarray):
        table = from_array(source, "array")
    elif isinstance(source, Mapping):
        table = from_value(dict(source), "dictionary", variable)
    else:
        raise _no_source(source)
    return table.checked().without_first(drop_rows), None


def _no_source(source: object) -> InputError:
    return InputError(
        f"a log cannot be read from a {type(source).__name__}; "
        "give a path, an array, a dictionary of arrays or a pandas DataFrame"
    )


def _from_file(
    path: Path, variable: str | None, dialect: Dialect, drop_rows: int
) -> tuple[Table, Source]:
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}; give the path of a log")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; record or copy it again")
    try:
        digest = _sha256(path)
        table = _opened(path, variable, dialect, drop_rows)
    except PermissionError as error:
        raise InputError(f"{path}: may not be read; change its permissions") from error
    return table, Source(str(path), digest, table.rows + drop_rows)


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def _opened(path: Path, variable: str | None, dialect: Dialect, drop_rows: int) -> Table:
    kind, packed = _kind(path)
    label = str(path)
    if kind == ".npy" and not packed:
        table = from_value(_numpy(path, label), label, variable)
    else:
        content = _unpacked(path.read_bytes(), packed, label)
        if kind not in (".npy", ".npz", ".mat", ".h5", ".hdf5", ".json"):
            return read_delimited(content, label, dialect, drop_rows).checked()
        table = _structured(content, kind, label, variable)
    return table.checked().without_first(drop_rows)


def _structured(content: bytes, kind: str, label: str, variable: str | None) -> Table:
    if kind in (".npy", ".npz"):
        return from_value(_numpy(io.BytesIO(content), label), label, variable)
    if kind == ".json":
        return _from_json(content, label, variable)
    return read_matlab(content, label, variable)


def _kind(path: Path) -> tuple[str, str]:
    """Return (".csv", ".gz") for run.csv.gz: what a file is, and how it is packed."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    packed = suffixes.pop() if suffixes and suffixes[-1] in PACKED else ""
    return (suffixes[-1] if suffixes else ""), packed


def _unpacked(content: bytes, packed: str, label: str) -> bytes:
    if not packed:
        return content
    try:
        content = PACKED[packed](content)
    except BROKEN as error:
        raise InputError(f"{label}: cannot be unpacked ({error}); copy it again") from error
    if not content:
        raise InputError(f"{label}: the packed file is empty; record or copy it again")
    return content


def _only_member(content: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = [name for name in archive.namelist() if not name.endswith("/")]
        if len(files) != 1:
            raise zipfile.BadZipFile(f"it holds {len(files)} files where one is wanted")
        return archive.read(files[0])


def _numpy(file: Path | io.BytesIO, label: str) -> Any:
    """Return the array in a file, left on disk, or the arrays of an .npz file."""
    try:
        loaded = np.load(file, mmap_mode="r" if isinstance(file, Path) else None)
        return loaded if isinstance(loaded, np.ndarray) else dict(loaded)
    except (*BROKEN, ValueError) as error:
        raise InputError(
            f"{label}: not a NumPy file of numbers ({error}); "
            "save it again with numpy.save or numpy.savez"
        ) from error


def _from_json(content: bytes, label: str, variable: str | None) -> Table:
    try:
        value = json.loads(content)
    except (ValueError, RecursionError) as error:  # no JSON, no text, endless digits or depth
        raise InputError(f"{label}: not JSON ({error}); export it again") from error
    if not isinstance(value, (dict, list)):
        raise InputError(f"{label}: holds no records; give a list of them, or an object with one")
    return records_at(value, label, variable)


def _from_frame(frame: pandas.DataFrame) -> Table:
    if frame.index.name is not None and frame.index.name not in frame.columns:
        frame = frame.reset_index()
    data = tuple(frame.iloc[:, number].to_numpy(copy=True) for number in range(frame.shape[1]))
    named = not all(isinstance(name, int) for name in frame.columns)
    names = tuple(str(name) for name in frame.columns) if named else None
    return Table("DataFrame", data, names, notes=("columns " + listed(frame.columns),))
