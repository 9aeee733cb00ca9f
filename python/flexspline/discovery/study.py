"""What a discovery looks at: logs made ready for every effect that they could show."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.candidates import Candidate, candidates_for, possible
from flexspline.discovery.dictionary import Columned, Dictionary, columned
from flexspline.discovery.pools import joined, order_pools, scanned
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.sheet import Sheet
from flexspline.discovery.stretches import edges_of
from flexspline.discovery.thinning import rows_of, thinned
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.effects import UNITS, Effect
from flexspline.errors import InputError
from flexspline.fit.problem import Problem, problem_of
from flexspline.fit.requirements import require_one_unit
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.orders import FoundOrder
from flexspline.prepared import Preparation
from flexspline.simulator.record import Simulated

__all__ = ["Study", "study_of"]

Array = NDArray[np.float64]
Orders = tuple[FoundOrder, ...]


@dataclass
class Study:
    """Problem, effects that may be missing, why others are not tried, and orders found.

    `last`, `known`: what was asked for before, a table and the candidates beside models.
    """

    problem: Problem
    possible: list[Effect]
    not_tried: dict[str, str]
    orders: Orders = field(default=())
    last: Columned | None = field(default=None, repr=False, compare=False)
    known: dict[tuple[Effect, ...], tuple[Orders, list[Candidate]]] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def target(self) -> str:
        return self.problem.target

    @property
    def _span(self) -> float:
        """How far the output goes from end to end in a run, rad; without bound where unknown."""
        kept: dict[Any, Any] = self.problem.kept
        if "span" not in kept:
            logs = [run.log for run in self.problem.runs]
            angles = [log["output_position"] for log in logs if "output_position" in log]
            kept["span"] = max((float(np.ptp(angle)) for angle in angles), default=np.inf)
        return float(kept["span"])

    def thinned(self) -> Study:
        """The same for a part of long logs; itself for others."""
        news = rows_of(self.problem) // self.problem.decimation
        share = round(0.5 * SETTINGS.bends * news)
        enough = max(share, (SETTINGS.tried - 1) * SETTINGS.rows)
        part = thinned(self.problem, enough, SETTINGS.rows // 2)
        return self if part is self.problem else replace(self, problem=part, last=None, known={})

    def candidates(self, model: Sequence[Effect]) -> list[Candidate]:
        """Return what may be missing beside a model."""
        orders, made = self.known.get(tuple(model), (None, []))
        if orders is not self.orders:
            facts = self.problem.runs[0].log.facts
            names = [e.name for e in self.possible]
            pools = order_pools(names, facts, self.orders, model, self.target, self._span)
            made = candidates_for(model, self.possible, self.problem, pools)
            self.known[tuple(model)] = self.orders, made
        return made

    def refine(self, model: Sequence[Effect], effect: Effect) -> None:
        """Let a candidate beside a model have the shapes of `effect`, too."""
        orders, made = self.known[tuple(model)]
        better = [c.having(effect) if c.name == effect.name else c for c in made]
        self.known[tuple(model)] = orders, better

    def dictionary(
        self, work: Working, whitening: Whitening, *, without: str | None = None
    ) -> Dictionary:
        """Return the table of a model and all candidates beside it, or beside it without one."""
        candidates = self._beside(work, without)
        last = self.last
        if (
            last is None
            or last.work is not work
            or last.whitening is not whitening
            or not last.has(candidates)
        ):
            every = [None, without, *(effect.name for effect in work.named)]
            wanted = [e for name in every for c in self._beside(work, name) for e in c.effects]
            last = self.last = columned(self.problem, work, wanted, whitening)
        return last.dictionary(candidates)

    def _beside(self, work: Working, without: str | None) -> list[Candidate]:
        """What may stand beside a model, or beside it in the place of one of its effects."""
        rest = [e for e in work.effects if e.name != without]
        return [c for c in self.candidates(rest) if c.name != without]

    def scan(self, work: Working) -> None:
        """Look for orders in what a model leaves; those of earlier scans stay."""
        logs = [run.log for run in self.problem.runs]
        sheet = Sheet(work.effects, work.coefficients, (), work.coefficients)
        folds = sum(len(edges_of(self.problem, number)) - 1 for number in range(len(logs)))
        residuals = sheet.left_over(self.problem, [np.empty(0)] * folds)
        self.orders = joined(self.orders, scanned(logs, residuals, UNITS[self.target]))


def study_of(
    base: Sequence[Effect],
    logs: Sequence[Log],
    target: str,
    *,
    known_load: str | None,
    lowpass_hz: float | None,
    threads: int,
    exclude: Iterable[str] = (),
    preparations: Sequence[Preparation] = (),
    inputs: Sequence[Log] | None = None,
    counted: Sequence[NDArray[np.bool_]] | None = None,
    simulated: Simulated | None = None,
) -> Study:
    """Make logs ready for the base and every effect that they could show beside it.

    `simulated`: the simulation whose prediction is taken off the target, or None.

    Raises
    ------
    InputError
        As `fit`, for the base alone; for a name in `exclude` that is no effect or is in the base.
    """
    require_one_unit(base, target, known_load)
    problem_of(
        logs,
        base,
        target,
        known_load=known_load,
        lowpass_hz=lowpass_hz,
        threads=threads,
        preparations=preparations,
        inputs=inputs,
        counted=counted,
        simulated=simulated,
    )
    inputs = [_with_motion(log) for log in (logs if inputs is None else inputs)]
    effects, reasons = possible(base, inputs, target, known_load, exclude)
    kept = [e for e in effects if _finite(e, inputs, reasons)]
    problem = problem_of(
        logs,
        [*base, *kept],
        target,
        known_load=known_load,
        lowpass_hz=lowpass_hz,
        threads=threads,
        preparations=preparations,
        inputs=inputs,
        counted=counted,
        simulated=simulated,
    )
    runs = tuple(replace(run, stretches=run.unbroken) for run in problem.runs)
    return Study(replace(problem, runs=runs), kept, reasons)


def _finite(effect: Effect, logs: Sequence[Log], reasons: dict[str, str]) -> bool:
    """Whether all channels of an effect are finite; a candidate's fault is no fault of the base."""
    for log in logs:
        for name in effect.reads:
            if name in log and not np.isfinite(log[name]).all():
                reasons[effect.name] = f"log '{log.name}': {name} is not finite throughout"
                return False
    return True


def _with_motion(log: Log) -> Log:
    """The log with the derivatives of its position, where that allows them."""
    names = [n for n in ("output_velocity", "output_acceleration") if n not in log]
    if not names or "output_position" not in log:
        return log
    try:
        made = differentiate(log)
    except InputError:
        return log
    return log.with_columns({n: made[n] for n in names}, note=made.history[-1])
