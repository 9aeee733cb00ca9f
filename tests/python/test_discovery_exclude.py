"""What the user knows not to be there is no candidate."""

from __future__ import annotations

import pytest
from hidden_logs import LOAD, friction_of, log_of, rich_run

from flexspline.discovery.search import SearchContext, search_context_of
from flexspline.effects import effect
from flexspline.errors import InputError

BASE = [effect(n) for n in ("offset", "coulomb_friction", "viscous_friction", "inertia")]


def studied(*exclude: str) -> SearchContext:
    c = rich_run(1, 600)
    logs = [log_of(c, sensor_torque=c[LOAD] + friction_of(c))]
    return search_context_of(
        BASE, logs, "sensor_torque", known_load=LOAD, lowpass_hz=None, threads=1, exclude=exclude
    )


def names(context: SearchContext) -> set[str]:
    return {c.name for c in context.candidates(BASE)}


def test_an_excluded_effect_is_no_candidate_and_the_others_are() -> None:
    free, without = studied(), studied("gravity", "sensor_lag")
    assert {"gravity", "sensor_lag"} <= names(free)
    assert names(without) == names(free) - {"gravity", "sensor_lag"}
    assert without.not_tried["gravity"] == "excluded by the caller"


def test_excluding_what_is_in_the_model_or_is_no_effect_is_refused() -> None:
    with pytest.raises(InputError, match="'inertia' is excluded and in the model"):
        studied("inertia")
    with pytest.raises(InputError, match="there is no effect 'gravitiy'"):
        studied("gravitiy")
