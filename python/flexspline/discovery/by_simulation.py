"""`discover` by simulation: from a search in the forward simulation to a `Discovery`.

All errors are of the output's angle [rad], driven from the first row to the end by fits that never
counted the row. The noise floor is what its encoder resolves: no simulation gets below it, and what
is left above it is said to be unexplained.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from flexspline.comparison.result import Comparison
from flexspline.comparison.result import assembled as compared_all
from flexspline.comparison.runs import resolution
from flexspline.comparison.search import analysed
from flexspline.discovery.faults import DataFault
from flexspline.discovery.missing import Driven, Missing, Say, Step, search
from flexspline.discovery.result import Discovery, Found, Motion, Unexplained
from flexspline.discovery.slices import HeldRun, compared_motion
from flexspline.effects import Effect
from flexspline.errors import InputError, listed
from flexspline.least_squares.result import Fit
from flexspline.logs.derive import with_motion
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.output_error.assemble import assembled, errors_of
from flexspline.output_error.fitting import require_drive, require_motion
from flexspline.output_error.settings import Settings

__all__ = ["discover_by_simulation"]

CHANNELS = {
    "speed": "output_velocity",
    "direction": "output_velocity",
    "position": "output_position",
    "acceleration": "output_acceleration",
    "load": "reference_torque",
    "reversal_angle": "output_position",
    "reversal_time": "output_velocity",
}
"""Channel of each covariate of a comparison that is not named after its own."""


def discover_by_simulation(
    effects: Sequence[Effect],
    logs: Sequence[Log],
    target: str,
    known_load: str | None,
    fixed: Mapping[str, float],
    exclude: Iterable[str],
    settings: Settings,
    into: Model | None,
    faults: tuple[DataFault, ...],
    say: Say,
) -> Discovery:
    """Find what a drive lacks by the motion that it makes (`missing.py`).

    Parameters
    ----------
    effects : the base, inertia among them.
    into : the model that it is of, or None.
    faults : of the data.

    Raises
    ------
    InputError
        As for a fit by simulation.
    """
    require_drive(effects, target)
    require_motion(logs)
    made = search(effects, logs, target, known_load, fixed, exclude, settings, say)
    say("errors")
    final = made.final
    errors = errors_of(final.cost, final.best.point, [one.point for one in final.without])
    fit = assembled(
        final.regression, final.cost, final.found, final.folds, final.without, errors,
        settings.controller, logs, into,
    )  # fmt: skip
    held = _held(made, logs)
    floor = resolution([run.measured for run in held])
    units = "runs" if final.folds.by == "folds of runs" else "blocks"
    return Discovery(
        target=target,
        unit="rad",
        base_effects=tuple(effect.name for effect in effects),
        found=tuple(_found(step, fit, units) for step in made.steps),
        base_rmse=made.base.rmse,
        final_rmse=final.rmse,
        noise_floor=floor,
        validated_by=units,
        data_faults=faults,
        unexplained=_unexplained(made, held, floor),
        next_experiment=None,
        fit=fit,
        runs=held,
        motion=Motion("output_position", "rad", held),
        not_tried=made.not_tried,
        refused=made.refused,
        doubted=(),
        by="simulation",
    )


def _held(made: Missing, logs: Sequence[Log]) -> tuple[HeldRun, ...]:
    """Measured angle, and what base and extended model make of rows that no fit counted."""
    found = []
    for number, log in enumerate(logs):
        measured = np.asarray(log["output_position"])
        base, final = (
            measured + one.held_out[number] for one in (made.base, made.final)
        )  # held_out is simulated less measured
        found.append(HeldRun(with_motion(log), measured, base, final, None))
    return tuple(found)


def _found(step: Step, fit: Fit, units: str) -> Found:
    """One name with its evidence."""
    before, after = step.before.rmse, step.after.rmse
    lower = int(np.count_nonzero(step.after.sizes() < step.before.sizes()))
    evidence = (
        f"Driven forward through {units} that no fit counted, the simulated angle is off by "
        f"{1e3 * after:.3g} instead of {1e3 * before:.3g} mrad, and by less in {lower} of "
        f"{len(step.after.sizes())} of them (t = {step.t:.1f} over these)."
    )
    return Found(
        effect=step.effect.name,
        rmse_before=before,
        rmse_after=after,
        confidence=step.weight,
        indistinguishable_from=step.alike,
        where=_where(step.before, step.after, fit),
        evidence=evidence,
        t=step.t,
        rivals=(),
    )


def _where(before: Driven, after: Driven, fit: Fit) -> str:
    """The runs in which the motion gains most."""
    names = [run.log.name for run in fit.runs]
    squares = [
        [float(np.nanmean(rows**2)) if np.isfinite(rows).any() else 0.0 for rows in one.held_out]
        for one in (before, after)
    ]
    gained = np.array(squares[0]) - np.array(squares[1])
    most = [names[k] for k in np.argsort(-gained) if gained[k] > 0.5 * gained.max()]
    return f"most in {listed(most)}"


def _unexplained(made: Missing, held: Sequence[HeldRun], floor: float) -> Unexplained | None:
    """What is left above what the encoder resolves, as a share of the base's, and where."""
    first, last = (max(one.rmse**2 - floor**2, 0.0) for one in (made.base, made.final))
    if last == 0.0 or first == 0.0:
        return None
    names = [CHANNELS.get(follow.name, follow.name) for follow in _left(held).follows]
    return Unexplained(min(last / first, 1.0), tuple(dict.fromkeys(names)) or ("time",))


def _left(held: Sequence[HeldRun]) -> Comparison:
    """The comparison of what the extended model leaves."""
    compared = compared_motion(held, "final")
    try:
        return compared_all(compared, analysed(compared, lambda _: None), {})
    except InputError as error:
        raise InputError(f"what the simulation leaves cannot be looked at: {error}") from error
