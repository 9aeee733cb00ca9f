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
from tqdm import tqdm

from flexspline.about import __version__
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.files import whole_folder
from flexspline.plot.canvas import own_style
from flexspline.reproduce.claims import PAPERS, Verdict, judged

if TYPE_CHECKING:
    import pandas

    from flexspline.plot.canvas import PlainFigure

__all__ = ["DRAWS", "Reproduction", "Story", "reproduce"]

DRAWS = 50
SEED = 20261121


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
        written whole or not at all; None writes nothing.
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
        For an unknown paper, fewer than one draw or thread, or a negative seed.
    """
    if paper != "all" and paper not in PAPERS:
        near = did_you_mean(paper, PAPERS)
        raise InputError(f"there is no paper '{paper}'{near}; give {listed(PAPERS)} or all")
    for name, value, least in (("draws", draws, 1), ("seed", seed, 0), ("threads", threads, 1)):
        if value < least:
            raise InputError(f"{name} is {value}; give at least {least}")
    papers = PAPERS if paper == "all" else (paper,)
    if out is None:
        return {name: _one(name, draws, seed, threads, progress) for name in papers}
    with whole_folder(out, last="claims.json") as folder:
        made = {name: _one(name, draws, seed, threads, progress) for name in papers}
        with own_style():
            _write(folder, made)
    return made


def _one(paper: str, draws: int, seed: int, threads: int, progress: bool) -> Reproduction:
    module = importlib.import_module(f"flexspline.reproduce.{paper}")
    seeds = [int(s.generate_state(1)[0]) for s in np.random.SeedSequence(seed).spawn(draws)]
    with tqdm(total=draws, desc=paper, unit=" draws", disable=not progress, leave=False) as bar:
        found = []
        for values in _drawn(paper, seeds, threads):
            found.append(values)
            bar.update()
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


def _write(folder: Path, made: Mapping[str, Reproduction]) -> None:
    from flexspline.reproduce.claims import report_page

    for name, reproduction in made.items():
        place = folder / name
        place.mkdir()
        for title, figure in reproduction.story.figures.items():
            figure.savefig(place / f"{title}.png", dpi=150)
            figure.savefig(place / f"{title}.svg", metadata={"Date": None})
        for title, table in reproduction.story.tables.items():
            table.to_csv(place / f"{title}.csv", lineterminator="\n")
    (folder / "report.html").write_text(report_page(made), encoding="utf-8")
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
    (folder / "claims.json").write_text(text, encoding="utf-8")
