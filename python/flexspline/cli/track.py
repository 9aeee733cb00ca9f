"""`flexspline track`: one joint over months."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import click

from flexspline.cli.options import (
    EFFECTS,
    FILE,
    Reading,
    Taught,
    bandwidth,
    effects_by_target,
    fixed,
    known_load,
    loaded,
    named,
    named_effects,
    on_terminal,
    orders,
    positive,
    reading,
    refuse_overwriting,
    repairs,
    target,
    threads,
)
from flexspline.cli.speech import found, say
from flexspline.errors import InputError
from flexspline.files import atomic_write, whole_folder

__all__ = ["horizon", "limits", "track"]


def _limit(text: str) -> float | str:
    """Read a number, or a share of the level at first."""
    value = float(text.removesuffix("%"))
    if not math.isfinite(value):
        raise ValueError
    return text if text.endswith("%") else value


limits = click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="NAME=VALUE",
    callback=named("NAME=VALUE or NAME=150%", _limit),
    help="What a parameter must not pass, in its unit, or as 150% of its level at first: when it "
    "gets there is told. Can be repeated.",
)
horizon = click.option(
    "--horizon",
    type=positive,
    default=5.0,
    show_default=True,
    metavar="YEARS",
    help="How far behind the last session a limit is looked for.",
)


@click.command(cls=Taught, sections=(effects_by_target, repairs))
@click.argument("sessions", nargs=-1, required=True, metavar="MODEL_OR_RUN...", type=FILE)
@click.option(
    "--out", required=True, metavar="DIR", type=FILE, help="Folder for track.json and report.html."
)
@click.option(
    "--model",
    "model_path",
    metavar="MODEL.json",
    type=FILE,
    help="Of runs: its effects and orders are fitted to each, its shapes held.",
)
@click.option(
    "--effects",
    "names",
    metavar="A,B,C",
    type=EFFECTS,
    help="Of runs, in the place of a model: effects, listed below; shapes of the first run are "
    "held.",
)
@target(required=False, says="Which part of the models, or what is explained of runs.")
@known_load
@bandwidth
@orders
@fixed
@click.option(
    "--dates",
    metavar="TABLE.csv",
    type=FILE,
    help="Columns run and date, of models also temperature; by default dates are in the names of "
    "files or folders, as 2027-03-14, or the fact date of a run.",
)
@click.option(
    "--since", metavar="DATE", help="Only sessions from then on, as after a service of the joint."
)
@limits
@horizon
@threads
@reading()
def track(
    sessions: tuple[str, ...],
    out: str,
    model_path: str | None,
    names: str | None,
    target: str | None,
    since: str | None,
    limits: dict[str, float | str],
    horizon: float,
    dates: str | None,
    reading: Reading,
    **options: Any,
) -> None:
    """Follow one joint over months: what changed since when, and what it will need.

    Takes the model.json of each session, or its runs, which are fitted one by one, or a folder of
    these. Each parameter is looked at over calendar time, temperature accounted for. A change is
    told where noise alone makes less than one in ten years of weekly sessions, over all parameters
    together; where two causes explain it as well, both are named. A date for a limit is given only
    where a change that is told leads there.

    DIR receives track.json and report.html. Of fewer than eight sessions nothing is told.

    \b
    Examples:
      flexspline track models/2027-*/model.json --limit coulomb_friction=150% --out track
      flexspline track runs/ --model joint/model.json --known-load reference_torque --out track
      flexspline track runs/2027-*.csv --target motor_torque --gear-ratio 100 --out track \\
          --effects offset,coulomb_friction,viscous_friction,gravity,inertia
    """
    reading.refuse_cut("a file is one session")
    if model_path is not None and names is not None:
        raise InputError("--model and --effects both say what is fitted; give one of them")
    model = None if model_path is None else loaded(model_path, target)
    effects = None if names is None else named_effects(names)
    read = [path for path in (*sessions, model_path, dates) if path and Path(path).is_file()]
    refuse_overwriting(out, read, ("track.json", "report.html"))

    from flexspline.tracking import track as follow
    from flexspline.tracking.history import history_of

    with whole_folder(out, last="track.json") as draft:
        history = history_of(
            sessions,
            target=target,
            model=model,
            effects=effects,
            orders=options["orders"],
            fixed=options["fix"],
            known_load=options["known_load"],
            bandwidth=options["bandwidth"],
            dates=dates,
            columns=reading.columns,
            threads=options["threads"],
            progress=on_terminal(),
            **reading.arguments,
        )
        if since is not None:
            history = history.since(since)
        made = follow(history, limits=limits, horizon=horizon)
        made.report(draft / "report.html")
        atomic_write(draft / "track.json", made.to_json())
        said = str(made)
    found(json.loads(made.to_json()))
    say(f"{said}\n\nwrote track.json and report.html to {Path(out)}")
