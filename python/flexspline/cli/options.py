"""Options that several commands share, and how their values are written."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import click

from flexspline.cli.runs import Reading
from flexspline.effects import TARGETS, effect
from flexspline.errors import InputError

__all__ = [
    "bandwidth",
    "controller",
    "fixed",
    "known_load",
    "lowpass",
    "model",
    "named",
    "named_effects",
    "orders",
    "out_file",
    "positive",
    "reading",
    "simulation",
    "strict",
    "target",
    "threads",
]

Command = TypeVar("Command", bound=Callable[..., Any])


def positive(text: str) -> float:
    """Read a number that is finite and above zero."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise click.BadParameter(f"'{text}' is no number above zero")
    return number


def named(example: str, parse: Callable[[str], Any]) -> Callable[..., dict[str, Any]]:
    """Return a callback that reads repeated NAME=... into a mapping; `parse` reads the rest."""

    def read(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for text in values:
            name, equals, rest = (part.strip() for part in text.partition("="))
            if name in found:
                raise click.BadParameter(f"'{name}' is given twice", ctx, param)
            try:
                if not name or not equals:
                    raise ValueError
                found[name] = parse(rest)
            except ValueError:
                raise click.BadParameter(f"'{text}' is not written {example}", ctx, param) from None
        return found

    return read


def named_effects(text: str) -> list[str]:
    """Read the names of effects, A,B,C or none.

    Raises
    ------
    InputError
        Where a name is missing or unknown.
    """
    names = [] if text.strip() == "none" else [name.strip() for name in text.split(",")]
    if "" in names:
        raise InputError(f"--effects '{text}': a name is missing; write A,B,C or none")
    return [effect(name).name for name in names]


def known_load(command: Command) -> Command:
    """--known-load CHANNEL"""
    says = "Channel with the load, e.g. reference_torque."
    return click.option("--known-load", metavar="CHANNEL", help=says)(command)


def orders(command: Command) -> Command:
    """--orders EFFECT=1,2,4"""
    return click.option(
        "--orders",
        multiple=True,
        metavar="EFFECT=1,2,4",
        callback=named("EFFECT=1,2,4", lambda text: tuple(int(each) for each in text.split(","))),
        help="Orders of a ripple effect; otherwise they are found. Can be repeated.",
    )(command)


def fixed(command: Command) -> Command:
    """--fix NAME=VALUE"""
    return click.option(
        "--fix",
        multiple=True,
        metavar="NAME=VALUE",
        callback=named("NAME=VALUE", float),
        help="A parameter that is known and not fitted, such as inertia=0.019.",
    )(command)


def threads(command: Command) -> Command:
    """--threads COUNT"""
    count = click.IntRange(1, 1024)
    return click.option(
        "--threads", type=count, default=1, show_default=True, help="To compute with."
    )(command)


def target(required: bool, says: str = "") -> Callable[[Command], Command]:
    """--target, needed by fit; where a model has one part only, it can be left out."""
    usual = "What is explained." if required else "Which part, where the model has several."
    return click.option(
        "--target", type=click.Choice(list(TARGETS)), required=required, help=says or usual
    )


def lowpass(command: Command) -> Command:
    """--lowpass HZ"""
    return click.option(
        "--lowpass",
        type=positive,
        metavar="HZ",
        help="Zero-phase low pass, on the target and on every row alike.",
    )(command)


def _bandwidth(ctx: click.Context, param: click.Parameter, text: str | None) -> float | None:
    return math.inf if text == "none" else None if text is None else positive(text)


def bandwidth(command: Command) -> Command:
    """--bandwidth HZ"""
    return click.option(
        "--bandwidth",
        metavar="HZ",
        callback=_bandwidth,
        help="To which the motion of the output is smoothed before the model reads it; by default "
        "as the noise of the channels tells. none: all channels as recorded.",
    )(command)


def model(command: Command) -> Command:
    """--model MODEL.json"""
    return click.option(
        "--model", "model_path", required=True, metavar="MODEL.json", help="A model that fit wrote."
    )(command)


def simulation(command: Command) -> Command:
    """--simulation FILE, --simulated-torque COLUMN"""
    command = click.option(
        "--simulated-torque",
        metavar="COLUMN",
        help="What a simulator of yours says of the target, in its unit, at the output: a column "
        "of the runs, or of the files of --simulation.",
    )(command)
    return click.option(
        "--simulation",
        multiple=True,
        metavar="FILE",
        help="Its files, with time stamps of the runs' clock; one for each run, in their order.",
    )(command)


def controller(command: Command) -> Command:
    """--controller SERVO.json"""
    says = "A servo law that takes the place of the measured motor torque."
    return click.option("--controller", metavar="SERVO.json", help=says)(command)


def strict(command: Command) -> Command:
    """--strict"""
    says = "Refuse what is otherwise warned of, with exit code 2."
    return click.option("--strict", is_flag=True, help=says)(command)


def out_file(metavar: str) -> Callable[[Command], Command]:
    """--out FILE"""
    says = "File to write, whole or not at all."
    return click.option("--out", required=True, metavar=metavar, help=says)


def reading(columns_needed: bool = False) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add the options of how runs are read; the command gets them as one `Reading`."""
    spline = click.Choice(["circular", "flex"])
    options: list[tuple[str, dict[str, Any]]] = [
        ("--gear-ratio", {"type": positive, "metavar": "N", "help": "Gear ratio N."}),
        ("--output-spline", {"type": spline, "help": "The part of the gear that is the output."}),
        (
            "--torque-constant",
            {
                "type": positive,
                "metavar": "K",
                "help": "Nm/A at the motor: motor_torque from motor_current where a run has none.",
            },
        ),
        ("--pole-pairs", {"type": click.IntRange(1), "metavar": "P", "help": "Of the motor."}),
        ("--slots", {"type": click.IntRange(1), "metavar": "S", "help": "Of the motor's stator."}),
        (
            "--repair",
            {
                "multiple": True,
                "metavar": "NAME[=VALUE]",
                "help": "A repair of the data, listed below; can be repeated, done in this order.",
            },
        ),
        (
            "--columns",
            {
                "metavar": "MAP.toml",
                "required": columns_needed,
                "help": "Column map of a foreign file: channel, column, unit, sign.",
            },
        ),
        ("--rate", {"type": positive, "metavar": "HZ", "help": "Of runs without time stamps."}),
    ]
    names = [name[2:].replace("-", "_") for name, _ in options]

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        def packed(**given: Any) -> Any:
            own = {name: given.pop(name) for name in names}
            facts = {name: own[name] for name in names[:5] if own[name] is not None}
            how = Reading(facts, own["repair"], own["columns"], own["rate"])
            return command(reading=how, **given)

        packed.__name__, packed.__doc__ = command.__name__, command.__doc__
        packed.__dict__.update(command.__dict__)  # the options that are there already
        for name, settings in reversed(options):
            packed = click.option(name, **settings)(packed)
        return packed

    return add
