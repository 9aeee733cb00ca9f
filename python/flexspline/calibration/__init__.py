"""Calibration of the torque sensor and compensation of its drift with temperature.

`calibrate` makes estimators with standard errors of voltage, temperature and a reference torque.

In this order: runs, regression, estimators, accuracy, warnings.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from flexspline.calibration.accuracy import Figure
from flexspline.calibration.parameters import (
    PART_OF_ERROR,
    Asked,
    Estimators,
    confounded,
    drift_polynomial,
    estimators_of,
    lost_to_noise,
    sensitivity_determined,
    torque_parameters,
    voltage_parameters,
)
from flexspline.calibration.regression import Regression, Shape, cross_validate, regress
from flexspline.calibration.result import CalibratedRun, CalibrationResult, views_of, warnings_of
from flexspline.calibration.runs import (
    CalibrationRun,
    calibration_runs,
    why_unexcited,
)
from flexspline.calibration.thermal import (
    contrast_names,
    delay_test,
    gain_test,
    require_own_zeros,
    run_zeros,
    zero_test,
)
from flexspline.errors import InputError, above_zero, number
from flexspline.estimators import Calibration
from flexspline.least_squares.identifiability import Confounded
from flexspline.least_squares.result import Parameter
from flexspline.logs.log import Log, limits_of
from flexspline.model import Model, require_model
from flexspline.schema import plain_json
from flexspline.signals import IMAGINABLE

if TYPE_CHECKING:
    from flexspline.estimators import Thermistor
    from flexspline.logs.read import LogLike

__all__ = [
    "CalibratedRun",
    "CalibrationResult",
    "Figure",
    "calibrate",
]


ROWS_A_PARAMETER = 3
ROWS_A_RUN = 8  # that the noise model looks back over before it starts
ROWS_BESIDE = 40
FIT = "fit"
TOGETHER = "load and temperature change together in these runs"
NOT_FOLLOWED = "the voltage does not follow the reference"


def calibrate(
    logs: LogLike | Iterable[LogLike],
    *,
    reference: str | None = "reference_torque",
    degree: int = 2,
    reference_temperature: float = 25.0,
    thermal_lag: float | str = 0.0,
    gradient: float | str = 0.0,
    thermistor: Thermistor | Mapping[str, float] | None = None,
    sensitivity: float | None = None,
    full_scale: float | None = None,
    into: Model | None = None,
    zero_per_run: bool = False,
) -> CalibrationResult:
    """Calibrate a torque sensor and compensate its drift with temperature.

        τ = k V + zero + Σ_k c_k (T_b − T₀)^k + g (T − T_b)

    Runs with load give all of it; where the reference never leaves zero, the drift alone is
    fitted, in volts, and in Nm where the sensitivity is known.

    Parameters
    ----------
    logs : runs with `sensor_voltage` [V], the reference [Nm], and `temperature` [°C] or
        `thermistor_voltage` [V]. Runs that lack the reference are taken to be without load.
    reference : channel with the trusted torque; None where all runs are without load.
    degree : of the drift's polynomial, 1 to 6; 0 leaves temperature out.
    reference_temperature : T₀, °C, where the compensation is zero.
    thermal_lag : s, of the elastic body behind the thermometer, "fit" to find it; 0 is the paper's.
    gradient : g, Nm/K, or "fit"; needs a lag.
    thermistor : a `Thermistor` or its constants, for logs without `temperature`; that of `into`
        where it has one.
    sensitivity : Nm/V, where it is known and not to be fitted; for runs without load that of
        `into` is used.
    full_scale : Nm, what %FS are percent of; the largest reference where none is given.
    into : a model of the same joint that receives the estimators.
    zero_per_run : whether each run has its own zero, because the sensor was mounted, or its
        amplifier zeroed, again between the runs. The zero of the parameters and of the model is
        then the mean over the runs, whatever their order and length: the next mounting has yet
        another one, and the mean is the best guess of it. `.zeros` holds that of each run.

    Returns
    -------
    CalibrationResult
        Prints as a verdict; `.model` holds the estimators.

    Raises
    ------
    InputError
        For missing channels, values that are not finite, a saturated converter, fewer than
        degree + 1 temperatures, too few rows, a reference that is the voltage, load and
        temperature that change together, or a zero for each run where no run shows the drift.

    Notes
    -----
    zhang_disturbance_elimination (8)–(11), (24), (25). The published numbers: (25),
    τ = 62.738 V + 2.1835, has its zero at −2.1835/62.738 V = −34.8 mV (the text calls this
    "temperature drift"), and (24), b(T) = 0.0102 T² − 0.8704 T − 21.39 mV, gives −34.7 mV at
    20 °C: the two agree. (24) has its minimum, −39.96 mV, at 42.7 °C and falls by 5.2 mV, 0.33 Nm
    by (25), between 20 and 45 °C, where the text says that the reading rises by up to 0.38 Nm.
    b of (9) is a torque, b of (24) a voltage: that of (11).

    Errors are those of least squares under autocorrelated noise (see `flexspline.fit`). The
    voltage is regressed on the reference and the line inverted; (25) regresses the reference on
    the voltage, which noise of the voltage biases towards zero.

    All rows count alike. Where the line bends, or load and unloading part, drift and lag are found
    beside bend and hysteresis, which would else go into them (`calibration/regression.py`). Where
    load and temperature change together they are indistinguishable, which is said; the paper's own
    way, load first and then the drift alone, keeps them apart: ``calibrate(load, degree=0)`` and
    ``calibrate(warm_up, reference=None, into=first.model)``. The sensitivity is taken not to
    depend on temperature, as in (8); where there is load at several, that is tested, and both that
    and a bend are said.

    Zeros. With one zero for all runs, a zero that moved between them goes into the drift; this is
    tested for (`calibration/thermal.py`) and said. With `zero_per_run` errors of reading, and with
    them the figures in %FS, are those of a sensor that is zeroed at the start of each run: each
    run is read with its own zero. Where whole runs are held out (four runs or more), a run that
    was not seen has an unknown zero and is read with the mean of the others', so that its error
    holds the spread of the zeros; blocks are read with the zero of the rest of their run.
    """
    from flexspline.logs.read import as_logs

    runs = as_logs(logs)
    if not runs:
        raise InputError("there is no log to calibrate from; give at least one")
    if into is not None:
        require_model(into, "into")
    asked = Asked(
        reference,
        _degree(degree),
        number(reference_temperature, "reference_temperature", "°C"),
        _or_fit(thermal_lag, "thermal_lag", "s", least=0.0),
        _or_fit(gradient, "gradient", "Nm/K"),
        None if sensitivity is None else _sensitivity(sensitivity),
        None if full_scale is None else above_zero(full_scale, "full_scale", "Nm"),
        _thermistor(thermistor, into),
        bool(zero_per_run),
    )
    _require_sense(asked)
    return calibrated(runs, asked, into)


def require_temperatures(runs: Sequence[CalibrationRun], degree: int) -> None:
    """Refuse a polynomial with more coefficients than the runs hold temperatures."""
    from flexspline.calibration.thermal import count_temperatures
    from flexspline.logs.quantisation import white_noise

    if degree == 0:
        return
    columns = [run.temperature for run in runs if run.temperature is not None]
    count = count_temperatures(columns, max(white_noise(c) for c in columns))
    if count <= degree:
        low, high = min(c.min() for c in columns), max(c.max() for c in columns)
        raise InputError(
            f"the runs hold {count} distinct temperature{'' if count == 1 else 's'} ({low:.4g} to "
            f"{high:.4g} °C, those closer than 0.5 K count as one), a drift of degree {degree} "
            f"needs {degree + 1}; record more temperatures or give a smaller degree "
            "(--degree 0 leaves temperature out)"
        )


def require_rows(runs: Sequence[CalibrationRun], parameters: int) -> None:
    """Refuse what is too short for parameters and a noise model."""
    rows = sum(len(run) for run in runs)
    needed = ROWS_A_PARAMETER * parameters + ROWS_A_RUN * len(runs) + ROWS_BESIDE
    if rows < needed:
        raise InputError(
            f"{_counted(len(runs), 'run')} with {_counted(rows, 'row')} cannot hold "
            f"{_counted(parameters, 'parameter')} and their errors, {needed} rows are needed; "
            "record longer runs"
        )


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _degree(degree: object) -> int:
    from flexspline.estimators.sensing import HIGHEST_DEGREE

    whole = isinstance(degree, int) and not isinstance(degree, bool)
    if not whole or not 0 <= int(str(degree)) <= HIGHEST_DEGREE:
        raise InputError(f"degree = {degree!r}; give a whole number from 0 to {HIGHEST_DEGREE}")
    return int(str(degree))


def _sensitivity(value: Any) -> float:
    found = number(value, "sensitivity", "Nm/V")
    if not 1.0 / IMAGINABLE <= abs(found) <= IMAGINABLE:
        what = "0 reads nothing" if found == 0.0 else f"{found:g} Nm/V is that of no sensor"
        raise InputError(f"sensitivity = {what}; give that of an earlier calibration")
    return found


def _or_fit(value: float | str, name: str, unit: str, least: float = -math.inf) -> float | None:
    if value == FIT:
        return None
    if isinstance(value, str):
        raise InputError(f"{name} = {value!r}; give a number in {unit}, or 'fit' to find it")
    found = number(value, name, unit)
    if found < least:
        raise InputError(f"{name} = {found:g} {unit} is below {least:g}; give {least:g} or more")
    return found


def _thermistor(
    given: Thermistor | Mapping[str, float] | None, into: Model | None
) -> Thermistor | None:
    from flexspline.estimators import Thermistor

    if given is None:
        known = None if into is None else into.estimators.get("thermistor")
        return known if isinstance(known, Thermistor) else None
    return given if isinstance(given, Thermistor) else Thermistor.from_json(given)


def _require_sense(asked: Asked) -> None:
    _require_possible(asked)
    if asked.gradient != 0.0 and asked.thermal_lag == 0.0:
        raise InputError(
            "a gradient is the share of T − T_b, which is zero without a lag; give thermal_lag as "
            "well, in s, or 'fit'"
        )
    if asked.degree == 0 and (asked.thermal_lag != 0.0 or asked.gradient != 0.0):
        raise InputError("degree = 0 leaves temperature out; give a degree of 1 or more for a lag")


def _require_possible(asked: Asked) -> None:
    """Refuse numbers that no sensor has, which overflow further on."""
    low, high = limits_of("temperature")
    for name, value, least, most, unit in (
        ("reference_temperature", asked.reference_temperature, low, high, "°C"),
        ("thermal_lag", asked.thermal_lag, 0.0, IMAGINABLE, "s"),
        ("gradient", asked.gradient, -IMAGINABLE, IMAGINABLE, "Nm/K"),
        ("full_scale", asked.full_scale, 1.0 / IMAGINABLE, IMAGINABLE, "Nm"),
    ):
        if value is not None and not least <= value <= most:
            raise InputError(
                f"{name} = {value:g} {unit} is that of no sensor; give one from {least:g} to "
                f"{most:g} {unit}"
            )


@dataclass(frozen=True)
class _Solved:
    """The regression, what it cannot tell apart, and k (None where it is not known)."""

    made: Regression
    groups: list[Confounded]
    sensitivity: float | None
    why_not: str


def calibrated(logs: Sequence[Log], asked: Asked, into: Model | None) -> CalibrationResult:
    """Calibrate; the arguments have been checked."""
    runs, strange = calibration_runs(
        logs, asked.reference, asked.thermistor, temperature_needed=asked.degree > 0
    )
    if asked.degree == 0:
        runs = [replace(run, temperature=None) for run in runs]
    require_temperatures(runs, asked.degree)
    if asked.zero_per_run:
        require_own_zeros(runs, asked.degree)
    solved = _solved(runs, asked, into)
    validation = cross_validate(runs, solved.made)
    estimators = estimators_of(runs, solved.made, solved.sensitivity, asked, into)
    views = views_of(runs, solved.made, estimators, validation.residuals)
    volts, torques = _parameters(solved)
    result = CalibrationResult(
        model=into or Model({}),
        calibration=estimators.calibration,
        compensation=estimators.compensation,
        voltage_parameters=volts,
        torque_parameters=torques,
        drift_polynomial=drift_polynomial(solved.made),
        confounded=tuple(solved.groups),
        **vars(views),
        full_scale=estimators.full_scale,
        full_scale_source=estimators.full_scale_source,
        sensitivity_reason=solved.why_not,
        validated_by=validation.by,
        fold_rmses=tuple((validation.rmses * (abs(solved.sensitivity or 1.0))).tolist()),
        fold_labels=validation.labels,
        alone=validation.alone,
        instead=validation.instead,
        drift_beside_bend=bool(solved.made.structure),
        bend_taken=solved.made.bend_taken,
        uncertainty=solved.made.uncertainty,
        shape=solved.made.shape,
        zeros=run_zeros(runs, solved.made, solved.sensitivity),
        zero_test=zero_test(runs, solved.made),
        gain_test=gain_test(runs, solved.made),
        delay_test=delay_test(runs, solved.made, asked.reference),
        spiked=tuple(dict.fromkeys(channel for run in runs for channel in run.spiked)),
        warnings=(),
    )
    result = replace(result, warnings=(*strange, *warnings_of(result, runs, solved.made)))
    return replace(result, model=_model(result, estimators, asked, into))


def _solved(runs: Sequence[CalibrationRun], asked: Asked, into: Model | None) -> _Solved:
    """With the sensitivity where the runs determine it, else the drift alone."""
    shape = _shape(asked, runs)
    find_lag = asked.thermal_lag is None
    why_not = why_unexcited(runs)
    if asked.sensitivity is None and not why_not:
        require_rows(runs, len(shape.names) + find_lag)
        made = regress(runs, shape, find_lag=find_lag)
        groups = confounded(made)
        why_not = _why_not(runs, made, groups)
        if not why_not:
            return _Solved(made, groups, _read(made), "")
    known = asked.sensitivity if asked.sensitivity is not None else _known(into)
    held = 0.0 if known is None else (asked.gradient or 0.0)
    shape = replace(shape, sensitivity=False, held_sensitivity=known, held_gradient=held)
    require_rows(runs, len(shape.names) + find_lag)
    _require_something(asked, known, why_not)
    made = regress(runs, shape, find_lag=find_lag)
    return _Solved(made, confounded(made), known, why_not if asked.sensitivity is None else "")


def _why_not(runs: Sequence[CalibrationRun], made: Regression, groups: Sequence[Confounded]) -> str:
    """Why the sensitivity is not determined, "" where it is."""
    together = any("sensitivity" in group.names for group in groups)
    if not sensitivity_determined(made, groups):
        return TOGETHER if together else NOT_FOLLOWED
    error = float(made.uncertainty.standard_errors[0])
    lost = together and abs(lost_to_noise(runs, made)) > PART_OF_ERROR * error
    return TOGETHER if lost else ""


def _read(made: Regression) -> float:
    """k = 1/s, Nm/V."""
    found = 1.0 / float(made.coefficients[0])
    if not 1.0 / IMAGINABLE <= abs(found) <= IMAGINABLE:
        raise InputError(
            f"the runs say {found:.3g} Nm/V, which is the sensitivity of no sensor; check the "
            "units of voltage and reference in the column map"
        )
    return found


def _require_something(asked: Asked, known: float | None, why_not: str) -> None:
    """Refuse runs that show neither sensitivity nor drift."""
    if known is not None:
        return
    if why_not == TOGETHER:
        smaller = ", a smaller degree" if asked.degree > 1 else ""
        raise InputError(
            f"{TOGETHER}, so that the sensitivity and a drift of degree {asked.degree} cannot be "
            "distinguished; add a run with load at a steady temperature, or one without load while "
            f"the temperature changes, or give the sensitivity (--sensitivity){smaller}"
        )
    if asked.degree == 0 and why_not != NOT_FOLLOWED:
        raise InputError(
            f"{why_not} and degree = 0 leaves temperature out, so that there is nothing to "
            "calibrate; add a run with load, or give a degree of 1 or more for the drift alone"
        )


def _shape(asked: Asked, runs: Sequence[CalibrationRun]) -> Shape:
    return Shape(
        asked.degree,
        asked.reference_temperature,
        asked.thermal_lag or 0.0,
        asked.gradient is None,
        asked.gradient or 0.0,
        True,
        None,
        contrast_names(runs) if asked.zero_per_run else (),
    )


def _known(into: Model | None) -> float | None:
    found = None if into is None else into.estimators.get("calibration")
    return _sensitivity(found.sensitivity) if isinstance(found, Calibration) else None


def _parameters(solved: _Solved) -> tuple[tuple[Parameter, ...], tuple[Parameter, ...]]:
    hidden = {name for group in solved.groups for name in group.names}
    volts = voltage_parameters(solved.made, hidden)
    if solved.sensitivity is None:
        return volts, ()
    return volts, torque_parameters(solved.made, solved.sensitivity, hidden)


def _model(
    result: CalibrationResult, estimators: Estimators, asked: Asked, into: Model | None
) -> Model:
    """The model with the estimators and what was known when they were made."""
    model = into or Model({}, _facts(result))
    if estimators.calibration is None:
        return model
    kept = {k: v for k, v in model.estimators.items() if k != "temperature_compensation"}
    record = _record(result, asked)
    made = replace(model, estimators=kept)
    if estimators.thermistor is not None:
        made = made.with_estimator(estimators.thermistor)
    made = made.with_estimator(replace(estimators.calibration, record=record))
    if estimators.compensation is None:
        return made
    return made.with_estimator(estimators.compensation)


def _facts(result: CalibrationResult) -> dict[str, Any]:
    known = ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant")
    facts = result.runs[0].log.facts
    return {key: facts[key] for key in known if key in facts}


def _record(result: CalibrationResult, asked: Asked) -> dict[str, Any]:
    zeros = {"zeros": [asdict(zero) for zero in result.zeros]} if result.zeros else {}
    return dict(
        plain_json(
            {
                "reference": asked.reference,
                "parameters": [p.to_json() for p in result.torque_parameters],
                "volts": [p.to_json() for p in result.voltage_parameters],
                "figures": [asdict(figure) for figure in result.figures],
                "held_out": {
                    "by": result.validated_by,
                    "rmse": result.cv_rmse,
                    "median": result.median_fold,
                    "worst": result.worst_fold,
                },
                "warnings": list(result.warnings),
                "logs": [_log_record(run.log) for run in result.runs],
                **zeros,
            }
        )
    )


def _log_record(log: Log) -> dict[str, Any]:
    return {
        "name": log.name,
        "sha256": log.source.sha256 if log.source else None,
        "rows": len(log),
        "history": list(log.history),
    }
