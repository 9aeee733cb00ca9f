"""What a discovery found: prints, reports itself, and is plain data.

How likely a name is right: its weight among all that may stand behind what it explains.

    p = 1 / (1 + n + (1 − s) + l + exp(−e / 2)),    at most 1 − α

Besides the name, of weight one, there are its n aliases, each as good; a cause without a name, as
far as functions of the channels take its gain from it (a share 1 − s) and leave as much beside it
(l, over its gain); and chance, by what the name gains above its price, e in χ². Weights of
explanations that runs cannot tell apart are equal: p is rather too low than too high.

Base and extended model driven forward through folds that no fit saw: does the motion agree?

Each fold starts from its measured state and is driven by its inputs alone, by the coefficients of
the fit to all other folds.
"""

from __future__ import annotations

import importlib.resources
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import jsonschema
import numpy as np
from numpy.typing import NDArray

from flexspline import __version__
from flexspline.discovery.analysis import Analysis
from flexspline.discovery.evidence import Fold, HeldOut
from flexspline.discovery.faults import DataFault
from flexspline.discovery.model import Working
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.slices import HeldRun, Slice, slices
from flexspline.errors import InputError
from flexspline.fit.result import Fit, Parameter
from flexspline.logs.log import Log
from flexspline.model import PART_OF, Model, Part

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from flexspline.discovery.analysis import Rival
    from flexspline.discovery.confirmation import AlsoSeen
    from flexspline.discovery.slices import Disagreement
    from flexspline.experiment.plan import Plan
    from flexspline.logs.channel_noise import ChannelNoise
    from flexspline.logs.checks.dependence import Dependence
    from flexspline.simulator.record import Simulated

__all__ = [
    "Discovery",
    "DrivenRun",
    "Found",
    "Motion",
    "Unexplained",
    "confidence",
    "discovery_json",
    "driven_apart",
]


def confidence(gain: float, above: float, survives: float, left: float, aliases: int) -> float:
    """Return the probability that a name is right; gains in χ², see the head of this file.

    Parameters
    ----------
    gain, above : what the name gains, and that above its price, by search and final fit.
    survives : share of its gain that it keeps beside functions without a name.
    left : gain of these beside it.
    aliases : how many names explain the runs as well.
    """
    chance = np.exp(-0.5 * max(above, 0.0))
    nameless = 1.0 - float(np.clip(survives, 0.0, 1.0)) + left / max(gain, TINY)
    return float(min(1.0 / (1.0 + aliases + nameless + chance), 1.0 - SETTINGS.alpha))


Array = NDArray[np.float64]

DRIVES = ("motor_torque", "motor_current")


@dataclass(frozen=True, eq=False)
class DrivenRun:
    """One fold: its log, and measured and simulated values (N,) in the channel's unit."""

    log: Log
    measured: Array
    base: Array
    final: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Forward simulation before and after; RMSE in `unit`, over all rows of all folds."""

    channel: str
    unit: str
    runs: tuple[DrivenRun, ...]

    @property
    def base_rmse(self) -> float:
        return self._rmse("base")

    @property
    def final_rmse(self) -> float:
        return self._rmse("final")

    def _rmse(self, which: str) -> float:
        left = np.concatenate([run.measured - getattr(run, which) for run in self.runs])
        return float(np.sqrt(np.nanmean(left**2)))


def driven_apart(
    made: Analysis, before: HeldOut, after: HeldOut, facts: Mapping[str, Any]
) -> Motion | None:
    """Return both models' motion through every fold, None where one of them cannot be driven."""
    problem = made.study.problem
    both = (made.base, made.final)
    alone = problem.simulated is None  # a correction is no joint that can be driven
    if problem.target not in DRIVES or problem.lowpass is not None or not alone:
        return None
    if not all("inertia" in [e.name for e in work.effects] for work in both):
        return None
    try:
        return _driven(made, before, after, dict(facts))
    except InputError:
        return None


def _driven(made: Analysis, before: HeldOut, after: HeldOut, facts: dict[str, Any]) -> Motion:
    from flexspline.forward import simulate

    problem, runs = made.study.problem, []
    for first, last in zip(before.folds, after.folds, strict=True):
        log = problem.runs[first.run].log
        log = log.rows(slice(first.first, first.last), note="one fold")
        one = simulate(_model(made, made.base, first, facts), log)
        two = simulate(_model(made, made.final, last, facts), log)
        runs.append(DrivenRun(log, one.measured, one.simulated, two.simulated))
    return Motion(one.channel, one.unit, tuple(runs))


def _model(made: Analysis, work: Working, fold: Fold, facts: dict[str, Any]) -> Model:
    """The model of the fit that never saw a fold."""
    problem = made.study.problem
    part = Part(problem.target, work.effects, fold.coefficients, problem.known_load)
    return Model({PART_OF[problem.target]: part}, facts)


@dataclass(frozen=True)
class Found:
    """One missing effect, by name.

    Parameters
    ----------
    effect : its name in `CATALOGUE`.
    rmse_before, rmse_after : on folds that the fit never saw, without it and with it, beside
        those found before; in the unit of the target.
    confidence : probability that the name is right.
    indistinguishable_from : effects that explain these runs as well, within the noise.
    where : where it acts.
    evidence : one sentence.
    t : |t| of a normal number that is as surprising as what it gains in the search, or as its
        coefficients in the final fit, whichever is less.
    rivals : the best candidates in its place, the best first.
    coefficients_p : p of Wald's test that all its coefficients are zero in the final fit.
    share_of_gap : of what all names close held out, what is lost without it, −1 … 1.
    """

    effect: str
    rmse_before: float
    rmse_after: float
    confidence: float
    indistinguishable_from: tuple[str, ...]
    where: str
    evidence: str
    t: float
    rivals: tuple[Rival, ...]
    coefficients_p: float = 0.0
    share_of_gap: float = 1.0

    @property
    def runner_up(self) -> str | None:
        """The best other candidate in its place."""
        return self.rivals[0].name if self.rivals else None


@dataclass(frozen=True)
class Unexplained:
    """Structure that no effect explains: its share of the first gap's square above the floor.

    The squares are those of whitened residuals: slow noise does not hide what is left.
    """

    share_of_variance: float
    depends_on: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Discovery:
    """What was missing in a model of these runs.

    Parameters
    ----------
    target, unit : what is explained.
    base_effects : names of the effects that were there.
    found : missing effects, in the order of discovery.
    base_rmse, final_rmse, noise_floor : on folds that the fit never saw; the floor is what no
        channel explains.
    validated_by : "runs" or "blocks", what was left out.
    data_faults : looked for first.
    unexplained : None where the residual is down at the floor.
    next_experiment : a sentence where the runs cannot separate causes, else None.
    plan : what it says, with its trajectory and a figure.
    searched : shares of the rows on which "names" were looked for first, before they were tried
        and fitted on all rows, and on which "functions" without a name were; 1 of short logs.
    also_seen : effects that are real but too small to matter, and no part of the model.
    inputs : noise of each channel of the runs; how they were prepared stands in the model.
    rows : how many are "used", and how many are left out by reason, such as "at rest" or "in a
        stuck tail".
    fit : of the extended model.
    runs : measured and predicted values of base and extended model, on folds no fit saw.
    motion : both driven forward through these folds; None where the model cannot be simulated.
    dependences : channels that are nearly a function of another in these runs.
    by : "regression" of the target; or "simulation": all errors are of the output's angle, rad.
    not_tried : why effects were no candidates, by name. `refused`: why candidates that gained
        were not taken. `doubted`: names that only stood in for an unexplained cause.
    """

    target: str
    unit: str
    base_effects: tuple[str, ...]
    found: tuple[Found, ...]
    base_rmse: float
    final_rmse: float
    noise_floor: float
    validated_by: str
    data_faults: tuple[DataFault, ...]
    unexplained: Unexplained | None
    next_experiment: str | None
    fit: Fit
    runs: tuple[HeldRun, ...]
    motion: Motion | None
    not_tried: Mapping[str, str]
    refused: Mapping[str, str]
    doubted: tuple[str, ...]
    plan: Plan | None = None
    also_seen: tuple[AlsoSeen, ...] = ()
    inputs: tuple[ChannelNoise, ...] = ()
    rows: Mapping[str, int] = field(default_factory=dict)
    by: str = "regression"
    searched: Mapping[str, float] = field(default_factory=lambda: {"names": 1.0, "functions": 1.0})
    dependences: tuple[Dependence, ...] = ()

    @property
    def model(self) -> Model:
        """The extended model: an ordinary one."""
        return self.fit.model

    @property
    def simulated(self) -> Simulated | None:
        """The foreign simulation that is the base, or beneath it; None without one."""
        return self.fit.part.simulated

    @property
    def what(self) -> str:
        """What the errors are of: the target, or the channel that is simulated."""
        return "output_position" if self.by == "simulation" else self.target

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects found, in order."""
        return tuple(found.effect for found in self.found)

    @property
    def gap_closed(self) -> float:
        """Share of the base's mean square above the noise floor that is gone; NaN without a gap."""
        gap = self.base_rmse**2 - self.noise_floor**2
        return (self.base_rmse**2 - self.final_rmse**2) / gap if gap > 0.0 else float("nan")

    def parameters(self, name: str) -> tuple[Parameter, ...]:
        """Return the parameters of one effect, as the fit of the extended model left them."""
        own = (p for p in self.fit.parameters if p.name.split(".")[0] == name)
        return tuple(own)

    @cached_property
    def slices(self) -> tuple[Slice, ...]:
        """RMS before and after in parts of the runs and bands of the residual, held out."""
        return slices(self.runs)

    @cached_property
    def disagreement(self) -> Disagreement:
        """Where the base and the runs disagree, and what is left there; both held out."""
        from flexspline.discovery.slices import disagreement

        return disagreement(self)

    def before_after(self) -> pandas.DataFrame:
        """Return `slices` as a table: rows, RMS before and after in the target's unit, by part.

        The index is group and label, such as ("reversals", "within ±0.1 s of a reversal").
        """
        from dataclasses import asdict

        import pandas

        table = pandas.DataFrame([asdict(part) for part in self.slices])
        return table.set_index(["group", "label"])

    def plot(self) -> Figure:
        """Return a figure: one held-out run before and after, where the gap shrank, orders."""
        from flexspline.plot.discovery import plot_discovery

        return plot_discovery(self)

    def to_json(self) -> str:
        """Return the text of `discovery.json`."""
        return discovery_json(self)

    def __str__(self) -> str:
        from flexspline.report.discovery import discovery_text

        return discovery_text(self)

    def __repr__(self) -> str:
        names = ", ".join(self.names) or "nothing"
        return (
            f"<Discovery in {self.target}: {names}; RMSE {self.base_rmse:.4g} to "
            f"{self.final_rmse:.4g} {self.unit}>"
        )

    def _repr_html_(self) -> str:
        from flexspline.report.discovery import discovery_html

        return discovery_html(self)

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write a self-contained HTML report, whole or not at all."""
        from flexspline.report.discovery import write_discovery_report

        write_discovery_report(self, path)


FORMAT = "flexspline-discovery"
VERSION = 1


def discovery_json(made: Discovery) -> str:
    """Return the text of `discovery.json`, which fits its schema."""
    left = made.unexplained
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"flexspline {__version__}",
        "target": made.target,
        "unit": made.unit,
        "by": made.by,
        "base_effects": list(made.base_effects),
        "simulation": None if made.simulated is None else made.simulated.to_json(),
        "found": [_found(made, one) for one in made.found],
        "rmse": {
            "base": made.base_rmse,
            "final": made.final_rmse,
            "noise_floor": made.noise_floor,
        },
        "also_seen": [
            {
                "effect": one.effect,
                "rmse_before": one.rmse_before,
                "rmse_after": one.rmse_after,
                "rmse_unit": made.unit,
                "share_of_gap": one.share_of_gap,
                "t": one.t,
            }
            for one in made.also_seen
        ],
        "inputs": [_input(made, noise) for noise in made.inputs],
        "bandwidth_hz": _bandwidth(made),
        "rows": dict(made.rows),
        "validated_by": made.validated_by,
        "before_after": [
            {
                "group": part.group,
                "label": part.label,
                "rows": part.rows,
                "base": part.base,
                "final": part.final,
            }
            for part in made.slices
        ],
        "parameters": [_parameter(p) for p in made.fit.parameters],
        "simulated_rmse": None
        if made.motion is None
        else {
            "channel": made.motion.channel,
            "base": made.motion.base_rmse,
            "final": made.motion.final_rmse,
            "unit": made.motion.unit,
        },
        "data_faults": [
            {
                "name": fault.name,
                "channel": fault.channel,
                "size": _number(fault.size),
                "rows": list(fault.rows),
                "unit": fault.unit,
                "run": fault.run,
                "sentence": fault.sentence,
                "makes": None if fault.makes is None else _number(fault.makes),
                "grave": fault.grave,
                "left_out": fault.left_out,
            }
            for fault in made.data_faults
        ],
        "unexplained": None
        if left is None
        else {"share_of_variance": left.share_of_variance, "depends_on": list(left.depends_on)},
        "dependences": [
            {"channel": one.channel, "of": one.of, "left": one.left, "sentence": one.sentence}
            for one in made.dependences
        ],
        "next_experiment": made.next_experiment,
        "not_tried": dict(made.not_tried),
        "refused": dict(made.refused),
        "doubted": list(made.doubted),
        "searched": dict(made.searched),
    }
    jsonschema.Draft202012Validator(_schema()).validate(content)
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _found(made: Discovery, one: Found) -> dict[str, Any]:
    return {
        "effect": one.effect,
        "rmse_before": one.rmse_before,
        "rmse_after": one.rmse_after,
        "rmse_unit": made.unit,
        "share_of_gap": one.share_of_gap,
        "coefficients_p": one.coefficients_p,
        "confidence": one.confidence,
        "indistinguishable_from": list(one.indistinguishable_from),
        "where": one.where,
        "evidence": one.evidence,
        "runner_up": one.runner_up,
        "t": one.t,
        "parameters": [_parameter(p) for p in made.parameters(one.effect)],
    }


def _input(made: Discovery, noise: ChannelNoise) -> dict[str, Any]:
    """What a recorder added to a channel, and how it was prepared for the rows."""
    late = [f.size for f in made.data_faults if "delay" in f.name and f.channel == noise.channel]
    used = [p.bandwidth for p in made.fit.part.preparations if p.channel == noise.channel]
    return {
        "channel": noise.channel,
        "noise": noise.noise,
        "quantum": noise.quantum,
        "delay": _number(float(np.median(late))) if late else None,
        "bandwidth": noise.bandwidth,
        "bandwidth_used": used[0] if used else None,
    }


def _bandwidth(made: Discovery) -> float | None:
    """-3 dB of the output's motion as the rows read it, Hz; None where it is as recorded."""
    motion = (p for p in made.fit.part.preparations if p.channel == "output_velocity")
    return next((one.bandwidth for one in motion), None)


def _parameter(one: Parameter) -> dict[str, Any]:
    return {
        "name": one.name,
        "value": _number(one.value),
        "standard_error": _number(one.standard_error),
        "unit": one.unit,
        "state": one.state,
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


@cache
def _schema() -> dict[str, Any]:
    file = importlib.resources.files("flexspline") / "schemas" / "discovery.schema.json"
    content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return content
