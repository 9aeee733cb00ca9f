"""Mutants: one small change of a module's source text each, found in its syntax tree.

| kind | change |
|---|---|
| compare | `<` to `<=` and to `>=`, `==` to `!=`, `is` to `is not`, `in` to `not in`, … |
| arithmetic | `+` to `-`, `*` to `/`, `**` to `*`, …, in `+=` too; `-x` and `~x` to `x` |
| boolean | `and` to `or`; `not x` to `x`; `True` to `False` |
| constant | 0 to 1, another whole number to the next, a float to twice itself |
| return | the value returned to `None` |
| condition | of `if`, `while`, `… if … else` and a comprehension: negated |
| call | `min` to `max`, `any` to `all` |
| statement | a call for its effect, or an assignment to an item or attribute: left out |

Annotations, messages (f-strings, `raise`), `__all__`, `__repr__`, type variables and what only type
checkers read are left alone: a mutant of these is no different program.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

COMPARE = {
    ast.Lt: ("<=", ">="), ast.LtE: ("<", ">"), ast.Gt: (">=", "<="), ast.GtE: (">", "<"),
    ast.Eq: ("!=",), ast.NotEq: ("==",), ast.Is: ("is not",), ast.IsNot: ("is",),
    ast.In: ("not in",), ast.NotIn: ("in",),
}  # fmt: skip
ARITHMETIC = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "*",
    ast.Pow: "*", ast.BitAnd: "|", ast.BitOr: "&",
}  # fmt: skip
CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}
UNREAD = ("__repr__", "__str__", "_repr_html_")


@dataclass(frozen=True)
class Mutant:
    """The text from `start` to `end` of a file becomes `text`; `scope`: statements around it."""

    file: Path
    kind: str
    start: int
    end: int
    text: str
    line: int
    scope: tuple[ast.stmt, ...]

    @cached_property
    def source(self) -> str:
        return self.file.read_text(encoding="utf-8")

    @property
    def mutated(self) -> str:
        return self.source[: self.start] + self.text + self.source[self.end :]

    @property
    def key(self) -> str:
        return f"{self.file.parent.name}/{self.file.name}:{self.line} {self.after}"

    def hashed(self, seed: int) -> str:
        """Of the seed, the file, the function, and the lines before and after."""
        name, _ = self.function or ("", 0)
        place = f"{self.file.parent.name}/{self.file.name} {name}"
        text = "\n".join((str(seed), place, self.kind, self.before, self.after))
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def function(self) -> tuple[str, int] | None:
        """Qualified name and first line of the outermost function whose body holds it."""
        names = []
        for statement in self.scope[:-1] if self.scope else ():
            names.append(getattr(statement, "name", ""))
            if isinstance(statement, ast.FunctionDef):
                first = min([statement.lineno, *(d.lineno for d in statement.decorator_list)])
                return ".".join(name for name in names if name), first
        return None

    @property
    def before(self) -> str:
        """The lines that change, as they are."""
        return self._lines(self.source, self.end)

    @property
    def after(self) -> str:
        return self._lines(self.mutated, self.start + len(self.text))

    def _lines(self, text: str, end: int) -> str:
        first = text.rfind("\n", 0, self.start) + 1
        last = text.find("\n", end)
        return "\n".join(line.strip() for line in text[first:last].splitlines())


def drawn(files: list[Path], seed: int, number: int) -> list[Mutant]:
    """Draw mutants of these files, each as likely as any other: those of the smallest hashes.

    A hash is of the seed and the mutant's own lines, so that what changes elsewhere in the sources
    changes nothing of the draw, and another day's count is one of nearly the same mutants.
    """
    every = [mutant for file in sorted(files) for mutant in mutants_of(file)]
    return sorted(every, key=lambda mutant: mutant.hashed(seed))[:number]


def mutants_of(file: Path) -> Iterator[Mutant]:
    source = file.read_text(encoding="utf-8")
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    data = source.encode()

    def place(line: int, column: int) -> int:
        return len(data[: starts[line - 1] + column].decode())

    for kind, node, text, scope in changes(ast.parse(source), ()):
        yield Mutant(
            file,
            kind,
            place(node.lineno, node.col_offset),
            place(node.end_lineno or 0, node.end_col_offset or 0),
            text,
            node.lineno,
            scope,
        )


def changes(
    node: ast.AST, scope: tuple[ast.stmt, ...]
) -> Iterator[tuple[str, ast.expr | ast.stmt, str, tuple[ast.stmt, ...]]]:
    """Yield (kind, node, the text in its place, statements around it) for this and all below."""
    if _unread(node):
        return
    if isinstance(node, ast.stmt):
        scope = (*scope, node)
    for change in (_operators, _constants, _conditions, _left_out):
        for kind, changed, text in change(node):
            yield kind, changed, text, scope
    for name, field in ast.iter_fields(node):
        if name not in ("annotation", "returns"):
            for child in field if isinstance(field, list) else [field]:
                if isinstance(child, ast.AST):
                    yield from changes(child, scope)


Change = tuple[str, "ast.expr | ast.stmt", str]


def _operators(node: ast.AST) -> Iterator[Change]:
    text = ast.unparse
    match node:
        case ast.Compare(left=left, ops=[operator], comparators=[right]):
            for other in COMPARE[type(operator)]:
                yield "compare", node, f"(({text(left)}) {other} ({text(right)}))"
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in ARITHMETIC:
            other = ARITHMETIC[type(operator)]
            yield "arithmetic", node, f"(({text(left)}) {other} ({text(right)}))"
        case ast.AugAssign(target=target, op=operator, value=value) if type(operator) in ARITHMETIC:
            yield "arithmetic", node, f"{text(target)} {ARITHMETIC[type(operator)]}= {text(value)}"
        case ast.UnaryOp(op=ast.USub() | ast.Invert(), operand=operand):
            yield "arithmetic", node, f"({text(operand)})"
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield "boolean", node, f"({text(operand)})"
        case ast.BoolOp(op=operator, values=values):
            other = " or " if isinstance(operator, ast.And) else " and "
            yield "boolean", node, "(" + other.join(f"({text(value)})" for value in values) + ")"


def _constants(node: ast.AST) -> Iterator[Change]:
    match node:
        case ast.Constant(value=bool(value)):
            yield "boolean", node, str(not value)
        case ast.Constant(value=int(value)):
            yield "constant", node, str(value + 1)
        case ast.Constant(value=float(value)):
            yield "constant", node, repr(2.0 * value if value else 1.0)
        case ast.Call(func=ast.Name(id=name)) if name in CALLS:
            yield "call", node, CALLS[name] + ast.unparse(node)[len(name) :]


def _conditions(node: ast.AST) -> Iterator[Change]:
    tests = node.ifs if isinstance(node, ast.comprehension) else []
    if isinstance(node, (ast.If, ast.While, ast.IfExp)):
        tests = [node.test]
    for test in tests:
        yield "condition", test, f"(not ({ast.unparse(test)}))"


def _left_out(node: ast.AST) -> Iterator[Change]:
    match node:
        case ast.Return(value=ast.expr() as value) if not isinstance(value, ast.Constant):
            yield "return", value, "None"
        case ast.Expr(value=ast.Call()) | ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield "statement", node, "pass"


def _unread(node: ast.AST) -> bool:
    """Whether no caller sees what this node holds, or nothing but a message holds it."""
    match node:
        case ast.JoinedStr() | ast.Raise() | ast.Import() | ast.ImportFrom():
            return True
        case ast.FunctionDef(name=name):
            return name in UNREAD
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
        case ast.Assign(targets=[ast.Name(id=name)]):
            return name == "__all__" or _is_type(node.value)
        case _:
            return False


def _is_type(node: ast.AST) -> bool:
    """Whether the value is a type: `TypeVar(…)`, `NewType(…)`, `cast(…)`."""
    return isinstance(node, ast.Call) and ast.unparse(node.func) in ("TypeVar", "NewType", "cast")
