"""Sphinx's settings; `build.py` copies this beside the pages that it makes."""

import re

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
exclude_patterns = ["_trees"]
nb_execution_mode = "off"  # notebooks are shown as they are committed
nb_merge_streams = True
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
bibtex_bibfiles = ["REFERENCES.bib"]
bibtex_reference_style = "author_year"
autodoc_typehints = "none"  # a docstring says types with their shapes and units
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "pydata_sphinx_theme"
html_title = "flexspline"
html_static_path = ["_static"]
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

KEY = re.compile(r"\[([A-Z][A-Za-z-]*\d{4})\]")


def cite_keys(app, what, name, thing, options, lines):
    """Turn `[Higham2002]` of a docstring into a citation."""
    lines[:] = [KEY.sub(r":cite:t:`\1`", line) for line in lines]


def setup(app):
    """Tell Sphinx of what is done to docstrings."""
    app.connect("autodoc-process-docstring", cite_keys)
