"""A model as the joint of a MuJoCo model: armature, damping, frictionloss and stiffness.

MuJoCo 4 has an actuator `dcmotor` too, with back-EMF, cogging and LuGre friction. It is not
written: it takes volts through the constant and the resistance of a winding, which no model here
has, and its cogging has one order of the joint's angle, not those of the motor's.
"""

from __future__ import annotations

from collections.abc import Iterator

from flexspline.exporting.plain_joint import (
    ARMATURE,
    DAMPING,
    FRICTION,
    PlainJoint,
    heading,
)
from flexspline.exporting.xml_text import attributes, comment

__all__ = ["mjcf_text"]

NUMBERS = ((ARMATURE, 0), (DAMPING, 0), (DAMPING, 1), (DAMPING, 2), (FRICTION, 0))


def mjcf_text(joint: PlainJoint) -> str:
    """Return an MJCF file with one hinge joint, and above it what its attributes leave out."""
    element = attributes(
        [
            ("name", joint.name),
            ("type", "hinge"),
            ("axis", "0 0 1"),
            ("armature", repr(joint.armature)),
            ("damping", " ".join(map(repr, joint.damping))),
            ("frictionloss", repr(joint.friction)),
            ("stiffness", "0"),
        ]
    )
    inertial = attributes(
        [("pos", "0 0 0"), ("mass", "0.001"), ("diaginertia", "1e-09 1e-09 1e-09")]
    )
    return "\n".join(
        [
            f"<mujoco {attributes([('model', joint.name)])}>",
            comment(_said(joint), "  "),
            '  <compiler angle="radian"/>',
            "  <worldbody>",
            "    <body>",
            f"      <inertial {inertial}/>",
            f"      <joint {element}/>",
            "    </body>",
            "  </worldbody>",
            "</mujoco>",
            "",
        ]
    )


def _said(joint: PlainJoint) -> Iterator[str]:
    yield from heading(
        joint, "MJCF", {ARMATURE: "armature", DAMPING: "damping", FRICTION: "frictionloss"}
    )
    yield ""
    yield "The line of the joint can be copied into a model of yours; the body here has next to"
    yield "no inertia. The armature is all inertia that the model found: where your link has its"
    yield "own, take that off."
    if len(joint.damping) > 1:
        yield "damping has the numbers of v, v|v| and v^3, which MuJoCo 4 knows; for an older one"
        yield "leave all but the first, and the nonlinear part is lost."
    if joint.friction:
        yield "frictionloss is a soft constraint and not the level times sgn(v): under a load below"
        yield "the level the joint creeps, and it has the level itself only above a speed, which is"
        yield "about 0.011 s times frictionloss over all inertia with MuJoCo's default solver, and"
        yield "more where damping is strong."
    yield "stiffness: no effect of the model pulls the joint back to an angle."
