"""Reports whose figures are made but not drawn, for tests of something else."""

from __future__ import annotations

import html
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from matplotlib.figure import Figure


def _empty(figure: Figure, name: str) -> str:
    return f'<svg role="img" aria-label="{html.escape(name, quote=True)}"></svg>'


@contextmanager
def undrawn() -> Iterator[None]:
    """An empty SVG in the place of each figure: drawing takes 0.25 s a figure, most of a report.

    `test_report_html` and the tests of each command's report let Matplotlib draw.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flexspline.report.html.inline_svg", _empty)
        yield
