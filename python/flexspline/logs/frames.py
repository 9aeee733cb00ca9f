"""Tables of other libraries: pandas, polars, xarray and Arrow in memory, Parquet and Feather as
files.

Of files of Apache Arrow (Parquet, and Feather or Arrow IPC) and its tables in memory only columns
that become channels are read, one at a time. A column of structs is several, with a dot between the
names; one of lists of one length is several too, named as NumPy would reach them: ``q[0]``. Units
stand in the metadata of a field, or in pandas' attributes; all other short metadata of the file are
facts. Neither format can hold programs or lead to other files.

Who has a table of pandas, polars or xarray has imported its library: none is imported to ask. Units
are those of attributes: of pandas `frame.attrs["units"]`, a name of a column to its unit, of xarray
each variable's own; polars has none. Other attributes that are numbers or short text are facts.
"""

from __future__ import annotations

import io
import itertools
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.logs.channels import CHANNELS
from flexspline.logs.columns import to_si
from flexspline.logs.log import Fact, Log, parsed_fact
from flexspline.logs.one_clock import with_time
from flexspline.logs.packed import require_memory
from flexspline.logs.table import NUMBER, Later, Series, Table
from flexspline.logs.units import canonical_unit

if TYPE_CHECKING:
    import pandas

__all__ = [
    "from_frame",
    "is_frame",
    "read_feather",
    "read_parquet",
    "short_facts",
    "write_parquet",
]


UNIT_KEYS: Final = ("unit", "units", "Unit", "Units")
LONGEST_FACT: Final = 100  # characters: what is longer is no fact of a joint
LIST_LIMIT: Final = 64  # cells of a list that become columns
FOREIGN_KEYS: Final = ("pandas", "PANDAS", "ARROW:", "huggingface", "org.apache.")
"""Beginnings of keys under which libraries keep what is theirs."""


@dataclass(frozen=True)
class _Stored:
    """The columns of a file: rows in each of its groups, and how columns are read by their names.

    `whole`: a pyarrow.Table with a column; `group`: with the rows of one group; `head`: with the
    first row alone.
    """

    schema: Any
    groups: tuple[int, ...]
    whole: Callable[[str], Any]
    group: Callable[[str, int], Any]
    head: Callable[[str], Any]

    @property
    def rows(self) -> int:
        return sum(self.groups)


def read_parquet(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the table in a Parquet file, whose columns are read when they are asked for.

    Raises
    ------
    InputError
        Where it is damaged.
    """
    import pyarrow
    from pyarrow import parquet

    def whole(name: str) -> Any:
        with parquet.ParquetFile(file) as opened:
            return opened.read(columns=[name], use_threads=False)

    def group(name: str, number: int) -> Any:
        with parquet.ParquetFile(file, metadata=metadata) as opened:
            return opened.read_row_group(number, columns=[name], use_threads=False)

    def head(name: str) -> Any:
        with parquet.ParquetFile(file) as opened:
            batches = opened.iter_batches(1, columns=[name], use_threads=False)
            return pyarrow.Table.from_batches(itertools.islice(batches, 1), _only(schema, name))

    with _sound(label, "Parquet"), parquet.ParquetFile(file) as opened:
        schema, metadata = opened.schema_arrow, opened.metadata
        rows = (metadata.row_group(k).num_rows for k in range(metadata.num_row_groups))
        stored = _Stored(schema, tuple(rows), whole, group, head)
    return _table(stored, _Of(label, "Parquet", variable, most))


def read_feather(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the table in a Feather file (Arrow IPC), whose columns are read when asked for.

    Raises
    ------
    InputError
        Where it is damaged or of version 1.
    """
    import pyarrow

    def opened(fields: list[int] | None) -> Any:
        how = pyarrow.ipc.IpcReadOptions(included_fields=fields, use_threads=False)
        content = pyarrow.BufferReader(file.getbuffer()) if isinstance(file, io.BytesIO) else None
        return pyarrow.ipc.open_file(content or pyarrow.OSFile(str(file)), options=how)

    def column(name: str) -> Any:
        return opened([schema.get_field_index(name)])

    def group(name: str, number: int) -> Any:
        return pyarrow.Table.from_batches([column(name).get_batch(number)])

    with _sound(label, "Feather"):
        whole = opened(None)
        schema = whole.schema
        counted = opened([0]) if len(schema) else whole
        rows = (counted.get_batch(k).num_rows for k in range(counted.num_record_batches))
        stored = _Stored(
            schema,
            tuple(rows),
            lambda name: column(name).read_all(),
            group,
            lambda name: group(name, 0).slice(0, 1),
        )
    return _table(stored, _Of(label, "Feather", variable, most))


def write_parquet(
    facts: Mapping[str, str], first: Log, pieces: Iterator[Log], file: BinaryIO
) -> None:
    """Write pieces of a log, of which `first` is one: facts and units stand in the metadata."""
    import pyarrow
    from pyarrow import parquet

    fields = [
        pyarrow.field(name, pyarrow.float64(), metadata={"unit": CHANNELS[name].unit})
        for name in first.columns
    ]
    schema = pyarrow.schema(fields, metadata=facts)
    with parquet.ParquetWriter(file, schema) as made:
        for piece in pieces:
            made.write_table(pyarrow.table(dict(piece.columns), schema=schema))


@dataclass(frozen=True)
class _Of:
    """What file a table is of."""

    label: str
    kind: str
    variable: str | None
    most: int


@contextmanager
def _sound(label: str, kind: str) -> Iterator[None]:
    """Say of which file it is that pyarrow cannot read something."""
    import pyarrow

    try:
        yield
    except InputError:
        raise
    except (pyarrow.ArrowException, OSError, ValueError, MemoryError) as error:
        raise InputError(
            f"{label}: not a {kind} file, or a damaged one ({error}); write it again"
        ) from error


def _only(schema: Any, name: str) -> Any:
    import pyarrow

    return pyarrow.schema([schema.field(name)])


def _table(stored: _Stored, of: _Of) -> Table:
    schema = stored.schema
    if of.variable is not None:
        raise InputError(
            f"{of.label}: a {of.kind} file is one table; leave variable out, and give columns of "
            "a struct by their path, such as 'run.q'"
        )
    twice = [name for name in schema.names if schema.names.count(name) > 1]
    if twice:
        raise InputError(
            f"{of.label}: has two columns of the name '{twice[0]}'; write it again with a name "
            "for each"
        )
    attributes = _pandas_attributes(schema)
    beside = stated_units(attributes)
    names: list[str] = []
    data: list[Later] = []
    units: list[str | None] = []
    for each in schema:
        for path, pick in _leaves(each, stored, of):
            column = _Column(stored, each.name, path, pick, of)
            names.append(path)
            data.append(Later(stored.rows, column.whole, part=column.part))
            units.append(stated_units(_texts(each.metadata)).get("") or beside.get(path))
    facts = {key: value for key, value in _texts(schema.metadata).items()
             if not key.startswith(FOREIGN_KEYS)}  # fmt: skip
    return Table(
        of.label,
        tuple(data),
        tuple(names),
        short_facts({**facts, **attributes}),
        (f"{of.kind}, a table of {len(names)} columns",),
        units=tuple(units) if any(units) else None,
    )


Pick = Callable[[Any], Any]
"""From a pyarrow array of a top-level column to that of a part of it."""


def _leaves(field: Any, stored: _Stored, of: _Of) -> Iterator[tuple[str, Pick]]:
    """Name of each column that a field makes, and how its numbers are found in the field's."""
    from pyarrow import types

    def below(kind: Any, path: str, pick: Pick) -> Iterator[tuple[str, Pick]]:
        if types.is_struct(kind):
            for k in range(kind.num_fields):
                inner = kind.field(k)
                yield from below(inner.type, f"{path}.{inner.name}", partial(_field, pick, k))
        elif types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
            for k in range(min(width(pick), LIST_LIMIT)):
                yield from below(kind.value_type, f"{path}[{k}]", partial(_cell, pick, k, of))
        else:
            yield path, pick

    def width(pick: Pick) -> int:
        if not stored.rows:
            return 0
        with _sound(of.label, of.kind):
            cells = pick(stored.head(field.name).column(0).combine_chunks())
            return len(cells[0].as_py() or ())

    yield from below(field.type, field.name, lambda array: array)


def _field(pick: Pick, number: int, array: Any) -> Any:
    import pyarrow.compute

    return pyarrow.compute.struct_field(pick(array), [number])


def _cell(pick: Pick, number: int, of: _Of, array: Any) -> Any:
    """Return one cell of each list."""
    import pyarrow.compute

    lists = pick(array)
    widths = pyarrow.compute.unique(pyarrow.compute.list_value_length(lists))
    if len(widths) != 1:
        raise InputError(
            f"{of.label}: a column of lists has some of {listed(widths.to_pylist())} cells, and "
            "no cell of each row is one channel; write lists of one length, or columns"
        )
    return pyarrow.compute.list_element(lists, number)


@dataclass(eq=False)
class _Column:
    """A column of a file, whole or in parts.

    `at`, `last`: number and numbers of the group that was read last: parts mostly go on in it.
    """

    stored: _Stored
    name: str
    path: str
    pick: Pick
    of: _Of
    at: int = -1
    last: NDArray[Any] = field(default_factory=lambda: np.empty(0))

    def whole(self) -> NDArray[Any]:
        """Return all rows."""
        return self._numbers(self.stored.whole, self.stored.rows)

    def part(self, first: int, last: int) -> NDArray[Any]:
        """Return rows [first, last)."""
        ends = np.cumsum([0, *self.stored.groups])
        its, own = np.searchsorted(ends[1:], [first, last - 1], side="right")
        parts = [
            self._group(k)[max(first - ends[k], 0) : last - ends[k]] for k in range(its, own + 1)
        ]
        return np.concatenate(parts) if len(parts) != 1 else parts[0]

    def _group(self, number: int) -> NDArray[Any]:
        if number != self.at:
            rows = self.stored.groups[number]
            require_memory(NUMBER * rows, self.of.most, f"{self.of.label}, one group of its rows")
            self.last = self._numbers(lambda name: self.stored.group(name, number), rows)
            self.at = number
        return self.last

    def _numbers(self, load: Callable[[str], Any], rows: int) -> NDArray[Any]:
        """Return what is loaded; other things than numbers, times and text as text."""
        import pyarrow
        from pyarrow import types

        label, kind = self.of.label, self.of.kind
        with _sound(label, kind):
            array = self.pick(load(self.name).column(self.name).combine_chunks())
            its = array.type
            if types.is_dictionary(its):
                array = array.cast(its.value_type)
            elif types.is_decimal(its) or (types.is_boolean(its) and array.null_count):
                array = array.cast(pyarrow.uint8() if types.is_boolean(its) else pyarrow.float64())
            elif types.is_nested(its) or types.is_binary(its) or types.is_large_binary(its):
                raise InputError(
                    f"{label}: column '{self.path}' holds {its} where a channel needs numbers; "
                    "write its numbers as columns"
                )
            values = np.asarray(array.to_numpy(zero_copy_only=False))
        if len(values) != rows:
            raise InputError(
                f"{label}: column '{self.path}' has {len(values)} rows where the file promises "
                f"{rows}; write it again"
            )
        return values


def stated_units(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Return the units that attributes state, of columns by their names, of one alone by ""."""
    found: dict[str, str] = {}
    for key in UNIT_KEYS:
        stated = attributes.get(key)
        if isinstance(stated, str):
            found.setdefault("", stated)
        elif isinstance(stated, Mapping):
            found |= {str(name): unit for name, unit in stated.items() if isinstance(unit, str)}
    return found


def short_facts(attributes: Mapping[str, Any]) -> dict[str, Fact]:
    """Return attributes that can be facts: numbers, and short text, which may be numbers."""
    facts: dict[str, Fact] = {}
    for key, value in attributes.items():
        if isinstance(value, str) and key not in UNIT_KEYS and len(value) <= LONGEST_FACT:
            facts[str(key)] = parsed_fact(value)
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            facts[str(key)] = value
    return facts


def _texts(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    return {
        key.decode("utf-8", "replace"): value.decode("utf-8", "replace")
        for key, value in (metadata or {}).items()
    }


def _pandas_attributes(schema: Any) -> dict[str, Any]:
    """Return what pandas' frame had in `attrs` when it wrote the file."""
    try:
        said = json.loads((schema.metadata or {}).get(b"pandas", b"{}"))
    except (ValueError, RecursionError):
        return {}
    attributes = said.get("attributes") if isinstance(said, dict) else None
    return attributes if isinstance(attributes, dict) else {}


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
