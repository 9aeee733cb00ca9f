"""`flexspline compare-models`: several models of one target side by side on the same runs."""

from __future__ import annotations

from pathlib import Path

import click

from flexspline.cli.options import (
    FILE,
    Reading,
    Taught,
    is_table,
    loaded,
    lowpass,
    reading,
    refuse_overwriting,
    repairs,
    target,
)
from flexspline.cli.speech import found, say
from flexspline.errors import InputError
from flexspline.files import save_table, whole_folder

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
@click.option(
    "--out",
    metavar="FILE.csv|DIR",
    type=FILE,
    help="Table, a row for each model; or a folder for models.csv, models.png and report.html.",
)
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
      flexspline compare-models run3.csv --model a.json --model b.json --out side_by_side
    """
    for path in paths:
        if paths.count(path) > 1:
            raise InputError(f"--model {path} is given twice; give each model once")
    if len(paths) < 2:
        raise InputError("one --model is nothing to compare; give two or more")
    joints = {path: loaded(path, target) for path in paths}
    if out is not None:
        written = () if is_table(out) else ("models.csv", "models.png", "report.html")
        refuse_overwriting(out, [*runs, *paths], written)
    logs = reading.logs(runs, joints[paths[0]].facts)

    from flexspline.comparison.models import compare_models

    made = compare_models(joints, logs, target=target, lowpass=lowpass)
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
    say(str(made))
    if out is None:
        return
    table = made.to_frame().drop(columns=["aic", "bic"]).reset_index()  # these are of fits alone
    if is_table(out):
        save_table(table, out)
        say(f"\nwrote {out}")
        return
    with whole_folder(out, last="models.csv") as draft:
        made.plot().savefig(draft / "models.png", dpi=110)
        made.report(draft / "report.html")
        save_table(table, draft / "models.csv")
    say(f"\nwrote models.csv, models.png and report.html to {Path(out)}")
