"""Who may import whom: the rooms of the package in layers, and every arrow points down.

An arrow is any import, wherever it stands: at the top of a module, inside a function, for types
alone, by name (`import_module`), or by a string that names a module of ours, as in the tables
`_HOME` and `RENDERERS`. `from flexspline import x` is an arrow to the package's top, unless x is a
module.
"""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import flexspline
from flexspline.presentation import RENDERERS

LAYERS = (
    # what knows nothing of joints
    ("_core", "about", "errors", "parallel", "plain", "rendering"),
    ("files", "formatting", "schema"),
    # runs, and what they show by themselves; logs know no effects, their checks do
    ("effects", "logs"),
    ("logs.checks",),
    ("orders", "prepared", "signals"),
    ("requirements", "simulator"),
    # a model of a joint, and what it is made of
    ("part",),
    ("estimators", "model_warnings"),
    ("model",),
    ("forward",),
    # least squares
    ("least_squares",),
    ("regression",),
    ("fitting",),
    ("output_error",),
    # what is asked of runs
    ("calibration", "comparison", "experiment"),
    ("deprecated", "discovery"),
    # the chain of estimators, and the joint and the sensor that it is tried on
    ("estimation", "observer", "sensor", "simulation"),
    ("collision", "full_range"),
    ("exporting",),
    ("certification",),
    # how results are shown
    ("plot",),
    ("report",),
    ("presentation",),
    # papers and their rigs
    ("rigs",),
    ("baselines", "demo_device"),
    ("demo", "reproduce"),
    ("cli",),
    ("",),  # flexspline/__init__.py
)
"""Rooms, which are sub-packages and modules of the package, the lowest first. A room imports from
rows above its own in this table, not from its neighbours. Where a room lies in another one, the
`__init__` of the outer belongs to the higher of both."""

TOP = "flexspline"
PACKAGE = Path(flexspline.__file__).parent
OURS = re.compile(r"flexspline(\.\w+)+(:\w+)?")


class Arrow(NamedTuple):
    """A module, the line at which it names another one, and that one."""

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


def arrows_of(modules: dict[str, Path]) -> list[Arrow]:
    """Every arrow between modules, each once."""
    found = {}
    for module, file in modules.items():
        tree = ast.parse(file.read_text(encoding="utf-8"))
        inside = module if file.stem == "__init__" else module.rpartition(".")[0]
        for line, name in _named(tree, module, inside, modules):
            while name and name not in modules:  # of a name in a module, the module
                name = name.rpartition(".")[0]
            if name and name != module:
                found[Arrow(module, line, name)] = None
    return list(found)


def _named(
    tree: ast.Module, module: str, inside: str, modules: dict[str, Path]
) -> Iterator[tuple[int, str]]:
    """Line and dotted name of all that a module of the package `inside` asks for."""
    prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = inside.split(".")[: inside.count(".") + 2 - node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) not in prose and OURS.fullmatch(node.value):
                name = node.value.replace(":", ".")
                if ".".join(name.split(".")[:2]) in modules:  # no file such as flexspline.hpp
                    yield node.lineno, name
        elif isinstance(node, ast.Call) and node.args:
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if called in ("import_module", "__import__"):
                name = _said(node.args[0], module)
                yield node.lineno, inside + name if name.startswith(".") else name
        elif isinstance(node, (ast.Assign, ast.AnnAssign)) and _of_homes(node):
            homes = node.value.values if isinstance(node.value, ast.Dict) else []
            yield from ((home.lineno, f"{inside}.{_said(home, module)}") for home in homes)


def _of_homes(node: ast.Assign | ast.AnnAssign) -> bool:
    names = node.targets if isinstance(node, ast.Assign) else [node.target]
    return any(isinstance(name, ast.Name) and name.id == "_HOME" for name in names)


def _said(text: ast.expr, module: str) -> str:
    """A string as far as it is known before the program runs."""
    known = ""
    for part in text.values if isinstance(text, ast.JoinedStr) else [text]:
        if isinstance(part, ast.Constant):
            known += str(part.value)
        elif isinstance(part, ast.FormattedValue) and ast.unparse(part.value) == "__name__":
            known += module
        else:
            break
    return known


def room_of(module: str, rooms: dict[str, int]) -> str | None:
    """The innermost room in which a module lies."""
    name = module.partition(".")[2]
    inner = [room for room in rooms if name and room.startswith(f"{name}.")]
    if inner:  # an `__init__` that brings together what inner rooms have
        return max([*inner, *({name} & rooms.keys())], key=rooms.__getitem__)
    while name and name not in rooms:
        name = name.rpartition(".")[0]
    return name if name or module == TOP else None


def faults_of(package: Path, layers: tuple[tuple[str, ...], ...]) -> list[str]:
    """A sentence for each arrow that does not point down, and for each room without a layer."""
    rooms = {room: height for height, row in enumerate(layers) for room in row}
    modules = modules_of(package)
    lying = {module: room_of(module, rooms) for module in modules}
    said = [f"{m} has no layer: put it into LAYERS" for m, room in lying.items() if room is None]
    said += [f"LAYERS has '{room}', which is no more" for room in rooms.keys() - lying.values()]
    for module, line, target in arrows_of(modules):
        here, there = lying[module], lying[target]
        if here is None or there is None or here == there or rooms[there] < rooms[here]:
            continue
        side = "a neighbour" if rooms[there] == rooms[here] else "above it"
        said.append(
            f"{modules[module].relative_to(package).as_posix()}:{line} imports {target}, {side}: "
            "move what it needs down, pass it as an argument, or register it from above"
        )
    return said


def test_every_arrow_points_down() -> None:
    assert faults_of(PACKAGE, LAYERS) == []


def test_rooms_form_no_cycle() -> None:
    """Whatever the order of the layers: what imports nothing that is left goes, until all are."""
    rooms = {room: height for height, row in enumerate(LAYERS) for room in row}
    left: dict[str | None, set[str | None]] = {room: set() for room in rooms}
    for module, _, target in arrows_of(modules_of(PACKAGE)):
        here, there = room_of(module, rooms), room_of(target, rooms)
        left[here] |= {there} - {here}
    while free := [room for room, needs in left.items() if not needs & left.keys()]:
        for room in free:
            del left[room]
    assert not left


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    """A package of two rooms and their neighbours, in which every arrow points down."""
    package = tmp_path / "flexspline"
    for room in ("low", "beside", "high"):
        (package / room).mkdir(parents=True)
        (package / room / "__init__.py").write_text("")
    (package / "__init__.py").write_text('_HOME = {"thing": "high.deep"}\n')
    (package / "high" / "deep.py").write_text("from flexspline.low.fine import thing\n")
    (package / "low" / "fine.py").write_text('"""Of flexspline.high.deep."""\n"flexspline.high"\n')
    assert faults_of(package, PLANTED_LAYERS) == []
    return package


PLANTED_LAYERS = (("low", "beside"), ("high",), ("",))
PLANTED = {
    "at the top": "from flexspline.high.deep import thing",
    "of a module": "from flexspline.high import deep",
    "of a module, whole": "import flexspline.high.deep as deep",
    "with dots": "from ..high import deep",
    "in a function": "def late():\n    from flexspline.high.deep import thing",
    "for types alone": "if TYPE_CHECKING:\n    from flexspline.high.deep import Thing",
    "by a name": 'importlib.import_module("flexspline.high.deep")',
    "by a name put together": 'import_module(f"flexspline.high.{name}")',
    "in a table": 'RENDERERS = {"thing": "flexspline.high.deep:thing"}',
    "of the top": "from flexspline import thing",
    "of the top, whole": "import flexspline",
    "of the top by a name": '__import__("flexspline")',
    "of a neighbour": "from flexspline.beside import thing",
}


@pytest.mark.parametrize("kind", PLANTED)
def test_a_planted_arrow_is_found_with_its_line(kind: str, planted: Path) -> None:
    (planted / "low" / "bad.py").write_text(f"import ast\n{PLANTED[kind]}\n")
    (fault,) = faults_of(planted, PLANTED_LAYERS)
    line = 3 if "\n" in PLANTED[kind] else 2
    assert fault.startswith(f"low/bad.py:{line} imports flexspline")


def test_names_of_a_table_of_homes_are_arrows(planted: Path) -> None:
    (fault,) = faults_of(planted, (("",), ("low", "beside"), ("high",)))
    assert fault.startswith("__init__.py:1 imports flexspline.high.deep, above it")


def test_the_init_around_an_inner_room_lies_as_high_as_that(planted: Path) -> None:
    (planted / "low" / "inner.py").write_text("from flexspline.beside import thing\n")
    (planted / "low" / "__init__.py").write_text("from flexspline.low.inner import thing\n")
    layers = (("low",), ("beside",), ("low.inner",), ("high",), ("",))
    assert faults_of(planted, layers) == []
    (planted / "beside" / "bad.py").write_text("from flexspline.low import thing\n")
    (fault,) = faults_of(planted, layers)
    assert fault.startswith("beside/bad.py:1 imports flexspline.low, above it")


def test_a_room_that_has_no_layer_and_one_that_is_no_more_are_told(planted: Path) -> None:
    (planted / "new.py").write_text("")
    faults = faults_of(planted, (*PLANTED_LAYERS, ("old",)))
    assert faults == [
        "flexspline.new has no layer: put it into LAYERS",
        "LAYERS has 'old', which is no more",
    ]


@pytest.mark.parametrize("home", RENDERERS.values())
def test_what_shows_a_result_is_where_the_table_says(home: str) -> None:
    module, _, name = home.partition(":")
    assert callable(getattr(importlib.import_module(module), name))


def test_no_public_name_is_a_room_too() -> None:
    """Else an import of the room would take the function's place."""
    inside = {file.stem for file in PACKAGE.iterdir()}
    assert set(flexspline.__all__) & inside == set()
