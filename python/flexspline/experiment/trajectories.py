"""Trajectories that labs record, each kind a map from numbers in [0, 1] to a path within limits.

    strokes       to and fro at three constant speeds
    sines         a sum of three sines
    small cycles  slow reversals over a small angle, a smaller one in between, at several places
    holds         rests at several places, each reached from both sides
    rest          at one place

Every path starts and ends at rest at the same angle, so that it can be repeated at another load or
temperature. A path of pulses is made of consecutive accelerations a(s) = A sin²(π s / T):

    v(s) = A (s/2 − T/4π sin 2πs/T),     q(s) = A (s²/4 + T²/8π² (cos 2πs/T − 1))

so that a pulse changes the speed by A T / 2, and the jerk is bounded. A = 0 is a rest or a
stretch at constant speed. A path of sines is a sum of them in a window that rises as
6x⁵ − 15x⁴ + 10x³ at both ends. Both are twice continuously differentiable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from flexspline.experiment.plan import Bounds, joined, over, short

__all__ = ["Drawn", "Kind", "Path", "Sines", "kinds_for", "moved", "reach", "reached", "smoothstep"]

Array = NDArray[np.float64]

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


@dataclass(frozen=True)
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
    words = f"rests at {count} places {over(low, low + far)}, each reached from both sides"
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


@dataclass(frozen=True)
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
        up, down = smoothstep(time / self.edge), smoothstep((self.duration - time) / self.edge)
        w = up[:, 0] * down[:, 0]
        dw = (up[:, 1] * down[:, 0] - up[:, 0] * down[:, 1]) / self.edge
        ddw = up[:, 2] * down[:, 0] - 2.0 * up[:, 1] * down[:, 1] + up[:, 0] * down[:, 2]
        ddw = ddw / self.edge**2
        q = self.centre + w * s
        return np.column_stack([q, w * ds + dw * s, w * dds + 2.0 * dw * ds + ddw * s])


def smoothstep(x: Array) -> Array:
    """6x⁵ − 15x⁴ + 10x³ with its two derivatives, (N, 3); 0 below 0 and 1 above 1."""
    x = np.clip(x, 0.0, 1.0)
    return np.column_stack(
        [
            x**3 * (10.0 + x * (6.0 * x - 15.0)),
            30.0 * x**2 * (1.0 - x) ** 2,
            60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
        ]
    )
