"""From what the residual follows to a `Comparison`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexspline.comparison.analysis import Analysis
from flexspline.comparison.bands import Band, bands_of, overall, peaks_of
from flexspline.comparison.locate import place_of
from flexspline.comparison.result import Comparison, Follows, Remembered
from flexspline.comparison.runs import Compared
from flexspline.comparison.search import ALPHA, ORDERS, Step

__all__ = ["assembled"]

TURNS = "what turns with the joint"
_ONCE = {"reversal_angle": "distance from reversals"}
_ONCE["reversal_time"] = _ONCE["reversal_angle"]


def assembled(compared: Compared, made: Analysis, facts: Mapping[str, Any]) -> Comparison:
    """Return the result."""
    shown = [covariate for covariate in made.covariates if covariate.shown]
    parts = made.rows, made.memory, made.found, made.test
    family = max(len(made.found.chances), 1)
    whole = overall(*parts)
    by = {c.name: tuple(bands_of(c, *parts, family)) for c in shown}
    turns = made.spectrum.analysis
    return Comparison(
        compared.what,
        compared.unit,
        compared.simulated,
        compared.lowpass,
        compared.runs,
        whole,
        by,
        {c.name: c.unit for c in shown},
        {c.name: c.words for c in shown},
        tuple(peaks_of(made.turning)),
        tuple(_follows(step, made, whole) for step in made.found.steps),
        _idle(made),
        _remembered(compared, made),
        compared.load_source,
        turns,
        dict(facts),
        compared.foreign,
        compared.notes,
        compared.inputs,
        compared.preparations,
        compared.bandwidth,
    )


def _follows(step: Step, made: Analysis, whole: Band) -> Follows:
    place = None
    words = TURNS
    if step.covariate is not None:
        place = place_of(step, made.test(step.covariate, made.found.rest))
        words = step.covariate.words
    names = {c.name: _ONCE.get(c.name, c.words) for c in made.covariates} | {ORDERS: TURNS}
    also = tuple(dict.fromkeys(names[n] for n in step.also if names[n] != names[step.name]))
    share = step.gain / whole.excess**2 if whole.excess > 0.0 else 0.0
    return Follows(step.name, words, step.gain, share, step.chance, also, place)


def _idle(made: Analysis) -> tuple[str, ...]:
    """What the residual does not follow, in words."""
    steps = made.found.steps
    busy = {step.name for step in steps} | {name for step in steps for name in step.also}
    level = ALPHA / max(len(made.found.chances), 1)
    busy |= {name for name, chance in made.found.chances.items() if chance < level}
    if "reversal_angle" in busy or "reversal_time" in busy:
        busy |= {"reversal_angle", "reversal_time"}
    busy |= {part for name in busy for part in name.split(" and ")}
    idle = [_ONCE.get(c.name, c.words) for c in made.covariates if c.shown and c.name not in busy]
    if made.spectrum.analysis is not None and ORDERS not in busy and not made.turning.found:
        idle.append(TURNS)
    return tuple(dict.fromkeys(idle))


def _remembered(compared: Compared, made: Analysis) -> Remembered:
    noise = made.memory.model
    velocity = max(run.velocity_noise for run in compared.runs)
    matters = float(np.mean(made.rows.doubt**2)) > 0.01 * made.found.floor_square
    matters = matters or bool(made.rows.allowance.max() > made.found.floor_square**0.5)
    return Remembered(
        noise.order,
        float(noise.memory * noise.decimation * made.step),
        float(noise.innovation_variance**0.5),
        float(velocity),
        bool(matters),
    )
