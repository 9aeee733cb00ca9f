"""Broken logs: each is refused with one sentence that says where, what, and what to do."""

from __future__ import annotations

import gzip
import json
import lzma
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
import scipy.io

from flexspline.errors import InputError
from flexspline.logs import ColumnSource, read_log

GOOD = "time,q,tau\n0,1,2\n1,2,3\n2,3,4\n"


def write(content: str | bytes) -> Callable[[Path], object]:
    data = content.encode() if isinstance(content, str) else content
    return lambda path: path.write_bytes(data)


def two_members(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.csv", GOOD)
        archive.writestr("b.csv", GOOD)


def damaged_npz(path: Path) -> None:
    np.savez(path, time=np.arange(100.0))
    content = bytearray(path.read_bytes())
    content[300] ^= 0xFF
    path.write_bytes(content)


def matlab(**variables: Any) -> Callable[[Path], object]:
    return lambda path: scipy.io.savemat(path, variables)


Q = {"output_position": "q"}
LETTER = "[{'a': 1}"
FILES: list[tuple[str, Callable[[Path], object], dict[str, Any], str]] = [
    ("missing.csv", lambda path: None, {}, "no such file.*give the path"),
    ("folder", lambda path: path.mkdir(), {}, "is a folder.*give the path"),
    ("empty.csv", write(""), {}, r"the file is empty; record or copy it again"),
    ("blank.csv", write("\n\n"), {}, "no rows of data; record the run again"),
    ("facts_only.csv", write("# joint: 7\n"), {}, "no rows of data"),
    ("header_only.csv", write("time,q\n"), {"columns": Q}, "a header line but no rows of data"),
    ("one_row.csv", write("time,q\n0,1\n"), {"columns": Q}, "only one row of data"),
    (
        "no_column.csv",
        write(GOOD),
        {"columns": {"output_position": "qq"}},
        r"no column 'qq' \(did you mean 'q'\?\); it has time, q, tau",
    ),
    (
        "no_number.csv",
        write(GOOD),
        {"columns": {"output_position": 3}},
        "no column 3; its 3 columns are numbered from 0 to 2",
    ),
    (
        "no_names.csv",
        write("0,1\n1,2\n"),
        {"columns": Q},
        "no column 'q', for its columns have no names; give a number from 0 to 1",
    ),
    ("no_map.csv", write("0,1\n1,2\n"), {}, "columns without names; say which is which"),
    ("strange.csv", write("t,q\n0,1\n1,2\n"), {}, "names t, q that are no channels; say which is"),
    ("strange.csv", write("t,q\n0,1\n1,2\n"), {}, "a column map .flexspline init guesses one."),
    (
        "letter.csv",
        write("# a: 1\ntime,q\n0,1\n\n1,x7\n"),
        {"columns": Q},
        r"data row 2 \(line 5\), column 'q' is 'x7' where .output_position. needs a number",
    ),
    (
        "short_row.csv",
        write("time,q\n0,1\n1\n2,3\n"),
        {"columns": Q},
        r"data row 2 \(line 3\) has 1 fields where .* has 2; complete or delete it",
    ),
    (
        "long_row.csv",
        write("0,1\n1,2,3\n"),
        {"columns": {"time": 0}},
        r"data row 2 \(line 2\) has 3 fields",
    ),
    ("quote.csv", write('time,q\n0,"1\n1,2\n'), {"columns": Q}, "quotation mark is never closed"),
    (
        "unit.csv",
        write(GOOD),
        {"columns": {"output_position": ("q", "degs/foo")}},
        "'output_position': unit 'degs/foo' is not known; give one such as 'deg'",
    ),
    (
        "dimension.csv",
        write(GOOD),
        {"columns": {"sensor_torque": ("tau", "N")}},
        "'sensor_torque': unit 'N' does not measure what is in Nm; give one such as 'mNm'",
    ),
    (
        "hertz.csv",
        write(GOOD),
        {"columns": {"output_velocity": ("q", "Hz")}},
        "'output_velocity': unit 'Hz' does not measure what is in rad/s",
    ),
    (
        "shared.csv",
        write(GOOD),
        {"columns": {**Q, "motor_position": "q"}},
        "column 'q' is mapped to both 'output_position' and 'motor_position'; map it to one",
    ),
    (
        "twice.csv",
        write("time,q,q\n0,1,1\n1,2,2\n"),
        {"columns": Q},
        r"2 columns are named 'q' \(numbers 1, 2\); give the number",
    ),
    (
        "channel.csv",
        write(GOOD),
        {"columns": {"output_positon": "q"}},
        r"channel 'output_positon' is not known \(did you mean 'output_position'\?\)",
    ),
    (
        "no_time.csv",
        write("q\n1\n2\n"),
        {"columns": Q},
        "no time stamps; map a column to 'time' or give the rate",
    ),
    ("time_and_rate.csv", write(GOOD), {"columns": Q, "rate": 100}, "leave one out"),
    ("rate.csv", write("q\n1\n2\n"), {"columns": Q, "rate": 0}, "rate is 0; give a positive"),
    (
        "latin.csv",
        write("time,q\n0,1\n1,\xb0\n".encode("latin-1")),
        {"columns": Q},
        "line 3 is not utf-8 text; give its encoding, such as latin-1 .--encoding latin-1, ",
    ),
    ("encoding.csv", write(GOOD), {"columns": Q, "encoding": "klingon"}, "encoding 'klingon'"),
    ("picture.csv", write(b"\x89PNG\0\0"), {}, "not a text file"),
    ("separator.csv", write(GOOD), {"columns": Q, "separator": ";;"}, "is not one character"),
    ("decimal.csv", write(GOOD), {"columns": Q, "separator": ",", "decimal": ","}, "that differ"),
    ("drop.csv", write(GOOD), {"columns": Q, "drop_rows": 2}, "drop_rows is 2 of 3 rows"),
    ("ratio.csv", write("# gear_ratio: many\n" + GOOD), {"columns": Q}, "gear_ratio is 'many'"),
    ("cut.csv.gz", write(gzip.compress(GOOD.encode())[:-9]), {}, "cannot be unpacked.*copy it"),
    ("cut.csv.xz", write(lzma.compress(GOOD.encode())[:-9]), {}, "cannot be unpacked.*copy it"),
    ("bad.csv.bz2", write(b"BZh9nonsense"), {}, "cannot be unpacked.*copy it again"),
    ("bad.zip", write(b"PK nonsense"), {}, "cannot be unpacked.*copy it again"),
    ("two.zip", two_members, {}, "holds 2 files where one is wanted"),
    ("bad.npy", write(b"nonsense"), {}, "not a NumPy file of numbers"),
    ("cube.npy", lambda path: np.save(path, np.zeros((2, 2, 2))), {}, r"shape \(2, 2, 2\) is no"),
    ("object.npy", lambda path: np.save(path, np.array([{}, 1], dtype=object)), {}, "not a NumPy"),
    ("bad.npz", write(b"PK nonsense"), {}, "not a NumPy file"),
    ("bad_member.npz", damaged_npz, {}, "not a NumPy file"),
    ("bad.mat", write(b"nonsense"), {}, "not a MATLAB file, or a corrupt one"),
    (
        "variable.mat",
        matlab(data_1=np.eye(3)),
        {"variable": "data_2"},
        r"no variable 'data_2' \(did you mean 'data_1'\?\); there is data_1",
    ),
    ("which.mat", matlab(a=np.eye(3), b=np.eye(4)), {}, "a, b; name the right part with variable"),
    (
        "unequal.mat",
        matlab(time=np.arange(5.0), q=np.arange(4.0)),
        {"columns": Q},
        "column 'time' has 5 rows where column 'q' has 4; give columns of equal length",
    ),
    ("bad.json", write(LETTER), {}, "not JSON .*export it again"),
    ("number.json", write("7"), {}, "holds no records"),
    (
        "two.json",
        write(json.dumps({"a": [{"q": 1}], "b": [{"q": 1}]})),
        {},
        "lists of records under a, b; name the right one",
    ),
    (
        "text.json",
        write(json.dumps([{"time": 0, "q": 1}, {"time": 1, "q": "up"}])),
        {"columns": Q},
        "data row 2, column 'q' is 'up' where 'output_position' needs a number",
    ),
    (
        "unknown.csv",
        write(GOOD),
        {"columns": Q, "repair": "unwarp"},
        r"repair 'unwarp' is not known \(did you mean 'unwrap'\?\); the repairs are drop_invalid",
    ),
]


@pytest.mark.parametrize(("name", "make", "how", "sentence"), FILES, ids=[f[0] for f in FILES])
def test_a_broken_file_is_refused_in_one_sentence_with_its_name(
    tmp_path: Path, name: str, make: Callable[[Path], object], how: dict[str, Any], sentence: str
) -> None:
    make(tmp_path / name)
    with pytest.raises(InputError) as refused:
        read_log(tmp_path / name, **how)
    said = str(refused.value)
    assert re.search(sentence, said), said
    of_the_call = name in ("unknown.csv", "separator.csv", "decimal.csv")  # wrong before any file
    assert (name in said) is not of_the_call, said
    assert "\n" not in said


TIMES = {"time": [0, 1, 2]}
MEMORY: list[tuple[Any, dict[str, Any], str]] = [
    (42, {}, "cannot be read from a int; give a path, an array"),
    ({**TIMES, "q": [1, 2]}, {"columns": Q}, "column 'time' has 3 rows where column 'q' has 2"),
    ({**TIMES, "q": [1, None, "a"]}, {"columns": Q}, "data row 3, column 'q' is 'a'"),
    (pandas.DataFrame({**TIMES, "q": ["a", "b", "c"]}), {"columns": Q}, "data row 1, column 'q'"),
    (np.zeros((0, 2)), {"columns": {"time": 0}}, "no rows of data"),
    (
        {**TIMES, "q": [1, 2, 3]},
        {"columns": {"output_position": {"source": "q", "gain": 2}}},
        "'output_position' has an unknown key 'gain'; the keys are source, unit",
    ),
    ({**TIMES, "q": [1, 2, 3]}, {"columns": {"output_position": {"unit": "deg"}}}, "no source"),
    ({**TIMES, "q": [1, 2, 3]}, {"columns": {"output_position": 1.5}}, "is mapped to 1.5; give"),
    (
        {**TIMES, "q": [1, 2, 3]},
        {"columns": {"output_position": ColumnSource("q", sign=2)}},
        "sign 2; give 1 or -1",
    ),
    (
        {**TIMES, "q": [1, 2, 70000]},
        {"columns": {"duty": ColumnSource("q", bits=16)}},
        "data row 3, 'duty' is 70000, no whole number of 16 bits",
    ),
    (
        {**TIMES, "q": [1, 2.5, 7]},
        {"columns": {"duty": ColumnSource("q", bits=16)}},
        "data row 2, 'duty' is 2.5, no whole number",
    ),
    ({**TIMES, "q": np.array([1, 2j, 3])}, {"columns": Q}, "complex"),
    ({}, {"columns": Q}, "dictionary: is empty; give arrays"),
    ({"time": [], "q": []}, {"columns": Q}, "dictionary: no rows of data"),
    ({"time": [0.0], "q": np.ones((1, 1))}, {"columns": Q}, "dictionary: only one row of data"),
    (
        {**TIMES, "q": [1, 2, 3]},
        {"columns": {"output_position": {"source": "q", "scale": "two"}}},
        "scale 'two'; give a number",
    ),
    ({**TIMES, "q": [10**400, 2, 3]}, {"columns": Q}, "beyond all floating point"),
    ({**TIMES, "q": [1, 2, 3]}, {"columns": {"output_position": True}}, "is mapped to True; give"),
    ({**TIMES, "q": [1, 2, 3]}, {"columns": {0: "q"}}, "channel '0' is not known"),
    ({**TIMES, "q": [1, 2, 3]}, {"columns": {"output_position": ("q", 3)}}, "unit '3' is not"),
]


@pytest.mark.parametrize(("source", "how", "sentence"), MEMORY)
def test_broken_data_in_memory_is_refused_in_one_sentence(
    source: Any, how: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        read_log(source, **how)


@pytest.mark.parametrize("seed", range(40))
def test_a_bad_cell_is_found_on_its_line_however_the_file_is_spaced(
    tmp_path: Path, seed: int
) -> None:
    random = np.random.default_rng(seed)
    separator = [",", ";", "\t", " ", "   "][seed % 5]
    bad = int(random.integers(1, 30))
    lines = ["# joint: 1"] * int(random.integers(3)) + [separator.join(("time", "q", "x"))]
    for row in range(30):
        lines += ["", "  "][: int(random.integers(3))]
        if row == bad:
            line = len(lines) + 1
        lines.append(separator.join((str(row), "1e" if row == bad else f"-{row}.5", "7")))
    path = tmp_path / "run.txt"
    path.write_text("\n".join(lines) + "\n" * int(random.integers(3)))
    with pytest.raises(
        InputError, match=rf"data row {bad + 1} \(line {line}\), column 'q' is '1e'"
    ):
        read_log(path, Q)
