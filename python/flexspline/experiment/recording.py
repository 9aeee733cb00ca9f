"""A planned run as a log: the commanded trajectory, and the channels that a recording would have.

Trajectories are those that labs record, each kind a map from numbers in [0, 1] to a path within
limits.

    strokes       to and fro at three constant speeds
    sines         a sum of three sines
    small cycles  slow reversals over a small angle, a smaller one in between, at several places
    holds         rests at several places, on the way up and on the way down
    rest          at one place

Every path starts and ends at rest at the same angle, so that it can be repeated at another load or
temperature. A path of pulses is made of consecutive accelerations a(s) = A sin²(π s / T):

    v(s) = A (s/2 − T/4π sin 2πs/T),     q(s) = A (s²/4 + T²/8π² (cos 2πs/T − 1))

so that a pulse changes the speed by A T / 2, and the jerk is bounded. A = 0 is a rest or a
stretch at constant speed. A path of sines is a sum of them in a window that rises as
6x⁵ − 15x⁴ + 10x³ at both ends. Both are twice continuously differentiable.

The motor torque is what the drive of the recorded runs would need for the motion.

Load and temperature stand at levels, at which the motion is repeated, or change slowly under it: a
part of a run has a load that is constant or a cosine, and a temperature that is constant or rises
exponentially. Between parts the joint rests while the load changes. Parts at different temperatures
are runs of their own, with a gap between them in the file's time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect, effect
from flexspline.effects.causes import BASIC, GRAVITY, SCALING_WITH_LOAD
from flexspline.errors import InputError
from flexspline.experiment.plan import LEAST_KELVIN, Bounds, Range, joined, over, short
from flexspline.least_squares.problem import Problem, Run, kept_rows, problem_of
from flexspline.logs.derive import lowpass
from flexspline.logs.local_fit import NARROWEST, WIDEST
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.prepared import Preparation, prepared
from flexspline.regression.candidate_model import CandidateModel, candidate_model_of, started
from flexspline.regression.gram import Whitening
from flexspline.signals import channels_for, core_channels, gear_of

__all__ = [
    "Excitation",
    "Motor",
    "Part",
    "as_problem",
    "commanded",
    "kinds_for",
    "motor_of",
    "moved",
    "reach",
    "settings",
]

Array = NDArray[np.float64]

RATE = 100.0  # Hz, of the trajectory file

REST = 1.0  # s at least, in which a load changes
STEEPEST = 1.875  # of a smooth step of one second and one unit
RESTS = 0.25  # of the run that changes of the load may take
WAIT = 1800.0  # s in the file between runs at different temperatures

MOST_PARTS = 6
MOST_ROWS = 10_000_000  # of a run that is planned: each kind is drawn some hundred times
WARM = 3.0  # time constants of a warm-up in a part

SPEEDS = 3
SINES = 3
EDGE = 0.15  # of the duration that the window of sines rises at either end
ATTEMPTS = 8
LOOKED_AT = 300  # times in a path

SHORTEST_RAMP = 0.1  # s

Path = Callable[[Array], Array]
"""From times (N,) [s] to angle, velocity and acceleration, (N, 3)."""
Pulse = tuple[float, float]
"""Length [s] and largest acceleration [rad/s²]."""


@dataclass(frozen=True)
class Drawn:
    """A path, and what it is in words."""

    path: Path
    words: str


@dataclass(frozen=True, eq=False)
class Kind:
    """A family of paths: `draw` takes (D,) numbers in [0, 1] and limits.

    `starts`: points (K, D) to begin a search from. `steps`: how much there is to set up, 0 for a
    rest.
    `for_memory`: only worth it for effects that remember; for others it would hang on the form of
    friction at reversals.
    """

    name: str
    draw: Callable[[Array, Bounds], Drawn]
    starts: Array
    steps: int
    for_memory: bool = False


def _reach(bounds: Bounds, share: float) -> float:
    """How far a move gets in a share of the run, within the limits [rad]."""
    far = reach(share * bounds.duration, bounds.velocity, bounds.acceleration)
    return min(far, bounds.span)


def _between(low: float, high: float, share: float) -> float:
    """The geometric way from one number to another."""
    return float(low * (high / low) ** share)


def strokes(u: Array, bounds: Bounds) -> Drawn:
    """Five numbers: width and place of the angles, fastest and slowest speed, place of the slow."""
    fast = bounds.velocity * _between(0.15, 1.0, u[2])
    speeds = np.geomspace(fast * _between(0.02, 1.0, u[3]), fast, SPEEDS)
    span = bounds.span * _between(0.15, 1.0, u[0])
    for width in (span, min(span, _reach(bounds, 0.1))):
        low = bounds.position[0] + u[1] * (bounds.span - width)
        share = bounds.duration / SPEEDS
        for _ in range(ATTEMPTS):
            pulses, fastest = _strokes(low, width, speeds, u[4], share, bounds)
            path = Pulses(low, pulses)
            if path.seconds <= bounds.duration and any(fastest):
                angles = path(np.linspace(0.0, path.seconds, LOOKED_AT))[:, 0]
                where = over(angles.min(), angles.max())
                words = f"strokes {where} at {joined(short(v) for v in fastest if v)} rad/s"
                return Drawn(path, words)
            if not path.seconds:  # too short for strokes of these speeds
                break
            share *= 0.98 * bounds.duration / path.seconds
    return rests(u[1:2], bounds)


def _strokes(
    low: float, span: float, speeds: Array, place: float, share: float, bounds: Bounds
) -> tuple[list[Pulse], list[float]]:
    pulses: list[Pulse] = []
    at, speeds_of = low, []
    for speed in speeds:
        speed = min(float(speed), 0.125 * bounds.acceleration * share)
        ramp = ramp_to(speed, bounds.acceleration)
        width = min(span, max(speed * (0.5 * share - ramp), 0.0))
        first = low + place * (span - width)
        there, back = (moved(d, speed, bounds.acceleration) for d in (width, -width))
        trips = max(1, int(share / (sum(p[0] for p in (*there, *back)) + 1e-12)))
        pulses += moved(first - at, bounds.velocity, bounds.acceleration)
        pulses += (there + back) * trips
        at = first
        speeds_of.append(reached(width, speed, bounds.acceleration)[0])
    return pulses + moved(low - at, bounds.velocity, bounds.acceleration), speeds_of


def sines(u: Array, bounds: Bounds) -> Drawn:
    """Nine numbers: size, place, lowest frequency, two ratios, two weights, two phases."""
    slowest = 2.0 / bounds.duration
    fastest = max(bounds.acceleration / bounds.velocity / (2.0 * np.pi), 2.0 * slowest)
    first = _between(slowest, fastest, u[2])
    hertz = first * np.cumprod([1.0, 1.1 + 2.0 * u[3], 1.1 + 2.0 * u[4]])
    weights = np.array([1.0, 1.5 * u[5], 1.5 * u[6]])
    phases = 2.0 * np.pi * np.array([0.0, u[7], u[8]])
    edge = EDGE * bounds.duration
    rates = 2.0 * np.pi * hertz
    plain = Sines(0.0, weights / rates, rates, phases, bounds.duration, edge)
    time = np.linspace(0.0, bounds.duration, max(400, int(40.0 * hertz[-1] * bounds.duration)))
    q, v, a = plain(time).T
    most = [bounds.span / np.ptp(q), bounds.velocity / np.abs(v).max(),
            bounds.acceleration / np.abs(a).max()]  # fmt: skip
    scale = 0.99 * min(most) * (0.2 + 0.8 * u[0])
    beyond = 0.005 * scale * np.ptp(q)  # between two of the times looked at
    low, high = scale * q.min() - beyond, scale * q.max() + beyond
    centre = bounds.position[0] - low + u[1] * (bounds.span - (high - low))
    path = Sines(float(centre), scale * plain.amplitudes, rates, phases, bounds.duration, edge)
    where, speed = over(centre + low, centre + high), short(scale * np.abs(v).max())
    tones = joined(short(f) for f in hertz)
    return Drawn(path, f"a sum of sines of {tones} Hz {where}, up to {speed} rad/s")


def small_cycles(u: Array, bounds: Bounds) -> Drawn:
    """Four numbers: angle, speed, how many places, how far these reach."""
    width = min(bounds.span * _between(1e-3, 0.3, u[0]), _reach(bounds, 0.05))
    speed = bounds.velocity * _between(0.01, 1.0, u[1])
    count = 1 + int(3.999 * u[2])
    far = (bounds.span - width) * u[3]
    low = bounds.position[0] + 0.5 * (bounds.span - width - far)
    places = low + far * np.linspace(0.0, 1.0, count) if count > 1 else np.array([low])
    cycle: list[Pulse] = []
    for part in (width, -width, width / 3.0, -width / 3.0):
        cycle += moved(part, speed, bounds.acceleration)
    if not cycle:  # too short for any
        return rests(u[:1], bounds)
    between: list[list[Pulse]] = [
        moved(d, bounds.velocity, bounds.acceleration) for d in np.diff(places, append=places[0])
    ]
    left = bounds.duration - sum(p[0] for move in between for p in move)
    trips = int(left / count / sum(p[0] for p in cycle))
    if trips < 1:  # too slow for the run
        return small_cycles(np.array([u[0], min(u[1] + 0.1, 1.0), 0.8 * u[2], 0.8 * u[3]]), bounds)
    pulses = [pulse for move in between for pulse in [*(cycle * trips), *move]]
    fastest = reached(width, speed, bounds.acceleration)[0]
    where = f"at {short(places[0] + 0.5 * width)} rad" if count == 1 else (
        f"at {count} places {over(places[0], places[-1] + width)}")  # fmt: skip
    return Drawn(
        Pulses(float(places[0]), pulses),
        f"slow reversals over {short(width)} rad at {short(fastest)} rad/s {where}",
    )


def holds(u: Array, bounds: Bounds) -> Drawn:
    """Three numbers: how many places, speed between them, how far they reach."""
    count = 2 + int(4.999 * u[0])
    speed = bounds.velocity * _between(0.1, 1.0, u[1])
    far = bounds.span * (0.2 + 0.8 * u[2])
    far = min(far, _reach(bounds, 0.2)) if count == 2 else far
    low = bounds.position[0] + 0.5 * (bounds.span - far)
    places = low + far * np.linspace(0.0, 1.0, count)
    order = np.concatenate([places[1:], places[-2::-1]])
    moves = [moved(d, speed, bounds.acceleration) for d in np.diff(order, prepend=places[0])]
    left = bounds.duration - sum(p[0] for move in moves for p in move)
    if left < 0.2 * bounds.duration:
        return holds(np.array([0.7 * u[0], min(u[1] + 0.2, 1.0), 0.7 * u[2]]), bounds)
    pauses = rested(left / len(moves))
    pulses = [pulse for move in moves for pulse in [*move, *pauses]]
    words = f"rests at {count} places {over(low, low + far)}, on the way up and on the way down"
    return Drawn(Pulses(float(low), pulses), words)


def rests(u: Array, bounds: Bounds) -> Drawn:
    """One number: where."""
    at = bounds.position[0] + u[0] * bounds.span
    return Drawn(Pulses(float(at), rested(bounds.duration)), f"rest at {short(at)} rad")


def _spread(count: int, dimensions: int, *fixed: tuple[float, ...]) -> Array:
    """Points that lie evenly in the cube (Halton's sequence), behind some that are chosen."""
    from scipy.stats import qmc

    even = qmc.Halton(dimensions, scramble=False).random(count + 1)[1:]
    return np.concatenate([np.array(fixed).reshape(-1, dimensions), even])


def kinds_for(bounds: Bounds, remembers: bool) -> list[Kind]:
    """Kinds of runs that limits allow; with `remembers`, those for effects with memory too."""
    if not bounds.span > 0.0:
        return [kind for kind in _kinds() if kind.name == "rest"]
    return [kind for kind in _kinds() if remembers or not kind.for_memory]


@cache
def _kinds() -> tuple[Kind, ...]:
    ready = _spread(9, 5, (1, 0.5, 1, 0.5, 0.5), (1, 0.5, 1, 0.2, 0.5), (1, 0.5, 1, 0.8, 0.5))
    tones = (0.3, 0.5, 0.5, 0.4, 0.3, 0.6)
    return (
        Kind("rest", rests, np.array([[0.0], [0.5], [1.0]]), 0),
        Kind("strokes", strokes, ready, 1),
        Kind("sines", sines, _spread(12, 9, (1, 0.5, 0.2, *tones), (1, 0.5, 1, *tones)), 2),
        Kind("holds", holds, _spread(2, 3, (0.5, 1, 1), (1, 1, 1)), 2),
        Kind("small cycles", small_cycles, _spread(6, 4), 2, for_memory=True),
    )


def moved(distance: float, speed: float, acceleration: float) -> list[Pulse]:
    """Pulses of a move from rest to rest, no faster than `speed`; no move where it is none."""
    far = abs(distance)
    if not far > 0.0:
        return []
    speed, ramp = reached(far, speed, acceleration)
    size = float(np.copysign(2.0 * speed / ramp, distance))
    return [(ramp, size), (max(far / speed - ramp, 0.0), 0.0), (ramp, -size)]


def reached(far: float, speed: float, acceleration: float) -> tuple[float, float]:
    """Highest speed [rad/s] of a move from rest to rest, and the time [s] to get there."""
    speed = min(speed, float(np.sqrt(0.5 * far * acceleration)))
    ramp = ramp_to(speed, acceleration)
    return min(speed, far / ramp), ramp


def ramp_to(speed: float, acceleration: float) -> float:
    """Time [s] to get to a speed: never a jolt."""
    return max(2.0 * speed / acceleration, SHORTEST_RAMP)


def reach(seconds: float, speed: float, acceleration: float) -> float:
    """How far a move from rest to rest gets in a time [rad]."""
    speed = min(speed, 0.25 * acceleration * seconds)
    return max(speed * (seconds - ramp_to(speed, acceleration)), 0.0)


def rested(seconds: float) -> list[Pulse]:
    return [(seconds, 0.0)]


@dataclass(frozen=True)
class Pulses:
    """Path of pulses from an angle; before and behind them it rests."""

    start: float
    pulses: Sequence[Pulse]

    @property
    def seconds(self) -> float:
        return float(sum(length for length, _ in self.pulses))

    def __call__(self, time: Array) -> Array:
        length, size = np.array([(0.0, 0.0), *self.pulses, (0.0, 0.0)]).T
        begins = np.concatenate([[0.0], np.cumsum(length)[:-1]])
        gained = 0.5 * size * length
        speed = np.concatenate([[0.0], np.cumsum(gained)[:-1]])
        gone = speed * length + 0.25 * size * length**2
        angle = self.start + np.concatenate([[0.0], np.cumsum(gone)[:-1]])
        speed[-1] = 0.0  # what rounding leaves
        at = np.maximum(np.searchsorted(begins, time, side="right") - 1, 0)
        since, lasts = time - begins[at], np.where(length[at] > 0.0, length[at], 1.0)
        turn = 2.0 * np.pi * since / lasts
        half = lasts / (2.0 * np.pi)
        a = size[at] * np.sin(0.5 * turn) ** 2
        v = speed[at] + 0.5 * size[at] * (since - half * np.sin(turn))
        q = angle[at] + speed[at] * since
        q = q + 0.5 * size[at] * (0.5 * since**2 + half**2 * (np.cos(turn) - 1.0))
        return np.column_stack([q, v, a])


@dataclass(frozen=True, eq=False)
class Sines:
    """Path c + w(t) Σ a sin(ω t + φ), at rest at the centre c at both ends of its duration."""

    centre: float
    amplitudes: Array
    rates: Array
    phases: Array
    duration: float
    edge: float

    def __call__(self, time: Array) -> Array:
        phase = np.outer(time, self.rates) + self.phases
        s = np.sin(phase) @ self.amplitudes
        ds = np.cos(phase) @ (self.amplitudes * self.rates)
        dds = -np.sin(phase) @ (self.amplitudes * self.rates**2)
        up, down = _smoothstep(time / self.edge), _smoothstep((self.duration - time) / self.edge)
        w = up[:, 0] * down[:, 0]
        dw = (up[:, 1] * down[:, 0] - up[:, 0] * down[:, 1]) / self.edge
        ddw = up[:, 2] * down[:, 0] - 2.0 * up[:, 1] * down[:, 1] + up[:, 0] * down[:, 2]
        ddw = ddw / self.edge**2
        q = self.centre + w * s
        return np.column_stack([q, w * ds + dw * s, w * dds + 2.0 * dw * ds + ddw * s])


def _smoothstep(x: Array) -> Array:
    """6x⁵ − 15x⁴ + 10x³ with its two derivatives, (N, 3); 0 below 0 and 1 above 1."""
    x = np.clip(x, 0.0, 1.0)
    return np.column_stack(
        [
            x**3 * (10.0 + x * (6.0 * x - 15.0)),
            30.0 * x**2 * (1.0 - x) ** 2,
            60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
        ]
    )


@dataclass(frozen=True, eq=False)
class Excitation:
    """One run of the family: kind, its numbers (D,) in [0, 1], and load and temperature."""

    kind: Kind
    numbers: Array
    setting: Setting

    @property
    def name(self) -> str:
        return self.kind.name

    def words(self, bounds: Bounds) -> str:
        """What to record, in words."""
        drawn = self.kind.draw(self.numbers, bounds.lasting(_whole_steps(self.setting, bounds)))
        return ", ".join(s for s in (drawn.words, self.setting.words) if s)


def commanded(made: Excitation, bounds: Bounds, rate: float) -> dict[str, Array]:
    """Return time, motion, and load and temperature where they are set, arrays (N,).

    The path is that of `Excitation.words` at any rate.
    """
    seconds = _whole_steps(made.setting, bounds)
    count = max(int(seconds * rate + 1e-6), 2)
    if count > MOST_ROWS:
        raise InputError(
            f"a run of {count / rate:.4g} s at {rate:.4g} Hz has {count} rows where {MOST_ROWS} "
            "are planned at most; give a shorter duration"
        )
    drawn = made.kind.draw(made.numbers, bounds.lasting(seconds))
    path = drawn.path(np.arange(count + 1) / rate)
    pieces = list(_pieces(made.setting.parts, path, bounds, rate))
    rows = np.concatenate([piece for piece, _ in pieces])
    waits = np.repeat(np.cumsum([wait for _, wait in pieces]), [len(p) for p, _ in pieces])
    names = ["output_position", "output_velocity", "output_acceleration"]
    names += ["load"] if made.setting.parts[0].load else []
    names += ["temperature"] if made.setting.parts[0].temperature else []
    time = np.arange(len(rows)) / rate + waits
    return {"time": time, **dict(zip(names, rows.T, strict=True))}


def _pieces(
    parts: Sequence[Part], path: Array, bounds: Bounds, rate: float
) -> Iterator[tuple[Array, float]]:
    """Rows of each part and of rests before it, with the wait [s] before them.

    `path`: (n + 1, 3), from rest to rest; its last row is the first of what follows.
    """
    share = np.linspace(0.0, 1.0, len(path))
    for number, part in enumerate(parts):
        before = parts[number - 1] if number else part
        rest = _change(before, part, bounds, rate)
        if len(rest):
            still = np.repeat(path[:1], len(rest), axis=0)
            yield _beside(still, rest, part, np.zeros(len(rest))), 0.0
        last = len(path) if number == len(parts) - 1 else len(path) - 1
        load = part.loads(share[:last]) if part.load else None
        wait = WAIT if part.temperature != before.temperature else 0.0
        yield _beside(path[:last], load, part, share[:last]), wait


def as_problem(
    columns: dict[str, Array],
    problem: Problem,
    effects: Sequence[Effect],
    motor: Motor | None,
    ways: Sequence[Preparation] = (),
) -> Problem:
    """Return a planned run as the core would read its recording; the target is not known: zero.

    What waits for a temperature lies in runs of their own. `ways`: how the motion is smoothed; one
    that is too fast for the planned run's rate leaves it as it is.
    """
    columns = dict(columns)
    load = columns.pop("load", None)
    if load is not None and problem.known_load is not None:
        columns[problem.known_load] = load
    if problem.gear["motor_encoder"]:
        ratio = float(problem.gear["effective_ratio"])
        columns["motor_position"] = ratio * columns["output_position"]
    cuts = np.flatnonzero(np.diff(columns["time"]) > 0.5 * WAIT) + 1
    pieces = zip(*(np.split(values, cuts) for values in columns.values()), strict=True)
    parts = [dict(zip(columns, piece, strict=True)) for piece in pieces]
    made = tuple(_run(part, problem, effects, motor, ways) for part in parts)
    return replace(problem, runs=made, kept={})


def _run(
    columns: dict[str, Array],
    problem: Problem,
    effects: Sequence[Effect],
    motor: Motor | None,
    ways: Sequence[Preparation],
) -> Run:
    log = Log(columns, dict(problem.runs[0].log.facts))
    if motor is not None:
        log = log.with_columns({"motor_torque": motor.torque(log)}, note="as the drive needs")
    log = prepared(log, [w for w in ways if NARROWEST < w.bandwidth / log.rate <= WIDEST])
    channels = core_channels(log, effects, problem.known_load, problem.carried)
    stretches = [(int(a), int(b)) for a, b in runs(log["time"])]
    target = np.zeros(len(log))
    if problem.lowpass is not None:
        stretches = kept_rows(stretches, lowpass(target, log["time"], problem.lowpass).valid)
    return Run(log, channels, target, tuple(stretches), tuple(stretches))


def _seconds(setting: Setting, bounds: Bounds) -> float:
    """Of one part."""
    parts = setting.parts
    rests = sum(_rest(a, b, bounds) for a, b in pairwise(parts))
    return (bounds.duration - rests) / len(parts)


def _whole_steps(setting: Setting, bounds: Bounds) -> float:
    """Seconds of one part in whole steps of the file, so that its last row is at rest."""
    return max(int(_seconds(setting, bounds) * RATE), 2) / RATE


def _rest(before: Part, after: Part, bounds: Bounds) -> float:
    """Seconds at rest while the load changes between two parts."""
    if before.load is None or after.load is None or before.load == after.load:
        return 0.0
    change = abs(float(after.loads(np.zeros(1))[0] - before.loads(np.ones(1))[0]))
    longest = RESTS * bounds.duration / 5.0
    return float(min(max(STEEPEST * change / max(bounds.load_rate, 1e-12), REST), longest))


def _change(before: Part, after: Part, bounds: Bounds, rate: float) -> Array:
    """Load (N,) at rest between two parts; none where it stays."""
    count = int(_rest(before, after, bounds) * rate)
    if not count:
        return np.empty(0)
    first, last = before.loads(np.ones(1))[0], after.loads(np.zeros(1))[0]
    return np.asarray(first + (last - first) * _smoothstep(np.arange(count) / count)[:, 0])


def _beside(path: Array, load: Array | None, part: Part, share: Array) -> Array:
    """Columns of motion, load and temperature."""
    columns = [path]
    if load is not None:
        columns.append(load[:, None])
    if part.temperature is not None:
        columns.append(part.temperatures(share)[:, None])
    return np.column_stack(columns)


@dataclass(frozen=True)
class Part:
    """`load`: from, to [Nm] and how often to and fro, 0 for standing at the first; or None.

    `temperature`: at the start and, after a warm-up, at the end [°C]; or None.
    """

    load: tuple[float, float, int] | None
    temperature: Range | None

    def loads(self, share: Array) -> Array:
        """Load (N,) over the share of the part that has gone."""
        assert self.load is not None
        low, high, times = self.load
        return np.asarray(low + 0.5 * (high - low) * (1.0 - np.cos(2 * np.pi * times * share)))

    def temperatures(self, share: Array) -> Array:
        """Temperature (N,) over the share of the part that has gone."""
        assert self.temperature is not None
        cold, warm = self.temperature
        return np.asarray(cold + (warm - cold) * np.expm1(-WARM * share) / np.expm1(-WARM))


@dataclass(frozen=True)
class Setting:
    """Parts of a run, each with the same motion."""

    parts: tuple[Part, ...]

    @property
    def words(self) -> str:
        loads = list(dict.fromkeys(p.load for p in self.parts if p.load))
        temperatures = list(dict.fromkeys(p.temperature for p in self.parts if p.temperature))
        said = [_load_words(loads), _temperature_words(temperatures)]
        return ", ".join(s for s in said if s)


def settings(bounds: Bounds) -> list[Setting]:
    """All settings worth trying, the one that visits most first."""
    made = [
        Setting(tuple(Part(a, b) for b, a in product(temperatures, loads)))
        for loads, temperatures in product(_loads(bounds), _temperatures(bounds))
        if len(loads) * len(temperatures) <= MOST_PARTS
    ]
    return list(dict.fromkeys(made))


def _loads(bounds: Bounds) -> list[list[tuple[float, float, int] | None]]:
    if bounds.load is None:
        return [[None]]
    low, high = bounds.load
    least = float(np.clip(0.0, low, high))
    levels = [sorted({low, high}), sorted({low, least, high}), [high], [least], [low],
              sorted({least, max(low, high, key=abs)})]  # fmt: skip
    made: list[list[tuple[float, float, int] | None]] = [[(v, v, 0) for v in row] for row in levels]
    period = np.pi * (high - low) / max(bounds.load_rate, 1e-12)
    often = int(min(bounds.duration / max(period, 1e-3), 1000.0))
    return made + [[(low, high, n)] for n in sorted({often, often // 4, 2}) if 0 < n <= often]


def _temperatures(bounds: Bounds) -> list[list[Range | None]]:
    if bounds.temperature is None:
        return [[None]]
    cold, warm = bounds.temperature
    if warm - cold < LEAST_KELVIN:
        middle = 0.5 * (cold + warm)
        return [[(middle, middle)]]
    made: list[list[Range | None]] = [[(cold, cold), (warm, warm)], [(warm, warm)], [(cold, cold)]]
    rise = min(bounds.warming * bounds.duration, warm - cold)
    return [*made, [(cold, cold + rise)]] if rise >= LEAST_KELVIN else made


def _load_words(loads: Sequence[tuple[float, float, int]]) -> str:
    if not loads:
        return ""
    low, high, times = loads[0]
    if times:
        return f"while the load goes {times} times from {short(low)} to {short(high)} Nm and back"
    if len(loads) == 1:
        return f"at a load of {short(low)} Nm"
    return joined(f"once at {short(load[0])} Nm" for load in loads)


def _temperature_words(temperatures: Sequence[Range]) -> str:
    if not temperatures:
        return ""
    cold, warm = temperatures[0]
    if warm > cold:
        return f"while the joint warms up from {short(cold)} to {short(warm)} °C"
    if len(temperatures) == 1:
        return f"at {short(cold)} °C"
    each = joined(f"once at {short(t[0])} °C" for t in temperatures)
    return f"{each}, each a run of its own"


@dataclass(frozen=True, eq=False)
class Motor:
    """The drive's equation, fitted to the motor torque of the recorded runs."""

    work: CandidateModel
    known_load: str | None

    def torque(self, log: Log) -> Array:
        """Motor torque (N,) [Nm] of a log that has motion and load."""
        from flexspline import _core

        log = _geared(log)
        design = _core.Design(
            [e.for_core() for e in self.work.effects], **gear_of(log.facts, "motor_position" in log)
        )
        channels = core_channels(log, self.work.effects, self.known_load)
        y = np.asarray(design.predict(channels, len(log), self.work.coefficients))
        load = log[self.known_load] if self.known_load is not None else 0.0
        return np.asarray((y + load) / float(log.effective_ratio or 1.0))


def motor_of(logs: Sequence[Log], known_load: str | None) -> Motor:
    """Fit the drive of logs with motor torque."""
    names: Sequence[str] = BASIC
    if known_load is not None:  # which holds gravity
        names = [*(name for name in BASIC if name != GRAVITY), *SCALING_WITH_LOAD]
    effects = [effect(name) for name in names]
    problem = problem_of(
        [channels_for(_geared(log), effects, known_load) for log in logs],
        effects,
        "motor_torque",
        known_load=known_load,
        lowpass_hz=None,
        threads=1,
    )
    plain = Whitening(np.ones(1), 1.0, 1)
    return Motor(
        started(problem, candidate_model_of(effects, len(effects), {}), plain)[0], known_load
    )


def _geared(log: Log) -> Log:
    """The log with a gear ratio: 1 where none is known, which the load's scale makes up for."""
    if "gear_ratio" in log.facts:
        return log
    return log.with_facts({"gear_ratio": 1.0})
