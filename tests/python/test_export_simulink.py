"""A model as an S-function's source: compiled with a stub of Simulink's header, the core's numbers.

No Simulink is there, so nothing here says that one would run it; the file says so itself.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import call
from fmu_runs import LOAD, every_effect, model_of, run_of
from numpy.typing import NDArray
from test_own_effect import NM, WIDTHS
from test_own_header import HEADER, curve

from flexspline import InputError, own_effect
from flexspline.effects import effect
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.programs import include_folder

if shutil.which("c++") is None:
    pytest.skip("c++ is missing; install Debian's g++", allow_module_level=True)

STUB = Path(__file__).parent / "simulink_stub"
OPTIONS = (
    "-std=c++20",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Werror",
    "-Wshadow",
)
MEMORY = ("presliding_friction", "sensor_lag", "viscous_friction", "temperature_dependent_friction")
DOUBLES = ctypes.POINTER(ctypes.c_double)


def compiled(source: Path) -> Any:
    """The S-function as a library, built as its build line says, with the stub in mex's place."""
    library = source.with_suffix(".so")
    said = source.read_text()
    assert f'mex -IINCLUDE CXXFLAGS="$CXXFLAGS -std=c++20 -ffp-contract=off" {source.name}' in said
    given = ["-DMATLAB_MEX_FILE", "-O1", "-fPIC", "-shared", "-fvisibility=hidden"]
    given += [f"-I{STUB}", f"-I{include_folder()}"]
    subprocess.run(["c++", *OPTIONS, *given, source, "-o", library], check=True)
    made = ctypes.CDLL(str(library))
    made.block_new.restype = ctypes.c_void_p
    made.block_new.argtypes = [ctypes.c_double]
    made.block_restart.argtypes = [ctypes.c_void_p, ctypes.c_double]
    made.block_inputs.argtypes = made.block_free.argtypes = [ctypes.c_void_p]
    made.block_step.argtypes = [ctypes.c_void_p, ctypes.c_double, DOUBLES, DOUBLES, ctypes.c_int]
    return made


@contextmanager
def block(library: Any, at: float) -> Iterator[Any]:
    made = library.block_new(at)
    yield made
    library.block_free(made)


def names_of(source: Path, title: str) -> list[str]:
    """What the comment at the top says of the ports: Inputs or Outputs."""
    table = source.read_text().partition(f"// {title}")[2]
    return re.findall(r"^//   \d (\w+) ?[\[:]", table.partition("\n\n")[0], re.M)


def inputs_of(source: Path) -> list[str]:
    return names_of(source, "Inputs, a port each:")[: -len(names_of(source, "Outputs:")) or None]


def stepped(
    library: Any, one: Any, time: float, values: NDArray[np.float64], major: bool = True
) -> NDArray[np.float64]:
    made = np.empty(64)
    given = np.ascontiguousarray(values)
    pointers = (data.ctypes.data_as(DOUBLES) for data in (given, made))
    count = library.block_step(one, time, *pointers, int(major))
    assert count >= 2
    return made[:count]


def columns_of(source: Path, log: Log) -> NDArray[np.float64]:
    return np.array([log[LOAD if n == "known_load" else n] for n in inputs_of(source)]).T


def driven(source: Path, library: Any, log: Log) -> NDArray[np.float64]:
    """Outputs row by row: the whole, the status, each effect."""
    columns, made = columns_of(source, log), []
    with block(library, log["time"][0]) as one:
        assert library.block_inputs(one) == columns.shape[1]
        for time, values in zip(log["time"], columns, strict=True):
            stepped(library, one, time, np.zeros_like(values), major=False)  # a minor step
            made.append(stepped(library, one, time, values))
    return np.array(made)


@pytest.mark.parametrize(
    ("target", "encoder"), [("sensor_torque", True), ("motor_torque", False), ("torsion", True)]
)
def test_an_s_function_of_every_effect_has_the_numbers_of_the_core(
    target: str, encoder: bool, tmp_path: Path
) -> None:
    model, log = model_of(target, every_effect(target), encoder=encoder), run_of()
    source = export(model, tmp_path / "joint.cpp", format="simulink")
    assert ("motor_position" in inputs_of(source)) == encoder
    made, said = driven(source, compiled(source), log), model.predict(log).predicted
    scale = np.abs(said).max()
    np.testing.assert_allclose(made[:, 0], said, rtol=0.0, atol=1e-12 * scale)
    assert (made[:, 1] == 0.0).all()
    for name, column in zip(model.components(log), made[:, 2:].T, strict=True):
        expected = model.components(log)[name]
        np.testing.assert_allclose(column, expected, rtol=0.0, atol=1e-12 * scale, err_msg=name)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    model = model_of("motor_torque", [effect(name) for name in MEMORY])
    source = export(model, tmp_path_factory.mktemp("small") / "joint_7.cpp", format="simulink")
    return source, compiled(source)


def test_blocks_know_nothing_of_each_other_and_start_anew(small: tuple[Path, Any]) -> None:
    source, library = small
    logs = run_of(1, 300), run_of(2, 300)
    alone = [driven(source, library, log) for log in logs]
    columns = [columns_of(source, log) for log in logs]
    with block(library, logs[0]["time"][0]) as one, block(library, logs[1]["time"][0]) as two:
        for round_ in range(2):
            if round_:
                for each, log in zip((one, two), logs, strict=True):
                    library.block_restart(each, log["time"][0])
            for row in range(300):
                for k, each in enumerate((one, two)):
                    made = stepped(library, each, logs[k]["time"][row], columns[k][row])
                    assert made.tobytes() == alone[k][row].tobytes()


def test_a_bad_input_shows_in_the_status_and_keeps_the_last_values(small: tuple[Path, Any]) -> None:
    source, library = small
    log = run_of(1, 20)
    columns = columns_of(source, log)
    with block(library, log["time"][0]) as one:
        for row in range(20):
            good = stepped(library, one, log["time"][row], columns[row])
        for value, status in ((np.nan, 1.0), (1e30, 3.0)):
            wrong = columns[-1].copy()
            wrong[0] = value
            made = stepped(library, one, log["time"][-1] + 0.01, wrong)
            assert made[1] == status
            np.testing.assert_array_equal(np.delete(made, 1), np.delete(good, 1))
        assert stepped(library, one, log["time"][-1], columns[-1])[1] == 2.0  # time stands still


def test_the_source_says_what_it_is_in_ascii(small: tuple[Path, Any]) -> None:
    source, _ = small
    text = source.read_bytes()
    assert text.isascii() and not re.search(rb"[^\n -~]", text)
    assert b"NOT RUN IN SIMULINK" in text and b"#define S_FUNCTION_NAME joint_7\n" in text
    assert text.count(b"#pragma once") == 0 and text.count(b'#include "simstruc.h"') == 1
    assert names_of(source, "Outputs:") == ["motor_torque", "status"]
    assert inputs_of(source) == ["output_position", "output_velocity", "temperature", "known_load"]


@pytest.mark.parametrize("name", ['*/ int x; //"', "\\\nint x;", "tab\t\x00\x1b[2J", "關節 ??/\n"])
def test_no_name_reaches_out_of_its_comment(name: str, tmp_path: Path) -> None:
    log = {"name": name, "rows": 9, "sha256": None, "history": [f"{name} zero phase {name}"]}
    made = model_of("motor_torque", [effect("viscous_friction")], logs=[log])
    model = Model(made.parts, {**made.facts, "joint": name})
    source = export(model, tmp_path / "joint.cpp", format="simulink")
    text = source.read_bytes()
    assert text.isascii() and not re.search(rb"[^\n -~]", text)
    compiled(source)


def test_an_own_effect_goes_beside_it(tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "hump.hpp").write_text(HEADER)
    how: dict[str, Any] = {"name": "hump", "terms": NM, "shapes": WIDTHS}
    own = own_effect(**how, header=tmp_path / "own" / "hump.hpp")(curve)
    model, log = model_of("motor_torque", [effect("offset"), own]), run_of(1, 100)
    source = export(model, tmp_path / "joint.cpp", format="simulink")
    assert (tmp_path / "hump.hpp").read_text() == HEADER
    made = driven(source, compiled(source), log)
    np.testing.assert_allclose(made[:, 0], model.predict(log).predicted, rtol=1e-6, atol=1e-9)
    (tmp_path / "new" / "folder.cpp").mkdir(parents=True)
    with pytest.raises(InputError, match="is a folder; give the name of a file"):
        export(model, tmp_path / "new" / "folder.cpp", format="simulink")
    assert [each.name for each in (tmp_path / "new").iterdir()] == ["folder.cpp"]
    (tmp_path / "hump.hpp").write_text("mine")
    source.unlink()
    with pytest.raises(InputError, match=r"is not what .* was when it was compiled"):
        export(model, source, format="simulink")
    with pytest.raises(InputError, match=r"hump\.hpp, and give it with header or with_header"):
        bare = own_effect(**how)(curve)
        export(model_of("motor_torque", [bare]), source, format="simulink")
    assert not source.exists() and (tmp_path / "hump.hpp").read_text() == "mine"


def test_a_model_without_effects_is_a_block_that_says_zero(tmp_path: Path) -> None:
    source = export(model_of("motor_torque", []), tmp_path / "nothing.cpp", format="simulink")
    library = compiled(source)
    with block(library, 0.0) as one:
        assert stepped(library, one, 0.0, np.zeros(1)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("out", "sentence"),
    [
        ("joint.c", "mex tells C++ by the name of the file"),
        ("joint", "mex tells C++ by the name of the file"),
        ("joint 7.cpp", "an S-function is called as its file, and 'joint 7' is no name"),
        ("7.cpp", "and '7' is no name"),
        ("struct.cpp", "and 'struct' is no name"),
        ("flexspline.cpp", "and 'flexspline' is no name"),
        ("exported.cpp", "and 'exported' is no name"),
        ("sin.cpp", "and 'sin' is no name"),
        ("end.cpp", "and 'end' is no name"),  # a word of MATLAB
        ("gelenk_é.cpp", "is no name that it can have"),
        ("a\nb.cpp", "is no name that it can have"),
        (f"{'a' * 70}.cpp", "is no name that it can have"),
        ("folder.cpp", "give the name of a file"),
        ("model.json/joint.cpp", "cannot be written"),
    ],
)
def test_files_that_no_s_function_can_be_get_one_sentence(
    out: str, sentence: str, tmp_path: Path
) -> None:
    model_of("motor_torque", [effect("viscous_friction")]).save(tmp_path / "model.json")
    (tmp_path / "folder.cpp").mkdir()
    given = ("--model", tmp_path / "model.json", "--format", "simulink", "--out", tmp_path / out)
    done = call("export", *given)
    assert done.exit_code == 2 and sentence in done.stderr, done.stderr
    assert done.stderr.count("\n") == 1
    assert sorted(each.name for each in tmp_path.rglob("*")) == ["folder.cpp", "model.json"]
