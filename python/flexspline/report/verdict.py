"""The verdict on a fit: how good on held-out rows, against what, and what is wrong with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexspline.errors import listed
from flexspline.formatting.numbers import short, short_names
from flexspline.least_squares.ripple import ripple_orders

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["TARGET_WORDS", "Verdict", "spread", "trust", "validation_sentence", "verdict"]

TARGET_WORDS = {
    "sensor_torque": "sensor torque",
    "motor_torque": "motor torque (at the output)",
    "motor_current": "motor current",
    "torsion": "torsion",
}
WORSE = 1.15  # held-out over in-sample RMSE from which the fit is said to be too rich


@dataclass(frozen=True)
class Verdict:
    """Two sentences. `grave`: what is wrong makes the numbers unfit for use as they stand."""

    good: str
    wrong: str
    grave: bool


def verdict(fit: Fit) -> Verdict:
    """Return the verdict in words."""
    around = spread(fit)
    share = 1.0 - (fit.cv_rmse / around) ** 2 if around > 0.0 else float("nan")
    what = TARGET_WORDS[fit.target]
    good = (
        f"{_grade(share)} the {what} on held-out rows: "
        f"{short(fit.cv_rmse)} {fit.unit} RMSE is left of a spread of "
        f"{short(around)} {fit.unit} ({_percent(share)} of the variance explained)."
    )
    if fit.simulation is not None:
        good = f"{fit.simulation.verdict} {good}"
    faults = [*_grave(fit, share), *_doubts(fit)]
    if not faults:
        return Verdict(good, "Nothing wrong was found with the fit itself.", False)
    text = "; ".join(faults)
    return Verdict(good, f"Wrong with it: {text}.", bool(_grave(fit, share)))


def spread(fit: Fit) -> float:
    """Return the standard deviation of the target over all rows that count, in its unit."""
    y = np.concatenate([run.measured[run.counts] for run in fit.runs])
    return float(y.std())


def validation_sentence(fit: Fit) -> str:
    """Return how the rows never seen were chosen."""
    if fit.validated_by == "folds of runs":
        return f"Held out: each of {fit.folds} folds of runs in turn, fitted to the others."
    if fit.validated_by == "runs":
        return f"Held out: each of {fit.folds} runs in turn, fitted to the others."
    return f"Held out: each of {fit.folds} contiguous blocks in turn, fitted to the others."


def trust(fit: Fit) -> list[str]:
    """Return why the errors can be believed, and what was held out."""
    from flexspline.report.content import naive_remark

    if fit.simulation is None:
        said = [fit.uncertainty.statement, naive_remark(fit), validation_sentence(fit)]
    else:
        said = [*fit.simulation.sentences, naive_remark(fit), validation_sentence(fit)]
    return [sentence for sentence in said if sentence]


def _grade(share: float) -> str:
    for limit, words in (
        (0.98, "Explains nearly all of"),
        (0.9, "Explains most of"),
        (0.5, "Explains a part of"),
        (0.05, "Explains little of"),
    ):
        if share >= limit:
            return words
    return "Explains nothing of"


def _percent(share: float) -> str:
    if not share > 0.0:
        return "none"
    digits = 1 if share < 0.999 else 3
    return f"{np.floor(share * 100 * 10**digits) / 10**digits:.{digits}f} %"


def _grave(fit: Fit, share: float) -> list[str]:
    found = []
    if not share >= 0.05:
        found.append("it predicts no better than a constant")
    if fit.simulation is None and not fit.uncertainty.reliable:
        found.append("the runs are too short for the errors to hold")
    hidden = [short_names(name) for group in fit.confounded for name in group.names]
    if hidden:
        found.append(f"not determined alone: {listed(hidden, 6)}")
    stuck = [short_names(p.name) for p in fit.parameters if p.state.startswith("at ")]
    if stuck:
        found.append(f"at a bound: {listed(stuck, 6)}")
    return found


def _doubts(fit: Fit) -> list[str]:
    found = []
    if fit.cv_rmse > WORSE * fit.rmse:
        percent = round(100.0 * (fit.cv_rmse / fit.rmse - 1.0))
        found.append(f"{percent} % worse on held-out rows than on its own")
    shapes = [short_names(p.name) for p in fit.parameters if p.kind == "shape" and not p.determined]
    if shapes:
        found.append(f"shape not determined: {listed(shapes, 6)}")
    idle = _idle(fit)
    if idle:
        found.append(f"not significant: {listed(idle, 6)}")
    warned = len([said for said in fit.warnings if said != fit.uncertainty.statement])
    if warned:
        found.append(f"{warned} warning{'s' if warned > 1 else ''}, see below")
    return found


def _idle(fit: Fit) -> list[str]:
    """Coefficients and orders that may as well be zero."""
    orders = ripple_orders(fit)
    whole = {name for order in orders for name in order.names}
    idle = [
        short_names(p.name)
        for p in fit.parameters
        if p.kind == "coefficient"
        and p.determined
        and p.name not in whole
        and np.isfinite(p.standard_error)
        and not p.significant
    ]
    return idle + [f"{o.effect} order {o.order}" for o in orders if not o.significant]
