"""A stage's numbers are listed once, in the core: dataclass, schema, header and block follow."""

from __future__ import annotations

import dataclasses
import json
import math
from importlib.resources import files

import pytest

from flexspline import _core
from flexspline.estimators import ESTIMATORS
from flexspline.exporting.cpp_text import STAGES, given

SCHEMA = json.loads(files("flexspline").joinpath("schemas/model.schema.json").read_text("utf-8"))
OF_THE_MODEL = {  # of a part, put in by the plan
    "compliance": {"mesh_stiffness", "mesh_shape"},
    "adaptation": {"low", "high", "factor"},
}
WORDS = {  # what is no number of the core: rules, channels, records for people
    "differentiator": {"channels"},
    "observer": {"input", "discretisation"},
    "compliant_observer": {"input", "discretisation", "rotor_inertia"},
    "merge": {"method", "at_rest", "record"},
    "collision": {"input", "record"},
    "temperature_compensation": {"record"},
    "calibration": {"full_scale", "record"},
    "adaptation": {"effects", "range_factor", "use", "load"},
}


def numbers_of(key: str) -> set[str]:
    own = [stage for stage in STAGES.values() if stage.within == key and stage.key != "hysteresis"]
    return {field.key for stage in own for field in stage.fields}


@pytest.mark.parametrize("key", ESTIMATORS)
def test_the_schema_has_the_numbers_of_the_core_and_no_others(key: str) -> None:
    known = numbers_of(key) - OF_THE_MODEL.get(key, set())
    assert set(SCHEMA["$defs"][key]["properties"]) == known | WORDS.get(key, set())


@pytest.mark.parametrize("key", ESTIMATORS)
def test_the_dataclass_has_the_fields_of_the_schema(key: str) -> None:
    properties = set(SCHEMA["$defs"][key]["properties"])
    fields = {field.name for field in dataclasses.fields(ESTIMATORS[key])}
    if key == "observer":
        fields.remove("rotor_inertia")  # of the compliant observer alone
    assert fields == properties


def test_each_stage_of_the_core_is_in_an_estimators_entry() -> None:
    assert {stage.within for stage in STAGES.values()} == {*ESTIMATORS, "sensor"}


def test_a_default_lies_in_its_range() -> None:
    for key, stage in _core.stages().items():
        for field in stage["fields"]:
            assert field["low"] < field["high"], (key, field)
            if "default" in field and field["needed"]:
                assert field["low"] <= field["default"] <= field["high"], (key, field)


def test_two_fields_of_one_key_are_the_ends_of_its_list() -> None:
    entry = {"sensitivity": 60.0, "zero": 2.0, "voltage_range": [-1.0, 1.5]}
    found = {field.name: value for field, value in given(STAGES["calibration"], entry)}
    assert found == {"sensitivity": 60.0, "zero": 2.0, "low": -1.0, "high": 1.5}
    del entry["voltage_range"]
    bare = {
        field.name: (value, field.default) for field, value in given(STAGES["calibration"], entry)
    }
    assert bare["low"][0] is None and bare["low"][1] == -math.nextafter(math.inf, 0.0)
