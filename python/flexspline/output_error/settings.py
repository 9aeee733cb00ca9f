"""How a fit by simulation is asked for."""

from __future__ import annotations

from dataclasses import dataclass

from flexspline.errors import InputError
from flexspline.forward.servo import PositionServo

__all__ = ["Settings"]


@dataclass(frozen=True)
class Settings:
    """How a fit by simulation searches.

    `controller`: the servo's law, or None. `free`: its fields that are fitted. `starts`, `folds`:
    how many. `seed`: of the starts. `threads`: that simulations are shared among.
    """

    controller: PositionServo | None
    free: tuple[str, ...]
    starts: int
    folds: int
    seed: int
    threads: int
    progress: bool

    def __post_init__(self) -> None:
        for name, least in (("starts", 1), ("folds", 2)):
            value = getattr(self, name)
            if not isinstance(value, int) or value < least:
                raise InputError(f"{name} is {value!r}; give a whole number from {least} up")
        if self.free and self.controller is None:
            raise InputError("free_controller names fields of a controller; give the controller")
