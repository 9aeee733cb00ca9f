"""`flexspline predict`: what a model says of a run, beside what was measured."""

from __future__ import annotations

import click

from flexspline.cli.help import Taught, repairs
from flexspline.cli.options import lowpass, model, out_file, reading, strict, target
from flexspline.cli.runs import Reading, refuse_overwriting, warn

__all__ = ["predict"]


@click.command(cls=Taught, sections=(repairs,))
@click.argument("run", metavar="RUN.csv")
@model
@out_file("FILE.csv")
@target(required=False)
@lowpass
@strict
@reading()
def predict(
    run: str,
    model_path: str,
    out: str,
    target: str | None,
    lowpass: float | None,
    strict: bool,
    reading: Reading,
) -> None:
    """Predict a run with a model, and subtract.

    FILE.csv receives the columns time, measured, predicted and residual, one row for each row
    of the run, in the unit of the target; measured and residual are empty where the run does
    not have them. Nothing is fitted.

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
    from flexspline.model import Model
    from flexspline.model_warnings import refuse_warnings

    refuse_overwriting(out, [run, model_path])
    joint = Model.load(model_path)
    part = joint.part(target)
    (log,) = reading.logs([run], joint.facts)
    found = joint.predict(log, part.target, lowpass_hz=lowpass)
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
