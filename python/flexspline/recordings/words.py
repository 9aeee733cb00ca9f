"""What the name of a column says: quantity, side of the gear, role, unit, joint.

Long words count anywhere in a name, so that "Abtriebswinkel" is an angle of the output; short ones
and symbols ("q", "tau", "m") count only by themselves. What a name does not say stays open, and
the numbers may tell it.

Outside the table a file may say of its joint gear ratio, torque constant and encoders.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from flexspline.logs.channels import CHANNELS
from flexspline.logs.units import COUNTS, canonical_unit, states_no_unit, without_remark

__all__ = ["Meaning", "Resolution", "Said", "meaning", "placed", "said_in", "trusted", "unit_in"]


Words = Mapping[str, tuple[str, ...]]

LONG: Final[Words] = {
    "enabled": ("enable", "servo on"),
    "temperature": ("temperat", "thermo", "températ", "teplot", "温度", "температур"),
    "acceleration": ("accel", "beschleunig", "accél", "加速度", "ускорен"),
    "velocity": (
        "veloc", "speed", "drehzahl", "geschwindig", "omega", "qdot", "vitesse", "prędko",
        "otáč", "snelheid", "hastighet", "速度", "转速", "回転数", "скорость",
    ),
    "current": (
        "current", "strom", "courant", "corrente", "corriente", "prąd", "proud", "stroom", "ström",
        "電流", "电流", "ток",
    ),
    "torque": (
        "torque", "moment", "effort", "couple", "coppia", "koppel", "トルク", "扭矩", "力矩",
        "转矩", "момент",
    ),
    "voltage": ("volt", "spannung", "tension ", "napięc", "napět", "電圧", "电压", "напряж"),
    "position": (
        "position", "angle", "winkel", "angular", "angolo", "ángulo", "ângulo", "kąt", "úhel",
        "hoek", "vinkel", "poloha", "posizione", "posición", "encoder", "角度", "位置", "угол",
    ),
    "time": (
        "x value", "time", "zeit", "stamp", "temps", "tempo", "tiempo", "czas", "čas", "tijd",
        "時間", "时间", "время",
    ),
    "duty": ("duty",),
}  # fmt: skip
"""Quantities by parts of words of a dozen languages, those that may hold another one first."""

SHORT: Final = (
    ("position", ("q", "pos", "ang", "theta", "th", "phi", "enc", "lage", "posn", "p")),
    (
        "velocity",
        (
            "qd",
            "dq",
            "qp",
            "vel",
            "spd",
            "dtheta",
            "thetad",
            "thetadot",
            "dth",
            "rpm",
            "velo",
            "erpm",
        ),
    ),
    ("acceleration", ("qdd", "ddq", "qpp", "ddtheta")),
    ("torque", ("tau", "trq", "tq", "mom", "mz", "md", "tj", "tor", "tl")),
    ("current", ("i", "iq", "cur", "curr", "amp", "amps", "imot")),
    ("temperature", ("temp", "tmp")),
    ("voltage", ("u", "ub", "vbus", "vin", "ud")),
    ("time", ("t", "ts", "tm", "clock", "tick", "ticks", "millis", "micros", "ms", "us")),
    ("duty", ("pwm",)),
    ("velocity", ("n", "w", "v")),
    ("acceleration", ("a", "acc")),
    ("voltage", ("v",)),
    ("temperature", ("t",)),
    ("torque", ("m",)),
)
"""Quantities by symbols and short words, those that mean one thing first."""

OUTPUT_LONG: Final = (
    "output", "abtrieb", "link", "gelenk", "achse", "joint", "ausgang", "sortie", "uscita",
    "salida", "wyjści", "výstup", "uitgang", "出力", "関節", "输出", "выход",
)  # fmt: skip
OUTPUT_SHORT: Final = (
    "ab",
    "out",
    "l",
    "ls",
    "j",
    "o",
    "load",
    "arm",
    "axis",
    "lss",
    "q",
    "qd",
    "dq",
)
MOTOR_LONG: Final = (
    "motor", "rotor", "antrieb", "winding", "wicklung", "wave", "moteur", "silnik", "モータ",
    "电机", "двигател",
)  # fmt: skip
MOTOR_SHORT: Final = (
    "erpm", "an", "mot", "mtr", "m", "hs", "rot", "wg", "input", "drive", "in", "mo",
)  # fmt: skip

COMMANDED_LONG: Final = ("command", "target", "soll", "setpoint", "desired", "demand", "goal",
                         "指令", "目標", "profile")  # fmt: skip
COMMANDED_SHORT: Final = ("cmd", "set", "sp", "des", "d", "tgt")
TRUSTED_LONG: Final = ("reference", "referenz", "load cell", "loadcell", "load_cell", "messwelle",
                       "dynamometer", "kraftmess", "参照", "基準", "負荷")  # fmt: skip
TRUSTED_SHORT: Final = ("ft", "ref", "load", "dyno", "brake", "bremse", "last", "tl", "transducer")
TRANSDUCER: Final = re.compile(r"\bT(?:4|5|10|12|20|22|40)[A-Z]{0,3}(?![A-Za-z0-9])")
"""Torque transducers of test benches go by these letters and numbers, as T40B."""
SENSOR_LONG: Final = ("sensor", "strain", "dms", "torsion", "センサ", "joint torque", "传感")
SENSOR_SHORT: Final = ("s", "j", "sens", "jts", "ts", "tj", "msr", "bridge", "link")
SUPPLY: Final = (
    "supply",
    "bus",
    "versorgung",
    "zwischenkreis",
    "zk",
    "battery",
    "vbus",
    "ub",
    "vin",
    "input voltage",
)
NONE_OF_OURS: Final = (
    "error", "deviation", "following", "residual", "differen", "schlepp", "abweich", "fehler",
    "status", "state", "mode", "flag", "checksum", "limit", "estimat", "friction", "bias", "power",
    "fault", "warning", "ambient", "umgebung", "driver", "mosfet", "board", "counter", "zähler",
    "zaehler", "gravity", "meter", "d axis", "battery level",
)  # fmt: skip
NONE_SHORT: Final = (
    "err", "ext", "hat", "crc", "seq", "idx", "index", "id", "min", "max", "std", "nr", "no", "num",
    "fet", "pcb", "room", "amb", "est", "fehl", "mos", "core", "imu", "gyro", "acc", "gnss", "roll",
    "pitch", "yaw", "setup", "defl",
)  # fmt: skip

TENTHS: Final = ("dc", "ddegc", "d°c", "0.1°c", "0.1 °c", "1/10°c")  # of a degree Celsius
LONGEST: Final = 200  # letters of a name or a line that are looked at
FOREIGN: Final = frozenset(
    [
        "m",
        "mm",
        "cm",
        "m/s",
        "mm/s",
        "m/s^2",
        "m/s²",
        "N",
        "kN",
        "mV/V",
        "Pa",
        "bar",
        "W",
        "kW",
        "J",
        "g",
        "kg",
        "h",
        "hr",
        "hrs",
        "min",
        "Hz",
        "kHz",
        "Wh",
        "Ah",
    ]
)
"""Units of no channel: what is given in one is something else."""

MANGLED: Final = re.compile(r"^([^.].*?)\.\.([^.].*?)\.*$")  # R's "Angle..deg." is "Angle [deg]"
IN_WORDS: Final = tuple(
    map(
        re.compile,
        (
            r"^(.*?)\s*[\[({<]\s*([^\[\](){}<>]*)\s*[\])}>]\s*(.*)$",
            r"^(.+?)\s+in\s+(.+)$",
            r"^(.+?)\s*[/,]\s*(\S.*)$",
        ),
    )
)

QUANTITY_OF_UNIT: Final[dict[str, str]] = {
    **dict.fromkeys(("s", "ms", "us", "ns", "day"), "time"),
    **dict.fromkeys(("rad", "mrad", "deg", "rev"), "position"),
    **dict.fromkeys(("rad/s", "deg/s", "rpm", "rev/s", "mrad/s", "erpm"), "velocity"),
    **dict.fromkeys(("rad/s^2", "deg/s^2"), "acceleration"),
    **dict.fromkeys(
        ("Nm", "mNm", "cNm", "dNm", "daNm", "Ncm", "kilonewton * metre", "uNm", "lbf * inch",
         "lbf * foot", "ozf * inch", "kgf * cm", "kgf * m"),
        "torque",
    ),
    **dict.fromkeys(("A", "mA"), "current"),
    **dict.fromkeys(("V", "mV"), "voltage"),
    **dict.fromkeys(("degC", "degF", "K", "ddegC"), "temperature"),
}  # fmt: skip

NUMBER: Final = r"(\d+(?:[.,]\d+)?)"
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


@dataclass(frozen=True)
class Meaning:
    """What a name says of its column; None and "" where it says nothing.

    Parameters
    ----------
    name : the column's name as it is in the file.
    quantity : "position", "torque", …
    side : "motor" or "output".
    role : "commanded", "trusted" (a reference torque), "sensor", "supply", "other" or "".
    unit : pint's name, "counts", or None.
    """

    name: str
    quantity: str | None = None
    side: str | None = None
    role: str = ""
    unit: str | None = None


def meaning(name: str, stated: str | None = None, *, ours: bool = False) -> Meaning:
    """Return what a name says, and the unit that the file states elsewhere.

    `ours`: a name of a channel is that channel, in its own unit.
    """
    if ours and name in CHANNELS:
        return _of_channel(name, stated)
    plain = unicodedata.normalize("NFKC", " ".join(name.split()))[:LONGEST]
    bare, unit = stated_unit(MANGLED.sub(_brackets, plain))
    if stated is not None:
        unit = unit_in(stated) or (unit if states_no_unit(stated) else "foreign")
    whole = _words(bare)
    last = _words(re.split(r"/|\.(?=\D)", bare.rstrip("/."))[-1])  # of a path, what counts most
    unit = "erpm" if "erpm" in whole[1] else unit
    quantity = _quantity(*last, unit) or _quantity(*whole, unit)
    if unit in QUANTITY_OF_UNIT and quantity != QUANTITY_OF_UNIT[unit]:
        unit = None
    role = "other" if unit == "foreign" else _role(name, *last, quantity)
    return Meaning(name, quantity, _side(*last, quantity) or _side(*whole, quantity), role, unit)


def stated_unit(name: str) -> tuple[str, str | None]:
    """Return a name without its unit, and the unit: "tau [Nm]", "n / rpm", "pos_deg", "i in A"."""
    for pattern in IN_WORDS:
        found = pattern.match(name)
        if found and (unit := unit_in(found[2])):
            return " ".join([found[1], *found.groups()[2:]]).strip(), unit
    for split in (name, re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)):
        parts = re.split(r"[_\s.]+", split)
        for count in (3, 2, 1):
            if count < len(parts) and (unit := unit_in("_".join(parts[-count:]))):
                rest = "_".join(parts[:-count])
                if _fits(unit, rest):
                    return rest, unit
    return name, None


def unit_in(text: str) -> str | None:
    """Return pint's name of a unit, "counts", "foreign" for one of no channel, else None.

    Remarks in brackets behind it are left out: "° (Angle)".
    """
    plain = text.strip(" []()\"'")
    for each in (plain, without_remark(plain)):
        if each.lower() in COUNTS:
            return "counts"
        if each.lower() in TENTHS:
            return "ddegC"
        if unit := canonical_unit(each):
            return unit
    return "foreign" if plain in FOREIGN else None


def _fits(unit: str, rest: str) -> bool:
    """Whether a name may have this unit behind it: "tau_s" is no torque in seconds."""
    words, tokens = _words(rest)
    if unit == "foreign":
        return False  # as the end of a name it may be a word
    named = _quantities(words, tokens)
    letters = {quantity for quantity, parts in SHORT if tokens & {p for p in parts if len(p) == 1}}
    if set(named) <= letters and unit not in ("s", "A", "V", "K"):
        return True  # a letter may be many things, "Nm" is one
    return QUANTITY_OF_UNIT.get(unit) in named if unit != "counts" else "position" in named


def _of_channel(name: str, stated: str | None) -> Meaning:
    parts = name.split("_")
    side = parts[0] if parts[0] in ("motor", "output") else None
    role = {"commanded": "commanded", "reference": "trusted", "sensor": "sensor",
            "supply": "supply"}.get(parts[0], "")  # fmt: skip
    silent = not stated or states_no_unit(stated)
    unit = canonical_unit(CHANNELS[name].unit) if silent else unit_in(stated or "") or "foreign"
    if unit == "foreign" or QUANTITY_OF_UNIT.get(str(unit), parts[-1]) != parts[-1]:
        return Meaning(name, parts[-1], side, "other", "foreign")
    return Meaning(name, parts[-1], side, role, unit)


def trusted(name: str) -> bool:
    """Whether a name says in so many words that a torque is a reference: a load cell's."""
    words, tokens = _words(name)
    return _has(words, tokens, TRUSTED_LONG, ()) or TRANSDUCER.search(name) is not None


def placed(name: str) -> bool:
    """Whether a name says where on the joint something is measured."""
    words, tokens = _words(name)
    places = ("sensor", "housing", "gehäuse", "body", "flexspline", "circular", *OUTPUT_LONG)
    return _has(words, tokens, places, ("geh", "dms", "jts"))


def _words(bare: str) -> tuple[str, frozenset[str]]:
    """Return a name in small letters, and its parts: at changes of case, digits and signs."""
    text = unicodedata.normalize("NFKC", bare)
    split = re.sub(r"(?<=[a-zà-ÿ])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text)
    tokens = re.findall(r"[^\W\d_]+", split.lower())
    return " ".join(tokens), frozenset(tokens)


def _brackets(found: re.Match[str]) -> str:
    return f"{found[1].replace('.', ' ')} [{found[2]}]"


def _has(words: str, tokens: frozenset[str], long: tuple[str, ...], short: tuple[str, ...]) -> bool:
    return any(word in words for word in long) or not tokens.isdisjoint(short)


def _quantities(words: str, tokens: frozenset[str]) -> list[str]:
    """Return the quantities that a name may mean, likeliest first."""
    named = [quantity for quantity, parts in LONG.items() if any(part in words for part in parts)]
    if "current" in named and len(named) > 1 and words.startswith("current"):
        named.remove("current")  # "current position" is the present one
    if not tokens.isdisjoint(("i", "u")):
        tokens -= {"q"}  # i_q is a current, of the q axis
    symbols = [quantity for quantity, parts in SHORT if not tokens.isdisjoint(parts)]
    return list(dict.fromkeys([*named, *symbols]))


def _quantity(words: str, tokens: frozenset[str], unit: str | None) -> str | None:
    named = _quantities(words, tokens)
    by_unit = QUANTITY_OF_UNIT.get(unit or "")
    if by_unit is not None:
        return by_unit
    if unit == "counts" and "position" in named:
        return "position"
    return named[0] if named else None


def _side(words: str, tokens: frozenset[str], quantity: str | None) -> str | None:
    if _has(words, tokens, MOTOR_LONG, ()):
        return "motor"
    if _has(words, tokens, OUTPUT_LONG, ("out",)):
        return "output"
    symbol = {"m"} if quantity == "torque" and _quantities(words, tokens - {"m"}) == [] else set()
    if not (tokens - symbol).isdisjoint(MOTOR_SHORT):
        return "motor"
    return "output" if not tokens.isdisjoint(OUTPUT_SHORT) else None


def _role(name: str, words: str, tokens: frozenset[str], quantity: str | None) -> str:
    if _has(words, tokens, NONE_OF_OURS, NONE_SHORT):
        return "other"
    if quantity == "torque" and (
        _has(words, tokens, TRUSTED_LONG, TRUSTED_SHORT) or TRANSDUCER.search(name)
    ):
        return "trusted"
    if _has(words, tokens, COMMANDED_LONG, COMMANDED_SHORT) or (
        quantity != "torque" and _has(words, tokens, ("reference", "referenz"), ("ref",))
    ):
        return "commanded"
    if _has(words, tokens, SENSOR_LONG, SENSOR_SHORT):
        return "sensor"
    if quantity == "current" and _has(words, tokens, ("supply", "bus", "battery"), ("in", "total")):
        return "other"
    return "supply" if quantity == "voltage" and _has(words, tokens, SUPPLY, ("ub", "zk")) else ""


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
        own = _plain_words(name)
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
                yield Resolution(
                    _plain_words(label), count * (4 if quadrature else 1), not quadrature
                )


def _named(lines: Sequence[str]) -> Iterable[Resolution]:
    """Resolutions that a scalar of a name such as enc_out_cpr states."""
    for line in lines:
        for found in NAMED.finditer(line):
            if _number(found[2]) >= FEWEST_COUNTS:
                yield Resolution(_plain_words(found[1]), _number(found[2]), True)


def _plain_words(text: str) -> frozenset[str]:
    return frozenset(re.findall(r"[^\W\d_]{2,}", text.lower()))


def _number(text: str) -> float:
    return float(text.replace(",", "."))
