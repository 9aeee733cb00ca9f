"""Thirty simulated logs: of the hidden benchmark's recorders, and of the simulator elsewhere.

They are of a deal that nobody works on, so that golden numbers tell nothing of the frozen cases.
Every one is fitted with what is hidden in it known; twelve also go through `discover`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial

from elsewhere.recorder import recorded as recorded_elsewhere
from hidden.cases import CLASSES, Case, cases, recorded_cases
from hidden.made import made_of
from hidden.recorded import recorded
from hidden.rig import LOAD

import flexspline as fx
from golden.numbers import Cases, discovery_numbers, fit_numbers, of

__all__ = ["simulated_cases"]

DEAL = 16
CHOSEN = {
    "exact": (165, 202, 472, 538, 669, 774, 795, 833, 978, 1040),
    "lab": (146, 331, 467, 738, 842, 1112, 1189),
    "robot": (355, 483, 585, 826, 838, 1047),
}
ELSEWHERE = (0, 4, 5, 6, 7, 8, 9)
DISCOVERED = {
    "exact": (202, 538, 669, 833),
    "lab": (331, 738, 1189),
    "robot": (355, 483, 1047),
    "elsewhere": (6, 7),
}


@dataclass(frozen=True)
class Runs:
    """Logs with what is known of them, and the names of what is hidden."""

    base: tuple[str | fx.Effect, ...]
    hidden: tuple[str, ...]
    logs: tuple[fx.Log, ...]
    target: str
    known_load: str | None

    def fitted(self) -> fx.Fit:
        """The fit that knows what is hidden."""
        effects = [*self.base, *self.hidden]
        return fx.fit(effects, list(self.logs), self.target, known_load=self.known_load)

    def discovered(self) -> fx.Discovery:
        """What is missing in the base."""
        return fx.discover(
            self.base, list(self.logs), target=self.target, known_load=self.known_load
        )


def simulated_cases() -> Cases:
    """Return what computes the numbers of each case, by its name."""
    made: Cases = {}
    for recorder in CLASSES:
        for number in CHOSEN[recorder]:
            case = _dealt(recorder)[number]
            name = f"simulated {recorder} {number} {case.target} {case.label}"
            made |= _both(name, number in DISCOVERED[recorder], partial(_hidden, recorder, number))
    for seed in ELSEWHERE:
        name = f"simulated elsewhere {seed}"
        made |= _both(name, seed in DISCOVERED["elsewhere"], partial(_elsewhere, seed))
    return made


def _both(name: str, discovered: bool, runs: partial[Runs]) -> Cases:
    made = {f"fit/{name}": of(lambda: runs().fitted(), fit_numbers)}
    if discovered:
        made[f"discover/{name}"] = of(lambda: runs().discovered(), discovery_numbers)
    return made


@cache
def _dealt(recorder: str) -> dict[int, Case]:
    every = cases(DEAL) if recorder == "exact" else recorded_cases(recorder, DEAL)
    return {case.number: case for case in every}


@cache
def _hidden(recorder: str, number: int) -> Runs:
    case = _dealt(recorder)[number]
    made = made_of(case) if recorder == "exact" else recorded(case)
    load = LOAD if LOAD in made.logs[0] else None
    return Runs(made.base, case.hidden, made.logs, case.target, load)


@cache
def _elsewhere(seed: int) -> Runs:
    made = recorded_elsewhere(seed)
    hidden = tuple(name for name in made.hidden if not name.startswith("?"))
    return Runs(tuple(made.base), hidden, tuple(made.logs), made.target, made.known_load)
