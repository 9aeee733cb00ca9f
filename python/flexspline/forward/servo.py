"""The law of a position servo, as `servo.json` holds it."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.files import atomic_write, text_of
from flexspline.logs.log import Log, given_number

__all__ = ["PositionServo"]


@dataclass(frozen=True)
class PositionServo:
    """A position servo that ticks at the rows of a log.

    u = clip(position_gain e + velocity_gain ė + integral, ± limit), with e = commanded_position −
    output_position as its encoder reads it; motor torque = torque u − back_emf q̇. u holds from row
    to row. It has no unit: gains and `torque` share out as is convenient, a duty cycle with a
    limit of 1 and a torque at full duty, or a torque with its own limit.

    Parameters
    ----------
    position_gain : u per rad at the output; or the name of a fact of the log that holds it.
    velocity_gain : u per rad/s of e.
    integral_gain : u per rad s of e; stands while the limit holds.
    limit : of |u|.
    torque : Nm at the motor's shaft for each u (A where the model's target is motor_current); with
        `supply`, Nm per V for each u.
    back_emf : Nm (A) at the motor's shaft for each rad/s of the output, while enabled.
    encoder_step : rad at the output that its encoder counts in; 0 is exact.
    supply : u switches the channel supply_voltage.
    gain_scale : factor of position_gain, such as that from a servo's register to u per rad.

    The channel `enabled`, where a log has it, takes torque and back-EMF away where it is 0.
    """

    position_gain: float | str
    velocity_gain: float = 0.0
    integral_gain: float = 0.0
    limit: float = 1.0
    torque: float = 1.0
    back_emf: float = 0.0
    encoder_step: float = 0.0
    supply: bool = False
    gain_scale: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "supply":
                if not isinstance(value, bool):
                    raise InputError(f"servo: supply is {value!r}; give true or false")
                continue
            if field.name == "position_gain" and isinstance(value, str):
                continue
            given_number(value, f"servo: {field.name}")
        if self.limit <= 0.0 or self.encoder_step < 0.0:
            raise InputError("servo: limit must be above 0, encoder_step not below; correct them")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> PositionServo:
        """Read a `servo.json`: the fields of this class by their names.

        Raises
        ------
        InputError
            Where the file is missing or is no servo; the sentence names the field.
        """
        text = text_of(path, "a servo.json")
        try:
            content = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}: is no JSON; give a servo.json") from error
        return cls.from_fields(content, str(path))

    @classmethod
    def from_fields(cls, content: Any, label: str = "servo") -> PositionServo:
        """Return the servo of a mapping of fields; `label` is what errors call it."""
        known = [field.name for field in fields(cls)]
        if not isinstance(content, Mapping) or "position_gain" not in content:
            raise InputError(f"{label}: has no position_gain; give the fields {listed(known)}")
        for name in content:
            if name not in known:
                near = did_you_mean(name, known)
                raise InputError(f"{label}: a servo has no '{name}'{near}; it has {listed(known)}")
        try:
            return cls(**content)
        except InputError as error:
            raise InputError(f"{label}: {error}") from error

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a `servo.json`, whole or not at all."""
        content = {field.name: getattr(self, field.name) for field in fields(self)}
        atomic_write(path, json.dumps(content, indent=1) + "\n")

    def for_log(self, log: Log) -> PositionServo:
        """Return the servo with the gain that this log's facts give.

        Raises
        ------
        InputError
            Where the fact is missing or no number, or a channel of the servo is missing.
        """
        for channel in ("commanded_position", *(["supply_voltage"] if self.supply else [])):
            if channel not in log:
                raise InputError(
                    f"log '{log.name}': the servo needs the channel {channel}; it has "
                    f"{listed(log.channels)}; map a column to it"
                )
        if not isinstance(self.position_gain, str):
            return self
        value = log.facts.get(self.position_gain)
        said = f"log '{log.name}': the servo's position_gain is its fact '{self.position_gain}', "
        if not isinstance(value, (int, float)):
            raise InputError(f"{said}which is {value!r}; give the log that fact as a number")
        return replace(self, position_gain=given_number(value, f"{said}which"))

    def with_fields(self, values: Mapping[str, float]) -> PositionServo:
        """Return the servo with some of its numbers replaced."""
        return replace(self, **dict[str, Any](values))

    def for_core(self) -> dict[str, float]:
        """Return what the core's servo takes."""
        names = ("velocity_gain", "integral_gain", "limit", "torque", "back_emf", "encoder_step")
        gain = float(self.position_gain) * self.gain_scale
        return {"position_gain": gain, **{name: float(getattr(self, name)) for name in names}}
