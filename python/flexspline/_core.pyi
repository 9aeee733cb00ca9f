"""The C++ core of flexspline: effects, sums, solves and estimators."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

max_harmonics: int

class Design:
    """Effects chosen at run time: rows, sums and predictions over arrays."""

    def __init__(
        self,
        effects: Sequence[dict[str, Any]],
        effective_ratio: float,
        output_spline: str,
        motor_encoder: bool,
    ) -> None: ...
    @property
    def columns(self) -> int:
        """How many columns the rows have."""

    @property
    def structured(self) -> bool:
        """Whether the sums of this design can use the structure of dense harmonics."""

    def rows(
        self, channels: dict[str, NDArray[np.float64]], size: int, coefficients: ArrayLike
    ) -> NDArray[np.float64]:
        """Design matrix, shape (size, columns)."""

    def predict(
        self, channels: dict[str, NDArray[np.float64]], size: int, coefficients: ArrayLike
    ) -> NDArray[np.float64]:
        """Rows times coefficients, shape (size,)."""

    def accumulate(
        self,
        channels: dict[str, NDArray[np.float64]],
        target: ArrayLike,
        blocks: Sequence[tuple[int, int]],
        coefficients: ArrayLike,
        held: ArrayLike,
        weights: ArrayLike | None,
        double_double: bool,
        structured: bool,
        threads: int,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sums of products of [rows, target] of each block: (high, low)."""

class Solution:
    """Least squares from a Gram matrix."""

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Shape (columns,); 0 at dependent ones."""

    @property
    def condition(self) -> float:
        """Of the basic columns scaled to length one (estimate)."""

    @property
    def dependence(self) -> NDArray[np.float64]:
        """Shape (columns - rank, rank): of which basic columns each dependent one is made."""

    @property
    def double_is_enough(self) -> bool:
        """Whether plain sums were good to 1e-9 here, without double-double."""

    @property
    def factor(self) -> NDArray[np.float64]:
        """Shape (rank, columns): XᵀX = factorᵀ factor."""

    @property
    def order(self) -> list[int]:
        """Columns, pivots first: order[:rank] are the basic ones."""

    @property
    def rank(self) -> int:
        """How many columns are independent."""

    @property
    def residual_squares(self) -> float:
        """|X b - y|², at least 0."""

    @property
    def rotated_target(self) -> NDArray[np.float64]:
        """Qᵀ y of the basic columns, shape (rank,)."""

def accumulate_rows(
    rows: ArrayLike,
    target: ArrayLike,
    blocks: Sequence[tuple[int, int]],
    weights: ArrayLike | None,
    double_double: bool,
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sums of products of [rows, target] of each block, from explicit rows: (high, low)."""

def catalogue() -> list[dict[str, Any]]:
    """Every effect of the core: name, targets, terms, shapes, channels read, pairs of parts."""

def isa() -> str:
    """Name of the instruction set in use: 'baseline', 'v3' or 'v4'."""

def merge(
    high: ArrayLike, low: ArrayLike, chosen: Sequence[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sum of the chosen blocks' sums of products, exact where they are: (high, low)."""

def replay_differentiator(
    time: ArrayLike, position: ArrayLike, bandwidth: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocity and acceleration of each row by the causal differentiator of the core."""

def solve(high: ArrayLike, low: ArrayLike) -> Solution:
    """Least squares from the sums of products of [X, y]; low is empty for plain sums."""
