"""What there is to say of the parameters of a fit, for text and HTML alike."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from flexspline.errors import listed
from flexspline.formatting.numbers import plus_minus, short, short_names
from flexspline.least_squares.ripple import PAIRS, RippleOrder, ripple_orders

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit, Parameter

__all__ = ["KnownGroup", "ParameterLine", "known_groups", "naive_remark", "parameter_lines"]

TOGETHER = 0.95  # correlation from which two estimates are said to move together


@dataclass(frozen=True)
class ParameterLine:
    """One line of the table of parameters, as text.

    `heading`: of the lines from here on, "" for none. `concern`: the remark is a reason to worry.
    `interval`: of 95 %. `naive`: the error as if every sample were news. `effect`: whose it is, ""
    where several share it.
    """

    name: str
    value: str
    unit: str
    remark: str
    concern: bool = False
    heading: str = ""
    interval: str = ""
    naive: str = ""
    effect: str = ""


@dataclass(frozen=True)
class KnownGroup:
    """Confounded coefficients: why, and the combinations that are known, with value and unit."""

    sentence: str
    known: tuple[tuple[str, str], ...]


def parameter_lines(fit: Fit) -> list[ParameterLine]:
    """Return a line for each parameter, then one for each order of ripple and derived quantity."""
    ripple = ripple_orders(fit)
    orders = {name for order in ripple for name in order.names}
    lines = [_line(fit, p) for p in fit.parameters if p.name not in orders]
    for (effect, turns), members in groupby(ripple, lambda o: (o.effect, o.turns)):
        for number, order in enumerate(members):
            lines.append(_ripple_line(order, "" if number else _heading(effect, turns)))
    return [*lines, *_derived_lines(fit)]


def _derived_lines(fit: Fit) -> list[ParameterLine]:
    """What follows from the parameters, under a heading of its own."""
    return [
        ParameterLine(
            d.name,
            plus_minus(d.value, d.standard_error),
            d.unit,
            "",
            heading="" if number else "From these (errors to first order)",
        )
        for number, d in enumerate(fit.derived)
    ]


def known_groups(fit: Fit) -> list[KnownGroup]:
    """Return what is known of coefficients that are not known by themselves."""
    return [
        KnownGroup(
            short_names(group.sentence),
            tuple(
                (short_names(str(k)), f"{plus_minus(k.value, k.standard_error)} {k.unit}")
                for k in group.known
            ),
        )
        for group in fit.confounded
    ]


def naive_remark(fit: Fit) -> str:
    """Return how wrong errors would be that take every sample for news; "" where none is known."""
    ratios = np.array(
        [
            p.standard_error / p.naive_error
            for p in fit.parameters
            if p.determined and p.naive_error > 0.0 and np.isfinite(p.standard_error)
        ]
    )
    if not len(ratios):
        return ""
    low, middle, high = np.percentile(ratios, [0, 50, 100]).tolist()
    naive = "Naive errors (all samples treated as independent)"
    if middle < 1.1:
        return f"{naive} would be about the same."
    spread = f" ({low:.1f} to {high:.1f})" if high > 1.2 * low else ""
    return f"{naive} are {middle:.1f} times too small{spread}."


def _heading(effect: str, turns: str) -> str:
    return f"{effect}: A·cos(order·angle − phase) per turn of {turns}"


def _ripple_line(order: RippleOrder, heading: str) -> ParameterLine:
    counted = ""
    if order.turns != PAIRS["output_on_housing"] and np.isfinite(order.per_output_turn):
        counted = f"{order.per_output_turn:g} per output turn"
    phase = f"phase {_angle(order)}" if order.significant else "not significant"
    return ParameterLine(
        f"order {order.order}",
        plus_minus(order.amplitude, order.amplitude_error),
        order.unit,
        "; ".join(part for part in (phase, counted) if part),
        not order.significant,
        heading,
        naive=_error(order.naive_error),
        effect=order.effect,
    )


def _angle(order: RippleOrder) -> str:
    digits = 0 if order.phase_error >= 1.0 else 1
    return f"{order.phase:.{digits}f}° ± {max(order.phase_error, 0.1):.{digits}f}°"


def _line(fit: Fit, parameter: Parameter) -> ParameterLine:
    name = short_names(parameter.name)
    owner = parameter.name.split(".")[0] if "." in parameter.name else ""
    if not parameter.determined:
        return ParameterLine(name, *_undetermined(fit, parameter), concern=True, effect=owner)
    value = plus_minus(parameter.value, parameter.standard_error)
    remarks = []
    concern = False
    if parameter.state == "fixed":
        remarks.append("fixed")
    elif parameter.state != "fitted":
        remarks.append(f"ended {parameter.state.replace('at ', 'at its ')}")
        concern = True
    if parameter.prior is not None:
        remarks.append(f"prior {plus_minus(*parameter.prior)}")
    if parameter.kind == "coefficient" and np.isfinite(parameter.standard_error):
        if not parameter.significant:
            remarks.append("not significant")
            concern = True
        remarks += _partners(fit, parameter)
    return ParameterLine(
        name,
        value,
        parameter.unit,
        "; ".join(remarks),
        concern,
        interval=_interval(parameter),
        naive=_error(parameter.naive_error),
        effect=owner,
    )


def _interval(parameter: Parameter) -> str:
    low, high = parameter.interval
    if not np.isfinite(parameter.standard_error) or not np.isfinite(high - low):
        return ""  # unknown, or fewer effective samples than parameters
    digits = max(0, min(9, 1 - int(np.floor(np.log10(max((high - low) / 4.0, 1e-9))))))
    return f"{low:.{digits}f} to {high:.{digits}f}"


def _error(error: float) -> str:
    return short(error, 2) if np.isfinite(error) else ""


def _undetermined(fit: Fit, parameter: Parameter) -> tuple[str, str, str]:
    """Value, unit and remark of a parameter that must not show a number of its own."""
    if parameter.kind == "shape":
        said = f"the model uses {short(parameter.value)} {parameter.unit}"
        return "not determined", "", said
    partners = next((g.names for g in fit.confounded if parameter.name in g.names), ())
    if len(partners) == 1:
        return "not determined", "", "these runs do not excite it"
    return "not determined alone", "", "what is known stands below"


def _partners(fit: Fit, parameter: Parameter) -> list[str]:
    """Parameters whose estimates are tied to this one."""
    names = fit.part.record["covariance"]["names"]
    if parameter.name not in names:
        return []
    errors = np.sqrt(np.maximum(np.diag(fit.covariance), 1e-300))
    row = names.index(parameter.name)
    correlation = fit.covariance[row] / errors / errors[row]
    hidden = {p.name for p in fit.parameters if not p.determined}
    tied = [
        short_names(name)
        for name, r in zip(names, correlation, strict=True)
        if abs(r) > TOGETHER and name != parameter.name and name not in hidden
    ]
    return [f"strongly correlated with {listed(tied, 2)}"] if tied else []
