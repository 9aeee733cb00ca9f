"""Wherever a log is taken, so is what `read_log` reads as one: a file's name, arrays, a table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from fit_logs import FRICTION, autoregressive, fitted, friction, motion, simulated

import flexspline
from flexspline import InputError, Log
from flexspline.logs.read import as_logs
from flexspline.logs.writing import write_log

EFFECTS = ["offset", "coulomb_friction", "viscous_friction", "inertia"]


def run() -> Log:
    noise = autoregressive(np.random.default_rng(2), 2000)
    made = simulated(friction(), FRICTION, motion(2, 2000), noise)
    return made.with_facts({"gear_ratio": 100.0})


def columns() -> dict[str, Any]:
    return {name: np.array(run()[name]) for name in run().channels}


def as_file(folder: Path) -> Path:
    write_log(run(), folder / "run.csv")
    return folder / "run.csv"


SOURCES: dict[str, Callable[[Path], Any]] = {
    "path": as_file,
    "name": lambda folder: str(as_file(folder)),
    "arrays": lambda folder: columns(),
    "table": lambda folder: pandas.DataFrame(columns()),
}


@pytest.mark.parametrize("source", SOURCES)
def test_a_fit_and_all_that_follows_take_what_can_be_read(source: str, tmp_path: Path) -> None:
    given, own = SOURCES[source](tmp_path), fitted(EFFECTS, run())
    made = fitted(EFFECTS, [given])
    assert made.part.coefficients == pytest.approx(own.part.coefficients, rel=1e-9)
    assert made.predict(given).residual == pytest.approx(own.predict(run()).residual, abs=1e-9)
    assert set(made.model.components(given)) == set(EFFECTS)
    found = flexspline.check(given, target="sensor_torque")
    assert [f.name for f in found] == [f.name for f in flexspline.check(run())]
    where = flexspline.compare(made.model, given)
    assert where.rmse == pytest.approx(own.rmse, rel=0.05)
    estimated = flexspline.estimate(made.model, given)
    assert len(estimated["sensor_torque"]) == 2000


def test_one_is_one_and_several_are_a_list(tmp_path: Path) -> None:
    file = as_file(tmp_path)
    assert len(as_logs(file)) == len(as_logs(run())) == len(as_logs(columns())) == 1
    assert [log.name for log in as_logs([file, run(), str(file)])] == ["run", "run", "run"]
    assert as_logs(log for log in (run(), run()))[1].channels == run().channels


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (5, "a log cannot be read from a int; give a path, an array, a dictionary"),
        (None, "a log cannot be read from a NoneType"),
        ([5], "a log cannot be read from a int"),
        ("none.csv", "none.csv: no such file; give the path of a log"),
    ],
)
def test_what_is_no_log_is_told_in_a_sentence(wrong: Any, says: str) -> None:
    for call in (
        lambda: fitted(EFFECTS, wrong),
        lambda: flexspline.compare(fitted(EFFECTS, run()).model, wrong),
        lambda: flexspline.discover(EFFECTS, wrong, target="sensor_torque"),
        lambda: flexspline.calibrate(wrong),
    ):
        with pytest.raises(InputError, match=says):
            call()


def masked_sources() -> dict[str, Any]:
    time, torque = np.arange(50) / 100.0, np.ma.masked_array(np.arange(50))
    torque[7] = np.ma.masked
    rows = np.ma.zeros(50, dtype=[("time", float), ("sensor_torque", int)])
    rows["time"], rows["sensor_torque"] = time, torque
    stamps = np.array(1e9 * time, dtype="timedelta64[ns]")
    return {
        "dictionary": {"time": time, "sensor_torque": torque},
        "of texts": {"time": time, "sensor_torque": torque.astype(str)},
        "of stamps": {"time": np.ma.masked_array(stamps), "sensor_torque": 1.0 * torque},
        "matrix": np.ma.column_stack([time, torque]),
        "structured array": rows,
    }


@pytest.mark.parametrize("kind", masked_sources())
def test_masked_samples_of_arrays_are_read_as_missing(kind: str) -> None:
    numbered = {"time": 0, "sensor_torque": 1} if kind == "matrix" else None
    log = flexspline.read_log(masked_sources()[kind], numbered)
    assert np.flatnonzero(np.isnan(log["sensor_torque"])).tolist() == [7]
    assert log["sensor_torque"][8] == 8.0 and np.isfinite(log["time"]).all()
    assert "masked samples are empty: 1 of column" in log.history[0]
    stamps = {"time": np.ma.masked_array(np.arange(9).astype("m8[s]"), np.arange(9) == 3)}
    read = flexspline.read_log({**stamps, "sensor_torque": np.arange(9)})
    assert np.flatnonzero(np.isnan(read["time"])).tolist() == [3]
