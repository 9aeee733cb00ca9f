"""One draw of the first paper's sensor: ripple of two placements, drift, calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexspline.baselines import wave_generator_angle
from flexspline.calibration import CalibrationResult, calibrate
from flexspline.estimation import estimate
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.rigs.zhang import ZhangRig
from flexspline.rigs.zhang_sensor import DRIFT, FULL_SCALE, THERMISTOR
from flexspline.sensor import Bridge

__all__ = ["Study", "amplitude", "peak_between", "spectrum"]

Array = NDArray[np.float64]

PADDED = 16  # so that a peak is found between the bins of a record
FIRST = 5.0  # s of a run that count as its start
LAST = 60.0  # s that count as its end


@dataclass(frozen=True)
class Study:
    """A rig and what §4.1 to §4.3 make of its sensor."""

    rig: ZhangRig

    @cached_property
    def placements(self) -> tuple[Log, Log]:
        """At 35.16 °/s without load: common and cancelling placement."""
        return self.rig.ripple()

    @cached_property
    def loading(self) -> CalibrationResult:
        """§4.3 as printed: one way, without temperature."""
        return calibrate(self.rig.bench.calibration(), degree=0, full_scale=FULL_SCALE)

    @cached_property
    def unloading(self) -> CalibrationResult:
        """The same with the way back, which hysteresis needs."""
        log = self.rig.bench.calibration(unloading=True)
        return calibrate(log, degree=0, full_scale=FULL_SCALE)

    @cached_property
    def drift(self) -> CalibrationResult:
        """§4.2: 20 to 45 °C without load, into the model of the line."""
        return calibrate(
            self.rig.bench.oven(),
            reference=None,
            thermistor=THERMISTOR,
            reference_temperature=20.0,
            into=self.loading.model,
        )

    @property
    def model(self) -> Model:
        """Line, drift and thermistor: what the sensor's microcontroller computes."""
        return self.drift.model

    @cached_property
    def held_out(self) -> Log:
        """A warming of another day."""
        return self.rig.bench.warm_up()

    @cached_property
    def before(self) -> Array:
        """Reading of the held-out warming less that at 20 °C, without compensation, Nm."""
        reading = self.loading["sensitivity"].value * self.held_out["sensor_voltage"]
        return np.asarray(reading - reading[self.held_out["time"] < FIRST].mean())

    @cached_property
    def after(self) -> Array:
        """Compensated reading of the held-out warming, Nm."""
        return np.asarray(estimate(self.model, self.held_out)["sensor_torque"])

    @property
    def risen(self) -> float:
        """Reading at 45 °C less that at 20 °C, without compensation, Nm."""
        time = self.held_out["time"]
        return float(self.before[time > time[-1] - LAST].mean())

    @property
    def polynomial_off(self) -> float:
        """Largest |estimate − (24)| / standard error of the three coefficients."""
        found = self.drift.drift_polynomial
        off = [abs(p.value - t) / p.standard_error for p, t in zip(found, DRIFT, strict=True)]
        return float(max(off))

    @property
    def four_gauges(self) -> Bridge:
        """R1 to R4 of the cancelling sensor, at 0° and 90°, by themselves."""
        built = self.rig.sensor.cancelling
        return replace(built, gauges=built.gauges[:4])

    def amplitude_left(self, order: int) -> float:
        """Amplitude of an order, cancelling over common placement."""
        common, cancelling = self.placements
        return amplitude(cancelling, order) / amplitude(common, order)


def amplitude(log: Log, order: int) -> float:
    """Amplitude of an order of the wave generator in the voltage [V], beside a straight drift."""
    phase = order * wave_generator_angle(log)
    time = log["time"] - log["time"][0]
    rows = np.column_stack([np.ones_like(time), time, np.cos(phase), np.sin(phase)])
    found = np.linalg.lstsq(rows, log["sensor_voltage"], rcond=None)[0]
    return float(np.hypot(found[2], found[3]))


def spectrum(log: Log) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes [V] of the voltage, Hann's window, zeros appended."""
    voltage = log["sensor_voltage"] - log["sensor_voltage"].mean()
    window = np.hanning(len(voltage))
    size = 2.0 * np.abs(np.fft.rfft(voltage * window, PADDED * len(voltage))) / window.sum()
    return np.asarray(np.fft.rfftfreq(PADDED * len(voltage), 1.0 / log.rate)), np.asarray(size)


def peak_between(log: Log, low: float, high: float) -> float:
    """Frequency of the highest peak between two [Hz]."""
    hertz, size = spectrum(log)
    inside = (hertz >= low) & (hertz <= high)
    return float(hertz[inside][np.argmax(size[inside])])
