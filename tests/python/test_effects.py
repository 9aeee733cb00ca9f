"""The catalogue and one effect with its shapes and orders."""

from __future__ import annotations

import pickle
import re

import numpy as np
import pytest
from fit_logs import log_with, motion, rows_of

from flexspline import CATALOGUE, Effect, InputError, effect
from flexspline.effects import UNITS, require_effects, unit_in

FIRST = [
    "offset",
    "coulomb_friction",
    "coulomb_friction_per_direction",
    "viscous_friction",
    "nonlinear_viscous_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "inertia",
    "gravity",
    "output_ripple",
    "wave_generator_ripple",
    "cogging",
    "temperature_drift",
    "gain_error",
]
RIPPLES = [name for name, info in CATALOGUE.items() if info.pairs]


def test_the_catalogue_holds_the_first_effects_with_their_targets():
    assert set(FIRST) <= set(CATALOGUE)
    targets = {"offset": "SMD", "gain_error": "S", "temperature_drift": "SD"}
    for name in FIRST:
        assert CATALOGUE[name].targets == targets.get(name, "SM"), name


def test_the_torsion_effects_are_for_the_torsion_and_its_units():
    names = ("mesh_compliance", "wave_generator_compliance", "kinematic_error")
    names += ("torsional_hysteresis", "backlash", "temperature_dependent_stiffness")
    for name in names:
        info = CATALOGUE[name]
        assert info.targets == "D"
        assert all(unit_in(t.unit, "torsion", "reference_torque") == t.unit for t in info.terms)
        assert all(t.unit.startswith("rad") for t in info.terms)
    shared = ("offset", "temperature_drift", "time_drift")
    assert all("D" in CATALOGUE[name].targets for name in shared)


def test_the_effects_that_remember_are_those_of_path_and_lag():
    assert {name for name, info in CATALOGUE.items() if info.remembers} == {
        "presliding_friction",
        "thermal_gradient_drift",
        "torque_hysteresis",
        "sensor_lag",
        "torsional_hysteresis",
    }


def test_every_effect_of_the_specification_has_its_targets():
    targets = {
        "direction_dependent_friction": "SM",
        "presliding_friction": "SM",
        "temperature_dependent_friction": "SM",
        "position_dependent_friction": "SM",
        "speed_dependent_ripple": "SM",
        "thermal_gradient_drift": "S",
        "time_drift": "SD",
        "gain_temperature_dependence": "S",
        "sensor_nonlinearity": "S",
        "torque_hysteresis": "S",
        "motor_crosstalk": "S",
        "sensor_lag": "SM",
        "torque_constant_error": "M",
        "backlash": "D",
        "temperature_dependent_stiffness": "D",
    }
    assert {name: CATALOGUE[name].targets for name in targets} == targets


def test_an_effect_with_several_paths_reads_the_one_in_use():
    by_load = effect("torsional_hysteresis")
    by_motor = by_load.without_load()
    assert by_load.reads == ("load",) and by_motor.reads == ("motor_position",)
    assert [s.name for s in by_load.fitted_shapes] == ["load_width"]
    assert [s.name for s in by_motor.fitted_shapes] == ["angle_width"]
    assert by_motor.without_load() == by_motor
    assert effect("mesh_compliance").without_load() == effect("mesh_compliance")


def test_every_effect_says_where_it_comes_from_and_every_shape_starts_within_its_bounds():
    for info in CATALOGUE.values():
        assert info.signature and info.source
        for shape in info.shapes:
            assert shape.lower < shape.upper
            assert shape.lower <= shape.default <= shape.upper


def test_the_rows_are_the_formulas_of_the_papers():
    channels = motion(3, 300)
    log = log_with(channels, temperature=np.linspace(20, 45, 300))
    q, v = channels["output_position"], channels["output_velocity"]
    direction = np.tanh(v / 0.03)
    warm = log["temperature"] - 25.0
    formulas = {
        effect("offset"): [np.ones(300)],
        effect("coulomb_friction", direction_width=0.03): [direction],
        effect("coulomb_friction_per_direction", direction_width=0.03): [
            1 / (1 + np.exp(-2 * v / 0.03)),
            1 / (1 + np.exp(2 * v / 0.03)),
        ],
        effect("direction_dependent_friction", direction_width=0.03): [direction**2, v * direction],
        effect("viscous_friction"): [v],
        effect("nonlinear_viscous_friction"): [v * np.abs(v), v**3],
        effect("stribeck_friction", direction_width=0.03, stribeck_velocity=0.5): [
            direction * np.exp(-((v / 0.5) ** 2))
        ],
        effect("inertia"): [channels["output_acceleration"]],
        effect("gravity"): [np.sin(q), np.cos(q)],
        effect("output_ripple", orders=[1, 3]): [
            np.cos(q),
            np.sin(q),
            np.cos(3 * q),
            np.sin(3 * q),
        ],
        effect("temperature_drift"): [warm, warm**2],
    }
    formulas |= {
        effect("time_drift"): [log["time"], log["time"] ** 2],
        effect("temperature_dependent_friction"): [v * warm, v * warm**2],
        effect("position_dependent_friction", direction_width=0.03): [
            wave(k * q) * direction for k in (1, 2, 3) for wave in (np.cos, np.sin)
        ],
    }
    load, torque = 30.0 * np.sin(0.7 * channels["time"]), 0.8 * np.cos(1.1 * channels["time"])
    log = log.with_columns({"reference_torque": load, "motor_torque": torque}, note="simulated")
    theta = 101.0 * q
    log = log.with_columns({"motor_position": theta}, note="simulated")
    log = log.with_facts({"gear_ratio": 100.0, "output_spline": "circular"})
    pairs = [(2, "output_on_housing"), (2, "motor_on_stator")]
    pairs += [(2, "wave_generator_on_circular_spline")]
    angles = [theta, q, theta - q]  # sorted by the names of the pairs
    formulas |= {
        effect("mesh_compliance", mesh_shape=0.05): [-np.arctan(0.05 * load) / 0.05],
        effect("wave_generator_compliance", wave_generator_shape=3.0): [
            -np.sign(torque) * (1 - np.exp(-3.0 * np.abs(torque))) / 3.0
        ],
        effect("kinematic_error", orders=pairs): [
            wave(2 * angle) for angle in angles for wave in (np.cos, np.sin)
        ],
        effect("gain_temperature_dependence"): [load * warm],
        effect("sensor_nonlinearity"): [load**2, load**3],
        effect("motor_crosstalk"): [torque],
        effect("torque_constant_error"): [load],
        effect("backlash", contact_torque=2.0): [-np.tanh(load / 2.0)],
        effect("temperature_dependent_stiffness"): [-np.arctan(0.05 * load) / 0.05 * warm],
    }
    for made, columns in formulas.items():
        rows = rows_of([made], log, "reference_torque")
        assert rows == pytest.approx(np.column_stack(columns), rel=1e-9, abs=1e-9), made.name


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_an_effect_survives_pickling(name):
    made = effect(name, orders=[2, 5]) if name in RIPPLES else effect(name)
    again = pickle.loads(pickle.dumps(made))
    assert again == made and again.terms == made.terms


def test_orders_are_sorted_and_named():
    made = effect("output_ripple", orders=[8, 2])
    assert [term.name for term in made.terms] == ["cosine 2", "sine 2", "cosine 8", "sine 8"]


@pytest.mark.parametrize("numbers", [np.array([1, 2]), (1.0, 2.0), range(1, 3)])
def test_orders_may_be_any_whole_numbers(numbers):
    assert effect("output_ripple", orders=numbers) == effect("output_ripple", orders=[1, 2])


def test_an_order_names_its_pair_where_there_is_a_choice():
    pair = "wave_generator_on_circular_spline"
    made = effect("wave_generator_ripple", orders=[(2, pair), 2])
    names = [term.name for term in made.terms]
    assert names[0].startswith("cosine 2") and len(set(names)) == 4
    assert any("circular spline" in name for name in names)


def test_a_shape_can_be_replaced_and_the_effect_stays_as_it_was():
    made = effect("stribeck_friction")
    other = made.with_shapes(stribeck_velocity=0.3)
    assert other.shapes["stribeck_velocity"] == 0.3
    assert made.shapes["stribeck_velocity"] == 0.1
    with pytest.raises(TypeError):
        made.shapes["stribeck_velocity"] = 0.4  # type: ignore[index]


@pytest.mark.parametrize(
    ("unit", "target", "known_load", "shown"),
    [
        ("Nm·s/rad", "sensor_torque", None, "Nm·s/rad"),
        ("Nm·s/rad", "motor_current", None, "A·s/rad"),
        ("kg·m²", "motor_current", None, "A·s²/rad"),
        ("Nm", "torsion", "reference_torque", "rad"),
        ("Nm/K", "torsion", "reference_torque", "rad/K"),
        ("rad/Nm", "torsion", "reference_torque", "rad/Nm"),
        ("1", "sensor_torque", "reference_torque", "1"),
        ("1", "motor_current", "reference_torque", "A/Nm"),
        ("1", "motor_current", None, "1"),
    ],
)
def test_units_follow_the_target_and_the_load(unit, target, known_load, shown):
    assert unit_in(unit, target, known_load) == shown


def test_units_of_a_torque_are_those_of_the_catalogue():
    for info in CATALOGUE.values():
        for term in info.terms:
            assert unit_in(term.unit, "motor_torque", None) == term.unit
    assert set(UNITS.values()) == {"Nm", "A", "rad"}


PAIR = "output_on_housing"
WRONG = {
    "unknown effect": (lambda: effect("friction_viscous"), "friction_viscous"),
    "unknown shape": (lambda: effect("inertia", width=1.0), "no shape 'width'"),
    "shape of another effect": (lambda: effect("offset", direction_width=0.1), "direction_width"),
    "shape too small": (lambda: effect("coulomb_friction", direction_width=0.0), "0.0001"),
    "shape not a number": (lambda: effect("coulomb_friction", direction_width=np.nan), "nan"),
    "shape in words": (
        lambda: effect("coulomb_friction", direction_width="0.1"),
        "'coulomb_friction': direction_width = '0.1' is no finite number; give one in rad/s",
    ),
    "orders as one number": (lambda: effect("output_ripple", orders=2), "orders = 2 is no list"),
    "orders of an offset": (lambda: effect("offset", orders=[1]), "no orders"),
    "harmonics of an offset": (lambda: Effect("offset", {}, ((1, PAIR),)), "no orders"),
    "negative order": (lambda: effect("output_ripple", orders=[-2]), "order -2"),
    "unknown pair": (lambda: effect("output_ripple", orders=[(1, "moon")]), "moon"),
    "an order that is not finite": (lambda: effect("output_ripple", orders=[np.inf]), "order inf"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_effect_is_refused_with_one_sentence(case):
    make, word = WRONG[case]
    with pytest.raises(InputError, match=re.escape(word)) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_target_takes_only_its_effects():
    require_effects([effect("offset"), effect("inertia")], "motor_current")
    with pytest.raises(InputError, match=r"inertia.*torsion"):
        require_effects([effect("inertia")], "torsion")
    with pytest.raises(InputError, match="did you mean 'motor_torque'"):
        require_effects([], "motor_torqe")
