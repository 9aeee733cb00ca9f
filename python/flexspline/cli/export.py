"""`flexspline export` and `flexspline certify`: a model for a controller or a simulator.

`certify` compares the device's results with the analysis, and measures their cost.
"""

from __future__ import annotations

from collections.abc import Iterable

import click

from flexspline.cli.options import (
    FILE,
    LateChoice,
    Reading,
    Taught,
    loaded,
    model,
    model_joint,
    out_file,
    reading,
    refuse_overwriting,
    repairs,
    strict,
    target,
    warn,
)
from flexspline.cli.speech import found, say
from flexspline.errors import InputError

__all__ = [
    "certify",
    "export",
]


def _formats() -> Iterable[str]:
    from flexspline.exporting import FORMATS

    return FORMATS


def _devices() -> Iterable[str]:
    from flexspline.certification.devices import DEVICES

    return DEVICES


@click.command()
@model
@model_joint
@click.option(
    "--format",
    "form",
    type=LateChoice(_formats),
    required=True,
    help="header: constants that a C++ program compiles with the core's headers; binary: "
    "parameters that replace those of such a program while it runs; json: the model file; mujoco, "
    "urdf: a joint of an MJCF file or a URDF; mujoco-plugin: a folder with the sources of an "
    "engine plugin.",
)
@click.option(
    "--scalar",
    type=click.Choice(("float", "double")),
    default="float",
    show_default=True,
    help="Numbers of a binary block, as the program was compiled.",
)
@click.option(
    "--compile",
    "compiles",
    is_flag=True,
    help="Compile the plugin too, with $CXX or c++ and the MuJoCo of this Python.",
)
@out_file("FILE_OR_DIR", "File to write, of mujoco-plugin a folder; whole or not at all.")
@target(required=False)
@strict
def export(
    model_path: str,
    model_joint: str | None,
    form: str,
    scalar: str,
    compiles: bool,
    out: str,
    target: str | None,
    strict: bool,
) -> None:
    """Export a model for the controller or a simulator.

    The header holds plain constants and compiles with flexspline's headers (C++20, no heap, no
    exceptions); it predicts the same numbers as flexspline predict. The binary block is checked by
    its length, version, CRC-32 and structure before a program takes it, whole or not at all.

    A MuJoCo joint has armature, damping and frictionloss of the model, that of a URDF damping,
    friction and limits, in SI units at the output of the gear. A comment above it lists the effects
    that it leaves out, each with its largest torque over the ranges of the fit.

    A MuJoCo plugin leaves out none of the joint's torques: it is the passive force of a joint by
    the same C++ code, load, angle, direction and memory included. Its folder has the sources, the
    line that builds them, and an MJCF file to copy from.

    Standard error says what speaks against using the model: inertia or friction of a drive that is
    negative, terms that are not significant, parameters at a bound.

    \b
    Examples:
      flexspline export --model joint/model.json --format header --out joint.hpp
      flexspline export --model joint/model.json --format mujoco --out joint.xml
      flexspline export --model joint/model.json --format mujoco-plugin --compile --out elbow
    """
    from flexspline.exporting import FOLDERS, export_warnings, mujoco_plugin, namespace_of
    from flexspline.exporting import export as export_model

    files = FOLDERS[form](namespace_of(out)) if form in FOLDERS else ()
    if compiles and not files:
        raise InputError(f"--compile is for --format {' or '.join(FOLDERS)}; leave it out")
    refuse_overwriting(out, [model_path], files)
    joint = loaded(model_path, target, model_joint)
    if compiles:
        mujoco_plugin(joint, out, target, strict)
    else:
        export_model(joint, out, format=form, target=target, scalar=scalar, strict=strict)
    warnings = export_warnings(joint, target)
    found({"format": form, "warnings": warnings})
    warn(warnings)
    alone = [
        f"; for {part.target} it is the correction alone: add what the simulation says"
        for part in joint.parts.values()
        if part.simulated is not None and target in (None, part.target)
    ]
    say(f"wrote {out}{''.join(alone)}")


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv", type=FILE)
@model
@click.option(
    "--device",
    type=LateChoice(_devices),
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
    refuse_overwriting(out, [run, model_path])
    joint = loaded(model_path)
    log = reading.one(run, joint.facts)

    from flexspline.certification import certify as run_on_device

    made = run_on_device(joint, log, device, target=target, options=options or ("-O2",))
    made.save(out)
    found(made.to_json())
    say(str(made))
    say(f"wrote {out}")
