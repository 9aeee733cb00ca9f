"""Every notebook runs from a clean kernel, as a reader would run it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

nbclient = pytest.importorskip("nbclient", reason="pip install '.[test]' to run the notebooks")
nbformat = pytest.importorskip("nbformat", reason="pip install '.[test]' to run the notebooks")

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
SECONDS_PER_CELL = 300


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_a_clean_kernel(
    path: Path, tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    notebook = nbformat.read(path, as_version=4)
    if any("import mujoco" in cell.source for cell in notebook.cells):
        pytest.importorskip("mujoco", reason="pip install mujoco to run its notebook")
    if any("FLEXSPLINE_DATA" in cell.source for cell in notebook.cells):
        data = request.getfixturevalue("data_folder")
        monkeypatch.setenv("FLEXSPLINE_DATA", os.fspath(data.resolve()))
    nbclient.NotebookClient(
        notebook,
        timeout=SECONDS_PER_CELL,
        kernel_name="python3",
        resources={"metadata": {"path": os.fspath(tmp_path)}},
    ).execute()
