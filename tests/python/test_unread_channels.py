"""Values that are not finite stop a fit where it reads their channel, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from checks_logs import sound_log
from cli_calls import call
from fleet_logs import NAMES, fleet_in

import flexspline
from flexspline.errors import InputError
from flexspline.fleet import fit as fit_fleet
from flexspline.logs import Log, read_log
from flexspline.logs.writing import write_log

EFFECTS = ("offset", "coulomb_friction", "viscous_friction")


def spoilt(log: Log, channel: str, rows: slice = slice(500, 510)) -> Log:
    values = log[channel].copy()
    values[rows] = np.nan
    return Log({**log.columns, channel: values}, log.facts)


@pytest.mark.parametrize("channel", ["sensor_torque", "temperature", "motor_position"])
@pytest.mark.parametrize("rows", [slice(500, 510), slice(None)])
def test_a_channel_that_is_not_read_does_not_stop_a_fit(channel: str, rows: slice) -> None:
    log = sound_log(3)
    whole = flexspline.fit(EFFECTS, log, target="motor_current")
    made = flexspline.fit(EFFECTS, spoilt(log, channel, rows), target="motor_current")
    for one, other in zip(made.parameters, whole.parameters, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)
    (said,) = [line for line in made.warnings if channel in line and "not read" in line]
    assert f"{len(log[channel][rows])} rows" in said


@pytest.mark.parametrize(
    ("channel", "effects"),
    [
        ("motor_current", EFFECTS),
        ("output_velocity", EFFECTS),
        ("output_position", (*EFFECTS, "inertia")),
        ("temperature", (*EFFECTS, "temperature_drift")),
    ],
)
def test_a_channel_that_is_read_stops_a_fit(channel: str, effects: tuple[str, ...]) -> None:
    """The acceleration that inertia reads is derived of the position."""
    target = "sensor_torque" if "temperature_drift" in effects else "motor_current"
    with pytest.raises(InputError, match=f"{channel} is NaN or infinite in 10 rows"):
        flexspline.fit(effects, spoilt(sound_log(3), channel), target=target)


def test_the_command_fits_and_says_what_it_goes_on_without(tmp_path: Path) -> None:
    write_log(spoilt(sound_log(3), "sensor_torque"), tmp_path / "run.csv")
    ask = ["--effects", ",".join(EFFECTS), "--out", tmp_path / "fit"]
    ran = call("fit", tmp_path / "run.csv", "--target", "motor_current", *ask)
    assert ran.exit_code == 0
    assert "the fit does not read it" in " ".join(ran.output.split())
    ran = call("fit", tmp_path / "run.csv", "--target", "sensor_torque", *ask)
    assert ran.exit_code == 2


def test_a_fleet_keeps_a_run_without_a_temperature_that_no_effect_reads(tmp_path: Path) -> None:
    fleet_in(tmp_path / "line", 3, 2)
    path = tmp_path / "line" / "joint01" / "run1.csv"
    log = read_log(path)
    write_log(log.with_columns({"temperature": np.full(len(log), np.nan)}, note="lost"), path)
    made = fit_fleet(tmp_path / "line", "sensor_torque", NAMES, workers=0)
    assert not made.failed
    assert made.unit("joint01").rows == made.unit("joint02").rows
