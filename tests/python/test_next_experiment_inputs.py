"""The run to record next is computed from logs as they come: short pieces, any low pass."""

from __future__ import annotations

import numpy as np
import pytest
from fit_logs import motion
from numpy.typing import NDArray

import flexspline
from flexspline import InputError, Limits, Plan
from flexspline.experiment.plan import Bounds
from flexspline.experiment.planning import at_coarser_rate
from flexspline.experiment.recording import kinds_for
from flexspline.logs.local_fit import require_bandwidth
from flexspline.logs.log import Log
from flexspline.regression.gram import Whitening

LOAD = "reference_torque"
Array = NDArray[np.float64]


def loaded(seed: int, rate: float, seconds: float, alone: int = 0) -> Log:
    """A run whose sensor reads 2 % too much; the last `alone` rows lie behind a gap.

    Velocity and acceleration are not recorded.
    """
    samples = int(rate * seconds)
    channels = motion(seed, samples, rate)
    time = channels["time"].copy()
    load = 3.0 * np.sin(0.7 * time + seed)
    torque = 1.02 * load + 0.1 + 0.01 * np.random.default_rng(seed).normal(size=samples)
    time[samples - alone :] += 5.0
    return Log.from_arrays(
        facts={"name": f"run{seed}"},
        time=time,
        output_position=channels["output_position"],
        sensor_torque=torque,
        **{LOAD: load},
    )


def planned(logs: list[Log], lowpass: float | None = None) -> Plan:
    model = flexspline.fit(
        ["offset", "gain_error"], logs, "sensor_torque", known_load=LOAD, lowpass=lowpass,
        checks=False,
    )  # fmt: skip
    made = flexspline.next_experiment(model, ("gain_error", "sensor_nonlinearity"), logs)
    assert made is not None
    return made


def test_a_row_without_a_velocity_is_no_limit_of_the_next_run() -> None:
    whole, cut = (planned([loaded(k, 100.0, 20.0, alone) for k in range(2)]) for alone in (0, 1))
    assert cut.bounds.velocity == pytest.approx(whole.bounds.velocity, rel=0.02)
    assert cut.bounds.acceleration == pytest.approx(whole.bounds.acceleration, rel=0.02)
    assert np.isfinite(cut.log["output_position"]).all()


@pytest.mark.parametrize("fastest", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("rate", [100.0, 500.0, 1000.0])
@pytest.mark.parametrize("share", [0.004, 0.04, 0.044, 0.12, 0.24, 0.25])
def test_a_low_pass_that_suits_a_log_suits_the_rate_of_the_next_run(
    share: float, rate: float, fastest: float
) -> None:
    cutoff = share * rate
    decimation = max(1, int(rate / (2.5 * cutoff)))  # as of `Problem`
    noise = Whitening(np.array([1.0, -0.5]), 1.0, decimation)
    _, slower = at_coarser_rate(noise, rate, fastest * rate, cutoff)
    require_bandwidth(cutoff, slower, "the planned run")
    assert slower >= min(8.0 * fastest, 1.0) * rate / 2.0  # within what a whole number of rows is


def test_a_run_is_planned_behind_a_low_pass_of_a_fast_log() -> None:
    made = planned([loaded(k, 500.0, 6.0) for k in range(2)], 22.0)
    assert made.expected > made.now


@pytest.mark.parametrize("seconds", [0.1, 1.0, 10.0, 600.0])
def test_paths_of_every_kind_fit_into_runs_of_any_length(seconds: float) -> None:
    """Strokes of slow speeds have no room in a second: there had been none to be shortened."""
    bounds = Bounds((-2.4, 1.9), 1.86, 5.4, (-9.4, 9.0), 25.0, (18.0, 35.0), 0.6, seconds)
    chance = np.random.default_rng(0)
    for kind in kinds_for(bounds, remembers=True):
        for numbers in (*kind.starts, *chance.random((20, kind.starts.shape[1]))):
            angles = kind.draw(numbers, bounds).path(np.linspace(0.0, seconds, 200))[:, 0]
            assert bounds.position[0] - 1e-9 <= angles.min() <= angles.max()
            assert angles.max() <= bounds.position[1] + 1e-9


@pytest.mark.parametrize("value", ["a", "3", (1.0, "a"), {}])
def test_a_limit_that_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(InputError, match=r"the limit 'velocity' is .*; give a number"):
        Limits(velocity=value)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"the limit 'position' is .*; give \(lowest, highest\)"):
        Limits(position=value)  # type: ignore[arg-type]


def test_what_is_no_limits_no_model_and_no_pair_is_refused_for_what_it_is() -> None:
    log = loaded(0, 100.0, 10.0)
    fit = flexspline.fit(["offset", "inertia"], log, "sensor_torque", checks=False)
    pair = ("inertia", "gravity")
    with pytest.raises(InputError, match=r"limits is a dict; give Limits\(...\)"):
        flexspline.next_experiment(fit, pair, log, limits={"velocity": 3})  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"limits is a dict; give Limits\(...\)"):
        flexspline.discover(["offset"], log, limits={"velocity": 3})  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"model is a str; give what it holds"):
        flexspline.next_experiment("model.json", pair, log)  # type: ignore[arg-type]
    lone: list[object] = ["gravity", flexspline.effect("gravity"), ["gravity"], [pair, "gravity"]]
    for rivals in lone:
        with pytest.raises(InputError, match="the rival 'gravity' stands alone; give pairs"):
            flexspline.next_experiment(fit, rivals, log)  # type: ignore[arg-type]
