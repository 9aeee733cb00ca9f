"""Ways to remove wave-generator ripple side by side, on one log with a known truth."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.baselines.ripple import (
    RippleKalman,
    kalman_oscillator,
    order_tracking,
    sum_of_two_bridges,
    wave_generator_angle,
)
from flexspline.baselines.table import MethodScore, RippleComparison
from flexspline.effects import Effect
from flexspline.errors import InputError
from flexspline.fitting import fit
from flexspline.logs.log import Log
from flexspline.logs.segments import standstill, true_ranges
from flexspline.signals import core_channels, gear_of

__all__ = ["compare_ripple_methods"]

Array = NDArray[np.float64]

RIPPLE = "wave_generator_ripple"
STEPS = 6  # of torque, in motion and at standstill
REPEATS = 5  # of which the quickest counts


@dataclass(frozen=True)
class _Method:
    """`remove` gives the torque of the log when `added` [Nm] is on top of the true one."""

    name: str
    remove: Callable[[Array], Array]
    operations: float
    needs: str


def compare_ripple_methods(
    log: Log,
    training: Log | Sequence[Log],
    *,
    truth: ArrayLike | None = None,
    orders: Sequence[int] = (1, 2),
    cancelling: ArrayLike | None = None,
    two_bridges: tuple[ArrayLike, ArrayLike] | None = None,
    kalman: RippleKalman | None = None,
    points: int = 64,
    learning: float = 2.0,
    window: float = 0.5,
    at_rest: ArrayLike | None = None,
) -> RippleComparison:
    """Return one table: ripple left, delay added and cost, in motion and at standstill.

    Parameters
    ----------
    log : with time, the angles, and the sensor_torque [Nm] of a bridge that ripples; it moves
        and stands still, under a torque that changes.
    training : runs that the regression (`wave_generator_ripple`) is fitted to; their
        reference_torque, where they have one, is taken off first.
    truth : true torque [Nm], (N,); None: the log's reference_torque.
    orders : to remove, per turn of the wave generator against the flexspline.
    cancelling : reading of a cancelling placement on the same run [Nm], (N,).
    two_bridges : readings of two bridges a quarter of a turn apart, each through its own
        circuit [Nm].
    kalman, points : settings of the Kalman oscillator and of order tracking.
    learning : s at the start that do not count: what learns in motion needs some.
    window : s behind a test step of 1 Nm in which its delay is measured; at least a turn of the
        wave generator.
    at_rest : rows of standstill, (N,); None: `flexspline.logs.segments.standstill`.

    Returns
    -------
    RippleComparison

    Raises
    ------
    InputError
        Where there is no truth, or the log never moves or never rests for longer than `window`.

    Notes
    -----
    Delay: the torque gets a step of 1 Nm at several instants, and r(t), what comes out more than
    without it, gives ∫ (1 − r/r_end) dt over the window: the group delay at low frequency.
    Every method here is linear in the reading, so this is its delay whatever the log.
    """
    rest = standstill(log) if at_rest is None else np.asarray(at_rest, dtype=bool)
    counts = log["time"] >= log["time"][0] + learning
    trial = _Trial(log, _truth(log, truth), tuple(orders), ~rest & counts, rest & counts, window)
    methods = [
        _Method("nothing", lambda added: log["sensor_torque"] + added, 0.0, "nothing"),
        *_placements(cancelling, two_bridges),
        *_filters(log, orders, kalman or RippleKalman(), points),
        _regression(log, training, orders),
    ]
    return RippleComparison(tuple(trial.score(method) for method in methods), window)


@dataclass(frozen=True)
class _Trial:
    """What all methods are tried on: `moving` and `rest` are the rows that count, (N,)."""

    log: Log
    true: Array
    orders: tuple[int, ...]
    moving: NDArray[np.bool_]
    rest: NDArray[np.bool_]
    window: float

    def score(self, method: _Method) -> MethodScore:
        plain = method.remove(np.zeros(len(self.log)))
        moving_late = self._delay(method, plain, self.moving)
        rest_late = self._delay(method, plain, self.rest)
        error = plain - self.true
        error = error - np.nanmean(error[self.moving])
        return MethodScore(
            method.name,
            _rms(error[self.moving]),
            _rms(error[self.rest]),
            _amplitudes(error, wave_generator_angle(self.log), self.moving, self.orders),
            moving_late,
            rest_late,
            _cost(method, len(self.log)),
            method.operations,
            method.needs,
        )

    def _delay(self, method: _Method, plain: Array, rows: NDArray[np.bool_]) -> float:
        """Median over some instants of ∫ (1 − r/r_end) dt behind a step of 1 Nm."""
        length = round(self.window * self.log.rate)
        found = []
        for at in self._instants(rows, length).tolist():
            step = np.zeros(len(self.log))
            step[at:] = 1.0
            response = (method.remove(step) - plain)[at : at + length]
            end = float(response[-max(1, length // 10) :].mean())
            late = float(np.sum(1.0 - response / end)) / self.log.rate if end > 0.5 else np.inf
            found.append(late)
        return float(np.median(found))

    def _instants(self, rows: NDArray[np.bool_], length: int) -> NDArray[np.intp]:
        """Rows with at least `length` more of the same regime behind them, spread over the log."""
        starts = [np.arange(a, b - length) for a, b in true_ranges(rows) if b - a > length]
        if not starts:
            raise InputError(
                f"log '{self.log.name}': it must both move and stand still for more than "
                f"{self.window:g} s; give a log that does, or a shorter window"
            )
        found = np.concatenate(starts)
        return found[np.linspace(0, len(found) - 1, min(STEPS, len(found))).astype(np.intp)]


def _placements(
    cancelling: ArrayLike | None, two_bridges: tuple[ArrayLike, ArrayLike] | None
) -> list[_Method]:
    found = []
    if cancelling is not None:
        quiet = np.asarray(cancelling, float)
        found.append(
            _Method("cancelling placement", lambda added: quiet + added, 0.0, "gauges in place")
        )
    if two_bridges is not None:
        one, other = (np.asarray(bridge, float) for bridge in two_bridges)
        found.append(
            _Method(
                "sum of two bridges",
                lambda added: sum_of_two_bridges(one + added, other + added),
                2.0,
                "gauges in place, two circuits",
            )
        )
    return found


def _filters(
    log: Log, orders: Sequence[int], kalman: RippleKalman, points: int
) -> tuple[_Method, _Method]:
    """Order tracking and the oscillator; operations counted from the core's loops."""
    reading, known = log["sensor_torque"], len(orders)
    states = 1 + 2 * known
    turns = float(np.abs(np.diff(wave_generator_angle(log))).sum()) / (2.0 * np.pi)
    passed = min(1.0, turns * points / len(log))  # share of samples that reach a new grid angle
    return (
        _Method(
            "order tracking",
            lambda added: order_tracking(log, orders, points=points, reading=reading + added),
            2.0 * points * passed + 12.0,
            "the angle, and that it turns",
        ),
        _Method(
            "Kalman oscillator",
            lambda added: kalman_oscillator(log, orders, kalman, reading=reading + added),
            known * (46.0 + 12.0 * states) + states * (known + 5.0) + 3.0 * states**2,
            "the angle, a tuning, motion to learn in",
        ),
    )


def _regression(log: Log, training: Log | Sequence[Log], orders: Sequence[int]) -> _Method:
    """Ours: the ripple fitted once, predicted from the angle and taken off."""
    runs = [training] if isinstance(training, Log) else list(training)
    load = "reference_torque" if all("reference_torque" in run for run in runs) else None
    fitted = fit(
        ["offset", RIPPLE],
        runs,
        "sensor_torque",
        known_load=load,
        orders={RIPPLE: [int(order) for order in orders]},
        checks=False,
    )
    part = fitted.model.part("sensor_torque")
    effect: Effect = next(e for e in part.effects if e.name == RIPPLE)
    values = part.coefficients[-len(effect.terms) :]
    channels = core_channels(log, [effect], None)
    design = _core.Design([effect.for_core()], **gear_of(log.facts, "motor_position" in log))

    def remove(added: Array) -> Array:
        ripple = design.predict(channels, len(log), values)
        return np.asarray(log["sensor_torque"] + added - ripple)

    return _Method(
        "regression", remove, 46.0 * len(orders) + 1.0, "the angle, a run to fit beforehand"
    )


def _truth(log: Log, truth: ArrayLike | None) -> Array:
    if truth is None and "reference_torque" not in log:
        raise InputError(
            f"log '{log.name}': ripple methods need the true torque; give truth or a log with "
            "reference_torque"
        )
    true = log["reference_torque"] if truth is None else np.asarray(truth, float)
    if true.shape != (len(log),):
        raise InputError(f"log '{log.name}': truth has shape {true.shape}; give one value a row")
    return true


def _amplitudes(
    error: Array, angle: Array, rows: NDArray[np.bool_], orders: Sequence[int]
) -> dict[int, float]:
    """Amplitude of each order in the error, all fitted together."""
    good = rows & np.isfinite(error)
    phase = np.outer(angle[good], np.array(orders, float))
    design = np.hstack([np.ones((len(phase), 1)), np.cos(phase), np.sin(phase)])
    found = np.linalg.lstsq(design, error[good], rcond=None)[0][1:]
    size = np.hypot(*found.reshape(2, len(orders)))
    return {int(order): float(amount) for order, amount in zip(orders, size, strict=True)}


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _cost(method: _Method, rows: int) -> float:
    """Seconds per sample, the quickest of some repeats."""
    added = np.zeros(rows)
    taken = []
    for _ in range(REPEATS):
        before = clock.perf_counter()
        method.remove(added)
        taken.append(clock.perf_counter() - before)
    return min(taken) / rows
