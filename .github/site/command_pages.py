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
        text = f"# {_help(f'flexspline {name}', command)}"
        for inner in getattr(command, "commands", {}):
            text += f"\n## {_help(f'flexspline {name} {inner}', command.commands[inner])}"
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
    context = click.Context(commands, info_name="flexspline", terminal_width=WIDTH)
    entries = "\n".join(names)
    (folder / "index.md").write_text(
        f"# Commands\n\n```text\n{commands.get_help(context)}\n```\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n\n{entries}\n```\n",
        encoding="utf-8",
    )


def _help(name: str, command: click.Command) -> str:
    """The name of a command, and what its help prints."""
    context = click.Context(
        command,
        info_name=name,
        max_content_width=WIDTH,
        terminal_width=WIDTH,
        help_option_names=["-h", "--help"],
    )
    return f"{name}\n\n```text\n{command.get_help(context)}\n```\n"
