"""Inputs and initial state of a run for forward simulation of a fitted joint, prepared once.

The joint starts at the run's first angle and velocity, and at the reading of its motor's encoder.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import Effect
from flexspline.errors import InputError, listed
from flexspline.forward.servo import PositionServo
from flexspline.logs.derive import differentiate, velocity_noise
from flexspline.logs.log import Log
from flexspline.logs.read import with_motor_torque
from flexspline.logs.segments import runs
from flexspline.model import Model
from flexspline.part import Part
from flexspline.signals import gear_of, require_one_unit, torque_of_current

__all__ = [
    "DriveInputs",
    "drive_inputs",
    "motor_offset",
    "require_finite",
    "require_movable",
    "require_no_delay",
]

Array = NDArray[np.float64]

DRIVEN = ("position", "velocity", "acceleration", "motor", "stuck")

_NAMED = {
    "motor": "motor torque",
    "command": "commanded_position",
    "supply": "supply_voltage",
    "known_load": "known load",
}

_NOISY = 3.0  # standard deviations of the velocity that count as rest


@dataclass(frozen=True, eq=False)
class DriveInputs:
    """Inputs and initial state of one run; behind a gap it begins anew from the measured state.

    Parameters
    ----------
    name : of the run.
    time : (N,), s.
    columns : what the core reads, (N,) each: motor, known_load, command, enabled, supply, and
        those of `_core.given_numbers` that effects read.
    servo : the law, or None where the motor's torque is measured.
    stretches : row ranges that are driven in one go, (K, 2), half-open.
    start : initial angle [rad] and velocity [rad/s] of each stretch, (K, 2).
    motor_offset : rad, θ − Ñ q.
    gear : as `_core.Design` takes it.
    drive_factor, load_factor : of motor torque and known load in the target's y.
    hold : the motor's torque holds from row to row, else it is linear.
    measured : output angle, (N,) rad; it is compared with, never driven with.
    """

    name: str
    time: Array
    columns: Mapping[str, Array]
    servo: PositionServo | None
    stretches: NDArray[np.intp]
    start: Array
    motor_offset: float
    gear: Mapping[str, Any]
    drive_factor: float
    load_factor: float
    hold: bool
    measured: Array

    def plant(self, part: Part) -> _core.Plant:
        """Return the drive as a body that moves; one for all runs of a joint with one offset."""
        design = _core.Design([effect.for_core() for effect in part.effects], **self.gear)
        return _core.Plant(
            design, part.coefficients, self.motor_offset, self.drive_factor, self.load_factor
        )

    def run(
        self,
        part: Part,
        steps_per_sample: int,
        channels: Sequence[str] = ("position",),
        *,
        law: Mapping[str, float] | None = None,
        start: Array | None = None,
    ) -> dict[str, Array]:
        """Drive, and return `DRIVEN` by name, (N,); NaN from where the motion runs away.

        Parameters
        ----------
        part : the drive, with any effects and coefficients of the same target.
        steps_per_sample : ≥ 1.
        channels : position [rad], velocity, acceleration, motor [Nm at the shaft, or A], stuck.
        law : fields of the core's servo that replace those of the run's own law.
        start : instead of the run's own, (K, 2).
        """
        fields = {**self.servo.for_core(), **(law or {})} if self.servo is not None else {}
        plant = self.plant(part)
        found = {name: np.full(len(self.time), np.nan) for name in channels}
        for (first, last), (position, velocity) in zip(
            self.stretches, self.start if start is None else start, strict=True
        ):
            made, valid = plant.drive(
                self.time[first:last],
                {name: data[first:last] for name, data in self.columns.items()},
                fields,
                position,
                velocity,
                steps_per_sample,
                self.hold,
                list(channels),
            )
            for name in channels:
                found[name][first : first + valid] = made[name][:valid]
        return found


def drive_inputs(
    model: Model,
    log: Log,
    *,
    target: str | None = None,
    controller: PositionServo | None = None,
    hold: bool = False,
    horizon: float | None = None,
) -> DriveInputs:
    """Return what drives the model's drive part through a run.

    `hold`: the measured torque holds from row to row. `horizon`: s after which the motion begins
    anew from the measured state; None: only behind gaps.

    Raises
    ------
    InputError
        Where the log lacks the motor's torque (or the command), an input of an effect, or the
        initial angle, or has rows without a value in one of them; and as `require_no_delay`.
    """
    part = model.part(target)
    require_no_delay(part.effects, part.target)
    require_one_unit(part.effects, part.target, part.known_load)
    model.require_scales(log, part)
    log = _with_facts(model, with_motor_torque(log))
    servo = controller.for_log(log) if controller is not None else None
    columns = _columns(part, log, servo)
    stretches = _stretches(log, horizon)
    for name, data in columns.items():
        require_finite(log, _NAMED.get(name, name), data)
    return DriveInputs(
        log.name,
        np.ascontiguousarray(log["time"]),
        columns,
        servo,
        stretches,
        start_of(log, stretches),
        motor_offset(part, log),
        gear_of(log.facts, False),
        _drive_factor(part, log),
        _load_factor(part, log),
        hold,
        np.asarray(log["output_position"]),
    )


def require_movable(part: Part) -> None:
    """Refuse a drive that cannot be integrated: no inertia, or friction that exceeds its load.

    Raises
    ------
    InputError
    """
    first = 0
    inertia = 0.0
    for effect in part.effects:
        values = part.coefficients[first : first + len(effect.terms)]
        first += len(effect.terms)
        if effect.info.traits.inertial:
            inertia = float(values[0])
        brakes_load = effect.info.traits.dissipative and "load" in effect.reads
        if brakes_load and abs(values[0]) >= 1.0:
            raise InputError(
                f"the model's {effect.name} has the factor {values[0]:.3g}: friction "
                "that exceeds its load locks the joint for ever; fit it on runs that move under "
                "load"
            )
    if not inertia > 0.0:
        said = f"an inertia of {inertia:.3g}" if inertia else "no inertia"
        raise InputError(
            f"the model's {part.target} part has {said}, so it cannot be driven forward; fit it "
            "with the effect inertia on runs that accelerate"
        )


def require_no_delay(effects: Sequence[Effect], target: str) -> None:
    """Refuse a drive with an effect of the load's past: a delay of the recorder moves no joint.

    Raises
    ------
    InputError
    """
    for effect in effects:
        if effect.info.remembers and "load" in effect.reads:
            raise InputError(
                f"the effect {effect.name} of the {target} part is a delay of the recorded load, "
                "which moves no joint, so the part cannot be driven forward; leave it out and move "
                "the late channel with the repair shift instead"
            )


def _with_facts(model: Model, log: Log) -> Log:
    missing = {k: v for k, v in model.facts.items() if k not in log.facts and v is not None}
    return with_motor_torque(log.with_facts(missing))


def _columns(part: Part, log: Log, servo: PositionServo | None) -> dict[str, Array]:
    columns = {}
    if servo is None:
        columns["motor"] = _motor(part, log)
    else:
        columns["command"] = log["commanded_position"]
        if "enabled" in log:
            columns["enabled"] = log["enabled"]
        if servo.supply:
            columns["supply"] = log["supply_voltage"]
    if part.known_load is not None:
        columns["known_load"] = log[part.known_load]
    for channel in _core.given_numbers:
        readers = [e.name for e in part.effects if channel in e.reads]
        if readers and channel not in log:
            raise InputError(
                f"log '{log.name}': {listed(readers)} needs the channel {channel}; it has "
                f"{listed(log.channels)}; map a column to it"
            )
        if readers:
            columns[channel] = log[channel]
    return {name: np.ascontiguousarray(data) for name, data in columns.items()}


def _motor(part: Part, log: Log) -> Array:
    channel = "motor_current" if part.target == "motor_current" else "motor_torque"
    if channel not in log:
        constant = " or give torque_constant" if "motor_current" in log else ""
        raise InputError(
            f"log '{log.name}': driving the model forward needs the channel {channel}, which it "
            f"lacks; map a column to it{constant}, or give a controller and commanded_position"
        )
    return np.asarray(log[channel])


def _drive_factor(part: Part, log: Log) -> float:
    if part.target == "motor_current":
        return 1.0
    if log.effective_ratio is None:
        raise InputError(
            f"log '{log.name}': driving a motor torque forward needs the gear ratio; "
            "give gear_ratio"
        )
    return log.effective_ratio


def _load_factor(part: Part, log: Log) -> float:
    if part.known_load is None:
        return 0.0
    if part.target == "motor_current":
        return 1.0 / torque_of_current(log, part.known_load)
    return 1.0


def _stretches(log: Log, horizon: float | None) -> NDArray[np.intp]:
    found = runs(log["time"])
    if horizon is not None:
        found = np.concatenate([_pieces(log["time"], a, b, horizon) for a, b in found.tolist()])
    long = found[found[:, 1] - found[:, 0] >= 2]
    if not len(long):
        raise InputError(f"log '{log.name}': has no two rows without a gap; give a longer run")
    return np.asarray(long)


def _pieces(time: Array, first: int, last: int, horizon: float) -> NDArray[np.intp]:
    """Cut rows [first, last) every `horizon` seconds, (K, 2)."""
    number = np.floor((time[first:last] - time[first]) / horizon)
    cuts = first + 1 + np.flatnonzero(np.diff(number))
    edges = np.concatenate(([first], cuts, [last]))
    return np.stack((edges[:-1], edges[1:]), axis=1)


def start_of(log: Log, stretches: NDArray[np.intp]) -> Array:
    """Return angle and velocity at the start of each stretch, (K, 2), rad and rad/s.

    A velocity within its noise is none. Raises InputError where the angle is not measured.
    """
    if "output_position" not in log:
        raise InputError(
            f"log '{log.name}': the initial state is the first output_position, which the log "
            f"lacks; it has {listed(log.channels)}; map a column to it"
        )
    first = stretches[:, 0]
    position = log["output_position"][first]
    require_finite(log, "output_position", position, first)
    velocity, noise = _velocity(log, stretches)
    velocity[np.abs(velocity) < _NOISY * noise] = 0.0
    return np.stack((position, velocity), axis=1)


def _velocity(log: Log, stretches: NDArray[np.intp]) -> tuple[Array, float]:
    first = stretches[:, 0]
    if "output_velocity" in log:
        velocity = log["output_velocity"][first]
        require_finite(log, "output_velocity", velocity, first)
        return velocity.copy(), velocity_noise(log)
    if not np.isfinite(log["output_position"]).all() or len(log) < 3:
        return np.zeros(len(first)), 0.0
    made = differentiate(log)
    return np.asarray(made["output_velocity"])[first].copy(), velocity_noise(made)


def motor_offset(part: Part, log: Log) -> float:
    """Return θ − Ñ q, rad: the encoders' zeros differ, and ripple counts from the motor's.

    Raises InputError where the model was fitted with the motor's angle and the log lacks it.
    """
    fitted = part.record.get("channels")
    reads = any("motor_position" in effect.reads for effect in part.effects)
    measured = "motor_position" in (log.channels if fitted is None else fitted)
    if not (reads and measured):
        return 0.0
    if "motor_position" not in log or log.effective_ratio is None:
        raise InputError(
            f"log '{log.name}': the model's ripple was fitted with the channel motor_position, "
            "whose first row says where it starts; map a column to it and give gear_ratio"
        )
    offset = log["motor_position"][0] - log.effective_ratio * log["output_position"][0]
    require_finite(log, "motor_position", np.array([offset]))
    return math.remainder(float(offset), 2.0 * math.pi)


def require_finite(log: Log, name: str, data: Array, rows: NDArray[np.intp] | None = None) -> None:
    bad = np.flatnonzero(~np.isfinite(data))
    if not len(bad):
        return
    row = int(bad[0] if rows is None else rows[bad[0]])
    raise InputError(
        f"log '{log.name}': row {row} has no value of {name} "
        f"({len(bad)} such rows), so nothing can be driven through it; interpolate or cut the run"
    )
