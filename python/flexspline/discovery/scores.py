"""Every candidate in its best form beside a model: what it gains, and what it pays.

A ripple pays for each order that it takes, out of all that it may have. What evidence is, and its
price: `evidence.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.candidates import Candidate
from flexspline.discovery.dictionary import Dictionary
from flexspline.discovery.evidence import evidence_of, gain_of, price
from flexspline.discovery.physics import one_signed
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.table import Columns
from flexspline.effects import Effect

__all__ = ["Offer", "offers"]

Array = NDArray[np.float64]

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


def offers(
    dictionary: Dictionary, model: Columns, rivals: int, *, signed: bool = True
) -> list[Offer]:
    """Return every candidate in its best form beside these columns of the model.

    `signed`: whether coefficients have the signs that physics gives them.
    """
    total = dictionary.table.total
    left = dictionary.table.without(model)
    raw = np.diag(total)
    made = [_offer(c, dictionary, left, raw, rivals, signed) for c in dictionary.candidates]
    return [offer for offer in made if offer is not None]


def _offer(
    candidate: Candidate,
    dictionary: Dictionary,
    left: Array,
    raw: Array,
    rivals: int,
    signed: bool,
) -> Offer | None:
    if candidate.atoms:
        found = [_orders(v, atoms, dictionary, left, raw, rivals)
                 for v, atoms in zip(candidate.variants, candidate.atoms, strict=True)]  # fmt: skip
    else:
        forms = 0.5 * (1 + len(candidate.variants))
        signs = one_signed(candidate.name, dictionary.target) if signed else 0
        tried = [(v, evidence_of(v.name, signs, left, dictionary.at[v], raw))
                 for v in candidate.variants]  # fmt: skip
        best, told = max(tried, key=lambda pair: pair[1].gain)
        cost = told.price(forms, rivals) + SHAPE_PRICE * (forms > 1.0)
        found = [Offer(best, dictionary.at[best], told.gain, cost)]
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
    scale = np.sqrt(np.maximum(raw[columns], TINY))
    products = left[np.ix_(columns, columns)] / np.outer(scale, scale)
    return float(np.linalg.eigvalsh(products)[0]) >= SETTINGS.negligible
