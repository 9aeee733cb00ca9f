"""`flexspline compare`: where a model and runs disagree."""

from __future__ import annotations

from pathlib import Path

import click

from flexspline.cli.help import Taught, repairs
from flexspline.cli.options import controller, lowpass, model, reading, target
from flexspline.cli.runs import Reading, on_terminal
from flexspline.files import atomic_write, whole_folder

__all__ = ["compare"]


@click.command(cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...")
@model
@click.option(
    "--out", required=True, metavar="DIR", help="Folder for comparison.json and report.html."
)
@target(required=False)
@click.option(
    "--simulated", is_flag=True, help="Drive the model forward and compare the motion instead."
)
@controller
@lowpass
@reading()
def compare(
    runs: tuple[str, ...],
    model_path: str,
    out: str,
    target: str | None,
    simulated: bool,
    controller: str | None,
    lowpass: float | None,
    reading: Reading,
) -> None:
    """Say where a model and runs disagree, and how far above the noise.

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
    """
    from flexspline.comparison import compare as compare_runs
    from flexspline.forward import PositionServo
    from flexspline.model import Model

    joint = Model.load(model_path)
    joint.part(target)
    with whole_folder(out, last="comparison.json") as draft:
        logs = reading.logs(runs, joint.facts)
        made = compare_runs(
            joint,
            logs,
            target=target,
            lowpass=lowpass,
            simulated=simulated,
            controller=PositionServo.load(controller) if controller else None,
            progress=on_terminal(),
        )
        made.report(draft / "report.html")
        atomic_write(draft / "comparison.json", made.to_json())
        said = str(made)
    click.echo(f"{said}\n\nwrote {Path(out) / 'comparison.json'} and {Path(out) / 'report.html'}")
