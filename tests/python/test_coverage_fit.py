"""Whether the errors that `fit` gives cover the truth, shapes fitted and all.

200 logs of AR(1) noise (0.9): a true 95 % shows as 95 ± 1.5 %, so 90 to 98.5 % is −3.2 to +2.3
standard deviations. The full study with 1000 logs is that of test_uncertainty.
"""

from __future__ import annotations

import numpy as np
import pytest
from fit_logs import FRICTION, WIDTH, autoregressive, friction, motion, simulated

import flexspline
from flexspline import effect

LOGS = 200
SAMPLES = 2000
MODEL = [*friction(), effect("output_ripple", orders=[2]), "nonlinear_viscous_friction"]
TRUTH = np.array([*FRICTION, 0.1, -0.05, 0.02, 0.01])


@pytest.fixture(scope="module")
def study() -> dict[str, tuple[float, float]]:
    """Share of the logs whose interval covers the truth: ours and the naive one, by name."""
    covered: dict[str, list[tuple[bool, bool]]] = {}
    for seed in range(LOGS):
        noise = autoregressive(np.random.default_rng([seed, 11]), SAMPLES)
        log = simulated(MODEL, TRUTH, motion(seed, SAMPLES), noise)
        fit = flexspline.fit(MODEL, log, "sensor_torque", checks=False)
        truth = {**dict(zip(names(fit), TRUTH, strict=True)), "direction_width": WIDTH}
        for name, true in truth.items():
            p = fit[name]
            naive = abs(p.value - true) < 1.96 * p.naive_error
            covered.setdefault(name, []).append((p.interval[0] < true < p.interval[1], naive))
    return {name: tuple(np.mean(rows, axis=0)) for name, rows in covered.items()}


def names(fit) -> list[str]:
    return [p.name for p in fit.parameters if p.kind == "coefficient"]


def test_intervals_of_fit_cover_each_parameter_in_90_to_98_5_percent_of_the_logs(study):
    assert len(study) == len(TRUTH) + 1
    shares = {name: ours for name, (ours, _) in study.items()}
    print(shares)
    assert min(shares.values()) >= 0.90, shares
    assert max(shares.values()) <= 0.985, shares
    # All together, about 9 · 200 intervals, correlated within a log: ±2 %.
    assert abs(np.mean(list(shares.values())) - 0.95) < 0.02


def test_naive_intervals_cover_far_less(study):
    assert max(naive for _, naive in study.values()) < 0.75
    assert np.mean([naive for _, naive in study.values()]) < 0.55
