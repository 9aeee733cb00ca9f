"""A discovery as text and as HTML: what was missing, why, and by how much the gap shrank."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from flexspline.comparison.result import sentences as gap_sentences
from flexspline.discovery.candidates import EXCLUDED, TAKEN
from flexspline.discovery.result import BY_ENCODER, BY_FUNCTIONS, BY_MODE, BY_NAMES, BY_RUN
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.slices import telling
from flexspline.effects.causes import FRICTION_BY_DIRECTION
from flexspline.errors import listed
from flexspline.formatting import decimals_for, lowered, padded, percent, plus_minus, short
from flexspline.least_squares.ripple import part_of_a_turn
from flexspline.plot.canvas import own_style
from flexspline.report.html import (
    bandwidth_given,
    model_facts,
    orders_given,
    templates,
    used_logs,
    write_html,
)
from flexspline.report.tables import input_rows
from flexspline.report.text import (
    TARGET_WORDS,
    ParameterLine,
    known_groups,
    known_text,
    parameter_lines,
)

if TYPE_CHECKING:
    from flexspline.discovery.faults import DataFault
    from flexspline.discovery.result import Discovery, Found, Motion
    from flexspline.discovery.slices import Slice

__all__ = ["discovery_html", "discovery_text", "remarks", "verdict", "write_discovery_report"]

WIDTH = 100
TERMINAL = 79  # of the rows of a table, which read badly where a terminal breaks them
MAP = (
    "RMS of measured − predicted on folds that no fit saw (line{after}) in each band against the "
    "noise floor there (grey, with two standard errors). What lies between is the excess, "
    "coloured, and a dot marks an excess that is more than chance. All panels have the same "
    "scale; what the gap follows comes first. Hatched: fewer than 2 % of the rows{arrow}. "
    "Triangles: orders that are more than chance, each with the amplitude of a fit."
)
PLAN = (
    "What to command over time, as next_experiment.csv holds it, and how far apart the rivals are "
    "expected to stand after this run if the named one is right, beside now and the best run of "
    "each simple kind. The bars are for exact forms: where the form of the named one may be off by "
    "what the other explains, the text does not tell the two apart beyond the line either."
)

MOST_RIVALS = 3
OF_OUTPUT = "output_on_housing"
LIKELY = 0.5  # confidence from which a name is more likely right than wrong
CRITICAL = "Faults of the data, to be fixed first"
LEFT_OUT = "Left out of the runs, before anything was searched"
SMALL = "Seen in the data, too little to matter here"

_TITLES = {
    "all": "all",
    "run": "by run",
    "reversals": "at reversals and away from them",
    "direction": "by direction",
    "speed": "by speed",
    "temperature": "cold to hot",
    "load": "unloaded to loaded",
    "frequency": "by frequency, slow to fast",
    "order": "by order per output turn, one way at half the top speed or more",
}


def discovery_text(made: Discovery) -> str:
    """Return what `print(discovery)` shows."""
    blocks = [_wrapped(verdict(made))]
    for title, sentences in faults_told(made):
        blocks.append("\n".join([f"{title}:", *(_wrapped(said, "- ") for said in sentences)]))
    blocks += [_one(made, number, one) for number, one in enumerate(made.found, 1)]
    blocks += ["\n".join(known)] if (known := known_text(made.fit, made.names)) else []
    blocks += [_wrapped(sentence) for sentence in remarks(made)]
    return "\n\n".join(blocks)


def discovery_html(made: Discovery) -> str:
    """Return a discovery as a fragment of HTML without scripts, for notebooks."""
    return templates().get_template("discovery_fragment.html").render(_common(made))


@own_style()
def write_discovery_report(made: Discovery, path: str | os.PathLike[str]) -> None:
    """Write a self-contained report, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.comparison import plot_comparison
    from flexspline.plot.discovery import panels
    from flexspline.report.html import ReportFigure, drawn, inline_svg

    where = made.disagreement
    chart = plot_comparison(where.before, where.after if made.found else None)
    write_html(
        path,
        "discovery.html",
        _common(made),
        title=str(made.model.facts.get("joint", f"What the {TARGET_WORDS[made.target]} lacks")),
        places=where_sentences(made),
        map=ReportFigure(inline_svg(chart, "map of the disagreement"), _map_caption(made)),
        figures=[drawn(panel) for panel in panels(made)],
        plan=None
        if made.plan is None
        else ReportFigure(inline_svg(made.plan.plot(), "run to record next"), PLAN),
        tables=shrunk_tables(made),
        channels=channel_rows(made),
        delay="",
        searched=searched_sentence(made),
        refused=refused_rows(made),
        estimator=estimator_sentence(made),
        lines=parameter_lines(made.fit),
        groups=known_groups(made.fit),
        logs=used_logs(made.fit),
        facts=model_facts(made.fit),
        call=discovery_call(made),
    )


def _map_caption(made: Discovery) -> str:
    if not made.found:
        return MAP.format(after="", arrow="")
    arrow = "; an arrow: the extended model's RMS where it is above the axes"
    return MAP.format(after="; blue: the extended model", arrow=arrow)


def _common(made: Discovery) -> dict[str, Any]:
    """What the fragment shows, and the report too."""
    return {
        "made": made,
        "verdict": verdict(made),
        "remarks": remarks(made),
        "faults": faults_told(made),
        "headlines": headlines(made),
        "found": [
            {
                "one": one,
                "confidence": f"{100.0 * one.confidence:.0f} %",
                "errors": lowered(one.rmse_before, one.rmse_after),
                "lines": effect_lines(made, one),
                "rivals": best_rivals(made, one),
            }
            for one in made.found
        ],
        "critical": bool(made.unexplained and not _unexplained_is_small(made))
        or any(fault.grave for fault in made.data_faults),
    }


def _one(made: Discovery, number: int, one: Found) -> str:
    head = f"{number}. {one.effect}   confidence {100.0 * one.confidence:.0f} %   {one.where}"
    lines = [_wrapped(head, rest="   ", width=TERMINAL)]
    for line in effect_lines(made, one):
        name, value = line.name.removeprefix(f"{one.effect}."), f"{line.value} {line.unit}".rstrip()
        row = f"   {name:<24} {value}{f'   {line.remark}' if line.remark else ''}"
        lines.append(_wrapped(row, rest=" " * 28, width=TERMINAL))
    lines.append(_wrapped(one.evidence, "   "))
    if one.indistinguishable_from:
        also = listed(one.aliases)
        lines.append(_wrapped(f"These runs would be explained as well by {also}.", "   "))
    return "\n".join(lines)


def _wrapped(sentence: str, first: str = "", rest: str = "", width: int = WIDTH) -> str:
    return "\n".join(
        textwrap.wrap(
            sentence, width, initial_indent=first, subsequent_indent=rest or " " * len(first),
            break_long_words=False, break_on_hyphens=False,
        )
    )  # fmt: skip


def verdict(made: Discovery) -> str:
    """Return what was found, and by how much the gap shrank, in a sentence or two."""
    what = TARGET_WORDS[made.target]
    base = f"The model of the {what}"
    if made.by == "simulation":
        base += ", driven forward,"
    if made.simulated is not None:
        base = f"The simulation of the {what} ({made.simulated.words})"
        base += f" with {listed(made.base_effects)}" if made.base_effects else ""
    said = base[0].lower() + base[1:]
    where = f"on {made.validated_by} that no fit saw{_of_how_many(made)}"
    sided, without = _sided(made), made.without_directions
    if made.found:
        rmse = f"{' to '.join(lowered(made.base_rmse, made.final_rmse))} {made.unit}"
        both = f" Besides, {sided}; both errors are with that in the model." if sided else ""
        return f"{base} {_names_told(made)}: RMSE {rmse} {where}, {_floor_words(made)}.{both}"
    what, more = _nothing_named(made, said, " else" if sided else "")
    rmse = f"{padded(made.base_rmse)} {made.unit} {where}{more}"
    if not sided or without is None:
        return f"{what}: RMSE {rmse}."
    return (
        f"{what}: {sided}. With that in the model RMSE {rmse}; without it about "
        f"{padded(without)} {made.unit}."
    )


def _nothing_named(made: Discovery, said: str, other: str) -> tuple[str, str]:
    """Return what a search says that names nothing of a model, and what of its error.

    `other`: " else" where something is said beside it.
    """
    little, floor = _unexplained_is_small(made), f", {_floor_words(made)}"
    if made.unexplained and made.unexplained.differs:
        own = listed(made.unexplained.differs)
        return f"{said[0].upper()}{said[1:]} needs a size of {own} for each run", floor
    if made.unexplained and made.unexplained.rings:
        return f"{said[0].upper()}{said[1:]} lacks a mode at {made.unexplained.rings:.3g} Hz", floor
    if made.unexplained and not little:
        return f"No effect that is known explains what{other} {said} lacks", ""
    if made.doubted:
        return f"These runs do not tell what{other} {said} lacks, if anything", ""
    if little:
        unexplained = f", of which {_small(made)} {made.unit} is unexplained"
        return f"Nothing{other} that matters is missing in {said}", unexplained
    return (
        f"Nothing{other} is missing in {said} that these runs show",
        ", noise as far as their channels tell",
    )


def _sided(made: Discovery) -> str:
    """Return that friction differs between directions, where the error is much lower with that.

    It is no name, and the model has it all the same. What is negligible is that of a name.
    """
    told, without = _directions(made), made.without_directions
    if not told or without is None or without - made.final_rmse < SETTINGS.negligible * without:
        return ""
    return f"friction differs between directions ({listed(told)}, below)"


def _names_told(made: Discovery) -> str:
    """Return what is missing; a name that is more likely wrong than right may be missing.

    What closes most comes first, sure or not, and with what explains the runs as well.
    """
    found = made.found
    sure = [_or_alias(made, one) for one in found if _likely(one)]
    unsure = [
        f"{_or_alias(made, one)} at {100.0 * one.confidence:.0f} %"
        for one in found
        if not _likely(one)
    ]
    verbs = [("lacks", sure), ("may lack", unsure)]
    if not _likely(max(found, key=lambda one: one.share_of_gap)):
        verbs.reverse()
    told = [f"{verb} {listed(names, most=len(names))}" for verb, names in verbs if names]
    return ", and ".join(told)


def _likely(one: Found) -> bool:
    """Whether it, or what explains the runs as well and stands beside it, is likelier than not."""
    return one.confidence > LIKELY or (one.confidence == LIKELY and bool(one.aliases))


def _or_alias(made: Discovery, one: Found) -> str:
    """A name, and the one that explains the runs as well; of several the list below tells."""
    more = ["more orders"] if one.effect in made.base_orders else []
    alias = [f"or {one.aliases[0]}"] if len(one.aliases) == 1 else []
    return f"{one.effect} ({', '.join(more + alias)})" if more or alias else one.effect


def _unexplained_is_small(made: Discovery) -> bool:
    """Whether what is unexplained lowers the error by too little to matter."""
    if made.unexplained is None or made.floor.by == BY_NAMES:  # nothing says how large it is
        return False
    most = max(made.without_directions or 0.0, made.final_rmse)
    floor, left = made.noise_floor, made.final_rmse
    if left**2 - floor**2 < SETTINGS.bends * (most**2 - left**2):  # friction by direction is more
        return True
    return left - floor < SETTINGS.negligible * left


def _small(made: Discovery) -> str:
    """How much of the error is unexplained, where that is little."""
    least, left = SETTINGS.negligible * made.final_rmse, made.final_rmse - made.noise_floor
    return f"about {short(left)}" if left >= least else f"less than {short(least)}"


def _floor_words(made: Discovery) -> str:
    """How low that could get, for the headline."""
    if made.floor.by == BY_NAMES:
        told = "how much of that is noise is not known"
        return f"and {told if made.unexplained else 'no channel is seen to tell more that matters'}"
    most = "" if made.floor.by == BY_ENCODER else "at most "
    return f"noise floor {most}{padded(made.noise_floor)} {made.unit}"


def floor_sentence(made: Discovery) -> str:
    """Return what bounds the noise floor, and how well it is known."""
    folds = made.validated_by
    if made.floor.by == BY_ENCODER:
        return (
            f"Noise floor: {padded(made.noise_floor)} {made.unit} is what the encoder resolves; no "
            "simulation gets below it."
        )
    most = padded(made.floor.rmse)
    if np.isfinite(made.floor.error):
        most = plus_minus(made.floor.rmse, made.floor.error)
    if made.floor.by == BY_NAMES and made.unexplained:
        return (
            f"Noise: at most what is left, {most} {made.unit}. Each of these {folds} goes where no "
            "other goes: how much lower it is they do not tell."
        )
    if made.floor.by == BY_NAMES:
        return (
            f"Noise: at most what is left, {most} {made.unit}. Held out, neither functions of the "
            f"channels and pairs of them nor rows of other {folds} at the same place are seen to "
            f"explain {100.0 * SETTINGS.bends:.0f} % of the gap; what no channel follows counts as "
            "noise."
        )
    assert made.unexplained is not None
    by = listed(made.unexplained.depends_on)
    if made.floor.by == BY_RUN:
        differs = listed(made.unexplained.differs)
        return f"Noise floor: at most {most} {made.unit}, with a size of {differs} for each run."
    if made.floor.by == BY_MODE:
        return (
            f"Noise floor: at most {most} {made.unit}, without what follows {by} at "
            f"{made.unexplained.rings:.3g} Hz."
        )
    told = (
        f"functions of {by} leave" if made.floor.by == BY_FUNCTIONS
        else f"rows of other {folds} at the same {by} leave"
    )  # fmt: skip
    return f"Noise floor: at most {most} {made.unit}, which {told} on {folds} that no fit saw."


def where_sentences(made: Discovery) -> tuple[str, str]:
    """Return how large the gap is, and where; the floor there is as `floor_sentence` has it."""
    before = made.disagreement.before
    first, second = gap_sentences(before, of_bands_alone=False)
    if not before.follows and (made.found or made.unexplained):
        what, size = TARGET_WORDS[made.target], f"{padded(before.rmse)} {made.unit} RMS"
        first = f"The base misses the {what} by {size}."
        return first, "No channel alone is seen to locate that, band by band."
    if made.floor.by != BY_ENCODER:
        first = first.replace("a noise floor of", "a noise floor of at most")
    return first, second


def _of_how_many(made: Discovery) -> str:
    """How many of the rows that is, where some were left out, for the headline."""
    scored, total = _scored(made), sum(made.rows.values())
    return f" ({scored} of {total} rows)" if scored < total else ""


def _scored(made: Discovery) -> int:
    return sum(int(np.count_nonzero(run.counts)) for run in made.runs)


def rows_sentence(made: Discovery) -> str:
    """Return how many rows were left out, and why; "" where none was."""
    left = {why: count for why, count in made.rows.items() if why != "used"}
    if not left:
        return ""
    total = sum(made.rows.values())
    told = listed([f"{count} {why}" for why, count in left.items()])
    used = made.rows["used"]
    short_of = used - _scored(made)
    unscored = (
        f", {short_of} of them in stretches shorter than the noise's memory, which count in no RMSE"
        if short_of > 0
        else ""
    )
    return f"{used} of {total} rows were used{unscored}; left out: {told}."


def channel_rows(made: Discovery) -> list[tuple[str, ...]]:
    """Return channel with unit, noise, quantum, bandwidth, delay and how the rows read it."""
    late: dict[str, list[float]] = {}
    for fault in made.data_faults:
        if "delay" in fault.name:
            late.setdefault(fault.channel, []).append(fault.size)
    delays = {channel: float(np.median(sizes)) for channel, sizes in late.items()}
    return input_rows(made.inputs, made.fit.part.preparations, delays)


def inputs_sentence(made: Discovery) -> str:
    """Return how noisy channels were prepared for the rows; "" where none was."""
    ways = made.fit.part.preparations
    if not ways:
        return ""
    told = listed([f"{way.channel} {way.how}" for way in ways], most=len(ways))
    return f"Rows read {told}, zero phase, −3 dB there: what tells each best beside its noise."


def directions_sentence(made: Discovery) -> str:
    """Return how friction differs between directions, where the search gave it that freedom."""
    told = _directions(made)
    if not told:
        return ""
    return f"Friction differs between directions, forward less backward: {listed(told)}."


def _directions(made: Discovery) -> list[str]:
    """Return what of friction differs between directions and by how much, beyond two errors."""
    if FRICTION_BY_DIRECTION in made.base_effects:
        return []
    return [
        f"{p.name.split('.')[1]} by {plus_minus(2.0 * p.value, 2.0 * p.standard_error)} {p.unit}"
        for p in made.fit.parameters
        if p.name.startswith(f"{FRICTION_BY_DIRECTION}.") and abs(p.value) > 2.0 * p.standard_error
    ]


def also_seen_sentences(made: Discovery) -> list[str]:
    """Return a sentence for each effect that is real but too small to matter."""
    return [
        f"{one.effect}: {' to '.join(lowered(one.rmse_before, one.rmse_after))} {made.unit} held "
        f"out, {_share(one.share_of_gap)} of what closes (t = {one.t:.1f})"
        for one in made.also_seen
    ]


def _share(share: float) -> str:
    """A share with two digits where it is below 10 %, and never "1e+02 %"."""
    return f"{100.0 * share:.2g} %" if abs(share) < 0.095 else percent(share)


def faults_told(made: Discovery) -> list[tuple[str, list[str]]]:
    """Return the faults of the data under a heading each: rows left out, what matters, the others.

    What several runs share is told once, of the run where it is largest.
    """
    cut = [fault.sentence for fault in made.data_faults if fault.left_out]
    told = [(LEFT_OUT, cut)] if cut else []
    for title, critical in ((CRITICAL, True), (SMALL, False)):
        alike: dict[tuple[str, str], list[DataFault]] = {}
        for fault in (f for f in made.data_faults if f.grave is critical and not f.left_out):
            alike.setdefault((fault.name, fault.channel), []).append(fault)
        if alike:
            told.append((title, [_together(faults) for faults in alike.values()]))
    return told


def _together(faults: Sequence[DataFault]) -> str:
    worst = max(faults, key=lambda fault: abs(fault.size))
    others = [fault.run for fault in faults if fault is not worst]
    if not others:
        return worst.sentence
    less = "where it is no larger" if len(others) == 1 else "none of them larger"
    return f"{worst.sentence} The same in {listed(others)}, {less}."


def remarks(made: Discovery) -> list[str]:
    """Return what else has to be said: what is unexplained, what to record, what was not tried."""
    said = [
        *(f"Check before use: {sentence.rstrip('.')}." for sentence in made.warnings),
        unexplained_sentence(made),
        floor_sentence(made),
        vibrations_sentence(made),
        withdrawn_sentence(made),
        rejected_sentence(made),
        _also_seen(made),
        directions_sentence(made),
        rows_sentence(made),
        inputs_sentence(made),
        driven_sentence(made),
        estimator_sentence(made) if made.fit.generalised else "",
        part_of_a_turn_sentence(made),
        *(one.sentence for one in made.dependences),
        f"Next: {made.next_experiment}" if made.next_experiment else "",
        searched_sentence(made) if min(made.searched.values()) < 1.0 else "",
        *not_tried_sentences(made),
    ]
    return [sentence for sentence in said if sentence]


def part_of_a_turn_sentence(made: Discovery) -> str:
    """Return that orders of the output look alike where the runs cover no whole turn of it."""
    found = {one.effect for one in made.found}
    turning = [
        effect.name
        for effect in made.fit.part.effects
        if effect.name in found and any(pair == OF_OUTPUT for _, pair in effect.harmonics)
    ]
    said = part_of_a_turn([run.log for run in made.fit.runs], turning)
    return f"{said[0].upper()}{said[1:]}." if said else ""


APART = 10.0  # per cent, by which two shares of one gap seem to contradict each other


def unexplained_sentence(made: Discovery) -> str:
    """Return what is left that no effect explains, "" where nothing is."""
    if not made.unexplained:
        return ""
    share = 100.0 * made.unexplained.share_of_variance
    if made.unexplained.differs:
        names = made.unexplained.differs
        return (
            f"Unexplained: {share:.0f} % of the gap above the noise floor. No one size of "
            f"{listed(names)} suits all runs, as with another payload, mounting or zero in some: "
            f"fit a size for each run (--per-run {','.join(names)}), or give runs that are alike."
        )
    if made.unexplained.rings:
        return (
            f"Unexplained: {share:.0f} % of the gap above the noise floor. A mode at "
            f"{made.unexplained.rings:.3g} Hz rings where {made.unexplained.depends_on[0]} excites "
            "it. No effect of the catalogue does that: look at the arm of the load, the "
            "couplings and the bench, or move so smoothly that nothing there rings."
        )
    weighed = "" if made.by == "simulation" else " after prewhitening"
    what = f"{share:.0f} % of the gap above the noise floor{weighed}, depends on"
    if made.floor.by == BY_NAMES:  # nothing says how large that gap is
        what = f"what is left{weighed} depends on"
    if _unexplained_is_small(made):
        return (
            f"Unexplained: {_small(made)} {made.unit} of the error, too little to "
            f"matter, depends on {listed(made.unexplained.depends_on)}, in a way that no effect of "
            f"the catalogue is seen to have. That is {share:.0f} % of the little gap above the "
            f"noise floor{weighed}."
        )
    said = (
        f"Unexplained: {what} {listed(made.unexplained.depends_on)}, in a way that no effect of "
        "the catalogue is seen to have."
    )
    if made.floor.by != BY_NAMES and weighed:
        left = 1.0 - min(made.gap_closed, 1.0)
        if abs(100.0 * left - share) > APART:
            said += f" Not weighed so, {percent(left)} of the gap's mean square is left."
    return said


def vibrations_sentence(made: Discovery) -> str:
    """Return what stays at one frequency in what is left, "" where nothing does."""
    told = [
        f"{plus_minus(one.amplitude, one.error)} {made.unit} at {one.frequency:.4g} Hz"
        for one in made.vibrations
    ]
    if not told:
        return ""
    share = sum(one.amplitude**2 for one in made.vibrations) / (2.0 * made.final_rmse**2)
    return (
        f"What is left vibrates, whatever the speed: {listed(told)}, {percent(min(share, 1.0))} of "
        "its mean square. No effect of a joint does that, and it counts as noise: look at the "
        "mains, a fan, the controller and the structure."
    )


def withdrawn_sentence(made: Discovery) -> str:
    """Return which names were withdrawn, and why."""
    withdrawn = ", ".join(f"{name} ({why})" for name, why in made.withdrawn.items())
    return f"Withdrawn: {withdrawn}." if withdrawn else ""


def rejected_sentence(made: Discovery) -> str:
    """Return which names are spurious: a flexible basis explains the data better."""
    if not made.doubted:
        return ""
    are = "are spurious" if len(made.doubted) > 1 else "is spurious"
    hold = "" if made.unexplained else " and does not hold on held-out rows"
    return (
        f"Rejected: {listed(made.doubted)}, which {are}: a flexible basis explains the data "
        f"better{hold}."
    )


def _also_seen(made: Discovery) -> str:
    if not made.also_seen:
        return ""
    told = listed(also_seen_sentences(made), most=len(made.also_seen))
    return f"Also seen, too small to matter and no part of the model: {told}."


def driven_sentence(made: Discovery) -> str:
    """Return how far the model misses the motion where it is driven forward."""
    if made.motion is None or not made.found or made.by == "simulation":
        return ""
    worse = ""
    if made.motion.final_rmse > made.motion.base_rmse:
        worse = ": the names do not make this better, for what a forward simulation misses adds up"
    return (
        f"Driven forward through {made.validated_by} that no fit saw, the model "
        f"misses the {_channel(made.motion)} by {_motion(made)} RMS{worse}."
    )


def refused_rows(made: Discovery) -> list[tuple[str, str]]:
    """Return the effects that gained and were not taken, and why, those that are spurious too."""
    spurious = dict.fromkeys(made.doubted, "spurious: a flexible basis explains the data better")
    return [*(dict(made.refused) | spurious).items()]


def not_tried_sentences(made: Discovery) -> list[str]:
    """Return the effects that were not tried, by the reason."""
    groups: dict[str, list[str]] = {EXCLUDED: [], TAKEN: [], "for lack of channels or facts": []}
    *_, lacking = groups.values()
    for name, reason in made.not_tried.items():
        groups.get(reason, lacking).append(name)
    return [
        f"Not tried, {why}: {listed(names, most=len(names))}."
        for why, names in groups.items()
        if names
    ]


def estimator_sentence(made: Discovery) -> str:
    """Return by which estimator the parameters were found."""
    if made.by == "simulation":
        return "Parameters are those whose simulated motion misses the measured one least."
    if not made.fit.generalised:
        return "Parameters are those of least squares."
    return (
        "Parameters are those of generalised least squares: the noise is slow, and its memory is "
        "counted in; plain least squares does not contradict them and predicts held-out rows no "
        "better."
    )


def searched_sentence(made: Discovery) -> str:
    """Return on which rows names and functions of a flexible basis were looked for."""
    names, functions = made.searched["names"], made.searched["functions"]
    if min(names, functions) >= 1.0:
        return "All rows that count were searched, for names and for what has none."
    first = (
        f"Of these long runs {_share(names)} of the rows, spread evenly, were searched for "
        "names first; what was found there was tried and fitted on all rows."
        if names < 1.0
        else "All rows that count were searched for names."
    )
    rest = _share(functions) if functions < 1.0 else "all"
    return f"{first} What no name explains was looked for on {rest} of the rows."


def headlines(made: Discovery) -> list[tuple[str, str]]:
    """Return the numbers that say how the gap shrank: what, and its value with the unit."""
    unit = made.unit
    base, final = lowered(made.base_rmse, made.final_rmse)
    rows = [("base model, RMSE held out", f"{base} {unit}")]
    if made.found:
        rows.append(("extended model, RMSE held out", f"{final} {unit}"))
    by, floor = made.floor.by, f"{padded(made.noise_floor)} {unit}"
    if by == BY_ENCODER:
        rows.append(("noise floor: what the encoder resolves", floor))
    else:
        rows.append(("noise floor, at most", f"what is left, {floor}" if by == BY_NAMES else floor))
    if made.found and by == BY_NAMES:
        closed = 1.0 - (made.final_rmse / made.base_rmse) ** 2
        rows.append(("mean square that the names take away", f"{100.0 * closed:.0f} %"))
    elif made.found and made.gap_closed == made.gap_closed:
        closed = min(made.gap_closed, 1.0)
        rows.append(
            ("gap above the floor that is closed", f"{100.0 * closed:.0f} % of its mean square")
        )
    if made.motion is not None and made.by != "simulation":
        rows.append((f"{_channel(made.motion)} of a forward simulation, RMSE", _motion(made)))
    return rows


def effect_lines(made: Discovery, one: Found) -> list[ParameterLine]:
    """Return a line for each parameter of one named effect, ripple as amplitude and phase."""
    own = {parameter.name for parameter in made.parameters(one.effect)}
    return [line for line in parameter_lines(made.fit, own) if line.effect == one.effect]


def best_rivals(made: Discovery, one: Found) -> list[tuple[str, str, str]]:
    """Return the best other candidates: name, share of what the named effect explains, verdict."""
    return [
        (
            rival.words,
            f"{100.0 * rival.share:.0f} %",
            f"indistinguishable: {rival.why(one.effect)}"
            if rival.alias
            else f"worse: {one.effect} keeps t = {rival.keeps:.1f}",
        )
        for rival in one.rivals[:MOST_RIVALS]
    ]


def shrunk_tables(made: Discovery) -> list[tuple[str, list[tuple[str, str, str, str, str]]]]:
    """Return the held-out errors by group: title, then label, rows, before, after and change."""
    decimals = decimals_for(made.final_rmse)
    return [
        (_TITLES[group], [_row(part, decimals) for part in members])
        for group, members in groupby(telling(made.slices), lambda part: part.group)
    ]


def discovery_call(made: Discovery) -> str:
    """Return the call that makes the discovery again from the same logs."""
    lines = [*_start_call(made), f"target={made.target!r}"]
    part = made.model.part(made.target)
    if part.known_load is not None:
        lines.append(f"known_load={part.known_load!r}")
    if made.fit.lowpass is not None:
        lines.append(f"lowpass={made.fit.lowpass!r}")
    lines += bandwidth_given(made.fit.bandwidth)
    base = [e for e in made.fit.part.effects if e.name in made.base_effects and e.harmonics]
    given = [e.with_orders(made.base_orders.get(e.name, e.harmonics)) for e in base]
    orders = {effect.name: orders_given(effect) for effect in given}
    if orders:
        lines.append(f"orders={orders!r}")
    fixed = {p.name: p.value for p in made.fit.parameters if p.state == "fixed"}
    if fixed:
        lines.append(f"fixed={fixed!r}")
    excluded = [name for name, why in made.not_tried.items() if why == EXCLUDED]
    if excluded:
        lines.append(f"exclude={excluded!r}")
    if made.by == "simulation":
        lines += ["by='simulation'", "controller=controller", "free_controller=free_controller"]
    return "found = flexspline.discover(\n" + "".join(f"    {x},\n" for x in lines) + ")"


def _start_call(made: Discovery) -> list[str]:
    """What to start from, and the logs."""
    if made.simulated is None:
        return [repr(list(made.base_effects)), "logs"]
    files = ["simulation=simulation"] if made.simulated.own_files else []
    first = "model" if made.base_effects else "None"
    return [first, "logs", *files, f"simulated_torque={made.simulated.column!r}"]


def _channel(motion: Motion) -> str:
    return motion.channel.replace("_", " ")


def _motion(made: Discovery) -> str:
    """The error of a forward simulation, before and after where something was found."""
    assert made.motion is not None
    base, final = lowered(made.motion.base_rmse, made.motion.final_rmse)
    return f"{base} to {final} {made.motion.unit}" if made.found else f"{base} {made.motion.unit}"


def _row(part: Slice, decimals: int) -> tuple[str, str, str, str, str]:
    change = 100.0 * (part.final / part.base - 1.0) if part.base > 0.0 else 0.0
    return (
        part.label,
        str(part.rows),
        f"{part.base:.{decimals}f}",
        f"{part.final:.{decimals}f}",
        f"{change + 0.0:+.0f} %" if round(change) else "0 %",
    )
