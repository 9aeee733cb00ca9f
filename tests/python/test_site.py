"""The documentation builds without a warning, and every link within it leads somewhere.

Needs what `pip install '.[docs]'` brings, and Chromium; skipped without, but never in CI.
"""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import site_crawl

import flexspline
from flexspline.cli import commands

ROOT = Path(__file__).parents[2]
NEEDED = ("sphinx", "pydata_sphinx_theme", "myst_nb", "sphinxcontrib.bibtex", "sklearn")
PLANTED = {
    "index.html": '<a href="other.html">a</a><a href="no.html">b</a><a href="other.html#no">c</a>'
    '<a href="other.html#here">d</a><img src="no.png">',
    "other.html": '<p id="here">here</p><div style="width:900px">wide</div>'
    '<h1 style="font-size:20px">one</h1><h2 style="font-size:30px">two</h2>'
    "<script>undefined_name()</script>",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The documentation, built as README says."""
    lacking = [name for name in NEEDED if not _installed(name)]
    if lacking:
        sentence = (
            f"{lacking[0]} is not installed: pip install '.[docs]' to build the documentation"
        )
        if os.environ.get("CI") == "true":
            pytest.fail(sentence)
        pytest.skip(sentence)
    out = tmp_path_factory.mktemp("site")
    build = ROOT / ".github" / "site" / "build.py"
    made = subprocess.run(
        [sys.executable, build, "--out", out], capture_output=True, text=True, check=False
    )
    assert made.returncode == 0 and not made.stderr, made.stderr
    return out


def _installed(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def test_every_link_of_the_site_leads_to_a_page_and_no_page_is_wider_than_a_telephone(
    site: Path, tmp_path: Path
) -> None:
    found = site_crawl.crawl(site, tmp_path)
    assert not found.faults
    pages = {f"/{path.relative_to(site).as_posix()}" for path in site.rglob("*.html")}
    unlinked = {page for page in pages - set(found.pages) if "/_" not in page}
    assert unlinked <= {"/genindex.html", "/py-modindex.html", "/search.html"}


def test_each_effect_command_notebook_and_public_name_has_a_page(site: Path) -> None:
    names = set(flexspline.__all__) - {"CATALOGUE", "__version__"}
    wanted = [f"effects/{name}" for name in flexspline.CATALOGUE]
    wanted += [f"commands/{name}" for name in commands.commands]
    wanted += [f"notebooks/{path.stem}" for path in (ROOT / "notebooks").glob("*.ipynb")]
    wanted += [f"api/{name}" for name in names]
    assert [page for page in wanted if not (site / f"{page}.html").is_file()] == []


@pytest.mark.parametrize("name", flexspline.CATALOGUE)
def test_the_page_of_an_effect_has_its_formula_picture_signature_source_and_cost(
    site: Path, name: str
) -> None:
    page = (site / "effects" / f"{name}.html").read_text(encoding="utf-8")
    formula, signature, source, cost = re.search(
        r'class="formula.*?<pre>(.*?)</pre>.*?In the residual.*?<li>(.*?)</li>'
        r".*?>Source<.*?<p>(.*?)</p>.*?On the device.*?<strong>(\d+) instructions",
        page,
        re.DOTALL,
    ).groups()  # type: ignore[union-attr]
    assert "=" in formula and len(signature) > 20 and len(source) > 20 and int(cost) > 0
    assert f"{name}.svg" in page


def test_what_is_wrong_with_pages_is_found(tmp_path: Path) -> None:
    pages = tmp_path / "pages"
    pages.mkdir()
    for name, body in PLANTED.items():
        text = f"<!doctype html><title>{name}</title>{body}"
        (pages / name).write_text(text, encoding="utf-8")
    found = site_crawl.crawl(pages, tmp_path)
    assert set(found.pages) == {"/index.html", "/other.html", "/no.html"} and found.links == 4
    for fault in (
        "/no.html is asked for",
        "no no in /other.html",
        "/no.png is no image",
        "/other.html is wider than 400 px",
        "/other.html: 'two' is as large as the title",
        "undefined_name is not defined",
    ):
        assert any(fault in said for said in found.faults), fault
    assert not any("no here" in said for said in found.faults)


def test_the_citation_is_of_this_version() -> None:
    text = (ROOT / ".github" / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {flexspline.__version__}\n" in text
