"""Runs without a model: `flexspline init`, `check`, `orders` and `convert`.

`init` guesses the column map of a foreign recording, with reasons; `convert` makes a run of a
foreign file and a map. `check` is the audit before any fit, `orders` says what turns with the
joint.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flexspline.cli.options import (
    EFFECTS,
    FILE,
    MAX_MEMORY,
    Reading,
    Taught,
    channels,
    effects_by_target,
    formats,
    is_table,
    known_load,
    left_open,
    named_effects,
    out_file,
    positive,
    reading,
    refuse_overwriting,
    repairs,
    target,
    text_file,
    warn,
)
from flexspline.cli.speech import found, is_json, say, tell
from flexspline.errors import InputError, listed, printable
from flexspline.files import atomic_write, atomic_writer, whole_folder

if TYPE_CHECKING:
    from flexspline.recordings import Guess

__all__ = ["check", "convert", "init", "orders"]


FORBIDDEN = 3  # exit code: findings that forbid a fit


def _of_joint(content: Mapping[str, Any]) -> dict[str, Any]:
    """What a check says of one joint: its findings, counted over its runs."""
    findings = [finding for run in content["runs"] for finding in run["findings"]]
    counted = {
        f"{severity}s": sum(finding["severity"] == severity for finding in findings)
        for severity in ("error", "fault", "note")
    }
    named = dict.fromkeys(f["name"] for f in findings if f["severity"] != "note")
    fit = "no" if content["fit_forbidden"] else "yes"
    return {"can_be_fitted": fit, **counted, "errors_and_faults": ", ".join(named) or "–"}


@click.command(cls=Taught, sections=(channels, effects_by_target, repairs))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@click.option(
    "--effects",
    "names",
    metavar="A,B,C",
    type=EFFECTS,
    default="none",
    help="Effects to be fitted: missing channels and lacking excitation are found too.",
)
@target(required=False, says="What is to be fitted: it has to be there, and suit.")
@click.option(
    "--out", metavar="DIR", type=FILE, help="Folder for check.json and report.html with figures."
)
@reading(each_joint=_of_joint)
@click.pass_context
def check(
    ctx: click.Context,
    runs: tuple[str, ...],
    names: str,
    target: str | None,
    out: str | None,
    reading: Reading,
) -> None:
    """Look for what is wrong with runs; nothing is changed and nothing is fitted.

    Prints, for each run, what makes every fit meaningless (error), what a fit would take for
    physics (fault) and what is worth knowing (note): dropped, repeated and missing rows, delays,
    wrapped angles, wrong units and signs, stuck ends, homing moves, clipping, quanta. Each says
    where, how much, and which repair to ask for. Then, of the effects that are given, or of all
    whose channels are there, whether the runs together excite them, and if not, what to record.
    DIR receives check.json and report.html.

    Exit code 0: can be fitted; 3: an error forbids every fit; 2: the call is wrong or a file
    cannot be read.

    \b
    Examples:
      flexspline check run1.csv run2.csv
      flexspline check run*.csv --target motor_torque --effects viscous_friction,inertia --out audit
    """
    effects = named_effects(names)
    if out is not None:
        refuse_overwriting(out, runs, ("check.json", "report.html"))
    logs = reading.logs(runs)

    from flexspline.logs.checks import audit_text, check_json, check_runs, check_verdict, together

    audits = list(zip(logs, check_runs(logs, effects=effects, target=target), strict=True))
    shown = together(audits, effects, target)
    content = check_json(audits, target, shown) if out is not None or is_json() else "{}"
    found(json.loads(content))
    lines = [*audit_text(audits, shown), check_verdict(audits, target)]
    say("\n".join(map(printable, lines)))
    if out is not None:
        from flexspline.report.html import write_check_report

        with whole_folder(out, last="check.json") as draft:
            write_check_report(audits, draft / "report.html", target, shown)
            atomic_write(draft / "check.json", content)
        say(f"\nwrote {Path(out) / 'check.json'} and {Path(out) / 'report.html'}")
    if any(one.forbidding(target) for _, one in audits):
        ctx.exit(FORBIDDEN)


@click.command(cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@target(required=True, says="Whose ripple is looked for.")
@known_load
@click.option(
    "--out",
    metavar="FILE.csv|DIR",
    type=FILE,
    help="Table of what is found; or a folder for orders.csv and orders.png.",
)
@reading()
def orders(
    runs: tuple[str, ...], target: str, known_load: str | None, out: str | None, reading: Reading
) -> None:
    """Find what turns with the joint, and what vibrates at one frequency; nothing is fitted.

    Prints, for each order that is significant, how often it comes per turn of the output and of
    which pair of parts; how finely these runs tell orders apart, and what else turns within that;
    the size and phase of its steady part, which all runs have in common, with errors; and the
    spread, by how much single runs and directions differ from that. Vibrations stay at one
    frequency whatever the speed: runs at two speeds tell them from orders, one speed does not.

    \b
    Examples:
      flexspline orders run1.csv run2.csv --target sensor_torque --gear-ratio 100
      flexspline orders run*.csv --target motor_current --repair drop_start=1 --out orders.csv
    """
    if out is not None:
        refuse_overwriting(out, runs, () if is_table(out) else ("orders.csv", "orders.png"))
    logs = reading.logs(runs)

    from flexspline.effects import UNITS
    from flexspline.orders import find_orders
    from flexspline.signals import target_of

    values = [target_of(log, target, known_load) for log in logs]
    made = find_orders(logs, values, unit=UNITS[target], channel=target, vibrations=True)
    if is_json():
        found({"orders": made.to_frame().to_dict("records")})
    say(str(made))
    if out is None:
        return
    if is_table(out):
        made.save(out)
        say(f"\nwrote {out}")
        return
    from flexspline.plot.canvas import PlainFigure, own_style

    with whole_folder(out, last="orders.csv") as draft, own_style():
        figure = PlainFigure(9.0, 4.0)
        made.plot(figure.add_subplot())
        figure.savefig(draft / "orders.png", dpi=110)
        made.save(draft / "orders.csv")
    say(f"\nwrote {Path(out) / 'orders.csv'} and {Path(out) / 'orders.png'}")


@click.command(cls=Taught, sections=(formats, channels, repairs))
@click.argument("foreign", metavar="FOREIGN", type=FILE)
@out_file("RUN.csv")
@click.option(
    "--rows-at-once",
    metavar="N",
    type=click.IntRange(min=2),
    help="Convert N rows at a time, for a file larger than memory in a format that is read in "
    "pieces. Repairs need the whole run and are refused.",
)
@reading(columns_needed=True)
def convert(foreign: str, out: str, rows_at_once: int | None, reading: Reading) -> None:
    """Turn a foreign file into a run: CSV, channel names, SI units.

    FOREIGN is a file of any of the formats below, packed or not. The map says which column is which
    channel, in which unit and with which sign. Prints what the run holds. A RUN that ends like one
    of the formats that are written too is such a file.

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
      flexspline convert robot.csv --preset ur-rtde --joint 2 --out run1.csv
    """
    from flexspline.logs.read import convert as convert_log
    from flexspline.logs.read import convert_in_pieces

    refuse_overwriting(out, [foreign, *([reading.columns] if reading.columns else [])])
    if rows_at_once is not None:
        made = convert_in_pieces(
            foreign, reading.columns, out, rows=rows_at_once, **reading.arguments
        )
        tell("\n".join(made.history))
        found({"rows": made.rows, "channels": made.channels})
        say(f"{made.rows} rows of {listed(made.channels)}\n\nwrote {out}")
        return
    log = convert_log(foreign, reading.columns, out, **reading.arguments)
    tell("\n".join(log.history))
    warn(left_open([log]))
    found({"run": log.name, "rows": len(log), "rate": log.rate, "channels": log.channels})
    say(f"{log}\n\nwrote {out}")


def _list_presets() -> None:
    """Print all presets."""
    from dataclasses import asdict

    from flexspline.logs.presets import preset_names, preset_of, presets_text

    found({"presets": {name: asdict(preset_of(name)) for name in preset_names()}})
    say(presets_text())


@click.command(cls=Taught, sections=(formats, channels))
@click.argument("recording", metavar="RECORDING", required=False, type=FILE)
@click.option(
    "--out",
    default="map.toml",
    show_default=True,
    metavar="MAP.toml",
    type=FILE,
    help="Column map to write, whole or not at all; a figure of its name, .png, stands beside it.",
)
@click.option(
    "--joint",
    metavar="NAME|all",
    help="Which joint, as the columns of several call it; all: a map of all, guessed from one.",
)
@click.option(
    "--list-presets",
    is_flag=True,
    help="Print, instead, the column maps of common recorders, which commands take by --preset: "
    "what each reads, by which source, and what is left to be said.",
)
@click.option("--rate", type=positive, metavar="HZ", help="Of a recording without time stamps.")
@text_file
@click.option(MAX_MEMORY[0], **MAX_MEMORY[1])
def init(
    recording: str | None,
    out: str,
    joint: str | None,
    list_presets: bool,
    rate: float | None,
    encoding: str | None,
    skip_lines: int | None,
    units_row: bool | None,
    max_memory: float | None,
) -> None:
    """Guess which column of a recording is which channel, and write a column map.

    RECORDING is a file of any of the formats below, packed or not. Of text, as any recorder writes
    it, encoding, preamble, names, a row of units, separators, decimal sign and time stamps are
    found by looking, as far as no option says them. Channels come from names and units, and from
    physics: a velocity is a position's derivative, the motor turns N times as far as the output, a
    drive does work against friction.

    Each entry of the map has its reason beside it, and what is unsure says so. Look at these and
    at the figure before the first fit; signs of torques that only the rig knows are yours to see.

    \b
    Examples:
      flexspline init recording.txt --joint 3 --out map.toml
      flexspline check recording.txt --columns map.toml
      flexspline init robot.csv --joint all --out robot.toml
      flexspline check robot.csv --columns robot.toml --joint all
      flexspline init --list-presets
    """
    if list_presets:
        _list_presets()
        return
    if recording is None:
        raise click.UsageError("Missing argument 'RECORDING'.")
    refuse_overwriting(out, [recording])
    if not Path(out).name:
        raise InputError(f"--out '{out}': is no name of a file; give one that ends in .toml")
    figure = Path(out).with_suffix(".png")
    if figure == Path(out):
        raise InputError(f"--out {out}: is the name of the figure; give one that ends in .toml")
    refuse_overwriting(str(figure), [recording])

    from flexspline.recordings import guess_map

    guess = guess_map(
        recording,
        joint=joint,
        rate=rate,
        encoding=encoding,
        skip_lines=skip_lines or 0,
        units_row=units_row,
        max_memory=max_memory,
    )
    found(guess.to_json())
    say(str(guess))
    guess.save(out)
    shown = ""
    try:
        if "time" in guess.channels or "rate" in guess.read:
            drawn = guess.plot()
            with atomic_writer(figure) as file:
                drawn.savefig(file, format="png", dpi=110)
            shown = f" and {figure}"
    except InputError as error:
        say(f"\nnot drawn, for the map does not read the recording yet: {error}")
    say(f"\nwrote {out}{shown}; next: {_next(recording, out, guess)}")


def _next(recording: str, out: str, guess: Guess) -> str:
    import shlex

    words = ["flexspline", "check", recording, "--columns", out]
    return printable(shlex.join([*words, *(["--joint", "all"] if guess.places else [])]))
