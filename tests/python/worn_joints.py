"""Histories of joints with known wear, for tests of `track`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexspline.tracking import History

NAMES = ("coulomb_friction.level", "load_dependent_friction.factor", "offset.offset")
UNITS = ("Nm", "1", "Nm")
LEVELS = (5.0, 0.1, 0.5)
NOISES = (0.1, 0.004, 0.05)
FIRST = np.datetime64("2026-01-05")


def step(onset: float, size: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return a step of a size in weeks."""
    return lambda weeks: size * (weeks >= onset)


def ramp(onset: float, per_year: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return what grows from a week on."""
    return lambda weeks: per_year * np.maximum(weeks - onset, 0.0) / 52.18


def worn_history(
    seed: int,
    sessions: int = 80,
    *,
    worn: dict[str, Callable[[np.ndarray], np.ndarray]] | None = None,
    per_kelvin: float = 0.03,
    temperature: np.ndarray | None = None,
    correlation: float = 0.0,
    names: tuple[str, ...] = NAMES,
    levels: tuple[float, ...] = LEVELS,
    noises: tuple[float, ...] = NOISES,
    units: tuple[str, ...] = UNITS,
    **more: object,
) -> History:
    """Return sessions a week apart; `worn`: of a parameter, in units of its noise.

    Half of the noise's variance is measured, the other half is of the sessions. `correlation`: of
    what is measured of the first two; it is all noise then. `per_kelvin`: in units of the noise,
    times 10.
    """
    rng = np.random.default_rng(seed)
    weeks, width = np.arange(sessions, dtype=float), len(names)
    warm = 22.0 + 5.0 * np.sin(2.0 * np.pi * weeks / 52.0) + rng.normal(0.0, 1.0, sessions)
    warm = warm if temperature is None else temperature
    shared = np.eye(width)
    if correlation:
        shared[0, 1] = shared[1, 0] = correlation
    measured = rng.multivariate_normal(np.zeros(width), shared, sessions)
    share = 0.999 if correlation else 0.5
    noise = np.sqrt(share) * measured + np.sqrt(1.0 - share) * rng.normal(size=(sessions, width))
    told = np.nan_to_num(warm, nan=22.0)
    noise += 10.0 * per_kelvin * (told[:, None] - 22.0)
    for name, course in (worn or {}).items():
        noise[:, names.index(name)] += course(weeks)
    values = np.array(levels) + np.array(noises) * noise
    covariance = share * shared * np.outer(noises, noises)
    dates = FIRST + (7 * weeks).astype("timedelta64[D]")
    return History(
        dates, names, units, values, np.repeat(covariance[None], sessions, 0), warm, **more
    )  # fmt: skip
