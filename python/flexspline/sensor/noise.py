"""Where the noise of a torque reading comes from: each source in V and in Nm, and their sum."""

from __future__ import annotations

import html
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flexspline.errors import InputError
from flexspline.formatting.numbers import short
from flexspline.formatting.rows import rows_html, rows_text
from flexspline.sensor.bridge import Bridge
from flexspline.sensor.electronics import Electronics

if TYPE_CHECKING:
    import pandas

__all__ = ["NoiseBudget", "NoiseSource", "noise_budget"]

_HEAD = ("source", "at the converter [µV rms]", "torque [mNm rms]", "share of the power [%]", "how")


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
        rows = rows_html(self._rows())
        title = html.escape(self._title())
        return f'<table class="scores"><caption>{title}</caption>{rows}</table>'

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
