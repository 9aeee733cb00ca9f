"""Figures 7, 8 and 9 of the third paper, and Table I as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from flexspline.plot.canvas import GREY, INK, PALETTE, PlainFigure, axes_or_new, legend, titled
from flexspline.plot.estimate import error_over_speed
from flexspline.reproduce.full_range.captions import CAPTIONS
from flexspline.reproduce.full_range.quantities import PUBLISHED
from flexspline.reproduce.full_range.study import Study
from flexspline.reproduce.full_range.tables import table_1, table_2, table_3
from flexspline.reproduce.run import Story
from flexspline.rigs.full_range import full_range_rig

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from flexspline.full_range import ErrorTable
    from flexspline.logs.log import Log

__all__ = ["story"]

GP_ROWS = 500
RIGS = 3  # in the picture of Table I
SUBSET = slice(0, 10000)  # 20 s of the day of validation, from rest
SLOWEST = 5e-4  # rad/s, of the axis
GROUPS = ("full", "motion", "no motion")
PUBLISHED_TRANSITIONS = {"1": 0.001, "2": 0.45}  # rad/s


def story(seed: int) -> Story:
    """Return figures and tables of one rig, and Table I of a few more."""
    study = Study(full_range_rig(seed), GP_ROWS)
    tables = [study.table, *(Study(full_range_rig(seed + k), 0).table for k in range(1, RIGS))]
    return Story(
        {
            "fig7": _over_speed(study),
            "fig8": cast("PlainFigure", study.trained.plot_validation(_subset(study))),
            "fig9": _torques(study),
            "table1_compared": _compared(tables),
        },
        {"table1": table_1(study), "table2": table_2(study), "table3": table_3(study)},
        CAPTIONS,
    )


def _over_speed(study: Study) -> PlainFigure:
    figure = PlainFigure(11.0, 4.2)
    for place, number in enumerate(PUBLISHED_TRANSITIONS, start=1):
        ax = figure.add_subplot(1, 2, place)
        error_over_speed(
            study.trained.curve,
            ax,
            methods=("o", f"c{number}"),
            transition=study.trained.transitions[f"m{number}"],
        )
        printed = PUBLISHED_TRANSITIONS[number]
        ax.axvline(printed, color=PALETTE[3], ls=":", label=f"printed: {printed:g} rad/s")
        ax.set_xlim(left=SLOWEST)
        legend(ax)
    return figure


def _subset(study: Study) -> Log:
    return study.validation.rows(SUBSET, note="20 s")


def _torques(study: Study) -> PlainFigure:
    figure = PlainFigure(10.0, 7.6)
    log = _subset(study)
    for place, number in enumerate(PUBLISHED_TRANSITIONS, start=1):
        ax = figure.add_subplot(2, 1, place)
        methods = ("o", f"c{number}", f"m{number}")
        study.trained.plot_torque(log, ax, methods=methods)
    return figure


def _compared(tables: Sequence[ErrorTable]) -> PlainFigure:
    """RMSE of each method: printed as a bar, ours as a point for each rig."""
    figure = PlainFigure(11.0, 4.4)
    panels = figure.subplots(1, 3, sharey=True)
    ours = [*PUBLISHED, "kalman", "mco"]
    for column, (ax, group) in enumerate(zip(panels, GROUPS, strict=True)):
        axes_or_new(ax)
        titled(ax, group)
        printed = [PUBLISHED[m][column][0] for m in PUBLISHED]
        ax.barh(range(len(printed)), printed, color=GREY, alpha=0.45, label="printed")
        _points(ax, tables, ours, group)
        ax.set_xlabel("RMSE [Nm]")
        ax.set_xlim(left=0.0)
    panels[0].set_yticks(range(len(ours)), ours)
    panels[0].invert_yaxis()
    legend(panels[1])
    return figure


def _points(ax: Axes, tables: Sequence[ErrorTable], methods: Sequence[str], group: str) -> None:
    for number, table in enumerate(tables):
        there = [(k, table[m][group].rmse) for k, m in enumerate(methods) if m in table.methods]
        ax.plot(
            [rmse for _, rmse in there],
            [k for k, _ in there],
            "o" if number == 0 else ".",
            color=PALETTE[0] if number == 0 else INK,
            ms=6 if number == 0 else 5,
            label="ours, the rig of fig. 7 to 9"
            if number == 0
            else "ours, other rigs" * (number == 1),
        )
