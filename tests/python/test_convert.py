"""A foreign file and a map become a run that reads as the same log."""

from __future__ import annotations

from pathlib import Path

import measured
import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.logs import Log, convert, read_log, write_log

FOREIGN = "0 1.5 100\n1 2.5 200\n2 x 300\n3 181 400\n"
MAP = """
[read]
rate = 10
separator = "whitespace"
drop_rows = 0

[facts]
gear_ratio = 100
joint = "7"
remark = "two words: fine"

[columns]
output_position = {source = 0, unit = "deg"}
sensor_torque = {source = 2, unit = "mNm", sign = -1}
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    """A foreign file, a map of its columns and where the run goes."""
    foreign, columns, out = (tmp_path / name for name in ("rig.txt", "map.toml", "run.csv"))
    foreign.write_text(FOREIGN)
    columns.write_text(MAP)
    return foreign, columns, out


def test_a_converted_run_reads_as_the_same_log_to_the_last_bit(
    files: tuple[Path, Path, Path],
) -> None:
    log = convert(*files)
    again = read_log(files[2])
    assert again.channels == log.channels == ("time", "output_position", "sensor_torque")
    for channel in log.channels:
        np.testing.assert_array_equal(again[channel], log[channel])
    assert dict(again.facts) == dict(log.facts)
    assert again.facts["remark"] == "two words: fine" and again.facts["name"] == "rig"


def test_arguments_overrule_the_map(files: tuple[Path, Path, Path]) -> None:
    log = convert(*files, gear_ratio=160, rate=20)
    assert log.facts["gear_ratio"] == 160
    assert log.rate == pytest.approx(20)


def test_any_number_survives_writing_and_reading(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    bits = random.integers(0, 2**64, 20_000, dtype=np.uint64).view(np.float64)
    values = np.where(np.isfinite(bits), bits, np.nan)
    log = Log.from_arrays(time=np.arange(20_000) / 7, sensor_torque=values)
    write_log(log, tmp_path / "run.csv")
    np.testing.assert_array_equal(read_log(tmp_path / "run.csv")["sensor_torque"], values)


def test_a_failed_conversion_leaves_the_old_run_and_nothing_else(
    files: tuple[Path, Path, Path],
) -> None:
    foreign, columns, out = files
    out.write_text("old")
    columns.write_text(MAP.replace("source = 2", "source = 1"))
    with pytest.raises(InputError, match=r"rig\.txt: data row 3 \(line 3\), column 1 is 'x'"):
        convert(*files)
    assert out.read_text() == "old"
    assert sorted(out.parent.iterdir()) == sorted([foreign, columns, out])


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("[columns", r"map\.toml: the column map is not TOML"),
        ("[colums]\nx = 1", r"'colums' is no section \(did you mean 'columns'\?\)"),
        ("[read]\nrates = 1", r"'rates' is no key of \[read\] \(did you mean 'rate'\?\)"),
        ("columns = 3", r"'columns' is no section; write \[columns\]"),
        ("[columns]\noutput_position = {source = 0, unit = 'furlong'}", "unit 'furlong' does not"),
        ("[columns]\noutput_position = {source = 0, units = 'deg'}", r"unknown key 'units' \(did"),
        ("[columns]\noutput_position = 9", "no column 9"),
        ("[read]\ndrop_rows = 'two'\n[columns]\ntime = 0", "drop_rows is 'two'"),
        ("[read]\nrate = 'fast'\n[columns]\nduty = 0", "rate is 'fast'"),
        ("[read]\nheader = 'maybe'\n[columns]\ntime = 0", "header is 'maybe'"),
        ("[read]\nseparator = 5\n[columns]\ntime = 0", "separator is 5"),
        ("[read]\nencoding = 5\n[columns]\ntime = 0", "encoding is 5"),
        ("[read]\nrepair = 5\n[columns]\ntime = 0", "repair is 5"),
    ],
)
def test_a_broken_map_is_refused_in_one_sentence(
    files: tuple[Path, Path, Path], content: str, sentence: str
) -> None:
    files[1].write_text(content)
    with pytest.raises(InputError, match=sentence):
        convert(*files)
    assert not files[2].exists()


def test_a_missing_map_is_named(files: tuple[Path, Path, Path]) -> None:
    with pytest.raises(InputError, match=r"no\.toml: the column map cannot be read"):
        convert(files[0], "no.toml", files[2])


def test_a_measured_foreign_log_is_converted(tmp_path: Path, data_folder: Path) -> None:
    columns = tmp_path / "kinova.toml"
    columns.write_text("""
        [read]
        rate = 1000
        repair = "unwrap"
        [facts]
        joint = "Kinova Gen3 actuator 7"
        gear_ratio = 100
        pole_pairs = 7
        torque_constant = 0.076
        name = "0.5 rad/s"
        [columns]
        output_position = 1
        output_velocity = 2
        sensor_torque = 3
        motor_current = 5
    """)
    foreign = data_folder / "kinova_gen3_joint7" / "velocity_0.500000readings.csv"
    convert(foreign, columns, tmp_path / "run.csv")
    log, direct = read_log(tmp_path / "run.csv"), measured.kinova(0.5)
    assert dict(log.facts) == dict(direct.facts)
    for channel in direct.channels:
        np.testing.assert_array_equal(log[channel], direct[channel])
