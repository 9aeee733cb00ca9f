"""Tables of a foreign file, before any column has a meaning.

Tables lie inside arrays, dictionaries, MATLAB structs and JSON objects. MATLAB files of versions
4 to 7 are read by scipy, those of 7.3 (which is HDF5) by h5py.
"""

from __future__ import annotations

import io
import math
import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.log import Fact, unmasked, unmasking_notes
from flexspline.logs.packed import PIECE, require_memory

__all__ = [
    "NUMBER",
    "Later",
    "OnDisk",
    "Series",
    "Table",
    "from_array",
    "from_value",
    "read_matlab",
    "records_at",
    "require_droppable",
]

NUMBER: Final = 8  # bytes of a number in memory
FAR: Final = 10  # times as long as what describes it is a record
PACKED_VARIABLE: Final = 15  # miCOMPRESSED of MATLAB's files of version 5
HDF5: Final = b"\x89HDF\r\n\x1a\n"  # behind the 512 bytes of text that MATLAB puts first


def require_droppable(label: str, count: int, rows: int) -> None:
    """Refuse a number of rows to drop of which two are not left."""
    if not (isinstance(count, int) and 0 <= count <= max(rows - 2, 0)):
        raise InputError(
            f"{label}: drop_rows is {count!r} of {rows} rows; give a whole number that leaves two"
        )


@dataclass(frozen=True, eq=False)
class Later:
    """A column that stays in its file until it is asked for: most columns of most files never are.

    Parameters
    ----------
    rows : how many the column has.
    read : returns them all, (rows,).
    first : rows at the start that are left out.
    part : returns rows [a, b), of a file that need not be read whole.
    """

    rows: int
    read: Callable[[], NDArray[Any]]
    first: int = 0
    part: Callable[[int, int], NDArray[Any]] | None = None

    def __len__(self) -> int:
        return self.rows - self.first

    def __getitem__(self, rows: slice) -> Later:
        return replace(self, first=self.first + (rows.start or 0))

    def now(self) -> NDArray[Any]:
        """Read the column."""
        return self.read()[self.first :]


def _exchanged(index: Any) -> Any:
    return index[::-1] if isinstance(index, tuple) else index


@dataclass(frozen=True, eq=False)
class OnDisk:
    """A dataset of HDF5 as MATLAB sees it, (rows,) or (rows, columns), that stays in its file.

    `read`: returns a part of it, by its index in the file, where the last axis comes first; `at`:
    what that index is for a slice of the rows of a column.
    """

    read: Callable[[Any], NDArray[Any]]
    shape: tuple[int, ...]
    dtype: Any
    at: Callable[[slice], Any] = lambda rows: rows

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    def transpose(self) -> OnDisk:
        """Return the matrix with its axes exchanged; a vector stays."""
        turned = self.shape[::-1]
        return replace(self, shape=turned, read=lambda index: self.read(_exchanged(index)))

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Any) -> OnDisk:
        """Return a column, [:, k], or a row, [k], of a matrix."""
        if isinstance(index, tuple):
            column = index[1]
            return replace(self, shape=self.shape[:1], at=lambda rows: (column, rows))
        return replace(self, shape=self.shape[1:], at=lambda rows: (rows, index))

    def reshape(self, _: int) -> OnDisk:
        """Return the vector that a matrix of one row or one column is."""
        return self[0] if self.shape[0] == 1 else self[:, 0]

    def later(self) -> Later:
        """Return a vector as a column of a table."""

        def part(first: int, last: int) -> NDArray[Any]:
            return self.read(self.at(slice(first, last)))

        return Later(len(self), lambda: part(0, len(self)), part=part)


@dataclass(frozen=True, eq=False)
class Series:
    """Columns that were sampled at the same instants, of a file in which others were at others.

    Parameters
    ----------
    name : what a sentence calls it.
    stamps : when each row was taken, by the clock of the file: seconds, or whole nanoseconds.
    """

    name: str
    stamps: NDArray[Any] | Later


@dataclass(frozen=True, eq=False)
class Table:
    """Columns, with names where the file has them.

    `lines` is the file line of each row (the first is 1), where the file has lines; `units` what
    the file itself says of each column, or None. Where the file samples columns at instants of
    their own, `series` are these, `of_series` is the number of each column's, and `drop` how many
    rows are left out once all are on one clock. `numbers` are those of the rows in the whole table
    (the first is 0), where this is a part of one; `most` the bytes that columns which stay in their
    file may take together once they are read. `unreadable` are names that the file has beside
    these, each with why it cannot be read and what to do. Masked samples of a column are NaN.
    """

    label: str
    data: tuple[NDArray[Any] | Later, ...]
    names: tuple[str, ...] | None = None
    facts: Mapping[str, Fact] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    lines: NDArray[np.intp] | None = None
    units: tuple[str | None, ...] | None = None
    series: tuple[Series, ...] = ()
    of_series: tuple[int, ...] = ()
    drop: int = 0
    numbers: NDArray[np.intp] | None = None
    most: float = math.inf
    unreadable: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        said = unmasking_notes((self.title(n), column) for n, column in enumerate(self.data))
        object.__setattr__(self, "notes", (*self.notes, *said))
        object.__setattr__(self, "data", tuple(map(unmasked, self.data)))

    @property
    def rows(self) -> int:
        """Number of rows of data, in the longest column."""
        return max((len(column) for column in self.data), default=0)

    def column(self, number: int) -> NDArray[Any]:
        """Return a column, read from its file if it still is there."""
        data = self.data[number]
        return data.now() if isinstance(data, Later) else data

    def checked(self) -> Table:
        """Return this table if it can be a log: one with two rows of data or more."""
        _require_two_rows(self.label, self.rows if self.data else 0)
        return self

    def without_first(self, count: int) -> Table:
        """Return the table without its first `count` rows."""
        require_droppable(self.label, count, self.rows)
        if self.series:
            return replace(self, drop=self.drop + count)
        return replace(
            self,
            data=tuple(column[count:] for column in self.data),
            lines=None if self.lines is None else self.lines[count:],
        )

    def pieces(self, rows: int) -> Iterator[Table]:
        """Yield the first row of all and so many others, again and again; read when asked for.

        Times count from the first row of all, in whatever way they are written, so it leads each
        piece.

        Raises
        ------
        InputError
            Where columns have clocks of their own, or one that is asked for is read as a whole.
        """
        if self.series:
            raise InputError(
                f"{self.label}: columns with clocks of their own are put on one clock as a whole; "
                "read the file at once"
            )
        tops: dict[int, NDArray[Any]] = {}
        for first in range(0, self.rows, rows):
            numbers = np.append(0, np.arange(first, min(first + rows, self.rows)))
            data = (
                Later(len(numbers), partial(_piece, self, number, numbers, tops))
                for number in range(len(self.data))
            )
            lines = None if self.lines is None else self.lines[numbers]
            yield replace(self, data=tuple(data), numbers=numbers, lines=lines)

    def require_room(self, numbers: Iterable[int]) -> None:
        """Refuse columns that stay in their file and together take too much memory."""
        kept = (self.data[number] for number in numbers)
        wanted = sum(len(column) for column in kept if isinstance(column, Later))
        advice = (
            "give max_memory (--max-memory GB) if that is right, or read it in pieces "
            "(read_pieces, convert --rows-at-once)"
        )
        require_memory(NUMBER * wanted, self.most, self.label, advice)

    def title(self, number: int) -> str:
        """Return what a sentence calls this column."""
        return f"column '{self.names[number]}'" if self.names else f"column {number}"

    def place(self, row: int) -> str:
        """Return what a sentence calls the row with this index: its number counts from 1."""
        line = "" if self.lines is None else f" (line {self.lines[row]})"
        number = row if self.numbers is None else int(self.numbers[row])
        return f"data row {number + 1}{line}"

    def index(self, source: str | int) -> int:
        """Return the number of a column given by name or number.

        Raises
        ------
        InputError
            Where there is no such column, or more than one of that name.
        """
        width = len(self.data)
        if isinstance(source, int):
            if not 0 <= source < width:
                raise InputError(
                    f"{self.label}: no column {source}; "
                    f"its {width} columns are numbered from 0 to {width - 1}"
                )
            return source
        if self.names is None:
            raise InputError(
                f"{self.label}: no column '{source}', for its columns have no names; "
                f"give a number from 0 to {width - 1}"
            )
        found = [number for number, name in enumerate(self.names) if name == source]
        if not found and source in self.unreadable:
            raise InputError(
                f"{self.label}: column '{source}' cannot be read: {self.unreadable[source]}"
            )
        if not found:
            near = did_you_mean(source, self.names)
            raise InputError(
                f"{self.label}: no column '{source}'{near}; it has {listed(self.names)}"
            )
        if len(found) > 1:
            raise InputError(
                f"{self.label}: {len(found)} columns are named '{source}' "
                f"(numbers {listed(found)}); give the number of the right one"
            )
        return found[0]


def _piece(
    table: Table, number: int, rows: NDArray[np.intp], tops: dict[int, NDArray[Any]]
) -> NDArray[Any]:
    """Return the first row of a column, and rows that follow each other; `tops`: first rows."""
    column, first, last = table.data[number], int(rows[1]), int(rows[-1]) + 1
    if isinstance(column, np.ndarray):
        return np.concatenate([column[:1], column[first:last]])
    if column.part is None:
        raise InputError(
            f"{table.label}: {table.title(number)} can be read only as a whole; read the file at "
            "once"
        )
    at = column.first
    if number not in tops:
        tops[number] = column.part(at, at + 1)
    return np.concatenate([tops[number], column.part(at + first, at + last)])


def from_array(array: NDArray[Any] | OnDisk, label: str) -> Table:
    """Return the table in a structured array, or in a matrix of any orientation.

    The longer side of a matrix is time. Columns are views: a memory map stays on disk.
    """
    if array.dtype.names:
        flat: Any = array.reshape(-1)
        return Table(
            label,
            tuple(flat[name] for name in array.dtype.names),
            array.dtype.names,
            notes=("structured array",),
        )
    if array.ndim == 1:
        return Table(label, (_kept(array),), notes=(f"matrix of {len(array)} × 1",))
    if array.ndim != 2:
        raise InputError(
            f"{label}: an array of shape {array.shape} is no table; "
            "give two dimensions, rows and columns"
        )
    note = f"matrix of {array.shape[0]} × {array.shape[1]}"
    if array.shape[0] < array.shape[1]:
        array, note = array.transpose(), note + ", one row for each channel"
    columns: list[Any] = [array[:, number] for number in range(array.shape[1])]
    return Table(label, tuple(map(_kept, columns)), notes=(note,))


def _kept(column: Any) -> NDArray[Any] | Later:
    """Return a column, an array or on disk, as a table keeps it."""
    made: NDArray[Any] | Later = column.later() if isinstance(column, OnDisk) else column
    return made


def from_value(value: Any, label: str, variable: str | None) -> Table:
    """Return the table in nested dictionaries of arrays, at the dotted path `variable`.

    Without a path: the only matrix, else all vectors by their names; single values are facts.
    """
    if variable is not None:
        value = _at(value, label, variable)
    if not isinstance(value, Mapping):
        try:
            return from_array(value if isinstance(value, OnDisk) else np.asanyarray(value), label)
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{label}: holds lists of unequal length; give rows that all have as many numbers"
            ) from error
    found = {str(name): _array(inner) for name, inner in value.items()}
    known = {name: array for name, array in found.items() if array is not None}
    facts = {name: _single(array) for name, array in known.items() if array.size == 1}
    arrays = {name: array for name, array in known.items() if array.size > 1}
    matrices = [name for name, array in arrays.items() if array.ndim > 1 or array.dtype.names]
    vectors = [name for name in arrays if name not in matrices]
    labels = [name for name in vectors if arrays[name].dtype.kind in "US"]
    if len(matrices) == 1 and vectors == labels:
        table = from_array(arrays[matrices[0]], label)
        names = table.names or _names_among([arrays[name] for name in labels], len(table.data))
        return Table(table.label, table.data, names, facts, table.notes)
    inside = [str(name) for name in value]
    if not vectors and len(inside) == 1 and isinstance(value[inside[0]], Mapping):
        return from_value(value[inside[0]], label, None)
    columns = _columns(value, {name: arrays[name] for name in vectors})
    if not columns:
        _require_more(label, value, known)
        raise InputError(
            f"{label}: no table is seen at once in {listed(inside)}; "
            "name the right part with variable="
        )
    return Table(
        label,
        tuple(map(_kept, columns.values())),
        tuple(columns),
        facts,
        notes=("arrays " + listed(columns),),
    )


def _require_more(label: str, value: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    """Refuse what has nothing in it, or nothing but vectors of a single row or none."""
    if not value:
        raise InputError(f"{label}: is empty; give arrays by the names of their columns")
    rows = [array.size for array in known.values() if array.ndim == 1]
    if len(rows) == len(value):
        _require_two_rows(label, max(rows))


def _require_two_rows(label: str, rows: int) -> None:
    if rows == 0:
        raise InputError(f"{label}: no rows of data; record the run again")
    if rows < 2:
        raise InputError(f"{label}: only one row of data; a log needs two or more")


def _names_among(texts: list[NDArray[Any]], width: int) -> tuple[str, ...] | None:
    """Return the names of a matrix' columns, which stand in a list of texts beside it."""
    return next((tuple(map(str, text)) for text in texts if len(text) == width), None)


def _columns(value: Mapping[str, Any], vectors: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the vectors, and what else is as long: columns of matrices, vectors in groups.

    They are named as NumPy would reach them: ``q[:, 0]``, ``joint.signals[1].values``, or by a
    label that stands beside them. The length that most numbers have is that of the record; where
    there are no vectors at the top, it has to be the only one, or far more than the others.
    """
    found = {name: column for name, column in _flat(value, "") if name not in vectors}
    if not found:
        return vectors
    numbers = Counter[int]()
    counted = vectors if len(vectors) > 1 else {**vectors, **found}  # one may be any clock
    for column in counted.values():
        numbers[len(column)] += len(column)
    length = numbers.most_common(1)[0][0]
    others = [each for each in numbers if each != length]
    if not vectors and others and length < FAR * max(others):
        return {}
    if not any(len(column) == length for column in found.values()):
        return vectors
    both = {**vectors, **found}
    return {name: column for name, column in both.items() if len(column) == length}


def _flat(value: Any, path: str) -> Iterator[tuple[str, NDArray[Any]]]:
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _flat(inner, f"{path}.{name}" if path else str(name))
        return
    objects = isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype == object
    if (objects or isinstance(value, (list, tuple))) and any(
        isinstance(inner, Mapping) for inner in value
    ):
        for number, inner in enumerate(value):
            label = _label(inner)
            yield from _flat(inner["values"] if label else inner, label or f"{path}[{number}]")
        return
    array = _array(value)
    if array is None or array.size < 2 or array.dtype.kind not in "biufmMSUO":
        return
    if array.dtype.names or array.ndim > 2:
        return
    if array.ndim == 1:
        yield path, array
    elif array.shape[0] >= array.shape[1]:
        yield from ((f"{path}[:, {k}]", array[:, k]) for k in range(array.shape[1]))
    else:
        yield from ((f"{path}[{k}, :]", array[k]) for k in range(array.shape[0]))


def _label(signal: Any) -> str:
    """Return what stands beside the values of a signal as its name, in Simulink's way."""
    named = isinstance(signal, Mapping) and "values" in signal
    texts = [signal.get(key) for key in ("label", "blockName", "name")] if named else []
    return next((text for text in texts if isinstance(text, str) and text), "")


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
    import pandas

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


def _array(value: Any) -> Any:
    """Return a value as an array, vectors in one dimension, or None if it is not one."""
    if isinstance(value, Mapping):
        return None
    try:
        kept = isinstance(value, (OnDisk, np.ma.MaskedArray))
        array = value if kept else np.asarray(value)
    except ValueError:  # lists of unequal length
        return None
    if array.ndim == 2 and 1 in array.shape:
        array = array.reshape(-1)
    return None if array.dtype == object and array.ndim != 1 else array


def _single(array: NDArray[Any]) -> Fact:
    value = unmasked(array).reshape(-1)[0]
    value = value.item() if hasattr(value, "item") else value
    return value if isinstance(value, (str, int, float)) else str(value)


def read_matlab(source: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the table in a .mat (or plain HDF5) file.

    Parameters
    ----------
    source : path or bytes
        The file. By its path, datasets of HDF5 stay there until they are asked for.
    label : str
        What an error calls it.
    variable : str, optional
        A variable, or a path with dots into structs, such as "run.data".
    most : int
        Bytes that it may unfold to, but for datasets that stay in it.

    Raises
    ------
    InputError
        Where the file is corrupt, or has no such variable, or no table there; where it unfolds to
        more; and where it leads to what other files hold.
    """
    import h5py
    from scipy.io import loadmat

    try:
        units = dict[str, str]()
        if _is_hdf5(source):
            with h5py.File(source) as root:
                path = source if isinstance(source, Path) else None
                value = _Hdf5(label, most, path).group(root)
                root.visititems(lambda name, inner: units.update(_stated(name, inner)))
        else:
            content = source.read_bytes() if isinstance(source, Path) else source.getvalue()
            _require_unfolded(content, label, most)
            value = {
                name: inner
                for name, inner in loadmat(io.BytesIO(content), simplify_cells=True).items()
                if not name.startswith("__")
            }
    except InputError:
        raise
    except Exception as error:  # scipy and h5py raise many kinds on a corrupt file
        raise InputError(
            f"{label}: not a MATLAB file, or a corrupt one ({error}); save it again"
        ) from error
    table = from_value(value, label, variable)
    units |= _units_beside(value, "")
    if not units or not table.names:
        return table
    inside = f"{variable}." if variable else ""
    bare = [re.sub(r"\[[^]]*\]$", "", inside + name) for name in table.names]
    return replace(table, units=tuple(_ending(units, name) for name in bare))


def _is_hdf5(source: Path | io.BytesIO) -> bool:
    if isinstance(source, Path):
        with source.open("rb") as file:
            begins = file.read(512 + len(HDF5))
    else:
        begins = bytes(source.getbuffer()[: 512 + len(HDF5)])
    return any(begins.startswith(HDF5, start) for start in (0, 512))


def _ending(units: Mapping[str, str], name: str) -> str | None:
    """Return the unit of a column whose path may lack the groups around it, if one ends so."""
    leaf = name.rsplit(".", maxsplit=1)[-1]
    for ending in (name, leaf):
        found = [unit for path, unit in units.items() if f".{path}".endswith(f".{ending}")]
        if len(found) == 1:
            return found[0]
    return None


def _units_beside(value: Any, path: str) -> dict[str, str]:
    """Return units that stand as text in a struct of that name, by the paths of their columns."""
    found: dict[str, str] = {}
    for name, inner in value.items() if isinstance(value, Mapping) else ():
        if name in ("unit", "units") and isinstance(inner, Mapping):
            texts = {key: text for key, text in inner.items() if isinstance(text, str)}
            found |= {f"{path}{key}": text for key, text in texts.items()}
        else:
            found |= _units_beside(inner, f"{path}{name}.")
    return found


def _stated(name: str, inner: Any) -> dict[str, str]:
    """Return the unit that a dataset of HDF5 states in an attribute, by its path with dots."""
    for key in ("unit", "units", "Unit", "Units"):
        stated = inner.attrs.get(key)
        if isinstance(stated, (str, bytes)):
            text = stated.decode("utf-8", "replace") if isinstance(stated, bytes) else stated
            return {name.replace("/", "."): text}
    return {}


def _require_unfolded(content: bytes, label: str, most: int) -> None:
    """Refuse a file of MATLAB 5 to 7 whose packed variables unfold to more than `most` bytes."""
    start, total = 128, 0  # behind the head
    order = "<" if content[126:128] == b"IM" else ">"
    while start + 8 <= len(content):
        kind, size = struct.unpack(f"{order}II", content[start : start + 8])
        if kind == PACKED_VARIABLE:
            unfolding, rest = zlib.decompressobj(), content[start + 8 : start + 8 + size]
            while rest and not unfolding.eof:
                total += len(unfolding.decompress(rest, PIECE))
                require_memory(total, most, label)
                rest = unfolding.unconsumed_tail
        start += 8 + size


@dataclass
class _Hdf5:
    """What is read of one file of HDF5: each group once, all datasets together within `most` bytes.

    Of a file by its `path`, vectors and matrices of numbers stay there. A group that holds itself,
    by a hard link, would never end. Of two names of one group the first counts.
    """

    label: str
    most: int
    path: Path | None = None
    taken: int = 0
    groups: set[Any] = field(default_factory=set)

    def group(self, group: Any) -> dict[str, Any]:
        """Return the numbers in a group as nested dictionaries.

        A matrix of MATLAB, which marks its own, lies in the file transposed, and comes as it is
        there. Nothing is read that lies in another file: a log could hold what its sender never
        saw.
        """
        import h5py

        self.groups.add(group)
        found: dict[str, Any] = {}
        for name in group:
            inner = _linked(group, name, self.label)
            if isinstance(inner, h5py.Group):
                if not name.startswith("#") and inner not in self.groups:
                    found[name] = self.group(inner)
            elif inner is not None:
                value = self._dataset(inner)
                if value is not None:
                    found[name] = value
        return found

    def _dataset(self, inner: Any) -> Any:
        """Return what a dataset holds; None of a kind that no log has."""
        stays = inner.dtype.kind in "fiub" and inner.ndim in (1, 2) and inner.size > 1
        turned = "MATLAB_class" in inner.attrs
        if self.path is not None and stays and inner.attrs.get("MATLAB_class") != b"char":
            read = partial(_read_stored, self.path, inner.name, self.label)
            stored = OnDisk(read, inner.shape[::-1], inner.dtype)
            return stored if turned else stored.transpose()
        self.taken += (inner.size or 0) * inner.dtype.itemsize
        require_memory(self.taken, self.most, self.label)
        if inner.attrs.get("MATLAB_class") == b"char":
            return "".join(map(chr, np.asarray(inner).T.reshape(-1)))
        if inner.dtype.kind in "SO" and inner.ndim == 1:
            return [
                each.decode("utf-8", "replace") if isinstance(each, bytes) else str(each)
                for each in inner[()]
            ]
        if inner.dtype.kind in "fiub":
            return np.asarray(inner).T if turned else np.asarray(inner)
        return None


def _read_stored(path: Path, name: str, label: str, index: Any) -> NDArray[Any]:
    """Return a part of a dataset of numbers."""
    import h5py

    try:
        with h5py.File(path) as file:
            return np.asarray(file[name][index])
    except InputError:
        raise
    except Exception as error:  # h5py raises many kinds on a damaged file
        raise InputError(
            f"{label}: '{name}' cannot be read ({error}); save the file again"
        ) from error


def _linked(group: Any, name: str, label: str) -> Any:
    """Return what a name in a group stands for; None of a link within the file.

    Raises
    ------
    InputError
        Where it, or its numbers, lie in another file.
    """
    import h5py

    at = f"{group.name.rstrip('/')}/{name}"
    link = group.get(name, getlink=True)
    if isinstance(link, h5py.SoftLink):
        return None
    if not isinstance(link, h5py.HardLink):
        raise InputError(f"{label}: '{at}' is a link to elsewhere; save the numbers themselves")
    inner = group[name]
    if isinstance(inner, h5py.Dataset) and (inner.external or inner.is_virtual):
        raise InputError(
            f"{label}: the numbers of '{at}' lie in another file; save them in this one"
        )
    return inner
