"""Fleets: how fast they are summed, and whether errors, spreads and alarms hold.

    python tests/bench/fleet.py scale --joints 1000 --workers 2            channels as recorded
    python tests/bench/fleet.py scale --joints 40 --workers 2 --as-fit     checked and smoothed too
    python tests/bench/fleet.py coverage          intervals of one run, by length, memory, block
    python tests/bench/fleet.py population        of fleets, by their size

`scale` makes the runs while it goes: 10 min of 9 channels at 1 kHz, 43 MB, of a motion that each
worker makes once and torques of every joint's own; what that takes is told apart from what summing
takes. Seeds are fixed.
"""

from __future__ import annotations

import argparse
import os
import pickle
import resource
import sys
import time
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))

from fleet_logs import MEAN, NAMES, SPREAD, drawn

from flexspline import _core
from flexspline.effects import effect
from flexspline.fleet import fit_sums
from flexspline.fleet.accumulators import Plan, RunSums, _folded, accumulators_of
from flexspline.fleet.cluster import Workers, done
from flexspline.fleet.estimates import estimate_of
from flexspline.fleet.population import population_of
from flexspline.fleet.sessions import Session
from flexspline.least_squares.sums import Sums
from flexspline.logs.log import Log
from flexspline.progress import Progress

SECONDS, RATE = 600.0, 1000.0
EFFECTS = ("offset", "coulomb_friction", "viscous_friction", "inertia", "stribeck_friction")
INERTIA, STRIBECK = 0.02, 0.15


def plan_of(as_fit: bool) -> Plan:
    effects = tuple(effect(name) for name in EFFECTS)
    if as_fit:
        return Plan(effects, "sensor_torque")
    return Plan(effects, "sensor_torque", bandwidth=np.inf, checks=False)


@cache
def motion() -> Log:
    """Ten minutes of random speeds, all channels but the torque."""
    time_ = np.arange(round(SECONDS * RATE)) / RATE
    knots = np.arange(0.0, SECONDS + 2.0, 1.5)
    rng = np.random.default_rng(1)
    rough = np.interp(time_, knots, rng.uniform(-1.5, 1.5, len(knots)))
    window = np.hanning(301)
    velocity = np.convolve(rough, window / window.sum(), mode="same")
    position = np.cumsum(velocity) / RATE
    return Log.from_arrays(
        facts={"gear_ratio": 100, "output_spline": "circular"},
        time=time_,
        output_position=position,
        output_velocity=velocity,
        output_acceleration=np.gradient(velocity, 1.0 / RATE),
        motor_position=101.0 * position,
        motor_velocity=101.0 * velocity,
        motor_torque=0.01 * velocity,
        sensor_torque=np.zeros_like(position),
        temperature=25.0 + 5.0 * (1.0 - np.exp(-time_ / 200.0)),
    )


@cache
def rows() -> np.ndarray[Any, Any]:
    from flexspline.own import design_of
    from flexspline.signals import channels_for, core_channels, gear_for

    effects = [effect(name) for name in EFFECTS]
    log = channels_for(motion(), effects, None)
    design = design_of(effects, gear_for([log], "sensor_torque", effects))
    return np.asarray(design.rows(core_channels(log, effects, None), len(log), np.empty(0)))


@dataclass(frozen=True)
class Made(Session):
    """A session that makes its run."""

    noisy: bool = False

    @property
    def size(self) -> int:
        return 0

    def read(self) -> Log:
        rng = np.random.default_rng(int(self.unit.removeprefix("joint")))
        truth = drawn(rng)
        values = np.array([*(truth[name] for name in NAMES), INERTIA, STRIBECK])
        values[3:] *= rng.normal(1.0, 0.1, 2)
        white = rng.standard_normal(len(motion())) * 0.03 * np.sqrt(1.0 - 0.98**2)
        torque = rows() @ values + lfilter([1.0], [1.0, -0.98], white)
        made = {"sensor_torque": torque}
        if self.noisy:  # an encoder of 20 bits, a velocity with noise
            step = 2 * np.pi / 2**20
            made["output_position"] = step * np.round(motion()["output_position"] / step)
            made["motor_position"] = step * np.round(motion()["motor_position"] / step)
            noise = 0.001 * rng.standard_normal(len(torque))
            made["output_velocity"] = motion()["output_velocity"] + noise
        log = motion().with_columns(made, note="simulated").with_facts({"name": self.run})
        if not self.noisy:
            return log
        gone = [n for n in log.channels if n not in ("output_acceleration", "motor_velocity")]
        return Log({n: log[n] for n in gone}, log.facts, log.history)


@dataclass(frozen=True)
class Timed:
    """Work that measures itself; a class, so that workers can unpickle it."""

    plan: Plan

    def __call__(self, session: Made) -> tuple[RunSums, float, float, float]:
        motion(), rows()
        began = time.process_time()
        log = session.read()
        read = time.process_time() - began

        class Held(Session):
            size = 0

            def read(self) -> Log:
                return log

        began = time.process_time()
        made = accumulators_of(Held(session.unit, session.run, session.path), self.plan)
        summed = time.process_time() - began
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        return made, read, summed, peak


def scale(joints: int, workers: int, as_fit: bool) -> None:
    tasks = [Made(f"joint{k:06d}", "run", Path("run"), noisy=as_fit) for k in range(joints)]
    plan = plan_of(as_fit)
    began = time.monotonic()
    with Progress("runs", sys.stderr.isatty(), total=joints, unit="run") as bar:
        found = done(Timed(plan), tasks, Workers(count=workers), bar)
    wall = time.monotonic() - began
    runs = [each[0] for each in found]
    read, summed = (sum(each[k] for each in found) for k in (1, 2))
    peak = max(each[3] for each in found)
    total = sum(run.rows for run in runs)
    size = len(pickle.dumps(runs[0]))
    began = time.monotonic()
    made = fit_sums(runs, plan)
    after = time.monotonic() - began
    whole = joints * round(SECONDS * RATE)
    kind = "checked and smoothed as fit does" if as_fit else "channels as recorded"
    print(
        f"{joints} joints × {SECONDS:.0f} s × {RATE:.0f} Hz × 9 channels, {kind}, {workers} workers"
    )
    speed, load = whole / wall / 1e6, os.getloadavg()[0]
    print(f"wall {wall:.0f} s ({speed:.2f} million rows a second), load {load:.1f}")
    print(
        f"a run: making it {read / joints:.3f} s, summing it {summed / joints:.3f} s of processor"
    )
    print(f"rows that count {total / whole:.4f}; peak of a process {peak:.0f} MB")
    print(f"sums of a run {runs[0].bytes} bytes, pickled {size}; all {size * joints / 1e6:.1f} MB")
    print(f"estimates, population and held-out runs {after:.1f} s")
    truth = [*(MEAN[n] for n in NAMES), INERTIA, STRIBECK]
    wide = [*(SPREAD[n] for n in NAMES), 0.1 * INERTIA, 0.1 * STRIBECK]
    for name, mean, spread, margin in zip(made.parameters, truth, wide, made.population.margins,
                                          strict=True):  # fmt: skip
        print(f"{name:28} mean {margin.mean:.4f} ± {margin.mean_error:.4f} (drawn {mean:.4f})  "
              f"spread {margin.spread:.4f} (drawn {spread:.4f})  n {margin.units}")  # fmt: skip
    print(f"stand out: {len(made.outlying)}")
    a_day = 1e6
    cores = summed / joints * a_day / 86400.0
    print("on paper, a million joints a day, each such a run:")
    print(
        f"  reading {a_day * SECONDS * RATE * 72 / 1e12:.0f} TB of doubles, "
        f"{a_day * SECONDS * RATE * 72 / 86400 / 1e6:.0f} MB/s; {a_day / 86400:.1f} tasks a second"
    )
    print(f"  summing {cores:.1f} cores busy; sums {a_day * size / 1e9:.1f} GB to one place")


def coverage() -> None:
    for seconds in (30, 60, 240):
        for block in (0.5, 1.0, 2.0):
            for memory in (0.0, 0.05, 0.5, 2.0):
                inside = [_covered(seconds, block, memory, seed) for seed in range(400)]
                share = " ".join(f"{x:.3f}" for x in np.mean(inside, axis=0))
                print(
                    f"{seconds:4d} s, blocks of {block} s, memory {memory} s: {share}", flush=True
                )


def _covered(seconds: int, block: float, memory: float, seed: int) -> Any:
    rng, rate = np.random.default_rng([seed, seconds, int(1e3 * memory)]), 100
    time_ = np.arange(seconds * rate) / rate
    knots = np.arange(0.0, seconds + 2.0, 2.0)
    v = np.interp(time_, knots, rng.uniform(-1.0, 1.0, len(knots)))
    columns = [np.ones(len(v)), np.tanh(v / 0.02), v, np.gradient(v, time_)]
    rows_, truth = np.column_stack(columns), np.array([0.1, 0.5, 0.3, 0.05])
    slope = np.exp(-1.0 / (rate * memory)) if memory else 0.0
    white = rng.normal(0.0, 0.1 * np.sqrt(1.0 - slope**2), len(v) + 2000)
    y = rows_ @ truth + lfilter([1.0], [1.0, -slope], white)[2000:]
    edges = np.linspace(0, len(v), round(seconds / block) + 1).astype(int).tolist()
    blocks = list(pairwise(edges))
    high, low = _core.accumulate_rows(np.asfortranarray(rows_), y, blocks, None, True, 1)
    sums = Sums(high, low, np.diff(edges), np.zeros(len(blocks), dtype=np.int64))
    whole = _core.merge(high, low, list(range(len(blocks))))
    total = Sums(whole[0][None], whole[1][None], np.array([len(v)]), np.zeros(1, dtype=np.int64))
    run = RunSums("a", "b", None, total, _folded(sums), len(v), float(seconds), None, ())
    ends = estimate_of([run]).intervals()
    return (ends[:, 0] < truth) & (truth < ends[:, 1])


def population() -> None:
    from test_fleet_population import MEAN as MU
    from test_fleet_population import SPREAD as SIGMA
    from test_fleet_population import joints

    for count in (4, 6, 10, 20, 50, 150):
        held: dict[str, list[Any]] = {
            name: [] for name in ("mean", "spread", "value", "alarm", "error")
        }
        for seed in range(300 if count < 50 else 100):
            truths, units = joints(count, np.random.default_rng([count, 9, seed]))
            made = population_of(units)
            for name, of, truth in (
                ("mean", "mean_interval", MU),
                ("spread", "spread_interval", SIGMA),
            ):
                ends = np.array([getattr(margin, of) for margin in made.margins])
                held[name].append((ends[:, 0] <= truth) & (truth <= ends[:, 1]))
            held["alarm"].append([made.outlying.any()])
            for u, (truth, unit) in enumerate(zip(truths, units, strict=True)):
                value = made.shrunken(unit, bool(made.outlying[u].any()))
                held["value"].append(np.abs(value.values - truth) < 1.96 * value.errors)
                held["error"].append(
                    [(x - truth) ** 2 for x in (value.values, unit.values, made.mean)]
                )
        shares = {
            name: np.round(np.mean(x, axis=0), 3) for name, x in held.items() if name != "error"
        }
        drawn_, separate, pooled = np.sqrt(np.mean(held["error"], axis=0)).round(3).tolist()
        print(
            f"{count:4d} joints: {shares}; RMS error drawn {drawn_} own {separate} mean {pooled}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=("scale", "coverage", "population"))
    parser.add_argument("--joints", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--as-fit", action="store_true")
    given = parser.parse_args()
    if given.what == "scale":
        scale(given.joints, given.workers, given.as_fit)
    else:
        {"coverage": coverage, "population": population}[given.what]()


if __name__ == "__main__":
    main()
