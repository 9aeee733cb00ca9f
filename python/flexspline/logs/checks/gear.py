"""Motor side against output side: ratio, sense of rotation, delay between the two encoders.

    θ(t) = θ₀ + R q(t) + R δ q̇(t) + h sign q̇(t)

by least squares: R is the ratio, δ the time by which the output's encoder is late (its reading
belongs to an earlier moment than the motor's). A gear's own angle errors are orthogonal to both
over enough turns. h is a hysteresis of the torsion, a step between the directions; one that comes
round gradually would be taken for a part of δ.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexspline.logs.checks.blocks import solve_with_error
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.motion import motion_of
from flexspline.logs.checks.values import unwrapped
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step

RATIO_LIMIT = 0.002
"""Relative deviation of the ratio that is let pass; N and N + 1 differ by more up to N = 400."""

TWIST = 0.005
"""rad at the output that the torsion of a gear under load may turn of itself."""

LEAST_TRAVEL = 10 * TWIST
"""rad of the output, below which the motor's angle says more of torsion than of the ratio."""

TOLD = 4.0  # standard errors of a delay between encoders, from which it is one
DIRECTION = 0.001
"""Half width of the change of direction, as a share of the 95 % speed."""


class Gear(NamedTuple):
    """Ratio R and delay δ [s] of the output's encoder, each with its standard error."""

    ratio: float
    ratio_error: float
    delay: float
    delay_error: float


def measured_gear(log: Log) -> Gear | None:
    """Ratio of motor to output side (with its sign) and the delay between the encoders.

    None without both positions, or where the output hardly moves.
    """
    motion = motion_of(log)
    if motion is None or "motor_position" not in log:
        return None
    motor = unwrapped(log["motor_position"][motion.rows])
    valid = motion.inside(0.0)
    if np.count_nonzero(valid) < 200:
        return None
    v = motion.velocity
    direction = np.tanh(v / max(DIRECTION * float(np.percentile(np.abs(v), 95)), 1e-12))
    design = np.column_stack(
        (motion.position - np.mean(motion.position), v, np.ones(len(v)), direction)
    )[valid]
    solved, error = solve_with_error(design, motor[valid])
    ratio = float(solved[0])
    if ratio == 0:
        return Gear(0.0, float(error[0]), 0.0, float("inf"))
    return Gear(ratio, float(error[0]), float(solved[1] / ratio), float(error[1] / abs(ratio)))


def gear(log: Log) -> Iterator[Finding]:
    """Ratio and sense against the facts, and the delay between the encoders."""
    found = measured_gear(log)
    if found is None:
        return
    angle = unwrapped(log["output_position"])
    travel = float(np.nanmax(angle) - np.nanmin(angle))
    if travel < LEAST_TRAVEL:
        return
    rows = (0, len(log))
    if found.ratio < 0:
        yield Finding(
            "motor_reversed",
            "fault",
            "motor_position",
            rows,
            found.ratio,
            "",
            f"the motor side runs the other way: θ is {found.ratio:.5g} times q.",
            "Ask for the repair reverse_motor.",
        )
    yield from _ratio(log, abs(found.ratio), found.ratio_error, travel)
    step = median_step(log["time"])
    if abs(found.delay) > max(TOLD * found.delay_error, 0.05 * step):
        which = "output_position" if found.delay > 0 else "motor_position"
        yield Finding(
            "encoder_delay",
            "fault",
            which,
            rows,
            abs(found.delay),
            "s",
            f"{which} is {1e3 * abs(found.delay):.3g} ± {1e3 * found.delay_error:.1g} ms late "
            f"against the other encoder: their difference grows with velocity.",
            f"Ask for the repair shift={which}:{abs(found.delay):.3g}.",
        )


def _ratio(log: Log, ratio: float, error: float, travel: float) -> Iterator[Finding]:
    """`travel`: rad of the output, over which a wrong ratio is more than a gear twists."""
    rows, stated = (0, len(log)), log.effective_ratio
    if stated is None:
        yield Finding(
            "gear_ratio_not_stated",
            "note",
            "motor_position",
            rows,
            ratio,
            "",
            f"the motor side turns {ratio:.5g} ± {max(error, 1e-6):.1g} times per turn of the "
            f"output; no gear ratio was stated.",
            f"State gear_ratio={ratio:.5g}.",
        )
    elif abs(ratio / stated - 1) > max(RATIO_LIMIT, 5 * error / stated, TWIST / travel):
        n = float(log.facts["gear_ratio"])
        other = n if log.facts.get("output_spline") == "circular" else n + 1
        fits = abs(ratio / other - 1) <= max(0.1 * RATIO_LIMIT, 5 * error / other)
        yield Finding(
            "gear_ratio",
            "fault",
            "motor_position",
            rows,
            ratio,
            "",
            f"the motor side turns {ratio:.5g} ± {max(error, 1e-6):.1g} times per turn of the "
            f"output, not {stated:.5g} as stated"
            + (": the other spline is the output." if fits else "."),
            f"State output_spline={'flex' if other == n else 'circular'}."
            if fits
            else f"State gear_ratio={ratio:.5g}, or check the encoders' units.",
        )
