"""How a call speaks, and what it does to files that are there: options of every command.

Text for a person goes to standard output, warnings and progress to standard error. `--json` puts
one object in the place of the text, for scripts.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

import click

from flexspline.errors import listed, printable
from flexspline.files import Writing, writing
from flexspline.progress import above_progress

__all__ = ["apart", "found", "is_json", "is_quiet", "say", "speaking", "spoken", "tell", "whose"]


@dataclass
class _Speech:
    """What was asked of a call, and what it has to say at its end."""

    json: bool = False
    quiet: bool = False
    verbose: bool = False
    whose: str = ""
    object: dict[str, Any] = field(default_factory=dict)


_SPEECH: ContextVar[_Speech] = ContextVar("speech")


def _speech() -> _Speech:
    return _SPEECH.get(None) or _Speech()


@contextmanager
def speaking() -> Iterator[Callable[[str | None, int], None]]:
    """Let a call speak by its options; gives what ends it: its command's name and exit code."""
    began, before = time.monotonic(), _SPEECH.set(_Speech())
    try:
        with writing() as record:
            yield lambda command, code: _end(record, command, code, time.monotonic() - began)
    finally:
        _SPEECH.reset(before)


def _end(record: Writing, command: str | None, code: int, seconds: float) -> None:
    speech = _speech()
    kept = [str(path) for path in record.kept]
    if kept:
        say(f"kept what was there before: {listed(map(printable, kept))}")
    tell(f"done in {seconds:.1f} s")
    if speech.json and command is not None:
        written = [str(path) for path in record.written]
        content = {"command": command, "exit_code": code, "wrote": written, "kept": kept}
        click.echo(json.dumps(_plain({**content, **speech.object}), allow_nan=False))


def _plain(value: Any) -> Any:
    from flexspline.schema import plain_json

    return plain_json(value)


def say(text: object = "") -> None:
    """Print text for a person on standard output, unless that is asked to be quiet or JSON."""
    speech = _speech()
    if not (speech.quiet or speech.json):
        click.echo(str(text))


def tell(text: object) -> None:
    """Print on standard error what `-v` asks for."""
    if _speech().verbose:
        with above_progress(sys.stderr):
            for line in str(text).splitlines():
                click.echo(f"flexspline: {whose()}{printable(line)}", err=True)


def found(content: Mapping[str, Any]) -> None:
    """Add to the object that `--json` prints."""
    _speech().object.update(content)


@contextmanager
def apart(whose: str) -> Iterator[dict[str, Any]]:
    """Let a call within a call print no text; gives what it finds. `whose` begins its warnings."""
    before = _SPEECH.set(_Speech(json=True, quiet=True, verbose=_speech().verbose, whose=whose))
    try:
        yield _speech().object
    finally:
        _SPEECH.reset(before)


def whose() -> str:
    """What begins a warning: of which call within a call it is."""
    return _speech().whose


def is_json() -> bool:
    """Whether what is found is asked for: for scripts, or for the summary of several joints."""
    return _speech().json


def is_quiet() -> bool:
    """Whether no progress is to be shown."""
    return _speech().quiet or _speech().json


def spoken(command: click.Command) -> click.Command:
    """Give a command the options of speech."""

    def asked(name: str) -> Callable[[click.Context, click.Parameter, bool], None]:
        def set_it(ctx: click.Context, param: click.Parameter, value: bool) -> None:
            if value:
                setattr(_speech(), name, True)

        return set_it

    def refuse(ctx: click.Context, param: click.Parameter, value: bool) -> None:
        if value:
            Writing.current().refuse = True

    for names, says, then in (
        (["--no-overwrite"], "Refuse to replace a file; else it is kept as NAME.previous.", refuse),
        (["--json"], "Print one JSON object instead of text, for scripts.", asked("json")),
        (["-q", "--quiet"], "Print no text and no progress, only what is wrong.", asked("quiet")),
        (["-v", "--verbose"], "Say on standard error what is read and done.", asked("verbose")),
    ):
        command.params.append(
            click.Option(
                names, is_flag=True, help=says, callback=then, expose_value=False, is_eager=True
            )
        )
    return command
