"""Who may import whom: the rooms of the package in layers, and every arrow points down.

`arrows.py` says what an arrow is.
"""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest
from arrows import cycles_of, faults_of, nodes_of

import flexspline
from flexspline.effects import CATALOGUE
from flexspline.presentation import RENDERERS

LAYERS = (
    # what knows nothing of joints
    ("_core", "about", "errors", "lazy", "parallel", "progress"),
    ("files", "formatting", "joint_file", "programs", "schema"),
    # runs, and what they show by themselves; logs know no effects, their checks do
    ("effects", "logs"),
    ("logs.checks", "own"),
    ("orders", "prediction", "prepared", "recordings", "signals"),
    ("simulator",),
    # a model of a joint, and what it is made of
    ("part",),
    ("estimators",),
    ("model",),
    ("forward",),
    # least squares
    ("least_squares",),
    ("regression",),
    ("fitting",),
    ("output_error",),
    # what is asked of runs
    ("calibration", "comparison", "experiment", "sklearn"),
    ("deprecated", "discovery"),
    ("fleet",),  # of what is asked of one joint
    ("tracking",),  # the same joint over many sessions
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
    ("baselines",),
    ("demo", "reproduce"),
    ("cli",),
    ("",),  # flexspline/__init__.py
    ("__main__",),
)
"""Rooms, which are sub-packages and modules of the package, the lowest first. A room imports from
rows above its own in this table, not from its neighbours. Where a room lies in another one, the
`__init__` of the outer belongs to the higher of both."""

KNOW_EFFECTS = ("effects", "baselines", "demo", "reproduce", "rigs", "simulation")
"""Rooms that know effects by name: their own, and those whose physics is a rig's or a paper's."""

OTHER_THINGS = {
    "comparison": ("offset",),  # a covariate: everywhere the same
    "exporting": ("inertia",),  # numbers of a plan, and arguments
    "joint_file": ("cogging",),  # an attribute of MuJoCo's dcmotor
    "observer": ("inertia",),
    "plot": ("inertia",),
    "recordings": ("gravity",),  # in the name of a column
}
"""Words of other rooms that are also names of effects, and mean something else there."""

BY_TABLE = ("flexspline.lazy",)
"""Modules that import what a table gives them whose strings are arrows where the table stands."""

PACKAGE = Path(flexspline.__file__).parent


def test_every_arrow_points_down() -> None:
    assert faults_of(PACKAGE, LAYERS, BY_TABLE) == []


def test_sub_packages_form_no_cycle() -> None:
    """Whatever the order of the layers, and rooms inside others taken with those."""
    assert cycles_of(PACKAGE) == []


def test_no_other_room_knows_an_effect_by_its_name() -> None:
    assert named_effects(PACKAGE) == []


def named_effects(package: Path) -> list[str]:
    """Strings of code that are an effect's name, by file and line; those of docstrings are not."""
    found = []
    for file in sorted(package.rglob("*.py")):
        room = file.relative_to(package).parts[0].removesuffix(".py")
        if room not in KNOW_EFFECTS:
            for node in nodes_of(file.read_text(encoding="utf-8")):
                value = node.value if isinstance(node, ast.Constant) else None
                if value in CATALOGUE and value not in OTHER_THINGS.get(room, ()):
                    found.append(f"{file.relative_to(package)}:{node.lineno} names {value}")
    return found


def test_a_planted_name_of_an_effect_is_found(planted: Path) -> None:
    (planted / "low" / "bad.py").write_text('"""Of gravity."""\nx = {"gravity": "offset of 1"}\n')
    (planted / "simulation.py").write_text('x = "gravity"\n')
    assert named_effects(planted) == ["low/bad.py:2 names gravity"]


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
    "of all names": "from flexspline.high.deep import *",
    "with dots": "from ..high import deep",
    "in a function": "def late():\n    from flexspline.high.deep import thing",
    "for types alone": "if TYPE_CHECKING:\n    from flexspline.high.deep import Thing",
    "by a name": 'importlib.import_module("flexspline.high.deep")',
    "by a name put together": 'import_module(f"flexspline.high.{name}")',
    "by a sum": 'import_module("flexspline." + "high")',
    "by a keyword": 'import_module(name="flexspline.high" + name)',
    "by a name with dots": 'import_module("..high.deep", __package__)',
    "by a name with dots, of a package": 'import_module("..high", package="flexspline.low")',
    "for types as a string": 'thing: "flexspline.high.deep.Thing"',
    "in a table": 'RENDERERS = {"thing": "flexspline.high.deep:thing"}',
    "in a table, put together": 'HOMES = {"thing": f"flexspline.high.{name}:thing"}',
    "of the top": "from flexspline import thing",
    "of the top, whole": "import flexspline",
    "of the top, by a module's": "import flexspline.low.fine",
    "of the top by a name": '__import__("flexspline")',
    "of a neighbour": "from flexspline.beside import thing",
}


@pytest.mark.parametrize("kind", PLANTED)
def test_a_planted_arrow_is_found_with_its_line(kind: str, planted: Path) -> None:
    (planted / "low" / "bad.py").write_text(f"import ast\n{PLANTED[kind]}\n")
    (fault,) = faults_of(planted, PLANTED_LAYERS)
    line = 3 if "\n" in PLANTED[kind] else 2
    assert fault.startswith(f"low/bad.py:{line} imports flexspline")


@pytest.mark.parametrize("name", ["name", "NAMES[0]", '".".join(["flexspline", "high"])', "*names"])
def test_a_name_that_nobody_can_tell_is_a_fault(name: str, planted: Path) -> None:
    (planted / "low" / "bad.py").write_text(f"import_module({name})\n")
    (fault,) = faults_of(planted, PLANTED_LAYERS)
    assert fault.startswith("low/bad.py:1 imports what nobody can tell")
    assert faults_of(planted, PLANTED_LAYERS, ("flexspline.low.bad",)) == []


def test_a_module_that_asks_for_no_table_any_more_is_told(planted: Path) -> None:
    faults = faults_of(planted, PLANTED_LAYERS, ("flexspline.low.fine",))
    assert faults == ["BY_TABLE has flexspline.low.fine, which asks for no module of a table"]


def test_a_module_from_elsewhere_is_no_arrow(planted: Path) -> None:
    said = 'import numpy as np\nimport os.path\nimport_module("scipy.linalg")\nx = f"numpy.{np}"\n'
    (planted / "low" / "fair.py").write_text(said)
    assert faults_of(planted, PLANTED_LAYERS) == []


def test_a_planted_cycle_is_found_and_what_hangs_on_it_is_not(planted: Path) -> None:
    (planted / "low" / "inner.py").write_text("def late():\n    from flexspline.beside import x\n")
    (planted / "beside" / "user.py").write_text("from flexspline.low.fine import thing\n")
    assert cycles_of(planted) == [
        "beside/user.py:1 imports flexspline.low.fine, which leads back to 'beside'",
        "low/inner.py:2 imports flexspline.beside, which leads back to 'low'",
    ]


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


def test_results_ask_for_all_that_the_table_has_and_for_nothing_else() -> None:
    asked, kinds, of_all = set(), set(), set()
    for file in PACKAGE.rglob("*.py"):
        for node in nodes_of(file.read_text(encoding="utf-8")):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "render":
                kind, form = node.args[:2]
                if isinstance(kind, ast.Constant):
                    asked.add((kind.value, ast.literal_eval(form)))
                else:
                    of_all.add(ast.literal_eval(form))
            elif isinstance(node, ast.AnnAssign) and getattr(node.target, "id", "") == "_kind":
                kinds.update(() if node.value is None else (ast.literal_eval(node.value),))
    assert of_all == {"text", "html", "report"}  # by lazy.Rendered
    assert asked | {(kind, form) for kind in kinds for form in of_all} == set(RENDERERS)


@pytest.mark.parametrize("home", RENDERERS.values())
def test_what_shows_a_result_is_where_the_table_says(home: str) -> None:
    module, _, name = home.partition(":")
    assert callable(getattr(importlib.import_module(module), name))


def test_no_public_name_is_a_room_too() -> None:
    """Else an import of the room would take the function's place."""
    inside = {file.stem for file in PACKAGE.iterdir()}
    assert set(flexspline.__all__) & inside == set()
