"""What `train` refuses, and what it says of a reference that goes the wrong way."""

from __future__ import annotations

from typing import Any

import full_range_logs as rigs
import numpy as np
import pytest
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.full_range import train
from flexspline.logs.log import Log

Array = NDArray[np.float64]


def changed(**channels: Array) -> Log:
    return rigs.rig(0).log.with_columns(channels, note="changed by the test")


def refused(logs: Any, said: str, model: Any = None, **options: Any) -> None:
    with pytest.raises(InputError, match=said):
        train(model or rigs.model(), logs, **{"methods": (), **options})


@pytest.mark.parametrize(
    "channel",
    ["output_position", "output_velocity", "motor_position", "motor_velocity", "motor_torque"],
)
def test_a_row_without_a_number_is_named_before_anything_is_trained(channel: str) -> None:
    values = np.array(rigs.rig(0).log[channel])
    values[[4, 9]] = np.nan, np.inf
    said = rf"'hand 0': {channel} is not finite in 2 rows, first in row 4; .* drop_invalid"
    refused(changed(**{channel: values}), said)


def test_a_wrapped_angle_is_refused_with_its_repair() -> None:
    angle = rigs.rig(0).log["output_position"]
    wrapped = np.mod(angle - np.median(angle), 2 * np.pi)
    refused(changed(output_position=wrapped), "unwrap=output_position")


def test_a_motor_that_turns_the_other_way_is_refused_with_its_repair() -> None:
    refused(changed(motor_position=-rigs.rig(0).log["motor_position"]), "reverse_motor")


def test_a_ratio_is_held_against_the_model_s_where_the_log_states_none() -> None:
    log = changed(motor_position=0.5 * rigs.rig(0).log["motor_position"])
    said = "bare: motor_position is 0.5 times what motor_velocity .*50.50., stated 101"
    refused(Log(log.columns, {"name": "bare"}), said)


def test_an_angle_that_jumps_is_refused_by_the_torsion_that_it_makes() -> None:
    jumps = np.mod(rigs.rig(0).log["output_position"], 1.0)
    refused(changed(output_position=jumps), r"rows the torsion is past the end.*look for jumps")


def test_a_reference_that_never_leaves_zero_is_refused() -> None:
    nothing = np.zeros(len(rigs.rig(0).log))
    refused(changed(reference_torque=nothing), "reference_torque is 0 Nm in every row")


def test_a_reference_of_the_wrong_sign_is_one_sentence() -> None:
    made = train(
        rigs.model(), changed(reference_torque=-rigs.rig(0).log["reference_torque"]), methods=()
    )
    assert any("reference_torque goes against the compliance" in s for s in made.warnings)
    assert "no better than the observer alone" in " ".join(str(made).split())
    assert "-0 %" not in str(made)
    right = train(rigs.model(), rigs.rig(0).log, methods=())
    assert not any("goes against" in sentence for sentence in right.warnings)
    assert "% less)" in " ".join(str(right).split())


@pytest.mark.parametrize("rows", [0, 19, 25_001, 300.5, True, "many"])
def test_rows_that_no_gaussian_process_can_have_are_refused(rows: Any) -> None:
    refused(rigs.rig(0).log, "gp_rows = .* from 20 to 25000", methods=("gp",), gp_rows=rows)


def test_what_is_no_log_no_model_and_no_part_is_named() -> None:
    log = rigs.rig(0).log
    refused(5, "a log cannot be read from a int; give a path, an array")
    refused([log, "run.csv"], "run.csv: no such file; give the path of a log")
    refused(log, "model is a str; give a model", model="x")
    refused(log, "'1' is a float; give a part", torsion_parts={"1": 15548.0})
