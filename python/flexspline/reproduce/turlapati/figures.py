"""Figures 2, 3 and 5 of the second paper, and the tables that it does not print."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexspline import _core
from flexspline.effects import effect
from flexspline.plot.canvas import GREY, PALETTE, PlainFigure, axes_or_new, legend, titled
from flexspline.reproduce.run import Story
from flexspline.reproduce.turlapati.lowpass_bias import amplitude_left
from flexspline.reproduce.turlapati.study import TRIALS, WIDTH, Study, filtered, rms
from flexspline.rigs.turlapati import turlapati_rig
from flexspline.signals import gear_of

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

__all__ = ["story"]

BLUE, ORANGE, GREEN, RED = PALETTE[:4]

CAPTIONS = {
    "fig2": "Basis functions of (7)–(13): the two sigmoids add up to one at every speed, as the "
    "offset's column does, so the design matrix of (16) has no full rank. At v = 0 (9) gives the "
    'mean of both levels, (8) zero. α is not printed ("chosen heuristically"): 200 s/rad here; a '
    "fit without fixed= estimates it.",
    "fig3": "(a) reading without load, 1 Hz; (b) over the joint angle, once forward and once "
    "backward; (c) components, friction with the offset because only their sum is known; (d) "
    "residual of a run that the fit never saw. The number n of harmonics is not printed: 8 here.",
    "fig5": "Reading on the bearing before and after compensation beside the load cell: (a) one "
    "trial, (b) error of three trials.",
    "components": "What is known of each component; single levels of (16) are not. Its vector of "
    "weights lists w_o twice, no w_s, and w_c for both Coulomb and cosine; the bases called "
    '"radial" are not.',
    "bearing": "RMS error over RMS load-cell torque, and Nm, of each trial. Ours falls to a few "
    "percent, theirs to 11: their rig held something more that (16) does not explain and this one "
    "lacks (load cell, clamping, another day). So the claim says no more than 'not worse'.",
    "lowpass": "Amplitude found over the true one at 0.5 rad/s. A filter on the target alone "
    "(§3.1) biases ripple; rows that pass the same filter do not.",
}


def story(seed: int) -> Story:
    """Return figures and tables of one rig."""
    study = Study(turlapati_rig(seed))
    return Story(
        {"fig2": _basis(), "fig3": _no_load(study), "fig5": _bearing(study)},
        {
            "components": _components_table(study),
            "bearing": _bearing_table(study),
            "lowpass": _lowpass_table(),
        },
        CAPTIONS,
    )


def _panels(rows: int, columns: int, titles: list[str]) -> tuple[PlainFigure, list[Axes]]:
    figure = PlainFigure(5.2 * columns, 3.3 * rows)
    panels = [axes_or_new(figure.add_subplot(rows, columns, k + 1)) for k in range(len(titles))]
    for ax, title in zip(panels, titles, strict=True):
        titled(ax, title)
    return figure, panels


def _basis() -> PlainFigure:
    figure, (a, b, c, d) = _panels(
        2, 2, ["a  Coulomb, (9)", "b  viscous, (10)", "c  inertia, (11)", "d  ripple, (12)"]
    )
    speed = np.linspace(-0.1, 0.1, 400)
    levels = effect("coulomb_friction_per_direction", direction_width=WIDTH)
    basis = _core.Design([levels.for_core()], **gear_of({}, False))
    forward, backward = np.asarray(
        basis.rows({"output_velocity": speed}, len(speed), np.empty(0))
    ).T
    a.plot(speed, forward, color=GREEN, label="φ_c⁺")
    a.plot(speed, backward, color=RED, label="φ_c⁻")
    a.plot(speed, forward + backward, color=GREY, ls="--", label="their sum, and φ_o")
    legend(a)
    b.plot(speed, speed, color=BLUE)
    acceleration = np.linspace(-2.0, 2.0, 50)
    c.plot(acceleration, acceleration, color=BLUE)
    angle = np.linspace(0.0, 2 * np.pi, 400)
    for order, colour in zip((1, 2, 3), PALETTE, strict=False):
        d.plot(angle, np.cos(order * angle), color=colour, label=f"cos({order} θ)")
    legend(d)
    for ax, x, y in zip(
        (a, b, c, d),
        ("output velocity [rad/s]", "output velocity [rad/s]", "acceleration [rad/s²]", "θ [rad]"),
        ("φ_c [1]", "φ_v [rad/s]", "φ_i [rad/s²]", "φ_cos [1]"),
        strict=True,
    ):
        ax.set_xlabel(x)
        ax.set_ylabel(y)
    return figure


def _no_load(study: Study) -> PlainFigure:
    figure, (a, b, c, d) = _panels(
        2,
        2,
        [
            "a  reading without load, 1 Hz",
            "b  over the joint angle",
            "c  components",
            "d  residual, a run never seen",
        ],
    )
    log = study.no_load[-1]
    reading, time = filtered(log, log["sensor_torque"]), log["time"]
    forward = log["output_velocity"] > 0
    a.plot(time, reading, ".", ms=1.2, color=BLUE)
    for moving, colour, name in ((forward, GREEN, "forward"), (~forward, RED, "backward")):
        angle = np.mod(log["output_position"][moving], 2 * np.pi)
        b.plot(angle, reading[moving], ".", ms=1.2, color=colour, label=name)
    legend(b)
    parts = study.components(log)
    friction = parts["viscous_friction"] + parts["coulomb_friction_per_direction"]
    for values, name, colour in (
        (friction + parts["offset"], "friction + offset", BLUE),
        (parts["output_ripple"], "ripple", ORANGE),
        (parts["inertia"], "inertia", GREEN),
    ):
        c.plot(time, values, ".", ms=1.2, color=colour, label=name)
    legend(c)
    held = study.held_out
    residual = filtered(held, held["sensor_torque"]) - study.intrinsic(held)
    d.plot(held["time"], residual, ".", ms=1.2, color=BLUE)
    d.axhline(0.0, color=GREY, lw=0.8)
    d.set_ylim(-0.3, 0.3)
    for ax in (a, c, d):
        ax.set_xlabel("time [s]")
    b.set_xlabel("joint angle [rad]")
    for ax in (a, b, c, d):
        ax.set_ylabel("torque [Nm]")
    return figure


def _bearing(study: Study) -> PlainFigure:
    figure, (a, b) = _panels(1, 2, ["a  one trial", "b  error of three trials"])
    log = study.trials[0]
    before, after, cell = study.errors(log)
    for values, name, colour in (
        (cell + before, "sensor", ORANGE),
        (cell + after, "compensated", BLUE),
        (cell, "load cell", GREEN),
    ):
        a.plot(log["time"], values, ".", ms=1.5, color=colour, label=name)
    legend(a)
    for trial, run in zip(TRIALS, study.trials, strict=True):
        before, after, _ = study.errors(run)
        first = trial == TRIALS[0]
        b.plot(run["output_velocity"], before, ".", ms=1, color=ORANGE, label="before" * first)
        b.plot(run["output_velocity"], after, ".", ms=1, color=BLUE, label="after" * first)
    b.axhline(0.0, color=GREY, lw=0.8)
    legend(b)
    a.set_xlabel("time [s]")
    a.set_ylabel("torque [Nm]")
    b.set_xlabel("output velocity [rad/s]")
    b.set_ylabel("error against the load cell [Nm]")
    return figure


def _components_table(study: Study) -> pandas.DataFrame:
    import pandas

    known = {
        str(combination): (combination.value, combination.standard_error, combination.unit)
        for group in study.fit.confounded
        for combination in group.known
    }
    single = {
        p.name: (p.value, p.standard_error, p.unit)
        for p in study.fit.parameters
        if p.determined and p.state == "fitted"
    }
    return pandas.DataFrame.from_dict(
        {**known, **single}, orient="index", columns=["value", "standard error", "unit"]
    )


def _bearing_table(study: Study) -> pandas.DataFrame:
    import pandas

    rows = {}
    for trial, log in zip(TRIALS, study.trials, strict=True):
        before, after, cell = study.errors(log)
        rows[f"trial {trial}"] = {
            "before [%]": 100 * rms(before) / rms(cell),
            "after [%]": 100 * rms(after) / rms(cell),
            "before [Nm]": rms(before),
            "after [Nm]": rms(after),
            "largest before [Nm]": float(np.abs(before).max()),
            "largest after [Nm]": float(np.abs(after).max()),
        }
    rejected = study.rejected()
    rows["good bearings rejected"] = {
        "before [%]": 100 * rejected[0],
        "after [%]": 100 * rejected[1],
    }
    rows["published"] = {"before [%]": 27.0, "after [%]": 11.0, "largest before [Nm]": 0.7}
    return pandas.DataFrame.from_dict(rows, orient="index")


def _lowpass_table() -> pandas.DataFrame:
    import pandas

    rows = {
        f"order {order}": {
            "first-order filter passes": left.theory,
            "target filtered alone": left.target_only,
            "rows filtered alike": left.rows_alike,
        }
        for order, left in ((order, amplitude_left(order)) for order in (8, 20))
    }
    return pandas.DataFrame.from_dict(rows, orient="index")
