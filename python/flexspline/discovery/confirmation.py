"""What a name has to show before it is the answer: in the fit that is returned, and held out.

A search weighs evidence in the metric of the noise. A reader asks plain questions, and a name that
fails one of them is withdrawn:

    Is it significant in the final fit?     Wald's test of its coefficients together, p < α
                                            with its shapes held, t > 2 without
    ... by more than forms of others miss?  χ² of the same test; asked up to a t of 16
    Does it lower the held-out error?       in the unit of the target; where its t exceeds 16, by
                                            more than two standard errors

An order of a ripple that is not significant there goes, and the name goes on without it.

Of an effect that is not there the shapes mean nothing, and where they are hardly known they make
the error of a coefficient large that the runs tell from zero well [Davies1987]. So the test holds
them; but neither may the errors that are printed reach zero.

Nor is it a name where something else is four times as likely: of any, other effects that explain as
much; of the first, what no name explains as well. Where that is more than all names explain held
out, none of them is the answer. Nor is the later of two names whose coefficients are confounded.
Of several names, one that closes less than a form may miss of what all of them close held out, and
less than a hundredth of what is left without it, with a tenth of the t of the largest at most, is
real but too small to matter (`AlsoSeen`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from flexspline.discovery.analysis import Analysis, Rival, in_place_of, rivals_of
from flexspline.discovery.evidence import equivalent_t
from flexspline.discovery.result import (
    FORMED,
    LESSER,
    NOT_LOWER,
    NOT_SIGNIFICANT,
    UNLIKELY,
    UNSETTLED,
    UNTOLD,
    confidence,
    doubt,
)
from flexspline.discovery.search import cost_of, freedom, share_missed
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import Effect
from flexspline.least_squares.linear import UnsettledError
from flexspline.least_squares.options import coefficient_names
from flexspline.least_squares.result import Fit, wald
from flexspline.least_squares.ripple import RippleOrder, ripple_orders
from flexspline.regression.candidate_model import CandidateModel, HeldOut, fall_of, rmse_of

__all__ = ["AlsoSeen", "Confirmed", "Residuals", "Shown", "confirmed", "significance",
           "together"]  # fmt: skip

Array = NDArray[np.float64]
Residuals = tuple[Array, ...]
LeftBy = Callable[[CandidateModel, Fit], Residuals]

LEAST = 1.0 / (1.0 + SETTINGS.tried)  # confidence in a name
SMALL, UNSEEN = "too small to matter", "too small to be seen held out"
UNTRIED = (
    " The confidence is lower for {}, which was not tried and may be what this is: motor_current "
    "explains most of it, and torque_constant is not stated (state 1 where it is not known)."
)
LATE_FRICTION = (
    " The confidence is lower for friction that is as late as the sensor: the lag of the model is "
    "one of its load alone, and such friction explains most of this."
)
ERRORS = 2.0  # standard errors: of the fall of the held-out error, of coefficients as printed


@dataclass(frozen=True)
class AlsoSeen:
    """An effect that is real in these runs, but too small to matter beside what is named.

    `rmse_before`, `rmse_after`: held out, without and with it beside all names, in the target's
    unit. `t`: as `Found.t`. `share_of_gap`: of what all names and it close held out.
    """

    effect: str
    rmse_before: float
    rmse_after: float
    t: float
    share_of_gap: float


@dataclass(frozen=True)
class Shown:
    """What one name shows in the fit that is returned and on rows held out.

    `p`: of Wald's test, its shapes held; `loose`: t with them free. `fall`, `error`: of the
    held-out mean square when the name joins the others, and its standard error. `share`: of what
    all names close. `without`: RMSE without it. `square`: χ² of the same test.
    """

    effect: Effect
    p: float
    t: float
    fall: float
    error: float
    share: float
    without: float
    loose: float = np.inf
    square: float = np.inf

    @property
    def withdrawn(self) -> str:
        """Why it is no answer, "" where it is one."""
        if not (self.p < SETTINGS.alpha and self.loose > ERRORS):
            return NOT_SIGNIFICANT
        if self.fall <= 0.0 or (self.t > SETTINGS.certain and self.fall < ERRORS * self.error):
            return NOT_LOWER
        return ""


@dataclass(frozen=True)
class Sure:
    """Confidence in a name, and what functions that no name explains take from it; "" if little."""

    confidence: float
    doubt: str


@dataclass(frozen=True, eq=False)
class Steps:
    """What `fit` leaves of rows held out, as one name joins after the other.

    The search holds shapes while it leaves out folds; these are the numbers of any fit of the same
    model to the same runs, all in the noise of the last where that is generalised least squares.
    `before`, `after`: of the base and of all names, (N,) of each run. `rmse`: of each model from
    the base on, in the target's unit. Of one whose load does not settle they are the search's.
    """

    before: Residuals
    after: Residuals
    rmse: list[float]


@dataclass(frozen=True)
class Confirmed:
    """The analysis with the names that hold, what each shows, the fit of its model.

    `also_seen`: effects that are real but too small to matter. `rivals`: of each name, best first.
    `sure`: of each name. `steps`: what is left as one name joins after the other.
    """

    made: Analysis
    fit: Fit
    steps: Steps
    shown: Mapping[str, Shown]
    also_seen: tuple[AlsoSeen, ...]
    rivals: Mapping[str, Sequence[Rival]]
    sure: Mapping[str, Sure]


def confirmed(
    made: Analysis,
    fitted: Callable[[CandidateModel], Fit],
    left_by: LeftBy,
    base: Sequence[str],
) -> Confirmed:
    """Withdraw names until each of them holds.

    Parameters
    ----------
    fitted, left_by : make the fit of a model, and what fits of it leave of rows held out, in the
        noise of another fit.
    base : effects that the caller gave; what else the base was given for its form is withdrawn
        too where it is not significant, or lowers the held-out error by no more than chance.
    """
    small: list[Shown] = []
    made = _in_order(_answering(_settled(made, base)))
    while True:
        made, fit = _fitted(made, fitted)
        if fit.generalised != made.generalised:
            before, made = made, _in_order(replace(made, generalised=fit.generalised))
            fit = fit if made.final is before.final else fitted(made.final)
        shown = {one.effect.name: one for one in _all_shown(made, fit)}
        name, why = _weakest(made, fit, [*shown.values()], base)
        if not name and (lean := _without_idle_order(made, fit)):
            made = _answering(lean)
            continue
        if not name:
            rivals = _rivals(made)
            sure = {name: _sure(made, fit, name, own) for name, own in rivals.items()}
            if better := _better_equal(made, rivals):
                made = _answering(better)
                continue
            if unlikely := _unlikely(rivals, sure):
                name, why = unlikely[-1], UNLIKELY
            else:
                steps = _steps(made, fit, left_by)
                rising = _rising([*shown.values()], steps.rmse)
                if rising is None:
                    seen = _also_seen(made, fit, small, steps.rmse[-1], left_by)
                    return Confirmed(made, fit, steps, shown, seen, rivals, sure)
                name, why = rising.effect.name, NOT_LOWER
        if why == SMALL:
            small.append(shown[name])
            made.searcher.refused.pop(name, None)  # of an earlier step
        elif why:
            made.searcher.refused[name] = why
        made = _answering(made.without(name))


def _answering(made: Analysis) -> Analysis:
    """Without its names where more is unexplained than explained: no answer stands beside that."""
    names = [effect.name for effect in made.final.named]
    if not names or made.answers:
        return made
    made.searcher.refused.update(dict.fromkeys(names, LESSER))
    return made.without(*names)


def _fitted(made: Analysis, fitted: Callable[[CandidateModel], Fit]) -> tuple[Analysis, Fit]:
    """The fit, without names that read a load of the model which does not settle beside them.

    The search takes a few rounds from the load of the model before.
    """
    while True:
        try:
            return made, fitted(made.final)
        except UnsettledError:
            reading = [effect.name for effect in made.final.named if "load" in effect.reads]
            if not reading:
                raise
            made.searcher.refused[reading[-1]] = UNSETTLED
            made = made.without(reading[-1])


def _weakest(
    made: Analysis, fit: Fit, shown: Sequence[Shown], base: Sequence[str]
) -> tuple[str, str]:
    """The effect that has to go first, and why; "" where all that were named hold.

    What the base was given goes without a reason.
    """
    if failing := [one for one in shown if one.withdrawn]:
        chance = [one for one in failing if one.withdrawn == NOT_SIGNIFICANT]
        worst = max(chance, key=lambda one: (one.p, -one.share), default=None)
        worst = worst or min(failing, key=lambda one: one.without)
        return worst.effect.name, worst.withdrawn
    if rising := _rising(shown, made.errors):
        return rising.effect.name, NOT_LOWER
    if untold := _untold(fit, shown):
        return untold, UNTOLD
    if little := _too_small(shown):
        least = min(little, key=lambda one: one.share)
        return least.effect.name, SMALL if least.fall > ERRORS * least.error else UNSEEN
    if formed := _left_of_form(made, shown):
        return formed, FORMED
    given = (e.name for e in made.base.effects if e.name not in base)
    return next((n for n in given if not significance(fit, n) < SETTINGS.alpha), ""), ""


def _without_idle_order(made: Analysis, fit: Fit) -> Analysis | None:
    """The analysis less the smallest of several orders of a name that are not significant.

    That is neither as printed nor with the effect's shapes held. None where there is no such order.
    """
    several = {e.name: e for e in made.final.named if len(e.harmonics) > 1}

    def shown(order: RippleOrder) -> bool:
        held = wald(fit, order.effect, held=True, terms=order.names)
        return order.significant or bool(chi2.sf(*held) < SETTINGS.alpha)

    orders = ripple_orders(fit) if several else []
    idle = [order for order in orders if order.effect in several and not shown(order)]
    if not idle:
        return None
    least = min(idle, key=lambda order: order.amplitude)
    effect, own = several[least.effect], (least.order, least.pair)
    return made.with_orders(effect, [h for h in effect.harmonics if h != own])


def _left_of_form(made: Analysis, shown: Sequence[Shown]) -> str:
    """The last name that shows no more in the final fit than forms of others may miss; "" of none.

    What is certain may be small beside a large one, but not what closes most of the gap.
    """
    for one in reversed(shown):
        if one.fall >= SETTINGS.most * made.before.rmse**2:
            continue
        others = [other for other in shown if other is not one]
        shares = (share_missed(o.effect, one.effect, made.tied) * o.square for o in others)
        if one.square < min(SETTINGS.certain**2, max(shares, default=0.0)):
            return one.effect.name
    return ""


def together(errors: Sequence[float]) -> list[tuple[int, int]]:
    """Cut the names, which join one after the other, into groups after which the error is lower.

    `errors`: held out, of the base and with each name more. A group is [first, last) of the names:
    one, or one that raises the error with those that make up for it. Names that nothing makes up
    for are a last group that is not lower.
    """
    groups, first = [], 0
    for last in range(1, len(errors)):
        if errors[last] < errors[first]:
            groups.append((first, last))
            first = last
    return groups if first == len(errors) - 1 else [*groups, (first, len(errors) - 1)]


def _rising(shown: Sequence[Shown], errors: Sequence[float]) -> Shown | None:
    """The weakest name that raises the held-out error as it joins those before it; None of none.

    In a group that lowers it together, each has to do so beside all others beyond chance.
    """
    raised = [
        one
        for first, last in together(errors)
        for one in shown[first:last]
        if errors[last] >= errors[first] or (last - first > 1 and one.fall < ERRORS * one.error)
    ]
    return max(raised, key=lambda one: one.p, default=None)


def _steps(made: Analysis, fit: Fit, left_by: LeftBy) -> Steps:
    before = _left(made, fit, made.base, left_by)
    if not made.final.named:
        return Steps(before, before, [rmse_of(before)])
    between = [rmse_of(_left(made, fit, work, left_by)) for work in made.nested[1:-1]]
    after = tuple(run.held_out for run in fit.runs)
    return Steps(before, after, [rmse_of(before), *between, fit.cv_rmse])


def _left(made: Analysis, fit: Fit, work: CandidateModel, left_by: LeftBy) -> Residuals:
    try:
        return left_by(work, fit)
    except UnsettledError:
        return made.left_by(work).residuals


def _also_seen(
    made: Analysis, fit: Fit, small: Sequence[Shown], without: float, left_by: LeftBy
) -> tuple[AlsoSeen, ...]:
    """Those of the small effects that lower the error held out beside the names, if by little."""
    found = []
    for one in small:
        beside, _ = made.searcher.fitted(made.final.with_effects(one.effect))
        error = rmse_of(_left(made, fit, beside, left_by))
        if error < without:
            share = float(np.clip(one.share, -1.0, 1.0))
            found.append(AlsoSeen(one.effect.name, without, error, one.t, share))
        else:
            made.searcher.refused[one.effect.name] = UNSEEN
    return tuple(found)


def _untold(fit: Fit, shown: Sequence[Shown]) -> str:
    """The later of two names that are confounded as wholes; "" of none."""
    terms = {e.name: set(coefficient_names([e])) for e in (one.effect for one in shown)}
    for group in fit.confounded:
        within = [name for name, own in terms.items() if own <= {*group.names}]
        if len(within) > 1:
            return within[-1]
    return ""


def _rivals(made: Analysis) -> dict[str, list[Rival]]:
    """What else may be in the place of each name, and the channels that tie it to the name."""
    searcher, final = made.searcher, made.final
    return {e.name: rivals_of(searcher, final, e, made.tied) for e in final.named}


def _better_equal(made: Analysis, rivals: Mapping[str, Sequence[Rival]]) -> Analysis | None:
    """The analysis with an effect in the place of a name from which these runs do not distinguish
    it, where it predicts rows held out significantly better; None of none.

    It has no more coefficients: what may follow more may follow what else is missing, too. The same
    to three digits is no better: two forms of one function differ by how well each was solved.
    """
    least = SETTINGS.negligible * made.after.rmse**2
    for named in made.final.named:
        equals = [r.effect for r in rivals[named.name] if r.alias and not r.more]
        for effect in (e for e in equals if freedom(e) <= freedom(named)):
            trial, _ = made.searcher.fitted(in_place_of(made.final, named.name, effect))
            fall, error = _fall(made.after, made.left_by(trial))
            if fall > max(SETTINGS.told * error, least):
                return _in_order(made.of(trial))
    return None


def _sure(made: Analysis, fit: Fit, name: str, rivals: Sequence[Rival]) -> Sure:
    """How sure a name is: no more than both the search and the final fit bear out."""
    dictionary = made.searcher.context.dictionary(made.final, made.searcher.whitening)
    gain, left = dictionary.gain(name), made.leftover
    above = min(gain, wald(fit, name, held=True)[0]) - cost_of(dictionary, made.final, name)
    aliases, untried = sum(r.alias for r in rivals), made.searcher.by_untried(made.final, name)
    retained = left.retained.get(name, 1.0)
    late = made.searcher.by_late_friction(made.final, name)
    sure = confidence(gain, above, retained, left.gain, aliases + bool(untried) + late)
    if sure < LEAST and made.closes_most(name):
        sure = LEAST  # it is no part of what is left, whatever that is
    more = (UNTRIED.format(untried) if untried else "") + (LATE_FRICTION if late else "")
    return Sure(sure, doubt(gain, retained, left.gain, left.channels) + more)


def _unlikely(rivals: Mapping[str, Sequence[Rival]], sure: Mapping[str, Sure]) -> list[str]:
    """Names that others are four times as likely as; what no name explains bars the first alone."""
    among = {name: 1.0 / (1.0 + sum(r.alias for r in own)) for name, own in rivals.items()}
    return [name for number, name in enumerate(rivals)
            if among[name] <= LEAST or (number == 0 and sure[name].confidence < LEAST)]  # fmt: skip


def _too_small(shown: Sequence[Shown]) -> list[Shown]:
    """Those of several names that are too small to matter beside the others."""
    plain = SETTINGS.little * max((one.t for one in shown), default=0.0)
    little = [one for one in shown if one.share < SETTINGS.form and one.t < plain
              and one.fall < SETTINGS.negligible * one.without**2]  # fmt: skip
    return little if len(shown) > 1 else []


def significance(fit: Fit, name: str, *, held: bool = False) -> float:
    """Return p of Wald's test that all fitted coefficients of an effect are zero; 1 of none."""
    return float(chi2.sf(*wald(fit, name, held=held)))


def _all_shown(made: Analysis, fit: Fit) -> list[Shown]:
    if not made.final.named:
        return []
    final, whole = made.final, made.after
    gap = made.before.rmse**2 - whole.rmse**2
    dictionary = made.searcher.context.dictionary(final, made.searcher.whitening)
    shown = []
    for effect in final.named:
        rest = made.left_by(final.without(effect.name))
        fall, error = _fall(rest, whole)
        t = equivalent_t(dictionary.gain(effect.name), len(effect.terms))
        share = fall / gap if gap > 0.0 else 1.0
        square, count = wald(fit, effect.name, held=True)
        p, loose = float(chi2.sf(square, count)), equivalent_t(*wald(fit, effect.name))
        shown.append(Shown(effect, p, t, fall, error, share, rest.rmse, loose, square))
    return shown


def _fall(rest: HeldOut, whole: HeldOut) -> tuple[float, float]:
    """By how much a model with a name more lowers the mean square held out, and its error.

    A fold that goes far beyond all others is predicted badly by every model. Where the mean square
    falls with it too, the fall may be significant on the others alone.
    """
    length = whole.problem.block_rows
    fall, error = fall_of(rest.residuals, whole.residuals, length)
    if not 0.0 < fall < ERRORS * error or len(whole.folds) < SETTINGS.tried:
        return fall, error
    left = [float(np.nansum(whole.residuals[f.run][f.first : f.last] ** 2)) for f in whole.folds]
    less, its_error = fall_of(rest.residuals, _but_fold(whole, int(np.argmax(left))), length)
    return (fall, its_error) if less > ERRORS * its_error else (fall, error)


def _but_fold(held: HeldOut, number: int) -> list[Array]:
    """Residuals held out, (N,) of each run, with NaN in one of the folds."""
    fold, others = held.folds[number], [values.copy() for values in held.residuals]
    others[fold.run][fold.first : fold.last] = np.nan
    return others


def _settled(made: Analysis, base: Sequence[str]) -> Analysis:
    """Take out what the base was given, where it does not lower the held-out error (`_lowers`)."""
    for name in (e.name for e in made.base.effects if e.name not in base):
        if not _lowers(made, name):
            made = made.without(name)
    return made


def _lowers(made: Analysis, name: str) -> bool:
    """Whether what the base was given lowers the held-out error beyond chance.

    It has to do so without the fold that shows it most, too, which may have another reason.
    """
    before, after = made.left_by(made.final.without(name)), made.after
    at = [(fold.run, slice(fold.first, fold.last)) for fold in after.folds]
    falls = [np.nansum(before.residuals[run][rows] ** 2 - after.residuals[run][rows] ** 2)
             for run, rows in at]  # fmt: skip
    others = _but_fold(after, int(np.argmax(falls)))
    length = made.context.problem.block_rows
    both = (fall_of(before.residuals, one, length) for one in (after.residuals, others))
    return all(fall > ERRORS * error for fall, error in both)


def _in_order(made: Analysis) -> Analysis:
    """The names in the order in which each closes most of what is left on rows held out."""
    final = made.final
    if len(final.named) < 2:
        return made
    chosen, rest = [*final.effects[: final.base]], [*final.named]
    while len(rest) > 1:
        errors = [made.left_by(final.having([*chosen, effect])).rmse for effect in rest]
        chosen.append(rest.pop(int(np.argmin(errors))))
    ordered = [*chosen, *rest]
    if ordered == [*final.effects]:
        return made
    return replace(made, final=final.having(ordered))  # the same fit
