"""Help texts that list what there is: effects, repairs."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from typing import Any

import click

__all__ = ["Taught", "effects_by_target", "repairs"]

Section = Callable[[], tuple[str, list[tuple[str, str]]]]


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


def repairs() -> tuple[str, list[tuple[str, str]]]:
    """Every repair, as it is written."""
    from flexspline.logs.repairs import REPAIRS, spelled

    meanings = ((spelled(name), textwrap.fill(r.meaning)) for name, r in REPAIRS.items())
    return "Repairs (none is done unless asked for)", list(meanings)
