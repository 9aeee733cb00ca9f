"""What the residual of a fit says about the noise: an autoregressive model of order p.

    e_t = φ_1 e_{t-1} + … + φ_p e_{t-p} + w_t,     w_t white with variance σ²

The terms of a fit swallow part of the slow noise, so φ straight from the residual is too white
and intervals built on it are too narrow. Here φ maximises the *restricted* likelihood, that of
what the terms cannot reach, by EM with the terms' coefficients β as missing data under a flat
prior: with z_t = [x_t, r_t] (row and residual), C_ij = Σ_t z_{t-i} z_{t-j}ᵀ, a = [1, -φ],

    M(φ) = Σ_ij a_i a_j C_ij                      (sums of products of the whitened rows)
    β    = M_xx⁻¹ M_xr,  u = [-β, 1],  σ² = uᵀ M u / (n - P)
    Q_ij = uᵀ C_ij u + σ² tr(M_xx⁻¹ C_ij,xx)      (expected products of the *noise*)
    φ    = the least-squares solution with Q      (and again)

Where each stretch has an offset o of its own, taken out of the rows, these are missing data too:
given β, o is N(m / A(1), σ² / (n A(1)²)) with m the mean of the whitened residual over the n rows
of the stretch, and A(1) = Σ a_i. With D_ij = Σ n m_i m_jᵀ over the R stretches, m_i the mean of
z_{t-i}, the work stays that of the other terms:

    M(φ) = Σ_ij a_i a_j (C_ij − D_ij),     n − P − R degrees of freedom
    Q_ij = <C_ij − d_i − d_j + d> + R σ² / A(1)²
    d_i  = Σ_j a_j D_ij / A(1),     d = Σ_i a_i d_i / A(1)

with <·> the expectation that makes Q of C above.

One pass collects C. Likelihoods are conditional on the first p rows of every stretch of samples.

Misfit. EM takes what β at φ leaves for the noise, and this β is that of generalised least squares,
not that of the fit. Under right terms the two differ by no more than noise. Where a term is missing
(friction that takes its level over some way, fitted by a step) the restricted likelihood can be
largest where the *terms* are called noise: β far from the fit's, and noise far larger and slower
than the residual. So its spectrum f is compared with the residual's own, f_r, of the autoregression
straight from C_rr. P terms take no more than P directions out of n rows. So where the noise has the
spectrum f, the chance that as little as f_r is left in the J lowest of n frequencies is

    log p ≤ s J − ½ (Σ_J log(1 + 2 s f/f_r) − P max_J log(1 + 2 s f/f_r))     for any s > 0

by Chernoff's bound, the determinant by Szegő's theorem, and its part that P directions take away by
interlacing. Where that says that the residual contradicts the noise, Q is C_rr + h (Q − C_rr), with
the largest share h of what the terms seem to hide that the residual does not contradict. Misfit is
no noise that an order could be chosen for, and may lie over slow noise: the largest order is taken.

Sources: [PattersonThompson1971] (restricted likelihood), [CooperThompson1977] (ARMA),
[Dempster1977] (EM), [MengRubin1991] (information), [HurvichTsai1989] (AICc picks p),
[Chernoff1952] (the bound), [GrenanderSzego1958] (the determinant).

Each of many runs may have terms of its own, which have no columns. Least squares beside such terms
is least squares on rows and target less what these can make of them in their run [FrischWaugh1933],
[Lovell1963]. What is left of the noise has lost the directions Q of the terms, and autoregression
straight from it is too white. So the noise is read in some runs, spread evenly among all, with Q of
each of these as columns: there the restricted likelihood is exact, and the work does not grow with
the number of runs. The model takes the noise to be the same in all of them, as the fit does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.signal import lfilter

from flexspline.errors import InputError
from flexspline.least_squares.problem import Problem

if TYPE_CHECKING:
    from flexspline.least_squares.late_load import Beside
    from flexspline.least_squares.shapes import Tangent

Array = NDArray[np.float64]

BLOCK = 4096  # rows handled at once: bounds the memory
_FIRST_ORDER = 8
_LARGEST_SUMS = 2_000_000  # numbers in C, 16 MB
_LONGEST_ITERATION = 100
_MOST_HIDDEN = 1.0 - 1.0 / _LONGEST_ITERATION  # no rate nearer to 1 is seen in so many steps of EM
_STEP = 0.1  # of a standard error
_RIDGE = 1e-13
_LEAST_GAIN = 1e-6  # of A(1), by which offsets are divided: noise as slow as that is an offset
_FREQUENCIES = 1 << 14

_CONTRADICTED = 1e-6
"""Chance below which a residual contradicts the noise: one fit in a million.

In 5 600 simulated logs with all terms in the model and roots up to 0.9999, order 8 and more, the
least was 0.04; with friction that takes its level over some way, fitted by a step, it is 1e-50 and
less. Half and double decide the same in all of them and move errors by 1.5 % where the residual
contradicts; 1e-3 narrows them by 15 %, and under misfit no longer covers what noise with a root of
0.9988 does.
"""
_BANDS = 1 << 11  # of frequency; a peak narrower than one counts as less than it is
_BOUNDS = 0.5 ** np.arange(20)  # s: each gives a bound, the least counts; best near f_r / 2 f

_LEAST_SHARE = 1e-9  # of what the terms seem to hide: nothing of it
_HALVINGS = 12  # of that range on a logarithmic scale: errors to 0.3 %

SOME_RUNS = 15
"""Runs that tell of the noise: below the number from which terms are taken out.

A degree of freedom of each term is lost in each run, so that what is told grows with the rows.
"""


@dataclass(frozen=True, eq=False)
class Chunk:
    """Consecutive rows of the least-squares problem, as the fit solved it.

    `rows`: (n, P), one column per parameter; a fitted shape is the column ∂(prediction)/∂shape.
    `residual`: (n,), reading minus prediction, in the unit of the target.
    `starts`: (n,) bool, true on the first sample of a run and after a gap.
    `weights`: (n,), Huber's in a robust fit, 1 inside the threshold; None: plain least squares.
    """

    rows: Array
    residual: Array
    starts: NDArray[np.bool_]
    weights: Array | None = None


Chunks = Callable[[], Iterator[Chunk]]


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Autoregressive noise, with how well it is known.

    `coefficients`: (p,) φ_1…φ_p. `innovation_variance`: σ², squared unit of the target.
    `coefficient_covariance`: (p, p), of φ. `samples`: rows that the likelihood used.
    `parameters`: P, fitted out. `decimation`: one row of so many was taken; memory counts these.
    """

    coefficients: Array
    innovation_variance: float
    coefficient_covariance: Array
    samples: int
    parameters: int
    decimation: int

    @property
    def order(self) -> int:
        return len(self.coefficients)

    @property
    def denominator(self) -> Array:
        """A = [1, -φ_1, …, -φ_p]: noise is white noise through 1/A."""
        return np.append(1.0, -self.coefficients)

    @property
    def largest_root(self) -> float:
        """Modulus of the slowest root of A, 0 for white noise, always below 1."""
        return float(np.abs(np.roots(self.denominator)).max(initial=0.0))

    @property
    def memory(self) -> float:
        """Rows per piece of news: peak of the spectrum over its mean; (1+φ)/(1-φ) for AR(1).

        1 where there is no noise.
        """
        if not self.variance > 0.0:
            return 1.0
        response = np.abs(np.fft.rfft(self.denominator, _FREQUENCIES)) ** -2.0
        return float(response.max()) * self.innovation_variance / self.variance

    @property
    def variance(self) -> float:
        """Variance of the noise at one sample, γ_0, by Levinson's recursion downwards."""
        a, share = self.denominator, 1.0
        while len(a) > 1:
            kept = 1.0 - a[-1] ** 2
            a = (a - a[-1] * a[::-1])[:-1] / kept
            share *= kept
        return self.innovation_variance / float(share)

    @property
    def long_run_variance(self) -> float:
        """N times the variance of the mean of N → ∞ samples, σ² / A(1)²."""
        return self.innovation_variance / float(self.denominator.sum()) ** 2

    def filter(self, columns: Array, state: Array) -> tuple[Array, Array]:
        """Columns (n, K) through 1/A, with the state (p, K) carried in and out."""
        if self.order == 0 or not len(columns):
            return columns, state  # of no rows SciPy gives a state that nobody has written
        filtered, state = lfilter([1.0], self.denominator, columns.T, zi=state.T)
        return filtered.T, state.T


def pieces(
    chunks: Chunks, basis: Array, decimation: int = 1, every: int = 1
) -> Iterator[tuple[bool, Array, Array, Array]]:
    """Cut chunks into blocks of one stretch: (starts anew, rows @ basis, noise, slope).

    With Huber weights w the noise is w·r and the slope its derivative: 1 inside the threshold, 0
    outside ([HuberRonchetti2009], section 7.6). One chunk of `every` is read, and starts anew.
    """
    position = 0
    for number, chunk in enumerate(chunks()):
        if number % every:
            continue
        count = len(chunk.residual)
        weights = np.ones(count) if chunk.weights is None else chunk.weights
        marks = {*range(0, count, BLOCK), *np.flatnonzero(chunk.starts).tolist(), count}
        for first, last in pairwise(sorted(marks)):
            unconnected = first == 0 and (number == 0 or every > 1)
            starts = unconnected or bool(chunk.starts[first])
            position = 0 if starts else position
            taken = slice(first + -position % decimation, last, decimation)
            position += last - first
            slope = (weights[taken] >= 1.0).astype(np.float64)
            yield starts, chunk.rows[taken] @ basis, chunk.residual[taken] * weights[taken], slope


def noise_model(
    chunks: Chunks, basis: Array, *, max_order: int = 32, every: int = 1, decimation: int = 1,
    floor: float = 0.0, offsets: bool = False,
) -> NoiseModel:  # fmt: skip
    """Fit the noise to the residual of a least-squares fit, in one pass over the data or a few.

    Orders up to 8 first; while the corrected AIC wants nearly all it is offered (slow noise
    under white measurement noise does), one more pass offers twice as many.

    Parameters
    ----------
    chunks : gives a new iterator over the rows of the problem, in order, at each call.
    basis : (P, K), spans what the data determine, with rows @ basis about orthonormal: V/s of a
        singular value decomposition, or the inverse of R of a QR decomposition.
    max_order : the largest order p ever tried; fewer for many parameters, to bound the memory.
    every : use one chunk of so many; enough for logs above a million rows.
    decimation : use one row of so many: floor(rate / (2.5 f_c)) for a target and rows that were
        low-passed at f_c, as above f_c there is nothing left that a model could hold on to.
    floor : white noise counted in as well, as a share of the residual's mean square.
    offsets : an offset of each stretch was fitted and taken out of the rows.

    Raises
    ------
    InputError : fewer rows than parameters and order need, or a residual that is not finite.
    """
    parameters = basis.shape[1]
    top = max(1, min(max_order, isqrt(_LARGEST_SUMS) // (parameters + 1) - 1))
    order, before, best = min(_FIRST_ORDER, top), 0, None
    while True:
        products, samples = _collect(chunks, basis, order, every, decimation, offsets)
        if best is not None and samples < 0.9 * before:
            return best
        sums, fitted = products.sums, parameters + products.offsets
        sums[range(order + 1), range(order + 1), -1, -1] += floor * sums[0, 0, -1, -1]
        _require_usable(sums, samples - fitted, order)
        best, before = _restricted_fit(products, samples, fitted, decimation), samples
        if best.order < 0.75 * order or order == top or samples < 40 * order:
            return best
        order = min(2 * order, top)


def _require_usable(products: Array, degrees: int, order: int) -> None:
    if degrees < 2 * order + 2:
        raise InputError(
            f"The residual has only {degrees} usable rows more than parameters, too few for a "
            f"noise model of order {order}; give longer logs or a smaller max_order."
        )
    if not np.isfinite(products).all():
        raise InputError("A residual or a row of the fit is not finite; check the logs for NaN.")


@dataclass(frozen=True, eq=False)
class _Products:
    """`sums`: C, (p+1, p+1, K, K). `means`: D, the same. `offsets`: R, how many were taken out."""

    sums: Array
    means: Array
    offsets: int

    def up_to(self, order: int) -> _Products:
        """The same of a lower order."""
        kept = slice(order + 1)
        return replace(self, sums=self.sums[kept, kept], means=self.means[kept, kept])


class _Means:
    """Σ n m_i m_jᵀ over stretches, m_i the mean (K,) of z_{t-i} over the n rows of one."""

    def __init__(self, order: int, width: int) -> None:
        self.products = np.zeros((order + 1, order + 1, width, width))
        self.stretches = 0
        self._total, self._rows = np.zeros((order + 1, width)), 0

    def add(self, z: Array) -> None:
        """Rows (n + p, K) of a stretch, the first p of which were counted before."""
        order, count = len(self._total) - 1, len(z)
        self._total += [z[order - i : count - i].sum(axis=0) for i in range(order + 1)]
        self._rows += count - order

    def close(self) -> None:
        """End of a stretch."""
        if self._rows:
            self.products += np.einsum("ik,jl->ijkl", self._total, self._total) / self._rows
            self.stretches += 1
        self._total, self._rows = np.zeros_like(self._total), 0


def _collect(
    chunks: Chunks, basis: Array, order: int, every: int, decimation: int, offsets: bool
) -> tuple[_Products, int]:
    """The sums of all stretches and how many rows are in them."""
    width = basis.shape[1] + 1
    products, means = np.zeros((order + 1, order + 1, width, width)), _Means(order, width)
    samples, tail = 0, np.empty((0, width))
    for starts, rows, noise, slope in pieces(chunks, basis, decimation, every):
        z = np.column_stack([rows * slope[:, None], noise])
        if starts:
            means.close()
        z = z if starts else np.concatenate([tail, z])
        if len(z) > order:
            products += lagged_products(z, order)
            samples += len(z) - order
            if offsets:
                means.add(z)
        tail = z[max(0, len(z) - order) :]
    means.close()
    return _Products(products, means.products, means.stretches), samples


def lagged_products(z: Array, order: int) -> Array:
    """C_ij = Σ_{t≥p} z_{t-i} z_{t-j}ᵀ as (p+1, p+1, K, K), for z of (n > p, K).

    Only C_0j are sums over time; the others follow from C_{i+1,j+1} = C_ij + first - last.
    """
    count, width = z.shape
    head, tail = z[:order][::-1], z[count - order :][::-1]  # z_{p-1-i} and z_{n-1-i}
    products = np.empty((order + 1, order + 1, width, width))
    for j in range(order + 1):
        products[0, j] = z[order:].T @ z[order - j : count - j]
        products[j, 0] = products[0, j].T
    for i in range(order):
        gained = head[i, None, :, None] * head[:, None, :]
        lost = tail[i, None, :, None] * tail[:, None, :]
        products[i + 1, 1:] = products[i, :-1] + gained - lost
    return products


def _restricted_fit(
    products: _Products, samples: int, parameters: int, decimation: int
) -> NoiseModel:
    """Choose the order with the expected products of the largest one, then fit that order."""
    degrees = samples - parameters
    expected, residual = _iterate(products, degrees)[1], products.sums[:, :, -1, -1]
    misfit = _contradicted(expected, residual, samples, parameters)
    if misfit:
        expected = _largest_share(expected, residual, samples, parameters)
        phi = _solve(expected)
        variance = _innovations(phi, expected) / samples
    else:
        products = products.up_to(_choose_order(expected, samples))
        phi, expected = _iterate(products, degrees)
        variance = _expected_products(phi, products, degrees)[1]
    spread = np.asarray(variance * np.linalg.pinv(expected[1:, 1:], hermitian=True), np.float64)
    if not misfit:  # where it is, what is hidden is no estimate but the most that can be
        spread = _coefficient_covariance(phi, products, degrees, spread)
    return NoiseModel(_stationary(phi, samples), variance, spread, samples, parameters, decimation)


def _contradicted(expected: Array, residual: Array, samples: int, parameters: int) -> bool:
    """Whether noise with the products Q leaves more than the residual's C_rr says that there is."""
    if not residual[0, 0] > 0.0:
        return False
    swollen = np.log1p(2.0 * _BOUNDS[:, None] * (_spectrum(expected) / _spectrum(residual)))
    lowest = samples / _BANDS * np.arange(1, _BANDS + 1)  # J
    left = samples / _BANDS * np.cumsum(swollen, axis=1)
    left -= np.minimum(parameters, lowest) * np.maximum.accumulate(swollen, axis=1)
    return bool((_BOUNDS[:, None] * lowest - 0.5 * left).min() < np.log(_CONTRADICTED))


def _largest_share(expected: Array, residual: Array, samples: int, parameters: int) -> Array:
    """Products C_rr + h (Q − C_rr) with the largest h that the residual does not contradict."""
    least, most = np.log(_LEAST_SHARE), 0.0  # of log h
    for _ in range(_HALVINGS):
        middle = 0.5 * (least + most)
        trial = residual + np.exp(middle) * (expected - residual)
        if _contradicted(trial, residual, samples, parameters):
            most = middle
        else:
            least = middle
    return np.asarray(residual + np.exp(least) * (expected - residual))


def _innovations(phi: Array, products: Array) -> float:
    """Sum of squares that the coefficients leave of noise with these products."""
    a = np.append(1.0, -phi)
    return float(a @ products @ a)


def _spectrum(products: Array) -> Array:
    """Spectrum of the noise with these products, in the middle of equal bands of frequency."""
    phi = _solve(products)
    turned = np.append(1.0, -phi) * np.exp(-0.5j * np.pi / _BANDS * np.arange(len(products)))
    squares = max(_innovations(phi, products), _RIDGE * float(products[0, 0]))  # above rounding
    return np.asarray(squares * np.abs(np.fft.fft(turned, 2 * _BANDS)[:_BANDS]) ** -2.0)


def _expected_products(phi: Array, products: _Products, degrees: int) -> tuple[Array, float]:
    """Q and σ² of the E-step at φ."""
    a, width = np.append(1.0, -phi), products.sums.shape[2]
    flat, means = (x.reshape(len(a) ** 2, width**2) for x in (products.sums, products.means))
    whitened = (np.outer(a, a).ravel() @ (flat - means)).reshape(width, width)
    terms = whitened[:-1, :-1]
    rounding = _RIDGE * np.trace(products.sums[0, 0, :-1, :-1])
    inverse = np.linalg.inv(terms + rounding * np.eye(width - 1))
    u = np.append(-inverse @ whitened[:-1, -1], 1.0)
    variance = float(u @ whitened @ u) / degrees
    weight = np.outer(u, u)
    weight[:-1, :-1] += variance * inverse
    expected = (flat @ weight.ravel()).reshape(len(a), len(a))
    if products.offsets:
        gain = max(float(a.sum()), _LEAST_GAIN)
        across = (means @ weight.ravel()).reshape(len(a), len(a)) @ a / gain
        known = float(a @ across) / gain + products.offsets * variance / gain**2
        expected = expected - across[:, None] - across[None, :] + known
    return expected, variance


def _iterate(products: _Products, degrees: int) -> tuple[Array, Array]:
    """EM from the plain least-squares coefficients until a step is 1/1000 of their error."""
    phi = _solve(products.sums[:, :, -1, -1])
    for _ in range(_LONGEST_ITERATION):
        expected, variance = _expected_products(phi, products, degrees)
        step = _solve(expected) - phi
        phi = phi + step
        if step @ expected[1:, 1:] @ step <= 1e-6 * variance:
            break
    return phi, expected


def _solve(expected: Array) -> Array:
    return np.asarray(np.linalg.lstsq(expected[1:, 1:], expected[1:, 0], rcond=1e-14)[0])


def _choose_order(expected: Array, samples: int) -> int:
    """Order with the least AICc, n log RSS_p + 2 (p + 1) n / (n - p - 2)."""
    scores = []
    for order in range(len(expected)):
        phi = _solve(expected[: order + 1, : order + 1])
        rest = max(expected[0, 0] - phi @ expected[1 : order + 1, 0], np.finfo(float).tiny)
        scores.append(samples * (np.log(rest) + 2.0 * (order + 1) / (samples - order - 2)))
    return int(np.argmin(scores))


def _coefficient_covariance(phi: Array, products: _Products, degrees: int, known: Array) -> Array:
    """σ² Q⁻¹, if the noise were known, widened by what EM says the terms hid: (I - DM)⁻¹.

    The rate DM of EM is taken along the principal axes of σ² Q⁻¹ = C Cᵀ, in their standard errors:
    coefficients of a smooth noise are correlated so strongly that a step in one of them alone is
    thousands of standard errors long across. There C⁻¹ DM C is symmetric, with eigenvalues from 0
    (nothing hidden) to below 1: what an EM that has not ended says beyond is rounding.
    """
    centre = _solve(_expected_products(phi, products, degrees)[0])
    powers, axes = np.linalg.eigh(known)
    sizes = np.sqrt(np.maximum(powers, np.finfo(float).tiny))  # 0 without any noise
    moved = [
        _solve(_expected_products(phi + _STEP * size * axis, products, degrees)[0]) - centre
        for size, axis in zip(sizes, axes.T, strict=True)
    ]
    rate = (axes.T @ np.transpose(moved)) / sizes[:, None] / _STEP
    hidden, across = np.linalg.eigh(0.5 * (rate + rate.T))
    wide = axes * sizes @ across / np.sqrt(1.0 - np.clip(hidden, 0.0, _MOST_HIDDEN))
    return np.asarray(wide @ wide.T)


def _stationary(phi: Array, samples: int) -> Array:
    """Pull roots back to modulus 1 - 1/n at most: slower noise cannot be seen in n samples."""
    limit = 1.0 - 1.0 / samples
    root = np.abs(np.roots(np.append(1.0, -phi))).max(initial=limit)
    return np.asarray(phi * (limit / root) ** np.arange(1, len(phi) + 1))


def noise_beside_own(tangent: Tangent | Beside, problem: Problem, basis: Array) -> NoiseModel:
    """Return the model of the noise, read in some runs.

    Parameters
    ----------
    tangent : rows less what the runs' own terms make of them.
    basis : as `noise_model` takes it.
    """
    count = len(problem.runs)
    some = np.unique(np.linspace(0, count - 1, min(SOME_RUNS, count)).round().astype(int)).tolist()
    own = [problem.own_basis(number).rows.shape[1] for number in some]
    first = np.cumsum([0, *own])

    def chunks() -> Iterator[Chunk]:
        for number, rows, chunk in tangent.pieces():
            if number in some:
                at = some.index(number)
                columns = np.zeros((len(chunk.residual), int(first[-1])))
                columns[:, first[at] : first[at + 1]] = problem.own_basis(number).rows[rows]
                yield replace(chunk, rows=np.hstack([chunk.rows, columns]))

    whole = block_diag(basis, np.eye(int(first[-1])))
    found = noise_model(chunks, whole, decimation=problem.decimation)
    fitted = basis.shape[1] + sum(problem.own_basis(k).rows.shape[1] for k in range(count))
    spare = found.samples - found.parameters  # the degrees of freedom that are behind the model
    return replace(found, parameters=fitted, samples=spare + fitted)


def beside_own(
    pieces: Iterable[tuple[int, slice, Chunk]], problem: Problem
) -> Iterator[tuple[int, slice, Chunk]]:
    """Give pieces of rows with the directions of their run's own terms behind them."""
    for number, rows, chunk in pieces:
        own = problem.own_basis(number).rows[rows]
        yield number, rows, replace(chunk, rows=np.hstack([chunk.rows, own]))
