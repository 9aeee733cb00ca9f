"""Autocorrelation of the noise, and the effective sample size of a cell.

The noise is autoregressive (`least_squares/noise_model.py`), fitted to what `search.py` leaves of
the residual where the joint moves. With its autocorrelation ρ_h and A_j(h) pairs of rows h apart
that are both in cell j

    var(mean of cell j) = s_j² / n_j² Σ_h ρ_h A_j(h) = s_j² τ_j / n_j

and n_j / τ_j rows are independent. A_j is counted at a few lags and interpolated linearly between.
The mean square has the same with ρ_h² (Gaussian noise), times 2. Source: [Bartlett1946]. Where
means of long batches scatter more than the model says, the sums of ρ are that much larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.runs import Rows
from flexspline.least_squares.noise_model import Chunk, NoiseModel, noise_model

__all__ = [
    "Memory",
    "memory_of",
]

Array = NDArray[np.float64]

LARGEST_ORDER = 32
LONGEST = 1 << 15  # rows of memory
NEGLIGIBLE = 1e-3
LAGS = 14
BATCH = 2  # times the memory: the shortest batch
LEAST_BATCHES = 20
_FFT = 1 << 18
_LEAST_TAU = 0.1
_LEAST_DEGREES = 4.0


@dataclass(frozen=True, eq=False)
class Memory:
    """The noise's autocorrelation, as weights at a few lags.

    `model`: autoregressive. `lags`: (L,), rows. `weights`: (L,), sums of ρ around each lag, both
    signs of h; `squares`: the same of ρ². `degrees`: of freedom that an error estimate has.
    `blocks`: rows at which pairs are counted, (start, stop).
    """

    model: NoiseModel
    lags: NDArray[np.intp]
    weights: Array
    squares: Array
    degrees: float
    blocks: tuple[tuple[int, int], ...]

    def times(self, cells: NDArray[np.integer], count: int) -> tuple[Array, Array]:
        """Return τ of the mean and of the mean square of each cell, (count,) each."""
        pairs = np.zeros((len(self.lags), count))
        for first, last in self.blocks:
            part = cells[first:last]
            for k, lag in enumerate(self.lags):
                early, late = part[: max(len(part) - lag, 0)], part[lag:]
                same = early[(early == late) & (early >= 0)]
                pairs[k] += np.bincount(same, minlength=count)
        seen = pairs[0] > 0
        share = np.where(seen, pairs / np.where(seen, pairs[0], 1.0), 1.0)
        mean, square = self.weights @ share, self.squares @ share
        return np.maximum(mean, _LEAST_TAU), np.maximum(square, _LEAST_TAU)


def memory_of(rows: Rows, rest: Array, decimation: int = 1) -> Memory:
    """Fit the noise's memory to `rest`, (N,), what is left of the residual on `rows.looked_at`.

    Parameters
    ----------
    decimation : of how many rows one is news, for a residual that was low-passed.
    """
    blocks = rows.looked_at
    moving = rows.direction > 0
    if 2 * np.count_nonzero(moving) < len(rows):
        moving[:] = True  # at rest what holds the joint is no noise; but here is little else
    chunks = [_chunk(rest, np.arange(*block), moving) for block in blocks]
    size = sum(len(chunk.residual) for chunk in chunks)
    basis = np.full((1, 1), 1.0 / np.sqrt(size))
    model = noise_model(lambda: iter(chunks), basis, max_order=LARGEST_ORDER, decimation=decimation)
    rho = _autocorrelation(model, max(last - first for first, last in blocks))
    lags = _lags(len(rho) - 1)
    degrees = max(_LEAST_DEGREES, model.samples / max(model.memory, 1.0) - 1.0)
    longer = _longer(rho, rest, blocks, round(model.memory * decimation))
    return Memory(model, lags, longer * _hats(rho, lags), _hats(rho**2, lags), degrees, blocks)


def _longer(rho: Array, rest: Array, blocks: Sequence[tuple[int, int]], memory: int) -> float:
    """How many times more the means of long batches scatter than the model says, at least 1.

    An order chosen for what comes next misses slow noise under white noise.
    """
    found = [1.0]
    square = float(np.mean([np.mean(rest[a:b] ** 2) for a, b in blocks]))
    if square == 0.0:  # nothing scatters
        return 1.0
    for size in (BATCH * memory, 2 * BATCH * memory, 4 * BATCH * memory):
        means = [
            rest[a : a + (b - a) // size * size].reshape(-1, size).mean(axis=1)
            for a, b in blocks
            if size > 0
        ]
        batches = np.concatenate(means) if means else np.empty(0)
        if len(batches) < LEAST_BATCHES:
            break
        lag = np.arange(1, min(len(rho), size))
        told = (1.0 + 2.0 * float(((1.0 - lag / size) * rho[lag]).sum())) / size
        found.append(float(np.mean(batches**2)) / (square * told))
    return max(found)


def _chunk(rest: Array, part: NDArray[np.intp], moving: NDArray[np.bool_]) -> Chunk:
    part = part[moving[part]]
    return Chunk(np.ones((len(part), 1)), rest[part], np.diff(part, prepend=-2) > 1)


def _autocorrelation(model: NoiseModel, rows: int) -> Array:
    """ρ_h of all lags that matter, from the model's spectrum; straight between decimated rows."""
    power = np.abs(np.fft.rfft(model.denominator, _FFT)) ** -2.0
    gamma = np.fft.irfft(power)[: max(2, min(LONGEST, rows // 2) // model.decimation)]
    rho = gamma / gamma[0]
    last = int(np.flatnonzero(np.abs(rho) > NEGLIGIBLE)[-1]) + 2
    rho = np.append(rho, 0.0)[: last + 1]
    fine = np.arange(model.decimation * (len(rho) - 1) + 1)
    return np.asarray(np.interp(fine / model.decimation, np.arange(len(rho)), rho))


def _lags(last: int) -> NDArray[np.intp]:
    grown = np.unique(np.round(np.geomspace(1, max(last, 1), LAGS)).astype(np.intp))
    return np.concatenate([[0], grown])


def _hats(rho: Array, lags: NDArray[np.intp]) -> Array:
    """Sums of ρ over lags of both signs, shared between the two lags beside."""
    every = np.arange(lags[-1] + 1)
    values = np.append(rho, np.zeros(max(0, len(every) - len(rho))))[: len(every)]
    both = np.where(every == 0, 1.0, 2.0) * values
    after = np.clip(np.searchsorted(lags, every), 1, len(lags) - 1)
    share = (every - lags[after - 1]) / (lags[after] - lags[after - 1])
    made = np.bincount(after, weights=share * both, minlength=len(lags))
    made += np.bincount(after - 1, weights=(1.0 - share) * both, minlength=len(lags))
    return np.asarray(made)
