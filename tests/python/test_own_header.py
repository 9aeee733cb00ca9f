"""The C++ header of an own effect: it makes the rows, agrees with the function, and leaves."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hidden_logs import BASE, LOAD
from numpy.typing import NDArray
from test_own_effect import HEIGHT, NM, WIDTHS, fitted, runs

import flexspline
from flexspline import InputError, OwnEffect, own_effect

if shutil.which("c++") is None:
    pytest.skip("c++ is missing; install Debian's g++", allow_module_level=True)

Array = NDArray[np.float64]

HEADER = """#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Friction that is largest at one speed: x exp(-x^2), x = v / width.
template <typename S>
struct Hump {
  static constexpr std::string_view name = "hump";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature = "friction is largest at one speed";
  static constexpr std::string_view source = "this test";
  static constexpr std::array<Term, 1> terms{{{"height", "Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_velocity};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 0> demands{};

  S width = S(0.2);

  static constexpr auto shapes() noexcept {
    return std::array{Shape<Hump, S>{"width", "rad/s", &Hump::width, S(0.02), S(3), true}};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    const S x = at.output_velocity / width;
    return {x * math::exp(math::clamp(-x * x, S(-50), S(0)))};
  }
};

}  // namespace flexspline
"""


def curve(output_velocity: Array, width: float = 0.2) -> Array:
    x = output_velocity / width
    return np.asarray(x * np.exp(-(x**2)))


def made(folder: Path, text: str = HEADER, function: Callable[..., Any] = curve) -> OwnEffect:
    folder.mkdir(exist_ok=True)
    (folder / "hump.hpp").write_text(text)
    return own_effect(name="hump", terms=NM, shapes=WIDTHS, header=folder / "hump.hpp")(function)


@cache
def compiled(folder: Path) -> Any:
    """A fit with a compiled effect; its header is gone before anything is exported."""
    hump = made(folder)
    found = flexspline.fit([*BASE, hump], runs(HEIGHT), "sensor_torque", known_load=LOAD)
    (folder / "hump.hpp").unlink()
    return found


@pytest.fixture(scope="module")
def with_header(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return compiled(tmp_path_factory.mktemp("header"))


def test_a_fit_with_the_header_is_that_of_the_function(with_header: Any) -> None:
    for here, there in zip(with_header.parameters, fitted().parameters, strict=True):
        assert here.name == there.name
        assert abs(here.value - there.value) < 1e-6 * there.standard_error


def test_a_model_is_certified_with_the_header_beside_it(with_header: Any) -> None:
    log = runs(HEIGHT)[0].rows(slice(0, 400))
    certificate = flexspline.certify(with_header.model, log)
    assert certificate.bit_identical
    (output,) = certificate.outputs
    assert output.largest < 1e-5  # float beside double, of a torque of some tenths of Nm


def test_an_export_puts_the_header_beside_it_and_over_no_other_file(
    with_header: Any, tmp_path: Path
) -> None:
    model = with_header.model
    flexspline.export(model, tmp_path / "joint.hpp")
    assert (tmp_path / "hump.hpp").read_text() == HEADER
    assert '#include "hump.hpp"' in (tmp_path / "joint.hpp").read_text()
    (tmp_path / "hump.hpp").write_text("mine")
    (tmp_path / "joint.hpp").unlink()
    with pytest.raises(InputError, match=r"hump\.hpp: is not what .* was when it was compiled"):
        flexspline.export(model, tmp_path / "joint.hpp")
    with pytest.raises(InputError, match="is the name of the header of one of the model's own"):
        flexspline.export(model, tmp_path / "hump.hpp")
    assert [f.name for f in tmp_path.iterdir()] == ["hump.hpp"]
    assert (tmp_path / "hump.hpp").read_text() == "mine"


@pytest.mark.parametrize("format", ["header", "binary"])
def test_without_a_header_nothing_leaves_for_a_device(format: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"write hump\.hpp, and give it with header or"):
        flexspline.export(fitted().model, tmp_path / "joint", format)
    with pytest.raises(InputError, match=r"write hump\.hpp, and give it with header or"):
        flexspline.certify(fitted().model, runs(HEIGHT)[0])
    assert not list(tmp_path.iterdir())


def test_a_function_that_differs_from_its_header_is_refused(tmp_path: Path) -> None:
    own = made(tmp_path, function=lambda output_velocity, width: curve(output_velocity, 2 * width))
    with pytest.raises(InputError, match=r"in row \d+ of log 'run 1' height of the Pyth"):
        flexspline.fit([*BASE, own], runs(HEIGHT, 600), "sensor_torque", known_load=LOAD)


WRONG = {
    "another struct": (("struct Hump", "struct Hunp"), "struct flexspline::Hump: .* error: "),
    "no source": (('"this test"', '""'), "it does not keep the contract of flexspline/effects"),
    "another unit": (('"Nm"', '"1"'), r"has the terms height \[1\], and the Python function"),
    "another channel": (("{Channel::output_velocity}", "{Channel::temperature}"), "channels temp"),
    "memory": (("S width =", "struct State {};\n  S width ="), "error: "),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_header_that_is_another_effect_is_refused_at_once(what: str, tmp_path: Path) -> None:
    (old, new), said = WRONG[what]
    assert HEADER.count(old) >= 1
    with pytest.raises(InputError, match=said) as caught:
        made(tmp_path, HEADER.replace(old, new))
    assert "\n" not in str(caught.value) and str(caught.value).startswith("effect 'hump': ")


def test_a_header_is_a_file_of_the_effects_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"hump\.hpp cannot be read \(No such file"):
        own_effect(name="hump", terms=NM, shapes=WIDTHS, header=tmp_path / "hump.hpp")(curve)
    with pytest.raises(InputError, match=r"its header is called Hump\.h; call it hump\.hpp"):
        own_effect(name="hump", terms=NM, shapes=WIDTHS, header=tmp_path / "Hump.h")(curve)
