"""How likely a name is right, as a number between 0 and 1.

    p = 1 / (1 + exp(−x · b)),    at most HIGHEST

with regressors x: 1; ln(1 + e), e the gain over its price in χ²; ln(1 + m), m the lead over the
best rival that is no alias; the share of the gain that functions without a name leave it; what
they explain beside it, over its own gain; and the number of its aliases.

The coefficients b are a logistic model's, fitted to 330 names (319 right) that were given in 482
random cases of single, two, three, unknown and no causes, all three targets, by

    python tests/bench/calibrate_confidence.py first/cases.jsonl ...

and drawn weakly towards those of 280 names that earlier versions of the search gave, of which more
were wrong. On the 740 names of the 1107 frozen cases, which it never saw: stated 0.33, right 0.33
of 3; 0.67, 0.80 of 10; 0.87, 0.79 of 28; 0.93, 0.96 of 116; 0.99, 0.99 of 583. The lead told
nothing beyond the rest.
"""

from __future__ import annotations

import numpy as np

__all__ = ["FEATURES", "confidence", "features"]

FEATURES = ("constant", "evidence", "lead", "survives", "left beside", "aliases")
COEFFICIENTS = (0.456, 0.477, 0.0, 0.929, -6.286, -1.234)
LOWEST, HIGHEST = 0.02, 0.99
MOST_LEFT = 0.2


def features(
    gain: float, told: float, price: float, rival: float, survives: float, left: float, aliases: int
) -> tuple[float, ...]:
    """Return the regressors of one name: gains in χ², see the head of this file.

    `told`: by Wald's test in the final fit; evidence is no more than that, either.
    """
    evidence = np.log1p(max(min(gain, told) - price, 0.0))
    lead = np.log1p(max(gain - rival, 0.0))
    beside = min(left / max(gain, 1e-300), MOST_LEFT)
    share = float(np.clip(survives, 0.0, 1.0))
    return (1.0, float(evidence), float(lead), share, float(beside), float(aliases))


def confidence(regressors: tuple[float, ...]) -> float:
    """Return the probability that a name with these regressors is right."""
    score = float(np.dot(COEFFICIENTS, regressors))
    return float(np.clip(1.0 / (1.0 + np.exp(-score)), LOWEST, HIGHEST))
