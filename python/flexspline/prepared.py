"""Channels as a model expects them: made as in the runs that its effects were found in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from flexspline.logs.derive import differentiate, lowpass_log
from flexspline.logs.log import Log

__all__ = ["Preparation", "preparations_of", "prepared"]


@dataclass(frozen=True)
class Preparation:
    """How a channel was made before any effect read it: without phase, −3 dB at `bandwidth`.

    Parameters
    ----------
    channel : that is made.
    source : the same channel, then it is smoothed; or a position, whose derivative it is.
    bandwidth : Hz.
    """

    channel: str
    source: str
    bandwidth: float

    @property
    def how(self) -> str:
        """Return it in words, such as "smoothed at 16 Hz"."""
        made = "smoothed" if self.source == self.channel else f"derived from {self.source}"
        return f"{made} at {self.bandwidth:.3g} Hz"

    def __call__(self, log: Log) -> Log:
        """Return the log with the channel made so, once; as it is where it lacks the source.

        Raises
        ------
        InputError
            Where the bandwidth does not suit the log's rate, or the position is not finite.
        """
        note = f"{self.channel} as the model expects it: {self.how}"
        if self.source not in log or note in log.history:
            return log
        if self.source != self.channel:
            made = differentiate(log, bandwidth=self.bandwidth, of=self.source,
                                 channels=(self.channel,))  # fmt: skip
            return log.with_columns({self.channel: made[self.channel]}, note=note)
        values = np.array(log[self.channel])
        lost = ~np.isfinite(values)
        if lost.all():
            return log
        values[lost] = np.interp(np.flatnonzero(lost), np.flatnonzero(~lost), values[~lost])
        whole = log.with_columns({self.channel: values}, note=note)
        smooth = np.array(lowpass_log(whole, self.bandwidth, (self.channel,))[self.channel])
        smooth[lost] = np.nan
        return log.with_columns({self.channel: smooth}, note=note)

    def to_json(self) -> dict[str, Any]:
        """Return it as `model.json` holds it."""
        return asdict(self)


def preparations_of(record: Mapping[str, Any]) -> tuple[Preparation, ...]:
    """Return what a part's record says of its channels; models made before this say nothing."""
    return tuple(
        Preparation(str(one["channel"]), str(one["source"]), float(one["bandwidth"]))
        for one in record.get("prepared", ())
    )


def prepared(log: Log, preparations: Iterable[Preparation]) -> Log:
    """Return the log with all channels made as a model expects them."""
    for one in preparations:
        log = one(log)
    return log
