"""What a calibration says of logs that are not what they should be."""

from __future__ import annotations

import calibration_logs as bench
import numpy as np
import pytest
from calibration_logs import QUIET, SENSITIVITY, Bench

from flexspline import InputError, calibrate
from flexspline.logs.log import Log
from flexspline.logs.repairs import repaired

LOAD, DRIFT = bench.load_run(), bench.drift_run(cooling=True)


def changed(log: Log, **columns: np.ndarray) -> Log:  # type: ignore[type-arg]
    return log.with_columns(columns, note="changed")


def refused(says: str, *logs: Log, **arguments: object) -> None:
    with pytest.raises(InputError, match=says) as raised:
        calibrate(list(logs), **arguments)  # type: ignore[arg-type]
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("channel", ["sensor_voltage", "reference_torque", "temperature"])
def test_nan_is_refused_with_its_channel_and_row(channel: str) -> None:
    values = LOAD[channel].copy()
    values[17] = np.nan
    refused(f"{channel} is NaN or infinite in 1 row, first in row 17",
            changed(LOAD, **{channel: values}), DRIFT)  # fmt: skip


def test_nan_in_a_channel_that_is_not_read_does_not_matter() -> None:
    odd = changed(LOAD, motor_current=np.full(len(LOAD), np.nan))
    assert calibrate(odd, degree=0)["sensitivity"].determined


def test_a_saturated_converter_is_refused() -> None:
    clipped = np.minimum(LOAD["sensor_voltage"], 0.9)
    refused("stays at exactly 0.9 V in .* saturated", changed(LOAD, sensor_voltage=clipped), DRIFT)


@pytest.mark.parametrize("limit", [0.45, 0.35, 0.3])
def test_a_converter_that_saturates_at_both_ends_is_refused(limit: float) -> None:
    clipped = np.clip(LOAD["sensor_voltage"] - 0.5, -limit, limit)
    says = rf"stays at exactly -?{limit:g} V in .* saturated"
    refused(says, changed(LOAD, sensor_voltage=clipped), DRIFT)
    refused(says, changed(LOAD, sensor_voltage=clipped), degree=0)


def test_a_unipolar_converter_that_cannot_go_below_zero_is_refused() -> None:
    clipped = np.maximum(LOAD["sensor_voltage"], 0.0)
    refused("stays at exactly 0 V in .* saturated", changed(LOAD, sensor_voltage=clipped), degree=0)


def test_a_drift_run_against_the_end_of_the_converter_is_refused() -> None:
    low = np.maximum(DRIFT["sensor_voltage"], -0.0395)
    refused("stays at exactly -0.0395 V", changed(DRIFT, sensor_voltage=low))


@pytest.mark.parametrize("step", [1e-4, 1e-3, 5e-3])
def test_plateaus_of_a_coarse_converter_are_not_called_saturated(step: float) -> None:
    coarse = step * np.round(LOAD["sensor_voltage"] / step)
    made = calibrate([changed(LOAD, sensor_voltage=coarse), DRIFT])
    fine = calibrate([LOAD, DRIFT])["sensitivity"].value
    # rounding adds step/√12 to single rows, here in 15 levels on plateaus: less than step/1 V
    assert made["sensitivity"].value == pytest.approx(fine, rel=step)


def test_a_simulated_log_without_noise_is_not_called_saturated() -> None:
    clean = Bench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, thermometer=0.0)
    made = calibrate([bench.load_run(clean), bench.drift_run(clean)])
    # double precision of a sum over 10⁴ rows, far below a millionth
    assert made["sensitivity"].value == pytest.approx(SENSITIVITY, rel=1e-9)


def test_a_voltage_that_never_changes_is_refused() -> None:
    dead = np.zeros(len(LOAD))
    refused("0 V in every row", changed(LOAD, sensor_voltage=dead), degree=0)


@pytest.mark.parametrize("slope", [1.0, 60.0, -60.0])
@pytest.mark.parametrize("degree", [0, 1, 2])
def test_a_reference_that_is_the_voltage_is_refused(slope: float, degree: int) -> None:
    copy = changed(LOAD, reference_torque=3.0 + slope * LOAD["sensor_voltage"])
    says = f"reference_torque is sensor_voltage times {slope:g} Nm/V .* mapped twice"
    refused(says, copy, DRIFT, degree=degree)
    refused(says, copy, DRIFT, degree=degree, sensitivity=60.0)


def test_a_reference_computed_from_a_voltage_that_was_rounded_is_refused() -> None:
    computed = np.round(60.0 * LOAD["sensor_voltage"], 5)
    refused("computed from the voltage", changed(LOAD, reference_torque=computed), degree=0)


def test_a_good_reference_that_is_a_thousandth_of_its_range_beside_the_voltage_is_none() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-5 * 70.0, len(LOAD))
    near = changed(LOAD, reference_torque=60.0 * LOAD["sensor_voltage"] + noise)
    assert calibrate(near, degree=0)["sensitivity"].value == pytest.approx(60.0, rel=1e-5)


@pytest.mark.parametrize("size", [1e-200, 1e-310, 1e-13])
@pytest.mark.parametrize("options", [{}, {"degree": 0}, {"sensitivity": 60.0}])
def test_a_reference_below_what_sensors_read_is_refused(
    size: float, options: dict[str, float]
) -> None:
    logs = [changed(g, reference_torque=size * g["reference_torque"]) for g in (LOAD, DRIFT)]
    refused("less than any torque sensor reads", *logs, **options)


@pytest.mark.parametrize("size", [1e-200, 1e-310, 1e-11])
def test_a_voltage_below_the_noise_of_bridges_is_refused(size: float) -> None:
    logs = [changed(g, sensor_voltage=size * g["sensor_voltage"]) for g in (LOAD, DRIFT)]
    refused("less than the noise of any bridge", *logs)


@pytest.mark.parametrize("channel", ["sensor_voltage", "reference_torque", "temperature"])
@pytest.mark.parametrize("size", [1e308, -1e308, 1e150])
def test_values_beyond_all_instruments_are_refused(channel: str, size: float) -> None:
    values = LOAD[channel].copy()
    values[17] = size
    refused(f"{channel} is .* in row 17", changed(LOAD, **{channel: values}), DRIFT)


def test_units_that_make_no_sensor_are_refused() -> None:
    logs = [changed(g, sensor_voltage=2e-9 * g["sensor_voltage"]) for g in (LOAD, DRIFT)]
    refused("sensitivity of no sensor; check the units", *logs)


@pytest.mark.parametrize("rows", [2, 3, 20])
@pytest.mark.parametrize("degree", [0, 2])
def test_a_few_rows_are_refused_in_one_sentence(rows: int, degree: int) -> None:
    says = "cannot hold" if degree == 0 else "distinct temperature"
    refused(says, LOAD.rows(slice(900, 900 + rows)), degree=degree)


def test_a_reference_that_stands_without_temperature_leaves_nothing_to_calibrate() -> None:
    for level in (0.0, 5.0):
        still = changed(LOAD, reference_torque=np.full(len(LOAD), level))
        refused("there is nothing to calibrate", still, degree=0)


def test_one_row_of_load_does_not_end_as_a_defect() -> None:
    spike = np.zeros(len(LOAD))
    spike[50] = 1.0
    log = changed(LOAD, reference_torque=spike)
    assert calibrate(log, degree=0, sensitivity=60.0)["sensitivity"].value == 60.0


@pytest.mark.parametrize(
    "options",
    [
        {"sensitivity": 1e-300},
        {"sensitivity": 1e300},
        {"full_scale": 1e-300},
        {"full_scale": 1e300},
        {"reference_temperature": 1e200},
        {"thermal_lag": 1e300},
        {"thermal_lag": 5.0, "gradient": 1e300},
    ],
)
def test_an_option_that_is_that_of_no_sensor_is_refused(options: dict[str, float]) -> None:
    refused(f"{list(options)[-1]} = .* no sensor", LOAD, DRIFT, **options)


def test_millivolts_as_volts_are_suspected() -> None:
    made = calibrate(changed(LOAD, sensor_voltage=1e3 * LOAD["sensor_voltage"]), degree=0)
    assert any("in mV" in said for said in made.warnings)
    tiny = calibrate(changed(LOAD, sensor_voltage=1e-6 * LOAD["sensor_voltage"]), degree=0)
    assert any("spans only" in said for said in tiny.warnings)


def test_a_reference_of_the_wrong_sign_is_suspected() -> None:
    made = calibrate(changed(LOAD, reference_torque=-LOAD["reference_torque"]), degree=0)
    assert made["sensitivity"].value < 0.0
    assert any("flip_sign=reference_torque" in said for said in made.warnings)


def test_kelvin_is_suspected() -> None:
    logs = [changed(g, temperature=g["temperature"] + 273.15) for g in (LOAD, DRIFT)]
    made = calibrate(logs, reference_temperature=298.15)
    assert any("kelvin" in said for said in made.warnings)


@pytest.mark.parametrize("typed", [False, True])
def test_a_reference_that_never_leaves_zero_determines_no_sensitivity(typed: bool) -> None:
    log = changed(DRIFT, reference_torque=np.zeros(len(DRIFT))) if typed else DRIFT
    made = calibrate(log)
    assert made.sensitivity_reason == "the reference never leaves zero"
    assert made.calibration is None


def test_a_reference_that_stands_under_load_is_said_to_be_in_the_zero() -> None:
    made = calibrate(changed(DRIFT, reference_torque=20.0 + DRIFT["reference_torque"]))
    assert made.sensitivity_reason == "the reference stays at 20 Nm"
    assert any("holds the load" in said for said in made.warnings)


def test_a_voltage_that_does_not_follow_the_reference_determines_no_sensitivity() -> None:
    noise = np.random.default_rng(1).normal(size=len(LOAD))
    made = calibrate(changed(LOAD, sensor_voltage=noise), degree=0)
    assert made.sensitivity_reason == "the voltage does not follow the reference"
    assert made.model.estimators == {}


def test_a_known_sensitivity_that_the_runs_do_not_share_is_said() -> None:
    made = calibrate([bench.load_run(QUIET), bench.drift_run(QUIET)], sensitivity=62.0)
    assert any("by themselves say 62.7" in said for said in made.warnings)


def test_a_run_without_the_reference_is_taken_to_be_without_load_and_said_to() -> None:
    made = calibrate([LOAD, bench.without(DRIFT, "reference_torque")])
    assert any(said.startswith("drift: has no reference_torque") for said in made.warnings)


def test_runs_that_all_lack_the_reference_are_refused() -> None:
    log = bench.without(DRIFT, "reference_torque")
    refused("give reference=None", log)
    assert calibrate(log, reference=None).sensitivity_reason == "the runs are without load"


def test_an_unknown_reference_is_answered_with_the_nearest_channel() -> None:
    refused("did you mean 'reference_torque'", LOAD, reference="refrence_torque", degree=0)


def test_missing_channels_are_named() -> None:
    refused("map the bridge's voltage to it", bench.without(LOAD, "sensor_voltage"))
    refused("no channel 'temperature'.*--degree 0", LOAD, bench.without(DRIFT, "temperature"))


def test_too_few_rows_are_refused_and_counted() -> None:
    refused("1 run with 25 rows cannot hold 1 parameter", LOAD.rows(slice(900, 925)), degree=0)


def test_time_that_runs_backwards_is_refused() -> None:
    refused("time runs backwards", changed(LOAD, time=LOAD["time"][::-1].copy()), degree=0)


def test_what_is_no_log_is_refused() -> None:
    with pytest.raises(InputError, match="there is no log"):
        calibrate([])
    with pytest.raises(InputError, match=r"run\.csv: no such file"):
        calibrate(["run.csv"])


def test_another_channel_can_be_the_reference() -> None:
    log = changed(bench.without(LOAD, "reference_torque"), sensor_torque=LOAD["reference_torque"])
    made = calibrate(log, reference="sensor_torque", degree=0)
    assert made["sensitivity"].value == calibrate(LOAD, degree=0)["sensitivity"].value


@pytest.mark.parametrize("channel", ["sensor_voltage", "reference_torque"])
@pytest.mark.parametrize("width", [1, 2])
def test_spikes_are_named_with_rows_and_repair_and_no_zero_is_said_to_move(
    channel: str, width: int
) -> None:
    values = LOAD[channel].copy()
    rows = np.array([157, 905, 1424, 1503, 1602])
    for k in range(width):
        values[rows + k] += 20.0 * np.ptp(LOAD[channel]) * np.array([1, -1, 1, 1, 1])
    spiked = changed(LOAD, **{channel: values})
    made = calibrate([spiked, DRIFT])
    first = made.warnings[0]
    assert first.startswith(f"load: {channel} leaps in {5 * width} single rows (157, ")
    assert first.endswith(f"ask for the repair drop_spikes={channel}")
    assert made.spiked == (channel,)
    verdict = str(made).partition("parameter")[0]
    assert f"single rows of {channel} leap (repair drop_spikes)" in " ".join(verdict.split())
    assert "the zero moved" not in verdict
    mended = calibrate([repaired(spiked, [f"drop_spikes={channel}"]), DRIFT])
    sound = calibrate([LOAD, DRIFT])["sensitivity"]
    assert mended["sensitivity"].value == pytest.approx(sound.value, abs=sound.standard_error)
    assert mended.spiked == ()


def test_what_is_strange_in_a_run_is_said_with_what_to_do() -> None:
    late = np.arange(len(LOAD)) / 10.0
    late[900:] += 100.0
    (said,) = [s for s in calibrate(changed(LOAD, time=late), degree=0).warnings if "load: " in s]
    assert said.count(". ") == 1 and said.endswith(".")


def waved(late: float, hertz: float, memory: float = 0.2) -> Log:
    """Twenty seconds of a sine of 40 Nm whose reference is recorded so many seconds late."""
    made_of, time = Bench(memory=memory), np.arange(20_000) / 1000.0
    true, seen = (40.0 * np.sin(2.0 * np.pi * hertz * (time - d)) for d in (0.0, late))
    log = bench.recorded("wave", true, np.full(len(time), 25.0), made_of, 3, 1000.0)
    noise = np.random.default_rng(10).normal(0.0, made_of.reference_noise, len(time))
    return changed(log, reference_torque=seen + noise)


def said_of_delay(*logs: Log) -> list[str]:
    return [w for w in calibrate(logs, degree=0).warnings if "looks like hysteresis" in w]


@pytest.mark.parametrize("hertz", [0.5, 2.0])
@pytest.mark.parametrize("late", [0.005, -0.005])
def test_a_reference_that_is_late_is_measured_and_its_repair_named(
    late: float, hertz: float
) -> None:
    log = waved(late, hertz)
    made = calibrate(log, degree=0)
    assert made.delay_test is not None
    assert made.delay_test.seconds == pytest.approx(late, abs=3.0 * made.delay_test.error)
    assert made.delay_test.error < 0.1 * abs(late)
    assert made.delay_test.loop == pytest.approx(2.0 * 40.0 * 2.0 * np.pi * hertz * 0.005, rel=0.1)
    (said,) = said_of_delay(log)
    assert "ms late" in said if late > 0.0 else "ms early" in said
    assert f"ms {'late' if late > 0.0 else 'early'}" in str(made).partition("parameter")[0]
    repair = said.partition("ask for the repair ")[2].partition(",")[0]
    assert repair.startswith("shift=reference_torque:" if late > 0.0 else "shift=sensor_voltage:")
    assert said_of_delay(repaired(log, [repair])) == []


def test_hysteresis_is_not_called_a_delay() -> None:
    for memory in (0.2, 1.0):
        for hertz in (0.5, 2.0):
            assert said_of_delay(waved(0.0, hertz, memory)) == []
    for seed in range(10):
        for ramp in (False, True):
            assert said_of_delay(bench.load_run(seed=seed, ramp=ramp)) == []


def test_no_delay_is_measured_of_a_load_that_stands_or_is_not_fitted() -> None:
    assert calibrate(DRIFT, reference=None).delay_test is None
    assert calibrate(LOAD, degree=0, sensitivity=SENSITIVITY).delay_test is None
