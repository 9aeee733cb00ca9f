"""The column map: which column of a foreign table is which channel, in what unit and sign.

Units are resolved by pint, the usual ones without it.
"""

from __future__ import annotations

import functools
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed, shortened
from flexspline.logs.channels import CHANNELS
from flexspline.logs.one_clock import on_one_clock
from flexspline.logs.table import Table
from flexspline.logs.units import (
    COUNTS,
    canonical_unit,
    is_stamp,
    seconds_of_stamps,
    states_no_unit,
    without_remark,
)

__all__ = ["ColumnSource", "ColumnSpec", "Picked", "picked"]

_PINT_NAMES = {
    "": "dimensionless",
    "-": "dimensionless",
    "–": "dimensionless",
    "0/1": "dimensionless",
    "°C": "degC",
}


_NAME = r"[^\W\d_]\w*|[%°′″'\"‰µΩ]+\w*"
_POWER = r"(?:\s*(?:\^|\*\*)\s*[-+]?[1-9]|[⁻]?[¹²³⁴⁵⁶⁷⁸⁹])?"
_FACTOR = rf"(?:(?:{_NAME}){_POWER}|1(?:\.0+)?)"
_PRODUCT = rf"{_FACTOR}(?:\s*(?:\*|/|·|⋅|\s)\s*{_FACTOR})*"
UNIT: Final = re.compile(rf"\s*(?:|[-–]|0/1|{_PRODUCT}|{_PRODUCT}\s*/\s*\(\s*{_PRODUCT}\s*\))\s*")
"""What a unit may be before pint sees it: names, joined by ``* /`` or a blank, with powers of one
digit; one bracket below the line. Pint computes: ``10**10**10`` takes for ever."""
USUAL: Final[dict[str, dict[str, float]]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "rev": math.tau},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180, "rpm": math.tau / 60, "rev/s": math.tau},
    "Nm": {"Nm": 1.0, "mNm": 1e-3, "Ncm": 1e-2},
    "A": {"A": 1.0, "mA": 1e-3},
    "V": {"V": 1.0, "mV": 1e-3},
    "°C": {"°C": 1.0, "degC": 1.0},
}
"""SI unit of a channel, and pint's own factor of each spelling that most recorders write: pint and
its registry take longer than a run takes to convert. None of these has an offset."""
LONGEST_UNIT: Final = 40
"""Characters of a unit; "kilogram * metre ** 2 / second ** 2" has 34."""


@dataclass(frozen=True)
class ColumnSource:
    """Where a channel comes from: ``SI value = unit(sign · scale · number in the file)``.

    Parameters
    ----------
    source : str or int
        Name of a column, or its number, counted from 0.
    unit : str, optional
        Unit in the file, such as "deg", "rpm", "mNm"; by default what the file states in a row
        or an attribute of units, where an unknown one is an error, else the channel's own SI unit.
    sign : int
        1, or −1 for a column that counts the other way.
    scale : float
        A factor before the unit, such as counts per volt.
    bits : int, optional
        The column holds whole numbers of so many bits in two's complement.
    clock_offset : float
        How late the column's clock is [s]: what is stamped t was taken at t − clock_offset.
    """

    source: str | int
    unit: str | None = None
    sign: int = 1
    scale: float = 1.0
    bits: int | None = None
    clock_offset: float = 0.0


ColumnSpec = str | int | tuple[str | int, str] | ColumnSource | Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Picked:
    """Channels of a table in SI units, how late each is [s], and what was done, in sentences.

    `table` is the one that they were picked from, with all of its columns on their clock.
    """

    channels: dict[str, NDArray[np.float64]]
    late: dict[str, float]
    notes: tuple[str, ...]
    table: Table


def picked(table: Table, columns: Mapping[str, ColumnSpec] | None) -> Picked:
    """Return the channels that the map names, and those whose column has a channel's name.

    Raises
    ------
    InputError
        For an unknown channel, column or unit, a cell that is no number, two channels made
        of one column, columns of unequal length.
    """
    chosen = {name: _with_unit(table, name, at) for name, at in _chosen(table, columns).items()}
    table.require_room({table.index(at.source) for at in chosen.values()})
    table = on_one_clock(table, {name: table.index(at.source) for name, at in chosen.items()})
    channels, notes = {}, []
    for channel, at in chosen.items():
        number = table.index(at.source)
        values = _numbers(table, channel, number)
        if at.bits is not None:
            values = _signed(table, channel, values, at.bits)
        channels[channel] = _scaled(table, channel, values, at)
        notes.append(_note(table, channel, at))
    _require_equal_length(table, channels, chosen)
    said = (listed(filter(None, notes)),) if any(notes) else ()
    late = {name: at.clock_offset for name, at in chosen.items() if at.clock_offset}
    used = {table.index(at.source) for at in chosen.values()}
    unused = [
        table.title(n).removeprefix("column ") for n in range(len(table.data)) if n not in used
    ]
    ignored = (f"ignored columns: {listed(unused)}",) if unused else ()
    return Picked(channels, late, (*said, *ignored), table)


def _chosen(table: Table, columns: Mapping[str, ColumnSpec] | None) -> dict[str, ColumnSource]:
    chosen = {name: _source(table, name, spec) for name, spec in (columns or {}).items()}
    owners: dict[int, str] = {}
    for channel, at in chosen.items():
        number = table.index(at.source)
        if number in owners:
            raise InputError(
                f"{table.label}: {table.title(number)} is mapped to both "
                f"'{owners[number]}' and '{channel}'; map it to one"
            )
        owners[number] = channel
    for number, name in enumerate(table.names or ()):
        if name in CHANNELS and name not in chosen and number not in owners:
            chosen[name] = ColumnSource(name)
    if not chosen.keys() - ({"time"} if table.series else set()):
        what = (
            f"names {listed(table.names)} that are no channels"
            if table.names
            else "columns without names"
        )
        raise InputError(
            f"{table.label}: has {what}; say which is which with a column map (flexspline init "
            "guesses one), or with columns={'output_position': ('q', 'deg'), ...}"
        )
    return chosen


def _with_unit(table: Table, channel: str, at: ColumnSource) -> ColumnSource:
    """Return the source with the unit that the file states, where the map states none.

    Counts that a scale or bits of the map make a quantity need no unit beside it, nor does a switch
    or a date.

    Raises
    ------
    InputError
        Where that unit is not known as one of the channel.
    """
    number = table.index(at.source)
    stated = table.units[number] if table.units and at.unit is None else None
    if stated is None or states_no_unit(stated) or CHANNELS[channel].unit == "0/1":
        return at
    if _in_counts(stated) and (at.scale != 1.0 or at.bits is not None):
        return at
    bare = without_remark(stated)
    for unit in (canonical_unit(stated), canonical_unit(bare), bare):
        if unit and _measures(channel, unit):
            return replace(at, unit=unit)
    if channel == "time" and _is_date(table.column(number)):
        return at
    raise InputError(_unknown_unit(table, channel, number, stated))


def _in_counts(stated: str) -> bool:
    return without_remark(stated).lower() in COUNTS


def _measures(channel: str, unit: str) -> bool:
    try:
        to_si(channel, unit)
    except InputError:
        return False
    return True


def _is_date(column: NDArray[Any]) -> bool:
    """Whether a column holds dates or times of day: these are read as seconds, come what may."""
    return column.dtype.kind in "mM" or (len(column) > 0 and is_stamp(column[0]))


def _unknown_unit(table: Table, channel: str, number: int, stated: str) -> str:
    """Return a sentence: what the file states of a column, and how a map says what it is."""
    wanted, counts = CHANNELS[channel].unit, _in_counts(stated)
    why = f"does not measure what is in {wanted}" if _is_unit(wanted, stated) else "is not known"
    why = "does not say what one is" if counts else why
    source = table.names[number] if table.names else number
    entry = f'source = {json.dumps(source, ensure_ascii=False)}, unit = "{_example(wanted)}"'
    entry += ", scale = 0.001" if counts else ""
    return (
        f"{table.label}: {table.title(number)}, as the file states: unit '{shortened(stated)}' "
        f"{why}; state it in the column map, such as {channel} = {{{entry}}}, as "
        f"{' or '.join(USUAL.get(wanted, [wanted]))} or whatever it is"
    )


def _is_unit(wanted: str, stated: str) -> bool:
    try:
        return len(stated) <= LONGEST_UNIT and _measuring(wanted, stated.strip()) is not None
    except Exception:  # pint raises many kinds
        return False


def _source(table: Table, channel: str, spec: ColumnSpec) -> ColumnSource:
    where = f"{table.label}: channel '{channel}'"
    if channel not in CHANNELS:
        raise InputError(
            f"{where} is not known{did_you_mean(channel, CHANNELS)}; "
            f"the channels are {listed(CHANNELS)}"
        )
    if isinstance(spec, Mapping):
        spec = _from_keys(where, spec)
    elif isinstance(spec, (tuple, list)) and len(spec) == 2:
        spec = ColumnSource(*spec)
    elif isinstance(spec, (str, int)) and not isinstance(spec, bool):
        spec = ColumnSource(spec)
    if not isinstance(spec, ColumnSource) or not isinstance(spec.source, (str, int)):
        raise InputError(
            f"{where} is mapped to {spec!r}; give a name, a number, (name, unit) or a ColumnSource"
        )
    if spec.sign not in (1, -1):
        raise InputError(f"{where} has sign {spec.sign!r}; give 1 or -1")
    for key in ("scale", "clock_offset"):
        value = getattr(spec, key)
        if not (isinstance(value, (int, float)) and math.isfinite(value)):
            raise InputError(f"{where} has {key} {value!r}; give a number")
    if not (spec.bits is None or (isinstance(spec.bits, int) and 2 <= spec.bits <= 52)):
        raise InputError(f"{where} has bits {spec.bits!r}; give a whole number such as 16")
    return spec


def _from_keys(where: str, spec: Mapping[str, Any]) -> ColumnSource:
    known = [field.name for field in fields(ColumnSource)]
    for key in spec:
        if key not in known:
            raise InputError(
                f"{where} has an unknown key '{key}'{did_you_mean(key, known)}; "
                f"the keys are {listed(known)}"
            )
    if "source" not in spec:
        raise InputError(f"{where} has no source; give a column's name or number")
    return ColumnSource(**spec)


def _numbers(table: Table, channel: str, number: int) -> NDArray[np.float64]:
    """Return one column as float64, the very array where it already is."""
    column = table.column(number)
    if column.dtype.kind in "mM":
        if len(column) == 0:
            return np.zeros(0)
        seconds: NDArray[np.float64] = (column - column[0]) / np.timedelta64(1, "s")
        return seconds
    if channel == "time" and column.dtype.kind in "iu" and len(column):
        return _from_first_where_large(column)
    if column.dtype.kind in "biuf":
        return column.astype(np.float64, copy=False)
    if column.dtype.kind == "c":
        raise InputError(
            f"{table.label}: {table.title(number)} holds complex numbers where "
            f"'{channel}' needs real ones; give their real part"
        )
    import pandas

    series = pandas.Series(column, dtype=object)  # as text it refuses halves of characters
    stamps = seconds_of_stamps(column) if channel == "time" and is_stamp(column[0]) else None
    if stamps is not None:
        return stamps
    try:
        values = pandas.to_numeric(series, errors="coerce").to_numpy(np.float64, na_value=np.nan)
    except OverflowError as error:
        raise InputError(
            f"{table.label}: {table.title(number)} holds a whole number beyond all "
            "floating point; correct it"
        ) from error
    wrong = np.flatnonzero(np.isnan(values) & series.notna().to_numpy())
    if len(wrong):
        row = int(wrong[0])
        raise InputError(
            f"{table.label}: {table.place(row)}, {table.title(number)} is {str(column[row])!r} "
            f"where '{channel}' needs a number; correct or empty the cell"
            + (", or leave the row out with drop_rows=1" if row == 0 else "")
        )
    return np.asarray(values, dtype=np.float64)


def _from_first_where_large(stamps: NDArray[Any]) -> NDArray[np.float64]:
    """Return whole numbers as they are, or from the first where doubles would not tell them apart.

    Nanoseconds since 1970 are beyond 2⁵³.
    """
    if np.abs(stamps[0]) > 2**53:
        stamps = stamps - stamps[0]
    return stamps.astype(np.float64, copy=False)


def _signed(
    table: Table, channel: str, values: NDArray[np.float64], bits: int
) -> NDArray[np.float64]:
    """Return whole numbers of `bits` bits in two's complement as signed numbers."""
    turn = 2.0**bits
    wrong = np.flatnonzero((values != np.floor(values)) | (values < -turn / 2) | (values >= turn))
    if len(wrong):
        row = int(wrong[0])
        raise InputError(
            f"{table.label}: {table.place(row)}, '{channel}' is {values[row]:g}, no "
            f"whole number of {bits} bits; correct bits= in the column map"
        )
    return np.where(values >= turn / 2, values - turn, values)


def _scaled(
    table: Table, channel: str, values: NDArray[np.float64], at: ColumnSource
) -> NDArray[np.float64]:
    try:
        factor, offset = (1.0, 0.0) if at.unit is None else to_si(channel, at.unit)
    except InputError as error:
        raise InputError(f"{table.label}: {error}") from error
    factor *= at.sign * at.scale
    if factor != 1.0:
        values = values * factor
    return values + offset if offset else values


def _note(table: Table, channel: str, at: ColumnSource) -> str:
    """Say where a channel comes from, unless its column already has its name, unit and sign."""
    if at == ColumnSource(channel):
        return ""
    said = f"{channel} is {table.title(table.index(at.source))}"
    said += f" in {at.unit}" if at.unit else ""
    said += f" of {at.bits} bits in two's complement" if at.bits is not None else ""
    said += f" times {at.sign * at.scale:g}" if at.sign * at.scale != 1 else ""
    return said


def _require_equal_length(
    table: Table, channels: Mapping[str, NDArray[np.float64]], chosen: Mapping[str, ColumnSource]
) -> None:
    first = next(iter(channels))
    for name, values in channels.items():
        if len(values) != len(channels[first]):
            raise InputError(
                f"{table.label}: {table.title(table.index(chosen[name].source))} has "
                f"{len(values)} rows where {table.title(table.index(chosen[first].source))} has "
                f"{len(channels[first])}; give columns of equal length"
            )


def to_si(channel: str, unit: str) -> tuple[float, float]:
    """Return (factor, offset) with value in the channel's SI unit = factor · x + offset.

    Parameters
    ----------
    channel : str
        A name of `CHANNELS`.
    unit : str
        Names that pint understands, with prefixes, products, quotients and small powers: "deg",
        "rpm", "mNm", "N*m", "deg/s^2", "mV", "degC", "%" ... "Nm" is newton metre. The empty text
        is a plain number.

    Raises
    ------
    InputError
        Where the unit is unknown, or measures something else than the channel.
    """
    wanted = CHANNELS[channel].unit
    usual = USUAL.get(wanted, {}).get(unit) if isinstance(unit, str) else None
    return (usual, 0.0) if usual is not None else _by_pint(channel, wanted, unit)


def _by_pint(channel: str, wanted: str, unit: str) -> tuple[float, float]:
    registry = _registry()
    try:
        if not (isinstance(unit, str) and len(unit) <= LONGEST_UNIT):
            raise ValueError
        source = _measuring(wanted, unit.strip())
    except Exception as error:  # pint raises many kinds, its parser's and tokenizer's among them
        raise InputError(
            f"channel '{channel}': unit '{shortened(unit)}' is not known; "
            f"give one such as '{_example(wanted)}'"
        ) from error
    target = registry.Unit(_PINT_NAMES.get(wanted, wanted))
    if registry.get_root_units(source)[1] != registry.get_root_units(target)[1]:
        raise InputError(
            f"channel '{channel}': unit '{unit}' does not measure what is in "
            f"{wanted}; give one such as '{_example(wanted)}'"
        )
    zero, one, far = (
        float(registry.Quantity(x, source).to(target).magnitude) for x in (0.0, 1.0, 1e6)
    )
    return ((far - zero) / 1e6 if zero else one), zero  # far: an offset costs no digits


def _measuring(wanted: str, unit: str) -> Any:
    """Return pint's unit, as it is written if that measures the same, else as it may be meant.

    Raises
    ------
    Exception
        Of many kinds, where neither is a unit.
    """
    registry = _registry()
    target = registry.get_root_units(registry.Unit(_PINT_NAMES.get(wanted, wanted)))[1]
    found = []
    for spelled in filter(None, (unit or "", canonical_unit(unit))):
        if UNIT.fullmatch(spelled):
            try:
                found.append(registry.Unit(_PINT_NAMES.get(spelled, spelled)))
            except Exception:  # pint raises many kinds
                continue
            if registry.get_root_units(found[-1])[1] == target:
                return found[-1]
    if not found and not unit:
        return registry.Unit("dimensionless")
    return found[0]


@functools.cache
def _registry() -> Any:
    """Return pint with newton metres.

    Units are compared by their root units, where an angle counts: to pint's dimensions
    1 Hz is 1 rad/s and a percentage is an angle; here both are errors.
    """
    import pint

    registry: Any = pint.UnitRegistry()
    registry.define("newton_metre = newton * metre = Nm")
    registry.define("newton_centimetre = 0.01 * newton * metre = Ncm")
    registry.define("@alias revolution = rev")
    return registry


def _example(wanted: str) -> str:
    return {
        "rad": "deg",
        "rad/s": "rpm",
        "rad/s²": "deg/s^2",
        "Nm": "mNm",
        "A": "mA",
        "V": "mV",
        "°C": "degC",
        "s": "ms",
    }.get(wanted, "%")
