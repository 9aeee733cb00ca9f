"""From logs to the three columns of a calibration: voltage, reference torque, temperature.

Nothing is repaired here. What cannot be calibrated from is refused with one sentence; what is
strange but possible is returned as a warning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import medfilt

from flexspline import _core
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.estimators import Thermistor
from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks import check
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.samples import WARMEST
from flexspline.logs.log import Log, limits_of
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.segments import runs as unbroken
from flexspline.logs.spikes import spikes

__all__ = ["CalibrationRun", "calibration_runs", "contrasts", "why_unexcited"]

Array = NDArray[np.float64]

VOLTAGE = "sensor_voltage"
MOST_VOLTS = 30.0  # no converter of a bridge reads more; millivolts do
LEAST_VOLTS = 1e-5  # of full range: a bridge that says nothing, or another unit
MOST_LEAP = 10.0  # K, of one row against both of its neighbours
MOST_TORQUE = 1e4  # Nm, the largest strain wave gears
LEAST_ROWS = 16
LOST_IN_NOISE = 0.01  # share of the reference's variance that is its own noise
LEAST_LEVEL = 1e-3  # Nm
LEAST_SPAN = 1e-9  # V; a bridge of 350 Ω has 2.4 nV of thermal noise in 1 Hz
LEAST_TORQUE = 1e-9  # Nm, below which no torque sensor reads
SAME = 1e-6  # of its range; the best force standards agree to 2e-5
BEYOND = 3.0  # standard deviations of the line from which a voltage is held back
LEAST_BEYOND = 1e-6  # of its range
START = 50  # a line through this part of a run tells the temperature that it starts from
NOISE_ALONE = 5.0  # standard deviations up to which a first row is off by its noise
TOLERATED = ("constant_channel", "repeated_rows", "stuck_recorder")  # of a typed or stepped load


@dataclass(frozen=True, eq=False)
class CalibrationRun:
    """One run as the regression reads it; arrays (N,).

    `voltage` V. `torque`: the reference, Nm; zeros where the run is without load. `temperature`:
    °C, or None. `loaded`: whether a reference was recorded. `starts`: true on the first row and
    behind each gap. `contrast`: (R - 1,), row of the run in columns that let each of R runs have
    its own zero, see `calibration/thermal.py`; read by shapes with such columns alone. `spiked`:
    channels of which single rows leap.
    """

    log: Log
    voltage: Array
    torque: Array
    temperature: Array | None
    loaded: bool
    starts: NDArray[np.bool_]
    contrast: Array = field(default_factory=lambda: np.zeros(0))
    spiked: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.voltage)

    @cached_property
    def temperature_of_body(self) -> Array | None:
        """The temperature, (N,), with the first row as the rows behind it tell it.

        A body that lags starts from the first row and keeps its noise for as long as the lag: one
        error that many rows have, and no standard error holds. Where the first row is off by more
        than noise, as behind a step, it stays.
        """
        if self.temperature is None:
            return None
        noise = white_noise(self.temperature)
        gaps = np.flatnonzero(self.starts[1:]) + 1
        count = min([max(len(self) // START, LEAST_ROWS), len(self), *gaps[:1]])
        if not noise > 0.0 or count < LEAST_ROWS:
            return self.temperature
        time = self.log["time"][:count] - self.log["time"][0]
        start = float(np.polyfit(time, self.temperature[:count], 1)[1])
        if not abs(self.temperature[0] - start) <= NOISE_ALONE * noise:
            return self.temperature
        return np.concatenate([[start], self.temperature[1:]])


def calibration_runs(
    logs: Sequence[Log],
    reference: str | None,
    thermistor: Thermistor | None,
    *,
    temperature_needed: bool,
) -> tuple[list[CalibrationRun], list[str]]:
    """Return the runs and sentences on what is strange in them.

    Parameters
    ----------
    reference : channel with the trusted torque, Nm; None for runs that are all without load.
    thermistor : for logs with `thermistor_voltage` and no `temperature`.
    temperature_needed : refuse logs without temperature.

    Raises
    ------
    InputError
        For a channel that is missing, not finite or saturated.
    """
    _require_reference(logs, reference)
    runs, said = [], []
    for log in logs:
        run, warnings = _run(log, reference, thermistor, temperature_needed)
        runs.append(run)
        said += warnings
    if all(np.all(run.voltage == runs[0].voltage[0]) for run in runs):
        raise InputError(
            f"{VOLTAGE} is {runs[0].voltage[0]:.6g} V in every row of all runs; check the wiring "
            "and the column map"
        )
    _require_measurable(runs)
    for run in runs:
        _require_another_sensor(run, str(reference))
    rows = contrasts(len(runs))
    runs = [replace(run, contrast=row) for run, row in zip(runs, rows, strict=True)]
    return runs, [*said, *_strange(runs)]


def _require_measurable(runs: Sequence[CalibrationRun]) -> None:
    """Refuse what is below the noise of all bridges and torque sensors, but not zero."""
    span = max(float(run.voltage.max()) for run in runs) - min(
        float(run.voltage.min()) for run in runs
    )
    if span < LEAST_SPAN:
        raise InputError(
            f"{VOLTAGE} spans only {span:.2g} V in all runs, less than the noise of any bridge; "
            "check the column map and its units"
        )
    load = max(float(np.abs(run.torque).max()) for run in runs)
    if 0.0 < load < LEAST_TORQUE:
        raise InputError(
            f"the reference reaches {load:.2g} Nm in all runs, less than any torque sensor reads; "
            "check the column map and its units, or give reference=None (--reference none) where "
            "all runs are without load"
        )


def _require_another_sensor(run: CalibrationRun, reference: str) -> None:
    """Refuse a reference that is the voltage itself, or was computed from it."""
    if not np.ptp(run.torque) > 0.0 or not np.ptp(run.voltage) > 0.0 or len(run) < LEAST_ROWS:
        return
    volts, torque = run.voltage - run.voltage.mean(), run.torque - run.torque.mean()
    slope = float(volts @ torque) / float(volts @ volts)
    if float(np.abs(torque - slope * volts).max()) > SAME * float(np.ptp(torque)):
        return
    raise InputError(
        f"log '{run.log.name}': {reference} is {VOLTAGE} times {slope:.6g} Nm/V in every row, to a "
        "millionth of its range, so that it is no measurement of its own: the same column was "
        f"mapped twice, or the reference computed from the voltage; map the reference sensor to "
        f"{reference}"
    )


def contrasts(count: int) -> Array:
    """(count, count - 1), rows that sum to zero: the constant beside them is the mean of all."""
    return np.vstack([np.eye(count - 1), np.full((1, count - 1), -1.0)])


def _require_reference(logs: Sequence[Log], reference: str | None) -> None:
    if reference is None or any(reference in log for log in logs):
        return
    if reference not in CHANNELS:
        raise InputError(
            f"reference '{reference}' is no channel of a log{did_you_mean(reference, CHANNELS)}; "
            f"the channels are {listed(CHANNELS)}"
        )
    raise InputError(
        f"no run has the channel '{reference}'; map the reference sensor to it, or give "
        "reference=None (--reference none) where all runs are without load: then the drift alone "
        "is fitted"
    )


def _run(
    log: Log, reference: str | None, thermistor: Thermistor | None, temperature_needed: bool
) -> tuple[CalibrationRun, list[str]]:
    if VOLTAGE not in log:
        raise InputError(
            f"log '{log.name}': no channel '{VOLTAGE}'; map the bridge's voltage to it; it has "
            f"{listed(log.channels)}"
        )
    voltage = log[VOLTAGE]
    loaded = reference is not None and reference in log
    names = ["time", VOLTAGE, *([str(reference)] if loaded else [])]
    warmth = next((n for n in ("temperature", "thermistor_voltage") if n in log), None)
    names += [warmth] if warmth else []
    used = Log({n: log[n] for n in names}, log.facts, log.history, log.source)
    said, spiked = _checked(used, reference if loaded else None)
    if reference is not None and not loaded:
        said.append(f"{log.name}: has no {reference} and is taken to be without load")
    starts = np.zeros(len(log), dtype=bool)
    starts[unbroken(log["time"])[:, 0]] = True
    torque = log[str(reference)] if loaded else np.zeros(len(log))
    temperature = _temperature(log, warmth, thermistor, temperature_needed)
    hot = temperature is not None and float(temperature.max()) > WARMEST
    if hot and warmth == "thermistor_voltage":  # a column has what `check` says of it
        said.append(f"{log.name}: its thermistor reads above {WARMEST:g} °C: check its constants")
    run = CalibrationRun(log, voltage, torque, temperature, loaded, starts, spiked=spiked)
    return run, said


def _checked(used: Log, reference: str | None) -> tuple[list[str], tuple[str, ...]]:
    """Refuse what makes a calibration meaningless.

    Returns the other faults as sentences, and the channels of which single rows leap.
    """
    _require_possible(used)
    findings = check(used)
    findings.raise_errors()
    clipped = [f for f in findings.named("clipped_channel") if f.channel == VOLTAGE]
    stands = np.isin(used[VOLTAGE], [finding.size for finding in clipped])
    for finding in clipped:
        if _is_saturated(used, finding, reference, stands):
            raise InputError(_saturated(used, finding))
    leaping = findings.named("spikes")
    said = [_spiked(used, finding) for finding in leaping]
    said += [
        f"{used.name}: {finding.sentence} {finding.remedy}".rstrip()
        for finding in findings.faults
        if finding.name not in (*TOLERATED, "clipped_channel", "spikes")
    ]
    return said, tuple(finding.channel for finding in leaping)


def _spiked(log: Log, finding: Finding) -> str:
    """What single rows that leap make of a calibration: one of 20 times the range is its line."""
    channel = finding.channel
    rows = spikes(log["time"], log[channel])
    largest = rows[np.argmax(np.abs(log[channel][rows] - np.median(log[channel])))]
    return (
        f"{log.name}: {channel} leaps in {len(rows)} single row{'s' if len(rows) > 1 else ''} "
        f"({listed(rows, 5)}), to {log[channel][largest]:.4g} {CHANNELS[channel].unit} in row "
        f"{largest}: what reads or sends it fails, and all that is said of line, zero, gain and "
        f"drift may come of these rows; ask for the repair drop_spikes={channel}"
    )


def _require_possible(log: Log) -> None:
    """Refuse numbers that no instrument reads: an overload, an open thermocouple, another unit.

    A temperature may step between settled levels, but not leap for one row and come back.
    """
    for channel in (name for name in log.channels if name != "time"):
        low, high = limits_of(channel)
        values = log[channel]
        bad = (values < low) | (values > high)
        if channel == "temperature" and len(log) > 2:
            bad[1:-1] |= np.abs(values - medfilt(values, 3))[1:-1] > MOST_LEAP
        rows = np.flatnonzero(bad)
        if len(rows):
            said = f"{values[rows[0]]:.4g} {CHANNELS[channel].unit}"
            raise InputError(
                f"log '{log.name}': {channel} is {said} in row {rows[0]}, which cannot be (rows of "
                f"this kind: {len(rows)}): an overload, a broken connection or another unit; leave "
                "such rows out (log.rows) or correct the recording"
            )


def _is_saturated(
    log: Log, finding: Finding, reference: str | None, stands: NDArray[np.bool_]
) -> bool:
    """Whether the voltage would go on where it stands.

    By the line through the rows in which it stands (N,) at no limit, where the reference moves: a
    plateau that a coarse converter reads as one number lies on the line, a limit does not, and at
    two limits the rows of one would bend the line that the other is held against. Without a
    reference a voltage that is noisy elsewhere and not coarse stands for no other reason.
    """
    values = log[finding.channel]
    at = values == finding.size
    if reference is None or _lost(log[reference]):
        return white_noise(values) > quantum(values)
    slope, level = np.polyfit(log[reference][~stands], values[~stands], 1)
    left = values - level - slope * log[reference]
    beyond = abs(float(left[at].mean()))
    return beyond > BEYOND * float(left[~stands].std()) + LEAST_BEYOND * float(np.ptp(values))


def _lost(torque: Array) -> bool:
    """Whether a reference is lost in its own noise."""
    variance = float(np.var(torque))
    return not (variance > 0.0 and white_noise(torque) ** 2 <= LOST_IN_NOISE * variance)


def _saturated(log: Log, finding: Finding) -> str:
    count = int(np.count_nonzero(log[finding.channel] == finding.size))
    return (
        f"log '{log.name}': {finding.channel} stays at exactly {finding.size:.6g} V in {count} "
        f"rows, first in row {finding.rows[0]}: the converter is saturated there; leave these rows "
        "out (log.rows) or record with less gain"
    )


def _temperature(
    log: Log, channel: str | None, thermistor: Thermistor | None, needed: bool
) -> Array | None:
    if channel == "temperature":
        return log["temperature"]
    if channel is not None and thermistor is not None:
        return _from_divider(log, thermistor)
    if not needed:
        return None
    if channel is None:
        raise InputError(
            f"log '{log.name}': no channel 'temperature' (or 'thermistor_voltage'); record it, or "
            "give degree=0 (--degree 0) to calibrate without temperature"
        )
    raise InputError(
        f"log '{log.name}': thermistor_voltage needs the constants of the divider; give thermistor "
        "(--thermistor SUPPLY:DIVIDER:NOMINAL:BETA, in V, Ω, Ω, K)"
    )


def _from_divider(log: Log, thermistor: Thermistor) -> Array:
    """(6), (7): temperature from the divider's voltage, °C."""
    found = np.asarray(
        _core.thermistor_temperature(log["thermistor_voltage"], **thermistor.to_json())
    )
    bad = np.flatnonzero(~np.isfinite(found))
    if len(bad):
        raise InputError(
            f"log '{log.name}': thermistor_voltage is no voltage of a divider at "
            f"{thermistor.supply_voltage:g} V in {len(bad)} rows, first in row {bad[0]} "
            f"({log['thermistor_voltage'][bad[0]]:.4g} V): open or short circuit, or another "
            "supply; correct the recording or the constants"
        )
    return found


def _strange(runs: Sequence[CalibrationRun]) -> list[str]:
    said = []
    high = max(float(np.abs(run.voltage).max()) for run in runs)
    span = max(float(np.ptp(run.voltage)) for run in runs)
    if high > MOST_VOLTS:
        said.append(
            f"sensor_voltage reaches {high:.4g} V: if the column is in mV, say so in the column "
            "map; the sensitivity is a thousand times too small otherwise"
        )
    elif span < LEAST_VOLTS:
        said.append(
            f"sensor_voltage spans only {span:.2g} V: if the column is in mV or kV, say so in the "
            "column map"
        )
    load = max(float(np.abs(run.torque).max()) for run in runs)
    if load > MOST_TORQUE:
        said.append(
            f"the reference reaches {load:.4g} Nm, more than strain wave gears bear: if the "
            "column is in mNm, say so in the column map"
        )
    return said


def why_unexcited(runs: Sequence[CalibrationRun]) -> str:
    """Return why the reference says nothing of the sensitivity; "" where it may."""
    loaded = [run.torque for run in runs if run.loaded]
    if not loaded:
        return "the runs are without load"
    variance = float(np.var(np.concatenate(loaded)))
    noise = max(white_noise(torque) for torque in loaded)
    level = float(np.mean(np.concatenate(loaded)))
    if variance > 0.0 and noise**2 <= LOST_IN_NOISE * variance:
        return ""
    if abs(level) <= 5.0 * max(noise, LEAST_LEVEL):
        return "the reference never leaves zero"
    return f"the reference stays at {level:.4g} Nm"
