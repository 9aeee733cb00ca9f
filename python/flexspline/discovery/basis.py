"""A flexible basis: what any smooth dependence on a channel, or on two, would explain.

A cause that is not in the catalogue still depends on something measured. Functions of each channel,
and of every two, stand for it: a few powers, which need little evidence, and hats (their products
for two), which follow every smooth function; a channel times every function of another; orders of
the motor's angle, one by one and together; and what a channel was some time ago.

Any linear cause with memory is a sum of first-order lags of its channel x with time constants T,

    T dz/dt + z = x,     z = x at the start

Some T, in geometric steps from two samples to half of the longest run, stand for all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import erf

from flexspline.discovery.physics import WIDTH, fastest_of
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import Effect
from flexspline.effects.causes import COULOMB
from flexspline.least_squares.problem import Problem, Run
from flexspline.logs.segments import median_step, runs
from flexspline.orders.parts import effective_ratio
from flexspline.regression.gram import TINY

__all__ = ["DIRECTION", "LEAD", "RATE", "ROUND", "TURNS", "BasisFunctions", "Functions", "Varied",
           "bent_forms", "channel_told", "flexible_basis", "past_of", "places_of",
           "state_functions", "turning_over", "values_of"]  # fmt: skip

Array = NDArray[np.float64]

MOST_ROWS = round(SETTINGS.rows / SETTINGS.negligible)
"""Of a run: beyond, its past is not looked at, to save memory."""
LEAD = 2 * SETTINGS.rows
"""Before a stretch of a part of a run, from which memory is followed."""
PAST = " behind each lag"
TURNS: tuple[Callable[[Array], Array], ...] = (
    lambda speed: np.asarray(speed / np.hypot(speed, 1.0)),
    lambda speed: np.asarray(erf(0.5 * np.sqrt(np.pi) * speed)),
)
"""Ways to turn over from −1 to 1 with a speed in widths, as steep at rest as tanh: one that takes
its level later, and a sign seen through Gaussian errors of the speed, which takes it sooner."""


def past_of(
    time: Array, values: Mapping[str, Array], names: list[str], longest: float
) -> dict[str, Array]:
    """Return some channels of a run behind each lag, (N, lags); `longest` of all runs, s."""
    step = median_step(time)
    lags = np.geomspace(2.0 * step, 0.5 * longest, SETTINGS.points)

    def behind(channel: Array, lag: float) -> Array:
        return np.concatenate([_lagged(channel[a:b], step / lag) for a, b in runs(time)])

    return {
        name + PAST: np.column_stack([behind(values[name], lag) for lag in lags])
        for name in names
        if name in values
    }


def _lagged(values: Array, share: float) -> Array:
    """Values behind a lag of 1 / share steps, settled at the first."""
    kept = np.exp(-share)
    made, _ = lfilter([1.0 - kept], [1.0, -kept], values, zi=[kept * values[0]])
    return np.asarray(made)


HIDDEN = {
    "sensor_torque": ("sensor_torque", "sensor_voltage"),
    "motor_torque": ("motor_torque", "motor_current", "duty", "supply_voltage"),
    "motor_current": ("motor_torque", "motor_current", "duty", "supply_voltage"),
    "torsion": ("motor_velocity",),
}
"""Channels that hold the target itself; a supply sags under the motor's own current."""
NEVER = ("enabled", "thermistor_voltage", "commanded_position", "motor_velocity", "motor_position",
         "simulated_torque")  # fmt: skip
STATE = ("output_position", "output_velocity", "output_acceleration", "temperature", "load")
"""Of a joint; its load where it is known."""
ROUND, DIRECTION, RATE = "motor_angle", "direction", "load_rate"
LAGGED = ("temperature", "motor_torque")
"""Channels whose past may act, beside the load's; that of the motion is friction with memory."""


def values_of(problem: Problem, number: int, rows: slice) -> dict[str, Array]:
    """Return what functions may depend on at some rows of a run: (n,), of the past (n, lags)."""
    run, found = problem.runs[number], _channels(problem)
    made = {name: run.log[name][rows] for name in found}
    if "time" in made:
        made["time"] = made["time"] - run.log["time"][0]
    if problem.known_load in found:
        made[RATE] = _rate(run.log[problem.known_load], run.log["time"], rows)
    if "output_velocity" in found:
        width = max(SETTINGS.bends * fastest_of(problem), TINY)
        made[DIRECTION] = np.tanh(made["output_velocity"] / width)
    if effective_ratio(run.log.facts) is not None and "output_position" in found:
        made[ROUND] = _motor_angle(run, rows)
    past = _past(problem, number)
    return {**made, **{name: values[rows] for name, values in past.items()}}


def _past(problem: Problem, number: int) -> dict[str, Array]:
    """What channels of a run were some time ago, (N, lags) each; nothing of very long runs."""
    if max(len(run) for run in problem.runs) > MOST_ROWS:
        return {}

    def made() -> dict[str, Array]:
        longest = max(float(np.ptp(run.log["time"])) for run in problem.runs)
        log = problem.runs[number].log
        values = {name: log[name] for name in _channels(problem)}
        return past_of(log["time"], values, [*LAGGED, problem.known_load or ""], longest)

    return problem.once(("lags", number), made)


def _rate(load: Array, time: Array, rows: slice) -> Array:
    """How fast the load changes, by the differences to the rows beside."""
    first, last = max(rows.start - 1, 0), min(rows.stop + 1, len(load))
    slope = np.gradient(load[first:last], time[first:last])
    return np.asarray(slope[rows.start - first : rows.stop - first])


def _channels(problem: Problem) -> list[str]:
    """Channels that all runs have and that change, but for the target's own."""
    return problem.once("channels", lambda: _usable(problem))


def _usable(problem: Problem) -> list[str]:
    hidden = {*HIDDEN[problem.target], *NEVER, *({"reference_torque"} - {problem.known_load})}
    logs = [run.log for run in problem.runs]

    def usable(name: str) -> bool:
        """Whether all runs have it whole, and it changes."""
        whole = all(name in log and np.isfinite(log[name]).all() for log in logs)
        return whole and any(np.ptp(log[name]) > 0.0 for log in logs)

    return [name for name in logs[0].channels if name not in hidden and usable(name)]


def _motor_angle(run: Run, rows: slice) -> Array:
    if "motor_position" in run.log:
        return run.log["motor_position"][rows]
    ratio = effective_ratio(run.log.facts) or 1.0
    return np.asarray(ratio * run.log["output_position"][rows])


Values = dict[str, Array]
Basis = Callable[[Values], Array]

TURN = 2.0 * np.pi
POWERS = tuple((power,) for power in range(1, SETTINGS.tried))
CROSSED = ((1, 1), (2, 1), (1, 2))
TOLD = {ROUND: "motor_position", DIRECTION: "output_velocity"}


@dataclass(frozen=True)
class BasisFunctions:
    """Functions of some channels: `columns` makes them, (N, C), from the values of these.

    `past`: whether they are of what a channel was, too. `plain`: whether they are powers alone.
    """

    channels: tuple[str, ...]
    columns: Basis
    count: int
    past: bool = False
    plain: bool = False


def channel_told(name: str, known_load: str | None) -> str:
    """Return the channel of a log behind one that is made of it."""
    return known_load or "" if name == RATE else TOLD.get(name, name)


def flexible_basis(problem: Problem, *, pairs: bool = True) -> list[BasisFunctions]:
    """Return functions of every channel that all runs have, and of every two."""
    alone, crossed = problem.once("functions", lambda: _flexible(_sample(problem)))
    return [*alone, *crossed] if pairs else [*alone]


def state_functions(problem: Problem) -> list[BasisFunctions]:
    """Return some functions of each channel of the joint's state that all runs have."""
    sample, few = _sample(problem), 2 * SETTINGS.tried
    names = (problem.known_load if name == "load" else name for name in STATE)
    return [BasisFunctions((n,), *_fine(sample, n, few)) for n in names if n in sample]


def _flexible(sample: Values) -> tuple[list[BasisFunctions], list[BasisFunctions]]:
    """All functions of every channel; and few of every channel and of every two."""
    past = [name for name in sample if name + PAST in sample]
    sample = {name: values for name, values in sample.items() if values.ndim == 1}
    alone = [BasisFunctions((name,), *_fine(sample, name)) for name in sample if name != DIRECTION]
    alone += [_memory(name) for name in past]
    straight = [name for name in sample if name not in (ROUND, DIRECTION)]
    made = [_powers(sample, (name,), POWERS) for name in straight]
    scaled = [name for name in sample if name not in (ROUND, "time")]
    made += [_powers(sample, both, CROSSED) for both in combinations(scaled, 2)]
    if ROUND in sample:
        made += [_waves(sample, name) for name in scaled]
        made += [
            BasisFunctions((ROUND,), _turning(ROUND, [k]), 2) for k in range(1, SETTINGS.lines + 1)
        ]
    for name in (name for name in straight if name not in ("time", RATE)):
        made += [_varying(sample, name, other) for other in scaled if other != name]
    few = SETTINGS.tried + 1
    coarse = {name: _hats_of(sample, name, few) for name in straight if name != "time"}
    return alone, made + [
        BasisFunctions((a, b), _product(coarse[a][0], coarse[b][0]), coarse[a][1] * coarse[b][1])
        for a, b in combinations(coarse, 2)
    ]


def _sample(problem: Problem) -> Values:
    """Every fourth row of all runs that counts, made a window at a time."""

    every, step = SETTINGS.tried, SETTINGS.tried * SETTINGS.rows

    def made() -> Values:
        parts = [
            {name: values[::every] for name, values in values_of(problem, number, rows).items()}
            for number, run in enumerate(problem.runs)
            for first, last in run.stretches
            for rows in (slice(row, min(row + step, last)) for row in range(first, last, step))
        ]
        return {name: np.concatenate([values[name] for values in parts]) for name in parts[0]}

    return problem.once("sample", made)


def _fine(sample: Values, name: str, count: int = SETTINGS.functions) -> tuple[Basis, int]:
    """All functions of one channel: periodic over a turn of an angle that turns, else hats."""
    if name == ROUND:
        return _turning(name, range(1, count + 1)), 2 * count
    if name == "output_position" and np.ptp(sample[name]) > TURN:
        return _turning(name, range(1, count // 2 + 1)), count
    return _hats_of(sample, name, count)


def _hats_of(sample: Values, name: str, count: int) -> tuple[Basis, int]:
    """Hats over a channel, made once of some values: many functions are made of the same."""
    knots = _knots(sample[name], count, name in ("output_velocity", RATE))
    key = f"hats of {name} at {knots.tobytes().hex()}"

    def columns(values: Values) -> Array:
        if key not in values:
            values[key] = _hats(values[name], knots)
        return values[key]

    return columns, len(knots)


def places_of(problem: Problem) -> Functions:
    """Hats of three widths at every place of the output's angle; none where it is not measured."""
    angle = _sample(problem).get("output_position")
    if angle is None:
        return Functions(())
    first, last = np.quantile(angle, (SETTINGS.negligible, 1.0 - SETTINGS.negligible))
    counts = [SETTINGS.functions // 2, SETTINGS.functions, 2 * SETTINGS.functions]

    def hats(count: int) -> BasisFunctions:
        knots = np.linspace(first, last, count)
        return BasisFunctions(
            ("output_position",), lambda values: _hats(values["output_position"], knots), count
        )

    return Functions(tuple(hats(count) for count in counts))


def _powers(
    sample: Values, names: tuple[str, ...], exponents: Sequence[tuple[int, ...]]
) -> BasisFunctions:
    """Products of powers of channels, each counted from its middle in its own spread."""
    scaled = [_scaled(sample, name) for name in names]

    def columns(values: Values) -> Array:
        parts = [one(values)[:, 0] for one in scaled]
        made = np.empty((len(parts[0]), len(exponents)), order="F")
        for column, powers in zip(made.T, exponents, strict=True):
            both = zip(parts, powers, strict=True)
            column[:] = reduce(np.multiply, [part for part, power in both for _ in range(power)])
        return made

    return BasisFunctions(names, columns, len(exponents), plain=True)


def _waves(sample: Values, name: str) -> BasisFunctions:
    """Low orders of the motor's angle that grow with a channel."""
    turning = _turning(ROUND, range(1, SETTINGS.tried + 1))
    return BasisFunctions(
        (ROUND, name), _product(turning, _scaled(sample, name)), 2 * SETTINGS.tried
    )


def bent_forms(problem: Problem, effects: Sequence[Effect]) -> Bent | None:
    """Other forms of some effects; None of one that remembers, or whose load is the model's own."""
    sample, count = _sample(problem), SETTINGS.functions
    made = []
    for effect in effects:
        if effect.info.remembers or ("load" in effect.reads and problem.known_load is None):
            return None
        turning = any(not pair.startswith("output") for _, pair in effect.harmonics)
        slow = ["output_position", *(["output_velocity"] if turning else [])]
        named = slow if effect.ripple else effect.reads
        own = [problem.known_load if name == "load" else name for name in named]
        made.append(tuple(_hats_of(sample, name, count) for name in own if name in sample))
    return Bent(tuple(effects), tuple(made))


def turning_over(problem: Problem, effects: Sequence[Effect]) -> Functions | None:
    """Return other ways (`TURNS`) in which sliding friction takes its level: the effect's is tanh.

    None where no effect is sliding friction, or the speed is not measured.
    """
    widths = [e.shapes[WIDTH] for e in effects if e.name == COULOMB and WIDTH in e.shapes]
    if not widths or "output_velocity" not in _channels(problem):
        return None
    width = widths[0]

    def columns(values: Values) -> Array:
        return np.column_stack([turned(values["output_velocity"] / width) for turned in TURNS])

    return Functions((BasisFunctions(("output_velocity",), columns, len(TURNS)),))


def _memory(name: str) -> BasisFunctions:
    """What a channel is and was: itself and behind each lag."""

    def columns(values: Values) -> Array:
        return np.column_stack([values[name], values[name + PAST]])

    return BasisFunctions((name,), columns, 1 + SETTINGS.points, past=True)


def _varying(sample: Values, name: str, other: str) -> BasisFunctions:
    """A channel times every function of another: a coefficient that varies with it."""
    hats, count = _hats_of(sample, name, SETTINGS.functions)
    return BasisFunctions((name, other), _product(hats, _scaled(sample, other)), count)


def _scaled(sample: Values, name: str) -> Basis:
    """A channel counted from its middle in its own spread, (N, 1); what has a sign, from zero."""
    signed = name in ("output_velocity", "output_acceleration", RATE, DIRECTION)
    low, high = np.quantile(sample[name], (SETTINGS.negligible, 1.0 - SETTINGS.negligible))
    middle = 0.0 if signed else 0.5 * float(low + high)
    spread = max(float(np.abs(sample[name] - middle).max()), TINY)
    return lambda values: np.asarray((values[name] - middle) / spread)[:, None]


def _knots(values: Array, count: int, both_ways: bool) -> Array:
    """Between the quantiles of the values; of a velocity, the same on both sides of zero."""
    if both_ways:
        inside = np.linspace(SETTINGS.little, 1.0 - SETTINGS.negligible, count // 2)
        speeds = np.quantile(np.abs(values), inside)
        knots = np.concatenate([-speeds[::-1], [0.0], speeds])
    else:
        inside = np.linspace(SETTINGS.negligible, 1.0 - SETTINGS.negligible, count)
        knots = np.quantile(values, inside)
    least = SETTINGS.little * SETTINGS.negligible * float(knots[-1] - knots[0])
    return np.asarray(knots[np.concatenate([[True], np.diff(knots) > least])])


def _hats(values: Array, knots: Array) -> Array:
    """Piecewise linear functions, one at each knot, constant beyond the ends: (N, knots)."""
    hats = np.zeros((len(values), len(knots)), order="F")
    if len(knots) == 1:
        hats[:] = 1.0
        return hats
    at = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((values - knots[at]) / np.diff(knots)[at], 0.0, 1.0)
    rows = np.arange(len(values))
    hats[rows, at], hats[rows, at + 1] = 1.0 - share, share
    return hats


def _turning(name: str, orders: Sequence[int]) -> Basis:
    """Cosines and sines of an angle, (N, 2 orders)."""
    numbers = np.array(orders)

    def columns(values: Values) -> Array:
        phase = numbers[:, None] * values[name]
        return np.concatenate([np.cos(phase), np.sin(phase)]).T

    return columns


def _product(first: Basis, second: Basis) -> Basis:
    def columns(values: Values) -> Array:
        a, b = first(values), second(values)
        made = np.empty((len(a), a.shape[1] * b.shape[1]), order="F")
        for k, column in enumerate(a.T):
            np.multiply(column[:, None], b, out=made[:, k * b.shape[1] : (k + 1) * b.shape[1]])
        return made

    return columns


@dataclass(frozen=True, eq=False)
class Functions:
    """Several groups as columns of a `ColumnAssembly`; behind them one column (N,) of each run."""

    groups: tuple[BasisFunctions, ...] = ()
    column: tuple[Array, ...] | None = None

    @property
    def count(self) -> int:
        return sum(group.count for group in self.groups) + (self.column is not None)

    def rows(self, problem: Problem, number: int, rows: slice) -> Array:
        """Return some rows of a run, (n, count)."""
        values = values_of(problem, number, rows) if self.groups else {}
        made = np.empty((rows.stop - rows.start, self.count), order="F")
        done = 0
        for group in self.groups:
            made[:, done : done + group.count] = group.columns(values)
            done += group.count
        if self.column is not None:
            made[:, done] = self.column[number][rows]
        return made


@dataclass(frozen=True, eq=False)
class Varied:
    """Functions times a torque (N,) of each run, as columns of a `ColumnAssembly`."""

    torque: tuple[Array, ...]
    functions: Functions

    @property
    def count(self) -> int:
        return self.functions.count

    def rows(self, problem: Problem, number: int, rows: slice) -> Array:
        """Return some rows of a run, (n, count)."""
        return self.functions.rows(problem, number, rows) * self.torque[number][rows, None]


@dataclass(frozen=True, eq=False)
class Bent:
    """Columns of effects, each times every smooth function of a channel that the effect reads.

    `hats`: functions of each such channel, and how many they are, by effect.
    """

    effects: tuple[Effect, ...]
    hats: tuple[tuple[tuple[Basis, int], ...], ...]

    @property
    def count(self) -> int:
        both = zip(self.effects, self.hats, strict=True)
        return sum(len(effect.terms) * sum(n for _, n in own) for effect, own in both)

    def rows(self, problem: Problem, number: int, rows: slice) -> Array:
        """Return some rows of a run, (n, count)."""
        size, made = rows.stop - rows.start, []
        channels = {name: v[rows] for name, v in problem.runs[number].channels.items()}
        values = values_of(problem, number, rows)
        for effect, own in zip(self.effects, self.hats, strict=True):
            none = np.zeros(len(effect.terms))
            columns = np.asarray(problem.design((effect,)).rows(channels, size, none))
            made += [hats(values) * column[:, None] for hats, _ in own for column in columns.T]
        return np.column_stack([np.empty((size, 0)), *made])
