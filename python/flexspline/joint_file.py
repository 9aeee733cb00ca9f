"""The numbers of a joint in an MJCF file or a URDF, which may come from anywhere.

An XML that declares anything is refused, so that nothing in it unfolds and no other file is read.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from flexspline.errors import InputError, did_you_mean, listed, shortened

__all__ = ["JointNumbers", "is_joint_file", "read_joint"]

SUFFIXES = (".xml", ".urdf", ".mjcf")
LARGEST = 16 * 2**20  # bytes; whole robots have some 100 kB, their meshes are files of their own
DEEPEST = 200  # elements in each other
MAIN = "main"  # the class of all that name none
SPRING, REST = "stiffness", "springref"
OF_MJCF = {
    "armature": "armature",
    "damping": "damping",
    "friction": "frictionloss",
    SPRING: SPRING,
    REST: REST,
}
MOST = {"damping": 3, SPRING: 3}  # numbers: of 1, |x| and x^2 beside what they multiply
OF_ACTUATORS = ("lugre", "cogging", "armature", "damping")
INSIDE = ("body", "frame", "replicate")
ROTARY = ("hinge", "revolute", "continuous")
WANTED = "give an MJCF file or a URDF"


@dataclass(frozen=True)
class JointNumbers:
    """A joint's numbers, in SI units at its output.

    `damping`: one number to three, τ = v (d₀ + d₁ |v| + d₂ v²). `left_out`: a sentence for
    what the file says of the joint and is no number of a joint here: its spring, and what actuators
    add to it, such as the friction and cogging of a `dcmotor`.
    """

    name: str
    armature: float
    damping: tuple[float, ...]
    friction: float
    left_out: tuple[str, ...] = ()


def is_joint_file(path: str | os.PathLike[str]) -> bool:
    """Whether a file is an XML, by its name or by how it begins."""
    if Path(path).suffix.lower() in SUFFIXES:
        return True
    try:
        with Path(path).open("rb") as file:
            return file.read(100).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")
    except OSError:
        return False


def read_joint(path: str | os.PathLike[str], joint: str | None = None) -> JointNumbers:
    """Return the numbers of a rotary joint of an MJCF file, defaults included, or of a URDF.

    Parameters
    ----------
    joint : its name; None where the file has one.

    Raises
    ------
    InputError
        Where the file cannot be read, is neither, declares entities or includes files, has no such
        joint, several and none is named, or two of a name, or where a number is none or negative.
    """
    root = _tree(path)
    if root.tag == "mujoco":
        _refuse_includes(root, path)
        joints = [*_of_mjcf(root, path)]
    elif root.tag == "robot":
        joints = [*_of_urdf(root)]
    else:
        raise InputError(f"{path}: begins with <{shortened(root.tag, 40)}>; {WANTED}")
    chosen = _chosen(joints, path, joint)
    return _numbers(chosen, [*_by_actuators(root, chosen.name)], path)


@dataclass
class _Element:
    tag: str
    attributes: Mapping[str, str]
    children: list[_Element] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[_Element]:
        return (child for child in self.children if child.tag == tag)


def _tree(path: str | os.PathLike[str]) -> _Element:
    """The root of an XML without declarations."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {WANTED}") from error
    if len(content) > LARGEST:
        raise InputError(f"{path}: is larger than {LARGEST // 2**20} MiB; give the joint alone")
    top = _Element("", {})
    within = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(within) > DEEPEST:
            raise InputError(f"{path}: is nested too deep; {WANTED}")
        within.append(_Element(tag, attributes))
        within[-2].children.append(within[-1])

    def end(_: str) -> None:
        within.pop()

    def declared(*_: object) -> None:
        raise InputError(
            f"{path}: has a DOCTYPE or declares entities, which no file of a robot needs; take the "
            "declarations out"
        )

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = declared
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: is no whole XML ({error}); {WANTED}") from error
    return top.children[0]


@dataclass(frozen=True)
class _Joint:
    """A joint as the file has it: what kind, its numbers' texts, and what the file calls them."""

    name: str
    kind: str
    numbers: Mapping[str, str]
    called: Mapping[str, str] = field(default_factory=dict)


def _of_urdf(root: _Element) -> Iterator[_Joint]:
    for joint in root.all("joint"):
        dynamics = next(joint.all("dynamics"), _Element("", {})).attributes
        numbers = {name: dynamics[name] for name in ("damping", "friction") if name in dynamics}
        kind = joint.attributes.get("type", "")
        if kind != "fixed":  # holds two links together
            yield _Joint(joint.attributes.get("name", ""), kind, numbers)


def _of_mjcf(root: _Element, path: str | os.PathLike[str]) -> Iterator[_Joint]:
    classes = _defaults(root, "joint")
    for world in root.all("worldbody"):
        yield from _of_body(world, MAIN, classes, path)


def _defaults(root: _Element, tag: str) -> dict[str, Mapping[str, str]]:
    """Attributes that elements have by default, by their class."""
    classes: dict[str, Mapping[str, str]] = {MAIN: {}}
    for section in root.all("default"):
        _classes(section, MAIN, classes, tag)
        classes[section.attributes.get("class", MAIN)] = classes[MAIN]
    return classes


def _classes(section: _Element, name: str, classes: dict[str, Mapping[str, str]], tag: str) -> None:
    """Collect what the classes of defaults say; one inherits from the one around it."""
    for element in section.all(tag):
        classes[name] = {**classes[name], **element.attributes}
    for inner in section.all("default"):
        own = inner.attributes.get("class", "")
        classes[own] = classes[name]
        _classes(inner, own, classes, tag)


def _of_body(
    body: _Element,
    given: str,
    classes: Mapping[str, Mapping[str, str]],
    path: str | os.PathLike[str],
) -> Iterator[_Joint]:
    for child in body.children:
        if child.tag in INSIDE:
            inner = child.attributes.get("childclass", given)
            yield from _of_body(child, inner, classes, path)
        elif child.tag == "joint":
            name = child.attributes.get("class", given)
            if name not in classes:
                raise InputError(
                    f"{path}: a joint is of the class '{name}'{did_you_mean(name, classes)}, "
                    "which no default has; correct the file"
                )
            said = {**classes[name], **child.attributes}
            numbers = {ours: said[theirs] for ours, theirs in OF_MJCF.items() if theirs in said}
            yield _Joint(said.get("name", ""), said.get("type", "hinge"), numbers, OF_MJCF)


def _by_actuators(root: _Element, joint: str) -> Iterator[str]:
    """What actuators of an MJCF file add to a joint beside what they are told to."""
    for section in root.all("actuator"):
        for actuator in section.children:
            given = _defaults(root, actuator.tag)
            own = actuator.attributes
            said = {**given.get(own.get("class", MAIN), {}), **own}
            if joint and joint in (said.get("joint"), said.get("jointinparent")):
                for name in OF_ACTUATORS:
                    text = " ".join(said.get(name, "").split())
                    if text.replace("0", "").strip(" .+-"):
                        yield f"{actuator.tag} {name} {shortened(text, 60)}"


def _refuse_includes(element: _Element, path: str | os.PathLike[str]) -> None:
    for child in element.children:
        if child.tag == "include":
            raise InputError(
                f"{path}: includes another file, which is not read; give one file that holds all, "
                "as mujoco.mj_saveLastXML writes it"
            )
        _refuse_includes(child, path)


def _chosen(joints: list[_Joint], path: str | os.PathLike[str], name: str | None) -> _Joint:
    if not joints:
        raise InputError(f"{path}: has no joint that moves; give a file with one")
    names = [joint.name for joint in joints if joint.name]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise InputError(f"{path}: has two joints of the name '{twice[0]}'; rename one")
    if name is None:  # what slides or floats is not meant
        joints = [joint for joint in joints if joint.kind in ROTARY] or joints
        if len(joints) > 1:
            said = listed(joint.name or "an unnamed one" for joint in joints)
            raise InputError(f"{path}: has several joints; say which (--model-joint): {said}")
    found = [joint for joint in joints if name in (None, joint.name)]
    if not found:
        near = did_you_mean(str(name), names)
        raise InputError(
            f"{path}: has no joint '{name}'{near}; give one that it has (--model-joint): "
            f"{listed(names)}"
        )
    (joint,) = found
    if joint.kind not in ROTARY:
        raise InputError(
            f"{path}: the joint '{joint.name}' is of the type '{joint.kind}', and flexspline has "
            f"those that turn; give one of {listed(ROTARY)}"
        )
    return joint


def _numbers(
    joint: _Joint, by_actuators: Sequence[str], path: str | os.PathLike[str]
) -> JointNumbers:
    read = {name: _parsed(joint, name, path) for name in OF_MJCF}
    left_out: tuple[str, ...] = ()
    if by_actuators:
        left_out = (
            f"{path}: joint '{joint.name}': what its actuators add to it is left out "
            f"({shortened(listed(by_actuators), 300)}); let discover find it in runs, or fit its "
            "effects",
        )
    if any(read[SPRING]):
        left_out += (
            f"{path}: joint '{joint.name}': its spring ({SPRING} {joint.numbers[SPRING]}, {REST} "
            f"{joint.numbers.get(REST, '0')}) is left out: no effect pulls a joint to an angle; "
            "where one does, write it as your own (own_effect)",
        )
    return JointNumbers(
        joint.name, read["armature"][0], read["damping"], read["friction"][0], left_out
    )


def _parsed(joint: _Joint, name: str, path: str | os.PathLike[str]) -> tuple[float, ...]:
    text = joint.numbers.get(name, "0")
    called, most = joint.called.get(name, name), MOST.get(name, 1)
    where = f"{path}: joint '{joint.name}': {called} = '{shortened(text, 60)}'"
    try:
        if "_" in text:  # Python's own, in no file
            raise ValueError
        values = tuple(float(word) for word in text.split())
    except ValueError as error:
        raise InputError(f"{where} is no number; correct the file") from error
    if not 1 <= len(values) <= most or not all(map(math.isfinite, values)):
        wanted = "a finite number" if most == 1 else f"one to {most} finite numbers"
        raise InputError(f"{where} is not {wanted}; correct the file")
    if values[0] < 0.0 and name not in (SPRING, REST):
        raise InputError(f"{where} is negative, which no joint has; correct the file")
    return values
