"""`flexspline calibrate`: voltage, temperature and a reference to a calibration and a report."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from flexspline.cli.options import (
    FILE,
    Reading,
    Taught,
    loaded,
    positive,
    reading,
    refuse_overwriting,
    repairs,
)
from flexspline.cli.speech import found, say
from flexspline.files import whole_folder

__all__ = ["command"]

NO_REFERENCE = "none"
FIT = "fit"
CONSTANTS = (
    "supply_voltage", "divider_resistance", "nominal_resistance", "beta", "nominal_temperature",
)  # fmt: skip


def _number_or_fit(ctx: click.Context, param: click.Parameter, text: str) -> float | str:
    """Read a number, or the word that asks for a fit."""
    if text == FIT:
        return text
    try:
        return float(text)
    except ValueError:
        raise click.BadParameter(f"'{text}' is no number and not '{FIT}'", ctx, param) from None


def _thermistor(
    ctx: click.Context, param: click.Parameter, text: str | None
) -> dict[str, float] | None:
    """Read SUPPLY:DIVIDER:NOMINAL:BETA[:TEMPERATURE]."""
    if text is None:
        return None
    try:
        values = [float(part) for part in text.split(":")]
    except ValueError:
        values = []
    if len(values) not in (4, 5):
        raise click.BadParameter(
            f"'{text}' is not written SUPPLY:DIVIDER:NOMINAL:BETA, in V, Ω, Ω, K", ctx, param
        )
    return dict(zip(CONSTANTS, values, strict=False))


@click.command("calibrate", cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@click.option(
    "--out", required=True, metavar="DIR", type=FILE, help="Folder for model.json and report.html."
)
@click.option(
    "--reference",
    default="reference_torque",
    show_default=True,
    metavar="CHANNEL",
    help="The trusted torque; none where all runs are without load.",
)
@click.option(
    "--into", metavar="MODEL.json", type=FILE, help="Add the estimators to a model of this joint."
)
@click.option(
    "--degree",
    type=click.IntRange(0, 6),
    default=2,
    show_default=True,
    metavar="N",
    help="Of the drift's polynomial in temperature; 0 leaves temperature out.",
)
@click.option(
    "--reference-temperature",
    type=float,
    default=25.0,
    show_default=True,
    metavar="T0",
    help="°C, where the compensation is zero.",
)
@click.option(
    "--thermal-lag",
    default="0",
    show_default=True,
    metavar="S|fit",
    callback=_number_or_fit,
    help="Lag of the elastic body behind the thermometer, s.",
)
@click.option(
    "--gradient",
    default="0",
    show_default=True,
    metavar="G|fit",
    callback=_number_or_fit,
    help="Nm per K that body and thermometer differ by; needs a lag.",
)
@click.option(
    "--thermistor",
    metavar="VCC:RD:RN:B[:TN]",
    callback=_thermistor,
    help="Divider of runs with thermistor_voltage: supply V, divider Ω, nominal Ω, beta K, °C.",
)
@click.option(
    "--sensitivity", type=float, metavar="K", help="Nm/V, where it is known and not to be fitted."
)
@click.option(
    "--full-scale",
    type=positive,
    metavar="NM",
    help="What %FS are percent of; else the largest reference.",
)
@click.option(
    "--zero-per-run",
    is_flag=True,
    help="Each run has its own zero: mounted or zeroed again between runs.",
)
@reading()
def command(
    runs: tuple[str, ...],
    out: str,
    into: str | None,
    reference: str,
    reading: Reading,
    **options: Any,
) -> None:
    """Calibrate a torque sensor, and compensate its drift with temperature.

    Reads runs with sensor_voltage, a reference torque and a temperature, fits sensitivity, zero
    and drift to all of them together, and prints the verdict: each number with its error,
    non-linearity, hysteresis and repeatability in %FS, what the runs cannot show and why. DIR
    receives model.json (with the estimators) and report.html.

    Runs of any kind may be mixed: steps or ramps of load, loading alone or with unloading, and
    runs without load while the temperature changes. Without any load the drift alone is fitted.
    Zeros that differ between runs are said; with --zero-per-run the model holds their mean.

    \b
    Examples:
      flexspline calibrate load.csv warmup.csv --full-scale 70 --out sensor
      flexspline calibrate warmup.csv --reference none --into sensor/model.json --out sensor2
      flexspline calibrate load.csv warmup.csv --thermal-lag fit --gradient fit --out sensor
    """
    model = None if into is None else loaded(into)
    refuse_overwriting(out, runs, ("model.json", "report.html"))
    with whole_folder(out, last="model.json") as draft:
        logs = reading.logs(runs, {} if model is None else model.facts)

        from flexspline.calibration.calibrating import calibrate

        channel = None if reference.lower() == NO_REFERENCE else reference
        made = calibrate(logs, reference=channel, into=model, **options)
        made.report(draft / "report.html")
        made.model.save(draft / "model.json")
        verdict = str(made)
    found(
        {
            "unit": made.unit,
            "rmse": made.rmse,
            "parameters": [parameter.to_json() for parameter in made.parameters],
            "figures": [asdict(figure) for figure in made.figures],
            "warnings": made.warnings,
        }
    )
    say(f"{verdict}\n\nwrote {Path(out) / 'model.json'} and {Path(out) / 'report.html'}")
