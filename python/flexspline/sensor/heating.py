"""What warming up does to the reading: with the bridge alone, with software alone, with both."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.formatting import short
from flexspline.sensor.bridge import Bridge

__all__ = ["METHODS", "Heating", "HeatingDrift", "heating_drift"]

Array = NDArray[np.float64]

ROWS = 361
METHODS = ("neither", "bridge alone", "software alone", "both")


@dataclass(frozen=True)
class Heating:
    """How a joint warms its sensor; 20 to 45 °C in steps of 5 is §4.2, the rest is assumed.

    Parameters
    ----------
    low, high : °C before and after.
    step : K between the settled, even temperatures at which the software is calibrated.
    degree : of its polynomial, (9): 2.
    time_constant, duration : of the warming and of the run, s.
    across : K between the two gauges of a pair at the end of the run, the compressed one warmer.
    around : K by which the spoke at 0° is warmer than the mean at the end, as a cosine.
    thermistor_lag : s by which the one thermistor follows the body.
    linear, quadratic : apparent strain of the gauges' lot, 1/K and 1/K².
    spread : standard deviation of the linear part between gauges of a lot, 1/K; the default
        makes the drift of Fig. 17, a few tenths of a Nm.
    lots : how many bridges are built of gauges with that spread.
    seed : of the spread.
    """

    low: float = 20.0
    high: float = 45.0
    step: float = 5.0
    degree: int = 2
    time_constant: float = 600.0
    duration: float = 3600.0
    across: float = 1.0
    around: float = 1.0
    thermistor_lag: float = 20.0
    linear: float = 2e-6
    quadratic: float = 1e-8
    spread: float = 0.5e-6
    lots: int = 100
    seed: int = 1

    def __post_init__(self) -> None:
        steps = (self.high - self.low) / self.step if self.step > 0.0 else math.nan
        if not steps >= self.degree:
            raise InputError(
                f"heating: {self.low:g} to {self.high:g} °C in steps of {self.step:g} K gives "
                f"fewer than {self.degree + 1} temperatures for degree {self.degree}; give smaller "
                "steps"
            )
        lag = self.thermistor_lag
        if not all(math.isfinite(value) for value in vars(self).values()) or self.degree < 0:
            raise InputError("heating: give finite numbers, and a degree of 0 or more")
        if self.lots < 1:
            raise InputError(f"heating: {self.lots} lots of gauges; give at least one")
        if not (self.time_constant > 0.0 and self.duration > 0.0 and lag >= 0.0):
            raise InputError(
                "heating: time constant and duration must be above zero, the lag not below"
            )


@dataclass(frozen=True, eq=False)
class HeatingDrift:
    """Readings of unloaded sensors that warm up, less their first values [Nm].

    `time` [s] and `temperature` [°C] of the body: (N,). `even`, `uneven`: curves (lots, N) by
    the names of `METHODS`.
    """

    time: Array
    temperature: Array
    even: Mapping[str, Array]
    uneven: Mapping[str, Array]

    def largest(self, method: str, *, uneven: bool = True, share: float = 0.5) -> float:
        """Return the largest drift of a run [Nm] that this share of bridges stays within.

        `method`: "bridge alone", "software alone", "both" or "neither".
        """
        curves = (self.uneven if uneven else self.even)[method]
        return float(np.quantile(np.abs(curves).max(axis=1), share))

    @property
    def bridge_alone(self) -> float:
        """Nm, median of the bridges, heated unevenly: no polynomial."""
        return self.largest("bridge alone")

    @property
    def software_alone(self) -> float:
        """Nm, likewise: one gauge with fixed resistors, and the polynomial."""
        return self.largest("software alone")

    @property
    def both(self) -> float:
        """Nm, likewise: the bridge and the polynomial."""
        return self.largest("both")

    def __str__(self) -> str:
        lines = [
            "Largest drift [Nm]: half of the bridges stay within (95 % of them)",
            f"{'':<14}  {'heated evenly':>16}  {'unevenly':>16}",
        ]
        for method in METHODS:
            cells = []
            for uneven in (False, True):
                half, most = (self.largest(method, uneven=uneven, share=s) for s in (0.5, 0.95))
                cells.append(f"{short(half)} ({short(most)})")
            lines.append(f"{method:<14}  {cells[0]:>16}  {cells[1]:>16}")
        return "\n".join(lines)


def heating_drift(bridge: Bridge, heating: Heating | None = None) -> HeatingDrift:
    """Return the drift with the bridge alone, with software alone and with both.

    The software is a polynomial in one thermistor's temperature, calibrated at settled, even
    temperatures (8)–(11). "Software alone" reads one gauge in a bridge of fixed resistors. The
    bridge cancels what its gauges have in common; what differs between them, by their lot or by
    where the heat is, it does not (§1, §2.3, §2.4).

    Parameters
    ----------
    bridge : its gauges' thermal strain, where they have none that of `heating`.
    heating : the run; by default §4.2's range with 1 K of unevenness.
    """
    run = heating or Heating()
    time = np.linspace(0.0, run.duration, ROWS)
    risen = -np.expm1(-time / run.time_constant)
    body = run.low + (run.high - run.low) * risen
    thermistor = run.low + (run.high - run.low) * _lagged(time, run)
    built = _lots(bridge.with_waves(), run)
    found = []
    for across, around in ((0.0, 0.0), (run.across, run.around)):
        each = _each(bridge, body, risen, across, around)
        curves = np.array([_curves(one, run, each, thermistor) for one in built])
        found.append({name: curves[:, k] for k, name in enumerate(METHODS)})
    return HeatingDrift(time, body, *found)


def _lots(bridge: Bridge, run: Heating) -> list[Bridge]:
    """The bridge as it is where its gauges have a thermal strain, else one of each lot."""
    if any(g.thermal_linear or g.thermal_quadratic for g in bridge.gauges):
        return [bridge]
    spread = np.random.default_rng(run.seed).normal(size=(run.lots, len(bridge.gauges)))
    return [bridge.with_thermal(run.linear + run.spread * lot, run.quadratic) for lot in spread]


def _lagged(time: Array, run: Heating) -> Array:
    """The share that a first-order lag has risen by behind 1 − e^{−t/τ}."""
    slow, lag = run.time_constant, run.thermistor_lag
    if math.isclose(slow, lag):
        return np.asarray(1.0 - (1.0 + time / slow) * np.exp(-time / slow))
    fast = lag * np.exp(-time / lag) if lag else 0.0
    return np.asarray(1.0 - (slow * np.exp(-time / slow) - fast) / (slow - lag))


def _each(bridge: Bridge, body: Array, risen: Array, across: float, around: float) -> Array:
    """Temperature of each gauge, (N, n)."""
    signs = np.array([gauge.sign for gauge in bridge.gauges])
    return body[:, None] + risen[:, None] * (around * np.cos(bridge.angles) - 0.5 * across * signs)


def _readings(bridge: Bridge, temperature: Array) -> tuple[Array, Array]:
    """What the bridge, and its first gauge in a bridge of fixed resistors, read [Nm]."""
    strains = bridge.strains(0.0, 0.0, temperature)
    one = bridge.gauges[0].sign * strains[:, 0] / bridge.strain_per_torque
    return bridge.reading(0.0, 0.0, temperature), one


def _curves(bridge: Bridge, run: Heating, each: Array, thermistor: Array) -> Array:
    """Drift of one bridge, (methods, N)."""
    settled = np.arange(run.low, run.high + 1e-9, run.step)
    calibrated = _readings(bridge, np.repeat(settled[:, None], len(bridge.gauges), axis=1))
    full, one = _readings(bridge, each)
    laws = [Polynomial.fit(settled, values, run.degree) for values in calibrated]
    curves = np.array([one, full, one - laws[1](thermistor), full - laws[0](thermistor)])
    return np.asarray(curves - curves[:, :1])
