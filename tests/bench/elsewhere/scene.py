"""All runs of a joint on a fine grid: motion, load, temperature, and the torques that they make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.random import Generator
from scipy.ndimage import gaussian_filter1d

from elsewhere.joint import Deal, Joint
from elsewhere.motions import LOADS, MOTIONS, Span, heated, warming
from elsewhere.parts import TURNS, Array, low_passed

__all__ = ["Scene", "scene"]

NEED_LOAD = ("gain_error", "load_dependent_friction", "torque_constant_error",
             "sensor_nonlinearity", "torque_hysteresis")  # fmt: skip


@dataclass(frozen=True)
class Scene:
    """All runs of a joint on the fine grid, one after the other; arrays (N,) in SI units.

    `middle`: rad, of the motions on average. `edges`: first row of each run, and N. `motions`,
    `loading`: names of what was drawn. `motor`: torque of the motor at the output. `pair`: "circ"
    or "flex", the spline against which the wave generator makes ripple.
    """

    joint: Joint
    motions: tuple[str, ...]
    loading: str
    middle: float
    edges: tuple[int, ...]
    time: Array
    q: Array
    v: Array
    a: Array
    load: Array
    temperature: Array
    motor: Array = field(default_factory=lambda: np.empty(0))
    pair: str = ""

    @property
    def slices(self) -> list[slice]:
        """Rows of each run."""
        return [slice(*pair) for pair in zip(self.edges, self.edges[1:], strict=False)]

    def each(self, values: Array, made: Callable[[Array], Array]) -> Array:
        """What is made of the values of each run by itself."""
        return np.concatenate([made(values[rows]) for rows in self.slices])

    @cached_property
    def theta(self) -> Array:
        """Angle of the motor, rad; the gear gives way under the load."""
        own, ratio = self.joint, self.joint.ratio
        error = ratio * own.mesh_error * np.cos(2 * ratio * self.q)
        return np.asarray(ratio * self.q + ratio * self.load / own.stiffness + error)

    @cached_property
    def direction(self) -> Array:
        return TURNS[self.joint.turn](self.v, self.joint.width)

    @cached_property
    def gravity(self) -> Array:
        return np.asarray(self.joint.link * np.sin(self.q + self.joint.link_angle))

    @cached_property
    def carried(self) -> Array:
        """Torque that the gear transmits, Nm."""
        return np.asarray(self.load + self.joint.inertia * self.a + self.gravity)

    @cached_property
    def friction(self) -> tuple[Array, Array]:
        """Coulomb and viscous friction, Nm."""
        own = self.joint
        side = 1 + own.asymmetry * np.tanh(self.v / own.width)
        return own.coulomb * self.direction * side, own.viscous * self.v * side


def scene(deal: Deal, joint: Joint, rng: Generator) -> Scene:
    """Draw and move through all runs of a joint."""
    count = int(rng.integers(2, 4))
    odds = [0.3, 0.2, 0.15, 0.2, 0.15] if deal.lab else [0.4, 0.2, 0.1, 0.1, 0.2]
    motions = tuple(map(str, rng.choice(list(MOTIONS), size=count, replace=False, p=odds)))
    loading = _loading(deal, rng) if deal.lab else "none"
    ambient, middle = rng.uniform(19, 26), rng.uniform(-1, 1)
    span = Span(0.0, joint.step, middle, joint.reach, joint.speed, joint.acceleration)
    runs = []
    for run in range(joint.runs):
        seconds = rng.uniform(15, 40)
        q = _motion(motions[run % count], seconds, span, rng)
        load = LOADS[loading](rng, q, span, joint.load)
        start = ambient + (run * rng.uniform(2, 5) if joint.widely else rng.normal() * 0.3)
        time = np.arange(len(q), dtype=float) * joint.step
        temperature = warming(rng, time, start, joint.widely)
        if deal.hides("thermal_gradient_drift"):
            temperature = temperature + heated(rng, time, seconds, joint.step)
        v = np.gradient(q, joint.step)
        runs.append((time, q, v, np.gradient(v, joint.step), load, temperature))
    edges = tuple(int(row) for row in np.cumsum([0, *(len(run[0]) for run in runs)]))
    time, q, v, a, load, temperature = (np.concatenate(x) for x in zip(*runs, strict=True))
    return Scene(joint, motions, loading, middle, edges, time, q, v, a, load, temperature)


def _loading(deal: Deal, rng: Generator) -> str:
    kinds = ["motor", "brake", "spring", "motor+spring"]
    kind = str(rng.choice(kinds, p=[0.55, 0.2, 0.1, 0.15]))
    if kind == "brake" and deal.hides(*NEED_LOAD) and rng.random() < 0.7:
        return "motor"
    return kind


def _motion(name: str, seconds: float, span: Span, rng: Generator) -> Array:
    """The angle of one run, as a servo follows it: behind a low pass, and restless by 1e-5."""
    middle, speed = span.middle + rng.normal() * 0.2, span.speed * rng.uniform(0.7, 1)
    own = replace(span, seconds=seconds, middle=middle, speed=speed)
    q = low_passed(MOTIONS[name](rng, own), rng.uniform(10, 25), span.step)
    wide = 0.02 / span.step
    restless = gaussian_filter1d(rng.normal(size=len(q)), wide)
    return np.asarray(q + restless * np.sqrt(wide) * 1e-5 * span.reach)
