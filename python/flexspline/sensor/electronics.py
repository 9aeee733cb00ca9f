"""From the bridge's millivolts to the number that the microcontroller reads, and its noise.

The noise of a torque reading has its sources each in V and in Nm, and their sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.errors import InputError, above_zero
from flexspline.formatting import rows_text, scores_html, short
from flexspline.sensor.bridge import Bridge

if TYPE_CHECKING:
    import pandas

__all__ = ["Electronics", "NoiseBudget", "noise_budget"]

Array = NDArray[np.float64]

#: Bits of the flags of the core: the converter is at the end of its range.
SATURATED = 2

_HEAD = ("source", "at the converter [µV rms]", "torque [mNm rms]", "share of the power [%]", "how")


@dataclass(frozen=True)
class Electronics:
    """Amplifier, RC low pass and converter (zhang_disturbance_elimination §2.2, Fig. 5).

    Gain 200 (ADA4528), 16 bits (AD7790) are the paper's; what it does not print is a choice. With
    (25) ±2.5 V are ±157 Nm: more than the range of 70 Nm, less than the overload of 180 Nm that the
    body bears (§2.2), so an overload is flagged and not measured.

    Parameters
    ----------
    gain : of the amplifier.
    resistance, capacitance : of the low pass, Ω and F; the corner is 1/(2π R C) Hz.
    bits : of the converter, 2 to 24.
    reference : V; the converter reads −reference to +reference.
    amplifier_noise : V/√Hz at its input (the data sheet says 5.6e-9 at a gain of 100).
    converter_noise : V rms at the converter. The AD7790's is 1.1 µV at its slowest rate, 9.5 Hz,
        and more at faster ones: give that of yours.
    supply_noise : V rms across the bridge, in the signal's band.
    ratiometric : whether the converter's reference follows the bridge's supply, so that the
        supply's noise divides out.
    offset : V at the converter without torque: unbalanced bridge and amplifier.
    temperature : of the resistors, °C.

    Raises
    ------
    InputError
        For a value that is not finite, not positive where it must be, or bits outside 2 to 24.
    """

    gain: float = 200.0
    resistance: float = 10e3
    capacitance: float = 100e-9
    bits: int = 16
    reference: float = 2.5
    amplifier_noise: float = 5.9e-9
    converter_noise: float = 1.1e-6
    supply_noise: float = 100e-6
    ratiometric: bool = True
    offset: float = 0.0
    temperature: float = 25.0

    def __post_init__(self) -> None:
        for name in ("gain", "resistance", "capacitance", "reference"):
            above_zero(getattr(self, name), f"electronics: {name}")
        for name in ("amplifier_noise", "converter_noise", "supply_noise"):
            above_zero(getattr(self, name), f"electronics: {name}", or_zero=True)
        if not (math.isfinite(self.offset) and -273.15 <= self.temperature < math.inf):
            raise InputError("electronics: offset [V] and temperature [°C] must be possible values")
        if not 2 <= self.bits <= 24 or int(self.bits) != self.bits:
            raise InputError(f"electronics: {self.bits} bits; give a whole number from 2 to 24")

    @property
    def time_constant(self) -> float:
        """R C [s], by which the low pass is late."""
        return self.resistance * self.capacitance

    @property
    def step(self) -> float:
        """One step of the converter [V]."""
        return 2.0 * self.reference / 2.0**self.bits

    def variances(self, bridge_resistance: float) -> tuple[float, float, float, float]:
        """Return the noise at the converter [V²]: bridge, amplifier, low pass, rounding."""
        return _core.noise_variances(
            bridge_resistance,
            self.amplifier_noise,
            self.gain,
            self.time_constant,
            self.capacitance,
            self.reference,
            self.bits,
            self.temperature,
        )

    def read(
        self,
        time: ArrayLike,
        voltage: ArrayLike,
        *,
        bridge_resistance: float = 350.0,
        seed: int | None = None,
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return what the converter reads [V], shape (N,), and where it is at its end.

        Parameters
        ----------
        time : s, increasing, (N,).
        voltage : of the bridge [V], (N,).
        bridge_resistance : Ω, for its thermal noise.
        seed : of the noise; None for none. White noise in front of the low pass that behind it
            has the power that the budget says, whatever the rate.
        """
        when = np.asarray(time, dtype=float)
        given = np.asarray(voltage, dtype=float)
        if when.shape != given.shape or when.ndim != 1 or not (np.diff(when) > 0.0).all():
            raise InputError(
                f"electronics: time {when.shape} and voltage {given.shape}; give one voltage a row "
                "and times that increase"
            )
        if seed is not None:
            given = given + self._noise(when, bridge_resistance, np.random.default_rng(seed))
        read, flags = _core.condition_signal(
            when,
            given,
            gain=self.gain,
            offset=self.offset,
            time_constant=self.time_constant,
            reference=self.reference,
            bits=self.bits,
        )
        return read, (flags & SATURATED) != 0

    def _noise(self, time: Array, resistance: float, rng: np.random.Generator) -> Array:
        """Noise at the bridge [V]: g/(2 − g) of a white one passes a low pass of gain g."""
        bridge, amplifier, low_pass, _ = self.variances(resistance)
        passed = bridge + amplifier + low_pass + self.converter_noise**2
        step = float(np.median(np.diff(time))) if len(time) > 1 else self.time_constant
        gain = -math.expm1(-step / self.time_constant)
        spread = math.sqrt(passed * (2.0 - gain) / gain) / self.gain
        return rng.normal(0.0, spread, len(time))


@dataclass(frozen=True)
class NoiseSource:
    """One source: `volts` rms at the converter, `torque` rms [Nm], `how` it was reckoned."""

    name: str
    volts: float
    torque: float
    how: str


@dataclass(frozen=True)
class NoiseBudget:
    """The noise of a reading, source by source.

    Parameters
    ----------
    sources : with V rms at the converter and Nm rms.
    per_volt : Nm per V at the converter.
    step : of the converter, Nm.
    load : the torque that the sources were reckoned at, Nm.
    """

    sources: tuple[NoiseSource, ...]
    per_volt: float
    step: float
    load: float

    @property
    def total(self) -> float:
        """Nm rms of all sources, as if independent."""
        return math.sqrt(sum(source.torque**2 for source in self.sources))

    def __getitem__(self, name: str) -> NoiseSource:
        return next(source for source in self.sources if source.name == name)

    def to_frame(self) -> pandas.DataFrame:
        """Return the sources by name: volts [V rms], torque [Nm rms], how."""
        import pandas

        data = [(s.volts, s.torque, s.how) for s in self.sources]
        names = [s.name for s in self.sources]
        return pandas.DataFrame(data, index=names, columns=["volts", "torque", "how"])

    def __str__(self) -> str:
        return f"{self._title()}\n{rows_text(self._rows(), left=(0, 4))}"

    def to_html(self) -> str:
        """Return the table as HTML."""
        return scores_html(self._rows(), caption=self._title())

    def _repr_html_(self) -> str:
        return self.to_html()

    def _title(self) -> str:
        return (
            f"Noise of the reading at {self.load:g} Nm: {short(1e3 * self.total)} mNm rms; "
            f"one step of the converter is {short(1e3 * self.step)} mNm"
        )

    def _rows(self) -> list[tuple[str, ...]]:
        power = self.total**2
        found: list[tuple[str, ...]] = [_HEAD]
        for s in self.sources:
            share = 100.0 * s.torque**2 / power if power else 0.0
            shown = f"{share:.1f}" if share >= 0.05 or not share else "< 0.1"
            found.append((s.name, short(1e6 * s.volts), short(1e3 * s.torque), shown, s.how))
        volts = math.sqrt(sum(s.volts**2 for s in self.sources))
        total = ("total", short(1e6 * volts), short(1e3 * self.total), "100.0", "root of squares")
        return [*found, total]


def noise_budget(
    bridge: Bridge, electronics: Electronics | None = None, *, load: float = 0.0
) -> NoiseBudget:
    """Return the noise and quantisation of a torque reading, in Nm.

    Parameters
    ----------
    bridge : its sensitivity and resistance.
    electronics : the paper's by default.
    load : torque at which it is asked, Nm; the supply's noise scales with it.

    Notes
    -----
    Thermal noise 4kTR of the bridge and the amplifier's noise in the band 1/(4RC) of the low
    pass, kT/C of the low pass itself, the converter's own noise, and its step/√12 (a uniform
    error, which needs noise or a signal of a step). The digital filter of a sigma-delta
    converter passes less of the first two, so the total errs on the safe side.

    References
    ----------
    zhang_disturbance_elimination §2.2, Fig. 5 for the chain; [Johnson1928], [Nyquist1928] for 4kTR.
    """
    if not math.isfinite(load):
        raise InputError(f"noise budget: load = {load:g} Nm; give a finite torque")
    chain = electronics or Electronics()
    thermal, amplifier, low_pass, rounding = map(
        math.sqrt, chain.variances(bridge.output_resistance)
    )
    per_volt = 1.0 / (chain.gain * bridge.sensitivity)
    band = 0.25 / chain.time_constant
    supply = 0.0 if chain.ratiometric else chain.supply_noise / bridge.supply * abs(load) / per_volt
    rows = (
        ("bridge", thermal, f"4kTR of {bridge.output_resistance:g} Ω over {band:.4g} Hz"),
        ("amplifier", amplifier, f"{1e9 * chain.amplifier_noise:g} nV/√Hz over {band:.4g} Hz"),
        ("low pass", low_pass, f"kT/C of {1e9 * chain.capacitance:g} nF"),
        ("converter", chain.converter_noise, "its own noise, at the rate it is given for"),
        ("rounding", rounding, f"step/√12, {chain.bits} bits over ±{chain.reference:g} V"),
        ("supply", supply, _supply_words(chain, load)),
    )
    sources = tuple(NoiseSource(name, volts, volts * per_volt, how) for name, volts, how in rows)
    return NoiseBudget(sources, per_volt, chain.step * per_volt, load)


def _supply_words(chain: Electronics, load: float) -> str:
    if chain.ratiometric:
        return "none: the converter's reference follows the supply"
    return f"{1e6 * chain.supply_noise:g} µV rms across the bridge, at {load:g} Nm"
