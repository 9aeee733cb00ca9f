"""What a recorder makes of a simulated joint: its encoders, drive, torque amplifier and thermistor.

    angle        rounded to the encoder's quantum, 2π / 2^bits
    velocity     low-pass of first order in the drive, causal, plus white noise
    torque       white noise of the amplifier, rounded to its quantum
    temperature  white noise, rounded to its quantum

Rows are stamped at even times and taken up to a jitter later or earlier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, lfilter_zi

from flexspline.logs.log import Log

__all__ = ["Recorder"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recorder:
    """Settings of a laboratory's recorder.

    Parameters
    ----------
    output_bits, motor_bits : of the encoders, per turn.
    velocity_bandwidth : of the drive's low-pass, Hz; below half the sampling rate.
    velocity_noise : standard deviation, rad/s at the output.
    torque_noise, torque_step : standard deviation and quantum, Nm.
    temperature_noise, temperature_step : standard deviation and quantum, K.
    jitter : standard deviation of the time at which a row is taken, s.
    """

    output_bits: int = 20
    motor_bits: int = 15
    velocity_bandwidth: float = 80.0
    velocity_noise: float = 0.001
    torque_noise: float = 0.003
    torque_step: float = 0.001
    temperature_noise: float = 0.03
    temperature_step: float = 0.01
    jitter: float = 2e-5

    def record(self, motion: Log, torque: Array, rng: np.random.Generator) -> Log:
        """Return the log of a true motion and the true torque at the sensor, Nm (N,)."""
        time = motion["time"]
        taken = time + self.jitter * rng.standard_normal(len(time))
        white = rng.standard_normal((3, len(time)))

        def at_rows(values: Array) -> Array:
            return np.interp(taken, time, values)

        velocity = at_rows(self._filtered(time, motion["output_velocity"]))
        torque = at_rows(torque) + self.torque_noise * white[1]
        temperature = at_rows(motion["temperature"]) + self.temperature_noise * white[2]
        columns = {
            "time": time,
            "output_position": _rounded(
                at_rows(motion["output_position"]), 2 * np.pi / 2**self.output_bits
            ),
            "motor_position": _rounded(
                at_rows(motion["motor_position"]), 2 * np.pi / 2**self.motor_bits
            ),
            "output_velocity": velocity + self.velocity_noise * white[0],
            "sensor_torque": _rounded(torque, self.torque_step),
            "temperature": _rounded(temperature, self.temperature_step),
        }
        return Log(columns, motion.facts, ("simulated by flexspline.rigs",))

    def _filtered(self, time: Array, velocity: Array) -> Array:
        rate = 1.0 / (time[1] - time[0])
        b, a = butter(1, self.velocity_bandwidth, fs=rate)
        return np.asarray(lfilter(b, a, velocity, zi=velocity[0] * lfilter_zi(b, a))[0])


def _rounded(values: Array, step: float) -> Array:
    return step * np.round(values / step)
