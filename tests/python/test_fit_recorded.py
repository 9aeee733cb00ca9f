"""Fits and comparisons of noisy recordings: prepared inputs, the load's delay, the bandwidth."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cli_calls import call
from recorded_joint import INERTIA, LEVEL, LOAD, OFFSET, VISCOUS, base, exact, friction, runs

import flexspline
from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.exporting.header import header_text
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.prepared import learned

TARGET = "sensor_torque"
AS_RECORDED = float("inf")
LATE = 0.004  # s
TRUTH = {
    "offset": OFFSET,
    "coulomb_friction": LEVEL,
    "viscous_friction": VISCOUS,
    "inertia": INERTIA,
}
MOTION = ("output_position", "output_velocity", "output_acceleration")


@cache
def late_runs() -> tuple[Log, ...]:
    return tuple(runs(3, late=LATE))


@cache
def fitted(bandwidth: float | None = None, more: str = "") -> flexspline.Fit:
    effects = [*base(), *([effect(more)] if more else [])]
    return flexspline.fit(
        effects,
        late_runs(),
        TARGET,
        known_load=LOAD,
        checks=False,
        options=flexspline.FitOptions(bandwidth=bandwidth),
    )


def exact_runs() -> list[Log]:
    made = []
    for seed in range(2):
        c = exact(seed)
        noise = np.random.default_rng(seed).normal(0.0, 0.01, len(c["time"]))
        made.append(Log.from_arrays(**c, sensor_torque=c[LOAD] + friction(c) + noise))
    return made


def test_exact_runs_give_to_the_bit_what_channels_as_recorded_give() -> None:
    both = [
        flexspline.fit(
            base(),
            exact_runs(),
            TARGET,
            known_load=LOAD,
            options=flexspline.FitOptions(bandwidth=bandwidth),
        )
        for bandwidth in (None, AS_RECORDED)
    ]
    assert both[0].model.to_json() == both[1].model.to_json()
    assert "prepared" not in both[0].part.record
    assert both[0].delay is None
    assert "Noisy channels" not in str(both[0])
    assert {row.channel for row in both[0].inputs} >= {*MOTION, LOAD}
    compared = flexspline.compare(both[0].model, exact_runs())
    (note,) = compared.notes
    assert compared.preparations == () and note.startswith("The model was fitted to these runs")


def test_coefficients_of_recorded_runs_are_within_three_errors_and_their_errors_small() -> None:
    plain, made = fitted(AS_RECORDED), fitted()
    for name, true in TRUTH.items():
        p = made[name]
        assert abs(p.value - true) < 3.0 * p.standard_error, name
        assert p.standard_error < plain[name].standard_error, name


def test_the_delay_of_the_load_is_found_and_stays_in_the_residual() -> None:
    made = fitted()
    assert made.delay is not None and made.delay.channel == LOAD
    assert abs(made.delay.seconds - LATE) < 4.0 * made.delay.standard_error
    assert made.delay.standard_error < 0.1 * LATE
    assert made.part.record["delay"]["seconds"] == made.delay.seconds
    told = [made.model.predict(run).residual for run in late_runs()]
    for run, residual in zip(made.runs, told, strict=True):
        assert run.residual == pytest.approx(residual, abs=1e-9)
    assert 0.5 * made.delay.rmse < made.rmse < made.cv_rmse
    assert "ms later than the target" in str(made)


def test_no_delay_is_looked_for_beside_an_effect_that_is_one_or_an_exact_load() -> None:
    assert fitted(more="sensor_lag").delay is None
    assert fitted(AS_RECORDED).delay is None


def test_a_model_keeps_how_its_channels_were_made(tmp_path: Path) -> None:
    made = fitted()
    ways = {way.channel: way for way in made.part.preparations}
    assert {*ways} == {"output_velocity", "output_acceleration", LOAD}  # those that rows read
    made.model.save(tmp_path / "model.json")
    assert flexspline.Model.load(tmp_path / "model.json").part().preparations == (
        made.part.preparations
    )
    assert "Expects output_velocity derived from output_position" in header_text(
        made.model, "joint"
    )
    assert fitted(AS_RECORDED).part.record["prepared"] == []


def test_the_bandwidth_of_the_motion_can_be_given() -> None:
    made = fitted(9.0)
    ways = {way.channel: way.bandwidth for way in made.part.preparations}
    assert {ways[name] for name in MOTION[1:]} == {9.0}
    assert ways[LOAD] == {w.channel: w.bandwidth for w in fitted().part.preparations}[LOAD]
    compared = flexspline.compare(fitted().model, late_runs(), bandwidth=9.0)
    assert json.loads(compared.to_json())["bandwidth_hz"] == 9.0


@pytest.mark.parametrize("bandwidth", [0.0, -3.0, float("nan"), 60.0])
def test_a_bandwidth_that_does_not_suit_is_refused(bandwidth: float) -> None:
    calls = (
        lambda: flexspline.fit(
            base(),
            late_runs(),
            TARGET,
            known_load=LOAD,
            options=flexspline.FitOptions(bandwidth=bandwidth),
        ),
        lambda: flexspline.compare(fitted().model, late_runs(), bandwidth=bandwidth),
        lambda: flexspline.discover(
            base(), late_runs(), target=TARGET, known_load=LOAD, bandwidth=bandwidth
        ),
    )
    for one in calls:
        with pytest.raises(InputError, match="bandwidth") as refused:
            one()
        assert "\n" not in str(refused.value)


def test_a_simulation_takes_no_bandwidth() -> None:
    with pytest.raises(InputError, match="leave bandwidth out"):
        flexspline.compare(fitted().model, late_runs(), simulated=True, bandwidth=9.0)


def test_compare_reads_channels_as_the_model_or_else_the_runs_tell() -> None:
    made = fitted()
    same = flexspline.compare(made.model, late_runs())
    assert same.preparations == made.part.preparations
    assert "Noisy channels" in str(same) and "derived from output_position" in str(same)
    of_exact = flexspline.fit(base(), exact_runs(), TARGET, known_load=LOAD).model
    learnt = flexspline.compare(of_exact, late_runs())
    assert learnt.preparations == learned(late_runs(), TARGET, LOAD)[1]
    raw = flexspline.compare(of_exact, late_runs(), bandwidth=AS_RECORDED)
    assert raw.preparations == ()
    assert flexspline.compare(fitted(AS_RECORDED).model, late_runs()).preparations == ()


def test_compare_measures_the_load_as_it_was_recorded() -> None:
    made = flexspline.compare(fitted().model, late_runs())
    for run, log in zip(made.runs, late_runs(), strict=True):
        assert np.array_equal(run.measured, log[TARGET] - log[LOAD])
    left = sum(int(np.isnan(run.modelled).sum()) for run in made.runs)
    fitted_to, not_compared = made.notes
    assert fitted_to.startswith("The model was fitted to these runs")
    assert f"{left} of" in not_compared


@pytest.mark.parametrize(("late", "source"), [(0.0, "output_velocity"), (0.02, "output_position")])
def test_a_velocity_that_is_late_does_not_make_the_motion(late: float, source: str) -> None:
    c, generator = exact(0), np.random.default_rng(5)
    noisy = c["output_position"] + generator.normal(0.0, 1e-3, len(c["time"]))
    velocity = np.interp(c["time"] - late, c["time"], c["output_velocity"])
    velocity = velocity + generator.normal(0.0, 1e-4, len(velocity))
    log = Log.from_arrays(
        time=c["time"], output_position=noisy, output_velocity=velocity, sensor_torque=c[LOAD]
    )
    noise, ways = learned([log], TARGET, None)
    assert noise["output_velocity"].delay == pytest.approx(late, abs=2e-3)
    assert {way.source for way in ways if way.channel == "output_acceleration"} == {source}


@pytest.mark.usefixtures("undrawn")
def test_the_command_line_takes_a_bandwidth_or_none(tmp_path: Path) -> None:
    write_log(late_runs()[0], tmp_path / "run.csv")
    start = ("fit", tmp_path / "run.csv", "--target", TARGET, "--known-load", LOAD)
    start = (*start, "--effects", "offset,coulomb_friction,viscous_friction,inertia")
    used = {}
    for said in ("none", "9", ""):
        asked = ("--bandwidth", said) if said else ()
        result = call(*start, *asked, "--out", tmp_path / f"out{said}")
        assert result.exit_code == 0, result.stderr
        content = json.loads((tmp_path / f"out{said}" / "model.json").read_text(encoding="utf-8"))
        used[said] = {w["channel"]: w["bandwidth"] for w in content["sensor"]["prepared"]}
        page = (tmp_path / f"out{said}" / "report.html").read_text(encoding="utf-8")
        assert "What the recorder added to the channels" in page
    assert used["none"] == {}
    assert used["9"]["output_velocity"] == 9.0 != used[""]["output_velocity"]
    wrong = call(*start, "--bandwidth", "wide", "--out", tmp_path / "wrong")
    assert wrong.exit_code == 2 and "'wide' is no number above zero" in wrong.stderr


def test_a_prior_that_says_nothing_changes_neither_the_delay_nor_its_error() -> None:
    made = fitted()
    with_prior = flexspline.fit(
        base(), late_runs(), TARGET, known_load=LOAD, priors={"coulomb_friction.level": (0.0, 1e6)}
    )
    assert made.delay is not None and with_prior.delay is not None
    assert with_prior.delay.seconds == pytest.approx(made.delay.seconds, rel=1e-6)
    assert with_prior.delay.standard_error == pytest.approx(made.delay.standard_error, rel=1e-3)


def test_a_delay_is_one_number_in_the_table_and_in_the_warnings_told_once_of_all_runs() -> None:
    """Of 60 ms a first-order estimate told 10 % too little of a motion of up to 2 Hz."""
    logs = []
    for number, late in enumerate((0.058, 0.060, 0.062)):
        time = np.arange(6000) * 0.005
        phases = np.random.default_rng(number).uniform(0.0, 2.0 * np.pi, 4)
        turns = 2.0 * np.pi * np.array([0.3, 0.7, 1.3, 2.0])[:, None]
        at = turns * (time - late) + phases[:, None]
        noise = 1e-5 * np.random.default_rng(number + 9).standard_normal((3, 6000))
        torque = 0.1 * np.sin(turns * time + phases[:, None]).sum(axis=0) + 1e-3 * noise[2] / 1e-5
        logs.append(Log.from_arrays(
            time=time,
            output_position=np.sin(turns * time + phases[:, None]).sum(axis=0) / 10 + noise[0],
            output_velocity=(turns * np.cos(at)).sum(axis=0) / 10 + noise[1],
            sensor_torque=torque,
            facts={"name": f"run {number}"},
        ))  # fmt: skip
    fit = flexspline.fit(["offset", "viscous_friction"], logs, "sensor_torque")
    (velocity,) = (noise for noise in fit.inputs if noise.channel == "output_velocity")
    assert velocity.delay == pytest.approx(0.060, abs=2e-4)
    (told,) = (said for said in fit.warnings if "output_velocity is" in said)
    late_ms = told.removeprefix("run 2: output_velocity is ").partition(" ± ")[0]
    assert float(late_ms) == pytest.approx(62.0, abs=0.002)
    assert "The same in run 0, run 1, where it is 58 ms or more." in told
