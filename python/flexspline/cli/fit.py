"""`flexspline fit`: effects and runs to a model and a report."""

from __future__ import annotations

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
    lowpass,
    named,
    named_effects,
    on_terminal,
    orders,
    reading,
    refuse_overwriting,
    repairs,
    simulation,
    simulations,
    target,
    threads,
)
from flexspline.cli.speech import found, say
from flexspline.effects import require_effects
from flexspline.errors import InputError
from flexspline.files import whole_folder

__all__ = ["fit"]


def _bound(text: str) -> tuple[float | None, float | None]:
    low, high = (None if not part.strip() else float(part) for part in text.split(":"))
    return low, high


def _prior(text: str) -> tuple[float, float]:
    value, error = (float(part) for part in text.split(":"))
    return value, error


def _refuse_of_motion(options: dict[str, Any], foreign: bool) -> None:
    """Refuse what a fit of the motion cannot take."""
    if foreign:
        raise InputError(
            "--by simulation drives the effects alone; leave the foreign simulation out"
        )
    if options["prior"]:
        raise InputError("--by simulation takes no --prior; fix or bound the parameter instead")
    if options["bandwidth"] is not None and options["bandwidth"] != math.inf:
        raise InputError("--by simulation compares the motion as it is; leave --bandwidth out")
    if options["offset_per_run"]:
        raise InputError(
            "--by simulation takes one offset for all runs; leave --offset-per-run out"
        )


def _require_call(names: list[str], target: str, options: dict[str, Any], foreign: bool) -> None:
    """Refuse what is wrong whatever the runs hold, before they are read."""
    from flexspline.fitting import with_orders
    from flexspline.least_squares.options import Given, require_given

    effects = with_orders(names, options["orders"])
    require_effects(effects, target)
    if options["by"] == "simulation":
        _refuse_of_motion(options, foreign)
        return
    if options["controller"] or options["free_controller"]:
        raise InputError("--controller drives a simulation; give --by simulation or leave it out")
    if not options["offset_per_run"]:  # whose names are those of the runs
        if options["known_load"] is None:
            effects = [each.without_load() for each in effects]
        require_given(effects, Given(options["fix"], options["bound"], options["prior"], False))


@click.command(cls=Taught, sections=(effects_by_target, repairs))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@target(required=True)
@click.option(
    "--effects",
    "names",
    required=True,
    metavar="A,B,C",
    type=EFFECTS,
    help="Effects, listed below; or none.",
)
@click.option(
    "--out", required=True, metavar="DIR", type=FILE, help="Folder for model.json and report.html."
)
@click.option(
    "--into", metavar="MODEL.json", type=FILE, help="Add this part to a model of the same joint."
)
@known_load
@lowpass
@bandwidth
@orders
@fixed
@click.option(
    "--bound",
    multiple=True,
    metavar="NAME=LOW:HIGH",
    callback=named("NAME=LOW:HIGH", _bound),
    help="Limits of a parameter; either may be left out, as in viscous_friction=0:.",
)
@click.option(
    "--prior",
    multiple=True,
    metavar="NAME=VALUE:ERROR",
    callback=named("NAME=VALUE:ERROR", _prior),
    help="A value known beforehand, with its standard error.",
)
@click.option("--robust", is_flag=True, help="Weigh down outliers and pushes (Huber).")
@click.option(
    "--by",
    type=click.Choice(("regression", "simulation")),
    default="regression",
    show_default=True,
    help="Fit the torque, or from there on the motion that it makes when simulated.",
)
@click.option(
    "--controller",
    metavar="SERVO.json",
    type=FILE,
    help="By simulation: the servo's law that drives it.",
)
@click.option(
    "--free-controller",
    metavar="A,B",
    default="",
    help="Fields of the law to fit too: torque, back_emf.",
)
@click.option(
    "--starts",
    type=click.IntRange(1),
    default=8,
    show_default=True,
    help="By simulation: descents, from the regression, from pieces of the runs, and around.",
)
@simulation
@click.option("--offset-per-run", is_flag=True, help="One offset for each run.")
@threads
@reading()
def fit(
    runs: tuple[str, ...],
    target: str,
    names: str,
    out: str,
    into: str | None,
    simulation: tuple[str, ...],
    simulated_torque: str | None,
    reading: Reading,
    **options: Any,
) -> None:
    """Fit physical effects to runs, all together.

    Reads the runs, checks them, fits the effects by least squares, and judges the fit on rows
    that it never saw. Prints the verdict: each term with its error and unit, what the runs
    cannot tell apart, and where the error is largest. DIR receives model.json (the joint, all
    that predict and export need) and report.html (open it in a browser). A fit by simulation goes
    on from there until the simulated motion is the measured one, and leaves the law as servo.json.

    A run is a CSV file with one line of channel names (time, output_position, output_velocity,
    sensor_torque, ...) in SI units; lines "# gear_ratio: 100" above it give facts, which the
    options overrule. Other formats are read as well; name their columns by --columns.

    \b
    Examples:
      flexspline fit run1.csv run2.csv --target sensor_torque --gear-ratio 100 \\
          --effects offset,coulomb_friction,viscous_friction --out joint
      flexspline fit run1.csv --target motor_current --lowpass 5 \\
          --effects offset,coulomb_friction,gravity --repair drop_start=1 --out drive
      flexspline fit run*.csv --target motor_torque --by simulation --gear-ratio 1 \\
          --controller servo.json --free-controller back_emf \\
          --effects inertia,gravity,coulomb_friction,load_dependent_friction --out servo
    """
    from flexspline.fitting import fit as fit_effects
    from flexspline.least_squares.options import FitOptions

    effects = named_effects(names)
    foreign = bool(simulation) or simulated_torque is not None
    _require_call(effects, target, options, foreign)
    model = None if into is None else loaded(into)
    refuse_overwriting(out, [*runs, *simulation], ("model.json", "report.html", "servo.json"))
    with whole_folder(out, last="model.json") as draft:
        column = None if simulation else simulated_torque
        logs = reading.logs(runs, {} if model is None else model.facts, column)
        shared = {
            "known_load": options["known_load"],
            "lowpass": options["lowpass"],
            "orders": options["orders"],
            "fixed": options["fix"],
            "bounds": options["bound"],
            "into": model,
        }
        how = {
            "robust": "huber" if options["robust"] else None,
            "threads": options["threads"],
            "progress": on_terminal(),
        }
        made_elsewhere = simulations(simulation, simulated_torque)
        if options["by"] == "simulation":
            from flexspline.output_error.fitting import fit_motion
            from flexspline.output_error.settings import MotionOptions

            free = [name for name in options["free_controller"].split(",") if name]
            asked = MotionOptions(free_controller=free, starts=options["starts"], **how)
            made = fit_motion(
                effects, logs, target, controller=options["controller"], options=asked, **shared
            )
        else:
            rest = FitOptions(
                bandwidth=options["bandwidth"],
                offset_per_run=options["offset_per_run"],
                simulation=made_elsewhere,
                simulated_torque=simulated_torque,
                **how,
            )
            made = fit_effects(
                effects, logs, target, priors=options["prior"], options=rest, **shared
            )
        if made.simulation is not None and made.simulation.controller is not None:
            made.simulation.controller.save(draft / "servo.json")
        made.report(draft / "report.html")
        made.model.save(draft / "model.json")
        verdict = str(made)
    found(
        {
            "target": made.target,
            "unit": made.unit,
            "rmse": made.rmse,
            "held_out_rmse": made.cv_rmse,
            "parameters": [parameter.to_json() for parameter in made.parameters],
        }
    )
    say(f"{verdict}\n\nwrote {Path(out) / 'model.json'} and {Path(out) / 'report.html'}")
