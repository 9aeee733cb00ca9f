"""`flexspline certify`: whether a device computes what the analysis promised, and what it costs."""

from __future__ import annotations

import click

from flexspline.cli.help import Taught, repairs
from flexspline.cli.options import model, out_file, reading, target
from flexspline.cli.runs import Reading, refuse_overwriting

__all__ = ["certify"]

DEVICES = ("host", "cortex-m4f", "cortex-m7")  # those of flexspline.certify, heavy to import


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv")
@model
@click.option(
    "--device",
    type=click.Choice(DEVICES),
    required=True,
    help="host: this machine; the others are compiled with arm-none-eabi-g++ and run by QEMU.",
)
@click.option(
    "--option",
    "options",
    multiple=True,
    metavar="-Os",
    help="Of the device's compiler, such as those of your firmware; default -O2. Can be repeated.",
)
@target(required=False)
@out_file("CERT.json")
@reading()
def certify(
    run: str,
    model_path: str,
    device: str,
    options: tuple[str, ...],
    target: str | None,
    out: str,
    reading: Reading,
) -> None:
    """Run the exported model on a device and compare each output with this machine's.

    CERT.json says whether all bits are the same, the largest difference (ULP, and the output's
    unit), what float costs against double, and what a step needs: instructions (counted), cycles
    (estimated), flash, RAM and stack. A model with estimators is certified as their chain, one
    without as the part of --target.

    \b
    Example:
      flexspline certify --model joint/model.json run3.csv --device cortex-m4f --out cert.json
    """
    from flexspline.certification import certify as run_on_device
    from flexspline.model import Model

    refuse_overwriting(out, [run, model_path])
    joint = Model.load(model_path)
    (log,) = reading.logs([run], joint.facts)
    made = run_on_device(joint, log, device, target=target, options=options or ("-O2",))
    made.save(out)
    click.echo(str(made))
    click.echo(f"wrote {out}")
