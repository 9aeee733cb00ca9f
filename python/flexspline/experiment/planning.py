"""The search for the run that best resolves what is confounded, within limits.

A run is worth Σ ln(1 + t²) over all questions, with t as it would be with the recorded runs and
this one: to settle one question that was open is worth more than to settle another twice. The runs
of the family are scored one by one, and the best is refined. Of two with the same information the
simpler one is chosen.

Information of a run on a question is the square of the t that is expected. A question has a signal,
a sum of columns, and columns beside which it has to stand. With G the products of all whitened
columns over σ², summed over runs, and s the signal's weights,

    t² = s' G s − (G s)_b' G_bb⁻¹ (G s)_b            b: the model and a rival, in any of its forms

A named effect against a rival has its fitted coefficients as weights: t is that of its noise-free
term after model and rival are projected out. A parameter has the weight one on its own column: t is
the inverse of the standard error that is expected. G of recorded and of planned runs add up.

The noise is that of the recorded runs, at the rate of the planned one. An autoregressive noise has
the spectrum σ² / |A(e^{iω})|². Its part below half of a coarser rate has the autocovariance

    r_k = (1 / π) ∫_0^{π/m} σ² / |A(e^{iω})|² cos(ω m k) dω

at every m-th row, and is autoregressive again (Yule and Walker), so that a slow excitation holds
as much information at the coarser rate as at the recorded one.

Around reversals a model of friction is least exact, and the residual there is larger than the
noise. Where the innovation variance of a band of speed exceeds that of all rows, planned rows at
that speed are weighted by the inverse of the ratio.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.optimize import minimize
from scipy.signal import freqz

from flexspline import _core
from flexspline.effects import CATALOGUE, Effect
from flexspline.effects.causes import GRAVITY, ONE_SINE, OUTPUT_RIPPLE
from flexspline.experiment.plan import (
    ENOUGH,
    TAKEN,
    TIGHTER,
    Bounds,
    Limits,
    Outlook,
    Plan,
    bounds_of,
    short,
)
from flexspline.experiment.recording import (
    Excitation,
    Motor,
    as_problem,
    commanded,
    kinds_for,
    settings,
)
from flexspline.least_squares.options import coefficient_names
from flexspline.least_squares.problem import Problem, Run, coarser
from flexspline.logs.checks.ends import at_work
from flexspline.logs.local_fit import WIDEST
from flexspline.logs.log import Log
from flexspline.logs.segments import true_ranges
from flexspline.parallel import in_order
from flexspline.prepared import MOTION
from flexspline.regression.candidate_model import CandidateModel
from flexspline.regression.gram import SINGULAR, Columns, Whitening, left_by

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = [
    "Bench",
    "at_coarser_rate",
    "in_any_run",
    "planned",
    "refined",
]

MOST_QUESTIONS = 6
TRIED_WIDER = 3
WIDER = 1.3  # times t by doubling a limit, for the limit to be named
SET = ("load", "temperature")  # limits of what stands in the parts of a run, beside its motion

Array = NDArray[np.float64]

IN_ALL_SETTINGS = 3  # motions that are tried at every load and temperature
EVALUATIONS = 60
MOST_TIMES = 5
PLAIN = 0.03  # of ln t², that a step more in what has to be set up has to bring
OFTEN = 3  # where a rival still explains nearly as much then

PIECE = 50_000  # rows
MOST_PIECES = 6

FAST = 100.0  # Hz, what a planned run is looked at with
SLOW = 50.0
OF_A_PERIOD = 8.0  # rows of ripple, at least: its sine is followed to some per cent
POINTS = 1 << 14
MARGIN = 1e-6  # of a rate, that the steps of a planned run's clock are rounded by at most

SHARES = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7)  # of all rows, that are slower than a band's end


def planned(
    problem: Problem,
    work: CandidateModel,
    whitening: Whitening,
    pairs: Sequence[tuple[str, Effect]],
    fit: Fit | None,
    limits: Limits | None = None,
) -> Plan | None:
    """Return the run that settles these pairs, and what a fit left undetermined.

    Parameters
    ----------
    problem, work, whitening : recorded runs, model and noise of a discovery.
    pairs : name of an effect of the model, and the rival, with orders where it has any.
    fit : whose undetermined parameters are asked for; None for no parameter.

    Returns
    -------
    Plan, or None where nothing is confounded.
    """

    pieces, times = pieces_of(problem)
    rivalries = [_rivalry(pieces, work, whitening, a, b) for a, b in pairs[:MOST_QUESTIONS]]
    parameters = _undetermined(fit, pairs)[: MOST_QUESTIONS - len(rivalries)]
    layout = layout_of(work, rivalries, parameters)
    if not layout.questions:
        return None
    reads = sorted({name for e in layout.effects for name in e.reads})
    bounds = bounds_of(problem, limits or Limits(), reads)
    bench = _bench(problem, pieces, times, layout, whitening, reads, bounds.velocity)
    return _plan(bench, bounds, {p.name: p.standard_error for p in fit.parameters} if fit else {})


def in_any_run(named: str, rival: Effect) -> Effect:
    """Return a rival that recorded runs left, with what other runs would let it have.

    Over less than half a turn no order 1 of the output is tried, and a ripple of others stands for
    gravity. A wider run ends that, and order 1 takes their place, which is gravity's own function.
    """
    if named != GRAVITY or rival.name != OUTPUT_RIPPLE or ONE_SINE in rival.harmonics:
        return rival
    return rival.with_orders([ONE_SINE, *rival.harmonics][: _core.max_harmonics])


def _plan(bench: Bench, bounds: Bounds, errors: Mapping[str, float]) -> Plan:
    from flexspline.experiment.plan import plan_sentence
    from flexspline.experiment.recording import RATE, commanded

    ranked = best_of_family(bench, bounds)
    best = refined(bench, bounds, ranked[0])
    gained = bench.gained(commanded(best.excitation, bounds, bench.rate))
    times = bench.repetitions(gained)
    outlooks = [
        _as_fitted(one, errors)
        for one in _outlooks(bench, bounds, bench.before + times * gained, [best, *ranked])
    ]
    log = _trajectory(commanded(best.excitation, bounds, RATE), bench.problem)
    words = best.excitation.words(bounds)
    kinds: dict[str, float] = {}
    for one in sorted([best, *ranked], key=lambda one: -one.t[0]):
        kinds.setdefault(one.excitation.name, one.t[0])
    own_load = bench.problem.known_load is None
    sentence = plan_sentence(bounds.duration, words, outlooks, times, own_load)
    log = log.with_facts({"run": words, "repetitions": times})
    return Plan(sentence, log, tuple(outlooks), kinds, bounds)


def _trajectory(columns: dict[str, np.ndarray], problem: Problem) -> Log:
    from flexspline.logs.log import Log

    named = {"reference_torque" if k == "load" else k: v for k, v in columns.items()}
    known = problem.runs[0].log.facts
    kept = ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant")
    facts = {"name": "next_experiment", **{k: known[k] for k in kept if k in known}}
    return Log(named, facts, ("planned",))


def _outlooks(
    bench: Bench, bounds: Bounds, total: np.ndarray, ranked: Sequence[Scored]
) -> list[Outlook]:
    """What each question stands at with all products (C, C), and what limit binds it."""
    made = []
    for k, (question, before, t) in enumerate(
        zip(bench.layout.questions, bench.now, bench.t(total), strict=True)
    ):
        now, expected = _shown(question, before), _shown(question, t)
        taken = 0.0 if question.parameter else question.taken(total)
        one = Outlook(question.names, now, expected, question.unit, taken, None)
        doubled = None if one.settled else _doubled(bench, bounds, k, t, ranked)
        if doubled is not None:
            name, value, wider = doubled
            one = replace(one, doubled=(name, value, _shown(question, wider)))
        made.append(one)
    return made


def _as_fitted(one: Outlook, errors: Mapping[str, float]) -> Outlook:
    """A parameter's standard errors in the measure of the fit, which trusts its noise model less.

    So what stands now is what the table of parameters says; by how much it falls is the plan's.
    Where columns depend on each other the fit takes the shortest of all solutions, and its errors
    are of that: much smaller than what these runs know of the parameter itself, which is nothing;
    nor would anything be known by a run that tells hardly more.
    """
    fitted = errors.get(one.names[0], np.nan) if one.parameter else np.nan
    if one.parameter and one.now > TIGHTER * fitted:
        reached = one.expected if TIGHTER * one.expected <= one.now else np.inf
        wider = one.doubled if one.doubled and TIGHTER * one.doubled[2] <= one.now else None
        return replace(one, now=np.inf, expected=float(reached), doubled=wider)
    if not (np.isfinite(fitted) and fitted > 0.0 and 0.0 < one.now < np.inf):
        return one
    scale = fitted / one.now
    wider = one.doubled and (*one.doubled[:2], scale * one.doubled[2])
    return replace(one, now=fitted, expected=scale * one.expected, doubled=wider)


def _shown(question: Question, t: float) -> float:
    """t of a pair, the standard error of a parameter."""
    if not question.parameter:
        return t
    return 1.0 / t if t > 0.0 else float("inf")


def _doubled(
    bench: Bench, bounds: Bounds, number: int, reached: float, ranked: Sequence[Scored]
) -> tuple[str, str, float] | None:
    """The limit whose doubling raises a t most: its name, twice its value, t."""
    units = {"position": "rad", "velocity": "rad/s", "acceleration": "rad/s²", "load": "Nm",
             "temperature": "°C", "duration": "s"}  # fmt: skip
    kinds: dict[str, Scored] = {}
    for one in sorted(ranked, key=lambda one: -one.t[number]):
        kinds.setdefault(one.excitation.name, one)
    best: tuple[str, str, float] | None = None
    for field in fields(Limits):
        if getattr(bounds, field.name) is None:
            continue
        wider = bounds.doubled(field.name)
        trials = [one.excitation for one in kinds.values()][:TRIED_WIDER]
        if field.name in SET:  # an excitation holds what is set, as it was
            trials = [replace(one, setting=settings(wider)[0]) for one in trials]
        t = max(bench.scored(one, wider).t[number] for one in trials)
        if t > max(WIDER * reached, best[2] if best else 0.0, 1e-3):
            value = getattr(wider, field.name)
            words = f"{' to '.join(short(v) for v in np.ravel(value))} {units[field.name]}"
            if field.name == "temperature" and bounds.same_temperature is not None:
                words += f" instead of {short(bounds.same_temperature)} °C"
            best = (field.name, words, t)
    return best


def _fastest_ripple(effects: Sequence[Effect], problem: Problem, velocity: float) -> float:
    """Highest frequency of ripple at this speed [rad/s] of the output, Hz; ∞ of no known gear."""
    from flexspline.least_squares.ripple import CORE_PAIRS
    from flexspline.orders.parts import pairs

    turns = {CORE_PAIRS[p.name]: abs(p.turns) for p in pairs(problem.runs[0].log.facts)}
    orders = (order * turns[pair] for e in effects for order, pair in e.harmonics)
    highest = np.max([0.0, *orders])
    return float(np.nan_to_num(highest * velocity / (2.0 * np.pi), nan=np.inf))


def _bench(
    problem: Problem,
    pieces: Problem,
    times: Sequence[float],
    layout: Layout,
    whitening: Whitening,
    reads: Sequence[str],
    velocity: float,
) -> Bench:
    from flexspline.experiment.recording import motor_of

    logs = [run.log for run in problem.runs]
    motor = motor_of(logs, problem.known_load) if "motor_torque" in reads else None
    rate = float(np.median([log.rate for log in logs]))
    asked = [effect for effect in layout.effects if effect.name in layout.asked]
    fastest = _fastest_ripple(asked, problem, velocity)
    coarse, slower = at_coarser_rate(whitening, rate, fastest, problem.lowpass)
    trust = trust_of(pieces, layout.work, whitening)
    before = products(layout, pieces, whitening, trust, times)
    return Bench(problem, layout, coarse, trust, slower, motor, before, _resolved(problem))


def _resolved(problem: Problem) -> float | None:
    """The most by which smoothing further moves a recorded row that counts; None if not looked at.

    The rows that count are those where it is within the noise (`resolved_rows`).
    """
    moved = [
        float(np.abs(run.blur[first:last]).max())
        for run in problem.runs
        if run.blur is not None
        for first, last in run.stretches
    ]
    return max(moved, default=None)


def _only(run: Run, counts: NDArray[np.bool_]) -> Run:
    """The run with those of its rows that count."""
    kept = [
        (first + int(a), first + int(b))
        for first, last in run.stretches
        for a, b in true_ranges(counts[first:last])
    ]
    return replace(run, stretches=tuple(kept), unbroken=tuple(kept), whole=run.unbroken)


def _rivalry(
    problem: Problem, work: CandidateModel, whitening: Whitening, named: str, rival: Effect
) -> Rivalry:
    from flexspline.least_squares.options import SHARED
    from flexspline.regression.candidate_model import refitted, shaped

    others = [e for e in work.effects if e.name != named]
    variants = tuple(shaped(rival, tuple(others), problem))
    fitted = None
    if any(shape.name not in SHARED for shape in rival.fitted_shapes):
        fitted = refitted(problem, work.having([*others, rival]), whitening)[0]
    return Rivalry(named, rival.name, variants, fitted)


def _undetermined(fit: Fit | None, pairs: Sequence[tuple[str, Effect]]) -> list[tuple[str, str]]:
    """Parameters that a fit cannot tell apart, with their unit, but those of the pairs' effects."""
    if fit is None:
        return []
    asked = {name for pair in pairs for name in (pair[0], pair[1].name)}
    confounded = [name for group in fit.confounded for name in group.names]
    return [
        (p.name, p.unit)
        for p in fit.parameters
        if p.name in confounded and p.name.split(".")[0] not in asked
    ]


@dataclass(frozen=True, eq=False)
class Bench:
    """Everything that a planned run is judged by.

    `before`: products (C, C) of recorded runs. `resolved`: by how much a prediction changes at most
    in rows that count, with the motion smoothed further; None where all are resolved.
    """

    problem: Problem
    layout: Layout
    whitening: Whitening
    trust: Trust
    rate: float
    motor: Motor | None
    before: Array
    resolved: float | None = None

    def gained(self, columns: dict[str, Array]) -> Array:
        """Products (C, C) of a planned run."""
        return products(self.layout, self.as_read(columns), self.whitening, self.trust)

    def as_read(self, columns: dict[str, Array]) -> Problem:
        """A planned run with the rows that a fit would count: in motion, and resolved."""
        ways = [way for way in self.problem.preparations if way.channel in MOTION]
        smoothed = partial(as_problem, columns, self.problem, self.layout.effects, self.motor)
        made, further = smoothed(ways), smoothed(coarser(ways))
        moving = at_work([run.log for run in made.runs], made.target)
        kept = []
        for number, run in enumerate(made.runs):
            counts = np.ones(len(run), dtype=bool) if moving is None else moving[number]
            if self.resolved is not None:
                both = (self.layout.work.predict(one, number) for one in (made, further))
                counts = counts & (np.abs(np.subtract(*both)) <= self.resolved)
            kept.append(_only(run, counts))
        return replace(made, runs=tuple(kept))

    @property
    def now(self) -> tuple[float, ...]:
        """t of each question with the recorded runs alone."""
        return self.t(self.before)

    def t(self, total: Array) -> tuple[float, ...]:
        """t of each question that these products promise."""
        return tuple(float(np.sqrt(q.information(total))) for q in self.layout.questions)

    def scored(self, excitation: Excitation, bounds: Bounds) -> Scored:
        """Judge one planned run."""
        t = self.t(self.before + self.gained(commanded(excitation, bounds, self.rate)))
        values = [abs(q.value) if q.parameter else 1.0 for q in self.layout.questions]
        worth = sum(np.log1p((v * x) ** 2) for v, x in zip(values, t, strict=True))
        plain = PLAIN * (excitation.kind.steps + len(excitation.setting.parts))
        return Scored(excitation, t, float(worth) - plain)

    def repetitions(self, gained: Array) -> int:
        """How often a run has to be recorded until no rival explains nearly as much (`aliases`)."""
        for times in range(1, MOST_TIMES + 1):
            total = self.before + times * gained
            if all(q.parameter or q.taken(total) < TAKEN for q in self._within_reach(total)):
                return times
        return OFTEN

    def _within_reach(self, total: Array) -> list[Question]:
        pairs = zip(self.layout.questions, self.t(total), strict=True)
        return [question for question, t in pairs if t >= ENOUGH]


@dataclass(frozen=True, eq=False)
class Scored:
    """A run, t of each question with it, and what it is worth."""

    excitation: Excitation
    t: tuple[float, ...]
    worth: float


def best_of_family(bench: Bench, bounds: Bounds) -> list[Scored]:
    """Return runs of all kinds, the best first."""
    every = settings(bounds)

    def scored(runs: Iterable[Excitation]) -> list[Scored]:
        work = partial(bench.scored, bounds=bounds)
        return [*in_order(bench.problem.threads, work, runs)]

    kinds = kinds_for(bounds, bench.layout.remembers)
    made = scored(Excitation(kind, numbers, every[0]) for kind in kinds for numbers in kind.starts)
    chosen = [one.excitation for one in _ranked(made)[:IN_ALL_SETTINGS]]
    made += scored(replace(one, setting=other) for one in chosen for other in every[1:])
    return _ranked(made)


def refined(bench: Bench, bounds: Bounds, start: Scored) -> Scored:
    """Improve a run's numbers within the limits."""
    best = [start]

    def loss(numbers: Array) -> float:
        trial = replace(start.excitation, numbers=np.clip(numbers, 0.0, 1.0))
        made = bench.scored(trial, bounds)
        if made.worth > best[0].worth:
            best[0] = made
        return -made.worth

    numbers = start.excitation.numbers
    corner = np.where(numbers > 0.5, numbers - 0.2, numbers + 0.2)
    simplex = np.vstack([numbers, *(np.where(row, corner, numbers)
                                    for row in np.eye(len(numbers), dtype=bool))])  # fmt: skip
    minimize(
        loss,
        numbers,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(numbers),
        options={"maxfev": EVALUATIONS, "initial_simplex": simplex},
    )
    return best[0]


def _ranked(made: Sequence[Scored]) -> list[Scored]:
    return sorted(made, key=lambda one: -one.worth)


@dataclass(frozen=True, eq=False)
class Rivalry:
    """A named effect of a model, and a rival: in some shapes, and fitted in its place."""

    named: str
    rival: str
    variants: tuple[Effect, ...]
    fitted: CandidateModel | None


@dataclass(frozen=True, eq=False)
class Question:
    """A signal (C,) over all columns, and the columns (of each form) that it has to stand beside.

    `names`: of the effect and its rival, or of the parameter alone. `model`: columns of the model
    without the effect. `value`: of the parameter.
    """

    names: tuple[str, ...]
    signal: Array
    model: Columns
    beside: tuple[Columns, ...]
    value: float
    unit: str

    @property
    def parameter(self) -> bool:
        return len(self.names) == 1

    def information(self, total: Array) -> float:
        """t² that these products (C, C) promise, in the rival's worst form."""
        return max(min(self._left(total, columns) for columns in self.beside), 0.0)

    def taken(self, total: Array) -> float:
        """Share of what the signal explains beside the model that a rival would explain too."""
        alone = max(self._left(total, self.model), 1e-300)
        return 1.0 - self.information(total) / alone

    def _left(self, total: Array, columns: Columns) -> float:
        across = total @ self.signal
        full = np.block([[total, across[:, None]], [across[None, :], self.signal @ across]])
        left, alone = float(left_by(full, columns)[-1, -1]), float(full[-1, -1])
        return left if left > SINGULAR * alone else 0.0  # a difference of equals is its rounding


@dataclass(frozen=True, eq=False)
class Layout:
    """All columns that the questions need: of the model, of rivals' variants, of fitted rivals."""

    work: CandidateModel
    rivalries: tuple[Rivalry, ...]
    questions: tuple[Question, ...]

    @property
    def variants(self) -> list[Effect]:
        return list(dict.fromkeys(v for r in self.rivalries for v in r.variants))

    @property
    def effects(self) -> list[Effect]:
        """Everything that reads channels."""
        fitted = [e for r in self.rivalries if r.fitted for e in r.fitted.effects]
        return list(dict.fromkeys([*self.work.effects, *self.variants, *fitted]))

    @property
    def asked(self) -> set[str]:
        """Names of the effects that the questions are about."""
        return {name.split(".")[0] for question in self.questions for name in question.names}

    @property
    def remembers(self) -> bool:
        """Whether a question is about an effect whose row depends on the rows before."""
        return any(name in CATALOGUE and CATALOGUE[name].remembers for name in self.asked)

    def columns(self, problem: Problem, number: int) -> Array:
        """Columns (N, C) of a run."""
        parts = [self.work.assembly(beside=self.variants).rows(problem, number)[0]]
        for rivalry in self.rivalries:
            if rivalry.fitted is not None:
                rows, _ = rivalry.fitted.rows(problem, number)
                parts.append(rows[:, _owned(rivalry.fitted, rivalry.rival)])
        return np.column_stack(parts)


def layout_of(
    work: CandidateModel, rivalries: Sequence[Rivalry], parameters: Sequence[tuple[str, str]]
) -> Layout:
    """Lay out the columns of a model, of rivals of its effects, and of parameters (name, unit)."""
    bare = Layout(work, tuple(rivalries), ())
    at = len(work.owners())
    places: dict[Effect, Columns] = {}
    for effect in bare.variants:
        places[effect] = np.arange(at, at + len(effect.terms))
        at += len(effect.terms)
    forms = []
    for rivalry in rivalries:
        forms.append([places[variant] for variant in rivalry.variants])
        if rivalry.fitted is not None:
            count = len(_owned(rivalry.fitted, rivalry.rival))
            forms[-1].append(np.arange(at, at + count))
            at += count
    pairs = [_of_pair(work, r, own, at) for r, own in zip(rivalries, forms, strict=True)]
    names = [coefficient_names(work.effects)[number] for number in work.free]
    known = [_of_parameter(work, names.index(n), n, u, at) for n, u in parameters if n in names]
    return replace(bare, questions=(*pairs, *known))


def _of_pair(
    work: CandidateModel, rivalry: Rivalry, forms: Sequence[Columns], count: int
) -> Question:
    """The fitted term of a named effect beside the model and each form of its rival."""
    owners = np.array(work.owners())
    model = np.flatnonzero(owners != rivalry.named)
    signal = np.zeros(count)
    own = np.flatnonzero(owners[: len(work.free)] == rivalry.named)
    signal[own] = work.coefficients[work.free[own]]
    beside = tuple(np.concatenate([model, form]) for form in forms)
    return Question((rivalry.named, rivalry.rival), signal, model, beside, np.nan, "")


def _of_parameter(work: CandidateModel, own: int, name: str, unit: str, count: int) -> Question:
    """One column beside all others of the model."""
    signal = np.zeros(count)
    signal[own] = 1.0
    rest = np.delete(np.arange(len(work.owners())), own)
    return Question((name,), signal, rest, (rest,), float(work.coefficients[work.free[own]]), unit)


def products(
    layout: Layout,
    problem: Problem,
    whitening: Whitening,
    trust: Trust,
    times: Sequence[float] | None = None,
) -> Array:
    """Return the products (C, C) of all columns over σ², summed over the runs of a problem.

    `times`: how often each of them counts; None: once.
    """
    total: Array | float = 0.0
    for number, run in enumerate(problem.runs):
        made, rows = whitening(layout.columns(problem, number), run)
        made *= trust.weights(run.log, rows)[:, None]
        often = 1.0 if times is None else times[number]
        total = total + often * (made.T @ made) / whitening.variance
    return np.asarray(total)


def pieces_of(problem: Problem) -> tuple[Problem, tuple[float, ...]]:
    """Return pieces that stand for the whole of long runs, and how often each of them counts."""
    found, times = list[Run](), list[float]()
    for run in problem.runs:
        starts = np.arange(0, len(run), PIECE)
        kept = starts if len(starts) <= MOST_PIECES else starts[:-1][:: len(starts) // MOST_PIECES]
        own = [_piece(run, int(first)) for first in kept]
        found += own
        times += [len(run) / sum(map(len, own))] * len(own)
    return replace(problem, runs=tuple(found), kept={}), tuple(times)


def _piece(run: Run, first: int) -> Run:
    """Rows of a run, whose memory starts anew."""
    last = min(first + PIECE, len(run))
    if last - first == len(run):
        return run
    channels = {name: values[first:last].copy() for name, values in run.channels.items()}
    if "period" in channels:
        channels["period"][0] = 0.0
    kept = [(max(a, first) - first, min(b, last) - first) for a, b in run.stretches]
    kept = [(a, b) for a, b in kept if a < b]
    log = run.log.rows(slice(first, last), note="")
    return Run(log, channels, run.target[first:last], tuple(kept), tuple(kept))


def _owned(work: CandidateModel, name: str) -> list[int]:
    return [k for k, owner in enumerate(work.owners()) if owner == name]


def at_coarser_rate(
    whitening: Whitening, rate: float, fastest: float = 0.0, lowpass: float | None = None
) -> tuple[Whitening, float]:
    """Return the noise and the rate [Hz] that a planned run is judged with.

    Parameters
    ----------
    rate : Hz, of the recorded runs.
    fastest : Hz, of ripple that the run has to follow.
    lowpass : Hz, that the planned run is looked at with, as the recorded ones were; None: none.
    """
    news = rate / whitening.decimation
    least = 0.0 if lowpass is None else (1.0 + MARGIN) * lowpass / WIDEST
    fast = max(FAST, OF_A_PERIOD * fastest)
    if news < 2.0 * fast or least > fast:
        slowest = max(min(max(SLOW, OF_A_PERIOD * fastest), rate), least)
        rows = max(1, int(np.ceil(slowest / news)))
        return Whitening(whitening.denominator, whitening.variance, rows), news * rows
    every = int(news / fast)
    order = max(whitening.order, 1)
    frequency = np.linspace(0.0, np.pi / every, POINTS)
    _, response = freqz([1.0], whitening.denominator, worN=frequency)
    power = whitening.variance * np.abs(response) ** 2
    waves = np.cos(np.outer(np.arange(order + 1) * every, frequency))
    lags = np.trapezoid(power * waves, frequency, axis=1) / np.pi
    phi = solve_toeplitz(lags[:order] * np.where(np.arange(order), 1.0, 1.0 + 1e-9), lags[1:])
    variance = max(float(lags[0] - phi @ lags[1:]), 1e-12 * float(lags[0]))
    return Whitening(np.append(1.0, -phi), variance, 1), news / every


@dataclass(frozen=True, eq=False)
class Trust:
    """`edges` (K,) between bands of speed [rad/s], `excess` (K + 1,) of their variance, ≥ 1."""

    edges: Array
    excess: Array

    def weights(self, log: Log, rows: NDArray[np.intp]) -> Array:
        """What rows (N,) of a log are multiplied with, at most 1."""
        return np.asarray(
            1.0 / np.sqrt(self.excess[np.searchsorted(self.edges, _speed(log)[rows])])
        )


def trust_of(problem: Problem, work: CandidateModel, whitening: Whitening) -> Trust:
    """Compare what a model leaves at each speed with what it leaves overall."""
    squares, speeds = [], []
    for number, run in enumerate(problem.runs):
        left = run.target - work.predict(problem, number)
        values, rows = whitening(left[:, None], run)
        squares.append(values[:, 0] ** 2 / whitening.variance)
        speeds.append(_speed(run.log)[rows])
    square, speed = np.concatenate(squares), np.concatenate(speeds)
    edges = np.unique(np.quantile(speed, SHARES))
    band = np.searchsorted(edges, speed)
    count = np.maximum(np.bincount(band, minlength=len(edges) + 1), 1)
    mean = np.bincount(band, weights=square, minlength=len(edges) + 1) / count
    return Trust(edges, np.maximum(mean, 1.0))


def _speed(log: Log) -> Array:
    """(N,) [rad/s], 0 where nothing is known of it."""
    return np.abs(log["output_velocity"]) if "output_velocity" in log else np.zeros(len(log))
