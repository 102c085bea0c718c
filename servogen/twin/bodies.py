"""A robot as bodies, joints and shapes for MuJoCo: `Robot` -> MJCF text, and what was assumed.

In: a robot of the catalogue or of a file, the ground, the actuators of its joints. Out: `Bodies`. The XML is
written without MuJoCo, so that anybody can export it.

    pantograph (left)   body ─ α about z ─ coxa ─ β about y' ─ thigh ─ (spring E' along y') ─ foot part
                        The slider mechanism keeps the foot part vertical: a joint at C turns back what β
                        turns, by an equality constraint.
    hip-lift            body ─ hip about z ─ coxa ─ lift about x' ─ femur and tibia
    coxa-femur-tibia    body ─ coxa about z ─ coxa ─ femur about x' ─ femur ─ tibia about x' ─ tibia
    A right leg is the mirror image: y' points to the right, z and x' axes turn the other way.

    arm             each DH row with a joint is a body whose frame stands at a point of the joint's axis and
                    is parallel to the base's while all joints are at 0
    omni wheel      a short capsule on an axle that points outwards. MuJoCo aligns the contact of a capsule
                    and a plane with the capsule's axis: friction acts along the rolling direction, the
                    rollers have none along the axle
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from servogen.errors import InputError
from servogen.kinematics.forward import link_frames, row_axes
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.leg import Leg
from servogen.kinematics.omni import OmniBase
from servogen.motion.loads import MIN_LEGS
from servogen.robot.model import Arm, Robot
from servogen.twin.ground import Ground
from servogen.twin.mjcf import (
    CONTACT,
    ROBOT_BITS,
    STEP_S,
    STIFF,
    Actuator,
    Scene,
    Variation,
    add,
    add_actuators,
    add_joint,
    add_rod,
    document,
    leg_bits,
    numbers,
)

ASSUMED_MASS_KG = 0.64
"""The mass of a hexapod of twelve joints whose file states none: twelve servos of 17 g, and twice as much for
the rest; in proportion for other numbers of joints.
"""

ASSUMED_SHARES = {"coxa": 0.03, "thigh": 0.01, "foot": 0.01, "femur": 0.01, "tibia": 0.01}
"""The shares of the total mass in the parts of each leg: the coxa carries a servo."""

FOOT_RADIUS_M = 0.003
BODY_HEIGHT_M = 0.03
"""The radius of a foot's ball and the height of the trunk's box: robot files state neither."""

SPRING_DAMPING = 0.5
"""The damping of a leg's spring as a share of the critical one, assumed: the spring does not ring."""

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


Place = tuple[float, float, float]
Point = np.ndarray[tuple[int], np.dtype[np.float64]]


@dataclass(frozen=True, slots=True)
class Bodies:
    """MJCF text, and the assumptions behind it, one sentence each."""

    text: str
    assumptions: tuple[str, ...]
    mass: float


def _add_hexapod(scene: Scene, robot: Hexapod) -> tuple[list[str], float]:
    """Add the body and its legs; return what was assumed, and the total mass."""
    variation, held_at = scene.variation, scene.held_at
    assumptions: list[str] = []
    total = robot.mass
    if total is None:
        total = ASSUMED_MASS_KG * len(robot.mounts) * len(robot.leg.joints) / 12
        assumptions.append(f"mass of the robot: {total:.3g} kg (its file states no mass_g)")
    masses = dict(robot.leg_masses)
    missing = [part for part in robot.leg_kind.parts if part not in masses]
    if missing:
        masses |= {part: ASSUMED_SHARES[part] * total for part in missing}
        shown = ", ".join(f"{part} {1000 * masses[part]:.3g} g" for part in missing)
        assumptions.append(f"masses of each leg: {shown} (its file does not state them in leg_mass_g)")
    trunk = total - len(robot.mounts) * sum(masses.values())
    if trunk <= 0:
        raise InputError(
            "out-of-range",
            f"the legs of {robot.name} weigh more than its mass_g of {1000 * total:g}",
            hint="leg_mass_g is for each leg, mass_g for the whole robot",
        )
    centre = _trunk_centre(robot, masses, total, trunk) + np.array([*variation.centre_offset, 0.0])
    if robot.spring is None and robot.leg_kind.name == "pantograph":
        assumptions.append("springs E': rigid (the robot's file states no spring_n_m)")
    held = len(robot.mounts) < MIN_LEGS
    body = add(scene.world, "body", name="body", pos=numbers(0.0, 0.0, held_at if held else 0.0))
    if held:
        assumptions.append(f"the body is held at {1000 * held_at:.4g} mm: it has too few legs to stand")
    else:
        add(body, "freejoint", name="body")
    half = [max(abs(getattr(mount, axis)) for mount in robot.mounts) for axis in ("x", "y")]
    half = [max(value, 0.01) for value in half]
    inertia = [
        trunk / 3 * (across**2 + along**2)
        for across, along in (
            (half[1], BODY_HEIGHT_M / 2),
            (half[0], BODY_HEIGHT_M / 2),
            (half[0], half[1]),
        )
    ]
    add(body, "inertial", pos=numbers(*centre), mass=numbers(trunk), diaginertia=numbers(*inertia))
    assumptions.append("the body is a homogeneous box around the mounts, links are rods")
    add(
        body,
        "geom",
        name="body",
        type="box",
        size=numbers(half[0], half[1], BODY_HEIGHT_M / 2),
        friction=numbers(scene.ground.friction, 0.0, 0.0),
        mass="0",
        **ROBOT_BITS,
    )
    equality, sensors = add(scene.root, "equality"), add(scene.root, "sensor")
    for index, mount in enumerate(robot.mounts):
        factor = variation.foot_friction[index] if variation.foot_friction else 1.0
        hip = add(
            body,
            "body",
            name=f"{mount.name}_{robot.leg_kind.parts[0]}",
            pos=numbers(mount.x, mount.y, mount.z),
            euler=numbers(0.0, 0.0, mount.heading),
        )
        if robot.leg_kind.name == "pantograph":
            foot = _pantograph(scene, hip, equality, robot, index, masses)
        else:
            foot = _serial(scene, hip, robot, index, masses)
        _add_foot(foot, mount.name, factor * scene.ground.friction, index)
        add(sensors, "touch", name=f"{mount.name}_touch", site=f"{mount.name}_foot")
    return assumptions, total


def _trunk_centre(robot: Hexapod, masses: Mapping[str, float], total: float, trunk: float) -> Point:
    """Return where the trunk's centre of mass must be for the whole robot's to be where its file says.

    All joints of the legs are at 0.
    """
    moment = np.zeros(3)
    for index in range(len(robot.mounts)):
        corners = robot.corners(index, np.zeros((1, len(robot.leg.joints))))[0]
        for part, (first, last) in zip(robot.leg_kind.parts, robot.leg_kind.rods, strict=True):
            moment += masses[part] * (corners[first] + corners[last]) / 2
    return np.asarray((total * np.array(robot.centre_of_mass) - moment) / trunk)


def _pantograph(
    scene: Scene,
    coxa: xml.Element,
    equality: xml.Element,
    robot: Hexapod,
    index: int,
    masses: Mapping[str, float],
) -> tuple[xml.Element, Place]:
    """Add the rest of the lab's leg to its coxa; return its foot part, and where its end is on it."""
    leg, mount, bits = Leg.of(robot.leg.length), robot.mounts[index], leg_bits(index)
    side, name = -1.0 if mount.mirrored else 1.0, mount.name
    alpha, beta = (f"{name}_{joint.name}" for joint in robot.leg.joints)
    add_joint(scene, coxa, alpha, (0.0, 0.0, side), robot.leg.joints[0].lower, robot.leg.joints[0].upper)
    add_rod(coxa, (0.0, 0.0, 0.0), (0.0, side * leg.ab, 0.0), masses["coxa"], bits)
    thigh = add(coxa, "body", name=f"{name}_thigh", pos=numbers(0.0, side * leg.ab, 0.0))
    add_joint(scene, thigh, beta, (0.0, 1.0, 0.0), robot.leg.joints[1].lower, robot.leg.joints[1].upper)
    add_rod(thigh, (0.0, 0.0, 0.0), (0.0, 0.0, -leg.bc), masses["thigh"], bits)
    foot = add(thigh, "body", name=f"{name}_foot", pos=numbers(0.0, side * leg.cd, -leg.bc))
    add(foot, "joint", name=f"{name}_level", type="hinge", axis="0 1 0")
    if robot.spring is not None:
        add(
            foot,
            "joint",
            name=f"{name}_spring",
            type="slide",
            axis=numbers(0.0, side, 0.0),
            stiffness=numbers(robot.spring),
            damping=numbers(2 * SPRING_DAMPING * math.sqrt(robot.spring * masses["foot"])),
        )
    add_rod(foot, (0.0, 0.0, 0.0), (0.0, 0.0, -leg.df), masses["foot"], bits)
    add(equality, "joint", joint1=f"{name}_level", joint2=beta, polycoef="0 -1 0 0 0", **STIFF)
    return foot, (0.0, 0.0, -leg.df)


def _serial(
    scene: Scene, hip: xml.Element, robot: Hexapod, index: int, masses: Mapping[str, float]
) -> tuple[xml.Element, Place]:
    """Add the rest of a leg of the field to its coxa; return the part with the foot, and where that is on it.

    Where a joint has the whole rest of the leg, its parts are one body.
    """
    mount = robot.mounts[index]
    side = -1.0 if mount.mirrored else 1.0
    corners = robot.leg_kind.corners(robot.leg, np.zeros((1, len(robot.leg.joints))))[0] * [1.0, side, 1.0]
    parts, body, origin = robot.leg_kind.parts, hip, corners[0]
    axes = [(0.0, 0.0, side), *[(side, 0.0, 0.0)] * (len(robot.leg.joints) - 1)]
    for number, part in enumerate(parts):
        if number < len(axes):
            if number:
                place = numbers(*(corners[number] - origin))
                body, origin = add(body, "body", name=f"{mount.name}_{part}", pos=place), corners[number]
            joint = robot.leg.joints[number]
            add_joint(scene, body, f"{mount.name}_{joint.name}", axes[number], joint.lower, joint.upper)
        add_rod(body, corners[number] - origin, corners[number + 1] - origin, masses[part], leg_bits(index))
    x, y, z = (corners[-1] - origin).tolist()
    return body, (x, y, z)


def _add_foot(foot: tuple[xml.Element, Place], name: str, friction: float, index: int) -> None:
    """Add the ball at the end of a leg that touches the ground, and its switch."""
    part, (x, y, z) = foot
    tip = numbers(x, y, z + FOOT_RADIUS_M)
    add(
        part,
        "geom",
        name=f"{name}_tip",
        type="sphere",
        size=numbers(FOOT_RADIUS_M),
        pos=tip,
        friction=numbers(friction, 0.0, 0.0),
        mass="0",
        **leg_bits(index, ground=True),
    )
    add(part, "site", name=f"{name}_foot", pos=tip, size=numbers(2 * FOOT_RADIUS_M))


def _add_arm(scene: Scene, arm: Arm) -> tuple[list[str], float]:
    """Add an arm on its base; where any of its joints has a servo, those without one are held.

    Raises InputError for a joint whose first row does not move as far as the joint.
    """
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
        end = axes[number + 1].point if number + 1 < len(axes) else tool[:3, 3]
        centre, mass = (axis.point + end) / 2, ASSUMED_LINK_KG
        if index in owned:
            name = f"{joint.name}_{number + 1}"
            add_joint(scene, body, name, axis.direction.tolist(), 1.0, 0.0, kind)
            xml.SubElement(
                equality,
                "joint",
                {"joint1": name, "joint2": joint.name, "polycoef": f"0 {axis.row.ratio:g} 0 0 0", **STIFF},
            )
            assumptions.append(
                f"the link that follows {joint.name} has {1000 * ASSUMED_LINK_KG:g} g in addition"
            )
        else:
            owned.add(index)
            if abs(axis.row.ratio) != 1:  # MuJoCo's axes have no length
                raise InputError(
                    "wrong-robot-kind",
                    f"{arm.name}: {joint.name} moves its first row by {axis.row.ratio:g} times its position: "
                    "bodies are modelled for 1 and -1",
                )
            direction = (axis.direction * axis.row.ratio).tolist()
            add_joint(scene, body, joint.name, direction, joint.lower, joint.upper, kind)
            if scene.actuators and scene.joint_actuator(joint.name) is None:
                xml.SubElement(
                    equality,
                    "joint",
                    {"joint1": joint.name, "polycoef": f"{joint.home:.9g} 0 0 0 0", **STIFF},
                )
                assumptions.append(f"{joint.name} has no servo and is held at its home position")
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


def _add_omni(scene: Scene, base: OmniBase) -> tuple[list[str], float]:
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
        axle = (math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0)
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


MODELS: Mapping[str, Callable[[Scene, Any], tuple[list[str], float]]] = MappingProxyType(
    {Arm.kind: _add_arm, Hexapod.kind: _add_hexapod, OmniBase.kind: _add_omni}
)
"""By kind of robot, the function that adds bodies to a scene and returns the assumptions and the mass."""


def bodies(
    robot: Robot,
    actuators: Sequence[Actuator] = (),
    ground: Ground = Ground(),  # noqa: B008 - frozen
    variation: Variation = Variation(),  # noqa: B008 - frozen
    step_s: float = STEP_S,
    held_at: float = 0.0,
) -> Bodies:
    """Return a robot as MJCF; one of one or two legs is held with its body at the height `held_at`.

    Raises InputError for a robot of a kind whose bodies are not modelled.
    """
    add_bodies = MODELS.get(robot.kind)
    if add_bodies is None:
        raise InputError(
            "wrong-robot-kind",
            f"{robot.name} is of the kind '{robot.kind}': its bodies are not modelled",
            hint=f"bodies are modelled for the kinds {', '.join(MODELS)}",
        )
    root, world = document(robot.name, ground, step_s)
    scene = Scene(root, world, ground, actuators, variation, held_at)
    assumptions, mass = add_bodies(scene, robot)
    add_actuators(scene)
    xml.indent(root)
    return Bodies(xml.tostring(root, encoding="unicode") + "\n", tuple(assumptions), mass)
