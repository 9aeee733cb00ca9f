"""Scores of torque estimates as in Table I and Fig. 7 (by speed) of full_range_torque_estimation.

    RMSE = √(mean e²),  bias = mean e,  variance = mean (e − bias)² = RMSE² − bias²,  e = τ̂ − τ

A row moves where |q̇| at the output is at least the motion speed. What the paper counts as motion
is not printed (its own numbers imply 41 % of the rows); so the rule and the share of rows stand
over every table.
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError

if TYPE_CHECKING:
    import pandas

__all__ = ["ErrorScore", "ErrorTable", "SpeedCurve", "error_table", "speed_curve"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GROUPS = ("full", "motion", "no motion")
LEAST_ROWS = 10


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


@dataclass(frozen=True)
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
