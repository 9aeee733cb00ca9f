"""The search for the orders of a joint's ripple."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.orders.analysis import FoundOrder, OrderAnalysis
from flexspline.orders.faint import find_faint
from flexspline.orders.joint import Estimate, estimates
from flexspline.orders.low import find_low, less_low
from flexspline.orders.parts import Candidate, Pair, candidates, effective_ratio, owner
from flexspline.orders.parts import pairs as known_pairs
from flexspline.orders.scan import Line, find_lines
from flexspline.orders.spectrum import LONGEST, order_spectrum, step_turns
from flexspline.orders.stretches import Values, chosen_values, stretches

__all__ = ["find_orders"]

_CLEAR = 2.0  # standard errors that an order must keep once all are fitted together


def find_orders(
    logs: Log | Sequence[Log],
    values: Values,
    *,
    pairs: Sequence[Pair] | None = None,
    max_order: float | None = None,
    false_alarm: float = 0.01,
    unit: str | None = None,
) -> OrderAnalysis:
    """Find the orders at which something turns with the joint, and name them.

    Parameters
    ----------
    logs : Log or sequence of Log
        Runs of one joint with `output_position` or `motor_position`; samples need not be even.
    values : str, callable or sequence of arrays
        A channel, a function of a log, or one array of shape (rows,) for each log; NaN rows
        are left out.
    pairs : sequence of Pair, optional
        Pairs of parts that may own an order; default `flexspline.orders.pairs` of the log.
    max_order : float, optional
        Highest order per output turn; default 50 Ñ, at most 10 000 and what the rate shows.
    false_alarm : float
        Probability that logs of noise alone, of any colour, yield any order.
    unit : str, optional
        Unit of `values`; a channel knows its own.

    Returns
    -------
    OrderAnalysis

    Raises
    ------
    InputError
        Where no log is given, values do not fit, no run moves, or an option is out of range.

    Notes
    -----
    Runs are cut by direction; amplitude and phase may differ between the stretches, and both
    what keeps its phase and what does not is found. Sources: `orders/floor.py`, `orders/scan.py`,
    `orders/low.py`, `orders/joint.py`.
    """
    logs = [logs] if isinstance(logs, Log) else list(logs)
    if not 0 < false_alarm < 1:
        raise InputError(
            f"find_orders: false_alarm = {false_alarm} is no probability; "
            "give a number between 0 and 1"
        )
    if max_order is not None and not max_order > 0:
        raise InputError(f"find_orders: max_order = {max_order} must be above 0")
    arrays, channel, unit = chosen_values(logs, values, unit)
    parts = stretches(logs, arrays, LONGEST)
    ratio = effective_ratio(logs[0]) or 100.0
    highest = min(max_order or min(50 * ratio, 1e4), max(part.highest for part in parts))
    table = tuple(known_pairs(logs[0]) if pairs is None else pairs)

    def snap(order: float, resolution: float) -> float:
        near = candidates(order, resolution, table)
        return near[0].per_output_turn if near else order

    low, low_estimates = find_low(parts, false_alarm / 2)
    rest = [replace(part, values=less_low(part, low, low_estimates)) for part in parts]
    lines, last = find_lines(rest, step_turns(parts), highest, false_alarm / 2, snap, low)
    fitted = estimates(rest, last.floors, [line.order for line in lines])
    named = _named([*low, *lines], [*low_estimates, *fitted], table, logs[0].facts)
    lowest = min([line.order for line in low] + [part.lowest for part in parts])
    faint = find_faint(parts, [order.per_output_turn for order in named], false_alarm / 2)
    spectrum = order_spectrum(logs, arrays, max_order=highest, unit=unit)
    return OrderAnalysis(
        tuple(named),
        faint,
        channel,
        unit,
        false_alarm,
        (lowest, highest),
        len(logs),
        replace(spectrum, channel=channel),
    )


def _named(
    lines: Sequence[Line],
    fitted: Sequence[Estimate | None],
    table: tuple[Pair, ...],
    facts: Mapping[str, object],
) -> list[FoundOrder]:
    """Return the lines that the joint fit separates, named, the largest first."""
    kept = [
        (line, fit)
        for line, fit in zip(lines, fitted, strict=True)
        if fit is not None and max(fit.amplitude, fit.steady) > _CLEAR * fit.error
    ]
    choices = [candidates(line.order, line.resolution, table) for line, _ in kept]
    alone = sum(bool(choice) and choice[0].pair.motor == 0 for choice in choices) == 1
    found = [
        _one(line, fit, choice, table, facts, alone)
        for (line, fit), choice in zip(kept, choices, strict=True)
    ]
    return sorted(found, key=lambda order: -order.amplitude)


def _one(
    line: Line,
    fit: Estimate,
    choice: Sequence[Candidate],
    table: tuple[Pair, ...],
    facts: Mapping[str, object],
    alone: bool,
) -> FoundOrder:
    wide = candidates(line.order, line.resolution, table, wide=True)
    if choice:
        order: int | float = choice[0].order
        pair = choice[0].pair.name
        effect, label = owner(choice[0], facts, alone=alone)
        wide = [other for other in wide if (other.pair, other.order) != (choice[0].pair, order)]
    else:
        order, pair, effect, label = line.order, "", "", "no known pair turns at a whole order"
    return FoundOrder(
        order,
        pair,
        line.order,
        line.resolution,
        fit.amplitude,
        fit.error,
        fit.steady,
        fit.phase,
        fit.phase_error,
        fit.amplitude / max(fit.error, 1e-300),
        line.chance,
        label,
        effect,
        tuple(other.label for other in wide),
        fit.shares,
    )
