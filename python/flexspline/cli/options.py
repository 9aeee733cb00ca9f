"""Options that several commands share, the format of their values, and the runs they name.

Help texts list the effects and repairs that exist.
"""

from __future__ import annotations

import math
import os
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.shell_completion import CompletionItem

from flexspline.cli.speech import found, is_quiet, tell, whose
from flexspline.effects import TARGETS, effect
from flexspline.errors import FlexsplineWarning, InputError, printable
from flexspline.files import (
    PREVIOUS,
    Writing,
    file_to_write,
    folder_to_write,
    require_there,
)
from flexspline.progress import Progress

if TYPE_CHECKING:
    from flexspline.cli.joints import Summary
    from flexspline.logs.log import Log
    from flexspline.model import Model

    Choice = click.Choice[str]
    ParamType = click.ParamType[str]
else:
    Choice, ParamType = click.Choice, click.ParamType  # before click 8.4 no generic ones

__all__ = [
    "EFFECTS",
    "FILE",
    "RATE",
    "REPAIRS",
    "TEXT",
    "Command",
    "LateChoice",
    "Listed",
    "Reading",
    "Taught",
    "asked_of_fit",
    "bandwidth",
    "by_motion",
    "channels",
    "controller",
    "effects_by_target",
    "exclude",
    "excluded",
    "files_in",
    "files_of",
    "fitted_controller",
    "fixed",
    "formats",
    "is_table",
    "joint_and_map",
    "known_effects",
    "known_load",
    "left_open",
    "loaded",
    "lowpass",
    "model",
    "model_file",
    "model_joint",
    "named_effects",
    "named_values",
    "of_a_fit",
    "on_terminal",
    "orders",
    "out_file",
    "out_files",
    "positive",
    "preset_names",
    "reading",
    "refuse_overwriting",
    "repairs",
    "simulation",
    "simulations",
    "speed_above",
    "strict",
    "target",
    "text_file",
    "threads",
    "warn",
    "whole_number",
]

Command = TypeVar("Command", bound=Callable[..., Any])

SIMULATED = "simulated_torque"  # the channel; its own module takes long to import

Section = Callable[[], tuple[str, list[tuple[str, str]]]]


class LateChoice(Choice):
    """A choice among names of a module that takes long to import: asked for when it is needed."""

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self.case_sensitive = True
        self._names = names

    @cached_property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self._names())


class Listed(ParamType):
    """Names with commas between them, read as one text; a shell completes the last one."""

    name = "text"

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self._names = names

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return what the text may become."""
        before, comma, last = incomplete.rpartition(",")
        return [
            CompletionItem(f"{before}{comma}{name}")
            for name in self._names()
            if name.startswith(last)
        ]


def _effect_names() -> Iterable[str]:
    from flexspline.effects import CATALOGUE

    return CATALOGUE


def preset_names() -> Iterable[str]:
    from flexspline.logs.presets import preset_names

    return preset_names()


def _repair_names() -> Iterable[str]:
    from flexspline.logs.repairs import REPAIRS as KNOWN

    return KNOWN


FILE = click.Path(readable=False)  # a shell completes it; it is looked at where it is read
EFFECTS, REPAIRS = Listed(_effect_names), Listed(_repair_names)


def positive(text: str) -> float:
    """Read a number that is finite and above zero."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise click.BadParameter(f"'{text}' is no number above zero")
    return number


def _named(example: str, parse: Callable[[str], Any]) -> Callable[..., dict[str, Any]]:
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


def named_values(
    *names: str, metavar: str, parse: Callable[[str], Any], says: str, example: str | None = None
) -> Callable[[Command], Command]:
    """An option NAME=... that can be repeated, given as one mapping; `parse` reads the values.

    `example`: how it is written, for who writes it wrong; None: as `metavar` says.
    """
    read = _named(example or metavar, parse)
    return click.option(*names, multiple=True, metavar=metavar, callback=read, help=says)


def whole_number(
    name: str,
    least: int,
    most: int | None = None,
    *,
    default: int | Callable[[], int],
    says: str,
    shown: bool | str = True,
    metavar: str | None = None,
) -> Callable[[Command], Command]:
    """An option that counts from `least` to `most`, and whose help tells the default as `shown`."""
    numbers = click.IntRange(least, most)
    return click.option(
        name, type=numbers, default=default, show_default=shown, metavar=metavar, help=says
    )


def by_motion(says: str) -> Callable[[Command], Command]:
    """--by regression|simulation"""
    ways = click.Choice(("regression", "simulation"))
    return click.option("--by", type=ways, default="regression", show_default=True, help=says)


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


def known_effects(command: Command) -> Command:
    """--effects A,B,C"""
    says = "Effects that are known; or none."
    return click.option("--effects", "names", metavar="A,B,C", type=EFFECTS, help=says)(command)


def exclude(command: Command) -> Command:
    """--exclude A,B,C"""
    says = "Effects that are known not to be there."
    return click.option("--exclude", metavar="A,B,C", type=EFFECTS, help=says)(command)


def excluded(text: str | None) -> list[str]:
    """Read the names of --exclude.

    Raises
    ------
    InputError
        Where one is unknown.
    """
    given = (name.strip() for name in (text or "").split(","))
    return [effect(name).name for name in given if name]


def known_load(command: Command) -> Command:
    """--known-load CHANNEL"""
    says = (
        "Channel with the load at the output, of a load cell, brake or weight, e.g. "
        "reference_torque: effects explain the target less this; a torsion follows it, and the "
        "gravity that the drive of --into was found to have beside it."
    )
    return click.option("--known-load", metavar="CHANNEL", help=says)(command)


def orders(command: Command) -> Command:
    """--orders EFFECT=1,2,4"""
    return named_values(
        "--orders",
        metavar="EFFECT=1,2,4",
        parse=lambda text: tuple(int(each) for each in text.split(",")),
        says="Orders of a ripple effect; otherwise they are found. Can be repeated.",
    )(command)


def fixed(command: Command) -> Command:
    """--fix NAME=VALUE"""
    says = "A parameter that is known and not fitted, such as inertia=0.019."
    return named_values("--fix", metavar="NAME=VALUE", parse=float, says=says)(command)


def fitted_controller(command: Command) -> Command:
    """--controller SERVO.json and --free-controller A,B"""
    free = click.option(
        "--free-controller",
        metavar="A,B",
        default="",
        callback=lambda _, __, text: [n.strip() for n in text.split(",") if n.strip()],
        help="Fields of the law to fit too: torque, back_emf.",
    )
    law = click.option(
        "--controller",
        metavar="SERVO.json",
        type=FILE,
        help="By simulation: the servo's law that drives it.",
    )
    return law(free(command))


def threads(command: Command) -> Command:
    """--threads COUNT"""
    return whole_number("--threads", 1, 1024, default=1, says="To compute with.")(command)


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
    says = "A model that fit wrote, or an MJCF file or a URDF with a joint."
    return model_file(says, required=True)(command)


def model_file(says: str, *, required: bool = False) -> Callable[[Command], Command]:
    """--model MODEL.json"""
    return click.option(
        "--model", "model_path", required=required, metavar="MODEL.json", type=FILE, help=says
    )


def model_joint(command: Command) -> Command:
    """--model-joint NAME"""
    return click.option(
        "--model-joint",
        metavar="NAME",
        help="Of an MJCF file or a URDF as --model: the joint, where it has several.",
    )(command)


def loaded(path: str, target: str | None = None, joint: str | None = None) -> Model:
    """Read the model of a command; what the command computes with is imported after its files.

    `target` and `joint` say what is meant of an MJCF file or a URDF.
    """
    from flexspline.model import Model

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", FlexsplineWarning)
        made = Model.load(path, target=target, joint=joint)
    warn([str(one.message) for one in said])
    return made


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
        type=FILE,
        help="Its files, with time stamps of the runs' clock; one for each run, in their order.",
    )(command)


def controller(command: Command) -> Command:
    """--controller SERVO.json"""
    says = "A servo law that takes the place of the measured motor torque."
    return click.option("--controller", metavar="SERVO.json", type=FILE, help=says)(command)


def strict(command: Command) -> Command:
    """--strict"""
    says = "Refuse what is otherwise warned of, with exit code 2."
    return click.option("--strict", is_flag=True, help=says)(command)


def text_file(command: Command) -> Command:
    """--encoding NAME, --skip-lines N, --units-row"""
    for name, settings in reversed(TEXT):
        command = click.option(name, **settings)(command)
    return command


def speed_above(command: Command) -> Command:
    """--speed-above RAD_PER_S"""
    return click.option(
        "--speed-above",
        type=positive,
        metavar="RAD_PER_S",
        help="Rows whose output is slower are left out of the errors; its speed is "
        "output_velocity, or the derivative of output_position.",
    )(command)


def of_a_fit(command: Command) -> Command:
    """Add what every fit to a target asks."""
    for add in (fixed, orders, bandwidth, lowpass, known_load):
        command = add(command)
    return command


def asked_of_fit(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the options of `of_a_fit` say, of those that a command has, as arguments."""
    named = {"orders": "orders", "fixed": "fix"}
    named |= {name: name for name in ("known_load", "lowpass", "bandwidth")}
    return {name: options[option] for name, option in named.items() if option in options}


def out_files(command: Command) -> Command:
    """--out FILE_OR_DIR"""
    says = "File to write; of several runs a folder, which gets one for each. Whole or not at all."
    return out_file("FILE_OR_DIR", says)(command)


def files_in(
    out: str, runs: Sequence[str], inputs: Sequence[str], *, cut: bool = False
) -> list[str]:
    """Return the names of the files of these runs in the folder --out; none where that is a file.

    It is a folder where there are several runs, where one is there, and where its name ends so.
    `cut`: a file may hold several runs; what they are called is known when they are read.

    Raises
    ------
    InputError
        Where runs would have files of one name, --out is a file and there are several runs, or a
        file that is read would be overwritten.
    """
    alone = len(runs) == 1 and not cut
    if alone and not Path(out).is_dir() and not out.endswith(("/", os.sep)):
        refuse_overwriting(out, [*runs, *inputs])
        return []
    if Path(out).is_file() or (Path(out).suffix and not Path(out).exists()):
        raise InputError(
            f"--out {out}: is the name of a file, and there {_count(runs, cut)}; give a folder, "
            "which gets a file for each"
        )
    from flexspline.logs.read import run_name

    named = dict[str, str]()
    for run in runs:
        name = f"{run_name(Path(run))}.csv"
        if (other := named.setdefault(name.casefold(), run)) != run:
            raise InputError(
                f"{run} and {other}: the files of both in --out would be named {name}; rename one, "
                "or give them in calls of their own"
            )
        refuse_overwriting(str(Path(out) / name), [*runs, *inputs])
    return [f"{run_name(Path(run))}.csv" for run in runs]


def is_table(out: str) -> bool:
    """Whether --out FILE.csv|DIR is the file."""
    return Path(out).suffix.lower() == ".csv" and not Path(out).is_dir()


def _count(runs: Sequence[str], cut: bool) -> str:
    return "may be several runs in a file" if cut else f"are {len(runs)} runs"


def files_of(out: str, logs: Sequence[Log], inputs: Sequence[str]) -> list[str]:
    """Return the names of the files of runs cut from files, in the folder --out.

    They go by the names of the files that were read, for a run may be called anything.

    Raises
    ------
    InputError
        Where a file that is read would be overwritten.
    """
    from flexspline.logs.read import run_name

    paths = [log.source.path if log.source else log.name for log in logs]
    names = [
        f"{run_name(Path(path))}_{paths[: k + 1].count(path)}.csv" for k, path in enumerate(paths)
    ]
    for name in names:
        refuse_overwriting(str(Path(out) / name), inputs)
    return names


def out_file(
    metavar: str, says: str = "File to write, whole or not at all."
) -> Callable[[Command], Command]:
    """--out FILE"""
    return click.option("--out", required=True, metavar=metavar, type=FILE, help=says)


MAX_MEMORY: tuple[str, dict[str, Any]] = (
    "--max-memory",
    {
        "type": positive,
        "metavar": "GB",
        "help": "What a file may unfold to; by default half of what is free.",
    },
)
RATE: tuple[str, dict[str, Any]] = (
    "--rate",
    {"type": positive, "metavar": "HZ", "help": "Of runs without time stamps."},
)
TEXT: tuple[tuple[str, dict[str, Any]], ...] = (
    ("--encoding", {"metavar": "NAME", "help": "Of text files, such as latin-1."}),
    (
        "--skip-lines",
        {"type": click.IntRange(0), "metavar": "N", "help": "Above the table of a text file."},
    ),
    (
        "--units-row/--no-units-row",
        {"default": None, "help": "Whether the row below the names holds units."},
    ),
)


def _gaps(ctx: click.Context, param: click.Parameter, text: str | None) -> float | bool | None:
    """Read the seconds of --split-gaps; True without a number."""
    if text is None or text == "auto":
        return None if text is None else True
    try:
        return positive(text)
    except click.BadParameter:
        raise click.BadParameter(
            f"'{text}' is no number of seconds above zero; write --split-gaps behind the runs, or "
            "--split-gaps=0.5",
            ctx,
            param,
        ) from None


def _require_map(given: Mapping[str, Any], needed: bool) -> None:
    """Refuse a preset that is not there, and neither map nor preset where one is needed."""
    if given["preset"] is not None:
        from flexspline.logs.presets import preset_of

        preset_of(given["preset"])
    elif needed and given["columns"] is None:
        raise click.UsageError("Missing option '--columns' or '--preset'.")


JOINT_AND_MAP: dict[str, dict[str, Any]] = {
    "--gear-ratio": {"type": positive, "metavar": "N"},
    "--output-spline": {"type": click.Choice(["circular", "flex"])},
    "--torque-constant": {"type": positive, "metavar": "K"},
    "--pole-pairs": {"type": click.IntRange(1), "metavar": "P"},
    "--slots": {"type": click.IntRange(1), "metavar": "S"},
    "--repair": {"multiple": True, "metavar": "NAME[=VALUE]", "type": REPAIRS},
    "--columns": {"metavar": "MAP.toml", "type": FILE},
    "--preset": {"metavar": "RECORDER", "type": Listed(preset_names)},
}


def joint_and_map(**says: str) -> list[tuple[str, dict[str, Any]]]:
    """Return options of `JOINT_AND_MAP`, each with what a command says of it."""
    options = {f"--{name.replace('_', '-')}": text for name, text in says.items()}
    return [(name, {**JOINT_AND_MAP[name], "help": text}) for name, text in options.items()]


def reading(
    columns_needed: bool = False, each_joint: Summary | None = None
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add the options of how runs are read; the command gets them as one `Reading`.

    `each_joint`: what a command says of one joint in the summary of several; None: it takes one.
    """
    options: list[tuple[str, dict[str, Any]]] = [
        *joint_and_map(
            gear_ratio="Gear ratio N, as sold.",
            output_spline="The part of the gear that is the output; where it is the circular one, "
            "the motor turns N + 1 times.",
            torque_constant="Nm/A at the motor: motor_torque from motor_current where a run has "
            "none.",
            pole_pairs="Of the motor.",
            slots="Of the motor's stator.",
            repair="A repair of the data, listed below; can be repeated, done in this order, "
            "behind those of the column map.",
            columns="Column map of a foreign file: channel, column, unit, sign.",
            preset="A column map that comes with flexspline, over which --columns is laid: "
            "flexspline init --list-presets.",
        ),
        (
            "--joint",
            {
                "metavar": "NAME|A,B|all",
                "help": "Of a robot's files, whose map has sources such as q_{joint}: the joint. "
                "Several, or all: "
                + (
                    "each by itself, into a folder of its own in --out, with one summary."
                    if each_joint
                    else "only check, discover, fit and predict take them."
                ),
            },
        ),
        RATE,
        (
            "--split-column",
            {
                "metavar": "COLUMN",
                "help": "A file holds several runs: one begins wherever this column changes.",
            },
        ),
        (
            "--split-gaps",
            {
                "is_flag": False,
                "flag_value": "auto",
                "metavar": "[SECONDS]",
                "callback": _gaps,
                "help": "A file holds several runs: one begins wherever time goes on by more than "
                "this, or back; without a number by more than 25 median steps.",
            },
        ),
        *TEXT,
        MAX_MEMORY,
    ]
    names = [name.partition("/")[0][2:].replace("-", "_") for name, _ in options]

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        def packed(**given: Any) -> Any:
            own = {name: given.pop(name) for name in names}
            facts = {name: own[name] for name in names[:5] if own[name] is not None}
            _require_map(own, columns_needed)
            rest = {name: own[name] for name in names[-6:] if own[name] is not None}
            rest |= {"preset": own["preset"]} if own["preset"] is not None else {}
            how = Reading(facts, own["repair"], own["columns"], own["rate"], rest)
            asked = own["joint"]
            if asked is None:
                return command(reading=how, **given)
            from flexspline.cli.joints import for_joints

            return for_joints(command, each_joint, asked, how, given)

        packed.__name__, packed.__doc__ = command.__name__, command.__doc__
        packed.__dict__.update(command.__dict__)  # the options that are there already
        for name, settings in reversed(options):
            packed = click.option(name, **settings)(packed)
        return packed

    return add


@dataclass(frozen=True)
class Reading:
    """How runs are read: the options that `cli.options.reading` adds.

    Parameters
    ----------
    facts : of the joint; they overrule those in the files.
    repair : repairs by name, in order.
    columns : path of a column map, or None.
    rate : Hz, of files without time stamps.
    rest : how files are written where that is not found by looking, what cuts them into runs, what
        memory they may take, and the preset of their recorder.
    joint : of a robot, whose files have columns of several.
    """

    facts: Mapping[str, Any] = field(default_factory=dict)
    repair: tuple[str, ...] = ()
    columns: str | None = None
    rate: float | None = None
    rest: Mapping[str, Any] = field(default_factory=dict)
    joint: str | None = None

    @property
    def splits(self) -> bool:
        """Whether a file is cut into runs."""
        from flexspline.logs.read import splits

        return bool(splits(self.with_map()))

    @property
    def arguments(self) -> dict[str, Any]:
        """What was given, as arguments of `read_runs`."""
        given = {**self.facts, "repair": self.repair, "rate": self.rate, "joint": self.joint}
        return {**{key: value for key, value in given.items() if value}, **self.rest}

    def logs(
        self,
        paths: Sequence[str],
        known: Mapping[str, Any] | None = None,
        simulated_torque: str | None = None,
    ) -> list[Log]:
        """Read all runs; `known` are facts of a model, used where a run has none of its own.

        `simulated_torque`: the column of the runs that is read as the channel of that name.

        Raises
        ------
        InputError
            Where a file cannot be read, or is given twice.
        """
        seen = set[Path]()
        for path in paths:
            require_there(path)
            if Path(path).resolve() in seen:
                raise InputError(f"{path}: is given twice; give each run once")
            seen.add(Path(path).resolve())
        from flexspline.logs.read import splits

        arguments = with_simulated(self.with_map(), simulated_torque)
        logs = []
        with Progress("reading", on_terminal(), total=len(paths), unit="run") as bar:
            for path in paths:
                logs += [_completed(log, known or {}) for log in self._read(path, arguments)]
                bar.step()
        if splits(arguments):
            found({"cut": [{"run": log.name, "rows": len(log)} for log in logs]})
        warn(left_open(logs))
        return logs

    def with_map(self) -> dict[str, Any]:
        """What was given, and what the map says, as arguments of `read_runs`.

        Raises
        ------
        InputError
            Where the map cannot be read.
        """
        if self.columns is None:
            return self.arguments
        from flexspline.logs.read import map_arguments
        from flexspline.logs.repairs import repairs_of_both

        said = map_arguments(self.columns, self.joint)
        repair = repairs_of_both(said.get("repair", ()), self.repair)
        return {**said, **self.arguments, **({"repair": repair} if repair else {})}

    def one(self, path: str, known: Mapping[str, Any]) -> Log:
        """Read the run of a command that takes one; `known` as for `logs`.

        Raises
        ------
        InputError
            Where it cannot be read, or is to be cut.
        """
        self.refuse_cut(f"{path}: one run is taken, whole")
        return self.logs([path], known)[0]

    def refuse_cut(self, why: str) -> None:
        """Refuse to cut a file into runs."""
        from flexspline.logs.read import refuse_split

        refuse_split(self.with_map(), why)

    def _read(self, path: str, arguments: Mapping[str, Any]) -> list[Log]:
        """Read the runs of a file, and say how many rows are in none."""
        from flexspline.logs.read import cut_runs, read_log, splits

        if not splits(arguments):
            return [read_log(path, **arguments)]
        cut = cut_runs(path, **arguments)
        (warn if cut.rows_left_out or len(cut.runs) == 1 else _aside)([cut.sentence])
        return list(cut.runs)


def left_open(logs: Sequence[Log]) -> list[str]:
    """What a preset leaves open of the logs, each sentence once."""
    from flexspline.logs.presets import OPEN

    said = {sentence: log for log in logs for sentence in log.history if sentence.startswith(OPEN)}
    return [sentence for sentence, log in said.items()
            if sentence.removeprefix(OPEN).partition(":")[0] not in log.facts]  # fmt: skip


def _aside(sentences: Sequence[str]) -> None:
    for sentence in sentences:
        tell(sentence)


def simulations(
    paths: Sequence[str], column: str | None, *, motion: bool = False
) -> list[Log] | None:
    """Read the files of a simulation; None where there are none.

    Raises
    ------
    InputError
        Where a file cannot be read.
    """
    from flexspline.logs.read import read_log

    if not paths:
        return None
    arguments = with_simulated({}, None if motion else column)
    return [read_log(path, **arguments) for path in paths]


def with_simulated(arguments: Mapping[str, Any], column: str | None) -> dict[str, Any]:
    """Return arguments of `read_log` that read a simulated column too."""
    from flexspline.logs.channels import CHANNELS

    if column is None or column in CHANNELS:
        return dict(arguments)
    columns = {**(arguments.get("columns") or {}), SIMULATED: column}
    return {**arguments, "columns": columns}


def on_terminal() -> bool:
    """Whether somebody watches standard error: then there is a progress bar."""
    return sys.stderr.isatty() and not is_quiet()


def refuse_overwriting(out: str, inputs: Sequence[str], names: Sequence[str] = ()) -> None:
    """Raise `InputError` where a file to write is one of those that are read, or no file.

    `names`: of the files that are written where `out` is a folder.
    """
    places = [folder_to_write(out) / name for name in names] or [file_to_write(out)]
    for place in places:
        Writing.current().before(place)
    kept = [Path(f"{place}{PREVIOUS}") for place in places if place.exists()]
    taken = {os.path.realpath(place) for place in (*places, *kept)}
    for path in inputs:
        if os.path.realpath(path) in taken:
            raise InputError(f"--out {out}: would overwrite {path}, which is read; give another")


def warn(sentences: Sequence[str]) -> None:
    """Print each sentence on a line of standard error."""
    for sentence in sentences:
        click.echo(f"flexspline: warning: {whose()}{printable(sentence)}", err=True)


def _completed(log: Log, known: Mapping[str, Any]) -> Log:
    from flexspline.logs.read import with_motor_torque

    tell("\n".join(log.history))
    missing = {key: value for key, value in known.items() if key not in log.facts}
    return with_motor_torque(log.with_facts(missing)) if missing else log


class Taught(click.Command):
    """A command whose help ends in lists that are made only when they are asked for."""

    def __init__(self, *args: Any, sections: Sequence[Section] = (), **extra: Any) -> None:
        super().__init__(*args, **extra)
        self.sections = sections

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the lists."""
        for section in self.sections:
            title, rows = section()
            with formatter.section(title):
                formatter.write_dl(rows)
        super().format_epilog(ctx, formatter)


def effects_by_target() -> tuple[str, list[tuple[str, str]]]:
    """Every effect of the catalogue, with the targets on which it acts."""
    from flexspline.effects import CATALOGUE

    title = "Effects (S: sensor_torque, M: motor_torque and motor_current, D: torsion)"
    return title, [(e.name, f"{e.targets:<3} {e.signature}") for e in CATALOGUE.values()]


def channels() -> tuple[str, list[tuple[str, str]]]:
    """Every channel of a run, with its unit."""
    from flexspline.logs.channels import CHANNELS

    rows = [(name, f"{each.unit:<6} {each.meaning}") for name, each in CHANNELS.items()]
    return "Channels; torques at the output are positive where the joint pushes in +q", rows


def formats() -> tuple[str, list[tuple[str, str]]]:
    """Every format of files."""
    from flexspline.logs.formats import format_rows
    from flexspline.logs.packed import PACKED

    return f"Formats of files, each also packed ({', '.join(PACKED)})", format_rows()


def repairs() -> tuple[str, list[tuple[str, str]]]:
    """Every repair, as it is written."""
    from flexspline.logs.repairs import REPAIRS, spelled

    meanings = ((spelled(name), textwrap.fill(r.meaning)) for name, r in REPAIRS.items())
    return "Repairs (none is done unless asked for)", list(meanings)
