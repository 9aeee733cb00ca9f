"""`flexspline export` and `flexspline certify`: a model for a controller or a simulator.

`certify` compares the device's results with the analysis, and measures their cost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from flexspline.cli.options import (
    FILE,
    Command,
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
    simulation,
    simulations,
    strict,
    target,
    warn,
)
from flexspline.cli.predict import require_simulations
from flexspline.cli.speech import found, is_json, say

if TYPE_CHECKING:
    from flexspline.exporting.coupling import Coupling
    from flexspline.exporting.plain_joint import PlainJoint
    from flexspline.logs.log import Log
    from flexspline.model import Model
from flexspline.errors import InputError

__all__ = [
    "certify",
    "export",
]


def _formats() -> Iterable[str]:
    from flexspline.exporting import FORMATS

    return FORMATS


def _devices() -> Iterable[str]:
    from flexspline.certification.program import DEVICES

    return DEVICES


def _one_of(
    *names: str, among: Callable[[], Iterable[str]], says: str
) -> Callable[[Command], Command]:
    """An option that has to be given, one of the names that `among` returns."""
    return click.option(*names, type=LateChoice(among), required=True, help=says)


def _listed() -> tuple[str, list[tuple[str, str]]]:
    from flexspline.exporting import EXPORTS

    return "Formats in which a model leaves", [(name, e.says) for name, e in EXPORTS.items()]


@click.command(cls=Taught, sections=(_listed, repairs))
@click.argument("runs", nargs=-1, metavar="[RUN.csv...]", type=FILE)
@model
@model_joint
@_one_of("--format", "form", among=_formats, says="In which the model leaves; each is told below.")
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
@click.option(
    "--dcmotor/--no-dcmotor",
    default=None,
    help="Whether passive dcmotors of an MJCF file take Stribeck's and presliding friction and "
    "ripple; by default where the MuJoCo of this Python has them, from 4 on.",
)
@out_file("FILE_OR_DIR", "File to write, or the folder that some formats are; whole or not at all.")
@target(required=False)
@simulation
@strict
@reading()
def export(
    runs: tuple[str, ...],
    simulation: tuple[str, ...],
    simulated_torque: str | None,
    model_path: str,
    model_joint: str | None,
    form: str,
    scalar: str,
    compiles: bool,
    dcmotor: bool | None,
    out: str,
    target: str | None,
    strict: bool,
    reading: Reading,
) -> None:
    """Export a model for the controller or a simulator.

    The formats are listed below. Where runs are given, the file of a simulator's joint says what it
    leaves out on these too, and the command prints it.

    Standard error says what speaks against using the model: inertia or friction of a drive that is
    negative, terms that are not significant, parameters at a bound.

    \b
    Examples:
      flexspline export --model joint/model.json --format header --out joint.hpp
      flexspline export --model joint/model.json --format fmu --out joint.fmu
      flexspline export --model joint/model.json --format mujoco --out joint.xml
      flexspline export --model joint/model.json --format mujoco --out joint.xml run1.csv run2.csv
      flexspline export --model joint/model.json --format mujoco-plugin --compile --out elbow
    """
    from flexspline.exporting import (
        FOLDERS,
        JOINTS,
        WITH_MOTORS,
        export_warnings,
        joint_of,
        mujoco_plugin,
        namespace_of,
        plugins_of,
    )
    from flexspline.exporting import export as export_model

    files = FOLDERS[form](namespace_of(out)) if form in FOLDERS else ()
    if compiles and not files:
        raise InputError(f"--compile is for --format {' or '.join(FOLDERS)}; leave it out")
    if dcmotor is not None and form != WITH_MOTORS:
        said = "dcmotor" if dcmotor else "no-dcmotor"
        raise InputError(f"--{said} is for --format {WITH_MOTORS}; leave it out")
    refuse_overwriting(out, [*runs, *simulation, model_path], files)
    joint = loaded(model_path, target, model_joint or reading.joint)
    logs: Sequence[Log] = ()
    if runs or simulation:
        part = joint.part(target)
        require_simulations(model_path, part, runs, simulation, simulated_torque)
        logs = _runs(reading, runs, joint, part.target, simulation, simulated_torque)
    if compiles and not logs:
        mujoco_plugin(joint, out, target, strict)
    else:
        export_model(joint, out, form, target, scalar, strict, logs, dcmotor)
    warnings = export_warnings(joint, target)
    found({"format": form, "warnings": warnings})
    warn(warnings)
    if form in JOINTS and (runs or is_json()):
        _tell_losses(joint_of(joint, form, target, logs, dcmotor))
    if files:
        _tell_stiffness(plugins_of(joint, target).coupling)
    alone = [
        f"; for {part.target} it is the correction alone: add what the simulation says"
        for part in joint.parts.values()
        if part.simulated is not None and target in (None, part.target)
    ]
    say(f"wrote {out}{''.join(alone)}")


def _runs(
    reading: Reading,
    runs: Sequence[str],
    joint: Model,
    target: str,
    files: Sequence[str],
    column: str | None,
) -> list[Log]:
    """Read runs, and what a simulation says of them where a model corrects one."""
    logs = reading.logs(runs, joint.facts, None if files else column)
    says = simulations(files, column)
    if says is None:
        return logs
    from flexspline.simulator import paired, with_simulation

    pairs = zip(logs, paired(logs, says), strict=True)
    return [with_simulation(log, target, one, column)[0] for log, one in pairs]


def _tell_stiffness(coupling: Coupling | None) -> None:
    """Say how stiff a gear between two hinges is, and what that means for a timestep."""
    if coupling is None:
        return
    found({"stiffness": coupling.stiffness})
    say(
        f"the gear is up to {coupling.stiffness:.3g} Nm/rad stiff at the output; MuJoCo's timestep "
        f"has to be below {2.0 / coupling.stiffness**0.5:.2g} s / sqrt(1/J_motor + 1/J_link), "
        "inertias in kg m^2 at the output, better a tenth of that"
    )


def _tell_losses(joint: PlainJoint) -> None:
    """Print what a joint costs on runs, and say what it leaves out to who asked for JSON."""
    losses: list[dict[str, Any]] = [
        {"effect": loss.effect, "largest": loss.torque, "rms": loss.rms, "why": loss.why}
        for loss in joint.lost
    ]
    found({"kept": joint.kept, "lost": losses, "dcmotors": len(joint.motors)})
    if joint.on_runs is not None:
        from flexspline.exporting.plain_joint import losses_text, runs_text

        found({"on_runs": asdict(joint.on_runs)})
        say("\n".join([*losses_text(joint), "", *runs_text(joint.on_runs, joint.target), ""]))


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv", type=FILE)
@model
@_one_of(
    "--device",
    among=_devices,
    says="host: this machine; the others are compiled with arm-none-eabi-g++ and run by QEMU.",
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
