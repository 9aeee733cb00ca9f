"""Chromium, by which pages are opened and measured."""

from __future__ import annotations

import os
import shutil

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu")


def browser() -> str:
    """Return Chromium's path; without one a test is skipped, but never in CI."""
    for name in NAMES:
        if found := shutil.which(name):
            return found
    sentence = "no Chromium is installed, by which pages are opened and measured"
    if os.environ.get("CI") == "true":
        pytest.fail(sentence)
    pytest.skip(sentence)
