"""The channels of a log: name, SI unit and meaning."""

from __future__ import annotations

from typing import Final, NamedTuple

__all__ = ["CHANNELS", "CONDITIONS", "Channel"]


class Channel(NamedTuple):
    """Unit and meaning of one channel of a log."""

    unit: str
    meaning: str


CHANNELS: Final[dict[str, Channel]] = {
    "time": Channel("s", "strictly increasing"),
    "output_position": Channel("rad", "angle of the link side of the gear (q)"),
    "output_velocity": Channel("rad/s", "velocity of the link side"),
    "output_acceleration": Channel("rad/s²", "acceleration of the link side"),
    "motor_position": Channel("rad", "angle of the motor side, the wave generator (θ)"),
    "motor_velocity": Channel("rad/s", "velocity of the motor side"),
    "motor_torque": Channel("Nm", "at the motor shaft, before the gear (τ_m)"),
    "motor_current": Channel("A", "gives motor_torque through a torque constant"),
    "sensor_torque": Channel("Nm", "reading of the joint torque sensor (τ_s)"),
    "sensor_voltage": Channel("V", "bridge output of the torque sensor before calibration"),
    "temperature": Channel("°C", "of the sensor's elastic body, or of the joint"),
    "motor_temperature": Channel("°C", "of the motor"),
    "thermistor_voltage": Channel("V", "ADC voltage of the thermistor's divider"),
    "reference_torque": Channel("Nm", "a trusted torque at the output"),
    "commanded_position": Channel("rad", "output angle that the servo was told"),
    "duty": Channel("–", "duty cycle of the servo's bridge, −1 to 1"),
    "supply_voltage": Channel("V", "of the servo"),
    "enabled": Channel("0/1", "whether the servo's torque is switched on"),
    "simulated_torque": Channel("Nm", "what a foreign simulation says, at the output"),
}

CONDITIONS: Final = (
    "enabled",
    "supply_voltage",
    "temperature",
    "motor_temperature",
    "commanded_position",
)
"""Channels that may well stay constant in a run."""
