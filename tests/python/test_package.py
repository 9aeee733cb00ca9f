"""What the wheel brings: headers, a CMake package, stub, schema, templates, licence."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

import pytest

import flexspline

CONSUMER = """
cmake_minimum_required(VERSION 3.20)
project(consumer LANGUAGES CXX)
find_package(flexspline {version} CONFIG REQUIRED)
add_executable(consumer main.cpp)
target_link_libraries(consumer PRIVATE flexspline::core)
"""
PROGRAM = """
#include <cstdio>
#include <flexspline/effects/viscous_friction.hpp>
#include <flexspline/model.hpp>

int main() {
  using namespace flexspline;
  Model<float, ViscousFriction<float>> model;
  std::get<0>(model.parts).coefficients = {2.0f};
  Sample<float> at;
  at.output_velocity = 1.5f;
  float torque = 0;
  const Status status = model.predict(at, torque);
  std::printf("%d %g", status == Status::ok, static_cast<double>(torque));
}
"""


@pytest.fixture(scope="module")
def wheel() -> Distribution:
    """The installed wheel that `flexspline` is imported from; CI must have one."""
    package = Path(flexspline.__file__).resolve()
    try:
        installed = distribution("flexspline")
        if package in {Path(str(file.locate())).resolve() for file in installed.files or ()}:
            return installed
    except PackageNotFoundError:
        pass
    sentence = f"flexspline is imported from {package}, not from a wheel; run pip install ."
    if os.environ.get("CI") == "true":
        pytest.fail(sentence)
    pytest.skip(sentence)


def content(wheel: Distribution) -> set[str]:
    return {file.as_posix() for file in wheel.files or ()}


@pytest.mark.parametrize(
    "path",
    [
        "flexspline/py.typed",
        "flexspline/_core.pyi",
        "flexspline/schemas/model.schema.json",
        "flexspline/schemas/certificate.schema.json",
        "flexspline/firmware/README.md",
        "flexspline/firmware/example.cpp",
        "flexspline/firmware/mujoco/mujoco-joint.hpp",
        "flexspline/firmware/own/rows.cpp",
        "flexspline/firmware/simulators/fmu.cpp",
        "flexspline/firmware/simulators/sfunction.cpp",
        "flexspline/firmware/certify/joint_unit.cpp",
        "flexspline/firmware/cortex_m/mps2.ld",
        "flexspline/report/templates/report.html",
        "flexspline/cmake/flexspline-config.cmake",
        "flexspline/cmake/flexspline-config-version.cmake",
        "flexspline/cmake/flexspline-targets.cmake",
    ],
)
def test_the_wheel_brings(wheel: Distribution, path: str) -> None:
    assert path in content(wheel)


def test_the_wheel_brings_the_headers_of_the_core_and_no_others(wheel: Distribution) -> None:
    headers = Path(__file__).parents[2] / "cpp" / "include"
    expected = {
        f"flexspline/include/{h.relative_to(headers).as_posix()}" for h in headers.rglob("*.hpp")
    }
    assert expected
    assert {path for path in content(wheel) if path.startswith("flexspline/include/")} == expected


def test_the_wheel_brings_its_licence(wheel: Distribution) -> None:
    assert wheel.metadata["License-Expression"] == "BSD-3-Clause"
    assert any(path.endswith("dist-info/licenses/LICENSE") for path in content(wheel))


def test_the_wheel_brings_nothing_from_beside_the_package(wheel: Distribution) -> None:
    tops = {path.split("/")[0] for path in content(wheel)}
    assert {top for top in tops if top != ".." and not top.endswith(".dist-info")} == {"flexspline"}


def test_metadata_and_package_state_the_same_version(wheel: Distribution) -> None:
    assert wheel.version == flexspline.__version__


def test_the_include_folder_holds_the_core(wheel: Distribution) -> None:
    assert (Path(flexspline.get_include()) / "flexspline" / "model.hpp").is_file()


def test_a_program_builds_against_the_cmake_package(wheel: Distribution, tmp_path: Path) -> None:
    if shutil.which("c++") is None and os.environ.get("CI") != "true":
        pytest.skip("there is no C++ compiler to build a program with")
    (tmp_path / "CMakeLists.txt").write_text(CONSUMER.format(version=flexspline.__version__))
    (tmp_path / "main.cpp").write_text(PROGRAM)
    package = Path(flexspline.get_include()).with_name("cmake")
    build = tmp_path / "build"
    tools = Path(sys.executable).parent
    env = {**os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}"}
    configure = [
        "cmake",
        "-G",
        "Ninja",
        "-S",
        str(tmp_path),
        "-B",
        str(build),
        f"-Dflexspline_DIR={package}",
    ]
    subprocess.run(configure, check=True, env=env)
    subprocess.run(["cmake", "--build", build], check=True, env=env)
    said = subprocess.run([build / "consumer"], check=True, capture_output=True, text=True)
    assert said.stdout == "1 3"


def test_importing_the_package_leaves_out_what_only_pictures_and_files_need() -> None:
    asked = "import sys, flexspline; print(*{name.split('.')[0] for name in sys.modules})"
    loaded = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"matplotlib", "pandas", "h5py", "jinja2", "pint"} & set(loaded)
