"""Notebooks run from a clean kernel. Not part of the package."""

from __future__ import annotations

import os
from pathlib import Path

import measured
import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
NAMES = sorted(path.stem for path in FOLDER.glob("*.ipynb"))
SECONDS_PER_CELL = 300
MISSING = "pip install '.[test]' to run the notebooks"


def run(name: str, folder: Path, last_cell: str | None = None) -> None:
    """Run a notebook in a folder, and one more cell at its end; a cell that fails fails the test.

    The test is skipped where nothing runs notebooks, or where an optional package is not there.
    """
    nbclient = pytest.importorskip("nbclient", reason=MISSING)
    nbformat = pytest.importorskip("nbformat", reason=MISSING)
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    if any("import mujoco" in cell.source for cell in notebook.cells):
        newest = any("dcmotor" in cell.source for cell in notebook.cells)
        pytest.importorskip(
            "mujoco",
            minversion="4" if newest else None,
            reason="pip install mujoco to run its notebook",
        )
    if any("from distributed" in cell.source for cell in notebook.cells):
        pytest.importorskip("distributed", reason="pip install '.[fleet]' to run its notebook")
    if last_cell is not None:
        notebook.cells.append(nbformat.v4.new_code_cell(last_cell))
    nbclient.NotebookClient(
        notebook,
        timeout=SECONDS_PER_CELL,
        kernel_name="python3",
        resources={"metadata": {"path": os.fspath(folder)}},
    ).execute(env={**os.environ, "FLEXSPLINE_DATA": os.fspath(measured.data_folder().resolve())})


def reads_measured_logs(name: str) -> bool:
    return "FLEXSPLINE_DATA" in (FOLDER / f"{name}.ipynb").read_text(encoding="utf-8")
