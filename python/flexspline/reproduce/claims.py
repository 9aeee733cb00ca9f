"""Claims of the papers, with criteria that were committed before any of them was run.

Each claim is a quantity of one draw of a simulated rig. Draws differ in what the paper does not
print. A criterion says how many draws must meet it:

    near         |value − expected| ≤ tolerance   (expected: the published value unless given)
    at_most      value ≤ bound
    at_least     value ≥ bound
    undecidable  a simulated rig cannot decide it, and the reason is said
"""

from __future__ import annotations

import importlib.resources
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed

__all__ = ["PAPERS", "Claim", "Verdict", "claims_of", "judged"]

PAPERS = ("zhang", "turlapati", "full_range")


@dataclass(frozen=True)
class Claim:
    """One published claim.

    Parameters
    ----------
    id : paper, place and name, such as "zhang.fig17.before".
    source : equation, figure, table or section.
    claim : what the paper says.
    quantity : what is computed in each draw; None where nothing can be.
    published : the printed value in `unit`; None where none is printed.
    criterion : see the head of this file; `share` of the draws must meet it, all where it is
        left out.
    note : what else a reader should know.
    """

    id: str
    source: str
    claim: str
    quantity: str | None
    published: float | None
    unit: str
    criterion: Mapping[str, Any]
    note: str = ""

    def meets(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether each draw meets the criterion, (D,); a value that is not finite does not."""
        kind = self.criterion["kind"]
        if kind == "near":
            expected = self.criterion.get("expected", self.published)
            return np.asarray(np.abs(values - expected) <= self.criterion["tolerance"])
        bound = self.criterion["bound"]
        return np.asarray(values <= bound if kind == "at_most" else values >= bound)


@dataclass(frozen=True)
class Verdict:
    """A claim beside ours.

    Parameters
    ----------
    claim : what was published, and the criterion.
    values : ours, (D,), one for each draw; empty where nothing can be computed.
    holds : whether the criterion is met; None where it cannot be decided.
    """

    claim: Claim
    values: NDArray[np.float64]
    holds: bool | None

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `claims.json`."""
        entry = {
            "id": self.claim.id,
            "source": self.claim.source,
            "claim": self.claim.claim,
            "quantity": self.claim.quantity,
            "unit": self.claim.unit,
            "published": self.claim.published,
            "criterion": dict(self.claim.criterion),
            "note": self.claim.note,
            "ours": None,
            "holds": self.holds,
        }
        good = self.values[np.isfinite(self.values)]
        if good.size:
            low, median, high = np.percentile(good, [5, 50, 95])
            entry["ours"] = {
                "median": float(median),
                "p5": float(low),
                "p95": float(high),
                "worst": [float(good.min()), float(good.max())],
                "draws": int(self.values.size),
                "failed_draws": int(self.values.size - good.size),
            }
        return entry


def claims_of(paper: str) -> tuple[Claim, ...]:
    """Return the claims of "zhang", "turlapati" or "full_range"."""
    if paper not in PAPERS:
        raise InputError(f"there is no paper '{paper}'; give one of {listed(PAPERS)}")
    folder = importlib.resources.files("flexspline.reproduce") / "claims"
    entries = json.loads((folder / f"{paper}.json").read_text(encoding="utf-8"))
    return tuple(Claim(**entry) for entry in entries)


def judged(paper: str, draws: Sequence[Mapping[str, float]]) -> tuple[Verdict, ...]:
    """Return each claim of a paper beside ours.

    Parameters
    ----------
    paper : "zhang", "turlapati" or "full_range".
    draws : of each draw, the quantities by the ids of their claims. A quantity that does not
        depend on the draw may be in the first one only.

    Raises
    ------
    InputError
        Where a decidable claim has no value, or a value has no claim.
    """
    claims = claims_of(paper)
    unknown = {name for draw in draws for name in draw} - {claim.id for claim in claims}
    if unknown:
        raise InputError(f"{paper}: there is no claim {listed(sorted(unknown))}; add it first")
    return tuple(_judged(claim, draws) for claim in claims)


def _judged(claim: Claim, draws: Sequence[Mapping[str, float]]) -> Verdict:
    values = np.array([draw[claim.id] for draw in draws if claim.id in draw], dtype=np.float64)
    if claim.criterion["kind"] == "undecidable":
        return Verdict(claim, values, None)
    if not values.size:
        raise InputError(f"claim {claim.id}: no draw gives a value; compute '{claim.quantity}'")
    share = float(claim.criterion.get("share", 1.0))
    return Verdict(claim, values, bool(np.mean(claim.meets(values)) >= share))
