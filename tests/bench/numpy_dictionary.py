"""The dictionary of `discover` for a sensor, as one would write it in numpy: a column at a time.

Sines, tanh and powers of whole channels, scipy's lfilter for lags, and for springs that slip, whose
state has to go from row to row, a loop over the rows with all springs of all effects in one array.
It knows nothing of the core; `agrees` holds it against the core's rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline.effects import Effect
from flexspline.least_squares.ripple import CORE_PAIRS
from flexspline.logs.log import Log
from flexspline.orders import pairs

__all__ = ["agrees", "channels_of", "columns_of"]

Array = NDArray[np.float64]
Channels = Mapping[str, Array]
Law = Callable[[Effect, Channels], list[Array]]

SPRINGS = 4
CLOSE = 1e-6  # of a column's largest value


def columns_of(effects: Sequence[Effect], channels: Channels) -> Array:
    """Columns (N, C) of effects of which the load is known."""
    loops = _slipped([e for e in effects if e.name in PATHS], channels)
    made = [
        column
        for effect in effects
        for column in loops.get(effect) or LAWS[effect.name](effect, channels)
    ]
    return np.column_stack(made)


def agrees(mine: Array, core: Array) -> bool:
    """Whether columns (N, C) are those of the core."""
    return bool((np.abs(mine - core) <= CLOSE * np.abs(core).max(axis=0)).all())


def channels_of(log: Log, load: str) -> dict[str, Array]:
    """Channels of a log under short names."""
    names = {"q": "output_position", "v": "output_velocity", "a": "output_acceleration",
             "T": "temperature", "m": "motor_torque", "load": load, "time": "time"}  # fmt: skip
    made = {short: log[name] for short, name in names.items()}
    made["time"] = made["time"] - made["time"][0]
    for pair in pairs(log.facts):
        made[CORE_PAIRS[pair.name]] = pair.motor * log["motor_position"] + pair.output * made["q"]
    return made


def _direction(effect: Effect, c: Channels) -> Array:
    return np.tanh(c["v"] / effect.shapes["direction_width"])


def _warmer(effect: Effect, c: Channels) -> Array:
    return c["T"] - effect.shapes["reference_temperature"]


def _ripple(effect: Effect, c: Channels) -> list[Array]:
    return [wave(order * c[pair]) for order, pair in effect.harmonics for wave in (np.cos, np.sin)]


def _position(effect: Effect, c: Channels) -> list[Array]:
    d = _direction(effect, c)
    return [d * wave(k * c["q"]) for k in (1, 2, 3) for wave in (np.cos, np.sin)]


def _slope(values: Array, time: Array, lag: float) -> Array:
    """How fast values change, smoothed by a lag of first order; even steps."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    share = -np.expm1(-step / lag)
    rate = np.diff(values, prepend=values[0]) / step
    return np.asarray(lfilter([share], [1.0, share - 1.0], rate))


def _stribeck(effect: Effect, c: Channels) -> list[Array]:
    return [_direction(effect, c) * np.exp(-((c["v"] / effect.shapes["stribeck_velocity"]) ** 2))]


LAWS: Mapping[str, Law] = {
    "offset": lambda e, c: [np.ones_like(c["v"])],
    "coulomb_friction": lambda e, c: [_direction(e, c)],
    "viscous_friction": lambda e, c: [c["v"]],
    "nonlinear_viscous_friction": lambda e, c: [c["v"] * np.abs(c["v"]), c["v"] ** 3],
    "stribeck_friction": _stribeck,
    "load_dependent_friction": lambda e, c: [np.abs(c["load"]) * _direction(e, c)],
    "position_dependent_friction": _position,
    "temperature_dependent_friction": lambda e, c: [
        _warmer(e, c) * c["v"], _warmer(e, c) ** 2 * c["v"]],
    "gravity": lambda e, c: [np.sin(c["q"]), np.cos(c["q"])],
    "inertia": lambda e, c: [c["a"]],
    "gain_error": lambda e, c: [c["load"]],
    "gain_temperature_dependence": lambda e, c: [c["load"] * _warmer(e, c)],
    "sensor_nonlinearity": lambda e, c: [c["load"] ** 2, c["load"] ** 3],
    "motor_crosstalk": lambda e, c: [c["m"]],
    "temperature_drift": lambda e, c: [_warmer(e, c), _warmer(e, c) ** 2],
    "time_drift": lambda e, c: [c["time"], c["time"] ** 2],
    "output_ripple": _ripple,
    "wave_generator_ripple": _ripple,
    "sensor_lag": lambda e, c: [-_slope(c["load"], c["time"], e.shapes["smoothing_time"])],
    "thermal_gradient_drift": lambda e, c: [
        e.shapes["thermal_lag"] * _slope(c["T"], c["time"], e.shapes["thermal_lag"])],
}  # fmt: skip

PATHS = {"presliding_friction": ("q", "presliding_width", 1.0),
         "torque_hysteresis": ("load", "load_width", -1.0)}  # fmt: skip
"""Path of the springs, the shape that is their width, and their sign."""


def _slipped(effects: Sequence[Effect], c: Channels) -> dict[Effect, list[Array]]:
    """Shares z/w of springs that slip at their widths, z ← clip(z + Δu, −w, w)."""
    if not effects:
        return {}
    halves = 0.5 ** np.arange(SPRINGS)
    widths = np.concatenate([e.shapes[PATHS[e.name][1]] * halves for e in effects])
    moved = np.repeat([np.diff(c[PATHS[e.name][0]], prepend=c[PATHS[e.name][0]][0])
                       for e in effects], SPRINGS, axis=0).T  # fmt: skip
    shares, now = np.ascontiguousarray(moved), np.zeros(len(widths))
    for row in shares:
        now += row
        np.clip(now, -widths, widths, out=now)
        row[:] = now
    shares /= widths
    return {
        effect: list(PATHS[effect.name][2] * shares[:, SPRINGS * k : SPRINGS * (k + 1)].T)
        for k, effect in enumerate(effects)
    }
