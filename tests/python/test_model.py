"""`model.json`: lossless, checked, whole or not at all; predictions of every target."""

from __future__ import annotations

import importlib.resources
import json
import re

import numpy as np
import pytest
from fit_logs import FRICTION, autoregressive, chosen, friction, log_with, motion, simulated
from hypothesis import given, settings
from hypothesis import strategies as st

import flexspline
from flexspline import CATALOGUE, InputError, effect
from flexspline.effects import TARGETS
from flexspline.estimators import Observer
from flexspline.logs.channels import CHANNELS
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.model import PART_OF, Model, Part

NUMBER = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def effects_of(draw, target: str):
    names = [n for n, info in CATALOGUE.items() if TARGETS[target] in info.targets]
    made = []
    for name in draw(st.lists(st.sampled_from(names), unique=True, max_size=6)):
        info = CATALOGUE[name]
        shapes = {s.name: draw(st.floats(s.lower, s.upper)) for s in info.shapes}
        orders = st.tuples(st.integers(1, 5000), st.sampled_from(info.pairs or ("",)))
        some = draw(st.lists(orders, unique=True, max_size=4)) if info.pairs else []
        made.append(effect(name, **shapes).with_orders(some) if some else effect(name, **shapes))
    return tuple(made)


@st.composite
def parts(draw, target: str):
    effects = draw(effects_of(target))
    count = sum(len(e.terms) for e in effects)
    values = draw(st.lists(NUMBER, min_size=count, max_size=count))
    load = draw(st.sampled_from([None, "reference_torque"]))
    record = {"lowpass": draw(st.one_of(st.none(), st.floats(0.1, 100)))}
    return Part(target, effects, np.array(values), load, record)


@st.composite
def models(draw):
    sides = {
        "sensor": ["sensor_torque"],
        "drive": ["motor_torque", "motor_current"],
        "torsion": ["torsion"],
    }
    named = draw(st.lists(st.sampled_from(sorted(sides)), unique=True))
    made = {side: draw(parts(draw(st.sampled_from(sides[side])))) for side in named}
    facts = {"gear_ratio": draw(st.floats(1, 400)), "output_spline": "circular", "joint": "A 1"}
    return Model(made, facts, {"observer": Observer(draw(st.floats(1e-3, 1e3)))})


@settings(max_examples=60, deadline=None, derandomize=True)
@given(model=models())
def test_a_model_survives_json_to_the_last_bit(model):
    again = Model.from_json(model.to_json())
    assert again.facts == model.facts and again.estimators == model.estimators
    assert set(again.parts) == set(model.parts)
    for side, part in model.parts.items():
        other = again.parts[side]
        assert other.effects == part.effects and other.target == part.target
        assert other.coefficients.tobytes() == part.coefficients.tobytes()
        assert other.known_load == part.known_load and other.record == part.record
    assert again.to_json() == model.to_json()


def small_fit(**options):
    noise = autoregressive(np.random.default_rng(0), 2000)
    log = simulated(friction(), FRICTION, motion(0), noise)
    log = log.with_facts({"gear_ratio": 100.0, "output_spline": "flex"})
    ripple = effect("output_ripple", orders=[2])
    return log, flexspline.fit([*friction(), ripple], log, "sensor_torque", checks=False, **options)


def test_a_fitted_model_survives_a_file_with_its_record(tmp_path):
    log, fit = small_fit()
    fit.model.save(tmp_path / "model.json")
    again = Model.load(tmp_path / "model.json")
    assert again.to_json() == fit.model.to_json()
    assert np.array_equal(again.predict(log).predicted, fit.model.predict(log).predicted)
    record = again.part().record
    assert {p["name"] for p in record["parameters"]} == {p.name for p in fit.parameters}
    assert record["covariance"]["names"] == [p.name for p in fit.parameters]
    matrix = np.array(record["covariance"]["matrix"])
    errors = [p.standard_error for p in fit.parameters]
    assert np.sqrt(np.diag(matrix)) == pytest.approx(errors)


def test_confounded_groups_and_priors_are_kept_in_the_file():
    noise = autoregressive(np.random.default_rng(0), 2000)
    log = simulated(friction(), FRICTION, motion(0), noise)
    effects = ["offset", "coulomb_friction_per_direction", "inertia"]
    fit = flexspline.fit(
        effects, log, "sensor_torque", priors={"inertia": (0.02, 0.01)}, checks=False
    )
    record = Model.from_json(fit.model.to_json()).part().record
    assert len(record["confounded"]) == 1 and len(record["confounded"][0]["known"]) == 2
    kept = {p["name"]: p for p in record["parameters"]}
    assert kept["inertia.inertia"]["prior"] == [0.02, 0.01]


# Damage


def damaged(change) -> str:
    content = json.loads(small_fit()[1].model.to_json())
    change(content)
    return json.dumps(content)


def first(content):
    return content["sensor"]["effects"][0]


def ripple_of(content):
    return content["sensor"]["effects"][-1]


DAMAGE = {
    "another format": (lambda c: c.update(format="urdf"), "no flexspline model"),
    "a newer version": (lambda c: c.update(version=2), "version 2"),
    "a version of the future": (lambda c: c.update(version=3), "reads the versions 1 and 2"),
    "a version in words": (lambda c: c.update(version="1"), "'1' of the format where a number"),
    "a version that is true": (lambda c: c.update(version=True), "True of the format where"),
    "no version": (lambda c: c.pop("version"), "no version of the format where a number"),
    "no joint": (lambda c: c.pop("joint"), "joint"),
    "an unknown entry": (lambda c: c.update(extra=1), "extra"),
    "a part without effects": (lambda c: c["sensor"].pop("effects"), "effects"),
    "an unknown target": (lambda c: c["sensor"].update(target="heat"), "heat"),
    "the target of another part": (lambda c: c["sensor"].update(target="torsion"), "torsion"),
    "the wrong unit": (lambda c: c["sensor"].update(unit="A"), "unit"),
    "an unknown effect": (lambda c: first(c).update(name="offsets"), "offsets"),
    "an effect twice": (lambda c: c["sensor"]["effects"].append(first(c)), "twice"),
    "an effect of another target": (
        lambda c: c.update(torsion={**c.pop("sensor"), "target": "torsion", "unit": "rad"}),
        "does not act on",
    ),
    "a coefficient too many": (lambda c: first(c)["coefficients"].append(1.0), "1 coefficients"),
    "a coefficient too few": (lambda c: first(c)["coefficients"].clear(), "0 are given"),
    "a coefficient in words": (lambda c: first(c).update(coefficients=["one"]), "one"),
    "no coefficients": (lambda c: first(c).pop("coefficients"), "coefficients"),
    "an unknown shape": (lambda c: first(c)["shapes"].update(width=1.0), "width"),
    "order zero": (lambda c: ripple_of(c).update(harmonics=[[0, "output_on_housing"]]), "0"),
    "an unknown pair": (lambda c: ripple_of(c).update(harmonics=[[2, "moon"]]), "moon"),
    "an order without its pair": (lambda c: ripple_of(c).update(harmonics=[[2]]), "harmonics"),
    "a negative gear": (lambda c: c["joint"].update(gear_ratio=-1.0), "gear_ratio"),
    "a validity that is reversed": (
        lambda c: c["sensor"]["validity"].update(output_velocity=[2.0, -2.0]),
        "sensor: validity of output_velocity = [2, -2] is no range",
    ),
    "a range of the target that is reversed": (
        lambda c: c["sensor"].update(target_range=[1.0, 0.5]),
        "target_range = [1, 0.5]",
    ),
    "an unknown spline": (lambda c: c["joint"].update(output_spline="round"), "output_spline"),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_model_is_refused_with_one_sentence_that_names_the_file(case, refused_model):
    change, word = DAMAGE[case]
    sentence = refused_model(damaged(change))
    assert word in sentence, sentence
    assert "\n" not in sentence and ";" in sentence
    assert len(sentence) < 600


TEXTS = {
    "cut off": ('{"format": "flexspline-model", ', "no JSON"),
    "empty": ("", "no JSON"),
    "a list": ("[1, 2]", "no flexspline model"),
    "a NaN": (None, "NaN"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_a_text_that_is_no_model_is_refused(case, tmp_path):
    text, word = TEXTS[case]
    if text is None:
        text = damaged(lambda c: first(c).update(coefficients=[float("nan")]))
    path = tmp_path / "joint.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=word) as caught:
        Model.load(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(InputError, match=re.escape(str(tmp_path / "none.json"))):
        Model.load(tmp_path / "none.json")
    with pytest.raises(InputError, match="cannot be read"):
        Model.load(tmp_path)
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="no text"):
        Model.load(tmp_path / "binary.json")


def test_a_failure_while_saving_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "model.json"
    model = small_fit()[1].model
    model.save(path)
    before = path.read_bytes()

    def fail(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(InputError, match=r"model\.json: cannot be written"):
        Model({}).save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["model.json"]


def test_saving_below_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="cannot be written"):
        Model({}).save(tmp_path / "file" / "model.json")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_part_with_a_coefficient_that_is_not_finite_is_refused(value):
    with pytest.raises(InputError, match="not finite"):
        Part("sensor_torque", tuple(chosen("offset")), np.array([value]))


# Predictions


@pytest.mark.parametrize("ends", [(1.0, 0.0), (np.nan, 1.0), (0.0, np.inf)])
def test_a_part_with_ends_that_are_no_range_is_refused(ends):
    for record in ({"validity": {"output_velocity": ends}}, {"target_range": ends}):
        with pytest.raises(InputError, match=r"(output_velocity|target_range) = .* is no range"):
            Part("sensor_torque", (effect("offset"),), np.array([1.0]), record=record)


def test_components_add_up_to_the_prediction():
    log, fit = small_fit()
    whole = sum(fit.model.components(log).values())
    predicted = fit.model.predict(log).predicted
    assert np.abs(whole - predicted).max() <= 1e-14 * np.ptp(predicted) * 10


def test_rows_that_are_not_finite_are_predicted_as_nan_and_no_others():
    log, fit = small_fit()
    velocity = log["output_velocity"].copy()
    velocity[[5, 700]] = np.nan, np.inf
    holed = log.with_columns({"output_velocity": velocity}, note="two bad rows")
    predicted = fit.model.predict(holed).predicted
    assert np.flatnonzero(np.isnan(predicted)).tolist() == [5, 700]
    whole = fit.model.predict(log).predicted
    good = np.isfinite(predicted)
    assert np.array_equal(predicted[good], whole[good])


def test_numpy_takes_a_prediction_for_what_is_predicted():
    log = simulated(friction(), FRICTION, motion(2), np.zeros(2000))
    made = flexspline.fit(friction(), log, "sensor_torque", checks=False).predict(log)
    assert np.array_equal(np.asarray(made), made.predicted) and np.shape(made) == (2000,)
    assert np.array_equal(log["sensor_torque"] - made, made.residual)
    assert np.asarray(made, dtype=np.float32).dtype == np.float32
    own = np.array(made, copy=True)
    own[0] += 1.0
    assert own[0] != made.predicted[0]


def test_without_the_target_a_log_is_predicted_and_its_measurement_is_nan():
    log, fit = small_fit()
    bare = Log.from_arrays(
        facts=dict(log.facts), **{n: log[n] for n in log.channels if n != "sensor_torque"}
    )
    made = fit.model.predict(bare)
    assert np.isnan(made.measured).all()
    assert np.array_equal(made.predicted, fit.model.predict(log).predicted)


def test_several_runs_are_each_predicted_and_their_errors_pooled_by_rows():
    log, fit = small_fit()
    runs = [log, log.rows(slice(0, 500)).with_facts({"name": "short"})]
    made = fit.model.predict(runs)
    assert len(made) == 2 and made[1].name == "short" and list(made) == list(made.runs)
    for one, run in zip(made, runs, strict=True):
        assert np.array_equal(one.predicted, fit.model.predict(run).predicted)
    residuals = np.concatenate([one.residual for one in made])
    assert made.rows == len(residuals) == len(log) + 500
    assert made.rmse == np.sqrt(np.mean(residuals**2))
    assert made.rmse != pytest.approx(np.mean([one.rmse for one in made]), rel=1e-6)
    assert made.worst is max(made, key=lambda one: one.rmse)
    assert np.array_equal(fit.predict(runs).errors, residuals)
    assert fit.model.predict([log]).rmse == fit.model.predict(log).rmse
    assert [*made.to_frame()["rows"]] == [len(log), 500]


def test_predictions_say_the_error_of_each_run_the_pooled_one_and_the_worst_run():
    log, fit = small_fit()
    made = fit.model.predict([log, log.rows(slice(0, 500)).with_facts({"name": "short"})])
    assert repr(made) == (
        f"<Predictions of sensor_torque: 2 runs, RMSE {made.rmse:.4g} Nm over {made.rows} rows>"
    )
    for text in (str(made), made._repr_html_()):
        assert f"the worst run is {made.worst.name}: RMSE {made.worst.rmse:.4g} Nm" in text
        assert "all runs" in text and "RMSE [Nm]" in text and "short" in text


def test_predictions_of_runs_without_the_target_have_no_error_and_say_so():
    log, fit = small_fit()
    bare = Log.from_arrays(
        facts=dict(log.facts), **{n: log[n] for n in log.channels if n != "sensor_torque"}
    )
    made = fit.model.predict([bare, bare])
    assert made.rows == 0 and np.isnan(made.rmse) and made.worst is None
    assert "nothing measured to compare with" in str(made)
    assert fit.model.predict([bare, log]).worst.name == log.name


@pytest.mark.parametrize("derived", [False, True])
def test_slow_rows_count_in_no_error_and_are_counted(derived):
    log, fit = small_fit()
    if derived:
        log = Log.from_arrays(
            facts=dict(log.facts), **{n: log[n] for n in log.channels if n != "output_velocity"}
        )
        speed = np.abs(differentiate(log)["output_velocity"])
    else:
        speed = np.abs(log["output_velocity"])
    least = float(np.median(speed))
    made = fit.model.predict(log, speed_above=least)
    fast = speed >= least
    assert np.array_equal(made.residual, fit.model.predict(log).residual)
    assert (made.rows, made.slow_rows) == (fast.sum(), (~fast).sum())
    assert made.rmse == np.sqrt(np.mean(made.residual[fast] ** 2))
    assert f"{made.slow_rows} of {len(log)} rows are slower than {least:g} rad/s" in str(
        fit.model.predict([log], speed_above=least)
    )


@pytest.mark.parametrize(
    ("change", "least", "says"),
    [
        ({}, 1e3, r"no row with a measured value moves at 1000 rad/s or more, the fastest at"),
        ({}, -1.0, "speed_above is -1.0; give rad/s"),
        ({}, np.nan, "give rad/s"),
        ({"time", "sensor_torque"}, 0.1, "needs output_velocity or output_position"),
    ],
)
def test_a_speed_that_chooses_no_row_is_one_sentence(change, least, says):
    log, fit = small_fit()
    model = fit.model
    if change:
        log = Log.from_arrays(**{name: log[name] for name in change})
        model = Model({"sensor": Part("sensor_torque", (), np.zeros(0))})
    with pytest.raises(InputError, match=says):
        model.predict(log, speed_above=least)


def test_no_run_at_all_is_refused():
    with pytest.raises(InputError, match="there is no log to predict"):
        small_fit()[1].model.predict([])


def test_a_channel_that_is_missing_is_named():
    log, fit = small_fit()
    bare = Log.from_arrays(time=log["time"], sensor_torque=log["sensor_torque"])
    with pytest.raises(InputError, match="output_"):
        fit.model.predict(bare)


def drive_log(spline: str) -> Log:
    ratio = 50 + (spline == "circular")
    channels = motion(0)
    v, q = channels["output_velocity"], channels["output_position"]
    load = 2.0 * np.sin(channels["time"])
    torque = load + 0.3 + 0.5 * v
    return log_with(
        channels,
        name="drive",
        facts={"gear_ratio": 50.0, "output_spline": spline},
        motor_torque=torque / ratio,
        motor_current=0.1 + 0.2 * v,
        motor_position=ratio * q - 0.004 - 0.001 * np.cos(2 * q),
        reference_torque=load,
    )


@pytest.mark.parametrize("spline", ["circular", "flex"])
def test_every_target_is_fitted_and_predicted_with_its_effective_ratio(spline):
    log = drive_log(spline)
    facts = {"known_load": "reference_torque", "checks": False}
    viscous = ["offset", "viscous_friction"]
    model = flexspline.fit(viscous, log, "motor_torque", **facts).model
    assert model.part().coefficients == pytest.approx([0.3, 0.5], rel=1e-9)
    assert np.abs(model.predict(log).residual).max() < 1e-9
    model = flexspline.fit(["offset"], log, "torsion", checks=False, into=model).model
    assert model.part("torsion").unit == "rad"
    assert model.part("torsion").coefficients == pytest.approx([0.004], abs=1e-3)
    model = flexspline.fit(viscous, log, "motor_current", checks=False, into=model).model
    assert set(model.parts) == {"drive", "torsion"}  # a drive has one part: the last stays
    assert model.part("motor_current").coefficients == pytest.approx([0.1, 0.2], rel=1e-9)
    assert model.part("motor_current").unit == "A"
    again = Model.from_json(model.to_json())
    for target in ("torsion", "motor_current"):
        assert np.array_equal(
            again.predict(log, target).predicted, model.predict(log, target).predicted
        )


def ripple_logs() -> tuple[Log, Log]:
    """A log with ripple of the wave generator, without and with the motor's encoder."""
    channels = motion(0)
    angle = 51 * channels["output_position"]
    torque = 0.2 * np.cos(2 * angle) + 0.01 * np.random.default_rng(0).normal(size=2000)
    facts = {"gear_ratio": 50.0, "output_spline": "circular"}
    bare = log_with(channels, torque, facts=facts)
    return bare, bare.with_columns({"motor_position": angle + 1.0}, note="another zero")


def test_the_motors_angle_is_taken_from_where_the_fit_took_it():
    bare, encoder = ripple_logs()
    ripple = [effect("wave_generator_ripple", orders=[2])]
    model = flexspline.fit(ripple, bare, "sensor_torque", checks=False).model
    for again in (model, Model.from_json(model.to_json())):
        assert np.array_equal(again.predict(encoder).predicted, again.predict(bare).predicted)
    assert np.std(model.predict(encoder).residual) < 0.011
    model = flexspline.fit(ripple, encoder, "sensor_torque", checks=False).model
    assert np.std(model.predict(encoder).residual) < 0.011
    with pytest.raises(InputError, match="motor_position"):
        model.predict(bare)


@pytest.mark.parametrize("target", [None, "sensor_torque"])
def test_a_model_without_a_part_does_not_ask_which(target):
    with pytest.raises(InputError, match="no target; it holds the estimators observer; a fit"):
        Model({}, estimators={"observer": Observer(5.0)}).part(target)
    with pytest.raises(InputError, match="no target; a fit into it adds a part"):
        Model({}).part(target)


def test_the_part_is_named_where_there_are_several():
    log = drive_log("flex")
    model = flexspline.fit(["offset"], log, "motor_torque", checks=False).model
    model = flexspline.fit(["offset"], log, "torsion", checks=False, into=model).model
    with pytest.raises(InputError, match="say which target"):
        model.predict(log)
    with pytest.raises(InputError, match="sensor_torque"):
        model.predict(log, "sensor_torque")


# Parts and facts together


def test_a_new_part_keeps_the_others_and_adds_facts():
    _, fit = small_fit()
    extra = Part("torsion", tuple(chosen("offset")), np.array([0.001]))
    both = fit.model.with_part(extra, {"gear_ratio": 100.0, "pole_pairs": 7})
    assert set(both.parts) == {"sensor", "torsion"}
    assert both.facts["pole_pairs"] == 7 and both.facts["output_spline"] == "flex"
    assert set(fit.model.parts) == {"sensor"}
    assert PART_OF["motor_current"] == PART_OF["motor_torque"] == "drive"


@pytest.mark.parametrize(
    ("key", "value"),
    [("gear_ratio", 50.0), ("output_spline", "circular")],
)
def test_parts_and_logs_of_another_gear_are_refused(key, value):
    log, fit = small_fit()
    extra = Part("torsion", tuple(chosen("offset")), np.array([0.001]))
    with pytest.raises(InputError, match=rf"{key}.*one joint"):
        fit.model.with_part(extra, {key: value})
    with pytest.raises(InputError, match=rf"{key}.*one joint"):
        fit.model.predict(log.with_facts({key: value}))


@pytest.mark.parametrize(("key", "value"), [("joint", "A2"), ("pole_pairs", 8), ("slots", 12)])
def test_a_part_of_another_joint_is_refused(key, value):
    model = Model({}, {"joint": "A1", "pole_pairs": 7, "slots": 9})
    extra = Part("torsion", tuple(chosen("offset")), np.array([0.001]))
    with pytest.raises(InputError, match=rf"{key}.*one joint"):
        model.with_part(extra, {key: value})


def test_the_schema_of_a_model_knows_every_channel_that_a_log_may_have() -> None:
    path = importlib.resources.files("flexspline") / "schemas" / "model.schema.json"
    known = json.loads(path.read_text(encoding="utf-8"))["$defs"]["channel"]["enum"]
    assert {*known} == {*CHANNELS, "known_load"} - {"simulated_torque"}


def test_what_a_prompt_shows_is_a_few_lines_without_arrays():
    import report_fits

    fit = report_fits.plain_fit()
    run = fit.runs[0].log
    shown = [fit, fit.model, fit.model.part(), fit.uncertainty, fit.predict(run),
             *fit.part.effects, *fit.parameters, flexspline.check(run)]  # fmt: skip
    for one in shown:
        text = repr(one)
        assert len(text.splitlines()) <= 5 and len(text) < 400, text
        assert "array(" not in text and "mappingproxy" not in text
    assert repr(flexspline.effect("coulomb_friction", direction_width=0.01)) == (
        "effect('coulomb_friction', direction_width=0.01)"
    )
