"""`flexspline predict`: what a model says of a run, beside what was measured."""

from __future__ import annotations

import click

from flexspline.cli.help import Taught, repairs
from flexspline.cli.options import lowpass, model, out_file, reading, simulation, strict, target
from flexspline.cli.runs import Reading, refuse_overwriting, simulations, warn
from flexspline.errors import InputError

__all__ = ["predict"]


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv")
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
    import numpy as np
    import pandas

    from flexspline.files import atomic_writer
    from flexspline.model import Model, refuse_warnings

    refuse_overwriting(out, [run, model_path, *simulation])
    joint = Model.load(model_path)
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
    with atomic_writer(out) as file:
        pandas.DataFrame(columns).to_csv(file, index=False, lineterminator="\n")
    warn(found.warnings)
    residual = found.residual[np.isfinite(found.residual)]
    rmse = np.sqrt(np.mean(residual**2)) if residual.size else np.nan
    gap = f"RMSE {rmse:.4g} {found.unit}" if residual.size else "nothing measured to compare with"
    click.echo(f"{log.name}: {part.target} of {len(log)} rows predicted, {gap}; wrote {out}")
