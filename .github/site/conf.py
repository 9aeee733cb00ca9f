"""Sphinx's settings for the folder that `build.py` makes."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from citations import BIBLIOGRAPHY, IN_RST, cited
from sphinx.ext.napoleon import NumpyDocstring

from flexspline import __version__

project = "flexspline"
author = "The flexspline developers"
copyright = author
release = version = __version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinxcontrib.bibtex",
]
nb_execution_mode = "off"  # notebooks are shown as they are committed
nb_merge_streams = True
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
bibtex_bibfiles = [str(BIBLIOGRAPHY)]
suppress_warnings = ["bibtex.missing_field"]  # which fields are asked is tested elsewhere
bibtex_reference_style = "author_year"
autodoc_typehints = "none"  # a docstring says types with their shapes and units
autodoc_member_order = "bysource"
default_role = "py:obj"  # `name` in a docstring: a link where it is a name of the package
napoleon_google_docstring = napoleon_numpy_docstring = False  # `marked_up` calls Napoleon
napoleon_use_param = False  # types are sentences here, and no names to link to
napoleon_use_rtype = False

html_theme = "pydata_sphinx_theme"
html_title = "flexspline"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "header_links_before_dropdown": 7,
    "navbar_align": "left",
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}


def marked_up(app, what, name, thing, options, lines):
    """Turn a docstring into reStructuredText, section by section."""
    starts = [k for k, line in enumerate(lines) if line and set(line) == {"-"}]
    first = starts[0] - 1 if starts else len(lines)
    made = [*_with_formulas(lines[:first]), *_described([_cited(x) for x in lines[first:]])]
    if what not in ("attribute", "property"):  # of which Napoleon takes a first clause for a type
        made = NumpyDocstring(made, app.config, app, what, name, thing, options).lines()
    lines[:] = made


def _with_formulas(lines):
    """Keep indented lines as they are: they are formulas."""
    made, inside = [], False
    for k, line in enumerate(lines):
        indented = line.startswith("    ")
        if indented and not inside and k and not lines[k - 1]:
            made += ["::", ""]
            inside = True
        inside &= indented or not line
        made.append(line if inside else _cited(line))
    return made


def _described(lines):
    """Take what is behind `name :` for the description, and no type, where it is a sentence."""
    made, inside = [], False
    for k, line in enumerate(lines):
        below = lines[k + 1] if k + 1 < len(lines) else ""
        if below and set(below) == {"-"}:
            inside = line in ("Parameters", "Attributes")
        found = re.fullmatch(r"([*\w, ]+?) : (.+)", line)
        typed = below.startswith("    ") and below.strip()[0].isupper() and line[-1] not in ".;,:"
        made += [found[1], f"    {found[2]}"] if inside and found and not typed else [line]
    return made


def _cited(line):
    """Make citations, and escape bars."""
    return cited(line, IN_RST, lambda words: words.replace("|", r"\|"))


def skipped(app, what, name, thing, skip, options):
    """Leave out what scikit-learn adds to a regressor: its documentation is elsewhere."""
    return True if name.endswith("_request") else None


def setup(app):
    """Tell Sphinx of what is done to docstrings."""
    app.connect("autodoc-process-docstring", marked_up)
    app.connect("autodoc-skip-member", skipped)
