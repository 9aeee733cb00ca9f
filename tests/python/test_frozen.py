"""Results, options and logs are values: nothing that is handed out changes behind its back."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil

import flexspline

WORKING = {"SearchContext", "Searcher", "Cost", "Writing"}  # what remembers while it works


def test_every_dataclass_but_those_that_work_is_frozen() -> None:
    names = [m.name for m in pkgutil.walk_packages(flexspline.__path__, "flexspline.")]
    things = [
        thing
        for name in names
        if not name.endswith("__main__")
        for thing in vars(importlib.import_module(name)).values()
        if isinstance(thing, type) and dataclasses.is_dataclass(thing)
    ]
    loose = {t.__name__ for t in things if not t.__dataclass_params__.frozen}
    assert {name for name in loose if not name.startswith("_")} == WORKING
