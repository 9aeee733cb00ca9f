"""A model as the joint of a URDF: damping, friction and limits."""

from __future__ import annotations

from collections.abc import Iterator

from flexspline.exporting.plain_joint import DAMPING, FRICTION, PlainJoint, heading
from flexspline.exporting.xml_text import attributes, comment

__all__ = ["urdf_text"]

NUMBERS = ((DAMPING, 0), (FRICTION, 0))
PARENT, CHILD = "base_link", "link"


def urdf_text(joint: PlainJoint) -> str:
    """Return a URDF with one joint between two links, and above it what it leaves out."""
    dynamics = [("damping", repr(joint.damping[0])), ("friction", repr(joint.friction))]
    limits = _limits(joint)
    turns = joint.position is None or not limits
    named = [("name", joint.name), ("type", "continuous" if turns else "revolute")]
    return "\n".join(
        [
            f"<robot {attributes([('name', joint.name)])}>",
            comment(_said(joint, turns), "  "),
            f'  <link name="{PARENT}"/>',
            f'  <link name="{CHILD}"/>',
            f"  <joint {attributes(named)}>",
            f'    <parent link="{PARENT}"/>',
            f'    <child link="{CHILD}"/>',
            '    <axis xyz="0 0 1"/>',
            f"    <dynamics {attributes(dynamics)}/>",
            *([f"    <limit {attributes(limits)}/>"] if limits else []),
            "  </joint>",
            "</robot>",
            "",
        ]
    )


def _limits(joint: PlainJoint) -> list[tuple[str, str]]:
    """Attributes of the limits; none where effort or velocity is not known, for both are needed."""
    if joint.effort is None or joint.velocity is None:
        return []
    ends = () if joint.position is None else zip(("lower", "upper"), joint.position, strict=True)
    beside = (("effort", joint.effort), ("velocity", joint.velocity))
    return [(name, repr(value)) for name, value in (*ends, *beside)]


def _said(joint: PlainJoint, turns: bool) -> Iterator[str]:
    yield from heading(joint, "URDF", {DAMPING: "damping", FRICTION: "friction"})
    yield ""
    if _limits(joint):
        yield "The limits are what the model was fitted to and not those of the motor: the largest"
        yield "speed, and the largest torque of the model in its ranges, known load included."
    else:
        yield "There are no limits: the model has no range of its speed, or of a channel that its"
        yield "torque depends on."
    if turns:
        yield "The joint is continuous, for its angle has no limits here."
    if joint.friction:
        yield "What friction is at standstill is for the simulator to say."
