"""What is to be known of a model before it is used: by itself, and on one log.

A model can be saved, exported and run whatever its fit said of it. These sentences are what a
person who did not make the fit has to be told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import unit_in
from flexspline.errors import InputError, listed
from flexspline.logs.channels import CHANNELS
from flexspline.logs.log import Log
from flexspline.part import PART_OF, Part
from flexspline.signals import core_channels

__all__ = [
    "MARGIN",
    "part_warnings",
    "range_warnings",
    "refuse_warnings",
    "rows_outside",
    "widened",
]

Array = NDArray[np.float64]

TWO_SIDED_95 = 1.959964  # standard normal quantile: an interval of 95 % leaves out zero
CHI_SQUARED_95 = 5.991465  # of two degrees of freedom: cosine and sine of an order together

# Share of a range's width that a reading may lie beyond its ends: runs of one motion differ by
# their noise. Of five rig runs, each beside the fit of the others, 3 are warned of without it and
# none at 0.025 to 0.1; of five lab runs that truly differ, 5 at 0.025, 4 at 0.05, 2 at 0.1.
MARGIN = 0.05

TURN = 2.0 * np.pi
ANGLES = ("output_position", "motor_position")  # no effect tells one turn from another

MUST_BE_POSITIVE = {
    "viscous_friction.viscosity": "damping",
    "inertia.inertia": "inertia",
    "coulomb_friction.level": "friction",
}
PER_DIRECTION = "coulomb_friction_per_direction"


def part_warnings(part: Part) -> list[str]:
    """Return what is wrong with a part, a sentence each: signs, significance, bounds.

    Signs are those of a drive alone: a sensor may see friction from either side.
    """
    said: list[str] = []
    if PART_OF[part.target] == "drive":
        said += _sign_warnings(part)
    weak = [*_weak_terms(part), *_weak_orders(part)]
    if weak:
        said.append(
            f"the model of {part.target} has terms that are not significant (95 %): "
            f"{listed(weak)}; leave them out, or record runs that show them"
        )
    stuck = [
        f"{entry['name']} ({entry['state'].removeprefix('at ')})"
        for entry in part.record.get("parameters", ())
        if entry["state"] in ("at lower bound", "at upper bound")
    ]
    if stuck:
        said.append(
            f"the model of {part.target} has parameters that ended at a bound of their search: "
            f"{listed(stuck)}; the model may lack something else"
        )
    return said


def range_warnings(part: Part, log: Log) -> list[str]:
    """Return a sentence where rows of a log lie outside of what the part was fitted to, or none.

    Parameters
    ----------
    log : with the channels that the part's effects read, made as it expects them.
    """
    found = rows_outside(part, log)
    if not found:
        return []
    channels = core_channels(log, part.effects, part.known_load)
    named = []
    for name, rows in found.items():
        reached, (low, high) = channels[name][rows], part.record["validity"][name]
        unit = CHANNELS[name].unit if name in CHANNELS else "Nm"
        named.append(
            f"{name} from {reached.min():.3g} to {reached.max():.3g} {unit} "
            f"(fitted from {low:.3g} to {high:.3g})"
        )
    count = np.count_nonzero(np.any(list(found.values()), axis=0))
    return [
        f"log '{log.name}': {count} of {len(log)} rows lie outside of what the model of "
        f"{part.target} was fitted to: {listed(named)}; it extrapolates there"
    ]


def rows_outside(part: Part, log: Log) -> dict[str, NDArray[np.bool_]]:
    """Return the rows outside of the part's ranges, (N,) by channel; channels that have any."""
    ranges: Mapping[str, Sequence[float]] = part.record.get("validity", {})
    channels = core_channels(log, part.effects, part.known_load)
    rows = {name: _beyond(name, channels[name], *ranges[name]) for name in channels.keys() & ranges}
    return {name: rows[name] for name in ranges if name in rows and rows[name].any()}


def widened(low: float, high: float) -> tuple[float, float]:
    """Return the ends of a range with the margin on both sides."""
    slack = MARGIN * (high - low)
    return low - slack, high + slack


def refuse_warnings(said: Sequence[str]) -> None:
    """Raise the first of these sentences as an `InputError`, and say how many others there are."""
    if said:
        more = f" (and {len(said) - 1} more of the kind)" if len(said) > 1 else ""
        raise InputError(f"{said[0]}{more}; without strict this is a warning")


def _sign_warnings(part: Part) -> Iterator[str]:
    terms = [(f"{e.name}.{term.name}", term.unit) for e in part.effects for term in e.terms]
    values = dict(zip((name for name, _ in terms), part.coefficients.tolist(), strict=True))
    levels = [values.get(f"{PER_DIRECTION}.{side}", 0.0) for side in ("positive", "negative")]
    checked = [
        (name, values[name], unit, MUST_BE_POSITIVE[name])
        for name, unit in terms
        if name in MUST_BE_POSITIVE
    ]
    checked.append(
        (f"the level of {PER_DIRECTION}", 0.5 * (levels[0] - levels[1]), "Nm", "friction")
    )
    for name, value, unit, what in checked:
        if value < 0.0:
            yield (
                f"{name} = {value:.3g} {unit_in(unit, part.target, part.known_load)} is negative "
                f"{what}, which no drive has; fit it again with bounds, or with runs that show it"
            )


def _weak_terms(part: Part) -> list[str]:
    """Coefficients of effects without orders that may as well be zero."""
    ripple = {effect.name for effect in part.effects if effect.ripple}
    return [
        entry["name"]
        for entry in part.record.get("parameters", ())
        if entry["kind"] == "coefficient"
        and entry["state"] in ("fitted", "not determined")
        and entry["name"].split(".")[0] not in ripple
        and not _significant(entry)
    ]


def _significant(entry: Mapping[str, Any]) -> bool:
    """Whether a value is told from zero by its error; where there is none, by being determined."""
    error = entry["standard_error"]
    if error is None:
        return bool(entry["state"] == "fitted")
    return bool(abs(entry["value"]) > TWO_SIDED_95 * error)


def _weak_orders(part: Part) -> list[str]:
    """Orders whose cosine and sine together may as well be zero."""
    known = part.record.get("covariance", {"names": [], "matrix": []})
    place = {name: number for number, name in enumerate(known["names"])}
    if [len(row) for row in known["matrix"]] != [len(place)] * len(place):
        return []  # a file that was changed by hand
    covariance = np.array(known["matrix"], dtype=np.float64)
    found, first = [], 0
    for effect in part.effects:
        last = first + len(effect.terms)
        if effect.ripple:
            names = [f"{effect.name}.{term.name}" for term in effect.terms]
            for number, (order, _) in enumerate(effect.harmonics):
                both = part.coefficients[first + 2 * number : first + 2 * number + 2]
                at = [place[n] for n in names[2 * number : 2 * number + 2] if n in place]
                if len(at) == 2 and _near_zero(both, covariance[np.ix_(at, at)]):
                    found.append(f"{effect.name} order {order}")
        first = last
    return found


def _near_zero(both: Array, covariance: Array) -> bool:
    """Whether bᵀ C⁻¹ b is below the quantile; without a spread nothing is near zero."""
    if not np.isfinite(covariance).all():
        return True
    (a, c), (_, d) = covariance.tolist()
    x, y = both.tolist()
    return bool(d * x * x - 2.0 * c * x * y + a * y * y < CHI_SQUARED_95 * (a * d - c * c))


def _beyond(name: str, values: Array, low: float, high: float) -> NDArray[np.bool_]:
    """Rows whose value is outside of [low, high]; of an angle, whatever the turn."""
    low, high = widened(low, high)
    if name in ANGLES:
        if high - low >= TURN:
            return np.zeros(len(values), dtype=bool)
        return np.asarray(np.mod(values - low, TURN) > high - low)
    return np.asarray((values < low) | (values > high))
