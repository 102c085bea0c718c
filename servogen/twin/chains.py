"""An arm, or a base on omni wheels, as MJCF: beside the hexapod's legs, which are in `bodies`.

In: a scene and the robot. Out: elements that are added to the scene, what was assumed, and the mass.

    arm         each DH row with a joint is a body whose frame stands at a point of the joint's axis and is
                parallel to the base's while all joints are at 0
    omni wheel  a short capsule on an axle that points outwards. MuJoCo aligns the contact of a capsule and a
                plane with the capsule's axis: friction acts along the rolling direction, the rollers have
                none along the axle
"""

from __future__ import annotations

from math import cos, radians, sin
from xml.etree import ElementTree as xml

import numpy as np

from servogen.errors import InputError
from servogen.kinematics.forward import link_frames, row_axes
from servogen.kinematics.omni import OmniBase
from servogen.robot.model import Arm
from servogen.twin.mjcf import CONTACT, STIFF, Scene, add_joint, numbers

ASSUMED_LINK_KG = 0.01
"""The mass of a link whose joint states none."""

ASSUMED_BASE_KG = 1.0

WHEELS_DEG = (60.0, 300.0, 180.0)
"""The directions of wheels 1, 2 and 3 (`kinematics.omni`)."""

ROLLER_FRICTION = 0.001
"""The friction along a wheel's axle, where its rollers turn freely; MuJoCo refuses 0."""

WHEEL_HALF_M = 0.002
LINK_INERTIA_M = 0.01
"""The radius of gyration of a link, whose mass is concentrated at its centre."""


def add_arm(scene: Scene, arm: Arm) -> tuple[list[str], float]:
    """Add an arm on its base; where any of its joints has a servo, those without one are held."""
    payload = scene.variation.payload
    zeros = np.zeros(len(arm.joints))
    axes, tool = row_axes(arm, zeros)
    frames = link_frames(arm, zeros)
    rows = [index for index, row in enumerate(arm.rows) if row.joint is not None]
    assumptions, total = [], 0.0
    equality = xml.SubElement(scene.root, "equality")
    parent, here, owned = scene.world, np.zeros(3), set[int]()
    unstated = [joint.name for joint in arm.joints if not joint.mass]
    if unstated:
        assumptions.append(
            f"links of {', '.join(unstated)}: {1000 * ASSUMED_LINK_KG:g} g each (without mass_g)"
        )
    for number, (axis, row) in enumerate(zip(axes, rows, strict=True)):
        index = axis.row.joint
        assert index is not None
        joint = arm.joints[index]
        kind = "hinge" if joint.turning else "slide"
        body = xml.SubElement(
            parent, "body", {"name": f"link{number + 1}", "pos": numbers(*(axis.point - here))}
        )
        if index in owned:
            name = f"{joint.name}_{number + 1}"
            add_joint(scene, body, name, axis.direction.tolist(), 1.0, 0.0, kind)
            xml.SubElement(
                equality,
                "joint",
                {"joint1": name, "joint2": joint.name, "polycoef": f"0 {axis.row.ratio:g} 0 0 0", **STIFF},
            )
        else:
            owned.add(index)
            direction = (axis.direction * axis.row.ratio).tolist()
            add_joint(scene, body, joint.name, direction, joint.lower, joint.upper, kind)
            if scene.actuators and scene.servo_of(joint.name) is None:
                xml.SubElement(
                    equality,
                    "joint",
                    {"joint1": joint.name, "polycoef": f"{joint.home:.9g} 0 0 0 0", **STIFF},
                )
                assumptions.append(f"{joint.name} has no servo and is held at its home position")
            end = axes[number + 1].point if number + 1 < len(axes) else tool[:3, 3]
            centre = (axis.point + end) / 2
            mass = ASSUMED_LINK_KG
            if joint.mass:
                mass = joint.mass
                centre = frames[row + 1, :3, :3] @ np.array(joint.centre) + frames[row + 1, :3, 3]
            _lump(body, centre - axis.point, mass)
            total += mass
        parent, here = body, axis.point
    carried = arm.payload if payload is None else payload
    xml.SubElement(parent, "site", {"name": "tool", "pos": numbers(*(tool[:3, 3] - here))})
    if carried:
        load = xml.SubElement(parent, "body", {"name": "payload", "pos": numbers(*(tool[:3, 3] - here))})
        _lump(load, np.zeros(3), carried)
    return assumptions, total + carried


def add_omni(scene: Scene, base: OmniBase) -> tuple[list[str], float]:
    """Add a base on three omni wheels. Raises InputError for ground that is not a plane."""
    ground = scene.ground
    if ground.rough or ground.step:
        raise InputError("wrong-robot-kind", f"{base.name}: its wheels are modelled on a plane only")
    assumptions: list[str] = []
    mass = base.mass
    if mass is None:
        mass = ASSUMED_BASE_KG
        assumptions.append(f"mass of the robot: {mass:g} kg (its file states no mass_g)")
    radius, out = base.wheel_radius, base.wheel_distance
    assumptions.append("the base is a disc, 5 % of its mass in each wheel; its rollers turn without friction")
    wheel = 0.05 * mass
    rest = mass - 3 * wheel
    body = xml.SubElement(scene.world, "body", {"name": "body", "pos": f"0 0 {radius:.9g}"})
    xml.SubElement(body, "freejoint", {"name": "body"})
    turning, tilting = rest * out**2 / 2, rest * out**2 / 4
    xml.SubElement(
        body,
        "inertial",
        {"pos": "0 0 0", "mass": numbers(rest), "diaginertia": numbers(tilting, tilting, turning)},
    )
    contact = xml.SubElement(scene.root, "contact")
    for number, degrees in enumerate(WHEELS_DEG, 1):
        axle = (cos(radians(degrees)), sin(radians(degrees)), 0.0)
        place = [out * part for part in axle]
        hub = xml.SubElement(body, "body", {"name": f"wheel{number}", "pos": numbers(*place)})
        add_joint(scene, hub, f"wheel{number}", axle, 1.0, 0.0, "hinge")
        half = [WHEEL_HALF_M * part for part in axle]
        xml.SubElement(
            hub,
            "geom",
            {
                "name": f"wheel{number}",
                "type": "capsule",
                "fromto": numbers(*(-part for part in half), *half),
                "size": numbers(radius),
                "mass": numbers(wheel),
                "contype": "0",
                "conaffinity": "0",
            },
        )
        xml.SubElement(
            contact,
            "pair",
            {
                "geom1": "ground",
                "geom2": f"wheel{number}",
                "condim": "3",
                "friction": numbers(ROLLER_FRICTION, ground.friction, 1e-5, 1e-5, 1e-5),
                **CONTACT,
            },
        )
    return assumptions, mass


def _lump(body: xml.Element, centre: np.ndarray[tuple[int], np.dtype[np.float64]], mass: float) -> None:
    inertia = mass * LINK_INERTIA_M**2
    xml.SubElement(
        body,
        "inertial",
        {"pos": numbers(*centre), "mass": numbers(mass), "diaginertia": numbers(*[inertia] * 3)},
    )
