"""Tables inside arrays, dictionaries, MATLAB structs and JSON objects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.facts import Fact
from flexspline.logs.table import Table

__all__ = ["from_array", "from_value", "records_at"]


def from_array(array: NDArray[Any], label: str) -> Table:
    """Return the table in a structured array, or in a matrix of any orientation.

    The longer side of a matrix is time. Columns are views: a memory map stays on disk.
    """
    if array.dtype.names:
        flat = array.reshape(-1)
        return Table(
            label,
            tuple(flat[name] for name in array.dtype.names),
            array.dtype.names,
            notes=("structured array",),
        )
    if array.ndim == 1:
        array = array[:, np.newaxis]
    if array.ndim != 2:
        raise InputError(
            f"{label}: an array of shape {array.shape} is no table; "
            "give two dimensions, rows and columns"
        )
    note = f"matrix of {array.shape[0]} × {array.shape[1]}"
    if array.shape[0] < array.shape[1]:
        array, note = array.T, note + ", one row for each channel"
    return Table(label, tuple(array[:, i] for i in range(array.shape[1])), notes=(note,))


def from_value(value: Any, label: str, variable: str | None) -> Table:
    """Return the table in nested dictionaries of arrays, at the dotted path `variable`.

    Without a path: the only matrix, else all vectors by their names; single values are facts.
    """
    if variable is not None:
        value = _at(value, label, variable)
    if not isinstance(value, Mapping):
        return from_array(np.asanyarray(value), label)
    found = {str(name): _array(inner) for name, inner in value.items()}
    known = {name: array for name, array in found.items() if array is not None}
    facts = {name: _single(array) for name, array in known.items() if array.size == 1}
    arrays = {name: array for name, array in known.items() if array.size > 1}
    matrices = [name for name, array in arrays.items() if array.ndim > 1 or array.dtype.names]
    vectors = [name for name in arrays if name not in matrices]
    if len(matrices) == 1 and not vectors:
        table = from_array(arrays[matrices[0]], label)
        return Table(table.label, table.data, table.names, facts, table.notes)
    if not vectors:
        inside = [str(name) for name in value]
        if len(inside) == 1 and isinstance(value[inside[0]], Mapping):
            return from_value(value[inside[0]], label, None)
        raise InputError(
            f"{label}: no table is seen at once in {listed(inside)}; "
            "name the right part with variable="
        )
    return Table(
        label,
        tuple(arrays[name] for name in vectors),
        tuple(vectors),
        facts,
        notes=("arrays " + listed(vectors),),
    )


def records_at(value: Any, label: str, variable: str | None) -> Table:
    """Return the table in a JSON value: a list of records, or an object that holds one.

    The other entries of the object are facts. An object of lists is a table of columns.
    """
    facts: dict[str, Fact] = {}
    if isinstance(value, dict):
        facts = {key: inner for key, inner in value.items() if isinstance(inner, (str, int, float))}
        if variable is None:
            lists = [key for key, inner in value.items() if _is_records(inner)]
            if len(lists) > 1:
                raise InputError(
                    f"{label}: has lists of records under {listed(lists)}; "
                    "name the right one with variable="
                )
            variable = lists[0] if lists else None
        if variable is not None:
            value = _at(value, label, variable)
    if isinstance(value, dict):
        table = from_value({k: v for k, v in value.items() if k not in facts}, label, None)
        return Table(table.label, table.data, table.names, facts, table.notes)
    if not _is_records(value):
        return from_value(value, label, None)
    frame = pandas.DataFrame.from_records(value)
    note = "records" + (f" under '{variable}'" if variable else "")
    return Table(
        label,
        tuple(frame[name].to_numpy() for name in frame),
        tuple(str(name) for name in frame),
        facts,
        (note,),
    )


def _is_records(value: Any) -> bool:
    return isinstance(value, list) and len(value) > 0 and all(isinstance(v, dict) for v in value)


def _at(value: Any, label: str, path: str) -> Any:
    for part in path.split("."):
        names = list(value) if isinstance(value, Mapping) else []
        if part not in names:
            raise InputError(
                f"{label}: no variable '{path}'{did_you_mean(part, names)}; "
                f"there is {listed(names)}"
            )
        value = value[part]
    return value


def _array(value: Any) -> NDArray[Any] | None:
    """Return a value as an array, vectors in one dimension, or None if it is not one."""
    if isinstance(value, Mapping):
        return None
    try:
        array = np.asarray(value)
    except ValueError:  # lists of unequal length
        return None
    if array.ndim == 2 and 1 in array.shape:
        array = array.reshape(-1)
    return None if array.dtype == object and array.ndim != 1 else array


def _single(array: NDArray[Any]) -> Fact:
    value = array.reshape(-1)[0]
    value = value.item() if hasattr(value, "item") else value
    return value if isinstance(value, (str, int, float)) else str(value)
