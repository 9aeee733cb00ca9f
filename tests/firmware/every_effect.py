"""Every effect of the catalogue in a model, and a run with every channel that they read."""

from __future__ import annotations

import numpy as np

from flexspline.effects import CATALOGUE, TARGETS, Effect, effect
from flexspline.logs.log import Log
from flexspline.model import PART_OF, Model, Part

LOAD = "reference_torque"


def motion(seed: int, rows: int = 6000) -> Log:
    """A run with all channels; several turns in both directions."""
    rng = np.random.default_rng(seed)
    time = np.arange(rows) * 1e-3
    rates, sizes = rng.uniform(0.2, 1.2, 4), rng.uniform(0.5, 1.5, 4)
    sines = [size * np.sin(rate * time + rate) for size, rate in zip(sizes, rates, strict=True)]
    cosines = [
        size * rate * np.cos(rate * time + rate) for size, rate in zip(sizes, rates, strict=True)
    ]
    curvature = [-(rate**2) * sine for rate, sine in zip(rates, sines, strict=True)]
    position = 4.0 * sum(sines) - 20.0
    return Log.from_arrays(
        time=time,
        output_position=position,
        output_velocity=4.0 * sum(cosines),
        output_acceleration=4.0 * sum(curvature),
        motor_position=101.0 * position + 0.01 * np.sin(position),
        temperature=30.0 + 8.0 * np.sin(0.5 * time + seed),
        reference_torque=20.0 * np.sin(1.7 * time) + rng.normal(size=rows),
        facts={"name": f"run{seed}"},
    )


def all_of(target: str) -> tuple[Effect, ...]:
    """Every effect of the catalogue that acts on a target; ripple with orders of all its pairs."""
    found = []
    for name, info in CATALOGUE.items():
        if TARGETS[target] in info.targets:
            orders = [(order, pair) for pair in info.pairs for order in (1, 2, 5)]
            found.append(effect(name, orders=orders))
    return tuple(found)


def rich(seed: int, rows: int = 6000) -> Log:
    """A run with every channel that an effect reads, and a gap."""
    log = motion(seed, rows)
    torque = 0.4 * np.sin(0.9 * log["time"])
    log = log.with_columns({"motor_torque": torque}, note="simulated")
    kept = np.ones(len(log), dtype=bool)
    kept[2000:2100] = False
    return log.rows(kept, note="a gap")


def exported(effects: tuple[Effect, ...], target: str) -> Model:
    """A model with coefficients of which each makes its row as large as one."""
    log = rich(5)
    facts = {"gear_ratio": 100.0, "output_spline": "circular"}
    terms = sum(len(e.terms) for e in effects)
    record = {"channels": ["motor_position"]}
    plain = Part(target, effects, np.ones(terms), LOAD, record)
    sizes = Model({PART_OF[target]: plain}, facts).components(log)
    values = [
        1.0 / float(np.abs(sizes[e.name]).max()) / (2 + k)
        for e in effects
        for k in range(len(e.terms))
    ]
    part = Part(target, effects, np.array(values), LOAD, record)
    return Model({PART_OF[target]: part}, facts)
