"""The runs of a case as a recorder saw them, and what is hidden in them at its size.

The size is the t of the true form in the noise of target and rows (`row_noise.py`), beside base,
rivals, what all draws of the recorder have in common, and |v| where viscous friction differs
between directions. The noise grows with the term itself, so its factor is solved for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from flexspline.effects import Effect
from flexspline.logs.log import Log
from hidden.cases import Case
from hidden.forms import FORMS, Form
from hidden.made import IN_TORSION, Made, base_of, forms_in, known_of, noise_of
from hidden.noise import NOISES, Noise
from hidden.recorder import FINE, MARGIN, Recorder, Taken, quantised, recorder_of, taken
from hidden.rig import EXCITATIONS, JOINTS, LOAD, Array, Joint, Scene, scene
from hidden.row_noise import RowNoise
from hidden.size import Size, Sizing, Term, sized
from hidden.small import small_terms

__all__ = ["REACH", "Rig", "UnreachableError", "recorded"]

REACH = 0.8  # of the largest t: no larger size is dealt
CLOSE = 0.01  # of a factor, at which it is solved
ROUNDS = 12
UNSEEN = 24  # runs that nobody fits: on three, chance decides over an effect of t = 5
FAR = 1e4  # times its size: the noise is then that of the term's own inputs
NO_CHANNEL = {"motor_current": ("torque_constant_error", "temperature_dependent_friction")}


class UnreachableError(Exception):
    """A size is above REACH of the largest t that there is; `largest`: that t by name."""

    def __init__(self, largest: Mapping[str, float]) -> None:
        super().__init__(", ".join(f"{name}: {t:.3g}" for name, t in largest.items()))
        self.largest = dict(largest)


def recorded(case: Case) -> Made:
    """Make the runs of a case of the classes lab and robot.

    Raises
    ------
    UnreachableError
        Where no size of the term has so large a t, or nearly none.
    """
    rig = Rig(case)
    if not case.hidden and not case.unknown:
        return rig.made({}, rig.sizing(NOISES[case.noise], rig.level))
    return rig.made(*_solved(rig))


@dataclass(frozen=True)
class Rig:
    """A case, its recorder, its runs, and what is true in them."""

    case: Case

    @cached_property
    def joint(self) -> Joint:
        return JOINTS[self.case.joint]

    @cached_property
    def base(self) -> tuple[Effect, ...]:
        return base_of(self.case)

    @cached_property
    def runs(self) -> int:
        """Runs that are fitted."""
        return EXCITATIONS[self.case.excitation]

    @cached_property
    def recorder(self) -> Recorder:
        return recorder_of(self.case, self.runs)

    @cached_property
    def by_current(self) -> bool:
        """Whether this is a robot: it carries its own link, and its target is in amperes."""
        return self.case.target == "motor_current"

    @cached_property
    def unit(self) -> float:
        """What a Nm at the output is in the target, where that is a torque or a current."""
        return 1.0 / self.joint.drive if self.by_current else 1.0

    @cached_property
    def level(self) -> float:
        """Standard deviation of the target's own noise, in the target's unit."""
        return self.case.level * (IN_TORSION if self.case.target == "torsion" else self.unit)

    @cached_property
    def fine(self) -> list[Scene]:
        """All runs before they are recorded."""
        case, seconds = self.case, self.recorder.seconds + 2.0 * MARGIN
        return [
            scene(self.joint, case.excitation, case.seed, k, rate=FINE, seconds=seconds)
            for k in range(self.runs + UNSEEN)
        ]

    def taken(self, number: int, draw: int = 0) -> Taken:
        """Record a run; the first draw is the one in the log."""
        late = self.recorder.load_delay if "sensor_lag" in self.case.hidden else 0.0
        seen = taken(self.recorder, self.fine[number], self.case.seed, number, draw, late)
        return replace(seen, truth=self.carrying(seen.truth))

    def carrying(self, s: Scene) -> Scene:
        """Return the scene with the load of a robot's own link, whatever it was."""
        return replace(s, load=self.joint.link * np.sin(s.q - 0.3)) if self.by_current else s

    @cached_property
    def first(self) -> list[Taken]:
        """Every run as it is in the log."""
        return [self.taken(k) for k in range(self.runs + UNSEEN)]

    @cached_property
    def scenes(self) -> list[Scene]:
        """Every run as it is, at the times of the samples."""
        return [seen.truth for seen in self.first]

    def known(self, s: Scene) -> Array:
        """The base in a scene, (N,), in the target's unit."""
        own = known_of(self.case, s)
        if self.case.target == "torsion":
            return own
        if "viscous_friction" not in self.case.hidden:
            own = own + self.joint.viscous * self.recorder.one_way * np.abs(s.v)
        if self.by_current and "gravity" not in self.case.hidden:
            own = own + s.load
        return np.asarray(self.unit * own)

    def forms(self) -> dict[str, Form]:
        """What is hidden, by its name."""
        return {name: self.form(name) for name in forms_in(self.case)}

    def form(self, name: str) -> Form:
        """The true form of an effect or unknown cause; viscous friction differs by direction."""
        if name == self.case.unknown:
            return forms_in(self.case)[name]
        own = FORMS["motor_torque" if self.by_current else self.case.target][name]
        if name != "viscous_friction":
            return own
        return lambda s: own(s) * (1.0 + self.recorder.one_way * np.sign(s.v))

    @cached_property
    def exact(self) -> list[Log]:
        """Every run with exact channels and the base alone; of a robot with its link as load."""
        return [self.log(s, self.known(s), k) for k, s in enumerate(self.scenes)]

    def log(self, s: Scene, y: Array, number: int) -> Log:
        """Return a log of exact channels."""
        columns = {**s.columns, **self._target(s, y)}
        if self.recorder.kind == "lab":
            columns = {"motor_position": s.theta, **columns}
        if self.by_current:
            columns[LOAD] = self.unit * s.transmitted
        return Log.from_arrays(facts=self._facts(number), **columns)

    def recorded(self, seen: Taken, y: Array, number: int) -> Log:
        """Return the log of a run whose target is y with its noise, (N,)."""
        quanta = np.random.default_rng([20261122, self.case.seed, number, 2])
        columns = {"time": seen.stamps, **seen.columns, **self._target(seen.truth, y)}
        for name, quantum in self._target_quantum.items():
            columns[name] = quantised(columns[name], quantum, quanta)
        kept = {name: x[seen.kept] for name, x in columns.items()}
        return Log.from_arrays(facts=self._facts(number), **kept)

    def _target(self, s: Scene, y: Array) -> dict[str, Array]:
        ratio = self.joint.ratio
        if self.case.target == "torsion":
            return {"motor_position": ratio * s.q - y}
        if self.by_current:
            return {"motor_current": y}
        return {
            self.case.target: (y + s.load) / (ratio if self.case.target == "motor_torque" else 1)
        }

    @property
    def _target_quantum(self) -> dict[str, float]:
        """Of the channel that holds the target, where it has one."""
        return {
            "torsion": {"motor_position": self.recorder.motor_quantum},
            "motor_current": {"motor_current": self.recorder.current_quantum},
        }.get(self.case.target, {})

    def _facts(self, number: int) -> dict[str, str | float | int]:
        facts = {**self.joint.facts, "name": f"run{number + 1}"}
        if self.by_current:
            facts["torque_constant"] = self.joint.torque_constant
        return facts

    def sizing(self, noise: Noise, level: float, common: Sequence[Array] = ()) -> Sizing:
        """Return what measures terms in a noise beside the base and `common` columns, (N, 1)."""
        case, runs = self.case, slice(self.runs)
        columns = self._one_way()
        if common:
            columns = [np.column_stack(both) for both in zip(columns, common, strict=True)]
        excluded = (*case.excluded, *NO_CHANNEL.get(case.target, ()))
        return Sizing(case.target, self.base, self.scenes[runs], self.exact[runs], noise, level,
                      excluded, columns)  # fmt: skip

    def _one_way(self) -> list[Array]:
        """What differs between directions, a column of each run that is fitted or none."""
        there = self.case.target != "torsion" and self.recorder.one_way != 0.0
        return [np.abs(s.v)[:, None][:, : int(there)] for s in self.scenes[: self.runs]]

    def made(self, sizes: Mapping[str, Size], sizing: Sizing) -> Made:
        """Return the runs with each term at its size, and small ones besides."""
        case = self.case
        terms = {name: [sizes[name].factor * form(s) for s in self.scenes]
                 for name, form in self.forms().items()}  # fmt: skip
        small = small_terms(self, sizing, terms)
        every = [*terms.values(), *small.values()]
        clean = [self.known(s) + sum(term[k] for term in every) for k, s in enumerate(self.scenes)]
        measured = [y + noise_of(case, self.level, k, len(y)) for k, y in enumerate(clean)]
        logs = [self.recorded(seen, measured[k], k) for k, seen in enumerate(self.first)]
        exact = [self.log(s, clean[k], k) for k, s in enumerate(self.scenes)]
        return Made(
            self.base,
            tuple(self.scenes),
            tuple(logs[: self.runs]),
            tuple(exact[self.runs :]),
            terms,
            clean,
            measured,
            sizing,
            dict(sizes),
            tuple(small),
            self.recorder,
            tuple(logs[self.runs :]),
        )


def _solved(rig: Rig) -> tuple[dict[str, Size], Sizing]:
    """Solve for the factors: the noise that goes through a term grows with it."""
    size, errors = rig.case.size, RowNoise.drawn(rig)
    raw: dict[str, Term] = {n: [form(s) for s in rig.scenes] for n, form in rig.forms().items()}

    def sizes_at(
        factors: Mapping[str, float], alone: bool = False
    ) -> tuple[dict[str, Size], Sizing]:
        sizing = rig.sizing(*errors.at(factors, alone=alone))
        return sized(sizing, raw, size), sizing

    begun = {name: one.factor for name, one in sizes_at(dict.fromkeys(raw, 0.0))[0].items()}
    largest = dict.fromkeys(raw, np.inf)
    if errors.of_terms:
        far = {name: FAR * factor for name, factor in begun.items()}
        beyond, _ = sizes_at(far, alone=True)
        largest = {name: size * far[name] / one.factor for name, one in beyond.items()}
    if size > REACH * min(largest.values()):
        raise UnreachableError(largest)
    factors = {n: begun[n] / np.sqrt(1.0 - (size / largest[n]) ** 2) for n in raw}
    for _ in range(ROUNDS):
        sizes, sizing = sizes_at(factors)
        moved = max(abs(one.factor / factors[name] - 1.0) for name, one in sizes.items())
        factors = {name: one.factor for name, one in sizes.items()}
        if moved < CLOSE:
            return sizes, sizing
    raise UnreachableError(largest)
