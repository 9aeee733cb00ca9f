"""`--joint A,B` and `--joint all`: a command for each joint of a robot, and one summary.

Each joint is a call of its own, and one that fails does not lose the others. Exit code 2 where one
failed, with its sentence on standard error; else 3 of `check`, where a joint cannot be fitted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from tqdm import tqdm

from flexspline.cli.speech import apart, found, say
from flexspline.errors import InputError, listed, printable

if TYPE_CHECKING:
    from flexspline.cli.options import Reading

__all__ = ["Summary", "for_joints"]

Summary = Callable[[Mapping[str, Any]], dict[str, Any]]
"""From what `--json` prints of a command to a row of the summary: text, numbers, None."""

ALL: Final = "all"
TABLE: Final = "joints.csv"
NAME: Final = re.compile(r"[\w.-]+")  # of a joint: it becomes the name of a folder
FAILED: Final = 2  # exit code: a joint could not be read or fitted
ERROR, UNIT = "_error", "_unit"  # endings of the names of a value's standard error and unit
REMARK: Final = "remark"  # of a row: a sentence below the table


@dataclass
class _Joint:
    """What became of one joint: a row of the summary, its exit code, or why it failed."""

    name: str
    row: dict[str, Any] = field(default_factory=dict)
    content: dict[str, Any] = field(default_factory=dict)
    code: int = 0
    failed: str = ""


def for_joints(
    command: Callable[..., Any],
    summary: Summary | None,
    asked: str,
    reading: Reading,
    given: Mapping[str, Any],
) -> Any:
    """Call a command for the joint that is asked for, or for each of several.

    ``{joint}`` in the name of a model, a servo's law or a simulation stands for the joint.

    Raises
    ------
    InputError
        Where a joint has no name that a folder can have or is named twice, the command takes one
        alone, or none of several can be done.
    """
    names = _names(asked, reading, given)
    if asked != ALL and len(names) == 1:
        return command(reading=replace(reading, joint=names[0]), **_of_joint(given, names[0], None))
    context = click.get_current_context()
    if summary is None:
        raise InputError(
            f"--joint {asked}: {context.command.name} takes one joint; give one of {listed(names)}"
        )
    out = given.get("out")
    if out is not None:
        from flexspline.cli.options import refuse_overwriting

        if "{joint}" in str(out):
            raise InputError(
                f"--out {out}: holds a folder for each of several joints; give a name without "
                "{joint}"
            )
        refuse_overwriting(out, _inputs(given), (TABLE,))
    made = [_done(command, summary, name, reading, given) for name in _shown(names)]
    _conclude(context, made, out)
    return None


def _names(asked: str, reading: Reading, given: Mapping[str, Any]) -> list[str]:
    names = [name.strip() for name in asked.split(",")]
    if names == [ALL]:
        if not _inputs(given):
            raise InputError("--joint all: there are no runs that tell the joints; name one")
        names = _all(reading, _inputs(given)[0])
    for name in names:
        if not NAME.fullmatch(name):
            raise InputError(
                f"--joint {asked}: '{name}' is no name of a joint; write --joint 3, --joint 1,2,3 "
                "or --joint all"
            )
        if names.count(name) > 1:
            raise InputError(f"--joint {asked}: {name} is named twice; name it once")
    return names


def _all(reading: Reading, recording: str) -> list[str]:
    """The joints that the recording has, and those of which the map alone knows.

    A map that goes by the numbers of columns has to list them.
    """
    from flexspline.logs.read import joints_of, read_map, splits
    from flexspline.logs.splitting import goes_by_number

    listed = list(read_map(reading.columns)["joints"]) if reading.columns is not None else []
    arguments = reading.with_map()
    columns = arguments.pop("columns", None) or {}
    for key in ("repair", *splits(arguments)):
        arguments.pop(key, None)
    if listed and "preset" not in arguments and goes_by_number(columns):
        return listed
    return list(dict.fromkeys([*joints_of(recording, columns, **arguments), *listed]))


def _inputs(given: Mapping[str, Any]) -> list[str]:
    """Names of the recordings of a call."""
    return list(given["runs"]) if "runs" in given else [given.get("run") or given["foreign"]]


def _of_joint(given: Mapping[str, Any], joint: str, out: str | None) -> dict[str, Any]:
    """The options of one joint, whose files carry its name."""

    def named(value: Any) -> Any:
        if isinstance(value, str):
            return value.replace("{joint}", joint)
        return tuple(map(named, value)) if isinstance(value, tuple) else value

    own = {name: named(value) for name, value in given.items()}
    return own if out is None else {**own, "out": out}


def _shown(names: Sequence[str]) -> Iterator[str]:
    from flexspline.cli.options import on_terminal

    yield from tqdm(names, "joints", unit="joint", disable=not on_terminal(), leave=False)


def _done(
    command: Callable[..., Any],
    summary: Summary,
    name: str,
    reading: Reading,
    given: Mapping[str, Any],
) -> _Joint:
    """Call the command for one joint, quietly."""
    made, out = _Joint(name), given.get("out")
    folder = None if out is None else f"{Path(out) / f'joint_{name}'}/"
    with apart(f"joint {name}: ") as content, _kept(made):
        command(reading=replace(reading, joint=name), **_of_joint(given, name, folder))
    made.content = dict(content)
    if not made.failed:
        made.row = summary(content)
    return made


@contextmanager
def _kept(made: _Joint) -> Iterator[None]:
    """Keep why a joint's call ended."""
    try:
        yield
    except click.exceptions.Exit as end:
        made.code = end.exit_code
    except InputError as error:
        made.code, made.failed = FAILED, str(error)
    except click.ClickException as error:
        made.code, made.failed = FAILED, error.format_message()


def _conclude(context: click.Context, made: Sequence[_Joint], out: str | None) -> None:
    """Print and write the summary, and end with the exit code of all."""
    wrong = [joint for joint in made if joint.failed]
    if len(wrong) == len(made):
        others = " (and no other joint can be done)" if len(made) > 1 else ""
        raise InputError(f"joint {wrong[0].name}: {wrong[0].failed}{others}")
    found({"joints": {joint.name: _said(joint) for joint in made}})
    say(_text(made))
    if out is not None:
        from flexspline.files import save_table

        save_table(_frame(made), Path(out) / TABLE)
        done = [f"joint_{joint.name}" for joint in made if not joint.failed]
        say(f"\nwrote {listed(done)} and {TABLE} to {Path(out)}")
    for joint in wrong:
        click.echo(f"flexspline: joint {joint.name}: {printable(joint.failed)}", err=True)
    code = FAILED if wrong else max(joint.code for joint in made)
    if code:
        context.exit(code)


def _said(joint: _Joint) -> dict[str, Any]:
    """What `--json` prints of a joint."""
    why = {"failed": joint.failed} if joint.failed else {}
    return {"exit_code": joint.code, **why, **joint.content}


def _frame(made: Sequence[_Joint]) -> Any:
    import pandas

    return pandas.DataFrame(
        [{"joint": joint.name, **joint.row, "failed": joint.failed or None} for joint in made]
    )


def _text(made: Sequence[_Joint]) -> str:
    """The summary as a table; the sentence of a joint that failed takes the place of its row."""
    from flexspline.formatting import rows_text

    done = [joint for joint in made if not joint.failed]
    keys = [key for key in dict.fromkeys(key for joint in done for key in joint.row)
            if not key.endswith((ERROR, UNIT)) and key != REMARK]  # fmt: skip
    rows = [["joint", *(_head(done, key) for key in keys)]]
    rows += [[joint.name, *(_cell(joint.row, key) for key in keys)] for joint in made]
    texts = {k for k, key in enumerate(keys, 1)
             if any(isinstance(joint.row.get(key), str) for joint in done)}  # fmt: skip
    lines = rows_text(rows, left=(0, *texts)).split("\n")
    wide = max(len(row[0]) for row in rows)
    for number, joint in enumerate(made, 1):
        if joint.failed:
            lines[number] = f"{joint.name:<{wide}}  failed: {printable(joint.failed)}"
    remarks = [(joint.name, joint.row.get(REMARK)) for joint in done]
    said = [f"joint {name}: {remark}" for name, remark in remarks if remark]
    return "\n".join([*lines, *(["", *said] if said else [])])


def _head(done: Sequence[_Joint], key: str) -> str:
    """The name of a column, with the unit that its values have in every joint."""
    from flexspline.formatting import short_names

    units = {str(joint.row[key + UNIT]) for joint in done if joint.row.get(key + UNIT)}
    name = short_names(key).replace("_", " ")
    return f"{name} [{units.pop()}]" if len(units) == 1 else name


def _cell(row: Mapping[str, Any], key: str) -> str:
    from flexspline.formatting import plus_minus, short

    value, error = row.get(key), row.get(key + ERROR)
    if isinstance(value, float) and isinstance(error, float):
        return plus_minus(value, error)
    return short(value) if isinstance(value, float) else "–" if value is None else str(value)
