"""Order analysis: laws on simulated logs, and what is known of the measured ones."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import measured
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.signal import lfilter

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.orders import find_orders, order_spectrum, pairs, time_spectrum
from flexspline.orders.spectrum import fourier_sums

matplotlib.use("Agg")

Array = NDArray[np.float64]


def coloured(rng: np.random.Generator, rows: int, memory: float = 0.9) -> Array:
    """AR(1) noise with innovations of unit variance."""
    return np.asarray(lfilter([1], [1, -memory], rng.normal(size=rows + 300))[300:])


def turning(
    turns: float,
    rows: int,
    ripple: dict[float, float],
    *,
    noise: float = 0.05,
    seed: int = 0,
    start: float = 0.0,
    phase: float = 0.4,
    **facts: str | float,
) -> Log:
    """A joint that turns evenly, 1 kHz: ripple of the sensor torque, {order: amplitude}."""
    rng = np.random.default_rng(seed)
    time = np.arange(rows) * 1e-3
    q = start + 2 * np.pi * turns * time / time[-1]
    torque = noise * coloured(rng, rows) + sum(a * np.cos(k * q - phase) for k, a in ripple.items())
    return Log.from_arrays(
        time=time, output_position=q, sensor_torque=torque, facts={"gear_ratio": 100, **facts}
    )


def per_turn(analysis: object) -> list[float]:
    return sorted(found.per_output_turn for found in analysis)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("facts", "turns"),
    [
        ({"gear_ratio": 100, "output_spline": "circular"}, [1, 101, 101, 100]),
        ({"gear_ratio": 100, "output_spline": "flex"}, [1, 100, 101, 100]),
        ({"gear_ratio": 100}, [1, 100]),
    ],
)
def test_pairs_turn_as_the_log_format_says(facts: dict[str, object], turns: list[float]) -> None:
    table = pairs(facts)
    assert [pair.turns for pair in table] == turns
    q = np.linspace(0, 20, 300)
    log = Log.from_arrays(time=q, output_position=q, facts=facts)  # type: ignore[arg-type]
    for pair in table:
        np.testing.assert_allclose(pair.angle(log), pair.turns * q, atol=1e-9)


def test_fast_sums_equal_the_plain_sums_at_uneven_angles() -> None:
    rng = np.random.default_rng(1)
    angle, values = rng.uniform(-7, 40, 500), rng.normal(size=500)
    fast = fourier_sums(angle, values, 8, 100.0)
    plain = np.exp(-1j * np.outer(np.arange(801) / 8, angle)) @ values
    assert np.max(np.abs(fast - plain)) < 1e-4 * np.sum(np.abs(values))


def test_a_known_order_comes_back_with_amplitude_and_phase_within_its_error() -> None:
    pulls = []
    for seed in range(20):
        (found,) = find_orders(
            turning(3, 6000, {200: 0.1}, seed=seed), "sensor_torque", max_order=1000
        )
        assert (found.order, found.pair) == (2, "motor_stator")
        assert found.effect == "wave_generator_ripple"
        pulls += [(found.amplitude - 0.1) / found.error, (found.phase - 0.4) / found.phase_error]
    # 40 pulls of unit variance, the floor known to some 15 %: their mean square is 1 ± 0.3
    assert 0.4 < np.mean(np.square(pulls)) < 2.0


def test_two_near_orders_are_two_over_enough_turns_and_one_with_an_alias_over_few() -> None:
    ripple = {200.0: 0.1, 202.0: 0.1}
    assert per_turn(find_orders(turning(3, 8000, ripple), "sensor_torque")) == [200, 202]
    short = find_orders(turning(0.3, 8000, ripple), "sensor_torque")
    near = [found for found in short if 190 < found.per_output_turn < 212]
    assert len(near) == 1
    assert near[0].resolution == pytest.approx(1 / 0.3, rel=0.01)
    assert near[0].order == 2
    assert "output, 202 per turn" in near[0].aliases


def test_flexspline_and_circular_spline_are_told_apart_where_the_turns_allow() -> None:
    log = turning(4, 8000, {101.0: 0.1, 200.0: 0.1}, output_spline="circular")
    found = find_orders(log, "sensor_torque")
    assert {(one.pair, one.order) for one in found} == {
        ("wave_generator_flexspline", 1),
        ("wave_generator_circular_spline", 2),
    }
    assert found.orders_for("wave_generator_ripple") == [1, 2]


def test_uneven_samples_and_missing_values_change_nothing() -> None:
    rng = np.random.default_rng(3)
    time = np.sort(rng.uniform(0, 8, 6000))
    q = 2 * time + 0.3 * np.sin(time)
    torque = 0.1 * np.cos(300 * q) + 0.05 * rng.normal(size=6000)
    torque[100:140] = np.nan
    log = Log.from_arrays(
        time=time, output_position=q, sensor_torque=torque, facts={"gear_ratio": 100}
    )
    (found,) = find_orders(log, "sensor_torque", max_order=800)
    assert found.order == 3
    assert found.amplitude == pytest.approx(0.1, abs=4 * found.error)


def test_an_order_beyond_half_the_rate_is_not_claimed_and_not_drawn() -> None:
    log = turning(3, 6000, {1500.0: 0.3})  # 0.5 turns/s: order 1000 is at 500 Hz, 1500 folds to 500
    spectrum = order_spectrum(log, "sensor_torque", max_order=2000)
    assert np.all(np.isnan(spectrum.amplitude[spectrum.order > 1000]))
    slow = turning(0.6, 6000, {1500.0: 0.3}, seed=1)
    assert per_turn(find_orders([log.rows(slice(0, 1)), slow], "sensor_torque")) == [1500]


def test_leakage_over_part_of_a_turn_is_not_named() -> None:
    log = turning(0.6, 6000, {1.0: 30.0, 100.0: 0.5, 700.0: 0.3}, pole_pairs=7)
    found = find_orders(log, "sensor_torque")
    assert per_turn(found) == [100, 700]
    assert found.orders_for("cogging") == [7]


def test_order_one_alone_is_gravity_and_needs_a_full_turn() -> None:
    full = find_orders(turning(2.5, 10000, {1.0: 3.0}), "sensor_torque", max_order=300)
    assert full.orders_for("gravity") == [1]
    part = find_orders(turning(0.7, 10000, {1.0: 3.0}), "sensor_torque", max_order=300)
    assert len(part) == 0


def test_a_ripple_whose_phase_changes_from_run_to_run_is_still_found() -> None:
    runs = [turning(0.4 + 0.1 * i, 4000, {600.0: 0.06}, seed=i, phase=2.1 * i) for i in range(5)]
    (found,) = find_orders(runs, "sensor_torque", max_order=1000)
    assert found.order == 6
    assert found.steady < 0.6 * found.amplitude
    assert found.amplitude == pytest.approx(0.06, abs=4 * found.error)


def test_noise_alone_names_an_order_no_more_often_than_stated() -> None:
    named = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        time = np.arange(3000) * 1e-3
        q = 2 * np.sin(1.5 * time) if seed % 2 else 2.5 * time
        log = Log.from_arrays(
            time=time,
            output_position=q,
            sensor_torque=coloured(rng, 3000),
            facts={"gear_ratio": 100},
        )
        named += len(find_orders(log, "sensor_torque", max_order=500, false_alarm=0.05)) > 0
    # of 200 logs at 0.05 no more than this, with 99 % probability
    assert named <= stats.binom.ppf(0.99, 200, 0.05)


def test_a_spectrum_over_time_shows_a_sine_with_its_amplitude() -> None:
    log = turning(1, 4000, {}, noise=1e-4)
    spectrum = time_spectrum(log, 0.7 * np.sin(2 * np.pi * 50.1 * log["time"]), unit="Nm")
    frequency, amplitude = spectrum.peaks[0]
    assert frequency == pytest.approx(50.1, abs=0.02)
    assert amplitude == pytest.approx(0.7, rel=0.02)


def test_results_print_draw_and_export_with_units() -> None:
    found = find_orders(turning(3, 6000, {200.0: 0.1, 7.0: 0.2}), "sensor_torque", max_order=500)
    assert "motor, 2 per turn" in str(found)
    assert "<table>" in found._repr_html_()
    assert list(found.to_frame()["order"]) == [7, 2]
    assert "[Nm]" in found.plot().get_ylabel()
    assert "[Hz]" in time_spectrum(turning(1, 500, {}), "sensor_torque").plot().get_xlabel()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda log: find_orders([], "sensor_torque"), "no log"),
        (lambda log: find_orders(log, [np.ones(3)]), "rows"),
        (lambda log: find_orders(log, [np.ones(3), np.ones(3)]), "one array for each log"),
        (lambda log: find_orders(log, "sensor_torque", false_alarm=1.5), "probability"),
        (lambda log: find_orders(log, "sensor_torque", max_order=-1), "above 0"),
        (lambda log: order_spectrum(log, "sensor_torque", pair="teeth"), "no pair"),
    ],
)
def test_a_wrong_call_gets_a_sentence(call: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        call(turning(1, 500, {}))  # type: ignore[operator]


def kinova_runs() -> list[Log]:
    return [measured.kinova(speed).rows(slice(1000, None)) for speed in measured.KINOVA_SPEEDS]


def test_kinova_current_shows_its_known_orders(data_folder: Path) -> None:
    found = find_orders(kinova_runs(), lambda log: 7.6 * log["motor_current"], unit="Nm")
    assert {100, 200, 400, 700, 1200, 1400, 2100, 2400, 2800, 4200} <= set(per_turn(found))
    largest = [(one.per_output_turn, round(one.amplitude, 2)) for one in found][:3]
    assert [order for order, _ in largest] == [1200, 1400, 700]
    assert largest[0][1] == pytest.approx(0.14, abs=0.011)
    assert {7, 14, 21, 28, 42} <= set(found.orders_for("cogging"))


def test_kinova_torque_sensor_shows_8_for_sure_and_2_and_4_with_doubt(data_folder: Path) -> None:
    found = find_orders(kinova_runs(), "sensor_torque")
    assert 8 in found.orders_for("output_ripple")
    assert [faint.order for faint in found.faint] == [2, 4]


@pytest.mark.parametrize(("joint", "ratio", "order"), [(2, 160, 320), (5, 100, 200)])
def test_iiwa_ripple_is_found_over_part_of_a_turn(
    data_folder: Path, joint: int, ratio: int, order: int
) -> None:
    log = measured.iiwa(joint, "p1").with_facts({"gear_ratio": ratio})
    found = find_orders(log, "sensor_torque")
    assert found.found[0].per_output_turn == order
    assert min(per_turn(found)) > 1 / (np.ptp(log["output_position"]) / (2 * np.pi))
