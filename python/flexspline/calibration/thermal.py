"""What moves a sensor's zero: drift with temperature, and zeros that differ between runs.

Drift with temperature: how much before and after, and whether warming differs from cooling.

zhang_disturbance_elimination §4.2 ignores the difference, because there the temperature only
rose. A body that warms from one side lags its thermistor, so that on the way up the reading is
that of a colder body: the two
legs part. What is left of it after the compensation says whether a thermal lag is worth fitting.

Means over a tenth of the range of temperatures each, of the rows without load where there are any
(up to 2 % of the full scale), else of all rows.

Zeros that differ between runs: how large they are, and whether they moved.

A sensor that is mounted again, or an amplifier that is zeroed again, starts each run with another
voltage at zero torque. With one zero for all runs the difference goes where it can: into the
coefficients of the drift, where temperature differs between the runs, or into what passes for very
slow noise. With a zero of its own for each of R runs

    V = s τ + v₀ + Σ_r a_r x_r + …,     x_r one row of `contrasts` for each run,     R - 1 columns

v₀ is the mean of the zeros (rows of `contrasts` sum to zero), and v₀ + x_r·a that of run r.

Test. The contrasts a are estimated beside the columns of the regression and beside bend and
hysteresis (`structure_columns`): load in one run and none in another would otherwise make a zero of
a bend. Their covariance C is that of least squares under the noise model of what is left, which no
longer holds the differences between runs. With L the combinations of a that the other columns
cannot take over (temperature that stands in each run determines no drift beside the zeros), q of
them, Wald's statistic is compared with F:

    F = (L a)ᵀ (L C Lᵀ)⁻¹ (L a) / q  ~  F(q, ν),     ν of `least_squares.uncertainty`

The same way it is tested whether the gain changes with temperature, where there was load at several
(`gain_test`): a column τ (T − T_m) beside all of these.

And whether the reference is late against the sensor (`delay_test`). Of a reference that is late by
d, r(t) = τ(t − d), the voltage is s r(t + d), to first order s r + s d r′: a column r′ beside all
of these, where structure has taken what hysteresis there is. Its loop opens with the rate of the
load, that of hysteresis does not; of a load that changes at one rate alone only their forms differ,
and a hysteresis that slips at once (a friction) shares a good part of a delay's.

Temperature enters as a moving mean over a fiftieth of its run, and as one number where it stands
(`count_temperatures`): a drift that is estimated from the thermometer's noise comes out too small,
and the rest of it would be a zero that moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from flexspline.calibration.accuracy import Figure, Leg, legs_of, slack_of
from flexspline.calibration.regression import Regression, rows_of
from flexspline.calibration.runs import CalibrationRun, contrasts
from flexspline.calibration.structure import (
    LEVEL,
    largest_of,
    quiet,
    wald_test,
    warmth_under_load,
)
from flexspline.errors import InputError
from flexspline.logs.checks.consistency import TOLD
from flexspline.logs.derive import default_bandwidth, derivative
from flexspline.logs.quantisation import white_noise

__all__ = [
    "DelayTest",
    "RunZero",
    "Thermal",
    "ThermalLeg",
    "ZeroTest",
    "contrast_names",
    "count_temperatures",
    "delay_test",
    "require_own_zeros",
    "run_zeros",
    "thermal_figures",
    "thermal_legs",
    "thermal_means",
    "unloaded",
    "zero_spread",
    "zero_test",
]

Array = NDArray[np.float64]

SAME_TEMPERATURE = 0.5  # K
SAME_IN_NOISE = 6.0  # standard deviations of the thermometer's noise
BINS = 10
LEAST_ROWS = 8
SLACK_SHARE = 0.03  # of the span: a thermostat swings about its set point
LEAST_LEG = 0.3  # of the span
UNLOADED = 0.02  # of the full scale
STILL_LOADED = 0.1  # of all rows: with fewer without load, all are taken

DEFINITIONS = {
    "drift, uncompensated": "largest less least mean reading over temperature",
    "drift, compensated": "the same with the compensation",
    "thermal hysteresis, uncompensated": "heating less cooling at the same temperature",
    "thermal hysteresis, compensated": "the same with the compensation",
}

SMOOTHED = 50  # a mean over this part of a run, of the temperature


@dataclass(frozen=True)
class ThermalLeg:
    """One way of the temperature in one run. `error`: reading less reference, compensated, Nm.

    `bias`: its mean, `rmse`: its root mean square.
    """

    run: str
    heating: bool
    low: float
    high: float
    bias: float
    rmse: float


@dataclass(frozen=True, eq=False)
class Thermal:
    """Means over temperature, (bins,): °C, and Nm before and after the compensation.

    `heating`, `cooling`: (bins, 2), before and after; NaN in bins with too few rows.
    `noise`: standard error of a mean, Nm.
    """

    centre: Array
    both: Array
    heating: Array
    cooling: Array
    noise: float


def count_temperatures(columns: Sequence[Array], noise: float) -> int:
    """How many temperatures there are that lie half a kelvin, and more than the noise, apart."""
    apart = max(SAME_TEMPERATURE, SAME_IN_NOISE * noise)
    ordered = np.sort(np.concatenate(columns))
    count, at = 0, 0
    while at < len(ordered):
        count += 1
        at = int(np.searchsorted(ordered, ordered[at] + apart, side="left"))
    return count


def thermal_legs(columns: Sequence[Array]) -> list[Leg]:
    """Heating (rising) and cooling legs of the temperature in all runs."""
    span = max(float(c.max()) for c in columns) - min(float(c.min()) for c in columns)
    return legs_of(columns, slack_of(columns, SLACK_SHARE), LEAST_LEG * span)


def thermal_means(
    legs: Sequence[Leg],
    temperatures: Sequence[Array],
    torques: Sequence[Array],
    errors: Sequence[Array],
    full_scale: float | None,
) -> Thermal:
    """Average the errors of reading over temperature, over all rows and over the legs.

    Parameters
    ----------
    errors : (N, 2) for each run, Nm: reading less reference, before and after the compensation.
    """
    chosen = unloaded(torques, full_scale)
    low, high = min(float(t.min()) for t in temperatures), max(float(t.max()) for t in temperatures)
    edges = np.linspace(low, high, BINS + 1)
    masks = {True: [m & False for m in chosen], False: [m & False for m in chosen]}
    for leg in legs:
        rows = slice(leg.start, leg.stop)
        masks[leg.rising][leg.run][rows] |= chosen[leg.run][rows]
    return Thermal(
        0.5 * (edges[1:] + edges[:-1]),
        _binned(edges, temperatures, errors, chosen),
        _binned(edges, temperatures, errors, masks[True]),
        _binned(edges, temperatures, errors, masks[False]),
        _noise(legs, edges, temperatures, errors, chosen),
    )


def unloaded(torques: Sequence[Array], full_scale: float | None) -> list[NDArray[np.bool_]]:
    """Rows without load, (N,) for each run; all of them where too few are."""
    if full_scale is None:
        return [np.ones(len(t), dtype=bool) for t in torques]
    free = [np.abs(t) <= UNLOADED * full_scale for t in torques]
    share = sum(int(m.sum()) for m in free) / sum(len(m) for m in free)
    return free if share >= STILL_LOADED else [np.ones(len(t), dtype=bool) for t in torques]


def _binned(
    edges: Array,
    temperatures: Sequence[Array],
    errors: Sequence[Array],
    masks: Sequence[NDArray[np.bool_]],
) -> Array:
    """Means (bins, 2), NaN where there are too few rows."""
    t = np.concatenate([values[m] for values, m in zip(temperatures, masks, strict=True)])
    e = np.concatenate([values[m] for values, m in zip(errors, masks, strict=True)])
    place = _places(edges, t)
    means = np.full((BINS, 2), np.nan)
    for k in range(BINS):
        inside = e[place == k]
        if len(inside) >= LEAST_ROWS:
            means[k] = inside.mean(axis=0)
    return means


def _noise(
    legs: Sequence[Leg],
    edges: Array,
    temperatures: Sequence[Array],
    errors: Sequence[Array],
    masks: Sequence[NDArray[np.bool_]],
) -> float:
    """Standard error of a mean, Nm, from the halves of what each leg has in a bin."""
    gaps = []
    for leg in legs:
        rows = slice(leg.start, leg.stop)
        place = np.where(masks[leg.run][rows], _places(edges, temperatures[leg.run][rows]), -1)
        for k in range(BINS):
            inside = errors[leg.run][rows, 1][place == k]
            if len(inside) >= LEAST_ROWS:
                middle = len(inside) // 2
                gaps.append(inside[:middle].mean() - inside[middle:].mean())
    return 0.5 * float(np.sqrt(np.mean(np.square(gaps)))) if gaps else 0.0


def _places(edges: Array, temperature: Array) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(edges, temperature, side="right") - 1, 0, BINS - 1)


def thermal_figures(
    thermal: Thermal | None, full_scale: float | None, missing: str
) -> tuple[Figure, ...]:
    """Return the figures of `DEFINITIONS`; `missing` says why there are none at all."""
    names = list(DEFINITIONS)
    if thermal is None or full_scale is None:
        return tuple(Figure.none(n, DEFINITIONS[n], missing) for n in names)
    made = []
    for column, name in enumerate(names[:2]):
        values = thermal.both[:, column]
        spread = values - np.nanmin(values)
        made.append(_figure(name, spread, thermal, full_scale))
    gap = np.abs(thermal.heating - thermal.cooling)
    for column, name in enumerate(names[2:]):
        if np.isfinite(gap[:, column]).any():
            made.append(_figure(name, gap[:, column], thermal, full_scale))
        else:
            made.append(Figure.none(name, DEFINITIONS[name], _one_way(thermal)))
    return tuple(made)


def _figure(name: str, values: Array, thermal: Thermal, full_scale: float) -> Figure:
    shown = thermal.noise * float(np.sqrt(4.0 * np.log(2.0 * BINS)))
    return Figure.of(name, DEFINITIONS[name], values, thermal.centre, shown, full_scale, "°C")


def _one_way(thermal: Thermal) -> str:
    warmed = bool(np.isfinite(thermal.heating[:, 0]).any())
    cooled = bool(np.isfinite(thermal.cooling[:, 0]).any())
    if warmed and not cooled:
        return "the temperature only rises: record the cooling as well"
    if cooled and not warmed:
        return "the temperature only falls: record the heating as well"
    return "no temperature was passed both on the way up and on the way down"


@dataclass(frozen=True)
class RunZero:
    """The zero of one run with its standard error: `voltage` at zero torque and T₀, V.

    `torque`: that of 0 V, Nm. `beside`: what the run reads more than it would with the mean zero,
    Nm. NaN without a sensitivity. `beside_voltage`: the same in V.
    """

    run: str
    voltage: float
    voltage_error: float
    torque: float
    torque_error: float
    beside: float
    beside_voltage: float


@dataclass(frozen=True)
class ZeroTest:
    """Whether the zero moved between runs.

    `p`: of Wald's test, chance of such differences where the zero has not moved; NaN where the
    noise is not known well enough to tell. `tested`: q, combinations of zeros that it looks at.
    `spread`: largest less least zero that these combinations show, V.
    """

    p: float
    tested: int
    spread: float

    @property
    def moved(self) -> bool:
        """Whether the zeros differ by more than noise does once in a hundred calibrations."""
        return self.p < LEVEL


def contrast_names(runs: Sequence[CalibrationRun]) -> tuple[str, ...]:
    """Names of the columns; none for one run."""
    return tuple(f"zero_of_{run.log.name}" for run in runs[:-1])


def zero_test(runs: Sequence[CalibrationRun], made: Regression) -> ZeroTest | None:
    """Test whether the zeros of the runs differ; None for one run, or where each has its own.

    Parameters
    ----------
    made : the regression with one zero for all runs.
    """
    if len(runs) < 2 or made.shape.contrasts:
        return None
    # a sensitivity that is held and wrong must not make a zero of each run's load
    shape = replace(made.shape, sensitivity=True, contrasts=contrast_names(runs))
    still = [_still(run) for run in runs]
    rows = [rows_of(run, shape) for run in still]
    tested = wald_test(still, rows, made.residuals, slice(shape.shared, len(shape.names)))
    if tested is None:
        return ZeroTest(1.0, 0, 0.0)
    shown = tested.combinations @ tested.coefficients
    shifts = contrasts(len(runs)) @ tested.combinations.T @ shown
    return ZeroTest(tested.p, len(tested.combinations), float(np.ptp(shifts)))


@dataclass(frozen=True)
class GainTest:
    """Whether the gain changes with temperature.

    `per_kelvin`: of the reading, relative, with its standard `error`. `p`: chance of such a change
    where there is none. `low`, `high`: temperatures at which there was load, °C.
    """

    per_kelvin: float
    error: float
    p: float
    low: float
    high: float

    @property
    def changes(self) -> bool:
        """Whether noise shows as much in less than one of a hundred calibrations."""
        return self.p < LEVEL


def gain_test(runs: Sequence[CalibrationRun], made: Regression) -> GainTest | None:
    """Test whether the gain changes with temperature; None where load was at one temperature."""
    still = [_still(run) for run in runs]
    warmth = warmth_under_load(still)
    if warmth is None or not made.shape.sensitivity:
        return None
    rows = [rows_of(run, made.shape) for run in still]
    tested = wald_test(still, rows, made.residuals, slice(-1, None))
    if tested is None:
        return None
    unit = float(made.coefficients[0]) * largest_of(still) * warmth.span
    half = 0.5 * warmth.span
    return GainTest(
        float(tested.coefficients[0]) / unit,
        float(tested.errors[0]) / abs(unit),
        tested.p,
        warmth.middle - half,
        warmth.middle + half,
    )


@dataclass(frozen=True)
class DelayTest:
    """Whether the channel `reference` is late against the sensor, or early: negative.

    `seconds`, with its standard `error`. `fastest`: rate of the reference, Nm/s, at which its loop
    is widest.
    """

    reference: str
    seconds: float
    error: float
    fastest: float

    @property
    def loop(self) -> float:
        """How far the sides of the loop are apart that the delay makes, Nm."""
        return 2.0 * abs(self.seconds) * self.fastest

    @property
    def late(self) -> bool:
        """Whether there is a delay, by the rule of `check`."""
        return abs(self.seconds) > TOLD * self.error


def delay_test(
    runs: Sequence[CalibrationRun], made: Regression, reference: str | None
) -> DelayTest | None:
    """Measure the delay of the reference; None where no load changes or other columns take it."""
    if reference is None or not made.shape.sensitivity:
        return None
    try:
        rates = [_rate(run, reference) for run in runs]
    except InputError:  # too short, or too slow a recorder, for a derivative
        return None
    still = [_still(run) for run in runs]
    rows = [np.column_stack([rows_of(s, made.shape), r]) for s, r in zip(still, rates, strict=True)]
    count = rows[0].shape[1]
    tested = wald_test(still, rows, made.residuals, slice(count - 1, count))
    if tested is None:
        return None
    slope = float(made.coefficients[0])
    return DelayTest(
        reference,
        float(tested.coefficients[0]) / slope,
        float(tested.errors[0]) / abs(slope),
        max(float(np.abs(rate).max()) for rate in rates),
    )


def _rate(run: CalibrationRun, reference: str) -> Array:
    """(N,), Nm/s, of the reference; zeros of a run without load."""
    if not run.loaded or not np.ptp(run.torque) > 0.0:
        return np.zeros(len(run))
    return derivative(run.log, reference, 1, default_bandwidth(run.log["time"], run.torque))


def _still(run: CalibrationRun) -> CalibrationRun:
    """The run with reference and temperature as they would be without their noise."""
    warmth = run.temperature
    if warmth is None:
        return quiet(run)
    if _temperatures(warmth) == 1:
        smooth = np.full(len(run), warmth.mean())
    else:
        smooth = uniform_filter1d(warmth, max(len(run) // SMOOTHED, 1))
    return replace(quiet(replace(run, temperature=None)), temperature=smooth)


def _temperatures(warmth: Array) -> int:
    """Distinct temperatures of one run."""
    return count_temperatures([warmth], white_noise(warmth))


def require_own_zeros(runs: Sequence[CalibrationRun], degree: int) -> None:
    """Refuse a zero of its own for each run where no run shows the drift by itself.

    A run of c distinct temperatures tells c - 1 coefficients of the drift beside its zero.
    """
    columns = [run.temperature for run in runs if run.temperature is not None]
    if degree == 0 or len(runs) < 2 or not columns:
        return
    told = sum(_temperatures(c) - 1 for c in columns)
    if told == 0:
        raise InputError(
            "the temperature stays the same within each run (to half a kelvin or its noise), so "
            "that a zero of its own for each run and a drift with temperature are "
            "indistinguishable; record runs in which the temperature changes, or give degree=0 "
            "(--degree 0)"
        )
    if told < degree:
        raise InputError(
            f"the temperatures within the runs show a drift of degree {told} at most beside a zero "
            f"of its own for each run, degree = {degree} is asked for; give a smaller degree, or "
            "record runs in which the temperature changes more"
        )


def run_zeros(
    runs: Sequence[CalibrationRun], made: Regression, sensitivity: float | None
) -> tuple[RunZero, ...]:
    """Return the zero of each run; none where all runs share one."""
    shape, slope = made.shape, sensitivity if sensitivity is not None else float("nan")
    if not shape.contrasts:
        return ()
    first, count = int(shape.sensitivity), len(shape.names)
    volts = np.zeros((len(runs), len(made.uncertainty.basis)))
    volts[:, first] = 1.0
    volts[:, shape.shared : count] = [run.contrast for run in runs]
    beside = volts[:, shape.shared : count] @ made.coefficients[shape.shared :]
    values = volts[:, :count] @ made.coefficients
    torque = -slope * volts
    if shape.sensitivity:
        torque[:, 0] = slope**2 * values  # of −v / s, as k = 1/s
    errors = made.uncertainty.errors_of(volts), made.uncertainty.errors_of(torque)
    return tuple(
        RunZero(
            run.log.name,
            float(values[k]),
            float(errors[0][k]),
            float(-slope * values[k]),
            float(errors[1][k]),
            float(slope * beside[k]),
            float(beside[k]),
        )
        for k, run in enumerate(runs)
    )


def zero_spread(zeros: Sequence[RunZero]) -> tuple[float, float]:
    """Standard deviation of the zeros over the runs, in V and in Nm; NaN for less than two."""
    if len(zeros) < 2:
        return float("nan"), float("nan")
    volts = float(np.std([zero.voltage for zero in zeros], ddof=1))
    torque = float(np.std([zero.torque for zero in zeros], ddof=1))
    return volts, torque
