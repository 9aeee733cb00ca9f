"""A pytest plugin: which lines of the package each test executes, and what each test costs.

Fixtures wider than one test and functions under `functools.cache` run once for many tests; lines
that they execute are theirs, and every test that uses them is a user of these lines. So each of
them has a context of its own, and who uses whom is written down next to the durations:

    <folder>/lines.<worker>.json   {file: {line: [units]}}, written at the end
    <folder>/tests.<worker>.jsonl  {"unit", "outcome", "seconds", "uses"}, a line for each unit

A unit is a test's node id, `fixture:…`, `cache:…` or `module:…` (what a test file does at import).
`seconds` are of processor time, children included, without those of the units that it uses: other
work on the machine does not count.
"""

from __future__ import annotations

import functools
import importlib
import json
import os
import pkgutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import coverage
import pytest

TASK = json.loads(os.environ["MUTANTS_TASK"])
FOLDER = Path(TASK["folder"])
WORKER = os.environ.get("PYTEST_XDIST_WORKER", "main")
WIDE = ("session", "package", "module", "class")

_lines = coverage.Coverage(
    data_file=str(FOLDER / f"lines.{WORKER}.sqlite"),
    include=TASK["files"],
    config_file=False,
)
_stack: list[dict[str, Any]] = []


def processor_seconds() -> float:
    return sum(os.times()[:4])


def note(unit: dict[str, Any]) -> None:
    with (FOLDER / f"tests.{WORKER}.jsonl").open("a") as file:
        file.write(json.dumps({**unit, "uses": sorted(unit["uses"])}) + "\n")


def use(name: str) -> None:
    if _stack:
        _stack[-1]["uses"].add(name)


@contextmanager
def running(name: str) -> Iterator[dict[str, Any]]:
    """Count lines and seconds as those of the unit `name` while the block runs."""
    use(name)
    unit: dict[str, Any] = {"unit": name, "outcome": "", "seconds": 0.0, "uses": set()}
    start = processor_seconds()
    _stack.append(unit)
    _lines.switch_context(name)
    try:
        yield unit
    finally:
        _stack.pop()
        spent = processor_seconds() - start
        unit["seconds"] += spent
        if _stack:
            _stack[-1]["seconds"] -= spent
        _lines.switch_context(_stack[-1]["unit"] if _stack else "")
        note(unit)


def recorded_cache(function: Callable[..., Any]) -> Callable[..., Any]:
    """Cache as `functools.cache` does, with each entry a unit of its own."""

    def make(*args: Any, **options: Any) -> Any:
        with running(name(args, options)):
            return function(*args, **options)

    def name(args: Any, options: Any) -> str:
        return f"cache:{function.__module__}.{function.__qualname__}{args!r:.150}{options!r:.50}"

    cached = functools.lru_cache(maxsize=None)(make)

    @functools.wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        use(name(args, options))
        return cached(*args, **options)

    call.cache_clear = cached.cache_clear  # type: ignore[attr-defined]
    return call


def pytest_configure(config: pytest.Config) -> None:
    if WORKER == "main" and config.getoption("numprocesses", None):
        return  # the workers run the tests
    _lines.start()
    _lines.switch_context("import")
    package = importlib.import_module("flexspline")
    for module in pkgutil.walk_packages(package.__path__, "flexspline."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    functools.cache = recorded_cache  # type: ignore[assignment]
    _lines.switch_context("")


def pytest_unconfigure() -> None:
    if coverage.Coverage.current() is not _lines:
        return
    _lines.stop()
    data = _lines.get_data()
    by_file = {file: data.contexts_by_lineno(file) for file in data.measured_files()}
    (FOLDER / f"lines.{WORKER}.json").write_text(json.dumps(by_file))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    if not isinstance(collector, pytest.Module):
        return (yield)
    with running(f"module:{collector.nodeid}"):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any, request: Any) -> Iterator[None]:
    if fixturedef.scope not in WIDE:
        return (yield)
    with running(fixture(fixturedef, request.param_index if hasattr(request, "param") else 0)):
        return (yield)


def fixture(definition: Any, index: int) -> str:
    return f"fixture:{definition.baseid}::{definition.argname}[{index}]"


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Function) -> Iterator[None]:
    with running(item.nodeid) as unit:
        item.stash[UNIT] = unit
        use(f"module:{item.nodeid.split('::')[0]}")
        places = getattr(getattr(item, "callspec", None), "indices", {})
        for definitions in item._fixtureinfo.name2fixturedefs.values():
            if definitions[-1].scope in WIDE:
                use(fixture(definitions[-1], places.get(definitions[-1].argname, 0)))
        return (yield)


UNIT = pytest.StashKey[dict[str, Any]]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report: pytest.TestReport = yield  # type: ignore[assignment]
    unit = item.stash[UNIT]
    if report.when == "call" or report.outcome != "passed":
        unit["outcome"] = report.outcome
    return report
