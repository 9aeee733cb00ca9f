"""The result of a calibration: its runs with their legs and points, and its warnings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.accuracy import (
    Figure,
    Leg,
    Points,
    legs_of,
    load_figures,
    points_on,
    slack_of,
)
from flexspline.calibration.parameters import (
    PART_OF_ERROR,
    Estimators,
    compensation_torque,
    lost_to_reference,
)
from flexspline.calibration.regression import Alone, Regression, Shape, drift_columns
from flexspline.calibration.runs import CalibrationRun, why_unexcited
from flexspline.calibration.structure import LEVEL
from flexspline.calibration.thermal import (
    DelayTest,
    GainTest,
    RunZero,
    Thermal,
    ThermalLeg,
    ZeroTest,
    require_own_zeros,
    thermal_figures,
    thermal_legs,
    thermal_means,
    zero_spread,
)
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.estimators import Calibration, TemperatureCompensation
from flexspline.formatting import plus_minus, short
from flexspline.lazy import Rendered, render
from flexspline.least_squares.identifiability import Confounded
from flexspline.least_squares.result import Parameter, parameters_frame
from flexspline.least_squares.uncertainty import Uncertainty
from flexspline.logs.log import Log
from flexspline.logs.quantisation import white_noise
from flexspline.model import Model

if TYPE_CHECKING:
    import pandas

__all__ = [
    "CalibratedRun",
    "CalibrationResult",
    "bend_of",
    "held_in_drift",
    "late_of",
    "percent_text",
    "views_of",
    "warnings_of",
]

Array = NDArray[np.float64]

WHOLE_LEG = 0.5  # of the reference's span

LAG_SHOWS = 2.0  # thermal hysteresis over what noise would show
MOST_OF_IT = 0.8  # of the full scale
DISAGREES = 0.002  # of the sensitivity, and of the full scale
BENT = 3.0  # standard deviations of the noise of a reading that a straight line may be off


@dataclass(frozen=True)
class Views:
    """What a result shows of its runs."""

    runs: tuple[CalibratedRun, ...]
    legs: tuple[Leg, ...]
    points: Points | None
    thermal_legs: tuple[ThermalLeg, ...]
    thermal: Thermal | None
    figures: tuple[Figure, ...]


@dataclass(frozen=True)
class CalibrationResult(Views, Rendered):
    """The result of `calibrate`: prints as a verdict, one line for each parameter and figure.

    Parameters
    ----------
    model : with the estimators, ready to save and export.
    calibration, compensation : the estimators; None where the runs cannot give them.
    torque_parameters : k, zero, c_k, g, lag in Nm; empty where the sensitivity is not known.
    voltage_parameters : s = 1/k, v₀, d_k, h, lag in V.
    drift_polynomial : A′_j of zhang_disturbance_elimination (11), b(T) = Σ A′_j T^j in V, T in °C.
    confounded : coefficients in volts that the runs cannot tell apart.
    runs : errors of reading, row by row.
    legs, points : of the reference: rising and falling, plateaus or bins on them.
    thermal_legs, thermal : of the temperature.
    figures : in %FS, see `flexspline.calibration.accuracy`.
    full_scale : Nm, and `full_scale_source`: "given", "model" or "reference", the largest one.
    sensitivity_reason : why the runs do not determine the sensitivity, "" where they do.
    validated_by : "runs" or "blocks"; `fold_rmses`: of each that was left out, in `unit`.
    alone : parts that were left out and alone determine a parameter; `instead`: runs that do, for
        which blocks were left out.
    drift_beside_bend : whether drift and lag were found beside bend and hysteresis; `bend_taken`:
        whether these runs cannot tell one from the other.
    uncertainty : covariance and noise model, in volts.
    shape : what was regressed on what.
    zeros : of each run, with `zero_per_run`, else none; the parameters hold their mean.
    zero_test : whether the zero moved between the runs; None for one run or with `zero_per_run`.
    gain_test : whether the gain changes with temperature; None where load was at one temperature.
    delay_test : whether the reference is late against the sensor; None where that is not shown.
    spiked : channels of which single rows leap: their calibration is that of these rows.
    warnings : sentences about the runs and the result.
    """

    _kind: ClassVar = "calibration"

    model: Model
    calibration: Calibration | None
    compensation: TemperatureCompensation | None
    voltage_parameters: tuple[Parameter, ...]
    torque_parameters: tuple[Parameter, ...]
    drift_polynomial: tuple[Parameter, ...]
    confounded: tuple[Confounded, ...]
    full_scale: float | None
    full_scale_source: str
    sensitivity_reason: str
    validated_by: str
    fold_rmses: tuple[float, ...]
    fold_labels: tuple[str, ...]
    alone: tuple[Alone, ...]
    instead: tuple[Alone, ...]
    drift_beside_bend: bool
    bend_taken: bool
    uncertainty: Uncertainty
    shape: Shape
    zeros: tuple[RunZero, ...]
    zero_test: ZeroTest | None
    gain_test: GainTest | None
    delay_test: DelayTest | None
    spiked: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def unit(self) -> str:
        """Of the errors: Nm, or V where the sensitivity is not known."""
        return "V" if self.calibration is None else "Nm"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """In Nm where the sensitivity is known, else in V."""
        return self.torque_parameters or self.voltage_parameters

    @cached_property
    def rmse(self) -> float:
        """Root mean square of reading less reference, in `unit`."""
        return _rms([run.error for run in self.runs])

    @cached_property
    def cv_rmse(self) -> float:
        """The same on rows that the regression never saw."""
        return _rms([run.held_out for run in self.runs])

    @property
    def median_fold(self) -> float:
        """Median RMSE of the parts that were left out in turn, in `unit`."""
        return float(np.median(self.fold_rmses))

    @property
    def worst_fold(self) -> float:
        """Largest RMSE of the parts that were left out in turn, in `unit`."""
        return max(self.fold_rmses)

    @property
    def zero_spread(self) -> tuple[float, float]:
        """Standard deviation of the zeros over the runs, V and Nm; NaN without `zero_per_run`."""
        return zero_spread(self.zeros)

    def __getitem__(self, name: str) -> Parameter:
        """Return a parameter by its name, in Nm where the sensitivity is known."""
        known = {p.name: p for p in self.parameters}
        if name not in known:
            raise InputError(
                f"the calibration has no '{name}'{did_you_mean(name, known)}; it has "
                f"{listed(known)}"
            )
        return known[name]

    def figure(self, name: str) -> Figure:
        """Return a figure by its name, such as "hysteresis"."""
        known = {figure.name: figure for figure in self.figures}
        if name not in known:
            raise InputError(
                f"there is no figure '{name}'{did_you_mean(name, known)}; there are {listed(known)}"
            )
        return known[name]

    def drift_voltage(self, temperature: Sequence[float] | Array) -> tuple[Array, Array]:
        """Return b(T) of (11), the voltage at zero torque, and its standard error, (n,) each, V.

        Parameters
        ----------
        temperature : (n,), °C, of a body that is evenly warm.
        """
        warmer = np.asarray(temperature, dtype=np.float64) - self.shape.reference_temperature
        first, width = int(self.shape.sensitivity), len(self.uncertainty.basis)
        rows = np.zeros((len(warmer), width))
        rows[:, first : first + self.shape.degree + 1] = np.vander(
            warmer, self.shape.degree + 1, increasing=True
        )
        values = np.zeros(width)
        known = [p.value for p in self.voltage_parameters][: self.shape.degree + 1 + first]
        values[: len(known)] = known
        return rows @ values, self.uncertainty.errors_of(rows)

    def to_frame(self) -> pandas.DataFrame:
        """Return the parameters in Nm (or V) as a table."""
        return parameters_frame(self.parameters)

    def figures_frame(self) -> pandas.DataFrame:
        """Return the figures as a table; NaN where the runs cannot show one."""
        from dataclasses import asdict

        import pandas

        return pandas.DataFrame([asdict(figure) for figure in self.figures]).set_index("name")

    def __repr__(self) -> str:
        return (
            f"<CalibrationResult: {len(self.runs)} runs, {len(self.parameters)} parameters, "
            f"RMSE {self.rmse:.4g} {self.unit}, held out {self.cv_rmse:.4g} {self.unit}>"
        )

    def plot(self) -> Any:
        """Return a figure: drift (Fig. 16), before and after (Fig. 17), calibration (Fig. 18)."""
        return render("calibration", "figure", self)


def _rms(columns: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(columns) ** 2)))


@dataclass(frozen=True, eq=False)
class CalibratedRun:
    """One run, arrays (N,). `voltage` V, `reference` Nm, `temperature` °C or None.

    `error`: reading less reference with the compensation, `uncompensated`: without, `held_out`:
    of regressions that never saw the row; Nm, or V where the sensitivity is not known. With a zero
    for each run, errors are those with the run's own zero, which is `own_zero` [V] above the mean
    that the model holds: what runs on the joint reads so many volts' torque more.
    """

    log: Log
    voltage: Array
    reference: Array
    temperature: Array | None
    error: Array
    uncompensated: Array
    held_out: Array
    own_zero: float = 0.0


def views_of(
    runs: Sequence[CalibrationRun],
    made: Regression,
    estimators: Estimators,
    held_out: Sequence[Array],
) -> Views:
    """Apply the estimators to the runs and look at what is left.

    Parameters
    ----------
    held_out : V, an array (N,) for each run.
    """
    seen = [
        _calibrated(run, made, estimators, residual, other)
        for run, residual, other in zip(runs, made.residuals, held_out, strict=True)
    ]
    full_scale = estimators.full_scale if estimators.calibration is not None else None
    long_run = float(np.sqrt(made.uncertainty.noise.long_run_variance))
    legs, points, why = _load(runs, seen, estimators, long_run)
    thermal, told, cold = _warmth(seen, full_scale)
    figures = (
        *load_figures(legs, points, full_scale, why),
        *thermal_figures(thermal, full_scale, cold),
    )
    return Views(tuple(seen), tuple(legs), points, tuple(told), thermal, figures)


def _calibrated(
    run: CalibrationRun,
    made: Regression,
    estimators: Estimators,
    residual: Array,
    held_out: Array,
) -> CalibratedRun:
    calibration = estimators.calibration
    scale = 1.0 if calibration is None else calibration.sensitivity
    error = scale * residual
    if calibration is None:
        shape = made.shape
        first = shape.shared - shape.degree - shape.gradient
        columns = drift_columns(run, shape)[:, : shape.degree + shape.gradient]
        uncompensated = error + columns @ made.coefficients[first : shape.shared]
    else:
        added = compensation_torque(estimators.compensation, run.log["time"], run.temperature)
        uncompensated = error - added
    return CalibratedRun(
        run.log,
        run.voltage,
        run.torque,
        run.temperature,
        error,
        np.asarray(uncompensated),
        scale * held_out,
        _own_zero(run, made),
    )


def _own_zero(run: CalibrationRun, made: Regression) -> float:
    """Zero of the run less the mean of all, V."""
    if not made.shape.contrasts:
        return 0.0
    return float(run.contrast @ made.coefficients[made.shape.shared :])


def _load(
    runs: Sequence[CalibrationRun],
    seen: Sequence[CalibratedRun],
    estimators: Estimators,
    long_run: float,
) -> tuple[list[Leg], Points | None, str]:
    """Legs of the reference and points on them; why there are none."""
    why = why_unexcited(runs)
    if why:
        return [], None, why
    if estimators.calibration is None:
        return [], None, "the sensitivity is not determined"
    columns = [run.torque for run in runs]
    span = max(float(c.max()) for c in columns) - min(float(c.min()) for c in columns)
    slack = slack_of([run.torque for run in runs if run.loaded])
    legs = legs_of(columns, slack, WHOLE_LEG * span)
    looked_at = [
        np.column_stack([run.error, run.voltage - run.own_zero + (run.error - run.uncompensated)
                         / estimators.calibration.sensitivity])
        for run in seen
    ]  # fmt: skip
    if not legs:
        return legs, None, ""
    slow = (abs(estimators.calibration.sensitivity) * long_run, long_run)
    points = points_on(legs, columns, looked_at, slack, slow)
    return legs, points and _bounded(points, _rms([run.error for run in seen]), estimators), ""


def _bounded(points: Points, seen: float, estimators: Estimators) -> Points:
    """Noise of a mean, no more than what is seen: RMS of all errors of reading, Nm.

    The noise model's error of a mean is that of many times its memory. Noise that is slower than a
    plateau lasts, or zeros that moved, would by that rule show more than all errors there are.
    """
    assert estimators.calibration is not None
    most = np.array([seen, seen / abs(estimators.calibration.sensitivity)])
    return replace(points, noise=np.minimum(points.noise, most))


def _warmth(
    seen: Sequence[CalibratedRun], full_scale: float | None
) -> tuple[Thermal | None, list[ThermalLeg], str]:
    """Means over temperature, its legs, and why there are none."""
    temperatures = [run.temperature for run in seen if run.temperature is not None]
    if len(temperatures) < len(seen):
        return None, [], "temperature is left out"
    legs = thermal_legs(temperatures)
    errors = [np.column_stack([run.uncompensated, run.error]) for run in seen]
    torques = [run.reference for run in seen]
    thermal = thermal_means(legs, temperatures, torques, errors, full_scale)
    told = [
        ThermalLeg(
            seen[leg.run].log.name,
            leg.rising,
            min(leg.first, leg.last),
            max(leg.first, leg.last),
            float(np.mean(seen[leg.run].error[leg.start : leg.stop])),
            float(np.sqrt(np.mean(seen[leg.run].error[leg.start : leg.stop] ** 2))),
        )
        for leg in legs
    ]
    missing = "" if full_scale is not None else "in %FS it needs a sensitivity and a full scale"
    return thermal, told, missing


def warnings_of(
    result: CalibrationResult, runs: Sequence[CalibrationRun], made: Regression
) -> list[str]:
    """Return sentences on what may be wrong with the result."""
    return [
        *_undetermined(result),
        *_sign(result),
        *_disagrees(result),
        *_attenuation(result, runs, made),
        *_moved(result, runs),
        *_gain(result),
        *_late(result),
        *_bend(result, runs),
        *_lag(result, made),
        *_beyond(result),
        *([] if result.uncertainty.reliable else [result.uncertainty.statement]),
    ]


def _undetermined(result: CalibrationResult) -> Iterator[str]:
    if not result.sensitivity_reason:
        return
    if result.calibration is None:
        yield (
            f"the sensitivity is not determined: {result.sensitivity_reason}; the drift is fitted "
            "in volts alone and the model receives no estimator; add a run with load, or give the "
            "sensitivity"
        )
    else:
        yield (
            f"the sensitivity, {result.calibration.sensitivity:.6g} Nm/V, is taken as known: "
            f"{result.sensitivity_reason}"
        )
    if "stays at" in result.sensitivity_reason and result.calibration is None:
        yield "the zero holds the load that the reference shows"


def _sign(result: CalibrationResult) -> Iterator[str]:
    if result.calibration is not None and result.calibration.sensitivity < 0.0:
        yield (
            f"the sensitivity is negative, {result.calibration.sensitivity:.5g} Nm/V: the bridge "
            "is wired that way round, or the reference has the wrong sign; if so ask for the "
            "repair flip_sign=reference_torque"
        )


def _disagrees(result: CalibrationResult) -> Iterator[str]:
    """A known sensitivity that the runs do not share: error = (k / k_own − 1) τ."""
    if result.calibration is None or result.points is None or result.shape.sensitivity:
        return
    if not np.ptp(result.points.x) > 0.0:
        return
    slope = float(np.polyfit(result.points.x, result.points.y[:, 0], 1)[0])
    if abs(slope) > DISAGREES:
        own = result.calibration.sensitivity / (1.0 + slope)
        yield (
            f"the runs by themselves say {own:.5g} Nm/V, {100 * abs(slope):.2g} % beside the "
            "sensitivity given; leave it out to fit it"
        )


def _attenuation(
    result: CalibrationResult, runs: Sequence[CalibrationRun], made: Regression
) -> Iterator[str]:
    """Noise of the reference makes s too small, k too large."""
    loaded = [run.torque for run in runs if run.loaded]
    known = [p for p in result.torque_parameters if p.name == "sensitivity" and p.state == "fitted"]
    if not known or not loaded:
        return
    noise = max(white_noise(torque) for torque in loaded)
    share = lost_to_reference(runs, made)
    if share * abs(known[0].value) > PART_OF_ERROR * known[0].standard_error:
        yield (
            f"noise of the reference, {noise:.2g} Nm, makes the sensitivity too large by about "
            f"{100 * share:.2g} %: average the reference, or load higher"
        )


def _moved(result: CalibrationResult, runs: Sequence[CalibrationRun]) -> Iterator[str]:
    """A zero that differs between runs, with its size."""
    test = result.zero_test
    if test is None or not test.moved:
        return
    size = f"{1e3 * test.spread:.3g} mV"
    if result.calibration is not None:
        torque = abs(result.calibration.sensitivity) * test.spread
        whole = result.full_scale
        share = f", {100.0 * torque / whole:.2g} %FS" if whole else ""
        size += f" ({torque:.3g} Nm{share})"
    lags = result.shape.degree and result.shape.lag == 0.0
    other = "; a body that lags the thermometer looks like it (--thermal-lag fit)" if lags else ""
    into = "the errors"
    if result.shape.degree:
        fitted = any(p.name == "thermal_lag" and p.state == "fitted" for p in result.parameters)
        into = "drift, thermal lag and their errors" if fitted else "the drift and its errors"
    try:
        require_own_zeros(runs, result.shape.degree)
        ask = "ask for --zero-per-run (zero_per_run=True)"
    except InputError:
        ask = "record runs in which the temperature changes and ask for --zero-per-run"
    yield (
        f"the zero differs between the runs by up to {size}, more than noise shows in one of "
        f"{round(1.0 / LEVEL)} calibrations, and {into} hold the difference: {ask} if the sensor "
        f"was mounted or zeroed again between runs{other}"
    )


def _gain(result: CalibrationResult) -> Iterator[str]:
    """A gain that changes with temperature, with what it makes of the largest load."""
    test = result.gain_test
    if test is None or not test.changes:
        return
    largest = max(float(np.abs(run.reference).max()) for run in result.runs)
    off = abs(test.per_kelvin) * 0.5 * (test.high - test.low) * largest
    size = plus_minus(100.0 * test.per_kelvin, 100.0 * test.error)
    yield (
        f"the gain changes with temperature, by {size} %/K between {test.low:.3g} and "
        f"{test.high:.3g} °C, which the calibration takes for constant: at {largest:.3g} Nm the "
        f"reading is off by up to {off:.2g} Nm; calibrate at the temperature at which the joint "
        "works, or fit the gain too: flexspline fit RUN.csv... --into DIR/model.json --out DIR2 "
        "--target sensor_torque --known-load reference_torque --effects "
        "gain_error,gain_temperature_dependence (with the runs and DIR of this calibration)"
    )


def late_of(result: CalibrationResult) -> DelayTest | None:
    """The delay of the reference, where its loop is more than noise and than calibrations differ.

    Both as `bend_of` asks it of a line.
    """
    test, calibration = result.delay_test, result.calibration
    if test is None or calibration is None or not test.late or result.spiked:
        return None
    noise = abs(calibration.sensitivity) * max(white_noise(run.voltage) for run in result.runs)
    shows = test.loop > max(BENT * noise, DISAGREES * (result.full_scale or 0.0))
    return test if shows else None


def _late(result: CalibrationResult) -> Iterator[str]:
    """A reference that is late or early against the sensor, which looks like hysteresis."""
    test = late_of(result)
    if test is None:
        return
    size = plus_minus(1e3 * abs(test.seconds), 1e3 * test.error)
    way, moved = ("late", test.reference) if test.seconds > 0.0 else ("early", "sensor_voltage")
    yield (
        f"the reference is {size} ms {way} against the sensor, which looks like hysteresis and "
        f"parts the sides of the loop by up to {short(test.loop)} Nm: ask for the repair "
        f"shift={moved}:{abs(test.seconds):.3g}, unless the loop is as wide where the load "
        "changes half as fast: then it is the sensor's"
    )


def bend_of(result: CalibrationResult) -> tuple[Figure, float] | None:
    """How far the line of the calibration is off, and how many times the noise of a reading.

    None where that is within the noise of a reading, or within what two calibrations may differ.
    """
    calibration = result.calibration
    figure = result.figure("non-linearity, least squares")
    if calibration is None or figure.torque is None or figure.percent is None:
        return None
    noise = abs(calibration.sensitivity) * max(white_noise(run.voltage) for run in result.runs)
    bent = figure.torque > BENT * noise and figure.percent > 100.0 * DISAGREES
    return (figure, figure.torque / noise if noise > 0.0 else np.inf) if bent else None


def percent_text(share: float) -> str:
    """Return per cent to two digits, and in no power of ten."""
    return short(share, 2) if share < 99.5 else f"{share:.0f}"


def _bend(result: CalibrationResult, runs: Sequence[CalibrationRun]) -> Iterator[str]:
    """A characteristic that is no straight line: bent, or a loop whose middle may be one."""
    bend = bend_of(result)
    if bend is None:
        return
    torque, percent, at = (value or 0.0 for value in (bend[0].torque, bend[0].percent, bend[0].at))
    apart = result.figure("hysteresis").torque or 0.0
    form, its = "bent", "bend"
    if percent <= (bend[0].noise or 0.0):
        yield (
            f"a straight line is off by up to {short(torque)} Nm, {percent_text(percent)} %FS and "
            f"{short(bend[1])} times the noise of a reading, at {short(at)} Nm, which is no bend "
            "that is significant: what differs between the readings of one load shows as much. "
            "Look for a reference that was recorded late, or a zero that moved between the runs"
        )
        return
    if torque <= 0.5 * apart:  # at the ends of a loop there is one side alone
        form, its = f"a loop, whose sides are up to {short(apart)} Nm apart", "loop"
    how = (
        "; calibrate the runs with load alone (degree=0, --degree 0) and then the drift into that "
        f"model, so that none of the {its} goes into the drift"
    )
    beside, several = result.drift_beside_bend, result.shape.degree > 0 and len(runs) > 1
    what = "sensitivity and zero" if beside else "sensitivity, zero and drift"
    yield (
        f"a straight line is off by up to {short(torque)} Nm, {percent_text(percent)} %FS and "
        f"{short(bend[1])} times the noise of a reading, at {short(at)} Nm: the characteristic is "
        f"{form}, and the errors of {what} hold the noise alone and not the {its}"
        f"{how if several and not beside else ''}"
    )


def held_in_drift(result: CalibrationResult) -> str:
    """What drift and lag hold that their errors do not, in words; "" for nothing that is known."""
    if result.zero_test is not None and result.zero_test.moved:
        return "holds zeros that moved, its error does not"
    if result.bend_taken:
        return "may be a bend, its error does not hold that"
    return ""


def _lag(result: CalibrationResult, made: Regression) -> Iterator[str]:
    parted = result.figure("thermal hysteresis, compensated")
    shows = parted.percent is not None and parted.percent > LAG_SHOWS * (parted.noise or 0.0)
    if made.lag is None and made.shape.lag == 0.0 and shows:
        yield (
            f"heating and cooling part by {parted.torque:.3g} Nm at the same temperature: the "
            "body lags the thermometer; thermal_lag='fit' (--thermal-lag fit) may remove it"
        )
    if made.lag is not None and made.lag.bound:
        side = "lower" if made.lag.bound < 0 else "upper"
        yield (
            f"the thermal lag ended on its {side} bound, {made.lag.value:.3g} s: these runs do not "
            "show one; give thermal_lag=0 or record slower and faster changes of temperature"
        )
    if made.lag is not None and made.lag.flat:
        yield "the runs say nothing of a thermal lag: the temperature does not change"


def _beyond(result: CalibrationResult) -> Iterator[str]:
    """Full scale beyond what was loaded: the figures are extrapolated."""
    largest = max(float(np.abs(run.reference).max()) for run in result.runs)
    whole = result.full_scale if result.full_scale_source == "given" else None
    if whole is not None and not result.sensitivity_reason and largest < MOST_OF_IT * whole:
        yield (
            f"the reference reaches {largest:.4g} Nm of a full scale of {whole:.4g} Nm: the "
            "figures say nothing of the rest"
        )
