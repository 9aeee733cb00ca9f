"""A foreign simulation as the base: its values at the rows of the runs, and its delay.

    y = what the simulation says + what it lacks

`Simulated` is the record that a model keeps of it. `comparison` makes it the base.

A column of the runs needs no alignment. A file of its own has its own time stamps, of the same
clock: it is interpolated linearly between its rows, and has no values outside its span and in its
gaps. Rows without a value are left out and counted.

The delay of the measured value y behind the simulated one s:

    y(t) = s(t − D) + N(t) c        D minimises the sum of squares, c solved for each D

N holds what a simulation may lack and what looks like a delay at one frequency: a constant,
tanh(v / v_d), v, q̈, sin q, cos q, the known torque, |s| tanh(v / v_d), and friction that builds up
over an angle behind a reversal (presliding: late by an angle, not by a time). The error of D is of
sixteen blocks of time, as in `logs/checks/consistency.py`. D is reported and never corrected.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.formatting import plus_minus
from flexspline.logs.checks.consistency import MOST_ROWS, SURE, WITHIN, block_error, motion_columns
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.samples import Motion, motion_of
from flexspline.logs.columns import picked
from flexspline.logs.derive import has_value, increasing_time
from flexspline.logs.formats import Dialect, read_table
from flexspline.logs.log import Log
from flexspline.logs.read import LogLike, as_logs
from flexspline.logs.segments import median_step, since_reversal
from flexspline.signals import target_of, torque_of_current

__all__ = [
    "SIMULATED",
    "SIMULATION_DELAY",
    "Remark",
    "Simulated",
    "SimulatedFile",
    "covered",
    "late",
    "onto_clock",
    "paired",
    "simulation_of",
    "take",
    "with_simulation",
]

Array = NDArray[np.float64]

LEAST_COVERED = 0.5
"""Share of a run's rows of which a simulation has to say something: with less it is of another run
or clock. Half or twice this changes what is refused, and no result."""

TARGETS = ("sensor_torque", "motor_torque", "motor_current")

SIMULATED = "simulated_torque"
"""The channel of a run that holds what the simulation says, in the target's unit, at the output."""

SIMULATION_DELAY = "simulation_delay"
"""The fault of a run whose measured values are late behind the simulated ones, or ahead of them."""

STEP = 0.005  # s, of the scan, as in the checks
LEFT = 0.5
"""Of the squares that no delay leaves: one that leaves more is not told from other things that a
simulation may lack. In simulated runs that lack one effect each, delays of 3 ms left 0.06 to 0.8 of
them, and delays that were none 0.6 to 0.98: half finds fewer, twice reports false ones."""
LEAST_ROWS = 200
WAYS = (0.005, 0.02, 0.08)  # rad behind a reversal: a factor of two moves no delay that is there


@dataclass(frozen=True)
class Remark:
    """What there is to say of the simulation of one run."""

    run: str
    finding: Finding

    @property
    def sentence(self) -> str:
        return f"{self.run}: {self.finding.sentence} {self.finding.remedy}".rstrip()


@dataclass(frozen=True)
class TakenSimulation:
    """Runs with the channel `SIMULATED`, what to keep of it, and what there is to say of it."""

    logs: tuple[Log, ...]
    simulated: Simulated
    remarks: tuple[Remark, ...]


def take(
    logs: Sequence[Log],
    target: str,
    known_load: str | None,
    simulation: LogLike | Sequence[LogLike] | None,
    column: str | None,
) -> TakenSimulation:
    """Bring what a simulation says of a target onto the clock of each run.

    Parameters
    ----------
    logs : the measured runs.
    target : sensor_torque, motor_torque (simulated: Nm at the output) or motor_current.
    known_load : channel that holds τ_load, or None. Whether the simulation holds it too is what
        leaves less of the measured values.
    simulation : one log for each run, in their order; None for a column of the runs.
    column : its name there. Of files by default `simulated_torque`, or else the target's channel.

    Raises
    ------
    InputError
        For a torsion, a column that is not there, files that are not one for each run or whose
        clock is another one, and runs of which the simulation says too little.
    """
    if target not in TARGETS:
        raise InputError(
            f"a simulated torque is compared with {listed(TARGETS)}; the target is {target}"
        )
    files = None if simulation is None else paired(logs, simulation)
    made, remarks, used = [], [], ""
    for number, log in enumerate(logs):
        other = None if files is None else files[number]
        log, used = with_simulation(log, target, other, column)
        log, said = covered(log, log[SIMULATED])
        made.append(log)
        remarks += [Remark(log.name, one) for one in said]
    own_files = files is not None
    holds = _holds_load(made, target, known_load)
    sources = [_file(log) for log in (logs if files is None else files)]
    simulated = Simulated(used, own_files, holds, tuple(sources))
    for log in made:
        measured = target_of(log, target, None if holds else known_load)
        found = late(log, measured, log[SIMULATED], f"measured {target}")
        remarks += [Remark(log.name, one) for one in found]
    return TakenSimulation(tuple(made), simulated, tuple(remarks))


def paired(logs: Sequence[Log], simulation: LogLike | Sequence[LogLike]) -> list[Log]:
    """Return the simulation's logs, one for each run."""
    files = as_logs(simulation)
    if len(files) != len(logs):
        raise InputError(
            "a simulation has one file for each run, in the order of the runs: runs are "
            f"{len(logs)}, its files {len(files)}; give as many"
        )
    return files


def with_simulation(
    log: Log, target: str, simulation: Log | None, column: str | None
) -> tuple[Log, str]:
    """Return a run with the channel `SIMULATED`, and the column that it is.

    Rows of which the simulation says nothing hold NaN.
    """
    holder = log if simulation is None else simulation
    used = column or _usual(holder, target)
    values = _column(holder, used)
    if used == target == "motor_torque":  # the channel of that name is at the motor's shaft
        values = values * (log.effective_ratio or 1.0)
    note = f"{SIMULATED} is column '{used}' of the run"
    if simulation is not None:
        values = onto_clock(log, simulation, values)
        digest = f" (SHA-256 {simulation.source.sha256})" if simulation.source else ""
        note = f"{SIMULATED} is column '{used}' of '{simulation.name}'{digest}, by its time stamps"
    return log.with_columns({SIMULATED: values}, note=note), used


def onto_clock(log: Log, simulation: Log, values: Array) -> Array:
    """Return values of a simulation at the times of a run, (N,); NaN where it has none."""
    time = increasing_time(simulation, "a simulation")
    at = log["time"]
    found = np.interp(at, time, values)
    found[~has_value(time, at)] = np.nan
    return found


def _usual(holder: Log, target: str) -> str:
    for name in (SIMULATED, target):
        if name in holder:
            return name
    raise InputError(
        f"log '{holder.name}': has neither {SIMULATED} nor {target}; name the simulated column"
    )


def _column(holder: Log, column: str) -> Array:
    """A channel of a log, or else a column of the file that it was read from."""
    if column in holder:
        return np.array(holder[column])
    if any(f"{SIMULATED} is column '{column}'" in said for said in holder.history):
        return np.array(holder[SIMULATED])
    source = holder.source
    if source is None:
        raise InputError(
            f"log '{holder.name}': no channel '{column}' for the simulated torque; it has "
            f"{listed(holder.channels)}"
        )
    table, origin = read_table(Path(source.path), None, Dialect())
    values = picked(table, {SIMULATED: column}).channels[SIMULATED]
    if origin is None or origin.sha256 != source.sha256 or len(values) != len(holder):
        raise InputError(
            f"log '{holder.name}': its rows are no longer those of {source.path}; read the column "
            f"with it: columns={{'{SIMULATED}': '{column}'}}"
        )
    return np.array(values)


def covered(log: Log, says: Array) -> tuple[Log, list[Finding]]:
    """Return the rows of which a simulation `says` (N,) something, and how many others there were.

    Raises
    ------
    InputError
        Where these are too many.
    """
    there = np.isfinite(says)
    left = int(np.count_nonzero(~there))
    if there.mean() < LEAST_COVERED:
        raise InputError(
            f"log '{log.name}': its simulation says nothing of {left} of {len(log)} rows; give the "
            "simulation of this run, with time stamps of the same clock"
        )
    if not left:
        return log, []
    rows = np.flatnonzero(~there)
    said = f"the simulation says nothing of {left} of {len(log)} rows; they are left out."
    span = (int(rows[0]), int(rows[-1]) + 1)
    found = Finding("simulation_span", "note", SIMULATED, span, float(left), "", said)
    return log.rows(there, note=f"{left} rows left out, of which the simulation says nothing"), [
        found
    ]


def _holds_load(logs: Sequence[Log], target: str, known_load: str | None) -> bool:
    """Whether the simulation is nearer to what is measured than to that without the load."""
    if known_load is None or not all(known_load in log for log in logs):
        return False
    with_load, without = (
        sum(float(np.nansum((target_of(log, target, load) - log[SIMULATED]) ** 2)) for log in logs)
        for load in (None, known_load)
    )
    return with_load < without


def _file(log: Log) -> SimulatedFile:
    return SimulatedFile(log.name, log.source.sha256 if log.source else None)


@dataclass(frozen=True)
class SimulatedFile:
    """The file that a simulated column was read from; no SHA-256 where it was made in memory."""

    name: str
    sha256: str | None


@dataclass(frozen=True)
class Simulated:
    """The simulation that a part corrects.

    Parameters
    ----------
    column : as it was named, of the runs or of the simulation's own files.
    own_files : whether it came in files of its own, not as a column of the runs.
    holds_load : whether it predicts the measured torque with the known load in it; otherwise it
        predicts y, without that load.
    files : those that the column was read from, in the order of the runs.
    """

    column: str
    own_files: bool
    holds_load: bool
    files: tuple[SimulatedFile, ...] = ()

    @property
    def words(self) -> str:
        """Where it comes from, such as "column 'mujoco' of the runs"."""
        return f"column '{self.column}' of {'its own files' if self.own_files else 'the runs'}"

    @property
    def asked(self) -> str:
        """What a command has to be given for it."""
        file = " --simulation FILE" if self.own_files else ""
        return f"give{file} --simulated-torque {self.column}"

    def to_json(self) -> dict[str, Any]:
        """Return it as `model.json` holds it."""
        return {
            "column": self.column,
            "own_files": self.own_files,
            "holds_load": self.holds_load,
            "files": [{"name": file.name, "sha256": file.sha256} for file in self.files],
        }

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Simulated:
        """Return what `to_json` wrote."""
        files = (SimulatedFile(one["name"], one["sha256"]) for one in content["files"])
        return cls(content["column"], content["own_files"], content["holds_load"], tuple(files))


def simulation_of(log: Log, target: str, simulated: Simulated, known_load: str | None) -> Array:
    """Return what the simulation says of y, (N,), in the target's unit.

    Raises
    ------
    InputError
        Where the run does not hold it.
    """
    if SIMULATED not in log:
        raise InputError(
            f"log '{log.name}': the model corrects what a simulation says ({simulated.words}), "
            f"which is not there; {simulated.asked}"
        )
    says = np.asarray(log[SIMULATED])
    if known_load is None or not simulated.holds_load:
        return says
    unit = torque_of_current(log, known_load) if target == "motor_current" else 1.0
    return np.asarray(says - log[known_load] / unit)


def late(log: Log, measured: Array, simulated: Array, what: str) -> Iterator[Finding]:
    """Say by how much measured values (N,) are late behind simulated ones, if they surely are."""
    motion = motion_of(log)
    if motion is None:
        return
    found = _delay(log, motion, measured, simulated)
    if found is None:
        return
    seconds, error = found
    way = "late behind" if seconds > 0.0 else "ahead of"
    yield Finding(
        SIMULATION_DELAY,
        "fault",
        SIMULATED,
        (0, len(log)),
        seconds,
        "s",
        f"the {what} is {plus_minus(1e3 * abs(seconds), 1e3 * error)} ms {way} the simulated one; "
        "that is reported and not taken away.",
        "If a clock or a filter makes it, align the time stamps and run again.",
    )


def _lacking(motion: Motion, columns: Array, says: Array) -> Array:
    """N: what a simulation may lack, (rows, K), behind the motion's low pass."""
    since = since_reversal(motion.time, motion.position, motion.velocity, 0.0)
    way = np.nan_to_num(since.angle, nan=np.inf)
    coming = [since.direction * np.exp(-way / width) for width in WAYS]
    late = motion.low_passed(np.column_stack(coming))
    return np.column_stack((columns, np.abs(says) * columns[:, 0], late, np.ones(len(says))))


def _delay(
    log: Log, motion: Motion, measured: Array, simulated: Array
) -> tuple[float, float] | None:
    """The delay and its standard error, s, where it is sure and matters."""
    from scipy.interpolate import CubicSpline
    from scipy.optimize import minimize_scalar

    reading, says = motion.smooth(measured), motion.smooth(simulated)
    beside = _lacking(motion, motion_columns(log, motion), says)
    step = median_step(motion.time)
    within = min(WITHIN, float(motion.time[-1] - motion.time[0]) / 8.0)
    rows = np.flatnonzero(motion.inside(within))
    rows = rows[:: max(1, rows.size // MOST_ROWS)]
    if rows.size < LEAST_ROWS or np.ptp(says) == 0.0:
        return None
    scale = np.sqrt(np.mean(beside[rows] ** 2, axis=0))
    basis = np.linalg.qr(beside[np.ix_(rows, scale > 0.0)] / scale[scale > 0.0])[0]
    curve, at = CubicSpline(motion.time, says), motion.time[rows]

    def rest(delay: float) -> Array:
        left = reading[rows] - curve(at - delay)
        return np.asarray(left - basis @ (basis.T @ left))

    def loss(delay: float) -> float:
        left = rest(delay)
        return float(left @ left)

    grid = np.linspace(-within, within, 2 * max(1, int(np.ceil(within / STEP))) + 1)
    start = float(grid[int(np.argmin([loss(delay) for delay in grid]))])
    spacing = float(grid[1] - grid[0])
    bounds = (max(start - spacing, -within), min(start + spacing, within))
    best = float(minimize_scalar(loss, bounds=bounds, method="bounded").x)
    tick = 0.1 * spacing
    slope = np.asarray(curve(at - best - tick) - curve(at - best)) / tick
    error = block_error(rest(best), slope, basis)
    sure = max(0.5 * step, SURE * error) < abs(best) < 0.98 * within
    matters = loss(best) < LEFT * loss(0.0)
    return (best, error) if sure and matters else None
