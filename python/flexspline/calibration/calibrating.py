"""`calibrate`: from voltage, temperature and a reference to estimators with errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from flexspline.calibration.parameters import Asked
from flexspline.errors import InputError

if TYPE_CHECKING:  # what is heavy is imported where it is used
    from flexspline.calibration.result import CalibrationResult
    from flexspline.calibration.runs import CalibrationRun
    from flexspline.estimators import Thermistor
    from flexspline.logs.log import Log
    from flexspline.model import Model

__all__ = ["calibrate"]

ROWS_A_PARAMETER = 3
ROWS_A_RUN = 8  # that the noise model looks back over before it starts
ROWS_BESIDE = 40
FIT = "fit"


def calibrate(
    logs: Log | Sequence[Log],
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

    Returns
    -------
    CalibrationResult
        Prints as a verdict; `.model` holds the estimators.

    Raises
    ------
    InputError
        For missing channels, values that are not finite, a saturated converter, fewer than
        degree + 1 temperatures, or too few rows.

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

    All rows count alike. Where the line bends, and load was applied at one temperature only, a
    part of the bend goes into a drift that is fitted together with it; the paper's own way, load
    first and then the drift alone, keeps them apart: ``calibrate(load, degree=0)`` and
    ``calibrate(warm_up, reference=None, into=first.model)``. The sensitivity is taken not to
    depend on temperature, as in (8).
    """
    from flexspline.calibration.solve import calibrated
    from flexspline.logs.log import Log
    from flexspline.model import Model

    runs = [logs] if isinstance(logs, Log) else list(logs)
    if not runs:
        raise InputError("there is no log to calibrate from; give at least one")
    for run in runs:
        if not isinstance(run, Log):
            raise InputError(
                f"logs holds a {type(run).__name__}; give logs, as read_log makes them"
            )
    if not isinstance(into, Model | None):
        raise InputError(
            f"into is a {type(into).__name__}; give a model, as Model.load or a fit makes it"
        )
    asked = Asked(
        reference,
        _degree(degree),
        _finite(reference_temperature, "reference_temperature", "°C"),
        _or_fit(thermal_lag, "thermal_lag", "s", least=0.0),
        _or_fit(gradient, "gradient", "Nm/K"),
        None if sensitivity is None else _sensitivity(sensitivity),
        None if full_scale is None else _above_zero(full_scale, "full_scale", "Nm"),
        _thermistor(thermistor, into),
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
    from flexspline.estimators.temperature_compensation import HIGHEST_DEGREE

    whole = isinstance(degree, int) and not isinstance(degree, bool)
    if not whole or not 0 <= int(str(degree)) <= HIGHEST_DEGREE:
        raise InputError(f"degree = {degree!r}; give a whole number from 0 to {HIGHEST_DEGREE}")
    return int(str(degree))


def _finite(value: Any, name: str, unit: str) -> float:
    from flexspline.estimators.checks import number

    return number(value, name, unit)


def _above_zero(value: Any, name: str, unit: str) -> float:
    from flexspline.estimators.checks import above_zero

    return above_zero(value, name, unit)


def _sensitivity(value: Any) -> float:
    found = _finite(value, "sensitivity", "Nm/V")
    if found == 0.0:
        raise InputError("sensitivity = 0 reads nothing; give that of an earlier calibration")
    return found


def _or_fit(value: float | str, name: str, unit: str, least: float = -math.inf) -> float | None:
    if value == FIT:
        return None
    if isinstance(value, str):
        raise InputError(f"{name} = {value!r}; give a number in {unit}, or 'fit' to find it")
    found = _finite(value, name, unit)
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
    if asked.gradient != 0.0 and asked.thermal_lag == 0.0:
        raise InputError(
            "a gradient is the share of T − T_b, which is zero without a lag; give thermal_lag as "
            "well, in s, or 'fit'"
        )
    if asked.degree == 0 and (asked.thermal_lag != 0.0 or asked.gradient != 0.0):
        raise InputError("degree = 0 leaves temperature out; give a degree of 1 or more for a lag")
