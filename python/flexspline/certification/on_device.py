"""What the estimates lose where a device derives velocity and acceleration itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.estimation.chain import estimate
from flexspline.estimation.preprocessing import BANDWIDTH
from flexspline.estimation.result import Estimate
from flexspline.estimators import Differentiator, Estimator, ReadingChecks
from flexspline.estimators.differentiator import DERIVED
from flexspline.formatting import short
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.model import Model

__all__ = ["derived_on_device"]

START = 0.5  # s, of which the filter and the observers behind it remember nothing later
REFERENCE = "reference_torque"


def derived_on_device(model: Model, log: Log) -> tuple[str, ...]:
    """Return a sentence on how far the chain's differentiator moves each external torque [Nm].

    Both runs are the host's chain in double: with the analysis' own velocity and acceleration, and
    with those of the chain's stage. A model that has the stage is compared with one that reads the
    log's channels, or their zero-phase derivative where the log has none; a model without the stage
    gets one in place of the log's channels. Where the log has a reference torque, the sentence has
    the error of both against it.
    """
    made = model.estimators.get("differentiator")
    own = tuple(name for name in DERIVED if name in log)
    if "output_position" not in log or not (own or isinstance(made, Differentiator)):
        return ()
    try:
        if isinstance(made, Differentiator):
            rest = {key: e for key, e in model.estimators.items() if key != made.key}
            whose, channels = _analysis_own(log, made)
            analysed = estimate(replace(model, estimators=rest), channels)
            derived = estimate(model, log)
        else:
            whose = f"the log's own {listed(own)}"
            analysed, derived = estimate(model, log), estimate(_by_angle(model, log, own), log)
    except InputError:
        return ()  # what is wrong with the log is said elsewhere
    moved = _moved(log, analysed, derived)
    filters = [note for note in derived.notes if "causal, " in note]
    if not moved or not filters:  # nothing reads what the filter makes
        return ()
    how = filters[0][filters[0].index("causal, ") :].split("; ")[0]
    return (
        f"with the chain's own filter ({how}) in place of {whose}, and {START:g} s behind each "
        f"start left out, these move: {'; '.join(moved)}",
    )


def _by_angle(model: Model, log: Log, channels: tuple[str, ...]) -> Model:
    """The model with a stage that makes these channels, and without checks of a velocity read."""
    stages: dict[str, Estimator] = {
        "differentiator": Differentiator(min(BANDWIDTH, log.rate / 4.0), channels)
    }
    checks = model.estimators.get("reading_checks")
    if isinstance(checks, ReadingChecks):
        stages["reading_checks"] = replace(checks, way=None, most_acceleration=None)
    return replace(model, estimators={**model.estimators, **stages})


def _analysis_own(log: Log, made: Differentiator) -> tuple[str, Log]:
    """The channels that the stage makes, as the analysis has them; and whose they are."""
    missing = [name for name in made.channels if name not in log]
    if not missing:
        return f"the log's own {listed(made.channels)}", log
    derived = differentiate(log)
    columns = {name: derived[name] for name in missing}
    return f"the zero-phase {listed(missing)}", log.with_columns(columns, note="zero phase")


def _moved(log: Log, analysed: Estimate, derived: Estimate) -> list[str]:
    """Each external torque in words: how far it moves, and both errors."""
    moved, settled = [], _settled(log)
    for name in analysed.columns:
        if not name.startswith("external") or name not in derived:
            continue
        both = settled & np.isfinite(analysed[name]) & np.isfinite(derived[name])
        if not both.any():
            continue
        apart = (analysed[name] - derived[name])[both]
        said = f"{name} by {_rms(apart)} Nm RMS, {short(float(np.abs(apart).max()), 3)} at most"
        known = both & np.isfinite(log[REFERENCE]) if REFERENCE in log else np.zeros_like(both)
        if known.any():
            errors = [_rms((run[name] - log[REFERENCE])[known]) for run in (derived, analysed)]
            said += f" (error against {REFERENCE} {errors[0]} Nm RMS, before {errors[1]} Nm RMS)"
        moved.append(said)
    return moved


def _rms(values: NDArray[np.float64]) -> str:
    return short(float(np.sqrt(np.mean(values**2))), 3)


def _settled(log: Log) -> NDArray[np.bool_]:
    """Rows in which the filter and what is behind it have forgotten their start, (N,)."""
    time = log["time"]
    starts = np.zeros(len(time))
    for first, last in runs(time):
        starts[first:last] = time[first]
    return np.asarray(time - starts >= START)
