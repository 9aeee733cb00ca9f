"""Sums of products of rows and target, in blocks of a second or two: what fits are made of.

Blocks are labelled with their run, can be added up in any choice, pickled and shipped. With
`low` they are double-double: exact products, about 31 digits. A log larger than memory, or a
fleet's logs on many machines, is summed piece by piece:

    sums = accumulate(effects, (log.rows(slice(i, i + n)) for i in range(0, len(log), n)), target)
    sums.solve().coefficients
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import Effect, effect, require_effects
from flexspline.errors import InputError
from flexspline.logs.read import LogLike, as_log, is_one
from flexspline.own import design_of
from flexspline.signals import (
    channels_for,
    core_channels,
    gear_for,
    require_finite,
    require_load,
    target_of,
)

__all__ = [
    "Solution",
    "Sums",
    "accumulate",
    "joined",
    "solve",
]

Array = NDArray[np.float64]

BLOCK = 1 << 17


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of products of [X, y] of blocks of rows.

    `high`: (B, P+1, P+1), `low`: the same or (0, P+1, P+1). `rows`: (B,) samples in each block.
    `run`: (B,) number of the run that the block is from.
    """

    high: Array
    low: Array
    rows: NDArray[np.int64]
    run: NDArray[np.int64]

    @property
    def exact(self) -> bool:
        return len(self.low) > 0

    def __add__(self, other: Sums) -> Sums:
        """Blocks of both, one after the other."""
        return joined([self, other])

    def columns(self, chosen: Sequence[int]) -> Sums:
        """Return the sums of some columns of X, with the target."""
        pick = [*chosen, self.high.shape[1] - 1]
        grid = np.ix_(range(len(self.high)), pick, pick)
        low = self.low[np.ix_(range(len(self.low)), pick, pick)]
        return Sums(self.high[grid], low, self.rows, self.run)

    def spread(self, place: NDArray[np.intp], count: int) -> Sums:
        """Return the sums with column k moved to column place[k] of `count`, zeros elsewhere."""
        pick = [*place.tolist(), count]
        high = np.zeros((len(self.high), count + 1, count + 1))
        low = np.zeros((len(self.low), count + 1, count + 1))
        high[np.ix_(range(len(high)), pick, pick)] = self.high
        low[np.ix_(range(len(low)), pick, pick)] = self.low
        return Sums(high, low, self.rows, self.run)

    def solve(self) -> Solution:
        """Least squares over all blocks."""
        return solve(*self.total())

    def total(self, chosen: Iterable[int] | None = None) -> tuple[Array, Array]:
        """Return (high, low) of the sum over all or some blocks."""
        blocks = list(range(len(self.high)) if chosen is None else chosen)
        high, low = _core.merge(self.high, self.low, blocks)
        return high, low


@dataclass(frozen=True, eq=False)
class Solution:
    """Least squares: coefficients of least norm (columns scaled to length one), and the factor.

    `coefficients`: (P,). `factor`: (rank, P), XᵀX = factorᵀ factor. `rotated_target`: (rank,).
    `null_space`: (P, P - rank), combinations of coefficients that the data do not see.
    `lengths`: (P,), of the columns. `condition`: of the scaled basic columns.
    """

    coefficients: Array
    factor: Array
    rotated_target: Array
    null_space: Array
    lengths: Array
    residual_squares: float
    condition: float
    double_is_enough: bool

    @property
    def rank(self) -> int:
        return len(self.factor)

    @property
    def basis(self) -> Array:
        """(P, rank): V/s of the scaled factor; rows @ basis are orthonormal columns."""
        _, singular, right = np.linalg.svd(self.factor / self.lengths, full_matrices=False)
        return np.asarray(right.T / singular / self.lengths[:, None])


def joined(parts: Sequence[Sums]) -> Sums:
    """Blocks of all, one after the other."""
    low = np.concatenate([part.low for part in parts])
    return Sums(
        np.concatenate([part.high for part in parts]),
        low if all(part.exact for part in parts) else low[:0],
        np.concatenate([part.rows for part in parts]),
        np.concatenate([part.run for part in parts]),
    )


def solve(high: Array, low: Array) -> Solution:
    """Solve least squares from one sum of products of [X, y].

    Parameters
    ----------
    high, low : (P+1, P+1), low may be (0, 0).
    """
    raw = _core.solve(high, low)
    lengths = np.sqrt(np.maximum(np.diag(high)[:-1], 0.0))
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    null_space = _null_space(raw, len(lengths))
    coefficients = np.asarray(raw.coefficients)
    if null_space.shape[1]:
        scaled = null_space * lengths[:, None]
        along = np.linalg.lstsq(scaled, coefficients * lengths, rcond=None)[0]
        coefficients = coefficients - null_space @ along
    return Solution(
        coefficients,
        np.asarray(raw.factor),
        np.asarray(raw.rotated_target),
        null_space,
        lengths,
        raw.residual_squares,
        raw.condition,
        raw.double_is_enough,
    )


def _null_space(raw: _core.Solution, columns: int) -> Array:
    """Columns n with X n = 0: each dependent column minus what it is made of."""
    order = np.asarray(raw.order, dtype=int)
    null_space = np.zeros((columns, columns - raw.rank))
    for d, dependent in enumerate(order[raw.rank :]):
        null_space[order[: raw.rank], d] = -raw.dependence[d]
        null_space[dependent, d] = 1.0
    return null_space


def accumulate(
    effects: Iterable[str | Effect],
    logs: Iterable[LogLike],
    target: str,
    *,
    known_load: str | None = None,
    exact: bool = False,
    threads: int = 1,
) -> Sums:
    """Sum the products of rows and target over logs, one at a time.

    Parameters
    ----------
    effects : with their shapes and orders; nothing is searched for.
    logs : read one after the other; a generator of pieces of a long log keeps memory constant.
        Pieces are summed by themselves: a velocity that is to be derived must be there already.
    target, known_load : as for `fit`. Effects that depend on the load see the known load alone.
    exact : sum in double-double, for designs with a condition number above 1e3.
    threads : for the blocks of each log.

    Returns
    -------
    Sums
        One block for each log: add them up, pickle them, leave some out, solve.

    Raises
    ------
    InputError
        As `fit`, and where there is no log.
    """
    chosen = [e if isinstance(e, Effect) else effect(e) for e in effects]
    for e in chosen:
        if e.info.remembers:
            raise InputError(
                f"effect '{e.name}' remembers what came before a piece of a log; fit whole runs "
                "or leave it out"
            )
    require_effects(chosen, target)
    require_load(chosen, known_load)
    pieces = []
    several = cast("Iterable[LogLike]", [logs] if is_one(logs) else logs)
    for number, log in enumerate(as_log(each) for each in several):
        log = channels_for(log, chosen, known_load)
        channels = core_channels(log, chosen, known_load)
        y = target_of(log, target, known_load)
        design = design_of(chosen, gear_for([log], target, chosen))
        blocks = [(i, min(i + BLOCK, len(log))) for i in range(0, len(log), BLOCK)]
        nothing = np.empty(0)
        high, low = design.accumulate(
            channels, y, blocks, nothing, nothing, None, exact, True, threads
        )
        if not np.isfinite(high).all():
            require_finite(log, {**channels, target: y})
        high, low = _core.merge(high, low, list(range(len(blocks))))
        rows, label = np.array([len(log)]), np.array([number])
        pieces.append(Sums(high[None], low.reshape(-1, *high.shape), rows, label))
    if not pieces:
        raise InputError("there is no log to sum over; give at least one")
    return joined(pieces)
