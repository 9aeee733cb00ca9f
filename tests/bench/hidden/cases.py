"""Which cases there are: a frozen list, and an even subset of it for a quick look.

The same kinds of cases can be dealt afresh, with other seeds and settings, to work on: what is
tuned on the frozen ones can no longer be judged by them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from hidden.combined import (
    ALONE,
    EXCLUDED,
    OF_CURRENT,
    PAIRS,
    TRIPLES,
    Combined,
)
from hidden.noise import NOISES
from hidden.rig import JOINTS
from hidden.unknown import UNKNOWN

__all__ = ["CLASSES", "RECORDED_SIZES", "SIZES", "Case", "cases", "quick", "recorded_cases"]

SIZES = (50.0, 16.0, 5.0)
MISMATCHED = (50.0, 100.0, 150.0)
RECORDED_SIZES = (500.0, *SIZES)
CLASSES = ("exact", "lab", "robot")
NOTHING = 100  # logs of each target
RESTLESS = (0.3, 3.0)  # of the noise, that a noisy velocity makes of friction where the joint rests
RESTLESS_LOGS = 20  # of each, for each target with friction

FRESH = 100_000  # between the seeds of one deal and those of the next
OF_CLASS = 20_000  # and between those of the classes

RICH = ("swings", "moves")
LEVELS = (0.01, 0.02, 0.005)


@dataclass(frozen=True)
class Case:
    """One set of runs: what is hidden, how large as t, and where.

    `kind`: nothing, restless (nothing, but a noisy velocity at rests), single, pair, triple,
    unknown, removed or mismatch. `unknown`: a cause that no effect has. `excluded`: effects that
    are taken from the candidates; what is hidden is then one of them. `level`: of the noise, Nm,
    or 0.1 rad of a torsion. `restless`: of that level, what the noise of the measured velocity
    makes of Coulomb friction at rest; elsewhere the channels of an exact log are exact. `recorder`:
    exact, lab or robot.
    """

    number: int
    kind: str
    target: str
    hidden: tuple[str, ...]
    unknown: str
    excluded: tuple[str, ...]
    size: float
    seed: int
    joint: str
    excitation: str
    noise: str
    level: float
    restless: float = 0.0
    recorder: str = "exact"

    @property
    def label(self) -> str:
        """What is hidden, in words."""
        return "+".join(self.hidden) or self.unknown or "nothing"

    @property
    def key(self) -> str:
        """One line that no other case has."""
        own = f"{self.number} {self.kind} {self.target} {self.label} t={self.size:g}"
        return own if self.recorder == "exact" else f"{self.recorder} {own}"

    @property
    def nameable(self) -> tuple[str, ...]:
        """What is hidden and among the candidates."""
        return () if self.excluded else self.hidden


@dataclass
class _Maker:
    """Deals out settings by the number of the case, and poor motion in turn.

    `fresh`: 0 for the frozen cases; any other number deals other settings and seeds.
    """

    fresh: int = 0
    recorder: str = "exact"
    numbers: Iterator[int] = field(default_factory=count)
    dealt: dict[tuple[str, str], int] = field(default_factory=dict)

    def __call__(
        self,
        kind: str,
        target: str,
        hidden: tuple[str, ...],
        size: float,
        *,
        unknown: str = "",
        excluded: tuple[str, ...] = (),
        poor_every: int = 0,
        restless: float = 0.0,
    ) -> Case:
        k = self.dealt[kind, target] = self.dealt.get((kind, target), -1) + 1
        poor = poor_every and k % poor_every == poor_every - 1
        number = next(self.numbers)
        own = CLASSES.index(self.recorder)
        entropy = [20261122, own, number, self.fresh] if own else [20261121, number]
        entropy += [self.fresh] * bool(self.fresh and not own)
        dealt = np.random.default_rng(entropy)
        motion = "tied" if poor else "moves" if restless else str(dealt.choice(RICH))
        return Case(
            number=number,
            kind=kind,
            target=target,
            hidden=hidden,
            unknown=unknown,
            excluded=excluded,
            size=size,
            seed=1000 + number + FRESH * self.fresh + OF_CLASS * own,
            joint=str(dealt.choice(sorted(JOINTS))),
            excitation=motion,
            noise=str(dealt.choice(sorted(NOISES))),
            level=float(dealt.choice(LEVELS)),
            restless=restless,
            recorder=self.recorder,
        )


def cases(fresh: int = 0) -> list[Case]:
    """Return every case, in an order that mixes sizes and targets.

    `fresh`: 0 for the frozen ones, else the number of another deal of the same kinds.
    """
    made, case = list[Case](), _Maker(fresh)
    for target in ALONE:
        for size in SIZES:
            for seed in range(2):
                made += [case("single", target, (name,), size, poor_every=5 - seed)
                         for name in ALONE[target]]  # fmt: skip
            made += [case("pair", target, names, size, poor_every=7) for names in PAIRS[target]]
            made += [case("triple", target, names, size) for names in TRIPLES[target]]
            made += [case("unknown", target, (), size, unknown=name) for name in UNKNOWN[target]]
            made += [case("removed", target, (name,), size, excluded=(name, *more))
                     for name, more in EXCLUDED[target].items()]  # fmt: skip
        made += [case("mismatch", target, (name,), MISMATCHED[k % 3])
                 for k, name in enumerate(n for n in ALONE[target] if n != "offset")]  # fmt: skip
        made += [case("nothing", target, (), 0.0, poor_every=5) for _ in range(NOTHING)]
    for target in ("sensor_torque", "motor_torque"):
        made += [case("restless", target, (), 0.0, restless=share)
                 for share in RESTLESS for _ in range(RESTLESS_LOGS)]  # fmt: skip
    if fresh:
        order = np.random.default_rng([20261121, fresh]).permutation(len(made))
        return [made[k] for k in order]
    return sorted(made, key=_mixed)


def recorded_cases(recorder: str, fresh: int = 0) -> list[Case]:
    """Return every case of the class lab or robot, in an order that mixes sizes and targets.

    `fresh`: 0 for the frozen ones, else the number of another deal of the same kinds.
    """
    made, case = list[Case](), _Maker(fresh, recorder)
    for target, own in _combined(recorder).items():
        singles, pairs, triples, nothing, unknown = COUNTS[recorder]
        for size in RECORDED_SIZES:
            for seed in range(singles):
                made += [case("single", target, (name,), size, poor_every=5 - seed % 2)
                         for name in own.alone]  # fmt: skip
            made += [case("pair", target, names, size, poor_every=7)
                     for _ in range(pairs) for names in own.pairs]  # fmt: skip
            made += [case("triple", target, names, size)
                     for _ in range(triples) for names in own.triples]  # fmt: skip
            made += [case("unknown", target, (), size, unknown=name)
                     for _ in range(unknown) for name in own.unknown]  # fmt: skip
            made += [case("removed", target, (name,), size, excluded=(name, *more))
                     for name, more in own.excluded.items()]  # fmt: skip
        made += [case("nothing", target, (), 0.0, poor_every=5) for _ in range(nothing)]
    if fresh:
        order = np.random.default_rng([20261121, fresh]).permutation(len(made))
        return [made[k] for k in order]
    return sorted(made, key=_mixed)


COUNTS = {"lab": (3, 1, 1, 100, 1), "robot": (10, 5, 4, 300, 2)}
"""How often each is dealt at each size: singles, pairs, triples, nothing, unknown."""


def _combined(recorder: str) -> dict[str, Combined]:
    if recorder == "robot":
        return {"motor_current": OF_CURRENT}
    return {target: Combined(ALONE[target], PAIRS[target], TRIPLES[target], EXCLUDED[target],
                             tuple(UNKNOWN[target]))
            for target in ALONE}  # fmt: skip


def _mixed(case: Case) -> int:
    """An order in which the first cases of a run that is stopped are of all sorts."""
    return (case.number * 7919) % 10007


def quick(every: Sequence[Case]) -> list[Case]:
    """Return about seventy cases: of each kind, target and size a few."""
    share = {"nothing": 5, "single": 2, "pair": 1, "triple": 1, "unknown": 1, "removed": 0,
             "mismatch": 1, "restless": 1}  # fmt: skip
    strata: dict[tuple[str, str, float], list[Case]] = {}
    for case in sorted(every, key=lambda c: c.number):
        size = 0.0 if case.kind == "mismatch" else case.size
        strata.setdefault((case.kind, case.target, size), []).append(case)
    chosen = []
    for number, ((kind, _, size), own) in enumerate(strata.items()):
        wanted = share[kind] + (kind == "removed" and size == SIZES[0])
        dealt = np.random.default_rng([20261121, number])
        chosen += [own[k] for k in dealt.choice(len(own), min(wanted, len(own)), replace=False)]
    return sorted(chosen, key=_mixed)
