"""What measures figures and pages sees the faults for which it was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from figure_layout import figure_faults, page_faults
from matplotlib.figure import Figure

from flexspline.logs import Log
from flexspline.orders import find_orders
from flexspline.plot.canvas import (
    LEAST,
    PlainFigure,
    axes_or_new,
    legend,
    log_axis,
    short_labels,
    titled,
)
from flexspline.plot.estimate import observer_gain


def test_a_legend_over_data_and_numbers_on_each_other_are_found() -> None:
    figure = Figure(figsize=(3, 2))
    ax = figure.add_subplot()
    ax.plot([1.0, 2.0], label="a line")
    ax.legend()
    ax.set_xticks([0.50, 0.51], ["one half", "more"])
    found = figure_faults(figure)
    assert "a legend is over data" in found
    assert "'one half' lies on 'more'" in found
    assert "'a line' is black" in found


def test_short_names_of_runs_differ_and_keep_their_numbers_whole() -> None:
    speeds = [f"velocity_{speed:.6f}readings" for speed in (0.03, 0.05, 1.3)]
    assert short_labels(speeds) == ["…0.030000", "…0.050000", "…1.300000"]
    assert short_labels([f"joint2_vel_p{k}" for k in (1, 2, 10)]) == ["…p1", "…p2", "…p10"]
    assert short_labels(["at rest", "forward"]) == ["at rest", "forward"]
    assert short_labels(["one name of two", "one name of two"]) == ["1", "2"]


def test_many_labels_and_a_long_title_have_room_whatever_comes_first() -> None:
    figure = PlainFigure(4.5, 3.4)
    ax = axes_or_new(figure.add_subplot())
    for k in range(9):
        ax.plot([0.0, 1.0], [0.0, 10.0**-k], label=f"an effect with a name {k}")
    titled(ax, "A title of so many words that no panel of a report has room for it in one line")
    legend(ax)
    log_axis(ax, "y")
    ax.set(xlabel="time [s]", ylabel="torque [Nm]")
    assert figure_faults(figure) == []
    titled(ax, "Another title, after the legend")
    assert figure_faults(figure) == []


def test_a_title_has_room_beside_long_names_of_rows() -> None:
    ax = axes_or_new(PlainFigure(4.5, 3.4).add_subplot())
    ax.plot([0.0, 1.0], [0.0, 1.0], label="before")
    ax.set_yticks(
        [0.0, 1.0], ["all rows", "within ±0.1 s of a reversal (185 rows)"], fontsize=LEAST
    )
    titled(ax, "By how much the gap shrank, and where")
    legend(ax)
    assert figure_faults(ax.figure) == []


def test_an_axis_within_a_decade_has_numbers_of_one_size_that_lie_apart() -> None:
    for ends in ((0.0021, 0.0064), (1e-5, 0.4), (3.0, 40.0)):
        ax = axes_or_new(None)
        ax.plot(ends, ends)
        for which in ("x", "y"):
            log_axis(ax, which)
        assert figure_faults(ax.figure) == []
        shown = [t for t in ax.get_yticks() if ends[0] <= t <= ends[1]]
        assert len(shown) >= 2


def test_figures_of_orders_and_of_gains_are_readable() -> None:
    time = np.arange(4000) / 100.0
    angle = 6.0 * np.sin(0.5 * time)
    torque = 0.1 * np.cos(7 * angle) + 0.08 * np.cos(8 * angle)
    torque += 0.01 * np.random.default_rng(0).normal(size=len(time))
    log = Log.from_arrays(
        time=time, output_position=angle, output_velocity=3.0 * np.cos(0.5 * time)
    )
    found = find_orders([log], [torque], unit="Nm", channel="sensor_torque")
    assert found.found
    assert figure_faults(found.plot().figure) == []
    assert figure_faults(observer_gain(0.01, torque_noise=0.1).figure) == []


def test_a_page_that_is_cut_small_or_dark_on_dark_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(
        "<style>body{background:#fff}@media (prefers-color-scheme:dark){body{background:#111}}"
        "svg{width:100%}</style>"
        f"<table><tr><td>{'x' * 999}</td></tr></table>"
        '<svg viewBox="0 0 800 100"><text x="9" y="50" font-size="12">one</text>'
        '<text x="12" y="50" font-size="12">two</text>'
        '<text x="795" y="50" font-size="12">three</text></svg>'
    )
    found = page_faults(page)
    for fault in (
        "narrow: the page is wider than the screen",
        "wide: a TABLE does not scroll",
        "narrow: 'one' is 5.8 px high",
        "narrow: 'one' is hardly seen",
        "wide: 'two' lies on 'one'",
        "wide: 'three' leaves its figure",
    ):
        assert fault in found
