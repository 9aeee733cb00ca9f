"""How large a hidden term is: its t by generalised least squares in the true noise.

The base, its bend (∂/∂ ln of its one shape) and the other hidden terms are taken out, then each
rival, one at a time: every other effect of the catalogue in several shapes. The least t is the
size. A rival that leaves less than SAME of a term is no rival but the same thing in these runs:
no size would tell them apart, and it is not taken out.

Shapes and orders of the rivals are frozen here; what `discover` tries does not move a size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.signal import lfilter

from flexspline import _core
from flexspline.effects import CATALOGUE, TARGETS, Effect
from flexspline.logs.log import Log
from flexspline.signals import core_channels, gear_of
from hidden.noise import Noise
from hidden.rig import LOAD, Array, Scene
from hidden.rivals import SAME_THING, forms_of

__all__ = ["Size", "Sizing", "Term", "base_rows", "rows_of", "sized"]

Term = list[Array]
SAME = 0.06  # 3 / 50: at full size t = 3 is left
LATER = {"direction_dependent_friction"}
"""Effects that the catalogue got since: no size of the frozen cases moves with them."""
DEPENDENT = 1e-10  # of a column's squares


@dataclass(frozen=True)
class Size:
    """What a term is multiplied by, the t it then has beside the base alone, and its rival."""

    factor: float
    t_base: float
    closest: str


@dataclass(frozen=True)
class Sizing:
    """The runs, and the noise they have, in which terms are measured.

    `disturbing`: columns of each run, (N, K), that a term stands beside as it does beside the base.
    """

    target: str
    base: tuple[Effect, ...]
    scenes: Sequence[Scene]
    logs: Sequence[Log]
    noise: Noise
    level: float
    excluded: tuple[str, ...] = ()
    disturbing: Sequence[Array] = ()

    def whitened(self, columns: Sequence[Array]) -> Array:
        """Columns of all runs as white noise of variance one sees them, (N, C)."""
        skipped, sigma = len(self.noise.denominator) - 1, self.noise.innovation(self.level)
        made = [lfilter(self.noise.denominator, [1.0], c, axis=0)[skipped:] for c in columns]
        return np.asarray(np.concatenate(made) / sigma)

    @cached_property
    def known(self) -> Array:
        """The base and its bend, whitened, (N, B)."""
        columns = [np.empty((len(s.time), 0)) for s in self.scenes]
        for effect in self.base:
            own = [base_rows(effect, s, log) for s, log in zip(self.scenes, self.logs, strict=True)]
            columns = [np.column_stack(both) for both in zip(columns, own, strict=True)]
        if self.disturbing:
            columns = [np.column_stack(both) for both in zip(columns, self.disturbing, strict=True)]
        return self.whitened(columns)

    @cached_property
    def rivals(self) -> dict[Effect, Array]:
        """Every effect that may be missing, in each of its forms, whitened, (N, R)."""
        taken = {e.name for e in self.base} | set(self.excluded) | LATER
        taken |= {"sensor_lag"} if self.target != "sensor_torque" else set()
        names = [n for n, info in CATALOGUE.items()
                 if TARGETS[self.target] in info.targets and n not in taken]  # fmt: skip
        forms = [form for name in names for form in forms_of(name, self.scenes[0].joint)]
        return {form: self.beside(form) for form in forms}

    def beside(self, effect: Effect) -> Array:
        """Rows of an effect, whitened, (N, R)."""
        return self.whitened([rows_of(effect, log) for log in self.logs])

    def left(self, term: Array, *others: Array) -> float:
        """t of a whitened term (N,) beside the base and other columns."""
        return float(np.linalg.norm(_left(np.column_stack([self.known, *others]), term[:, None])))

    def own(self, term: Term) -> Array:
        """A term of the runs, whitened, (N,)."""
        return self.whitened([x[:, None] for x in term[: len(self.logs)]])[:, 0]

    def off_by(self, share: float, name: str, term: Term, logs: Sequence[Log]) -> Term:
        """Return the catalogue's best form plus what a term differs from it, `share` of it in t.

        `logs`: all runs, those held out as well.
        """
        own, trials = self.own(term), []
        for form in forms_of(name, self.scenes[0].joint):
            rows = self.beside(form)
            both = np.column_stack([self.known, rows])
            beta = np.linalg.lstsq(both, own, rcond=None)[0][-rows.shape[1] :]
            trials.append((self.left(own, rows), form, beta))
        _, form, beta = min(trials, key=lambda trial: trial[0])
        exact = [rows_of(form, log) @ beta for log in logs]
        away = [x - e for x, e in zip(term, exact, strict=True)]
        rows = self.beside(form)
        factor = share * self.left(self.own(exact)) / self.left(self.own(away), rows)
        return [e + factor * a for e, a in zip(exact, away, strict=True)]


def sized(
    sizing: Sizing, terms: dict[str, Term], size: float, *, rivals_out: bool = True
) -> dict[str, Size]:
    """Return the factor of each term that gives it the size, beside the others.

    `rivals_out`: whether rivals are taken out too; else the size is that beside the base.
    """
    whitened = {name: sizing.own(term) for name, term in terms.items()}
    made = {}
    for name, own in whitened.items():
        others = [x[:, None] for n, x in whitened.items() if n != name]
        known = np.column_stack([sizing.known, *others])
        left = {form: c for form, c in (sizing.rivals.items() if rivals_out else ())
                if form.name not in (name, *SAME_THING.get(name, ()))}  # fmt: skip
        base = float(np.linalg.norm(_left(known, own[:, None])))
        beside = _beside_each(known, own, left)
        rivals = {form: t for form, t in beside.items() if t >= SAME * base}
        least = min(rivals, key=lambda form: rivals[form], default=None)
        t = base if least is None else rivals[least]
        closest = "" if least is None else least.name
        made[name] = Size(size / t, size * base / t, closest)
    return made


def _beside_each(known: Array, term: Array, rivals: dict[Effect, Array]) -> dict[Effect, float]:
    """Norm of what is left of a term beside the base and each rival."""
    columns = np.column_stack([term, *rivals.values()])
    rest = _left(known, columns)
    own, at, made = rest[:, :1], 1, {}
    for form, rows in rivals.items():
        end = at + rows.shape[1]
        made[form] = float(np.linalg.norm(_left(rest[:, at:end], own)))
        at = end
    return made


def _left(known: Array, columns: Array) -> Array:
    """Columns less their projection on the known ones."""
    scale = np.linalg.norm(known, axis=0)
    known = known[:, scale > 0.0] / scale[scale > 0.0]
    if not known.shape[1]:
        return columns
    values, vectors = np.linalg.eigh(known.T @ known)
    seen = values > DEPENDENT * values[-1]
    basis = known @ (vectors[:, seen] / np.sqrt(values[seen]))
    rest = columns - basis @ (basis.T @ columns)
    return np.asarray(rest - basis @ (basis.T @ rest))


def rows_of(effect: Effect, log: Log) -> Array:
    """Rows of an effect in a run, the known load its load, (N, terms)."""
    gear: dict[str, Any] = gear_of(log.facts, "motor_position" in log)
    design = _core.Design([effect.for_core()], **gear)
    return np.asarray(design.rows(core_channels(log, [effect], LOAD), len(log), np.empty(0)))


def base_rows(effect: Effect, s: Scene, log: Log) -> Array:
    """Rows of an effect of the base at its true shape, and its bend, by numpy, (N, 1 or 2)."""
    own = s.joint
    if effect.name == "coulomb_friction":
        slip = s.v / own.width
        return np.column_stack([s.direction, slip * (1.0 - s.direction**2)])
    if effect.name == "mesh_compliance":
        bend = own.mesh_shape * s.load
        return np.column_stack([s.mesh, bend / (1.0 + bend**2) - np.arctan(bend)])
    return rows_of(effect, log)
