"""What `train` gives: a model that estimates over the full range, and how every method did."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.estimators import Merge
from flexspline.full_range.gaussian_process import GaussianProcess
from flexspline.full_range.kalman import MergeRun, merged_by_kalman
from flexspline.full_range.methods import (
    Settings,
    Signals,
    compliant_observer,
    signals_of,
    two_mass_observer,
)
from flexspline.full_range.scores import ErrorTable, SpeedCurve, error_table
from flexspline.full_range.structural_damping import StructuralDamping
from flexspline.full_range.transition import Transition, merge_weight
from flexspline.logs.log import Log
from flexspline.logs.read import with_motor_torque
from flexspline.model import Model
from flexspline.rendering import render

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["FullRange"]

Array = NDArray[np.float64]

WIDTH = 100
LEAST_GAIN = 0.5  # %, of which it is worth speaking


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
    wave_generator_share : RMS of the wave generator's term over RMS of the mesh's torsion.
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
        runs = [logs] if isinstance(logs, Log) else list(logs)
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
        return "\n\n".join("\n".join(block) for block in blocks if block)

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

    def _remarks(self) -> list[str]:
        said = [
            f"wave generator: its term is {100 * self.wave_generator_share:.2g} % of the mesh's "
            "torsion (RMS) in the training logs"
            + (": the motor is all but silent" if self.wave_generator_share < 0.02 else "")
        ]
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
