"""`flexspline simulate`: a model driven forward from the inputs of a run."""

from __future__ import annotations

import click

from flexspline.cli.help import Taught, repairs
from flexspline.cli.options import controller, model, out_file, positive, reading, target
from flexspline.cli.runs import Reading, refuse_overwriting

__all__ = ["simulate"]


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv")
@model
@controller
@out_file("FILE.csv")
@target(required=False)
@click.option(
    "--steps",
    type=click.IntRange(1),
    metavar="N",
    help="Integration steps from row to row; without it as many as are needed.",
)
@click.option(
    "--horizon",
    type=positive,
    metavar="S",
    help="Seconds after which a drive begins anew from the measured state; without it never.",
)
@reading()
def simulate(
    run: str,
    model_path: str,
    controller: str | None,
    out: str,
    target: str | None,
    steps: int | None,
    horizon: float | None,
    reading: Reading,
) -> None:
    """Drive a model forward through a run, without looking at its measured motion.

    A drive starts at the first row's angle and velocity and moves as the motor torque, the load
    and its own friction, inertia, gravity and ripple make it: friction truly holds it at rest. With
    --controller the motor torque is that of a servo law, which reads the channel
    commanded_position. A torsion part gives the output's angle from the motor's, a sensor part its
    reading. FILE.csv receives the simulated channels, one row for each row of the run.

    \b
    servo.json, gains per rad at the output, torque at the motor's shaft:
      {"position_gain": 40.0, "velocity_gain": 1.5, "integral_gain": 0.0, "limit": 2.0,
       "torque": 1.0, "back_emf": 0.0, "encoder_step": 0.0015, "supply": false}

    \b
    Examples:
      flexspline simulate --model joint/model.json run3.csv --out motion.csv
      flexspline simulate --model joint/model.json run3.csv --controller servo.json --out motion.csv
    """
    from flexspline.forward import simulate as simulate_run
    from flexspline.model import Model

    refuse_overwriting(out, [run, model_path, *([controller] if controller else [])])
    joint = Model.load(model_path)
    joint.part(target)
    (log,) = reading.logs([run], joint.facts)
    made = simulate_run(
        joint, log, target=target, controller=controller, steps_per_sample=steps, horizon=horizon
    )
    made.save(out)
    click.echo(f"{made}\nwrote {out}")
