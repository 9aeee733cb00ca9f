"""A fit as HTML: a small table for notebooks, and a report in one file that needs no network.

It says how to make the fit again. Figures are SVG inside the page and follow its text colour.

What is wrong with logs is such a page too, and numbers for scripts.
"""

from __future__ import annotations

import html
import io
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from flexspline.about import __version__
from flexspline.effects import Effect
from flexspline.files import atomic_write
from flexspline.formatting import padded, short
from flexspline.least_squares.result import shares
from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks import check_verdict, must_be_repaired
from flexspline.logs.checks.findings import EXCITED
from flexspline.model import load_words
from flexspline.plot import panels
from flexspline.plot.canvas import INK, LEAST, Panel, PlainFigure, axes_or_new, own_style
from flexspline.report.tables import (
    between_rows,
    between_sentences,
    delay_sentence,
    grouped_scores,
    input_rows,
    late_of,
    score_rows,
)
from flexspline.report.text import (
    TARGET_WORDS,
    known_groups,
    parameter_lines,
    trust,
    unknown_error,
    validation_sentence,
    verdict,
)

if TYPE_CHECKING:
    from flexspline.least_squares.profile import Contour, Profile
    from flexspline.least_squares.result import Fit, SimulationFit
    from flexspline.logs.checks import Audits, Excited
    from flexspline.logs.log import Log

__all__ = [
    "ReportFigure",
    "drawn",
    "fit_html",
    "inline_svg",
    "log_facts",
    "model_facts",
    "templates",
    "write_check_report",
    "write_report",
]


_WORDS = {
    "gear_ratio": "gear ratio N",
    "output_spline": "output spline",
    "pole_pairs": "pole pairs",
    "torque_constant": "torque constant [Nm/A]",
}

DPI = 130  # of the heavy layers, which are drawn as pixels
WIDTH = 4.5  # inches of a panel: whole on a screen of 400 px, two side by side on a wide one
SMALLEST, LARGEST = 9.0, 12.0  # px of the least text, wherever the page is shown

MOST_BESIDE = 12
"""Runs that have a column each in the table of effects: as many as a wide page holds."""


def fit_html(fit: Fit) -> str:
    """Return a fit as a fragment of HTML without scripts, for notebooks light and dark."""
    return (
        templates()
        .get_template("fit.html")
        .render(_common(fit), scores=score_rows(fit.scores, fit.unit))
    )


@own_style()
def write_report(
    fit: Fit,
    path: str | os.PathLike[str],
    beside: Sequence[Profile | Contour] = (),
    refused: Sequence[str] = (),
) -> None:
    """Write a self-contained report, whole or not at all.

    Parameters
    ----------
    beside : profiles and regions of its parameters, to be shown with it.
    refused : why there is none of what was asked for, a sentence each.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    # matplotlib only where it draws

    made = shares(fit)
    largest = max(made.values(), default=1.0) or 1.0
    write_html(
        path,
        "report.html",
        {**_common(fit), "warnings": [*_common(fit)["warnings"], *refused]},
        profiles=[_profiled(one) for one in beside],
        title=str(fit.model.facts.get("joint", f"Fit of {TARGET_WORDS[fit.target]}")),
        scores=grouped_scores(fit.scores),
        figures=report_figures(fit),
        shares=[(name, padded(size), 100.0 * size / largest) for name, size in made.items()],
        orders="" if fit.orders is None else str(fit.orders),
        channels=input_rows(fit.inputs, fit.part.preparations, late_of(fit.delay)),
        delay=delay_sentence(fit.delay, fit.unit),
        logs=used_logs(fit),
        facts=model_facts(fit),
        call=python_call(fit),
    )


def _common(fit: Fit) -> dict[str, Any]:
    return {
        "verdict": verdict(fit),
        "lines": parameter_lines(fit),
        "groups": known_groups(fit),
        "determined": all(p.determined for p in fit.parameters),
        "unknown": any(unknown_error(p) for p in fit.parameters),
        "between": between_rows(fit),
        "differ": between_sentences(fit),
        "trust": trust(fit)[:-1],
        "held": validation_sentence(fit),
        "motion": None if fit.simulation is None else fit.simulation.table(),
        "starts": None if fit.simulation is None else fit.simulation.ends,
        "reliable": fit.simulation is not None or fit.uncertainty.reliable,
        "warnings": [w for w in fit.warnings if w != fit.uncertainty.statement],
        "what": TARGET_WORDS[fit.target],
        "unit": fit.unit,
    }


@cache
def templates() -> Environment:
    """Return the package's HTML templates, which know how numbers are printed."""
    made = Environment(
        loader=PackageLoader("flexspline.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["minus"] = minus
    made.filters["together"] = together
    return made


def write_html(
    path: str | os.PathLike[str],
    template: str,
    shared: Mapping[str, Any] | None = None,
    **content: Any,
) -> None:
    """Write the page of a template, whole or not at all; it says which version made it.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    page = templates().get_template(template).render(shared or {}, version=__version__, **content)
    atomic_write(path, page)


def minus(text: str) -> str:
    """Return a text or HTML with a minus sign where a hyphen stands before a number."""
    return re.sub(r"(?<![\w.])-(?=\d)", "−", text)


def together(page: str) -> Markup:
    """Return HTML whose lines break neither between a number and its unit nor around ± and =.

    What is drawn, code and paths stay as they are: they are copied.
    """
    return Markup(_AS_IT_IS.sub(lambda m: m[0] if m["kept"] else _joined(m[0]), page))


_AS_IT_IS = re.compile(
    r'(?P<kept><(svg|pre|code)\b.*?</\2>|<p class="path">.*?</p>|<[^>]*>)|[^<]+', re.DOTALL
)
_UNIT = re.compile(
    r"(?<=\d) (?=(?:%|°C|[mkµ]?(?:Nm|V|A|Hz|Ω|s|rad|g|m)|K|1/s|min|h)(?![A-Za-z]))"
    r"| (?=± )|(?<=±) |(?<=\b\w) (?== )|(?<=\b\w =) "
)


def _joined(text: str) -> str:
    return _UNIT.sub("\N{NO-BREAK SPACE}", text)


@dataclass(frozen=True)
class LogFacts:
    """One log: name, rows and duration, file, SHA-256, and what was done to it."""

    name: str
    rows: str
    path: str
    sha256: str
    history: tuple[str, ...]


def used_logs(fit: Fit) -> list[LogFacts]:
    """Return what there is to say of the logs of a fit, and how many rows of each it used."""
    return log_facts([run.log for run in fit.runs], [int(run.counts.sum()) for run in fit.runs])


def log_facts(logs: Iterable[Log], used: Sequence[int] = ()) -> list[LogFacts]:
    """Return what there is to say of each log; `used`: how many of its rows, where not all."""
    found = []
    for number, log in enumerate(logs):
        rows = f"{used[number]} of {len(log)} rows used" if used else f"{len(log)} rows"
        found.append(
            LogFacts(
                log.name,
                f"{rows}, {short(log.duration, 4)} s at {short(log.rate, 4)} Hz",
                log.source.path if log.source else "not from a file",
                log.source.sha256 if log.source else "",
                tuple(log.history),
            )
        )
    return found


def model_facts(fit: Fit) -> list[tuple[str, str]]:
    """Return facts of the joint and of the fit, by name."""
    found = [
        (_WORDS.get(k, k.replace("_", " ")), f"{v:g}" if isinstance(v, float) else str(v))
        for k, v in fit.model.facts.items()
    ]
    corrects = fit.part.simulated
    found += [
        ("target", f"{fit.target} [{fit.unit}]"),
        ("known load", load_words(fit.part)),
        *([] if corrects is None else [("corrects a simulation", corrects.words)]),
        ("low pass, zero phase", "none" if fit.lowpass is None else f"{fit.lowpass:g} Hz"),
        ("condition of the scaled design", short(fit.condition)),
        ("sums", "double-double" if fit.exact else "double"),
    ]
    for name, ends in fit.part.record.get("validity", {}).items():
        unit = CHANNELS[name].unit if name in CHANNELS else "Nm"
        label = f"range of {name.replace('_', ' ')}"
        found.append((label, f"{ends[0]:.4g} to {ends[1]:.4g} {unit}"))
    return found


def python_call(fit: Fit) -> str:
    """Return the call that makes the fit again from the same logs."""
    effects = [e.name if e.own else repr(e.name) for e in fit.part.effects]
    lines = [f"[{', '.join(effects)}]", "logs", repr(fit.target)]
    if fit.part.known_load is not None:
        lines.append(f"known_load={fit.part.known_load!r}")
    if fit.part.carried is not None:
        lines.append("into=model")
    if fit.lowpass is not None:
        lines.append(f"lowpass={fit.lowpass!r}")
    orders = {e.name: orders_given(e) for e in fit.part.effects if e.harmonics}
    fixed = {p.name: p.value for p in fit.parameters if p.state == "fixed"}
    priors = {p.name: p.prior for p in fit.parameters if p.prior is not None}
    for key, value in (("orders", orders), ("fixed", fixed), ("priors", priors)):
        if value:
            lines.append(f"{key}={value!r}")
    if fit.simulation is not None and fit.simulation.controller is not None:
        lines.append(f"controller={fit.simulation.controller!r}")
    name, kind = (
        ("fit", "FitOptions") if fit.simulation is None else ("fit_motion", "MotionOptions")
    )
    options = _fit_options(fit) if fit.simulation is None else _motion_options(fit, fit.simulation)
    if options:
        lines.append(f"options=flexspline.{kind}({', '.join(options)})")
    carried = fit.part.carried
    above = "" if carried is None else f"# model: one that has {carried.words}\n"
    return f"{above}fit = flexspline.{name}(\n" + "".join(f"    {line},\n" for line in lines) + ")"


def bandwidth_given(bandwidth: float | None) -> list[str]:
    """Return the argument of a call that smooths motion to this, Hz; none where the runs tell."""
    if bandwidth is None:
        return []
    return ["bandwidth=" + (f"{bandwidth!r}" if math.isfinite(bandwidth) else "float('inf')")]


def _fit_options(fit: Fit) -> list[str]:
    options = []
    if fit.part.simulated is not None:
        options += ["simulation=simulation"] if fit.part.simulated.own_files else []
        options.append(f"simulated_torque={fit.part.simulated.column!r}")
    options += bandwidth_given(fit.bandwidth)
    own = [term.term for term in fit.between_runs]
    if own == ["offset.offset"]:
        options.append("offset_per_run=True")
    elif own:
        options.append(f"per_run={own!r}")
    return options


def _motion_options(fit: Fit, found: SimulationFit) -> list[str]:
    free = [name.removeprefix("controller.") for name in found.names if "controller." in name]
    given = [f"starts={len(found.starts)}", f"folds={len(found.folds)}"]
    given += bandwidth_given(fit.bandwidth)
    return [*given, f"free_controller={free!r}"] if free else given


def orders_given(effect: Effect) -> list[int | tuple[int, str]]:
    """Return the orders of a ripple as a call takes them: with their pair where it is not usual."""
    usual = effect.info.pairs[0]
    return [order if pair == usual else (order, pair) for order, pair in effect.harmonics]


@dataclass(frozen=True)
class ReportFigure:
    """A figure as SVG text with a caption that says what to look at."""

    svg: str
    caption: str


def report_figures(fit: Fit) -> list[ReportFigure]:
    """Return a figure for each panel of `plot_fit`."""
    return [drawn(panel) for panel in panels(fit)]


def _profiled(made: Profile | Contour) -> ReportFigure:
    """A profile or a region as a figure of a report, below it what it says."""
    figure = made.plot()
    name = figure.axes[0].get_title(loc="left")
    return ReportFigure(inline_svg(figure, f"{name} of {made!r}"), str(made))


def drawn(panel: Panel) -> ReportFigure:
    """Return a panel as a figure of a report."""
    ax = axes_or_new(None, WIDTH, panel.height)
    panel.draw(ax)
    figure = ax.figure
    assert isinstance(figure, PlainFigure)
    return ReportFigure(
        inline_svg(figure, ax.get_title(loc="left").replace("\n", " ")), panel.look_for
    )


def inline_svg(figure: Figure, name: str) -> str:
    """Return an SVG element whose dark lines and text have the colour of the text around it.

    `name` is read out to who cannot see it, and keeps ids apart within a page. It shrinks and grows
    with the page as far as its text can be read, and scrolls in its box where that is too wide.
    """
    made = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(made, format="svg", transparent=True, dpi=DPI, metadata=nothing)
    text = made.getvalue()
    text = text[text.index("<svg") :].replace(INK, "currentColor")
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    label = html.escape(name, quote=True)
    ends = (72.0 * figure.get_figwidth() * px / LEAST for px in (SMALLEST, LARGEST))
    size = "min-width:{:.0f}px;max-width:{:.0f}px".format(*ends)
    text = re.sub(
        r'<svg ([^>]*?)width="[^"]*" ([^>]*?)height="[^"]*"|<svg ([^>]*?)height="[^"]*" ([^>]*?)'
        r'width="[^"]*"',
        lambda m: (
            f'<svg role="img" aria-label="{label}" style="{size}" '
            + " ".join(g for g in m.groups() if g)
        ),
        text,
        count=1,
    )
    return f'<div class="wide">{text}</div>'


@own_style()
def write_check_report(
    audits: Audits,
    path: str | os.PathLike[str],
    target: str | None = None,
    excited: Sequence[Excited] = (),
) -> None:
    """Write a self-contained report, whole or not at all.

    `excited`: what the runs excite together.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.channels import plot_channels

    runs = [
        {
            "name": log.name,
            "rows": f"{len(log)} rows, {short(log.duration, 4)} s at {short(log.rate, 4)} Hz",
            "path": log.source.path if log.source else "not from a file",
            "sha256": log.source.sha256 if log.source else "",
            "findings": list(found),
            "svg": inline_svg(plot_channels(log, found), f"channels of run {k}, {log.name}"),
        }
        for k, (log, found) in enumerate(audits, 1)
    ]
    write_html(
        path,
        "check.html",
        verdict=check_verdict(audits, target),
        critical=must_be_repaired(audits, target),
        runs=runs,
        effects=_effects(audits, excited),
    )


def _effects(audits: Audits, excited: Sequence[Excited]) -> list[dict[str, Any]]:
    """Of each effect: what the runs do together, what each does, what is lacking and to do."""
    beside = 1 < len(audits) <= MOST_BESIDE
    by_run = [{one.effect: EXCITED[one.excited] for one in found.excited} for _, found in audits]
    return [
        {
            "name": one.effect,
            "together": EXCITED[one.excited],
            "runs": [run.get(one.effect, "–") for run in by_run] if beside else [],
            "said": one.said,
        }
        for one in excited
    ]
