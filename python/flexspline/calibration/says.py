"""What is to be said of a calibration beside its numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexspline.calibration.regression import Regression
from flexspline.calibration.runs import CalibrationRun
from flexspline.logs.quantisation import white_noise

if TYPE_CHECKING:
    from flexspline.calibration.result import CalibrationResult

__all__ = ["warnings_of"]

ATTENUATES = 0.5  # of the sensitivity's standard error
LAG_SHOWS = 2.0  # thermal hysteresis over what noise would show
MOST_OF_IT = 0.8  # of the full scale
DISAGREES = 0.002  # of the sensitivity


def warnings_of(
    result: CalibrationResult, runs: Sequence[CalibrationRun], made: Regression
) -> list[str]:
    """Return sentences on what may be wrong with the result."""
    return [
        *_undetermined(result),
        *_sign(result),
        *_disagrees(result),
        *_attenuation(result, runs),
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
    slope = float(np.polyfit(result.points.x, result.points.y[:, 0], 1)[0])
    if abs(slope) > DISAGREES:
        own = result.calibration.sensitivity / (1.0 + slope)
        yield (
            f"the runs by themselves say {own:.5g} Nm/V, {100 * abs(slope):.2g} % beside the "
            "sensitivity given; leave it out to fit it"
        )


def _attenuation(result: CalibrationResult, runs: Sequence[CalibrationRun]) -> Iterator[str]:
    """Noise of the reference makes s too small, k too large, by noise²/signal²."""
    loaded = [run.torque for run in runs if run.loaded]
    known = [p for p in result.torque_parameters if p.name == "sensitivity" and p.state == "fitted"]
    if not known or not loaded:
        return
    noise = max(white_noise(torque) for torque in loaded)
    share = noise**2 / float(np.var(np.concatenate(loaded)))
    if share * abs(known[0].value) > ATTENUATES * known[0].standard_error:
        yield (
            f"noise of the reference, {noise:.2g} Nm, makes the sensitivity too large by about "
            f"{100 * share:.2g} %: average the reference, or load higher"
        )


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
