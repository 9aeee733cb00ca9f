"""A model of one joint: effects with their coefficients for each target, kept in one JSON file.

It may begin as the joint of an MJCF file or a URDF. A model can be saved, exported and run whatever
its fit said of it. Its warnings tell a user who did not make the fit what limits it, by itself and
on a given log.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from flexspline.about import __version__
from flexspline.effects import Effect, slices_of, unit_in
from flexspline.effects.causes import (
    COULOMB,
    COULOMB_PER_DIRECTION,
    GRAVITY,
    INERTIA,
    OFFSET,
    POLYNOMIAL_FRICTION,
    PRESLIDING,
    VISCOUS,
)
from flexspline.errors import FlexsplineWarning, InputError, did_you_mean, listed, shortened
from flexspline.estimators import ESTIMATORS, Estimator
from flexspline.estimators.checks import require_complete
from flexspline.files import atomic_write, refuse_special, text_of
from flexspline.formatting import short, short_names
from flexspline.joint_file import JointNumbers, is_joint_file, read_joint
from flexspline.logs.channels import CHANNELS
from flexspline.logs.derive import lowpass
from flexspline.logs.log import Log, measurable
from flexspline.logs.read import LogLike, as_log, as_logs, is_one
from flexspline.logs.segments import output_speed
from flexspline.own import Design, OwnEffect, design_of, own_effects
from flexspline.part import PART_OF, SIDES, Part, part_from_json, part_to_json
from flexspline.prediction import Prediction, Predictions, require_rows
from flexspline.prepared import prepared
from flexspline.schema import json_content, require_schema
from flexspline.signals import Carried, channels_for, core_channels, gear_of, target_of
from flexspline.simulator import paired, simulation_of

__all__ = [
    "ANGLES",
    "MARGIN",
    "PART_OF",
    "Model",
    "Part",
    "Prediction",
    "Predictions",
    "carried_beside",
    "fitted_to",
    "gravity_on_gear",
    "load_words",
    "lowpass_remark",
    "no_drive_has",
    "own_of_runs",
    "part_warnings",
    "range_warnings",
    "refuse_warnings",
    "require_model",
    "rows_outside",
    "sign_warnings",
    "sliding_weights",
    "undetermined_gravity",
    "weight_left_out",
    "widened",
]

Array = NDArray[np.float64]

FORMAT = "flexspline-model"
VERSION = 1
CORRECTING = 2
"""Version of a model with a part that corrects a foreign simulation: who does not know of that
would take the correction for the whole."""
HIDDEN = "not determined"  # state of a coefficient that runs tell beside others alone
GEAR = ("gear_ratio", "output_spline")

OF_JOINT = ("motor_torque", "sensor_torque")
"""Targets that the joint of a simulator explains: a torque at the output."""

TWO_SIDED_95 = 1.959964  # standard normal quantile: an interval of 95 % leaves out zero
CHI_SQUARED_95 = 5.991465  # of two degrees of freedom: cosine and sine of an order together

# Share of a range's width that a reading may lie beyond its ends: runs of one motion differ by
# their noise. Of five rig runs, each beside the fit of the others, 3 are warned of without it and
# none at 0.025 to 0.1; of five lab runs that truly differ, 5 at 0.025, 4 at 0.05, 2 at 0.1.
MARGIN = 0.05

LITTLE = 0.01
"""Share of a load's range up to which a weight beside it is not worth a word: gravity that a fit
finds where there is none is that of its noise."""

TURN = 2.0 * np.pi
ANGLES = ("output_position", "motor_position")  # no effect tells one turn from another


@dataclass(frozen=True)
class Model:
    """One joint: gear facts and up to three parts, "sensor", "drive" and "torsion".

    `facts`: gear_ratio, output_spline, pole_pairs, slots, torque_constant [Nm/A], joint.
    `estimators`: what `estimate` runs with, by key ("observer": an `Observer`).
    """

    parts: Mapping[str, Part]
    facts: Mapping[str, Any] = field(default_factory=dict)
    estimators: Mapping[str, Estimator] = field(default_factory=dict)

    def __repr__(self) -> str:
        joint = self.facts.get("joint")
        parts = [f"{key}: {', '.join(e.name for e in p.effects)}" for key, p in self.parts.items()]
        own = [f"estimators: {', '.join(self.estimators)}"] if self.estimators else []
        return "\n  ".join([f"<Model of {joint}" if joint else "<Model", *parts, *own]) + ">"

    def __post_init__(self) -> None:
        for key, estimator in self.estimators.items():
            if type(estimator) is not ESTIMATORS.get(key):
                near = did_you_mean(key, ESTIMATORS)
                raise InputError(
                    f"the model's estimator '{key}'{near} is a {type(estimator).__name__}; "
                    f"give one of flexspline.estimators by its key: {listed(ESTIMATORS)}"
                )
            if estimator.key != key:
                raise InputError(
                    f"the model's estimator '{key}' is one whose key is {estimator.key}; give it "
                    "by that key, or use model.with_estimator"
                )

    def part(self, target: str | None = None) -> Part:
        """Return the part of a target; None picks the only one.

        Raises
        ------
        InputError
            Where there is none, or several and no target is given.
        """
        if not self.parts:
            holds = (
                f"; it holds the estimators {listed(self.estimators)}" if self.estimators else ""
            )
            raise InputError(
                f"the model explains no target{holds}; a fit into it adds a part that does "
                "(into=, --into MODEL.json)"
            )
        if target is None:
            if len(self.parts) == 1:
                return next(iter(self.parts.values()))
            known = listed(part.target for part in self.parts.values())
            raise InputError(f"the model has parts for {known}; say which target")
        for part in self.parts.values():
            if part.target == target:
                return part
        known = listed(part.target for part in self.parts.values())
        raise InputError(f"the model has no part for the target {target}; it has {known}")

    def with_part(self, part: Part, facts: Mapping[str, Any]) -> Model:
        """Return the model with this part added or replaced.

        Raises
        ------
        InputError
            Where the facts are of another joint.
        """
        parts = {**self.parts, PART_OF[part.target]: part}
        scales = [name for own in parts.values() for name in _scales(own)]
        self._require_same(("joint", *scales, "pole_pairs", "slots"), facts, "the logs have")
        known = {key: value for key, value in facts.items() if value is not None}
        return replace(self, parts=parts, facts={**self.facts, **known})

    def with_estimator(self, estimator: Estimator) -> Model:
        """Return the model with this estimator added or replaced.

        Parameters
        ----------
        estimator : one of `flexspline.estimators`, such as ``Observer(gain=80.0)``.

        Raises
        ------
        InputError
            Where the model lacks a part or an estimator that it reads; the sentence names the
            command that makes it.
        """
        key = getattr(estimator, "key", type(estimator).__name__)
        made = replace(self, estimators={**self.estimators, key: estimator})
        require_complete(made.estimators, made.parts)
        return made

    @overload  # a name of a file is one log
    def predict(  # type: ignore[overload-overlap]
        self,
        log: LogLike,
        target: str | None = None,
        *,
        lowpass_hz: float | None = None,
        simulation: LogLike | Sequence[LogLike] | None = None,
        simulated_torque: str | None = None,
        speed_above: float | None = None,
    ) -> Prediction: ...
    @overload
    def predict(
        self,
        log: Iterable[LogLike],
        target: str | None = None,
        *,
        lowpass_hz: float | None = None,
        simulation: LogLike | Sequence[LogLike] | None = None,
        simulated_torque: str | None = None,
        speed_above: float | None = None,
    ) -> Predictions: ...
    def predict(
        self,
        log: LogLike | Iterable[LogLike],
        target: str | None = None,
        *,
        lowpass_hz: float | None = None,
        simulation: LogLike | Sequence[LogLike] | None = None,
        simulated_torque: str | None = None,
        speed_above: float | None = None,
    ) -> Prediction | Predictions:
        """Return measured and predicted y of a log, or of several with their pooled error.

        Parameters
        ----------
        log : a log, or what `read_log` reads as one, with the channels that the effects read; a
            missing velocity or acceleration is derived from the position, and one that the model
            expects smoothed is smoothed. Or several of them, such as a list.
            A part that corrects a simulation adds to what that says: the channel
            `simulated_torque`, or what `simulation` and `simulated_torque` name.
        target : which part; None picks the only one.
        lowpass_hz : zero-phase low pass on both, Hz; None for none.
        simulation : what the simulation says of this run, in a log of its own; of several runs one
            for each, in their order.
        simulated_torque : its column, there or in the run.
        speed_above : rad/s; rows whose output is slower are left out of the errors. The speed is
            that of output_velocity, or of the derivative of output_position.

        Returns
        -------
        A `Prediction` of one log; of several, a list of one included, their `Predictions`.

        Raises
        ------
        InputError
            Where a channel that an effect reads is missing, the gear is another one, or no row is
            so fast.
        """
        part = self.part(target)
        logs = as_logs(log)
        if not logs:
            raise InputError("there is no log to predict; give at least one")
        simulations: Sequence[Log | None] = (
            [None] * len(logs) if simulation is None else paired(logs, simulation)
        )
        made = tuple(
            replace(
                self._predicted(part, one, lowpass_hz, other, simulated_torque),
                name=one.name,
                speed_above=speed_above,
                speed=None if speed_above is None else output_speed(one, speed_above),
            )
            for one, other in zip(logs, simulations, strict=True)
        )
        require_rows(made)
        return made[0] if is_one(log) else Predictions(made)

    def _predicted(
        self,
        part: Part,
        log: Log,
        lowpass_hz: float | None,
        simulation: Log | None,
        simulated_torque: str | None,
    ) -> Prediction:
        """What a part says of one log, and how far that is off."""
        log, said = measurable(log)
        self.require_scales(log, part)
        if simulation is not None or simulated_torque is not None:
            log = self._with_simulation(part, log, simulation, simulated_torque)
        measured = self._measured(part, log)
        inputs = prepared(log, part.preparations)
        inputs = channels_for(inputs, part.effects, part.known_load, load_needed=False)
        predicted = self._evaluate(part, inputs, part.coefficients)
        if part.simulated is not None:
            predicted = predicted + simulation_of(log, part.target, part.simulated, part.known_load)
        if lowpass_hz is not None:
            predicted = lowpass(predicted, log["time"], lowpass_hz).values
            measured = lowpass(measured, log["time"], lowpass_hz).values
        warnings = (
            *said, *part_warnings(part), *_without_load(part, log), *range_warnings(part, inputs)
        )  # fmt: skip
        time = np.asarray(log["time"])
        return Prediction(time, measured, predicted, part.target, part.unit, warnings)

    def _with_simulation(
        self, part: Part, log: Log, simulation: Log | None, column: str | None
    ) -> Log:
        from flexspline.simulator import with_simulation

        if part.simulated is None:
            raise InputError(
                f"the part for {part.target} corrects no simulation; leave simulated_torque and "
                "simulation out"
            )
        return with_simulation(log, part.target, simulation, column)[0]

    def require_scales(self, log: Log, part: Part) -> None:
        """Refuse a log of another gear, or whose current is worth another load."""
        self._require_same(_scales(part), log.facts, f"log '{log.name}' has")

    def rows(self, log: LogLike, target: str | None = None) -> Array:
        """Return what each coefficient multiplies, (N, P), as `components` adds it up."""
        part = self.part(target)
        log = prepared(measurable(as_log(log))[0], part.preparations)
        log = channels_for(log, part.effects, part.known_load, load_needed=False)
        channels = core_channels(log, part.effects, part.known_load, part.carried)
        return np.asarray(self._design(part, log).rows(channels, len(log), part.coefficients))

    def components(self, log: LogLike, target: str | None = None) -> dict[str, Array]:
        """Return what each effect contributes, (N,) by its name, in the unit of the target."""
        part, rows = self.part(target), self.rows(log, target)
        return {
            effect.name: np.asarray(rows[:, at] @ part.coefficients[at])
            for effect, at in zip(part.effects, slices_of(part.effects), strict=True)
        }

    def to_json(self) -> str:
        """Return the model as text in the format of `model.json`."""
        content = {
            "format": FORMAT,
            "version": self._version,
            "made_by": f"flexspline {__version__}",
            "joint": dict(self.facts),
            **{name: part_to_json(self.parts[name]) for name in SIDES if name in self.parts},
            "estimators": {
                key: self.estimators[key].to_json() for key in ESTIMATORS if key in self.estimators
            },
        }
        require_schema(content, "model")
        return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write `model.json`, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        atomic_write(path, self.to_json())

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        own: OwnEffect | Iterable[OwnEffect] = (),
        *,
        joint: str | None = None,
        target: str | None = None,
    ) -> Model:
        """Read a `model.json`, or a joint of an MJCF file or a URDF to start from.

        Damping, frictionloss or friction, and armature of such a joint become viscous and Coulomb
        friction and inertia of a torque at the output. Whatever else it has is left out. Nothing of
        it is held: `discover` fits the values again, unless it is told which are fixed. An XML file
        that declares anything or includes others is refused.

        Parameters
        ----------
        path : an XML file is told by its name (.xml, .urdf, .mjcf) or by its first letter, "<".
        own : effects of your own (`flexspline.own_effect`), those of the model among them: a file
            keeps their names, terms and shapes, and no function.
        joint : its name in an MJCF file or a URDF; None where that has one that turns.
        target : what a joint of these explains: "motor_torque", as by itself, or "sensor_torque".

        Raises
        ------
        InputError
            Where the file is missing, is no model, is damaged, is of a newer version, or has an
            effect of its maker's own that is not given; of an MJCF file or a URDF where it has no
            such joint, two of a name, or a number that is none or negative.

        Warns
        -----
        FlexsplineWarning
            Of a spring that the joint has, for which there is no effect, and of what actuators of
            an MJCF file add to it.
        """
        refuse_special(path, "a model.json")
        if is_joint_file(path):
            numbers = read_joint(path, joint)
            for sentence in numbers.left_out:
                warnings.warn(sentence, FlexsplineWarning, stacklevel=2)
            return _of_numbers(numbers, target or "motor_torque", str(path))
        return cls.from_json(text_of(path, "a model.json"), str(path), own)

    @classmethod
    def from_json(
        cls, text: str, label: str = "model", own: OwnEffect | Iterable[OwnEffect] = ()
    ) -> Model:
        """Return the model that `to_json` wrote; `label` begins its errors, `own` as for `load`."""
        content = json_content(text, label)
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise InputError(f"{label}: is no flexspline model; give a model.json")
        _require_version(content.get("version"), label)
        require_schema(content, label)
        corrects = any("simulated" in content.get(name, {}) for name in SIDES)
        if content["version"] != (CORRECTING if corrects else VERSION):
            raise InputError(
                f"{label}: has version {content['version']} of the format, which is of models that "
                f"{'correct no' if corrects else 'correct a'} simulation; fit the model again"
            )
        given = own_effects(own)
        parts = {
            name: part_from_json(name, content[name], f"{label}: {name}", given)
            for name in SIDES
            if name in content
        }
        return cls(parts, content["joint"], _estimators(content.get("estimators", {}), label))

    @property
    def _version(self) -> int:
        corrects = any(part.simulated is not None for part in self.parts.values())
        return CORRECTING if corrects else VERSION

    def _require_same(self, keys: Sequence[str], facts: Mapping[str, Any], whose: str) -> None:
        for key in keys:
            mine, other = self.facts.get(key), facts.get(key)
            if mine is not None and other is not None and mine != other:
                raise InputError(
                    f"the model has {key} = {mine}, {whose} {other}; they must be of one joint"
                )

    def _design(self, part: Part, log: Log) -> Design:
        return design_of(part.effects, gear_of(self.facts, _by_motor_encoder(part, log)))

    def _evaluate(self, part: Part, log: Log, coefficients: Array) -> Array:
        """Prediction (N,); NaN where a channel that it reads is not finite."""
        channels = core_channels(log, part.effects, part.known_load, part.carried)
        if not _by_motor_encoder(part, log):
            channels.pop("motor_position", None)
        values = np.asarray(self._design(part, log).predict(channels, len(log), coefficients))
        for data in channels.values():
            values[~np.isfinite(data)] = np.nan
        return values

    def _measured(self, part: Part, log: Log) -> Array:
        """The y of the log (N,); NaN where it lacks the channels."""
        facts = {key: self.facts[key] for key in _scales(part) if key in self.facts}
        try:
            return target_of(log.with_facts(facts), part.target, part.known_load)
        except InputError:
            return np.full(len(log), np.nan)


def _require_version(version: object, label: str) -> None:
    """Refuse a version of the format that is missing, is no number or is not known here."""
    known = f"this flexspline reads the versions {VERSION} and {CORRECTING}"
    if isinstance(version, bool) or not isinstance(version, (int, float)):
        has = "no version" if version is None else f"the version {shortened(repr(version), 40)}"
        raise InputError(
            f"{label}: has {has} of the format where a number belongs; {known}: write the one that "
            "it is of as a number, or fit the model again"
        )
    if version not in (VERSION, CORRECTING):
        raise InputError(
            f"{label}: has version {version} of the format, and {known}; update flexspline or "
            "export the model again"
        )


def _of_numbers(joint: JointNumbers, target: str, label: str) -> Model:
    """The model of a joint that a simulator has; numbers that are zero make no effect."""
    if target not in OF_JOINT:
        raise InputError(
            f"{label}: the joint of a simulator has a torque at the output, and the target is "
            f"{target}; give {' or '.join(OF_JOINT)}"
        )
    linear, *bent = (*joint.damping, 0.0, 0.0)[:3]
    numbers = {
        INERTIA: [joint.armature],
        VISCOUS: [linear],
        POLYNOMIAL_FRICTION: bent,
        COULOMB: [joint.friction],
    }
    made = {name: values for name, values in numbers.items() if any(values)}
    coefficients = np.array([value for values in made.values() for value in values])
    part = Part(target, tuple(Effect(name) for name in made), coefficients)
    return Model({PART_OF[target]: part}, {"joint": joint.name} if joint.name else {})


def _estimators(content: Mapping[str, Any], label: str) -> dict[str, Estimator]:
    try:
        return {key: ESTIMATORS[key].from_json(entry) for key, entry in content.items()}
    except InputError as error:
        raise InputError(f"{label}: estimators: {error}") from error


def _scales(part: Part) -> tuple[str, ...]:
    """Facts of the joint that the y of a part is made with."""
    in_amperes = part.target == "motor_current" and part.known_load is not None
    return (*GEAR, "torque_constant") if in_amperes else GEAR


def _by_motor_encoder(part: Part, log: Log) -> bool:
    """Whether the motor's angle is measured: as in the fit, for the encoders' zeros differ."""
    fitted = part.record.get("channels")
    motor_side = any("motor_position" in effect.reads for effect in part.effects)
    if fitted is None or not motor_side:
        return "motor_position" in log
    if "motor_position" in fitted and "motor_position" not in log:
        raise InputError(
            f"log '{log.name}': the model was fitted with the channel motor_position, which the "
            "log lacks; map a column to it or fit the model without"
        )
    return "motor_position" in fitted


def gravity_on_gear(model: Model) -> Part | None:
    """Return gravity alone, of the drive's part, else of the sensor's: what a gear carries too."""
    for name in ("drive", "sensor"):
        part = model.parts.get(name)
        if part is not None and part.unit == "Nm" and any(e.name == GRAVITY for e in part.effects):
            return part.keeping(lambda effect: effect.name == GRAVITY)
    return None


def carried_beside(
    model: Model | None, runs: Sequence[Log], target: str, known_load: str | None
) -> tuple[Carried | None, list[str]]:
    """Return the weight that twists a gear beside a known load, and what is to be said of it.

    It is the gravity that `estimate` takes off the gear's torque, where that was fitted beside the
    same known load, so that the load does not hold it. Where it was not, the load may.
    """
    part = None if model is None or target != "torsion" else gravity_on_gear(model)
    if part is None or known_load is None or part.simulated is not None:
        return None, []
    carried = Carried(part.target, tuple(part.coefficients.tolist()))
    if part.known_load == known_load:
        said = undetermined_gravity(part, "part of the load here", "offset and stiffness")
        return carried, [said] if said else []
    there = [run for run in runs if known_load in run and "output_position" in run]
    weights = [np.abs(carried.torque(run)) for run in there]
    largest = max((float(np.nanmax(each)) for each in weights), default=0.0)
    load = max((float(np.ptp(run[known_load])) for run in there), default=0.0)
    if not largest > LITTLE * load:
        return None, []
    return None, [
        f"{carried.words} is up to {largest:.3g} Nm at the angles of these runs, and that part was "
        f"not fitted beside {known_load}, so whether {known_load} holds this weight is not known. "
        "It is taken to hold it; if it does not, the weight is in offset and stiffness here, and "
        f"estimate takes it off once more: fit the part for {part.target} with known_load="
        f"'{known_load}' (a channel of zeros where the joint was free), then the torsion again"
    ]


def undetermined_gravity(part: Part, role: str, suffers: str) -> str:
    """Return a sentence where the fit of a part did not tell its gravity from other effects.

    `role`: what the gravity is here, and `suffers`: what is wrong by it.
    """
    told = {entry["name"]: entry["state"] for entry in part.record.get("parameters", ())}
    unknown = {name for name, state in told.items() if state == "not determined"}
    if not any(name.startswith(f"{GRAVITY}.") for name in unknown):
        return ""
    groups = [set(group["names"]) for group in part.record.get("confounded", ())]
    alike = {name for group in groups if group & unknown for name in group}
    beside = sorted(short_names(n) for n in alike if not n.startswith(f"{GRAVITY}."))
    whose = f": its runs do not tell it from {listed(beside)}" if beside else ""
    return (
        f"the gravity of the part for {part.target}, which is {role}, was not determined by its "
        f"fit{whose}; {suffers} may be off by any weight, most at angles that its runs lack: fit "
        "that part again with runs over a wider range of the joint's angle"
    )


def weight_left_out(torsion: Part, gravity: Part) -> str:
    """Return a sentence where a gear's torsion was fitted without the weight that is taken off it.

    That is where the gravity was found beside the same known load, which so does not hold it.
    """
    known = torsion.known_load
    if known is None or torsion.carried is not None or gravity.known_load != known:
        return ""
    low, high = torsion.record.get("validity", {}).get("known_load", (0.0, 0.0))
    weight = float(np.hypot(*gravity.coefficients))
    if not weight > LITTLE * (high - low):
        return ""
    return (
        f"the part for torsion was fitted to {known} alone, without the gravity of the part for "
        f"{gravity.target} (up to {weight:.3g} Nm) that is taken off the gear's torque, so that "
        "external_torque_compliance is off by the weight at the angles of its runs: fit the "
        "torsion again into this model"
    )


def load_words(part: Part) -> str:
    """Return what a part's effects read as the known load, in words."""
    if part.known_load is None:
        return "none"
    return part.known_load + (f" + {part.carried.words}" if part.carried is not None else "")


def part_warnings(part: Part) -> list[str]:
    """Return what is wrong with a part, a sentence each: signs, significance, bounds."""
    said = sign_warnings(part)
    weak = [*_weak_terms(part), *_weak_orders(part)]
    if weak:
        said.append(
            f"the model of {part.target} has terms that are not significant (95 %): "
            f"{listed(weak)}; leave them out, or record runs that show them"
        )
    varied = [*_varied_terms(part)]
    if varied:
        said.append(
            f"the model of {part.target} was fitted to runs that differ in {listed(varied)}; it "
            "holds their mean, and a new run differs from that by as much"
        )
    stuck = [
        f"{entry['name']} ({entry['state'].removeprefix('at ')})"
        for entry in part.record.get("parameters", ())
        if entry["state"] in ("at lower bound", "at upper bound")
    ]
    if stuck:
        said.append(
            f"the model of {part.target} has parameters that ended at a bound of their search: "
            f"{listed(stuck)}; the model may lack something else"
        )
    return said


def lowpass_remark(part: Part, lowpass_hz: float | None, who: str = "") -> str:
    """Return a sentence where the part was fitted behind another low pass than this; "" if not.

    `who`: how the model is called, where there are several.
    """
    fitted = part.record.get("lowpass")
    if fitted == lowpass_hz or "lowpass" not in part.record:
        return ""
    here = "nothing is low-passed" if lowpass_hz is None else f"the low pass is {lowpass_hz:g} Hz"
    who = who or f"The model of {part.target}"
    if fitted is None:
        return (
            f"{who} was fitted without a low pass, and here {here}: errors are not those of its "
            "fit."
        )
    return (
        f"{who} was fitted behind a low pass of {fitted:g} Hz, and here {here}: errors are not "
        "those of its fit, which has nothing of what lies above. To compare as it was fitted, give "
        f"lowpass (--lowpass {fitted:g})."
    )


def fitted_to(part: Part, log: Log) -> bool:
    """Whether the part's record says that it was fitted to this log: its file, or name and rows."""
    own = log.source.sha256 if log.source else None

    def same(entry: Mapping[str, Any]) -> bool:
        if own is not None or entry.get("sha256") is not None:
            return bool(entry.get("sha256") == own)
        return bool(entry.get("name") == log.name and entry.get("rows") == len(log))

    return any(same(entry) for entry in part.record.get("logs", ()))


def _without_load(part: Part, log: Log) -> list[str]:
    """Return a sentence where a run lacks the known load that effects of a part read, or none."""
    readers = [effect.name for effect in part.effects if "load" in effect.reads]
    if not readers or part.known_load is None or part.known_load in log:
        return []
    return [
        f"log '{log.name}': no {part.known_load}, which {listed(readers)} of the model of "
        f"{part.target} {'read' if len(readers) > 1 else 'reads'}; predicted as without a load"
    ]


def range_warnings(part: Part, log: Log) -> list[str]:
    """Return a sentence where rows of a log lie outside of what the part was fitted to, or none.

    Parameters
    ----------
    log : with the channels that the part's effects read, made as it expects them.
    """
    found = rows_outside(part, log)
    if not found:
        return []
    channels = core_channels(log, part.effects, part.known_load, part.carried)
    named = []
    for name, rows in found.items():
        reached, (low, high) = channels[name][rows], part.record["validity"][name]
        unit = CHANNELS[name].unit if name in CHANNELS else "Nm"
        named.append(
            f"{name} from {reached.min():.3g} to {reached.max():.3g} {unit} "
            f"(fitted from {low:.3g} to {high:.3g})"
        )
    count = np.count_nonzero(np.any(list(found.values()), axis=0))
    return [
        f"log '{log.name}': {count} of {len(log)} rows lie outside of what the model of "
        f"{part.target} was fitted to, by more than {100.0 * MARGIN:g} % of its range: "
        f"{listed(named)}; it extrapolates there"
    ]


def rows_outside(part: Part, log: Log) -> dict[str, NDArray[np.bool_]]:
    """Return the rows outside of the part's ranges, (N,) by channel; channels that have any."""
    ranges: Mapping[str, Sequence[float]] = part.record.get("validity", {})
    channels = core_channels(log, part.effects, part.known_load, part.carried)
    rows = {name: _beyond(name, channels[name], *ranges[name]) for name in channels.keys() & ranges}
    return {name: rows[name] for name in ranges if name in rows and rows[name].any()}


def widened(low: float, high: float) -> tuple[float, float]:
    """Return the ends of a range with the margin on both sides."""
    slack = MARGIN * (high - low)
    return low - slack, high + slack


def require_model(given: object, name: str = "model") -> None:
    """Refuse what is no model, such as the path of one or a fit, and say how to give that one.

    `name` is what the sentence calls it.
    """
    if isinstance(given, Model):
        return
    how = "a model, as Model.load or a fit makes it"
    if isinstance(given, (str, os.PathLike)):
        how = f"what it holds, Model.load({os.fspath(given)!r})"
    elif isinstance(getattr(given, "model", None), Model):
        how = "the model that it holds, its .model"
    raise InputError(f"{name} is a {type(given).__name__}; give {how}")


def refuse_warnings(said: Sequence[str]) -> None:
    """Raise the first of these sentences as an `InputError`, and say how many others there are."""
    if said:
        more = f" (and {len(said) - 1} more of the kind)" if len(said) > 1 else ""
        raise InputError(f"{said[0]}{more}; without strict this is a warning")


def sign_warnings(part: Part, *, significant: bool = False) -> list[str]:
    """Return a sentence for each friction and inertia below zero, which no drive has.

    `significant`: of those that `negative_terms` returns with it.
    """
    return [
        f"{term.name} = {term.value:.3g}{_unit(term.unit, part)} {no_drive_has(term.what)}"
        f"{'' if term.significant else ', and not significant'}; fit it again with "
        "bounds, or with runs that show it"
        for term in negative_terms(part, significant=significant)
    ]


def no_drive_has(what: str) -> str:
    """Return what is wrong with a friction or inertia below zero, behind its value."""
    return f"is negative {what}, which no drive has"


class NegativeTerm(NamedTuple):
    """A friction or inertia below zero: short name, value, unit, which of the two it is."""

    name: str
    value: float
    unit: str
    what: str
    significant: bool


def negative_terms(part: Part, *, significant: bool = False) -> list[NegativeTerm]:
    """Return each friction and inertia below zero, which no drive has.

    Of a drive alone, for a sensor may see friction from either side; and of a drive itself, for
    what corrects a foreign simulation may be too much in that. A coefficient that the runs do not
    determine by itself has no sign. Beside presliding, Coulomb friction is a share of what slides,
    and the sum is what has a sign (`sliding_weights`). `significant`: those alone.
    """
    if PART_OF[part.target] != "drive" or part.simulated is not None:
        return []
    entries = part.record.get("parameters", ())
    hidden = {p["name"] for p in entries if p["state"] == HIDDEN}
    near = {p["name"] for p in entries if not _significant(p)}
    weights = sliding_weights(part)
    shares = dict.fromkeys(name.split(".")[0] for name in weights)
    found = []
    if weights and not hidden.intersection(weights):
        value, sure = _sliding(part, weights)
        if value < 0.0 and (sure or not significant):
            found.append(NegativeTerm(" + ".join(shares), value, "Nm", "friction", sure))
    for effect, values in part.by_effect():
        if hidden.intersection(f"{effect.name}.{term.name}" for term in effect.terms):
            continue
        if effect.name in shares:
            continue
        unit, name = effect.terms[0].unit if effect.terms else "", effect.name
        what = name.rpartition("_")[2]  # friction or inertia
        if effect.info.traits.one_signed and len(effect.terms) == 1:  # levels of a loop are several
            name, value = f"{name}.{effect.terms[0].name}", float(values[0])
        elif name == COULOMB_PER_DIRECTION:
            name, what = f"the level of {name}", "friction"
            value = 0.5 * float(values[0] - values[1])
        else:
            continue
        sure = name not in near
        if value < 0.0 and (sure or not significant):
            found.append(NegativeTerm(short_names(name), value, unit, what, sure))
    return found


def sliding_weights(part: Part) -> dict[str, float]:
    """Return what each coefficient counts in the friction that slides, where that is a sum.

    The springs of presliding slip once the joint slides, and Coulomb friction has its level there,
    so the split depends on the widths, and physics bounds the sum alone. Empty without both.
    """
    effects = {effect.name: effect for effect in part.effects}
    coulomb = {COULOMB: (1.0,), COULOMB_PER_DIRECTION: (0.5, -0.5)}
    if PRESLIDING not in effects or effects.keys().isdisjoint(coulomb):
        return {}
    springs = [1.0] * len(effects[PRESLIDING].terms)
    return {
        f"{name}.{term.name}": weight
        for name, weights in {**coulomb, PRESLIDING: springs}.items()
        if name in effects
        for term, weight in zip(effects[name].terms, weights, strict=True)
    }


def _sliding(part: Part, weights: Mapping[str, float]) -> tuple[float, bool]:
    """The friction that slides, and whether it is told from zero by its error, if that is known."""
    coefficients = {
        f"{effect.name}.{term.name}": float(one)
        for effect, values in part.by_effect()
        for term, one in zip(effect.terms, values, strict=True)
    }
    value = sum(weight * coefficients[name] for name, weight in weights.items())
    names, covariance = _covariance(part)
    gradient = np.array([weights.get(name, 0.0) for name in names])
    variance = float(gradient @ covariance @ gradient) if gradient.any() else float("nan")
    return value, not value**2 <= TWO_SIDED_95**2 * variance


def _unit(unit: str, part: Part) -> str:
    """The unit of a term behind a space, nothing of a factor."""
    own = unit_in(unit, part.target, part.known_load)
    return "" if own == "1" else f" {own}"


def own_of_runs(part: Part) -> list[Mapping[str, Any]]:
    """What is recorded of terms that each run of the fit had of its own, beside offsets alone."""
    own = [*part.record.get("validated", {}).get("per_run", ())]
    return [] if [term["term"] for term in own] == [f"{OFFSET}.{OFFSET}"] else own


def _varied_terms(part: Part) -> Iterator[str]:
    """Those of these terms that differ between the runs, with their spread."""
    for term in own_of_runs(part):
        if term["differs"] and term["spread"] is not None:
            name = short_names(term["term"])
            yield f"{name} (by {short(term['spread'])} {term['unit']}, standard deviation)"


def _weak_terms(part: Part) -> list[str]:
    """Coefficients of effects without orders that may as well be zero."""
    ripple = {effect.name for effect in part.effects if effect.ripple}
    own = tuple(f"{short_names(term['term'])}." for term in own_of_runs(part))
    return [
        entry["name"]
        for entry in part.record.get("parameters", ())
        if entry["kind"] == "coefficient"
        and entry["state"] in ("fitted", HIDDEN)
        and entry["name"].split(".")[0] not in ripple
        and not entry["name"].startswith(own)
        and not _significant(entry)
    ]


def _significant(entry: Mapping[str, Any]) -> bool:
    """Whether a value is told from zero by its error; where there is none, by being determined."""
    error = entry["standard_error"]
    if error is None:
        return bool(entry["state"] == "fitted")
    return bool(abs(entry["value"]) > TWO_SIDED_95 * error)


def _weak_orders(part: Part) -> list[str]:
    """Orders whose cosine and sine together may as well be zero."""
    names, covariance = _covariance(part)
    place = {name: number for number, name in enumerate(names)}
    found = []
    for effect, values in part.by_effect():
        if effect.ripple:
            names = [f"{effect.name}.{term.name}" for term in effect.terms]
            for number, (order, _) in enumerate(effect.harmonics):
                both = values[2 * number : 2 * number + 2]
                at = [place[n] for n in names[2 * number : 2 * number + 2] if n in place]
                if len(at) == 2 and _near_zero(both, covariance[np.ix_(at, at)]):
                    found.append(f"{effect.name} order {order}")
    return found


def _covariance(part: Part) -> tuple[list[str], Array]:
    """Names of P parameters and their covariance (P, P); none in a file changed by hand."""
    known = part.record.get("covariance", {"names": [], "matrix": []})
    names = [*known["names"]]
    if [len(row) for row in known["matrix"]] != [len(names)] * len(names):
        names, known = [], {"matrix": []}
    return names, np.array(known["matrix"], dtype=np.float64).reshape(len(names), len(names))


def _near_zero(both: Array, covariance: Array) -> bool:
    """Whether bᵀ C⁻¹ b is below the quantile; without a spread nothing is near zero."""
    if not np.isfinite(covariance).all():
        return True
    (a, c), (_, d) = covariance.tolist()
    x, y = both.tolist()
    return bool(d * x * x - 2.0 * c * x * y + a * y * y < CHI_SQUARED_95 * (a * d - c * c))


def _beyond(name: str, values: Array, low: float, high: float) -> NDArray[np.bool_]:
    """Rows whose value is outside of [low, high]; of an angle, whatever the turn."""
    low, high = widened(low, high)
    if name in ANGLES:
        if high - low >= TURN:
            return np.zeros(len(values), dtype=bool)
        return np.asarray(np.mod(values - low, TURN) > high - low)
    return np.asarray((values < low) | (values > high))
