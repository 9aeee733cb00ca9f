"""A certificate: what a device computes with a model, against the host, and what it costs."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from flexspline.about import __version__
from flexspline.certification.differences import OutputDifference

__all__ = ["Certificate", "Cost", "OutputDifference"]

VERSION = 1


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
        from flexspline.certification.text import certificate_text

        return certificate_text(self)

    def _repr_html_(self) -> str:
        from flexspline.certification.text import certificate_html

        return certificate_html(self)
