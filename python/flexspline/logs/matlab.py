"""MATLAB files: versions 4 to 7 by scipy, version 7.3 (which is HDF5) by h5py."""

from __future__ import annotations

import io
from typing import Any, Final

import h5py
import numpy as np
import scipy.io

from flexspline.errors import InputError
from flexspline.logs.nested import from_value
from flexspline.logs.table import Table

__all__ = ["read_matlab"]

HDF5: Final = b"\x89HDF\r\n\x1a\n"  # behind the 512 bytes of text that MATLAB puts first


def read_matlab(content: bytes, label: str, variable: str | None) -> Table:
    """Return the table in the bytes of a .mat (or plain HDF5) file.

    Parameters
    ----------
    content : bytes
        The file.
    label : str
        What an error calls it.
    variable : str, optional
        A variable, or a path with dots into structs, such as "run.data".

    Raises
    ------
    InputError
        Where the file is corrupt, or has no such variable, or no table there.
    """
    try:
        file = io.BytesIO(content)
        if any(content.startswith(HDF5, start) for start in (0, 512)):
            with h5py.File(file) as root:
                value = _group(root)
        else:
            value = {
                name: inner
                for name, inner in scipy.io.loadmat(file, simplify_cells=True).items()
                if not name.startswith("__")
            }
    except Exception as error:  # scipy and h5py raise many kinds on a corrupt file
        raise InputError(
            f"{label}: not a MATLAB file, or a corrupt one ({error}); save it again"
        ) from error
    return from_value(value, label, variable)


def _group(group: Any) -> dict[str, Any]:
    """Return the numbers in a group of HDF5 as nested dictionaries.

    MATLAB stores columns first, so each matrix comes transposed.
    """
    found: dict[str, Any] = {}
    for name, inner in group.items():
        if isinstance(inner, h5py.Group):
            if not name.startswith("#"):
                found[name] = _group(inner)
        elif inner.attrs.get("MATLAB_class") == b"char":
            found[name] = "".join(map(chr, np.asarray(inner).T.reshape(-1)))
        elif inner.dtype.kind in "fiub":
            found[name] = np.asarray(inner).T
    return found
