"""Thresholds for a stated rate of false alarms: is the rate what is stated?"""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy import signal, stats

from flexspline import Differentiator, Log, Model, Observer, Part, effect, estimate
from flexspline.collision import (
    Residual,
    calibrate_detector,
    cluster_peaks,
    correlation_time,
    detection_delay,
    fit_tail,
    left_out_margin,
)
from flexspline.errors import InputError
from flexspline.plot.estimate import contacts_over_time, thresholds_of_joints

RATE = 100.0


def noise(kind, hours, rng):
    """Coloured noise, correlation 0.9 from sample to sample; "t4": Student's t, four degrees."""
    count = int(hours * 3600 * RATE)
    white = rng.standard_normal(count) if kind == "gauss" else rng.standard_t(int(kind[1:]), count)
    return signal.lfilter([1.0], [1.0, -0.9], white)


def residual(values, **options):
    return Residual(np.arange(len(values)) / RATE, values, **options)


def counted(kind, hours, thresholds, apart, rng):
    """How often noise crosses each threshold in so many hours, in pieces of five."""
    counts = np.zeros(len(thresholds))
    for _ in range(hours // 5):
        values = noise(kind, 5, rng)
        rows = np.flatnonzero(values > min(thresholds))
        for k, threshold in enumerate(thresholds):
            counts[k] += len(cluster_peaks(rows / RATE, values[rows], threshold, apart)[0])
    return counts


@pytest.mark.parametrize("kind", ["gauss", "t8", "t4"])
def test_the_true_rate_lies_within_the_stated_interval_in_at_least_the_stated_share(kind):
    rng = np.random.default_rng(20)
    found = [
        calibrate_detector(residual(noise(kind, 0.5, rng)), false_alarms_per_hour=4.0, apart=1.0)
        for _ in range(20)
    ]
    each = [threshold for one in found for threshold in one.thresholds]
    hours = 50
    counts = counted(kind, hours, [t.value for t in each], 1.0, rng)
    # The truth is itself a count: what a Poisson law excludes by 99 % counts as outside.
    low, high = np.array([t.rate_interval for t in each]).T
    above = stats.poisson.cdf(counts, hours * low) < 0.01
    below = stats.poisson.sf(counts - 1, hours * high) < 0.01
    assert np.mean(~above & ~below) >= found[0].confidence
    stated = 4.0 / 2.0  # per direction
    assert np.mean(counts <= stated * hours) >= found[0].confidence
    assert high == pytest.approx(stated, rel=1e-6)


def test_a_detector_of_two_joints_alarms_no_more_often_than_stated():
    rng = np.random.default_rng(5)
    quiet = residual(np.stack([noise("t8", 0.7, rng), 3.0 * noise("gauss", 0.7, rng)], axis=1))
    detector = calibrate_detector(quiet, false_alarms_per_hour=6.0)
    later = residual(np.stack([noise("t8", 10, rng), 3.0 * noise("gauss", 10, rng)], axis=1))
    contact = detector.detect(later)
    alarms = np.count_nonzero(np.diff(contact.astype(int), axis=0) == 1)
    assert 0 < alarms <= 6.0 * 10.0
    assert detector.values(2, 1)[0] > 2.0 * detector.values(1, 1)[0]


def test_the_stated_rate_raises_the_threshold_and_the_paper_rule_does_not_know_it():
    quiet = residual(noise("t8", 0.5, np.random.default_rng(2)))
    often, seldom = (calibrate_detector(quiet, false_alarms_per_hour=r) for r in (10.0, 0.5))
    for low, high in zip(often.thresholds, seldom.thresholds, strict=True):
        assert low.value < high.value and low.likely < high.likely
        assert low.paper == high.paper == pytest.approx(low.largest * 0.03 / 0.0255)


def test_the_result_prints_what_hours_without_an_alarm_prove():
    detector = calibrate_detector(
        residual(noise("gauss", 0.5, np.random.default_rng(2))), false_alarms_per_hour=0.01
    )
    assert detector.proven_rate == pytest.approx(3.0 / 0.5, rel=0.01)
    assert "1800 s without an alarm prove no more than 5.99 false alarms per hour" in str(detector)
    assert "rests on the shape of the tail alone" in str(detector)


def test_alarms_of_the_detector_on_its_own_logs_count_in_what_they_prove():
    quiet = residual(noise("gauss", 0.1, np.random.default_rng(2)))
    detector = calibrate_detector([quiet, quiet], false_alarms_per_hour=300.0)
    contact = detector.detect(quiet)[:, 0]
    alarms = 2 * np.count_nonzero(contact[1:] & ~contact[:-1])
    assert alarms > 2 and not contact[0] and detector.alarms == alarms
    # so few alarms or fewer are 5 % likely at the rate that is excluded
    assert stats.poisson.cdf(alarms, detector.proven_rate * 0.2) == pytest.approx(0.05)
    assert f"720 s with {alarms} alarms of this detector prove no more than" in str(detector)
    record = detector.collision().record
    assert record["proven_rate_per_hour"] == detector.proven_rate and record["alarms"] == alarms


def test_bands_of_speed_have_thresholds_of_their_own():
    rng = np.random.default_rng(3)
    values, speed = noise("gauss", 0.6, rng), np.where(rng.random(216_000 // 3600) < 0.5, 0.1, 1.0)
    speed = np.repeat(speed, 3600)
    detector = calibrate_detector(
        residual(values * np.where(speed > 0.5, 5.0, 1.0), velocity=speed),
        false_alarms_per_hour=5.0,
        speed_edges=(0.5,),
    )
    slow, fast = detector.values(1, 1)
    assert 3.0 < fast / slow < 8.0
    made = detector.collision(1)
    assert made.speed_edges == (0.5,) and made.positive == (slow, fast)
    json.dumps(made.to_json(), allow_nan=False)
    assert made.record["stated_rate_per_hour"] == 5.0


def test_empty_and_too_short_logs_are_refused_in_a_sentence():
    short = residual(noise("gauss", 0.002, np.random.default_rng(1)))
    with pytest.raises(InputError, match=r"fewer than 30 separate exceedances.*record more"):
        calibrate_detector(short, false_alarms_per_hour=1.0)
    with pytest.raises(InputError, match="no contact-free logs; give at least one"):
        calibrate_detector([], false_alarms_per_hour=1.0)
    with pytest.raises(InputError, match="no finite residual"):
        calibrate_detector(residual(np.full(100, np.nan)), false_alarms_per_hour=1.0)
    with pytest.raises(InputError, match="no contact-free data for joint 1 in band 1"):
        calibrate_detector(short, false_alarms_per_hour=None, speed_edges=(0.5,))


def test_impossible_options_are_refused():
    quiet = residual(noise("gauss", 0.1, np.random.default_rng(1)))
    with pytest.raises(InputError, match="false_alarms_per_hour"):
        calibrate_detector(quiet, false_alarms_per_hour=0.0)
    with pytest.raises(InputError, match="state a lower rate"):
        calibrate_detector(quiet, false_alarms_per_hour=1e6)
    with pytest.raises(InputError, match="confidence"):
        calibrate_detector(quiet, false_alarms_per_hour=1.0, confidence=90.0)
    with pytest.raises(InputError, match="release"):
        calibrate_detector(quiet, false_alarms_per_hour=None, release=1.5)
    with pytest.raises(InputError, match="speed_edges"):
        calibrate_detector(quiet, false_alarms_per_hour=1.0, speed_edges=(0.5, 0.2))
    with pytest.raises(InputError, match="other joints or another unit"):
        current = residual(quiet.values, unit="A")
        calibrate_detector([quiet, current], false_alarms_per_hour=None)
    with pytest.raises(InputError, match="no joint 'observer'; it watches joints 1 to 1"):
        calibrate_detector(quiet, false_alarms_per_hour=None).collision("observer")
    with pytest.raises(InputError, match="time does not increase"):
        Residual(np.zeros(3), np.zeros(3))


def test_a_detector_for_currents_makes_no_estimator_of_torques():
    quiet = residual(noise("gauss", 0.1, np.random.default_rng(1)), unit="A")
    detector = calibrate_detector(quiet, false_alarms_per_hour=None)
    with pytest.raises(InputError, match="residuals in A"):
        detector.collision(1)
    with pytest.raises(InputError, match="the detector watches 1 in A"):
        detector.detect(residual(quiet.values))


def pushed_joint(seed, push=0.0):
    """A joint of 0.3 kg m² that a motor moves, torque noise 0.05 Nm, pushing from 100 s on."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 300.0, 0.01)
    speed, acceleration = np.sin(time), np.cos(time)
    external = push * ((time > 100.0) & (time < 101.0))
    torque = 0.3 * acceleration + 0.8 * speed + external + 0.05 * rng.standard_normal(len(time))
    return Log.from_arrays(
        time=time,
        output_position=-np.cos(time),
        output_velocity=speed,
        motor_torque=torque / 100.0,
        facts={"gear_ratio": 100.0, "name": f"run {seed}"},
    )


def observed_joint():
    effects = (effect("viscous_friction"), effect("inertia"))
    part = Part("motor_torque", effects, np.array([0.8, 0.3]))
    model = Model({"drive": part}, {"gear_ratio": 100.0})
    return model.with_estimator(Observer(20.0, "motor_torque"))


def test_a_detector_from_logs_and_a_model_runs_inside_the_model():
    model = observed_joint()
    quiet = [pushed_joint(1), pushed_joint(2)]
    detector = calibrate_detector(quiet, model=model, false_alarms_per_hour=20.0)
    whole = model.with_estimator(detector.collision(1))
    found = estimate(whole, pushed_joint(3, push=0.5)).contacts
    assert len(found) == 1
    threshold = detector.values(1, 1)[0]
    late = detection_delay(0.5, threshold, 20.0)
    assert 100.0 < found[0][0] <= 100.0 + 2.0 * late + 0.01
    with pytest.raises(InputError, match="needs model="):
        calibrate_detector(quiet, false_alarms_per_hour=20.0)


def test_a_rate_that_was_stated_with_a_recorded_velocity_is_doubted_with_a_derived_one():
    """2 alarms per hour became 463 in half an hour where a log lacked the column."""
    model = observed_joint()
    quiet = [pushed_joint(1), pushed_joint(2)]
    bare = [log.without(["output_velocity"], ["no velocity"]) for log in quiet]

    def doubts(logs, log, model=model, **options):
        made = calibrate_detector(logs, model=model, **{"false_alarms_per_hour": 20.0, **options})
        whole = Model.from_json(model.with_estimator(made.collision()).to_json())
        return estimate(whole, log).doubts

    (said,) = doubts(quiet, bare[0])
    assert "log 'run 1': the detector's thresholds were calibrated with a recorded" in said
    assert "output_velocity, which is derived from output_position here: their 20 false" in said
    assert (
        said
        in estimate(
            model.with_estimator(
                calibrate_detector(quiet, model=model, false_alarms_per_hour=20.0).collision()
            ),
            bare,
        )[0].warnings
    )
    (said,) = doubts(quiet, bare[0], false_alarms_per_hour=None)
    assert "here: they do not hold" in said
    assert doubts(quiet, quiet[1]) == doubts(bare, bare[1]) == doubts(bare, quiet[1]) == ()
    assert doubts([quiet[0], bare[1]], bare[0]) == ()
    given = Residual(quiet[0]["time"], 0.05 * np.random.default_rng(0).standard_normal(30000))
    assert doubts(given, bare[0]) == ()  # of what it was made is not known
    own = model.with_estimator(Differentiator(20.0, ("output_velocity",)))
    assert doubts(quiet, bare[0], own) == ()  # it derives the velocity of either


def test_a_sensor_that_reads_no_velocity_keeps_its_rate_without_one():
    sensor = Part("sensor_torque", (effect("offset"),), np.array([0.0]))
    model = Model({"sensor": sensor}, {"gear_ratio": 100.0})
    rng = np.random.default_rng(4)
    quiet = pushed_joint(1).with_columns(
        {"sensor_torque": 0.5 * rng.standard_normal(30000)}, note="sensor"
    )
    bare = quiet.without(["output_velocity"], ["no velocity"])
    for edges, doubts in (((), 0), ((0.5,), 1)):
        made = calibrate_detector(
            quiet, model=model, input="sensor", false_alarms_per_hour=60.0, speed_edges=edges
        )
        assert len(estimate(model.with_estimator(made.collision()), bare).doubts) == doubts


def test_a_detector_watches_the_estimate_that_it_was_calibrated_on():
    effects = (effect("viscous_friction"), effect("inertia"))
    part = Part("motor_torque", effects, np.array([0.8, 0.3]))
    sensor = Part("sensor_torque", (effect("inertia"),), np.array([0.0]))
    parts = {"drive": part, "sensor": sensor}
    model = Model(parts, {"gear_ratio": 100.0}).with_estimator(Observer(20.0, "motor_torque"))
    rng = np.random.default_rng(4)
    quiet = [
        log.with_columns({"sensor_torque": 0.5 * rng.standard_normal(len(log))}, note="sensor")
        for log in (pushed_joint(1), pushed_joint(2))
    ]
    detector = calibrate_detector(quiet, model=model, input="sensor", false_alarms_per_hour=20.0)
    assert detector.collision().input == detector.collision(input="sensor").input == "sensor"
    found = estimate(model.with_estimator(detector.collision()), quiet[0]).contacts
    assert len(found) <= detector.alarms  # of both logs
    with pytest.raises(InputError, match=r"of the sensor estimate and input is 'observer'; leave"):
        detector.collision(input="observer")
    watched = calibrate_detector(quiet, model=model, false_alarms_per_hour=20.0)
    assert watched.collision().input == "observer"


def test_of_residuals_that_are_given_the_estimate_may_be_said_early_or_late():
    quiet = residual(noise("gauss", 0.1, np.random.default_rng(1)))
    unsaid = calibrate_detector(quiet, false_alarms_per_hour=None)
    assert unsaid.collision().input == "observer"
    assert unsaid.collision(input="merged").input == "merged"
    said = calibrate_detector(quiet, false_alarms_per_hour=None, input="merged")
    assert said.collision().input == "merged"
    with pytest.raises(InputError, match="merged estimate"):
        said.collision(input="observer")
    with pytest.raises(InputError, match="detector: input"):
        calibrate_detector(quiet, false_alarms_per_hour=None, input="mergd")


def test_the_margin_is_the_one_that_no_run_left_out_exceeds():
    runs = [residual(scale * np.sin(np.arange(1000.0))) for scale in (1.0, 2.0, 5.0)]
    assert left_out_margin(runs) == pytest.approx(2.5, rel=1e-3)
    assert left_out_margin(runs[:1] * 2) == pytest.approx(0.03 / 0.0255)
    with pytest.raises(InputError, match="two or more"):
        left_out_margin(runs[:1])


def test_the_shape_of_a_known_tail_is_found():
    rng = np.random.default_rng(8)
    values = rng.standard_t(3, 300_000)
    tail = fit_tail(np.arange(300_000.0), values, 1.0, 0.5)
    # ξ = 1/3 for three degrees of freedom; standard error (1 + ξ)/√100 = 0.13, two of them.
    assert tail.shape == pytest.approx(1.0 / 3.0, abs=0.27)
    assert tail.dispersion < 2.0


def test_exceedances_nearer_than_the_declustering_time_are_one_event():
    time = np.array([0.0, 0.1, 0.2, 1.0, 1.1])
    start, size = cluster_peaks(time, np.array([2.0, 3.0, 1.5, 0.0, 2.5]), 1.0, 0.5)
    assert start.tolist() == [0.0, 1.1] and size.tolist() == [3.0, 2.5]


def test_the_correlation_time_is_that_of_the_noise():
    values = noise("gauss", 1.0, np.random.default_rng(7))
    # 0.9^k < 0.1 from k = 22 on.
    assert correlation_time(values, 0.01) == pytest.approx(0.22, abs=0.03)


def test_the_plots_show_every_threshold_and_the_contacts():
    rng = np.random.default_rng(2)
    detector = calibrate_detector(residual(noise("gauss", 0.3, rng)), false_alarms_per_hour=5.0)
    pushed = np.concatenate([np.zeros(100), np.full(100, 2 * detector.values(1, 1)[0])])
    axes = contacts_over_time(detector, residual(pushed))
    assert axes.get_ylabel() == "residual [Nm]" and len(axes.patches) == 1
    assert len(thresholds_of_joints(detector).get_xticks()) == 2
