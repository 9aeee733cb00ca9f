"""What the full-range methods read of a log, and the observers that hold the compliant gear.

The third paper names other gear models inside the observer as its next step. Its own, rigid, gear
makes one mass of link and rotor, so its input is the motor torque and all friction is between
input and estimate. With the torque through the mesh known from the torsion there are two masses:

    link    J_l q̈ = τ_gear(Δθ_m) − g(q) − τ_ext,           p_l = J_l q̇
    rotor   Ñ J_m θ̈ = Ñ τ_m − friction − τ_gear,            p_m = Ñ J_m θ̇

"co" observes the link alone: no friction of gear or motor stands in its way, and unlike the
compliance by itself it takes the link's inertia off. "o2" observes the sum of both momenta, with
the rotor's from its own encoder: the paper's observer, less the error of a gear that it takes for
rigid. J_l = J − Ñ² J_m, J the inertia of the drive's part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError
from flexspline.estimation.models import model_inputs
from flexspline.estimation.plan import Plan, plan_of
from flexspline.estimators import Compliance, Observer
from flexspline.full_range.torsion_part import WAVE_GENERATOR, Mesh, mesh_of, only
from flexspline.logs.causal import differentiate_causal
from flexspline.logs.log import Log
from flexspline.logs.read import with_motor_torque
from flexspline.logs.segments import runs
from flexspline.model import Model

__all__ = [
    "Settings",
    "Signals",
    "compliant_observer",
    "link_inertia",
    "signals_of",
    "two_mass_observer",
    "with_estimators",
    "with_velocities",
]

Array = NDArray[np.float64]

BANDWIDTH = 20.0  # Hz, of the causal velocity where a log has none, as `flexspline.estimate`
HYSTERESIS = "torsional_hysteresis"
LOAD = "reference_torque"
ROUNDS = 3  # of torque and hysteresis, each from the other; the loop is a small part of the torsion
SATURATED = 2


@dataclass(frozen=True)
class Settings:
    """Options of the methods.

    Parameters
    ----------
    gain : K of the observers, 1/s.
    margin : share of the way to the mesh's pole that is kept free.
    motion_speed : rad/s at the output from which a row counts as moving.
    rotor_inertia : J_m, kg·m² at the motor; 0 where it is not known.
    """

    gain: float
    margin: float
    motion_speed: float
    rotor_inertia: float = 0.0


@dataclass(frozen=True)
class Signals:
    """One log as the methods read it, arrays (N,).

    `velocity`: rad/s at the output. `observer`, `compliance`: external torque, Nm. `mesh_torsion`:
    Δθ_m, rad at the output, all other effects taken off. `wave_generator`: its part of Δθ, rad at
    the motor. `saturated`: rows held before the pole. `acting`: Ñ τ_m less what the drive's part
    knows but inertia, Nm. `motor_velocity`: θ̇, rad/s.
    """

    time: Array
    velocity: Array
    observer: Array
    compliance: Array
    mesh_torsion: Array
    wave_generator: Array
    saturated: NDArray[np.bool_]
    acting: Array
    motor_velocity: Array


def with_estimators(model: Model, settings: Settings) -> Model:
    """Return the model with the observer on the motor torque and the compliance.

    Raises
    ------
    InputError
        Where the model lacks a part that they read.
    """
    alone = replace(model, estimators={})
    observed = alone.with_estimator(Observer(settings.gain, input="motor_torque"))
    return observed.with_estimator(Compliance(settings.margin))


def with_velocities(log: Log) -> Log:
    """Return the log with both velocities; a missing one is causal, as on a device."""
    log = with_motor_torque(log)
    for side in ("output", "motor"):
        if f"{side}_velocity" not in log and f"{side}_position" in log:
            channels = (f"{side}_velocity", "output_acceleration")
            made = differentiate_causal(
                log,
                bandwidth=min(BANDWIDTH, log.rate / 4.0),
                of=f"{side}_position",
                channels=channels,
            )
            log = log.with_columns({channels[0]: made[channels[0]]}, note=made.history[-1])
    return log


def signals_of(model: Model, log: Log, settings: Settings) -> Signals:
    """Return what the methods read of a log: the torques are those of `flexspline.estimate`.

    Parameters
    ----------
    model : with the parts for motor_torque, inertia in it, and torsion, mesh_compliance in it.
    log : output and motor angle, motor torque; missing velocities are derived.

    Raises
    ------
    InputError
        Where a part or a channel is missing.
    """
    log, said = with_velocities(log), list[str]()
    plan = plan_of(with_estimators(model, settings))
    inputs = model_inputs(model, plan, log, np.full(len(log), np.nan), said.append)
    for name in ("momentum", "motor_torque", "observer_intrinsic", "torsion"):
        if not np.isfinite(inputs[name]).any():
            raise InputError(
                f"log '{log.name}': {said[-1]}"
                if said
                else f"log '{log.name}': {name} is not finite in any row"
            )
    acting = inputs["motor_torque"] - inputs["observer_intrinsic"]
    mesh = mesh_of(model.part("torsion"), plan.effective_ratio)
    torsion = _with_hysteresis(model, plan, log, inputs["torsion"], mesh, settings.margin)
    torque, flags = _through(mesh, torsion, settings.margin)
    return Signals(
        np.asarray(log["time"]),
        inputs["velocity"],
        _observed(log["time"], inputs["momentum"], acting, settings.gain),
        torque - inputs["gear_known"],
        torsion,
        _wave_generator(model, log),
        (flags & SATURATED) != 0,
        acting,
        np.asarray(log["motor_velocity"]),
    )


def compliant_observer(model: Model, signals: Signals, settings: Settings) -> Array:
    """Return the external torque, (N,), Nm, from the link's momentum and the gear's torque."""
    inertia = link_inertia(model, settings)
    momentum = inertia * signals.velocity
    return _observed(signals.time, momentum, signals.compliance, settings.gain)


def two_mass_observer(model: Model, signals: Signals, settings: Settings) -> Array:
    """Return the external torque, (N,), Nm, from the momenta of link and rotor."""
    plan = plan_of(with_estimators(model, settings))
    rotor = plan.effective_ratio * settings.rotor_inertia
    momentum = link_inertia(model, settings) * signals.velocity + rotor * signals.motor_velocity
    return _observed(signals.time, momentum, signals.acting, settings.gain)


def link_inertia(model: Model, settings: Settings) -> float:
    """Return J_l = J − Ñ² J_m, kg·m² at the output.

    Raises
    ------
    InputError
        Where the rotor has more inertia than the drive's part.
    """
    plan = plan_of(with_estimators(model, settings))
    reflected = plan.effective_ratio**2 * settings.rotor_inertia
    if not 0.0 <= reflected <= plan.inertia:
        raise InputError(
            f"rotor_inertia = {settings.rotor_inertia:g} kg·m² is {reflected:.3g} kg·m² at the "
            f"output, but the part for motor_torque has {plan.inertia:.3g} kg·m² of link and rotor "
            "together; give that of the motor's shaft"
        )
    return plan.inertia - reflected


def _observed(time: Array, momentum: Array, acting: Array, gain: float) -> Array:
    """The core's observer over each stretch without a gap, from a fresh start."""
    pieces = [
        _core.observe_momentum(
            time[first:last], momentum[first:last], acting[first:last], gain=gain, exact=True
        )
        for first, last in runs(time)
    ]
    return np.concatenate(pieces)


def _through(mesh: Mesh, torsion: Array, margin: float) -> tuple[Array, NDArray[np.uint8]]:
    """(18) with its flags."""
    torque, flags = _core.mesh_torque(
        torsion, mesh_stiffness=mesh.stiffness, mesh_shape=mesh.shape, margin=margin
    )
    return torque, flags


def _with_hysteresis(
    model: Model, plan: Plan, log: Log, torsion: Array, mesh: Mesh, margin: float
) -> Array:
    """Take hysteresis on the path of the load off the mesh's torsion, (N,), rad at the output.

    It needs the torque that is looked for: both in turn. The device's chain has no load and
    leaves it in; on the path of the motor's angle it is taken off already.
    """
    part = model.part("torsion")
    if not any(its.name == HYSTERESIS and its.shapes["path"] < 0.5 for its in part.effects):
        return torsion
    alone = replace(model, parts={"torsion": replace(only(part, HYSTERESIS), known_load=LOAD)})
    left = torsion
    for _ in range(ROUNDS):
        load, _ = _through(mesh, left, margin)
        loop = alone.predict(log.with_columns({LOAD: load}, note="as estimated")).predicted
        left = torsion - loop / plan.effective_ratio
    return left


def _wave_generator(model: Model, log: Log) -> Array:
    """The wave generator's part of Δθ, (N,), rad at the motor; zero where the model has none."""
    part = model.part("torsion")
    if not any(its.name == WAVE_GENERATOR for its in part.effects):
        return np.zeros(len(log))
    return replace(model, parts={"torsion": only(part, WAVE_GENERATOR)}).predict(log).predicted
