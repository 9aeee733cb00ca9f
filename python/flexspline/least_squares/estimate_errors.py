"""Errors of an estimate, by plain or by generalised least squares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.least_squares.estimate import Estimate, noise_of, read_of
from flexspline.least_squares.late_load import Beside, basis_beside
from flexspline.least_squares.noise_model import Chunk, Chunks, noise_model
from flexspline.least_squares.problem import Problem, Run
from flexspline.least_squares.shapes import Tangent, filtered
from flexspline.least_squares.uncertainty import Prior, Uncertainty, parameter_uncertainty

__all__ = ["uncertainty_of"]

Array = NDArray[np.float64]


def uncertainty_of(made: Estimate, columns: Sequence[Array] | None = None) -> Uncertainty:
    """Return the errors of fitted coefficients and free shapes, in this order.

    `columns`: one of each run, (N,), beside which the estimate was made; its error comes last.
    """
    if made.denominator is not None:
        return _generalised(made, made.denominator)
    every, basis, known = read_of(made), made.basis, made.prior_rows
    tangent: Tangent | Beside = made.tangent
    if columns is not None:
        tangent = Beside(made.tangent, tuple(columns))
        basis = basis_beside(made, columns)
        known = np.hstack([known, np.zeros((len(known), 1))])
    problem, chunks = made.tangent.problem, tangent.some(every)
    noise = noise_model(chunks, basis, decimation=problem.decimation, offsets=problem.centred)
    prior = None
    if len(known):  # weighed against every row, while the noise model may skip some
        scale = np.sqrt(noise.decimation)
        errors = np.full(len(known), np.sqrt(made.noise_variance) / scale)
        prior = Prior(known / scale, errors)
    rows = sum(run.counted for run in problem.runs) // noise.decimation
    if every > 1:
        return parameter_uncertainty(chunks, basis, noise, prior, rows)
    left_out = sum(last - first for run in problem.runs for first, last in _left_out(run))
    chunks = _going_on(tangent, problem) if left_out else chunks
    left_out //= noise.decimation
    return parameter_uncertainty(chunks, basis, noise, prior, left_out=left_out)


def _left_out(run: Run) -> list[tuple[int, int]]:
    """Row ranges [first, last) between rows that count, through which the recording goes on."""
    return [
        (end, start)
        for (_, end), (start, _) in pairwise(run.stretches)
        if start > end and any(a < end and start < b for a, b in run.whole or ())
    ]


def _going_on(tangent: Tangent | Beside, problem: Problem) -> Chunks:
    """The rows of a fit, and rows of nothing where some inside a run do not count.

    Noise goes on while rows are left out, and couples what stands on both sides.
    """

    def chunks() -> Iterator[Chunk]:
        gaps = [{start: start - end for end, start in _left_out(run)} for run in problem.runs]
        for number, rows, chunk in tangent.pieces():
            gap = gaps[number].get(rows.start, 0)
            if gap:
                nothing = np.zeros(gap)
                on = np.zeros(gap, dtype=bool)
                yield Chunk(np.zeros((gap, chunk.rows.shape[1])), nothing, on)
                chunk = replace(chunk, starts=np.zeros(len(chunk.residual), dtype=bool))
            yield chunk

    return chunks


def _generalised(made: Estimate, denominator: Array) -> Uncertainty:
    """Errors on the filtered rows; what else is told of the noise is that of the rows as such."""
    noise = noise_of(made)
    plain = parameter_uncertainty(made.tangent, made.basis, noise)
    chunks = filtered(made.tangent, denominator)
    found = parameter_uncertainty(chunks, made.basis, noise_model(chunks, made.basis))
    freedom = np.minimum(found.degrees_of_freedom, plain.degrees_of_freedom)
    return replace(plain, core=found.core, degrees_of_freedom=freedom)
