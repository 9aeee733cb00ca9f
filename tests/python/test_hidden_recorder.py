"""The benchmark's recorder: what it writes, how large a hidden term is behind it, what is right."""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

from hidden.by_class import CLASS_BARS, class_shares
from hidden.cases import RECORDED_SIZES, Case, cases, recorded_cases
from hidden.gap import base_rows_of, closed
from hidden.laws import unseen_errors
from hidden.made import Made, made_of
from hidden.recorded import Rig, UnreachableError, recorded
from hidden.recorder import CAPACITY, MILLISECOND, RANGES, Recorder, recorder_of
from hidden.rig import LOAD
from hidden.row_noise import RowNoise, inputs_of
from hidden.size import sized
from hidden.small import SHARE, SMALL_T
from hidden.tables import text
from hidden.trial import Outcome
from hidden.verdict import judged_recorded
from hidden.writing import written

import flexspline
from flexspline.discovery.faults import DataFault
from flexspline.effects import effect

Array = np.ndarray
ROBOT = Case(1, "single", "motor_current", ("gravity",), "", (), 50.0, 12, "small", "swings",
             "AR 0.6", 0.01, recorder="robot")  # fmt: skip
LAB = Case(1, "single", "sensor_torque", ("viscous_friction",), "", (), 50.0, 12, "small", "moves",
           "AR 0.6", 0.01, recorder="lab")  # fmt: skip
DIFFERENT = replace(ROBOT, seed=11, hidden=("stribeck_friction",))
"""Viscous friction differs between directions here, and small effects are there besides."""


@cache
def made(case: Case) -> Made:
    return recorded(case)


def settings(recorder: str, count: int = 300) -> list[Recorder]:
    case = LAB if recorder == "lab" else ROBOT
    return [recorder_of(replace(case, seed=seed), 5) for seed in range(count)]


def test_the_exact_cases_are_those_that_they_were() -> None:
    keys = "\n".join(f"{c.key} {c.seed} {c.joint} {c.excitation} {c.noise} {c.level}"
                     for c in cases())  # fmt: skip
    assert hashlib.sha256(keys.encode()).hexdigest()[:16] == "8053e7c739a08b67"


def test_the_exact_runs_are_those_that_they_were() -> None:
    case = replace(LAB, recorder="exact", seed=5, hidden=("sensor_lag",))
    log = made_of(case).logs[1]
    rows = [0, 1234, 3999]
    assert log["sensor_torque"][rows] == pytest.approx(
        [6.837279978862, 1.919936620134, -2.556336135634], abs=1e-9
    )
    assert log["output_velocity"][rows] == pytest.approx(
        [0.406206157415, -0.525369651426, -0.612392295767], abs=1e-9
    )


@pytest.mark.parametrize("recorder", ["lab", "robot"])
def test_every_setting_is_drawn_from_its_range(recorder: str) -> None:
    drawn, ranges = settings(recorder), RANGES[recorder]
    assert {r.rate for r in drawn} == set(ranges["rate"])
    assert all(5 * r.rate * r.seconds <= 40_000 and r.seconds <= 20.0 for r in drawn)
    bits = [np.log2(2.0 * np.pi / r.output_quantum) for r in drawn]
    assert min(bits) == pytest.approx(ranges["output_bits"][0])
    assert max(bits) == pytest.approx(ranges["output_bits"][1])
    sided = [abs(2.0 * r.one_way) for r in drawn if r.one_way]
    assert 0.4 < len(sided) / len(drawn) < 0.6
    assert ranges["one_way"][0] <= min(sided) and max(sided) <= ranges["one_way"][1]


def test_a_laboratory_has_its_noise_delays_and_quanta_in_the_stated_ranges() -> None:
    drawn, ranges = settings("lab"), RANGES["lab"]
    for name in ("velocity_cutoff", "velocity_noise", "velocity_delay", "load_delay",
                 "temperature_noise", "temperature_lag", "motor_noise", "jitter"):  # fmt: skip
        values, (low, high) = [getattr(r, name) for r in drawn], ranges[name]
        assert low <= min(values) and max(values) <= high, name
        assert max(values) > low + 0.9 * (high - low), name
    noise = [r.load_noise / CAPACITY for r in drawn]
    assert min(noise) >= 2e-4 and max(noise) <= 2e-3
    with_acceleration = sum(r.acceleration_noise is not None for r in drawn)
    assert 0.4 < with_acceleration / len(drawn) < 0.6
    assert {r.velocity_order for r in drawn} == {1, 2}


def test_a_laboratory_log_holds_what_its_recorder_says() -> None:
    case = replace(LAB, kind="nothing", hidden=(), size=0.0)
    one, r = made(case), made(case).recorder
    assert r is not None
    for log, s in zip(one.logs, one.scenes, strict=False):
        assert np.abs(log["output_position"] - s.q).max() <= 0.5001 * r.output_quantum
        assert np.abs(log["motor_position"] - s.theta).max() <= 0.5001 * r.motor_quantum
        late = s.load - r.load_delay * np.gradient(s.load, s.time)
        noise = np.hypot(r.load_noise, r.load_quantum / np.sqrt(12.0))
        assert np.std(log[LOAD] - late) == pytest.approx(noise, rel=0.05)
        assert np.abs(np.diff(log["time"]) * r.rate - 1.0).max() <= 2.0 * r.jitter
        corner = 1.0 / (2.0 * np.pi * r.velocity_cutoff)
        lag = r.velocity_delay + corner * (1.0 if r.velocity_order == 1 else 3.0**0.5)
        found = -(log["output_velocity"] - s.v) @ s.a / (s.a @ s.a)
        assert found == pytest.approx(lag, rel=0.3)
    assert ("output_acceleration" in one.logs[0]) == (r.acceleration_noise is not None)


def test_a_robots_log_has_whole_milliseconds_missing_rows_and_a_velocity_of_differences() -> None:
    one, r = made(replace(ROBOT, kind="nothing", hidden=(), size=0.0)), made(ROBOT).recorder
    assert r is not None
    rows = round(r.rate * r.seconds)
    for log in (*one.logs, *one.unseen):
        assert set(log.channels) == {"time", "output_position", "output_velocity", "motor_current"}
        assert len(log) == rows - round(1e-3 * rows)
        ticks = log["time"] / MILLISECOND
        assert np.abs(ticks - np.round(ticks)).max() < 1e-6
        steps = np.diff(log["motor_current"]) / r.current_quantum
        assert np.abs(steps - np.round(steps)).max() < 1e-6
        together = np.diff(log["time"]) < 1.5 / r.rate
        differences = np.diff(log["output_position"])[together] * r.rate
        assert log["output_velocity"][1:][together] == pytest.approx(differences, abs=1e-9)


def test_a_recorded_case_is_made_twice_alike_and_other_draws_differ_in_noise_alone() -> None:
    first, again = made(ROBOT), recorded(ROBOT)
    for a, b in zip(first.logs + first.unseen, again.logs + again.unseen, strict=True):
        assert all(a[name].tobytes() == b[name].tobytes() for name in a.channels)
    rig = Rig(LAB)
    here, there = rig.taken(0, 1), rig.taken(0, 2)
    assert np.array_equal(here.stamps, there.stamps)
    assert not np.array_equal(here.columns[LOAD], there.columns[LOAD])
    noise = here.columns[LOAD] - there.columns[LOAD]
    assert np.std(noise) < 3.0 * np.hypot(rig.recorder.load_noise, rig.recorder.load_quantum)


@pytest.mark.parametrize("case", [ROBOT, LAB], ids=["robot", "lab"])
def test_estimates_over_draws_of_the_recorder_scatter_as_the_size_says(case: Case) -> None:
    """Generalised least squares by the true forms, fed with what the recorder wrote."""
    (name,), one, rig, each = case.hidden, made(case), Rig(case), 30
    form = rig.form(name)
    factor = one.terms[name][0][100] / form(rig.scenes[0])[100]
    columns = [np.column_stack([base_rows_of(one, k), one.sizing.disturbing[k],
                                form(rig.scenes[k])]) for k in range(rig.runs)]  # fmt: skip
    rows = one.sizing.whitened(columns)
    scale = np.linalg.norm(rows, axis=0)
    pull = np.linalg.pinv(rows / scale, rcond=1e-6)[-1] / scale[-1]
    errors = RowNoise.drawn(rig, range(100, 100 + each))  # others than those of the size
    found = []
    for draw in range(each):
        y = [(errors.base[k][draw] + factor * errors.terms[name][k][draw]
              + factor * form(rig.scenes[k]))[:, None] for k in range(rig.runs)]  # fmt: skip
        found.append(float(pull @ one.sizing.whitened(y)[:, 0]))
    assert np.mean(found) == pytest.approx(factor, rel=5.0 / one.t_base[name])
    error = np.std(found, ddof=1)
    slack = 3.0 / np.sqrt(2.0 * (each - 1))  # three errors of a deviation from so many draws
    assert factor / error == pytest.approx(one.t_base[name], rel=slack)
    assert one.t_base[name] >= case.size * 0.98


def test_the_noise_that_goes_through_a_term_bounds_its_t() -> None:
    case = replace(ROBOT, hidden=("stribeck_friction",), size=1e6)
    with pytest.raises(UnreachableError, match="stribeck_friction") as reason:
        recorded(case)
    largest = reason.value.largest["stribeck_friction"]
    assert 50.0 < largest < 1e5
    with pytest.raises(UnreachableError):
        recorded(replace(case, size=0.85 * largest))
    assert recorded(replace(case, size=0.5 * largest)).t_base["stribeck_friction"] > 0.49 * largest


def test_inputs_are_read_from_the_better_of_a_channel_and_its_position() -> None:
    rig = Rig(replace(ROBOT, seed=4))  # 12 bits: its velocity of differences is useless
    seen, widths = rig.taken(0), {}
    read = inputs_of(rig, seen, widths)
    raw = np.std(seen.columns["output_velocity"] - seen.truth.v)
    assert widths["v"] is not None and np.std(read.v - seen.truth.v) < 0.1 * raw
    assert np.array_equal(read.load, read.joint.link * np.sin(read.q - 0.3))


def test_small_effects_have_the_stated_share_and_stay_below_their_t() -> None:
    one, rig = made(DIFFERENT), Rig(DIFFERENT)
    assert rig.recorder.one_way and one.small
    (name,) = DIFFERENT.hidden
    hidden = np.concatenate(one.terms[name][: rig.runs])
    rest = [one.clean[k] - rig.known(s) - one.terms[name][k] for k, s in enumerate(one.scenes)]
    beside = [rig.form(small) for small in one.small]
    columns = np.column_stack([np.concatenate([f(s) for s in one.scenes]) for f in beside])
    share = np.linalg.lstsq(columns, np.concatenate(rest), rcond=None)[0]
    assert np.concatenate(rest) == pytest.approx(columns @ share, abs=1e-12)
    own = enumerate(one.sizing.disturbing)
    known = [np.column_stack([beside, one.terms[name][k]]) for k, beside in own]
    among = replace(one.sizing, disturbing=known)
    for small, form, factor in zip(one.small, beside, share, strict=True):
        term = [factor * form(s) for s in one.scenes]
        rms = np.sqrt(np.mean(np.concatenate(term[: rig.runs]) ** 2) / np.mean(hidden**2))
        assert SHARE[0] * 0.999 <= rms <= SHARE[1] * 1.001
        assert 1.0 / sized(among, {small: term}, 1.0)[small].factor < SMALL_T
    assert not made(replace(DIFFERENT, kind="nothing", hidden=(), size=0.0)).small


def test_viscous_friction_differs_between_directions_as_is_said() -> None:
    rig = Rig(replace(DIFFERENT, kind="nothing", hidden=(), size=0.0))
    s, own = rig.scenes[0], rig.joint
    back = replace(s, v=-s.v, a=-s.a, load=-s.load)
    even = 0.5 * (rig.known(s) + rig.known(back)) / rig.unit - own.offset
    assert even == pytest.approx(own.viscous * rig.recorder.one_way * np.abs(s.v), abs=1e-12)


def test_a_lag_of_the_sensor_is_its_difference_to_the_load_cells() -> None:
    rig = Rig(replace(LAB, hidden=("sensor_lag",)))
    seen = rig.taken(0)
    left = seen.columns[LOAD] - seen.truth.load
    assert abs(np.mean(left * np.gradient(seen.truth.load, seen.truth.time))) < 2e-3
    other = Rig(LAB).taken(0)
    slope = np.gradient(other.truth.load, other.truth.time)
    delay = -(other.columns[LOAD] - other.truth.load) @ slope / (slope @ slope)
    assert delay == pytest.approx(rig.recorder.load_delay, abs=2e-4)


def fault(name: str, channel: str, size: float = 0.0) -> DataFault:
    return DataFault("run1", name, channel, size, "s", (0, 1), "")


def judged(case: Case, names: tuple[str, ...], *, aliases: tuple[tuple[str, ...], ...] = (),
           small: tuple[str, ...] = (), unexplained: bool = False,
           faults: tuple[DataFault, ...] = ()) -> tuple[bool, bool]:  # fmt: skip
    """Whether the case is right, and whether a name or fault is wrong."""
    means = [name if name in case.hidden else "" for name in names]
    recorder = recorder_of(case, 5)
    verdict = judged_recorded(case, recorder, small, names, aliases or ((),) * len(names), means,
                              unexplained, faults)  # fmt: skip
    return verdict.right, verdict.wrong


def test_a_small_effect_may_be_named_behind_the_large_one_and_never_before_it() -> None:
    small = ("cogging",)
    assert judged(LAB, ("viscous_friction",), small=small) == (True, False)
    assert judged(LAB, ("viscous_friction", "cogging"), small=small) == (True, False)
    assert judged(LAB, ("cogging", "viscous_friction"), small=small) == (False, True)
    assert judged(LAB, ("cogging",), small=small) == (False, True)
    assert judged(LAB, ("viscous_friction", "cogging")) == (False, True)
    assert judged(LAB, ()) == (False, False)


def test_a_load_cells_delay_named_as_a_lag_is_right_only_with_the_delay_as_its_alias() -> None:
    nothing = replace(LAB, kind="nothing", hidden=(), size=0.0)
    assert recorder_of(nothing, 5).load_delay > 0.0
    assert judged(nothing, ("sensor_lag",)) == (False, True)
    assert judged(nothing, ("sensor_lag",), aliases=(("load_delay",),)) == (True, False)
    assert judged(nothing, ("gain_error",), aliases=(("load_delay",),)) == (False, True)


def test_a_fault_that_is_not_there_is_a_wrong_name() -> None:
    own, delay = ("viscous_friction",), recorder_of(LAB, 5).load_delay
    real = (fault("load_delay", LOAD, delay), fault("velocity_noise", "output_velocity"))
    assert judged(LAB, own, faults=real) == (True, False)
    assert judged(LAB, own, faults=(fault("load_delay", LOAD, 0.03),)) == (False, True)
    assert judged(LAB, own, faults=(fault("velocity_delay", "output_velocity", 0.05),))[1]
    assert judged(LAB, own, faults=(fault("dropped_samples", "time"),)) == (False, True)
    assert judged(ROBOT, ROBOT.hidden, faults=(fault("dropped_samples", "time"),))[0]
    assert judged(LAB, own, faults=(fault("gear_ratio", "motor_position"),)) == (False, True)


def test_an_unknown_cause_is_to_be_said_and_not_named() -> None:
    unknown = replace(LAB, kind="unknown", hidden=(), unknown="power")
    assert judged(unknown, (), unexplained=True) == (True, False)
    assert judged(unknown, ()) == (False, False)
    assert judged(unknown, ("gain_error",), unexplained=True) == (False, True)


def test_a_name_that_is_there_lowers_the_error_on_unseen_runs_and_another_hardly() -> None:
    one = made(replace(ROBOT, size=500.0))
    names = ("gravity", "position_dependent_friction")
    fit = flexspline.fit([*one.base, *(effect(n) for n in names)], one.logs, "motor_current",
                         checks=False)  # fmt: skip
    found = SimpleNamespace(model=fit.model, fit=fit, target="motor_current", names=names)
    errors = unseen_errors(one, found)
    (before, after, clear), (_, _, chance) = errors
    assert json.loads(json.dumps(errors)) == [[*each] for each in errors]
    assert all(type(value > 0.0) is bool for each in errors for value in each)
    assert after < before and clear > 5.0
    assert chance < 5.0


def test_the_true_model_closes_the_gap_behind_a_recorder() -> None:
    one = made(replace(ROBOT, size=500.0))
    fit = flexspline.fit([*one.base, "gravity"], one.logs, "motor_current", checks=False)
    assert closed(one, fit.model) > 0.8
    without = flexspline.fit(one.base, one.logs, "motor_current", checks=False)
    assert closed(one, without.model) < 0.2


@pytest.mark.parametrize("recorder", ["lab", "robot"])
def test_there_are_as_many_recorded_cases_as_are_asked_for(recorder: str) -> None:
    every = recorded_cases(recorder)
    assert len({c.key for c in every}) == len(every)
    assert sum(c.kind == "nothing" for c in every) >= 300
    for size in RECORDED_SIZES:
        named = [c for c in every if c.kind in ("single", "pair", "triple") and c.size == size]
        assert len(named) >= 190  # some are out of reach
    others = {c.seed for other in (cases(), cases(1), recorded_cases(recorder, 1)) for c in other}
    assert not others & {c.seed for c in every}
    assert {c.key for c in recorded_cases(recorder, 1)} == {c.key for c in every}


def test_the_table_of_a_class_has_its_bars_and_counts_what_was_not_dealt() -> None:
    plain = {"t_base": {}, "closest": {}, "faults": (), "unexplained": None,
             "closed": 0.95, "seconds": 2.0}  # fmt: skip
    right = Outcome(ROBOT, names=("gravity",), aliases=((),), confidences=(0.9,),
                    means=("gravity",), right=True, rmse=((2.0, 1.0),), told=(True,),
                    together=(True,), unseen=((2.0, 1.0, 9.0),), **plain)  # fmt: skip
    wrong = replace(right, names=("cogging",), means=("",), right=False, wrong=True, told=(False,),
                    together=(False,))  # fmt: skip
    undealt = replace(right, undealt={"gravity": 40.0}, right=False)
    said = {s.what: s for s in class_shares([right, wrong, undealt])}
    assert (said["right set of names, t = 50"].hits, said["right set of names, t = 50"].of) == (
        1,
        2,
    )
    assert said["right set of names, t = 50"].bar == CLASS_BARS["robot"][50.0]
    assert said["no wrong name or fault, all cases"].hits == 1
    assert said["names that lower the error and are told from zero"].hits == 1
    together = said["  by its coefficients together"]
    assert (together.hits, together.of) == (1, 2)
    table = text([right, wrong, undealt])
    assert "gravity, t = 50: 1" in table and "above 0.8 of the largest: 1 cases" in table
    assert Outcome.from_json(undealt.to_json()) == undealt


def test_the_runs_of_a_case_are_written_for_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(ROBOT, tmp_path)
    log = flexspline.read_log(tmp_path / "run1.csv")
    assert log["motor_current"].tobytes() == made(ROBOT).logs[0]["motor_current"].tobytes()
    assert "--target motor_current" in capsys.readouterr().out
