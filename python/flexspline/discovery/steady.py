"""A noisy velocity is looked for before any physics: what its noise makes is no missing effect.

Friction that follows the measured velocity follows its noise n too; the joint does not. Where the
model turns over steeply, at rest and at reversals, that leaves

    f(v) − f(v + n) ≈ −f′(v) n − ½ f″(v) n²

whose first part moves with the regressors themselves (errors in variables: Fuller 1987), so that
every effect of low speeds seems to explain it. The rival hypothesis is the same model of a
velocity without the noise: the angle's derivative, or the velocity smoothed, at some bandwidths.
Both have the same coefficients, so the likelihoods of the base decide, in noise with memory:

    gain = Σ_runs N ln(σ² with the velocity as it is / σ² with the other)

It has to pay what the best of so many reaches by chance. What is taken off has to be noise, too: as
large as the fourth differences of the velocity say that its noise without memory is, where ripple
of a drive and a filter's bend of fast motion are larger. A velocity that is smooth already is left
as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.discovery.evidence import price
from flexspline.discovery.faults import DataFault
from flexspline.discovery.refit import refitted, started
from flexspline.discovery.whitening import Whitening, rough_whitening
from flexspline.discovery.working import Working, working
from flexspline.effects import Effect
from flexspline.errors import InputError
from flexspline.fit.problem import Problem, Run, problem_of
from flexspline.logs.grain import white_noise
from flexspline.logs.log import Log
from flexspline.parallel import in_order
from flexspline.prepared import Preparation
from flexspline.simulator.record import Simulated

__all__ = ["steadied"]

Array = NDArray[np.float64]
Logs = Sequence[Log]

VELOCITY, ANGLE = "output_velocity", "output_position"
SHARES = (0.16, 0.08, 0.04, 0.02)  # of the rate: bandwidths that are tried
WHITE = 1.5  # times the noise without memory, that what is taken off a velocity has at most
HEARD = 0.02  # of what the base leaves, that the noise without memory makes of it somewhere
SLOPE = 1e-3  # of the fastest: step for the slope of the model


@dataclass(frozen=True)
class _Version:
    """Logs with another velocity, and how it was made."""

    logs: list[Log]
    made: Preparation


def steadied(
    logs: Logs,
    base: Sequence[Effect],
    target: str,
    known_load: str | None,
    fixed: Mapping[str, float],
    taken: Callable[[Log], Log],
    threads: int = 1,
    simulated: Simulated | None = None,
) -> tuple[list[Log], tuple[DataFault, ...], tuple[Preparation, ...]]:
    """Return the logs with the velocity that explains most; where it is another, fault and way.

    `taken`: the rows of a log that count. `simulated`: the simulation taken off the target.
    """
    logs = list(logs)
    noise = _noise(logs, base)
    if not noise > 0.0:
        return logs, (), ()

    def problem(of: Logs) -> Problem:
        return problem_of(
            [taken(log) for log in of],
            base,
            target,
            known_load=known_load,
            lowpass_hz=None,
            threads=threads,
            simulated=simulated,
        )

    given = problem(logs)
    plain = Whitening(np.ones(1), 1.0, given.decimation)
    work, _ = started(given, working(base, len(base), fixed), plain)
    if noise * _steepest(given, work) < HEARD * _left(given, work):
        return logs, (), ()
    versions = [v for v in _versions(logs) if all(map(_is_noise, logs, v.logs))]
    best, gain = _best(versions, problem, work, _deviance(given, work))
    if best is None or gain <= 0.0:
        return logs, (), ()
    return best.logs, _faults(logs, best), (best.made,)


def _noise(logs: Logs, base: Sequence[Effect]) -> float:
    """Noise of the velocity without memory, rad/s; nothing where no log has one that is read."""
    if not any(VELOCITY in e.reads for e in base) or not all(VELOCITY in log for log in logs):
        return 0.0
    if not all(np.isfinite(log[VELOCITY]).all() for log in logs):
        return 0.0
    return max(white_noise(log[VELOCITY]) for log in logs)


def _steepest(problem: Problem, work: Working) -> float:
    """The model's largest slope against the velocity, target's unit per rad/s."""
    steepest = 0.0
    for run in problem.runs:
        step = SLOPE * max(float(np.abs(run.log[VELOCITY]).max()), 1e-300)
        design = problem.design(work.effects)

        def predicted(side: float, run: Run = run, design: _core.Design = design) -> Array:
            channels = {**run.channels, VELOCITY: run.log[VELOCITY] + side}
            return np.asarray(design.predict(channels, len(run), work.coefficients))

        both = list(in_order(problem.threads, predicted, (-step, step)))
        steepest = max(steepest, float(np.quantile(np.abs(both[1] - both[0]), 0.99) / (2.0 * step)))
    return steepest


def _residuals(problem: Problem, work: Working) -> list[Array]:
    return [run.target - work.predict(problem, number) for number, run in enumerate(problem.runs)]


def _left(problem: Problem, work: Working) -> float:
    """What a model leaves without memory: the noise that a velocity's noise would add to."""
    return float(np.mean([white_noise(rest) for rest in _residuals(problem, work)]))


def _deviance(problem: Problem, work: Working) -> float:
    """N ln σ² of what a model leaves, in noise with memory."""
    white = rough_whitening(_residuals(problem, work), problem.runs, problem.decimation)
    return (
        sum(run.counted for run in problem.runs)
        / problem.decimation
        * float(np.log(white.variance))
    )


def _best(
    versions: Sequence[_Version],
    problem: Callable[[Logs], Problem],
    work: Working,
    before: float,
) -> tuple[_Version | None, float]:
    """The version whose likelihood is highest, and its gain above the price."""
    best: _Version | None = None
    most = price(1, 1.0, len(versions))
    gained = 0.0
    for version in versions:
        other = problem(version.logs)
        plain = Whitening(np.ones(1), 1.0, other.decimation)
        gain = before - _deviance(other, refitted(other, work, plain)[0])
        if gain - most > gained:
            best, gained = version, gain - most
    return best, gained


def _versions(logs: Logs) -> Iterator[_Version]:
    rate = float(np.median([log.rate for log in logs]))
    sources = [VELOCITY, *([ANGLE] if all(ANGLE in log for log in logs) else [])]
    widths = [float(f"{share * rate:.6g}") for share in SHARES]
    ways = [Preparation(VELOCITY, source, width) for source in sources for width in widths]
    for way in ways:
        try:
            made = [way(log) for log in logs]
        except InputError:
            continue
        if all(np.isfinite(log[VELOCITY]).all() for log in made):
            yield _Version(made, way)


def _is_noise(log: Log, other: Log) -> bool:
    """Whether two velocities differ by no more than noise without memory."""
    off = log[VELOCITY] - other[VELOCITY]
    return float(np.sqrt(np.mean(off**2))) <= WHITE * white_noise(log[VELOCITY])


def _faults(logs: Logs, best: _Version) -> tuple[DataFault, ...]:
    found = []
    for log, other in zip(logs, best.logs, strict=True):
        size = float(np.std(log[VELOCITY] - other[VELOCITY]))
        found.append(
            DataFault(
                log.name,
                "velocity_noise",
                VELOCITY,
                size,
                "rad/s",
                (0, len(log)),
                f"{log.name}: {VELOCITY} is noisy by {size:.2g} rad/s RMS, which friction that "
                f"follows it shows and the joint does not; names are looked for with the velocity "
                f"{best.made.how}.",
            )
        )
    return tuple(found)
