"""Criteria of the papers' claims: what is met, what is not, what cannot be decided."""

from __future__ import annotations

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.reproduce import PAPERS, Claim, claims_of, judged


def claim(**criterion: object) -> Claim:
    return Claim("paper.x", "Fig. 1", "it is so", "a number", 2.0, "Nm", criterion)


@pytest.mark.parametrize("paper", PAPERS)
def test_each_claim_can_be_judged_and_has_its_own_name(paper: str) -> None:
    claims = claims_of(paper)
    assert len({c.id for c in claims}) == len(claims)
    for c in claims:
        assert c.id.startswith(f"{paper}.")
        if c.criterion["kind"] == "undecidable":
            assert c.criterion["reason"]
        else:
            assert c.quantity
            assert c.meets(np.array([np.nan])).tolist() == [False]


def test_near_is_near_the_published_value_on_both_sides() -> None:
    values = np.array([1.89, 1.9, 2.1, 2.11])
    assert claim(kind="near", tolerance=0.1001).meets(values).tolist() == [0, 1, 1, 0]


def test_a_bound_is_met_at_the_bound() -> None:
    values = np.array([0.9, 1.0, 1.1])
    assert claim(kind="at_most", bound=1.0).meets(values).tolist() == [1, 1, 0]
    assert claim(kind="at_least", bound=1.0).meets(values).tolist() == [0, 1, 1]


def draws_of(paper: str, value: float, count: int = 10) -> list[dict[str, float]]:
    ids = [c.id for c in claims_of(paper) if c.criterion["kind"] != "undecidable"]
    return [dict.fromkeys(ids, value) for _ in range(count)]


def test_a_claim_holds_where_its_share_of_draws_meets_it_and_not_below() -> None:
    draws = draws_of("turlapati", 0.0)
    for k, value in enumerate([1.0] * 8 + [2.0] * 2):  # 80 % of ten
        draws[k]["turlapati.fig5.improvement"] = 0.4 if value == 1.0 else 0.6
    found = {v.claim.id: v for v in judged("turlapati", draws)}
    assert found["turlapati.fig5.improvement"].holds is True
    draws[0]["turlapati.fig5.improvement"] = np.nan
    found = {v.claim.id: v for v in judged("turlapati", draws)}
    verdict = found["turlapati.fig5.improvement"]
    assert verdict.holds is False
    assert verdict.to_json()["ours"]["failed_draws"] == 1


def test_an_undecidable_claim_says_so() -> None:
    found = {v.claim.id: v for v in judged("zhang", draws_of("zhang", 0.0))}
    assert found["zhang.fig20.egg"].holds is None
    assert found["zhang.fig20.egg"].to_json()["ours"] is None


def test_a_claim_without_a_value_is_refused_by_name() -> None:
    draws = draws_of("zhang", 0.0)
    for draw in draws:
        del draw["zhang.fig17.after"]
    with pytest.raises(InputError, match=r"zhang\.fig17\.after"):
        judged("zhang", draws)


def test_a_value_without_a_claim_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="no claim zhang"):
        judged("zhang", [{"zhang.nothing": 1.0}])
