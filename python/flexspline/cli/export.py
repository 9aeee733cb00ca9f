"""`flexspline export`: a model in the form that a controller takes."""

from __future__ import annotations

import click

from flexspline.cli.options import model, out_file, target
from flexspline.cli.runs import refuse_overwriting

__all__ = ["FORMATS", "export"]

FORMATS = ("header", "json")  # those of flexspline.export, which takes long to import


@click.command()
@model
@click.option(
    "--format",
    "form",
    type=click.Choice(FORMATS),
    required=True,
    help="header: constants that a C++ program compiles with the core's headers.",
)
@out_file("FILE")
@target(required=False)
def export(model_path: str, form: str, out: str, target: str | None) -> None:
    """Export a model for the controller.

    The header holds plain constants and compiles with flexspline's headers (C++20, no heap, no
    exceptions); it predicts the same numbers as flexspline predict.

    \b
    Example:
      flexspline export --model joint/model.json --format header --out joint.hpp
    """
    from flexspline.export import export as export_model
    from flexspline.model import Model

    refuse_overwriting(out, [model_path])
    export_model(Model.load(model_path), out, format=form, target=target)
    click.echo(f"wrote {out}")
