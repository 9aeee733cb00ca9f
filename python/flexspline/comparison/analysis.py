"""From runs to what their residual follows.

Orders are looked for in the residual, and again in what is left once it follows something else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flexspline.comparison.covariates import Covariate, covariates_of
from flexspline.comparison.heldout import held_out_rest
from flexspline.comparison.memory import Memory, memory_of
from flexspline.comparison.rows import Rows, rows_of
from flexspline.comparison.runs import Compared
from flexspline.comparison.search import ORDERS, CellTests, Search, search
from flexspline.comparison.turning import Turning, turning_of
from flexspline.logs.segments import median_step

__all__ = ["Analysis", "analysed"]

PER_CUTOFF = 2.5  # a low-passed residual has news this many times per period of the cutoff


@dataclass(frozen=True, eq=False)
class Analysis:
    """What the residual follows: `found`, tested by `test` with the noise's `memory`.

    `turning`: orders in the residual, or in what is left where it follows something else first;
    `spectrum`: those of the residual itself. `step`: s, of the rows.
    """

    rows: Rows
    covariates: tuple[Covariate, ...]
    memory: Memory
    test: CellTests
    found: Search
    turning: Turning
    spectrum: Turning
    step: float


def analysed(compared: Compared, say: Callable[[str], None]) -> Analysis:
    """Search the runs; `say` is told what is being done."""
    say("sorting rows")
    rows = rows_of(compared)
    covariates = covariates_of(compared, rows)
    step = min(median_step(run.log["time"]) for run in compared.runs)
    news = 1
    if compared.lowpass is not None:
        news = max(1, int(1.0 / (PER_CUTOFF * compared.lowpass * step)))
    say("looking for orders")
    turning = spectrum = turning_of(compared, rows, rows.residual)
    say("what the residual follows")
    memory = memory_of(rows, held_out_rest(rows, covariates, turning), news)
    test = CellTests(rows, memory)
    found = search(rows, covariates, turning, test)
    if found.steps and ORDERS not in [each.name for each in found.steps]:
        turning = turning_of(compared, rows, found.rest)
        if turning.found:
            found = search(rows, covariates, turning, test)
    return Analysis(rows, tuple(covariates), memory, test, found, turning, spectrum, step)
