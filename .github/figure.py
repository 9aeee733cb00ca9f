"""Draws both figures of README.md, for light and dark, from simulated runs: run this file."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib
import numpy as np

import flexspline
from flexspline import effect
from flexspline.plot.canvas import (
    GREY,
    INK,
    PALETTE,
    PlainFigure,
    axes_or_new,
    legend,
    log_axis,
    titled,
)
from flexspline.rigs.sensor import SPEEDS, sensor_rig

TODAY = [
    "offset",
    "coulomb_friction",
    "viscous_friction",
    "inertia",
    effect("output_ripple", orders=[1, 2]),
    effect("wave_generator_ripple", orders=[2]),
    "temperature_drift",
]
LIGHT = "#e7e9ec"  # of text in the dark, as reports have it

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

figure = PlainFigure(9.0, 3.4)
torque, error = (axes_or_new(ax) for ax in figure.subplots(1, 2, width_ratios=(3, 2)))
shown = slice(0, None, 12)
torque.plot(
    unseen["time"][shown],
    unseen["sensor_torque"][shown],
    color=GREY,
    lw=2.5,
    label="measured (simulated rig)",
)
for color, (label, fit) in zip((PALETTE[1], PALETTE[0]), fits.items(), strict=True):
    made = fit.predict(unseen)
    torque.plot(unseen["time"][shown], made.predicted[shown], color=color, lw=0.9, label=label)
    rms = [np.sqrt(np.mean(made.residual[rows] ** 2)) for rows in near]
    error.plot(SPEEDS, rms, color=color, marker="o", ms=4)
error.axhline(rig.truth.noise, color=INK, lw=0.8, ls=":", label="noise of the sensor")
torque.set(xlabel="time [s]", ylabel="torque at the output [Nm]")
error.set(xlabel="speed of the output [rad/s]", ylabel="error, RMS [Nm]")
log_axis(error, "x")
error.set_ylim(0.0, 0.11)
titled(torque, "A run that neither fit saw")
titled(error, "Where each is wrong")
for ax in (torque, error):
    legend(ax)

drawn = io.StringIO()
with matplotlib.rc_context({"svg.hashsalt": "flexspline", "svg.fonttype": "none"}):
    figure.savefig(drawn, format="svg", transparent=True, metadata={"Date": None})
for name, ink in (("figure.svg", INK), ("figure_dark.svg", LIGHT)):
    text = drawn.getvalue().replace(INK, ink)
    Path(__file__).with_name(name).write_text(text, encoding="utf-8")
