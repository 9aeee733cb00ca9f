"""TDMS: channels by name, with the clock of their waveform or of a channel of time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import foreign_files
import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from flexspline import joints_of, read_log

FAST, SLOW = np.arange(1000) * 0.001, np.arange(95) * 0.01
ANGLE = np.degrees(np.sin(5.0 * FAST))
TORQUE = 4.0 + np.cos(3.0 * FAST)
HEAT = 20.0 + SLOW
BEGUN = np.datetime64("2026-03-01T08:00:00.000000", "us")
MAP = {"output_position": "q", "sensor_torque": "tau"}


def wave(step: float, unit: str, late: float = 0.0, **more: Any) -> dict[str, Any]:
    """Properties of a waveform; late: s behind the first."""
    begun = BEGUN + np.timedelta64(round(1e6 * late), "us")
    return {"wf_start_time": begun, "wf_start_offset": 0.0, "wf_increment": step,
            "unit_string": unit, **more}  # fmt: skip


def written(path: Path, channels: Sequence[Any], **facts: Any) -> Path:
    groups = dict.fromkeys(channel.group for channel in channels)
    with TdmsWriter(path) as writer:
        writer.write_segment([RootObject(facts), *map(GroupObject, groups), *channels])
    return path


def drive() -> list[Any]:
    return [ChannelObject("drive", "q", ANGLE, wave(0.001, "deg")),
            ChannelObject("drive", "tau", TORQUE, wave(0.001, "Nm"))]  # fmt: skip


def both(path: Path) -> Path:
    heat = ChannelObject("oven", "heat", HEAT, wave(0.01, "degC", late=0.0005))
    return written(path, [*drive(), heat], gear_ratio=100, operator="me")


def test_channels_are_read_with_their_waveforms_clock_and_units(tmp_path: Path) -> None:
    log = read_log(both(tmp_path / "a.tdms"), MAP)
    assert log["time"] == pytest.approx(FAST, abs=1e-12)
    assert log["output_position"] == pytest.approx(np.radians(ANGLE), abs=1e-12)
    assert np.array_equal(log["sensor_torque"], TORQUE)
    assert log.facts["gear_ratio"] == 100 and log.facts["operator"] == "me"


def test_groups_of_two_rates_are_laid_on_the_clock_of_the_faster(tmp_path: Path) -> None:
    log = read_log(both(tmp_path / "a.tdms"), {**MAP, "temperature": "heat"})
    assert log["time"] == pytest.approx(FAST[1:941], abs=1e-9)
    assert log["temperature"] == pytest.approx(20.0 + FAST[1:941] - 0.0005, abs=1e-9)
    said = "\n".join(log.history)
    assert "one clock: 940 samples of group 'drive', and on a line" in said


def test_one_group_of_two_rates_has_a_clock_for_each(tmp_path: Path) -> None:
    heat = ChannelObject("drive", "heat", HEAT, wave(0.01, "degC"))
    path = written(tmp_path / "a.tdms", [*drive(), heat])
    log = read_log(path, {**MAP, "temperature": "heat"})
    assert log["temperature"] == pytest.approx(20.0 + log["time"], abs=1e-9)
    assert any("of group 'drive (2)'" in said for said in log.history)
    assert len(read_log(path, MAP, variable="drive")) == 1000


def test_a_channel_of_time_is_the_clock_of_its_group(tmp_path: Path) -> None:
    stamps = BEGUN + np.round(1e6 * SLOW).astype("m8[us]")
    channels = [
        ChannelObject("drive", "Time", FAST + 7.0), ChannelObject("drive", "q", ANGLE),
        ChannelObject("oven", "heat", HEAT), ChannelObject("oven", "when", stamps),
    ]  # fmt: skip
    path = written(tmp_path / "a.tdms", channels)
    log = read_log(path, {"output_position": ("q", "deg")})
    assert log["time"] == pytest.approx(FAST + 7.0, abs=1e-12)
    log = read_log(path, {"temperature": "heat"})
    assert log["time"] == pytest.approx(SLOW, abs=1e-9)


def test_scaling_is_computed(tmp_path: Path) -> None:
    counts = np.round(1000.0 * np.sin(5.0 * FAST)).astype("i2")
    scaled = wave(0.001, "deg", **{
        "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 0.01,
        "NI_Scale[0]_Linear_Y_Intercept": 2.0, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    })  # fmt: skip
    path = written(tmp_path / "a.tdms", [ChannelObject("drive", "q", counts, scaled)])
    log = read_log(path, {"output_position": "q"})
    assert log["output_position"] == pytest.approx(np.radians(0.01 * counts + 2.0), abs=1e-12)


def test_channels_of_one_name_are_told_apart_by_their_group(tmp_path: Path) -> None:
    channels = [ChannelObject(f"axis{k}", "q", ANGLE + k, wave(0.001, "deg")) for k in (1, 2)]
    path = written(tmp_path / "a.tdms", channels)
    columns = {"output_position": "axis{joint}.q"}
    assert joints_of(path, columns) == ("1", "2")
    log = read_log(path, columns, joint=2)
    assert log["output_position"] == pytest.approx(np.radians(ANGLE + 2), abs=1e-12)


def test_a_file_is_known_by_its_beginning_and_unpacked(tmp_path: Path) -> None:
    foreign_files.known_by_its_beginning_and_packed(both(tmp_path / "a.tdms"), MAP, 1000)


def test_the_index_beside_a_file_is_not_looked_at(tmp_path: Path) -> None:
    path = both(tmp_path / "a.tdms")
    (tmp_path / "a.tdms_index").write_bytes(b"TDSh" + bytes(200))
    assert np.array_equal(read_log(path, MAP)["sensor_torque"], TORQUE)


def test_init_guesses_a_map_and_check_takes_it(tmp_path: Path) -> None:
    entry = 'output_position = {source = "q", unit = "deg"}'
    log = foreign_files.converted_by_a_guessed_map(both(tmp_path / "a.tdms"), entry)
    assert log.facts["gear_ratio"] == 100
    assert log["output_position"] == pytest.approx(np.radians(ANGLE)[1:941], abs=1e-9)


def test_a_recording_that_stopped_is_read_and_said_to_have_no_end(tmp_path: Path) -> None:
    path = tmp_path / "a.tdms"
    with TdmsWriter(path) as writer:
        for first in (0, 500):
            rows = slice(first, first + 500)
            writer.write_segment([ChannelObject("drive", "q", ANGLE[rows], wave(0.001, "deg"))])
    path.write_bytes(path.read_bytes()[:-800])
    log = read_log(path, {"output_position": "q"})
    assert len(log) == 900
    assert log["output_position"] == pytest.approx(np.radians(ANGLE)[:900], abs=1e-12)
    assert any("its end is missing" in said for said in log.history)


# what is wrong


def refused(path: Path, columns: Any = None, **how: Any) -> str:
    return foreign_files.refused(path, columns or MAP, **how)


def test_a_conversion_that_is_not_known_is_refused_by_name(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    strange = {"NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1,
               "NI_Scale[0]_Scale_Type": "Script"}  # fmt: skip
    odd = ChannelObject("drive", "odd", TORQUE, wave(0.001, "Nm", **strange))
    path = written(tmp_path / "a.tdms", [*drive(), odd])
    said = refused(path, {"output_position": "q", "sensor_torque": "odd"})
    assert "column 'odd' cannot be read: it is converted by the rule 'Script'" in said
    assert any("not read: odd" in said for said in read_log(path, MAP).history)
    assert capfd.readouterr() == ("", "")


def test_a_group_without_time_is_read_alone_with_a_rate(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tdms", [*drive(), ChannelObject("oven", "heat", HEAT)])
    assert len(read_log(path, MAP)) == 1000
    foreign_files.read_alone_with_a_rate(path, MAP, HEAT)


def test_several_groups_of_which_none_has_time_are_refused(tmp_path: Path) -> None:
    channels = [ChannelObject(name, "x", HEAT) for name in ("a", "b")]
    said = refused(written(tmp_path / "a.tdms", channels))
    assert "none of its groups a, b has a channel of time; name one with variable=" in said


def test_a_group_that_is_not_there_is_said_with_those_that_are(tmp_path: Path) -> None:
    said = refused(both(tmp_path / "a.tdms"), variable="drives")
    assert "no group 'drives' (did you mean 'drive'?); it has drive, oven" in said


def test_text_is_no_channel(tmp_path: Path) -> None:
    words = ChannelObject("drive", "words", ["on"] * 1000, wave(0.001, ""))
    path = written(tmp_path / "a.tdms", [*drive(), words])
    assert "is 'on' where 'enabled' needs a number" in refused(path, {**MAP, "enabled": "words"})


def test_a_file_without_samples_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tdms", [ChannelObject("drive", "q", np.zeros(0))])
    assert "has no samples; record the run again" in refused(path)


def test_a_step_that_is_none_makes_no_clock(tmp_path: Path) -> None:
    for step in (0.0, -0.001, float("nan")):
        channels = [ChannelObject("drive", "q", ANGLE, wave(step, "deg"))]
        path = written(tmp_path / "a.tdms", channels)
        assert "no time stamps" in refused(path, {"output_position": "q"})


def test_a_waveform_over_anything_else_than_time_has_no_clock(tmp_path: Path) -> None:
    spectrum = ChannelObject("drive", "q", ANGLE, wave(0.5, "deg", wf_xunit_string="Hz"))
    path = written(tmp_path / "a.tdms", [spectrum])
    assert "no time stamps" in refused(path, {"output_position": "q"})


@pytest.mark.parametrize("content", [b"TDSm", b"TDSm" + bytes(60), b"PK\x03\x04" + bytes(90)])
def test_what_is_called_tdms_and_is_none_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.tdms").write_bytes(content)
    refused(tmp_path / "a.tdms")


def test_damaged_bytes_are_refused_or_read_and_nothing_else(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    foreign_files.refused_or_read_when_damaged(
        both(tmp_path / "a.tdms"), {**MAP, "temperature": "heat"},
        times=60, until=1200, bytes_at_once=6,
    )  # fmt: skip
    assert capfd.readouterr() == ("", "")


def test_a_channel_beyond_the_limit_of_memory_is_refused(tmp_path: Path) -> None:
    assert "takes 8e-06 GB of memory or more" in refused(both(tmp_path / "a.tdms"), max_memory=1e-6)


def test_without_the_library_the_command_that_installs_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = foreign_files.refused_without("nptdms", both(tmp_path / "a.tdms"), MAP, monkeypatch)
    assert said.endswith("pip install 'flexspline[tdms]'")
