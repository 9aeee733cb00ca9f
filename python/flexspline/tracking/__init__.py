"""One joint over many sessions: its parameters over calendar time, what changed, what it will need.

`history_of` makes estimates of models or runs, `track` says what became of them; `track_fleet` does
so for all joints of a fleet.
"""

from flexspline.tracking.fleet import FleetTrack, history_of_sums, track_fleet
from flexspline.tracking.history import History, history_of
from flexspline.tracking.result import Change, Forecast, Track, TrackedParameter
from flexspline.tracking.tracking import track

__all__ = [
    "Change",
    "FleetTrack",
    "Forecast",
    "History",
    "Track",
    "TrackedParameter",
    "history_of",
    "history_of_sums",
    "track",
    "track_fleet",
]
