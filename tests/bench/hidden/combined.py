"""What is hidden alone and together, and what is taken from the candidates.

An effect that is taken out leaves a cause without a name. Its near relatives are taken out with
it: of what remains, no single effect explains more than half of its variance in rich runs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hidden.forms import FORMS

__all__ = ["ALONE", "EXCLUDED", "OF_CURRENT", "PAIRS", "TRIPLES", "Combined"]

Names = tuple[str, ...]

ALONE: Mapping[str, Names] = {target: tuple(forms) for target, forms in FORMS.items()}

IN_TORQUE: tuple[Names, ...] = (
    ("offset", "coulomb_friction"),  # coulomb_friction_per_direction: the same columns
    ("stribeck_friction", "load_dependent_friction"),
    ("stribeck_friction", "temperature_dependent_friction"),
    ("nonlinear_viscous_friction", "position_dependent_friction"),
    ("presliding_friction", "gravity"),
    ("load_dependent_friction", "temperature_dependent_friction"),
    ("wave_generator_ripple", "cogging"),
    ("gravity", "load_dependent_friction"),
    ("output_ripple", "stribeck_friction"),
    ("viscous_friction", "temperature_dependent_friction"),
)

SENSOR_PAIRS: tuple[Names, ...] = (
    *IN_TORQUE,
    ("temperature_drift", "gain_error"),
    ("gain_error", "sensor_nonlinearity"),
    ("torque_hysteresis", "gain_temperature_dependence"),
    ("motor_crosstalk", "stribeck_friction"),
    ("sensor_lag", "wave_generator_ripple"),
    ("thermal_gradient_drift", "load_dependent_friction"),
    ("time_drift", "torque_hysteresis"),
)

DRIVE_PAIRS: tuple[Names, ...] = (
    *IN_TORQUE,
    ("torque_constant_error", "load_dependent_friction"),
    ("inertia", "gravity"),
    ("torque_constant_error", "wave_generator_ripple"),
)

TORSION_PAIRS: tuple[Names, ...] = (
    ("kinematic_error", "torsional_hysteresis"),
    ("kinematic_error", "wave_generator_compliance"),
    ("kinematic_error", "backlash"),
    ("torsional_hysteresis", "backlash"),
    ("torsional_hysteresis", "wave_generator_compliance"),
    ("torsional_hysteresis", "temperature_dependent_stiffness"),
    ("wave_generator_compliance", "temperature_drift"),
    ("wave_generator_compliance", "temperature_dependent_stiffness"),
    ("kinematic_error", "time_drift"),
    ("temperature_drift", "temperature_dependent_stiffness"),
    ("mesh_compliance", "kinematic_error"),
    ("time_drift", "torsional_hysteresis"),
)

PAIRS: Mapping[str, tuple[Names, ...]] = {
    "sensor_torque": SENSOR_PAIRS,
    "motor_torque": DRIVE_PAIRS,
    "torsion": TORSION_PAIRS,
}

TRIPLES: Mapping[str, tuple[Names, ...]] = {
    "sensor_torque": (
        ("stribeck_friction", "load_dependent_friction", "temperature_dependent_friction"),
        ("gain_error", "temperature_drift", "torque_hysteresis"),
        ("wave_generator_ripple", "cogging", "gravity"),
        ("motor_crosstalk", "thermal_gradient_drift", "position_dependent_friction"),
        ("nonlinear_viscous_friction", "output_ripple", "sensor_lag"),
        ("presliding_friction", "gain_temperature_dependence", "time_drift"),
        ("sensor_nonlinearity", "motor_crosstalk", "wave_generator_ripple"),
    ),
    "motor_torque": (
        ("stribeck_friction", "load_dependent_friction", "temperature_dependent_friction"),
        ("wave_generator_ripple", "cogging", "gravity"),
        ("torque_constant_error", "position_dependent_friction", "stribeck_friction"),
        ("presliding_friction", "gravity", "load_dependent_friction"),
        ("nonlinear_viscous_friction", "output_ripple", "torque_constant_error"),
        ("inertia", "temperature_dependent_friction", "cogging"),
    ),
    "torsion": (
        ("kinematic_error", "torsional_hysteresis", "wave_generator_compliance"),
        ("kinematic_error", "backlash", "temperature_dependent_stiffness"),
        ("torsional_hysteresis", "temperature_drift", "backlash"),
        ("wave_generator_compliance", "time_drift", "kinematic_error"),
        ("temperature_dependent_stiffness", "torsional_hysteresis", "temperature_drift"),
        ("mesh_compliance", "kinematic_error", "wave_generator_compliance"),
    ),
}

FRICTION_AND_RIPPLE: Mapping[str, Names] = {
    "stribeck_friction": ("nonlinear_viscous_friction",),
    "presliding_friction": (),
    "load_dependent_friction": (),
    "temperature_dependent_friction": (),
    "position_dependent_friction": (),
    "gravity": ("output_ripple",),
    "output_ripple": ("gravity",),
    "wave_generator_ripple": ("speed_dependent_ripple",),
    "cogging": ("speed_dependent_ripple",),
}

EXCLUDED: Mapping[str, Mapping[str, Names]] = {
    "sensor_torque": {
        **FRICTION_AND_RIPPLE,
        "thermal_gradient_drift": (),
        "motor_crosstalk": (),
        "torque_hysteresis": ("sensor_lag",),
        "sensor_lag": ("torque_hysteresis",),
    },
    "motor_torque": {**FRICTION_AND_RIPPLE, "torque_constant_error": ()},
    "torsion": {
        "wave_generator_compliance": (),
        "kinematic_error": (),
        "torsional_hysteresis": (),
        "backlash": (),
        "temperature_dependent_stiffness": (),
    },
}
"""By target, the effect that is hidden and what is taken out beside it."""


@dataclass(frozen=True)
class Combined:
    """What is hidden in the runs of a target: effects alone and together, and what has no name."""

    alone: Names
    pairs: tuple[Names, ...]
    triples: tuple[Names, ...]
    excluded: Mapping[str, Names]
    unknown: Names


OF_CURRENT = Combined(
    alone=(
        "offset",
        "coulomb_friction",
        "viscous_friction",
        "nonlinear_viscous_friction",
        "stribeck_friction",
        "presliding_friction",
        "load_dependent_friction",
        "position_dependent_friction",
        "inertia",
        "gravity",
        "output_ripple",
        "wave_generator_ripple",
        "speed_dependent_ripple",
        "cogging",
    ),
    pairs=(
        ("offset", "coulomb_friction"),
        ("stribeck_friction", "load_dependent_friction"),
        ("nonlinear_viscous_friction", "position_dependent_friction"),
        ("wave_generator_ripple", "cogging"),
        ("output_ripple", "stribeck_friction"),
        ("inertia", "gravity"),
        ("presliding_friction", "load_dependent_friction"),
        ("viscous_friction", "wave_generator_ripple"),
    ),
    triples=(
        ("stribeck_friction", "load_dependent_friction", "wave_generator_ripple"),
        ("nonlinear_viscous_friction", "output_ripple", "cogging"),
        ("presliding_friction", "viscous_friction", "output_ripple"),
    ),
    excluded={
        name: FRICTION_AND_RIPPLE[name]
        for name in (
            "stribeck_friction",
            "presliding_friction",
            "load_dependent_friction",
            "position_dependent_friction",
            "output_ripple",
            "wave_generator_ripple",
            "cogging",
        )
    },
    unknown=(
        "a bump at an angle",
        "even in speed",
        "power",
        "squared acceleration",
        "acceleration times angle",
        "viscosity by angle",
        "one way only",
    ),
)
"""Of a robot's current: what a known load or a temperature would have to show is not hidden."""
