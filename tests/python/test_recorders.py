"""The collections of recorders by themselves: files, opened by hand, give their truth."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from fresh_recorders import FRESH_RECORDERS
from more_recorders import MORE_RECORDERS
from recorder_files import Recorder, joint_run
from recorders import RECORDERS
from scipy.io import loadmat
from unseen_recorders import UNSEEN_RECORDERS

from flexspline.logs.channels import CHANNELS

Read = dict[str, np.ndarray]

DEGREE = np.pi / 180.0
TURN = 2.0 * np.pi
PER_MINUTE = TURN / 60.0
ALL_RECORDERS = RECORDERS + MORE_RECORDERS + UNSEEN_RECORDERS + FRESH_RECORDERS
BY_NAME = {recorder.name: recorder for recorder in ALL_RECORDERS}


@pytest.fixture(params=ALL_RECORDERS, ids=lambda recorder: recorder.name)
def recorder(request: pytest.FixtureRequest) -> Recorder:
    if request.param.name == "payload_rig":
        request.getfixturevalue("data_folder")
    return request.param


# what holds of all


def test_thirty_fifteen_and_twice_twelve_recorders_have_names_and_file_names_of_their_own(
    data_folder: Path,
) -> None:
    assert (len(RECORDERS), len(MORE_RECORDERS)) == (30, 15)
    assert (len(UNSEEN_RECORDERS), len(FRESH_RECORDERS)) == (12, 12)
    assert len(BY_NAME) == len({recorder.file().name for recorder in ALL_RECORDERS}) == 69


def test_half_of_the_recorders_have_a_documented_form() -> None:
    assert sum(bool(recorder.source) for recorder in RECORDERS) >= 15
    assert sum(bool(recorder.source) for recorder in MORE_RECORDERS) >= 8
    assert all(recorder.hard for recorder in ALL_RECORDERS)


def test_a_truth_has_time_and_two_more_channels_of_one_length(recorder: Recorder) -> None:
    made = recorder.file()
    truth = made.truth
    assert {"time", *truth} <= set(CHANNELS)
    assert len(truth) >= 3
    rows = truth["time"].size
    assert 2000 <= rows <= 6000 or recorder.name == "payload_rig"
    assert {values.shape for values in truth.values()} == {(rows,)}
    assert set(made.steps) == set(truth)


def test_time_starts_at_zero_and_increases(recorder: Recorder) -> None:
    time = recorder.file().truth["time"]
    assert time[0] == 0.0
    assert np.all(np.diff(time) > 0.0)


def test_what_is_ambiguous_or_wraps_is_a_channel_or_a_fact(recorder: Recorder) -> None:
    made = recorder.file()
    assert set(made.ambiguous) <= {*CHANNELS, *made.facts, "gear_ratio"}
    assert set(made.wraps) <= set(made.truth)


def test_a_gear_ratio_is_a_fact_where_the_truth_shows_it(recorder: Recorder) -> None:
    """To 2 ‰ by angles, as the gear twists by 18 Nm in 12 kNm/rad; to 1 % by speeds."""
    made = recorder.file()
    truth = made.truth
    told = made.facts.get("gear_ratio")
    if "motor_position" in truth and "output_position" in truth:
        output, motor = truth["output_position"], truth["motor_position"]
        there = ~np.isnan(output)
        output = np.interp(truth["time"], truth["time"][there], output[there])
        there = ~np.isnan(motor)
        slope = np.polyfit(output[there], motor[there], 1)[0]
        assert slope == pytest.approx(told, rel=2e-3) if told else "gear_ratio" in made.ambiguous
    elif told is not None and "output_position" in truth:
        speed = np.gradient(truth["output_position"], truth["time"])
        slope = np.dot(speed, truth["motor_velocity"]) / np.dot(speed, speed)
        assert slope == pytest.approx(told, rel=0.01)


def test_a_recorder_writes_the_same_small_file_each_time(
    recorder: Recorder, tmp_path: Path
) -> None:
    first = recorder.write(tmp_path)
    content = first.read_bytes()
    assert recorder.write(tmp_path) == first
    assert first.read_bytes() == content
    assert len(content) < 2.5e6
    assert [path.name for path in tmp_path.iterdir()] == [recorder.file().name]


def test_a_run_of_the_joint_has_the_signs_of_the_package() -> None:
    """The sensor reads the load; the drive is ahead of it by what friction takes; θ is +N q."""
    run = joint_run(0, 500.0, 20.0, ratio=80.0, torque_constant=0.2)
    assert np.std(run["sensor_torque"] - run["reference_torque"]) < 0.3
    lost = 80.0 * run["motor_torque"] - run["reference_torque"]
    moving = np.abs(run["output_velocity"]) > 0.2
    assert np.mean((lost * run["output_velocity"])[moving] > 0.0) > 0.99
    assert np.polyfit(run["motor_position"], run["output_position"], 1)[0] > 0.0
    apart = run["motor_torque"] - 0.2 * run["motor_current"]
    assert np.std(apart) < 1.5 * np.hypot(3e-3, 0.2 * 0.03)
    torsion = 80.0 * run["output_position"] - run["motor_position"]
    assert np.corrcoef(torsion, run["reference_torque"])[0, 1] < -0.9


@pytest.mark.parametrize("motion", ["sines", "trapezoids"])
def test_velocity_is_the_derivative_of_position(motion: str) -> None:
    run = joint_run(5, 1000.0, 9.0, motion=motion, pace=0.7)
    command, rate = run["commanded_position"], 1000.0
    speed = np.gradient(command - 4e-3 * run["output_velocity"], 1.0 / rate)
    smooth = np.convolve(speed - run["output_velocity"], np.full(101, 1 / 101.0), "valid")
    assert np.max(np.abs(smooth)) < 2e-2
    assert np.max(np.abs(np.diff(command))) < 2.5 / rate  # no leap


# each file, opened by hand


def scaled(table: pd.DataFrame, columns: Mapping[str, tuple[object, float]]) -> Read:
    """Channels from columns of a table, each times its unit; time from its first row."""
    read = {n: table[c].to_numpy(dtype=float) * unit for n, (c, unit) in columns.items()}
    if "time" in read:
        read["time"] = read["time"] - read["time"][0]
    return read


def seconds_of_day(clock: pd.Series) -> np.ndarray:
    parts = clock.str.replace(",", ".").str.split(":", expand=True).astype(float)
    seconds = parts[0] * 3600.0 + parts[1] * 60.0 + parts[2]
    return (seconds - seconds.iloc[0]).to_numpy()


def ur_rtde(path: Path) -> Read:
    columns = {
        "time": ("timestamp", 1.0),
        "output_position": ("actual_q_2", 1.0),
        "output_velocity": ("actual_qd_2", 1.0),
        "motor_current": ("actual_current_2", 1.0),
        "commanded_position": ("target_q_2", 1.0),
        "temperature": ("joint_temperatures_2", 1.0),
    }
    return scaled(pd.read_csv(path, sep=" "), columns)


def franka_log(path: Path) -> Read:
    columns = {
        "time": ("time", 1e-3),
        "output_position": ("state.q[3]", 1.0),
        "output_velocity": ("state.dq[3]", 1.0),
        "sensor_torque": ("state.tau_J[3]", 1.0),
        "commanded_position": ("state.q_d[3]", 1.0),
    }
    return scaled(pd.read_csv(path, skipinitialspace=True), columns)


def kinova_kortex(path: Path) -> Read:
    columns = {
        "time": ("timestamp", 1.0),
        "output_position": ("position", DEGREE),
        "output_velocity": ("velocity", DEGREE),
        "sensor_torque": ("torque", 1.0),
        "motor_current": ("current_motor", 1.0),
        "supply_voltage": ("voltage", 1.0),
        "motor_temperature": ("temperature_motor", 1.0),
    }
    return scaled(pd.read_csv(path), columns)


def rostopic_echo(path: Path) -> Read:
    table = pd.read_csv(path)
    assert table["field.name0"].iloc[0] == "elbow_joint"
    columns = {
        "output_position": ("field.position0", 1.0),
        "output_velocity": ("field.velocity0", 1.0),
        "sensor_torque": ("field.effort0", 1.0),
    }
    stamp = table["%time"].to_numpy(dtype=np.int64)
    return scaled(table, columns) | {"time": (stamp - stamp[0]) * 1e-9}


def plotjuggler(path: Path) -> Read:
    columns = {
        "time": ("__time", 1.0),
        "motor_current": ("/drive/current", 1.0),
        "motor_position": ("/drive/position", 1.0),
        "motor_velocity": ("/drive/velocity", 1.0),
        "sensor_torque": ("/joint_states/elbow/effort", 1.0),
        "output_position": ("/joint_states/elbow/position", 1.0),
        "output_velocity": ("/joint_states/elbow/velocity", 1.0),
        "temperature": ("/thermometer/data", 1.0),
    }
    return scaled(pd.read_csv(path), columns)


def moteus(path: Path) -> Read:
    columns = {
        "time": ("time", 1.0),
        "motor_position": ("position", TURN),
        "motor_velocity": ("velocity", TURN),
        "motor_torque": ("torque", 1.0),
        "motor_current": ("q_current", 1.0),
        "supply_voltage": ("voltage", 1.0),
        "motor_temperature": ("temperature", 1.0),
        "output_position": ("encoder_1_position", TURN),
    }
    return scaled(pd.read_csv(path), columns)


def dynamixel_raw(path: Path) -> Read:
    columns = {
        "time": ("Realtime Tick", 1e-3),
        "duty": ("Present PWM", 1.0 / 885.0),
        "motor_current": ("Present Current", 2.69e-3),
        "output_velocity": ("Present Velocity", 0.229 * PER_MINUTE),
        "output_position": ("Present Position", TURN / 4096),
        "commanded_position": ("Goal Position", TURN / 4096),
        "supply_voltage": ("Present Input Voltage", 0.1),
        "temperature": ("Present Temperature", 1.0),
    }
    return scaled(pd.read_csv(path), columns)


def vesc_tool(path: Path) -> Read:
    columns = {
        "time": ("ms_today", 1e-3),
        "supply_voltage": ("input_voltage", 1.0),
        "motor_temperature": ("temp_motor", 1.0),
        "motor_current": ("q_axis_current", 1.0),
        "motor_velocity": ("erpm", PER_MINUTE / 7.0),
        "duty": ("duty_cycle", 1.0),
        "motor_position": ("encoder_position", DEGREE),
    }
    return scaled(pd.read_csv(path, sep=";"), columns)


def insight_arm(path: Path) -> Read:
    columns = {
        "time": ("time(s)", 1.0),
        "output_position": ("enc2(rad)", 1.0),
        "output_velocity": ("v2(rad/s)", 1.0),
        "motor_current": ("cur2(mA)", 1e-3),
        "temperature": ("tcase2(C)", 1.0),
        "motor_temperature": ("trotor2(C)", 1.0),
        "sensor_torque": ("tau2(N-m)", 1.0),
    }
    table = pd.read_csv(path, skipinitialspace=True)
    return scaled(table.rename(columns=str.strip), columns)


def twincat_scope(path: Path) -> Read:
    table = pd.read_csv(
        path, sep="\t", decimal=",", skiprows=24, header=None, skipfooter=1, engine="python"
    )
    columns = {
        "time": (0, 1e-3),
        "output_position": (1, DEGREE),
        "motor_position": (3, DEGREE),
        "output_velocity": (5, DEGREE),
        "motor_current": (7, 1e-3),
        "sensor_torque": (9, 1.0),
    }
    return scaled(table, columns)


def labview_lvm(path: Path) -> Read:
    _, _, body = path.read_text().split("***End_of_Header***")
    table = pd.read_csv(io.StringIO(body.split("\n", 1)[1]), sep="\t")
    columns = {
        "time": ("X_Value", 1.0),
        "output_position": ("Output Angle", DEGREE),
        "motor_velocity": ("Motor Speed", PER_MINUTE),
        "sensor_torque": ("Torque Sensor", 1.0),
        "motor_current": ("Motor Current", 1.0),
        "temperature": ("Temperature", 1.0),
    }
    return scaled(table, columns)


def catman_ascii(path: Path) -> Read:
    columns = {
        "time": ("Zeit  1 - Standardmessrate [s]", 1.0),
        "output_position": ("Winkel_Abtrieb [°]", DEGREE),
        "reference_torque": ("T40B_Drehmoment [kNm]", 1e3),
        "motor_current": ("Strom_Motor [A]", 1.0),
        "temperature": ("PT100_Gehäuse [°C]", 1.0),
    }
    return scaled(pd.read_csv(path, sep="\t", decimal=",", encoding="latin-1"), columns)


def hioki_memory(path: Path) -> Read:
    table = pd.read_csv(path, skiprows=9, header=None)
    columns = {
        "time": (0, 1.0),
        "output_position": (1, DEGREE),
        "motor_velocity": (2, PER_MINUTE),
        "motor_current": (3, 1.0),
        "reference_torque": (4, 1.0),
    }
    return scaled(table, columns)


def tektronix_mdo(path: Path) -> Read:
    table = pd.read_csv(path, skiprows=20, skip_blank_lines=False)
    columns = {"time": ("TIME", 1.0), "motor_current": ("CH1", 1.0), "sensor_voltage": ("CH2", 1.0)}
    return scaled(table, columns)


def etas_inca(path: Path) -> Read:
    table = pd.read_csv(path, sep="\t", skiprows=5, header=None)
    units = {
        "output_position": DEGREE,
        "motor_velocity": PER_MINUTE,
        "motor_current": 1.0,
        "motor_torque": 1.0,
        "sensor_torque": 1.0,
        "motor_temperature": 1.0,
    }
    columns = {name: (k, unit) for k, (name, unit) in enumerate(units.items(), 1)}
    return scaled(table, {"time": (0, 1.0), **columns})


def epos_studio(path: Path) -> Read:
    table = pd.read_csv(path, sep=";", skiprows=8)
    columns = {
        "time": ("Time [ms]", 1e-3),
        "motor_position": ("Position actual value [inc]", TURN / 4096),
        "motor_velocity": ("Velocity actual value [rpm]", PER_MINUTE),
        "motor_current": ("Current actual value averaged [mA]", 1e-3),
        "motor_torque": ("Torque actual value [per mille]", 0.512 / 1000),
        "output_position": ("SSI encoder position [inc]", TURN / 262144),
    }
    return scaled(table, columns)


def excel_german(path: Path) -> Read:
    table = pd.read_csv(path, sep=";", decimal=",", encoding="cp1252")
    columns = {
        "output_position": ("Winkel Abtrieb (°)", DEGREE),
        "motor_position": ("Winkel Motor (°)", -DEGREE),
        "motor_velocity": ("Drehzahl Motor (1/min)", -PER_MINUTE),
        "motor_current": ("Motorstrom (A)", -1.0),
        "sensor_torque": ("Drehmoment (Nm)", 1.0),
        "temperature": ("Temperatur Gehäuse (°C)", 1.0),
        "commanded_position": ("Sollwinkel (°)", DEGREE),
    }
    return scaled(table, columns) | {"time": seconds_of_day(table["Uhrzeit"])}


def excel_unicode_text(path: Path) -> Read:
    table = pd.read_csv(path, sep="\t", encoding="utf-16", skipfooter=2, engine="python")
    columns = {
        "output_position": ("Output angle (deg)", DEGREE),
        "output_velocity": ("Output speed (rpm)", PER_MINUTE),
        "motor_velocity": ("Motor speed (rpm)", PER_MINUTE),
        "reference_torque": ("Torque, load cell (lbf·in)", 0.112984829),
        "motor_current": ("Motor current (A)", 1.0),
    }
    days = table["Timestamp"].to_numpy(dtype=float)
    warmth = (table["Housing temp (°F)"].to_numpy(dtype=float) - 32.0) / 1.8
    return scaled(table, columns) | {"time": (days - days[0]) * 86_400, "temperature": warmth}


def excel_sep_line(path: Path) -> Read:
    table = pd.read_csv(path, sep=";", decimal=",", skiprows=1, encoding="utf-8-sig")
    columns = {
        "time": ("t/ms", 1e-3),
        "output_position": ("phi_ab/°", DEGREE),
        "motor_velocity": ("n_mot/rpm", -PER_MINUTE),
        "motor_current": ("I_q/mA", -1e-3),
        "sensor_torque": ("M_sens/Nm", 1.0),
        "supply_voltage": ("U_zk/V", 1.0),
    }
    return scaled(table, columns) | {"temperature": table["T_geh/K"].to_numpy() - 273.15}


def japanese_logger(path: Path) -> Read:
    table = pd.read_csv(path, encoding="cp932", skiprows=6, header=None)
    columns = {
        "output_position": (2, DEGREE),
        "motor_velocity": (3, PER_MINUTE),
        "motor_current": (4, 1.0),
        "reference_torque": (5, 9.80665e-2),
        "temperature": (6, 1.0),
    }
    return scaled(table, columns) | {"time": seconds_of_day(table[1])}


def arduino_serial(path: Path) -> Read:
    table = pd.read_csv(path, skiprows=2, header=None, skipfooter=1, engine="python")
    columns = {
        "time": (0, 1e-6),
        "motor_position": (1, TURN / 2000),
        "output_position": (2, TURN / 16384),
    }
    return scaled(table, columns)


def pandas_iso(path: Path) -> Read:
    table = pd.read_csv(path, index_col=0)
    stamps = pd.to_datetime(table.index, utc=True, format="ISO8601")
    columns = {
        "enabled": ("enabled", 1.0),
        "output_position": ("joint_angle_rad", 1.0),
        "output_velocity": ("joint_vel_rad_s", 1.0),
        "motor_position": ("motor_angle_rad", 1.0),
        "motor_current": ("motor_current_A", 1.0),
        "reference_torque": ("ft_sensor_Nm", 1.0),
        "commanded_position": ("target_rad", 1.0),
    }
    return scaled(table, columns) | {"time": (stamps - stamps[0]).total_seconds().to_numpy()}


def stm32_swo(path: Path) -> Read:
    table = pd.read_csv(path, skiprows=4, header=None, skipinitialspace=True)
    columns = {
        "time": (0, 1e-3),
        "output_position": (2, TURN / 2**19),
        "motor_position": (3, -TURN / 4096),
        "motor_current": (4, -1e-3),
        "sensor_torque": (5, -1e-3),
        "temperature": (6, 0.1),
    }
    return scaled(table, columns)


def aligned_hash(path: Path) -> Read:
    table = pd.read_csv(path, sep=r"\s+", comment="#", header=None)
    names = (
        "time output_position output_velocity motor_position motor_torque sensor_torque "
        "commanded_position"
    )
    return scaled(table, {name: (k, 1.0) for k, name in enumerate(names.split())})


def simulink_mat5(path: Path) -> Read:
    scope = loadmat(path, simplify_cells=True)["ScopeData"]
    by_label = {signal["label"]: signal["values"] for signal in scope["signals"]}
    return {
        "time": scope["time"],
        "output_position": by_label["q_link [deg]"] * DEGREE,
        "motor_velocity": by_label["omega_motor [rpm]"] * PER_MINUTE,
        "motor_current": by_label["i_q [A]"],
        "sensor_torque": by_label["tau_JTS [Nm]"],
    }


def matlab_v73(path: Path) -> Read:
    with h5py.File(path) as file:
        log = file["log"]
        assert "".join(chr(letter) for letter in log["units/q"][:, 0]) == "deg"
        return {
            "time": log["t"][0],
            "output_position": log["q"][0] * DEGREE,
            "output_velocity": log["dq"][0] * DEGREE,
            "motor_position": log["theta"][0],
            "motor_current": log["i_m"][0],
            "sensor_torque": log["tau"][0],
        }


def hdf5_groups(path: Path) -> Read:
    with h5py.File(path) as file:
        joint = file[file.attrs["joint_under_test"]]
        ticks = file["time"][:]
        return {
            "time": (ticks - ticks[0]) * 1e-9,
            "output_position": joint["position"][:] * DEGREE,
            "output_velocity": joint["velocity"][:] * DEGREE,
            "motor_position": -joint["motor_position"][:],
            "motor_current": joint["motor_current"][:] * -1e-3,
            "sensor_torque": joint["torque"][:],
        }


def numpy_npz(path: Path) -> Read:
    names = {
        "time": "t",
        "output_position": "q",
        "output_velocity": "dq",
        "motor_position": "th",
        "motor_velocity": "dth",
        "motor_current": "i",
        "sensor_torque": "tau_s",
    }
    with np.load(path) as archive:
        return {name: archive[short] for name, short in names.items()}


def numpy_structured(path: Path) -> Read:
    array = np.load(path)
    columns = {
        "time": ("stamp_us", 1e-6),
        "output_position": ("pos_cnt", TURN / 2**20),
        "motor_position": ("mot_cnt", TURN / 2**14),
        "motor_current": ("iq_mA", 1e-3),
        "sensor_torque": ("torque_mNm", 1e-3),
        "temperature": ("temp_dC", 0.1),
    }
    return scaled(pd.DataFrame({name: array[name] for name in array.dtype.names}), columns)


def doosan_rt(path: Path) -> Read:
    columns = {
        "time": ("time_stamp", 1.0),
        "motor_position": ("actual_joint_position[2]", 100.0 * DEGREE),
        "output_position": ("actual_joint_position_abs[2]", DEGREE),
        "motor_velocity": ("actual_joint_velocity[2]", 100.0 * DEGREE),
        "output_velocity": ("actual_joint_velocity_abs[2]", DEGREE),
        "motor_torque": ("actual_motor_torque[2]", 0.01),
        "sensor_torque": ("raw_joint_torque[2]", 1.0),
        "commanded_position": ("target_joint_position[2]", DEGREE),
    }
    return scaled(pd.read_csv(path), columns)


def influx_annotated(path: Path) -> Read:
    table = pd.read_csv(path, comment="#")
    columns = {
        "motor_current": ("iq_a", 1.0),
        "motor_position": ("motor_pos_deg", DEGREE),
        "output_position": ("output_pos_deg", DEGREE),
        "output_velocity": ("output_vel_degs", DEGREE),
        "temperature": ("t_housing_c", 1.0),
        "sensor_torque": ("tau_nm", 1.0),
    }
    stamps = table["_time"].str.removesuffix("Z").to_numpy(dtype="datetime64[ns]")
    ticks = (stamps - stamps[0]).astype(np.int64)
    return scaled(table, columns) | {"time": ticks * 1e-9}


def grafana_formatted(path: Path) -> Read:
    table = pd.read_csv(path, skiprows=1)
    prefixes = {"": 1.0, "m": 1e-3, "µ": 1e-6}

    def numbers(name: str, unit: str) -> np.ndarray:
        parts = table[name].str.extract(rf"^(\S+) (.?){unit}$")
        return parts[0].to_numpy(dtype=float) * parts[1].map(prefixes).to_numpy(dtype=float)

    stamps = pd.to_datetime(table["Time"])
    return {
        "time": (stamps - stamps[0]).dt.total_seconds().to_numpy(),
        "output_position": numbers("joint angle", "°") * DEGREE,
        "motor_velocity": numbers("motor speed", "rpm") * PER_MINUTE,
        "motor_current": numbers("motor current", "A"),
        "sensor_torque": numbers("joint torque", "Nm"),
        "temperature": numbers("housing temperature", "°C"),
    }


def json_lines(path: Path) -> Read:
    first, *lines, _ = path.read_text().splitlines()
    assert json.loads(first)["units"]["q"] == "rad"
    columns = {
        "time": ("ts", 1.0),
        "output_position": ("q", 1.0),
        "output_velocity": ("dq", 1.0),
        "motor_position": ("theta", 1.0),
        "motor_current": ("iq", 1.0),
        "sensor_torque": ("tau_jts", 1.0),
        "temperature": ("temp", 1.0),
    }
    return scaled(pd.DataFrame([json.loads(line) for line in lines]), columns)


def matlab_timetable(path: Path) -> Read:
    table = pd.read_csv(path)
    table["Time"] = table["Time"].str.removesuffix(" sec")
    columns = {
        "time": ("Time", 1.0),
        "output_position": ("phi_out", 1.0),
        "motor_position": ("phi_mot", 1.0),
        "motor_velocity": ("omega_mot", 1.0),
        "motor_current": ("i_q", 1.0),
        "sensor_torque": ("tau_jts", 1.0),
    }
    return scaled(table, columns)


def octave_text(path: Path) -> Read:
    text = path.read_text()
    matrix = re.search(r"# columns: 6\n((?: .*\n)+)", text)
    assert matrix
    table = pd.read_csv(io.StringIO(matrix[1]), sep=" ", header=None).iloc[:, 1:]
    table.columns = pd.Index(re.findall(r"# length: \d+\n(.*)\n", text)[1:])
    columns = {
        "time": ("t_s", 1.0),
        "output_position": ("q_deg", DEGREE),
        "motor_position": ("th_deg", DEGREE),
        "motor_velocity": ("dth_rpm", PER_MINUTE),
        "motor_current": ("iq_A", 1.0),
        "sensor_torque": ("tau_Nm", 1.0),
    }
    return scaled(table, columns)


def r_write_csv(path: Path) -> Read:
    columns = {
        "time": ("Time..s.", 1.0),
        "output_position": ("Output.angle..deg.", DEGREE),
        "motor_velocity": ("Motor.speed..1.min.", PER_MINUTE),
        "motor_current": ("Motor.current..A.", 1.0),
        "sensor_torque": ("Sensor.torque..N.m.", 1.0),
        "temperature": ("Temp...C.", 1.0),
        "enabled": ("Servo.on", 1.0),
    }
    return scaled(pd.read_csv(path, index_col=0), columns)


def pandas_multiindex(path: Path) -> Read:
    table = pd.read_csv(path, header=[0, 1], index_col=0)
    columns = {
        "output_position": (("output", "angle [deg]"), DEGREE),
        "output_velocity": (("output", "velocity [deg/s]"), DEGREE),
        "sensor_torque": (("output", "torque [Nm]"), 1.0),
        "motor_position": (("motor", "angle [rad]"), 1.0),
        "motor_current": (("motor", "current [A]"), 1.0),
        "motor_temperature": (("motor", "temperature [degC]"), 1.0),
    }
    assert table.index.name == "time [s]"
    return scaled(table, columns) | {"time": table.index.to_numpy()}


def fortran_blocks(path: Path) -> Read:
    lines = path.read_text().splitlines()
    numbers = "\n".join(line.replace("D", "E") for line in lines[3:])
    table = pd.read_csv(io.StringIO(numbers), sep=r"\s+", header=None, names=lines[1].split())
    columns = {
        "time": ("T", 1.0),
        "output_position": ("Q2", DEGREE),
        "motor_position": ("TH2", DEGREE),
        "output_velocity": ("V2", 1e-3),
        "motor_current": ("I2", 1.0),
        "sensor_torque": ("M2", -1.0),
    }
    return scaled(table, columns)


def rigol_ds1000z(path: Path) -> Read:
    table = pd.read_csv(path, skiprows=2, header=None)
    columns = {"time": (0, 1e-4), "motor_current": (1, 10.0), "sensor_voltage": (2, 1.0)}
    return scaled(table, columns)


def graphtec_gl240(path: Path) -> Read:
    numbers = re.sub(r"(?<=[+-]) +", "", path.read_text().split('AO1234"\n')[1])
    table = pd.read_csv(io.StringIO(numbers), header=None, na_values="+++++++")
    columns = {
        "output_position": (3, DEGREE),
        "motor_velocity": (4, PER_MINUTE),
        "motor_current": (5, 1.0),
        "reference_torque": (6, 1.0),
        "temperature": (7, 1.0),
    }
    seconds = pd.to_datetime(table[1])
    whole = (seconds - seconds[0]).dt.total_seconds().to_numpy()
    return scaled(table, columns) | {"time": whole + 1e-3 * table[2].to_numpy()}


def french_bench(path: Path) -> Read:
    text = path.read_text(encoding="cp1252").replace("\xa0", "")
    table = pd.read_csv(io.StringIO(text), sep=";", decimal=",", skiprows=3)
    columns = {
        "time": ("Temps (s)", 1.0),
        "output_position": ("Angle sortie (°)", DEGREE),
        "motor_velocity": ("Vitesse moteur (tr/min)", PER_MINUTE),
        "motor_current": ("Courant (A)", 1.0),
        "sensor_torque": ("Couple (N.m)", 1.0),
        "temperature": ("Température (°C)", 1.0),
    }
    return scaled(table, columns)


def russian_cp1251(path: Path) -> Read:
    table = pd.read_csv(path, sep=";", decimal=",", skiprows=4, encoding="cp1251")
    columns = {
        "time": ("Время, мс", 1e-3),
        "output_position": ("Угол выхода, град", DEGREE),
        "motor_position": ("Угол двигателя, град", -DEGREE),
        "motor_velocity": ("Скорость двигателя, об/мин", -PER_MINUTE),
        "motor_current": ("Ток, А", -1.0),
        "sensor_torque": ("Момент датчика, Н·м", 1.0),
        "temperature": ("Температура, °C", 1.0),
    }
    return scaled(table, columns)


def chinese_gbk(path: Path) -> Read:
    table = pd.read_csv(path, skiprows=6, encoding="gbk", skip_blank_lines=False)
    columns = {
        "time": ("时间(ms)", 1e-3),
        "motor_position": ("电机位置(脉冲)", TURN / 131072),
        "output_position": ("输出端位置(脉冲)", TURN / 524288),
        "motor_velocity": ("电机转速(rpm)", PER_MINUTE),
        "motor_current": ("电机电流(A)", 1.0),
        "sensor_torque": ("关节扭矩(N·m)", 1.0),
        "temperature": ("温度(℃)", 1.0),
    }
    return scaled(table, columns)


def polish_drive(path: Path) -> Read:
    table = pd.read_csv(path, sep=";", decimal=",", skiprows=6, encoding="cp1250")
    columns = {
        "time": ("Czas [ms]", 1e-3),
        "output_position": ("Położenie wału [°]", DEGREE),
        "motor_velocity": ("Prędkość silnika [obr/min]", -PER_MINUTE),
        "motor_torque": ("Moment silnika [% Mn]", -0.64 / 100),
        "motor_current": ("Prąd silnika [A RMS]", -1.0),
        "supply_voltage": ("Napięcie DC [V]", 1.0),
        "motor_temperature": ("Temperatura silnika [°C]", 1.0),
    }
    return scaled(table, columns)


def labview_spreadsheet(path: Path) -> Read:
    columns = {
        "time": ("Time (s)", 1.0),
        "output_position": ("Output_Encoder (deg)", DEGREE),
        "motor_position": ("Motor_Encoder (deg)", DEGREE),
        "sensor_torque": ("Torque_Sensor (Nm)", -1.0),
        "motor_current": ("Motor_Current (mA)", 1e-3),
        "supply_voltage": ("Supply_Voltage (V)", 1.0),
        "motor_temperature": ("T_Motor (C)", 1.0),
        "temperature": ("T_Housing (C)", 1.0),
    }
    return scaled(pd.read_csv(path, sep="\t"), columns)


def python_ft_sensor(path: Path) -> Read:
    columns = {
        "time": ("timestamp", 1.0),
        "output_position": ("EncOut_deg", DEGREE),
        "motor_position": ("EncMot_deg", DEGREE),
        "motor_velocity": ("MotSpeed_rpm", PER_MINUTE),
        "motor_current": ("Iq", 1.0),
        "reference_torque": ("Mz", 1.0),
    }
    return scaled(pd.read_csv(path), columns)


def plc_axis(path: Path) -> Read:
    columns = {
        "time": ("Time_ms", 1e-3),
        "commanded_position": ("PosSet", DEGREE),
        "output_position": ("PosAct", DEGREE),
        "output_velocity": ("VelAct", DEGREE),
        "motor_torque": ("TrqAct", 0.64 / 100),
        "motor_velocity": ("MotSpeed", PER_MINUTE),
    }
    return scaled(pd.read_csv(path, sep=";"), columns)


def drive_recorder(path: Path) -> Read:
    columns = {
        "time": ("Time [s]", 1.0),
        "motor_position": ("Position [cnt]", TURN / 65536),
        "motor_velocity": ("Velocity [cnt/sec]", TURN / 65536),
        "motor_current": ("Active Current [A]", 1.0),
        "supply_voltage": ("Bus Voltage [V]", 1.0),
    }
    return scaled(pd.read_csv(path, skiprows=4, skip_blank_lines=False), columns)


def matlab_workspace(path: Path) -> Read:
    variables = loadmat(path, simplify_cells=True)
    assert variables["params"]["N"] == 120.0
    return {
        "time": variables["t"],
        "motor_position": -variables["theta_m"],
        "motor_velocity": -variables["omega_m"],
        "output_position": variables["theta_l"],
        "motor_current": variables["i_q"],
        "sensor_torque": variables["tau_s"],
    }


def hdf5_matrices(path: Path) -> Read:
    names = {
        "output_position": "JointPos",
        "output_velocity": "JointVel",
        "sensor_torque": "JointTorque",
        "motor_position": "MotorPos",
        "motor_current": "MotorCurrent",
        "motor_temperature": "MotorTemp",
    }
    with h5py.File(path) as file:
        ticks = file["Timestamp"][:]
        read = {channel: file[name][:, 2].astype(float) for channel, name in names.items()}
    return read | {"time": 1e-6 * (ticks - ticks[0])}


def arduino_monitor(path: Path) -> Read:
    sent = "\n".join(line.split(" -> ")[1] for line in path.read_text().splitlines()[2:])
    columns = {
        "time": ("millis", 1e-3),
        "output_position": ("theta_deg", DEGREE),
        "motor_velocity": ("motor_rpm", PER_MINUTE),
        "motor_current": ("current_mA", 1e-3),
        "reference_torque": ("loadcell_Nm", 1.0),
        "temperature": ("temp_C", 1.0),
    }
    return scaled(pd.read_csv(io.StringIO(sent)), columns)


def german_messwelle(path: Path) -> Read:
    table = pd.read_csv(path, sep=";", decimal=",", skiprows=6, header=None, encoding="cp1252")
    columns = {
        "time": (0, 1.0),
        "motor_velocity": (1, PER_MINUTE),
        "output_position": (2, DEGREE),
        "reference_torque": (3, 1.0),
        "motor_current": (4, 1.0),
        "motor_temperature": (5, 1.0),
        "temperature": (6, 1.0),
    }
    return scaled(table, columns)


def italian_bench(path: Path) -> Read:
    columns = {
        "time": ("Tempo (ms)", 1e-3),
        "output_position": ("Angolo uscita (gradi)", DEGREE),
        "motor_position": ("Angolo motore (gradi)", -DEGREE),
        "motor_velocity": ("Velocità motore (giri/min)", -PER_MINUTE),
        "motor_current": ("Corrente motore (A)", -1.0),
        "sensor_torque": ("Coppia (Nm)", 1.0),
        "temperature": ("Temp. riduttore (°C)", 1.0),
    }
    return scaled(pd.read_csv(path, sep=";", decimal=",", encoding="cp1252"), columns)


def npz_counts(path: Path) -> Read:
    with np.load(path) as archive:
        ticks = archive["t_us"]
        return {
            "time": 1e-6 * (ticks - ticks[0]),
            "output_position": archive["enc_out"] * (TURN / archive["enc_out_cpr"]),
            "motor_position": archive["enc_mot"] * (TURN / archive["enc_mot_cpr"]),
            "motor_current": 1e-3 * archive["iq_mA"],
            "sensor_torque": archive["torque_sensor_Nm"],
            "temperature": archive["temp_housing"],
        }


def joint_controller_iso(path: Path) -> Read:
    table = pd.read_csv(path, parse_dates=["timestamp"])
    columns = {
        "commanded_position": ("q_des", 1.0),
        "output_position": ("q_act", 1.0),
        "output_velocity": ("dq_act", 1.0),
        "sensor_torque": ("tau_act", 1.0),
        "motor_position": ("motor_pos", 1.0),
        "motor_current": ("motor_current", 1.0),
        "motor_temperature": ("temp_winding_degC", 1.0),
    }
    passed = table["timestamp"] - table["timestamp"].iloc[0]
    return scaled(table, columns) | {"time": passed.dt.total_seconds().to_numpy()}


def sensor_bench(path: Path) -> Read:
    columns = {
        "time": ("t_us", 1e-6),
        "output_position": ("link_angle_deg", DEGREE),
        "motor_position": ("motor_angle_deg", DEGREE),
        "motor_current": ("motor_current_A", 1.0),
        "sensor_voltage": ("bridge_mV", 1e-3),
        "reference_torque": ("T_ref_Nm", 1.0),
        "temperature": ("temp_sensor_C", 1.0),
    }
    return scaled(pd.read_csv(path, comment="#"), columns)


BY_HAND: tuple[Callable[[Path], Read], ...] = (
    ur_rtde,
    franka_log,
    kinova_kortex,
    rostopic_echo,
    plotjuggler,
    moteus,
    dynamixel_raw,
    vesc_tool,
    insight_arm,
    twincat_scope,
    labview_lvm,
    catman_ascii,
    hioki_memory,
    tektronix_mdo,
    etas_inca,
    epos_studio,
    excel_german,
    excel_unicode_text,
    excel_sep_line,
    japanese_logger,
    arduino_serial,
    pandas_iso,
    stm32_swo,
    aligned_hash,
    simulink_mat5,
    matlab_v73,
    hdf5_groups,
    numpy_npz,
    numpy_structured,
    doosan_rt,
    influx_annotated,
    grafana_formatted,
    json_lines,
    matlab_timetable,
    octave_text,
    r_write_csv,
    pandas_multiindex,
    fortran_blocks,
    rigol_ds1000z,
    graphtec_gl240,
    french_bench,
    russian_cp1251,
    chinese_gbk,
    polish_drive,
    labview_spreadsheet,
    python_ft_sensor,
    plc_axis,
    drive_recorder,
    matlab_workspace,
    hdf5_matrices,
    arduino_monitor,
    german_messwelle,
    italian_bench,
    npz_counts,
    joint_controller_iso,
    sensor_bench,
)


def test_every_file_but_that_of_others_and_the_fresh_is_opened_by_hand() -> None:
    fresh = {recorder.name for recorder in FRESH_RECORDERS}
    assert {read.__name__ for read in BY_HAND} == set(BY_NAME) - {"payload_rig"} - fresh


@pytest.mark.parametrize("read", BY_HAND, ids=lambda read: read.__name__)
def test_a_file_opened_by_hand_gives_the_truth(
    read: Callable[[Path], Read], tmp_path: Path
) -> None:
    """To half the step of the file; times to three halves, as the first row is rounded too."""
    recorder = BY_NAME[read.__name__]
    made = recorder.file()
    got = read(recorder.write(tmp_path))
    assert set(got) == set(made.truth)
    for channel, values in got.items():
        halves = 3.0 if channel == "time" else 1.0
        room = 1e-9 * float(np.nanmax(np.abs(made.truth[channel])))
        limit = 0.5 * halves * made.steps[channel] * (1.0 + 1e-6) + room
        assert recorder.gap(channel, values) <= limit, channel
