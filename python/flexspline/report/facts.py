"""What a report says of the logs, the joint, and how to make the fit again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flexspline.effects import Effect
from flexspline.formatting.numbers import short
from flexspline.logs.channels import CHANNELS

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit, SimulationFit

__all__ = ["LogFacts", "log_facts", "model_facts", "python_call"]

_WORDS = {
    "gear_ratio": "gear ratio N",
    "output_spline": "output spline",
    "pole_pairs": "pole pairs",
    "torque_constant": "torque constant [Nm/A]",
}


@dataclass(frozen=True)
class LogFacts:
    """One log: name, rows used of all, duration, file, SHA-256, and what was done to it."""

    name: str
    rows: str
    duration: str
    path: str
    sha256: str
    history: tuple[str, ...]


def log_facts(fit: Fit) -> list[LogFacts]:
    """Return what there is to say of each log of a fit."""
    found = []
    for run in fit.runs:
        source = run.log.source
        found.append(
            LogFacts(
                run.log.name,
                f"{int(run.counts.sum())} of {len(run.log)} rows used",
                f"{short(run.log.duration, 4)} s at {short(run.log.rate, 4)} Hz",
                source.path if source else "not from a file",
                source.sha256 if source else "",
                tuple(run.log.history),
            )
        )
    return found


def model_facts(fit: Fit) -> list[tuple[str, str]]:
    """Return facts of the joint and of the fit, by name."""
    found = [(_WORDS.get(k, k.replace("_", " ")), str(v)) for k, v in fit.model.facts.items()]
    load = fit.part.known_load
    corrects = fit.part.simulated
    found += [
        ("target", f"{fit.target} [{fit.unit}]"),
        ("known load", "none" if load is None else load),
        *([] if corrects is None else [("corrects a simulation", corrects.words)]),
        ("low pass, zero phase", "none" if fit.lowpass is None else f"{fit.lowpass:g} Hz"),
        ("condition of the scaled design", short(fit.condition)),
        ("sums", "double-double" if fit.exact else "double"),
    ]
    for name, ends in fit.part.record.get("validity", {}).items():
        unit = CHANNELS[name].unit if name in CHANNELS else "Nm"
        label = f"range of {name.replace('_', ' ')}"
        found.append((label, f"{ends[0]:.4g} to {ends[1]:.4g} {unit}"))
    return found


def python_call(fit: Fit) -> str:
    """Return the call that makes the fit again from the same logs."""
    effects = [effect.name for effect in fit.part.effects]
    lines = [repr(effects), "logs", repr(fit.target)]
    if fit.part.known_load is not None:
        lines.append(f"known_load={fit.part.known_load!r}")
    if fit.lowpass is not None:
        lines.append(f"lowpass={fit.lowpass!r}")
    orders = {e.name: _orders(e) for e in fit.part.effects if e.harmonics}
    fixed = {p.name: p.value for p in fit.parameters if p.state == "fixed"}
    priors = {p.name: p.prior for p in fit.parameters if p.prior is not None}
    for key, value in (("orders", orders), ("fixed", fixed), ("priors", priors)):
        if value:
            lines.append(f"{key}={value!r}")
    if fit.simulation is not None and fit.simulation.controller is not None:
        lines.append(f"controller={fit.simulation.controller!r}")
    name, kind = (
        ("fit", "FitOptions") if fit.simulation is None else ("fit_motion", "MotionOptions")
    )
    options = _fit_options(fit) if fit.simulation is None else _motion_options(fit.simulation)
    if options:
        lines.append(f"options=flexspline.{kind}({', '.join(options)})")
    return f"fit = flexspline.{name}(\n" + "".join(f"    {line},\n" for line in lines) + ")"


def _fit_options(fit: Fit) -> list[str]:
    options = []
    if fit.part.simulated is not None:
        options += ["simulation=simulation"] if fit.part.simulated.own_files else []
        options.append(f"simulated_torque={fit.part.simulated.column!r}")
    if fit.bandwidth is not None:
        told = f"{fit.bandwidth!r}" if math.isfinite(fit.bandwidth) else "float('inf')"
        options.append(f"bandwidth={told}")
    own_offset = f"offset.{fit.runs[0].log.name}"
    if own_offset != "offset.offset" and own_offset in [p.name for p in fit.parameters]:
        options.append("offset_per_run=True")
    return options


def _motion_options(found: SimulationFit) -> list[str]:
    free = [name.removeprefix("controller.") for name in found.names if "controller." in name]
    given = [f"starts={len(found.starts)}", f"folds={len(found.folds)}"]
    return [*given, f"free_controller={free!r}"] if free else given


def _orders(effect: Effect) -> list[int | tuple[int, str]]:
    usual = effect.info.pairs[0]
    return [order if pair == usual else (order, pair) for order, pair in effect.harmonics]
