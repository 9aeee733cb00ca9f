"""Fleets of joints: fit, discover and compare for hundreds, and what they have in common.

A folder for each joint with its runs in it is a fleet. Runs are read where they lie, by processes
of this machine or of a Dask cluster:

    made = flexspline.fleet.fit("line7", "sensor_torque", ["offset", "coulomb_friction"])
    print(made)                      # mean, spread, who stands out
    made.model("joint07")            # values of one joint, given its log and the fleet
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexspline.lazy import attached

if TYPE_CHECKING:
    from flexspline.fleet.accumulators import RunSums, accumulators_of
    from flexspline.fleet.each_joint import FleetComparison, FleetDiscovery, compare, discover
    from flexspline.fleet.fitting import fit, fit_sums
    from flexspline.fleet.plan import Plan
    from flexspline.fleet.result import FleetFit
    from flexspline.fleet.sessions import Session, Sessions, mean_temperature, sessions_of

__all__ = [
    "FleetComparison",
    "FleetDiscovery",
    "FleetFit",
    "Plan",
    "RunSums",
    "Session",
    "Sessions",
    "accumulators_of",
    "compare",
    "discover",
    "fit",
    "fit_sums",
    "mean_temperature",
    "sessions_of",
]

_HOME = {
    "FleetComparison": "each_joint",
    "FleetDiscovery": "each_joint",
    "FleetFit": "result",
    "Plan": "plan",
    "RunSums": "accumulators",
    "Session": "sessions",
    "Sessions": "sessions",
    "accumulators_of": "accumulators",
    "compare": "each_joint",
    "discover": "each_joint",
    "fit": "fitting",
    "fit_sums": "fitting",
    "mean_temperature": "sessions",
    "sessions_of": "sessions",
}

__getattr__ = attached(__name__, _HOME)
