"""The same small run, written in every format, reads as the same log."""

from __future__ import annotations

import bz2
import gzip
import json
import lzma
import mmap
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas
import pytest
import scipy.io

from flexspline.errors import InputError
from flexspline.logs import ColumnSource, Log, formats, read_log
from flexspline.logs.formats import BEGINNING, FORMATS, Dialect

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TIME = np.arange(6) * 0.01
ANGLE = np.array([0.0, 0.1, 0.30000000000000004, 1e-320, -5.0, 1 / 3])
MATRIX = np.stack([TIME, ANGLE], axis=1)
MAP = {"time": 0, "output_position": 1}
NAMED = {"time": "t", "output_position": "q"}


def text(separator: str = ",", head: str = "t,q\n", decimal: str = ".") -> str:
    rows = [separator.join(map(repr, row)) for row in MATRIX.tolist()]
    return head.replace(",", separator) + "\n".join(rows).replace(".", decimal) + "\n"


def packed_zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("run.csv", text())


def hdf5(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["run/data"] = np.stack([TIME, ANGLE], axis=1)


def structured() -> np.ndarray:
    run = np.zeros(6, dtype=[("t", "f8"), ("q", "f8")])
    run["t"], run["q"] = TIME, ANGLE
    return run


RECORDS = [{"t": float(t), "q": float(q)} for t, q in zip(TIME, ANGLE, strict=True)]

FILES: list[tuple[str, Callable[[Path], object], dict[str, object]]] = [
    ("a.csv", lambda p: p.write_text(text()), {"columns": NAMED}),
    ("crlf.csv", lambda p: p.write_text(text(), newline="\r\n"), {"columns": NAMED}),
    ("bom.csv", lambda p: p.write_text(text(), encoding="utf-8-sig"), {"columns": NAMED}),
    ("utf16.csv", lambda p: p.write_text(text(), encoding="utf-16"), {"columns": NAMED}),
    ("semicolon.csv", lambda p: p.write_text(text(";")), {"columns": NAMED}),
    ("comma.csv", lambda p: p.write_text(text(";", decimal=",")), {"columns": NAMED}),
    ("blanks.txt", lambda p: p.write_text(text("  ", decimal=",")), {"columns": NAMED}),
    ("tabs.tsv", lambda p: p.write_text(text("\t")), {"columns": NAMED}),
    ("bare.dat", lambda p: p.write_text(text(" ", head="")), {"columns": MAP}),
    ("numpy.txt", lambda p: np.savetxt(p, MATRIX, header="t q", fmt="%.17g"), {"columns": NAMED}),
    (
        "empty_lines.csv",
        lambda p: p.write_text("\n" + text().replace("\n", "\n\n")),
        {"columns": NAMED},
    ),
    ("a.csv.gz", lambda p: p.write_bytes(gzip.compress(text().encode())), {"columns": NAMED}),
    ("a.csv.bz2", lambda p: p.write_bytes(bz2.compress(text().encode())), {"columns": NAMED}),
    ("a.csv.xz", lambda p: p.write_bytes(lzma.compress(text().encode())), {"columns": NAMED}),
    ("a.zip", packed_zip, {"columns": NAMED}),
    ("a.npy", lambda p: np.save(p, MATRIX), {"columns": MAP}),
    ("turned.npy", lambda p: np.save(p, MATRIX.T), {"columns": MAP}),
    ("named.npy", lambda p: np.save(p, structured()), {"columns": NAMED}),
    ("a.npz", lambda p: np.savez(p, t=TIME, q=ANGLE), {"columns": NAMED}),
    ("v5.mat", lambda p: scipy.io.savemat(p, {"t": TIME, "q": ANGLE}), {"columns": NAMED}),
    ("v4.mat", lambda p: scipy.io.savemat(p, {"data_1": MATRIX.T}, format="4"), {"columns": MAP}),
    (
        "struct.mat",
        lambda p: scipy.io.savemat(p, {"run": {"data": MATRIX}, "x": np.eye(3)}),
        {"columns": MAP, "variable": "run.data"},
    ),
    ("v73.mat", hdf5, {"columns": MAP, "variable": "run.data"}),
    ("a.json", lambda p: p.write_text(json.dumps(RECORDS)), {"columns": NAMED}),
    (
        "entries.json",
        lambda p: p.write_text(json.dumps({"kp": 100, "entries": RECORDS})),
        {"columns": NAMED},
    ),
    (
        "lists.json",
        lambda p: p.write_text(json.dumps({"t": [*TIME], "q": [*ANGLE]})),
        {"columns": NAMED},
    ),
]


@pytest.mark.parametrize(("name", "write", "how"), FILES, ids=[file[0] for file in FILES])
def test_every_format_gives_the_same_numbers_to_the_last_bit(
    tmp_path: Path, name: str, write: Callable[[Path], object], how: dict[str, object]
) -> None:
    write(tmp_path / name)
    log = read_log(tmp_path / name, **how)  # type: ignore[arg-type]
    np.testing.assert_array_equal(log["time"], TIME)
    np.testing.assert_array_equal(log["output_position"], ANGLE)
    assert log.source is not None and log.source.rows == 6 and len(log.source.sha256) == 64
    assert log.name == name.split(".")[0]


@pytest.mark.parametrize(
    ("source", "columns"),
    [
        (MATRIX, MAP),
        (MATRIX.T, MAP),
        (structured(), NAMED),
        ({"t": TIME, "q": ANGLE}, NAMED),
        (pandas.DataFrame({"t": TIME, "q": ANGLE}), NAMED),
        (pandas.DataFrame({"q": ANGLE}, index=pandas.Index(TIME, name="t")), NAMED),
        (pandas.DataFrame(MATRIX), MAP),
    ],
    ids=["matrix", "turned", "structured", "dictionary", "frame", "index", "numbered frame"],
)
def test_data_in_memory_gives_the_same_numbers(source: object, columns: dict[str, str]) -> None:
    log = read_log(source, columns)
    np.testing.assert_array_equal(log["output_position"], ANGLE)
    assert log.source is None


def test_a_memory_mapped_file_stays_on_disk(tmp_path: Path) -> None:
    np.save(tmp_path / "long.npy", MATRIX)
    log = read_log(tmp_path / "long.npy", MAP, drop_rows=1)
    for part in (log, log.rows(slice(1, 3))):
        owner = part["output_position"]
        while isinstance(owner, np.ndarray) and owner.base is not None:
            owner = owner.base
        assert isinstance(owner, mmap.mmap)


def test_facts_come_from_the_file_and_arguments_overrule_them(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(
        "# gear_ratio: 100\n# serial: 00123\n# name: run: one\n# mass: 0.5\n"
        "# slots: 36\ntime,duty\n0,0\n1,1\n"
    )
    log = read_log(path, gear_ratio=160, facts={"joint": 7, "gear_ratio": 50})
    assert dict(log.facts) == {
        "name": "run: one",
        "gear_ratio": 160,
        "serial": "00123",
        "mass": 0.5,
        "slots": 36,
        "joint": "7",
    }
    assert "gear_ratio 100 of the file is overruled by 160.0" in log.history


def test_units_signs_and_scales_are_applied_once() -> None:
    run = {
        "ms": [0, 10],
        "deg": [0, 180],
        "rpm": [0, 60],
        "mNm": [0, 500],
        "F": [32, 212],
        "percent": [0, 50],
        "counts": [1, 2],
    }
    log = read_log(
        run,
        {
            "time": ("ms", "ms"),
            "output_position": ("deg", "deg"),
            "motor_velocity": ("rpm", "rpm"),
            "sensor_torque": ColumnSource("mNm", "mNm", sign=-1),
            "temperature": ("F", "degF"),
            "duty": ("percent", "%"),
            "sensor_voltage": ColumnSource("counts", "mV", scale=2.5),
        },
    )
    for channel, last in {
        "time": 0.01,
        "output_position": np.pi,
        "motor_velocity": 2 * np.pi,
        "sensor_torque": -0.5,
        "temperature": 100,
        "duty": 0.5,
        "sensor_voltage": 0.005,
    }.items():
        # one multiplication and one addition: a few roundings
        assert log[channel][-1] == pytest.approx(last, rel=1e-14), channel


def test_twos_complement_is_decoded_before_anything_else() -> None:
    log = read_log(
        {"time": [0, 1, 2], "load": [1, 65535, 32768]},
        {"duty": ColumnSource("load", bits=16, scale=1 / 885)},
    )
    np.testing.assert_allclose(log["duty"] * 885, [1, -1, -32768], rtol=1e-15)


def test_missing_time_stamps_are_made_of_the_rate() -> None:
    log = read_log({"duty": [0, 1, 2]}, rate=200)
    np.testing.assert_array_equal(log["time"], [0, 0.005, 0.01])
    assert "time is made of 200 Hz" in log.history


def test_motor_torque_is_current_times_the_torque_constant() -> None:
    log = read_log({"time": [0, 1], "motor_current": [1, 2]}, torque_constant=0.5)
    np.testing.assert_array_equal(log["motor_torque"], [0.5, 1.0])
    assert any("motor_torque is motor_current times 0.5 Nm/A" in said for said in log.history)


def test_a_measured_motor_torque_is_not_replaced() -> None:
    run = {"time": [0, 1], "motor_current": [1, 2], "motor_torque": [9, 9]}
    assert read_log(run, torque_constant=0.5)["motor_torque"][0] == 9


def test_a_late_column_is_moved_where_it_belongs() -> None:
    time = np.arange(101) / 100
    log = read_log(
        {"time": time, "output_position": time, "late": time - 0.05},
        {"output_velocity": ColumnSource("late", clock_offset=0.05)},
    )
    np.testing.assert_allclose(log["output_velocity"], log["output_position"], atol=1e-15)
    assert len(log) == 96


def test_ignored_columns_are_named_even_if_they_hold_text(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text('time,duty,remark\n0,0,"start, all well"\n1,1,\n')
    assert "ignored columns: 'remark'" in read_log(path).history


def test_an_empty_cell_is_no_number_and_no_error(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,duty\n0,\n1,1\n")
    assert np.isnan(read_log(path)["duty"][0])


def test_stamps_of_date_and_time_become_seconds_from_the_first() -> None:
    frame = pandas.DataFrame(
        {"time": pandas.date_range("2026-01-01", periods=3, freq="10ms"), "duty": [0, 1, 2]}
    )
    np.testing.assert_allclose(read_log(frame)["time"], [0, 0.01, 0.02], rtol=1e-15)


def test_two_logs_of_one_file_have_the_same_checksum(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,duty\n0,0\n1,1\n")
    first, second = read_log(path), read_log(path)
    assert first.source == second.source


def test_a_log_is_a_log() -> None:
    assert isinstance(read_log({"time": [0, 1]}), Log)


def test_a_later_change_of_the_frame_does_not_change_the_log() -> None:
    frame = pandas.DataFrame({"time": TIME, "duty": ANGLE})
    log = read_log(frame)
    frame.loc[0, "duty"] = 9
    assert log["duty"][0] == 0


def test_an_impossible_fact_of_the_file_can_be_overruled(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("# slots: A, B\ntime,duty\n0,0\n1,1\n")
    assert read_log(path, slots=36).facts["slots"] == 36


def test_time_can_be_sorted_before_a_late_column_is_moved() -> None:
    run = {"time": [2, 1, 0], "x": [0, -1, -2]}
    log = read_log(run, {"duty": ColumnSource("x", clock_offset=1)}, repair="sort_time")
    np.testing.assert_array_equal(log["duty"], [-1, 0])


def test_a_line_of_units_is_left_out_before_anything_is_taken_for_text(tmp_path: Path) -> None:
    path = tmp_path / "daq.txt"
    path.write_text("Zeit;Moment\n[s];[Nm]\n\n0,5;0,30000000000000004\n1,5;-2\n", encoding="utf-8")
    log = read_log(path, {"time": "Zeit", "sensor_torque": "Moment"}, drop_rows=1)
    np.testing.assert_array_equal(log["time"], [0.5, 1.5])
    np.testing.assert_array_equal(log["sensor_torque"], [0.30000000000000004, -2])
    assert log.source is not None and log.source.rows == 3
    with pytest.raises(InputError, match=r"line 2\).*leave the row out with drop_rows=1"):
        read_log(path, {"time": "Zeit", "sensor_torque": "Moment"})


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "|"])
def test_numbers_are_read_the_same_with_and_without_pandas(
    separator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    chance = np.random.default_rng(4)
    cells = chance.normal(size=(300, 4)) * 10.0 ** chance.integers(-300, 15, (300, 4))
    cells[7] = np.nan, 0.1, -0.0, 2.0**52
    cells[:, 3] = np.arange(300)
    rows = [separator.join(map(repr, row)) for row in cells.tolist()]
    content = "\n".join(["# note: x", separator.join("abcd"), *rows[:9], "", *rows[9:]])
    with monkeypatch.context() as patch:
        patch.delattr(formats, "_parsed")
        quick = formats.read_delimited(content.encode(), "run.csv", Dialect(), drop_rows=3)
    monkeypatch.setattr(formats, "_numbers", lambda *_: None)
    slow = formats.read_delimited(content.encode(), "run.csv", Dialect(), drop_rows=3)
    assert len(quick.data[0]) == 297
    for one, other in zip(quick.data, slow.data, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    "cell", ["", "NA", "9007199254740993", '"1.5"', "1,5", "True", "12:00:01", "1e999"]
)
def test_what_is_no_plain_number_is_left_to_pandas(cell: str) -> None:
    body = f"1.0;2.0\n3.0;{cell}\n"
    assert formats._numbers("1.0;2.0\n3.0;4.0\n", ";", ".", 0, (2, 2)) is not None
    assert formats._numbers(body, ";", ".", 0, (2, 2)) is None


def test_the_docstring_of_read_log_tells_every_format() -> None:
    doc = " ".join((read_log.__doc__ or "").split())
    for form in FORMATS:
        assert f"- {form}: {form.says}" in doc
        assert not form.extra or form.install in doc


def test_what_installs_the_library_of_a_format_is_an_extra_of_the_package() -> None:
    content = (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    extras = tomllib.loads(content)["project"]["optional-dependencies"]
    assert {form.extra for form in FORMATS} - {""} <= set(extras)


def test_no_two_formats_have_one_suffix_or_one_beginning() -> None:
    suffixes = [suffix for form in FORMATS for suffix in form.suffixes]
    assert len(set(suffixes)) == len(suffixes)
    assert all(suffix == suffix.lower() and suffix[0] == "." for suffix in suffixes)
    magic = [each for form in FORMATS for each in form.magic]
    assert all(len(each) <= BEGINNING for each in magic)
    assert not [(a, b) for a in magic for b in magic if a is not b and a.startswith(b)]


def test_what_is_no_text_and_has_no_known_name_names_every_format(tmp_path: Path) -> None:
    (tmp_path / "run.dat").write_bytes(b"1\0 2")
    with pytest.raises(InputError, match="not a text file") as told:
        read_log(tmp_path / "run.dat")
    assert all(form.suffixes[0] in str(told.value) for form in FORMATS)
