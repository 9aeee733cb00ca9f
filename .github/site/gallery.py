"""The notebooks with their outputs, and a page that shows each by its title and first figure."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

from citations import IN_MARKDOWN, cited

ROOT = Path(__file__).parents[2]


def write_gallery(folder: Path) -> None:
    """Copy the notebooks, in the order in which README names them, and write their page."""
    folder.mkdir()
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    paths = sorted((ROOT / "notebooks").glob("*.ipynb"))
    paths.sort(key=lambda path: readme.find(f"notebooks/{path.name}") % len(readme))
    cards = ""
    for path in paths:
        notebook = json.loads(path.read_text(encoding="utf-8"))
        for cell in notebook["cells"]:
            if cell["cell_type"] == "markdown":
                cell["source"] = cited("".join(cell["source"]), IN_MARKDOWN)
        (folder / path.name).write_text(json.dumps(notebook), encoding="utf-8")
        cards += _card(path.stem, notebook, folder)
    names = "\n".join(path.stem for path in paths)
    (folder / "index.md").write_text(
        "# Notebooks\n\nEach is shown as it was run; the tests run each anew and hold its "
        "sentences to its results.\n\n"
        f"::::{{container}} gallery\n{cards}::::\n\n```{{toctree}}\n:hidden:\n\n{names}\n```\n",
        encoding="utf-8",
    )


def _card(name: str, notebook: dict[str, Any], folder: Path) -> str:
    title, words = _opening(notebook)
    picture = _first_picture(notebook)
    shown = ""
    if picture:
        (folder / f"{name}.png").write_bytes(picture)
        shown = f"![first figure of {name}]({name}.png)\n\n"
    return f":::{{container}} notebook\n{shown}[{title}]({name}.ipynb)\n\n{words}\n:::\n"


def _opening(notebook: dict[str, Any]) -> tuple[str, str]:
    """Return the title of a notebook and its first paragraph."""
    title, words, *_ = "".join(notebook["cells"][0]["source"]).split("\n\n")
    return title.removeprefix("# "), words


def _first_picture(notebook: dict[str, Any]) -> bytes:
    for cell in notebook["cells"]:
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                return base64.b64decode("".join(output["data"]["image/png"]))
    return b""
