"""The C++ core of flexspline: effects, sums, solves and estimators."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Shares = Sequence[tuple[int, float]]
_Run = tuple[
    int,
    dict[str, NDArray[np.float64]],
    NDArray[np.float64],
    NDArray[np.float64] | None,
    int,
    Sequence[tuple[int, int, NDArray[np.float64]]],
    Sequence[int],
]

max_harmonics: int
channels: tuple[str, ...]
numbers: tuple[str, ...]
given_numbers: tuple[str, ...]
instruments: tuple[str, ...]
most_adapted: int
simulation_columns: list[str]
simulation_elements: int

class Design:
    """Effects chosen at run time: rows, sums and predictions over arrays."""

    def __init__(
        self,
        effects: Sequence[dict[str, Any]],
        effective_ratio: float,
        output_spline: str,
        motor_encoder: bool,
    ) -> None: ...
    @property
    def columns(self) -> int:
        """How many columns the rows have."""

    @property
    def structured(self) -> bool:
        """Whether the sums of this design can use the structure of dense harmonics."""

    def rows(
        self, channels: dict[str, NDArray[np.float64]], size: int, coefficients: ArrayLike
    ) -> NDArray[np.float64]:
        """Design matrix, shape (size, columns)."""

    def predict(
        self, channels: dict[str, NDArray[np.float64]], size: int, coefficients: ArrayLike
    ) -> NDArray[np.float64]:
        """Rows times coefficients, shape (size,)."""

    def settled(
        self, channels: dict[str, NDArray[np.float64]], size: int, coefficients: ArrayLike
    ) -> NDArray[np.bool_]:
        """Rows that no longer depend on what an effect remembered before its run, (size,)."""

    def accumulate(
        self,
        channels: dict[str, NDArray[np.float64]],
        target: ArrayLike,
        blocks: Sequence[tuple[int, int]],
        coefficients: ArrayLike,
        held: ArrayLike,
        weights: ArrayLike | None,
        double_double: bool,
        structured: bool,
        threads: int,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sums of products of [rows, target] of each block: (high, low)."""

class Joint:
    """From raw readings to the external torque and a contact, as on the device."""

    def __init__(
        self,
        stages: dict[str, Any],
        models: dict[str, tuple[Design, ArrayLike]] = ...,
        *,
        effective_ratio: float = ...,
        inertia: float = ...,
        link_inertia: float = ...,
        low: float = ...,
        high: float = ...,
        limits: Mapping[str, float] = ...,
    ) -> None:
        """`stages` as model.json has them; `models` by 'sensor', 'observed', 'torsion' and
        'carried': a design and its coefficients; inertias [kg m² at the output]; parts were fitted
        between temperatures `low` and `high` [°C]; `limits` of readings that have other ones than
        those of `reading_limits`.
        """

    def run(
        self, columns: dict[str, NDArray[np.float64]], starts: Sequence[int], inputs: bool = ...
    ) -> dict[str, NDArray[Any]]:
        """Results of each row by name, for the stages that the joint has; NaN in rows that a
        stage missed. It starts anew at the rows `starts`, which rise from 0.

        'missed': 1 thermistor, 2 temperature_compensation, 4 sensor, 8 observer, 16 compliance,
        32 merge, 64 collision, 128 compliant_observer, 256 differentiator. 'flags': 1 extrapolated,
        2 saturated, 4 a reading beyond its limit. 'faults', of limits and reading_checks: 1 sensor,
        2 motor, 4 speed, 8 motion, 16 encoders, 32 where sensor and observer disagree,
        64 temperature. `inputs`: also what the stages read, 'velocity', 'momentum', 'motor_torque'
        at the output, 'observer_intrinsic', 'torsion', 'gear_known', 'link_momentum'. Of a joint
        that adapts 'adapted': the first eight coefficients of the observed model behind each row, 0
        where it has fewer, and 'told': directions of them that its last round of blocks told.
        """

class Plant:
    """A fitted drive as a body that moves."""

    def __init__(
        self,
        design: Design,
        coefficients: ArrayLike,
        motor_offset: float,
        drive_factor: float,
        load_factor: float,
    ) -> None: ...
    @property
    def inertia(self) -> float:
        """kg m², or A s²/rad of a current."""

    def drive(
        self,
        time: ArrayLike,
        columns: dict[str, NDArray[np.float64]],
        servo: dict[str, float],
        position: float,
        velocity: float,
        steps: int,
        hold: bool,
        channels: Sequence[str],
    ) -> tuple[dict[str, NDArray[np.float64]], int]:
        """Drives through the inputs of a log: what is asked for, and how many rows are valid."""

class SimulatedJoint:
    """The parameters of a joint, ready to simulate."""

    def __init__(self, fields: dict[str, Any]) -> None: ...
    @property
    def eventless(self) -> bool:
        """True where nothing can stick, slip or touch."""
    @property
    def expandable(self) -> bool:
        """True where the motion is a power series between kinks, and energy is lost."""

class Remembered:
    """What effects remembered at rows of one problem's runs, `lead` rows back at most."""

    def __init__(self, lead: int | None = ...) -> None: ...

class Screen:
    """Columns of runs, made a piece at a time and mixed from rows of a design."""

    def __init__(
        self, design: Design, load: ArrayLike, given: int, remembered: Remembered
    ) -> None: ...
    def left_over(
        self, runs: Sequence[_Run], held: Sequence[_Shares], threads: int
    ) -> list[NDArray[np.float64]]:
        """Target less what is held in each fold, (N,) for each run; NaN where no row counts."""

    def products(
        self,
        runs: Sequence[_Run],
        columns: Sequence[_Shares],
        held: _Shares,
        whitening: Sequence[float] | NDArray[np.float64],
        every: int,
        threads: int,
    ) -> NDArray[np.float64]:
        """Sums of products of filtered [columns, target], (folds, columns + 1, columns + 1)."""

    def rows(self, run: _Run, columns: Sequence[_Shares], held: _Shares) -> NDArray[np.float64]:
        """[columns, target] of the stretches of one run, (rows, columns + 1), not whitened."""

    @property
    def parts(self) -> int:
        """How many parts columns may be mixed from."""

class Solution:
    """Least squares from a Gram matrix."""

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Shape (columns,); 0 at dependent ones."""

    @property
    def condition(self) -> float:
        """Of the basic columns scaled to length one (estimate)."""

    @property
    def dependence(self) -> NDArray[np.float64]:
        """Shape (columns - rank, rank): of which basic columns each dependent one is made."""

    @property
    def double_is_enough(self) -> bool:
        """Whether plain sums were good to 1e-9 here, without double-double."""

    @property
    def factor(self) -> NDArray[np.float64]:
        """Shape (rank, columns): XᵀX = factorᵀ factor."""

    @property
    def order(self) -> list[int]:
        """Columns, pivots first: order[:rank] are the basic ones."""

    @property
    def rank(self) -> int:
        """How many columns are independent."""

    @property
    def residual_squares(self) -> float:
        """|X b - y|², at least 0."""

    @property
    def rotated_target(self) -> NDArray[np.float64]:
        """Qᵀ y of the basic columns, shape (rank,)."""

def accumulate_rows(
    rows: ArrayLike,
    target: ArrayLike,
    blocks: Sequence[tuple[int, int]],
    weights: ArrayLike | None,
    double_double: bool,
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sums of products of [rows, target] of each block, from explicit rows: (high, low)."""

def bridge_ripple(
    position: ArrayLike, sensitivity: ArrayLike, sign: ArrayLike, arm: ArrayLike, waves: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Ripple at the output of each placement as strain: cosine, sine, (D, O); torque gain, (D,)."""

def bridge_signal(
    angle: ArrayLike,
    torque_strain: ArrayLike,
    warmer: ArrayLike,
    position: ArrayLike,
    sensitivity: ArrayLike,
    sign: ArrayLike,
    arm: ArrayLike,
    thermal_linear: ArrayLike,
    thermal_quadratic: ArrayLike,
    waves: ArrayLike,
    gauge_factor: float,
    supply: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Strain of each gauge, (N, n), and output of the bridge in V, (N,)."""

def catalogue() -> list[dict[str, Any]]:
    """Every effect of the core: name, targets, terms, shapes, channels read, pairs of parts."""

def condition_signal(
    time: ArrayLike,
    voltage: ArrayLike,
    gain: float,
    offset: float,
    time_constant: float,
    reference: float,
    bits: int,
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """What the converter reads of a bridge [V], and flags: 2 at the end of its range."""

def detect_collision(
    time: ArrayLike,
    residual: ArrayLike,
    velocity: ArrayLike,
    *,
    speed_edges: Sequence[float],
    negative: Sequence[float],
    positive: Sequence[float],
    release: float,
    hold: float,
) -> NDArray[np.bool_]:
    """Whether each row is in contact by its external torque [Nm] and velocity [rad/s]."""

def gauge_sensitivity(
    factor_error: ArrayLike, tilt: ArrayLike, poisson: float
) -> NDArray[np.float64]:
    """Sensitivity of gauges with a factor error and a tilt [rad]."""

def isa() -> str:
    """Name of the instruction set in use: 'baseline', 'v3' or 'v4'."""

def local_weights(
    time: ArrayLike,
    rows: ArrayLike,
    first: ArrayLike,
    last: ArrayLike,
    sigma: ArrayLike,
    degree: int,
    derivative: int,
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Weights of polynomials around rows: (data, indices, indptr) of a sparse (rows, N) matrix."""

def merge(
    high: ArrayLike, low: ArrayLike, chosen: Sequence[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sum of the chosen blocks' sums of products, exact where they are: (high, low)."""

def merge_kalman(
    time: ArrayLike,
    velocity: ArrayLike,
    observer: ArrayLike,
    compliance: ArrayLike,
    *,
    alpha: float,
    transition_velocity: float,
    walk: float,
    observer_rest: float,
    observer_motion: float,
    compliance_rest: float,
    compliance_motion: float,
) -> NDArray[np.float64]:
    """Torque [Nm] that observer and compliance agree on, by a Kalman filter of a random walk."""

def merge_weight(
    velocity: ArrayLike, *, alpha: float, transition_velocity: float
) -> NDArray[np.float64]:
    """Share of the observer in the logistic merge at each velocity [rad/s at the output]."""

def mesh_torque(
    torsion: ArrayLike, *, mesh_stiffness: float, mesh_shape: float, margin: float
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Outward torque [Nm] from the mesh's torsion [rad at the output]: (torque, flags)."""

def hysteretic_mesh_torque(
    torsion: ArrayLike,
    *,
    mesh_stiffness: float,
    mesh_shape: float,
    margin: float,
    load_width: float,
    heights: Sequence[float],
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.float64]]:
    """Torque of one run whose torsion also remembers the way of the load, row by row:
    (torque, flags, torsion of the mesh alone). `heights` [rad at the output] of `load_width` [Nm at
    the output], its half, quarter and eighth; NaN where the torsion is not finite.
    """

def mesh_torsion(
    torque: ArrayLike, *, mesh_stiffness: float, mesh_shape: float
) -> NDArray[np.float64]:
    """Torsion of the mesh [rad at the output] under an outward torque [Nm at the output]."""

def noise_variances(
    resistance: float,
    amplifier_noise: float,
    gain: float,
    time_constant: float,
    capacitance: float,
    reference: float,
    bits: int,
    temperature: float,
) -> tuple[float, float, float, float]:
    """Variances at the converter [V²]: bridge, amplifier, low pass, rounding."""

def observe_momentum(
    time: ArrayLike, momentum: ArrayLike, known_torque: ArrayLike, *, gain: float, exact: bool
) -> NDArray[np.float64]:
    """External torque [Nm, outward] from the momentum [Nm s] and what else drives it [Nm]."""

def reading_limits() -> list[dict[str, Any]]:
    """How large the readings of a joint of which nothing is known may be: 'name', 'unit', 'default'
    and what else the fields of `stages` have.
    """

def replay_differentiator(
    time: ArrayLike, position: ArrayLike, bandwidth: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocity and acceleration of each row by the causal differentiator of the core."""

def replay_order_tracker(
    angle: ArrayLike, reading: ArrayLike, orders: Sequence[int], points: int
) -> NDArray[np.float64]:
    """Torque of each row, the orders taken out over the resampled angle."""

def replay_ripple_oscillator(
    time: ArrayLike,
    angle: ArrayLike,
    reading: ArrayLike,
    orders: Sequence[int],
    noise: float,
    level_rate: float,
    ripple_rate: float,
    amplitude: float,
) -> NDArray[np.float64]:
    """Torque of each row, the ripple taken out by the core's Kalman oscillator."""

def simulate(
    joint: SimulatedJoint,
    time: ArrayLike,
    inputs: dict[str, NDArray[np.float64]],
    hold: bool,
    options: dict[str, Any],
    start: dict[str, Any],
    channels: Sequence[str],
) -> dict[str, Any]:
    """Drives a joint through time: dict of columns, fault, row, largest_phase, end."""

def simulation_rates(joint: SimulatedJoint, torque: float) -> tuple[float, float]:
    """Fastest eigenfrequency and decay [1/s] where the gear transmits `torque` [Nm]."""

def simulation_torque(joint: SimulatedJoint, windup: ArrayLike) -> NDArray[np.float64]:
    """Transmitted torque [Nm, output] at wind-ups [rad, motor side]; infinite past the pole."""

def simulation_windup(joint: SimulatedJoint, torque: ArrayLike) -> NDArray[np.float64]:
    """Wind-up of the gear [rad, motor side] at transmitted torques [Nm, output]."""

def solve(high: ArrayLike, low: ArrayLike) -> Solution:
    """Least squares from the sums of products of [X, y]; low is empty for plain sums."""

def stages() -> dict[str, dict[str, Any]]:
    """The stages of a chain in the order of their parameters, a dict each.

    'member' of the chain, 'type' in an exported header, 'bit' that says it missed, 'within', the
    entry of model.json that holds it, 'rules': 'name', 'type'.
    'choice' that the chain makes by it, or None: 'key' in model.json, 'member', 'type' of the
    enumerators, 'prefix' of the words in a block.
    'fields', its numbers in the core's order: 'name' of the member, 'unit', 'key' in model.json
    (two of one key are the two numbers of its list), 'needed' there, 'low' and 'high' that it may
    be, 'default', which an array has not.
    """

def structural_damping_torque(
    time: ArrayLike,
    torsion: ArrayLike,
    *,
    damping: float,
    time_constant: float,
    initial_torque: float,
    threshold: float,
) -> NDArray[np.float64]:
    """Outward torque [Nm] of each row from the rate of the torsion [rad at the output]."""

def temperature_compensation(
    time: ArrayLike,
    temperature: ArrayLike,
    *,
    coefficients: Sequence[float],
    reference_temperature: float,
    gradient: float,
    thermal_lag: float,
) -> NDArray[np.float64]:
    """Torque [Nm] to add to each row's reading so that temperature leaves no trace."""

def thermistor_temperature(
    voltage: ArrayLike,
    *,
    supply_voltage: float,
    divider_resistance: float,
    nominal_resistance: float,
    beta: float,
    nominal_temperature: float,
) -> NDArray[np.float64]:
    """Temperature [°C] from the divider's voltage [V]; NaN where the line is open or short."""

def thermistor_voltage(
    temperature: ArrayLike,
    *,
    supply_voltage: float,
    divider_resistance: float,
    nominal_resistance: float,
    beta: float,
    nominal_temperature: float,
) -> NDArray[np.float64]:
    """The divider's voltage [V] at a temperature [°C]; NaN at absolute zero and below."""

def wave_generator_torsion(
    motor_torque: ArrayLike, *, stiffness: float, shape: float
) -> NDArray[np.float64]:
    """Torsion of the wave generator [rad at the motor] under a motor torque [Nm at the motor]."""

def whiten(
    columns: NDArray[np.float64],
    whitening: ArrayLike,
    every: int,
    out: NDArray[np.float64],
) -> None:
    """Filter one row of `every` of columns (N, C) into `out`, columns of neighbouring rows."""
