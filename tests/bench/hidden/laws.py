"""Whether each name lowers the error on runs that neither fit nor selection saw.

The model that was found, as it is, against the base and the names before one: plain least squares
on the rows of the given runs that the fit of that model counted, with its shapes and channels. The
errors are those on the unseen runs, recorded by the same recorder; drives at rest do not count.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.discovery.result import Discovery
from flexspline.logs.checks.ends import DRIVES, resting
from flexspline.logs.log import Log
from flexspline.model import Part
from flexspline.prepared import prepared
from flexspline.signals import channels_for, core_channels, gear_of, target_of
from hidden.made import Made
from hidden.rig import Array

__all__ = ["unseen_errors"]

BLOCK = 0.5  # s: squares of errors in blocks of this length are independent


def unseen_errors(made: Made, found: Discovery) -> tuple[tuple[float, float, float], ...]:
    """Return of each name RMSE before and after it, in the target's unit, and the difference.

    The last number is the mean difference of the squares in its standard errors, from blocks.
    """
    part = found.model.part(found.target)
    known = {name: found.model.facts[name] for name in ("gear_ratio",) if name in found.model.facts}
    given, more = ([_columns(part, log.with_facts(known)) for log in logs]
                   for logs in (made.logs, made.unseen))  # fmt: skip
    fitted_to = zip(made.logs, found.fit.runs, strict=True)  # a drive on time lacks rows at the end
    counts = np.concatenate([np.isin(log["time"], run.log["time"][run.counts])
                             for log, run in fitted_to])  # fmt: skip
    rows, y, there, _ = (np.concatenate(parts) for parts in zip(*given, strict=True))
    rows, y = rows[there & counts], y[there & counts]
    owners = np.array([e.name for e in part.effects for _ in e.terms])
    free = part.coefficients != 0.0  # what the fit holds at zero is no column of the base either
    added, errors = list(found.names), []
    for count in range(len(added) + 1):
        used = free & ~np.isin(owners, added[count:])
        fitted = np.linalg.lstsq(rows[:, used], y, rcond=1e-9)[0]
        beta = part.coefficients[used] if count == len(added) else fitted
        errors.append([target[on] - own[on][:, used] @ beta for own, target, on, _ in more])
    steps = [block[on] for _, _, on, block in more]
    return tuple(_compared(errors[k], errors[k + 1], steps) for k in range(len(added)))


def _columns(part: Part, log: Log) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.intp]]:
    """Rows of all effects (N, C), target (N,), whether a row counts, and its block, (N,)."""
    log = channels_for(prepared(log, part.preparations), part.effects, part.known_load,
                       load_needed=False)  # fmt: skip
    gear = gear_of(log.facts, "motor_position" in log)
    design = _core.Design([e.for_core() for e in part.effects], **gear)
    channels = core_channels(log, part.effects, part.known_load)
    rows = np.asarray(design.rows(channels, len(log), part.coefficients))
    y = target_of(log, part.target, part.known_load)
    counts = np.isfinite(y) & np.all(np.isfinite(rows), axis=1)
    if part.target in DRIVES:
        counts &= ~resting(log)
    block = ((log["time"] - log["time"][0]) / BLOCK).astype(np.intp)
    return rows, y, counts, block


def _compared(
    before: Sequence[Array], after: Sequence[Array], blocks: Sequence[NDArray[np.intp]]
) -> tuple[float, float, float]:
    every = [np.concatenate(errors) ** 2 for errors in (before, after)]
    gains = []
    for first, second, block in zip(before, after, blocks, strict=True):
        sums = np.bincount(block, weights=first**2 - second**2)
        gains.append(sums[np.bincount(block) > 0])
    gain = np.concatenate(gains)
    error = float(np.std(gain, ddof=1) / np.sqrt(len(gain)))
    rmse = [float(np.sqrt(np.mean(squares))) for squares in every]
    return rmse[0], rmse[1], float(np.mean(gain)) / error if error > 0.0 else 0.0
