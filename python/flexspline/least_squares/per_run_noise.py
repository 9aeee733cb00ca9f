"""The noise beside terms that each of many runs has of its own, without columns for all of them.

Least squares beside such terms is least squares on rows and target less what these can make of them
in their run [FrischWaugh1933], [Lovell1963]. What is left of the noise has lost the directions Q of
the terms, and autoregression straight from it is too white. So the noise is read in some runs,
spread evenly among all, with Q of each of these as columns: there the restricted likelihood of
`noise_model.py` is exact, and the work does not grow with the number of runs. The model takes the
noise to be the same in all of them, as the fit does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from flexspline.least_squares.noise_model import Chunk, NoiseModel, noise_model
from flexspline.least_squares.problem import Problem

if TYPE_CHECKING:
    from flexspline.least_squares.late_load import Beside
    from flexspline.least_squares.shapes import Tangent

__all__ = ["beside_own", "noise_beside_own"]

Array = NDArray[np.float64]

SOME_RUNS = 15
"""Runs that tell of the noise: below the number from which terms are taken out.

A degree of freedom of each term is lost in each run, so that what is told grows with the rows.
"""


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
