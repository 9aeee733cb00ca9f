"""Tables I, II and III of the third paper, published beside ours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import flexspline.full_range as fr
from flexspline.reproduce.full_range.quantities import PUBLISHED, found_orders
from flexspline.reproduce.full_range.study import RATIO, Study
from flexspline.rigs.full_range import COULOMB, INERTIA, KINEMATIC_ERROR, VISCOUS

if TYPE_CHECKING:
    import pandas

__all__ = ["table_1", "table_2", "table_3"]

#: Order per turn of the output of once per turn of a pair.
PER_TURN = {
    "output_on_housing": 1,
    "wave_generator_on_circular_spline": 100,
    "wave_generator_on_flexspline": 101,
}
SPEEDS = (0.2, 0.5, 1.0, 1.5)  # rad/s
COLUMNS = ("published", "ours", "standard error", "true in the rig", "unit")


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
