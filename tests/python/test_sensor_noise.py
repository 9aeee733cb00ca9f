"""The electronics of the sensor: what they read, their noise in Nm, and its table."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.sensor import Electronics, cancelling_bridge, noise_budget


def test_the_budget_is_what_a_hand_reckons() -> None:
    budget = noise_budget(cancelling_bridge(8))
    band = 1.0 / (4.0 * 1e-3)
    by_hand = {
        "bridge": 200.0 * math.sqrt(4.0 * 1.380649e-23 * 298.15 * 700.0 * band),
        "amplifier": 200.0 * 5.9e-9 * math.sqrt(band),
        "low pass": math.sqrt(1.380649e-23 * 298.15 / 100e-9),
        "converter": 1.1e-6,
        "rounding": 5.0 / 2**16 / math.sqrt(12.0),
        "supply": 0.0,
    }
    for name, volts in by_hand.items():
        assert budget[name].volts == pytest.approx(volts)
        assert budget[name].torque == pytest.approx(volts * 62.738)
    total = 62.738 * math.sqrt(sum(volts**2 for volts in by_hand.values()))
    assert budget.total == pytest.approx(total)
    assert budget.step == pytest.approx(5.0 / 2**16 * 62.738)


def test_what_the_converter_reads_scatters_as_the_budget_says() -> None:
    """Noise of a tenth of a step and more makes rounding uniform; 1 % at 20 000 rows is 5 sigma."""
    bridge = cancelling_bridge(8, waves=())
    chain = Electronics(bits=20)
    time = np.arange(40_000) * 2e-2  # 20 time constants apart: independent
    read, saturated = chain.read(
        time, bridge.voltage(0.0 * time, 5.0), bridge_resistance=bridge.output_resistance, seed=3
    )
    budget = noise_budget(bridge, chain)
    assert not saturated.any()
    assert np.std(read) * budget.per_volt == pytest.approx(budget.total, rel=0.02)
    assert np.mean(read) * budget.per_volt == pytest.approx(5.0, abs=5 * budget.total / 200)


def test_the_power_behind_the_low_pass_does_not_depend_on_the_rate() -> None:
    chain = Electronics(bits=24)
    spread = []
    for step in (2e-4, 5e-3):
        time = np.arange(60_000) * step
        read, _ = chain.read(time, 0.0 * time, seed=1)
        spread.append(np.std(read))
    assert spread[0] == pytest.approx(spread[1], rel=0.05)


def test_a_supply_that_the_converter_does_not_follow_scales_with_the_load() -> None:
    bridge, chain = cancelling_bridge(8), Electronics(ratiometric=False)
    assert noise_budget(bridge, chain)["supply"].torque == 0.0
    loaded = noise_budget(bridge, chain, load=-70.0)["supply"]
    assert loaded.torque == pytest.approx(70.0 * 100e-6 / 3.3)


def test_the_end_of_the_converter_is_flagged() -> None:
    bridge, chain = cancelling_bridge(8, waves=()), Electronics()
    torque = np.array([70.0, -70.0, 180.0, -180.0])
    _, saturated = chain.read(np.arange(4.0), bridge.voltage(0.0 * torque, torque))
    assert saturated.tolist() == [False, False, True, True]


def test_text_html_and_data_of_the_budget_agree() -> None:
    budget = noise_budget(cancelling_bridge(8))
    text, page, frame = str(budget), budget.to_html(), budget.to_frame()
    assert "[mNm rms]" in text and "[µV rms]" in text
    assert "1.93 mNm rms" in text and "1.93 mNm rms" in page
    assert math.sqrt((frame["torque"] ** 2).sum()) == pytest.approx(budget.total)
    for source in budget.sources:
        assert source.name in text and source.name in page
    assert page.count("<tr>") == len(budget.sources) + 2


@pytest.mark.parametrize(
    "wrong", [{"gain": 0.0}, {"bits": 1}, {"reference": -1.0}, {"amplifier_noise": math.nan}]
)
def test_impossible_electronics_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="electronics"):
        Electronics(**wrong)
