"""How much a candidate explains beside a model, and what it pays for being one of many.

The gain is the fall of squares over σ² when its columns join the model: χ² with as many degrees
of freedom as it has columns where it is not there. Of m candidates, each in v forms, the best
reaches the χ² of probability α / (m v) by chance in a share α of all logs; that is the price that
each pays, so that effects with many columns or forms and those with few compete on equal terms.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln
from scipy.stats import chi2, norm

from flexspline.discovery.candidates import Candidate
from flexspline.discovery.dictionary import Dictionary
from flexspline.discovery.table import SINGULAR, Columns
from flexspline.effects import Effect

__all__ = ["Offer", "equivalent_t", "gain_of", "offers", "price"]

Array = NDArray[np.float64]

ALPHA = 0.01  # that logs which hide nothing get a name
UNSEEN = 1e-7  # of a column's squares that the model leaves: nothing is seen of it
LARGE = 600.0  # χ² above which its tail is taken from the asymptotic series
PARTED = 0.01  # of an order's squares that no other holds: below, large ones cancel each other
SHAPE_PRICE = 2.0  # χ² that a shape takes for itself when it is fitted


@dataclass(frozen=True)
class Offer:
    """A candidate in its best form beside a model: what it gains, and its price, in χ²."""

    effect: Effect
    columns: Columns
    gain: float
    price: float

    @property
    def net(self) -> float:
        """Gain above the price."""
        return self.gain - self.price


@lru_cache(maxsize=4096)  # a search asks for few of them, very often
def price(columns: int, forms: float, rivals: int) -> float:
    """Return the χ² that the best of `rivals` reaches by chance in a share α of all logs."""
    return float(chi2.isf(ALPHA / max(rivals, 1) / max(forms, 1.0), columns))


def equivalent_t(gain: float, columns: int) -> float:
    """Return the |t| of a normal number that is as surprising as a χ² of so many columns."""
    if gain < LARGE:
        return float(norm.isf(0.5 * chi2.sf(max(gain, 0.0), columns)))
    half = 0.5 * columns
    log_p = -0.5 * gain + (half - 1.0) * np.log(0.5 * gain) - gammaln(half)
    return float(np.sqrt(-2.0 * log_p - np.log(-np.pi * log_p)))


def offers(dictionary: Dictionary, model: Columns, rivals: int) -> list[Offer]:
    """Return every candidate in its best form beside these columns of the model."""
    total = dictionary.table.total
    left = dictionary.table.without(model)
    raw = np.diag(total)
    made = [_offer(c, dictionary, left, raw, rivals) for c in dictionary.candidates]
    return [offer for offer in made if offer is not None]


def _offer(
    candidate: Candidate, dictionary: Dictionary, left: Array, raw: Array, rivals: int
) -> Offer | None:
    if candidate.atoms:
        found = [_orders(v, atoms, dictionary, left, raw, rivals)
                 for v, atoms in zip(candidate.variants, candidate.atoms, strict=True)]  # fmt: skip
    else:
        forms = 0.5 * (1 + len(candidate.variants))
        found = []
        for variant in candidate.variants:
            columns = dictionary.at[variant]
            gain, seen = gain_of(left, columns, raw)
            cost = price(max(seen, 1), forms, rivals) + SHAPE_PRICE * (forms > 1.0)
            found.append(Offer(variant, columns, gain, cost))
    return max(found, key=lambda offer: offer.net, default=None)


def _orders(
    variant: Effect,
    atoms: tuple[Effect, ...],
    dictionary: Dictionary,
    left: Array,
    raw: Array,
    rivals: int,
) -> Offer:
    """Take the orders of a ripple effect one after the other, as long as one pays its price."""
    chosen: list[Effect] = []
    columns, gain, cost = np.empty(0, dtype=np.intp), 0.0, 0.0
    each = price(2, len(atoms), rivals)
    while len(chosen) < len(atoms):
        trials = []
        for atom in (a for a in atoms if a not in chosen):
            both = np.concatenate([columns, dictionary.at[atom]])
            if not chosen or _parted(left, both, raw):
                trials.append((gain_of(left, both, raw)[0], atom, both))
        if not trials:
            break
        reached, atom, both = max(trials, key=lambda trial: trial[0])
        if chosen and reached - gain < each:
            break
        chosen.append(atom)
        columns, gain, cost = both, reached, cost + each
    harmonics = [h for atom in chosen for h in atom.harmonics]
    return Offer(variant.with_orders(harmonics), columns, gain, cost)


def _parted(left: Array, columns: Columns, raw: Array) -> bool:
    """Whether every mix of these columns keeps a share of its squares beside the model."""
    scale = np.sqrt(np.maximum(raw[columns], 1e-300))
    products = left[np.ix_(columns, columns)] / np.outer(scale, scale)
    return float(np.linalg.eigvalsh(products)[0]) >= PARTED


def gain_of(left: Array, columns: Columns, raw: Array) -> tuple[float, int]:
    """Squares over σ² that columns explain of what the model leaves, and how many are seen."""
    scale = np.sqrt(np.maximum(raw[columns], 1e-300))
    products = left[np.ix_(columns, columns)] / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(products)
    seen = (values > UNSEEN) & (values > SINGULAR * max(float(values.max()), 1e-300))
    along = vectors[:, seen].T @ (left[columns, -1] / scale)
    return float(np.sum(along**2 / values[seen])), int(seen.sum())
