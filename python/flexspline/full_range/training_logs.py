"""What `train` can work with: model, logs and methods looked at before anything is trained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.full_range.gaussian_process import require_rows
from flexspline.full_range.methods import Signals, with_velocities
from flexspline.full_range.transition import Transition
from flexspline.logs.checks import check
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.part import Part

__all__ = [
    "faults_of",
    "motion_speed_of",
    "require_methods",
    "require_torsion",
    "training_logs",
    "variants_of",
    "warnings_of",
]

Array = NDArray[np.float64]

MOTION_SHARE = 0.02  # of the speed that 99 % of the rows stay below
LEAST_MOTION = 0.01  # rad/s; an elastic gear lets the output creep at some mrad/s under a push
LEAST_SHARE = 0.01  # of the rows, for motion and for standstill
MOST_HELD = 0.5  # of the rows; a gear that is used stays before the end of its law
#: Faults with which the torsion q Ñ − θ is hundreds of rad of nothing.
READ = (
    "output_position",
    "output_velocity",
    "motor_position",
    "motor_velocity",
    "motor_torque",
)


def variants_of(model: Model, parts: Mapping[str, Part] | None) -> dict[str, Model]:
    """Return the model with each torsion part, by name; by "" with its own.

    Raises
    ------
    InputError
        Where the model is none or has no torsion part, or a name is no number.
    """
    if not isinstance(model, Model):
        raise InputError(
            f"model is a {type(model).__name__}; give a model, as fit or Model.load makes it"
        )
    if parts is None:
        model.part("torsion")
        return {"": model}
    if not isinstance(parts, Mapping) or not parts:
        raise InputError("torsion_parts is empty; name at least one part or leave it out")
    for name, part in parts.items():
        if not str(name).isdigit():
            raise InputError(
                f"torsion_parts: '{name}' is no number; name the parts '1', '2', for c1, c2, m1, m2"
            )
        if not isinstance(part, Part):
            raise InputError(
                f"torsion_parts: '{name}' is a {type(part).__name__}; give a part, as "
                "torsion_part_from_datasheet makes it"
            )
    return {
        str(name): replace(model, parts={**model.parts, "torsion": part})
        for name, part in parts.items()
    }


def require_methods(methods: Sequence[str], known: Sequence[str], gp_rows: int) -> None:
    """Refuse a method that does not exist and rows that no Gaussian process can have."""
    for name in methods:
        if name not in known:
            raise InputError(f"there is no method '{name}' to train; give some of {listed(known)}")
    if "gp" in methods:
        require_rows(gp_rows)


def training_logs(logs: Log | Sequence[Log], reference: str, models: Sequence[Model]) -> list[Log]:
    """Return the logs, each with a number in every row of all that is read.

    Raises
    ------
    InputError
        Where there is no log, something else than a log, no reference or one that never changes,
        or a row without a number.
    """
    runs = [logs] if isinstance(logs, Log) else _listed(logs)
    if not runs:
        raise InputError("there is no training log; give at least one")
    for run in runs:
        if not isinstance(run, Log):
            raise InputError(
                f"logs holds a {type(run).__name__}; give logs, as read_log makes them"
            )
        if reference not in run:
            raise InputError(
                f"log '{run.name}': no channel '{reference}'; training needs the true torque at "
                f"the output, it has {listed(run.channels)}"
            )
        _require_numbers(run, {reference, *READ, *_reads(models)})
    truth = np.concatenate([run[reference] for run in runs])
    if np.all(truth == truth[0]):
        raise InputError(
            f"log '{runs[0].name}': {reference} is {truth[0] + 0.0:.3g} Nm in every row, which "
            "says nothing of an external torque; check its column or record a joint that is pushed"
        )
    return runs


def motion_speed_of(runs: Sequence[Log], given: float | None) -> float:
    """Return the speed [rad/s] from which a row counts as moving, with rows on both sides of it.

    Raises
    ------
    InputError
        Where it is not above zero, or the runs hold no motion or no standstill.
    """
    speed = np.abs(np.concatenate([with_velocities(run)["output_velocity"] for run in runs]))
    limit = given
    if limit is None:
        limit = max(LEAST_MOTION, MOTION_SHARE * float(np.quantile(speed, 0.99)))
    if not limit > 0.0:
        raise InputError(f"motion_speed = {limit:g} rad/s; give a speed above zero")
    moving = float(np.mean(speed >= limit))
    if moving < LEAST_SHARE:
        raise InputError(
            f"the training logs hold no motion: {100 * moving:.1f} % of the rows reach "
            f"{limit:.3g} rad/s; add a run in which the joint is driven"
        )
    if 1.0 - moving < LEAST_SHARE:
        raise InputError(
            f"the training logs hold no standstill: {100 * moving:.1f} % of the rows reach "
            f"{limit:.3g} rad/s; add a run that is pushed without moving"
        )
    return limit


def faults_of(runs: Sequence[Log], model: Model) -> list[str]:
    """Return the faults of the logs as sentences.

    A log that states no gear is held against the model's.

    Raises
    ------
    InputError
        Where the torsion of a log is none: a wrapped angle, a motor that turns the other way or a
        ratio that is not the stated one; and for errors of `flexspline.logs.check`.
    """
    said = []
    for run in runs:
        findings = check(Log(run.columns, {**model.facts, **run.facts}))
        findings.raise_forbidding("torsion")
        said += [f"{run.name}: {f.sentence} {f.remedy}".rstrip() for f in findings.faults]
    return said


def require_torsion(signals: Mapping[str, Sequence[Signals]]) -> None:
    """Refuse angles whose difference is no torsion of the gear, by the most of rows.

    Raises
    ------
    InputError
        Where more than `MOST_HELD` of the rows are past the end of a compliance's law.
    """
    for name, its in signals.items():
        held = float(np.mean(np.concatenate([s.saturated for s in its])))
        if held > MOST_HELD:
            raise InputError(
                f"c{name}: in {100 * held:.0f} % of the training rows the torsion is past the end "
                "of the compliance law; look for jumps, the unit or the zero of output_position "
                "and motor_position, or fit the torsion's part to this joint"
            )


def warnings_of(
    transitions: Mapping[str, Transition],
    signals: Mapping[str, Sequence[Signals]],
    truth: Sequence[Array],
    reference: str,
) -> list[str]:
    """Return what is to be known of the transitions, the compliances and the reference's sign."""
    said = [f"{name}: {t.warning}" for name, t in transitions.items() if t.warning]
    for name, its in signals.items():
        held = float(np.mean(np.concatenate([s.saturated for s in its])))
        if held > 0.0:
            said.append(
                f"c{name}: in {100 * held:.2g} % of the training rows the torsion is past the end "
                "of the compliance law; its torque is held there and flagged"
            )
        compliance = np.concatenate([s.compliance for s in its])
        along = float(np.corrcoef(compliance, np.concatenate(truth))[0, 1])
        if along < 0.0:
            said.append(
                f"c{name}: {reference} goes against the compliance (correlation {along:.2f}): it "
                "is positive when the joint pushes the outside in +q; turn its sign, or look at "
                "that of the torsion's part"
            )
    return said


def _listed(logs: object) -> list[Log]:
    try:
        return list(logs)  # type: ignore[call-overload, no-any-return]
    except TypeError:
        raise InputError(
            f"logs holds a {type(logs).__name__}; give logs, as read_log makes them"
        ) from None


def _reads(models: Sequence[Model]) -> set[str]:
    """Channels that the parts for motor torque and torsion read."""
    parts = [
        model.parts[name]
        for model in models
        for name in ("drive", "torsion")
        if name in model.parts
    ]
    return {name for part in parts for effect in part.effects for name in effect.reads}


def _require_numbers(run: Log, names: set[str]) -> None:
    if "motor_torque" not in run:
        names = {*names, "motor_current"}
    for name in (name for name in run.channels if name in names):
        bad = np.flatnonzero(~np.isfinite(run[name]))
        if bad.size:
            raise InputError(
                f"log '{run.name}': {name} is not finite in {bad.size} row"
                f"{'' if bad.size == 1 else 's'}, first in row {bad[0]}; ask for the repair "
                "drop_invalid"
            )
