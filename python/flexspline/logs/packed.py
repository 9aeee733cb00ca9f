"""Files that may be larger than they look: packed ones and NumPy's, within a limit of memory.

A log may take so much memory, by default half of what is free when it is read. A packed file (.gz,
.bz2, .xz, .zip) says nothing of its size before it is unfolded, and a few bytes may unfold to
terabytes: it is unfolded in pieces.

A file of NumPy is one array (.npy) or several (.npz), of which nothing is ever unpickled. The head
of an array says how large it is. It is believed only as far as the file goes: an array of a hundred
bytes may call itself a terabyte.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import math
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from flexspline.errors import InputError, shortened

__all__ = ["PACKED", "memory_limit", "read_numpy", "require_memory", "unpacked"]


PIECE: Final = 1 << 22  # bytes that are unfolded at a time

PACKED: Final[dict[str, Callable[[IO[bytes]], Any]]] = {
    ".gz": lambda file: gzip.GzipFile(fileobj=file),
    ".bz2": bz2.BZ2File,
    ".xz": lzma.LZMAFile,
    ".zip": lambda file: _only_member(file),
}
BROKEN: Final[tuple[type[Exception], ...]] = (
    OSError, EOFError, lzma.LZMAError, zipfile.BadZipFile, zlib.error, struct.error, RuntimeError,
)  # fmt: skip

ZIP: Final = b"PK\x03\x04"

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


def unpacked(content: bytes, packed: str, label: str, most: int) -> bytes:
    """Return what a packed file holds.

    Parameters
    ----------
    content : of the file.
    packed : a key of `PACKED`, or "" for a file that is not packed.
    label : what an error calls it.
    most : bytes that it may unfold to.

    Raises
    ------
    InputError
        Where it is damaged, cut short, empty, or unfolds to more.
    """
    if not packed:
        return content
    whole = bytearray()
    try:
        with PACKED[packed](io.BytesIO(content)) as file:
            while piece := file.read(PIECE):
                require_memory(len(whole) + len(piece), most, label)
                whole += piece
    except BROKEN as error:
        raise InputError(f"{label}: cannot be unpacked ({error}); copy it again") from error
    if not whole:
        raise InputError(f"{label}: the packed file is empty; record or copy it again")
    return bytes(whole)


def _only_member(file: Any) -> IO[bytes]:
    archive = zipfile.ZipFile(file)
    files = [name for name in archive.namelist() if not name.endswith("/")]
    if len(files) != 1:
        raise zipfile.BadZipFile(f"it holds {len(files)} files where one is wanted")
    return archive.open(files[0])


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
