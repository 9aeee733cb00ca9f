"""The result of a forward simulation beside what was measured, and its summary as text."""

from __future__ import annotations

import html
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline.files import save_columns
from flexspline.logs.channels import CHANNELS
from flexspline.logs.log import Log

if TYPE_CHECKING:
    import pandas

__all__ = ["ForwardRun"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ForwardRun:
    """One run, simulated from its inputs and its initial state, arrays (N,).

    Parameters
    ----------
    log : what was simulated, as channels of a log, with the run's time and facts.
    channel : of `log`, the one that is compared.
    measured : the same channel of the run; NaN where it has none.
    stuck : rows where friction holds the joint; None where nothing is integrated.
    steps_per_sample : of the integration; 0 where nothing is integrated.
    step_error : RMS, in the channel's unit, by which half the steps give another motion; NaN where
        the steps were given.
    notes : sentences on what was taken for granted.
    """

    log: Log
    channel: str
    measured: Array
    stuck: NDArray[np.bool_] | None = None
    steps_per_sample: int = 0
    step_error: float = float("nan")
    notes: tuple[str, ...] = ()

    @property
    def simulated(self) -> Array:
        """The simulated channel, (N,)."""
        return self.log[self.channel]

    @property
    def residual(self) -> Array:
        """Measured minus simulated, (N,)."""
        return self.measured - self.simulated

    @property
    def unit(self) -> str:
        """Of measured and simulated."""
        return CHANNELS[self.channel].unit

    @property
    def rmse(self) -> float:
        """Root mean square of measured less simulated; NaN where nothing is measured."""
        found = self.residual[np.isfinite(self.residual)]
        return float(np.sqrt(np.mean(found**2))) if found.size else float("nan")

    def to_frame(self) -> pandas.DataFrame:
        """Return the simulated channels as a table; `stuck` is 0 or 1."""
        frame = self.log.to_frame()
        if self.stuck is not None:
            frame["stuck"] = self.stuck.astype(int)
        return frame

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV, one row for each row of the run, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        stuck = {} if self.stuck is None else {"stuck": self.stuck.astype(int)}
        save_columns({**self.log.columns, **stuck}, path)

    def __str__(self) -> str:

        return run_text(self)

    def __repr__(self) -> str:
        return (
            f"<ForwardRun of '{self.log.name}': {self.channel}, {len(self.log)} rows, "
            f"RMSE {self.rmse:.4g} {self.unit}>"
        )

    def _repr_html_(self) -> str:

        return run_html(self)


def run_text(run: ForwardRun) -> str:
    """Return the gap between measured and simulated, its worst row, and how it was integrated."""
    return "\n".join([f"{run.log.name}: {run.channel} simulated", *(f"  {s}" for s in _said(run))])


def run_html(run: ForwardRun) -> str:
    """Return the same for a notebook."""
    items = "".join(f"<li>{html.escape(said)}</li>" for said in _said(run))
    head = html.escape(f"{run.log.name}: {run.channel} simulated")
    return f"<p><b>{head}</b></p><ul>{items}</ul>"


def _said(run: ForwardRun) -> list[str]:
    said = [_gap(run)]
    if run.stuck is not None:
        held = 100.0 * float(np.mean(run.stuck))
        steps = f"{run.steps_per_sample} steps from row to row"
        if np.isfinite(run.step_error):
            steps += f"; half of them change it by {run.step_error:.2g} {run.unit} RMS"
        said += [f"friction holds the joint on {held:.3g} % of {len(run.log)} rows", steps]
    return [*said, *run.notes]


def _gap(run: ForwardRun) -> str:
    if not np.isfinite(run.rmse):
        return f"nothing measured to compare with on {len(run.log)} rows"
    worst = int(np.nanargmax(np.abs(run.residual)))
    moves = float(np.nanstd(run.measured))
    return (
        f"RMSE {run.rmse:.4g} {run.unit} (the measured one varies by {moves:.3g} {run.unit}), at "
        f"most {abs(run.residual[worst]):.3g} {run.unit} at {run.log['time'][worst]:.4g} s"
    )
