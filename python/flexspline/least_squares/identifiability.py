"""Which coefficients the data determine, and which move together.

With columns scaled to length one and the singular values s of the design, a direction has the
condition index s_max / s. Directions with an index above 30 are near dependencies; coefficients
with more than half of their variance in them are confounded [Belsley1980],
unless each is resolved all the same: ten standard errors from zero and an index below 10⁴, or,
where a prior holds one of them, no error above a tenth of the largest contribution. A direction
that data and priors do not see at all (to rounding) is an exact dependency. What is known of a
confounded group are the combinations that its directions leave alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.effects.causes import OFFSET
from flexspline.least_squares.sums import Solution

__all__ = ["Combination", "Confounded", "confounded_groups"]

Array = NDArray[np.float64]

INDEX = 30.0
HOPELESS_INDEX = 1e4
RESOLVED = 10.0
SHARE = 0.5
TOUCHED = 0.05
NEGLIGIBLE = 1e-7
MOST_NAMES = 24  # in a sentence


@dataclass(frozen=True)
class Combination:
    """A sum of coefficients that the data determine: Σ weight · coefficient = value ± error.

    The unit is that of the first coefficient.
    """

    weights: tuple[tuple[str, float], ...]
    value: float
    standard_error: float
    unit: str

    def __str__(self) -> str:
        parts = []
        for name, weight in self.weights:
            size = "" if abs(abs(weight) - 1.0) < 1e-9 else f"{abs(weight):.4g}·"
            parts.append(f"{'−' if weight < 0 else '+'} {size}{name}")
        return " ".join(parts).removeprefix("+ ").replace("− ", "−", 1 if parts[0][0] == "−" else 0)


@dataclass(frozen=True)
class Confounded:
    """Coefficients that the data cannot tell apart.

    `exact`: no data of this kind could (to rounding); else these runs cannot. A group of one is
    a coefficient without any excitation. `condition`: index of the worst direction.
    """

    names: tuple[str, ...]
    exact: bool
    condition: float
    known: tuple[Combination, ...]

    @property
    def sentence(self) -> str:
        """What is confounded and why, in words."""
        if len(self.names) == 1:
            return f"{self.names[0]} is not excited by these runs: nothing is known of it"
        names, more = self.names, len(self.names) - MOST_NAMES
        if more > 1:
            names = (*names[:MOST_NAMES], f"{more} more")
        these = ", ".join(names[:-1]) + " and " + names[-1]
        if self.exact:
            return f"{these} are indistinguishable: their columns are linearly dependent"
        return f"{these} are indistinguishable in these runs (condition index {self.condition:.0f})"


def confounded_groups(
    solution: Solution,
    names: Sequence[str],
    units: Sequence[str],
    coefficients: Array,
    errors_of: Callable[[Array], Array],
    prior_rows: Array,
) -> list[Confounded]:
    """Find the groups of coefficients that move together.

    Parameters
    ----------
    solution : of the free columns, priors included.
    names, units, coefficients : (P,), of the free coefficients.
    errors_of : standard errors (m,) of combinations (m, P).
    prior_rows : (m, P), what priors added to the rows.
    """
    exact = _columns(solution.null_space * solution.lengths[:, None])
    near, index = _near(solution, coefficients, errors_of, prior_rows)
    directions = np.hstack([np.where(np.abs(exact) > NEGLIGIBLE, exact, 0.0), near])
    index = np.concatenate([np.full(exact.shape[1], np.inf), index])
    found = []
    for members, columns in _grouped(directions != 0.0):
        physical = directions[np.ix_(members, columns)] / solution.lengths[members][:, None]
        known = _known(members, physical, names, units, coefficients, errors_of)
        finite = index[columns][np.isfinite(index[columns])]
        found.append(
            Confounded(
                tuple(names[m] for m in members),
                not len(finite),
                float(finite.max(initial=0.0)) if len(finite) else np.inf,
                tuple(known),
            )
        )
    return found


def _near(
    solution: Solution,
    coefficients: Array,
    errors_of: Callable[[Array], Array],
    prior_rows: Array,
) -> tuple[Array, Array]:
    """Directions (P, k) of near dependencies, zero outside their members, and their index (k,)."""
    nothing = np.zeros((len(coefficients), 0)), np.zeros(0)
    scaled = solution.factor / solution.lengths
    if not scaled.size:
        return nothing
    _, singular, right = np.linalg.svd(scaled, full_matrices=False)
    index = singular[0] / singular
    weak = index > INDEX
    if not weak.any():
        return nothing
    variance = (right.T / singular) ** 2
    whole = np.maximum(variance.sum(axis=1), 1e-300)
    share = variance[:, weak].sum(axis=1) / whole
    member = (share > SHARE) & scaled.any(axis=0)  # a column of zeros has a part in no dependency
    errors = errors_of(np.eye(len(coefficients)))
    directions = np.where(member[:, None], right[weak].T, 0.0)
    touched = (variance[:, weak] / whole[:, None] > TOUCHED) & member[:, None]
    kept = []
    for members, columns in _grouped(touched):
        worst = index[weak][columns].max()
        resolved = np.abs(coefficients[members]) >= RESOLVED * errors[members]
        resolved_all = worst <= HOPELESS_INDEX and bool(resolved.all())
        held = _held_by_priors(members, solution, coefficients, errors, prior_rows)
        if len(members) > 1 and not resolved_all and not held:
            inside = np.zeros((len(coefficients), len(columns)))
            inside[members] = directions[np.ix_(members, columns)]
            kept.append((inside, index[weak][columns]))
    if not kept:
        return nothing
    return np.hstack([k[0] for k in kept]), np.concatenate([k[1] for k in kept])


def _held_by_priors(
    members: list[int], solution: Solution, coefficients: Array, errors: Array, prior_rows: Array
) -> bool:
    """Whether a prior holds one of the members, and with it all of them."""
    if not prior_rows[:, members].any():
        return False
    squares = solution.lengths**2 - (prior_rows**2).sum(axis=0)
    lengths = np.sqrt(np.maximum(squares, 0.0))[members]
    largest = np.abs(coefficients[members] * lengths).max()
    return bool((RESOLVED * errors[members] * lengths <= largest).all())


def _grouped(touched: NDArray[np.bool_]) -> list[tuple[list[int], list[int]]]:
    """Split directions, columns of (P, k), into groups that share no coefficient."""
    groups: list[tuple[set[int], list[int]]] = []
    for column in range(touched.shape[1]):
        members = set(np.flatnonzero(touched[:, column]).tolist())
        if not members:
            continue
        columns = [column]
        rest = []
        for other, its in groups:
            if other & members:
                members |= other
                columns = its + columns
            else:
                rest.append((other, its))
        groups = [*rest, (members, columns)]
    return [(sorted(members), columns) for members, columns in groups]


def _columns(matrix: Array) -> Array:
    """Scale each column to a largest entry of one."""
    largest = np.abs(matrix).max(axis=0, initial=1e-300)
    return np.asarray(matrix / np.where(largest > 0.0, largest, 1.0))


def _known(
    members: list[int],
    directions: Array,
    names: Sequence[str],
    units: Sequence[str],
    coefficients: Array,
    errors_of: Callable[[Array], Array],
) -> list[Combination]:
    """Combinations across which the directions do not reach, each led by another coefficient."""
    last = sorted(range(len(members)), key=lambda m: names[members[m]].startswith(OFFSET))
    found = []
    for weights in _reduced(_complement(directions[last])):
        full = np.zeros(len(coefficients))
        full[[members[m] for m in last]] = weights
        used = [members[m] for m in last if full[members[m]] != 0.0]
        named = tuple((names[k], float(full[k])) for k in used)
        error = float(errors_of(full[None, :])[0])
        found.append(Combination(named, float(full @ coefficients), error, units[used[0]]))
    return found


def _complement(directions: Array) -> Array:
    """Rows that are orthogonal to all directions, (g - k, g)."""
    scale = np.abs(directions).max(axis=1, initial=1e-300)
    left, singular, _ = np.linalg.svd(directions / scale[:, None])
    rank = int((singular > 1e-9 * singular[0]).sum())
    return np.asarray(left[:, rank:].T / scale)


def _reduced(rows: Array) -> Array:
    """Row echelon form with leading ones; rounding leftovers are taken away."""
    rows = rows.copy()
    lead = 0
    size = np.abs(rows).max(axis=0, initial=1e-300)
    for r in range(len(rows)):
        while lead < rows.shape[1]:
            pivot = r + int(np.argmax(np.abs(rows[r:, lead])))
            if abs(rows[pivot, lead]) > 1e-7 * size[lead]:
                break
            lead += 1
        if lead == rows.shape[1]:
            rows = rows[:r]
            break
        rows[[r, pivot]] = rows[[pivot, r]]
        rows[r] /= rows[r, lead]
        others = np.arange(len(rows)) != r
        rows[others] -= np.outer(rows[others, lead], rows[r])
        lead += 1
    snapped = np.round(rows)
    rows = np.where(np.abs(rows - snapped) < 1e-6, snapped, rows)
    return np.where(np.abs(rows) < 1e-9, 0.0, rows)
