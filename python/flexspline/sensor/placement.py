"""How exactly gauges must be bonded: placement tolerance against the ripple that is left."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError
from flexspline.estimators.checks import above_zero
from flexspline.formatting import short
from flexspline.sensor.bridge import Bridge

__all__ = ["PlacementRipple", "Tolerance", "placement_tolerance"]

Array = NDArray[np.float64]

STEPS = 13
FEWEST_DRAWS = 100
UNIFORM = 1.0 / 3.0  # variance of a uniform error within ± 1


@dataclass(frozen=True)
class Tolerance:
    """Largest errors of bonding; each gauge's are uniform within ± these, and independent.

    Parameters
    ----------
    angle : of its place around the joint, rad.
    tilt : out of the spoke's direction, rad.
    factor : of the gauge factor, a share (0.005 is 0.5 %).
    """

    angle: float = 0.0
    tilt: float = 0.0
    factor: float = 0.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(x) and x >= 0.0 for x in (self.angle, self.tilt, self.factor)):
            raise InputError("placement tolerance: give errors that are finite and not negative")
        if self.angle == self.tilt == self.factor == 0.0:
            raise InputError("placement tolerance: all errors are zero; give at least one above it")
        if self.tilt >= math.pi / 4 or self.factor >= 0.5:
            raise InputError(
                "placement tolerance: a tilt of 45° or a gauge factor off by half is no "
                "tolerance; give smaller ones"
            )


@dataclass(frozen=True)
class PlacementRipple:
    """Ripple left over the placement tolerance, arrays (P, O): tolerances by orders.

    Parameters
    ----------
    share : of `tolerance`, from 0 to 1, (P,).
    tolerance : the largest one.
    orders : periods per turn of the wave generator against the flexspline.
    median, high : amplitude left in half and in 95 % of the bridges built, Nm.
    change : rms over the bridges of how far the ripple's phasor moved, Nm.
    slope : the same by the first-order formula, Nm at the whole tolerance, (O,).
    nominal : amplitude of a bridge without errors, Nm, (O,).
    full_scale : Nm.
    draws : bridges built.
    """

    share: Array
    tolerance: Tolerance
    orders: tuple[int, ...]
    median: Array
    high: Array
    change: Array
    slope: Array
    nominal: Array
    full_scale: float
    draws: int

    def allowed(self, order: int, ripple: float) -> float:
        """Return the share of the tolerance at which 95 % of bridges keep below `ripple` [Nm].

        0 where none do, 1 where all of the tolerance is allowed.
        """
        high = self.high[:, self._at(order)]
        above_zero(ripple, "placement tolerance: ripple", "Nm")
        within = np.flatnonzero(high <= ripple)
        if not len(within):
            return 0.0
        last = int(within[-1])
        if last == len(high) - 1:
            return 1.0
        part = (ripple - high[last]) / (high[last + 1] - high[last])
        return float(self.share[last] + part * (self.share[last + 1] - self.share[last]))

    def percent(self, torque: Array | float) -> Array:
        """Return Nm as % of full scale."""
        return np.asarray(100.0 * np.asarray(torque) / self.full_scale)

    def __str__(self) -> str:
        lines = [
            f"Ripple left of {self.draws} bridges bonded within {self._words()}:",
            "order  without error [mNm]  median [mNm]  95 % [mNm]  95 % [%FS]  "
            "change, rms [mNm]  first order [mNm]",
        ]
        for k, order in enumerate(self.orders):
            cells = [1e3 * self.nominal[k], 1e3 * self.median[-1, k], 1e3 * self.high[-1, k]]
            cells += [float(self.percent(self.high[-1, k])), 1e3 * self.change[-1, k]]
            shown = [short(float(c)) if c > 1e-9 else "0" for c in (*cells, 1e3 * self.slope[k])]
            wide = (5, 19, 12, 10, 10, 17, 17)
            lines.append(
                "  ".join(f"{c:>{w}}" for c, w in zip([str(order), *shown], wide, strict=True))
            )
        return "\n".join(lines)

    def _words(self) -> str:
        t = self.tolerance
        said = [f"± {math.degrees(t.angle):.3g}°"] if t.angle else []
        said += [f"a tilt of ± {math.degrees(t.tilt):.3g}°"] if t.tilt else []
        said += [f"a gauge factor of ± {100 * t.factor:.3g} %"] if t.factor else []
        return ", ".join(said)

    def _at(self, order: int) -> int:
        if order not in self.orders:
            raise InputError(
                f"placement tolerance: there is no order {order}; the bridge has {self.orders}"
            )
        return self.orders.index(order)


def placement_tolerance(
    bridge: Bridge, tolerance: Tolerance | float, *, draws: int = 2000, seed: int = 1
) -> PlacementRipple:
    """Return the ripple left by order as gauges are bonded less and less exactly.

    `draws` bridges get errors, scaled from nothing to the whole tolerance; each is calibrated
    (its torque gain is its own). Ripple is the amplitude at the output in Nm.

    Parameters
    ----------
    bridge : as it is meant to be, with its waves.
    tolerance : `Tolerance`, or the largest error of angle alone [rad].
    draws : bridges built, from 100.
    seed : of the errors.

    Notes
    -----
    To first order an error δφ_i turns gauge i's share w_i of the ripple's phasor by o δφ_i, one
    of its gauge factor stretches it, and a tilt does nothing, cos² being flat at 0:

        δz = Σ_i (−j o w_i δφ_i + (w_i − z a_i s_i / (n g)) δk_i / k_i)

    `slope` is the rms of that. `change` meets it at small tolerances.

    References
    ----------
    zhang_disturbance_elimination §2.3 (bonding under a microscope); (2)–(4) for the cancelling.
    """
    limits = tolerance if isinstance(tolerance, Tolerance) else Tolerance(float(tolerance))
    if draws < FEWEST_DRAWS:
        raise InputError(
            f"placement tolerance: {draws} draws do not show what 95 % keep; "
            f"give at least {FEWEST_DRAWS}"
        )
    if not bridge.waves:
        raise InputError("placement tolerance: the bridge has no waves; give it some")
    count = len(bridge.gauges)
    errors = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, draws, count))
    share = np.linspace(0.0, 1.0, STEPS)
    left = np.array([_phasors(bridge, limits, scale * errors) for scale in share])
    size = np.abs(left)
    return PlacementRipple(
        share,
        limits,
        bridge.orders,
        np.median(size, axis=1),
        np.quantile(size, 0.95, axis=1),
        np.sqrt(np.mean(np.abs(left - left[:1]) ** 2, axis=1)),
        _slope(bridge, limits),
        size[0, 0],
        bridge.full_scale,
        draws,
    )


def _phasors(bridge: Bridge, limits: Tolerance, errors: Array) -> NDArray[np.complex128]:
    """The ripple of each draw as phasor [Nm], (D, O)."""
    angle, tilt, factor = errors
    fixed = bridge._fixed
    known = np.array([(g.tilt, g.factor_error) for g in bridge.gauges]).T
    sensitivity = _core.gauge_sensitivity(
        known[1] + limits.factor * factor, known[0] + limits.tilt * tilt, bridge.poisson
    )
    cosine, sine, gain = _core.bridge_ripple(
        fixed["position"] + limits.angle * angle,
        sensitivity,
        fixed["sign"],
        fixed["arm"],
        fixed["waves"],
    )
    return np.asarray((cosine - 1j * sine) / (gain[:, None] * bridge.strain_per_torque))


def _slope(bridge: Bridge, limits: Tolerance) -> Array:
    """Rms of the first-order change of the phasors at the whole tolerance [Nm], (O,)."""
    fixed = bridge._fixed
    sign, arm, k = fixed["sign"], fixed["arm"], fixed["sensitivity"]
    order, cosine, sine, along, across = (fixed["waves"].T)[..., None]
    weight = arm * k / len(arm) * np.exp(-1j * order * fixed["position"])
    weight = weight * (sign * (cosine - 1j * sine) + along - 1j * across)
    gain = bridge.torque_gain
    per_stretch = weight - weight.sum(1, keepdims=True) * (arm * sign * k / len(arm)) / gain
    tilts = np.array([gauge.tilt for gauge in bridge.gauges])
    factors = np.array([gauge.factor_error for gauge in bridge.gauges])
    by_tilt = -(1.0 + factors) * (1.0 + bridge.poisson) * np.sin(2.0 * tilts) / k
    square = (limits.angle * order * np.abs(weight)) ** 2
    square = square + (limits.factor / (1.0 + factors) * np.abs(per_stretch)) ** 2
    square = square + (limits.tilt * by_tilt * np.abs(per_stretch)) ** 2
    rms = np.sqrt(UNIFORM * square.sum(1))
    return np.asarray(rms / (abs(gain) * bridge.strain_per_torque))
