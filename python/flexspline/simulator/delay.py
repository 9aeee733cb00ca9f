"""Is the measured value late behind the simulated one?

    y(t) = s(t − D) + N(t) c        D minimises the sum of squares, c solved for each D

N holds what a simulation may lack and what looks like a delay at one frequency: a constant,
tanh(v / v_d), v, q̈, sin q, cos q, the known torque, |s| tanh(v / v_d), and friction that comes up
over some way behind a reversal (presliding: late by an angle, not by a time). The error of D is of
sixteen blocks of time, as in `logs/checks/delay.py`. D is reported and never taken away.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from flexspline.logs.checks.consistency import MOST_ROWS, SURE, WITHIN, block_error, motion_columns
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.motion import Motion, motion_of
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step, since_reversal
from flexspline.simulator.record import SIMULATED

__all__ = ["late"]

Array = NDArray[np.float64]

STEP = 0.005  # s, of the scan, as in the checks
LEFT = 0.5
"""Of the squares that no delay leaves: one that leaves more is not told from other things that a
simulation may lack. In simulated runs that lack one effect each, delays of 3 ms left 0.06 to 0.8 of
them, and delays that were none 0.6 to 0.98: half finds fewer, twice reports false ones."""
LEAST_ROWS = 200
WAYS = (0.005, 0.02, 0.08)  # rad behind a reversal: a factor of two moves no delay that is there


def late(log: Log, measured: Array, simulated: Array, what: str) -> Iterator[Finding]:
    """Say by how much measured values (N,) are late behind simulated ones, if they surely are."""
    motion = motion_of(log)
    if motion is None:
        return
    found = _delay(log, motion, measured, simulated)
    if found is None:
        return
    seconds, error = found
    way = "late behind" if seconds > 0.0 else "ahead of"
    yield Finding(
        "simulation_delay",
        "fault",
        SIMULATED,
        (0, len(log)),
        seconds,
        "s",
        f"the {what} is {1e3 * abs(seconds):.3g} ± {1e3 * error:.1g} ms {way} the simulated one; "
        "that is reported and not taken away.",
        "If a clock or a filter makes it, align the time stamps and run again.",
    )


def _lacking(motion: Motion, columns: Array, says: Array) -> Array:
    """N: what a simulation may lack, (rows, K), behind the motion's low pass."""
    since = since_reversal(motion.time, motion.position, motion.velocity, 0.0)
    way = np.nan_to_num(since.angle, nan=np.inf)
    coming = [since.direction * np.exp(-way / width) for width in WAYS]
    late = motion.low_passed(np.column_stack(coming))
    return np.column_stack((columns, np.abs(says) * columns[:, 0], late, np.ones(len(says))))


def _delay(
    log: Log, motion: Motion, measured: Array, simulated: Array
) -> tuple[float, float] | None:
    """The delay and its standard error, s, where it is sure and matters."""
    reading, says = motion.smooth(measured), motion.smooth(simulated)
    beside = _lacking(motion, motion_columns(log, motion), says)
    step = median_step(motion.time)
    within = min(WITHIN, float(motion.time[-1] - motion.time[0]) / 8.0)
    rows = np.flatnonzero(motion.inside(within))
    rows = rows[:: max(1, rows.size // MOST_ROWS)]
    if rows.size < LEAST_ROWS or np.ptp(says) == 0.0:
        return None
    scale = np.sqrt(np.mean(beside[rows] ** 2, axis=0))
    basis = np.linalg.qr(beside[np.ix_(rows, scale > 0.0)] / scale[scale > 0.0])[0]
    curve, at = CubicSpline(motion.time, says), motion.time[rows]

    def rest(delay: float) -> Array:
        left = reading[rows] - curve(at - delay)
        return np.asarray(left - basis @ (basis.T @ left))

    def loss(delay: float) -> float:
        left = rest(delay)
        return float(left @ left)

    grid = np.linspace(-within, within, 2 * max(1, int(np.ceil(within / STEP))) + 1)
    start = float(grid[int(np.argmin([loss(delay) for delay in grid]))])
    spacing = float(grid[1] - grid[0])
    bounds = (max(start - spacing, -within), min(start + spacing, within))
    best = float(minimize_scalar(loss, bounds=bounds, method="bounded").x)
    tick = 0.1 * spacing
    slope = np.asarray(curve(at - best - tick) - curve(at - best)) / tick
    error = block_error(rest(best), slope, basis)
    sure = max(0.5 * step, SURE * error) < abs(best) < 0.98 * within
    matters = loss(best) < LEFT * loss(0.0)
    return (best, error) if sure and matters else None
