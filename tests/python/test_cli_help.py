"""Help that teaches, versions, and the ways in which a call can end."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from cli_calls import call, write_runs
from click.shell_completion import ShellComplete

import flexspline
from flexspline.cli import commands
from flexspline.effects import CATALOGUE, TARGETS, effect
from flexspline.exporting import EXPORTS, export
from flexspline.logs.formats import FORMATS
from flexspline.logs.repairs import REPAIRS
from flexspline.model import Model
from flexspline.part import Part

SHELL = [sys.executable, "-m", "flexspline"]
SOURCE = {"_FLEXSPLINE_COMPLETE": "zsh_source"}
HEAVY = ("scipy", "pandas", "matplotlib", "pint", "h5py", "jsonschema", "jinja2")


def test_help_of_the_tool_names_the_path_and_every_command() -> None:
    result = call("--help")
    assert result.exit_code == 0
    for word in ("read", "check", "fit", "judge", "export", *commands.commands):
        assert word in result.stdout


@pytest.mark.parametrize("name", list(commands.commands))
def test_help_of_each_command_has_an_example_to_paste(name: str) -> None:
    result = call(name, "--help")
    assert result.exit_code == 0
    assert f"  flexspline {name} " in result.stdout


def test_help_of_fit_lists_all_targets_effects_and_repairs() -> None:
    text = call("fit", "--help").stdout
    for word in (*TARGETS, *CATALOGUE, *REPAIRS):
        assert word in text


@pytest.mark.parametrize("command", ["predict", "convert"])
def test_help_of_what_reads_runs_lists_all_repairs(command: str) -> None:
    text = call(command, "--help").stdout
    for word in REPAIRS:
        assert word in text


@pytest.mark.parametrize("command", ["init", "convert"])
def test_help_lists_every_format_of_files_and_what_installs_it(command: str) -> None:
    text = " ".join(call(command, "--help").stdout.split())
    for form in FORMATS:
        assert f"{form} {form.says}" in text
        assert not form.extra or form.install in text


def test_help_and_docstring_of_export_tell_every_format() -> None:
    text, doc = (" ".join(t.split()) for t in (call("export", "--help").stdout, export.__doc__))
    for name, form in EXPORTS.items():
        assert f" {name} {form.says}" in text
        assert f'- "{name}": {form.says}' in doc


def test_help_of_estimate_tells_of_what_the_sensors_torque_is_compensated() -> None:
    said = " ".join(call("estimate", "--help").output.split())
    assert "compensated for temperature; ripple, friction" in said and "still in it" in said


def test_the_version_is_that_of_the_package() -> None:
    assert call("--version").stdout == f"flexspline {flexspline.__version__}\n"


RUN = "no_run.csv --target sensor_torque --out new"
ASKED = """
import sys
from flexspline.cli import main
sys.argv = ["flexspline", *sys.argv[1:]]
try:
    main()
finally:
    print(*{name.split(".")[0] for name in sys.modules}, file=sys.stderr)
"""


@pytest.mark.parametrize(
    "line",
    [
        "--help",
        "fit --help",
        "discover --help",
        "fit none.csv --target sensor_torque --effects offset --out new",
        "fit none.csv --target sensor_torque --effects ofset --out new",
        "fit none.csv --target torsion --effects inertia --out new",
        f"fit {RUN} --effects viscous_friction --fix viscosty=1",
        f"fit {RUN} --effects viscous_friction --bound stribeck_velocity=0:1",
        f"fit {RUN} --effects stribeck_friction --prior stribeck_velocity=1:1",
        f"fit {RUN} --effects offset --by simulation --prior offset=1:1",
        f"fit {RUN} --effects offset --free-controller torque",
        f"discover {RUN} --effects offset --limit speed=1",
        f"discover {RUN} --effects offset --exclude gravitiy",
        "check none.csv",
        "predict --model none.json run.csv --out new",
        "compare --model none.json run.csv --out new",
        "export --model none.json --format header --out new",
    ],
)
def test_help_and_wrong_calls_are_answered_without_what_is_heavy(line: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", ASKED, *line.split()], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == (0 if "--help" in line else 2)
    assert line != "--help" or "numpy" not in done.stderr.split()
    assert not set(HEAVY) & set(done.stderr.split("\n")[-2].split())
    assert "no_run.csv" not in done.stderr  # what is wrong in the call is said before the run is
    assert list(tmp_path.iterdir()) == []


ONE_BY_ONE = """
import sys
from flexspline.cli import commands
for line in sys.argv[1:]:
    try:
        commands([*line.split(), "-q"])
    except SystemExit as end:
        print(end.code, *sys.modules)
"""
LOADED = {*HEAVY, "scipy.signal"} - {"scipy"}  # whose top pint imports, which is next to nothing
NEEDS = {  # in this order, of one process: what is heavy, once a command has run, and why
    "export --model model.json --format header --out joint.hpp": {"jsonschema"},  # of a model file
    "convert foreign.csv --columns map.toml --out run.csv": set(),
    "predict --model model.json run.csv --out residual.csv": {"scipy.signal"},  # derivatives
    "simulate --model model.json run.csv --out simulated.csv": set(),
    "estimate --model model.json run.csv --out estimated.csv": set(),
    "check run.csv": set(),
    "orders run.csv --target sensor_torque": set(),
    "convert gaps.csv --columns map.toml --out run2.csv": {"pandas"},  # of cells without a number
    "convert foreign.csv --columns feet.toml --out run3.csv": {  # of a unit that is rare
        "pint",
        *({"jinja2"} if find_spec("dask") else ()),  # which pint imports where it is, with this
    },
}


def test_no_command_imports_what_it_does_not_use(tmp_path: Path) -> None:
    """No figure is drawn and no page is made by any of these."""
    time = np.arange(2000) / 200.0
    velocity = np.sin(time)
    columns = np.c_[time, np.degrees(1.0 - np.cos(time)), velocity, 0.1 + 2.0 * velocity]
    head = "t,q,w,s"
    np.savetxt(tmp_path / "foreign.csv", columns, delimiter=",", header=head, comments="")
    (tmp_path / "map.toml").write_text(
        "[columns]\ntime = 't'\noutput_position = {source = 'q', unit = 'deg'}\n"
        "output_velocity = 'w'\nsensor_torque = 's'\n"
    )
    text = (tmp_path / "foreign.csv").read_text().splitlines()
    text[9] = text[9].rpartition(",")[0] + ","
    (tmp_path / "gaps.csv").write_text("\n".join(text))
    (tmp_path / "feet.toml").write_text(
        "[columns]\ntime = 't'\nsensor_torque = {source = 's', unit = 'lbf*ft'}\n"
    )
    part = Part("sensor_torque", (effect("viscous_friction"),), np.array([2.0]))
    Model({"sensor": part}, {}).save(tmp_path / "model.json")
    said = subprocess.run(
        [sys.executable, "-c", ONE_BY_ONE, *NEEDS], capture_output=True, text=True, cwd=tmp_path
    )
    needed: set[str] = set()
    for (line, more), answer in zip(NEEDS.items(), said.stdout.splitlines(), strict=True):
        code, *loaded = answer.split()
        needed |= more
        assert (code, LOADED & set(loaded) - needed) == ("0", set()), (line, said.stderr)


def test_the_module_is_the_command() -> None:
    done = subprocess.run([*SHELL, "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, f"flexspline {flexspline.__version__}\n")


def test_a_reader_that_goes_away_ends_it_quietly(tmp_path: Path) -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    done = subprocess.run([*SHELL, "--help"], stdout=write_end, stderr=subprocess.PIPE, text=True)
    os.close(write_end)
    assert (done.returncode, done.stderr) == (141, "")


def test_a_terminal_without_greek_letters_gets_question_marks(tmp_path: Path) -> None:
    run = write_runs(tmp_path)[0]
    done = subprocess.run(
        [*SHELL, "fit", str(run), "--target", "sensor_torque", "--effects", "offset,inertia",
         "--out", str(tmp_path / "joint")],
        capture_output=True, text=True, env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def test_a_defect_is_one_line_and_the_traceback_is_there_for_the_asking(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(path: object) -> Model:
        raise KeyError("lost")

    monkeypatch.setattr(Model, "load", broken)
    asked = ("predict", "--model", "m.json", "run.csv", "--out", tmp_path / "out.csv")
    result = call(*asked)
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "defect" in result.stderr and "FLEXSPLINE_TRACEBACK" in result.stderr
    monkeypatch.setenv("FLEXSPLINE_TRACEBACK", "1")
    assert "Traceback" in call(*asked).stderr


def test_an_interrupt_while_the_command_is_imported_is_one_line() -> None:
    asked = """
import runpy, sys
class Interrupting:
    def find_spec(self, name, *_):
        if name == "flexspline.cli.fit":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupting())
runpy.run_module("flexspline", run_name="__main__")
"""
    said = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True)
    assert said.returncode == 130
    assert said.stderr == "flexspline: interrupted; nothing was written\n"


def test_the_end_of_memory_is_no_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **options: object) -> Model:
        raise MemoryError

    monkeypatch.setattr(Model, "load", full)
    result = call("export", "--model", "m.json", "--format", "json", "--out", "o.json")
    assert result.exit_code == 2
    assert result.stderr.startswith("flexspline: memory ends") and result.stderr.count("\n") == 1


def test_an_interrupt_is_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **options: object) -> Model:
        raise KeyboardInterrupt

    monkeypatch.setattr(Model, "load", interrupted)
    result = call("predict", "--model", "m.json", "run.csv", "--out", "out.csv")
    assert result.exit_code == 130
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "begun", "offered"),
    [
        ([], "che", ["check"]),
        (["fit", "run.csv", "--effects"], "inertia,stri", ["inertia,stribeck_friction"]),
        (["fit", "run.csv", "--target"], "motor_t", ["motor_torque"]),
        (["check", "run.csv", "--repair"], "unw", ["unwrap"]),
        (["export", "--model", "m.json", "--format"], "hea", ["header"]),
    ],
)
def test_a_shell_completes_commands_effects_targets_and_repairs(
    words: list[str], begun: str, offered: list[str]
) -> None:
    shell = ShellComplete(commands, {}, "flexspline", "_FLEXSPLINE_COMPLETE")
    assert [item.value for item in shell.get_completions(words, begun)] == offered


@pytest.mark.parametrize("words", [["fit"], ["predict", "--model"], ["fit", "a.csv", "--out"]])
def test_a_shell_completes_names_of_files_by_itself(words: list[str]) -> None:
    shell = ShellComplete(commands, {}, "flexspline", "_FLEXSPLINE_COMPLETE")
    assert [item.type for item in shell.get_completions(words, "")] == ["file"]


def test_a_shell_is_given_the_script_that_asks() -> None:
    done = subprocess.run(
        SHELL, capture_output=True, text=True, env={**os.environ, **SOURCE}, check=True
    )
    assert "_flexspline_completion" in done.stdout
