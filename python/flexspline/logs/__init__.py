"""Logs: reading, checking, repairing and deriving the channels of a run."""

from flexspline.logs.channels import CHANNELS, Channel
from flexspline.logs.clock import Clock, find_clock
from flexspline.logs.columns import ColumnSource
from flexspline.logs.convert import convert, write_log
from flexspline.logs.log import Log, Source
from flexspline.logs.merge import Merged, merge
from flexspline.logs.read import read_log
from flexspline.logs.repairs import REPAIRS, repaired

__all__ = [
    "CHANNELS",
    "REPAIRS",
    "Channel",
    "Clock",
    "ColumnSource",
    "Log",
    "Merged",
    "Source",
    "convert",
    "find_clock",
    "merge",
    "read_log",
    "repaired",
    "write_log",
]
