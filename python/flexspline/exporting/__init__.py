"""Export of a model: as JSON, for programs with the core, or as the joint of a simulator."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from flexspline.errors import FlexsplineWarning, InputError, did_you_mean
from flexspline.exporting.block import block_bytes
from flexspline.exporting.cpp_text import namespace_name
from flexspline.exporting.header import header_text, own_headers
from flexspline.exporting.plain_joint import mjcf_text, urdf_text
from flexspline.files import atomic_write
from flexspline.model import PART_OF, Model, part_warnings, refuse_warnings
from flexspline.own.header import Header

__all__ = ["FORMATS", "export", "export_warnings", "namespace_of"]


def _header(model: Model, path: Path, target: str | None, scalar: str) -> None:
    text, beside = header_text(model, namespace_of(path), target), own_headers(model, target)
    missing = [own for own in beside if not _is_there(own, path)]
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


def _mujoco(model: Model, path: Path, target: str | None, scalar: str) -> None:
    atomic_write(path, mjcf_text(model, target))


def _urdf(model: Model, path: Path, target: str | None, scalar: str) -> None:
    atomic_write(path, urdf_text(model, target))


FORMATS: Mapping[str, Callable[[Model, Path, str | None, str], None]] = {
    "header": _header,
    "binary": _binary,
    "json": _json,
    "mujoco": _mujoco,
    "urdf": _urdf,
}
"""What writes each format, whole or not at all."""


def export(
    model: Model,
    path: str | os.PathLike[str],
    format: str = "header",
    target: str | None = None,
    scalar: str = "float",
    strict: bool = False,
) -> Path:
    """Write a model for use outside Python, whole or not at all.

    Parameters
    ----------
    model : what `fit` or `Model.load` gives.
    path : file to write; its stem is the header's namespace.
    format : "header", constants for a C++20 program in float or double; "binary", the parameters
        alone, which replace those of a program compiled with such a header (flexspline/block.hpp);
        "json", the same file as `Model.save` writes; or "mujoco" or "urdf", a file with a joint for
        a simulator and a table of what that leaves out.
    target : which part, such as "sensor_torque"; None picks the only one, and keeps all in JSON.
    scalar : "float" or "double", the numbers of a binary block.
    strict : refuse what is otherwise warned of.

    Returns
    -------
    The path.

    Raises
    ------
    InputError
        For an unknown format, scalar or target, a number that the core cannot hold, a target that
        is no torque where a simulator's joint needs one, or a path that cannot be written; with
        `strict` for what is otherwise warned of.

    Warns
    -----
    FlexsplineWarning
        Of signs that no drive has, of terms that are not significant and of parameters at a bound.
    """
    if format not in FORMATS:
        near = did_you_mean(format, FORMATS)
        raise InputError(f"there is no export format '{format}'{near}; give {' or '.join(FORMATS)}")
    said = export_warnings(model, target)
    if strict:
        refuse_warnings(said)
    for sentence in said:
        warnings.warn(sentence, FlexsplineWarning, stacklevel=2)
    FORMATS[format](model, Path(path), target, scalar)
    return Path(path)


def export_warnings(model: Model, target: str | None) -> list[str]:
    """Return what `export` warns of: of one part, or of all where a model is exported whole."""
    parts = [model.part(target)] if target is not None else model.parts.values()
    return [sentence for part in parts for sentence in part_warnings(part)]


def namespace_of(path: str | os.PathLike[str]) -> str:
    """Return the stem of a path as a C++ namespace: "joint 7.hpp" is "joint_7"."""
    return namespace_name(Path(path).stem)
