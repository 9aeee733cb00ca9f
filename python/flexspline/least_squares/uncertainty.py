"""How far off the coefficients of a least-squares fit can be under autocorrelated noise.

The estimates are those of least squares; their covariance is that of noise with the fitted
model Ω (autoregressive, starting anew in each stretch):

    cov β = (XᵀX)⁻¹ XᵀΩX (XᵀX)⁻¹,     XᵀΩX = σ² Σ_t y_t y_tᵀ,     y = X filtered by 1/A

exactly, if the filter runs on over zeros behind the last row of a stretch; what it would add there
is summed in closed form from its state (`_Tail`), for slow noise rings longer than a run. An
interval is value ± t·error, with Student's t of ν degrees of freedom, because the noise model is
estimated too ([Satterthwaite1946]; for restricted likelihood [KenwardRoger1997]):

    ν = 2 / (gᵀ cov(φ) g + 2 / (n - P)),     g = ∂ log(error²) / ∂φ

Below one degree of freedom there is no interval: its ends are NaN.

Naive errors, s² (XᵀX)⁻¹, which treat samples as independent, are kept for comparison.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import t as student

from flexspline.errors import InputError
from flexspline.least_squares.noise_model import Chunks, NoiseModel, pieces

Array = NDArray[np.float64]

#: Pieces of news (rows / noise.memory) beyond one per parameter from which 95 % intervals cover
#: 93–97 %. In tests/bench/coverage.py they still do at 15; at 6 they cover 96–100 %, being as wide
#: as noise that is hardly known makes them. 20 leaves a margin.
PIECES_NEEDED = 20.0
#: Degrees of freedom below which nobody can say how far off a value is: the logarithm of its error
#: is known no better than to 2^-½, a factor of two either way, and Student's t has no mean.
LEAST_FREEDOM = 1.0
_DOUBLINGS = 64  # of a sum's length: 2⁶⁴ rows, which no root below 1 outlasts
_GONE = 1e-12  # of the transition: what it adds then is below rounding


@dataclass(frozen=True, eq=False)
class Prior:
    """Parameters held by knowledge from elsewhere, as extra rows of the least-squares problem.

    `rows`: (m, P), as added to X. `errors`: (m,), standard deviation of rows @ β - target there.
    """

    rows: Array
    errors: Array


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Errors of P parameters. Units: those of the parameters.

    `basis`: (P, K) of the determined subspace; `core`: (K, K) with covariance = basis core basisᵀ.
    `naive_core`: the same under white noise. `degrees_of_freedom`: (P,). `noise`: the model.
    Errors are NaN for a parameter that the basis does not reach.
    """

    basis: Array
    core: Array
    naive_core: Array
    degrees_of_freedom: Array
    rows: int
    noise: NoiseModel

    def __repr__(self) -> str:
        count, known = self.basis.shape
        return (
            f"<Uncertainty of {count} parameters, {known} combinations determined: "
            f"{self.rows} rows, effective sample size {self.effective_samples:.0f}>"
        )

    @property
    def covariance(self) -> Array:
        """(P, P), of the parameters."""
        return self.basis @ self.core @ self.basis.T

    @property
    def standard_errors(self) -> Array:
        """(P,)"""
        return self.errors_of(np.eye(len(self.basis)))

    @property
    def naive_standard_errors(self) -> Array:
        """(P,), as if the noise were white: for comparison only."""
        return _errors(self.basis, self.naive_core)

    def errors_of(self, directions: Array) -> Array:
        """Standard errors of directions @ β, (m,) for directions (m, P).

        For known combinations of confounded parameters and for predictions (directions = rows);
        accurate where the covariance of the parameters alone would cancel.
        """
        return _errors(directions @ self.basis, self.core)

    def intervals(self, values: Array, confidence: float = 0.95) -> Array:
        """(P, 2): lower and upper ends of the confidence intervals around values (P,).

        NaN where the error is not known (`half_widths`).
        """
        half = half_widths(self.standard_errors, self.degrees_of_freedom, confidence)
        return np.column_stack([values - half, values + half])

    @property
    def effective_samples(self) -> float:
        """Independent samples that would know the mean as well: N γ_0 / (long-run variance).

        More than N where the noise swings and averages out; N where there is none.
        """
        if not self.noise.long_run_variance > 0.0:
            return float(self.rows)
        return self.rows * self.noise.variance / self.noise.long_run_variance

    @property
    def effective_samples_of(self) -> Array:
        """(P,): the same for each parameter, N (naive error / error)²."""
        with np.errstate(divide="ignore", invalid="ignore"):  # without any noise no error
            share = self.naive_standard_errors / self.standard_errors
        return np.asarray(self.rows * share**2)

    @property
    def shortest_length(self) -> int:
        """Samples of log, all runs together, from which the intervals hold in this noise."""
        news = PIECES_NEEDED + self.noise.parameters
        return int(np.ceil(news * self.noise.memory)) * self.noise.decimation

    @property
    def reliable(self) -> bool:
        return self.length >= self.shortest_length

    @property
    def length(self) -> int:
        """Samples of log behind the result, all runs together."""
        return self.rows * self.noise.decimation

    @property
    def statement(self) -> str:
        """Whether the intervals can be believed, in words."""
        have = f"{self.length} samples (effective sample size {self.effective_samples:.0f}"
        if round(self.effective_samples) > self.length:
            have += ", for what swings averages out more than independent noise does"
        have += ")"
        count, least = self.noise.parameters, self.shortest_length
        if not count:
            return "No coefficient was fitted, so that there is no error of one."
        several = "parameter in this noise needs" if count == 1 else "parameters in this noise need"
        need = f"{count} {several} {least} samples"
        if self.reliable:
            return f"Intervals hold: {need}, there are {have}."
        return f"Intervals are rough: {need}, there are {have}; record longer logs."


def half_widths(errors: ArrayLike, freedom: ArrayLike, confidence: float = 0.95) -> Array:
    """Return half of each confidence interval: Student's t times its standard error.

    NaN below `LEAST_FREEDOM` degrees of freedom.
    """
    require_level(confidence)
    quantiles = student.ppf(0.5 + 0.5 * confidence, freedom)
    return np.where(np.less(freedom, LEAST_FREEDOM), np.nan, quantiles * np.asarray(errors))


def require_level(confidence: float) -> None:
    """Refuse a confidence that is not between 0 and 1."""
    if not 0.0 < confidence < 1.0:
        raise InputError(f"The confidence {confidence} is not between 0 and 1; give 0.95 for 95 %.")


def parameter_uncertainty(
    chunks: Chunks,
    basis: Array,
    noise: NoiseModel,
    prior: Prior | None = None,
    counted: int | None = None,
    left_out: int = 0,
) -> Uncertainty:
    """Covariance of least-squares coefficients under the noise model, in one pass.

    Parameters
    ----------
    chunks, basis : as given to `noise_model`; its decimation is used again.
    noise : the fitted model.
    prior : pseudo-rows that were part of the problem, if any.
    counted : rows of the whole problem, where the chunks are an even part of it; else None.
    left_out : rows of nothing among the chunks, through which the noise goes on.

    Cost: O(N P (K + p)). Memory: a few times one chunk.
    """
    sums = _Sums(basis, noise)
    for starts, columns, residual, slope in pieces(chunks, basis, noise.decimation):
        if starts:
            sums.close()
        sums.add(columns, residual, slope)
    sums.close()
    sums.rows -= left_out
    times = 1.0 if counted is None else counted / sums.rows
    bread, meat = times * sums.bread, times * noise.innovation_variance * sums.meat
    naive = times * sums.squares / max(sums.rows - noise.parameters, 1) * sums.white
    if prior is not None:
        known = prior.rows @ basis
        bread = bread + known.T @ known
        told = known.T @ (prior.errors[:, None] ** 2 * known)
        meat, naive = meat + told, naive + told
    inverse = np.linalg.pinv(bread, rcond=1e-14, hermitian=True)
    freedom = _degrees_of_freedom(sums.slopes, sums.powers, noise)
    return Uncertainty(
        basis,
        inverse @ meat @ inverse,
        inverse @ naive @ inverse,
        freedom,
        counted or sums.rows,
        noise,
    )


class _Sums:
    """What one pass adds up, and the filter state of the stretch at hand.

    With Y the filtered rows and D = Y basisᵀ their share in each parameter: `meat` Σ y yᵀ,
    `powers` Σ d², `slopes` ∂(Σ d²)/∂φ_k = 2 Σ d_t w_{t-k} with w = d filtered once more.
    """

    def __init__(self, basis: Array, noise: NoiseModel) -> None:
        count, width = basis.shape
        self.basis, self.noise = basis, noise
        self.bread = np.zeros((width, width))
        self.white = np.zeros((width, width))
        self.meat = np.zeros((width, width))
        self.powers = np.zeros(count)
        self.slopes = np.zeros((noise.order, count))
        self.squares, self.rows = 0.0, 0
        self.tail = _Tail.of(noise)
        self._forget()

    def _forget(self) -> None:
        order, (count, width) = self.noise.order, self.basis.shape
        self.first = np.zeros((order, width))
        self.second = np.zeros((order, count))
        self.last = np.zeros((order, count))

    def add(self, rows: Array, residual: Array, slope: Array) -> None:
        self.bread += rows.T @ (slope[:, None] * rows)
        self.white += rows.T @ rows
        self.squares += float(residual @ residual)
        self.rows += len(rows)
        self._filter(rows)

    def close(self) -> None:
        """End of a stretch: add what the filter would as it rings out, and forget."""
        if self.noise.order and self.first.any():
            self.meat += self.tail.squares(self.first)
            share = self.first @ self.basis.T
            self.powers += np.einsum("kj,kj->j", share, self.tail.seen @ share)
            self.slopes += 2.0 * self.tail.lagged(share, self.second, self.last)
        self._forget()

    def _filter(self, rows: Array) -> None:
        order = self.noise.order
        y, self.first = self.noise.filter(rows, self.first)
        self.meat += y.T @ y
        share = y @ self.basis.T
        self.powers += np.einsum("tj,tj->j", share, share)
        again, self.second = self.noise.filter(share, self.second)
        again = np.concatenate([self.last, again])
        for k in range(1, order + 1):
            self.slopes[k - 1] += 2.0 * np.einsum(
                "tj,tj->j", share, again[order - k : len(again) - k]
            )
        self.last = again[len(again) - order :]


@dataclass(frozen=True, eq=False)
class _Tail:
    """Sums over all rows behind a stretch, where the filters run on from their states alone.

    The state s (p,) of 1/A goes on as s ← F s and puts out d = s₀; that of the second filter takes
    d in: u ← F u + φ d, and puts out w = d + u₀. With both as x = (s, u):

        `seen`: Σ_t (Fᵗ)ᵀ e₀ e₀ᵀ Fᵗ (p, p), so that Σ d² = sᵀ seen s,
        `both`: Σ_t of products (p, p, 2p), so that Σ s_i w = sᵀ both_i x,
        `ahead`: rows e₀ᵀ Fᵗ (p + 1, p), so that d_t = ahead_t s.

    Each sum is doubled in length until nothing is left to add.
    """

    seen: Array
    both: Array
    ahead: Array

    @classmethod
    def of(cls, noise: NoiseModel) -> _Tail:
        order = noise.order
        step = np.eye(order, k=1)
        step[:, :1] += noise.coefficients[:, None]
        joint = np.kron(np.eye(2), step)
        joint[order:, :1] += noise.coefficients[:, None]
        first = np.zeros((order, order))
        first[:1, :1] = 1.0
        out = np.zeros(2 * order)
        out[[0, order] if order else []] = 1.0
        both = np.eye(order)[:, :, None] * out
        ahead = [np.eye(1, order)[0]]
        for _ in range(order):
            ahead.append(ahead[-1] @ step)
        seen = first
        for _ in range(_DOUBLINGS):
            if np.abs(joint).max(initial=0.0) < _GONE:
                break
            seen = seen + step.T @ seen @ step
            both = both + step.T @ both @ joint
            step, joint = step @ step, joint @ joint
        return cls(seen, both, np.array(ahead))

    def squares(self, state: Array) -> Array:
        """Σ y yᵀ (K, K) of columns whose filter stands at (p, K)."""
        return np.asarray(state.T @ self.seen @ state)

    def lagged(self, share: Array, second: Array, last: Array) -> Array:
        """Σ d_t w_{t-k} (p, P), k = 1 … p, from both states (p, P) and the last w (p, P)."""
        order, count = share.shape
        x = np.concatenate([share, second])
        pairs = (share[:, None, :] * x[None, :, :]).reshape(2 * order * order, count)
        told = self.ahead[1:] @ (self.both.reshape(order, -1) @ pairs)  # rows that are to come
        outputs = self.ahead[:-1] @ share
        for k in range(1, order + 1):
            told[k - 1] += np.einsum("tj,tj->j", outputs[:k], last[order - k :])
        return np.asarray(told)


def _degrees_of_freedom(slopes: Array, powers: Array, noise: NoiseModel) -> Array:
    gradient = slopes / np.where(powers > 0.0, powers, 1.0)
    spread = np.einsum("kj,kl,lj->j", gradient, noise.coefficient_covariance, gradient)
    return np.asarray(2.0 / (spread + 2.0 / (noise.samples - noise.parameters)))


def _errors(directions: Array, core: Array) -> Array:
    variances = np.einsum("mk,kl,ml->m", directions, core, directions)
    return np.sqrt(np.where(directions.any(axis=1), np.maximum(variances, 0.0), np.nan))
