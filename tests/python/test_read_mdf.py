"""MDF 4: channels by name, converted as the file says, groups laid on one clock."""

from __future__ import annotations

import itertools
import struct
import time
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import foreign_files
import numpy as np
import pytest
from asammdf import MDF, Signal
from asammdf.blocks.conversion_utils import from_dict

from flexspline import joints_of, read_log

FAST, SLOW = np.arange(1000) * 0.001, np.arange(95) * 0.01
COUNTS = np.round(1000.0 * np.sin(5.0 * FAST)).astype("<i4")
TORQUE = 4.0 + np.cos(3.0 * FAST)
HEAT = 20.0 + SLOW
STATE = (np.arange(95) > 40).astype("u1")
MAP = {"output_position": "q", "sensor_torque": "tau"}


def signal(name: str, values: Any, time: Any, unit: str = "", **conversion: Any) -> Signal:
    made = from_dict(conversion) if conversion else None
    return Signal(np.asarray(values), time, name=name, unit=unit, conversion=made)


def fast() -> list[Signal]:
    return [signal("q", COUNTS, FAST, "deg", a=0.01, b=2.0), signal("tau", TORQUE, FAST, "Nm")]


def slow() -> list[Signal]:
    on = {"val_0": 0, "text_0": "off", "val_1": 1, "text_1": "on"}
    return [signal("heat", HEAT, SLOW, "degC"), signal("power", STATE, SLOW, **on)]


def written(
    path: Path, groups: Sequence[tuple[str, list[Signal]]], packed: int = 0, version: str = "4.10"
) -> Path:
    """An MDF file of groups with a clock each; packed: 1 Deflate, 2 Deflate of columns."""
    made = MDF(version=version)  # type: ignore[arg-type]
    for name, signals in groups:
        made.append(signals, acq_name=name, common_timebase=True)
    made.save(path, overwrite=True, compression=packed)  # type: ignore[arg-type]
    made.close()
    return path


def both(path: Path, packed: int = 0) -> Path:
    return written(path, [("drive", fast()), ("oven", slow())], packed)


@pytest.mark.parametrize("packed", [0, 1, 2])
def test_channels_are_read_as_their_file_converts_them(packed: int, tmp_path: Path) -> None:
    log = read_log(both(tmp_path / "a.mf4", packed), MAP)
    assert log["time"] == pytest.approx(FAST, abs=1e-12)
    assert log["output_position"] == pytest.approx(np.radians(0.01 * COUNTS + 2.0), abs=1e-12)
    assert np.array_equal(log["sensor_torque"], TORQUE)
    assert any("MDF 4.10, 2 groups" in said for said in log.history)
    assert not any("one clock" in said for said in log.history)


def test_groups_of_two_rates_are_laid_on_the_clock_of_the_faster(tmp_path: Path) -> None:
    columns = {**MAP, "temperature": "heat", "enabled": "power"}
    log = read_log(both(tmp_path / "a.mf4", 2), columns)
    assert log["time"] == pytest.approx(FAST[:941], abs=1e-12)
    assert log["temperature"] == pytest.approx(20.0 + FAST[:941], abs=1e-9)
    assert np.array_equal(log["enabled"], np.repeat(STATE, 10)[:941])
    said = "\n".join(log.history)
    assert "one clock: 941 samples of group 'drive', and on a line between" in said
    assert "of group 'oven'" in said and "states as numbers: power" in said


def test_rational_conversions_and_tables_are_computed(tmp_path: Path) -> None:
    x = np.linspace(0.0, 2.0, 200)
    time = FAST[:200]
    rational = {"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.5, "P5": 0.0, "P6": 4.0}
    table = {"raw_0": 0.0, "phys_0": 5.0, "raw_1": 2.0, "phys_1": 9.0, "interpolation": True}
    signals = [signal("r", x, time, **rational), signal("t", x, time, **table)]
    path = written(tmp_path / "a.mf4", [("", signals)])
    log = read_log(path, {"sensor_torque": "r", "reference_torque": "t"})
    assert log["sensor_torque"] == pytest.approx((2.0 * x + 1.0) / (0.5 * x**2 + 4.0), rel=1e-12)
    assert log["reference_torque"] == pytest.approx(5.0 + 2.0 * x, rel=1e-12)


def test_samples_that_are_invalid_are_missing(tmp_path: Path) -> None:
    invalid = np.zeros(1000, dtype=bool)
    invalid[100:110] = True
    made = MDF(version="4.10")
    tau = Signal(TORQUE, FAST, name="tau", unit="Nm", invalidation_bits=invalid)
    made.append([signal("q", TORQUE, FAST, "rad"), tau], common_timebase=True)
    made.save(tmp_path / "a.mf4", overwrite=True)
    log = read_log(tmp_path / "a.mf4", MAP)
    assert np.array_equal(np.isnan(log["sensor_torque"]), invalid)
    assert np.array_equal(log["output_position"], TORQUE)


def test_channels_of_one_name_are_told_apart_by_their_group(tmp_path: Path) -> None:
    groups = [(f"axis{k}", [signal("q", TORQUE + k, FAST, "rad")]) for k in (1, 2)]
    path = written(tmp_path / "a.mf4", groups)
    log = read_log(path, {"output_position": "axis2.q"})
    assert np.array_equal(log["output_position"], TORQUE + 2)
    assert np.array_equal(read_log(path, {"output_position": "q"}, variable="axis1")
                          ["output_position"], TORQUE + 1)  # fmt: skip
    columns = {"output_position": "axis{joint}.q"}
    assert joints_of(path, columns) == ("1", "2")
    assert np.array_equal(read_log(path, columns, joint=2)["output_position"], TORQUE + 2)
    said = refused(path, {"output_position": "q"})
    assert "no column 'q'; it has time, axis1.q, axis2.q" in said


def test_a_file_is_known_by_its_beginning_and_unpacked(tmp_path: Path) -> None:
    foreign_files.known_by_its_beginning_and_packed(both(tmp_path / "a.mf4"), MAP, 1000)


def test_init_guesses_a_map_and_convert_takes_it(tmp_path: Path) -> None:
    entry = 'output_position = {source = "q", unit = "deg"}'
    log = foreign_files.converted_by_a_guessed_map(both(tmp_path / "a.mf4", 1), entry)
    assert log["output_position"] == pytest.approx(
        np.radians(0.01 * COUNTS + 2.0)[: len(log)], abs=1e-9
    )


def test_nothing_is_printed_by_a_long_reading(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """asammdf prints its speed once reading has taken some seconds, into the middle of --json."""
    path, ticks = both(tmp_path / "a.mf4", 1), itertools.count(0.0, 100.0)
    monkeypatch.setattr(time, "perf_counter", lambda: next(ticks))
    capfd.readouterr()
    read_log(path, MAP)
    monkeypatch.undo()
    assert next(ticks) > 0.0 and capfd.readouterr() == ("", "")


# what is wrong


def refused(path: Path, columns: Any = None, **how: Any) -> str:
    return foreign_files.refused(path, columns or MAP, **how)


def test_a_formula_is_never_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from asammdf.blocks import v4_blocks

    def run(*_: Any) -> None:
        raise AssertionError("a stranger's formula was computed")

    monkeypatch.setattr(v4_blocks, "evaluate", run)
    evil = signal("evil", TORQUE, FAST, "Nm", formula="__import__('os').system('id') + X1")
    path = written(tmp_path / "a.mf4", [("", [*fast(), evil])])
    said = refused(path, {"output_position": "q", "sensor_torque": "evil"})
    assert "column 'evil' cannot be read: it is converted by a formula" in said
    log = read_log(path, MAP)
    assert len(log) == 1000 and any("not read: evil" in said for said in log.history)


def test_a_formula_inside_a_table_is_found(tmp_path: Path) -> None:
    inside = {"val_0": 1, "text_0": "on", "val_1": 2, "text_1": from_dict({"formula": "X1*2"})}
    evil = Signal(STATE, SLOW, name="evil", conversion=from_dict(inside))
    path = written(tmp_path / "a.mf4", [("", [evil, signal("heat", HEAT, SLOW)])])
    said = refused(path, {"enabled": "evil", "temperature": "heat"})
    assert "column 'evil' cannot be read: it is converted by a formula" in said


def channels_of(content: bytes) -> list[tuple[int, int]]:
    """Where the blocks of all channels begin, and the data in each of them."""
    found, at = [], -1
    while (at := content.find(b"##CN", at + 1)) >= 0:
        _, _, links = struct.unpack_from("<4s4xQQ", content, at)
        found.append((at, at + 24 + 8 * links))
    return found


MASTER = 2
RULE = 24 + 8 * 4  # where in a block of a channel the link to its conversion is


def test_a_clock_that_is_a_formula_is_none(tmp_path: Path) -> None:
    evil = signal("evil", TORQUE, FAST, "Nm", formula="X1 + 1")
    path = written(tmp_path / "a.mf4", [("", [evil])])
    content = bytearray(path.read_bytes())
    every = channels_of(content)
    (rule,) = {struct.unpack_from("<Q", content, at + RULE)[0] for at, _ in every} - {0}
    for at, data in every:
        if content[data] == MASTER:
            struct.pack_into("<Q", content, at + RULE, rule)
    path.write_bytes(bytes(content))
    said = refused(path, {"output_position": "evil"}, rate=1000)
    assert "no channel can be read, such as 'time', for it is converted by a formula" in said


def test_a_conversion_that_is_damaged_or_not_known_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mf4", [("drive", fast())])
    for kind, says in ((3, "a formula"), (2, "its conversion is damaged"), (99, "of kind 99")):
        content = bytearray(path.read_bytes())
        content[content.index(b"##CC") + 24 + 8 * 4] = kind
        (tmp_path / "b.mf4").write_bytes(bytes(content))
        said = refused(tmp_path / "b.mf4")
        assert "column 'q' cannot be read" in said and says in said


def test_text_and_arrays_are_refused_by_name(tmp_path: Path) -> None:
    words = Signal(np.array([b"on"] * 95), SLOW, name="words", encoding="utf-8")
    pairs = np.rec.fromarrays([np.zeros((95, 2))], dtype=[("pairs", "<f8", (2,))])
    array = Signal(pairs, SLOW, name="pairs")
    path = written(tmp_path / "a.mf4", [("", [words, signal("heat", HEAT, SLOW)]), ("b", [array])])
    assert "'words' cannot be read: it holds text; save numbers" in refused(
        path, {"temperature": "words"}
    )
    assert "'pairs' cannot be read: it is an array or a structure" in refused(
        path, {"temperature": "pairs"}
    )


def timeless(path: Path) -> Path:
    """Of two groups the second has lost its clock: its master is a plain channel."""
    content = bytearray(both(path).read_bytes().replace(b"time\0", b"tick\0"))
    masters = [data for _, data in channels_of(content) if content[data] == MASTER]
    content[masters[1] : masters[1] + 2] = b"\0\0"
    path.write_bytes(bytes(content))
    return path


def test_a_group_without_time_is_read_alone_with_a_rate(tmp_path: Path) -> None:
    path = timeless(tmp_path / "a.mf4")
    assert np.array_equal(read_log(path, MAP)["sensor_torque"], TORQUE)
    foreign_files.read_alone_with_a_rate(path, MAP, HEAT)


def test_several_groups_of_which_none_has_time_are_refused(tmp_path: Path) -> None:
    path = timeless(tmp_path / "a.mf4")
    content = bytearray(path.read_bytes())
    (master,) = [data for _, data in channels_of(content) if content[data] == MASTER]
    content[master + 1] = 2  # its clock is an angle
    path.write_bytes(bytes(content))
    said = refused(path)
    assert "none of its groups drive, oven has a channel of time; name one with variable=" in said


def test_a_group_that_is_not_there_is_said_with_those_that_are(tmp_path: Path) -> None:
    said = refused(both(tmp_path / "a.mf4"), variable="drives")
    assert "no group 'drives' (did you mean 'drive'?); it has drive, oven" in said


def test_a_file_without_samples_is_refused(tmp_path: Path) -> None:
    empty = [signal("q", np.zeros(0), np.zeros(0))]
    path = written(tmp_path / "a.mf4", [("drive", empty)])
    assert "has no samples; record the run again" in refused(path)
    MDF(version="4.10").save(tmp_path / "b.mf4", overwrite=True)
    assert "has no samples" in refused(tmp_path / "b.mf4")


def test_other_versions_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mdf", [("", [signal("q", TORQUE, FAST)])], version="3.30")
    said = refused(path)
    assert "is MDF 3.30, and MDF 4 alone is read; convert it, such as by asammdf" in said


@pytest.mark.parametrize(("at", "value"), [(0, b"UnFinMF "), (60, b"\x01\0")])
def test_a_file_that_is_not_finalised_is_refused(at: int, value: bytes, tmp_path: Path) -> None:
    content = bytearray(both(tmp_path / "a.mf4").read_bytes())
    content[at : at + len(value)] = value
    (tmp_path / "a.mf4").write_bytes(bytes(content))
    assert "was not finalised by its recorder; finalise it" in refused(tmp_path / "a.mf4")


def test_what_is_called_mf4_and_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mf4").write_bytes(b"PK\x03\x04" + bytes(200))
    assert "not an MDF 4 file, or a damaged one (it does not begin as one)" in refused(
        tmp_path / "a.mf4"
    )


@pytest.mark.parametrize("share", [0.001, 0.1, 0.5, 0.9, 0.999])
@pytest.mark.parametrize("packed", [0, 2])
def test_a_file_that_was_cut_short_is_refused(packed: int, share: float, tmp_path: Path) -> None:
    content = both(tmp_path / "a.mf4", packed).read_bytes()
    (tmp_path / "a.mf4").write_bytes(content[: int(share * len(content))])
    assert "or a damaged one" in refused(tmp_path / "a.mf4")


@pytest.mark.parametrize("packed", [0, 1])
def test_damaged_bytes_are_refused_or_read_and_nothing_else(
    packed: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    foreign_files.refused_or_read_when_damaged(
        both(tmp_path / "a.mf4", packed), {**MAP, "temperature": "heat"},
        times=40, until=8000, bytes_at_once=12,
    )  # fmt: skip
    assert capfd.readouterr() == ("", "")


def test_samples_that_are_promised_and_not_there_are_missed(tmp_path: Path) -> None:
    content = bytearray(both(tmp_path / "a.mf4").read_bytes())
    at = content.index(b"##CG")
    _, _, links = struct.unpack_from("<4s4xQQ", content, at)
    struct.pack_into("<Q", content, at + 24 + 8 * links + 8, 10**15)
    (tmp_path / "a.mf4").write_bytes(bytes(content))
    assert "a group promises" in refused(tmp_path / "a.mf4")


def test_a_channel_beyond_the_limit_of_memory_is_refused(tmp_path: Path) -> None:
    path = both(tmp_path / "a.mf4")
    assert "takes 8e-06 GB of memory or more" in refused(path, max_memory=1e-6)


def packed_block(content: bytearray) -> int:
    """Where the data of the first packed block begin: two letters, how, and sizes."""
    at = content.index(b"##DZ")
    _, _, links = struct.unpack_from("<4s4xQQ", content, at)
    return at + 24 + 8 * int(links)


def test_a_block_that_unfolds_to_more_than_memory_is_refused(tmp_path: Path) -> None:
    content = bytearray(both(tmp_path / "a.mf4", 1).read_bytes())
    struct.pack_into("<Q", content, packed_block(content) + 8, 10**13)
    (tmp_path / "a.mf4").write_bytes(bytes(content))
    assert "takes 1e+04 GB of memory" in refused(tmp_path / "a.mf4")


def test_a_block_that_unfolds_to_more_than_it_says_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mf4", [("", [signal("q", np.zeros(60_000), np.arange(6e4))])], 1)
    content = bytearray(path.read_bytes())
    at = packed_block(content)
    (length,) = struct.unpack_from("<Q", content, at + 16)
    bomb = zlib.compress(bytes(10 * length))
    assert len(bomb) < length
    content[at + 24 : at + 24 + len(bomb)] = bomb
    struct.pack_into("<QQ", content, at + 8, length // 4, len(bomb))
    path.write_bytes(bytes(content))
    how = {"max_memory": 1e-6 * length, "columns": {"output_position": "q"}}
    assert "or a damaged one" in refused(path, **how)


def test_a_block_packed_by_a_method_without_bound_is_refused(tmp_path: Path) -> None:
    content = bytearray(both(tmp_path / "a.mf4", 1).read_bytes())
    content[packed_block(content) + 2] = 2
    (tmp_path / "a.mf4").write_bytes(bytes(content))
    assert "packed by another method than Deflate and LZ4" in refused(tmp_path / "a.mf4")


def test_without_the_library_the_command_that_installs_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = foreign_files.refused_without("asammdf", both(tmp_path / "a.mf4"), MAP, monkeypatch)
    assert said.endswith("pip install 'flexspline[mdf]'")
