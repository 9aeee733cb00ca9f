"""The simulated rig is what its truth says, and more than its catalogue effects."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexspline.errors import InputError
from flexspline.logs.checks import check
from flexspline.logs.segments import play
from flexspline.rigs.sensor import OUTPUT_BITS, SENSOR_STEP, SPEEDS, sensor_rig


def play_by_loop(position: list[float], slip: float) -> list[float]:
    """The recursion as it is written, as the oracle."""
    end = [position[0]]
    for q in position[1:]:
        end.append(min(q + slip, max(q - slip, end[-1])))
    return end


@given(
    st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=70),
    st.floats(0.0, 1e3),
)
def test_play_is_its_recursion(position: list[float], slip: float) -> None:
    assert play(np.array(position), slip).tolist() == play_by_loop(position, slip)


def test_the_same_seed_gives_the_same_rig_and_another_does_not() -> None:
    first, again, other = (sensor_rig(1, duration=8.0, rate=200.0, seed=s) for s in (5, 5, 6))
    torque = [rig.logs[0]["sensor_torque"] for rig in (first, again, other)]
    assert np.array_equal(torque[0], torque[1])
    assert not np.array_equal(torque[0], torque[2])


def test_a_rig_that_is_sound_passes_all_checks() -> None:
    for log in sensor_rig(3, rate=250.0).logs:
        assert not check(log, target="sensor_torque").faults


def test_the_reading_is_the_true_model_but_for_presliding_noise_and_steps() -> None:
    rig = sensor_rig(4, rate=500.0)
    residual = np.concatenate([rig.truth.model.predict(log).residual for log in rig.logs])
    # the element slips nearly always: ± its level beside the noise; encoders and a smoothed
    # velocity add a little at reversals
    expected = np.hypot(rig.truth.noise, rig.truth.presliding_level)
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(expected, rel=0.1)


def test_encoder_and_amplifier_leave_their_steps() -> None:
    log = sensor_rig(1, duration=8.0, rate=200.0).logs[0]
    for channel, step in (
        ("output_position", 2 * np.pi / 2**OUTPUT_BITS),
        ("sensor_torque", SENSOR_STEP),
    ):
        steps = log[channel] / step
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def test_each_speed_is_driven_both_ways() -> None:
    velocity = sensor_rig(1).logs[0]["output_velocity"]
    for speed in SPEEDS:
        for sign in (-1, 1):
            assert np.mean(np.abs(velocity / (sign * speed) - 1.0) < 0.05) > 0.03


def test_the_truth_has_a_value_for_coefficients_and_shapes() -> None:
    truth = sensor_rig(1, duration=8.0, rate=200.0).truth
    assert truth.value("inertia.inertia") == 0.0192
    assert truth.value("stribeck_friction.stribeck_velocity") == 0.12
    assert truth.value("direction_width") == 0.01
    assert np.isnan(truth.value("backlash.width"))


@pytest.mark.parametrize("wrong", [{"runs": 0}, {"duration": 1.0}, {"rate": 50.0}])
def test_a_rig_that_shows_nothing_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="at least one run"):
        sensor_rig(**wrong)  # type: ignore[arg-type]
