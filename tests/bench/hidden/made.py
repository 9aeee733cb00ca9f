"""The runs of a case: base, noise, and the hidden terms at their size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexspline.effects import Effect, effect
from flexspline.logs.log import Log
from hidden.cases import Case
from hidden.forms import FORMS, RIPPLE, Form
from hidden.noise import NOISES
from hidden.recorder import Recorder
from hidden.rig import EXCITATIONS, JOINTS, Array, Scene, scene
from hidden.size import Size, Sizing, Term, sized
from hidden.unknown import UNKNOWN

__all__ = ["IN_TORSION", "Made", "base_of", "forms_in", "known_of", "made_of",
           "noise_of"]  # fmt: skip

HELD_OUT = 3  # runs that nobody fits
OFF = 0.09  # of a term: what its form misses, in the cases of a mismatch
IN_TORSION = 0.1  # rad of noise at the motor for one Nm
FRICTION = ("offset", "coulomb_friction", "viscous_friction", "inertia")
BASES = {"sensor_torque": FRICTION, "motor_torque": FRICTION,
         "motor_current": (*FRICTION, "gravity"),
         "torsion": ("offset", "mesh_compliance")}  # fmt: skip


@dataclass(frozen=True)
class Made:
    """Runs to look at and runs that are held out.

    `scenes`: of all runs, those held out last. `terms`: each hidden term at its size, arrays (N,)
    of all runs, as `sizes` have it. `clean`: base and hidden terms without the noise; `measured`:
    with it.

    Of a recorded case: `logs` are recorded, `held_out` exact and `unseen` the same runs recorded;
    `small`: effects that are there besides.
    """

    base: tuple[Effect, ...]
    scenes: tuple[Scene, ...]
    logs: tuple[Log, ...]
    held_out: tuple[Log, ...]
    terms: dict[str, Term]
    clean: Term
    measured: Term
    sizing: Sizing
    sizes: dict[str, Size]
    small: tuple[str, ...] = ()
    recorder: Recorder | None = None
    unseen: tuple[Log, ...] = ()

    @property
    def t_base(self) -> dict[str, float]:
        """t of each term beside the base and the other terms alone."""
        return {name: one.t_base for name, one in self.sizes.items()}

    @property
    def closest(self) -> dict[str, str]:
        """The rival of each term that leaves least."""
        return {name: one.closest for name, one in self.sizes.items()}

    @property
    def exact(self) -> tuple[Log, ...]:
        """All runs with channels as they are, not as they were recorded."""
        return (*self.sizing.logs, *self.held_out)


def base_of(case: Case) -> tuple[Effect, ...]:
    """Return what the model knows: the base without what is hidden of it."""
    names = [name for name in BASES[case.target] if name not in case.hidden]
    effects = [effect(name) for name in names]
    if "speed_dependent_ripple" in case.hidden:
        effects.append(effect("wave_generator_ripple", orders=[RIPPLE]))
    return tuple(effects)


def made_of(case: Case) -> Made:
    """Make the runs of a case."""
    joint, runs = JOINTS[case.joint], EXCITATIONS[case.excitation]
    restless = case.level * case.restless
    scenes = [scene(joint, case.excitation, case.seed, k, restless) for k in range(runs + HELD_OUT)]
    base, level = base_of(case), case.level * (IN_TORSION if case.target == "torsion" else 1.0)
    known = [known_of(case, s) for s in scenes]
    logs = [_log(case.target, s, y, k) for k, (s, y) in enumerate(zip(scenes, known, strict=True))]
    sizing = Sizing(case.target, base, scenes[:runs], logs[:runs], NOISES[case.noise], level,
                    case.excluded)  # fmt: skip
    raw = {name: [form(s) for s in scenes] for name, form in forms_in(case).items()}
    if case.kind == "mismatch":
        raw = {name: sizing.off_by(OFF, name, term, logs) for name, term in raw.items()}
    sizes = sized(sizing, raw, case.size, rivals_out=case.kind != "mismatch")
    terms = {name: [sizes[name].factor * x for x in term] for name, term in raw.items()}
    clean = [y + sum(term[k] for term in terms.values()) for k, y in enumerate(known)]
    measured = [y + noise_of(case, level, k, len(y)) for k, y in enumerate(clean)]
    made = [
        _log(case.target, s, y, k) for k, (s, y) in enumerate(zip(scenes, measured, strict=True))
    ]
    return Made(
        base,
        tuple(scenes),
        tuple(made[:runs]),
        tuple(made[runs:]),
        terms,
        clean,
        measured,
        sizing,
        sizes,
    )


def noise_of(case: Case, level: float, number: int, rows: int, draw: int = 0) -> Array:
    """Noise of a run in the target, (N,); the first draw is the one in the log."""
    generator = np.random.default_rng([20261121, case.seed, number, 99 + draw])
    return NOISES[case.noise].drawn(generator, rows, level)


def forms_in(case: Case) -> dict[str, Form]:
    """What is hidden, by its name."""
    target = {"motor_current": "motor_torque"}.get(case.target, case.target)
    forms = {name: FORMS[target][name] for name in case.hidden}
    return {**forms, case.unknown: UNKNOWN[target][case.unknown]} if case.unknown else forms


def known_of(case: Case, s: Scene) -> Array:
    """The base of a run without what is hidden of it, (N,)."""
    own, hidden = s.joint, case.hidden
    if case.target == "torsion":
        mesh = 0.0 if "mesh_compliance" in hidden else s.mesh
        return np.asarray(mesh + np.full(len(s.time), 0.0 if "offset" in hidden else 0.02))
    parts = {
        "offset": np.full(len(s.time), own.offset),
        "coulomb_friction": own.coulomb * s.direction,
        "viscous_friction": own.viscous * s.v,
        "inertia": own.inertia * s.a,
        "": _base_ripple(s) if "speed_dependent_ripple" in hidden else np.zeros(len(s.time)),
    }
    return np.asarray(sum(part for name, part in parts.items() if name not in hidden))


def _base_ripple(s: Scene) -> Array:
    angle = s.theta if s.joint.output_spline == "circular" else s.beta
    return np.asarray(0.1 * s.joint.coulomb * np.cos(2.0 * angle + 0.4))


def _log(target: str, s: Scene, y: Array, number: int) -> Log:
    columns, ratio = s.columns, s.joint.ratio
    if target == "sensor_torque":
        columns["sensor_torque"] = y + s.load
    elif target == "motor_torque":
        columns["motor_torque"] = (y + s.load) / ratio
    else:
        columns["motor_position"] = ratio * s.q - y
    return Log.from_arrays(facts={**s.joint.facts, "name": f"run{number + 1}"}, **columns)
