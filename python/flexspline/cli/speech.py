"""How a call speaks and ends: options of every command, one line for a failure, exit codes.

Text for a person goes to standard output, warnings and progress to standard error. `--json` puts
one object in the place of the text, for scripts.

The exit codes:

0 done    1 a defect    2 wrong input or call    3 of check alone: the data forbid a fit
130 interrupted    141 reader went away
"""

from __future__ import annotations

import json
import os
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.shell_completion import shell_complete

from flexspline.errors import InputError, did_you_mean, listed, one_line, printable
from flexspline.files import Writing, writing
from flexspline.progress import above_progress

__all__ = [
    "Commands",
    "apart",
    "found",
    "is_json",
    "is_quiet",
    "say",
    "speaking",
    "spoken",
    "tell",
    "whose",
]


COMPLETE = "_FLEXSPLINE_COMPLETE"  # what a shell asks for, in this variable

DEFECT, WRONG, INTERRUPTED, NO_READER = 1, 2, 130, 141
TRACEBACK = "FLEXSPLINE_TRACEBACK"
POOLS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
NOTHING = "nothing was written"


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
    """Give a command the options of speech, and `--threads` where it has none of its own."""

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
    if "threads" not in [param.name for param in command.params]:
        command.params.append(
            click.Option(
                ["--threads"],
                type=click.IntRange(1, 1024),
                metavar="COUNT",
                help="Of linear algebra; by default one for each processor.",
                callback=_limited,
                expose_value=False,
                is_eager=True,
            )
        )
    return command


def _limited(ctx: click.Context, param: click.Parameter, value: int | None) -> None:
    """Let linear algebra use so many threads, of libraries that are loaded and those to come."""
    if value is None or ctx.resilient_parsing:
        return
    from threadpoolctl import threadpool_limits

    before = {name: os.environ.get(name) for name in POOLS}
    os.environ.update(dict.fromkeys(POOLS, str(value)))
    ctx.call_on_close(partial(_restored, before))
    ctx.with_resource(threadpool_limits(value))


def _restored(before: Mapping[str, str | None]) -> None:
    for name, value in before.items():
        os.environ.pop(name, None)
        os.environ.update({} if value is None else {name: value})


class Commands(click.Group):
    """A group whose failures are one line each, with the exit codes of the contract."""

    def main(  # type: ignore[override]
        self, args: Sequence[str] | None = None, prog_name: str | None = None, **_: Any
    ) -> None:
        """Run, and leave by `SystemExit`."""
        if asked := os.environ.get(COMPLETE):
            sys.exit(shell_complete(self, {}, prog_name or "flexspline", COMPLETE, asked))
        before = os.environ.get("MPLBACKEND")
        os.environ["MPLBACKEND"] = "Agg"  # a notebook's own may not be installed here
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                given = list(sys.argv[1:] if args is None else args)
                sys.exit(self._code(prog_name or "flexspline", given))
        finally:
            del os.environ["MPLBACKEND"]
            os.environ.update({} if before is None else {"MPLBACKEND": before})

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Find the command; an unknown one is answered with the nearest."""
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            near = did_you_mean(args[0], self.commands)
            ctx.fail(f"there is no command '{args[0]}'{near}; give {listed(self.commands)}")
        return super().resolve_command(ctx, args)

    # One clause for each way in which a call ends: it is the list of them.
    def _code(self, name: str, args: list[str]) -> int:
        context = None
        try:
            ran = False  # and not ended by --help
            with speaking() as end_with:
                try:
                    with self.make_context(name, args) as context:
                        self.invoke(context)
                    code, ran = 0, True
                except click.exceptions.Exit as end:
                    code = end.exit_code
                ended = code != 0 or ran
                end_with(context.invoked_subcommand if context and ended else None, code)
            sys.stdout.flush()
            return code
        except click.UsageError as error:
            return _usage(error)
        except click.ClickException as error:
            return _say(error.format_message(), WRONG)
        except InputError as error:
            return _say(str(error), WRONG)
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            return NO_READER
        except (click.Abort, KeyboardInterrupt):
            return _say(f"interrupted; {NOTHING}", INTERRUPTED)
        except OSError as error:
            return _say(f"{error.filename or 'standard output'}: {error.strerror or error}", WRONG)
        except MemoryError:
            return _say("memory ends: give fewer or shorter runs, or make room; " + NOTHING, WRONG)
        except Exception as error:
            return _defect(error)


def _usage(error: click.UsageError) -> int:
    command = error.ctx.command_path if error.ctx else "flexspline"
    return _say(f"{error.format_message().rstrip('.')}; see: {command} --help", WRONG)


def _defect(error: Exception) -> int:
    if os.environ.get(TRACEBACK):
        traceback.print_exception(error)
    frames = traceback.extract_tb(error.__traceback__)
    where = f" in {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    return _say(
        f"a defect of flexspline, not of your input: {type(error).__name__}: {error}{where}; "
        f"run again with {TRACEBACK}=1 for the traceback and report it",
        DEFECT,
    )


def _say(message: str, code: int) -> int:
    """Print one line on standard error, whatever the message's own line ends and control signs."""
    click.echo(f"flexspline: {one_line(' '.join(message.split()))}", err=True)
    return code
