"""What `print(fit)` says, word for word, and numbers within a tolerance."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import report_fits
from golden_texts import NUMBER, is_as_kept

from flexspline import fit
from flexspline.comparison.covariates import labels_of
from flexspline.formatting import percent, plus_minus, short_names, span, told_apart, truncated
from flexspline.least_squares.result import Fit, contributions, shares
from flexspline.least_squares.ripple import ripple_orders
from flexspline.least_squares.validation import bands
from flexspline.logs import Log
from flexspline.report.text import _grade as grade
from flexspline.report.text import _interval as interval
from flexspline.report.text import fit_text

FITS: dict[str, Callable[[], Fit]] = {
    "plain": report_fits.plain_fit,
    "confounded": report_fits.confounded_fit,
    "constrained": report_fits.constrained_fit,
    "useless": report_fits.useless_fit,
}


@pytest.mark.parametrize("name", FITS)
def test_the_words_are_those_of_the_golden_file(name: str) -> None:
    is_as_kept(fit_text(FITS[name]()) + "\n", f"fit_{name}.txt")


@pytest.mark.parametrize("name", FITS)
def test_a_line_is_no_longer_than_the_screen(name: str) -> None:
    lines = fit_text(FITS[name]()).splitlines()
    assert max(map(len, lines)) <= 120


def test_a_confounded_coefficient_never_shows_a_number() -> None:
    fit = report_fits.confounded_fit()
    hidden = [p for p in fit.parameters if not p.determined and p.kind == "coefficient"]
    assert len(hidden) == 3
    for page in (str(fit), fit._repr_html_()):
        for parameter in hidden:
            (line,) = (
                re.sub("<[^>]*>", " ", row)
                for row in page.splitlines()
                if re.match(rf"(<tr><td>)?{re.escape(short_names(parameter.name))}( {{2}}|<)", row)
            )
            assert "not determined alone" in line
            assert not NUMBER.findall(line)
            for digits in (2, 3, 4):
                assert f"{parameter.value:.{digits}f} ±" not in page.replace("−", "-")


def test_a_value_whose_error_is_not_known_stands_without_one() -> None:
    fit = report_fits.plain_fit()
    one = replace(
        next(p for p in fit.parameters if p.kind == "coefficient"), interval=(np.nan, np.nan)
    )
    assert not one.significant
    assert np.isnan([one.stderr, *one.ci()]).all()
    parameters = tuple(one if p.name == one.name else p for p in fit.parameters)
    loose = replace(fit, parameters=parameters)
    (line,) = (row for row in str(loose).splitlines() if row.startswith(short_names(one.name)))
    assert line.endswith("error not known")
    assert "±" not in line
    assert short_names(one.name) not in str(loose).split("\n\n")[0]
    assert loose.to_frame()["standard_error"].isna().to_numpy().tolist() == [
        p.name == one.name for p in parameters
    ]


def test_the_combinations_of_a_confounded_group_are_known_with_their_error() -> None:
    text = str(report_fits.confounded_fit())
    assert "known: coulomb_friction_per_direction.positive + offset = " in text
    assert "known: coulomb_friction_per_direction.negative + offset = " in text


def test_what_no_run_excites_is_not_said_to_be_known_beside_another() -> None:
    """At rest nothing is known of friction: it is no sum with another parameter either."""
    rng = np.random.default_rng(4)
    still = Log.from_arrays(
        time=np.arange(2_000) / 200.0,
        output_position=np.zeros(2_000),
        output_velocity=np.zeros(2_000),
        motor_current=0.02 + 0.01 * rng.standard_normal(2_000),
    )
    text = " ".join(str(fit(["offset", "viscous_friction"], still, "motor_current")).split())
    assert "not excited by these runs: viscous_friction" in text
    assert "not determined alone" not in text


def test_an_order_has_the_amplitude_and_phase_that_were_put_in() -> None:
    orders = {(o.effect, o.order): o for o in ripple_orders(report_fits.plain_fit())}
    found = orders["output_ripple", 2]
    assert abs(found.amplitude - 0.1) < 4 * found.amplitude_error
    assert abs(found.phase - 28.65) < 4 * found.phase_error
    found = orders["wave_generator_ripple", 2]
    assert found.per_output_turn == 202
    assert abs(found.amplitude - 0.08) < 4 * found.amplitude_error
    assert abs(found.phase + 57.30) < 4 * found.phase_error
    assert not orders["output_ripple", 5].significant


def test_a_useless_fit_is_called_useless() -> None:
    first = str(report_fits.useless_fit()).splitlines()[0]
    assert first.startswith("Explains nothing of the sensor torque on held-out rows: 2.57 Nm RMSE")


def test_states_are_said_in_words() -> None:
    text = str(report_fits.constrained_fit())
    assert re.search(r"temperature_drift.quadratic +0 +Nm/K² +fixed", text)
    assert re.search(r"viscous_friction.viscosity +0.02 +Nm·s/rad +ended at its lower bound", text)
    assert re.search(r"coulomb_friction.level .*prior 0.30 ± 0.05", text)


def test_what_is_explained_a_little_is_not_called_nothing() -> None:
    assert grade(0.027) == "Explains next to nothing of"
    assert grade(0.0) == grade(-0.3) == grade(float("nan")) == "Explains nothing of"


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.30246, 0.0022, "0.3025 ± 0.0022"),
        (-0.008, 0.0134, "-0.008 ± 0.013"),
        (12345.6, 230.0, "(1.235 ± 0.023)·10⁴"),
        (1.23e-7, 4e-9, "(1.23 ± 0.04)·10⁻⁷"),
        (-0.3, 40.0, "0 ± 40"),
        (-30.0, 190.0, "(-0.3 ± 1.9)·10²"),
        (-2e-6, 4e-5, "(0 ± 4)·10⁻⁵"),
        (0.5, float("nan"), "0.5"),
        (1.0, 0.0, "1 ± 0"),
        (float("nan"), 0.1, "–"),
    ],
)
def test_value_and_error_are_rounded_together(value: float, error: float, text: str) -> None:
    assert plus_minus(value, error) == text


@pytest.mark.parametrize("power", range(-30, 31))
def test_an_interval_is_rounded_as_the_value_beside_it_whatever_its_size(power: int) -> None:
    some = report_fits.plain_fit().parameters[0]
    rng = np.random.default_rng(power + 30)
    for _ in range(50):
        value = float(rng.uniform(-10.0, 10.0) * 10.0**power)
        error = float(abs(value) * 10.0 ** rng.uniform(-5.0, 2.0))
        low, high = value - 2.0 * error, value + 2.0 * error
        made = replace(some, value=value, standard_error=error, interval=(low, high))
        text = interval(made)
        assert len(text) <= 40
        ends = [number_in(end) for end in text.split(" to ")]
        # half a unit of the last digit, which the errors' two digits 10 to 35 or one digit tell
        assert ends == pytest.approx([low, high], rel=1e-12, abs=0.15 * error)
        assert ends[0] < ends[1]


def number_in(text: str) -> float:
    """The number that "1.23·10⁻⁵" is."""
    mantissa, _, power = text.partition("·10")
    digits = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
    return float(f"{mantissa}e{power.translate(digits) or 0}")


@pytest.mark.parametrize(
    ("ends", "error", "text"),
    [
        ((0.2981, 0.3069), 0.0022, "0.2981 to 0.3069"),
        ((8e-13, 1.6e-12), 2e-13, "0.80·10⁻¹² to 1.60·10⁻¹²"),
        ((-2e-5, 1e-7), 1e-5, "-2.0·10⁻⁵ to 0.0·10⁻⁵"),
        ((-0.0001, 0.1), 0.05, "0.00 to 0.10"),
        ((0.5, 0.5), 0.0, "0.5 to 0.5"),
        ((1.0, 1.0 + 1e-9), 3e-10, "1 to 1.000000001"),
        ((0.2, 3.9e154), 3.0, "0.2 to 3.9e+154"),
    ],
)
def test_both_ends_have_one_power_of_ten(
    ends: tuple[float, float], error: float, text: str
) -> None:
    assert span(*ends, error) == text


def test_a_share_is_never_rounded_up_to_all() -> None:
    assert truncated(0.99996) == "0.999"


def _words(text: str) -> list[str]:
    return NUMBER.sub("#", text).split()


def test_the_share_of_an_effect_is_the_rms_of_what_it_gives_over_all_runs() -> None:
    fit = report_fits.plain_fit()
    given = [contributions(fit, one) for one in fit.runs]
    for name, size in shares(fit).items():
        values = np.concatenate(
            [g[name][one.counts] for g, one in zip(given, fit.runs, strict=True)]
        )
        assert size == pytest.approx(float(np.sqrt(np.nanmean(values**2))), rel=1e-12)


def test_no_two_edges_of_bands_read_the_same() -> None:
    warm = np.linspace(26.04, 26.12, 600)
    assert [name for _, name, _ in bands("temperature", warm, 3, "°C")] == [
        "26.04 to 26.07 °C", "26.07 to 26.09 °C", "26.09 to 26.12 °C"
    ]  # fmt: skip
    assert labels_of(np.array([-np.inf, 26.06, 26.08, np.inf]), "°C") == (
        "below 26.06 °C", "26.06 to 26.08 °C", "above 26.08 °C"
    )  # fmt: skip
    assert labels_of(np.array([-np.inf, np.inf]), "") == ("all",)
    assert told_apart([0.1, 0.1, np.nan, 1.0]) == ["0.1", "0.1", "–", "1"]


def test_a_name_said_twice_is_said_once_and_a_number_is_no_name() -> None:
    known = "offset.offset + 1.1·inertia.inertia = 12.12 ± 0.22 Nm over 3.3 rad of run1.run1"
    assert short_names(known) == "offset + 1.1·inertia = 12.12 ± 0.22 Nm over 3.3 rad of run1"


@pytest.mark.parametrize(
    ("share", "said"), [(-0.001, "0 %"), (-0.006, "-1 %"), (0.57, "57 %"), (np.nan, "–")]
)
def test_a_share_that_rounds_to_nothing_has_no_sign(share: float, said: str) -> None:
    assert percent(share) == said
