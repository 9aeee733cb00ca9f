"""The result of a fit: a model, its errors, its scores, and the contribution of each effect.

Effects that are indistinguishable contribute only as their sum.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, overload

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import UNITS
from flexspline.errors import InputError
from flexspline.formatting import Page, plus_minus
from flexspline.forward.servo import PositionServo
from flexspline.lazy import Rendered, render
from flexspline.least_squares.derived import Derived, derived_of
from flexspline.least_squares.identifiability import Confounded
from flexspline.least_squares.options import Bounds, coefficient_names
from flexspline.least_squares.uncertainty import Uncertainty, half_widths
from flexspline.least_squares.validation import Score
from flexspline.logs.derive import lowpass
from flexspline.logs.log import Log
from flexspline.logs.read import LogLike
from flexspline.model import Model, Part, Prediction, Predictions

if TYPE_CHECKING:
    from os import PathLike

    import pandas

    from flexspline.least_squares.estimate import Estimate
    from flexspline.least_squares.late_load import LateLoad
    from flexspline.least_squares.likelihood import Likelihood
    from flexspline.least_squares.per_run_terms import BetweenRuns
    from flexspline.least_squares.profile import Contour, Profile
    from flexspline.logs.channel_noise import ChannelNoise

__all__ = [
    "SINGULAR",
    "TINY",
    "Delay",
    "Fit",
    "FittedRun",
    "Parameter",
    "Params",
    "RunGap",
    "SimulationFit",
    "StartEnd",
    "contributions",
    "parameters_frame",
    "shares",
    "wald",
]


Array = NDArray[np.float64]

_FIELDS = ("rmse", "held_out", "regression")
_NOT_KEPT = ("degrees_of_freedom", "bounds", "logarithmic")
"""Of a parameter, what only the fit that was just made needs."""
TINY = float(np.finfo(float).tiny)  # in the place of a nothing that something is divided by
SINGULAR = 1e-9
"""Of the largest eigenvalue of scaled products: below, columns depend on each other; and of any
quantity, that is rounding. Squares have half the digits of a double."""


@dataclass(frozen=True)
class Parameter:
    """A coefficient or a shape, as the fit left it.

    Parameters
    ----------
    name : "effect.term", "effect.shape", "direction_width" or "controller.field".
    kind : "coefficient", "shape" or, of a fit by simulation, "controller".
    value, standard_error : in `unit`; the error is NaN where there is none (fixed, at a bound).
    naive_error : as if the noise were white, for comparison.
    interval : ends of the 95 % confidence interval; NaN where too few independent samples tell how
        far off the value is.
    state : "fitted", "fixed", "at lower bound", "at upper bound" or "not determined".
    determined : whether the data (and priors) determine it by itself.
    prior : (value, standard error) it was given, or None.
    effective_samples : independent samples that its error is worth.
    degrees_of_freedom : of Student's t behind the interval; NaN where there is none.
    bounds : (low, high) in `unit` that held it, None for an open end; None: not bounded.
    logarithmic : whether the interval is that of ln(value): of a fit of the motion.
    """

    name: str
    kind: str
    value: float
    standard_error: float
    naive_error: float
    interval: tuple[float, float]
    unit: str
    state: str
    determined: bool
    prior: tuple[float, float] | None
    effective_samples: float
    degrees_of_freedom: float = float("nan")
    bounds: Bounds | None = None
    logarithmic: bool = False

    @property
    def significant(self) -> bool:
        """Whether the interval leaves out zero; not where there is none."""
        return self.interval[0] > 0.0 or self.interval[1] < 0.0

    @property
    def error_known(self) -> bool:
        """Whether there is an interval: its ends are NaN where the noise leaves too little."""
        return bool(np.isfinite(self.interval).all())

    @property
    def stderr(self) -> float:
        """The standard error; NaN where fixed, at a bound, not determined or not known."""
        return self.standard_error if self.determined and self.error_known else float("nan")

    @property
    def fixed(self) -> bool:
        """Whether its value was given and not fitted."""
        return self.state == "fixed"

    def ci(self, level: float = 0.95) -> tuple[float, float]:
        """Return the ends of a confidence interval, in `unit`, by its standard error (Wald).

        Parameters
        ----------
        level : between 0 and 1; at 0.95 it is `interval` where there is a standard error.

        Returns
        -------
        (low, high), NaN where there is no standard error or it is not known. For an interval that
        need not be symmetric see `Fit.profile`.

        Raises
        ------
        InputError
            For a level that is not between 0 and 1.
        """
        half = float(half_widths(self.stderr, self.degrees_of_freedom, level))
        if not self.logarithmic:
            return self.value - half, self.value + half
        low, high = self.bounds or (None, None)
        ends = self.value * np.exp(np.array([-half, half]) / self.value)
        low, high = np.clip(ends, low, high).tolist()
        return low, high

    def __repr__(self) -> str:
        return f"<Parameter {self}>"

    def __str__(self) -> str:
        if not self.determined:
            return f"{self.name}: not determined"
        remark = "" if self.state == "fitted" else f" ({self.state})"
        return f"{self.name} = {plus_minus(self.value, self.stderr)} {self.unit}{remark}"

    def to_json(self) -> dict[str, Any]:
        """Return the parameter as `model.json` keeps it."""
        return {key: value for key, value in asdict(self).items() if key not in _NOT_KEPT}


def parameters_frame(parameters: Iterable[Parameter]) -> pandas.DataFrame:
    """Return parameters as a table by their names; NaN for what is not determined."""
    import pandas

    rows = {
        p.name: {
            "value": p.value if p.determined else np.nan,
            "standard_error": p.stderr,
            "unit": p.unit,
            "lower": p.interval[0] if p.determined else np.nan,
            "upper": p.interval[1] if p.determined else np.nan,
            "state": p.state,
            "determined": p.determined,
            "naive_error": p.naive_error,
        }
        for p in parameters
    }
    return pandas.DataFrame(list(rows.values()), index=list(rows)).rename_axis("parameter")


@dataclass(frozen=True, eq=False)
class FittedRun:
    """One run with its target and residuals, arrays (N,) in the unit of the target.

    `log` has the derived channels. `counts`: rows that the fit used. `held_out`: residuals of
    fits that never saw the row, NaN where it does not count.
    """

    log: Log
    measured: Array
    predicted: Array
    held_out: Array
    counts: NDArray[np.bool_]

    @property
    def residual(self) -> Array:
        return self.measured - self.predicted


@dataclass(frozen=True)
class Delay:
    """By how much a channel is later than the target, s, with its standard error.

    `rmse`: what that makes of the residual, in the unit of the target.
    """

    channel: str
    seconds: float
    standard_error: float
    rmse: float


@dataclass(frozen=True, eq=False)
class Fit(Rendered):
    """The result of `fit`: prints as a verdict, one line for each term.

    Parameters
    ----------
    model : ready to predict, save and export.
    parameters : coefficients and shapes, in the order of the effects.
    confounded : groups that the data cannot tell apart, with what is known of them.
    runs : targets and residuals.
    scores : overall (first), by run, direction, speed, temperature, near reversals.
    validated_by : "runs", "blocks" or "folds of runs": what the cross-validation left out, and
        `folds` of them.
    uncertainty : covariance and noise model behind the errors.
    warnings : sentences about the logs and the fit.
    exact : whether the sums had to be double-double.
    condition : of the design, columns scaled to length one.
    orders : the analysis that found the orders of ripple effects, or None.
    simulation : of a fit by simulation: how far the motion is missed, and how it was searched.
        The parameters, errors and `folds` are then those of the motion, `noise` the regression's.
    inputs : noise of each channel of the runs; how they were prepared stands in the model.
    delay : of the known load behind the target, beside which the parameters were found; None where
        the load is exact, or an effect is such a delay.
    bandwidth : Hz, of the output's motion, as it was asked for; None: as the runs tell.
    solved : the estimate with the rows that it was made from, from which likelihood and profiles
        are computed when they are asked for; None of a fit of the motion.
    late : the delay of the load as the estimate was made beside it, or None.
    between_runs : of each term that runs have of their own (`FitOptions.per_run`): its values, mean
        and spread between the runs, and whether they differ. The model predicts with the mean.
    """

    _kind: ClassVar = "fit"

    model: Model
    target: str
    parameters: tuple[Parameter, ...]
    confounded: tuple[Confounded, ...]
    runs: tuple[FittedRun, ...]
    scores: tuple[Score, ...]
    validated_by: str
    folds: int
    uncertainty: Uncertainty
    covariance: Array
    lowpass: float | None
    warnings: tuple[str, ...]
    exact: bool
    condition: float
    orders: Any
    simulation: SimulationFit | None = None
    inputs: tuple[ChannelNoise, ...] = ()
    delay: Delay | None = None
    bandwidth: float | None = None
    solved: Estimate | None = field(default=None, repr=False, compare=False)
    late: LateLoad | None = field(default=None, repr=False, compare=False)
    between_runs: tuple[BetweenRuns, ...] = ()

    @property
    def part(self) -> Part:
        """The part of the model that this fit made."""
        return self.model.part(self.target)

    @property
    def unit(self) -> str:
        """Unit of the target."""
        return UNITS[self.target]

    @property
    def generalised(self) -> bool:
        """Whether rows were filtered by the noise's memory (`least_squares/assemble.py`)."""
        return bool(self.part.record["noise"].get("filtered", False))

    @property
    def score(self) -> Score:
        """The score of all rows."""
        return self.scores[0]

    @property
    def rmse(self) -> float:
        """Root mean square of the residual, in the unit of the target."""
        return self.score.rmse

    @property
    def cv_rmse(self) -> float:
        """The same on rows that the fit never saw."""
        return self.score.cv_rmse

    def __getitem__(self, name: str) -> Parameter:
        """Return a parameter by "effect.term", or by one part of it if that is unique."""
        from flexspline.least_squares.options import resolve

        names = [parameter.name for parameter in self.parameters]
        return self.parameters[resolve(name, names, "fit")]

    @property
    def params(self) -> Params:
        """The parameters by name; prints as a table."""
        return Params(self)

    @cached_property
    def likelihood(self) -> Likelihood:
        """Gaussian likelihood of the rows under the fit's noise (`least_squares/likelihood.py`).

        Raises
        ------
        InputError
            For a robust fit and for a fit of the motion, which have none.
        """
        from flexspline.least_squares.likelihood import likelihood_of

        return likelihood_of(self)

    @property
    def aic(self) -> float:
        """Akaike's information criterion, −2 ln L + 2 k [Akaike1974].

        L is the likelihood of generalised least squares in the fit's own noise (autoregressive, not
        white), k the effective number of parameters, with those of the noise. It can be compared
        between fits to the same rows of the same target alone (equal runs, target, known load, low
        pass and rows that count); a difference below 2 tells nothing.

        Raises
        ------
        InputError
            As `likelihood`.
        """
        return self.likelihood.aic

    @property
    def bic(self) -> float:
        """Schwarz's (Bayesian) information criterion, −2 ln L + k ln N [Schwarz1978].

        To be compared, and refused, as `aic`.
        """
        return self.likelihood.bic

    def report(
        self,
        path: str | PathLike[str],
        *,
        beside: Sequence[Profile | Contour] = (),
        refused: Sequence[str] = (),
    ) -> None:
        """Write a self-contained HTML report, whole or not at all.

        Parameters
        ----------
        path : of the page.
        beside : profiles and regions of the parameters, to be shown with the fit.
        refused : why there is none of what was asked for, a sentence each.
        """
        render("fit", "report", self, path, beside, refused)

    def profile(self, name: str, level: float = 0.95, *, points: int = 20) -> Profile:
        """Return how the squares rise around a parameter, and the interval that follows.

        All others are fitted again at each value. Scaled by the noise of the fit, so that it holds
        under autocorrelation; of a shape, whose squares are no parabola, it is not symmetric.

        Parameters
        ----------
        name : as `fit[name]` takes it; a coefficient or a shape.
        level : of the interval.
        points : of the profile between its ends, beside those that finding the ends asked.

        Returns
        -------
        Profile
            ``interval`` has None for an end that lies beyond the parameter's bound.

        Raises
        ------
        InputError
            For an unknown name, a parameter without an error (fixed, at a bound, confounded), and a
            fit of the motion or by generalised least squares.
        """
        from flexspline.least_squares.profile import profile_of

        return profile_of(self, name, level, points)

    def contour(self, one: str, other: str, level: float = 0.95, *, points: int = 24) -> Contour:
        """Return the region in which two parameters lie together, by profiles around it.

        Parameters
        ----------
        one, other : as for `profile`.
        level : of both together.
        points : around the region.

        Returns
        -------
        Contour
            ``points`` are NaN where the region does not end within bounds.

        Raises
        ------
        InputError
            As `profile`.
        """
        from flexspline.least_squares.profile import contour_of

        return contour_of(self, (one, other), level, points)

    @cached_property
    def derived(self) -> tuple[Derived, ...]:
        """Quantities that follow from the parameters, such as a stiffness from a compliance."""
        return derived_of(self)

    @cached_property
    def effective_samples(self) -> float:
        """Independent samples that the runs are worth for a mean."""
        return self.uncertainty.effective_samples

    @overload  # a name of a file is one log
    def predict(  # type: ignore[overload-overlap]
        self, log: LogLike
    ) -> Prediction: ...
    @overload
    def predict(self, log: Iterable[LogLike]) -> Predictions: ...
    def predict(self, log: LogLike | Iterable[LogLike]) -> Prediction | Predictions:
        """Return measured and predicted y of any log, or of several; see `Model.predict`."""
        return self.model.predict(log, self.target)

    def shares(self) -> dict[str, float]:
        """Return each effect's RMS contribution over all rows, by name, in the target's unit.

        Indistinguishable effects come as one, "a + b".
        """

        return shares(self)

    def to_frame(self) -> pandas.DataFrame:
        """Return the parameters as a table."""
        return parameters_frame(self.parameters)

    def covariance_frame(self) -> pandas.DataFrame:
        """Return the covariance of the parameters, rows and columns by name, in their units.

        NaN where there is none: in rows and columns of parameters that are fixed, at a bound or not
        determined by the data; and, where many runs have terms of their own, between such a term
        and all others.
        """
        import pandas

        names = [p.name for p in self.parameters]
        errors = np.array([p.stderr for p in self.parameters])
        frame = pandas.DataFrame(np.diag(errors**2), index=names, columns=names)
        frame = frame.where(np.eye(len(names), dtype=bool))
        kept = self.part.record["covariance"]["names"]
        known = [k for k, name in enumerate(kept) if np.isfinite(self.params[name].stderr)]
        own = [kept[k] for k in known]
        frame.loc[own, own] = self.covariance[np.ix_(known, known)]
        return frame.rename_axis(index="parameter", columns="parameter")

    def correlation_frame(self) -> pandas.DataFrame:
        """Return the correlation of the parameters, −1 … 1, rows and columns by name.

        NaN where `covariance_frame` is.
        """
        frame = self.covariance_frame()
        errors = np.sqrt(np.diag(frame))
        with np.errstate(divide="ignore", invalid="ignore"):  # without any noise no error
            return frame.div(errors, axis="index").div(errors, axis="columns")

    def summary(self) -> str:
        """Return target, rows, noise, errors, criteria and parameters as a text of one page."""
        return Page(render("fit", "summary", self))

    def scores_frame(self) -> pandas.DataFrame:
        """Return the scores as a table."""
        from dataclasses import asdict

        import pandas

        return pandas.DataFrame([asdict(s) for s in self.scores]).set_index(["group", "label"])

    def __repr__(self) -> str:
        return (
            f"<Fit of {self.target}: {len(self.parameters)} parameters, RMSE {self.rmse:.4g} "
            f"{self.unit}, held out {self.cv_rmse:.4g} {self.unit}>"
        )

    def plot(self) -> Any:
        """Return a figure: measured against predicted, residuals, components, orders."""
        return render("fit", "figure", self)


def contributions(fit: Fit, run: FittedRun) -> dict[str, Array]:
    """Return the contribution (N,) of each effect of a fit to a run, in the target's unit.

    Effects that share a confounded group are summed and called "a + b", since only that is known.
    The low pass of the fit is applied.
    """
    parts = fit.model.components(run.log, fit.target)
    time = run.log["time"]
    found = {}
    for group in _groups(fit, list(parts)):
        total = np.sum([parts[name] for name in group], axis=0)
        smooth = total if fit.lowpass is None else lowpass(total, time, fit.lowpass).values
        found[" + ".join(group)] = smooth
    return found


def shares(fit: Fit) -> dict[str, float]:
    """Return the RMS contribution of each effect over all rows, in the unit of the target."""
    squares: dict[str, float] = {}
    count = sum(int(run.counts.sum()) for run in fit.runs)
    for run in fit.runs:
        for name, values in contributions(fit, run).items():
            squares[name] = squares.get(name, 0.0) + float(np.nansum(values[run.counts] ** 2))
    return {name: float(np.sqrt(total / count)) for name, total in squares.items()}


def wald(
    fit: Fit, name: str, *, held: bool = False, terms: Collection[str] | None = None
) -> tuple[float, int]:
    """Return Wald's χ² of all fitted coefficients of an effect, and how many they are.

    ∞ of coefficients without error; 0 and 1 where none is fitted. `held`: with the effect's own
    shapes where they are. `terms`: names of some of its coefficients, for these alone.
    """
    known = fit.part.record["covariance"]["names"]
    every = {n for n in coefficient_names(fit.part.effects) if n.split(".")[0] == name}
    values = {p.name: p.value for p in fit.parameters}
    at = [k for k, own in enumerate(known) if own in every and (terms is None or own in terms)]
    if not at:
        return 0.0, 1
    beta = np.array([values[known[k]] for k in at])
    spread = fit.covariance[np.ix_(at, at)]
    own = [k for k, n in enumerate(known) if n.split(".")[0] == name and n not in every]
    if held and own:
        across = fit.covariance[np.ix_(own, at)]
        shapes = np.linalg.pinv(fit.covariance[np.ix_(own, own)], SINGULAR, hermitian=True)
        spread = spread - across.T @ shapes @ across
    scale = np.sqrt(np.maximum(np.diag(spread), TINY))
    if np.all(scale <= SINGULAR * np.abs(beta)):
        return np.inf, len(at)  # runs without noise
    scaled = spread / np.outer(scale, scale)
    told = np.linalg.lstsq(scaled, beta / scale, rcond=SINGULAR)[0]
    return float((beta / scale) @ told), len(at)


def _groups(fit: Fit, effects: list[str]) -> list[list[str]]:
    """Effects in their order, joined where a confounded group holds coefficients of several."""
    groups = [[name] for name in effects]
    for confounded in fit.confounded:
        tied = {name.split(".")[0] for name in confounded.names}
        joined = [name for group in groups if tied & set(group) for name in group]
        at = next((k for k, group in enumerate(groups) if tied & set(group)), 0)
        rest = [group for group in groups if not tied & set(group)]
        groups = [*rest[:at], joined, *rest[at:]] if joined else rest
    return groups


@dataclass(frozen=True)
class RunGap:
    """RMS [rad] of simulated − measured position of one run.

    `rmse`: as fitted. `held_out`: by the fits that never counted the row. `regression`: by the
    parameters of the ordinary regression.
    """

    name: str
    rows: int
    rmse: float
    held_out: float
    regression: float


@dataclass(frozen=True)
class StartEnd:
    """One start: RMS [rad] where it began and where it ended, and the parameters of the end."""

    first_rmse: float
    rmse: float
    evaluations: int
    values: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class SimulationFit:
    """The record of a fit by simulation, `Fit.simulation`.

    Parameters
    ----------
    runs : gap of each run.
    starts : all of them: from the regression, from short pieces of the runs, then drawn ones.
    names : of the parameters that were searched.
    regressed, fitted : their values, (P,).
    folds : (K, P): values without each fold; `folds_by` says what a fold is.
    controller : the law with its fitted fields, or None where the motor's torque is measured.
    steps_per_sample : of the simulation.
    logs : that were simulated, as recorded: the rows of a torque may read a smoothed motion.
    """

    runs: tuple[RunGap, ...]
    starts: tuple[StartEnd, ...]
    names: tuple[str, ...]
    regressed: tuple[float, ...]
    fitted: tuple[float, ...]
    folds: Array
    folds_by: str
    controller: PositionServo | None
    steps_per_sample: int
    logs: tuple[Log, ...] = field(repr=False)

    @property
    def rmse(self) -> float:
        """RMS over the rows of all runs, rad."""
        return self._overall("rmse")

    @property
    def held_out(self) -> float:
        """The same by fits that never counted the row."""
        return self._overall("held_out")

    @property
    def regression(self) -> float:
        """The same by the ordinary regression."""
        return self._overall("regression")

    @property
    def best_starts(self) -> int:
        """How many starts ended within 2 % of the best."""
        ends = np.array([start.rmse for start in self.starts])
        return int((ends <= 1.02 * ends.min()).sum())

    @property
    def ends(self) -> str:
        """Where each start ended, in words."""
        ends = ", ".join(_milli(start.rmse) for start in self.starts)
        return f"Starts ended at {ends} mrad, the regression's first."

    @property
    def verdict(self) -> str:
        """How far the simulated motion is off on held-out rows, and what the fit gained."""
        law = "under the servo's law" if self.controller else "by the measured motor"
        return (
            f"Driven {law}, the simulated position is off by {_angle(self.held_out)} RMS on "
            f"{self.folds_by} that a fit did not count, by {_angle(self.rmse)} on those it did; "
            f"with the regression's parameters by {_angle(self.regression)}."
        )

    @property
    def sentences(self) -> list[str]:
        """How far the starts agree, and where the intervals come from."""
        ends = np.array([start.rmse for start in self.starts])
        return [
            f"{len(ends)} starts ended between {_angle(ends.min())} and {_angle(ends.max())}, "
            f"{self.best_starts} of them within 2 % of the best.",
            f"Intervals hold what each of {len(self.folds)} fits without one of the "
            f"{self.folds_by} found, and the spread between runs.",
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the record as `model.json` keeps it."""
        return {
            "method": "least squares of simulated − measured output_position (trust region, "
            "central differences)",
            "rmse": self.rmse,
            "held_out_rmse": self.held_out,
            "regression_rmse": self.regression,
            "runs": [asdict(run) for run in self.runs],
            "names": list(self.names),
            "regressed": list(self.regressed),
            "starts": [asdict(start) for start in self.starts],
            "folds": self.folds.tolist(),
            "folds_by": self.folds_by,
            "controller": None if self.controller is None else asdict(self.controller),
            "steps_per_sample": self.steps_per_sample,
        }

    def table(self) -> list[tuple[str, ...]]:
        """Return a head and a line for each run and for all, in mrad."""
        mean = [float(np.mean([getattr(r, f) for r in self.runs])) for f in _FIELDS]
        lines: list[tuple[str, ...]] = [("run", "fitted", "held out", "regression")]
        for run in self.runs:
            lines.append((run.name, *(_milli(getattr(run, field)) for field in _FIELDS)))
        lines.append(("mean of runs", *map(_milli, mean)))
        overall = (self.rmse, self.held_out, self.regression)
        return [*lines, ("all rows", *map(_milli, overall))]

    def _overall(self, field: str) -> float:
        squares = [run.rows * getattr(run, field) ** 2 for run in self.runs]
        return float(np.sqrt(sum(squares) / sum(run.rows for run in self.runs)))


def _angle(value: float) -> str:
    return f"{1e3 * value:.3g} mrad"


def _milli(value: float) -> str:
    return f"{1e3 * value:.3g}"


class Params(Mapping[str, "Parameter"]):
    """The parameters of a fit by name, in the order of the effects.

    Names are those that the fit prints and that `fixed`, `bounds` and ``--fix`` take:
    "effect.term", a shape's name, or one part of a name where that is unique. Iteration gives full
    names. Each record has `value`, `stderr`, `unit`, `bounds`, `fixed`, `determined` and
    ``ci(level)``, see `Parameter`. The value of one that is not determined is what the model uses;
    it tells nothing of the joint, and its `stderr` and ``ci()`` are NaN.

    Raises
    ------
    InputError
        For a name that is no parameter's, or that may be several.
    """

    def __init__(self, fit: Fit) -> None:
        self._fit = fit

    def __getitem__(self, name: str) -> Parameter:
        return self._fit[name]

    def __iter__(self) -> Iterator[str]:
        return iter([parameter.name for parameter in self._fit.parameters])

    def __len__(self) -> int:
        return len(self._fit.parameters)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self.get(name) is not None

    def get(self, name: str, default: Any = None) -> Any:
        """Return a parameter, or `default` where the name is none or may be several."""
        try:
            return self[name]
        except InputError:
            return default

    def to_frame(self) -> pandas.DataFrame:
        """Return the parameters as a table; see `Fit.to_frame`."""
        return self._fit.to_frame()

    def __str__(self) -> str:
        return render("parameters", "text", self._fit)

    def __repr__(self) -> str:
        return f"<Params of {self._fit.target}: {len(self)} parameters>"

    def _repr_html_(self) -> str:
        return render("parameters", "html", self._fit)
