"""`compare_models`: several models of one target on the same rows, side by side.

A fit that was made of a run is judged there by the residuals of fits that never saw its rows; all
else by its prediction. Every model is judged by the rows that all of them tell, so that no error is
lower for what was left out. A model from a file may have been fitted to a run: its record tells,
and the run does not count as one that it predicts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.runs import warned
from flexspline.effects import UNITS
from flexspline.errors import InputError, listed
from flexspline.lazy import Rendered, render
from flexspline.least_squares.likelihood import why_none
from flexspline.least_squares.result import Fit
from flexspline.logs.derive import with_motion
from flexspline.logs.log import Log
from flexspline.logs.read import LogLike, as_logs
from flexspline.model import Model, Prediction, fitted_to, lowpass_remark
from flexspline.signals import require_apart

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

__all__ = ["FITTED", "HELD_OUT", "PREDICTED", "ModelComparison", "ModelRun", "compare_models"]

Array = NDArray[np.float64]

HELD_OUT, PREDICTED, FITTED = "held out", "predicted", "fitted"


@dataclass(frozen=True, eq=False)
class ModelRun:
    """One run as all models tell it, in the unit of the target.

    Parameters
    ----------
    log : with velocity and acceleration, where its position allows them.
    measured : (N,).
    residuals : (models, N), measured less modelled; NaN on rows that some model does not tell.
    kinds : of each model: "held out" by fits that never saw the row, "predicted", or "fitted": the
        model was fitted to this run, and its error is too low to be compared.
    """

    log: Log
    measured: Array
    residuals: Array
    kinds: tuple[str, ...]

    @property
    def counts(self) -> NDArray[np.bool_]:
        """Rows (N,) that all models tell."""
        return np.asarray(np.isfinite(self.residuals).all(axis=0))


@dataclass(frozen=True, eq=False, repr=False)
class ModelComparison(Rendered):
    """Errors of several models on the same runs; prints as a table.

    Parameters
    ----------
    target, unit : what all of them model.
    lowpass : Hz, or None.
    names : of the models, in the order they were given.
    runs : measured values and residuals.
    aic, bic : by model; NaN for what is no fit, and for all where these are not of the same rows.
    notes : sentences: what is missing in the table and why.
    """

    _kind: ClassVar = "models"

    target: str
    unit: str
    lowpass: float | None
    names: tuple[str, ...]
    runs: tuple[ModelRun, ...]
    aic: Array
    bic: Array
    notes: tuple[str, ...]

    @property
    def rows(self) -> int:
        """Rows that all models tell, by which they are judged."""
        return int(sum(run.counts.sum() for run in self.runs))

    def errors(self) -> Array:
        """Return the RMSE of each run and, last, of all rows: (runs + 1, models), in `unit`."""
        return np.vstack([*(_rmse([run]) for run in self.runs), _rmse(self.runs)])

    def unseen(self) -> tuple[tuple[str, ...], Array]:
        """Return the runs that no model was fitted to, and the RMSE over these, (models,)."""
        runs = [run for run in self.runs if FITTED not in run.kinds and run.counts.any()]
        return tuple(run.log.name for run in runs), _rmse(runs)

    def kinds(self) -> list[tuple[str, ...]]:
        """Return what the errors are, as `errors`; over all runs "fitted" where one run is."""
        each = [run.kinds for run in self.runs]
        return [*each, tuple(_pooled(kinds) for kinds in zip(*each, strict=True))]

    def to_frame(self) -> pandas.DataFrame:
        """Return errors, AIC and BIC as a table: a row for each model."""
        import pandas

        labels = [*(run.log.name for run in self.runs), "all rows"]
        frame = pandas.DataFrame(self.errors().T, index=list(self.names), columns=labels)
        frame["kind"] = self.kinds()[-1]
        return frame.assign(aic=self.aic, bic=self.bic).rename_axis("model")

    def __repr__(self) -> str:
        return f"<ModelComparison of {self.target}: {listed(self.names)}; {len(self.runs)} runs>"

    def plot(self) -> Figure:
        """Return a figure: measured and all models over time, residuals over load and velocity."""
        return render("models", "figure", self)


def _rmse(runs: Sequence[ModelRun]) -> Array:
    """RMSE of each model, (models,), over the rows of runs that count; NaN where there is none."""
    squares = sum(np.sum(run.residuals[:, run.counts] ** 2, axis=1) for run in runs)
    count = sum(int(run.counts.sum()) for run in runs)
    return np.asarray(np.sqrt(squares / count if count else np.nan * squares))


def compare_models(
    models: Mapping[str, Model | Fit],
    logs: LogLike | Iterable[LogLike],
    *,
    target: str | None = None,
    lowpass: float | None = None,
) -> ModelComparison:
    """Compare models and fits of one target on the same rows of the same runs.

    Parameters
    ----------
    models : {"with ripple": fit, "from last year": model}.
    logs : one or several runs, as `read_log` takes them.
    target : which part, where a model has several; None: that of the fits.
    lowpass : Hz; zero phase, on measured and modelled alike.

    Returns
    -------
    ModelComparison
        RMSE by run and of all rows, AIC and BIC of fits, and a figure.

    Raises
    ------
    InputError
        Where there is no model or no log, the models are of different targets or known loads, a
        log lacks a channel, or no row is told by all models.
    """
    runs = as_logs(logs)
    if not runs:
        raise InputError("there is no log to compare with; give at least one")
    require_apart(runs)
    target = _target_of(models, target)
    told = [[_told(one, log, target, lowpass) for one in models.values()] for log in runs]
    made = [_run(log, row) for log, row in zip(runs, told, strict=True)]
    if not any(run.counts.any() for run in made):
        raise InputError(
            f"no row of {listed([log.name for log in runs])} is told by all of {listed(models)}; "
            "compare fewer models, or runs with the channels that they read"
        )
    aic, bic, notes = _criteria(models)
    names = tuple(models)
    parts = {n: one.part if isinstance(one, Fit) else one.part(target) for n, one in models.items()}
    told_apart = (lowpass_remark(part, lowpass, f"'{n}'") for n, part in parts.items())
    smoothed = [sentence for sentence in told_apart if sentence]
    against = (
        warned((row[at][0].warnings for row in told), f" of '{name}'")
        for at, name in enumerate(names)
    )
    said = [sentence for own in against for sentence in own]
    notes = [*_left_out(made), *_fitted(names, made), *smoothed, *said, *notes]
    return ModelComparison(
        target, UNITS[target], lowpass, names, tuple(made), aic, bic, tuple(notes)
    )


def _target_of(models: Mapping[str, Model | Fit], target: str | None) -> str:
    """The one target of all models."""
    if not isinstance(models, Mapping):
        raise InputError(
            f"the models to compare are given as a {type(models).__name__}, and each needs a name; "
            "give a dictionary, such as {'last year': model, 'now': fit}, or one model alone to "
            "flexspline.compare"
        )
    if not models:
        raise InputError(
            "there is no model to compare; give a dictionary, such as {'a': fit, 'b': model}"
        )
    for name, one in models.items():
        if not isinstance(one, (Model, Fit)):
            raise InputError(
                f"'{name}' is a {type(one).__name__}; give a model, as flexspline.Model.load "
                "reads one, or a fit"
            )
    fits = {one.target for one in models.values() if isinstance(one, Fit)}
    if target is None and len(fits) == 1:
        target = next(iter(fits))
    parts = {
        name: one.part if isinstance(one, Fit) else one.part(target) for name, one in models.items()
    }
    for what in ("target", "known_load"):
        found = {name: getattr(part, what) for name, part in parts.items()}
        if len(set(found.values()) | ({target} if target and what == "target" else set())) > 1:
            each = listed(f"'{name}': {value or 'none'}" for name, value in found.items())
            raise InputError(
                f"the models differ in their {what.replace('_', ' ')} ({each}); compare models of "
                "one target and one known load"
            )
    return next(iter(parts.values())).target


def _told(
    one: Model | Fit, log: Log, target: str, lowpass: float | None
) -> tuple[Prediction, Array, str]:
    """What a model says of a run, what it misses (N,), and what kind of error that is."""
    model = one.model if isinstance(one, Fit) else one
    said = model.predict(log, target, lowpass_hz=lowpass)
    if isinstance(one, Fit) and one.lowpass == lowpass:
        for run in one.runs:
            if _same(run.measured, said.measured) and np.array_equal(run.log["time"], log["time"]):
                return said, run.held_out, HELD_OUT
    return said, said.residual, FITTED if fitted_to(model.part(target), log) else PREDICTED


def _same(one: Array, other: Array) -> bool:
    return one.shape == other.shape and bool(np.allclose(one, other, equal_nan=True))


def _run(log: Log, told: Sequence[tuple[Prediction, Array, str]]) -> ModelRun:
    residuals = np.array([missed for _, missed, _ in told])
    residuals[:, ~np.isfinite(residuals).all(axis=0)] = np.nan
    measured = told[0][0].measured
    return ModelRun(with_motion(log), measured, residuals, tuple(kind for _, _, kind in told))


def _pooled(kinds: Sequence[str]) -> str:
    if FITTED in kinds:
        return FITTED
    return kinds[0] if len(set(kinds)) == 1 else f"{HELD_OUT} or {PREDICTED}"


def _criteria(models: Mapping[str, Model | Fit]) -> tuple[Array, Array, list[str]]:
    """AIC and BIC by model, and why some have none."""
    aic, bic = np.full(len(models), np.nan), np.full(len(models), np.nan)
    fits = {name: one for name, one in models.items() if isinstance(one, Fit)}
    if len(fits) < 2:
        return aic, bic, []
    without = {name: why_none(fit) for name, fit in fits.items() if why_none(fit)}
    notes = [f"'{name}' has no AIC or BIC: {reason}." for name, reason in without.items()]
    having = {name: fit for name, fit in fits.items() if name not in without}
    if len({_rows_of(fit) for fit in having.values()}) > 1:
        counts = {name: sum(int(run.counts.sum()) for run in f.runs) for name, f in having.items()}
        told = listed([f"'{name}' of {count}" for name, count in counts.items()])
        said = (
            f"AIC and BIC are left out: the fits are of different rows ({told}), and cannot be "
            "compared."
            if len(set(counts.values())) > 1
            else "AIC and BIC are left out: the fits are of different rows, or of rows smoothed or "
            "thinned differently, and cannot be compared."
        )
        return aic, bic, [*notes, said]
    if len({fit.likelihood.of_noise_in_all for fit in having.values()}) > 1:
        said = (
            "AIC and BIC are left out: some fits read their noise in a part of the runs, as terms "
            "of each of many runs were taken out, and cannot be compared with the others."
        )
        return aic, bic, [*notes, said]
    if len(having) > 1:
        for at, name in enumerate(models):
            if name in having:
                aic[at], bic[at] = having[name].aic, having[name].bic
    return aic, bic, notes


def _rows_of(fit: Fit) -> tuple[object, ...]:
    """What of two fits must be equal for their likelihoods to be of the same rows."""
    each = tuple((r.measured[r.counts].tobytes(), r.counts.tobytes()) for r in fit.runs)
    return (fit.lowpass, fit.uncertainty.noise.decimation, each)


def _left_out(runs: Sequence[ModelRun]) -> list[str]:
    whole, kept = sum(len(run.log) for run in runs), sum(int(run.counts.sum()) for run in runs)
    if whole == kept:
        return []
    return [
        f"{whole - kept} of {whole} rows do not count: there some model tells nothing, because "
        "a channel that it reads is missing or does not resolve the motion, or what came before is "
        "not known. Every model is judged by the rows that all of them tell."
    ]


def _fitted(names: Sequence[str], runs: Sequence[ModelRun]) -> list[str]:
    alike: dict[tuple[str, ...], list[str]] = {}
    for at, name in enumerate(names):
        own = tuple(run.log.name for run in runs if run.kinds[at] == FITTED)
        alike.setdefault(own, []).append(f"'{name}'")
    return [
        f"{listed(which)} {'was' if len(which) == 1 else 'were'} fitted to {listed(own, 3)}: "
        "errors there are too low to be compared, and marked with †; held-out errors are those of "
        "a fit itself, at its own low pass."
        for own, which in alike.items()
        if own
    ]
