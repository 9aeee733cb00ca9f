"""The committed stub `_core.pyi` says what the built module has: members, arguments, docstrings."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import flexspline
from flexspline import _core


class Member(NamedTuple):
    """What a stub and a built module can both say; `arguments` is None for what is not called."""

    arguments: tuple[str, ...] | None
    doc: str


def argument_names(function: ast.FunctionDef) -> tuple[str, ...]:
    given = function.args
    return tuple(arg.arg for arg in (*given.posonlyargs, *given.args, *given.kwonlyargs))


def in_stub(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, Member]]:
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield prefix + node.name, Member(None, ast.get_docstring(node) or "")
            yield from in_stub(node.body, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            called = not any(getattr(d, "id", "") == "property" for d in node.decorator_list)
            arguments = argument_names(node) if called else None
            yield prefix + node.name, Member(arguments, ast.get_docstring(node) or "")
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield prefix + node.target.id, Member(None, "")


def of_callable(doc: str) -> Member:
    """Read the signature that pybind11 writes as the first line of a docstring."""
    signature, _, text = doc.partition("\n")
    (function,) = ast.parse(f"def {signature}: ...").body
    assert isinstance(function, ast.FunctionDef)
    return Member(argument_names(function), text.strip())


def in_module(owner: object, prefix: str = "") -> Iterator[tuple[str, Member]]:
    for name, value in vars(owner).items():
        constructor = name == "__init__" and (value.__doc__ or "").startswith("__init__(self: ")
        if name.startswith("_") and not constructor:
            continue
        doc = value.__doc__ or ""
        if isinstance(value, type):
            yield prefix + name, Member(None, doc)
            yield from in_module(value, f"{prefix}{name}.")
        elif isinstance(value, property):
            yield prefix + name, Member(None, doc)
        elif callable(value):
            yield prefix + name, of_callable(doc)
        else:
            yield prefix + name, Member(None, "")


STUB = ast.parse(Path(flexspline.__file__).with_name("_core.pyi").read_text(encoding="utf-8"))
STATED = dict(in_stub(STUB.body))
BUILT = dict(in_module(_core))


def test_the_stub_names_every_member_of_the_module_and_no_other() -> None:
    assert sorted(STATED) == sorted(BUILT)


@pytest.mark.parametrize("name", sorted(STATED.keys() & BUILT.keys()))
def test_a_member_has_the_arguments_and_the_docstring_of_the_stub(name: str) -> None:
    assert STATED[name] == BUILT[name]


def test_the_module_has_the_docstring_of_the_stub() -> None:
    assert ast.get_docstring(STUB) == _core.__doc__
