"""A detector's calibration: residuals, and from them thresholds, false alarms and delays.

Residuals are given, or estimated from logs; those of rows in which a joint stands still are found
for themselves.

A torque F that sets in at once reaches the observer's output as F (1 − e^(−K t)), so with the
threshold Υ

    detected after  t = −ln(1 − Υ / F) / K          for F > Υ, never otherwise
    detected at all F ≥ Υ / (1 − e^(−K d))          for a contact that lasts d

to which the detector adds up to one period. Noise σ of the residual moves the threshold that has to
be passed for a detection with probability P to Υ + z(P) σ, z the normal quantile.
Source: zhang_disturbance_elimination (19), (22).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from flexspline import _core
from flexspline.errors import InputError, above_zero, number, shortened
from flexspline.estimation import estimate
from flexspline.estimators import Differentiator
from flexspline.estimators.external_torque import MOST_BANDS, Collision
from flexspline.logs.log import Log, unmasked
from flexspline.logs.segments import runs, true_ranges
from flexspline.model import Model
from flexspline.schema import plain_json

if TYPE_CHECKING:
    import pandas

__all__ = [
    "DetectorCalibration",
    "Residual",
    "Threshold",
    "detection_delay",
    "proven_rate",
    "residuals_of",
    "shared_channels",
    "smallest_detectable_torque",
    "speed_bands",
    "standstill_residual",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Residual:
    """External torques, or currents without their trend, of one run.

    Parameters
    ----------
    time : (N,) s, increasing.
    values : (N, n), in `unit`, outward positive; NaN where nothing is known; (N,) for one joint.
    velocity : (N, n) rad/s at the outputs, NaN where it is not known (no band, no detection);
        None: at rest.
    name : of the run.
    unit : of the values, "Nm" or "A".
    channels : that the log had which they were estimated from, without those that the chain makes
        itself; None where they are of no log.

    Raises
    ------
    InputError
        Where shapes do not agree, time does not increase or a value is infinite.
    """

    time: Array
    values: Array
    velocity: Array | None = None
    name: str = "run"
    unit: str = "Nm"
    channels: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        time = np.ascontiguousarray(self.time, dtype=float)
        values = _columns(self.values)
        velocity = np.zeros_like(values) if self.velocity is None else _columns(self.velocity)
        if time.ndim != 1 or values.shape[:1] != time.shape or velocity.shape != values.shape:
            raise InputError(
                f"residual '{self.name}': time {time.shape}, values {values.shape} and velocity "
                f"{velocity.shape} do not agree; give (N,), (N, n) and (N, n)"
            )
        if not (np.diff(time) > 0.0).all():
            raise InputError(f"residual '{self.name}': time does not increase; repair the log")
        if np.isinf(values).any():
            row = int(np.argwhere(np.isinf(values))[0, 0])
            raise InputError(
                f"residual '{self.name}': infinite at row {row}; give NaN where nothing is known"
            )
        for name, array in (("time", time), ("values", values), ("velocity", velocity)):
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def speed(self) -> Array:
        """|q̇|, (N, n) rad/s; zero where no velocity was given."""
        return np.abs(self.velocity) if self.velocity is not None else np.zeros_like(self.values)


def standstill_residual(
    time: ArrayLike,
    signal: ArrayLike,
    velocity: ArrayLike,
    *,
    fast: float = 40.0,
    slow: float = 2.0,
    still_speed: float = 0.02,
    settle: float = 0.5,
    name: str = "run",
    unit: str = "A",
) -> Residual:
    """Return what leaves a slow trend all at once while a joint is held at rest.

        residual = low pass (fast) of the signal − low pass (slow) of the signal

    Both are the core's observer without momentum, started at the signal's first value. At rest,
    gravity and friction that sticks are unknown and drift slowly, so the current itself has no
    zero; its changes do. A push that lasts much longer than 1/slow fades: this finds beginnings.

    Parameters
    ----------
    time : (N,) s, increasing.
    signal, velocity : (N, n) currents or torques, and rad/s at the outputs.
    fast, slow : 1/s, corners of the two low passes.
    still_speed : rad/s; a joint that is faster does not stand still: NaN.
    settle : s, at the start of each stretch at rest: NaN, for the trend is not known yet.

    Raises
    ------
    InputError
        Where shapes do not agree, or the corners are not 0 < slow < fast.
    """
    if not 0.0 < slow < fast:
        raise InputError(
            f"standstill_residual: slow = {slow:g} and fast = {fast:g} 1/s; give 0 < slow < fast"
        )
    made = Residual(np.asarray(time), np.asarray(signal), np.asarray(velocity), name, unit)
    left = np.full_like(made.values, np.nan)
    for joint in range(left.shape[1]):
        still = made.speed[:, joint] < still_speed
        for first, last in _stretches(made.time, still):
            rows = slice(int(first), int(last))
            part = _without_trend(made.time[rows], made.values[rows, joint], fast, slow)
            part[made.time[rows] < made.time[first] + settle] = np.nan
            left[rows, joint] = part
    return Residual(made.time, left, made.velocity, name, unit)


def _stretches(time: Array, mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Ranges of rows without a gap in time where the mask is true."""
    inside = mask.copy()
    found = [true_ranges(inside[a:b]) + a for a, b in runs(time)]
    return np.concatenate(found) if found else np.zeros((0, 2), dtype=np.intp)


def _without_trend(time: Array, signal: Array, fast: float, slow: float) -> Array:
    level = np.ascontiguousarray(signal - signal[0])
    rest = np.zeros_like(level)
    quick, trend = (
        _core.observe_momentum(time, rest, level, gain=gain, exact=True) for gain in (fast, slow)
    )
    return np.asarray(quick - trend)


def _columns(values: ArrayLike) -> Array:
    array = np.asarray(unmasked(values), dtype=float)
    return array[:, None] if array.ndim == 1 else array


def residuals_of(
    logs: Residual | Log | Sequence[Residual | Log], model: Model | None, source: str
) -> list[Residual]:
    given: list[Any] = list(logs) if isinstance(logs, (list, tuple)) else [logs]
    for each in given:
        if not isinstance(each, (Residual, Log)):
            raise InputError(
                f"detector: a {type(each).__name__} is no contact-free run; give Residual, or logs "
                "with their model"
            )
    if not given:
        raise InputError("detector: no contact-free logs; give at least one")
    made: list[Residual] = [
        _estimated(log, model, source) if isinstance(log, Log) else log for log in given
    ]
    for each in made:
        if len(each) < 2 or not np.isfinite(each.values).any():
            raise InputError(
                f"detector: log '{each.name}' holds {len(each)} rows and no finite residual over "
                "any time; leave it out or check it"
            )
        if each.values.shape[1] != made[0].values.shape[1] or each.unit != made[0].unit:
            raise InputError(
                f"detector: log '{each.name}' has other joints or another unit than "
                f"'{made[0].name}'; give logs of one arm"
            )
    return made


def _estimated(log: Log, model: Model | None, source: str) -> Residual:
    if model is None:
        raise InputError(f"detector: log '{log.name}' needs model=, whose estimate is watched")
    found = estimate(model, log)[f"external_torque_{source}"]
    velocity = log.columns.get("output_velocity")
    made = model.estimators.get("differentiator")
    own = made.channels if isinstance(made, Differentiator) else ()
    recorded = tuple(name for name in log.channels if name not in own)
    return Residual(log["time"], found, velocity, log.name, channels=recorded)


def shared_channels(residuals: Sequence[Residual]) -> tuple[str, ...] | None:
    """Return the channels that every residual's log had; None where one is of no log."""
    known = [each.channels for each in residuals if each.channels is not None]
    if len(known) < len(residuals):
        return None
    return tuple(name for name in known[0] if all(name in channels for channels in known))


def speed_bands(speed_edges: ArrayLike) -> tuple[float, ...]:
    edges = np.asarray(speed_edges, dtype=float).ravel()
    if not (np.diff(edges, prepend=0.0) > 0.0).all() or len(edges) >= MOST_BANDS:
        raise InputError(
            f"detector: speed_edges = {edges.tolist()}; give at most {MOST_BANDS - 1} speeds above "
            "zero, increasing"
        )
    return tuple(edges.tolist())


def proven_rate(hours: float, alarms: int = 0, confidence: float = 0.95) -> float:
    """Return the rate [1/h] above which so few alarms in so many hours are too unlikely.

    The upper limit of a Poisson law: half of χ² with 2 (k + 1) degrees of freedom over T. Without
    an alarm it is −ln(1 − confidence) / T ≈ 3/T.
    """
    return float(special.chdtri(2 * (alarms + 1), 1.0 - confidence)) / 2.0 / hours


@dataclass(frozen=True)
class Threshold:
    """One threshold of one joint.

    Parameters
    ----------
    joint : 1 to n.
    direction : +1 for outward torque, −1 for inward.
    band : of speed, from 0.
    value : what the detector uses, unit of the residual, above zero.
    likely : the most likely threshold for the stated rate; NaN without a fit.
    rate : most likely rate of false alarms at `value`, 1/h; NaN without a fit.
    rate_interval : (low, high) of that rate; NaN without a fit.
    largest : largest value in the contact-free logs.
    paper : the paper's rule: largest value times 0.03/0.0255.
    clusters : separate exceedances that the fit rests on; 0 without a fit.
    shape : ξ of the generalised Pareto law; NaN without a fit.
    hours : in which this band was watched.
    """

    joint: int
    direction: int
    band: int
    value: float
    likely: float
    rate: float
    rate_interval: tuple[float, float]
    largest: float
    paper: float
    clusters: int
    shape: float
    hours: float


@dataclass(frozen=True)
class DetectorCalibration:
    """Thresholds of a whole detector from contact-free logs.

    Parameters
    ----------
    thresholds : by joint, direction and band.
    stated_rate : false alarms per hour of the whole detector; None for the rule of the largest
        value, which states none.
    confidence : of intervals and of the stated rate.
    hours : of all contact-free logs.
    apart : s, exceedances closer than this are one event.
    speed_edges : rad/s.
    release, hold : hysteresis and hold time [s] of the detector.
    unit : of the residual.
    runs : names of the logs.
    warnings : sentences on what the thresholds rest on.
    alarms : that this detector gives on these logs, of all joints.
    input : which estimate the residuals are, as in `Collision`; None where that was not said.
    channels : that all logs had; None for residuals that were given. Where a log lacks a velocity
        among them, the thresholds do not hold, and `estimate` doubts it.
    """

    thresholds: tuple[Threshold, ...]
    stated_rate: float | None
    confidence: float
    hours: float
    apart: float
    speed_edges: tuple[float, ...]
    release: float
    hold: float
    unit: str
    runs: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    alarms: int = 0
    input: str | None = None
    channels: tuple[str, ...] | None = None

    @property
    def joints(self) -> int:
        """How many joints are watched."""
        return max(each.joint for each in self.thresholds)

    @property
    def proven_rate(self) -> float:
        """False alarms per hour that the logs exclude by 95 %, with the alarms that they have.

        3/T without one. The thresholds come from the same logs; `alarms_on` counts in others.
        """
        return proven_rate(self.hours, self.alarms)

    def values(self, joint: int, direction: int) -> tuple[float, ...]:
        """Return the thresholds of one joint (1 to n) and direction, one for each band."""
        found = (t for t in self.thresholds if (t.joint, t.direction) == (joint, direction))
        return tuple(each.value for each in sorted(found, key=lambda t: t.band))

    def collision(self, joint: int = 1, *, input: str | None = None) -> Collision:
        """Return the estimator of one joint for `Model.with_estimator`.

        Parameters
        ----------
        joint : 1 to n.
        input : which estimate the residuals were, where they were given without that being said:
            "observer" (by default), "sensor", "merged" or "compliant_observer". Elsewhere the
            calibration knows it.

        Raises
        ------
        InputError
            Where there is no such joint, the residuals were no torques, or they were of another
            estimate than `input`.
        """
        self._require(joint)
        if self.unit != "Nm":
            raise InputError(
                f"the detector was calibrated on residuals in {self.unit}, the estimator collision "
                "reads Nm; calibrate on torques or use detect"
            )
        if input is not None and self.input not in (None, input):
            raise InputError(
                f"detector: its thresholds are of the {self.input} estimate and input is "
                f"{input!r}; leave input out, or calibrate with input={input!r}"
            )
        record = {
            "stated_rate_per_hour": self.stated_rate,
            "confidence": self.confidence,
            "hours": self.hours,
            "alarms": self.alarms,
            "proven_rate_per_hour": self.proven_rate,
            "runs": list(self.runs),
            **({} if self.channels is None else {"channels": list(self.channels)}),
            "thresholds": plain_json([asdict(t) for t in self.thresholds if t.joint == joint]),
        }
        return Collision(
            input=input or self.input or "observer",
            speed_edges=self.speed_edges,
            negative=self.values(joint, -1),
            positive=self.values(joint, 1),
            release=self.release,
            hold=self.hold,
            record=record,
        )

    def detect(self, residual: Residual) -> NDArray[np.bool_]:
        """Return where each joint is in contact, (N, n); a gap begins anew.

        Raises
        ------
        InputError
            Where the residual has other joints or another unit.
        """
        if residual.values.shape[1] != self.joints or residual.unit != self.unit:
            raise InputError(
                f"residual '{residual.name}': {residual.values.shape[1]} joints in "
                f"{residual.unit}, the detector watches {self.joints} in {self.unit}"
            )
        contact = np.zeros(residual.values.shape, dtype=bool)
        for joint in range(self.joints):
            known = np.flatnonzero(
                np.isfinite(residual.values[:, joint]) & np.isfinite(residual.speed[:, joint])
            )
            for first, last in runs(residual.time[known], self.apart + self.hold):
                rows = known[first:last]
                contact[rows, joint] = self._run(residual, joint, rows)
        return contact

    def alarms_on(self, residuals: Sequence[Residual]) -> int:
        """Return how often any joint comes into contact in these residuals."""
        began = 0
        for each in residuals:
            contact = self.detect(each)
            began += int(np.count_nonzero(np.diff(contact, axis=0, prepend=False) & contact))
        return began

    def _run(self, residual: Residual, joint: int, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        found = _core.detect_collision(
            residual.time[rows],
            np.ascontiguousarray(residual.values[rows, joint]),
            np.ascontiguousarray(residual.speed[rows, joint]),
            speed_edges=list(self.speed_edges),
            negative=list(self.values(joint + 1, -1)),
            positive=list(self.values(joint + 1, 1)),
            release=self.release,
            hold=self.hold,
        )
        return np.asarray(found, dtype=bool)

    def to_frame(self) -> pandas.DataFrame:
        """Return the thresholds as a table."""
        import pandas

        return pandas.DataFrame([asdict(each) for each in self.thresholds])

    def __str__(self) -> str:
        return "\n".join([*self._head(), *self._table(), *(f"- {w}" for w in self.warnings)])

    def _head(self) -> list[str]:
        seconds = self.hours * 3600.0
        watched = f"{len(self.runs)} contact-free logs, {seconds:.4g} s"
        had, law = "without an alarm", "3/T"
        if self.alarms:
            had = f"with {self.alarms} alarm{'s' * (self.alarms > 1)} of this detector"
            law = f"Poisson's upper limit for {self.alarms} in T"
        proven = (
            f"  {seconds:.4g} s {had} prove no more than {self.proven_rate:.3g} false "
            f"alarms per hour ({law}, 95 %)"
        )
        if self.stated_rate is None:
            return [f"Thresholds by the largest value times a margin, {watched}", proven]
        return [
            f"Thresholds for {self.stated_rate:.3g} false alarms per hour, {watched}",
            f"  stated with {self.confidence:.0%} confidence by an extreme-value fit",
            proven,
        ]

    def _table(self) -> list[str]:
        lines = [
            "  joint  band  direction  threshold  likely  largest  largest·1.18  "
            "rate 1/h (interval)"
        ]
        for t in self.thresholds:
            low, high = t.rate_interval
            rate = "-" if math.isnan(t.rate) else f"{t.rate:.2g} ({low:.2g} to {high:.2g})"
            likely = "-" if math.isnan(t.likely) else f"{t.likely:.4g}"
            lines.append(
                f"  {t.joint:>5}  {t.band:>4}  {'outward' if t.direction > 0 else 'inward':>9}  "
                f"{t.value:>9.4g}  {likely:>6}  {t.largest:>7.4g}  {t.paper:>12.4g}  {rate}"
            )
        return [*lines, f"  all thresholds in {self.unit}; joint 1 is the first column"]

    def _require(self, joint: int) -> None:
        if joint not in range(1, self.joints + 1):
            raise InputError(f"detector: no joint {joint!r}; it watches joints 1 to {self.joints}")


def detection_delay(
    torque: ArrayLike,
    threshold: float,
    gain: float,
    *,
    noise: float = 0.0,
    probability: float = 0.5,
) -> Array:
    """Return the time from the beginning of a contact to its detection [s]; infinite if never.

    Parameters
    ----------
    torque : Nm, size of the contact, any shape.
    threshold : Nm.
    gain : K of the observer, 1/s.
    noise : Nm, standard deviation of the residual.
    probability : that the contact is found by then.

    Raises
    ------
    InputError
        Where threshold or gain are not above zero, or the probability is not within 0 and 1.
    """
    needed = _needed(threshold, gain, noise, probability)
    sizes = _numbers(torque, "torque", "Nm")
    with np.errstate(divide="ignore"):
        share = np.minimum(needed / np.abs(sizes), 1.0)
        return np.asarray(-np.log1p(-share) / gain)


def smallest_detectable_torque(
    duration: ArrayLike,
    threshold: float,
    gain: float,
    *,
    noise: float = 0.0,
    probability: float = 0.5,
) -> Array:
    """Return the smallest torque that is found if it lasts `duration` seconds [Nm].

    Parameters
    ----------
    duration : s, any shape.
    threshold, gain, noise, probability : as for `detection_delay`.

    Raises
    ------
    InputError
        As `detection_delay`, or where a duration is not above zero.
    """
    needed = _needed(threshold, gain, noise, probability)
    lasting = _numbers(duration, "duration", "s")
    if not (lasting > 0.0).all():
        raise InputError(
            f"detection: duration = {float(lasting.min()):g} s is not allowed; give one above zero"
        )
    return np.asarray(needed / -np.expm1(-gain * lasting))


def _numbers(values: ArrayLike, name: str, unit: str) -> Array:
    """Numbers of any shape; NaN is one that is not known."""
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(
            f"detection: {name} = {shortened(repr(values))} holds something that is no number; "
            f"give numbers in {unit}"
        ) from None


def _needed(threshold: float, gain: float, noise: float, probability: float) -> float:
    above_zero(threshold, "detection: threshold", "Nm")
    above_zero(gain, "detection: gain", "1/s")
    number(noise, "detection: noise", "Nm")
    number(probability, "detection: probability")
    if not (noise >= 0.0 and 0.0 < probability < 1.0):
        raise InputError(
            f"detection: noise = {noise:g}, probability = {probability:g}; give noise of zero or "
            "more and a probability between 0 and 1"
        )
    return max(threshold + float(special.ndtri(probability)) * noise, 0.0)
