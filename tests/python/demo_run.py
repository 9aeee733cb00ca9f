"""`flexspline demo`, run once for all processes of tests."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NamedTuple

import pytest
from cli_calls import call

from flexspline.files import atomic_write


class Demo(NamedTuple):
    """What the demo said, and the folder that it wrote, which stays as it is."""

    exit_code: int
    stdout: str
    stderr: str
    out: Path


def once(folders: pytest.TempPathFactory) -> Demo:
    """Run it, or return what another process of these tests has of it.

    Where two begin at the same time both run it, and either is right.
    """
    own = folders.getbasetemp()
    kept = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "demo.json"
    if not kept.exists():
        out = folders.mktemp("demo") / "story"
        said = call("demo", "--out", out)
        atomic_write(kept, json.dumps([said.exit_code, said.stdout, said.stderr, str(out)]))
    exit_code, stdout, stderr, place = json.loads(kept.read_text(encoding="utf-8"))
    return Demo(exit_code, stdout, stderr, Path(place))
