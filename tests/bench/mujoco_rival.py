"""The best joint that MuJoCo has built in for the servo of notebooks/mujoco_plugin.ipynb.

    python tests/bench/mujoco_rival.py [--starts 6] [--evaluations 40]
                                       [--simplex 400] [--with-frictionloss]

Armature, damping, torque, back-EMF and the LuGre friction of a passive `dcmotor`, with frictionloss
or without, by least squares of the simulated angle over the notebook's twelve logs, from several
starts, and from the best of them by a simplex, which the steps of a joint that sticks do not stop.
Prints what each finds, its RMSE over the twelve, and
at last that of the best over the four held out. The drive law, the logs and the loss are those of
the notebook and of mujoco_pendulum.ipynb, which identified damping and frictionloss. Needs `mujoco`
4 and the measured logs (FLEXSPLINE_DATA). Takes 2 min of processor time.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))

import measured
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

from flexspline.logs import Log, read_log

Array = NDArray[np.float64]

HELD_OUT = ("10h28m17", "10h28m57", "10h29m37", "10h29m47")
MASS, ARM, GRAVITY = 0.49, 0.1, 9.81
COUNTS = 4096 / (2 * np.pi)  # of the encoder, per rad
SUBSTEPS = 2
XML = f"""
<mujoco>
  <option gravity="0 0 -{GRAVITY}" integrator="implicitfast"/>
  <worldbody>
    <body>
      <joint name="servo" type="hinge" axis="0 1 0" armature="1" frictionloss="1"/>
      <geom type="sphere" size="0.001" pos="0 0 -{ARM}" mass="{MASS}"/>
    </body>
  </worldbody>
  <actuator>
    <general joint="servo" biastype="affine"/>
    <dcmotor joint="servo" input="none" motorconst="0 0" resistance="1" lugre="1 1 1 1 1"/>
  </actuator>
</mujoco>"""
FARTHEST = 3.0  # rad, of a residual: a simulation that runs away is no better the farther it goes

NAMES = (
    "torque",
    "back_emf",
    "damping",
    "armature",
    "stiffness",
    "bristle_damping",
    "coulomb",
    "static_beyond_coulomb",
    "stribeck",
    "frictionloss",
)
FIRST = (0.0739, 0.0274, 0.00693, 0.00143)  # of mujoco_pendulum.ipynb, with frictionloss 0.0233
LEVEL = 0.0233
STARTS = [  # stiffness, bristle damping, Coulomb's level, beyond it at rest, Stribeck's velocity
    (20.0, 0.01, LEVEL, 0.3 * LEVEL, 0.1),
    (5.0, 0.003, LEVEL, LEVEL, 0.3),
    (100.0, 0.03, LEVEL, LEVEL, 0.05),
    (2.0, 0.01, 0.5 * LEVEL, 2.0 * LEVEL, 0.5),
    (50.0, 0.003, 0.3 * LEVEL, 3.0 * LEVEL, 1.0),
    (10.0, 0.05, 2.0 * LEVEL, 0.1 * LEVEL, 0.1),
]
LEAST = np.log((1e-3, 1e-4, 1e-5, 1e-5, 0.05, 1e-6, 1e-5, 1e-6, 1e-3, 1e-6))
MOST = np.log((1.0, 1.0, 1.0, 0.1, 2e3, 0.3, 1.0, 1.0, 20.0, 1.0))
SIDE = 0.15  # of the simplex, in logarithms


def driven(scene: Any, log: Log, joint: Array) -> Array:
    """The angle [rad] that MuJoCo gives for the commands of a log, from its first row on."""
    torque, back_emf, damping, armature, *bristle, loss = joint
    stiffness, bristle_damping, coulomb, beyond, stribeck = bristle
    scene.dof_damping[0], scene.dof_armature[0] = damping, armature
    scene.dof_frictionloss[0] = loss
    scene.actuator_dynprm[1, 5:7] = stiffness, bristle_damping
    scene.actuator_biasprm[1, 3:6] = coulomb, coulomb + beyond, stribeck
    state = mujoco.MjData(scene)
    state.qpos[0] = log["output_position"][0]
    names = ("time", "commanded_position", "supply_voltage", "enabled")
    time, goal, volts, enabled = (log[name].tolist() for name in names)
    gain = log.facts["kp"] * COUNTS / (256 * 885)
    angle = np.empty(len(log))
    for row in range(len(log)):
        now = float(state.qpos[0])
        angle[row] = now
        if row == len(log) - 1 or not abs(now) < 1e3:
            angle[row:] = now
            break
        scene.opt.timestep = (time[row + 1] - time[row]) / SUBSTEPS
        read = np.floor(now * COUNTS + 0.5) / COUNTS
        duty = min(max(gain * (goal[row] - read), -1.0), 1.0) * enabled[row]
        state.ctrl[0] = torque * volts[row] * duty
        scene.actuator_biasprm[0, 2] = -back_emf * enabled[row]
        mujoco.mj_step(scene, state, SUBSTEPS)
    return angle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=len(STARTS))
    parser.add_argument("--evaluations", type=int, default=40)
    parser.add_argument("--with-frictionloss", action="store_true")
    parser.add_argument("--simplex", type=int, default=400, help="evaluations")
    given = parser.parse_args()
    every = [
        read_log(path, measured.XL330, gear_ratio=1.0, repair="velocity_from_position")
        for path in sorted((measured.data_folder() / "xl330_pendulum").glob("*.json"))
    ]
    held_out = [log for log in every if log.name.endswith(HELD_OUT)]
    logs = [log for log in every if not log.name.endswith(HELD_OUT)]
    scene = mujoco.MjModel.from_xml_string(XML)
    count = len(NAMES) if given.with_frictionloss else len(NAMES) - 1

    def missed(point: Array, runs: list[Log] = logs) -> Array:
        joint = np.append(np.exp(point), [0.0] * (len(NAMES) - count))
        rest = np.concatenate([driven(scene, log, joint) - log["output_position"] for log in runs])
        return np.clip(np.nan_to_num(rest, nan=FARTHEST), -FARTHEST, FARTHEST)

    def rmse(point: Array, runs: list[Log]) -> float:
        return float(1e3 * np.sqrt(np.mean(missed(point, runs) ** 2)))

    def tell(point: Array, by: str) -> None:
        said = ", ".join(f"{n} {v:.4g}" for n, v in zip(NAMES, np.exp(point), strict=False))
        print(f"{rmse(point, logs):.2f} mrad on the twelve, {by}: {said}", flush=True)

    found_points = []
    for number, bristle in enumerate(STARTS[: given.starts]):
        start = np.log((*FIRST, *bristle, 0.2 * LEVEL)[:count])
        if given.with_frictionloss:
            start[6] = np.log(0.8 * bristle[2])
        found = least_squares(
            missed,
            start,
            bounds=(LEAST[:count], MOST[:count]),
            diff_step=1e-3,
            x_scale=0.3,
            max_nfev=given.evaluations,
        )
        tell(found.x, f"start {number + 1}")
        found_points.append(found.x)
    best = min(found_points, key=lambda point: rmse(point, logs))
    corners = np.vstack([best, best + SIDE * np.eye(count)])
    options = {"maxfev": given.simplex, "xatol": 1e-3, "fatol": 1e-3, "initial_simplex": corners}
    polished = minimize(
        lambda point: rmse(point, logs), best, method="Nelder-Mead", options=options
    )
    best = polished.x
    tell(best, "simplex")
    by_log = ", ".join(f"{rmse(best, [log]):.1f}" for log in held_out)
    print(f"best: {rmse(best, held_out):.1f} mrad on the four held out ({by_log})")
    print("  " + ", ".join(f"{v:.6g}" for v in np.exp(best)))


if __name__ == "__main__":
    main()
