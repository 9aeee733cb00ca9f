"""`flexspline predict`, `flexspline estimate` and `flexspline simulate`: a model applied to runs.

`predict` compares the model with the measured target, `estimate` runs the production chain, and
`simulate` drives the model forward from the inputs of the run.
"""

from __future__ import annotations

import click

from flexspline.cli.options import (
    FILE,
    Reading,
    Taught,
    controller,
    loaded,
    lowpass,
    model,
    out_file,
    positive,
    reading,
    refuse_overwriting,
    repairs,
    simulation,
    simulations,
    strict,
    target,
    warn,
)
from flexspline.errors import InputError

__all__ = [
    "estimate",
    "predict",
    "simulate",
]


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv", type=FILE)
@model
@out_file("FILE.csv")
@target(required=False)
@lowpass
@simulation
@strict
@reading()
def predict(
    run: str,
    model_path: str,
    simulation: tuple[str, ...],
    simulated_torque: str | None,
    out: str,
    target: str | None,
    lowpass: float | None,
    strict: bool,
    reading: Reading,
) -> None:
    """Predict a run with a model, and subtract.

    FILE.csv receives the columns time, measured, predicted and residual, one row for each row
    of the run, in the unit of the target; measured and residual are empty where the run does
    not have them. Nothing is fitted. A model that corrects a simulation asks for what that says.

    Standard error says what speaks against the prediction: rows outside of what the model was
    fitted to; damping, inertia or friction of a drive that is negative, terms that are not
    significant, parameters at a bound.

    \b
    Example:
      flexspline predict --model joint/model.json run3.csv --out residual.csv
    """
    refuse_overwriting(out, [run, model_path, *simulation])
    joint = loaded(model_path)
    part = joint.part(target)
    foreign = bool(simulation) or simulated_torque is not None
    if part.simulated is not None and not foreign:
        raise InputError(
            f"{model_path}: the part for {part.target} corrects what a simulation says "
            f"({part.simulated.words}); {part.simulated.asked}"
        )
    if len(simulation) > 1:
        raise InputError(f"--simulation is given {len(simulation)} times; give one for the run")
    (log,) = reading.logs([run], joint.facts, None if simulation else simulated_torque)
    files = simulations(simulation, simulated_torque)

    import numpy as np
    import pandas

    from flexspline.files import save_table
    from flexspline.model import refuse_warnings

    found = joint.predict(
        log,
        part.target,
        lowpass_hz=lowpass,
        simulation=files[0] if files else None,
        simulated_torque=simulated_torque,
    )
    if strict:
        refuse_warnings(found.warnings)
    columns = {name: getattr(found, name) for name in ("time", "measured", "predicted", "residual")}
    save_table(pandas.DataFrame(columns), out)
    warn(found.warnings)
    residual = found.residual[np.isfinite(found.residual)]
    rmse = np.sqrt(np.mean(residual**2)) if residual.size else np.nan
    gap = f"RMSE {rmse:.4g} {found.unit}" if residual.size else "nothing measured to compare with"
    click.echo(f"{log.name}: {part.target} of {len(log)} rows predicted, {gap}; wrote {out}")


def _bits() -> tuple[str, list[tuple[str, str]]]:
    """Every bit of the status column."""
    from flexspline.estimation.result import MEANING

    return "Status, a sum of", [(str(int(bit)), meaning) for bit, meaning in MEANING.items()]


@click.command(cls=Taught, sections=(_bits, repairs))
@click.argument("run", metavar="RUN.csv", type=FILE)
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
    refuse_overwriting(out, [run, model_path])
    joint = loaded(model_path)
    (log,) = reading.logs([run], joint.facts)

    from flexspline.estimation import estimate as run_chain

    made = run_chain(joint, log, bandwidth=bandwidth)
    made.save(out)
    click.echo(str(made))
    click.echo(f"wrote {out}")


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv", type=FILE)
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
    refuse_overwriting(out, [run, model_path, *([controller] if controller else [])])
    joint = loaded(model_path)
    joint.part(target)
    (log,) = reading.logs([run], joint.facts)

    from flexspline.forward import simulate as simulate_run

    made = simulate_run(
        joint, log, target=target, controller=controller, steps_per_sample=steps, horizon=horizon
    )
    made.save(out)
    click.echo(f"{made}\nwrote {out}")
