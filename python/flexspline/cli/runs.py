"""Reading the runs that a command is given."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

from flexspline.errors import InputError, printable

if TYPE_CHECKING:
    from flexspline.logs.log import Log

__all__ = ["Reading", "on_terminal", "refuse_overwriting", "simulations", "warn"]

SIMULATED = "simulated_torque"  # the channel; its own module takes long to import


@dataclass(frozen=True)
class Reading:
    """How runs are read: the options that `cli.options.reading` adds.

    Parameters
    ----------
    facts : of the joint; they overrule those in the files.
    repair : repairs by name, in order.
    columns : path of a column map, or None.
    rate : Hz, of files without time stamps.
    """

    facts: Mapping[str, Any] = field(default_factory=dict)
    repair: tuple[str, ...] = ()
    columns: str | None = None
    rate: float | None = None

    @property
    def arguments(self) -> dict[str, Any]:
        """What was given, as arguments of `read_log`."""
        given = {**self.facts, "repair": self.repair, "rate": self.rate}
        return {key: value for key, value in given.items() if value}

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
        for number, path in enumerate(paths):
            if Path(path).resolve() in (Path(other).resolve() for other in paths[:number]):
                raise InputError(f"{path}: is given twice; give each run once")
        arguments = with_simulated(self._with_map(), simulated_torque)
        quiet = not on_terminal()
        return [
            _completed(path, arguments, known or {})
            for path in tqdm(paths, "reading", unit="run", disable=quiet, leave=False, delay=1.0)
        ]

    def _with_map(self) -> dict[str, Any]:
        if self.columns is None:
            return self.arguments
        from flexspline.logs.read import read_map

        sections = read_map(self.columns)
        mapped = {"columns": sections["columns"], "facts": sections["facts"]}
        return {**sections["read"], **mapped, **self.arguments}


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
    return sys.stderr.isatty()


def refuse_overwriting(out: str, inputs: Sequence[str]) -> None:
    """Raise `InputError` where the file to write is one of those that are read."""
    for path in inputs:
        if Path(path).resolve() == Path(out).resolve():
            raise InputError(f"--out {out}: would overwrite what is read; give another name")


def warn(sentences: Sequence[str]) -> None:
    """Print each sentence on a line of standard error."""
    for sentence in sentences:
        click.echo(f"flexspline: warning: {printable(sentence)}", err=True)


def _completed(path: str, arguments: Mapping[str, Any], known: Mapping[str, Any]) -> Log:
    from flexspline.logs.read import read_log, with_motor_torque

    log = read_log(path, **arguments)
    missing = {key: value for key, value in known.items() if key not in log.facts}
    return with_motor_torque(log.with_facts(missing)) if missing else log
