"""The command line: each command is one call of the package, and others script against it."""

from __future__ import annotations

import sys

import click

from flexspline.about import __version__
from flexspline.cli.demo import demo, reproduce
from flexspline.cli.discover import compare, discover, models
from flexspline.cli.export import certify, export
from flexspline.cli.fit import calibrate, fit
from flexspline.cli.fleet import fleet, track
from flexspline.cli.logs import check, convert, init, orders
from flexspline.cli.predict import estimate, predict, simulate
from flexspline.cli.speech import Commands, spoken

__all__ = ["commands", "main"]


@click.group(
    cls=Commands,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, message="flexspline %(version)s")
def commands() -> None:
    """Find out what a robot joint with a strain wave gear does to your torque.

    A joint's torque sensor (or its motor current) shows the load and everything the joint
    itself adds: friction, ripple, drift, inertia. flexspline fits those effects to logs of a
    rig, says how sure it is, and exports the model for the controller.

    \b
    The path:
      begin    with any recorder's file       flexspline init (guesses the column map)
      read     your runs, CSV in SI units     flexspline convert (from other formats)
      check    are the data sound?            flexspline check
      orders   what turns with the joint      flexspline orders
      calibrate  a bridge's volts to torque   flexspline calibrate
      fit      effects to a target            flexspline fit
      judge    held-out error, confounding    what fit prints, and report.html
      predict  held-out runs                  flexspline predict
      simulate the motion from its inputs     flexspline simulate
      compare  where model and runs disagree  flexspline compare
      models   of one target, side by side    flexspline compare-models
      discover which effect is missing        flexspline discover
      track    one joint over months          flexspline track
      estimate the torque from outside        flexspline estimate
      fleet    the same of many joints        flexspline fleet
      export   constants for the robot        flexspline export
      certify  the robot computes the same    flexspline certify

    \b
    See it work, no data needed:
      flexspline demo
      flexspline reproduce all --out papers     (the papers' claims beside ours)

    \b
    On your own runs:
      flexspline fit run1.csv run2.csv --target sensor_torque --gear-ratio 100 \\
          --effects offset,coulomb_friction,viscous_friction --out joint
      flexspline predict --model joint/model.json run3.csv --out residual.csv
      flexspline export --model joint/model.json --format header --out joint.hpp

    Each command explains itself: flexspline fit --help. With --json it prints one object for
    scripts, with -q nothing, and a file that it replaces stays as NAME.previous. Exit codes: 0
    done; 2 the input or the call is wrong, and one line on standard error says what to do; 1 a
    defect of flexspline; 3, of check alone, the data forbid a fit.

    \b
    Tab completion in this bash (or zsh_source, fish_source):
      eval "$(_FLEXSPLINE_COMPLETE=bash_source flexspline)"
    """


COMMANDS = (
    init, check, orders, fit, calibrate, predict, simulate, compare, models, discover, track,
    fleet, estimate, export, certify, convert, demo, reproduce,
)  # fmt: skip

for command in COMMANDS:
    commands.add_command(spoken(command))


def main() -> None:
    """Run the command line and end the process with its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that has no "±" gets a "?"
    commands(prog_name="flexspline")
