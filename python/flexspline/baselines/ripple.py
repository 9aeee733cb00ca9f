"""Removal of ripple from a reading as refs. 10, 11, 13, 14 of zhang_disturbance_elimination."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.errors import InputError
from flexspline.logs.log import Log
from flexspline.orders.parts import pairs

__all__ = [
    "RippleKalman",
    "kalman_oscillator",
    "order_tracking",
    "sum_of_two_bridges",
    "wave_generator_angle",
]

Array = NDArray[np.float64]

MOST_ORDERS = 8
MOST_POINTS = 256


@dataclass(frozen=True)
class RippleKalman:
    """Settings of the Kalman oscillator.

    Parameters
    ----------
    noise : of the reading, one standard deviation, Nm.
    level_rate : how fast the torque wanders, Nm/√s.
    ripple_rate : how fast the ripple changes as the wave generator turns, Nm/√rad.
    amplitude : of a ripple not known yet, one standard deviation, Nm.
    """

    noise: float = 0.02
    level_rate: float = 1.0
    ripple_rate: float = 0.001
    amplitude: float = 0.5

    def __post_init__(self) -> None:
        for name, least in (("noise", 0.0), ("level_rate", 0.0), ("amplitude", 0.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > least):
                raise InputError(f"Kalman oscillator: {name} = {value} must be above zero")
        if not (math.isfinite(self.ripple_rate) and self.ripple_rate >= 0.0):
            raise InputError(
                f"Kalman oscillator: ripple_rate = {self.ripple_rate} must not be negative"
            )


def wave_generator_angle(log: Log) -> Array:
    """Return the angle of the wave generator against the flexspline, where gauges sit [rad], (N,).

    Where the log does not say which spline is the output it is the motor's, as in the effect
    `wave_generator_ripple`.

    Raises
    ------
    InputError
        Where the log has no position, or only that of the output and no gear ratio.
    """
    known = {pair.name: pair for pair in pairs(log)}
    pair = known.get("wave_generator_flexspline", known["motor_stator"])
    return pair.angle(log)


def kalman_oscillator(
    log: Log,
    orders: Sequence[int],
    settings: RippleKalman | None = None,
    *,
    reading: ArrayLike | None = None,
) -> Array:
    """Return the reading without ripple [Nm], (N,), by a Kalman filter on an oscillator an order.

    Causal; the core's `flexspline/estimators/ripple_oscillator.hpp` has states and formulas. At
    standstill it holds the ripple that it has learnt in motion.

    Parameters
    ----------
    log : with time, the angles, and sensor_torque [Nm].
    orders : periods per turn of the wave generator against the flexspline, 8 at most.
    settings : noise and rates.
    reading : another one than the log's sensor_torque, Nm.

    References
    ----------
    Ref. 10 of zhang_disturbance_elimination (Taghirad); states and walks are ours.
    """
    known = settings or RippleKalman()
    return _core.replay_ripple_oscillator(
        log["time"],
        wave_generator_angle(log),
        _reading(log, reading),
        orders=_orders(orders, "Kalman oscillator"),
        noise=known.noise,
        level_rate=known.level_rate,
        ripple_rate=known.ripple_rate,
        amplitude=known.amplitude,
    )


def order_tracking(
    log: Log, orders: Sequence[int], *, points: int = 64, reading: ArrayLike | None = None
) -> Array:
    """Return the reading without ripple [Nm], (N,), by resampling over angle and back.

    Causal; the core's `flexspline/estimators/order_tracker.hpp`. At standstill it sees no change
    of torque at all: there is no new angle to resample at.

    Parameters
    ----------
    log : with the angles and sensor_torque [Nm].
    orders : as in `kalman_oscillator`, below points/2.
    points : grid angles a turn, 4 to 256; between them the torque is held.
    reading : another one than the log's sensor_torque, Nm.

    References
    ----------
    Ref. 11 of zhang_disturbance_elimination (Jung); the causal form is ours.
    """
    known = _orders(orders, "order tracking")
    if not 2 * max(known) < points <= MOST_POINTS:
        raise InputError(
            f"order tracking: {points} points a turn for order {max(known)}; give more than twice "
            f"the highest order, and {MOST_POINTS} at most"
        )
    return _core.replay_order_tracker(
        wave_generator_angle(log), _reading(log, reading), orders=known, points=points
    )


def sum_of_two_bridges(first: ArrayLike, second: ArrayLike) -> Array:
    """Return the torque of two bridges a quarter of a turn apart, each read by its own circuit.

    Half the sum of both readings [Nm]. Cancels what one cancelling bridge does, as far as the
    two circuits' gains agree; needs two of them, and averages their noise.

    References
    ----------
    Refs. 13, 14 of zhang_disturbance_elimination.
    """
    one, other = np.asarray(first, float), np.asarray(second, float)
    if one.shape != other.shape:
        raise InputError(
            f"sum of two bridges: {one.shape} and {other.shape} rows; give readings of one log"
        )
    return np.asarray(0.5 * (one + other))


def _orders(orders: Sequence[int], who: str) -> list[int]:
    known = [int(order) for order in orders]
    if not 1 <= len(known) <= MOST_ORDERS or len(set(known)) < len(known) or min(known) < 1:
        raise InputError(
            f"{who}: orders {list(orders)}; give 1 to {MOST_ORDERS} different whole numbers from 1"
        )
    return known


def _reading(log: Log, reading: ArrayLike | None) -> Array:
    given = log["sensor_torque"] if reading is None else np.asarray(reading, float)
    if given.shape != (len(log),):
        raise InputError(
            f"log '{log.name}': a reading of shape {given.shape} for {len(log)} rows; give "
            "one value a row"
        )
    return given
