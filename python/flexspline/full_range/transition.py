"""The transition from compliance to observer, (20), chosen on training logs for the least RMSE.

The error of the merged estimate (19) is λ e_o + (1 − λ) e_c, so its square needs three sums in
each of many narrow bands of speed, and any α and q̇_trans is tried without the rows. Blocks of
time drawn again with replacement [Kuensch1989] tell how well the optimum is known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError

__all__ = ["Transition", "choose_transition", "merge_weight"]

Array = NDArray[np.float64]

BANDS = 400
DRAWS = 200
ZOOMS = 6
STEEPEST = 1e4  # s/rad; a step within 1 mrad/s
GRID = 30
SHUT_OUT = 0.05  # weight at rest from which the observer is not shut out


@dataclass(frozen=True)
class Transition:
    """The chosen α and q̇_trans.

    Parameters
    ----------
    alpha, transition_velocity : s/rad and rad/s, at the output.
    alpha_interval, velocity_interval : 95 % of the optima of blocks drawn again.
    rmse : on the training rows, Nm.
    rmse_observer, rmse_compliance : of either alone.
    """

    alpha: float
    transition_velocity: float
    alpha_interval: tuple[float, float]
    velocity_interval: tuple[float, float]
    rmse: float
    rmse_observer: float
    rmse_compliance: float

    @property
    def weight_at_rest(self) -> float:
        """λ(0), the observer's share of the estimate at standstill."""
        return float(merge_weight(np.zeros(1), self.alpha, self.transition_velocity)[0])

    @property
    def warning(self) -> str | None:
        """A sentence where the observer is not shut out at standstill."""
        if not self.weight_at_rest > SHUT_OUT:
            return None
        return (
            f"λ(0) = {self.weight_at_rest:.3f}: at standstill {100 * self.weight_at_rest:.0f} % of "
            "the merged torque is the observer's, which is blind there; "
            f"weight_at_rest={SHUT_OUT:g} shuts it out"
        )


def merge_weight(velocity: Array, alpha: float, transition_velocity: float) -> Array:
    """Return λ(q̇) of (20), (N,), for a velocity in rad/s at the output."""
    return np.asarray(
        _core.merge_weight(velocity, alpha=alpha, transition_velocity=transition_velocity)
    )


def choose_transition(
    velocity: Array,
    observer_error: Array,
    compliance_error: Array,
    block: NDArray[np.intp],
    *,
    weight_at_rest: float | None = None,
    seed: int = 0,
) -> Transition:
    """Return the α and q̇_trans with the least RMSE.

    Parameters
    ----------
    velocity : (N,), rad/s at the output.
    observer_error, compliance_error : (N,), Nm.
    block : (N,), number of the block of time of each row, from 0.
    weight_at_rest : largest λ(0) allowed, above 0 and below 1; None for any.
    seed : of the blocks drawn.

    Raises
    ------
    InputError
        For a weight at rest that is no share.
    """
    if weight_at_rest is not None and not 0.0 < weight_at_rest < 1.0:
        raise InputError(f"weight_at_rest = {weight_at_rest:g} is no share; give 0 < λ(0) < 1")
    speed = np.abs(velocity)
    sums, middles = _sums(speed, observer_error, compliance_error, block)
    grid = _Grid.over(speed, middles, weight_at_rest)
    total = sums.sum(axis=0)
    alpha, transition_velocity = grid.refined(total)
    rng = np.random.default_rng(seed)
    picks = rng.integers(0, len(sums), (DRAWS, len(sums)))
    around = grid.around(grid.drawn(sums, picks))
    low, high = np.quantile(around.drawn(sums, picks), [0.025, 0.975], axis=0)
    rows, weight = len(speed), merge_weight(middles, alpha, transition_velocity)
    return Transition(
        alpha,
        transition_velocity,
        (min(float(low[0]), alpha), max(float(high[0]), alpha)),
        (min(float(low[1]), transition_velocity), max(float(high[1]), transition_velocity)),
        float(np.sqrt(_squares(total, weight) / rows)),
        float(np.sqrt(total[:, 0].sum() / rows)),
        float(np.sqrt(total[:, 2].sum() / rows)),
    )


def _sums(
    speed: Array, observer: Array, compliance: Array, block: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Σ e_o², Σ e_o e_c, Σ e_c² of each block and band, (K, B, 3), and the bands' speeds (B,)."""
    edges = np.unique(np.quantile(speed, np.linspace(0.0, 1.0, BANDS + 1)))
    band = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, max(len(edges) - 2, 0))
    bands, blocks = max(len(edges) - 1, 1), int(block.max()) + 1
    cell = block * bands + band
    products = (observer**2, observer * compliance, compliance**2)
    sums = [np.bincount(cell, weights=p, minlength=blocks * bands) for p in products]
    count = np.maximum(np.bincount(band, minlength=bands), 1)
    middles = np.bincount(band, weights=speed, minlength=bands) / count
    table = np.stack(sums, axis=1).reshape(blocks, bands, 3).astype(np.float64)
    return table, np.asarray(middles)


def _squares(sums: Array, weight: Array) -> Any:
    """Σ (λ e_o + (1 − λ) e_c)² from the sums of each band (B, 3, ...); weights (B,) or (G, B)."""
    rest = 1.0 - weight
    return weight**2 @ sums[:, 0] + 2 * (weight * rest) @ sums[:, 1] + rest**2 @ sums[:, 2]


@dataclass(frozen=True)
class _Grid:
    """Values of α and q̇_trans that are tried, (G, 2), with their weights in the bands (G, B).

    `speed`: the bands' speeds; `least`: α q̇_trans that λ(0) asks for.
    """

    nodes: Array
    weights: Array
    speed: Array
    least: float

    @classmethod
    def over(cls, speed: Array, middles: Array, weight_at_rest: float | None) -> _Grid:
        """Return a grid with a node in every part of the speeds that occur, however slow."""
        fastest = float(speed.max()) or 1.0
        fast = np.unique(
            np.concatenate(
                [
                    np.linspace(0.0, fastest, GRID),
                    np.quantile(speed, np.linspace(0.02, 0.98, GRID)),
                ]
            )
        )
        steep = np.geomspace(1.0 / fastest, max(STEEPEST, 2.0 / fastest), GRID)
        least = -np.inf if weight_at_rest is None else float(np.log(1.0 / weight_at_rest - 1.0))
        return cls._of(steep, fast, middles, least)

    @classmethod
    def _of(cls, steep: Array, fast: Array, middles: Array, least: float) -> _Grid:
        nodes = np.stack(np.meshgrid(steep, fast, indexing="ij"), axis=-1).reshape(-1, 2)
        nodes = nodes[nodes[:, 0] * nodes[:, 1] >= least]
        return cls(nodes, np.array([merge_weight(middles, *n) for n in nodes]), middles, least)

    def best(self, sums: Array) -> tuple[float, float]:
        """Return the node with the least sum of squares."""
        found = self.nodes[int(np.argmin(_squares(sums, self.weights)))]
        return float(found[0]), float(found[1])

    def around(self, found: Array) -> _Grid:
        """Return a finer grid over these nodes (D, 2) and their neighbours."""
        axes = []
        for column in (0, 1):
            known = np.unique(self.nodes[:, column])
            first, last = np.searchsorted(known, [found[:, column].min(), found[:, column].max()])
            ends = known[max(first - 1, 0)], known[min(last + 1, len(known) - 1)]
            axes.append(np.geomspace(*ends, GRID) if column == 0 else np.linspace(*ends, GRID))
        return _Grid._of(axes[0], axes[1], self.speed, self.least)

    def drawn(self, sums: Array, picks: NDArray[np.intp]) -> Array:
        """Return the best node of each draw (D, 2): of the sums (K, B, 3) of the blocks (D, K)."""
        often = np.array([np.bincount(pick, minlength=len(sums)) for pick in picks], dtype=float)
        each = np.tensordot(often, sums, axes=1)
        costs = _squares(each.transpose(1, 2, 0), self.weights)
        return np.asarray(self.nodes[np.argmin(costs, axis=0)])

    def refined(self, sums: Array) -> tuple[float, float]:
        """Return the best of finer and finer grids around the best node."""
        alpha, velocity = self.best(sums)
        wide, step = np.exp(np.diff(np.log(np.unique(self.nodes[:, 0]))).max()), None
        for _ in range(ZOOMS):
            known = np.unique(self.nodes[:, 1])
            step = np.diff(known).max() if step is None else step / 3.0
            fast = np.unique(np.maximum(velocity + step * np.linspace(-1, 1, 7), 0.0))
            steep = np.minimum(alpha * wide ** np.linspace(-1, 1, 7), self.nodes[:, 0].max())
            fine = _Grid._of(np.unique(steep), fast, self.speed, self.least)
            candidates = [(alpha, velocity), *([fine.best(sums)] if len(fine.nodes) else [])]
            costs = [float(_squares(sums, merge_weight(self.speed, *n))) for n in candidates]
            alpha, velocity = candidates[int(np.argmin(costs))]
            wide = np.sqrt(wide)
        return alpha, velocity
