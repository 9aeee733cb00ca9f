"""The first paper's figures and tables from one rig, and where its text errs."""

from __future__ import annotations

from flexspline.reproduce.run import Story
from flexspline.reproduce.zhang.arm import Arm
from flexspline.reproduce.zhang.arm_figures import collisions, gains
from flexspline.reproduce.zhang.drift_methods import drift_methods
from flexspline.reproduce.zhang.methods import ripple_methods
from flexspline.reproduce.zhang.sensor_figures import (
    compensated,
    drift_curve,
    heating,
    line,
    phase,
    placement,
    ripple_over_time,
    ripple_spectrum,
)
from flexspline.reproduce.zhang.study import Study
from flexspline.reproduce.zhang.tables import free_motion, table1, table2, table3
from flexspline.rigs.zhang import zhang_rig

__all__ = ["story"]

CAPTIONS = {
    "fig7": 'The text\'s "phase difference of π/2" stands against π in its own (3): π cancels, '
    "π/2 leaves √2. π/2 is the angle between the spokes, which order 2 makes π. (1) has the same "
    "ε_w in both gauges, by which the sinusoid of (2) would vanish: what (2) needs is bending, of "
    "opposite sign on both flanks of a spoke.",
    "fig14": "Two seconds of 20: the common placement waves, the cancelling one is at the step of "
    "the converter, 0.076 mV.",
    "fig15": "Peaks once and twice per turn of the wave generator against the flexspline, where "
    "the gauges sit: 35.16 °/s · 101/360 = 9.86 Hz. 101 is inferred from N = 100, which is not "
    "printed; the printed 9.89 and 19.76 Hz imply 101.26 and 101.16. Gone with eight gauges. "
    "The text derives the second order only; R1 to R4 at 0° and 90° leave 0.71 of the first. What "
    "stays is order 4, at 39.5 Hz.",
    "fig16": "Our b(T) with its 95 % band on (24). (24) is a voltage, that of (11); b of (9) is a "
    "torque. It falls to a minimum at 42.7 °C.",
    "fig17": "A warming that the fit never saw. (24) falls by 0.33 Nm, where the text says that "
    "the reading rises by up to 0.38 Nm: the sign does not follow from (24).",
    "fig18": "Left the protocol as printed: 2 °/s one way, called dynamic although the speed is "
    'constant. −2.1835/62.738 V = −34.8 mV is the zero of the line, not a "temperature drift". '
    "Right: only with the way back does hysteresis show.",
    "fig20": "(a) What the threshold has to stay above; the level is order 4 in a zero that was "
    "set at rest, see free_motion. (b) The residual passes it in the first samples after the "
    "touch. (c) Force with and without the stop. The egg's strength is not printed.",
    "placement": "How exactly must gauges be bonded? Placement errors bring orders 1 and 2 back in "
    "proportion; order 4 stays whatever the care.",
    "heating": "The bridge cancels what its gauges have in common, software what one temperature "
    "tells: heated unevenly, both together leave least.",
    "gain": "K_O = 100 1/s at 100 Hz makes forward Euler dead-beat: all noise of the newest torque "
    "passes. At K·dt = 2 it rings for ever. The exact form has no such limit.",
    "table1": "As printed: inputs of their finite elements, which nothing here can reproduce. The "
    'text\'s largest "strain of 0.003 mm" has no meaning: a strain has no unit.',
    "table2": "The printed parameters, and our fit of (23) to swings without contact on this rig, "
    "whose truth is known.",
    "table3": "The figures are what the simulated sensor was given; that they come back says that "
    "they are read correctly. One way there is no hysteresis to read. Percent of 70 Nm is our "
    "reading.",
    "ripple_methods": "Ripple left of the common placement's, delay and cost, in motion and at "
    "standstill [Nm, s]. Order tracking sees no torque at standstill and is late in motion. Filter "
    "and regression hold at standstill what they learnt in motion, and take off order 4, which "
    "placement leaves; placement needs neither angle nor learning.",
    "drift_methods": "What each model of the drift leaves of a warming that it never saw (refs. 16 "
    "and 17 beside the paper's), all from the same runs of brake and oven. A line misses the bend "
    "of (24); a kernel has no law between the levels of the oven, and none beyond them.",
    "free_motion": "Order 4, which no placement at quarter turns cancels, and a zero set on top of "
    "it make most of what the observer reads without contact. The printed bound says that theirs "
    "was small; a fit of the ripple takes most of it off. (23) has neither ripple nor friction "
    "beyond the sensor.",
}


def story(seed: int) -> Story:
    """Return figures and tables of one rig."""
    study = Study(zhang_rig(seed))
    arm = Arm(study.rig, study.model)
    figures = {
        "fig7": phase(),
        "fig14": ripple_over_time(study),
        "fig15": ripple_spectrum(study),
        "fig16": drift_curve(study),
        "fig17": compensated(study),
        "fig18": line(study),
        "fig20": collisions(arm),
        "placement": placement(),
        "heating": heating(),
        "gain": gains(arm),
    }
    tables = {
        "table1": table1(),
        "table2": table2(arm),
        "table3": table3(study),
        "ripple_methods": ripple_methods(study.rig).to_frame(),
        "drift_methods": drift_methods(study),
        "free_motion": free_motion(arm),
    }
    return Story(figures, tables, CAPTIONS)
