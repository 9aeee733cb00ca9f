"""Estimates of several runs, and how far their external torques are from a reference.

The error is the estimate less `reference_torque`, which has the same sign: positive where the joint
pushes the outside world in +q. No estimator ever reads the reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import listed
from flexspline.estimation.result import Estimate
from flexspline.formatting import rows_text, sentences_text, short, table_html
from flexspline.prediction import SIZES, error_sizes

if TYPE_CHECKING:
    import pandas

__all__ = ["Estimates"]

Array = NDArray[np.float64]

EXTERNAL = "external_torque_"
ALL = "all runs"
TITLE = "Errors of the external torque: the estimate less reference_torque"
HEAD = ("run", "estimate", "rows", *(f"{name} [Nm]" for name in SIZES))


@dataclass(frozen=True, eq=False, repr=False)
class Estimates(Sequence[Estimate]):
    """Estimates of several runs by one model.

    Parameters
    ----------
    runs : at least one.
    references : `reference_torque` of each run, (N,) in Nm, or None where it has none.
    """

    runs: tuple[Estimate, ...]
    references: tuple[Array | None, ...]

    def __len__(self) -> int:
        return len(self.runs)

    @overload
    def __getitem__(self, index: int) -> Estimate: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Estimate, ...]: ...
    def __getitem__(self, index: int | slice) -> Estimate | tuple[Estimate, ...]:
        return self.runs[index]

    @property
    def estimators(self) -> tuple[str, ...]:
        """Columns of the external torque that any run has."""
        return tuple(
            dict.fromkeys(c for run in self.runs for c in run.columns if c.startswith(EXTERNAL))
        )

    def errors(self, column: str) -> tuple[Array, ...]:
        """Return one external torque less the reference, (rows,) for each run.

        Rows without either are left out; a run without a reference has none.
        """
        return tuple(
            _error(run, column, reference)
            for run, reference in zip(self.runs, self.references, strict=True)
        )

    @property
    def rmse(self) -> dict[str, float]:
        """Root mean square error over all rows of all runs [Nm], by column; NaN without a row."""
        return {c: error_sizes(np.concatenate(self.errors(c)))[0] for c in self.estimators}

    def to_frame(self) -> pandas.DataFrame:
        """Return a table of the errors, a row for each run that has a reference and estimate."""
        import pandas

        return pandas.DataFrame(list(self._of_runs()), columns=HEAD)

    def __repr__(self) -> str:
        return f"<Estimates of {len(self)} runs: {listed(self.estimators)}>"

    def __str__(self) -> str:
        blocks = [str(run) for run in self.runs]
        if self._has_reference:
            said = "\n".join(sentences_text(self._sentences()))
            blocks += [f"{TITLE}\n\n{rows_text(self._rows(), left=(0, 1))}\n\n{said}"]
        return "\n\n".join(blocks)

    def _repr_html_(self) -> str:
        whole = "".join(run._repr_html_() for run in self.runs)
        if self._has_reference:
            whole += table_html(TITLE, self._rows(), self._sentences())
        return whole

    @property
    def _has_reference(self) -> bool:
        return any(reference is not None for reference in self.references)

    def _of_runs(self) -> Iterator[tuple[str, str, int, float, float, float]]:
        for column in self.estimators:
            each = self.errors(column)
            for run, errors, known in zip(self.runs, each, self.references, strict=True):
                if known is not None and column in run:
                    yield run.name, column, len(errors), *error_sizes(errors)

    def _pooled(self) -> Iterator[tuple[str, str, int, float, float, float]]:
        for column in self.estimators:
            whole = np.concatenate(self.errors(column))
            yield ALL, column, len(whole), *error_sizes(whole)

    def _rows(self) -> list[tuple[str, ...]]:
        return [
            HEAD,
            *(
                (run, column, str(rows), *(short(size, 4) for size in sizes))
                for run, column, rows, *sizes in (*self._of_runs(), *self._pooled())
            ),
        ]

    def _sentences(self) -> list[str]:
        said = []
        for column in self.estimators:
            sizes = [
                (error_sizes(errors)[0], run.name)
                for run, errors in zip(self.runs, self.errors(column), strict=True)
                if len(errors)
            ]
            if len(sizes) > 1:
                largest, name = max(sizes)
                said.append(f"the worst run of {column} is {name}: RMSE {largest:.4g} Nm")
        bare = [
            run.name
            for run, reference in zip(self.runs, self.references, strict=True)
            if reference is None
        ]
        if bare:
            said.append(f"no reference_torque to compare with: {listed(bare)}")
        return said


def _error(run: Estimate, column: str, reference: Array | None) -> Array:
    if reference is None or column not in run:
        return np.zeros(0)
    error = run[column] - reference
    return error[np.isfinite(error)]
