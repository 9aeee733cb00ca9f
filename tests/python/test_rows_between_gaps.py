"""A row or two alone between gaps have no velocity or acceleration: they do not count."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_logs import LOAD, friction_of, noise, rich_run

import flexspline as fx
from flexspline.errors import InputError
from flexspline.logs.log import Log


def lonely(rows: int = 2000) -> Log:
    """A run without velocity, in which a row and two rows stand alone between gaps."""
    c = rich_run(3, rows)
    torque = c[LOAD] + friction_of(c) + noise(3, rows)
    left = [*range(500, 506), *range(507, 513), *range(900, 906), *range(908, 914)]
    kept = np.delete(np.arange(rows), left)
    names = ("time", "output_position", LOAD, "temperature")
    some = {name: c[name][kept] for name in names}
    return Log.from_arrays(facts={"gear_ratio": 100.0}, **some, sensor_torque=torque[kept])


def test_rows_alone_between_gaps_do_not_count_where_no_velocity_can_be_derived() -> None:
    log = lonely()
    effects = ["offset", "coulomb_friction", "viscous_friction"]
    made = fx.fit(effects, log, "sensor_torque", known_load=LOAD)
    alone = np.isin(np.round(log["time"], 6), np.round([log["time"][500]], 6))
    assert alone.sum() == 1 and np.isfinite(made.rmse)
    fewer = Log.from_arrays(
        facts=dict(log.facts), **{name: log[name][~alone] for name in log.channels}
    )
    without = fx.fit(effects, fewer, "sensor_torque", known_load=LOAD)
    assert made.part.coefficients == pytest.approx(without.part.coefficients, rel=1e-6)
    bad = log["output_position"].copy()
    bad[500] = np.nan
    wrong = log.with_columns({"output_position": bad}, note="spoiled")
    with pytest.raises(InputError, match="output_position"):
        fx.fit(effects, wrong, "sensor_torque", known_load=LOAD)
