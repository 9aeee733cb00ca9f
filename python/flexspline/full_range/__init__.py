"""The external torque from standstill to full speed: observer in motion, torsion at rest.

`train` chooses how a momentum observer and the compliance of the gear share the range, after the
third paper, and compares them with the methods that it names. `torsion_part_from_datasheet` makes
the compliance from a catalogue, `fit_mesh_stiffness` from a stiffness run.

Of the paper's next steps, other gear models inside the observer are taken up ("co", "o2",
hysteresis of the torsion). Friction with wear of the teeth is not: it needs logs over years, so fit
the drive's part again as the joint ages. In place of the merge there is a Kalman filter; why no IMM
or further complementary filter is said in `flexspline.full_range.methods`.

Model, logs and methods are checked before anything is trained.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.estimation.plan import carried_warnings
from flexspline.estimators import Adaptation, Collision, Estimator, Merge
from flexspline.estimators.checks import choice
from flexspline.estimators.external_torque import AT_REST
from flexspline.full_range.methods import (
    GaussianProcess,
    MergeRun,
    Settings,
    Signals,
    StructuralDamping,
    Transition,
    choose_transition,
    compliant_observer,
    fit_gaussian_process,
    fit_kalman,
    fit_structural_damping,
    link_observer,
    require_rows,
    signals_of,
    wave_generator_share,
    with_estimators,
    with_velocities,
)
from flexspline.full_range.result import (
    ErrorScore,
    ErrorTable,
    FullRange,
    SpeedCurve,
    error_table,
    estimates_of,
    speed_curve,
)
from flexspline.full_range.torsion_part import (
    GearCompliance,
    compliance_from_datasheet,
    fit_kinematic_error,
    fit_mesh_stiffness,
    mesh_of,
    torsion_part,
    torsion_part_from_datasheet,
    with_mesh_stiffness,
)
from flexspline.logs.checks import check
from flexspline.logs.log import Log
from flexspline.logs.read import as_logs
from flexspline.logs.segments import at_rest as rows_at_rest
from flexspline.model import Model
from flexspline.part import Part

__all__ = [
    "ErrorScore",
    "ErrorTable",
    "FullRange",
    "GearCompliance",
    "SpeedCurve",
    "Transition",
    "compliance_from_datasheet",
    "fit_kinematic_error",
    "fit_mesh_stiffness",
    "mesh_of",
    "torsion_part",
    "torsion_part_from_datasheet",
    "train",
    "with_mesh_stiffness",
]


Array = NDArray[np.float64]

METHODS = ("sd", "gp", "kalman")
BLOCK_SECONDS = 5.0
ENOUGH_RUNS = 4  # from which runs are the repetitions, below it blocks of time
BANDS = 8  # of speed in motion

MOTION_SHARE = 0.02  # of the speed that 99 % of the rows stay below
LEAST_MOTION = 0.01  # rad/s; an elastic gear lets the output creep at some mrad/s under a push
LEAST_SHARE = 0.01  # of the rows, for motion and for standstill
MOST_HELD = 0.5  # of the rows; a gear that is used stays before the end of its law
#: Faults with which the torsion q Ñ − θ is hundreds of rad of nothing.
READ = (
    "output_position",
    "output_velocity",
    "motor_position",
    "motor_velocity",
    "motor_torque",
)


def __dir__() -> list[str]:
    return __all__


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
    weight_at_rest : largest mean λ allowed over the training rows that certainly stand still, whose
        measured velocity is noise, and largest λ(0); None leaves the observer as much at standstill
        as the RMSE asks for, with a warning above 0.05.
    methods : which of "sd", "gp", "kalman" to train.
    gp_rows : samples that enter the Gaussian process, 20 to 25000.
    seed : of blocks drawn and of the Gaussian process.
    at_rest : what the model's merge takes at rest: "compliance" ("m"), or "compliant_observer",
        which puts "co" into the model ("mco").

    Returns
    -------
    FullRange
        Its model has observer, compliance and merge as trained, and every other estimator of
        `model`, such as the sensor's calibration; what was tuned to the torques that training
        replaces (a detector, an adaptation) is left out, and a warning says so.

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
        warnings=(
            *warnings_of(transitions, signals, task.truth(), reference),
            *carried_warnings(variants[kept]),
            *_left_out(model),
            *faults,
        ),
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
            at_rest=np.concatenate([rows_at_rest(run) for run in self.runs]),
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
    made = (made.with_estimator(link_observer(settings)) if link else made).with_estimator(merge)
    for key, stage in model.estimators.items():
        if key not in made.estimators and not _tuned_to_others(stage, model):
            made = made.with_estimator(stage)
    return made


def _tuned_to_others(stage: Estimator, model: Model) -> bool:
    """Whether a stage is tuned to torques or to a part that a trained observer does not go by."""
    if isinstance(stage, Adaptation):
        return getattr(model.estimators["observer"], "input", "") != "motor_torque"
    return isinstance(stage, Collision) and stage.input != "sensor"


def _left_out(model: Model) -> list[str]:
    """A sentence for each estimator of a model that the trained one lacks."""
    return [
        f"the estimator {key} of the model is left out: it was tuned to an observer or a merge "
        "that training replaces; tune it again to the trained model"
        for key, stage in model.estimators.items()
        if _tuned_to_others(stage, model)
    ]


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


def variants_of(model: Model, parts: Mapping[str, Part] | None) -> dict[str, Model]:
    """Return the model with each torsion part, by name; by "" with its own.

    Raises
    ------
    InputError
        Where the model is none or has no torsion part, or a name is no number.
    """
    if not isinstance(model, Model):
        raise InputError(
            f"model is a {type(model).__name__}; give a model, as fit or Model.load makes it"
        )
    if parts is None:
        model.part("torsion")
        return {"": model}
    if not isinstance(parts, Mapping) or not parts:
        raise InputError("torsion_parts is empty; name at least one part or leave it out")
    for name, part in parts.items():
        if not str(name).isdigit():
            raise InputError(
                f"torsion_parts: '{name}' is no number; name the parts '1', '2', for c1, c2, m1, m2"
            )
        if not isinstance(part, Part):
            raise InputError(
                f"torsion_parts: '{name}' is a {type(part).__name__}; give a part, as "
                "torsion_part_from_datasheet makes it"
            )
    return {
        str(name): replace(model, parts={**model.parts, "torsion": part})
        for name, part in parts.items()
    }


def require_methods(methods: Sequence[str], known: Sequence[str], gp_rows: int) -> None:
    """Refuse a method that does not exist and rows that no Gaussian process can have."""
    for name in methods:
        if name not in known:
            raise InputError(f"there is no method '{name}' to train; give some of {listed(known)}")
    if "gp" in methods:
        require_rows(gp_rows)


def training_logs(logs: Log | Sequence[Log], reference: str, models: Sequence[Model]) -> list[Log]:
    """Return the logs, each with a number in every row of all that is read.

    Raises
    ------
    InputError
        Where there is no log, something else than a log, no reference or one that never changes,
        or a row without a number.
    """
    runs = as_logs(logs)
    if not runs:
        raise InputError("there is no training log; give at least one")
    for run in runs:
        if reference not in run:
            raise InputError(
                f"log '{run.name}': no channel '{reference}'; training needs the true torque at "
                f"the output, it has {listed(run.channels)}"
            )
        _require_numbers(run, {reference, *READ, *_reads(models)})
    truth = np.concatenate([run[reference] for run in runs])
    if np.all(truth == truth[0]):
        raise InputError(
            f"log '{runs[0].name}': {reference} is {truth[0] + 0.0:.3g} Nm in every row, which "
            "says nothing of an external torque; check its column or record a joint that is pushed"
        )
    return runs


def motion_speed_of(runs: Sequence[Log], given: float | None) -> float:
    """Return the speed [rad/s] from which a row counts as moving, with rows on both sides of it.

    Raises
    ------
    InputError
        Where it is not above zero, or the runs hold no motion or no standstill.
    """
    speed = np.abs(np.concatenate([with_velocities(run)["output_velocity"] for run in runs]))
    limit = given
    if limit is None:
        limit = max(LEAST_MOTION, MOTION_SHARE * float(np.quantile(speed, 0.99)))
    if not limit > 0.0:
        raise InputError(f"motion_speed = {limit:g} rad/s; give a speed above zero")
    moving = float(np.mean(speed >= limit))
    if moving < LEAST_SHARE:
        raise InputError(
            f"the training logs hold no motion: {100 * moving:.1f} % of the rows reach "
            f"{limit:.3g} rad/s; add a run in which the joint is driven"
        )
    if 1.0 - moving < LEAST_SHARE:
        raise InputError(
            f"the training logs hold no standstill: {100 * moving:.1f} % of the rows reach "
            f"{limit:.3g} rad/s; add a run that is pushed without moving"
        )
    return limit


def faults_of(runs: Sequence[Log], model: Model) -> list[str]:
    """Return the faults of the logs as sentences.

    A log that states no gear is held against the model's.

    Raises
    ------
    InputError
        Where the torsion of a log is none: a wrapped angle, a motor that turns the other way or a
        ratio that is not the stated one; and for errors of `flexspline.logs.check`.
    """
    said = []
    for run in runs:
        findings = check(Log(run.columns, {**model.facts, **run.facts}))
        findings.raise_forbidding("torsion")
        said += [f"{run.name}: {f.sentence} {f.remedy}".rstrip() for f in findings.faults]
    return said


def require_torsion(signals: Mapping[str, Sequence[Signals]]) -> None:
    """Refuse angles whose difference is no torsion of the gear, by the most of rows.

    Raises
    ------
    InputError
        Where more than `MOST_HELD` of the rows are past the end of a compliance's law.
    """
    for name, its in signals.items():
        held = float(np.mean(np.concatenate([s.saturated for s in its])))
        if held > MOST_HELD:
            raise InputError(
                f"c{name}: in {100 * held:.0f} % of the training rows the torsion is past the end "
                "of the compliance law; look for jumps, the unit or the zero of output_position "
                "and motor_position, or fit the torsion's part to this joint"
            )


def warnings_of(
    transitions: Mapping[str, Transition],
    signals: Mapping[str, Sequence[Signals]],
    truth: Sequence[Array],
    reference: str,
) -> list[str]:
    """Return what is to be known of the transitions, the compliances and the reference's sign."""
    said = [f"{name}: {t.warning}" for name, t in transitions.items() if t.warning]
    for name, its in signals.items():
        held = float(np.mean(np.concatenate([s.saturated for s in its])))
        if held > 0.0:
            said.append(
                f"c{name}: in {100 * held:.2g} % of the training rows the torsion is past the end "
                "of the compliance law; its torque is held there and flagged"
            )
        compliance = np.concatenate([s.compliance for s in its])
        along = float(np.corrcoef(compliance, np.concatenate(truth))[0, 1])
        if along < 0.0:
            said.append(
                f"c{name}: {reference} goes against the compliance (correlation {along:.2f}): it "
                "is positive when the joint pushes the outside in +q; turn its sign, or look at "
                "that of the torsion's part"
            )
    return said


def _reads(models: Sequence[Model]) -> set[str]:
    """Channels that the parts for motor torque and torsion read."""
    parts = [
        model.parts[name]
        for model in models
        for name in ("drive", "torsion")
        if name in model.parts
    ]
    return {name for part in parts for effect in part.effects for name in effect.reads}


def _require_numbers(run: Log, names: set[str]) -> None:
    if "motor_torque" not in run:
        names = {*names, "motor_current"}
    for name in (name for name in run.channels if name in names):
        bad = np.flatnonzero(~np.isfinite(run[name]))
        if bad.size:
            raise InputError(
                f"log '{run.name}': {name} is not finite in {bad.size} row"
                f"{'' if bad.size == 1 else 's'}, first in row {bad[0]}; ask for the repair "
                "drop_invalid"
            )
