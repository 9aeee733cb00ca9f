"""Runs that hide one effect, made without the core, and what finding it means."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from fit_logs import WIDTH, autoregressive, motion
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import flexspline
from flexspline.effects import Effect, effect
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log

RATIO = 101.0  # N + 1: the circular spline is the output
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}
LOAD = "reference_torque"
RATE = 200.0
FINE = 10  # steps of an oscillator or a delay in one row
CLOSED = 0.9  # of the gap that the effect leaves, on rows that the fit has not seen
NOTHING = 0.01  # of the error on such rows; a gain below is none

SEEDS = (1, 2)
BASE = [
    "offset",
    effect("coulomb_friction", direction_width=WIDTH),
    "viscous_friction",
    "inertia",
]

Array = NDArray[np.float64]
Channels = dict[str, Array]
Truth = Callable[[Channels], Array]


def rich_run(seed: int, samples: int = 8000, speed: float = 2.0) -> Channels:
    """Channels of a joint that moves, is loaded and warms up, each at its own pace."""
    fine = motion(seed, samples * FINE, RATE * FINE, speed)
    channels = {name: values[::FINE].copy() for name, values in fine.items()}
    time, shift = channels["time"], np.random.default_rng([seed, 31]).uniform(0, 6.3, 5)
    channels[LOAD] = load_at(time, shift)
    channels["late_load"] = load_at(time - 0.03, shift)
    channels["motor_torque"] = 0.4 * np.sin(1.1 * time + shift[3]) + 0.2 * np.sin(4.3 * time)
    channels["temperature"] = 22.0 + 9.0 * (1 - np.exp(-time / 15.0)) + np.sin(0.4 * time)
    channels["fine_angle"] = fine["output_position"]
    return channels


def load_at(time: Array, shift: Array) -> Array:
    """A known torque of up to 10 Nm, (N,)."""
    return np.asarray(
        5.0 * np.sin(0.7 * time + shift[0])
        + 3.0 * np.sin(2.9 * time + shift[1])
        + 1.5 * np.sin(9.7 * time + shift[2])
    )


def log_of(channels: Channels, **more: Array) -> Log:
    """The log of the channels that a device would have."""
    kept = {k: v for k, v in channels.items() if k not in ("late_load", "fine_angle")}
    return Log.from_arrays(facts=FACTS, **{**kept, **more})


def friction_of(channels: Channels) -> Array:
    """Offset, Coulomb and viscous friction, inertia: what the models of these tests know."""
    v = channels["output_velocity"]
    inertial = 0.02 * channels["output_acceleration"]
    return np.asarray(-0.12 + 0.3 * np.tanh(v / WIDTH) + 0.15 * v + inertial)


def noise(seed: int, samples: int, size: float = 0.01) -> Array:
    return autoregressive(np.random.default_rng([seed, 37]), samples, 0.6, size)


def slipping(path: Array, level: float, width: float) -> Array:
    """An elastic-plastic element, row by row: level at the end of its width."""
    stretch, last, found = 0.0, path[0], []
    for value in path:
        stretch = min(max(stretch + value - last, -width), width)
        last = value
        found.append(level * stretch / width)
    return np.array(found)


def presliding(c: Channels) -> Array:
    """One element, where the core has four, less the level that coulomb_friction has."""
    return slipping(c["output_position"], 0.2, 0.03)


def by_temperature(c: Channels) -> Array:
    return np.asarray(0.15 * c["output_velocity"] * np.expm1(-0.04 * (c["temperature"] - 25)))


def by_position(c: Channels) -> Array:
    q = c["output_position"]
    return np.asarray(
        (0.08 * np.cos(q - 0.4) + 0.04 * np.sin(2 * q)) * np.tanh(c["output_velocity"] / WIDTH)
    )


def followed(time: Array, values: Array, lag: float) -> Array:
    """A first-order lag of values (N,), from its differential equation, at rest at the start."""
    solved = solve_ivp(
        lambda t, y: (np.interp(t, time, values) - y) / lag,
        (time[0], time[-1]),
        [values[0]],
        t_eval=time,
        rtol=1e-7,
        atol=1e-9,
        max_step=min(lag, 0.1),
    )
    return np.asarray(solved.y[0])


def fitted(effects: Sequence[str | Effect], logs: Sequence[Log], target: str) -> Fit:
    """A fit with the known load; the width of the friction, which is no question here, is held."""
    known = any("direction_width" in e.shapes for e in effects if isinstance(e, Effect))
    return flexspline.fit(
        effects,
        logs,
        target,
        known_load=LOAD,
        fixed={"direction_width": WIDTH} if known else {},
    )


def share_closed(base: Fit, made: Fit, floor: float) -> float:
    """How much of base's mean square beyond the noise a fit takes away, on held-out rows."""
    return (base.cv_rmse**2 - made.cv_rmse**2) / (base.cv_rmse**2 - floor**2)


def evidence(made: Fit, name: str) -> float:
    """b Σ⁻¹ b of an effect's coefficients over their number: 1 where they are noise."""
    names = made.part.record["covariance"]["names"]
    at = [k for k, n in enumerate(names) if n in {f"{name}.{t.name}" for t in _terms(made, name)}]
    value = {p.name: p.value for p in made.parameters}
    b = np.array([value[names[k]] for k in at])
    spread = made.uncertainty.covariance[np.ix_(at, at)]
    return float(b @ np.linalg.lstsq(spread, b, rcond=None)[0]) / len(at)


def _terms(made: Fit, name: str) -> tuple[flexspline.effects.TermInfo, ...]:
    (own,) = (e for e in made.part.effects if e.name == name)
    return own.terms


def torque_hiding(truth: Truth | None, seed: int, speed: float = 2.0) -> tuple[Channels, Array]:
    """Channels of a run, and its torque: load, friction, noise, and what is hidden in it [Nm]."""
    c = rich_run(seed, speed=speed)
    torque = c[LOAD] + friction_of(c) + noise(seed, len(c["time"]))
    return c, torque if truth is None else torque + truth(c)


def floor_of(a_noise: Callable[[int, int], Array] = noise, samples: int = 8000) -> float:
    """What the noise alone leaves, RMS."""
    return float(np.sqrt(np.mean([np.var(a_noise(seed, samples)) for seed in SEEDS])))


def closes_the_gap(base: Fit, made: Fit, name: str, floor: float) -> None:
    """With the effect that is hidden the error on held-out rows falls to the noise."""
    assert base.cv_rmse > 1.3 * floor
    assert share_closed(base, made, floor) >= CLOSED
    assert evidence(made, name) > 50.0


def gains_nothing(base: Fit, made: Fit, name: str) -> None:
    """With an effect that is not there the error on held-out rows stays."""
    assert made.cv_rmse > (1.0 - NOTHING) * base.cv_rmse
    # a mean of squares of 1 to 6 normal numbers; a shape that was searched takes the best of many
    assert evidence(made, name) < 16.0


def of_each_seed(make: Callable[[str, int], Log]) -> Callable[[str], tuple[Log, ...]]:
    """Return what makes a run of each seed that hides an effect by its name, once."""
    return cache(lambda name: tuple(make(name, seed) for seed in SEEDS))
