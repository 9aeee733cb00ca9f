"""The C++ header of an effect of the user's own: compiled on this machine when it is given.

The header keeps the contract of the catalogue's (`flexspline/effects/effect.hpp`): of an effect
`hump` the file is `hump.hpp` and the struct `flexspline::Hump`, a template of the number type, with
the name, terms, channels and shapes of the Python function. It includes no other file of the
user's, so that it can go beside an exported header.

Only a path that a caller gives is compiled; a model's file has none.
"""

from __future__ import annotations

import ctypes
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import EffectInfo
from flexspline.errors import InputError, listed
from flexspline.files import refuse_special
from flexspline.programs import STRICT, call, firmware_folder, host_compiler, include_folder

__all__ = ["Header", "compiled"]

Array = NDArray[np.float64]

POINTER = ctypes.POINTER(ctypes.c_double)


@dataclass(frozen=True)
class Header:
    """A header and the library that was made of it.

    `path`: as it was given. `text`: what was compiled. `reads`, `shapes`: in the header's order.
    """

    path: Path
    text: bytes
    reads: tuple[str, ...]
    shapes: tuple[str, ...]
    terms: int
    library: Any = field(repr=False, compare=False)

    @property
    def name(self) -> str:
        """Name of the file, as an exported header includes it."""
        return self.path.name

    def rows(self, channels: Mapping[str, Array], shapes: Mapping[str, float], size: int) -> Array:
        """Return the rows of the compiled effect, (size, terms)."""
        columns = [np.ascontiguousarray(channels[name], dtype=np.float64) for name in self.reads]
        values = np.array([shapes[name] for name in self.shapes])
        made = np.empty((size, self.terms))
        pointers = (POINTER * len(columns))(*map(_pointer, columns))
        self.library.flexspline_own_rows(size, pointers, _pointer(values), _pointer(made))
        return made


def compiled(path: str | os.PathLike[str], info: EffectInfo) -> Header:
    """Compile the header of an effect, and hold it to what the Python function says of itself.

    Raises
    ------
    InputError
        Where the file is not there or is called otherwise than the effect, the compiler is missing
        or refuses, or the header has other terms, channels or shapes.
    """
    file, label = Path(path), f"effect '{info.name}'"
    if file.name != f"{info.name}.hpp":
        raise InputError(f"{label}: its header is called {file.name}; call it {info.name}.hpp")
    refuse_special(file, "a C++ header")
    try:
        text = file.read_bytes()
    except OSError as error:
        raise InputError(
            f"{label}: its header {file} cannot be read ({error.strerror}); give a C++ header"
        ) from error
    with tempfile.TemporaryDirectory(prefix="flexspline-own-", ignore_cleanup_errors=True) as name:
        library = _library(file.resolve(), Path(name), info)
    said = [line.split("\t") for line in library.flexspline_own_description().decode().split("\n")]
    _require_same(info, file, said)
    reads, shapes = _named(said, "reads"), _named(said, "shape")
    return Header(file, text, reads, shapes, len(info.terms), library)


def _library(file: Path, folder: Path, info: EffectInfo) -> Any:
    """The header as a library, which stays loaded when its file is gone.

    Its names are hidden: the constants of another header's `Hump` would be taken for its own.
    """
    struct = "".join(word.capitalize() for word in info.name.split("_"))
    made = folder / f"{info.name}.so"
    options = ["-O2", "-fPIC", "-shared", "-fvisibility=hidden"]
    options += [f"-DFLEXSPLINE_OWN={struct}", f"-I{include_folder()}"]
    source = firmware_folder() / "own" / "rows.cpp"
    call(
        [host_compiler(), *STRICT.split(), *options, "-include", file, source, "-o", made],
        folder,
        does=f"effect '{info.name}': compiling {file}, struct flexspline::{struct}",
        remedy="correct the header",
    )
    library = ctypes.CDLL(str(made))
    library.flexspline_own_description.restype = ctypes.c_char_p
    library.flexspline_own_rows.argtypes = [
        ctypes.c_size_t,
        ctypes.POINTER(POINTER),
        POINTER,
        POINTER,
    ]
    library.flexspline_own_rows.restype = None
    return library


def _pointer(values: Array) -> Any:
    return values.ctypes.data_as(POINTER)


def _named(said: Sequence[Sequence[str]], what: str) -> tuple[str, ...]:
    return tuple(line[1] for line in said if line[0] == what)


def _require_same(info: EffectInfo, file: Path, said: Sequence[Sequence[str]]) -> None:
    """Refuse a header that says something else than the function beside it."""
    units = [(line[0], f"{line[1]} [{line[2]}]") for line in said[1:]]
    pairs = {
        "the name": ([said[0][1]], [info.name]),
        "the channels": (sorted(_named(said, "reads")), sorted(info.reads)),
        "the terms": (
            [text for what, text in units if what == "term"],
            [f"{term.name} [{term.unit}]" for term in info.terms],
        ),
        "the shapes": (
            [text for what, text in units if what == "shape"],
            [f"{shape.name} [{shape.unit}]" for shape in info.shapes],
        ),
    }
    for what, (there, here) in pairs.items():
        if there != here:
            raise InputError(
                f"effect '{info.name}': its header {file} has {what} {listed(there)}, and the "
                f"Python function {listed(here)}; make them the same, in the same order"
            )
