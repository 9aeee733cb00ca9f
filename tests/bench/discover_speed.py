"""Speed and memory of `discover` on an hour at 1 kHz, and of its screening against numpy.

    python tests/bench/discover_speed.py                    # the hour: 3.6 million rows
    python tests/bench/discover_speed.py --rows 4e5         # a short one
    python tests/bench/discover_speed.py --no-numpy         # without the comparison
    python tests/bench/discover_speed.py --small            # five runs of 4000 rows as well

Two numbers are taken. The whole of `discover`: seconds by stage, and how far the peak of the
process's memory lies above that before the call (with the log) and above that before the log was
made. And the screening alone: the products of all columns of the model and of all candidates,
filtered to white, fold by fold. numpy does the same with plain columns: the same rows from the same
core a column block at a time, scipy's lfilter, and X.T @ X, with as many BLAS threads as there are
cores; it does so on `--most` rows and is given the benefit of that rate (all rows would need
8 · columns bytes each).
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from typing import Any

os.environ["OPENBLAS_NUM_THREADS"] = os.environ.get("OPENBLAS_NUM_THREADS", str(os.cpu_count()))

import discover_log
import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

import flexspline
from flexspline.discovery import discovering
from flexspline.discovery.sheet import Sheet
from flexspline.discovery.study import Study, study_of
from flexspline.discovery.table import tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import working

Array = NDArray[np.float64]

CORES = os.cpu_count() or 1
CHUNK = 1 << 14  # rows of which numpy has all columns at once: best of 2¹² … 2¹⁷
NOISE = np.array([1.0, -0.8, 0.1, -0.05, 0.02])


def peak() -> float:
    """Largest memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def now() -> Array:
    """Seconds on the wall, and of all cores: a machine with other work on it shows in the first."""
    return np.array([time.perf_counter(), time.process_time()])


class Stages:
    """Stands for the progress bar: seconds between what is said."""

    def __init__(self, *_: Any, **__: Any) -> None:
        self.begun = now()
        self.said, self.seconds = "orders of the base", dict[str, Array]()

    def __enter__(self) -> Stages:
        Stages.last = self
        return self

    def __exit__(self, *_: object) -> None:
        self.set_description("end")

    def update(self) -> None:
        """Nothing to count."""

    def set_description(self, what: str) -> None:
        here = now()
        self.seconds[self.said] = self.seconds.get(self.said, 0.0) + here - self.begun
        self.begun, self.said = here, what

    last: Stages


def discovered(logs: list[flexspline.Log], threads: int, before_log: float) -> None:
    discovering.tqdm = Stages  # type: ignore[assignment,misc]
    before, begun = peak(), now()
    found = flexspline.discover(
        discover_log.BASE,
        logs,
        target=discover_log.TARGET,
        known_load=discover_log.LOAD,
        threads=threads,
    )
    seconds = now() - begun
    for stage, (wall, cores) in Stages.last.seconds.items():
        print(f"  {wall:7.2f} s  {cores:7.2f} s of all cores  {stage}")
    print(f"discover: {seconds[0]:.2f} s, {seconds[1]:.2f} s of all cores")
    print(f"peak memory: {peak():.0f} MB; {peak() - before:.0f} MB above that before the call, "
          f"{peak() - before_log:.0f} MB above that before the log")  # fmt: skip
    names = sorted(one.effect for one in found.found)
    print(f"hidden: {sorted(discover_log.HIDDEN)}; found: {names}")


def dictionary(study: Study) -> Sheet:
    effects = [flexspline.effect(name) for name in discover_log.BASE]
    begun = working(effects, len(effects), {})
    wanted = [e for c in study.candidates(effects) for e in c.effects]
    return begun.sheet(beside=list(dict.fromkeys(wanted)))


def by_numpy(study: Study, sheet: Sheet, rows: int) -> float:
    """Seconds of all cores for the same sums of the first `rows` rows with plain columns."""
    run, begun = study.problem.runs[0], time.process_time()
    channels = {name: values[:rows] for name, values in run.channels.items()}
    design = study.problem.design(sheet.effects)
    columns = np.column_stack([design.rows(channels, rows, sheet.load), run.target[:rows]])
    total = np.zeros((columns.shape[1],) * 2)
    for first in range(0, rows, CHUNK):
        part = columns[max(0, first - len(NOISE) + 1) : first + CHUNK]
        white = lfilter(NOISE, [1.0], part, axis=0)[len(NOISE) - 1 :]
        total += white.T @ white
    return time.process_time() - begun


def screened(log: flexspline.Log, threads: int, most: int) -> None:
    effects = [flexspline.effect(name) for name in discover_log.BASE]
    study = study_of(
        effects,
        [log],
        discover_log.TARGET,
        known_load=discover_log.LOAD,
        lowpass_hz=None,
        threads=threads,
    )
    sheet, whitening = dictionary(study), Whitening(NOISE, 1.0, 1)
    seconds = []
    for _ in range(3):
        begun = time.process_time()
        tabulated(study.problem, sheet, whitening)
        seconds.append(time.process_time() - begun)
    rows = min(most, len(log))
    ours, theirs = len(log) / np.array(seconds), rows / by_numpy(study, sheet, rows)
    print(f"screening: {sheet.width} columns, {len(log)} rows, {threads} threads: first "
          f"{seconds[0]:.2f} s, then {min(seconds[1:]):.2f} s")  # fmt: skip
    print(f"  numpy: {1e6 / theirs:.2f} s for a million rows; ratio {ours[0] / theirs:.1f}, "
          f"then {max(ours[1:]) / theirs:.1f}")  # fmt: skip


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--rows", type=float, default=3.6e6)
    options.add_argument("--threads", type=int, default=min(2, CORES))
    options.add_argument("--most", type=float, default=4e5, help="rows that numpy gets")
    options.add_argument("--numpy", action=argparse.BooleanOptionalAction, default=True)
    options.add_argument("--small", action="store_true")
    given = options.parse_args()
    begun = peak()
    if given.small:
        discovered([discover_log.log(4000, seed) for seed in range(1, 6)], given.threads, begun)
    log = discover_log.log(int(given.rows))
    discovered([log], given.threads, begun)
    if given.numpy:
        screened(log, given.threads, int(given.most))


if __name__ == "__main__":
    main()
