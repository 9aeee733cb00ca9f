"""An arm: its rigid-body dynamics, and the wrench that its joints' external torques amount to.

Its dynamics are functions of its state, and are checked to be consistent.

    M(q) q̈ + C(q, q̇) q̇ + g(q) = torques that drive the joints,    Ṁ = C + Cᵀ

The momentum observer rests on the second equation: with a C that violates it, ṗ is not what the
observer assumes, and the estimate is wrong wherever the arm moves. M, C and g are given as
functions, or come from a URDF by Pinocchio.
Source: zhang_disturbance_elimination (12), (13).

Its wrench acts at the end effector.

    τ_ext = Jᵀ W,    W = (J Σ⁻¹ Jᵀ)⁻¹ J Σ⁻¹ τ_ext,    cov W = (J Σ⁻¹ Jᵀ)⁻¹

Σ is the covariance of the torques. Force and moment have different units, so moments are scaled by
a length before the rank is judged. With fewer than six joints, or at a singular pose, some
directions of W move no joint: no torque tells of them, and any component with a share in one of
them is NaN. Source: turlapati_intrinsic_dynamics (1), (2).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError, listed
from flexspline.formatting import plus_minus

__all__ = [
    "COMPONENTS",
    "Dynamics",
    "Wrench",
    "dynamics_from_urdf",
    "require_dynamics",
    "wrench_at_end_effector",
]

Array = NDArray[np.float64]

Dynamics: TypeAlias = Callable[[Array, Array], tuple[ArrayLike, ArrayLike, ArrayLike]]
"""q, q̇ (N, n) → M (N, n, n) kg m², C (N, n, n) Nm s, g (N, n) Nm, at the outputs."""

STEP = 1e-5
"""rad: half-width of the central difference; truncation and rounding are both near 1e-10 of M."""
CHECKED_ROWS = 200
EPS = float(np.finfo(float).eps)

COMPONENTS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
RANK = 1e-6
"""Singular values of the scaled, whitened Jᵀ below this share of the largest count as zero."""
LEAK = 1e-6
"""Share of a component in the unobservable directions from which on it is unknown."""


def require_dynamics(dynamics: Dynamics, position: Array, velocity: Array) -> None:
    """Refuse dynamics with Ṁ ≠ C + Cᵀ, with wrong shapes or with an impossible mass matrix.

    Looked at in up to 200 of the rows, with the log's velocities and again with made-up ones of
    1 rad/s, as a log at rest says nothing about C. Ṁ is the central difference of M along q̇ with
    the steps h and 2h. What may be left: ten times their difference (three times the truncation
    at h) and the rounding of M, 100 ε |M| / h.

    Parameters
    ----------
    dynamics : callable of (N, n), (N, n).
    position, velocity : (N, n), rad and rad/s at the outputs, finite.

    Raises
    ------
    InputError
        Where one of these does not hold; names the row.
    """
    rows = np.unique(np.linspace(0, len(position) - 1, CHECKED_ROWS).astype(int))
    made_up = np.random.default_rng(0).standard_normal((len(rows), position.shape[1]))
    made_up /= np.linalg.norm(made_up, axis=1, keepdims=True)
    for moving in (velocity[rows], made_up):
        _require_coriolis(dynamics, position[rows], moving, rows)


def evaluated(dynamics: Dynamics, position: Array, velocity: Array) -> tuple[Array, Array, Array]:
    """Return M (N, n, n), C (N, n, n), g (N, n), checked for shape, symmetry and sign of M.

    Raises
    ------
    InputError
        Where a shape is another one, a value is not finite, or M is not symmetric and positive.
    """
    count, joints = position.shape
    made = dynamics(position, velocity)
    if not isinstance(made, tuple) or len(made) != 3:
        raise InputError("the dynamics must return M, C and g as a tuple of three arrays")
    wanted = {"M": (count, joints, joints), "C": (count, joints, joints), "g": (count, joints)}
    found = []
    for (name, shape), values in zip(wanted.items(), made, strict=True):
        array = np.asarray(values, dtype=float)
        if array.shape != shape:
            raise InputError(
                f"the dynamics return {name} of shape {array.shape} for {count} samples of "
                f"{joints} joints; return {shape}"
            )
        if not np.isfinite(array).all():
            row = int(np.argwhere(~np.isfinite(array))[0, 0])
            raise InputError(f"the dynamics return {name} that is not finite at row {row}")
        found.append(array)
    _require_mass(found[0])
    return found[0], found[1], found[2]


def _require_mass(mass: Array) -> None:
    """Refuse a mass matrix that is not symmetric or not positive definite."""
    size = np.abs(mass).max(axis=(1, 2))
    skew = np.abs(mass - mass.swapaxes(1, 2)).max(axis=(1, 2))
    _refuse_first(skew > 1e-9 * size, "M is not symmetric", "fill both of its triangles")
    least = np.linalg.eigvalsh(mass)[:, 0]
    _refuse_first(
        ~(least > 10.0 * EPS * size),
        "M is not positive definite",
        "every motion needs inertia: check masses and the joints' own inertia",
    )


def _refuse_first(bad: NDArray[np.bool_], what: str, remedy: str) -> None:
    if bad.any():
        raise InputError(f"the dynamics at row {int(np.argmax(bad))}: {what}; {remedy}")


def _require_coriolis(
    dynamics: Dynamics, position: Array, velocity: Array, rows: NDArray[np.intp]
) -> None:
    speed = np.linalg.norm(velocity, axis=1)[:, None, None]
    along = velocity / np.maximum(speed[:, :, 0], np.finfo(float).tiny)
    mass, coriolis, _ = evaluated(dynamics, position, velocity)

    def slope(step: float) -> Array:
        ahead = evaluated(dynamics, position + step * along, velocity)[0]
        behind = evaluated(dynamics, position - step * along, velocity)[0]
        return np.asarray(speed * (ahead - behind) / (2.0 * step))

    fine, coarse = slope(STEP), slope(2.0 * STEP)
    left = _size(fine - coriolis - coriolis.swapaxes(1, 2))
    rounding = 100.0 * EPS * speed[:, 0, 0] * _size(mass) / STEP
    allowed = 10.0 * _size(fine - coarse) + rounding
    # At rest both sides are zero; C may then hold what the callable's own rounding leaves.
    bad = left > allowed + 100.0 * EPS * _size(coriolis)
    if bad.any():
        worst = int(np.argmax(np.where(bad, left, 0.0)))
        raise InputError(
            f"the dynamics violate Ṁ = C + Cᵀ at row {int(rows[worst])} by {left[worst]:.3g} "
            f"kg m²/s where |Ṁ| is {_size(fine)[worst]:.3g}; make C of the Christoffel symbols of M"
        )


def _size(matrices: Array) -> Array:
    return np.asarray(np.linalg.norm(matrices, axis=(1, 2)))


def dynamics_from_urdf(
    urdf: str | os.PathLike[str], *, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
) -> Dynamics:
    """Return the rigid-body dynamics of a URDF as a callable for `observe`.

    M by the composite-rigid-body algorithm, C by Pinocchio's Coriolis matrix, which keeps
    Ṁ = C + Cᵀ, g by its gravity. The joints are those of the URDF that move, in its order; a
    continuous joint's angle may be any number. Pinocchio takes one sample a call, so this costs
    some 60 µs a sample, unlike everything else here.

    Parameters
    ----------
    urdf : path of the file.
    gravity : m/s², in the frame of the base.

    Raises
    ------
    InputError
        Where Pinocchio is not installed, or the file cannot be read as a URDF.
    """
    try:
        import pinocchio
    except ImportError:
        raise InputError(
            "dynamics from a URDF need Pinocchio, which is not installed; "
            "run pip install 'flexspline[pinocchio]' or give M, C and g as a callable"
        ) from None
    if not Path(urdf).is_file():
        raise InputError(f"{urdf}: no such file; give the path of a URDF")
    try:
        model = pinocchio.buildModelFromUrdf(str(urdf))
    except ValueError as error:
        raise InputError(f"{urdf}: cannot be read as a URDF; check it ({error})") from error
    model.gravity.linear = np.array(gravity)
    return _Arm(pinocchio, model, str(urdf))


class _Arm:
    """One model of Pinocchio, called with arrays."""

    def __init__(self, pinocchio: Any, model: Any, label: str) -> None:
        self._pinocchio = pinocchio
        self._model = model
        self._data = model.createData()
        self._neutral = pinocchio.neutral(model)
        self._label = label

    def __call__(self, position: Array, velocity: Array) -> tuple[Array, Array, Array]:
        """Return M, C (N, n, n) and g (N, n) for q, q̇ (N, n)."""
        joints = self._model.nv
        if position.shape[1] != joints:
            raise InputError(
                f"{self._label} has {joints} joints that move, the log {position.shape[1]}; "
                "give all of them in the order of the URDF"
            )
        count = len(position)
        mass, coriolis = np.empty((count, joints, joints)), np.empty((count, joints, joints))
        gravity = np.empty((count, joints))
        rows = zip(position, velocity, mass, coriolis, gravity, strict=True)
        for angle, speed, *row in rows:
            self._fill(angle, speed, *row)
        return mass, coriolis, gravity

    def _fill(self, angle: Array, speed: Array, mass: Array, coriolis: Array, load: Array) -> None:
        pin, model, data = self._pinocchio, self._model, self._data
        at = pin.integrate(model, self._neutral, angle)
        upper = np.triu(pin.crba(model, data, at))
        mass[:] = upper + np.triu(upper, 1).T
        coriolis[:] = pin.computeCoriolisMatrix(model, data, at, speed)
        load[:] = pin.computeGeneralizedGravity(model, data, at)


@dataclass(frozen=True, eq=False)
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
                lines.append(f"  {name}: median {plus_minus(middle, spread)} {unit}{share}")
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
