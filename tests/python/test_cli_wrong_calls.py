"""Each wrong call or input: exit code 2, one line on standard error, nothing written."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from cli_calls import call, fitted, write_runs

FIT = "fit {run1} --target sensor_torque --effects offset,coulomb_friction --out {new}"
PREDICT = "predict --model {model} {run1} --out {new}"

WRONG = [
    ("", "Missing command"),
    ("fti {run1}", "did you mean 'fit'"),
    ("--tragt", "No such option"),
    ("fit", "RUN.csv"),
    ("fit {run1} --effects offset --out {new}", "--target"),
    ("fit {run1} --target sensor_torque --out {new}", "--effects"),
    ("fit {run1} --target sensor_torque --effects offset", "--out"),
    ("fit {run1} --target torque --effects offset --out {new}", "sensor_torque"),
    ("fit {run1} --target sensor_torque --effects ofset --out {new}", "did you mean 'offset'"),
    ("fit {run1} --target sensor_torque --effects offset,,inertia --out {new}", "missing"),
    ("fit {run1} --target sensor_torque --effects offset,offset --out {new}", "twice"),
    ("fit {run1} --target torsion --effects inertia --out {new}", "does not act"),
    ("fit {run1} --target motor_torque --effects offset --out {new}", "motor_torque"),
    ("fit {folder}/none.csv --target sensor_torque --effects offset --out {new}", "none.csv"),
    ("fit {folder} --target sensor_torque --effects offset --out {new}", "runs"),
    ("fit {run1} {run1} --target sensor_torque --effects offset --out {new}", "twice"),
    ("fit {nan} --target sensor_torque --effects offset --out {new}", "drop_invalid"),
    ("fit {backwards} --target sensor_torque --effects offset --out {new}", "sort_time"),
    ("fit {text} --target sensor_torque --effects offset --out {new}", "text.csv"),
    ("fit {empty} --target sensor_torque --effects offset --out {new}", "empty.csv"),
    (FIT + " --orders offset", "EFFECT=1,2,4"),
    (FIT + " --orders output_ripple=1,x", "EFFECT=1,2,4"),
    (FIT + " --orders output_ripple=1,2", "output_ripple"),
    (FIT + " --orders offset=1,2", "offset"),
    (FIT + " --orders cogging=1 --orders cogging=2", "twice"),
    (FIT + " --fix inertia=0.1", "inertia"),
    (FIT + " --fix offset=much", "NAME=VALUE"),
    (FIT + " --bound offset=1", "LOW:HIGH"),
    (FIT + " --bound offset=2:1", "low < high"),
    (FIT + " --prior offset=1:0", "above zero"),
    (FIT + " --lowpass 0", "above zero"),
    (FIT + " --lowpass nan", "above zero"),
    (FIT + " --lowpass 1000", "1000"),
    (FIT + " --gear-ratio -100", "--gear-ratio"),
    (FIT + " --pole-pairs 2.5", "--pole-pairs"),
    (FIT + " --output-spline oval", "circular"),
    (FIT + " --repair unwarp", "did you mean 'unwrap'"),
    (FIT + " --repair drop_start", "drop_start=seconds"),
    (FIT + " --repair drop_start=1000", "drop_start"),
    (FIT + " --known-load reference_torque", "reference_torque"),
    (FIT + " --columns {folder}/none.toml", "none.toml"),
    (FIT + " --rate 100", "rate"),
    (FIT + " --threads 0", "--threads"),
    (FIT + " --into {run1}", "run1.csv"),
    (FIT + " --into {model} --gear-ratio 80", "gear_ratio"),
    ("fit {run1} --target sensor_torque --effects offset --out {run2}", "is a file"),
    ("predict {run1} --out {new}", "--model"),
    ("predict --model {folder}/none.json {run1} --out {new}", "none.json"),
    ("predict --model {run1} {run1} --out {new}", "run1.csv"),
    ("predict --model {model} --out {new}", "RUN.csv"),
    ("predict --model {model} {run1} {run2} --out {new}.csv", "is the name of a file"),
    ("simulate --model {model} {run1} {run2} --out {new}", "unexpected"),
    (PREDICT + " --gear-ratio 80", "gear_ratio"),
    (PREDICT + " --target torsion", "torsion"),
    ("predict --model {model} {run1} --out {run1}", "overwrite"),
    ("predict --model {model} {run1} --out {run2}/out.csv", "that you may write to"),
    ("predict --model {model} {narrow} --out {new}", "narrow"),
    ("export --model {model} --out {new}", "--format"),
    ("export --model {model} --format xml --out {new}", "header"),
    ("export --model {folder}/none.json --format json --out {new}", "none.json"),
    ("convert {run1} --out {new}", "--columns"),
    ("convert {run1} --columns {map} --out {run1}", "overwrite"),
    ("convert {run1} --columns {run1} --out {new}", "TOML"),
    ("convert {run1} --columns {map} --out {new}", "angle"),
    ("compare {run1} --out {new}", "--model"),
    ("compare {run1} --model {model}", "--out"),
    ("compare --model {model} --out {new}", "RUN.csv"),
    ("compare {run1} --model {folder}/none.json --out {new}", "none.json"),
    ("compare {folder}/none.csv --model {model} --out {new}", "none.csv"),
    ("compare {run1} {run1} --model {model} --out {new}", "twice"),
    ("compare {run1} --model {model} --target torsion --out {new}", "torsion"),
    ("compare {run1} --model {model} --gear-ratio 80 --out {new}", "gear_ratio"),
    ("compare {run1} --model {model} --lowpass 1000 --out {new}", "1000"),
    ("compare {run1} --model {model} --simulated --lowpass 5 --out {new}", "lowpass"),
    ("compare {run1} --model {model} --controller servo.json --out {new}", "servo.json"),
    ("compare {run1} --model {model} --out {run2}", "is a file"),
    ("compare {narrow} --model {model} --out {new}", "narrow"),
    ("demo --out {run1}", "is a file"),
    ("init {run1} --out ''", "no name of a file"),
    ("init {run1} --out /", "no name of a file"),
]


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("runs")
    run1, run2 = write_runs(folder)
    lines = run1.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("time")) + 1
    columns = lines[first - 1].split(",")
    broken = lines[first + 5].split(",")
    broken[columns.index("sensor_torque")] = "nan"
    files = {
        "nan": [*lines[: first + 5], ",".join(broken), *lines[first + 6 :]],
        "backwards": [*lines[:first], *lines[: first - 1 : -1]],
        "text": ["some words", "and no", "numbers"],
        "empty": [],
        "narrow": ["time,sensor_torque", *(f"{k / 100},0.1" for k in range(500))],
        "map": ["[columns]", 'output_position = "angle"'],
    }
    found = {"folder": folder, "run1": run1, "run2": run2}
    for name, content in files.items():
        found[name] = folder / f"{name}.csv"
        found[name].write_text("\n".join(content))
    found["model"] = fitted(folder, [run1, run2]) / "model.json"
    return found


@pytest.mark.parametrize(("line", "says"), WRONG, ids=[line or "nothing" for line, _ in WRONG])
def test_a_wrong_call_is_one_line_and_writes_nothing(
    line: str, says: str, places: dict[str, Path], tmp_path: Path
) -> None:
    before = contents(places["folder"])
    named = {name: shlex.quote(str(path)) for name, path in places.items()}
    result = call(*shlex.split(line.format(**named, new=tmp_path / "new")))
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1 and result.stderr.endswith("\n")
    assert says in result.stderr
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []
    assert contents(places["folder"]) == before


def test_no_byte_of_an_input_steers_the_terminal(tmp_path: Path) -> None:
    name = f"{tmp_path}/\x1b]0;owned\x07\u202e.json"
    result = call("export", "--model", name, "--format", "json", "--out", tmp_path / "new")
    assert result.exit_code == 2 and "owned" in result.stderr
    assert result.stderr.rstrip("\n").isprintable()


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
