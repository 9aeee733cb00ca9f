"""`flexspline demo`: the whole path on a rig that the package simulates itself."""

from __future__ import annotations

import click

__all__ = ["demo"]


@click.command()
@click.option(
    "--out", default="flexspline-demo", show_default=True, metavar="DIR", help="Folder to write."
)
def demo(out: str) -> None:
    """See the whole path work, without any data of your own.

    Simulates a joint whose torque sensor shows more physics than the model that is fitted
    first, finds the effect that is hidden in the runs, and leaves in DIR the runs, model.json,
    report.html, the figures and a C++ header. The printed lines tell the story.

    \b
    Example:
      flexspline demo --out flexspline-demo
    """
    from flexspline.demo import demo as run_demo

    run_demo(out, say=click.echo)
