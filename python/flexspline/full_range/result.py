"""The result of `train`: a model for the full range, and the scores of every method.

Scores are as in Table I and Fig. 7 (by speed) of full_range_torque_estimation:

    RMSE = √(mean e²),  bias = mean e,  variance = mean (e − bias)² = RMSE² − bias²,  e = τ̂ − τ

A row moves where |q̇| at the output is at least the motion speed. What the paper counts as motion
is not printed (its own numbers imply 41 % of the rows); so the rule and the share of rows stand
over every table.
"""

from __future__ import annotations

import html
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects.causes import WAVE_GENERATOR
from flexspline.errors import InputError
from flexspline.estimators import Merge
from flexspline.formatting import blocks_text
from flexspline.full_range.methods import (
    GaussianProcess,
    MergeRun,
    Settings,
    Signals,
    StructuralDamping,
    Transition,
    compliant_observer,
    merge_weight,
    merged_by_kalman,
    signals_of,
    two_mass_observer,
)
from flexspline.lazy import render
from flexspline.logs.log import Log
from flexspline.logs.read import as_logs, with_motor_torque
from flexspline.model import Model

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "ErrorScore",
    "ErrorTable",
    "FullRange",
    "SpeedCurve",
    "error_table",
    "speed_curve",
]

Array = NDArray[np.float64]

WIDTH = 100
LEAST_GAIN = 0.5  # %, of which it is worth speaking


GROUPS = ("full", "motion", "no motion")
LEAST_ROWS = 10


@dataclass(frozen=True, repr=False)
class FullRange:
    """Observer and compliance, merged; with the methods that they are compared with.

    Methods by name, as in Table I: "o" observer; "c" compliance, "m" merged, with the name of the
    torsion part where there are several ("c1", "m2"); "sd" structural damping; "gp" Gaussian
    process; "kalman" the rival of the merge; "co" observer of the link whose input is the torque
    through the compliant gear; "mco" observer and "co" merged; "o2" observer with the momentum of
    both sides, where the rotor's inertia is known.

    Parameters
    ----------
    model : with the estimators Observer, Compliance and Merge, for `flexspline.estimate`.
    variants : torsion part's name -> model with it; one, named "", where `train` was given none.
    kept : the name of the one in `model`, that with the least RMSE when merged.
    transitions : method ("m1", "mco") -> α and q̇_trans.
    kalman, damping, process : None where left out.
    curve : RMSE against speed on the training logs.
    training : the table of the training logs.
    settings : gain, margin, motion speed, rotor inertia.
    reference : channel of the true torque.
    wave_generator_share : RMS of the wave generator's term over RMS of the mesh's torsion; zero
        where the torsion part has no such term.
    warnings : sentences.
    """

    model: Model
    variants: Mapping[str, Model]
    kept: str
    transitions: Mapping[str, Transition]
    kalman: Merge | None
    damping: StructuralDamping | None
    process: GaussianProcess | None
    curve: SpeedCurve
    training: ErrorTable
    settings: Settings
    reference: str
    wave_generator_share: float
    warnings: tuple[str, ...]

    @property
    def transition(self) -> Transition:
        """The transition of the merge in `model`."""
        return self.transitions[self.merged]

    @property
    def merged(self) -> str:
        """The method that `model` merges by: "m" with the name of its part, or "mco"."""
        merge = self.model.estimators.get("merge")
        compliant = isinstance(merge, Merge) and merge.at_rest == "compliant_observer"
        return "mco" if compliant else f"m{self.kept}"

    def estimates(self, log: Log) -> dict[str, Array]:
        """Return the external torque by every method, (N,) each, Nm, outward.

        Raises
        ------
        InputError
            Where a channel is missing.
        """
        signals = {name: signals_of(m, log, self.settings) for name, m in self.variants.items()}
        return estimates_of(self, signals, log)

    def saturated(self, log: Log) -> dict[str, NDArray[np.bool_]]:
        """Return the rows, (N,), in which each compliance is held at the end of its law."""
        return {
            f"c{name}": signals_of(m, log, self.settings).saturated
            for name, m in self.variants.items()
        }

    def table(self, logs: Log | Sequence[Log]) -> ErrorTable:
        """Return Table I for these logs, which need the reference torque."""
        runs = as_logs(logs)
        made = [self.estimates(run) for run in runs]
        joined = {name: np.concatenate([run[name] for run in made]) for name in made[0]}
        velocity = np.concatenate([self._signals(run).velocity for run in runs])
        reference = np.concatenate([run[self.reference] for run in runs])
        return error_table(joined, reference, velocity, self.settings.motion_speed)

    def drawn(self, log: Log) -> dict[str, Array]:
        """Return what Fig. 8 draws, (N,) each: reference, torsion, velocity, motor torque, λ."""
        signals = self._signals(log)
        chosen = self.transition
        weight = merge_weight(signals.velocity, chosen.alpha, chosen.transition_velocity)
        nothing = np.full(len(log), np.nan)
        return {
            "time": np.asarray(log["time"]),
            "weight": weight,
            "reference": log.columns.get(self.reference, nothing),
            "torsion": self.model.predict(log, "torsion").measured,
            "velocity": signals.velocity,
            "motor_torque": with_motor_torque(log).columns.get("motor_torque", nothing),
        }

    def plot_speed(self, ax: Axes | None = None) -> Axes:
        """Draw RMSE against speed (Fig. 7)."""
        drawn: Axes = render("full range", "speed", self.curve, ax, transition=self.transition)
        return drawn

    def plot_validation(self, log: Log) -> Figure:
        """Draw torque, torsion, velocity, motor torque and λ of a log (Fig. 8)."""
        drawn: Figure = render("full range", "validation", self, log)
        return drawn

    def plot_torque(self, log: Log, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the estimates of a log beside its reference (Fig. 9)."""
        drawn: Axes = render("full range", "torque", self, log, ax, **options)
        return drawn

    def _signals(self, log: Log) -> Signals:
        return signals_of(self.variants[self.kept], log, self.settings)

    def __str__(self) -> str:
        blocks = [
            textwrap.wrap(f"Full-range torque: {self._verdict()}", WIDTH),
            [_line(name, made) for name, made in self.transitions.items()],
            str(self.training).split("\n"),
            self._remarks(),
        ]
        return blocks_text(blocks)

    def __repr__(self) -> str:
        return f"<FullRange {self.merged}: {self.transition.rmse:.3g} Nm RMSE on its training logs>"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"

    def _verdict(self) -> str:
        score, made = self.training, self.transition
        still = "compliant observer" if self.merged == "mco" else "compliance"
        alone = {"observer": made.rmse_observer, still: made.rmse_compliance}
        best = min(alone, key=lambda name: alone[name])
        gain = 100.0 * (1.0 - made.rmse / alone[best])
        against = (
            f"the {best} alone {alone[best]:.3g} Nm ({gain:.0f} % less)"
            if gain >= LEAST_GAIN
            else f"no better than the {best} alone ({alone[best]:.3g} Nm)"
        )
        return (
            f"{self.merged} has {made.rmse:.3g} Nm RMSE on the training logs, {against}; "
            f"{score.rule}."
        )

    def _wave_generator(self) -> str:
        """How much of the torsion its compliance makes, or that the model has none."""
        if not any(one.name == WAVE_GENERATOR for one in self.model.part("torsion").effects):
            return f"wave generator: the torsion model has no {WAVE_GENERATOR}"
        return (
            f"wave generator: its term is {100 * self.wave_generator_share:.2g} % of the mesh's "
            "torsion (RMS) in the training logs"
            + (": the motor is all but silent" if self.wave_generator_share < 0.02 else "")
        )

    def _remarks(self) -> list[str]:
        said = [self._wave_generator()]
        if self.damping is not None:
            d = self.damping
            said.append(
                f"sd (a reading): B = {d.damping:.3g} Nm·s/rad, T = {d.time_constant:.3g} s, "
                f"τ_0 = {d.initial_torque:.2g} Nm: a spring of {d.stiffness:.3g} Nm/rad that "
                "forgets within T"
            )
        if self.process is not None:
            said.append(self.process.sentence)
        if self.kalman is not None:
            k = self.kalman
            assert k.walk and k.observer_noise and k.compliance_noise  # as Merge checks
            said.append(
                f"kalman: noise at rest and in motion {k.observer_noise[0]:.2g}, "
                f"{k.observer_noise[1]:.2g} Nm (observer), {k.compliance_noise[0]:.2g}, "
                f"{k.compliance_noise[1]:.2g} Nm (compliance), walk {k.walk:.3g} Nm/√s"
            )
        if not self.settings.rotor_inertia > 0.0:
            said.append("co, mco: rotor_inertia is not given, so the link has all the inertia")
        said += [f"Warning: {sentence}" for sentence in self.warnings]
        return [
            line
            for sentence in said
            for line in textwrap.wrap(sentence, WIDTH, initial_indent="- ", subsequent_indent="  ")
        ]


def estimates_of(trained: FullRange, signals: Mapping[str, Signals], log: Log) -> dict[str, Array]:
    """Return what `FullRange.estimates` gives, from signals that are there already."""
    own = signals[trained.kept]
    found = {"o": own.observer}
    found |= {f"c{name}": its.compliance for name, its in signals.items()}
    for name, its in signals.items():
        found[f"m{name}"] = _merged(trained.transitions[f"m{name}"], own, its.compliance)
    if trained.damping is not None:
        found["sd"] = trained.damping.torque(own.time, own.mesh_torsion)
    if trained.process is not None:
        found["gp"] = trained.process.torque(log)
    if trained.kalman is not None:
        run = MergeRun(own.time, own.velocity, own.observer, own.compliance, own.observer)
        found["kalman"] = merged_by_kalman(trained.kalman, run)
    found["co"] = compliant_observer(trained.model, own, trained.settings)
    found["mco"] = _merged(trained.transitions["mco"], own, found["co"])
    if trained.settings.rotor_inertia > 0.0:
        found["o2"] = two_mass_observer(trained.model, own, trained.settings)
    return found


def _merged(chosen: Transition, signals: Signals, still: Array) -> Array:
    """(19): the observer in motion, the other at rest."""
    weight = merge_weight(signals.velocity, chosen.alpha, chosen.transition_velocity)
    return still + weight * (signals.observer - still)


def _line(name: str, made: Transition) -> str:
    low, high = made.velocity_interval
    slow, steep = made.alpha_interval
    return (
        f"{name:<4} α = {made.alpha:.3g} s/rad ({slow:.3g} to {steep:.3g}), q̇_trans = "
        f"{made.transition_velocity:.3g} rad/s ({low:.3g} to {high:.3g}), "
        f"λ(0) = {made.weight_at_rest:.3f}; RMSE {made.rmse:.3f} Nm"
    )


@dataclass(frozen=True)
class ErrorScore:
    """Error of one method on some rows: Nm, and Nm² for the variance; NaN without rows."""

    rows: int
    rmse: float
    variance: float
    bias: float


@dataclass(frozen=True)
class ErrorTable:
    """Errors of several methods, as Table I has them, with a column of bias.

    Parameters
    ----------
    methods : names, such as "m", "o", "c".
    scores : one mapping for each method: "full", "motion", "no motion" -> ErrorScore.
    motion_speed : rad/s at the output from which a row counts as moving.
    motion_share : share of the rows that do.
    """

    methods: tuple[str, ...]
    scores: tuple[Mapping[str, ErrorScore], ...]
    motion_speed: float
    motion_share: float

    def __getitem__(self, method: str) -> Mapping[str, ErrorScore]:
        if method not in self.methods:
            raise InputError(f"the table has no method '{method}'; it has {list(self.methods)}")
        return self.scores[self.methods.index(method)]

    @property
    def rule(self) -> str:
        """What counts as motion, as a sentence."""
        return (
            f"motion: |q̇| ≥ {self.motion_speed:.3g} rad/s at the output, "
            f"{100 * self.motion_share:.0f} % of the rows"
        )

    def improvement(self, method: str, over: str, group: str = "full") -> float:
        """Return by which share the RMSE of a method is below that of another."""
        return 1.0 - self[method][group].rmse / self[over][group].rmse

    def to_frame(self) -> pandas.DataFrame:
        """Return the table: methods by (group, figure)."""
        import pandas

        columns = [(group, name) for group in GROUPS for name in ("rmse", "variance", "bias")]
        values = [[getattr(score[group], name) for group, name in columns] for score in self.scores]
        index = pandas.Index(self.methods, name="method")
        return pandas.DataFrame(values, index=index, columns=pandas.MultiIndex.from_tuples(columns))

    def _repr_html_(self) -> str:
        table = self.to_frame().to_html(float_format="{:.3f}".format, na_rep="–")
        return f"<div>{table}<p>Nm, variance Nm²; {html.escape(self.rule)}</p></div>"

    def __str__(self) -> str:
        head = ["", *(f"{group} [Nm, Nm², Nm]" for group in GROUPS)]
        rows = [head]
        for method, score in zip(self.methods, self.scores, strict=True):
            rows.append([method, *(_cell(score[group]) for group in GROUPS)])
        wide = [max(len(row[k]) for row in rows) for k in range(len(head))]
        lines = [
            "  ".join(cell.ljust(w) for cell, w in zip(row, wide, strict=True)).rstrip()
            for row in rows
        ]
        return "\n".join(["RMSE (variance) bias; " + self.rule, *lines])


@dataclass(frozen=True, eq=False)
class SpeedCurve:
    """RMSE of each method in bands of speed, as Fig. 7.

    Parameters
    ----------
    edges : (B + 1,), rad/s at the output.
    rows : (B,), how many samples each band has.
    rmse, spread : method -> (B,), Nm: over all rows, and the standard deviation over repetitions;
        NaN where there are too few.
    repetitions : what the spread is over, as a sentence.
    """

    edges: Array
    rows: NDArray[np.intp]
    rmse: Mapping[str, Array]
    spread: Mapping[str, Array]
    repetitions: str

    @property
    def speed(self) -> Array:
        """Middles of the bands, rad/s."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))


def error_table(
    estimates: Mapping[str, Array], reference: Array, velocity: Array, motion_speed: float
) -> ErrorTable:
    """Return the errors of estimates (N,) against a reference (N,), Nm, over a velocity (N,)."""
    moving = np.abs(velocity) >= motion_speed
    scores = []
    for torque in estimates.values():
        error = torque - reference
        masks = zip(GROUPS, (np.ones_like(moving), moving, ~moving), strict=True)
        scores.append({group: _score(error[mask & np.isfinite(error)]) for group, mask in masks})
    return ErrorTable(tuple(estimates), tuple(scores), motion_speed, float(np.mean(moving)))


def speed_curve(
    errors: Mapping[str, Array],
    velocity: Array,
    repetition: NDArray[np.intp],
    edges: Sequence[float] | Array,
    repetitions: str,
) -> SpeedCurve:
    """Return RMSE against speed with its spread over repetitions.

    Parameters
    ----------
    errors : method -> (N,), Nm.
    velocity : (N,), rad/s.
    repetition : (N,), number of the run or block of each row, from 0.
    edges : (B + 1,), rad/s.
    repetitions : a sentence about them.
    """
    limits = np.asarray(edges, dtype=np.float64)
    bands, count = len(limits) - 1, int(repetition.max()) + 1
    band = np.searchsorted(limits, np.abs(velocity), side="right") - 1
    inside = (band >= 0) & (band < bands)
    cell = (repetition * bands + band)[inside]
    rows = np.bincount(cell, minlength=count * bands).reshape(count, bands)
    rmse, spread = {}, {}
    for name, error in errors.items():
        weights = error[inside] ** 2
        squares = np.bincount(cell, weights=weights, minlength=count * bands).reshape(count, bands)
        with np.errstate(invalid="ignore", divide="ignore"):
            rmse[name] = np.sqrt(squares.sum(axis=0) / rows.sum(axis=0))
            each = np.sqrt(np.where(rows >= LEAST_ROWS, squares, np.nan) / rows)
        spread[name] = _spread(each)
    return SpeedCurve(limits, rows.sum(axis=0), rmse, spread, repetitions)


def _spread(each: Array) -> Array:
    """Standard deviation over repetitions (R, B) of those that have the band; NaN below two."""
    known = np.isfinite(each)
    count = known.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(known, each, 0.0).sum(axis=0) / count
        squares = np.where(known, (each - mean) ** 2, 0.0).sum(axis=0)
        return np.where(count > 1, np.sqrt(squares / (count - 1)), np.nan)


def _score(error: Array) -> ErrorScore:
    if not len(error):
        return ErrorScore(0, np.nan, np.nan, np.nan)
    bias = float(error.mean())
    return ErrorScore(
        len(error),
        float(np.sqrt(np.mean(error**2))),
        float(np.mean((error - bias) ** 2)),
        bias,
    )


def _cell(score: ErrorScore) -> str:
    if not score.rows:
        return "–"
    return f"{score.rmse:.3f} ({score.variance:.3f}) {score.bias + 0.0:+.3f}"
