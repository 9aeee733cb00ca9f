"""`flexspline export`: a model in the form that a controller takes."""

from __future__ import annotations

import click

from flexspline.cli.options import model, out_file, strict, target
from flexspline.cli.runs import refuse_overwriting, warn

__all__ = ["FORMATS", "export"]

FORMATS = ("header", "binary", "json")  # those of flexspline.export, which takes long to import


@click.command()
@model
@click.option(
    "--format",
    "form",
    type=click.Choice(FORMATS),
    required=True,
    help="header: constants that a C++ program compiles with the core's headers; binary: "
    "parameters that replace those of such a program while it runs.",
)
@click.option(
    "--scalar",
    type=click.Choice(("float", "double")),
    default="float",
    show_default=True,
    help="Numbers of a binary block, as the program was compiled.",
)
@out_file("FILE")
@target(required=False)
@strict
def export(
    model_path: str, form: str, scalar: str, out: str, target: str | None, strict: bool
) -> None:
    """Export a model for the controller.

    The header holds plain constants and compiles with flexspline's headers (C++20, no heap, no
    exceptions); it predicts the same numbers as flexspline predict. The binary block is checked by
    its length, version, CRC-32 and structure before a program takes it, whole or not at all.

    Standard error says what speaks against using the model: damping, inertia or friction of a drive
    that is negative, terms that are not significant, parameters at a bound.

    \b
    Example:
      flexspline export --model joint/model.json --format header --out joint.hpp
    """
    from flexspline.exporting import export as export_model
    from flexspline.exporting import export_warnings
    from flexspline.model import Model

    refuse_overwriting(out, [model_path])
    joint = Model.load(model_path)
    export_model(joint, out, format=form, target=target, scalar=scalar, strict=strict)
    warn(export_warnings(joint, target))
    alone = [
        f"; for {part.target} it is the correction alone: add what the simulation says"
        for part in joint.parts.values()
        if part.simulated is not None and target in (None, part.target)
    ]
    click.echo(f"wrote {out}{''.join(alone)}")
