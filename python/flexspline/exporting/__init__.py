"""Export of a model: as JSON, for programs with the core, or as the joint of a simulator."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from flexspline.errors import FlexsplineWarning, InputError, did_you_mean
from flexspline.estimation.plan import carried_warnings
from flexspline.exporting.block import block_bytes, require_scalar
from flexspline.exporting.coupling import Coupling, coupling_of
from flexspline.exporting.cpp_text import namespace_name
from flexspline.exporting.dcmotor import has_dcmotor
from flexspline.exporting.fmu import fmu_bytes, sfunction_text
from flexspline.exporting.header import header_text, own_headers
from flexspline.exporting.plain_joint import (
    MJCF_NUMBERS,
    URDF_NUMBERS,
    PlainJoint,
    mjcf_text,
    plain_joint,
    urdf_text,
)
from flexspline.exporting.plugin import (
    Plugin,
    Plugins,
    compile_plugin,
    library_name,
    plugin_files,
    plugin_of,
    plugins_of,
    write_plugin,
)
from flexspline.files import atomic_write, whole_folder
from flexspline.formatting import documented
from flexspline.logs.read import LogLike, as_logs
from flexspline.model import PART_OF, Model, part_warnings, refuse_warnings, require_model
from flexspline.own import Header

__all__ = [
    "EXPORTS",
    "FOLDERS",
    "FORMATS",
    "JOINTS",
    "Coupling",
    "Export",
    "Plugin",
    "Plugins",
    "coupling_of",
    "export",
    "export_warnings",
    "joint_of",
    "mujoco_plugin",
    "namespace_of",
    "plugin_of",
    "plugins_of",
]


def _header(model: Model, path: Path, target: str | None, scalar: str) -> None:
    _write_with_own(model, path, target, header_text(model, namespace_of(path), target))


def _simulink(model: Model, path: Path, target: str | None, scalar: str) -> None:
    part = model.part(target).target
    _write_with_own(model, path, part, sfunction_text(model, path, part))


def _write_with_own(model: Model, path: Path, target: str | None, text: str) -> None:
    """Write a source, and beside it the headers of own effects that it includes."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give the name of a file")
    missing = [own for own in own_headers(model, target) if not _is_there(own, path)]
    for own in missing:
        atomic_write(path.with_name(own.name), own.text)
    atomic_write(path, text)


def _is_there(own: Header, path: Path) -> bool:
    """Whether the header of an own effect stands beside an exported one already.

    Raises
    ------
    InputError
        Where another file stands in its place, or the exported header would.
    """
    there = path.with_name(own.name)
    if there == path:
        raise InputError(
            f"{path}: is the name of the header of one of the model's own effects; export to "
            "another file"
        )
    if not there.exists():
        return False
    if not there.is_file() or there.read_bytes() != own.text:
        raise InputError(
            f"{there}: is not what {own.path} was when it was compiled, and the exported header "
            "includes it from here; export into another folder, or take this file away"
        )
    return True


def _binary(model: Model, path: Path, target: str | None, scalar: str) -> None:
    own_headers(model, target)  # refuses effects that no program can have
    atomic_write(path, block_bytes(model, scalar, target))


def _json(model: Model, path: Path, target: str | None, scalar: str) -> None:
    if target is not None:
        part = model.part(target)
        model = replace(model, parts={PART_OF[part.target]: part})
    model.save(path)


def _fmu(model: Model, path: Path, target: str | None, scalar: str) -> None:
    atomic_write(path, fmu_bytes(model, namespace_of(path), target))


def _mujoco_plugin(
    model: Model, path: Path, target: str | None, scalar: str, compiles: bool = False
) -> None:
    namespace = namespace_of(path)
    for one in plugins_of(model, target).models:
        for own in own_headers(one, None):
            _is_there(own, path / f"{namespace}.hpp")
    with whole_folder(path) as draft:
        write_plugin(model, namespace, draft, target)
        if compiles:
            compile_plugin(namespace, draft)


class Export(NamedTuple):
    """A format in which a model leaves.

    Parameters
    ----------
    says : what it is, a text for help and docstrings.
    write : writes a model, whole or not at all: to a path, a target's part, with numbers of a
        scalar. None where `joint` is given.
    joint : of a format that knows a joint by a few numbers, which, and the text that they make.
    files : of a format that is a folder, its files by the namespace.
    """

    says: str
    write: Callable[[Model, Path, str | None, str], None] | None = None
    joint: tuple[Sequence[tuple[str, int]], Callable[[PlainJoint], str]] | None = None
    files: Callable[[str], list[str]] | None = None


LOSSES = (
    " A comment above it lists the effects that it leaves out, each with its largest torque over "
    "the ranges of the fit; where runs are given, with the root mean square there too, and the "
    "errors of model and joint."
)
EXPORTS = {
    "header": Export(
        "constants that a C++20 program compiles with the core's headers, without heap or "
        "exceptions; it predicts the same numbers as predict",
        _header,
    ),
    "binary": Export(
        "parameters that replace those of a program with such a header while it runs "
        "(flexspline/block.hpp), which checks length, version, CRC-32 and structure before it "
        "takes them, whole or not at all",
        _binary,
    ),
    "json": Export("the model file, as fit writes it", _json),
    "fmu": Export(
        "a co-simulation unit of FMI 3.0 with sources and a binary for this machine, compiled by "
        "$CXX or c++. Inputs are the channels that the model reads, outputs the torque that it "
        "says, that of each effect, and a status; each instance keeps what its effects remember",
        _fmu,
    ),
    "simulink": Export(
        "the C++ source of an S-function with the ports of an FMU, and in it the line of mex that "
        "builds it; compiled and run with a stub of Simulink's header alone, never in Simulink",
        _simulink,
    ),
    "mujoco-plugin": Export(
        "a folder with the sources of an engine plugin of MuJoCo, the line that builds them and an "
        "MJCF file to copy from. It leaves out none of the joint's torques: it is the passive "
        "force of a joint by the same C++ code, load, angle, direction and memory included, and "
        "its heat if asked for. A torsion by a known load becomes the gear between two hinges, "
        "motor side and link, with compliance, hysteresis and backlash; the MJCF says how long a "
        "timestep that bears",
        _mujoco_plugin,
        files=plugin_files,
    ),
    "mujoco": Export(
        "a joint of an MJCF file with armature, damping and frictionloss of the model, in SI units "
        "at the output of the gear. Where the MuJoCo of this Python is 4 or later, or with "
        "dcmotor, passive dcmotors beside the joint take Stribeck's friction, presliding friction "
        "and each order of a ripple." + LOSSES,
        joint=(MJCF_NUMBERS, mjcf_text),
    ),
    "urdf": Export(
        "a joint of a URDF with damping, friction and limits, in SI units at the output of the "
        "gear." + LOSSES,
        joint=(URDF_NUMBERS, urdf_text),
    ),
}
"""Every format in which a model leaves. Help, docstrings and sentences follow."""

FORMATS = tuple(EXPORTS)
JOINTS = {name: each.joint for name, each in EXPORTS.items() if each.joint is not None}
WITH_MOTORS = "mujoco"
"""The format of `JOINTS` that has passive motors beside a joint."""
FOLDERS = {name: each.files for name, each in EXPORTS.items() if each.files is not None}


@documented((f'"{name}"', each.says) for name, each in EXPORTS.items())
def export(
    model: Model,
    path: str | os.PathLike[str],
    format: str = "header",
    target: str | None = None,
    scalar: str = "float",
    strict: bool = False,
    runs: LogLike | Iterable[LogLike] = (),
    dcmotor: bool | None = None,
) -> Path:
    """Write a model for use outside Python, whole or not at all.

    Parameters
    ----------
    model : what `fit` or `Model.load` gives.
    path : file to write, or the folder that some formats are; its stem is the header's namespace.
    format : what leaves, one of the notes below.
    target : which part, such as "sensor_torque"; None picks the only one, and keeps all in JSON,
        and a torsion beside another one in a plugin.
    scalar : "float" or "double", the numbers of a binary block.
    strict : refuse what is otherwise warned of.
    runs : of a simulator's joint, runs on which the table tells what is lost too: the root mean
        square of each effect, and the errors of the model and of the joint. Of a part that corrects
        a simulation they hold the channel simulated_torque.
    dcmotor : of "mujoco", whether MuJoCo's passive `dcmotor` beside the joint takes Stribeck's and
        presliding friction and each order of a ripple. None: where the MuJoCo of this Python has
        it, from 4 on. It is not imported.

    Returns
    -------
    The path.

    Raises
    ------
    InputError
        For an unknown format, scalar or target, a number that the core cannot hold, a target that
        is no torque where a simulator's joint needs one, a part without an effect that a plugin
        could run, a torsion to which no torque belongs, a compiler that is missing or refuses, runs
        that lack what the model reads or of which the format says nothing, `dcmotor` of another
        format than "mujoco", or a path that cannot be written; with `strict` for what is otherwise
        warned of.

    Warns
    -----
    FlexsplineWarning
        Of signs that no drive has, of terms that are not significant, of parameters at a bound, and
        of a gravity that a compliance reads and no fit determined.

    Notes
    -----
    {formats}
    """
    if format not in FORMATS:
        near = did_you_mean(format, FORMATS)
        raise InputError(f"there is no export format '{format}'{near}; give {' or '.join(FORMATS)}")
    require_model(model)
    require_scalar(scalar)
    _require_motors(format, dcmotor)
    _warn(model, target, strict)
    if format in JOINTS:
        _, text = JOINTS[format]
        atomic_write(path, text(joint_of(model, format, target, runs, dcmotor)))
        return Path(path)
    if as_logs(runs):
        raise InputError(
            f"runs say what a simulator's joint leaves out, and {format} leaves out nothing; leave "
            f"them out, or give {' or '.join(JOINTS)}"
        )
    write = EXPORTS[format].write
    assert write is not None  # as it is no joint
    write(model, Path(path), target, scalar)
    return Path(path)


def _warn(model: Model, target: str | None, strict: bool) -> None:
    said = export_warnings(model, target)
    if strict:
        refuse_warnings(said)
    for sentence in said:
        warnings.warn(sentence, FlexsplineWarning, stacklevel=3)


def mujoco_plugin(
    model: Model, path: str | os.PathLike[str], target: str | None = None, strict: bool = False
) -> Path:
    """Export a model as MuJoCo engine plugins and compile them with this machine's compiler.

    One plugin is the passive force of one joint: what the model says that the joint takes beside
    its load, by the core's own code in double, with the memory of effects that have one in mjData.
    Inertia and weight are left to MuJoCo, errors of a sensor left out. The temperature is what the
    MJCF says; with a thermal resistance and a time constant there, the joint's losses heat it.

    Where the model has a torsion, another plugin of the same library couples two hinges, motor side
    and link: compliance, hysteresis by the load, backlash. Its force is explicit, so that the
    timestep has to be below a limit, which the MJCF says; a longer one is refused as it is loaded.

    `mujoco-joint.hpp` and `mujoco-coupling.hpp` in the folder say with which numbers they work. The
    compiler is $CXX, else c++; headers and library of MuJoCo are those of Python's `mujoco`.

    Parameters
    ----------
    path : folder to write, as of `export(..., format="mujoco-plugin")`; its name is the plugin's,
        "flexspline.NAME", that of the coupling "flexspline.NAME_torsion". A process knows one
        plugin of a name.
    target : a part alone; None: the torsion and the only other part, where the model has them.
    strict : as of `export`.

    Returns
    -------
    The library, for `mujoco.mj_loadPluginLibrary(str(library))` before the MJCF is read that names
    the plugin.

    Raises
    ------
    InputError
        As `export`; where `mujoco` is not installed, or the compiler is missing or refuses.

    Warns
    -----
    FlexsplineWarning
        As `export`.
    """
    folder = Path(path)
    _warn(model, target, strict)
    _mujoco_plugin(model, folder, target, "double", compiles=True)
    return folder / library_name(namespace_of(folder))


def joint_of(
    model: Model,
    format: str,
    target: str | None = None,
    runs: LogLike | Iterable[LogLike] = (),
    dcmotor: bool | None = None,
) -> PlainJoint:
    """Return the numbers of a simulator's joint and what they leave out, as `export` writes them.

    Parameters
    ----------
    format : one of `JOINTS`.
    target, runs, dcmotor : as for `export`.

    Raises
    ------
    InputError
        As `export` does.
    """
    _require_motors(format, dcmotor)
    numbers, _ = JOINTS[format]
    motors = has_dcmotor() if dcmotor is None else dcmotor
    return plain_joint(model, target, numbers, runs, motors if format == WITH_MOTORS else None)


def _require_motors(format: str, dcmotor: bool | None) -> None:
    if dcmotor is not None and format != WITH_MOTORS:
        raise InputError(
            f"dcmotor is for the format {WITH_MOTORS}, and {format} has none; leave it out"
        )


def export_warnings(model: Model, target: str | None) -> list[str]:
    """Return what `export` warns of: of one part, or of all where a model is exported whole."""
    parts = [model.part(target)] if target is not None else model.parts.values()
    said = [sentence for part in parts for sentence in part_warnings(part)]
    return [*said, *(carried_warnings(model) if "compliance" in model.estimators else [])]


def namespace_of(path: str | os.PathLike[str]) -> str:
    """Return the stem of a path as a C++ namespace: "joint 7.hpp" is "joint_7"."""
    return namespace_name(Path(path).stem)
