"""A robot as bodies, joints and shapes for MuJoCo: `Robot` -> MJCF text, and what was assumed.

In: a robot of the catalogue or of a file, the ground, the actuators of its joints. Out: `Bodies`. The XML is
written without MuJoCo, so that anybody can export it.

    leg (left)      body ─ α about z ─ coxa ─ β about y' ─ thigh ─ (spring E' along y') ─ foot part
    The slider mechanism of the leg keeps the foot part vertical: a joint at C turns back what β turns, by an
    equality constraint. A right leg is the mirror image: y' points to the right and α turns about -z.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as xml

import numpy as np

from servogen.errors import InputError
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.leg import Leg
from servogen.kinematics.omni import OmniBase
from servogen.kinematics.statics import GRAVITY
from servogen.motion.loads import MIN_LEGS
from servogen.robot.model import Arm, Mount, Robot
from servogen.twin.chains import CONTACT, STIFF, add_arm, add_omni
from servogen.twin.ground import ROUGH_HALF_M, Ground

STEP_S = 0.001
"""The physics' step."""

ASSUMED_MASS_KG = 0.64
"""Of a six-legged robot whose file states no mass: twelve servos of 17 g, and twice as much for the rest."""

ASSUMED_SHARES = {"coxa": 0.03, "thigh": 0.01, "foot": 0.01}
"""Of the total mass, for each leg: the coxa carries the servo of β."""

FOOT_RADIUS_M = 0.003
BODY_HEIGHT_M = 0.03
LINK_RADIUS_M = 0.006

ROBOT_BITS, GROUND_BITS = {"contype": "1", "conaffinity": "0"}, {"contype": "0", "conaffinity": "1"}
"""Parts of the robot touch the ground, not each other."""


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
class Bodies:
    """MJCF text, and the assumptions behind it, one sentence each."""

    text: str
    assumptions: tuple[str, ...]
    mass: float


@dataclass(frozen=True, slots=True)
class Variation:
    """Deviations of one specimen: the factor of each foot's friction, an offset of the body's centre of mass
    in metres, what an arm's tool carries in kg (None: as the robot's file says).
    """

    foot_friction: tuple[float, ...] = ()
    centre_offset: tuple[float, float] = (0.0, 0.0)
    payload: float | None = None


def bodies(
    robot: Robot,
    actuators: Sequence[Actuator] = (),
    ground: Ground = Ground(),  # noqa: B008 - frozen
    variation: Variation = Variation(),
    step_s: float = STEP_S,
    held_at: float = 0.0,
) -> Bodies:
    """Return a robot as MJCF; one of one or two legs is held with its body at the height `held_at`.

    Raises InputError for a robot that has no model of its bodies.
    """
    root, world = document(robot.name, ground, step_s)
    servos = {each.joint: each for each in actuators}

    def add_joint(
        body: xml.Element, name: str, axis: Sequence[float], lower: float, upper: float, kind: str
    ) -> None:
        _joint(body, name, axis, lower, upper, servos, kind)

    if isinstance(robot, Hexapod):
        assumptions, mass = _hexapod(root, world, robot, actuators, ground, variation, held_at)
    elif isinstance(robot, Arm):
        driven = frozenset(each.joint for each in actuators) if actuators else None
        assumptions, mass = add_arm(root, world, robot, add_joint, driven, variation.payload)
    elif isinstance(robot, OmniBase):
        assumptions, mass = add_omni(root, world, robot, add_joint, ground)
    else:
        raise InputError(
            "wrong-robot-kind",
            f"{robot.name} is of the kind '{robot.kind}': its bodies are not modelled",
            hint="those of arms, hexapods and omni bases are",
        )
    _actuate(root, actuators)
    xml.indent(root)
    return Bodies(xml.tostring(root, encoding="unicode") + "\n", tuple(assumptions), mass)


def document(name: str, ground: Ground, step_s: float = STEP_S) -> tuple[xml.Element, xml.Element]:
    """Return an MJCF document with its options and the ground, and its world."""
    root = xml.Element("mujoco", model=name)
    _add(root, "compiler", angle="radian", autolimits="true")
    gravity = (-GRAVITY * math.sin(ground.slope), 0.0, -GRAVITY * math.cos(ground.slope))
    _add(
        root,
        "option",
        timestep=_numbers(step_s),
        gravity=_numbers(*gravity),
        integrator="implicitfast",
        cone="elliptic",
        impratio="10",
    )
    default = _add(root, "default")
    _add(default, "geom", condim="3", friction="0 0 0", **CONTACT)
    world = _add(root, "worldbody")
    if ground.rough:
        heights = ground.heights()
        asset = _add(root, "asset")
        _add(
            asset,
            "hfield",
            name="rough",
            nrow=str(len(heights)),
            ncol=str(len(heights)),
            size=_numbers(ROUGH_HALF_M, ROUGH_HALF_M, ground.rough, 0.1),
            elevation=" ".join(f"{height:.6g}" for height in (heights / ground.rough).ravel()),
        )
        _add(world, "geom", name="ground", type="hfield", hfield="rough", **GROUND_BITS)
    else:
        _add(world, "geom", name="ground", type="plane", size="0 0 1", **GROUND_BITS)
    if ground.step:
        _add(
            world,
            "geom",
            name="step",
            type="box",
            pos=_numbers(ground.step_at + 2.0, 0.0, ground.step / 2 - 0.5),
            size=_numbers(2.0, 4.0, ground.step / 2 + 0.5),
            **GROUND_BITS,
        )
    return root, world


def _hexapod(
    root: xml.Element,
    world: xml.Element,
    robot: Hexapod,
    actuators: Sequence[Actuator],
    ground: Ground,
    variation: Variation,
    held_at: float,
) -> tuple[list[str], float]:
    """Add the body and its legs; return what was assumed, and the total mass."""
    leg = Leg.of(robot.leg.length)
    assumptions: list[str] = []
    total = robot.mass
    if total is None:
        total = ASSUMED_MASS_KG
        assumptions.append(f"mass of the robot: {total:g} kg assumed (its file states no mass_g)")
    masses = dict(robot.leg_masses)
    missing = [part for part in ASSUMED_SHARES if part not in masses]
    if missing:
        masses |= {part: ASSUMED_SHARES[part] * total for part in missing}
        shown = ", ".join(f"{part} {1000 * masses[part]:.3g} g" for part in missing)
        assumptions.append(f"masses of each leg: {shown} assumed (leg_mass_g)")
    trunk = total - len(robot.mounts) * sum(masses.values())
    if trunk <= 0:
        raise InputError(
            "out-of-range",
            f"the legs of {robot.name} weigh more than its mass_g of {1000 * total:g}",
            hint="leg_mass_g is for each leg, mass_g for the whole robot",
        )
    centre = _trunk_centre(robot, leg, masses, total, trunk) + np.array([*variation.centre_offset, 0.0])
    if robot.spring is None:
        assumptions.append("springs E': rigid (the robot's file states no spring_n_m)")
    held = len(robot.mounts) < MIN_LEGS
    body = _add(world, "body", name="body", pos=_numbers(0.0, 0.0, held_at if held else 0.0))
    if held:
        assumptions.append(f"the body is held at {1000 * held_at:.4g} mm: it has too few legs to stand")
    else:
        _add(body, "freejoint", name="body")
    half = [max(abs(getattr(mount, axis)) for mount in robot.mounts) for axis in ("x", "y")]
    half = [max(value, 0.01) for value in half]
    inertia = [
        trunk / 3 * (one**2 + other**2)
        for one, other in (
            (half[1], BODY_HEIGHT_M / 2),
            (half[0], BODY_HEIGHT_M / 2),
            (half[0], half[1]),
        )
    ]
    _add(body, "inertial", pos=_numbers(*centre), mass=_numbers(trunk), diaginertia=_numbers(*inertia))
    assumptions.append("the body is a homogeneous box around the mounts, links are rods")
    _add(
        body,
        "geom",
        name="body",
        type="box",
        size=_numbers(half[0], half[1], BODY_HEIGHT_M / 2),
        friction=_numbers(ground.friction, 0.0, 0.0),
        mass="0",
        **ROBOT_BITS,
    )
    equality, sensors = _add(root, "equality"), _add(root, "sensor")
    by_joint = {each.joint: each for each in actuators}
    for index, mount in enumerate(robot.mounts):
        factor = variation.foot_friction[index] if variation.foot_friction else 1.0
        _leg(body, equality, robot, leg, mount, by_joint, masses, factor * ground.friction)
        _add(sensors, "touch", name=f"{mount.name}_touch", site=f"{mount.name}_foot")
    return assumptions, total


def _trunk_centre(
    robot: Hexapod, leg: Leg, masses: Mapping[str, float], total: float, trunk: float
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return where the trunk's centre of mass must be for the whole robot's to be where its file says.

    The legs are straight out and down, α = β = 0.
    """
    moment = np.zeros(3)
    middles = {
        "coxa": (leg.ab / 2, 0.0),
        "thigh": (leg.ab, -leg.bc / 2),
        "foot": (leg.r, -leg.bc - leg.df / 2),
    }
    for mount in robot.mounts:
        side = -1.0 if mount.mirrored else 1.0
        for part, (out, height) in middles.items():
            x, y = -math.sin(mount.heading) * side * out, math.cos(mount.heading) * side * out
            moment += masses[part] * np.array([mount.x + x, mount.y + y, mount.z + height])
    return np.asarray((total * np.array(robot.centre_of_mass) - moment) / trunk)


def _leg(
    body: xml.Element,
    equality: xml.Element,
    robot: Hexapod,
    leg: Leg,
    mount: Mount,
    actuators: Mapping[str, Actuator],
    masses: Mapping[str, float],
    friction: float,
) -> None:
    side = -1.0 if mount.mirrored else 1.0
    name = mount.name
    alpha, beta = (f"{name}_{joint.name}" for joint in robot.leg.joints)
    coxa = _add(
        body,
        "body",
        name=f"{name}_coxa",
        pos=_numbers(mount.x, mount.y, mount.z),
        euler=_numbers(0.0, 0.0, mount.heading),
    )
    _joint(coxa, alpha, (0.0, 0.0, side), robot.leg.joints[0].lower, robot.leg.joints[0].upper, actuators)
    _rod(coxa, (0.0, 0.0, 0.0), (0.0, side * leg.ab, 0.0), masses["coxa"])
    thigh = _add(coxa, "body", name=f"{name}_thigh", pos=_numbers(0.0, side * leg.ab, 0.0))
    _joint(thigh, beta, (0.0, 1.0, 0.0), robot.leg.joints[1].lower, robot.leg.joints[1].upper, actuators)
    _rod(thigh, (0.0, 0.0, 0.0), (0.0, 0.0, -leg.bc), masses["thigh"])
    foot = _add(thigh, "body", name=f"{name}_foot", pos=_numbers(0.0, side * leg.cd, -leg.bc))
    _add(foot, "joint", name=f"{name}_level", type="hinge", axis="0 1 0")
    if robot.spring is not None:
        _add(
            foot,
            "joint",
            name=f"{name}_spring",
            type="slide",
            axis=_numbers(0.0, side, 0.0),
            stiffness=_numbers(robot.spring),
            damping=_numbers(2 * SPRING_DAMPING * math.sqrt(robot.spring * masses["foot"])),
        )
    _rod(foot, (0.0, 0.0, 0.0), (0.0, 0.0, -leg.df), masses["foot"])
    tip = (0.0, 0.0, -leg.df + FOOT_RADIUS_M)
    _add(
        foot,
        "geom",
        name=f"{name}_tip",
        type="sphere",
        size=_numbers(FOOT_RADIUS_M),
        pos=_numbers(*tip),
        friction=_numbers(friction, 0.0, 0.0),
        mass="0",
        **ROBOT_BITS,
    )
    _add(foot, "site", name=f"{name}_foot", pos=_numbers(*tip), size=_numbers(2 * FOOT_RADIUS_M))
    _add(equality, "joint", joint1=f"{name}_level", joint2=beta, polycoef="0 -1 0 0 0", **STIFF)


SPRING_DAMPING = 0.5
"""Of critical damping, assumed: a spring of a leg does not ring."""


def _joint(
    body: xml.Element,
    name: str,
    axis: Sequence[float],
    lower: float,
    upper: float,
    actuators: Mapping[str, Actuator],
    kind: str = "hinge",
) -> None:
    """Add a joint that a servo turns; its backlash is a second joint that only its limits hold."""
    servo = actuators.get(name)
    extra: dict[str, str] = {}
    if servo is not None:
        if lower < upper:
            lower, upper = max(lower, servo.lower), min(upper, servo.upper)
        if servo.armature:
            extra["armature"] = _numbers(servo.armature * servo.ratio**2)
        if servo.friction:
            extra["frictionloss"] = _numbers(servo.friction * abs(servo.ratio))
            extra["solreffriction"] = "0.002 1"
            extra["solimpfriction"] = ".9999 .9999 .001"
    limits = {"range": _numbers(lower, upper)} if lower < upper else {}
    _add(
        body,
        "joint",
        name=name,
        type=kind,
        axis=_numbers(*axis),
        solreflimit="0.004 1",
        **limits,
        **extra,
    )
    if servo is not None and servo.backlash:
        half = servo.backlash / abs(servo.ratio) / 2
        _add(
            body,
            "joint",
            name=f"{name}_play",
            type=kind,
            axis=_numbers(*axis),
            range=_numbers(-half, half),
            solreflimit="0.004 1",
        )


def _rod(body: xml.Element, start: Sequence[float], end: Sequence[float], mass: float) -> None:
    """Add a rod with a mass that touches nothing; a rod of no length is a ball."""
    radius = {"size": _numbers(LINK_RADIUS_M), "mass": _numbers(mass)}
    touching = {"contype": "0", "conaffinity": "0"}
    if math.dist(start, end) < 2 * LINK_RADIUS_M:
        middle = [(one + other) / 2 for one, other in zip(start, end, strict=True)]
        _add(body, "geom", type="sphere", pos=_numbers(*middle), **radius, **touching)
    else:
        _add(body, "geom", type="capsule", fromto=_numbers(*start, *end), **radius, **touching)


def _actuate(root: xml.Element, actuators: Sequence[Actuator]) -> None:
    """Add the servos: force = gain · control + bias, set by the motor's constants when it runs."""
    if not actuators:
        return
    found = _add(root, "actuator")
    for each in actuators:
        _add(
            found,
            "general",
            name=each.name,
            joint=each.joint,
            gear=_numbers(each.ratio),
            gaintype="fixed",
            biastype="affine",
            gainprm="1",
            biasprm="0 0 0",
        )


def _add(parent: xml.Element, tag: str, **attributes: str) -> xml.Element:
    """Add an element and return it."""
    return xml.SubElement(parent, tag, dict(attributes))


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)
