"""What a device computes with an exported model, against what was promised, and its cost.

`certify` compares an exported model on its device with the host.
Where the chain derives velocity and acceleration on the device, the certificate also states how far
that moves each external torque.

Outputs are compared in bits, in units in the last place (ULP), and in their own unit.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.about import __version__
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
from flexspline.errors import InputError, listed
from flexspline.estimation import Estimate, estimate, measurable
from flexspline.estimation.plan import BANDWIDTH, adapted_units, plan_of, with_derivatives
from flexspline.estimators import Differentiator, Estimator, ReadingChecks
from flexspline.estimators.sensing import DERIVED
from flexspline.exporting import export
from flexspline.formatting import rows_text, sentences_text, short, table_html
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

VERSION = 1
REFUSED, OUT_OF_RANGE = 3, 4  # of the core: Status::out_of_range, the bit Flag::out_of_range

Results = NDArray[np.void]

MARKS = ("contact", "flags", "faults", "missed", "status")

WIDTH = 100
HEAD = ("output", "unit", "samples", "other bits", "largest ULP", "largest", "float costs", "RMS")

HOST = DEVICES["host"]
PLAIN = ("-O1",)  # of the host's own runs: their bits are the same at every level

START = 0.5  # s, of which the filter and the observers behind it remember nothing later
REFERENCE = "reference_torque"


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
        log = with_derivatives(plan, measurable(with_motor_torque(log), said), said)
        stages = {*plan.sensing, *plan.estimating, *(("sensor",) if plan.has_sensor else ())}
        outputs = {name: made for name, made in CHAIN_OUTPUTS.items() if made.estimator in stages}
        for place, (name, unit) in enumerate(adapted_units(model, plan).items()):
            outputs[name] = Output(FIRST_ADAPTED + place, unit, 0, "adaptation")
        return _Subject("estimators", "joint_unit", None, outputs, log, None, tuple(said))
    part = model.part(target)
    log = channels_for(prepared(log, part.preparations), part.effects, part.known_load)
    if part.carried is not None and part.known_load is not None:
        whole = {part.known_load: part.load(log)}
        log = log.with_columns(whole, note=f"{part.known_load} with {part.carried.words}")
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
