"""Information of runs on a question: the square of the t that is expected.

A question has a signal, a sum of columns, and columns beside which it has to stand. With G the
products of all whitened columns over σ², summed over runs, and s the signal's weights,

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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import freqz

from flexspline.effects import CATALOGUE, Effect
from flexspline.least_squares.options import coefficient_names
from flexspline.least_squares.problem import Problem, Run
from flexspline.logs.local_fit import WIDEST
from flexspline.logs.log import Log
from flexspline.regression.candidate_model import Working
from flexspline.regression.gram import SINGULAR, Columns, Whitening, left_by

__all__ = [
    "Layout",
    "Question",
    "Rivalry",
    "Trust",
    "at_coarser_rate",
    "layout_of",
    "pieces_of",
    "products",
    "trust_of",
]

Array = NDArray[np.float64]

PIECE = 50_000  # rows
MOST_PIECES = 6

FAST = 100.0  # Hz, what a planned run is looked at with
SLOW = 50.0
OF_A_PERIOD = 8.0  # rows of ripple, at least: its sine is followed to some per cent
POINTS = 1 << 14
MARGIN = 1e-6  # of a rate, that the steps of a planned run's clock are rounded by at most

SHARES = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7)  # of all rows, that are slower than a band's end


@dataclass(frozen=True, eq=False)
class Rivalry:
    """A named effect of a model, and a rival: in some shapes, and fitted in its place."""

    named: str
    rival: str
    variants: tuple[Effect, ...]
    fitted: Working | None


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

    work: Working
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
        parts = [self.work.sheet(beside=self.variants).rows(problem, number)[0]]
        for rivalry in self.rivalries:
            if rivalry.fitted is not None:
                rows, _ = rivalry.fitted.rows(problem, number)
                parts.append(rows[:, _owned(rivalry.fitted, rivalry.rival)])
        return np.column_stack(parts)


def layout_of(
    work: Working, rivalries: Sequence[Rivalry], parameters: Sequence[tuple[str, str]]
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


def _of_pair(work: Working, rivalry: Rivalry, forms: Sequence[Columns], count: int) -> Question:
    """The fitted term of a named effect beside the model and each form of its rival."""
    owners = np.array(work.owners())
    model = np.flatnonzero(owners != rivalry.named)
    signal = np.zeros(count)
    own = np.flatnonzero(owners[: len(work.free)] == rivalry.named)
    signal[own] = work.coefficients[work.free[own]]
    beside = tuple(np.concatenate([model, form]) for form in forms)
    return Question((rivalry.named, rivalry.rival), signal, model, beside, np.nan, "")


def _of_parameter(work: Working, own: int, name: str, unit: str, count: int) -> Question:
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


def _owned(work: Working, name: str) -> list[int]:
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


def trust_of(problem: Problem, work: Working, whitening: Whitening) -> Trust:
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
