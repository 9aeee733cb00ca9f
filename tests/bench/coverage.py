"""Do 95 % intervals cover the truth? Simulated logs of a joint in noise with memory.

    python tests/bench/coverage.py [logs per case] [part of the case's name]
    python tests/bench/coverage.py --class lab [sets of runs] [deal]      (see lab_coverage.py)

prints, per case, the least, the median and the largest coverage over the parameters for our
intervals, for naive ones (white noise) and for Newey–West (Bartlett weights, the usual
4 (n/100)^(2/9) lags), and for how many logs the result says that it is too short.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfiltfilt

from flexspline.least_squares.noise_model import Chunk, noise_model
from flexspline.least_squares.uncertainty import Uncertainty, parameter_uncertainty

Array = NDArray[np.float64]

RATE = 100.0  # Hz
NOISE = 0.3  # Nm, standard deviation
NORMAL = 1.959964
WHITE: tuple[float, ...] = ()
AR1 = (0.9,)
AR2_SWINGING = (1.6, -0.8)
AR2_SLOW = (1.2, -0.3)


@dataclass(frozen=True)
class Case:
    """One experiment, repeated. `terms` counts all parameters, the fitted shape included."""

    name: str
    noise: tuple[float, ...]
    terms: int = 10
    samples: int = 2000
    runs: int = 1
    motion: str = "sine"
    shape: str = "direction width"
    white: float = 0.0  # share of white measurement noise in the variance
    lowpass: float = 0.0  # Hz, on target and rows alike
    offset_per_run: bool = False


@dataclass(frozen=True)
class Rig:
    """What stays the same in all logs of a case: rows (n, P - 2) and velocity (n,)."""

    case: Case
    linear: Array
    velocity: Array
    starts: NDArray[np.bool_]
    truth: Array  # linear coefficients, then strength and shape of the bent term

    def jacobian(self, at: Array) -> Array:
        """Rows (n, P) at parameters (P,): linear terms, then ∂/∂strength and ∂/∂shape."""
        slip = self.velocity / at[-1]
        if self.case.shape == "direction width":
            bent = np.tanh(slip)
            slope = -(1.0 - bent**2) * slip
        else:  # Stribeck speed, with the direction width known
            bent = np.tanh(self.velocity / 0.02) * np.exp(-(slip**2))
            slope = 2.0 * bent * slip**2
        return np.column_stack([self.linear, bent, at[-2] / at[-1] * slope])

    def prediction(self, at: Array) -> Array:
        return self.jacobian(at)[:, :-1] @ at[:-1]

    def lowpassed(self, columns: Array) -> Array:
        if not self.case.lowpass:
            return columns
        sections = butter(4, self.case.lowpass, fs=RATE, output="sos")
        parts = np.split(columns, np.flatnonzero(self.starts)[1:])
        return np.concatenate([sosfiltfilt(sections, part, axis=0) for part in parts])


def positions(case: Case, run: int) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of one run, rad: two sines or speed-limited strokes."""
    time = np.arange(case.samples // case.runs) / RATE
    pace = 2 * np.pi * 0.15 * (1.0 + 0.35 * run)
    if case.motion == "sine":
        position = np.sin(pace * time + 0.3 * run) + 0.4 * np.sin(2.3 * pace * time)
    else:
        speed = np.clip(2.0 * np.sin(pace * time + 0.3 * run), -1.0, 1.0)
        speed *= 0.5 + 0.3 * np.sign(np.sin(0.37 * pace * time))
        position = np.cumsum(np.convolve(speed, np.hanning(25) / 12.0, "same")) / RATE
    velocity = np.gradient(position, 1.0 / RATE)
    return position, velocity, np.gradient(velocity, 1.0 / RATE)


def build(case: Case) -> Rig:
    parts = [positions(case, run) for run in range(case.runs)]
    position, velocity, acceleration = (np.concatenate(part) for part in zip(*parts, strict=True))
    starts = np.zeros(len(position), bool)
    starts[:: case.samples // case.runs] = True
    columns = [np.ones(len(position))]
    if case.offset_per_run:
        columns = list((np.cumsum(starts)[:, None] == np.arange(1, case.runs + 1)).T.astype(float))
    columns += [velocity, acceleration]
    for order in range(2, case.terms + 2, 2):
        columns += [np.cos(order * position), np.sin(order * position)]
    linear = np.column_stack(columns[: case.terms - 2])
    strengths = np.random.default_rng(1).normal(size=case.terms - 2)
    return Rig(case, linear, velocity, starts, np.append(strengths, [2.0, 0.15]))


def noise_of(case: Case, generator: np.random.Generator, logs: int) -> Array:
    """(logs, n), Nm; every run starts anew from the stationary state."""
    settle, length = 500, case.samples // case.runs
    shocks = generator.standard_normal((logs * case.runs, length + settle))
    slow = lfilter([1.0], np.append(1.0, -np.array(case.noise)), shocks)[:, settle:]
    slow *= np.sqrt(1.0 - case.white) / slow.std()
    slow += np.sqrt(case.white) * generator.standard_normal(slow.shape)
    return NOISE * slow.reshape(logs, case.samples)


def estimate(rig: Rig, torque: Array) -> tuple[Array, Array, Array]:
    """Gauss–Newton from the truth: parameters, rows and residual as low-passed."""
    at = rig.truth.copy()
    for _ in range(12):
        rows = rig.lowpassed(rig.jacobian(at))
        residual = rig.lowpassed(torque - rig.prediction(at))
        factor = np.linalg.qr(rows, mode="r")
        step = np.linalg.solve(factor, np.linalg.solve(factor.T, rows.T @ residual))
        if np.linalg.norm(factor @ step) < 1e-4 * np.linalg.norm(residual):
            break  # 0.5 % of a standard error
        at = at + step
        at[-1] = max(at[-1], 0.03)
    return at, rows, residual


def errors_of(rig: Rig, rows: Array, residual: Array) -> Uncertainty:
    case = rig.case

    def chunks() -> Iterator[Chunk]:
        yield Chunk(rows, residual, rig.starts)

    basis = np.linalg.inv(np.linalg.qr(rows, mode="r"))
    thin = int(RATE / (2.5 * case.lowpass)) if case.lowpass else 1
    noise = noise_model(chunks, basis, decimation=thin)
    return parameter_uncertainty(chunks, basis, noise)


def newey_west(rows: Array, residual: Array) -> Array:
    """Standard errors with Bartlett weights [NeweyWest1987], runs joined as usual."""
    scores = rows * residual[:, None]
    lags = int(4 * (len(rows) / 100.0) ** (2.0 / 9.0))
    meat = scores.T @ scores
    for lag in range(1, lags + 1):
        both = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (lags + 1.0)) * (both + both.T)
    bread = np.linalg.inv(rows.T @ rows)
    return np.asarray(np.sqrt(np.diag(bread @ meat @ bread)))


@dataclass(frozen=True)
class Coverage:
    """Shares of logs, each (P,), whose interval covers the truth; and the rest of the study."""

    ours: Array
    naive: Array
    newey_west: Array
    too_short: float
    error_ratio: Array  # reported standard error (root mean square) over the real one


def study(case: Case, logs: int, seed: int) -> Coverage:
    rig = build(case)
    clean = rig.prediction(rig.truth)
    hits: list[Array] = []
    errors, estimates, short = [], [], 0
    for noise in noise_of(case, np.random.default_rng(seed), logs):
        at, rows, residual = estimate(rig, clean + noise)
        result = errors_of(rig, rows, residual)
        low, high = result.intervals(at).T
        miss = np.abs(at - rig.truth)
        naive = miss <= NORMAL * result.naive_standard_errors
        plain = miss <= NORMAL * newey_west(rows, residual)
        hits.append(np.array([(low <= rig.truth) & (rig.truth <= high), naive, plain]))
        errors.append(result.standard_errors)
        estimates.append(at)
        short += not result.reliable
    ratio = np.sqrt(np.mean(np.square(errors), 0)) / np.std(estimates, 0)
    return Coverage(*np.mean(hits, 0), short / logs, ratio)


CASES = (
    Case("white", WHITE),
    *(
        Case(f"{name}, {terms} terms, {runs} run(s)", noise, terms, runs=runs)
        for name, noise in (("AR1", AR1), ("AR2 swinging", AR2_SWINGING), ("AR2 slow", AR2_SLOW))
        for terms in (7, 10, 15)
        for runs in (1, 4)
    ),
    Case("AR1, strokes", AR1, 15, motion="strokes"),
    Case("AR1, strokes, 4 runs", AR1, 15, motion="strokes", runs=4),
    Case("AR1, offset per run", AR1, 15, runs=4, offset_per_run=True),
    Case("AR1, Stribeck speed", AR1, 8, shape="Stribeck speed", runs=4),
    Case("AR1 + 30 % white", AR1, white=0.3),
    Case("AR1 + 30 % white, 4 runs", AR1, white=0.3, runs=4),
    Case("slow AR1 + 80 % white", (0.98,), samples=20_000, white=0.8),
    Case("AR1, 5 Hz low pass", AR1, lowpass=5.0),
    Case("AR1, 5 Hz low pass, 4 runs", AR1, lowpass=5.0, runs=4),
    Case("AR2 swinging, 5 Hz low pass", AR2_SWINGING, lowpass=5.0, samples=4000),
    *(Case(f"AR1, {n} samples, 10 terms", AR1, samples=n) for n in (200, 300, 500, 800, 1200)),
    *(Case(f"AR1, {n} samples, 15 terms", AR1, 15, samples=n) for n in (400, 600, 800, 1200)),
    *(
        Case(f"AR2 swinging, {n} samples", AR2_SWINGING, samples=n)
        for n in (150, 200, 300, 500, 800)
    ),
    *(Case(f"AR1, 20 runs of {n // 20}", AR1, samples=n, runs=20) for n in (600, 1000, 2000)),
)


def main() -> None:
    if sys.argv[1:3] == ["--class", "lab"]:
        import lab_coverage

        lab_coverage.main(sys.argv[3:])
        return
    logs = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    print(f"{'':34s} {'ours':^17s} {'naive':^17s} {'Newey–West':^17s} short  error ratio")
    for number, case in enumerate(CASES):
        if wanted not in case.name:
            continue
        result = study(case, logs, seed=number)
        three = [
            " ".join(f"{100 * q:5.1f}" for q in (c.min(), np.median(c), c.max()))
            for c in (result.ours, result.naive, result.newey_west)
        ]
        three.append(f"{100 * result.too_short:4.0f}%")
        ratio = f"{result.error_ratio.min():.2f}–{result.error_ratio.max():.2f}"
        print(f"{case.name:34s} {' '.join(three)}  {ratio}", flush=True)


if __name__ == "__main__":
    main()
