"""The result of a discovery: printed, reported, and as plain data.

The probability that a name is right is its weight among all causes of what it explains:

    p = 1 / (1 + n + l + (1 − s) x + exp(−e / 2)),    at most 99 %

Besides the name, of weight one, there are its n aliases, each as good; a cause outside the
catalogue, by what functions of the channels gain beside it (l, over its gain) and, where that is
enough to be said to be unexplained (x from 0 at once that share to 1 at twice), as far as they take
its own gain from it (a share 1 − s); and chance, by its Δχ² above the significance threshold, e.

`Motion` is base and extended model driven forward through held-out folds: each starts from its
measured state and is driven by its inputs alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from flexspline.about import __version__
from flexspline.discovery.analysis import VARIES, Analysis
from flexspline.discovery.faults import DataFault
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.slices import HeldRun, Slice, slices
from flexspline.effects import Effect, Harmonic
from flexspline.effects.causes import INERTIA
from flexspline.errors import InputError, listed
from flexspline.formatting import percent
from flexspline.lazy import Rendered, render
from flexspline.least_squares.options import coefficient_names
from flexspline.least_squares.result import Fit, Parameter
from flexspline.logs.checks.load import unused_load
from flexspline.model import PART_OF, Model, Part, sign_warnings
from flexspline.prepared import bandwidth_used, inputs_json
from flexspline.regression.candidate_model import CandidateModel, Fold
from flexspline.regression.gram import TINY
from flexspline.schema import checked_json

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from flexspline.discovery.analysis import Rival
    from flexspline.discovery.confirmation import AlsoSeen
    from flexspline.discovery.slices import Disagreement
    from flexspline.experiment.plan import Plan
    from flexspline.logs.channel_noise import ChannelNoise
    from flexspline.logs.checks.dependence import Dependence
    from flexspline.orders import Vibration
    from flexspline.simulator import Simulated

__all__ = ["Discovery", "Found", "Motion", "NoiseFloor", "Unexplained", "confidence", "doubt",
           "driven_apart"]  # fmt: skip


def confidence(gain: float, above: float, retained: float, left: float, aliases: int) -> float:
    """Return the probability that a name is right; gains in χ² (see the module docstring).

    Parameters
    ----------
    gain, above : what the name gains, and that above its threshold, by search and final fit.
    survives : share of its gain that it keeps beside functions of a flexible basis.
    left : gain of these beside it.
    aliases : how many names explain the runs as well.
    """
    chance = np.exp(-0.5 * max(above, 0.0))
    flexible = _flexible(gain, retained, left)
    return float(min(1.0 / (1.0 + aliases + flexible + chance), 1.0 - SETTINGS.negligible))


def doubt(gain: float, retained: float, left: float, channels: Sequence[str]) -> str:
    """Return why functions of a flexible basis lower the confidence in a name; "" where little.

    The arguments are those of `confidence`; `channels`: which the functions are of.
    """
    if left <= SETTINGS.bends * gain:
        return ""
    of_these = "this channel" if len(channels) == 1 else "these channels"
    times = left / max(gain, TINY)
    much = f"{percent(times)} of" if times <= 1.0 else f"{times:.1f} times"
    return (
        f" The confidence is lower for functions of {listed(channels)} that no name explains: "
        f"after prewhitening they gain {much} what it does, "
        f"and beside all functions of {of_these} it keeps {percent(max(retained, 0.0))} of that."
    )


def _flexible(gain: float, retained: float, left: float) -> float:
    """The odds against a name of what functions of a flexible basis explain in its place."""
    beside = left / max(gain, TINY)
    beyond = float(np.clip(beside / SETTINGS.bends - 1.0, 0.0, 1.0))
    return beside + beyond * (1.0 - float(np.clip(retained, 0.0, 1.0)))


DRIVES = ("motor_torque", "motor_current")
NOT_SIGNIFICANT, NOT_LOWER = "not significant in the final fit", "does not lower the held-out error"
UNLIKELY = "other effects, or what no name explains, are four times as likely"
UNTOLD = "these runs do not tell its coefficients from those of another name"
FORMED = "no more in the final fit than what the form of another name may miss"
UNSETTLED = "the load that it reads, which the model makes, does not settle beside it"
LESSER = "more of the gap stays unexplained than names explain"
"""Why a name is withdrawn that the search had found."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Forward simulation before and after; RMSE in `unit`, over all rows of all folds."""

    channel: str
    unit: str
    runs: tuple[HeldRun, ...]

    @property
    def base_rmse(self) -> float:
        return self._rmse("base")

    @property
    def final_rmse(self) -> float:
        return self._rmse("final")

    def _rmse(self, which: str) -> float:
        left = np.concatenate([run.measured - getattr(run, which) for run in self.runs])
        return float(np.sqrt(np.nanmean(left**2)))


def driven_apart(made: Analysis, facts: Mapping[str, Any]) -> Motion | None:
    """Return both models' motion through every fold, None where one of them cannot be driven.

    Nor where finer steps give another motion: the least difference decides it there.
    """
    problem = made.context.problem
    both = (made.base, made.final)
    alone = problem.simulated is None  # a correction is no joint that can be driven
    if problem.target not in DRIVES or problem.lowpass is not None or not alone:
        return None
    if not all(INERTIA in [e.name for e in work.effects] for work in both):
        return None
    try:
        return _driven(made, dict(facts))
    except InputError:
        return None


def _driven(made: Analysis, facts: dict[str, Any]) -> Motion | None:
    from flexspline.forward import simulate

    problem, runs = made.context.problem, []
    steps: int | None = None  # as many as the first fold takes
    for first, last in zip(made.before.folds, made.after.folds, strict=True):
        log = problem.runs[first.run].log
        log = log.rows(slice(first.first, first.last), note="one fold")
        one = simulate(_model(made, made.base, first, facts), log, steps_per_sample=steps)
        two = simulate(_model(made, made.final, last, facts), log, steps_per_sample=steps)
        if any(run.step_error > SETTINGS.little * run.rmse for run in (one, two)):
            return None
        steps = steps or max(one.steps_per_sample, two.steps_per_sample)
        runs.append(HeldRun(log, one.measured, one.simulated, two.simulated))
    return Motion(one.channel, one.unit, tuple(runs))


def _model(made: Analysis, work: CandidateModel, fold: Fold, facts: dict[str, Any]) -> Model:
    """The model of the fit that never saw a fold."""
    problem = made.context.problem
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
    coefficients_p : p of the test that all its coefficients are zero in the final fit: Wald's, its
        shapes held; by simulation, F.
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

    @property
    def aliases(self) -> tuple[str, ...]:
        """`indistinguishable_from` in words: of an effect that is in the model, which orders."""
        words = {rival.name: rival.words for rival in self.rivals}
        return tuple(words.get(name, name) for name in self.indistinguishable_from)


@dataclass(frozen=True)
class NoiseFloor:
    """How low the error could get, and what says so: at most this is noise.

    What no channel follows counts as noise: the true floor may be lower. What an encoder resolves
    is its own floor, and no bound of other noise.

    Parameters
    ----------
    rmse : on folds that no fit saw, in the unit of the errors.
    error : its standard error, from blocks longer than the noise's memory; NaN of an encoder, and
        where there is one block alone.
    by : what bounds it, a key of `BOUNDS`.
    """

    rmse: float
    error: float
    by: str


BY_FUNCTIONS, BY_PLACE, BY_RUN, BY_MODE = "functions", "place", "run", "mode"
BY_NAMES, BY_ENCODER = "names", "encoder"
BOUNDS = {
    BY_FUNCTIONS: "what is left beside functions of the channels",
    BY_PLACE: "what is left beside what comes again at the same place in other folds",
    BY_RUN: "what is left with sizes of each run's own",
    BY_MODE: "what is left beside a mode that rings",
    BY_NAMES: "what is left: neither functions of the channels nor places lower it held out",
    BY_ENCODER: "what the encoder resolves",
}
"""What bounds the noise, for `NoiseFloor.by`."""


@dataclass(frozen=True)
class Unexplained:
    """Structure that no effect explains: its share of the first gap's square above the floor.

    The squares are those of whitened residuals: slow noise does not hide what is left.
    `depends_on`: channels, or "run" where effects of the model differ between the runs: `differs`.
    `rings`: Hz, of a mode that the channel excites.
    """

    share_of_variance: float
    depends_on: tuple[str, ...]
    differs: tuple[str, ...] = ()
    rings: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Discovery(Rendered):
    """What was missing in a model of these runs.

    Parameters
    ----------
    target, unit : what is explained.
    base_effects : names of the effects that were there. `base_orders`: of ripple among them, as it
        was given; the fit has those that were found beside these.
    found : missing effects, in the order of discovery.
    base_rmse, final_rmse : on folds that the fit never saw.
    floor : how low that could get, and what says so.
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
        were not taken. `doubted`: spurious names, of an unexplained cause.
    without_directions : `final_rmse` of a model whose friction is the same in both directions;
        None where the model has no friction by direction.
    vibrations : at one frequency, whatever the speed, in what is left held out, where they are much
        of it; they count as noise.
    """

    _kind: ClassVar = "discovery"

    target: str
    unit: str
    base_effects: tuple[str, ...]
    found: tuple[Found, ...]
    base_rmse: float
    final_rmse: float
    floor: NoiseFloor
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
    without_directions: float | None = None
    base_orders: Mapping[str, tuple[Harmonic, ...]] = field(default_factory=dict)
    vibrations: tuple[Vibration, ...] = ()

    @property
    def model(self) -> Model:
        """The extended model: an ordinary one."""
        return self.fit.model

    @property
    def simulated(self) -> Simulated | None:
        """The foreign simulation that is the base, or beneath it; None without one."""
        return self.fit.part.simulated

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence for each sign that no drive has, and for a known load that was not used."""
        part, logs = self.fit.part, [run.log for run in self.fit.runs]
        return (*sign_warnings(part), *unused_load(logs, self.target, part.known_load))

    @property
    def what(self) -> str:
        """What the errors are of: the target, or the channel that is simulated."""
        return "output_position" if self.by == "simulation" else self.target

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects found, in order."""
        return tuple(found.effect for found in self.found)

    @property
    def withdrawn(self) -> dict[str, str]:
        """Names that the search found and these runs do not bear out, with the reason."""
        whys = (NOT_SIGNIFICANT, NOT_LOWER, UNTOLD, FORMED, UNLIKELY, LESSER, VARIES)
        return {name: why for name, why in self.refused.items() if why.startswith(whys)}

    @property
    def noise_floor(self) -> float:
        """How low the error could get, in `unit`; `floor` says how that is known."""
        return self.floor.rmse

    @property
    def gap_closed(self) -> float:
        """Share of the base's mean square above the noise floor that is gone; NaN without a gap.

        1 where the floor is what is left (`floor.by` is "names"): none of it is known to be gap.
        """
        gap = self.base_rmse**2 - self.noise_floor**2
        return (self.base_rmse**2 - self.final_rmse**2) / gap if gap > 0.0 else float("nan")

    def parameters(self, name: str) -> tuple[Parameter, ...]:
        """Return the parameters of one effect, as the fit of the extended model left them.

        Of a ripple of which more orders were found these orders alone.
        """
        given = self.base_orders.get(name, ()) if name in self.names else ()
        known = {*coefficient_names([Effect(name, harmonics=given)])} if given else {*()}
        own = (p for p in self.fit.parameters if p.name.split(".")[0] == name)
        return tuple(p for p in own if p.name not in known)

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
        import pandas

        table = pandas.DataFrame([asdict(part) for part in self.slices])
        return table.set_index(["group", "label"])

    def plot(self) -> Figure:
        """Return a figure: one held-out run before and after, where the gap shrank, orders."""
        return render("discovery", "figure", self)

    def to_json(self) -> str:
        """Return the text of `discovery.json`."""
        return discovery_json(self)

    def __repr__(self) -> str:
        names = ", ".join(self.names) or "nothing"
        return (
            f"<Discovery in {self.target}: {names}; RMSE {self.base_rmse:.4g} to "
            f"{self.final_rmse:.4g} {self.unit}>"
        )


FORMAT = "flexspline-discovery"
VERSION = 1


def discovery_json(made: Discovery) -> str:
    """Return the text of `discovery.json`, which fits its schema."""
    ways, motion, unit = made.fit.part.preparations, made.motion, {"rmse_unit": made.unit}
    content = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"flexspline {__version__}",
        "target": made.target,
        "unit": made.unit,
        "by": made.by,
        "base_effects": made.base_effects,
        "simulation": None if made.simulated is None else made.simulated.to_json(),
        "found": [_found(made, one) for one in made.found],
        "rmse": {"base": made.base_rmse, "final": made.final_rmse, "noise_floor": made.noise_floor},
        "noise_floor_error": made.floor.error if np.isfinite(made.floor.error) else None,
        "noise_floor_method": BOUNDS[made.floor.by],
        "also_seen": [asdict(one) | unit for one in made.also_seen],
        "inputs": [
            one | {"delay": _delay(made, one["channel"])} for one in inputs_json(made.inputs, ways)
        ],
        "bandwidth_hz": bandwidth_used(ways),
        "rows": made.rows,
        "validated_by": made.validated_by,
        "before_after": [asdict(part) for part in made.slices],
        "parameters": [_parameter(one) for one in made.fit.parameters],
        "simulated_rmse": None
        if motion is None
        else {
            "channel": motion.channel,
            "base": motion.base_rmse,
            "final": motion.final_rmse,
            "unit": motion.unit,
        },
        "data_faults": [asdict(fault) for fault in made.data_faults],
        "warnings": made.warnings,
        "unexplained": None if made.unexplained is None else asdict(made.unexplained),
        "dependences": [
            {"channel": one.channel, "of": one.of, "left": one.left, "sentence": one.sentence}
            for one in made.dependences
        ],
        "vibrations": [
            {"frequency": one.frequency, "amplitude": one.amplitude, "error": one.error}
            for one in made.vibrations
        ],
        **{name: getattr(made, name) for name in PLAIN},
    }
    return checked_json(content, "discovery")


PLAIN = ("next_experiment", "not_tried", "refused", "doubted", "searched")


def _found(made: Discovery, one: Found) -> dict[str, Any]:
    own = {f.name: getattr(one, f.name) for f in fields(one) if f.name != "rivals"}
    return own | {
        "rmse_unit": made.unit,
        "runner_up": one.runner_up,
        "parameters": [_parameter(p) for p in made.parameters(one.effect)],
    }


def _delay(made: Discovery, channel: str) -> float | None:
    late = [f.size for f in made.data_faults if "delay" in f.name and f.channel == channel]
    return float(np.median(late)) if late else None


def _parameter(one: Parameter) -> dict[str, Any]:
    return {
        name: getattr(one, name) for name in ("name", "value", "standard_error", "unit", "state")
    }
