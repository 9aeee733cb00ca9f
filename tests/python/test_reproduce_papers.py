"""Every paper: one draw of its rig answers its claims, no more and no less."""

from __future__ import annotations

import numpy as np
import pytest

from flexspline.reproduce import claims_of, draw

PAPERS = ("zhang", "turlapati", "full_range")


@pytest.mark.parametrize("paper", PAPERS)
def test_one_draw_gives_a_finite_value_to_each_claim_that_can_be_computed(paper: str) -> None:
    values = draw(paper, 3)
    computable = {claim.id for claim in claims_of(paper) if claim.quantity is not None}
    decidable = {c.id for c in claims_of(paper) if c.criterion["kind"] != "undecidable"}
    assert decidable <= set(values) <= computable
    assert all(np.isfinite(value) for value in values.values())
