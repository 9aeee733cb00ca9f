"""The second paper's rig: what its own model of a joint without load lacks is found and added.

§2.1(a): "we choose the simplest, i.e., Coulomb's friction to model the non-linear behavior of
static friction and viscous friction to model the velocity-dependent nature of friction"; ripple are
harmonics of the joint's angle. The rig's friction fades as the joint starts to slide (Stribeck),
and its wave generator shows in the sensor.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import flexspline
from flexspline.discovery.result import Discovery
from flexspline.logs.log import Log
from flexspline.rigs import turlapati_rig
from flexspline.rigs.turlapati import TurlapatiRig

PAPER = ("offset", "coulomb_friction", "viscous_friction", "inertia", "output_ripple")
PEAKS = (1.0, 1.5, 2.0, 3.0)  # Nm
LEVEL, VELOCITY = 0.15, 0.1  # Nm, rad/s of the hidden Stribeck friction


def rig(*, stribeck: float, waves: bool) -> TurlapatiRig:
    """The rig as published, with this Stribeck level [Nm], and with the wave generator or not."""
    made = turlapati_rig(1)
    friction = replace(made.joint.output.friction, stribeck=stribeck, stribeck_velocity=VELOCITY)
    joint = replace(made.joint, output=replace(made.joint.output, friction=friction))
    ripple = [h for h in made.sensor.ripple if waves or h.pair == "output_on_housing"]
    return replace(made, joint=joint, sensor=replace(made.sensor, ripple=ripple))


def runs(made: TurlapatiRig, peaks: tuple[float, ...] = PEAKS) -> tuple[Log, ...]:
    """Runs without load, every second row."""
    return tuple(
        log.rows(slice(None, None, 2), note="thinned").with_facts({"name": f"run {k}"})
        for k, log in enumerate(made.no_load(peaks))
    )


def unknown(log: Log) -> Log:
    """A torque that follows speed and angle together: no effect of the catalogue does."""
    angle, velocity = log["output_position"], log["output_velocity"]
    extra = 0.08 * velocity * np.abs(velocity) * np.sin(angle)
    return log.with_columns({"sensor_torque": log["sensor_torque"] + extra}, note="something else")


@cache
def found(case: str) -> Discovery:
    peaks = (2.0, 3.0, 2.0, 3.0) if case == "unknown" else PEAKS  # each speed in two runs
    logs = runs(rig(stribeck=LEVEL if case == "stribeck" else 0.0, waves=case == "waves"), peaks)
    logs = tuple(unknown(log) for log in logs) if case == "unknown" else logs
    return flexspline.discover(PAPER, logs, target="sensor_torque")


def test_friction_that_fades_is_named_with_its_size_and_closes_the_gap() -> None:
    made = found("stribeck")
    assert made.names == ("stribeck_friction",)
    level, velocity = made.parameters("stribeck_friction")
    assert abs(level.value - LEVEL) < 4.0 * level.standard_error
    assert abs(velocity.value - VELOCITY) < 4.0 * velocity.standard_error
    nothing = found("nothing")
    assert made.gap_closed > 0.9
    assert made.final_rmse < 1.03 * nothing.final_rmse


def test_the_gap_closes_where_the_friction_acts() -> None:
    table = found("stribeck").before_after().loc["speed"]
    slow, fast = table.iloc[0], table.iloc[-1]
    floor = found("nothing").before_after().loc["speed"].iloc[0]["final"]  # the rig's own noise
    assert slow["base"] ** 2 - slow["final"] ** 2 > 0.9 * (slow["base"] ** 2 - floor**2) > 0.0
    assert fast["final"] / fast["base"] > slow["final"] / slow["base"] + 0.05


def test_the_wave_generator_is_named_and_not_a_harmonic_of_the_joint() -> None:
    made = found("waves")
    assert made.names == ("wave_generator_ripple",)
    sizes = [h.amplitude for h in turlapati_rig(1).sensor.ripple if h.pair != "output_on_housing"]
    values = {p.name: p.value for p in made.parameters("wave_generator_ripple")}
    pairs = list(zip(list(values.values())[::2], list(values.values())[1::2], strict=True))
    amplitudes = sorted(np.hypot(*np.array(pairs).T).tolist())[-2:]
    assert amplitudes == pytest.approx(sorted(sizes), rel=0.05)


def test_nothing_is_named_where_the_paper_s_model_is_the_rig_s() -> None:
    made = found("nothing")
    assert made.names == () and made.unexplained is None


def test_a_cause_outside_the_catalogue_is_unexplained_and_gets_no_name() -> None:
    made = found("unknown")
    assert made.names == ()
    assert made.unexplained is not None
    assert set(made.unexplained.depends_on) <= {"output_position", "output_velocity"}
    assert made.unexplained.share_of_variance > 0.7
