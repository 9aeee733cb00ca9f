"""What a log says twice: a channel that is nearly a function of another, a run that is a copy.

What follows a channel may follow one that depends on it. The share of a channel's variance that a
smooth function of another one explains is told on folds that the function was not fitted to. From
nine tenths on the variance of a coefficient is inflated tenfold [Marquardt1970], and runs are said
not to tell the two apart.

A run that is there twice is fitted and held out at once, and makes every score look better.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.checks.findings import Finding
from flexspline.logs.log import Log

__all__ = ["Dependence", "called", "copies", "copy_finding", "dependences"]


Array = NDArray[np.float64]

INFLATED = 10.0  # [Marquardt1970]: variance inflation from which two columns are collinear
FOLDS = 8  # blocks of rows, where there are fewer than four runs
ROWS = 4000  # of each run, evenly spread
PIECES, OF_TIME = 16, 3  # of the cubic spline; a drift that bends more is none
STIFF = 1e-4  # weight of the bend, beside the rows' mean weight of a spline
TURN = 2.0 * np.pi

ANGLE, SPEED, ACCELERATION = "output_position", "output_velocity", "output_acceleration"
PAIRS = {
    ("load", ANGLE): "with another load at the same angles, such as another payload or another "
    "direction of gravity,",
    ("load", SPEED): "with another load at the same speeds",
    ("load", ACCELERATION): "with a load that does not come from acceleration, such as a weight,",
    ("load", "temperature"): "with the same load, cold and warm,",
    ("temperature", "time"): "that begins warm, or cools down,",
    (ACCELERATION, ANGLE): "through the same angles at another frequency",
    (SPEED, ANGLE): "through the same angles at other speeds",
}
"""Channel, what it may be a function of, and the run that would tell."""


@dataclass(frozen=True)
class Dependence:
    """A channel that is nearly a function of another.

    `channel` and `of` as effects read them ("load"). `left`: RMS of what the function misses on
    folds that it was not fitted to, over the channel's own variation. `said`: what the channels
    are called in these runs. `run`: which run would tell the two apart.
    """

    channel: str
    of: str
    left: float
    said: tuple[str, str]
    run: str

    @property
    def sentence(self) -> str:
        """What follows for whoever reads an effect's name."""
        one, other = self.said
        share = 100.0 * self.left**2
        missed = f"{share:.2g} %" if share >= 0.01 else "less than 0.01 %"
        return (
            f"In these runs {one} is nearly a function of {other}: a smooth one misses {missed} of "
            "its variance on rows left out, and what depends on the one may depend on the other. "
            f"A run {self.run} would tell."
        )

    def swapped(self, reads: Sequence[str], others: Sequence[str]) -> bool:
        """Whether two effects read these channels, one the one and the other the other, alone."""
        mine, theirs = ({self.channel, self.of} & {*read} for read in (reads, others))
        return len(mine) == len(theirs) == 1 and mine != theirs


def dependences(
    runs: Sequence[Mapping[str, Array]], called: Mapping[str, str] | None = None
) -> tuple[Dependence, ...]:
    """Return which channels of these runs are nearly a function of another.

    Parameters
    ----------
    runs : of each the channels (N,) in SI units by name, "load" [Nm] among them, without rows that
        do not count; "time" counts from the run's start.
    called : names that a user knows them by, where these are others.
    """
    names = called or {}
    thin = [_thinned(run) for run in runs]
    found = []
    for (channel, of), telling in PAIRS.items():
        if not all(channel in run and of in run for run in thin):
            continue
        left = _left(
            [run[of] for run in thin], [run[channel] for run in thin], turns=of == ANGLE,
            pieces=OF_TIME if of == "time" else PIECES,
        )  # fmt: skip
        if left**2 * INFLATED < 1.0:
            said = names.get(channel, channel), names.get(of, of)
            found.append(Dependence(channel, of, left, said, telling))
    return tuple(found)


def _thinned(run: Mapping[str, Array]) -> dict[str, Array]:
    """Some thousand rows of a run, evenly spread, in which all channels are finite."""
    few = {name: values[:: max(1, len(values) // ROWS)] for name, values in run.items()}
    finite = np.logical_and.reduce([np.isfinite(values) for values in few.values()])
    return {name: values[finite] for name, values in few.items()}


def _left(x: Sequence[Array], y: Sequence[Array], *, turns: bool, pieces: int) -> float:
    """RMS of what a smooth function of x leaves of y on held-out folds, over y's deviation."""
    if len(x) >= 4:
        folds = list(zip(x, y, strict=True))
    else:
        parts = zip(np.array_split(np.concatenate(x), FOLDS),
                    np.array_split(np.concatenate(y), FOLDS), strict=True)  # fmt: skip
        folds = list(parts)
    every, values = np.concatenate(x), np.concatenate(y)
    spread = float(np.std(values))
    if len(every) < 10 * pieces:
        return 1.0
    if spread <= 1e-9 * float(np.max(np.abs(values), initial=0.0)) or np.ptp(every) == 0.0:
        return 1.0
    low, high = float(every.min()), float(every.max())
    if turns and high - low > TURN:
        folds, low, high = [(np.mod(a, TURN), b) for a, b in folds], 0.0, TURN
    rows = [_spline((a - low) / (high - low), pieces) for a, _ in folds]
    centre = float(values.mean())
    right = [b - centre for _, b in folds]
    grams = np.array([r.T @ r for r in rows])
    targets = np.array([r.T @ b for r, b in zip(rows, right, strict=True)])
    bend = np.diff(np.eye(grams.shape[1]), n=2, axis=0)
    stiff = STIFF * np.trace(grams.sum(axis=0)) / grams.shape[1] * (bend.T @ bend)
    squares = 0.0
    for k, (own, b) in enumerate(zip(rows, right, strict=True)):
        gram = grams.sum(axis=0) - grams[k] + stiff
        found = np.linalg.lstsq(gram, targets.sum(axis=0) - targets[k], rcond=1e-10)[0]
        squares += float(np.sum((b - own @ found) ** 2))
    return float(np.sqrt(squares / len(values)) / spread)


def _spline(place: Array, pieces: int) -> Array:
    """Cubic B-splines over 0 … 1 at each place, (N, pieces + 3)."""
    from scipy.interpolate import BSpline

    knots = np.arange(-3, pieces + 4) / pieces
    inside = np.clip(place, 0.0, 1.0 - 1e-12)
    return np.asarray(BSpline.design_matrix(inside, knots, 3).toarray())


def copies(logs: Sequence[Log]) -> Iterator[tuple[int, int]]:
    """Yield the number of each run that holds the same values as another before it, and of that."""
    seen: dict[tuple[object, ...], list[int]] = {}
    for number, log in enumerate(logs):
        ends = tuple((name, log[name][[0, -1]].tobytes()) for name in log.channels if len(log))
        alike = seen.setdefault((len(log), ends), [])
        for other in alike:
            if all(_equal(log, logs[other], name) for name in log.channels):
                yield number, other
                break
        alike.append(number)


def _equal(one: Log, other: Log, name: str) -> bool:
    return np.array_equal(one[name], other[name], equal_nan=True)


def copy_finding(log: Log, other: Log) -> Finding:
    """Return what is said of a run that holds the same values as another."""
    return Finding(
        "copy_of_a_run",
        "error",
        "all",
        (0, len(log)),
        float(len(log)),
        "rows",
        f"it holds the same values as the run {called(other)}: a run counts once.",
        "Leave one of them out.",
    )


def called(log: Log) -> str:
    """Return a run's name, and its file where it has one: copies of a file share the name."""
    return f"'{log.name}'" + (f" ({log.source.path})" if log.source is not None else "")
