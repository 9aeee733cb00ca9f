"""Logs: reading, checking, repairing, merging and deriving the channels of a run."""

from flexspline.logs.causal import differentiate_causal
from flexspline.logs.channels import CHANNELS, Channel
from flexspline.logs.checks import Finding, Findings, check
from flexspline.logs.clock import Clock, find_clock
from flexspline.logs.columns import ColumnSource
from flexspline.logs.convert import convert, write_log
from flexspline.logs.derive import decimate, differentiate, lowpass, lowpass_log, resample
from flexspline.logs.log import Log, Source
from flexspline.logs.merge import Merged, merge
from flexspline.logs.read import read_log
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
