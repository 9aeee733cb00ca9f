"""From a regression to the parameters whose simulation misses the measured motion least."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from flexspline.effects import Effect
from flexspline.effects.causes import INERTIA
from flexspline.errors import InputError, listed
from flexspline.fitting import fit, runs_of, with_orders
from flexspline.forward.drive import DriveInputs, drive_inputs, require_no_delay
from flexspline.least_squares.options import FitOptions
from flexspline.logs.derive import differentiate
from flexspline.output_error.assemble import errors_of
from flexspline.output_error.cost import (
    Cost,
    best_of,
    by_pieces,
    descend,
    drawn_starts,
    folds_of,
    refitted,
)
from flexspline.output_error.settings import MotionOptions, Settings, settings_of, with_servo_torque
from flexspline.output_error.space import space_of
from flexspline.part import PART_OF
from flexspline.progress import Progress

if TYPE_CHECKING:
    from flexspline.forward.servo import PositionServo
    from flexspline.least_squares.options import Bounds
    from flexspline.least_squares.result import Fit
    from flexspline.logs.log import Log
    from flexspline.logs.read import LogLike
    from flexspline.model import Model

__all__ = ["EVALUATIONS", "cost_of", "fit_motion", "require_drive", "require_motion",
           "starts_of"]  # fmt: skip

STILL = 1e-6  # rad: an output that moves less does not move
ENOUGH = 1e-3  # of the regression's miss: what half the steps may change
MOST_STEPS = 16
EVALUATIONS = 25  # of each descent


def fit_motion(
    effects: str | Effect | Iterable[str | Effect],
    logs: LogLike | Iterable[LogLike],
    target: str,
    *,
    controller: PositionServo | str | os.PathLike[str] | None = None,
    known_load: str | None = None,
    lowpass: float | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, Bounds] | None = None,
    checks: bool = True,
    into: Model | None = None,
    options: MotionOptions | None = None,
) -> Fit:
    """Fit a drive's effects so that the simulated motion is the measured one.

    From the regression that `fit` makes on to the parameters whose forward simulation, from the
    first row to the end, misses the measured output_position least.

    Parameters
    ----------
    effects : as for `fit`; inertia is among them.
    logs : one or several runs of one joint, with output_position [rad].
    target : "motor_torque" [Nm at the output] or "motor_current" [A].
    controller : the servo's law that drives the simulation, or the path of its `servo.json`; None:
        the measured motor torque does. Without a torque channel, `duty` gives the regression's.
    known_load, orders, fixed, bounds, checks, into : as for `fit`.
    lowpass : Hz, of the regression alone; the motion is compared as it is.
    options : what few calls need, see `MotionOptions`.

    Returns
    -------
    Fit; what is said of the motion is in `Fit.simulation`.

    Raises
    ------
    InputError
        As for `fit`; for a target that is not the drive, without inertia or motion, and where a
        scale of all torques is free.

    Notes
    -----
    [Ljung1999], System identification, output-error models.
    """
    how = MotionOptions() if options is None else options
    settings, runs = settings_of(controller, how), runs_of(logs)
    chosen = with_orders(effects, orders or {})
    regression = FitOptions(bandwidth=math.inf, robust=how.robust, threads=how.threads)
    regress = partial(
        fit, chosen, target=target, known_load=known_load, lowpass=lowpass, fixed=fixed,
        bounds=bounds, checks=checks, options=regression,
    )  # fmt: skip
    require_drive(chosen, target)
    require_motion(runs)
    return _best_motion(runs, target, settings, regress, bounds or {}, into)


def _best_motion(
    logs: Sequence[Log],
    target: str,
    settings: Settings,
    regress: Callable[[Sequence[Log]], Fit],
    bounds: Mapping[str, Bounds],
    into: Model | None,
) -> Fit:
    """Descend from the regression, and from around it, to where the motion is missed least."""
    from flexspline.output_error.assemble import assembled

    law = settings.controller
    driven = [log if law is None else with_servo_torque(log, law, target) for log in logs]
    shown = settings.options.progress
    with Progress("fitting the motion", shown, unit=" simulations") as bar:
        bar.say("regression")
        regression = regress(driven)
        cost = cost_of(regression, driven, settings, bounds, bar.step)
        found = []
        for number, start in enumerate(starts_of(cost, regression, settings)):
            bar.say(f"start {number + 1} of {settings.options.starts}")
            found.append(descend(cost, start, EVALUATIONS))
        best = best_of(found)
        bar.say("without each fold")
        folds = folds_of(cost.counts, settings.options.folds)
        without = refitted(cost, best, folds, EVALUATIONS)
        errors = errors_of(cost, best.point, [fold.point for fold in without])
        return assembled(regression, cost, found, folds, without, errors, law, logs, into)


def cost_of(
    regression: Fit,
    driven: Sequence[Log],
    settings: Settings,
    bounds: Mapping[str, Bounds],
    tick: Callable[[], object],
    steps: int | None = None,
) -> Cost:
    """Return the miss of the motion around a regression of `driven` runs, to be descended.

    `steps`: from row to row; None: as many as change little.

    Raises
    ------
    InputError
        Where a scale of all torques is free, and as `drive_inputs`.
    """
    law, target = settings.controller, regression.target
    _require_scale(regression, settings.free)
    space = space_of(regression.part, law, regression.parameters, bounds, settings.free)
    runs = [drive_inputs(regression.model, log, target=target, controller=law) for log in driven]
    cost = Cost(space, runs, [_counts(run) for run in runs], 1, settings.options.threads, tick)
    return replace(cost, steps=_steps(cost) if steps is None else steps)


def starts_of(cost: Cost, regression: Fit, settings: Settings) -> list[Any]:
    """The regression, where pieces of the runs are missed least, and points drawn around it."""
    drawn = drawn_starts(cost, settings.options.starts, settings.options.seed)
    if settings.options.starts == 1:
        return drawn
    velocities = [_velocity(run.log) for run in regression.runs]
    shooting = descend(by_pieces(cost, velocities), cost.space.start, EVALUATIONS)
    return [drawn[0], shooting.point, *drawn[1:-1]]


def _velocity(log: Log) -> Any:
    made = log if "output_velocity" in log else differentiate(log)
    return made["output_velocity"]


def require_drive(effects: Sequence[Effect], target: str) -> None:
    if PART_OF.get(target, "drive") != "drive":
        raise InputError(
            f"a simulated motion is that of a drive, but the target is {target}; give the target "
            "motor_torque or motor_current, or fit the target itself"
        )
    names = [effect.name for effect in effects]
    if INERTIA not in names:
        raise InputError(
            f"a simulated motion needs the effect {INERTIA}, without which nothing can be driven "
            f"forward; the effects are {listed(names) or 'none'}; add it"
        )
    require_no_delay(effects, target)


def require_motion(logs: Sequence[Log]) -> None:
    for log in logs:
        if "output_position" not in log:
            raise InputError(
                f"log '{log.name}': a simulated motion is compared with output_position, which is "
                f"not among {listed(log.channels)}; map a column to it"
            )
    if all(np.ptp(log["output_position"]) < STILL for log in logs):
        raise InputError(
            "no log moves, so no simulated motion can be compared; record runs that move"
        )


def _require_scale(regression: Fit, free: Sequence[str]) -> None:
    """Torques are known by what is fixed in Nm, or by the motor's constant: one of the two."""
    held = [p for p in regression.parameters if p.kind == "coefficient" and p.state == "fixed"]
    if "torque" in free and not any(p.value for p in held):
        raise InputError(
            "the controller's torque scales all coefficients alike, so it can only be fitted where "
            "one of them is known; fix one, such as gravity.sine, or leave torque out"
        )


def _counts(run: DriveInputs) -> Any:
    """Rows that are driven through and measured."""
    driven = np.zeros(len(run.time), dtype=bool)
    for first, last in run.stretches:
        driven[first:last] = True
    return driven & np.isfinite(run.measured)


def _steps(cost: Cost) -> int:
    """Fewest steps from row to row of which twice as many change little beside the miss."""
    point = cost.space.start
    steps, coarse = 1, cost.residuals(point)
    enough = ENOUGH * float(np.sqrt(np.mean(coarse**2)))
    while steps < MOST_STEPS:
        fine = replace(cost, steps=2 * steps).residuals(point)
        if float(np.sqrt(np.mean((fine - coarse) ** 2))) <= enough:
            return steps
        steps, coarse = 2 * steps, fine
    return steps
