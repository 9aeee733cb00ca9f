"""How well `track` tells wear: false alarms, delay, what it names, and how far its dates hold.

    python tests/bench/track.py [--joints 100] [--seed 1] [--part false|delay|forecast|all]

Joints of eight parameters, one session a week, as rigs have them and as no model below assumes:
missed weeks and months, noise of sessions with tails (Student's t of four), a share of it that
lasts (autoregressive, one to four weeks, shared by the parameters), days on which all is off,
measured errors that are wrong by up to 1.4 and correlated, seasons and single days of temperature,
friction that falls with it exponentially. Sizes are in standard deviations of the session noise.

The rivals see the same numbers with the true effect of temperature taken out, which nobody knows on
a rig: a threshold on each parameter, tabular CUSUM (k = 0.5), and one change point by `ruptures`
(cost l2), asked each week. Each has the threshold at which joints without wear raise one alarm in
ten years over all parameters; `track` has its own, which raises less.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from flexspline.tracking import History, Track, track
from flexspline.tracking.changes import Series, evidence_over_time, threshold

Array = NDArray[np.float64]
Course = Callable[[Array], Array]
Limit = tuple[float, float]

RATE = 0.1  # false alarms in a joint-year
WEEKS = 156
COUNT = 8
BASELINE = 26  # sessions from which the rivals know level and spread


@dataclass
class Joint:
    """A joint's sessions: days (S,), temperatures (S,), values (S, P), covariance (S, P, P)."""

    days: Array
    temperatures: Array
    values: Array
    covariance: Array
    by_temperature: Array  # (S, P): what temperature does
    worn: int = -1  # the parameter that changes
    start: float = np.nan  # day
    course: Array | None = None  # (S,)


def joint(rng: np.random.Generator, weeks: int = WEEKS, count: int = COUNT) -> Joint:
    """Return sessions of a joint that does not change."""
    days = np.arange(weeks) * 7.0 + rng.integers(0, 3, weeks)
    there = rng.random(weeks) > 0.1
    away = rng.integers(20, weeks)
    there[away : away + rng.integers(3, 9)] = False
    days = days[there]
    number = len(days)
    season = rng.uniform(1.0, 7.0) * np.sin(2.0 * np.pi * days / 365.25 + rng.uniform(0.0, 6.3))
    warm = 22.0 + season + rng.normal(0.0, rng.uniform(0.3, 2.5), number)

    root = rng.normal(size=(count, count))
    mixed = root @ root.T + 0.3 * np.eye(count)
    errors = np.exp(rng.uniform(np.log(0.1), 0.0, count))
    scale = errors / np.sqrt(np.diag(mixed))
    known = mixed * np.outer(scale, scale)
    size = np.exp(rng.normal(0.0, 0.3, number))
    wrong = np.exp(rng.uniform(np.log(0.7), np.log(1.4)))
    measured = rng.normal(size=(number, count)) @ np.linalg.cholesky(known).T
    measured *= size[:, None] * wrong

    share, memory = rng.choice([0.0, 0.3, 0.7], count), rng.uniform(0.2, 0.8, count)
    both = np.linalg.cholesky(0.4 + 0.6 * np.eye(count)).T
    lasting = np.empty((number, count))
    lasting[0] = rng.normal(size=count) @ both
    for s, gap in enumerate(np.diff(days) / 7.0, 1):
        kept = memory**gap
        lasting[s] = kept * lasting[s - 1]
        lasting[s] += np.sqrt(1.0 - kept**2) * (rng.normal(size=count) @ both)
    daily = rng.standard_t(4, size=(number, count)) / np.sqrt(2.0)
    noise = np.sqrt(share) * lasting + np.sqrt(1.0 - share) * daily
    off = rng.random(number) < 0.02
    noise[off] += rng.normal(0.0, 4.0, size=(int(off.sum()), count))

    above = (warm - 25.0)[:, None]
    falls = rng.random(count) < 0.3
    by_temperature = np.where(
        falls, 8.0 * np.expm1(-0.03 * above), above * rng.normal(0, 0.25, count)
    )
    values = noise + measured + by_temperature
    return Joint(days, warm, values, known[None] * size[:, None, None] ** 2, by_temperature)


KNOWN = ("step of 3", "3 a year", "8 a year", "accelerating", "settling at 4")
COURSES: dict[str, Course] = {
    "step of 3": lambda t: 3.0 * (t >= 0.0),
    "3 a year": lambda t: 3.0 * np.maximum(t, 0.0),
    "8 a year": lambda t: 8.0 * np.maximum(t, 0.0),
    "accelerating": lambda t: 6.0 * np.maximum(t, 0.0) ** 2,
    "settling at 4": lambda t: 4.0 * -np.expm1(-3.0 * np.maximum(t, 0.0)),
    "in jumps": lambda t: 1.5 * np.floor(np.maximum(4.0 * t, 0.0)),
    "by its root": lambda t: 4.0 * np.sqrt(np.maximum(t, 0.0)),
    "exponential": lambda t: 0.3 * np.expm1(3.5 * np.maximum(t, 0.0)),
}
"""Of years since the onset. Those in `KNOWN` are shapes of the model, whatever their rates."""


def worn(rng: np.random.Generator, course: str, count: int = COUNT) -> Joint:
    """Return a joint of which one parameter changes somewhere in its second year."""
    made = joint(rng, count=count)
    made.worn, made.start = int(rng.integers(count)), float(rng.uniform(300.0, 600.0))
    made.course = COURSES[course]((made.days - made.start) / 365.25)
    made.values[:, made.worn] += made.course
    return made


def ours(made: Joint, parameters: Sequence[int] = range(COUNT)) -> Array:
    """(S, P): what `track` asks of each parameter at each session, above its own threshold."""
    gains = []
    for p in parameters:
        own = Series(made.days, made.values[:, p], made.covariance[:, p, p], made.temperatures)
        gains.append(evidence_over_time(own))
    needed = [threshold(n, COUNT) for n in range(1, len(made.days) + 1)]
    return np.stack(gains, 1) - np.array(needed)[:, None]


def standard(made: Joint) -> Array:
    """(S, P) in standard deviations of the first sessions, the true effect of temperature out."""
    left = made.values - made.by_temperature
    first = left[:BASELINE]
    middle = np.median(first, axis=0)
    return (left - middle) / (1.4826 * np.median(np.abs(first - middle), axis=0))


def plain(made: Joint) -> Array:
    """Threshold on each."""
    found = np.abs(standard(made))
    found[:BASELINE] = -np.inf
    return found


def cusum(made: Joint) -> Array:
    """Tabular, both ways."""
    z = standard(made)
    found = np.full_like(z, -np.inf)
    up, down = np.zeros(z.shape[1]), np.zeros(z.shape[1])
    for s in range(BASELINE, len(z)):
        up, down = np.maximum(up + z[s] - 0.5, 0.0), np.maximum(down - z[s] - 0.5, 0.0)
        found[s] = np.maximum(up, down)
    return found


def ruptures_l2(made: Joint) -> Array:
    """What the cost l2 of `ruptures` gains by one change point, asked at each session.

    By sums, as it is asked a million times; `check` holds it against `ruptures` itself.
    """
    z = standard(made)
    found = np.full_like(z, -np.inf)
    total = np.vstack([np.zeros(z.shape[1]), np.cumsum(z, axis=0)])
    for n in range(BASELINE + 2, len(z) + 1):
        k = np.arange(4, n - 1)[:, None]
        a, b = total[4 : n - 1], total[n] - total[4 : n - 1]
        found[n - 1] = (a**2 / k + b**2 / (n - k) - total[n] ** 2 / n).max(axis=0)
    return found


RIVALS: dict[str, Callable[[Joint], Array]] = {
    "ruptures l2": ruptures_l2,
    "CUSUM": cusum,
    "threshold": plain,
}


def first_above(path: Array, level: float) -> int:
    """The first session at which any parameter is above; −1 for none."""
    over = (path > level).any(axis=1) if path.ndim > 1 else path > level
    return int(np.argmax(over)) if over.any() else -1


def level_for(paths: list[Array], years: float) -> float:
    """The threshold at which the rate of first alarms is `RATE`."""
    tops = np.sort([path.max() for path in paths])[::-1]

    def rate(level: float) -> float:
        hit, seen = 0, 0.0
        for path in paths:
            at = first_above(path, level)
            hit += at >= 0
            seen += (at + 1 if at >= 0 else len(path)) / len(path) * years
        return hit / seen

    low, high = float(np.nanmin(tops[np.isfinite(tops)])) - 1.0, float(tops[0]) + 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rate(middle) > RATE else (low, middle)
    return high


def history(made: Joint) -> History:
    """The same as `track` takes it."""
    count = made.values.shape[1]
    dates = np.datetime64("2026-01-01T00:00:00") + (made.days * 86400.0).astype("m8[s]")
    names = tuple(f"parameter_{p}.value" for p in range(count))
    return History(
        dates, names, ("Nm",) * count, made.values, made.covariance, made.temperatures
    )  # fmt: skip


@dataclass
class Covered:
    """How often something lay within its interval."""

    inside: int = 0
    of: int = 0

    def __call__(self, inside: bool) -> None:
        self.inside, self.of = self.inside + inside, self.of + 1

    def __str__(self) -> str:
        return f"{self.inside / max(self.of, 1):4.0%} of {self.of}"


class Tally:
    """What forecasts and onsets of one course came to."""

    def __init__(self) -> None:
        self.onset, self.size, self.inner, self.outer = (Covered() for _ in range(4))
        self.told = self.named = self.dated = 0
        self.off: list[float] = []
        self.wide: list[float] = []

    def __str__(self) -> str:
        return (
            f"told {self.told}, kind told {self.named}; onset off by {np.median(self.off):+.0f} "
            f"days, within {self.onset}; size within {self.size}; dates {self.dated}: 80 % "
            f"{self.inner}, 95 % {self.outer}, both ends {len(self.wide)}, median width "
            f"{np.median(self.wide) if self.wide else np.nan:.0f} days"
        )


def _limited(made: Joint, course: str, kept: NDArray[np.bool_], reached: float) -> Limit:
    """A limit that the level reaches on a day, or never, and the day."""
    law, years = COURSES[course], (reached - made.start) / 365.25
    order = np.argsort(made.temperatures)
    reference = float(np.median(made.temperatures[kept]))
    base = np.interp(reference, made.temperatures[order], made.by_temperature[order, 0])
    limit = float(base + law(np.array([years]))[0]) + 1e-6
    if course in ("settling at 4", "step of 3"):
        return limit + 1.0, np.inf
    if course == "in jumps":
        return limit, made.start + 365.25 * (np.floor(4.0 * years) + 1.0) / 4.0
    return limit, reached


def _count(made: Track, truth: Joint, law: Course, reached: float, tally: Tally) -> None:
    """Count what one track got right."""

    def since(when: datetime | None) -> float:
        first = made.history.dates[0].astype(datetime)
        return np.inf if when is None else (when - first).total_seconds() / 86400.0

    start, now = truth.start - truth.days[0], float(made.history.days[-1])
    change = max(made.changes, key=lambda c: abs(c.size))
    tally.told += 1
    tally.named += change.kind is not None
    tally.onset(since(change.between[0]) <= start <= since(change.between[1]))
    tally.off.append(since(change.date) - start)
    true = float(law(np.array([(now - start) / 365.25]))[0])
    tally.size(change.interval[0] <= true <= change.interval[1])
    (forecast,) = made.forecasts
    reached -= truth.days[0]
    if forecast.why_none:  # beyond it already, or not within the horizon
        tally.outer(forecast.chance < 1.0 and reached > now + 5.0 * 365.25)
        return
    tally.dated += 1
    for covered, ends in ((tally.inner, forecast.within_80), (tally.outer, forecast.within_95)):
        covered(since(ends[0]) - 7.0 <= reached <= since(ends[1]) + 7.0)
    width = since(forecast.within_95[1]) - since(forecast.within_95[0])
    tally.wide += [width] if np.isfinite(width) else []


def forecasts(joints: int, seed: int) -> None:
    """Print how often onset, size and date of a limit lie within their intervals, by course.

    One parameter; a third to one and a half years behind the onset, of a limit that is reached a
    quarter to two years later, or never. Dates are good to the week of a session.
    """
    for course, law in COURSES.items():
        rng = np.random.default_rng([seed, 11, list(COURSES).index(course)])
        tally = Tally()
        for _ in range(joints):
            made = worn(rng, course, 1)
            kept = made.days <= made.start + rng.uniform(120.0, 500.0)
            now = float(made.days[kept][-1])
            limit, reached = _limited(made, course, kept, now + rng.uniform(90.0, 700.0))
            found = track(history(made).sessions(kept), limits={"parameter_0": limit}, horizon=5.0)
            if found.changes:
                _count(found, made, law, reached, tally)
        print(f"{course:14} of {joints} {tally}", flush=True)


def main() -> None:
    """Print the tables."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--joints", type=int, default=100)
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--part", choices=("false", "delay", "forecast", "all"), default="all")
    given = ask.parse_args()
    parts = {"false": false_alarms, "delay": delays, "forecast": forecasts}
    for name, part in parts.items():
        if given.part in (name, "all"):
            part(given.joints, given.seed)


def rate(paths: list[Array], level: float) -> str:
    """Words for how many first alarms there are in a joint-year."""
    years = WEEKS * 7 / 365.25
    hit = [first_above(path, level) for path in paths]
    shares = [(at + 1) / len(p) if at >= 0 else 1.0 for at, p in zip(hit, paths, strict=True)]
    raised, seen = sum(at >= 0 for at in hit), years * sum(shares)
    return f"{raised / seen:.3f} a joint-year ({raised} in {seen:.0f} years)"


def false_alarms(joints: int, seed: int) -> None:
    """Print the rate of `track` at its own threshold, and at that of joints in a fleet."""
    rng = np.random.default_rng([seed, 3])
    paths = [ours(joint(rng)) for _ in range(joints)]
    print("track, false alarms:", rate(paths, 0.0), flush=True)
    for among in (10, 40):
        more = threshold(WEEKS, COUNT * among) - threshold(WEEKS, COUNT)
        print(f"as one of {among} joints of a fleet:", rate(paths, more), flush=True)


def check(made: Joint) -> float:
    """Largest difference of `ruptures_l2` from `ruptures` at one session of each parameter."""
    import ruptures

    z, n = standard(made), 60
    found = ruptures_l2(made)[n - 1]
    apart = []
    for p in range(z.shape[1]):
        cost = ruptures.costs.cost_factory(model="l2").fit(z[:n, p : p + 1])
        best = min(cost.error(0, k) + cost.error(k, n) for k in range(4, n - 2 + 1))
        apart.append(abs(cost.error(0, n) - best - found[p]))
    return float(max(apart))


def delays(joints: int, seed: int) -> None:
    """Print delays of all methods: `track` at its own threshold, rivals at the rate `RATE`."""
    rng = np.random.default_rng([seed, 5])
    sound, fresh = ([joint(rng) for _ in range(8 * joints)] for _ in range(2))
    print(f"l2 by sums and by ruptures differ by {check(sound[0]):.1e}")
    levels = {}
    for name, method in RIVALS.items():
        levels[name] = level_for([method(made) for made in sound], WEEKS * 7 / 365.25)
        told = rate([method(made) for made in fresh], levels[name])
        print(f"{name:12} level {levels[name]:6.2f}, on other joints {told}", flush=True)
    for course in COURSES:
        rng = np.random.default_rng([seed, 7, list(COURSES).index(course)])
        wearing = [worn(rng, course) for _ in range(joints)]
        paths = {"track": [ours(made, [made.worn]) for made in wearing]}
        for name, method in RIVALS.items():
            paths[name] = [method(made)[:, made.worn] for made in wearing]
        for name, own in paths.items():
            first = [first_above(path, levels.get(name, 0.0)) for path in own]
            told = [
                np.inf if at < 0 else (made.days[at] - made.start) / 7.0
                for at, made in zip(first, wearing, strict=True)
            ]
            late = np.sort([each for each in told if each >= 0.0])
            print(
                f"{course:14} {name:12} median {np.median(late):6.1f} weeks, 90 % "
                f"{late[int(0.9 * (len(late) - 1))]:6.1f}, worst {late[-1]:6.1f}, missed "
                f"{np.isinf(late).sum()}, before {len(told) - len(late)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
