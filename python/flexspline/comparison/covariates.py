"""What a disagreement may depend on, each as bins, and as cells: a bin in one direction.

A mean over both directions would hide friction, which changes its sign with the direction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.edges import even_edges, growing_edges, in_bins, labels_of
from flexspline.comparison.rows import Rows
from flexspline.comparison.runs import Compared, ComparedRun
from flexspline.logs.segments import since_reversal

__all__ = ["DIRECTIONS", "Covariate", "covariates_of"]

Array = NDArray[np.float64]
Cells = NDArray[np.int16] | NDArray[np.int32]

DIRECTIONS = ("at rest", "forward", "backward")
ANGLE_BINS = 24
EVEN_BINS = 10
COARSE = 4
FIRST_SINCE = 1e-3  # of the longest way since a reversal: the first edge
_LEAST_SHARE, _LEAST_ROWS = 0.002, 30
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Covariate:
    """One thing that rows are sorted by.

    Parameters
    ----------
    name : key in `comparison.json`; `words` in sentences; `unit` of the edges.
    edges : (bins + 1,), or None for kinds.
    labels : what each bin is called.
    cells : (N,), cell of each row, -1 where the row has none.
    bin_of : (cells,), bin of each cell. `direction_of`: its direction, -1 where it has none.
    shown : whether it is a line of the result; others only clean the noise floor.
    """

    name: str
    words: str
    unit: str
    edges: Array | None
    labels: tuple[str, ...]
    cells: Cells
    bin_of: NDArray[np.intp]
    direction_of: NDArray[np.intp]
    shown: bool = True

    @property
    def count(self) -> int:
        """How many cells there are."""
        return len(self.bin_of)

    def bins(self, per_cell: Array) -> Array:
        """Add up what cells have, (cells,), for each bin."""
        made = np.bincount(self.bin_of, weights=per_cell, minlength=len(self.labels))
        return np.asarray(made, dtype=np.float64)


def covariates_of(compared: Compared, rows: Rows) -> list[Covariate]:
    """Return what the channels of all runs allow, the simplest first."""
    least = max(_LEAST_ROWS, round(_LEAST_SHARE * len(rows)))
    found = list(_found(compared, rows, least))
    known = {covariate.name: covariate for covariate in found}
    for first, second in (("speed", "load"), ("speed", "temperature"), ("speed", "position")):
        if first in known and second in known:
            found.append(_together(known[first], known[second], rows))
    return [covariate for covariate in found if len(covariate.labels) > 1 or
            covariate.name == "offset"]  # fmt: skip


def _found(compared: Compared, rows: Rows, least: int) -> Iterator[Covariate]:
    yield _kinds("offset", "everywhere", ("all rows",), np.zeros(len(rows), np.int16), shown=False)
    if all("output_velocity" in run.log for run in compared.runs):
        yield _kinds("direction", "direction", DIRECTIONS, rows.direction.astype(np.int16))
        speed = rows.column(compared, lambda run, k: np.abs(run.log["output_velocity"]))
        yield _split(
            "speed",
            "speed",
            "rad/s",
            speed,
            growing_edges(speed, least, max(rows.still)),
            rows.direction,
        )
    yield from _conditions(compared, rows, least)
    yield from _place(compared, rows, least)
    yield from _history(compared, rows, least)


def _conditions(compared: Compared, rows: Rows, least: int) -> Iterator[Covariate]:
    if all(run.load is not None for run in compared.runs):
        load = rows.column(compared, lambda run, k: np.asarray(run.load))
        own = compared.load_source.startswith("the model")
        unit = compared.load_unit if own else "Nm"
        edges = even_edges(load, least, EVEN_BINS)
        yield _split("load", "load", unit, load, edges, rows.direction)
    for name in ("temperature", "motor_temperature"):
        if all(name in run.log for run in compared.runs):
            values = rows.column(compared, partial(_channel, name=name))
            edges = even_edges(values, least, EVEN_BINS)
            yield _split(name, name.replace("_", " "), "°C", values, edges, rows.direction)


def _place(compared: Compared, rows: Rows, least: int) -> Iterator[Covariate]:
    if all("output_position" in run.log for run in compared.runs):
        angle = rows.column(compared, lambda run, k: run.log["output_position"])
        whole = bool(np.ptp(angle[np.isfinite(angle)]) > 1.02 * _TURN)
        edges = np.linspace(0.0, _TURN, ANGLE_BINS + 1) if whole else even_edges(
            angle, least, ANGLE_BINS
        )  # fmt: skip
        angle = np.mod(angle, _TURN) if whole else angle
        yield _split("position", "output angle", "rad", angle, edges, rows.direction)
    if all("output_acceleration" in run.log for run in compared.runs):
        values = rows.column(compared, lambda run, k: run.log["output_acceleration"])
        edges = even_edges(values, least, EVEN_BINS)
        yield _split("acceleration", "acceleration", "rad/s²", values, edges, rows.direction)


def _history(compared: Compared, rows: Rows, least: int) -> Iterator[Covariate]:
    channels = ("output_position", "output_velocity")
    if all(c in run.log for run in compared.runs for c in channels):

        def since(run: ComparedRun, number: int) -> Array:
            log = run.log
            made = since_reversal(log["time"], log["output_position"], log["output_velocity"],
                                  rows.slow[number])  # fmt: skip
            return np.column_stack(made)

        parts = zip(compared.runs, rows.counts, strict=True)
        table = np.concatenate([since(run, k)[keep] for k, (run, keep) in enumerate(parts)])
        kept = np.where(table[:, 2] > 0, 1, 2)
        for name, words, unit, values in (
            ("reversal_angle", "angle since the last reversal", "rad", table[:, 1]),
            ("reversal_time", "time since the last reversal", "s", table[:, 0]),
        ):
            if np.isfinite(values).any():
                first = FIRST_SINCE * float(np.nanmax(values))
                edges = growing_edges(values, least, first)
                yield _split(name, words, unit, values, edges, kept)
    time = rows.column(compared, lambda run, k: run.log["time"] - run.log["time"][0])
    yield _by_run("time", time, even_edges(time, least, EVEN_BINS), rows, len(compared.runs))
    if len(compared.runs) > 1:
        names = tuple(run.log.name for run in compared.runs)
        yield _kinds("run", "run", names, rows.run)


def _channel(run: ComparedRun, number: int, *, name: str) -> Array:
    return run.log[name]


def _packed(cells: NDArray[np.integer]) -> Cells:
    """The cells in as few bytes as hold them, with room for one more."""
    few = int(cells.max(initial=0)) < np.iinfo(np.int16).max - 1
    return cells.astype(np.int16) if few else cells.astype(np.int32)


def _kinds(
    name: str, words: str, labels: tuple[str, ...], cells: Cells, *, shown: bool = True
) -> Covariate:
    each = np.arange(len(labels))
    none = np.full(len(labels), -1)
    return Covariate(name, words, "", None, labels, cells, each, none, shown)


def _split(
    name: str, words: str, unit: str, values: Array, edges: Array, direction: NDArray[np.integer]
) -> Covariate:
    """Cells of every bin in every direction."""
    place = in_bins(values, edges)
    cells = _packed(np.where(place < 0, -1, 3 * place + direction))
    number = np.arange(3 * (len(edges) - 1))
    return Covariate(name, words, unit, edges, labels_of(edges, unit), cells, number // 3,
                     number % 3)  # fmt: skip


def _by_run(name: str, time: Array, edges: Array, rows: Rows, runs: int) -> Covariate:
    """Cells of every bin in every run: a drift of one run is not that of another."""
    place, count = in_bins(time, edges), len(edges) - 1
    cells = _packed(np.where(place < 0, -1, rows.run * count + place))
    number = np.arange(runs * count)
    return Covariate(name, "time", "s", edges, labels_of(edges, "s"), cells, number % count,
                     np.full(runs * count, -1))  # fmt: skip


def _together(first: Covariate, second: Covariate, rows: Rows) -> Covariate:
    """Cells of two covariates at once, the first in few bins: repeated states."""
    size = -(-len(first.labels) // COARSE)
    coarse = np.where(first.cells < 0, -1, first.bin_of[first.cells] // size)
    few = int(coarse.max()) + 1
    both = (coarse >= 0) & (second.cells >= 0)
    cells = _packed(np.where(both, coarse * np.int32(second.count) + second.cells, -1))
    number = np.arange(few * second.count)
    words = f"{first.words} and {second.words} together"
    return Covariate(f"{first.name} and {second.name}", words, "", None, ("",) * 2, cells,
                     np.zeros(len(number), np.intp), second.direction_of[number % second.count],
                     False)  # fmt: skip
