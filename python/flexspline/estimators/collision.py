"""When a torque from outside is a contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

from flexspline.errors import InputError
from flexspline.estimators.checks import (
    above_zero,
    choice,
    from_fields,
    json_record,
    numbers,
    to_fields,
)

__all__ = ["MOST_BANDS", "Collision"]

INPUTS = ("observer", "sensor", "merged", "compliant_observer")
MOST_BANDS = 8


@dataclass(frozen=True)
class Collision:
    """A contact where the external torque leaves a band around zero.

        contact begins   τ > positive[b]  or  τ < −negative[b]
        contact ends     when τ was within release · threshold for the hold time

    b is the band of speed |q̇|. Source: zhang_disturbance_elimination (22), (23): one threshold,
    0.03 Nm; directions, speeds, hysteresis and hold time are the step beyond it.

    Parameters
    ----------
    input : the estimate that is watched: "observer", "sensor", "merged" or "compliant_observer".
    speed_edges : rad/s at the output, increasing, between the bands: one fewer than there are
        thresholds, none for one band.
    negative, positive : Nm, above zero; one threshold per band of speed and direction of torque.
    release : share of the threshold at which a contact may end, above 0 to 1.
    hold : s, how long the torque stays below that before the contact ends.
    record : how the thresholds were found; kept as it is.

    Raises
    ------
    InputError
        Where a threshold is not above zero, or numbers of bands and edges disagree.
    """

    key: ClassVar[str] = "collision"

    input: str
    speed_edges: tuple[float, ...]
    negative: tuple[float, ...]
    positive: tuple[float, ...]
    release: float = 1.0
    hold: float = 0.0
    record: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        choice(self.input, "collision: input", INPUTS)
        edges = self._edges()
        made: dict[str, Any] = {
            "speed_edges": edges,
            "negative": self._thresholds("negative", len(edges) + 1),
            "positive": self._thresholds("positive", len(edges) + 1),
            "release": above_zero(self.release, "collision: release"),
            "hold": above_zero(self.hold, "collision: hold", "s", or_zero=True),
            "record": json_record(self.record, self.key),
        }
        if made["release"] > 1.0:
            raise InputError(
                f"collision: release = {self.release:g} is above the threshold itself; "
                "give a share of at most 1"
            )
        for name, value in made.items():
            object.__setattr__(self, name, value)

    def _edges(self) -> tuple[float, ...]:
        edges = numbers(self.speed_edges, "collision: speed_edges", "rad/s")
        rising = all(low < high for low, high in pairwise(edges))
        if not rising or (edges and edges[0] <= 0.0) or len(edges) >= MOST_BANDS:
            raise InputError(
                f"collision: speed_edges = {list(edges)}; give at most {MOST_BANDS - 1} speeds "
                "above zero, increasing"
            )
        return edges

    def _thresholds(self, name: str, bands: int) -> tuple[float, ...]:
        values = numbers(getattr(self, name), f"collision: {name}", "Nm")
        if len(values) != bands:
            raise InputError(
                f"collision: {len(values)} {name} thresholds for {bands} bands of speed; "
                "give one for each band, one more than speed_edges"
            )
        return tuple(above_zero(value, f"collision: {name}", "Nm") for value in values)

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Collision:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
