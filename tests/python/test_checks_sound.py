"""Sound logs must pass: no error, no fault; and a long one in bearable time."""

from __future__ import annotations

import numpy as np
import pytest
from checks_logs import sound_log

from flexspline.logs import Log
from flexspline.logs.checks import check


@pytest.mark.parametrize("seed", range(50))
def test_a_sound_log_has_neither_error_nor_fault(seed: int) -> None:
    findings = check(sound_log(seed))
    assert not findings.errors and not findings.faults, str(findings)


def test_a_noise_free_log_at_one_speed_has_neither_error_nor_fault() -> None:
    time = np.arange(5000) / 1000
    torque = 3.0 + 0.2 * np.sin(200 * 0.5 * time)
    log = Log.from_arrays(
        time=time,
        output_position=0.5 * time,
        output_velocity=np.full(5000, 0.5) + 1e-9 * np.sin(time),
        motor_torque=torque,
    )
    findings = check(log)
    assert not findings.errors and not findings.faults, str(findings)


def test_a_sound_log_of_a_million_rows_has_no_findings_either() -> None:
    time = np.arange(1_000_000) / 1000
    q = np.sin(time)
    rng = np.random.default_rng(0)
    log = Log.from_arrays(
        time=time,
        output_position=q,
        output_velocity=np.cos(time),
        sensor_torque=q + 0.01 * rng.standard_normal(len(time)),
    )
    findings = check(log)
    assert not findings.errors and not findings.faults, str(findings)
