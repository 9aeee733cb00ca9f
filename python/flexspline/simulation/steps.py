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

__all__ = ["Choice", "Steps", "run"]

KICKS = {4: 4, 6: 10}  # evaluations of all torques in a step, by its order
WRONG = {4: 6.05e-5, 6: 1.51e-7}  # a frequency's relative error, in units of (ω h)^order
STABLE = {4: 2.98, 6: 3.13}  # ω h at which a method ends (composition.hpp)
ACCURACY = WRONG[4] * 0.25**4  # 25 steps per period of the fastest mode
IN_A_LEAP = 0.1  # share of the accuracy: a leap is some radians of the fastest mode
LOOSER = 33.0  # times the accuracy that is left where a gear grows stiffer under torque
FASTEST_DECAY = 1.5  # decay times h, by the series of a kick
MOST_STEPS = 2e9
FINEST = 1 / 256  # of the step that the gear asks for at rest: 65 thousand times its stiffness
NONE, POLE, NOT_FINITE, UNSTABLE = range(4)

Fields = dict[str, Any]


@dataclass(frozen=True)
class Steps:
    """A run, but for the length of its steps; `longest` is that of its rows, s."""

    time: NDArray[np.float64]
    inputs: dict[str, NDArray[np.float64]]
    hold: bool
    options: Fields
    start: Fields
    channels: Sequence[str]
    longest: float

    def once(
        self,
        joint: _core.SimulatedJoint,
        step: float,
        order: int,
        coarsest: float = math.inf,
        leap: Fields | None = None,
    ) -> Fields:
        """Run with steps of at most `step` seconds, up to where ω h passes `coarsest`.

        With `leap`, power series of its accuracy take the place of all steps but a brake's.
        """
        how = {"longest_step": step, "order": order, "coarsest": coarsest}
        options = {**self.options, **how, **(leap or {})}
        result = _core.simulate(
            joint, self.time, self.inputs, self.hold, options, self.start, list(self.channels)
        )
        result["longest_step"] = result["longest_leap"] if leap else step
        return result


@dataclass(frozen=True)
class Choice:
    """What a caller says about the steps: how many, how good, of which order; None is open."""

    count: int | None = None
    accuracy: float | None = None
    order: int | None = None

    def __post_init__(self) -> None:
        if self.order not in (None, 4, 6):
            raise InputError(f"simulation: order is {self.order!r}; give 4, 6 or None")
        if self.accuracy is None:
            return
        if self.count is not None:
            raise InputError("simulation: accuracy and steps_per_sample are both given; give one")
        if not 1e-13 <= self.accuracy <= 1e-4:
            raise InputError(
                f"simulation: accuracy is {self.accuracy!r}; give a number from 1e-13 to 1e-4"
            )

    def phase(self, order: int) -> float:
        """Return ω h to aim at."""
        wanted = ACCURACY if self.accuracy is None else self.accuracy
        return min(1.2, math.pow(wanted / WRONG[order], 1.0 / order))

    def orders(self, joint: _core.SimulatedJoint) -> tuple[int, ...]:
        """Return the orders to choose from."""
        if self.order == 6 and not joint.eventless:
            raise InputError(
                "simulation: order 6 is for joints in which nothing sticks, slips or touches; give "
                "4 or None"
            )
        if self.order is not None:
            return (self.order,)
        return (4, 6) if joint.eventless and self.count is None else (4,)


def run(joint: _core.SimulatedJoint, steps: Steps, choice: Choice) -> Fields:
    """Run with the caller's steps, by power series, or as the eigenfrequencies ask for.

    Raises
    ------
    InputError
        For steps that cannot be stable, too many of them, or a motion without bound.
    """
    frequency, decay = _core.simulation_rates(joint, 0.0)
    longest = steps.longest
    orders = choice.orders(joint)
    if choice.count is not None:
        step = _given(choice.count, longest, frequency, decay, STABLE[orders[0]])
        result = steps.once(joint, step, orders[0])
    elif joint.expandable and choice.order is None:
        step = _step(choice.phase(4), 4, longest, frequency, decay)
        accuracy = IN_A_LEAP * (choice.accuracy or ACCURACY)
        leap = {"accuracy": accuracy, "shortest_leap": step * FINEST}
        result = _refined(joint, steps, step, 4, choice.phase(4), leap)
    else:
        found = {k: _step(choice.phase(k), k, longest, frequency, decay) for k in orders}
        order = min(orders, key=lambda k: KICKS[k] * math.ceil(longest / found[k] - 1e-9))
        result = _refined(joint, steps, found[order], order, choice.phase(order))
    _require_sound(result, steps)
    return result


def _step(phase: float, order: int, longest: float, frequency: float, decay: float) -> float:
    """Seconds of a step; friction in a step is a series, of which order 6 takes half the way."""
    damped = phase if order == 4 else phase / 2
    return min(longest, phase / frequency, damped / max(decay, 1e-300))


def _given(count: int, longest: float, frequency: float, decay: float, stable: float) -> float:
    if count != int(count) or count < 1:
        raise InputError(
            f"simulation: steps_per_sample is {count!r}; give a whole number of at least 1"
        )
    step = longest / count
    if frequency * step >= stable or decay * step >= FASTEST_DECAY:
        least = int(longest * max(frequency / stable, decay / FASTEST_DECAY)) + 1
        raise InputError(
            f"simulation: {count} steps per sample of {longest:g} s cannot be stable, the joint's "
            f"fastest mode has {frequency:.4g} rad/s and its fastest decay {decay:.4g} 1/s; give "
            f"more than {least}, or None"
        )
    return step


def _refined(
    joint: _core.SimulatedJoint,
    steps: Steps,
    step: float,
    order: int,
    aim: float,
    leap: Fields | None = None,
) -> Fields:
    """Repeat with shorter steps while the gear is stiffer under torque than they allow."""
    span = float(steps.time[-1] - steps.time[0])
    finest = step * FINEST
    coarsest = aim * LOOSER ** (1.0 / order)
    while True:
        if span / step > MOST_STEPS:
            raise InputError(
                f"simulation: {span:g} s would take {span / step:.2g} steps of {step:.2g} s; "
                "simulate a shorter time or a softer gear"
            )
        result = steps.once(joint, step, order, coarsest, leap)
        phase = result["largest_phase"]
        if result["fault"] == NONE and phase <= coarsest:
            return result
        if step <= finest:
            result["fault"] = POLE if result["fault"] in (NONE, UNSTABLE) else result["fault"]
            return result
        grown = math.isfinite(phase) and phase > coarsest
        step = max(finest, step * (max(aim / phase, 1 / 16) if grown else 1 / 4))


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
