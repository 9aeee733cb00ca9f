"""A second recorder's log put on the time of the first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexspline.errors import InputError, listed
from flexspline.logs.clock import Clock, find_clock
from flexspline.logs.log import Log
from flexspline.logs.sampling import has_value, increasing_time, sampled

__all__ = ["Merged", "merge"]


class Merged(NamedTuple):
    """The log with the channels of both, and the second recorder's clock."""

    log: Log
    clock: Clock


def merge(
    log: Log,
    other: Log,
    *,
    channels: Sequence[str] | None = None,
    offset: float | None = None,
    drift: float | None = None,
    align: tuple[str, str] | None = None,
) -> Merged:
    """Put channels of a second recorder, such as a load cell, on the time of a log.

    Parameters
    ----------
    log, other : Log
        Two recordings of one run, each with its own strictly increasing time.
    channels : sequence of str, optional
        What to take from `other`; by default all that `log` does not have.
    offset : float, optional
        What the other's clock shows more than the log's at the log's first row [s].
    drift : float, optional
        How much faster the other's clock runs [ppm].
    align : (str, str), optional
        A channel of `log` and one of `other` that see the same thing: what is not given of
        offset and drift is found by them (`flexspline.logs.clock`). Without it, a drift
        that is not given is 0.

    Returns
    -------
    Merged
        (log, clock). Rows of `log` where `other` has no value are dropped; the history says
        how many, and the clock with its standard errors.

    Raises
    ------
    InputError
        Where neither offset nor align is given, a channel is missing or there twice, the
        channels of `align` hardly correlate, or the logs do not overlap.
    """
    names = _wanted(log, other, channels)
    time, theirs = increasing_time(log, "merge"), increasing_time(other, "merge")
    if align is not None:
        clock = find_clock(log, other, align, offset=offset, drift=drift)
    elif offset is not None:
        clock = Clock(offset, drift or 0.0)
    else:
        raise InputError(
            f"log '{other.name}': its clock against that of log '{log.name}' is not "
            "known; give offset, or align with two channels that see the same thing"
        )
    at = clock.at(time, float(time[0]))
    inside = has_value(theirs, at)
    if not inside.any():
        raise InputError(
            f"logs '{log.name}' and '{other.name}' do not overlap with {clock}; "
            "correct the offset or read logs of the same time"
        )
    columns = {name: sampled(name, theirs, other[name], at) for name in names}
    origin = f" ({other.source.path}, SHA-256 {other.source.sha256})" if other.source else ""
    note = (
        f"{listed(names)} merged from log '{other.name}'{origin}, whose clock has {clock}; "
        f"rows where it has no value, dropped: {np.count_nonzero(~inside)}"
    )
    return Merged(log.with_columns(columns, note=note).rows(inside, note=""), clock)


def _wanted(log: Log, other: Log, channels: Sequence[str] | None) -> list[str]:
    if channels is None:
        names = [name for name in other.channels if name not in log]
    else:
        names = list(channels)
    for name in names:
        other[name]
        if name in log:
            raise InputError(
                f"log '{log.name}': has '{name}' already, so that of log "
                f"'{other.name}' cannot be merged; leave it out of channels"
            )
    if not names:
        raise InputError(
            f"log '{other.name}': has no channel that log '{log.name}' has not; "
            "name what to merge with channels"
        )
    return names
