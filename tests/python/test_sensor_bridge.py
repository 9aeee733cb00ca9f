"""The bridge of a torque sensor: what it keeps of torque, ripple and heat, and what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexspline.errors import InputError
from flexspline.sensor import Bridge, Gauge, WaveStrain, cancelling_bridge, common_bridge

ANGLE = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)


def of_order(bridge: Bridge, order: int) -> float:
    """The share of a bending wave that a bridge passes."""
    one = bridge.with_waves(WaveStrain(order, bridge.strain_per_torque, phase=0.7))
    return one.ripple()[order]


def test_the_default_bridge_reads_what_the_paper_calibrated() -> None:
    per_volt = 1.0 / (200.0 * cancelling_bridge().sensitivity)
    assert per_volt == pytest.approx(62.738)


def test_torque_makes_k_times_strain_times_supply() -> None:
    for bridge in (common_bridge(waves=()), cancelling_bridge(waves=())):
        strain = 70.0 * bridge.strain_per_torque
        expected = bridge.gauge_factor * strain * bridge.supply
        np.testing.assert_allclose(bridge.voltage(ANGLE, 70.0), expected, rtol=1e-12)


def test_four_gauges_cancel_order_two_and_leave_half_the_power_of_order_one() -> None:
    bridge = cancelling_bridge(4)
    assert of_order(bridge, 2) < 1e-12
    assert of_order(bridge, 1) == pytest.approx(math.sqrt(0.5))
    assert of_order(bridge, 4) == pytest.approx(1.0)


@given(st.integers(1, 40))
def test_eight_gauges_keep_only_multiples_of_four(order: int) -> None:
    left = of_order(cancelling_bridge(8), order)
    assert left == pytest.approx(1.0 if order % 4 == 0 else 0.0, abs=1e-12)


def test_the_common_placement_shows_both_peaks_and_eight_gauges_neither() -> None:
    """Fig. 15: 9.89 and 19.76 Hz at 35.16 °/s; a ratio of 101 makes 9.86 and 19.73 Hz of it."""
    turns_per_second = 35.16 / 360.0 * 101.0
    rate, seconds = 200.0, 300.0 / turns_per_second  # whole turns: no leakage
    count = round(rate * seconds)
    time = np.arange(count) * seconds / count
    peaks = {}
    for name, bridge in (("common", common_bridge()), ("eight", cancelling_bridge(8))):
        torque = bridge.reading(2.0 * np.pi * turns_per_second * time, 0.0)
        size = 2.0 * np.abs(np.fft.rfft(torque)) / count
        peaks[name] = {o: size[300 * o] for o in (1, 2)}
        loud = np.flatnonzero(size > 0.1)
        if name == "common":
            assert (loud / seconds).tolist() == pytest.approx([9.86, 19.73], abs=0.01)
    assert peaks["common"][1] > 0.3
    assert peaks["common"][2] > 0.6
    assert max(peaks["eight"].values()) < 1e-10


def test_what_both_gauges_of_a_pair_feel_alike_leaves_no_sinusoid() -> None:
    """(1) as it is printed; (2) needs the bending."""
    alike = common_bridge(waves=(WaveStrain(2, 0.0, stretching=8e-6),))
    assert np.ptp(alike.reading(ANGLE, 0.0)) < 1e-12
    strains = alike.strains(ANGLE, 0.0)
    np.testing.assert_allclose(strains[:, 0], strains[:, 1])
    meant = common_bridge(waves=(WaveStrain(2, 8e-6),))
    strains = meant.strains(ANGLE, 0.0)
    difference = strains[:, 0] - strains[:, 1]
    np.testing.assert_allclose(difference, 2 * 8e-6 * np.cos(2 * ANGLE), atol=1e-15)


def test_a_gauge_sees_the_wave_at_its_order_times_beta_less_phi() -> None:
    gauges = (Gauge(0.4, 1), Gauge(0.4, -1))
    bridge = Bridge(gauges, waves=(WaveStrain(3, 5e-6, phase=0.2),))
    expected = 5e-6 * np.cos(3 * (ANGLE - 0.4) - 0.2)
    np.testing.assert_allclose(bridge.strains(ANGLE, 0.0)[:, 0], expected, atol=1e-14)


def test_ripple_is_the_amplitude_of_the_reading() -> None:
    bridge = cancelling_bridge(8).with_errors(angle=np.linspace(-0.1, 0.1, 8), factor=0.01)
    reading = bridge.reading(ANGLE, 0.0)
    spectrum = 2.0 * np.abs(np.fft.rfft(reading)) / len(ANGLE)
    for order, size in bridge.ripple().items():
        assert size == pytest.approx(spectrum[order], abs=1e-12)


def test_even_heating_cancels_for_equal_gauges_and_a_warmer_flank_does_not() -> None:
    bridge = cancelling_bridge(8, waves=()).with_thermal(2e-6, 1e-8)
    even = bridge.reading(0.0, 0.0, np.array([20.0, 45.0]))
    assert np.abs(even).max() < 1e-9
    signs = np.array([gauge.sign for gauge in bridge.gauges])
    warmer = bridge.reading(0.0, 0.0, (25.0 - 0.5 * signs)[None])
    assert warmer[0] == pytest.approx(-2e-6 * 0.5 / bridge.strain_per_torque, rel=1e-9)


def test_a_tilted_gauge_reads_less_and_calibration_takes_that_out() -> None:
    bridge = cancelling_bridge(4, waves=()).with_errors(tilt=math.radians(10))
    share = math.cos(math.radians(10)) ** 2 - 0.33 * math.sin(math.radians(10)) ** 2
    assert bridge.torque_gain == pytest.approx(share)
    assert bridge.reading(0.0, 10.0)[0] == pytest.approx(10.0)


def test_gauges_that_cancel_the_torque_are_refused() -> None:
    wired_wrong = (Gauge(0.0, 1), Gauge(0.0, 1, arm=-1))
    with pytest.raises(InputError, match="cancel the torque itself"):
        Bridge(wired_wrong)
    crossed = (Gauge(0, 1), Gauge(0, -1), Gauge(1, 1, arm=-1), Gauge(1, -1, arm=1))
    with pytest.raises(InputError, match="cancel the torque itself"):
        Bridge(crossed)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Bridge((Gauge(0, 1), Gauge(0, 1))), "2 gauges in the one arm and 0"),
        (lambda: Bridge(()), "0 gauges in the one arm"),
        (lambda: Gauge(0, 2), "must be \\+1 or -1"),
        (lambda: Gauge(math.nan, 1), "finite"),
        (lambda: WaveStrain(0, 1e-6), "no whole number"),
        (lambda: WaveStrain(2, math.inf), "finite"),
        (lambda: cancelling_bridge(6), "give 4 or 8"),
        (lambda: common_bridge(supply=0.0), "supply"),
        (lambda: common_bridge(waves=(WaveStrain(2, 1e-6),) * 2), "named twice"),
        (lambda: common_bridge().voltage(0.0, 0.0, np.zeros((3, 8))), "8 columns for 4 gauges"),
    ],
)
def test_an_impossible_sensor_is_refused_in_one_sentence(make, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()
