"""Where the base model and the runs disagree, on folds that no fit saw; and what is left there.

The noise floor of a band is at most what the extended model leaves in it: a model that comes nearer
than the floor that the base's residual suggests shows that this was too high.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.analysis import Analysis, analysed
from flexspline.comparison.assemble import assembled
from flexspline.comparison.bands import Band
from flexspline.comparison.result import Comparison
from flexspline.comparison.runs import Compared, ComparedRun, located

if TYPE_CHECKING:
    from flexspline.discovery.result import Discovery

__all__ = ["Disagreement", "disagreement"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Disagreement:
    """`before`: the base model compared. `after`: RMS that the extended model leaves, by the names
    and labels of `before.by`."""

    before: Comparison
    after: Mapping[str, Mapping[str, float]]


def disagreement(made: Discovery) -> Disagreement:
    """Compare what the base predicts on left-out folds with what was measured.

    Raises
    ------
    InputError
        Where too few rows count.
    """
    if made.by == "simulation":
        from flexspline.output_error.discovering import compared_motion

        return _judged(made, compared_motion(made.runs, "base"))
    part = made.model.part(made.target)
    runs = tuple(
        located(made.model, part, run.log, run.measured, np.where(run.counts, run.base, np.nan),
                made.fit.lowpass, run.load)
        for run in made.runs
    )  # fmt: skip
    source = part.known_load or "the model's own inertia and gravity"
    return _judged(made, Compared(runs, made.target, made.unit, False, made.fit.lowpass, source))


def _judged(made: Discovery, compared: Compared) -> Disagreement:
    found = analysed(compared, lambda _: None)
    before, after = assembled(compared, found, made.model.facts), _after(made, compared, found)
    overall = _above(before.overall, made.noise_floor)
    by = {
        name: tuple(_lowered(band, after[name][band.label]) for band in bands)
        for name, bands in before.by.items()
    }
    return Disagreement(replace(before, overall=overall, by=by), after)


def _lowered(band: Band, reached: float) -> Band:
    """A band whose floor is no higher than what a model has reached."""
    return _above(band, min(band.noise_floor, reached))


def _above(band: Band, floor: float) -> Band:
    excess = float(np.sqrt(max(band.rmse**2 - floor**2, 0.0)))
    return replace(band, noise_floor=floor, excess=excess)


def _after(made: Discovery, compared: Compared, found: Analysis) -> dict[str, dict[str, float]]:
    def left(run: ComparedRun, number: int) -> Array:
        return made.runs[number].measured - made.runs[number].final

    squares = found.rows.column(compared, left) ** 2
    after = {}
    for covariate in found.covariates:
        inside = covariate.cells >= 0
        total, count = (
            covariate.bins(
                np.bincount(
                    covariate.cells[inside], weights=each[inside], minlength=covariate.count
                ).astype(np.float64)
            )
            for each in (squares, np.ones(len(squares)))
        )
        rms = np.sqrt(total / np.maximum(count, 1.0))
        after[covariate.name] = dict(zip(covariate.labels, rms.tolist(), strict=False))
    return after
