"""What remains of a run: sums of products of its rows and target, a few kilobytes.

A run is made ready as `fit` does it, by the same function: checks, preparation of noisy channels,
low pass, rows that do not count. Then its rows become sums, the total in double-double
(`least_squares/sums.py`) and up to 64 blocks in order of time, which tell how the noise goes on.
All that follows, the joint's estimate and its errors, a fit with other runs, the error on a run
that was held out, is made of these.

What differs from `fit` is told in `DIFFERENCES`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError
from flexspline.fitting import checked, posing
from flexspline.fleet.plan import Plan
from flexspline.fleet.sessions import Session, mean_temperature
from flexspline.least_squares.linear import fit_linear, load_of
from flexspline.least_squares.options import FitOptions, coefficient_names
from flexspline.least_squares.problem import Problem, problem_of
from flexspline.least_squares.sums import Sums, joined
from flexspline.logs.log import Fact, Log

__all__ = ["DIFFERENCES", "RunSums", "accumulators_of", "merged"]

Array = NDArray[np.float64]

MOST_BLOCKS = 64
"""Of a run. Twice as many halve the memory that noise may have in a block; half as many leave 20
degrees of freedom for an error."""
LEAST_SECONDS = 0.5
"""Of a block: in runs of a minute and more blocks of a half, one and two seconds cover within 2 %
of each other, in 30 s within 5 % (`tests/bench/fleet.py coverage`); more blocks leave more degrees
of freedom."""
LARGE = 400_000_000  # bytes of a file, from which it is read in pieces
PIECE = 1_000_000  # rows
JOINT_FACTS = ("gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant")

DIFFERENCES = (
    "shapes and orders are held, not fitted",
    "least squares are plain; those of `fit` may be weighed by the noise's memory",
    "no delay of a known load is fitted beside the parameters",
    "no bounds, priors or robust weights",
    "the noise of each run's channels is its own, where a fit to several runs has one for all",
)
"""Between the estimate of a joint here and what `fit` makes of the same runs."""


@dataclass(frozen=True)
class RunSums:
    """Sums over one run.

    Parameters
    ----------
    unit, run, date : as the session.
    total : of all rows that count, one block in double-double, columns of the plan's free terms.
    packed : (B, K (K + 1) / 2), upper triangles of the blocks' products of [X, y].
    rows : rows that count; `seconds` : that they span.
    temperature : mean, °C; None where the run has none.
    own : columns that each run has its own coefficient of.
    facts : of the joint, such as its gear ratio.
    remarks : sentences about the run.
    """

    unit: str
    run: str
    date: datetime | None
    total: Sums
    packed: Array
    rows: int
    seconds: float
    temperature: float | None
    own: tuple[int, ...]
    remarks: tuple[str, ...] = ()
    facts: Mapping[str, Fact] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """UNIT/RUN."""
        return f"{self.unit}/{self.run}"

    @property
    def blocks(self) -> Array:
        """(B, K, K), products of [X, y] of each block, in order of time."""
        width = self.total.high.shape[1]
        upper = np.triu_indices(width)
        full = np.zeros((len(self.packed), width, width))
        full[:, upper[0], upper[1]] = self.packed
        full[:, upper[1], upper[0]] = self.packed
        return full

    @property
    def bytes(self) -> int:
        """Of all its numbers."""
        return int(self.packed.nbytes + self.total.high.nbytes + self.total.low.nbytes)

    def shared(self) -> tuple[Array, Array, Array]:
        """Return (high, low, blocks) of what runs share: their own terms are taken out.

        With Z the own columns, [X, y] becomes [X, y] − Z (ZᵀZ)⁺ Zᵀ [X, y] (`per_run_terms.py`).
        """
        high, low, blocks = self.total.high[0], self.total.low[0], self.blocks
        if not self.own:
            return high, low, blocks
        own = list(self.own)
        kept = [k for k in range(len(high)) if k not in own]
        whole = high + low
        scale = np.sqrt(np.maximum(np.diag(whole)[own], np.finfo(float).tiny))
        inverse = np.linalg.pinv(whole[np.ix_(own, own)] / np.outer(scale, scale), hermitian=True)
        turn = np.zeros((len(high), len(kept)))
        turn[kept, range(len(kept))] = 1.0
        turn[own] = -(inverse / np.outer(scale, scale)) @ whole[np.ix_(own, kept)]
        blocks = np.einsum("ki,bkl,lj->bij", turn, blocks, turn, optimize=True)
        return turn.T @ whole @ turn, np.zeros((len(kept), len(kept))), blocks


def accumulators_of(session: Session, plan: Plan) -> RunSums:
    """Read a run and return its sums.

    A file of more than 400 MB is read, and made ready, in pieces of a million rows, each like a run
    of its own: at the ends of a piece a few rows do not count that would in the whole.

    Raises
    ------
    InputError
        Where the run cannot be read, or is no run for this plan: a sentence that names it.
    """
    pieces = session.pieces(PIECE) if _in_pieces(session) else iter([session.read()])
    sums, seconds, temperatures, remarks = [], 0.0, [], []
    count, facts = 0, dict[str, Fact]()
    for log in pieces:
        session, facts = session.dated(log), {**log.facts}
        if count and len(log) < PIECE // 10:
            remarks.append(f"the last {len(log)} rows are no piece of their own, and do not count")
            break
        made, said = _summed(log, plan)
        count += 1
        sums.append(made)
        remarks += said
        seconds += log.duration
        warm = mean_temperature(log)
        temperatures += [] if warm is None else [(warm, len(log))]
    whole = joined(sums)
    high, low = _core.merge(whole.high, whole.low, list(range(len(whole.high))))
    rows = int(whole.rows.sum())
    total = Sums(high[None], low[None], np.array([rows]), np.zeros(1, dtype=np.int64))
    names = coefficient_names(plan.effects)
    own = tuple(k for k, free in enumerate(plan.free) if names[free] in plan.own)
    if count > 1:
        remarks.append(f"read in {count} pieces")
    return RunSums(
        session.unit,
        session.run,
        session.date,
        total,
        _folded(whole),
        rows,
        seconds,
        _mean(temperatures),
        own,
        tuple(dict.fromkeys(remarks)),
        {key: facts[key] for key in JOINT_FACTS if key in facts},
    )


def merged(runs: Sequence[RunSums]) -> tuple[Array, Array]:
    """Return (high, low) of runs together, added in double-double in the order of their names."""
    parts = [run.shared()[:2] for run in sorted(runs, key=lambda run: (run.unit, run.run))]
    high, low = (np.stack([part[k] for part in parts]) for k in range(2))
    made: tuple[Array, Array] = _core.merge(high, low, list(range(len(parts))))
    return made


def _in_pieces(session: Session) -> bool:
    return session.size > LARGE and not session.arguments.get("repair")


def _summed(log: Log, plan: Plan) -> tuple[Sums, list[str]]:
    """Sums of a run, or of a piece of one, and what its checks say."""
    said = checked([log], plan.effects, plan.target, plan.known_load) if plan.checks else []
    problem = _posed(log, plan)
    if not problem.runs[0].counted:
        raise InputError(f"{log.name}: no row counts; record longer, or smooth less")
    length = max(round(LEAST_SECONDS * log.rate), problem.runs[0].counted // MOST_BLOCKS, 1)
    made = _sums(replace(problem, block_rows=length), plan)
    if not np.isfinite(made.high).all():
        raise InputError(f"{log.name}: sums are not finite; look for values that no joint has")
    return made, said


def _posed(log: Log, plan: Plan) -> Problem:
    """The run as a fit has it; where channels are read as recorded, their noise is not asked."""
    if plan.bandwidth == np.inf:
        return problem_of([log], plan.effects, plan.target, known_load=plan.known_load,
                          lowpass_hz=plan.lowpass, threads=1)  # fmt: skip
    how = FitOptions(bandwidth=plan.bandwidth)
    _, posed = posing([log], plan.effects, plan.target, plan.known_load, plan.lowpass, how)
    return posed(plan.effects)


def _sums(problem: Problem, plan: Plan) -> Sums:
    """Blocks in order of time; a load that the model makes itself is that of this run's own fit."""
    constraints = plan.constraints
    held = np.nan_to_num(constraints.held)
    nothing = load_of(plan.effects, np.zeros(len(held)))
    if nothing.size:
        own = fit_linear(problem, plan.effects, constraints)
        nothing = load_of(plan.effects, own.coefficients)
    return problem.sums(plan.effects, nothing, held=held, exact=True).columns(plan.free)


def _folded(sums: Sums) -> Array:
    """Upper triangles of at most so many blocks, neighbours put together: (B, K (K + 1) / 2)."""
    edges = list(_edges(sums.rows.tolist()))
    blocks = sums.high + sums.low if sums.exact else sums.high
    folded = [blocks[first:last].sum(axis=0) for first, last in pairwise(edges)]
    upper = np.triu_indices(sums.high.shape[1])
    return np.stack([block[upper] for block in folded])


def _edges(rows: Sequence[int]) -> Iterator[int]:
    """Where blocks begin, and the end: of about equal numbers of rows, none of less than half.

    Stretches between gaps make blocks of any length.
    """
    length = max(sum(rows) / MOST_BLOCKS, float(np.median(rows)))
    yield 0
    held = 0
    for at, count in enumerate(rows[:-1], 1):
        held += count
        if held >= length and sum(rows[at:]) >= 0.5 * length:
            yield at
            held = 0
    yield len(rows)


def _mean(values: Sequence[tuple[float, int]]) -> float | None:
    """Mean of (value, weight)."""
    if not values:
        return None
    return sum(value * weight for value, weight in values) / sum(weight for _, weight in values)
