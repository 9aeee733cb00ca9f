"""Parquet, Feather, and tables of polars and xarray read as the same run in a CSV does."""

from __future__ import annotations

import gzip
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import polars
import pyarrow
import pytest
import xarray
from cli_calls import call
from pyarrow import feather, parquet

import flexspline
from flexspline.errors import InputError
from flexspline.logs import Log, read_log
from flexspline.logs.read import joints_of, read_runs

TIME = np.arange(200) * 0.01
ANGLE = np.sin(7.0 * TIME)
TORQUE = np.round(1e3 * np.cos(3.0 * TIME)).astype(np.int32)
MAP = {"time": "t", "output_position": "q", "sensor_torque": "tau"}
UNITS = {"t": "s", "q": "deg", "tau": "mNm"}
FRAME = pandas.DataFrame({"t": TIME, "q": np.degrees(ANGLE), "tau": TORQUE, "note": "x"})


def table(**more: Any) -> pyarrow.Table:
    """The run with its units in the metadata of its fields."""
    arrays = {"t": TIME, "q": np.degrees(ANGLE), "tau": TORQUE, **more}
    made = {name: pyarrow.array(values) for name, values in arrays.items()}
    fields = [pyarrow.field(name, array.type, metadata={"unit": UNITS.get(name, "")})
              for name, array in made.items()]  # fmt: skip
    schema = pyarrow.schema(fields, metadata={"gear_ratio": "100", "joint": "elbow"})
    return pyarrow.table(list(made.values()), schema=schema)


def with_attributes() -> pandas.DataFrame:
    frame = FRAME.copy()
    frame.attrs = {"units": UNITS, "gear_ratio": 100, "joint": "elbow"}
    return frame


def dataset() -> xarray.Dataset:
    names = {"q": "deg", "tau": "mNm"}
    made = {name: ("t", FRAME[name].to_numpy(), {"units": unit}) for name, unit in names.items()}
    attributes = {"gear_ratio": 100, "joint": "elbow"}
    return xarray.Dataset(made, coords={"t": TIME}, attrs=attributes)


def gzipped(path: Path) -> None:
    parquet.write_table(table(), path)
    path.write_bytes(gzip.compress(path.read_bytes()))


FILES: dict[str, Callable[[Path], object]] = {
    "a.parquet": lambda p: parquet.write_table(table(), p),
    "groups.parquet": lambda p: parquet.write_table(table(), p, row_group_size=7),
    "zstd.pq": lambda p: parquet.write_table(table(), p, compression="zstd", data_page_size=64),
    "attributes.parquet": lambda p: with_attributes().to_parquet(p),
    "packed.parquet.gz": gzipped,
    "by_its_beginning": lambda p: parquet.write_table(table(), p),
    "a.feather": lambda p: feather.write_feather(table(), p),
    "chunks.arrow": lambda p: feather.write_feather(table(), p, "zstd", chunksize=9),
    "attributes.feather": lambda p: with_attributes().to_feather(p),
}
SOURCES = {"pandas": with_attributes, "xarray": dataset}


def require_the_run(log: Log) -> None:
    assert np.allclose(log["time"], TIME, rtol=0, atol=0)
    assert log["output_position"] == pytest.approx(ANGLE, abs=1e-15)
    assert log["sensor_torque"] == pytest.approx(1e-3 * TORQUE, abs=1e-15)
    assert log.facts["gear_ratio"] == 100 and log.facts["joint"] == "elbow"


@pytest.mark.parametrize("name", FILES)
def test_a_file_reads_with_its_units_and_facts(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    require_the_run(read_log(tmp_path / name, MAP))


@pytest.mark.parametrize("name", SOURCES)
def test_a_table_in_memory_reads_with_its_units_and_facts(name: str) -> None:
    require_the_run(read_log(SOURCES[name](), MAP))


def test_polars_has_no_units() -> None:
    frame = polars.DataFrame({"t": TIME, "q": ANGLE, "tau": TORQUE})
    log = read_log(frame, {**MAP, "sensor_torque": ("tau", "mNm")})
    assert np.array_equal(log["output_position"], ANGLE)
    assert np.array_equal(flexspline.logs.read.as_log(frame.rename({"t": "time"}))["time"], TIME)


def test_a_unit_of_the_map_overrules_that_of_the_file(tmp_path: Path) -> None:
    parquet.write_table(table(), tmp_path / "a.parquet")
    log = read_log(tmp_path / "a.parquet", {**MAP, "output_position": ("q", "rad")})
    assert np.array_equal(log["output_position"], np.degrees(ANGLE))


def test_only_columns_that_become_channels_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parquet.write_table(table(wide=np.zeros(200)), tmp_path / "a.parquet")
    asked: list[str] = []
    read = parquet.ParquetFile.read

    def watched(self: parquet.ParquetFile, columns: list[str], **how: Any) -> pyarrow.Table:
        asked.extend(columns)
        return read(self, columns=columns, **how)

    monkeypatch.setattr(parquet.ParquetFile, "read", watched)
    log = read_log(tmp_path / "a.parquet", MAP)
    assert sorted(asked) == ["q", "t", "tau"]
    assert "ignored columns: 'wide'" in log.history


def test_structs_and_lists_are_columns_with_places_for_joints(tmp_path: Path) -> None:
    both = np.stack([ANGLE, 2.0 * ANGLE], axis=1)
    state = [{"q": list(row), "t": time} for row, time in zip(both, TIME, strict=True)]
    parquet.write_table(pyarrow.table({"arm": state}), tmp_path / "a.parquet")
    columns = {"time": "arm.t", "output_position": "arm.q[{joint-1}]"}
    assert joints_of(tmp_path / "a.parquet", columns) == ("1", "2")
    log = read_log(tmp_path / "a.parquet", columns, joint=2)
    assert np.array_equal(log["output_position"], 2.0 * ANGLE)


@pytest.mark.parametrize(
    ("values", "reads"),
    [
        (pyarrow.array([None, *ANGLE[1:]]), [np.nan, *ANGLE[1:]]),
        (pyarrow.array([None, *TORQUE[1:].tolist()]), [np.nan, *TORQUE[1:]]),
        (pyarrow.array([None, *[True] * 199]), [np.nan, *[1.0] * 199]),
        (pyarrow.array(TORQUE).cast(pyarrow.decimal128(12, 2)), TORQUE),
        (pyarrow.array([str(x) for x in TORQUE]).dictionary_encode(), TORQUE),
        (pyarrow.array(ANGLE.astype(np.float16)), ANGLE.astype(np.float16)),
    ],
    ids=["empty", "empty counts", "empty switch", "decimal", "dictionary of text", "half"],
)
def test_numbers_of_any_kind_are_numbers(
    values: pyarrow.Array, reads: np.ndarray, tmp_path: Path
) -> None:
    parquet.write_table(pyarrow.table({"time": TIME, "x": values}), tmp_path / "a.parquet")
    log = read_log(tmp_path / "a.parquet", {"output_position": "x"})
    assert np.array_equal(log["output_position"], np.asarray(reads, dtype=float), equal_nan=True)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_time_stamps_are_seconds_from_the_first(unit: str, tmp_path: Path) -> None:
    stamps = (1_800_000_000_000 + np.arange(200) * 10).astype("datetime64[ms]")
    rows = pyarrow.array(stamps).cast(pyarrow.timestamp(unit, "UTC"), safe=False)
    parquet.write_table(pyarrow.table({"time": rows, "x": ANGLE}), tmp_path / "a.parquet")
    log = read_log(tmp_path / "a.parquet", {"output_position": "x"})
    whole = np.floor(TIME) if unit == "s" else TIME
    assert log["time"] == pytest.approx(whole, abs=1e-9)


def test_a_file_of_several_runs_is_cut_by_a_column_of_text(tmp_path: Path) -> None:
    runs = np.repeat(["a", "b"], 100)
    parquet.write_table(table(run=runs), tmp_path / "a.parquet")
    made = read_runs(tmp_path / "a.parquet", MAP, split_column="run")
    assert [len(run) for run in made] == [100, 100]
    assert np.array_equal(made[1]["time"], TIME[100:])


def test_commands_read_it_and_init_takes_its_units(tmp_path: Path) -> None:
    recording, made = tmp_path / "a.parquet", tmp_path / "map.toml"
    names = {"t": "t [s]", "q": "joint position", "tau": "joint torque"}
    parquet.write_table(table().rename_columns([names[n] for n in MAP.values()]), recording)
    assert call("init", str(recording), "--out", str(made)).exit_code == 0
    said = call("convert", str(recording), "--columns", str(made), "--out", f"{tmp_path}/run.csv")
    assert said.exit_code == 0, said.output
    assert read_log(tmp_path / "run.csv")["output_position"] == pytest.approx(ANGLE, abs=1e-15)


def test_rows_at_the_start_are_dropped(tmp_path: Path) -> None:
    parquet.write_table(table(), tmp_path / "a.parquet")
    assert np.array_equal(read_log(tmp_path / "a.parquet", MAP, drop_rows=5)["time"], TIME[5:])


def test_a_second_dimension_of_xarray_is_of_joints() -> None:
    both = np.stack([ANGLE, 2.0 * ANGLE])
    made = xarray.Dataset(
        {"q": (("joint", "time"), both)}, coords={"time": TIME, "joint": ["hip", "knee"]}
    )
    columns = {"output_position": "q[{joint}]"}
    assert joints_of(made, columns) == ("hip", "knee")
    assert np.array_equal(read_log(made, columns, joint="knee")["output_position"], 2.0 * ANGLE)


def test_two_dimensions_of_xarray_are_laid_on_the_faster_clock() -> None:
    slow = np.arange(0.5, 1.51, 0.1)
    made = xarray.Dataset(
        {"q": ("t", ANGLE), "theta": ("ms", 20.0 + slow, {"units": "degC"})},
        coords={"t": TIME, "ms": ("ms", 1e3 * slow, {"units": "ms"})},
    )
    log = read_log(made, {"output_position": "q", "temperature": "theta"})
    assert log["time"] == pytest.approx(TIME[50:151]) and len(log) == 101
    assert np.array_equal(log["output_position"], ANGLE[50:151])
    assert log["temperature"] == pytest.approx(20.0 + TIME[50:151], abs=1e-12)
    assert any("101 samples of dimension 't'" in said for said in log.history)


def test_without_the_library_the_command_that_installs_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parquet.write_table(table(), tmp_path / "a.parquet")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"pip install 'flexspline\[parquet\]'$"):
        read_log(tmp_path / "a.parquet", MAP)


def truncated(path: Path) -> None:
    parquet.write_table(table(), path)
    path.write_bytes(path.read_bytes()[:-20])


def damaged(path: Path) -> None:
    parquet.write_table(table(), path, compression="zstd")
    content = bytearray(path.read_bytes())
    content[40:400] = bytes(360)
    path.write_bytes(bytes(content))


def twice(path: Path) -> None:
    parquet.write_table(pyarrow.table([TIME, TIME], names=["t", "t"]), path)


def ragged(path: Path) -> None:
    lists = [[1.0, 2.0], *[[1.0]] * 199]
    parquet.write_table(pyarrow.table({"t": TIME, "q": lists}), path)


def constant(path: Path) -> None:
    """Ten million rows in a few kilobytes."""
    same = np.zeros(10_000_000, dtype=np.int8)
    parquet.write_table(pyarrow.table({"t": same, "q": same}), path, compression="zstd")
    assert path.stat().st_size < 100_000


WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "truncated": (truncated, "not a Parquet file, or a damaged one"),
    "damaged inside": (damaged, "not a Parquet file, or a damaged one"),
    "no Parquet": (lambda p: p.write_bytes(b"t,q\n1,2\n"), "not a Parquet file"),
    "Feather that is none": (lambda p: p.with_suffix(".feather").write_bytes(b"ARROW1\0\0" * 9),
                             "not a Feather file, or a damaged one"),
    "a name twice": (twice, "has two columns of the name 't'"),
    "ragged lists": (ragged, "has some of 2, 1 cells"),
    "no rows": (lambda p: parquet.write_table(table().slice(0, 0), p), "no rows of data"),
    "one row": (lambda p: parquet.write_table(table().slice(0, 1), p), "only one row of data"),
    "no columns": (lambda p: parquet.write_table(pyarrow.table({}), p), "no rows of data"),
    "more than memory": (constant, "takes 0.16 GB of memory or more"),
    "a unit of no torque": (lambda p: parquet.write_table(_in_volts(), p),
                            "unit 'V' does not measure what is in Nm"),
    "bytes": (lambda p: parquet.write_table(pyarrow.table({"t": TIME, "q": [b"x"] * 200}), p),
              "column 'q' holds binary where a channel needs numbers"),
    "text": (lambda p: parquet.write_table(pyarrow.table({"t": TIME, "q": ["x"] * 200}), p),
             "column 'q' is 'x' where 'output_position' needs a number"),
}  # fmt: skip


def _in_volts() -> pyarrow.Table:
    field = pyarrow.field("tau", pyarrow.float64(), metadata={"unit": "V"})
    schema = pyarrow.schema([("t", pyarrow.float64()), ("q", pyarrow.float64()), field])
    return pyarrow.table([TIME, ANGLE, ANGLE], schema=schema)


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_one_sentence_with_the_files_name(case: str, tmp_path: Path) -> None:
    write, says = WRONG[case]
    write(tmp_path / "a.parquet")
    (file,) = tmp_path.iterdir()
    columns = {"time": "t", "output_position": "q"}
    if case == "ragged lists":
        columns["output_position"] = "q[0]"
    if case == "a unit of no torque":
        columns["sensor_torque"] = "tau"
    with pytest.raises(InputError) as caught:
        read_log(file, columns, max_memory=0.01)
    said = str(caught.value)
    assert said.startswith(str(file)) and says in said and "; " in said and "\n" not in said


def test_a_command_that_fails_writes_nothing(tmp_path: Path) -> None:
    truncated(tmp_path / "a.parquet")
    (tmp_path / "map.toml").write_text('[columns]\ntime = "t"\n')
    out = tmp_path / "run.csv"
    made = call("convert", str(tmp_path / "a.parquet"), "--columns", str(tmp_path / "map.toml"),
                "--out", str(out))  # fmt: skip
    assert made.exit_code == 2 and not out.exists()


def test_a_variable_of_a_table_is_refused(tmp_path: Path) -> None:
    parquet.write_table(table(), tmp_path / "a.parquet")
    with pytest.raises(InputError, match="leave variable out"):
        read_log(tmp_path / "a.parquet", MAP, variable="t")


def test_three_dimensions_of_xarray_are_refused() -> None:
    with pytest.raises(InputError, match="'q' has 3 dimensions"):
        read_log(xarray.Dataset({"q": (("a", "b", "c"), np.zeros((9, 2, 2)))}), {})


def test_dimensions_without_a_clock_are_refused() -> None:
    made = xarray.Dataset({"q": ("a", ANGLE), "x": ("b", TIME[:9])}, coords={"a": TIME})
    with pytest.raises(InputError, match="dimension 'b' has no coordinate of times"):
        read_log(made, {"output_position": "q"})
