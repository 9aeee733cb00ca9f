"""The torque sensor of the first paper's rig, as bonded: what it makes of torque, angle and heat.

Printed and kept: (25), 62.738 Nm/V; (24), the voltage without load over an even temperature;
non-linearity 0.878 %FS and hysteresis 0.903 %FS of 70 Nm; gain 200, RC, 16 bits. (24) and (25)
agree at no load to 0.1 mV, so the deviation from the line vanishes there whatever its shape.

Drawn, each range chosen once, before any claim was computed:

- Strain of the wave generator: 0.5–2 times the 0.5 % and 1 % of full scale that
  `flexspline.sensor` assumes at orders 1 and 2; order 4 is 1–5 % of order 2 (an ellipse with an
  axis 0.3 mm longer on a radius of 25 mm has 1 %, elastic bearings give more); stretching is
  0.5–1.5 of bending.
- Bonding under a microscope: angle within 0.5° (0.25 mm on 30 mm), tilt within 1°, gauge factor
  within 0.5 % (one lot), strain of a spoke within 2 % (0.05 mm of a width of 5 mm, twice).
- Thermal strain: 2e-6/K in common, 0.5e-6/K between gauges of a lot, as in `flexspline.sensor`;
  moved a little so that even heating gives (24) exactly.
- Uneven heating: a spoke's flanks part by 3–15 s times the rate of warming and wander by
  0.02–0.1 K over 100–300 s (air about the joint); one side of the joint is up to 4 % warmer than
  the other above the room. The thermistor lags by 5–30 s; its resistance and B are within 1 %.
- Electronics: 15–40 µV of the converter's noise at 100 Hz (assumed; the AD7790's data sheet has
  1.1 µV at 9.5 Hz and goes to 120 Hz), 10–60 µV over 5–20 ms from the drive. Two conversions of
  10 ms make one reading (assumed; a digital filter needs more than one).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline import _core
from flexspline.logs.segments import play
from flexspline.sensor import Bridge, Electronics, WaveStrain, cancelling_bridge, common_bridge
from flexspline.simulation import Noise

__all__ = [
    "DRIFT",
    "FULL_SCALE",
    "HYSTERESIS",
    "NON_LINEARITY",
    "SENSITIVITY",
    "THERMISTOR",
    "Deviation",
    "UnevenHeat",
    "ZhangSensor",
    "drift_voltage",
    "zhang_sensor",
]

Array = NDArray[np.float64]

SENSITIVITY = 62.738  # Nm/V, (25)
FULL_SCALE = 70.0  # Nm
DRIFT = (-21.39e-3, -0.8704e-3, 0.0102e-3)  # V, V/K, V/K², (24)
NON_LINEARITY, HYSTERESIS = 0.00878 * FULL_SCALE, 0.00903 * FULL_SCALE  # Nm
LEVELS = np.linspace(0.0, 1.0, 15)  # of full scale, §4.3
SLIPS = np.array([0.03, 0.08, 0.16]) * FULL_SCALE  # Nm
THERMISTOR = {
    "supply_voltage": 3.3,
    "divider_resistance": 10e3,
    "nominal_resistance": 10e3,
    "beta": 3950.0,
    "nominal_temperature": 25.0,
}
CONVERTER_STEP = 3.3 / 4096  # V, of the microcontroller that reads the thermistor


def drift_voltage(temperature: Array | float) -> Array:
    """Return (24), V at no load, of an even temperature [°C]."""
    return np.asarray(np.polynomial.polynomial.polyval(np.asarray(temperature, float), DRIFT))


@dataclass(frozen=True, eq=False)
class Deviation:
    """What the body adds to a torque beside a straight line [Nm].

    On a rising leg from 0 to 70 Nm: a sum of sines less its least-squares line, at most 0.878 %FS
    and nothing at no load. Falling, 0.903 %FS more in the middle: elements with play.

    Parameters
    ----------
    sines : amplitudes of sin(kπτ/70), k = 1 …, Nm.
    line : Nm at no load and at full scale, taken off them.
    shares : of the elements, by `SLIPS`; they add up to one.
    """

    sines: Array
    line: tuple[float, float]
    shares: Array

    def rising(self, torque: Array) -> Array:
        """Return the deviation on a rising leg, Nm, of torques (N,)."""
        x = np.clip(torque / FULL_SCALE, 0.0, 1.0)
        waves = np.sin(np.pi * np.outer(x, np.arange(1, len(self.sines) + 1)))
        return waves @ self.sines - self.line[0] - (self.line[1] - self.line[0]) * x

    def of(self, torque: Array) -> Array:
        """Return the deviation along a run of torques (N,), after a full cycle before it."""
        size = HYSTERESIS / (2.0 * float(self.shares @ SLIPS))
        before = np.concatenate([[0.0, FULL_SCALE, 0.0], np.maximum(torque, 0.0)])
        added = self.rising(torque)
        for share, slip in zip(self.shares, SLIPS, strict=True):
            up = np.maximum(slip, before[3:] - slip)
            added = added + size * share * (play(before, slip)[3:] - up)
        return added


@dataclass(frozen=True)
class UnevenHeat:
    """How the gauges' temperatures part; see the module docstring.

    Parameters
    ----------
    flanks : s, kelvins between the flanks of a spoke per K/s of warming.
    wander, memory : K, s, of the same.
    around : K per K above 20 °C, and `warm_side` where it is warmest, rad.
    """

    flanks: float
    wander: float
    memory: float
    around: float
    warm_side: float

    def gauges(self, bridge: Bridge, time: Array, body: Array, rng: np.random.Generator) -> Array:
        """Return the temperature of each gauge, (N, n), of the body's, (N,), °C."""
        signs = np.array([gauge.sign for gauge in bridge.gauges])
        wander = Noise(self.wander, self.memory).draw(len(time), float(time[1] - time[0]), rng)
        across = self.flanks * np.gradient(body, time) + wander
        side = self.around * (body - 20.0)
        return np.asarray(
            body[:, None]
            + side[:, None] * np.cos(bridge.angles - self.warm_side)
            - 0.5 * across[:, None] * signs
        )


@dataclass(frozen=True)
class ZhangSensor:
    """Both sensors of §4.1 with their circuit and thermistor.

    Parameters
    ----------
    common, cancelling : as bonded (Fig. 13, Fig. 8).
    electronics : the circuit; its offset is that of (24).
    heat : how gauges warm.
    deviation : from the line under load.
    drive_noise : V at the converter, from the drive, coloured.
    thermistor_lag : s. thermistor_errors : of resistance and B, shares.
    """

    common: Bridge
    cancelling: Bridge
    electronics: Electronics
    heat: UnevenHeat
    deviation: Deviation
    drive_noise: Noise
    thermistor_lag: float
    thermistor_errors: tuple[float, float]

    def read(
        self,
        bridge: Bridge,
        time: Array,
        voltage: Array,
        every: int,
        rng: np.random.Generator,
    ) -> Array:
        """Return what the converter reads [V] in every so many rows of a bridge's voltage (N,).

        Two conversions of `every` rows each make a reading; 1 is no averaging at all. The RC low
        pass, 1 ms, settles within a conversion.
        """
        mean = np.full(every, 1.0 / every)
        passed = lfilter(mean, 1.0, lfilter(mean, 1.0, voltage - voltage[0])) + voltage[0]
        at = time[::every]
        noise = self.drive_noise.draw(len(at), float(at[1] - at[0]), rng)
        seen = passed[::every] + noise / self.electronics.gain
        read, _ = self.electronics.read(
            at, seen, bridge_resistance=bridge.output_resistance, seed=int(rng.integers(2**32))
        )
        return read

    def thermistor(self, time: Array, body: Array, rng: np.random.Generator) -> Array:
        """Return the divider's voltage [V], (N,), by (6), (7), at body temperatures [°C]."""
        keep = float(np.exp(-(time[1] - time[0]) / self.thermistor_lag))
        late = lfilter([1.0 - keep], [1.0, -keep], body - body[0]) + body[0]
        real = dict(THERMISTOR)
        for name, error in zip(("nominal_resistance", "beta"), self.thermistor_errors, strict=True):
            real[name] *= 1.0 + error
        volts = np.asarray(_core.thermistor_voltage(late, **real))
        volts = volts + rng.normal(0.0, CONVERTER_STEP, len(volts))
        return np.asarray(CONVERTER_STEP * np.round(volts / CONVERTER_STEP))


def zhang_sensor(rng: np.random.Generator) -> ZhangSensor:
    """Return a sensor; `rng` draws what the paper does not print (see the module docstring)."""
    waves = _waves(rng)
    cancelling = _drifting(_bonded(cancelling_bridge(8, waves=waves), rng), rng)
    return ZhangSensor(
        _bonded(common_bridge(waves=waves), rng),
        cancelling,
        Electronics(
            converter_noise=rng.uniform(15e-6, 40e-6),
            offset=float(drift_voltage(cancelling.reference_temperature)),
        ),
        UnevenHeat(
            rng.uniform(3.0, 15.0),
            rng.uniform(0.02, 0.1),
            rng.uniform(100.0, 300.0),
            rng.uniform(0.0, 0.04),
            rng.uniform(-np.pi, np.pi),
        ),
        _deviation(rng),
        Noise(rng.uniform(10e-6, 60e-6), rng.uniform(0.005, 0.02)),
        rng.uniform(5.0, 30.0),
        (rng.uniform(-0.01, 0.01), rng.uniform(-0.01, 0.01)),
    )


def _waves(rng: np.random.Generator) -> tuple[WaveStrain, ...]:
    once, twice = 4e-6 * rng.uniform(0.5, 2.0), 8e-6 * rng.uniform(0.5, 2.0)
    sizes = {1: once, 2: twice, 4: twice * rng.uniform(0.01, 0.05)}
    return tuple(
        WaveStrain(
            order,
            size,
            rng.uniform(-np.pi, np.pi),
            size * rng.uniform(0.5, 1.5),
            rng.uniform(-np.pi, np.pi),
        )
        for order, size in sizes.items()
    )


def _bonded(bridge: Bridge, rng: np.random.Generator) -> Bridge:
    """The bridge with errors of bonding and of its spokes; it reads (25) all the same."""
    count = len(bridge.gauges)
    spokes = rng.uniform(-0.02, 0.02, 4)[np.round(bridge.angles / (np.pi / 2)).astype(int) % 4]
    bonded = bridge.with_errors(
        angle=np.radians(rng.uniform(-0.5, 0.5, count)),
        tilt=np.radians(rng.uniform(-1.0, 1.0, count)),
        factor=rng.uniform(-0.005, 0.005, count) + spokes,
    )
    return replace(bonded, strain_per_torque=bridge.strain_per_torque / bonded.torque_gain)


def _drifting(bridge: Bridge, rng: np.random.Generator) -> Bridge:
    """The bridge with gauges of one lot whose differences, heated evenly, are (24)."""
    arms = np.array([float(gauge.arm or 0) for gauge in bridge.gauges])
    linear = 2e-6 + rng.normal(0.0, 0.5e-6, len(arms))
    quadratic = np.full(len(arms), 1e-8)
    still = bridge.with_waves()
    gain, at = Electronics().gain, bridge.reference_temperature
    slope = (DRIFT[1] + 2.0 * DRIFT[2] * at) / gain

    def volts(linear: Array, quadratic: Array) -> tuple[float, float]:
        """Per K and per K² above the reference temperature."""
        hot = still.with_thermal(linear, quadratic).voltage(0.0, 0.0, np.array([at - 1, at + 1]))
        return 0.5 * float(hot[1] - hot[0]), 0.5 * float(hot[1] + hot[0])

    one = volts(1e-6 * arms, 1e-8 * arms)
    now = volts(linear, quadratic)
    linear = linear + 1e-6 * arms * (slope - now[0]) / one[0]
    quadratic = quadratic + 1e-8 * arms * (DRIFT[2] / gain - now[1]) / one[1]
    return bridge.with_thermal(linear, quadratic)


def _deviation(rng: np.random.Generator) -> Deviation:
    """Sines with amplitudes falling as 1/k, none of them left at no load."""
    order = np.arange(1, 5)
    waves = np.sin(np.pi * np.outer(LEVELS, order))
    line = np.column_stack([1.0 - LEVELS, LEVELS])
    ends = np.linalg.lstsq(line, waves, rcond=None)[0]  # (2, 4)
    sizes = rng.normal(size=len(order)) / order
    sizes = sizes - ends[0] * float(ends[0] @ sizes) / float(ends[0] @ ends[0])
    left = (waves - line @ ends) @ sizes
    sizes = sizes * NON_LINEARITY / float(np.abs(left).max())
    low, high = (ends @ sizes).tolist()
    return Deviation(sizes, (low, high), rng.dirichlet(np.full(len(SLIPS), 4.0)))
