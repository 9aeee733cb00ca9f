"""A model as the source of a level-2 C++ S-function, a block of Simulink ([MathWorks2024]).

It is one file: the exported header and `cpp/firmware/simulators/sfunction.cpp` with what that
includes, but for the core's headers and Simulink's. No Simulink has run it: its test compiles it
with a stub of Simulink's header and compares its numbers with the core's.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from flexspline.about import __version__
from flexspline.errors import InputError, shortened
from flexspline.exporting.cpp_text import in_ascii, namespace_name
from flexspline.exporting.fmu import MODEL_HEADER, NAMESPACE, STATUSES, input_names, model_header
from flexspline.exporting.header import MEANING, channels_read
from flexspline.logs.channels import CHANNELS
from flexspline.model import Model, Part
from flexspline.programs import firmware_folder

__all__ = ["sfunction_text"]

SUFFIXES = (".cpp", ".cc", ".cxx")  # by which mex tells C++
OURS = frozenset((NAMESPACE, "simulators"))
OF_MATLAB = frozenset(
    ["classdef", "elseif", "end", "function", "global", "otherwise", "parfor", "persistent", "spmd"]
)  # its words that are none of C++
ONCE = "#pragma once\n"


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
