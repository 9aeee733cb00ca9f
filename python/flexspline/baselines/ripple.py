"""Removal of ripple from a reading as refs. 10, 11, 13, 14 of zhang_disturbance_elimination.

Ways to remove it stand side by side on one log with a known truth: what each leaves, delays and
costs.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.effects import Effect
from flexspline.errors import InputError
from flexspline.fitting import fit
from flexspline.formatting import rows_text, scores_html, short
from flexspline.logs.log import Log
from flexspline.logs.read import as_logs
from flexspline.logs.segments import standstill, true_ranges
from flexspline.orders.parts import pairs
from flexspline.signals import core_channels, gear_of

if TYPE_CHECKING:
    import pandas

__all__ = [
    "MethodScore",
    "RippleComparison",
    "RippleKalman",
    "compare_ripple_methods",
    "kalman_oscillator",
    "order_tracking",
    "sum_of_two_bridges",
    "wave_generator_angle",
]

Array = NDArray[np.float64]

MOST_ORDERS = 8
MOST_POINTS = 256

RIPPLE = "wave_generator_ripple"
STEPS = 6  # of torque, in motion and at standstill
REPEATS = 5  # of which the quickest counts


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


@dataclass(frozen=True, eq=False)
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
    runs = as_logs(training)
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


@dataclass(frozen=True)
class MethodScore:
    """What one method leaves of the ripple.

    Parameters
    ----------
    name : of the method.
    moving_error, rest_error : RMS of its torque less the true one, in motion and at standstill,
        Nm, less the mean error in motion (a zero).
    orders : amplitude left in motion by order, Nm.
    moving_delay, rest_delay : mean delay of a step of torque, s; infinite where half of the step
        did not come out within the window.
    cost : s per sample, measured on this machine; `operations`: additions and multiplications,
        estimated.
    needs : what it takes beside one bridge and its reading.
    """

    name: str
    moving_error: float
    rest_error: float
    orders: Mapping[int, float]
    moving_delay: float
    rest_delay: float
    cost: float
    operations: float
    needs: str


@dataclass(frozen=True)
class RippleComparison:
    """Scores of all methods on one log; `window`: s behind a step in which delay is measured."""

    scores: tuple[MethodScore, ...]
    window: float

    def __getitem__(self, name: str) -> MethodScore:
        return next(score for score in self.scores if score.name == name)

    def to_frame(self) -> pandas.DataFrame:
        """Return the scores in SI units, by the names of the methods."""
        import pandas

        data = [
            {
                **{k: v for k, v in vars(s).items() if k not in ("orders", "name")},
                **{f"order_{order}": size for order, size in s.orders.items()},
            }
            for s in self.scores
        ]
        return pandas.DataFrame(data, index=[s.name for s in self.scores])

    def __str__(self) -> str:
        rows = self._rows()
        return f"{rows_text(rows, left=(0, len(rows[0]) - 1))}\n{self._note()}"

    def to_html(self) -> str:
        """Return the table as HTML."""
        return scores_html(self._rows(), note=self._note())

    def _repr_html_(self) -> str:
        return self.to_html()

    def _note(self) -> str:
        return (
            "left: RMS of torque less the true one; delay: mean of a step's, ∞ where not half of "
            f"it came out within {self.window:g} s"
        )

    def _rows(self) -> list[tuple[str, ...]]:
        orders = list(self.scores[0].orders)
        head = (
            "method",
            "in motion: left [mNm]",
            *(f"order {order} [mNm]" for order in orders),
            "delay [ms]",
            "at standstill: left [mNm]",
            "delay [ms]",
            "cost [ns]",
            "operations",
            "needs",
        )
        return [head, *(self._cells(score) for score in self.scores)]

    def _cells(self, s: MethodScore) -> tuple[str, ...]:
        return (
            s.name,
            short(1e3 * s.moving_error),
            *(short(1e3 * size) for size in s.orders.values()),
            _milliseconds(s.moving_delay),
            short(1e3 * s.rest_error),
            _milliseconds(s.rest_delay),
            f"{1e9 * s.cost:.0f}",
            f"{s.operations:.0f}",
            s.needs,
        )


def _milliseconds(delay: float) -> str:
    if math.isinf(delay):
        return "∞"
    if math.isnan(delay):
        return "–"
    return f"{1e3 * delay + 0.0:.2f}" if abs(delay) >= 5e-6 else "0"
