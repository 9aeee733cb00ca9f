"""How far two runs of the same rows are apart: in bits, in units in the last place, in Nm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["CHAIN_OUTPUTS", "Output", "OutputDifference", "differences", "same_bits"]

Results = NDArray[np.void]


@dataclass(frozen=True)
class Output:
    """One of the values of a result: its place, unit, and the bit in `missed` of its stage.

    `estimator` is the key of the stage in the plan; empty for those that have none.
    """

    place: int
    unit: str
    stage: int = 0
    estimator: str = ""


CHAIN_OUTPUTS = {
    "temperature": Output(0, "°C", 1, "thermistor"),
    "sensor_torque": Output(1, "Nm", 4, "sensor"),
    "external_torque_sensor": Output(2, "Nm", 4, "sensor"),
    "external_torque_observer": Output(3, "Nm", 8, "observer"),
    "external_torque_compliance": Output(4, "Nm", 16, "compliance"),
    "external_torque_compliant_observer": Output(5, "Nm", 128, "compliant_observer"),
    "external_torque_merged": Output(6, "Nm", 32, "merge"),
}
MARKS = ("contact", "flags", "faults", "missed", "status")


@dataclass(frozen=True)
class OutputDifference:
    """One output of the device against the host's runs.

    Parameters
    ----------
    name, unit : of the output.
    samples : in which the device has it.
    different : in how many of all samples its bits are not the host's.
    largest_ulp : largest difference from the host's float, in units in the last place.
    largest : the same in the output's unit.
    quantisation, quantisation_rms : largest and RMS difference from the host's double, which has
        the log's own numbers, not rounded: what float costs.
    """

    name: str
    unit: str
    samples: int
    different: int
    largest_ulp: int
    largest: float
    quantisation: float
    quantisation_rms: float


def differences(
    outputs: Mapping[str, Output], device: Results, single: Results, double: Results
) -> tuple[OutputDifference, ...]:
    """Return the outputs that the device has in some sample, each against the host's two runs."""
    found = []
    for name, output in outputs.items():
        good = (device["status"] == 0) & ((device["missed"] & output.stage) == 0)
        if good.any():
            values = (run["values"][:, output.place] for run in (device, single, double))
            both = good & (double["status"] == 0) & ((double["missed"] & output.stage) == 0)
            found.append(_difference(name, output, good, both, *values))
    return tuple(found)


def same_bits(device: Results, single: Results) -> bool:
    """Whether values, marks and verdict are the same in each sample."""
    values = np.array_equal(_ordered(device["values"]), _ordered(single["values"]))
    return values and all(np.array_equal(device[name], single[name]) for name in MARKS)


def _difference(
    name: str,
    output: Output,
    good: NDArray[np.bool_],
    both: NDArray[np.bool_],
    device: NDArray[np.float32],
    single: NDArray[np.float32],
    double: NDArray[np.float64],
) -> OutputDifference:
    apart = np.abs(_ordered(device) - _ordered(single))
    with np.errstate(invalid="ignore"):
        torques = np.abs(device.astype(np.float64) - single)
        cost = np.abs(device[both].astype(np.float64) - double[both])
    return OutputDifference(
        name,
        output.unit,
        samples=int(good.sum()),
        different=int(np.count_nonzero(apart)),
        largest_ulp=int(apart.max(initial=0)),
        largest=float(np.max(torques, initial=0.0, where=np.isfinite(torques))),
        quantisation=float(cost.max(initial=0.0)),
        quantisation_rms=float(np.sqrt(np.mean(cost**2))) if cost.size else 0.0,
    )


def _ordered(values: NDArray[np.float32]) -> NDArray[np.int64]:
    """Floats as whole numbers in their order, one apart where they are neighbours.

    −0 and 0 are one apart, for their bits differ; NaN, whose bits a processor may choose, is one.
    """
    bits = np.ascontiguousarray(values).view(np.uint32).astype(np.int64)
    bits[np.isnan(values)] = 0x7FC00000
    sign = np.int64(0x80000000)
    return np.where(bits >= sign, sign - 1 - bits, bits)
