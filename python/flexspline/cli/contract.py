"""Exit codes and the one line on standard error.

0 done    1 a defect    2 wrong input or call    3 of check alone: the data forbid a fit
130 interrupted    141 reader went away
"""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from click.shell_completion import shell_complete

from flexspline.cli.speech import speaking
from flexspline.errors import InputError, did_you_mean, listed, one_line

__all__ = ["Commands"]

COMPLETE = "_FLEXSPLINE_COMPLETE"  # what a shell asks for, in this variable

DEFECT, WRONG, INTERRUPTED, NO_READER = 1, 2, 130, 141
TRACEBACK = "FLEXSPLINE_TRACEBACK"


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
            return _say("interrupted; nothing was written", INTERRUPTED)
        except OSError as error:
            return _say(f"{error.filename or 'standard output'}: {error.strerror or error}", WRONG)
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
