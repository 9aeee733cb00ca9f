"""Terms that each run has of its own: as columns and taken out, their spread, test and limits."""

from __future__ import annotations

import importlib
import json
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_calls import call
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2

import flexspline
from flexspline import FitOptions, InputError
from flexspline.least_squares.per_run_terms import LEVEL
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.report.tables import between_rows, between_sentences

own_terms = importlib.import_module("flexspline.least_squares.per_run_terms")
offsets = importlib.import_module("flexspline.least_squares.per_run_terms")
EFFECTS = ["offset", "viscous_friction", "inertia", "gravity"]
OWN = ("offset", "gravity.sine")
VISCOSITY, INERTIA, COSINE = 0.4, 0.02, 0.3


def run_of(
    number: int, seed: int = 1, rows: int = 240, payload: float = 0.5, zero: float = 0.2,
    phi: float = 0.6, amplitude: float = 1.0,
) -> tuple[Log, list[float]]:  # fmt: skip
    """Some seconds of a swinging joint at 60 Hz with a payload and a zero, and these two."""
    generator = np.random.default_rng([seed, number])
    time = np.arange(rows) / 60.0
    omega, phase = 2 * np.pi * generator.uniform(0.4, 1.2, 2), generator.uniform(0, 6.28, 2)
    size = amplitude * np.array([1.0, 0.4])
    angle = omega[:, None] * time + phase[:, None]
    middle = generator.uniform(-1, 1)
    position = size @ np.sin(angle) + middle
    velocity = (size * omega) @ np.cos(angle)
    acceleration = -(size * omega**2) @ np.sin(angle)
    own = [0.3 + zero * generator.normal(), 1.0 + payload * generator.normal()]
    noise = lfilter([1.0], [1.0, -phi], 0.05 * generator.normal(size=rows + 100))[100:]
    torque = own[0] + own[1] * np.sin(position) + COSINE * np.cos(position) + noise
    torque += VISCOSITY * velocity + INERTIA * acceleration
    channels = {
        "time": time, "output_position": position, "output_velocity": velocity,
        "output_acceleration": acceleration, "sensor_torque": torque,
    }  # fmt: skip
    return Log.from_arrays(facts={"name": f"run {number}"}, **channels), own


def runs_of(count: int, **more: float) -> list[Log]:
    return [run_of(k, **more)[0] for k in range(count)]  # type: ignore[arg-type]


def fitted(logs: list[Log], per_run: object = OWN, effects: object = None, **more: object) -> Fit:
    options = FitOptions(per_run=per_run, **more.pop("how", {}))  # type: ignore[arg-type]
    return flexspline.fit(
        effects or EFFECTS, logs, "sensor_torque", checks=False, options=options, **more
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("lowpass", [None, 12.0])
def test_terms_that_are_taken_out_are_those_of_a_column_for_each_run(
    monkeypatch: pytest.MonkeyPatch, lowpass: float | None
) -> None:
    logs = runs_of(6)
    few = fitted(logs, lowpass=lowpass)
    monkeypatch.setattr(own_terms, "MANY_RUNS", 2)
    many = fitted(logs, lowpass=lowpass)
    assert many.solved.tangent.problem.projected and not few.solved.tangent.problem.projected
    assert [p.name for p in many.parameters] == [p.name for p in few.parameters]
    for own, other in zip(many.parameters, few.parameters, strict=True):
        assert own.value == pytest.approx(other.value, rel=1e-9, abs=1e-11)
        assert own.standard_error == pytest.approx(other.standard_error, rel=0.1)
        assert (own.unit, own.state) == (other.unit, other.state)
    assert many.rmse == pytest.approx(few.rmse, rel=1e-12)
    assert many.cv_rmse == pytest.approx(few.cv_rmse, rel=1e-9)
    assert many.part.coefficients == pytest.approx(few.part.coefficients, rel=1e-9)
    assert many.likelihood.parameters == pytest.approx(few.likelihood.parameters, abs=1.1)
    for own, other in zip(many.between_runs, few.between_runs, strict=True):
        assert own.spread == pytest.approx(other.spread, rel=0.01)
        assert own.new_run_rmse == pytest.approx(other.new_run_rmse, rel=1e-9)


def test_intervals_cover_common_terms_and_each_runs_own_where_payloads_differ() -> None:
    """20 fits, of common terms (z² is χ² each) and own ones; 300 fits gave 93 to 97 %."""
    away, own, draws = [], [], 20
    for seed in range(draws):
        made = [run_of(k, seed=100 + seed) for k in range(3)]
        fit = fitted([log for log, _ in made])
        common = {"viscosity": VISCOSITY, "inertia": INERTIA, "gravity.cosine": COSINE}
        for name, true in common.items():
            away.append((fit[name].value - true) / fit[name].standard_error)
        for k, (_, (zero, sine)) in enumerate(made):
            own.append((fit[f"offset.run {k}"].value - zero) / fit[f"offset.run {k}"].stderr)
            own.append(
                (fit[f"gravity.sine.run {k}"].value - sine) / fit[f"gravity.sine.run {k}"].stderr
            )
    low, high = chi2.interval(0.999, len(away))
    # errors are estimated in 720 rows of memory 4: ν ≈ 100, z² a few per cent above 1
    assert low <= np.sum(np.square(away)) <= 1.1 * high
    # three runs share the cosine, so that their own values err together: a third as many
    low, high = chi2.interval(0.999, len(own) // 3)
    assert low / (len(own) // 3) <= np.mean(np.square(own)) <= 1.1 * high / (len(own) // 3)


@pytest.mark.parametrize("per_run", [OWN, ("offset",)])
@pytest.mark.parametrize("taken_out", [False, True])
def test_the_error_on_a_new_run_is_that_of_fits_that_never_saw_it(
    monkeypatch: pytest.MonkeyPatch, per_run: tuple[str, ...], taken_out: bool
) -> None:
    if taken_out:
        for module in (own_terms, offsets):
            monkeypatch.setattr(module, "MANY_RUNS", 2)
    logs = runs_of(4, rows=80)
    left = [
        fitted([other for other in logs if other is not log], per_run).predict(log).residual
        for log in logs
    ]
    for term in fitted(logs, per_run).between_runs:
        assert term.new_run_rmse == pytest.approx(np.sqrt(np.mean(np.square(left))), rel=1e-9)


def test_without_per_run_payloads_that_differ_hurt_the_common_terms() -> None:
    logs = [run_of(k, seed=7)[0] for k in range(4)]
    with_own, without = fitted(logs), fitted(logs, ())
    assert with_own.rmse < 0.3 * without.rmse
    assert with_own["viscosity"].standard_error < 0.5 * without["viscosity"].standard_error


@pytest.mark.parametrize("count", [5, 18])
def test_whether_runs_differ_is_told_with_mean_and_spread(count: int) -> None:
    alike = fitted(runs_of(count, payload=0.0, zero=0.0, seed=3))
    assert all(term.p > LEVEL and not term.differs for term in alike.between_runs)
    made = [run_of(k, seed=4) for k in range(count)]
    zero, sine = fitted([log for log, _ in made]).between_runs
    assert zero.differs and sine.differs and (zero.term, sine.term) == ("offset.offset", OWN[1])
    true = np.array([own[1] for _, own in made])
    assert sine.mean == pytest.approx(true.mean(), abs=0.1)
    assert sine.spread == pytest.approx(true.std(ddof=1), rel=0.1)
    assert sine.new_run_error > sine.spread
    assert all(sine.determined)


@pytest.mark.parametrize("count", [4, 17])
def test_a_run_at_one_angle_does_not_determine_its_payload_and_does_not_count(count: int) -> None:
    logs = [*runs_of(count - 1), run_of(count - 1, amplitude=1e-3)[0]]
    fit = fitted(logs)
    sine = fit.between_runs[1]
    assert sine.determined == (*[True] * (count - 1), False)
    assert sine.mean == pytest.approx(np.mean(sine.values[:-1]))
    assert any(f"run {count - 1} does not determine its own value" in said for said in fit.warnings)
    assert ("not determined" in str(fit)) == (count < 12)  # the table shows twelve runs


@pytest.mark.parametrize("per_run", [("offset",), OWN])
def test_what_is_constant_in_each_run_is_not_told_from_its_own_offset(
    monkeypatch: pytest.MonkeyPatch, per_run: tuple[str, ...]
) -> None:
    """Gravity at one angle in each run; friction by a velocity that is moved for it."""
    logs = []
    for log in runs_of(4, rows=120, amplitude=0.0):
        channels = {name: log[name] for name in log.channels}
        channels["output_velocity"] = np.sin(np.arange(120) / 9.0)
        logs.append(Log.from_arrays(facts={"name": log.name}, **channels))
    names = ["offset", "viscous_friction", "gravity"]
    few = fitted(logs, per_run, names)
    for module in (own_terms, offsets):
        monkeypatch.setattr(module, "MANY_RUNS", 2)
    many = fitted(logs, per_run, names)
    alone = [p.name for p in few.parameters if p.determined]
    assert (
        alone == [p.name for p in many.parameters if p.determined] == ["viscous_friction.viscosity"]
    )
    for fit in (few, many):
        assert not any(any(term.determined) for term in fit.between_runs)
        assert "not excited" not in str(fit) and "indistinguishable" in str(fit)


def test_a_term_that_is_held_in_one_run_is_no_value_that_runs_determine() -> None:
    fit = fitted(runs_of(4), fixed={"offset.run 2": run_of(2)[1][0]})
    zero, _ = fit.between_runs
    assert zero.determined == (True, True, False, True) and zero.standard_errors[2] == 0.0
    assert zero.differs and not any("determine its own" in said for said in fit.warnings)
    assert not any("not determined" in line for line in str(fit).splitlines())


def test_a_mean_that_fewer_than_two_runs_determine_is_no_number() -> None:
    fit = fitted(runs_of(3))
    zero, sine = fit.between_runs
    alone = replace(zero, determined=(True, False, False))
    rows = between_rows(replace(fit, between_runs=(alone, sine)))
    assert [row[1] for row in rows[-2:]] == ["not determined", "–"]
    assert all("±" in row[2] for row in rows[1:-1])


def test_a_model_keeps_mean_and_table_and_says_so_where_it_predicts() -> None:
    fit = fitted(runs_of(4))
    model = flexspline.Model.from_json(fit.model.to_json())
    kept = model.part().record["validated"]["per_run"]
    assert [term["term"] for term in kept] == ["offset.offset", "gravity.sine"]
    assert model.part().coefficients[0] == kept[0]["mean"] == fit.between_runs[0].mean
    assert any("differ in offset" in said for said in model.predict(run_of(9)[0]).warnings)
    with pytest.raises(InputError, match=r"gravity\.sine of each run by itself"):
        flexspline.discover(model, runs_of(4), target="sensor_torque")
    page = fit._repr_html_()
    for text in (str(fit), fit.summary(), page):
        assert "spread between runs" in text and "the runs differ" in text and "run 3" in text
    assert fit.params["gravity.sine.run 3"].unit == "Nm"


def test_offset_among_per_run_is_offset_per_run() -> None:
    logs = runs_of(4)
    one = fitted(logs, "offset")
    other = fitted(logs, (), how={"offset_per_run": True})
    assert [p.value for p in one.parameters] == [p.value for p in other.parameters]
    assert one.between_runs == other.between_runs


def test_the_likelihood_holds_the_terms_that_are_taken_out() -> None:
    logs = runs_of(16, rows=120)
    fit = fitted(logs)
    pulse = lfilter([1.0], fit.uncertainty.noise.denominator, np.eye(1, 5000)[0])
    shape = toeplitz([pulse[: len(pulse) - k] @ pulse[k:] for k in range(120)])
    lower = np.linalg.cholesky(shape)
    rows, target = [], []
    for k, log in enumerate(logs):
        q, own = log["output_position"], np.zeros((120, 32))
        own[:, 2 * k], own[:, 2 * k + 1] = 1.0, np.sin(q)
        shared = np.column_stack([log["output_velocity"], log["output_acceleration"], np.cos(q)])
        rows.append(np.linalg.solve(lower, np.hstack([shared, own])))
        target.append(np.linalg.solve(lower, log["sensor_torque"]))
    y = np.concatenate(target)
    left = float(np.linalg.lstsq(np.vstack(rows), y)[1][0])
    logarithms = 16 * 2.0 * np.log(np.diag(lower)).sum()
    twice = len(y) * (np.log(2.0 * np.pi * left / len(y)) + 1.0) + logarithms
    assert -2.0 * fit.likelihood.log_likelihood == pytest.approx(twice, rel=1e-9)
    assert fit.likelihood.parameters == pytest.approx(35 + fit.uncertainty.noise.order + 1)
    made = flexspline.compare_models({"own": fit, "common": fitted(logs, per_run=())}, logs)
    assert np.isnan([*made.aic, *made.bic]).all() and "noise in a part of the runs" in str(made)
    assert "to be compared with fits of such per-run terms alone" in fit.summary()


def test_memory_grows_with_the_runs_and_not_with_their_square() -> None:
    peaks = []
    for count in (16, 40):
        logs = runs_of(count, rows=40)
        tracemalloc.start()
        fitted(logs, ("offset", "gravity"))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 3.3 * peaks[0]  # its square: 6.25


@pytest.mark.parametrize(
    ("per_run", "effects", "words"),
    [
        ("payload", EFFECTS, ["per_run", "no parameter 'payload'", "gravity.sine"]),
        ("coulomb_friction", [*EFFECTS, "coulomb_friction"], ["direction_width", "fix"]),
        (
            "load_dependent_friction",
            [*EFFECTS, "load_dependent_friction"],
            ["direction_width", "share"],
        ),
    ],
)
def test_a_term_that_cannot_be_of_each_run_is_refused(
    per_run: str, effects: list[str], words: list[str]
) -> None:
    with pytest.raises(InputError) as refused:
        fitted(runs_of(3), per_run, effects)
    assert all(word in str(refused.value) for word in words)


def test_terms_of_one_run_or_of_too_many_with_something_given_are_refused() -> None:
    with pytest.raises(InputError, match=r"one alone; .* leave gravity\.cosine, gravity\.sine out"):
        fitted(runs_of(1), "gravity")
    with pytest.raises(InputError, match=r"99 coefficients, more than 64, .* gravity"):
        fitted(runs_of(33), ("offset", "gravity"), fixed={"gravity.sine.run 3": 1.0})


# the command line


def saved(logs: list[Log], folder: Path) -> list[str]:
    for log in logs:
        write_log(log, folder / f"{log.name}.csv")
    return [str(folder / f"{log.name}.csv") for log in logs]


@pytest.mark.usefixtures("undrawn")
def test_the_command_takes_per_run_profiles_contours_and_a_summary(tmp_path: Path) -> None:
    given = [
        "fit", *saved(runs_of(3, rows=80), tmp_path), "--target", "sensor_torque", "--effects",
        ",".join(EFFECTS), "--per-run", "offset,gravity.sine", "--profile", "viscosity",
        "--contour", "viscosity,inertia", "--summary", "--out", str(tmp_path / "out"),
    ]  # fmt: skip
    text = call(*given)
    assert text.exit_code == 0, text.stderr
    for words in ("AIC", "spread between runs", "by its profile", "Region of viscous_friction"):
        assert words in text.stdout
    told = json.loads(call(*given, "--json").stdout)
    assert [term["term"] for term in told["per_run"]] == ["offset.offset", "gravity.sine"]
    assert told["aic"] < told["bic"]
    (profile,), (contour,) = told["profiles"], told["contours"]
    assert profile["interval"][0] < profile["value"] < profile["interval"][1]
    assert len(contour["points"]) == 24
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "What each run has of its own" in report and "per_run=[" in report
    wrong = call(*given[:-5], "--contour", "viscosity", "--out", str(tmp_path / "other"))
    assert wrong.exit_code == 2 and "names 1; write two" in wrong.stderr
    wrong = call(*given[:-5], "--profile", "viscosty", "--out", str(tmp_path / "other"))
    assert wrong.exit_code == 2 and "--profile: there is no parameter 'viscosty'" in wrong.stderr
    wrong = call(*given[:-5], "--profile", "offset", "--out", str(tmp_path / "other"))
    assert wrong.exit_code == 2
    assert "--profile: 'offset' may be offset.run 0, offset.run 1" in wrong.stderr
    assert not (tmp_path / "other").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_fit_is_written_though_a_profile_that_was_asked_for_is_none(tmp_path: Path) -> None:
    generator = np.random.default_rng(1)
    t = np.arange(400) * 0.01
    log = Log.from_arrays(
        time=t, output_position=t + 0.2 * np.sin(3.0 * t),
        output_velocity=1.0 + 0.6 * np.cos(3.0 * t),
        output_acceleration=-1.8 * np.sin(3.0 * t),
        sensor_torque=1.0 - np.sin(3.0 * t) + 0.01 * generator.standard_normal(400),
        facts={"name": "one way"},
    )  # fmt: skip
    given = [
        "fit", *saved([log], tmp_path), "--target", "sensor_torque", "--effects",
        "offset,coulomb_friction,inertia", "--profile", "inertia", "--profile",
        "coulomb_friction.level", "--out", str(tmp_path / "out"),
    ]  # fmt: skip
    made = call(*given)
    assert made.exit_code == 0, made.stderr
    said = "No --profile of coulomb_friction.level: coulomb_friction.level is not determined"
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for text in (" ".join(made.stdout.split()), page):
        assert said in text and "fit runs that determine it" in text and "free it" not in text
        assert "by its profile" in text
    assert "Profiles and regions" in page
    told = json.loads(call(*given, "--json").stdout)
    assert len(told["profiles"]) == 1 and told["refused"][0].startswith(said)


def test_a_term_of_one_of_many_runs_is_refused_a_profile_before_the_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def not_reached(*given: object, **more: object) -> None:
        raise AssertionError("fitted")

    monkeypatch.setattr("flexspline.fitting.fit", not_reached)
    given = [
        "fit", *saved(runs_of(16, rows=80), tmp_path), "--target", "sensor_torque", "--effects",
        ",".join(EFFECTS), "--per-run", "offset", "--profile", "offset.run 3", "--out",
        str(tmp_path / "out"),
    ]  # fmt: skip
    wrong = call(*given)
    assert wrong.exit_code == 2 and "has no profile of its own" in wrong.stderr
    assert not (tmp_path / "out").exists()


def test_the_verdict_says_what_a_new_run_leaves_and_why_it_may_be_less_than_held_out() -> None:
    fit = fitted(runs_of(4))
    (new,) = {term.new_run_rmse for term in fit.between_runs}
    text = " ".join(str(fit).split())
    assert f"predicted with the mean of the runs' own terms, leaves {new:.3g}" in text
    assert ("It is the lower of the two" in text) == (new < fit.cv_rmse)
    unknown = tuple(replace(term, new_run_rmse=np.nan) for term in fit.between_runs)
    assert (
        "How much that leaves is not known"
        in between_sentences(replace(fit, between_runs=unknown))[-1]
    )


def test_models_are_compared_on_the_same_rows_by_a_command(tmp_path: Path) -> None:
    small = fitted(runs_of(2), (), ["offset", "viscous_friction"])
    large = fitted(runs_of(2), (), EFFECTS)
    paths = [str(tmp_path / f"{name}.json") for name in ("small", "large")]
    for fit, path in zip((small, large), paths, strict=True):
        fit.model.save(path)
    given = ["compare-models", *saved([run_of(5)[0]], tmp_path), "--model", paths[0]]
    out = tmp_path / "errors.csv"
    text = call(*given, "--model", paths[1], "--out", str(out))
    assert text.exit_code == 0, text.stderr
    assert "predicted" in text.stdout and "wrote" in text.stdout
    assert out.read_text(encoding="utf-8").splitlines()[0].startswith("model,run 5,all rows,kind")
    told = json.loads(call(*given, "--model", paths[1], "--json").stdout)
    errors = [one["rmse"] for one in told["models"]]
    assert errors[1] < errors[0] and told["unit"] == "Nm"
    folder = tmp_path / "side by side"
    assert call(*given, "--model", paths[1], "--out", str(folder)).exit_code == 0
    written = ["models.csv", "models.png", "report.html"]
    assert sorted(file.name for file in folder.iterdir()) == written
    alone = call(*given)
    assert alone.exit_code == 2 and "give two or more" in alone.stderr
