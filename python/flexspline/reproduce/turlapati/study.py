"""One draw of the second paper: fit without load, subtract on a bearing, judge bearings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexspline.fitting import fit
from flexspline.least_squares.result import Fit
from flexspline.logs.derive import lowpass
from flexspline.logs.log import Log
from flexspline.reproduce.turlapati.lowpass_bias import amplitude_left
from flexspline.rigs.turlapati import TurlapatiRig, turlapati_rig

__all__ = ["EFFECTS", "LOWPASS", "ORDERS", "Study", "draw"]

Array = NDArray[np.float64]

#: The terms of (16); α of (9) is 200 s/rad, for it is "chosen heuristically".
EFFECTS = (
    "viscous_friction",
    "coulomb_friction_per_direction",
    "inertia",
    "output_ripple",
    "offset",
)
WIDTH = 0.01  # rad/s, 2/α
ORDERS = tuple(range(1, 9))
LOWPASS = 1.0  # Hz, §3.1
TRIALS = (1, 2, 3)
HELD_OUT = 2.5  # Nm, the peak of a run that no fit sees
#: Friction of good bearings over that of a typical one; bad ones begin at 1.35, the
#: limit is midway.
GOOD, REJECTED_ABOVE = (0.9, 1.0, 1.1, 1.15, 1.2, 1.25), 1.3


@dataclass(frozen=True)
class Study:
    """A rig, the fit of its runs without load, and what it says of bearings."""

    rig: TurlapatiRig

    @cached_property
    def no_load(self) -> tuple[Log, ...]:
        return self.rig.no_load()

    @cached_property
    def held_out(self) -> Log:
        """A run without load that the fit never saw."""
        return self.rig.no_load((HELD_OUT,))[0]

    @cached_property
    def trials(self) -> tuple[Log, ...]:
        return tuple(self.rig.bearing_run(trial) for trial in TRIALS)

    @cached_property
    def fit(self) -> Fit:
        """Equation (16), rows and target filtered alike."""
        return fit(
            EFFECTS,
            self.no_load,
            "sensor_torque",
            lowpass=LOWPASS,
            orders={"output_ripple": ORDERS},
            fixed={"direction_width": WIDTH},
            checks=False,
        )

    def components(self, log: Log) -> dict[str, Array]:
        """Contribution of each effect, Nm."""
        return self.fit.model.components(log)

    def intrinsic(self, log: Log) -> Array:
        """Predicted intrinsic torque, Nm, filtered like the reading."""
        return filtered(log, self.fit.model.predict(log).predicted)

    def errors(self, log: Log) -> tuple[Array, Array, Array]:
        """Reading minus load cell before and after compensation, and the load cell, Nm at 1 Hz."""
        cell = filtered(log, log["reference_torque"])
        before = filtered(log, log["sensor_torque"]) - cell
        return before, before - self.intrinsic(log), cell

    def percent(self, log: Log) -> tuple[float, float]:
        """RMS error over RMS load-cell torque, %, before and after."""
        before, after, cell = self.errors(log)
        return 100 * rms(before) / rms(cell), 100 * rms(after) / rms(cell)

    def rejected(self) -> tuple[float, float]:
        """Share of good bearings that are rejected, before and after compensation."""
        limit = REJECTED_ABOVE * _level(self.trials[0], self.trials[0]["reference_torque"])
        bearings = [self.rig.bearing_run(10 + k, level) for k, level in enumerate(GOOD)]
        before = [_level(log, log["sensor_torque"]) > limit for log in bearings]
        after = [
            _level(log, log["sensor_torque"] - self.fit.model.predict(log).predicted) > limit
            for log in bearings
        ]
        return float(np.mean(before)), float(np.mean(after))


def draw(rng: np.random.Generator) -> Mapping[str, float]:
    """Return the quantities of the paper's claims for one rig."""
    study = Study(turlapati_rig(int(rng.integers(2**32))))
    percents = np.array([study.percent(log) for log in study.trials])
    rejected = study.rejected()
    deviation = max(float(np.abs(study.errors(log)[0]).max()) for log in study.trials)
    return {
        **_fit_quantities(study),
        "turlapati.fig5.before": float(percents[:, 0].mean()),
        "turlapati.fig5.after": float(percents[:, 1].mean()),
        "turlapati.fig5.improvement": float(percents[:, 1].mean() / percents[:, 0].mean()),
        "turlapati.fig5.deviation": deviation,
        "turlapati.fig5.three_trials": float(np.ptp(percents[:, 1])),
        "turlapati.wrong_rejections": rejected[1] - rejected[0],
        "turlapati.lowpass.order_8": amplitude_left(8).target_only,
        "turlapati.lowpass.rows_alike": amplitude_left(8).rows_alike,
    }


def _fit_quantities(study: Study) -> dict[str, float]:
    parts = [study.components(log) for log in study.no_load]
    friction = np.concatenate(
        [p["viscous_friction"] + p["coulomb_friction_per_direction"] + p["offset"] for p in parts]
    )
    residual = filtered(study.held_out, study.held_out["sensor_torque"])
    residual = residual - study.intrinsic(study.held_out)
    levels = [
        float(np.mean(log["sensor_torque"][sign * log["output_velocity"] > 0]))
        for log in study.no_load
        for sign in (-1, 1)
    ]
    exact = [group for group in study.fit.confounded if group.exact]
    return {
        "turlapati.rank": float(sum(len(g.names) - len(g.known) for g in exact)),
        "turlapati.fig3.known_combinations": _off_by(study),
        "turlapati.fig3.ripple": max(float(np.abs(p["output_ripple"]).max()) for p in parts),
        "turlapati.fig3.friction_band": float(np.ptp(friction)),
        "turlapati.fig3.inertia": max(float(np.abs(p["inertia"]).max()) for p in parts),
        "turlapati.fig3.level": max(levels, key=abs),
        "turlapati.fig3.residual": abs(float(residual.mean())) / rms(residual),
    }


def _off_by(study: Study) -> float:
    """Largest |estimate − truth| / standard error of w_c⁺ + w_o and w_c⁻ + w_o.

    The truth of a direction is what the sensor makes of its Coulomb level, with the drift of the
    runs; the Stribeck and load-dependent part, which the model has not, counts as error.
    """
    sensor, own = study.rig.sensor, study.rig.joint.output.friction
    warm = np.mean([np.mean(log["temperature"]) - 25.0 for log in study.no_load])
    zero = sensor.offset + sensor.drift[0] * warm
    truth = {
        "positive": zero + sensor.gain * own.coulomb_forward,
        "negative": zero - sensor.gain * own.coulomb_backward,
    }
    off = []
    for known in (k for group in study.fit.confounded for k in group.known):
        names = [name for name, _ in known.weights if name.startswith("coulomb")]
        if len(names) == 1:
            side = names[0].rsplit(".", 1)[1]
            off.append(abs(known.value - truth[side]) / known.standard_error)
    return float(max(off)) if len(off) == 2 else float("nan")


def _level(log: Log, torque: Array) -> float:
    """A bearing's friction as an inspector reads it: the larger mean level of the directions."""
    forward = log["output_velocity"] > 0
    return max(abs(float(torque[forward].mean())), abs(float(torque[~forward].mean())))


def filtered(log: Log, torque: Array) -> Array:
    return np.asarray(lowpass(torque, log["time"], LOWPASS).values)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
