"""From a log to numbers that a model reads, and to the y that it explains.

sensor_torque   y = τ_s − τ_load          [Nm]
motor_torque    y = Ñ τ_m − τ_load        [Nm at the output]
motor_current   y = i − τ_load / (Ñ k_t)   [A]
torsion         y = q Ñ − θ               [rad]

What logs and effects must have before that: finite values, a load, one gear.

Effects read the load that the gear transmits. The weight of the link is no part of τ_load where a
drive's gravity was fitted beside it; a torsion then follows the sum

    τ_gear = τ_load + g(q)

of which `estimate` takes g(q) off again. The link's inertia passes the gear too, but a drive's fit
knows it in a sum with the rotor's, which does not: it is in neither.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.effects.causes import GRAVITY
from flexspline.errors import InputError, listed
from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks.dependence import called, copies
from flexspline.logs.derive import differentiate
from flexspline.logs.log import IMAGINABLE, LEAST, Log, limits_of, who_reads
from flexspline.logs.read import with_motor_torque
from flexspline.logs.segments import runs
from flexspline.own import design_of

__all__ = [
    "IMAGINABLE",
    "Carried",
    "channels_for",
    "channels_read",
    "core_channels",
    "gear_for",
    "gear_of",
    "require_apart",
    "require_change",
    "require_finite",
    "require_load",
    "require_one_unit",
    "target_of",
    "torque_of_current",
    "without_unread",
]

Array = NDArray[np.float64]

POSITION = "output_position"

_PER_TARGET = {
    "sensor_torque": ("sensor_torque",),
    "motor_torque": ("motor_torque",),
    "motor_current": ("motor_current",),
    "torsion": ("output_position", "motor_position"),
}


@dataclass(frozen=True)
class Carried:
    """The weight that a gear carries beside τ_load: gravity as another part of the model knows it.

    Parameters
    ----------
    target : of that part.
    coefficients : of its gravity, Nm, in the order of the effect's terms.
    """

    target: str
    coefficients: tuple[float, ...]

    @property
    def words(self) -> str:
        return f"the gravity of the part for {self.target}"

    def torque(self, log: Log) -> Array:
        """Return the weight at the output's angle, (N,), Nm.

        Raises
        ------
        InputError
            Where the log lacks the angle.
        """
        if POSITION not in log:
            raise InputError(
                f"log '{log.name}': the gear's load holds {self.words}, which needs the channel "
                f"{POSITION}; it has {listed(log.channels)}; map a column to it"
            )
        position = {POSITION: np.ascontiguousarray(log[POSITION])}
        design = design_of([Effect(GRAVITY)], gear_of({}, motor_encoder=False))
        return np.asarray(design.predict(position, len(log), np.array(self.coefficients)))

    def to_json(self) -> dict[str, Any]:
        """Return it as `model.json` holds it."""
        return {"target": self.target, "coefficients": [*self.coefficients]}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Carried | None:
        """Return what a part's record says; models made before this say nothing."""
        made = record.get("carried")
        return made and cls(str(made["target"]), tuple(map(float, made["coefficients"])))


def target_of(log: Log, target: str, known_load: str | None) -> Array:
    """Return y of a log, (N,), in the target's unit (see the module docstring)."""
    _require_output_torque(known_load, target)
    for channel in _PER_TARGET[target]:
        if channel not in log:
            raise InputError(
                f"log '{log.name}': target {target} needs the channel {channel}; "
                f"it has {listed(log.channels)}"
            )
    if target == "torsion":
        return np.asarray(log["output_position"] * _ratio(log, target) - log["motor_position"])
    measured = np.asarray(log[target])  # borrowed: a long log is not copied without need
    if target == "motor_torque":
        measured = _ratio(log, target) * measured
    if known_load is None:
        return measured
    if target == "motor_current":
        return np.asarray(measured - log[known_load] / torque_of_current(log, known_load))
    return np.asarray(measured - log[known_load])


def _require_output_torque(known_load: str | None, target: str) -> None:
    """Refuse a known load that is no torque at the output, or the target itself."""
    if known_load is None or known_load not in CHANNELS:  # refused where it is read
        return
    remedy = "give a channel with the load at the output, such as reference_torque, or leave it out"
    if known_load == target:
        raise InputError(f"the known load {known_load} is the target itself; {remedy}")
    unit, meaning = CHANNELS[known_load]
    if known_load == "motor_torque":
        meaning = "at the motor shaft, with the friction in it that is looked for"
    if unit != "Nm" or known_load == "motor_torque":
        raise InputError(
            f"the known load {known_load} is no torque at the output: it is in {unit}, {meaning}; "
            f"{remedy}"
        )


def torque_of_current(log: Log, known_load: str) -> float:
    """Return Ñ k_t [Nm/A], the torque at the output that a motor current is worth.

    Raises
    ------
    InputError
        Where the log lacks the torque constant or the gear ratio; the sentence says that the known
        load needs it.
    """
    constant, ratio = log.facts.get("torque_constant"), log.effective_ratio
    needed = {"torque_constant": constant, "gear_ratio": ratio}
    missing = [name for name, value in needed.items() if value is None]
    if missing:
        options = " and ".join(f"--{name.replace('_', '-')}" for name in missing)
        raise InputError(
            f"log '{log.name}': taking the known load {known_load} [Nm] off the target "
            f"motor_current [A] needs {listed(missing)}; give {options}, or leave the known load "
            "out"
        )
    return float(str(constant)) * float(str(ratio))


def channels_for(
    log: Log, effects: Sequence[Effect], known_load: str | None, *, load_needed: bool = True
) -> Log:
    """Return the log with the derived channels that the effects read.

    A missing velocity or acceleration is the zero-phase derivative of the position, and the
    log's history says so.

    Raises
    ------
    InputError
        Where a channel is missing and cannot be derived; the known load only if `load_needed`.
    """
    reads = {channel for effect in effects for channel in effect.reads}
    if load_needed and known_load is not None and known_load not in log:
        raise InputError(
            f"log '{log.name}': no channel '{known_load}' for the known load; "
            f"it has {listed(log.channels)}"
        )
    derived = ("output_velocity", "output_acceleration")
    missing = [name for name in derived if name in reads and name not in log]
    if missing and "output_position" in log:
        made = differentiate(log)
        log = log.with_columns(
            {name: made[name] for name in missing},
            note=made.history[-1].replace(listed(derived), listed(missing)),
        )
    log = with_motor_torque(log) if "motor_torque" in reads else log
    needed = reads - {"load", "motor_position", "period"}
    needed |= {name for effect in effects if effect.own for name in effect.reads}
    turning = [e.name for e in effects if "motor_position" in e.reads]
    if turning and "motor_position" in log:
        pair = TURNS_WITH_OUTPUT.get(str(log.facts.get("output_spline")))
        turning = [e.name for e in effects if pair in [of for _, of in e.harmonics]]
    if turning:
        needed.add("output_position")
    for name in sorted(needed):
        if name not in log:
            users = listed([e.name for e in effects if name in e.reads] or turning)
            by_current = name == "motor_torque" and "motor_current" in log
            remedy = "give torque_constant" if by_current else "map a column to it"
            raise InputError(
                f"log '{log.name}': {users} needs the channel {name}; it has "
                f"{listed(log.channels)}; {remedy} or leave the effect out"
            )
    return log


def channels_read(
    log: Log, effects: Sequence[Effect], target: str, known_load: str | None
) -> set[str]:
    """Return the channels of a log that a fit of these effects reads, or derives others of."""
    read = {channel for effect in effects for channel in effect.reads}
    made_of = {
        "output_velocity": "output_position",
        "output_acceleration": "output_position",
        "motor_torque": "motor_current",
    }
    read |= {source for name, source in made_of.items() if name in read and name not in log}
    if "motor_position" in read:
        read.add("output_position")
    return read | {"time", *_PER_TARGET.get(target, ()), *([known_load] if known_load else [])}


def without_unread(
    logs: Sequence[Log], effects: Sequence[Effect], target: str, known_load: str | None
) -> tuple[list[Log], list[str]]:
    """Return logs without channels that are not finite and that a fit does not read.

    Such a channel says nothing against the others. What is left out is returned as sentences.
    """
    left, said = list[Log](), list[str]()
    for log in logs:
        unread = set(log.channels) - channels_read(log, effects, target, known_load)
        counts = {name: np.count_nonzero(~np.isfinite(log[name])) for name in sorted(unread)}
        notes = {
            name: f"{name} is NaN or infinite in {count} row{'' if count == 1 else 's'}; the fit "
            "does not read it and goes on without it."
            for name, count in counts.items()
            if count
        }
        said += [f"{log.name}: {note}" for note in notes.values()]
        left.append(log.without(notes, [*notes.values()]))
    return left, said


def core_channels(
    log: Log, effects: Sequence[Effect], known_load: str | None, carried: Carried | None = None
) -> dict[str, Array]:
    """Return the channels that the core reads, by its names; `carried` is part of the load.

    `time` [s] counts from the first row. Effects that remember get the `period` [s] since the row
    before, 0 where the memory starts anew: at the first row and behind each gap.
    """
    reads = {channel for effect in effects for channel in effect.reads}
    names = set(reads) - {"load"}
    if "motor_position" in reads:
        names.add("output_position")
    channels = {name: np.ascontiguousarray(log[name]) for name in names if name in log}
    if "time" in channels:
        channels["time"] = channels["time"] - channels["time"][0]
    if known_load is not None and known_load in log:
        load = log[known_load] if carried is None else log[known_load] + carried.torque(log)
        channels["known_load"] = np.ascontiguousarray(load)
    if any(effect.info.remembers for effect in effects):
        channels["period"] = np.diff(log["time"], prepend=log["time"][:1])
        channels["period"][runs(log["time"])[:, 0]] = 0.0
    return channels


TURNS_WITH_OUTPUT = {
    "circular": "wave_generator_on_circular_spline",
    "flex": "wave_generator_on_flexspline",
}
"""The pair that the motor's angle alone does not tell, by the spline that is the output."""


def gear_of(facts: Mapping[str, Any], motor_encoder: bool) -> dict[str, Any]:
    """Return the gear as `_core.Design` takes it; without a ratio the motor turns with q."""
    spline = str(facts.get("output_spline", "unknown"))
    ratio = float(facts.get("gear_ratio", 1.0))
    return {
        "effective_ratio": ratio + (spline == "circular"),
        "output_spline": spline,
        "motor_encoder": motor_encoder,
    }


def _ratio(log: Log, target: str) -> float:
    if log.effective_ratio is None:
        raise InputError(f"log '{log.name}': target {target} needs the gear ratio; give gear_ratio")
    return log.effective_ratio


def require_finite(log: Log, columns: Mapping[str, Array]) -> None:
    """Refuse columns (N,) with NaN, infinities or an overload, naming channel and row."""
    for name, values in columns.items():
        low, high = limits_of(name)
        if low <= values.min() and values.max() <= high:
            continue
        beyond = np.flatnonzero(np.isfinite(values) & ((values < low) | (values > high)))
        if len(beyond):
            raise InputError(
                f"log '{log.name}': {name} is {values[beyond[0]]:.4g} in row {beyond[0]}, which no "
                f"{who_reads(name)} (rows of this kind: {len(beyond)}): an overload is written so, "
                "or a broken connection; ask for the repair drop_invalid, or correct the recording"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"log '{log.name}': {name} is not finite in {len(bad)} rows, first in row "
                f"{bad[0]}; ask for the repair drop_invalid, or correct the recording"
            )


def require_apart(logs: Sequence[Log]) -> None:
    """Refuse a run that is there twice: it would be held out and fitted at once."""
    for number, other in copies(logs):
        raise InputError(
            f"run {number + 1} of {len(logs)}, {called(logs[number])}, holds the same values as "
            f"the run {called(logs[other])}: a run counts once; leave one of them out"
        )


def require_change(target: str, columns: Sequence[Array]) -> None:
    """Refuse a target, (N,) for each run, that is one number throughout, or next to nothing."""
    if all(np.all(values == columns[0][0]) for values in columns):
        raise InputError(
            f"the target {target} is {columns[0][0]:.6g} in every row of all logs: there is "
            "nothing to explain; check the wiring and the column map, or record runs with motion "
            "and load"
        )
    size = max(float(np.max(np.abs(values), initial=0.0)) for values in columns)
    if size < LEAST:
        raise InputError(
            f"the target {target} is at most {size:.3g} in all logs, which no instrument resolves; "
            "correct the unit of its column"
        )


def require_one_unit(effects: Sequence[Effect], target: str, known_load: str | None) -> None:
    """Refuse effects of a load that would be a sum of Nm and A.

    The load is the known one and that of the model's own inertia and gravity,
    which of a motor current is in A.
    """
    if target != "motor_current" or known_load is None:
        return
    own = [effect.name for effect in effects if effect.info.carries_load]
    readers = [e.name for e in effects if "load" in e.reads and not e.info.traits.known_load]
    if own and readers:
        raise InputError(
            f"effect '{readers[0]}' reads the load, which would be {known_load} in Nm and "
            f"{listed(own)} of motor_current in A; give the target motor_torque and "
            "--torque-constant, or leave one of them out"
        )


def require_load(effects: Sequence[Effect], known_load: str | None) -> None:
    """Refuse effects of a load that neither a channel nor the model tells."""
    if known_load is not None:
        return
    own = any(effect.info.carries_load for effect in effects)
    for effect in effects:
        if effect.info.traits.known_load:
            raise InputError(
                f"effect '{effect.name}' needs a known load; name its channel with known_load, or "
                "leave the effect out"
            )
        if "load" in effect.reads and not own:
            raise InputError(
                f"effect '{effect.name}' depends on the load, which neither a known load nor "
                "inertia or gravity tells; give known_load, add one of these, or leave it out"
            )


def gear_for(
    logs: Sequence[Log], target: str, effects: Sequence[Effect], known_load: str | None = None
) -> dict[str, Any]:
    """Return the gear that all logs agree on, as `_core.Design` takes it.

    `known_load`: the channel that is taken off the target; off a current by one torque constant.
    """
    scale = ["torque_constant"] if target == "motor_current" and known_load is not None else []
    for key in ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", *scale):
        values = list(dict.fromkeys(log.facts.get(key, "unknown") for log in logs))
        if len(values) > 1:
            raise InputError(
                f"the logs disagree on {key}: {listed(values)}; they must be of one joint"
            )
    facts = dict(logs[0].facts)
    encoders = {"motor_position" in log for log in logs}
    motor_side = [e.name for e in effects if "motor_position" in e.reads]
    if motor_side and len(encoders) > 1:
        raise InputError("some logs have motor_position and others not; give it in all or none")
    if motor_side and "gear_ratio" not in facts:
        raise InputError(f"{listed(motor_side)} needs the gear ratio; give gear_ratio")
    return gear_of(facts, encoders == {True})
