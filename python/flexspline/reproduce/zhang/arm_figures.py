"""Figure 20 of the first paper, and what the observer's gain costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from flexspline import _core
from flexspline.observer import observer_delay, observer_noise
from flexspline.plot.canvas import GREY, INK, PALETTE, PlainFigure, legend, titled
from flexspline.reproduce.zhang.arm import GAIN, THRESHOLD, Arm, Hit
from flexspline.reproduce.zhang.sensor_figures import panels
from flexspline.rigs.zhang import RATE

__all__ = ["collisions", "gains"]

BLUE, ORANGE, GREEN, RED = PALETTE[:4]
GAINS = (10.0, 20.0, 50.0, 100.0, 150.0, 190.0)  # 1/s
AROUND = (-0.1, 0.2)  # s about the touch


def collisions(arm: Arm) -> PlainFigure:
    """Figure 20: the residual without contact, at a collision, and the force of the contact."""
    figure, (a, b, c) = panels(3, 5.0)
    time = arm.swings["time"]
    a.plot(time, 1e3 * arm.free_residual, color=BLUE, linewidth=0.6)
    for bound, style, name in ((THRESHOLD, "-", "threshold 0.03"), (0.0255, ":", "printed bound")):
        a.axhline(1e3 * bound, color=RED, linestyle=style, linewidth=1.0, label=f"{name} Nm")
        a.axhline(-1e3 * bound, color=RED, linestyle=style, linewidth=1.0)
    low, high = a.get_ylim()
    a.set(xlabel="time [s]", ylabel="external torque [mNm]", ylim=(low, high + 0.3 * (high - low)))
    titled(a, "a  two minutes without contact")
    legend(a)
    for hit, colour in zip(arm.hits, (BLUE, ORANGE, GREEN), strict=True):
        _near(b, hit, hit.residual, hit.free.log["time"], colour, f"{hit.speed:+.0f} °/s")
        b.axvline(1e3 * hit.delay, color=colour, linestyle="--", linewidth=0.9)
        _force(c, hit, colour)
    b.set_yscale("symlog", linthresh=0.1)
    b.axhline(THRESHOLD, color=RED, linewidth=1.0)
    b.axhline(-THRESHOLD, color=RED, linewidth=1.0)
    b.set(xlabel="time since the touch [ms]", ylabel="external torque [Nm]")
    titled(b, "b  collisions; dashed: the flag")
    legend(b)
    c.set(xlabel="time since the touch [ms]", ylabel="|torque on the obstacle| [Nm]")
    titled(c, "c  contact with the stop (full) and without (dotted)")
    legend(c)
    return figure


def _near(
    ax: Axes, hit: Hit, values: np.ndarray, time: np.ndarray, colour: str, label: str
) -> None:
    since = time - hit.free.touched
    near = (since > AROUND[0]) & (since < AROUND[1])
    ax.plot(1e3 * since[near], values[near], ".-", markersize=3, color=colour, label=label)


def _force(ax: Axes, hit: Hit, colour: str) -> None:
    for run, style, label in (
        (hit.stopped, "-", f"{hit.speed:+.0f} °/s, {hit.stopped.peak:.1f} Nm"),
        (hit.free, ":", f"no stop, {hit.free.peak:.0f} Nm"),
    ):
        since = run.trajectory.time - hit.free.touched
        near = (since > AROUND[0]) & (since < AROUND[1])
        torque = np.abs(run.trajectory["contact_torque"][near])
        ax.plot(1e3 * since[near], torque, style, color=colour, label=label)


def gains(arm: Arm) -> PlainFigure:
    """Ours: delay and noise over the gain, exact and Euler, and the step responses."""
    figure, (a, b, c) = panels(3, 5.0)
    gain = np.geomspace(5.0, 199.0, 200)
    for kind, colour in (("exact", BLUE), ("euler", ORANGE)):
        a.plot(gain, 1e3 * observer_delay(gain, 1.0 / RATE, kind), color=colour, label=kind)
        noise = observer_noise(gain, 1.0 / RATE, kind, torque_noise=1.0)
        b.plot(gain, noise, color=colour, label=f"{kind}, white torque noise")
        c.plot(*_step(100.0, kind == "exact"), "o-", color=colour, label=f"{kind}, K = 100 1/s")
    c.plot(*_step(190.0, False), ".-", color=RED, label="euler, K = 190 1/s", linewidth=0.9)
    found = [_spread(replace(arm, gain=k)) for k in GAINS]
    b.plot(GAINS, np.array(found) / found[GAINS.index(GAIN)] * float(
        observer_noise(GAIN, 1.0 / RATE, "exact", torque_noise=1.0)),
        "s", color=GREEN, label="exact on the rig's swings, scaled at 100 1/s")  # fmt: skip
    for ax in (a, b):
        ax.axvline(GAIN, color=GREY, linestyle="--", linewidth=0.9)
        ax.set_xscale("log")
        ax.set_xlabel("gain K [1/s]")
    a.set_ylabel("delay [ms]")
    b.set_ylabel("noise of the estimate [of the torque's]")
    b.set_ylim(0.0, 3.0)
    c.axhline(1.0, color=INK, linewidth=0.8)
    c.set(xlabel="time since a step of torque [ms]", ylabel="estimate [of the step]")
    titled(a, "a  delay at 100 Hz; dashed: printed gain")
    titled(b, "b  noise; Euler's is that of the torque at K·dt = 1")
    titled(c, "c  step: Euler is dead-beat at 100, rings at 190")
    for ax in (a, b, c):
        legend(ax)
    return figure


def _step(gain: float, exact: bool) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(16) / RATE
    return 1e3 * time, _core.observe_momentum(
        time, -time, np.zeros_like(time), gain=gain, exact=exact
    )


def _spread(arm: Arm) -> float:
    """Standard deviation of the residual without contact, Nm."""
    return float(np.nanstd(arm.free_residual))
