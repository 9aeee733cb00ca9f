"""The problem of a fit: runs with channels as the core takes them, the target, and valid rows.

Burn-in. Each run, and each segment behind a gap, starts an effect's memory with a guess. The rows
that still depend on it do not count. Which rows these are depends on the shapes (a wider loop takes
longer to turn over), so a fit repeats with those of the shapes that it found; while it searches,
the rows stay the same, for sums of squares over different rows cannot be compared.

Resolution. Around a reversal, and where a joint starts to move, friction changes within
milliseconds. A motion that was smoothed up to B is blurred there, and the residual looks like
friction of the path or of low speeds. So each row is tested: by how much does the prediction move
when the motion is smoothed at half its bandwidth? Where that is more than the noise of the target,
the inputs do not determine the prediction, and the rows do not count. The model that is tested has
Coulomb and viscous friction, which turn over fastest.

A width of friction that is no wider than what the smoothed speed is known to is what the smoother
makes of a narrower one, and its rows say nothing of that: their noise gives it a small error. So
what the speed is known to is added to its standard error, from a tenth of the width on.

Near the ends of a recording a smoother has rows on one side only: derivatives are many times as
noisy there as elsewhere, and a value is off by another share of the curvature. Within its reach the
rows do not count; one row of them would stand out by the jump. The same holds for a load, whose
slope gives its delay, beside gaps too. For a motion beside a gap the resolution test decides
instead, as a start of motion behind a gap may be all that shows friction at low speed. A
temperature hardly changes within the smoother's reach.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import Effect, require_effects
from flexspline.effects.causes import BASIC_FRICTION
from flexspline.errors import InputError, listed
from flexspline.least_squares.sums import Sums, joined
from flexspline.logs.channel_noise import ChannelNoise
from flexspline.logs.derive import LowPass, lowpass
from flexspline.logs.local_fit import LocalFit, require_bandwidth, response
from flexspline.logs.log import Log
from flexspline.logs.segments import runs, true_ranges
from flexspline.own import Design, OwnEffect, design_of
from flexspline.prepared import ACCELERATION, MOTION, VELOCITY, Preparation, prepared
from flexspline.signals import (
    Carried,
    channels_for,
    core_channels,
    gear_for,
    require_change,
    require_finite,
    require_load,
    target_of,
    torque_of_current,
)
from flexspline.simulator import Simulated, simulation_of

__all__ = [
    "OwnBasis",
    "Problem",
    "Ranges",
    "Run",
    "away_from_ends",
    "coarser",
    "columns_of",
    "joined_ranges",
    "kept_rows",
    "memory_warnings",
    "noise_of_acceleration",
    "noise_of_load",
    "own_basis_of",
    "problem_of",
    "resolved_rows",
    "settled",
    "target_range",
    "unresolved_speed",
    "with_fastest",
]

Array = NDArray[np.float64]
Ranges = Mapping[str, tuple[float, float]]
T = TypeVar("T")

SECONDS_A_BLOCK = 2.0
MOST_BLOCKS = 400
CHUNK = 1 << 15
ROUNDING = 1e-12  # of a column's size: what is left of one that is constant in a run
UNSEEN = 1e-9  # share of a run's own term that the run's others leave, at which they explain it
KEPT = 24  # filtered effects of each run

LEAST_SETTLED = 0.1  # of the rows; with fewer the guess of the start is the lesser evil

Masks = list[NDArray[np.bool_]]

HALF = 0.5  # of the bandwidth: what a smoother that is off by an octave would tell
SLOW = "temperature"
LEAST = 0.5  # of a run: where less would count, all of it does
DERIVED = 3  # rows between two gaps from which an acceleration can be derived
FREQUENCIES = 10_000  # at which the noise of a load is added up
TURNING = 2.0  # widths, at which friction is 96 % of what it will be
SHORT = 0.05  # s: the noise of the target is what it differs by after so long, in the median


@dataclass(frozen=True, eq=False)
class Run:
    """One log made ready: channels for the core, the target, and the pieces without gaps.

    `log`: with its inputs prepared; the target is that of the log as recorded. `channels`: name ->
    (N,) in SI units, "known_load" among them. `target`: (N,), y. `unbroken`: row ranges
    [first, last) without a gap. `stretches`: the rows of these that count; the beginning may be
    left out, where an effect still depends on what came before the run.
    `low_pass`: of the target, for the rows; None without one. `whole`: `unbroken` before rows were
    left out that do not count: through these time, and the noise, go on. None where none were.
    `blur`: what a prediction changes by with the motion smoothed further, (N,), where it was asked.
    """

    log: Log
    channels: dict[str, Array]
    target: Array
    unbroken: tuple[tuple[int, int], ...]
    stretches: tuple[tuple[int, int], ...]
    low_pass: LowPass | None = None
    whole: tuple[tuple[int, int], ...] | None = None
    blur: Array | None = None

    def __len__(self) -> int:
        return len(self.target)

    @property
    def counted(self) -> int:
        """Rows that count."""
        return sum(last - first for first, last in self.stretches)

    def mean(self, values: Array) -> Array:
        """Mean of values (N,) or (N, K) over the rows that count."""
        total = sum(values[first:last].sum(axis=0) for first, last in self.stretches)
        return np.asarray(total / max(self.counted, 1))

    def centred(self, values: Array) -> Array:
        """Values (N,) or (N, K) less their mean; zero where nothing but rounding is left."""
        rest = values - self.mean(values)
        parts = [slice(first, last) for first, last in self.stretches]
        size = np.max([np.abs(values[part]).max(axis=0) for part in parts], axis=0, initial=0.0)
        left = np.max([np.abs(rest[part]).max(axis=0) for part in parts], axis=0, initial=0.0)
        return np.where(left > ROUNDING * size, rest, 0.0)

    def blocks(self, length: int) -> list[tuple[int, int]]:
        """Cut the stretches into blocks of about `length` rows, none shorter than half."""
        return _blocks(self.stretches, length)


@dataclass(frozen=True, eq=False)
class OwnBasis:
    """Directions that the K own terms of a run span, R of them orthonormal over rows that count.

    `rows`: (N, R). `to_terms`: (K, R), rows = rows of the terms @ to_terms. `hidden`: (K,), terms
    that the run does not determine.
    """

    rows: Array
    to_terms: Array
    hidden: NDArray[np.bool_]


def joined_ranges(parts: Sequence[Ranges]) -> Ranges:
    """Return the ranges, by channel, of these parts together."""
    names = sorted({name for part in parts for name in part} - {"period"})
    every = {name: [part[name] for part in parts if name in part] for name in names}
    return {
        name: (min(low for low, _ in ends), max(high for _, high in ends))
        for name, ends in every.items()
    }


@dataclass(frozen=True)
class Problem:
    """Runs that one model explains.

    `gear`: effective ratio, output spline and whether the motor's angle is measured, as
    `_core.Design` takes them. `lowpass`: Hz, on target and rows alike, or None. `preparations`: of
    the channels that rows read. `centred`: whether an offset of each run is taken out of target and
    rows (`per_run_terms.py`). `own`: terms, "effect.term", of which each run has one of its own;
    `projected`: the effects of these, where they are taken out of target and rows in the same way.
    `simulated`: the foreign simulation whose prediction is taken off every target, or None.
    `carried`: what the rows read as part of the load beside the channel, or None. `scatter`: RMS of
    the known load's noise, Nm.
    """

    runs: tuple[Run, ...]
    target: str
    gear: dict[str, Any]
    known_load: str | None
    lowpass: float | None
    threads: int
    block_rows: int
    own: tuple[str, ...] = ()
    preparations: tuple[Preparation, ...] = ()
    centred: bool = False
    projected: tuple[Effect, ...] = ()
    simulated: Simulated | None = None
    carried: Carried | None = None
    scatter: float = 0.0
    kept: dict[Any, Array] = field(default_factory=dict, compare=False, repr=False)
    remembered: _core.Remembered = field(
        default_factory=_core.Remembered, compare=False, repr=False
    )

    @property
    def ranges(self) -> Ranges:
        """Lowest and highest value of each channel, of all runs, by name."""
        return joined_ranges([
            {name: (float(of.min()), float(of.max())) for name, of in run.channels.items()}
            for run in self.runs
        ])  # fmt: skip

    def bare(self) -> Problem:
        """Return the problem without what was kept to search faster."""
        return replace(self, kept={}, remembered=_core.Remembered())

    def __getstate__(self) -> dict[str, Any]:
        kept = ("kept", "remembered")  # the second is the core's, and no pickle
        return {name: value for name, value in self.__dict__.items() if name not in kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, kept={}, remembered=_core.Remembered())

    def place(self, effects: Sequence[Effect], number: int) -> NDArray[np.intp]:
        """Number of the parameter behind each column of the core for a run, (P,).

        What each run has of its own stands behind all other parameters, run after run.
        """
        columns = np.arange(sum(len(effect.terms) for effect in effects))
        at = self.own_columns(effects)
        if not at:
            return columns
        shared, place = np.delete(columns, at), np.empty_like(columns)
        place[shared] = np.arange(len(shared))
        place[at] = len(shared) + number * len(at) + np.arange(len(at))
        return place

    def own_columns(self, effects: Sequence[Effect]) -> list[int]:
        """Return the columns of the core of which each run has a parameter of its own."""
        if self.projected or not self.own:
            return []
        return columns_of(effects, self.own)

    @property
    def takes_out(self) -> bool:
        """Whether something of each run is taken out of target and rows."""
        return self.centred or bool(self.projected)

    def apart(self, number: int, values: Array) -> Array:
        """Values (N,) or (N, K) of a run without what its own terms can make of them."""
        run = self.runs[number]
        if self.centred:
            return run.centred(values)
        basis = self.own_basis(number).rows
        parts = [slice(first, last) for first, last in run.stretches]
        rest = values - basis @ sum(basis[part].T @ values[part] for part in parts)
        size = np.max([np.abs(values[part]).max(axis=0) for part in parts], axis=0, initial=0.0)
        left = np.max([np.abs(rest[part]).max(axis=0) for part in parts], axis=0, initial=0.0)
        return np.where(left > ROUNDING * size, rest, 0.0)

    def own_rows(self, effects: Sequence[Effect], number: int) -> Array:
        """Columns of the terms in `own` of a whole run, low-passed as the target is: (N, K)."""
        run = self.runs[number]
        rows = self.design(effects).rows(run.channels, len(run), np.empty(0))
        return self.smooth(run, np.asarray(rows)[:, columns_of(effects, self.own)])

    def own_basis(self, number: int) -> OwnBasis:
        """Return the directions that terms span which are taken out of a run."""
        run = self.runs[number]
        key = ("own", number, run.stretches)
        return self.once(key, lambda: own_basis_of(run, self.own_rows(self.projected, number)))

    def once(self, key: Any, make: Callable[[], T]) -> T:
        """Return what `make` makes, which is kept: models come and go, the runs stay."""
        kept: dict[Any, Any] = self.kept
        if key not in kept:
            kept[key] = make()
        made: T = kept[key]
        return made

    def design(self, effects: Sequence[Effect]) -> Design:
        return design_of(effects, self.gear)

    def sums(
        self,
        effects: Sequence[Effect],
        load: Array,
        *,
        held: Array | None = None,
        weights: Sequence[Array] | None = None,
        exact: bool = False,
    ) -> Sums:
        """Sums of products of [rows, y] of all blocks.

        Parameters
        ----------
        load : (P,), coefficients from which the load is made; (0,) for the known load alone.
        held : (P,), what is taken off the target beforehand; None for nothing.
        weights : an array (N,) for each run, or None.
        exact : sum in double-double.
        """
        design = self.design(effects)
        nothing = np.empty(0)
        pieces = []
        own, place = bool(self.own_columns(effects)), self.place(effects, 0)
        for number, run in enumerate(self.runs):
            if own:
                place = self.place(effects, number)
            blocks = run.blocks(self.block_rows)
            weight = None if weights is None else weights[number]
            off = nothing if held is None or not held.any() else held[place]
            carried = load[place] if load.size else nothing
            if self.lowpass is None and not self.takes_out:
                high, low = design.accumulate(
                    run.channels,
                    run.target,
                    blocks,
                    carried,
                    off,
                    weight,
                    exact,
                    True,
                    self.threads,
                )
            else:
                rows = self.rows(effects, number, carried)
                target = run.target - rows @ off if off.size else run.target
                if self.takes_out:
                    rows, target = self.apart(number, rows), self.apart(number, target)
                if weight is not None and exact:
                    root = np.sqrt(weight)
                    rows, target, weight = rows * root[:, None], target * root, None
                high, low = _core.accumulate_rows(rows, target, blocks, weight, exact, self.threads)
            lengths = np.array([last - first for first, last in blocks], dtype=np.int64)
            label = np.full(len(blocks), number, dtype=np.int64)
            pieces.append(Sums(high, low, lengths, label))
            if own:
                pieces[-1] = pieces[-1].spread(place, self.parameters(effects))
        return joined(pieces)

    @property
    def decimation(self) -> int:
        """Every how many rows the noise is news: above a low pass nothing is left to look at."""
        if self.lowpass is None:
            return 1
        rate = float(np.median([run.log.rate for run in self.runs]))
        return max(1, int(rate / (2.5 * self.lowpass)))

    def parameters(self, effects: Sequence[Effect]) -> int:
        """How many coefficients there are."""
        return int(self.place(effects, len(self.runs) - 1).max(initial=-1)) + 1

    def rows(self, effects: Sequence[Effect], number: int, load: Array) -> Array:
        """Low-passed design matrix of a whole run, (N, P).

        The search for shapes asks for the same columns again and again: those that no load
        changes are kept, the last few of each effect.
        """
        run = self.runs[number]
        if self.lowpass is None:
            return np.asarray(self.design(effects).rows(run.channels, len(run), load))
        columns = [np.empty((len(run), 0))]
        for k, effect in enumerate(effects):
            if "load" in effect.reads:
                first = sum(len(e.terms) for e in effects[:k])
                raw = self.design(effects).rows(run.channels, len(run), load)
                made = self.smooth(run, np.asarray(raw)[:, first : first + len(effect.terms)])
            else:
                key = (number, effect)
                if key not in self.kept:
                    raw = self.design([effect]).rows(run.channels, len(run), np.empty(0))
                    self.kept[key] = self.smooth(run, np.asarray(raw))
                    if len(self.kept) > KEPT * len(self.runs):
                        self.kept.pop(next(iter(self.kept)))
                made = self.kept[key]
            columns.append(made)
        return np.asfortranarray(np.hstack(columns))

    def smooth(self, run: Run, values: Array) -> Array:
        """Values (N,) or (N, K) of a whole run, low-passed as the target is."""
        return values if run.low_pass is None else run.low_pass(values)

    def predict(self, effects: Sequence[Effect], coefficients: Array) -> list[Array]:
        """Rows times coefficients, an array (N,) for each run."""
        return [self.predict_run(effects, coefficients, k) for k in range(len(self.runs))]

    def predict_run(self, effects: Sequence[Effect], coefficients: Array, number: int) -> Array:
        """Rows times coefficients of one run, (N,), and its own terms where these are taken out."""
        values = self.combined(effects, coefficients, number)
        return values + self.taken_out(number) if self.takes_out else values

    def taken_out(self, number: int) -> Array:
        """What the run's own terms make of its target: (N,), or () where it is their mean."""
        run = self.runs[number]
        if self.centred:
            return run.mean(run.target)
        return run.target - self.apart(number, run.target)

    def combined(self, effects: Sequence[Effect], weights: Array, number: int) -> Array:
        """Rows of one run, as they are fitted, times weights: (N,)."""
        run, place = self.runs[number], self.place(effects, number)
        values = self.design(effects).predict(run.channels, len(run), weights[place])
        values = self.smooth(run, np.asarray(values))
        return self.apart(number, values) if self.takes_out else values

    def pieces(self) -> Iterator[tuple[int, int, int]]:
        """Run number and row range of pieces small enough to hold a design matrix of."""
        for number, run in enumerate(self.runs):
            for first, last in run.stretches:
                for start in range(first, last, CHUNK):
                    yield number, start, min(start + CHUNK, last)


def problem_of(
    logs: Sequence[Log],
    effects: Sequence[Effect],
    target: str,
    *,
    known_load: str | None,
    lowpass_hz: float | None,
    threads: int,
    own: Sequence[str] = (),
    preparations: Sequence[Preparation] = (),
    inputs: Sequence[Log] | None = None,
    counted: Sequence[NDArray[np.bool_]] | None = None,
    simulated: Simulated | None = None,
    carried: Carried | None = None,
    scatter: float = 0.0,
) -> Problem:
    """Make logs ready for a fit of these effects to this target, or to what a simulation leaves.

    `preparations`: how channels are made that the rows read; the target is that of the logs as
    they are. `inputs`: these logs with the channels so made, where rows were taken out since.
    `counted`: rows (N,) of each log that count; None for all. `own`, `carried`, `scatter`: see
    `Problem`.

    Raises
    ------
    InputError
        For an unknown target, an effect that does not act on it, a channel that is missing and
        cannot be derived, values that are not finite, or logs that disagree on the gear.
    """
    require_effects(effects, target)
    require_load(effects, known_load)
    gear = gear_for(logs, target, effects, known_load)
    inputs = [*inputs] if inputs is not None else [prepared(log, preparations) for log in logs]
    made = [
        _run(*both, effects, target, known_load, lowpass_hz, simulated, carried)
        for both in zip(logs, inputs, strict=True)
    ]
    if counted is not None:
        made = [_cut(run, rows) for run, rows in zip(made, counted, strict=True)]
    require_change(target, [run.target for run in made])
    rate = float(np.median([run.log.rate for run in made]))
    rows = sum(run.counted for run in made)
    block = max(round(SECONDS_A_BLOCK * rate), rows // MOST_BLOCKS, 1)
    problem = Problem(
        tuple(made), target, gear, known_load, lowpass_hz, threads, block, tuple(own),
        preparations=tuple(preparations), simulated=simulated, carried=carried, scatter=scatter,
    )  # fmt: skip
    return settled(problem, effects)


def target_range(problem: Problem) -> dict[str, list[float]]:
    """Return the range of the target's own channel, as a device reads it; none for a torsion.

    A torque of the motor is that at its shaft; no load or simulation is taken off, as y has it.
    """
    read = [run.log[problem.target] for run in problem.runs if problem.target in run.log]
    if not read:
        return {}
    return {"target_range": [min(float(t.min()) for t in read), max(float(t.max()) for t in read)]}


@lru_cache(maxsize=256)  # a search asks for the same ones each time that it solves
def _blocks(stretches: tuple[tuple[int, int], ...], length: int) -> list[tuple[int, int]]:
    cut: list[tuple[int, int]] = []
    for first, last in stretches:
        count = max(1, round((last - first) / length))
        cut += pairwise(np.linspace(first, last, count + 1).astype(int).tolist())
    return cut


def columns_of(effects: Sequence[Effect], terms: Sequence[str]) -> list[int]:
    """Return the columns of terms, "effect.term", that the effects have, each once."""
    names = [f"{effect.name}.{term.name}" for effect in effects for term in effect.terms]
    return [names.index(term) for term in terms if term in names]


def own_basis_of(run: Run, rows: Array) -> OwnBasis:
    """Return the directions that rows (N, K) of a run's own terms span over those that count."""

    def counted(values: Array) -> Array:
        return np.concatenate([values[first:last] for first, last in run.stretches])

    lengths = np.linalg.norm(counted(rows), axis=0)
    scale = np.where(lengths > 0.0, lengths, 1.0)
    _, sizes, right = np.linalg.svd(np.linalg.qr(counted(rows / scale), mode="r"))
    seen = sizes > UNSEEN * max(float(sizes.max(initial=0.0)), 1.0)
    right = right[: len(sizes)]
    hidden = np.sum(right[seen] ** 2, axis=0) < 1.0 - UNSEEN
    to_terms = right[seen].T / sizes[seen] / scale[:, None]
    again = np.linalg.inv(np.linalg.qr(counted(rows @ to_terms), mode="r"))  # once lets terms that
    to_terms = to_terms @ again  # are nearly one stand askew by rounding over what is left of them
    return OwnBasis(rows @ to_terms, to_terms, hidden)


def _cut(run: Run, counted: NDArray[np.bool_]) -> Run:
    """The run with the rows that count; what an effect remembers goes on through the others."""
    pieces = [
        (first + int(a), first + int(b))
        for first, last in run.stretches
        for a, b in true_ranges(counted[first:last])
    ]
    if not pieces:
        return run
    rows = tuple(pieces)
    return replace(run, unbroken=rows, stretches=rows, whole=run.whole or run.unbroken)


def _run(
    log: Log,
    made: Log,
    effects: Sequence[Effect],
    target: str,
    known_load: str | None,
    cutoff: float | None,
    simulated: Simulated | None,
    carried: Carried | None,
) -> Run:
    if len(log) < 2:
        raise InputError(f"log '{log.name}': one row is no run; leave it out or record longer")
    y = target_of(log, target, known_load)
    if simulated is not None:
        y = y - simulation_of(log, target, simulated, known_load)
    recorded, log = log, channels_for(made, effects, known_load)
    stretches = [(int(first), int(last)) for first, last in runs(log["time"])]
    made_channels = core_channels(log, effects, known_load, carried)
    channels, lone = _without_lone(made_channels, recorded, stretches)
    stretches = [rows for rows in stretches if rows not in lone]
    require_finite(log, {**channels, target: y})
    for effect in effects:
        if isinstance(effect, OwnEffect):
            effect.require_by_row(channels, len(log), log.name)
    if cutoff is not None:
        require_bandwidth(cutoff, log.rate, f"log '{log.name}', low pass")
        smooth = lowpass(y, log["time"], cutoff)
        y = smooth.values
        stretches = kept_rows(stretches, smooth.valid)
        if not stretches:
            raise InputError(
                f"log '{log.name}': a low pass of {cutoff:g} Hz leaves no row that it sees from "
                "both sides; give a longer log or a higher cutoff"
            )
    filtered = None if cutoff is None else LowPass(log["time"], cutoff)
    return Run(log, channels, y, tuple(stretches), tuple(stretches), filtered)


def _without_lone(
    channels: dict[str, Array], recorded: Log, stretches: Sequence[tuple[int, int]]
) -> tuple[dict[str, Array], list[tuple[int, int]]]:
    """Return channels with zeros for what rows alone between two gaps do not tell, and these rows.

    One row has no velocity and two have no acceleration; they do not count. What was recorded as no
    number stays, for it is refused.
    """
    unknown = {
        name: ~np.isfinite(values) & (np.isfinite(recorded[name]) if name in recorded else True)
        for name, values in channels.items()
    }
    lone = [
        (first, last)
        for first, last in stretches
        if last - first < DERIVED and any(each[first:last].any() for each in unknown.values())
    ]
    if not lone or len(lone) == len(stretches):
        return channels, []
    at = np.zeros(len(recorded), dtype=bool)
    for first, last in lone:
        at[first:last] = True
    return {
        name: np.where(unknown[name] & at, 0.0, values) for name, values in channels.items()
    }, lone


def settled(problem: Problem, effects: Sequence[Effect]) -> Problem:
    """Return the problem in which only rows count whose memory is known.

    Where that would leave next to nothing, all rows count.
    """
    if not any(effect.info.remembers for effect in effects):
        return problem
    design, nothing = problem.design(effects), np.empty(0)
    starts: list[Sequence[tuple[int, int]]] = [
        kept_rows(run.unbroken, design.settled(run.channels, len(run), nothing))
        for run in problem.runs
    ]
    left = sum(last - first for run in starts for first, last in run)
    if left < LEAST_SETTLED * _whole(problem):
        starts = [run.unbroken for run in problem.runs]
    runs = [
        replace(run, stretches=tuple(kept)) for run, kept in zip(problem.runs, starts, strict=True)
    ]
    return replace(problem, runs=tuple(runs))


def kept_rows(
    stretches: Sequence[tuple[int, int]], valid: NDArray[np.bool_]
) -> list[tuple[int, int]]:
    """Shorten each stretch [first, last) to its valid rows; `valid`: (N,)."""
    kept = []
    for first, last in stretches:
        inside = np.flatnonzero(valid[first:last])
        if len(inside):
            kept.append((first + int(inside[0]), first + int(inside[-1]) + 1))
    return kept


def memory_warnings(problem: Problem, effects: Sequence[Effect]) -> list[str]:
    """Say what the unknown start of effects with memory cost."""
    remembering = [effect.name for effect in effects if effect.info.remembers]
    if not remembering:
        return []
    whole = _whole(problem)
    left_out = whole - sum(run.counted for run in problem.runs)
    if left_out:
        return [
            f"{left_out} of {whole} rows at the start of runs do not count: there "
            f"{listed(remembering)} still depends on what came before"
        ]
    design, nothing = problem.design(effects), np.empty(0)
    if all(design.settled(run.channels, len(run), nothing).all() for run in problem.runs):
        return []
    return [
        f"the runs hardly take {listed(remembering)} through its whole width, so that its start, "
        "in the middle, remains a guess; record runs that go further each way"
    ]


def _whole(problem: Problem) -> int:
    return sum(last - first for run in problem.runs for first, last in run.unbroken)


def coarser(ways: Sequence[Preparation]) -> tuple[Preparation, ...]:
    """Return the preparations with the output's motion smoothed at half its bandwidth."""
    return tuple(
        replace(way, bandwidth=HALF * way.bandwidth) if way.channel in MOTION else way
        for way in ways
    )


def away_from_ends(recorded: Log, log: Log, ways: Sequence[Preparation]) -> NDArray[np.bool_]:
    """Return which rows (N,) of a part of a recording no end of it blurs, nor of its load a gap."""
    moving, time = [way for way in ways if way.channel in MOTION], log["time"]
    other = [way for way in ways if way.channel not in (*MOTION, SLOW)]
    unbroken = runs(recorded["time"])
    first, last = recorded["time"][unbroken[:, 0]], recorded["time"][unbroken[:, 1] - 1]
    own = np.searchsorted(first, time, side="right") - 1
    ends, gaps = _reach([*moving, *other]), _reach(other)
    inside = (time >= first[0] + ends) & (time <= last[-1] - ends)
    inside &= (time >= first[own] + gaps) & (time <= last[own] - gaps)
    return inside if np.mean(inside) >= LEAST else np.ones(len(log), dtype=bool)


def _reach(ways: Sequence[Preparation]) -> float:
    """How far the rows of the widest smoother lie on either side, s."""
    return max((LocalFit(way.bandwidth).half_length for way in ways), default=0.0)


def unresolved_speed(problem: Problem, width: float) -> float:
    """Return how well the speed is known where the joint turns over, rad/s; 0 where as recorded.

    What a smoother of bandwidth B takes of it falls as B^-p, with p = 1 at a corner and 4 in a
    smooth motion. So from two steps, to B/2 and on to B/4, whose RMS are r and ρ r,

        e = r / (ρ − 1)

    is what it takes at B, by extrapolation, and at most r. The value is twice that: a width was
    off by up to 3.3 e in strokes and in waves behind 12 to 19 bit. Rows below twice the speed
    `width` within which friction turns over, all of them: those that the test of resolution leaves
    are the ones that moved little. Runs that know it well make up for others, as in a mean.
    """
    way = next((way for way in problem.preparations if way.channel == VELOCITY), None)
    if way is None:
        return 0.0
    smoothers = [LocalFit(HALF**k * way.bandwidth) for k in (1, 2)]
    rows, weights = 0, 0.0
    for run in problem.runs:
        steps = [np.empty((0, 2))]
        for first, last in run.whole or run.unbroken:
            time, speed = run.log["time"][first:last], run.channels[VELOCITY][first:last]
            slow = np.abs(speed) < TURNING * width
            if slow.any():
                half, quarter = (smoother.apply(time, speed) for smoother in smoothers)
                steps.append(np.column_stack([half - speed, quarter - half])[slow])
        moved = np.concatenate(steps)
        squares = np.sum(moved[np.isfinite(moved).all(axis=1)] ** 2, axis=0)
        if squares.all():
            rows += len(moved)
            growth = max(float(np.sqrt(squares[1] / squares[0])) - 1.0, 1.0)
            weights += len(moved) ** 2 * growth**2 / float(squares[0])
    return 2.0 * float(np.sqrt(rows / weights)) if weights else 0.0


def noise_of_load(problem: Problem, denominator: Array, decimation: int = 1) -> float:
    """Return what the noise of a known load has in common with a scale of it, per row, unit · Nm.

    The target has −n in it, for the noise n, white and of RMS `scatter`; the column of the load has
    what the smoother G of the load leaves of n. Behind a filter A of one row of `decimation`

        v = ∫ S |A|² G df,  S = 2 scatter² / rate
    """
    known, log = problem.known_load, problem.runs[0].log
    if known is None or not problem.scatter:
        return 0.0
    frequency = np.linspace(0.0, 0.5 * log.rate, FREQUENCIES)
    passed = [way.bandwidth for way in problem.preparations if way.channel == known]
    passed += [problem.lowpass] * 2 if problem.lowpass else []  # of target and columns
    gain = np.prod([np.ones_like(frequency), *(response(frequency, b) for b in passed)], axis=0)
    left = _squared_gain(denominator, frequency, log.rate / decimation)
    unit = torque_of_current(log, known) if problem.target == "motor_current" else 1.0
    return float(2.0 * problem.scatter**2 / log.rate / unit * np.trapezoid(gain * left, frequency))


def noise_of_acceleration(
    problem: Problem, inputs: Sequence[ChannelNoise], denominator: Array
) -> float:
    """Return the mean square that noise leaves in an acceleration that is made, (rad/s²)²; else 0.

    Of a source of which it is the k-th derivative, with white noise of RMS n at a rate, behind the
    smoother G and a filter A of the rows

        v = ∫ S (2πf)^2k G² |A|² df,  S = 2 n² / rate
    """
    way = next((way for way in problem.preparations if way.channel == ACCELERATION), None)
    noise = next((one for one in inputs if way is not None and one.channel == way.source), None)
    if way is None or noise is None:
        return 0.0
    rate = problem.runs[0].log.rate
    frequency = np.linspace(0.0, 0.5 * rate, FREQUENCIES)
    order = 2 if way.source.endswith("position") else 1
    passed = (2.0 * np.pi * frequency) ** order * response(frequency, way.bandwidth)
    left = _squared_gain(denominator, frequency, rate)
    return float(2.0 * noise.noise**2 / rate * np.trapezoid(passed**2 * left, frequency))


def _squared_gain(denominator: Array, frequency: Array, rate: float) -> Array:
    """|A|² of a filter of rows at a rate, at frequencies, all in Hz."""
    late = np.outer(frequency, np.arange(len(denominator))) / rate
    return np.asarray(np.abs(np.exp(-2j * np.pi * late) @ denominator) ** 2)


def with_fastest(base: Sequence[Effect]) -> list[Effect]:
    """Return the base with the effects that turn over fastest."""
    names = {effect.name for effect in base}
    return [*base, *(Effect(name) for name in BASIC_FRICTION if name not in names)]


def resolved_rows(
    logs: Sequence[Log], measured: Sequence[Array], predicted: Sequence[tuple[Array, Array]]
) -> Masks:
    """Return which rows of each run count, (N,).

    Parameters
    ----------
    measured : target of each run, (N,).
    predicted : of each run, with the motion as it is prepared and smoothed further, (N,) both.
    """
    left = [y - told for y, (told, _) in zip(measured, predicted, strict=True)]
    noise = float(np.median([_noise(log, rest) for log, rest in zip(logs, left, strict=True)]))
    return [np.abs(told - other) <= noise for told, other in predicted]


def _noise(log: Log, residual: Array) -> float:
    """Standard deviation of what a model leaves, from its median change after a short time."""
    lag = max(1, min(round(SHORT * log.rate), len(residual) - 1))
    return float(np.nanmedian(np.abs(residual[lag:] - residual[:-lag])) / 0.6745 / np.sqrt(2.0))
