"""What a discovery says of how the gap shrank is arithmetic on residuals that no fit saw."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from figure_layout import page_faults
from hidden_logs import LOAD, friction_of, log_of, noise, rich_run

import flexspline
from flexspline.discovery.analysis import Rival
from flexspline.discovery.assemble import where
from flexspline.discovery.candidates import EXCLUDED
from flexspline.discovery.confirmation import AlsoSeen
from flexspline.discovery.faults import DataFault
from flexspline.discovery.result import (
    BY_FUNCTIONS,
    BY_NAMES,
    LESSER,
    Discovery,
    Motion,
    Unexplained,
)
from flexspline.discovery.slices import HeldRun, frequency_bands, order_bands, slices, telling
from flexspline.experiment.plan import Outlook, plan_sentence
from flexspline.formatting import lowered, percent
from flexspline.least_squares.identifiability import Combination, Confounded
from flexspline.logs.log import Log
from flexspline.plot.comparison import bands_over, plot_comparison
from flexspline.plot.discovery import held_out_run
from flexspline.report.discovery import (
    also_seen_sentences,
    channel_rows,
    discovery_call,
    effect_lines,
    headlines,
    remarks,
    verdict,
    where_sentences,
)

BASE = ["offset", "coulomb_friction", "viscous_friction", "inertia"]
ROWS = 2000


@cache
def found() -> Discovery:
    """Runs that hide a crosstalk of the motor; each has a name of its own."""
    runs = []
    for seed in range(1, 5):
        c = rich_run(seed, ROWS)
        torque = c[LOAD] + friction_of(c) + noise(seed, ROWS) + 0.05 * c["motor_torque"]
        runs.append(log_of(c, sensor_torque=torque).with_facts({"name": f"run {seed}"}))
    return flexspline.discover(BASE, runs, target="sensor_torque", known_load=LOAD)


@pytest.mark.parametrize(
    ("forward", "backward", "said"),
    [(1.0, 0.0, "forward"), (0.0, 1.0, "backward"), (1.0, 1.0, "both directions")],
)
def test_an_effect_is_said_to_act_where_what_it_adds_lies(
    forward: float, backward: float, said: str
) -> None:
    v = np.linspace(-1.0, 1.0, 2001)
    added = np.where(v > 0.0, forward, -backward) * v**8
    run = log_of({"time": np.arange(2001) / 100.0, "output_velocity": v})
    problem = SimpleNamespace(runs=[SimpleNamespace(log=run, channels={})])
    words = where(cast(Any, problem), flexspline.effect("viscous_friction"), [added])
    fast, *ways = words.split(", ")
    assert fast.startswith("above 0.91") and ways == [said]  # of v¹⁷, 0.8 lie above 0.2^(1/17)


def test_rows_of_a_name_fit_into_a_terminal_of_80_columns() -> None:
    made = found()
    long = replace(made.found[0], where=", ".join(["above 0.9 rad/s"] * 9))
    text = str(replace(made, found=(long,)))
    lines = text[text.index("1. ") :].splitlines()
    rows = lines[: next(k for k, line in enumerate(lines) if line.startswith("   On "))]
    assert len(rows) > 2 and max(map(len, rows)) <= 79
    for line in effect_lines(made, long):
        assert line.value in text and line.remark in " ".join(text.split())


def test_text_and_page_tell_the_same_of_a_parameter_and_of_the_floor() -> None:
    (one,) = found().found
    held = replace(found().fit.parameters[0], name=f"{one.effect}.share", determined=False)
    hidden = replace(found(), fit=replace(found().fit, parameters=(held,)))
    for made, told in ((found(), "±"), (hidden, "not determined")):
        (line,) = effect_lines(made, one)
        assert told in line.value and f"{line.value} {line.unit}".rstrip() in str(made)
    assert found().floor.by == BY_NAMES and "at most" in where_sentences(found())[0]


def test_what_is_not_there_is_not_spoken_of() -> None:
    bare = replace(found(), also_seen=(), refused={}, doubted=(), unexplained=None, motion=None,
                   next_experiment=None, not_tried={})  # fmt: skip
    for word in (
        "Also seen",
        "Withdrawn",
        "Rejected",
        "Unexplained",
        "Driven",
        "Next",
        "Not tried",
    ):
        assert not any(said.startswith(word) for said in remarks(bare))
    seen = replace(bare, also_seen=found().found, refused={"gravity": LESSER}, doubted=("a", "b"))
    (also,) = (said for said in remarks(seen) if said.startswith("Also seen"))
    assert "motor_crosstalk" in also
    assert f"Withdrawn: gravity ({LESSER})." in remarks(seen)
    assert any(said.startswith("Rejected: a, b, which are spurious") for said in remarks(seen))


def test_the_text_says_what_is_known_of_coefficients_that_are_not_known_alone() -> None:
    made = found()
    (one,) = made.found
    parameters = tuple(
        replace(p, determined=False) if p.name.startswith(one.effect) else p
        for p in made.fit.parameters
    )
    names = (f"{one.effect}.factor", "offset.offset")
    known = Combination(((names[0], 1.0), (names[1], 0.5)), 0.25, 0.01, "Nm")
    group = Confounded(names, False, 99.0, (known,))
    apart = Confounded(("inertia.inertia", "gravity.sine"), False, 99.0, (known,))
    fit = replace(made.fit, parameters=parameters, confounded=(group, apart))
    text = " ".join(str(replace(made, fit=fit)).split())
    assert f"{one.effect}.factor and offset are indistinguishable" in text
    assert "= 0.250 ± 0.010 Nm" in text and "gravity" not in text


@pytest.mark.usefixtures("undrawn")
def test_what_is_spurious_is_listed_as_tried_and_none_is_said_to_gain_less_than_chance(
    tmp_path: Path,
) -> None:
    made = replace(found(), doubted=("gravity",), refused={"gravity": "does not hold"})
    made.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    tried = page[page.index('id="tried"') :]
    assert "spurious: a flexible basis explains the data better" in tried
    assert "All other effects" not in tried and "this report does not name gain less" in tried


def test_the_call_that_makes_it_again_leaves_out_what_was_left_out() -> None:
    assert "exclude=" not in discovery_call(found())
    left_out = replace(found(), not_tried={"gravity": EXCLUDED, "cogging": "needs pole pairs"})
    assert "    exclude=['gravity'],\n" in discovery_call(left_out)


def test_the_call_that_makes_it_again_has_the_bandwidth_and_the_orders_of_the_base() -> None:
    said = discovery_call(found())
    assert "bandwidth=" not in said and "orders=" not in said
    ripple = flexspline.effect("output_ripple", orders=[1, 3])
    fit = SimpleNamespace(
        lowpass=None,
        bandwidth=12.5,
        parameters=(),
        part=SimpleNamespace(effects=[ripple], simulated=None),
        model=found().model,
    )
    smoothed = replace(found(), base_effects=("output_ripple",), fit=cast(Any, fit))
    said = discovery_call(smoothed)
    assert "    bandwidth=12.5,\n" in said and "    orders={'output_ripple': [1, 3]},\n" in said


@pytest.mark.parametrize(
    ("share", "said"),
    [(1.0, "100 %"), (0.999, "100 %"), (0.334, "33 %"), (0.0123, "1.2 %"), (-0.001, "-0.1 %")],
)
def test_a_share_reads_as_a_person_writes_it(share: float, said: str) -> None:
    seen = AlsoSeen("gravity", 0.3, 0.29, 3.0, share)
    (told,) = also_seen_sentences(replace(found(), also_seen=(seen,)))
    assert f" {said} of what closes" in told
    assert percent(-0.004) == "0 %" and percent(-0.006) == "-1 %" and percent(2.0) == "200 %"


def turning(values: np.ndarray, rate: float = 100.0) -> Log:
    time = np.arange(len(values)) / rate
    return Log.from_arrays(
        time=time,
        output_position=2.0 * time,
        output_velocity=np.full(len(time), 2.0),
        facts={"gear_ratio": 100.0, "output_spline": "circular"},
    )


@pytest.mark.parametrize(("hertz", "band"), [(0.3, 0), (4.0, 1), (21.0, 2)])
def test_a_wave_is_in_the_band_of_its_frequency(hertz: float, band: int) -> None:
    time = np.arange(4000) / 100.0
    wave = np.sin(2 * np.pi * hertz * time)
    sizes = [size for _, _, (size,) in frequency_bands([turning(wave)], [[wave]])]
    assert int(np.argmax(sizes)) == band
    assert sizes[band] == pytest.approx(np.sqrt(0.5), rel=0.01)


@pytest.mark.parametrize(("order", "band"), [(3.0, 0), (30.0, 1), (101.0, 2)])
def test_a_ripple_is_in_the_band_of_its_order(order: float, band: int) -> None:
    time = np.arange(4000) / 100.0
    wave = np.sin(order * 2.0 * time)
    sizes = [size for _, _, (size,) in order_bands([turning(wave)], [[wave]])]
    assert int(np.argmax(sizes)) == band
    assert sizes[band] == pytest.approx(np.sqrt(0.5), rel=0.02)


def test_squares_of_the_bands_add_up_to_those_of_the_rows_that_count() -> None:
    residual = np.random.default_rng(5).normal(0.1, 1.0, 3000)
    residual[900:1000] = np.nan
    sizes = [size for _, _, (size,) in frequency_bands([turning(residual)], [[residual]])]
    assert sum(np.square(sizes)) == pytest.approx(float(np.nanmean(residual**2)), rel=1e-12)


def test_bands_of_orders_count_the_rows_that_turn_and_no_others() -> None:
    log = there_and_back()
    rests = np.where(np.arange(len(log)) % 2000 < 500, 0.0, log["output_velocity"])
    log = log.with_columns({"output_velocity": rests}, note="rests")
    left = np.ones(len(log))
    bands = order_bands([log], [[left]])
    assert {rows for _, rows, _ in bands} == {int(np.count_nonzero(rests))}
    assert sum(sizes[0] ** 2 for *_, sizes in bands) == pytest.approx(1.0, rel=1e-12)
    (whole,) = {rows for _, rows, _ in frequency_bands([log], [[left]])}
    assert whole == len(log)


def test_rows_too_few_to_be_scored_are_told_apart_from_those_used() -> None:
    made = found()
    scored = sum(int(run.counts.sum()) for run in made.runs)
    told = " ".join(
        str(replace(made, rows={"used": scored + 14, "at rest": 6, "in a gap": 1})).split()
    )
    assert f"on runs that no fit saw ({scored} of {scored + 21} rows)" in told
    assert f"{scored + 14} of {scored + 21} rows were used, 14 of them in stretches" in told
    assert "stretches" not in str(replace(made, rows={"used": scored, "at rest": 6}))


def test_a_gap_at_reversals_alone_is_told_from_one_elsewhere() -> None:
    time = np.arange(4000) / 100.0
    velocity = np.sin(time)
    log = Log.from_arrays(time=time, output_position=1.0 - np.cos(time), output_velocity=velocity)
    zero = np.zeros(len(time))
    near = np.min(np.abs(time[:, None] - np.pi * np.arange(14)), axis=1) < 0.03
    run = HeldRun(log, zero, np.where(near, 1.0, 0.0), zero, None)
    by = {s.label: s for s in slices([run]) if s.group == "reversals"}
    assert by["within ±0.1 s of a reversal"].base > 0.3
    assert by["elsewhere"].base < 0.1 * by["within ±0.1 s of a reversal"].base
    assert all(part.final == 0.0 for part in by.values())


def test_rmse_of_all_rows_is_that_of_the_verdict_and_runs_add_up_to_it() -> None:
    made = found()
    table = made.before_after()
    assert table.loc[("all", "all rows"), "base"] == pytest.approx(made.base_rmse, rel=1e-12)
    assert table.loc[("all", "all rows"), "final"] == pytest.approx(made.final_rmse, rel=1e-12)
    runs = table.loc["run"]
    together = np.sqrt((runs["final"] ** 2 * runs["rows"]).sum() / runs["rows"].sum())
    assert together == pytest.approx(made.final_rmse, rel=1e-12)
    groups = {"all", "run", "reversals", "direction", "speed", "temperature", "load", "frequency",
              "order"}  # fmt: skip
    assert set(table.index.get_level_values("group")) == groups


def test_the_gap_of_a_slow_leak_closes_below_a_hertz_and_not_above_ten() -> None:
    bands = found().before_after().loc["frequency"]
    slow, fast = bands.iloc[0], bands.iloc[-1]
    assert slow["final"] < 0.3 * slow["base"]
    assert fast["final"] == pytest.approx(fast["base"], rel=0.02)


def test_residuals_are_of_fits_that_never_saw_the_run() -> None:
    made = found()
    others = [run.log for run in made.runs[1:]]
    names = [e.name for e in made.model.part("sensor_torque").effects]
    own = flexspline.fit(names, others, "sensor_torque", known_load=LOAD, checks=False)
    predicted = own.model.predict(made.runs[0].log).predicted
    apart = np.nanstd(predicted - made.runs[0].final)
    assert apart < 0.1 * made.final_rmse  # of other weights and shapes, not of another fit


def test_the_noise_floor_on_the_map_is_never_above_what_the_extended_model_reaches() -> None:
    where = found().disagreement
    for name, bands in where.before.by.items():
        for band in bands:
            assert band.noise_floor <= where.after[name][band.label] * (1.0 + 1e-12)
    assert "noise floor of 0.013 Nm" in where.before.sentences[0]


def test_the_json_holds_bands_and_all_parameters_with_errors() -> None:
    made = found()
    content = json.loads(made.to_json())
    assert len(content["before_after"]) == len(made.slices)
    assert {p["name"] for p in content["parameters"]} == {p.name for p in made.fit.parameters}
    (leak,) = content["found"][0]["parameters"]
    assert abs(leak["value"] - 0.05) < 4.0 * leak["standard_error"]


def test_the_report_stands_alone_can_be_read_and_shows_map_evidence_errors_and_provenance(
    tmp_path: Path,
) -> None:
    made = found()
    made.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("\u00a0", " ")
    (leak,) = made.parameters("motor_crosstalk")
    assert page.count("<svg") == 5  # the map and four views
    assert "http" not in page.replace("http://www.w3.org", "") and "<script" not in page
    for said in ("within ±0.1 s of a reversal", "below 1 Hz", "above order 50.5", "run 3",
                 "0.0500 ± 0.00", "flexspline.discover(", made.found[0].evidence[:40]):  # fmt: skip
        assert said in page, said
    assert leak.unit in page
    assert page_faults(tmp_path / "report.html") == []


def test_a_page_without_a_name_speaks_of_none(tmp_path: Path) -> None:
    """Two channels' product without a name: how large it is, and no figure of an extended model."""
    runs = []
    for seed in range(1, 5):
        c = rich_run(seed, ROWS)
        hidden = 2.0 * np.sin(3.0 * c["output_position"]) * np.tanh(c[LOAD] / 20.0)
        torque = c[LOAD] + friction_of(c) + noise(seed, ROWS) + hidden
        runs.append(log_of(c, sensor_torque=torque).with_facts({"name": f"run {seed}"}))
    made = flexspline.discover(BASE, runs, target="sensor_torque", known_load=LOAD)
    assert not made.found and made.unexplained
    made.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for said in ("extended model", "before and after", "after (full)", "named effects change",
                 "down at the noise floor", ">before<"):  # fmt: skip
        assert said not in page, said
    assert page_faults(tmp_path / "report.html") == []


@pytest.mark.usefixtures("undrawn")
def test_what_is_in_the_model_and_was_not_given_is_marked_as_new(tmp_path: Path) -> None:
    made = replace(found(), base_effects=("offset",))
    made.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count('<span class="new">') == 1 + 3  # the name; three of the base not given here


def test_a_notebook_shows_the_same_numbers_as_the_report() -> None:
    fragment = found()._repr_html_()
    assert "motor_crosstalk" in fragment and "0.0500 ± 0.00" in fragment
    assert "<html" not in fragment


def test_the_figure_has_a_panel_for_each_view() -> None:
    figure = found().plot()
    titles = [ax.get_title(loc="left") for cell in figure.subfigs for ax in cell.axes]
    assert len(titles) == 4 and "Orders of the residual, before and after" in titles


@pytest.mark.parametrize(
    ("gain", "left", "form", "alias", "said"),
    [
        (60.0, 2.4, 0.007, True, "beside it a keeps t = 2.4"),
        (98.0, 5.3, 0.3, True, "is no more than its form may miss"),
        (98.0, 5.3, 0.007, True, "in its place it explains 98 % as much"),
        (85.0, 5.3, 0.007, False, ""),
        (40.0, 2.4, 0.3, False, ""),
        (100.0, 5.3, 0.007, True, "in its place it explains 100 % as much"),
    ],
)
def test_an_alias_says_by_which_rule_it_is_one(
    gain: float, left: float, form: float, alias: bool, said: str
) -> None:
    adds = np.sqrt(max(gain + left**2 - 100.0, 0.0))
    rival = Rival(flexspline.effect("gravity"), gain, 100.0, left, adds, form)
    assert rival.alias is alias
    why = rival.why("a") if alias else ""
    assert said in why and (f"t = {left}" in why) is alias


@pytest.mark.parametrize(
    ("gain", "left", "moved", "alias"),
    [(990.0, 22.0, 11.0, True), (990.0, 22.0, 9.0, False), (990.0, 23.0, 11.0, False)],
)
def test_what_forms_of_other_names_may_move_tells_nothing_apart(
    gain: float, left: float, moved: float, alias: bool
) -> None:
    """Two that explain most of the same: t² = 484 of 1000 is left of the one beside the other."""
    rival = Rival(flexspline.effect("gravity"), gain, 1000.0, left, 1.0, 0.007, moved=moved)
    assert rival.alias is alias
    assert ("by that much the forms of other names may be off" in rival.why("a")) is alias


@pytest.mark.parametrize(("now", "doubted"), [(2.4, False), (5.3, True)])
def test_a_t_that_would_do_is_doubted_where_the_names_are_not_told_apart(
    now: float, doubted: bool
) -> None:
    outlook = Outlook(("inertia", "gravity"), now, 19.0, "", 0.5, None)
    said = plan_sentence(60.0, "strokes", [outlook], 1, own_load=False)
    assert f"(now {now}" in said
    assert ("were inertia right and every form exact" in said) is doubted


@pytest.mark.parametrize("reached", [0.02, float("inf")])
def test_a_parameter_that_a_run_makes_no_better_known_is_said_to_be_so(reached: float) -> None:
    outlook = Outlook(("inertia.inertia",), 0.02, reached, "kg m²", 0.0, None)
    said = plan_sentence(60.0, "strokes", [outlook], 1, own_load=False)
    assert "No run within these limits makes inertia" in said and "(now ± 0.02)" in said
    assert "inf" not in said


@pytest.mark.parametrize(("worse", "arrow"), [(1.5, False), (30.0, True)])
def test_what_got_worse_is_on_the_axes_of_the_map_or_said_to_be_above(
    worse: float, arrow: bool
) -> None:
    where = found().disagreement
    before = where.before
    band = max(before.by["speed"], key=lambda b: b.rmse)
    speed = {**where.after["speed"], band.label: worse * band.rmse}
    figure = plot_comparison(before, {**where.after, "speed": speed})
    axes = {ax.get_title(loc="left").split(":")[0]: ax for ax in figure.axes}
    top = axes["Speed"].get_ylim()[1]
    assert (worse * band.rmse < top) is not arrow
    said = [text.get_text() for text in axes["Speed"].texts]
    assert said == ([f"↑ {worse * band.rmse:.2g}"] if arrow else [])


def test_a_band_of_next_to_no_rows_is_hatched() -> None:
    before = found().disagreement.before
    most = max(before.by["speed"], key=lambda band: band.rows)
    few = [replace(band, rows=9) if band is most else band for band in before.by["speed"]]
    rare = replace(before, by={**before.by, "speed": tuple(few)})
    hatched = [len(bands_over(made, "speed").patches) for made in (before, rare)]
    assert hatched[1] == hatched[0] + 1


def test_a_stretch_is_as_short_as_what_changes_in_it_is_fast() -> None:
    made = found()
    time = made.runs[0].log["time"]

    def swinging(hertz: float) -> float:
        wave = np.sin(2.0 * np.pi * hertz * time)
        run = replace(made.runs[0], base=made.runs[0].final - wave)
        ax = held_out_run(replace(made, runs=(run,)))
        return float(np.ptp(ax.lines[0].get_xdata()))

    assert swinging(0.2) == pytest.approx(10.0, abs=0.1)
    assert swinging(10.0) == pytest.approx(3.0, rel=0.1)


def test_where_an_effect_acts_is_not_told_by_a_temperature_that_it_does_not_read() -> None:
    made = found()
    assert "temperature" not in made.found[0].where


def test_the_floor_of_the_verdict_is_that_of_the_map() -> None:
    assert found().disagreement.before.noise_floor == found().noise_floor


@pytest.mark.parametrize(
    ("confidences", "told"),
    [
        ((0.98,), "lacks motor_crosstalk: RMSE"),
        ((0.24, 0.04), "may lack motor_crosstalk at 24 %, cogging at 4 %: RMSE"),
        ((0.98, 0.04), "lacks motor_crosstalk, and may lack cogging at 4 %: RMSE"),
        ((0.04, 0.98), "may lack motor_crosstalk at 4 %, and lacks cogging: RMSE"),
    ],
)
def test_a_headline_is_no_surer_than_its_names(confidences: tuple[float, ...], told: str) -> None:
    (one,) = found().found
    names = ("motor_crosstalk", "cogging")
    several = tuple(
        replace(one, effect=name, confidence=confidence, share_of_gap=share)
        for name, confidence, share in zip(names, confidences, (0.9, 0.1), strict=False)
    )
    said = verdict(replace(found(), found=several))
    assert f"The model of the sensor torque {told} " in said


def test_an_error_that_falls_by_little_is_never_told_as_two_equal_numbers() -> None:
    little = replace(found(), base_rmse=1.9213, final_rmse=1.9187)
    assert "RMSE 1.921 to 1.919 Nm" in " ".join(str(little).split())
    assert ("extended model, RMSE held out", "1.919 Nm") in headlines(little)
    assert lowered(0.42, 0.016) == ("0.420", "0.0160") and lowered(2.0, 2.0) == ("2.00", "2.00")
    assert lowered(1.0, 1.0 - 1e-9) == ("1.00", "1.00")  # that no law of a name lets pass


def test_a_headline_names_what_explains_the_runs_as_well() -> None:
    (one,) = found().found
    either = replace(one, confidence=0.4, indistinguishable_from=("gravity",))
    said = verdict(replace(found(), found=(either,)))
    assert "may lack motor_crosstalk (or gravity) at 40 %: RMSE" in said
    several = replace(either, indistinguishable_from=("gravity", "cogging"))
    assert "may lack motor_crosstalk at 40 %: RMSE" in verdict(replace(found(), found=(several,)))


def test_a_headline_with_names_says_too_that_friction_differs_between_directions() -> None:
    made, name = found(), "direction_dependent_friction.viscosity"
    more = replace(
        made.fit.parameters[0], name=name, value=0.05, standard_error=0.001, unit="Nm·s/rad"
    )
    fit = replace(made.fit, parameters=(*made.fit.parameters, more))
    said = verdict(replace(made, fit=fit, without_directions=2.0 * made.final_rmse))
    assert said == (
        f"{verdict(made)} Besides, friction differs between directions (viscosity by "
        "0.1000 ± 0.0020 Nm·s/rad, below); both errors are with that in the model."
    )


def test_names_that_were_all_taken_back_are_not_told_as_nothing_missing() -> None:
    made = replace(found(), found=(), doubted=("presliding_friction",), unexplained=None)
    said = str(made)
    assert "Nothing is missing" not in said and "which is noise" not in said
    assert "Rejected: presliding_friction" in said
    assert "Nothing is missing" in str(replace(made, doubted=()))


def test_a_part_that_is_alone_in_its_group_is_not_told_twice() -> None:
    parts = found().slices
    forward = tuple(s for s in parts if s.group != "direction" or s.label == "forward")
    assert {s.group for s in parts} - {s.group for s in telling(forward)} == {"direction"}
    assert telling(parts) == parts


def test_what_the_caller_excluded_is_not_said_to_lack_channels() -> None:
    told = {"gravity": EXCLUDED, "cogging": "log 'run 1' has no motor_position"}
    said = " ".join(str(replace(found(), not_tried=told)).split())
    assert "Not tried, excluded by the caller: gravity." in said
    assert "Not tried, for lack of channels or facts: cogging." in said


@pytest.mark.parametrize(("final", "worse"), [(0.5, False), (1.5, True)])
def test_a_forward_simulation_that_got_worse_is_said_to_be_so(final: float, worse: bool) -> None:
    log = found().runs[0].log
    zero = np.zeros(len(log))
    motion = Motion("output_position", "rad", (HeldRun(log, zero, zero + 1.0, zero + final),))
    said = " ".join(str(replace(found(), motion=motion)).split())
    assert f"by 1.00 to {final:#.3g} rad RMS" in said
    assert ("the names do not make this better" in said) is worse


def there_and_back(rows: int = 4000) -> Log:
    """Two rad one way and back."""
    time = np.arange(rows) / 200.0
    velocity = np.where(time < time[-1] / 2.0, 0.2, -0.2)
    angle = np.cumsum(velocity) / 200.0
    return Log.from_arrays(time=time, output_position=angle, output_velocity=velocity)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_bands_of_orders_hold_what_is_left_in_either_direction(way: float) -> None:
    log = there_and_back()
    wave = np.cos(20.0 * log["output_position"])
    left = np.where(way * log["output_velocity"] > 0.0, wave, 0.0)
    bands = {label: sizes for label, _, sizes in order_bands([log], [[left]])}
    assert bands["orders 10 to 50"][0] == pytest.approx(0.5, rel=0.05)
    assert bands["below order 10"][0] < 0.1


def test_a_stretch_of_few_rows_tells_no_order_wherever_it_lies() -> None:
    log = there_and_back()
    velocity = np.zeros(len(log))
    velocity[3000:3020] = 10.0  # one radian in a tenth of a second
    angle = np.cumsum(velocity) / 200.0
    short = log.with_columns({"output_position": angle, "output_velocity": velocity}, note="short")
    assert order_bands([short], [[np.ones(len(log))]]) == []


def test_the_table_of_channels_says_what_was_found_late() -> None:
    made = found()
    fault = DataFault("run 1", "load_delay", LOAD, 0.0015, "s", (0, 100), "It is late.")
    other = replace(fault, size=0.0025, run="run 2")
    rows = channel_rows(replace(made, data_faults=(fault, other)))
    cells = {row[0].split()[0]: row[4] for row in rows}
    assert cells[LOAD] == "2" and {v for k, v in cells.items() if k != LOAD} <= {"–"}


def test_no_share_is_told_of_a_gap_whose_size_is_not_known() -> None:
    left = Unexplained(0.4, ("temperature", "time"))
    for by, said in (
        (BY_NAMES, "Unexplained: what is left after prewhitening depends on temperature, time, in"),
        (BY_FUNCTIONS, "Unexplained: 40 % of the gap above the noise floor after prewhitening, "),
    ):
        floor = replace(found().floor, by=by, rmse=0.5 * found().final_rmse)
        made = replace(found(), unexplained=left, floor=floor)
        assert any(sentence.startswith(said) for sentence in remarks(made))


@pytest.mark.parametrize(("final", "told"), [(1.21, True), (0.5, False)])
def test_a_weighed_share_does_not_stand_alone_beside_a_gap_that_is_hardly_closed(
    final: float, told: bool
) -> None:
    """The noise's metric sees 18 % left where the error in newton metres has hardly fallen."""
    floor = replace(found().floor, by=BY_FUNCTIONS, rmse=0.236)
    left = Unexplained(0.18, ("time",))
    made = replace(found(), unexplained=left, floor=floor, base_rmse=1.23, final_rmse=final)
    (said,) = [one for one in remarks(made) if one.startswith("Unexplained: 18 %")]
    assert ("Not weighed so, 97 % of the gap's mean square is left." in said) is told
    assert ("Not weighed" in said) is told


@pytest.mark.parametrize(("turns", "told"), [(0.4, True), (1.3, False)])
def test_orders_of_the_output_are_said_to_look_alike_over_part_of_a_turn(
    turns: float, told: bool
) -> None:
    time = np.arange(4000) / 100.0
    runs = []
    for seed in range(2):
        swing = np.sin((0.7 + 0.1 * seed) * time)
        angle = np.pi * turns * swing
        torque = 0.3 * np.cos(5.0 * angle) + np.random.default_rng(seed).normal(0.0, 0.02, 4000)
        runs.append(log_of({"time": time, "output_position": angle}, sensor_torque=torque))
    made = flexspline.discover(["offset"], runs, target="sensor_torque")
    assert made.names == ("output_ripple",)
    said = [one for one in remarks(made) if "of a turn of the output" in one]
    assert len(said) == told
    assert not told or said[0].startswith("The runs cover 0.4 of a turn of the output, over which")
