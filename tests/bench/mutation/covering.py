"""Which tests execute the lines of a mutant, and what they cost: read from what `record` wrote."""

from __future__ import annotations

import ast
import json
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from mutation.draw import Mutant

DEARER_TOGETHER = 0.2  # s; a test file whose tests share more stays together


class Record:
    """Tests, what they use (see `record`) and the lines that these execute."""

    def __init__(self, folder: Path) -> None:
        self.seconds: dict[str, float] = {}
        self.uses: dict[str, set[str]] = defaultdict(set)
        self.passed: set[str] = set()
        self.lines: dict[Path, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
        self.counts: dict[str, Counter[Path]] = defaultdict(Counter)
        for file in sorted(folder.glob("**/tests.*.jsonl")):
            for unit in map(json.loads, file.read_text().splitlines()):
                self.seconds[unit["unit"]] = unit["seconds"]
                self.uses[unit["unit"]] |= set(unit["uses"])
                if unit["outcome"] == "passed":
                    self.passed.add(unit["unit"])
        for file in sorted(folder.glob("**/lines.*.json")):
            for module, lines in json.loads(file.read_text()).items():
                self._add(Path(module), lines)
        self.closure = cache(self._closure)
        self.users: dict[str, set[str]] = defaultdict(set)
        for test in self.passed:
            for name in self.closure(test):
                self.users[name].add(test)

    def _add(self, module: Path, lines: dict[str, list[str]]) -> None:
        for line, units in lines.items():
            for name in set(units) - {"", "import"}:
                self.lines[module][int(line)].add(name)
                self.counts[name][module] += 1

    def _closure(self, unit: str) -> frozenset[str]:
        found, waiting = {unit}, [unit]
        while waiting:
            new = self.uses[waiting.pop()] - found
            found |= new
            waiting.extend(new)
        return frozenset(found)

    def cost(self, test: str) -> float:
        return sum(self.seconds.get(unit, 0.0) for unit in self.closure(test))

    def nearness(self, test: str, file: Path) -> float:
        """Share of the lines that a test executes, which are in this file."""
        own = sum((self.counts[unit] for unit in self.closure(test)), Counter[Path]())
        return own[file] / max(own.total(), 1)

    def covering(self, mutant: Mutant) -> list[str]:
        """Tests that execute the mutant: first those that are cheap and busy with its file."""
        units: set[str] = set()
        for file, first, last in places(mutant, tuple(self.lines)):
            for line in range(first, last + 1):
                units |= self.lines[file].get(line, set())
        tests = {test for unit in units for test in self.users[unit]}
        near = {test: max(self.nearness(test, mutant.file), 1e-3) for test in tests}
        return sorted(tests, key=lambda test: ((self.cost(test) + 0.02) / near[test], test))

    def affordable(self, tests: list[str], budget: float) -> tuple[list[str], float]:
        """The first of these tests that cost no more than the budget together, and their cost."""
        paid: set[str] = set()
        spent, chosen = 0.0, []
        for test in tests:
            more = sum(self.seconds.get(unit, 0.0) for unit in self.closure(test) - paid)
            if spent + more <= budget or not chosen:
                spent += more
                paid |= self.closure(test)
                chosen.append(test)
        return self._together(chosen), spent

    def _together(self, tests: list[str]) -> list[str]:
        """Put tests of a file that share what is dear one after the other."""

        def group(test: str) -> str:
            shared = self.cost(test) - self.seconds.get(test, 0.0)
            return test.split("::")[0] if shared > DEARER_TOGETHER else test

        place: dict[str, int] = {}
        for at, test in enumerate(tests):
            place.setdefault(group(test), at)
        return sorted(tests, key=lambda test: place[group(test)])


def places(mutant: Mutant, files: tuple[Path, ...]) -> Iterator[tuple[Path, int, int]]:
    """Yield (file, first line, last line) of what is executed differently.

    In a function these are the lines of the mutant's statement; of a default of an argument, the
    whole function. Other statements run at import: a constant shows where its name is read, a
    field or decorator where its class or function does.
    """
    statement = mutant.scope[-1]
    functions = [s for s in mutant.scope if isinstance(s, ast.FunctionDef)]
    if functions:
        inside = statement is not functions[-1]
        yield mutant.file, statement.lineno, _last_of(statement, with_block=not inside)
        return
    names = set()
    for outer in mutant.scope:
        if isinstance(outer, ast.ClassDef):
            names.add(outer.name)
            yield mutant.file, outer.lineno, _last_of(outer, with_block=True)
        elif isinstance(outer, (ast.Assign, ast.AnnAssign)):
            target = outer.targets[0] if isinstance(outer, ast.Assign) else outer.target
            names.add(ast.unparse(target))
    for file in {*files, mutant.file}:
        for name in names:
            yield from ((file, line, line) for line in _reads(file).get(name, ()))


def _last_of(statement: ast.stmt, with_block: bool) -> int:
    """The last line of a statement, with the block below it or without."""
    block = getattr(statement, "body", None)
    if isinstance(block, list) and not with_block:
        return max(statement.lineno, block[0].lineno - 1)
    return statement.end_lineno or statement.lineno


@cache
def _reads(file: Path) -> dict[str, set[int]]:
    """The lines of a file that read each name, plain or as an attribute."""
    lines: dict[str, set[int]] = defaultdict(set)
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            lines[node.id].add(node.lineno)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
            lines[node.attr].add(node.lineno)
    return lines
