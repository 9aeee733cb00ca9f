"""What remains of a run: sums of products of its rows and target, a few kilobytes.

Sums of products can be merged only where all runs have the same columns, so that shapes (a Stribeck
velocity, a width) and orders of ripple are held, at the values of a model or of a pilot joint: that
is the `Plan` of a fleet.

A run is made ready as `fit` does it, by the same function: checks, preparation of noisy channels,
low pass, rows that do not count. Then its rows become sums, the total in double-double
(`least_squares/sums.py`) and up to 64 blocks in order of time, which tell how the noise goes on.
All that follows, the joint's estimate and its errors, a fit with other runs, the error on a run
that was held out, is made of these.

What differs from `fit` is told in `DIFFERENCES`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import UNITS, Effect, require_effects, unit_in
from flexspline.errors import InputError, listed
from flexspline.fitting import checked, posing
from flexspline.fleet.sessions import Session, mean_temperature, readable
from flexspline.formatting import short_names
from flexspline.least_squares.linear import fit_linear, load_of
from flexspline.least_squares.options import (
    FitOptions,
    coefficient_names,
    constraints_of,
    resolve,
    shapes_of,
)
from flexspline.least_squares.problem import Problem, Ranges, joined_ranges, problem_of
from flexspline.least_squares.sums import Sums, joined
from flexspline.logs.log import Fact, Log
from flexspline.signals import Carried, require_one_unit, without_unread

if TYPE_CHECKING:
    from flexspline.fleet.sessions import Session
    from flexspline.least_squares.options import Constraints
    from flexspline.model import Model

__all__ = [
    "DIFFERENCES",
    "PilotError",
    "Plan",
    "RunSums",
    "accumulators_of",
    "merged",
    "plan_of_model",
    "plan_of_pilot",
]

PILOT_RUNS = 3
"""Of the pilot joint, the longest: shapes are common to all runs, and more tell them no better."""

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


class PilotError(InputError):
    """The runs of the pilot joint tell no shapes and orders."""


@dataclass(frozen=True)
class Plan:
    """How each run is summed.

    Parameters
    ----------
    effects : with the shapes and orders that are held.
    target, known_load, lowpass, bandwidth : as for `fit`.
    fixed : coefficients that are not fitted.
    own : terms, "effect.term", of which each run has its own, such as zeros.
    pilot : who told shapes and orders, in words.
    checks : whether runs are looked at first; one that no fit can use is left out.
    carried : the weight that the effects read as part of the load, or None.
    """

    effects: tuple[Effect, ...]
    target: str
    known_load: str | None = None
    lowpass: float | None = None
    bandwidth: float | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    own: tuple[str, ...] = ()
    pilot: str = ""
    checks: bool = True
    carried: Carried | None = None

    def __post_init__(self) -> None:
        require_effects(self.effects, self.target)
        require_one_unit(self.effects, self.target, self.known_load)
        names = coefficient_names(self.effects)
        own = []
        for each in self.own:
            its = [name for name in names if name.split(".")[0] == each]
            own += its or [names[resolve(each, names, "per_run")]]
        object.__setattr__(self, "own", tuple(dict.fromkeys(own)))
        if not self.names:
            raise InputError("there is no coefficient to fit; give effects, or fix fewer of them")

    @property
    def unit(self) -> str:
        """Unit of the target."""
        return UNITS[self.target]

    @property
    def constraints(self) -> Constraints:
        """What is held of the coefficients."""
        return constraints_of(coefficient_names(self.effects), self.fixed, {}, {})

    @property
    def free(self) -> list[int]:
        """Numbers of the coefficients that are fitted, those of single runs among them."""
        return [int(k) for k in self.constraints.free]

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficients that joints are compared by: neither fixed nor each run's own."""
        names = coefficient_names(self.effects)
        return tuple(names[k] for k in self.free if names[k] not in self.own)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of `names`."""
        terms = [term for each in self.effects for term in each.terms]
        names = coefficient_names(self.effects)
        return tuple(
            unit_in(terms[names.index(name)].unit, self.target, self.known_load)
            for name in self.names
        )

    @property
    def held_shapes(self) -> dict[str, float]:
        """Shapes by full name, with their values."""
        return {shape.name: shape.value(self.effects) for shape in shapes_of(self.effects)}

    def to_json(self) -> dict[str, Any]:
        """Return the plan as `fleet.json` holds it."""
        return {
            "target": self.target,
            "unit": self.unit,
            "known_load": self.known_load,
            "lowpass": self.lowpass,
            "bandwidth": self.bandwidth,
            "fixed": dict(self.fixed),
            "per_run": list(self.own),
            "pilot": self.pilot,
            "effects": [
                {
                    "name": each.name,
                    "shapes": dict(each.shapes),
                    "harmonics": [list(harmonic) for harmonic in each.harmonics],
                }
                for each in self.effects
            ],
        }


def plan_of_model(model: Model, target: str | None, label: str, **how: Any) -> Plan:
    """Return the plan with shapes and orders of a joint's model.

    Parameters
    ----------
    target : which part; None where there is one alone.
    label : who told them, for the result.
    **how : other fields of a `Plan`.
    """
    part = model.part(target)
    load = how.pop("known_load", None) or part.known_load
    return Plan(part.effects, part.target, load, pilot=label, carried=part.carried, **how)


def plan_of_pilot(
    effects: str | Effect | Iterable[str | Effect],
    sessions: Sequence[Session],
    target: str,
    *,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    known_load: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    per_run: Sequence[str] = (),
    checks: bool = True,
) -> Plan:
    """Return the plan with shapes and orders that a fit finds in runs of one joint.

    Where there is nothing to be found, no run is read.

    Parameters
    ----------
    sessions : of the pilot joint; its longest `PILOT_RUNS` are fitted.

    Raises
    ------
    PilotError
        Where they cannot be fitted.
    """
    from flexspline.fitting import with_orders

    chosen = with_orders(effects, orders or {})
    if known_load is None:
        chosen = [each.without_load() for each in chosen]
    require_effects(chosen, target)
    fixed = dict(fixed or {})
    shapes = {shape.name: shape for shape in shapes_of(chosen)}
    held = {name: value for name, value in fixed.items() if _shape(name, shapes)}
    how: dict[str, Any] = {"known_load": known_load, "lowpass": lowpass, "bandwidth": bandwidth}
    how |= {"fixed": {k: v for k, v in fixed.items() if k not in held}, "checks": checks}
    for name, value in held.items():
        chosen = list(shapes[_shape(name, shapes)].set(chosen, value))
    loose = [name for name in shapes if name not in {_shape(each, shapes) for each in held}]
    if not loose and not any(each.ripple and not each.harmonics for each in chosen):
        return Plan(tuple(chosen), target, own=tuple(per_run), **how)
    return _piloted(chosen, sessions, target, fixed, per_run, loose, how)


def _shape(name: str, shapes: Iterable[str]) -> str:
    """Full name of the shape that is meant, or "" where it is none."""
    return next((full for full in shapes if name in (full, full.split(".")[-1])), "")


def _piloted(
    chosen: Sequence[Effect],
    sessions: Sequence[Session],
    target: str,
    fixed: Mapping[str, float],
    per_run: Sequence[str],
    loose: Sequence[str],
    how: Mapping[str, Any],
) -> Plan:
    from flexspline.fitting import fit
    from flexspline.least_squares.options import FitOptions

    longest = sorted(sessions, key=lambda session: (-session.size, session.run))[:PILOT_RUNS]
    unit = longest[0].unit
    try:
        logs, _ = readable(longest)
        own = tuple(per_run) if len(logs) > 1 else ()
        made = fit(
            chosen,
            logs,
            target,
            known_load=how["known_load"],
            lowpass=how["lowpass"],
            fixed=fixed,
            checks=how["checks"],
            options=FitOptions(bandwidth=how["bandwidth"], per_run=own),
        )
    except InputError as error:
        raise PilotError(
            f"the pilot joint {unit}, which is to tell shapes and orders: {error}"
        ) from error
    kept = [each.name for each in made.part.effects]
    lost = [each.name for each in chosen if each.name not in kept]
    found = [*loose, *(f"orders of {each.name}" for each in made.part.effects if each.harmonics)]
    by = f"{unit} ({listed(log.name for log in logs)})"
    said = f"held as a fit of {by} found them: {listed(map(short_names, found))}"
    ends = [p.name for p in made.parameters if p.kind == "shape" and p.state.startswith("at ")]
    said += f"; {listed(ends)} ended at a bound, which is no value of a joint" if ends else ""
    said += f"; it has no orders of {listed(lost)}, which the fleet's model lacks" if lost else ""
    return Plan(made.part.effects, target, own=tuple(per_run), pilot=said, **how)


@dataclass(frozen=True, eq=False)
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
    ranges : lowest and highest value of each channel that the effects read.
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
    ranges: Ranges = field(default_factory=dict)

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
    count, facts, ranges = 0, dict[str, Fact](), list[Ranges]()
    for log in pieces:
        session, facts = session.dated(log), {**log.facts}
        if count and len(log) < PIECE // 10:
            remarks.append(f"the last {len(log)} rows are no piece of their own, and do not count")
            break
        made, said, reached = _summed(log, plan)
        count += 1
        sums.append(made)
        ranges.append(reached)
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
        joined_ranges(ranges),
    )


def merged(runs: Sequence[RunSums]) -> tuple[Array, Array]:
    """Return (high, low) of runs together, added in double-double in the order of their names."""
    parts = [run.shared()[:2] for run in sorted(runs, key=lambda run: (run.unit, run.run))]
    high, low = (np.stack([part[k] for part in parts]) for k in range(2))
    made: tuple[Array, Array] = _core.merge(high, low, list(range(len(parts))))
    return made


def _in_pieces(session: Session) -> bool:
    return session.size > LARGE and not session.arguments.get("repair")


def _summed(log: Log, plan: Plan) -> tuple[Sums, list[str], Ranges]:
    """Sums of a run, or of a piece of one, what its checks say, and ranges of its channels."""
    asked = plan.effects, plan.target, plan.known_load
    read, said = without_unread([log], *asked)
    said += checked(read, *asked) if plan.checks else []
    problem = _posed(log, plan)
    if not problem.runs[0].counted:
        raise InputError(f"{log.name}: no row counts; record longer, or smooth less")
    length = max(round(LEAST_SECONDS * log.rate), problem.runs[0].counted // MOST_BLOCKS, 1)
    made = _sums(replace(problem, block_rows=length), plan)
    if not np.isfinite(made.high).all():
        raise InputError(f"{log.name}: sums are not finite; look for values that no joint has")
    return made, said, problem.ranges


def _posed(log: Log, plan: Plan) -> Problem:
    """The run as a fit has it; where channels are read as recorded, their noise is not asked."""
    if plan.bandwidth == np.inf:
        return problem_of([log], plan.effects, plan.target, known_load=plan.known_load,
                          lowpass_hz=plan.lowpass, threads=1, carried=plan.carried)  # fmt: skip
    how = FitOptions(bandwidth=plan.bandwidth)
    _, posed = posing(
        [log], plan.effects, plan.target, plan.known_load, plan.lowpass, how, carried=plan.carried
    )
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
