"""One case through `discover`, and whether the names are right."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching
from scipy.stats import chi2, norm

import flexspline
from flexspline.discovery.result import Discovery
from flexspline.effects import Effect
from flexspline.least_squares.result import Fit
from hidden.cases import Case
from hidden.gap import closed
from hidden.laws import unseen_errors
from hidden.made import Made, made_of
from hidden.recorded import UnreachableError, recorded
from hidden.rig import LOAD
from hidden.rivals import forms_of
from hidden.verdict import judged_recorded, short_lists

__all__ = [
    "ALIAS",
    "Outcome",
    "judged",
    "left_beside",
    "outcome_of",
    "outcome_recorded",
    "plain_case",
    "stands_for",
    "timed",
    "tried",
]

ALIAS = 3.0  # t that the noise-free term keeps beside a declared alias, for it to be a real one


@dataclass(frozen=True)
class Outcome:
    """A case and what came of it.

    `t_base`: of each hidden term beside the base alone; `closest`: its nearest rival. `means`:
    the hidden effect that each name stands for, "" for a wrong one. `right`: see `judged`.
    `unexplained`: share of the gap, or None. `closed`: share of what the true forms close.
    `seconds`: of processor time.

    Of recorded cases also: `undealt`, the largest t of each term where the size is out of reach
    (nothing is tried then); `wrong`, whether any name or fault is; `also_seen`; `small`, what was
    there besides; `rmse` of each name, before and after it as `discover` reports them; `unseen`,
    the same on runs that nobody saw, with the difference of squares in its standard errors
    (`laws.py`); `told`, whether a coefficient of the name is more than two standard errors from
    zero, and `together`, whether all of them are as surely not zero; `error`, what `discover` or
    its model raised.
    """

    case: Case
    t_base: dict[str, float]
    closest: dict[str, str]
    names: tuple[str, ...]
    aliases: tuple[tuple[str, ...], ...]
    confidences: tuple[float, ...]
    means: tuple[str, ...]
    unexplained: float | None
    faults: tuple[str, ...]
    right: bool
    closed: float | None
    seconds: float
    undealt: dict[str, float] = field(default_factory=dict)
    wrong: bool = False
    also_seen: tuple[str, ...] = ()
    small: tuple[str, ...] = ()
    rmse: tuple[tuple[float, float], ...] = ()
    unseen: tuple[tuple[float, float, float], ...] = ()
    told: tuple[bool, ...] = ()
    together: tuple[bool, ...] = ()
    error: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {"key": self.case.key, **asdict(self)}

    @classmethod
    def from_json(cls, plain: dict[str, Any]) -> Outcome:
        """Return the outcome that `to_json` wrote."""
        own = {name: value for name, value in plain.items() if name != "key"}
        lists = {"names", "aliases", "confidences", "means", "faults", "also_seen",
                 "small", "rmse", "unseen", "told", "together"}  # fmt: skip
        values = {name: _tuples(v) if name in lists else v for name, v in own.items()}
        values["case"] = plain_case(own["case"])
        return cls(**values)


def plain_case(plain: dict[str, Any]) -> Case:
    """Return the case of plain values."""
    return Case(**{name: _tuples(value) for name, value in plain.items()})


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def tried(case: Case) -> Outcome:
    """Run one case through `discover`."""
    if case.recorder != "exact":
        return _tried_recorded(case)
    made = made_of(case)
    return outcome_of(case, made, *timed(case, made))


def _tried_recorded(case: Case) -> Outcome:
    try:
        made = recorded(case)
    except UnreachableError as reason:
        return _silent(case, undealt=reason.largest)
    try:
        return outcome_recorded(case, made, *timed(case, made))
    except Exception as error:  # what a user would see is an outcome, and the next case goes on
        return _silent(case, made=made, error=f"{type(error).__name__}: {error}")


def _silent(
    case: Case,
    *,
    made: Made | None = None,
    undealt: dict[str, float] | None = None,
    error: str = "",
) -> Outcome:
    """The outcome of a case that was not dealt, or that ended in an error."""
    return Outcome(case, made.t_base if made else {}, made.closest if made else {}, (), (), (), (),
                   None, (), False, None, 0.0, undealt=undealt or {}, error=error)  # fmt: skip


def timed(case: Case, made: Made) -> tuple[Discovery, float]:
    """Return what is found, and the seconds of processor time it took."""
    begun = time.process_time()
    load = LOAD if LOAD in made.logs[0] else None
    there = {effect.name for effect in made.base}  # a robot carries its own gravity
    absent = [name for name in case.excluded if name not in there]
    found = flexspline.discover(
        made.base, made.logs, target=case.target, known_load=load, exclude=absent
    )
    return found, time.process_time() - begun


def outcome_of(case: Case, made: Made, found: Discovery, seconds: float) -> Outcome:
    """Judge what was found."""
    fitted = {e.name: e for e in found.model.part(case.target).effects}
    means = stands_for(
        case,
        made,
        [fitted[n] for n in found.names],
        [o.indistinguishable_from for o in found.found],
    )
    left = found.unexplained.share_of_variance if found.unexplained else None
    return Outcome(
        case=case,
        t_base=made.t_base,
        closest=made.closest,
        names=found.names,
        aliases=tuple(one.indistinguishable_from for one in found.found),
        confidences=tuple(one.confidence for one in found.found),
        means=means,
        unexplained=left,
        faults=tuple(fault.name for fault in found.data_faults),
        right=judged(case, means, left is not None),
        closed=closed(made, found.model) if case.nameable else None,
        seconds=seconds,
    )


def outcome_recorded(case: Case, made: Made, found: Discovery, seconds: float) -> Outcome:
    """Judge what was found in a recorded case."""
    assert made.recorder is not None
    fitted = {e.name: e for e in found.model.part(case.target).effects}
    aliases = short_lists([o.indistinguishable_from for o in found.found])
    verdict = judged_recorded(
        case,
        made.recorder,
        made.small,
        found.names,
        aliases,
        stands_for(case, made, [fitted[n] for n in found.names], aliases),
        found.unexplained is not None,
        found.data_faults,
    )
    return replace(
        outcome_of(case, made, found, seconds),
        means=verdict.means,
        wrong=verdict.wrong,
        right=verdict.right,
        also_seen=tuple(one.effect for one in getattr(found, "also_seen", ())),
        small=made.small,
        rmse=tuple((one.rmse_before, one.rmse_after) for one in found.found),
        unseen=unseen_errors(made, found),
        told=tuple(_told(found, name) for name in found.names),
        together=tuple(_together(found.fit, name) for name in found.names),
    )


def _together(fit: Fit, name: str) -> bool:
    """Whether the coefficients of an effect are not all zero, as surely as two standard errors.

    Wald's test of the covariance that is printed, the effect's shapes free.
    """
    known = list(fit.part.record["covariance"]["names"])
    own = [p for p in fit.parameters if p.name.split(".")[0] == name and p.kind == "coefficient"
           and p.name in known]  # fmt: skip
    at = [known.index(p.name) for p in own]
    values, spread = np.array([p.value for p in own]), fit.covariance[np.ix_(at, at)]
    errors = np.sqrt(np.diag(spread))
    if not errors.all():  # known exactly
        return bool(np.any(values[errors == 0.0] != 0.0))
    t = values / errors
    square = float(t @ np.linalg.pinv(spread / np.outer(errors, errors), hermitian=True) @ t)
    return bool(own) and float(chi2.sf(square, len(own))) < 2.0 * float(norm.sf(2.0))


def _told(found: Discovery, name: str) -> bool:
    """Whether a coefficient of an effect is more than two standard errors from zero."""
    own = [p for p in found.parameters(name) if p.kind == "coefficient"]
    return bool(any(abs(p.value) > 2.0 * p.standard_error for p in own))


def judged(case: Case, means: tuple[str, ...], unexplained: bool) -> bool:
    """Whether a case is right.

    Nothing hidden: nothing named. Hidden effects: each named once, and no other. A mismatch of
    form: the same, and nothing "unexplained". A cause without a name: nothing named, and said to
    be unexplained.
    """
    if not case.hidden and not case.unknown:
        return not means
    if not case.nameable:
        return not means and unexplained
    named = "" not in means and set(means) == set(case.nameable)
    return named and not (case.kind == "mismatch" and unexplained)


def stands_for(
    case: Case, made: Made, named: list[Effect], aliases: list[tuple[str, ...]]
) -> tuple[str, ...]:
    """Return the hidden effect that each name stands for, "" for none.

    A name is right where it is hidden, or where it declares what is hidden as an alias and that
    is real: beside base, other terms and the named effect (as fitted, and in every frozen form)
    the hidden term keeps t < ALIAS. Each hidden effect is found once.
    """
    hidden = case.nameable
    exact = {e.name for e in named} & set(hidden)
    fits = np.zeros((len(named), len(hidden)))
    for k, effect in enumerate(named):
        for j, name in enumerate(hidden):
            if effect.name == name:
                fits[k, j] = 1.0
            elif not {effect.name, name} & exact and name in aliases[k]:
                fits[k, j] = left_beside(case, made, name, effect) < ALIAS
    if not fits.size:
        return ("",) * len(named)
    match = maximum_bipartite_matching(csr_array(fits), perm_type="column")
    return tuple(hidden[j] if j >= 0 else "" for j in match)


def left_beside(case: Case, made: Made, name: str, effect: Effect) -> float:
    """t that a hidden term keeps beside base, the other terms and another effect."""
    sizing = made.sizing
    others = [sizing.own(term)[:, None] for n, term in made.terms.items() if n != name]
    own = sizing.own(made.terms[name])
    forms = [effect, *forms_of(effect.name, sizing.scenes[0].joint)]
    return min(sizing.left(own, *others, sizing.beside(form)) for form in forms)
