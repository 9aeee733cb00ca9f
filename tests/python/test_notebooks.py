"""Every notebook runs from a clean kernel, as a reader would run it, and its sentences are true.

What `missing_effect_measured` discovers takes minutes: `test_discover_measured` runs that one, and
holds its names to what an expert says.
"""

from __future__ import annotations

import json
from pathlib import Path

import notebook_runs
import pytest
from notebook_claims import CLAIMS


@pytest.mark.parametrize(
    "name", [name for name in notebook_runs.NAMES if name != "missing_effect_measured"]
)
def test_a_notebook_runs_from_a_clean_kernel(
    name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if notebook_runs.reads_measured_logs(name):
        request.getfixturevalue("data_folder")
    notebook_runs.run(name, tmp_path, CLAIMS.get(name))


def test_an_own_effect_takes_less_than_thirty_lines_of_python() -> None:
    notebook = json.loads((notebook_runs.FOLDER / "own_effect.ipynb").read_text(encoding="utf-8"))
    cells = [cell["source"] for cell in notebook["cells"] if cell["cell_type"] == "code"]
    lines = [line for cell in cells if not cell[0].startswith("%%writefile") for line in cell]
    assert 15 < sum(bool(line.strip()) for line in lines) < 30


def test_claims_are_those_of_notebooks() -> None:
    own = {"missing_effect_measured", "mujoco_pendulum"}
    assert set(CLAIMS) | own == set(notebook_runs.NAMES) and not set(CLAIMS) & own
