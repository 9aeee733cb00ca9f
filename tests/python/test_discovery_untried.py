"""A log of a sensor with the motor's current and no torque constant: crosstalk cannot be tried."""

from __future__ import annotations

import numpy as np
import pytest
from fit_logs import motion

import flexspline
from flexspline.discovery.result import Discovery
from flexspline.logs.log import Log

RATE, SAMPLES = 200.0, 4000
CONSTANT, LEAKAGE, GAIN = 0.05, 0.003, 0.02  # Nm/A, of the motor's torque at the output, 1


def run(seed: int) -> Log:
    """A sensor of 2 % too much gain that sees the current; friction and inertia are the drive's."""
    c = motion(seed, SAMPLES, RATE)
    rng = np.random.default_rng([seed, 3])
    v, load = c["output_velocity"], 3.0 * np.sin(1.1 * c["time"] + seed)
    drive = load + 2.0 * np.tanh(v / 0.02) + 4.0 * v + 0.3 * c["output_acceleration"]
    sensor = 0.1 + (1.0 + GAIN) * load + LEAKAGE * drive / CONSTANT
    return Log.from_arrays(
        facts={"name": f"run{seed}", "gear_ratio": 100.0},
        **c,
        motor_current=rng.normal(drive / 100.0 / CONSTANT, 0.01),
        sensor_torque=rng.normal(sensor, 0.02),
        reference_torque=rng.normal(load, 0.005),
    )


def found(**facts: float) -> Discovery:
    logs = [run(seed).with_facts(facts) for seed in range(3)]
    base = [flexspline.Effect("offset")]
    return flexspline.discover(
        base, logs, target="sensor_torque", known_load="reference_torque", progress=False
    )


def test_names_that_the_current_explains_may_be_crosstalk_and_say_so() -> None:
    """Coulomb friction and inertia of a sensor stood there at 99 %."""
    made = found()
    assert "motor_crosstalk" in made.not_tried
    assert {"inertia", "coulomb_friction"} & {*made.names}
    for one in made.found:
        assert one.confidence <= 0.5
        assert "motor_crosstalk, which was not tried" in one.evidence
    assert str(made).startswith("The model of the sensor torque may lack")


@pytest.mark.parametrize("constant", [CONSTANT, 1.0])
def test_with_a_constant_whatever_it_is_crosstalk_is_named(constant: float) -> None:
    made = found(torque_constant=constant)
    assert {*made.names} == {"motor_crosstalk", "gain_error"}
    assert next(one for one in made.found if one.effect == "motor_crosstalk").confidence > 0.9
