"""`flexspline.estimate`: the right torque, nothing invented, gaps, flags, and what it says."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from chain_rig import (
    BY_MOTOR,
    CALIBRATION,
    COLLISION,
    COMPENSATION,
    DRIVE,
    FACTS,
    MERGE,
    RATIO,
    SENSOR,
    THERMISTOR,
    TORSION,
    joint,
    raw_log,
    whole_joint,
    without,
)
from figure_layout import figure_faults

import flexspline
from flexspline import Collision, Compliance, InputError, Observer, effect
from flexspline.estimation import MEANING, Status
from flexspline.estimators import TemperatureCompensation
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.prepared import Preparation

GAIN = SENSOR.coefficients[1]


def largest(values) -> float:
    return float(np.nanmax(np.abs(values)))


def test_every_estimator_finds_the_external_torque_that_made_the_log() -> None:
    log = raw_log()
    made = flexspline.estimate(whole_joint(), log)
    truth = log["reference_torque"]
    # The gain error is taken off by one step of a contraction: what is left is its square.
    sensor = made["external_torque_sensor"] - truth
    assert largest(sensor) <= 1.01 * GAIN**2 * largest(truth)
    # Exact but for the angles' 52 bits: 2π 2⁻⁵² · 30 turns · K / Ñ.
    stiffness = 15548.0 * (1.0 + (0.05 * 5.0) ** 2)
    assert largest(made["external_torque_compliance"] - truth) <= stiffness * 30.0 * 6.3 * 2.0**-52
    # A first-order low pass is late by 1/K: the error is at most the steepest slope over K, and
    # what the sensor's error does to the load-dependent friction.
    slope = largest(np.gradient(truth, log["time"])) / BY_MOTOR.gain
    friction = DRIVE.coefficients[4]  # of the load; inertia is a load that the observer leaves out
    carried = DRIVE.coefficients[0] * largest(log["output_acceleration"])
    settled = made["time"] > 10.0 / BY_MOTOR.gain
    observer = (made["external_torque_observer"] - truth)[settled]
    assert largest(observer) <= slope + friction * (carried + largest(sensor))
    assert largest(made["sensor_torque"] - log["sensor_torque"]) < 1e-13 * 100
    assert largest(made["temperature"] - log["temperature"]) < 1e-11


def test_estimates_of_several_runs_have_the_errors_beside_their_references() -> None:
    log = raw_log()
    short = log.rows(slice(0, 1000)).with_facts({"name": "short"})
    bare = without(log, "reference_torque").with_facts({"name": "bare"})
    made = flexspline.estimate(whole_joint(), [log, short, bare])
    assert len(made) == 3 and made[1].name == "short"
    np.testing.assert_array_equal(
        made[0]["external_torque_merged"],
        flexspline.estimate(whole_joint(), log)["external_torque_merged"],
    )
    for column in ("external_torque_sensor", "external_torque_merged"):
        truth = [run["reference_torque"] for run in (log, short)]
        errors = [one[column] - known for one, known in zip(made.runs[:2], truth, strict=True)]
        expected = np.concatenate(errors)
        expected = expected[np.isfinite(expected)]
        assert made.rmse[column] == pytest.approx(np.sqrt(np.mean(expected**2)), rel=1e-12)
    table = made.to_frame()
    assert set(table["run"]) == {"rig", "short"}
    text = str(made)
    assert "the estimate less reference_torque" in text and "all runs" in text
    assert "the worst run of external_torque_sensor is" in text
    assert "no reference_torque to compare with: bare" in text
    assert "the estimate less reference_torque" in made._repr_html_()


def test_estimates_without_a_reference_say_what_each_says() -> None:
    bare = without(raw_log(500), "reference_torque")
    made = flexspline.estimate(whole_joint(), [bare, bare])
    assert str(made) == f"{made[0]}\n\n{made[1]}"
    assert np.isnan(made.rmse["external_torque_sensor"])
    with pytest.raises(InputError, match="there is no log to estimate from"):
        flexspline.estimate(whole_joint(), [])


def test_a_reference_torque_is_never_read() -> None:
    log = raw_log()
    bare = without(log, "reference_torque")
    first, second = (flexspline.estimate(whole_joint(), run) for run in (log, bare))
    assert list(first.columns) == list(second.columns)
    for name in first.columns:
        np.testing.assert_array_equal(first[name], second[name])


def test_columns_are_those_of_the_estimators_that_the_model_holds() -> None:
    log = raw_log(500)
    always = ["time", "temperature", "sensor_torque"]
    sensor = [*always, "external_torque_sensor", "status"]
    assert list(flexspline.estimate(joint(), log).columns) == sensor
    made = flexspline.estimate(joint(BY_MOTOR, Collision("observer", (), (2.0,), (2.0,))), log)
    found = ["external_torque_sensor", "external_torque_observer", "contact", "status"]
    assert list(made.columns) == [*always, *found]
    blind = Model({"drive": DRIVE}, FACTS).with_estimator(BY_MOTOR)
    assert "external_torque_sensor" not in flexspline.estimate(blind, log)
    everything = flexspline.estimate(whole_joint(), log)
    assert list(everything.columns) == list(flexspline.estimation.COLUMNS)


def test_every_status_is_a_bit_of_its_own_with_a_meaning() -> None:
    bits = [int(bit) for bit in Status.__members__.values()]
    assert sorted(bits) == [1 << k for k in range(len(bits))]
    assert set(MEANING) == set(Status.__members__.values())


# Nothing invented

SILENT = {  # channel that is gone: what is empty, bits that say so
    "motor_torque": ("observer", Status.NO_OBSERVER | Status.NO_MERGED | Status.NO_CONTACT),
    "motor_position": ("compliance", Status.NO_COMPLIANCE | Status.NO_MERGED | Status.NO_CONTACT),
    "output_acceleration": ("sensor", Status.NO_SENSOR | Status.NO_OBSERVER),
    "sensor_voltage": ("sensor", Status.NO_SENSOR | Status.NO_OBSERVER),
}


@pytest.mark.parametrize("channel", SILENT)
def test_a_row_without_a_channel_has_no_estimate_of_it_and_says_so(channel: str) -> None:
    log = raw_log(1000)
    values = log[channel].copy()
    values[[300, 301, 700]] = np.nan, np.inf, -np.inf
    made = flexspline.estimate(whole_joint(), log.with_columns({channel: values}, note="holes"))
    stage, bits = SILENT[channel]
    empty = np.flatnonzero(np.isnan(made[f"external_torque_{stage}"]))
    assert empty.tolist() == [300, 301, 700]
    assert np.flatnonzero((made.status & int(bits)) == int(bits)).tolist() == [300, 301, 700]


@pytest.mark.parametrize("channel", ["motor_torque", "motor_position"])
def test_a_log_without_a_channel_leaves_its_stage_silent_and_names_it(channel: str) -> None:
    made = flexspline.estimate(whole_joint(), without(raw_log(500), channel))
    stage, bits = SILENT[channel]
    assert np.isnan(made[f"external_torque_{stage}"]).all()
    assert ((made.status & int(bits)) == int(bits)).all()
    assert any(f"reads {channel}, which log 'rig' lacks" in note for note in made.notes)
    assert np.isfinite(made["external_torque_sensor"]).all()


def test_an_observer_names_the_velocity_that_a_log_without_any_position_lacks() -> None:
    said = "the observer reads output_velocity, which log 'rig' lacks"
    model = Model({"drive": DRIVE}, FACTS).with_estimator(CALIBRATION).with_estimator(BY_MOTOR)
    moving = raw_log(500)
    still = without(moving, "output_position", "motor_position", "output_velocity")
    assert said in flexspline.estimate(model, still).notes
    assert said not in flexspline.estimate(model, moving).notes


def test_the_part_of_the_torsion_says_too_how_its_channels_were_made() -> None:
    way = Preparation("output_velocity", "output_velocity", 16.0)
    torsion = replace(TORSION, record={**TORSION.record, "prepared": [way.to_json()]})
    notes = flexspline.estimate(
        Model({"torsion": torsion}, FACTS).with_estimator(Compliance()), raw_log(500)
    ).notes
    assert any("part for torsion" in note and way.how in note for note in notes)


def test_an_estimate_that_is_empty_in_all_rows_is_summed_up_as_empty() -> None:
    made = flexspline.estimate(whole_joint(), without(raw_log(500), "motor_torque"))
    (line,) = (s for s in str(made).splitlines() if s.split()[:1] == ["external_torque_observer"])
    assert line.split()[2:] == ["–", "–", "–", "500"]


def test_a_log_without_anything_to_read_is_refused() -> None:
    log = without(raw_log(500), "sensor_voltage", "sensor_torque")
    with pytest.raises(InputError, match=r"no row has all that external_torque_sensor read"):
        flexspline.estimate(joint(CALIBRATION), log)


@pytest.mark.parametrize(
    ("lacks", "named"),
    [
        (("temperature",), "temperature"),
        (("sensor_voltage", "sensor_torque"), r"sensor_voltage \(or sensor_torque\)"),
        (
            ("sensor_voltage", "sensor_torque", "temperature"),
            r"sensor_voltage \(or sensor_torque\), temperature",
        ),
    ],
)
def test_channels_without_which_nothing_can_be_estimated_are_named(
    lacks: tuple[str, ...], named: str
) -> None:
    model = joint(CALIBRATION, TemperatureCompensation((0.1,), temperature_range=(0.0, 80.0)))
    log = without(raw_log(500), "sensor_torque", *lacks)
    with pytest.raises(InputError, match=rf"; map columns to {named}$"):
        flexspline.estimate(model, log)


def test_a_channel_that_is_empty_in_all_rows_is_named_where_nothing_can_be_estimated() -> None:
    log = without(raw_log(500), "sensor_voltage")
    empty = log.with_columns({"sensor_torque": np.full(500, np.nan)}, note="empty")
    says = r"external_torque_sensor read: sensor_torque is NaN in all 500 rows; map"
    with pytest.raises(InputError, match=says):
        flexspline.estimate(joint(CALIBRATION), empty)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("model.json", r"model is a str; give what it holds, Model.load\('model.json'\)"),
        (Path("model.json"), r"Path; give what it holds, Model.load\('model.json'\)"),
        (SimpleNamespace(model=joint(CALIBRATION)), "give the model that it holds, its .model"),
        (None, "model is a NoneType; give a model"),
    ],
)
def test_what_is_no_model_is_refused_with_how_to_give_one(given: object, says: str) -> None:
    with pytest.raises(InputError, match=says):
        flexspline.estimate(given, raw_log(100))  # type: ignore[call-overload]
    with pytest.raises(InputError, match=says):
        flexspline.simulate(given, raw_log(100))  # type: ignore[call-overload]
    if given is not None:
        with pytest.raises(InputError, match=says):
            flexspline.compare(given, raw_log(100))  # type: ignore[arg-type]


@pytest.mark.parametrize("bandwidth", ["a", [5.0], True])
def test_a_bandwidth_that_is_no_number_is_refused(bandwidth: object) -> None:
    log = without(raw_log(500), "output_velocity")
    with pytest.raises(InputError, match=r"bandwidth = .* is no finite number; give one in Hz"):
        flexspline.estimate(whole_joint(), log, bandwidth=bandwidth)  # type: ignore[call-overload]


def test_a_shorted_thermistor_gives_no_temperature_and_the_last_drift() -> None:
    log = raw_log(1000)
    voltage = log["thermistor_voltage"].copy()
    voltage[400:420] = 0.0
    voltage[500:510] = 3.3
    made = flexspline.estimate(
        whole_joint(), log.with_columns({"thermistor_voltage": voltage}, note="short")
    )
    gone = np.isnan(made["temperature"])
    assert np.flatnonzero(gone).tolist() == [*range(400, 420), *range(500, 510)]
    assert np.array_equal(gone, made.flagged(Status.NO_TEMPERATURE))
    # 20 samples of 2 ms at 5 °C/s: 0.2 K of drift, at most 0.05 Nm/K with its gradient, that late.
    whole = flexspline.estimate(whole_joint(), log)
    late = largest(made["sensor_torque"] - whole["sensor_torque"])
    assert 0.0 < late <= 0.2 * 0.05


@pytest.mark.parametrize("channel", ["sensor_voltage", "thermistor_voltage", "temperature"])
def test_an_overload_that_no_instrument_measures_is_an_empty_row(channel: str) -> None:
    log = raw_log(500)
    if channel == "temperature":
        log = without(log, "thermistor_voltage")
    made = []
    for wrong in (9.91e37, np.nan):
        values = np.array(log[channel])
        values[[99, 240]] = wrong
        run = log.with_columns({channel: values}, note="overload")
        made.append(flexspline.estimate(whole_joint(), run))
    for name in made[1].columns:
        np.testing.assert_array_equal(made[0][name], made[1][name])
    said = f"{channel} is 9.91e+37"
    assert any(
        s.startswith(said) and "in row 99" in s and "2 such rows" in s for s in made[0].notes
    )
    assert not any("no instrument" in sentence for sentence in made[1].notes)


def test_a_temperature_of_the_log_is_read_where_it_has_no_thermistor() -> None:
    made = flexspline.estimate(whole_joint(), without(raw_log(500), "thermistor_voltage"))
    assert np.isfinite(made["temperature"]).all() and np.isfinite(made["sensor_torque"]).all()
    assert any("no thermistor_voltage" in note for note in made.notes)


def test_a_sensor_torque_of_the_log_is_taken_as_it_is_where_it_has_no_voltage() -> None:
    log = without(raw_log(500), "sensor_voltage")
    made = flexspline.estimate(whole_joint(), log)
    assert np.array_equal(made["sensor_torque"], log["sensor_torque"])
    assert any("not compensated" in note for note in made.notes)


def test_a_drift_without_a_calibration_is_added_to_the_logs_torque() -> None:
    log = raw_log(500)
    made = flexspline.estimate(joint(COMPENSATION), log)
    whole = flexspline.estimate(joint(COMPENSATION, CALIBRATION), log)
    volts = CALIBRATION.sensitivity * log["sensor_voltage"] + CALIBRATION.zero
    drift = whole["sensor_torque"] - volts
    assert largest(made["sensor_torque"] - log["sensor_torque"] - drift) < 1e-13


# Gaps, flags, velocity


def test_a_gap_starts_every_state_again() -> None:
    log = raw_log(2000)
    holed = log.rows(np.r_[0:800, 1000:2000], note="a gap")
    made = flexspline.estimate(whole_joint(), holed)
    alone = flexspline.estimate(whole_joint(), log.rows(slice(1000, 2000)))
    start = 42  # rows of 2 ms: 5 / K of the slower observer, 60 1/s, is 83.3 ms
    restarted = [*range(start), *range(800, 800 + start)]
    assert np.flatnonzero(made.flagged(Status.RESTARTED)).tolist() == restarted
    for name in alone.columns:
        np.testing.assert_array_equal(made[name][800:], alone[name])
    assert made["external_torque_observer"][800] == 0.0


def test_an_observer_that_comes_up_from_zero_is_flagged_until_it_has_forgotten_that() -> None:
    """A push of 6 Nm was 0, 0.9, 1.6 Nm behind a gap, with status 0 from the second row on."""
    rows = 1000
    log = Log(
        {
            "time": 2e-3 * np.arange(rows),
            "motor_torque": np.full(rows, 6.0 / RATIO),
            "output_velocity": np.zeros(rows),
        },
        FACTS,
    )
    still = Part("motor_torque", (effect("inertia"),), np.array([0.5]))
    model = Model({"drive": still}, FACTS).with_estimator(BY_MOTOR)
    holed = flexspline.estimate(model, log.rows(np.r_[0:500, 600:rows], note="a gap"))
    torque, starting = holed["external_torque_observer"], holed.flagged(Status.RESTARTED)
    assert np.flatnonzero(starting).tolist() == [*range(32), *range(500, 532)]
    assert torque[500] == 0.0 and torque[502] < 2.0
    assert np.abs(torque[~starting] - 6.0).max() < 6.0 * np.exp(-5.0)


def test_what_lies_outside_of_the_fit_is_flagged_and_said() -> None:
    log = raw_log(2000)
    made = flexspline.estimate(whole_joint(), log)
    low, high = COMPENSATION.temperature_range
    outside = (made["temperature"] < low) | (made["temperature"] > high)
    assert outside.any() and not outside.all()
    assert np.array_equal(made.flagged(Status.EXTRAPOLATED), outside)
    assert "outside the range" in str(made)


def test_the_temperature_of_a_parts_fit_is_a_range_too() -> None:
    record = {**SENSOR.record, "validity": {"temperature": [25.0, 35.0]}}
    part = Part(SENSOR.target, SENSOR.effects, SENSOR.coefficients, None, record)
    log = raw_log(2000)
    made = flexspline.estimate(Model({"sensor": part}, FACTS), log)
    outside = (log["temperature"] < 25.0) | (log["temperature"] > 35.0)
    assert outside.any() and np.array_equal(made.flagged(Status.EXTRAPOLATED), outside)


def test_a_temperature_in_kelvin_is_told_in_words_beside_its_flag() -> None:
    log = without(raw_log(500), "thermistor_voltage")
    assert not any("kelvin" in said for said in flexspline.estimate(whole_joint(), log).warnings)
    warm = log.with_columns({"temperature": log["temperature"] + 273.15}, note="as recorded")
    made = flexspline.estimate(whole_joint(), warm)
    assert made.flagged(Status.EXTRAPOLATED).all()
    (said,) = (said for said in made.warnings if "kelvin" in said)
    assert said.startswith(f"{warm.name}: temperature is ")
    assert "take 273.15 off" in said and said in " ".join(str(made).split())


def test_a_torsion_past_the_pole_is_held_flagged_and_of_the_right_sign() -> None:
    log = raw_log(500)
    for step in (0.4, -0.4):
        motor = log["motor_position"].copy()
        motor[200:210] += step
        jumped = log.with_columns({"motor_position": motor}, note="an encoder step")
        made = flexspline.estimate(whole_joint(), jumped)
        assert np.flatnonzero(made.flagged(Status.SATURATED)).tolist() == [*range(200, 210)]
        held = made["external_torque_compliance"][200:210]
        # A motor that runs ahead pushes outward; the pole is kept 5 % off: tan(0.95 π/2) / c_m.
        assert (np.sign(held) == np.sign(step)).all()
        assert largest(held) <= np.tan(0.95 * np.pi / 2) / 0.05 + 1.0


def test_a_missing_velocity_is_derived_as_a_device_would_and_said() -> None:
    log = raw_log()
    bare = without(log, "output_velocity", "output_acceleration")
    made = flexspline.estimate(whole_joint(), bare)
    (note,) = (n for n in made.notes if "derived from output_position" in n)
    assert "output_velocity, output_acceleration" in note and "late by" in note and "20 Hz" in note
    wider = flexspline.estimate(whole_joint(), bare, bandwidth=80.0)
    truth = log["reference_torque"]
    settled = made["time"] > 1.0
    slow, fast = (
        np.std((run["external_torque_observer"] - truth)[settled]) for run in (made, wider)
    )
    assert fast < slow < 1.0
    with pytest.raises(InputError, match="bandwidth"):
        flexspline.estimate(whole_joint(), bare, bandwidth=400.0)


def test_nothing_looks_ahead() -> None:
    log = without(raw_log(2000), "output_velocity", "output_acceleration")
    whole = flexspline.estimate(whole_joint(), log)
    start = flexspline.estimate(whole_joint(), log.rows(slice(0, 1200)))
    for name in start.columns:
        np.testing.assert_array_equal(start[name], whole[name][:1200])


# Refusals


def test_a_gain_that_euler_cannot_hold_is_refused_at_this_rate() -> None:
    log = raw_log(500)
    stable, unstable = (joint(Observer(k, discretisation="euler")) for k in (999.0, 1000.0))
    assert np.isfinite(flexspline.estimate(stable, log)["external_torque_observer"]).all()
    with pytest.raises(InputError, match=r"not stable at 500 Hz; give a gain below 1000 1/s"):
        flexspline.estimate(unstable, log)


def test_time_that_does_not_increase_is_refused_with_its_row() -> None:
    log = raw_log(500)
    for value in (log["time"][9], np.nan):
        time = log["time"].copy()
        time[10] = value
        with pytest.raises(InputError, match="row 10"):
            flexspline.estimate(joint(), log.with_columns({"time": time}, note="stuck"))


EMPTY = {
    "nothing": (Model({}), "nothing to estimate"),
    "a drive alone": (Model({"drive": DRIVE}, FACTS), "nothing to estimate"),
    "an incomplete file": (Model({}, {}, {"merge": MERGE}), "needs the estimator observer"),
    "no gear": (Model({"drive": DRIVE}, {}, {"observer": BY_MOTOR}), "gear ratio"),
    "a mesh that pushes": (
        Model(
            {"torsion": Part("torsion", (effect("mesh_compliance"),), np.array([-1.0]))},
            FACTS,
            {"compliance": Compliance()},
        ),
        "gives way",
    ),
}


@pytest.mark.parametrize("case", EMPTY)
def test_a_model_that_cannot_estimate_is_refused_with_what_to_do(case: str) -> None:
    model, word = EMPTY[case]
    with pytest.raises(InputError, match=word) as caught:
        flexspline.estimate(model, raw_log(500))
    assert ";" in str(caught.value) and "\n" not in str(caught.value)


def test_a_log_of_another_gear_is_refused() -> None:
    with pytest.raises(InputError, match="gear_ratio"):
        flexspline.estimate(whole_joint(), raw_log(500).with_facts({"gear_ratio": 50.0}))


# The result


def test_contacts_are_where_the_thresholds_are_passed() -> None:
    log = raw_log()
    model = joint(Collision("sensor", (), (2.0,), (1.5,)))
    made = flexspline.estimate(model, log)
    torque = made["external_torque_sensor"]
    assert np.array_equal(made["contact"] == 1.0, (torque > 1.5) | (torque < -2.0))
    starts = np.flatnonzero(np.diff(made["contact"]) == 1.0) + 1
    assert [start for start, _ in made.contacts] == made["time"][starts].tolist()
    assert not flexspline.estimate(joint(), log).contacts


def test_a_contact_that_goes_on_after_missing_rows_is_one_contact() -> None:
    log = raw_log()
    model = joint(Collision("sensor", (), (2.0,), (1.5,)))
    whole = flexspline.estimate(model, log)
    (first, last), *others = whole.contacts
    inside = np.flatnonzero((log["time"] > first) & (log["time"] < last))
    torque = np.array(log["sensor_torque"])
    torque[inside[5:-5:7]] = np.nan
    end = np.flatnonzero(log["time"] > last)[0]
    torque[end + 3 : end + 6] = np.nan  # behind it, between rows without a contact
    made = flexspline.estimate(model, log.with_columns({"sensor_torque": torque}, note="holes"))
    assert np.isnan(made["contact"]).sum() == len(inside[5:-5:7]) + 3
    assert made.contacts == ((first, last), *others)


@pytest.mark.parametrize("known", [1.0, 0.5, 0.0])
def test_no_contact_is_said_of_rows_in_which_it_is_decided(known: float) -> None:
    log = raw_log()
    torque = np.where(np.arange(len(log)) < known * len(log), log["motor_torque"], np.nan)
    log = log.with_columns({"motor_torque": torque}, note="a drive that falls silent")
    made = flexspline.estimate(joint(BY_MOTOR, Collision("observer", (), (1e3,), (1e3,))), log)
    decided = int(np.isfinite(made["contact"]).sum())
    assert (decided == len(log), decided == 0) == (known == 1.0, known == 0.0)
    text = str(made)
    assert ("no contact\n" in text, f"no contact in {decided} rows" in text) == (
        known == 1.0,
        known == 0.5,
    )
    assert ("no contact" in text) == (known > 0.0)


def test_the_result_speaks() -> None:
    made = flexspline.estimate(whole_joint(), raw_log())
    text, page = str(made), made._repr_html_()
    for word in ("external_torque_merged", "Nm", "contacts:", "status 1 in", "4000 rows"):
        assert word in text and word in page
    assert max(map(len, text.splitlines())) <= 100
    assert "<script" not in page and repr(made).startswith("<Estimate of 'rig': 4000 rows")
    frame = made.to_frame()
    assert list(frame.columns) == list(made.columns) and str(frame["status"].dtype) == "Int64"
    with pytest.raises(InputError, match="did you mean 'external_torque_merged'"):
        made["external_torque_merge"]
    again = pickle.loads(pickle.dumps(made))
    assert np.array_equal(again["status"], made["status"]) and again.notes == made.notes
    with pytest.raises(ValueError):
        made["time"][0] = 1.0


def test_the_plot_shows_every_estimate_and_what_is_flagged() -> None:
    made = flexspline.estimate(whole_joint(), raw_log())
    assert figure_faults(made.plot()) == []
    above, below = made.plot().axes
    labels = [line.get_label() for line in above.lines]
    assert labels == ["sensor", "observer", "compliance", "compliant_observer", "merged"]
    assert len(above.patches) == len(made.contacts) > 0
    assert [tick.get_text() for tick in below.get_yticklabels()] == ["extrapolated", "restarted"]
    assert "[Nm]" in above.get_ylabel() and "[s]" in below.get_xlabel()


def test_a_run_of_one_row_is_a_run() -> None:
    log = raw_log(3)
    made = flexspline.estimate(whole_joint(), log.rows(slice(0, 1)))
    assert len(made) == 1 and made["external_torque_observer"][0] == 0.0
    assert np.isfinite(made["external_torque_sensor"][0])


def test_estimators_go_through_a_file(tmp_path) -> None:
    model, log = whole_joint(), raw_log(500)
    model.save(tmp_path / "model.json")
    first = flexspline.estimate(model, log)
    second = flexspline.estimate(Model.load(tmp_path / "model.json"), log)
    for name in first.columns:
        np.testing.assert_array_equal(first[name], second[name])


def test_only_what_is_read_needs_to_be_there() -> None:
    log = raw_log(500)
    bare = Log.from_arrays(
        time=log["time"], sensor_voltage=log["sensor_voltage"], thermistor_voltage=np.full(500, 1.6)
    )
    model = Model({}).with_estimator(THERMISTOR).with_estimator(COMPENSATION)
    made = flexspline.estimate(model.with_estimator(CALIBRATION), bare)
    assert np.isfinite(made["sensor_torque"]).all()
    assert np.array_equal(made["sensor_torque"], made["external_torque_sensor"])
    assert any("no part for sensor_torque" in note for note in made.notes)


def test_the_observer_of_a_sensor_without_inertia_is_a_low_pass_and_says_so() -> None:
    log = raw_log(2000)
    model = Model({}).with_estimator(CALIBRATION).with_estimator(Observer(50.0))
    made = flexspline.estimate(model, log)
    assert any("low pass" in note for note in made.notes)
    torque, period = made["sensor_torque"], 2e-3
    expected, share = np.zeros(2000), -np.expm1(-50.0 * period)
    for row in range(1, 2000):
        mean = 0.5 * (torque[row] + torque[row - 1])
        expected[row] = expected[row - 1] + share * (mean - expected[row - 1])
    np.testing.assert_allclose(made["external_torque_observer"], expected, atol=1e-12)


def test_a_collision_needs_only_what_it_watches() -> None:
    model = joint(BY_MOTOR, Compliance(), MERGE, COLLISION)
    made = flexspline.estimate(model, without(raw_log(500), "sensor_voltage"))
    assert np.isfinite(made["contact"]).all()


def test_slow_rows_are_left_out_of_the_errors_and_counted() -> None:
    log = raw_log()
    bare = without(log, "reference_torque").with_facts({"name": "bare"})
    made = flexspline.estimate(whole_joint(), [log, bare], speed_above=0.3)
    fast = np.abs(log["output_velocity"]) >= 0.3
    assert 0 < np.count_nonzero(fast) < len(log)
    errors = (made[0]["external_torque_sensor"] - log["reference_torque"])[fast]
    expected = np.sqrt(np.mean(errors[np.isfinite(errors)] ** 2))
    assert made.rmse["external_torque_sensor"] == pytest.approx(expected, rel=1e-12)
    assert made.slow_rows == np.count_nonzero(~fast)
    assert f"{made.slow_rows} rows are slower than 0.3 rad/s" in str(made)
    for logs in (log, [bare]):
        with pytest.raises(InputError, match="list of logs"):
            flexspline.estimate(whole_joint(), logs, speed_above=0.3)


# What makes the estimates wrong


def fitted_on(key: str, **ranges: list[float]) -> Model:
    """The whole joint, one part of which was fitted on these ranges."""
    model = whole_joint()
    part = model.parts[key]
    made = replace(part, record={**part.record, "validity": ranges})
    return model.with_part(made, {})


@pytest.mark.parametrize(
    ("key", "channel"),
    [
        ("sensor", "output_acceleration"),
        ("sensor", "output_position"),
        ("drive", "output_acceleration"),
        ("drive", "output_velocity"),
        ("torsion", "output_position"),
    ],
)
def test_rows_outside_of_what_a_part_was_fitted_to_are_doubted_as_predict_says(
    key: str, channel: str
) -> None:
    log = raw_log(2000)
    model = fitted_on(key, **{channel: [-0.5, 0.5]})
    part = model.parts[key]
    (said,) = (s for s in model.predict(log, part.target).warnings if "lie outside" in s)
    made = flexspline.estimate(model, log)
    assert made.doubts == (said,) and said in made.warnings
    assert f"of 2000 rows lie outside of what the model of {part.target}" in said
    wide = fitted_on(key, **{channel: [-10.0, 10.0]})
    assert not flexspline.estimate(wide, log).doubts


def test_the_load_and_the_temperature_of_a_range_are_those_that_the_chain_found() -> None:
    log = without(raw_log(2000), "temperature", "sensor_torque", "reference_torque")
    model = fitted_on("sensor", known_load=[-1.0, 1.0], temperature=[25.0, 32.0])
    loaded = replace(model.parts["sensor"], known_load="reference_torque")
    made = flexspline.estimate(model.with_part(loaded, {}), log)
    (said,) = made.doubts
    torque, warm = made["external_torque_sensor"], made["temperature"]
    outside = (np.abs(torque) > 1.1) | (warm < 24.65) | (warm > 32.35)
    assert f"{np.count_nonzero(outside)} of 2000 rows" in said
    assert f"known_load from {torque.min():.3g} to {torque.max():.3g} Nm" in said


def test_a_missing_reading_a_wrapped_angle_and_an_uneven_clock_are_outside_of_no_fit() -> None:
    log = raw_log(2000)
    made = prepared_for(log)
    rng = np.random.default_rng(3)
    late = log["time"] + rng.uniform(-1e-4, 1e-4, len(log))
    holed, wrapped = np.array(log["output_position"]), np.array(log["output_position"])
    holed[[700, 1200, 1201, 1202, 1203]] = np.nan, np.nan, np.nan, np.nan, np.nan
    wrapped = np.mod(wrapped + np.pi, 2.0 * np.pi) - np.pi
    changed: tuple[dict[str, np.ndarray], ...] = (
        {"output_position": holed},
        {"output_position": wrapped},
        {"time": late, "output_position": 4.0 * np.sin(late) + 0.3 * np.sin(2.7 * late)},
    )
    for columns in changed:
        other = log.with_columns(columns, note="as recorded")
        assert not flexspline.estimate(made, other).doubts
        fast = log.with_columns(
            columns | {"output_velocity": 3.0 * log["output_velocity"]}, note=""
        )
        (said,) = flexspline.estimate(made, fast).doubts
        assert "output_velocity from" in said


def prepared_for(log: Log) -> Model:
    """The joint whose drive was fitted on this log, its acceleration made of the position."""
    way = Preparation("output_acceleration", "output_position", 20.0)
    names = ("output_acceleration", "output_velocity")
    ranges = {name: [float(log[name].min()), float(log[name].max())] for name in names}
    model = fitted_on("drive", **ranges)
    return model.with_part(model.parts["drive"].preparing([way]), {})
