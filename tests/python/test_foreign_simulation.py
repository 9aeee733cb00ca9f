"""A foreign simulation as the base: resampled, subtracted, recorded, asked for again."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from cli_calls import call
from hidden_logs import LOAD, WIDTH, friction_of, log_of, noise, rich_run

import flexspline
from flexspline import InputError, Log, Model
from flexspline.exporting import export
from flexspline.simulator import late, take

pytestmark = pytest.mark.usefixtures("undrawn")

ROWS = 3000
LEAK = 0.05
SAMPLE = 1.0 / 200.0


def run(
    seed: int, *, holds_load: bool = False, late: float = 0.0, named: bool = True, rows: int = ROWS
) -> Log:
    """A run whose simulation knows its friction, and lacks a crosstalk of the motor."""
    c = rich_run(seed, rows)
    says = friction_of(c) + (c[LOAD] if holds_load else 0.0)
    torque = c[LOAD] + friction_of(c) + LEAK * c["motor_torque"]
    torque = np.interp(c["time"] - late, c["time"], torque) + noise(seed, rows)
    more = {"sensor_torque": torque, **({"simulated_torque": says} if named else {})}
    return log_of(c, **more).with_facts({"name": f"run{seed}"})


def runs(**how: object) -> list[Log]:
    return [run(seed, **how) for seed in range(1, 5)]  # type: ignore[arg-type]


def on_own_clock(log: Log, first: float = 0.0, last: float = np.inf) -> Log:
    """The simulation of a run in a log of its own, at another rate, from `first` to `last` s."""
    time = np.arange(log["time"][0], log["time"][-1] + 0.003, 0.003)
    time = time[(time >= first) & (time <= last)]
    c = rich_run(int(log.name[3:]), ROWS)
    says = np.interp(time, c["time"], friction_of(c))
    return Log.from_arrays(time=time, simulated_torque=says).with_facts({"name": f"of {log.name}"})


@pytest.fixture(scope="module")
def found() -> flexspline.Discovery:
    return flexspline.discover(
        None, runs(), target="sensor_torque", known_load=LOAD, simulated_torque="simulated_torque"
    )


def test_what_a_simulation_lacks_is_named_with_its_size(found: flexspline.Discovery) -> None:
    assert found.names == ("motor_crosstalk",) and found.base_effects == ()
    (leak,) = found.parameters("motor_crosstalk")
    assert leak.value == pytest.approx(LEAK, abs=4.0 * leak.standard_error)
    assert "The simulation of the sensor torque" in str(found)
    assert json.loads(found.to_json())["simulation"]["column"] == "simulated_torque"


def test_a_simulation_with_the_load_in_it_gives_the_same_correction(
    found: flexspline.Discovery,
) -> None:
    other = flexspline.discover(
        None, runs(holds_load=True), target="sensor_torque", known_load=LOAD,
        simulated_torque="simulated_torque",
    )  # fmt: skip
    assert other.simulated is not None and other.simulated.holds_load
    part, same = other.model.part(), found.model.part()
    assert part.coefficients == pytest.approx(same.coefficients, rel=1e-9)
    log = run(9, holds_load=True)
    assert np.std(other.model.predict(log).residual) < 1.3 * np.std(noise(9, ROWS))


@pytest.mark.parametrize("holds_load", [True, False])
def test_of_a_current_the_load_is_taken_off_in_amperes(holds_load: bool) -> None:
    log = run(1)
    per_ampere = 0.1 * 101.0  # Ñ k_t
    says = (log["simulated_torque"] + holds_load * log[LOAD]) / per_ampere
    current = (log["sensor_torque"]) / per_ampere
    log = log.with_columns({"motor_current": current, "simulated_torque": says}, note="in A")
    log = log.with_facts({"torque_constant": 0.1})
    fit = flexspline.fit(
        ["offset"],
        log,
        "motor_current",
        known_load=LOAD,
        options=flexspline.FitOptions(simulated_torque="simulated_torque"),
    )
    left = log["sensor_torque"] - log[LOAD] - run(1)["simulated_torque"]
    assert fit.part.simulated is not None and fit.part.simulated.holds_load is holds_load
    assert fit.runs[0].measured == pytest.approx(left / per_ampere, abs=1e-12)
    made = fit.model.predict(log)
    assert made.measured == pytest.approx((log["sensor_torque"] - log[LOAD]) / per_ampere)


def test_files_on_their_own_clocks_give_what_columns_give(found: flexspline.Discovery) -> None:
    logs = runs(named=False)
    files = [on_own_clock(log) for log in logs]
    taken = take(logs, "sensor_torque", LOAD, files, None)
    for log, was in zip(taken.logs, runs(), strict=True):
        exact = was["simulated_torque"]
        span = np.ptp(exact)
        assert np.abs(log["simulated_torque"] - exact).max() < 0.01 * span
    fit = flexspline.fit(
        ["motor_crosstalk"],
        logs,
        "sensor_torque",
        known_load=LOAD,
        options=flexspline.FitOptions(simulation=files),
    )
    assert fit["leakage"].value == pytest.approx(
        found.parameters("motor_crosstalk")[0].value, rel=0.02
    )


def test_rows_outside_a_simulation_are_left_out_and_counted() -> None:
    log = run(1, named=False)
    taken = take([log], "sensor_torque", LOAD, [on_own_clock(log, first=3.0)], None)
    left = int(np.count_nonzero(log["time"] < 3.0))
    assert len(taken.logs[0]) == ROWS - left
    (said,) = [r for r in taken.remarks if r.finding.name == "simulation_span"]
    assert f"nothing of {left} of {ROWS} rows" in said.sentence


def test_a_simulation_of_another_span_is_refused() -> None:
    log = run(1, named=False)
    with pytest.raises(InputError, match="time stamps of the same clock"):
        take([log], "sensor_torque", LOAD, [on_own_clock(log, last=5.0)], None)


@pytest.mark.parametrize("late", [0.01, 0.2])
def test_a_delay_is_reported_and_not_taken_away(late: float) -> None:
    log = run(1, holds_load=True, late=late)
    taken = take([log], "sensor_torque", LOAD, None, "simulated_torque")
    (said,) = taken.remarks
    assert said.finding.name == "simulation_delay"
    assert said.finding.size == pytest.approx(late, abs=0.3 * SAMPLE)
    assert np.array_equal(taken.logs[0]["simulated_torque"], log["simulated_torque"])


def test_a_late_simulation_is_one_fault_and_the_load_is_not_called_late() -> None:
    """Beside its delay what it lacks is named, or said to be unexplained."""
    logs = []
    for log in runs(holds_load=True, late=-0.01, rows=ROWS // 2):
        load = log[LOAD] + np.random.default_rng(len(logs)).normal(0.0, 0.02, len(log))
        logs.append(log.with_columns({LOAD: load}, note="as a load cell reads it"))
    found = flexspline.discover(
        None, logs, target="sensor_torque", known_load=LOAD, simulated_torque="simulated_torque"
    )
    assert {fault.name for fault in found.data_faults} == {"simulation_delay"}
    assert all("ahead of the simulated" in fault.sentence for fault in found.data_faults)
    assert found.names == ("motor_crosstalk",) or (found.unexplained and not found.names)


@pytest.mark.parametrize("lacks", ["nothing", "viscous", "coulomb", "load", "inertia"])
def test_what_a_simulation_lacks_is_no_delay(lacks: str) -> None:
    for seed in range(1, 6):
        c = rich_run(seed, ROWS)
        v = c["output_velocity"]
        missing = {
            "nothing": 0.0 * v,
            "viscous": 0.3 * v,
            "coulomb": 0.3 * np.tanh(v / WIDTH),
            "load": 0.05 * np.abs(c[LOAD]) * np.tanh(v / WIDTH),
            "inertia": 0.05 * c["output_acceleration"],
        }[lacks]
        says = c[LOAD] + friction_of(c)
        log = log_of(c, sensor_torque=says + missing + noise(seed, ROWS), simulated_torque=says)
        assert take([log], "sensor_torque", LOAD, None, "simulated_torque").remarks == ()


def test_exactly_one_base_is_taken(found: flexspline.Discovery) -> None:
    logs = runs()
    plain = flexspline.fit(["offset"], logs, "sensor_torque", known_load=LOAD).model
    for base in (["offset"], plain):
        with pytest.raises(InputError, match="exactly one of effects, a model, and a simulation"):
            flexspline.discover(base, logs, target="sensor_torque", simulated_torque="x")
    with pytest.raises(InputError, match="exactly one"):
        flexspline.discover(None, logs, target="sensor_torque")
    with pytest.raises(InputError, match="exactly one of a model and a simulation"):
        flexspline.compare(None, logs)
    with pytest.raises(InputError, match=r"one file for each run.*runs are \d, its files \d;"):
        flexspline.compare(None, logs, target="sensor_torque", simulation=logs[:1])
    with pytest.raises(InputError, match="the target is torsion"):
        flexspline.compare(None, logs, target="torsion", simulated_torque="simulated_torque")


def test_a_discovery_goes_on_from_a_model_that_corrects_a_simulation(
    found: flexspline.Discovery,
) -> None:
    more = flexspline.discover(found.model, runs(), simulated_torque="simulated_torque")
    assert more.names == () and more.base_effects == ("motor_crosstalk",)
    assert more.simulated is not None


def test_a_model_keeps_what_it_corrects_and_asks_for_it(
    found: flexspline.Discovery, tmp_path: Path
) -> None:
    found.model.save(tmp_path / "model.json")
    content = json.loads((tmp_path / "model.json").read_text(encoding="utf-8"))
    assert content["version"] == 2 and content["sensor"]["simulated"]["own_files"] is False
    model = Model.load(tmp_path / "model.json")
    assert model.part().simulated == found.simulated
    log = run(7)
    assert np.std(model.predict(log).residual) < 1.3 * np.std(noise(7, ROWS))
    bare = run(7, named=False)
    with pytest.raises(InputError, match="give --simulated-torque simulated_torque"):
        model.predict(bare)
    made = model.predict(bare, simulation=on_own_clock(bare))
    assert np.nanstd(made.residual) < 1.3 * np.std(noise(7, ROWS))
    with pytest.raises(InputError, match="cannot be driven alone"):
        flexspline.simulate(model, log)


def test_a_model_without_a_simulation_stays_of_version_1_and_refuses_one() -> None:
    logs = runs()
    model = flexspline.fit(["offset"], logs, "sensor_torque", known_load=LOAD).model
    assert json.loads(model.to_json())["version"] == 1
    with pytest.raises(InputError, match="corrects no simulation"):
        model.predict(logs[0], simulated_torque="simulated_torque")


def test_an_exported_header_says_that_it_is_the_correction_alone(
    found: flexspline.Discovery, tmp_path: Path
) -> None:
    text = export(found.model, tmp_path / "joint.hpp").read_text(encoding="utf-8")
    assert "THE CORRECTION ALONE: what a simulation lacks of sensor_torque [Nm]" in text
    assert "column 'simulated_torque' of the runs" in " ".join(text.replace("//", " ").split())


def test_a_comparison_with_a_simulation_says_what_its_base_is() -> None:
    made = flexspline.compare(
        None, runs(), target="sensor_torque", known_load=LOAD, simulated_torque="simulated_torque"
    )
    crosstalk = np.concatenate([LEAK * rich_run(s, ROWS)["motor_torque"] for s in range(1, 5)])
    hidden = np.hypot(np.sqrt(np.mean(crosstalk**2)), np.std(noise(1, ROWS)))
    assert made.rmse == pytest.approx(hidden, rel=0.05)
    assert "The base is what a simulation says: column 'simulated_torque' of the runs." in str(made)
    assert "measured and simulated sensor torque" in made.sentences[0]
    assert json.loads(made.to_json())["simulation"] == made.foreign


def test_simulated_motion_is_compared_by_run_and_direction() -> None:
    logs = runs()
    files = [
        Log.from_arrays(
            time=log["time"][::2],
            output_position=log["output_position"][::2]
            + 0.01 * np.sign(log["output_velocity"])[::2],
        )
        for log in logs
    ]
    made = flexspline.compare(None, logs, simulation=files, simulated_motion=True)
    assert (made.what, made.unit) == ("output_position", "rad")
    assert made.rmse == pytest.approx(0.01, rel=0.02)
    assert [band.label for band in made["run"]] == [log.name for log in logs]
    bias = {band.label: band.bias for band in made["direction"]}
    assert bias["forward"] == pytest.approx(-0.01, rel=0.05)
    assert bias["backward"] == pytest.approx(0.01, rel=0.05)
    with pytest.raises(InputError, match="give simulation, and neither"):
        flexspline.compare(None, logs, simulated_torque="x", simulated_motion=True)


def saved(folder: Path) -> tuple[list[Path], list[Path]]:
    """Runs with a column 'mujoco', and files of the simulation alone on another clock."""
    measured, simulated = [], []
    for log in runs():
        measured.append(folder / f"{log.name}.csv")
        table = log.to_frame().rename(columns={"simulated_torque": "mujoco"})
        table.to_csv(measured[-1], index=False)
        simulated.append(folder / f"made_{log.name}.csv")
        table = on_own_clock(log).to_frame().rename(columns={"simulated_torque": "tau"})
        table.to_csv(simulated[-1], index=False)
    return measured, simulated


COMMON = ("--target", "sensor_torque", "--known-load", LOAD)


def test_the_command_line_goes_all_the_way_by_a_column_of_the_runs(tmp_path: Path) -> None:
    measured, _ = saved(tmp_path)
    out = tmp_path / "found"
    made = call("discover", *measured, *COMMON, "--simulated-torque", "mujoco", "--out", out)
    assert made.exit_code == 0, made.stderr
    content = json.loads((out / "discovery.json").read_text(encoding="utf-8"))
    assert [one["effect"] for one in content["found"]] == ["motor_crosstalk"]
    digest = hashlib.sha256(measured[0].read_bytes()).hexdigest()
    assert content["simulation"]["files"][0] == {"name": "run1", "sha256": digest}
    model = ("--model", out / "model.json")
    asked = call("predict", *model, measured[0], "--out", tmp_path / "p.csv")
    assert asked.exit_code == 2 and "give --simulated-torque mujoco" in asked.stderr
    told = call("predict", *model, measured[0], "--simulated-torque", "mujoco",
                "--out", tmp_path / "p.csv")  # fmt: skip
    assert told.exit_code == 0, told.stderr
    compared = call("compare", *measured, *model, "--simulated-torque", "mujoco",
                    "--out", tmp_path / "where")  # fmt: skip
    assert compared.exit_code == 0, compared.stderr
    wrote = call("export", *model, "--format", "header", "--out", tmp_path / "joint.hpp")
    assert wrote.exit_code == 0 and "the correction alone" in wrote.stdout


def test_the_command_line_goes_all_the_way_by_files_of_their_own(tmp_path: Path) -> None:
    measured, simulated = saved(tmp_path)
    files = [part for path in simulated for part in ("--simulation", path)]
    out = tmp_path / "where"
    made = call("compare", *measured, *COMMON, *files, "--simulated-torque", "tau", "--out", out)
    assert made.exit_code == 0, made.stderr
    assert json.loads((out / "comparison.json").read_text(encoding="utf-8"))["simulation"] == (
        "column 'tau' of its own files"
    )
    fitted = call("fit", *measured, *COMMON, *files, "--simulated-torque", "tau",
                  "--effects", "motor_crosstalk", "--out", tmp_path / "joint")  # fmt: skip
    assert fitted.exit_code == 0, fitted.stderr
    content = json.loads((tmp_path / "joint" / "model.json").read_text(encoding="utf-8"))
    digest = hashlib.sha256(simulated[0].read_bytes()).hexdigest()
    kept = content["sensor"]["simulated"]
    assert kept["own_files"] and kept["files"][0]["sha256"] == digest
    told = call("predict", "--model", tmp_path / "joint" / "model.json", measured[0],
                "--simulation", simulated[0], "--simulated-torque", "tau",
                "--out", tmp_path / "p.csv")  # fmt: skip
    assert told.exit_code == 0, told.stderr
    all_told = call("predict", "--model", tmp_path / "joint" / "model.json", *measured, *files,
                    "--simulated-torque", "tau", "--out", tmp_path / "all")  # fmt: skip
    assert all_told.exit_code == 0, all_told.stderr
    assert (tmp_path / "all" / "run1.csv").read_bytes() == (tmp_path / "p.csv").read_bytes()


def test_the_command_line_refuses_two_bases_with_one_sentence(tmp_path: Path) -> None:
    measured, simulated = saved(tmp_path)
    both = call("discover", *measured, *COMMON, "--simulated-torque", "mujoco",
                "--effects", "offset", "--out", tmp_path / "x")  # fmt: skip
    assert both.exit_code == 2 and "give exactly one to start from" in both.stderr
    none = call("compare", *measured, "--out", tmp_path / "x")
    assert none.exit_code == 2 and "give exactly one of --model" in none.stderr
    few = call("compare", *measured, *COMMON, "--simulation", simulated[0],
               "--simulated-torque", "tau", "--out", tmp_path / "x")  # fmt: skip
    assert few.exit_code == 2 and "one file for each run" in few.stderr
    wrong = call("compare", *measured, *COMMON, "--simulated-torque", "mujco",
                 "--out", tmp_path / "x")  # fmt: skip
    assert wrong.exit_code == 2 and "mujoco" in wrong.stderr


@pytest.mark.parametrize("first", [0.0, 1e5])
def test_a_delay_of_a_simulation_is_told_whenever_the_clock_began(first: float) -> None:
    made = run(1, holds_load=True, late=0.05)
    log = made.with_columns({"time": made["time"] + first}, note="another clock")
    (said,) = late(log, log["sensor_torque"], log["simulated_torque"], "simulation")
    assert said.size == pytest.approx(0.05, abs=0.3 * SAMPLE)


def test_how_far_a_delay_is_looked_for_follows_from_the_length_of_a_run_not_from_its_clock() -> (
    None
):
    made = run(1, holds_load=True, late=0.28).rows(slice(0, 401))
    told = []
    for first in (0.0, 1e5):
        log = made.with_columns({"time": made["time"] + first}, note="another clock")
        told += late(log, log["sensor_torque"], log["simulated_torque"], "simulation")
    assert len(told) == 2
    assert told[1].size == pytest.approx(told[0].size, abs=1e-5)
