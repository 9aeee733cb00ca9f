"""How well `track` tells wear: false alarms, delay, what it names, and how far its dates hold.

    python tests/bench/track.py [--joints 100] [--seed 1] [--part delay|forecast|all]

Joints of eight parameters, one session a week, as rigs have them and as no model below assumes:
missed weeks and months, noise of sessions with tails (Student's t of four), a share of it that
lasts (autoregressive, one to four weeks, shared by the parameters), days on which all is off,
measured errors that are wrong by up to 1.4 and correlated, seasons and single days of temperature,
friction that falls with it exponentially. Sizes are in standard deviations of the session noise.

The rivals see the same numbers with the true effect of temperature taken out, which nobody knows on
a rig: a threshold on each parameter, tabular CUSUM (k = 0.5), and `ruptures` with its costs l2 and
rbf, asked each week. Each method has the one threshold at which joints without wear raise one alarm
in ten years over all parameters, found on other joints than those on which it is then counted.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.tracking import History, track
from flexspline.tracking.changes import Series, evidence_over_time, threshold

Array = NDArray[np.float64]

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
COURSES: dict[str, Callable[[Array], Array]] = {
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


def ours(made: Joint) -> Array:
    """(S, P): what `track` asks of each parameter at each session, above its own h(n)."""
    gains = []
    for p in range(made.values.shape[1]):
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


def of_ruptures(model: str) -> Callable[[Joint], Array]:
    """Return the penalty below which one change point is found, asked at each session."""

    def ask(made: Joint) -> Array:
        import ruptures

        z = standard(made)
        found = np.full_like(z, -np.inf)
        for p in range(z.shape[1]):
            for n in range(BASELINE + 2, len(z) + 1):
                cost = ruptures.costs.cost_factory(model=model).fit(z[:n, p : p + 1])
                whole = cost.error(0, n)
                best = min(cost.error(0, k) + cost.error(k, n) for k in range(4, n - 1))
                found[n - 1, p] = whole - best
        return found

    return ask


def ruptures_l2(made: Joint) -> Array:
    """The same as `of_ruptures("l2")`, by sums: asked 10⁶ times."""
    z = standard(made)
    found = np.full_like(z, -np.inf)
    total = np.vstack([np.zeros(z.shape[1]), np.cumsum(z, axis=0)])
    for n in range(BASELINE + 2, len(z) + 1):
        k = np.arange(4, n - 1)[:, None]
        a, b = total[4 : n - 1], total[n] - total[4 : n - 1]
        found[n - 1] = (a**2 / k + b**2 / (n - k) - total[n] ** 2 / n).max(axis=0)
    return found


METHODS: dict[str, Callable[[Joint], Array]] = {
    "track": ours,
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


def forecasts(joints: int, seed: int) -> None:
    """Print how often onset, size and date of a limit lie within their intervals, by course.

    One parameter; a third to two years behind the onset, of a limit that is reached a quarter to
    two years later, or never.
    """
    for course, law in COURSES.items():
        rng = np.random.default_rng([seed, 11, list(COURSES).index(course)])
        onset, size, inner, outer = Covered(), Covered(), Covered(), Covered()
        told = named = dated = 0
        off, wide = [], []
        for _ in range(joints):
            made = worn(rng, course, 1)
            end = made.start + rng.uniform(120.0, 500.0)
            kept = made.days <= end
            whole = history(made)
            now = float(made.days[kept][-1])
            reached = now + rng.uniform(90.0, 700.0)
            years = (reached - made.start) / 365.25
            base = np.interp(
                float(np.median(made.temperatures[kept])),
                np.sort(made.temperatures),
                made.by_temperature[np.argsort(made.temperatures), 0],
            )
            limit = float(base + law(np.array([years]))[0] * (1.0 + 1e-9))
            if course == "settling at 4":
                limit, reached = limit + 1.0, np.inf
            if course in ("step of 3", "in jumps"):
                limit, reached = limit + 1e-6 + 1.0 * (course == "step of 3"), np.inf
                if course == "in jumps":
                    reached = made.start + 365.25 * (np.floor(4.0 * years) + 1.0) / 4.0
            found = track(whole.sessions(kept), limits={"parameter_0": limit}, horizon=5.0)
            if not found.changes:
                continue
            told += 1
            change = max(found.changes, key=lambda c: abs(c.size))
            start = (change.between[0] - whole.date(0.0)).total_seconds() / 86400.0
            stop = (change.between[1] - whole.date(0.0)).total_seconds() / 86400.0
            onset(start <= made.start <= stop + 1.0)
            off.append((change.date - whole.date(made.start)).days)
            true = float(law(np.array([(now - made.start) / 365.25]))[0])
            size(change.interval[0] <= true <= change.interval[1])
            named += change.kind is not None
            (forecast,) = found.forecasts
            if forecast.chance == 1.0 and forecast.why_none:
                outer(False)
                continue
            if forecast.why_none:  # not within the horizon
                outer(reached > now + 5.0 * 365.25)
                continue
            dated += 1
            for covered, ends in ((inner, forecast.within_80), (outer, forecast.within_95)):
                low, high = (
                    np.inf if each is None else (each - whole.date(0.0)).total_seconds() / 86400.0
                    for each in ends
                )
                covered(low - 7.0 <= reached <= high + 7.0)
            if forecast.within_95[1] is not None and forecast.within_95[0] is not None:
                wide.append((forecast.within_95[1] - forecast.within_95[0]).days)
        print(
            f"{course:14} told {told} of {joints}, kind told {named}; onset off by "
            f"{np.median(off) if off else np.nan:+.0f} days, within {onset}; size within {size}; "
            f"dates {dated}: 80 % {inner}, 95 % {outer}, closed {len(wide)}, median width "
            f"{np.median(wide) if wide else np.nan:.0f} days",
            flush=True,
        )


def main() -> None:
    """Print the tables."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--joints", type=int, default=100)
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--part", choices=("delay", "forecast", "all"), default="all")
    given = ask.parse_args()
    if given.part != "forecast":
        delays(given.joints, given.seed)
    if given.part != "delay":
        forecasts(given.joints, given.seed)


def delays(joints: int, seed: int) -> None:
    """Print rates of false alarms, and delays, of all methods."""
    years = WEEKS * 7 / 365.25
    rng = np.random.default_rng(seed)
    sound = [joint(rng) for _ in range(joints)]
    fresh = [joint(rng) for _ in range(joints)]
    levels = {}
    for name, method in METHODS.items():
        began = time.time()
        levels[name] = level_for([method(made) for made in sound], years)
        paths = [method(made) for made in fresh]
        hit = [first_above(path, levels[name]) for path in paths]
        shares = [(at + 1) / len(p) if at >= 0 else 1 for at, p in zip(hit, paths, strict=True)]
        seen = years * sum(shares)
        raised = sum(at >= 0 for at in hit)
        print(
            f"{name:12} level {levels[name]:6.2f}, on others {raised / seen:.3f} a joint-year "
            f"({raised} in {seen:.0f} years), {time.time() - began:.0f} s",
            flush=True,
        )
    for course in COURSES:
        rng = np.random.default_rng([seed, 7, list(COURSES).index(course)])
        wearing = [worn(rng, course) for _ in range(joints // 2)]
        for name, method in METHODS.items():
            delays, missed, before = [], 0, 0
            for made in wearing:
                at = first_above(method(made)[:, made.worn], levels[name])
                if at < 0:
                    missed += 1
                    delays.append(np.inf)
                elif made.days[at] < made.start:
                    before += 1
                else:
                    delays.append((made.days[at] - made.start) / 7)
            told = np.sort(delays)
            print(
                f"{course:14} {name:12} median {np.median(told):6.1f} weeks, 90 % "
                f"{told[int(0.9 * (len(told) - 1))]:6.1f}, missed {missed}, before {before}",
                flush=True,
            )


if __name__ == "__main__":
    main()
