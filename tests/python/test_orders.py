"""Order analysis: laws on simulated logs, and what is known of the measured ones."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import measured
import numpy as np
import pandas
import pytest
from cli_calls import call
from numpy.typing import NDArray
from scipy import stats
from scipy.signal import lfilter

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.writing import write_log
from flexspline.orders import Vibration, find_orders, order_spectrum, pairs, time_spectrum
from flexspline.orders.scan import Share, combined, scattered
from flexspline.orders.spectrum import fourier_sums, stretches

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


def test_an_order_is_found_in_rows_that_are_far_apart_on_the_circle() -> None:
    """Three short pieces of a long run: as one stretch, its line has others as high beside it."""
    rng = np.random.default_rng(3)
    log = turning(1.25, 120_000, {}, noise=0.0, output_spline="flex")
    q, pieces = log["output_position"], [range(k, k + 5700) for k in (17_000, 57_000, 97_000)]
    values = np.full(len(log), np.nan)
    for rows in map(list, pieces):
        values[rows] = 0.0625 * np.cos(1400 * q[rows] + 0.4) + 0.01 * rng.normal(size=len(rows))
    (found,) = find_orders(log, [values])
    assert (found.order, found.pair) == (14, "motor_stator")
    assert abs(found.amplitude - 0.0625) < 4 * found.error
    values[pieces[2]] = np.nan  # and where nothing else is there, each piece by itself
    assert [one.order for one in find_orders(log, [values])] == [14]


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


SPEEDS = (1.0, 1.3, 2.2, 3.1)  # turns in 6 s: order 200 is at 33, 43, 73 and 103 Hz


def humming(log: Log, hertz: float, size: float, seed: int = 0) -> Log:
    """The log with a vibration in its sensor torque, of any phase."""
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    hum = size * np.cos(2 * np.pi * hertz * log["time"] + phase)
    return log.with_columns({"sensor_torque": log["sensor_torque"] + hum}, note="it hums")


def assert_hums(hum: Vibration, hertz: float, size: float) -> None:
    """To a tenth of what can be resolved, and to four standard errors."""
    assert hum.frequency == pytest.approx(hertz, abs=0.1 * hum.resolution)
    assert hum.amplitude == pytest.approx(size, abs=4 * hum.error)


def hummed(size: float) -> list[Log]:
    """Runs at several speeds with order 200, 0.1 Nm, and a vibration at 50 Hz."""
    runs = [turning(turns, 6000, {200.0: 0.1}, seed=i) for i, turns in enumerate(SPEEDS)]
    return [humming(log, 50.0, size, i) for i, log in enumerate(runs)]


@pytest.mark.parametrize("size", [0.05, 0.3])
def test_a_vibration_that_stays_at_one_frequency_is_told_from_orders_by_several_speeds(
    size: float,
) -> None:
    logs = hummed(size)
    found = find_orders(logs, "sensor_torque", vibrations=True)
    assert per_turn(found) == [200] and np.isnan(found.found[0].alone)
    (hum,) = found.vibrations
    assert_hums(hum, 50.0, size)
    assert hum.resolution == pytest.approx(1 / 6.0, rel=0.1)
    assert (hum.seen, hum.of) == (4, 4)
    assert "\n         50.00  " in str(found) and "frequency [Hz]" in found._repr_html_()


@pytest.mark.parametrize("size", [0.1, 0.12])
def test_an_order_is_not_lost_to_a_vibration_of_its_size_at_two_speeds(size: float) -> None:
    logs = [turning(turns, 6000, {200.0: 0.1}, seed=i) for i, turns in enumerate(SPEEDS[:2])]
    logs = [humming(log, 31.0, size, i) for i, log in enumerate(logs)]
    found = find_orders(logs, "sensor_torque", vibrations=True)
    assert per_turn(found) == [200]
    assert [hum.frequency for hum in found.vibrations] == pytest.approx([31.0], abs=0.05)


def test_a_strong_vibration_makes_orders_that_only_competition_takes_away() -> None:
    plain = find_orders(hummed(0.3), "sensor_torque")
    assert len(plain) > 1 and plain.vibrations == () and plain.frequencies is None
    assert "vibration" not in str(plain)


def test_at_one_speed_nothing_tells_an_order_from_a_vibration_and_it_says_so() -> None:
    found = find_orders(hummed(0.3)[0], "sensor_torque", vibrations=True)
    assert found.vibrations == () and per_turn(found) == [200, 300]
    text = str(found)
    assert "all runs turn at one speed, 1.05 rad/s" in text and "300 (50 Hz)" in text
    assert "record a run at another speed" in text


def test_two_speeds_tell_an_order_and_it_is_called_no_vibration() -> None:
    logs = [turning(turns, 6000, {200.0: 0.1}, seed=i) for i, turns in enumerate(SPEEDS[:2])]
    found = find_orders(logs, "sensor_torque", vibrations=True)
    assert found.found[0].per_output_turn == 200 and np.isnan(found.found[0].alone)
    assert "no vibration that stays at one frequency was found" in str(found)


def test_a_speed_that_changes_within_a_run_tells_a_vibration_from_an_order() -> None:
    time = np.arange(12_000) * 1e-3
    q = 2 * np.sin(2 * np.pi * 0.1 * time + 1)
    torque = 0.05 * coloured(np.random.default_rng(1), 12_000) + 0.2 * np.cos(100 * q - 0.4)
    log = Log.from_arrays(
        time=time, output_position=q, sensor_torque=torque, facts={"gear_ratio": 100}
    )
    assert find_orders(log, "sensor_torque", vibrations=True).vibrations == ()
    found = find_orders(humming(log, 40.0, 0.2), "sensor_torque", vibrations=True)
    assert per_turn(found) == [100]
    (hum,) = found.vibrations
    assert_hums(hum, 40.0, 0.2)


def test_a_vibration_of_a_run_that_goes_to_and_fro_is_one_line() -> None:
    """The rows of one direction have gaps in time, which would make two lines of it, or more."""
    time = np.arange(40_000) * 1e-3
    q = 3 * np.sin(2 * np.pi * time / 10)
    torque = 0.1 * np.random.default_rng(0).normal(size=len(time)) + 0.1 * np.cos(200 * q)
    log = Log.from_arrays(
        time=time, output_position=q, sensor_torque=torque, facts={"gear_ratio": 100}
    )
    found = find_orders(humming(log, 50.0, 0.05), "sensor_torque", vibrations=True)
    assert per_turn(found) == [200]
    (hum,) = found.vibrations
    assert_hums(hum, 50.0, 0.05)


def test_runs_without_a_vibration_have_the_orders_that_they_have_without_looking() -> None:
    logs = [turning(turns, 6000, {200.0: 0.1, 700.0: 0.05}, seed=i)
            for i, turns in enumerate(SPEEDS)]  # fmt: skip
    plain = find_orders(logs, "sensor_torque")
    looked = find_orders(logs, "sensor_torque", vibrations=True)
    assert plain.to_frame().drop(columns="alone").equals(looked.to_frame().drop(columns="alone"))


def test_noise_alone_makes_a_vibration_no_more_often_than_stated() -> None:
    named = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        logs = []
        for run in range(2):
            time = np.arange(3000) * 1e-3
            q = 2 * np.sin((1.5 + 0.3 * run) * time) if seed % 2 else (1.5 + run) * time
            logs.append(
                Log.from_arrays(time=time, output_position=q, sensor_torque=coloured(rng, 3000))
            )
        found = find_orders(logs, "sensor_torque", max_order=300, false_alarm=0.05, vibrations=True)
        named += len(found.vibrations) > 0
    # of 40 at 0.05 no more than this, with 99 % probability
    assert named <= stats.binom.ppf(0.99, 40, 0.05)


def test_runs_of_opposite_phases_have_no_steady_part_and_a_spread_as_large_as_they_are() -> None:
    logs = [turning(1 + 0.3 * i, 6000, {200.0: 0.1}, seed=i, phase=np.pi * i) for i in range(4)]
    (found,) = find_orders(logs, "sensor_torque", max_order=1000)
    assert found.steady < 2 * found.steady_error
    # of four waves two of either sign: Σ (β_g - mean)² / 3 is 4/3 of their square
    assert found.spread == pytest.approx(0.1 * np.sqrt(4 / 3), rel=0.15)
    same = [turning(1 + 0.3 * i, 6000, {200.0: 0.1}, seed=i) for i in range(4)]
    (kept,) = find_orders(same, "sensor_torque", max_order=1000)
    assert kept.spread < 0.2 * kept.steady
    assert kept.steady == pytest.approx(0.1, abs=4 * kept.steady_error)


def test_the_spread_and_the_error_of_the_steady_part_are_those_that_made_the_waves() -> None:
    rng = np.random.default_rng(2)
    beta, tau, sigma = np.array([0.3, -0.2]), 0.05, np.array([0.02, 0.03, 0.05, 0.04, 0.02, 0.03])
    squares, pulls = [], []
    for _ in range(400):
        shares = [
            Share(
                "", 1.0, 100, beta + rng.normal(0, tau, 2) + rng.normal(0, s, 2), s**2 * np.eye(2)
            )
            for s in sigma
        ]
        spread, covariance = scattered(shares)
        made = combined(shares)
        steady = made.steady * np.array([np.cos(made.phase), np.sin(made.phase)])
        squares.append(spread**2)
        pulls.append((steady - beta) @ np.linalg.solve(covariance, steady - beta) / 2)
    # the moment's estimate of τ² scatters by about τ² √(2 / 10) each, and is cut off at zero
    assert np.mean(squares) == pytest.approx(2 * tau**2, rel=0.15)
    # mean of an F(2, ~10): 10 / 8
    assert 0.9 < np.mean(pulls) < 1.6


def test_one_stretch_has_no_spread() -> None:
    (found,) = find_orders(turning(3, 6000, {200.0: 0.1}), "sensor_torque", max_order=500)
    assert np.isnan(found.spread) and found.steady_error == pytest.approx(found.error, rel=1e-3)


def test_the_table_of_orders_and_vibrations_has_units_in_its_heads(tmp_path: Path) -> None:
    found = find_orders(hummed(0.3), "sensor_torque", vibrations=True)
    found.save(tmp_path / "orders.csv")
    table = pandas.read_csv(tmp_path / "orders.csv")
    assert list(table["kind"]) == ["order", "vibration"]
    assert table["steady part [Nm]"][0] == found.found[0].steady
    assert table["spread [Nm]"][0] == found.found[0].spread
    assert table["resolution [orders per output turn]"][0] == found.found[0].resolution
    assert table["frequency [Hz]"][1] == found.vibrations[0].frequency
    assert np.isnan(table["frequency [Hz]"][0]) and np.isnan(table["order of pair"][1])


def test_the_command_prints_and_writes_what_the_call_finds(tmp_path: Path) -> None:
    logs = [log.with_facts({"name": f"run{i}"}) for i, log in enumerate(hummed(0.3))]
    runs = [tmp_path / f"{log.name}.csv" for log in logs]
    for log, path in zip(logs, runs, strict=True):
        write_log(log, path)
    found = find_orders(logs, "sensor_torque", vibrations=True)
    bare = call("orders", *runs, "--target", "sensor_torque")
    assert bare.exit_code == 0, bare.stderr
    assert bare.stdout == f"{found}\n"
    table, folder = tmp_path / "found.csv", tmp_path / "found"
    assert call("orders", *runs, "--target", "sensor_torque", "--out", table).exit_code == 0
    assert call("orders", *runs, "--target", "sensor_torque", "--out", folder).exit_code == 0
    assert sorted(path.name for path in folder.iterdir()) == ["orders.csv", "orders.png"]
    assert (folder / "orders.csv").read_bytes() == table.read_bytes()


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("{run}", "--target"),
        ("{run} --target torsion", "motor_position"),
        ("{run} --target sensor_torque --out {run}", "would overwrite"),
        ("{run} --target sensor_torque --out {text}", "is a file"),
        ("{still} --target sensor_torque --out {folder}/new", "stands still"),
        ("{run} {run} --target sensor_torque", "twice"),
        ("{run} --target sensor_torque --known-load reference_torque", "reference_torque"),
    ],
)
def test_a_wrong_call_of_the_command_is_one_line_and_writes_nothing(
    line: str, says: str, tmp_path: Path
) -> None:
    run, still, text = (tmp_path / name for name in ("run.csv", "still.csv", "notes.txt"))
    log = turning(1, 500, {})
    write_log(log, run)
    write_log(log.with_columns({"output_position": np.ones(500)}, note="still"), still)
    text.write_text("a note\n")
    before = sorted(tmp_path.iterdir())
    arguments = line.format(run=run, still=still, text=text, folder=tmp_path).split()
    result = call("orders", *arguments)
    assert result.exit_code == 2
    assert says in result.stderr and result.stderr.count("\n") == 1, result.stderr
    assert sorted(tmp_path.iterdir()) == before


def test_the_kinova_current_vibrates_at_one_frequency_at_all_speeds(data_folder: Path) -> None:
    found = find_orders(kinova_runs(), "motor_current", vibrations=True)
    assert {100, 200, 400, 700, 1200, 1400, 2100, 2400, 2800, 4200} <= set(per_turn(found))
    (wave,) = found.vibrations
    assert wave.frequency == pytest.approx(5.4, abs=wave.resolution)
    assert wave.speeds[1] > 2 * wave.speeds[0]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda log: find_orders([], "sensor_torque"), "no log"),
        (lambda log: find_orders(log, [np.ones(3)]), "rows"),
        (lambda log: find_orders(log, [np.ones(3), np.ones(3)]), "one array for each log"),
        (lambda log: find_orders(log, "sensor_torque", false_alarm=1.5), "probability"),
        (lambda log: find_orders(log, "sensor_torque", max_order=-1), "above 0"),
        (lambda log: order_spectrum(log, "sensor_torque", pair="teeth"), "no pair"),
    ],
)
def test_a_wrong_call_gets_a_sentence(wrong: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        wrong(turning(1, 500, {}))  # type: ignore[operator]


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


def test_a_joint_at_rest_between_two_quanta_of_its_encoder_has_no_stretch() -> None:
    """The hole between both is wider than all that has rows; the report of such a fit divided by
    the turns of one."""
    time = np.arange(0.0, 20.0, 0.002)
    angle = 0.8 + 3e-6 * (np.random.default_rng(0).random(len(time)) < 0.5)
    log = Log.from_arrays(time=time, output_position=angle, facts={"gear_ratio": 100})
    with pytest.raises(InputError, match="stands still in every log"):
        stretches([log], [np.sin(time)], 1.0)
