"""Whatever the texts of a model hold, its exported header declares the same and nothing else."""

from __future__ import annotations

import copy
import importlib.resources
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import chain_rig
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from flexspline.effects import CATALOGUE, effect
from flexspline.errors import InputError
from flexspline.exporting.cpp_text import (
    WORDS,
    comment,
    identifier,
    include,
    namespace_name,
    string_literal,
)
from flexspline.exporting.header import header_text
from flexspline.model import Model, Part

RECORD = {
    "lowpass": 5.0,
    "channels": ["output_position", "output_velocity", "motor_position", "known_load"],
    "prepared": [{"channel": "output_velocity", "source": "output_position", "bandwidth": 16.0}],
    "validity": {"output_velocity": [-1.5, 1.25], "known_load": [0.0, 20.0]},
    "parameters": [
        {
            "name": "offset.offset",
            "kind": "coefficient",
            "value": 0.1,
            "standard_error": 0.02,
            "unit": "Nm·s²/rad²",
            "state": "at lower bound",
            "determined": True,
        }
    ],
    "confounded": [{"names": ["offset.offset"], "exact": False, "known": "that"}],
    "logs": [{"name": "run 1", "sha256": "ab12", "rows": 5, "history": ["zero phase, 12 Hz"]}],
}
FACTS = {
    "gear_ratio": 100.0,
    "output_spline": "circular",
    "joint": "elbow",
    "serial": "00123",
}


def part(target: str, *effects: Any) -> Part:
    terms = sum(len(one.terms) for one in effects)
    return Part(target, effects, 0.1 + np.arange(terms), "reference_torque", RECORD)


SENSOR = part("sensor_torque", effect("offset"), effect("gain_error"))
DRIVE = part("motor_current", effect("offset"), effect("load_dependent_friction"))
TORSION = part(
    "torsion",
    effect("offset"),
    effect("mesh_compliance"),
    effect("torsional_hysteresis"),
    effect("kinematic_error", orders=[2, (1, "wave_generator_on_flexspline")]),
)


def whole_chain() -> Model:
    """A joint with each estimator, and texts in each part."""
    made = chain_rig.angle_joint()
    drive = replace(made.parts["drive"], record=RECORD)
    return replace(
        made.with_estimator(chain_rig.KALMAN),
        parts={**made.parts, "drive": drive},
        facts={**made.facts, "joint": "elbow"},
    )


MODELS = {
    "sensor": json.loads(Model({"sensor": SENSOR}, FACTS).to_json()),
    "drive": json.loads(Model({"drive": DRIVE}, FACTS).to_json()),
    "torsion": json.loads(Model({"torsion": TORSION}, FACTS).to_json()),
    "chain": json.loads(whole_chain().to_json()),
}


def places(content: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], bool]]:
    """The path of each string of a model, and whether it is a key."""
    if isinstance(content, str):
        yield path, False
    entries = content.items() if isinstance(content, dict) else ()
    entries = enumerate(content) if isinstance(content, list) else entries
    for key, value in entries:
        if isinstance(key, str):
            yield (*path, key), True
        yield from places(value, (*path, key))


PLACES = [(name, *place) for name, content in MODELS.items() for place in places(content)]


def strings(content: Any) -> set[str]:
    return {path[-1] for path, key in places(content) if key} | {
        value for value in _values(content) if isinstance(value, str)
    }


def _values(content: Any) -> Iterator[Any]:
    if isinstance(content, (dict, list)):
        for value in content.values() if isinstance(content, dict) else content:
            yield from _values(value)
    else:
        yield content


SCHEMA = importlib.resources.files("flexspline") / "schemas" / "model.schema.json"
KNOWN = strings(json.loads(SCHEMA.read_text(encoding="utf-8"))) | set(CATALOGUE)
KNOWN |= {shape.name for info in CATALOGUE.values() for shape in info.shapes}
KNOWN |= {pair for info in CATALOGUE.values() for pair in info.pairs}


def changed(name: str, path: tuple[Any, ...], key: bool, text: str | None) -> dict[str, Any]:
    """The model with a text in one place; of a key, None takes its entry out."""
    content = copy.deepcopy(MODELS[name])
    inner = content
    for step in path[:-1]:
        inner = inner[step]
    if not key:
        inner[path[-1]] = text
        return content
    value = inner.pop(path[-1])
    if text is not None:
        inner[text] = value
    return content


def header_of(content: dict[str, Any]) -> str | None:
    """The header of a model's JSON, None where it is refused in one sentence."""
    try:
        return header_text(Model.from_json(json.dumps(content)), "joint")
    except InputError as error:
        assert "\n" not in str(error)
        return None


def declarations(header: str) -> list[str]:
    """The tokens of a header as the most lenient of compilers reads it.

    It knows trigraphs, ends a line at all that any reader takes for its end, and joins a line that
    ends in a backslash with the next. Of a string nothing but its quotes is left.
    """
    text = header.replace("??/", "\\")
    text = re.sub(r"\\[ \t\v\f]*(\r\n|[\n\r\v\f\x1c-\x1e\x85\u2028\u2029])", "", text)
    text = "\n".join(text.splitlines())
    found = r'"(?:[^"\\\n]|\\.)*"|//[^\n]*|/\*.*?\*/'
    kept = re.sub(found, lambda hit: '""' if hit[0][0] == '"' else " ", text, flags=re.DOTALL)
    return re.findall(r'""|\w[\w.]*|\S', kept)


DECLARED = {name: declarations(header_of(content) or "") for name, content in MODELS.items()}


def assert_harmless(name: str, path: tuple[Any, ...], key: bool, text: str) -> None:
    header = header_of(changed(name, path, key, text))
    if header is None:
        return
    assert all(letter == "\n" or letter.isprintable() for letter in header)
    assert not any(line.endswith("\\") for line in header.splitlines())
    expected = DECLARED[name]
    if key:
        without = header_of(changed(name, path, True, None))
        assert without is not None  # an entry that is needed cannot be called otherwise
        expected = declarations(without)
    assert declarations(header) == expected


NASTY = (
    "x{}; inline int pwned = 1; template <typename S> inline constexpr std::array<S, 2> y",
    '"; int pwned = 1; "',
    "*/ int pwned = 1; /*",
    "\nint pwned = 1;\n//",
    "\u2028int pwned = 1;",
    "\x0bint pwned = 1;",
    "zero phase\\",
    "zero phase??/",
    "zero phase \\ \n",
    "zero phase /\\* */ // \u202e;1 = denwp tni",
    "  zero phase\r\n#include </etc/passwd>",
    "%s\x1b[31m\x00ÿ\ufeff",
    "output_velocity\n",
    "\ud800",
)


@pytest.mark.parametrize("first", [0, 1, 5])
def test_no_string_of_a_model_reaches_the_declarations(first: int) -> None:
    for number, place in enumerate(PLACES, first):
        assert_harmless(*place, NASTY[number % len(NASTY)])


LETTERS = st.characters() | st.sampled_from("\\/*?\"'\n\r\t{};#%:<>_a1\u2028\u202e\x85 ")
TEXTS = st.text(LETTERS, max_size=40) | st.lists(st.sampled_from(NASTY), max_size=3).map("".join)


@given(place=st.sampled_from(PLACES), text=TEXTS)
@settings(max_examples=400, deadline=None, derandomize=True)
def test_arbitrary_text_anywhere_leaves_the_declarations_as_they_are(place, text) -> None:
    assume(text not in KNOWN)
    assert_harmless(*place, text)


def test_the_reader_of_these_tests_sees_what_is_smuggled_in() -> None:
    plain = declarations('#pragma once\nint a = 1;  // x\nint b = 2; /* c */ auto s = "d";\n')
    assert plain[-7:] == ["2", ";", "auto", "s", "=", '""', ";"]
    for smuggled in ("// x\\\nint a;", "// x??/\nint a;"):
        assert declarations(smuggled) == []  # a line too few
    for smuggled in ("// x\u2028int a;", "// x\rint a;", "/* */ int a; /* */", '"\\"" int a;'):
        assert declarations(smuggled)[-3:] == ["int", "a", ";"]
    assert DECLARED["chain"].count("struct") == 2 and "validity" in DECLARED["drive"]


@pytest.mark.parametrize("name", ["outputvelocity", "", "output_velocity ", "load", "x{}; int y"])
def test_a_range_of_what_is_no_channel_is_refused(name: str) -> None:
    content = changed("drive", ("drive", "validity", "known_load"), True, name)
    with pytest.raises(InputError, match="drive/validity"):
        Model.from_json(json.dumps(content))
    record = {**RECORD, "validity": {name: [0.0, 1.0]}}
    made = Model({"drive": replace(DRIVE, record=record)}, FACTS)
    with pytest.raises(InputError, match="no channel"):
        header_text(made, "joint")


@given(text=TEXTS)
@settings(max_examples=300, deadline=None, derandomize=True)
def test_every_text_is_one_line_of_a_comment_and_one_string(text: str) -> None:
    assert declarations(f"// {comment(text)}\nint a;") == ["int", "a", ";"]
    assert declarations(f"/* {comment(text)} */ int a;") == ["int", "a", ";"]
    assert declarations(f"{string_literal(text)};") == ['""', ";"]
    assert comment(text).isprintable() and string_literal(text).isascii()


def test_a_comment_spells_the_letters_and_signs_of_formulas() -> None:
    said = comment("wave generator (θ), Δτ ≤ 3 Nm → 5 µm, 10 Ω, 0.1 rad/s², Müller, 日")
    assert said == (
        "wave generator (theta), Deltatau <= 3 Nm -> 5 um, 10 Ohm, 0.1 rad/s², Muller, ?"
    )


def test_a_string_keeps_what_it_says() -> None:
    text = 'a "b" \\ ?? ° \n1'
    made = string_literal(text)
    back = re.sub(r"\\([0-7]{3})", lambda hit: chr(int(hit[1], 8)), made[1:-1])
    assert back.encode("latin-1").decode() == text


@pytest.mark.parametrize("text", ["", "a b", "a__b", "_a", "1a", "é", "float", "a\n", "a" * 65])
def test_what_is_no_name_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="no name"):
        identifier(text)


@pytest.mark.parametrize("text", ["", "../a.hpp", "a b.hpp", 'a"', "a\n", "/a.hpp", "a<b>"])
def test_what_is_no_header_is_not_included(text: str) -> None:
    with pytest.raises(InputError, match="no name of a header"):
        include(text)


@given(stem=TEXTS)
@settings(max_examples=300, deadline=None, derandomize=True)
def test_every_file_name_gives_a_namespace(stem: str) -> None:
    assert identifier(namespace_name(stem)) not in WORDS


@pytest.mark.parametrize(
    "stem", ["j0", "j1", "y0", "gamma", "log", "exp", "round", "time", "index", "gammaf", "std2"]
)
def test_a_namespace_does_not_clash_with_the_c_library(stem: str) -> None:
    assert namespace_name(stem) == f"{stem}_model"
