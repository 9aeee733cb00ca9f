"""Residuals that a collision detector is calibrated on, and the rows in which a joint stands still.

They are given, or estimated from logs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.errors import InputError
from flexspline.estimation import estimate
from flexspline.estimators.external_torque import MOST_BANDS
from flexspline.logs.log import Log
from flexspline.logs.segments import runs, true_ranges
from flexspline.model import Model

__all__ = [
    "Residual",
    "residuals_of",
    "speed_bands",
    "standstill_residual",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Residual:
    """External torques, or currents without their trend, of one run.

    Parameters
    ----------
    time : (N,) s, increasing.
    values : (N, n), in `unit`, outward positive; NaN where nothing is known; (N,) for one joint.
    velocity : (N, n) rad/s at the outputs, NaN where it is not known (no band, no detection);
        None: at rest.
    name : of the run.
    unit : of the values, "Nm" or "A".

    Raises
    ------
    InputError
        Where shapes do not agree, time does not increase or a value is infinite.
    """

    time: Array
    values: Array
    velocity: Array | None = None
    name: str = "run"
    unit: str = "Nm"

    def __post_init__(self) -> None:
        time = np.ascontiguousarray(self.time, dtype=float)
        values = _columns(self.values)
        velocity = np.zeros_like(values) if self.velocity is None else _columns(self.velocity)
        if time.ndim != 1 or values.shape[:1] != time.shape or velocity.shape != values.shape:
            raise InputError(
                f"residual '{self.name}': time {time.shape}, values {values.shape} and velocity "
                f"{velocity.shape} do not agree; give (N,), (N, n) and (N, n)"
            )
        if not (np.diff(time) > 0.0).all():
            raise InputError(f"residual '{self.name}': time does not increase; repair the log")
        if np.isinf(values).any():
            row = int(np.argwhere(np.isinf(values))[0, 0])
            raise InputError(
                f"residual '{self.name}': infinite at row {row}; give NaN where nothing is known"
            )
        for name, array in (("time", time), ("values", values), ("velocity", velocity)):
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def speed(self) -> Array:
        """|q̇|, (N, n) rad/s; zero where no velocity was given."""
        return np.abs(self.velocity) if self.velocity is not None else np.zeros_like(self.values)


def standstill_residual(
    time: ArrayLike,
    signal: ArrayLike,
    velocity: ArrayLike,
    *,
    fast: float = 40.0,
    slow: float = 2.0,
    still_speed: float = 0.02,
    settle: float = 0.5,
    name: str = "run",
    unit: str = "A",
) -> Residual:
    """Return what leaves a slow trend all at once while a joint is held at rest.

        residual = low pass (fast) of the signal − low pass (slow) of the signal

    Both are the core's observer without momentum, started at the signal's first value. At rest,
    gravity and friction that sticks are unknown and drift slowly, so the current itself has no
    zero; its changes do. A push that lasts much longer than 1/slow fades: this finds beginnings.

    Parameters
    ----------
    time : (N,) s, increasing.
    signal, velocity : (N, n) currents or torques, and rad/s at the outputs.
    fast, slow : 1/s, corners of the two low passes.
    still_speed : rad/s; a joint that is faster does not stand still: NaN.
    settle : s, at the start of each stretch at rest: NaN, for the trend is not known yet.

    Raises
    ------
    InputError
        Where shapes do not agree, or the corners are not 0 < slow < fast.
    """
    if not 0.0 < slow < fast:
        raise InputError(
            f"standstill_residual: slow = {slow:g} and fast = {fast:g} 1/s; give 0 < slow < fast"
        )
    made = Residual(np.asarray(time), np.asarray(signal), np.asarray(velocity), name, unit)
    left = np.full_like(made.values, np.nan)
    for joint in range(left.shape[1]):
        still = made.speed[:, joint] < still_speed
        for first, last in _stretches(made.time, still):
            rows = slice(int(first), int(last))
            part = _without_trend(made.time[rows], made.values[rows, joint], fast, slow)
            part[made.time[rows] < made.time[first] + settle] = np.nan
            left[rows, joint] = part
    return Residual(made.time, left, made.velocity, name, unit)


def _stretches(time: Array, mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Ranges of rows without a gap in time where the mask is true."""
    inside = mask.copy()
    found = [true_ranges(inside[a:b]) + a for a, b in runs(time)]
    return np.concatenate(found) if found else np.zeros((0, 2), dtype=np.intp)


def _without_trend(time: Array, signal: Array, fast: float, slow: float) -> Array:
    level = np.ascontiguousarray(signal - signal[0])
    rest = np.zeros_like(level)
    quick, trend = (
        _core.observe_momentum(time, rest, level, gain=gain, exact=True) for gain in (fast, slow)
    )
    return np.asarray(quick - trend)


def _columns(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=float)
    return array[:, None] if array.ndim == 1 else array


def residuals_of(
    logs: Residual | Log | Sequence[Residual | Log], model: Model | None, source: str
) -> list[Residual]:
    given: list[Any] = list(logs) if isinstance(logs, (list, tuple)) else [logs]
    for each in given:
        if not isinstance(each, (Residual, Log)):
            raise InputError(
                f"detector: a {type(each).__name__} is no contact-free run; give Residual, or logs "
                "with their model"
            )
    if not given:
        raise InputError("detector: no contact-free logs; give at least one")
    made: list[Residual] = [
        _estimated(log, model, source) if isinstance(log, Log) else log for log in given
    ]
    for each in made:
        if len(each) < 2 or not np.isfinite(each.values).any():
            raise InputError(
                f"detector: log '{each.name}' holds {len(each)} rows and no finite residual over "
                "any time; leave it out or check it"
            )
        if each.values.shape[1] != made[0].values.shape[1] or each.unit != made[0].unit:
            raise InputError(
                f"detector: log '{each.name}' has other joints or another unit than "
                f"'{made[0].name}'; give logs of one arm"
            )
    return made


def _estimated(log: Log, model: Model | None, source: str) -> Residual:
    if model is None:
        raise InputError(f"detector: log '{log.name}' needs model=, whose estimate is watched")
    found = estimate(model, log)[f"external_torque_{source}"]
    velocity = log.columns.get("output_velocity")
    return Residual(log["time"], found, velocity, log.name)


def speed_bands(speed_edges: ArrayLike) -> tuple[float, ...]:
    edges = np.asarray(speed_edges, dtype=float).ravel()
    if not (np.diff(edges, prepend=0.0) > 0.0).all() or len(edges) >= MOST_BANDS:
        raise InputError(
            f"detector: speed_edges = {edges.tolist()}; give at most {MOST_BANDS - 1} speeds above "
            "zero, increasing"
        )
    return tuple(edges.tolist())
