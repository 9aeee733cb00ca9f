"""The measured logs of `../shared/data`, each read by a few lines. Not part of the package."""

from __future__ import annotations

import os
from pathlib import Path

from flexspline.logs import ColumnSource, Log, read_log

KINOVA_SPEEDS = (0.03, 0.05, 0.09, 0.1, 0.3, 0.5, 0.7, 0.9, 1.3, 1.5)

XL330: dict[str, str | ColumnSource] = {
    "time": "timestamp",
    "output_position": "position",
    "output_velocity": "speed",
    "duty": ColumnSource("load", bits=16, scale=1 / 885),
    "supply_voltage": "input_volts",
    "commanded_position": "goal_position",
    "temperature": "temp",
    "enabled": "torque_enable",
}


def data_folder() -> Path:
    """Return the folder of the measured logs, which need not exist."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    return Path(os.environ.get("FLEXSPLINE_DATA", beside))


def kinova(speed: float) -> Log:
    """Kinova Gen3, actuator 7 at one of `KINOVA_SPEEDS` [rad/s]; the start is still in it."""
    return read_log(
        data_folder() / "kinova_gen3_joint7" / f"velocity_{speed:.6f}readings.csv",
        {"output_position": 1, "output_velocity": 2, "sensor_torque": 3, "motor_current": 5},
        rate=1000,
        gear_ratio=100,
        pole_pairs=7,
        torque_constant=0.076,
        name=f"{speed} rad/s",
        facts={"joint": "Kinova Gen3 actuator 7"},
        repair="unwrap",
    )


def ur10e(joint: int, run: str | None = None) -> Log:
    """UR10e: joint 1 to 6 in its own run (1, 2, 4), or in `run`, such as "14harm50sec"."""
    found = data_folder().glob(f"ur10e/ur-*{run or f'joint_{joint}'}.csv")
    return read_log(
        next(found),
        {
            "time": 0,
            "output_position": joint,
            "output_velocity": 6 + joint,
            "motor_current": 12 + joint,
        },
        facts={"joint": f"UR10e joint {joint}"},
    )


def iiwa(joint: int, speed: str) -> Log:
    """KUKA iiwa 14: joint 1, 2, 5 or 7 at "1" or "p25" (0.25 rad/s), the torque's sign turned."""
    return read_log(
        data_folder() / "kuka_iiwa14" / f"joint{joint}_vel_{speed}.csv.xz",
        {
            "time": "t_s",
            "output_position": "q_rad",
            "output_velocity": "qd_rad_s",
            "sensor_torque": ColumnSource("tau_Nm", sign=-1),
        },
        facts={"joint": f"iiwa 14 joint {joint}"},
    )


def xl330(run: str) -> Log:
    """Dynamixel XL330 with a pendulum, such as "10h28m17"."""
    return read_log(
        data_folder() / "xl330_pendulum" / f"2026-01-15_{run}.json",
        XL330,
    )


def two_encoder(joint: int) -> Log:
    """Motor and output encoder of joint 1 or 2, without the first 5000 samples."""
    return read_log(
        data_folder() / "two_encoder_joint" / "transmission_data_part1.mat",
        {"time": 0, "motor_position": 2 * joint - 1, "output_position": 2 * joint},
        variable="data_1",
        drop_rows=5000,
        facts={"joint": joint},
    )
