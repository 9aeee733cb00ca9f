"""What a device computes with an exported model, against what was promised, and its cost.

`certify` compares an exported model on its device with the host.
Where the chain derives velocity and acceleration on the device, the certificate also states how far
that moves each external torque.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.certification.program import (
    DEVICES,
    METHOD,
    Built,
    Device,
    Run,
    build,
    calls_of,
    counted_on_host,
    cycles_per_instruction,
    device_of,
    rows_of,
    run,
    sizes_of,
    version_of,
)
from flexspline.certification.result import (
    CHAIN_OUTPUTS,
    FIRST_ADAPTED,
    Certificate,
    Cost,
    Output,
    OutputDifference,
    beyond_limits,
    differences,
    same_bits,
)
from flexspline.errors import InputError, listed
from flexspline.estimation import estimate, measurable
from flexspline.estimation.plan import BANDWIDTH, adapted_units, plan_of, with_derivatives
from flexspline.estimation.result import Estimate
from flexspline.estimators import Differentiator, Estimator, ReadingChecks
from flexspline.estimators.sensing import DERIVED
from flexspline.exporting import export
from flexspline.formatting import short
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.logs.read import LogLike, as_log, with_motor_torque
from flexspline.logs.segments import runs
from flexspline.model import Model
from flexspline.prepared import prepared
from flexspline.programs import found, host_compiler
from flexspline.signals import channels_for

__all__ = [
    "Certificate",
    "OutputDifference",
    "certify",
]


HOST = DEVICES["host"]
PLAIN = ("-O1",)  # of the host's own runs: their bits are the same at every level

START = 0.5  # s, of which the filter and the observers behind it remember nothing later
REFERENCE = "reference_torque"


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
    log: LogLike,
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
    log = as_log(log)
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
        out_of_range=int(np.count_nonzero(beyond_limits(made.results))),
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
        for place, (name, unit) in enumerate(adapted_units(model, plan).items()):
            outputs[name] = Output(FIRST_ADAPTED + place, unit, 0, "adaptation")
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


def derived_on_device(model: Model, log: Log) -> tuple[str, ...]:
    """Return a sentence on how far the chain's differentiator moves each external torque [Nm].

    Both runs are the host's chain in double: with the analysis' own velocity and acceleration, and
    with those of the chain's stage. A model that has the stage is compared with one that reads the
    log's channels, or their zero-phase derivative where the log has none; a model without the stage
    gets one in place of the log's channels. Where the log has a reference torque, the sentence has
    the error of both against it.
    """
    made = model.estimators.get("differentiator")
    own = tuple(name for name in DERIVED if name in log)
    if "output_position" not in log or not (own or isinstance(made, Differentiator)):
        return ()
    try:
        if isinstance(made, Differentiator):
            rest = {key: e for key, e in model.estimators.items() if key != made.key}
            whose, channels = _analysis_own(log, made)
            analysed = estimate(replace(model, estimators=rest), channels)
            derived = estimate(model, log)
        else:
            whose = f"the log's own {listed(own)}"
            analysed, derived = estimate(model, log), estimate(_by_angle(model, log, own), log)
    except InputError:
        return ()  # what is wrong with the log is said elsewhere
    moved = _moved(log, analysed, derived)
    filters = [note for note in derived.notes if "causal, " in note]
    if not moved or not filters:  # nothing reads what the filter makes
        return ()
    how = filters[0][filters[0].index("causal, ") :].split("; ")[0]
    return (
        f"with the chain's own filter ({how}) in place of {whose}, and {START:g} s behind each "
        f"start left out, these move: {'; '.join(moved)}",
    )


def _by_angle(model: Model, log: Log, channels: tuple[str, ...]) -> Model:
    """The model with a stage that makes these channels, and without checks of a velocity read."""
    stages: dict[str, Estimator] = {
        "differentiator": Differentiator(min(BANDWIDTH, log.rate / 4.0), channels)
    }
    checks = model.estimators.get("reading_checks")
    if isinstance(checks, ReadingChecks):
        stages["reading_checks"] = replace(checks, way=None, most_acceleration=None)
    return replace(model, estimators={**model.estimators, **stages})


def _analysis_own(log: Log, made: Differentiator) -> tuple[str, Log]:
    """The channels that the stage makes, as the analysis has them; and whose they are."""
    missing = [name for name in made.channels if name not in log]
    if not missing:
        return f"the log's own {listed(made.channels)}", log
    derived = differentiate(log)
    columns = {name: derived[name] for name in missing}
    return f"the zero-phase {listed(missing)}", log.with_columns(columns, note="zero phase")


def _moved(log: Log, analysed: Estimate, derived: Estimate) -> list[str]:
    """Each external torque in words: how far it moves, and both errors."""
    moved, settled = [], _settled(log)
    for name in analysed.columns:
        if not name.startswith("external") or name not in derived:
            continue
        both = settled & np.isfinite(analysed[name]) & np.isfinite(derived[name])
        if not both.any():
            continue
        apart = (analysed[name] - derived[name])[both]
        said = f"{name} by {_rms(apart)} Nm RMS, {short(float(np.abs(apart).max()), 3)} at most"
        known = both & np.isfinite(log[REFERENCE]) if REFERENCE in log else np.zeros_like(both)
        if known.any():
            errors = [_rms((run[name] - log[REFERENCE])[known]) for run in (derived, analysed)]
            said += f" (error against {REFERENCE} {errors[0]} Nm RMS, before {errors[1]} Nm RMS)"
        moved.append(said)
    return moved


def _rms(values: NDArray[np.float64]) -> str:
    return short(float(np.sqrt(np.mean(values**2))), 3)


def _settled(log: Log) -> NDArray[np.bool_]:
    """Rows in which the filter and what is behind it have forgotten their start, (N,)."""
    time = log["time"]
    starts = np.zeros(len(time))
    for first, last in runs(time):
        starts[first:last] = time[first]
    return np.asarray(time - starts >= START)
