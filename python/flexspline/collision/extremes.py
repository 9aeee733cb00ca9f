"""How often a residual that nobody touches exceeds a threshold that it has never reached.

Peaks over a level u, one for each cluster (exceedances closer than the declustering time are one
event), follow a generalised Pareto law; how many there are, a Poisson law:

    rate(x) = ζ (1 + ξ (x − u) / σ)^(−1/ξ)        1/h

A confidence interval of a threshold or a rate is its range over all (ξ, σ, ζ) whose likelihood is
not too far below the best: deviance below the χ² quantile with two degrees of freedom, the joint
region of ξ and σ. That is wider than the profile likelihood's one degree, for a finite level leaves
a bias that no likelihood knows of. The tail of Gaussian noise looks shorter at any level than it
is (ξ < 0, and 0 in the limit), so what is plausible with ξ ≥ 0 alone counts as plausible too. The
clusters' counts vary more than Poisson's where the residual's spread changes; ζ's share of the
deviance is divided by their dispersion. Sources: [Coles2001], An Introduction to
Statistical Modeling of Extreme Values, ch. 4, 5; [FerroSegers2003] on declustering.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

__all__ = ["LEAST_CLUSTERS", "Tail", "cluster_peaks", "correlation_time", "fit_tail"]

Array = NDArray[np.float64]

LEAST_CLUSTERS = 30
MOST_CLUSTERS = 100
SHAPES = np.linspace(-0.5, 0.9, 57)
"""ξ: below zero a tail that ends, 0 exponential, 0.5 infinite variance."""
SPREADS = 61
ROUNDS = 20


@dataclass(frozen=True)
class Tail:
    """The tail of one residual in one direction.

    Parameters
    ----------
    level : u, unit of the residual.
    peaks : (k,) above the level, one for each cluster.
    hours : how long the residual was watched.
    shape, scale : ξ and σ at the largest likelihood.
    dispersion : variance over mean of the clusters' counts in twenty blocks, at least 1.
    """

    level: float
    peaks: Array
    hours: float
    shape: float
    scale: float
    dispersion: float

    @property
    def clusters_per_hour(self) -> float:
        """ζ."""
        return len(self.peaks) / self.hours

    def rate(self, threshold: float) -> float:
        """Return the most likely rate of exceedances of a threshold above the level, 1/h."""
        over = threshold - self.level
        return float(
            self.clusters_per_hour * stats.genpareto.sf(over, self.shape, scale=self.scale)
        )

    def threshold(self, rate: float) -> float:
        """Return the most likely threshold that is exceeded at a rate [1/h]."""
        return self.level + float(
            _excess(rate / self.clusters_per_hour, np.array(self.shape), np.array(self.scale))
        )

    def threshold_interval(self, rate: float, confidence: float) -> tuple[float, float]:
        """Return the two-sided interval of the threshold with this rate."""
        shape, scale, spread = self._plausible(confidence)
        low = _excess(rate / (self.clusters_per_hour * np.exp(-spread)), shape, scale)
        high = _excess(rate / (self.clusters_per_hour * np.exp(spread)), shape, scale)
        return self.level + max(float(low.min()), 0.0), self.level + float(high.max())

    def rate_interval(self, threshold: float, confidence: float) -> tuple[float, float]:
        """Return the two-sided interval of the rate at a threshold above the level, 1/h."""
        shape, scale, spread = self._plausible(confidence)
        share = stats.genpareto.sf(threshold - self.level, shape, scale=scale)
        low = self.clusters_per_hour * np.exp(-spread) * share
        high = self.clusters_per_hour * np.exp(spread) * share
        return float(low.min()), float(high.max())

    def _plausible(self, confidence: float) -> tuple[Array, Array, Array]:
        """ξ, σ and how far log ζ may be off, of all that the data do not exclude."""
        shape, scale, likelihood = _likelihoods(self.peaks, self.scale)
        deviance = 2.0 * (likelihood.max() - likelihood)
        heavy = shape >= -1e-9
        long_tailed = 2.0 * (likelihood[heavy].max() - likelihood)
        deviance = np.where(heavy, np.minimum(deviance, long_tailed), deviance)
        left = float(stats.chi2.ppf(confidence, 2)) - deviance
        kept = left >= 0.0
        spread = np.sqrt(left[kept] * self.dispersion / len(self.peaks))
        return shape[kept], scale[kept], spread


def correlation_time(values: Array, step: float) -> float:
    """Return the lag [s] at which the autocorrelation of a residual falls below 0.1.

    At least one step. Of the longest stretch that is finite, its mean taken off.
    """
    padded = np.concatenate(([False], np.isfinite(values), [False]))
    edges = np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)
    if not len(edges):
        return step
    first, last = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    part = values[first:last] - values[first:last].mean()
    size = 1 << int(2 * len(part) - 1).bit_length()
    power = np.abs(np.fft.rfft(part, size)) ** 2
    together = np.fft.irfft(power, size)[: len(part)]
    below = np.flatnonzero(together < 0.1 * together[0])
    return step * max(int(below[0]) if below.size else len(part), 1)


def cluster_peaks(time: Array, values: Array, level: float, apart: float) -> tuple[Array, Array]:
    """Return time and size of the largest value of each cluster above a level.

    Exceedances less than `apart` seconds after one another are one cluster.
    """
    rows = np.flatnonzero(values > level)
    if not rows.size:
        return np.empty(0), np.empty(0)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(time[rows]) > apart) + 1))
    return time[rows[starts]], np.maximum.reduceat(values[rows], starts)


def fit_tail(time: Array, values: Array, hours: float, apart: float) -> Tail | None:
    """Return the tail of one residual, or None where there are fewer than 30 clusters.

    Parameters
    ----------
    time, values : (N,) s and the residual, positive in the direction looked at; all runs one after
        another, further apart than `apart`.
    hours : how long that is.
    apart : s, the declustering time.

    The level is as high as leaves some 100 clusters, but no lower than the 90 % quantile.
    """
    sure = np.isfinite(values)
    time, values = time[sure], values[sure]
    starts, sizes = _best_level(time, values, apart)
    if len(sizes) < LEAST_CLUSTERS:
        return None
    level = float(np.sort(sizes)[0])
    peaks = sizes - np.nextafter(level, -np.inf)
    shape, scale = _likeliest(peaks)
    counts = np.histogram(starts, bins=np.quantile(time, np.linspace(0.0, 1.0, 21)))[0]
    return Tail(
        level,
        peaks,
        hours,
        shape,
        scale,
        max(float(counts.var(ddof=1) / max(counts.mean(), 1e-300)), 1.0),
    )


def _likeliest(peaks: Array) -> tuple[float, float]:
    """ξ and σ of the largest likelihood; the grid moves until it stands around the best σ.

    It starts at the median's σ of an exponential law: one wild value moves the mean, not that.
    """
    centre, found = float(np.median(peaks)) / np.log(2.0), (0.0, 0.0)
    for _ in range(ROUNDS):
        shape, scale, likelihood = _likelihoods(peaks, centre)
        best = np.unravel_index(int(np.argmax(likelihood)), likelihood.shape)
        found, centre = (float(shape[best]), float(scale[best])), float(scale[best])
        if best[1] == SPREADS // 2:
            break
    return found


def _best_level(time: Array, values: Array, apart: float) -> tuple[Array, Array]:
    """Clusters over the highest level that leaves enough of them."""
    found = (np.empty(0), np.empty(0))
    if not values.size:
        return found
    for share in np.geomspace(1e-5, 0.1, 33):
        tried = cluster_peaks(time, values, float(np.quantile(values, 1.0 - share)), apart)
        if len(tried[1]) > len(found[1]):
            found = tried
        if len(found[1]) >= MOST_CLUSTERS:
            break
    return found


def _likelihoods(peaks: Array, centre: float) -> tuple[Array, Array, Array]:
    """Log likelihoods of the peaks on a grid of ξ and σ, all (57, 61)."""
    shape, scale = np.meshgrid(SHAPES, centre * np.geomspace(0.4, 2.5, SPREADS), indexing="ij")
    total = np.zeros_like(shape)
    inverse = np.where(np.abs(shape) < 1e-9, 0.0, 1.0 / np.where(np.abs(shape) < 1e-9, 1.0, shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        for peak in np.array_split(peaks, max(1, len(peaks) // 25)):
            ratio = peak / scale[..., None]
            logs = np.log1p(np.maximum(shape[..., None] * ratio, -1.0))
            each = (1.0 + inverse[..., None]) * logs
            total -= np.where(np.abs(shape) < 1e-9, ratio.sum(-1), each.sum(-1))
    total -= len(peaks) * np.log(scale)
    return shape, scale, np.where(np.isfinite(total), total, -np.inf)


def _excess(share: Array | float, shape: Array, scale: Array) -> Array:
    """How far above the level only this share of the clusters' peaks is; 0 from 1 on."""
    return np.asarray(stats.genpareto.isf(np.minimum(share, 1.0), shape, scale=scale))
