"""The parts of a robot's model for MuJoCo: the document, joints with their servos, rods -> MJCF elements.

In: a `Scene`. Out: elements that are added to it. MuJoCo itself is not needed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from xml.etree import ElementTree as xml

from servogen.kinematics.statics import GRAVITY
from servogen.twin.ground import ROUGH_HALF_M, Ground

STEP_S = 0.001
"""The step of the physics in seconds."""

LINK_RADIUS_M = 0.006
"""The radius of a link: robot files state none."""

ROBOT_BITS, GROUND_BITS = {"contype": "1", "conaffinity": "0"}, {"contype": "0", "conaffinity": "1"}
"""Collision bits: parts of the robot collide with the ground; legs with each other, too (`leg_bits`)."""

NO_BITS = {"contype": "0", "conaffinity": "0"}


def leg_bits(index: int, *, ground: bool = False) -> dict[str, str]:
    """Return the collision bits of a leg's parts: they meet those of other legs, and the ground if asked."""
    own = 4 << index % 28
    return {"contype": str(own + ground), "conaffinity": str(0x7FFFFFFC & ~own)}


CONTACT = {"solref": "0.004 1", "solimp": "0.95 0.99 0.0005"}
"""Contact parameters with which the oracles of docs/twin.md pass at steps of 1 ms (impratio 10)."""

STIFF = {"solref": "0.002 1", "solimp": "0.99 0.999 0.0001"}
"""Parameters of equality constraints: the shortest time constant that a step of 1 ms can follow."""


@dataclass(frozen=True, slots=True)
class Actuator:
    """What turns one joint: `ratio` is the servo's radians per unit of the joint's position.

    `lower` and `upper` are the joint's positions at the servo's stops; `friction` (N·m) and `armature`
    (kg m²) act at the servo's shaft, `backlash` (radians of the shaft) lies behind its gear.
    """

    name: str
    joint: str
    ratio: float
    lower: float
    upper: float
    friction: float = 0.0
    armature: float = 0.0
    backlash: float = 0.0


@dataclass(frozen=True, slots=True)
class Variation:
    """Deviations of one specimen: the factor of each foot's friction, an offset of the body's centre of mass
    in metres, what an arm's tool carries in kg (None: as the robot's file says).
    """

    foot_friction: tuple[float, ...] = ()
    centre_offset: tuple[float, float] = (0.0, 0.0)
    payload: float | None = None


@dataclass(frozen=True, slots=True)
class Scene:
    """What the bodies of a robot are added to, and the conditions under which they are.

    `actuators` without entries leaves every joint free. A robot of one or two legs is held with its body at
    the height `held_at`.
    """

    root: xml.Element
    world: xml.Element
    ground: Ground
    actuators: Sequence[Actuator] = ()
    variation: Variation = Variation()
    held_at: float = 0.0

    def joint_actuator(self, joint: str) -> Actuator | None:
        """Return what turns a joint, several servos as if they were one; None if none does."""
        group = [actuator for actuator in self.actuators if actuator.joint == joint]
        if not group:
            return None
        return replace(
            group[0],
            lower=max(each.lower for each in group),
            upper=min(each.upper for each in group),
            friction=sum(each.friction for each in group),
            armature=sum(each.armature for each in group),
            backlash=min(each.backlash for each in group),
        )


def document(name: str, ground: Ground, step_s: float = STEP_S) -> tuple[xml.Element, xml.Element]:
    """Return an MJCF document with its options and the ground, and its world."""
    root = xml.Element("mujoco", model=name)
    add(root, "compiler", angle="radian", autolimits="true")
    gravity = (-GRAVITY * math.sin(ground.slope), 0.0, -GRAVITY * math.cos(ground.slope))
    add(
        root,
        "option",
        timestep=numbers(step_s),
        gravity=numbers(*gravity),
        integrator="implicitfast",
        cone="elliptic",
        impratio="10",
    )
    # MuJoCo takes the greater friction of two shapes that touch. The ground's is on the feet, each of which
    # may deviate from it, so that all others must have none.
    default = add(root, "default")
    add(default, "geom", condim="3", friction="0 0 0", **CONTACT)
    world = add(root, "worldbody")
    if ground.rough:
        heights = ground.heights()
        asset = add(root, "asset")
        add(
            asset,
            "hfield",
            name="rough",
            nrow=str(len(heights)),
            ncol=str(len(heights)),
            size=numbers(ROUGH_HALF_M, ROUGH_HALF_M, ground.rough, 0.1),
            elevation=" ".join(f"{height:.6g}" for height in (heights / ground.rough).ravel()),
        )
        add(world, "geom", name="ground", type="hfield", hfield="rough", **GROUND_BITS)
    else:
        add(world, "geom", name="ground", type="plane", size="0 0 1", **GROUND_BITS)
    if ground.step:
        add(
            world,
            "geom",
            name="step",
            type="box",
            pos=numbers(ground.step_at + 2.0, 0.0, ground.step / 2 - 0.5),
            size=numbers(2.0, 4.0, ground.step / 2 + 0.5),
            **GROUND_BITS,
        )
    return root, world


def add_joint(
    scene: Scene,
    body: xml.Element,
    name: str,
    axis: Sequence[float],
    lower: float,
    upper: float,
    kind: str = "hinge",
) -> None:
    """Add a joint that a servo turns; its backlash is a second joint that only its limits hold."""
    servo = scene.joint_actuator(name)
    extra: dict[str, str] = {}
    if servo is not None:
        if lower < upper:
            lower, upper = max(lower, servo.lower), min(upper, servo.upper)
        # Seen from the joint, the shaft's inertia counts with the square of the ratio, its friction with the
        # ratio itself.
        if servo.armature:
            extra["armature"] = numbers(servo.armature * servo.ratio**2)
        if servo.friction:
            extra["frictionloss"] = numbers(servo.friction * abs(servo.ratio))
            extra["solreffriction"] = "0.002 1"
            extra["solimpfriction"] = ".9999 .9999 .001"
    limits = {"range": numbers(lower, upper)} if lower < upper else {}
    add(
        body,
        "joint",
        name=name,
        type=kind,
        axis=numbers(*axis),
        solreflimit="0.004 1",
        **limits,
        **extra,
    )
    if servo is not None and servo.backlash:
        half = servo.backlash / abs(servo.ratio) / 2
        add(
            body,
            "joint",
            name=f"{name}_play",
            type=kind,
            axis=numbers(*axis),
            range=numbers(-half, half),
            solreflimit="0.004 1",
        )


def add_rod(
    body: xml.Element,
    start: Sequence[float],
    end: Sequence[float],
    mass: float,
    bits: Mapping[str, str] = MappingProxyType(NO_BITS),
) -> None:
    """Add a rod with a mass that touches what its bits say, by default nothing; a short one is a ball."""
    radius = {"size": numbers(LINK_RADIUS_M), "mass": numbers(mass)}
    if math.dist(start, end) < 2 * LINK_RADIUS_M:
        middle = [(begin + stop) / 2 for begin, stop in zip(start, end, strict=True)]
        add(body, "geom", type="sphere", pos=numbers(*middle), **radius, **bits)
    else:
        add(body, "geom", type="capsule", fromto=numbers(*start, *end), **radius, **bits)


def add_actuators(scene: Scene) -> None:
    """Add the servos: force = gain · control + bias, set by the motor's constants when it runs."""
    if not scene.actuators:
        return
    section = add(scene.root, "actuator")
    for actuator in scene.actuators:
        add(
            section,
            "general",
            name=actuator.name,
            joint=actuator.joint,
            gear=numbers(actuator.ratio),
            gaintype="fixed",
            biastype="affine",
            gainprm="1",
            biasprm="0 0 0",
        )


def add(parent: xml.Element, tag: str, **attributes: str) -> xml.Element:
    """Add an element and return it."""
    return xml.SubElement(parent, tag, dict(attributes))


def numbers(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)
