"""What a discovery found: prints, reports itself, and is plain data."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from flexspline.discovery.driven import Motion
from flexspline.discovery.faults import DataFault
from flexspline.discovery.shrunk import HeldRun, Slice, slices
from flexspline.fit.result import Fit, Parameter
from flexspline.model import Model

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from flexspline.discovery.aliases import Rival
    from flexspline.discovery.confirmation import AlsoSeen
    from flexspline.discovery.disagreement import Disagreement
    from flexspline.experiment.plan import Plan
    from flexspline.logs.channel_noise import ChannelNoise
    from flexspline.logs.checks.dependence import Dependence
    from flexspline.simulator.record import Simulated

__all__ = ["Discovery", "Found", "Unexplained"]


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
        from flexspline.discovery.disagreement import disagreement

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
        from flexspline.discovery.export import discovery_json

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
