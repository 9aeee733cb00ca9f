"""The first paper's oven and brake: drift and calibration of the sensor by itself.

Protocols (zhang_disturbance_elimination §4.2, §4.3): 20 to 45 °C in steps of 5, rising only; a
brake from 0 to 70 Nm in steps of 5 while the joint turns at 2 °/s one way.

Drawn, each range chosen once, before any claim was computed:

- Oven: 20 minutes a step, which the body follows within 120–300 s (60 g of aluminium in moving
  air). The run that no fit sees is another day's: the joint warms by its motor over an hour, with
  a time constant of 600–1200 s.
- Calibration: reference gain within 0.25 % and zero within 0.05 Nm (0.025 % of its 200 Nm), noise
  of 20 mNm; room of 19–21 °C, as (25) agrees with (24) at 20 °C; the joint warms by 0.2–1 K; brake
  levels within 0.3 Nm, reached within 0.7 s, wandering by 0.2 %; 12 s a level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline.logs.log import Log
from flexspline.rigs.zhang_sensor import FULL_SCALE, ZhangSensor
from flexspline.simulation import Noise

__all__ = ["RATIO", "ZhangBench", "facts", "zhang_bench"]

Array = NDArray[np.float64]

RATIO = 100.0
LOW, STEP, STEPS = 20.0, 5.0, 6  # °C, K
LEVEL = 12.0  # s
KINDS = {"warming": 2, "drift": 3, "calibration": 4}


@dataclass(frozen=True)
class ZhangBench:
    """A sensor in the oven and against the brake.

    Parameters
    ----------
    sensor : its cancelling placement is used.
    reference : gain and zero [Nm] of the reference sensor.
    room : °C. warming : K during a calibration.
    seed : of noise and levels.
    """

    sensor: ZhangSensor
    reference: tuple[float, float]
    room: float
    warming: float
    seed: int

    def oven(self, soak: float = 1200.0) -> Log:
        """Return 20 to 45 °C in steps of 5, rising only, without load, 1 Hz (§4.2)."""
        rng = np.random.default_rng([self.seed, KINDS["drift"]])
        time = np.arange(0.0, STEPS * soak)
        target = LOW + STEP * np.floor(time / soak)
        return self._warm(time, _late(target, rng.uniform(120.0, 300.0)), "oven", rng)

    def warm_up(self, seconds: float = 3600.0) -> Log:
        """Return the joint warming from 20 to 45 °C by its own motor, another day, 1 Hz."""
        rng = np.random.default_rng([self.seed, KINDS["warming"]])
        time = np.arange(0.0, seconds)
        risen = -np.expm1(-time / rng.uniform(600.0, 1200.0))
        body = LOW + STEP * (STEPS - 1) * risen / risen[-1]
        return self._warm(time, body, "warming by the motor", rng)

    def calibration(self, *, unloading: bool = False) -> Log:
        """Return 0 to 70 Nm in steps of 5 at 2 °/s one way, and back if `unloading`, 10 Hz."""
        rng = np.random.default_rng([self.seed, KINDS["calibration"], unloading])
        levels = np.arange(0.0, FULL_SCALE + 1.0, 5.0)
        levels = np.concatenate([levels, levels[-2::-1]]) if unloading else levels
        levels = np.maximum(levels + rng.uniform(-0.3, 0.3, len(levels)) * (levels > 0.0), 0.0)
        time = np.arange(0.0, LEVEL * len(levels), 0.1)
        steps = levels[np.minimum((time / LEVEL).astype(int), len(levels) - 1)]
        torque = _late(steps, 7.0) * (1.0 + Noise(2e-3, 0.5).draw(len(time), 0.1, rng))
        gain, zero = self.reference
        columns = {
            **self._read(time, np.maximum(torque, 0.0), rng),
            "reference_torque": gain * torque + zero + rng.normal(0.0, 0.02, len(time)),
        }
        way = "loading and unloading" if unloading else "loading"
        return Log(columns, facts(f"calibration, {way}"), ("simulated",))

    def _read(self, time: Array, torque: Array, rng: np.random.Generator) -> dict[str, Array]:
        """Columns of a run at 2 °/s."""
        sensor, body = self.sensor, self.room + self.warming * time / time[-1]
        angle = np.radians(2.0) * time
        voltage = sensor.cancelling.voltage(
            (RATIO + 1.0) * angle, torque + sensor.deviation.of(torque), body
        )
        return {
            "time": time,
            "output_position": angle,
            "sensor_voltage": sensor.read(sensor.cancelling, time, voltage, 1, rng),
            "thermistor_voltage": sensor.thermistor(time, body, rng),
        }

    def _warm(self, time: Array, body: Array, name: str, rng: np.random.Generator) -> Log:
        """A run at rest; the strain of the wave generator is a part of the zero then."""
        bridge = self.sensor.cancelling.with_waves()
        voltage = bridge.voltage(0.0, 0.0, self.sensor.heat.gauges(bridge, time, body, rng))
        columns = {
            "time": time,
            "sensor_voltage": self.sensor.read(bridge, time, voltage, 1, rng),
            "thermistor_voltage": self.sensor.thermistor(time, body, rng),
        }
        return Log(columns, facts(name), ("simulated",))


def zhang_bench(sensor: ZhangSensor, rng: np.random.Generator, seed: int) -> ZhangBench:
    """Return the bench of a sensor; `rng` draws what the paper does not print."""
    return ZhangBench(
        sensor,
        (rng.uniform(0.9975, 1.0025), rng.uniform(-0.05, 0.05)),
        rng.uniform(19.0, 21.0),
        rng.uniform(0.2, 1.0),
        seed,
    )


def facts(name: str) -> dict[str, str | float | int]:
    """Facts of a log of this rig."""
    return {
        "joint": "modular joint",
        "name": name,
        "gear_ratio": RATIO,
        "output_spline": "circular",
    }


def _late(values: Array, lag: float) -> Array:
    """The values (N,) behind a first-order lag of so many rows; they start settled."""
    keep = float(np.exp(-1.0 / lag))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values - values[0]) + values[0])
