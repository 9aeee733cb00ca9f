"""Two sentences that say where measurement and model disagree most, made of the numbers.

They say where, never why: a cause is not named here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexspline.comparison.locate import Place
from flexspline.errors import listed

if TYPE_CHECKING:
    from flexspline.comparison.result import Comparison, Follows

__all__ = ["floor_sentence", "sentences", "sized"]

WORTH_SAYING = 0.1  # of what all explain together
MOST = 3
MOST_IDLE = 7
FAR = 2.0  # times the floor: a simulation that is off by more is not down at it


def sentences(made: Comparison) -> tuple[str, str]:
    """Return the size of the gap beside the floor, and where the gap is."""
    whole, what = made.overall, made.what.replace("_", " ")
    size = sized(whole.rmse, whole.noise_floor)
    floor = sized(whole.noise_floor, whole.noise_floor)
    kind = "simulated" if made.simulated or made.foreign else "predicted"
    of = f"between measured and {kind} {what}"
    if made.simulated and not made.follows and made.rmse > FAR * made.noise_floor:
        first = f"The gap {of} is {size} {made.unit} RMS; the measured one resolves {floor}."
        return first, "No channel locates it: it grows and shrinks with time, as drift does."
    if not made.follows:
        first = f"The gap {of} is {size} {made.unit} RMS, which is down at the noise floor."
        idle = _and(made.makes_no_difference[:MOST_IDLE], "or")
        return first, f"Nothing in it follows {idle}." if idle else "No channel locates any of it."
    first = f"The gap {of} is {size} {made.unit} RMS against a noise floor of {floor} {made.unit}."
    return first, _where(made)


def floor_sentence(made: Comparison) -> str:
    """Say how the noise floor was estimated."""
    if made.simulated and made.what == "output_position":
        return (
            "The noise floor is that of the measured angle alone: its white noise, or its counts. "
            "A simulation is off by more wherever it drifts."
        )
    noise = made.memory
    seconds = f"{noise.seconds:.2g} s" if noise.seconds >= 1e-4 else "less than a row"
    taken = [f.words for f in made.follows]
    left = (
        f"what is left of the residual once its dependence on {_and(taken)} is taken out" if taken
        else "the residual itself, for no channel explains any of it"
    )  # fmt: skip
    doubt = (
        f" The velocity is noisy by {noise.velocity:.2g} rad/s; where the prediction bends within "
        "that, the floor holds what it does to the prediction."
        if noise.velocity_matters
        else ""
    )
    return (
        f"The noise floor is {left}, band by band. Its memory (autoregressive, order "
        f"{noise.order}, {seconds}) gives {made.overall.rows} rows an effective sample size of "
        f"{made.overall.effective_rows:.0f}, by which every chance is counted.{doubt}"
    )


def sized(value: float, beside: float) -> str:
    """Return a value with the decimals that show two digits of another."""
    if not (np.isfinite(value) and beside > 0.0):
        return f"{value:.2g}"
    decimals = 1 - int(np.floor(np.log10(beside)))
    if not -3 <= decimals <= 6:
        return f"{value:.2g}"
    return f"{value:.{max(decimals, 0)}f}"


def _where(made: Comparison) -> str:
    total = sum(f.gain for f in made.follows)
    told = [f for f in made.follows if f.gain >= WORTH_SAYING * total][:MOST]
    largest = [_located(f.place, f.name, made.units[f.name]) for f in told if _is_band(f)]
    verbs: list[str] = []
    for f in told:
        if not _is_band(f):
            verbs.append(_verb(made, f))
        elif not any(v.startswith("is largest") for v in verbs):
            verbs.append(f"is largest {_and(largest)}")
    said = f"It {_and(verbs)}"
    also = list(dict.fromkeys(w for f in told[:1] for w in f.also))
    if also:
        said += f" ({_and(also)} would locate it nearly as well)"
    idle = [w for w in made.makes_no_difference if w != "direction" or "direction" not in said]
    if not idle:
        return f"{said}."
    verb = "make" if len(idle) > 1 else "makes"
    return f"{said}; {_and(idle[:MOST_IDLE])} {verb} no difference."


def _is_band(f: Follows) -> bool:
    if f.place is None or f.name in ("offset", "direction") or " and " in f.name:
        return False
    return bool(f.place.kinds) or (1 <= len(f.place.bands) <= 2 and not f.place.whole)


def _verb(made: Comparison, f: Follows) -> str:
    unit, floor = made.unit, made.overall.noise_floor
    if f.place is None:
        each = made.orders[:3]
        orders = _and([f"{peak.per_output_turn:.5g}" for peak in each])
        sizes = _and([sized(peak.amplitude, peak.amplitude) for peak in each])
        return f"turns with the joint, {orders} times per output turn ({sizes} {unit})"
    if f.name == "offset":
        return f"is shifted everywhere by {f.place.means[0]:+.{_decimals(floor)}f} {unit}"
    if f.name == "direction":
        pairs = zip(f.place.kinds, f.place.means, strict=True)
        each_way = listed(f"{kind} {mean:+.{_decimals(floor)}f} {unit}" for kind, mean in pairs)
        return f"changes with the direction ({each_way})"
    return f"changes with the {f.words} over its whole range"


def _located(place: Place | None, name: str, unit: str) -> str:
    assert place is not None
    if place.kinds:
        return f"in {'run' if len(place.kinds) == 1 else 'runs'} {_and(place.kinds[:5])}"
    bands = _and([_band(low, high, name, unit) for low, high in place.bands], "or")
    before = _NOUNS.get(name, "")
    bands = bands.replace(f"or {before}", "or ").replace("-", "−")
    if len(place.directions) == 1:
        return f"{bands} {place.directions[0]}"
    said = place.directions and (place.turns_sign or name in ("speed", *_AFTER))
    return f"{bands} in both directions" if said else bands


_NOUNS = {
    "load": "at loads ",
    "motor_temperature": "at motor temperatures ",
    "position": "at output angles ",
    "acceleration": "at accelerations ",
    "time": "at times ",
}
_AFTER = ("reversal_angle", "reversal_time")


def _band(low: float | None, high: float | None, name: str, unit: str) -> str:
    if name in _AFTER:
        if not low:
            return f"within {high:.3g} {unit} after reversals"
        reach = f"more than {low:.3g}" if high is None else f"from {low:.3g} to {high:.3g}"
        return f"{reach} {unit} after reversals"
    before = _NOUNS.get(name, "")
    if low is None or (low == 0.0 and name == "speed"):
        return f"{before}below {high:.3g} {unit}"
    return f"{before}above {low:.3g} {unit}" if high is None else (
        f"{before}from {low:.3g} to {high:.3g} {unit}"
    )  # fmt: skip


def _decimals(size: float) -> int:
    return max(0, min(6, 1 - int(np.floor(np.log10(size))))) if size > 0.0 else 3


def _and(words: Sequence[str], last: str = "and") -> str:
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"
