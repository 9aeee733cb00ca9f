"""Which of position, velocity and the other side's position has the wrong unit."""

from __future__ import annotations

import re

import numpy as np
import pytest
from checks_logs import sound_log

import flexspline
from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.checks import Finding, Findings, check
from flexspline.logs.repairs import repaired

SEED = 6
DEGREES = 180.0 / np.pi
SCALES = ("velocity_unit", "velocity_scale", "position_unit", "position_scale", "gear_ratio")


def scaled(factors: dict[str, float], *, left_out: str = "") -> Log:
    """The sound log 6 with its motor's velocity, and channels times these factors."""
    log = sound_log(SEED)
    columns = {name: log[name] for name in log.channels}
    assert log.effective_ratio is not None
    columns["motor_velocity"] = log["output_velocity"] * log.effective_ratio
    columns.pop(left_out, None)
    made = {name: column * factors.get(name, 1.0) for name, column in columns.items()}
    return Log(made, log.facts)


def of_scale(found: Findings) -> list[Finding]:
    return [finding for name in SCALES for finding in found.named(name)]


@pytest.mark.parametrize("factor", [DEGREES, 1 / DEGREES, 1000.0, 7.0])
@pytest.mark.parametrize(
    "channel", ["output_position", "output_velocity", "motor_position", "motor_velocity"]
)
def test_of_three_readings_the_one_that_differs_is_blamed(channel: str, factor: float) -> None:
    log = scaled({channel: factor})
    (finding,) = of_scale(check(log))
    assert finding.channel == channel
    assert finding.size == pytest.approx(factor, rel=0.01)
    (asked,) = re.findall(r"repair (scale=\w+:[\d.e+-]+\d)", finding.remedy)
    assert not check(repaired(log, asked)).faults


@pytest.mark.parametrize("factor", [DEGREES, 1 / DEGREES])
def test_of_two_readings_either_may_be_wrong(factor: float) -> None:
    """Without a motor nothing tells whether a position or its velocity has the wrong unit."""
    log = scaled({"output_position": factor}, left_out="motor_position")
    (finding,) = of_scale(check(log))
    said = {DEGREES: "output_position is in degrees", 1 / DEGREES: "it is in deg/s"}[factor]
    assert said in finding.sentence
    for channel in ("output_velocity", "output_position"):
        (asked,) = re.findall(rf"scale={channel}:[\d.e+-]+\d", finding.remedy)
        assert not check(repaired(log, asked)).faults


def swing(amplitude: float, encoder: float, *, twist: float = 0.0, unit: float = 1.0) -> Log:
    """A joint of ratio 100 that swings; `unit`: what its output encoder's numbers are scaled by."""
    time = np.arange(6_000) / 500.0
    angle = amplitude * np.sin(2 * np.pi * 0.3 * time)
    motor = 100.0 * (angle + twist * np.sin(2 * np.pi * 0.3 * time + 0.4))
    noise = np.random.default_rng(3).standard_normal
    return Log.from_arrays(
        time=time,
        output_position=unit * (angle + encoder * noise(len(time))),
        motor_position=motor + 0.001 * noise(len(time)),
        motor_velocity=np.gradient(motor, time) + 0.05 * noise(len(time)),
        facts={"gear_ratio": 100.0, "output_spline": "flex"},
    )


@pytest.mark.parametrize("unit", [1 / DEGREES, DEGREES, 0.01])
def test_a_ratio_that_is_far_off_is_told_however_little_the_output_seems_to_move(
    unit: float,
) -> None:
    (finding,) = check(swing(1.0, 1e-4, unit=unit)).named("gear_ratio")
    assert finding.size == pytest.approx(100.0 / unit, rel=0.01)


@pytest.mark.parametrize("unit", [1 / DEGREES, DEGREES])
def test_degrees_have_the_repair_of_the_side_that_nothing_confirms_first(unit: float) -> None:
    """The motor's velocity confirms its position, or both have the same wrong unit."""
    log = swing(1.0, 1e-4, unit=unit)
    (finding,) = of_scale(check(log))
    assert finding.channel == "output_position"
    first, also = finding.remedy.split("repair ")[1].rstrip(".").split(", or ")
    assert re.match("scale=output_position:", first)
    assert not check(repaired(log, first)).faults
    assert not of_scale(check(repaired(log, also.split(" with "))))


@pytest.mark.parametrize("amplitude", [0.0005, 0.002, 0.01, 0.02])
@pytest.mark.parametrize("encoder", [1e-6, 1e-4, 1e-3])
@pytest.mark.parametrize("twist", [0.0, 0.004])
def test_a_run_that_hardly_moves_says_nothing_of_its_ratio(
    amplitude: float, encoder: float, twist: float
) -> None:
    assert not of_scale(check(swing(amplitude, encoder, twist=twist)))


@pytest.mark.parametrize(
    ("bits", "unit"), [(16, 1.0), (16, 1e-3), (16, -1.0), (32, 1e-3), (16, 0.0134)]
)
@pytest.mark.parametrize("channel", ["motor_current", "output_velocity", "sensor_torque"])
def test_whole_numbers_read_without_their_sign_are_an_error(
    bits: int, unit: float, channel: str
) -> None:
    time = np.arange(4_000) / 500.0
    count = np.round(800.0 * np.sin(2.0 * time) + 3.0 * np.sin(70.0 * time))
    columns = {"time": time, "output_position": np.sin(time), channel: unit * (count % 2**bits)}
    (finding,) = check(Log(columns)).named("unsigned_channel")
    assert finding.severity == "error" and f"bits = {bits}" in finding.remedy
    assert finding.size == np.count_nonzero(np.diff(count < 0))
    columns[channel] = unit * count
    assert not check(Log(columns)).named("unsigned_channel")


def test_a_positive_current_and_an_encoder_that_wraps_are_not_read_without_a_sign() -> None:
    time = np.arange(4_000) / 500.0
    columns = {
        "time": time,
        "motor_position": np.round(3e4 * time) % 2**16 * 1e-3,
        "motor_current": np.where(time % 2.0 < 1.0, 2.0, 60_000.5),
        "sensor_voltage": 0.5 * (np.round(32_767.0 * np.sin(time)) + 32_768.0),
        "supply_voltage": np.full_like(time, 24.0),
    }
    assert not check(Log(columns)).named("unsigned_channel")


def test_a_drive_that_is_off_is_not_clipped_at_zero() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(2_000) / 500.0
    off = (time > 1.0) & (time < 2.0)
    current = np.where(off, 0.0, 2.0 + np.abs(rng.normal(size=len(time))))
    columns = {"time": time, "output_position": np.sin(3 * time), "motor_current": current}
    assert check(Log(columns)).named("clipped_channel")
    found = check(Log({**columns, "enabled": np.where(off, 0.0, 1.0)}))
    assert not found.named("clipped_channel") and found.named("drive_disabled")


def warming(rows: int = 6_000) -> dict[str, np.ndarray]:
    """A joint that swings, with a thermometer of steps of 0.1 K that reads 25 to 26 °C."""
    time = np.arange(rows) / 500.0
    noise = np.random.default_rng(5).standard_normal(rows)
    return {
        "time": time,
        "output_position": np.sin(time),
        "motor_torque": 0.1 * np.tanh(np.cos(time) / 0.01) + 0.01 * noise,
        "temperature": np.round(10.0 * (25.0 + time / time[-1] + 0.05 * noise)) / 10.0,
    }


def in_milliseconds(channels: tuple[str, ...]) -> Log:
    """Four seconds of some channels of a joint at 1 kHz whose time is said to be seconds."""
    time = np.arange(4_000) / 1_000
    made = {"time": 1_000 * time, "output_position": np.sin(3 * time)}
    made["output_velocity"] = 3 * np.cos(3 * time)
    made["temperature"] = 25 + time
    return Log({name: made[name] for name in ("time", *channels)})


def test_milliseconds_read_as_seconds_are_asked_about_without_a_velocity() -> None:
    log = in_milliseconds(("output_position",))
    (finding,) = check(log).named("slow_clock")
    assert finding.severity == "note" and finding.size == pytest.approx(1.0)
    assert "rows are 1 s apart" in finding.sentence and "milliseconds?" in finding.sentence
    asked = "scale=time:0.001"
    assert asked in finding.remedy and not check(repaired(log, asked)).named("slow_clock")


def test_milliseconds_read_as_seconds_are_told_by_a_velocity_and_scaled_back() -> None:
    log = in_milliseconds(("output_position", "output_velocity"))
    (finding,) = check(log).named("velocity_unit")
    assert finding.severity == "fault" and "time is in milliseconds" in finding.sentence
    assert "scale=time:0.001 if time is wrong" in finding.remedy
    assert not check(repaired(log, "scale=time:0.001")).faults


def test_a_slow_recorder_that_resolves_no_motion_or_reads_none_is_sound() -> None:
    assert not check(in_milliseconds(("temperature",))).named("slow_clock")
    time, random = np.arange(4_000.0), np.random.default_rng(1).standard_normal(4_000)
    poses = np.repeat(random[::100], 100) + 1e-5 * random
    for position in (np.sin(3 * time), np.zeros(4_000), random, poses):
        log = Log({"time": time, "output_position": position})
        assert not check(log).named("slow_clock")


@pytest.mark.parametrize("channel", ["temperature", "motor_temperature"])
@pytest.mark.parametrize("value", [-3276.8, -999.0, -273.15, 850.0, 999.0, 3276.7, 6553.5, 65535.0])
@pytest.mark.parametrize("count", [1, 10, 3_000])
def test_a_temperature_that_no_joint_has_is_impossible_and_no_unread_sign(
    channel: str, value: float, count: int
) -> None:
    """−3276.8 °C in ten rows was called whole numbers of 32 bits, which forbids every fit."""
    columns = warming()
    made = {**columns, channel: columns["temperature"].copy()}
    made[channel][2_000 : 2_000 + count] = value
    log = Log(made)
    found = check(log)
    assert not found.errors
    (finding,) = found.named("impossible_value")
    assert (finding.channel, finding.rows, finding.size) == (channel, (2_000, 2_000 + count), count)
    assert finding.severity == "fault" and "joint has" in finding.sentence
    left = repaired(log, "drop_invalid")
    assert len(left) == len(log) - count and not check(left).named("impossible_value")


def test_a_thermometer_that_is_broken_throughout_hides_no_other_fault() -> None:
    columns = {**warming(), "output_velocity": np.degrees(np.cos(warming()["time"]))}
    for temperature in (columns["temperature"], np.full(6_000, 2_048.0)):
        assert check(Log({**columns, "temperature": temperature})).named("velocity_unit")


@pytest.mark.parametrize("value", [6553.5, 6553.0, 5200.0])
@pytest.mark.parametrize("channel", ["motor_current", "reference_torque", "thermistor_voltage"])
def test_a_sensor_that_fails_now_and_then_is_not_read_without_its_sign(
    channel: str, value: float
) -> None:
    """Its values never come near zero, from which those without their sign jump."""
    columns = warming()
    made = {**columns, channel: columns["temperature"].copy()}
    for first in (500, 2_000, 2_500):
        made[channel][first : first + 10] = value
    assert not check(Log(made)).named("unsigned_channel")


@pytest.mark.parametrize("rate", [50.0, 500.0])
def test_a_current_that_leaps_at_each_reversal_is_read_without_its_sign(rate: float) -> None:
    time = np.arange(int(20 * rate)) / rate
    noise = np.random.default_rng(6).standard_normal(len(time))
    count = np.round(300.0 * np.sign(np.cos(2.0 * time)) + 2.0 * noise)
    columns = {"time": time, "output_position": np.sin(2.0 * time), "motor_current": count % 2**16}
    (finding,) = check(Log(columns)).named("unsigned_channel")
    assert "bits = 16" in finding.remedy


def test_a_fit_that_reads_no_temperature_goes_on_and_one_that_does_is_refused() -> None:
    made = warming()
    made["temperature"][2_000:2_010] = -3276.8
    log = Log({**made, "output_velocity": np.cos(made["time"])}, {"gear_ratio": 100.0})
    fit = flexspline.fit(["offset", "coulomb_friction"], [log], target="motor_torque")
    assert any("temperature is beyond what any joint has in 10 rows" in w for w in fit.warnings)
    with pytest.raises(InputError, match=r"temperature is -3277 .* no joint has .*drop_inv"):
        flexspline.fit(["temperature_dependent_friction"], [log], target="motor_torque")


@pytest.mark.parametrize("channel", ["temperature", "motor_temperature"])
@pytest.mark.parametrize(("celsius", "said"), [(-40.0, "-40"), (23.5, "23.5"), (120.0, "120")])
def test_a_temperature_in_kelvin_is_told_and_one_in_celsius_is_not(
    channel: str, celsius: float, said: str
) -> None:
    def log(zero: float) -> Log:
        warm = zero + celsius + np.linspace(-0.2, 0.2, len(sound_log(SEED)))
        warm[7] = np.nan
        return sound_log(SEED).with_columns({channel: warm}, note="with a thermometer")

    assert not check(log(0.0)).named("temperature_unit")
    (found,) = check(log(273.15)).named("temperature_unit")
    assert (found.severity, found.channel, found.unit) == ("fault", channel, "°C")
    assert found.sentence.endswith(f"in kelvin, and this is {said} °C.")
    assert found.remedy == "Give the column its unit, K, or take 273.15 off."


def turning(speed: float, **factors: float) -> Log:
    """A joint of ratio 100 that turns at up to `speed` rad/s, its channels times these factors."""
    time = np.arange(4_000) / 200.0
    columns = {
        "output_position": speed * np.sin(time),
        "output_velocity": speed * np.cos(time),
        "motor_position": 100.0 * speed * np.sin(time),
        "motor_torque": 0.2 * np.tanh(np.cos(time) / 0.01) + 0.05 * np.cos(time),
    }
    columns["motor_current"] = columns["motor_torque"] / 0.08
    chosen = {name: factor * columns[name] for name, factor in factors.items()}
    facts = {"gear_ratio": 100.0, "output_spline": "flex", "torque_constant": 0.08}
    return Log.from_arrays(time=time, facts=facts, **chosen)


DEGREES = 180.0 / np.pi


@pytest.mark.parametrize(
    "names",
    [
        ("output_position",),
        ("output_velocity",),
        ("motor_position",),
        ("output_position", "output_velocity"),
        ("output_position", "motor_position"),
    ],
)
def test_degrees_of_all_angles_are_told_by_a_motor_faster_than_any(names: tuple[str, ...]) -> None:
    (found,) = check(turning(1.5, **dict.fromkeys(names, DEGREES))).faults
    assert (found.name, found.channel) == ("impossible_speed", names[0])
    assert found.size == pytest.approx(1.5 * DEGREES * (1 if "out" in names[0] else 100), rel=0.02)
    assert "in degrees" in found.sentence
    assert all(f"scale={name}:0.0174533" in found.remedy for name in names)
    assert not check(turning(15.0, **dict.fromkeys(names, 1.0))).faults  # 14 000 rpm


def test_degrees_that_a_velocity_tells_are_told_once() -> None:
    (found,) = check(turning(1.5, output_position=DEGREES, output_velocity=1.0)).faults
    assert found.name == "velocity_unit"


@pytest.mark.parametrize("factor", [1000.0, 0.001, 100.0, 1.0, 1.3])
def test_a_torque_of_the_drive_has_the_scale_of_its_current(factor: float) -> None:
    log = turning(1.0, output_position=1.0, motor_torque=factor, motor_current=-1.0)
    found = check(log).named("torque_scale")
    assert bool(found) == (factor not in (1.0, 1.3))  # of 1.3 a torque constant may be off
    for one in found:
        assert one.severity == "fault" and one.size == pytest.approx(factor)
        assert f"scale=motor_torque:{1 / factor:.6g}" in one.remedy
        assert not check(repaired(log, f"scale=motor_torque:{1 / factor}")).named("torque_scale")
