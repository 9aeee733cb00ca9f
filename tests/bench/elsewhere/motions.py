"""What happens to a joint in one run: its motion, the load at its output, and its temperature."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from elsewhere.parts import Array, dahl, lagged, levels

__all__ = ["LOADS", "MOTIONS", "Span", "heated", "warming"]


@dataclass(frozen=True)
class Span:
    """Bounds of a motion: `seconds` in rows of `step` s, `middle` ± `reach` rad, rad/s, rad/s²."""

    seconds: float
    step: float
    middle: float
    reach: float
    speed: float
    acceleration: float

    @property
    def rows(self) -> int:
        return int(self.seconds / self.step)

    @property
    def time(self) -> Array:
        return np.arange(self.rows, dtype=float) * self.step


def _trapezoid(here: float, there: float, speed: float, acceleration: float, step: float) -> Array:
    """A move whose speed rises, stays and falls."""
    way = abs(there - here)
    top = min(speed, np.sqrt(way * acceleration))
    rise = top / acceleration
    cruise = max(0.0, (way - top * rise) / top) if top > 0 else 0.0
    end = 2 * rise + cruise
    t = np.arange(0, end, step)
    gone = np.where(
        t < rise,
        0.5 * acceleration * t**2,
        np.where(
            t < rise + cruise,
            0.5 * top * rise + top * (t - rise),
            way - 0.5 * acceleration * np.maximum(end - t, 0) ** 2,
        ),
    )
    return np.asarray(here + np.sign(there - here) * gone)


def _joined(legs: Iterator[list[Array]], span: Span) -> Array:
    """Legs one after the other until the time is over."""
    parts: list[Array] = []
    rows = 0
    while rows * span.step < span.seconds:
        leg = next(legs)
        parts += leg
        rows += sum(map(len, leg))
    return np.concatenate(parts)[: span.rows]


def _rest(seconds: float, angle: float, step: float) -> Array:
    return np.full(int(seconds / step), angle)


def _point_to_point(rng: Generator, span: Span) -> Iterator[list[Array]]:
    """Moves between random angles at four speeds, with rests."""
    here = span.middle + span.reach * rng.uniform(-1, 1)
    yield [_rest(rng.uniform(0.3, 0.8), here, span.step)]
    speeds = span.speed * np.array([1, 0.6, 0.3, 0.12])
    while True:
        there = span.middle + span.reach * rng.uniform(-1, 1)
        speed, acceleration = rng.choice(speeds), span.acceleration * rng.choice([1, 0.5])
        move = _trapezoid(here, there, speed, acceleration, span.step)
        yield [move, _rest(rng.choice([0.1, 0.3, 0.8]), there, span.step)]
        here = there


def _triangles(rng: Generator, span: Span) -> Iterator[list[Array]]:
    """To and fro about the middle at constant speeds, from slow to half the top speed."""
    here = span.middle
    for share in itertools.cycle(rng.permutation([0.02, 0.05, 0.1, 0.25, 0.5])):
        speed = span.speed * share
        size = min(span.reach, speed * rng.uniform(1.5, 3.0))
        goals = (span.middle + size, span.middle - size, span.middle)
        yield [
            _trapezoid(start, goal, speed, span.acceleration, span.step)
            for start, goal in zip((here, *goals), goals, strict=False)
        ]


def _jogs(rng: Generator, span: Span) -> Iterator[list[Array]]:
    """Moves of three lengths either way, with long rests."""
    here = span.middle
    while True:
        way = rng.choice([-1, 1]) * span.reach * rng.choice([0.05, 0.2, 0.5])
        there = here - way if abs(here + way - span.middle) > span.reach else here + way
        speed = span.speed * rng.choice([0.1, 0.25, 0.5, 0.8])
        move = _trapezoid(here, there, speed, span.acceleration, span.step)
        yield [move, _rest(rng.uniform(0.4, 1.5), there, span.step)]
        here = there


def _multisine(rng: Generator, span: Span) -> Array:
    """Six sines below 1.6 Hz, scaled to the bounds."""
    t, step = span.time, span.step
    hertz = rng.choice(np.arange(1, 16), 6, replace=False) * 0.1
    sizes = 1 / (hertz / 0.1) ** rng.uniform(0.6, 1.1)
    waves = [size * np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi))
             for size, f in zip(sizes, hertz, strict=True)]  # fmt: skip
    q = np.asarray(sum(waves))
    v = np.gradient(q, step)
    highest = [abs(x).max() for x in (q, v, np.gradient(v, step))]
    q /= max(highest[0] / span.reach, highest[1] / span.speed, highest[2] / span.acceleration / 2)
    return np.asarray(span.middle + (q - q[0]))


def _chirp(rng: Generator, span: Span) -> Array:
    """A sine whose frequency rises exponentially, as large as the bounds allow at each."""
    low, high = 0.05, rng.uniform(0.8, 2)
    hertz = low * (high / low) ** (span.time / span.seconds)
    omega = 2 * np.pi * hertz
    size = np.minimum(np.minimum(span.reach, span.speed / omega), span.acceleration / omega**2)
    phase = 2 * np.pi * np.cumsum(hertz) * span.step
    return np.asarray(span.middle + size * np.sin(phase))


Motion = Callable[[Generator, Span], Array]

MOTIONS: Mapping[str, Motion] = {
    "ptp": lambda rng, span: _joined(_point_to_point(rng, span), span),
    "multisine": _multisine,
    "chirp": _chirp,
    "triangles": lambda rng, span: _joined(_triangles(rng, span), span),
    "jogs": lambda rng, span: _joined(_jogs(rng, span), span),
}
"""Angles, rad, on the fine grid."""


def _steps(rng: Generator, time: Array, step: float) -> Array:
    held = levels(rng, -1, 1, len(time), step, 1.5)
    return lagged(lagged(held, 0.06, step), 0.06, step)


def _sines(rng: Generator, time: Array, step: float) -> Array:
    hertz, phases = rng.uniform([0.05, 0.15, 0.5], [0.15, 0.5, 1.2]), rng.uniform(0, 6.28, 3)
    waves = [size * np.sin(2 * np.pi * f * time + phase)
             for size, f, phase in zip((0.6, 0.3, 0.2), hertz, phases, strict=True)]  # fmt: skip
    return np.asarray(sum(waves))


def _ramps(rng: Generator, time: Array, step: float) -> Array:
    period = rng.uniform(4, 9)
    ramps = 2 * np.abs(2 * ((time / period + rng.uniform()) % 1) - 1) - 1
    return lagged(ramps * levels(rng, 0.4, 1, len(time), step, period), 0.08, step)


COURSES: Mapping[str, Callable[[Generator, Array, float], Array]] = {
    "steps": _steps,
    "sines": _sines,
    "ramps": _ramps,
}


def _second_motor(rng: Generator, q: Array, span: Span, largest: float) -> Array:
    """A torque-controlled motor at the output, whose torque has nothing to do with the motion."""
    course = COURSES[rng.choice(list(COURSES))](
        rng, np.arange(len(q), dtype=float) * span.step, span.step
    )
    return np.asarray(largest * course / np.abs(course).max())


def _brake(rng: Generator, q: Array, span: Span, largest: float) -> Array:
    """A hysteresis brake at changing levels, which turns elastically before it drags."""
    held = lagged(levels(rng, 0, 1, len(q), span.step, 3), 0.1, span.step)
    return np.asarray(largest * held * dahl(q, 0.01, 1, 0.0))


def _spring(rng: Generator, q: Array, span: Span, largest: float) -> Array:
    return np.asarray(largest * np.sin(0.9 * (q - span.middle) / span.reach) / 0.8)


def _motor_and_spring(rng: Generator, q: Array, span: Span, largest: float) -> Array:
    motor = _second_motor(rng, q, span, largest)
    return np.asarray(0.6 * motor + 0.4 * largest * (q - span.middle) / span.reach)


Load = Callable[[Generator, Array, Span, float], Array]

LOADS: Mapping[str, Load] = {
    "none": lambda rng, q, span, largest: np.zeros(len(q)),
    "motor": _second_motor,
    "brake": _brake,
    "spring": _spring,
    "motor+spring": _motor_and_spring,
}
"""Torque at the output, Nm, by the angle, the bounds of the rig and the largest torque."""


def warming(rng: Generator, time: Array, start: float, widely: bool) -> Array:
    """Temperature, °C, that rises exponentially or, seldom, falls."""
    rise = rng.uniform(2, 8) if widely else rng.uniform(0.1, 0.5)
    constant = rng.uniform(15, 60)
    course = rise * (1 - np.exp(-time / constant))
    return np.asarray(start + course * (1 if rng.random() < 0.8 else -0.6))


def heated(rng: Generator, time: Array, seconds: float, step: float) -> Array:
    """Rise of temperature, K, by a heat gun that is on for a third of the run."""
    on = (time > 0.2 * seconds) & (time < 0.55 * seconds)
    return lagged(np.where(on, rng.uniform(4, 9), 0.0), 6.0, step)
