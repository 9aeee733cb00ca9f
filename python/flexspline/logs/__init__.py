"""Logs: reading, checking, repairing, merging and deriving the channels of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexspline.lazy import attached

if TYPE_CHECKING:
    from flexspline.logs.channels import CHANNELS, Channel
    from flexspline.logs.checks import Finding, Findings, check
    from flexspline.logs.columns import ColumnSource
    from flexspline.logs.derive import (
        decimate,
        differentiate,
        differentiate_causal,
        lowpass,
        lowpass_log,
        resample,
    )
    from flexspline.logs.log import Log, Source
    from flexspline.logs.merging import Clock, Merged, find_clock, merge
    from flexspline.logs.read import (
        convert,
        joints_of,
        read_log,
        read_pieces,
        read_runs,
    )
    from flexspline.logs.repairs import REPAIRS, repaired
    from flexspline.logs.segments import Segment
    from flexspline.logs.writing import write_log

__all__ = [
    "CHANNELS",
    "REPAIRS",
    "Channel",
    "Clock",
    "ColumnSource",
    "Finding",
    "Findings",
    "Log",
    "Merged",
    "Segment",
    "Source",
    "check",
    "convert",
    "decimate",
    "differentiate",
    "differentiate_causal",
    "find_clock",
    "joints_of",
    "lowpass",
    "lowpass_log",
    "merge",
    "read_log",
    "read_pieces",
    "read_runs",
    "repaired",
    "resample",
    "write_log",
]

_HOME = {
    "CHANNELS": "channels",
    "REPAIRS": "repairs",
    "Channel": "channels",
    "Clock": "merging",
    "ColumnSource": "columns",
    "Finding": "checks",
    "Findings": "checks",
    "Log": "log",
    "Merged": "merging",
    "Segment": "segments",
    "Source": "log",
    "check": "checks",
    "convert": "read",
    "decimate": "derive",
    "differentiate": "derive",
    "differentiate_causal": "derive",
    "find_clock": "merging",
    "joints_of": "read",
    "lowpass": "derive",
    "lowpass_log": "derive",
    "merge": "merging",
    "read_log": "read",
    "read_pieces": "read",
    "read_runs": "read",
    "repaired": "repairs",
    "resample": "derive",
    "write_log": "writing",
}

__getattr__ = attached(__name__, _HOME)


def __dir__() -> list[str]:
    return __all__
