"""A model as source of C for other programs: an FMU of FMI 3.0, or an S-function.

An FMU is a co-simulation unit of FMI 3.0 ([Modelica2022], chapters 2 and 4). It is a ZIP with
modelDescription.xml, the exported header, the core's headers and the C++ that makes an FMU of them
(`cpp/firmware/simulators`), and that compiled for this machine. Inputs are the channels that the
part reads, outputs what it says, the torque of each effect and the status of a step. What is in it
depends on the model alone, so that the same model makes the same bytes.

A level-2 C++ S-function is a block of Simulink ([MathWorks2024]). It is one file: the exported
header and `cpp/firmware/simulators/sfunction.cpp` with what that includes, but for the core's
headers and Simulink's. No Simulink has run it: its test compiles it with a stub of Simulink's
header and compares its numbers with the core's.
"""

from __future__ import annotations

import io
import platform
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from flexspline.about import __version__
from flexspline.errors import InputError, shortened
from flexspline.exporting.cpp_text import IN_ASCII, in_ascii, namespace_name
from flexspline.exporting.header import (
    MEANING,
    channels_read,
    conditions,
    correction,
    given_load,
    header_text,
    model_sha256,
    own_headers,
)
from flexspline.exporting.plain_joint import attributes
from flexspline.logs.channels import CHANNELS
from flexspline.model import Model, Part
from flexspline.programs import STRICT, call, firmware_folder, host_compiler, include_folder

__all__ = [
    "MODEL_HEADER",
    "NAMESPACE",
    "STATUSES",
    "fmu_bytes",
    "input_names",
    "model_header",
    "sfunction_text",
]


NAMESPACE = "exported"  # as fmu.cpp and sfunction.cpp call that of the model
MODEL_HEADER = "flexspline-model.hpp"  # as fmu.cpp includes it; no effect has a hyphen in its name
SOURCES = ("fmu.cpp", "fmi3.hpp", "stepper.hpp")
FOLDER = PurePosixPath("fmu")  # of these; headers of effects, of any name, are not beside them
NUMBERED = (
    "output_position",
    "output_velocity",
    "output_acceleration",
    "motor_position",
    "temperature",
    "load",
    "motor_torque",
)
"""Channels as the core numbers them (`flexspline::Channel`); time and period are no inputs."""
TORQUE, STATUS, PARTS = 64, 65, 128  # value references, as in fmu.cpp
STATUSES = {
    "ok": "outputs are those of the inputs",
    "not_finite": "an input is not finite; outputs keep their last good values",
    "bad_period": "time stands still, goes back, or by more than an hour",
    "out_of_range": "an input is beyond what a joint has",
}
UNITS = {
    "rad": 'rad="1"',
    "rad/s": 'rad="1" s="-1"',
    "rad/s2": 'rad="1" s="-2"',
    "N.m": 'kg="1" m="2" s="-2"',
    "A": 'A="1"',
    "s": 's="1"',
    "degC": 'K="1" offset="273.15"',
}
NAMED = {"Nm": "N.m", "rad/s²": "rad/s2", "°C": "degC"}  # where the log format names it otherwise
SYSTEMS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("windows", "dll")}
MACHINES = {"amd64": "x86_64", "x64": "x86_64", "arm64": "aarch64"}

SUFFIXES = (".cpp", ".cc", ".cxx")  # by which mex tells C++
OURS = frozenset((NAMESPACE, "simulators"))
OF_MATLAB = frozenset(
    ["classdef", "elseif", "end", "function", "global", "otherwise", "parfor", "persistent", "spmd"]
)  # its words that are none of C++
ONCE = "#pragma once\n"


def fmu_bytes(model: Model, identifier: str, target: str | None = None) -> bytes:
    """Return an FMU of a part of a model, compiled for this machine.

    Parameters
    ----------
    identifier : its modelIdentifier, a name of C.

    Raises
    ------
    InputError
        Where there is no such part, the core cannot hold a number, an own effect has no header, or
        the compiler is missing or refuses.
    """
    part = model.part(target)
    sources = _sources(model, part, identifier)
    binary, library = _compiled(sources, identifier)
    files = {"modelDescription.xml": _model_description(model, part, identifier).encode()}
    files |= {f"sources/{path}": text for path, text in sources.items()}
    files[binary] = library
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name)  # of 1980: no clock is in it
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def input_names(part: Part) -> dict[str, str]:
    """Return the channels of the core that are inputs of a part, and what they are called.

    They are in the core's order.
    """
    names = (name for name in NUMBERED if name in channels_read(part))
    return {name: "known_load" if name == "load" else name for name in names}


def model_header(model: Model, part: Part, identifier: str) -> str:
    """Return the exported header of a part in ASCII, as `MODEL_HEADER` is to be.

    Its namespace is its own, for a program may hold several models.
    """
    own = f"{identifier}_model"
    text = header_text(model, own, part.target, chain=False)
    text = text.translate(IN_ASCII)  # signs stand in comments alone
    return f"{text}\nnamespace {NAMESPACE} = {own};\n"


def _sources(model: Model, part: Part, identifier: str) -> dict[str, bytes]:
    """What is compiled, by its path."""
    core, mine = include_folder(), firmware_folder() / "simulators"
    return {
        "buildDescription.xml": _build_description(identifier).encode(),
        MODEL_HEADER: model_header(model, part, identifier).encode(),
        **{str(FOLDER / name): (mine / name).read_bytes() for name in SOURCES},
        **{own.name: own.text for own in own_headers(model, part.target)},
        **{
            path.relative_to(core).as_posix(): path.read_bytes()
            for path in sorted(core.rglob("*.hpp"))
        },
    }


def _compiled(sources: Mapping[str, bytes], identifier: str) -> tuple[str, bytes]:
    """Path in the FMU and content of the library for this machine."""
    system, suffix = SYSTEMS.get(sys.platform, ("", ""))
    if not system:
        raise InputError(
            f"FMI has no name for binaries of {sys.platform}; export the FMU on Linux, macOS or "
            "Windows"
        )
    machine = platform.machine().lower()
    name = f"{identifier}.{suffix}"
    with tempfile.TemporaryDirectory(prefix="flexspline-fmu-", ignore_cleanup_errors=True) as made:
        folder = Path(made)
        for path, text in sources.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_bytes(text)
        options = ["-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-I."]
        call(
            [host_compiler(), *STRICT.split(), *options, str(FOLDER / "fmu.cpp"), "-o", name],
            folder,
            does=f"compiling the FMU {identifier}",
        )
        library = (folder / name).read_bytes()
    return f"binaries/{MACHINES.get(machine, machine)}-{system}/{name}", library


def _build_description(identifier: str) -> str:
    options = "-std=c++20 -O2 -ffp-contract=off -fno-exceptions -fno-rtti"
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            '<fmiBuildDescription fmiVersion="3.0">',
            f"  <BuildConfiguration {_tag(modelIdentifier=identifier)}>",
            f"    <SourceFileSet {_tag(language='C++20', compilerOptions=options)}>",
            f"      <SourceFile {_tag(name=FOLDER / 'fmu.cpp')}/>",
            '      <IncludeDirectory name="."/>',
            "    </SourceFileSet>",
            "  </BuildConfiguration>",
            "</fmiBuildDescription>",
            "",
        ]
    )


def _tag(**values: object) -> str:
    """Attributes of a tag, in ASCII."""
    return attributes((name, in_ascii(str(value))) for name, value in values.items())


def _model_description(model: Model, part: Part, identifier: str) -> str:
    said = correction(part, part.simulated) if part.simulated else [f"{MEANING[part.target]}."]
    head = _tag(
        fmiVersion="3.0",
        modelName=model.facts.get("joint") or identifier,
        instantiationToken=f"{part.target}:{model_sha256(model)}",
        description=" ".join([*said, *conditions(part)]),
        license="BSD-3-Clause (all in sources)",
        generationTool=f"flexspline {__version__}",
        variableNamingConvention="flat",
    )
    simulation = _tag(
        modelIdentifier=identifier,
        needsExecutionTool="false",
        canBeInstantiatedOnlyOncePerProcess="false",
        canGetAndSetFMUState="false",
        canSerializeFMUState="false",
        canHandleVariableCommunicationStepSize="true",
        hasEventMode="false",
    )
    variables = [*_variables(part)]
    outputs = [*_outputs(part)]
    units = ["s", *(str(v["unit"]) for v in (*variables, *outputs))]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f"<fmiModelDescription {head}>",
            f"  <CoSimulation {simulation}/>",
            "  <UnitDefinitions>",
            *(
                f"    <Unit {_tag(name=unit)}><BaseUnit {UNITS[unit]}/></Unit>"
                for unit in dict.fromkeys(units)
            ),
            "  </UnitDefinitions>",
            "  <TypeDefinitions>",
            '    <EnumerationType name="Status">',
            *(
                f"      <Item {_tag(name=name, value=value, description=words)}/>"
                for value, (name, words) in enumerate(STATUSES.items())
            ),
            "    </EnumerationType>",
            "  </TypeDefinitions>",
            "  <LogCategories>",
            '    <Category name="logStatusWarning"/>',
            '    <Category name="logStatusError"/>',
            "  </LogCategories>",
            "  <ModelVariables>",
            '    <Float64 name="time" valueReference="0" causality="independent" '
            'variability="continuous" unit="s"/>',
            *(f"    <Float64 {_tag(**each)}/>" for each in variables),
            *(f"    <Float64 {_tag(**each)}/>" for each in outputs),
            f'    <Enumeration name="status" valueReference="{STATUS}" causality="output" '
            'variability="discrete" declaredType="Status"/>',
            "  </ModelVariables>",
            "  <ModelStructure>",
            *(
                f'    <{kind} valueReference="{reference}"/>'
                for kind in ("Output", "InitialUnknown")
                for reference in (*(each["valueReference"] for each in outputs), STATUS)
            ),
            "  </ModelStructure>",
            "</fmiModelDescription>",
            "",
        ]
    )


def _variables(part: Part) -> Iterator[dict[str, object]]:
    """Attributes of the inputs."""
    for channel, name in input_names(part).items():
        unit, meaning = CHANNELS.get(name) or ("Nm", _load(part))
        yield {
            "name": name,
            "valueReference": 1 + NUMBERED.index(channel),
            "causality": "input",
            "variability": "continuous",
            "start": 25.0 if channel == "temperature" else 0.0,
            "unit": NAMED.get(unit, unit),
            "description": meaning,
        }


def _load(part: Part) -> str:
    return f"torque at the output that is known from elsewhere ({given_load(part)})"


def _outputs(part: Part) -> Iterator[dict[str, object]]:
    """Attributes of the outputs that are numbers."""
    unit = NAMED.get(part.unit, part.unit)
    whole = {"causality": "output", "variability": "continuous", "unit": unit}
    yield {
        "name": f"modelled_{part.target}",
        "valueReference": TORQUE,
        **whole,
        "description": MEANING[part.target],
    }
    for number, effect in enumerate(effect for effect in part.effects if effect.terms):
        yield {
            "name": f"part_{effect.name}",
            "valueReference": PARTS + number,
            **whole,
            "description": effect.info.signature,
        }


def sfunction_text(model: Model, path: Path, target: str | None = None) -> str:
    """Return the source of an S-function, which is called as its file is.

    Raises
    ------
    InputError
        Where there is no such part, the core cannot hold a number, or the file has no name that an
        S-function and a C++ source can have.
    """
    part = model.part(target)
    name = _require_name(path)
    folder = firmware_folder() / "simulators"
    source = (folder / "sfunction.cpp").read_text(encoding="utf-8")
    texts = {
        MODEL_HEADER: model_header(model, part, name),
        "stepper.hpp": (folder / "stepper.hpp").read_text(encoding="utf-8"),
    }
    for header, text in texts.items():
        source = source.replace(f'#include "{header}"\n', text.replace(ONCE, "", 1))
    head = [f"// {in_ascii(line)}".rstrip() for line in _head(part, name, path.name)]
    return "\n".join([*head, "", f"#define S_FUNCTION_NAME {name}", "", source])


def _require_name(path: Path) -> str:
    if path.suffix not in SUFFIXES:
        raise InputError(
            f"{path}: mex tells C++ by the name of the file; end it in {' or '.join(SUFFIXES)}"
        )
    name = namespace_name(path.stem)
    if name != path.stem or name in OURS | OF_MATLAB:
        raise InputError(
            f"{path}: an S-function is called as its file, and {shortened(ascii(path.stem), 80)} "
            "is no name that it can have; give letters, digits and single underscores, such as "
            "joint_7.cpp"
        )
    return name


def _head(part: Part, name: str, file: str) -> Iterator[str]:
    """Lines of the comment at the top."""
    yield f"S-function {name}, level 2, of a joint's model, by flexspline {__version__}."
    yield "NOT RUN IN SIMULINK: compiled and run with a stub of its header alone. Compare a run of"
    yield "yours with `flexspline predict` before you trust it."
    yield ""
    yield "Build it in MATLAB, INCLUDE being the folder that flexspline.get_include() names:"
    yield f"""  mex -IINCLUDE CXXFLAGS="$CXXFLAGS -std=c++20 -ffp-contract=off" {file}"""
    yield f"""  mex -IINCLUDE COMPFLAGS="$COMPFLAGS /std:c++20 /fp:precise" {file}   (Windows)"""
    yield ""
    yield "Sample time: inherited. Angles in rad, all in SI units, signs as in flexspline's logs."
    yield "What effects remember moves on in major steps; each block has its own."
    yield ""
    yield "Inputs, a port each:"
    names = input_names(part)
    for port, (channel, called) in enumerate(names.items(), 1):
        unit, meaning = CHANNELS.get(called) or ("Nm", "known torque at the output, else 0")
        yield f"  {port} {called} [{unit}]: {meaning}"
        if channel == "temperature":
            yield "    (25 where it is not known)"
    if not names:
        yield "  none"
    yield "Outputs:"
    yield f"  1 {part.target} [{part.unit}]: {MEANING[part.target]}"
    yield f"  2 status: {', '.join(f'{k} {each}' for k, each in enumerate(STATUSES))}"
    effects = [effect.name for effect in part.effects if effect.terms]
    if effects:
        yield "  3 what each effect adds, in this order:"
        yield from (f"      {effect}" for effect in effects)
    if "time" in channels_read(part):
        yield "The model reads the time since the simulation began."
