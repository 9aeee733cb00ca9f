"""Sentences print a number with its unit, and a value with as many digits as its error has."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest
from arrows import nodes_of

import flexspline
from flexspline.errors import InputError
from flexspline.logs import Log, check
from flexspline.logs.derive import lowpass_log
from flexspline.logs.repairs import repaired

PACKAGE = Path(flexspline.__file__).parent
ITSELF = ("formatting.py", "reproduce/__init__.py")  # rounds them; prints stated tolerances
TIME = np.arange(2000) * 5e-3


def rounded_apart(code: str) -> list[int]:
    """Lines of strings that round a value and the error beside it by different formats.

    Decimals that are the same for both, as in {value:.2f} ± {error:.2f}, are one format; digits
    that each number counts for itself, as in {value:.3g} ± {error:.1g}, are not.
    """
    found = []
    for node in nodes_of(code):
        parts = node.values if isinstance(node, ast.JoinedStr) else []
        for left, middle, right in zip(parts, parts[1:], parts[2:], strict=False):
            if isinstance(middle, ast.Constant) and middle.value.strip(" °") == "±":
                both = [_format(part) for part in (left, right)]
                if any(both) and (both[0] != both[1] or not both[0].endswith("f")):
                    found.append(node.lineno)
    return found


def _format(part: ast.expr) -> str:
    """The precision of a number in a string, such as "3g", without its width; "" of none."""
    spec = part.format_spec if isinstance(part, ast.FormattedValue) else None
    made = "" if spec is None else ast.unparse(spec)
    return made.strip("'\"").rpartition(".")[2]


def test_no_string_rounds_a_value_and_its_error_apart() -> None:
    files = {file.relative_to(PACKAGE).as_posix(): file for file in PACKAGE.rglob("*.py")}
    faults = [
        f"{name}:{line}"
        for name, file in sorted(files.items())
        for line in rounded_apart(file.read_text(encoding="utf-8"))
        if name not in ITSELF
    ]
    assert faults == []


def test_a_planted_pair_of_formats_is_found() -> None:
    assert rounded_apart('f"{a:.3g} ± {b:.1g} ms"') == [1]
    assert rounded_apart('f"{a:.3f} ± {b:.1f} ms"') == [1]
    assert rounded_apart('f"{a:.{d}f} ± {b:.{d}f} ms"') == rounded_apart('f"{a} ± {b}"') == []
    assert rounded_apart('f"{a:+.2f} ± {b:.2f} rad"') == []


def moving(**columns: np.ndarray) -> Log:
    angle = np.sin(TIME) + 0.3 * np.sin(3.3 * TIME)
    return Log.from_arrays(**{"time": TIME, "output_position": angle, **columns})


def test_a_delay_has_the_digits_of_its_error() -> None:
    late = TIME - 0.062
    noise = 1e-3 * np.random.default_rng(1).normal(size=len(TIME))
    velocity = np.cos(late) + 0.99 * np.cos(3.3 * late) + noise
    (finding,) = check(moving(output_velocity=velocity)).named("velocity_delay")
    value, _, error = finding.sentence.split(" ms ")[0].split(" is ")[1].partition(" ± ")
    assert float(value) == pytest.approx(62.0, abs=0.5) and 0.0 < float(error) < 0.5
    assert len(value.partition(".")[2]) == len(error.partition(".")[2]) > 0


def test_a_number_beyond_any_instrument_has_its_unit() -> None:
    broken = np.where(np.arange(len(TIME)) == 7, 1e300, np.sin(TIME))
    with pytest.raises(InputError, match=r"output_velocity is 1e\+300 rad/s, beyond any"):
        lowpass_log(moving(output_velocity=broken), 5.0, ("output_velocity",))


def test_a_limit_at_which_rows_were_dropped_has_its_unit() -> None:
    made = repaired(moving(sensor_torque=np.minimum(TIME, 1.5)), "drop_clipped=sensor_torque:1.5")
    assert "rows in which sensor_torque is 1.5 Nm, dropped: 1700" in made.history[-1]


def test_a_torque_constant_that_no_joint_has_has_its_unit() -> None:
    with pytest.raises(InputError, match=r"torque_constant is 1e\+12 Nm/A, .* to 1e\+09 Nm/A"):
        moving().with_facts({"torque_constant": 1e12})


def test_the_noise_of_an_acceleration_has_its_unit() -> None:
    angle = 1e-5 * np.round((0.4937 * TIME + 1e-3 * np.sin(3.0 * TIME)) / 1e-5)
    run = Log.from_arrays(time=TIME, output_position=angle)
    (finding,) = check(run, effects=["inertia"]).named("no_excitation")
    assert re.search(r"of which noise makes [\d.e-]+ rad/s²\.", finding.sentence)
