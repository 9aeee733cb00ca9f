"""From an analysis to a `Discovery`: scores on held-out folds, places, sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.analysis import Analysis, Rival, carried_load, contribution
from flexspline.discovery.basis import Functions, channel_told
from flexspline.discovery.candidates import OF_BASE
from flexspline.discovery.confirmation import Confirmed, together
from flexspline.discovery.evidence import equivalent_t
from flexspline.discovery.faults import DataFault
from flexspline.discovery.result import (
    BY_FUNCTIONS,
    BY_MODE,
    BY_NAMES,
    BY_PLACE,
    BY_RUN,
    Discovery,
    Found,
    NoiseFloor,
    Unexplained,
    driven_apart,
)
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.slices import HeldRun
from flexspline.discovery.unexplained import differing
from flexspline.effects import UNITS, Effect
from flexspline.effects.causes import FRICTION_BY_DIRECTION, GRAVITY, ONE_SINE
from flexspline.errors import InputError, listed
from flexspline.experiment.plan import Limits, Plan
from flexspline.experiment.planning import in_any_run, planned
from flexspline.formatting import padded, percent
from flexspline.least_squares.problem import Problem
from flexspline.least_squares.result import wald
from flexspline.least_squares.ripple import CORE_PAIRS
from flexspline.logs.channel_noise import ChannelNoise
from flexspline.orders import Vibration, find_orders, ringing
from flexspline.orders.parts import Candidate, Pair, owner, pairs
from flexspline.prepared import ACCELERATION
from flexspline.regression.candidate_model import held_out, rmse_error, rmse_of
from flexspline.regression.gram import TINY, by_runs, left_by

__all__ = ["assembled", "where"]

Array = NDArray[np.float64]

COVARIATES = {
    "output_velocity": ("rad/s", "", True),
    "known_load": ("Nm", "load ", True),
    "temperature": ("°C", "temperature ", False),
    "motor_temperature": ("°C", "motor temperature ", False),
    "time": ("s", "time ", False),
}
"""Unit of a channel, its words, and whether its size is meant."""
ALWAYS = ("output_velocity", "known_load")  # else of an effect that reads it: all heats up in time


def where(problem: Problem, effect: Effect, parts: list[Array]) -> str:
    """Return where an effect acts, from what it adds to each run, (N,), NaN where none counts."""
    counted = np.isfinite(np.concatenate(parts))
    values = np.concatenate(parts)[counted]

    def channel(name: str) -> Array | None:
        """A channel of the rows that count; None where a run does not have it."""
        own = [run.channels[name] if name in run.channels else run.log[name]
               for run in problem.runs if name in run.channels or name in run.log]  # fmt: skip
        return np.concatenate(own)[counted] if len(own) == len(problem.runs) else None

    velocity = channel("output_velocity")
    sides = [] if velocity is None else [velocity > 0.0, velocity < 0.0]
    # friction lies to either side of the middle between the directions, not about its median
    medians = [np.median(values[side]) for side in sides if side.any()] or [np.median(values)]
    squares = (values - (0.0 if effect.info.traits.constant else np.mean(medians))) ** 2
    own = [c for c in COVARIATES.items() if c[0] in ALWAYS or c[0] in effect.reads]
    places = (_place(channel(name), squares, *told) for name, told in own)
    said = next((place for place in places if place), "")
    ripple = _orders(effect, problem.runs[0].log.facts)
    said = ", ".join(s for s in (ripple, said) if s) or "in all parts of the runs"
    return ", ".join(s for s in (said, _sides(squares, sides), effect.info.reversal) if s)


def _orders(effect: Effect, facts: Mapping[str, object]) -> str:
    """Orders of a ripple effect by pair of parts, and what turns where a fact tells it."""
    said = []
    for pair in dict.fromkeys(pair for _, pair in effect.harmonics):
        own = [order for order, of in effect.harmonics if of == pair]
        known = [p for p in pairs(facts) if CORE_PAIRS[p.name] == pair][:1]
        words = [_told(order, p, facts) for order in own for p in known]
        told = "; ".join(word for word in words if word)
        orders = f"order{'s' if len(own) > 1 else ''} {', '.join(map(str, own))}"
        said.append(f"{orders} of {pair.replace('_', ' ')}{f' ({told})' if told else ''}")
    return ", ".join(said)


def _told(order: int, pair: Pair, facts: Mapping[str, object]) -> str:
    """What has this order by the pole pairs or slots of the motor, "" where nothing known does."""
    _, words = owner(Candidate(order, pair, order * pair.turns), facts, alone=False)
    known = any(fact in words for fact in ("pole pairs", "slots"))
    return f"{order} is {words}" if known else ""


def _place(values: Array | None, squares: Array, unit: str, words: str, size: bool) -> str:
    """The narrowest end of a channel that holds most of the squares, "" where none is narrow."""
    if values is None:
        return ""
    values = np.abs(values) if size else values
    if not np.ptp(values) > 0.0 or not squares.sum() > 0.0:
        return ""
    order = np.argsort(values, kind="stable")
    held = np.cumsum(squares[order]) / squares.sum()
    low = int(np.searchsorted(held, SETTINGS.most))
    high = len(held) - 1 - int(np.searchsorted(held, 1.0 - SETTINGS.most))
    if min(low, high) > 0.5 * len(held):
        return ""
    if low <= high:
        return f"{words}below {values[order[min(low, len(order) - 1)]]:.3g} {unit}"
    return f"{words}above {values[order[len(order) - 1 - high]]:.3g} {unit}"


def _sides(squares: Array, sides: Sequence[NDArray[np.bool_]]) -> str:
    if not sides:
        return ""
    forward, backward = (float(squares[side].sum()) for side in sides)
    if min(forward, backward) >= SETTINGS.little * max(forward + backward, TINY):
        return "both directions"
    return "forward" if forward > backward else "backward"


def assembled(
    held: Confirmed,
    faults: tuple[DataFault, ...],
    inputs: tuple[ChannelNoise, ...],
    rows: Mapping[str, int],
    limits: Limits | None = None,
) -> Discovery:
    """Put everything together that a user sees; `limits`: of the run to record next."""
    made, fit, problem = held.made, held.fit, held.made.context.problem
    steps = held.steps.rmse
    own = rmse_error(held.steps.after, problem.block_rows)
    unexplained, floor = _left_over(made, steps, own) or (
        None,
        NoiseFloor(steps[-1], own, BY_NAMES),
    )
    groups, named = together(steps), [e.name for e in made.final.named]
    found = [
        _found(held, effect, group, (steps[first], steps[last]))
        for first, last in groups
        for group in [made.final.named[first:last]]
        for effect in group
    ]
    pairs = [
        (one.effect, in_any_run(one.effect, rival.effect))
        for one in found
        for rival in one.rivals
        if rival.alias
    ]
    told = {*named, *(name for one in found for name in one.indistinguishable_from)}
    refused = {name: why for name, why in made.searcher.refused.items() if name not in told}
    plan = _as_read(planned(problem, made.final, made.whitening, pairs, fit, limits))
    return Discovery(
        target=problem.target,
        unit=UNITS[problem.target],
        base_effects=tuple(e.name for e in made.base.effects),
        found=tuple(found),
        base_rmse=steps[0],
        final_rmse=steps[-1],
        floor=floor,
        validated_by="runs" if by_runs(problem) else "blocks",
        data_faults=faults,
        unexplained=unexplained,
        next_experiment=plan.sentence if plan else None,
        fit=fit,
        runs=_runs(made, held.steps.before, held.steps.after),
        motion=driven_apart(made, fit.model.facts),
        not_tried=made.context.not_tried,
        refused=refused,
        doubted=tuple(name for name in made.rejected if name not in told | {*refused}),
        plan=plan,
        also_seen=held.also_seen,
        inputs=inputs,
        rows=rows,
        searched=made.searched,
        dependences=made.tied,
        without_directions=_without_directions(made, steps[-1]),
        vibrations=_vibrations(made.part.problem, held.steps.after),
    )


def _vibrations(problem: Problem, left: Sequence[Array]) -> tuple[Vibration, ...]:
    """What stays at one frequency in what is left, (N,) of each run, whatever the speed.

    Of each at least a tenth of the mean square; others are not worth a word.
    """
    looked_at = [np.full(len(values), np.nan) for values in left]
    for values, own, run in zip(looked_at, left, problem.runs, strict=True):
        for first, last in run.stretches:
            values[first:last] = own[first:last]
    logs = [run.log for run in problem.runs]
    try:
        found = find_orders(logs, looked_at, unit=UNITS[problem.target], vibrations=True)
    except InputError:  # nothing moves
        return ()
    least = 2.0 * SETTINGS.little * rmse_of(left) ** 2
    return tuple(one for one in found.vibrations if one.amplitude**2 > least)


def _as_read(plan: Plan | None) -> Plan | None:
    """A plan with the effects of the base under their names."""
    if plan is None:
        return None
    outlooks = tuple(
        replace(one, names=tuple(name.replace(OF_BASE, "") for name in one.names))
        for one in plan.outlooks
    )
    return replace(plan, sentence=plan.sentence.replace(OF_BASE, ""), outlooks=outlooks)


def _without_directions(made: Analysis, rmse: float) -> float | None:
    """The error without friction by direction, from that with it; None where it is in no model.

    What this friction adds to the rows and no other column of the model takes over joins the error.
    """
    problem, work = made.part.problem, made.final
    owners = np.array(work.owners())
    if FRICTION_BY_DIRECTION not in owners:
        return None
    other, rows = np.flatnonzero(owners != FRICTION_BY_DIRECTION), 0
    products = np.zeros((len(other) + 1, len(other) + 1))
    for number, added in enumerate(contribution(problem, work, FRICTION_BY_DIRECTION)):
        counted = np.isfinite(added)
        columns = work.rows(problem, number)[0][:, other]
        both = np.column_stack((columns, added))[counted]
        products += both.T @ both
        rows += int(counted.sum())
    left = left_by(products, np.arange(len(other)))[-1, -1]
    return float(np.sqrt(rmse**2 + max(float(left), 0.0) / rows))


def _runs(made: Analysis, before: Sequence[Array], after: Sequence[Array]) -> tuple[HeldRun, ...]:
    """What both models predict of folds that they never saw, and the load if it is known in Nm."""
    problem, final = made.context.problem, made.final
    loads: Sequence[Array | None] = [run.channels.get("known_load") for run in problem.runs]
    if UNITS[problem.target] == "Nm":
        loads = carried_load(problem, final) or loads
    return tuple(
        HeldRun(run.log, run.target, run.target - base, run.target - last, load)
        for run, base, last, load in zip(problem.runs, before, after, loads, strict=True)
    )


def _left_over(
    made: Analysis, steps: list[float], own: float
) -> tuple[Unexplained, NoiseFloor] | None:
    """What is unexplained, by what tells most of it."""
    found = [by(made, steps, own) for by in (_unexplained, _by_run, _by_mode)]
    best = min((one for one in found if one), key=lambda one: one[1].rmse, default=None)
    return best or _again(made, steps, own)


def _unexplained(
    made: Analysis, steps: list[float], own: float
) -> tuple[Unexplained, NoiseFloor] | None:
    """What functions of the channels tell of what is left, if it matters; and the floor below.

    Where folds go where no other goes, functions lower nothing on them, and all that is left is the
    bound of the noise. `own`: standard error of the last step.
    """
    if not made.leftover.groups or made.unexplained < SETTINGS.bends:
        return None
    told = Unexplained(made.unexplained, tuple(made.leftover.channels))
    problem, rows = made.part.problem, made.fitted_as
    beside = held_out(problem, made.final, rows, Functions(made.leftover.groups))
    scale = steps[-1] / held_out(problem, made.final, rows).rmse
    floor = scale * beside.rmse
    if floor >= steps[-1]:
        return told, NoiseFloor(steps[-1], own, BY_NAMES)
    error = scale * rmse_error(beside.residuals, problem.block_rows)
    return told, NoiseFloor(min(floor, *steps), error, BY_FUNCTIONS)


def _by_run(
    made: Analysis, steps: list[float], own: float
) -> tuple[Unexplained, NoiseFloor] | None:
    """Which effects differ between the runs, if they do; and the floor with sizes of each run."""
    problem = made.context.problem
    found = differing(problem, made.final) if len(problem.runs) > 1 else None
    if found is None:
        return None
    share, floor = _without(found.share, steps, own, BY_RUN)
    return Unexplained(share, ("run",), found.effects), floor


def _by_mode(
    made: Analysis, steps: list[float], own: float
) -> tuple[Unexplained, NoiseFloor] | None:
    """The mode that the motion or the load excites, if it is much of what is left; and the floor.

    It rings on in rows that do not count.
    """
    problem = made.context.problem
    left = [
        (run.log, run.target - made.final.predict(problem, number), run.whole or run.unbroken)
        for number, run in enumerate(problem.runs)
    ]
    known = {way.channel: way.bandwidth for way in problem.preparations}
    asked = filter(None, (ACCELERATION, problem.known_load))
    found = ringing(left, {channel: known.get(channel, np.inf) for channel in asked})
    if found is None:
        return None
    channel, mode = found
    share, floor = _without(mode.share, steps, own, BY_MODE)
    return Unexplained(share, (channel,), rings=mode.frequency), floor


def _without(part: float, steps: list[float], own: float, by: str) -> tuple[float, NoiseFloor]:
    """Share of the gap's mean square and the floor, where `part` of the last step's is no noise."""
    fall, left = part * steps[-1] ** 2, float(np.sqrt(1.0 - part))
    share = fall / max(steps[0] ** 2 - steps[-1] ** 2 + fall, TINY)
    return float(min(share, 1.0)), NoiseFloor(left * steps[-1], left * own, by)


def _again(made: Analysis, steps: list[float], own: float) -> tuple[Unexplained, NoiseFloor] | None:
    """What comes again at the same place in other folds, if it matters; and the floor below it."""
    again = made.again
    if again is None:
        return None
    scale = (steps[-1] / made.after.rmse) ** 2  # of what the search left to what the fit leaves
    fall = scale * again.fall
    share = fall / max(steps[0] ** 2 - steps[-1] ** 2 + fall, TINY)
    if share < SETTINGS.bends:
        return None
    known = made.context.problem.known_load
    channels = dict.fromkeys(channel_told(name, known) for name in again.channels)
    floor = float(np.sqrt(max(steps[-1] ** 2 - fall, 0.0)))
    error = np.hypot(steps[-1] * own, 0.5 * scale * again.error) / max(floor, TINY)
    bound = NoiseFloor(floor, float(error), BY_PLACE)
    return Unexplained(float(min(share, 1.0)), tuple(channels)), bound


def _found(
    held: Confirmed, effect: Effect, group: Sequence[Effect], rmse: tuple[float, float]
) -> Found:
    """A name with its evidence: no more than both the search and the final fit bear out.

    `group`: the names that lower the held-out error together, and `rmse` by how much.
    """
    made, shown = held.made, held.shown[effect.name]
    t = min(shown.t, equivalent_t(*wald(held.fit, effect.name, held=True)))
    found = held.rivals[effect.name]
    most = max(shown.t, *(rival.left for rival in found), TINY)
    counted = t / most if np.isfinite(t) else 1.0  # runs without noise
    rivals = [replace(rival, counted=counted) for rival in found]
    aliases = tuple(rival.name for rival in rivals if rival.alias)
    parts = contribution(made.part.problem, made.final, effect.name)
    return Found(
        effect=effect.name,
        rmse_before=rmse[0],
        rmse_after=rmse[1],
        confidence=held.sure[effect.name].confidence,
        indistinguishable_from=aliases,
        where=where(made.part.problem, effect, parts),
        evidence=_evidence(made, effect, t, rivals, rmse, [e.name for e in group])
        + held.sure[effect.name].doubt,
        t=t,
        rivals=tuple(r for k, r in enumerate(rivals) if k < SETTINGS.tried or r.alias),
        coefficients_p=shown.p,
        share_of_gap=float(np.clip(shown.share, -1.0, 1.0)),
    )


def _many(t: float) -> str:
    """Standard errors; of a log that a simulator wrote without noise they are of rounding alone."""
    return f"{t:.1f}" if t < 1e4 else "more than 10 000"


def _evidence(
    made: Analysis,
    effect: Effect,
    t: float,
    rivals: list[Rival],
    rmse: tuple[float, float],
    group: Sequence[str],
) -> str:
    joined = [name for name in group if name != effect.name]
    beside = f", together with {listed(joined, most=len(joined))}" if joined else ""
    unit = UNITS[made.context.target]
    what = "runs" if by_runs(made.context.problem) else "blocks"
    said = (
        f"On {what} that the fit never saw it takes the error from {padded(rmse[0])} to "
        f"{padded(rmse[1])} {unit}{beside}; beside all other effects it stands {_many(t)} standard "
        "errors from nothing, with the noise's memory counted"
    )
    others = [r for r in rivals if not r.alias]
    if others:
        best = others[0]
        said += (
            f"; the next best in its place, {best.words}, explains "
            f"{percent(best.share)} of that and leaves it t = {best.keeps:.1f}"
        )
    told = [f"{r.words} ({r.why(effect.name)})" for r in rivals if r.alias]
    if told:
        said += f"; these runs do not tell it from {listed(told, most=len(told))}"
    waves = effect.harmonics if GRAVITY in [e.name for e in made.context.possible] else ()
    if ONE_SINE in waves and len(waves) > 1 and GRAVITY not in [e.name for e in made.final.effects]:
        said += f"; order 1 of it may be {GRAVITY}, from which no motion tells it"
    return said + "."
