"""Texts that people read against those that are kept, word for word, and numbers within bounds."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

GOLDEN = Path(__file__).parents[1] / "golden"
NUMBER = re.compile(r"(?<![\w.])[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def is_as_kept(text: str, name: str) -> None:
    """The text is that of a golden file, which FLEXSPLINE_REWRITE_GOLDEN=1 writes again."""
    file = GOLDEN / name
    if os.environ.get("FLEXSPLINE_REWRITE_GOLDEN"):
        file.write_text(text, encoding="utf-8")
    kept = file.read_text(encoding="utf-8")
    assert NUMBER.sub("#", text).split() == NUMBER.sub("#", kept).split()
    for found, expected in zip(NUMBER.findall(text), NUMBER.findall(kept), strict=True):
        both = [float(n.replace("−", "-")) for n in (found, expected)]
        # rounding of the last printed digit, and solvers that end a little apart
        assert both[0] == pytest.approx(both[1], rel=0.02, abs=2e-3)
