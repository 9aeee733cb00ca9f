"""The frame of `reproduce`, with a paper of three claims that the test writes itself."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas
import pytest
from cli_calls import call
from figure_layout import page_faults

from flexspline import reproduce as papers
from flexspline.errors import InputError
from flexspline.plot.canvas import axes_or_new
from flexspline.reproduce import Claim, Story, reproduce

PAPER = "small_paper"


def draw(rng: np.random.Generator) -> Mapping[str, float]:
    return {"small_paper.near": rng.normal(1.0, 0.01), "small_paper.never": 2.0}


def story(seed: int) -> Story:
    ax = axes_or_new(None)
    ax.plot([0, 1], [0, seed])
    return Story(
        {"fig1": ax.figure}, {"table1": pandas.DataFrame({"x [Nm]": [1.0]})}, {"fig1": "a line"}
    )


@pytest.fixture
def small_paper(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    module = ModuleType(PAPER)
    module.draw, module.story = draw, story  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, f"flexspline.reproduce.{PAPER}", module)
    near, never = {"kind": "near", "tolerance": 0.1}, {"kind": "at_most", "bound": 1.0}
    unclear = {"kind": "undecidable", "reason": "?"}
    rules = (
        Claim("small_paper.near", "(1)", "one", "x", 1.0, "Nm", near),
        Claim("small_paper.never", "(2)", "< one", "y", 1.0, "Nm", never),
        Claim("small_paper.open", "(3)", "?", None, None, "", unclear),
    )
    monkeypatch.setattr(papers, "claims_of", lambda paper: rules)
    monkeypatch.setattr(papers, "PAPERS", (PAPER,))
    yield


@pytest.mark.usefixtures("small_paper")
def test_a_reproduction_leaves_figures_tables_claims_and_a_page(tmp_path: Path) -> None:
    made = reproduce(PAPER, tmp_path / "out", draws=5)[PAPER]
    assert [v.holds for v in made.verdicts] == [True, False, None]
    assert "1 holds, 1 does not hold, 1 not decided" in str(made)
    for name in ("fig1.png", "fig1.svg", "table1.csv"):
        assert (tmp_path / "out" / PAPER / name).stat().st_size > 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<svg" in page and "does not hold" in page and "NaN" not in page
    assert page_faults(tmp_path / "out" / "report.html") == []
    kept = json.loads((tmp_path / "out" / "claims.json").read_text(encoding="utf-8"))
    first = kept["papers"][PAPER]["claims"][0]
    assert first["published"] == 1.0 and first["holds"] is True and first["ours"]["draws"] == 5


@pytest.mark.usefixtures("small_paper")
def test_the_same_seed_gives_the_same_numbers_and_another_seed_others() -> None:
    one, same, other = (reproduce(PAPER, draws=3, seed=s)[PAPER].verdicts[0] for s in (1, 1, 2))
    assert one.values.tolist() == same.values.tolist() != other.values.tolist()


@pytest.mark.usefixtures("small_paper")
def test_nothing_is_left_where_a_draw_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(papers, "draw", lambda paper, seed: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        reproduce(PAPER, tmp_path / "out", draws=1)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("small_paper")
def test_a_paper_that_is_done_stays_where_the_next_one_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reproduce(PAPER, tmp_path / "alone", draws=2)
    monkeypatch.setattr(papers, "PAPERS", (PAPER, "another"))
    draw = papers.draw
    monkeypatch.setattr(
        papers, "draw", lambda paper, seed: draw(paper, seed) if paper == PAPER else 1 / 0
    )
    monkeypatch.setitem(
        sys.modules, "flexspline.reproduce.another", sys.modules[f"flexspline.reproduce.{PAPER}"]
    )
    with pytest.raises(ZeroDivisionError):
        reproduce("all", tmp_path / "out", draws=2)
    for name in ("claims.json", "report.html", f"{PAPER}/table1.csv"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()


@pytest.mark.usefixtures("small_paper")
def test_what_the_command_itself_wrote_before_is_neither_kept_nor_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(papers, "PAPERS", (PAPER, "another"))
    monkeypatch.setitem(
        sys.modules, "flexspline.reproduce.another", sys.modules[f"flexspline.reproduce.{PAPER}"]
    )
    out, pages = tmp_path / "out", {"claims.json", "report.html"}
    how = ["reproduce", "all", "--draws", "2", "--threads", "1", "--out", out]
    assert call(*how, "--no-overwrite").exit_code == 0
    assert {file.name for file in out.iterdir()} == {*pages, PAPER, "another"}
    (out / "report.html").write_text("what was there")
    said = call(*how, "--seed", "2")
    assert said.exit_code == 0, said.stderr
    assert (out / "report.html.previous").read_text() == "what was there"
    refused = call(*how, "--no-overwrite")
    assert refused.exit_code == 2 and "is there already" in refused.stderr


def test_without_scikit_learn_it_is_asked_for_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.kernel_ridge", None)
    monkeypatch.setattr(papers, "draw", pytest.fail)
    for paper in ("zhang", "all"):
        with pytest.raises(InputError, match=r"pip install 'flexspline\[baselines\]'"):
            reproduce(paper, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_unknown_paper_is_answered_with_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'zhang'"):
        reproduce("zang")


def test_no_draw_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least 1"):
        reproduce("zhang", draws=0)
    done = call("reproduce", "zhang", "--draws", "0", "--out", str(tmp_path / "x"))
    assert done.exit_code == 2
