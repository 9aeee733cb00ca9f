"""Amplitude and phase of the orders found, fitted together, with errors from the local floor.

In stretch g order k has β_g = (a_g, b_g) of a cos kq + b sin kq, with covariance
F_g(k) (XᵀX)⁻¹: F is the local noise floor, so the errors hold for correlated noise. Over the
stretches

    amplitude   A² = Σ w_g (|β_g|² - tr cov_g) / Σ w_g     whatever the phase does,
    steady      β = (Σ cov_g⁻¹)⁻¹ Σ cov_g⁻¹ β_g            what keeps its phase,

with w_g = 1 / (A² + tr cov_g): stretches count alike unless they are too noisy for A
[DerSimonianLaird1986].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.orders.floor import Floor
from flexspline.orders.scan import normal_equations, visible
from flexspline.orders.stretches import Stretch

__all__ = ["Estimate", "Share", "estimates"]

_SEPARATE = 0.1  # of its information that an order must keep beside the others


@dataclass(frozen=True)
class Share:
    """An order in one stretch: name, signed speed [rad/s], rows, (a, b) and covariance."""

    stretch: str
    speed: float
    rows: int
    weight: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @property
    def amplitude(self) -> float:
        """√(a² + b²), in the unit of the values."""
        return float(np.hypot(*self.weight))


@dataclass(frozen=True)
class Estimate:
    """An order over all stretches: amplitudes in the unit of the values, phase in rad."""

    amplitude: float
    error: float
    steady: float
    phase: float
    phase_error: float
    shares: tuple[Share, ...]


def estimates(
    parts: Sequence[Stretch], floors: Sequence[Floor | None], orders: Sequence[float]
) -> list[Estimate | None]:
    """Return one estimate for each of `orders`, None where no stretch separates it."""
    shares: list[list[Share]] = [[] for _ in orders]
    for part, floor in zip(parts, floors, strict=True):
        here = visible(part, orders)
        if floor is None or not here:
            continue
        gram, moment, _ = normal_equations(part, here)
        level = np.trace(gram) / len(gram)
        inverse = np.linalg.inv(gram + 1e-9 * level * np.eye(len(gram)))
        weight, noise = inverse @ moment, floor.level(np.array(here))
        for i, order in enumerate(here):
            pair = slice(2 * i, 2 * i + 2)
            block = inverse[pair, pair]
            if np.linalg.eigvalsh(block)[-1] * _SEPARATE * len(part.angle) / 2 < 1:
                shares[list(orders).index(order)].append(
                    Share(part.name, part.speed, len(part.angle), weight[pair], noise[i] * block)
                )
    return [combined(found) if found else None for found in shares]


def combined(shares: Sequence[Share]) -> Estimate:
    """Return the estimate over `shares`, which must not be empty."""
    spread = np.array([np.trace(share.covariance) for share in shares])
    power = np.array([share.amplitude**2 for share in shares]) - spread
    each = _even_weights(power, spread)
    information = [np.linalg.inv(share.covariance) for share in shares]
    covariance = np.linalg.inv(np.sum(information, axis=0))
    pulls = [info @ share.weight for info, share in zip(information, shares, strict=True)]
    a, b = covariance @ np.sum(pulls, axis=0)
    steady = float(np.hypot(a, b))
    across = np.array([-b, a]) / max(steady, 1e-300)
    phase_error = float(np.sqrt(across @ covariance @ across)) / max(steady, 1e-300)
    return Estimate(
        float(np.sqrt(max(each @ power, 0.0))),
        float(np.sqrt(each**2 @ spread / 2)),
        steady,
        float(np.arctan2(b, a)),
        min(phase_error, float(np.pi)),
        tuple(shares),
    )


def _even_weights(power: NDArray[np.float64], spread: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return w_g, summing to one, for estimated powers A_g² with noise of power `spread`."""
    weight = 1 / spread / np.sum(1 / spread)
    for _ in range(5):
        weight = 1 / (max(float(weight @ power), 0.0) + spread)
        weight /= weight.sum()
    return np.asarray(weight)
