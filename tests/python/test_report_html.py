"""The notebook table, the report in one file, and tables of several fits."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import report_fits
from figure_layout import page_faults
from html_pages import tags_of

import flexspline
from flexspline.errors import InputError
from flexspline.formatting import padded
from flexspline.least_squares.result import shares
from flexspline.report.html import together, write_report
from flexspline.report.tables import compare_scores


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(report_fits.plain_fit(), path)
    return path.read_text(encoding="utf-8")


def test_the_report_of_a_fit_is_readable_wide_narrow_and_dark(page: str, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    for mark in ("<h1>", "<li>", "<summary>"):
        assert mark in page
        page = page.replace(mark, f"{mark}{'/long/path' * 9}")
    path.write_text(page, encoding="utf-8")
    assert page_faults(path) == []


def test_no_line_breaks_between_a_number_and_its_unit(page: str) -> None:
    said = "<p id='a 2 s'>2 % of 5.0 ± 0.1 Nm·s/rad, t = 3</p>"
    assert together(said) == said.replace("2 %", "2~%").replace(" ± ", "~±~").replace(
        "1 Nm", "1~Nm"
    ).replace(" = ", "~=~").replace("~", "\N{NO-BREAK SPACE}")
    kept = '3 runs, 4 sets<pre>a = 5 s</pre><svg><text>5 %</text></svg><p class="path">run 2 s</p>'
    assert together(kept) == kept
    prose = re.sub(r"<(svg|pre|style)\b.*?</\1>", "", page, flags=re.DOTALL)
    assert not re.search(r"\d (%|Nm|s|rad|°C|Hz)\b|\d ± ", prose)


def test_zeros_at_the_end_of_a_size_are_said() -> None:
    assert [padded(v) for v in (0.016, 0.3, 0.0848, 12.0, 700.0, np.nan)] == [
        "0.0160", "0.300", "0.0848", "12.0", "700", "–",
    ]  # fmt: skip


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("tied", [False, True])
def test_what_is_strongly_correlated_is_not_said_to_be_determined_by_itself(
    tied: bool, tmp_path: Path
) -> None:
    time = np.arange(2000) * 1e-2
    position = np.sin(time)
    noise = np.random.default_rng(0).normal(size=len(time))
    log = flexspline.Log.from_arrays(
        time=time,
        output_position=position,
        output_velocity=np.cos(time),
        sensor_torque=np.cos(position) + 0.01 * noise,
    )
    effects = ["offset", "gravity"] if tied else ["offset", "viscous_friction"]
    fit = flexspline.fit(effects, log, "sensor_torque", checks=False)
    write_report(fit, tmp_path / "tied.html")
    told = (tmp_path / "tied.html").read_text(encoding="utf-8")
    assert ("strongly correlated with" in told) is tied
    assert ("only loosely" in told) is tied
    assert ("determine every coefficient by itself" in told) is not tied


def test_every_tag_is_closed(page: str) -> None:
    for text in (page, report_fits.plain_fit()._repr_html_()):
        assert tags_of(text)


def test_the_report_loads_nothing_from_a_network(page: str) -> None:
    assert not re.search(r"""(src|href|url\(|@import)\s*[=(]?\s*["']?\s*(https?:)?//""", page)
    namespaces = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert set(re.findall(r"https?://[^\"'\s<>)]+", page)) <= namespaces


def test_the_report_is_small_and_has_all_sections(page: str) -> None:
    assert len(page) < 3_000_000
    sections = re.findall(r'<section id="(\w+)">', page)
    assert sections == [
        "parameters",
        "known",
        "scores",
        "figures",
        "shares",
        "trust",
        "channels",
        "logs",
        "again",
    ]
    assert page.count("<figure>") == page.count("<figcaption>") == 9
    assert "prefers-color-scheme:dark" in page and "@media print" in page


def test_nothing_in_a_report_is_a_script_or_repeats_an_id_of_a_clip(page: str) -> None:
    assert "script" not in tags_of(page)
    clips = re.findall(r'<clipPath id="([^"]+)"', page)
    assert len(clips) == len(set(clips))


def test_the_call_in_the_report_makes_the_same_fit(page: str) -> None:
    call = re.search(r"<pre><code>(.*?)</code>", page, re.DOTALL)
    assert call is not None
    source = call.group(1).replace("&#39;", "'").replace("\n)", "\n    checks=False)")
    names = {"flexspline": flexspline, "logs": [report_fits.run(k) for k in range(5)]}
    exec(source, names)
    again: object = names["fit"]
    assert isinstance(again, type(report_fits.plain_fit()))
    assert again.rmse == report_fits.plain_fit().rmse


def test_names_of_logs_are_escaped(tmp_path: Path) -> None:
    evil = "<script>alert('$x$')</script>"
    fit = flexspline.fit(
        ["offset", "viscous_friction"],
        [report_fits.run(1, name=evil, joint=evil), report_fits.run(2, name="_b&_$", joint=evil)],
        "sensor_torque",
        checks=False,
    )
    write_report(fit, tmp_path / "report.html")
    for text in ((tmp_path / "report.html").read_text(encoding="utf-8"), fit._repr_html_()):
        assert "<script" not in text
        assert "&lt;script&gt;" in text


def test_a_report_below_a_file_is_an_error_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="cannot be written"):
        write_report(report_fits.useless_fit(), tmp_path / "file" / "report.html")


def test_confounded_effects_share_one_bar() -> None:
    found = shares(report_fits.confounded_fit())
    assert list(found) == ["offset + coulomb_friction_per_direction", "viscous_friction"]


def test_a_table_of_fits_marks_the_best_of_each_row() -> None:
    rich, poor = report_fits.plain_fit(), report_fits.confounded_fit()
    table = compare_scores({"rich": rich, "no_ripple": poor})
    frame = table.to_frame()
    assert frame.loc[("all", "all rows"), "rich"] == rich.cv_rmse
    assert np.isnan(frame.loc[("run", "run 4"), "no_ripple"])
    assert table.best()[0].tolist() == [True, False]
    assert f"<b>{rich.cv_rmse:.4f}</b>" in table.to_html()
    assert f"\\textbf{{{rich.cv_rmse:.4f}}}" in table.to_latex()
    assert "no\\_ripple" in table.to_latex() and "[Nm]" in table.to_latex()
    assert str(table).splitlines()[0].startswith("RMSE on held-out rows [Nm]")
    assert "*" in str(table).splitlines()[1]
    named = compare_scores({"a^2 ~ b\\": rich, "c": poor}).to_latex()
    assert "a\\textasciicircum{}2 \\textasciitilde{} b\\textbackslash{}" in named


def test_fits_of_different_targets_are_not_compared() -> None:
    log = report_fits.run(1)
    other = flexspline.fit(
        ["offset"],
        log.with_columns({"motor_current": log["sensor_torque"]}, note="copied"),
        "motor_current",
        checks=False,
    )
    with pytest.raises(InputError, match="one target only"):
        compare_scores({"a": report_fits.plain_fit(), "b": other})
    with pytest.raises(InputError, match="no fit to compare"):
        compare_scores({})


def test_a_users_style_and_backend_change_no_report(page: str, tmp_path: Path) -> None:
    fit = report_fits.plain_fit()
    style = {"text.usetex": True, "axes.facecolor": "red", "font.size": 40.0, "axes.grid": True}
    with matplotlib.rc_context(style):
        fit.report(tmp_path / "styled.html")
        assert matplotlib.rcParams["font.size"] == 40.0
    assert (tmp_path / "styled.html").read_text(encoding="utf-8") == page


def test_reports_of_two_threads_are_those_of_one(page: str, tmp_path: Path) -> None:
    fit = report_fits.plain_fit()
    with ThreadPoolExecutor(2) as threads:
        for made in [threads.submit(fit.report, tmp_path / f"{k}.html") for k in range(2)]:
            made.result()
    assert {path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == {page}
