"""The figures of a report as SVG inside the page: they follow its text colour."""

from __future__ import annotations

import html
import io
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import matplotlib
from matplotlib.figure import Figure

from flexspline.plot.canvas import INK, Panel, PlainFigure, axes_or_new
from flexspline.plot.fit import panels

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["ReportFigure", "drawn", "inline_svg", "report_figures"]

DPI = 130  # of the heavy layers, which are drawn as pixels


@dataclass(frozen=True)
class ReportFigure:
    """A figure as SVG text with a caption that says what to look at."""

    svg: str
    caption: str


def report_figures(fit: Fit) -> list[ReportFigure]:
    """Return a figure for each panel of `plot_fit`."""
    return [drawn(panel) for panel in panels(fit)]


def drawn(panel: Panel) -> ReportFigure:
    """Return a panel as a figure of a report."""
    ax = axes_or_new(None, 7.2, 3.7)
    panel.draw(ax)
    figure = ax.figure
    assert isinstance(figure, PlainFigure)
    return ReportFigure(inline_svg(figure, ax.get_title(loc="left")), panel.look_for)


def inline_svg(figure: Figure, name: str) -> str:
    """Return an SVG element whose dark lines and text have the colour of the text around it.

    `name` is read out to who cannot see it, and keeps ids apart within a page.
    """
    made = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(made, format="svg", transparent=True, dpi=DPI, metadata=nothing)
    text = made.getvalue()
    text = text[text.index("<svg") :].replace(INK, "currentColor")
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    label = html.escape(name, quote=True)
    return re.sub(
        r'<svg ([^>]*?)width="[^"]*" ([^>]*?)height="[^"]*"|<svg ([^>]*?)height="[^"]*" ([^>]*?)'
        r'width="[^"]*"',
        lambda m: f'<svg role="img" aria-label="{label}" ' + " ".join(g for g in m.groups() if g),
        text,
        count=1,
    )
