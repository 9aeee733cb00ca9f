"""Notebooks are committed as they ran: read without being run, small, and of no one's machine."""

from __future__ import annotations

import ast
import base64
import re
import sys
from pathlib import Path
from typing import Any

import nbformat
import notebook_runs
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / ".github" / "site"))

import execute_notebooks

MOST_NOTEBOOK = 500_000  # bytes
MACHINE = re.compile(r"(?<![\w/.])/(?:tmp|home|root|work|usr|Users|private)/| at 0x[0-9a-f]{6}|\r")
REMEDY = "python .github/site/execute_notebooks.py"


def read(name: str) -> Any:
    return nbformat.read(notebook_runs.FOLDER / f"{name}.ipynb", as_version=4)


def faults(notebook: Any) -> list[str]:
    """What is wrong with the outputs of a notebook."""
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    found = []
    if [cell.execution_count for cell in code] != list(range(1, len(code) + 1)):
        found.append("its cells were not run once each in their order")
    if notebook.metadata.get("outputs_of") != execute_notebooks.code_digest(notebook):
        found.append("its outputs are of other code than stands there")
    for cell in code:
        if speaks(cell.source) and not cell.outputs:
            found.append(f"cell {cell.execution_count} has no output")
        for output in cell.outputs:
            found += [f"cell {cell.execution_count} {fault}" for fault in output_faults(output)]
    return found


def speaks(source: str) -> bool:
    """Whether the last line of a cell prints, or is a value that a notebook shows."""
    if source.startswith("%%"):  # a file that is written, in another language
        return False
    last = ast.parse(re.sub(r"^[!%].*$", "pass", source, flags=re.MULTILINE)).body[-1]
    if not isinstance(last, ast.Expr):
        return False
    called = last.value.func if isinstance(last.value, ast.Call) else None
    return not isinstance(called, ast.Attribute) or called.attr in ("plot", "round", "head")


def output_faults(output: Any) -> list[str]:
    if output.output_type == "error" or output.get("name") == "stderr":
        return ["failed or warned"]
    if output.output_type == "stream":
        return ["shows this machine"] if MACHINE.search(output.text) else []
    found = []
    for kind, value in output.data.items():
        if kind == "image/png" and len(base64.b64decode(value)) > execute_notebooks.MOST_PICTURE:
            found.append("has a large picture")
        if kind.startswith("text/") and MACHINE.search(value):
            found.append("shows this machine")
    return found


@pytest.mark.parametrize("name", notebook_runs.NAMES)
def test_a_notebook_is_committed_as_it_ran(name: str) -> None:
    assert not faults(read(name)), f"{REMEDY} {name}"
    assert (notebook_runs.FOLDER / f"{name}.ipynb").stat().st_size < MOST_NOTEBOOK


def test_what_is_wrong_with_outputs_is_found() -> None:
    def spoilt(change: Any) -> list[str]:
        notebook = read("first_fit")
        printing = next(c for c in notebook.cells if c.get("outputs"))
        change(printing)
        return faults(notebook)

    assert spoilt(lambda cell: None) == []
    assert "other code" in spoilt(lambda cell: cell.update(source="print(1)"))[0]
    assert "in their order" in spoilt(lambda cell: cell.update(execution_count=7))[0]
    assert "no output" in spoilt(lambda cell: cell.update(outputs=[]))[0]
    assert "shows this machine" in spoilt(lambda cell: cell.outputs[0].update(text="/tmp/x"))[0]
    assert "warned" in spoilt(lambda cell: cell.outputs[0].update(name="stderr"))[0]
