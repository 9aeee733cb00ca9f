"""Fits to the motion: known parameters come back, intervals hold the folds, starts agree."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from cli_calls import call
from output_error_logs import EFFECTS, FACTS, KNOWN, STEP, TRUE, law, runs

import flexspline
from flexspline import MotionOptions
from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.least_squares.result import Fit
from flexspline.logs.writing import write_log
from flexspline.model import Model, Part
from flexspline.output_error.cost import Searched, Space
from flexspline.output_error.fitting import cost_of, settings_of, with_servo_torque
from flexspline.plot import simulated_motion
from flexspline.report.html import python_call

FREE = ("torque", "back_emf")


@cache
def wrong_start() -> Fit:
    """From a law whose torque is 1.5 times and whose back-EMF is half of the true one."""
    return flexspline.fit_motion(
        EFFECTS,
        runs(),
        "motor_torque",
        fixed=KNOWN,
        controller=law(torque=0.375, back_emf=0.03),
        options=MotionOptions(starts=2, free_controller=FREE),
    )


@cache
def open_loop() -> Fit:
    """Driven by the measured torque of two runs, the law's true torque among their channels."""
    given = [with_servo_torque(log, law(), "motor_torque") for log in runs()[:2]]
    return flexspline.fit_motion(
        EFFECTS,
        given,
        "motor_torque",
        fixed={"gravity.cosine": 0.0},
        options=MotionOptions(starts=2),
    )


@pytest.mark.parametrize("name", TRUE)
def test_a_known_joint_comes_back_within_its_intervals_from_a_wrong_law(name):
    low, high = wrong_start()[name].interval
    assert low <= TRUE[name] <= high


def test_the_regression_with_the_wrong_law_was_far_off():
    found = wrong_start().simulation
    assert found.regressed[found.names.index("controller.torque")] == pytest.approx(0.375)
    assert found.regression > 20.0 * found.rmse


def test_what_is_left_is_a_step_or_two_of_the_encoder():
    # noise and rounding leave 1.1 mrad; the servo's law counts from a first angle that has them too
    found = wrong_start().simulation
    assert found.rmse < found.held_out < 2.5 * STEP


@pytest.mark.parametrize("made", [wrong_start, open_loop])
def test_intervals_hold_what_every_fold_found(made):
    fit = made()
    for name, values in zip(fit.simulation.names, fit.simulation.folds.T, strict=True):
        low, high = fit[name].interval
        assert low <= values.min() and values.max() <= high, name


def test_all_starts_end_at_the_same_joint():
    found = wrong_start().simulation
    assert found.best_starts == len(found.starts) == 2
    assert "2 starts ended between" in str(wrong_start())


def test_an_arm_that_goes_over_the_top_is_found_from_pieces_of_its_runs():
    # from the regression the search ends 0.24 rad off: a turn more or less of the arm
    fit = flexspline.fit_motion(
        EFFECTS,
        runs(6, 9),
        "motor_torque",
        fixed=KNOWN,
        controller=law(torque=0.3, back_emf=0.04),
        options=MotionOptions(starts=2, free_controller=FREE),
    )
    from_regression, from_pieces = (start.rmse for start in fit.simulation.starts)
    assert from_regression > 0.1 and from_pieces < 3.0 * STEP
    assert not [said for said in fit.warnings if "starts that end nearly as low" in said]
    for name, value in TRUE.items():
        low, high = fit[name].interval
        assert low <= value <= high, name


def test_the_saved_model_and_law_move_as_the_fit_says(tmp_path):
    fit = wrong_start()
    fit.model.save(tmp_path / "model.json")
    fit.simulation.controller.save(tmp_path / "servo.json")
    model = Model.load(tmp_path / "model.json")
    for log, run in zip(runs(), fit.simulation.runs, strict=True):
        again = flexspline.simulate(model, log, controller=tmp_path / "servo.json")
        assert again.rmse == pytest.approx(run.rmse, rel=0.02)
    assert len(model.part().record["simulation"]["starts"]) == 2


def test_the_range_of_the_torque_is_that_of_the_law_as_it_was_fitted():
    fit = wrong_start()
    servo = fit.simulation.controller
    torque = [with_servo_torque(log, servo, "motor_torque")["motor_torque"] for log in runs()]
    ends = [min(t.min() for t in torque), max(t.max() for t in torque)]
    assert fit.part.record["target_range"] == pytest.approx(ends, rel=1e-12)


def test_measured_torque_drives_where_there_is_no_law():
    fit = open_loop()
    assert fit.simulation.controller is None and fit.simulation.folds_by == "blocks"
    for name in ("inertia.inertia", "coulomb_friction.level", "load_dependent_friction.factor"):
        low, high = fit[name].interval
        assert low <= TRUE[name] <= high, name


def test_the_same_seed_gives_the_same_fit_on_any_number_of_threads():
    def fit(threads):
        return flexspline.fit_motion(
            EFFECTS[:3],
            runs()[:2],
            "motor_torque",
            fixed=KNOWN,
            controller=law(),
            options=MotionOptions(starts=2, folds=2, threads=threads),
        )

    assert fit(1).simulation.starts == fit(2).simulation.starts


def test_the_command_leaves_model_law_and_report(tmp_path):
    paths = [tmp_path / f"{k}.csv" for k in range(2)]
    for log, path in zip(runs(), paths, strict=False):
        write_log(log, path)
    law().save(tmp_path / "servo.json")
    made = call(
        "fit", *paths, "--target", "motor_torque", "--effects", ",".join(EFFECTS[:3]),
        "--by", "simulation", "--controller", tmp_path / "servo.json", "--free-controller",
        "back_emf", "--starts", 1, "--out", tmp_path / "out",
    )  # fmt: skip
    assert made.exit_code == 0, made.output
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "model.json", "servo.json", "report.html"
    }  # fmt: skip
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Starts ended at" in page and "run 1" in page and "flexspline.fit_motion(" in page
    assert "simulated position is off by" in " ".join(made.output.split())


def test_its_figure_shows_measured_and_simulated_motion_of_the_worst_run_and_of_any_other():
    fit = wrong_start()
    worst = int(np.argmax([run.held_out for run in fit.simulation.runs]))
    for name, number in (("worst", worst), (fit.simulation.runs[0].name, 0)):
        measured, simulated = simulated_motion(fit, name).lines
        made = flexspline.simulate(fit.model, runs()[number], controller=fit.simulation.controller)
        assert np.isin(simulated.get_ydata(), made.simulated).all()
        assert np.isin(measured.get_ydata(), runs()[number]["output_position"]).all()
    with pytest.raises(InputError, match="no run 'none' in this fit; it has"):
        simulated_motion(fit, "none")


COARSE = ["inertia", "gravity", "coulomb_friction", "viscous_friction"]
WAVES = ((0.1, 1.5), (0.23, 1.2), (0.41, 0.8), (0.7, 0.6))  # Hz, Nm


@cache
def coarse() -> tuple[flexspline.Log, ...]:
    """A pendulum under a measured torque; of its motion the counts of a coarse encoder alone."""
    part = Part("motor_torque", tuple(map(effect, COARSE)), [0.25, 1.6, 0.0, 0.4, 0.35])
    model, made = Model({"drive": part}, FACTS), []
    time = np.arange(0.0, 15.0, 0.005)
    for number in range(2):
        draw = np.random.default_rng(number)
        torque = sum(
            size * np.sin(2 * np.pi * hz * time + draw.uniform(0.0, 6.3)) for hz, size in WAVES
        )
        log = flexspline.Log.from_arrays(
            time=time, output_position=np.zeros(len(time)), motor_torque=torque,
            facts={**FACTS, "name": f"run {number}"},
        )  # fmt: skip
        angle = flexspline.simulate(model, log).simulated + draw.normal(0.0, 2e-4, len(time))
        seen = {
            "output_position": STEP * np.round(angle / STEP),
            "motor_torque": torque + draw.normal(0.0, 0.03, len(time)),
        }
        made.append(log.with_columns(seen, note="measured"))
    return tuple(made)


@cache
def motion_of_coarse() -> Fit:
    return flexspline.fit_motion(COARSE, coarse(), "motor_torque", options=MotionOptions(starts=1))


def test_the_torque_of_a_coarse_encoder_is_told_as_well_as_by_the_regression(tmp_path):
    plain, moved = flexspline.fit(COARSE, coarse(), "motor_torque"), motion_of_coarse()
    assert plain.part.preparations
    assert moved.part.preparations == plain.part.preparations
    assert moved.cv_rmse < 1.1 * plain.cv_rmse
    moved.model.save(tmp_path / "model.json")
    left = Model.load(tmp_path / "model.json").predict(coarse()[0]).rmse
    assert left < 1.1 * plain.model.predict(coarse()[0]).rmse


def test_the_regression_that_a_motion_is_compared_with_is_the_one_that_fit_makes():
    plain, moved = flexspline.fit(COARSE, coarse(), "motor_torque"), motion_of_coarse()
    for log, run in zip(coarse(), moved.simulation.runs, strict=True):
        assert run.regression == pytest.approx(flexspline.simulate(plain.model, log).rmse, rel=0.01)


def test_what_the_torque_is_predicted_from_can_be_chosen_and_stands_in_the_call_of_the_report():
    how = MotionOptions(starts=1, folds=2, bandwidth=30.0)
    made = flexspline.fit_motion(COARSE, coarse()[0], "motor_torque", options=how)
    assert {way.bandwidth for way in made.part.preparations} == {30.0}
    assert "bandwidth=30.0" in python_call(made)


def test_a_low_pass_is_that_of_the_errors_of_the_torque_too():
    given = {"effects": COARSE, "logs": coarse(), "target": "motor_torque", "lowpass": 20.0}
    moved = flexspline.fit_motion(**given, options=MotionOptions(starts=1, folds=2))
    assert moved.cv_rmse < 1.1 * flexspline.fit(**given).cv_rmse


WRONG = {
    "needs the effect inertia": {"effects": EFFECTS[1:]},
    "the target is sensor_torque": {"target": "sensor_torque"},
    "scales all coefficients alike": {"fixed": {"gravity.cosine": 0.0}},
    "'limit' cannot be fitted": {"options": MotionOptions(free_controller=["limit"])},
    "give a guess above zero": {"controller": law(back_emf=0.0)},
    "give the controller": {"controller": None},
    "no parameter 'inertai'": {"bounds": {"inertai": (0.0, 1.0)}},
}


@pytest.mark.parametrize("sentence", WRONG)
def test_a_wrong_call_is_told_what_to_do(sentence):
    given = {
        "effects": EFFECTS, "logs": runs()[:2], "target": "motor_torque", "fixed": KNOWN,
        "controller": law(), "options": MotionOptions(free_controller=FREE), **WRONG[sentence],
    }  # fmt: skip
    with pytest.raises(InputError, match=sentence):
        flexspline.fit_motion(**given)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"starts": 0}, "starts is 0; give a whole number from 1 up"),
        ({"folds": 1}, "folds is 1; give a whole number from 2 up"),
        ({"robust": "tukey"}, "robust is 'tukey'; give 'huber' or None"),
    ],
)
def test_options_that_cannot_be_are_refused_where_they_are_made(wrong, sentence):
    with pytest.raises(InputError, match=sentence):
        MotionOptions(**wrong)
    with pytest.raises(TypeError, match="start"):
        MotionOptions(start=3)


def test_runs_that_do_not_move_are_refused():
    still = runs()[0].with_columns({"output_position": np.zeros(len(runs()[0]))}, note="held")
    with pytest.raises(InputError, match="no log moves"):
        flexspline.fit_motion(EFFECTS, still, "motor_torque", fixed=KNOWN, controller=law())


def test_a_log_without_torque_and_duty_is_refused():
    kept = {name: runs()[0][name] for name in runs()[0].channels if name != "duty"}
    log = flexspline.Log.from_arrays(**kept, facts=dict(runs()[0].facts))
    with pytest.raises(InputError, match="motor_torque or duty"):
        flexspline.fit_motion(EFFECTS, log, "motor_torque", controller=law())


def test_what_a_law_without_a_supply_gives_is_its_torque_by_the_duty() -> None:
    log, plain = runs()[0], replace(law(), supply=False)
    given = with_servo_torque(log, plain, "motor_torque")["motor_torque"]
    expected = plain.torque * log["duty"] - plain.back_emf * log["output_velocity"]
    np.testing.assert_allclose(given, expected, atol=1e-12)


def test_limits_of_a_search_are_those_that_were_given_in_its_own_coordinates() -> None:
    name = "viscous_friction.viscosity"
    one = Searched(name, "coefficient", "", 0.01, False, 0.05, 0.004, 0.02)
    low, high = Space(wrong_start().part, (name,), (one,)).bounds
    assert (0.05 * low[0], 0.05 * high[0]) == pytest.approx((0.004, 0.02))


def test_a_number_away_from_its_limits_is_fitted_and_memory_lowers_what_it_is_known_by() -> None:
    level = wrong_start()["coulomb_friction.level"]
    assert level.state == "fitted" and level.determined
    rows = sum(len(log) for log in runs())
    assert 1.0 < level.effective_samples < rows


def test_slopes_of_a_servo_are_those_of_an_exact_encoder_and_errors_those_of_its_counts() -> None:
    servo, logs = law(), list(runs(2))
    settings = settings_of(servo, MotionOptions())
    driven = [with_servo_torque(log, servo, "motor_torque") for log in logs]
    regression = flexspline.fit(EFFECTS, driven, "motor_torque", fixed=KNOWN)
    cost = cost_of(regression, driven, settings, {}, int, 1)
    exact = replace(
        cost, runs=[replace(run, servo=replace(servo.for_log(log), encoder_step=0.0))
                    for run, log in zip(cost.runs, logs, strict=True)]
    )  # fmt: skip
    at = cost.space.start
    for central in (False, True):
        assert np.array_equal(
            cost.jacobian(at, central=central), exact.jacobian(at, central=central)
        )
    assert not np.array_equal(cost.residuals(at), exact.residuals(at))
