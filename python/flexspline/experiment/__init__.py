"""Which run to record next, computed: the excitation that best separates what is confounded.

`plan` has what a rig may do, and the answer; `recording` the runs that labs record, each as a log
that the core reads, `information` what it would tell, `planning` the search. What a discovery or a
fit left open is asked for here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

from flexspline.effects import Effect, effect
from flexspline.errors import InputError, listed, require_kind
from flexspline.experiment.plan import Limits
from flexspline.logs.read import LogLike, as_logs
from flexspline.model import Model, require_model

if TYPE_CHECKING:  # what is heavy is imported where it is used
    from flexspline.experiment.plan import Plan
    from flexspline.least_squares.problem import Problem
    from flexspline.least_squares.result import Fit
    from flexspline.logs.log import Log
    from flexspline.model import Part
    from flexspline.regression.candidate_model import CandidateModel

__all__ = ["next_experiment"]

Pair = tuple[str | Effect, str | Effect]


class Discovery(Protocol):
    """What is asked of one: its fit, and the names found with their rivals."""

    @property
    def fit(self) -> Fit: ...
    @property
    def model(self) -> Model: ...
    @property
    def found(self) -> Sequence[Any]: ...


def next_experiment(
    model_or_discovery: Model | Fit | Discovery,
    rivals: Pair | Iterable[Pair] | None,
    logs: LogLike | Iterable[LogLike],
    *,
    limits: Limits | None = None,
    target: str | None = None,
    lowpass: float | None = None,
) -> Plan | None:
    """Compute the run that best separates causes which the recorded runs confound.

    Parameters
    ----------
    model_or_discovery : the model of these runs; a fit or a discovery has one.
    rivals : pairs of effects, one that the model has and one that may stand in its place; or one
        pair. None: what a discovery declared indistinguishable, and parameters that the fit left
        undetermined.
    logs : the recorded runs.
    limits : what the next run may do; what is left open is what the recorded runs did.
    target : of which part, where the model has several.
    lowpass : Hz, with which the model was fitted; a fit or a discovery tells it.

    Returns
    -------
    Plan, or None where nothing is confounded.

    Raises
    ------
    InputError
        For a pair of which the model has none or both, or that these runs have no channels for.

    Notes
    -----
    Runs of the kinds in `experiment/recording.py` are scored by the t that is expected
    (`experiment/planning.py`), in the noise that the model leaves in the recorded runs. Load
    (of a known load) and temperature are taken to be what a rig can set; give limits of two equal
    numbers for what cannot.
    """
    from flexspline.experiment.planning import planned
    from flexspline.least_squares.result import Fit
    from flexspline.regression.candidate_model import restricted_whitening

    given = model_or_discovery
    require_kind(limits, Limits, "limits")
    if not isinstance(given, Fit) and not hasattr(given, "fit"):
        require_model(given)
    fit = None if isinstance(given, Model) else given if isinstance(given, Fit) else given.fit
    model = given if isinstance(given, Model) else given.model
    part = model.part(target or (fit.target if fit is not None else None))
    pairs = _declared(given) if rivals is None else _asked(rivals, part)
    runs = as_logs(logs)
    cutoff = lowpass or (fit.lowpass if fit is not None else None)
    problem, work = _prepared(part, [rival for _, rival in pairs], runs, cutoff)
    whitening = restricted_whitening(problem, work)
    asked = fit if rivals is None else None
    return planned(problem, work, whitening, pairs, asked, limits)


def _declared(given: Model | Fit | Discovery) -> list[tuple[str, Effect]]:
    """Pairs that a discovery declared indistinguishable."""
    from flexspline.experiment.planning import in_any_run
    from flexspline.least_squares.result import Fit

    if isinstance(given, (Model, Fit)):
        return []
    return [
        (one.effect, in_any_run(one.effect, rival.effect))
        for one in given.found
        for rival in one.rivals
        if rival.name in one.indistinguishable_from
    ]


def _asked(rivals: Pair | Iterable[Pair], part: Part) -> list[tuple[str, Effect]]:
    """Pairs with the name of the model's effect in front, and the rival behind."""
    given = [rivals] if isinstance(rivals, (str, Effect)) else list(rivals)
    single = len(given) == 2 and all(isinstance(one, (str, Effect)) for one in given)
    names, made = [e.name for e in part.effects], []
    own = {e.name: e for e in part.effects if e.own}
    for pair in [given] if single else given:
        if isinstance(pair, (str, Effect)):
            raise InputError(
                f"the rival '{getattr(pair, 'name', pair)}' stands alone; give pairs, an effect of "
                "the model and the one that may stand in its place"
            )
        effects = [_effect(e, own) for e in pair]
        inside = [e for e in effects if e.name in names]
        outside = [e for e in effects if e.name not in names]
        if len(inside) != 1 or len(outside) != 1:
            raise InputError(
                f"of the rivals {listed(e.name for e in effects)} one must be in the model and one "
                f"not; the model has {listed(names)}"
            )
        (rival,) = outside
        if rival.ripple and not rival.harmonics:
            raise InputError(
                f"the rival '{rival.name}' has no orders; give them, as in "
                f"effect('{rival.name}', orders=[1])"
            )
        made.append((inside[0].name, rival.without_load() if part.known_load is None else rival))
    return made


def _effect(given: object, own: Mapping[str, Effect]) -> Effect:
    """An effect as it was given, or by its name: one of the model's own, or of the catalogue."""
    if isinstance(given, Effect):
        return given
    return own.get(str(given)) or effect(str(given))


def _prepared(
    part: Part, rivals: Sequence[Effect], logs: Sequence[Log], lowpass: float | None
) -> tuple[Problem, CandidateModel]:
    """Runs made ready for a model and rivals, and the model with its coefficients."""
    from flexspline.least_squares.problem import problem_of
    from flexspline.logs.derive import with_motion
    from flexspline.regression.candidate_model import candidate_model_of

    if not logs:
        raise InputError("there is no log to look at; give at least one")
    problem = problem_of(
        [with_motion(log) for log in logs],
        [*part.effects, *rivals],
        part.target,
        known_load=part.known_load,
        lowpass_hz=lowpass,
        threads=1,
        carried=part.carried,
    )
    runs = tuple(replace(run, stretches=run.unbroken) for run in problem.runs)
    work = candidate_model_of(part.effects, len(part.effects), {})
    return replace(problem, runs=runs), replace(work, coefficients=part.coefficients.copy())
