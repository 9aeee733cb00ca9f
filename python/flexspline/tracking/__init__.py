"""One joint over many sessions: its parameters over calendar time, what changed, what it will need.

`history_of` makes estimates of models or runs, `track` says what became of them; `track_fleet` does
so for all joints of a fleet.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.lazy import attached
from flexspline.least_squares.options import resolve
from flexspline.tracking.attribution import (
    SCALE,
    Told,
    detected,
    drawn,
    moved,
    moves,
    negative,
    other_ranges,
    turned_by,
)
from flexspline.tracking.changes import (
    INTERVAL,
    LEAST_SESSIONS,
    SHAPES,
    STEP,
    WARM_FROM,
    YEAR,
    Candidates,
    Posterior,
    Series,
    Shape,
    evidence_over_time,
    posterior_of,
    threshold,
    value_of,
)
from flexspline.tracking.history import DAY, TOLD, History, history_of
from flexspline.tracking.result import (
    CHANGED,
    DISPUTED,
    NO_CHANGE,
    NOT_KNOWN,
    UNLIKELY,
    Band,
    Change,
    Forecast,
    Track,
    TrackedParameter,
    spoken,
)

if TYPE_CHECKING:
    from flexspline.tracking.fleet import FleetTrack, history_of_sums, track_fleet

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

_HOME = {"FleetTrack": "fleet", "history_of_sums": "fleet", "track_fleet": "fleet"}

__getattr__ = attached(__name__, _HOME)


Array = NDArray[np.float64]

PERCENT: Final = re.compile(r"\s*(\d+(?:\.\d+)?)\s*%\s*")
HORIZON: Final = 5.0  # years
MOST_HORIZON: Final = 50.0
CLEAR: Final = 0.9
"""Chance from which the kind of a change is told; below, it is said not to be known yet."""
TOGETHER: Final = 0.7
"""Correlation of temperature and date from which half of a drift is taken for temperature's."""
SEASONS: Final = 2.0
"""Years from which a trend is told from the seasons: within one year they are a trend, and only a
second one shows that they come back."""
SEASONAL: Final = (
    "no date, for sessions without temperature over less than two years do not tell wear from a "
    "season"
)
BANDED: Final = 121  # days on which a band is told
STEPS_A_YEAR: Final = 52  # of a forecast


def track(
    history: History,
    *,
    limits: Mapping[str, float | str] | None = None,
    horizon: float = HORIZON,
) -> Track:
    """Say what changed in a joint over its sessions, since when, by how much, and what comes.

    Parameters
    ----------
    history : estimates of the joint's parameters over calendar time: of `history_of` (models or
        runs), or made of arrays.
    limits : {"coulomb_friction": 0.5}: values that a parameter must not pass, in its unit, or
        "150%" of its level at first. One below the level at first is a lower limit, any other an
        upper one. Each gets a date, or the reason why it has none: of less than two years without
        temperature, that a season looks the same.
    horizon : years behind the last session, as far as a limit is looked for.

    Returns
    -------
    Track

    Raises
    ------
    InputError
        For a limit of an unknown parameter or that is no number, or an impossible horizon.

    Notes
    -----
    False alarms: at most one in ten years of weekly sessions, of all parameters together, in noise
    that `tests/bench/track.py` describes.
    """
    if not 0.0 < horizon <= MOST_HORIZON:
        raise InputError(f"the horizon is {horizon} years; give one above 0 and at most 50")
    turned = history.turned()
    limited = _limits(limits or {}, turned)
    told = detected(turned)
    courses = [_course(turned, p, told) for p in range(len(turned.names))]
    states = [_state(turned, p, courses[p], told) for p in range(len(turned.names))]
    forecasts = tuple(
        _forecast(turned, p, _limit_of(courses[p], value, is_share), courses[p], states[p], horizon)
        for p, value, is_share in limited
    )
    parameters = tuple(
        _parameter(turned, p, courses[p], states[p], _shown_until(turned, p, forecasts))
        for p in range(len(turned.names))
    )
    below = {each.name for each in parameters if each.negative}
    made = [_change(turned, each) for each in told]
    made = [replace(each, negative=each.parameter in below) for each in made]
    misled = any(each.negative and each.ranges for each in made)
    changes = sorted(
        (replace(each, misled=misled and bool(each.ranges)) for each in made), key=lambda c: c.date
    )
    warm = turned.knows_temperature
    accounted = warm is not None and warm.sum() >= WARM_FROM
    reference = float(np.median(turned.temperatures[warm])) if accounted else math.nan
    return Track(
        turned,
        parameters,
        tuple(changes),
        forecasts,
        reference,
        (*turned.remarks, *_remarks(turned, told, courses, states), *_of_dates(forecasts)),
    )


def _limits(given: Mapping[str, float | str], turned: History) -> list[tuple[int, float, bool]]:
    """Of each limit: the parameter's number, the value, and whether that is a share."""
    found = []
    for name, value in given.items():
        at = resolve(name, turned.names, f"the limit of {name}")
        share = PERCENT.fullmatch(value) if isinstance(value, str) else None
        try:
            limit = float(share[1]) / 100.0 if share else float(value)
        except (TypeError, ValueError):
            limit = math.nan
        if not math.isfinite(limit):
            raise InputError(f"the limit of {name} is '{value}'; give a number, or 150%")
        found.append((at, limit, share is not None))
    return found


def _limit_of(course: Posterior | None, value: float, is_share: bool) -> float:
    """A limit in the parameter's unit: a share is of its level at first."""
    if not is_share:
        return value
    return math.nan if course is None else value * float(np.median(course.course(np.zeros(1))))


def _plain(series: Series, rng: np.random.Generator) -> Posterior:
    return posterior_of(series, None, rng)


def _course(history: History, p: int, told: Sequence[Told]) -> Posterior | None:
    """Draws of a parameter's own course, its changes in it; None where no session tells it."""
    series, _ = history.series(np.eye(len(history.names))[p])
    if not len(series.days):
        return None
    rng = np.random.default_rng([p, len(series.days)])
    own = [each for each in told if _is_of(history, p, each)]
    if not own:
        return _plain(series, rng)
    last = max(own, key=lambda each: each.shape.start)
    beside = series.beside(*(each.shape for each in own if each is not last))
    candidates = Candidates.of(beside)
    if not np.isfinite(candidates.changed).any():
        return _plain(series, rng)
    return posterior_of(beside, candidates, rng)


def _is_of(history: History, p: int, change: Told) -> bool:
    """Whether a parameter is known to have made a change."""
    return len(change.causes) == 1 and moves(change, history.names[p])


def _change(history: History, told: Told) -> Change:
    made = drawn(history, told, np.random.default_rng(len(history)))
    days = made.series.days
    bends = [made.series.known.index(shape) for shape in told.bends]

    def whole(when: Array) -> Array:
        bent = [made.by_known[:, j] * made.series.known[j].of(when)[0] for j in bends]
        return np.asarray(made.changed(when)[:, 0] + np.sum(bent, axis=0))

    sizes = whole(days[-1:])
    speed = (whole(days[-1:] + 7.0) - sizes) * YEAR / 7.0
    chances = {kind: made.chance(kind) for kind in SHAPES}
    kind = max(chances, key=lambda each: chances[each])
    first, middle, last = np.percentile(made.starts, [INTERVAL[0], 50.0, INTERVAL[1]])
    low, high = np.percentile(sizes, INTERVAL)
    before = made.levels + (made.by_known @ _ones(made) if made.series.known else 0.0)
    level, error = float(np.mean(before)), float(np.std(before))
    size = float(np.mean(sizes))
    scaled = SCALE in told.causes
    lone = scaled or np.count_nonzero(told.weights) == 1
    before_it = level if scaled else abs(level)
    turn = turned_by(history, told)
    relative = size / before_it if lone and abs(level) > 3.0 * error else math.nan
    return Change(
        told.causes,
        told.chances,
        history.names[told.parameters[0]],
        history.units[told.parameters[0]],
        kind if chances[kind] >= CLEAR else None,
        chances[STEP],
        history.date(float(middle)),
        (history.date(float(first)), history.date(float(last))),
        size,
        float(np.std(sizes)),
        (float(low), float(high)),
        relative,
        0.0 if kind == STEP else float(np.mean(speed)),
        history.date(_told_since(made.series, history.looked_at)),
        told.evidence,
        told.needed,
        turn,
        other_ranges(history, told, turn is not None),
    )


def _ones(made: Posterior) -> Array:
    """What each known change has made before the onset, at size 1."""
    onset = np.array([np.median(made.starts)])
    return np.array([shape.of(onset)[0] for shape in made.series.known])


def _told_since(series: Series, count: int) -> float:
    """The day of the first session at which a change could be told."""
    needed = np.array([threshold(n, count) for n in range(1, len(series.days) + 1)])
    over = evidence_over_time(series) > needed
    return float(series.days[int(np.argmax(over))] if over.any() else series.days[-1])


def _shown_until(history: History, p: int, forecasts: Sequence[Forecast]) -> float:
    """Days to which a band is told: to the date of a limit, at most as long again as the past."""
    last = float(history.days[-1])
    ahead = [
        (when - history.date(0.0)).total_seconds() / DAY
        for each in forecasts
        if each.parameter == history.names[p]
        for when in (each.date, each.within_95[1])
        if when is not None
    ]
    return max(min(max(ahead, default=last), 2.0 * last), last, 1e-9)


def _parameter(
    history: History, p: int, course: Posterior | None, state: str, until: float
) -> TrackedParameter:
    name, unit, count = history.names[p], history.units[p], len(history)
    days = np.linspace(0.0, until, BANDED)
    dates = np.array([history.date(float(each)) for each in days], dtype="datetime64[s]")
    nothing = np.full(count, np.nan)
    if course is None:
        empty = np.full(BANDED, np.nan)
        none = (math.nan, math.nan)
        return TrackedParameter(
            name, unit, NOT_KNOWN, 0, none, none, none, math.nan, math.nan, math.nan,
            history.values[:, p], nothing, Band(dates, empty, empty, empty),
        )  # fmt: skip
    series, at = history.series(np.eye(len(history.names))[p])
    levels = course.course(days)
    low, middle, high = np.percentile(levels, [INTERVAL[0], 50.0, INTERVAL[1]], axis=0)
    corrected = nothing.copy()
    corrected[at] = series.values - course.thermal()
    left = corrected[at] - np.median(course.course(series.days), axis=0)
    measured = float(np.sqrt(np.median(series.variances)))
    spread = 1.4826 * float(np.median(np.abs(left)))
    now = value_of(course.course(history.days[-1:])[:, 0])
    warm = course.by_temperature.size > 0
    return TrackedParameter(
        name,
        unit,
        state,
        len(at),
        value_of(levels[:, 0]),
        now,
        value_of(course.by_temperature[:, 0] / 10.0) if warm else (math.nan, math.nan),
        float(np.sqrt(max(spread**2 - measured**2, 0.0))),
        measured,
        _least(history, p, series),
        history.values[:, p],
        corrected,
        Band(dates, middle, low, high),
        negative(history, name, now),
    )


def _state(history: History, p: int, course: Posterior | None, told: Sequence[Told]) -> str:
    if course is None or len(course.series.days) < LEAST_SESSIONS:
        return NOT_KNOWN
    if any(_is_of(history, p, each) for each in told):
        low, high = np.percentile(course.changed(history.days[-1:])[:, 0], INTERVAL)
        shows = any(p in each.parameters for each in told) or low > 0.0 or high < 0.0
        return CHANGED if shows else NO_CHANGE
    if any(moves(each, history.names[p]) for each in told):
        return DISPUTED
    return NO_CHANGE


def _least(history: History, p: int, series: Series) -> float:
    """The size of a step in the middle of the sessions that is told by half of all noises."""
    if len(series.days) < LEAST_SESSIONS:
        return math.nan
    middle = Shape(STEP, float(series.days[len(series.days) // 2]))
    needed = threshold(len(series.days), history.looked_at) + math.log(len(series.days))
    return math.sqrt(2.0 * needed) * moved(history, p, middle, ()).error


def _forecast(
    history: History,
    p: int,
    limit: float,
    course: Posterior | None,
    state: str,
    horizon: float,
) -> Forecast:
    """When a parameter reaches a limit."""
    name, unit = history.names[p], history.units[p]
    lower = course is not None and limit < float(np.median(course.course(np.zeros(1))))

    def none(why: str, now: tuple[float, float], chance: float = 0.0) -> Forecast:
        return Forecast(
            name, unit, limit, now, chance, None, (None, None), (None, None), horizon, why, lower
        )

    if course is None:
        return none("no session tells it", (math.nan, math.nan), math.nan)
    last = float(history.days[-1])
    ahead = last + np.arange(0, math.ceil(horizon * STEPS_A_YEAR) + 1) * YEAR / STEPS_A_YEAR
    levels = course.course(ahead)
    now = value_of(levels[:, 0])
    beyond = levels <= limit if lower else levels >= limit
    if np.mean(beyond[:, 0]) >= 0.975:
        return none("it is beyond it already", now, 1.0)
    if state == NOT_KNOWN:
        return none("not known yet, of so few sessions", now, math.nan)
    if state == DISPUTED:
        return none("it may have changed, or another; no date before that is known", now, math.nan)
    if state == NO_CHANGE:
        return none("no change of it is told, so no date", now, math.nan)
    if _may_be_season(history, course):
        return none(SEASONAL, now, math.nan)
    reached = beyond.any(axis=1)
    chance = float(np.mean(reached))
    when = np.where(reached, ahead[np.argmax(beyond, axis=1)], np.inf)
    ends = np.quantile(when, [0.025, 0.1, 0.5, 0.9, 0.975], method="higher")
    early_95, early_80, middle, late_80, late_95 = (
        history.date(float(each)) if np.isfinite(each) else None for each in ends
    )
    if early_95 is None:
        return none(f"not within {horizon:g} years (97.5 %)", now, chance)
    return Forecast(
        name, unit, limit, now, chance, middle, (early_80, late_80), (early_95, late_95), horizon,
        lower=lower,
    )  # fmt: skip


def _may_be_season(history: History, course: Posterior) -> bool:
    """Whether what goes on may be the year's temperatures, which no session tells."""
    goes_on = course.chance(STEP) < 1.0 - UNLIKELY
    return goes_on and history.knows_temperature is None and history.years < SEASONS


def _remarks(
    history: History,
    told: Sequence[Told],
    courses: Sequence[Posterior | None],
    states: Sequence[str],
) -> list[str]:
    """What limits all that is said."""
    said = []
    known = history.knows_temperature
    if known is None:
        some = int(np.isfinite(history.temperatures).sum())
        said.append(
            f"Temperature is not accounted for: {some} of {len(history)} sessions tell it. What it "
            "makes of friction looks like wear, or hides it."
        )
    elif known.sum() < WARM_FROM:
        said.append(
            f"Temperature is not accounted for: what it makes is told of {WARM_FROM} sessions on."
        )
    if known is not None and not known.all():
        said.append(f"{int((~known).sum())} sessions of unknown temperature are left out.")
    gaps = np.diff(history.days)
    if len(gaps) and gaps.max() > 60.0:
        k = int(np.argmax(gaps))
        said.append(
            f"No session from {history.dates[k].astype('M8[D]')} to "
            f"{history.dates[k + 1].astype('M8[D]')}: what began there may have begun at any time."
        )
    if known is not None and len(history) >= LEAST_SESSIONS:
        said += _by_temperature(history, courses, states)
    if any(np.count_nonzero(each.weights) > 1 and SCALE not in each.causes for each in told):
        said.append(
            "Sizes of changes in confounded parameters hold as far as the others stayed as they "
            "were."
        )
    return said


def _of_dates(forecasts: Sequence[Forecast]) -> list[str]:
    """What a date holds for."""
    if not any(forecast.within_95[0] for forecast in forecasts):
        return []
    return [
        "Dates hold for wear that goes on as so far, at most by the third power of time; what runs "
        "away faster, such as by e each four months, gets there before the interval."
    ]


def _by_temperature(
    history: History, courses: Sequence[Posterior | None], states: Sequence[str]
) -> list[str]:
    """Parameters that would seem to change, were temperature left out, and do not with it."""
    found = [
        spoken(name)
        for name, course, state in zip(history.names, courses, states, strict=True)
        if course is not None and state == NO_CHANGE and _is_thermal(history, course)
    ]
    said = [f"What looks like a change of {listed(found)} goes with temperature."] if found else []
    told = np.isfinite(history.temperatures)
    warm, days = history.temperatures[told], history.days[told]
    if np.ptp(warm) > 0.0 and np.ptp(days) > 0.0:
        together = float(np.corrcoef(warm, days)[0, 1])
        if abs(together) > TOGETHER:
            way = "rose" if together > 0.0 else "fell"
            said.append(f"Temperature {way} over these sessions: what wore with it is not told.")
    return said


def _is_thermal(history: History, course: Posterior) -> bool:
    """Whether temperature moves a parameter, and that is all that looks like a change of it."""
    if not course.by_temperature.size:
        return False
    slope, error = value_of(course.by_temperature[:, 0])
    if abs(slope) <= TOLD * error:
        return False
    series = course.series
    cold = Series(series.days, series.values, series.variances, known=series.known)
    needed = threshold(len(series.days), history.looked_at)
    warm, without = (float(Candidates.of(each).evidence[-1]) for each in (series, cold))
    return warm <= needed < without
