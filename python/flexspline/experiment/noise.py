"""The recorded noise as a run of another rate sees it.

An autoregressive noise has the spectrum σ² / |A(e^{iω})|². What of it lies below half of a coarser
rate has the autocovariance

    r_k = (1 / π) ∫_0^{π/m} σ² / |A(e^{iω})|² cos(ω m k) dω

at every m-th row, and is autoregressive again (Yule and Walker), so that a slow excitation tells
as much at the coarser rate as at the one that was recorded.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import freqz

from flexspline.logs.local_fit import WIDEST
from flexspline.regression.gram import Whitening

__all__ = ["at_coarser_rate"]

FAST = 100.0  # Hz, what a planned run is looked at with
SLOW = 50.0
OF_A_PERIOD = 8.0  # rows of ripple, at least: its sine is followed to some per cent
POINTS = 1 << 14
MARGIN = 1e-6  # of a rate, that the steps of a planned run's clock are rounded by at most


def at_coarser_rate(
    whitening: Whitening, rate: float, fastest: float = 0.0, lowpass: float | None = None
) -> tuple[Whitening, float]:
    """Return the noise and the rate [Hz] that a planned run is judged with.

    Parameters
    ----------
    rate : Hz, of the recorded runs.
    fastest : Hz, of ripple that the run has to follow.
    lowpass : Hz, that the planned run is looked at with, as the recorded ones were; None: none.
    """
    news = rate / whitening.decimation
    least = 0.0 if lowpass is None else (1.0 + MARGIN) * lowpass / WIDEST
    fast = max(FAST, OF_A_PERIOD * fastest)
    if news < 2.0 * fast or least > fast:
        slowest = max(min(max(SLOW, OF_A_PERIOD * fastest), rate), least)
        rows = max(1, int(np.ceil(slowest / news)))
        return Whitening(whitening.denominator, whitening.variance, rows), news * rows
    every = int(news / fast)
    order = max(whitening.order, 1)
    frequency = np.linspace(0.0, np.pi / every, POINTS)
    _, response = freqz([1.0], whitening.denominator, worN=frequency)
    power = whitening.variance * np.abs(response) ** 2
    waves = np.cos(np.outer(np.arange(order + 1) * every, frequency))
    lags = np.trapezoid(power * waves, frequency, axis=1) / np.pi
    phi = solve_toeplitz(lags[:order] * np.where(np.arange(order), 1.0, 1.0 + 1e-9), lags[1:])
    variance = max(float(lags[0] - phi @ lags[1:]), 1e-12 * float(lags[0]))
    return Whitening(np.append(1.0, -phi), variance, 1), news / every
