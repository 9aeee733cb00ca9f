"""What a part keeps of the simulation that it corrects, and what that simulation says of y."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs.log import Log
from flexspline.signals import torque_of_current

__all__ = ["SIMULATED", "Simulated", "SimulatedFile", "simulation_of"]

Array = NDArray[np.float64]

SIMULATED = "simulated_torque"
"""The channel of a run that holds what the simulation says, in the target's unit, at the output."""


@dataclass(frozen=True)
class SimulatedFile:
    """The file that a simulated column was read from; no SHA-256 where it was made in memory."""

    name: str
    sha256: str | None


@dataclass(frozen=True)
class Simulated:
    """The simulation that a part corrects.

    Parameters
    ----------
    column : as it was named, of the runs or of the simulation's own files.
    own_files : whether it came in files of its own, not as a column of the runs.
    holds_load : whether it predicts the measured torque with the known load in it; otherwise it
        predicts y, without that load.
    files : those that the column was read from, in the order of the runs.
    """

    column: str
    own_files: bool
    holds_load: bool
    files: tuple[SimulatedFile, ...] = ()

    @property
    def words(self) -> str:
        """Where it comes from, such as "column 'mujoco' of the runs"."""
        return f"column '{self.column}' of {'its own files' if self.own_files else 'the runs'}"

    @property
    def asked(self) -> str:
        """What a command has to be given for it."""
        file = " --simulation FILE" if self.own_files else ""
        return f"give{file} --simulated-torque {self.column}"

    def to_json(self) -> dict[str, Any]:
        """Return it as `model.json` holds it."""
        return {
            "column": self.column,
            "own_files": self.own_files,
            "holds_load": self.holds_load,
            "files": [{"name": file.name, "sha256": file.sha256} for file in self.files],
        }

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Simulated:
        """Return what `to_json` wrote."""
        files = (SimulatedFile(one["name"], one["sha256"]) for one in content["files"])
        return cls(content["column"], content["own_files"], content["holds_load"], tuple(files))


def simulation_of(log: Log, target: str, simulated: Simulated, known_load: str | None) -> Array:
    """Return what the simulation says of y, (N,), in the target's unit.

    Raises
    ------
    InputError
        Where the run does not hold it.
    """
    if SIMULATED not in log:
        raise InputError(
            f"log '{log.name}': the model corrects what a simulation says ({simulated.words}), "
            f"which is not there; {simulated.asked}"
        )
    says = np.asarray(log[SIMULATED])
    if known_load is None or not simulated.holds_load:
        return says
    unit = torque_of_current(log, known_load) if target == "motor_current" else 1.0
    return np.asarray(says - log[known_load] / unit)
