"""Estimators in `model.json`: lossless, checked, complete; every refusal is one sentence."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flexspline
from flexspline import InputError, effect
from flexspline.errors import above_zero, number
from flexspline.estimators import (
    ESTIMATORS,
    Calibration,
    Collision,
    Compliance,
    Differentiator,
    Merge,
    Observer,
    ReadingChecks,
    TemperatureCompensation,
    Thermistor,
)
from flexspline.model import Model, Part

NUMBER = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.floats(1e-300, 1e300)
SHARE = st.floats(1e-6, 0.999)
RANGE = st.tuples(st.floats(-1e9, -1e-9), st.floats(0, 1e9))
RECORD = st.dictionaries(st.text(max_size=4), st.one_of(NUMBER, st.text(max_size=4), st.none()))
PAIR = st.tuples(POSITIVE, POSITIVE)


@st.composite
def collisions(draw):
    edges = sorted(draw(st.sets(st.floats(1e-6, 1e3), max_size=7)))
    thresholds = st.lists(POSITIVE, min_size=len(edges) + 1, max_size=len(edges) + 1)
    return Collision(
        "sensor", edges, draw(thresholds), draw(thresholds), draw(SHARE), draw(POSITIVE)
    )


ANY = {
    "reading_checks": st.builds(
        ReadingChecks,
        voltage_range=st.none() | RANGE,
        thermistor_voltage_range=st.none() | RANGE,
        most_speed=POSITIVE,
        twist=st.none() | POSITIVE,
        forget=POSITIVE,
        apart=st.none() | POSITIVE,
    ),
    "differentiator": st.builds(
        Differentiator,
        POSITIVE,
        st.sampled_from(
            [
                ("output_velocity",),
                ("output_acceleration",),
                ("output_velocity", "output_acceleration"),
            ]
        ),
    ),
    "thermistor": st.builds(
        Thermistor, POSITIVE, POSITIVE, POSITIVE, POSITIVE, st.floats(-273, 1e3)
    ),
    "temperature_compensation": st.builds(
        TemperatureCompensation,
        st.lists(NUMBER, min_size=1, max_size=6),
        NUMBER,
        NUMBER,
        st.floats(0, 1e6),
        st.none() | RANGE,
        RECORD,
    ),
    "calibration": st.builds(
        Calibration,
        NUMBER.filter(bool),
        NUMBER,
        st.none() | RANGE,
        st.none() | POSITIVE,
        RECORD,
    ),
    "observer": st.builds(
        Observer,
        POSITIVE,
        st.sampled_from(["sensor_torque", "motor_torque"]),
        st.sampled_from(["exact", "euler"]),
    ),
    "compliant_observer": st.builds(
        Observer,
        POSITIVE,
        st.just("compliance"),
        st.sampled_from(["exact", "euler"]),
        st.none() | POSITIVE,
    ),
    "compliance": st.builds(Compliance, SHARE),
    "merge": st.builds(
        Merge,
        POSITIVE,
        POSITIVE,
        record=RECORD,
        at_rest=st.sampled_from(["compliance", "compliant_observer"]),
    )
    | st.builds(Merge, POSITIVE, POSITIVE, st.just("kalman"), POSITIVE, PAIR, PAIR),
    "collision": collisions(),
}


@settings(max_examples=60, deadline=None, derandomize=True)
@given(estimators=st.fixed_dictionaries({}, optional=ANY))
def test_estimators_survive_the_file_to_the_last_bit(estimators):
    model = Model({}, {"joint": "A"}, estimators)
    text = model.to_json()
    again = Model.from_json(text)
    assert dict(again.estimators) == estimators
    assert {key: type(made) for key, made in again.estimators.items()} == {
        key: ESTIMATORS[key] for key in estimators
    }
    assert again.to_json() == text


def test_a_file_from_before_the_estimators_loads_without_any():
    content = json.loads(Model({}).to_json())
    for old in ({**content, "estimators": {}}, {k: content[k] for k in content if k[0] != "e"}):
        assert not Model.from_json(json.dumps(old)).estimators


# Refusals of construction: what the call was, and a word that the sentence must hold.

THERMISTOR = {
    "supply_voltage": 3.3,
    "divider_resistance": 1e4,
    "nominal_resistance": 1e4,
    "beta": 3950,
}
KALMAN = {"method": "kalman", "walk": 1.0, "observer_noise": (1, 2), "compliance_noise": (1, 2)}
WRONG = {
    "supply of zero": (lambda: Thermistor(**{**THERMISTOR, "supply_voltage": 0}), "supply_voltage"),
    "no beta": (lambda: Thermistor(**{**THERMISTOR, "beta": float("nan")}), "beta"),
    "colder than cold": (lambda: Thermistor(**THERMISTOR, nominal_temperature=-300), "zero"),
    "no coefficients": (lambda: TemperatureCompensation(()), "0 coefficients"),
    "degree seven": (lambda: TemperatureCompensation((1,) * 7), "at most 6"),
    "coefficient of infinity": (lambda: TemperatureCompensation((float("inf"),)), "[0]"),
    "one number for a list": (lambda: TemperatureCompensation(1.0), "list"),
    "a negative lag": (lambda: TemperatureCompensation((1,), thermal_lag=-1), "thermal_lag"),
    "a range turned round": (
        lambda: TemperatureCompensation((1,), temperature_range=(45, 20)),
        "temperature_range",
    ),
    "a record of arrays": (
        lambda: Calibration(1, 0, record={"x": np.zeros(2)}),
        "calibration: the record",
    ),
    "a record with NaN": (lambda: Calibration(1, 0, record={"x": float("nan")}), "JSON"),
    "a blind sensor": (lambda: Calibration(0, 0), "sensitivity"),
    "a zero in words": (lambda: Calibration(1, "two"), "zero"),
    "a truth for a number": (lambda: Calibration(True, 0), "sensitivity"),
    "three ends": (lambda: Calibration(1, 0, voltage_range=(0, 1, 2)), "voltage_range"),
    "full scale below zero": (lambda: Calibration(1, 0, full_scale=-70), "full_scale"),
    "no limits": (lambda: ReadingChecks(forget=5.0), "nothing to check"),
    "a limit of zero": (lambda: ReadingChecks(most_speed=0), "most_speed"),
    "a bandwidth of zero": (lambda: Differentiator(0), "bandwidth"),
    "a channel that nobody makes": (lambda: Differentiator(20, ("torque",)), "channel"),
    "no channels": (lambda: Differentiator(20, ()), "no channels"),
    "gain of zero": (lambda: Observer(0), "gain"),
    "the papers' gain of -8": (lambda: Observer(-8), "gain"),
    "an unknown input": (lambda: Observer(1, "motor"), "motor_torque"),
    "an unknown rule": (lambda: Observer(1, discretisation="trapezoid"), "discretisation"),
    "a rotor of the wrong observer": (
        lambda: Observer(1, "motor_torque", rotor_inertia=1e-4),
        "belongs to the input compliance",
    ),
    "a rotor below zero": (lambda: Observer(1, "compliance", rotor_inertia=-1), "rotor_inertia"),
    "a rotor that is no number": (
        lambda: Observer(1, "compliance", rotor_inertia=float("nan")),
        "rotor_inertia",
    ),
    "rest by nothing": (lambda: Merge(500, 0.1, at_rest="observer"), "compliant_observer"),
    "no margin": (lambda: Compliance(0), "margin"),
    "nothing but margin": (lambda: Compliance(1), "margin"),
    "a slope of zero": (lambda: Merge(0, 0.1), "alpha"),
    "a negative speed": (lambda: Merge(500, -0.1), "transition_velocity"),
    "an unknown method": (lambda: Merge(500, 0.1, "kallman"), "kalman"),
    "a walk without a filter": (lambda: Merge(500, 0.1, walk=1), "walk"),
    "a filter without a walk": (lambda: Merge(500, 0.1, **{**KALMAN, "walk": None}), "walk"),
    "one noise for two": (
        lambda: Merge(500, 0.1, **{**KALMAN, "observer_noise": (1,)}),
        "observer_noise",
    ),
    "no noise at all": (
        lambda: Merge(500, 0.1, **{**KALMAN, "compliance_noise": (0, 1)}),
        "compliance_noise",
    ),
    "an unknown residual": (lambda: Collision("compliance", (), (1,), (1,)), "observer"),
    "a threshold below zero": (lambda: Collision("sensor", (), (-1,), (1,)), "negative"),
    "a threshold missing": (lambda: Collision("sensor", (0.1,), (1, 1), (1,)), "2 bands"),
    "edges that fall": (lambda: Collision("sensor", (2, 1), (1,) * 3, (1,) * 3), "increasing"),
    "nine bands": (lambda: Collision("sensor", range(1, 9), (1,) * 9, (1,) * 9), "at most 7"),
    "a release above": (lambda: Collision("sensor", (), (1,), (1,), 1.5), "release"),
    "a negative hold": (lambda: Collision("sensor", (), (1,), (1,), hold=-1), "hold"),
}


def assert_one_sentence(sentence: str, word: str) -> None:
    assert word in sentence and ";" in sentence and "\n" not in sentence, sentence


@pytest.mark.parametrize("case", WRONG)
def test_a_value_that_cannot_be_is_refused_with_one_sentence(case):
    make, word = WRONG[case]
    with pytest.raises(InputError) as caught:
        make()
    assert_one_sentence(str(caught.value), word)


# Refusals of the file


def damaged(change) -> str:
    made = Model({}, {}, {"observer": Observer(80.0), "merge": Merge(500, 0.001)})
    content = json.loads(made.to_json())
    change(content["estimators"])
    return json.dumps(content)


DAMAGE = {
    "an unknown estimator": (lambda e: e.update(obsever=e.pop("observer")), "obsever"),
    "an unknown field": (lambda e: e["observer"].update(inertia=1), "inertia"),
    "no gain": (lambda e: e["observer"].pop("gain"), "gain"),
    "a gain of zero": (lambda e: e["observer"].update(gain=0), "observer/gain"),
    "a gain in words": (lambda e: e["observer"].update(gain="80"), "80"),
    "an unknown input": (lambda e: e["observer"].update(input="motor"), "motor"),
    "a link's observer by its key alone": (
        lambda e: e.update(compliant_observer={"gain": 80}),
        "compliant_observer",
    ),
    "a link's observer by the motor": (
        lambda e: e.update(compliant_observer={"gain": 80, "input": "motor_torque"}),
        "compliant_observer/input",
    ),
    "fields of another method": (lambda e: e["merge"].update(walk=1), "walk"),
    "a list of estimators": (lambda e: e.update(observer=[80]), "observer"),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_damaged_estimators_are_refused_with_one_sentence_that_names_the_file(case, refused_model):
    change, word = DAMAGE[case]
    assert_one_sentence(refused_model(damaged(change)), word)


def test_an_entry_without_its_class_checks_its_own_fields():
    with pytest.raises(InputError, match="did you mean 'gain'"):
        Observer.from_json({"gian": 80.0})
    with pytest.raises(InputError, match="lacks 'gain'"):
        Observer.from_json({})


# What an estimator needs of its model

DRIVE = Part("motor_torque", (effect("inertia"), effect("viscous_friction")), np.ones(2))
LOOSE = Part("motor_torque", (effect("viscous_friction"),), np.ones(1))
AMPERES = Part("motor_current", (effect("inertia"),), np.ones(1))
MESHED = Part("torsion", (effect("mesh_compliance"),), np.ones(1))
BENT = Part("torsion", (effect("offset"),), np.ones(1))
COLLISION = {"speed_edges": (), "negative": (1,), "positive": (1,)}
INCOMPLETE = {
    "an observer without a drive": ({}, Observer(80, "motor_torque"), "--target motor_torque"),
    "an observer without inertia": ({"drive": LOOSE}, Observer(80, "motor_torque"), "inertia"),
    "an observer in amperes": ({"drive": AMPERES}, Observer(80, "motor_torque"), "motor_torque"),
    "a compliance without torsion": ({}, Compliance(), "--target torsion"),
    "a compliance without a mesh": ({"torsion": BENT}, Compliance(), "mesh_compliance"),
    "a link without torsion": ({"drive": DRIVE}, Observer(80, "compliance"), "--target torsion"),
    "a link without a mesh": (
        {"drive": DRIVE, "torsion": BENT},
        Observer(80, "compliance"),
        "mesh_compliance",
    ),
    "a link without inertia": (
        {"drive": LOOSE, "torsion": MESHED},
        Observer(80, "compliance"),
        "--effects inertia,",
    ),
    "a link without the compliance": (
        {"drive": DRIVE, "torsion": MESHED},
        Observer(80, "compliance"),
        "with_estimator(flexspline.Compliance(",
    ),
    "a contact of no link": (
        {},
        Collision("compliant_observer", **COLLISION),
        'flexspline.Observer(..., input="compliance")',
    ),
    "a merge of nothing": ({}, Merge(500, 0.001), "flexspline.Observer"),
    "a contact of no observer": ({}, Collision("observer", **COLLISION), "flexspline.Observer"),
    "a contact of no merge": ({}, Collision("merged", **COLLISION), "flexspline.Merge"),
}


@pytest.mark.parametrize("case", INCOMPLETE)
def test_what_an_estimator_lacks_is_named_with_the_command_that_makes_it(case):
    parts, estimator, word = INCOMPLETE[case]
    with pytest.raises(InputError) as caught:
        Model(parts).with_estimator(estimator)
    assert_one_sentence(str(caught.value), word)
    kept = case == "an observer without inertia"  # its part is there, and lacks an effect
    assert ("fit it again with" if kept else "which the model lacks") in str(caught.value)


def test_an_estimator_is_added_and_replaced_and_the_old_model_stays():
    bare = Model({"drive": DRIVE})
    first = bare.with_estimator(Observer(80, "motor_torque"))
    second = first.with_estimator(Observer(40, "motor_torque")).with_estimator(
        Collision("observer", **COLLISION)
    )
    assert not bare.estimators and first.estimators["observer"].gain == 80
    assert set(second.estimators) == {"observer", "collision"}
    assert second.estimators["observer"].gain == 40 and second.parts == bare.parts


def test_both_observers_fit_into_one_model_each_by_its_key():
    link = Observer(60, "compliance", rotor_inertia=1e-5)
    model = Model({"drive": DRIVE, "torsion": MESHED}, {"gear_ratio": 100.0})
    for made in (Observer(80, "motor_torque"), Compliance(), link):
        model = model.with_estimator(made)
    assert set(model.estimators) == {"observer", "compliance", "compliant_observer"}
    with pytest.raises(InputError, match="needs the estimator compliant_observer") as caught:
        Model({}, {}, {"observer": Observer(80)}).with_estimator(
            Merge(500, 0.001, at_rest="compliant_observer")
        )
    assert_one_sentence(str(caught.value), 'Observer(..., input="compliance")')
    assert Model.from_json(model.to_json()).estimators["compliant_observer"] == link
    with pytest.raises(InputError, match="whose key is compliant_observer"):
        Model({}, {}, {"observer": link})


def test_what_is_no_estimator_is_refused():
    with pytest.raises(InputError, match="dict"):
        Model({}).with_estimator({"gain": 80})
    with pytest.raises(InputError, match="did you mean 'observer'"):
        Model({}, {}, {"observers": Observer(80)})
    with pytest.raises(InputError, match="is a Merge"):
        Model({}, {}, {"observer": Merge(500, 0.001)})
    with pytest.raises(InputError, match="'observer' is a method; give one of"):
        Model({}, {}, {"observer": Observer(80).to_json})


def test_the_names_are_public():
    for made in ESTIMATORS.values():
        assert getattr(flexspline, made.__name__) is made


@pytest.mark.parametrize("value", ["5", b"5", "a", True, None, [5], {}, 10**400, np.nan, np.inf])
def test_what_is_no_number_is_refused_and_shortened(value: object) -> None:
    with pytest.raises(InputError, match=r"^gain = .* is no finite number; give one in 1/s$"):
        number(value, "gain", "1/s")
    assert number(np.float32(0.5), "gain") == 0.5


def test_what_is_refused_is_said_with_its_unit_where_it_has_one() -> None:
    for unit, end in (
        ("kg·m²", "give a number above zero in kg·m²"),
        ("", "give a number above zero"),
    ):
        with pytest.raises(InputError) as caught:
            above_zero(-1.0, "observer: rotor_inertia", unit)
        assert str(caught.value).endswith(end)
