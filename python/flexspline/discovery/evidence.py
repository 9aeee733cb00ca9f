"""What columns explain beside a model, and what they have to explain to be no chance.

The gain is the fall of squares over σ² when columns join the model: χ² with as many degrees of
freedom as there are columns where nothing is. Of m candidates, each in v forms, the best reaches
the χ² of probability α / (m v) by chance in a share α of all logs; that is the price that each
pays, so that effects with many columns or forms and those with few compete on equal terms.

What physics says of the coefficients makes chance smaller: those of one sign lie in a cone
(`cone.py`), a friction or a mass of a drive has one sign of two. And the orders of a series become
smaller: the first may pay alone, at the price of half a chance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln
from scipy.stats import chi2, norm

from flexspline.discovery.cone import cone_gain, cone_price
from flexspline.discovery.physics import VARYING
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.table import SINGULAR, Columns

__all__ = ["Evidence", "equivalent_t", "evidence_of", "gain_of", "price"]

Array = NDArray[np.float64]

FIRST = {VARYING: 2}
"""Columns of the first order of a series."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What columns gain beside a model, in χ².

    `count`: columns that are seen. `signs`: see `one_signed`. `products`: of the columns (K, K),
    where their coefficients have one sign. `first`: gain of the first order alone, of a series.
    """

    gain: float
    count: int
    signs: int
    products: Array | None = None
    first: float | None = None

    def price(self, forms: float, rivals: int) -> float:
        """Return what the best of `rivals` in so many forms gains by chance in a share α of logs.

        Of a series, less what the first order gains above its price where that is more.
        """
        if self.products is not None:
            return cone_price(self.products, _share(forms, rivals), either=self.signs > 1)
        if self.first is not None:
            all_orders = price(self.count, 2.0 * forms, rivals)
            alone = price(min(self.count, 2), 2.0 * forms, rivals) + self.gain - self.first
            return min(all_orders, alone)
        if self.signs == 1 and self.count == 1:
            return float(chi2.isf(2.0 * _share(forms, rivals), 1))
        return price(self.count, forms, rivals)


def evidence_of(name: str, signs: int, left: Array, columns: Columns, raw: Array) -> Evidence:
    """Return what the columns of an effect gain of what a model leaves.

    `signs`: that its coefficients may all have, see `one_signed`. `left`: products (C + 1, C + 1)
    of all columns and the target, less what the model explains.
    `raw`: the squares of the columns before.
    """
    gain, seen = gain_of(left, columns, raw)
    if signs and seen == len(columns) > 1:
        products = left[np.ix_(columns, columns)]
        gain = cone_gain(products, left[columns, -1], either=signs > 1)
        return Evidence(gain, seen, signs, products)
    first = gain_of(left, columns[: FIRST[name]], raw)[0] if name in FIRST else None
    return Evidence(gain, max(seen, 1), signs, None, first)


@cache  # a search asks for few of them, very often
def price(columns: int, forms: float, rivals: int) -> float:
    """Return the χ² that the best of `rivals` reaches by chance in a share α of all logs."""
    return float(chi2.isf(_share(forms, rivals), columns))


def _share(forms: float, rivals: int) -> float:
    return SETTINGS.alpha / max(rivals, 1) / max(forms, 1.0)


def equivalent_t(gain: float, columns: int) -> float:
    """Return the |t| of a normal number that is as surprising as a χ² of so many columns."""
    tail = float(chi2.sf(max(gain, 0.0), columns))
    if tail > TINY or gain == np.inf:
        return float(norm.isf(0.5 * tail))
    half = 0.5 * columns
    log_p = -0.5 * gain + (half - 1.0) * np.log(0.5 * gain) - gammaln(half)
    return float(np.sqrt(-2.0 * log_p - np.log(-np.pi * log_p)))


def gain_of(left: Array, columns: Columns, raw: Array) -> tuple[float, int]:
    """Squares over σ² that columns explain of what the model leaves, and how many are seen."""
    scale = np.sqrt(np.maximum(raw[columns], TINY))
    products = left[np.ix_(columns, columns)] / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(products)
    least = max(SINGULAR / SETTINGS.negligible, SINGULAR * float(values.max(initial=0.0)))
    seen = values > least
    along = vectors[:, seen].T @ (left[columns, -1] / scale)
    return float(np.sum(along**2 / values[seen])), int(seen.sum())
