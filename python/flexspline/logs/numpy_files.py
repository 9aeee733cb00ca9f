"""Files of NumPy: one array (.npy) or several (.npz), of which nothing is ever unpickled.

The head of an array says how large it is. It is believed only as far as the file goes: an array of
a hundred bytes may call itself a terabyte.
"""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from flexspline.errors import InputError, shortened
from flexspline.logs.memory import require_memory

__all__ = ["read_numpy"]

ZIP: Final = b"PK\x03\x04"


def read_numpy(file: Path | io.BytesIO, label: str, most: int) -> Any:
    """Return the array in a file, left on disk, or the arrays of an .npz file by their names.

    Parameters
    ----------
    file : path of an .npy file, or the bytes of either.
    label : what an error calls it.
    most : bytes that the arrays of an .npz file may unfold to.

    Raises
    ------
    InputError
        Where it is damaged, holds objects, promises more numbers than it has, or unfolds to more.
    """
    try:
        if isinstance(file, Path):
            return _from_path(file, label, most)
        content = file.getbuffer()
        if bytes(content[:4]) == ZIP:
            return _archive(file, label, most)
        return _array(io.BytesIO(content), len(content))
    except InputError:
        raise
    except Exception as error:  # numpy, zipfile and zlib raise many kinds on a damaged file
        raise InputError(
            f"{label}: not a NumPy file of numbers ({error}); "
            "save it again with numpy.save or numpy.savez"
        ) from error


def _from_path(path: Path, label: str, most: int) -> Any:
    """The array of an .npy file, left on disk; or the arrays of an .npz file that is called so."""
    with path.open("rb") as file:
        zipped = file.read(len(ZIP)) == ZIP
        file.seek(0)
        if zipped:
            return _archive(file, label, most)
        _require_held(file, path.stat().st_size)
    return np.load(path, mmap_mode="r", allow_pickle=False)


def _archive(file: IO[bytes], label: str, most: int) -> dict[str, Any]:
    found = {}
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        require_memory(sum(member.file_size for member in members), most, label)
        for member in members:
            with archive.open(member) as stream:
                found[member.filename.removesuffix(".npy")] = _array(stream, member.file_size)
    return found


def _array(stream: IO[bytes], size: int) -> Any:
    """The array of a stream of so many bytes, read once its head is seen to be true."""
    start = stream.tell()
    _require_held(stream, size)
    stream.seek(start)
    return np.lib.format.read_array(stream, allow_pickle=False)


def _require_held(stream: IO[bytes], size: int) -> None:
    """Refuse the head of an array of objects, or of more bytes than the file has."""
    version = np.lib.format.read_magic(stream)
    reader = {(1, 0): np.lib.format.read_array_header_1_0}.get(
        version, np.lib.format.read_array_header_2_0
    )
    shape, _, kind = reader(stream)
    if kind.hasobject:
        raise ValueError("it holds objects")
    if any(isinstance(length, bool) or length < 0 for length in shape):
        raise ValueError("its head has a shape that no array has")
    wanted = math.prod(shape) * kind.itemsize
    if wanted > size:
        raise ValueError(f"its head promises {shortened(wanted, 20)} bytes and it has {size}")
