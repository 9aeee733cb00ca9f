"""Fixtures that all tests share."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

# a process of tests for each processor: threads of BLAS besides would wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import demo_run
import measured
import pytest
from demo_run import Demo
from mujoco_plugins import Loaded, loader
from undrawn import undrawn

from flexspline.errors import InputError
from flexspline.model import Model

LONG = (
    "test_notebooks.py",
    "test_discover_measured.py",
    "test_discovery_evidence.py",
    "test_discovery_confirmation.py",
    "test_track.py",
    "test_readme.py",
    "test_simulated_lab_logs.py",
    "test_discovery_clock.py",
    "test_site.py",
    "test_discovery.py",
    "test_uncertainty.py",
    "test_track_together.py",
    "test_missing_effect_zhang.py",
    "test_certificate.py",
    "test_foreign_simulation.py",
    "test_missing_effect_full_range.py",
    "test_bad_day.py",
    "test_calibration_thermal.py",
    "test_discovery_friction.py",
    "test_comparison.py",
    "test_discover_injected.py",
    "test_discovery_long.py",
    "test_track_fleet.py",
    "test_header_program.py",
    "test_chain_program.py",
    "test_discovery_waves.py",
    "test_calibration_zeros.py",
    "test_cli_fit.py",
    "test_block_program.py",
    "test_cli_check.py",
    "test_checks_spikes.py",
    "test_device_cost.py",
    "test_discovery_report.py",
    "test_discovery_largest.py",
    "test_adaptation_program.py",
    "test_hidden_in_sensor.py",
    "test_calibration_fit.py",
    "test_export_fmu.py",
    "test_report_html.py",
    "test_discovery_search.py",
)
"""Files that take 12 s of processor time or more, the longest first."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files: the short ones at the end keep all processes busy alike."""
    places = {name: place for place, name in enumerate(LONG)}
    items.sort(key=lambda item: places.get(item.path.name, len(LONG)))


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of the measured logs; without it a test is skipped, but never in CI."""
    folder = measured.data_folder()
    if not folder.is_dir():
        sentence = f"the measured logs are not at {folder}; set FLEXSPLINE_DATA to their folder"
        if os.environ.get("CI") == "true":
            pytest.fail(sentence)
        pytest.skip(sentence)
    return folder


@pytest.fixture(name="undrawn")
def _undrawn() -> Iterator[None]:
    """No figure of a report is drawn, see `undrawn.py`."""
    with undrawn():
        yield


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    return demo_run.once(tmp_path_factory)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Let CI fail where a test was skipped: it has all extras, tools and logs."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") != "true" or reporter is None:
        return
    for report in reporter.stats.get("skipped", []):
        reporter.write_line(f"\nskipped in CI, which has all: {report.nodeid}", red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.fixture(scope="session")
def mujoco() -> Any:
    return pytest.importorskip("mujoco", reason="mujoco is missing; install flexspline[mujoco]")


@pytest.fixture(scope="module")
def loaded(mujoco: Any, tmp_path_factory: pytest.TempPathFactory) -> Loaded:
    """What compiles and loads the MuJoCo plugin of a model."""
    return loader(mujoco, tmp_path_factory.mktemp("plugins"))


@pytest.fixture
def refused_model(tmp_path: Path) -> Callable[[str], str]:
    """What says why a model.json of this text is refused; it begins with the file."""

    def why(text: str) -> str:
        path = tmp_path / "joint.json"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError) as caught:
            Model.load(path)
        assert str(caught.value).startswith(f"{path}: ")
        return str(caught.value)

    return why


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The working folder is another: MuJoCo writes its warnings into MUJOCO_LOG.TXT there."""
    monkeypatch.chdir(tmp_path)
