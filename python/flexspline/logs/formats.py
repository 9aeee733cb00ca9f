"""From a file of any known format, or data in memory, to a table without meaning.

Delimited text is CSV in all its dialects, with facts in `# key: value` lines on top.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.files import require_there
from flexspline.logs.bag_files import parts_of, read_bag, read_mcap, read_ros2
from flexspline.logs.frames import (
    from_frame,
    is_frame,
    read_feather,
    read_parquet,
    write_parquet,
)
from flexspline.logs.log import Fact, Log, Source, parsed_fact
from flexspline.logs.mdf_files import read_mdf
from flexspline.logs.packed import PACKED, memory_limit, read_numpy, unpacked
from flexspline.logs.table import (
    Table,
    from_array,
    from_value,
    read_matlab,
    records_at,
    require_droppable,
)
from flexspline.logs.tdms_files import read_tdms

__all__ = [
    "FORMATS",
    "Dialect",
    "Format",
    "decoded",
    "format_named",
    "format_rows",
    "no_source",
    "read_table",
    "unpacked_text",
]


class Format(NamedTuple):
    """A format of files, told by how a file's name ends or by how the file begins.

    Parameters
    ----------
    name : what sentences call it.
    suffixes : ends of names.
    read : from path or bytes, label, variable and most bytes to a `Table`. A library that not
        everybody needs is imported here, with the first file.
    says : what who has such a file should know.
    variable : what the argument `variable` names; "" where a file is one table.
    pieces : how a file larger than memory is read in pieces; "" where it is read as a whole.
    magic : first bytes of such a file, whatever it is called.
    extra : what pip installs the library by; "" where it comes with flexspline.
    write : from facts, first piece and all pieces of a log to an opened file; None: not written.
    """

    name: str
    suffixes: tuple[str, ...]
    read: Callable[[Path | io.BytesIO, str, str | None, int], Table]
    says: str = ""
    variable: str = ""
    pieces: str = ""
    magic: tuple[bytes, ...] = ()
    extra: str = ""
    write: Callable[[Mapping[str, str], Log, Iterator[Log], BinaryIO], None] | None = None

    def __str__(self) -> str:
        """What it is, and how such files are called: "MDF 4 (.mf4, .mdf)"."""
        return f"{self.name} ({', '.join(self.suffixes)})"

    @property
    def install(self) -> str:
        """The command that installs its library."""
        return f"pip install 'flexspline[{self.extra}]'"


BEGINNING: Final = 16  # bytes of a file that tell its format
SEPARATORS: Final = (",", ";", "\t", "|", " ")
MONITOR: Final = r"^\d{1,2}:\d{2}:\d{2}(?:\.\d+)? -> "
FORTRAN: Final = r"(?<=\d)[Dd](?=[+-]\d{2}\b)"
SPELLED: Final = {"\t": "tab", " ": "whitespace"}
SAMPLE_LINES: Final = 20
MOST_CELLS: Final = 1_000_000  # beyond these pandas, which reads faster, is sooner done
EXACT_SINCE: Final = (3, 1)  # of pandas, which read some numbers wrong in the last digit before


def read_table(
    source: Any,
    variable: str | None,
    dialect: Dialect,
    drop_rows: int = 0,
    max_memory: float | None = None,
) -> tuple[Table, Source | None]:
    """Return what `source` holds, and where it comes from if it is a file.

    Parameters
    ----------
    source : path, ndarray, mapping of arrays, table of pandas, polars or xarray
        The formats of `read_log`.
    variable : str, optional
        Of a file: the part that is the table, in those of `FORMATS` that have several.
    dialect : Dialect
        How text is written.
    drop_rows : int
        Rows at the start that are left out.
    max_memory : float, optional
        What a file may take once it is unfolded [GB]; by default half of what is free.

    Raises
    ------
    InputError
        Where the file is missing, empty, corrupt or holds no table.
    """
    if isinstance(source, (str, os.PathLike)):
        return _from_file(Path(source), variable, dialect, drop_rows, memory_limit(max_memory))
    if is_frame(source):
        table = from_frame(source)
    elif isinstance(source, np.ndarray):
        table = from_array(source, "array")
    elif isinstance(source, Mapping):
        table = from_value(dict(source), "dictionary", variable)
    else:
        raise no_source(source)
    return table.checked().without_first(drop_rows), None


def no_source(source: object) -> InputError:
    """Return the error for what is no source of a log."""
    return InputError(
        f"a log cannot be read from a {type(source).__name__}; "
        "give a path, an array, a dictionary of arrays, a DataFrame of pandas or polars, or a "
        "Dataset of xarray"
    )


def _from_file(
    path: Path, variable: str | None, dialect: Dialect, drop_rows: int, most: int
) -> tuple[Table, Source]:
    require_there(path)
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; record or copy it again")
    with _named(path):
        digest = _sha256(path)
        table = replace(_opened(path, variable, dialect, drop_rows, most), most=most)
    return table, Source(str(path), digest, table.rows + drop_rows)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Say of which file a read failed: one that fails midway does not."""
    try:
        yield
    except PermissionError as error:
        raise InputError(f"{path}: may not be read; change its permissions") from error
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror or error}); copy it from a sound disk"
        ) from error


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    for part in parts_of(path) if path.is_dir() else [path]:
        with part.open("rb") as file:
            while chunk := file.read(1 << 20):
                digest.update(chunk)
    return digest.hexdigest()


def _opened(path: Path, variable: str | None, dialect: Dialect, drop_rows: int, most: int) -> Table:
    form, packed = _format(path)
    label = str(path)
    file = io.BytesIO(unpacked(path.read_bytes(), packed, label, most)) if packed else path
    if form is None:
        return read_delimited(_bytes(file), label, dialect, drop_rows).checked()
    try:
        table = form.read(file, label, variable, most)
    except ModuleNotFoundError as error:
        if not form.extra:
            raise
        raise InputError(f"{label}: {error.name} is needed to read it; {form.install}") from error
    return table.checked().without_first(drop_rows)


def _format(path: Path) -> tuple[Format | None, str]:
    """Return what a file is, None for text, and how it is packed: ".gz" for run.npz.gz.

    Its beginning says more than its name, but for names of formats of which no beginning is known.
    """
    packed, named = _packed(path), format_named(path)
    if path.is_dir():
        return next(each for each in FORMATS if each.read is read_ros2), ""
    if packed or (named is not None and not named.magic):
        return named, packed
    with path.open("rb") as file:
        begins = file.read(BEGINNING)
    return next((each for each in FORMATS if begins.startswith(each.magic)), named), ""


def _packed(path: Path) -> str:
    return path.suffix.lower() if path.suffix.lower() in PACKED else ""


def format_named(path: Path) -> Format | None:
    """Return the format that a name ends like, packed or not; None of text."""
    named = path.with_suffix("") if _packed(path) else path
    return next((each for each in FORMATS if named.suffix.lower() in each.suffixes), None)


def unpacked_text(path: Path, max_memory: float | None = None) -> bytes | None:
    """Return the bytes of a text file as it was before it was packed; None of other formats.

    `max_memory`: what it may unfold to [GB]; by default half of what is free.

    Raises
    ------
    InputError
        Where the file is missing, empty or damaged.
    """
    require_there(path)
    with _named(path):
        form, packed = _format(path)
        if form is not None:
            return None
        content = unpacked(path.read_bytes(), packed, str(path), memory_limit(max_memory))
    if not content:
        raise InputError(f"{path}: the file is empty; record or copy it again")
    return content


def _numpy(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    return from_value(read_numpy(file, label, most), label, variable)


def _bytes(file: Path | io.BytesIO) -> bytes:
    return file.read_bytes() if isinstance(file, Path) else file.getvalue()


def _json(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    try:
        value = json.loads(_bytes(file))
    except (ValueError, RecursionError) as error:  # no JSON, no text, endless digits or depth
        raise InputError(f"{label}: not JSON ({error}); export it again") from error
    if not isinstance(value, (dict, list)):
        raise InputError(f"{label}: holds no records; give a list of them, or an object with one")
    return records_at(value, label, variable)


def _json_lines(file: Path | io.BytesIO, label: str, variable: str | None, most: int) -> Table:
    """Return the records, one for each line, but for those of another kind: events between them."""
    table: list[dict[str, Any]] = []
    for number, line in enumerate(_bytes(file).splitlines(), start=1):
        try:
            table += [json.loads(line)] if line.strip() else []
        except (ValueError, RecursionError) as error:
            raise InputError(
                f"{label}: line {number} is not JSON ({error}); correct or delete it"
            ) from error
    records = [record for record in table if isinstance(record, dict)]
    if not records:
        raise InputError(f"{label}: holds no records; give an object for each line")
    usual = max(map(frozenset, records), key=Counter(map(frozenset, records)).__getitem__)
    kept = [record for record in records if len(usual & record.keys()) > len(usual) / 2]
    made = records_at(kept, label, None)
    left = (
        f"; {len(table) - len(kept)} lines of other kinds left out"
        if len(kept) < len(table)
        else ""
    )
    return replace(made, notes=(f"a record in each line{left}",))


OF_COLUMNS: Final = "only columns that become channels are read"
OF_TABLES: Final = "the table, such as run.data"
OF_MESSAGES: Final = (
    "columns go by the path of their field, wrench.force.x, and by joint, position[elbow]"
)
OF_GROUPS: Final = "columns go by the name of a channel, or group.name"
FORMATS: Final = (
    Format(
        "NumPy", (".npy",), _numpy, "left on disk where no unit is changed",
        pieces="read in pieces",
    ),
    Format("NumPy arrays", (".npz",), _numpy, variable=OF_TABLES),
    Format(
        "MATLAB", (".mat",), read_matlab, "all versions", OF_TABLES,
        pieces="of version 7.3 read in pieces",
    ),
    Format("HDF5", (".h5", ".hdf5"), read_matlab, OF_COLUMNS, OF_TABLES, pieces="read in pieces"),
    Format("JSON", (".json",), _json, "records", OF_TABLES),
    Format("JSON lines", (".jsonl", ".ndjson"), _json_lines, "a record in each line"),
    Format(
        "Parquet", (".parquet", ".pq"), read_parquet, OF_COLUMNS, magic=(b"PAR1",),
        pieces="read in pieces, a group of rows as one", extra="parquet", write=write_parquet,
    ),
    Format(
        "Feather", (".feather", ".arrow", ".ipc"), read_feather, OF_COLUMNS, magic=(b"ARROW1",),
        pieces="read in pieces", extra="parquet",
    ),
    Format(
        "MCAP", (".mcap",), read_mcap, OF_MESSAGES, "a topic", magic=(b"\x89MCAP0\r\n",),
        extra="mcap",
    ),
    Format(
        "ROS 1 bag", (".bag",), read_bag, OF_MESSAGES, "a topic", magic=(b"#ROSBAG V2.0\n",),
        extra="ros",
    ),
    Format(
        "ROS 2 bag", (".db3",), read_ros2, "its folder, or one file of it; " + OF_MESSAGES,
        "a topic", magic=(b"SQLite format 3\0",), extra="ros",
    ),
    Format(
        "MDF 4", (".mf4", ".mdf"), read_mdf, OF_GROUPS, "a group",
        pieces="one group read in pieces",
        magic=(b"MDF     ", b"UnFinMF "), extra="mdf",
    ),
    Format(
        "TDMS", (".tdms",), read_tdms, OF_GROUPS, "a group", pieces="one group read in pieces",
        magic=(b"TDSm",), extra="tdms",
    ),
)  # fmt: skip
"""Every format of files but delimited text. Reading, writing, help, docstrings, sentences and
README follow."""


def format_rows() -> list[tuple[str, str]]:
    """Return what is said of each format: how such files are called, and what to know of them."""
    text = "any other name: names, units, separators and decimal signs are found by looking"
    return [("delimited text", text), *((str(each), _said(each)) for each in FORMATS)]


def _said(form: Format) -> str:
    said = [
        form.says,
        f"variable: {form.variable}" if form.variable else "",
        form.pieces,
        "written too" if form.write else "",
        form.install if form.extra else "",
    ]
    return "; ".join(filter(None, said))


@dataclass(frozen=True)
class Dialect:
    """How a text file is written; None and "auto" are found out by looking.

    A separator of " " stands for any run of blanks and tabs. `skip_lines` and `skip_footer` are
    lines at the top and at the end that are not read; `units_row` says that the row below the
    names holds their units.
    """

    header: bool | Literal["auto"] = "auto"
    separator: str | None = None
    decimal: str | None = None
    encoding: str = "utf-8"
    skip_lines: int = 0
    skip_footer: int = 0
    units_row: bool = False

    def __post_init__(self) -> None:
        for name, sound, remedy in (
            ("header", self.header in (True, False, "auto"), "True, False or 'auto'"),
            ("separator", isinstance(self.separator, str | None), "one character"),
            ("decimal", self.decimal in (None, ".", ","), "'.' or ','"),
            ("encoding", isinstance(self.encoding, str), "a name such as 'latin-1'"),
            ("skip_lines", _is_count(self.skip_lines), "a whole number of lines"),
            ("skip_footer", _is_count(self.skip_footer), "a whole number of lines"),
            ("units_row", isinstance(self.units_row, bool), "True or False"),
        ):
            if not sound:
                raise InputError(f"{name} is {getattr(self, name)!r}; give {remedy}")


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


@dataclass(frozen=True)
class _Top:
    """The comment lines above the table: facts, the last other comment, where the table starts."""

    facts: dict[str, Fact]
    comment: str
    body: str
    first_line: int


def read_delimited(content: bytes, label: str, dialect: Dialect, drop_rows: int = 0) -> Table:
    """Return the table in the bytes of a text file, without its first `drop_rows` rows.

    These are not even looked at as numbers: a line of units may be among them.

    Raises
    ------
    InputError
        For bytes that are no text in this encoding, a table without rows, rows with
        another number of fields than the first, an unfinished quotation.
    """
    text = decoded(content, label, dialect.encoding)
    top = _top(*_without(text, label, dialect.skip_lines, dialect.skip_footer))
    sample = _first_lines(top.body, SAMPLE_LINES)
    if not sample:
        raise InputError(f"{label}: no rows of data; record the run again")
    try:
        separator, decimal = _layout(sample, dialect)
        first = _fields(sample[0], separator)
    except csv.Error as error:
        raise InputError(
            f"{label}: no table could be read ({error}); check separator and quotation marks"
        ) from error
    headed = dialect.header
    if headed == "auto":
        headed = not any(_is_number(cell, decimal) and cell for cell in first)
    first = _as_wide_as_rows(first, sample[1:], separator)
    names = tuple(first) if headed else _commented_names(top.comment, separator, len(first))
    lines = _lines_of_rows(top, label, separator, len(first), headed)
    if not len(lines):
        raise InputError(f"{label}: a header line but no rows of data; record the run again")
    units = _units(sample[headed:], separator, len(first)) if dialect.units_row else None
    lines = lines[int(dialect.units_row) :]
    require_droppable(label, drop_rows, len(lines))
    lines = lines[drop_rows:]
    skipped = int(lines[0]) - top.first_line
    data = _numbers(top.body, separator, decimal, skipped, (len(first), len(lines)))
    if data is None:
        data = _parsed(top.body, label, separator, decimal, skipped)
    spelled = SPELLED.get(separator, f"'{separator}'")
    note = f"text with separator {spelled}" + (", decimal comma" if decimal == "," else "")
    return Table(
        label=label,
        data=data,
        names=names,
        facts=top.facts,
        notes=(note + ("" if names else ", no header"),),
        lines=lines,
        units=units,
    )


def _without(text: str, label: str, top: int, footer: int) -> tuple[str, int]:
    """Return a text without lines at its top and its end, and the number of its first line."""
    if not top and not footer:
        return text, 1
    lines = text.rstrip("\n").split("\n")
    if top + footer >= len(lines):
        raise InputError(
            f"{label}: has {len(lines)} lines where {top + footer} are to be skipped; "
            "correct skip_lines or skip_footer"
        )
    return "\n".join(lines[top : len(lines) - footer]) + "\n", top + 1


def _as_wide_as_rows(first: list[str], below: list[str], separator: str) -> list[str]:
    """Return the cells of the first line, as many as the rows have: a separator may end a line.

    Some recorders put one behind the last cell of each row, or of the header alone.
    """
    rows = [_fields(line, separator) for line in below]
    if separator == " " or not rows or len({len(row) for row in rows}) != 1:
        return first
    if len(rows[0]) == len(first) + 1 and not any(row[-1] for row in rows):
        return [*first, ""]
    return first


def _units(below: list[str], separator: str, width: int) -> tuple[str | None, ...]:
    """Return the unit in each cell of the row below the names, None where it says none."""
    cells = [cell.strip(" []()") for cell in _fields(below[0], separator)] if below else []
    return tuple(cell or None for cell in (cells + [""] * width)[:width])


def decoded(content: bytes, label: str, encoding: str) -> str:
    """Return the text in these bytes, its lines ended by line feeds."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    elif b"\0" in content[:4096]:
        raise InputError(
            f"{label}: not a text file, and its name ends like none of the known formats; give "
            f"text, or a name that ends in {listed([each.suffixes[0] for each in FORMATS])}"
        )
    try:
        plain = encoding.lower() in ("utf-8", "utf8")
        text = content.decode("utf-8-sig" if plain else encoding)
        if not plain:
            text.encode()  # some codecs give halves of characters
    except UnicodeError as error:  # the codecs of host names say no place
        where = content.count(b"\n", 0, getattr(error, "start", 0)) + 1
        raise InputError(
            f"{label}: line {where} is not {encoding} text; "
            "give its encoding, such as latin-1 (--encoding latin-1, in Python encoding='latin-1')"
        ) from error
    except (LookupError, ValueError) as error:
        raise InputError(
            f"{label}: encoding '{encoding}' is not known; give one such as 'utf-8' or 'latin-1'"
        ) from error
    text = text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text
    return _plain_numbers(text)


def _plain_numbers(text: str) -> str:
    """Return a text whose numbers have neither spaces between thousands nor Fortran's D.

    The clock that a serial monitor writes before each line is left out.
    """
    if re.match(MONITOR, text):
        text = re.sub(MONITOR, "", text, flags=re.MULTILINE)
    if "\xa0" in text or "\u202f" in text:
        text = re.sub(r"(?<=\d)[\xa0\u202f](?=\d{3})", "", text)
    return re.sub(FORTRAN, "e", text) if re.search(FORTRAN, text[:100_000]) else text


def _first_lines(body: str, most: int) -> list[str]:
    """The first lines that are not blank, however long they are."""
    lines: list[str] = []
    start = 0
    while start < len(body) and len(lines) < most:
        end = body.find("\n", start)
        end = len(body) if end < 0 else end
        line = body[start:end]
        lines += [line] if line.strip() else []
        start = end + 1
    return lines


def _top(text: str, number: int = 1) -> _Top:
    """Split the comment and blank lines at the top from the table below."""
    facts: dict[str, Fact] = {}
    comment, start = "", 0
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        line = text[start:end].strip()
        if line and not line.startswith("#"):
            break
        pair = re.match(r"#+\s*([^:,;\t]+?)\s*:\s*(.*)$", line)
        if pair:
            facts[pair[1]] = parsed_fact(pair[2])
        elif line:
            comment = line.lstrip("#").strip()
        start, number = end + 1, number + 1
    return _Top(facts, comment, text[start:], number)


def _layout(sample: list[str], dialect: Dialect) -> tuple[str, str]:
    """Return the separator and decimal sign under which most cells are numbers.

    Among equals more columns win, then the order of `SEPARATORS`, then the decimal point.
    """
    separators = SEPARATORS if dialect.separator is None else (_one(dialect.separator),)
    decimals = (".", ",") if dialect.decimal is None else (dialect.decimal,)
    below = sample[1:] or sample

    def score(layout: tuple[str, str]) -> tuple[float, int]:
        cells = [cell for line in below for cell in _fields(line, layout[0])]
        return sum(_is_number(cell, layout[1]) for cell in cells) / len(cells), len(cells)

    layouts = [(s, d) for d in decimals for s in separators if s != d]
    if not layouts:
        raise InputError(
            f"separator and decimal sign are both '{dialect.decimal}'; give two that differ"
        )
    return max(layouts, key=score)


def _one(separator: str) -> str:
    """Return the one character that separates; any white space but a tab means blanks."""
    if separator in (r"\s+", "whitespace", "") or (separator.isspace() and separator != "\t"):
        return " "
    if separator in ("tab", r"\t"):
        return "\t"
    if len(separator) != 1 or not separator.isascii():
        raise InputError(
            f"separator '{separator}' is not one character; "
            "give one such as ',' or ';', or 'whitespace'"
        )
    return separator


def _fields(line: str, separator: str) -> list[str]:
    if separator == " ":
        return [cell.strip('"') for cell in line.split()]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]


def _is_number(cell: str, decimal: str) -> bool:
    """Tell whether `cell` is a number or empty."""
    if not cell:
        return True
    if decimal == ",":
        cell = cell.replace(".", "no").replace(",", ".")
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _commented_names(comment: str, separator: str, width: int) -> tuple[str, ...] | None:
    """Return names from a comment line above the table, where their number fits (numpy's way)."""
    names = _fields(comment, separator) if comment else []
    return tuple(names) if len(names) == width > 1 else None


def _lines_of_rows(
    top: _Top, label: str, separator: str, width: int, headed: bool
) -> NDArray[np.intp]:
    """Return the file line of each row of data, all of which must have `width` fields."""
    letters = _unquoted(top.body.rstrip("\n"), label)
    ends = np.append(np.flatnonzero(letters == ord("\n")), len(letters))
    paper = np.zeros(256, dtype=bool)
    paper[[ord(letter) for letter in "\n \t" if letter != separator or letter == " "]] = True
    bare = paper[letters]
    filled = _count(bare, ends) < np.diff(ends, prepend=0)
    if separator == " ":  # a field begins behind each last bare letter, and at the very start
        fields = _count(bare & ~np.append(bare[1:], True), ends)
        fields[0] += not bare[0]
    else:
        fields = _count(letters == ord(separator), ends) + 1
    fields = fields[filled]
    lines: NDArray[np.intp] = np.flatnonzero(filled) + top.first_line
    odd = np.flatnonzero(fields != width)
    if len(odd):
        raise InputError(
            f"{label}: data row {odd[0] + 1 - headed} (line {lines[odd[0]]}) has {fields[odd[0]]} "
            f"fields where the first line of the table has {width}; complete or delete it"
        )
    return lines[headed:]


def _unquoted(body: str, label: str) -> NDArray[np.uint8]:
    """Return the bytes of the table, with everything between quotation marks made one letter."""
    letters = np.frombuffer(body.encode(), dtype=np.uint8)
    if '"' not in body:
        return letters
    quoted = np.cumsum(letters == ord('"')) % 2 == 1
    if quoted[-1]:
        raise InputError(f"{label}: a quotation mark is never closed; close or delete it")
    return np.where(quoted, np.uint8(ord("x")), letters)


def _count(marks: NDArray[np.bool_], ends: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return how many marks lie in each line, counted from the end of the line before it."""
    return np.diff(np.searchsorted(np.flatnonzero(marks), ends), prepend=0)


def _numbers(
    body: str, separator: str, decimal: str, skipped: int, shape: tuple[int, int]
) -> tuple[NDArray[np.float64], ...] | None:
    """Return the columns of a table of numbers alone, or None where there is anything else.

    None also for numbers that are whole to pandas and no longer to a double, and for a table of
    another `shape` (columns, rows). Most runs need no more; pandas takes longer to import than a
    run takes to read.
    """
    if decimal != "." or shape[0] * shape[1] > MOST_CELLS:
        return None
    delimiter = None if separator == " " else separator
    try:
        rows = np.loadtxt(
            io.StringIO(body), delimiter=delimiter, comments=None, skiprows=skipped, ndmin=2
        )
    except ValueError:  # an empty cell, a quotation mark, text, a whole number without end
        return None
    if rows.shape != shape[::-1] or np.any(np.abs(rows) >= 2.0**53):
        return None
    return tuple(np.ascontiguousarray(rows.T))


def _parsed(
    body: str, label: str, separator: str, decimal: str, skipped: int
) -> tuple[NDArray[Any], ...]:
    import pandas

    exact = tuple(map(int, pandas.__version__.split(".")[:2])) >= EXACT_SINCE
    try:
        frame = pandas.read_csv(
            io.StringIO(body),
            sep=r"\s+" if separator == " " else separator,
            decimal=decimal,
            header=None,
            skiprows=skipped,
            skipinitialspace=True,
            index_col=False,
            low_memory=False,
            float_precision=None if exact else "round_trip",
        )
    except (pandas.errors.ParserError, ValueError) as error:
        raise InputError(
            f"{label}: no table could be read ({error}); check separator and quotation marks"
        ) from error
    return tuple(frame[number].to_numpy() for number in frame.columns)
