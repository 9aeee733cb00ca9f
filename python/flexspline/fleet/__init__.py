"""Fleets of joints: fit, discover and compare for hundreds, and what they have in common.

A folder for each joint with its runs in it is a fleet. Runs are read where they lie, by processes
of this machine or of a Dask cluster:

    made = flexspline.fleet.fit("line7", "sensor_torque", ["offset", "coulomb_friction"])
    print(made)                      # mean, spread, who stands out
    made.model("joint07")            # values of one joint, given its log and the fleet

A run that cannot be used is left out with the sentence that says why; the others go on.

What values shrunk towards the fleet are worth is shown on runs that were held out: the last run of
each joint that has several. All else is made again without these, and each held-out run is judged
by the joint's own fit, by its value given the fleet, and by the fleet's mean. What a fit to the
held-out run itself leaves is taken off, so that the numbers are errors of the model alone.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.errors import InputError, listed
from flexspline.fleet.accumulators import (
    PilotError,
    Plan,
    RunSums,
    accumulators_of,
    plan_of_model,
    plan_of_pilot,
)
from flexspline.fleet.cluster import Workers, done, split_failed
from flexspline.fleet.estimates import Scored, estimate_of, squares_of
from flexspline.fleet.population import LEAST_UNITS, population_of, run_to_run
from flexspline.fleet.result import FleetFit, HeldOut, RunFit, UnitFit
from flexspline.fleet.sessions import Session, Sessions, mean_temperature, sessions_of
from flexspline.lazy import attached
from flexspline.progress import Progress

if TYPE_CHECKING:
    from distributed import Client

    from flexspline.fleet.each_joint import FleetComparison, FleetDiscovery, compare, discover
    from flexspline.model import Model

__all__ = [
    "FleetComparison",
    "FleetDiscovery",
    "FleetFit",
    "Plan",
    "RunSums",
    "Session",
    "Sessions",
    "accumulators_of",
    "compare",
    "discover",
    "fit",
    "fit_sums",
    "mean_temperature",
    "sessions_of",
]

_HOME = {
    "FleetComparison": "each_joint",
    "FleetDiscovery": "each_joint",
    "compare": "each_joint",
    "discover": "each_joint",
}

__getattr__ = attached(__name__, _HOME)

Array = NDArray[np.float64]
Folders = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]

PILOTS = 3  # joints that are asked for shapes and orders, those with most data first
ENOUGH = 4.0
"""Degrees of freedom of a run's estimate, from which it counts for the spread between runs: with
fewer an error may be far too small by chance, and the run would seem to differ."""


def fit(
    folders: Folders | Sessions,
    target: str | None = None,
    effects: str | Effect | Iterable[str | Effect] | None = None,
    *,
    model: Model | None = None,
    pilot: str | None = None,
    known_load: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    per_run: Sequence[str] = (),
    checks: bool = True,
    scheduler: str | Client | None = None,
    workers: int | None = None,
    progress: bool = False,
    **reading: Any,
) -> FleetFit:
    """Fit the same effects to every joint of a fleet, and to the fleet.

    Parameters
    ----------
    folders : trees with a folder for each joint and its runs in it, or what `sessions_of` made of
        them.
    target : as for `fit`; it may be left out where a model has one part.
    effects : names, or `Effect` with shapes and orders. What the runs are to tell of these is told
        by the `pilot`, and held for all.
    model : instead of effects: of a joint, whose shapes and orders are held.
    pilot : name of the joint that tells shapes and orders; by default the one with most data.
    known_load, lowpass, bandwidth, orders, fixed, checks : as for `fit`.
    per_run : terms of which each run has its own value, such as ``["offset"]``; these are no
        parameters of the joint then.
    scheduler : address of a Dask scheduler, or a client; None: processes on this machine.
    workers : how many of these; None: one for each processor; 0: this process alone.
    progress : show what is being done on standard error.
    **reading : `columns`, `dates`, `joints` and all else that `sessions_of` takes.

    Returns
    -------
    FleetFit

    Raises
    ------
    InputError
        Where folders, effects or options are wrong, no run can be used, or fewer than three joints
        are left.

    Examples
    --------
    >>> made = flexspline.fleet.fit("line7", "sensor_torque",         # doctest: +SKIP
    ...     ["offset", "coulomb_friction", "viscous_friction"])
    >>> print(made)                                                   # doctest: +SKIP
    """
    sessions = sessions_from(folders, reading)
    how: dict[str, Any] = {"known_load": known_load, "lowpass": lowpass, "bandwidth": bandwidth}
    how |= {"fixed": dict(fixed or {}), "checks": checks}
    plan, made, failed = summed(
        sessions,
        target,
        effects,
        (model, pilot, orders, tuple(per_run)),
        how,
        Workers(scheduler, workers),
        progress,
    )
    return fit_sums(made, plan, failed, sessions.remarks)


def summed(
    sessions: Sessions,
    target: str | None,
    effects: str | Effect | Iterable[str | Effect] | None,
    shapes_of: tuple[Model | None, str | None, Mapping[str, Sequence[int]] | None, tuple[str, ...]],
    how: Mapping[str, Any],
    workers: Workers,
    progress: bool,
) -> tuple[Plan, list[RunSums], list[tuple[str, str]]]:
    """Return the plan of a fleet, the sums of its runs, and (run, why) of those that have none.

    Parameters
    ----------
    shapes_of : model, pilot, orders and terms of single runs, as `fit` takes them.
    how : the other fields of the plan.

    Raises
    ------
    InputError
        Where effects or options are wrong.
    """
    with Progress("pilot", progress, unit=""):
        plan = _plan(sessions, target, effects, *shapes_of, how)
    with Progress("runs", progress, total=len(sessions), unit="run") as bar:
        made = done(partial(accumulators_of, plan=plan), sessions.sessions, workers, bar)
    return plan, *split_failed([session.label for session in sessions], made)


def sessions_from(folders: Folders | Sessions, reading: Mapping[str, Any]) -> Sessions:
    """Return sessions as they are, or those in folders."""
    if isinstance(folders, Sessions):
        if reading:
            raise InputError(f"the sessions are there already; leave {listed(reading)} out")
        return folders
    return sessions_of(folders, **reading)


def fit_sums(
    runs: Sequence[RunSums],
    plan: Plan,
    failed: Sequence[tuple[str, str]] = (),
    remarks: Sequence[str] = (),
) -> FleetFit:
    """Return the fit of a fleet from the sums of its runs, whoever made them and where.

    Raises
    ------
    InputError
        Where no run can be used, or fewer than three joints are left.
    """
    if not runs:
        why = f"{failed[0][0]}: {failed[0][1]}" if failed else "there are no runs"
        others = " (and no other run can be used)" if len(failed) > 1 else ""
        raise InputError(f"{why}{others}")
    failed = list(failed)
    alone = _each_alone(runs)
    joints, own, between = _joints(runs, alone, failed)
    if len(joints) < LEAST_UNITS:
        rest = f"; {failed[0][0]}: {failed[0][1]}" if failed else ""
        raise InputError(
            f"{listed(joints) if joints else 'no joint'} alone can be used, and a fleet has "
            f"{LEAST_UNITS} joints at least{rest}"
        )
    population = population_of([own[name] for name in joints])
    units = []
    for u, (name, its) in enumerate(joints.items()):
        apart = population.outlying[u]
        shrunken = population.shrunken(own[name], bool(apart.any()))
        units.append(
            UnitFit(
                name,
                tuple(_run_fit(run, alone.get(run.label)) for run in its),
                own[name],
                shrunken,
                apart,
                population.p[u],
                population.expected[u],
                population.expected_error[u],
                its[0].facts,
            )
        )
    return FleetFit(
        plan,
        tuple(units),
        population,
        np.sqrt(between),
        _held_out(runs, alone),
        tuple(failed),
        tuple(remarks),
    )


def _plan(
    sessions: Sessions,
    target: str | None,
    effects: str | Effect | Iterable[str | Effect] | None,
    model: Model | None,
    pilot: str | None,
    orders: Mapping[str, Sequence[int]] | None,
    per_run: tuple[str, ...],
    how: Mapping[str, Any],
) -> Plan:
    if (effects is None) == (model is None):
        raise InputError("give the effects, or the model of a joint that has them: one of the two")
    if model is not None:
        if pilot is not None or orders:
            raise InputError("a model has shapes and orders; leave pilot and orders out")
        label = "shapes and orders are held as the model has them"
        return plan_of_model(model, target, label, own=per_run, **how)
    if target is None or effects is None:
        raise InputError("what is explained is not said; give the target, such as sensor_torque")
    sizes = {name: sum(each.size for each in sessions.of(name)) for name in sessions.units}
    if pilot is not None and pilot not in sizes:
        raise InputError(f"pilot: there is no joint '{pilot}'; the joints are {listed(sizes)}")
    largest = sorted(sizes, key=lambda name: (-sizes[name], name))[:PILOTS]
    errors = []
    for name in [pilot] if pilot is not None else largest:
        try:
            return plan_of_pilot(
                effects, sessions.of(name), target, orders=orders, per_run=per_run, **how
            )
        except PilotError as error:
            errors.append(error)
    raise errors[0]


def _each_alone(runs: Sequence[RunSums]) -> dict[str, Scored]:
    """The estimate of each run by itself, by its label, where it has enough for errors."""
    found = {}
    for run in runs:
        try:
            found[run.label] = estimate_of([run])
        except InputError:
            continue
    return found


def _joints(
    runs: Sequence[RunSums], alone: Mapping[str, Scored], failed: list[tuple[str, str]]
) -> tuple[dict[str, list[RunSums]], dict[str, Scored], Array]:
    """Runs and estimate of each joint that has enough for errors, and the variance between runs."""
    joints: dict[str, list[RunSums]] = {}
    for run in sorted(runs, key=lambda run: (run.unit, run.run)):
        joints.setdefault(run.unit, []).append(run)
    between = _between(joints, alone)
    known, own = np.nan_to_num(between), {}
    for name, its in list(joints.items()):
        try:
            own[name] = estimate_of(its, known)
        except InputError as error:
            failed.append((name, str(error)))
            del joints[name]
    return joints, own, between


def _between(joints: Mapping[str, Sequence[RunSums]], alone: Mapping[str, Scored]) -> Array:
    """Variance of each parameter between runs of a joint, (P,)."""
    several = []
    for its in joints.values():
        known = [alone[run.label] for run in its if run.label in alone]
        if len(known) > 1:
            several.append([_sure(one) for one in known])
    width = next(iter(joints.values()))[0].total.high.shape[1] - 1
    width -= len(next(iter(joints.values()))[0].own)
    return run_to_run(several) if several else np.full(width, np.nan)


def _sure(one: Scored) -> Scored:
    """The estimate, with those parameters determined whose error is known well enough."""
    return replace(one, determined=one.determined & (one.degrees_of_freedom >= ENOUGH))


def _run_fit(run: RunSums, alone: Scored | None) -> RunFit:
    return RunFit(
        run.run,
        run.date,
        run.rows,
        run.seconds,
        run.temperature,
        np.nan if alone is None else alone.rmse,
        run.remarks,
    )


def _held_out(runs: Sequence[RunSums], alone: Mapping[str, Scored]) -> HeldOut | None:
    """How the last run of each joint with several is told by the others; None where none has."""
    joints: dict[str, list[RunSums]] = {}
    for run in sorted(runs, key=_time):
        joints.setdefault(run.unit, []).append(run)
    last = {name: its[-1] for name, its in joints.items() if len(its) > 1}
    last = {name: run for name, run in last.items() if run.label in alone}
    kept = [run for run in runs if last.get(run.unit) is not run]
    others, own, _ = _joints(kept, {run.label: alone[run.label] for run in kept
                                    if run.label in alone}, [])  # fmt: skip
    if len(others) < LEAST_UNITS or not any(name in last for name in others):
        return None
    population = population_of([own[name] for name in others])
    rows = []
    for u, name in enumerate(others):
        if name not in last:
            continue
        run = last[name]
        drawn = population.shrunken(own[name], bool(population.outlying[u].any())).values
        mean = np.where(np.isfinite(population.mean), population.mean, own[name].values)
        least = squares_of(run, alone[run.label].values)
        separate, shrunken, pooled = (
            float(np.sqrt(max(squares_of(run, values) - least, 0.0) / run.rows))
            for values in (own[name].values, drawn, mean)
        )
        seconds = sum(each.seconds for each in others[name])
        rows.append((run.label, run.rows, seconds, separate, shrunken, pooled))
    return HeldOut(tuple(rows))


def _time(run: RunSums) -> tuple[str, bool, str, str]:
    when = "" if run.date is None else run.date.isoformat()
    return run.unit, run.date is not None, when, run.run
