"""What the estimates lose where a device derives velocity and acceleration itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.estimation.chain import estimate
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.model import Model
from flexspline.report.numbers import short

__all__ = ["derived_on_device"]

START = 0.5  # s, of which the filter and the observers behind it remember nothing later
DERIVED = ("output_velocity", "output_acceleration")


def derived_on_device(model: Model, log: Log) -> tuple[str, ...]:
    """Return sentences on how far the core's causal filter moves each external torque [Nm].

    Both runs are the host's chain in double: with the log's own velocity and acceleration, and with
    those of `flexspline/estimators/differentiator.hpp` in their place. A log that has none of its
    own has one run, which is the device's; then there is nothing to say.
    """
    own = [name for name in DERIVED if name in log]
    if not own or "output_position" not in log:
        return ()
    kept = {name: log[name] for name in log.channels if name not in own}
    try:
        analysed = estimate(model, log)
        derived = estimate(model, Log.from_arrays(facts=dict(log.facts), **kept))
    except InputError:
        return ()  # what is wrong with the log is said elsewhere
    moved, settled = [], _settled(log)
    for name in analysed.columns:
        apart = analysed[name] - derived[name] if name in derived else np.full(len(log), np.nan)
        apart = apart[settled & np.isfinite(apart)]
        if name.startswith("external") and apart.size:
            rms = float(np.sqrt(np.mean(apart**2)))
            most = float(np.abs(apart).max())
            moved.append(f"{name} by {short(rms, 3)} Nm RMS, {short(most, 3)} at most")
    if not moved:
        return ()
    how = [note.split(": ")[-1] for note in derived.notes if note.startswith("derived from")]
    return (
        f"with {listed(own)} from the core's causal filter ({'; '.join(how)}) in place of the "
        f"log's own, and {START:g} s behind each start left out, these move: {'; '.join(moved)}",
    )


def _settled(log: Log) -> NDArray[np.bool_]:
    """Rows in which the filter, which starts at rest, has forgotten its start, (N,)."""
    time = log["time"]
    starts = np.zeros(len(time))
    for first, last in runs(time):
        starts[first:last] = time[first]
    return np.asarray(time - starts >= START)
