"""Bits of the status column: what is to be known of a row's estimates."""

from __future__ import annotations

from enum import IntFlag

__all__ = ["MEANING", "Status"]


class Status(IntFlag):
    """Bits of the column `status`; 0 is a row in which every stage of the model did its work.

    A bit that begins with NO stands for a stage whose estimate is empty in this row: a channel
    that it reads is missing, not finite or out of range. Only stages that the model holds
    set one. A bit that ends with FAULT is of a reading that the model's checks took out, or that
    they found beside another one.
    """

    EXTRAPOLATED = 1
    SATURATED = 2
    NO_TEMPERATURE = 4
    NO_SENSOR = 8
    NO_OBSERVER = 16
    NO_COMPLIANCE = 32
    NO_MERGED = 64
    NO_CONTACT = 128
    RESTARTED = 256
    NO_COMPLIANT_OBSERVER = 512
    NO_VELOCITY = 1024
    SENSOR_FAULT = 2048
    MOTOR_FAULT = 4096
    SPEED_FAULT = 8192
    MOTION_FAULT = 16384
    ENCODERS_FAULT = 32768
    TORQUES_FAULT = 65536
    TEMPERATURE_FAULT = 131072


MEANING = {
    Status.EXTRAPOLATED: "voltage or temperature lies outside the range of the calibration",
    Status.SATURATED: "the torsion is at the end of the compliance model: its torque is held there",
    Status.NO_TEMPERATURE: "no temperature",
    Status.NO_SENSOR: "no external torque from the sensor",
    Status.NO_OBSERVER: "no torque from the observer",
    Status.NO_COMPLIANCE: "no torque from the compliance",
    Status.NO_MERGED: "no merged torque",
    Status.NO_CONTACT: "contact is not decided",
    Status.NO_COMPLIANT_OBSERVER: "no torque from the observer of the link",
    Status.NO_VELOCITY: "no velocity from the angle: it is missing, or its filter starts",
    Status.SENSOR_FAULT: "the sensor's voltage or torque is out of its range and was taken out",
    Status.MOTOR_FAULT: "the motor's torque is out of its range and was taken out",
    Status.SPEED_FAULT: "the joint cannot be so fast: angle or velocity were taken out",
    Status.MOTION_FAULT: "angle and velocity disagree: both were taken out",
    Status.ENCODERS_FAULT: "both encoders disagree: angles and velocity were taken out",
    Status.TORQUES_FAULT: "sensor and observer disagree on the external torque",
    Status.TEMPERATURE_FAULT: "temperature or thermistor is out of its range and was taken out",
    Status.RESTARTED: "observer, lags and detector start here: the first row, or one behind a gap",
}
