"""One joint over many sessions: its parameters over calendar time, what changed, what it will need.

`history_of` makes estimates of models or runs, `track` says what became of them.
"""

from flexspline.tracking.history import History
from flexspline.tracking.result import Change, Forecast, Track, TrackedParameter
from flexspline.tracking.sources import history_of
from flexspline.tracking.tracking import track

__all__ = ["Change", "Forecast", "History", "Track", "TrackedParameter", "history_of", "track"]
