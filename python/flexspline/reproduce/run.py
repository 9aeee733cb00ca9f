"""`reproduce`: figures, tables and claims of a paper, from draws of a simulated rig."""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexspline.about import __version__
from flexspline.baselines.drift import require_scikit
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.files import atomic_write, folder_to_write, whole_folder
from flexspline.plot.canvas import own_style
from flexspline.progress import Progress
from flexspline.reproduce.claims import PAPERS, Verdict, judged

if TYPE_CHECKING:
    import pandas

    from flexspline.plot.canvas import PlainFigure

__all__ = ["DRAWS", "Reproduction", "Story", "reproduce"]

DRAWS = 50
SEED = 20261121

BESIDE_RIVALS = "zhang"  # the paper whose method is set beside kernel regression


@dataclass(frozen=True)
class Story:
    """What a paper shows, made again: the module of a paper gives one by ``story(seed)``.

    Parameters
    ----------
    figures : by file name without ending, such as "fig14".
    tables : by file name without ending, such as "table3".
    captions : what to look at, by the same names.
    """

    figures: Mapping[str, PlainFigure] = field(default_factory=dict)
    tables: Mapping[str, pandas.DataFrame] = field(default_factory=dict)
    captions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, repr=False)
class Reproduction:
    """One paper, done again: its story and each of its claims beside ours."""

    paper: str
    story: Story
    verdicts: tuple[Verdict, ...]
    draws: int
    seed: int

    def __repr__(self) -> str:
        return f"<Reproduction of {self.paper}: {len(self.verdicts)} claims, {self.draws} draws>"

    def __str__(self) -> str:
        from flexspline.reproduce.claims import claims_text

        return claims_text(self)

    def _repr_html_(self) -> str:
        from flexspline.reproduce.claims import claims_html

        return claims_html(self)

    @property
    def claims(self) -> pandas.DataFrame:
        """Each claim: published, ours (median, 5 %, 95 %), whether it holds."""
        from flexspline.reproduce.claims import claims_table

        return claims_table(self)


def reproduce(
    paper: str,
    out: str | os.PathLike[str] | None = None,
    *,
    draws: int = DRAWS,
    seed: int = SEED,
    threads: int = 1,
    progress: bool = False,
) -> dict[str, Reproduction]:
    """Do a paper again on its simulated rig.

    Parameters
    ----------
    paper : "zhang", "turlapati", "full_range" or "all".
    out : folder for figures (PNG and SVG), tables (CSV), `claims.json` and `report.html`,
        each paper's as soon as it is done, whole or not at all; None writes nothing.
    draws : rigs that differ in what the paper does not print.
    seed : the same seed gives the same numbers.
    threads : processes to draw with.
    progress : show it on standard error.

    Returns
    -------
    dict of Reproduction, by paper.

    Raises
    ------
    InputError
        For an unknown paper, fewer than one draw or thread, a negative seed, or, of the first
        paper, without scikit-learn, before anything is computed.
    """
    if paper != "all" and paper not in PAPERS:
        near = did_you_mean(paper, PAPERS)
        raise InputError(f"there is no paper '{paper}'{near}; give {listed(PAPERS)} or all")
    for name, value, least in (("draws", draws, 1), ("seed", seed, 0), ("threads", threads, 1)):
        if value < least:
            raise InputError(f"{name} is {value}; give at least {least}")
    papers = PAPERS if paper == "all" else (paper,)
    if BESIDE_RIVALS in papers:
        require_scikit()
    folder = None if out is None else folder_to_write(out)
    made: dict[str, Reproduction] = {}
    for number, name in enumerate(papers, start=1):
        title = name if len(papers) == 1 else f"{name} ({number} of {len(papers)})"
        made[name] = _one(name, draws, seed, threads, title if progress else "")
        if folder is not None:
            _write(folder, made, name)
    return made


def _one(paper: str, draws: int, seed: int, threads: int, title: str) -> Reproduction:
    """One paper done again; a title is shown with its progress, an empty one is not."""
    module = importlib.import_module(f"flexspline.reproduce.{paper}")
    seeds = [int(s.generate_state(1)[0]) for s in np.random.SeedSequence(seed).spawn(draws)]
    with Progress(title, bool(title), total=draws, unit=" draws") as bar:
        found = []
        for values in _drawn(paper, seeds, threads):
            found.append(values)
            bar.step()
    with own_style():
        story = module.story(seed)
    return Reproduction(paper, story, judged(paper, found), draws, seed)


def _drawn(paper: str, seeds: Sequence[int], threads: int) -> Iterator[Mapping[str, float]]:
    if threads == 1:
        yield from (draw(paper, seed) for seed in seeds)
        return
    with ProcessPoolExecutor(threads) as pool:
        yield from pool.map(draw, [paper] * len(seeds), seeds)


def draw(paper: str, seed: int) -> Mapping[str, float]:
    """Return the quantities of one draw, by the ids of the claims."""
    module = importlib.import_module(f"flexspline.reproduce.{paper}")
    values: Mapping[str, float] = module.draw(np.random.default_rng(seed))
    return values


def _write(folder: Path, made: Mapping[str, Reproduction], latest: str) -> None:
    """Write the figures and tables of a paper, and page and claims of all that are done."""
    from flexspline.reproduce.claims import report_page

    story = made[latest].story
    with own_style(), whole_folder(folder / latest) as place:
        for title, figure in story.figures.items():
            figure.savefig(place / f"{title}.png", dpi=150)
            figure.savefig(place / f"{title}.svg", metadata={"Date": None})
        for title, table in story.tables.items():
            table.to_csv(place / f"{title}.csv", lineterminator="\n")
    with own_style():
        page = report_page(made)
    atomic_write(folder / "report.html", page)
    content = {
        "format": "flexspline-claims",
        "version": 1,
        "made_by": f"flexspline {__version__}",
        "papers": {
            name: {
                "draws": reproduction.draws,
                "seed": reproduction.seed,
                "claims": [verdict.to_json() for verdict in reproduction.verdicts],
            }
            for name, reproduction in made.items()
        },
    }
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    atomic_write(folder / "claims.json", text)
