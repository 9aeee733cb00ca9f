"""Damaged logs, absurd numbers and hostile files: one sentence and exit code 2, or a right result.

Any command may get any of this. It never ends as a defect (exit code 1), never leaves half a file,
and never asks for more memory than the file is worth.
"""

from __future__ import annotations

import bz2
import errno
import gzip
import io
import json
import lzma
import os
import random
import resource
import shutil
import signal
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from cli_calls import call, fitted, write_runs
from fit_logs import friction

import flexspline
from flexspline.comparison import compare
from flexspline.errors import LONGEST_SENTENCE, InputError
from flexspline.exporting.cpp_text import comment, namespace_name
from flexspline.forward.servo import PositionServo
from flexspline.logs.columns import to_si
from flexspline.logs.derive import differentiate, resample
from flexspline.logs.log import MOST, SHORTEST, Log
from flexspline.logs.read import read_log
from flexspline.model import Model
from flexspline.orders import find_orders, order_spectrum, time_spectrum, vibrations

EXAMPLES = int(os.environ.get("FLEXSPLINE_BAD_DAYS", "200"))  # 2000 before a release
FAILED_ONCE = (375, 807, 1737, 3102)
"""Seeds beyond these that a command once answered with a defect: no finite angle on the rows of a
comparison, an angle that no axis holds, a run without rows in its middle, no band to draw."""
OVERLOAD = 9.91e37  # SCPI
GOOD = "time,output_position\n" + "".join(f"{k / 100},{0.1 * k}\n" for k in range(200))
BYTES = GOOD.encode()
FIT = ("--target", "sensor_torque", "--effects", "offset,viscous_friction")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run and a model that was fitted to it and another one."""
    folder = tmp_path_factory.mktemp("rig")
    runs = write_runs(folder)
    return runs[0], fitted(folder, runs) / "model.json"


def short(run: Path, rows: int) -> Log:
    return read_log(run).rows(slice(0, rows), note="short")


def spoilt(log: Log, channel: str, row: int, value: float) -> Log:
    values = np.array(log[channel])
    values[row] = value
    return log.with_columns({channel: values}, note="spoilt")


def refused(path: Path | str, **how: Any) -> str:
    with pytest.raises(InputError) as caught:
        read_log(path, **how)
    said = str(caught.value)
    assert said.isprintable() and len(said) <= LONGEST_SENTENCE + 3
    return said


# numbers


@pytest.mark.parametrize("value", [1e308, -1e308, np.inf, np.nan, 1e12])
@pytest.mark.parametrize("row", [0, 100, -1])
def test_a_time_that_no_clock_shows_is_refused_by_all(
    rig: tuple[Path, Path], value: float, row: int
) -> None:
    log, model = spoilt(short(rig[0], 400), "time", row, value), Model.load(rig[1])
    assert {f.name for f in flexspline.check(log).errors} & {"not_finite", "impossible_value"}
    for use in (
        lambda: flexspline.fit(friction(), [log], "sensor_torque"),
        lambda: model.predict(log),
        lambda: flexspline.simulate(model, log),
        lambda: flexspline.estimate(model, log),
        lambda: compare(model, log),
    ):
        with pytest.raises(InputError, match="time"):
            use()


@pytest.mark.parametrize("factor", [1e-300, 1e-12, 1e12, 1e300])
def test_steps_of_time_that_no_recorder_has_are_refused(
    rig: tuple[Path, Path], factor: float
) -> None:
    log = short(rig[0], 400)
    log = log.with_columns({"time": log["time"] * factor}, note="in another unit")
    assert next(f.name for f in flexspline.check(log).errors).startswith("impossible")
    with pytest.raises(InputError, match="correct the unit"):
        Model.load(rig[1]).predict(log)
    for use in (find_orders, order_spectrum, time_spectrum):
        with pytest.raises(InputError, match="correct the unit"):
            use(log, "sensor_torque")


def test_the_fastest_clock_and_unix_time_are_none_of_that(
    rig: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    log = short(rig[0], 400)
    fast = log.with_columns({"time": np.arange(400) * 2.0 * SHORTEST}, note="fast")
    since_1970 = log.with_columns({"time": log["time"] + 1.8e9}, note="unix")
    for one in (fast, since_1970):
        assert not flexspline.check(one).errors
    monkeypatch.setattr(vibrations, "_MOST_SCANNED", 10_000)
    assert find_orders(fast, "sensor_torque", vibrations=True).frequencies[1] == 10_000.0


@pytest.mark.parametrize("value", [1e308, -1e308, OVERLOAD, 1.1e9])
def test_what_no_instrument_reads_counts_as_empty_and_is_told(
    rig: tuple[Path, Path], value: float
) -> None:
    log, model = spoilt(short(rig[0], 400), "sensor_torque", 7, value), Model.load(rig[1])
    made, gone = model.predict(log), model.predict(spoilt(log, "sensor_torque", 7, np.nan))
    np.testing.assert_array_equal(made.residual, gone.residual)
    assert np.isnan(made.measured[7]) and "row 7" in made.warnings[0]
    assert any("row 7" in note for note in compare(model, log).notes)
    (found,) = flexspline.check(log).named("impossible_value")
    assert found.rows == (7, 8) and "drop_invalid" in found.remedy
    with pytest.raises(InputError, match=r"sensor_torque is .* row 7, which no instrument reads"):
        flexspline.fit(friction(), [log], "sensor_torque")


def test_a_position_that_no_encoder_reads_is_named_before_it_is_derived(
    rig: tuple[Path, Path],
) -> None:
    log = spoilt(short(rig[0], 400), "output_position", 7, 1e308)
    with pytest.raises(InputError, match=r"row 7: output_position is 1e\+308 rad, beyond"):
        differentiate(log)


def test_drop_invalid_takes_overloads_out_and_says_so(rig: tuple[Path, Path]) -> None:
    lines = rig[0].read_text().splitlines()
    lines[20] = ",".join([*lines[20].split(",")[:-1], str(OVERLOAD)])
    path = rig[0].with_name("overload.csv")
    path.write_text("\n".join(lines))
    log = read_log(path, repair="drop_invalid")
    assert len(log) == len(read_log(path)) - 1
    assert "9.91e+37" in log.history[-1]


@pytest.mark.parametrize("factor", [1e-200, 1e-310])
def test_a_target_that_no_instrument_resolves_is_refused(
    rig: tuple[Path, Path], factor: float
) -> None:
    log = short(rig[0], 400)
    log = log.with_columns({"sensor_torque": factor * log["sensor_torque"]}, note="tiny")
    with pytest.raises(InputError, match="which no instrument resolves"):
        flexspline.fit(friction(), [log], "sensor_torque")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--fix", "offset=1e308"), "fixed: offset is 1e+308, beyond"),
        (("--prior", "offset=1e308:1"), "priors: offset is 1e+308, beyond"),
        (("--prior", "offset=0:1e308"), "the error of offset is 1e+308"),
        (("--prior", "offset=0:1e-308"), "give one above 1e-15"),
        (("--bound", "offset=1e308:"), "bounds: offset is 1e+308"),
        (("--lowpass", "1e-308"), "choose one above 2e-07 Hz"),
        (("--bandwidth", "1e-300"), "choose one above 2e-07 Hz"),
        (("--gear-ratio", "1e308"), "gear_ratio is 1e+308, which no joint has"),
        (("--gear-ratio", "1e-300"), "gear_ratio is 1e-300, which no joint has"),
        (("--torque-constant", "1e308"), "torque_constant is 1e+308"),
        (("--pole-pairs", "1" + "0" * 400), "pole_pairs is 1000"),
        (("--slots", "9" * 5000), "--slots"),
        (("--repair", "resample=1e12"), "GB may be taken; give a lower rate"),
        (("--repair", "resample=1e308"), "GB may be taken; give a lower rate"),
        (("--repair", "resample=1e-300"), "does not suit"),
        (("--max-memory", "0"), "above zero"),
    ],
)
def test_a_setting_that_no_joint_has_is_one_sentence(
    rig: tuple[Path, Path], tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    result = call("fit", rig[0], *FIT, *options, "--out", tmp_path / "new")
    assert result.exit_code == 2, result.output
    assert said in result.stderr and result.stderr.count("\n") == 1
    assert len(result.stderr) < LONGEST_SENTENCE + 100
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("limit", ["velocity=1e308", "acceleration=1e308", "duration=1e308",
                                   "position=-1e308,1e308", "velocity=1e-308"])  # fmt: skip
def test_a_limit_that_no_joint_has_is_refused_before_any_search(
    rig: tuple[Path, Path], tmp_path: Path, limit: str
) -> None:
    result = call("discover", rig[0], *FIT, "--limit", limit, "--out", tmp_path / "new")
    assert result.exit_code == 2 and "which no joint can do" in result.stderr


def test_the_largest_setting_is_still_computed_with(rig: tuple[Path, Path]) -> None:
    log = short(rig[0], 800)
    made = flexspline.fit(friction(), [log], "sensor_torque", fixed={"offset": MOST}, checks=False)
    assert np.isfinite(made.part.coefficients).all()


@pytest.mark.parametrize("number", ["1e308", "9" * 400, "9" * 5000, "1e9999", "nan", "-1", "0"])
def test_a_fact_that_no_joint_has_is_refused(tmp_path: Path, number: str) -> None:
    path = tmp_path / "run.csv"
    for fact in ("gear_ratio", "slots"):
        path.write_text(f"# {fact}: {number}\n{GOOD}")
        assert fact in refused(path)


@pytest.mark.parametrize("value", [1e308, 10**400, float("nan"), None, "x"])
def test_a_servo_that_no_joint_has_is_refused(value: Any) -> None:
    with pytest.raises(InputError, match="velocity_gain is"):
        PositionServo(position_gain=1.0, velocity_gain=value)


@pytest.mark.parametrize("ratio", [1e308, 1e-308, 1e10, 2**31])
def test_a_model_of_a_gear_that_none_is_has_no_export(
    rig: tuple[Path, Path], tmp_path: Path, ratio: float
) -> None:
    content = json.loads(rig[1].read_text())
    content["joint"]["gear_ratio"] = ratio
    path = tmp_path / "model.json"
    path.write_text(json.dumps(content))
    for form in ("binary", "header", "json"):
        result = call("export", "--model", path, "--format", form, "--out", tmp_path / "out")
        assert result.exit_code == 2 and "joint/gear_ratio" in result.stderr


def test_resampling_within_memory_is_done(rig: tuple[Path, Path]) -> None:
    assert len(resample(short(rig[0], 400), 1e4)) > 15_000


@pytest.mark.parametrize("rows", [2, 3, 4, 19])
def test_a_recording_of_few_rows_is_called_too_short(
    rig: tuple[Path, Path], tmp_path: Path, rows: int
) -> None:
    from flexspline.logs.writing import write_log

    run = tmp_path / "run.csv"
    write_log(short(rig[0], rows), run)
    assert call("check", run).exit_code == 0
    for command in (
        ("fit", run, *FIT),
        ("discover", run, *FIT),
        ("compare", run, "--model", rig[1]),
    ):
        result = call(*command, "--out", tmp_path / "new")
        assert result.exit_code == 2 and f"{rows} rows" in result.stderr
    assert list(tmp_path.iterdir()) == [run]


def test_a_run_that_the_model_explains_to_the_bit_has_no_gap(rig: tuple[Path, Path]) -> None:
    log, model = read_log(rig[0]), Model.load(rig[1])
    exact = log.with_columns({"sensor_torque": model.predict(log).predicted}, note="exact")
    made = compare(model, exact)
    assert "0 Nm RMS" in str(made) and "nan" not in str(made)


def test_one_row_without_an_angle_is_left_out_of_the_orders(rig: tuple[Path, Path]) -> None:
    log, model = short(rig[0], 1200), Model.load(rig[1])
    turned = log["sensor_torque"] + 0.5 * np.cos(20.0 * log["output_position"])
    log = log.with_columns({"sensor_torque": turned}, note="with an order")
    made = compare(model, spoilt(log, "output_position", -5, np.nan))
    assert np.isfinite(made.rmse) and made.rmse == pytest.approx(compare(model, log).rmse, rel=0.05)


# silently wrong


def test_copies_of_a_run_are_told_with_the_files_whatever_their_format(
    rig: tuple[Path, Path], tmp_path: Path
) -> None:
    shutil.copy(rig[0], tmp_path / "copy.csv")
    log = read_log(rig[0])
    np.savez(tmp_path / "copy.npz", **{name: log[name] for name in log.channels})
    for copy in ("copy.csv", "copy.npz"):
        pair = (rig[0], tmp_path / copy)
        for line in (("fit", *pair, *FIT), ("discover", *pair, *FIT),
                     ("compare", *pair, "--model", rig[1])):  # fmt: skip
            result = call(*line, "--gear-ratio", "100", "--output-spline", "circular",
                          "--out", tmp_path / "new")  # fmt: skip
            assert result.exit_code == 2 and result.stderr.count(".csv") + (copy[-1] == "z") >= 2
            assert str(rig[0]) in result.stderr and copy in result.stderr, result.stderr


@pytest.mark.parametrize("row", [0, 200, 399])
def test_nothing_is_simulated_on_a_clock_that_runs_back(rig: tuple[Path, Path], row: int) -> None:
    model = flexspline.fit(["offset"], [read_log(rig[0])], "sensor_torque", checks=False).model
    log = short(rig[0], 400)
    flexspline.simulate(model, log)
    for value in (np.nan, 1.0 if row != 200 else 0.0):
        with pytest.raises(InputError, match="time"):
            flexspline.simulate(model, spoilt(log, "time", row, value))


def test_a_run_that_would_be_overwritten_is_refused(rig: tuple[Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    for name in ("report.html", "model.json", "comparison.json", "next_experiment.csv"):
        shutil.copy(rig[0], out / name)
    before = rig[0].read_bytes()
    for command, name in (
        ("fit", "report.html"),
        ("fit", "model.json"),
        ("discover", "report.html"),
        ("discover", "next_experiment.csv"),
        ("compare", "comparison.json"),
        ("check", "report.html"),
    ):
        how = {"compare": ("--model", rig[1]), "check": ()}.get(command, FIT)
        result = call(command, out / name, *how, "--out", out)
        assert result.exit_code == 2 and "would overwrite" in result.stderr
        assert (out / name).read_bytes() == before


@pytest.mark.parametrize("command", ["check", "fit", "predict"])
def test_a_model_or_a_report_is_no_log(
    rig: tuple[Path, Path], tmp_path: Path, command: str
) -> None:
    how = {"check": (), "fit": FIT, "predict": ("--model", rig[1])}[command]
    for file in (rig[1], rig[1].with_name("report.html")):
        result = call(command, file, *how, "--out", tmp_path / "new")
        assert result.exit_code == 2 and file.name in result.stderr


def test_a_full_disk_is_told_with_the_file_and_a_remedy(
    rig: tuple[Path, Path], tmp_path: Path
) -> None:
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limit[1]))
    try:
        one = call("predict", rig[0], "--model", rig[1], "--out", tmp_path / "residual.csv")
        many = call("check", rig[0], "--out", tmp_path / "audit")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, before)
    for result, file in ((one, "residual.csv"), (many, "audit/report.html")):
        assert result.exit_code == 2 and f"{tmp_path / file}: cannot be written" in result.stderr
        assert "make room" in result.stderr
    assert not list(tmp_path.iterdir())


# files


PACKERS: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "bz2": bz2.compress,
    "xz": lzma.compress,
}


@pytest.mark.parametrize("kind", PACKERS)
def test_a_packed_file_cut_anywhere_is_refused(tmp_path: Path, kind: str) -> None:
    whole = PACKERS[kind](BYTES)
    path = tmp_path / f"run.csv.{kind}"
    for end in range(1, len(whole), max(1, len(whole) // 40)):
        path.write_bytes(whole[:end])
        assert "copy it again" in refused(path)
    path.write_bytes(whole)
    assert len(read_log(path)) == 200


def test_nothing_unfolds_beyond_the_memory_that_it_may_take(tmp_path: Path) -> None:
    zeros = bytes(30_000_000)
    for kind, pack in PACKERS.items():
        (tmp_path / f"run.csv.{kind}").write_bytes(pack(zeros))
    with zipfile.ZipFile(tmp_path / "run.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run.csv", zeros)
    long = np.zeros(3_000_000)
    np.savez_compressed(tmp_path / "run.npz", time=long)
    scipy.io.savemat(tmp_path / "run.mat", {"time": long}, do_compression=True)
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file.create_dataset("time", (10**13,), "f8", chunks=(1000,), compression="gzip")
    files = sorted(tmp_path.iterdir())
    assert len(files) == 7
    for path in files:
        assert path.stat().st_size < 100_000
        assert "--max-memory" in refused(path, max_memory=0.01), path
    for command in ("check", "init"):
        result = call(command, files[0], "--max-memory", "0.01")
        assert result.exit_code == 2 and "GB of memory" in result.stderr


def array_head(shape: tuple[Any, ...], kind: str = "<f8") -> bytes:
    file = io.BytesIO()
    head = {"shape": shape, "fortran_order": False, "descr": kind}
    np.lib.format.write_array_header_1_0(file, head)
    return file.getvalue()


TOUCH = "cos\nsystem\n(S'touch {}'\ntR."


@pytest.mark.parametrize(
    "head",
    [array_head(shape) for shape in ((10**12,), (10**18, 10**18), (-5,), (10**400,), (True,))]
    + [array_head((3,), "|O"), array_head((3,), "<U1000000000"), b"text", b""],
    ids=str,
)
def test_a_head_of_numpy_is_believed_no_further_than_its_file(tmp_path: Path, head: bytes) -> None:
    content = head + TOUCH.format(tmp_path / "owned").encode() + bytes(100)
    (tmp_path / "run.npy").write_bytes(content)
    (tmp_path / "run.npy.gz").write_bytes(gzip.compress(content))
    with zipfile.ZipFile(tmp_path / "run.npz", "w") as archive:
        archive.writestr("time.npy", content)
    for path in sorted(tmp_path.iterdir()):
        assert "not a NumPy file of numbers" in refused(path)
    assert not (tmp_path / "owned").exists()


def test_a_file_of_hdf5_reads_no_other_file_of_the_machine(tmp_path: Path) -> None:
    secret, other = tmp_path / "secret.bin", tmp_path / "other.h5"
    secret.write_bytes(np.arange(10.0).tobytes())
    with h5py.File(other, "w") as file:
        file["time"] = np.arange(10.0)

    def external(file: Any) -> None:
        file.create_dataset("time", (10,), "f8", external=[(str(secret), 0, 80)])

    def linked(file: Any) -> None:
        file["time"] = h5py.ExternalLink(str(other), "/time")

    def soft(file: Any) -> None:
        file["time"] = h5py.SoftLink("/output_position")

    def virtual(file: Any) -> None:
        layout = h5py.VirtualLayout((10,), "f8")
        layout[:] = h5py.VirtualSource(str(other), "time", (10,))
        file.create_virtual_dataset("time", layout)

    def inside(file: Any) -> None:
        file.create_group("run")["time"] = h5py.ExternalLink(str(other), "/time")

    for make in (external, linked, soft, virtual, inside):
        path = tmp_path / f"{make.__name__}.mat"
        with h5py.File(path, "w") as file:
            file["output_position"] = np.arange(10.0)
            make(file)
        assert "time'" in refused(path)


def test_a_group_of_hdf5_that_holds_itself_is_read_once(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "run.h5", "w") as file:
        group = file.create_group("run")
        group["again"] = group
        group["time"], group["output_position"] = np.arange(10.0), np.ones(10)
    assert read_log(tmp_path / "run.h5").channels == ("time", "output_position")


def test_the_memory_that_hdf5_may_take_is_that_of_all_its_datasets(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for name in ("time", "output_position", "output_velocity"):
            file.create_dataset(name, data=np.arange(100_000.0), compression="gzip")
    assert "--max-memory" in refused(tmp_path / "run.h5", max_memory=0.002)  # one takes 0.0008
    assert len(read_log(tmp_path / "run.h5", max_memory=0.003)) == 100_000


def test_a_read_that_fails_midway_names_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.csv").write_bytes(BYTES)

    def fail(path: Path) -> bytes:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(Path, "read_bytes", fail)
    for command in ("check", "init"):
        result = call(command, tmp_path / "run.csv")
        assert result.exit_code == 2
        assert f"{tmp_path / 'run.csv'}: cannot be read (Input/output error)" in result.stderr


@pytest.mark.parametrize(
    "content",
    [
        "[[0, 1], [2]]",
        "[[0, 1], [2, [3]]]",
        '{"time": [[0, 1], [2]], "output_position": [1, 2]}',
        '{"time": [0, 1, 2], "output_position": [0, 1, "\\ud800"]}',
        '{"time": [0, 1, 2], "output_position": [0, 1, {"a": 1}]}',
        '[{"time": 0, "output_position": [1, 2]}, {"time": 1, "output_position": 2}]',
        '{"time": [0, 1, 2], "output_position": [0, 1, ' + "9" * 400 + "]}",
    ],
)
def test_ragged_json_and_halves_of_characters_are_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "run.json").write_text(content)
    refused(tmp_path / "run.json")


def test_halves_of_characters_in_facts_never_leave(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    path.write_text(
        '{"time": [0, 1], "output_position": [0, 1], "name": "\\ud800", "a": "\\udfff"}'
    )
    str(read_log(path)).encode()


def test_a_name_that_is_no_utf8_and_a_nul_are_read_or_refused(tmp_path: Path) -> None:
    path = os.fsdecode(os.fsencode(tmp_path) + b"/run\xff.csv")
    Path(path).write_text(GOOD)
    assert call("check", path).exit_code == 0
    str(read_log(path)).encode()
    refused("run\0.csv")
    (tmp_path / "nul.csv").write_bytes(b"# a: b\n" + b"#" * 5000 + b"\n" + BYTES + b"2\x00,3\n")
    assert "line 204" in refused(tmp_path / "nul.csv")
    (tmp_path / "bytes.csv").write_bytes(b"# name: \xff\n" + BYTES)
    assert "line 1 is not utf-8" in refused(tmp_path / "bytes.csv")


def test_a_header_line_may_be_as_long_as_it_likes(tmp_path: Path) -> None:
    names = [f"a_channel_that_nobody_needs_{number}" for number in range(9000)]
    rows = (",".join(["1"] * 9000) + f",{row},2" for row in range(3))
    (tmp_path / "run.csv").write_text(",".join(names) + ",time,output_position\n" + "\n".join(rows))
    assert len(read_log(tmp_path / "run.csv")) == 3


@pytest.mark.parametrize("cell", ["z" * 200_000, "z " * 100_000])
def test_no_sentence_repeats_a_cell_or_a_path_of_thousands_of_characters(
    tmp_path: Path, cell: str
) -> None:
    (tmp_path / "run.csv").write_text(f"{GOOD}9,{cell}\n")
    said = refused(tmp_path / "run.csv")
    assert "line 202" in said and said.endswith("correct or empty the cell")
    (tmp_path / "head.csv").write_text(f"time,{cell},output_position\n0,1,2\n1,1,2\n")
    refused(tmp_path / "head.csv")
    assert refused(str(tmp_path / cell.replace(" ", ""))).endswith("give the path of a log")


@pytest.mark.parametrize("encoding", ["punycode", "undefined", "base64", "rot13", "utf-32", "\0"])
def test_an_encoding_that_is_none_of_texts_is_refused(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "run.csv").write_text(GOOD)
    assert "encoding" in refused(tmp_path / "run.csv", encoding=encoding)


@pytest.mark.parametrize(("encoding", "cell"), [("utf-7", "+2AA-"), ("unicode_escape", "\\ud800")])
def test_a_codec_that_makes_halves_of_characters_is_refused(
    tmp_path: Path, encoding: str, cell: str
) -> None:
    (tmp_path / "run.csv").write_text(f"time,output_position\n0,{cell}\n1,1\n")
    assert "is not" in refused(tmp_path / "run.csv", encoding=encoding)


# units, texts and names


@pytest.mark.parametrize(
    "unit",
    ["10**10**10", "10**10**10*Nm", "Nm**99999999", "Nm**999", "2**99999*Nm", "Nm**2**9",
     "(((((Nm", "Nm" * 3000, "__import__('os')", "\0", "\ud800", "[]", "1e-3 Nm"],
)  # fmt: skip
def test_a_unit_is_not_computed_with(unit: str) -> None:
    with pytest.raises(InputError, match="is not known"):
        to_si("sensor_torque", unit)


@pytest.mark.parametrize(
    ("channel", "unit", "factor"),
    [
        ("sensor_torque", "N m", 1.0),
        ("sensor_torque", "kg*m**2/s**2", 1.0),
        ("sensor_torque", "kg m² s⁻²", 1.0),
        ("sensor_torque", "N·m", 1.0),
        ("output_velocity", "rev/min", np.pi / 30.0),
        ("output_velocity", "rad*s^-1", 1.0),
        ("output_acceleration", "deg/s/s", np.pi / 180.0),
        ("output_acceleration", "rad/(s*s)", 1.0),
        ("output_position", "°", np.pi / 180.0),
        ("time", "µs", 1e-6),
        ("duty", "%", 0.01),
        ("duty", "–", 1.0),
    ],
)
def test_a_unit_as_people_write_it_is_known(channel: str, unit: str, factor: float) -> None:
    assert to_si(channel, unit) == (pytest.approx(factor, rel=1e-12), 0.0)


def test_no_text_of_a_log_steers_the_terminal(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"# na\x1bme: x\n# colour: \x1b[31mred\x9b\n# name: \x1b]0;owned\x07\n{GOOD}")
    log = read_log(path, {"output_velocity": "output_position"})
    for text in (str(log), repr(log), str(flexspline.check(log)), call("check", path).stdout):
        assert all(letter.isprintable() or letter == "\n" for letter in text)


def test_a_comment_of_a_header_is_ascii_but_for_the_signs_of_units() -> None:
    assert comment("a\u202eb\u2028c\x85d??/e\u2066*/x\u200b\u0430é") == "a b c d? ?/e * /x ?e"
    assert comment("0.1 ± 0.2 Nm·s²/rad") == "0.1 ± 0.2 Nm·s²/rad"


HEADERS = ("cmath", "cstring", "ctime", "cstdio", "cstdlib", "cassert", "csignal", "climits",
           "cerrno", "cinttypes", "cfloat", "mutex")  # fmt: skip
CLASHING = ("j0", "y1", "index", "time", "clock", "new", "double", "class", "NULL", "EOF", "NAN",
            "assert", "errno", "M_PI", "M_PI_2", "INT_MAX", "SIGINT", "EINVAL", "PRId64", "stdin",
            "FLT_MAX", "SEEK_SET", "HUGE_VAL", "BUFSIZ", "std", "va_arg", "abs")  # fmt: skip


def test_every_file_name_gives_a_namespace_that_compiles_behind_the_c_library() -> None:
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("no g++; install Debian's g++ to compile the names")
    lines = [f"#include <{name}>" for name in HEADERS]
    names = {namespace_name(stem) for stem in (*CLASHING, "joint", "UR5", "E1", "JOINT_7")}
    lines += [f"namespace {name} {{ constexpr int a = 1; }}" for name in sorted(names)]
    made = subprocess.run(
        [compiler, "-std=gnu++20", "-fsyntax-only", "-x", "c++", "-"],
        input="\n".join(lines), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    assert {"joint", "UR5", "E1", "JOINT_7"} <= names


# random damage


TOKENS = ("", "nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "9" * 400, "1,5", '"', "#", ";",
          "\t", "\0", "é", "0x1p3", "1e", "None", "9.91e37", "-0", "z" * 3000, "1_000")  # fmt: skip
NUMBERS = ("nan", "inf", "1e308", "-1e308", "1e-308", "1e-320", "9.91e37", "-0", "0", "1e9", "1e11",
           "1e16", "-1e20", "1e-20", "1.8e9")  # fmt: skip
ROWS = 260


Rows = list[list[str]]


def _cell(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    row = [*rows[at][:column], chance.choice(TOKENS), *rows[at][column + 1 :]]
    return [*rows[:at], row, *rows[at + 1 :]]


def _cut(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    return [*rows[:at], rows[at][:column], *rows[at + 1 :]]


def _dropped(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    return [row[:column] + row[column + 1 :] for row in rows]


def _doubled(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    return [row + row[column : column + 1] for row in rows]


def _left_out(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    return rows[:at] + rows[at + chance.randint(1, ROWS) :]


def _repeated(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    return rows[:at] + rows[at - chance.randint(0, 3) :]


def _replaced(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    return [rows[0], *(_cell([row], 0, column, chance)[0] for row in rows[1:])]


def _scaled(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    factor = 10.0 ** chance.choice((-300, -200, -20, -12, 9, 30, 200, 300))
    made = [list(row) for row in rows]
    for row in made[1:]:
        try:
            row[column] = repr(float(row[column]) * factor)
        except (IndexError, ValueError):
            continue
    return made


def _shuffled(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    return chance.sample(rows, len(rows))


def _number(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    row = [*rows[at][:column], chance.choice(NUMBERS), *rows[at][column + 1 :]]
    return [*rows[:at], row, *rows[at + 1 :]] if at else rows


def _constant(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    number = chance.choice(NUMBERS)
    return [rows[0], *([*row[:column], number, *row[column + 1 :]] for row in rows[1:])]


def _sorted(rows: Rows, at: int, column: int, chance: random.Random) -> Rows:
    return [rows[0], *_shuffled(rows[1:], at, column, chance)]


SYNTAX = (_cell, _cell, _cut, _dropped, _doubled, _left_out, _repeated, _replaced, _shuffled)
OF_NUMBERS = (_number, _number, _constant, _scaled, _left_out, _sorted)
"""Faults behind which a log is still a table, so that the numbers are what a command meets."""


def damaged(lines: list[str], chance: random.Random) -> bytes:
    """A log of these lines with up to four faults of the kinds that disks and people make."""
    rows = [line.split(",") for line in lines[-ROWS - 1 :]]
    table = chance.random() < 0.6
    for _ in range(chance.randint(1, 3)):
        if rows and rows[0]:
            at, column = chance.randrange(len(rows)), chance.randrange(len(rows[0]))
            rows = chance.choice(OF_NUMBERS if table else SYNTAX)(rows, at, column, chance)
    separator = chance.choice((",", ";", "\t", " ", "|"))
    text = "\n".join(separator.join(row) for row in rows)
    content = bytearray(("\n".join(lines[: -ROWS - 1]) + "\n" + text).encode())
    if not table and chance.random() < 0.4:
        first = chance.randrange(len(content))
        content[first : first + chance.randrange(60)] = chance.randbytes(chance.randrange(9))
    return bytes(content)


COMMANDS = ("check", "fit", "compare", "predict", "convert", "simulate", "estimate")
HOW = {"fit": FIT, "check": (), "convert": ()}
WRITTEN = {"check": {"check.json", "report.html"}, "fit": {"model.json", "report.html"},
           "compare": {"comparison.json", "report.html"}}  # fmt: skip


@pytest.mark.parametrize("part", range(4))
def test_a_randomly_damaged_log_is_used_or_refused_in_one_line(
    rig: tuple[Path, Path], tmp_path: Path, part: int
) -> None:
    head = [line for line in rig[0].read_text().splitlines() if line]
    facts = [line for line in head if line.startswith("#")]
    lines = head[: len(facts) + 1 + ROWS]
    columns = tmp_path / "map.toml"
    columns.write_text('[columns]\noutput_position = {source = "output_position", unit = "rad"}\n')
    for seed in sorted({*range(part, EXAMPLES, 4), *FAILED_ONCE[part::4]}):
        chance = random.Random(seed)
        run, out = tmp_path / "run.csv", tmp_path / "out"
        run.write_bytes(damaged(lines, chance))
        command = chance.choice(COMMANDS)
        more = HOW.get(command, ("--model", rig[1]))
        more = ("--columns", columns) if command == "convert" else more
        result = call(command, run, *more, "--out", out)
        where = f"seed {seed}, {command}: {result.output[-600:]}"
        assert result.exit_code in (0, 2, 3), where
        if result.exit_code == 2:
            assert result.stderr.count("\n") == 1, where
            assert "out" not in {path.name for path in tmp_path.iterdir()}, where
        elif command in WRITTEN:
            assert {path.name for path in out.iterdir()} == WRITTEN[command], where
            shutil.rmtree(out)
        else:
            assert out.read_bytes().endswith(b"\n"), where
            out.unlink()
        left = {path.name for path in tmp_path.iterdir()}
        assert left == {"map.toml", "run.csv"}, where
