"""What the chain says of a fault in its readings, and what the estimate does meanwhile: measured.

The table of cpp/firmware/README.md is this one, line for line.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import chain_rig
import device
import numpy as np
from numpy.typing import NDArray
from test_chain_program import CHANNELS, rows_of, stream

from flexspline.model import Model
from flexspline.programs import firmware_folder

Array = NDArray[np.float64]

FIRST, LAST = 2000, 2100  # rows of the fault, 200 ms; the joint turns at 2.8 rad/s
PLACE = {"period": 1, **{name: k for k, name in enumerate(CHANNELS, start=2)}}
STAGES = {1: "thermistor", 2: "compensation", 4: "sensor", 8: "observer", 16: "compliance"}
STAGES |= {32: "merge", 64: "collision", 128: "compliant_observer", 256: "differentiator"}
FLAGS = {1: "extrapolated", 2: "saturated", 4: "out_of_range"}
FAULTS = {1: "sensor", 2: "motor", 4: "speed", 8: "motion", 16: "encoders", 32: "torques"}
FAULTS |= {64: "temperature"}
TORQUES = {"sensor": (2, 4), "observer": (3, 8), "compliance": (4, 16), "merged": (5, 32)}
CALM = 0.05  # Nm: as good as without the fault


def put(name: str, value: float) -> Callable[[Array], None]:
    return lambda rows: rows[FIRST:LAST, PLACE[name]].fill(value)


def stuck(*names: str) -> Callable[[Array], None]:
    def change(rows: Array) -> None:
        for name in names:
            held = 0.0 if name.endswith("velocity") else rows[FIRST, PLACE[name]]
            rows[FIRST:LAST, PLACE[name]] = held

    return change


def moved(name: str, step: float) -> Callable[[Array], None]:
    def change(rows: Array) -> None:
        rows[FIRST:, PLACE[name]] += step

    return change


def swapped(name: str) -> Callable[[Array], None]:
    def change(rows: Array) -> None:
        rows[FIRST:LAST, PLACE[name]] *= -1.0

    return change


def lost(rows: Array) -> None:
    """No call of the step at all: the next reading's period is longer."""
    rows[LAST, PLACE["period"]] = rows[FIRST : LAST + 1, PLACE["period"]].sum()
    rows[FIRST:LAST, 0] = np.nan  # taken out by `made`


BROKEN: dict[str, Callable[[Array], None]] = {
    "sensor voltage NaN": put("sensor_voltage", np.nan),
    "motor torque infinite": put("motor_torque", np.inf),
    "output angle missing": put("output_position", np.nan),
    "no step for 200 ms": lost,
    "time stands still": put("period", 0.0),
    "time goes backwards": put("period", -0.002),
    "sensor's converter at its end": put("sensor_voltage", 1.65),
    "sensor voltage with the wrong sign": swapped("sensor_voltage"),
    "motor torque with the wrong sign": swapped("motor_torque"),
    "velocity with the wrong sign": swapped("output_velocity"),
    "output encoder stuck": stuck("output_position"),
    "output encoder stuck, velocity from it": stuck("output_position", "output_velocity"),
    "motor encoder stuck": stuck("motor_position"),
    "output encoder steps by 0.02 rad": moved("output_position", 0.02),
    "motor encoder steps by 1 rad": moved("motor_position", 1.0),
    "thermistor open": put("thermistor_voltage", 3.3),
    "thermistor shorted": put("thermistor_voltage", 0.0),
}
OF_THE_ANGLE = (
    "output angle missing",
    "no step for 200 ms",
    "output encoder stuck",
    "motor encoder stuck",
    "output encoder steps by 0.02 rad",
)


def made(change: Callable[[Array], None], rows: Array) -> Array:
    broken = rows.copy()
    change(broken)
    return broken[np.isfinite(broken[:, 0])]


def by_row(results: Array, rows: int) -> Array:
    """Results with those that were never asked for repeated from the last step."""
    if len(results) == rows:
        return results
    return np.insert(results, np.full(rows - len(results), FIRST), results[FIRST - 1], axis=0)


def named(bits: int, names: dict[int, str]) -> list[str]:
    return [name for bit, name in names.items() if bits & bit]


def first_sign(found: Array, clean: Array) -> tuple[str, str]:
    """What speaks first, and after how many samples of the fault."""
    for row in range(FIRST, LAST + 1):
        said = named(int(found[row, 11]), FAULTS)
        said = [f"fault {name}" for name in said]
        if not said and found[row, 9] != 0:
            said = ["status bad_period"]
        if not said:
            said += [f"flag {n}" for n in named(int(found[row, 7]) & ~int(clean[row, 7]), FLAGS)]
            missed = named(int(found[row, 8]) & ~int(clean[row, 8]), STAGES)
            said += [f"missed {missed[0]}"] if missed else []
        if not said and found[row, 6] != clean[row, 6]:
            said = ["contact"]
        if said:
            return said[0], str(row - FIRST)
    return "nothing", "–"


def errors(found: Array, clean: Array) -> dict[str, str]:
    """Largest difference [Nm] from the run without the fault of what is not held; or held."""
    during = slice(FIRST, LAST)
    made = {}
    for name, (place, stage) in TORQUES.items():
        fresh = (found[during, 8].astype(int) & stage == 0) & (found[during, 9] == 0)
        apart = np.abs(found[during, place] - clean[during, place])[fresh]
        worst = apart.max(initial=0.0)
        size = "0" if worst < 5e-4 else f"{worst:.2g}"
        order = f"{size}, then held" if fresh[0] else f"held, then {size}"
        made[name] = size if fresh.all() else order if fresh.any() else "held"
    return made


def back_after(found: Array, clean: Array) -> str:
    """Samples behind the fault until every torque is that of the run without it."""
    places = [place for place, _ in TORQUES.values()]
    apart = np.abs(found[LAST:, places] - clean[LAST:, places]).max(axis=1) > CALM
    apart |= (found[LAST:, 8] != clean[LAST:, 8]) | (found[LAST:, 11] != 0)
    if apart[-1]:
        return "stays"
    return str(int(np.flatnonzero(apart)[-1]) + 1) if apart.any() else "0"


def clean_run(program: Path, rows: Array) -> Array:
    """The run without a fault, of which nothing is said but at its start."""
    clean = stream(program, "float", rows)
    assert not clean[:, 9].any() and not clean[:, 11].any() and not clean[200:, 8].any()
    return clean


def lines(checked: Path, unchecked: Path | None = None) -> list[str]:
    """The table of a chain, of the faults of the angle where there is no other to compare with."""
    rows = rows_of(chain_rig.without(chain_rig.raw_log(), "sensor_torque"), single=True)
    clean = clean_run(checked, rows)
    head = "| fault of 100 samples | first sign | after | sensor | observer | compliance | merged "
    head += "| back after |"
    table = [head, "|---|---|---|---|---|---|---|---|"]
    if unchecked is not None:
        table = [f"{head} merged, unchecked |", f"{table[1]}---|"]
    for name in BROKEN if unchecked else OF_THE_ANGLE:
        given = made(BROKEN[name], rows)
        found = by_row(stream(checked, "float", given), len(rows))
        assert np.isfinite(found[:, :7]).all(), name
        sign, after = first_sign(found, clean)
        cells = [name, sign, after, *errors(found, clean).values(), back_after(found, clean)]
        if unchecked is not None:
            plain = by_row(stream(unchecked, "float", given), len(rows))
            cells.append(errors(plain, clean)["merged"])
        table.append(f"| {' | '.join(cells)} |")
    return table


def program_of(model: Model, folder: Path) -> Path:
    folder.mkdir()
    return device.compiled(model, folder, device.compilers()[0], name="chain")


def assert_in_readme(expected: list[str]) -> None:
    text = (firmware_folder() / "README.md").read_text(encoding="utf-8")
    assert "\n".join(expected) in text, "\n".join(["", *expected])


def test_the_table_of_faults_is_what_the_chain_does(tmp_path: Path) -> None:
    checked = program_of(chain_rig.checked_joint(), tmp_path / "checked")
    assert_in_readme(lines(checked, program_of(chain_rig.whole_joint(), tmp_path / "unchecked")))


def test_the_table_of_a_chain_that_makes_its_velocity_is_what_it_does(tmp_path: Path) -> None:
    assert_in_readme(lines(program_of(chain_rig.angle_joint(), tmp_path / "angle")))
