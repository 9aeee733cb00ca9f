"""The wrench at the end effector that the joints' external torques amount to.

    τ_ext = Jᵀ W,    W = (J Σ⁻¹ Jᵀ)⁻¹ J Σ⁻¹ τ_ext,    cov W = (J Σ⁻¹ Jᵀ)⁻¹

Σ is the covariance of the torques. Force and moment have different units, so moments are scaled by
a length before the rank is judged. With fewer than six joints, or at a singular pose, some
directions of W move no joint: no torque tells of them, and any component with a share in one of
them is NaN. Source: turlapati_intrinsic_dynamics (1), (2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError, listed

__all__ = ["COMPONENTS", "Wrench", "wrench_at_end_effector"]

Array = NDArray[np.float64]

COMPONENTS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
RANK = 1e-6
"""Singular values of the scaled, whitened Jᵀ below this share of the largest count as zero."""
LEAK = 1e-6
"""Share of a component in the unobservable directions from which on it is unknown."""


@dataclass(frozen=True)
class Wrench:
    """What the arm pushes the outside with at the end effector.

    Parameters
    ----------
    values : (N, 6), force [N] and moment [Nm] in the frame of the Jacobian; NaN where unknown.
    covariance : (N, 6, 6); rows and columns of what is unknown are NaN.
    rank : (N,), how many directions of the wrench the joints feel.
    unobservable : (N, 6, 6), projector onto the directions that no joint feels (moments scaled by
        the length), zero where there is none.
    """

    values: Array
    covariance: Array
    rank: NDArray[np.intp]
    unobservable: Array

    @property
    def deviation(self) -> Array:
        """Standard deviations (N, 6), N and Nm."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def unknown(self) -> tuple[str, ...]:
        """Components that are unknown in some sample."""
        missing = np.asarray(np.isnan(self.values).any(axis=0))
        return tuple(name for name, gone in zip(COMPONENTS, missing.tolist(), strict=True) if gone)

    def __str__(self) -> str:
        lines = [f"Wrench at the end effector, {len(self.values)} samples"]
        units = ("N",) * 3 + ("Nm",) * 3
        for k, (name, unit) in enumerate(zip(COMPONENTS, units, strict=True)):
            known = np.isfinite(self.values[:, k])
            if known.any():
                middle = np.median(self.values[known, k])
                spread = np.median(self.deviation[known, k])
                share = "" if known.all() else f", known in {known.mean():.0%} of the samples"
                lines.append(f"  {name}: median {middle:.4g} ± {spread:.2g} {unit}{share}")
        if self.unknown:
            least = int(self.rank.min())
            lines.append(
                f"  not observable: {listed(self.unknown)}; "
                f"at the worst pose the joints feel {least} of 6 directions"
            )
        return "\n".join(lines)


def wrench_at_end_effector(
    torque: ArrayLike, jacobian: ArrayLike, covariance: ArrayLike, *, length: float = 1.0
) -> Wrench:
    """Return the wrench that explains the external torques, with its uncertainty.

    Parameters
    ----------
    torque : (N, n) Nm, external torques: what is left of each sensor when the rigid body and the
        intrinsic torque are taken off, outward positive. The wrench is then what the arm exerts.
    jacobian : (N, 6, n), linear rows [m] above angular rows [1] of the end effector.
    covariance : (n, n) or (N, n, n) Nm², of the torques.
    length : m, by which moments are compared with forces where the rank is judged: the arm's reach.

    Raises
    ------
    InputError
        Where shapes do not agree, values are not finite, or a covariance is not positive definite.
    """
    forces, jacobians, spread = _checked(torque, jacobian, covariance)
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"wrench: length = {length:g} m is not allowed; give one above zero")
    scale = np.array([1.0, 1.0, 1.0, length, length, length])  # W = W' · scale
    root = np.linalg.cholesky(spread)
    whitened = np.linalg.solve(root, jacobians.swapaxes(1, 2) * scale)  # (N, n, 6)
    seen = np.linalg.solve(root, forces[:, :, None])
    left, singular, right = np.linalg.svd(whitened, full_matrices=True)
    few = singular.shape[1]
    felt = singular > RANK * singular.max(axis=1, keepdims=True)
    inverse = np.where(felt, 1.0 / np.where(felt, singular, 1.0), 0.0)
    basis = right[:, :few].swapaxes(1, 2)  # (N, 6, few)
    spectrum = inverse * (left[:, :, :few].swapaxes(1, 2) @ seen)[:, :, 0]
    values = scale * (basis @ spectrum[:, :, None])[:, :, 0]
    half = scale[:, None] * basis * inverse[:, None, :]
    spreads = half @ half.swapaxes(1, 2)
    kept = basis * felt[:, None, :]
    hidden = np.eye(6) - kept @ kept.swapaxes(1, 2)
    unknown = np.sqrt(np.clip(np.diagonal(hidden, axis1=1, axis2=2), 0.0, None)) > LEAK
    values[unknown] = np.nan
    spreads[unknown[:, :, None] | unknown[:, None, :]] = np.nan
    rank = np.asarray(felt.sum(axis=1), dtype=np.intp)
    hidden[rank == 6] = 0.0
    return Wrench(values, spreads, rank, hidden)


def _checked(
    torque: ArrayLike, jacobian: ArrayLike, covariance: ArrayLike
) -> tuple[Array, Array, Array]:
    try:
        forces, jacobians = np.asarray(torque, dtype=float), np.asarray(jacobian, dtype=float)
        spread = np.asarray(covariance, dtype=float)
    except (TypeError, ValueError):
        raise InputError("wrench: torque, jacobian or covariance is no array of numbers") from None
    if forces.ndim != 2 or jacobians.shape != (len(forces), 6, forces.shape[1]):
        raise InputError(
            f"wrench: torque of shape {forces.shape} and Jacobian of shape {jacobians.shape} do "
            "not agree; give (N, n) and (N, 6, n)"
        )
    count, joints = forces.shape
    if spread.shape not in ((joints, joints), (count, joints, joints)):
        raise InputError(
            f"wrench: covariance of shape {spread.shape}; give {(joints, joints)} or "
            f"{(count, joints, joints)}"
        )
    for name, array in (("torque", forces), ("jacobian", jacobians), ("covariance", spread)):
        if not np.isfinite(array).all():
            row = int(np.argwhere(~np.isfinite(array))[0, 0])
            raise InputError(f"wrench: {name} is not finite at row {row}; leave such rows out")
    size = np.abs(spread).max()
    skew = np.abs(spread - spread.swapaxes(-1, -2)).max()
    if skew > 1e-9 * size or not (np.linalg.eigvalsh(spread) > 0.0).all():
        raise InputError("wrench: the covariance is not symmetric positive definite; give Nm²")
    return forces, jacobians, np.broadcast_to(spread, (count, joints, joints))
