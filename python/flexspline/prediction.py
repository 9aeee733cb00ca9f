"""What a model says of runs beside what was measured: of one run, or of several with their errors.

The error is that of the rows with a measured and a predicted value; on request of those alone whose
output is at least so fast. Over several runs it is pooled,

    RMSE = √( Σ residual² / Σ rows ),    over all rows of all runs,

so that a long run weighs more than a short one.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, overload

import numpy as np
from numpy.typing import DTypeLike, NDArray

from flexspline.errors import InputError
from flexspline.files import save_columns
from flexspline.formatting import rows_text, sentences_text, short, table_html

if TYPE_CHECKING:
    import pandas

__all__ = [
    "SIZES",
    "OfRuns",
    "Prediction",
    "Predictions",
    "error_sizes",
    "require_rows",
    "too_slow",
]

Result = TypeVar("Result")
Array = NDArray[np.float64]

SIZES = ("RMSE", "mean error", "largest error")
"""What `error_sizes` returns."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Measured and predicted y of one log, arrays (N,) in `unit`; NaN where there is nothing.

    `warnings`: a sentence for each thing that is to be known of the model on this log: signs that
    no drive has, terms that are not significant, rows outside of what it was fitted to. `name`: of
    the run. `speed_above`: rad/s; the error is of rows whose output moves at least so fast, which
    `speed` tells, (N,); None for all rows. To numpy it is `predicted`: ``np.asarray(prediction)``.
    """

    time: Array
    measured: Array
    predicted: Array
    target: str
    unit: str
    warnings: tuple[str, ...] = ()
    name: str = ""
    speed_above: float | None = None
    speed: Array | None = None

    def __repr__(self) -> str:
        gap = f"RMSE {self.rmse:.4g} {self.unit}" if self.rows else "none measured"
        return f"<Prediction of {self.target}: {len(self.time)} rows, {gap}>"

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.predicted, dtype=dtype) if copy else np.asarray(self.predicted, dtype)

    @property
    def residual(self) -> Array:
        """Measured minus predicted, of all rows."""
        return self.measured - self.predicted

    @property
    def errors(self) -> Array:
        """Measured minus predicted of the rows that the error is of, (rows,)."""
        counted = np.isfinite(self.residual)
        if self.speed is not None and self.speed_above is not None:
            counted &= self.speed >= self.speed_above
        return self.residual[counted]

    @property
    def rows(self) -> int:
        """Rows that the error is of."""
        return len(self.errors)

    @property
    def slow_rows(self) -> int:
        """Rows with a residual that are slower than `speed_above`, and left out of the error."""
        return int(np.isfinite(self.residual).sum()) - self.rows

    @property
    def rmse(self) -> float:
        """Root mean square of `errors`, in `unit`; NaN where there is no row."""
        return _rms(self.errors)

    def to_frame(self) -> pandas.DataFrame:
        """Return a table of all rows: time [s], measured, predicted and residual."""
        import pandas

        return pandas.DataFrame(self._columns())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV, one row for each row of the log, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        save_columns(self._columns(), path)

    def _columns(self) -> dict[str, Array]:
        return {name: getattr(self, name) for name in ("time", "measured", "predicted", "residual")}


class OfRuns(Sequence[Result]):
    """Results of several runs, one of each, in their order."""

    runs: tuple[Result, ...]

    def __len__(self) -> int:
        return len(self.runs)

    @overload
    def __getitem__(self, index: int) -> Result: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Result, ...]: ...
    def __getitem__(self, index: int | slice) -> Result | tuple[Result, ...]:
        return self.runs[index]


@dataclass(frozen=True, eq=False, repr=False)
class Predictions(OfRuns[Prediction]):
    """Predictions of several runs by one part of a model, `runs`, at least one."""

    runs: tuple[Prediction, ...]

    @property
    def target(self) -> str:
        """What is predicted."""
        return self.runs[0].target

    @property
    def unit(self) -> str:
        """Unit of the target."""
        return self.runs[0].unit

    @property
    def errors(self) -> Array:
        """Measured minus predicted of the rows that the error is of, run after run, (rows,)."""
        return np.concatenate([run.errors for run in self.runs])

    @property
    def rows(self) -> int:
        """Rows of all runs that the error is of."""
        return len(self.errors)

    @property
    def rmse(self) -> float:
        """Root mean square over all rows of all runs, in `unit`; NaN where there is no row."""
        return _rms(self.errors)

    @property
    def worst(self) -> Prediction | None:
        """The run with the largest RMSE; None where none has a measured value."""
        known = [run for run in self.runs if run.rows]
        return max(known, key=lambda run: run.rmse, default=None)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is to be known of the model on these runs, each sentence once."""
        return tuple(dict.fromkeys(said for run in self.runs for said in run.warnings))

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each run: rows, RMSE, mean and largest error, in `unit`."""
        import pandas

        names = ["run", "rows", *(f"{name} [{self.unit}]" for name in SIZES)]
        table = [(run.name, run.rows, *error_sizes(run.errors)) for run in self.runs]
        return pandas.DataFrame(table, columns=names)

    def __repr__(self) -> str:
        return f"<{self._title()}>"

    def __str__(self) -> str:
        table = rows_text(self._rows())
        return "\n".join([self._title(), "", table, "", *sentences_text(self._sentences())])

    def _repr_html_(self) -> str:
        return table_html(self._title(), self._rows(), self._sentences())

    def _title(self) -> str:
        many = f"{len(self)} run{'' if len(self) == 1 else 's'}"
        gap = f"RMSE {self.rmse:.4g} {self.unit} over {self.rows} rows"
        return f"Predictions of {self.target}: {many}, {gap if self.rows else 'none measured'}"

    def _rows(self) -> list[tuple[str, ...]]:
        named = [(run.name, run.errors) for run in self.runs]
        head = ("run", "rows", *(f"{name} [{self.unit}]" for name in SIZES))
        return [
            head,
            *(
                (name, str(len(errors)), *(short(size, 4) for size in error_sizes(errors)))
                for name, errors in [*named, ("all runs", self.errors)]
            ),
        ]

    def _sentences(self) -> list[str]:
        slow, speed = sum(run.slow_rows for run in self.runs), self.runs[0].speed_above
        said = []
        if self.worst is None:
            said.append("nothing measured to compare with")
        elif len(self) > 1:
            said.append(
                f"the worst run is {self.worst.name}: RMSE {self.worst.rmse:.4g} {self.unit}"
            )
        if speed is not None:
            said.append(
                f"{slow} of {self.rows + slow} rows are slower than {speed:g} rad/s and left out "
                "of these errors"
            )
        return [*said, *self.warnings]


def require_rows(runs: Sequence[Prediction]) -> None:
    """Refuse a least speed that no row with a residual reaches.

    Raises
    ------
    InputError
        Where there are residuals, and all are of slower rows.
    """
    if any(run.rows for run in runs) or not any(run.slow_rows for run in runs):
        return
    reached = [run.speed[np.isfinite(run.residual)] for run in runs if run.speed is not None]
    raise InputError(
        too_slow([run.name for run in runs], runs[0].speed_above, np.concatenate(reached))
    )


def too_slow(names: Sequence[str], least: float | None, speeds: Array) -> str:
    """Return the sentence on runs none of whose compared rows has this speed, rad/s."""
    of = f"log '{names[0]}'" if len(names) == 1 else f"the {len(names)} logs"
    fastest = float(np.nanmax(speeds, initial=0.0))
    return (
        f"{of}: no row with a measured value moves at {least:g} rad/s or more, the fastest at "
        f"{fastest:.3g} rad/s; give a lower speed_above"
    )


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else float("nan")


def error_sizes(errors: Array) -> tuple[float, float, float]:
    """Return root mean square, mean and largest absolute value of errors (N,); NaN of none."""
    if not errors.size:
        return (float("nan"),) * 3
    return _rms(errors), float(np.mean(errors)), float(np.max(np.abs(errors)))
