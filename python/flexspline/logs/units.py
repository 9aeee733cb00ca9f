"""Units as recorders, laboratories and languages spell them, and what pint calls them.

A spelling counts whatever its blanks, brackets and product signs: "[N·m]" is "Nm". Letters' case
counts first ("mNm"), then not ("NM").
"""

from __future__ import annotations

import functools
import re
from typing import Final

__all__ = ["SPELLINGS", "canonical_unit"]

SMALL: Final = ("mNm", "mA", "mV")  # with a capital M they may be mega

SPELLINGS: Final[dict[str, tuple[str, ...]]] = {
    "s": ("s", "sec", "secs", "second", "seconds", "sek", "sekunden", "秒", "с"),
    "ms": ("ms", "msec", "millis", "millisecond", "milliseconds", "millisekunden", "мс"),
    "us": ("us", "µs", "μs", "usec", "micros", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanosecond", "nanoseconds"),
    "day": ("day", "days", "d"),
    "rad": ("rad", "рад", "radian", "radians", "rads"),
    "mrad": ("mrad",),
    "deg": ("deg", "degs", "degree", "degrees", "°", "º", "grad", "度", "град"),
    "rev": ("rev", "revs", "revolution", "revolutions", "turn", "turns", "umdr", "tr"),
    "rad/s": ("rad/s", "rad/sec", "rads/s", "rad_s", "rad_per_s", "rad_sec", "rads-1", "rads^-1"),
    "deg/s": ("deg/s", "deg/sec", "°/s", "°/sec", "º/s", "dps", "grad/s", "deg_s", "deg_per_s"),
    "mrad/s": ("mrad/s", "mrad_s"),
    "rpm": (
        "rpm", "1/min", "1min", "1.min", "u/min", "min-1", "min^-1", "r/min", "rev/min", "umin",
        "upm", "tr/min", "/min", "min⁻¹", "rev_min", "об/мин", "obr/min", "ot/min", "giri/min",
    ),
    "rev/s": ("rev/s", "revs/s", "turn/s", "turns/s", "rps", "r/s", "u/s", "rev_s"),
    "rad/s^2": ("rad/s^2", "rad/s²", "rad/s2", "rad/ss", "rad_s2", "rads-2"),
    "deg/s^2": ("deg/s^2", "deg/s²", "deg/s2", "°/s²", "°/s^2", "°/s2", "deg_s2"),
    "Nm": ("Nm", "newtonmetre", "newtonmeter", "newtonmetres", "newtonmeters", "нм", "N_m"),
    "mNm": ("mNm", "N_mm", "Nmm"),
    "Ncm": ("Ncm",),
    "kilonewton * metre": ("kNm",),
    "uNm": ("uNm", "µNm", "μNm"),
    "lbf * inch": ("lbfin", "lbin", "inlb", "inlbf", "inlbs", "lbsin"),
    "lbf * foot": ("lbfft", "lbft", "ftlb", "ftlbf", "ftlbs"),
    "ozf * inch": ("ozfin", "ozin", "inoz", "inozf"),
    "kgf * cm": ("kgfcm", "kgcm", "kgf_cm"),
    "A": ("A", "А", "amp", "amps", "ampere", "amperes"),
    "mA": ("mA", "мА", "milliamp", "milliamps"),
    "V": ("V", "В", "volt", "volts"),
    "mV": ("mV", "millivolt", "millivolts"),
    "degC": ("degC", "°C", "ºC", "℃", "C", "celsius", "deg_C", "gradC"),
    "degF": ("degF", "°F", "ºF", "℉", "F", "fahrenheit", "deg_F"),
    "K": ("K", "kelvin"),
    "%": ("%", "percent", "prozent", "pct"),
    "permille": ("permille", "‰"),
}  # fmt: skip
"""pint's unit: how it is met. "grad" and "C" are the laboratory's, degrees and not gon or coulomb.
Not here: "Hz" and "1/s", which of a speed may be turns or radians in a second."""


def canonical_unit(text: str) -> str | None:
    """Return pint's name of a unit as somebody spelt it, or None where the spelling is not known.

    Examples
    --------
    >>> canonical_unit("[N·m]"), canonical_unit("U/min"), canonical_unit("apples")
    ('Nm', 'rpm', None)
    """
    bare = _bare(text)
    exact, folded = _tables()
    for plain in (re.sub(r"\s", "", bare), _without_signs(bare)):
        unit = exact.get(plain) or folded.get(plain.lower())
        if unit and (plain in exact or not (unit in SMALL and plain != plain.lower())):
            return unit
    return None


def _bare(text: str) -> str:
    """Return a unit without the brackets around it."""
    return re.sub(r"^\s*(?:\[(.*)\]|\((.*)\)|\{(.*)\})\s*$", r"\1\2\3", str(text)).strip()


def _without_signs(bare: str) -> str:
    """Return a torque without the signs of its product: "N·m", "lbf-in"."""
    return re.sub(r"(?<=[A-Za-zА-я])[\s·⋅•・*.-]+(?=[A-Za-zА-я])", "", bare)


@functools.cache
def _tables() -> tuple[dict[str, str], dict[str, str]]:
    exact, folded = dict[str, str](), dict[str, str]()
    for unit, spellings in SPELLINGS.items():
        for spelling in (unit, *spellings):
            plain = re.sub(r"\s", "", spelling)
            exact.setdefault(plain, unit)
            folded.setdefault(plain.lower(), unit)
    return exact, folded
