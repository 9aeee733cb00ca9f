"""The gauges of a torque sensor as one Wheatstone bridge: zhang_disturbance_elimination (1)–(5).

A gauge is as it is bonded and wired, and sees the strain that the wave generator makes.
How exactly gauges must be bonded is a placement tolerance against the ripple that is left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.errors import InputError, above_zero
from flexspline.formatting import short

__all__ = [
    "Bridge",
    "Gauge",
    "PlacementRipple",
    "Tolerance",
    "WaveStrain",
    "cancelling_bridge",
    "common_bridge",
    "placement_tolerance",
]

Array = NDArray[np.float64]

MOST_GAUGES = 16

MOST_TURNS = 2

STEPS = 13
FEWEST_DRAWS = 100
UNIFORM = 1.0 / 3.0  # variance of a uniform error within ± 1


@dataclass(frozen=True)
class WaveStrain:
    """Strain in the spokes that turns with the wave generator.

    At x = β − φ, β the angle of the wave generator against the flexspline and φ the gauge's,
    a gauge reads

        sign · bending · cos(order · x − phase) + stretching · cos(order · x − stretching_phase)

    The bending differs in sign between both flanks of a spoke, so a pair's difference is
    2 bending: Ψ₀ of (2). The stretching is one for both and leaves a pair; it is ε_w as (1) of
    the paper prints it, by which the sinusoid of (2) would vanish. It comes back with
    placement errors.

    Parameters
    ----------
    order : periods per turn of the wave generator against the flexspline, from 1.
    bending, stretching : amplitudes as strain (1e-6 is a microstrain).
    phase, stretching_phase : rad.

    References
    ----------
    zhang_disturbance_elimination (1)–(3), Fig. 7; [Hashimoto1993] (its ref. 12).

    Raises
    ------
    InputError
        For an order that is no whole number from 1, or a value that is not finite.
    """

    order: int
    bending: float
    phase: float = 0.0
    stretching: float = 0.0
    stretching_phase: float = 0.0

    def __post_init__(self) -> None:
        if self.order < 1 or int(self.order) != self.order:
            raise InputError(
                f"wave strain: order {self.order} is no whole number from 1; give periods per "
                "turn of the wave generator"
            )
        numbers = (self.bending, self.phase, self.stretching, self.stretching_phase)
        if not all(map(math.isfinite, numbers)):
            raise InputError(f"wave strain of order {self.order}: give finite amplitudes and phase")

    def for_core(self) -> tuple[float, float, float, float, float]:
        """Return order, and cosine and sine amplitudes of bending and stretching."""
        return (
            float(self.order),
            self.bending * math.cos(self.phase),
            self.bending * math.sin(self.phase),
            self.stretching * math.cos(self.stretching_phase),
            self.stretching * math.sin(self.stretching_phase),
        )


#: Not printed: 0.5 % and 1 % of full scale at orders 1 and 2 (the peaks of Fig. 15), and a tenth
#: of that at order 4, which no placement at quarter turns takes out. Stretching as large.
DEFAULT_WAVES = (
    WaveStrain(1, 4e-6, phase=0.6, stretching=4e-6, stretching_phase=1.1),
    WaveStrain(2, 8e-6, phase=0.0, stretching=8e-6, stretching_phase=0.5),
    WaveStrain(4, 0.8e-6, phase=0.3, stretching=0.8e-6, stretching_phase=0.8),
)


@dataclass(frozen=True)
class Bridge:
    """Strain gauges of a torque sensor, wired to one bridge.

    Parameters
    ----------
    gauges : an even number of `Gauge`, at most 16, half of them in each arm.
    waves : what the wave generator does to the spokes.
    gauge_factor : K.
    supply : V across the bridge; not printed in the paper.
    strain_per_torque : strain of a gauge per Nm; the default makes (25)'s 62.738 Nm/V of a gain
        of 200 and the other defaults.
    full_scale : Nm.
    resistance : of one gauge, Ω.
    poisson : Poisson's ratio of the body (aluminium 6061).
    reference_temperature : where gauges have no apparent strain, °C.

    Raises
    ------
    InputError
        Where the arms are not of equal number, the gauges cancel the torque itself, or a number
        is not positive.
    """

    gauges: tuple[Gauge, ...]
    waves: tuple[WaveStrain, ...] = DEFAULT_WAVES
    gauge_factor: float = 2.0
    supply: float = 3.3
    strain_per_torque: float = 1.0 / (62.738 * 200.0 * 2.0 * 3.3)
    full_scale: float = 70.0
    resistance: float = 350.0
    poisson: float = 0.33
    reference_temperature: float = 25.0
    _fixed: dict[str, Any] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "gauges", tuple(self.gauges))
        object.__setattr__(self, "waves", tuple(self.waves))
        for name in ("gauge_factor", "supply", "strain_per_torque", "full_scale", "resistance"):
            above_zero(getattr(self, name), f"bridge: {name}")
        if not (0.0 <= self.poisson <= 0.5 and math.isfinite(self.reference_temperature)):
            raise InputError(
                f"bridge: poisson = {self.poisson:g}, reference_temperature = "
                f"{self.reference_temperature:g} °C; give 0 to 0.5 and a finite temperature"
            )
        self._require_wheatstone()
        object.__setattr__(self, "_fixed", self._for_core())
        if abs(self.torque_gain) < 1e-9:
            raise InputError(
                "bridge: the gauges cancel the torque itself; put those that are stretched into "
                "one arm and those that are compressed into the other"
            )

    def _require_wheatstone(self) -> None:
        arms = [gauge.arm for gauge in self.gauges]
        if not 2 <= len(arms) <= MOST_GAUGES or arms.count(1) != arms.count(-1):
            raise InputError(
                f"bridge: {arms.count(1)} gauges in the one arm and {arms.count(-1)} in the other; "
                "give as many in each, 16 at most in all"
            )
        orders = [wave.order for wave in self.waves]
        if len(set(orders)) < len(orders):
            raise InputError("bridge: an order of the waves is named twice; name it once")

    def _for_core(self) -> dict[str, Any]:
        of = {
            name: np.array([float(getattr(g, name)) for g in self.gauges])
            for name in ("sign", "arm", "thermal_linear", "thermal_quadratic")
        }
        errors, tilts = ([getattr(g, n) for g in self.gauges] for n in ("factor_error", "tilt"))
        return {
            **of,
            "position": self.angles,
            "sensitivity": _core.gauge_sensitivity(errors, tilts, self.poisson),
            "waves": np.array([w.for_core() for w in self.waves]).reshape(-1, 5),
        }

    @property
    def angles(self) -> Array:
        """Where the gauges are [rad], shape (n,)."""
        return np.array([gauge.angle for gauge in self.gauges])

    @property
    def orders(self) -> tuple[int, ...]:
        return tuple(wave.order for wave in self.waves)

    @property
    def torque_gain(self) -> float:
        """Share of the torque strain that reaches the output, 1 for a full bridge."""
        return float(self._response()[2][0])

    @property
    def sensitivity(self) -> float:
        """Output per torque [V/Nm]: K ε_t U_i of (5), per Nm."""
        return self.gauge_factor * self.supply * self.strain_per_torque * self.torque_gain

    @property
    def output_resistance(self) -> float:
        """Ω that an amplifier sees: that of one arm; n/4 gauges are in series in each."""
        return self.resistance * len(self.gauges) / 4.0

    def voltage(self, angle: ArrayLike, torque: ArrayLike, temperature: ArrayLike = 25.0) -> Array:
        """Return the output [V], shape (N,).

        Parameters
        ----------
        angle : β, wave generator against flexspline [rad], (N,) or one number.
        torque : at the sensor [Nm], (N,) or one number.
        temperature : °C; one number, (N,) for even heating, or (N, n) for each gauge.
        """
        return self._signal(angle, torque, temperature)[1]

    def strains(self, angle: ArrayLike, torque: ArrayLike, temperature: ArrayLike = 25.0) -> Array:
        """Return the strain of each gauge, shape (N, n); arguments as in `voltage`."""
        return self._signal(angle, torque, temperature)[0]

    def torque(self, voltage: ArrayLike) -> Array:
        """Return what an output [V] reads as [Nm], by the bridge's own sensitivity."""
        return np.asarray(voltage, dtype=float) / self.sensitivity

    def reading(self, angle: ArrayLike, torque: ArrayLike, temperature: ArrayLike = 25.0) -> Array:
        """Return what the bridge reads [Nm], shape (N,): torque, ripple and thermal strain."""
        return self.torque(self.voltage(angle, torque, temperature))

    def ripple(self) -> dict[int, float]:
        """Return the amplitude of the ripple left at the output [Nm], by order."""
        cosine, sine, gain = self._response()
        size = np.hypot(cosine[0], sine[0]) / (abs(gain[0]) * self.strain_per_torque)
        return dict(zip(self.orders, size.tolist(), strict=True))

    def with_waves(self, *waves: WaveStrain) -> Bridge:
        """Return the bridge with other strain from the wave generator."""
        return replace(self, waves=waves)

    def with_errors(
        self, *, angle: ArrayLike = 0.0, tilt: ArrayLike = 0.0, factor: ArrayLike = 0.0
    ) -> Bridge:
        """Return the bridge with placement errors added: one number or one a gauge, (n,).

        `angle`, `tilt` in rad, `factor` as a share of the gauge factor.
        """
        count = len(self.gauges)
        errors = [_one_each(e, count) for e in (angle, tilt, factor)]
        moved = [
            replace(g, angle=g.angle + a, tilt=g.tilt + t, factor_error=g.factor_error + f)
            for g, a, t, f in zip(self.gauges, *(e.tolist() for e in errors), strict=True)
        ]
        return replace(self, gauges=tuple(moved))

    def with_thermal(self, linear: ArrayLike, quadratic: ArrayLike = 0.0) -> Bridge:
        """Return the bridge with the gauges' apparent strain [1/K, 1/K²]: one number or (n,)."""
        count = len(self.gauges)
        given = [_one_each(e, count) for e in (linear, quadratic)]
        warmed = [
            replace(g, thermal_linear=a, thermal_quadratic=b)
            for g, a, b in zip(self.gauges, *(e.tolist() for e in given), strict=True)
        ]
        return replace(self, gauges=tuple(warmed))

    def _signal(
        self, angle: ArrayLike, torque: ArrayLike, temperature: ArrayLike
    ) -> tuple[Array, Array]:
        self._require_state(angle, torque)
        given = np.asarray(temperature, dtype=float)
        each = given if given.ndim == 2 else given[..., None]
        if given.ndim == 2 and given.shape[1] != len(self.gauges):
            raise InputError(
                f"bridge: temperature has {given.shape[1]} columns for {len(self.gauges)} gauges; "
                "give one a gauge, or one temperature for all"
            )
        beta, load, each = np.broadcast_arrays(
            np.atleast_1d(np.asarray(angle, float))[:, None],
            np.atleast_1d(np.asarray(torque, float))[:, None],
            np.atleast_2d(each - self.reference_temperature) + np.zeros(len(self.gauges)),
        )
        return _core.bridge_signal(
            beta[:, 0],
            load[:, 0] * self.strain_per_torque,
            each,
            **self._fixed,
            gauge_factor=self.gauge_factor,
            supply=self.supply,
        )

    @staticmethod
    def _require_state(angle: ArrayLike, torque: ArrayLike) -> None:
        """Refuse an angle that is not finite, of which the core makes some phase, or shapes."""
        turned, load = np.atleast_1d(np.asarray(angle, float)), np.atleast_1d(np.asarray(torque))
        if not np.isfinite(turned).all():
            row = int(np.argmin(np.isfinite(turned)))
            raise InputError(f"bridge: angle is not finite at row {row}; leave such rows out")
        if len(turned) != len(load) and 1 not in (len(turned), len(load)):
            raise InputError(
                f"bridge: {len(turned)} angles and {len(load)} torques; give one a row or one "
                "for all"
            )

    def _response(self) -> tuple[Array, Array, Array]:
        fixed = self._fixed
        return _core.bridge_ripple(
            fixed["position"][None],
            fixed["sensitivity"][None],
            fixed["sign"],
            fixed["arm"],
            fixed["waves"],
        )


def _one_each(given: ArrayLike, count: int) -> Array:
    """One number for each gauge, (n,)."""
    values = np.asarray(given, float)
    if values.shape not in ((), (1,), (count,)):
        raise InputError(f"bridge: {values.size} values for {count} gauges; give one, or one each")
    return np.broadcast_to(values, (count,))


def _pairs(angles: Sequence[float]) -> tuple[Gauge, ...]:
    """A stretched and a compressed gauge on each spoke."""
    return tuple(Gauge(angle, sign) for angle in angles for sign in (1, -1))


def common_bridge(apart: float = 0.0, **options: Any) -> Bridge:
    """Return a bridge of four gauges whose ripple does not cancel (Fig. 13).

    Parameters
    ----------
    apart : angle between its two pairs [rad]. Fig. 13 is a drawing that the text does not
        describe; Fig. 15(a) shows orders 1 *and* 2 with it, so its pairs are neither half a turn
        apart (order 1 would cancel) nor a quarter (order 2). By default both sit on one spoke.
    options : of `Bridge`.
    """
    return Bridge(_pairs((0.0, apart)), **options)


def cancelling_bridge(gauges: int = 4, **options: Any) -> Bridge:
    """Return the bridge whose pairs, a quarter of a turn apart, cancel order 2 (Fig. 8).

    Four gauges, R1 to R4: pairs at 0° and 90°; order 2 cancels (3), (4), order 1 does not. All
    eight: pairs at 0°, 90°, 180° and 270°, and only multiples of four are left. The text derives
    order 2 alone; that both peaks of Fig. 15 vanish needs all eight. Those are at 9.89 and 19.76 Hz
    at 35.16 °/s, 101.26 and 2 · 101.16 per turn of the output: once and twice per turn of the wave
    generator *against the flexspline* with 101 = N + 1 (9.86 Hz); N = 100 is inferred, not printed.

    Parameters
    ----------
    gauges : 4 or 8.
    options : of `Bridge`.

    Raises
    ------
    InputError
        For another number of gauges.
    """
    if gauges not in (4, 8):
        raise InputError(f"cancelling bridge: {gauges} gauges; give 4 or 8, or build a Bridge")
    return Bridge(_pairs([k * math.pi / 2 for k in range(gauges // 2)]), **options)


@dataclass(frozen=True)
class Gauge:
    """One strain gauge on a spoke of the sensor.

    Parameters
    ----------
    angle : where its spoke is, around the joint [rad].
    sign : +1 where a positive torque stretches it, −1 where it compresses it.
    arm : +1 or −1, the arm of the bridge that it sits in; None: as `sign`, so that it adds to
        the torque.
    tilt : how far it is turned out of the spoke's direction [rad].
    factor_error : its gauge factor against the nominal one, as a share (0.01 is 1 %).
    thermal_linear, thermal_quadratic : apparent strain per K and per K² away from the reference
        temperature of the bridge.

    Raises
    ------
    InputError
        For a sign or an arm that is not ±1, a value that is not finite, an angle of more than two
        turns (degrees?) or a gauge factor that is none.
    """

    angle: float
    sign: int
    arm: int | None = None
    tilt: float = 0.0
    factor_error: float = 0.0
    thermal_linear: float = 0.0
    thermal_quadratic: float = 0.0

    def __post_init__(self) -> None:
        if self.arm is None:
            object.__setattr__(self, "arm", self.sign)
        if self.sign not in (1, -1) or self.arm not in (1, -1):
            raise InputError(
                f"gauge: sign {self.sign} and arm {self.arm} must be +1 or -1; give +1 for "
                "tension under torque, -1 for compression"
            )
        numbers = (self.angle, self.tilt, self.factor_error)
        if abs(self.angle) > MOST_TURNS * 2.0 * math.pi:
            raise InputError(
                f"gauge: angle = {self.angle:g} rad is more than {MOST_TURNS} turns; give radians"
            )
        if self.factor_error <= -1.0:
            raise InputError(
                f"gauge: factor_error = {self.factor_error:g} leaves no gauge; give more than -1"
            )
        if not all(map(math.isfinite, (*numbers, self.thermal_linear, self.thermal_quadratic))):
            raise InputError("gauge: angle, errors and thermal strain must be finite numbers")


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


@dataclass(frozen=True, eq=False)
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
