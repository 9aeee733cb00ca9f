"""How good a fit is: overall, and where.

All scores are of residuals e = measured − predicted on the rows that count; the cross-validated
ones are those to believe.

    RMSE = √(mean e²),  bias = mean e,  variance = mean (e − bias)²,  R² = 1 − Σe² / Σ(y − ȳ)²
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.least_squares.problem import Problem
from flexspline.logs.log import Log
from flexspline.logs.segments import near_reversal, standstill

__all__ = ["REVERSAL_SECONDS", "Score", "bands", "groups", "score", "scores_of"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SPEED_BANDS = 5
TEMPERATURE_BANDS = 3
REVERSAL_SECONDS = 0.1
LEAST_ROWS = 10


@dataclass(frozen=True)
class Score:
    """Residuals of one part of the rows. Units: the target's, variance its square.

    `group`: "all", "run", "direction", "speed", "temperature" or "reversals"; `label`: which
    part; `cv_rmse`: the RMSE on rows that the fit never saw.
    """

    group: str
    label: str
    rows: int
    rmse: float
    cv_rmse: float
    bias: float
    variance: float
    r_squared: float


def score(group: str, label: str, y: Array, residual: Array, held_out: Array) -> Score:
    """Return the score of some rows, all arrays of shape (n,)."""
    bias = float(residual.mean())
    squares, spread = float(residual @ residual), _about(y, float(y.mean()))
    return Score(
        group,
        label,
        len(y),
        float(np.sqrt(squares / len(y))),
        float(np.sqrt(held_out @ held_out / len(y))),
        bias,
        _about(residual, bias) / len(y),
        1.0 - squares / spread if spread > 0.0 else float("nan"),
    )


def _about(values: Array, middle: float) -> float:
    """Σ (value − middle)²"""
    apart = values - middle
    return float(apart @ apart)


def scores_of(
    problem: Problem, residuals: Sequence[Array], held_out: Sequence[Array]
) -> tuple[Score, ...]:
    """Score residuals by run, direction, speed, temperature and nearness to a reversal.

    Parameters
    ----------
    residuals, held_out : an array (N,) for each run; NaN in `held_out` on rows that do not count.
    """
    counts = [np.isfinite(rows) for rows in held_out]
    y, inside, outside = (
        _joined([v if c.all() else v[c] for v, c in zip(list_, counts, strict=True)])
        for list_ in ([run.target for run in problem.runs], residuals, held_out)
    )
    found = [score("all", "all rows", y, inside, outside)]

    def scored(part: tuple[str, str, Mask]) -> Score:
        group, label, mask = part
        return score(group, label, y[mask], inside[mask], outside[mask])

    parts = groups([run.log for run in problem.runs], counts)
    seen = (part for part in parts if part[-1].sum() >= LEAST_ROWS)
    return (*found, *map(scored, seen))  # by one thread: each part is a copy of its rows


def groups(logs: Sequence[Log], counts: Sequence[Mask]) -> Iterator[tuple[str, str, Mask]]:
    """Yield group, label and the rows (n,) of each part of the n rows that count.

    Parameters
    ----------
    logs : runs.
    counts : (N,) for each run, which of its rows count.
    """
    number = np.concatenate([np.full(c.sum(), k) for k, c in enumerate(counts)])
    if len(logs) > 1:
        for k, log in enumerate(logs):
            yield "run", log.name, number == k
    if all("output_velocity" in log or "output_position" in log for log in logs):
        yield from _by_motion(logs, counts)
    if all("temperature" in log for log in logs):
        temperature = _channel(logs, counts, "temperature")
        yield from bands("temperature", temperature, TEMPERATURE_BANDS, "°C")


def _by_motion(logs: Sequence[Log], counts: Sequence[Mask]) -> Iterator[tuple[str, str, Mask]]:
    still = _masks(logs, counts, standstill)
    if all("output_velocity" in log for log in logs):
        velocity = _channel(logs, counts, "output_velocity")
        yield "direction", "forward", ~still & (velocity > 0)
        yield "direction", "backward", ~still & (velocity < 0)
        yield from bands("speed", np.where(still, np.nan, np.abs(velocity)), SPEED_BANDS, "rad/s")
    yield "direction", "standstill", still
    near = _masks(logs, counts, lambda log: near_reversal(log, REVERSAL_SECONDS))
    yield "reversals", f"within ±{REVERSAL_SECONDS:g} s of a reversal", near
    yield "reversals", "elsewhere", ~near


def bands(group: str, values: Array, count: int, unit: str) -> Iterator[tuple[str, str, Mask]]:
    """Yield bands of about as many rows each; one band is no news."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return
    edges = np.unique(np.quantile(finite, np.linspace(0.0, 1.0, count + 1)))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-3 * (edges[-1] - edges[0])])]
    if len(edges) < 3:
        return
    for low, high in pairwise(edges):
        last = high == edges[-1]
        mask = (values >= low) & ((values <= high) if last else (values < high))
        yield group, f"{low:.3g} to {high:.3g} {unit}", mask


def _channel(logs: Sequence[Log], counts: Sequence[Mask], channel: str) -> Array:
    parts = zip((log[channel] for log in logs), counts, strict=True)
    return _joined([values if c.all() else values[c] for values, c in parts])


def _joined(parts: Sequence[Array]) -> Array:
    """One array behind the other; a long one alone is not copied."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _masks(logs: Sequence[Log], counts: Sequence[Mask], of: Callable[[Log], Mask]) -> Mask:
    return np.concatenate([of(log)[c] for log, c in zip(logs, counts, strict=True)])
