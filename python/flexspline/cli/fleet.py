"""Joints over many sessions: `flexspline track`, and `flexspline fleet fit|discover|compare|track`.

`track` follows one joint over months; the commands of a fleet work on many, on this machine or a
cluster.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flexspline.cli.options import (
    EFFECTS,
    FILE,
    RATE,
    TEXT,
    Command,
    Reading,
    Taught,
    asked_of_fit,
    bandwidth,
    effects_by_target,
    exclude,
    excluded,
    fixed,
    joint_and_map,
    known_effects,
    known_load,
    loaded,
    lowpass,
    model_file,
    named_effects,
    named_values,
    of_a_fit,
    on_terminal,
    orders,
    out_file,
    positive,
    reading,
    refuse_overwriting,
    repairs,
    speed_above,
    target,
    threads,
)
from flexspline.cli.speech import Commands, found, say, spoken
from flexspline.errors import InputError
from flexspline.files import atomic_write, whole_folder

if TYPE_CHECKING:
    from flexspline.fleet.result import FleetResult
    from flexspline.fleet.sessions import Sessions
    from flexspline.model import Model

__all__ = ["fleet", "track"]


FIT, DISCOVERY, COMPARISON = "fleet.json", "fleet_discovery.json", "fleet_comparison.json"
TRACK = "fleet_track.json"
REPORT = "report.html"
FACTS = ("gear_ratio", "output_spline", "torque_constant", "pole_pairs", "slots")
READ = ("columns", "preset", "repair", "rate", "encoding", "skip_lines", "dates", "joint")


def _limit(text: str) -> float | str:
    """Read a number, or a share of the level at first."""
    value = float(text.removesuffix("%"))
    if not math.isfinite(value):
        raise ValueError
    return text if text.endswith("%") else value


limits = named_values(
    "--limit",
    "limits",
    metavar="NAME=VALUE",
    example="NAME=VALUE or NAME=150%",
    parse=_limit,
    says="What a parameter must not pass, in its unit, or as 150% of its level at first: when it "
    "gets there is told. One below the level at first is a lower limit. Can be repeated.",
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
@out_file("DIR", "Folder for track.json and report.html.")
@model_file("Of runs: its effects and orders are fitted to each, its shapes held.")
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
    these. What cannot be read or fitted, or is there twice, is left out and named. Each parameter
    is looked at over calendar time, temperature accounted for. A change is told where noise alone
    makes less than one in ten years of weekly sessions, over all parameters together; where two
    causes explain it as well, both are named. A date for a limit is given only where a change that
    is told leads there.

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
            **asked_of_fit(options),
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


@click.group(cls=Commands, no_args_is_help=False)
def fleet() -> None:
    """Fit, discover, compare and track for all joints of a fleet, on one machine or a cluster.

    DIR holds a folder for each joint, and that its runs: DIR/UNIT/RUN.csv, in any format that the
    other commands read. Several DIRs may hold runs of the same joints, such as a folder for each
    month. map.toml in DIR, or in the folder of a joint, says what their columns are. Runs are read
    where they lie, each as a task of its own; a run that cannot be used is left out and named.

    Processes are Dask's: those of this machine, or with --scheduler ADDRESS of a cluster whose
    machines see the runs under the same paths (pip install 'flexspline[fleet]'). --workers 0 does
    without. The numbers are the same, to the last bit.

    \b
    Examples:
      flexspline fleet fit line7 --target sensor_torque \\
          --effects offset,coulomb_friction,viscous_friction --out line7_fit
      flexspline fleet discover line7 --target sensor_torque --effects offset --out line7_lacks
      flexspline fleet compare line7 --model line7_fit/units/{joint}.json --out line7_gap
      flexspline fleet track line7 --model joint.json --limit coulomb_friction=150% --out line7_wear
      flexspline fleet fit line7 --scheduler tcp://10.0.0.5:8786 --model joint.json --out all
    """


def _shared(command: Command) -> Command:
    """Options of who works, how runs are read, and where to."""
    options: tuple[tuple[str, dict[str, Any]], ...] = (
        (
            "--out",
            {"required": True, "metavar": "DIR", "type": FILE, "help": "Folder for what is found."},
        ),
        (
            "--scheduler",
            {"metavar": "ADDRESS", "help": "Of a Dask scheduler, such as tcp://10.0.0.5:8786."},
        ),
        (
            "--workers",
            {
                "type": click.IntRange(0, 1024),
                "metavar": "COUNT",
                "help": "Processes of this machine; by default one for each processor. 0: this one "
                "alone, without Dask.",
            },
        ),
        *joint_and_map(
            columns="Instead of map.toml in the folders.",
            preset="A column map that comes with flexspline.",
        ),
        (
            "--dates",
            {
                "metavar": "DATES.csv",
                "type": FILE,
                "help": "Columns run (UNIT/RUN) and date; else a date in a file's name counts.",
            },
        ),
        (
            "--joint",
            {
                "metavar": "A,B|all",
                "help": "Of a robot's files, whose map has sources such as q_{joint}: each is a "
                "joint of the fleet, UNIT.A.",
            },
        ),
        *joint_and_map(
            gear_ratio="Of all joints, as sold.",
            output_spline="The part of the gear that is the output.",
            torque_constant="Nm/A at the motor, of all joints.",
            pole_pairs="Of the motors.",
            slots="Of the motors.",
            repair="A repair of every run, listed below; can be repeated.",
        ),
        RATE,
        *TEXT[:2],
    )
    for name, settings in reversed(options):
        command = click.option(name, **settings)(command)
    folders = click.argument("folders", nargs=-1, required=True, metavar="DIR...", type=FILE)
    return folders(command)


def _fitted(command: Command) -> Command:
    """Options of what is fitted, and of who tells its shapes."""
    options = (
        target(required=False, says="What is explained; it may be left out with --model."),
        click.option(
            "--effects", "names", metavar="A,B,C", type=EFFECTS, help="Effects, listed below."
        ),
        model_file("Or the model of a joint, whose effects, shapes and orders are taken."),
        click.option(
            "--pilot",
            metavar="UNIT",
            help="The joint that tells shapes and orders; by default the one with most data.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


@fleet.command("fit", cls=Taught, sections=(effects_by_target, repairs))
@_fitted
@click.option(
    "--per-run",
    metavar="NAME,NAME",
    default="",
    help="Terms that differ from run to run, such as offset (zeros).",
)
@of_a_fit
@_shared
def fit(
    folders: tuple[str, ...],
    target: str | None,
    names: str | None,
    model_path: str | None,
    pilot: str | None,
    per_run: str,
    out: str,
    **options: Any,
) -> None:
    """Fit the same effects to every joint, and say what they have in common.

    Each run becomes a few kilobytes of sums, made ready as fit makes it; shapes and orders are
    held for all, as a pilot joint or --model tells them. Prints mean and spread of each parameter
    over the joints, with errors; the joints that stand out; and how well the values of each joint,
    shrunk towards the fleet by as much as its own runs do not know, predict runs that were held
    out.

    DIR receives fleet.json (all numbers), report.html (a page for the fleet), and in units a page
    and a model for each joint, with its values given the fleet, for predict, compare and export.

    \b
    Examples:
      flexspline fleet fit line7 --target sensor_torque \\
          --effects offset,coulomb_friction,viscous_friction --out line7_fit
      flexspline fleet fit 2026-10 2026-11 --target motor_current --gear-ratio 100 \\
          --effects offset,coulomb_friction,viscous_friction --per-run offset --out months
      flexspline fleet fit robots --columns robot.toml --joint all --model joint.json --out all
    """
    own = tuple(name.strip() for name in per_run.split(",")) if per_run else ()
    if "" in own:
        raise InputError(f"--per-run '{per_run}': a name is missing; write NAME or NAME,NAME")
    base = _base(names, model_path, target)

    def asked(sessions: Sessions) -> _Answer:
        from flexspline.fleet import fit as fit_fleet

        made = fit_fleet(sessions, **base, pilot=pilot, per_run=own, **_of_the_fit(options))
        models = {unit.name: made.model(unit.name).to_json() for unit in made.units}
        return made, models, f"{len(models)} pages and models"

    _answer(asked, FIT, folders, out, options)


@fleet.command("discover", cls=Taught, sections=(effects_by_target, repairs))
@target(required=False, says="What is explained; it may be left out with --model.")
@known_effects
@model_file("Or a model to start from.")
@exclude
@of_a_fit
@_shared
def discover(
    folders: tuple[str, ...],
    target: str | None,
    names: str | None,
    model_path: str | None,
    exclude: str | None,
    out: str,
    **options: Any,
) -> None:
    """Find what the joints lack, all of them or only some, and how sure that is.

    Looks at each joint by itself, as flexspline discover does. Prints in how many joints each name
    is found, with the share of such joints that have it, and which joints alone have a name.

    DIR receives fleet_discovery.json, report.html, and in units a page and the extended model of
    each joint.

    \b
    Examples:
      flexspline fleet discover line7 --target sensor_torque \\
          --effects offset,coulomb_friction,viscous_friction --out line7_lacks
      flexspline fleet discover line7 --model joint.json --workers 2 --out line7_lacks
    """
    unwanted = excluded(exclude)
    base = _base(names, model_path, target)

    def asked(sessions: Sessions) -> _Answer:
        from flexspline.fleet import discover as look

        made = look(sessions, **base, exclude=unwanted, **_of_the_fit(options))
        models = {unit.name: unit.model.to_json() for unit in made.units}
        return made, models, f"{len(models)} pages and models"

    _answer(asked, DISCOVERY, folders, out, options)


@fleet.command("compare", cls=Taught, sections=(repairs,))
@model_file(
    "One for all joints; or with {joint} in its name, which stands for the joint.", required=True
)
@target(required=False)
@lowpass
@bandwidth
@speed_above
@_shared
def compare(
    folders: tuple[str, ...], target: str | None, model_path: str, out: str, **options: Any
) -> None:
    """Say where a model and the runs of each joint disagree, pooled and for the worst.

    Compares each joint by itself, as flexspline compare does. Nothing is fitted. DIR receives
    fleet_comparison.json, report.html, and in units a page for each joint.

    \b
    Examples:
      flexspline fleet compare line7 --model joint.json --out line7_gap
      flexspline fleet compare line7 --model line7_fit/units/{joint}.json --out line7_gap
    """
    model = _model(model_path, target)

    def asked(sessions: Sessions) -> _Answer:
        from flexspline.fleet import compare as compare_fleet

        made = compare_fleet(
            model,
            sessions,
            target=target,
            lowpass=options["lowpass"],
            bandwidth=options["bandwidth"],
            speed_above=options["speed_above"],
            **_work(options),
        )
        return made, {}, f"{len(made.units)} pages"

    _answer(asked, COMPARISON, folders, out, options)


@fleet.command("track", cls=Taught, sections=(effects_by_target, repairs))
@_fitted
@limits
@horizon
@of_a_fit
@_shared
def track_joints(
    folders: tuple[str, ...],
    target: str | None,
    names: str | None,
    model_path: str | None,
    pilot: str | None,
    limits: dict[str, float | str],
    horizon: float,
    out: str,
    **options: Any,
) -> None:
    """Follow every joint over months: which changed, in what, since when, by how much.

    Each run is one session of its joint and needs a date, such as DIR/UNIT/2027-03-14.csv or those
    of --dates. Runs become sums as in fleet fit; each joint is then looked at as flexspline track
    does. Of many joints one shows more by chance than a joint alone, so the evidence that is needed
    grows with their number: a fleet alarms no more often than a joint, once in ten years.

    DIR receives fleet_track.json, report.html, and in units a page and track.json of each joint.

    \b
    Examples:
      flexspline fleet track line7 --target sensor_torque \\
          --effects offset,coulomb_friction,viscous_friction --out line7_wear
      flexspline fleet track line7 --model joint.json --limit coulomb_friction=150% --out line7_wear
    """
    base = _base(names, model_path, target)

    def asked(sessions: Sessions) -> _Answer:
        from flexspline.tracking import track_fleet

        made = track_fleet(
            sessions, **base, pilot=pilot, limits=limits, horizon=horizon, **_of_the_fit(options)
        )
        tracks = {name: one.to_json() for name, one in made.tracks.items()}
        return made, tracks, f"{len(tracks)} pages and tracks"

    _answer(asked, TRACK, folders, out, options)


def _write(made: FleetResult, file: Path, of_joints: Mapping[str, str]) -> str:
    """Write a result, its report, and beside the page of each joint a text; return its words."""
    from flexspline.report.fleet import page_names

    made.report(file.parent)
    for name, page in page_names([*of_joints]).items():
        atomic_write((file.parent / page).with_suffix(".json"), of_joints[name])
    made.save(file)
    return str(made)


_Answer = tuple["FleetResult", Mapping[str, str], str]
"""A result, the text beside the page of each joint, and what both of these are in words."""


def _answer(
    asked: Callable[[Sessions], _Answer],
    file: str,
    folders: tuple[str, ...],
    out: str,
    options: Mapping[str, Any],
) -> None:
    """Ask something of the runs in the folders; write the answer, its numbers to `file`.

    `asked` imports what it computes with, which takes long: wrong calls are refused before.
    """
    sessions = _sessions(folders, out, options, (file, REPORT))
    with whole_folder(out, last=file) as draft:
        made, of_joints, units = asked(sessions)
        said = _write(made, draft / file, of_joints)
    found(made.to_json())
    say(f"{said}\n\nwrote {file}, {REPORT} and units ({units}) to {Path(out)}")


def _model(path: str, target: str | None) -> Model | Callable[[str], Model]:
    """The model of all joints, or what reads that of each."""
    if "{joint}" not in path:
        return loaded(path, target)

    def of_joint(name: str) -> Model:
        from flexspline.report.fleet import page_names

        file = Path(page_names([name])[name]).stem  # as fleet fit calls it
        return loaded(path.replace("{joint}", file), target)

    return of_joint


def _sessions(
    folders: tuple[str, ...], out: str, options: Mapping[str, Any], written: tuple[str, ...]
) -> Sessions:
    """The runs in the folders; nothing is read before the place for the results is looked at."""
    refuse_overwriting(out, folders, written)
    for folder in folders:
        if Path(out).resolve() == Path(folder).resolve():
            raise InputError(f"--out {out}: holds the runs; give another folder")
    from flexspline.fleet.sessions import sessions_of

    how = {key: options[key] for key in (*FACTS, *READ) if options[key] not in (None, ())}
    names = [name.strip() for name in how.pop("joint", "").split(",") if name.strip()]
    dates, columns = how.pop("dates", None), how.pop("columns", None)
    return sessions_of(folders, columns=columns, dates=dates, joints=names, **how)


def _base(names: str | None, model_path: str | None, target: str | None) -> dict[str, Any]:
    """What is fitted to the target: the effects that are named, or those of a model."""
    if (names is None) == (model_path is None):
        raise InputError("give exactly one of --effects A,B,C and --model MODEL.json")
    if names is not None and target is None:
        raise InputError("--target is needed beside --effects; say what is explained")
    return {
        "target": target,
        "effects": None if names is None else named_effects(names),
        "model": None if model_path is None else loaded(model_path, target),
    }


def _of_the_fit(options: Mapping[str, Any]) -> dict[str, Any]:
    """How the runs of each joint are fitted, and who works."""
    asked = asked_of_fit(options)
    given = {"orders": asked["orders"] or None, "fixed": asked["fixed"] or None}
    return {**asked, **given, **_work(options)}


def _work(options: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "scheduler": options["scheduler"],
        "workers": options["workers"],
        "progress": on_terminal(),
    }


for _command in (fit, discover, compare, track_joints):
    spoken(_command)
