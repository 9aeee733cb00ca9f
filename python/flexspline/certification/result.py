"""A certificate: a device's outputs against the host's, the cost of a step, both as text and HTML.

Outputs are compared in bits, in units in the last place (ULP), and in their own unit.
"""

from __future__ import annotations

import json
import os
import textwrap
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.about import __version__
from flexspline.formatting import rows_text, sentences_text, short, table_html

__all__ = [
    "CHAIN_OUTPUTS",
    "FIRST_ADAPTED",
    "Certificate",
    "Cost",
    "Output",
    "OutputDifference",
    "beyond_limits",
    "differences",
    "same_bits",
]

VERSION = 1
REFUSED, OUT_OF_RANGE = 3, 4  # of the core: Status::out_of_range, the bit Flag::out_of_range

Results = NDArray[np.void]

MARKS = ("contact", "flags", "faults", "missed", "status")

WIDTH = 100
HEAD = ("output", "unit", "samples", "other bits", "largest ULP", "largest", "float costs", "RMS")


@dataclass(frozen=True)
class Cost:
    """What one step costs on the device; None where it was not measured.

    Parameters
    ----------
    flash_bytes : code, constants and initial values of the step and what it calls; without
        start-up code and the program that streams.
    code_bytes : of these, code and constants alone.
    ram_bytes : state, readings and outputs of one joint.
    stack_bytes : deepest use of the steps over the log; `stack_by` says how it was found.
    instructions_per_step : median over the samples; `instructions_by` says how they were counted.
    most_instructions : the worst sample.
    cycles_per_step : estimated from the median; `cycles_by` says how.
    calls : functions of the compiler's libraries.
    """

    flash_bytes: int | None
    code_bytes: int | None
    ram_bytes: int | None
    stack_bytes: int | None
    stack_by: str
    instructions_per_step: float | None
    most_instructions: int | None
    instructions_by: str
    cycles_per_step: float | None
    cycles_by: str
    calls: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class Certificate:
    """What `certify` found.

    Parameters
    ----------
    device, processor, machine, compiler, options : what ran the model; `machine` is QEMU's board.
    certified : "estimators", the chain, or the target of the part whose model it is.
    model_sha256 : of the model's file.
    log : name, rows and SHA-256 of the log.
    samples : compared.
    bit_identical : whether every output, flag and verdict has the bits of the host's float run in
        every sample.
    outputs : each against the host's float and double runs.
    refused : samples that a step refused.
    cost : of a step.
    notes : sentences on what was derived.
    out_of_range : samples with a reading beyond its limit, which the chain took for missing, or for
        which the part's model, that also refuses a missing angle so, gave no value.
    """

    device: str
    processor: str
    machine: str | None
    compiler: str
    options: tuple[str, ...]
    certified: str
    model_sha256: str
    log: Mapping[str, Any]
    samples: int
    bit_identical: bool
    outputs: tuple[OutputDifference, ...]
    refused: int
    cost: Cost
    notes: tuple[str, ...] = field(default=())
    out_of_range: int = 0

    @property
    def largest_difference(self) -> OutputDifference:
        """The output that differs most from the host's float run, in units in the last place."""
        return max(self.outputs, key=lambda output: output.largest_ulp)

    @property
    def quantisation(self) -> OutputDifference:
        """The torque (or the part's output) that float costs most."""
        first = self.outputs[0].unit if self.certified != "estimators" else "Nm"
        torques = [output for output in self.outputs if output.unit == first]
        return max(torques or self.outputs, key=lambda output: output.quantisation)

    def to_json(self) -> dict[str, Any]:
        """Return what `cert.json` holds, as plain values; its schema is part of the package."""
        worst, costly = self.largest_difference, self.quantisation
        return {
            "format": "flexspline-certificate",
            "version": VERSION,
            "made_by": f"flexspline {__version__}",
            "device": self.device,
            "processor": self.processor,
            "machine": self.machine,
            "compiler": self.compiler,
            "options": list(self.options),
            "certified": self.certified,
            "model_sha256": self.model_sha256,
            "log": dict(self.log),
            "samples": self.samples,
            "bit_identical": self.bit_identical,
            "largest_difference": {
                "output": worst.name,
                "ulp": worst.largest_ulp,
                "value": worst.largest,
                "unit": worst.unit,
            },
            "quantisation": {
                "output": costly.name,
                "largest": costly.quantisation,
                "rms": costly.quantisation_rms,
                "unit": costly.unit,
            },
            "outputs": [asdict(output) for output in self.outputs],
            "refused": self.refused,
            "out_of_range": self.out_of_range,
            **asdict(self.cost),
            "calls": list(self.cost.calls),
            "notes": list(self.notes),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write `to_json` to a file, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        from flexspline.files import atomic_write

        atomic_write(path, json.dumps(self.to_json(), indent=2, ensure_ascii=False) + "\n")

    def __repr__(self) -> str:
        same = "bit-identical" if self.bit_identical else "not bit-identical"
        return f"<Certificate of {self.certified} on {self.device}: {same}>"

    def __str__(self) -> str:

        return certificate_text(self)

    def _repr_html_(self) -> str:

        return certificate_html(self)


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
FIRST_ADAPTED = 8  # place of the adapted coefficients among the values


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


def beyond_limits(results: Results) -> NDArray[np.bool_]:
    """Samples with a reading beyond its limit, (N,): a chain flags it, a model refuses them."""
    flagged = (results["flags"] & OUT_OF_RANGE) != 0
    return np.asarray((results["status"] == REFUSED) | flagged)


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


def certificate_text(made: Certificate) -> str:
    """Return what `print(certificate)` shows."""
    table = rows_text([HEAD, *_rows(made)], left=(0, 1))
    said = sentences_text(_sentences(made), WIDTH)
    return "\n".join([*textwrap.wrap(_verdict(made), WIDTH), "", table, "", *said])


def certificate_html(made: Certificate) -> str:
    """Return the same as a fragment of HTML, for notebooks light and dark."""
    return table_html(_verdict(made), [HEAD, *_rows(made)], _sentences(made))


def _verdict(made: Certificate) -> str:
    what = "the estimators" if made.certified == "estimators" else f"the model of {made.certified}"
    where = made.device if made.machine is None else f"{made.device} (QEMU {made.machine})"
    if made.bit_identical:
        return f"{where} computes {what} with the host's bits in all {made.samples} samples."
    worst = made.largest_difference
    apart = "flags or verdicts differ"
    if worst.largest_ulp > 0:
        size = f"{worst.largest_ulp} ULP, {short(worst.largest, 3)} {worst.unit}"
        apart = f"{worst.name} differs by up to {size}"
    return (
        f"{where} does NOT compute {what} with the host's bits: {apart}; compile with "
        "-ffp-contract=off and without -ffast-math."
    )


def _rows(made: Certificate) -> list[tuple[str, ...]]:
    return [
        (
            output.name,
            output.unit,
            str(output.samples),
            str(output.different),
            str(output.largest_ulp),
            *(short(v, 3) for v in (output.largest, output.quantisation, output.quantisation_rms)),
        )
        for output in made.outputs
    ]


def _sentences(made: Certificate) -> list[str]:
    cost, costly = made.cost, made.quantisation
    said = [
        f"float instead of double, readings rounded too, costs {costly.name} at most "
        f"{short(costly.quantisation, 3)} {costly.unit}, {short(costly.quantisation_rms, 3)} RMS"
    ]
    if cost.instructions_per_step is not None:
        most = "" if cost.most_instructions is None else f", at most {cost.most_instructions}"
        count = f"{cost.instructions_per_step:.0f}"
        said.append(f"{count} instructions per step{most} ({cost.instructions_by})")
    if cost.cycles_per_step is not None:
        said.append(f"about {cost.cycles_per_step:.0f} cycles per step ({cost.cycles_by})")
    sizes = {"code": cost.code_bytes, "flash": cost.flash_bytes, "RAM": cost.ram_bytes}
    sizes["stack"] = cost.stack_bytes
    known = [f"{name} {size} bytes" for name, size in sizes.items() if size is not None]
    if known:
        said.append(f"{', '.join(known)} (stack: {cost.stack_by})")
    if cost.calls:
        said.append(f"calls of the compiler's libraries: {', '.join(cost.calls)}")
    if made.refused:
        said.append(f"{made.refused} of {made.samples} samples were refused by the step")
    if made.out_of_range:
        also = "" if made.certified == "estimators" else ", or lack an angle"
        said.append(
            f"{made.out_of_range} of {made.samples} samples have a reading beyond its limit in the "
            f"exported model{also}: the device says out_of_range and does without"
        )
    options = " ".join(made.options)
    said.append(f"{made.processor}; {made.compiler} {options}")
    return [*said, *made.notes]
