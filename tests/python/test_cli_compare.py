"""`flexspline compare`: what it writes and what it prints."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cli_calls import call, fitted, write_runs

import flexspline
from flexspline.model import Model


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("runs")
    run1, run2 = write_runs(folder)
    return {"run1": run1, "run2": run2, "model": fitted(folder, [run1, run2]) / "model.json"}


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
