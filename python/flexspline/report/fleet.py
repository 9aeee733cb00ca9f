"""A fleet as text and HTML: what joints have in common, who stands out, and a page for each."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexspline.about import __version__
from flexspline.errors import listed
from flexspline.fleet.accumulators import DIFFERENCES
from flexspline.formatting import (
    blocks_text,
    lowered,
    padded,
    percent,
    plus_minus,
    rows_text,
    short,
    table_html,
)
from flexspline.plot.canvas import Panel, own_style
from flexspline.report.html import ReportFigure, drawn, write_html
from flexspline.report.text import TARGET_WORDS, wrapped
from flexspline.tracking.result import day, in_unit, spoken

if TYPE_CHECKING:
    from flexspline.fleet.each_joint import (
        FleetComparison,
        FleetDiscovery,
        UnitComparison,
        UnitDiscovery,
    )
    from flexspline.fleet.result import FleetFit, FleetResult, UnitFit
    from flexspline.tracking.fleet import FleetTrack

__all__ = [
    "PageOf",
    "Section",
    "comparison_of_fleet_html",
    "comparison_of_fleet_text",
    "discovery_of_fleet_html",
    "discovery_of_fleet_text",
    "fleet_html",
    "fleet_summary",
    "fleet_text",
    "page_names",
    "track_of_fleet_html",
    "track_of_fleet_text",
    "write_comparison_of_fleet",
    "write_discovery_of_fleet",
    "write_fleet_report",
    "write_page",
    "write_track_of_fleet",
]

Row = tuple[str, ...]

MOST_SHOWN = 12  # rows of a list in a text; pages have them all
MOST_HELD_OUT = 50  # rows of that table in a page, the worst first
HELD_OUT = (
    "The last run of each joint with several was held out, and all made again without these. "
    "Errors are RMS of the model alone: what a fit to the held-out run itself leaves is taken off."
)
SPREAD = (
    "Mean with its standard error; spread: standard deviation between joints, with its 95 % "
    "interval; between runs: of one joint. Joints that stand out in a parameter are not among "
    "those behind its mean and spread."
)
OUT = (
    "In the long run at most one in twenty of those told is a joint like the others (false "
    "discovery rate 5 %). p is the chance of such a value given the others' mean, spread, and this "
    "joint's own error."
)
DIFFERS = "What these fits differ in from flexspline.fit: " + "; ".join(DIFFERENCES) + "."


@dataclass(frozen=True)
class Section:
    """A part of a page: sentences, a table whose first row is its head, figures.

    `links`: where the first cell of a row leads to, by its text. `words`: columns of words.
    """

    id: str
    title: str
    sentences: Sequence[str] = ()
    rows: Sequence[Row] = ()
    figures: Sequence[ReportFigure] = ()
    links: dict[str, str] = field(default_factory=dict)
    words: Sequence[int] = (0,)


@dataclass(frozen=True)
class PageOf:
    """A page: what stands on top, verdict and sections. `back`: a link and its words."""

    over: str
    title: str
    verdict: Sequence[str]
    critical: bool
    sections: Sequence[Section]
    call: str = ""
    back: tuple[str, str] | None = None


def write_page(page: PageOf, path: str | os.PathLike[str]) -> None:
    """Write a self-contained page, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    write_html(path, "fleet.html", page=page)


def page_names(joints: Sequence[str]) -> dict[str, str]:
    """Return the file of each joint's page below the folder of the report."""
    names: dict[str, str] = {}
    for joint in joints:
        stem = re.sub(r"[^\w.-]", "_", joint).strip(".") or "joint"
        taken, number = stem, 2
        while f"units/{taken}.html" in names.values():
            taken, number = f"{stem}_{number}", number + 1
        names[joint] = f"units/{taken}.html"
    return names


def fleet_text(made: FleetFit) -> str:
    """Return what `print(fleet)` shows."""
    blocks = [
        _lines(_verdict(made)),
        [rows_text(_parameter_rows(made), (0, 1))],
        [rows_text(_outlying_rows(made)[: MOST_SHOWN + 1], (0, 1, 5)), *_more(made)]
        if made.outlying
        else [],
        _lines(_held_sentences(made)),
        _lines(_single(made)),
        _lines(_left_sentences(made)),
    ]
    return blocks_text(blocks)


def fleet_summary(made: FleetFit) -> str:
    """Return the same, with a table of all joints and all that was left out."""
    blocks = [
        fleet_text(made),
        rows_text(_joint_rows(made)),
        "\n".join(_lines([f"{what}: {why}" for what, why in made.failed])),
        "\n".join(_lines([DIFFERS])),
    ]
    return "\n\n".join(block for block in blocks if block)


def fleet_html(made: FleetFit) -> str:
    """Return a fleet as a fragment of HTML without scripts, for notebooks."""
    verdict = _verdict(made)
    said = [*verdict[1:], *_held_sentences(made), *_left_sentences(made)]
    return table_html(verdict[0], _parameter_rows(made), said)


@own_style()
def write_fleet_report(made: FleetFit, folder: str | os.PathLike[str]) -> None:
    """Write `report.html`, and a page for each joint in `units`."""
    from flexspline.plot.fleet import population_panels

    pages = page_names([unit.name for unit in made.units])
    sections = [
        Section("parameters", "Parameters", [SPREAD, *_pilot(made)], _parameter_rows(made),
                words=(0, 1)),
        Section("outlying", "Joints that stand out", [OUT if made.outlying else NOBODY],
                _outlying_rows(made) if made.outlying else (), links=pages, words=(0, 1, 5)),
        Section("figures", "Joints beside the fleet",
                figures=[drawn(panel) for panel in population_panels(made)]),
        Section("joints", "Joints",
                ["Values given the fleet, with standard errors; those of joints that stand out are "
                 "their own."], _joint_rows(made), links=pages),
        *_held_section(made),
        _left_out(_left_sentences(made, short_list=False), "Nothing: every run was used."),
        Section("how", "How far this is from a fit of each joint", [DIFFERS]),
    ]  # fmt: skip
    verdict = [*_verdict(made), *_held_sentences(made)]
    title = f"{len(made.units)} joints, {TARGET_WORDS[made.plan.target]}"
    _write_overview(
        folder, "fit of a fleet", title, verdict, bool(made.outlying), sections, _call(made)
    )
    for unit in made.units:
        _write_unit(made, unit, Path(folder) / pages[unit.name])


def _write_unit(made: FleetFit, unit: UnitFit, path: Path) -> None:
    from flexspline.plot.fleet import joint_among_others

    look = (
        "How far each parameter is from the mean of the others, over what is to be expected of "
        "spread and errors: beyond ±2 lies one value in twenty of joints like the others."
    )
    figure = Panel(partial(joint_among_others, made, unit), look, 1.6 + 0.3 * len(made.parameters))
    out = [made.parameters[k] for k in np.flatnonzero(unit.outlying)]
    said = (
        f"{unit.name} stands out in {listed(out)}: its own values are kept."
        if out
        else f"{unit.name} is a joint like the others."
    )
    runs = f"{len(unit.runs)} run{'s' if len(unit.runs) > 1 else ''}, {_minutes(unit.seconds)}"
    unknown = [made.parameters[k] for k in np.flatnonzero(~unit.own.determined)]
    told = (
        [f"Its runs do not tell {listed(unknown)} by themselves: that is the fleet's."]
        if unknown
        else []
    )
    sections = [
        Section("values", "Values", [
            "Own: the fit of its runs alone. Given the fleet: shrunk towards the others' mean by "
            "as much as its own runs do not know.", *told], _unit_rows(made, unit), words=(0, 1)),
        Section("figure", "Among the others", figures=[drawn(figure)]),
        Section("runs", "Runs", rows=_run_rows(made, unit), words=(0, 1, 6)),
    ]  # fmt: skip
    verdict = [said, f"{runs}; the fit leaves {padded(unit.rmse)} {made.plan.unit} RMS."]
    _write_joint(len(made.units), unit.name, verdict, bool(out), sections, path)


def _left_out(said: Sequence[str], nothing: str) -> Section:
    return Section("left", "What was left out", said or [nothing])


def _write_overview(
    folder: str | os.PathLike[str],
    what: str,
    title: str,
    verdict: Sequence[str],
    critical: bool,
    sections: Sequence[Section],
    call: str = "",
) -> None:
    """Write the page of the whole fleet; `what` it is of."""
    over = f"flexspline {__version__} · {what}"
    write_page(PageOf(over, title, verdict, critical, sections, call), Path(folder) / "report.html")


def _write_joint(
    joints: int,
    name: str,
    verdict: Sequence[str],
    critical: bool,
    sections: Sequence[Section],
    path: Path,
) -> None:
    """Write the page of one of so many joints, with a link to that of the fleet."""
    over = f"flexspline {__version__} · one of {joints} joints"
    back = ("../report.html", "The fleet")
    write_page(PageOf(over, name, verdict, critical, sections, back=back), path)


NOBODY = "No joint stands out."


def _verdict(made: FleetFit) -> list[str]:
    runs = sum(len(unit.runs) for unit in made.units)
    hours = _minutes(sum(unit.seconds for unit in made.units))
    what = TARGET_WORDS[made.plan.target]
    first = f"Fleet of {len(made.units)} joints, {runs} runs, {hours}, {what}."
    joints = list(dict.fromkeys(one.joint for one in made.outlying))
    if not joints:
        return [first, NOBODY]
    verb = "stands" if len(joints) == 1 else "stand"
    return [first, f"{len(joints)} {verb} out: {listed(joints, MOST_SHOWN)}."]


def _minutes(seconds: float) -> str:
    if seconds < 600.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 2e4 else f"{seconds / 3600.0:.0f} h"


def _pilot(made: FleetFit) -> list[str]:
    said = [_sentence(made.plan.pilot)] if made.plan.pilot else []
    return [*said, *_single(made)]


def _single(made: FleetFit) -> list[str]:
    """What one run of each joint leaves open."""
    if np.isfinite(made.run_spread).any():
        return []
    return [
        "No joint has two runs that tell how much parameters differ between runs, by temperature "
        "or mounting: spread and joints that stand out may hold some of that."
    ]


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _parameter_rows(made: FleetFit) -> list[Row]:
    rows: list[Row] = [("parameter", "unit", "mean", "spread", "95 %", "between runs", "joints")]
    for k, margin in enumerate(made.population.margins):
        low, high = margin.spread_interval
        rows.append(
            (
                made.parameters[k],
                made.plan.units[k],
                plus_minus(margin.mean, margin.mean_error),
                short(margin.spread, 2),
                f"{short(low, 2)} … {short(high, 2)}",
                short(float(made.run_spread[k]), 2),
                str(margin.units),
            )
        )
    return rows


def _outlying_rows(made: FleetFit) -> list[Row]:
    rows: list[Row] = [("joint", "parameter", "own", "others", "p", "unit")]
    for one in made.outlying:
        p = "< 0.0001" if one.p < 1e-4 else f"{one.p:.2g}"
        expected = plus_minus(one.expected, one.expected_error)
        own = plus_minus(one.value, one.error)
        rows.append((one.joint, one.parameter, own, expected, p, one.unit))
    return rows


def _more(made: FleetFit) -> list[str]:
    rest = len(made.outlying) - MOST_SHOWN
    return [f"… and {rest} more"] if rest > 0 else []


def _joint_rows(made: FleetFit) -> list[Row]:
    heads = [
        f"{name} [{unit}]" if unit not in ("", "1") else name
        for name, unit in zip(made.parameters, made.plan.units, strict=True)
    ]
    rows: list[Row] = [("joint", "runs", "time", f"RMSE [{made.plan.unit}]", *heads)]
    for unit in made.units:
        values = [
            plus_minus(float(value), float(error)) + (" !" if out else "")
            for value, error, out in zip(
                unit.shrunken.values, unit.shrunken.errors, unit.outlying, strict=True
            )
        ]
        rows.append(
            (unit.name, str(len(unit.runs)), _minutes(unit.seconds), padded(unit.rmse), *values)
        )
    return rows


def _unit_rows(made: FleetFit, unit: UnitFit) -> list[Row]:
    rows: list[Row] = [("parameter", "unit", "own", "given the fleet", "others", "p")]
    for k, name in enumerate(made.parameters):
        own = (
            plus_minus(float(unit.own.values[k]), float(unit.own.errors[k]))
            if unit.own.determined[k]
            else "–"
        )
        given = plus_minus(float(unit.shrunken.values[k]), float(unit.shrunken.errors[k]))
        others = plus_minus(float(unit.expected[k]), float(unit.expected_error[k]))
        p = "–" if not np.isfinite(unit.p[k]) else f"{unit.p[k]:.2g}"
        rows.append((name, made.plan.units[k], own, given, others, p))
    return rows


def _run_rows(made: FleetFit, unit: UnitFit) -> list[Row]:
    rows: list[Row] = [
        ("run", "date", "rows", "time", f"RMSE [{made.plan.unit}]", "temperature [°C]", "remarks")
    ]
    for run in unit.runs:
        date = "–" if run.date is None else run.date.isoformat(sep=" ", timespec="minutes")
        warm = "–" if run.temperature is None else f"{run.temperature:.1f}"
        said = "; ".join(run.remarks) or "–"
        rows.append(
            (run.run, date, str(run.rows), _minutes(run.seconds), padded(run.rmse), warm, said)
        )
    return rows


def _held_sentences(made: FleetFit) -> list[str]:
    held = made.held_out
    if held is None:
        return []
    label, separate, shrunken, mean = held.worst
    unit = made.plan.unit
    return [
        f"On {len(held.runs)} held-out runs the model alone errs by {padded(held.separate)} {unit} "
        f"with each joint's own fit, {padded(held.shrunken)} {unit} given the fleet, "
        f"{padded(held.mean)} {unit} with the fleet's mean (RMS; what a fit to the run itself "
        f"leaves is taken off). Worst given the fleet is {label}: {padded(separate)}, "
        f"{padded(shrunken)}, {padded(mean)} {unit}."
    ]


def _held_section(made: FleetFit) -> list[Section]:
    held = made.held_out
    if held is None:
        return []
    unit = made.plan.unit
    rows: list[Row] = [("run", "rows", "time of the others", f"own fit [{unit}]",
                        f"given the fleet [{unit}]", f"fleet's mean [{unit}]")]  # fmt: skip
    worst = sorted(held.runs, key=lambda run: -run[4])
    for label, count, seconds, *errors in worst[:MOST_HELD_OUT]:
        rows.append((label, str(count), _minutes(seconds), *map(padded, errors)))
    rest = len(worst) - MOST_HELD_OUT
    said = [HELD_OUT, *([f"The {MOST_HELD_OUT} worst of {len(worst)}."] if rest > 0 else [])]
    return [Section("held_out", "Held-out runs", said, rows)]


def _left_sentences(made: FleetFit, short_list: bool = True) -> list[str]:
    most = MOST_SHOWN if short_list else len(made.failed)
    said = _failed(made.failed[:most], ())
    rest = len(made.failed) - most
    return [*said, *([f"… and {rest} more left out."] if rest > 0 else []), *made.remarks]


def _lines(sentences: Sequence[str]) -> list[str]:
    return [line for sentence in sentences for line in wrapped(sentence)]


def _call(made: FleetFit) -> str:
    plan = made.plan
    effects = ", ".join(repr(each) for each in plan.effects)
    given = [f"[{effects}]"]
    for name in ("known_load", "lowpass", "bandwidth"):
        if getattr(plan, name) is not None:
            given.append(f"{name}={getattr(plan, name)!r}")
    if plan.fixed or plan.held_shapes:
        given.append(f"fixed={ ({**plan.fixed, **plan.held_shapes})!r}")
    if plan.own:
        given.append(f"per_run={list(plan.own)!r}")
    lines = "".join(f"    {each},\n" for each in ["folders", repr(plan.target), *given])
    return f"from flexspline import effect\nfleet = flexspline.fleet.fit(\n{lines})"


def discovery_of_fleet_text(made: FleetDiscovery) -> str:
    """Return what `print(discovery)` of a fleet shows."""
    return _as_text(
        made,
        _discovered(made),
        rows_text(_name_rows(made)) if made.names else "",
        rows_text(_looked_rows(made)[: MOST_SHOWN + 1], (0, 1)),
    )


def discovery_of_fleet_html(made: FleetDiscovery) -> str:
    """Return it as a fragment of HTML."""
    rows = _name_rows(made) if made.names else _looked_rows(made)
    return _as_html(made, _discovered(made), rows)


@own_style()
def write_discovery_of_fleet(made: FleetDiscovery, folder: str | os.PathLike[str]) -> None:
    """Write `report.html`, and a page for each joint in `units`."""
    pages = page_names([unit.name for unit in made.units])
    sections = [
        Section("names", "Names", [NAMES] if made.names else ["Nothing is found in any joint."],
                _name_rows(made) if made.names else (), words=(0, 6)),
        Section("joints", "Joints", [EACH_JOINT], _looked_rows(made), links=pages, words=(0, 1)),
        _left_out(_failed(made.failed, made.remarks), "Nothing: every joint was looked at."),
    ]  # fmt: skip
    title = f"What {len(made.units)} joints lack, {TARGET_WORDS[made.target]}"
    _write_overview(
        folder, "discovery in a fleet", title, _discovered(made), bool(made.names), sections
    )
    for unit in made.units:
        _write_discovered(made, unit, Path(folder) / pages[unit.name])


def _write_discovered(made: FleetDiscovery, unit: UnitDiscovery, path: Path) -> None:
    base, final, floor = unit.rmse
    found = listed(f"{name} ({sure:.0%})".replace("%", " %") for name, sure in unit.found.items())
    verdict = [
        f"{unit.name} lacks {found}." if unit.found else f"{unit.name} lacks nothing by name.",
        f"Held-out RMSE {' to '.join(lowered(base, final))} {made.unit}, noise floor "
        f"{padded(floor)} {made.unit}; {len(unit.runs)} runs.",
    ]
    rows: list[Row] = [("effect", "where", "confidence", f"RMSE before [{made.unit}]", "after",
                        "explains as well", "evidence")]  # fmt: skip
    for one in unit.content["found"]:
        rows.append(
            (one["effect"], one["where"], f"{one['confidence']:.2f}",
             *lowered(one["rmse_before"], one["rmse_after"]), listed(one["indistinguishable_from"])
             if one["indistinguishable_from"] else "–", one["evidence"])
        )  # fmt: skip
    values: list[Row] = [("parameter", "unit", "value")]
    for one in unit.content["parameters"]:
        error = float("nan") if one["standard_error"] is None else one["standard_error"]
        values.append((one["name"], one["unit"], plus_minus(one["value"], error)))
    left = unit.content["unexplained"]
    said = [
        f"Structure is left that no effect explains: {left['share_of_variance']:.0%} of the gap, "
        f"carried by {listed(left['depends_on'])}."
    ] if left else []  # fmt: skip
    said += [str(fault["name"]) for fault in unit.content["data_faults"]]
    said += [unit.content["next_experiment"]] if unit.content["next_experiment"] else []
    sections = [
        Section("found", "Found", rows=rows if len(rows) > 1 else (), words=(0, 1, 5, 6)),
        Section("left", "What else there is to say", said or ["Nothing."]),
        Section("values", "The extended model", rows=values, words=(0, 1)),
    ]
    _write_joint(len(made.units), unit.name, verdict, bool(unit.found), sections, path)


NAMES = (
    "In how many joints each name is found, and the share of such joints that have it (95 % "
    "interval). Confidence: median over these joints, of each by itself, and given in how many "
    "the name is found. Small: joints in which it is real but too small to matter. As well: "
    "joints in which it explains the runs as well as a name that is found."
)
EACH_JOINT = "Held-out errors of each joint, the worst first."


def _discovered(made: FleetDiscovery) -> list[str]:
    base, final, floor = made.rmse
    total = len(made.units)
    whole = [name.effect for name in made.names if len(name.joints) == total]
    some = [
        f"{name.effect} in {len(name.joints)} ({listed(name.joints, 4)})"
        for name in made.names
        if len(name.joints) < total
    ]
    first = f"All {total} joints lack {listed(whole)}."
    first = first if whole else f"No name is found in all {total} joints."
    said = [first, *([f"Only some: {'; '.join(some)}."] if some else [])]
    if made.unexplained:
        said.append(
            f"In {len(made.unexplained)} of them structure is left that no effect explains: "
            f"{listed(made.unexplained, 6)}."
        )
    unit = made.unit
    return [
        *said,
        f"Held-out RMSE {' to '.join(lowered(base, final))} {unit}, noise floor {padded(floor)} "
        f"{unit}, RMS over joints.",
    ]


def _name_rows(made: FleetDiscovery) -> list[Row]:
    rows: list[Row] = [("effect", "joints", "share", "95 %", "confidence", "given the fleet",
                        "which", "small in", "as well in")]  # fmt: skip
    for name in made.names:
        which = "all" if len(name.joints) == len(made.units) else listed(name.joints, 4)
        rows.append(
            (
                name.effect,
                f"{len(name.joints)} of {len(made.units)}",
                percent(name.share),
                f"{percent(name.share_low)} … {percent(name.share_high)}",
                f"{np.median(name.confidences):.2f}",
                f"{np.median(name.pooled):.2f}",
                which,
                str(len(name.seen)),
                str(len(name.indistinguishable)),
            )
        )
    return rows


def _looked_rows(made: FleetDiscovery) -> list[Row]:
    unit = made.unit
    rows: list[Row] = [("joint", "found", "runs", f"RMSE base [{unit}]", f"extended [{unit}]",
                        f"noise floor [{unit}]")]  # fmt: skip
    for one in sorted(made.units, key=lambda each: -each.rmse[1]):
        found = ", ".join(one.found) or "–"
        rows.append((one.name, found, str(len(one.runs)), *map(padded, one.rmse)))
    return rows


def comparison_of_fleet_text(made: FleetComparison) -> str:
    """Return what `print(comparison)` of a fleet shows."""
    table = rows_text(_compared_rows(made)[: MOST_SHOWN + 1], (0, 5))
    return _as_text(made, _compared(made), table)


def comparison_of_fleet_html(made: FleetComparison) -> str:
    """Return it as a fragment of HTML."""
    return _as_html(made, _compared(made), _compared_rows(made))


@own_style()
def write_comparison_of_fleet(made: FleetComparison, folder: str | os.PathLike[str]) -> None:
    """Write `report.html`, and a page for each joint in `units`."""
    pages = page_names([unit.name for unit in made.units])
    follows: list[Row] = [("follows", "joints", "which", "share of the gap, median")]
    for words, joints in made.follows.items():
        shares = [unit.follows[words] for unit in made.units if words in unit.follows]
        share = percent(min(float(np.median(shares)), 1.0))
        follows.append((words, f"{len(joints)} of {len(made.units)}", listed(joints, 6), share))
    sections = [
        Section("follows", "What the gap follows",
                [] if made.follows else ["In no joint it follows anything that was measured."],
                follows if made.follows else (), words=(0, 2)),
        Section("joints", "Joints", ["The worst first; excess is over the noise floor."],
                _compared_rows(made), links=pages, words=(0, 5)),
        _left_out(_failed(made.failed, made.remarks), "Nothing: every joint was compared."),
    ]  # fmt: skip
    title = f"{len(made.units)} joints and a model, {made.target.replace('_', ' ')}"
    _write_overview(
        folder, "comparison of a fleet", title, _compared(made), bool(made.follows), sections
    )
    for unit in made.units:
        _write_compared(made, unit, Path(folder) / pages[unit.name])


def _write_compared(made: FleetComparison, unit: UnitComparison, path: Path) -> None:
    rows: list[Row] = [("", "band", "rows", f"RMSE [{made.unit}]", "noise floor", "excess")]
    for name, bands in unit.content.items():
        if not (isinstance(bands, list) and bands and "noise_floor_error" in bands[0]):
            continue
        worst = max(bands, key=lambda band: float(band["excess"] or 0.0))
        rows.append((name.replace("_", " "), str(worst["label"]), str(worst["rows"]),
                     *(padded(float(worst[key] or 0.0))
                       for key in ("rmse", "noise_floor", "excess"))))  # fmt: skip
    sections = [Section("worst", "Worst bands", rows=rows, words=(0, 1))]
    said = [str(sentence) for sentence in unit.content["sentences"]]
    _write_joint(len(made.units), unit.name, said, bool(unit.follows), sections, path)


def _compared(made: FleetComparison) -> list[str]:
    unit, worst = made.unit, made.worst
    said = [
        f"The gap between measured and modelled {made.target.replace('_', ' ')} of "
        f"{len(made.units)} joints is {padded(made.rmse)} {unit} RMS against a noise floor of "
        f"{padded(made.noise_floor)} {unit}.",
        f"Worst is {worst.name}: {padded(worst.rmse)} {unit}, noise floor "
        f"{padded(worst.noise_floor)} {unit}.",
    ]
    first = [f"{words} in {len(joints)}" for words, joints in list(made.follows.items())[:4]]
    return [*said, f"It follows {'; '.join(first)} of {len(made.units)} joints."] if first else said


def _compared_rows(made: FleetComparison) -> list[Row]:
    unit = made.unit
    rows: list[Row] = [("joint", "rows", f"RMSE [{unit}]", "noise floor", "excess", "follows")]
    for one in sorted(made.units, key=lambda each: (-each.excess, -each.rmse)):
        sizes = (padded(one.rmse), padded(one.noise_floor), padded(one.excess))
        rows.append((one.name, str(one.rows), *sizes, ", ".join(one.follows) or "–"))
    return rows


CHANGES = (
    "Of each change the cause, since when (95 %), and what it has made by the last session. Over "
    "all joints and parameters together noise alone is told as a change once in ten years."
)


def track_of_fleet_text(made: FleetTrack) -> str:
    """Return what `print(track)` of a fleet shows."""
    shown = _change_rows(made)[: MOST_SHOWN + 1]
    return _as_text(made, [made.verdict], rows_text(shown, (0, 1, 2, 4)) if made.changed else "")


def track_of_fleet_html(made: FleetTrack) -> str:
    """Return it as a fragment of HTML."""
    rows = _change_rows(made) if made.changed else _tracked_rows(made)
    return _as_html(made, [made.verdict], rows)


@own_style()
def write_track_of_fleet(made: FleetTrack, folder: str | os.PathLike[str]) -> None:
    """Write `report.html`, and the track of each joint in `units`."""
    from flexspline.plot.tracking import fleet_panels

    pages = page_names([*made.tracks])
    dates = [f"{j}: {f.sentence}" for j, one in made.tracks.items() for f in one.forecasts
             if f.date is not None]  # fmt: skip
    sections = [
        Section("changes", "What changed", [CHANGES] if made.changed else ["No change is told."],
                _change_rows(made) if made.changed else (), links=pages, words=(0, 1, 2, 4)),
        *([Section("dates", "When limits are reached", dates)] if dates else []),
        *([Section("figures", "Over time", figures=[drawn(panel) for panel in fleet_panels(made)])]
          if made.changed else []),
        Section("joints", "Joints", ["Those that changed first."], _tracked_rows(made),
                links=pages, words=(0, 1, 3, 4)),
        _left_out(_failed(made.failed, made.remarks), "Nothing: every run was used."),
    ]  # fmt: skip
    title = f"{len(made.tracks)} joints over time, {TARGET_WORDS[made.fit.plan.target]}"
    changed = bool(made.changed)
    _write_overview(folder, "track of a fleet", title, [made.verdict], changed, sections)
    for name, one in made.tracks.items():
        one.report(Path(folder) / pages[name])


def _change_rows(made: FleetTrack) -> list[Row]:
    """A row for each change, the surest joint first."""
    rows: list[Row] = [("joint", "cause", "since", "size by the last session", "needs")]
    for name, changes in made.changed.items():
        for one in changes:
            first, last = (day(each) for each in one.between)
            since = f"{day(one.date)} ({first} to {last})" if first != last else day(one.date)
            size = in_unit(plus_minus(one.size, one.error), one.unit)
            causes = " or ".join(map(spoken, one.causes))
            rows.append((name, causes, since, size, one.needs or "–"))
    return rows


def _tracked_rows(made: FleetTrack) -> list[Row]:
    rows: list[Row] = [("joint", "state", "sessions", "first", "last")]
    for name in (*made.changed, *made.quiet, *made.unknown):
        history = made.tracks[name].history
        ends = (day(history.dates[k].astype("datetime64[s]").item()) for k in (0, -1))
        told = "changed" if name in made.changed else "quiet"
        told = "not known yet" if name in made.unknown else told
        rows.append((name, told, str(len(history)), *ends))
    return rows


def _as_text(made: FleetResult, said: Sequence[str], *tables: str) -> str:
    left = _lines(_failed(made.failed, made.remarks))
    return blocks_text([_lines(said), *([table] if table else [] for table in tables), left])


def _as_html(made: FleetResult, said: Sequence[str], rows: Sequence[Row]) -> str:
    return table_html(said[0], rows, [*said[1:], *_failed(made.failed, made.remarks)])


def _failed(failed: Sequence[tuple[str, str]], remarks: Sequence[str]) -> list[str]:
    return [*(f"Left out: {what}: {why.rstrip('.')}." for what, why in failed), *remarks]
