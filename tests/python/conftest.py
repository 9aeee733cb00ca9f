"""Fixtures that all tests share."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

# a process of tests for each processor: threads of BLAS besides would wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import demo_run
import measured
import pytest
from demo_run import Demo
from undrawn import undrawn


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
