"""Figures 7, 8 and 9: what they show, with units."""

from __future__ import annotations

import re
from functools import cache

import full_range_logs as rigs
import numpy as np
from matplotlib.figure import Figure

from flexspline.full_range import FullRange, train

UNIT = re.compile(r"\[[^\]]+\]$")


@cache
def trained() -> FullRange:
    logs = [rigs.rig(seed).log for seed in (0, 1)]
    return train(rigs.model(), logs, methods=())


def test_figure_7_has_the_transition_its_interval_and_bars() -> None:
    made = trained()
    ax = made.plot_speed(Figure().add_subplot())
    assert UNIT.search(ax.get_xlabel()) and UNIT.search(ax.get_ylabel())
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels[1:] == ["observer o", "compliance c"]
    assert f"{made.transition.transition_velocity:.3g}" in labels[0]
    (band,) = ax.patches
    low, high = made.transition.velocity_interval
    assert np.isclose(band.get_x(), low) and np.isclose(band.get_x() + band.get_width(), high)
    drawn = [line for line in ax.lines if len(line.get_xdata()) == len(made.curve.speed)]
    np.testing.assert_array_equal(drawn[0].get_ydata(), made.curve.rmse["o"])


def test_the_curve_over_speed_holds_all_rows_and_their_errors() -> None:
    made, rows = trained(), 2 * len(rigs.rig(0).log)
    assert made.curve.rows.sum() == rows
    whole = np.sqrt(made.curve.rows @ made.curve.rmse["o"] ** 2 / rows)
    assert np.isclose(whole, made.training["o"]["full"].rmse)
    assert made.curve.edges[1] == made.settings.motion_speed
    assert "blocks of 5 s" in made.curve.repetitions and np.isfinite(made.curve.spread["o"]).all()


def test_figure_8_shows_four_channels_over_one_time() -> None:
    figure = trained().plot_validation(rigs.rig(2).log)
    assert len(figure.axes) == 4
    assert all(UNIT.search(ax.get_ylabel()) for ax in figure.axes)
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_figure_9_has_the_reference_and_leaves_it_out_where_it_is_unknown() -> None:
    log = rigs.rig(2).log
    ax = trained().plot_torque(log)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["reference", "observer o", "compliance c", "merged m"]
    bare = {name: data for name, data in log.columns.items() if name != "reference_torque"}
    ax = trained().plot_torque(type(log)(bare, log.facts), methods=["m"])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["merged m"]
