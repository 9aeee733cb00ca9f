"""A log read and converted in pieces has the numbers of the log read at once."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow
import pytest
from asammdf import MDF, Signal
from cli_calls import call
from nptdms import ChannelObject, TdmsWriter
from numpy.typing import NDArray
from pyarrow import feather, parquet

import flexspline
from flexspline.errors import InputError
from flexspline.logs import Log, convert, read_log, read_pieces
from flexspline.logs.read import convert_in_pieces

ROWS = 1000
NUMBERS = np.arange(ROWS)
STAMPS = 1_700_000_000_000_000_000 + 1_000_000 * NUMBERS  # ns, beyond what doubles tell apart
TABLE = {"t": STAMPS, "q": np.sin(0.01 * NUMBERS), "i": NUMBERS.astype(np.int32) % 700}
MATRIX = np.column_stack([1e-3 * NUMBERS, TABLE["q"], TABLE["i"]])
BY_NAME = {"time": ("t", "ns"), "output_position": ("q", "deg"), "motor_current": ("i", "mA")}
BY_CLOCK = {**BY_NAME, "time": "time"}
MDF_UNITS = {"q": "deg", "i": "mA"}
BY_NUMBER = {"time": 0, "output_position": (1, "deg"), "motor_current": (2, "mA")}
FACTS: dict[str, Any] = {"torque_constant": 0.1, "gear_ratio": 100}


def hdf5(path: Path, **made: Any) -> None:
    with h5py.File(path, "w") as file:
        for name, values in made.items():
            file.create_dataset(name, data=values, chunks=True, compression="gzip")


def mdf(path: Path, table: Mapping[str, NDArray[Any]], **how: Any) -> None:
    made, clock = MDF(), 1e-3 * np.arange(len(table["q"]))
    signals = [Signal(table[name], clock, name=name, unit=unit) for name, unit in MDF_UNITS.items()]
    made.append(signals)
    made.save(path, overwrite=True, **how)
    made.close()


def tdms(path: Path, table: Mapping[str, NDArray[Any]], *, waveform: bool) -> None:
    """Three segments; the clock as properties of a waveform, or dates in a channel."""
    count = len(table["q"])
    first = np.datetime64("2026-11-28T09:00:00", "us")
    stamps = first + np.arange(count).astype("timedelta64[ms]")
    step = {"wf_increment": 1e-3, "wf_start_offset": 0.0} if waveform else {}
    channels = {name: table[name] for name in MDF_UNITS} | ({} if waveform else {"time": stamps})
    with TdmsWriter(path) as writer:
        for part in np.array_split(np.arange(count), 3):
            writer.write_segment(
                [ChannelObject("rig", name, values[part[0] : part[-1] + 1], step)
                 for name, values in channels.items()]
            )  # fmt: skip


FILES: dict[str, tuple[Callable[[Path], object], dict[str, Any]]] = {
    "groups.parquet": (
        lambda p: parquet.write_table(pyarrow.table(TABLE), p, row_group_size=300), BY_NAME,
    ),
    "dates.parquet": (
        lambda p: parquet.write_table(
            pyarrow.table({**TABLE, "t": STAMPS.astype("datetime64[ns]")}), p, row_group_size=64
        ),
        {**BY_NAME, "time": "t"},
    ),
    "bare.parquet": (
        lambda p: parquet.write_table(
            pyarrow.table(TABLE), p, row_group_size=300, write_statistics=False
        ),
        BY_NAME,
    ),
    "batches.feather": (
        lambda p: feather.write_feather(pyarrow.table(TABLE), p, chunksize=130), BY_NAME,
    ),
    "vectors.h5": (lambda p: hdf5(p, **TABLE), BY_NAME),
    "matrix.h5": (lambda p: hdf5(p, data=MATRIX), BY_NUMBER),
    "turned.h5": (lambda p: hdf5(p, data=MATRIX.T), BY_NUMBER),
    "matrix.npy": (lambda p: np.save(p, MATRIX), BY_NUMBER),
    "plain.mf4": (lambda p: mdf(p, TABLE), BY_CLOCK),
    "packed.mf4": (lambda p: mdf(p, TABLE, compression=2), BY_CLOCK),
    "waveform.tdms": (lambda p: tdms(p, TABLE, waveform=True), BY_CLOCK),
    "dates.tdms": (lambda p: tdms(p, TABLE, waveform=False), BY_CLOCK),
    "plain.csv": (
        lambda p: np.savetxt(p, MATRIX, delimiter=",", header="t,q,i", comments=""),
        {**BY_NAME, "time": "t"},
    ),
}  # fmt: skip


def made(folder: Path, name: str) -> tuple[Path, dict[str, Any]]:
    write, columns = FILES[name]
    write(folder / name)
    return folder / name, columns


def require_equal(pieces: list[Log], whole: Log) -> None:
    assert pieces[0].channels == whole.channels
    for channel in whole.channels:
        assert np.array_equal(np.concatenate([p[channel] for p in pieces]), whole[channel])


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("rows", [77, 500, 5000])
def test_pieces_have_the_numbers_of_the_whole(tmp_path: Path, name: str, rows: int) -> None:
    path, columns = made(tmp_path, name)
    for drop in (0, 7):
        pieces = list(read_pieces(path, columns, rows=rows, drop_rows=drop, **FACTS))
        require_equal(pieces, read_log(path, columns, drop_rows=drop, **FACTS))
        assert [len(p) for p in pieces[:-1]] == [rows] * (len(pieces) - 1)
        assert pieces[0].facts["torque_constant"] == 0.1


def test_time_that_is_made_of_a_rate_goes_on_from_piece_to_piece(tmp_path: Path) -> None:
    path, columns = made(tmp_path, "turned.h5")
    del columns["time"]
    pieces = list(read_pieces(path, columns, rows=99, rate=250.0))
    require_equal(pieces, read_log(path, columns, rate=250.0))


def test_sums_over_pieces_are_those_over_the_run(tmp_path: Path) -> None:
    path, columns = made(tmp_path, "groups.parquet")
    effects = ["offset", "gravity"]
    log = read_log(path, columns, **FACTS)
    pieces = read_pieces(path, columns, rows=123, **FACTS)
    parts = flexspline.accumulate(effects, pieces, "motor_torque", exact=True)
    whole = flexspline.accumulate(effects, [log], "motor_torque", exact=True)
    assert len(parts.rows) == 9
    assert parts.solve().coefficients == pytest.approx(whole.solve().coefficients, rel=1e-12)


@pytest.mark.parametrize("out", ["run.csv", "run.parquet"])
def test_a_file_converted_in_pieces_is_that_converted_at_once(tmp_path: Path, out: str) -> None:
    path, _ = made(tmp_path, "groups.parquet")
    columns = tmp_path / "map.toml"
    columns.write_text(
        '[facts]\ngear_ratio = 100\njoint = "elbow"\n[columns]\n'
        'time = {source = "t", unit = "ns"}\noutput_position = {source = "q", unit = "deg"}\n'
    )
    log = convert(path, columns, tmp_path / f"whole_{out}")
    told = convert_in_pieces(path, columns, tmp_path / out, rows=90)
    assert (told.rows, told.channels) == (ROWS, log.channels)
    again = read_log(tmp_path / out)
    require_equal([again], log)
    assert again.facts["gear_ratio"] == 100 and again.facts["joint"] == "elbow"
    if out.endswith("csv"):
        assert (tmp_path / out).read_bytes() == (tmp_path / f"whole_{out}").read_bytes()
    said = call("convert", path, "--columns", columns, "--out", tmp_path / f"cli_{out}",
                "--rows-at-once", 90)  # fmt: skip
    assert said.exit_code == 0 and "1000 rows of time, output_position" in said.stdout
    require_equal([read_log(tmp_path / f"cli_{out}")], log)


def test_nothing_is_written_where_a_later_piece_is_wrong(tmp_path: Path) -> None:
    text = [str(number) for number in NUMBERS]
    text[901] = "about seven"
    parquet.write_table(pyarrow.table({**TABLE, "q": text}), tmp_path / "a.parquet")
    columns = tmp_path / "map.toml"
    columns.write_text('[columns]\ntime = {source = "t", unit = "ns"}\noutput_position = "q"\n')
    with pytest.raises(InputError, match="data row 902, column 'q' is 'about seven'"):
        convert_in_pieces(tmp_path / "a.parquet", columns, tmp_path / "out.csv", rows=100)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.parquet", "map.toml"]


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ({"repair": "unwrap"}, "repairs look at the whole run"),
        ({"rows": 0}, "rows is 0; give how many rows"),
        ({"rows": 10, "max_memory": 1e-6}, "one group of its rows: takes .* give max_memory"),
    ],
)
def test_what_needs_the_whole_is_refused(
    tmp_path: Path, how: dict[str, Any], sentence: str
) -> None:
    path, columns = made(tmp_path, "groups.parquet")
    with pytest.raises(InputError, match=sentence):
        list(read_pieces(path, columns, **how))


def test_a_clock_of_its_own_is_refused(tmp_path: Path) -> None:
    path, columns = made(tmp_path, "groups.parquet")
    columns = {**columns, "motor_current": {"source": "i", "unit": "mA", "clock_offset": 0.01}}
    with pytest.raises(InputError, match="the clock of motor_current has an offset"):
        list(read_pieces(path, columns))


LARGE = """
import resource, sys
import flexspline
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
rows = 0
for number, piece in enumerate(flexspline.read_pieces(sys.argv[1], {"time": sys.argv[2],
                               "output_position": "q", "motor_current": "i"}, rows=100_000)):
    if number == 1:
        before = peak()
    rows += len(piece)
print(rows, peak() - before)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell a peak of memory")
@pytest.mark.parametrize("name", ["large.parquet", "large.h5", "large.mf4", "large.tdms"])
def test_memory_does_not_grow_with_the_rows(tmp_path: Path, name: str) -> None:
    """Four million rows of three numbers are 96 MB; a piece of them has 2.4 MB."""
    rows = 4_000_000
    table = {"t": 1e-3 * np.arange(rows), "q": np.zeros(rows), "i": np.ones(rows)}
    if name.endswith("h5"):
        with h5py.File(tmp_path / name, "w") as file:
            for key, values in table.items():
                file.create_dataset(key, data=values, chunks=(10_000,))
    elif name.endswith("mf4"):
        mdf(tmp_path / name, table)
    elif name.endswith("tdms"):
        tdms(tmp_path / name, table, waveform=True)
    else:
        parquet.write_table(pyarrow.table(table), tmp_path / name, row_group_size=100_000)
    clock = "time" if name.endswith(("mf4", "tdms")) else "t"
    ran = subprocess.run([sys.executable, "-c", LARGE, str(tmp_path / name), clock], check=True,
                         capture_output=True, text=True)  # fmt: skip
    seen, grown = map(int, ran.stdout.split())
    assert seen == rows
    assert grown < 30  # MB
