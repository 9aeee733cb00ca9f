"""What a certificate compares: rows as a device reads them, and distances between floats."""

from __future__ import annotations

import chain_rig
import device_chains
import numpy as np
import pytest

import flexspline
from flexspline.certification import Output, derived_on_device, differences, same_bits
from flexspline.certification.program import CHANNELS, RESULT, ROW, instruction_cost, rows_of
from flexspline.logs.log import Log

OUTPUTS = {"torque": Output(0, "Nm", 4)}


def results(scalar: str, values: list[float]) -> np.ndarray:
    """Results whose first value is this, good in each sample."""
    made = np.zeros(len(values), dtype=RESULT[scalar])
    made["values"][:, 0] = values
    return made


@pytest.mark.parametrize(
    ("device", "host", "ulp"),
    [
        (1.0, 1.0, 0),
        (np.nextafter(np.float32(1.0), np.float32(2.0)), 1.0, 1),
        (-1.0, np.nextafter(np.float32(-1.0), np.float32(0.0)), 1),
        (0.0, -0.0, 1),
        (2.0**-149, -(2.0**-149), 3),
        (1.0, 2.0, 2**23),
        (np.nan, np.nan, 0),
    ],
)
def test_a_difference_counts_the_floats_between(device: float, host: float, ulp: int) -> None:
    made, single = results("float", [0.5, device]), results("float", [0.5, host])
    (found,) = differences(OUTPUTS, made, single, results("double", [0.5, host]))
    assert found.largest_ulp == ulp and found.different == (ulp > 0)
    assert same_bits(made, single) == (ulp == 0)
    assert found.largest == (0.0 if np.isnan(host) else abs(float(device) - float(host)))


def test_bits_of_nan_are_the_processors_own() -> None:
    made, single = results("float", [1.0]), results("float", [1.0])
    made["values"][:, 5] = np.array([0x7FC00000], dtype=np.uint32).view(np.float32)
    single["values"][:, 5] = np.array([0xFFC00000], dtype=np.uint32).view(np.float32)
    assert same_bits(made, single)


@pytest.mark.parametrize("name", ["contact", "flags", "missed", "status"])
def test_a_flag_that_differs_is_another_result(name: str) -> None:
    made, single = results("float", [1.0, 2.0]), results("float", [1.0, 2.0])
    single[name][1] = 1
    assert not same_bits(made, single)


def test_what_float_costs_is_taken_where_both_runs_have_the_value() -> None:
    made, double = results("float", [1.0, 2.0, 3.0]), results("double", [1.5, 2.25, 9.0])
    made["missed"][0] = 4
    double["missed"][2] = 4
    (found,) = differences(OUTPUTS, made, made, double)
    assert (found.samples, found.quantisation, found.quantisation_rms) == (2, 0.25, 0.25)
    made["missed"] = 4
    assert differences(OUTPUTS, made, made, double) == ()


def log_of(**columns: np.ndarray) -> Log:
    time = np.array([10.0, 10.001, 10.002, 10.5, 10.501])
    return Log.from_arrays(facts={"name": "run"}, time=time, **columns)


@pytest.mark.parametrize(("scalar", "bits"), [("float", 32), ("double", 64)])
def test_angles_become_turns_and_a_fraction_below_them(scalar: str, bits: int) -> None:
    angles = np.array([0.0, -1e-9, 1000.25, -1000.25, 6.2])
    rows = rows_of(log_of(output_position=angles), scalar)
    fractions = rows["fractions"][:, 0].astype(np.float64) / 2.0**bits
    back = (rows["turns"][:, 0] + fractions) * 2.0 * np.pi
    assert (fractions < 1.0).all() and rows["turns"][1, 0] == -1
    step = 2.0 * np.pi * 2.0**-32 if scalar == "float" else 0.0
    assert np.abs(back - angles).max() <= step + 4e-13
    assert (rows["marks"] & 6 == 2).all()


def test_a_missing_channel_is_nan_and_a_missing_angle_has_no_mark() -> None:
    angles = np.array([1.0, np.nan, np.inf, 2.0, 1e11])
    rows = rows_of(log_of(motor_position=angles, temperature=np.full(5, 30.1)), "float")
    # one that is too far has its mark: the joint refuses it by its limit, as on the device
    assert (rows["marks"] & 4 != 0).tolist() == [True, False, False, True, True]
    assert np.isnan(rows["sensor_voltage"]).all() and (rows["known_load"] == 0.0).all()
    assert (rows["temperature"] == np.float32(30.1)).all()


def test_memory_starts_anew_at_the_first_row_and_behind_a_gap() -> None:
    rows = rows_of(log_of(), "double")
    assert (rows["marks"] & 1).tolist() == [1, 0, 0, 1, 0]
    assert np.abs(rows["period"] - 1e-3).max() < 1e-12
    assert rows["time"][0] == 0.0 and abs(rows["time"][3] - 0.5) < 1e-12


def test_rows_and_results_have_the_sizes_that_the_device_expects() -> None:
    assert [ROW[s].itemsize for s in ("float", "double")] == [64, 112]
    assert [RESULT[s].itemsize for s in ("float", "double")] == [80, 144]
    assert ROW["float"].names[: len(CHANNELS)] == CHANNELS


@pytest.mark.parametrize(
    ("name", "operands", "cycles"),
    [
        ("vmul.f32", "s0, s1, s2", 1),
        ("vldr", "s15, [r3, #4]", 2),
        ("vldr", "d7, [pc, #36]", 3),
        ("vmov", "r3, s15", 2),
        ("vmov.f32", "s15, s14", 1),
        ("vmov.f32", "s15, #112", 1),
        ("vmla.f32", "s0, s1, s2", 3),
        ("vdiv.f32", "s0, s1, s2", 14),
        ("vpush", "{d8-d9}", 5),
        ("vldmia", "r3!, {s0-s3}", 5),
        ("push", "{r4, r5, lr}", 4),
        ("ldrd", "r2, r3, [sp]", 3),
        ("beq.n", "8000", 2.5),
        ("adds", "r1, r2, #3", 1),
    ],
)
def test_an_instruction_of_the_m4f_costs_what_its_table_says(
    name: str, operands: str, cycles: float
) -> None:
    assert instruction_cost("cortex-m4f", name, operands) == cycles
    assert instruction_cost("cortex-m7", name, operands) == (14 if cycles == 14 else 1)


def test_the_certificate_says_what_channels_derived_on_the_device_cost() -> None:
    log = chain_rig.raw_log(1500)
    (said,) = derived_on_device(chain_rig.whole_joint(), log)
    assert "causal, −3 dB at 20 Hz" in said and "\n" not in said
    own = flexspline.estimate(chain_rig.whole_joint(), log)
    bare = chain_rig.without(log, "output_velocity", "output_acceleration")
    derived = flexspline.estimate(chain_rig.whole_joint(), bare)
    name = "external_torque_merged"
    apart = (own[name] - derived[name])[log["time"] >= 0.5]
    rms = float(np.sqrt(np.nanmean(apart**2)))
    assert rms > 0.01 and f"{name} by {rms:.3g} Nm RMS" in said
    assert derived_on_device(chain_rig.whole_joint(), bare) == ()
    truth = log["reference_torque"][log["time"] >= 0.5]
    (again,) = derived_on_device(chain_rig.angle_joint(), log)  # whose stage is the same
    for sentence in (said, again):
        for run in (own, derived):
            error = run[name][log["time"] >= 0.5] - truth
            assert f"{float(np.sqrt(np.nanmean(error**2))):.3g} Nm RMS" in sentence
    none = device_chains.growing_chain()["calibration"]  # reads no velocity
    assert derived_on_device(none, log) == ()
    (zero_phase,) = derived_on_device(chain_rig.angle_joint(), bare)
    assert "in place of the zero-phase output_velocity" in zero_phase
