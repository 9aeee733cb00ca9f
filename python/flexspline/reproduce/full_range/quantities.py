"""The quantities of the paper's claims, for one rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import flexspline.full_range as fr
from flexspline.least_squares.result import Fit
from flexspline.reproduce.full_range.study import RATIO, Study
from flexspline.rigs.full_range import KINEMATIC_ERROR, full_range_rig

__all__ = ["PUBLISHED", "Found", "draw", "found_orders", "found_share", "pole"]

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
