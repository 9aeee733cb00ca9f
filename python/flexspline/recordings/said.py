"""What a file says of its joint outside the table: gear ratio, torque constant, encoders."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

__all__ = ["Resolution", "Said", "said_in"]

NUMBER: Final = r"(\d+(?:[.,]\d+)?)"
LONGEST: Final = 200  # letters of a line or a name that are looked at
GEAR: Final = (
    re.compile(
        r"(?:gear[\s_-]*ratio|übersetzung\w*|uebersetzung\w*|untersetzung\w*|減速比|"
        rf"reduction(?:[\s_-]*ratio)?)\s*(?:\[[-–1]?\])?[\s:=;,\t\"]{{0,4}}{NUMBER}",
        re.IGNORECASE,
    ),
    re.compile(rf"(?:gear|getriebe|\bi\b|ratio)[^\n]{{0,60}}?\b{NUMBER}\s*:\s*1\b", re.IGNORECASE),
)
SIZE_CODE: Final = re.compile(
    r"\b(?:HF\w{2}|CS[GFD]|SH[GFD]|CP[UL]|FHA|SHD)\w*-\d{1,3}-(\d{2,3})\b"
)
"""Strain wave gears are sold by series, size and ratio: HFUS-25-100."""
CONSTANT: Final = re.compile(
    rf"(?:torque[\s_-]*constant|drehmomentkonstante|\bk_?[tm]\b)[\s:=;,\t\"]{{0,4}}{NUMBER}"
    r"[\s;,\t\"\[(]*(m?)Nm/A",
    re.IGNORECASE,
)
RESOLUTION: Final = re.compile(
    rf"{NUMBER}[\s;,\t\"]{{0,6}}(?:(bits?|counts?|cnts?|inc\w{{0,12}}|pulses|ticks)"
    r"\s{0,3}(?:per|/|pro|a)\s{0,3}(?:rev\w{0,12}|turn|umdr\w{0,12}|r\b)|(cpr|ppr))",
    re.IGNORECASE,
)
NAMED: Final = re.compile(
    rf"(\w*?)_?(?:cpr|counts_per_(?:rev|turn)|resolution)\b[\s:=;,\t\"]{{1,4}}{NUMBER}",
    re.IGNORECASE,
)
FEWEST_COUNTS: Final = 100.0  # per turn, of an encoder of a joint
RATIOS: Final = (2.0, 1000.0)  # what a gear ratio can be


class Resolution(NamedTuple):
    """Counts per turn, the words before them, and whether they are sure."""

    words: frozenset[str]
    counts: float
    sure: bool


@dataclass(frozen=True)
class Said:
    """Facts of a joint [-, Nm/A] and of its encoders."""

    gear_ratio: float | None = None
    torque_constant: float | None = None
    resolutions: tuple[Resolution, ...] = ()

    def resolution_of(self, name: str) -> Resolution | None:
        """Return that of the encoder whose words a column's name shares, if one alone does."""
        own = _words(name)
        shared = [(len(own & each.words), each) for each in self.resolutions]
        most = max((count for count, _ in shared), default=0)
        best = [each for count, each in shared if count == most and count > 0]
        return best[0] if len(best) == 1 else None


def said_in(lines: Iterable[str]) -> Said:
    """Return what lines above a table, or the facts of a file, say."""
    there = [line[:LONGEST] for line in lines]
    return Said(_gear_ratio(there), _torque_constant(there), (*_resolutions(there), *_named(there)))


def _gear_ratio(lines: Sequence[str]) -> float | None:
    for pattern in (*GEAR, SIZE_CODE):
        for line in lines:
            found = pattern.search(line)
            if found and RATIOS[0] <= _number(found[1]) <= RATIOS[1]:
                return _number(found[1])
    return None


def _torque_constant(lines: Sequence[str]) -> float | None:
    for line in lines:
        if found := CONSTANT.search(line):
            return _number(found[1]) * (1e-3 if found[2] else 1.0)
    return None


def _resolutions(lines: Sequence[str]) -> Iterable[Resolution]:
    for line in lines:
        before = 0
        for found in RESOLUTION.finditer(line):
            label, before = line[before : found.start()].rsplit(",", 1)[-1], found.end()
            count, kind = _number(found[1]), (found[2] or found[3]).lower()
            if kind.startswith("bit"):
                count = 2.0**count if count <= 32 else 0.0
            quadrature = kind in ("ppr", "pulses")
            if count >= 1:
                yield Resolution(_words(label), count * (4 if quadrature else 1), not quadrature)


def _named(lines: Sequence[str]) -> Iterable[Resolution]:
    """Resolutions that a scalar of a name such as enc_out_cpr states."""
    for line in lines:
        for found in NAMED.finditer(line):
            if _number(found[2]) >= FEWEST_COUNTS:
                yield Resolution(_words(found[1]), _number(found[2]), True)


def _words(text: str) -> frozenset[str]:
    return frozenset(re.findall(r"[^\W\d_]{2,}", text.lower()))


def _number(text: str) -> float:
    return float(text.replace(",", "."))
