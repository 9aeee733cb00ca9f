"""Draws figure.svg of README.md from simulated runs: python .github/figure.py"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

import flexspline
from flexspline import effect
from flexspline.rigs.sensor import SPEEDS, sensor_rig

matplotlib.rcParams.update({"svg.hashsalt": "flexspline", "svg.fonttype": "none", "font.size": 9})
TODAY = [
    "offset",
    "coulomb_friction",
    "viscous_friction",
    "inertia",
    effect("output_ripple", orders=[1, 2]),
    effect("wave_generator_ripple", orders=[2]),
    "temperature_drift",
]

rig = sensor_rig(5, rate=250.0, seed=1)
*training, unseen = rig.logs
fits = {
    "today's model": flexspline.fit(TODAY, training, "sensor_torque"),
    "with the Stribeck friction that it lacked": flexspline.fit(
        [*TODAY, "stribeck_friction"], training, "sensor_torque"
    ),
}
speed = np.abs(unseen["output_velocity"])
near = [np.abs(speed / nominal - 1.0) < 0.2 for nominal in SPEEDS]

figure, (torque, error) = plt.subplots(
    1, 2, figsize=(9, 3), layout="constrained", width_ratios=(3, 2)
)
shown = slice(0, None, 12)
torque.plot(
    unseen["time"][shown],
    unseen["sensor_torque"][shown],
    color="0.65",
    lw=2.5,
    label="measured (simulated rig)",
)
for color, (label, fit) in zip(("tab:orange", "tab:blue"), fits.items(), strict=True):
    made = fit.predict(unseen)
    torque.plot(unseen["time"][shown], made.predicted[shown], color=color, lw=0.9, label=label)
    rms = [np.sqrt(np.mean(made.residual[rows] ** 2)) for rows in near]
    error.plot(SPEEDS, rms, color=color, marker="o", ms=4, label=label)
error.axhline(rig.truth.noise, color="0.4", lw=0.8, ls=":", label="noise of the sensor")
torque.set(
    xlabel="time [s]",
    ylabel="torque at the output [Nm]",
    title="A run that neither fit saw",
)
error.set(
    xlabel="speed of the output [rad/s]",
    ylabel="error, RMS [Nm]",
    title="Where each is wrong",
    xscale="log",
    ylim=(0.0, 0.11),
)
torque.legend(fontsize=7.5, loc="lower left")
error.legend(fontsize=7.5)
figure.savefig(Path(__file__).with_name("figure.svg"), metadata={"Date": None})
