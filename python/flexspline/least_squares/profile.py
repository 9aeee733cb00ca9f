"""Profiles of what a fit minimises: intervals of one parameter, contours of two.

A Wald interval, value ± t·error, takes the squares Q for a parabola. Of a shape, such as the
velocity at which Stribeck friction fades, they are none: on one side they may rise steeply and on
the other hardly. The profile asks the squares themselves, with all other parameters fitted again,

    Q_p(θ) = min over all others of Σ w (y − X b)²,     D(θ) = (Q_p(θ) − Q_p(θ̂)) · H / V

with V the variance of the estimate in the autocorrelated noise of the fit (`uncertainty.py`), and H
= [(XᵀX)⁻¹]_θθ what it would be in white noise of variance 1. H / V turns squares of rows that are
not independent into a likelihood ratio; for two parameters it is dᵀV⁻¹d / dᵀH⁻¹d along d = θ − θ̂
([ChandlerBate2007], vertical adjustment). Near θ̂ D is the Wald statistic. The interval holds
every θ with D(θ) ≤ t² and a contour those with D ≤ 2 F, of Student's t and Fisher's F at the level,
with the degrees of freedom that the noise leaves. Source: [VenzonMoolgavkar1988].

The whole range within the bounds is scanned, for squares may have several valleys: a Stribeck
velocity of 0.3 rad/s and one of 1.4 with friction of the other sign can explain short runs as well.
The interval goes from the lowest to the highest θ that D allows, and its parts are told. Where D
allows a bound, that side has no end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf, isfinite, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import f as fisher
from scipy.stats import t as student

from flexspline.errors import InputError, listed
from flexspline.formatting import short, short_names
from flexspline.lazy import render
from flexspline.least_squares.estimate import Estimate, estimate_holding
from flexspline.least_squares.uncertainty import require_level

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from flexspline.least_squares.linear import LinearFit
    from flexspline.least_squares.result import Fit, Parameter

__all__ = ["Contour", "Profile", "contour_of", "profile_of"]

Array = NDArray[np.float64]
Interval = tuple[float | None, float | None]

FARTHEST = 64.0  # Wald distances, within which an unbounded parameter's end is looked for
SCAN = 12  # values between a shape and each of its bounds, evenly in its logarithm
STANDS = 1e-3  # of the Wald distance, to which an end is found
LOWER = 1e-3  # of a statistic, by which another minimum must be lower to be said
FINE = 0.05  # Wald distances, to which the bottom of another valley is found
NEAR = 6.0  # Wald distances, between which a profile is filled with points
HOW_TO = {"fixed": "free it", "not determined": "fit runs that determine it"}
KNOWN = 100.0  # degrees of freedom, from which a region is that of the normal distribution
MOST = 1e6  # of a statistic: where a load does not settle


@dataclass(frozen=True, eq=False, repr=False)
class Profile:
    """The profile of one parameter; prints its interval in words.

    Parameters
    ----------
    name, unit : of the parameter.
    value : as fitted.
    level : of the intervals.
    interval : (low, high); None for an end that lies beyond the bound of the parameter.
    parts : of the interval, from the lowest; between two of them the runs exclude all values.
    wald : (low, high), value ± t·error, for comparison; it may reach beyond the bounds.
    limit : of the statistic, t².
    values, statistic : (K,), points of the profile, D there.
    notes : sentences: what does not close, and a lower minimum that was found.
    """

    name: str
    unit: str
    value: float
    level: float
    interval: Interval
    parts: tuple[Interval, ...]
    wald: tuple[float, float]
    limit: float
    values: Array
    statistic: Array
    notes: tuple[str, ...]

    @property
    def closed(self) -> bool:
        """Whether the interval has both ends."""
        return None not in self.interval

    def to_frame(self) -> pandas.DataFrame:
        """Return the points as a table: value and statistic."""
        import pandas

        return pandas.DataFrame({"value": self.values, "statistic": self.statistic})

    def __str__(self) -> str:
        first = (
            f"{short_names(self.name)} = {short(self.value, 4)} {self.unit}, by its profile "
            f"{_either(self.parts, self.unit)} ({100 * self.level:g} %); the Wald interval is "
            f"{_between(self.wald, self.unit)}."
        )
        return " ".join([first, *self.notes])

    def __repr__(self) -> str:
        return f"<Profile of {self.name}: {_either(self.parts, self.unit)}>"

    def plot(self) -> Figure:
        """Return a figure: the statistic over the value, its limit, and Wald's parabola."""
        return render("profile", "figure", self)


@dataclass(frozen=True, eq=False, repr=False)
class Contour:
    """The region of two parameters at a level, around the estimate; prints its extent in words.

    A region that other valleys of the squares have is not looked for; a profile tells of these.

    Parameters
    ----------
    names, units, values : of both, as fitted.
    level : of the region, both together.
    points : (K, 2), around the region; NaN in a direction in which it does not end within bounds.
    notes : sentences: what does not close.
    freedom : degrees of freedom of the errors; the region is that of Fisher's F with two and these.
    """

    names: tuple[str, str]
    units: tuple[str, str]
    values: tuple[float, float]
    level: float
    points: Array
    notes: tuple[str, ...]
    freedom: float = float("inf")

    @property
    def by(self) -> str:
        """How its size follows from the level, in words; "" where the errors are well known."""
        if self.freedom >= KNOWN:
            return ""
        reach = (2.0 * float(fisher.ppf(self.level, 2, self.freedom))) ** 0.5
        return (
            f"by F with {self.freedom:.2g} degrees of freedom, so that it reaches {reach:.1f} "
            "standard errors"
        )

    @property
    def closed(self) -> bool:
        """Whether the region ends within bounds in every direction."""
        return bool(np.isfinite(self.points).all())

    def to_frame(self) -> pandas.DataFrame:
        """Return the points as a table, a column for each parameter."""
        import pandas

        return pandas.DataFrame(self.points, columns=list(self.names))

    def __str__(self) -> str:
        both = listed(short_names(name) for name in self.names).replace(", ", " and ")
        how = f"{100 * self.level:g} %, both together" + (f", {self.by}" if self.by else "")
        first = f"Region of {both} around the estimate ({how})"
        if not np.isfinite(self.points).any():
            return " ".join([f"{first}: it ends nowhere within bounds.", *self.notes])
        low, high = np.nanmin(self.points, axis=0), np.nanmax(self.points, axis=0)
        spans = [
            f"{short_names(name)} {short(a, 4)} to {short(b, 4)} {unit}"
            for name, a, b, unit in zip(self.names, low, high, self.units, strict=True)
        ]
        where = "" if self.closed else ", where it ends"
        return " ".join([f"{first}{where}: {spans[0]}, {spans[1]}.", *self.notes])

    def __repr__(self) -> str:
        return f"<Contour of {self.names[0]} and {self.names[1]}: {len(self.points)} points>"

    def plot(self) -> Figure:
        """Return a figure of the region."""
        return render("contour", "figure", self)


def profile_of(fit: Fit, name: str, level: float, points: int) -> Profile:
    """Return the profile of one parameter; see `Fit.profile`."""
    require_level(level)
    _require_points(points, 0, "to fill a profile with")
    search = _Search.of(fit, [name])
    (parameter,) = search.parameters
    limit = float(student.ppf(0.5 + 0.5 * level, parameter.degrees_of_freedom)) ** 2
    parts = tuple((search.value(low), search.value(high)) for low, high in search.parts(limit))
    interval = (parts[0][0], parts[-1][1])
    search.fill(points)
    values, statistic = search.curve()
    wald = limit**0.5 * parameter.standard_error
    return Profile(
        parameter.name,
        parameter.unit,
        parameter.value,
        level,
        interval,
        parts,
        (parameter.value - wald, parameter.value + wald),
        limit,
        values,
        statistic,
        (*_open(parameter, interval), *_in_parts(parts, parameter.unit), *search.lower()),
    )


def _require_points(points: int, least: int, what: str) -> None:
    if not (isinstance(points, int) and points >= least):
        raise InputError(f"points is {points!r}; give a whole number, {least} at least, {what}")


def contour_of(fit: Fit, names: tuple[str, str], level: float, points: int) -> Contour:
    """Return the region of two parameters; see `Fit.contour`."""
    require_level(level)
    _require_points(points, 4, "to go round a region")
    search = _Search.of(fit, names)
    one, other = search.parameters
    freedom = min(p.degrees_of_freedom for p in search.parameters)
    limit = 2.0 * float(fisher.ppf(level, 2, freedom))
    found = np.full((points, 2), np.nan)
    for k, angle in enumerate(np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)):
        way = search.way(angle)
        at = search.crossing(way, limit)
        if at is not None:
            found[k] = search.values(at * way)
    notes = list(search.lower())
    missing = int(np.isnan(found[:, 0]).sum())
    if missing:
        notes.insert(
            0,
            f"It does not close: in {missing} of {points} directions these runs allow everything "
            "up to the bounds.",
        )
    both = ((one.unit, other.unit), (one.value, other.value))
    return Contour((one.name, other.name), *both, level, found, tuple(notes), float(freedom))


class _Search:
    """The statistic D over coordinates of one or two parameters, and what was asked of it.

    Coordinates are Wald distances from the estimate, of a shape those of its logarithm.
    """

    def __init__(self, made: Estimate, parameters: Sequence[Parameter], fit: Fit) -> None:
        self.made, self.parameters = made, parameters
        free = [made.names[k] for k in made.fitted] + [s.name for s in made.free_shapes]
        at = [free.index(p.name) for p in parameters]
        own = made.basis[at]
        self._white = np.linalg.inv(own @ own.T)
        self._noisy = np.linalg.inv(fit.covariance[np.ix_(at, at)])
        self._sizes = np.array([p.value for p in parameters])
        self._shape = np.array([p.kind == "shape" for p in parameters])
        errors = np.array([p.standard_error for p in parameters])
        self._scale = np.where(self._shape, errors / self._sizes, errors)
        self._seen: dict[tuple[float, ...], tuple[float, LinearFit]] = {}

    @classmethod
    def of(cls, fit: Fit, names: Sequence[str]) -> _Search:
        """Return the search of these parameters.

        Raises
        ------
        InputError
            Where the fit has no profiles, or a parameter no error that its profile is scaled by.
        """
        made = fit.solved
        if made is None:
            raise InputError(
                "a fit of the motion has no profiles; fit with flexspline.fit for them"
            )
        if made.denominator is not None:
            raise InputError(
                "a fit by generalised least squares has no profiles; fit its effects with "
                "flexspline.fit for them"
            )
        parameters = [fit[name] for name in names]
        if len({p.name for p in parameters}) < len(parameters):
            raise InputError(f"a contour of {parameters[0].name} needs a second parameter; name it")
        for p in parameters:
            open_shape = p.kind == "shape" and np.isfinite(p.standard_error)
            if not p.standard_error > 0.0 or not (p.determined or open_shape):
                what = HOW_TO.get(p.state, "widen its bound")
                raise InputError(
                    f"{p.name} is {p.state}: there is no error that its profile could be scaled "
                    f"by; {what}"
                )
            if not np.isfinite(p.interval).all():
                raise InputError(
                    f"the runs are too short for an interval of {p.name}: the noise leaves no "
                    "degrees of freedom; record longer runs"
                )
        if any(p.name not in fit.part.record["covariance"]["names"] for p in parameters):
            raise InputError(
                "a term of one of many runs has no profile of its own; use its interval, which "
                "is exact but for the noise model"
            )
        return cls(made, parameters, fit)

    def way(self, angle: float) -> Array:
        """Direction (2,) in coordinates, so that equal angles go round Wald's ellipse evenly."""
        scaled = np.linalg.inv(self._noisy) / np.outer(self._errors, self._errors)
        return np.asarray(np.linalg.cholesky(scaled) @ [np.cos(angle), np.sin(angle)])

    def values(self, coordinates: Array) -> Array:
        """Values of the parameters at coordinates."""
        moved = self._scale * coordinates
        grown = self._sizes * np.exp(np.where(self._shape, moved, 0.0))  # a coefficient may be 1e9
        values = np.where(self._shape, grown, self._sizes + moved)
        ends = [p.bounds or (None, None) for p in self.parameters]
        low, high = np.array(ends, dtype=np.float64).T  # NaN where a side is open
        return np.asarray(np.fmin(np.fmax(values, low), high))

    def value(self, coordinate: float | None) -> float | None:
        """Value of one parameter, None of none."""
        return None if coordinate is None else float(self.values(np.array([coordinate]))[0])

    def parts(self, limit: float) -> list[Interval]:
        """Coordinates of one parameter between which D is below a limit; None: up to a bound."""
        both = (*self._scan(-1.0, limit), 0.0, *self._scan(1.0, limit))
        heights = {at: self.at(at) for at in sorted(both, key=abs)}
        grid = sorted(heights)
        for before, middle, behind in zip(grid, grid[1:], grid[2:], strict=False):
            if limit < heights[middle] <= min(heights[before], heights[behind]):
                lowest = float(minimize_scalar(
                    self.at, bounds=(before, behind), method="bounded", options={"xatol": FINE}
                ).x)  # fmt: skip
                heights[lowest] = self.at(lowest)
        grid = sorted(heights)
        ends: list[float | None] = [None] if heights[grid[0]] <= limit else []
        for before, behind in pairwise(grid):
            if (heights[before] <= limit) != (heights[behind] <= limit):
                ends.append(self._between(before, behind, limit))
        ends += [None] if heights[grid[-1]] <= limit else []
        return list(zip(ends[::2], ends[1::2], strict=True))

    def at(self, coordinate: float) -> float:
        """D of one parameter."""
        return self(np.array([coordinate]))

    def _scan(self, side: float, limit: float) -> list[float]:
        """Coordinates of one parameter on one side, as far as it may go."""
        room = self._room(np.array([side]))
        steps = [sqrt(limit) * 2.0**k for k in range(-1, 12)]
        if self._shape[0]:
            steps += np.linspace(0.0, room, SCAN + 1)[1:].tolist()
        return [side * step for step in steps if step < room] + [side * room]

    def _between(self, before: float, behind: float, limit: float) -> float:
        """Where D of one parameter crosses a limit; its root is nearly straight."""

        def above(at: float) -> float:
            return sqrt(self.at(at)) - sqrt(limit)

        return float(brentq(above, before, behind, xtol=STANDS, rtol=STANDS))

    def crossing(self, way: Array, limit: float) -> float | None:
        """How far along a direction D crosses a limit; None where it does not within bounds."""
        farthest, target = self._room(way), sqrt(limit)

        def above(distance: float) -> float:
            return sqrt(self(distance * way)) - target

        near, far = 0.0, min(target, farthest)
        while above(far) < 0.0:
            if far >= farthest:
                return None
            near, far = far, min(2.0 * far, farthest)
        if above(far) == 0.0:
            return far
        return float(brentq(above, near, far, xtol=STANDS, rtol=STANDS))

    def __call__(self, coordinates: Array) -> float:
        """Return D, 0 at the estimate."""
        key = tuple(np.round(coordinates, 9).tolist())
        if not any(key):
            return 0.0
        if key not in self._seen:
            self._seen[key] = self._asked(coordinates)
        return min(max(self._seen[key][0], 0.0), MOST)

    def fill(self, points: int) -> None:
        """Ask for so many points more around what was asked near the estimate."""
        low, high = (np.clip(f([k[0] for k in self._seen]), -NEAR, NEAR) for f in (min, max))
        for at in np.linspace(low, high, points):
            self.at(float(at))

    def curve(self) -> tuple[Array, Array]:
        """Values and D of all points that were asked, and of the estimate; of one parameter."""
        rows = [(self.values(np.array(key))[0], max(d, 0.0)) for key, (d, _) in self._seen.items()]
        table = np.array(sorted([*rows, (float(self._sizes[0]), 0.0)]))
        table = table[table[:, 1] < MOST]
        return table[:, 0], table[:, 1]

    def lower(self) -> Iterator[str]:
        """A sentence where squares lower than those of the fit were found."""
        least = min(((d, key) for key, (d, _) in self._seen.items()), default=(0.0, ()))
        if least[0] < -LOWER:
            values = self.values(np.array(least[1]))
            where = listed(
                f"{short_names(p.name)} = {short(float(v), 4)} {p.unit}"
                for p, v in zip(self.parameters, values, strict=True)
            )
            yield f"A lower minimum lies at {where}: fit again from there."

    @cached_property
    def _errors(self) -> Array:
        return np.array([p.standard_error for p in self.parameters])

    def _room(self, way: Array) -> float:
        """How far a direction goes before a bound."""
        room = inf
        for k, p in enumerate(self.parameters):
            bound = None if p.bounds is None else p.bounds[int(way[k] > 0.0)]
            if bound is not None and way[k] != 0.0:
                ratio = bound / self._sizes[k] if self._shape[k] else bound - self._sizes[k]
                own = np.log(ratio) if self._shape[k] else ratio
                room = min(room, float(own / self._scale[k] / way[k]))
        return max(room, 0.0) if isfinite(room) else FARTHEST

    def _asked(self, coordinates: Array) -> tuple[float, LinearFit]:
        values = self.values(coordinates)
        names = [p.name for p in self.parameters]
        held = dict(zip(names, values.tolist(), strict=True))
        found = estimate_holding(self.made, held, self._nearest(coordinates).effects)
        gained = found.squares + self._of_priors(held) - self.made.linear.squares
        apart = values - self._sizes
        ratio = (apart @ self._noisy @ apart) / (apart @ self._white @ apart)
        return float(gained * ratio), found

    def _nearest(self, coordinates: Array) -> LinearFit:
        """The fit that was found nearest by, from which the next one starts."""
        found = [self.made.linear, *(one for _, one in self._seen.values())]
        asked = np.array([np.zeros(len(coordinates)), *self._seen])
        return found[int(np.argmin(np.sum((asked - coordinates) ** 2, axis=1)))]

    def _of_priors(self, held: dict[str, float]) -> float:
        """What the squares of a fit lack in which a coefficient with a prior is held."""
        limits, total = self.made.constraints, 0.0
        for name, value in held.items():
            if name in self.made.names:
                at = self.made.names.index(name)
                if np.isfinite(limits.prior[at]):
                    missed = (value - limits.prior[at]) / limits.prior_error[at]
                    total += self.made.noise_variance * float(missed) ** 2
        return total


def _open(parameter: Parameter, interval: Interval) -> Iterator[str]:
    bounds = parameter.bounds or (None, None)
    for end, bound, word in zip(interval, bounds, ("below", "above"), strict=True):
        if end is None and bound is None:
            yield f"It has no end {word} within {FARTHEST:g} standard errors."
        elif end is None:
            yield (
                f"It has no end {word}: these runs allow everything to the bound "
                f"{short(bound or 0.0, 4)} {parameter.unit}."
            )


def _in_parts(parts: Sequence[Interval], unit: str) -> Iterator[str]:
    if len(parts) > 1:
        gaps = [(one[1], other[0]) for one, other in pairwise(parts)]
        said = " and ".join(_between(gap, unit) for gap in gaps)
        yield f"These runs exclude {said}, and do not tell which of {len(parts)} parts is right."


def _either(parts: Sequence[Interval], unit: str) -> str:
    """The parts of an interval in words."""
    return " or ".join(_between(part, unit) for part in parts)


def _between(interval: Interval, unit: str) -> str:
    low, high = interval
    if low is None and high is None:
        return "without an end"
    if low is None or high is None:
        return f"above {short(low, 4)} {unit}" if low is not None else f"below {high:.4g} {unit}"
    return f"{short(low, 4)} to {short(high, 4)} {unit}"
