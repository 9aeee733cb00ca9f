"""Tables of other libraries in memory: pandas, polars, xarray.

Who has one has imported its library: none is imported to ask. Units are those of attributes: of
pandas `frame.attrs["units"]`, a name of a column to its unit, of xarray each variable's own; polars
has none. Other attributes that are numbers or short text are facts.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.logs.arrow_files import short_facts, stated_units
from flexspline.logs.columns import to_si
from flexspline.logs.one_clock import with_time
from flexspline.logs.table import Series, Table
from flexspline.logs.units import canonical_unit

if TYPE_CHECKING:
    import pandas

__all__ = ["from_frame", "is_frame"]


def is_frame(source: Any) -> bool:
    """Whether that is a table of pandas, polars or xarray."""
    return _library_of(source) is not None


def from_frame(source: Any) -> Table:
    """Return the columns of a table of pandas, polars or xarray.

    Raises
    ------
    InputError
        Where an array of xarray has more dimensions than two, or two clocks are not told.
    """
    return {"pandas": _from_pandas, "polars": _from_polars, "xarray": _from_xarray}[
        str(_library_of(source))
    ](source)


def _library_of(source: Any) -> str | None:
    for library, name in (("pandas", "DataFrame"), ("polars", "DataFrame"), ("xarray", "Dataset")):
        kind = getattr(sys.modules.get(library), name, None)
        if kind is not None and isinstance(source, kind):
            return library
    return None


def _from_pandas(frame: pandas.DataFrame) -> Table:
    if frame.index.name is not None and frame.index.name not in frame.columns:
        frame = frame.reset_index()
    data = tuple(frame.iloc[:, number].to_numpy(copy=True) for number in range(frame.shape[1]))
    named = not all(isinstance(name, int) for name in frame.columns)
    names = tuple(str(name) for name in frame.columns) if named else None
    attributes = {str(key): value for key, value in frame.attrs.items()}
    stated = stated_units(attributes)
    return Table(
        "DataFrame",
        data,
        names,
        short_facts(attributes),
        ("columns " + listed(frame.columns),),
        units=tuple(stated.get(name) for name in names) if names and stated else None,
    )


def _from_polars(frame: Any) -> Table:
    data = tuple(np.array(column.to_numpy()) for column in frame.get_columns())
    return Table("DataFrame", data, tuple(frame.columns), notes=("columns of polars",))


def _from_xarray(dataset: Any) -> Table:
    found = {str(name): dataset[name] for name in dataset.variables}
    wide = [array for array in found.values() if array.ndim > 1]
    over = [str(array.name) for array in wide if array.ndim > 2]
    if over:
        raise InputError(
            f"Dataset: '{over[0]}' has {dataset[over[0]].ndim} dimensions, of which a channel has "
            "one; select the others (isel)"
        )
    labels = {min(array.dims, key=lambda dim: dataset.sizes[dim]) for array in wide}
    clocks = [dim for dim in dataset.sizes if dim not in labels]
    facts = {name: array.item() for name, array in found.items() if array.ndim == 0}
    columns = [
        column
        for name, array in found.items()
        if set(array.dims) & set(clocks) and (len(clocks) == 1 or name not in clocks)
        for column in _columns_of(array, labels)
    ]
    several = len(clocks) > 1
    made = Table(
        "Dataset",
        tuple(values for _, values, _ in columns),
        tuple(name for name, _, _ in columns),
        short_facts({**dataset.attrs, **facts}),
        ("variables of xarray",),
        units=tuple(stated_units(array.attrs).get("") for _, _, array in columns),
        series=tuple(_series(dataset, dim) for dim in clocks) if several else (),
        of_series=tuple(clocks.index(_time_of(array, labels)) for _, _, array in columns)
        if several
        else (),
    )
    return with_time(made)


def _time_of(array: Any, labels: set[Any]) -> Any:
    return next(dim for dim in array.dims if dim not in labels)


def _columns_of(array: Any, labels: set[Any]) -> list[tuple[str, NDArray[Any], Any]]:
    """Name, values and array of each column of an array, which has a second dimension or none."""
    if array.ndim == 1:
        return [(str(array.name), np.asarray(array.values), array)]
    array = array.transpose(_time_of(array, labels), ...)
    dim = array.dims[1]
    titles = array.coords[dim].values if dim in array.coords else range(array.sizes[dim])
    values = np.asarray(array.values)
    return [(f"{array.name}[{title}]", values[:, k], array) for k, title in enumerate(titles)]


def _series(dataset: Any, dim: Any) -> Series:
    """Return the instants of a dimension, which are its coordinate."""
    if dim not in dataset.coords or dataset.coords[dim].dtype.kind not in "biufM":
        raise InputError(
            f"Dataset: dimension '{dim}' has no coordinate of times, and cannot be laid beside "
            "others; give it one (assign_coords)"
        )
    coordinate = dataset.coords[dim]
    stamps = np.asarray(coordinate.values)
    if stamps.dtype.kind != "M":
        unit = canonical_unit(stated_units(coordinate.attrs).get("", "s")) or "s"
        stamps = stamps * to_si("time", unit)[0]
    return Series(f"dimension '{dim}'", stamps)
