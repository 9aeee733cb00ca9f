"""An axis of orders is drawn whatever is on it."""

from __future__ import annotations

import io

import pytest
from matplotlib.figure import Figure

from flexspline.plot.canvas import log_axis


@pytest.mark.parametrize(("orders", "scale"), [([], "linear"), ([0.0], "linear"), ([2.0], "log")])
def test_orders_that_are_not_there_end_no_figure(orders: list[float], scale: str) -> None:
    """Of runs of which few rows count no order is drawn; the report had ended as a defect."""
    figure = Figure()
    ax = figure.subplots()
    ax.plot(orders, [1.0] * len(orders), "v")
    log_axis(ax, "x")
    assert ax.get_xscale() == scale
    figure.savefig(io.BytesIO())
