"""`flexspline estimate`: what the production chain makes of a run."""

from __future__ import annotations

import click

from flexspline.cli.help import Taught, repairs
from flexspline.cli.options import model, out_file, positive, reading
from flexspline.cli.runs import Reading, refuse_overwriting

__all__ = ["estimate"]


def _bits() -> tuple[str, list[tuple[str, str]]]:
    """Every bit of the status column."""
    from flexspline.estimation.status import MEANING

    return "Status, a sum of", [(str(int(bit)), meaning) for bit, meaning in MEANING.items()]


@click.command(cls=Taught, sections=(_bits, repairs))
@click.argument("run", metavar="RUN.csv")
@model
@out_file("FILE.csv")
@click.option(
    "--bandwidth",
    type=positive,
    metavar="HZ",
    help="Of the velocity that is derived where run and model have none; default 20.",
)
@reading()
def estimate(
    run: str, model_path: str, out: str, bandwidth: float | None, reading: Reading
) -> None:
    """Run the model's estimators over a run, sample by sample, as the joint would.

    FILE.csv receives time, temperature, sensor_torque (compensated) and external_torque_sensor;
    external_torque_observer, _compliance, _compliant_observer and _merged and contact where the
    model holds the estimator; and status. One row for each row of the run, torques in Nm at the
    output, positive where the joint pushes in the positive direction. A value is empty where
    its stage had nothing to work with; status says which.

    \b
    Example:
      flexspline estimate --model joint/model.json run3.csv --out external.csv
    """
    from flexspline.estimation import estimate as run_chain
    from flexspline.model import Model

    refuse_overwriting(out, [run, model_path])
    joint = Model.load(model_path)
    (log,) = reading.logs([run], joint.facts)
    made = run_chain(joint, log, bandwidth=bandwidth)
    made.save(out)
    click.echo(str(made))
    click.echo(f"wrote {out}")
