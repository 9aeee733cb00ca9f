"""Does a log of 10⁸ rows go through in the memory of a piece?

    python tests/bench/stream_rows.py --rows 1e8 --out DIR

Writes a Parquet file of four channels (rows of 32 bytes), then, each in a process of its own, sums
the products of a model over its pieces, and converts it in pieces to Parquet. Printed: seconds,
rows a second, and the peak of the process's memory. DIR needs 65 bytes for each row.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

MAP = """[facts]
gear_ratio = 100
[columns]
time = {source = "t", unit = "ms"}
output_position = {source = "q", unit = "deg"}
output_velocity = {source = "v", unit = "deg/s"}
motor_torque = {source = "tau", unit = "mNm"}
"""
PIECE = 1_000_000


def write(path: Path, rows: int) -> None:
    """A joint that swings with Coulomb and viscous friction, a group of rows after the other."""
    import pyarrow
    from pyarrow import parquet

    writer = None
    rng = np.random.default_rng(1)
    for first in range(0, rows, PIECE):
        at = np.arange(first, min(first + PIECE, rows))
        speed = 90.0 * np.cos(1e-3 * at)
        table = pyarrow.table({
            "t": 1.0 * at, "q": 90.0 * np.sin(1e-3 * at), "v": speed,
            "tau": 900.0 * np.sign(speed) + 20.0 * speed + rng.normal(0.0, 100.0, len(at)),
        })  # fmt: skip
        writer = writer or parquet.ParquetWriter(path, table.schema)
        writer.write_table(table)
    if writer is not None:
        writer.close()


def sums(path: Path, columns: Path) -> None:
    import flexspline

    pieces = flexspline.read_pieces(path, columns, rows=PIECE)
    effects = ["coulomb_friction", "viscous_friction"]
    made = flexspline.accumulate(effects, pieces, "motor_torque")
    print("coefficients", made.solve().coefficients, "of", int(made.rows.sum()), "rows")


def convert(path: Path, columns: Path) -> None:
    from flexspline.logs.read import convert_in_pieces

    made = convert_in_pieces(path, columns, path.with_name("converted.parquet"), rows=PIECE)
    print("converted", made.rows, "rows")


JOBS = {"sums": sums, "convert": convert}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=float, default=1e8)
    parser.add_argument("--out", type=Path, required=True, help="folder for the files")
    parser.add_argument("--job", choices=JOBS, help=argparse.SUPPRESS)
    given = parser.parse_args()
    path, columns = given.out / "long.parquet", given.out / "map.toml"
    if given.job:
        begun = time.perf_counter()
        JOBS[given.job](path, columns)
        seconds = time.perf_counter() - begun
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{given.job}: {seconds:.1f} s, {given.rows / seconds:.3g} rows/s, peak {peak:.0f} MB"
        )
        return
    given.out.mkdir(parents=True, exist_ok=True)
    columns.write_text(MAP)
    write(path, int(given.rows))
    for job in JOBS:
        words = ["--rows", str(given.rows), "--out", str(given.out), "--job", job]
        subprocess.run([sys.executable, __file__, *words], check=True)


if __name__ == "__main__":
    main()
