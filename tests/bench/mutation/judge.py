"""A pytest plugin: collect all tests once, then let each mutant meet its tests in a forked child.

The child puts the mutated code object into the live function, so that neither libraries nor tests
are imported anew; the files stay as they are. A mutant of what runs at import (a constant, a field,
a default, a decorator) has no such function: `mutants.py` starts a process of its own for it.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import pkgutil
import resource
import time
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

import flexspline
from mutation.covering import Record
from mutation.draw import Mutant, drawn
from mutation.results import Result, add, last_results

LONGER, LONGER_BY = 4.0, 20.0  # times, and s: the processor time that a mutant may take
MEMORY = 8 * 2**30  # bytes
KILLED, NO_FUNCTION = 1, 77  # exit codes of the child


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool:
    """Judge this process's share of the mutants instead of running the tests."""
    for module in pkgutil.walk_packages(flexspline.__path__, "flexspline."):
        if not module.name.endswith("__main__"):  # a function has to be there to be mutated
            importlib.import_module(module.name)
    given = json.loads(os.environ["MUTANTS_TASK"])
    folder = Path(given["folder"])
    seen, old = Record(folder), last_results(folder)
    mutants = drawn([Path(file) for file in given["files"]], given["seed"], given["number"])
    items = {item.nodeid: item for item in session.items}
    for mutant in mutants[given["share"] :: given["jobs"]]:
        result = old.get(mutant.key, Result(mutant.key))
        if result.dead or (given["only"] and given["only"] not in mutant.key):
            continue
        every = [test for test in seen.covering(mutant) if test in items]
        tests, cost = seen.affordable(
            [test for test in every if test not in result.met], given["budget"]
        )
        result.covering = len(every)
        if tests:
            result.seconds += cost
            result.state, result.by = _met(mutant, [items[test] for test in tests], seen, folder)
            result.met += tests if result.state == "survived" else []
        add(folder, result)
    return True


def _met(mutant: Mutant, items: list[pytest.Item], seen: Record, folder: Path) -> tuple[str, str]:
    """What becomes of the mutant (killed, timeout, survived, import), and by which test."""
    at = folder / f"at.{os.getpid()}"
    child = os.fork()
    if not child:
        code = NO_FUNCTION
        try:
            if mutate(mutant):
                code = _run(items, seen, at)
        except BaseException:  # a mutant may raise anything, also out of pytest
            code = KILLED
        os._exit(code)
    status = os.waitpid(child, 0)[1]
    code = os.waitstatus_to_exitcode(status)
    if code == NO_FUNCTION:
        return "import", ""
    by = at.read_text() if at.exists() else ""
    return ("timeout" if code < 0 else "killed" if code else "survived"), by if code else ""


def _run(items: list[pytest.Item], seen: Record, at: Path) -> int:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    session = items[0].session
    for item, following in zip(items, [*items[1:], None], strict=True):
        at.write_text(item.nodeid)
        most = time.process_time() + LONGER * seen.cost(item.nodeid) + LONGER_BY
        resource.setrlimit(resource.RLIMIT_CPU, (int(most), resource.RLIM_INFINITY))
        session.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.testsfailed:
            return KILLED
    return 0


def mutate(mutant: Mutant) -> bool:
    """Put the mutant's code into its live function; False where there is none."""
    place = mutant.function
    if place is None:
        return False
    codes = [c for c in _codes(compile(mutant.mutated, str(mutant.file), "exec")) if _is(c, place)]
    alive: list[Any] = [
        thing
        for thing in gc.get_objects()
        if isinstance(thing, FunctionType)
        and thing.__code__.co_filename == str(mutant.file)
        and _is(thing.__code__, place)
    ]
    for function in alive:
        function.__code__ = codes[0]
    return bool(alive)


def _is(code: CodeType, place: tuple[str, int]) -> bool:
    return (code.co_qualname, code.co_firstlineno) == place


def _codes(code: CodeType) -> list[CodeType]:
    inner = [c for c in code.co_consts if isinstance(c, CodeType)]
    return [*inner, *(deeper for c in inner for deeper in _codes(c))]
