"""`flexspline compare`: what it writes, what it prints, and that it writes all or nothing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cli_calls import call, fitted, write_runs

import flexspline
from flexspline.model import Model

WRONG = [
    ("{run1} --out {new}", "--model"),
    ("{run1} --model {model}", "--out"),
    ("--model {model} --out {new}", "RUN.csv"),
    ("{run1} --model {folder}/none.json --out {new}", "none.json"),
    ("{folder}/none.csv --model {model} --out {new}", "none.csv"),
    ("{run1} {run1} --model {model} --out {new}", "twice"),
    ("{run1} --model {model} --target torsion --out {new}", "torsion"),
    ("{run1} --model {model} --gear-ratio 80 --out {new}", "gear_ratio"),
    ("{run1} --model {model} --lowpass 1000 --out {new}", "1000"),
    ("{run1} --model {model} --simulated --lowpass 5 --out {new}", "lowpass"),
    ("{run1} --model {model} --controller servo.json --out {new}", "servo.json"),
    ("{run1} --model {model} --out {run2}", "is a file"),
    ("{narrow} --model {model} --out {new}", "narrow"),
]


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("runs")
    run1, run2 = write_runs(folder)
    narrow = folder / "narrow.csv"
    narrow.write_text("time,sensor_torque\n" + "".join(f"{k / 100},0.1\n" for k in range(500)))
    model = fitted(folder, [run1, run2]) / "model.json"
    return {"folder": folder, "run1": run1, "run2": run2, "narrow": narrow, "model": model}


def test_compare_leaves_numbers_and_report_and_nothing_else(
    tmp_path: Path, places: dict[str, Path]
) -> None:
    out = tmp_path / "where"
    runs = [places["run1"], places["run2"]]
    result = call("compare", *runs, "--model", places["model"], "--out", out)
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    assert sorted(path.name for path in out.iterdir()) == ["comparison.json", "report.html"]
    made = flexspline.compare(Model.load(places["model"]), [flexspline.read_log(p) for p in runs])
    assert str(made) in result.stdout
    content = json.loads((out / "comparison.json").read_text(encoding="utf-8"))
    assert content == json.loads(made.to_json())
    assert [run["path"] for run in content["runs"]] == [str(path) for path in runs]
    assert all(len(run["sha256"]) == 64 for run in content["runs"])


@pytest.mark.usefixtures("undrawn")
def test_the_overall_error_is_that_of_predict(tmp_path: Path, places: dict[str, Path]) -> None:
    assert call("compare", places["run1"], "--model", places["model"], "--out",
                tmp_path / "where").exit_code == 0  # fmt: skip
    said = call("predict", places["run1"], "--model", places["model"], "--out", tmp_path / "p.csv")
    content = json.loads((tmp_path / "where" / "comparison.json").read_text(encoding="utf-8"))
    assert f"RMSE {content['overall']['rmse']:.4g} Nm" in said.stdout


@pytest.mark.usefixtures("undrawn")
def test_the_low_pass_reaches_the_comparison(tmp_path: Path, places: dict[str, Path]) -> None:
    result = call("compare", places["run1"], "--model", places["model"], "--lowpass", 5,
                  "--out", tmp_path / "where")  # fmt: skip
    assert result.exit_code == 0, result.stderr
    content = json.loads((tmp_path / "where" / "comparison.json").read_text(encoding="utf-8"))
    assert content["lowpass"] == 5.0


@pytest.mark.parametrize(("line", "says"), WRONG, ids=[line for line, _ in WRONG])
def test_a_wrong_call_is_one_line_and_writes_nothing(
    line: str, says: str, places: dict[str, Path], tmp_path: Path
) -> None:
    arguments = line.format(**places, new=tmp_path / "new").split()
    before = {p: p.read_bytes() for p in places["folder"].rglob("*") if p.is_file()}
    result = call("compare", *arguments)
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    assert says in result.stderr
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []
    assert {p: p.read_bytes() for p in places["folder"].rglob("*") if p.is_file()} == before
