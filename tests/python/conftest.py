"""Fixtures that all tests share."""

from __future__ import annotations

import os
from pathlib import Path

# a process of tests for each processor: threads of BLAS besides would wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import measured
import pytest


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


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Let CI fail where a test was skipped: it has all extras, tools and logs."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") != "true" or reporter is None:
        return
    for report in reporter.stats.get("skipped", []):
        reporter.write_line(f"\nskipped in CI, which has all: {report.nodeid}", red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
