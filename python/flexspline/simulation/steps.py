"""How long the inner steps of a simulation are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError

__all__ = ["Steps", "run"]

PHASE = 0.25  # ω h that is aimed at: 25 steps per period of the fastest mode
COARSEST = 0.6  # ω h that is left as it is where a gear grows stiffer under torque
STABLE = 2.98  # ω h at which the method ends (Omelyan et al. 2002); of decay, by its kicks
FASTEST_DECAY = 1.5
MOST_STEPS = 2e9
FINEST = 1 / 256  # of the step that the gear asks for at rest: 65 thousand times its stiffness
NONE, POLE, NOT_FINITE, UNSTABLE = range(4)

Fields = dict[str, Any]


@dataclass(frozen=True)
class Steps:
    """A run, but for the length of its steps."""

    time: NDArray[np.float64]
    inputs: dict[str, NDArray[np.float64]]
    hold: bool
    options: Fields
    start: Fields
    channels: Sequence[str]

    def once(self, joint: _core.SimulatedJoint, step: float) -> Fields:
        """Run with steps of at most `step` seconds."""
        options = {**self.options, "longest_step": step}
        result = _core.simulate(
            joint, self.time, self.inputs, self.hold, options, self.start, list(self.channels)
        )
        result["longest_step"] = step
        return result


def run(joint: _core.SimulatedJoint, steps: Steps, steps_per_sample: int | None) -> Fields:
    """Run with the caller's steps, or with those that the eigenfrequencies ask for.

    Raises
    ------
    InputError
        For steps that cannot be stable, too many of them, or a motion without bound.
    """
    frequency, decay = _core.simulation_rates(joint, 0.0)
    longest = float((steps.time[1:] - steps.time[:-1]).max())
    if steps_per_sample is not None:
        step = _given(steps_per_sample, longest, frequency, decay)
        result = steps.once(joint, step)
    else:
        step = min(longest, PHASE / frequency, PHASE / max(decay, 1e-300))
        result = _refined(joint, steps, step)
    _require_sound(result, steps)
    return result


def _given(count: int, longest: float, frequency: float, decay: float) -> float:
    if count != int(count) or count < 1:
        raise InputError(
            f"simulation: steps_per_sample is {count!r}; give a whole number of at least 1"
        )
    step = longest / count
    if frequency * step >= STABLE or decay * step >= FASTEST_DECAY:
        least = int(longest * max(frequency / STABLE, decay / FASTEST_DECAY)) + 1
        raise InputError(
            f"simulation: {count} steps per sample of {longest:g} s cannot be stable, the joint's "
            f"fastest mode has {frequency:.4g} rad/s and its fastest decay {decay:.4g} 1/s; give "
            f"more than {least}, or None"
        )
    return step


def _refined(joint: _core.SimulatedJoint, steps: Steps, step: float) -> Fields:
    """Repeat with shorter steps while the gear is stiffer under torque than they allow."""
    span = float(steps.time[-1] - steps.time[0])
    finest = step * FINEST
    while True:
        if span / step > MOST_STEPS:
            raise InputError(
                f"simulation: {span:g} s would take {span / step:.2g} steps of {step:.2g} s; "
                "simulate a shorter time or a softer gear"
            )
        result = steps.once(joint, step)
        phase = result["largest_phase"]
        if result["fault"] == NONE and phase <= COARSEST:
            return result
        if step <= finest:
            result["fault"] = result["fault"] or POLE
            return result
        grown = math.isfinite(phase) and phase > COARSEST
        step = max(finest, step * (max(PHASE / phase, 1 / 16) if grown else 1 / 4))


def _require_sound(result: Fields, steps: Steps) -> None:
    fault, row = result["fault"], result["row"]
    if fault == NONE:
        return
    where = f"simulation: after row {row} ({steps.time[row]:.6g} s)"
    if fault == UNSTABLE:
        raise InputError(
            f"{where} the gear is so stiff under its torque that steps of "
            f"{result['longest_step']:.3g} s cannot be stable; give more steps_per_sample, or None"
        )
    if fault == POLE:
        raise InputError(
            f"{where} the gear is wound up to the end of its spring, where its stiffness has no "
            "bound; give smaller torques or speeds, a stable servo, or a smaller mesh_shape"
        )
    raise InputError(
        f"{where} the motion grows without bound; check friction that drives (a negative cubic "
        "or quadratic), servo gains and torques"
    )
