"""The methods that share the full range, the third paper's and those that it compares with.

The paper's transition from compliance to observer, (20), is chosen on training logs for the least
RMSE. The error of the merged estimate (19) is λ e_o + (1 − λ) e_c, so its square needs three sums
in each of many narrow bands of speed, and any α and q̇_trans is tried without the rows. Blocks of
time drawn again with replacement [Kuensch1989] tell how well the optimum is known.

Observers that hold the compliant gear: co, o2. The third paper names other gear models inside the
observer as its next step. Its own, rigid, gear makes one mass of link and rotor, so its input is
the motor torque and all friction is between input and estimate. With the torque through the mesh
known from the torsion there are two masses:

    link    J_l q̈ = τ_gear(Δθ_m) − g(q) − τ_ext,           p_l = J_l q̇
    rotor   Ñ J_m θ̈ = Ñ τ_m − friction − τ_gear,            p_m = Ñ J_m θ̇

"co" observes the link alone: no friction of gear or motor stands in its way, and unlike the
compliance by itself it takes the link's inertia off; in production it is
`Observer(gain, input="compliance")`. "o2" observes the sum of both momenta, with
the rotor's from its own encoder: the paper's observer, less the error of a gear that it takes for
rigid. J_l = J − Ñ² J_m, J the inertia of the drive's part.

What the third paper compares its transition with (Table I): gp, kalman, sd.

Gaussian process (gp): scikit-learn's, on the inputs that the paper lists. They are printed as [q,
θ, q̇, θ, τ_m]; the second θ is read as θ̇. The kernel is an anisotropic squared exponential with
white noise, on inputs scaled to unit spread. The paper has 22070 training samples and does not say
whether all enter the kernel (that takes 3.9 GB); here `rows` of the training logs do, evenly spread
in time, and a share of these sets the kernel's lengths. As q and θ are nearly proportional and the
torsion is their small difference, these inputs hide it: that is the paper's choice, not ours.

Kalman filter, the rival of (19): the core's (`flexspline/estimators/kalman_merge.hpp`). The noise
of each estimate at rest and in motion is its RMSE there on the training logs. These errors are
autocorrelated, while the filter assumes white noise, so the wander of the torque is not taken from
the torque but chosen for the least RMSE: only the ratio of wander and noise matters. Other rivals
of (19) are not included. It is a complementary filter already, whose share depends on speed; an
IMM, filters for rest and motion weighted by their likelihoods, would infer from the estimates what
the measured speed says at once.

Structural damping (sd): the formula is the core's, its parameters from training. The paper names
only its ref. 23 [Ismail2021]; our reading is in `flexspline/estimators/structural_damping.hpp`. The
torsion has the kinematic error and the wave generator taken off, as for the compliance. For a time
constant T the torque is linear in B and τ_0, so only T is searched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from flexspline import _core
from flexspline.effects.causes import WAVE_GENERATOR
from flexspline.errors import InputError
from flexspline.estimation import run_joint
from flexspline.estimation.plan import Plan, plan_of
from flexspline.estimators import Compliance, Merge, Observer
from flexspline.full_range.torsion_part import only
from flexspline.logs.derive import differentiate_causal
from flexspline.logs.log import Log
from flexspline.logs.read import with_motor_torque
from flexspline.logs.segments import runs
from flexspline.model import Model

__all__ = [
    "INPUTS",
    "GaussianProcess",
    "MergeRun",
    "Settings",
    "Signals",
    "StructuralDamping",
    "Transition",
    "choose_transition",
    "compliant_observer",
    "fit_gaussian_process",
    "fit_kalman",
    "fit_structural_damping",
    "link_inertia",
    "link_observer",
    "merge_weight",
    "merged_by_kalman",
    "require_rows",
    "signals_of",
    "two_mass_observer",
    "wave_generator_share",
    "with_estimators",
    "with_velocities",
]

Array = NDArray[np.float64]

BANDS = 400
DRAWS = 200
ZOOMS = 6
STEEPEST = 1e4  # s/rad; a step within 1 mrad/s
GRID = 30
SHUT_OUT = 0.05  # weight at rest from which the observer is not shut out

BANDWIDTH = 20.0  # Hz, of the causal velocity where a log has none, as `flexspline.estimate`
SATURATED = 2

INPUTS = ("output_position", "motor_position", "output_velocity", "motor_velocity", "motor_torque")
KERNEL_ROWS = 400
LEAST_ROWS, MOST_ROWS = 20, 25_000  # some per length of the kernel; a matrix of 5 GB
CHUNK = 4096

SHUT = 4.0  # α of the change from rest to motion, in units of 1 / motion speed: λ(0) = 0.018
LEAST_NOISE = 1e-6  # Nm
WANDER_GRID = 13

SHORTEST_STEPS = 3.0  # sampling steps, of the time constants that are tried
TIME_GRID = 16


@dataclass(frozen=True)
class Transition:
    """The chosen α and q̇_trans.

    Parameters
    ----------
    alpha, transition_velocity : s/rad and rad/s, at the output.
    alpha_interval, velocity_interval : 95 % of the optima of blocks drawn again.
    rmse : on the training rows, Nm.
    rmse_observer, rmse_compliance : of either alone.
    mean_at_rest : mean λ of the training rows that stand still, whose measured velocity is noise;
        NaN where none certainly do.
    """

    alpha: float
    transition_velocity: float
    alpha_interval: tuple[float, float]
    velocity_interval: tuple[float, float]
    rmse: float
    rmse_observer: float
    rmse_compliance: float
    mean_at_rest: float = float("nan")

    @property
    def weight_at_rest(self) -> float:
        """λ(0), the observer's share of the estimate at standstill."""
        return float(merge_weight(np.zeros(1), self.alpha, self.transition_velocity)[0])

    @property
    def warning(self) -> str | None:
        """A sentence where the observer is not shut out at standstill."""
        share = float(np.fmax(self.weight_at_rest, self.mean_at_rest))
        if not share > SHUT_OUT:
            return None
        noisy = self.mean_at_rest > SHUT_OUT >= self.weight_at_rest
        what = "with the noise of the velocity, λ at rest" if noisy else "λ(0)"
        share = share if noisy else self.weight_at_rest
        return (
            f"{what} = {share:.3f}: at standstill {100 * share:.0f} % of "
            "the merged torque is the observer's, which is blind there; "
            f"weight_at_rest={SHUT_OUT:g} shuts it out"
        )


def merge_weight(velocity: Array, alpha: float, transition_velocity: float) -> Array:
    """Return λ(q̇) of (20), (N,), for a velocity in rad/s at the output."""
    return np.asarray(
        _core.merge_weight(velocity, alpha=alpha, transition_velocity=transition_velocity)
    )


def choose_transition(
    velocity: Array,
    observer_error: Array,
    compliance_error: Array,
    block: NDArray[np.intp],
    *,
    weight_at_rest: float | None = None,
    at_rest: NDArray[np.bool_] | None = None,
    seed: int = 0,
) -> Transition:
    """Return the α and q̇_trans with the least RMSE.

    Parameters
    ----------
    velocity : (N,), rad/s at the output.
    observer_error, compliance_error : (N,), Nm.
    block : (N,), number of the block of time of each row, from 0.
    weight_at_rest : largest mean λ allowed of the rows at rest, and so largest λ(0), above 0 and
        below 1; None for any.
    at_rest : (N,), rows that certainly stand still; None for none.
    seed : of the blocks drawn.

    Raises
    ------
    InputError
        For a weight at rest that is no share.
    """
    if weight_at_rest is not None and not 0.0 < weight_at_rest < 1.0:
        raise InputError(f"weight_at_rest = {weight_at_rest:g} is no share; give 0 < λ(0) < 1")
    speed = np.abs(velocity)
    sums, middles = _sums(speed, observer_error, compliance_error, block)
    still = speed[at_rest] if at_rest is not None else speed[:0]
    grid = _Grid.over(speed, middles, _Rest.of(still, weight_at_rest))
    total = sums.sum(axis=0)
    alpha, transition_velocity = grid.refined(total)
    rng = np.random.default_rng(seed)
    picks = rng.integers(0, len(sums), (DRAWS, len(sums)))
    around = grid.around(grid.drawn(sums, picks))
    low, high = np.quantile(around.drawn(sums, picks), [0.025, 0.975], axis=0)
    rows, weight = len(speed), merge_weight(middles, alpha, transition_velocity)
    return Transition(
        alpha,
        transition_velocity,
        (min(float(low[0]), alpha), max(float(high[0]), alpha)),
        (min(float(low[1]), transition_velocity), max(float(high[1]), transition_velocity)),
        float(np.sqrt(_squares(total, weight) / rows)),
        float(np.sqrt(total[:, 0].sum() / rows)),
        float(np.sqrt(total[:, 2].sum() / rows)),
        float(merge_weight(still, alpha, transition_velocity).mean()) if still.size else np.nan,
    )


@dataclass(frozen=True, eq=False)
class _Rest:
    """What bounds the weight at standstill: mean λ of these `speeds`, (M,), at `most`."""

    speeds: Array
    most: float

    @classmethod
    def of(cls, still: Array, most: float | None) -> _Rest:
        """Of speeds measured at standstill, and of zero where there are none or all is allowed.

        Quantiles stand for many rows, each for the fastest of its share.
        """
        if most is None:
            return cls(np.zeros(1), 1.0)
        shares = np.linspace(0.0, 1.0, BANDS + 1)[1:]
        speeds = np.quantile(still, shares) if len(still) > BANDS else still
        return cls(speeds if len(speeds) else np.zeros(1), most)

    def allows(self, alpha: float, transition_velocity: float) -> bool:
        """Whether the bound holds; λ rises with speed, so that it holds for λ(0) too."""
        weight = merge_weight(self.speeds, alpha, transition_velocity).mean()
        return bool(weight <= self.most)


def _sums(
    speed: Array, observer: Array, compliance: Array, block: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Σ e_o², Σ e_o e_c, Σ e_c² of each block and band, (K, B, 3), and the bands' speeds (B,)."""
    edges = np.unique(np.quantile(speed, np.linspace(0.0, 1.0, BANDS + 1)))
    band = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, max(len(edges) - 2, 0))
    bands, blocks = max(len(edges) - 1, 1), int(block.max()) + 1
    cell = block * bands + band
    products = (observer**2, observer * compliance, compliance**2)
    sums = [np.bincount(cell, weights=p, minlength=blocks * bands) for p in products]
    count = np.maximum(np.bincount(band, minlength=bands), 1)
    middles = np.bincount(band, weights=speed, minlength=bands) / count
    table = np.stack(sums, axis=1).reshape(blocks, bands, 3).astype(np.float64)
    return table, np.asarray(middles)


def _squares(sums: Array, weight: Array) -> Any:
    """Σ (λ e_o + (1 − λ) e_c)² from the sums of each band (B, 3, ...); weights (B,) or (G, B)."""
    rest = 1.0 - weight
    return weight**2 @ sums[:, 0] + 2 * (weight * rest) @ sums[:, 1] + rest**2 @ sums[:, 2]


@dataclass(frozen=True, eq=False)
class _Grid:
    """Values of α and q̇_trans that are tried, (G, 2), with their weights in the bands (G, B).

    `speed`: the bands' speeds; `rest`: what the nodes keep to at standstill.
    """

    nodes: Array
    weights: Array
    speed: Array
    rest: _Rest

    @classmethod
    def over(cls, speed: Array, middles: Array, rest: _Rest) -> _Grid:
        """Return a grid with a node in every part of the speeds that occur, however slow."""
        fastest = float(speed.max()) or 1.0
        fast = np.unique(
            np.concatenate(
                [
                    np.linspace(0.0, fastest, GRID),
                    np.quantile(speed, np.linspace(0.02, 0.98, GRID)),
                    np.linspace(1.0, 3.0, 9) * rest.speeds.max(),  # just beyond standstill
                ]
            )
        )
        steep = np.geomspace(1.0 / fastest, max(STEEPEST, 2.0 / fastest), GRID)
        return cls._of(steep, fast, middles, rest)

    @classmethod
    def _of(cls, steep: Array, fast: Array, middles: Array, rest: _Rest) -> _Grid:
        nodes = np.stack(np.meshgrid(steep, fast, indexing="ij"), axis=-1).reshape(-1, 2)
        nodes = nodes[[rest.allows(*node) for node in nodes]]
        return cls(nodes, np.array([merge_weight(middles, *n) for n in nodes]), middles, rest)

    def best(self, sums: Array) -> tuple[float, float]:
        """Return the node with the least sum of squares."""
        found = self.nodes[int(np.argmin(_squares(sums, self.weights)))]
        return float(found[0]), float(found[1])

    def around(self, found: Array) -> _Grid:
        """Return a finer grid over these nodes (D, 2) and their neighbours."""
        axes = []
        for column in (0, 1):
            known = np.unique(self.nodes[:, column])
            first, last = np.searchsorted(known, [found[:, column].min(), found[:, column].max()])
            ends = known[max(first - 1, 0)], known[min(last + 1, len(known) - 1)]
            axes.append(np.geomspace(*ends, GRID) if column == 0 else np.linspace(*ends, GRID))
        finer = _Grid._of(axes[0], axes[1], self.speed, self.rest)
        return finer if len(finer.nodes) else self

    def drawn(self, sums: Array, picks: NDArray[np.intp]) -> Array:
        """Return the best node of each draw (D, 2): of the sums (K, B, 3) of the blocks (D, K)."""
        often = np.array([np.bincount(pick, minlength=len(sums)) for pick in picks], dtype=float)
        each = np.tensordot(often, sums, axes=1)
        costs = _squares(each.transpose(1, 2, 0), self.weights)
        return np.asarray(self.nodes[np.argmin(costs, axis=0)])

    def refined(self, sums: Array) -> tuple[float, float]:
        """Return the best of finer and finer grids around the best node."""
        alpha, velocity = self.best(sums)
        wide, step = np.exp(np.diff(np.log(np.unique(self.nodes[:, 0]))).max()), None
        for _ in range(ZOOMS):
            known = np.unique(self.nodes[:, 1])
            step = np.diff(known).max() if step is None else step / 3.0
            fast = np.unique(np.maximum(velocity + step * np.linspace(-1, 1, 7), 0.0))
            steep = np.minimum(alpha * wide ** np.linspace(-1, 1, 7), self.nodes[:, 0].max())
            fine = _Grid._of(np.unique(steep), fast, self.speed, self.rest)
            candidates = [(alpha, velocity), *([fine.best(sums)] if len(fine.nodes) else [])]
            costs = [float(_squares(sums, merge_weight(self.speed, *n))) for n in candidates]
            alpha, velocity = candidates[int(np.argmin(costs))]
            wide = np.sqrt(wide)
        return alpha, velocity


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


@dataclass(frozen=True, eq=False)
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


def link_observer(settings: Settings) -> Observer:
    """Return "co" as an estimator of a model."""
    return Observer(settings.gain, input="compliance", rotor_inertia=settings.rotor_inertia)


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
    log, said = with_velocities(log), dict[str, None]()
    blind = with_estimators(model, settings)
    plan = plan_of(blind)
    inputs = run_joint(blind, plan, log, said, inputs=True)
    for name in ("momentum", "motor_torque", "observer_intrinsic", "torsion"):
        if not np.isfinite(inputs[name]).any():
            raise InputError(
                f"log '{log.name}': {[*said][-1]}"
                if said
                else f"log '{log.name}': {name} is not finite in any row"
            )
    acting = inputs["motor_torque"] - inputs["observer_intrinsic"]
    torque, flags, torsion = _through(plan, log, inputs["torsion"])
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
    link = link_observer(settings)
    return plan_of(with_estimators(model, settings).with_estimator(link)).link_inertia


def wave_generator_share(signals: Sequence[Signals], model: Model) -> float:
    """Return RMS of the wave generator's term over that of the mesh's torsion, at the motor."""
    ratio = float(model.facts["gear_ratio"]) + (model.facts.get("output_spline") == "circular")
    wave = np.concatenate([s.wave_generator for s in signals])
    mesh = ratio * np.concatenate([s.mesh_torsion for s in signals])
    return float(np.sqrt(np.mean(wave**2) / np.mean(mesh**2)))


def _observed(time: Array, momentum: Array, acting: Array, gain: float) -> Array:
    """The core's observer over each stretch without a gap, from a fresh start."""
    pieces = [
        _core.observe_momentum(
            time[first:last], momentum[first:last], acting[first:last], gain=gain, exact=True
        )
        for first, last in runs(time)
    ]
    return np.concatenate(pieces)


def _through(plan: Plan, log: Log, torsion: Array) -> tuple[Array, NDArray[np.uint8], Array]:
    """(18) with its flags, and the mesh's own torsion [rad at the output], (N,) each.

    Hysteresis on the path of the load, where the model has it, is the chain's own rule.
    """
    entry = plan.estimating["compliance"]
    loop = entry.get("hysteresis")
    options = {name: entry[name] for name in ("mesh_stiffness", "mesh_shape", "margin")}
    if loop is None:
        torque, flags = _core.mesh_torque(torsion, **options)
        return torque, flags, torsion
    pieces = [
        _core.hysteretic_mesh_torque(torsion[first:last], **options, **loop)
        for first, last in runs(log["time"])
    ]
    torque, flags, left = (np.concatenate(part) for part in zip(*pieces, strict=True))
    return torque, flags, left


def _wave_generator(model: Model, log: Log) -> Array:
    """The wave generator's part of Δθ, (N,), rad at the motor; zero where the model has none."""
    part = model.part("torsion")
    if not any(its.name == WAVE_GENERATOR for its in part.effects):
        return np.zeros(len(log))
    return replace(model, parts={"torsion": only(part, WAVE_GENERATOR)}).predict(log).predicted


@dataclass(frozen=True, eq=False)
class GaussianProcess:
    """A fitted process: `regressor` is scikit-learn's; `rows` of `available` entered it."""

    regressor: Any
    middle: Array
    scale: Array
    rows: int
    available: int

    def torque(self, log: Log) -> Array:
        """Return the outward torque of a log, (N,), Nm."""
        inputs = (_inputs(log) - self.middle) / self.scale
        parts = [inputs[k : k + CHUNK] for k in range(0, len(inputs), CHUNK)]
        return np.concatenate([self.regressor.predict(part) for part in parts])

    @property
    def sentence(self) -> str:
        """What was trained on, and the kernel."""
        return (
            f"gp: {self.rows} of {self.available} training rows, evenly spread in time; "
            f"{self.regressor.kernel_}"
        )


def require_rows(rows: object) -> None:
    """Refuse a number of rows that no kernel matrix can have.

    Raises
    ------
    InputError
        Where it is no whole number from `LEAST_ROWS` to `MOST_ROWS`.
    """
    whole = isinstance(rows, int | np.integer) and not isinstance(rows, bool)
    if not whole or not LEAST_ROWS <= int(rows) <= MOST_ROWS:  # type: ignore[call-overload]
        raise InputError(
            f"gp_rows = {rows!r} is not allowed; give a whole number from {LEAST_ROWS} to "
            f"{MOST_ROWS}, or leave 'gp' out of methods"
        )


def fit_gaussian_process(
    logs: Sequence[Log], references: Sequence[Array], *, rows: int = 1000, seed: int = 0
) -> GaussianProcess:
    """Fit the process to training logs.

    Parameters
    ----------
    logs : with output and motor angle and motor torque; missing velocities are derived.
    references : the torque to learn, (N,) of each log, Nm outward.
    rows : samples that enter the kernel matrix; its cost grows with their third power.
    seed : of the search for the kernel's lengths.

    Raises
    ------
    InputError
        Without scikit-learn, or where a channel is missing.
    """
    try:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    except ImportError as error:
        raise InputError(
            "the method gp needs scikit-learn; install flexspline[baselines] or leave 'gp' out "
            "of methods"
        ) from error
    inputs = np.concatenate([_inputs(log) for log in logs])
    torque = np.concatenate(references)
    good = np.flatnonzero(np.isfinite(inputs).all(axis=1) & np.isfinite(torque))
    kept = good[_spread(len(good), rows)]
    middle, scale = inputs[kept].mean(axis=0), inputs[kept].std(axis=0)
    scale[scale == 0.0] = 1.0
    x, y = (inputs[kept] - middle) / scale, torque[kept]
    kernel = ConstantKernel(float(np.var(y)), (1e-4, 1e6)) * RBF(
        np.ones(x.shape[1]), (1e-2, 1e3)
    ) + WhiteKernel(0.1 * float(np.var(y)), (1e-6, 1e4))
    some = _spread(len(kept), KERNEL_ROWS)
    searched = GaussianProcessRegressor(kernel, normalize_y=True, random_state=seed)
    _quietly(searched, x[some], y[some])
    final = GaussianProcessRegressor(searched.kernel_, optimizer=None, normalize_y=True)
    return GaussianProcess(final.fit(x, y), middle, scale, len(kept), len(torque))


def _quietly(regressor: Any, x: Array, y: Array) -> None:
    """Fit without the warnings of a length at its bound: an input that tells nothing ends there."""
    import warnings

    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        regressor.fit(x, y)


def _inputs(log: Log) -> Array:
    """[q, θ, q̇, θ̇, τ_m] of each row, (N, 5)."""
    log = with_velocities(log)
    return np.column_stack([log[name] for name in INPUTS])


def _spread(available: int, wanted: int) -> NDArray[np.intp]:
    """At most `wanted` row numbers, evenly spread."""
    return np.unique(np.linspace(0, available - 1, min(wanted, available)).astype(np.intp))


@dataclass(frozen=True, eq=False)
class MergeRun:
    """What a merge reads of one run, arrays (N,): s, rad/s at the output, Nm."""

    time: Array
    velocity: Array
    observer: Array
    compliance: Array
    reference: Array


def merged_by_kalman(merge: Merge, run: MergeRun) -> Array:
    """Return the merged torque of one run, (N,), Nm."""
    assert merge.walk and merge.observer_noise and merge.compliance_noise  # as Merge checks
    return np.asarray(
        _core.merge_kalman(
            run.time,
            run.velocity,
            run.observer,
            run.compliance,
            alpha=merge.alpha,
            transition_velocity=merge.transition_velocity,
            walk=merge.walk,
            observer_rest=merge.observer_noise[0],
            observer_motion=merge.observer_noise[1],
            compliance_rest=merge.compliance_noise[0],
            compliance_motion=merge.compliance_noise[1],
        )
    )


def fit_kalman(runs: Sequence[MergeRun], motion_speed: float) -> Merge:
    """Return the filter with the least RMSE over the runs.

    Parameters
    ----------
    runs : training runs with their reference.
    motion_speed : rad/s at the output, between rest and motion.
    """
    moving = np.concatenate([np.abs(run.velocity) for run in runs]) >= motion_speed

    def noise(name: str) -> tuple[float, float]:
        error = np.concatenate([getattr(run, name) - run.reference for run in runs])
        still, driven = (float(np.sqrt(np.nanmean(error[m] ** 2))) for m in (~moving, moving))
        return max(still, LEAST_NOISE), max(driven, LEAST_NOISE)

    sizes = noise("observer"), noise("compliance")

    def made(log_walk: float) -> Merge:
        return Merge(
            SHUT / motion_speed,
            motion_speed,
            method="kalman",
            walk=float(np.exp(log_walk)),
            observer_noise=sizes[0],
            compliance_noise=sizes[1],
        )

    def cost(log_walk: float) -> float:
        merge = made(log_walk)
        errors = [merged_by_kalman(merge, run) - run.reference for run in runs]
        return float(np.nanmean(np.concatenate(errors) ** 2))

    period = float(np.median(np.diff(runs[0].time)))
    middle = np.log(np.sqrt(sizes[0][1] * sizes[1][0] / period))
    grid = middle + np.linspace(-8.0, 4.0, WANDER_GRID)
    best = int(np.argmin([cost(x) for x in grid]))
    around = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, WANDER_GRID - 1)]))
    return made(float(minimize_scalar(cost, bounds=around, method="bounded").x))


@dataclass(frozen=True)
class StructuralDamping:
    """Parameters of the method.

    Parameters
    ----------
    damping : B, Nm·s/rad at the output.
    time_constant : T, s.
    initial_torque : τ_0, Nm.
    threshold : torsion below which there is no rate, rad at the output.
    """

    damping: float
    time_constant: float
    initial_torque: float = 0.0
    threshold: float = 0.0

    @property
    def stiffness(self) -> float:
        """B/T, Nm/rad at the output: of the spring that it is for changes faster than T."""
        return self.damping / self.time_constant

    def torque(self, time: Array, torsion: Array) -> Array:
        """Return the outward torque (N,), Nm, of a torsion (N,), rad at the output, over time."""
        return np.asarray(_core.structural_damping_torque(time, torsion, **vars(self)))


def fit_structural_damping(
    runs: Sequence[tuple[Array, Array, Array]], *, threshold: float = 0.0
) -> StructuralDamping:
    """Return the parameters with the least RMSE.

    Parameters
    ----------
    runs : (time, torsion, reference torque) of each run: s, rad at the output, Nm, all (N,).
    threshold : rad at the output; the text of ref. 23 has one, its value is not known to us.

    Raises
    ------
    InputError
        Where the torsion does not follow the torque at all.
    """
    reference = np.concatenate([run[2] for run in runs])

    def solved(log_time_constant: float) -> tuple[float, Array]:
        unit = StructuralDamping(1.0, float(np.exp(log_time_constant)), 0.0, threshold)
        passed = np.concatenate([unit.torque(time, torsion) for time, torsion, _ in runs])
        rows = np.column_stack([passed, np.ones_like(passed)])
        found = np.linalg.lstsq(rows, reference, rcond=None)[0]
        return float(np.mean((rows @ found - reference) ** 2)), found

    shortest = SHORTEST_STEPS * float(np.median(np.diff(runs[0][0])))
    longest = max(float(time[-1] - time[0]) for time, _, _ in runs)
    grid = np.linspace(np.log(shortest), np.log(max(longest, 2.0 * shortest)), TIME_GRID)
    best = int(np.argmin([solved(float(x))[0] for x in grid]))
    around = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, TIME_GRID - 1)]))
    at = float(minimize_scalar(lambda x: solved(x)[0], bounds=around, method="bounded").x)
    damping, initial = solved(at)[1]
    if not damping > 0.0:
        raise InputError(
            "structural damping: the torsion does not rise with the torque in the training logs; "
            "check the signs of load and motor angle or leave out 'sd'"
        )
    return StructuralDamping(float(damping), float(np.exp(at)), float(initial), threshold)
