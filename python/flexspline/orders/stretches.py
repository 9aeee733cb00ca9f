"""Stretches of logs in which the joint moves one way: what an order search looks at.

A ripple may change its phase with the direction (friction, lag) and its amplitude with the
speed, so every run is cut by direction; standstill and what follows a reversal are left out.
Within a stretch order k is seen between

    1.5 / turns   below it, a slow trend over part of a turn looks the same,
    0.9 π rate / |v|   near half the sampling rate; beyond it shows up at a false order (alias).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.channels import CHANNELS
from flexspline.logs.segments import runs
from flexspline.orders.parts import output_angle

__all__ = ["NYQUIST", "Stretch", "Values", "chosen_values", "stretches", "sweeps"]

Values = str | Sequence[ArrayLike] | Callable[[Log], ArrayLike]

_WINDOW = 0.05  # s, over which the speed is taken
_STILL = 0.3  # of the run's usual speed: slower than this counts as a reversal or standstill
_SETTLE = (0.5, 0.1)  # s left out after a start and before a stop: presliding, overshoot
_SHORTEST = 64  # rows that a stretch needs
_CYCLES = 1.5  # cycles in the span from which an order can be told from a trend
NYQUIST = 0.9  # of half the sampling rate


@dataclass(frozen=True)
class Stretch:
    """One direction of one run.

    `angle` [rad at the output], `raw` values [unit of the channel], `values` without their
    smooth part and `base`, its orthonormal columns, shape (rows, columns); `speed` [rad/s,
    signed, median]; `turns` of the output that the angle spans; `lowest` and `highest` order seen;
    `time` [s] and signed `speeds` [rad/s] of the rows.
    """

    run: int
    name: str
    angle: NDArray[np.float64]
    raw: NDArray[np.float64]
    values: NDArray[np.float64]
    base: NDArray[np.float64]
    speed: float
    turns: float
    lowest: float
    highest: float
    time: NDArray[np.float64]
    speeds: NDArray[np.float64]


def chosen_values(
    logs: Sequence[Log], values: Values, unit: str | None
) -> tuple[list[NDArray[np.float64]], str, str]:
    """Return one array for each log, with the name and the unit of what they hold.

    Raises
    ------
    InputError
        For no logs, another number of arrays than of logs, or arrays of another length.
    """
    if not logs:
        raise InputError("order analysis: no log was given; give at least one")
    if isinstance(values, str):
        known = CHANNELS[values].unit if values in CHANNELS else ""
        return [log[values] for log in logs], values, unit if unit is not None else known
    given = [values(log) for log in logs] if callable(values) else list(values)
    arrays = [np.asarray(entry, dtype=np.float64) for entry in given]
    if len(arrays) != len(logs):
        raise InputError(
            f"order analysis: {len(arrays)} arrays of values for {len(logs)} logs; "
            "give one array for each log"
        )
    for log, array in zip(logs, arrays, strict=True):
        if array.shape != (len(log),):
            raise InputError(
                f"log '{log.name}': the values have shape {array.shape} and the log has "
                f"{len(log)} rows; give one value for each row"
            )
    return arrays, "values", unit or ""


def stretches(
    logs: Sequence[Log], arrays: Sequence[NDArray[np.float64]], longest: float
) -> list[Stretch]:
    """Cut runs by direction into stretches of at most `longest` turns, smooth part taken out.

    Raises
    ------
    InputError
        Where no run moves.
    """
    found = [
        stretch
        for run, (log, values) in enumerate(zip(logs, arrays, strict=True))
        for stretch in _of_run(run, log, values, longest)
    ]
    if not found:
        raise InputError(
            "order analysis: the joint stands still in every log; orders need runs in motion"
        )
    return found


def sweeps(parts: Sequence[Stretch]) -> list[Stretch]:
    """Cut stretches where their rows are not one after the other in time: at each reversal.

    Sweeps of too few rows are left out; where there are no others, the stretches stay as they are.
    """
    made = [
        _sweep(part, slice(int(first), int(last)))
        for part in parts
        for first, last in runs(part.time)
        if last - first >= _SHORTEST
    ]
    return made or list(parts)


def _sweep(part: Stretch, rows: slice) -> Stretch:
    angle, base = part.angle[rows], _orthonormal(part.base[rows])
    turns = float(np.ptp(angle)) / (2 * np.pi)
    return replace(
        part,
        angle=angle,
        raw=part.raw[rows],
        values=part.values[rows] - base @ (base.T @ part.values[rows]),
        base=base,
        speed=float(np.median(part.speeds[rows])),
        turns=turns,
        lowest=_CYCLES / turns,
        time=part.time[rows],
        speeds=part.speeds[rows],
    )


def _of_run(run: int, log: Log, values: NDArray[np.float64], longest: float) -> Iterator[Stretch]:
    angle, time = output_angle(log), log["time"]
    good = np.isfinite(angle) & np.isfinite(values) & np.isfinite(time)
    if np.count_nonzero(good) < _SHORTEST:
        return
    angle, time, values = angle[good], time[good], values[good]
    speed = _smooth_speed(time, angle)
    usual = float(np.quantile(np.abs(speed), 0.9))
    if not usual > 0:
        return
    rate = log.rate
    for sign, word in ((1, "+"), (-1, "-")):
        way = _settled(time, speed * sign > _STILL * usual)
        if len(way) < _SHORTEST:
            continue
        start = angle[way].min()
        pieces = max(1, int(np.ceil((angle[way].max() - start) / (2 * np.pi * longest))))
        which = np.minimum((angle[way] - start) // (2 * np.pi * longest), pieces - 1)
        for piece in range(pieces):
            rows = way[which == piece]
            if len(rows) >= _SHORTEST:
                name = f"{log.name} {word}" + (f" part {piece + 1}" if pieces > 1 else "")
                yield _stretch(run, name, time[rows], angle[rows], values[rows], speed[rows], rate)


def _settled(time: NDArray[np.float64], moving: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the moving rows away from starts and stops, all of them where few would stay."""
    change = np.diff(moving.astype(np.int8))
    starts, stops = time[1:][change > 0], time[:-1][change < 0]
    since = np.concatenate([[-np.inf], starts])[np.searchsorted(starts, time, side="right")]
    until = np.concatenate([stops, [np.inf]])[np.searchsorted(stops, time, side="left")]
    calm = moving & (time - since >= _SETTLE[0]) & (until - time >= _SETTLE[1])
    enough = np.count_nonzero(calm) > 0.5 * np.count_nonzero(moving)
    return np.flatnonzero(calm if enough else moving)


def _stretch(
    run: int,
    name: str,
    time: NDArray[np.float64],
    angle: NDArray[np.float64],
    values: NDArray[np.float64],
    speed: NDArray[np.float64],
    rate: float,
) -> Stretch:
    turns = float(np.ptp(angle)) / (2 * np.pi)
    base = _smooth_base(angle, speed)
    rest = values - base @ (base.T @ values)
    fast = float(np.quantile(np.abs(speed), 0.95))
    return Stretch(
        run,
        name,
        angle,
        values,
        rest,
        base,
        float(np.median(speed)),
        turns,
        _CYCLES / turns,
        NYQUIST * np.pi * rate / fast,
        time,
        speed,
    )


def _smooth_speed(time: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return dq/dt [rad/s] over a window, from the position: a velocity channel may be late."""
    half = max(_WINDOW / 2, 2 * float(np.median(np.diff(time))))
    late, early = np.minimum(time + half, time[-1]), np.maximum(time - half, time[0])
    change = np.interp(late, time, angle) - np.interp(early, time, angle)
    return np.asarray(change / np.maximum(late - early, 1e-300), dtype=np.float64)


def _smooth_base(angle: NDArray[np.float64], speed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return orthonormal columns: a cubic of the angle, and of a changing speed a parabola."""
    x = 2 * (angle - angle.min()) / np.ptp(angle) - 1
    columns = np.polynomial.legendre.legvander(x, 3)
    if np.std(speed) > 0.2 * abs(np.mean(speed)):
        v = speed / np.max(np.abs(speed))
        columns = np.column_stack([columns, v, v * v])
    return _orthonormal(columns)


def _orthonormal(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    ortho, triangle = np.linalg.qr(columns)
    size = np.abs(np.diag(triangle))
    kept: NDArray[np.float64] = ortho[:, size > 1e-9 * size.max()]
    return kept
