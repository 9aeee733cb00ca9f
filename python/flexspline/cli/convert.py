"""`flexspline convert`: a foreign file and a column map to a run."""

from __future__ import annotations

import click

from flexspline.cli.help import Taught, repairs
from flexspline.cli.options import out_file, reading
from flexspline.cli.runs import Reading, refuse_overwriting

__all__ = ["convert"]


@click.command(cls=Taught, sections=(repairs,))
@click.argument("foreign", metavar="FOREIGN")
@out_file("RUN.csv")
@reading(columns_needed=True)
def convert(foreign: str, out: str, reading: Reading) -> None:
    """Turn a foreign file into a run: CSV, channel names, SI units.

    FOREIGN is delimited text, .npy, .npz, .mat or .json, packed or not. The map says which
    column is which channel, in which unit and with which sign. Prints what the run holds.

    \b
    Example: a file map.toml with
      [facts]
      gear_ratio = 100
      [columns]
      time = {source = "t", unit = "ms"}
      output_position = {source = "angle", unit = "deg"}
      sensor_torque = {source = 5, unit = "mNm", sign = -1}
    \b
    and then
      flexspline convert recording.txt --columns map.toml --out run1.csv
    """
    from flexspline.logs.read import convert as convert_log

    assert reading.columns is not None
    refuse_overwriting(out, [foreign, reading.columns])
    log = convert_log(foreign, reading.columns, out, **reading.arguments)
    click.echo(f"{log}\n\nwrote {out}")
