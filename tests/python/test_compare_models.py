"""Several models on the same rows: errors by run, AIC and BIC, what is refused, the figure."""

from __future__ import annotations

import html
from functools import cache

import numpy as np
import pytest
from figure_layout import figure_faults, page_faults
from fit_logs import FRICTION, chosen, fitted, friction, log_with, motion, run_of, simulated
from matplotlib.figure import Figure

import flexspline
from flexspline import InputError, Model
from flexspline.comparison.models import FITTED, HELD_OUT, PREDICTED, ModelComparison
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.model import Part
from flexspline.plot.comparison import missed_over


def log_of(seed: int, samples: int = 1000, **more) -> Log:
    return run_of(seed, samples, **more)


@cache
def runs() -> tuple[Log, ...]:
    return tuple(log_of(seed) for seed in range(4))


@cache
def whole() -> flexspline.Fit:
    return fitted(friction(), runs())


@cache
def small() -> flexspline.Fit:
    return fitted(friction()[:2], runs())


@cache
def compared() -> ModelComparison:
    return flexspline.compare_models({"whole": whole(), "small": small()}, runs())


def truth() -> Model:
    return Model({"sensor": Part("sensor_torque", tuple(friction()), FRICTION)})


def test_fits_are_judged_by_rows_that_they_never_saw():
    for at, fit in enumerate((whole(), small())):
        by_run = [s.cv_rmse for s in fit.scores if s.group == "run"]
        assert compared().errors()[:, at] == pytest.approx([*by_run, fit.cv_rmse], rel=1e-12)
    assert {kind for row in compared().kinds() for kind in row} == {HELD_OUT}


def test_a_model_and_a_fit_of_other_runs_are_judged_by_their_prediction():
    other = fitted(friction(), [log_of(9)])
    made = flexspline.compare_models({"true": truth(), "other": other}, runs())
    for at, model in enumerate((truth(), other.model)):
        missed = [model.predict(log, "sensor_torque").residual for log in runs()]
        told = [float(np.sqrt(np.mean(r**2))) for r in [*missed, np.concatenate(missed)]]
        assert made.errors()[:, at] == pytest.approx(told, rel=1e-12)
    assert made.kinds()[-1] == (PREDICTED, PREDICTED)
    assert np.isnan(made.aic).all()


def test_each_model_warns_of_what_predict_warns_of():
    """Rows outside of what one of two models was fitted to, faster than its own runs."""
    motions = [motion(seed, 1000, speed=0.5) for seed in (11, 12)]
    slow = [simulated(friction(), FRICTION, one, 0.01 * np.random.default_rng(k).normal(size=1000))
            for k, one in enumerate(motions)]  # fmt: skip
    kept = {"whole": whole(), "slow": fitted(friction(), slow)}
    made = flexspline.compare_models(kept, runs())
    assert any("velocity" in note for note in made.notes if note.startswith("Warning of 'slow'"))
    for name, fit in kept.items():
        said = [fit.model.predict(log, "sensor_torque").warnings for log in runs()]
        shown = {note for note in made.notes if note.startswith(f"Warning of '{name}': ")}
        assert shown <= {f"Warning of '{name}': {one}." for each in said for one in each}
        assert bool(shown) == any(said)


def test_runs_that_a_fit_saw_and_others_stand_side_by_side():
    made = flexspline.compare_models({"whole": whole()}, [*runs()[:1], log_of(8)])
    assert [run.kinds for run in made.runs] == [(HELD_OUT,), (PREDICTED,)]


def test_all_models_are_judged_by_the_same_rows():
    """A loop's first rows do not count; the model without a loop is not judged by them either."""
    loop = fitted([*friction(), "presliding_friction"], runs())
    made = flexspline.compare_models({"loop": loop, "small": small()}, runs())
    told = [np.isfinite(run.held_out) for run in loop.runs]
    assert 0 < made.rows == sum(int(rows.sum()) for rows in told) < 4000
    missed = np.concatenate([r.held_out[c] for r, c in zip(small().runs, told, strict=True)])
    assert made.errors()[-1, 1] == pytest.approx(float(np.sqrt(np.mean(missed**2))))
    assert f"{4000 - made.rows} of 4000 rows do not count" in str(made)


@pytest.mark.parametrize("from_file", [True, False])
def test_a_model_is_not_praised_for_a_run_that_it_was_fitted_to(from_file, tmp_path):
    logs = list(runs()[:2])
    if from_file:
        for log in logs:
            write_log(log, tmp_path / f"{log.name}.csv")
        logs = [flexspline.read_log(tmp_path / f"{log.name}.csv") for log in logs]
    model = fitted(friction(), logs[:1]).model
    made = flexspline.compare_models({"own": model, "true": truth()}, logs)
    assert [run.kinds for run in made.runs] == [(FITTED, PREDICTED), (PREDICTED, PREDICTED)]
    assert made.kinds()[-1] == (FITTED, PREDICTED)
    lines = {line[:10].strip(): line for line in str(made).splitlines()}
    assert "†" in lines["run 0"] and "*" not in lines["run 0"]
    assert "†" not in lines["run 1"] and "*" in lines["run 1"]
    assert "'own' was fitted to run 0" in str(made)


def test_the_verdict_is_of_the_runs_that_no_model_was_fitted_to(tmp_path):
    logs = list(runs()[:3])
    few = friction()[:2]
    models = {"all": fitted(friction(), logs[:2]).model, "less": fitted(few, logs[:2]).model}
    made = flexspline.compare_models(models, logs)
    best, other = made.errors()[2]
    text = " ".join(str(made).split())
    assert "Lowest error over run 2, which no model was fitted to: all, " in text
    assert f"{best:.4f} Nm; less {other:.4f}." in text
    lines = {line[:18].strip(): line for line in str(made).splitlines()}
    assert "kind of error" not in lines and lines["kind over all rows"].count("fitted") == 2
    assert text.count("fitted to run 0, run 1:") == 1
    made.report(tmp_path / "report.html")
    assert "say nothing" not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_criteria_are_those_of_the_fits_where_they_are_of_the_same_rows_and_else_left_out():
    assert compared().aic == pytest.approx([whole().aic, small().aic])
    assert compared().bic == pytest.approx([whole().bic, small().bic])
    fewer = fitted(friction(), runs()[:3])
    smooth = fitted(friction(), runs(), lowpass=10.0)
    for other in (fewer, smooth):
        made = flexspline.compare_models({"whole": whole(), "other": other}, runs())
        assert np.isnan([*made.aic, *made.bic]).all()
        assert "AIC" in str(made).split("left out")[0] and "different rows" in str(made)
    robust = fitted(friction(), runs(), options=flexspline.FitOptions(robust="huber"))
    made = flexspline.compare_models({"whole": whole(), "small": small(), "robust": robust}, runs())
    assert list(np.isnan(made.aic)) == [False, False, True]
    assert "'robust' has no AIC or BIC: robust weights" in str(made)


def test_a_low_pass_is_on_measured_and_modelled_alike():
    smooth = fitted(friction(), runs(), lowpass=10.0)
    made = flexspline.compare_models({"smooth": smooth, "true": truth()}, runs(), lowpass=10.0)
    assert made.kinds()[-1] == (HELD_OUT, PREDICTED)
    assert made.errors()[-1, 0] == pytest.approx(smooth.cv_rmse)
    assert "low-passed at 10 Hz" in str(made)
    plain = flexspline.compare_models({"smooth": smooth, "true": truth()}, runs())
    assert made.errors()[-1, 1] < plain.errors()[-1, 1]
    assert plain.kinds()[-1] == (FITTED, PREDICTED)
    assert not any("fitted behind" in note for note in made.notes)
    (said,) = [note for note in plain.notes if "fitted behind" in note]
    assert said.startswith("'smooth' was fitted behind a low pass of 10 Hz") and "--lowpass" in said


def test_the_table_marks_the_lowest_error_and_has_every_number():
    text, frame = str(compared()), compared().to_frame()
    assert list(frame.index) == ["whole", "small"] and list(frame.columns[:2]) == ["run 0", "run 1"]
    last = next(line for line in text.splitlines() if line.startswith("all rows"))
    assert f"{whole().cv_rmse:.4f} *" in last and f"{small().cv_rmse:.3f}"[:4] in last
    page = compared()._repr_html_()
    assert page.count("<tr>") == 2 + 5 + 2 and "script" not in page


def test_many_runs_are_shown_by_the_worst():
    logs = [log_of(seed, 300) for seed in range(15)]
    text = str(flexspline.compare_models({"true": truth()}, logs))
    assert text.count("\nrun ") == 12 and "The 12 worst of 15 runs are shown." in text


def test_two_measured_quantities_are_not_compared():
    channels = [{name: log[name] for name in log.channels} for log in runs()]
    loaded = [log_with(c, reference_torque=0.1 * np.sin(c["time"])) for c in channels]
    with_load = fitted(friction()[:2], loaded, known_load="reference_torque")
    with pytest.raises(InputError, match="'one': none, 'two': reference_torque"):
        flexspline.compare_models({"one": small(), "two": with_load}, loaded)


def test_a_wrong_call_is_refused_in_one_sentence():
    motor = Model({"drive": Part("motor_torque", (), np.zeros(0))})
    for models, logs, options, sentence in (
        ({}, runs(), {}, "there is no model to compare"),
        ([truth()], runs(), {}, "given as a list, and each needs a name; give a dictionary"),
        (truth(), runs(), {}, "given as a Model, .* or one model alone to flexspline.compare"),
        ({"a": truth()}, [], {}, "there is no log to compare with"),
        ({"a": "joint.json"}, runs(), {}, "'a' is a str; give a model, as flexspline.Model.load"),
        ({"a": truth(), "b": motor}, runs(), {}, "differ in their target"),
        ({"a": truth()}, runs(), {"target": "motor_torque"}, "no part for the target motor_torque"),
        ({"a": whole()}, runs(), {"target": "motor_torque"}, "differ in their target"),
        ({"a": truth()}, [runs()[0], runs()[0]], {}, "a run counts once"),
    ):
        with pytest.raises(InputError, match=sentence):
            flexspline.compare_models(models, logs, **options)
    silent = log_with({n: runs()[0][n] for n in motion(0)}, np.full(1000, np.nan))
    with pytest.raises(InputError, match="no row of run is told by all of a"):
        flexspline.compare_models({"a": truth()}, silent)


def test_a_figure_has_all_models_over_time_load_and_velocity():
    assert figure_faults(compared().plot()) == []
    axes = compared().plot().axes
    assert [ax.get_title(loc="left").split(":")[0] for ax in axes] == [
        "Measured and modelled, run 0",
        "Residual over modelled sensor torque",
        "Residual over output velocity",
    ]
    assert all("[" in ax.get_xlabel() and "[" in ax.get_ylabel() for ax in axes)
    assert [len(ax.lines) for ax in axes] == [3, 3, 3]
    loaded = [log_of(seed, 400, reference_torque=np.sin(np.arange(400))) for seed in range(2)]
    over = flexspline.compare_models({"true": truth()}, loaded).plot().axes[1]
    assert over.get_xlabel() == "reference torque [Nm]"


def test_a_report_holds_the_table_the_figures_and_what_makes_it_again(tmp_path):
    page = tmp_path / "report.html"
    compared().report(page)
    text = page.read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    best, other = whole().cv_rmse, small().cv_rmse
    assert f"Lowest error over all rows: whole, {best:.4f} Nm; small {other:.4f}." in text
    assert text.count("<svg") == 3 and "<script" not in text
    for cell in (cell for line in str(compared()).splitlines()[2:9] for cell in line.split("  ")):
        assert html.escape(cell.strip()) in text
    assert "flexspline.compare_models(models, logs, target=&#39;sensor_torque&#39;)" in text
    assert page_faults(page) == []


def test_a_report_praises_no_model_for_runs_that_it_was_fitted_to(tmp_path):
    made = flexspline.compare_models({"own": whole().model, "true": truth()}, runs())
    made.report(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "These errors say nothing of which model is better" in text


def test_a_right_model_has_no_slope_in_its_residual_over_what_it_says():
    """Over the measured torque it would: that holds the noise too."""
    noise = np.random.default_rng(1).normal(0, 0.3, (2, 4000))
    noisy = [simulated(friction(), FRICTION, motion(k, 4000), noise[k]) for k in range(2)]
    made = flexspline.compare_models({"true": truth()}, noisy)
    line = missed_over(made, "modelled", Figure().add_subplot()).lines[0]
    x, y = np.array(line.get_xdata()), np.array(line.get_ydata())
    good = np.isfinite(y)
    assert abs(np.polyfit(x[good], y[good], 1)[0]) < 0.1
    measured = np.concatenate([run.measured for run in made.runs])
    missed = np.concatenate([run.residuals[0] for run in made.runs])
    slope = np.polyfit(measured, missed, 1)[0]
    assert slope == pytest.approx(missed.var() / measured.var(), rel=0.1) and slope > 0.2


def test_runs_without_a_velocity_are_drawn_too():
    time = np.arange(300) / 100.0
    still = log_with({"time": time}, np.sin(time), temperature=25.0 + time)
    part = Part("sensor_torque", tuple(chosen("offset")), np.zeros(1))
    made = flexspline.compare_models({"nothing": Model({"sensor": part})}, still)
    assert len(made.plot().axes) == 2
