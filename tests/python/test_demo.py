"""The demo finds what its rig hides, tells it, and leaves what it promises."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from cli_calls import call
from click.testing import Result

import flexspline
from flexspline import demo
from flexspline.demo import BASE, COMPILERS, HELD_OUT, TRAINING, run_exported
from flexspline.exporting import export
from flexspline.model import Model

needs_a_compiler = pytest.mark.skipif(
    os.environ.get("CI") != "true" and not any(map(shutil.which, COMPILERS)),
    reason="no C++ compiler is installed",
)  # in CI it is there, or the test fails


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    out = tmp_path_factory.mktemp("demo") / "story"
    return call("demo", "--out", out), out


def test_the_hidden_effect_is_named_and_added(told: tuple[Result, Path]) -> None:
    result, out = told
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    assert "lacks stribeck_friction" in result.stdout
    effects = [effect.name for effect in Model.load(out / "model.json").part().effects]
    assert effects == [*(effect.name for effect in BASE), "stribeck_friction"]
    assert "\n2. " not in result.stdout.split("4. Ask discover")[1].split("5. Runs")[0]


def test_the_gap_on_unseen_runs_closes_to_the_noise(told: tuple[Result, Path]) -> None:
    _, out = told
    model = Model.load(out / "model.json")
    runs = [out / f"run{k + 1}.csv" for k in range(TRAINING, TRAINING + HELD_OUT)]
    residual = np.concatenate([model.predict(flexspline.read_log(run)).residual for run in runs])
    # the noise that was put in is 0.015 Nm; what is left of presliding and encoders is smaller
    assert 0.0145 < np.sqrt(np.mean(residual**2)) < 0.018


def test_what_it_promises_lies_there(told: tuple[Result, Path]) -> None:
    _, out = told
    runs = {f"run{k + 1}.csv" for k in range(TRAINING + HELD_OUT)}
    left = {"model.json", "report.html", "joint.hpp", "before_after.png"}
    recorded = {"recording.txt", "load.csv", "oven.csv", "warmup.csv"}
    assert {path.name for path in out.iterdir()} == runs | left | recorded
    assert list(out.parent.iterdir()) == [out]
    assert (out / "before_after.png").read_bytes().startswith(b"\x89PNG")


def test_the_model_names_the_runs_where_they_lie(told: tuple[Result, Path]) -> None:
    _, out = told
    record = Model.load(out / "model.json").part().record
    assert [log["history"][0].split(": ")[0] for log in record["logs"]] == [
        f"read {out / f'run{k + 1}.csv'}" for k in range(TRAINING)
    ]


def test_lines_fit_a_screen(told: tuple[Result, Path]) -> None:
    result, out = told
    assert max(len(line.replace(str(out), "demo")) for line in result.stdout.splitlines()) <= 100


@needs_a_compiler
def test_the_exported_header_gives_the_same_numbers(told: tuple[Result, Path]) -> None:
    result, _ = told
    line = next(ln for ln in result.stdout.splitlines() if "largest difference from predict" in ln)
    assert float(line.split()[-2]) <= 1e-12


def test_without_a_compiler_it_says_so(
    told: tuple[Result, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, out = told
    monkeypatch.setattr(demo.shutil, "which", lambda name: None)
    model, run = Model.load(out / "model.json"), flexspline.read_log(out / "run5.csv")
    assert "no C++ compiler" in run_exported(out / "joint.hpp", model, run)


@needs_a_compiler
def test_a_header_that_does_not_compile_is_said_to(
    told: tuple[Result, Path], tmp_path: Path
) -> None:
    _, out = told
    model, run = Model.load(out / "model.json"), flexspline.read_log(out / "run5.csv")
    header = export(model, tmp_path / "joint.hpp")
    header.write_text(header.read_text() + "\n#error no\n")
    assert "does not take it" in run_exported(header, model, run)
