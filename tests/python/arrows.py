"""The graph of who imports whom, drawn from the code, and what is wrong with it.

An arrow is any import, wherever it stands: at the top of a module, inside a function, for types
alone, by name (`import_module`), or by a string that names a module of ours, as in the tables
`_HOME` and `RENDERERS`. `from flexspline import x` is an arrow to the package's top, unless x is a
module; so is `import flexspline.x`, whose name is the top's. What cannot be told before the program
runs is no better than an arrow up.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

TOP = "flexspline"
OURS = re.compile(r"flexspline(\.\w+)+")
UNKNOWN = "?"


class Arrow(NamedTuple):
    """A module, the line at which it names another one, and that one or `UNKNOWN`."""

    module: str
    line: int
    target: str


def modules_of(package: Path) -> dict[str, Path]:
    """Every module by its dotted name; the compiled core by its stub."""
    found = {}
    for file in [*sorted(package.rglob("*.py")), *package.glob("_core.pyi")]:
        parts = file.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@cache
def nodes_of(code: str) -> tuple[ast.AST, ...]:
    """All nodes of a module's code, which several tests look at."""
    return tuple(ast.walk(ast.parse(code)))


def arrows_of(modules: dict[str, Path]) -> list[Arrow]:
    """Every arrow between modules, each once."""
    found = {}
    for module, file in modules.items():
        nodes = nodes_of(file.read_text(encoding="utf-8"))
        inside = module if file.stem == "__init__" else module.rpartition(".")[0]
        for line, name in _named(nodes, module, inside, modules):
            while name and name != UNKNOWN and name not in modules:
                name = name.rpartition(".")[0]  # of a name in a module, the module
            if name and name != module:
                found[Arrow(module, line, name)] = None
    return list(found)


def _named(
    nodes: tuple[ast.AST, ...], module: str, inside: str, modules: dict[str, Path]
) -> Iterator[tuple[int, str]]:
    """Line and dotted name of all that a module of the package `inside` asks for."""
    known = {"__name__": module, "__package__": inside}
    prose = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
            yield from ((node.lineno, a.name.split(".")[0]) for a in node.names if not a.asname)
        elif isinstance(node, ast.ImportFrom):
            base = _resolved("." * node.level + (node.module or ""), inside)
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)
        elif isinstance(node, (ast.Constant, ast.JoinedStr)) and id(node) not in prose:
            name = _said(node, known).rstrip(".:").replace(":", ".")
            first = ".".join(name.split(".")[:2])
            if OURS.fullmatch(name) and first in modules:  # no file such as flexspline.hpp
                yield node.lineno, name
        elif isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if called in ("import_module", "__import__"):
                yield node.lineno, _asked(node, known)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)) and _of_homes(node):
            homes = node.value.values if isinstance(node.value, ast.Dict) else []
            yield from ((home.lineno, f"{inside}.{_said(home, known)}") for home in homes)


def _resolved(name: str, inside: str) -> str:
    """A name with leading dots, as a module of the package `inside` means it."""
    dots = len(name) - len(name.lstrip("."))
    above = inside.split(".")[: inside.count(".") + 2 - dots] if dots else []
    return ".".join([*above, *filter(None, [name[dots:]])])


def _asked(call: ast.Call, known: dict[str, str]) -> str:
    """What `import_module` gets, as far as it is known before the program runs."""
    given = dict(zip(("name", "package"), call.args, strict=False))
    given |= {word.arg: word.value for word in call.keywords if word.arg}
    name = _said(given.get("name"), known)
    if "package" in given and name.startswith("."):
        package = _said(given["package"], known)
        return _resolved(name, package) if package else UNKNOWN
    return _resolved(name, known["__package__"]) if name else UNKNOWN


def _of_homes(node: ast.Assign | ast.AnnAssign) -> bool:
    names = node.targets if isinstance(node, ast.Assign) else [node.target]
    return any(isinstance(name, ast.Name) and name.id == "_HOME" for name in names)


def _said(text: ast.expr | None, known: dict[str, str]) -> str:
    """A string as far as it is known before the program runs."""
    said = ""
    for part in _parts(text):
        if isinstance(part, ast.Constant):
            said += str(part.value)
        elif isinstance(part, ast.Name) and part.id in known:
            said += known[part.id]
        else:
            break
    return said


def _parts(text: ast.expr | None) -> Iterator[ast.expr | None]:
    if isinstance(text, ast.JoinedStr):
        for part in text.values:
            yield from _parts(part)
    elif isinstance(text, ast.FormattedValue):
        yield from _parts(text.value)
    elif isinstance(text, ast.BinOp) and isinstance(text.op, ast.Add):
        yield from _parts(text.left)
        yield from _parts(text.right)
    else:
        yield text


def room_of(module: str, rooms: dict[str, int]) -> str | None:
    """The innermost room in which a module lies."""
    name = module.partition(".")[2]
    inner = [room for room in rooms if name and room.startswith(f"{name}.")]
    if inner:  # an `__init__` that brings together what inner rooms have
        return max([*inner, *({name} & rooms.keys())], key=rooms.__getitem__)
    while name and name not in rooms:
        name = name.rpartition(".")[0]
    return name if name or module == TOP else None


def faults_of(
    package: Path, layers: tuple[tuple[str, ...], ...], by_table: tuple[str, ...] = ()
) -> list[str]:
    """A sentence for each arrow that does not point down, and for each room without a layer."""
    rooms = {room: height for height, row in enumerate(layers) for room in row}
    modules = modules_of(package)
    arrows = arrows_of(modules)
    lying = {module: room_of(module, rooms) for module in modules}
    said = [f"{m} has no layer: put it into LAYERS" for m, room in lying.items() if room is None]
    said += [f"LAYERS has '{room}', which is no more" for room in rooms.keys() - lying.values()]
    asking = {arrow.module for arrow in arrows if arrow.target == UNKNOWN}
    said += [f"BY_TABLE has {m}, which asks for no module of a table" for m in {*by_table} - asking]
    for arrow in arrows:
        where = f"{modules[arrow.module].relative_to(package).as_posix()}:{arrow.line} imports"
        if arrow.target == UNKNOWN:
            if arrow.module not in by_table:
                said.append(
                    f"{where} what nobody can tell before the program runs: name the module"
                )
            continue
        here, there = lying[arrow.module], lying[arrow.target]
        if here is None or there is None or here == there or rooms[there] < rooms[here]:
            continue
        side = "a neighbour" if rooms[there] == rooms[here] else "above it"
        said.append(
            f"{where} {arrow.target}, {side}: "
            "move what it needs down, pass it as an argument, or register it from above"
        )
    return said


def cycles_of(package: Path) -> list[str]:
    """A sentence for each arrow between sub-packages, or modules beside them, that form a cycle."""
    modules = modules_of(package)
    between = {
        arrow: (_part(arrow.module), _part(arrow.target))
        for arrow in arrows_of(modules)
        if arrow.target != UNKNOWN and _part(arrow.module) != _part(arrow.target)
    }
    needs: dict[str, set[str]] = {}
    for here, there in between.values():
        needs.setdefault(here, set()).add(there)
    return [
        f"{modules[arrow.module].relative_to(package).as_posix()}:{arrow.line} imports "
        f"{arrow.target}, which leads back to '{here}'"
        for arrow, (here, there) in between.items()
        if here in _reached(there, needs)
    ]


def _reached(start: str, needs: dict[str, set[str]]) -> set[str]:
    found, left = {start}, [start]
    while left:
        new = needs.get(left.pop(), set()) - found
        found |= new
        left += new
    return found


def _part(module: str) -> str:
    """The sub-package in which a module lies, or the module beside them; "" for the top."""
    return [*module.split("."), ""][1]
