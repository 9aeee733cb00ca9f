"""Where models and runs disagree, and why: `flexspline compare`, `compare-models`, `discover`.

`compare` locates the disagreement, `compare-models` has several models of one target side by side
on the same runs; `discover` finds, names and adds what the model lacks.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from flexspline.cli.options import (
    FILE,
    Reading,
    Taught,
    asked_of_fit,
    bandwidth,
    by_motion,
    controller,
    effects_by_target,
    exclude,
    excluded,
    fitted_controller,
    is_table,
    known_effects,
    known_load,
    loaded,
    lowpass,
    model_file,
    model_joint,
    named_effects,
    named_values,
    of_a_fit,
    on_terminal,
    out_file,
    reading,
    refuse_overwriting,
    repairs,
    simulation,
    simulations,
    speed_above,
    target,
    threads,
)
from flexspline.cli.speech import found, say
from flexspline.errors import InputError
from flexspline.files import atomic_write, remove_file, save_table, whole_folder

__all__ = ["compare", "discover", "models"]


NEXT = "next_experiment.csv"


@click.command(cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@model_file("A model that fit wrote, or an MJCF file or a URDF with a joint.")
@model_joint
@simulation
@click.option(
    "--simulated-motion", is_flag=True, help="Compare the output_position of --simulation."
)
@out_file("DIR", "Folder for comparison.json and report.html.")
@target(required=False)
@click.option(
    "--simulated", is_flag=True, help="Drive the model forward and compare the motion instead."
)
@controller
@known_load
@lowpass
@bandwidth
@speed_above
@reading()
def compare(
    runs: tuple[str, ...],
    model_path: str | None,
    model_joint: str | None,
    simulation: tuple[str, ...],
    simulated_torque: str | None,
    simulated_motion: bool,
    out: str,
    target: str | None,
    simulated: bool,
    controller: str | None,
    known_load: str | None,
    lowpass: float | None,
    bandwidth: float | None,
    speed_above: float | None,
    reading: Reading,
) -> None:
    """Say where a model, or any simulation, and runs disagree, and how far above the noise.

    Predicts the runs and sorts what is left (measured − predicted) by run, direction, speed,
    load, temperature, angle, order of what turns, acceleration, time, and distance from the last
    reversal; estimates the noise floor where it applies; and prints two sentences that say where
    the gap is largest and what it is not seen to follow. It names no cause, and nothing is fitted.
    Of a model it warns as predict does: rows outside of what it was fitted to, terms that are not
    significant. DIR receives comparison.json (all numbers) and report.html (the map).

    \b
    Examples:
      flexspline compare run3.csv run4.csv --model joint/model.json --out where
      flexspline compare run3.csv --model joint/model.json --lowpass 5 --out where
      flexspline compare run3.csv --model joint/model.json --simulated --out where
      flexspline compare run3.csv --target sensor_torque --simulated-torque mujoco --out where
      flexspline compare run3.csv --simulation made3.csv --simulated-motion --out where
    """
    foreign = bool(simulation) or simulated_torque is not None
    if model_path is None and not foreign:
        raise InputError(
            "give exactly one of --model MODEL.json and --simulation FILE or --simulated-torque "
            "COLUMN to compare with"
        )
    if model_path is None and target is None and not simulated_motion:
        raise InputError("--target is needed beside a simulated torque; say what it predicts")
    joint = None if model_path is None else loaded(model_path, target, model_joint or reading.joint)
    if joint is not None:
        joint.part(target)
    refuse_overwriting(out, [*runs, *simulation], ("comparison.json", "report.html"))
    with whole_folder(out, last="comparison.json") as draft:
        column = None if simulation else simulated_torque
        logs = reading.logs(runs, joint.facts if joint else {}, column)

        from flexspline.comparison import compare as compare_runs
        from flexspline.forward import PositionServo

        made = compare_runs(
            joint,
            logs,
            target=target,
            lowpass=lowpass,
            bandwidth=bandwidth,
            simulated=simulated,
            simulation=simulations(simulation, simulated_torque, motion=simulated_motion),
            simulated_torque=simulated_torque,
            simulated_motion=simulated_motion,
            known_load=known_load,
            speed_above=speed_above,
            controller=PositionServo.load(controller) if controller else None,
            progress=on_terminal(),
        )
        made.report(draft / "report.html")
        atomic_write(draft / "comparison.json", made.to_json())
        said = str(made)
    found(json.loads(made.to_json()))
    say(f"{said}\n\nwrote {Path(out) / 'comparison.json'} and {Path(out) / 'report.html'}")


def _of_joint(content: Mapping[str, Any]) -> dict[str, Any]:
    """What a discovery says of one joint: the names found, and by how much the error fell."""
    sizes = {
        "rmse_base": content["rmse"]["base"],
        "rmse_final": content["rmse"]["final"],
        "noise_floor": content["rmse"]["noise_floor"],
    }
    names = [one["effect"] for one in content["found"]]
    return {
        **sizes,
        **{f"{name}_unit": content["unit"] for name in sizes},
        "found": ", ".join(names) or ("unexplained" if content["unexplained"] else "nothing"),
    }


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(number) for number in text.split(","))


@click.command(cls=Taught, sections=(effects_by_target, repairs))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@target(required=False)
@known_effects
@model_file("Or a model to start from, or an MJCF file or a URDF with a joint.")
@model_joint
@simulation
@by_motion(
    "By simulation: what makes the simulated motion the measured one, where only motion is "
    "measured."
)
@fitted_controller
@exclude
@out_file("DIR", "Folder for what is found.")
@of_a_fit
@named_values(
    "--limit",
    "limits",
    metavar="NAME=VALUE",
    example="NAME=VALUE or NAME=LOWEST,HIGHEST",
    parse=_numbers,
    says="Of a run to record next: velocity, acceleration [rad/s, rad/s²], duration [s]; "
    "LOWEST,HIGHEST of position [rad], load [Nm], temperature [°C]. Can be repeated.",
)
@threads
@reading(each_joint=_of_joint)
def discover(
    runs: tuple[str, ...],
    target: str | None,
    names: str | None,
    model_path: str | None,
    model_joint: str | None,
    simulation: tuple[str, ...],
    simulated_torque: str | None,
    out: str,
    reading: Reading,
    **options: Any,
) -> None:
    """Find what a model of these runs lacks, name it, add it, and show the gap shrink.

    Starts from known effects (--effects), from a saved model (--model), or from what a simulator
    of yours says of the runs (--simulated-torque, --simulation); then what that lacks is found.
    A model may be the joint of an MJCF file or a URDF, whose damping, friction and armature are
    effects to begin with; their values are fitted again, but those of --fix.
    Faults of the data are looked for first. Every effect of the catalogue that acts on the target
    and has its channels is a candidate; one is named where it gains on runs that the fit never
    saw, by more than chance and by more than any other. What no effect
    explains is said to be unexplained.

    DIR receives model.json (the extended model), discovery.json and report.html; where these runs
    cannot separate two causes also next_experiment.csv, the trajectory of the run that would.
    --limit says what that run may do: by default what these runs did.

    \b
    Examples:
      flexspline discover run1.csv run2.csv run3.csv run4.csv --target sensor_torque \\
          --effects offset,coulomb_friction,viscous_friction --out found
      flexspline discover run5.csv --model joint/model.json --target motor_torque --out found
      flexspline discover run*.csv --model robot.urdf --model-joint elbow \\
          --target motor_torque --out found
      flexspline discover run*.csv --target sensor_torque --simulated-torque mujoco --out found
    """
    from flexspline.experiment.plan import parsed_limits

    foreign = bool(simulation) or simulated_torque is not None
    if (names is not None) + (model_path is not None or foreign) != 1:
        raise InputError(
            "give exactly one to start from: either --effects A,B,C, or --model MODEL.json, or "
            "--simulation FILE (or --simulated-torque COLUMN)"
        )
    if model_path is None and target is None and options["by"] == "regression":
        beside = "a simulation" if foreign else "--effects"
        raise InputError(f"--target is needed beside {beside}; say what is explained")
    model = None if model_path is None else loaded(model_path, target, model_joint or reading.joint)
    effects = None if names is None else named_effects(names)
    limits = parsed_limits(options["limits"])
    unwanted = excluded(options["exclude"])
    written = ("model.json", "discovery.json", "report.html", NEXT)
    refuse_overwriting(out, [*runs, *simulation], written)
    with whole_folder(out, last="discovery.json") as draft:
        column = None if simulation else simulated_torque
        logs = reading.logs(runs, {} if model is None else model.facts, column)

        from flexspline.discovery.discovering import discover as look

        made = look(
            effects if model is None else model,
            logs,
            target=target,
            **asked_of_fit(options),
            simulation=simulations(simulation, simulated_torque),
            simulated_torque=simulated_torque,
            exclude=unwanted,
            limits=limits,
            threads=options["threads"],
            by=options["by"],
            controller=options["controller"],
            free_controller=options["free_controller"],
            progress=on_terminal(),
        )
        made.report(draft / "report.html")
        made.model.save(draft / "model.json")
        if made.plan is not None:
            made.plan.save(draft / NEXT)
        atomic_write(draft / "discovery.json", made.to_json())
        verdict = str(made)
    if made.plan is None:  # of an earlier discovery
        remove_file(Path(out) / NEXT)
    found(json.loads(made.to_json()))
    files = f"model.json, discovery.json{f', {NEXT}' if made.plan else ''} and report.html"
    say(f"{verdict}\n\nwrote {files} to {Path(out)}")


@click.command("compare-models", cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@click.option(
    "--model",
    "paths",
    multiple=True,
    required=True,
    metavar="MODEL.json",
    type=FILE,
    help="A model to compare; give two or more.",
)
@click.option(
    "--out",
    metavar="FILE.csv|DIR",
    type=FILE,
    help="Table, a row for each model; or a folder for models.csv, models.png and report.html.",
)
@target(required=False)
@lowpass
@reading()
def models(
    runs: tuple[str, ...],
    paths: tuple[str, ...],
    out: str | None,
    target: str | None,
    lowpass: float | None,
    reading: Reading,
) -> None:
    """Compare models of one target on the same rows of the same runs.

    Prints the RMSE of each model by run and of all rows, and marks the lowest, and the errors of
    runs that a model was fitted to: these are too low to be compared. Nothing is fitted.

    \b
    Examples:
      flexspline compare-models run3.csv run4.csv --model before.json --model after.json
      flexspline compare-models run3.csv --model a.json --model b.json --out side_by_side
    """
    for path in paths:
        if paths.count(path) > 1:
            raise InputError(f"--model {path} is given twice; give each model once")
    if len(paths) < 2:
        raise InputError("one --model is nothing to compare; give two or more")
    joints = {path: loaded(path, target) for path in paths}
    if out is not None:
        written = () if is_table(out) else ("models.csv", "models.png", "report.html")
        refuse_overwriting(out, [*runs, *paths], written)
    logs = reading.logs(runs, joints[paths[0]].facts)

    from flexspline.comparison.models import compare_models

    made = compare_models(joints, logs, target=target, lowpass=lowpass)
    found(
        {
            "target": made.target,
            "unit": made.unit,
            "rows": made.rows,
            "runs": [run.log.name for run in made.runs],
            "models": [
                {"model": name, "rmse": errors[-1], "rmse_by_run": errors[:-1], "kind": kind}
                for name, errors, kind in zip(
                    made.names, made.errors().T.tolist(), made.kinds()[-1], strict=True
                )
            ],
            "notes": made.notes,
        }
    )
    say(str(made))
    if out is None:
        return
    table = made.to_frame().drop(columns=["aic", "bic"]).reset_index()  # these are of fits alone
    if is_table(out):
        save_table(table, out)
        say(f"\nwrote {out}")
        return
    with whole_folder(out, last="models.csv") as draft:
        made.plot().savefig(draft / "models.png", dpi=110)
        made.report(draft / "report.html")
        save_table(table, draft / "models.csv")
    say(f"\nwrote models.csv, models.png and report.html to {Path(out)}")
