"""A planar arm of two links by hand, its motion, and the same arm as a URDF."""

from __future__ import annotations

import numpy as np

LENGTHS, MASSES, GRAVITY = (0.4, 0.3), (3.0, 2.0), 9.81


def two_link(angle, speed):
    """M, C (Christoffel) and g of two uniform slender rods, angles from the horizontal."""
    (l1, l2), (m1, m2) = LENGTHS, MASSES
    a, first, second = m2 * l1 * l2 / 2, m1 * l1**2 / 3 + m2 * l1**2, m2 * l2**2 / 3
    cosine, sine = np.cos(angle[:, 1]), np.sin(angle[:, 1])
    mass = np.empty((len(angle), 2, 2))
    mass[:, 0, 0] = first + second + 2 * a * cosine
    mass[:, 0, 1] = mass[:, 1, 0] = second + a * cosine
    mass[:, 1, 1] = second
    coriolis = np.zeros_like(mass)
    coriolis[:, 0, 0] = -a * sine * speed[:, 1]
    coriolis[:, 0, 1] = -a * sine * (speed[:, 0] + speed[:, 1])
    coriolis[:, 1, 0] = a * sine * speed[:, 0]
    return mass, coriolis, gravity_free(angle)


def gravity_free(angle):
    """The torque g(q) that holds the arm against gravity."""
    (l1, l2), (m1, m2) = LENGTHS, MASSES
    outer = m2 * l2 / 2 * np.cos(angle.sum(axis=1))
    return GRAVITY * np.stack([(m1 / 2 + m2) * l1 * np.cos(angle[:, 0]) + outer, outer], axis=1)


def motion(duration, rate):
    """Time, q, q̇, q̈ of a smooth motion of both joints."""
    time = np.arange(0.0, duration, 1.0 / rate)
    w = 1.7
    angle = np.stack([np.sin(time), 0.7 * np.cos(w * time)], axis=1)
    speed = np.stack([np.cos(time), -0.7 * w * np.sin(w * time)], axis=1)
    acceleration = np.stack([-np.sin(time), -0.7 * w**2 * np.cos(w * time)], axis=1)
    return time, angle, speed, acceleration


def urdf():
    """The arm about the y axis, which turns x downwards: the axis is −y."""
    links, joints, at = ['<link name="base"/>'], [], 0.0
    for k, (length, mass) in enumerate(zip(LENGTHS, MASSES, strict=True), start=1):
        inertia = mass * length**2 / 12
        links.append(
            f'<link name="l{k}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
            f'<inertia ixx="0" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>'
            "</inertial></link>"
        )
        parent = "base" if k == 1 else f"l{k - 1}"
        joints.append(
            f'<joint name="j{k}" type="continuous"><parent link="{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{at} 0 0"/><axis xyz="0 -1 0"/></joint>'
        )
        at = length
    return f'<robot name="two_link">{"".join(links)}{"".join(joints)}</robot>'
