"""A unit that a file states counts, or is an error: an unknown one is never read as SI.

What recorders write where a column has no unit is none, and the unit of a map goes before it.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pandas
import pytest
from cli_calls import call

from flexspline import InputError, guess_map, read_log
from flexspline.logs.columns import ColumnSource, picked
from flexspline.logs.table import Table

TIME = np.arange(400) * 0.005
ANGLE = np.sin(TIME)
TORQUE = 3.0 * np.cos(2.0 * TIME)


def hdf5(path: Path, unit: str) -> dict[str, bool]:
    with h5py.File(path, "w") as file:
        for name, values, said in (
            ("time", TIME, "s"),
            ("output_position", ANGLE, "rad"),
            ("motor_torque", TORQUE, unit),
        ):
            file.create_dataset(name, data=values).attrs["units"] = said
    return {}


def rows(path: Path, unit: str) -> dict[str, bool]:
    body = "\n".join(f"{t},{q},{m}" for t, q, m in zip(TIME, ANGLE, TORQUE, strict=True))
    path.write_text(f"time,output_position,motor_torque\ns,rad,{unit}\n{body}\n", encoding="utf-8")
    return {"units_row": True}


def parquet(path: Path, unit: str) -> dict[str, bool]:
    frame = pandas.DataFrame(
        {"time": TIME, "output_position": ANGLE, "motor_torque": TORQUE},
    )
    frame.attrs["units"] = {"motor_torque": unit}
    frame.to_parquet(path)
    return {}


FORMATS = {".h5": hdf5, ".csv": rows, ".parquet": parquet}


@pytest.mark.parametrize("ending", FORMATS)
def test_a_stated_unit_that_is_not_known_is_an_error_and_none_of_the_map_is(
    ending: str, tmp_path: Path
) -> None:
    file = tmp_path / f"run{ending}"
    how = FORMATS[ending](file, "foo")
    with pytest.raises(InputError) as caught:
        read_log(file, **how)
    said = str(caught.value)
    assert said.startswith(f"{file}: column 'motor_torque'") and "unit 'foo' is not known" in said
    assert 'motor_torque = {source = "motor_torque", unit = "mNm"}' in said and "\n" not in said
    log = read_log(file, {"motor_torque": ("motor_torque", "mNm")}, **how)
    assert log["motor_torque"] == pytest.approx(1e-3 * TORQUE)


@pytest.mark.parametrize("ending", FORMATS)
def test_a_prefix_of_newton_metres_counts(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"run{ending}"
    how = FORMATS[ending](file, "cNm")
    assert read_log(file, **how)["motor_torque"] == pytest.approx(1e-2 * TORQUE)


def read_as(stated: str | None, channel: str = "motor_torque", **source: object) -> np.ndarray:
    table = Table("a", (TIME, np.arange(400.0)), ("t", "y"), units=("s", stated))
    return picked(table, {"time": "t", channel: ColumnSource("y", **source)}).channels[channel]


@pytest.mark.parametrize(
    ("stated", "nm"),
    [
        ("N·m", 1.0), ("[N·m]", 1.0), ("Nm (filtered)", 1.0), ("cN m", 1e-2), ("dNm", 0.1),
        ("daNm", 10.0), ("MNm", 1e6), ("kgf·m", 9.80665), ("kgf·cm", 0.0980665),
        ("ozf·in", 0.00706155), ("oz-in", 0.00706155), ("lbf·ft", 1.355818), ("ft-lb", 1.355818),
        ("lbf·in", 0.1129848),
    ],
)  # fmt: skip
def test_a_torque_is_read_in_the_unit_that_its_file_states(stated: str, nm: float) -> None:
    assert read_as(stated) == pytest.approx(nm * np.arange(400.0), rel=1e-6)


@pytest.mark.parametrize(
    "stated", [None, "", "-", "[-]", "–", "--", "1", "[1]", "none", "N/A", "filtered", "double"]
)
def test_what_stands_for_no_unit_is_none(stated: str | None) -> None:
    assert read_as(stated) == pytest.approx(np.arange(400.0))


@pytest.mark.parametrize("stated", ["foo", "xNm", "% rated", "counts", "1/s", "degC", "9" * 90])
def test_what_is_no_unit_of_the_channel_is_an_error_of_one_sentence(stated: str) -> None:
    with pytest.raises(InputError, match=r"^a: column 'y', as the file states: unit ") as caught:
        read_as(stated)
    assert len(str(caught.value)) < 300


def test_counts_are_read_where_the_map_says_what_one_is() -> None:
    assert read_as("counts", scale=0.5) == pytest.approx(0.5 * np.arange(400.0))
    assert read_as("raw", bits=16) == pytest.approx(np.arange(400.0))
    assert read_as("counts", unit="mNm", scale=0.5) == pytest.approx(5e-4 * np.arange(400.0))
    assert read_as("active", channel="enabled") == pytest.approx(np.arange(400.0))


@pytest.mark.parametrize(
    ("stated", "second"),
    [("seconds since 2020-01-01", 1.0), ("milliseconds since start", 1e-3), ("min", 60.0)],
)
def test_the_unit_of_a_time_stands_before_since(stated: str, second: float) -> None:
    table = Table("a", (np.arange(400.0), ANGLE), ("t", "q"), units=(stated, "rad"))
    made = picked(table, {"time": "t", "output_position": "q"}).channels["time"]
    assert made == pytest.approx(second * np.arange(400.0))


def test_dates_are_seconds_whatever_their_column_states() -> None:
    stamps = np.datetime64("2026-01-01T00:00:00", "ms") + (1e3 * TIME).astype(int)
    table = Table("a", (stamps, ANGLE), ("t", "q"), units=("yyyy-mm-dd", "rad"))
    made = picked(table, {"time": "t", "output_position": "q"}).channels["time"]
    assert made == pytest.approx(TIME)


def test_init_and_convert_say_the_same_of_a_unit(tmp_path: Path) -> None:
    """`init` left the column out, and `convert` with its very map wrote it in Nm."""
    file, mapped, out = tmp_path / "run.h5", tmp_path / "map.toml", tmp_path / "run.csv"
    hdf5(file, "foo")
    guess = guess_map(file)
    assert "motor_torque" not in guess.channels
    assert ("motor_torque", "its unit is not known, or that of no channel") in [
        *guess.ignored.values()
    ]
    guess.save(mapped)
    made = call("convert", file, "--columns", mapped, "--out", out)
    assert made.exit_code == 2 and not out.exists() and "unit 'foo' is not known" in made.output
    hdf5(file, "cNm")
    guess = guess_map(file)
    assert guess.channels["motor_torque"].unit == "cNm"
    assert guess.log()["motor_torque"] == pytest.approx(
        0.01 * guess.channels["motor_torque"].sign * TORQUE
    )
