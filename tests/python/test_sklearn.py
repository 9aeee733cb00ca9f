"""The scikit-learn regressor: its contract, and the same numbers as those of a fit of logs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pandas as pd
import pytest
from fit_logs import WIDTH, friction, run_of

import flexspline
from flexspline import FitOptions, InputError, Model
from flexspline.logs.log import Log

pytest.importorskip("sklearn", minversion="1.6")

from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils.estimator_checks import estimator_checks_generator

from flexspline.sklearn import JointRegressor

MOTION = ["output_position", "output_velocity", "output_acceleration"]
LINE = ["offset", "viscous_friction"]
AS_RECORDED = FitOptions(bandwidth=float("inf"))


REGRESSORS = (
    JointRegressor(columns={"output_velocity": 0}),
    JointRegressor(LINE, columns={"output_velocity": 0}, rate=100.0),
)
OF_OTHER_ARRAYS = "check_array_api_input"  # asks for SCIPY_ARRAY_API in the environment


def contract() -> Iterator[object]:
    """All checks that scikit-learn has for a regressor, none expected to fail."""
    for regressor in REGRESSORS:
        for number, (estimator, check) in enumerate(estimator_checks_generator(regressor)):
            name = getattr(check, "func", check).__name__
            if name != OF_OTHER_ARRAYS:
                yield pytest.param(estimator, check, id=f"{name} {number}, rate {regressor.rate}")


@pytest.mark.parametrize(("estimator", "check"), list(contract()))
def test_it_keeps_the_contract_of_scikit_learn(estimator, check):
    check(estimator)


def log_of(seed: int, samples: int = 1500) -> Log:
    return run_of(seed, samples)


def arrays(log: Log) -> tuple[np.ndarray, np.ndarray]:
    return np.column_stack([log[name] for name in MOTION]), np.array(log["sensor_torque"])


def test_its_parameters_are_those_of_a_fit_of_the_log_as_recorded():
    log = log_of(1)
    fit = flexspline.fit(friction(), log, "sensor_torque", options=AS_RECORDED)
    made = JointRegressor(friction(), columns=MOTION, rate=100.0).fit(*arrays(log))
    assert list(made.parameters_) == list(fit.params)
    values = [p.value for p in fit.parameters]
    assert list(made.parameters_.values()) == pytest.approx(values, rel=1e-12)
    assert made.predict(arrays(log)[0]) == pytest.approx(fit.runs[0].predicted, rel=1e-12)
    assert made.score(*arrays(log)) == pytest.approx(fit.score.r_squared, rel=1e-9)


def test_the_order_of_the_rows_does_not_matter_without_a_rate():
    X, y = arrays(log_of(1))
    order = np.random.default_rng(0).permutation(len(y))
    one, other = (JointRegressor(friction(), columns=MOTION) for _ in range(2))
    one.fit(X, y)
    other.fit(X[order], y[order])
    assert list(other.parameters_.values()) == pytest.approx(
        list(one.parameters_.values()), rel=1e-6
    )
    assert one.predict(X[order]) == pytest.approx(one.predict(X)[order])


def test_a_loop_remembers_the_rows_before_as_in_a_fit_of_the_log():
    effects = ["offset", "presliding_friction"]
    log = log_of(2)
    fit = flexspline.fit(effects, log, "sensor_torque", options=AS_RECORDED, checks=False)
    made = JointRegressor(effects, columns=MOTION, rate=100.0).fit(*arrays(log))
    assert list(made.parameters_.values()) == pytest.approx([p.value for p in fit.parameters])
    with pytest.raises(InputError, match="depends on time and on the rows before; give rate"):
        JointRegressor(effects, columns=MOTION).fit(*arrays(log))


def test_a_motor_torque_is_counted_at_the_output_less_the_known_load():
    log = log_of(3)
    load = 0.5 * np.sin(log["time"])
    y = np.array(log["sensor_torque"])
    made = JointRegressor(
        LINE,
        target="motor_torque",
        columns=[*MOTION, "reference_torque"],
        facts={"gear_ratio": 100, "output_spline": "circular"},
        known_load="reference_torque",
    ).fit(np.column_stack([arrays(log)[0], load]), y)
    same = JointRegressor(LINE, columns=MOTION).fit(*arrays(log))
    assert list(made.parameters_.values()) == pytest.approx(list(same.parameters_.values()))
    assert made.model_.facts["gear_ratio"] == 100


def test_a_data_frame_says_which_channel_is_which():
    log = log_of(1)
    frame = pd.DataFrame({"note": 0.0, **{name: log[name] for name in reversed(MOTION)}})
    made = JointRegressor(friction()).fit(frame, log["sensor_torque"])
    same = JointRegressor(friction(), columns=MOTION).fit(*arrays(log))
    assert made.parameters_ == pytest.approx(same.parameters_, rel=1e-9)
    by_name = JointRegressor(LINE, columns={"output_velocity": "output_velocity"})
    assert by_name.fit(frame, log["sensor_torque"]).n_features_in_ == 4


def test_it_goes_through_pipelines_searches_and_cross_validation_by_run():
    logs = [log_of(seed, 600) for seed in range(4)]
    X = np.concatenate([arrays(log)[0] for log in logs])
    y = np.concatenate([arrays(log)[1] for log in logs])
    groups = np.repeat(np.arange(4), 600)
    small = JointRegressor(LINE, columns=MOTION)
    search = GridSearchCV(small, {"effects": [LINE, friction()]}, cv=GroupKFold(4))
    assert search.fit(X, y, groups=groups).best_params_ == {"effects": friction()}
    scores = cross_val_score(search.best_estimator_, X, y, groups=groups, cv=GroupKFold(4))
    assert scores.min() > 0.9
    held = clone(search.best_estimator_).set_params(fixed={"direction_width": WIDTH})
    degrees = make_pipeline(FunctionTransformer(np.deg2rad), clone(held))
    rad = held.fit(X, y).predict(X)
    assert degrees.fit(np.rad2deg(X), y).predict(np.rad2deg(X)) == pytest.approx(rad, rel=1e-9)


def test_its_model_is_saved_and_predicts_a_log(tmp_path):
    log = log_of(1)
    made = JointRegressor(friction(), columns=MOTION).fit(*arrays(log))
    made.model_.save(tmp_path / "joint.json")
    again = Model.load(tmp_path / "joint.json").predict(log)
    assert again.predicted == pytest.approx(made.predict(arrays(log)[0]), rel=1e-12)


def test_fixed_values_and_bounds_are_kept():
    made = JointRegressor(
        friction(),
        columns=MOTION,
        fixed={"direction_width": WIDTH},
        bounds={"inertia": (None, 0.0)},
    ).fit(*arrays(log_of(1)))
    assert made.parameters_["direction_width"] == WIDTH
    assert made.parameters_["inertia.inertia"] == 0.0


WRONG = {
    "columns=\\['output_velocity', None\\]": {"columns": None},
    "X has 3 features; give a channel or None for each": {"columns": ["output_velocity"]},
    "X has no feature 7; it has 0 to 2": {"columns": {"output_velocity": 7}},
    "X has no feature 'v'; it has nothing": {"columns": {"output_velocity": "v"}},
    "output_velocty": {"columns": ["output_velocty", None, None]},
    "needs the channel output_velocity": {"columns": ["output_acceleration", None, None]},
    "derived from consecutive rows; give rate": {"columns": ["output_position", None, None]},
    "rate is -1": {"rate": -1},
    "no orders; give orders={'output_ripple'": {"effects": ["output_ripple"]},
    "did you mean 'viscous_friction'": {"effects": ["viscous_frictoin"]},
    "fit logs with flexspline.fit": {"target": "torsion"},
    "time_drift.*give rate": {"effects": ["time_drift"]},
}


@pytest.mark.parametrize("sentence", WRONG)
def test_a_wrong_call_is_refused_in_one_sentence(sentence):
    made = JointRegressor(**{"effects": LINE, "columns": MOTION, **WRONG[sentence]})
    with pytest.raises(InputError, match=sentence) as caught:
        made.fit(*arrays(log_of(1, 200)))
    assert "\n" not in str(caught.value)


def test_fewer_rows_than_parameters_are_refused():
    X, y = arrays(log_of(1))
    with pytest.raises(InputError, match="X has 4 rows, but 5 parameters need as many"):
        JointRegressor(friction(), columns=MOTION).fit(X[:4], y[:4])


def test_without_scikit_learn_one_sentence_says_how_to_install_it():
    program = (
        "import sys; sys.modules['sklearn'] = None\n"
        "import flexspline\n"
        "try:\n    flexspline.sklearn\n"
        "except ImportError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.strip().endswith("run pip install 'flexspline[sklearn]'"), done.stderr


def test_flexspline_starts_without_it():
    program = "import sys, flexspline; flexspline.fit; print('sklearn' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.strip() == "False", done.stderr
