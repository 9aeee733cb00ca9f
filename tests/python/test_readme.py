"""What README.md shows works as it stands, after its first command, which is the demo."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from demo_run import Demo

import flexspline
from flexspline.cli import commands
from flexspline.logs.channels import CHANNELS
from flexspline.logs.formats import FORMATS
from flexspline.logs.packed import PACKED
from flexspline.logs.read import read_log

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"^```python\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
TABLE = re.findall(r"^\| .* \| `(flexspline .*?)`", README, re.MULTILINE)
LINKS = re.findall(r"\]\(([^)#:]+)\)", README)


@pytest.fixture(scope="module")
def after_the_demo(demo: Demo, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty folder after README's first command."""
    folder = tmp_path_factory.mktemp("readme")
    shutil.copytree(demo.out, folder / "flexspline-demo")
    return folder


def run(arguments: list[str]) -> None:
    said = CliRunner().invoke(commands, arguments)
    assert said.exit_code == 0, said.output


@pytest.mark.parametrize("marker", ["ci: demo", "ci: tests"])
def test_the_command_that_ci_runs_is_one_line(marker: str) -> None:
    (lines,) = re.findall(
        rf"^<!-- {marker} -->\n```sh\n(.*?)^```$", README, re.MULTILINE | re.DOTALL
    )
    assert len(lines.splitlines()) == 1


def test_the_commands_of_the_table_run_in_their_order(
    after_the_demo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(after_the_demo)
    assert [command.split()[1] for command in TABLE] == [
        "init",
        "convert",
        "check",
        "orders",
        "fit",
        "predict",
        "calibrate",
        "estimate",
        "compare",
        "discover",
        "export",
        "export",
        "export",
        "export",
        "export",
        "certify",
    ]
    for command in TABLE:
        run(shlex.split(command)[1:])
        assert (after_the_demo / shlex.split(command)[-1]).exists()
    recorded = read_log(after_the_demo / "run.csv")  # by the map that init wrote
    run6 = read_log(after_the_demo / "flexspline-demo" / "run6.csv")
    assert recorded.channels == run6.channels
    for channel in run6.channels:
        assert np.allclose(recorded[channel], run6[channel], atol=1e-4 * np.ptp(run6[channel]))


def test_the_python_example_runs(
    after_the_demo: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(after_the_demo)
    (example,) = PYTHON
    exec(compile(example, "README.md", "exec"), {})
    assert "stribeck_friction" in capsys.readouterr().out
    assert (after_the_demo / "joint.json").is_file()


def test_the_table_of_channels_is_that_of_the_package() -> None:
    table = re.findall(r"^\| `(\w+)` \| (\S+) \| (output|motor|) ?\|", README, re.MULTILINE)
    assert [(name, unit) for name, unit, _ in table] == [
        (name, channel.unit) for name, channel in CHANNELS.items()
    ]
    sides = {name: side for name, _, side in table}
    named = {name: name.split("_")[0] for name in sides if name.startswith(("output", "motor"))}
    assert {name: sides[name] for name in named} == named


def test_the_formats_of_files_are_those_of_the_package() -> None:
    ours = ", ".join(f"{each.name} (`{each.suffixes[0]}`)" for each in FORMATS if not each.extra)
    extras = dict.fromkeys(each.extra for each in FORMATS if each.extra)
    named = [
        (" and ".join(each.name for each in FORMATS if each.extra == extra), extra)
        for extra in extras
    ]
    (first, extra), *others = named
    rest = ", ".join(f"{names} (`{extra}`)" for names, extra in others)
    packed = ", ".join(f"`{suffix}`" for suffix in PACKED)
    said = f"{ours}; with an extra {first} (`pip install '.[{extra}]'`), {rest}; each also packed"
    assert f"{said} ({packed})" in " ".join(README.split())


@pytest.mark.parametrize("link", sorted(set(LINKS)))
def test_a_link_leads_to_a_file(link: str) -> None:
    assert (ROOT / link).is_file()


def test_what_the_text_names_is_there_after_one_import() -> None:
    named = sorted(set(re.findall(r"`flexspline((?:\.\w+)+)", README)))
    assert len(named) > 3
    asked = "import flexspline\n" + "\n".join(f"flexspline{name}" for name in named)
    subprocess.run([sys.executable, "-c", asked], check=True)


def test_completion_offers_public_names_alone() -> None:
    asked = "import flexspline; print(*dir(flexspline))"
    said = subprocess.run([sys.executable, "-c", asked], check=True, capture_output=True, text=True)
    names = said.stdout.split()
    assert {"fit", "fit_motion", "check", "export", "Log", "simulation"} <= set(names)
    assert not {"importlib", "annotations", "TYPE_CHECKING", "Any", "deprecated"} & set(names)


@pytest.mark.parametrize("room", ["baselines", "collision", "full_range", "observer", "plot",
                                  "rigs", "sensor", "simulation", "sklearn"])  # fmt: skip
def test_completion_in_a_room_offers_its_public_names_alone(room: str) -> None:
    module = getattr(flexspline, room)
    assert dir(module) == sorted(module.__all__)
    assert all(getattr(module, name) is not None for name in module.__all__)
