"""Every notebook runs from a clean kernel, as a reader would run it, and its sentences are true.

What `missing_effect_measured` discovers takes minutes: `test_discover_measured` runs that one, and
holds its names to what an expert says.
"""

from __future__ import annotations

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


def test_claims_are_those_of_notebooks() -> None:
    own = {"missing_effect_measured", "mujoco_pendulum"}
    assert set(CLAIMS) | own == set(notebook_runs.NAMES) and not set(CLAIMS) & own
