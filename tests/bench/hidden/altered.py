"""One number of `discover` replaced for a whole process: to be imported before any other module."""

from __future__ import annotations

import sys
from dataclasses import replace

import flexspline.discovery.settings as settings

__all__ = ["ONE", "TODAY"]

ONE, TODAY = "--one", "today"


def _alter() -> None:
    """Replace the number that the command line names as `--one field=value`, but for `today`."""
    name, value = sys.argv[sys.argv.index(ONE) + 1].split("=")
    if name != TODAY:
        kind = type(getattr(settings.SETTINGS, name))
        settings.SETTINGS = replace(settings.SETTINGS, **{name: kind(float(value))})


if ONE in sys.argv:
    _alter()
