"""The quantities of the first paper's claims, for one draw."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexspline.reproduce.zhang.arm import Arm, dead_beat, low_pass_error
from flexspline.reproduce.zhang.study import Study, peak_between
from flexspline.rigs.zhang import zhang_rig

__all__ = ["draw", "sum_over_one"]


def draw(rng: np.random.Generator) -> Mapping[str, float]:
    """Return the quantities of the paper's claims for one rig."""
    study = Study(zhang_rig(int(rng.integers(2**32))))
    return {
        "zhang.fig7.opposite_phase_cancels": sum_over_one(np.pi),
        "zhang.fig7.quarter_phase_cancels": sum_over_one(np.pi / 2.0),
        **_ripple(study),
        **_drift(study),
        **_calibration(study),
        **_arm(Arm(study.rig, study.model)),
        "zhang.observer.low_pass": low_pass_error(),
        "zhang.euler.dead_beat": dead_beat(),
    }


def sum_over_one(phase: float) -> float:
    """Amplitude of the sum of two signals this electrical phase apart, over that of one."""
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    both = np.sin(angle) + np.sin(angle - phase)
    return float(np.abs(np.fft.rfft(both)[1]) / np.abs(np.fft.rfft(np.sin(angle))[1]))


def _ripple(study: Study) -> dict[str, float]:
    common, _ = study.placements
    once = study.four_gauges.ripple()[1] / study.rig.sensor.common.ripple()[1]
    return {
        "zhang.fig15.peak_once_per_turn": peak_between(common, 8.0, 12.0),
        "zhang.fig15.peak_twice_per_turn": peak_between(common, 17.0, 23.0),
        "zhang.fig15.once_gone": study.amplitude_left(1),
        "zhang.fig15.twice_gone": study.amplitude_left(2),
        "zhang.bridge.two_places_cancel_once": once,
    }


def _drift(study: Study) -> dict[str, float]:
    return {
        "zhang.fig16.polynomial": study.polynomial_off,
        "zhang.fig17.before": float(np.abs(study.before).max()),
        "zhang.fig17.rises": study.risen,
        "zhang.fig17.after": float(np.abs(study.after).max()),
    }


def _calibration(study: Study) -> dict[str, float]:
    sensitivity, zero = (study.loading[name].value for name in ("sensitivity", "zero"))
    one_way = study.loading.figure("hysteresis").percent
    both = study.unloading.figure("hysteresis").percent
    bend = study.loading.figure("non-linearity, least squares").percent
    return {
        "zhang.fig18.sensitivity": 1e-3 * sensitivity,
        "zhang.fig18.zero": -1e3 * zero / sensitivity,
        "zhang.table3.nonlinearity": _known(bend),
        "zhang.table3.hysteresis": _known(both),
        "zhang.table3.hysteresis_one_way": float(one_way is not None),
    }


def _arm(arm: Arm) -> dict[str, float]:
    return {
        "zhang.fig20.no_contact_bound": arm.bound,
        "zhang.fig20.false_alarms": float(arm.false_alarms),
        "zhang.fig20.delay": max(hit.delay for hit in arm.hits),
        "zhang.fig20.stopping_helps": max(hit.stopped.peak / hit.free.peak for hit in arm.hits),
    }


def _known(percent: float | None) -> float:
    return float("nan") if percent is None else percent
