"""What people read of a comparison: text, JSON, map and report."""

from __future__ import annotations

import json
import re
from pathlib import Path

import comparison_logs as rig
import matplotlib.pyplot as plt
import pytest
from figure_layout import page_faults
from golden_texts import is_as_kept
from html_pages import tags_of

from flexspline.plot.comparison import panels

CAUSES = ("friction", "stribeck", "hysteresis", "drift", "cogging", "backlash", "compliance")
CONTRACT = ("run", "speed", "direction", "position_order", "temperature", "load")
CONTRACT += ("reversal_time", "reversal_angle", "acceleration", "time")


@pytest.mark.parametrize("hidden", ["slow", "ripple", "nothing"])
def test_the_words_are_those_of_the_golden_file(hidden: str) -> None:
    is_as_kept(str(rig.comparison(hidden)) + "\n", f"comparison_{hidden}.txt")


@pytest.mark.parametrize("hidden", rig.HIDDEN)
def test_no_cause_is_named_and_lines_fit_the_screen(hidden: str) -> None:
    made = rig.comparison(hidden)
    text = str(made)
    assert max(map(len, text.splitlines())) <= 120
    assert not [cause for cause in CAUSES if cause in text.lower()]
    assert all(sentence.endswith(".") for sentence in made.sentences)


@pytest.mark.parametrize("hidden", ["slow", "nothing"])
def test_the_json_holds_what_the_contract_names(hidden: str) -> None:
    made = rig.comparison(hidden)
    content = json.loads(made.to_json())
    assert content["overall"]["rmse"] == made.rmse
    assert content["sentences"] == list(made.sentences)
    assert set(CONTRACT) <= set(content)
    for name in CONTRACT:
        for band in content[name]:
            assert {"rmse", "variance", "bias", "noise_floor"} <= set(band)
    assert [band["rows"] for band in content["run"]] == [12_000] * 4


def test_the_map_shows_what_the_gap_follows_first_and_all_axes_have_units() -> None:
    before = plt.get_fignums()
    for hidden, first in (("slow", "speed"), ("ripple", "position_order")):
        made = rig.comparison(hidden)
        figure = made.plot()
        shown = [ax for ax in figure.axes if ax.get_visible()]
        assert panels(made)[0] == first and len(shown) == len(panels(made))
        for ax in shown:
            assert re.search(r"\[[^\]]+\]$", ax.get_ylabel())
            assert ax.get_title(loc="left") and ax.get_xlabel()
    assert plt.get_fignums() == before


@pytest.mark.parametrize("hidden", rig.HIDDEN)
def test_html_is_closed_and_loads_nothing(hidden: str, tmp_path: Path) -> None:
    made = rig.comparison(hidden)
    made.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for text in (page, made._repr_html_()):
        assert "script" not in tags_of(text)
        assert "<script" not in text
    assert not re.search(r"""(src|href)\s*=\s*["'](https?:)?//""", page)
    assert page.count("<svg") == 2


def test_a_report_is_readable_wide_narrow_and_dark(tmp_path: Path) -> None:
    rig.comparison("ripple").report(tmp_path / "report.html")
    assert page_faults(tmp_path / "report.html") == []


def test_the_table_holds_the_same_numbers() -> None:
    made = rig.comparison("slow")
    frame = made.to_frame()
    assert frame.loc[("all", "all rows"), "rmse"] == made.rmse
    assert len(frame) == 1 + sum(len(bands) for bands in made.by.values())
