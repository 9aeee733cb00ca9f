"""Builds the documentation: python .github/site/build.py [--out DIR]

Sphinx reads a folder that is made here from what is written elsewhere already, each thing once:
README.md by its sections, the notebooks with their outputs, the catalogue of effects with the
comments of their headers, the help of each command, docstrings, the changelog. Only pages that have
no other home are in `pages`. Warnings are errors. Needs `pip install '.[docs]'`.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from api_pages import write_api
from command_pages import write_commands
from effect_pages import write_effects
from gallery import write_gallery

SITE = Path(__file__).parent
ROOT = SITE.parents[1]
FILES = {
    ".github/CHANGELOG.md": "changelog",
    ".github/CONTRIBUTING.md": "contributing",
    "cpp/firmware/README.md": "firmware",
}
SECTIONS = {
    "Start": "start",
    "What a run holds": "joint",
    "Which command for which task": "tasks",
    "Beyond the fit": "beyond",
}
FIGURES = sorted(SITE.parent.glob("figure*.svg"))  # that of README, and one for dark pages
FIGURE = re.compile(
    r"!\[(?P<alt>[^\]]+)\]\(\.github/figure\.svg\)|<picture>.*?alt=\"(?P<said>.*?)\".*?</picture>",
    re.DOTALL,
)
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#:]+)\)")


def assemble(source: Path) -> None:
    """Write all that Sphinx reads into a folder."""
    shutil.copytree(SITE / "pages", source)
    for path in (SITE.parent / "CITATION.cff", *FIGURES):
        shutil.copy(path, source)
    for file, page in FILES.items():
        text = (ROOT / file).read_text(encoding="utf-8")
        (source / f"{page}.md").write_text(_relinked(text), encoding="utf-8")
    _write_sections(source)
    write_gallery(source / "notebooks")
    write_effects(source / "effects")
    write_commands(source / "commands")
    write_api(source / "api")


def _write_sections(source: Path) -> None:
    """README's sections, a page each; what stands before them goes on the first page."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    first, *parts = re.split(r"^## ", readme, flags=re.MULTILINE)
    opening = FIGURE.sub(_figure, first.split("\n", 2)[2])
    index = source / "index.md"
    text = index.read_text(encoding="utf-8").replace("OPENING", opening.strip())
    index.write_text(text, encoding="utf-8")
    by_title = dict(part.split("\n", 1) for part in parts)
    for title, page in SECTIONS.items():
        text = re.sub(r"^<!--.*-->\n", "", by_title[title], flags=re.MULTILINE)
        (source / f"{page}.md").write_text(f"# {title}\n{_relinked(text)}", encoding="utf-8")


def _figure(found: re.Match[str]) -> str:
    said = " ".join((found["alt"] or found["said"]).split())
    schemes = ("only-light", "only-dark") if len(FIGURES) > 1 else ("bg-white",)
    images = "\n\n".join(
        f"```{{image}} {path.name}\n:alt: {said}\n:class: {scheme}\n```"
        for path, scheme in zip(FIGURES, schemes, strict=True)
    )
    return f"````{{container}} scrolls\n{images}\n````"


def _relinked(text: str) -> str:
    """Turn links between files of the repository into links between pages, others into words."""

    def linked(found: re.Match[str]) -> str:
        words, file = found.groups()
        if file.endswith(".ipynb"):
            return f"[{words}](notebooks/{Path(file).name})"
        page = {**FILES, ".github/REFERENCES.bib": "references"}.get(file)
        return f"[{words}]({page}.md)" if page else words

    return LINK.sub(linked, text)


def main() -> int:
    """Build the pages and return Sphinx's exit code."""
    asked = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    asked.add_argument("--out", type=Path, default=ROOT / "build" / "site")
    out = asked.parse_args().out.resolve()
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        assemble(source)
        shutil.rmtree(out, ignore_errors=True)
        call = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", "-E"]
        places = ["-c", SITE, "-d", source.with_name("trees"), source, out]
        return subprocess.run([*call, *map(os.fspath, places)]).returncode


if __name__ == "__main__":
    raise SystemExit(main())
