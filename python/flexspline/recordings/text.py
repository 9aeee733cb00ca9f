"""Where the table of a text file is, and how it is written.

The table is the longest stretch of lines with one number of cells of which most are numbers or time
stamps. Its names stand right above, with or without a row of units; what is above them is the
preamble, and what follows the table is a footer.
"""

from __future__ import annotations

import codecs
import csv
import re
from dataclasses import dataclass, field
from typing import Any, Final

from flexspline.errors import InputError
from flexspline.logs.formats import decoded
from flexspline.logs.units import canonical_unit, is_stamp
from flexspline.recordings.words import meaning, unit_in

__all__ = ["TextLayout", "text_layout"]

ENCODINGS: Final = ("cp1252", "cp1250", "cp932", "cp1251", "gb18030", "mac_roman", "cp850")
"""Of files that are no Unicode. Where two read them, the one with more known words and units."""

SEPARATORS: Final = (";", "\t", ",", "|", " ")
LOOKED_AT: Final = 400  # lines at the top: no preamble is as long
LAST: Final = 50  # lines at the end
NUMBERS: Final = 0.5  # share of a line's filled cells that are numbers, from which it is a row
SAID: Final = {"\t": "tab", " ": "whitespace"}
REMARK: Final = re.compile(r"^\s*(?:#+\s*|%+\s+|//+\s*)")


@dataclass(frozen=True)
class TextLayout:
    """How a text is read, in keys of a column map's [read], and why.

    Parameters
    ----------
    read : keys of [read].
    preamble : lines above the table.
    reasons : a sentence for each key that had to be found.
    names, units : of the columns, as far as the file states them anywhere.
    numbered : whether a reader does not see the names: they stand apart from the table.
    """

    read: dict[str, Any] = field(default_factory=dict)
    preamble: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()
    names: tuple[str, ...] | None = None
    units: tuple[str | None, ...] | None = None
    numbered: bool = False


@dataclass(frozen=True)
class _Heads:
    """Names and units above a table, and the line of the names where a reader sees them there."""

    names: tuple[str, ...] | None = None
    units: tuple[str | None, ...] | None = None
    line: int | None = None
    units_row: bool = False
    dropped: int = 0
    commented: bool = False


def text_layout(
    content: bytes,
    label: str,
    *,
    encoding: str | None = None,
    skip_lines: int = 0,
    units_row: bool | None = None,
) -> TextLayout:
    """Return how the text in these bytes is to be read.

    `encoding`, `units_row`: where they are known. `skip_lines`: lines at its start that are not
    looked at.

    Raises
    ------
    InputError
        Where no stretch of lines looks like a table of numbers.
    """
    encoding = encoding or _encoding(content, label)
    lines = decoded(content, label, encoding).rstrip("\n").split("\n")
    lines[:skip_lines] = [""] * min(skip_lines, len(lines))
    separator, decimal = _way_to_write(lines[:LOOKED_AT])
    first, width = _table(lines[:LOOKED_AT], separator, decimal)
    if first is None:
        raise InputError(
            f"{label}: no table of numbers is seen in its first {LOOKED_AT} lines; "
            "give a recording, or write the column map by hand"
        )
    first, numeric = _first_row(lines, first, separator, decimal, width)
    rows = [cells_of(line, separator) for line in lines[first : first + LAST] if line.strip()]
    heads = _heads(lines[:first], separator, width, all(row[-1] == "" for row in rows))
    footer = _footer(lines[max(first, len(lines) - LAST) :], separator, decimal, width, numeric)
    begin = first if heads.line is None else heads.line
    above = skip_lines > 0 or any(line.strip() for line in lines[:begin])
    skip = begin if above and not heads.commented else skip_lines
    read: dict[str, Any] = {
        "separator": SAID.get(separator, separator),
        "decimal": decimal,
        "header": heads.line is not None,
        "encoding": encoding,
        "skip_lines": skip,
        "units_row": heads.units_row if units_row is None else units_row,
        "drop_rows": heads.dropped,
        "skip_footer": footer,
    }
    usual = {"encoding": "utf-8", "skip_lines": 0, "units_row": False, "drop_rows": 0}
    usual["skip_footer"] = 0
    read = {key: value for key, value in read.items() if usual.get(key, "") != value}
    numbered = heads.names is not None and heads.line is None and not heads.commented
    said = _reasons(read, lines, first, numbered)
    return TextLayout(read, tuple(lines[:first]), tuple(said), heads.names, heads.units, numbered)


def _reasons(read: dict[str, Any], lines: list[str], first: int, numbered: bool) -> list[str]:
    spelled = {"tab": "a tab", "whitespace": "blanks"}.get(read["separator"])
    said = [
        f"numbers begin in line {first + 1}, separated by {spelled or repr(read['separator'])}"
        + (", with a decimal comma" if read["decimal"] == "," else "")
    ]
    if "encoding" in read:
        said.append(f"encoding {read['encoding']}")
    if "skip_lines" in read:
        said.append(f"skipped above the table: {_count(read['skip_lines'])}")
    if numbered:
        said.append("the names stand apart from the table, so columns go by their numbers")
    if "units_row" in read:
        said.append("the row below the names holds units")
    if "skip_footer" in read:
        begin = lines[len(lines) - read["skip_footer"]][:40]
        said.append(f"skipped at the end: {_count(read['skip_footer'])}, from {begin!r}")
    return said


def _count(lines: int) -> str:
    return "1 line" if lines == 1 else f"{lines} lines"


def _encoding(content: bytes, label: str) -> str:
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if content.startswith(mark):
            return name
    if b"\0" in content[:4096]:
        few = content[1:200:2].count(0) > content[0:200:2].count(0)
        return "utf-16-le" if few else "utf-16-be"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return _old_encoding(content, label)
    return "utf-8"


def _old_encoding(content: bytes, label: str) -> str:
    odd = b"\n".join(line for line in content.split(b"\n")[:LOOKED_AT] if not line.isascii())
    best, known = "", -1
    for name in ENCODINGS:
        try:
            content.decode(name)
            count = _known_words(odd.decode(name, "replace"))
        except UnicodeDecodeError:
            continue
        best, known = (name, count) if count > known else (best, known)
    if not best:
        raise InputError(f"{label}: is no text in an encoding that is known; convert it to UTF-8")
    return best


def _known_words(text: str) -> int:
    """Return how many cells with signs beyond ASCII are a unit or a quantity, less what is odd."""
    cells = [cell for line in text.splitlines() for cell in _split_any(line) if not cell.isascii()]
    known = sum(canonical_unit(cell.strip(" []()\"'")) is not None for cell in cells)
    known += sum(meaning(cell).quantity is not None for cell in cells)
    known += sum(meaning(cell).unit is not None for cell in cells)
    odd = sum(not letter.isprintable() or "\uff61" <= letter <= "\uff9f" for letter in text)
    return max(2 * known - odd, 0)


def _split_any(line: str) -> list[str]:
    for sign in ("\t", ";", ","):
        line = line.replace(sign, "\n")
    return [cell.strip() for cell in line.split("\n")]


def cells_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line: behind a separator at its end there is an empty one."""
    if separator == " ":
        return [cell.strip('"') for cell in line.split()]
    try:
        read = csv.reader([line], delimiter=separator, skipinitialspace=True)
        return [cell.strip() for cell in next(read, [])]
    except csv.Error:  # a cell longer than any number
        return []


def _is_value(cell: str, decimal: str) -> bool:
    if decimal == ",":
        if "." in cell and not is_stamp(cell):
            return False
        cell = cell.replace(",", ".")
    try:
        float(cell)
    except ValueError:
        return is_stamp(cell)
    return True


def _is_row(cells: list[str], decimal: str) -> bool:
    values = sum(_is_value(cell, decimal) for cell in cells)
    filled = sum(bool(cell) for cell in cells)
    return values > 0 and values >= NUMBERS * filled


def _way_to_write(lines: list[str]) -> tuple[str, str]:
    """Return the separator and decimal sign under which most cells of rows are numbers."""
    best, most = (",", "."), (-1.0, 0)
    for separator in SEPARATORS:
        for decimal in (".", ","):
            if separator == decimal:
                continue
            rows = [cells_of(line, separator) for line in lines if line.strip()]
            rows = [cells for cells in rows if len(cells) > 1 and _is_row(cells, decimal)]
            values = sum(_is_value(cell, decimal) for cells in rows for cell in cells)
            filled = sum(bool(cell) for cells in rows for cell in cells)
            score = (round(len(rows) * values / max(filled, 1), 1), values)
            if score > most:
                best, most = (separator, decimal), score
    return best


def _table(lines: list[str], separator: str, decimal: str) -> tuple[int | None, int]:
    """Return the index of the first row of the longest stretch of rows alike, and its width."""
    best, longest, begin, width, count = None, 0, 0, 0, 0
    wide = 0
    for number, line in enumerate([*lines, "end"]):
        cells = cells_of(line, separator)
        row = _is_row(cells, decimal)
        if row and len(cells) == width:
            count += 1
            continue
        if not line.strip():
            continue
        if count > longest:
            best, longest, wide = begin, count, width
        begin, width, count = number, len(cells) if row else 0, int(row)
    return best, wide


def _heads(above: list[str], separator: str, width: int, ended: bool) -> _Heads:
    """Return the names and units above a table; `ended`: each row has an empty cell at its end.

    The names are the line whose cells name most quantities; the units one of which most cells are.
    """
    there = [n for n, line in enumerate(above) if line.strip()]
    cells = {n: _aligned(above[n], separator, width) for n in there}
    counts = {n: sum(map(_says, set(cells[n]))) for n in there}
    number = max(there, key=lambda n: (counts[n], n), default=None)
    if number is not None and counts[number] == 0:
        number = there[-1] if _all_words(above[there[-1]], separator, width) else None
    units = next((n for n in reversed(there) if n != number and _are_units(cells[n])), None)
    stated = None if units is None else tuple(cell or None for cell in cells[units])
    if number is None:
        return _Heads(units=stated)
    names = tuple(cells[number])
    above_it = number - 1 if number - 1 in there else None  # a blank line parts them
    if above_it is not None and above_it != units and _groups(cells[above_it], cells[number]):
        groups = cells[above_it]
        names = tuple(f"{group} {name}".strip() for group, name in zip(groups, names, strict=True))
        return _Heads(names, stated)
    own = len(cells_of(above[number], separator))
    if REMARK.match(above[number]):
        seen = above[number].lstrip().startswith("#") and number == there[-1]
        seen = seen and all(above[n].lstrip().startswith("#") for n in there)
        exact = len(cells_of(REMARK.sub("", above[number]), separator)) == width
        return _Heads(names, stated, commented=seen and exact)
    if own != width and not (own == width - 1 and ended and separator != " "):
        return _Heads(names, stated)
    between = [n for n in there if n > number]
    row = bool(between) and between[0] == units
    return _Heads(names, stated, number, row, len(between) - row)


def _groups(cells: list[str], names: list[str]) -> bool:
    """Whether a row of words stands above one of names as its groups: each fills most cells."""
    filled = sum(bool(cell) for cell in cells)
    words = not any(_is_value(cell, ".") or _says(cell) for cell in cells if cell)
    return words and len(cells) == len(names) and filled >= NUMBERS * len(names)


def _aligned(line: str, separator: str, width: int) -> list[str]:
    """Return as many cells as the rows have: a line may begin with a tag, or end with more."""
    cells = cells_of(REMARK.sub("", line), separator)
    if len(cells) == width + 1 and cells[-1] and not _says(cells[0]):
        cells = cells[1:]
    return (cells + [""] * width)[:width] if width - 1 <= len(cells) <= width + 2 else []


def _all_words(line: str, separator: str, width: int) -> bool:
    cells = cells_of(line, separator)
    return len(cells) == width and not any(_is_value(cell, ".") for cell in cells if cell)


def _says(cell: str) -> bool:
    """Whether a cell is the name of a quantity, rather than its unit."""
    return meaning(cell).quantity is not None and canonical_unit(cell.strip("[]() ")) is None


def _are_units(cells: list[str]) -> bool:
    filled = {cell for cell in cells if cell.strip("[]()- ")}
    known = sum(unit_in(cell) is not None for cell in filled)
    return bool(filled) and known >= NUMBERS * len(filled)


def _first_row(
    lines: list[str], first: int, separator: str, decimal: str, width: int
) -> tuple[int, list[int]]:
    """Return the first row that has numbers where all later ones do, and these columns.

    A preamble of numbers and words in turn may look like rows.
    """
    there = [n for n in range(first, min(len(lines), first + LOOKED_AT)) if lines[n].strip()]
    cells = {n: cells_of(lines[n], separator) for n in there}
    rows = [n for n in there if len(cells[n]) == width]
    numeric = _numeric([cells[n] for n in rows[len(rows) // 2 :][:LAST]], decimal)
    good = (n for n in rows if all(_is_value(cells[n][k], decimal) for k in numeric if cells[n][k]))
    return next(good, first), numeric


def _numeric(rows: list[list[str]], decimal: str) -> list[int]:
    """Return the columns in which rows have numbers, and nothing else but empty cells."""
    columns = []
    for number, cells in enumerate(zip(*rows, strict=True)):
        filled = [cell for cell in cells if cell]
        if filled and all(_is_value(cell, decimal) for cell in filled):
            columns.append(number)
    return columns


def _footer(tail: list[str], separator: str, decimal: str, width: int, numeric: list[int]) -> int:
    """Return how many lines at the end are no rows: a footer, or one that was cut off."""
    count = 0
    for line in reversed(tail):
        cells = cells_of(line, separator)
        filled = (cells[n] for n in numeric if cells[n]) if len(cells) == width else ("",)
        if all(_is_value(cell, decimal) for cell in filled) and _is_row(cells, decimal):
            break
        count += 1
    return count if count < len(tail) else 0
