"""The three papers, done again on simulated rigs, with each published claim beside ours.

Each claim is a quantity of one draw of a simulated rig. Draws differ in what the paper does not
print. A criterion says how many draws must meet it:

    near         |value − expected| ≤ tolerance   (expected: the published value unless given)
    at_most      value ≤ bound
    at_least     value ≥ bound
    undecidable  a simulated rig cannot decide it, and the reason is said

Published values and ours are listed side by side as a table, as text and as HTML.
`reproduce` makes figures, tables and claims of a paper from draws of a simulated rig.
"""

from __future__ import annotations

import html
import importlib
import importlib.resources
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexspline.about import __version__
from flexspline.baselines.drift import require_scikit
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.files import atomic_write, folder_to_write, whole_folder
from flexspline.plot.canvas import own_style
from flexspline.progress import Progress

if TYPE_CHECKING:
    import pandas

    from flexspline.plot.canvas import PlainFigure

__all__ = [
    "PAPERS",
    "Claim",
    "Reproduction",
    "Story",
    "Verdict",
    "claims_of",
    "reproduce",
]


PAPERS = ("zhang", "turlapati", "full_range")

ROUNDING = 1e-12  # what is less in a table of SI units is what rounding leaves of zero

WORDS = {True: "holds", False: "does not hold", None: "not decided"}

DRAWS = 50
SEED = 20261121

BESIDE_RIVALS = "zhang"  # the paper whose method is set beside kernel regression


@dataclass(frozen=True)
class Claim:
    """One published claim.

    Parameters
    ----------
    id : paper, place and name, such as "zhang.fig17.before".
    source : equation, figure, table or section.
    claim : what the paper says.
    quantity : what is computed in each draw; None where nothing can be.
    published : the printed value in `unit`; None where none is printed.
    criterion : see the module docstring; `share` of the draws must meet it, all where it is
        left out.
    note : what else a reader should know.
    """

    id: str
    source: str
    claim: str
    quantity: str | None
    published: float | None
    unit: str
    criterion: Mapping[str, Any]
    note: str = ""

    def meets(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether each draw meets the criterion, (D,); a value that is not finite does not."""
        kind = self.criterion["kind"]
        if kind == "near":
            expected = self.criterion.get("expected", self.published)
            return np.asarray(np.abs(values - expected) <= self.criterion["tolerance"])
        bound = self.criterion["bound"]
        return np.asarray(values <= bound if kind == "at_most" else values >= bound)


@dataclass(frozen=True, eq=False)
class Verdict:
    """A claim beside ours.

    Parameters
    ----------
    claim : what was published, and the criterion.
    values : ours, (D,), one for each draw; empty where nothing can be computed.
    holds : whether the criterion is met; None where it cannot be decided.
    """

    claim: Claim
    values: NDArray[np.float64]
    holds: bool | None

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `claims.json`."""
        entry = {
            "id": self.claim.id,
            "source": self.claim.source,
            "claim": self.claim.claim,
            "quantity": self.claim.quantity,
            "unit": self.claim.unit,
            "published": self.claim.published,
            "criterion": dict(self.claim.criterion),
            "note": self.claim.note,
            "ours": None,
            "holds": self.holds,
        }
        good = self.values[np.isfinite(self.values)]
        if good.size:
            low, median, high = np.percentile(good, [5, 50, 95])
            entry["ours"] = {
                "median": float(median),
                "p5": float(low),
                "p95": float(high),
                "worst": [float(good.min()), float(good.max())],
                "draws": int(self.values.size),
                "failed_draws": int(self.values.size - good.size),
            }
        return entry


def claims_of(paper: str) -> tuple[Claim, ...]:
    """Return the claims of "zhang", "turlapati" or "full_range"."""
    if paper not in PAPERS:
        raise InputError(f"there is no paper '{paper}'; give one of {listed(PAPERS)}")
    folder = importlib.resources.files("flexspline.reproduce") / "claims"
    entries = json.loads((folder / f"{paper}.json").read_text(encoding="utf-8"))
    return tuple(Claim(**entry) for entry in entries)


def judged(paper: str, draws: Sequence[Mapping[str, float]]) -> tuple[Verdict, ...]:
    """Return each claim of a paper beside ours.

    Parameters
    ----------
    paper : "zhang", "turlapati" or "full_range".
    draws : of each draw, the quantities by the ids of their claims. A quantity that does not
        depend on the draw may be in the first one only.

    Raises
    ------
    InputError
        Where a decidable claim has no value, or a value has no claim.
    """
    claims = claims_of(paper)
    unknown = {name for draw in draws for name in draw} - {claim.id for claim in claims}
    if unknown:
        raise InputError(f"{paper}: there is no claim {listed(sorted(unknown))}; add it first")
    return tuple(_judged(claim, draws) for claim in claims)


def _judged(claim: Claim, draws: Sequence[Mapping[str, float]]) -> Verdict:
    values = np.array([draw[claim.id] for draw in draws if claim.id in draw], dtype=np.float64)
    if claim.criterion["kind"] == "undecidable":
        return Verdict(claim, values, None)
    if not values.size:
        raise InputError(f"claim {claim.id}: no draw gives a value; compute '{claim.quantity}'")
    share = float(claim.criterion.get("share", 1.0))
    return Verdict(claim, values, bool(np.mean(claim.meets(values)) >= share))


def _claims_table(made: Reproduction) -> pandas.DataFrame:
    """Return a row for each claim: published, ours (median and 90 % range), verdict."""
    import pandas

    rows = [
        {
            "claim": verdict.claim.claim,
            "source": verdict.claim.source,
            "published": _published(verdict),
            "ours": _ours(verdict),
            "unit": verdict.claim.unit,
            "criterion": _criterion(verdict),
            "verdict": WORDS[verdict.holds],
        }
        for verdict in made.verdicts
    ]
    return pandas.DataFrame(rows, index=[verdict.claim.id for verdict in made.verdicts])


def _claims_text(made: Reproduction) -> str:
    """Return the claims of a paper, three lines each at most."""
    counts = [
        f"{sum(v.holds is answer for v in made.verdicts)} {word}" for answer, word in WORDS.items()
    ]
    lines = [f"{made.paper}: {', '.join(counts)}; {_drawn(made)}", ""]
    for verdict in made.verdicts:
        claim = verdict.claim
        unit = "" if claim.unit == "1" else claim.unit
        lines.append(f"{WORDS[verdict.holds]:<13}  {claim.claim} [{claim.source}]")
        if claim.quantity:
            lines.append(
                f"{'':<15}{claim.quantity}: published {_published(verdict)}, "
                f"ours {f'{_ours(verdict)} {unit}'.rstrip()}; {_criterion(verdict)}"
            )
        else:
            lines.append(f"{'':<15}{_criterion(verdict)}")
    return "\n".join(lines)


def _claims_html(made: Reproduction) -> str:
    """Return the claims as a fragment of HTML."""
    import pandas

    with pandas.option_context("display.max_colwidth", None):
        table = _claims_table(made).to_html(index=False, border=0, classes="claims")
    return f"<p>{_drawn(made)}</p>\n{_scrolling(table)}"


def _report_page(made: Mapping[str, Reproduction]) -> str:
    """Return a page with every figure, table and claim; figures lie inside it."""
    from flexspline.report.html import templates

    body = "\n".join(part for reproduction in made.values() for part in _chapter(reproduction))
    page = templates().get_template("reproduction.html")
    return page.render(body=body, version=__version__) + "\n"


def _chapter(made: Reproduction) -> Iterator[str]:
    from flexspline.report.html import inline_svg

    yield f"<h1>{html.escape(made.paper)}</h1>"
    yield _claims_html(made)
    for name, figure in made.story.figures.items():
        caption = html.escape(made.story.captions.get(name, ""))
        yield f"<figure>{inline_svg(figure, f'{made.paper} {name}')}"
        yield f"<figcaption><b>{html.escape(name)}</b> {caption}</figcaption></figure>"
    for name, table in made.story.tables.items():
        yield f"<h2>{html.escape(name)}</h2>"
        yield f"<p>{html.escape(made.story.captions.get(name, ''))}</p>"
        named = table.rename(columns=lambda name: str(name).replace("_", " "))
        yield _scrolling(named.to_html(border=0, na_rep="–", float_format=_number))


def _number(value: float) -> str:
    return f"{value:.4g}" if abs(value) >= ROUNDING else "0"


def _scrolling(table: str) -> str:
    """A table of HTML in a box in which it scrolls where the screen is narrower."""
    from flexspline.report.html import minus

    return f'<div class="wide">{minus(table)}</div>'


def _drawn(made: Reproduction) -> str:
    return f"{made.draws} draw{'' if made.draws == 1 else 's'}, seed {made.seed}"


def _published(verdict: Verdict) -> str:
    value = verdict.claim.published
    return "not printed" if value is None else f"{value:g}"


def _ours(verdict: Verdict) -> str:
    good = verdict.values[np.isfinite(verdict.values)]
    if not good.size:
        return "–"
    low, median, high = np.percentile(good, [5, 50, 95])
    if good.size == 1 or low == high:
        return f"{median:.3g}"
    return f"{median:.3g} ({low:.3g} … {high:.3g})"


def _criterion(verdict: Verdict) -> str:
    rule = verdict.claim.criterion
    if rule["kind"] == "undecidable":
        return str(rule["reason"])
    if rule["kind"] == "near":
        expected = rule.get("expected", verdict.claim.published)
        wanted = f"{expected:g} ± {rule['tolerance']:g}"
    else:
        wanted = f"{'≤' if rule['kind'] == 'at_most' else '≥'} {rule['bound']:g}"
    return f"{wanted} in {100 * rule.get('share', 1.0):.0f} % of draws"


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

        return _claims_text(self)

    def _repr_html_(self) -> str:

        return _claims_html(self)

    @property
    def claims(self) -> pandas.DataFrame:
        """Each claim: published, ours (median, 5 %, 95 %), whether it holds."""

        return _claims_table(self)


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
        for values in _draws(paper, seeds, threads):
            found.append(values)
            bar.step()
    with own_style():
        story = module.story(seed)
    return Reproduction(paper, story, judged(paper, found), draws, seed)


def _draws(paper: str, seeds: Sequence[int], threads: int) -> Iterator[Mapping[str, float]]:
    if threads == 1:
        yield from (draw(paper, seed) for seed in seeds)
        return
    alone = partial(threadpool_limits, 1, "blas")  # threads of BLAS in each would wait for others
    with ProcessPoolExecutor(threads, initializer=alone) as pool:
        yield from pool.map(draw, [paper] * len(seeds), seeds)


def draw(paper: str, seed: int) -> Mapping[str, float]:
    """Return the quantities of one draw, by the ids of the claims."""
    module = importlib.import_module(f"flexspline.reproduce.{paper}")
    values: Mapping[str, float] = module.draw(np.random.default_rng(seed))
    return values


def _write(folder: Path, made: Mapping[str, Reproduction], latest: str) -> None:
    """Write the figures and tables of a paper, and page and claims of all that are done."""

    story = made[latest].story
    with own_style(), whole_folder(folder / latest) as place:
        for title, figure in story.figures.items():
            figure.savefig(place / f"{title}.png", dpi=150)
            figure.savefig(place / f"{title}.svg", metadata={"Date": None})
        for title, table in story.tables.items():
            table.to_csv(place / f"{title}.csv", lineterminator="\n")
    with own_style():
        page = _report_page(made)
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
