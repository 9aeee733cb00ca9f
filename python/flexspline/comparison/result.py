"""What a comparison found: prints, draws itself, and is plain data."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from flexspline.comparison.bands import Band, OrderPeak, worst_band
from flexspline.comparison.locate import Place
from flexspline.comparison.runs import ComparedRun
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.rendering import render

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from flexspline.logs.channel_noise import ChannelNoise
    from flexspline.orders import OrderAnalysis
    from flexspline.prepared import Preparation

__all__ = ["Comparison", "Follows", "Remembered", "ranked"]


@dataclass(frozen=True)
class Follows:
    """One thing that the residual follows, the most telling first.

    `name`: key of `Comparison.by`; `words` for it in sentences. `gain`: mean square that it
    explains once those before it are taken out, squared unit; `share` of the gap's square above
    the floor. `chance`: that noise alone does so. `also`: what would explain nearly as much.
    `place`: where on its axis it is large; None for orders of what turns.
    """

    name: str
    words: str
    gain: float
    share: float
    chance: float
    also: tuple[str, ...]
    place: Place | None


@dataclass(frozen=True)
class Remembered:
    """The noise's memory: order of the model, seconds; and the velocity's noise, rad/s."""

    order: int
    seconds: float
    innovation: float
    velocity: float
    velocity_matters: bool


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Where a model and runs disagree. Numbers in `unit`.

    Parameters
    ----------
    what : the target, or the channel of a simulation that is compared.
    unit : of measured, modelled and all errors.
    simulated : by forward simulation, else by prediction.
    lowpass : Hz, or None.
    runs : measured and modelled values, row by row.
    overall : all rows.
    by : bands of "run", "direction", "speed", "load", "temperature", "position",
        "acceleration", "reversal_angle", "reversal_time", "time", as far as there are channels.
    units, words : of the names in `by`.
    orders : of what turns that the residual holds, the largest first.
    follows : what the residual follows, the most telling first; empty at the noise floor.
    makes_no_difference : in words, what it does not follow.
    memory : of the noise.
    load_source : where the load is from, "" where it is not known.
    spectrum : of the residual over the output's orders, or None where it does not turn.
    foreign : the foreign simulation that is the base, in words; "" without one.
    notes : sentences on it: rows of which it says nothing, delays.
    inputs : noise of each channel of the runs; of a prediction.
    preparations : how channels were made before the model read them.
    bandwidth : Hz, of the output's motion, as it was asked for; None: as model or runs tell.
    """

    what: str
    unit: str
    simulated: bool
    lowpass: float | None
    runs: tuple[ComparedRun, ...]
    overall: Band
    by: Mapping[str, tuple[Band, ...]]
    units: Mapping[str, str]
    words: Mapping[str, str]
    orders: tuple[OrderPeak, ...]
    follows: tuple[Follows, ...]
    makes_no_difference: tuple[str, ...]
    memory: Remembered
    load_source: str
    spectrum: OrderAnalysis | None
    facts: Mapping[str, Any]
    foreign: str = ""
    notes: tuple[str, ...] = ()
    inputs: tuple[ChannelNoise, ...] = ()
    preparations: tuple[Preparation, ...] = ()
    bandwidth: float | None = None

    @property
    def rmse(self) -> float:
        """Root mean square of measured less modelled."""
        return self.overall.rmse

    @property
    def noise_floor(self) -> float:
        """RMS of what no channel explains."""
        return self.overall.noise_floor

    @property
    def excess(self) -> float:
        """RMS of the gap above the noise floor."""
        return self.overall.excess

    @cached_property
    def sentences(self) -> tuple[str, str]:
        """How large the gap is, and where."""
        from flexspline.comparison.says import sentences

        return sentences(self)

    def __getitem__(self, name: str) -> tuple[Band, ...]:
        """Return the bands of one covariate, such as "speed"."""
        if name not in self.by:
            raise InputError(
                f"the comparison has no '{name}'{did_you_mean(name, self.by)}; it has "
                f"{listed(self.by)}"
            )
        return self.by[name]

    def to_frame(self) -> pandas.DataFrame:
        """Return all bands as a table, by covariate and label."""
        from dataclasses import asdict

        import pandas

        rows = [{"covariate": "all", **asdict(self.overall)}]
        rows += [{"covariate": name, **asdict(b)} for name, bands in self.by.items() for b in bands]
        return pandas.DataFrame(rows).set_index(["covariate", "label"])

    def to_json(self) -> str:
        """Return the text of `comparison.json`."""
        from flexspline.comparison.export import comparison_json

        return comparison_json(self)

    def __str__(self) -> str:
        return render("comparison", "text", self)

    def __repr__(self) -> str:
        return (
            f"<Comparison of {self.what}: {len(self.runs)} runs, RMSE {self.rmse:.4g} {self.unit}, "
            f"noise floor {self.noise_floor:.4g} {self.unit}>"
        )

    def _repr_html_(self) -> str:
        return render("comparison", "html", self)

    def plot(self) -> Figure:
        """Return the map: excess over the floor against each covariate, the worst first."""
        return render("comparison", "figure", self)

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write a self-contained HTML report, whole or not at all."""
        render("comparison", "report", self, path)


def ranked(made: Comparison) -> list[str]:
    """Return the names of `made.by`, what the gap follows first, then by their worst band."""
    first = [f.name for f in made.follows if f.name in made.by]
    rest = [name for name in made.by if name not in first]
    return [*first, *sorted(rest, key=lambda name: -worst_band(made.by[name]).excess)]
