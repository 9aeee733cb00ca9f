"""The rows of all runs that are compared, side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.runs import Compared, ComparedRun
from flexspline.errors import InputError
from flexspline.logs.segments import runs as unbroken

__all__ = ["STILL_IN_NOISE", "Rows", "rows_of"]

Array = NDArray[np.float64]

LEAST_ROWS = 200
MOST_LOOKED_AT = 300_000  # for the noise and its memory
BLOCK = 16_384
STILL_IN_NOISE = 3.0  # standard deviations of the velocity that have no direction
_SLOW_OF_USUAL = 1e-2
_STILL_OF_USUAL = 1e-3  # of the speed that 99 % of the rows stay below


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows that count, of all runs together, (N,).

    Parameters
    ----------
    residual : in the unit of the comparison.
    run : number of the run.
    starts : first row of each unbroken stretch, as indices.
    direction : 0 standing still, 1 forward, 2 backward; 0 where there is no velocity.
    allowance : mean shift of the residual that the velocity's noise may cause, its unit.
    doubt : standard deviation of the same.
    still : for each run, rad/s that count as standing still.
    slow : for each run, rad/s below which nothing is a reversal, as in `logs/segments.py`.
    counts : for each run, which of its rows are here.
    floor : noise of what is measured, where it is known.
    """

    residual: Array
    run: NDArray[np.int32]
    starts: NDArray[np.intp]
    direction: NDArray[np.int8]
    allowance: Array
    doubt: Array
    still: tuple[float, ...]
    slow: tuple[float, ...]
    counts: tuple[NDArray[np.bool_], ...]
    floor: float | None = None

    def __len__(self) -> int:
        return len(self.residual)

    @cached_property
    def looked_at(self) -> tuple[tuple[int, int], ...]:
        """Unbroken pieces (start, stop); of many rows shorter ones, evenly spread."""
        whole = list(pairwise([*self.starts.tolist(), len(self)]))
        every = -(-len(self) // MOST_LOOKED_AT)
        if every == 1:
            return tuple(whole)
        cut = [(a, min(a + BLOCK, b)) for first, b in whole for a in range(first, b, BLOCK)]
        return tuple(cut[::every])

    def column(self, compared: Compared, of: Callable[[ComparedRun, int], Array]) -> Array:
        """Put together a value for each row: `of` gives one for each row of run number k."""
        made = (of(run, k)[keep] for k, (run, keep) in enumerate(zip(compared.runs, self.counts,
                                                                     strict=True)))  # fmt: skip
        return np.concatenate([np.asarray(values, dtype=np.float64) for values in made])


def rows_of(compared: Compared) -> Rows:
    """Return the rows with a measured and a modelled value.

    Raises
    ------
    InputError
        Where they are too few to be judged.
    """
    counts = tuple(np.isfinite(run.residual) for run in compared.runs)
    if sum(int(c.sum()) for c in counts) < LEAST_ROWS:
        raise InputError(
            f"the logs have {sum(int(c.sum()) for c in counts)} rows to compare and "
            f"{LEAST_ROWS} are needed at least; give longer runs"
        )
    still = tuple(_still(run, _STILL_OF_USUAL) for run in compared.runs)
    slow = tuple(_still(run, _SLOW_OF_USUAL) for run in compared.runs)
    parts = [
        (run.residual[keep], *_moving(run, limit, keep))
        for run, limit, keep in zip(compared.runs, still, counts, strict=True)
    ]
    residual, direction, allowance, doubt = (
        np.concatenate(columns) for columns in zip(*parts, strict=True)
    )
    sizes = [int(c.sum()) for c in counts]
    run = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)
    return Rows(residual, run, _starts(compared, counts), direction.astype(np.int8), allowance,
                doubt, still, slow, counts, compared.floor)  # fmt: skip


def _still(run: ComparedRun, share: float) -> float:
    if "output_velocity" not in run.log:
        return 0.0
    usual = float(np.nanpercentile(np.abs(run.log["output_velocity"]), 99))
    return max(STILL_IN_NOISE * run.velocity_noise, share * usual)


def _moving(
    run: ComparedRun, still: float, keep: NDArray[np.bool_]
) -> tuple[NDArray[np.int8], Array, Array]:
    """Direction, allowance and doubt of the rows kept."""
    doubt = run.doubt[keep]
    if "output_velocity" not in run.log:
        return np.zeros(len(doubt), dtype=np.int8), np.zeros(len(doubt)), doubt
    velocity = run.log["output_velocity"][keep]
    direction = np.where(velocity > still, 1, np.where(velocity < -still, 2, 0))
    near = np.abs(velocity) <= (STILL_IN_NOISE + 1.0) * run.velocity_noise
    return direction.astype(np.int8), np.where(near, doubt, 0.0), doubt


def _starts(compared: Compared, counts: tuple[NDArray[np.bool_], ...]) -> NDArray[np.intp]:
    found, first = [], 0
    for run, keep in zip(compared.runs, counts, strict=True):
        time = run.log["time"][keep]
        if len(time):
            found.append(first + unbroken(time)[:, 0])
        first += len(time)
    return np.concatenate(found)
