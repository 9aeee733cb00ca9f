"""Faults of the data, looked for before any physics, and how much each of them matters.

A fault of size r [target's unit, RMS] beside a noise floor σ raises the error from σ to √(σ² + r²).
One that raises it by less than a hundredth is worth knowing, and no reason to reject a name.

    delay of a velocity          r: prediction with the velocity as recorded less with the right one
    rows that repeat others      r: each is wrong by one step of the target, √(share · mean step²)

What another fault makes of the target is not known, and it counts as grave. Where the rows read a
velocity that is derived from a position, the recorded one has made nothing of what is found: it
matters to whoever reads it, and the sentence says so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.settings import SETTINGS
from flexspline.effects import Effect
from flexspline.errors import InputError
from flexspline.formatting.numbers import short
from flexspline.least_squares.problem import (
    Problem,
    away_from_ends,
    coarser,
    resolved_rows,
    with_fastest,
)
from flexspline.least_squares.result import Fit
from flexspline.logs.checks import check
from flexspline.logs.checks.consistency import TOLD, Gear, measured_gear
from flexspline.logs.checks.findings import NO_TORSION, Finding
from flexspline.logs.log import Log
from flexspline.logs.repairs import move_earlier
from flexspline.logs.segments import median_step
from flexspline.model import Model
from flexspline.regression.gram import TINY, Whitening
from flexspline.regression.working import started, working
from flexspline.signals import target_of

__all__ = [
    "DataFault",
    "away_from_ends",
    "coarser",
    "data_faults",
    "graded",
    "resolved",
    "with_measured_ratio",
]


def resolved(
    base: Sequence[Effect],
    fixed: Mapping[str, float],
    posed: Callable[[Sequence[Effect], bool], Problem],
) -> tuple[list[NDArray[np.bool_]], list[Array]]:
    """Return which rows of each run count, and by how much a prediction moves, (N,) both.

    Parameters
    ----------
    posed : makes the problem of effects, with the motion as it is prepared or smoothed further.
    """
    effects = with_fastest(base)
    fine, coarse = posed(effects, False), posed(effects, True)
    plain = Whitening(np.ones(1), 1.0, fine.decimation)
    work, _ = started(fine, working(effects, len(effects), fixed), plain)
    both = [(work.predict(fine, k), work.predict(coarse, k)) for k in range(len(fine.runs))]
    runs = fine.runs
    told = resolved_rows([run.log for run in runs], [run.target for run in runs], both)
    return told, [np.nan_to_num(one - other) for one, other in both]


RATIO = "gear_ratio"
ENCODER_DELAY = "encoder_delay"
HALF_A_ROW = 0.5  # more than that a run may be late by alone: another clock
SIGN = "torque_sign"  # this and a small delay are a recorder's where half of the runs show them
NO_TWIST = tuple(name for name in NO_TORSION if name != RATIO)


@dataclass(frozen=True)
class DataFault:
    """A fault of one run: `name` of the check, channel, size in `unit`, rows [first, last).

    `makes`: RMS of what it makes of the target, in its unit, None where that is not known. `grave`:
    whether it matters beside the noise floor (`graded`). `left_out`: these rows were left out of
    all that follows.
    """

    run: str
    name: str
    channel: str
    size: float
    unit: str
    rows: tuple[int, int]
    sentence: str
    makes: float | None = None
    grave: bool = True
    left_out: bool = False

    @classmethod
    def of(cls, run: str, found: Finding, sentence: str, **more: bool) -> DataFault:
        """What a check has found in a run, in these words."""
        return cls(
            run, found.name, found.channel, found.size, found.unit, found.rows, sentence, **more
        )  # fmt: skip


def data_faults(
    logs: Sequence[Log],
    base: Sequence[Effect],
    target: str,
    known_load: str | None,
    threads: int = 1,
) -> tuple[DataFault, ...]:
    """Return the faults of all runs.

    Raises
    ------
    InputError
        Where a fault makes every fit meaningless. A ratio that the encoders contradict does not:
        they show the right one, see `with_measured_ratio`.
    """
    elsewhere = known_load not in (None, "reference_torque")
    asked = [e.name for e in base if not (elsewhere and "load" in e.reads)]
    found = []
    for log in logs:
        findings = check(log, effects=asked, target=target, threads=threads)
        findings.raise_errors()
        if target == "torsion":
            findings.raise_named(NO_TWIST)
        found += [
            DataFault.of(log.name, f, f"{log.name}: {f.sentence} {f.remedy}".rstrip())
            for f in findings.faults
        ]
    late = {f.run for f in found if f.name == ENCODER_DELAY}
    if late:
        gears = {log.name: gear for log in logs if (gear := measured_gear(log)) is not None}
        if 2 * len(late) < len(logs) or not _late_alike([*gears.values()]):
            row = {log.name: median_step(log["time"]) for log in logs}
            found = [f for f in found if f.name != ENCODER_DELAY
                     or _least_delay(gears[f.run]) > HALF_A_ROW * row[f.run]]  # fmt: skip
    flipped = Counter(f.channel for f in found if f.name == SIGN)
    rare = [channel for channel, runs in flipped.items() if 2 * runs < len(logs)]
    return tuple(f for f in found if not (f.name == SIGN and f.channel in rare))


def _least_delay(gear: Gear) -> float:
    """What an encoder is late by at least, s, whatever its error."""
    return abs(gear.delay) - TOLD * gear.delay_error


def _late_alike(gears: Sequence[Gear]) -> bool:
    """Whether one encoder is late by the same in all runs, as a recorder makes it.

    A part of a row that differs from run to run is torsion that comes round with the motion: the
    scatter of the runs is part of the error of their mean.
    """
    if len(gears) < 2:
        return True
    delay = np.array([gear.delay for gear in gears])
    weight = np.array([max(gear.delay_error, TINY) for gear in gears]) ** -2.0
    mean = np.average(delay, weights=weight)
    scatter = np.average((delay - mean) ** 2, weights=weight) / (len(delay) - 1)
    return bool(abs(mean) > TOLD * np.sqrt(max(1.0 / weight.sum(), scatter)))


def with_measured_ratio(
    logs: Sequence[Log], faults: Sequence[DataFault], target: str
) -> tuple[list[Log], tuple[DataFault, ...]]:
    """Return the runs with the ratio that their encoders show, where a torsion would be nothing.

    With a wrong ratio q Ñ − θ grows with every turn, and all that could be found is the ratio. The
    fault's sentence then says which one is used instead. A ratio that is off by a little, and is no
    whole number, may be a torsion that follows the angle: the one that was stated stays.
    """
    shown = [fault.size for fault in faults if fault.name == RATIO]
    stated = logs[0].effective_ratio
    if target != "torsion" or not shown or stated is None:
        return list(logs), tuple(faults)
    ratio = float(np.median(shown))
    near = abs(ratio / stated - 1.0) < SETTINGS.negligible
    if near and abs(ratio - round(ratio)) > SETTINGS.bends:
        return list(logs), tuple(faults)
    circular = logs[0].facts.get("output_spline") == "circular"
    said = f"What follows is with {ratio:.5g} turns of the motor side per turn of the output."
    mended = [log.with_facts({"gear_ratio": ratio - circular}, note=said) for log in logs]
    told = [replace(f, sentence=f"{f.sentence} {said}") if f.name == RATIO else f for f in faults]
    return mended, tuple(told)


Array = NDArray[np.float64]

VELOCITY = "output_velocity"


def graded(
    faults: Sequence[DataFault], logs: Sequence[Log], fit: Fit, floor: float
) -> tuple[DataFault, ...]:
    """Return the faults with what each makes of the target, and whether that matters.

    Parameters
    ----------
    logs : the runs as recorded, the rows that count.
    fit : of the extended model.
    floor : noise floor, in the unit of the target.
    """
    look = _Look(tuple(logs), fit, floor)
    return tuple(look.graded(fault) for fault in faults)


@dataclass(frozen=True)
class _Look:
    logs: tuple[Log, ...]
    fit: Fit
    floor: float

    def graded(self, fault: DataFault) -> DataFault:
        try:
            makes = self._makes(fault)
        except InputError:  # where the fault cannot be taken off, its size is not known
            makes = None
        if makes is None or not np.isfinite(makes):
            return fault
        grave = bool(np.hypot(self.floor, makes) > (1.0 + SETTINGS.negligible) * self.floor)
        unit, source = self.fit.unit, self._read_instead(fault)
        said = f"It makes {short(makes)} {unit} RMS, the noise floor is {short(self.floor)} {unit}"
        said += "." if grave else ": too little to matter."
        if source:
            said = (
                f"Names are looked for with a velocity derived from {source}; as recorded it makes "
                f"{short(makes)} {unit} RMS, the noise floor is {short(self.floor)} {unit}."
            )
        return replace(fault, makes=makes, grave=grave, sentence=f"{fault.sentence} {said}")

    def _read_instead(self, fault: DataFault) -> str:
        """The position that a velocity is derived from where a fault is one of the velocity's."""
        sources = {p.channel: p.source for p in self.fit.part.preparations}
        source = sources.get(VELOCITY, VELOCITY)
        return source if fault.channel == VELOCITY and source != VELOCITY else ""

    def _makes(self, fault: DataFault) -> float | None:
        own = [log for log in self.logs if log.name == fault.run]
        if len(own) != 1:
            return None
        log = own[0]
        if fault.name == "velocity_delay" and fault.channel == VELOCITY:
            return self._moved(log, move_earlier(log, VELOCITY, fault.size))
        if fault.name == "repeated_rows":
            steps = np.diff(target_of(log, self.fit.target, self.fit.part.known_load))
            return float(np.sqrt(fault.size / len(log) * np.mean(steps**2)))
        return None

    def _moved(self, log: Log, mended: Log) -> float:
        """RMS by which the prediction changes with a mended channel, on the rows that both have."""
        both = [self._predicted(one) for one in (log, mended)]
        _, first, second = np.intersect1d(log["time"], mended["time"], return_indices=True)
        return float(np.sqrt(np.nanmean((both[0][first] - both[1][second]) ** 2)))

    def _predicted(self, log: Log) -> Array:
        """The prediction with the channels as they are, low-passed as the fit's rows were."""
        part = self.fit.part
        record = {name: value for name, value in part.record.items() if name != "prepared"}
        plain: Model = self.fit.model.with_part(replace(part, record=record), {})
        return plain.predict(log, part.target, lowpass_hz=self.fit.lowpass).predicted
