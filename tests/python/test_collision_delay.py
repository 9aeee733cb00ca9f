"""How late a contact is found, how small it may be: against the core's observer and detector."""

from __future__ import annotations

import numpy as np
import pytest

from flexspline import _core
from flexspline.collision import detection_delay, smallest_detectable_torque, standstill_residual
from flexspline.errors import InputError

GAIN, THRESHOLD, PERIOD = 100.0, 0.03, 1e-4


def found_at(torque, duration=10.0):
    """Time of detection of a torque that sets in at 0, by observer and detector; inf if never."""
    time = np.arange(-10, 3000) * PERIOD
    known = torque * ((time > 0) & (time <= duration))
    zero = np.zeros_like(time)
    external = _core.observe_momentum(time, zero, known, gain=GAIN, exact=True)
    contact = _core.detect_collision(
        time,
        external,
        zero,
        speed_edges=[],
        negative=[THRESHOLD],
        positive=[THRESHOLD],
        release=1.0,
        hold=0.0,
    )
    return time[np.argmax(contact)] if contact.any() else np.inf


@pytest.mark.parametrize("torque", [0.031, 0.05, 0.3, 3.0, -0.05])
def test_the_delay_is_that_of_observer_and_detector_within_a_period(torque):
    # Half a period from the step, one from sampling.
    assert found_at(torque) == pytest.approx(
        float(detection_delay(torque, THRESHOLD, GAIN)), abs=1.5 * PERIOD
    )


def test_a_torque_below_the_threshold_is_never_found():
    assert detection_delay(0.029, THRESHOLD, GAIN) == np.inf == found_at(0.029)


def test_the_smallest_torque_of_a_short_contact_is_found_and_a_smaller_one_is_not():
    least = float(smallest_detectable_torque(0.005, THRESHOLD, GAIN))
    assert np.isfinite(found_at(1.02 * least, 0.005)) and found_at(0.98 * least, 0.005) == np.inf
    assert smallest_detectable_torque(100.0, THRESHOLD, GAIN) == pytest.approx(THRESHOLD)


def test_a_sure_detection_in_noise_takes_longer():
    plain, sure = (
        detection_delay(0.1, THRESHOLD, GAIN, noise=0.01, probability=p) for p in (0.5, 0.99)
    )
    assert plain == detection_delay(0.1, THRESHOLD, GAIN) and sure > plain


def test_impossible_thresholds_gains_and_probabilities_are_refused():
    for wrong in ({"threshold": 0.0}, {"gain": -1.0}, {"probability": 1.0}, {"noise": -1.0}):
        options = {"threshold": THRESHOLD, "gain": GAIN, **wrong}
        with pytest.raises(InputError, match="detection: "):
            detection_delay(0.1, **options)


@pytest.mark.parametrize("wrong", ["threshold", "gain", "noise", "probability"])
def test_settings_in_words_are_refused(wrong):
    options = {"threshold": THRESHOLD, "gain": GAIN, wrong: "a"}
    with pytest.raises(InputError, match=f"detection: {wrong} = 'a' is no finite number"):
        detection_delay(0.1, **options)


def test_torques_and_durations_in_words_are_refused():
    for call, name in ((detection_delay, "torque"), (smallest_detectable_torque, "duration")):
        for wrong in ([1, 2, "a"], "a", [[1], [1, 2]]):
            with pytest.raises(InputError, match=f"detection: {name} = .* is no number; give"):
                call(wrong, THRESHOLD, GAIN)


def test_the_standstill_residual_sees_a_step_and_not_the_drift():
    time = np.arange(0.0, 10.0, 0.01)
    drift, rest = 5.0 + 0.1 * time, np.zeros_like(time)
    quiet = standstill_residual(time, drift, rest)
    # A ramp of 0.1 A/s: late by 1/slow − 1/fast = 0.475 s.
    assert np.nanmax(np.abs(quiet.values)) == pytest.approx(0.0475, rel=0.01)
    pushed = standstill_residual(time, drift + (time > 5.0), rest)
    assert np.nanmax(pushed.values) > 0.8
    assert np.isnan(pushed.values[time < 0.499]).all()


def test_a_joint_that_moves_has_no_standstill_residual():
    time = np.arange(0.0, 10.0, 0.01)
    moving = 0.5 * ((time > 4.0) & (time < 5.0))
    found = standstill_residual(time, np.sin(time), moving)
    assert np.isnan(found.values[(time > 4.001) & (time < 5.49)]).all()
    assert np.isfinite(found.values[time > 5.52]).all()
    with pytest.raises(InputError, match="0 < slow < fast"):
        standstill_residual(time, time, moving, fast=1.0, slow=2.0)
