"""Packed files: .gz, .bz2, .xz and .zip, unfolded in pieces up to a limit of memory."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import struct
import zipfile
import zlib
from collections.abc import Callable
from typing import IO, Any, Final

from flexspline.errors import InputError
from flexspline.logs.memory import require_memory

__all__ = ["BROKEN", "PACKED", "unpacked"]

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
