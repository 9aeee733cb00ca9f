"""What a simulation says, brought onto the clock of each run.

A column of the runs is there already. A file of its own has its own time stamps, of the same
clock: between its rows it is a straight line, and outside its span and in its gaps it says nothing.
Rows where it says nothing are left out and counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.logs.checks.findings import Finding
from flexspline.logs.columns import picked
from flexspline.logs.derive import has_value, increasing_time
from flexspline.logs.formats import Dialect, read_table
from flexspline.logs.log import Log
from flexspline.signals import target_of
from flexspline.simulator.delay import late
from flexspline.simulator.record import SIMULATED, Simulated, SimulatedFile

__all__ = [
    "Remark",
    "TakenSimulation",
    "covered",
    "onto_clock",
    "paired",
    "take",
    "with_simulation",
]

Array = NDArray[np.float64]

LEAST_COVERED = 0.5
"""Share of a run's rows of which a simulation has to say something: with less it is of another run
or clock. Half or twice this changes what is refused, and no result."""

TARGETS = ("sensor_torque", "motor_torque", "motor_current")


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
    simulation: Log | Sequence[Log] | None,
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


def paired(logs: Sequence[Log], simulation: Log | Sequence[Log]) -> list[Log]:
    """Return the simulation's logs, one for each run."""
    files = [simulation] if isinstance(simulation, Log) else list(simulation)
    if len(files) != len(logs):
        raise InputError(
            f"there are {len(logs)} runs and {len(files)} files of a simulation; give one file for "
            "each run, in the order of the runs"
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
