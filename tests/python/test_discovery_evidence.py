"""Evidence and its price: what chance gains, where signs are known, of a series, between shapes."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

from hidden.cases import cases
from hidden.trial import Outcome, tried

from flexspline.discovery.evidence import cone_gain, cone_price, evidence_of, price
from flexspline.discovery.model import one_signed
from flexspline.discovery.settings import SETTINGS

Array = np.ndarray

ANGLE = 0.7  # rad between two columns
DRAWN = 0.1  # of a probability: the weights are of 1000 draws, one of 0.11 known to 0.01
APART = np.array([[1.0, np.cos(ANGLE)], [np.cos(ANGLE), 1.0]])


def drawn(products: Array, count: int) -> Array:
    """Pulls of columns where nothing is there, (count, K)."""
    root = np.linalg.cholesky(products)
    return np.random.default_rng(3).normal(size=(count, len(products))) @ root.T


def springs() -> Array:
    """Products of four springs that slip at w, w/2, w/4, w/8 over a random path."""
    path = np.cumsum(np.random.default_rng(1).normal(size=3000))
    columns = []
    for width in (20.0, 10.0, 5.0, 2.5):
        at, force = 0.0, []
        for place in path:
            at = min(max(at, place - width), place + width)
            force.append((place - at) / width)
        columns.append(force)
    return np.array(columns) @ np.array(columns).T


def test_two_columns_of_one_sign_have_the_weights_of_their_angle() -> None:
    """Silvapulle & Sen 2005, (3.25): β / 2π both, 1/2 one, the rest none, β the cone's angle."""
    for share in (0.05, 1e-3):
        paid = cone_price(APART, share, either=False)
        both = ANGLE / (2.0 * np.pi)
        exceeded = both * chi2.sf(paid, 2) + 0.5 * chi2.sf(paid, 1)
        assert exceeded == pytest.approx(share, rel=DRAWN)


def test_one_column_of_one_sign_is_a_normal_number_of_one_sign() -> None:
    one = np.array([[4.0]])
    assert cone_gain(one, np.array([-6.0]), either=False) == pytest.approx(0.0, abs=1e-12)
    assert cone_gain(one, np.array([-6.0]), either=True) == pytest.approx(9.0)
    assert cone_price(one, 0.01, either=False) == pytest.approx(chi2.isf(0.02, 1), rel=DRAWN)


@pytest.mark.parametrize("either", [False, True])
def test_chance_exceeds_the_price_of_springs_as_often_as_is_said(either: bool) -> None:
    products = springs()
    gains = [cone_gain(products, pulls, either) for pulls in drawn(products, 20_000)]
    for share in (0.05, 0.005):
        above = np.mean(np.array(gains) > cone_price(products, share, either))
        spread = 3.0 * np.sqrt(share / len(gains))
        assert abs(above - share) < spread + DRAWN * share


def test_springs_of_one_sign_pay_less_than_any_four_columns() -> None:
    assert cone_price(springs(), 1e-4, either=True) < chi2.isf(1e-4, 4) - 4.0


def table(columns: int, pulls: Array) -> Array:
    """Products of orthogonal columns of length one and a target with these pulls."""
    made = np.eye(columns + 1)
    made[-1, :-1] = made[:-1, -1] = pulls
    return made


def test_a_mass_of_a_drive_has_one_sign_and_of_a_sensor_either() -> None:
    left = table(1, np.array([3.0]))
    drive, sensor = (
        evidence_of("inertia", one_signed("inertia", target), left, np.arange(1), np.ones(1)).price(
            1.0, 20
        )
        for target in ("motor_torque", "sensor_torque")
    )
    assert sensor == price(1, 1.0, 20) == pytest.approx(chi2.isf(SETTINGS.alpha / 20, 1))
    assert drive == pytest.approx(chi2.isf(2.0 * SETTINGS.alpha / 20, 1))


def test_the_first_order_of_a_series_may_pay_alone() -> None:
    """Chance: half of what either may reach it by."""
    columns = np.arange(6)
    first, spread = np.zeros(6), np.full(6, np.sqrt(22.0 / 6.0))
    first[0] = np.sqrt(22.0)
    nets = []
    for pulls in (first, spread):
        left = table(6, pulls)
        told = evidence_of("position_dependent_friction", 0, left, columns, np.ones(6))
        nets.append(told.gain - told.price(1.0, 20))
    assert nets[0] == pytest.approx(22.0 - price(2, 2.0, 20))
    assert nets[1] == pytest.approx(22.0 - price(6, 2.0, 20))
    assert nets[0] > 0.0 > nets[1]


@cache
def small(number: int, deal: int) -> Outcome:
    (case,) = (c for c in cases(deal) if c.number == number)
    return tried(case)


@pytest.mark.parametrize(
    ("number", "deal"),
    [
        (593, 42),  # Stribeck friction between two shapes that are screened
        (578, 42),  # springs that only their sign tells from chance
        (581, 42),  # friction over the angle, most of it of the first order
    ],
)
def test_a_small_effect_is_named_that_is_told_from_chance_by(number: int, deal: int) -> None:
    made = small(number, deal)
    assert made.right, made


def test_a_plainer_rival_that_only_the_folds_do_not_tell_is_an_alias_and_no_better_name() -> None:
    """In tied runs friction under load explains nine tenths of what a late sensor shows."""
    made = small(262, 42)
    assert made.names[0] == "sensor_lag"
    assert "load_dependent_friction" in made.aliases[0]
