"""Speed and memory of `discover` on an hour at 1 kHz, and of its screening against numpy.

    python tests/bench/discover_speed.py                    # the hour: 3.6 million rows
    python tests/bench/discover_speed.py --rows 4e5         # a short one
    python tests/bench/discover_speed.py --no-numpy         # without the comparison
    python tests/bench/discover_speed.py --small            # five runs of 4000 rows as well

The whole of `discover`: seconds by stage, and how far the peak of the process's memory lies above
that before the call (with the log) and above that before the log was made.

The screening alone: the products of all columns of the model and of all candidates, filtered to
white, fold by fold. The rival is the same dictionary built in numpy (`numpy_dictionary.py`, whose
columns are held against the core's first), scipy's lfilter, X.T @ X and a solve, in the same run,
on `--most` rows, and is given the benefit of that rate. Springs that slip need a loop over rows in
numpy, so the comparison is made without effects with memory as well.
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
import numpy_dictionary
from numpy.typing import NDArray
from scipy.signal import lfilter

import flexspline
from flexspline.discovery import discovering
from flexspline.discovery.search import SearchContext, search_context_of
from flexspline.regression.candidate_model import candidate_model_of
from flexspline.regression.gram import ColumnAssembly, Whitening, tabulated

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
        self.say("end")

    def say(self, what: str) -> None:
        here = now()
        self.seconds[self.said] = self.seconds.get(self.said, 0.0) + here - self.begun
        self.begun, self.said = here, what

    last: Stages


def discovered(logs: list[flexspline.Log], threads: int, before_log: float) -> None:
    discovering.Progress = Stages  # type: ignore[assignment,misc]
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


def dictionary(context: SearchContext, remembered: bool = True) -> ColumnAssembly:
    effects = [flexspline.effect(name) for name in discover_log.BASE]
    begun = candidate_model_of(effects, len(effects), {})
    wanted = [e for c in context.candidates(effects) for e in c.effects]
    wanted = [e for e in wanted if remembered or not e.info.remembers]
    return begun.assembly(beside=list(dict.fromkeys(wanted)))


def by_numpy(
    log: flexspline.Log, context: SearchContext, assembly: ColumnAssembly, rows: int
) -> Array:
    """Seconds on the wall and of all cores for the sums of the first `rows` rows, and a solve."""
    run = context.problem.runs[0]
    channels = numpy_dictionary.channels_of(log.rows(slice(0, rows)), discover_log.LOAD)
    begun = now()
    columns = numpy_dictionary.columns_of(assembly.effects, channels)
    columns = np.column_stack([columns, run.target[:rows]])
    total = np.zeros((columns.shape[1],) * 2)
    for first in range(0, rows, CHUNK):
        part = columns[max(0, first - len(NOISE) + 1) : first + CHUNK]
        white = lfilter(NOISE, [1.0], part, axis=0)[len(NOISE) - 1 :]
        total += white.T @ white
    np.linalg.lstsq(total[:-1, :-1], total[:-1, -1], rcond=1e-12)
    seconds = now() - begun
    core = context.problem.design(assembly.effects).rows(run.channels, len(run), assembly.load)[
        :rows
    ]
    if not numpy_dictionary.agrees(columns[:, :-1], np.asarray(core)):
        raise SystemExit("numpy's columns are not those of the core")
    return seconds


def screened(log: flexspline.Log, threads: int, most: int) -> None:
    """Print seconds of our screening and numpy's, with and without effects that remember."""
    effects = [flexspline.effect(name) for name in discover_log.BASE]
    context = search_context_of(
        effects,
        [log],
        discover_log.TARGET,
        known_load=discover_log.LOAD,
        lowpass_hz=None,
        threads=threads,
    )
    rows = min(most, len(log))
    short = search_context_of(
        effects,
        [log.rows(slice(0, rows))],
        discover_log.TARGET,
        known_load=discover_log.LOAD,
        lowpass_hz=None,
        threads=threads,
    )
    for remembered in (True, False):
        assembly, whitening = dictionary(context, remembered), Whitening(NOISE, 1.0, 1)
        seconds = []
        for _ in range(3):
            begun = now()
            tabulated(context.problem, assembly, whitening)
            seconds.append(now() - begun)
        ours = np.array(seconds) / len(log)
        theirs = by_numpy(log, short, assembly, rows) / rows
        what = "all effects" if remembered else "effects without memory"
        print(f"screening, {what}: {assembly.width} columns, {len(log)} rows, {threads} threads; "
              "seconds for a million rows on the wall (of all cores)")  # fmt: skip
        print(f"  first {_said(ours[0])}, again {_said(ours[1:].min(axis=0))}; numpy "
              f"{_said(theirs)}")  # fmt: skip
        print(f"  numpy over first: {_ratio(theirs / ours[0])}, over again: "
              f"{_ratio(theirs / ours[1:].min(axis=0))}")  # fmt: skip


def _said(seconds: Array) -> str:
    return f"{1e6 * seconds[0]:.2f} ({1e6 * seconds[1]:.2f})"


def _ratio(ratio: Array) -> str:
    return f"{ratio[0]:.1f} ({ratio[1]:.1f})"


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
