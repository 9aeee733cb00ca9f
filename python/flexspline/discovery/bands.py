"""How large a residual is in bands of frequency, and of orders of the output.

Each unbroken stretch is turned into cosines (DCT-II, orthonormal): it does not take the step
between its last row and its first for a ripple, and by Parseval the squares of the bands add up to
those of the rows,

    Σ r² = Σ c_k²,     f_k = k / (2 N Δt),     order_k = π k / L  over an angle L [rad].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from flexspline.discovery.settings import SETTINGS
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step, runs, true_ranges
from flexspline.orders.parts import effective_ratio, output_angle

__all__ = ["frequency_bands", "order_bands"]

Array = NDArray[np.float64]

DECADE = 1.0 / SETTINGS.little
HIGH_HZ = HIGH_ORDER = DECADE  # where the rate shows it; a power of ten below otherwise
LEAST_ANGLE = 0.5  # rad of the same
MOVES = 0.5  # of the largest speed but for a tenth, from which a row belongs to such a stretch


def frequency_bands(
    logs: Sequence[Log], residuals: Sequence[Sequence[Array]]
) -> list[tuple[str, list[float]]]:
    """Return label and RMS of each band, slow to fast.

    Parameters
    ----------
    logs : runs.
    residuals : for each of several models, an array (N,) for each run; NaN where a row does not
        count.

    Returns
    -------
    list of (label, RMS of each model, in the unit of the residuals)
    """
    rate = 1.0 / max(median_step(log["time"]) for log in logs)
    high = min(HIGH_HZ, DECADE ** np.floor(np.log10(0.5 * SETTINGS.most * rate)))
    edges = [0.0, high / DECADE, high, np.inf]
    labels = [f"below {edges[1]:g} Hz", f"{edges[1]:g} to {high:g} Hz", f"above {high:g} Hz"]
    made = [_banded(_in_time(logs, values), edges) for values in residuals]
    return [(label, [sizes[k] for sizes in made]) for k, label in enumerate(labels)]


def order_bands(
    logs: Sequence[Log], residuals: Sequence[Sequence[Array]]
) -> list[tuple[str, list[float]]]:
    """Return label and RMS of each band of orders per output turn, while the joint turns.

    Empty where the runs hold no angle or speed, or turn less than half a radian one way. Takes what
    `frequency_bands` takes.
    """
    if not all("output_position" in log and "output_velocity" in log for log in logs):
        return []
    ratio = effective_ratio(logs[0].facts)
    high = 0.5 * ratio if ratio is not None and ratio > 2.0 * HIGH_ORDER else 0.5 * HIGH_ORDER**2
    edges = [0.0, HIGH_ORDER, high, np.inf]
    labels = [f"below order {HIGH_ORDER:g}", f"orders {HIGH_ORDER:g} to {high:g}",
              f"above order {high:g}"]  # fmt: skip
    made = [_banded(_in_angle(logs, values), edges) for values in residuals]
    if not np.isfinite(made).all():
        return []
    return [(label, [sizes[k] for sizes in made]) for k, label in enumerate(labels)]


def _banded(parts: Iterator[tuple[Array, Array]], edges: Sequence[float]) -> list[float]:
    """RMS of each band; NaN without a part."""
    squares, rows = np.zeros(len(edges) - 1), 0
    for at, values in parts:
        power = np.asarray(dct(values, norm="ortho")) ** 2
        for k, (low, high) in enumerate(pairwise(edges)):
            squares[k] += power[(at >= low) & (at < high)].sum()
        rows += len(values)
    sizes: list[float] = np.sqrt(squares / rows if rows else squares * np.nan).tolist()
    return sizes


def _in_time(logs: Sequence[Log], residuals: Sequence[Array]) -> Iterator[tuple[Array, Array]]:
    """Frequencies [Hz] of the cosines, and the values, of each unbroken stretch that counts."""
    for log, values in zip(logs, residuals, strict=True):
        for first, last in runs(log["time"]):
            for a, b in true_ranges(np.isfinite(values[first:last])) + first:
                step = (log["time"][b - 1] - log["time"][a]) / max(b - a - 1, 1)
                yield np.arange(b - a) / (2.0 * (b - a) * (step or 1.0)), values[a:b]


def _in_angle(logs: Sequence[Log], residuals: Sequence[Array]) -> Iterator[tuple[Array, Array]]:
    """Orders of the cosines, and the values at even angles, of each stretch in one direction."""
    for log, values in zip(logs, residuals, strict=True):
        angle, velocity = output_angle(log), log["output_velocity"]
        moving = MOVES * float(np.nanquantile(np.abs(velocity), SETTINGS.most))
        good = np.isfinite(angle) & np.isfinite(values)
        for first, last in runs(log["time"]):
            for way in (1.0, -1.0):
                ahead = (way * velocity > moving) & good
                for a, b in true_ranges(ahead[first:last]) + first:
                    turned = np.maximum.accumulate(way * (angle[a:b] - angle[a]))
                    if b - a < SETTINGS.lines or turned[-1] < LEAST_ANGLE:
                        continue
                    even = np.linspace(0.0, turned[-1], b - a)
                    yield (
                        np.pi * np.arange(b - a) / turned[-1],
                        np.interp(even, turned, values[a:b]),
                    )
