"""The momentum observer over a log of one joint or of an arm.

    p = M q̇,    τ̄ = τ + Cᵀ q̇ − g − τ_f,    ṗ = τ̄ − τ_ext,    dr/dt = K (τ_ext − r)

τ is what drives each joint, at its output: the sensor's torque, or Ñ τ_m with its friction τ_f.
Each joint is one observer of the core. r is the estimate of τ_ext, positive when the joint pushes
the outside in +q; τ_c of (12) and the residual r of (16)–(22) are positive when the outside drives
the joint forward (`Observed.residual`). The first paper takes the sensor's torque, so that (23) has
no friction; the third the motor's, with friction. Here it may be either.
Source: zhang_disturbance_elimination (12)–(21); one joint: full_range_torque_estimation (1)–(8).
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.errors import FlexsplineWarning, InputError
from flexspline.estimators.observer import Observer
from flexspline.logs.segments import runs
from flexspline.observer.dynamics import Dynamics, evaluated, require_dynamics
from flexspline.observer.gain import require_gain
from flexspline.observer.parts import coefficient, friction_torque, parts_of
from flexspline.part import Part

__all__ = ["Observed", "observe"]

Array = NDArray[np.float64]

RIGID = ("inertia", "gravity")
"""Effects of a part that M and g hold already."""


@dataclass(frozen=True, eq=False)
class Observed:
    """Estimates of the external torque.

    Parameters
    ----------
    time : (N,) s.
    external : (N, n) Nm, outward positive; NaN before the first good row of each run.
    velocity : (N, n) rad/s at the outputs.
    gain : (n,) 1/s.
    discretisation : "exact" or "euler".
    """

    time: Array
    external: Array
    velocity: Array
    gain: Array
    discretisation: str

    @property
    def residual(self) -> Array:
        """The paper's r, (N, n) Nm: positive when the outside drives the joint forward."""
        return -self.external

    def estimator(self, joint: int = 1, *, input: str = "sensor_torque") -> Observer:
        """Return the observer of one joint (1 to n) for `Model.with_estimator`.

        Parameters
        ----------
        joint : 1 to n. The estimator knows that joint's own momentum alone, not the coupling.
        input : "sensor_torque" or "motor_torque": what the torque was.

        Raises
        ------
        InputError
            Where there is no such joint, or the input is another word.
        """
        if not 1 <= joint <= len(self.gain):
            raise InputError(f"observer: no joint {joint}; there are joints 1 to {len(self.gain)}")
        return Observer(float(self.gain[joint - 1]), input, self.discretisation)

    def __str__(self) -> str:
        lines = [f"External torque of {self.external.shape[1]} joints, {len(self.time)} samples"]
        for joint, gain in enumerate(self.gain):
            values = self.external[:, joint]
            known = values[np.isfinite(values)]
            said = (
                "nothing known"
                if not known.size
                else (
                    f"RMS {np.sqrt(np.mean(known**2)):.3g} Nm, largest {np.abs(known).max():.3g} Nm"
                )
            )
            late = f"K = {gain:.4g} 1/s, late by {1e3 / gain:.3g} ms"
            lines.append(f"  joint {joint + 1}: {said}; {late}")
        return "\n".join(lines)


def observe(
    time: ArrayLike,
    position: ArrayLike,
    velocity: ArrayLike,
    torque: ArrayLike,
    *,
    gain: ArrayLike,
    dynamics: Dynamics | float | None = None,
    friction: Part | Sequence[Part | None] | ArrayLike | None = None,
    discretisation: str = "exact",
) -> Observed:
    """Return the external torque of every joint from momentum.

    Each run without a gap starts again at zero, whatever the momentum: no jump. A row that is not
    finite keeps the last estimate. For a log and a `Model` of one joint, `flexspline.estimate`
    does the same within the whole chain.

    Parameters
    ----------
    time : (N,) s, increasing.
    position, velocity : (N, n) rad, rad/s at the outputs; (N,) for one joint.
    torque : (N, n) Nm at the outputs: the sensors' torque, compensated, or Ñ τ_m.
    gain : K, 1/s; one number or one for each joint.
    dynamics : callable (q, q̇) → M, C, g, arrays over samples (`Dynamics`; of a URDF by
        `dynamics_from_urdf`). For one joint also its inertia, kg m², or None: that of the part.
    friction : what else the torque contains: fitted parts of a model, one for each joint (None
        for a joint without), or an array (N, n), Nm. Beside dynamics with M and g, a part must not
        hold inertia or gravity.
    discretisation : "exact", stable at any rate, or "euler" as the papers print it.

    Raises
    ------
    InputError
        For shapes that do not agree, a gain that cannot be stable, impossible dynamics
        (`require_dynamics`), or inertia that nothing or two things give.

    Warns
    -----
    FlexsplineWarning
        Where forward Euler has gain · period of 1 or more: it rings, or is dead-beat at 1.
    """
    times, states = arrays_of(time, position, velocity, torque)
    angle, speed, driving = states
    count = angle.shape[1]
    gains = _gains(gain, count, times, discretisation)
    parts = parts_of(friction, count)
    momentum, others = _rigid(dynamics, parts, angle, speed)
    known = driving - others - friction_torque(friction, parts, times, (angle, speed))
    external = np.empty_like(known)
    for first, last in runs(times):
        rows = slice(int(first), int(last))
        for joint in range(count):
            external[rows, joint] = _core.observe_momentum(
                times[rows],
                np.ascontiguousarray(momentum[rows, joint]),
                np.ascontiguousarray(known[rows, joint]),
                gain=float(gains[joint]),
                exact=discretisation == "exact",
            )
    return Observed(times, external, speed, gains, discretisation)


def arrays_of(time: ArrayLike, *given: ArrayLike) -> tuple[Array, list[Array]]:
    """Return time (N,) and each of `given` as (N, n), or refuse what does not agree."""
    try:
        times = np.ascontiguousarray(time, dtype=float)
        states = [np.asarray(values, dtype=float) for values in given]
    except (TypeError, ValueError):
        raise InputError(
            "observer: time, position, velocity or torque holds what is no number; give arrays"
        ) from None
    states = [values[:, None] if values.ndim == 1 else values for values in states]
    shapes = [values.shape for values in states]
    if times.ndim != 1 or len(set(shapes)) != 1 or shapes[0][:1] != times.shape or len(times) < 2:
        raise InputError(
            f"observer: time {times.shape} and position, velocity, … torque {shapes} do not agree; "
            "give (N,) with N of 2 or more, and (N, n) of each of the others"
        )
    if not (np.diff(times) > 0.0).all():
        row = int(np.argmin(np.diff(times) > 0.0)) + 1
        raise InputError(f"observer: time does not increase at row {row}; sort or repair the log")
    if not np.isfinite(states).all(axis=(0, 2)).any():
        raise InputError(
            "observer: position, velocity and torque are in no row all finite; check the channels"
        )
    return times, states


def _gains(gain: ArrayLike, count: int, time: Array, discretisation: str) -> Array:
    longest = max(
        (float(np.diff(time[a:b]).max()) for a, b in runs(time) if b - a > 1), default=0.0
    )
    values = (
        require_gain(gain, longest, discretisation)
        if longest
        else require_gain(gain, float(np.diff(time).min()), discretisation)
    )
    if values.shape not in ((), (1,), (count,)):
        raise InputError(
            f"observer: {values.size} gains for {count} joints; give one number or one each"
        )
    worst = float(values.max()) * longest
    if discretisation == "euler" and worst >= 1.0 - 1e-9:
        warnings.warn(
            f"observer: gain · period = {worst:.3g} by forward Euler: the estimate takes all of "
            "the newest sample's noise and rings above 1; use discretisation='exact'",
            FlexsplineWarning,
            stacklevel=3,
        )
    return np.broadcast_to(values, (count,)).copy()


def _rigid(
    dynamics: Dynamics | float | None, parts: list[Part | None], angle: Array, speed: Array
) -> tuple[Array, Array]:
    """Momentum p = M q̇ and g − Cᵀ q̇, both (N, n); NaN where the state is not finite."""
    if not callable(dynamics):
        return _inertia(dynamics, parts) * speed, np.zeros_like(speed)
    for joint, part in enumerate(parts, start=1):
        twice = [e.name for e in part.effects if e.name in RIGID] if part is not None else []
        if twice:
            raise InputError(
                f"observer: the part of joint {joint} holds {twice[0]}, which the dynamics hold "
                "too; fit it without, with the rigid body's torque as known_load"
            )
    good = np.isfinite(angle).all(axis=1) & np.isfinite(speed).all(axis=1)
    require_dynamics(dynamics, angle[good], speed[good])
    mass, coriolis, gravity = evaluated(dynamics, angle[good], speed[good])
    momentum, others = np.full_like(speed, np.nan), np.full_like(speed, np.nan)
    momentum[good] = np.einsum("kij,kj->ki", mass, speed[good])
    others[good] = gravity - np.einsum("kji,kj->ki", coriolis, speed[good])
    return momentum, others


def _inertia(given: float | None, parts: list[Part | None]) -> float:
    """Inertia of the one joint, kg m², of the call or of the part, but not of both."""
    if len(parts) != 1:
        raise InputError(
            f"observer: {len(parts)} joints need dynamics that return M, C and g; give a callable "
            "or dynamics_from_urdf"
        )
    if isinstance(given, (str, os.PathLike)):
        raise InputError(
            f"observer: dynamics = {str(given)!r} is a text; give dynamics_from_urdf(...) of it "
            "for a URDF, or the inertia [kg m²]"
        )
    found = coefficient(parts[0], "inertia")
    if (given is None) == (found is None):
        which = "both the call and the part give" if given is not None else "nothing gives"
        raise InputError(f"observer: {which} the inertia; give dynamics= [kg m²] or a part with it")
    inertia = float(given if given is not None else found or 0.0)
    if not (np.isfinite(inertia) and inertia >= 0.0):
        raise InputError(f"observer: inertia = {inertia:g} kg m² is not allowed; give 0 or more")
    return inertia
