"""When a residual is a contact: thresholds for a stated rate of false alarms, delays, sizes.

For a stated rate: each joint, direction and band of speed gets an equal share of the rate, and of
the thresholds that its tail makes plausible the highest (below), so that with the stated
confidence its rate is no more than its share. The paper's rule, the largest value times a margin
(0.0255 → 0.03 Nm: 1.18), stands beside it: it states no rate, and grows with the log's length. Υ
of (22) is a vector: a threshold for each joint, and here for each direction and band of speed.
Source: zhang_disturbance_elimination (22), §4.4. Where logs are too short for a tail, the
threshold is the largest value of free motion times a margin.

The rate at which a residual without contact exceeds a threshold that it never reached is
extrapolated. Peaks over a level u, one for each cluster (exceedances closer than the declustering
time are one event), follow a generalised Pareto law; their number, a Poisson law:

    rate(x) = ζ (1 + ξ (x − u) / σ)^(−1/ξ)        1/h

A confidence interval of a threshold or a rate is its range over all (ξ, σ, ζ) whose likelihood is
not too far below the best: deviance below the χ² quantile with two degrees of freedom, the joint
region of ξ and σ. That is wider than the profile likelihood's one degree, for a finite level leaves
a bias that the likelihood does not contain. The tail of Gaussian noise looks shorter at any level
than it is (ξ < 0, and 0 in the limit), so what is plausible with ξ ≥ 0 alone counts as plausible
too. The clusters' counts vary more than Poisson's where the residual's spread changes; ζ's share of
the deviance is divided by their dispersion. Sources: [Coles2001], An Introduction to
Statistical Modeling of Extreme Values, ch. 4, 5; [FerroSegers2003] on declustering.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from flexspline.collision.result import (
    DetectorCalibration,
    Residual,
    Threshold,
    detection_delay,
    residuals_of,
    shared_channels,
    smallest_detectable_torque,
    speed_bands,
    standstill_residual,
)
from flexspline.errors import InputError, above_zero
from flexspline.estimators.checks import choice
from flexspline.estimators.external_torque import WATCHED
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step
from flexspline.model import Model

__all__ = [
    "DetectorCalibration",
    "Residual",
    "Threshold",
    "calibrate_detector",
    "detection_delay",
    "left_out_margin",
    "smallest_detectable_torque",
    "standstill_residual",
]


Array = NDArray[np.float64]

CORRELATION_TIMES = 5.0
WILD = 0.5
"""ξ from which on a generalised Pareto law has no variance: single events stand out."""
FAR = 100.0
"""An extrapolation by more than this factor of the proven rate is warned of."""

PAPER_MARGIN = 0.03 / 0.0255
"""zhang_disturbance_elimination §4.4: 0.0255 Nm in free motion, 0.03 Nm as the threshold."""

LEAST_CLUSTERS = 30
MOST_CLUSTERS = 100
SHAPES = np.linspace(-0.5, 0.9, 57)
"""ξ: below zero a tail that ends, 0 exponential, 0.5 infinite variance."""
SPREADS = 61
ROUNDS = 20


def __dir__() -> list[str]:
    return __all__


def calibrate_detector(
    logs: Residual | Log | Sequence[Residual | Log],
    *,
    false_alarms_per_hour: float | None,
    model: Model | None = None,
    input: str | None = None,
    speed_edges: ArrayLike = (),
    confidence: float = 0.9,
    apart: float | None = None,
    release: float = 0.8,
    hold: float | None = None,
    margin: float = PAPER_MARGIN,
    symmetric: bool = False,
) -> DetectorCalibration:
    """Return thresholds for every joint, direction and band of speed.

    Parameters
    ----------
    logs : without any contact: `Residual` (n joints), or logs of one joint with its `model`, whose
        estimate is then the residual.
    false_alarms_per_hour : of the whole detector, all joints, directions and bands together. None:
        the paper's rule, largest value times 1.18, which states no rate.
    model, input : for logs: the model, and which of its estimates: "observer" (by default),
        "sensor", "merged" or "compliant_observer". `collision` of the result watches the same one;
        of residuals that are given, `input` says which they are.
    speed_edges : rad/s, increasing, between the bands of |q̇|.
    confidence : two-sided, of the intervals; the upper end is what the thresholds rest on.
    apart : s; exceedances closer than this are one event; default: five times the lag at which
        the residual's autocorrelation falls below 0.1.
    release, hold : share of the threshold at which a contact may end, and for how long [s] the
        residual must be below it; `hold` is by default `apart`.
    margin : on the largest value, where no rate is stated; `left_out_margin` finds one.
    symmetric : one threshold for both directions, the higher one: steadier where data is scarce.

    Raises
    ------
    InputError
        Where there is no contact-free data, too little of it for the stated rate (fewer than 30
        separate exceedances in some band), or an option is impossible.
    """
    source = "observer" if input is None else input
    choice(source, "detector: input", WATCHED)
    given: list[Any] = list(logs) if isinstance(logs, (list, tuple)) else [logs]
    watched = residuals_of(given, model, source)
    edges = speed_bands(speed_edges)
    _require_options(false_alarms_per_hour, confidence, margin, release, hold)
    gap = above_zero(_apart(watched) if apart is None else apart, "detector: apart", "s")
    seen = _Seen(watched, edges, gap)
    share = None
    if false_alarms_per_hour is not None:
        share = false_alarms_per_hour / (2 * seen.joints)
    thresholds = tuple(seen.threshold(cell, share, confidence, margin) for cell in seen.cells())
    if symmetric:
        thresholds = tuple(_higher(each, thresholds) for each in thresholds)
    made = DetectorCalibration(
        thresholds,
        false_alarms_per_hour,
        confidence,
        seen.hours,
        gap,
        edges,
        release,
        gap if hold is None else hold,
        watched[0].unit,
        tuple(each.name for each in watched),
        input=input if all(isinstance(each, Residual) for each in given) else source,
        channels=shared_channels(watched),
    )
    made = replace(made, alarms=made.alarms_on(watched))
    return replace(made, warnings=tuple(_warnings(made)))


@dataclass(frozen=True)
class _Seen:
    """All residuals one after another."""

    runs: Sequence[Residual]
    edges: tuple[float, ...]
    apart: float

    @property
    def joints(self) -> int:
        return int(self.runs[0].values.shape[1])

    @property
    def hours(self) -> float:
        """In which any joint was watched."""
        return (
            sum(
                np.count_nonzero(np.isfinite(run.values).any(axis=1)) * median_step(run.time)
                for run in self.runs
            )
            / 3600.0
        )

    def cells(self) -> Iterator[tuple[int, int, int]]:
        for joint in range(self.joints):
            for direction in (-1, 1):
                for band in range(len(self.edges) + 1):
                    yield joint, direction, band

    def threshold(
        self,
        cell: tuple[int, int, int],
        share: float | None,
        confidence: float,
        margin: float,
    ) -> Threshold:
        joint, direction, band = cell
        time, values, hours = self._of(joint, direction, band)
        if not hours:
            raise InputError(
                f"detector: no contact-free data for joint {joint + 1} in band {band} of speed; "
                "record some there or choose other speed_edges"
            )
        largest = float(np.nanmax(values))
        made = partial(
            Threshold,
            joint=joint + 1,
            direction=direction,
            band=band,
            largest=largest,
            paper=PAPER_MARGIN * largest,
            hours=hours,
        )
        where = f"joint {joint + 1}, band {band} of speed, {'out' if direction > 0 else 'in'}ward"
        if share is None:
            return made(**_by_margin(margin * largest, where, hours))
        tail = fit_tail(time, values, hours, self.apart)
        return made(**_by_tail(tail, share, confidence, where, hours))

    def _of(self, joint: int, direction: int, band: int) -> tuple[Array, Array, float]:
        """Time, residual (NaN outside the band) and hours inside it, of all runs."""
        times, values, begins, seconds = [], [], 0.0, 0.0
        for run in self.runs:
            inside = np.searchsorted(self.edges, run.speed[:, joint], side="right") == band
            inside &= np.isfinite(run.values[:, joint]) & np.isfinite(run.speed[:, joint])
            times.append(run.time - run.time[0] + begins)
            values.append(np.where(inside, direction * run.values[:, joint], np.nan))
            begins = float(times[-1][-1]) + 2.0 * self.apart
            seconds += np.count_nonzero(inside) * median_step(run.time)
        return np.concatenate(times), np.concatenate(values), seconds / 3600.0


def _by_margin(value: float, where: str, hours: float) -> dict[str, Any]:
    """What a threshold is by the rule of the largest value."""
    if value <= 0.0:
        raise InputError(
            f"detector: {where}: the residual never has this sign in {hours * 3600:.3g} s; "
            "record more contact-free data"
        )
    nothing = float("nan")
    return {
        "value": value,
        "likely": nothing,
        "rate": nothing,
        "rate_interval": (nothing, nothing),
        "clusters": 0,
        "shape": nothing,
    }


def _by_tail(
    tail: Tail | None, share: float, confidence: float, where: str, hours: float
) -> dict[str, Any]:
    """What a threshold is by its tail, for this share of the stated rate."""
    if tail is None:
        raise InputError(
            f"detector: {where}: {hours * 3600:.3g} s of contact-free data hold fewer than "
            f"{LEAST_CLUSTERS} separate exceedances, too few to state a rate; record more, or "
            "give false_alarms_per_hour=None for the largest value with a margin"
        )
    if share > tail.clusters_per_hour:
        raise InputError(
            f"detector: {where}: {share:.3g} false alarms per hour are more than the "
            f"{tail.clusters_per_hour:.3g} separate exceedances that the fit rests on; state "
            "a lower rate"
        )
    value = tail.threshold_interval(share, confidence)[1]
    if value <= 0.0:
        raise InputError(
            f"detector: {where}: the residual keeps to the other sign without a contact, at this "
            "rate the threshold would be on the wrong side of zero; take the residual's offset off"
        )
    return {
        "value": value,
        "likely": tail.threshold(share),
        "rate": tail.rate(value),
        "rate_interval": tail.rate_interval(value, confidence),
        "clusters": len(tail.peaks),
        "shape": tail.shape,
    }


def _require_options(
    rate: float | None, confidence: float, margin: float, release: float, hold: float | None
) -> None:
    if rate is not None:
        above_zero(rate, "detector: false_alarms_per_hour", "1/h")
    if not 0.5 <= confidence < 1.0:
        raise InputError(f"detector: confidence = {confidence:g}; give 0.5 to below 1")
    if above_zero(margin, "detector: margin") < 1.0:
        raise InputError(
            f"detector: margin = {margin:g} puts the threshold below the largest contact-free "
            "value; give 1 or more"
        )
    if above_zero(release, "detector: release") > 1.0:
        raise InputError(
            f"detector: release = {release:g} is above the threshold; give a share of at most 1"
        )
    if hold is not None:
        above_zero(hold, "detector: hold", "s", or_zero=True)


def _higher(each: Threshold, all_of_them: Sequence[Threshold]) -> Threshold:
    """The threshold or that of the other direction, whichever is higher."""
    pair = [t for t in all_of_them if (t.joint, t.band) == (each.joint, each.band)]
    top = max(pair, key=lambda t: t.value)
    return replace(top, direction=each.direction)


def _apart(runs: Sequence[Residual]) -> float:
    """Five times the longest correlation time of any joint in the longest run."""
    longest = max(runs, key=len)
    step = median_step(longest.time)
    return CORRELATION_TIMES * max(
        correlation_time(longest.values[:, joint], step) for joint in range(runs[0].values.shape[1])
    )


def _warnings(made: DetectorCalibration) -> Iterator[str]:
    thresholds, stated = made.thresholds, made.stated_rate
    if stated is None:
        yield "the largest value states no rate of false alarms: a longer log has a larger one"
        return
    wild = [t for t in thresholds if t.shape > WILD]
    if wild:
        worst = max(wild, key=lambda t: t.largest)
        yield (
            f"single events stand out of the tails of {len(wild)} thresholds (ξ > {WILD:g}), most "
            f"in joint {worst.joint}, up to {worst.largest:.3g}: look there for a contact, a fault"
        )
    far = made.proven_rate / stated
    if far > FAR:
        yield (
            f"the stated rate is {far:.3g} times below what the logs prove: it rests on the shape "
            "of the tail alone; record more"
        )
    spread = [t for t in thresholds if t.value > 2.0 * t.likely]
    if spread:
        worst = max(spread, key=lambda t: t.value / t.likely)
        yield (
            f"{len(spread)} thresholds are more than twice the likely ones, most in joint "
            f"{worst.joint}: longer logs would make the detector more sensitive"
        )


def left_out_margin(runs: Sequence[Residual], *, symmetric: bool = False) -> float:
    """Return the margin on the largest value of all other runs that no run left out exceeds.

    What the paper's 1.18 would have to be for these logs: with little data, far more. At least
    1.18. One number for all joints and directions, speed bands aside.

    Parameters
    ----------
    runs : contact-free, two or more, of the same joints.
    symmetric : whether both directions have one threshold.

    Raises
    ------
    InputError
        Where there are fewer than two runs, or a joint's residual is zero throughout.
    """
    watched = residuals_of(runs, None, "observer")
    if len(watched) < 2:
        raise InputError("detector: to leave one run out takes two or more; give more runs")
    both = np.array([[np.nanmax(each.values, 0), np.nanmax(-each.values, 0)] for each in watched])
    if symmetric:
        both = both.max(axis=1, keepdims=True)
    ratios = [both[k] / np.delete(both, k, axis=0).max(axis=0) for k in range(len(watched))]
    worst = float(np.max(ratios))
    if not np.isfinite(worst):
        raise InputError("detector: a joint's residual is zero throughout; check its channel")
    return max(worst, PAPER_MARGIN)


@dataclass(frozen=True, eq=False)
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
