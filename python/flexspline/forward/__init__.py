"""A fitted model driven forward from a run's inputs, without a look at its measured motion.

`drive_inputs` prepares inputs and initial state of a run once: the joint starts at the run's first
angle and velocity, and at the reading of its motor's encoder. `simulate` drives the model, and says
how far off it ends.

Parts of a model that follow a given motion integrate nothing, and nothing sticks in them.
"""

from __future__ import annotations

import html
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import Effect
from flexspline.errors import InputError, above_zero, listed
from flexspline.files import save_columns
from flexspline.forward.servo import PositionServo
from flexspline.logs.channels import CHANNELS
from flexspline.logs.derive import differentiate, increasing_time, velocity_noise
from flexspline.logs.log import Log, measurable
from flexspline.logs.read import LogLike, as_logs, is_one, with_motor_torque
from flexspline.logs.segments import runs
from flexspline.model import Model, require_model
from flexspline.part import PART_OF, Part
from flexspline.signals import gear_of, require_one_unit, torque_of_current

if TYPE_CHECKING:
    import pandas

__all__ = [
    "DriveInputs",
    "ForwardRun",
    "PositionServo",
    "drive_inputs",
    "require_movable",
    "simulate",
    "simulated_gap",
    "simulated_rmse",
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

FINE = 1e-5  # rad RMS: half the steps change the motion by no more, where they can be chosen
MOST_STEPS = 64
LESS = 0.75  # times as much: half the steps of a method of first order change it half as much

_ROUNDS = 8


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
    inertia = 0.0
    for effect, values in part.by_effect():
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
    whole = _of_two_rows(runs(log["time"]))
    if not len(whole):
        raise InputError(f"log '{log.name}': has no two rows without a gap; give a longer run")
    if horizon is None:
        return whole
    pieces = [_pieces(log["time"], first, last, horizon) for first, last in whole.tolist()]
    found = _of_two_rows(np.concatenate(pieces))
    if not len(found):
        raise InputError(
            f"log '{log.name}': has no two rows within a horizon of {horizon:g} s; give a longer "
            "horizon"
        )
    return found


def _of_two_rows(ranges: NDArray[np.intp]) -> NDArray[np.intp]:
    return np.asarray(ranges[ranges[:, 1] - ranges[:, 0] >= 2])


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


@overload
def simulate(  # type: ignore[overload-overlap]  # a name is text, and text has parts
    model: Model,
    log: LogLike,
    *,
    target: str | None = None,
    controller: PositionServo | str | os.PathLike[str] | None = None,
    steps_per_sample: int | None = None,
    inputs: str = "linear",
    horizon: float | None = None,
) -> ForwardRun: ...
@overload
def simulate(
    model: Model,
    log: Iterable[LogLike],
    *,
    target: str | None = None,
    controller: PositionServo | str | os.PathLike[str] | None = None,
    steps_per_sample: int | None = None,
    inputs: str = "linear",
    horizon: float | None = None,
) -> list[ForwardRun]: ...
def simulate(
    model: Model,
    log: LogLike | Iterable[LogLike],
    *,
    target: str | None = None,
    controller: PositionServo | str | os.PathLike[str] | None = None,
    steps_per_sample: int | None = None,
    inputs: str = "linear",
    horizon: float | None = None,
) -> ForwardRun | list[ForwardRun]:
    """Drive a model forward from inputs and initial state, without looking at measured motion.

    Drive: J q̈ = Ñ τ_m − τ_load − Σ coefficients · rows, with friction that truly holds: the
    direction tanh(v / v_d) of its rows is taken to its limit v_d → 0, where friction at rest is
    whatever keeps the joint there. Torsion: q = (θ + Δθ) / Ñ from the motor's angle. Sensor: the
    reading along the given motion.

    Parameters
    ----------
    model : with a part for the target; a drive needs the effect inertia.
    log : one run, or several; as `read_log` takes them.
    target : which part, where the model has several.
    controller : a servo law that takes the place of the measured motor torque (drive only), or the
        path of its `servo.json`; it reads commanded_position.
    steps_per_sample : Runge-Kutta steps of fourth order from row to row, ≥ 1; None: as many as
        leave an error of 1e-5 rad RMS, at most 64, and fewer where more do not lessen it.
    inputs : "linear" or "hold": the measured motor torque between rows.
    horizon : s after which a drive begins anew from the measured angle and velocity; None: never
        but behind gaps. A joint that gravity loads is unstable without a servo, and over a long run
        says more of that than of the model.

    Returns
    -------
    ForwardRun, or a list of them for several logs.

    Raises
    ------
    InputError
        Without a log, inertia, motor torque or initial angle, with rows that have no value, for a
        horizon that is not above zero or holds no two rows, and where the motion runs away.
    """
    if inputs not in ("linear", "hold"):
        raise InputError(f"inputs is '{inputs}'; give 'linear' or 'hold'")
    if steps_per_sample is not None and not (
        isinstance(steps_per_sample, int) and steps_per_sample >= 1
    ):
        raise InputError(f"steps_per_sample is {steps_per_sample!r}; give a whole number above 0")
    if horizon is not None:
        above_zero(horizon, "simulate: horizon", "s")
    law = (
        PositionServo.load(controller) if isinstance(controller, (str, os.PathLike)) else controller
    )
    logs = as_logs(log)
    if not logs:
        raise InputError("there is no log to simulate; give at least one")
    require_model(model)
    part = model.part(target)
    how = partial(drive_inputs, controller=law, hold=inputs == "hold", horizon=horizon)
    made = [_simulated(model, part, one, how, steps_per_sample) for one in logs]
    return made[0] if is_one(log) else made


def _simulated(
    model: Model, part: Part, log: Log, how: partial[DriveInputs], steps: int | None
) -> ForwardRun:
    if part.simulated is not None:
        raise InputError(
            f"the part for {part.target} corrects what another simulation says and cannot be "
            "driven alone; add its effects to that simulation"
        )
    log, said = measurable(log)
    increasing_time(log, "a simulation")
    made = _along(model, part, log, how, steps)
    return replace(made, notes=(*made.notes, *said))


def _along(
    model: Model, part: Part, log: Log, how: partial[DriveInputs], steps: int | None
) -> ForwardRun:
    side = PART_OF[part.target]
    if side != "drive" and how.keywords["controller"] is not None:
        raise InputError(
            f"a controller drives a motor, but the target is {part.target}; leave it out or give "
            "the target motor_torque"
        )
    if side == "sensor":
        return reading(model, part, log)
    if side == "torsion":
        return turned(model, part, log)
    require_movable(part)
    return _driven(part, log, how(model, log, target=part.target), steps)


def _driven(part: Part, log: Log, given: DriveInputs, steps: int | None) -> ForwardRun:
    if steps is None:
        steps, error, found = _finely_driven(part, given)
    else:
        error, found = float("nan"), given.run(part, steps, DRIVEN)
    _require_bounded(log, found["position"], given)
    motor = "motor_current" if part.target == "motor_current" else "motor_torque"
    columns = {
        "time": given.time,
        "output_position": found["position"],
        "output_velocity": found["velocity"],
        "output_acceleration": found["acceleration"],
        motor: found["motor"],
    }
    note = f"simulated from the inputs of '{log.name}', {steps} steps from row to row"
    stuck = np.asarray(found["stuck"] == 1.0)
    made = Log(columns, dict(log.facts), (note,))
    return ForwardRun(made, "output_position", given.measured, stuck, steps, error, _notes(given))


def _finely_driven(part: Part, given: DriveInputs) -> tuple[int, float, dict[str, Array]]:
    """The steps from row to row that leave `FINE`, what half of them change, rad, and `DRIVEN`.

    Where the least difference decides the way on, as that of friction that holds or lets go, each
    step gives another motion: steps are no longer halved once that changes it by nearly as much as
    the time before.
    """
    steps, before = 1, np.inf
    coarse = given.run(part, steps)
    while True:
        steps *= 2
        fine = given.run(part, steps, DRIVEN)
        error = float(np.sqrt(np.nanmean((fine["position"] - coarse["position"]) ** 2)))
        if not FINE < error < LESS * before or steps >= MOST_STEPS:
            return steps, error, fine
        coarse, before = fine, error


def _require_bounded(log: Log, position: np.ndarray, given: DriveInputs) -> None:
    driven = np.concatenate([np.arange(a, b) for a, b in given.stretches])
    lost = driven[~np.isfinite(position[driven])]
    if len(lost):
        raise InputError(
            f"log '{log.name}': the simulated motion runs away at {given.time[lost[0]]:.4g} s (row "
            f"{lost[0]}); look at the signs of torque, load and gains, and at negative friction"
        )


def _notes(given: DriveInputs) -> tuple[str, ...]:
    again = len(given.stretches) - 1
    if not again:
        return ()
    return (f"it begins anew from the measured state {again} times",)


def reading(model: Model, part: Part, log: Log) -> ForwardRun:
    """Return what a sensor reads along the given motion: the prediction and the known load."""
    torque = model.predict(log, part.target).predicted
    if part.known_load is not None:
        if part.known_load not in log:
            raise InputError(
                f"log '{log.name}': the reading is made of the load, whose channel "
                f"{part.known_load} is not among {listed(log.channels)}; map a column to it"
            )
        torque = torque + log[part.known_load]
    made = Log({"time": log["time"], "sensor_torque": torque}, dict(log.facts), (_note(log),))
    measured = log["sensor_torque"] if "sensor_torque" in log else np.full(len(log), np.nan)
    return ForwardRun(made, "sensor_torque", np.asarray(measured))


def turned(model: Model, part: Part, log: Log) -> ForwardRun:
    """Return where the output stands: q = (θ + Δθ) / Ñ, θ measured.

    Effects that read q see the one that is looked for: they turn it by so little that a few rounds
    of insertion, from q = θ / Ñ, settle it.

    Raises
    ------
    InputError
        Where the log lacks the motor's angle, the gear ratio, or what an effect reads.
    """
    if "motor_position" not in log:
        raise InputError(
            f"log '{log.name}': the output's angle follows from the channel motor_position, which "
            f"is not among {listed(log.channels)}; map a column to it"
        )
    facts = {k: v for k, v in model.facts.items() if k not in log.facts and v is not None}
    log = log.with_facts(facts)
    ratio = log.effective_ratio
    if ratio is None:
        raise InputError(
            f"log '{log.name}': the output's angle needs the gear ratio; give gear_ratio"
        )
    output = log["motor_position"] / ratio
    for _ in range(_ROUNDS):
        there = log.with_columns({"output_position": output}, note="simulated")
        torsion = model.predict(there, part.target).predicted
        before, output = output, (log["motor_position"] + torsion) / ratio
        if not np.nanmax(np.abs(output - before), initial=0.0) > 1e-12:
            break
    made = Log({"time": log["time"], "output_position": output}, dict(log.facts), (_note(log),))
    measured = log["output_position"] if "output_position" in log else np.full(len(log), np.nan)
    return ForwardRun(made, "output_position", np.asarray(measured))


def _note(log: Log) -> str:
    return f"simulated along the motion of '{log.name}'"


def simulated_rmse(
    model: Model,
    logs: Sequence[Log],
    *,
    target: str | None = None,
    controller: PositionServo | None = None,
    horizon: float | None = None,
) -> dict[str, Any] | None:
    """Return {"channel", "value"}: the RMSE over all rows of all runs; None where one cannot be.

    `value` is in the channel's unit (rad of output_position; Nm of sensor_torque).
    """
    try:
        made = simulate(model, list(logs), target=target, controller=controller, horizon=horizon)
    except InputError:
        return None
    rest = np.concatenate([run.residual for run in made]) if made else np.zeros(0)
    rest = rest[np.isfinite(rest)]
    if not rest.size:
        return None
    return {"channel": made[0].channel, "value": float(np.sqrt(np.mean(rest**2)))}


def simulated_gap(
    base: Model,
    final: Model,
    logs: Sequence[Log],
    *,
    target: str | None = None,
    controller: PositionServo | None = None,
    horizon: float | None = None,
) -> dict[str, Any] | None:
    """Return {"channel", "base", "final"} of `discovery.json`; None where one cannot be driven.

    Parameters
    ----------
    base, final : fitted without these logs.
    logs : runs that neither has seen.
    horizon : s, as in `simulate`.
    """
    first = simulated_rmse(base, logs, target=target, controller=controller, horizon=horizon)
    last = simulated_rmse(final, logs, target=target, controller=controller, horizon=horizon)
    if first is None or last is None:
        return None
    return {"channel": last["channel"], "base": first["value"], "final": last["value"]}
