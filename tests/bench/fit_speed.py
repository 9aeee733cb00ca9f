"""Least squares of turlapati_intrinsic_dynamics (16) and its named alternatives, in one process.

    python tests/bench/fit_speed.py                 # a minute: N = 10⁶
    python tests/bench/fit_speed.py --rows 1e7      # the long one; numpy takes a while
    python tests/bench/fit_speed.py --stream 1e8    # a log of 3.2 GB from disk, constant memory

Every method solves the same problem: offset, two sigmoids, viscous friction, inertia and n
harmonics of the joint angle, 5 + 2n columns. The basis has no full rank, so methods are compared
by their predictions. numpy's own methods get at most `--most` rows (their memory is 8 (5 + 2n)
bytes a row) and are given the benefit of a rate measured there.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everybody, unless it says two

import numpy as np
from numpy.typing import NDArray

import flexspline
from flexspline import _core

Array = NDArray[np.float64]
TARGET = "sensor_torque"
CHANNELS = ("time", "output_position", "output_velocity", "output_acceleration", TARGET)
WIDTH = 0.01
CHUNK = 8192  # best of 2048 … 65536 for numpy on the machines tried


def made(rows: int, seed: int = 1) -> flexspline.Log:
    """A log of `rows` samples: back and forth over several turns, at several speeds."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * 1e-3
    v = 1.1 * np.sin(0.7 * t) + 0.4 * np.sin(2.9 * t + 1.0)
    q = -1.1 / 0.7 * np.cos(0.7 * t) - 0.4 / 2.9 * np.cos(2.9 * t + 1.0) + 0.13 * t
    a = 0.77 * np.cos(0.7 * t) + 1.16 * np.cos(2.9 * t + 1.0)
    y = 0.3 * np.tanh(v / WIDTH) + 0.2 * v + 0.02 * a + 0.1 * np.cos(2 * q) - 0.12
    y += 0.05 * rng.standard_normal(rows)
    columns = (t, q, v + 0.13, a, y)
    for column in columns:
        column.flags.writeable = False  # a log takes such arrays as they are
    return flexspline.Log(dict(zip(CHANNELS, columns, strict=True)))


def effects(n: int) -> list[flexspline.Effect]:
    return [
        flexspline.effect("offset"),
        flexspline.effect("coulomb_friction_per_direction", direction_width=WIDTH),
        flexspline.effect("viscous_friction"),
        flexspline.effect("inertia"),
        flexspline.effect("output_ripple", orders=range(1, n + 1)),
    ]


def design(log: flexspline.Log, n: int, rows: slice = slice(None)) -> Array:
    """The design matrix in numpy, with the harmonics by one complex power after the other."""
    v, q = log["output_velocity"][rows], log["output_position"][rows]
    up = 0.5 + 0.5 * np.tanh(v / WIDTH)
    columns = np.empty((len(v), 5 + 2 * n), order="F")
    columns[:, 0], columns[:, 1], columns[:, 2], columns[:, 3] = 1.0, up, 1.0 - up, v
    columns[:, 4] = log["output_acceleration"][rows]
    once = np.exp(1j * q)
    turned = np.ones(len(q), dtype=complex)
    for k in range(n):
        turned = turned * once
        columns[:, 5 + 2 * k], columns[:, 6 + 2 * k] = turned.real, turned.imag
    return columns


def by_lstsq(log: flexspline.Log, n: int) -> Array:
    return np.linalg.lstsq(design(log, n), log["sensor_torque"], rcond=None)[0]


def by_normal_equations(log: flexspline.Log, n: int) -> Array:
    x = design(log, n)
    return np.linalg.lstsq(x.T @ x, x.T @ log["sensor_torque"], rcond=1e-12)[0]


def by_chunks(log: flexspline.Log, n: int) -> Array:
    gram, right = np.zeros((5 + 2 * n, 5 + 2 * n)), np.zeros(5 + 2 * n)
    y = log["sensor_torque"]
    for first in range(0, len(y), CHUNK):
        rows = slice(first, first + CHUNK)
        x = design(log, n, rows)
        gram += x.T @ x
        right += x.T @ y[rows]
    return np.linalg.lstsq(gram, right, rcond=1e-12)[0]


def by_scikit_learn(log: flexspline.Log, n: int) -> Array:
    from sklearn.linear_model import LinearRegression

    model = LinearRegression(fit_intercept=False, copy_X=False)
    return np.asarray(model.fit(design(log, n), log["sensor_torque"]).coef_)


def by_flexspline(log: flexspline.Log, n: int, threads: int = 1) -> Array:
    sums = flexspline.accumulate(effects(n), [log], TARGET, threads=threads)
    return sums.solve().coefficients


METHODS: dict[str, Callable[[flexspline.Log, int], Array]] = {
    "numpy design + lstsq": by_lstsq,
    "numpy normal equations": by_normal_equations,
    "numpy in chunks": by_chunks,
    "scikit-learn": by_scikit_learn,
    "flexspline, 1 thread": by_flexspline,
    "flexspline, 2 threads": lambda log, n: by_flexspline(log, n, 2),
}
HUNGRY = ("numpy design + lstsq", "numpy normal equations", "scikit-learn")


def timed(rows: int, n: int, most: int, repeats: int) -> list[dict[str, Any]]:
    """Every method on the same log, in turns; rates in million samples a second."""
    log = made(rows)
    short = log.rows(slice(0, most))
    probe = design(made(2000, seed=2), n)
    seconds: dict[str, list[float]] = {name: [] for name in METHODS}
    predicted = {}
    for _ in range(repeats):
        for name, method in METHODS.items():
            if name in HUNGRY and len(seconds[name]) == 2:
                continue
            start = time.perf_counter()
            coefficients = method(short if name in HUNGRY else log, n)
            seconds[name].append(time.perf_counter() - start)
            predicted[name] = probe @ coefficients
    reference = predicted["flexspline, 1 thread"]
    whole = probe @ by_flexspline(short, n)
    found = []
    for name, its in seconds.items():
        used = min(rows, most) if name in HUNGRY else rows
        apart = predicted[name] - (whole if name in HUNGRY else reference)
        found.append(
            {
                "n": n,
                "method": name,
                "rows": used,
                "median": used / float(np.median(its)) / 1e6,
                "worst": used / max(its) / 1e6,
                "apart": float(np.abs(apart).max()),
            }
        )
    return found


def memory_of(rows: int, n: int) -> float:
    """Extra memory [MB] of flexspline beyond its input, in a fresh process."""
    command = [sys.executable, __file__, "--memory", str(rows), "--harmonics", str(n)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def print_memory(rows: int, n: int) -> None:
    log = made(rows)
    by_flexspline(made(4096), n)
    Path("/proc/self/clear_refs").write_text("5")  # forget the peak so far (Linux)
    before = memory("VmHWM")
    by_flexspline(log, n, 2)
    print(memory("VmHWM") - before)


def stream(rows: int, n: int) -> None:
    """Write a log to disk piece by piece, then sum it up from there in constant memory."""
    piece = 1_000_000
    with tempfile.TemporaryDirectory() as folder:
        columns = {
            name: np.lib.format.open_memmap(
                Path(folder) / f"{name}.npy", mode="w+", dtype="<f8", shape=(rows,)
            )
            for name in CHANNELS
        }
        for first in range(0, rows, piece):
            part = made(min(piece, rows - first), seed=first)
            for name, column in columns.items():
                shift = first * 1e-3 if name == "time" else 0.0
                column[first : first + len(part)] = part[name] + shift
        for column in columns.values():
            column.flush()
        log = flexspline.Log(
            {name: np.load(Path(folder) / f"{name}.npy", mmap_mode="r") for name in columns}
        )
        before = memory("RssAnon")
        start = time.perf_counter()
        pieces = (log.rows(slice(i, min(i + piece, rows))) for i in range(0, rows, piece))
        sums = flexspline.accumulate(effects(n), pieces, TARGET, threads=2)
        solution = sums.solve()
        seconds = time.perf_counter() - start
        print(
            f"streamed {rows:.0e} rows from disk in {seconds:.1f} s "
            f"({rows / seconds / 1e6:.1f} M/s), {memory('RssAnon') - before:.1f} MB more "
            f"memory at the end, rank {solution.rank}"
        )


def memory(what: str) -> float:
    """Memory of this process [MB]: VmHWM, the peak; RssAnon, what is no file's (Linux)."""
    status = Path("/proc/self/status").read_text()
    return int(next(x for x in status.splitlines() if x.startswith(what)).split()[1]) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=float, default=1e6)
    parser.add_argument(
        "--most", type=float, default=2e6, help="rows for methods that need the whole matrix"
    )
    parser.add_argument("--harmonics", type=int, nargs="*", default=[4, 10, 20, 40])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--stream", type=float, help="only stream so many rows from disk")
    parser.add_argument("--memory", type=float, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.memory:
        return print_memory(int(chosen.memory), chosen.harmonics[0])
    if chosen.stream:
        return stream(int(chosen.stream), 20)
    print(f"instruction set {_core.isa()}, N = {chosen.rows:.0e}; million samples a second")
    print(
        f"{'method':<24}{'n':>4}{'rows':>10}{'median':>9}{'worst':>9}{'x lstsq':>9}"
        f"{'x chunks':>9}{'apart':>9}"
    )
    for n in chosen.harmonics:
        rows = timed(int(chosen.rows), n, int(chosen.most), chosen.repeats)
        rate = {row["method"]: row["median"] for row in rows}
        for row in rows:
            print(
                f"{row['method']:<24}{n:>4}{row['rows']:>10}{row['median']:>9.2f}"
                f"{row['worst']:>9.2f}{row['median'] / rate[HUNGRY[0]]:>9.1f}"
                f"{row['median'] / rate['numpy in chunks']:>9.1f}{row['apart']:>9.0e}"
            )
        print(f"  extra memory of flexspline, 2 threads: {memory_of(int(chosen.rows), n):.1f} MB")


if __name__ == "__main__":
    main()
