"""Reproduction of full_range_torque_estimation on `flexspline.rigs.full_range_rig`.

One draw fits friction, gear and merge on training runs and is judged on another day's. As the paper
has it (§IV): the observer's model from a training set, kinematic error from a training set, c1's
stiffness from the data sheet, c2's from a stiffness run, α and q̇_trans for the least RMSE on the
training log. L = 80 1/s is our reading of Table II; L = −8 diverges.

Tables I to III and Figures 7 to 9 stand beside ours, with what to look at in each and the errors in
the paper's text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np

import flexspline.full_range as fr
from flexspline.fitting import fit
from flexspline.least_squares.result import Fit
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.part import Part
from flexspline.plot.canvas import (
    GREY,
    INK,
    LEAST,
    PALETTE,
    PlainFigure,
    axes_or_new,
    legend,
    titled,
)
from flexspline.plot.estimate import error_over_speed
from flexspline.reproduce import Story
from flexspline.rigs.full_range import (
    COULOMB,
    INERTIA,
    KINEMATIC_ERROR,
    MOTION,
    VISCOUS,
    FullRangeRig,
    full_range_rig,
)

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

    from flexspline.full_range import ErrorTable

__all__ = [
    "CAPTIONS",
    "GAIN",
    "PUBLISHED",
    "RATIO",
    "Found",
    "Study",
    "draw",
    "found_orders",
    "pole",
    "story",
    "table_1",
    "table_2",
    "table_3",
]

RATIO = 101.0
GAIN = 80.0  # 1/s
GP_ROWS = 250
#: Friction (21), (22) with both levels; the sign of the speed is smooth within `WIDTH`.
DRIVE = (
    "inertia",
    "coulomb_friction_per_direction",
    "viscous_friction",
    "nonlinear_viscous_friction",
)
WIDTH = 0.005  # rad/s
BANDWIDTH = 20.0  # Hz, of the velocity and acceleration that the fit reads
#: Harmonic Drive, size 20, ratio 80 and above: they give c1 of Table III to the printed digits.
STIFFNESSES = (1.6e4, 2.5e4, 2.9e4)  # K1, K2, K3, Nm/rad
TORQUES = (7.0, 25.0)  # T1, T2, Nm
LOST_MOTION = 2.91e-4  # rad, 1 arcmin

#: Table I: RMSE and variance of (full, motion, no motion), Nm and Nm².
PUBLISHED = {
    "m1": ((1.03, 1.06), (1.01, 0.98), (1.04, 1.07)),
    "m2": ((0.87, 0.75), (1.02, 1.05), (0.74, 0.55)),
    "o": ((1.69, 2.85), (1.01, 0.99), (2.03, 4.10)),
    "c1": ((2.24, 4.99), (3.24, 10.44), (1.09, 1.19)),
    "c2": ((1.02, 1.02), (1.33, 1.67), (0.74, 0.55)),
    "sd": ((1.23, 0.54), (1.30, 0.47), (1.17, 0.57)),
    "gp": ((1.62, 2.61), (1.54, 2.35), (1.67, 2.79)),
}

#: Which two methods of Table I are compared, and on which rows.
COMPARED = (
    "full.m1_beats_o",
    "full.m2_beats_o",
    "full.m2_beats_c2",
    "full.m1_beats_c1",
    "full.c2_beats_o",
    "full.o_beats_c1",
    "full.m2_beats_m1",
    "full.m1_ties_c2",
    "motion.o_beats_c1",
    "motion.o_beats_c2",
    "motion.m1_ties_o",
    "motion.m2_ties_o",
    "standstill.c1_beats_o",
    "standstill.c2_beats_c1",
    "standstill.m2_ties_c2",
    "standstill.m1_ties_c1",
)
GROUPS = {"full": "full", "motion": "motion", "standstill": "no motion"}
MOST_OFF, MOST_ERRORS = 0.2, 3.0  # of an amplitude: share of it, standard errors

#: Order per turn of the output of once per turn of a pair.
PER_TURN = {
    "output_on_housing": 1,
    "wave_generator_on_circular_spline": 100,
    "wave_generator_on_flexspline": 101,
}
SPEEDS = (0.2, 0.5, 1.0, 1.5)  # rad/s
COLUMNS = ("published", "ours", "standard error", "true in the rig", "unit")

FIGURES_GP_ROWS = 500
RIGS = 3  # in the picture of Table I
SUBSET = slice(0, 10000)  # 20 s of the day of validation, from rest
SLOWEST = 5e-4  # rad/s, of the axis
PANELS = ("full", "motion", "no motion")
PUBLISHED_TRANSITIONS = {"1": 0.001, "2": 0.45}  # rad/s

CAPTIONS = {
    "fig7": "RMSE against speed on the training log, with the spread over blocks of time: the "
    "compliance wins at rest, the observer from some mrad/s on, and the optimum of q̇_trans lies "
    "where the curves cross. The printed α = 500 s/rad with q̇_trans = 0.001 rad/s leaves "
    "λ(0) = 0.378 of (20): at rest 38 % of m1 is an observer that is blind there.",
    "fig8": "20 s of the day of validation, shaded to the height of λ(q̇). No motion: the torsion "
    "follows the torque while the joint stands. The motor torque is not zero but ripple and an "
    "offset: with τ_m ≈ 0 the wave generator's term (16) is all but silent. What counts as "
    "motion is not printed; here |q̇| ≥ 0.01 rad/s.",
    "fig9": "At rest the observer o stays near zero whatever the push, in motion the compliance c1 "
    "is off by what the joint's vibration and the encoders make of it; m1 and m2 take the better "
    "one. All torques are positive outward: as printed (8) and (18) have opposite signs for one "
    "push, and (19) would average a torque with its negative.",
    "table1_compared": "Table I as a picture: grey is printed, points are rigs that differ in what "
    "the paper does not print. Look at the order of the methods within a panel, not at the "
    "lengths of the bars.",
    "table1": "RMSE [Nm], error variance [Nm²] and bias [Nm], validation on another day than the "
    "training. Most of m2's 49 % below o is c2's: as printed, c2 alone is 40 % below o, and m2 is "
    "15 % below c2. The printed RMSE² − variance leaves 0.9 to 1.1 Nm of bias in sd. kalman, co, "
    "mco and o2 are not in the paper: the filter in place of (19), and observers that hold the "
    "compliant gear. gp has 500 rows of training in place of 22070; of sd only the reference is "
    "printed, ours is a reading.",
    "table2": "Published and fitted. The gain L_d is −8 in the text and 80 in the table, "
    "without a unit: (7) with L = −8 diverges, 80 1/s at 500 Hz is our reading. The three viscous "
    "coefficients are hard to tell apart at these speeds (in some rigs the fit knows combinations "
    "only, which then stand below), so judge the curve. Fitted "
    "levels hold Stribeck and load-dependent friction as well.",
    "table3": "Published and fitted. Appendix B calls it Table II, and (17) what is (15), (16), "
    "(18), (23); (15) writes c_c, K_c0 for c_m, K_m0; the unit of a stiffness is Nm/rad, not "
    "Nm·rad; (11) repeats θ_ci, with Δθ = θ_c Ñ − θ_w (13) and (14) follow. (18) has a pole at "
    "2.07 mrad (c1) and 1.22 mrad (c2) of mesh torsion, where ours is held and flagged. The "
    "measured K_m0 also holds hysteresis and what (16) takes off too much of lost motion, and its "
    "error is wide because one loop is little to learn from.",
}


@dataclass(frozen=True)
class Study:
    """A rig, what is fitted to its training runs, and how it does on another day.

    `gp_rows`: samples that enter the Gaussian process; 0 leaves it out.
    """

    rig: FullRangeRig
    gp_rows: int = GP_ROWS

    @cached_property
    def training(self) -> Log:
        return self.rig.training()

    @cached_property
    def validation(self) -> Log:
        return self.rig.validation()

    @cached_property
    def drive(self) -> Fit:
        """Inertia and friction, from the rows that move: at rest friction is not determined.

        The run by hand has the inertia, that with several speeds the bends of the friction.
        """
        logs = [differentiate(r, bandwidth=BANDWIDTH) for r in (self.training, self.rig.friction())]
        return fit(
            DRIVE,
            [r.rows(np.abs(r["output_velocity"]) >= MOTION, note="rows that move") for r in logs],
            "motor_torque",
            known_load="reference_torque",
            fixed={"direction_width": WIDTH},
            checks=False,
        )

    @cached_property
    def kinematic_error(self) -> Fit:
        """(23) with its orders found, on the compliance of the data sheet: this is c1."""
        sheet = fr.torsion_part_from_datasheet(
            *STIFFNESSES,
            *TORQUES,
            lost_motion=LOST_MOTION,
            gear_ratio=100.0,
            output_spline="circular",
        )
        return fr.fit_kinematic_error(sheet, self.rig.turning(), checks=False)

    @cached_property
    def mesh(self) -> Fit:
        """K_m0 from the stiffness run."""
        return fr.fit_mesh_stiffness(self.c1, self.rig.stiffness(), checks=False)

    @property
    def c1(self) -> Part:
        return self.kinematic_error.part

    @property
    def c2(self) -> Part:
        """c1 with the stiffness that was measured: they differ in nothing else."""
        return fr.with_mesh_stiffness(self.c1, self.stiffness, RATIO)

    @property
    def stiffness(self) -> float:
        """K_m0 as measured, Nm/rad."""
        return fr.mesh_of(self.mesh.part, RATIO).stiffness

    @cached_property
    def trained(self) -> fr.FullRange:
        return fr.train(
            self.drive.model,
            self.training,
            torsion_parts={"1": self.c1, "2": self.c2},
            gain=GAIN,
            rotor_inertia=self.rig.joint.motor.inertia,
            motion_speed=MOTION,
            methods=("sd", "gp", "kalman") if self.gp_rows else ("sd", "kalman"),
            gp_rows=self.gp_rows,
        )

    @cached_property
    def table(self) -> fr.ErrorTable:
        """Table I, on the day of validation."""
        return self.trained.table(self.validation)


@dataclass(frozen=True)
class Found:
    """An order of the kinematic error as fitted: rad at the motor, its error, phase of (23)."""

    amplitude: float
    standard_error: float
    phase: float


def draw(rng: np.random.Generator) -> Mapping[str, float]:
    """Return the quantities of the paper's claims for one rig."""
    study = Study(full_range_rig(int(rng.integers(2**32))))
    paper = fr.Transition(500.0, 0.001, (500.0, 500.0), (0.001, 0.001), 0.0, 0.0, 0.0)
    values = {
        **_table_quantities(study.table),
        **_speed_quantities(study.trained),
        "lambda_at_rest": paper.weight_at_rest,
        "pole.c1": 1e3 * pole(15548.0),
        "pole.c2": 1e3 * pole(26431.0),
        "gain_minus_8": float(np.exp(8.0)),  # p − p̂ of (7) obeys ė = −L e
        "kinematic_error": found_share(study.kinematic_error),
        "stiffness_ratio": study.stiffness / fr.mesh_of(study.c1, RATIO).stiffness,
    }
    return {f"full_range.{name}": value for name, value in values.items()}


def pole(stiffness: float, shape: float = 0.0487) -> float:
    """Return the torsion of the mesh at which (18) has its pole, rad at the output."""
    return float(np.pi / (2.0 * shape * stiffness))


def found_share(made: Fit) -> float:
    """Return which share of the ten orders is found within 20 % or three standard errors."""
    found = found_orders(made)
    good = []
    for printed in KINEMATIC_ERROR:
        ours = found.get((printed.order, printed.pair))
        good.append(
            ours is not None
            and abs(ours.amplitude - printed.amplitude)
            <= max(MOST_OFF * printed.amplitude, MOST_ERRORS * ours.standard_error)
        )
    return float(np.mean(good))


def found_orders(made: Fit) -> dict[tuple[int, str], Found]:
    """Return what the fit says of each order that it found, by order and pair of parts."""
    (error,) = [e for e in made.part.effects if e.name == "kinematic_error"]
    rows = [p for p in made.parameters if p.name.startswith("kinematic_error.")]
    found = {}
    for k, key in enumerate(error.harmonics):
        cosine, sine = rows[2 * k], rows[2 * k + 1]
        size = float(np.hypot(cosine.value, sine.value))
        spread = np.hypot(cosine.value * cosine.standard_error, sine.value * sine.standard_error)
        phase = float(np.arctan2(-sine.value, cosine.value))
        found[key] = Found(size, float(spread) / size, phase)
    return found


def _table_quantities(table: fr.ErrorTable) -> dict[str, float]:
    def over(one: str, other: str, group: str = "full") -> float:
        return table[one][group].rmse / table[other][group].rmse

    values = {}
    for place, name in (key.split(".") for key in COMPARED):
        one, _, other = name.split("_")
        values[f"table1.{place}.{name}"] = over(one, other, GROUPS[place])
    others = min(table[name]["full"].variance for name in PUBLISHED if name != "sd")
    return {
        **values,
        "table1.sd_smallest_variance": table["sd"]["full"].variance / others,
        "table1.sd_bias": abs(table["sd"]["full"].bias),
        "table1.gp": over("gp", "c2"),
        "gain_m1": table.improvement("m1", "o"),
        "gain_m2": table.improvement("m2", "o"),
        "gain_over_best_single": min(table.improvement("m2", name) for name in ("o", "c1", "c2")),
    }


def _speed_quantities(trained: fr.FullRange) -> dict[str, float]:
    rmse = trained.curve.rmse
    one, two = (trained.transitions[name].transition_velocity for name in ("m1", "m2"))
    return {
        "fig7.c1_wins_at_rest": float(rmse["c1"][0] / rmse["o"][0]),
        "fig7.o_wins_in_motion": float(rmse["o"][-1] / rmse["c1"][-1]),
        "fig7.transition_m1": one,
        "fig7.transition_m2_later": two - one,
    }


def table_1(study: Study) -> pandas.DataFrame:
    """RMSE, variance and bias; the published bias is √(RMSE² − variance), without its sign."""
    import pandas

    rows = {}
    for method in (*PUBLISHED, *(m for m in study.table.methods if m not in PUBLISHED)):
        row: dict[str, float] = {}
        for k, group in enumerate(("full", "motion", "no motion")):
            rmse, variance = PUBLISHED.get(method, ((np.nan, np.nan),) * 3)[k]
            score = study.table[method][group]
            row |= {
                f"{group}: RMSE published": rmse,
                f"{group}: RMSE ours": score.rmse,
                f"{group}: variance published": variance,
                f"{group}: variance ours": score.variance,
                f"{group}: |bias| published": np.sqrt(np.maximum(rmse**2 - variance, 0.0)),
                f"{group}: bias ours": score.bias,
            }
        rows[method] = row
    return pandas.DataFrame.from_dict(rows, orient="index")


def table_2(study: Study) -> pandas.DataFrame:
    """Inertia and friction; what is known of the cubic are combinations, and the curve itself."""
    import pandas

    made = study.drive
    printed = (INERTIA, COULOMB[0], -COULOMB[1], *VISCOUS)
    names = ("J", "f_C+", "−f_C−", "f_v1", "f_v2", "f_v3")
    fitted = made.parameters[: len(printed)]
    rows = {
        name: (value, p.value, p.standard_error, value, p.unit)
        for name, value, p in zip(names, printed, fitted, strict=True)
    }
    for known in (k for group in made.confounded for k in group.known):
        value = sum(
            weight * printed[[p.name for p in fitted].index(name)] for name, weight in known.weights
        )
        rows[str(known)] = (value, known.value, known.standard_error, value, known.unit)
    values = made.part.coefficients
    for speed in SPEEDS:
        powers = np.array([1.0, speed, speed**2, speed**3])
        curve = float(powers @ np.array([COULOMB[0], *VISCOUS]))
        ours = float(powers @ values[[1, 3, 4, 5]])
        rows[f"friction at {speed:g} rad/s"] = (curve, ours, np.nan, curve, "Nm")
    return pandas.DataFrame.from_dict(rows, orient="index", columns=list(COLUMNS))


def table_3(study: Study) -> pandas.DataFrame:
    """Compliance of c1 and c2, and the ten orders with amplitude and phase."""
    import pandas

    gear = study.rig.joint.gear
    sheet = fr.mesh_of(study.c1, RATIO)
    (compliance,) = [p for p in study.mesh.parameters if p.name == "mesh_compliance.compliance"]
    error = study.stiffness * compliance.standard_error / compliance.value
    wave = 1.0 / study.c1.coefficients[1]
    shape = study.c1.effects[1].shapes["wave_generator_shape"]
    true = gear.mesh_stiffness
    rows = {
        "K_m0 of c1": (15548.0, sheet.stiffness, np.nan, true, "Nm/rad"),
        "K_m0 of c2": (26431.0, study.stiffness, error, true, "Nm/rad"),
        "c_m": (0.0487, sheet.shape, np.nan, gear.mesh_shape, "1/Nm"),
        "K_w0": (21.9931, wave, np.nan, gear.wave_generator_stiffness, "Nm/rad"),
        "c_w": (3.1250, shape, np.nan, gear.wave_generator_shape, "1/Nm"),
    }
    found = found_orders(study.kinematic_error)
    for h in KINEMATIC_ERROR:
        ours = found.get((h.order, h.pair))
        name = f"order {h.order * PER_TURN[h.pair]}"
        size, spread, phase = (
            (1e3 * ours.amplitude, 1e3 * ours.standard_error, ours.phase)
            if ours is not None
            else (np.nan,) * 3
        )
        rows[f"{name}: amplitude"] = (1e3 * h.amplitude, size, spread, 1e3 * h.amplitude, "mrad")
        rows[f"{name}: phase"] = (h.phase, phase, np.nan, h.phase, "rad")
    return pandas.DataFrame.from_dict(rows, orient="index", columns=list(COLUMNS))


def story(seed: int) -> Story:
    """Return figures and tables of one rig, and Table I of a few more."""
    study = Study(full_range_rig(seed), FIGURES_GP_ROWS)
    tables = [study.table, *(Study(full_range_rig(seed + k), 0).table for k in range(1, RIGS))]
    return Story(
        {
            "fig7": _over_speed(study),
            "fig8": cast("PlainFigure", study.trained.plot_validation(_subset(study))),
            "fig9": _torques(study),
            "table1_compared": _compared(tables),
        },
        {"table1": table_1(study), "table2": table_2(study), "table3": table_3(study)},
        CAPTIONS,
    )


def _over_speed(study: Study) -> PlainFigure:
    figure = PlainFigure(11.0, 4.2)
    for place, number in enumerate(PUBLISHED_TRANSITIONS, start=1):
        ax = figure.add_subplot(1, 2, place)
        error_over_speed(
            study.trained.curve,
            ax,
            methods=("o", f"c{number}"),
            transition=study.trained.transitions[f"m{number}"],
        )
        printed = PUBLISHED_TRANSITIONS[number]
        ax.axvline(printed, color=PALETTE[3], ls=":", label=f"printed: {printed:g} rad/s")
        ax.set_xlim(left=SLOWEST)
        legend(ax)
    return figure


def _subset(study: Study) -> Log:
    return study.validation.rows(SUBSET, note="20 s")


def _torques(study: Study) -> PlainFigure:
    figure = PlainFigure(10.0, 7.6)
    log = _subset(study)
    for place, number in enumerate(PUBLISHED_TRANSITIONS, start=1):
        ax = figure.add_subplot(2, 1, place)
        methods = ("o", f"c{number}", f"m{number}")
        study.trained.plot_torque(log, ax, methods=methods)
    return figure


def _compared(tables: Sequence[ErrorTable]) -> PlainFigure:
    """RMSE of each method: printed as a bar, ours as a point for each rig."""
    figure = PlainFigure(11.0, 4.4)
    panels = figure.subplots(1, 3, sharey=True)
    ours = [*PUBLISHED, "kalman", "mco"]
    for column, (ax, group) in enumerate(zip(panels, PANELS, strict=True)):
        axes_or_new(ax)
        titled(ax, group)
        printed = [PUBLISHED[m][column][0] for m in PUBLISHED]
        ax.barh(range(len(printed)), printed, color=GREY, alpha=0.45, label="printed")
        _points(ax, tables, ours, group)
        ax.set_xlabel("RMSE [Nm]")
        ax.set_xlim(left=0.0)
    panels[0].set_yticks(range(len(ours)), ours)
    panels[0].invert_yaxis()
    shown, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        shown, labels, loc="outside upper right", ncols=3, frameon=False, labelcolor=INK,
        fontsize=LEAST,
    )  # fmt: skip
    return figure


def _points(ax: Axes, tables: Sequence[ErrorTable], methods: Sequence[str], group: str) -> None:
    for number, table in enumerate(tables):
        there = [(k, table[m][group].rmse) for k, m in enumerate(methods) if m in table.methods]
        ax.plot(
            [rmse for _, rmse in there],
            [k for k, _ in there],
            "o" if number == 0 else ".",
            color=PALETTE[0] if number == 0 else INK,
            ms=6 if number == 0 else 5,
            label="ours, the rig of fig. 7 to 9"
            if number == 0
            else "ours, other rigs" * (number == 1),
        )
