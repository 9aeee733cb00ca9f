"""The external torque of one joint or of a whole arm, and the wrench that it amounts to.

`observe` is the momentum observer over a log of one joint or of an arm.

    p = M q̇,    τ̄ = τ + Cᵀ q̇ − g − τ_f,    ṗ = τ̄ − τ_ext,    dr/dt = K (τ_ext − r)

τ is what drives each joint, at its output: the sensor's torque, or Ñ τ_m with its friction τ_f, a
fitted part or an array. Each joint is one observer of the core. r is the estimate of τ_ext,
positive when the joint pushes the outside in +q; τ_c of (12) and the residual r of (16)–(22) are
positive when the outside drives the joint forward (`Observed.residual`). The first paper takes the
sensor's torque, so that (23) has no friction; the third the motor's, with friction. Here it may be
either. Source: zhang_disturbance_elimination (12)–(21); one joint: full_range_torque_estimation
(1)–(8).

A gain trades delay against noise. With period T, share s = 1 − e^(−K T) (exact) or K T (forward
Euler):

    delay    exact  T (1/s − 1/2) → 1/K       euler  1/K − T/2
    noise    of white torque:    exact  σ √(s/2)       euler  σ √(s / (2 − s))
             of white velocity:  J σ_v (s / T) √(2 / (2 − s)), for both

Delay is that of a slowly changing external torque, on average over a period. In continuous time
the estimate is the external torque behind K / (K + s): zhang_disturbance_elimination (19).
Towards K T = 0 both torque noises are σ √(K T / 2); at K T = 1 Euler's is σ itself, at 2 infinite.

An arm with a sensor in each joint needs no observer:

    τ_s = τ_rb + τ_intr + τ_ext,    τ_rb = M q̈ + C q̇ + g,    τ_ext = Jᵀ W

There is no dynamics of an estimate and no delay, but the acceleration, which `observe` does
without. The remainder goes to `wrench_at_end_effector` with its covariance. M, C and g are of what
lies outboard of the sensors; they count as exact. Source: turlapati_intrinsic_dynamics (1), (2).
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.effects.causes import INERTIA
from flexspline.errors import FlexsplineWarning, InputError, above_zero, numbers
from flexspline.estimators.external_torque import Observer
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.model import Model
from flexspline.observer.dynamics import (
    Dynamics,
    Wrench,
    dynamics_from_urdf,
    evaluated,
    require_dynamics,
    wrench_at_end_effector,
)
from flexspline.part import PART_OF, Part

__all__ = [
    "Dynamics",
    "Observed",
    "Remainder",
    "Wrench",
    "dynamics_from_urdf",
    "observe",
    "observer_delay",
    "observer_noise",
    "require_dynamics",
    "subtract",
    "wrench_at_end_effector",
]


Array = NDArray[np.float64]


def __dir__() -> list[str]:
    return __all__


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
        twice = [e.name for e in part.effects if e.info.carries_load] if part is not None else []
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
    found = coefficient(parts[0], INERTIA)
    if (given is None) == (found is None):
        which = "both the call and the part give" if given is not None else "nothing gives"
        raise InputError(f"observer: {which} the inertia; give dynamics= [kg m²] or a part with it")
    inertia = float(given if given is not None else found or 0.0)
    if not (np.isfinite(inertia) and inertia >= 0.0):
        raise InputError(f"observer: inertia = {inertia:g} kg m² is not allowed; give 0 or more")
    return inertia


def observer_delay(gain: ArrayLike, period: float, discretisation: str = "exact") -> Array:
    """Return the delay of the estimate for a slowly changing external torque [s].

    Parameters
    ----------
    gain : 1/s, any shape.
    period : s, between samples.
    discretisation : "exact" or "euler".

    Raises
    ------
    InputError
        Where a gain or the period is not above zero, or Euler has gain · period of 2 or more.
    """
    return period * (1.0 / _share(gain, period, discretisation) - 0.5)


def observer_noise(
    gain: ArrayLike,
    period: float,
    discretisation: str = "exact",
    *,
    torque_noise: float = 0.0,
    velocity_noise: float = 0.0,
    inertia: float = 0.0,
) -> Array:
    """Return the standard deviation of the estimate at rest [Nm].

    Parameters
    ----------
    gain : 1/s, any shape.
    period : s, between samples.
    discretisation : "exact" or "euler".
    torque_noise : Nm, standard deviation of the white noise of the input torque, at the output.
    velocity_noise : rad/s, that of the velocity.
    inertia : kg m² at the output.

    Raises
    ------
    InputError
        As `observer_delay`, or where noise or inertia is negative or not finite.
    """
    for name, value in (
        ("torque_noise", torque_noise),
        ("velocity_noise", velocity_noise),
        ("inertia", inertia),
    ):
        above_zero(value, f"observer: {name}", or_zero=True)
    share = _share(gain, period, discretisation)
    of_torque = share / 2.0 if discretisation == "exact" else share / (2.0 - share)
    of_momentum = (share / period) ** 2 * 2.0 / (2.0 - share)
    moving = inertia * velocity_noise
    return np.sqrt(of_torque * torque_noise**2 + of_momentum * moving**2)


def require_gain(gain: ArrayLike, longest_period: float, discretisation: str) -> Array:
    """Return the gains as an array, or refuse those that cannot be stable."""
    try:
        values = np.asarray(gain, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"observer: gain = {gain!r} is no number; give it in 1/s") from None
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise InputError(
            f"observer: gain = {values.tolist()} is not allowed; give numbers above zero [1/s]"
        )
    if discretisation not in ("exact", "euler"):
        raise InputError(
            f"observer: discretisation = {discretisation!r} is unknown; give exact or euler"
        )
    worst = float(values.max()) * longest_period
    if discretisation == "euler" and worst >= 2.0:
        raise InputError(
            f"observer: gain · period = {worst:.3g} diverges by forward Euler, which needs less "
            f"than 2; give a gain below {2.0 / longest_period:.4g} 1/s or discretisation='exact'"
        )
    return values


def _share(gain: ArrayLike, period: float, discretisation: str) -> Array:
    if not (np.isfinite(period) and period > 0.0):
        raise InputError(f"observer: period = {period:g} s is not allowed; give one above zero")
    values = require_gain(gain, period, discretisation) * period
    return np.asarray(-np.expm1(-values) if discretisation == "exact" else values)


@dataclass(frozen=True, eq=False)
class Remainder:
    """What rigid body and intrinsic torque leave of the sensors.

    Parameters
    ----------
    time : (N,) s.
    external : (N, n) Nm, outward positive; NaN in rows that are not finite.
    rigid, intrinsic : (N, n) Nm, what was taken off.
    covariance : (n, n) Nm², of the external torques: that of the sensors and of the parts.
    """

    time: Array
    external: Array
    rigid: Array
    intrinsic: Array
    covariance: Array

    @property
    def deviation(self) -> Array:
        """Standard deviations (n,), Nm."""
        return np.sqrt(np.diagonal(self.covariance))


def subtract(
    time: ArrayLike,
    position: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    torque: ArrayLike,
    *,
    dynamics: Dynamics,
    noise: ArrayLike,
    intrinsic: Part | Sequence[Part | None] | ArrayLike | None = None,
    intrinsic_error: ArrayLike = 0.0,
) -> Remainder:
    """Return the external torque of every joint from its sensor.

    Parameters
    ----------
    time : (N,) s, increasing.
    position, velocity, acceleration : (N, n) rad, rad/s, rad/s² at the outputs.
    torque : (N, n) Nm, the sensors.
    dynamics : callable (q, q̇) → M, C, g (`Dynamics`; of a URDF by `dynamics_from_urdf`).
    noise : Nm, standard deviation of a sensor's noise; one number or one for each joint.
    intrinsic : fitted sensor parts, one for each joint (None for a joint without), or an array
        (N, n), Nm.
    intrinsic_error : Nm, standard deviation of what the parts predict, such as the RMSE of the fit
        on rows that it never saw; one number or one for each joint.

    Raises
    ------
    InputError
        For shapes that do not agree, rows of which none is finite, impossible dynamics
        (`require_dynamics`), or noise that is not above zero.
    """
    times, (angle, speed, rate, sensed) = arrays_of(time, position, velocity, acceleration, torque)
    count = angle.shape[1]
    parts = parts_of(intrinsic, count)
    good = np.isfinite(np.hstack([angle, speed, rate])).all(axis=1)
    require_dynamics(dynamics, angle[good], speed[good])
    mass, coriolis, gravity = evaluated(dynamics, angle[good], speed[good])
    rigid = np.full_like(angle, np.nan)
    rigid[good] = np.einsum("kij,kj->ki", mass, rate[good]) + gravity
    rigid[good] += np.einsum("kij,kj->ki", coriolis, speed[good])
    own = friction_torque(intrinsic, parts, times, (angle, speed, rate))
    spread = _each(noise, "noise", count) ** 2
    spread = spread + _each(intrinsic_error, "intrinsic_error", count) ** 2
    if not (spread > 0.0).all():
        raise InputError("subtract: noise = 0 makes no covariance; give that of the sensors in Nm")
    return Remainder(times, sensed - rigid - own, rigid, own, np.diag(spread))


def _each(given: ArrayLike, name: str, count: int) -> Array:
    """One number of zero or more for each joint, (n,)."""
    values = numbers(np.atleast_1d(np.asarray(given)).tolist(), f"subtract: {name}", "Nm")
    for value in values:
        above_zero(value, f"subtract: {name}", "Nm", or_zero=True)
    if len(values) not in (1, count):
        raise InputError(f"subtract: {len(values)} of {name} for {count} joints; give one or each")
    return np.broadcast_to(np.array(values), (count,))


def parts_of(friction: Any, count: int) -> list[Part | None]:
    """The parts given for friction, one for each joint; all None where an array was given."""
    if isinstance(friction, Part):
        friction = [friction]
    listed = isinstance(friction, (list, tuple))
    if not listed or not all(part is None or isinstance(part, Part) for part in friction):
        return [None] * count
    if len(friction) != count:
        raise InputError(f"observer: {len(friction)} parts for {count} joints; give one each")
    return list(friction)


def coefficient(part: Part | None, name: str) -> float | None:
    values = np.empty(0) if part is None else part.coefficients_of(name)
    return float(values[0]) if len(values) else None


def friction_torque(
    friction: Any,
    parts: list[Part | None],
    time: Array,
    state: tuple[Array, ...],
) -> Array:
    """Friction and the like, (N, n) Nm: an array as given, or what the parts say.

    `state`: q, q̇ and, where inertia belongs to it, q̈, each (N, n).
    """
    angle = state[0]
    if friction is None or any(part is not None for part in parts):
        made = [_said(part, time, *(x[:, k] for x in state)) for k, part in enumerate(parts)]
        return np.stack(made, axis=1)
    try:
        values = np.asarray(friction, dtype=float)
    except (TypeError, ValueError):
        raise InputError("observer: friction must be parts of a model or an array") from None
    values = values[:, None] if values.ndim == 1 and angle.shape[1] == 1 else values
    if values.shape != angle.shape:
        raise InputError(f"observer: friction of shape {values.shape}; give {angle.shape}")
    return values


def _said(
    part: Part | None, time: Array, angle: Array, speed: Array, rate: Array | None = None
) -> Array:
    """What a part says of the state, without its inertia where q̈ is None, Nm, (N,)."""
    if part is None:
        return np.zeros(len(time))
    if part.target not in ("sensor_torque", "motor_torque"):
        raise InputError(
            f"observer: friction is a part for {part.target}; give one for sensor_torque or "
            "motor_torque, in Nm"
        )
    reads = {name for effect in part.effects for name in effect.reads}
    if "load" in reads:
        raise InputError(
            "observer: the part reads the load, which is what is looked for; use "
            "flexspline.estimate, which takes the sensor's"
        )
    if "motor_position" in reads:
        raise InputError(
            "observer: the part has ripple of the wave generator, whose angle takes the gear; "
            "predict it with its Model and give the torque as an array"
        )
    alone = _alone(part, inertia=rate is not None)
    if not alone.effects:
        return np.zeros(len(time))
    channels = {"time": time, "output_position": angle, "output_velocity": speed}
    if rate is not None:
        channels["output_acceleration"] = rate
    log = Log(channels)
    return Model({PART_OF[part.target]: alone}).predict(log).predicted


def _alone(part: Part, *, inertia: bool) -> Part:
    return replace(
        part.keeping(lambda effect: inertia or effect.name != INERTIA),
        known_load=None,
        record={**part.record, "channels": []},
    )
