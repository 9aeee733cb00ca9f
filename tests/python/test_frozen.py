"""Results, options and logs are values: nothing that is handed out changes behind its back."""

from __future__ import annotations

import builtins
import dataclasses
import importlib
import pkgutil
import sys
from collections.abc import Callable
from typing import get_args, get_origin
from unittest.mock import MagicMock

import numpy as np

import flexspline

WORKING = {"SearchContext", "Searcher", "Cost", "Writing"}  # what remembers while it works


def dataclasses_of_the_package() -> set[type]:
    names = [m.name for m in pkgutil.walk_packages(flexspline.__path__, "flexspline.")]
    return {
        thing
        for name in names
        if not name.endswith("__main__")
        for thing in vars(importlib.import_module(name)).values()
        if isinstance(thing, type) and dataclasses.is_dataclass(thing)
    }


class Names(dict[str, object]):
    """What a module knows; what only type checkers import there is anything."""

    def __missing__(self, name: str) -> object:
        return vars(builtins).get(name, MagicMock())


def holds_arrays(kind: object) -> bool:
    if np.ndarray in (kind, get_origin(kind)):
        return True
    return get_origin(kind) is not Callable and any(map(holds_arrays, get_args(kind)))


def fields_with_arrays(thing: type) -> list[str]:
    compared = {field.name for field in dataclasses.fields(thing) if field.compare}
    return [
        name
        for owner in thing.__mro__
        for name, text in vars(owner).get("__annotations__", {}).items()
        if name in compared
        and holds_arrays(
            eval(text, {}, Names(vars(sys.modules[owner.__module__]), array=MagicMock()))
        )
    ]


def test_every_dataclass_but_those_that_work_is_frozen() -> None:
    loose = {t.__name__ for t in dataclasses_of_the_package() if not t.__dataclass_params__.frozen}
    assert {name for name in loose if not name.startswith("_")} == WORKING


def test_what_holds_arrays_is_compared_by_identity_for_equal_arrays_have_no_truth_value() -> None:
    compared = [t for t in dataclasses_of_the_package() if t.__dataclass_params__.eq]
    found = {t.__qualname__: fields_with_arrays(t) for t in compared}
    assert {name: fields for name, fields in found.items() if fields} == {}
