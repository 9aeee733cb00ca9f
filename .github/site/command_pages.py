"""The command reference: what `flexspline COMMAND --help` prints, a page each."""

from __future__ import annotations

from pathlib import Path

import click

from flexspline.cli import commands

WIDTH = 92  # columns; what a page shows without a bar to scroll


def write_commands(folder: Path) -> None:
    """Write a page for each command, and one that lists them."""
    folder.mkdir()
    names = list(commands.commands)
    for name in names:
        command = commands.commands[name]
        context = click.Context(
            command,
            info_name=f"flexspline {name}",
            max_content_width=WIDTH,
            terminal_width=WIDTH,
            help_option_names=["-h", "--help"],
        )
        text = f"# flexspline {name}\n\n```text\n{command.get_help(context)}\n```\n"
        for inner in getattr(command, "commands", {}):
            text += _inner(name, inner, command.commands[inner])
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
    context = click.Context(commands, info_name="flexspline", terminal_width=WIDTH)
    entries = "\n".join(names)
    (folder / "index.md").write_text(
        f"# Commands\n\n```text\n{commands.get_help(context)}\n```\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n\n{entries}\n```\n",
        encoding="utf-8",
    )


def _inner(group: str, name: str, command: click.Command) -> str:
    """The section of a command within a command."""
    context = click.Context(
        command,
        info_name=f"flexspline {group} {name}",
        max_content_width=WIDTH,
        terminal_width=WIDTH,
        help_option_names=["-h", "--help"],
    )
    return f"\n## flexspline {group} {name}\n\n```text\n{command.get_help(context)}\n```\n"
