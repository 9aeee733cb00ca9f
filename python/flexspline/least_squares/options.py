"""What a fit rarely needs to be told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flexspline.errors import InputError

if TYPE_CHECKING:
    from flexspline.logs.log import Log

__all__ = ["FitOptions", "require_robust"]


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """Options of `fit` that few calls need.

    Parameters
    ----------
    bandwidth : Hz, -3 dB to which the motion of the output is smoothed before rows read it. None:
        the runs tell how noisy each channel is, and noisy ones are smoothed to what tells them
        best (`Fit.inputs`); exact ones are read as recorded. ``float("inf")``: all channels are
        read as recorded, whatever their noise.
    robust : "huber" weighs down outliers and pushes [HuberRonchetti2009]; None does not.
    offset_per_run : one offset for each run instead of one for all.
    simulation, simulated_torque : what any simulator predicts of the target, as for `compare`; the
        effects are fitted to what it lacks, and the model corrects it.
    threads : for the sums over the logs.
    progress : show what is being done on standard error.

    Raises
    ------
    InputError
        Where robust is something else.
    """

    bandwidth: float | None = None
    robust: str | None = None
    offset_per_run: bool = False
    simulation: Log | Sequence[Log] | None = None
    simulated_torque: str | None = None
    threads: int = 1
    progress: bool = False

    def __post_init__(self) -> None:
        require_robust(self.robust)


def require_robust(robust: str | None) -> None:
    """Refuse weights that do not exist."""
    if robust not in (None, "huber"):
        raise InputError(f"robust is {robust!r}; give 'huber' or None")
