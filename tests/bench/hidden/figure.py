"""One figure: the confusion matrix, and how far the confidence can be relied on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from hidden.confusion import confusion
from hidden.shares import brier, reliability
from hidden.trial import Outcome

__all__ = ["drawn"]


def drawn(outcomes: Sequence[Outcome], path: Path) -> None:
    """Write the figure."""
    table = confusion(outcomes)
    height = 3.0 + 0.27 * len(table)
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(19.0, height), width_ratios=(3.2, 1), layout="constrained"
    )
    _matrix(left, table)
    _curve(right, outcomes)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _matrix(axes: Axes, table: pd.DataFrame) -> None:
    counts = table.to_numpy()
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for row, column in np.argwhere(counts):
        colour = "white" if shares[row, column] > 0.55 else "black"
        axes.text(column, row, counts[row, column], ha="center", va="center", color=colour,
                  fontsize=8)  # fmt: skip
    axes.set_xticks(range(table.shape[1]), _words(table.columns), rotation=60, ha="right")
    axes.set_yticks(range(table.shape[0]), _words(table.index))
    axes.set_xlabel("named")
    axes.set_ylabel("hidden")
    axes.set_title("Names given, by what is hidden (counts; shade: share of the row)")


def _words(names: Iterable[str]) -> list[str]:
    return [str(name).replace("_", " ") for name in names]


def _curve(axes: Axes, outcomes: Sequence[Outcome]) -> None:
    bins = reliability(outcomes)
    said = [one.mean for one in bins]
    right = np.array([one.right.value for one in bins])
    low = right - [one.right.low for one in bins]
    high = [one.right.high for one in bins] - right
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1, label="as said")
    axes.errorbar(said, right, yerr=[np.maximum(low, 0), np.maximum(high, 0)], fmt="o", capsize=3,
                  label="names, 95 % intervals")  # fmt: skip
    for one in bins:
        axes.annotate(f"{one.right.of}", (one.mean, one.right.value), xytext=(6, -10),
                      textcoords="offset points", fontsize=8)  # fmt: skip
    axes.set(xlim=(0, 1.02), ylim=(0, 1.02), xlabel="confidence said", ylabel="share right",
             title=f"Reliability (Brier {brier(outcomes):.3f})")  # fmt: skip
    axes.set_aspect("equal")
    axes.legend(loc="lower right")
