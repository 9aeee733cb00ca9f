"""A run that a model was driven through, beside what was measured."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

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
        from flexspline.files import atomic_writer

        with atomic_writer(path) as file:
            self.to_frame().to_csv(file, index=False, lineterminator="\n")

    def __str__(self) -> str:
        from flexspline.forward.text import run_text

        return run_text(self)

    def __repr__(self) -> str:
        return (
            f"<ForwardRun of '{self.log.name}': {self.channel}, {len(self.log)} rows, "
            f"RMSE {self.rmse:.4g} {self.unit}>"
        )

    def _repr_html_(self) -> str:
        from flexspline.forward.text import run_html

        return run_html(self)
