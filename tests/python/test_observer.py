"""The momentum observer of an arm: what it finds, what it refuses, what its gain costs."""

from __future__ import annotations

import numpy as np
import pytest
from two_link import gravity_free, motion, two_link

import flexspline
from flexspline.errors import FlexsplineWarning, InputError
from flexspline.observer import observe, observer_delay, observer_noise
from flexspline.part import Part
from flexspline.plot.estimate import observer_gain

RATE = 1000.0


def driven(external):
    """Time, q, q̇ and the joints' torque of a moving two-link arm that pushes `external`."""
    time, angle, speed, acceleration = motion(10.0, RATE)
    mass, coriolis, gravity = two_link(angle, speed)
    inner = np.einsum("kij,kj->ki", mass, acceleration) + np.einsum("kij,kj->ki", coriolis, speed)
    return time, angle, speed, inner + gravity + external(time)


def steps(time):
    return np.stack([2.0 * (time > 5.0), -1.0 * (time > 7.0)], axis=1)


def test_two_joints_find_their_external_torque_behind_a_first_order_low_pass():
    time, angle, speed, torque = driven(steps)
    found = observe(time, angle, speed, torque, gain=50.0, dynamics=two_link)
    late = np.clip(time[:, None] - np.array([5.0, 7.0]), 0.0, None)
    expected = np.array([2.0, -1.0]) * -np.expm1(-50.0 * late)
    # Half a period at the step, 2 Nm · K T / 2 = 0.05 Nm; the smooth part is exact to O(T²).
    assert np.abs(found.external - expected).max() < 2.0 * 50.0 / RATE
    assert np.array_equal(found.residual, -found.external)
    assert "late by 20 ms" in str(found)


def test_the_estimate_starts_at_zero_though_the_arm_moves():
    time, angle, speed, torque = driven(lambda t: np.zeros((len(t), 2)))
    assert np.abs(speed[0]).max() > 0.5
    found = observe(time, angle, speed, torque, gain=50.0, dynamics=two_link)
    assert np.abs(found.external[0]).max() == 0.0
    # τ̄ is taken as linear over a period: what is left is of order T², 1e-6 of some 40 Nm.
    assert np.abs(found.external).max() < 40.0 / RATE**2 * 10.0


def test_a_gap_starts_each_joint_again():
    time, angle, speed, torque = driven(lambda t: np.full((len(t), 2), 3.0))
    keep = (time < 4.0) | (time > 6.0)
    found = observe(
        time[keep], angle[keep], speed[keep], torque[keep], gain=50.0, dynamics=two_link
    )
    behind = np.flatnonzero(time[keep] > 6.0)[0]
    assert np.all(found.external[behind] == 0.0)
    assert found.external[-1] == pytest.approx([3.0, 3.0], abs=1e-3)


def test_one_row_that_is_not_finite_costs_no_more_than_itself():
    time, angle, speed, torque = driven(steps)
    broken = speed.copy()
    broken[6000, 1] = np.nan
    whole = observe(time, angle, speed, torque, gain=50.0, dynamics=two_link)
    found = observe(time, angle, broken, torque, gain=50.0, dynamics=two_link)
    assert np.isfinite(found.external).all()
    assert np.abs(found.external - whole.external)[6500:].max() < 1e-6


def one_joint_part(inertia=True):
    effects = [flexspline.effect("viscous_friction")]
    values = [0.8]
    if inertia:
        effects.append(flexspline.effect("inertia"))
        values.append(0.3)
    return Part("motor_torque", tuple(effects), np.array(values))


def test_one_joint_takes_inertia_and_friction_from_its_fitted_part():
    time = np.arange(0.0, 4.0, 1.0 / RATE)
    angle, speed, acceleration = -np.cos(time), np.sin(time), np.cos(time)
    torque = 0.3 * acceleration + 0.8 * speed + 1.5 * (time > 2.0)
    by_part = observe(time, angle, speed, torque, gain=80.0, friction=one_joint_part())
    by_hand = observe(
        time, angle, speed, torque, gain=80.0, dynamics=0.3, friction=0.8 * speed[:, None]
    )
    assert by_part.external == pytest.approx(by_hand.external, abs=1e-12)
    assert by_part.external[-1, 0] == pytest.approx(1.5, abs=1e-4)


def test_inertia_that_two_or_none_give_is_refused():
    time, rest = np.arange(10.0), np.zeros(10)
    with pytest.raises(InputError, match="both the call and the part"):
        observe(time, rest, rest, rest, gain=1.0, dynamics=0.3, friction=one_joint_part())
    with pytest.raises(InputError, match="nothing gives the inertia"):
        observe(time, rest, rest, rest, gain=1.0, friction=one_joint_part(inertia=False))


def test_a_part_that_repeats_the_dynamics_inertia_is_refused():
    time, angle, speed, torque = driven(steps)
    with pytest.raises(InputError, match=r"part of joint 1 holds inertia.*known_load"):
        observe(
            time,
            angle,
            speed,
            torque,
            gain=50.0,
            dynamics=two_link,
            friction=[one_joint_part(), None],
        )


@pytest.mark.parametrize("factor", [0.0, 1.0 + 1e-5])
def test_a_coriolis_matrix_that_violates_the_slope_of_the_mass_matrix_is_refused(factor):
    def wrong(angle, speed):
        mass, coriolis, gravity = two_link(angle, speed)
        return mass, factor * coriolis, gravity

    time, angle, speed, torque = driven(steps)
    with pytest.raises(InputError, match="violate Ṁ = C"):
        observe(time, angle, speed, torque, gain=50.0, dynamics=wrong)


def test_a_wrong_coriolis_matrix_is_refused_on_a_log_at_rest_too():
    def wrong(angle, speed):
        mass, coriolis, gravity = two_link(angle, speed)
        return mass, 0.0 * coriolis, gravity

    time, rest = np.arange(0.0, 1.0, 0.01), np.full((100, 2), 0.4)
    with pytest.raises(InputError, match="violate Ṁ = C"):
        observe(time, rest, 0.0 * rest, rest, gain=5.0, dynamics=wrong)


@pytest.mark.parametrize(
    ("spoilt", "sentence"),
    [
        (lambda m, c, g: (m[:, :1], c, g), "M of shape"),
        (lambda m, c, g: (m, c, g[:, :1]), "g of shape"),
        (lambda m, c, g: (-m, -c, g), "not positive definite"),
        (lambda m, c, g: (np.triu(m), c, g), "not symmetric"),
        (lambda m, c, g: (m, c, g * np.nan), "g that is not finite"),
        (lambda m, c, g: (m, c), "tuple of three"),
    ],
)
def test_impossible_dynamics_are_refused_in_a_sentence(spoilt, sentence):
    time, angle, speed, torque = driven(steps)
    with pytest.raises(InputError, match=sentence):
        observe(
            time, angle, speed, torque, gain=50.0, dynamics=lambda q, v: spoilt(*two_link(q, v))
        )


def test_a_gain_that_cannot_be_stable_is_refused_and_one_that_rings_is_warned_of():
    time, rest = np.arange(0.0, 1.0, 0.01), np.zeros((100, 1))
    for gain in (0.0, -8.0, np.nan):
        with pytest.raises(InputError, match="give numbers above zero"):
            observe(time, rest, rest, rest, gain=gain, dynamics=1.0)
    with pytest.raises(InputError, match=r"diverges by forward Euler.*exact"):
        observe(time, rest, rest, rest, gain=200.0, dynamics=1.0, discretisation="euler")
    with pytest.warns(FlexsplineWarning, match="rings above 1"):
        observe(time, rest, rest, rest, gain=100.0, dynamics=1.0, discretisation="euler")
    assert observe(time, rest, rest, rest, gain=1e4, dynamics=1.0).external[-1, 0] == 0.0


def test_shapes_and_gains_that_do_not_agree_are_refused():
    time, angle, speed, torque = driven(steps)
    with pytest.raises(InputError, match="do not agree"):
        observe(time, angle[:-1], speed, torque, gain=5.0, dynamics=two_link)
    with pytest.raises(InputError, match="3 gains for 2 joints"):
        observe(time, angle, speed, torque, gain=[1.0, 2.0, 3.0], dynamics=two_link)
    with pytest.raises(InputError, match="need dynamics"):
        observe(time, angle, speed, torque, gain=5.0)
    with pytest.raises(InputError, match="does not increase at row 1"):
        observe(time * 0.0, angle, speed, torque, gain=5.0, dynamics=two_link)


@pytest.mark.parametrize("name", ["exact", "euler"])
def test_noise_of_the_estimate_is_what_the_formula_says(name):
    rng = np.random.default_rng(4)
    count, period, gain = 200_000, 0.01, 60.0
    time = period * np.arange(count)
    torque, speed = 0.2 * rng.standard_normal(count), 0.01 * rng.standard_normal(count)
    found = observe(time, 0.0 * time, speed, torque, gain=gain, dynamics=0.05, discretisation=name)
    said = observer_noise(gain, period, name, torque_noise=0.2, velocity_noise=0.01, inertia=0.05)
    # Relative error of a standard deviation: 1/√(2 n), n reduced by the correlation to ≥ n / 4.
    assert np.std(found.external) == pytest.approx(said, rel=4.0 / np.sqrt(count / 2.0))


@pytest.mark.parametrize("name", ["exact", "euler"])
def test_delay_on_a_ramp_is_what_the_formula_says(name):
    period, gain = 0.01, 60.0
    time = period * np.arange(400)
    # A free inertia under a ramp τ_ext = t: momentum −t²/2.
    found = observe(
        time, 0.0 * time, -(time**2) / 2.0, 0.0 * time, gain=gain, dynamics=1.0, discretisation=name
    )
    late = time[-1] - found.external[-1, 0]
    assert late == pytest.approx(observer_delay(gain, period, name), rel=1e-6)


def test_delay_and_noise_tend_to_those_of_continuous_time():
    for name in ("exact", "euler"):
        assert observer_delay(10.0, 1e-6, name) == pytest.approx(0.1, rel=1e-4)
        assert observer_noise(10.0, 1e-4, name, torque_noise=1.0) == pytest.approx(
            np.sqrt(10.0 * 1e-4 / 2.0), rel=1e-3
        )


def test_the_observer_of_a_joint_goes_into_a_model_as_it_was_run():
    time, angle, speed, torque = driven(steps)
    found = observe(time, angle, speed, torque, gain=[50.0, 80.0], dynamics=two_link)
    assert found.estimator(2, input="motor_torque") == flexspline.Observer(80.0, "motor_torque")
    with pytest.raises(InputError, match="no joint 3"):
        found.estimator(3)


def test_the_plot_of_the_gain_says_both_units():
    axes = observer_gain(0.01, torque_noise=0.02)
    beside = next(each for each in axes.figure.axes if each is not axes)
    assert axes.get_ylabel() == "delay [ms]" and "Nm" in beside.get_ylabel()
    with pytest.raises(InputError, match="diverges"):
        observer_gain(0.01, torque_noise=0.02, gains=[200.0])


def test_gravity_alone_needs_no_coriolis_matrix():
    time, angle, speed, _ = driven(steps)
    torque = gravity_free(angle)
    found = observe(
        time,
        angle,
        0.0 * speed,
        torque,
        gain=50.0,
        dynamics=lambda q, v: (
            np.broadcast_to(np.eye(2), (len(q), 2, 2)),
            np.zeros((len(q), 2, 2)),
            gravity_free(q),
        ),
    )
    assert np.abs(found.external).max() < 1e-12
