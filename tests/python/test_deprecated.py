"""Old names of arguments work for one version and warn; the two fits stay small."""

from __future__ import annotations

import inspect
import math
from dataclasses import fields

import numpy as np
import pytest
from fit_logs import friction, motion, simulated

import flexspline as fx
from flexspline import FitOptions, InputError, MotionOptions

MOST = 12
PRIOR = {"inertia": (0.02, 0.001)}


def run() -> fx.Log:
    """A run with known friction."""
    noise = 0.01 * np.random.default_rng(4).standard_normal(1000)
    return simulated(friction(), [0.1, 0.2, 0.1, 0.05], motion(samples=1000), noise)


def test_a_fit_takes_twelve_arguments_at_most() -> None:
    for call in (fx.fit, fx.fit_motion):
        names = [*inspect.signature(call).parameters]
        assert len(names) <= MOST and names[-1] == "options"
        own = {f.name for f in fields(FitOptions if call is fx.fit else MotionOptions)}
        assert own and not own & set(names)


def test_an_option_by_its_own_name_gives_the_same_numbers_and_warns() -> None:
    log = run()
    now = fx.fit(friction(), log, "sensor_torque", options=FitOptions(robust="huber", threads=2))
    with pytest.warns(DeprecationWarning, match="as options=FitOptions") as said:
        old = fx.fit(friction(), log, "sensor_torque", robust="huber", threads=2)  # type: ignore[call-arg]
    assert [p.value for p in old.parameters] == [p.value for p in now.parameters]
    assert said[0].filename == __file__


@pytest.mark.filterwarnings("error::DeprecationWarning")
def test_the_new_form_does_not_warn() -> None:
    fx.fit(friction(), run(), "sensor_torque", options=FitOptions(threads=2))


def test_old_names_that_cannot_be_are_refused() -> None:
    log = run()
    wrong = {
        "beside options; give it inside": {"threads": 2, "options": FitOptions()},
        "by is 'motion'; leave it out": {"by": "motion"},
        "free_controller is of a simulated motion; call fit_motion": {
            "free_controller": ["torque"]
        },
        "robust is 'tukey'": {"robust": "tukey"},
    }
    for sentence, given in wrong.items():
        with pytest.raises(InputError, match=sentence):
            fx.fit(friction(), log, "sensor_torque", **given)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="lowpas"):
        fx.fit(friction(), log, "sensor_torque", lowpas=3.0)  # type: ignore[call-arg]


def test_a_motion_by_the_old_name_is_one_of_the_new() -> None:
    log = run()
    with (
        pytest.warns(DeprecationWarning, match="call fit_motion") as said,
        pytest.raises(InputError, match="takes no offset_per_run, priors; leave it out"),
    ):
        fx.fit(friction(), log, "motor_torque", by="simulation", offset_per_run=True, priors=PRIOR)  # type: ignore[call-arg]
    assert said[0].filename == __file__
    with pytest.warns(DeprecationWarning), pytest.raises(InputError, match="needs the effect in"):
        fx.fit(["offset"], log, "motor_torque", by="simulation", starts=2)  # type: ignore[call-arg]


def test_defaults_that_were_written_out_still_pass() -> None:
    log = run()
    with pytest.warns(DeprecationWarning):
        old = fx.fit(friction(), log, "sensor_torque", by="regression", controller=None, starts=8)  # type: ignore[call-arg]
    assert old.cv_rmse == fx.fit(friction(), log, "sensor_torque").cv_rmse
    inert = {"priors": None, "bandwidth": math.inf, "offset_per_run": False, "simulation": None}
    with pytest.warns(DeprecationWarning), pytest.raises(InputError, match="needs the effect in"):
        fx.fit(["offset"], log, "motor_torque", by="simulation", **inert)  # type: ignore[arg-type]


def test_every_public_name_is_there_and_is_what_it_says() -> None:
    made = {name: getattr(fx, name) for name in fx.__all__}
    modules = [name for name, value in made.items() if inspect.ismodule(value)]
    assert modules == []
    assert np.all([callable(v) for n, v in made.items() if n not in ("CATALOGUE", "__version__")])
