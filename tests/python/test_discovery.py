"""What a model lacks is found in runs that hide it, named, added, and the gap shrinks."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hidden_logs import LOAD, friction_of, log_of, noise, rich_run

import flexspline
from flexspline.discovery.result import Discovery, NoiseFloor
from flexspline.effects import effect
from flexspline.logs.log import Log

BASE = ["offset", "coulomb_friction", "viscous_friction", "inertia"]
RUNS, ROWS = 4, 2000
Array = np.ndarray


def crosstalk(c: dict[str, Array]) -> Array:
    return 0.05 * c["motor_torque"]


def by_temperature(c: dict[str, Array]) -> Array:
    return np.asarray(0.06 * c["output_velocity"] * np.expm1(-0.04 * (c["temperature"] - 25)))


def power(c: dict[str, Array]) -> Array:
    """Load times velocity: no effect of the catalogue."""
    return 0.004 * c[LOAD] * c["output_velocity"]


def unbalance(c: dict[str, Array]) -> Array:
    return 0.03 * np.sin(c["output_position"] - 0.3)


HIDDEN = {"": [], "one": [crosstalk], "two": [crosstalk, by_temperature],
          "unknown": [power], "gravity": [unbalance]}  # fmt: skip


@cache
def runs(hidden: str) -> tuple[Log, ...]:
    made = []
    for seed in range(1, RUNS + 1):
        c = rich_run(seed, ROWS)
        torque = c[LOAD] + friction_of(c) + noise(seed, ROWS)
        made.append(log_of(c, sensor_torque=torque + sum(term(c) for term in HIDDEN[hidden])))
    return tuple(made)


@cache
def found(hidden: str) -> Discovery:
    return flexspline.discover(BASE, runs(hidden), target="sensor_torque", known_load=LOAD)


def test_a_hidden_effect_is_named_and_most_of_the_gap_is_closed() -> None:
    made = found("one")
    assert made.names == ("motor_crosstalk",)
    (one,) = made.found
    assert one.rmse_after < one.rmse_before
    assert one.share_of_gap == pytest.approx(1.0, abs=1e-3)  # nothing else closes any of it
    assert made.gap_closed > 0.9
    assert made.unexplained is None and made.next_experiment is None
    (leak,) = made.parameters("motor_crosstalk")
    assert abs(leak.value - 0.05) < 4.0 * leak.standard_error


def test_two_hidden_effects_are_both_named() -> None:
    made = found("two")
    assert set(made.names) == {"motor_crosstalk", "temperature_dependent_friction"}
    assert made.found[1].rmse_after < made.found[0].rmse_after < made.base_rmse


def test_nothing_is_named_where_nothing_is_hidden() -> None:
    made = found("")
    assert made.names == () and made.unexplained is None
    assert "Nothing is missing" in str(made)


def test_a_cause_that_is_not_in_the_catalogue_gets_no_name() -> None:
    made = found("unknown")
    assert made.names == ()
    assert made.unexplained is not None and made.unexplained.share_of_variance > 0.9
    assert set(made.unexplained.depends_on) == {LOAD, "output_velocity"}


def test_gravity_and_a_first_order_of_the_output_are_not_told_apart() -> None:
    (one,) = found("gravity").found
    assert one.effect == "gravity" and one.indistinguishable_from == ("output_ripple",)
    assert "gravity and output_ripple" in str(found("gravity").next_experiment)


def test_the_extended_model_survives_its_file_and_is_a_start_itself(tmp_path: Path) -> None:
    made = found("one")
    made.model.save(tmp_path / "model.json")
    again = flexspline.Model.load(tmp_path / "model.json")
    log = runs("one")[0]
    expected = made.model.predict(log).predicted
    assert np.array_equal(again.predict(log).predicted, expected, equal_nan=True)
    assert flexspline.discover(again, runs("one")).names == ()


def test_what_the_user_of_a_model_fixed_stays_fixed() -> None:
    fit = flexspline.fit(BASE, runs("one"), "sensor_torque", known_load=LOAD,
                         fixed={"inertia": 0.0195})  # fmt: skip
    made = flexspline.discover(fit.model, runs("one"))
    assert made.names == ("motor_crosstalk",)
    assert made.fit["inertia"].value == 0.0195 and made.fit["inertia"].state == "fixed"


def test_the_json_is_the_contract_of_the_command_line() -> None:
    content = json.loads(found("gravity").to_json())
    keys = {"target", "base_effects", "found", "rmse", "simulated_rmse", "data_faults",
            "unexplained", "next_experiment"}  # fmt: skip
    assert keys <= set(content)
    assert set(content["found"][0]) >= {"effect", "rmse_before", "rmse_after", "confidence",
                                        "indistinguishable_from", "where", "evidence"}  # fmt: skip
    assert set(content["rmse"]) == {"base", "final", "noise_floor"}
    assert content["base_effects"] == BASE


@pytest.mark.parametrize("hidden", HIDDEN)
def test_what_is_left_is_never_called_a_noise_floor(hidden: str) -> None:
    """It bounds the noise; a floor is below it, and something other than the error says so."""
    made = found(hidden)
    text = " ".join(str(made).split())
    headline = text.split(" Noise")[0]
    if made.unexplained is None:
        assert made.floor.by == "names" and made.noise_floor == made.final_rmse
        assert "noise floor" not in text.lower()
        assert "Noise: at most what is left" in text
        assert not made.names or "and no channel is seen to tell more that matters" in headline
    else:
        assert made.floor.by in ("functions", "place") and made.noise_floor < made.final_rmse
        assert "Noise floor: at most" in text
    assert 0.0 < made.floor.error < 0.1 * made.noise_floor
    content = json.loads(made.to_json())
    assert content["noise_floor_error"] == made.floor.error
    assert content["noise_floor_method"].startswith("what is left")


@pytest.mark.usefixtures("undrawn")
def test_what_is_unexplained_and_too_small_to_matter_changes_no_headline(
    tmp_path: Path,
) -> None:
    made = found("unknown")
    floor = replace(made.floor, rmse=0.995 * made.final_rmse)
    small = replace(made, floor=floor, doubted=())
    headline = " ".join(str(small).split()).split(". ")[0]
    assert headline.startswith("Nothing that matters is missing")
    assert f"less than {0.01 * made.final_rmse:.3g} Nm is unexplained" in headline
    assert "Unexplained: " in str(small)
    for each, grave in ((made, True), (small, False)):
        each.report(tmp_path / "report.html")
        assert ('class="verdict critical"' in (tmp_path / "report.html").read_text()) is grave
    assert str(made).startswith("No effect that is known explains")


@pytest.mark.parametrize("error", [0.001, float("nan")])
def test_what_folds_cannot_size_is_never_called_too_small(error: float) -> None:
    made = found("unknown")
    alone = replace(made, floor=NoiseFloor(made.final_rmse, error, "names"), doubted=())
    text = " ".join(str(alone).split())
    assert text.startswith("No effect that is known explains")
    assert "how much lower it is they do not tell" in text
    assert "nan" not in text and "Nothing that matters" not in text
    named = replace(alone, found=found("one").found, fit=found("one").fit)
    assert "how much of that is noise is not known." in " ".join(str(named).split())


def test_a_late_velocity_is_a_fault_before_it_is_physics() -> None:
    late = []
    for log in runs("one"):
        shifted = np.interp(log["time"] - 0.05, log["time"], log["output_velocity"])
        late.append(log.with_columns({"output_velocity": shifted}, note="50 ms late"))
    made = flexspline.discover(BASE, late, target="sensor_torque", known_load=LOAD)
    assert "velocity_delay" in {fault.name for fault in made.data_faults}
    assert json.loads(made.to_json())["data_faults"][0]["rows"]


@pytest.mark.usefixtures("undrawn")
def test_a_report_holds_names_and_evidence(tmp_path: Path) -> None:
    made = found("two")
    made.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for one in made.found:
        assert one.effect in page and one.effect in str(made)
        assert 0.0 < one.confidence < 1.0


@pytest.mark.parametrize("given", ["no target", "no log"])
def test_a_call_that_lacks_something_is_refused_with_a_sentence(given: str) -> None:
    logs = [] if given == "no log" else list(runs("one"))
    target = None if given == "no target" else "sensor_torque"
    with pytest.raises(flexspline.InputError, match="give"):
        flexspline.discover([effect("offset")], logs, target=target)
