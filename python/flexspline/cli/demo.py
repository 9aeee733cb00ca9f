"""Simulated rigs: `flexspline demo`, and `flexspline reproduce` for the papers' claims."""

from __future__ import annotations

import os

import click

from flexspline.cli.options import FILE, on_terminal, out_file, refuse_overwriting, whole_number
from flexspline.cli.speech import found, say

__all__ = [
    "demo",
    "reproduce",
]

PAPERS = ("zhang", "turlapati", "full_range", "all")  # importing those of reproduce takes long


@click.command()
@click.option(
    "--out",
    default="flexspline-demo",
    show_default=True,
    metavar="DIR",
    type=FILE,
    help="Folder to write.",
)
def demo(out: str) -> None:
    """See the whole path work, without any data of your own.

    Simulates a joint whose torque sensor shows more physics than the model that is fitted
    first, finds the effect that is hidden in the runs, and leaves in DIR the runs, model.json,
    report.html, the figures and a C++ header. The printed lines tell the story.

    \b
    Example:
      flexspline demo --out flexspline-demo
    """
    refuse_overwriting(out, [], ("model.json", "report.html", "joint.hpp"))

    from flexspline.demo import demo as run_demo

    made = run_demo(out, say=say)
    found({"found": made.found, "rmse_before": made.before, "rmse_after": made.after})


def _processors() -> int:
    """How many processors this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)  # not on macOS and Windows
    return len(allowed(0)) if allowed else os.cpu_count() or 1


@click.command()
@click.argument("paper", type=click.Choice(PAPERS))
@out_file("DIR", "Folder for figures, tables and claims.")
@whole_number("--draws", 1, default=50, says="Rigs that differ in what the paper does not print.")
@whole_number("--seed", 0, default=20261121, says="The same gives the same numbers.")
@whole_number(
    "--threads",
    1,
    1024,
    default=_processors,
    shown="all processors",
    says="Processes to draw with.",
)
def reproduce(paper: str, out: str, draws: int, seed: int, threads: int) -> None:
    """Do the papers again, and set each published claim beside ours.

    \b
    zhang        ripple and drift of a torque sensor, calibration, collisions
    turlapati    intrinsic dynamics by regression, a bearing against a load cell
    full_range   observer and gear compliance merged

    The papers' data was never published: each has a simulated rig that follows its protocol
    with its parameters and more physics than any model under test. DIR receives the figures
    (PNG and SVG), the tables, report.html, and claims.json: of each claim the published value,
    ours over the draws, the criterion that was fixed before the run, and whether it holds.

    \b
    Example:
      flexspline reproduce zhang --out zhang
    """
    from flexspline.reproduce import reproduce as run

    made = run(paper, out, draws=draws, seed=seed, threads=threads, progress=on_terminal())
    for reproduction in made.values():
        say(f"{reproduction}\n")
    found({"papers": {name: [v.to_json() for v in one.verdicts] for name, one in made.items()}})
    say(f"wrote {out}")
