"""`flexspline compare`: where a model and runs disagree."""

from __future__ import annotations

from pathlib import Path

import click

from flexspline.cli.options import (
    Reading,
    Taught,
    bandwidth,
    controller,
    known_load,
    lowpass,
    on_terminal,
    reading,
    repairs,
    simulation,
    simulations,
    target,
)
from flexspline.errors import InputError
from flexspline.files import atomic_write, whole_folder

__all__ = ["compare"]


@click.command(cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...")
@click.option("--model", "model_path", metavar="MODEL.json", help="A model that fit wrote.")
@simulation
@click.option(
    "--simulated-motion", is_flag=True, help="Compare the output_position of --simulation."
)
@click.option(
    "--out", required=True, metavar="DIR", help="Folder for comparison.json and report.html."
)
@target(required=False)
@click.option(
    "--simulated", is_flag=True, help="Drive the model forward and compare the motion instead."
)
@controller
@known_load
@lowpass
@bandwidth
@reading()
def compare(
    runs: tuple[str, ...],
    model_path: str | None,
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
    reading: Reading,
) -> None:
    """Say where a model, or any simulation, and runs disagree, and how far above the noise.

    Predicts the runs and sorts what is left (measured − predicted) by run, direction, speed,
    load, temperature, angle, order of what turns, acceleration, time, and distance from the last
    reversal; estimates the noise floor where it applies; and prints two sentences that say where
    the gap is largest and what makes no difference. It names no cause, and nothing is fitted.
    DIR receives comparison.json (all numbers) and report.html (the map).

    \b
    Examples:
      flexspline compare run3.csv run4.csv --model joint/model.json --out where
      flexspline compare run3.csv --model joint/model.json --lowpass 5 --out where
      flexspline compare run3.csv --model joint/model.json --simulated --out where
      flexspline compare run3.csv --target sensor_torque --simulated-torque mujoco --out where
      flexspline compare run3.csv --simulation made3.csv --simulated-motion --out where
    """
    from flexspline.comparison import compare as compare_runs
    from flexspline.forward import PositionServo
    from flexspline.model import Model

    foreign = bool(simulation) or simulated_torque is not None
    if model_path is None and not foreign:
        raise InputError(
            "give exactly one of --model MODEL.json and --simulation FILE or --simulated-torque "
            "COLUMN to compare with"
        )
    if model_path is None and target is None and not simulated_motion:
        raise InputError("--target is needed beside a simulated torque; say what it predicts")
    joint = None if model_path is None else Model.load(model_path)
    if joint is not None:
        joint.part(target)
    with whole_folder(out, last="comparison.json") as draft:
        column = None if simulation else simulated_torque
        logs = reading.logs(runs, joint.facts if joint else {}, column)
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
            controller=PositionServo.load(controller) if controller else None,
            progress=on_terminal(),
        )
        made.report(draft / "report.html")
        atomic_write(draft / "comparison.json", made.to_json())
        said = str(made)
    click.echo(f"{said}\n\nwrote {Path(out) / 'comparison.json'} and {Path(out) / 'report.html'}")
