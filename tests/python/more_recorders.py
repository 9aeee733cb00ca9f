"""Fifteen further files of recorders with known truth, to score what was tuned on the thirty.

They are made as those of `recorders`, and nothing that guesses was looked at while they were
written. Not part of the package.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import recorder_files as rec
from recorder_files import DEG, REV, RPM, Array, Column, File, joint_run

_recorder = rec.Recorders()


def _rows(run: Mapping[str, Array], keep: Array | slice) -> dict[str, Array]:
    """Some rows of a run, on a clock that starts with the first of them."""
    kept = {name: values[keep] for name, values in run.items()}
    kept["time"] = kept["time"] - kept["time"][0]
    return kept


def _holes(column: Column, gone: Sequence[int] | Array, word: str) -> Column:
    """The column with `word` for a cell in rows `gone`."""
    assert column.truth is not None
    cells, truth = list(column.cells), column.truth.copy()
    for row in gone:
        cells[row], truth[row] = word, np.nan
    return Column(column.header, cells, column.channel, truth, column.step)


def _worded(column: Column, word: str) -> Column:
    """The column with `word` behind each number."""
    cells = [f"{cell} {word}" for cell in column.cells]
    return Column(column.header, cells, column.channel, column.truth, column.step)


# robots and data bases


@_recorder
def doosan_rt() -> File:
    """Two angles of one joint, both in deg of the output: that of the motor's encoder and that of
    the link's; motor torque already times the ratio; six joints; no unit in the file.

    Source:
    https://manual.doosanrobotics.com/en/api/1.32/Publish/cdrflex-get_rt_control_output_data_list
    (names, units and meanings)
    """
    ratio = 100.0
    run = joint_run(31, 1000.0, 3.0, ratio=ratio, motion="trapezoids", torque_constant=0.12)
    rows = run["time"].size
    estimate = run["reference_torque"] + rec.white(31, 0.4, rows)
    moving: dict[str, tuple[str, float, float]] = {
        "actual_joint_position": ("motor_position", ratio * DEG, 30.0),
        "actual_joint_position_abs": ("output_position", DEG, 30.0),
        "actual_joint_velocity": ("motor_velocity", ratio * DEG, 0.0),
        "actual_joint_velocity_abs": ("output_velocity", DEG, 0.0),
        "actual_motor_torque": ("motor_torque", 1.0 / ratio, -3.1),
        "actual_joint_torque": ("", 1.0, -3.0),
        "raw_joint_torque": ("sensor_torque", 1.0, -3.2),
        "target_joint_position": ("commanded_position", DEG, 30.0),
    }
    columns = [rec.channel(run, "time", "time_stamp", "%.3f", start=8134.211)]
    for k, (name, (channel, unit, held)) in enumerate(moving.items()):
        for joint in range(6):
            header = f"{name}[{joint}]"
            if joint != 2:
                columns.append(
                    rec.other(header, held + rec.white(10 * k + joint, 1e-3, rows), "%.6f")
                )
            elif channel:
                columns.append(rec.channel(run, channel, header, "%.6f", unit))
            else:
                columns.append(rec.other(header, estimate, "%.6f"))
    columns += [rec.same("robot_mode", "1", rows), rec.same("robot_state", "2", rows)]
    at_output = "said at the output: the motor's own needs a ratio that is not in the file"
    return rec.table(
        "rt_output_j3.csv",
        columns,
        ",",
        ambiguous={
            "output_position": "deg are known from the interface alone",
            "output_velocity": "deg/s are known from the interface alone",
            "commanded_position": "deg are known from the interface alone",
            "motor_position": at_output,
            "motor_velocity": at_output,
            "motor_torque": at_output,
            "sensor_torque": "three torques of one joint: measured, estimated, of the motor",
            "gear_ratio": "both angles are those of the output",
        },
    )


@_recorder
def influx_annotated() -> File:
    """Three rows of annotations, a first column that is empty, RFC 3339 stamps to ns without zeros
    at their ends, uneven sampling, two stamps that never change, a slow field with empty cells.

    Source: https://docs.influxdata.com/influxdb/cloud/reference/syntax/annotated-csv/ (after
    pivot())
    """
    run = joint_run(32, 200.0, 15.0, ratio=160.0, motion="sines")
    rows = run["time"].size
    late = np.random.default_rng(32).exponential(4e-4, rows)
    moments, run["time"] = rec.stamps(run["time"] + late, "2026-02-11T08:14:07.250", "ns")
    stamps = [_trimmed(moment) for moment in moments]
    slow = rec.channel(run, "temperature", "t_housing_c", "%.2f")
    table = [
        (rec.same("result", "", rows), "string", False),
        (rec.same("table", "0", rows), "long", False),
        (rec.same("_start", "2026-02-11T08:14:00Z", rows), "dateTime:RFC3339", True),
        (rec.same("_stop", "2026-02-11T08:15:00Z", rows), "dateTime:RFC3339", True),
        (Column("_time", stamps, "time", run["time"], 1e-9), "dateTime:RFC3339", False),
        (rec.same("_measurement", "joint_state", rows), "string", True),
        (rec.same("joint", "J2", rows), "string", True),
        (rec.channel(run, "motor_current", "iq_a", "%r"), "double", False),
        (rec.channel(run, "motor_position", "motor_pos_deg", "%r", DEG), "double", False),
        (rec.channel(run, "output_position", "output_pos_deg", "%r", DEG), "double", False),
        (rec.channel(run, "output_velocity", "output_vel_degs", "%r", DEG), "double", False),
        (_holes(slow, np.flatnonzero(np.arange(rows) % 200), ""), "double", False),
        (rec.channel(run, "sensor_torque", "tau_nm", "%r"), "double", False),
    ]
    columns = [column for column, _, _ in table]
    head = [
        "#group," + ",".join("true" if grouped else "false" for _, _, grouped in table),
        "#datatype," + ",".join(kind for _, kind, _ in table),
        "#default,_result" + "," * (len(table) - 1),
        "," + rec.headers(columns, ","),
    ]
    lines = ["," + line for line in rec.lines(columns, ",")]
    return rec.file(
        "2026-02-11-08-15_chronograf_data.csv",
        rec.text([*head, *lines, ""], "\r\n"),
        columns,
        facts={"gear_ratio": 160},
        ambiguous={"sensor_torque": f"tau {rec.MOTOR_OR_SENSOR}"},
    )


def _trimmed(stamp: str) -> str:
    """An RFC 3339 stamp as Go writes it: no zeros at the end of a fraction."""
    return stamp.rstrip("0").rstrip(".") + "Z"


@_recorder
def grafana_formatted() -> File:
    """A byte order mark before sep=, units behind each number in its cell, a prefix of SI that
    changes from cell to cell (mA and A, mNm and Nm), names quoted, numbers not.

    Source: https://grafana.com/docs/grafana/latest/panels-visualizations/panel-inspector (Formatted
    data, Download for Excel); https://github.com/grafana/grafana
    packages/grafana-data/src/valueFormats/categories.ts (amp, SIPrefix)
    """
    run = joint_run(33, 50.0, 60.0, ratio=100.0, motion="sines", pace=0.8)
    moments, run["time"] = rec.stamps(run["time"], "2026-01-21T14:03:11.020", "ms")
    stamps = [moment.replace("T", " ") for moment in moments]
    current = [_prefixed(x, "A") for x in run["motor_current"].tolist()]
    torque = [_prefixed(x, "Nm") for x in run["sensor_torque"].tolist()]
    columns = [
        Column('"Time"', stamps, "time", run["time"], 1e-3),
        _worded(rec.channel(run, "output_position", '"joint angle"', "%.2f", DEG), "°"),
        _worded(rec.channel(run, "motor_velocity", '"motor speed"', "%.1f", RPM), "rpm"),
        Column('"motor current"', current, "motor_current", run["motor_current"], 0.01),
        Column('"joint torque"', torque, "sensor_torque", run["sensor_torque"], 0.01),
        _worded(rec.channel(run, "temperature", '"housing temperature"', "%.1f"), "°C"),
    ]
    lines = ["sep=,", rec.headers(columns, ","), *rec.lines(columns, ",")]
    return rec.file(
        "Joint test-data-2026-01-21 15_04_48.csv",
        rec.text(lines, "\r\n", "utf-8-sig"),
        columns,
        facts={"gear_ratio": 100},
        ambiguous={
            "sensor_torque": "joint torque may be measured in it, beside it or made from a current",
        },
    )


def _prefixed(value: float, unit: str) -> str:
    """A number with two decimals and a prefix, so that it is at least 1 and below 1000."""
    power = 0 if value == 0.0 else max(int(np.floor(np.log10(abs(value)) / 3.0)), -2)
    return f"{value / 1000.0**power:.2f} {['', 'µ', 'm'][power]}{unit}"


@_recorder
def json_lines() -> File:
    """An object of JSON in each line, the first and the last of which are events; units in the
    first one; a key that only each fiftieth line has; seconds of an epoch.
    """
    run = joint_run(34, 250.0, 12.0, ratio=80.0, motion="trapezoids", from_zero=True)
    rows = run["time"].size
    late = np.random.default_rng(34).uniform(0.0, 6e-4, rows)
    ticks = np.rint((run["time"] + late) * 1e6).astype(np.int64)
    run["time"] = (ticks - ticks[0]) * 1e-6
    run["temperature"] = np.where(np.arange(rows) % 50 == 0, run["temperature"], np.nan)
    units = {"q": "rad", "dq": "rad/s", "theta": "rad", "iq": "A", "tau_jts": "Nm", "temp": "degC"}
    names = {
        "q": "output_position",
        "dq": "output_velocity",
        "theta": "motor_position",
        "iq": "motor_current",
        "tau_jts": "sensor_torque",
        "temp": "temperature",
    }
    start = {"event": "start", "joint": "elbow", "gear_ratio": 80, "units": units}
    lines = [json.dumps(start)]
    for row, tick in enumerate(ticks.tolist()):
        entry: dict[str, object] = {"ts": (1_770_123_456_000_000 + tick) / 1e6, "seq": row}
        for name, channel in names.items():
            if not np.isnan(run[channel][row]):
                entry[name] = round(float(run[channel][row]), 6)
        lines.append(json.dumps(entry))
    lines.append(json.dumps({"event": "stop", "rows": rows}))
    steps = {"time": 1e-6} | dict.fromkeys(names.values(), 1e-6)
    return rec.of_run(
        "elbow_telemetry.jsonl",
        rec.text(lines),
        run,
        steps,
        facts={"gear_ratio": 80},
        ambiguous={"temperature": rec.WHERE},
    )


# programs for numbers


@_recorder
def matlab_timetable() -> File:
    """Time as '0.004 sec' in each cell, names of variables without a unit, one variable of three
    columns, NaN.

    Source: https://mathworks.com/help/matlab/ref/writetimetable.html;
    https://www.mathworks.com/matlabcentral/answers/801181 (the content of the file)
    """
    run = joint_run(35, 250.0, 12.0, ratio=120.0, motion="sines")
    rows = run["time"].size
    lost = np.flatnonzero(np.random.default_rng(35).random(rows) < 0.003)
    columns = [
        _worded(rec.channel(run, "time", "Time", "%.5g"), "sec"),
        rec.channel(run, "output_position", "phi_out", "%.15g"),
        rec.channel(run, "motor_position", "phi_mot", "%.15g"),
        rec.channel(run, "motor_velocity", "omega_mot", "%.15g"),
        rec.channel(run, "motor_current", "i_q", "%.15g"),
        _holes(rec.channel(run, "sensor_torque", "tau_jts", "%.15g"), lost, "NaN"),
        rec.other("acc_1", 0.3 * run["output_velocity"] + rec.white(35, 0.05, rows), "%.15g"),
        rec.other(
            "acc_2", 9.81 * np.sin(run["output_position"]) + rec.white(36, 0.05, rows), "%.15g"
        ),
        rec.other(
            "acc_3", 9.81 * np.cos(run["output_position"]) + rec.white(37, 0.05, rows), "%.15g"
        ),
    ]
    return rec.table(
        "TT.csv",
        columns,
        ",",
        facts={"gear_ratio": 120},
        ambiguous={
            "output_position": "no unit is stated",
            "motor_position": "no unit is stated",
            "motor_velocity": "no unit is stated; as that of phi_mot in a second",
            "motor_current": "no unit is stated",
            "sensor_torque": "no unit is stated",
        },
    )


@_recorder
def octave_text() -> File:
    """A work space of several variables of which one matrix is the record; its names are a cell
    array behind it, the gear ratio and the torque constant scalars before and behind it.

    Source: https://gnu.org/software/octave/doc/v4.0.0/Simple-File-I_002fO.html (save -text); its '#
    name:', '# type:', '# rows:', '# columns:' as public programs write them
    """
    run = joint_run(36, 500.0, 6.0, ratio=100.0, motion="trapezoids")
    labels = {
        "t_s": ("time", 1.0),
        "q_deg": ("output_position", DEG),
        "th_deg": ("motor_position", DEG),
        "dth_rpm": ("motor_velocity", RPM),
        "iq_A": ("motor_current", 1.0),
        "tau_Nm": ("sensor_torque", 1.0),
    }
    columns = [rec.channel(run, c, name, "%.17g", unit) for name, (c, unit) in labels.items()]
    lines = ["# Created by Octave 6.4.0, Tue Feb 10 09:31:12 2026 CET <mk@rig2>"]
    lines += ["# name: N", "# type: scalar", "100", "", ""]
    lines += ["# name: data", "# type: matrix", f"# rows: {run['time'].size}"]
    lines += [f"# columns: {len(columns)}", *[" " + row for row in rec.lines(columns, " ")], "", ""]
    lines += ["# name: joint", *_octave_string("J4")]
    lines += ["# name: kt", "# type: scalar", "0.10000000000000001", "", ""]
    lines += ["# name: labels", "# type: cell", "# rows: 1", f"# columns: {len(labels)}"]
    for name in labels:
        lines += ["# name: <cell-element>", *_octave_string(name)]
    lines += ["", "", ""]
    return rec.file(
        "run36.txt",
        rec.text(lines),
        columns,
        facts={"gear_ratio": 100, "torque_constant": 0.1},
        ambiguous={"sensor_torque": f"tau {rec.MOTOR_OR_SENSOR}"},
    )


def _octave_string(text: str) -> list[str]:
    return ["# type: string", "# elements: 1", f"# length: {len(text)}", text, "", ""]


@_recorder
def r_write_csv() -> File:
    """Names in which each space, bracket and ° became a dot, quoted row names as a first column
    without a name, gaps in them where rows were filtered out, NA, TRUE and FALSE.

    Source: https://search.r-project.org/CRAN/refmans/utils/html/write.table.html (write.csv; names
    of read.csv by make.names)
    """
    whole = joint_run(37, 200.0, 15.0, ratio=50.0, motion="trapezoids")
    random = np.random.default_rng(37)
    there = np.flatnonzero(random.random(whole["time"].size) > 0.05)
    run = _rows(whole, there)
    rows = run["time"].size
    run["enabled"] = (np.arange(rows) >= 60).astype(float)
    on = ["TRUE" if value else "FALSE" for value in run["enabled"]]
    lost = np.flatnonzero(random.random(rows) < 0.004)
    columns = [
        Column('""', [f'"{row + 1}"' for row in there.tolist()]),
        rec.channel(run, "time", '"Time..s."', "%.15g", start=0.005 * float(there[0])),
        rec.channel(run, "output_position", '"Output.angle..deg."', "%.15g", DEG),
        rec.channel(run, "motor_velocity", '"Motor.speed..1.min."', "%.15g", RPM),
        rec.channel(run, "motor_current", '"Motor.current..A."', "%.15g"),
        _holes(rec.channel(run, "sensor_torque", '"Sensor.torque..N.m."', "%.15g"), lost, "NA"),
        rec.channel(run, "temperature", '"Temp...C."', "%.15g"),
        Column('"Servo.on"', on, "enabled", run["enabled"], 0.0),
        rec.same('"Operator"', '"J. Müller"', rows),
    ]
    return rec.table(
        "clean_run37.csv",
        columns,
        ",",
        facts={"gear_ratio": 50},
        ambiguous={"temperature": rec.WHERE},
    )


@_recorder
def pandas_multiindex() -> File:
    """Names in two rows, side and quantity with unit, and the name of the index in a third; an
    angle that leaps at ±180°.

    Source: https://github.com/pandas-dev/pandas/pull/3575 (to_csv of columns with a MultiIndex)
    """
    run = joint_run(38, 400.0, 8.0, ratio=160.0, motion="sines", from_zero=True)
    run["output_position"] = run["output_position"] + 2.9
    wrapped = np.mod(run["output_position"] / DEG + 180.0, 360.0) - 180.0
    table = {
        ("output", "angle [deg]"): wrapped,
        ("output", "velocity [deg/s]"): run["output_velocity"] / DEG,
        ("output", "torque [Nm]"): run["sensor_torque"],
        ("motor", "angle [rad]"): run["motor_position"],
        ("motor", "current [A]"): run["motor_current"],
        ("motor", "temperature [degC]"): run["motor_temperature"],
    }
    frame = pd.DataFrame(table, index=pd.Index(run["time"], name="time [s]"))
    names = (
        "time output_position output_velocity sensor_torque motor_position motor_current "
        "motor_temperature"
    )
    return rec.of_run(
        "joint_38_wide.csv",
        frame.to_csv(lineterminator="\n").encode(),
        run,
        dict.fromkeys(names.split(), 0.0),
        facts={"gear_ratio": 160},
        ambiguous={
            "sensor_torque": rec.OWN_OR_BESIDE,
        },
        wraps={"output_position": REV},
    )


@_recorder
def fortran_blocks() -> File:
    """Exponents with D, names and units in two lines of a Fortran format, blocks of three joints of
    which the second moves, mrad/s, a sensor that reads the reaction, accelerations at the end.
    """
    run = joint_run(39, 500.0, 5.0, ratio=100.0, motion="trapezoids")
    rows = run["time"].size
    kinds = {
        "Q": ("output_position", DEG, "DEG", 20.0),
        "TH": ("motor_position", DEG, "DEG", 2000.0),
        "V": ("output_velocity", 1e-3, "MRAD/S", 0.0),
        "I": ("motor_current", 1.0, "A", -0.4),
        "M": ("sensor_torque", -1.0, "NM", 2.2),
    }
    columns, units = [rec.channel(run, "time", "T", "%16.8E", start=0.002)], ["S"]
    for joint in (1, 2, 3):
        for k, (kind, (channel, unit, word, held)) in enumerate(kinds.items()):
            header = f"{kind}{joint}"
            if joint == 2:
                columns.append(rec.channel(run, channel, header, "%16.8E", unit))
            else:
                columns.append(
                    rec.other(header, held + rec.white(10 * k + joint, 1e-3, rows), "%16.8E")
                )
            units.append(word)
    for k, (axis, level) in enumerate({"AX": 0.1, "AY": 0.2, "AZ": -9.79}.items()):
        columns.append(rec.other(axis, level + rec.white(90 + k, 0.02, rows), "%16.8E"))
        units.append("M/S**2")
    head = [
        f" JOINT RIG   RUN 0042   NPTS = {rows:6d}   NCOL = {len(columns):3d}",
        "".join(f"{column.header:>16}" for column in columns),
        "".join(f"{'(' + unit + ')':>16}" for unit in units),
    ]
    return rec.file(
        "RUN0042.DAT",
        rec.text([*head, *[line.replace("E", "D") for line in rec.lines(columns, "")]]),
        columns,
        facts={"gear_ratio": 100},
        ambiguous={"sensor_torque": "M may be that of the motor or that of the joint's sensor"},
    )


# instruments and benches


@_recorder
def rigol_ds1000z() -> File:
    """10 kHz for 0.3 s, no time column: a row number, a start and a step in the second line; volts
    of unnamed inputs, 8 bits, a separator at the end of each line.

    Source: Rigol DS1000Z, waveform as CSV: 'X,CH1,CH2,Start,Increment,' and
    'Sequence,Volt,Volt,-1.200000e-03,2.000000e-06' as public readers quote it
    """
    run = joint_run(40, 10_000.0, 0.3, motion="sines", pace=6.0, amplitude=0.4)
    rows = run["time"].size
    run["sensor_voltage"] = run["sensor_torque"] * 0.05  # an amplifier of the bridge

    def bits(channel: str, header: str, unit: float, division: float) -> Column:
        step = division / 25.0  # V
        volts = np.rint(run[channel] / unit / step) * step + 0.0  # no minus before a zero
        assert np.max(np.abs(volts)) < 4.0 * division
        cells = [f"{x:.2e}" for x in volts.tolist()]
        return Column(header, cells, channel, run[channel], step * unit)

    columns = [
        Column("X", [str(row) for row in range(rows)], "time", run["time"], 0.0),
        bits("motor_current", "CH1", 10.0, 0.2),
        bits("sensor_voltage", "CH2", 1.0, 0.5),
    ]
    head = [
        "X,CH1,CH2,Start,Increment,",
        "Sequence,Volt,Volt,-1.500000e-01,1.000000e-04",
    ]
    unnamed = "an input without a name, and volts of "
    return rec.file(
        "NewFile4.csv",
        rec.text([*head, *rec.lines(columns, ",", ",")], "\r\n"),
        columns,
        ambiguous={
            "motor_current": unnamed + "a current probe: 0.1 V/A is not in the file",
            "sensor_voltage": unnamed + "nobody knows what",
        },
    )


@_recorder
def graphtec_gl240() -> File:
    """The columns are CH1 to CH5 and their names stand in a table of settings above, a unit row, a
    clock of seconds with the ms in a column of their own, spaces between a sign and its digits,
    +++++++ for out of range, alarms in letters.

    Source: Graphtec GL240, CSV: Vendor, Model, AMP settings to 'NO.,Time,ms' as public programs
    write and read it
    """
    run = joint_run(41, 100.0, 30.0, ratio=80.0, motion="trapezoids")
    rows = run["time"].size
    moments, run["time"] = rec.stamps(run["time"], "2026-03-04T10:12:58.000", "ms")
    clock = [moment[:-4].replace("T", " ").replace("-", "/") for moment in moments]
    over = np.flatnonzero(np.abs(run["motor_current"]) > np.quantile(run["motor_current"], 0.995))
    signals = [
        (rec.channel(run, "output_position", "OUTPUT ANGLE", "%+.2f", DEG), "DC", "10V", "deg"),
        (rec.channel(run, "motor_velocity", "MOTOR SPEED", "%+.1f", RPM), "DC", "10V", "rpm"),
        (
            _holes(rec.channel(run, "motor_current", "MOTOR CURR", "%+.3f"), over, "+++++++"),
            "DC",
            "5V",
            "A",
        ),
        (rec.channel(run, "reference_torque", "TORQUE FLANGE", "%+.2f"), "DC", "10V", "Nm"),
        (rec.channel(run, "temperature", "HOUSING", "%+.1f"), "TEMP", "TC_K", "degC"),
    ]
    inputs = [f"CH{k}" for k in range(1, len(signals) + 1)]
    columns = [
        rec.other("Number", range(1, rows + 1), "%10d"),
        Column("Date&Time", clock, "time", run["time"], 1e-3),
        rec.other("ms", [int(moment[-3:]) for moment in moments], "%3d"),
        *[
            Column(name, _padded(c.cells), c.channel, c.truth, c.step)
            for name, (c, _, _, _) in zip(inputs, signals, strict=True)
        ],
        rec.same("Alarm1-10", "LLLLLLLLLL", rows),
        rec.same("AlarmOut", "LLLL", rows),
    ]
    head = [
        'Vendor,"GRAPHTEC Corporation"',
        'Model,"GL240"',
        'Version,"Ver1.11  "',
        "Max. CH,10",
        "Sampling interval,10ms",
        f"Total data points,{rows}",
        "Start time,2026-03-04,10:12:58",
        "End time,2026-03-04,10:13:27",
        "Trigger time,2026-03-04,10:12:58",
        "AMP settings",
        "CH,Signal name,Input,Range,Filter,Span,,Unit",
        *[
            f'{name},"{c.header}",{kind},{span},Off,+100.00,-100.00,[{unit}]'
            for name, (c, kind, span, unit) in zip(inputs, signals, strict=True)
        ],
        "Logic/Pulse,Off",
        "Data",
        rec.headers(columns, ","),
        'NO.,Time,ms,"deg","rpm","A","Nm","degC","A1234567890","AO1234"',
    ]
    return rec.file(
        "260304-101258.CSV",
        rec.text([*head, *rec.lines(columns, ",")], "\r\n"),
        columns,
        facts={"gear_ratio": 80},
        ambiguous={"reference_torque": rec.OWN_OR_BESIDE},
    )


def _padded(cells: Sequence[str]) -> list[str]:
    """Numbers with spaces between the sign and the digits; +++++++ as it is."""
    return [cell if cell.endswith("+") else f"{cell[0]}{cell[1:]:>8}" for cell in cells]


@_recorder
def french_bench() -> File:
    """French in cp1252, decimal comma, a no-break space between thousands, tr/min and N.m, one
    speed in one direction, so that no sign is seen to change.
    """
    whole = joint_run(42, 100.0, 38.0, motion="trapezoids", amplitude=36.0, pace=0.04)
    run = _rows(whole, slice(1300, None))  # the ramp takes 12.5 s
    run["output_position"] = run["output_position"] - run["output_position"][0]
    rows = run["time"].size
    speed = [f"{x:,.1f}".replace(",", "\xa0") for x in (run["motor_velocity"] / RPM).tolist()]
    columns = rec.commas(
        [
            rec.channel(run, "time", "Temps (s)", "%.2f", start=13.0),
            rec.channel(run, "output_position", "Angle sortie (°)", "%.3f", DEG),
            Column(
                "Vitesse moteur (tr/min)",
                speed,
                "motor_velocity",
                run["motor_velocity"],
                0.1 * RPM,
            ),
            rec.channel(run, "motor_current", "Courant (A)", "%.3f"),
            rec.channel(run, "sensor_torque", "Couple (N.m)", "%.2f"),
            rec.channel(run, "temperature", "Température (°C)", "%.1f"),
            rec.same("État", "Marche", rows),
        ]
    )
    head = ["Banc d'essai réducteur n° 2", "Essai à vitesse constante, rapport 100", ""]
    return rec.table(
        "Essai réducteur 17.csv",
        columns,
        ";",
        "\r\n",
        "cp1252",
        head=head,
        facts={"gear_ratio": 100},
        ambiguous={
            "sensor_torque": "Couple may be that of the motor, of the joint's sensor or of another",
            "temperature": rec.WHERE,
        },
    )


@_recorder
def russian_cp1251() -> File:
    """Russian in cp1251, commas within names and between digits, whole ms with jitter and lost
    rows, a motor that counts the other way.
    """
    whole = joint_run(43, 200.0, 16.0, ratio=100.0, motion="sines")
    random = np.random.default_rng(43)
    ms = np.rint(5.0 * np.arange(whole["time"].size) + random.uniform(0.0, 2.0, 3200))
    whole["time"] = ms * 1e-3
    run = _rows(whole, np.flatnonzero(random.random(3200) > 0.03))
    rows = run["time"].size
    columns = rec.commas(
        [
            rec.channel(run, "time", "Время, мс", "%d", 1e-3, start=1204),
            rec.channel(run, "output_position", "Угол выхода, град", "%.4f", DEG),
            rec.channel(run, "motor_position", "Угол двигателя, град", "%.2f", -DEG),
            rec.channel(run, "motor_velocity", "Скорость двигателя, об/мин", "%.1f", -RPM),
            rec.channel(run, "motor_current", "Ток, А", "%.3f", -1.0),
            rec.channel(run, "sensor_torque", "Момент датчика, Н·м", "%.3f"),
            rec.channel(run, "temperature", "Температура, °C", "%.1f"),
            rec.same("Примечание", "", rows),
        ]
    )
    head = ["Стенд СВП-3", "Дата: 11.02.2026 15:40", "Передаточное отношение i = 100", ""]
    return rec.table(
        "Испытание_43.txt",
        columns,
        ";",
        "\r\n",
        "cp1251",
        head=head,
        facts={"gear_ratio": 100},
        ambiguous={"temperature": rec.WHERE},
    )


@_recorder
def chinese_gbk() -> File:
    """Chinese in GBK, counts of 17 and 19 bits whose resolution stands in the preamble, 121 turns
    as the circular spline is the output while the preamble says 120.
    """
    run = joint_run(44, 500.0, 6.0, ratio=121.0, motion="trapezoids")
    rows = run["time"].size
    columns = [
        rec.other("序号", range(1, rows + 1)),
        rec.channel(run, "time", "时间(ms)", "%d", 1e-3),
        rec.channel(run, "motor_position", "电机位置(脉冲)", "%d", REV / 2**17),
        rec.channel(run, "output_position", "输出端位置(脉冲)", "%d", REV / 2**19),
        rec.channel(run, "motor_velocity", "电机转速(rpm)", "%.1f", RPM),
        rec.channel(run, "motor_current", "电机电流(A)", "%.3f"),
        rec.channel(run, "sensor_torque", "关节扭矩(N·m)", "%.2f"),
        rec.channel(run, "temperature", "温度(℃)", "%.1f"),
    ]
    head = [
        "谐波关节测试系统 V2.1",
        "测试时间,2026-02-05 14:20:36",
        "电机编码器分辨率,131072",
        "输出端编码器分辨率,524288",
        "减速比,120",
        "",
    ]
    counts = "counts: the resolution stands in the preamble alone"
    return rec.table(
        "关节测试数据.csv",
        columns,
        ",",
        "\r\n",
        "gbk",
        head=head,
        facts={"gear_ratio": 121},
        ambiguous={
            "motor_position": counts,
            "output_position": counts,
            "gear_ratio": "121 turns by the counts; the preamble gives the 120 of the gear",
            "sensor_torque": "a joint's torque, of its own sensor or of one at the output",
            "temperature": rec.WHERE,
        },
    )


@_recorder
def polish_drive() -> File:
    """Polish in cp1250, torque in % of a rated one that stands in the preamble, A rms, a velocity
    that the drive filters, so that it comes 5 ms late, a motor that turns the other way.
    """
    run = joint_run(45, 1000.0, 4.0, ratio=80.0, motion="trapezoids")
    run["motor_velocity"] = rec.filtered(run["motor_velocity"], 1000.0, 5e-3)
    rows = run["time"].size
    columns = rec.commas(
        [
            rec.channel(run, "time", "Czas [ms]", "%.1f", 1e-3),
            rec.channel(run, "output_position", "Położenie wału [°]", "%.4f", DEG),
            rec.channel(run, "motor_velocity", "Prędkość silnika [obr/min]", "%.1f", -RPM),
            rec.channel(run, "motor_torque", "Moment silnika [% Mn]", "%.2f", -0.64e-2),
            rec.channel(run, "motor_current", "Prąd silnika [A RMS]", "%.3f", -1.0),
            rec.channel(run, "supply_voltage", "Napięcie DC [V]", "%.1f"),
            rec.channel(run, "motor_temperature", "Temperatura silnika [°C]", "%.1f"),
            rec.same("Słowo stanu", "16#0637", rows),
        ]
    )
    head = [
        "Rejestrator napędu;wersja 3.2",
        "Moment znamionowy Mn [Nm];0,64",
        "Prąd znamionowy In [A RMS];6,4",
        "Przekładnia;80:1",
        "Filtr prędkości [ms];5",
        "",
    ]
    return rec.table(
        "przebieg_45.csv",
        columns,
        ";",
        "\r\n",
        "cp1250",
        head=head,
        facts={"gear_ratio": 80},
        ambiguous={
            "motor_torque": "per cent of a rated torque that only the preamble gives",
            "motor_current": rec.RMS_OR_AMPLITUDE,
        },
    )


MORE_RECORDERS = tuple(_recorder)
"""Fifteen recorders, one file each."""
