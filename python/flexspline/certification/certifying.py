"""`flexspline.certify`: an exported model on its device, compared with the host."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexspline.certification.building import Built, build, calls_of, sizes_of
from flexspline.certification.cycles import METHOD, cycles_per_instruction
from flexspline.certification.devices import DEVICES, Device, device_of
from flexspline.certification.differences import (
    CHAIN_OUTPUTS,
    Output,
    OutputDifference,
    differences,
    same_bits,
)
from flexspline.certification.on_device import derived_on_device
from flexspline.certification.result import Certificate, Cost
from flexspline.certification.rows import rows_of
from flexspline.certification.running import Run, counted_on_host, run
from flexspline.certification.tools import found, host_compiler, version_of
from flexspline.errors import InputError
from flexspline.estimation.measurable import measurable
from flexspline.estimation.plan import plan_of
from flexspline.estimation.preprocessing import with_derivatives
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.logs.read import with_motor_torque
from flexspline.model import Model
from flexspline.prepared import prepared
from flexspline.signals import channels_for

__all__ = ["certify"]

HOST = DEVICES["host"]
PLAIN = ("-O1",)  # of the host's own runs: their bits are the same at every level


@dataclass(frozen=True)
class _Subject:
    """What is certified: its name, its unit of translation, its outputs, the log it reads."""

    name: str
    unit: str
    target: str | None
    outputs: Mapping[str, Output]
    log: Log
    known_load: str | None
    notes: tuple[str, ...]


def certify(
    model: Model,
    log: Log,
    device: str = "host",
    *,
    target: str | None = None,
    options: Sequence[str] = ("-O2",),
) -> Certificate:
    """Compile a model for a device, stream a log through it, and compare with the host.

    The model is exported as a header, compiled with the device's compiler and run on the log's
    rows one by one in float: on this machine, or on a board that QEMU plays. The same program is
    run on this machine in float, which must give the same bits, and in double with the log's own
    numbers, which says what float costs.

    Parameters
    ----------
    model : with estimators, whose chain is certified; or a part's model.
    log : all its rows are streamed; memory starts anew behind each gap. The device makes velocity
        and acceleration itself where the model has a `Differentiator`; else one that the log lacks
        is derived before, causally for estimators, and a note says so. A note says how far the
        causal filter moves each external torque against the analysis' own channels, and both
        errors where the log has a reference torque.
    device : "host", "cortex-m4f" or "cortex-m7".
    target : certifies the model of this part, also where the model has estimators.
    options : of the device's compiler, after those that every build has: such as your firmware's.

    Returns
    -------
    A `Certificate`: bits, differences in ULP and in the outputs' units, bytes, instructions.

    Raises
    ------
    InputError
        Where a tool is missing (the sentence names Debian's package), the compiler refuses, or the
        log has no row with all that the model reads.
    """
    chosen = device_of(device)
    compiler = host_compiler() if chosen.compiler is None else found(chosen.compiler)
    if chosen.machine is not None:
        found("qemu-system-arm")
    subject = _subject(model, log, target)
    with tempfile.TemporaryDirectory(prefix="flexspline-certify-") as name:
        folder = Path(name)
        export(model, folder / "joint.hpp", target=subject.target)
        made, built = _run(chosen, folder, subject, "float", options)
        host = [_run(HOST, folder, subject, scalar, PLAIN)[0] for scalar in ("float", "double")]
        cost = _cost(chosen, built, folder, subject, made)
    return Certificate(
        device=chosen.name,
        processor=chosen.processor,
        machine=chosen.machine,
        compiler=version_of(compiler),
        options=(*chosen.options, *options),
        certified=subject.name,
        model_sha256=hashlib.sha256(model.to_json().encode()).hexdigest(),
        log=_named(log),
        samples=len(log),
        bit_identical=same_bits(made.results, host[0].results),
        outputs=_compared(subject, made, *host),
        refused=int(np.count_nonzero(made.results["status"])),
        cost=cost,
        notes=subject.notes,
    )


def _compared(
    subject: _Subject, device: Run, single: Run, double: Run
) -> tuple[OutputDifference, ...]:
    runs = (device.results, single.results, double.results)
    compared = differences(subject.outputs, *runs)
    if not compared:
        raise InputError(
            f"log '{subject.log.name}': no row has all that the model reads; map the columns that "
            "are missing"
        )
    return compared


def _named(log: Log) -> dict[str, Any]:
    digest = log.source.sha256 if log.source else None
    return {"name": log.name, "rows": len(log), "sha256": digest}


def _subject(model: Model, log: Log, target: str | None) -> _Subject:
    said: dict[str, None] = {}
    if model.estimators and target is None:
        plan = plan_of(model)
        said |= dict.fromkeys(derived_on_device(model, log))
        log = with_derivatives(plan, measurable(with_motor_torque(log), said), None, said)
        stages = {*plan.sensing, *plan.estimating, *(("sensor",) if plan.has_sensor else ())}
        outputs = {name: made for name, made in CHAIN_OUTPUTS.items() if made.estimator in stages}
        return _Subject("estimators", "joint_unit", None, outputs, log, None, tuple(said))
    part = model.part(target)
    log = channels_for(prepared(log, part.preparations), part.effects, part.known_load)
    if "motor_position" not in part.record.get("channels", ()):
        kept = {name: log[name] for name in log.channels if name != "motor_position"}
        log = Log.from_arrays(facts=dict(log.facts), **kept)
    outputs = {part.target: Output(0, part.unit)}
    notes = tuple(f"{one.channel} of the log was {one.how}, zero phase, as the model expects it"
                  for one in part.preparations)  # fmt: skip
    return _Subject(part.target, "model_unit", part.target, outputs, log, part.known_load, notes)


def _run(
    device: Device, folder: Path, subject: _Subject, scalar: str, options: Sequence[str]
) -> tuple[Run, Built]:
    built = build(device, folder, subject.unit, scalar, options)
    rows = rows_of(subject.log, scalar, subject.known_load)
    return run(device, built, folder, rows, scalar), built


def _cost(device: Device, built: Built, folder: Path, subject: _Subject, made: Run) -> Cost:
    sizes = sizes_of(device, built, folder)
    calls = calls_of(device, built, folder)
    if made.instructions is None:
        rows = rows_of(subject.log, "float", subject.known_load)
        count = counted_on_host(built, folder, rows)
        how = "mean of the first samples, counted by callgrind" if count else "valgrind is missing"
        none = "not measured on a host"
        bytes_of = (sizes.flash, sizes.code, sizes.ram)
        return Cost(*bytes_of, None, none, count, None, how, None, none, calls)
    median = float(np.median(made.instructions))
    weight = cycles_per_instruction(device, built, folder)
    return Cost(
        flash_bytes=sizes.flash,
        code_bytes=sizes.code,
        ram_bytes=sizes.ram,
        stack_bytes=made.stack_bytes,
        stack_by="painted, deepest over the log",
        instructions_per_step=median,
        most_instructions=int(made.instructions.max()),
        instructions_by="median; each step counted by SysTick under QEMU's -icount",
        cycles_per_step=None if weight is None else round(weight * median),
        cycles_by=METHOD.get(device.name, "not estimated"),
        calls=calls,
    )
