"""Twelve more files of the ordinary kind, with known truth, for a score that nothing was made on.

They are made as those of `unseen_recorders`, by another hand: exports in the manner of drives'
tools, scripts and test benches. Nothing that guesses was looked at while they were written, and
no form is copied from a program's documentation. Not part of the package.
"""

from __future__ import annotations

import io

import h5py
import numpy as np
import recorder_files as rec
from recorder_files import DEG, REV, RPM, Column, File, joint_run
from scipy.io import savemat

_recorder = rec.Recorders()


# tools of drives


@_recorder
def maxon_recorder() -> File:
    """Object names of CiA 402 with a demand beside each actual value, increments whose resolution
    and the gear's ratio stand in the preamble alone, per mille of a rated torque, motor's side.
    """
    run = joint_run(301, 1000.0, 4.0, ratio=100.0, pace=1.5, from_zero=True)
    inc = REV / 4096
    demand = 100.0 * run["commanded_position"]
    demand += np.mean(run["motor_position"] - demand)
    columns = [
        rec.channel(run, "time", "Time [ms]", "%.1f", 1e-3),
        rec.other("Position Demand Value [inc]", demand / inc, "%.0f"),
        rec.channel(run, "motor_position", "Position Actual Value [inc]", "%d", inc),
        rec.channel(run, "motor_velocity", "Velocity Actual Value [rpm]", "%d", RPM),
        rec.channel(run, "motor_current", "Current Actual Value [mA]", "%d", 1e-3),
        rec.channel(run, "motor_torque", "Torque Actual Value [per mille]", "%d", 0.46e-3),
        rec.channel(run, "supply_voltage", "Power Supply Voltage [V]", "%.1f"),
    ]
    head = [
        "Data Recorder;Node 3",
        "Encoder resolution [inc/turn];4096",
        "Motor rated torque [mNm];460",
        "Gear reduction;100/1",
        "",
    ]
    return rec.table(
        "Recorder_Node3.csv",
        columns,
        ";",
        "\r\n",
        head=head,
        facts={"gear_ratio": 100},
        ambiguous={
            "motor_position": "increments of a resolution that only the preamble gives",
            "motor_torque": rec.RATED,
            "gear_ratio": "a line of the preamble; the output's side is not in the file",
            "commanded_position": "the motor's: that of the output needs the ratio",
        },
    )


@_recorder
def kollmorgen_scope() -> File:
    """Names of a drive's variables in quotes, A rms, a motor angle that wraps at 360° beside a
    second feedback at the output, a motor that counts the other way, a command of speed.
    """
    run = joint_run(302, 500.0, 8.0, ratio=160.0, motion="trapezoids", torque_constant=0.06)
    speed = -160.0 * np.gradient(run["commanded_position"], run["time"]) / RPM
    columns = [
        rec.channel(run, "time", '"Time (ms)"', "%.3f", 1e-3),
        rec.other('"VL.CMD (rpm)"', speed, "%.3f"),
        rec.channel(run, "motor_velocity", '"VL.FB (rpm)"', "%.3f", -RPM),
        rec.channel(run, "motor_position", '"PL.FB (deg)"', "%.3f", -DEG, wrap=360.0),
        rec.channel(run, "output_position", '"FB2.P (deg)"', "%.5f", DEG),
        rec.channel(run, "motor_current", '"IL.FB (Arms)"', "%.3f", -1.0),
        rec.channel(run, "supply_voltage", '"VBUS.VALUE (V)"', "%.1f"),
    ]
    return rec.table(
        "Scope_2026-05-04.csv",
        columns,
        ",",
        "\r\n",
        facts={"gear_ratio": 160},
        ambiguous={
            "motor_current": rec.RMS_OR_AMPLITUDE,
            "output_position": "FB2 is a second feedback: at the output by its slowness alone",
        },
        wraps={"motor_position": REV},
    )


@_recorder
def odrive_script() -> File:
    """Turns and turns/s without a unit, set points beside estimates, two temperatures, an output
    encoder in degrees.
    """
    run = joint_run(303, 200.0, 12.0, ratio=50.0, torque_constant=0.2, from_zero=True)
    rows = run["time"].size
    wanted = 50.0 * np.gradient(run["commanded_position"], run["time"]) / REV
    columns = [
        rec.channel(run, "time", "time", "%.4f", start=0.0123),
        rec.channel(run, "motor_position", "pos_estimate", "%.6f", REV),
        rec.other("input_vel", wanted, "%.5f"),
        rec.channel(run, "motor_velocity", "vel_estimate", "%.5f", REV),
        rec.other("Iq_setpoint", run["motor_current"] + rec.white(303, 0.05, rows), "%.4f"),
        rec.channel(run, "motor_current", "Iq_measured", "%.4f"),
        rec.channel(run, "supply_voltage", "vbus_voltage", "%.3f"),
        rec.other("fet_temp", 36.0 + rec.white(3031, 0.2, rows), "%.2f"),
        rec.channel(run, "motor_temperature", "motor_temp", "%.2f"),
        rec.channel(run, "output_position", "output_enc_deg", "%.4f", DEG),
    ]
    return rec.table(
        "odrive_log_axis0.csv",
        columns,
        ",",
        facts={"gear_ratio": 50},
        ambiguous=dict.fromkeys(
            ("motor_position", "motor_velocity", "motor_current", "supply_voltage"), rec.NO_UNIT
        )
        | {"gear_ratio": "the motor's angle has no unit: turns are known from the maker alone"},
    )


@_recorder
def servo_tool_trace() -> File:
    """No clock but a sampling period in the preamble, a torque command in per cent, a motor's speed
    of the other sign than the link-side encoder, tabs.
    """
    run = joint_run(304, 500.0, 7.0, ratio=161.0, motion="trapezoids", torque_constant=0.06)
    columns = [
        rec.channel(run, "motor_velocity", "Feedback Speed [r/min]", "%d", -RPM),
        rec.other("Torque Command [%]", -100.0 * run["motor_torque"] / 0.32, "%.0f"),
        rec.channel(run, "motor_current", "Feedback Current [A]", "%.2f", -1.0),
        rec.channel(run, "output_position", "Link-side encoder [deg]", "%.4f", DEG),
    ]
    head = ["Waveform data", "Sampling period\t2 ms", "Reduction ratio\t161", "Points\t3500", ""]
    clock = Column("", [], "time", run["time"], 0.0)
    return rec.file(
        "wave0007.txt",
        rec.text([*head, rec.headers(columns, "\t"), *rec.lines(columns, "\t")], "\r\n"),
        [*columns, clock],
        facts={"gear_ratio": 161},
        ambiguous={"time": "no column: the sampling period is in the preamble"},
    )


@_recorder
def rexroth_oszilloskop() -> File:
    """German in cp1252, numbers of parameters before the names, decimal comma, per cent of a torque
    that is not in the file, velocity of the motor in 1/min and filtered, no angle of the motor.
    """
    run = joint_run(305, 250.0, 12.0, ratio=120.0, motion="trapezoids", torque_constant=0.08)
    run["motor_velocity"] = rec.filtered(run["motor_velocity"], 250.0, 8e-3)
    table = [
        rec.channel(run, "time", "Zeit [s]", "%.3f"),
        rec.channel(run, "commanded_position", "S-0-0047 Lagesollwert [Grad]", "%.4f", DEG),
        rec.channel(run, "output_position", "S-0-0053 Lageistwert Geber 2 [Grad]", "%.4f", DEG),
        rec.channel(run, "motor_velocity", "S-0-0040 Geschwindigkeitsistwert [1/min]", "%.2f", RPM),
        rec.channel(run, "motor_torque", "S-0-0084 Drehmomentistwert [%]", "%.1f", 0.5e-2),
        rec.channel(run, "motor_temperature", "S-0-0383 Motortemperatur [°C]", "%.1f"),
    ]
    columns = rec.commas(table)
    return rec.table(
        "Oszi_Achse1.csv",
        columns,
        ";",
        "\r\n",
        "cp1252",
        facts={"gear_ratio": 120},
        ambiguous={"motor_torque": "per cent of a rated torque that is not in the file"},
    )


# benches and scripts


@_recorder
def german_formelzeichen() -> File:
    """German symbols with units in a row of their own, torque of the drive and of the output beside
    a force cell, effective current, ambient beside motor temperature, decimal comma.
    """
    run = joint_run(306, 200.0, 15.0, ratio=160.0, torque_constant=0.06)
    rows = run["time"].size
    force = run["reference_torque"] / 0.4 + rec.white(306, 0.1, rows)
    table = [
        (rec.channel(run, "time", "t", "%.3f"), "s"),
        (rec.channel(run, "motor_position", "phi_mot", "%.2f", DEG), "°"),
        (rec.channel(run, "output_position", "phi_out", "%.4f", DEG), "°"),
        (rec.channel(run, "motor_velocity", "n_mot", "%.1f", RPM), "min-1"),
        (rec.channel(run, "motor_torque", "M_an", "%.4f"), "Nm"),
        (rec.channel(run, "reference_torque", "M_ab", "%.3f"), "Nm"),
        (rec.other("F_Zelle", force, "%.2f"), "N"),
        (rec.channel(run, "motor_current", "I_RMS", "%.3f"), "A"),
        (rec.channel(run, "supply_voltage", "U_DC", "%.2f"), "V"),
        (rec.channel(run, "motor_temperature", "T_mot", "%.1f"), "°C"),
        (rec.other("T_amb", 22.4 + rec.white(3061, 0.05, rows), "%.1f"), "°C"),
    ]
    columns = rec.commas([column for column, _ in table])
    return rec.table(
        "Messung_P4_03.asc",
        columns,
        ";",
        "\r\n",
        "cp1252",
        units=[unit for _, unit in table],
        facts={"gear_ratio": 160},
        ambiguous={
            "motor_current": rec.RMS_OR_AMPLITUDE,
            "reference_torque": rec.OWN_OR_BESIDE,
        },
    )


@_recorder
def student_short_names() -> File:
    """Three letters for a name, no unit anywhere, degrees of the output, rpm of the motor."""
    run = joint_run(307, 100.0, 30.0, ratio=80.0, pace=0.8)
    columns = [
        rec.channel(run, "time", "t", "%.2f"),
        rec.channel(run, "output_position", "ang", "%.3f", DEG),
        rec.channel(run, "motor_velocity", "spd", "%.1f", RPM),
        rec.channel(run, "motor_current", "cur", "%.3f"),
        rec.channel(run, "sensor_torque", "trq", "%.3f"),
        rec.channel(run, "temperature", "tmp", "%.1f"),
    ]
    whose = rec.NO_UNIT + ", nor on which side of the gear it is"
    return rec.table(
        "test2_final.csv",
        columns,
        ",",
        ambiguous={
            "output_position": whose,
            "motor_velocity": whose,
            "motor_current": rec.NO_UNIT,
            "sensor_torque": whose,
            "temperature": rec.WHERE,
            "gear_ratio": "angle and speed without units are known to a factor alone",
        },
    )


@_recorder
def matlab_nested() -> File:
    """MAT of version 5 with a structure in a structure, units in a structure beside it, mNm and mA,
    both angles in rad, 101 turns, the rotor's angle of the other sign.
    """
    run = joint_run(308, 400.0, 8.0, ratio=101.0, from_zero=True)
    signals = {
        "time": ("time", 1.0, "s"),
        "link_side_encoder": ("output_position", 1.0, "rad"),
        "rotor_angle": ("motor_position", -1.0, "rad"),
        "rotor_speed": ("motor_velocity", -1.0, "rad/s"),
        "iq": ("motor_current", -1e-3, "mA"),
        "joint_torque_sensor": ("sensor_torque", 1e-3, "mNm"),
    }
    data = {name: (run[channel] / unit)[:, None] for name, (channel, unit, _) in signals.items()}
    units = {name: unit for name, (_, _, unit) in signals.items()}
    content = io.BytesIO()
    savemat(content, {"log": {"data": data, "units": units, "operator": "jm"}})
    return rec.of_run(
        "log_0412.mat",
        content.getvalue(),
        run,
        {channel: 0.0 for channel, _, _ in signals.values()},
        facts={"gear_ratio": 101},
    )


@_recorder
def hdf5_frame() -> File:
    """HDF5 with one matrix of all and the names of its columns beside it, seconds of an epoch, an
    output angle in turns, a derived power that is no channel.
    """
    run = joint_run(309, 250.0, 12.0, ratio=50.0, motion="trapezoids", torque_constant=0.2)
    start = 1_777_880_000.25
    signals = {
        "timestamp_s": ("time", 1.0),
        "output_pos_rev": ("output_position", REV),
        "motor_pos_rev": ("motor_position", REV),
        "motor_current_A": ("motor_current", 1.0),
        "torque_sensor_Nm": ("sensor_torque", 1.0),
        "housing_temp_K": ("temperature", 1.0),
    }
    offsets = {"timestamp_s": start, "housing_temp_K": 273.15}
    values = [run[c] / unit + offsets.get(name, 0.0) for name, (c, unit) in signals.items()]
    values.append(run["motor_torque"] * run["motor_velocity"])
    names = [*signals, "mech_power_W"]
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        frame = file.create_group("frame")
        frame.create_dataset("values", data=np.stack(values, axis=1))
        frame.create_dataset("columns", data=np.array([name.encode() for name in names]))
    steps = {channel: 0.0 for channel, _ in signals.values()}
    return rec.of_run(
        "run_12.h5",
        buffer.getvalue(),
        run,
        steps | {"time": 2.0**-22, "temperature": 2.0**-43},
        facts={"gear_ratio": 50},
    )


@_recorder
def ros_bag_csv() -> File:
    """Topics as names, two joints of which the elbow moves and the shoulder holds, seconds of an
    epoch, an effort that is the joint's torque, no unit.
    """
    run = joint_run(310, 250.0, 12.0, ratio=100.0)
    rows = run["time"].size
    columns = [rec.channel(run, "time", "__time", "%.6f", start=1_777_966_512.481_2)]
    fields = {
        "joint_states/{}/position": ("output_position", 0.41),
        "joint_states/{}/velocity": ("output_velocity", 0.0),
        "joint_states/{}/effort": ("sensor_torque", 31.6),
        "drive_states/{}/motor_position": ("motor_position", 41.2),
        "drive_states/{}/motor_current": ("motor_current", 3.4),
    }
    for k, (form, (channel, held)) in enumerate(fields.items()):
        still = rec.still(3100 + k, held, rows)
        columns.append(rec.other("/" + form.format("shoulder_joint"), still, "%.6f"))
        columns.append(rec.channel(run, channel, "/" + form.format("elbow_joint"), "%.6f"))
    channels = [channel for channel, _ in fields.values()]
    return rec.table(
        "bag_elbow_sweep.csv",
        columns,
        ",",
        facts={"gear_ratio": 100},
        ambiguous=dict.fromkeys(channels, rec.NO_UNIT)
        | {
            "sensor_torque": "an effort may be measured or made from the current; no unit",
            "gear_ratio": rec.ONE_UNIT,
        },
    )


@_recorder
def spanish_bench() -> File:
    """Spanish in UTF-8 with a mark, time of day alone, decimal comma, grados and rpm, a torque
    sensor that reads the reaction, a remark in each row.
    """
    run = joint_run(311, 100.0, 25.0, ratio=80.0, motion="trapezoids")
    rows = run["time"].size
    stamps, run["time"] = rec.stamps(run["time"], "2026-05-06T09:14:03.120", "ms")
    clock = [stamp[11:] for stamp in stamps]
    numbers = rec.commas(
        [
            rec.channel(run, "output_position", "Ángulo de salida (grados)", "%.4f", DEG),
            rec.channel(run, "motor_position", "Ángulo del motor (grados)", "%.2f", DEG),
            rec.channel(run, "motor_velocity", "Velocidad del motor (rpm)", "%.1f", RPM),
            rec.channel(run, "motor_current", "Corriente del motor (A)", "%.3f"),
            rec.channel(run, "sensor_torque", "Sensor de par (N·m)", "%.3f", -1.0),
            rec.channel(run, "temperature", "Temperatura reductor (°C)", "%.1f"),
        ]
    )
    columns = [
        Column("Hora", clock, "time", run["time"], 1e-3),
        *numbers,
        rec.same("Observaciones", "ok", rows),
    ]
    return rec.table(
        "ensayo_reductor_80.csv",
        columns,
        ";",
        "\r\n",
        "utf-8-sig",
        facts={"gear_ratio": 80},
    )


@_recorder
def chinese_test_stand() -> File:
    """Chinese in GB18030, a number of the row before the clock in ms, units in brackets of full
    width, mA, a motor's speed and current of the other sign, no angle of the motor.
    """
    run = joint_run(312, 200.0, 14.0, ratio=120.0, torque_constant=0.08)
    rows = run["time"].size
    columns = [
        rec.other("序号", range(1, rows + 1), "%d"),
        rec.channel(run, "time", "时间（ms）", "%d", 1e-3, start=20_415),
        rec.channel(run, "output_position", "输出端角度（°）", "%.4f", DEG),
        rec.channel(run, "motor_velocity", "电机转速（rpm）", "%.1f", -RPM),
        rec.channel(run, "motor_current", "电机电流（mA）", "%d", -1e-3),
        rec.channel(run, "sensor_torque", "关节力矩传感器（N·m）", "%.3f"),
        rec.channel(run, "motor_temperature", "电机温度（℃）", "%.1f"),
    ]
    return rec.table(
        "关节测试_05.csv",
        columns,
        ",",
        "\r\n",
        "gb18030",
        facts={"gear_ratio": 120},
    )


FRESH_RECORDERS = tuple(_recorder)
"""Twelve recorders, one file each."""
