"""Twelve files as an ordinary week in a laboratory brings them, with known truth.

They are made as those of `recorders`, to score what was tuned on the forty-five of that module and
of `more_recorders`; nothing that guesses was looked at while they were written. No form is that of
a documented program: each is what a person exports, or what a script or a sketch writes. Not part
of the package.
"""

from __future__ import annotations

import io

import h5py
import numpy as np
import recorder_files as rec
from recorder_files import DEG, REV, RPM, Column, File, joint_run
from scipy.io import savemat

_recorder = rec.Recorders()


# English


@_recorder
def labview_spreadsheet() -> File:
    """Tabs and CRLF, seconds since 1904, the motor's current in mA beside the supply's in A, two
    temperatures, a torque sensor that reads the reaction, no velocity.
    """
    run = joint_run(201, 200.0, 15.0, ratio=100.0, motion="trapezoids", from_zero=True)
    rows = run["time"].size
    supply = 0.35 + np.abs(run["duty"] * run["motor_current"]) + rec.white(201, 0.01, rows)
    columns = [
        rec.channel(run, "time", "Time (s)", "%.3f", start=3_853_412_907.115),
        rec.channel(run, "output_position", "Output_Encoder (deg)", "%.4f", DEG),
        rec.channel(run, "motor_position", "Motor_Encoder (deg)", "%.3f", DEG),
        rec.channel(run, "sensor_torque", "Torque_Sensor (Nm)", "%.4f", -1.0),
        rec.channel(run, "motor_current", "Motor_Current (mA)", "%.2f", 1e-3),
        rec.other("Supply_Current (A)", supply, "%.3f"),
        rec.channel(run, "supply_voltage", "Supply_Voltage (V)", "%.2f"),
        rec.channel(run, "motor_temperature", "T_Motor (C)", "%.2f"),
        rec.channel(run, "temperature", "T_Housing (C)", "%.2f"),
    ]
    return rec.table(
        "Joint_Test_03.txt",
        columns,
        "\t",
        "\r\n",
        facts={"gear_ratio": 100},
    )


@_recorder
def python_ft_sensor() -> File:
    """Seconds of an epoch with jitter, an output angle that wraps at 360°, six components of a
    force/torque sensor of which Mz is the joint's axis, Iq beside Id, half of it without a unit.
    """
    run = joint_run(202, 200.0, 15.0, ratio=50.0, torque_constant=0.2, from_zero=True)
    rows = run["time"].size
    late = np.random.default_rng(202).uniform(0.0, 8e-4, rows)
    run["time"] = run["time"] + late - late[0]
    angle = run["output_position"]
    columns = [
        rec.channel(run, "time", "timestamp", "%.6f", start=1_776_161_412.331_802),
        rec.channel(run, "output_position", "EncOut_deg", "%.4f", DEG, wrap=360.0),
        rec.channel(run, "motor_position", "EncMot_deg", "%.2f", DEG),
        rec.channel(run, "motor_velocity", "MotSpeed_rpm", "%.1f", RPM),
        rec.channel(run, "motor_current", "Iq", "%.4f"),
        rec.other("Id", rec.white(2021, 0.04, rows), "%.4f"),
        rec.other("Fx", 58.0 * np.cos(angle) + rec.white(2022, 0.3, rows), "%.3f"),
        rec.other("Fy", -58.0 * np.sin(angle) + rec.white(2023, 0.3, rows), "%.3f"),
        rec.other("Fz", 2.1 + rec.white(2024, 0.3, rows), "%.3f"),
        rec.other("Mx", 0.8 * np.cos(angle) + rec.white(2025, 0.02, rows), "%.4f"),
        rec.other("My", -0.8 * np.sin(angle) + rec.white(2026, 0.02, rows), "%.4f"),
        rec.channel(run, "reference_torque", "Mz", "%.4f"),
    ]
    return rec.table(
        "log_20260414_121012.csv",
        columns,
        ",",
        facts={"gear_ratio": 50},
        ambiguous={
            "motor_current": "no unit is stated: A or mA",
            "reference_torque": "Mz of a force/torque sensor: no unit, and in the joint or beside "
            "it is not said",
        },
        wraps={"output_position": REV},
    )


@_recorder
def plc_axis() -> File:
    """Set points and following errors beside actual values, no unit but in the name of the clock,
    torque in per cent of a rated torque that the file does not give, a filtered velocity, a status
    word.
    """
    run = joint_run(203, 500.0, 8.0, ratio=100.0, motion="trapezoids")
    rows = run["time"].size
    run["output_velocity"] = rec.filtered(run["output_velocity"], 500.0, 4e-3)
    command = run["commanded_position"]
    speed = np.gradient(command, run["time"])
    columns = [
        rec.channel(run, "time", "Time_ms", "%d", 1e-3, start=412_086),
        rec.channel(run, "commanded_position", "PosSet", "%.4f", DEG),
        rec.channel(run, "output_position", "PosAct", "%.4f", DEG),
        rec.other("PosFollowErr", (command - run["output_position"]) / DEG, "%.4f"),
        rec.other("VelSet", speed / DEG, "%.3f"),
        rec.channel(run, "output_velocity", "VelAct", "%.3f", DEG),
        rec.other("VelFollowErr", (speed - run["output_velocity"]) / DEG, "%.3f"),
        rec.channel(run, "motor_torque", "TrqAct", "%.1f", 0.64e-2),
        rec.channel(run, "motor_velocity", "MotSpeed", "%.1f", RPM),
        rec.same("StatusWord", "4663", rows),
        rec.same("ErrorId", "0", rows),
    ]
    return rec.table(
        "Axis2_Trace.csv",
        columns,
        ";",
        "\r\n",
        facts={"gear_ratio": 100},
        ambiguous={
            "commanded_position": rec.NO_UNIT,
            "output_position": rec.NO_UNIT,
            "output_velocity": rec.NO_UNIT,
            "motor_velocity": rec.NO_UNIT,
            "motor_torque": "no unit; per cent of a rated torque that is not in the file",
            "gear_ratio": "speeds of both sides without a unit are known to a factor alone",
        },
    )


@_recorder
def drive_recorder() -> File:
    """The motor's side alone, counts and counts/s without a resolution, a commanded position that
    is the motor's, the drive's temperature.
    """
    run = joint_run(204, 1000.0, 4.0, ratio=100.0, pace=1.5, from_zero=True)
    rows = run["time"].size
    count = REV / 65536
    command = 100.0 * run["commanded_position"]
    command += np.mean(run["motor_position"] - command)
    columns = [
        rec.channel(run, "time", "Time [s]", "%.4f"),
        rec.other("Position Command [cnt]", command / count, "%.0f"),
        rec.channel(run, "motor_position", "Position [cnt]", "%d", count),
        rec.other("Position Error [cnt]", (command - run["motor_position"]) / count, "%.0f"),
        rec.channel(run, "motor_velocity", "Velocity [cnt/sec]", "%d", count),
        rec.channel(run, "motor_current", "Active Current [A]", "%.4f"),
        rec.channel(run, "supply_voltage", "Bus Voltage [V]", "%.2f"),
        rec.other("Drive Temperature [C]", 41.0 + rec.white(2041, 0.2, rows), "%.0f"),
    ]
    head = ["Drive recording, axis A1", "Date: 14/04/2026 16:20:05", "Sampling time: 1000 us", ""]
    return rec.table(
        "Recording 4.csv",
        columns,
        ",",
        "\r\n",
        head=head,
        ambiguous={
            "motor_position": rec.NO_RESOLUTION,
            "motor_velocity": "counts per second without a resolution",
            "commanded_position": "the motor's: that of the output needs a ratio",
            "temperature": "that of the drive's power stage, not of the joint",
            "gear_ratio": "the motor's side alone",
        },
    )


@_recorder
def matlab_workspace() -> File:
    """MAT of version 5, one vector for each quantity as a script saves them, no unit anywhere, the
    motor's encoder counts the other way while the current does not, the ratio in a structure.
    """
    run = joint_run(205, 500.0, 6.0, ratio=120.0)
    signals = {
        "t": ("time", 1.0),
        "theta_m": ("motor_position", -1.0),
        "omega_m": ("motor_velocity", -1.0),
        "theta_l": ("output_position", 1.0),
        "i_q": ("motor_current", 1.0),
        "tau_s": ("sensor_torque", 1.0),
    }
    content = io.BytesIO()
    vectors = {name: (run[channel] / unit)[:, None] for name, (channel, unit) in signals.items()}
    params = {"N": 120.0, "kt": 0.1, "J_m": 6.25e-5, "Ts": 2e-3}
    savemat(content, {**vectors, "params": params, "test_name": "sine sweep, 2 kg"})
    channels = [channel for channel, _ in signals.values()]
    return rec.of_run(
        "sine_2kg_run1.mat",
        content.getvalue(),
        run,
        dict.fromkeys(channels, 0.0),
        facts={"gear_ratio": 120},
        ambiguous=dict.fromkeys(channels[1:], rec.NO_UNIT),
    )


@_recorder
def hdf5_matrices() -> File:
    """HDF5 with one matrix for each quantity, a column for each of four joints of which JointPos[2]
    moves, units in attributes, an integer clock in µs, single precision, 101 turns.
    """
    run = joint_run(206, 500.0, 6.0, ratio=101.0, motion="trapezoids", amplitude=0.8)
    rows = run["time"].size
    matrices = {
        "JointPos": ("output_position", 1.0, "rad", (0.2, -0.9, 0.0, 1.3)),
        "JointVel": ("output_velocity", 1.0, "rad/s", (0.0, 0.0, 0.0, 0.0)),
        "JointTorque": ("sensor_torque", 1.0, "Nm", (0.4, -21.0, 0.0, 1.6)),
        "MotorPos": ("motor_position", 1.0, "rad", (18.3, -91.7, 0.0, 130.1)),
        "MotorCurrent": ("motor_current", 1.0, "A", (0.02, -2.2, 0.0, 0.15)),
        "MotorTemp": ("motor_temperature", 1.0, "degC", (29.4, 35.1, 0.0, 30.2)),
    }
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs["robot"] = "arm4"
        file.attrs["sample_rate"] = 500.0
        ticks = np.rint(run["time"] * 1e6).astype(np.int64) + 91_440_312
        file.create_dataset("Timestamp", data=ticks).attrs["unit"] = "us"
        for k, (name, (channel, unit, word, held)) in enumerate(matrices.items()):
            joints = [
                run[channel] / unit if j == 2 else rec.still(2060 + 10 * k + j, held[j], rows)
                for j in range(4)
            ]
            data = np.stack(joints, axis=1).astype(np.float32)
            file.create_dataset(name, data=data).attrs["unit"] = word
    channels = [channel for channel, _, _, _ in matrices.values()]
    return rec.of_run(
        "arm4_elbow.h5",
        buffer.getvalue(),
        run,
        {"time": 1e-6} | rec.single(run, channels),
        facts={"gear_ratio": 101},
        ambiguous={
            "sensor_torque": "a joint's torque may be measured in it or made from the current",
        },
    )


@_recorder
def arduino_monitor() -> File:
    """A monitor's time of day and an arrow before each line, a message of the sketch, a clock in ms
    of the board, mA, a load cell at the output, a first line that is cut.
    """
    run = joint_run(207, 50.0, 50.0, ratio=80.0, pace=0.8)
    columns = [
        rec.channel(run, "time", "millis", "%d", 1e-3, start=8_312),
        rec.channel(run, "output_position", "theta_deg", "%.2f", DEG),
        rec.channel(run, "motor_velocity", "motor_rpm", "%.1f", RPM),
        rec.channel(run, "motor_current", "current_mA", "%d", 1e-3),
        rec.channel(run, "reference_torque", "loadcell_Nm", "%.2f"),
        rec.channel(run, "temperature", "temp_C", "%.1f"),
    ]
    sent = ["4,-0.41,21.8", "HX711 ready", rec.headers(columns, ","), *rec.lines(columns, ",")]
    waits = np.concatenate([[0.0, 0.4, 0.41], run["time"] + 0.43])
    waits = waits + np.random.default_rng(207).uniform(0.0, 4e-3, waits.size)
    moments, _ = rec.stamps(waits, "2026-04-15T14:22:31.407", "ms")
    shown = [f"{moment[11:]} -> {line}" for moment, line in zip(moments, sent, strict=True)]
    return rec.file(
        "serial_log.txt",
        rec.text(shown, "\r\n"),
        columns,
        facts={"gear_ratio": 80},
        ambiguous={
            "time": "two clocks: that of the board, and that of the monitor, up to 4 ms later",
            "temperature": rec.WHERE,
        },
    )


# German and Italian


@_recorder
def german_messwelle() -> File:
    """German in cp1252, a short preamble, units in a row of their own, decimal comma, the torque of
    a measuring shaft, two temperatures that are numbered alone.
    """
    run = joint_run(208, 200.0, 20.0, ratio=160.0, motion="trapezoids", torque_constant=0.06)
    table = [
        (rec.channel(run, "time", "Zeit", "%.3f"), "s"),
        (rec.channel(run, "motor_velocity", "Drehzahl_Motor", "%.2f", RPM), "1/min"),
        (rec.channel(run, "output_position", "Winkel_Abtrieb", "%.4f", DEG), "°"),
        (rec.channel(run, "reference_torque", "Drehmoment_Messwelle", "%.3f"), "N·m"),
        (rec.channel(run, "motor_current", "Strom_Motor", "%.3f"), "A"),
        (rec.channel(run, "motor_temperature", "Temperatur_1", "%.1f"), "°C"),
        (rec.channel(run, "temperature", "Temperatur_2", "%.1f"), "°C"),
    ]
    columns = rec.commas([column for column, _ in table])
    return rec.table(
        "Versuch_017.csv",
        columns,
        ";",
        "\r\n",
        "cp1252",
        head=[
            "Prüfling:;Wellgetriebe Größe 25, Nr. 0417",
            "Prüfer:;Hofmann",
            "Datum:;16.04.2026 10:41",
            "",
        ],
        units=[unit for _, unit in table],
        facts={"gear_ratio": 160},
        ambiguous={
            "reference_torque": "a measuring shaft may sit at the motor or at the output",
            "motor_temperature": "two temperatures with a number for a name",
            "temperature": "two temperatures with a number for a name",
        },
    )


@_recorder
def italian_bench() -> File:
    """Italian in cp1252, decimal comma, ms, gradi and giri/min, angle, speed and current of a motor
    that runs the other way.
    """
    run = joint_run(209, 250.0, 14.0, ratio=80.0, torque_constant=0.12)
    columns = rec.commas(
        [
            rec.channel(run, "time", "Tempo (ms)", "%d", 1e-3),
            rec.channel(run, "output_position", "Angolo uscita (gradi)", "%.4f", DEG),
            rec.channel(run, "motor_position", "Angolo motore (gradi)", "%.2f", -DEG),
            rec.channel(run, "motor_velocity", "Velocità motore (giri/min)", "%.1f", -RPM),
            rec.channel(run, "motor_current", "Corrente motore (A)", "%.3f", -1.0),
            rec.channel(run, "sensor_torque", "Coppia (Nm)", "%.3f"),
            rec.channel(run, "temperature", "Temp. riduttore (°C)", "%.1f"),
        ]
    )
    return rec.table(
        "prova_giunto_2.csv",
        columns,
        ";",
        "\r\n",
        "cp1252",
        facts={"gear_ratio": 80},
        ambiguous={"sensor_torque": rec.OWN_OR_BESIDE},
    )


# English again


@_recorder
def npz_counts() -> File:
    """NumPy archive: a clock in µs, counts of both sides with their resolutions in scalars beside
    them, mA, a motor's encoder that starts at zero while the output's is absolute.
    """
    run = joint_run(210, 400.0, 10.0, ratio=100.0, motion="trapezoids", from_zero=True)
    fields = {
        "t_us": ("time", 1e-6, np.int64, 3_120_447),
        "enc_out": ("output_position", REV / 2**19, np.int32, 0),
        "enc_mot": ("motor_position", REV / 8192, np.int32, 0),
        "iq_mA": ("motor_current", 1e-3, np.int32, 0),
        "torque_sensor_Nm": ("sensor_torque", 0.0, np.float64, 0),
        "temp_housing": ("temperature", 0.0, np.float64, 0),
    }
    arrays = {
        name: (np.rint(run[channel] / step) + start if step else run[channel]).astype(kind)
        for name, (channel, step, kind, start) in fields.items()
    }
    buffer = io.BytesIO()
    np.savez(buffer, **arrays, enc_out_cpr=np.array(2**19), enc_mot_cpr=np.array(8192))
    return rec.of_run(
        "step_test_a.npz",
        buffer.getvalue(),
        run,
        {channel: step for channel, step, _, _ in fields.values()},
        facts={"gear_ratio": 100},
    )


@_recorder
def joint_controller_iso() -> File:
    """ISO stamps with ms, des, act and err of position, velocity and torque, no unit but of the
    temperature, a word for the state.
    """
    run = joint_run(211, 250.0, 16.0, ratio=160.0, torque_constant=0.06)
    rows = run["time"].size
    stamps, run["time"] = rec.stamps(run["time"], "2026-04-17T07:58:40.216", "ms")
    command = run["commanded_position"]
    speed = np.gradient(command, run["time"])
    wanted = run["reference_torque"] + rec.white(2111, 0.2, rows)
    state = ["READY"] * 25 + ["RUN"] * (rows - 25)
    columns = [
        Column("timestamp", [stamp + "Z" for stamp in stamps], "time", run["time"], 1e-3),
        rec.same("joint", "J3", rows),
        Column("state", state),
        rec.channel(run, "commanded_position", "q_des", "%.6f"),
        rec.channel(run, "output_position", "q_act", "%.6f"),
        rec.other("q_err", command - run["output_position"], "%.6f"),
        rec.other("dq_des", speed, "%.5f"),
        rec.channel(run, "output_velocity", "dq_act", "%.5f"),
        rec.other("dq_err", speed - run["output_velocity"], "%.5f"),
        rec.other("tau_des", wanted, "%.3f"),
        rec.channel(run, "sensor_torque", "tau_act", "%.3f"),
        rec.other("tau_err", wanted - run["sensor_torque"], "%.3f"),
        rec.channel(run, "motor_position", "motor_pos", "%.4f"),
        rec.channel(run, "motor_current", "motor_current", "%.3f"),
        rec.channel(run, "motor_temperature", "temp_winding_degC", "%.1f"),
    ]
    unitless = [c.channel for c in columns[3:-1] if c.channel]
    return rec.table(
        "J3_2026-04-17T0758.csv",
        columns,
        ",",
        facts={"gear_ratio": 160},
        ambiguous=dict.fromkeys(unitless, rec.NO_UNIT)
        | {
            "sensor_torque": "no unit; tau_act may be measured or made from the current",
            "gear_ratio": rec.ONE_UNIT,
        },
    )


@_recorder
def sensor_bench() -> File:
    """Remarks behind #, a clock in µs, a motor angle that wraps at 360°, the bridge in mV beside a
    reference torque, no velocity and no calibrated torque of the sensor.
    """
    run = joint_run(212, 500.0, 8.0, ratio=120.0, motion="trapezoids", torque_constant=0.15)
    run["sensor_voltage"] = 1e-3 * (0.52 * run["sensor_torque"] + 0.31)
    columns = [
        rec.channel(run, "time", "t_us", "%d", 1e-6, start=1_204_118),
        rec.channel(run, "output_position", "link_angle_deg", "%.5f", DEG),
        rec.channel(run, "motor_position", "motor_angle_deg", "%.3f", DEG, wrap=360.0),
        rec.channel(run, "motor_current", "motor_current_A", "%.4f"),
        rec.channel(run, "sensor_voltage", "bridge_mV", "%.5f", 1e-3),
        rec.channel(run, "reference_torque", "T_ref_Nm", "%.3f"),
        rec.channel(run, "temperature", "temp_sensor_C", "%.2f"),
    ]
    head = [
        "# JTS bench, gauge set B, excitation 5.0 V",
        "# gear 120:1, lever 0.60 m, 3.0 kg",
        "# 2026-04-17 15:12:48",
    ]
    return rec.table(
        "jts_B_cal4.csv",
        columns,
        ",",
        head=head,
        facts={"gear_ratio": 120},
        wraps={"motor_position": REV},
    )


UNSEEN_RECORDERS = tuple(_recorder)
"""Twelve recorders, one file each."""
