"""Thresholds of a collision detector from logs without a contact.

For a stated rate: each joint, direction and band of speed gets an equal share of the rate, and of
the thresholds that its tail makes plausible the highest (`extremes`), so that with the stated
confidence its rate is no more than its share. The paper's rule, the largest value times a margin
(0.0255 → 0.03 Nm: 1.18), stands beside it: it states no rate, and grows with the log's length. Υ
of (22) is a vector: a threshold for each joint, and here for each direction and band of speed.
Source: zhang_disturbance_elimination (22), §4.4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.collision.contact_free import residuals_of, speed_bands
from flexspline.collision.extremes import LEAST_CLUSTERS, Tail, correlation_time, fit_tail
from flexspline.collision.margin import PAPER_MARGIN
from flexspline.collision.residual import Residual
from flexspline.collision.result import DetectorCalibration, Threshold
from flexspline.errors import InputError
from flexspline.estimators.checks import above_zero, choice
from flexspline.estimators.collision import INPUTS
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step
from flexspline.model import Model

__all__ = ["calibrate_detector"]

Array = NDArray[np.float64]

CORRELATION_TIMES = 5.0
WILD = 0.5
"""ξ from which on a generalised Pareto law has no variance: single events stand out."""
FAR = 100.0
"""An extrapolation by more than this factor of the proven rate is warned of."""


def calibrate_detector(
    logs: Residual | Log | Sequence[Residual | Log],
    *,
    false_alarms_per_hour: float | None,
    model: Model | None = None,
    input: str = "observer",
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
    model, input : for logs: the model, and which of its estimates: "observer", "sensor", "merged".
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
    watched = residuals_of(logs, model, input)
    edges = speed_bands(speed_edges)
    choice(input, "detector: input", INPUTS)
    _require_options(false_alarms_per_hour, confidence, margin, release, hold)
    gap = above_zero(_apart(watched) if apart is None else apart, "detector: apart", "s")
    seen = _Seen(watched, edges, gap)
    share = None
    if false_alarms_per_hour is not None:
        share = false_alarms_per_hour / (2 * seen.joints)
    thresholds = tuple(seen.threshold(cell, share, confidence, margin) for cell in seen.cells())
    if symmetric:
        thresholds = tuple(_higher(each, thresholds) for each in thresholds)
    return DetectorCalibration(
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
        tuple(_warnings(thresholds, false_alarms_per_hour, seen.hours)),
    )


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


def _warnings(thresholds: Sequence[Threshold], stated: float | None, hours: float) -> Iterator[str]:
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
    far = 3.0 / hours / stated
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
