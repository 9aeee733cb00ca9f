"""Whatever a file holds, flexspline reads it or says in one sentence why not."""

from __future__ import annotations

import copy
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import chain_rig
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flexspline
from flexspline import InputError, Model
from flexspline.exporting.block import block_bytes
from flexspline.exporting.header import header_text

MODEL = json.loads(chain_rig.angle_joint().to_json())
WORDS = ("", "Nm", "motor_torque", "exact", "offset", "2", "NaN")
NUMBERS = st.one_of(
    st.integers(-3, 3),
    st.floats(),
    st.sampled_from([1e-320, 1e38, 1e39, 1e308, 10**400, 2**63, -0.0]),
)
SCALARS = st.one_of(st.none(), st.booleans(), NUMBERS, st.sampled_from(WORDS), st.text(max_size=4))
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from([*WORDS, "gain"]), inner, max_size=3)
    ),
    max_leaves=6,
)


def one_sentence(call: Callable[[], Any]) -> Any:
    """What the call returns, or None where it said in one sentence why not."""
    try:
        return call()
    except InputError as error:
        said = str(error)
        assert said and "\n" not in said and len(said) < 1000, said
        return None


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to everything in a tree of JSON."""
    keys: Any = value if isinstance(value, dict) else ()
    if isinstance(value, list):
        keys = range(len(value))
    return [path, *(place for key in keys for place in places(value[key], (*path, key)))]


@st.composite
def changed_models(draw: st.DrawFn) -> str:
    """A model with one or two of its values replaced, left out or added to."""
    content: Any = copy.deepcopy(MODEL)
    for _ in range(draw(st.integers(1, 2))):
        *path, last = draw(st.sampled_from(places(content)[1:]))
        owner = content
        for key in path:
            owner = owner[key]
        if draw(st.booleans()):
            owner[last] = draw(VALUES)
        else:
            del owner[last]
    return json.dumps(content)


def use(text: str) -> None:
    """Read a model and, where it is one, all that leaves for a device."""
    model = one_sentence(lambda: Model.from_json(text))
    if model is not None:
        one_sentence(lambda: header_text(model, "joint"))
        for scalar in ("float", "double"):
            one_sentence(lambda scalar=scalar: block_bytes(model, scalar))
        again = one_sentence(lambda: Model.from_json(model.to_json()))
        assert again is not None


@settings(max_examples=120, deadline=None, derandomize=True)
@given(text=changed_models())
def test_a_model_with_other_values_is_used_or_refused_in_one_sentence(text: str) -> None:
    use(text)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(data=st.data())
def test_a_model_of_damaged_bytes_is_refused_in_one_sentence(data: st.DataObject) -> None:
    content = bytearray(json.dumps(MODEL).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        first = data.draw(st.integers(0, len(content) - 1))
        last = data.draw(st.integers(first, min(first + 8, len(content))))
        content[first:last] = data.draw(st.binary(max_size=8))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.json"
        path.write_bytes(content)
        one_sentence(lambda: Model.load(path))


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda text: text.replace("0.003", "9" * 400, 1), "beyond the range of a double"),
        (lambda text: text.replace("0.003", "9" * 5000, 1), "beyond the range of a double"),
        (lambda text: text.replace("0.003", "1e999", 1), "beyond the range of a double"),
        (lambda text: "[" * 200_000, "nested too deep"),
        (lambda text: text.replace('"offset"', '"' + "o" * 9000 + '"', 1), "there is no effect"),
    ],
)
def test_what_would_have_been_a_traceback_is_a_sentence(
    damage: Callable[[str], str], said: str
) -> None:
    with pytest.raises(InputError, match=said) as caught:
        Model.from_json(damage(json.dumps(MODEL)))
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 1000


LOG = chain_rig.raw_log(120)
CHANNELS = ("time", "output_position", "motor_position", "output_velocity", "sensor_voltage")
HEAD = ",".join(CHANNELS)
ROWS = [
    ",".join(f"{value:.6g}" for value in row)
    for row in np.column_stack([LOG[name] for name in CHANNELS])
]
CELLS = st.one_of(
    st.floats().map(repr),
    st.sampled_from(["", "nan", "inf", "-1e400", "1,5", '"', "#", ";", "\t", "\x00", "é", "0x1p3"]),
    st.text(max_size=3),
)


@st.composite
def changed_tables(draw: st.DrawFn) -> bytes:
    """A log as CSV, cells of which are replaced, lines doubled, left out or cut, then bytes."""
    rows = [HEAD, *ROWS]
    for _ in range(draw(st.integers(0, 5))):
        k = draw(st.integers(0, len(rows) - 1))
        cells = rows[k].split(",")
        cells[draw(st.integers(0, len(cells) - 1))] = draw(CELLS)
        rows[k] = draw(st.sampled_from([",".join(cells), rows[k - 1], "", rows[k][:-3]]))
    content = bytearray("\n".join(rows).encode("utf-8", "surrogatepass"))
    for _ in range(draw(st.integers(0, 2))):
        first = draw(st.integers(0, len(content)))
        content[first : first + draw(st.integers(0, 40))] = draw(st.binary(max_size=6))
    return bytes(content)


@settings(max_examples=120, deadline=None, derandomize=True)
@given(content=changed_tables())
def test_a_damaged_csv_is_read_and_used_or_refused_in_one_sentence(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        path.write_bytes(content)
        log = one_sentence(lambda: flexspline.read_log(path))
    if log is not None:
        one_sentence(lambda: flexspline.estimate(chain_rig.joint(chain_rig.CALIBRATION), log))


@pytest.mark.parametrize("content", ["[" * 200_000, '{"time": [0, ' + "9" * 5000 + "]}"])
def test_a_log_in_json_without_end_is_refused_in_one_sentence(tmp_path: Path, content: str) -> None:
    (tmp_path / "run.json").write_text(content)
    with pytest.raises(InputError, match="not JSON"):
        flexspline.read_log(tmp_path / "run.json")
