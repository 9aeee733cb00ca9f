"""M, C and g of an arm from its URDF, by Pinocchio."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.observer.dynamics import Dynamics

__all__ = ["dynamics_from_urdf"]

Array = NDArray[np.float64]


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
