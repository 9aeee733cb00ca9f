"""The Python interface: a page for each public name, from its docstring."""

from __future__ import annotations

import inspect
from pathlib import Path

import flexspline

ROOMS = ("simulation", "full_range", "collision", "observer", "sensor", "baselines", "sklearn")
"""Sub-packages whose interface is not all among the names of `flexspline` itself."""


def write_api(folder: Path) -> None:
    """Write a page for each name of the package, one for each sub-package, and their list."""
    folder.mkdir()
    names = [n for n in flexspline.__all__ if n not in ("CATALOGUE", "__version__")]
    for name in names:
        thing = getattr(flexspline, name)
        (folder / f"{name}.rst").write_text(_page(f"flexspline.{name}", thing), encoding="utf-8")
    for room in ROOMS:
        module = getattr(flexspline, room)
        text = f"{_title(f'flexspline.{room}')}{_first_line(module)}\n\n"
        for name in sorted(getattr(module, "__all__", ())):
            thing = getattr(module, name)
            if inspect.isclass(thing) or inspect.isfunction(thing):
                text += _directive(f"flexspline.{room}.{name}", thing)
        (folder / f"{room}-room.rst").write_text(text, encoding="utf-8")
    functions = [n for n in names if inspect.isfunction(getattr(flexspline, n))]
    classes = [n for n in names if n not in functions]
    text = f"{_title('Python')}``import flexspline`` gives all of these. Torques are in Nm, "
    text += "angles in rad, times in s; arrays have one entry a row of the run, ``(N,)``.\n\n"
    for title, pages in (
        ("Functions", functions),
        ("Classes", classes),
        ("Sub-packages", [f"{room}-room" for room in ROOMS]),
    ):
        listed = "".join(f"   {page}\n" for page in pages)
        text += f"{title}\n{'-' * len(title)}\n\n.. toctree::\n   :maxdepth: 1\n\n{listed}\n"
    (folder / "index.rst").write_text(text, encoding="utf-8")


def _page(path: str, thing: object) -> str:
    return _title(path) + _directive(path, thing)


def _title(text: str) -> str:
    return f"{text}\n{'=' * len(text)}\n\n"


def _first_line(module: object) -> str:
    return (inspect.getdoc(module) or "").split("\n\n")[0]


def _directive(path: str, thing: object) -> str:
    module = f".. currentmodule:: {path.rpartition('.')[0]}\n\n"
    if inspect.isclass(thing):
        ours = any(base.__module__.startswith("flexspline") for base in thing.__mro__[1:])
        inherited = "   :inherited-members:\n" if ours else ""
        return f"{module}.. autoclass:: {path}\n   :members:\n{inherited}\n"
    return f"{module}.. autofunction:: {path}\n\n"
