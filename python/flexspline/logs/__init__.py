"""Logs: reading, checking, repairing, merging and deriving the channels of a run."""

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
from flexspline.logs.merge import Clock, Merged, find_clock, merge
from flexspline.logs.read import convert, read_log, write_log
from flexspline.logs.repairs import REPAIRS, repaired
from flexspline.logs.segments import Segment

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
    "lowpass",
    "lowpass_log",
    "merge",
    "read_log",
    "repaired",
    "resample",
    "write_log",
]
