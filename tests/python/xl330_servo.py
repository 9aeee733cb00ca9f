"""The XL330 with its pendulum as a servo: its law, forms of its model, fits to its motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from measured import xl330

import flexspline
from flexspline.forward import PositionServo
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log
from flexspline.logs.repairs import repaired

HELD_OUT = ("10h28m17", "10h28m57", "10h29m37", "10h29m47")
TWELVE = (
    "10h28m10", "10h28m24", "10h28m32", "10h28m42", "10h28m49", "10h29m04",
    "10h29m14", "10h29m21", "10h29m29", "10h29m54", "10h30m02", "10h30m10",
)  # fmt: skip
LAW = PositionServo(
    "kp",
    gain_scale=4096 / (2 * np.pi) / (256 * 885),
    torque=0.104,
    back_emf=0.048,
    supply=True,
    encoder_step=2 * np.pi / 4096,
)
"""k and k_e are first guesses, of a data sheet: 0.52 Nm at 5 V, 103 rpm without load."""
KNOWN = {"gravity.sine": 0.49 * 9.81 * 0.1, "gravity.cosine": 0.0}
"""Nm: 0.49 kg on 0.1 m, hanging down at zero."""

_BASE = ["inertia", "gravity", "coulomb_friction"]
_LOAD = [*_BASE, "load_dependent_friction"]
_VISCOUS = [*_LOAD, "viscous_friction"]
_PLACE = "position_dependent_friction"
_COSINES = {f"{_PLACE}.sine {k}": 0.0 for k in (1, 2, 3)}
_ONE = {**_COSINES, **{f"{_PLACE}.cosine {k}": 0.0 for k in (2, 3)}}
FORMS: Mapping[str, tuple[Sequence[str], Mapping[str, float]]] = {
    "viscous": ([*_BASE, "viscous_friction"], {}),
    "load": (_LOAD, {}),
    "load, viscous": (_VISCOUS, {}),
    "+ offset": ([*_VISCOUS, "offset"], {}),
    "+ nonlinear viscous": ([*_VISCOUS, "nonlinear_viscous_friction"], {}),
    "+ Stribeck": ([*_VISCOUS, "stribeck_friction"], {}),
    "+ temperature": ([*_VISCOUS, "temperature_dependent_friction"], {}),
    "+ cosine of the angle": ([*_VISCOUS, _PLACE], _ONE),
    "+ two cosines": (
        [*_VISCOUS, _PLACE],
        {name: value for name, value in _ONE.items() if not name.endswith("cosine 2")},
    ),
    "cosines for the load": ([*_BASE, "viscous_friction", _PLACE], _COSINES),
    "+ cosine, offset": ([*_VISCOUS, _PLACE, "offset"], _ONE),
}
CHOSEN = "+ cosine of the angle"


def runs(names: Sequence[str]) -> list[Log]:
    """Logs of the servo; their velocity channel is 20 ms late and made anew."""
    return [
        repaired(xl330(name).with_facts({"gear_ratio": 1.0}), ["velocity_from_position"])
        for name in names
    ]


def fitted(form: str, *, starts: int = 8, threads: int = 2) -> Fit:
    """Fit a form of the model to the twelve logs."""
    effects, more = FORMS[form]
    return flexspline.fit_motion(
        effects,
        runs(TWELVE),
        "motor_torque",
        fixed={**KNOWN, **more},
        controller=LAW,
        options=flexspline.MotionOptions(
            free_controller=("torque", "back_emf"), starts=starts, threads=threads
        ),
    )
