"""`flexspline predict`, `flexspline estimate` and `flexspline simulate`: a model applied to runs.

`predict` compares the model with the measured target, `estimate` runs the production chain, and
`simulate` drives the model forward from the inputs of the run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flexspline.cli.options import (
    FILE,
    Reading,
    Taught,
    controller,
    files_in,
    files_of,
    loaded,
    lowpass,
    model,
    model_joint,
    out_file,
    out_files,
    positive,
    reading,
    refuse_overwriting,
    repairs,
    simulation,
    simulations,
    speed_above,
    strict,
    target,
    warn,
)
from flexspline.cli.speech import found, say
from flexspline.errors import InputError, listed
from flexspline.files import whole_folder

if TYPE_CHECKING:
    from flexspline.estimation import Estimate
    from flexspline.model import Part, Prediction

__all__ = [
    "estimate",
    "predict",
    "require_simulations",
    "simulate",
]


def _of_joint(content: Mapping[str, Any]) -> dict[str, Any]:
    """What a prediction says of one joint."""
    return {"rmse": content["rmse"], "rmse_unit": content["unit"], "rows": content["rows"]}


@click.command(cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@model
@model_joint
@out_files
@target(required=False)
@lowpass
@speed_above
@simulation
@strict
@reading(each_joint=_of_joint)
def predict(
    runs: tuple[str, ...],
    model_path: str,
    model_joint: str | None,
    simulation: tuple[str, ...],
    simulated_torque: str | None,
    out: str,
    target: str | None,
    lowpass: float | None,
    speed_above: float | None,
    strict: bool,
    reading: Reading,
) -> None:
    """Predict runs with a model, and subtract.

    FILE.csv receives the columns time, measured, predicted and residual, one row for each row
    of the run, in the unit of the target; measured and residual are empty where the run does
    not have them. Nothing is fitted. A model that corrects a simulation asks for what that says.
    Of several runs a folder receives a file for each, named after the run's, and a table says the
    error of each run, the pooled one over all their rows, and the worst run.

    Standard error says what speaks against the prediction: rows outside of what the model was
    fitted to; damping, inertia or friction of a drive that is negative, terms that are not
    significant, parameters at a bound.

    \b
    Examples:
      flexspline predict --model joint/model.json run3.csv --out residual.csv
      flexspline predict --model joint/model.json run3.csv run4.csv --speed-above 0.02 --out new
      flexspline predict --model 'robot/joint_{joint}/model.json' robot.csv --columns map.toml \\
          --joint all --out new
    """
    names = files_in(out, runs, [model_path, *simulation], cut=reading.splits)
    joint = loaded(model_path, target, model_joint or reading.joint)
    part = joint.part(target)
    if simulation:
        reading.refuse_cut("--simulation is given a file for each run")
    require_simulations(model_path, part, runs, simulation, simulated_torque)
    logs = reading.logs(runs, joint.facts, None if simulation else simulated_torque)
    if reading.splits:
        names = files_of(out, logs, [*runs, model_path])
    files = simulations(simulation, simulated_torque)

    from flexspline.model import refuse_warnings

    made = joint.predict(
        logs,
        part.target,
        lowpass_hz=lowpass,
        simulation=files,
        simulated_torque=simulated_torque,
        speed_above=speed_above,
    )
    if strict:
        refuse_warnings(made.warnings)
    _save(made.runs, out, names)
    warn(made.warnings)
    errors = {"target": made.target, "unit": made.unit, "rmse": made.rmse, "rows": made.rows}
    runs_of = [{"run": one.name, "rmse": one.rmse, "rows": one.rows} for one in made.runs]
    found({**errors, "runs": runs_of, "warnings": made.warnings})
    say(f"{made}\n\n{_wrote(out, names)}" if names else f"{_told(made[0])}; wrote {out}")


def require_simulations(
    model_path: str,
    part: Part,
    runs: Sequence[str],
    simulation: Sequence[str],
    simulated_torque: str | None,
) -> None:
    """Refuse a part that corrects a simulation without one, and another number of them."""
    if part.simulated is not None and not simulation and simulated_torque is None:
        raise InputError(
            f"{model_path}: the part for {part.target} corrects what a simulation says "
            f"({part.simulated.words}); {part.simulated.asked}"
        )
    if simulation and len(simulation) != len(runs):
        count = f"{len(simulation)} time{'' if len(simulation) == 1 else 's'}"
        wanted = "the run" if len(runs) == 1 else f"each of the {len(runs)} runs, in their order"
        raise InputError(f"--simulation is given {count}; give one for {wanted}")


def _save(made: Sequence[Prediction | Estimate], out: str, names: Sequence[str]) -> None:
    """Write the table of each run: into a folder by these names, or of one run without to a file.

    Without names there is one.
    """
    if not names:
        made[0].save(out)
        return
    with whole_folder(out) as draft:
        for one, name in zip(made, names, strict=True):
            one.save(draft / name)


def _wrote(out: str, names: Sequence[str]) -> str:
    return f"wrote {listed(names)} to {Path(out)}"


def _told(found: Prediction) -> str:
    """The error of one run in a sentence."""
    gap = "nothing measured to compare with"
    if found.rows:
        gap = f"RMSE {found.rmse:.4g} {found.unit}"
        if found.speed_above is not None:
            gap += (
                f" over {found.rows} rows at {found.speed_above:g} rad/s or more "
                f"({found.slow_rows} slower ones left out)"
            )
    return f"{found.name}: {found.target} of {len(found.time)} rows predicted, {gap}"


def _bits() -> tuple[str, list[tuple[str, str]]]:
    """Every bit of the status column."""
    from flexspline.estimation import MEANING

    return "Status, a sum of", [(str(int(bit)), meaning) for bit, meaning in MEANING.items()]


@click.command(cls=Taught, sections=(_bits, repairs))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@model
@out_files
@click.option(
    "--bandwidth",
    type=positive,
    metavar="HZ",
    help="Of the velocity that is derived where run and model have none; default 20.",
)
@speed_above
@strict
@reading()
def estimate(
    runs: tuple[str, ...],
    model_path: str,
    out: str,
    bandwidth: float | None,
    speed_above: float | None,
    strict: bool,
    reading: Reading,
) -> None:
    """Run the model's estimators over runs, sample by sample, as the joint would.

    FILE.csv receives time, temperature, sensor_torque (calibrated and compensated for temperature;
    ripple, friction and the link's own torques are still in it) and external_torque_sensor (the
    same less all that the model's sensor part tells); external_torque_observer, _compliance,
    _compliant_observer and _merged and contact where the model holds the estimator; status; and
    the coefficients that an adaptation learns, by their names. One row for each row of the run,
    torques in Nm at the output, positive where the joint pushes in the positive direction. A value
    is empty where its stage had nothing to work with; status says which. Of several runs a folder
    receives a file for each, named after the run's; where runs have a reference_torque a table
    says the error of each external torque beside it, by run and pooled.

    What makes the estimates wrong is said below the table: rows outside of what a part of the
    model was fitted to, as predict says them; a velocity derived where the detector's thresholds
    were calibrated with a recorded one. --strict refuses that, and rows outside of what the model
    was made for: status 1, 2 and 262144.

    \b
    Examples:
      flexspline estimate --model joint/model.json run3.csv --out external.csv
      flexspline estimate --model joint/model.json run3.csv run4.csv --out external
    """
    names = files_in(out, runs, [model_path], cut=reading.splits)
    joint = loaded(model_path)
    logs = reading.logs(runs, joint.facts)
    if reading.splits:
        names = files_of(out, logs, [*runs, model_path])

    from flexspline.estimation import estimate as run_chain

    made = run_chain(joint, logs, bandwidth=bandwidth, speed_above=speed_above)
    if strict:
        from flexspline.model import refuse_warnings

        refuse_warnings([said for one in made for said in one.warnings])
    _save(made.runs, out, names)
    found({"unit": "Nm", "rmse": made.rmse, "runs": [one.name for one in made.runs]})
    shown = made[0] if speed_above is None else made
    say(f"{made}\n\n{_wrote(out, names)}" if names else f"{shown}\nwrote {out}")


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv", type=FILE)
@model
@model_joint
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
    model_joint: str | None,
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
    refuse_overwriting(out, [run, model_path, *([controller] if controller else [])])
    joint = loaded(model_path, target, model_joint or reading.joint)
    joint.part(target)
    log = reading.one(run, joint.facts)

    from flexspline.forward import simulate as simulate_run

    made = simulate_run(
        joint, log, target=target, controller=controller, steps_per_sample=steps, horizon=horizon
    )
    made.save(out)
    found({"channel": made.channel, "unit": made.unit, "rmse": made.rmse, "rows": len(made.log)})
    say(f"{made}\nwrote {out}")
