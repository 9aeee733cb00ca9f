"""Simulated runs of a compliant gear with known truth, for the tests of torsion."""

from __future__ import annotations

import numpy as np
from fit_logs import autoregressive, rows_of
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flexspline.effects import Effect, effect
from flexspline.logs.log import Log

RATIO = 101.0  # N + 1: the circular spline is the output
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}
LOAD = "reference_torque"
FLEX = "wave_generator_on_flexspline"
CIRCULAR = "wave_generator_on_circular_spline"

K_M0, C_M = 26431.0, 0.0487  # Table III, c2
K_W0, C_W = 21.9931, 3.125
WIDTH = 6.0  # Nm, of the widest element
LOOP = (0.8e-3, 0.5e-3, 0.3e-3, 0.2e-3)  # rad at the motor

Array = NDArray[np.float64]


def stiffness_run(seed: int, samples: int = 12_000, rate: float = 500.0) -> dict[str, Array]:
    """Channels of a run in which joint, load and motor torque come and go, each at its own pace."""
    generator = np.random.default_rng([seed, 23])
    time = np.arange(samples) / rate

    def swing(size: float, *frequencies: float) -> Array:
        each = [
            np.sin(2 * np.pi * f * time * generator.uniform(0.9, 1.1) + generator.uniform(0, 6.3))
            for f in frequencies
        ]
        return size * np.mean(each, axis=0)

    return {
        "time": time,
        "output_position": swing(6.0, 0.04, 0.07, 0.13),
        LOAD: swing(45.0, 0.13, 0.31, 0.57),
        "motor_torque": swing(0.7, 0.09, 0.21, 0.37),
    }


def log_of(channels: dict[str, Array], torsion: Array, name: str = "run") -> Log:
    """The log of a gear with this Δθ [rad]."""
    q = channels["output_position"]
    return Log.from_arrays(
        motor_position=RATIO * q - torsion, facts={"name": name, **FACTS}, **channels
    )


def noise(seed: int, samples: int) -> Array:
    """Coloured noise of 0.1 mrad."""
    return autoregressive(np.random.default_rng([seed, 29]), samples, 0.8, 6e-5)


def truth(orders: bool = True) -> tuple[list[Effect], Array]:
    """A gear with everything of Table III that is large, and hysteresis; and its coefficients."""
    effects = [
        effect("offset"),
        effect("mesh_compliance", mesh_shape=C_M),
        effect("wave_generator_compliance", wave_generator_shape=C_W),
        effect("torsional_hysteresis", load_width=WIDTH),
    ]
    values = [0.02, RATIO / K_M0, 1.0 / K_W0, *LOOP]
    if orders:
        pairs = [(2, "output_on_housing"), (2, FLEX), (2, CIRCULAR), (4, CIRCULAR)]
        effects.append(effect("kinematic_error", orders=pairs))
        values += [3.0e-3, 0.0, 0.0, 0.8e-3, 3.0e-3, 3.0e-3, -2.3e-3, 0.0]
    return effects, np.array(values)


def own_rows(seed: int, effects: list[Effect], values: Array, noisy: bool = True) -> Log:
    """A run from the core's own rows, and noise.

    The rows read the motor's angle, which the torsion moves: repeated until both agree.
    """
    channels = stiffness_run(seed)
    log = log_of(channels, np.zeros(len(channels["time"])))
    torsion = np.zeros(len(log))
    for _ in range(8):
        torsion = rows_of(effects, log, LOAD, values) @ values
        log = log_of(channels, torsion, f"run {seed}")
    return log_of(channels, torsion + noisy * noise(seed, len(log)), f"run {seed}")


def bouc_wen(load: Array, time: Array, width: float, exponent: float = 1.0) -> Array:
    """Hysteretic part in [-1, 1] of a path (N,), from its differential equation.

        z' = (u' − |u'| z |z|^(n−1) / 2 − u' |z|^n / 2) / width        [Bouc1967], [Wen1976]

    An oracle that shares nothing with the springs of the core.
    """
    rate = np.gradient(load, time)

    def slope(t: float, z: Array) -> Array:
        u = np.interp(t, time, rate)
        size = np.abs(z) ** exponent
        return np.asarray((u - 0.5 * abs(u) * np.sign(z) * size - 0.5 * u * size) / width)

    span = (time[0], time[-1])
    solved = solve_ivp(slope, span, [0.0], t_eval=time, rtol=1e-6, atol=1e-8, max_step=0.02)
    return np.asarray(solved.y[0])
