"""`train`: choose how observer and compliance share the full range, on logs with a true torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.estimators import Merge
from flexspline.estimators.checks import choice
from flexspline.estimators.merge import AT_REST
from flexspline.full_range.gaussian_process import GaussianProcess, fit_gaussian_process
from flexspline.full_range.kalman import MergeRun, fit_kalman
from flexspline.full_range.methods import (
    Settings,
    Signals,
    compliant_observer,
    link_observer,
    signals_of,
    wave_generator_share,
    with_estimators,
)
from flexspline.full_range.result import FullRange, estimates_of
from flexspline.full_range.scores import ErrorTable, SpeedCurve, error_table, speed_curve
from flexspline.full_range.structural_damping import StructuralDamping, fit_structural_damping
from flexspline.full_range.training_logs import (
    faults_of,
    motion_speed_of,
    require_methods,
    require_torsion,
    training_logs,
    variants_of,
    warnings_of,
)
from flexspline.full_range.transition import Transition, choose_transition
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.part import Part

__all__ = ["METHODS", "train"]

Array = NDArray[np.float64]

METHODS = ("sd", "gp", "kalman")
BLOCK_SECONDS = 5.0
ENOUGH_RUNS = 4  # from which runs are the repetitions, below it blocks of time
BANDS = 8  # of speed in motion


def train(
    model: Model,
    logs: Log | Sequence[Log],
    *,
    torsion_parts: Mapping[str, Part] | None = None,
    gain: float = 80.0,
    margin: float = 0.05,
    reference: str = "reference_torque",
    motion_speed: float | None = None,
    rotor_inertia: float = 0.0,
    weight_at_rest: float | None = None,
    methods: Sequence[str] = METHODS,
    gp_rows: int = 1000,
    seed: int = 0,
    at_rest: str = "compliance",
) -> FullRange:
    """Choose α and q̇_trans of (20) for the least RMSE, and train what it is compared with.

    Parameters
    ----------
    model : with a part for motor_torque (inertia, friction) and one for torsion (mesh_compliance
        and what else twists).
    logs : training runs with motion and standstill, both angles, motor_torque and the reference.
    torsion_parts : {"1": datasheet, "2": measured}: several torsion parts to try; the one that is
        best when merged goes into the model. None for the model's own.
    gain : of the observer, 1/s; 80 1/s is our reading of Table II.
    margin : share of the way to the mesh's pole that is kept free.
    reference : channel of the true torque, Nm at the output, outward.
    motion_speed : rad/s at the output from which a row counts as moving; None for 2 % of the speed
        that 99 % of the rows stay below, 0.01 rad/s at least.
    rotor_inertia : J_m, kg·m² at the motor, of the methods "co", "mco", "o2"; 0 where not known:
        the link then has all inertia, and there is no "o2".
    weight_at_rest : largest λ(0) allowed; None leaves the observer as much at standstill as the
        RMSE asks for, with a warning above 0.05.
    methods : which of "sd", "gp", "kalman" to train.
    gp_rows : samples that enter the Gaussian process, 20 to 25000.
    seed : of blocks drawn and of the Gaussian process.
    at_rest : what the model's merge takes at rest: "compliance" ("m"), or "compliant_observer",
        which puts "co" into the model ("mco").

    Raises
    ------
    InputError
        Where part, channel, motion, standstill or load is missing, a channel has a row without a
        number, an angle is wrapped or turns the wrong way, or a method is unknown.
    """
    variants = variants_of(model, torsion_parts)
    require_methods(methods, METHODS, gp_rows)
    choice(at_rest, "at_rest", AT_REST)
    runs = training_logs(logs, reference, list(variants.values()))
    speed = motion_speed_of(runs, motion_speed)
    settings = Settings(gain, margin, speed, rotor_inertia)
    faults = faults_of(runs, model)
    signals = {
        name: [signals_of(its, run, settings) for run in runs] for name, its in variants.items()
    }
    require_torsion(signals)
    task = _Task(runs, reference, settings, weight_at_rest, seed)
    transitions = {
        f"m{name}": task.transition([s.compliance for s in its], its)
        for name, its in signals.items()
    }
    kept = min(variants, key=lambda name: transitions[f"m{name}"].rmse)
    own = signals[kept]
    co = [compliant_observer(variants[kept], s, settings) for s in own]
    transitions["mco"] = task.transition(co, own)
    chosen = transitions[f"m{kept}" if at_rest == "compliance" else "mco"]
    made = FullRange(
        model=_finished(variants[kept], settings, chosen, runs, at_rest),
        variants=variants,
        kept=kept,
        transitions=transitions,
        kalman=fit_kalman(task.merges(own), speed) if "kalman" in methods else None,
        damping=task.damping(own) if "sd" in methods else None,
        process=task.process(gp_rows) if "gp" in methods else None,
        curve=SpeedCurve(np.zeros(2), np.zeros(1, dtype=np.intp), {}, {}, ""),
        training=ErrorTable((), (), speed, 0.0),
        settings=settings,
        reference=reference,
        wave_generator_share=wave_generator_share(own, variants[kept]),
        warnings=(*warnings_of(transitions, signals, task.truth(), reference), *faults),
    )
    return _scored(made, task, signals)


@dataclass(frozen=True)
class _Task:
    """The training runs, and what is asked of them."""

    runs: Sequence[Log]
    reference: str
    settings: Settings
    weight_at_rest: float | None
    seed: int

    def truth(self) -> list[Array]:
        return [run[self.reference] for run in self.runs]

    def blocks(self) -> NDArray[np.intp]:
        """Number of the block of time of each row of all runs; a block is in one run."""
        found, first = [], 0
        for run in self.runs:
            time = run["time"] - run["time"][0]
            number = (time / BLOCK_SECONDS).astype(np.intp) + first
            found.append(number)
            first = int(number[-1]) + 1
        return np.concatenate(found)

    def transition(self, still: Sequence[Array], signals: Sequence[Signals]) -> Transition:
        """Of the observer in motion and `still` at rest."""
        observer, compliance = (
            np.concatenate([t - r for t, r in zip(torques, self.truth(), strict=True)])
            for torques in ([s.observer for s in signals], still)
        )
        return choose_transition(
            np.concatenate([s.velocity for s in signals]),
            observer,
            compliance,
            self.blocks(),
            weight_at_rest=self.weight_at_rest,
            seed=self.seed,
        )

    def merges(self, signals: Sequence[Signals]) -> list[MergeRun]:
        return [
            MergeRun(s.time, s.velocity, s.observer, s.compliance, truth)
            for s, truth in zip(signals, self.truth(), strict=True)
        ]

    def damping(self, signals: Sequence[Signals]) -> StructuralDamping:
        truth = self.truth()
        return fit_structural_damping(
            [(s.time, s.mesh_torsion, r) for s, r in zip(signals, truth, strict=True)]
        )

    def process(self, rows: int) -> GaussianProcess:
        return fit_gaussian_process(self.runs, self.truth(), rows=rows, seed=self.seed)


def _finished(
    model: Model, settings: Settings, chosen: Transition, runs: Sequence[Log], at_rest: str
) -> Model:
    record = {
        "rmse": chosen.rmse,
        "alpha_interval": list(chosen.alpha_interval),
        "velocity_interval": list(chosen.velocity_interval),
        "weight_at_rest": chosen.weight_at_rest,
        "logs": [
            {"name": run.name, "sha256": run.source.sha256 if run.source else None} for run in runs
        ],
    }
    merge = Merge(chosen.alpha, chosen.transition_velocity, record=record, at_rest=at_rest)
    made = with_estimators(model, settings)
    link = at_rest != "compliance"
    return (made.with_estimator(link_observer(settings)) if link else made).with_estimator(merge)


def _scored(made: FullRange, task: _Task, signals: Mapping[str, Sequence[Signals]]) -> FullRange:
    """The same with its curve over speed and its table of the training logs."""
    estimates = [
        estimates_of(made, {name: its[k] for name, its in signals.items()}, run)
        for k, run in enumerate(task.runs)
    ]
    joined = {name: np.concatenate([each[name] for each in estimates]) for name in estimates[0]}
    truth = np.concatenate(task.truth())
    velocity = np.concatenate([s.velocity for s in signals[made.kept]])
    moving = np.abs(velocity[np.abs(velocity) >= task.settings.motion_speed])
    bands = np.unique(np.quantile(moving, np.linspace(0.0, 1.0, BANDS + 1)[1:]))
    edges = [0.0, task.settings.motion_speed, *bands[:-1], np.nextafter(bands[-1], np.inf)]
    if len(task.runs) >= ENOUGH_RUNS:
        lengths = [len(run) for run in task.runs]
        repetition = np.repeat(np.arange(len(lengths), dtype=np.intp), lengths)
        said = f"spread over {len(lengths)} runs"
    else:
        repetition = task.blocks()
        said = f"spread over blocks of {BLOCK_SECONDS:g} s"
    errors = {name: torque - truth for name, torque in joined.items()}
    return replace(
        made,
        curve=speed_curve(errors, velocity, repetition, edges, said),
        training=error_table(joined, truth, velocity, task.settings.motion_speed),
    )
