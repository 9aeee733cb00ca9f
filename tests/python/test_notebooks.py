"""Every notebook runs from a clean kernel, as a reader would run it.

What `missing_effect_measured` discovers takes minutes: `test_discover_measured` runs that one, and
holds its names to what an expert says.
"""

from __future__ import annotations

from pathlib import Path

import notebook_runs
import pytest


@pytest.mark.parametrize(
    "name", [name for name in notebook_runs.NAMES if name != "missing_effect_measured"]
)
def test_a_notebook_runs_from_a_clean_kernel(
    name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if notebook_runs.reads_measured_logs(name):
        request.getfixturevalue("data_folder")
    notebook_runs.run(name, tmp_path)
