"""`flexspline compare-models`: several models of one target side by side on the same runs."""

from __future__ import annotations

from pathlib import Path

import click

from flexspline.cli.options import (
    FILE,
    Reading,
    Taught,
    loaded,
    lowpass,
    reading,
    refuse_overwriting,
    repairs,
    target,
)
from flexspline.cli.speech import found, say
from flexspline.errors import InputError
from flexspline.files import save_table

__all__ = ["models"]


@click.command("compare-models", cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@click.option(
    "--model",
    "paths",
    multiple=True,
    required=True,
    metavar="MODEL.json",
    type=FILE,
    help="A model to compare; give two or more.",
)
@click.option("--out", metavar="FILE.csv", type=FILE, help="The table, a row for each model.")
@target(required=False)
@lowpass
@reading()
def models(
    runs: tuple[str, ...],
    paths: tuple[str, ...],
    out: str | None,
    target: str | None,
    lowpass: float | None,
    reading: Reading,
) -> None:
    """Compare models of one target on the same rows of the same runs.

    Prints the RMSE of each model by run and of all rows, and marks the lowest, and the errors of
    runs that a model was fitted to: these are too low to be compared. Nothing is fitted.

    \b
    Examples:
      flexspline compare-models run3.csv run4.csv --model before.json --model after.json
      flexspline compare-models run3.csv --model a.json --model b.json --out errors.csv
    """
    for path in paths:
        if paths.count(path) > 1:
            raise InputError(f"--model {path} is given twice; give each model once")
    if len(paths) < 2:
        raise InputError("one --model is nothing to compare; give two or more")
    joints = {path: loaded(path) for path in paths}
    if out is not None:
        refuse_overwriting(out, [*runs, *paths])
    logs = reading.logs(runs, joints[paths[0]].facts)

    from flexspline.comparison.models import compare_models

    made = compare_models(joints, logs, target=target, lowpass=lowpass)
    frame = made.to_frame().drop(columns=["aic", "bic"])  # of fits alone
    if out is not None:
        save_table(frame.reset_index(), out)
    found(
        {
            "target": made.target,
            "unit": made.unit,
            "rows": made.rows,
            "runs": [run.log.name for run in made.runs],
            "models": [
                {"model": name, "rmse": errors[-1], "rmse_by_run": errors[:-1], "kind": kind}
                for name, errors, kind in zip(
                    made.names, made.errors().T.tolist(), made.kinds()[-1], strict=True
                )
            ],
            "notes": made.notes,
        }
    )
    wrote = [] if out is None else [f"wrote {Path(out)}"]
    say("\n\n".join([str(made), *wrote]))
