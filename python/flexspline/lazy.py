"""What is imported when it is first used, so that the package starts quickly.

Public names of a package are. So are functions that show results, which results do not know. A
result asks for the function by its kind and a form, such as "fit" and "html"; `presentation`, above
all results, says where each is. It is imported when it is first asked for, so that neither
matplotlib nor jinja2 is loaded before something is drawn or written.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, overload

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Rendered", "attached", "register", "render"]


_HOMES: dict[tuple[str, str], str] = {}


def attached(package: str, home: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package (PEP 562); `home`: module of each name, within it."""

    def imported(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(f"{package}.{home[name]}"), name)

    return imported


def register(kind: str, form: str, home: str) -> None:
    """Say where the function is that shows results of a kind: "package.module:function"."""
    _HOMES[kind, form] = home


@overload
def render(kind: str, form: Literal["text", "html"], *shown: Any) -> str: ...
@overload
def render(kind: str, form: Literal["figure"], *shown: Any) -> Figure: ...
@overload
def render(kind: str, form: str, *shown: Any, **options: Any) -> Any: ...


def render(kind: str, form: str, *shown: Any, **options: Any) -> Any:
    """Return what the registered function makes of a result and of all that it is given besides."""
    module, _, name = _HOMES[kind, form].partition(":")
    return getattr(importlib.import_module(module), name)(*shown, **options)


class Rendered:
    """A result that has a text, a fragment of HTML for notebooks, and a report."""

    _kind: ClassVar[str]
    """Of the result, by which what shows it is registered."""

    def __str__(self) -> str:
        return render(self._kind, "text", self)

    def _repr_html_(self) -> str:
        return render(self._kind, "html", self)

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write a self-contained HTML report, whole or not at all."""
        render(self._kind, "report", self, path)
