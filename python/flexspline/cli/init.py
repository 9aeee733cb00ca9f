"""`flexspline init`: a column map for a foreign recording, guessed with reasons."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flexspline.cli.options import FILE, MAX_MEMORY, Taught, channels, positive, refuse_overwriting
from flexspline.cli.speech import found, say
from flexspline.errors import InputError, printable
from flexspline.files import atomic_writer

if TYPE_CHECKING:
    from flexspline.recordings import Guess

__all__ = ["init"]


def _list_presets() -> None:
    """Print all presets."""
    from dataclasses import asdict

    from flexspline.logs.presets import preset_names, preset_of, presets_text

    found({"presets": {name: asdict(preset_of(name)) for name in preset_names()}})
    say(presets_text())


@click.command(cls=Taught, sections=(channels,))
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
@click.option(MAX_MEMORY[0], **MAX_MEMORY[1])
def init(
    recording: str | None,
    out: str,
    joint: str | None,
    list_presets: bool,
    rate: float | None,
    max_memory: float | None,
) -> None:
    """Guess which column of a recording is which channel, and write a column map.

    RECORDING is delimited text as any recorder writes it, .npy, .npz, .mat, HDF5, JSON, Parquet,
    Feather, MCAP, a bag of ROS, MDF 4 or TDMS, packed or not. Encoding, preamble, names, a row of
    units, separators, decimal sign and time stamps are found by looking. Channels come from names
    and units, and from physics: a velocity is a position's derivative, the motor turns N times as
    far as the output, a drive does work against friction.

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
    figure = Path(out).with_suffix(".png")
    if figure == Path(out):
        raise InputError(f"--out {out}: is the name of the figure; give one that ends in .toml")
    refuse_overwriting(str(figure), [recording])

    from flexspline.recordings import guess_map

    guess = guess_map(recording, joint=joint, rate=rate, max_memory=max_memory)
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
