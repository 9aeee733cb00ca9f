"""Thirty files in the manner of different recorders, with known truth. Not part of the package.

Each recorder writes one short run of a joint with a strain wave gear. What it writes is what such
a recorder writes: its encoding, preamble, names, units, decimal mark, clock, and the columns that
are no channel. The truth is the run itself in SI units and with the signs of the package, before
the recorder rounded it; it is never read back from the file, but for `payload_rig`, whose file
others made. A recorder with a `source` has the form that is documented there; one without is made
up in the manner of a home-made logger.
"""

from __future__ import annotations

import io
import json
import lzma
from collections.abc import Iterable

import h5py
import measured
import numpy as np
import pandas as pd
import recorder_files as rec
from recorder_files import DEG, KELVIN, KGF_CM, LBF_IN, REV, RPM, Array, Column, File, joint_run
from scipy.io import savemat

_recorder = rec.Recorders()


# robots


@_recorder
def ur_rtde() -> File:
    """Space as separator, CRLF, six joints of which the elbow moves, no unit anywhere, model's
    torque beside it.

    Source: https://github.com/UniversalRobots/RTDE_Python_Client_Library rtde/csv_writer.py
    """
    run = joint_run(1, 500.0, 6.0, ratio=101.0, motion="trapezoids")
    rows = run["time"].size
    moving = {
        "target_q": ("commanded_position", -1.5708),
        "actual_q": ("output_position", -1.5708),
        "actual_qd": ("output_velocity", 0.0),
        "actual_current": ("motor_current", -0.8),
        "joint_temperatures": ("temperature", 28.0),
    }
    columns = [rec.channel(run, "time", "timestamp", "%r", start=1297.498)]
    for name, (channel, held) in moving.items():
        for joint in range(6):
            if joint == 2:
                columns.append(rec.channel(run, channel, f"{name}_2", "%r"))
            elif name == "target_q":
                columns.append(rec.same(f"{name}_{joint}", repr(held), rows))
            else:
                still = rec.still(joint, held, rows)
                columns.append(rec.other(f"{name}_{joint}", still.tolist(), "%r"))
    model = run["reference_torque"] + rec.white(1, 1e-3, rows)
    for joint in range(6):
        moment = model if joint == 2 else rec.still(joint, -4.63, rows)
        columns.append(rec.other(f"target_moment_{joint}", moment.tolist(), "%r"))
    columns += [rec.same("robot_mode", "7", rows), rec.same("safety_mode", "1", rows)]
    columns.append(rec.same("runtime_state", "2", rows))
    return rec.table(
        "ur10e_elbow.csv",
        columns,
        " ",
        "\r\n",
        ambiguous={
            "motor_current": "no unit is stated; that it is A is known from the interface alone",
            "sensor_torque": "target_moment is what the model asks for and no measurement",
        },
    )


@_recorder
def franka_log() -> File:
    """Names separated by ', ' and ',' in one line, 87 columns, seven joints of which the fourth
    moves, time in ms without a unit, six significant digits.

    Source: https://github.com/frankaemika/libfranka src/log.cpp
    """
    run = joint_run(2, 1000.0, 3.0, motion="sines", pace=2.0)
    rows = run["time"].size
    parts: list[list[Column]] = []

    def seven(name: str, channel: str, held: float) -> None:
        columns = []
        for joint in range(7):
            header = f"{name}[{joint}]"
            if joint == 3 and channel in run:
                columns.append(rec.channel(run, channel, header, "%.6g"))
            elif joint == 3:
                columns.append(
                    rec.other(header, np.gradient(run["commanded_position"], 1e-3), "%.6g")
                )
            else:
                columns.append(rec.other(header, rec.still(joint, held, rows), "%.6g"))
        parts.append(columns)

    seven("state.q", "output_position", -0.7853)
    seven("state.q_d", "commanded_position", -0.785398)
    seven("state.dq", "output_velocity", 0.0)
    seven("state.dq_d", "", 0.0)
    seven("state.tau_J", "sensor_torque", -2.31)
    outside = rec.white(2, 0.2, rows)
    parts.append(
        [
            rec.other(f"state.tau_ext_hat_filtered[{j}]", outside * (j + 1) / 7, "%.6g")
            for j in range(7)
        ]
    )
    for name, count in (
        ("q_d", 7),
        ("dq_d", 7),
        ("O_T_EE_d", 16),
        ("O_dP_EE_d", 6),
        ("tau_J_d", 7),
    ):
        parts.append([rec.same(f"cmd.{name}[{k}]", "0", rows) for k in range(count)])
    clock = [rec.channel(run, "time", "time", "%d", 1e-3, start=1_843_211)]
    clock.append(rec.same("success_rate", "1", rows))
    names = "time, success_rate, " + ",".join(rec.headers(columns, ", ") for columns in parts)
    columns = clock + [column for part in parts for column in part]
    return rec.file(
        "panda_joint4.csv",
        rec.text([names, *rec.lines(columns, ",")]),
        columns,
        ambiguous={"time": "no unit is stated; ms, as velocity and angle agree only so"},
    )


@_recorder
def kinova_kortex() -> File:
    """No unit in the names, an angle that wraps at 360°, seconds of an epoch, fault words.

    Source: https://github.com/Kinovarobotics/Kinova-kortex2_Gen3_G3L
    api_python/doc/markdown/references, message BaseCyclic.ActuatorFeedback
    """
    run = joint_run(3, 500.0, 8.0, motion="sines", amplitude=1.6)
    rows = run["time"].size
    counter = (np.arange(rows) + 17_405) % 65536 + (5 << 16)
    columns = [
        rec.channel(run, "time", "timestamp", "%.6f", start=1_767_188_415.25),
        rec.other("command_id", counter),
        rec.same("status_flags", "67108864", rows),
        rec.other("jitter_comm", np.random.default_rng(3).integers(1, 40, rows)),
        rec.channel(run, "output_position", "position", "%.6f", DEG, wrap=360.0),
        rec.channel(run, "output_velocity", "velocity", "%.6f", DEG),
        rec.channel(run, "sensor_torque", "torque", "%.6f"),
        rec.channel(run, "motor_current", "current_motor", "%.6f"),
        rec.channel(run, "supply_voltage", "voltage", "%.4f"),
        rec.channel(run, "motor_temperature", "temperature_motor", "%.2f"),
        rec.other("temperature_core", 41.5 + rec.white(3, 0.2, rows), "%.2f"),
        *[rec.same(n, "0", rows) for n in ("fault_bank_a", "fault_bank_b", "warning_bank_a")],
    ]
    return rec.table(
        "gen3_actuator2_feedback.csv",
        columns,
        ",",
        ambiguous={
            "sensor_torque": f"torque {rec.MOTOR_OR_SENSOR}",
            "motor_current": "no unit is stated",
        },
        wraps={"output_position": REV},
    )


@_recorder
def rostopic_echo() -> File:
    """A header that starts with %, nanoseconds of an epoch twice, names of joints in cells, uneven
    sampling.

    Source: http://wiki.ros.org/rostopic rostopic echo -p;
    http://docs.ros.org/en/fuerte/api/sensor_msgs/html/msg/JointState.html
    """
    run = joint_run(4, 125.0, 20.0)
    rows = run["time"].size
    late = np.random.default_rng(4).uniform(0.0, 2e-3, rows)
    late[0] = 0.0
    ticks = np.rint((run["time"] + late) * 1e9).astype(np.int64)
    run["time"] = (ticks - ticks[0]) * 1e-9
    stamps = [str(1_772_445_123_004_512_011 + tick) for tick in ticks.tolist()]
    names = ["elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint"]
    columns = [
        Column("%time", stamps, "time", run["time"], 1e-9),
        rec.other("field.header.seq", range(88_121, 88_121 + rows)),
        Column("field.header.stamp", stamps),
        rec.same("field.header.frame_id", "", rows),
        *[rec.same(f"field.name{j}", name, rows) for j, name in enumerate(names)],
    ]
    kinds = {"position": "output_position", "velocity": "output_velocity"}
    for kind, channel in {**kinds, "effort": "sensor_torque"}.items():
        columns.append(rec.channel(run, channel, f"field.{kind}0", "%.12g"))
        for joint in (1, 2):
            held = rec.still(joint, -1.2 if kind == "position" else 0.0, rows)
            columns.append(rec.other(f"field.{kind}{joint}", held, "%.12g"))
    return rec.table(
        "elbow_joint.csv",
        columns,
        ",",
        ambiguous={
            "sensor_torque": "effort is in Nm, but measured, commanded or made from the current",
        },
    )


@_recorder
def plotjuggler() -> File:
    """Three topics with clocks of their own in one table, so that most cells of a row are empty;
    seconds of an epoch; names sorted.

    Joint states at 250 Hz, a drive at 100 Hz that is 1.3 ms late, a temperature at 1 Hz.

    Source: https://github.com/PlotJuggler/PlotJuggler plotjuggler_plugins/PublisherCSV
    """
    run = joint_run(5, 10_000.0, 8.0, ratio=120.0, motion="trapezoids")
    ticks = np.arange(run["time"].size)
    topics = {
        "/drive/current": ("motor_current", ticks % 100 == 13),
        "/drive/position": ("motor_position", ticks % 100 == 13),
        "/drive/velocity": ("motor_velocity", ticks % 100 == 13),
        "/joint_states/elbow/effort": ("sensor_torque", ticks % 40 == 0),
        "/joint_states/elbow/position": ("output_position", ticks % 40 == 0),
        "/joint_states/elbow/velocity": ("output_velocity", ticks % 40 == 0),
        "/thermometer/data": ("temperature", ticks % 10_000 == 27),
    }
    there = np.flatnonzero(np.any([when for _, when in topics.values()], axis=0))
    time = run["time"][there]
    clock = rec.channel({"time": time}, "time", "__time", "%.6f", start=1_770_000_123.5)
    columns = [clock]
    for header, (channel, when) in topics.items():
        cells = [f"{x:.9f}" if w else "" for x, w in zip(run[channel], when, strict=True)]
        truth = np.where(when, run[channel], np.nan)[there]
        columns.append(Column(header, [cells[k] for k in there], channel, truth, 1e-9))
    return rec.table(
        "plotjuggler_export.csv",
        columns,
        ",",
        facts={"gear_ratio": 120},
        ambiguous={"sensor_torque": "effort may be measured, commanded or made from the current"},
    )


@_recorder
def moteus() -> File:
    """Turns without a unit, coarse torque and current, the sides told apart by physics alone, mode
    words.

    Source: https://github.com/mjbots/moteus lib/python/moteus/moteus.py (registers; INT16 and F32)
    """
    run = joint_run(6, 250.0, 12.0, ratio=50.0, amplitude=1.3)
    rows = run["time"].size
    columns = [
        rec.channel(run, "time", "time", "%.6f"),
        rec.same("mode", "10", rows),
        rec.channel(run, "motor_position", "position", "%.9g", REV),
        rec.channel(run, "motor_velocity", "velocity", "%.9g", REV),
        rec.channel(run, "motor_torque", "torque", "%.2f"),
        rec.channel(run, "motor_current", "q_current", "%.1f"),
        rec.other("d_current", np.rint(rec.white(6, 0.06, rows) * 10) / 10 + 0.0, "%.1f"),
        rec.channel(run, "supply_voltage", "voltage", "%.1f"),
        rec.channel(run, "motor_temperature", "temperature", "%.1f"),
        rec.channel(run, "output_position", "encoder_1_position", "%.9g", REV),
        rec.same("fault", "0", rows),
    ]
    turns = "no unit is stated: that they are turns stands in the controller's manual"
    return rec.table(
        "moteus_id1.csv",
        columns,
        ",",
        facts={"gear_ratio": 50},
        ambiguous={
            "motor_torque": "torque may be that of the motor or that of the output",
            "motor_current": "no unit is stated",
            "motor_temperature": "temperature may be that of the board, the motor or the joint",
            "motor_position": turns,
            "motor_velocity": turns,
            "output_position": turns,
        },
    )


@_recorder
def dynamixel_raw() -> File:
    """Raw ticks of everything, a clock of 1 ms that starts again at 32768, no unit anywhere.

    Source: http://emanual.robotis.com/docs/en/dxl/x/xm430-w210/ (control table and its units)
    """
    run = joint_run(7, 50.0, 40.0, amplitude=1.2, torque_constant=0.3)
    rows = run["time"].size
    tick = REV / 4096.0
    for channel in ("output_position", "commanded_position"):  # 2048 ticks are the middle
        run[channel] += 2048 * tick
    run["supply_voltage"] -= 36.0  # 12 V
    columns = [
        rec.same("ID", "3", rows),
        rec.same("Torque Enable", "1", rows),
        rec.channel(run, "time", "Realtime Tick", "%d", 1e-3, start=20_117, wrap=32_768),
        rec.other("Moving", (np.abs(run["output_velocity"]) > 0.05).astype(int)),
        rec.channel(run, "duty", "Present PWM", "%d", 1.0 / 885.0),
        rec.channel(run, "motor_current", "Present Current", "%d", 2.69e-3),
        rec.channel(run, "output_velocity", "Present Velocity", "%d", 0.229 * RPM),
        rec.channel(run, "output_position", "Present Position", "%d", tick),
        rec.channel(run, "commanded_position", "Goal Position", "%d", tick),
        rec.channel(run, "supply_voltage", "Present Input Voltage", "%d", 0.1),
        rec.channel(run, "temperature", "Present Temperature", "%d"),
    ]
    return rec.table(
        "dxl_id3.csv",
        columns,
        ",",
        ambiguous={
            column.channel: "raw ticks: what one is worth stands in the servo's manual alone"
            for column in columns
            if column.channel and column.channel != "temperature"
        },
        wraps={"time": 32.768},
    )


@_recorder
def vesc_tool() -> File:
    """56 columns, a separator at the end of each line, ms of the day twice, electrical rpm, an
    angle in degrees that wraps.

    Source: https://gist.github.com/dsoto/c513a73215ccc81916f262f24c14b5f5 (log of VESC Tool)
    """
    run = joint_run(8, 50.0, 40.0, ratio=50.0, amplitude=0.8, motion="sines")
    rows = run["time"].size
    poles = 7
    turned = run["motor_position"] / REV * 6 * poles
    zero = "0"
    by_name = {
        "ms_today": rec.channel(run, "time", "", "%d", 1e-3, start=50_069_026),
        "input_voltage": rec.channel(run, "supply_voltage", "", "%.1f"),
        "temp_mos_max": rec.other("", 31.0 + rec.white(8, 0.1, rows), "%.1f"),
        "temp_motor": rec.channel(run, "motor_temperature", "", "%.1f"),
        "q_axis_current": rec.channel(run, "motor_current", "", "%.2f"),
        "current_motor": rec.other("", np.abs(run["motor_current"]), "%.2f"),
        "current_in": rec.other("", run["motor_current"] * run["duty"], "%.2f"),
        "d_axis_current": rec.other("", rec.white(8, 0.03, rows), "%.2f"),
        "erpm": rec.channel(run, "motor_velocity", "", "%d", RPM / poles),
        "duty_cycle": rec.channel(run, "duty", "", "%.3f"),
        "tachometer": rec.other("", np.rint(turned - turned[0]).astype(int)),
        "tachometer_abs": rec.other(
            "", np.cumsum(np.abs(np.diff(turned, prepend=turned[0]))), "%d"
        ),
        "encoder_position": rec.channel(run, "motor_position", "", "%.1f", DEG, wrap=360.0),
        "vesc_id": rec.same("", "1", rows),
        "ms_today_setup": rec.other("", np.rint(50_068_946 + 1e3 * run["time"]), "%d"),
        "amp_hours_used": rec.same("", "0.3098", rows),
        "battery_level": rec.same("", "0.709", rows),
        "num_vescs": rec.same("", "1", rows),
        "gnss_posTime": rec.same("", "-1", rows),
    }
    header = (
        "ms_today;input_voltage;temp_mos_max;temp_mos_1;temp_mos_2;temp_mos_3;temp_motor;"
        "current_motor;current_in;d_axis_current;q_axis_current;erpm;duty_cycle;amp_hours_used;"
        "amp_hours_charged;watt_hours_used;watt_hours_charged;tachometer;tachometer_abs;"
        "encoder_position;fault_code;vesc_id;d_axis_voltage;q_axis_voltage;ms_today_setup;"
        "amp_hours_setup;amp_hours_charged_setup;watt_hours_setup;watt_hours_charged_setup;"
        "battery_level;battery_wh_tot;current_in_setup;current_motor_setup;speed_meters_per_sec;"
        "tacho_meters;tacho_abs_meters;num_vescs;ms_today_imu;roll;pitch;yaw;accX;accY;accZ;gyroX;"
        "gyroY;gyroZ;gnss_posTime;gnss_lat;gnss_lon;gnss_alt;gnss_gVel;gnss_vVel;gnss_hAcc;"
        "gnss_vAcc;"
    )
    columns = [by_name.get(name) or rec.same("", zero, rows) for name in header[:-1].split(";")]
    return rec.file(
        "vesc_2026-02-11_13-54-29.csv",
        rec.text([header, *rec.lines(columns, ";", ";")]),
        columns,
        facts={"pole_pairs": poles},
        ambiguous={
            "motor_velocity": "erpm are electrical: the pole pairs follow from the angle alone",
        },
        wraps={"motor_position": REV},
    )


@_recorder
def insight_arm() -> File:
    """Names and cells padded with spaces, four joints numbered in the names, two angle sensors a
    joint, slow and uneven sampling, -99999 for nothing, hours beside seconds.

    Source:
    https://pds.nasa.gov/data/pds4/test-data/registry/urn-nasa-pds-insight_ida/data_raw_calibrated/A0087_0243_618085132_618085132_190802185339_eu.csv
    """
    run = joint_run(9, 2.5, 800.0, ratio=160.0, pace=0.02, amplitude=1.2)
    rows = run["time"].size
    run["time"] = run["time"] + np.random.default_rng(9).uniform(0.0, 0.03, rows)
    run["time"] -= run["time"][0]
    run["time"] = np.round(run["time"], 4)
    columns = [rec.channel(run, "time", "time(s)       ", "%.4f", start=618_085_129.5458)]
    columns.append(rec.other("elapsed_time(hr)", run["time"] / 3600.0, "%-16.4f"))

    def four(name: str, unit: str, moving: Column | Array, held: float, noise: float) -> None:
        for joint in (1, 2, 3, 4):
            header = f"{name}{joint}({unit})"
            if joint == 2 and isinstance(moving, Column):
                columns.append(
                    Column(header, moving.cells, moving.channel, moving.truth, moving.step)
                )
            else:
                values = moving if joint == 2 else held + rec.white(joint, noise, rows)
                columns.append(rec.other(header, values, "%8.4f"))

    four("enc", "rad", rec.channel(run, "output_position", "", "%8.4f"), -0.676, 1e-5)
    four("pot", "rad", run["output_position"] + 3e-3 + rec.white(9, 1e-3, rows), -0.673, 1e-3)
    four("tcase", "C", rec.channel(run, "temperature", "", "%8.4f"), 13.9, 0.02)
    four("trotor", "C", rec.channel(run, "motor_temperature", "", "%8.4f"), 14.2, 0.02)
    columns.append(rec.other("tgrapple(C)", -62.7 + rec.white(9, 0.1, rows), "%8.4f"))
    four("cur", "mA", rec.channel(run, "motor_current", "", "%9.4f", 1e-3), -0.3214, 0.1)
    four("volt", "V", np.full(rows, 24.0), 0.0, 0.0)
    columns += [rec.same("stat", "   50", rows), rec.same("tool", "    2", rows)]
    for kind in ("enc", "pot", "enc_defl", "pot_defl"):
        columns += [
            rec.other(f"{axis}_{kind}({unit})", 0.8 + rec.white(9, 1e-3, rows), "%8.4f")
            for axis, unit in (("x", "m"), ("y", "m"), ("z", "m"), ("th", "m"))
        ]
    four("v", "rad/s", rec.channel(run, "output_velocity", "", "%8.4f"), 0.0, 0.0)
    four("tau", "N-m", rec.channel(run, "sensor_torque", "", "%8.4f"), 0.0, 0.0)
    columns += [rec.same(f"F{a}(N)      ", "-99999.0000", rows) for a in "rtz"]
    columns += [rec.same("htr_cur(mA)", "  0.0000    ", rows), rec.same("grapple_phase", "1", rows)]
    return rec.table(
        "arm_joint2_eu.csv",
        columns,
        ", ",
        ambiguous={"sensor_torque": "tau may be measured or made from the current"},
    )


# laboratory recorders


@_recorder
def twincat_scope() -> File:
    """Twenty lines of preamble with a pair of cells for each channel, a time column for each
    channel, one of them slower and so shorter, decimal comma, units in a row, EOF at the end.

    Source: https://github.com/CagtayFabry/pytcs tests/data/tc3_scope_3_4_3145_3-default.csv;
    https://infosys.beckhoff.com/content/1031/te13xx_tc3_scopeview/6193063051.html
    """
    run = joint_run(10, 1000.0, 3.0, motion="trapezoids", from_zero=True)
    rows = run["time"].size
    clock = rec.channel(run, "time", "", "%d", 1e-3)
    table = [  # column, symbol, type, bytes, unit
        (rec.channel(run, "output_position", "ActPosLoad", "%.7g", DEG), "REAL64", 8, "° (Angle)"),
        (rec.channel(run, "motor_position", "ActPosMotor", "%.7g", DEG), "REAL64", 8, "° (Angle)"),
        (
            rec.channel(run, "output_velocity", "ActVeloLoad", "%.7g", DEG),
            "REAL64",
            8,
            "°/s (Velocity)",
        ),
        (rec.channel(run, "motor_current", "ActCurrent", "%d", 1e-3), "INT16", 2, "mA (Current)"),
        (rec.channel(run, "sensor_torque", "TorqueSensor", "%.6g"), "REAL32", 4, "Nm (Torque)"),
        (rec.same("StatusWord", "4663", rows), "UINT16", 2, "(None)"),
    ]
    slow = [f"{x:.1f}" for x in run["temperature"][::10]] + [""] * (rows - rows // 10)
    ticks = [f"{10 * k}" for k in range(rows // 10)] + [""] * (rows - rows // 10)
    table.append((Column("Temperature", slow), "REAL32", 4, "°C (Temperature)"))
    clocks = [clock] + [Column("", clock.cells)] * (len(table) - 2) + [Column("", ticks)]
    columns = rec.commas(
        [c for pair in zip(clocks, (t[0] for t in table), strict=True) for c in pair]
    )

    def row(key: str, values: Iterable[object]) -> str:
        return "\t".join(f"{key}\t{value}" for value in values).rstrip("\t")

    names = [t[0].header for t in table]
    count = len(table)
    preamble = [
        "Name\tJoint2_Axis",
        "File\tC:\\Messungen\\Joint2_Axis.csv",
        "Starttime of export\t134145177843760000\tMontag, 2. Februar 2026\t15:56:24.376",
        "Endtime of export\t134145177873750000\tMontag, 2. Februar 2026\t15:56:27.375",
        "",
        "",
        row("Name", names),
        row("SymbolComment", [""] * count),
        row("Data-Type", [t[1] for t in table]),
        row("SampleTime[ms]", [1] * (count - 1) + [10]),
        row("VariableSize", [t[2] for t in table]),
        row("SymbolBased", ["True"] * count),
        row("IndexGroup", [16448] * count),
        row("IndexOffset", range(385_000, 385_000 + 8 * count, 8)),
        row("SymbolName", [f"MAIN.fb{name}" for name in names]),
        row("NetID", ["192.168.178.20.1.1"] * count),
        row("Port", [851] * count),
        row("Offset", [0] * count),
        row("ScaleFactor", [1] * count),
        row("BitMask", ["0xffffffffffffffff"] * count),
        row("Unit", [t[3] for t in table]),
        row("Unit ScaleFactor", [1] * count),
        row("Unit Offset", [0] * count),
        "",
    ]
    return rec.file(
        "Joint2_Axis.csv",
        rec.text([*preamble, *rec.lines(columns, "\t"), "EOF"], "\r\n"),
        columns,
        facts={"gear_ratio": 100},
        ambiguous={"temperature": "it has a clock of its own: its row k is not that of the others"},
    )


@_recorder
def labview_lvm() -> File:
    """Two headers that end in ***End_of_Header***, units in a tag of the second, an empty column
    Comment, tabs at the ends, CRLF.

    Source:
    https://ni.com/en/support/documentation/supplemental/06/specification-for-the-labview-measurement-file---lvm-.html
    """
    run = joint_run(11, 200.0, 15.0, ratio=80.0)
    columns = [
        rec.channel(run, "time", "X_Value", "%.6f"),
        rec.channel(run, "output_position", "Output Angle", "%.6f", DEG),
        rec.channel(run, "motor_velocity", "Motor Speed", "%.6f", RPM),
        rec.channel(run, "sensor_torque", "Torque Sensor", "%.6f"),
        rec.channel(run, "motor_current", "Motor Current", "%.6f"),
        rec.channel(run, "temperature", "Temperature", "%.6f"),
    ]
    count, rows = len(columns) - 1, run["time"].size

    def tag(name: str, value: str) -> str:
        return "\t".join([name, *[value] * count]) + "\t"

    head = [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Separator\tTab",
        "Decimal_Separator\t.",
        "Multi_Headings\tNo",
        "X_Columns\tOne",
        "Time_Pref\tRelative",
        "Operator\tlab3",
        "Date\t2026/01/19",
        "Time\t17:18:18.938945770263671875",
        "***End_of_Header***\t",
        "\t",
        f"Channels\t{count}\t" + "\t" * count,
        tag("Samples", str(rows)),
        tag("Date", "2026/01/19"),
        tag("Time", "17:18:18.938945770263671875"),
        "\t".join(["Y_Unit_Label", "deg", "rpm", "Nm", "A", "degC"]) + "\t",
        tag("X_Dimension", "Time"),
        tag("X0", "0.0000000000000000E+0"),
        tag("Delta_X", "0.005000"),
        "***End_of_Header***\t" + "\t" * count,
        rec.headers(columns, "\t") + "\tComment",
    ]
    return rec.file(
        "joint_80.lvm",
        rec.text([*head, *rec.lines(columns, "\t")], "\r\n"),
        columns,
        facts={"gear_ratio": 80},
    )


@_recorder
def catman_ascii() -> File:
    """Two time columns with long names, Latin-1, decimal comma, a tab at the end of each line, kNm.

    Source: HBM catman, export as ASCII: 'Zeit  1 - Standardmessrate [s]' and units in brackets,
    tabs, decimal comma, as public programs read it
    """
    run = joint_run(12, 300.0, 10.0)
    rows = run["time"].size
    columns = rec.commas(
        [
            rec.channel(run, "time", "Zeit  1 - Standardmessrate [s]", "%.5f"),
            rec.channel(run, "output_position", "Winkel_Abtrieb [°]", "%.4f", DEG),
            rec.channel(run, "reference_torque", "T40B_Drehmoment [kNm]", "%.7f", 1e3),
            rec.other("DMS_Brücke [mV/V]", run["sensor_torque"] / 40.0, "%.6f"),
            rec.channel(run, "motor_current", "Strom_Motor [A]", "%.4f"),
            rec.channel(run, "temperature", "PT100_Gehäuse [°C]", "%.2f"),
            rec.other("Zeit  2 - Langsame Messrate [s]", np.floor(run["time"]), "%.5f"),
            rec.same("Kommentar", "", rows),
        ]
    )
    return rec.file(
        "Gelenk_A3_Drehmoment.asc",
        rec.text(
            [rec.headers(columns, "\t", "\t"), *rec.lines(columns, "\t", "\t")], "\r\n", "latin-1"
        ),
        columns,
        ambiguous={
            "sensor_voltage": "mV/V: volts are known with the bridge's supply alone",
        },
    )


@_recorder
def hioki_memory() -> File:
    """A preamble of quoted tags, names and units in rows of the preamble, five digits, so that the
    times of later rows are uneven, logic inputs.

    Source: https://manualshive.com/ru/manual/hioki/8807-01/2137496?page=286 (text file, internal
    format)
    """
    run = joint_run(13, 400.0, 12.5, motion="sines")
    rows = run["time"].size
    columns = [
        rec.channel(run, "time", "TIME", "%+.4E"),
        rec.channel(run, "output_position", "ANGLE", "%+.4E", DEG),
        rec.channel(run, "motor_velocity", "SPEED", "%+.4E", RPM),
        rec.channel(run, "motor_current", "CURRENT", "%+.4E"),
        rec.channel(run, "reference_torque", "TORQUE", "%+.4E"),
        *[rec.same(f"LCHA{k}", "1" if k < 3 else "0", rows) for k in (1, 2, 3, 4)],
    ]
    head = [
        '"COMMENT", "JOINT RIG"',
        '"DATE", "03-05-2026"',
        '"TIME", "15:26:55"',
        f'"NUM_SIGS", {len(columns)}',
        '"INTERVAL", 2.500E-03',
        '"HORZ_UNITS", "S"',
        '"VERT_UNITS", "S", "deg", "r/min", "A", "Nm", "Bit", "Bit", "Bit", "Bit"',
        '"SIGNAL", ' + ", ".join(f'"{c.header}"' for c in columns),
        '"DATA"',
    ]
    return rec.file(
        "AUTO0003.TXT",
        rec.text([*head, *rec.lines(columns, ", ")], "\r\n"),
        columns,
        facts={"gear_ratio": 100},
        ambiguous={"reference_torque": rec.OWN_OR_BESIDE},
    )


@_recorder
def tektronix_mdo() -> File:
    """Twenty lines of preamble with settings of each channel, time that starts below zero, volts
    instead of quantities, 8 bits, names in the row Label.

    Source: Tektronix MDO3000 and MDO4000, Save Waveform as CSV: the header of a MDO3014 and a
    MDO4014B-3 as public readers quote it (Model, Firmware Version, Waveform Type to Label and
    TIME,CH1)
    """
    run = joint_run(14, 250.0, 16.0, motion="trapezoids")
    rows = run["time"].size
    run["sensor_voltage"] = run["sensor_torque"] * 0.05  # an amplifier of the bridge
    scales = {"motor_current": 2.0, "sensor_voltage": 0.5, "motor_velocity": 2.0}  # per division
    per_volt = 300.0 * RPM  # of the tachometer: not in the file

    def bits(channel: str, unit: float = 1.0) -> list[str]:
        step = 10.0 * scales[channel] / 250.0
        return ["%.5g" % (round(x / unit / step) * step) for x in run[channel].tolist()]

    columns = [
        rec.channel(run, "time", "TIME", "%.7e", start=-2.0),
        Column("CH1", bits("motor_current"), "motor_current", run["motor_current"], 0.08),
        Column("CH2", bits("sensor_voltage"), "sensor_voltage", run["sensor_voltage"], 0.02),
        Column("CH3", bits("motor_velocity", per_volt)),
    ]
    head = [
        "Model,MDO4034C",
        "Firmware Version,3.22",
        "",
        "Waveform Type,ANALOG,,",
        "Point Format,Y,,",
        "Horizontal Units,s,,",
        "Horizontal Scale,1.6,,",
        "Horizontal Delay,6,,",
        "Sample Interval,0.004,,",
        f"Record Length,{rows},,",
        "Gating,0.0% to 100.0%,,",
        "Probe Attenuation,1,10,10",
        "Vertical Units,A,V,V",
        "Vertical Offset,0,0,0",
        "Vertical Scale," + ",".join(f"{s:g}" for s in scales.values()),
        "Vertical Position,0,-0.5,1.2",
        ",,,",
        ",,,",
        ",,,",
        "Label,I MOTOR,TORQUE BRIDGE,TACHO",
    ]
    return rec.table(
        "tek0007ALL.csv",
        columns,
        ",",
        "\r\n",
        head=head,
        ambiguous={
            "sensor_voltage": "volts of a bridge: how many Nm one is, is not in the file",
            "motor_velocity": "volts of a tachometer: how many rad/s one is, is not in the file",
        },
    )


@_recorder
def etas_inca() -> File:
    """Five rows before the data: kind, count, names with a device behind a backslash, types, units.

    Source: ETAS INCA and MDA, ASCII export: 'ETASAsciiItemFile record CrLf Tab', sampleCount,
    names, types, units in quotes, as public programs write it
    """
    run = joint_run(15, 200.0, 12.0, ratio=100.0)
    rows = run["time"].size
    table = [
        (rec.channel(run, "time", "time", "%.6f"), "s"),
        (rec.channel(run, "output_position", r"phiAbtr_w\XETK:1", "%.5f", DEG), "deg"),
        (rec.channel(run, "motor_velocity", r"nMot_w\XETK:1", "%.4f", RPM), "rpm"),
        (rec.channel(run, "motor_current", r"iqMot_w\XETK:1", "%.5f"), "A"),
        (rec.channel(run, "motor_torque", r"trqMot_w\XETK:1", "%.6f"), "Nm"),
        (rec.channel(run, "sensor_torque", r"trqSens_w\XETK:1", "%.5f"), "Nm"),
        (rec.channel(run, "motor_temperature", r"tMot\XETK:1", "%.2f"), "degC"),
        (rec.same(r"B_Enable\XETK:1", "1", rows), "-"),
    ]
    columns = [column for column, _ in table]
    head = [
        "ETASAsciiItemFile\trecord\tCrLf\tTab",
        f"sampleCount\t{rows:<15}",
        rec.headers(columns, "\t", "\t"),
        "f8\t" * len(columns),
        "".join(f'"{unit}"\t' for _, unit in table),
    ]
    return rec.file(
        "measure_joint.ascii",
        rec.text([*head, *rec.lines(columns, "\t", "\t")], "\r\n"),
        columns,
        facts={"gear_ratio": 100},
    )


@_recorder
def epos_studio() -> File:
    """Counts with their resolution in a preamble, torque in per mille of a rated torque that stands
    there, status words in hex.
    """
    run = joint_run(16, 500.0, 5.0, motion="trapezoids", from_zero=True)
    rows = run["time"].size
    columns = [
        rec.channel(run, "time", "Time [ms]", "%.1f", 1e-3),
        rec.channel(run, "motor_position", "Position actual value [inc]", "%d", REV / 4096),
        rec.channel(run, "motor_velocity", "Velocity actual value [rpm]", "%d", RPM),
        rec.channel(run, "motor_current", "Current actual value averaged [mA]", "%d", 1e-3),
        rec.channel(run, "motor_torque", "Torque actual value [per mille]", "%d", 0.512e-3),
        rec.channel(run, "output_position", "SSI encoder position [inc]", "%d", REV / 2**18),
        rec.same("Statusword", "0x1637", rows),
        rec.other("Following error [inc]", np.rint(rec.white(16, 6.0, rows)), "%d"),
    ]
    head = [
        "EPOS Studio data recorder",
        "Node;1",
        "Motor rated torque;512000;uNm",
        "Torque constant;100.0;mNm/A",
        "Digital incremental encoder 1 number of pulses;1024;ppr",
        "SSI encoder resolution;262144;inc/turn",
        "Sampling period;2;ms",
        "",
    ]
    return rec.table(
        "recorder_01.csv",
        columns,
        ";",
        "\r\n",
        head=head,
        facts={"gear_ratio": 100, "torque_constant": 0.1},
        ambiguous={
            "motor_torque": rec.RATED,
            "motor_position": "counts: 4 × 1024 a turn, and the preamble gives the pulses alone",
        },
    )


@_recorder
def excel_german() -> File:
    """Cp1252 with umlauts and °, time of day over midnight, decimal comma, words for booleans, a
    motor that counts the other way, remarks in a last column.
    """
    run = joint_run(17, 100.0, 24.0, motion="trapezoids")
    rows = run["time"].size
    ms = np.rint(1e3 * (run["time"] + 86_390.0)).astype(int) % 86_400_000
    clock = [
        f"{t // 3_600_000:02}:{t // 60_000 % 60:02}:{t // 1000 % 60:02}.{t % 1000:03}"
        for t in ms.tolist()
    ]
    remarks = [""] * rows
    remarks[0], remarks[rows // 2] = "Start", "Stoß von außen?"
    columns = rec.commas(
        [
            Column("Uhrzeit", clock, "time", run["time"], 1e-3),
            rec.channel(run, "output_position", "Winkel Abtrieb (°)", "%.4f", DEG),
            rec.channel(run, "motor_position", "Winkel Motor (°)", "%.1f", -DEG),
            rec.channel(run, "motor_velocity", "Drehzahl Motor (1/min)", "%.1f", -RPM),
            rec.channel(run, "motor_current", "Motorstrom (A)", "%.3f", -1.0),
            rec.channel(run, "sensor_torque", "Drehmoment (Nm)", "%.2f"),
            rec.channel(run, "temperature", "Temperatur Gehäuse (°C)", "%.1f"),
            rec.channel(run, "commanded_position", "Sollwinkel (°)", "%.4f", DEG),
            rec.same("Freigabe", "WAHR", rows),
            Column("Bemerkung", remarks),
        ]
    )
    return rec.table(
        "Prüfstand Gelenk 2.csv",
        columns,
        ";",
        "\r\n",
        "cp1252",
        facts={"gear_ratio": 100},
        ambiguous={"sensor_torque": rec.OWN_OR_BESIDE},
        wraps={"time": 86_400.0},
    )


@_recorder
def excel_unicode_text() -> File:
    """UTF-16 with a byte order mark, tabs, days since 1899 as time, lbf·in and °F, quotes round a
    name with a comma, two rows of a person's sums at the end.
    """
    run = joint_run(18, 100.0, 25.0, ratio=120.0)
    fahrenheit = 5.0 / 9.0
    columns = [
        rec.channel(run, "time", "Timestamp", "%.10f", 86_400.0, start=46_063.614_583_333_3),
        rec.channel(run, "output_position", "Output angle (deg)", "%.4f", DEG),
        rec.channel(run, "output_velocity", "Output speed (rpm)", "%.4f", RPM),
        rec.channel(run, "motor_velocity", "Motor speed (rpm)", "%.2f", RPM),
        rec.channel(run, "reference_torque", '"Torque, load cell (lbf·in)"', "%.3f", LBF_IN),
        rec.channel(run, "motor_current", "Motor current (A)", "%.4f"),
        rec.channel(run, "temperature", "Housing temp (°F)", "%.2f", fahrenheit, zero=-160.0 / 9.0),
    ]
    foot = ["", "Max" + "\t99.9" * (len(columns) - 1), "Min" + "\t-99.9" * (len(columns) - 1)]
    lines = [rec.headers(columns, "\t"), *rec.lines(columns, "\t"), *foot]
    return rec.file(
        "rig export.txt",
        b"\xff\xfe" + rec.text(lines, "\r\n", "utf-16-le"),
        columns,
        facts={"gear_ratio": 120},
    )


@_recorder
def excel_sep_line() -> File:
    """A first line sep=; after a byte order mark, units behind a slash, K, signs of another motor,
    a separator at the end of each line.
    """
    run = joint_run(19, 250.0, 12.0, ratio=80.0, motion="trapezoids")
    rows = run["time"].size
    columns = rec.commas(
        [
            rec.channel(run, "time", "t/ms", "%.1f", 1e-3, start=120.0),
            rec.channel(run, "output_position", "phi_ab/°", "%.5f", DEG),
            rec.channel(run, "motor_velocity", "n_mot/rpm", "%.2f", -RPM),
            rec.channel(run, "motor_current", "I_q/mA", "%.1f", -1e-3),
            rec.other("I_d/mA", rec.white(19, 40.0, rows), "%.1f"),
            rec.channel(run, "sensor_torque", "M_sens/Nm", "%.3f"),
            rec.channel(run, "temperature", "T_geh/K", "%.2f", zero=KELVIN),
            rec.channel(run, "supply_voltage", "U_zk/V", "%.2f"),
            rec.same("Fehler", "0", rows),
        ]
    )
    lines = ["sep=;", rec.headers(columns, ";", ";"), *rec.lines(columns, ";", ";")]
    return rec.file(
        "gelenk_80_lauf3.csv",
        rec.text(lines, "\r\n", "utf-8-sig"),
        columns,
        facts={"gear_ratio": 80},
    )


@_recorder
def japanese_logger() -> File:
    """Cp932, Japanese names, units in a row of their own, kgf·cm, ℃ as one sign, date and time in
    two columns.
    """
    run = joint_run(20, 100.0, 25.0, ratio=50.0)
    rows = run["time"].size
    ms = np.rint(1e3 * run["time"]).astype(int) + 9 * 3_600_000 + 12 * 60_000 + 3_000
    clock = [
        f"{t // 3_600_000:02}:{t // 60_000 % 60:02}:{t // 1000 % 60:02}.{t % 1000:03}"
        for t in ms.tolist()
    ]
    table = [
        (rec.same("日付", "2026/04/07", rows), ""),
        (Column("時刻", clock, "time", run["time"], 1e-3), ""),
        (rec.channel(run, "output_position", "出力軸角度", "%.4f", DEG), "deg"),
        (rec.channel(run, "motor_velocity", "モータ回転数", "%.1f", RPM), "min-1"),
        (rec.channel(run, "motor_current", "モータ電流", "%.3f"), "A"),
        (rec.channel(run, "reference_torque", "負荷トルク", "%.2f", KGF_CM), "kgf・cm"),
        (rec.channel(run, "temperature", "温度", "%.1f"), "℃"),
        (rec.same("アラーム", "0", rows), ""),
    ]
    return rec.table(
        "shiken_0407.csv",
        [column for column, _ in table],
        ",",
        "\r\n",
        "cp932",
        head=["機種,波動歯車減速機 試験機", "試料,減速比50", f"データ数,{rows}", ""],
        units=[unit for _, unit in table],
        facts={"gear_ratio": 50},
    )


@_recorder
def arduino_serial() -> File:
    """No header, the first line begun in its middle, the last cut off, a greeting between, counts,
    µs since the board was switched on.
    """
    run = joint_run(21, 100.0, 30.0, ratio=100.0, amplitude=0.7)
    rows = run["time"].size
    run["time"] = np.round(run["time"] + np.random.default_rng(21).uniform(0, 8e-5, rows), 6)
    run["time"] -= run["time"][0]
    columns = [
        rec.channel(run, "time", "", "%d", 1e-6, start=2_104_388),
        rec.channel(run, "motor_position", "", "%d", REV / 2000),
        rec.channel(run, "output_position", "", "%d", REV / 16384),
        rec.other("", np.rint(512 + 18 * run["motor_current"]), "%d"),
        rec.other("", np.rint(255 * run["duty"]), "%d"),
    ]
    lines = rec.lines(columns, ",")
    broken = ["88,-31407,-2571,512,0", "joint rig v2 ready", *lines]
    unknown = "no name and no unit: numbers alone"
    return rec.file(
        "putty.log",
        (rec.text(broken, "\r\n") + lines[-1][:9].encode()),
        columns,
        ambiguous={
            "time": "no name; µs, as a loop of 10 ms is likelier than one of 10 s",
            "motor_position": unknown + "; counts of which only the gear's ratio is seen",
            "output_position": unknown + "; counts of which only the gear's ratio is seen",
            "motor_current": unknown + "; the raw value of a converter",
            "gear_ratio": rec.TO_A_FACTOR,
        },
    )


@_recorder
def pandas_iso() -> File:
    """ISO stamps with a time zone that changes to summer time in the middle, an index without a
    name, True and False, words in a column.
    """
    run = joint_run(22, 200.0, 15.0, motion="trapezoids", ratio=160.0)
    rows = run["time"].size
    run["enabled"] = (run["time"] > 0.4).astype(float)
    stamps = pd.to_datetime("2026-03-29 00:59:52", utc=True) + pd.to_timedelta(
        np.rint(run["time"] * 1e6).astype(np.int64), unit="us"
    )
    table = {
        "joint": ["J4"] * rows,
        "phase": np.where(run["time"] < 0.4, "idle", "move"),
        "enabled": run["enabled"] > 0,
        "joint_angle_rad": run["output_position"],
        "joint_vel_rad_s": run["output_velocity"],
        "motor_angle_rad": run["motor_position"],
        "motor_current_A": run["motor_current"],
        "ft_sensor_Nm": run["reference_torque"],
        "target_rad": run["commanded_position"],
    }
    frame = pd.DataFrame(table, index=stamps.tz_convert("Europe/Berlin"))
    names = {
        "enabled": 0.0,
        "output_position": 0.0,
        "output_velocity": 0.0,
        "motor_position": 0.0,
        "motor_current": 0.0,
        "reference_torque": 0.0,
        "commanded_position": 0.0,
    }
    return rec.of_run(
        "run_j4.csv",
        frame.to_csv(lineterminator="\n").encode(),
        run,
        {"time": 1e-6, **names},
        facts={"gear_ratio": 160},
        ambiguous={"reference_torque": "ft_sensor may be the joint's own or one beside it"},
    )


@_recorder
def stm32_swo() -> File:
    """Remarks behind //, ticks of 1 ms, counts whose resolution stands in a remark, words in hex, a
    checksum, a motor that counts the other way and a sensor that reads the reaction.
    """
    run = joint_run(23, 500.0, 6.0, ratio=120.0, motion="sines")
    rows = run["time"].size
    columns = [
        rec.channel(run, "time", "tick", "%d", 1e-3, start=88_412),
        rec.other("state", np.where(np.arange(rows) < 40, 0x0231, 0x0237), "0x%04X"),
        rec.channel(run, "output_position", "enc_out", "%d", REV / 2**19),
        rec.channel(run, "motor_position", "enc_mot", "%d", -REV / 4096),
        rec.channel(run, "motor_current", "iq_mA", "%d", -1e-3),
        rec.channel(run, "sensor_torque", "tau_mNm", "%d", -1e-3),
        rec.channel(run, "temperature", "temp_dC", "%d", 0.1),
    ]
    columns.append(rec.other("crc", np.random.default_rng(23).integers(0, 65536, rows), "%04x"))
    head = [
        "// joint controller fw 1.4.2, built Jan 12 2026",
        "// enc_out: 19 bit per turn, enc_mot: 4096 counts per turn",
        "// tick: HAL_GetTick, 1 ms",
        "// " + rec.headers(columns, ", "),
    ]
    return rec.file(
        "swo_trace.log",
        rec.text([*head, *rec.lines(columns, ", ")]),
        columns,
        facts={"gear_ratio": 120},
        ambiguous={
            "output_position": "counts: the resolution stands in a remark alone",
            "motor_position": "counts: the resolution stands in a remark alone",
        },
    )


@_recorder
def aligned_hash() -> File:
    """Columns aligned with spaces, names in the last of the lines behind #, nan, empty lines at a
    restart of the writer, a last line behind #.
    """
    run = joint_run(24, 250.0, 12.0, ratio=100.0)
    rows = run["time"].size
    lost = np.random.default_rng(24).random(rows) < 0.004
    lost[0] = False
    run["sensor_torque"] = np.where(lost, np.nan, run["sensor_torque"])
    torque = [f"{x:12.5f}" for x in run["sensor_torque"]]
    columns = [
        rec.channel(run, "time", "t[s]", "%10.4f", start=0.004),
        rec.channel(run, "output_position", "q[rad]", "%12.7f"),
        rec.channel(run, "output_velocity", "dq[rad/s]", "%12.6f"),
        rec.channel(run, "motor_position", "theta[rad]", "%14.5f"),
        rec.channel(run, "motor_torque", "tau_m[Nm]", "%12.6f"),
        Column("tau_s[Nm]", torque, "sensor_torque", run["sensor_torque"], 1e-5),
        rec.channel(run, "commanded_position", "q_d[rad]", "%12.7f"),
    ]
    lines = rec.lines(columns, " ")
    lines[rows // 3 : rows // 3] = ["", ""]
    head = [
        "# jointlog 0.9",
        "# started 2026-02-03 17:22:01",
        "# gear ratio: 100",
        "#     " + rec.headers(columns, "   "),
    ]
    return rec.file(
        "jointlog_017.dat",
        rec.text([*head, *lines, f"# stopped, {rows} rows"]),
        columns,
        facts={"gear_ratio": 100},
    )


@_recorder
def payload_rig() -> File:
    """Latin-1, three lines of preamble, names and units in two rows, decimal comma, a rotor angle
    that wraps, torque without a side, compressed with xz.
    """
    name = "Messung_01.csv.xz"
    content = (measured.data_folder() / "simulated_lab_logs" / "payload_rig" / name).read_bytes()
    lines = lzma.decompress(content).decode("latin1").splitlines()
    table = pd.read_csv(
        io.StringIO("\n".join(lines[6:])), sep=";", decimal=",", header=None
    ).to_numpy(dtype=float)
    units = {
        "time": 1e-3,
        "output_position": DEG,
        "output_velocity": RPM,
        "motor_position": DEG,
        "motor_current": 1.0,
        "reference_torque": 1e-3,
        "temperature": 1.0,
    }
    truth = {n: table[:, k] * unit for k, (n, unit) in enumerate(units.items())}
    truth["motor_position"] = np.unwrap(truth["motor_position"])
    return File(
        name,
        content,
        truth,
        dict.fromkeys(truth, 0.0),
        facts={"gear_ratio": 100},
        ambiguous={"reference_torque": "Drehmoment may be that of the motor or that of the output"},
        wraps={"motor_position": REV},
    )


# binary files


@_recorder
def simulink_mat5() -> File:
    """MAT of version 5, an array of structures, names and units in their labels, a second clock.

    Source: https://www.mathworks.com/help/simulink/ug/data-format-for-logged-simulation-data.html
    (Structure With Time)
    """
    run = joint_run(25, 1000.0, 4.0, motion="sines")
    rows = run["time"].size
    signals = {
        "q_link [deg]": ("output_position", DEG),
        "omega_motor [rpm]": ("motor_velocity", RPM),
        "i_q [A]": ("motor_current", 1.0),
        "tau_JTS [Nm]": ("sensor_torque", 1.0),
        "mode": ("", 1.0),
    }
    fields = [(n, object) for n in ("values", "dimensions", "label", "title", "plotStyle")]
    array = np.zeros((1, len(signals)), dtype=fields)
    for k, (label, (channel, unit)) in enumerate(signals.items()):
        values = run[channel] / unit if channel else np.full(rows, 3.0)
        array[0, k] = (values[:, None], np.array([[1.0]]), label, "", np.array([[0.0]]))
    scope = {"time": run["time"][:, None], "signals": array, "blockName": "jointTest/Scope"}
    content = io.BytesIO()
    tout = np.arange(rows * 2)[:, None] / 2000.0
    savemat(content, {"ScopeData": scope, "tout": tout, "Kp": 450.0}, do_compression=True)
    channels = {"time": 0.0} | {c: 0.0 for c, _ in signals.values() if c}
    return rec.of_run(
        "scope_run3.mat", content.getvalue(), run, channels, facts={"gear_ratio": 100}
    )


@_recorder
def matlab_v73() -> File:
    """MAT of version 7.3, which is HDF5: rows for columns, units and words as numbers of
    characters, parameters beside the signals, references.
    """
    run = joint_run(26, 500.0, 6.0, ratio=80.0, motion="trapezoids")
    signals = {
        "t": ("time", 1.0, "s"),
        "q": ("output_position", DEG, "deg"),
        "dq": ("output_velocity", DEG, "deg/s"),
        "theta": ("motor_position", 1.0, "rad"),
        "i_m": ("motor_current", 1.0, "A"),
        "tau": ("sensor_torque", 1.0, "N*m"),
    }
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        log = file.create_group("log")
        units = log.create_group("units")
        for group in (log, units):
            group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, (channel, unit, word) in signals.items():
            data = log.create_dataset(name, data=(run[channel] / unit)[None, :])
            data.attrs["MATLAB_class"] = np.bytes_("double")
            _matlab_text(units, name, word)
        _matlab_text(log, "joint", "elbow")
        for name, value in {"N": 80.0, "kt": 0.1, "fs": 500.0}.items():
            data = file.create_dataset(name, data=np.array([[value]]))
            data.attrs["MATLAB_class"] = np.bytes_("double")
        file.create_group("#refs#").create_dataset("a", data=np.zeros(2, dtype=np.uint64))
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Tue Feb 10 09:12:44 2026 HDF5"
    block = head.ljust(116) + b" " * 8 + b"\x00\x02IM"
    content = block.ljust(512, b"\x00") + buffer.getvalue()[512:]
    return rec.of_run(
        "elbow_log.mat",
        content,
        run,
        {channel: 0.0 for channel, _, _ in signals.values()},
        facts={"gear_ratio": 80},
        ambiguous={"sensor_torque": f"tau {rec.MOTOR_OR_SENSOR}"},
    )


def _matlab_text(group: h5py.Group, name: str, text: str) -> None:
    data = group.create_dataset(name, data=np.array([[ord(letter)] for letter in text], np.uint16))
    data.attrs["MATLAB_class"] = np.bytes_("char")
    data.attrs["MATLAB_int_decode"] = np.int32(2)


@_recorder
def hdf5_groups() -> File:
    """Three joints in groups, of which an attribute names the one that is tested, attributes unit,
    ns of an epoch, a temperature with fewer rows and a clock of its own.
    """
    run = joint_run(27, 250.0, 12.0, ratio=160.0)
    rows = run["time"].size
    ticks = np.rint(run["time"] * 1e9).astype(np.uint64) + np.uint64(1_771_000_000_123_456_789)
    table = {
        "position": ("output_position", DEG, "deg"),
        "velocity": ("output_velocity", DEG, "deg/s"),
        "motor_position": ("motor_position", -1.0, "rad"),
        "motor_current": ("motor_current", -1e-3, "mA"),
        "torque": ("sensor_torque", 1.0, "N m"),
    }
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs["joint_under_test"] = "joint_2"
        file.attrs["operator"] = "mk"
        file.create_dataset("time", data=ticks).attrs["unit"] = "ns"
        for joint in (1, 2, 3):
            group = file.create_group(f"joint_{joint}")
            group.attrs["gear_ratio"] = 160
            for name, (channel, unit, word) in table.items():
                values = run[channel] / unit if joint == 2 else rec.still(joint, 0.4, rows)
                group.create_dataset(name, data=values, compression="gzip").attrs["unit"] = word
        room = file.create_group("ambient")
        room.create_dataset("time", data=ticks[:: rows // 12]).attrs["unit"] = "ns"
        room.create_dataset("temperature", data=np.full(12, 22.4)).attrs["unit"] = "degC"
    return rec.of_run(
        "rig_2026-02-13.h5",
        buffer.getvalue(),
        run,
        {"time": 1e-9} | {channel: 0.0 for channel, _, _ in table.values()},
        facts={"gear_ratio": 160},
        ambiguous={"sensor_torque": f"torque {rec.MOTOR_OR_SENSOR}"},
    )


@_recorder
def numpy_npz() -> File:
    """NumPy archive: names of one or two letters, single precision, facts in a JSON string, 101
    turns of the motor as the circular spline is the output.
    """
    run = joint_run(28, 400.0, 8.0, ratio=101.0)
    names = {
        "t": "time",
        "q": "output_position",
        "dq": "output_velocity",
        "th": "motor_position",
        "dth": "motor_velocity",
        "i": "motor_current",
        "tau_s": "sensor_torque",
    }
    arrays = {
        short: run[name] if name == "time" else run[name].astype(np.float32)
        for short, name in names.items()
    }
    facts = {"gear_ratio": 100, "output_spline": "circular", "operator": "AB"}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays, meta=np.array(json.dumps(facts)), fs=np.array(400.0))
    return rec.of_run(
        "run_28.npz",
        buffer.getvalue(),
        run,
        rec.single(run, names.values()) | {"time": 0.0},
        facts={"gear_ratio": 101},
        ambiguous={
            "gear_ratio": "101 turns; JSON in meta says 100 with the circular spline at the output",
            **dict.fromkeys(list(names.values())[1:], "no unit is stated anywhere"),
        },
    )


@_recorder
def numpy_structured() -> File:
    """One NumPy array with named fields of integers: µs, counts without a resolution, mA, mNm,
    tenths of °C, flags and a checksum.
    """
    run = joint_run(29, 500.0, 6.0, ratio=50.0, motion="trapezoids")
    rows = run["time"].size
    fields = {
        "stamp_us": ("time", 1e-6, "<u8"),
        "pos_cnt": ("output_position", REV / 2**20, "<i4"),
        "mot_cnt": ("motor_position", REV / 2**14, "<i4"),
        "iq_mA": ("motor_current", 1e-3, "<i2"),
        "torque_mNm": ("sensor_torque", 1e-3, "<i4"),
        "temp_dC": ("temperature", 0.1, "<i2"),
    }
    kinds = [(name, kind) for name, (_, _, kind) in fields.items()]
    array = np.zeros(rows, dtype=[*kinds, ("flags", "<u2"), ("crc", "<u2")])
    for name, (channel, unit, _) in fields.items():
        array[name] = np.rint(run[channel] / unit) + (55_120_044 if channel == "time" else 0)
    array["flags"] = 0x0011
    array["crc"] = np.random.default_rng(29).integers(0, 65536, rows)
    buffer = io.BytesIO()
    np.save(buffer, array)
    return rec.of_run(
        "capture.npy",
        buffer.getvalue(),
        run,
        {channel: unit for channel, unit, _ in fields.values()},
        ambiguous={
            "output_position": rec.NO_RESOLUTION,
            "motor_position": rec.NO_RESOLUTION,
            "gear_ratio": rec.TO_A_FACTOR,
            "sensor_torque": f"torque {rec.MOTOR_OR_SENSOR}",
        },
    )


RECORDERS = tuple(_recorder)
"""Thirty recorders, one file each."""
