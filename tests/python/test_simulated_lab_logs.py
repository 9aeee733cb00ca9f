"""Logs that a foreign simulator wrote with a recorder's noise: what is hidden is named, alone."""

from __future__ import annotations

import io
import lzma
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import flexspline
from flexspline.discovery.result import Discovery
from flexspline.logs.log import Log
from flexspline.logs.read import with_motor_torque

LOAD = "reference_torque"
DIFFERENCE = 0.485 - 0.741  # Nm, Coulomb friction forward less backward
VISCOUS = 1.5811  # Nm·s/rad, README.md of the data
LOADED, FACTOR, NEAR = "load_dependent_friction", 0.08, 0.004  # of the load


def hidden_viscous(folder: Path, *, acceleration: bool) -> list[Log]:
    """Five runs, their output the circular spline; with or without a recorded acceleration."""
    made = []
    for number in range(5):
        path = folder / "simulated_lab_logs" / "viscous_hidden" / f"run_{number}.csv.xz"
        read = flexspline.read_log(path, gear_ratio=100, output_spline="circular")
        kept = [n for n in read.channels if acceleration or n != "output_acceleration"]
        made.append(Log.from_arrays(facts=read.facts, **{n: read[n] for n in kept}))
    return made


@pytest.mark.parametrize(
    ("acceleration", "lowpass", "rows"),
    [(True, None, 20_000), (False, None, 20_000), (True, 20.0, 8000)],
)
def test_viscous_friction_is_named_alone_and_with_its_size(
    data_folder: Path, acceleration: bool, lowpass: float | None, rows: int
) -> None:
    every = hidden_viscous(data_folder, acceleration=acceleration)
    logs = [log.rows(slice(rows)) for log in every]
    assert all(("output_acceleration" in log) == acceleration for log in logs)
    base = ["offset", "coulomb_friction", "inertia"]
    found = flexspline.discover(
        base, logs, target="sensor_torque", known_load=LOAD, lowpass=lowpass
    )
    assert [one.effect for one in found.found] == ["viscous_friction"]
    (made,) = (p for p in found.fit.parameters if p.name.split(".")[0] == "viscous_friction")
    assert abs(made.value - VISCOUS) < min(4.0 * made.standard_error, 0.01 * VISCOUS)
    assert found.found[0].rmse_after < 0.1 * found.found[0].rmse_before
    levels = {p.name: p for p in found.fit.parameters}
    level = levels["direction_dependent_friction.level"]  # half of Coulomb friction's difference
    assert abs(level.value - DIFFERENCE / 2.0) < 4.0 * level.standard_error
    assert found.final_rmse < 0.038
    assert found.final_rmse == found.found[0].rmse_after == found.fit.cv_rmse
    left = np.concatenate([run.held_out for run in found.fit.runs])
    assert found.final_rmse == pytest.approx(np.sqrt(np.nanmean(left**2)), rel=1e-12)
    if not lowpass:  # both leave rows out, and a search more: at ends of runs
        model = found.base_effects, logs
        alone = flexspline.fit(*model, target="sensor_torque", known_load=LOAD)
        assert found.base_rmse == pytest.approx(alone.cv_rmse, rel=5e-3)


def test_a_load_cell_that_is_a_row_late_is_a_fault_and_hides_nothing(data_folder: Path) -> None:
    """What a form of t = 2600 may miss is more than the delay makes, but not along the load."""
    logs = []
    for log in hidden_viscous(data_folder, acceleration=True):
        late = {name: log[name][1:] for name in log.channels} | {LOAD: log[LOAD][:-1]}
        logs.append(Log.from_arrays(facts=log.facts, **late))
    base = ["offset", "coulomb_friction", "inertia"]
    found = flexspline.discover(base, logs, target="sensor_torque", known_load=LOAD)
    assert found.names == ("viscous_friction",)
    faults = [fault for fault in found.data_faults if fault.name == "load_delay"]
    assert [fault.channel for fault in faults] == 5 * [LOAD]
    assert faults[0].size == pytest.approx(2e-3, rel=0.05)  # one row at 500 Hz
    assert found.final_rmse < 0.038
    assert found.found[0].confidence > 0.95


@cache
def payloads(folder: Path) -> tuple[Log, ...]:
    """Five runs of an arm with a payload each; preamble, decimal comma, wrapped rotor angle."""
    return tuple(_payload(folder / "simulated_lab_logs" / "payload_rig", k) for k in range(1, 6))


def _payload(folder: Path, number: int) -> Log:
    packed = (folder / f"Messung_0{number}.csv.xz").read_bytes()
    text = lzma.decompress(packed).decode("latin1").splitlines()
    table = pd.read_csv(
        io.StringIO("\n".join(text[6:])),
        sep=";",
        decimal=",",
        header=None,
        names=text[4].split(";"),
    )
    channels = {
        "time": table["Zeit"] / 1e3,
        "output_position": np.radians(table["Abtriebswinkel"]),
        "output_velocity": table["Abtriebsdrehzahl"] * 2.0 * np.pi / 60.0,
        "motor_position": np.unwrap(np.radians(table["Rotorwinkel"])),
        "motor_current": table["Motorstrom"],
        LOAD: table["Drehmoment"] / 1e3,
        "temperature": table["Temperatur"],
    }
    facts = {
        "gear_ratio": 100,
        "output_spline": "flex",
        "torque_constant": 0.061,
        "name": f"Messung_0{number}",
    }
    columns = {name: np.asarray(values, dtype=float) for name, values in channels.items()}
    return with_motor_torque(Log.from_arrays(facts=facts, **columns))


def lacking(logs: list[Log]) -> Discovery:
    base = ["offset", "coulomb_friction", "viscous_friction", "inertia"]
    return flexspline.discover(base, logs, target="motor_torque", known_load=LOAD)


def wrapped(log: Log) -> Log:
    """The run as it was recorded, with the rotor's angle below a turn."""
    return log.with_columns({"motor_position": log["motor_position"] % (2.0 * np.pi)}, note="raw")


@pytest.mark.parametrize("without", [None, 1])
def test_friction_of_the_load_and_ripple_are_named_on_five_payloads_and_on_four_that_wrap(
    data_folder: Path, without: int | None
) -> None:
    logs = [log for k, log in enumerate(payloads(data_folder)) if k != without]
    found = lacking(logs if without is None else [wrapped(log) for log in logs])
    names = {one.effect for one in found.found}
    assert names == {LOADED, "wave_generator_ripple"}
    (made,) = (p for p in found.fit.parameters if p.name.split(".")[0] == LOADED)
    assert made.value == pytest.approx(FACTOR, abs=NEAR)
    amplitudes = [p.value for p in found.fit.parameters if "ripple" in p.name]
    assert np.hypot(*amplitudes[:2]) == pytest.approx(1.4, rel=0.1)
    for one in found.found:  # a low confidence has its reason beside it
        assert one.confidence > 0.9 or "The confidence is lower for functions of" in one.evidence
    said = [fault.sentence for fault in found.data_faults if fault.name == "wrapped_angle"]
    assert len(said) == (0 if without is None else len(logs))
    assert all("looked for with the unwrapped angle" in sentence for sentence in said)
