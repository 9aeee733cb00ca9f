"""What a result is in numbers and names, flat; no sentence is kept.

A float stays a float, written as `repr` does, which is exact; one that is not finite becomes
"nan", "inf" or "-inf". What begins with COST may fall and not rise.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

import flexspline as fx

__all__ = [
    "COST",
    "Cases",
    "NotRunError",
    "Numbers",
    "Value",
    "calibration_numbers",
    "certificate_numbers",
    "column_numbers",
    "comparison_numbers",
    "discovery_numbers",
    "estimate_numbers",
    "fit_numbers",
    "forward_numbers",
    "joined",
    "of",
    "picked",
    "plain",
    "sha",
    "together",
]

Made = TypeVar("Made")
Value = float | int | str
Numbers = dict[str, Value]
Cases = dict[str, Callable[[], Numbers]]

COST = "cost "
COSTS = ("flash_bytes", "code_bytes", "ram_bytes", "stack_bytes", "instructions_per_step",
         "most_instructions", "cycles_per_step")  # fmt: skip


class NotRunError(Exception):
    """What a case needs is not there; the message says what."""


def plain(value: Any) -> Value:
    """Return a Python number or string that JSON holds exactly."""
    if isinstance(value, bool | np.bool_):
        return str(bool(value))
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else str(float(value))
    return "none" if value is None else str(value)


def joined(names: Iterable[object]) -> str:
    """Return names in their order as one string."""
    return ", ".join(map(str, names))


def sha(content: bytes) -> str:
    """Return the SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def picked(label: str, one: object, names: Sequence[str]) -> Numbers:
    """Return attributes of an object under "label name"."""
    return {f"{label} {name}".strip(): plain(getattr(one, name)) for name in names}


def column_numbers(label: str, values: NDArray[Any]) -> Numbers:
    """Return mean, deviation and last of the finite values, how many there are, and the bits.

    A NaN counts as the same whatever its bits are.
    """
    column = np.array(values, dtype=np.float64, order="C")
    column[np.isnan(column)] = np.nan
    finite = column[np.isfinite(column)]
    made: Numbers = {f"{label} finite": len(finite), f"{label} sha256": sha(column.tobytes())}
    if len(finite):
        made[f"{label} mean"] = plain(finite.mean())
        made[f"{label} deviation"] = plain(finite.std())
        made[f"{label} last"] = plain(finite[-1])
    return made


def fit_numbers(fit: fx.Fit) -> Numbers:
    """Return parameters, errors, what is determined, scores and noise."""
    made: Numbers = {"parameters": joined(p.name for p in fit.parameters)}
    made["not determined"] = joined(p.name for p in fit.parameters if not p.determined)
    made["states"] = joined(f"{p.name}: {p.state}" for p in fit.parameters if p.state != "fitted")
    for p in fit.parameters:
        made[p.name] = plain(p.value)
        made[f"{p.name} error"] = plain(p.standard_error)
    for number, variance in enumerate(np.diag(fit.covariance)):  # of those that are free
        made[f"variance {number:02d}"] = plain(variance)
    made |= picked("", fit, ("rmse", "cv_rmse", "condition", "folds", "exact", "generalised"))
    for number, score in enumerate(fit.scores[1:], start=1):
        made[f"score {number:02d} {score.group}"] = plain(score.cv_rmse)
    return made | _noise(fit) | _beside(fit)


def _noise(fit: fx.Fit) -> Numbers:
    """The noise of the target, as the fit models it."""
    noise = fit.uncertainty.noise
    made = picked("noise", noise, ("order", "innovation_variance", "decimation", "samples"))
    made["noise memory"] = plain(noise.memory)
    for number, value in enumerate(noise.coefficients[:4], start=1):
        made[f"noise coefficient {number}"] = plain(value)
    return made


def _beside(fit: fx.Fit) -> Numbers:
    """What is said beside the parameters: preparations, delay, derived and confounded ones."""
    made: Numbers = {"confounded": "; ".join(joined(group.names) for group in fit.confounded)}
    for way in fit.part.preparations:
        made[f"prepared {way.channel} of {way.source}, Hz"] = plain(way.bandwidth)
    if fit.delay is not None:
        made |= picked(f"delay {fit.delay.channel}", fit.delay, ("seconds", "standard_error"))
    for one in fit.derived:
        made |= picked(f"derived {one.name}", one, ("value", "standard_error"))
    if fit.orders is not None:
        made["orders"] = joined(f"{one.order} {one.pair}" for one in fit.orders)
    if fit.simulation is not None:
        made |= picked("simulation", fit.simulation, ("rmse", "held_out", "regression"))
    return made


def discovery_numbers(found: fx.Discovery) -> Numbers:
    """Return the names in order, how sure they are, and what is left on rows no fit saw."""
    made: Numbers = {
        "names": joined(found.names),
        "withdrawn": joined(sorted(found.withdrawn)),
        "refused": joined(sorted(found.refused)),
        "doubted": joined(found.doubted),
        "also seen": joined(one.effect for one in found.also_seen),
        "validated by": found.validated_by,
    }
    made |= picked("", found, ("base_rmse", "final_rmse", "noise_floor", "gap_closed"))
    for one in found.found:
        names = ("confidence", "t", "rmse_before", "rmse_after", "coefficients_p", "share_of_gap")
        made |= picked(one.effect, one, names)
        made[f"{one.effect} aliases"] = joined(one.indistinguishable_from)
        for rival in one.rivals[:2]:
            made |= picked(f"{one.effect} rival {rival.name}", rival, ("gain", "left"))
    for number, fault in enumerate(found.data_faults):
        made[f"fault {number}"] = joined((fault.run, fault.name, fault.channel))
        made |= picked(f"fault {number}", fault, ("size", "makes", "grave"))
    return made | _left(found) | _extended(found)


def _left(found: fx.Discovery) -> Numbers:
    """What no name explains, what is too small to matter, and what would be recorded next."""
    made: Numbers = {f"rows {name}": plain(count) for name, count in found.rows.items()}
    if found.unexplained is not None:
        made["unexplained share"] = plain(found.unexplained.share_of_variance)
        made["unexplained depends on"] = joined(found.unexplained.depends_on)
    for one in found.also_seen:
        made |= picked(f"also seen {one.effect}", one, ("t", "share_of_gap"))
    if found.motion is not None:
        made |= picked("motion", found.motion, ("base_rmse", "final_rmse"))
    for look in () if found.plan is None else found.plan.outlooks:
        made |= picked(f"next run {joined(look.names)}", look, ("now", "expected", "taken"))
    return made


def _extended(found: fx.Discovery) -> Numbers:
    """Parameters of the extended model."""
    made: Numbers = {}
    for p in found.fit.parameters:
        made[p.name] = plain(p.value)
        made[f"{p.name} error"] = plain(p.standard_error)
    return made


def comparison_numbers(made: fx.Comparison) -> Numbers:
    """Return the gap, where it is, and what it follows."""
    whole = ("rmse", "bias", "noise_floor", "noise_floor_error", "excess", "effective_rows")
    numbers = picked("all", made.overall, whole)
    numbers["follows"] = joined(one.name for one in made.follows)
    for one in made.follows:
        numbers |= picked(f"follows {one.name}", one, ("gain", "share", "chance"))
        numbers[f"follows {one.name} also"] = joined(one.also)
    for name, bands in made.by.items():
        for number, band in enumerate(bands):
            numbers |= picked(f"{name} {number}", band, ("rmse", "excess"))
    for peak in made.orders[:10]:
        numbers |= picked(f"order {peak.order:g} {peak.pair}", peak, ("amplitude", "error"))
    memory = ("order", "seconds", "innovation", "velocity")
    return numbers | picked("memory", made.memory, memory)


def calibration_numbers(made: fx.CalibrationResult) -> Numbers:
    """Return parameters in Nm and in V, the drift, the figures and the errors left out."""
    numbers: Numbers = {}
    every = {
        "Nm": made.torque_parameters,
        "V": made.voltage_parameters,
        "drift": made.drift_polynomial,
    }
    for label, parameters in every.items():
        for p in parameters:
            numbers |= picked(f"{label} {p.name}", p, ("value", "standard_error", "state"))
    for figure in made.figures:
        names = ("percent", "torque", "noise", "at")
        numbers |= picked(f"figure {figure.name}", figure, names)
    numbers |= picked("", made, ("rmse", "cv_rmse", "median_fold", "worst_fold", "full_scale"))
    return numbers


def estimate_numbers(made: fx.Estimate) -> Numbers:
    """Return each column in short, and the contacts."""
    numbers: Numbers = {"contacts": len(made.contacts)}
    for name in made.columns:
        numbers |= column_numbers(name, made[name])
    for number, (first, last) in enumerate(made.contacts[:5]):
        numbers |= {f"contact {number} first": first, f"contact {number} last": last}
    return numbers


def forward_numbers(run: fx.ForwardRun) -> Numbers:
    """Return how far the motion is missed, and the motion in short."""
    numbers = picked("", run, ("rmse", "step_error", "steps_per_sample"))
    return numbers | column_numbers("simulated", run.simulated)


def certificate_numbers(made: fx.Certificate) -> Numbers:
    """Return whether bits are the host's, what float costs, and the costs of a step."""
    names = ("device", "compiler", "certified", "samples", "bit_identical", "refused")
    numbers = picked("", made, names)
    numbers["calls"] = joined(made.cost.calls)
    numbers |= {COST + name: plain(getattr(made.cost, name)) for name in COSTS}
    for one in made.outputs:
        kept = ("samples", "different", "largest_ulp", "quantisation", "quantisation_rms")
        numbers |= picked(one.name, one, kept)
    return numbers


def of(result: Callable[[], Made], numbers: Callable[[Made], Numbers]) -> Callable[[], Numbers]:
    """Return what computes a result and gives its numbers."""
    return lambda: numbers(result())


def together(parts: Mapping[str, Numbers]) -> Numbers:
    """Return the numbers of several results, each under its own label."""
    return {f"{label}: {name}": v for label, own in parts.items() for name, v in own.items()}
